// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The part of a vector that a matrix can make: its orthogonal projection on the range, by
/// Gram–Schmidt on the largest column left (Golub & Van Loan, *Matrix Computations*, 5.4). Columns
/// below √ε of the largest count as zero.
#pragma once

#include <cmath>
#include <limits>

#include "icat/core/types.hpp"

namespace icat::detail {

/// For matrices up to a size given. Construction allocates; nothing else does.
template <class Scalar>
class RangeProjection {
 public:
  [[gnu::cold]] RangeProjection(Index rows, Index cols) : columns_(rows, cols) {}

  /// Element (i, j) of the matrix: all are to be set before each `project`.
  Scalar& operator()(Index i, Index j) noexcept { return columns_(i, j); }

  /// `out` becomes the part of `x` (both `rows` long) in the range of the first `rows` rows, which
  /// are used up.
  [[gnu::noinline]] void project(Index rows, const Scalar* x, Scalar* out) noexcept {
    const Scalar rounding = std::sqrt(std::numeric_limits<Scalar>::epsilon());
    const Index n = columns_.cols();
    Scalar largest(0);
    for (Index i = 0; i < rows; ++i) out[i] = Scalar(0);
    for (Index rank = 0; rank < rows && rank < n; ++rank) {
      Index pivot = rank;
      Scalar length(0);
      for (Index j = rank; j < n; ++j) {
        const Scalar l = std::sqrt(dot(rows, column(j), column(j)));
        if (l > length) length = l, pivot = j;
      }
      if (rank == 0) largest = length;
      if (!(length > rounding * largest)) return;
      for (Index i = 0; i < rows; ++i) {
        const Scalar q = columns_(i, pivot) / length;
        columns_(i, pivot) = columns_(i, rank);
        columns_(i, rank) = q;
      }
      const Scalar* q = column(rank);
      const Scalar along = dot(rows, q, x);
      for (Index i = 0; i < rows; ++i) out[i] += along * q[i];
      for (Index j = rank + 1; j < n; ++j) {
        for (int pass = 0; pass < 2; ++pass) {  // the second takes what rounding left
          const Scalar part = dot(rows, q, column(j));
          for (Index i = 0; i < rows; ++i) columns_(i, j) -= part * q[i];
        }
      }
    }
  }

 private:
  const Scalar* column(Index j) const noexcept { return columns_.data() + j * columns_.rows(); }
  static Scalar dot(Index rows, const Scalar* x, const Scalar* y) noexcept {
    Scalar sum(0);
    for (Index i = 0; i < rows; ++i) sum += x[i] * y[i];
    return sum;
  }

  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> columns_;
};

}  // namespace icat::detail
