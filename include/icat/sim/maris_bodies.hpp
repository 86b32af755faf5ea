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
  struct Link {
    double mass, length, x, from;
  };
  constexpr Link table[7] = {{8, 0.108, 0, 0.175},         {6, 0.105, 0, 0.283},
                             {4, 0.3265, -0.07275, 0.388}, {3, 0.095, -0.1455, 0.7145},
                             {3, 0.325, -0.1455, 0.8095},  {3, 0.132, -0.1455, 1.1345},
                             {2, 0.021, -0.1455, 1.2665}};
  std::array<RigidBody<Scalar>, 7> links;
  for (std::size_t i = 0; i < 7; ++i) {
    const Link& link = table[i];
    const Vector3<double> size(0.1, 0.1, link.length);
    links[i] = cuboid<Scalar>(static_cast<Scalar>(link.mass), size.cast<Scalar>());
    links[i].displaced_mass = static_cast<Scalar>(maris_buoyancy * link.mass);
    links[i].pose.translation() =
        Vector3<double>(link.x, 0, link.from + link.length / 2).cast<Scalar>();
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

/// The whole robot, with the arm of `robot` (`maris_arm`) and its mount.
template <class Scalar>
typename VehicleManipulatorDynamics<Scalar, 7>::Description maris_dynamics(
    const typename Uvms<Scalar, 7>::Description& robot) {
  return {.robot = robot,
          .vehicle = maris_vehicle_body<Scalar>(),
          .links = maris_link_bodies<Scalar>()};
}

}  // namespace icat
