// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Two ways to guide the dual-arm vehicle along a line with the same tasks, gains and velocity
/// bounds, and the simulation of [NSB, V]: the computed velocities are tracked perfectly.
#pragma once

#include <functional>
#include <random>

#include "dual_arm.hpp"

namespace nsb {

/// What the paper does not give is chosen here.
struct Scenario {
  Dimensions dimensions;
  // Where it starts.
  double tilt = 8 * degree;
  Joints q = Joints(45, 130, 30, 68, 5) * degree;
  /// From 0.2 m off the tool, at a speed for work with a tool: see `simulate` for why it matters.
  double speed = 0.004, length = 1.0;  ///< m/s, m
  double slope = 15 * degree;          ///< of the line
  /// Of the tool above the vehicle's centre, in lengths of arm 1 above the hull; the paper's 2/3.
  double reach = 2.0 / 3;
  double wait = 20;    ///< at the end of the line, s
  bool stops = false;  ///< joints do not move past their limits, whatever is commanded

  Pose vehicle() const { return support::pose({0, 0, 0}, 0, 0, tilt); }
  Robot robot() const {
    Robot robot = make_robot(dimensions);
    (void)robot.update(q, vehicle());  // The first cycle does it again, and tells.
    return robot;
  }
  Tasks tasks(const Robot& at_start) const {
    const Vector3 begin =
        at_start.pose(at_start.frame("arm1_link3")).translation() + Vector3(-0.05, 0.22, 0);
    const Vector3 end = begin + length * Vector3(std::cos(slope), std::sin(slope), 0);
    double arm = 0;
    for (const Link& link : dimensions.arm1) arm += link.a;
    const double height = dimensions.height / 2 + reach * arm;
    return {at_start, {begin, end, speed}, icat::Objective<double>::equal_to(height)};
  }
};

/// The vertical distance is more than arm 1 can reach.
inline Scenario conflict() {
  Scenario s;
  s.reach = 1.1;
  return s;
}

/// A long line at a higher speed straightens arm 1, whose third joint has little room.
inline Scenario joint_limit() {
  Scenario s;
  s.length = 6;
  s.speed = 0.05;
  s.dimensions.arm1[2].upper = 30 * degree;
  return s;
}

/// [NSB, Eq. (36)].
inline Velocity velocity_limits() {
  Velocity limits = Velocity::Constant(10 * degree);
  limits.tail<3>() << 3, 2, 3 * degree;
  return limits;
}

inline constexpr double tolerance = 1e-3;  ///< an error below it (m, rad, 1) has converged

struct Sample {
  double t;
  Joints q;
  Pose vehicle, reference;  ///< the reference of the tool
  Velocity velocity;
  icat::Vector<double, 7> error;     ///< σ₁₁ (3), σ₁₂, σ₁₃, σ₂₁, σ₂₂
  std::array<double, 5> task_error;  ///< largest component of each task
};

struct Result {
  std::vector<Sample> samples;
  std::array<double, 5> converged{};   ///< s; from then on the task's error stays below `tolerance`
  std::array<double, 5> line_error{};  ///< the largest in the second half of the line
  std::array<double, 5> last_error{};
  Velocity peak = Velocity::Zero();  ///< largest |ẏ|
  double past_limit = -1e9;  ///< the most that a joint was past its limit, rad; negative: inside
  double largest_step = 0;   ///< max ‖Δẏ‖ between two periods
  icat::Status status = icat::Status::ok;
};

/// Runs the scenario with a period of `dt`: `guide(t, ẏ)` updates the tasks and yields ẏ.
///
/// On the line NSB leaves an error in the lower tasks that is proportional to the speed:
/// J₁₂ J₁₁⁺ σ̇₁₁ is not zero, and only Λe₁₂ compensates it.
template <class Guide>
Result simulate(const Scenario& scenario, Robot& robot, Tasks& tasks, double dt, Guide guide) {
  Result result;
  const auto check = [&](icat::Status status) {
    if (result.status == icat::Status::ok) result.status = status;
  };
  Joints q = scenario.q;
  Pose vehicle = scenario.vehicle();
  const double line = tasks.line.duration();
  const long steps = std::lround((line + scenario.wait) / dt);
  for (long i = 0; i <= steps; ++i) {
    const double t = static_cast<double>(i) * dt;
    Velocity y = Velocity::Zero();
    check(robot.update(q, vehicle));
    check(tasks.follow(t));
    check(guide(t, y));

    Sample s{t, q, vehicle, tasks.tool.goal(), y, errors(tasks, t), {}};
    s.task_error = {s.error.head<3>().cwiseAbs().maxCoeff(), std::abs(s.error(3)),
                    std::abs(s.error(4)), std::abs(s.error(5)), std::abs(s.error(6))};
    for (std::size_t k = 0; k < 5; ++k) {
      if (!(s.task_error[k] < tolerance)) result.converged[k] = t + dt;
      if (t > line / 2 && t < line) {
        result.line_error[k] = std::max(result.line_error[k], s.task_error[k]);
      }
    }
    result.last_error = s.task_error;
    result.peak = result.peak.cwiseMax(y.cwiseAbs());
    result.past_limit = std::max(result.past_limit, -support::joint_margin(robot));
    if (i > 0) {
      result.largest_step =
          std::max(result.largest_step, (y - result.samples.back().velocity).norm());
    }
    result.samples.push_back(s);

    q += dt * y.head<5>();
    for (std::size_t j = 0; scenario.stops && j < 5; ++j) {
      double& angle = q(static_cast<icat::Index>(j));
      angle = std::clamp(angle, robot.joints()[j].lower, robot.joints()[j].upper);
    }
    vehicle = icat::integrate<double>(vehicle, robot.base_motion() * y.tail<3>(), dt);
  }
  return result;
}

/// [NSB, Eq. (33), (34)]: ζ₁ and ζ₂ solved separately by null-space projection, each component then
/// cut off at its bound, Eq. (36).
inline Result run_nsb(const Scenario& scenario, double dt = 0.01) {
  Robot robot = scenario.robot();
  Tasks k = scenario.tasks(robot);
  //! [nsb]
  icat::NullSpaceGuidance<double, 6> leader;    // vehicle and arm 1
  icat::NullSpaceGuidance<double, 2> follower;  // arm 2
  const auto guide = [&](double, Velocity& y) {
    leader.reset();
    follower.reset();
    icat::Status status = icat::Status::ok;
    const auto add = [&](auto& solver, auto& task, icat::Index first) {
      task.update();
      const auto J = task.jacobian().middleCols(first, solver.dof());
      if (status == icat::Status::ok) status = solver.add_task(J, task.reference());
    };
    add(leader, k.tool, 2);
    add(leader, k.level, 2);
    add(leader, k.distance, 2);
    add(follower, k.view, 0);
    add(follower, k.joint, 0);
    y << follower.velocity(), leader.velocity();
    y = y.cwiseMax(-velocity_limits()).cwiseMin(velocity_limits());
    return status;
  };
  //! [nsb]
  return simulate(scenario, robot, k, dt, guide);
}

/// One iCAT hierarchy over all eight, joint limits on top. `observe` sees every cycle.
inline Result run_icat(
    const Scenario& scenario,
    const std::function<void(double, const icat::Controller<Robot>&)>& observe = {}) {
  Robot robot = scenario.robot();
  Tasks k = scenario.tasks(robot);
  //! [icat]
  task::JointLimits limits(robot, {.margin = 0.1, .gain = 0.5});
  icat::Controller controller(
      robot, {{"guide", {{limits}, {k.tool}, {k.level}, {k.distance}, {k.view}, {k.joint}}}},
      {.solver = {.bounds = {-velocity_limits(), velocity_limits()}},
       .characteristic_length = 1});  // rows as in the paper
  icat::Status status = controller.start("guide", 0);
  const auto guide = [&](double t, Velocity& y) {
    if (status == icat::Status::ok) status = controller.step(t);
    y = controller.velocity();
    return status;
  };
  //! [icat]
  return simulate(scenario, robot, k, 0.01, [&](double t, Velocity& y) {
    const icat::Status done = guide(t, y);
    if (observe) observe(t, controller);
    return done;
  });
}

/// How many of `count` random starts end with all errors below `tolerance` on the line, and in how
/// many of those the leader's, the follower's tasks converge in the order of priority.
struct Order {
  int starts, converged = 0, leader = 0, follower = 0;
};
inline Order random_starts(int count) {
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> u(-1, 1);
  Order order{count};
  for (int i = 0; i < count; ++i) {
    Scenario s;
    s.length = 60 * s.speed;
    s.wait = 0;
    s.tilt = 10 * degree * u(rng);
    for (const int j : {2, 3, 4}) s.q(j) += 40 * degree * u(rng);
    for (const int j : {0, 1}) s.q(j) += 60 * degree * u(rng);
    const Result r = run_nsb(s, 0.02);
    const auto& c = r.converged;
    if (*std::max_element(c.begin(), c.end()) > 55) continue;
    ++order.converged;
    order.leader += c[0] <= c[1] && c[1] <= c[2];
    order.follower += c[3] <= c[4];
  }
  return order;
}

}  // namespace nsb
