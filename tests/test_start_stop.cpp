// SPDX-License-Identifier: BSD-3-Clause
// Controllers that start, stop, and get bad times and old inputs: what is commanded meanwhile.
#include <gtest/gtest.h>

#include <icat/icat.hpp>
#include <random>

#include "support/robots.hpp"

namespace {

using Robot = testing_support::Robot<double>;
using Controller = icat::Controller<Robot>;
using icat::Status;
using testing_support::moved;
using Vector13d = icat::Vector<double, 13>;
namespace task = icat::task;

/// The papers' robot that moves its tool and not its vehicle, at 100 Hz.
class StartStop : public testing::Test {
 protected:
  StartStop() {
    EXPECT_EQ(robot.update(testing_support::bent_arm(), icat::Pose<double>::Identity()),
              Status::ok);
    EXPECT_EQ(tool.set_goal(moved(robot.pose(hand), 0.08, 0.05, -0.06)), Status::ok);
  }
  /// A cycle and its motion.
  Status cycle(Controller& controller, double stamp, double dt = 0.01) {
    const Status status = controller.step(stamp);
    EXPECT_TRUE(controller.velocity().allFinite());
    EXPECT_EQ(testing_support::drive(robot, controller.velocity(), dt), Status::ok);
    return status;
  }

  Robot robot = testing_support::make_robot<double>();
  icat::FrameId hand = robot.frame("tool");
  task::Minimality<Robot> still_vehicle{robot, robot.base_columns()};
  task::FramePose<Robot> tool{robot, hand, robot.pose(hand), {.gain = 1}};
  task::Minimality<Robot> still_arm{robot, icat::joint_columns(robot)};
  std::vector<icat::Action<Robot>> actions{{"move", {{still_vehicle}, {tool}}},
                                           {"rest", {{still_vehicle}, {still_arm}}}};
};

// Case M8.
TEST_F(StartStop, FromRestPrioritiesHoldFromTheFirstCycle) {
  for (const bool stopped_before : {false, true}) {
    Controller controller(robot, actions);
    double t = 0;
    if (stopped_before) {
      ASSERT_EQ(controller.start("rest", t), Status::ok);
      for (; t < 0.5; t += 0.01) ASSERT_EQ(cycle(controller, t), Status::ok);
      ASSERT_EQ(controller.stop(t, 0.1), Status::ok);
      for (; t < 1; t += 0.01) ASSERT_EQ(cycle(controller, t), Status::ok);
    }
    const icat::Pose<double> before = robot.pose(robot.base());
    ASSERT_EQ(tool.set_goal(moved(robot.pose(hand), 0.08, 0.05, -0.06)), Status::ok);
    ASSERT_EQ(controller.switch_to("move", t, 1), Status::ok);
    double farthest = 0, jump = 0;
    Vector13d last = Vector13d::Zero();
    for (int k = 0; k <= 1000; ++k) {
      ASSERT_EQ(cycle(controller, t + 0.01 * k), Status::ok);
      EXPECT_EQ(controller.phase_activations()[0], 1);
      EXPECT_EQ(controller.phase_activations()[1], 1);
      if (k != 100) {  // the end, to rounding
        EXPECT_EQ(controller.in_transition(), k < 100) << k;
      }
      jump = std::max(jump, (controller.velocity() - last).norm());
      last = controller.velocity();
      farthest = std::max(farthest,
                          (robot.pose(robot.base()).translation() - before.translation()).norm());
    }
    EXPECT_LT(farthest, 1e-4);
    // The smooth step rises by 15/8 a second at most.
    EXPECT_LT(jump, 0.05);
    EXPECT_LT(testing_support::difference(robot.pose(hand), tool.goal()).norm(), 1e-3);
  }
}

TEST_F(StartStop, StopsFromAnyStateWithinTheAccelerationLimits) {
  const icat::MotionLimits<Robot> limits(
      robot, {.max_acceleration = 0.5, .base_acceleration = std::vector<double>(6, 0.2)});
  for (const double duration : {0.01, 0.2, 2.0}) {
    for (const double begin : {0.05, 0.4, 3.0}) {
      SCOPED_TRACE(testing::Message() << duration << ' ' << begin);
      Controller controller(robot, actions, {.limits = limits});
      ASSERT_EQ(tool.set_goal(moved(robot.pose(hand), 0.3, 0.1, -0.1)), Status::ok);
      ASSERT_EQ(controller.switch_to("move", 0, 0.5), Status::ok);
      Vector13d last = Vector13d::Zero(), at_stop = last;
      int stops = 0;
      for (int k = 0; k < 1000; ++k) {
        const double t = 0.01 * k;
        if (stops == 0 && t >= begin) {
          ASSERT_EQ(controller.stop(t, duration), Status::ok);
          at_stop = last;
          stops = k;
        }
        ASSERT_EQ(cycle(controller, t), Status::ok);
        const Vector13d change = (controller.command() - last).cwiseAbs();
        EXPECT_LE(change.head<7>().maxCoeff(), 0.5 * 0.01 + 1e-12);
        EXPECT_LE(change.tail<6>().maxCoeff(), 0.2 * 0.01 + 1e-12);
        last = controller.command();
      }
      EXPECT_GT(at_stop.norm(), 1e-5);
      EXPECT_EQ(last, Vector13d::Zero());
      EXPECT_FALSE(controller.in_transition());
    }
  }
  Controller controller(robot, actions);
  EXPECT_EQ(controller.stop(NAN, 1), Status::non_finite);
  EXPECT_EQ(controller.stop(0, 0), Status::invalid_duration);
  EXPECT_EQ(controller.stop(0, INFINITY), Status::invalid_duration);
  EXPECT_EQ(controller.switch_to("move", 0, NAN), Status::invalid_duration);
}

// Case M9 and its kind: normal work goes on, and what was commanded does not last.
TEST_F(StartStop, AClockThatJumpsCostsAShortenedStep) {
  struct Jump {
    double by;
    bool once;
  };
  for (const Jump& jump : {Jump{3600, true}, Jump{3600, false}, Jump{-1e9, false}, Jump{1e9, true},
                           Jump{-0.5, false}, Jump{-0.02, true}, Jump{0.3, false}}) {
    SCOPED_TRACE(jump.by);
    Controller controller(robot, actions), steady(robot, actions);
    ASSERT_EQ(tool.set_goal(moved(robot.pose(hand), 0.1, 0.1, -0.1)), Status::ok);
    ASSERT_EQ(controller.start("move", 0), Status::ok);
    ASSERT_EQ(steady.start("move", 0), Status::ok);
    for (int k = 0; k < 300; ++k) {
      const double t = 0.01 * k;
      const bool jumped = k == 100 || (k > 100 && !jump.once);
      if (k == 50) {
        ASSERT_EQ(controller.switch_to("rest", t, 1), Status::ok);
        ASSERT_EQ(steady.switch_to("rest", t, 1), Status::ok);
      }
      ASSERT_EQ(controller.step(jumped ? t + jump.by : t), Status::ok);
      ASSERT_EQ(cycle(steady, t), Status::ok);
      // The fade is early or late by a step of at most 0.1 s, by two if the stamp comes back.
      EXPECT_LE((controller.velocity() - steady.velocity()).norm(), k < 100 ? 0 : 0.05) << k;
      if (k > 175) {
        EXPECT_EQ(controller.in_transition(), false);
        EXPECT_LT((controller.velocity() - steady.velocity()).norm(), 1e-12);
      }
    }
    EXPECT_GT(controller.clock().irregular(), 0);
  }
}

TEST_F(StartStop, AStampThatIsNoNumberHoldsAndThenStops) {
  Controller controller(robot, actions);
  ASSERT_EQ(controller.start("move", 0), Status::ok);
  for (int k = 0; k < 10; ++k) ASSERT_EQ(cycle(controller, 0.01 * k), Status::ok);
  const Vector13d before = controller.command();
  EXPECT_GT(before.norm(), 0.01);
  for (int k = 0; k < 100; ++k) {
    EXPECT_EQ(controller.step(NAN), Status::non_finite);
    if (k < 9) {
      EXPECT_EQ(controller.command(), before);
    }
    // hold, then ramp
    if (k > 9 + 51) {
      EXPECT_EQ(controller.command(), Vector13d::Zero());
    }
  }
  // And comes back when all is well.
  Vector13d last = Vector13d::Zero();
  for (int k = 11; k < 100; ++k) {
    ASSERT_EQ(controller.step(0.01 * k), Status::ok);
    EXPECT_LT((controller.command() - last).norm(), 0.05);
    last = controller.command();
  }
  EXPECT_LT((last - controller.answer()).norm(), 1e-12);
  EXPECT_LT((last - before).norm(), 0.01);
}

TEST_F(StartStop, AClockThatStandsStillIsToldAndStops) {
  Controller controller(robot, actions);
  ASSERT_EQ(controller.start("move", 0), Status::ok);
  for (int k = 0; k < 10; ++k) ASSERT_EQ(cycle(controller, 0.01 * k), Status::ok);
  Vector13d last = controller.command();
  for (int k = 1; k <= 100; ++k) {
    EXPECT_EQ(controller.step(0.09), k < 10 ? Status::ok : Status::clock_stalled) << k;
    if (k >= 10) {
      EXPECT_LE(controller.command().norm(), last.norm());
    }
    last = controller.command();
  }
  EXPECT_EQ(last, Vector13d::Zero());
  EXPECT_EQ(controller.step(0.10), Status::ok);
}

// At 1 kHz with stamps that are 2 ms wrong.
TEST_F(StartStop, FadesAreRightUnderJitter) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> error(-0.002, 0.002);
  Controller controller(robot, actions);
  ASSERT_EQ(controller.start("move", 0), Status::ok);
  for (int k = 0; k <= 500; ++k) ASSERT_EQ(controller.step(1e-3 * k + error(random)), Status::ok);
  ASSERT_EQ(controller.switch_to("rest", 0.5, 1), Status::ok);
  int ended = 0;
  for (int k = 501; k <= 2000; ++k) {
    ASSERT_EQ(controller.step(1e-3 * k + error(random)), Status::ok);
    if (ended == 0 && !controller.in_transition()) ended = k;
  }
  EXPECT_NEAR(ended, 1500, 50);
}

