// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A Doppler velocity log (DVL): four beams, each of which measures the velocity along itself.
///
///     b_i = (sinα cosφ_i, sinα sinφ_i, cosα),  φ_i = 45°, 135°, 225°, 315°
///     s_i = b_iᵀ u + n,   u = v + ω × r:  u by least squares, with the covariance σ² (Σ b_i
///     b_iᵀ)⁻¹
///
/// Three beams are enough; the covariance says what the fourth was worth.
#pragma once

#include <array>
#include <cmath>
#include <numbers>

#include "icat/math/spatial_algebra.hpp"
#include "icat/navigation/kalman.hpp"

namespace icat {

/// Where the instrument sits on the vehicle and how its beams open. Its axes are those of ⟨v⟩.
template <class Scalar>
struct DvlGeometry {
  Vector3<Scalar> position = Filled{0};                ///< r, in ⟨v⟩, m
  Scalar beam_angle = std::numbers::pi_v<Scalar> / 6;  ///< α from straight down, rad

  /// b_i on ⟨v⟩, i = 0 … 3: front right, back right, back left, front left.
  Vector3<Scalar> beam(int i) const noexcept {
    const Scalar across = std::sin(beam_angle) * std::sqrt(Scalar(0.5));
    return {i == 0 || i == 3 ? across : -across, i < 2 ? across : -across, std::cos(beam_angle)};
  }
};

/// One measurement.
template <class Scalar>
struct DvlMeasurement {
  Vector3<Scalar> velocity = Filled{0};               ///< u over ground, on ⟨v⟩, m/s
  std::array<bool, 4> beams{true, true, true, true};  ///< that have found the ground
};

namespace detail {

/// (Σ b_i b_iᵀ)⁻¹ of the beams there are; false for fewer than three.
template <class Scalar>
bool dvl_covariance(const DvlGeometry<Scalar>& geometry, const std::array<bool, 4>& beams,
                    Matrix3<Scalar>& covariance) noexcept {
  Matrix3<Scalar> information = Filled{0};
  int count = 0;
  for (int k = 0; k < 4; ++k) {
    if (!beams[static_cast<std::size_t>(k)]) continue;
    ++count;
    const Vector3<Scalar> b = geometry.beam(k);
    for (Index i = 0; i < 3; ++i) {
      for (Index j = 0; j < 3; ++j) information(i, j) += b(i) * b(j);
    }
  }
  return count >= 3 && invert<Scalar, 3>(information, covariance);
}

template <class Scalar>
void check_geometry(const char* owner, const DvlGeometry<Scalar>& geometry) {
  if (!all_finite(geometry.position)) invalid(owner, ": position of the DVL is not finite");
  if (!(geometry.beam_angle > Scalar(0)) || !(geometry.beam_angle < Scalar(1.5))) {
    invalid(owner, ": beam_angle must be in (0, 1.5) rad, got ", geometry.beam_angle);
  }
}

}  // namespace detail
}  // namespace icat
