// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Eigendecomposition of a symmetric matrix, `S = V diag(d) Vᵀ`, without allocation for any size up
/// to the one given at construction.
///
/// Householder tridiagonalization, then implicit QR steps with Wilkinson's shift (Golub & Van Loan,
/// *Matrix Computations*, 8.3). Eigen's SelfAdjointEigenSolver computes the same, but allocates in
/// every call for a size that is known at run time only.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "icat/core/types.hpp"

namespace icat::detail {

template <class Scalar, int MaxN>
class SymmetricEigen {
 public:
  explicit SymmetricEigen(Index max_size)
      : vectors_(max_size, max_size), values_(max_size), sub_(max_size), work_(max_size) {}

  /// Decomposes the symmetric `s` (k × k, k at most the size of the construction).
  /// False if the iteration did not converge, as for overflowing input.
  template <class S>
  bool compute(const S& s) noexcept {
    const Index n = size_ = s.rows();
    Scalar scale(0);
    bool good = true;
    for (Index j = 0; j < n; ++j) {
      for (Index i = 0; i < n; ++i) {
        scale = std::max(scale, std::abs(s(i, j)));
        good &= std::isfinite(s(i, j));
      }
    }
    if (!good) return false;
    // Keeps the squares below away from overflow and underflow.
    const Scalar divisor = scale == Scalar(0) ? Scalar(1) : scale;
    for (Index j = 0; j < n; ++j) {
      for (Index i = 0; i < n; ++i) vectors_(i, j) = s(i, j) / divisor;
    }
    tridiagonalize();
    if (!diagonalize()) return false;
    for (Index i = 0; i < n; ++i) values_(i) *= scale;
    return true;
  }

  /// Eigenvalues, unordered, and the matrix whose columns are the eigenvectors: the first k rows
  /// and columns count.
  const Eigen::Matrix<Scalar, MaxN, 1>& values() const noexcept { return values_; }
  const Eigen::Matrix<Scalar, MaxN, MaxN>& vectors() const noexcept { return vectors_; }

 private:
  using Square = Eigen::Matrix<Scalar, MaxN, MaxN>;
  using Column = Eigen::Matrix<Scalar, MaxN, 1>;

  void tridiagonalize() noexcept {
    const Index n = size_;
    auto& v = vectors_;
    // Reflector j annihilates column j below the subdiagonal; its essential part stays there.
    for (Index j = 0; j + 2 < n; ++j) {
      Scalar tail(0);
      for (Index i = j + 2; i < n; ++i) tail += v(i, j) * v(i, j);
      const Scalar first = v(j + 1, j);
      Scalar tau(0), beta = first;
      if (tail > std::numeric_limits<Scalar>::min()) {
        beta =
            first >= Scalar(0) ? -std::sqrt(first * first + tail) : std::sqrt(first * first + tail);
        for (Index i = j + 2; i < n; ++i) v(i, j) /= first - beta;
        tau = (beta - first) / beta;
      }
      v(j + 1, j) = Scalar(1);
      sub_(j) = beta;
      values_(j) = tau;  // Until the diagonal is read below.
      if (tau == Scalar(0)) continue;
      // rest ← rest − p xᵀ − x pᵀ
      Scalar px(0);
      for (Index i = j + 1; i < n; ++i) {
        Scalar sum(0);
        for (Index c = j + 1; c < n; ++c) sum += v(i, c) * v(c, j);
        work_(i) = tau * sum;
        px += work_(i) * v(i, j);
      }
      for (Index i = j + 1; i < n; ++i) work_(i) -= tau / Scalar(2) * px * v(i, j);
      for (Index c = j + 1; c < n; ++c) {
        for (Index i = j + 1; i < n; ++i) v(i, c) -= work_(c) * v(i, j) + v(c, j) * work_(i);
      }
    }
    if (n >= 2) sub_(n - 2) = v(n - 1, n - 2);
    // Accumulate the reflectors from the last to the first; diagonals are saved before the
    // matrix is overwritten.
    for (Index j = 0; j < n; ++j) work_(j) = v(j, j);
    for (Index j = n - 1; j >= 0; --j) {
      if (j + 2 < n && values_(j) != Scalar(0)) {
        for (Index c = j + 1; c < n; ++c) {
          Scalar sum(0);
          for (Index i = j + 1; i < n; ++i) sum += v(i, j) * v(i, c);
          for (Index i = j + 1; i < n; ++i) v(i, c) -= values_(j) * sum * v(i, j);
        }
      }
      for (Index i = j; i < n; ++i) v(i, j) = v(j, i) = Scalar(0);
      v(j, j) = Scalar(1);
    }
    for (Index j = 0; j < n; ++j) values_(j) = work_(j);
  }

  bool diagonalize() noexcept {
    constexpr Scalar eps = std::numeric_limits<Scalar>::epsilon();
    constexpr Scalar tiny = std::numeric_limits<Scalar>::min();
    // LAPACK's bound: 30 steps for each eigenvalue; about 1.7 are needed.
    Index steps_left = 30 * size_;
    Index end = size_ - 1;
    while (end > 0) {
      for (Index i = 0; i < end; ++i) {
        if (std::abs(sub_(i)) <= eps * (std::abs(values_(i)) + std::abs(values_(i + 1))) + tiny) {
          sub_(i) = Scalar(0);
        }
      }
      if (sub_(end - 1) == Scalar(0)) {
        --end;
        continue;
      }
      if (steps_left-- == 0) return false;
      Index start = end - 1;
      while (start > 0 && sub_(start - 1) != Scalar(0)) --start;
      qr_step(start, end);
    }
    bool good = true;
    for (Index i = 0; i < size_; ++i) good &= std::isfinite(values_(i));
    return good;
  }

  void qr_step(Index start, Index end) noexcept {
    const Scalar half = (values_(end - 1) - values_(end)) / Scalar(2);
    const Scalar e = sub_(end - 1);
    const Scalar h = std::hypot(half, e);
    const Scalar shift = values_(end) - e * (e / (half + (half >= Scalar(0) ? h : -h)));
    Scalar x = values_(start) - shift;
    Scalar z = sub_(start);
    for (Index k = start; k < end && z != Scalar(0); ++k) {
      const Scalar r = std::hypot(x, z);
      const Scalar c = x / r;
      const Scalar s = z / r;
      const Scalar dk = values_(k), dk1 = values_(k + 1), ek = sub_(k);
      const Scalar w = s * (dk - dk1) - Scalar(2) * c * ek;
      values_(k) = dk - s * w;
      values_(k + 1) = dk1 + s * w;
      sub_(k) = -c * w - ek;
      if (k > start) sub_(k - 1) = r;
      x = sub_(k);
      if (k + 1 < end) {
        z = s * sub_(k + 1);
        sub_(k + 1) *= c;
      }
      for (Index i = 0; i < size_; ++i) {
        const Scalar a = vectors_(i, k), b = vectors_(i, k + 1);
        vectors_(i, k) = c * a + s * b;
        vectors_(i, k + 1) = c * b - s * a;
      }
    }
  }

  Square vectors_;
  Column values_, sub_, work_;
  Index size_{0};
};

}  // namespace icat::detail