TEST_F(StartStop, StaleAndMissingInputsHaveTheirOwnStatus) {
  Controller controller(robot, actions, {.given = icat::ColumnRange{10, 2}});
  const Vector13d measured = Vector13d::Zero();
  const auto run = [&](double& t, Status expected, auto step) {
    for (int k = 0; k < 80; ++k) {
      t += 0.01;
      EXPECT_EQ(step(t), expected);
    }
    return controller.command();
  };
  double t = 0;
  ASSERT_EQ(controller.start("move", 0), Status::ok);
  const auto good = [&](double time) { return controller.step(time, measured, {0.05, 0.05}); };
  EXPECT_GT(run(t, Status::ok, good).norm(), 0.01);
  EXPECT_TRUE(run(t, Status::stale_state, [&](double time) {
                return controller.step(time, measured, {.state = 0.11});
              }).isZero(0));
  EXPECT_GT(run(t, Status::ok, good).norm(), 0.01);
  EXPECT_TRUE(run(t, Status::stale_velocity, [&](double time) {
                return controller.step(time, measured, {.velocity = 0.11});
              }).isZero(0));
  EXPECT_GT(run(t, Status::ok, good).norm(), 0.01);
  EXPECT_TRUE(run(t, Status::missing_velocity, [&](double time) {
                return controller.step(time);
              }).isZero(0));
  EXPECT_GT(run(t, Status::ok, good).norm(), 0.01);
  EXPECT_TRUE(run(t, Status::stale_state, [&](double time) {
                return controller.step(time, measured, {.state = NAN});
              }).isZero(0));
}

