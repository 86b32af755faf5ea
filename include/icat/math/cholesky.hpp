// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Cholesky factor of a small symmetric positive matrix, and the two halves of a solution.
///
///     A = L Lᵀ,   L y = b,   Lᵀ x = y
///
/// At these sizes plain loops over rows beat Eigen's blocked code, and a right-hand side kept by
/// rows is a few packets wide.
#pragma once

#include <cmath>

#include "icat/core/types.hpp"

namespace icat::detail {

/// `N` × `N`, known at compile time. Nothing allocates.
template <class Scalar, int N>
class Cholesky {
 public:
  /// Right-hand sides and solutions: `N` × `Columns`, by rows where there are several.
  template <int Columns>
  using Rows = Eigen::Matrix<Scalar, N, Columns, Columns == 1 ? Eigen::ColMajor : Eigen::RowMajor>;

  /// Factors `A`, of which the lower triangle is read. False if `A` is not positive or not finite;
  /// then nothing else may be called.
  template <class Derived>
  bool compute(const Eigen::MatrixBase<Derived>& A) noexcept {
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < i; ++j) {
        Scalar sum = A(i, j);
        for (int k = 0; k < j; ++k) sum -= L_(i, k) * L_(j, k);
        L_(i, j) = sum * inverse_diagonal_(j);
      }
      Scalar pivot = A(i, i);
      for (int k = 0; k < i; ++k) pivot -= L_(i, k) * L_(i, k);
      if (!(pivot > Scalar(0)) || !std::isfinite(pivot)) return false;
      inverse_diagonal_(i) = Scalar(1) / std::sqrt(pivot);
    }
    return true;
  }

  /// b ← L⁻¹ b.
  template <class Rhs>
  void solve_lower(Rhs& b) const noexcept {
    for (int i = 0; i < N; ++i) {
      for (int k = 0; k < i; ++k) b.row(i) -= L_(i, k) * b.row(k);
      b.row(i) *= inverse_diagonal_(i);
    }
  }

  /// b ← L⁻ᵀ b.
  template <class Rhs>
  void solve_upper(Rhs& b) const noexcept {
    for (int i = N - 1; i >= 0; --i) {
      b.row(i) *= inverse_diagonal_(i);
      for (int k = 0; k < i; ++k) b.row(k) -= L_(i, k) * b.row(i);
    }
  }

  /// b ← A⁻¹ b.
  template <class Rhs>
  void solve(Rhs& b) const noexcept {
    solve_lower(b);
    solve_upper(b);
  }

 private:
  Eigen::Matrix<Scalar, N, N, Eigen::RowMajor> L_;  // below the diagonal
  Vector<Scalar, N> inverse_diagonal_;
};

}  // namespace icat::detail
