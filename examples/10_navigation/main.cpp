// SPDX-License-Identifier: BSD-3-Clause
// A vehicle follows a square in a current by its own estimates. It has GPS at the start, then a
// DVL, which on the third side is too near to the bottom and does not measure for ten seconds.
#include <cstdio>
#include <icat/adapters/replay_scene.hpp>
#include <icat/control/vehicle_loop.hpp>
#include <icat/model/maris_bodies.hpp>
#include <icat/navigation/navigation.hpp>
#include <icat/sim/sensors.hpp>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/replay.hpp"
#include "../support/support.hpp"

using Vector2 = icat::Vector<double, 2>;
using Vector3 = icat::Vector3<double>;
using Matrix3 = icat::Matrix3<double>;
using Vector6 = icat::Vector6<double>;

constexpr double dt = 0.01, floor_depth = 10, side = 10, speed = 0.3;
const Vector3 water(0.08, -0.06, 0);  // the current, m/s

icat::VehicleModel<double> make_model(const icat::RigidBody<double>& body) {
  icat::VehicleModel<double> m;
  m.inertia = body.added_mass;
  m.inertia.head<3>().array() += body.mass;
  m.inertia.tail<3>() += body.inertia.diagonal();
  m.linear_drag = body.linear_drag;
  m.quadratic_drag = body.quadratic_drag;
  m.weight_in_water = 9.81 * (body.mass - body.displaced_mass);
  return m;
}

// The true motion: upright, with surge, sway, heave and yaw only.
void swim(const icat::VehicleModel<double>& m, const Vector6& wrench, icat::Noise& disturbance,
          icat::VehicleMotion<double>& truth) {
  const Matrix3 R = truth.pose.linear();
  const Vector3 angular = truth.velocity.tail<3>(), v = truth.velocity.head<3>();
  const Vector3 flow = R.transpose() * water, relative = v - flow;
  const Vector3 momentum = m.inertia.head<3>().cwiseProduct(relative);
  const Vector3 coriolis = angular.cross(momentum), carried = angular.cross(flow);
  for (int j = 0; j < 3; ++j) {
    const double drag = m.linear_drag(j) + m.quadratic_drag(j) * std::abs(relative(j));
    const double force = wrench(j) + (j == 2 ? m.weight_in_water : 0) - drag * relative(j);
    truth.velocity(j) += dt * ((force - coriolis(j)) / m.inertia(j) - carried(j)) +
                         0.005 * std::sqrt(dt) * disturbance.normal();
  }
  const double drag = m.linear_drag(5) + m.quadratic_drag(5) * std::abs(angular(2));
  truth.velocity(5) += dt * (wrench(5) - drag * angular(2)) / m.inertia(5);
  truth.pose = icat::integrate<double>(truth.pose, truth.velocity, dt);
}

double depth_at(double t) {
  if (t < 20) return 0.1;
  const double cruise = std::min(0.1 + 0.25 * (t - 20), 8.0);
  return t > 128 && t < 140.5 ? 9.2 : cruise;
}