TEST_F(StartStop, DegreesForRadiansAreRefusedByName) {
  Controller controller(robot, actions);
  Eigen::VectorXd degrees = testing_support::bent_arm();
  degrees(3) *= 57.3;
  ASSERT_EQ(robot.update(degrees), Status::ok);
  ASSERT_EQ(controller.start("move", 0), Status::ok);
  EXPECT_EQ(controller.implausible_joint(), "");
  EXPECT_EQ(controller.step(0), Status::implausible_position);
  EXPECT_EQ(controller.implausible_joint(), "joint4");
  EXPECT_EQ(controller.command(), Vector13d::Zero());
  // A start a little outside is none of that.
  Eigen::VectorXd outside = testing_support::bent_arm();
  outside(3) = robot.joints()[3].upper + 0.3;
  ASSERT_EQ(robot.update(outside), Status::ok);
  EXPECT_EQ(controller.step(0.01), Status::ok);
  EXPECT_EQ(controller.implausible_joint(), "");
}

TEST_F(StartStop, RefusesBadSettings) {
  const auto with = [&](icat::TimeOptions time) {
    return testing_support::message_of([&] { Controller(robot, actions, {.time = time}); });
  };
  EXPECT_EQ(with({}), "no exception");
  EXPECT_NE(with({.max_step = 0}).find("max_step"), std::string::npos);
  EXPECT_NE(with({.hold = -1}).find("hold"), std::string::npos);
  EXPECT_NE(with({.ramp = NAN}).find("ramp"), std::string::npos);
}

