// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A vehicle in a current, the truth for tests of navigation. Integrated by explicit steps, apart
/// from the estimators, with dynamics in the water and a velocity over ground:
///
///     M v̇_r + ω × M v_r = f − drag,   v = v_r + Rᵀ c
#pragma once

#include <cmath>
#include <icat/math/rigid_motion.hpp>
#include <icat/navigation/vehicle_model.hpp>

namespace support {

/// A vehicle of 300 kg, as in maris_bodies.hpp.
template <class S = double>
icat::VehicleModel<S> vehicle_model() {
  icat::VehicleModel<S> m;
  m.inertia << S(458), S(437), S(471), S(65), S(70), S(70);
  m.linear_drag << S(50), S(50), S(44), S(20), S(20), S(24);
  m.quadratic_drag << S(320), S(320), S(430), S(40), S(40), S(31);
  return m;
}

struct Swimmer {
  using Vector3 = icat::Vector3<double>;

  icat::VehicleModel<double> model = vehicle_model();
  Vector3 current = Vector3::Zero();   ///< m/s
  Vector3 velocity = Vector3::Zero();  ///< over ground, on ⟨v⟩, m/s
  icat::Matrix3<double> R = icat::Matrix3<double>::Identity();
  Vector3 position = Vector3::Zero();
  double yaw_rate = 0;

  /// `dt` s under a force, a yaw torque and unknown accelerations, on ⟨v⟩; rolling and pitching as
  /// told.
  void step(const Vector3& force, const Vector3& angular, const Vector3& disturbance, double dt) {
    const Vector3 flow = R.transpose() * current, water = velocity - flow;
    const Vector3 momentum = model.inertia.head<3>().cwiseProduct(water);
    const Vector3 coriolis = angular.cross(momentum), carried = angular.cross(flow);
    for (int j = 0; j < 3; ++j) {
      const double d = model.linear_drag(j) + model.quadratic_drag(j) * std::abs(water(j));
      const double weight = R(2, j) * model.weight_in_water;
      velocity(j) += dt * ((force(j) + weight - d * water(j) - coriolis(j)) / model.inertia(j) -
                           carried(j) + disturbance(j));
    }
    position += dt * (R * velocity);
    R = R * icat::rotation_exp<double>(Vector3(dt * angular));
  }
  /// The same for yaw alone.
  void turn(double torque, double dt) {
    const double d = model.linear_drag(5) + model.quadratic_drag(5) * std::abs(yaw_rate);
    yaw_rate += dt * (torque - d * yaw_rate) / model.inertia(5);
  }
};

}  // namespace support
