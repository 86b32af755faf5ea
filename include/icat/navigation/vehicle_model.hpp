// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What the estimators know of the vehicle's dynamics, each component by itself:
///
///     M ν̇_r = τ − (d + D |ν_r|) ν_r,     ν_r the velocity through the water
#pragma once

#include <limits>

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