// --- the same for all controllers: said again and again, in the middle of other things
// ------------

/// Two slides with limits of acceleration that go to (3, 0.3), at 100 Hz.
struct Slides {
  using Tree = icat::KinematicTree<double>;
  Slides(double acceleration, double fastest)
      : robot({.joints = {{.name = "a",
                           .parent = "base",
                           .link = "a",
                           .type = icat::JointType::prismatic,
                           .max_velocity = fastest,
                           .max_acceleration = acceleration},
                          {.name = "b",
                           .parent = "a",
                           .link = "b",
                           .type = icat::JointType::prismatic,
                           .axis = {1, 0, 0},
                           .max_velocity = fastest,
                           .max_acceleration = acceleration}}}),
        there(robot, Eigen::Vector2d(3, 0.3), {.gain = 1}),
        controller(robot, {{"go", {{there}}}}) {}
  /// A cycle; how much the command changed.
  double cycle(double stamp, icat::InputAge age = {}) {
    const Eigen::VectorXd last = controller.command();
    status = controller.step(stamp, age);
    EXPECT_EQ(robot.update((robot.q() + 0.01 * controller.command()).eval()), Status::ok);
    return (controller.command() - last).cwiseAbs().maxCoeff();
  }
  Tree robot;
  task::JointPosition<Tree> there;
  icat::Controller<Tree> controller;
  Status status{};
};

TEST(SaidAgain, StopInEveryCycleStops) {
  for (const bool before : {false, true}) {
    Slides slides(icat::infinity<double>, 0.5);
    ASSERT_EQ(slides.controller.start("go", 0), Status::ok);
    for (int k = 0; k < 400; ++k) {
      if (!before) (void)slides.cycle(0.01 * k);
      if (k >= 100) {
        ASSERT_EQ(slides.controller.stop(0.01 * k, 1), Status::ok);
      }
      if (before) (void)slides.cycle(0.01 * k);
      if (k == 99) {
        EXPECT_GT(slides.controller.command().norm(), 0.4);
      }
    }
    EXPECT_EQ(slides.controller.command(), Eigen::Vector2d::Zero());
  }
}

// What comes and goes holds no old command: each good cycle solves anew.
TEST(SaidAgain, InputThatIsStaleNowAndThenHoldsNoOldCommand) {
  for (const int period : {2, 5}) {
    Slides slides(icat::infinity<double>, 5);
    ASSERT_EQ(slides.controller.start("go", 0), Status::ok);
    for (int k = 0; k < 2000; ++k) {
      (void)slides.cycle(0.01 * k, {.state = k % period == 0 ? 0.05 : 0.15});
      EXPECT_LE(slides.robot.q()(0), 3 + 1e-3);
    }
  }
}

TEST(SaidAgain, StepsBeforeTheStartAndStampsFarAheadKeepTheAccelerationLimit) {
  Slides slides(1, 5);
  for (int k = 0; k < 500; ++k) EXPECT_EQ(slides.controller.step(0.01 * k), Status::not_started);
  ASSERT_EQ(slides.controller.start("go", 5), Status::ok);
  double stamp = 5;
  for (int k = 0; k < 600; ++k) {
    stamp += k % 100 == 50 ? 3600 : k % 100 == 70 ? -500 : 0.01;
    // The first cycle is 0.02 s after the last step; a usual step is a mean that begins there.
    EXPECT_LE(slides.cycle(stamp), k == 0 ? 0.02 + 1e-9 : 0.01 + 1e-4) << k;
  }
}

