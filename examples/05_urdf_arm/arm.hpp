// SPDX-License-Identifier: BSD-3-Clause
// The arm of arm.urdf along a line: robot, tasks, controller and loop.
#pragma once

#include <icat/adapters/urdf.hpp>
#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <icat/sim/plant_back_end.hpp>
#include <string>

namespace arm {

using Robot = icat::KinematicTree<double>;
using Controller = icat::Controller<Robot>;
using Vector3 = icat::Vector3<double>;
using Objective = icat::Objective<double>;

inline constexpr double dt = 0.005;  // s

// From `a` to `b` between the times `from` and `to`, at rest at both ends.
inline double between(double t, double from, double to, double a, double b) {
  return a + (b - a) * icat::smooth_step((t - from) / (to - from));
}

/// What every cycle shows.
struct Cycle {
  double t;
  const Robot& robot;
  Vector3 goal, tool;
  double turn, manipulability;  ///< left of the orientation, rad; m³
  const Eigen::VectorXd& velocity;
  const Controller& controller;
};

/// 60 s along the line; `observe(cycle)` at the end of each.
template <class Observe>
icat::Status run(const std::string& urdf, Observe observe) {
  Robot robot = icat::load_urdf<double>(urdf);
  const icat::FrameId tool = robot.frame("tool");
  Eigen::VectorXd q(robot.dof());
  q << 0.4, 0.5, 1.6, 0.3, -0.5, 0;
  if (const auto status = robot.update(q); status != icat::Status::ok) return status;

  //! [tasks]
  icat::Pose<double> goal = robot.pose(tool);
  icat::task::JointLimits limits(robot, {.margin = 0.1});
  icat::task::Manipulability dexterity(robot, tool, Objective::at_least(0, 0.002));
  icat::task::FramePosition position(robot, tool, goal.translation(), {.gain = 2, .max_rate = 0.1});
  icat::task::FrameOrientation orientation(robot, tool, goal.linear(),
                                           {.gain = 2, .max_rate = 0.5});
  // The more an arm is regularized, the slower its joints where it is stretched, and the farther it
  // is off there. At most 1 / (2 sqrt(0.01)) = 5 rad/s for each m/s of the tool.
  Controller controller(robot, {{"follow", {{limits}, {position}, {orientation}}}},
                        {.solver = {.regularization = {.lambda = 0.01, .threshold = 0.05}}});
  //! [tasks]

  icat::KinematicPlant<Robot> plant(robot, {.q = q});
  icat::PlantBackEnd back_end(robot, plant);
  icat::RobotState<Robot> state(robot);
  const Vector3 start = goal.translation();
  icat::Status status = controller.switch_to("follow", 0, 0.5);
  for (int cycle = 0; cycle < 12000 && status == icat::Status::ok; ++cycle) {
    const double t = cycle * dt;
    // Up and sideways through the singularity, then 0.5 m away from the base and back.
    goal.translation() = start + Vector3(between(t, 20, 32, 0, 0.5) - between(t, 36, 48, 0, 0.5),
                                         between(t, 1, 9, 0, -0.35) + between(t, 10, 18, 0, 0.35),
                                         between(t, 1, 9, 0, 0.3) - between(t, 10, 18, 0, 0.3));
    status = position.set_goal(goal.translation());
    if (status == icat::Status::ok) status = back_end.read(t, state);
    if (status == icat::Status::ok) status = robot.update(state.q);
    if (status == icat::Status::ok) status = controller.step(t);
    if (status == icat::Status::ok) status = back_end.write(t, controller.command());
    dexterity.update();
    observe(Cycle{t, robot, goal.translation(), robot.pose(tool).translation(),
                  orientation.reference().norm() / 2, dexterity.value(), controller.velocity(),
                  controller});
  }
  return status;
}

}  // namespace arm
