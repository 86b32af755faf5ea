// SPDX-License-Identifier: BSD-3-Clause
// The hydrodynamic runs of [Coop, V-B, Table III]: two dynamic vehicle-manipulators carry a pipe,
// with PI velocity loops, vehicles that track badly, and communication that is slow, late or
// half-duplex. One set of gains, filters and limits serves all rows.
#pragma once

#include <Eigen/LU>
#include <array>
#include <functional>
#include <icat/icat.hpp>
#include <icat/sim/channel.hpp>
#include <icat/sim/grasped_object_plant.hpp>
#include <icat/sim/maris_dynamics.hpp>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "../support/geometry.hpp"
#include "../support/uvms.hpp"

namespace table3 {

using Robot = icat::KinematicTree<double, 13>;
using Plant = icat::GraspedObjectPlant<double, 7>;
using Pose = icat::Pose<double>;
using Vector3 = icat::Vector3<double>;
using Vector6 = icat::Vector6<double>;
using Vector13 = icat::Vector<double, 13>;
using Joints = icat::Vector<double, 7>;
using Objective = icat::Objective<double>;

/// What is under way: the bytes, and the round, which the modem's schedule tells.
struct Message {
  long long round;
  std::array<std::byte, icat::message_size(42)> bytes;  ///< the longest, spans included
};

// --- the rows ------------------------------------------------------------------------------------

/// One row of the table.
struct Row {
  const char* name;
  bool compensation = true;
  double rate = 0;  ///< Hz, 0: no communication
  icat::Duplex duplex = icat::Duplex::full;
  double latency = 0;  ///< s
  bool filter = false;
  bool force = false;     ///< the force modification
  double feedback = 100;  ///< of the vehicle's velocity, Hz
  double loss = 0;        ///< share of messages lost
  bool spans = false;     ///< exchanged too
};

/// [Coop, Table III], and two more.
inline const std::vector<Row> rows{
    {.name = "T1", .compensation = false},
    {.name = "T2"},
    {.name = "T3", .rate = 100},
    {.name = "T4", .rate = 100, .filter = true},
    {.name = "T5", .rate = 1, .latency = 1, .filter = true},
    {.name = "T6", .rate = 1, .duplex = icat::Duplex::half, .latency = 1, .filter = true},
    {.name = "T7", .force = true},
    {.name = "T8", .rate = 100, .filter = true, .force = true},
    {.name = "T9", .rate = 1, .latency = 1, .filter = true, .force = true},
    {.name = "T10",
     .rate = 1,
     .duplex = icat::Duplex::half,
     .latency = 1,
     .filter = true,
     .force = true},
    {.name = "T11",
     .rate = 1,
     .duplex = icat::Duplex::half,
     .latency = 1,
     .filter = true,
     .force = true,
     .feedback = 10},
    {.name = "T9 loss", .rate = 1, .latency = 1, .filter = true, .force = true, .loss = 0.1},
    {.name = "T4 spans", .rate = 100, .filter = true, .spans = true}};

/// What the paper prints for T1 … T11; 0 where it aborted.
struct Published {
  double final_error, force_max, force_mean, force_std, moment_max, moment_mean, moment_std;
};
inline const std::array<Published, 11> published{{{0, 0, 0, 0, 0, 0, 0},
                                                  {0.0059, 63.29, 41.53, 18.09, 25.78, 13.52, 5.9},
                                                  {0.0039, 41.08, 26.52, 12.81, 16.09, 10.86, 4.7},
                                                  {0.004, 9.9, 1.78, 1.72, 5.13, 0.99, 0.75},
                                                  {0.0258, 10.1, 5.42, 2.53, 6.71, 1.87, 0.81},
                                                  {0.0305, 78.5, 29.03, 17.29, 14.55, 5.11, 3.34},
                                                  {0.0077, 9.64, 2.66, 2.25, 16.02, 5.99, 2.52},
                                                  {0.0039, 5.03, 0.89, 0.9, 5.7, 0.82, 0.92},
                                                  {0.0259, 5.07, 1.14, 1.12, 5.63, 1.19, 0.8},
                                                  {0.0109, 13.42, 3.19, 2.75, 8.17, 2.16, 1.36},
                                                  {0.0347, 24.81, 4.05, 4.37, 6.92, 2.13, 1.35}}};

// --- one set of parameters -----------------------------------------------------------------------

/// What the paper leaves open. The same for all rows; varied by the sensitivity study alone.
struct Parameters {
  double duration = 40;            ///< s
  double ramp = 0.5;               ///< s, from holding the pipe to carrying it
  double tool_gain = 0.2;          ///< 1/s
  double tool_linear = 0.1;        ///< m/s
  double tool_angular = 0.1;       ///< rad/s
  double joint_speed = 0.15;       ///< rad/s, bound of each joint
  double vehicle_speed = 0.5;      ///< m/s, bound along each axis
  double vehicle_turn = 0.3;       ///< rad/s, bound about each axis
  double joint_bandwidth = 100;    ///< rad/s, of the PI loops
  double vehicle_bandwidth = 0.9;  ///< rad/s, along the axes
  double turn_bandwidth = 3;       ///< rad/s, about them
  double filter = 2;               ///< s, time constant of the filter on the agreed velocity
  double force_gain = 2e-4;        ///< m/s per N of interaction force
  double moment_gain = 1e-3;       ///< rad/s per N m of interaction moment
  double force_limit = 200;        ///< N, of the interaction force: the run is aborted
  double hold = 4;                 ///< s, how long an agreement is held
  double fade = 0.1;               ///< s, into the first agreement
  double limit_margin = 0.2;
  double limit_gain = 0.5;
  double distance = 2, distance_margin = 0.5;
  double dexterity = 0.05, dexterity_margin = 0.04;
  double dexterity_gain = 1;
  double attitude = 0.2, attitude_margin = 0.1;
  double to_middle = 0;
  double yaw = 0, latest = 1;
  std::array<double, 7> start_a{0, 1.5, 0, -2.5, 0, 1.0, 0}, start_b{0, 1.4, 0, -2.4, 0, 1.0, 0};
};

inline constexpr double plant_dt = 1.0 / 2000, control_dt = 0.01;
inline constexpr double grasp_distance = 1.5;

// [Coop, V-B]. The pipe lies along x of ⟨o⟩ and along y of the world, so that the rotation about y
// and z of the world by π/2 rolls and turns it but leaves it horizontal.
inline constexpr double quarter = std::numbers::pi / 2;
inline const Pose pipe_start = support::pose({0.5, 0.5, 3}, 0, 0, quarter);
inline const Pose pipe_goal =
    support::pose({0.75, 0.75, 2.5}, 0, quarter, quarter) * support::pose({0, 0, 0}, 0, 0, quarter);

/// Its tool is the gripper until it holds the pipe.
inline Robot make_robot() {
  return icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>(),
                                                .tool = support::pose({0, 0, 0.1}, 0, 0, 0)});
}

