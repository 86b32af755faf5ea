// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The simulation of [NSB, V]: what is calculated is taken as tracked perfectly.
#pragma once

#include <array>
#include <random>

#include "guidance.hpp"

namespace nsb {

/// What the paper does not give is chosen here.
struct Scenario {
  Dimensions dimensions;
  State start = {.vehicle = {0, 0, 8 * degree},
                 .q1 = Vector3(30, 68, 5) * degree,
                 .q2 = Vector2(45, 130) * degree};
  /// From 0.2 m off the tool, at a speed for work with a tool: see `run` for why it matters.
  double speed = 0.004, length = 1.0;  ///< m/s, m
  double slope = 15 * degree;          ///< of the line
  /// Of the tool above the vehicle's centre, in lengths of arm 1 above the hull; the paper's 2/3.
  double reach = 2.0 / 3;
  double wait = 20;  ///< at the end of the line, s
  Joints lower = Joints::Constant(-170 * degree), upper = Joints::Constant(170 * degree);
  bool stops = false;  ///< joints do not move past their limits, whatever is commanded

  Line line() const {
    const Vector2 begin = tool_pose(dimensions, start).value.head<2>() + Vector2(-0.05, 0.22);
    return {begin, begin + length * Vector2(std::cos(slope), std::sin(slope)), speed};
  }
  double vertical() const { return dimensions.height / 2 + reach * dimensions.arm1.sum(); }
  double duration() const { return line().duration() + wait; }
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
  s.upper(2) = 30 * degree;
  return s;
}

inline constexpr double tolerance = 1e-3;  ///< an error below it (m, rad, 1) has converged

struct Sample {
  double t;
  State state;
  Vector3 reference;                 ///< of the tool
  icat::Vector<double, 7> error;     ///< σ₁₁ (3), σ₁₂, σ₁₃, σ₂₁, σ₂₂
  std::array<double, 5> task_error;  ///< largest component of each task
  Velocity velocity;
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

/// Runs `guidance` (`LeaderFollower` or `WholeBody`) with a period of `dt`.
///
/// On the line NSB leaves an error in the lower tasks that is proportional to the speed:
/// J₁₂ J₁₁⁺ σ̇₁₁ is not zero, and Λe₁₂ alone has to make up for it.
template <class Guidance>
Result run(const Scenario& scenario, Guidance guidance, double dt = 0.01) {
  const Line line = scenario.line();
  State state = scenario.start;
  Result result;
  const long steps = std::lround(scenario.duration() / dt);
  for (long i = 0; i <= steps; ++i) {
    const double t = static_cast<double>(i) * dt;
    const Tasks tasks(scenario.dimensions, state, line, scenario.vertical(), t);
    Sample s{t, state, line.pose(t), tasks.error, {}, guidance(tasks, state)};
    s.task_error = {s.error.head<3>().cwiseAbs().maxCoeff(), std::abs(s.error(3)),
                    std::abs(s.error(4)), std::abs(s.error(5)), std::abs(s.error(6))};
    for (std::size_t k = 0; k < 5; ++k) {
      if (!(s.task_error[k] < tolerance)) result.converged[k] = t + dt;
      if (t > line.duration() / 2 && t < line.duration()) {
        result.line_error[k] = std::max(result.line_error[k], s.task_error[k]);
      }
    }
    result.last_error = s.task_error;
    result.peak = result.peak.cwiseMax(s.velocity.cwiseAbs());
    Joints q;
    q << state.q1, state.q2;
    result.past_limit = std::max(
        {result.past_limit, (q - scenario.upper).maxCoeff(), (scenario.lower - q).maxCoeff()});
    if (result.status == icat::Status::ok) result.status = guidance.status();
    if (i > 0) {
      result.largest_step =
          std::max(result.largest_step, (s.velocity - result.samples.back().velocity).norm());
    }
    result.samples.push_back(s);
    state = moved(state, s.velocity, dt);
    if (scenario.stops) {
      state.q1 = state.q1.cwiseMax(scenario.lower.head<3>()).cwiseMin(scenario.upper.head<3>());
      state.q2 = state.q2.cwiseMax(scenario.lower.tail<2>()).cwiseMin(scenario.upper.tail<2>());
    }
  }
  return result;
}
inline Result run_nsb(const Scenario& scenario, double dt = 0.01) {
  return run(scenario, LeaderFollower(), dt);
}
inline Result run_icat(const Scenario& scenario) {
  return run(scenario, WholeBody(scenario.lower, scenario.upper, 0.1));
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
    s.start.vehicle.z() = 10 * degree * u(rng);
    for (double& q : s.start.q1) q += 40 * degree * u(rng);
    for (double& q : s.start.q2) q += 60 * degree * u(rng);
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
