// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The shortest vector with given products and bounds:
///
///     min ‖x‖²   with   A x = a,   lower ≤ x ≤ upper
///
/// It is unique, since ‖x‖² is strictly convex, and it is Lipschitz continuous in a wherever there
/// is a solution: bounds and rows are linear, their right sides alone change.
///
/// With rows E that are orthonormal and span those of A, x = x₀ + Q μ, where x₀ = A⁺ a, Q = I −
/// Eᵀ E, and μ is a multiplier for each component. The dual method of Goldfarb and Idnani (*A
/// numerically stable dual method for solving strictly convex quadratic programs*, 1983) finds the
/// components that are held at a bound; redistribution.hpp uses it for velocities.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "icat/core/types.hpp"

namespace icat::detail {

/// See the file comment; at most six rows. Construction of dynamic size allocates; nothing else
/// does.
template <class Scalar, int N>
class BoundedLeastNorm {
 public:
  [[gnu::cold]] explicit BoundedLeastNorm(Index n)
      : x(zeros<Vector<Scalar, N>>(n)),
        basis_(zeros<Eigen::Matrix<Scalar, 6, N>>(6, n)),
        factor_rows_(zeros<Matrix6<Scalar>>(6, 6)),
        gains_(zeros<Square>(n, n)),
        factor_(gains_),
        multiplier_(x),
        step_(x),
        held_(zeros<Vector<Index, N>>(n)) {
    set_identity(gains_);
  }

  /// Forgets the rows.
  void clear() noexcept {
    rows_ = 0;
    set_identity(gains_);
  }

  /// Adds a row of A, n numbers. False, and nothing added, if those before it determine its
  /// product.
  bool add_row(const Scalar* row) noexcept {
    const Index n = x.size();
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
      for (Index i = 0; i < n; ++i) gains_(i, j) -= basis_(rows_, i) * basis_(rows_, j);
    }
    ++rows_;
    return true;
  }

  /// Computes `x` for the products `a` of the rows that were added. It is inside the bounds
  /// whatever happens; A x differs from `a` by rounding, or by what is missing if there is no
  /// solution.
  void solve(const Scalar* a, const Scalar* lower, const Scalar* upper) noexcept {
    const Index n = x.size();
    Scalar y[6], largest(0);
    for (Index j = 0; j < rows_; ++j) {
      y[j] = a[j];
      for (Index k = 0; k < j; ++k) y[j] -= factor_rows_(j, k) * y[k];
      y[j] /= factor_rows_(j, j);
    }
    for (Index i = 0; i < n; ++i) {
      x(i) = multiplier_(i) = Scalar(0);
      for (Index j = 0; j < rows_; ++j) x(i) += basis_(j, i) * y[j];
      largest = std::max({largest, -lower[i], upper[i]});
    }
    held_count_ = steps_ = 0;
    const Scalar rounding = Scalar(64) * std::numeric_limits<Scalar>::epsilon() * largest;
    for (bool more = true; more;) {
      Index q = -1;  // the component that is furthest outside; side +1 above, −1 below
      Scalar excess = rounding, side(0);
      for (Index i = 0; i < n; ++i) {
        const Scalar above = x(i) - upper[i], below = lower[i] - x(i);
        if (!(std::max(above, below) > excess) || is_held(i)) continue;
        q = i;
        excess = std::max(above, below);
        side = above > below ? Scalar(1) : Scalar(-1);
      }
      more = q >= 0 && hold(q, side, excess);
    }
    for (Index i = 0; i < n; ++i) x(i) = std::min(std::max(x(i), lower[i]), upper[i]);
  }

  /// Components held or let go by the last `solve`, at most 6 n.
  Index steps() const noexcept { return steps_; }

  Vector<Scalar, N> x;  ///< the answer, n

 private:
  using Square = Eigen::Matrix<Scalar, N, N>;

  bool is_held(Index i) const noexcept {
    for (Index k = 0; k < held_count_; ++k) {
      if (held_(k) == i) return true;
    }
    return false;
  }

  /// Takes component `q` back by `excess` and holds it there; one whose multiplier would have to
  /// pull it outwards is let go first. False if nothing moves q, or the steps are used up.
  bool hold(Index q, Scalar side, Scalar excess) noexcept {
    const Index n = x.size();
    while (steps_ < 6 * n) {
      ++steps_;
      const Scalar gain = solve_held(q);
      const bool moves = gain > Scalar(8 * n) * std::numeric_limits<Scalar>::epsilon();
      Scalar t = moves ? excess / gain : infinity<Scalar>;
      Index free = -1;
      for (Index k = 0; k < held_count_; ++k) {
        const Scalar m = multiplier_(held_(k)), change = side * step_(k);
        if (!(m * change < Scalar(0)) || !(std::abs(m) < t * std::abs(change))) continue;
        t = std::abs(m / change);
        free = k;
      }
      if (!moves && free < 0) return false;
      for (Index i = 0; moves && i < n; ++i) {
        Scalar move = gains_(i, q);
        for (Index k = 0; k < held_count_; ++k) move -= gains_(i, held_(k)) * step_(k);
        x(i) -= t * side * move;
      }
      for (Index k = 0; k < held_count_; ++k) multiplier_(held_(k)) += t * side * step_(k);
      multiplier_(q) -= t * side;
      if (free < 0) {
        held_(held_count_++) = q;
        return true;
      }
      if (moves) excess -= t * gain;
      multiplier_(held_(free)) = Scalar(0);
      held_(free) = held_(--held_count_);
    }
    return false;
  }

  /// step_ = Q_SS⁻¹ Q_Sq over the held components S; what is left of Q_qq while they stay.
  Scalar solve_held(Index q) noexcept {
    Scalar gain = gains_(q, q);
    for (Index j = 0; j < held_count_; ++j) {  // Cholesky, row by row
      Scalar right = gains_(held_(j), q);
      for (Index i = 0; i <= j; ++i) {
        Scalar sum = gains_(held_(j), held_(i));
        for (Index k = 0; k < i; ++k) sum -= factor_(j, k) * factor_(i, k);
        factor_(j, i) = i < j ? sum / factor_(i, i)
                              : std::sqrt(std::max(sum, std::numeric_limits<Scalar>::min()));
      }
      for (Index k = 0; k < j; ++k) right -= factor_(j, k) * step_(k);
      step_(j) = right / factor_(j, j);
      gain -= step_(j) * step_(j);
    }
    for (Index j = held_count_; j-- > 0;) {
      for (Index k = j + 1; k < held_count_; ++k) step_(j) -= factor_(k, j) * step_(k);
      step_(j) /= factor_(j, j);
    }
    return gain;
  }

  Eigen::Matrix<Scalar, 6, N> basis_;  // E
  Matrix6<Scalar> factor_rows_;        // A = factor_rows_ E, lower triangular
  Square gains_, factor_;              // Q; the Cholesky factor of its part for those held
  Vector<Scalar, N> multiplier_, step_;
  Vector<Index, N> held_;
  Index rows_{0}, held_count_{0}, steps_{0};
};

}  // namespace icat::detail
