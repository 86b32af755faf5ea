// SPDX-License-Identifier: BSD-3-Clause
// Loops with delay: a joint at its limit comes to rest, and the limit holds.
#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <icat/icat.hpp>

#include "support/allocation_counter.hpp"
#include "support/robots.hpp"
#include "support/sanitized.hpp"

namespace {

using icat::Status;
using testing_support::message_of;
using Joint = icat::KinematicTree<double, 1>;

/// How a loop is set up.
struct Setting {
  double period, delay;  // s
  double told{1};        // the delay that the predictor is told, of the true one
  double lag{0};         // of the servo, s
  double gain{1};        // of what pushes against the limit, 1/s
  bool predicted{true}, limited{true};
};
/// What came of it.
struct Outcome {
  double farthest{-10};   // position, rad
  double alternation{0};  // largest change of the velocity that the next one undoes, last 10 s
  double speed{0};        // largest of the last 10 s
};

// Case M1: limits −2.8 … 1.7, a shape at 2.2 behind them, from 1.5 on, for 25 s.
Outcome run(const Setting& s) {
  Joint robot(Joint::Description{
      .joints = {
          {.name = "joint", .parent = "base", .link = "link", .lower = -2.8, .upper = 1.7}}});
  icat::task::JointLimits<Joint> limits(robot);
  icat::task::JointPosition<Joint> shape(robot, Eigen::VectorXd::Constant(1, 2.2),
                                         {.gain = s.gain});
  icat::Controller<Joint>::Options options;
  options.limits = icat::unlimited;
  if (s.limited) {
    options.limits =
        icat::MotionLimits<Joint>(robot, {.reaction_time = s.period + s.delay + s.lag});
  }
  icat::Controller<Joint> controller(robot, {{"hold", {{limits}, {shape}}}}, options);
  icat::StatePredictor<Joint> predictor(robot, {.delay = s.told * s.delay});
  EXPECT_EQ(controller.start("hold", 0), Status::ok);
  std::deque<std::pair<double, double>> past{{-1, 1.5}, {0, 1.5}};
  double q = 1.5, v = 0, last = 0, change = 0;
  Outcome outcome;
  for (int k = 0; k * s.period < 25; ++k) {
    const double t = k * s.period, then = t - s.delay;
    while (past.size() > 2 && past[1].first <= then) past.pop_front();
    const double u = std::max(0.0, (then - past[0].first) / (past[1].first - past[0].first));
    Eigen::VectorXd late(1);
    late(0) = past[0].second + std::min(u, 1.0) * (past[1].second - past[0].second);
    EXPECT_EQ(robot.update(s.predicted ? predictor.predict(late, t) : late), Status::ok);
    EXPECT_EQ(controller.step(t), Status::ok);
    EXPECT_EQ(predictor.command(controller.velocity(), t), Status::ok);
    const double command = controller.command()(0);
    constexpr int parts = 20;  // of the servo's lag
    for (int i = 1; i <= parts; ++i) {
      const double h = s.period / parts;
      v = s.lag > 0 ? v + (command - v) * (1 - std::exp(-h / s.lag)) : command;
      q += h * v;
      past.push_back({t + i * h, q});
    }
    outcome.farthest = std::max(outcome.farthest, q);
    if (t > 15) {
      const double next = command - last;
      if (next * change < 0) {
        outcome.alternation =
            std::max(outcome.alternation, std::min(std::abs(next), std::abs(change)));
      }
      outcome.speed = std::max(outcome.speed, std::abs(command));
      change = next;
    }
    last = command;
  }
  return outcome;
}

const std::vector<Setting> situations =
    sanitized ? std::vector<Setting>{{0.02, 0.06}}
              : std::vector<Setting>{{0.01, 0.03}, {0.05, 0},    {0.01, 0.1},
                                     {0.01, 0.05}, {0.001, 0.1}, {0.02, 0.06}};

TEST(StatePredictor, AJointAtItsLimitComesToRest) {
  for (Setting s : situations) {
    for (const double lag : {0.0, 0.03}) {
      for (const double told : {0.8, 1.0, 1.2}) {
        for (const double gain : {1.0, 5.0, 20.0}) {
          s.lag = lag;
          s.told = told;
          s.gain = gain;
          SCOPED_TRACE(testing::Message()
                       << s.period << ' ' << s.delay << ' ' << lag << ' ' << told << ' ' << gain);
          const Outcome outcome = run(s);
          EXPECT_LT(outcome.alternation, 1e-3);
          EXPECT_LT(outcome.speed, 1e-3);
          EXPECT_LE(outcome.farthest, 1.7 + 1e-9);
        }
      }
    }
  }
}

TEST(StatePredictor, WithoutItTheLimitsStillHold) {
  double worst = 0, without = 0;
  for (Setting s : situations) {
    for (const double lag : {0.0, 0.03}) {
      s.predicted = false;
      s.lag = lag;
      s.gain = 20;
      const Outcome limited = run(s);
      EXPECT_LE(limited.farthest, 1.7 + 1e-9) << s.delay << ' ' << lag;
      worst = std::max(worst, limited.speed);
      Setting unlimited = s;
      unlimited.limited = false;
      without = std::max(without, run(unlimited).farthest);
    }
  }
  EXPECT_GT(worst, 0.1) << "the delay was no difficulty";
  EXPECT_GT(without, 2.5) << "the limit was no difficulty";
}

// The bound for a servo with a lag that the reaction time counts in: the commanded position holds
// the limit up to min(a τ² / 2, 2 V τ / e), see docs/safety.md.
TEST(StatePredictor, TheBoundForALag) {
  for (const double a : {0.5, 2.0, 10.0}) {
    for (const double lag : {0.01, 0.03, 0.1}) {
      Joint robot(Joint::Description{.joints = {{.name = "joint",
                                                 .parent = "base",
                                                 .link = "link",
                                                 .lower = -2.8,
                                                 .upper = 1.7,
                                                 .max_velocity = 1,
                                                 .max_acceleration = a}}});
      icat::MotionLimits<Joint> limits(robot, {.reaction_time = 0.01 + lag});
      double q = 0, v = 0, farthest = 0;
      using Velocity = icat::Vector<double, 1>;
      for (int k = 0; k < 2000; ++k) {
        ASSERT_EQ(robot.update(Velocity(q)), Status::ok);
        limits.update(robot, {0.01, 0.01});
        // Away and back against the limit.
        const double wanted = k % 400 < 60 ? -1.0 : 1.0;
        (void)limits.limit_joints(
            Velocity(std::clamp(wanted, limits.bounds().lower(0), limits.bounds().upper(0))));
        for (int i = 0; i < 50; ++i) {
          v += (limits.command()(0) - v) * (1 - std::exp(-0.01 / 50 / lag));
          q += 0.01 / 50 * v;
        }
        farthest = std::max(farthest, q);
      }
      EXPECT_LE(farthest, 1.7 + std::min(a * lag * lag / 2, 2 * lag / std::exp(1.0)));
      EXPECT_GT(farthest, 1.5);
    }
  }
}

// Exact for a robot that does what it is told, base and joints, at any period.
TEST(StatePredictor, CarriesJointsAndBaseForward) {
  auto robot = testing_support::make_robot<double>();
  using Robot = decltype(robot);
  icat::StatePredictor<Robot> predictor(robot, {.delay = 0.1});
  const auto states = testing_support::random_states<double>(30, 77);
  std::deque<icat::StatePredictor<Robot>::State> past;
  icat::StatePredictor<Robot>::State now{robot.q(), icat::Pose<double>::Identity()};
  const double epoch = 1.76e9;
  for (int k = 0; k < 300; ++k) {
    past.push_back(now);
    if (past.size() > 11) past.pop_front();
    const double t = epoch + 0.01 * k;
    if (k >= 10) {
      const auto& arrived = past.front();
      const auto& state = predictor.predict(arrived.q, arrived.base_pose, t);
      // Stamps of this epoch hold 2e-7 s, and the speeds are some 5 rad/s.
      EXPECT_LT((state.q - now.q).norm(), 1e-5);
      EXPECT_LT((state.base_pose.matrix() - now.base_pose.matrix()).norm(), 1e-5);
      ASSERT_EQ(robot.update(state.q, state.base_pose), Status::ok);
    }
    const auto& s = states[static_cast<std::size_t>(k / 10)];
    icat::Vector<double, 13> velocity;
    velocity << s.q, s.vehicle.translation() * 0.1, s.vehicle.translation().reverse() * 0.3;
    ASSERT_EQ(predictor.command(velocity, t), Status::ok);
    now.q += 0.01 * velocity.head<7>();
    now.base_pose = icat::integrate<double>(now.base_pose, velocity.tail<6>(), 0.01);
  }
}

TEST(StatePredictor, RefusesBadInput) {
  const Joint robot(Joint::Description{.joints = {{"joint", "base", "link"}}});
  using Predictor = icat::StatePredictor<Joint>;
  EXPECT_EQ(message_of([&] { Predictor(robot, {.delay = -1}); }),
            "StatePredictor: delay must be in [0, 10] s, got -1");
  EXPECT_THROW(Predictor(robot, {.delay = NAN}), std::invalid_argument);
  EXPECT_THROW(Predictor(robot, {.max_step = 0}), std::invalid_argument);
  Predictor predictor(robot, {.delay = 0.05});
  using Velocity = icat::Vector<double, 1>;
  ASSERT_EQ(predictor.command(Velocity(1.0), 0), Status::ok);
  EXPECT_EQ(predictor.command(Velocity(NAN), 0.01), Status::non_finite);
  EXPECT_EQ(predictor.command(Velocity(1.0), NAN), Status::non_finite);
  EXPECT_NEAR(predictor.predict(Velocity(0.0), 0.02)(0), 0.02, 1e-12);
  EXPECT_EQ(predictor.predict(Eigen::VectorXd::Zero(2), 0.02).size(), 1);
  const Velocity q(0.3);
  EXPECT_EQ(count_allocations([&] {
              for (int k = 3; k < 100; ++k) {
                (void)predictor.predict(q, 0.01 * k);
                (void)predictor.command(q, 0.01 * k);
              }
            }),
            0);
}

}  // namespace
