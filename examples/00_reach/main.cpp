// SPDX-License-Identifier: BSD-3-Clause
#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <iostream>

int main() {
  icat::Uvms<double, 7> robot({.arm = icat::maris_arm<double>()});  // vehicle and arm, at rest
  icat::KinematicPlant<double, 7> plant({.q = icat::Vector<double, 7>::Constant(-0.4)});
  if (robot.update(plant.q(), plant.vehicle()) != icat::Status::ok) return 1;
  icat::Pose<double> goal = robot.tool();
  goal.translation() += icat::Vector3<double>(1.5, -0.5, 0.3);  // out of the arm's reach

  icat::task::JointLimits limits(robot, {.margin = 0.1, .gain = 0.5});
  icat::task::ToolPose tool(robot, {.goal = goal, .gain = 0.5});
  icat::task::VehicleMotionMinimality still_vehicle(robot);
  icat::Controller controller(robot, {{"reach", {{limits}, {tool}, {still_vehicle}}}});

  const double dt = 0.01;                                         // s; the caller owns the clock
  icat::Status status = controller.switch_to("reach", 0.0, 1.0);  // fades in over 1 s
  for (double t = 0; t < 20 && status == icat::Status::ok; t += dt) {
    status = robot.update(plant.q(), plant.vehicle());
    if (status == icat::Status::ok) status = controller.step(t);
    plant.step(controller.joint_velocity(), controller.vehicle_velocity(), t, dt);
  }
  std::cout.precision(2);
  std::cout << icat::describe(status) << ": tool error "
            << 1e3 * (goal.translation() - robot.tool().translation()).norm()
            << " mm, vehicle moved " << plant.vehicle().translation().norm() << " m\n";
}
