// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Eigendecomposition of a symmetric matrix, `S = V diag(d) Vᵀ`, without allocation for any size up
/// to the one given at construction.
///
/// Householder tridiagonalization, then implicit QR steps with Wilkinson's shift (Golub & Van Loan,
/// *Matrix Computations*, 8.3). Eigen's SelfAdjointEigenSolver computes the same, but allocates in
/// every call for a size that is known at run time only.
#pragma once

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
  template <class Derived>
  bool compute(const Eigen::MatrixBase<Derived>& s) noexcept {
    size_ = s.rows();
    auto v = vectors_.topLeftCorner(size_, size_);
    v = s;
    const Scalar scale = v.cwiseAbs().maxCoeff();
    if (!(scale <= std::numeric_limits<Scalar>::max())) return false;
    if (scale == Scalar(0)) {
      v.setIdentity();
      values_.head(size_).setZero();
      return true;
    }
    v /= scale;  // Keeps the squares below away from overflow and underflow.
    tridiagonalize();
    if (!diagonalize()) return false;
    values_.head(size_) *= scale;
    return true;
  }

  /// Eigenvalues, unordered, and the matrix whose columns are the eigenvectors.
  auto values() const noexcept { return values_.head(size_); }
  auto vectors() const noexcept { return vectors_.topLeftCorner(size_, size_); }

 private:
  using Square = Eigen::Matrix<Scalar, MaxN, MaxN>;
  using Column = Eigen::Matrix<Scalar, MaxN, 1>;

  void tridiagonalize() noexcept {
    const Index n = size_;
    // Reflector j annihilates column j below the subdiagonal; its essential part stays there.
    for (Index j = 0; j + 2 < n; ++j) {
      const Index m = n - j - 1;
      auto x = vectors_.col(j).segment(j + 1, m);
      const Scalar tail = x.tail(m - 1).squaredNorm();
      Scalar tau(0), beta = x(0);
      if (tail > std::numeric_limits<Scalar>::min()) {
        beta = x(0) >= Scalar(0) ? -std::sqrt(x(0) * x(0) + tail) : std::sqrt(x(0) * x(0) + tail);
        x.tail(m - 1) /= x(0) - beta;
        tau = (beta - x(0)) / beta;
      }
      x(0) = Scalar(1);
      sub_(j) = beta;
      values_(j) = tau;  // Until the diagonal is read below.
      if (tau == Scalar(0)) continue;
      auto rest = vectors_.block(j + 1, j + 1, m, m);
      auto p = work_.head(m);
      p = x(0) * rest.col(0);
      for (Index c = 1; c < m; ++c) p += x(c) * rest.col(c);
      p *= tau;
      p -= (tau / Scalar(2) * p.dot(x)) * x;
      for (Index c = 0; c < m; ++c) rest.col(c) -= p(c) * x + x(c) * p;
    }
    if (n >= 2) sub_(n - 2) = vectors_(n - 1, n - 2);
    // Accumulate the reflectors from the last to the first; diagonals are saved before the
    // matrix is overwritten.
    for (Index j = 0; j < n; ++j) work_(j) = vectors_(j, j);
    for (Index j = n - 1; j >= 0; --j) {
      const Index m = n - j - 1;
      if (j + 2 >= n) {
        vectors_.col(j).segment(j, m + 1).setZero();
        vectors_.row(j).segment(j, m + 1).setZero();
        vectors_(j, j) = Scalar(1);
        continue;
      }
      auto block = vectors_.block(j + 1, j + 1, m, m);
      auto x = vectors_.col(j).segment(j + 1, m);
      if (values_(j) != Scalar(0)) {
        for (Index c = 0; c < m; ++c) block.col(c) -= (values_(j) * x.dot(block.col(c))) * x;
      }
      x.setZero();
      vectors_.row(j).segment(j, m + 1).setZero();
      vectors_(j, j) = Scalar(1);
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
    return values_.head(size_).allFinite();
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
      rotate(vectors_.col(k).head(size_), vectors_.col(k + 1).head(size_), c, s);
    }
  }

  /// (a, b) ← (c a + s b, c b − s a)
  template <class A, class B>
  static void rotate(A&& a, B&& b, Scalar c, Scalar s) noexcept {
    for (Index i = 0; i < a.size(); ++i) {
      const Scalar ai = a(i), bi = b(i);
      a(i) = c * ai + s * bi;
      b(i) = c * bi - s * ai;
    }
  }

  Square vectors_;
  Column values_, sub_, work_;
  Index size_{0};
};

}  // namespace icat::detail
