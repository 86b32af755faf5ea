// SPDX-License-Identifier: BSD-3-Clause
// Time stamps that do what they do, and the steps made of them.
#include <gtest/gtest.h>

#include <cmath>
#include <icat/icat.hpp>
#include <random>

namespace {

using icat::Status;
using icat::StepClock;

/// At 100 Hz from `begin` on for a second.
StepClock running(double begin) {
  StepClock clock(0.1);
  for (int k = 0; k <= 100; ++k) EXPECT_EQ(clock.advance(begin + 0.01 * k), Status::ok);
  EXPECT_NEAR(clock.elapsed(), 1, 1e-6);
  return clock;
}

/// The next regular stamps after `stamp` are ordinary steps again.
void expect_normal_work(StepClock& clock, double stamp) {
  for (int k = 1; k <= 10; ++k) {
    EXPECT_EQ(clock.advance(stamp + 0.01 * k), Status::ok);
    EXPECT_NEAR(clock.step(), 0.01, 1e-6) << k;
    EXPECT_FALSE(clock.stalled());
  }
}

TEST(StepClock, RegularStampsOfAnyEpoch) {
  for (const double begin : {0.0, -50.0, 1.76e9}) {
    StepClock clock = running(begin);
    icat::CycleTime time;
    EXPECT_EQ(clock.since(time).step, 0.1);  // no longer than max_step
    EXPECT_EQ(clock.since(time).step, 0);
    EXPECT_EQ(clock.irregular(), 0);
    expect_normal_work(clock, begin + 1);
  }
}

// Case M9, each as a jump from one second to another and on from there.
TEST(StepClock, AJumpCostsOneShortenedStep) {
  struct Jump {
    double to, step;
  };
  for (const double begin : {0.0, 1.76e9}) {
    const double now = begin + 1;
    for (const Jump& jump :
         {Jump{now + 3600, 0.01}, Jump{2e9, 0.01}, Jump{now + 0.15, 0.01}, Jump{now - 3600, 0},
          Jump{0, 0}, Jump{now - 0.05, 0}, Jump{now - 0.5, 0}}) {
      if (jump.to == now - 1) continue;
      SCOPED_TRACE(jump.to - now);
      StepClock clock = running(begin);
      EXPECT_EQ(clock.advance(jump.to), Status::ok);
      EXPECT_NEAR(clock.step(), jump.step, 1e-6);
      EXPECT_EQ(clock.irregular(), 1);
      expect_normal_work(clock, jump.to);
    }
  }
}

TEST(StepClock, AnHourAheadAndBack) {
  StepClock clock = running(5);
  EXPECT_EQ(clock.advance(3606), Status::ok);
  EXPECT_NEAR(clock.step(), 0.01, 1e-6);
  EXPECT_EQ(clock.advance(6.02), Status::ok);
  EXPECT_EQ(clock.step(), 0);
  EXPECT_EQ(clock.irregular(), 2);
  expect_normal_work(clock, 6.02);
}

TEST(StepClock, WhatIsNoNumberIsRefused) {
  StepClock clock = running(5);
  for (const double stamp : {double(NAN), double(INFINITY), -double(INFINITY)}) {
    EXPECT_EQ(clock.advance(stamp), Status::non_finite);
    EXPECT_EQ(clock.step(), 0);
  }
  EXPECT_NEAR(clock.elapsed(), 1, 1e-9);
  EXPECT_EQ(clock.irregular(), 0);
  expect_normal_work(clock, 6);
}

TEST(StepClock, StallsAfterTenUnchangedStamps) {
  StepClock clock = running(0);
  for (int k = 1; k <= 30; ++k) {
    EXPECT_EQ(clock.advance(1), Status::ok);
    EXPECT_EQ(clock.step(), 0);
    EXPECT_EQ(clock.stalled(), k >= 10) << k;
  }
  expect_normal_work(clock, 1);
}

// Stamps that are 2 ms wrong at 1 kHz: more than a quarter of the differences are negative.
TEST(StepClock, JitterKeepsTheMean) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> error(-0.002, 0.002);
    StepClock clock(0.1);
    int backwards = 0;
    double last = -1, worst = 0;
    for (int k = 0; k <= 10000; ++k) {
      const double stamp = 100 + 1e-3 * k + error(random);
      if (stamp < last) ++backwards;
      last = stamp;
      ASSERT_EQ(clock.advance(stamp), Status::ok);
      EXPECT_GE(clock.step(), 0);
      // A fade of a second begun anywhere: right to 5 %.
      if (k >= 500) worst = std::max(worst, std::abs(clock.elapsed() - 1e-3 * k));
    }
    EXPECT_GT(backwards, 2000);
    EXPECT_LT(worst, 0.05 / 2) << seed;
  }
}

TEST(StepClock, RefusesABadLongestStep) {
  for (const double bad : {0.0, -1.0, double(NAN), double(INFINITY)}) {
    EXPECT_THROW(StepClock{bad}, std::invalid_argument);
  }
}

}  // namespace
