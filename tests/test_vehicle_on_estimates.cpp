// SPDX-License-Identifier: BSD-3-Clause
// The whole chain of a vehicle under way: sensors, estimators, velocity loop with the current as
// estimated, allocation, thrusters. Nothing in it knows the truth.
#include <gtest/gtest.h>

#include <cmath>
#include <icat/navigation/navigation.hpp>
#include <icat/sim/sensors.hpp>

#include "../examples/11_vehicle_loop/simulation.hpp"
#include "support/sanitized.hpp"

namespace {

using icat::Status;
using r2::Vector3;
using r2::Vector6;

struct Outcome {
  double velocity = 0;  ///< RMS off the reference under way, m/s
  double current = 0;   ///< largest error of the estimate under way, m/s
  long restarts = 0;    ///< of the velocity estimator
};

/// Ahead at 0.2 m/s while it turns at 0.1 rad/s, in a current; `heavier` than all think, kg;
/// without DVL for 20 s from `lost` on.
Outcome swim(double heavier, double lost) {
  const Vector3 water(0.15, -0.1, 0);
  const auto body = icat::r2_vehicle_body<double>();
  r2::Rig rig(body.mass, water, {});
  icat::VehicleModel<double> model;
  for (int i = 0; i < 3; ++i) {
    model.inertia(i) = body.mass + body.added_mass(i);
    model.inertia(3 + i) = body.inertia(i, i) + body.added_mass(3 + i);
  }
  model.linear_drag = body.linear_drag;
  model.quadratic_drag = body.quadratic_drag;
  model.weight_in_water = 9.81 * (body.mass - body.displaced_mass - heavier);
  icat::VehicleLoop<double> loop(body, r2::bandwidth());
  icat::Navigation<double> navigation(model, icat::Pose<double>::Identity());
  icat::Ahrs<double> ahrs;
  icat::Dvl<double> dvl({.latency = 0.1});
  Outcome result;
  Status status = Status::ok;
  Vector3 gyro = Vector3::Zero(), current = Vector3::Zero();
  Vector6 pushed = Vector6::Zero();
  double sum = 0;
  int count = 0;
  for (int k = 0; k < 14000; ++k) {
    const double t = rig.time();
    icat::VehicleMotion<double> truth;
    truth.pose.linear() = rig.attitude();
    truth.pose.translation() = rig.position();
    truth.velocity = rig.velocity();
    const auto inertial = ahrs.measure(t, truth);
    if (inertial) gyro = inertial->value.gyro;
    r2::Rig::keep(status, navigation.step(t, gyro, pushed));
    if (inertial) (void)navigation.correct_attitude(inertial->value.attitude, t - inertial->time);
    const auto z = dvl.measure(t, truth);
    if (z && (t < lost || t > lost + 20)) (void)navigation.correct_dvl(z->value, t - z->time);

    Vector6 reference = Vector6::Zero();
    if (t > 60) reference(0) = 0.2;
    if (t > 60) reference(5) = 0.1;
    current.head<2>() = navigation.current();
    r2::Rig::keep(status, loop.step(t, {.reference = reference,
                                        .velocity = navigation.velocity(),
                                        .attitude = navigation.pose().linear(),
                                        .current = current}));
    pushed = rig.push(loop.wrench(), status);
    r2::Rig::keep(status, loop.achieved(pushed));
    if (t < 80) continue;
    sum += (reference - rig.velocity()).head<3>().squaredNorm();
    ++count;
    result.current = std::max(result.current, (current - water).norm());
  }
  EXPECT_EQ(status, Status::ok);
  result.velocity = std::sqrt(sum / count);
  result.restarts = navigation.velocity_estimator().dvl().restarts();
  return result;
}

TEST(VehicleOnEstimates, FollowsItsReferenceInACurrent) {
  const double never = 1e9;
  // As modelled; 4 kg heavier, 1 % of it; and without DVL for 20 s.
  for (const auto& [heavier, lost] : {std::pair(0.0, never), {4.0, never}, {0.0, 90.0}}) {
    if (sanitized && heavier == 0) continue;
    const Outcome r = swim(heavier, lost);
    EXPECT_LT(r.velocity, 0.015) << heavier << ' ' << lost;
    EXPECT_LT(r.current, 0.03) << heavier << ' ' << lost;
    EXPECT_EQ(r.restarts, 0) << heavier << ' ' << lost;
  }
}

}  // namespace
