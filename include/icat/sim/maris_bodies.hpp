// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Masses and hydrodynamics of the robot of [Coop, V-B]: a vehicle of 1 m³ and 300 kg with Table
/// II, the arm's links as cuboids, and the pipe.
///
/// The links' cuboids lie along z of ⟨b⟩, at q = 0: links 1 and 2 end and start at the shoulder,
/// 2 + 3 span shoulder to elbow, 4 + 5 elbow to wrist, 6 wrist to end-effector, 7 beyond it. Link
/// 3, which carries the elbow's offset, lies half-way between both axes. Where the paper is silent:
/// weight is 1 % less than buoyancy, links and pipe have neither added mass nor drag (Table II is
/// of the vehicle), and the vehicle's centre of buoyancy is 5 cm above its centre of mass.
#pragma once

#include "icat/model/maris.hpp"
#include "icat/sim/vehicle_manipulator_dynamics.hpp"

namespace icat {

/// Displaced mass over mass: slightly positive.
inline constexpr double maris_buoyancy = 1.01;

/// The vehicle, ⟨v⟩ at the centre of the hull.
template <class Scalar>
RigidBody<Scalar> maris_vehicle_body() {
  RigidBody<Scalar> body = cuboid<Scalar>(Scalar(300), Vector3<Scalar>::Ones());
  body.added_mass << Scalar(158.4), Scalar(137.1), Scalar(171.3), Scalar(15), Scalar(20),
      Scalar(20);
  body.linear_drag << Scalar(50), Scalar(50), Scalar(44), Scalar(20), Scalar(20), Scalar(24);
  body.quadratic_drag << Scalar(320), Scalar(320), Scalar(430), Scalar(40), Scalar(40), Scalar(31);
  body.displaced_mass = static_cast<Scalar>(maris_buoyancy) * body.mass;
  body.centre_of_buoyancy << Scalar(0), Scalar(0), Scalar(-0.05);
  return body;
}

/// The links, in ⟨b⟩.
template <class Scalar>
std::array<RigidBody<Scalar>, 7> maris_link_bodies() {
  const auto arm = maris_arm<Scalar>();
  const auto up = [](double z) {
    return Vector3<Scalar>(Scalar(0), Scalar(0), static_cast<Scalar>(z));
  };
  const Vector3<Scalar> shoulder = arm.joints[1].point, elbow = arm.joints[3].point,
                        wrist = arm.joints[5].point, end = arm.end_effector.translation();
  // Where one link ends and the next begins.
  const std::array<Vector3<Scalar>, 8> ends{
      shoulder - up(0.108), shoulder, shoulder + up(0.105), elbow, elbow + up(0.095), wrist, end,
      end + up(0.021)};
  const std::array<Scalar, 7> mass{8, 6, 4, 3, 3, 3, 2};
  const Scalar side = static_cast<Scalar>(0.1);
  std::array<RigidBody<Scalar>, 7> links;
  for (std::size_t i = 0; i < 7; ++i) {
    links[i] = cuboid<Scalar>(mass[i], {side, side, ends[i + 1].z() - ends[i].z()});
    links[i].displaced_mass = static_cast<Scalar>(maris_buoyancy) * mass[i];
    links[i].pose.translation() = (ends[i] + ends[i + 1]) / Scalar(2);
  }
  return links;
}

/// The pipe: 28 kg, 3 m along x of ⟨o⟩, of 0.1 m radius.
template <class Scalar>
RigidBody<Scalar> maris_pipe_body() {
  RigidBody<Scalar> body = tube<Scalar>(Scalar(28), static_cast<Scalar>(0.1), Scalar(3));
  body.displaced_mass = static_cast<Scalar>(maris_buoyancy) * body.mass;
  return body;
}

/// The whole robot, with `maris_arm` on its mount.
template <class Scalar>
typename VehicleManipulatorDynamics<Scalar, 7>::Description maris_dynamics() {
  return {.arm = maris_arm<Scalar>(),
          .arm_mount = maris_arm_mount<Scalar>(),
          .vehicle = maris_vehicle_body<Scalar>(),
          .links = maris_link_bodies<Scalar>()};
}

}  // namespace icat
