// SPDX-License-Identifier: BSD-3-Clause
// The mission of [Coop, V-A]: two vehicles come to a pipe on the seabed, grasp it at both ends,
// carry it to another place while turning it, set it down and step back. Tasks and their order are
// those of [Coop, III-E], phases and activations those of its Table I.
#pragma once

#include <array>
#include <functional>
#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "../support/geometry.hpp"
#include "../support/recorder.hpp"
#include "../support/uvms.hpp"

namespace cooperation {

using support::pose;
using Robot = support::Uvms;
using Pose = icat::Pose<double>;
using Vector3 = icat::Vector3<double>;
using Vector6 = icat::Vector6<double>;
using support::Command;
using Objective = icat::Objective<double>;

struct Variant {
  bool current = false;       ///< a sinusoidal current along x of the world, on both vehicles
  bool compensation = false;  ///< the arms compensate the vehicles' errors
  bool centralized = false;   ///< one solver for both robots, instead of two that exchange 192 bits
  icat::FusionPolicy<double> policy = icat::fusion::mean<double>();  ///< the paper's
  bool spans = false;                                                ///< exchanged too
  double patience = 2;  ///< a phase may take so often what it takes in the paper, and 3 s
};

// --- the scene, NED: z points down ---------------------------------------------------------------

// [Coop, V]: the pipe's centre, the grasps, the goals. The pipe lies along x of its frame.
inline constexpr double quarter = std::numbers::pi / 2;
inline const Pose pipe_start = pose({0.5, 0.5, 3}, 0, 0, 0);
inline const Pose pre_deployment = pose({3, 5, 2}, 0, 0, quarter);
inline const Pose deployment = pose({3, 5, 3}, 0, 0, quarter);
inline constexpr double grasp_distance = 1.5, step_back = 0.5;

/// Grippers come from above, their y axis along the pipe. `side` is −1 for robot a, +1 for b.
inline Pose grasp_on_pipe(double side) {
  return support::turned_half(pose({side * grasp_distance, 0, 0}, 0, 0, quarter));
}
/// Where the vehicle hovers before it grasps: above the pipe and behind it, facing it.
inline Pose hover(double side) {
  return pipe_start * pose({side * grasp_distance, -0.33, -1.52}, 0, 0, quarter);
}
inline Pose start(double side) {
  return side < 0 ? pose({-0.6, -1.7, 0.9}, 0.12, -0.1, 0.9)
                  : pose({1.7, -1.8, 1.0}, -0.1, 0.1, 2.2);
}

// --- one set of gains, margins and limits for the whole mission ----------------------------------

inline constexpr double dt = 0.01;   ///< s
inline constexpr double fade = 2.0;  ///< s, of all transitions, "a couple of seconds"
inline constexpr double minimum_distance = 2.0, distance_margin = 0.5;  // m
inline constexpr double minimum_manipulability = 0.05, manipulability_margin = 0.06;
inline constexpr double maximum_attitude = 0.2, attitude_margin = 0.1;     // rad
inline constexpr double maximum_centering = 0.2, centering_margin = 0.15;  // rad
inline constexpr double hover_position = 0.15, hover_orientation = 0.1;    // m, rad
inline constexpr double limit_margin = 0.2;                                // rad
inline constexpr double tool_angular = 0.12;                               // rad/s
/// Of a tool task: gain, 1/s, and largest linear rate, m/s.
struct Pull {
  double gain, speed;
};
inline constexpr Pull to_grasp{1, 0.15}, to_pre_deployment{1.4, 0.254}, to_seabed{10, 0.19},
    to_step_back{1.4, 0.15};
inline constexpr double vehicle_gain = 0.8, vehicle_linear = 0.5, vehicle_angular = 0.35;
inline constexpr double joint_speed = 1.0, vehicle_speed = 0.8, vehicle_turn = 0.6;
inline constexpr double settle = 2.5;  ///< s, the phases around the firm grasp, as in the paper

inline icat::Controller<Robot>::Options controller_options() {
  return {.solver = {.bounds = support::velocity_bounds(joint_speed, vehicle_speed, vehicle_turn)},
          .characteristic_length = 1};  // rows as in the paper
}

/// Of ⟨c⟩ on the vehicle: it looks down and ahead.
inline Pose camera_mount() { return pose({0.45, 0, 0.35}, 0, 0.15, 0); }

inline Robot make_robot() {
  Robot robot = icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>(),
                                                       .camera = camera_mount(),
                                                       .tool = pose({0, 0, 0.1}, 0, 0, 0)});
  robot.add_frame("gripper", robot.frame("tool"), Pose::Identity());
  return robot;
}

