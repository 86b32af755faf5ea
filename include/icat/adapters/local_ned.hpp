// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Latitude, longitude and height to north, east and down about an origin, and back: what GPS says
/// as a position in ⟨0⟩. Exact through the earth-centred frame (ECEF) of WGS 84 [NGA.STND.0036,
/// section 4]: a = 6378137 m, 1/f = 298.257223563,
///
///     p = ((N + h) cosφ cosλ, (N + h) cosφ sinλ, (N (1 − e²) + h) sinφ),  N = a / √(1 − e² sin²φ)
///     n = R(φ₀, λ₀) (p − p₀)
///
/// Down is that of the origin: a point at the same height 1 km away has z = 0.08 m, at 10 km 7.8 m.
/// So take depth from a depth sensor, north and east from here.
#pragma once

#include <array>
#include <cmath>
#include <numbers>

#include "icat/core/error.hpp"

namespace icat {

/// A place on earth, WGS 84.
struct Geodetic {
  double latitude{0};   ///< φ, rad, north positive, [−π/2, π/2]
  double longitude{0};  ///< λ, rad, east positive
  double height{0};     ///< h above the ellipsoid, m: what GPS calls altitude plus the geoid's
};

/// ⟨0⟩ at an origin: x north, y east, z down. No allocation after construction, none before.
class LocalNed {
 public:
  /// @throws std::invalid_argument on a latitude outside [−π/2, π/2] (degrees for radians?) or what
  ///         is not finite.
  explicit LocalNed(const Geodetic& origin) : origin_(origin), ecef_(to_ecef(origin)) {
    if (!(std::abs(origin.latitude) <= std::numbers::pi / 2)) {
      detail::invalid("LocalNed: latitude must be within half pi, in rad, got ", origin.latitude);
    }
    if (!(std::abs(origin.longitude) <= 2 * std::numbers::pi)) {
      detail::invalid("LocalNed: longitude must be within two pi, in rad, got ", origin.longitude);
    }
    if (!(std::abs(origin.height) <= 1e6)) {
      detail::invalid("LocalNed: height must be within 1e6 m, got ", origin.height);
    }
    const double sp = std::sin(origin.latitude), cp = std::cos(origin.latitude);
    const double sl = std::sin(origin.longitude), cl = std::cos(origin.longitude);
    rotation_ = {{{-sp * cl, -sp * sl, cp}, {-sl, cl, 0}, {-cp * cl, -cp * sl, -sp}}};
  }

  /// North, east, down of `place`, m.
  std::array<double, 3> ned(const Geodetic& place) const noexcept {
    const std::array<double, 3> p = to_ecef(place);
    std::array<double, 3> out{};
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t k = 0; k < 3; ++k) out[i] += rotation_[i][k] * (p[k] - ecef_[k]);
    }
    return out;
  }
  /// The same for a point at the height of the origin: all that a fix without height can tell.
  std::array<double, 3> ned(double latitude, double longitude) const noexcept {
    return ned(Geodetic{latitude, longitude, origin_.height});
  }
  /// The place of north, east, down (m), within 1e-10 rad and 1e-4 m where it is within 1000 km of
  /// the surface. Longitude in [−π, π].
  Geodetic geodetic(const std::array<double, 3>& ned) const noexcept {
    std::array<double, 3> p = ecef_;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t k = 0; k < 3; ++k) p[k] += rotation_[i][k] * ned[i];
    }
    // Bowring's iteration of the reduced latitude; three steps are exact to the last digits.
    const double radius = std::hypot(p[0], p[1]);
    const double b = a_ * (1 - f_), second = e2_ / (1 - e2_);
    double u = std::atan2(p[2] * a_, radius * b), latitude = 0;
    for (int i = 0; i < 3; ++i) {
      const double s = std::sin(u), c = std::cos(u);
      latitude = std::atan2(p[2] + second * b * s * s * s, radius - e2_ * a_ * c * c * c);
      u = std::atan2((1 - f_) * std::sin(latitude), std::cos(latitude));
    }
    const double s = std::sin(latitude), c = std::cos(latitude);
    // Along the normal, which is well-conditioned at the pole, too.
    const double height = radius * c + p[2] * s - a_ * std::sqrt(1 - e2_ * s * s);
    return {latitude, std::atan2(p[1], p[0]), height};
  }
  /// Where north, east and down are zero.
  const Geodetic& origin() const noexcept { return origin_; }

 private:
  static constexpr double a_ = 6378137, f_ = 1 / 298.257223563, e2_ = f_ * (2 - f_);

  static std::array<double, 3> to_ecef(const Geodetic& g) noexcept {
    const double sp = std::sin(g.latitude), cp = std::cos(g.latitude);
    const double n = a_ / std::sqrt(1 - e2_ * sp * sp);
    return {(n + g.height) * cp * std::cos(g.longitude),
            (n + g.height) * cp * std::sin(g.longitude), (n * (1 - e2_) + g.height) * sp};
  }

  Geodetic origin_;
  std::array<double, 3> ecef_;
  std::array<std::array<double, 3>, 3> rotation_{};
};

}  // namespace icat
