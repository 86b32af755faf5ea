// SPDX-License-Identifier: BSD-3-Clause
// Hard limits: what they promise, in random loops.
#include <gtest/gtest.h>

#include <cstdlib>
#include <deque>
#include <icat/icat.hpp>
#include <random>

#include "support/robots.hpp"
#include "support/sanitized.hpp"

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
  return told        ? static_cast<unsigned>(std::strtoul(told, nullptr, 10))
         : sanitized ? 2'000u
                     : 100'000u;
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

// --- what they are made of -----------------------------------------------------------------------

TEST(MotionLimits, AreThoseThatTheRobotStatesOrOthers) {
  Row robot;
  robot.infos[0].upper = 1;
  robot.infos[0].max_velocity = 0.5;
  robot.infos[1].max_velocity = 2;
  const icat::Cycle cycle{0.01, 0.01};
  const auto box = [&](Limits limits) {
    limits.update(robot, cycle);
    return limits.upper();
  };
  EXPECT_EQ(box(Limits(robot)), Vector3(0.5, 2, inf));
  EXPECT_EQ(box(Limits(robot, {.max_velocity = 1})), Vector3(0.5, 1, 1));
  EXPECT_EQ(box(Limits(robot, {.max_velocity = 1, .max_acceleration = 3})),
            Vector3(0.03, 0.03, 0.03));
  // In place of the robot's own, by name.
  EXPECT_EQ(box(Limits(robot, {.joints = {{.name = "lift", .column = 0, .max_velocity = 4}}})),
            Vector3(4, 2, inf));
  robot.x(0) = 0.99;
  EXPECT_NEAR(box(Limits(robot, {.reaction_time = 0.05}))(0), 0.2, 1e-12);
  robot.x(0) = 1;
  EXPECT_EQ(box(Limits(robot))(0), 0);
  robot.x(0) = 1.2;
  EXPECT_EQ(box(Limits(robot))(0), 0);
}

TEST(MotionLimits, RefuseBadSettingsByName) {
  Row robot;
  const auto with = [&](Limits::Options options) {
    return message_of([&] { Limits(robot, options); });
  };
  EXPECT_EQ(with({}), "no exception");
  EXPECT_EQ(with({.reaction_time = 0}),
            "MotionLimits: reaction_time must be finite and > 0, got 0");
  EXPECT_EQ(with({.reaction_time = 20}),
            "MotionLimits: reaction_time must be at most 10 s, got 20");
  EXPECT_EQ(with({.max_velocity = -1}),
            "MotionLimits: limits of velocity and acceleration must be > 0");
  EXPECT_EQ(with({.joints = {{.name = "arm", .column = 0}}}),
            "MotionLimits: no joint 'arm'; there are 'lift', 'turn', 'wheel'");
  EXPECT_EQ(with({.joints = {{.name = "turn", .column = 1, .lower = 2, .upper = 1}}}),
            "MotionLimits: joint 'turn': limits must be in order, got [2, 1]");
  EXPECT_EQ(with({.joints = {{.name = "turn", .column = 1, .max_acceleration = 0}}}),
            "MotionLimits: joint 'turn': limits of velocity and acceleration must be > 0");
  EXPECT_EQ(with({.base_velocity = {1}}),
            "MotionLimits: 1 limits of the base, which has 0 columns");
}

// A joint that must brake does not hold the others; those that are free share a scale.
TEST(MotionLimits, ABrakingJointIsBroughtInAlone) {
  Row robot;
  for (auto& joint : robot.infos) joint.max_acceleration = 1;
  robot.infos[0].upper = 1;
  Limits limits(robot, {.reaction_time = 0.01});
  const icat::Cycle cycle{0.01, 0.01};
  for (int k = 0; k < 50; ++k) {
    limits.update(robot, cycle);
    (void)limits.limit_joints({1, 0.2, 0.4});
  }
  EXPECT_NEAR(limits.command()(0), 0.5, 1e-12);
  EXPECT_NEAR(limits.command()(1), 0.1, 1e-12);  // on the line to what is wanted
  EXPECT_NEAR(limits.command()(2), 0.2, 1e-12);
  robot.x(0) = 0.99;  // no way left to go on
  limits.update(robot, cycle);
  EXPECT_FALSE(limits.limit_joints({1, 0.2, 0.4}));
  EXPECT_NEAR(limits.command()(0), 0.49, 1e-12);
  EXPECT_NEAR(limits.command()(1), 0.105, 1e-12);
  EXPECT_NEAR(limits.command()(2), 0.21, 1e-12);
}