/// A robot with its tasks, its actions and its plant.
class Side {
 public:
  Side(double side, const Variant& variant)
      : robot(make_robot()),
        tool(robot.frame("tool")),
        gripper(robot.frame("gripper")),
        camera(robot.frame("camera")),
        plant(robot, {.q = support::folded_arm(),
                      .base = start(side),
                      .current = variant.current ? support::sinusoidal_current : nullptr}),
        joint_limits(robot, {.margin = limit_margin, .to_middle = true, .gain = 0.5}),
        vehicle_distance(robot, robot.base(), start(-side).translation(),
                         Objective::at_least(minimum_distance, distance_margin), {.gain = 0.5}),
        manipulability(robot, tool,
                       Objective::at_least(minimum_manipulability, manipulability_margin)),
        centering(robot, camera, (pipe_start * grasp_on_pipe(side)).translation(),
                  {.norm = Objective::at_most(maximum_centering, centering_margin), .gain = 0.5}),
        attitude(robot, robot.base(),
                 {.norm = Objective::at_most(maximum_attitude, attitude_margin), .gain = 0.5}),
        vehicle_pose(
            robot, robot.base(), hover(side),
            {.name = "vehicle pose",
             .norms = {{.position = Objective::at_most(hover_position, 0.1).toward(0),
                        .orientation = Objective::at_most(hover_orientation, 0.08).toward(0)}},
             .gain = vehicle_gain,
             .max_linear_rate = vehicle_linear,
             .max_angular_rate = vehicle_angular}),
        tool_grasp(robot, tool, pipe_start * grasp_on_pipe(side), with("tool to grasp", to_grasp)),
        tool_transport(robot, tool, pre_deployment,
                       with("tool to pre-deployment", to_pre_deployment)),
        tool_deploy(robot, tool, deployment, with("tool to deployment", to_seabed)),
        tool_away(robot, tool, away_goal(side), with("tool to step back", to_step_back)),
        still_arm(robot, icat::joint_columns(robot)),
        still_vehicle(robot, robot.base_columns()),
        recorder(robot, tool, gripper, camera, (pipe_start * grasp_on_pipe(side)).translation(),
                 manipulability) {}

  //! [actions]
  std::vector<icat::Action<Robot>> actions() {
    const icat::PriorityLevel<Robot> limits{joint_limits}, distance{vehicle_distance},
        dexterity{manipulability}, view{centering}, level{attitude};
    return {{"navigate", {limits, distance, dexterity, level, {vehicle_pose}, {still_arm}}},
            {"grasp", {limits, distance, dexterity, view, level, {tool_grasp}, {still_vehicle}}},
            {"join", {limits, distance, dexterity, level, {tool_grasp}, {still_arm}}},
            {"transport", {limits, distance, dexterity, level, {tool_transport}, {still_arm}}},
            {"deploy", {limits, distance, dexterity, level, {tool_deploy}, {still_vehicle}}},
            {"part", {limits, distance, dexterity, level, {tool_deploy}, {still_vehicle}}},
            {"step back", {limits, distance, dexterity, level, {tool_away}, {still_vehicle}}}};
  }
  /// Actions with an agreed tool velocity.
  std::vector<icat::SharedAction<Robot>> shared() {
    return {{"join", tool_grasp}, {"transport", tool_transport}, {"deploy", tool_deploy}};
  }
  //! [actions]

  /// ⟨t⟩ becomes the frame of the object, at its actual pose in the gripper.
  icat::Status take(const Pose& object) {
    const icat::Status status = tool_grasp.set_goal(object);
    return status == icat::Status::ok
               ? robot.set_frame(tool, gripper, robot.pose(gripper).inverse() * object)
               : status;
  }
  /// ⟨t⟩ becomes the gripper again.
  icat::Status leave() {
    const icat::Status status = tool_deploy.set_goal(robot.pose(gripper));
    return status == icat::Status::ok ? robot.set_frame(tool, gripper, Pose::Identity()) : status;
  }

