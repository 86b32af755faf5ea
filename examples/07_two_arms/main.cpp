// SPDX-License-Identifier: BSD-3-Clause
// A torso with two arms carries a tray: the hands keep their places on it, it stays level, its
// centre follows a loop that neither arm could follow without the torso.
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
constexpr double degree = std::numbers::pi / 180;

// A column that turns and a chest that rises, with seven joints on either side; at q = 0 the arms
// point ahead.
icat::KinematicTree<double> make_robot() {
  const Vector3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  const auto joint = [](const Vector3& axis, double along, double limit) {
    return icat::JointAxis<double>{icat::JointType::revolute, axis, {along, 0, 0}, -limit, limit};
  };
  const icat::SerialArm<double, 7> arm{
      {joint(z, 0, 2.5), joint(y, 0.05, 2.2), joint(x, 0.1, 2.9), joint(y, 0.35, 2.4),
       joint(x, 0.4, 2.9), joint(y, 0.65, 2), joint(z, 0.65, 2)},
      support::pose({0.75, 0, 0}, 0, 0, 0)};
  std::vector<icat::Joint<double>> joints{
      {.name = "turn", .parent = "pedestal", .link = "column", .lower = -1.5, .upper = 1.5},
      {"rise", "column", "chest", icat::JointType::prismatic, support::pose({0, 0, 0.9}, 0, 0, 0)}};
  joints[1].lower = 0, joints[1].upper = 0.4;
  for (const std::string side : {"left_", "right_"}) {
    joints.push_back({side + "mount", "chest", side + "shoulder", icat::JointType::fixed,
                      support::pose({0, side == "left_" ? 0.25 : -0.25, 0}, 0, 0, 0)});
    for (auto& j : icat::axes_chain(arm, side + "shoulder", side)) joints.push_back(j);
  }
  return icat::KinematicTree<double>({.joints = joints});
}

Vector3 loop(double t) {
  const double a = 2 * std::numbers::pi * t / 20;
  return {0.55 + 0.04 * (std::cos(a) - 1), 0.45 * std::sin(a), 1.08 + 0.2 * std::sin(2 * a)};
}

int main(int argc, char** argv) {
  const auto arguments =
      support::parse(argc, argv, "A torso with two arms carries a tray.", "out/07_two_arms");
  auto robot = make_robot();
  const icat::FrameId left = robot.frame("left_end_effector"),
                      right = robot.frame("right_end_effector");
  Eigen::VectorXd q(16);  // turn, rise, left arm, right arm
  q << 0, 0.2, 0, 0.9, 0, -1.7, 0, 0.8, 0, 0, 0.9, 0, -1.7, 0, 0.8, 0;
  icat::KinematicPlant plant(robot, {.q = q});
  if (robot.update(q) != icat::Status::ok) return 1;

  //! [tasks]
  // The tray lies midway between the hands, which keep their present poses on it.
  icat::Pose<double> centre = robot.pose(left);
  centre.translation() = (robot.pose(left).translation() + robot.pose(right).translation()) / 2;
  centre.linear().setIdentity();
  const icat::FrameId tray = robot.add_frame("tray", left, robot.pose(left).inverse() * centre);
  const icat::Pose<double> grasp = robot.pose(tray).inverse() * robot.pose(right);

  icat::task::JointLimits limits(robot);
  icat::task::FramePose hold(robot, right, grasp, {.name = "hold", .relative_to = tray, .gain = 5});
  icat::task::Attitude level(robot, tray, {.name = "level", .gain = 5});
  icat::task::FramePosition carry(robot, tray, loop(0),
                                  {.name = "carry", .gain = 2, .max_rate = 0.4});
  icat::task::JointPosition posture(robot, q, {.name = "posture", .gain = 0.2});
  icat::Controller controller(robot, {{"carry", {{limits}, {hold}, {level}, {carry}, {posture}}}});
  //! [tasks]

  support::Replay replay("A torso with two arms carries a tray");
  support::RobotReplay view(
      replay, controller,
      {.frames = {"left_end_effector", "right_end_effector", "tray"}, .samples = 4100});
  view.run().shapes.push_back({.form = icat::ReplayForm::box,
                               .frame = "frame/tray",
                               .size = {0.3, 0.44, 0.02},
                               .color = "#2fa36b",
                               .opacity = 0.6});
  support::Csv csv(arguments.output, "run.csv",
                   "t,x,y,z,goal_x,goal_y,goal_z,turn,rise,grip,tilt,error");
  const double dt = 0.01;
  double grip = 0, tilt = 0, error = 0;
  icat::Status status = controller.start("carry", 0);
  for (double t = 0; t < 40 && status == icat::Status::ok; t += dt) {
    const Vector3 goal = loop(t);
    status = robot.update(plant.q());
    if (status == icat::Status::ok) status = carry.set_goal(goal, (loop(t + dt) - goal) / dt);
    if (status == icat::Status::ok) status = controller.step(t);
    plant.step(controller.command(), t, dt);

    view.record(t, goal);
    const auto held = support::distance(robot.pose(tray) * grasp, robot.pose(right));
    const Vector3 at = robot.pose(tray).translation();
    grip = std::max(grip, held.position), tilt = std::max(tilt, level.angle());
    if (t > 5) error = std::max(error, (goal - at).norm());
    csv.row({t, at.x(), at.y(), at.z(), goal.x(), goal.y(), goal.z(), plant.q()(0), plant.q()(1),
             held.position, level.angle(), (goal - at).norm()});
  }
  std::printf(
      "%s: hands off their places by %.3f mm at most, tray tilted by %.4f deg, after 5 s off its "
      "loop by %.2f mm\n",
      icat::describe(status), 1e3 * grip, tilt / degree, 1e3 * error);
  if (arguments.pictures) support::draw(arguments.output);
  replay.write(arguments.output, arguments.logs);
  return status == icat::Status::ok && grip < 1e-3 && tilt < 0.1 * degree && error < 5e-3 ? 0 : 1;
}