/// After the grasp: the grippers came from above, the vehicles face along x of the world, level.
inline icat::HydrodynamicPlant<double, 7> plant_of(double side, const Parameters& p) {
  const Joints q = Eigen::Map<const Joints>((side < 0 ? p.start_a : p.start_b).data());
  Robot robot = make_robot();
  const icat::Status status = robot.update(q, Pose::Identity());
  if (status != icat::Status::ok) icat::detail::invalid("the start is refused");
  Pose gripper = pipe_start;
  gripper.translation() += side * grasp_distance * pipe_start.linear().col(0);
  gripper.linear() = Vector3(-1, -1, 1).asDiagonal();
  icat::HydrodynamicPlant<double, 7>::State start;
  start.q = q;
  start.vehicle = gripper * robot.pose(robot.frame("tool")).inverse();
  return icat::HydrodynamicPlant<double, 7>(icat::maris_dynamics<double>(), start);
}

/// A robot with its tasks, loops and agent.
class Side {
 public:
  Side(std::size_t index, const Plant& plant, const Row& row, const Parameters& p)
      : robot(holding(plant.grasp(index))),
        tool_frame_(robot.frame("tool")),
        joint_limits_(robot, {.margin = p.limit_margin, .to_middle = p.to_middle > 0, .gain = p.limit_gain}),
        distance_(robot, robot.base(), plant.robot(1 - index).vehicle().translation(),
                  Objective::at_least(p.distance, p.distance_margin), {.gain = 0.5}),
        manipulability_(robot, tool_frame_, Objective::at_least(p.dexterity, p.dexterity_margin), {.gain = p.dexterity_gain}),
        attitude_(robot, robot.base(), {.norm = Objective::at_most(p.attitude, p.attitude_margin), .gain = 0.5}),
        tool_(robot, tool_frame_, pipe_goal,
              {.name = "tool pose",
               .gain = p.tool_gain,
               .max_linear_rate = p.tool_linear,
               .max_angular_rate = p.tool_angular}),
        hold_(robot, tool_frame_, pipe_start, {.name = "hold"}),
        still_arm_(robot, icat::joint_columns(robot)),
        agent(robot, {{"hold", levels(hold_)}, {"transport", levels(tool_)}},
              {{"hold", hold_}, {"transport", tool_}},
              {.controller = {.solver = {.bounds = support::velocity_bounds(
                                             p.joint_speed, p.vehicle_speed, p.vehicle_turn)},
                              .characteristic_length = 1},  // rows as in the paper
               .compensation = row.compensation,
               .agreement = {.index = index,
                             .spans = row.spans,
                             .latest = p.latest > 0 && row.duplex == icat::Duplex::half,
                             .hold = p.hold,
                             .fallback = icat::Fallback::alone,
                             .fade = p.fade},
               .filter = row.filter ? p.filter : 0}),
        joints_(icat::PiLoop<double, 7>::tuned(nominal_inertia().head<7>(),
                                               Joints::Constant(p.joint_bandwidth))),
        vehicle_(icat::PiLoop<double, 6>::tuned(nominal_inertia().tail<6>(), vehicle_bandwidth(p))),
        feedback_(row.feedback, Vector6::Zero()) {}