 private:
  static Pose away_goal(double side) {
    Pose goal = deployment * grasp_on_pipe(side);
    goal.translation().z() -= step_back;
    return goal;
  }
  static icat::task::FramePose<Robot>::Options with(const char* name, const Pull& pull) {
    return {.name = name,
            .gain = pull.gain,
            .max_linear_rate = pull.speed,
            .max_angular_rate = tool_angular};
  }

 public:
  Robot robot;
  const icat::FrameId tool, gripper, camera;
  icat::KinematicPlant<Robot> plant;

  icat::task::JointLimits<Robot> joint_limits;
  icat::task::FrameDistance<Robot> vehicle_distance;
  icat::task::Manipulability<Robot> manipulability;
  icat::task::LookAt<Robot> centering;
  icat::task::Attitude<Robot> attitude;
  icat::task::FramePose<Robot> vehicle_pose, tool_grasp, tool_transport, tool_deploy, tool_away;
  icat::task::Minimality<Robot> still_arm, still_vehicle;
  support::Recorder recorder;
};

// --- what is recorded ----------------------------------------------------------------------------

/// Rows of Table I, the joint limits apart.
inline const std::array<const char*, 9> task_names{
    "vehicle_distance", "manipulability", "camera_centering", "horizontal_attitude", "vehicle_pose",
    "tool_pose",        "still_arm",      "still_vehicle",    "agreed_velocity"};

struct RobotSample : support::RobotSample {
  Pose gripper;
  Vector6 tool_velocity;  ///< as it is under the command and the current, components on ⟨t⟩
  std::array<double, 7> limit_activations;
  std::array<double, 9> activations;  ///< as `task_names`; the largest of each task's rows
};

struct Sample {
  double t;
  std::size_t phase;
  std::array<RobotSample, 2> robots;
  bool grasped;                              ///< firmly, by both
  Pose object;                               ///< midway between the two tools while grasped
  double position_error, orientation_error;  ///< of the object to the goal of the phase, m, rad
  double distance;                           ///< between the vehicles, m
  double mismatch;                           ///< ‖J_a ẏ_a − J_b ẏ_b‖
  Vector6 agreed;                            ///< ẋ̂_t
};

/// The tool frame changes at once; with the vehicle's velocity in the loop that takes some cycles.
inline constexpr int event_cycles = 5;

inline const std::array<const char*, 7> phase_names{"navigate", "grasp", "join",     "transport",
                                                    "deploy",   "part",  "step back"};
/// [Coop, V-A]
inline constexpr std::array<double, 7> paper_ends{5.95, 13.2, 15.7, 39.3, 45.04, 47.5, 55};
/// Of the second run, in the current with compensation: when transport begins and ends.
inline constexpr std::array<double, 2> paper_transport_in_current{22.99, 47.85};

/// How long phase `k` took, s, of phases that ended at `ends`.
template <class Ends>
double duration(const Ends& ends, std::size_t k) {
  return ends[k] - (k > 0 ? ends[k - 1] : 0);
}

struct Result {
  std::vector<Sample> samples;
  std::vector<double> ends;  ///< of the phases, s
  icat::Status status = icat::Status::ok;
  double pre_deployment_position = 0, pre_deployment_orientation = 0;  ///< errors, m, rad
  double deployment_position = 0, deployment_orientation = 0;
  double mismatch = 0;                ///< largest ‖J_a ẏ_a − J_b ẏ_b‖ while grasped
  double drift = 0, drift_angle = 0;  ///< largest of the relative tool pose, m, rad
  double object_speed_error = 0;      ///< RMS of the tools' velocity off the agreed one
  double step = 0, event_step = 0;    ///< largest ‖Δẏ‖: outside, at grasp and release
  double chatter = 0;                 ///< largest alternation, see `alternation`
  double joint_margin = 1e9, distance = 1e9, manipulability = 1e9, attitude = 0;  ///< extremes
  double bits_per_second = 0;  ///< that each robot sends while cooperating
  std::string outcome;         ///< the phase that ended the mission
};

