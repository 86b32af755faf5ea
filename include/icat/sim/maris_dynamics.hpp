// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The papers' robots as dynamics: a vehicle with `maris_arm` on its mount.
#pragma once

#include "icat/model/maris_bodies.hpp"
#include "icat/sim/vehicle_manipulator_dynamics.hpp"

namespace icat {

/// The robot of [Coop, V-B]; or one with another vehicle, such as `r2_vehicle_body` of [MARIS].
template <class Scalar>
typename VehicleManipulatorDynamics<Scalar, 7>::Description maris_dynamics(
    const RigidBody<Scalar>& vehicle = maris_vehicle_body<Scalar>()) {
  return {.arm = maris_arm<Scalar>(),
          .arm_mount = maris_arm_mount<Scalar>(),
          .vehicle = vehicle,
          .links = maris_link_bodies<Scalar>()};
}

}  // namespace icat
