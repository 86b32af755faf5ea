// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Robots with bodies for the tests of the plants: the one of the paper, and one with nothing
/// aligned.
#pragma once

#include <icat/sim/grasped_object_plant.hpp>
#include <icat/sim/maris_dynamics.hpp>

#include "states.hpp"

namespace testing_support {

using Dynamics = icat::VehicleManipulatorDynamics<double, 7>;
using Plant = icat::HydrodynamicPlant<double, 7>;
using Pair = icat::GraspedObjectPlant<double, 7>;
using VectorN = Dynamics::VectorN;
using Vector6 = icat::Vector6<double>;

/// The robot of the paper.
inline Dynamics::Description maris_description() { return icat::maris_dynamics<double>(); }

/// In vacuum: no added mass, drag or buoyancy.
inline void dry(icat::RigidBody<double>& body) {
  body.added_mass.setZero();
  body.linear_drag.setZero();
  body.quadratic_drag.setZero();
  body.displaced_mass = 0;
}
inline Dynamics::Description dry(Dynamics::Description d) {
  dry(d.vehicle);
  for (auto& link : d.links) dry(link);
  return d;
}

/// Random bodies, in vacuum, on an arm whose fourth joint slides.
inline Dynamics::Description random_description(unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto body = [&](double mass) {
    icat::RigidBody<double> b;
    b.mass = mass * (1.5 + u(rng));
    const Eigen::Matrix3d root =
        Eigen::Matrix3d::NullaryExpr([&] { return u(rng); }) + 2 * Eigen::Matrix3d::Identity();
    // Principal moments of a real body obey the triangle inequality, which MuJoCo checks.
    const Eigen::Matrix3d second_moment = 0.02 * b.mass * root * root.transpose();
    b.inertia = second_moment.trace() * Eigen::Matrix3d::Identity() - second_moment;
    b.pose = make_pose<double>(u(rng), u(rng), u(rng), u(rng), u(rng), u(rng));
    return b;
  };
  auto arm = icat::maris_arm<double>();
  arm.joints[3].type = icat::JointType::prismatic;
  arm.end_effector = make_pose<double>(-0.1, 0.2, 1.2, 0.3, 0.1, 0.2);
  Dynamics::Description d{.arm = arm,
                          .arm_mount = make_pose<double>(0.2, -0.1, 0.43, 0.3, -0.4, 2.0),
                          .vehicle = body(300),
                          .links = {}};
  for (auto& link : d.links) link = body(4);
  return d;
}

inline VectorN random_vector(std::mt19937& rng, double size) {
  std::uniform_real_distribution<double> u(-size, size);
  return VectorN::NullaryExpr([&] { return u(rng); });
}

}  // namespace testing_support
