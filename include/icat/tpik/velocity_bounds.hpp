// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Velocity bounds and the saturation `Sat` of [MARIS, Eq. (12)], after Antonelli, Indiveri,
/// Chiaverini, *Prioritized closed-loop inverse kinematic algorithms for redundant robotic systems
/// with velocity saturations*, IROS 2009.
///
///     s = max { s ∈ [0, 1] : lower ≤ ρ + s Δ ≤ upper }
///
/// The increment is scaled as a whole, so its direction and with it the order of priorities stay.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "icat/core/error.hpp"
#include "icat/core/types.hpp"

namespace icat {

/// Bounds on each component of ẏ (rad/s, m/s), `lower ≤ 0 ≤ upper`; infinities leave a component
/// free.
template <class Scalar, int N = Eigen::Dynamic>
struct VelocityBounds {
  /// n, each ≤ 0
  Vector<Scalar, N> lower;
  /// n, each ≥ 0
  Vector<Scalar, N> upper;

  /// Throws `std::invalid_argument` unless both have `dof` components and hold 0 between them.
  void validate(const char* owner, Index dof) const {
    if (lower.size() != dof || upper.size() != dof) {
      detail::invalid(owner, ": velocity bounds have ", lower.size(), " and ", upper.size(),
                      " components, need ", dof);
    }
    for (Index i = 0; i < dof; ++i) {
      if (!(lower(i) <= Scalar(0)) || !(upper(i) >= Scalar(0))) {
        detail::invalid(owner, ": velocity bounds of component ", i, " must hold 0, got [",
                        lower(i), ", ", upper(i), "]");
      }
    }
  }

  /// The factor s above, for `n` components. A component that starts outside may move towards its
  /// bounds only.
  Scalar scale(Index n, const Scalar* rho, const Scalar* delta) const noexcept {
    Scalar s(1), largest(0);
    for (Index i = 0; i < n; ++i) largest = std::max(largest, std::abs(delta[i]));
    // What rounding leaves in a component that a higher level holds at its bound must not stop the
    // whole level; `advance` keeps it on the bound.
    const Scalar rounding = Scalar(4096) * std::numeric_limits<Scalar>::epsilon() * largest;
    for (Index i = 0; i < n; ++i) {
      const Scalar d = delta[i];
      if (std::abs(d) <= rounding) continue;
      const Scalar room = d > Scalar(0) ? upper(i) - rho[i] : lower(i) - rho[i];
      // Compared by multiplication: room / d could overflow for a tiny d.
      if (std::abs(room) >= s * std::abs(d) && (room > Scalar(0)) == (d > Scalar(0))) continue;
      s = (room > Scalar(0)) == (d > Scalar(0)) ? room / d : Scalar(0);
    }
    return s > Scalar(0) ? s : Scalar(0);  // not -0
  }

  /// `rho += s delta`; rounding cannot carry a component past a bound it was inside of.
  void advance(Index n, Scalar* rho, const Scalar* delta, Scalar s) const noexcept {
    for (Index i = 0; i < n; ++i) {
      const Scalar next = rho[i] + s * delta[i];
      rho[i] = std::clamp(next, std::min(lower(i), rho[i]), std::max(upper(i), rho[i]));
    }
  }
};

}  // namespace icat
