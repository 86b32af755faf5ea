// SPDX-License-Identifier: BSD-3-Clause
// A work-class ROV holds a tool still with a five-joint arm. It commands surge, sway, heave and
// yaw; roll and pitch oscillate with the waves and are only measured.
#include <cstdio>
#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <numbers>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/geometry.hpp"
#include "../support/robot_replay.hpp"
#include "../support/support.hpp"

using Vector3 = icat::Vector3<double>;
using Velocity = icat::Vector<double, 11>;  // [q̇; surge, sway, heave, roll, pitch, yaw]
constexpr double pi = std::numbers::pi;

// Slew, shoulder, elbow, wrist pitch, wrist turn; x ahead, z down.
icat::KinematicTree<double, 11> make_robot() {
  const Vector3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  const auto joint = [](const Vector3& axis, double along, double lower, double upper) {
    return icat::JointAxis<double>{icat::JointType::revolute, axis, {along, 0, 0}, lower, upper};
  };
  const icat::SerialArm<double, 5> arm{
      {joint(z, 0, -1.5, 1.5), joint(y, 0.1, -1.4, 1.4), joint(y, 0.6, -2.2, 2.2),
       joint(y, 1.1, -1.8, 1.8), joint(x, 1.2, -3, 3)},
      support::pose({1.35, 0, 0}, 0, 0, 0)};
  return icat::uvms(arm, {.arm = support::pose({0.8, 0.3, 0.3}, 0, 0, 0)});
}

// Rates of roll and pitch, rad/s: 6 and 4 degrees at 7 and 5 s.
double roll_rate(double t) { return 6 * pi / 180 * 2 * pi / 7 * std::cos(2 * pi * t / 7); }
double pitch_rate(double t) { return 4 * pi / 180 * 2 * pi / 5 * std::cos(2 * pi * t / 5); }

struct Run {
  double tool = 0, attitude = 0;  ///< largest error after 10 s, m; largest tilt, rad
  icat::Status status = icat::Status::ok;
};

// With `feedback` the controller is given the measured rates, otherwise it takes them for zero.
Run run(bool feedback, support::Csv& csv, support::Replay& replay) {
  auto robot = make_robot();
  const icat::FrameId tool = robot.frame("tool");
  icat::Vector<double, 5> q;
  q << -0.2, -0.8, 1.6, -0.8, 0;
  icat::KinematicPlant plant(robot, {.q = q});
  if (robot.update(q, plant.base()) != icat::Status::ok) return {};
  const Vector3 valve = robot.pose(tool).translation() + Vector3(0.3, 0.1, 0.05);

  //! [tasks]
  const icat::ColumnRange roll_and_pitch{robot.base_columns().first + 3, 2};
  icat::task::JointLimits limits(robot);
  icat::task::FramePosition hold(robot, tool, valve, {.name = "hold the tool", .gain = 2});
  icat::task::Attitude ahead(
      robot, tool, {.name = "point ahead", .axis = {1, 0, 0}, .world_axis = {1, 0, 0}, .gain = 1});
  icat::task::Minimality still_vehicle(robot, robot.base_columns());
  icat::Controller controller(robot, {{"hold", {{limits}, {hold}, {ahead}, {still_vehicle}}}},
                              {.given = roll_and_pitch});
  //! [tasks]

  support::RobotReplay view(
      replay, controller,
      {.frames = {"tool"},
       .name = feedback ? "seeing" : "blind",
       .title = feedback ? "with the measured rates" : "without the measured rates",
       .base = {1.6, 1.0, 0.8},
       .ground = 1.5,
       .samples = 4100});
  const auto off = view.log().add("off the valve/tool", "m");
  view.run().plots.insert(view.run().plots.begin(),
                          {"Tool off the valve", {"off the valve/"}, "m", 0, 0, true});
  Run result;
  result.status = controller.start("hold", 0);
  const double dt = 0.01;
  for (double t = 0; t < 40 && result.status == icat::Status::ok; t += dt) {
    result.status = robot.update(plant.q(), plant.base());
    Velocity measured = Velocity::Zero();  // gyros, one period old
    if (feedback) measured = plant.velocity();
    if (result.status == icat::Status::ok) result.status = controller.step(t, measured);
    Velocity actual = controller.command();  // zeros in roll and pitch
    actual(8) = roll_rate(t), actual(9) = pitch_rate(t);
    plant.step(actual, t, dt);

    view.record(t, valve);
    const double error = (valve - robot.pose(tool).translation()).norm();
    view.log().set(off, error);
    const double tilt = std::acos(std::min(1.0, plant.base()(2, 2)));
    if (t > 10) result.tool = std::max(result.tool, error);
    result.attitude = std::max(result.attitude, tilt);
    csv.row({t, double(feedback), error, tilt, ahead.angle(), controller.velocity()(5),
             controller.velocity()(7), plant.q()(1), plant.q()(2)});
  }
  return result;
}

int main(int argc, char** argv) {
  const auto arguments =
      support::parse(argc, argv, "An ROV in waves holds a tool still.", "out/08_rov");
  support::Csv csv(arguments.output, "run.csv", "t,feedback,error,tilt,ahead,surge,heave,q2,q3");
  support::Replay replay("An ROV in waves holds a tool still", true);
  const Run blind = run(false, csv, replay), seeing = run(true, csv, replay);
  std::printf(
      "%s: the hull tilts by up to %.1f deg; the tool is off by %.1f mm without the measured "
      "rates,\n"
      "by %.2f mm with them\n",
      icat::describe(seeing.status), seeing.attitude * 180 / pi, 1e3 * blind.tool,
      1e3 * seeing.tool);
  if (arguments.pictures) support::draw(arguments.output);
  replay.write(arguments.output, arguments.logs);
  return seeing.status == icat::Status::ok && seeing.tool < 2e-3 && blind.tool > 10 * seeing.tool
             ? 0
             : 1;
}
