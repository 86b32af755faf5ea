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
#include "icat/core/status.hpp"
#include "icat/core/types.hpp"

namespace icat {

/// What happens to a level whose increment would take a component past its bound.
enum class Saturation {
  /// As published: the increment is scaled as a whole. Where a level above has left a component at
  /// its bound, a level that begins to push on it stops at once: ẏ jumps.
  scale,
  /// The same, continuous: level k of a hierarchy, from 1, may use the share 1 − 0.05 / (k + 1) of
  /// the bounds, the closing level all. So every level finds room; an inactive one keeps its place.
  continuous_scale,
  /// With the room of `continuous_scale`, the component stops at its bound and others take over in
  /// the null space of the level; what they cannot is scaled. See redistribution.hpp.
  redistribute
};

/// Bounds on each component of ẏ (rad/s, m/s), `lower ≤ 0 ≤ upper`; infinities leave a component
/// free. By default all are free; of dynamic size a side is then empty, and read as infinite.
template <class Scalar, int N = Eigen::Dynamic>
struct VelocityBounds {
  /// n, each ≤ 0
  Vector<Scalar, N> lower = Filled{-infinity<double>};
  /// n, each ≥ 0
  Vector<Scalar, N> upper = Filled{infinity<double>};

  /// Of component `i`, −∞ where `lower` is empty.
  Scalar lower_of(Index i) const noexcept {
    return lower.size() > 0 ? lower(i) : -infinity<Scalar>;
  }
  /// Of component `i`, ∞ where `upper` is empty.
  Scalar upper_of(Index i) const noexcept { return upper.size() > 0 ? upper(i) : infinity<Scalar>; }

  /// `wrong_size` unless each side is empty or has `dof` components, `non_finite` for NaN,
  /// `out_of_range` where 0 is not between them. No allocation.
  [[gnu::noinline]] Status check(Index dof) const noexcept {
    if (!sized(lower, dof) || !sized(upper, dof)) return Status::wrong_size;
    Status status = Status::ok;
    for (Index i = 0; i < dof; ++i) {
      const Scalar least = lower_of(i), most = upper_of(i);
      if (std::isnan(least) || std::isnan(most)) return Status::non_finite;
      if (least > Scalar(0) || most < Scalar(0)) status = Status::out_of_range;
    }
    return status;
  }
  /// Throws `std::invalid_argument` where `check` would refuse.
  [[gnu::cold]] void validate(const char* owner, Index dof) const {
    if (!sized(lower, dof) || !sized(upper, dof)) {
      detail::invalid(owner, ": velocity bounds have ", lower.size(), " and ", upper.size(),
                      " components, need ", dof);
    }
    for (Index i = 0; i < dof; ++i) {
      if (!(lower_of(i) <= Scalar(0)) || !(upper_of(i) >= Scalar(0))) {
        detail::invalid(owner, ": velocity bounds of component ", i, " must hold 0, got [",
                        lower_of(i), ", ", upper_of(i), "]");
      }
    }
  }
  /// Whether any of the first `n` components is bounded.
  bool any(Index n) const noexcept {
    for (Index i = 0; i < n; ++i) {
      if (lower_of(i) > -infinity<Scalar> || upper_of(i) < infinity<Scalar>) return true;
    }
    return false;
  }

  /// The factor s above, for `n` components and `share` of the bounds. A component that starts
  /// outside may move towards its bounds only.
  Scalar scale(Index n, const Scalar* rho, const Scalar* delta,
               Scalar share = Scalar(1)) const noexcept {
    Scalar s(1), largest(0);
    for (Index i = 0; i < n; ++i) largest = std::max(largest, std::abs(delta[i]));
    // What rounding leaves in a component that a higher level holds at its bound must not stop the
    // whole level; `advance` keeps it on the bound.
    const Scalar rounding = Scalar(4096) * std::numeric_limits<Scalar>::epsilon() * largest;
    for (Index i = 0; i < n; ++i) {
      const Scalar d = delta[i];
      if (std::abs(d) <= rounding) continue;
      const Scalar room =
          d > Scalar(0) ? share * upper_of(i) - rho[i] : share * lower_of(i) - rho[i];
      // Compared by multiplication: room / d could overflow for a tiny d.
      if (std::abs(room) >= s * std::abs(d) && (room > Scalar(0)) == (d > Scalar(0))) continue;
      s = (room > Scalar(0)) == (d > Scalar(0)) ? room / d : Scalar(0);
    }
    return s > Scalar(0) ? s : Scalar(0);  // not -0
  }

  /// `rho += s delta`; rounding cannot carry a component past a bound it was inside of.
  void advance(Index n, Scalar* rho, const Scalar* delta, Scalar s,
               Scalar share = Scalar(1)) const noexcept {
    for (Index i = 0; i < n; ++i) {
      const Scalar next = rho[i] + s * delta[i];
      rho[i] = std::clamp(next, std::min(share * lower_of(i), rho[i]),
                          std::max(share * upper_of(i), rho[i]));
    }
  }

 private:
  static bool sized(const Vector<Scalar, N>& side, Index dof) noexcept {
    return side.size() == dof || (N == Eigen::Dynamic && side.size() == 0);
  }
};

}  // namespace icat
