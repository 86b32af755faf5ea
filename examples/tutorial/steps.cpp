// SPDX-License-Identifier: BSD-3-Clause
// Six steps, each a function that docs/tutorial.md shows. `broken` stands in the one line that
// makes the difference: change it, or another one, and run the program again.
#include "steps.hpp"

#include <cmath>
#include <numbers>

#include "stage.hpp"

namespace tutorial {
namespace {

using Vector3 = icat::Vector3<double>;
using Objective = icat::Objective<double>;

Outcome reach_a_point(Stage& stage) {
  const bool broken = stage.broken;
  //! [1]
  Robot robot = make_arm();
  icat::KinematicPlant plant(robot, {.q = bent()});

  const Vector3 goal(broken ? 1.4 : 0.7, 0.3, 0.5);  // m; the arm reaches 1 m from its shoulder
  icat::task::FramePosition reach(robot, robot.frame("end_effector"), goal,
                                  {.name = "reach", .max_rate = 0.2});
  icat::Controller controller(robot, {{"work", {{reach}}}});

  (void)controller.switch_to("work", 0, 1);  // fades in over 1 s
  return stage.run(robot, plant, controller, goal, [&](double t) { return controller.step(t); });
  //! [1]
}

Outcome order_priorities(Stage& stage) {
  const bool broken = stage.broken;
  //! [2]
  Robot robot = make_arm();
  icat::KinematicPlant plant(robot, {.q = bent()});

  const Vector3 goal(0.5, -0.3, 0);  // on the floor, beside the pedestal
  icat::task::JointLimits limits(robot, {.margin = 0.3});
  icat::task::FramePosition reach(robot, robot.frame("end_effector"), goal,
                                  {.name = "reach", .max_rate = 0.2});
  using Levels = std::vector<icat::PriorityLevel<Robot>>;
  const Levels levels = broken ? Levels{{reach}, {limits}} : Levels{{limits}, {reach}};
  icat::Controller controller(robot, {{"work", levels}});

  (void)controller.switch_to("work", 0, 1);
  return stage.run(robot, plant, controller, goal, [&](double t) { return controller.step(t); });
  //! [2]
}

Outcome change_actions(Stage& stage) {
  const bool broken = stage.broken;
  stage.seconds = 14;
  stage.ask = 7;
  //! [3]
  Robot robot = make_arm();
  icat::KinematicPlant plant(robot, {.q = bent()});

  const Vector3 goal(0.5, 0.5, 0.4);
  icat::task::JointLimits limits(robot);
  icat::task::FramePosition reach(robot, robot.frame("end_effector"), goal,
                                  {.name = "reach", .max_rate = 0.2});
  icat::task::JointPosition park(robot, bent(), {.name = "park"});
  icat::Controller controller(
      robot, {{"work", {{limits}, {reach}}}, {"home", {{limits}, {park}}}},
      {.limits = icat::MotionLimits(robot, {.reaction_time = 0.02, .max_acceleration = 0.3})});

  const auto never = [] { return false; };
  icat::Mission mission({{.name = "work",
                          .action = "work",
                          .until = never,
                          .then = "home",
                          .time_limit = 6,
                          .on_timeout = "home"},
                         {.name = "home",
                          .action = "home",
                          .fade = broken ? 0.01 : 3,
                          .until = never,
                          .then = "done",
                          .time_limit = 10,
                          .on_timeout = "done"},
                         {.name = "done", .end = icat::PhaseEnd::success}});
  return stage.run(robot, plant, controller, goal, [&](double t) {
    (void)mission.step(t);
    (void)mission.drive(controller, t);  // switches where the mission has entered a phase
    return controller.step(t);
  });
  //! [3]
}

Outcome ride_a_vehicle(Stage& stage) {
  const bool broken = stage.broken;
  stage.seconds = 20;
  stage.ask = 20;
  stage.box = 0.8;
  //! [4]
  Robot robot = make_arm(icat::Base<double>::free());  // the same arm under a vehicle; z down
  const icat::ColumnRange surge{robot.base_columns().first, 1}, none{};
  icat::KinematicPlant plant(robot, {.q = bent(),
                                     .not_actuated = broken ? surge : none,  // its thrusters
                                     .current = [](double t) {
                                       return Vector3(0, 0.05 * std::sin(t), 0);  // m/s
                                     }});

  const Vector3 goal(3, 0.3, 1);  // m; the vehicle has to come nearer
  icat::task::JointLimits limits(robot);
  icat::task::FramePosition reach(robot, robot.frame("end_effector"), goal,
                                  {.name = "reach", .max_rate = 0.2});
  icat::task::Minimality still_arm(robot, icat::joint_columns(robot), "still arm");
  icat::ParallelController controller(robot, {{"work", {{limits}, {reach}, {still_arm}}}});

  (void)controller.switch_to("work", 0, 1);
  return stage.run(robot, plant, controller, goal, [&](double t) {
    return controller.step(t, plant.velocity());  // what the vehicle does, as it is measured
  });
  //! [4]
}

Outcome follow_a_point(Stage& stage) {
  const bool broken = stage.broken;
  //! [5]
  Robot robot = make_arm();
  icat::KinematicPlant plant(robot, {.q = bent()});

  const double rate = broken ? 2 : 0.5;  // rad/s, round a circle of 0.2 m
  const auto circle = [=](double t) {
    return Vector3(0.55, 0.2 * std::sin(rate * t), 0.5 + 0.2 * std::cos(rate * t));
  };
  const auto speed = [=](double t) {
    return Vector3(0, 0.2 * rate * std::cos(rate * t), -0.2 * rate * std::sin(rate * t));
  };
  Vector3 goal = circle(0);
  icat::task::JointLimits limits(robot);
  icat::task::FramePosition follow(robot, robot.frame("end_effector"), goal, {.name = "follow"});
  icat::Controller controller(robot, {{"work", {{limits}, {follow}}}},
                              {.limits = icat::MotionLimits(robot, {.max_velocity = 0.5})});

  (void)controller.switch_to("work", 0, 1);
  return stage.run(robot, plant, controller, goal, [&](double t) {
    goal = circle(t);
    (void)follow.set_goal(goal, speed(t));
    return controller.step(t);
  });
  //! [5]
}

Outcome write_a_task(Stage& stage) {
  const bool broken = stage.broken;
  if (broken) stage.ask = 2.1;
  //! [6]
  Robot robot = make_arm();
  const icat::FrameId tool = robot.frame("end_effector");
  icat::KinematicPlant plant(robot, {.q = bent()});

  double table = 0;  // m, the height of the table as a sensor has it
  const auto height = [&](const Robot& r, auto x, auto J) {
    x(0) = r.pose(tool).translation().z() - table;
    J.row(0) = r.jacobian(tool).row(2);
  };
  icat::task::FunctionTask<Robot> clear(robot, Objective::at_least(0.2, 0.1), height,
                                        {.name = "clear of the table", .length_power = 1});
  const Vector3 goal(0.6, 0.2, 0.1);  // too near to the table
  icat::task::FramePosition reach(robot, tool, goal, {.name = "reach", .max_rate = 0.2});
  icat::Controller controller(robot, {{"work", {{clear}, {reach}}}});

  (void)controller.switch_to("work", 0, 1);
  return stage.run(robot, plant, controller, goal, [&](double t) {
    if (broken && t > 2) table = std::nan("");  // the sensor has lost the table
    return controller.step(t);
  });
  //! [6]
}

}  // namespace

const char* title(int step) {
  constexpr const char* titles[] = {"reach a point",  "order priorities",
                                    "change actions", "ride on a vehicle",
                                    "follow a point", "write a task of your own"};
  return titles[step - 1];
}

Outcome run(int step, Form form, support::Replay* replay) {
  constexpr Outcome (*functions[])(Stage&) = {reach_a_point,  order_priorities, change_actions,
                                              ride_a_vehicle, follow_a_point,   write_a_task};
  Stage stage{.broken = form == Form::broken, .replay = replay};
  return functions[step - 1](stage);
}

}  // namespace tutorial
