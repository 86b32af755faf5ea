// SPDX-License-Identifier: BSD-3-Clause
// An arm from a URDF: its tool follows a line that leads through a singularity (the wrist's axes
// align), then out of the workspace and back. Nothing stops and nothing jumps: what cannot be had
// is approached as far as it goes.
#include <cstdio>
#include <icat/adapters/urdf.hpp>
#include <icat/icat.hpp>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/robot_replay.hpp"
#include "../support/support.hpp"

using Vector3 = icat::Vector3<double>;
using Objective = icat::Objective<double>;

// From `a` to `b` between the times `from` and `to`, at rest at both ends.
double between(double t, double from, double to, double a, double b) {
  return a + (b - a) * icat::smooth_step((t - from) / (to - from));
}

int main(int argc, char** argv) {
  const auto arguments =
      support::parse(argc, argv, "An arm from a URDF goes where it cannot.", "out/05_urdf_arm");
  auto robot = icat::load_urdf<double>(ICAT_EXAMPLE_FOLDER "/arm.urdf");
  const icat::FrameId tool = robot.frame("tool");
  Eigen::VectorXd q(robot.dof());
  q << 0.4, 0.5, 1.6, 0.3, -0.5, 0;
  if (robot.update(q) != icat::Status::ok) return 1;

  //! [tasks]
  icat::Pose<double> goal = robot.pose(tool);
  icat::task::JointLimits limits(robot, {.margin = 0.1});
  icat::task::Manipulability dexterity(robot, tool, Objective::at_least(0, 0.002));
  icat::task::FramePosition position(robot, tool, goal.translation(), {.gain = 2, .max_rate = 0.1});
  icat::task::FrameOrientation orientation(robot, tool, goal.linear(),
                                           {.gain = 2, .max_rate = 0.5});
  // The more an arm is regularized, the slower its joints where it is stretched, and the farther it
  // is off there. At most 1 / (2 sqrt(0.01)) = 5 rad/s for each m/s of the tool.
  icat::Controller controller(robot, {{"follow", {{limits}, {position}, {orientation}}}},
                              {.solver = {.regularization = {.lambda = 0.01, .threshold = 0.05}}});
  //! [tasks]

  support::Replay replay("An arm goes where it cannot: a singular wrist, out of reach");
  support::RobotReplay view(replay, controller, {.frames = {"tool"}});
  support::Csv csv(arguments.output, "run.csv", "t,error,turn,mu,speed,step,height,reach");
  const Vector3 start = goal.translation();
  const double dt = 0.005;
  double worst_step = 0, farthest = 0, least = 1;
  Eigen::VectorXd last = Eigen::VectorXd::Zero(robot.dof());
  icat::Status status = controller.switch_to("follow", 0, 0.5);
  for (double t = 0; t < 60 && status == icat::Status::ok; t += dt) {
    // Up and sideways through the singularity, then 0.6 m away from the base and back.
    goal.translation() = start + Vector3(between(t, 20, 32, 0, 0.5) - between(t, 36, 48, 0, 0.5),
                                         between(t, 1, 9, 0, -0.35) + between(t, 10, 18, 0, 0.35),
                                         between(t, 1, 9, 0, 0.3) - between(t, 10, 18, 0, 0.3));
    status = position.set_goal(goal.translation());
    if (status == icat::Status::ok) status = controller.step(t);
    q += dt * controller.velocity();
    if (status == icat::Status::ok) status = robot.update(q);

    view.record(t, goal.translation());
    dexterity.update();
    const double off = (goal.translation() - robot.pose(tool).translation()).norm();
    const double step = (controller.velocity() - last).norm();
    last = controller.velocity();
    worst_step = std::max(worst_step, step);
    least = std::min(least, dexterity.value());
    farthest = std::max(farthest, off);
    csv.row({t, off, orientation.reference().norm() / 2, dexterity.value(),
             last.cwiseAbs().maxCoeff(), step, robot.pose(tool).translation().z(),
             robot.pose(tool).translation().head<2>().norm()});
  }
  const double end = (goal.translation() - robot.pose(tool).translation()).norm();
  std::printf(
      "%s: manipulability down to %.1e; out of the workspace the tool stays %.0f mm short;\n"
      "back at its goal to %.1e mm; the largest change of a command in %.0f ms is %.3f rad/s\n",
      icat::describe(status), least, 1e3 * farthest, 1e3 * end, 1e3 * dt, worst_step);
  if (arguments.pictures) support::draw(arguments.output);
  replay.write(arguments.output, arguments.logs);
  return status == icat::Status::ok && end < 1e-4 && farthest > 0.1 && worst_step < 0.1 ? 0 : 1;
}
