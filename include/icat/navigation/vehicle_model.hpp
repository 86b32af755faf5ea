// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The vehicle's dynamics in the estimators, each component by itself:
///
///     M ν̇_r = τ − (d + D |ν_r|) ν_r,     ν_r the velocity through the water
///
/// An estimator must not linearise this drag at an estimate of ν_r with a standard deviation of 0.3
/// m/s: its covariance would be too small. It takes the mean and the slope over the distribution of
/// the estimate, x ~ N(μ, s²) (statistical linearisation):
///
///     a = erf(μ / √2 s),  g = s √(2/π) exp(−μ² / 2s²)
///     E[x |x|] = (μ² + s²) a + μ g,     d/dμ E[x |x|] = 2 E[|x|] = 2 (μ a + g)
#pragma once

#include <cmath>
#include <limits>
#include <numbers>

#include "icat/core/error.hpp"
#include "icat/core/types.hpp"

namespace icat {

/// Components on ⟨v⟩, [linear; angular]. Numbers of a vehicle of 300 kg and 1 m³ are in
/// `maris_vehicle_body`; added mass is a part of `inertia`.
template <class Scalar>
struct VehicleModel {
  Vector6<Scalar> inertia = Filled{0};         ///< M with added mass, kg, kg m², > 0
  Vector6<Scalar> linear_drag = Filled{0};     ///< d: N s/m, N m s/rad
  Vector6<Scalar> quadratic_drag = Filled{0};  ///< D: N s²/m², N m s²/rad²
  Scalar weight_in_water{0};                   ///< weight less buoyancy, N; < 0: it floats
};

namespace detail {

/// Force and slope of (d + D |x|) x over the spread of x.
template <class Scalar>
struct SpreadDrag {
  Scalar force, slope;

  SpreadDrag(Scalar linear, Scalar quadratic, Scalar mean, Scalar variance) noexcept {
    Scalar square = mean * std::abs(mean), speed = std::abs(mean);
    if (variance > Scalar(1e-12)) {
      const Scalar s = std::sqrt(variance), z = mean / s;
      const Scalar a = std::erf(z / std::numbers::sqrt2_v<Scalar>);
      const Scalar g =
          s * std::sqrt(Scalar(2) * std::numbers::inv_pi_v<Scalar>) * std::exp(-z * z / Scalar(2));
      square = (mean * mean + variance) * a + mean * g;
      speed = mean * a + g;
    }
    force = linear * mean + quadratic * square;
    slope = linear + Scalar(2) * quadratic * speed;
  }
};

template <class Scalar>
void check_model(const char* owner, const VehicleModel<Scalar>& model) {
  constexpr Scalar most = std::numeric_limits<Scalar>::max();
  for (Index i = 0; i < 6; ++i) {
    if (!(model.inertia(i) > Scalar(0)) || model.inertia(i) > most) {
      invalid(owner, ": inertia ", i, " must be finite and > 0, got ", model.inertia(i));
    }
    if (!(model.linear_drag(i) >= Scalar(0)) || model.linear_drag(i) > most) {
      invalid(owner, ": linear_drag ", i, " must be finite and >= 0, got ", model.linear_drag(i));
    }
    if (!(model.quadratic_drag(i) >= Scalar(0)) || model.quadratic_drag(i) > most) {
      invalid(owner, ": quadratic_drag ", i, " must be finite and >= 0, got ",
              model.quadratic_drag(i));
    }
  }
  if (!(model.weight_in_water >= -most && model.weight_in_water <= most)) {
    invalid(owner, ": weight_in_water must be finite, got ", model.weight_in_water);
  }
}

}  // namespace detail
}  // namespace icat
