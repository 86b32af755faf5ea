// SPDX-License-Identifier: BSD-3-Clause
// The reference mission: a vehicle with the MARIS arm comes from a few metres away, grasps a pipe
// on the seabed and lifts it 0.5 m. Tasks and their order are those of [Coop, III-E], phases those
// of [Coop, Table I] for one vehicle.
#pragma once

#include <algorithm>
#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <icat/sim/plant_back_end.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "../support/geometry.hpp"
#include "../support/recorder.hpp"
#include "../support/uvms.hpp"

namespace grasp {

using support::pose;
using Robot = support::Uvms;
using Pose = icat::Pose<double>;
using Vector3 = icat::Vector3<double>;
using Vector6 = icat::Vector6<double>;
using Objective = icat::Objective<double>;

struct Variant {
  bool underactuated = false;  ///< roll and pitch are not actuated
  bool current = false;        ///< a sinusoidal current along x of the world
  bool compensation = false;   ///< two parallel TPIKs: the arm compensates the vehicle's error
  double time_limit = 40;      ///< s, of a phase
};

// --- the scene, NED: z points down ---------------------------------------------------------------

inline constexpr double heading = 0.6;            ///< of the vehicle at the pipe, rad
inline const Vector3 pipe_centre{0.5, 0.5, 3.0};  ///< [Coop, V]
inline const Vector3 companion{-1.3, -0.3, 1.4};  ///< another vehicle, hovering on the way
inline const double companion_distance = 1.0;     ///< to be kept from it, m
inline const double lift_height = 0.5;

/// The pipe lies across the heading. The gripper approaches from above, its y axis along the pipe.
inline Pose grasp_goal() { return support::turned_half(pose(pipe_centre, 0, 0, heading)); }
inline Pose lift_goal() {
  Pose goal = grasp_goal();
  goal.translation().z() -= lift_height;
  return goal;
}
/// Hovering above the pipe and behind it, the arm in its initial shape some 0.4 m short of it.
inline Pose hover_goal() {
  return support::moved(pose(pipe_centre, 0, 0, heading), {-0.65, -0.1, -1.6});
}

/// Of ⟨c⟩ on the vehicle: it looks down.
inline Pose camera_mount() { return pose({0.45, 0, 0.35}, 0, 0, 0); }

inline Robot make_robot() {
  return icat::uvms(icat::maris_arm<double>(),
                    {.arm = icat::maris_arm_mount<double>(),
                     .camera = camera_mount(),
                     .tool = pose({0, 0, 0.1}, 0, 0, 0)});  // the gripper
}

// --- what is recorded ----------------------------------------------------------------------------

struct Sample : support::RobotSample {
  double t;
  std::string action;
  double position_error, orientation_error;  ///< of the tool, to the goal of the phase
  double distance, vehicle_position, vehicle_orientation;
  std::vector<double> activations;  ///< the largest of each task's rows
};

struct Result {
  std::vector<Sample> samples;
  std::vector<std::string> tasks;                      ///< names of the columns of `activations`
  std::vector<std::pair<std::string, double>> phases;  ///< action and the time it began
  std::string outcome;                                 ///< the phase that ended the mission
  bool grasped = false, lifted = false;                ///< within tolerance when the phase ended
  double grasp_position_error = 0, grasp_orientation_error = 0;  ///< m, rad, when it closed
  double lift_position_error = 0, lift_orientation_error = 0;
  double largest_step = 0;              ///< max ‖Δẏ‖ between two cycles, from standstill on
  double steady_error = 0;              ///< max tool position error, last 10 s of the grasp
  std::vector<std::string> violations;  ///< inequality objectives violated after they had been met
  icat::Status status = icat::Status::ok;  ///< of the last cycle
};

/// What every cycle shows at its end.
struct Cycle {
  double t;
  Robot& robot;
  icat::ParallelController<Robot>& controller;  ///< moves the robot with compensation
  icat::Controller<Robot>& whole_body;          ///< moves it without
  const Vector6& vehicle_velocity;              ///< as it was measured
};

// Thresholds of the inequality objectives.
inline constexpr double minimum_manipulability = 0.08;
inline constexpr double maximum_centering = 0.2;
inline constexpr double maximum_attitude = 0.2;
inline constexpr double hover_position = 0.12, hover_orientation = 0.1;

/// Where the mission begins.
inline Pose start(const Variant& variant) {
  return variant.underactuated ? pose({-3, -1.2, 0.6}, 0.03, 0.02, -0.7)
                               : pose({-3, -1.2, 0.6}, 0.25, -0.2, -0.7);
}
/// Columns that are not actuated: none, or roll and pitch.
inline icat::Columns given(const Variant& variant) {
  return variant.underactuated ? icat::ColumnRange{10, 2} : icat::ColumnRange{};
}

/// Runs the mission on `back_end` with a period of `dt`. Every cycle ends with `observe(cycle)`.
template <icat::BackEnd<Robot> BackEnd, class Observe>
Result run(const Variant& variant, double dt, BackEnd& back_end, Observe observe) {
  Robot robot = make_robot();
  const icat::FrameId vehicle = robot.base(), tool = robot.frame("tool"),
                      camera = robot.frame("camera");

  //! [tasks]
  icat::task::JointLimits joint_limits(robot, {.margin = 0.15, .gain = 0.5});
  icat::task::FrameDistance vehicle_distance(robot, vehicle, companion,
                                             Objective::at_least(companion_distance, 0.3),
                                             {.name = "vehicle distance", .gain = 0.5});
  icat::task::Manipulability manipulability(robot, tool,
                                            Objective::at_least(minimum_manipulability, 0.01));
  icat::task::LookAt centering(robot, camera, pipe_centre,
                               {.name = "camera centering",
                                .norm = Objective::at_most(maximum_centering, 0.1),
                                .gain = 0.5});
  icat::task::Attitude attitude(robot, vehicle,
                                {.name = "horizontal attitude",
                                 .norm = Objective::at_most(maximum_attitude, 0.1),
                                 .gain = 0.5});
  icat::task::FramePose vehicle_pose(
      robot, vehicle, hover_goal(),
      {.name = "vehicle pose",
       .norms = {{.position = Objective::at_most(hover_position, 0.1).toward(0),
                  .orientation = Objective::at_most(hover_orientation, 0.08).toward(0)}},
       .gain = 0.6,
       .max_linear_rate = 0.4,
       .max_angular_rate = 0.3});
  const auto to = [](const char* name) {
    return icat::task::FramePose<Robot>::Options{
        .name = name, .gain = 0.8, .max_linear_rate = 0.15, .max_angular_rate = 0.3};
  };
  icat::task::FramePose tool_grasp(robot, tool, grasp_goal(), to("tool to grasp"));
  icat::task::FramePose tool_lift(robot, tool, lift_goal(), to("tool to lift"));
  icat::task::Minimality still_arm(robot, icat::joint_columns(robot), "still arm");
  icat::task::Minimality still_vehicle(robot, robot.base_columns(), "still vehicle");
  //! [tasks]

  //! [actions]
  std::vector<icat::Action<Robot>> actions{{"navigate",
                                            {{joint_limits},
                                             {vehicle_distance},
                                             {manipulability},
                                             {attitude},
                                             {vehicle_pose},
                                             {still_arm}}},
                                           {"grasp",
                                            {{joint_limits},
                                             {vehicle_distance},
                                             {manipulability},
                                             {centering},
                                             {attitude},
                                             {tool_grasp},
                                             {still_vehicle}}},
                                           {"lift",
                                            {{joint_limits},
                                             {vehicle_distance},
                                             {manipulability},
                                             {attitude},
                                             {tool_lift},
                                             {still_arm}}}};
  //! [actions]
  if (variant.underactuated) {
    // Roll and pitch are passively stable; their objective is for vehicles that control them
    // [Coop, II-D5].
    for (auto& action : actions) {
      std::erase_if(action.levels, [&](const auto& level) { return &level[0].get() == &attitude; });
    }
  }

  //! [controller]
  const icat::Controller<Robot>::Options options{
      .given = given(variant),
      .solver = {.bounds = support::velocity_bounds(0.5, 0.5, 0.4)},
      .characteristic_length = 1};  // rows as in the paper
  icat::ParallelController controller(robot, actions, options);
  //! [controller]
  icat::Controller whole_body(robot, actions, options);  // without compensation: TPIK 1 alone

  Result result;
  std::vector<icat::Task<Robot>*> watched;
  for (const auto& level : controller.first().hierarchy()) {
    for (const auto& entry : level) {
      result.tasks.push_back(entry.task->name());
      watched.push_back(entry.task);
    }
  }

  // Objectives that must hold after they have been met once, and the actions in which they are
  // active.
  struct Watch {
    const char* name;
    std::string_view only_in;  // empty: always
    double (*excess)(const Sample&);
    bool entered = false, left = false;  // one that is not watched counts as entered
  };
  Watch watches[] = {
      {"joint limits", "", [](const Sample& s) { return -s.joint_margin; }},
      {"vehicle distance", "", [](const Sample& s) { return companion_distance - s.distance; }},
      {"manipulability", "",
       [](const Sample& s) { return minimum_manipulability - s.manipulability; }},
      {"camera centering", "grasp",
       [](const Sample& s) { return s.centering - maximum_centering; }},
      {"horizontal attitude", "", [](const Sample& s) { return s.attitude - maximum_attitude; },
       variant.underactuated},
      {"vehicle position", "navigate",
       [](const Sample& s) { return s.vehicle_position - hover_position; }},
      {"vehicle orientation", "navigate",
       [](const Sample& s) { return s.vehicle_orientation - hover_orientation; }}};

  support::Recorder recorder(robot, tool, tool, camera, pipe_centre, manipulability);
  Sample s;  // of the present cycle
  icat::RobotState<Robot> state(robot);
  const auto measure = [&](double t) {
    s.t = t;
    s.action = controller.action();
    recorder.record(variant.compensation ? controller.velocity() : whole_body.velocity(),
                    state.velocity.tail<6>(), s);
    const Pose goal = s.action == "lift" ? lift_goal() : grasp_goal();
    const auto error = support::distance(goal, s.tool),
               hover = support::distance(hover_goal(), s.vehicle);
    s.position_error = error.position;
    s.orientation_error = error.orientation;
    s.vehicle_position = hover.position;
    s.vehicle_orientation = hover.orientation;
    s.distance = support::distance(pose(companion, 0, 0, 0), s.vehicle).position;
    s.activations.clear();
    for (std::size_t i = 0; i < watched.size(); ++i) {
      s.activations.push_back(controller.first().phase_activations()[i] *
                              watched[i]->activation().maxCoeff());
    }
  };

  const auto in_phase = [&] { return s.t - result.phases.back().second; };
  const auto hovering = [&] {
    return s.vehicle_position < hover_position && s.vehicle_orientation < hover_orientation;
  };
  const auto at_goal = [&] {
    return s.position_error < 5e-4 && s.orientation_error < 5e-4 && !controller.in_transition();
  };
  // In a current the error never settles: hold for 40 s, and close when the tool passes the goal
  // next.
  const double time_limit = variant.time_limit;
  const auto closing = [&] { return at_goal() && (!variant.current || in_phase() > time_limit); };
  //! [mission]
  icat::Mission mission({{.name = "navigate",
                          .action = "navigate",
                          .until = hovering,
                          .hold = 3,
                          .then = "grasp",
                          .time_limit = time_limit,
                          .on_timeout = "not at the pipe"},
                         {.name = "grasp",
                          .action = "grasp",
                          .until = closing,
                          .then = "lift",
                          .time_limit = time_limit + 10,
                          .on_timeout = "not grasped"},
                         {.name = "lift",
                          .action = "lift",
                          .until = at_goal,
                          .then = "lifted",
                          .time_limit = time_limit,
                          .on_timeout = "not lifted"},
                         {.name = "lifted", .end = icat::PhaseEnd::success},
                         {.name = "not at the pipe", .end = icat::PhaseEnd::failure},
                         {.name = "not grasped", .end = icat::PhaseEnd::failure},
                         {.name = "not lifted", .end = icat::PhaseEnd::failure}});
  mission.check_actions(whole_body);
  //! [mission]
  // One mission for both controllers.
  const auto supervise = [&](double t) {
    icat::Status status = mission.step(t);
    if (status == icat::Status::ok) status = mission.drive(whole_body, t);
    return status == icat::Status::ok ? mission.drive(controller, t) : status;
  };
  icat::Status status = supervise(0);
  result.phases.emplace_back("navigate", 0);
  Eigen::Matrix<double, 13, 1> last = Eigen::Matrix<double, 13, 1>::Zero();
  //! [loop]
  for (int cycle = 0; status == icat::Status::ok; ++cycle) {
    const double t = cycle * dt;
    status = back_end.read(t, state);
    if (status == icat::Status::ok) status = robot.update(state.q, state.base);
    if (status != icat::Status::ok) break;
    status = controller.step(t, Vector6(state.velocity.tail<6>()));
    if (status == icat::Status::ok && !variant.compensation) {
      status = whole_body.step(t, state.velocity);
    }
    if (status == icat::Status::ok) {
      status =
          back_end.write(t, variant.compensation ? controller.command() : whole_body.command());
    }
    //! [loop]
    const Vector6 vehicle_velocity = state.velocity.tail<6>();
    observe(Cycle{t, robot, controller, whole_body, vehicle_velocity});
    measure(t);
    result.largest_step = std::max(result.largest_step, (s.command - last).norm());
    last = s.command;
    for (Watch& w : watches) {
      if (variant.underactuated && std::string_view(w.name) == "horizontal attitude") continue;
      if (!w.only_in.empty() && (w.only_in != s.action || controller.in_transition())) continue;
      const bool inside = w.excess(s) <= 0;
      if (w.entered && !inside) w.left = true;
      w.entered = w.entered || inside;
    }
    result.samples.push_back(s);

    // In a current the last 10 of the 40 s are judged.
    if (s.action == "grasp" && variant.current && in_phase() > time_limit - 10 &&
        in_phase() <= time_limit) {
      result.steady_error = std::max(result.steady_error, s.position_error);
    }
    status = supervise(t);
    if (!mission.entered()) continue;
    const bool reached = mission.cause() == icat::Cause::condition;
    if (mission.previous() == "grasp") {
      result.grasped = reached;
      result.grasp_position_error = s.position_error;
      result.grasp_orientation_error = s.orientation_error;
    } else if (mission.previous() == "lift") {
      result.lifted = reached;
      result.lift_position_error = s.position_error;
      result.lift_orientation_error = s.orientation_error;
    }
    if (mission.end() != icat::PhaseEnd::none) {
      result.outcome = mission.phase();
      break;
    }
    result.phases.emplace_back(mission.action(), t);
  }
  result.status = status;
  for (const Watch& w : watches) {
    if (w.left || !w.entered) result.violations.push_back(w.name);
  }
  return result;
}
/// The same without dynamics.
template <class Observe>
Result run(const Variant& variant, double dt, Observe observe) {
  const Robot robot = make_robot();
  icat::KinematicPlant<Robot> plant(
      robot, {.q = support::folded_arm(),
              .base = start(variant),
              .not_actuated = given(variant),
              .current = variant.current ? support::sinusoidal_current : nullptr});
  icat::PlantBackEnd back_end(robot, plant);
  return run(variant, dt, back_end, observe);
}
inline Result run(const Variant& variant, double dt = 0.01) {
  return run(variant, dt, [](const Cycle&) {});
}

}  // namespace grasp
