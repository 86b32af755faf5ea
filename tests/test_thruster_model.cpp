// SPDX-License-Identifier: BSD-3-Clause
// The propeller of sim/thruster.hpp: lag, asymmetry, dead zone.
#include <gtest/gtest.h>

#include <cmath>
#include <icat/sim/thruster.hpp>

namespace {

using icat::Status;
using Model = icat::ThrusterModel<double>;

// 1 − exp(−t/τ) in speed, its square in thrust, whatever the steps.
TEST(ThrusterModel, StepResponseIsExact) {
  for (const double dt : {0.3, 0.01, 0.0005}) {
    Model thruster({.maximum = 60, .minimum = -48, .time_constant = 0.15, .dead_zone = 0});
    for (int k = 1; k * dt < 0.6 + 1e-9; ++k) {
      ASSERT_EQ(thruster.update(30, dt), Status::ok);
      const double speed = std::sqrt(0.5) * (1 - std::exp(-k * dt / 0.15));
      // Rounding of 1,200 steps.
      EXPECT_NEAR(thruster.speed(), speed, 1e-13);
      EXPECT_NEAR(thruster.thrust(), 60 * speed * speed, 1e-11);
    }
    EXPECT_NEAR(thruster.thrust(), 30 * std::pow(1 - std::exp(-4), 2), 1e-9);
  }
}

TEST(ThrusterModel, PullsLessThanItPushes) {
  Model thruster({.maximum = 60, .minimum = -48, .time_constant = 0, .dead_zone = 0});
  for (const double f : {-1000.0, -48.0, -20.0, -0.1, 0.0, 0.1, 20.0, 60.0, 1e300}) {
    ASSERT_EQ(thruster.update(f, 0.01), Status::ok);
    EXPECT_NEAR(thruster.thrust(), std::min(std::max(f, -48.0), 60.0), 1e-12);
  }
  // From full ahead to full astern it is slower than it seems: through zero.
  Model slow({.maximum = 60, .minimum = -48, .time_constant = 0.15, .dead_zone = 0});
  ASSERT_EQ(slow.update(60, 100), Status::ok);
  ASSERT_EQ(slow.update(-48, 0.15 * std::log(2.0)), Status::ok);
  EXPECT_NEAR(slow.thrust(), 0, 1e-12);
  // One that cannot turn round.
  Model one_way({.maximum = 60, .minimum = 0, .time_constant = 0, .dead_zone = 0});
  ASSERT_EQ(one_way.update(-10, 1), Status::ok);
  EXPECT_EQ(one_way.thrust(), 0);
}

TEST(ThrusterModel, NothingInTheDeadZone) {
  Model thruster({.maximum = 60, .minimum = -48, .time_constant = 0, .dead_zone = 0.05});
  for (int k = -100; k <= 100; ++k) {
    const double f = 0.1 * k + 0.05;
    ASSERT_EQ(thruster.update(f, 0.01), Status::ok);
    EXPECT_NEAR(thruster.thrust(), f > 0.05 * 60 || f < -0.05 * 48 ? f : 0, 1e-12) << f;
  }
  // On the way through it nothing comes, for τ (√0.05 + √0.05) about.
  Model slow;
  ASSERT_EQ(slow.update(60, 100), Status::ok);
  double nothing = 0;
  for (int k = 0; k < 1000; ++k) {
    ASSERT_EQ(slow.update(-48, 0.001), Status::ok);
    nothing += slow.thrust() == 0 ? 0.001 : 0;
  }
  const double n0 = std::sqrt(0.05);
  EXPECT_NEAR(nothing, 0.15 * std::log((1 + n0) / (1 - n0)), 0.002);
}

TEST(ThrusterModel, Refusals) {
  Model thruster;
  ASSERT_EQ(thruster.update(30, 0.1), Status::ok);
  const double thrust = thruster.thrust();
  EXPECT_EQ(thruster.update(std::nan(""), 0.1), Status::non_finite);
  EXPECT_EQ(thruster.update(30, 1.0 / 0.0), Status::non_finite);
  EXPECT_EQ(thruster.update(30, -0.1), Status::time_reversed);
  EXPECT_EQ(thruster.thrust(), thrust);
  thruster.reset();
  EXPECT_EQ(thruster.thrust(), 0);
  const auto refused = [](const Model::Options& options, const char* text) {
    try {
      Model{options};
      FAIL() << "accepted: " << text;
    } catch (const std::invalid_argument& error) {
      EXPECT_STREQ(error.what(), text);
    }
  };
  refused({.maximum = -1},
          "ThrusterModel: limits must be finite, minimum <= 0 <= maximum, got -48 and -1");
  refused({.time_constant = -0.1},
          "ThrusterModel: time_constant must be finite and >= 0, got -0.1");
  refused({.dead_zone = 1}, "ThrusterModel: dead_zone must be in [0, 1), got 1");
}

TEST(ThrusterModel, Float) {
  icat::ThrusterModel<float> thruster;
  ASSERT_EQ(thruster.update(30.0F, 0.15), Status::ok);
  EXPECT_NEAR(thruster.thrust(), 30 * std::pow(1 - std::exp(-1), 2), 1e-5);
}

}  // namespace
