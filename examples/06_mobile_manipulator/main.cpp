// SPDX-License-Identifier: BSD-3-Clause
// A differential drive with a six-axis arm paints a bent wall: the tool follows a line that rises
// and falls, its axis normal to the wall; the base drives only as far as the arm needs it to.
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
using Objective = icat::Objective<double>;
constexpr double pi = std::numbers::pi;

// Six joints by their Denavit–Hartenberg table (a, alpha, d, theta), on a chassis with two wheels.
icat::KinematicTree<double> make_robot() {
  auto joints = icat::dh_chain<double>({{0, pi / 2, 0.089, 0},
                                        {-0.425, 0, 0, 0},
                                        {-0.392, 0, 0, 0},
                                        {0, pi / 2, 0.109, 0},
                                        {0, -pi / 2, 0.095, 0},
                                        {0, 0, 0.082, 0}},
                                       icat::DhConvention::standard, "arm_base");
  for (auto& joint : joints) joint.lower = -2 * pi, joint.upper = 2 * pi;
  joints.push_back({"mount", "chassis", "arm_base", icat::JointType::fixed,
                    support::pose({0.1, 0, 0.5}, 0, 0, 0)});
  return icat::KinematicTree<double>(
      {.joints = joints, .base = icat::Base<double>::differential_drive()});
}

// The wall: a circle about the origin, 4 m in radius, passed at 0.15 m/s.
struct Stroke {
  Vector3 point, velocity, normal, turning;
};
Stroke stroke(double t) {
  const double radius = 4, speed = 0.15, angle = speed * t / radius, wave = 0.5;
  const Vector3 out(std::cos(angle), std::sin(angle), 0), along(-out.y(), out.x(), 0);
  const Vector3 up(0, 0, 1);
  return {radius * out + (0.8 + 0.25 * std::sin(wave * t)) * up,
          speed * along + 0.25 * wave * std::cos(wave * t) * up, out, speed / radius * along};
}

int main(int argc, char** argv) {
  const auto arguments = support::parse(argc, argv, "A mobile manipulator paints a bent wall.",
                                        "out/06_mobile_manipulator");
  auto robot = make_robot();
  const icat::FrameId brush = robot.frame("link6");
  icat::Vector<double, 6> q;
  q << 0, -1.9, 2.0, -0.1, 0, 0;
  icat::KinematicPlant plant(robot, {.q = q, .base = support::pose({3.3, -0.4, 0}, 0, 0, pi / 2)});
  if (robot.update(plant.q(), plant.base()) != icat::Status::ok) return 1;

  //! [tasks]
  icat::task::JointLimits limits(robot);
  icat::task::Manipulability dexterity(robot, brush, Objective::at_least(0.02, 0.02));
  icat::task::FramePosition position(robot, brush, stroke(0).point, {.gain = 1.5, .max_rate = 0.3});
  icat::task::Attitude normal(robot, brush, {.gain = 1.0, .max_rate = 0.5});  // z along the normal
  icat::task::Minimality still_base(robot, robot.base_columns());
  icat::Controller controller(
      robot, {{"paint", {{limits}, {dexterity}, {position}, {normal}, {still_base}}}});
  //! [tasks]

  //! [replay]
  support::Replay replay("A mobile manipulator paints a bent wall");
  support::RobotReplay view(
      replay, controller,
      {.frames = {"link6"}, .base = {0.7, 0.5, 0.4}, .base_at = {0, 0, 0.25}, .samples = 4100});
  //! [replay]
  replay.look(3.5, 0.35);  // not from behind the wall
  for (double angle = -0.1; angle < 1.65; angle += 0.1) {  // the wall, 0.4 m after 0.4 m
    const Vector3 middle(4.03 * std::cos(angle), 4.03 * std::sin(angle), 0.7);
    view.run().shapes.push_back({.form = icat::ReplayForm::box,
                                 .at = support::pose(middle, 0, 0, angle),
                                 .size = {0.04, 0.405, 1.4},
                                 .color = "#c9b79c"});
  }
  support::Csv csv(arguments.output, "run.csv",
                   "t,tool_x,tool_y,tool_z,base_x,base_y,yaw,error,tilt,surge,yaw_rate,mu");
  const double dt = 0.01, end = 40;
  double worst = 0, tilt = 0;
  icat::Status status = controller.start("paint", 0);
  for (double t = 0; t < end && status == icat::Status::ok; t += dt) {
    const Stroke goal = stroke(t);
    status = robot.update(plant.q(), plant.base());
    if (status == icat::Status::ok) status = position.set_goal(goal.point, goal.velocity);
    if (status == icat::Status::ok) status = normal.set_world_axis(goal.normal, goal.turning);
    if (status == icat::Status::ok) status = controller.step(t);
    plant.step(controller.command(), t, dt);

    view.record(t, goal.point);
    const Vector3 tool = robot.pose(brush).translation(), base = plant.base().translation();
    const double error = (goal.point - tool).norm();
    if (t > 8) worst = std::max(worst, error), tilt = std::max(tilt, normal.angle());
    csv.row({t, tool.x(), tool.y(), tool.z(), base.x(), base.y(),
             std::atan2(plant.base()(1, 0), plant.base()(0, 0)), error, normal.angle(),
             controller.velocity()(6), controller.velocity()(7), dexterity.value()});
  }
  std::printf(
      "%s: after 8 s the brush is at most %.2f mm off its line and %.2f deg off the normal\n",
      icat::describe(status), 1e3 * worst, tilt * 180 / pi);
  if (arguments.pictures) support::draw(arguments.output);
  replay.write(arguments.output, arguments.logs);
  return status == icat::Status::ok && worst < 5e-3 && tilt < 0.01 ? 0 : 1;
}