  icat::Status see(const Vector3& other) { return distance_.set_point(other); }
  /// ẏ as the kinematic loop gets it: the vehicle's, the joints' is not needed.
  Vector13 measured(double t, const Vector6& truth) {
    Vector13 velocity = Vector13::Zero();
    velocity.tail<6>() = feedback_.update(t, truth);
    return velocity;
  }
  /// Velocity of the tool under the agent's own hierarchy, components on it.
  Vector6 own_tool_velocity() const {
    return support::twist(robot, tool_frame_, agent.own().velocity());
  }
  /// Torques and vehicle wrench of the PI loops, each 2 kHz step.
  icat::Status forces(const Vector13& velocity, Vector13& out) {
    const icat::Status arm =
        joints_.update(agent.velocity().head<7>(), velocity.head<7>(), Joints::Zero(), plant_dt);
    const icat::Status hull =
        vehicle_.update(agent.velocity().tail<6>(), velocity.tail<6>(), Vector6::Zero(), plant_dt);
    out << joints_.output(), vehicle_.output();
    return arm == icat::Status::ok ? hull : arm;
  }

  Robot robot;

 private:
  /// [Coop, III-E] in transport.
  std::vector<icat::PriorityLevel<Robot>> levels(icat::task::FramePose<Robot>& tool) {
    return {{joint_limits_}, {distance_}, {manipulability_}, {attitude_}, {tool}, {still_arm_}};
  }
  static Vector6 vehicle_bandwidth(const Parameters& p) {
    Vector6 b;
    b << Vector3::Constant(p.vehicle_bandwidth), Vector3::Constant(p.turn_bandwidth);
    return b;
  }
  /// What each axis feels when the others are free, 1/(M⁻¹)ᵢᵢ, in the nominal posture.
  static Vector13 nominal_inertia() {
    icat::HydrodynamicPlant<double, 7>::State nominal;
    nominal.q << 0, 0.4, 0.3, -1.6, 0, 0.8, 0;
    const icat::HydrodynamicPlant<double, 7> plant(icat::maris_dynamics<double>(), nominal);
    const Eigen::Matrix<double, 13, 13> M = plant.dynamics().mass_matrix();
    return M.inverse().diagonal().cwiseInverse();
  }
  static Robot holding(const Pose& grasp) {
    Robot robot = make_robot();
    const icat::Status status =
        robot.set_frame(robot.frame("tool"), robot.frame("end_effector"), grasp);
    if (status != icat::Status::ok) icat::detail::invalid("the grasp is refused");
    return robot;
  }
  icat::FrameId tool_frame_;
  icat::task::JointLimits<Robot> joint_limits_;
  icat::task::FrameDistance<Robot> distance_;
  icat::task::Manipulability<Robot> manipulability_;
  icat::task::Attitude<Robot> attitude_;
  icat::task::FramePose<Robot> tool_, hold_;
  icat::task::Minimality<Robot> still_arm_;

