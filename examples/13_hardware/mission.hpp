// SPDX-License-Identifier: BSD-3-Clause
// A vehicle with the MARIS arm brings its tool to a goal and holds it there, on any back-end. When
// the back-end is not healthy the controller stops; when it is again, the mission goes on.
#pragma once

#include <cmath>
#include <icat/icat.hpp>
#include <string>
#include <vector>

#include "../support/geometry.hpp"
#include "../support/uvms.hpp"

namespace reach {

using Robot = icat::KinematicTree<double, 13>;
using Pose = icat::Pose<double>;

inline constexpr double period = 0.01;  // s

inline Robot make_robot() {
  return icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>(),
                                                .tool = support::pose({0, 0, 0.1}, 0, 0, 0)});
}
/// Vehicles of this kind do not actuate roll and pitch: they are measured, and the rest
/// compensates.
inline const icat::Columns given = icat::ColumnRange{10, 2};
/// Of the tool: ahead of where the vehicle begins, to starboard and below, the gripper from above.
inline Pose goal_from(const Pose& vehicle) {
  const icat::Vector3<double> ahead = vehicle.linear().col(0);
  const double heading = std::atan2(ahead.y(), ahead.x());
  const Pose level = support::pose(vehicle.translation(), 0, 0, heading);
  return support::turned_half(level * support::pose({1.6, 0.6, 2.0}, 0, 0, 0.4));
}

struct Sample {
  double t;
  std::size_t phase;  ///< row of the mission's table
  bool healthy;
  double position_error, orientation_error;  ///< of the tool, m, rad
  icat::Vector<double, 7> q;
  icat::Vector3<double> vehicle, tool;
  icat::Vector<double, 13> command;
};

struct Result {
  std::vector<Sample> samples;
  bool held = false;  ///< the mission's end is the one that was wanted
};

/// Runs the mission. `clock(k)` waits for the k-th cycle and says its time, s; `entered(t, phase)`
/// is told of every phase; `observe(controller)` makes what is told of every cycle.
template <icat::BackEnd<Robot> BackEnd, class Clock, class Entered, class Observe>
Result run(BackEnd& back_end, Clock clock, Entered entered, Observe observe) {
  Robot robot = make_robot();
  const icat::FrameId tool = robot.frame("tool");
  icat::task::JointLimits limits(robot, {.margin = 0.15, .gain = 0.5});
  icat::task::FramePose hand(robot, tool, goal_from(robot.pose(robot.base())),
                             {.gain = 0.8, .max_linear_rate = 0.25, .max_angular_rate = 0.3});
  icat::Vector<double, 7> reaching;
  reaching << 0.3, 0.9, -0.2, -1.3, 0.2, 0.8, 0.4;
  icat::task::JointPosition shape(robot, reaching, {.gain = 0.4});
  icat::Controller controller(robot, {{"reach", {{limits}, {hand}, {shape}}}},
                              {.given = given,
                               .limits = {robot,
                                          {.reaction_time = 0.4,
                                           .max_velocity = 0.5,
                                           .max_acceleration = 1,
                                           .base_velocity = {0.4, 0.4, 0.4, 0.3, 0.3, 0.3},
                                           .base_acceleration = {0.5, 0.5, 0.5, 0.5, 0.5, 0.5}}},
                               .time = {.hold = 0.3}});

  support::Distance error{};
  const auto at_goal = [&] { return error.position < 2e-3 && error.orientation < 5e-3; };
  //! [mission]
  const std::vector<icat::Reaction> lost{{.event = "lost", .to = "standby"}};
  icat::Mission mission(
      {{.name = "standby",  // no action: the controller stops
        .fade = 0.3,
        .time_limit = 60,
        .on_timeout = "nobody there",
        .on = {{.event = "well", .to = "reach"}}},
       {.name = "reach",
        .action = "reach",
        .fade = 0.5,
        .until = at_goal,
        .hold = 1,
        .then = "hold",
        .time_limit = 60,
        .on_timeout = "not reached",
        .on = lost},
       {.name = "hold", .action = "reach", .time_limit = 3, .on_timeout = "held", .on = lost},
       {.name = "held", .end = icat::PhaseEnd::success},
       {.name = "nobody there", .end = icat::PhaseEnd::failure},
       {.name = "not reached", .end = icat::PhaseEnd::failure}});
  //! [mission]

  Result result;
  icat::RobotState<Robot> state(robot);
  bool begun = false;
  const auto record = observe(controller);
  //! [loop]
  for (long cycle = 0; mission.end() == icat::PhaseEnd::none; ++cycle) {
    const double t = clock(cycle);
    icat::Status status = back_end.read(t, state);
    if (status == icat::Status::ok) status = robot.update(state.q, state.base);
    const bool well = status == icat::Status::ok && back_end.healthy(t);
    if (well && !begun) begun = hand.set_goal(goal_from(state.base)) == icat::Status::ok;
    error = support::distance(hand.goal(), robot.pose(tool));
    (void)mission.raise(well ? "well" : "lost");
    (void)mission.step(t);
    (void)mission.drive(controller, t);
    const double age = t - state.time;
    (void)controller.step(t, state.velocity, icat::InputAge{age, age, age});
    (void)back_end.write(t, controller.command());
    //! [loop]
    if (mission.entered()) entered(t, std::string(mission.phase()));
    result.samples.push_back({t, mission.index(), well, error.position, error.orientation, state.q,
                              state.base.translation(), robot.pose(tool).translation(),
                              controller.command()});
    record(t, hand.goal().translation(), mission.phase());
  }
  // The last command is zero, for a back-end that holds its last command.
  (void)back_end.write(result.samples.back().t, icat::Vector<double, 13>::Zero());
  result.held = mission.end() == icat::PhaseEnd::success;
  return result;
}

}  // namespace reach
