// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Saturation in the null space: where a level would take a component past its bound, the component
/// stops there and the others take over the rest of its motion. After Flacco, De Luca, Khatib,
/// *Control of redundant robots under hard joint constraints: saturation in the null space*, IEEE
/// T-RO 2015.
///
///     min ‖w‖² + ‖Δ‖² (1 − s)² / ε   over w, s   with   lower ≤ ρ + s Δ + Q w ≤ upper
///
/// Δ is the level's increment and Q the projector after it: w moves what the level and those above
/// do not need. The published algorithm fixes components one by one, the worst first, and its
/// answer may jump where another becomes the worst. This minimum is unique, so it does not; where
/// the published answer is its minimum, both are the same. ε weighs motion in the null space
/// against the speed of the level: where a component hardly moves in the null space, the level
/// slows down instead of making the others fast. They move by 1/(2 √ε) of its excess at most.
///
/// With μ, a multiplier for each component, x = ρ + Δ + G μ, G = Q Qᵀ + ε Δ Δᵀ / ‖Δ‖²
/// (active_bounds.hpp).
#pragma once

#include "icat/math/active_bounds.hpp"

namespace icat::detail {

/// See the file comment. Construction of dynamic size allocates; nothing else does.
template <class Scalar, int N>
class Redistribution {
 public:
  [[gnu::cold]] explicit Redistribution(Index dof)
      : increment(zeros<Vector<Scalar, N>>(dof)), bounded_(dof), direction_(increment) {}

  /// Computes `increment` from Δ, of which some component leaves the bounds; the factor s. It may
  /// be past a bound still, by rounding or where the steps, 4 n, do not suffice: scale it.
  /// `projector(i, j)` is Q; `lower(i)` and `upper(i)` are bounds that hold ρ.
  template <class Q, class Lower, class Upper>
  [[gnu::cold]] Scalar solve(const Q& projector, const Scalar* rho, const Scalar* delta,
                             Lower lower, Upper upper) noexcept {
    const Index n = increment.size();
    Scalar largest(0), square(0), along(0);
    for (Index i = 0; i < n; ++i) largest = std::max(largest, std::abs(delta[i]));
    for (Index i = 0; i < n; ++i) {
      bounded_.x(i) = rho[i] + delta[i];
      direction_(i) = delta[i] / largest;
      square += direction_(i) * direction_(i);
    }
    form_gains(projector, square);
    bounded_.solve(lower, upper, Scalar(4096) * std::numeric_limits<Scalar>::epsilon() * largest,
                   4 * n);
    for (Index i = 0; i < n; ++i) {
      increment(i) = bounded_.x(i) - rho[i];
      along += direction_(i) * bounded_.multiplier(i);
    }
    return std::clamp(Scalar(1) + epsilon * along / (square * largest), Scalar(0), Scalar(1));
  }

  /// Components held at a bound by the last `solve`.
  Index held() const noexcept { return bounded_.held; }
  /// Components held or let go, at most 4 n.
  Index steps() const noexcept { return bounded_.steps; }

  Vector<Scalar, N> increment;  ///< s Δ + Q w of the last `solve`, n

 private:
  static constexpr Scalar epsilon = Scalar(1) / Scalar(1000);

  template <class Q>
  void form_gains(const Q& projector, Scalar square) noexcept {
    const Index n = increment.size();
    for (Index j = 0; j < n; ++j) {
      for (Index i = 0; i <= j; ++i) {
        Scalar sum = epsilon * direction_(i) * direction_(j) / square;
        for (Index k = 0; k < n; ++k) sum += projector(i, k) * projector(j, k);
        bounded_.gains(i, j) = bounded_.gains(j, i) = sum;
      }
    }
  }

  ActiveBounds<Scalar, N> bounded_;  // its gains are G
  Vector<Scalar, N> direction_;      // of Δ
};

}  // namespace icat::detail
