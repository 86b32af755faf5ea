// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Bounds on the minimum of a quadratic: of all x = x₀ + G μ with lower ≤ x ≤ upper the one where
/// μᵢ is zero unless xᵢ is at a bound, and pulls inwards there. G is positive semi-definite. It is
/// the minimum of ‖y‖² for x = x₀ + F y, G = F Fᵀ, and unique.
///
/// The dual method of Goldfarb and Idnani (*A numerically stable dual method for solving strictly
/// convex quadratic programs*, 1983) finds the components that are held at a bound: the one that is
/// furthest outside is taken back and held; one whose multiplier would have to pull it outwards for
/// that is let go first.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "icat/core/types.hpp"

namespace icat::detail {

/// Of `n` components. Construction of dynamic size allocates; nothing else does.
template <class Scalar, int N>
class ActiveBounds {
 public:
  [[gnu::cold]] explicit ActiveBounds(Index n)
      : gains(zeros<Square>(n, n)),
        x(zeros<Vector<Scalar, N>>(n)),
        multiplier(x),
        factor_(gains),
        step_(x),
        held_(zeros<Vector<Index, N>>(n)) {}

  /// Takes `x` from x₀ to the answer, or as far as `most_steps` suffice. `lower(i)` and `upper(i)`
  /// are the bounds; what passes one by no more than `rounding` stays. A component moves where that
  /// is more than rounding of its own gain, and of `least_gain`.
  template <class Lower, class Upper>
  void solve(Lower lower, Upper upper, Scalar rounding, Index most_steps,
             Scalar least_gain = Scalar(0)) noexcept {
    held = steps = 0;
    fill(multiplier, Scalar(0));
    for (bool more = true; more;) {
      // The component that is furthest outside; side +1 above, −1 below.
      Index q = -1;
      Scalar excess = rounding, side(0);
      for (Index i = 0; i < x.size(); ++i) {
        const Scalar above = x(i) - upper(i), below = lower(i) - x(i);
        if (!(std::max(above, below) > excess) || is_held(i)) continue;
        q = i;
        excess = std::max(above, below);
        side = above > below ? Scalar(1) : Scalar(-1);
      }
      more = q >= 0 && hold(q, side, excess, most_steps, least_gain);
    }
  }

  Eigen::Matrix<Scalar, N, N> gains;  ///< G, n × n
  Vector<Scalar, N> x, multiplier;    ///< x₀, then x; μ
  Index held{0};                      ///< components at a bound
  Index steps{0};                     ///< that it took: components held or let go

 private:
  using Square = Eigen::Matrix<Scalar, N, N>;

  bool is_held(Index i) const noexcept {
    for (Index k = 0; k < held; ++k) {
      if (held_(k) == i) return true;
    }
    return false;
  }

  /// Takes component `q` back by `excess` and holds it there; those that are held stay where they
  /// are. False if nothing moves q, or the steps are used up.
  [[gnu::cold]] bool hold(Index q, Scalar side, Scalar excess, Index most_steps,
                          Scalar least_gain) noexcept {
    const Index n = x.size();
    while (steps < most_steps) {
      ++steps;
      const Scalar gain = solve_held(q);
      const bool moves = gain > Scalar(8 * n) * std::numeric_limits<Scalar>::epsilon() *
                                    std::max(gains(q, q), least_gain);
      Scalar t = moves ? excess / gain : infinity<Scalar>;
      Index free = -1;
      for (Index k = 0; k < held; ++k) {
        const Scalar m = multiplier(held_(k)), change = side * step_(k);
        if (!(m * change < Scalar(0)) || !(std::abs(m) < t * std::abs(change))) continue;
        t = std::abs(m / change);
        free = k;
      }
      if (!moves && free < 0) return false;
      for (Index i = 0; moves && i < n; ++i) {
        Scalar move = gains(i, q);
        for (Index k = 0; k < held; ++k) move -= gains(i, held_(k)) * step_(k);
        x(i) -= t * side * move;
      }
      for (Index k = 0; k < held; ++k) multiplier(held_(k)) += t * side * step_(k);
      multiplier(q) -= t * side;
      if (free < 0) {
        held_(held++) = q;
        return true;
      }
      if (moves) excess -= t * gain;
      multiplier(held_(free)) = Scalar(0);
      held_(free) = held_(--held);
    }
    return false;
  }

  /// step_ = G_SS⁻¹ G_Sq over the held components S; what is left of G_qq while they stay.
  [[gnu::cold]] Scalar solve_held(Index q) noexcept {
    Scalar gain = gains(q, q);
    for (Index j = 0; j < held; ++j) {  // Cholesky, row by row
      Scalar right = gains(held_(j), q);
      for (Index i = 0; i <= j; ++i) {
        Scalar sum = gains(held_(j), held_(i));
        for (Index k = 0; k < i; ++k) sum -= factor_(j, k) * factor_(i, k);
        factor_(j, i) = i < j ? sum / factor_(i, i)
                              : std::sqrt(std::max(sum, std::numeric_limits<Scalar>::min()));
      }
      for (Index k = 0; k < j; ++k) right -= factor_(j, k) * step_(k);
      step_(j) = right / factor_(j, j);
      gain -= step_(j) * step_(j);
    }
    for (Index j = held; j-- > 0;) {
      for (Index k = j + 1; k < held; ++k) step_(j) -= factor_(k, j) * step_(k);
      step_(j) /= factor_(j, j);
    }
    return gain;
  }

  Square factor_;  // the Cholesky factor of G's part for the held components
  Vector<Scalar, N> step_;
  Vector<Index, N> held_;
};

}  // namespace icat::detail
