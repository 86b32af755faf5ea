// SPDX-License-Identifier: BSD-3-Clause
// The robot of the campaigns, the models of its controllers and estimators, and the conditions that
// differ between attempts.
#pragma once

#include <cmath>
#include <icat/model/uvms.hpp>
#include <icat/navigation/navigation.hpp>
#include <icat/sim/hydrodynamic_plant.hpp>
#include <icat/sim/maris_dynamics.hpp>
#include <icat/sim/noise.hpp>

#include "parameters.hpp"

namespace campaign {

using Robot = icat::KinematicTree<double, 13>;
using Plant = icat::HydrodynamicPlant<double, 7>;
using Pose = icat::Pose<double>;
using Vector3 = icat::Vector3<double>;
using Vector6 = icat::Vector6<double>;
using Vector13 = icat::Vector<double, 13>;
using Joints = icat::Vector<double, 7>;
using icat::Status;

/// Turned about z by `yaw`.
inline Pose at(double x, double y, double z, double yaw = 0) {
  Pose pose = Pose::Identity();
  pose.linear() = icat::rotation_exp<double>(Vector3(0, 0, yaw));
  pose.translation() << x, y, z;
  return pose;
}
inline Joints joints(double shoulder, double elbow, double wrist) {
  Joints q;
  q << 0, shoulder, 0, elbow, 0, wrist, 0;
  return q;
}
inline Pose camera_mount() { return at(0.6, 0, 0.1); }  // looks down; u of the images along x
inline Pose palm_mount() { return at(0, 0, 0.1); }      // ⟨h⟩ in the end-effector's frame
inline Robot make_robot() {
  return icat::uvms(
      icat::maris_arm<double>(),
      {.arm = icat::maris_arm_mount<double>(), .camera = camera_mount(), .tool = palm_mount()});
}

/// What is different in each attempt: drawn from its seed, the same in all campaigns.
struct Conditions {
  explicit Conditions(std::uint64_t seed) {
    icat::Noise noise(seed);
    double u[11];  // one after the other: the order of a call's arguments is the compiler's
    for (double& x : u) x = 2 * noise.uniform() - 1;
    pipe = at(0.2 * u[0], 0.2 * u[1], support - radius, 0.3 * u[2] - 1.5708);
    start = at(-1.5 + 0.5 * u[3], 0.5 * u[4], survey_depth, 0.2 * u[5]);
    placed = at(-0.35 + 0.1 * u[6], 0.1 * u[7], placed_depth, 0.1 * u[8]);
    waypoint = at(-0.5 + 0.3 * u[9], 0.3 * u[10], survey_depth);
    for (int i = 0; i < 3; ++i) tether(i) = (i < 2 ? umbilical : trim) * noise.normal();
  }
  Pose pipe;           ///< x along it
  Pose start, placed;  ///< of the vehicle, by itself and by hand
  Pose waypoint;       ///< of the vehicle, 0.5 m behind the assumed place of the pipe
  Vector3 tether;      ///< N, on ⟨0⟩: the umbilical and ballast, unknown to the controllers
};

/// Both poles of each component, rad/s; roll and pitch are not actuated.
inline Vector6 bandwidth() {
  Vector6 w;
  w << 1, 1, 1, 0, 0, 2;
  return w;
}
/// What the robot weighs in water, N, less what it displaces.
inline double weight() {
  const auto r2 = icat::r2_dynamics<double>();
  double mass = r2.vehicle.mass - r2.vehicle.displaced_mass;
  for (const auto& link : r2.links) mass += link.mass - link.displaced_mass;
  return 9.81 * mass;
}
/// The vehicle as its loop knows it: the arm weighs on it.
inline icat::RigidBody<double> trimmed() {
  auto body = icat::r2_vehicle_body<double>();
  body.displaced_mass = body.mass - weight() / 9.81;
  return body;
}
/// As the estimators know it.
inline icat::VehicleModel<double> model() {
  const auto body = icat::r2_vehicle_body<double>();
  icat::VehicleModel<double> model;
  for (int i = 0; i < 3; ++i) {
    model.inertia(i) = body.mass + body.added_mass(i);
    model.inertia(3 + i) = body.inertia(i, i) + body.added_mass(3 + i);
  }
  model.linear_drag = body.linear_drag;
  model.quadratic_drag = body.quadratic_drag;
  model.weight_in_water = weight();
  return model;
}
/// Told the noise of the sensors.
inline icat::Navigation<double>::Options navigation_options() {
  icat::Navigation<double>::Options o;
  o.yaw_rate.gyro_noise = gyro_noise;
  o.velocity.beam_noise = beam_noise;
  o.velocity.acceleration_noise = 0.02;  // umbilical and arm push it about
  o.attitude.gyro_noise = gyro_noise / std::sqrt(100.0);
  o.position.initial_position = 0.1;
  return o;
}

}  // namespace campaign