/// The smallest |Δ| of three changes in a row that alternate in sign, 0 if they do not.
inline double alternation(double d1, double d2, double d3) {
  if (d1 * d2 >= 0 || d2 * d3 >= 0) return 0;
  return std::min({std::abs(d1), std::abs(d2), std::abs(d3)});
}

using Agents = std::array<std::unique_ptr<icat::Agent<Robot>>, 2>;

/// Runs the mission; every cycle ends with `observe(t, agents)`.
inline Result run(const Variant& variant,
                  const std::function<void(double, const Agents&)>& observe = {}) {
  Side a(-1, variant), b(1, variant);
  const std::array<Side*, 2> sides{&a, &b};

  //! [agents]
  std::array<std::unique_ptr<icat::Agent<Robot>>, 2> agents;
  for (std::size_t i = 0; i < 2; ++i) {
    agents[i] = std::make_unique<icat::Agent<Robot>>(
        sides[i]->robot, sides[i]->actions(), sides[i]->shared(),
        icat::Agent<Robot>::Options{
            .controller = controller_options(),
            .compensation = variant.compensation,
            .agreement = {.index = i, .policy = variant.policy, .spans = variant.spans}});
  }
  //! [agents]
  icat::CentralizedController<Robot> central(
      {{a.robot, a.tool, a.actions()}, {b.robot, b.tool, b.actions()}},
      controller_options().solver);
  icat::Transition firmness(1);  // of the centralised variant

  Result result;
  result.samples.reserve(7000);
  bool grasped = false;
  std::size_t exchanged = 0;  // numbers per robot and cycle, centralised
  std::size_t bytes_sent = 0, exchanges = 0;
  int event = 0;  // cycles left of the grasp or the release
  Pose object = pipe_start, tool_b_in_a = Pose::Identity();
  icat::Status status = icat::Status::ok;
  const auto check = [&](icat::Status s) {
    if (status == icat::Status::ok) status = s;
  };
  Sample s;  // of the present cycle

  // A phase ends when both robots have reached its goal, or after a time limit.
  const double steady = variant.current ? (variant.compensation ? 6 : 100) : 1;
  const auto at = [&](const Pose& p, const Pose& q) {
    const auto d = support::distance(p, q);
    return d.position < 5e-4 * steady && d.orientation < 5e-4 * steady;
  };
  const auto both = [](auto condition) { return condition(0) && condition(1); };
  const auto hovering = [&](std::size_t i) {
    const auto d = support::distance(hover(i ? 1 : -1), s.robots[i].vehicle);
    return d.position < hover_position && d.orientation < hover_orientation;
  };
  const auto at_pipe = [&](std::size_t i) {
    return at(s.robots[i].gripper, pipe_start * grasp_on_pipe(i ? 1 : -1));
  };
  const auto stepped_back = [&](std::size_t i) {
    return at(s.robots[i].gripper, sides[i]->tool_away.goal());
  };
  icat::Mission* supervisor = nullptr;
  const auto after = [&](double time) { return supervisor->time_in_phase() > time; };
  const auto settled = [&] { return after(settle - dt / 2); };
  //! [mission]
  const std::array<std::function<bool()>, 7> ends{
      [&] { return after(fade) && both(hovering); },
      [&] { return after(fade) && both(at_pipe); },
      settled,
      [&] { return after(fade) && at(object, pre_deployment); },
      [&] { return after(fade) && at(object, deployment); },
      settled,
      [&] { return after(fade) && both(stepped_back); }};
  std::vector<icat::Phase> phases, late;
  for (std::size_t k = 0; k < 7; ++k) {
    const char* next = k < 6 ? phase_names[k + 1] : "done";
    const std::string too_late = std::string(phase_names[k]) + " took too long";
    phases.push_back({.name = phase_names[k],
                      .action = phase_names[k],
                      .fade = fade,
                      .until = ends[k],
                      .then = next,
                      .time_limit = variant.patience * duration(paper_ends, k) + 3,
                      .on_timeout = too_late});
    late.push_back({.name = too_late, .end = icat::PhaseEnd::failure});
  }
  phases.push_back({.name = "done", .end = icat::PhaseEnd::success});
  phases.insert(phases.end(), late.begin(), late.end());
  icat::Mission mission(phases);
  mission.check_actions(agents[0]->own());
  //! [mission]
  supervisor = &mission;
  // One mission for both robots, as for one controller of both.
  const auto supervise = [&](double t) {
    check(mission.step(t));
    if (!mission.entered() || mission.end() != icat::PhaseEnd::none) return;
    for (auto& agent : agents) check(mission.drive(*agent, t));
    check(central.switch_to(mission.action(), t, mission.fade()));
    const double firm = mission.index() >= 2 && mission.index() <= 4 ? 1 : 0;
    check(firmness.start({&firm, 1}, t, fade));
  };
  supervise(0);

  std::array<Command, 2> last{Command::Zero(), Command::Zero()};
  std::array<std::array<Command, 2>, 2> changes;  // the last two Δẏ of either robot
  for (auto& c : changes) c.fill(Command::Zero());
  std::vector<double> squared_errors;

  for (int cycle = 0; status == icat::Status::ok; ++cycle) {
    const double t = cycle * dt;
    const std::size_t phase = mission.index();
    const bool cooperating = phase >= 2 && phase <= 5;
    if (cooperating) ++exchanges;
    std::array<Command, 2> command;

    //! [cycle]
    for (Side* side : sides) check(side->robot.update(side->plant.q(), side->plant.base()));
    check(a.vehicle_distance.set_point(b.robot.pose(b.robot.base()).translation()));
    check(b.vehicle_distance.set_point(a.robot.pose(a.robot.base()).translation()));
    if (!variant.centralized) {
      for (std::size_t i = 0; i < 2; ++i) {
        check(agents[i]->propose(t, sides[i]->plant.velocity()));
      }
      for (std::size_t i = 0; cooperating && i < 2; ++i) {  // 24 bytes each way
        const auto message = agents[i]->send(cycle);
        check(agents[1 - i]->receive(i, cycle, message));
        bytes_sent += message.size();
      }
      for (std::size_t i = 0; i < 2; ++i) {
        check(agents[i]->step(t, sides[i]->plant.velocity()));
        command[i] = agents[i]->velocity();
      }
    } else {
      check(firmness.update(t));
      check(central.step(t, firmness.values()[0]));
      for (std::size_t i = 0; i < 2; ++i) command[i] = central.velocity(i);
      if (grasped) exchanged = std::max(exchanged, central.exchanged_numbers(0));
    }
    //! [cycle]

    // Record.
    s.t = t;
    s.phase = phase;
    s.grasped = grasped;
    s.agreed = agents[0]->agreed_velocity();
    for (std::size_t i = 0; i < 2; ++i) {
      Side& side = *sides[i];
      RobotSample& r = s.robots[i];
      side.recorder.record(command[i], side.plant.velocity().tail<6>(), r);
      r.gripper = side.robot.pose(side.gripper);
      Command actual = command[i];
      if (variant.current) {
        actual.segment<3>(7) += r.vehicle.linear().transpose() * support::sinusoidal_current(t);
      }
      r.tool_velocity = support::twist(side.robot, side.tool, actual);
      r.limit_activations.fill(0);
      r.activations.fill(0);
      const auto& own = agents[i]->own();
      std::size_t entry_index = 0;
      for (const auto& level : own.hierarchy()) {
        for (const auto& entry : level) {
          const double phase_activation = own.phase_activations()[entry_index++];
          const auto& activation = entry.task->activation();
          if (entry.task == &side.joint_limits) {
            for (int j = 0; j < 7; ++j) {
              r.limit_activations[static_cast<std::size_t>(j)] = phase_activation * activation(j);
            }
            continue;
          }
          const std::array<const icat::Task<Robot>*, 9> tasks{
              &side.vehicle_distance, &side.manipulability, &side.centering,
              &side.attitude,         &side.vehicle_pose,   nullptr,
              &side.still_arm,        &side.still_vehicle,  nullptr};
          const auto found = std::find(tasks.begin(), tasks.end(), entry.task);
          // What is none of these is one of the tool's.
          const auto column =
              found == tasks.end() ? 5u : static_cast<std::size_t>(found - tasks.begin());
          // Two tool tasks that fade into each other add up.
          r.activations[column] += phase_activation * activation.maxCoeff();
        }
      }
      r.activations[8] = agents[i]->agreement_activation();
    }
    if (grasped) {
      object.translation() = (s.robots[0].tool.translation() + s.robots[1].tool.translation()) / 2;
      object.linear() = Eigen::Quaterniond(s.robots[0].tool.linear())
                            .slerp(0.5, Eigen::Quaterniond(s.robots[1].tool.linear()))
                            .toRotationMatrix();
    }
    s.object = object;
    const Pose& goal = phase <= 2 ? pipe_start : phase == 3 ? pre_deployment : deployment;
    const auto error = support::distance(goal, object);
    s.position_error = error.position;
    s.orientation_error = error.orientation;
    s.distance = support::distance(s.robots[0].vehicle, s.robots[1].vehicle).position;
    s.mismatch = (s.robots[0].tool_velocity - s.robots[1].tool_velocity).norm();

    // Judge.
    for (std::size_t i = 0; i < 2; ++i) {
      const RobotSample& r = s.robots[i];
      const Command change = command[i] - last[i];
      double& largest = event > 0 ? result.event_step : result.step;
      largest = std::max(largest, change.norm());
      if (event == 0) {
        for (int j = 0; j < 13; ++j) {
          result.chatter =
              std::max(result.chatter, alternation(changes[i][0](j), changes[i][1](j), change(j)));
        }
      }
      changes[i] = {changes[i][1], event > 0 ? Command::Zero().eval() : change};
      last[i] = command[i];
      result.joint_margin = std::min(result.joint_margin, r.joint_margin);
      result.manipulability = std::min(result.manipulability, r.manipulability);
      result.attitude = std::max(result.attitude, r.attitude);
      if (grasped) {
        squared_errors.push_back((r.tool_velocity - s.agreed).squaredNorm());
      }
    }
    if (event > 0) --event;
    result.distance = std::min(result.distance, s.distance);
    if (grasped) {
      result.mismatch = std::max(result.mismatch, s.mismatch);
      const Pose relative = s.robots[0].tool.inverse() * s.robots[1].tool;
      const auto drift = support::distance(relative, tool_b_in_a);
      result.drift = std::max(result.drift, drift.position);
      result.drift_angle = std::max(result.drift_angle, drift.orientation);
    }
    result.samples.push_back(s);
    if (observe) observe(t, agents);
    for (std::size_t i = 0; i < 2; ++i) {
      sides[i]->plant.step(command[i], t, dt);
    }

    const double next = (cycle + 1) * dt;
    supervise(next);
    if (!mission.entered()) continue;
    result.ends.push_back(next);
    if (phase == 3) {
      result.pre_deployment_position = s.position_error;
      result.pre_deployment_orientation = s.orientation_error;
    } else if (phase == 4) {
      result.deployment_position = s.position_error;
      result.deployment_orientation = s.orientation_error;
    }
    if (mission.end() != icat::PhaseEnd::none) {
      result.outcome = mission.phase();
      break;
    }
    // The tool frames change at the grasp and after the release; the grasp is firm from the moment
    // at which both robots command the same tool velocity.
    for (Side* side : sides) check(side->robot.update(side->plant.q(), side->plant.base()));
    const std::size_t entered = mission.index();
    if (entered == 2 || entered == 3) {
      for (Side* side : sides) check(side->take(object));
    }
    if (entered == 3) {
      grasped = true;
      tool_b_in_a = a.robot.pose(a.tool).inverse() * b.robot.pose(b.tool);
    } else if (entered == 5) {
      grasped = false;
    } else if (entered == 6) {
      for (Side* side : sides) check(side->leave());
    }
    if (entered != 1 && entered != 4) event = event_cycles;
  }
  double sum = 0;
  for (const double e : squared_errors) sum += e;
  result.object_speed_error =
      squared_errors.empty() ? 0 : std::sqrt(sum / static_cast<double>(squared_errors.size()));
  const double bits_sent = 8.0 * static_cast<double>(bytes_sent) / 2;  // by each robot
  result.bits_per_second =
      variant.centralized
          ? 32.0 * static_cast<double>(exchanged) / dt
          : bits_sent / (static_cast<double>(std::max<std::size_t>(exchanges, 1)) * dt);
  result.status = status;
  return result;
}

}  // namespace cooperation