 public:
  icat::Agent<Robot> agent;

 private:
  icat::PiLoop<double, 7> joints_;
  icat::PiLoop<double, 6> vehicle_;
  icat::SampleHold<Vector6> feedback_;
};

// --- one run -------------------------------------------------------------------------------------

struct Sample {
  double t;
  Vector6 interaction;  ///< [N; N m] on ⟨o⟩
  double position_error, orientation_error;
  std::array<Vector6, 2> agreed, vehicle_wrench;
  double object_speed;
};

struct Statistics {
  double max = 0, mean = 0, deviation = 0;
};

struct Result {
  std::vector<Sample> samples;                    ///< at 100 Hz
  bool aborted = false;                           ///< at the force limit, or by a fault
  double end = 0;                                 ///< s
  double final_error = 0, final_orientation = 0;  ///< m, rad
  Statistics force, moment;                       ///< over all 2 kHz steps
  double thrust_peak = 0;                         ///< N, largest along an axis of a vehicle
  double thrust_mean = 0;      ///< N, mean of |.| along the axis where that is largest
  double drift = 0;            ///< m, of the grasps
  double proposals_apart = 0;  ///< RMS of ‖ẋ_a − ẋ_b‖
  icat::Status status = icat::Status::ok;
};

/// Running maximum, mean and deviation of a norm.
class Accumulator {
 public:
  void add(double x) {
    max_ = std::max(max_, x);
    sum_ += x;
    squares_ += x * x;
    ++count_;
  }
  Statistics get() const {
    const double n = std::max(count_, 1.0), mean = sum_ / n;
    return {max_, mean, std::sqrt(std::max(squares_ / n - mean * mean, 0.0))};
  }

 private:
  double max_ = 0, sum_ = 0, squares_ = 0, count_ = 0;
};

