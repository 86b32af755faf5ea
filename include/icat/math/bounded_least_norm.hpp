// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The shortest vector with given products and bounds:
///
///     min ‖x‖²   with   A x = a,   lower ≤ x ≤ upper
///
/// It is unique, since ‖x‖² is strictly convex, and it is Lipschitz continuous in a wherever there
/// is a solution: bounds and rows are linear, their right sides alone change.
///
/// With rows E that are orthonormal and span those of A, x = x₀ + Q μ, where x₀ = A⁺ a and
/// Q = I − Eᵀ E (active_bounds.hpp).
#pragma once

#include "icat/math/active_bounds.hpp"

namespace icat::detail {

/// See the file comment; at most six rows. Construction of dynamic size allocates; nothing else
/// does.
template <class Scalar, int N>
class BoundedLeastNorm {
 public:
  [[gnu::cold]] explicit BoundedLeastNorm(Index n)
      : basis_(zeros<Eigen::Matrix<Scalar, 6, N>>(6, n)),
        factor_rows_(zeros<Matrix6<Scalar>>(6, 6)),
        bounded_(n) {
    clear();
  }

  /// Forgets the rows.
  void clear() noexcept {
    rows_ = 0;
    set_identity(bounded_.gains);
  }

  /// Adds a row of A, n numbers. False, and nothing added, if those before it determine its
  /// product.
  bool add_row(const Scalar* row) noexcept {
    const Index n = bounded_.x.size();
    Scalar square(0), left(0);
    for (Index i = 0; i < n; ++i) square += row[i] * row[i];
    for (Index k = 0; k < 6; ++k) factor_rows_(rows_, k) = Scalar(0);
    for (Index i = 0; i < n; ++i) basis_(rows_, i) = row[i];
    for (int pass = 0; pass < 2; ++pass) {  // twice is enough for orthogonality to rounding
      for (Index k = 0; k < rows_; ++k) {
        Scalar along(0);
        for (Index i = 0; i < n; ++i) along += basis_(k, i) * basis_(rows_, i);
        for (Index i = 0; i < n; ++i) basis_(rows_, i) -= along * basis_(k, i);
        factor_rows_(rows_, k) += along;
      }
    }
    for (Index i = 0; i < n; ++i) left += basis_(rows_, i) * basis_(rows_, i);
    if (!(left > std::numeric_limits<Scalar>::epsilon() * square)) return false;
    const Scalar norm = std::sqrt(left);
    factor_rows_(rows_, rows_) = norm;
    for (Index i = 0; i < n; ++i) basis_(rows_, i) /= norm;
    for (Index j = 0; j < n; ++j) {
      for (Index i = 0; i < n; ++i) {
        bounded_.gains(i, j) -= basis_(rows_, i) * basis_(rows_, j);
      }
    }
    ++rows_;
    return true;
  }

  /// Computes `x` for the products `a` of the rows that were added. It is inside the bounds
  /// whatever happens; A x differs from `a` by rounding, or by what is missing if there is no
  /// solution.
  void solve(const Scalar* a, const Scalar* lower, const Scalar* upper) noexcept {
    Vector<Scalar, N>& x = bounded_.x;
    Scalar y[6], largest(0);
    for (Index j = 0; j < rows_; ++j) {
      y[j] = a[j];
      for (Index k = 0; k < j; ++k) y[j] -= factor_rows_(j, k) * y[k];
      y[j] /= factor_rows_(j, j);
    }
    for (Index i = 0; i < x.size(); ++i) {
      x(i) = Scalar(0);
      for (Index j = 0; j < rows_; ++j) x(i) += basis_(j, i) * y[j];
      largest = std::max({largest, -lower[i], upper[i]});
    }
    // Gains are at most 1; those of components that the rows determine are rounding.
    bounded_.solve([&](Index i) { return lower[i]; }, [&](Index i) { return upper[i]; },
                   Scalar(64) * std::numeric_limits<Scalar>::epsilon() * largest, 6 * x.size(),
                   Scalar(1));
    for (Index i = 0; i < x.size(); ++i) x(i) = std::min(std::max(x(i), lower[i]), upper[i]);
  }

  /// The answer, n. Before `solve` it is free, as scratch.
  Vector<Scalar, N>& x() noexcept { return bounded_.x; }
  const Vector<Scalar, N>& x() const noexcept { return bounded_.x; }

 private:
  Eigen::Matrix<Scalar, 6, N> basis_;  // E
  Matrix6<Scalar> factor_rows_;        // A = factor_rows_ E, lower triangular
  ActiveBounds<Scalar, N> bounded_;    // its gains are Q
  Index rows_{0};
};

}  // namespace icat::detail
