// SPDX-License-Identifier: BSD-3-Clause
// Hard limits: what they promise, in random loops.
#include <gtest/gtest.h>

#include <cstdlib>
#include <deque>
#include <icat/icat.hpp>
#include <random>

#include "support/robots.hpp"

namespace {

using icat::Status;
using testing_support::message_of;
constexpr double inf = icat::infinity<double>;

/// Three joints of one's own; the third turns without end.
struct Row {
  using Scalar = double;
  static constexpr int size = 3;
  static icat::Index dof() { return 3; }
  std::vector<icat::JointInfo<double>> infos{{"lift", 0}, {"turn", 1}, {"wheel", 2}};
  icat::Vector3<double> x = icat::Vector3<double>::Zero();
  const std::vector<icat::JointInfo<double>>& joints() const { return infos; }
  double position(icat::Index i) const { return x(i); }
};
static_assert(icat::JointedRobot<Row>);
using Limits = icat::MotionLimits<Row>;
using Vector3 = icat::Vector3<double>;

/// A plant that does what it is told, `delay` after it is told, or is seen `delay` late: the same.
struct Loop {
  Row robot;
  double delay{0}, time{0};
  Vector3 now = Vector3::Zero();
  std::deque<std::pair<double, Vector3>> past;  // positions at the ends of the steps

  /// The state that arrives.
  void see() {
    const double then = time - delay;
    while (past.size() > 1 && past[1].first <= then) past.pop_front();
    robot.x = past.front().second;
    if (past.size() > 1 && then > past.front().first) {
      const double u = (then - past[0].first) / (past[1].first - past[0].first);
      robot.x += u * (past[1].second - past[0].second);
    }
  }
  void run(const Vector3& velocity, double dt) {
    now += dt * velocity;
    time += dt;
    past.push_back({time, now});
  }
};

/// One run; empty where every promise was kept.
std::string fault_of_run(unsigned seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  const auto chance = [&](double p) { return uniform(0, 1) < p; };
  Loop loop;
  const double period = uniform(0.001, 0.05), longest = chance(0.5) ? period : 0.05;
  loop.delay = chance(0.3) ? 0 : uniform(0, 0.1);
  Limits::Options options;
  // Told exactly, or with room; a state that was predicted already is not late at all.
  options.reaction_time = longest + loop.delay + (chance(0.5) ? 0 : uniform(0, 0.1));
  Vector3 outside = Vector3::Zero();
  for (int i = 0; i < 3; ++i) {
    auto& joint = loop.robot.infos[static_cast<std::size_t>(i)];
    joint.lower = uniform(-2, -0.1);
    joint.upper = uniform(0.1, 2);
    if (chance(0.7)) joint.max_acceleration = std::exp(uniform(-2, 4));
    if (chance(0.5)) joint.max_velocity = std::exp(uniform(-2, 2));
    if (chance(0.1)) joint.upper = inf;
    const double width = std::min(joint.upper, 2.0) - joint.lower;
    loop.now(i) =
        chance(0.8) ? uniform(joint.lower, joint.lower + width) : joint.lower - uniform(0, 0.3);
    outside(i) = std::max(joint.lower - loop.now(i), 0.0);
  }
  loop.past.push_back({-1, loop.now});
  loop.past.push_back({0, loop.now});
  Limits limits(loop.robot, options);
  Vector3 goal = Vector3::Zero(), wanted = Vector3::Zero(), last = Vector3::Zero();
  double dt = period;
  for (int k = 0; k < 150; ++k) {
    loop.see();
    limits.update(loop.robot, {k == 0 ? 0 : dt, dt});
    if (k % 30 == 0) goal = 3 * Vector3::NullaryExpr([&] { return uniform(-1, 1); });
    // A stiff goal, beyond the limits now and then, or noise, or a switch.
    if (chance(0.05)) wanted = 5 * Vector3::NullaryExpr([&] { return uniform(-1, 1); });
    if (seed % 3 != 0) wanted = (seed % 3 == 1 ? 2 : 30) * (goal - loop.robot.x);
    // What a solver within `bounds` may answer.
    const Vector3 answer = wanted.cwiseMax(limits.bounds().lower).cwiseMin(limits.bounds().upper);
    (void)limits.limit_base(answer);
    (void)limits.limit_joints(answer);
    const Vector3 command = limits.command();
    const double passed = k == 0 ? 0 : dt;
    dt = longest > period ? uniform(0.001, longest) : period;
    loop.run(command, dt);
    for (int i = 0; i < 3; ++i) {
      const auto& joint = loop.robot.infos[static_cast<std::size_t>(i)];
      const auto text = [&](const char* what, double by) {
        return std::string(what) + " of joint " + std::to_string(i) + " by " + std::to_string(by) +
               " in cycle " + std::to_string(k);
      };
      const double q = loop.now(i), v = command(i);
      const double over = std::max(q - joint.upper, joint.lower - outside(i) - q);
      if (!(over <= 1e-9)) return text("position", over);
      outside(i) = std::min(outside(i), std::max(joint.lower - q, 0.0));
      if (!(std::abs(v) <= joint.max_velocity)) return text("velocity", std::abs(v));
      // Rounding of v and of a dt.
      const double a = joint.max_acceleration;
      if (a == inf) continue;
      const double change = std::abs(v - last(i)) - a * passed;
      if (!(change <= 1e-12 * (1 + std::abs(v)) + 1e-15 * a)) {
        return text("acceleration", change);
      }
    }
    last = command;
  }
  return "";
}

/// So many runs, or as many as ICAT_LIMIT_RUNS says.
unsigned runs() {
  const char* told = std::getenv("ICAT_LIMIT_RUNS");
  return told ? static_cast<unsigned>(std::strtoul(told, nullptr, 10)) : 100'000u;
}

TEST(MotionLimits, HoldInRandomLoops) {
  unsigned faults = 0;
  for (unsigned seed = 0; seed < runs() && faults < 5; ++seed) {
    const std::string fault = fault_of_run(seed);
    if (fault.empty()) continue;
    ++faults;
    ADD_FAILURE() << "seed " << seed << ": " << fault;
  }
}

}  // namespace