/// Runs one row; `progress` gets the simulated time.
inline Result run(const Row& row, const Parameters& p,
                  const std::function<void(double)>& progress = {}) {
  Plant plant(plant_of(-1, p), plant_of(1, p), icat::maris_pipe_body<double>(), pipe_start);
  Side a(0, plant, row, p), b(1, plant, row, p);
  const std::array<Side*, 2> sides{&a, &b};
  icat::Channel<Message> channel({.rate = row.rate > 0 ? row.rate : 1,
                                  .latency = row.latency,
                                  .duplex = row.duplex,
                                  .loss = row.loss});
  Result result;
  const auto check = [&](icat::Status s) {
    if (result.status == icat::Status::ok) result.status = s;
  };
  for (Side* side : sides) {
    check(side->agent.start("hold", 0));
    check(side->agent.switch_to("transport", 0, p.ramp));
  }

  Accumulator force, moment;
  Eigen::Matrix<double, 6, 2> thrust = Eigen::Matrix<double, 6, 2>::Zero();
  double apart = 0;
  const int steps = static_cast<int>(std::lround(p.duration / plant_dt));
  const int per_cycle = static_cast<int>(std::lround(control_dt / plant_dt));
  const auto receive = [&](double t) {
    for (std::size_t i = 0; i < 2; ++i) {
      if (const auto message = channel.receive(static_cast<int>(i), t)) {
        const std::size_t size = icat::message_size(row.spans ? 42 : 6);
        check(
            sides[i]->agent.receive(1 - i, message->round, std::span(message->bytes).first(size)));
      }
    }
  };
  for (int k = 0; k < steps && result.status == icat::Status::ok; ++k) {
    const double t = k * plant_dt;
    if (k % per_cycle == 0) {
      std::array<Vector13, 2> measured;
      for (std::size_t i = 0; i < 2; ++i) {
        const auto& body = plant.robot(i);
        check(sides[i]->robot.update(body.q(), body.vehicle()));
        check(sides[i]->see(plant.robot(1 - i).vehicle().translation()));
        measured[i] = sides[i]->measured(t, body.vehicle_velocity());
        check(sides[i]->agent.propose(t, measured[i]));
      }
      if (row.rate > 0) {
        receive(t);
        for (int i = 0; i < 2; ++i) {
          if (!channel.ready(i, t)) continue;
          // Half duplex: two slots, one of each, are a round.
          const long long slot = std::llround(std::floor(t * row.rate + 1e-6));
          Message message{row.duplex == icat::Duplex::full ? slot : slot / 2, {}};
          const auto bytes = sides[static_cast<std::size_t>(i)]->agent.send(message.round);
          std::copy(bytes.begin(), bytes.end(), message.bytes.begin());
          channel.send(i, t, message);
        }
        receive(t);
      }
      for (std::size_t i = 0; i < 2; ++i) {
        // Robot a presses with +w, b with −w: both give way along it.
        Vector6 correction = Vector6::Zero();
        if (row.force) {
          const Vector6 w = (i == 0 ? -1 : 1) * plant.interaction();
          correction << p.force_gain * w.head<3>(), p.moment_gain * w.tail<3>();
        }
        check(sides[i]->agent.step(t, measured[i], correction));
      }
      Sample s;
      s.t = t;
      s.interaction = plant.interaction();
      const auto error = support::distance(pipe_goal, plant.object());
      s.position_error = error.position;
      s.orientation_error = error.orientation;
      s.object_speed = plant.object_velocity().head<3>().norm();
      std::array<Vector6, 2> own;
      for (std::size_t i = 0; i < 2; ++i) {
        s.agreed[i] = sides[i]->agent.agreed_velocity();
        own[i] = sides[i]->own_tool_velocity();
      }
      apart += (own[0] - own[1]).squaredNorm();
      for (auto& wrench : s.vehicle_wrench) wrench.setZero();
      result.samples.push_back(s);
      if (progress) progress(t);
    }
    std::array<Vector13, 2> forces;
    for (std::size_t i = 0; i < 2; ++i) {
      check(sides[i]->forces(plant.robot(i).velocity(), forces[i]));
      if (k % per_cycle == 0) result.samples.back().vehicle_wrench[i] = forces[i].tail<6>();
      thrust.col(static_cast<Eigen::Index>(i)) += forces[i].tail<6>().cwiseAbs();
      result.thrust_peak =
          std::max(result.thrust_peak, forces[i].segment<3>(7).cwiseAbs().maxCoeff());
    }
    check(plant.step(forces[0], forces[1], plant_dt));
    const Vector6 w = plant.interaction();
    force.add(w.head<3>().norm());
    moment.add(w.tail<3>().norm());
    result.drift =
        std::max({result.drift, plant.drift(0).head<3>().norm(), plant.drift(1).head<3>().norm()});
    result.end = t + plant_dt;
    if (w.head<3>().norm() > p.force_limit) {
      result.aborted = true;
      break;
    }
  }
  result.aborted = result.aborted || result.status != icat::Status::ok;
  result.force = force.get();
  result.moment = moment.get();
  result.thrust_mean = thrust.topRows<3>().maxCoeff() * plant_dt / std::max(result.end, plant_dt);
  result.proposals_apart =
      std::sqrt(apart / std::max(static_cast<double>(result.samples.size()), 1.0));
  const auto error = support::distance(pipe_goal, plant.object());
  result.final_error = error.position;
  result.final_orientation = error.orientation;
  return result;
}

}  // namespace table3