TEST(SaidAgain, ALoopSlowerThanItsLongestPeriodIsTold) {
  Slides slides(1, 5);
  ASSERT_EQ(slides.controller.start("go", 0), Status::ok);
  for (int k = 1; k <= 200; ++k) (void)slides.cycle(0.2 * k);
  EXPECT_EQ(slides.status, Status::clock_stalled);
  EXPECT_EQ(slides.controller.command(), Eigen::Vector2d::Zero());
}

TEST(SaidAgain, StampsThatStandStillStopInTime) {
  for (const bool switches : {false, true}) {
    Slides slides(icat::infinity<double>, 5);
    ASSERT_EQ(slides.controller.start("go", 0), Status::ok);
    for (int k = 0; k < 100; ++k) {
      if (switches) (void)slides.controller.switch_to("go", 0.01 * k - 2e-5, 1);
      (void)slides.cycle(0.01 * k);
    }
    int cycles = 0;
    while (slides.controller.command().norm() > 0 && cycles < 1000) {
      (void)slides.controller.step(NAN);
      ++cycles;
    }
    EXPECT_NEAR(0.01 * cycles, 0.6, 0.05) << switches;
  }
}

TEST(SaidAgain, AColumnThatIsGivenDuringAStopStaysStill) {
  Slides slides(icat::infinity<double>, 5);
  ASSERT_EQ(slides.controller.start("go", 0), Status::ok);
  for (int k = 0; k < 50; ++k) (void)slides.cycle(0.01 * k);
  ASSERT_EQ(slides.controller.stop(0.5, 2), Status::ok);
  for (int k = 50; k < 120; ++k) (void)slides.cycle(0.01 * k);
  ASSERT_EQ(slides.controller.set_given("a", true), Status::ok);
  (void)slides.cycle(1.2);
  ASSERT_EQ(slides.controller.set_given("a", false), Status::ok);
  (void)slides.cycle(1.21);
  EXPECT_EQ(slides.controller.command()(0), 0);
}

// A fault in a slow fade: the fade goes on where it was.
TEST(SaidAgain, AFaultDoesNotShortenAFade) {
  Slides slides(icat::infinity<double>, 5);
  ASSERT_EQ(slides.controller.switch_to("go", 0, 10), Status::ok);
  double largest = 0;
  for (int k = 0; k < 600; ++k) {
    const double stale = k >= 100 && k < 120 ? 1.0 : 0.0;
    const double change = slides.cycle(0.01 * k, {.state = stale});
    largest = std::max(largest, change);
    EXPECT_LE(slides.controller.command().cwiseAbs().maxCoeff(),
              3 * icat::smooth_step(0.001 * k) + 1e-9);
  }
  EXPECT_LT(largest, 0.05);
}

// A base at its limit of velocity goes where it is to go, all columns in proportion.
TEST(SaidAgain, ABaseAtItsVelocityLimitStillTurns) {
  using Tree = icat::KinematicTree<double>;
  Tree robot({.joints = {{.name = "arm", .parent = "boat", .link = "arm"}},
              .base = icat::Base<double>::surface()});
  task::FramePosition<Tree> there(robot, robot.base(), icat::Vector3<double>(0.25, 0.25, 0),
                                  {.axes = {.z = false}, .gain = 1});
  const icat::MotionLimits<Tree> limits(
      robot, {.base_velocity = {0.3, 0.3, 0.3}, .base_acceleration = {1, 1, 1}});
  icat::Controller<Tree> controller(robot, {{"go", {{there}}}}, {.limits = limits});
  ASSERT_EQ(controller.start("go", 0), Status::ok);
  for (int k = 0; k < 6000; ++k) {
    if (k == 30) {
      ASSERT_EQ(there.set_goal(icat::Vector3<double>(10, 0.25, 0)), Status::ok);
    }
    ASSERT_EQ(controller.step(0.01 * k), Status::ok);
    ASSERT_EQ(testing_support::drive(robot, controller.command(), 0.01), Status::ok);
    EXPECT_LT(robot.pose(robot.base()).translation().y(), 0.3);
  }
  EXPECT_NEAR(robot.pose(robot.base()).translation().x(), 10, 1e-3);
  EXPECT_NEAR(robot.pose(robot.base()).translation().y(), 0.25, 1e-3);
}

}  // namespace
