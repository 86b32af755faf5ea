// SPDX-License-Identifier: BSD-3-Clause
#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <iostream>

int main() {
  auto robot = icat::uvms(icat::maris_arm<double>());  // an underwater vehicle with an arm
  icat::KinematicPlant plant(robot, {.q = Eigen::VectorXd::Constant(7, -0.4)});
  if (robot.update(plant.q(), plant.base()) != icat::Status::ok) return 1;
  const icat::FrameId tool = robot.frame("tool");
  icat::Pose<double> goal = robot.pose(tool);
  goal.translation() += icat::Vector3<double>(1.5, -0.5, 0.3);  // out of the arm's reach

  icat::task::JointLimits limits(robot, {.margin = 0.1, .gain = 0.5});
  icat::task::FramePose reach(robot, tool, goal, {.gain = 0.5});
  icat::task::Minimality still_vehicle(robot, robot.base_columns());
  icat::Controller controller(robot, {{"reach", {{limits}, {reach}, {still_vehicle}}}});

  const double dt = 0.01;                                         // s; the caller owns the clock
  icat::Status status = controller.switch_to("reach", 0.0, 1.0);  // fades in over 1 s
  for (double t = 0; t < 20 && status == icat::Status::ok; t += dt) {
    status = robot.update(plant.q(), plant.base());
    if (status == icat::Status::ok) status = controller.step(t);
    plant.step(controller.command(), t, dt);
  }
  std::cout.precision(2);
  std::cout << icat::describe(status) << ": tool error " << 1e3 * reach.position_error()
            << " mm, vehicle moved " << plant.base().translation().norm() << " m\n";
}