int main(int argc, char** argv) {
  const auto arguments = support::parse(
      argc, argv, "A vehicle navigates a square without DVL near the bottom.", "out/10_navigation");
  support::Csv csv(arguments.output, "run.csv",
                   "t,north,east,depth,north_est,east_est,north_dev,east_dev,current_north,"
                   "current_east,current_dev,surge_error,surge_dev,lost");
  const auto body = icat::maris_vehicle_body<double>();
  const auto model = make_model(body);
  icat::VehicleMotion<double> truth;
  truth.pose.translation() = Vector3(3, -2, 0.1);  // the navigation believes (0, 0, 0)

  const icat::DvlGeometry<double> instrument{.position = {0.3, 0, 0.4}};
  icat::Ahrs<double> ahrs;
  icat::Dvl<double> dvl({.latency = 0.1, .floor = floor_depth, .geometry = instrument});
  icat::DepthSensor<double> depth;
  icat::Gps<double> gps({.latency = 0.2});
  icat::Noise disturbance(5);
  icat::Navigation<double> navigation(
      model, icat::Pose<double>::Identity(),
      {.velocity = {.dvl = instrument}, .position = {.gps_noise = 5}});

  // Roll and pitch are not actuated.
  const Vector6 bandwidth{{0.7, 0.7, 0.7, 0, 0, 1.5}}, strongest{{150, 150, 150, 0, 0, 60}};
  icat::VehicleLoop<double> loop(body, bandwidth);
  const Vector2 corners[] = {{side, 0}, {side, side}, {0, side}, {0, 0}};
  support::Replay replay("A vehicle follows a square by its own estimates", true);
  support::VehicleRun run(replay, "navigation",
                          "orange: where it is; blue: where it estimates to be", 2101, floor_depth);
  const auto estimate = run.log().add("estimate", "m", icat::LogKind::pose),
             off_by = run.log().add("off/position", "m"),
             expected = run.log().add("off/position, expected", "m");
  run.run().plots.insert(run.run().plots.begin(),
                         {"Estimated position off the true one", {"off/"}, "m"});
  run.run().shapes.push_back({.form = icat::ReplayForm::box,
                              .frame = "estimate",
                              .size = {1.0, 0.6, 0.5},
                              .color = "#3d8fb5",
                              .opacity = 0.4});
  run.run().shapes.push_back(
      {.form = icat::ReplayForm::path, .frame = "estimate", .color = "#3d8fb5"});
  int corner = 0;
  Vector3 gyro = Vector3::Zero(), current = Vector3::Zero();
  Vector6 wrench = Vector6::Zero();
  double in_outage = 0, current_error = 0, lost_for = 0, t = 0;
  icat::Status status = icat::Status::ok;
  for (int k = 0; t < 210 && status == icat::Status::ok; ++k, t = k * dt) {
    const auto inertial = ahrs.measure(t, truth);
    if (inertial) gyro = inertial->value.gyro;
    status = navigation.step(t, gyro, wrench);
    // Counters of the gates show refused measurements.
    if (inertial) (void)navigation.correct_attitude(inertial->value.attitude);
    if (const auto z = dvl.measure(t, truth)) (void)navigation.correct_dvl(z->value, t - z->time);
    if (const auto z = depth.measure(t, truth)) (void)navigation.correct_depth(z->value);
    if (const auto z = gps.measure(t, truth)) (void)navigation.correct_gps(z->value, t - z->time);

    // Steering: to the corner, nose ahead, from 60 s on.
    const icat::Pose<double> pose = navigation.pose();
    const Vector3 position = pose.translation();
    Vector3 wanted(0, 0, 0.5 * (depth_at(t) - position(2)));
    double course = 0;
    if (t > 60) {
      const Vector2 ahead = corners[corner] - position.head<2>();
      if (ahead.norm() < 0.3 && corner < 3) ++corner;
      wanted.head<2>() = std::min(speed, 0.5 * ahead.norm()) * ahead.normalized();
      course = corner * std::numbers::pi / 2;
    }
    const Matrix3 R = pose.linear();
    const double turn = std::remainder(course - std::atan2(R(1, 0), R(0, 0)), 2 * std::numbers::pi);
    Vector6 reference = Vector6::Zero();
    reference.head<3>() = R.transpose() * wanted;
    reference(5) = std::clamp(0.5 * turn, -0.3, 0.3);
    current.head<2>() = navigation.current();
    if (status == icat::Status::ok) {
      status = loop.step(t, {.reference = reference,
                             .velocity = navigation.velocity(),
                             .attitude = R,
                             .current = current});
    }
    wrench = loop.wrench().cwiseMax(-strongest).cwiseMin(strongest);
    (void)loop.achieved(wrench);
    swim(model, wrench, disturbance, truth);

    const auto& estimator = navigation.velocity_estimator();
    const auto& P = navigation.position_estimator().covariance();
    const bool lost = t > 1 && estimator.dvl().age() > 0.5;
    const Vector3 off = estimator.velocity() - truth.velocity.head<3>();
    if (lost) lost_for += dt, in_outage = std::max(in_outage, off.norm());
    if (t > 120) {
      const Vector2 e = navigation.current() - water.head<2>();
      current_error = std::max(current_error, e.norm());
    }
    if (k % 10 != 0) continue;
    if (run.record(t, truth.pose, reference, truth.velocity)) {
      run.log().set(estimate, pose);
      run.log().set(off_by, (position - truth.pose.translation()).norm());
      run.log().set(expected, std::sqrt(P(0, 0) + P(1, 1)));
      run.log().explain(t, lost     ? "Too near to the bottom for the DVL: the model alone."
                           : t < 20 ? "At the surface: GPS and DVL correct the estimates."
                                    : "Under water: the DVL corrects the velocity, no GPS.");
    }
    csv.row({t, truth.pose(0, 3), truth.pose(1, 3), truth.pose(2, 3), position(0), position(1),
             std::sqrt(P(0, 0)), std::sqrt(P(1, 1)), navigation.current()(0),
             navigation.current()(1), std::sqrt(estimator.covariance()(3, 3)), off(0),
             std::sqrt(estimator.covariance()(0, 0)), double(lost)});
  }
  const Vector3 end = navigation.pose().translation();
  const double away = (end - truth.pose.translation()).norm();
  const auto& P = navigation.position_estimator().covariance();
  const double deviation = std::sqrt(P(0, 0) + P(1, 1));
  std::printf(
      "%s: current known to %.1f cm/s; without DVL for %.1f s the velocity was off by %.1f cm/s "
      "at\n"
      "most; at the end the position is off by %.2f m, its deviation is %.2f m\n",
      icat::describe(status), 100 * current_error, lost_for, 100 * in_outage, away, deviation);
  if (arguments.pictures) support::draw(arguments.output);
  replay.write(arguments.output, arguments.logs);
  return status == icat::Status::ok && lost_for > 9 && in_outage < 0.05 && away < 3 * deviation ? 0
                                                                                                : 1;
}
