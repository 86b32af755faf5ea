// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Saturation in the null space: where a level would take a component past its bound, the component
/// stops there and the others take over what it cannot give. After Flacco, De Luca, Khatib,
/// *Control of redundant robots under hard joint constraints: saturation in the null space*, IEEE
/// T-RO 2015.
///
///     min ‖w‖² + ‖Δ‖² (1 − s)² / ε   over w, s   with   lower ≤ ρ + s Δ + Q w ≤ upper
///
/// Δ is the level's increment and Q the projector after it: w moves what the level and those above
/// do not need. The published algorithm fixes components one by one, the worst first, and its
/// answer may jump where another becomes the worst. This minimum is unique, so it does not; where
/// the published answer is its minimum, both are the same. ε weighs motion in the null space
/// against the speed of the level: where a component hardly moves in the null space, the others
/// need not race to hold it, the level slows instead. They move by 1/(2 √ε) of its excess at most.
///
/// With μ, a multiplier for each component, x = ρ + Δ + G μ, G = Q Qᵀ + ε Δ Δᵀ / ‖Δ‖². The dual
/// method of Goldfarb and Idnani (*A numerically stable dual method for solving strictly convex
/// quadratic programs*, 1983) finds the components that are held.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "icat/core/types.hpp"

namespace icat::detail {

/// See the file comment. Construction of dynamic size allocates; nothing else does.
template <class Scalar, int N>
class Redistribution {
 public:
  [[gnu::cold]] explicit Redistribution(Index dof)
      : increment(zeros<Vector<Scalar, N>>(dof)),
        gains_(zeros<Square>(dof, dof)),
        factor_(gains_),
        x_(increment),
        direction_(increment),
        multiplier_(increment),
        step_(increment),
        held_(zeros<Vector<Index, N>>(dof)) {}

  /// Computes `increment` from Δ, of which some component leaves the bounds; the factor s. It may
  /// be past a bound still, by rounding or where the steps, 4 n, do not suffice: scale it.
  /// `projector(i, j)` is Q; `lower(i)` and `upper(i)` are bounds that hold ρ.
  template <class Q, class Lower, class Upper>
  Scalar solve(const Q& projector, const Scalar* rho, const Scalar* delta, Lower lower,
               Upper upper) noexcept {
    const Index n = x_.size();
    Scalar largest(0), square(0), along(0);
    for (Index i = 0; i < n; ++i) largest = std::max(largest, std::abs(delta[i]));
    for (Index i = 0; i < n; ++i) {
      x_(i) = rho[i] + delta[i];
      direction_(i) = delta[i] / largest;
      square += direction_(i) * direction_(i);
      multiplier_(i) = Scalar(0);
    }
    form_gains(projector, square);
    held = steps = 0;
    const Scalar rounding = Scalar(4096) * std::numeric_limits<Scalar>::epsilon() * largest;
    for (bool more = true; more;) {
      // The component that is furthest outside; side +1 above, −1 below.
      Index q = -1;
      Scalar excess = rounding, side(0);
      for (Index i = 0; i < n; ++i) {
        const Scalar above = x_(i) - upper(i), below = lower(i) - x_(i);
        if (!(std::max(above, below) > excess) || is_held(i)) continue;
        q = i;
        excess = std::max(above, below);
        side = above > below ? Scalar(1) : Scalar(-1);
      }
      more = q >= 0 && hold(q, side, excess);
    }
    for (Index i = 0; i < n; ++i) {
      increment(i) = x_(i) - rho[i];
      along += direction_(i) * multiplier_(i);
    }
    return std::clamp(Scalar(1) + epsilon * along / (square * largest), Scalar(0), Scalar(1));
  }

  Vector<Scalar, N> increment;  ///< s Δ + Q w of the last `solve`, n
  Index held{0};                ///< components it holds at a bound
  Index steps{0};               ///< it took: components held or let go, at most 4 n

 private:
  using Square = Eigen::Matrix<Scalar, N, N>;
  static constexpr Scalar epsilon = Scalar(1) / Scalar(1000);

  template <class Q>
  void form_gains(const Q& projector, Scalar square) noexcept {
    const Index n = x_.size();
    for (Index j = 0; j < n; ++j) {
      for (Index i = 0; i <= j; ++i) {
        Scalar sum = epsilon * direction_(i) * direction_(j) / square;
        for (Index k = 0; k < n; ++k) sum += projector(i, k) * projector(j, k);
        gains_(i, j) = gains_(j, i) = sum;
      }
    }
  }

  bool is_held(Index i) const noexcept {
    for (Index k = 0; k < held; ++k) {
      if (held_(k) == i) return true;
    }
    return false;
  }

  /// Takes component `q` back by `excess` and holds it there. Those that are held stay where they
  /// are; one whose multiplier would have to pull it outwards is let go first. False if nothing
  /// moves q, or the steps are used up.
  bool hold(Index q, Scalar side, Scalar excess) noexcept {
    const Index n = x_.size();
    while (steps < 4 * n) {
      ++steps;
      const Scalar gain = solve_held(q);
      const bool moves =
          gain > Scalar(8 * n) * std::numeric_limits<Scalar>::epsilon() * gains_(q, q);
      Scalar t = moves ? excess / gain : infinity<Scalar>;
      Index free = -1;
      for (Index k = 0; k < held; ++k) {
        const Scalar m = multiplier_(held_(k)), change = side * step_(k);
        if (!(m * change < Scalar(0)) || !(std::abs(m) < t * std::abs(change))) continue;
        t = std::abs(m / change);
        free = k;
      }
      if (!moves && free < 0) return false;
      for (Index i = 0; i < n; ++i) {
        Scalar move = gains_(i, q);
        for (Index k = 0; k < held; ++k) move -= gains_(i, held_(k)) * step_(k);
        x_(i) -= t * side * move;
      }
      for (Index k = 0; k < held; ++k) multiplier_(held_(k)) += t * side * step_(k);
      multiplier_(q) -= t * side;
      if (free < 0) {
        held_(held++) = q;
        return true;
      }
      excess -= t * gain;
      multiplier_(held_(free)) = Scalar(0);
      held_(free) = held_(--held);
    }
    return false;
  }

  /// step_ = G_SS⁻¹ G_Sq over the held components S; what is left of G_qq while they stay.
  Scalar solve_held(Index q) noexcept {
    Scalar gain = gains_(q, q);
    for (Index j = 0; j < held; ++j) {  // Cholesky, row by row
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
    for (Index j = held; j-- > 0;) {
      for (Index k = j + 1; k < held; ++k) step_(j) -= factor_(k, j) * step_(k);
      step_(j) /= factor_(j, j);
    }
    return gain;
  }

  Square gains_, factor_;  // G; the Cholesky factor of its part for the held components
  Vector<Scalar, N> x_, direction_, multiplier_, step_;
  Vector<Index, N> held_;
};

}  // namespace icat::detail
