// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The papers' robots as dynamics: a vehicle with `maris_arm` on its mount.
#pragma once

#include "icat/model/maris_bodies.hpp"
#include "icat/sim/vehicle_manipulator_dynamics.hpp"

namespace icat {

/// The robot of [Coop, V-B].
template <class Scalar>
typename VehicleManipulatorDynamics<Scalar, 7>::Description maris_dynamics() {
  return {.arm = maris_arm<Scalar>(),
          .arm_mount = maris_arm_mount<Scalar>(),
          .vehicle = maris_vehicle_body<Scalar>(),
          .links = maris_link_bodies<Scalar>()};
}

/// The robot of the trials [MARIS]: R2, the arm, the gripper.
/// @param mass  of the vehicle, kg
template <class Scalar>
typename VehicleManipulatorDynamics<Scalar, 7>::Description r2_dynamics(Scalar mass = Scalar(400)) {
  return {.arm = maris_arm<Scalar>(),
          .arm_mount = maris_arm_mount<Scalar>(),
          .vehicle = r2_vehicle_body<Scalar>(mass),
          .links = r2_link_bodies<Scalar>()};
}

}  // namespace icat