// Cases M7 and M11: goals at 10 Hz, gain 3, and the vehicle is slow.
TEST(MotionLimits, GoalsThatJumpMoveTheRobotWithinItsAccelerations) {
  auto robot = testing_support::make_robot<double>();
  using Uvms = decltype(robot);
  ASSERT_EQ(robot.update(testing_support::bent_arm(), icat::Pose<double>::Identity()), Status::ok);
  const icat::FrameId hand = robot.frame("tool");
  const icat::Pose<double> begin = robot.pose(hand);
  icat::task::JointLimits<Uvms> joints(robot);
  icat::task::FramePose<Uvms> tool(robot, hand, begin, {.gain = 3});
  const icat::MotionLimits<Uvms> limits(robot, {.max_velocity = 1,
                                                .max_acceleration = 2,
                                                .base_velocity = std::vector<double>(6, 0.3),
                                                .base_acceleration = std::vector<double>(6, 0.05)});
  icat::Controller<Uvms> controller(robot, {{"follow", {{joints}, {tool}}}}, {.limits = limits});
  ASSERT_EQ(controller.start("follow", 0), Status::ok);
  icat::Vector<double, 13> last = icat::Vector<double, 13>::Zero();
  double error = 0, base_step = 0;
  for (int k = 0; k < 2000; ++k) {
    const double t = 0.01 * k;
    icat::Vector6<double> velocity = icat::Vector6<double>::Zero();
    velocity(0) = -0.1 * std::sin(t);
    const icat::Pose<double> goal = testing_support::moved(begin, 0.1 * (std::cos(t) - 1), 0, 0);
    if (k % 10 == 0) {
      ASSERT_EQ(tool.set_goal(goal, velocity), Status::ok);
    }
    ASSERT_EQ(controller.step(t), Status::ok);
    const icat::Vector<double, 13> step = (controller.command() - last).cwiseAbs();
    EXPECT_LE(step.head<7>().maxCoeff(), 2 * 0.01 + 1e-12);
    EXPECT_LE(step.tail<6>().maxCoeff(), 0.05 * 0.01 + 1e-12);
    base_step = std::max(base_step, step.tail<6>().maxCoeff());
    last = controller.command();
    ASSERT_EQ(testing_support::drive(robot, controller.velocity(), 0.01), Status::ok);
    if (k > 300) {
      error = std::max(error, (robot.pose(hand).translation() - goal.translation()).norm());
    }
  }
  // The goal itself is held for 0.1 s at 0.1 m/s. The slow vehicle takes its time; the arm does
  // not.
  EXPECT_LT(error, 0.015);
  EXPECT_GT(base_step, 0.049 * 0.01) << "the vehicle's limit was no difficulty";
}

TEST(MotionLimits, AreOnByDefaultAndOffByAWord) {
  Row robot;
  robot.infos[0].max_velocity = 0.5;
  icat::task::JointPosition<Row> there(robot, Vector3(2, 0, 0), {.gain = 1});
  const std::vector<icat::Action<Row>> actions{{"go", {{there}}}};
  icat::Controller<Row> limited(robot, actions), free(robot, actions, {.limits = icat::unlimited});
  for (auto* c : {&limited, &free}) {
    ASSERT_EQ(c->start("go", 0), Status::ok);
    ASSERT_EQ(c->step(0), Status::ok);
  }
  EXPECT_NEAR(limited.command()(0), 0.5, 1e-12);
  EXPECT_NEAR(free.command()(0), 2, 1e-9);
  // The solver gets the box, so the answer is within it already.
  EXPECT_FALSE(limited.limited());
  EXPECT_LT(limited.report().levels()[0].saturation_scale, 1);
}

}  // namespace
