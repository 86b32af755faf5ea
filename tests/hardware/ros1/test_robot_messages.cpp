// SPDX-License-Identifier: BSD-3-Clause
// The plain data that the adapters of ROS 1 and DDS share.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "icat/adapters/robot_frames.hpp"
#include "icat/adapters/robot_messages.hpp"

namespace {

using icat::JointStates;
using icat::StampOrder;
using icat::Status;

const double nan = std::nan("");
const double infinity = std::numeric_limits<double>::infinity();

TEST(StampOrder, DropsWhatIsDoubledOrLate) {
  StampOrder order;
  EXPECT_EQ(order.accept(10.0), Status::ok);
  EXPECT_EQ(order.accept(10.0), Status::time_reversed);
  EXPECT_EQ(order.accept(10.1), Status::ok);
  EXPECT_EQ(order.accept(9.2),
            Status::time_reversed);  // each newer than the one before it, yet late
  EXPECT_EQ(order.accept(9.3), Status::time_reversed);
  EXPECT_EQ(order.accept(9.4), Status::time_reversed);
  EXPECT_EQ(order.accept(10.2), Status::ok);
  for (const double bad : {nan, infinity, -infinity}) {
    EXPECT_EQ(order.accept(bad), Status::non_finite);
  }
  EXPECT_EQ(order.accept(10.3), Status::ok);
}

// One wrong stamp must not silence a sender for as long as it is wrong by.
TEST(StampOrder, SurvivesALeapIntoTheFuture) {
  for (const double leap : {1.5, 3600.0, 1e9, 1e300}) {
    StampOrder order;
    EXPECT_EQ(order.accept(10.00), Status::ok);
    EXPECT_EQ(order.accept(10.01 + leap), Status::ok);
    EXPECT_EQ(order.accept(10.02), Status::time_reversed);
    EXPECT_EQ(order.accept(10.02), Status::time_reversed);  // doubled: confirms nothing
    EXPECT_EQ(order.accept(10.03), Status::ok);
    EXPECT_EQ(order.accept(10.03), Status::time_reversed);
    EXPECT_EQ(order.accept(10.04), Status::ok);
  }
  // A leap of less than `set_back` heals when the stamps overtake it.
  StampOrder order;
  EXPECT_EQ(order.accept(10.0), Status::ok);
  EXPECT_EQ(order.accept(10.9), Status::ok);
  int dropped = 0;
  for (double t = 10.01; order.accept(t) != Status::ok; t += 0.01) ++dropped;
  EXPECT_LE(dropped, 100 * StampOrder::set_back);
}

TEST(StampOrder, ASenderThatBeginsAnewIsTakenFromItsSecondMessageOn) {
  StampOrder order;
  EXPECT_EQ(order.accept(1000.0), Status::ok);
  EXPECT_EQ(order.accept(0.01), Status::time_reversed);
  EXPECT_EQ(order.accept(0.02), Status::ok);
  order.restart();
  EXPECT_EQ(order.accept(-5.0), Status::ok);
}

// A message that hung for long beside a sender that goes on is not taken, nor is a second sender
// whose clock is far behind.
TEST(StampOrder, WhatIsFarBehindIsNotTakenWhileOthersAreNewer) {
  StampOrder order;
  EXPECT_EQ(order.accept(100.00), Status::ok);
  for (int k = 1; k < 100; ++k) {
    EXPECT_EQ(order.accept(50 + 0.01 * k), Status::time_reversed);
    EXPECT_EQ(order.accept(100 + 0.01 * k), Status::ok);
  }
}

TEST(JointStates, KeepsTheLastGoodSampleOfEachJoint) {
  JointStates joints({"a", "b"});
  EXPECT_EQ(joints.age(5.0), infinity);
  EXPECT_EQ(joints.put("a", {1, 2, 3}, 10, 5.0), Status::ok);
  EXPECT_EQ(joints.age(5.0), infinity);  // b was not heard of
  EXPECT_EQ(joints.put("b", {4, 5, 6}, 10, 5.1), Status::ok);
  EXPECT_DOUBLE_EQ(joints.age(5.5), 0.5);
  EXPECT_EQ(joints.put("c", {9, 9, 9}, 11, 5.2), Status::unknown_joint);
  EXPECT_EQ(joints.put("", {9, 9, 9}, 11, 5.2), Status::unknown_joint);
  EXPECT_EQ(joints.put("a", {9, 9, 9}, 10, 5.2), Status::time_reversed);
  EXPECT_EQ(joints.put("a", {nan, 9, 9}, 11, 5.2), Status::non_finite);
  EXPECT_EQ(joints.put("a", {9, infinity, 9}, 11, 5.2), Status::non_finite);
  EXPECT_EQ(joints.put("a", {9, 9, -infinity}, 11, 5.2), Status::non_finite);
  EXPECT_EQ(joints.put("a", {9, 9, 9}, nan, 5.2), Status::non_finite);
  EXPECT_EQ(joints.put("a", {9, 9, 9}, 11, nan), Status::non_finite);
  EXPECT_EQ(joints[0].value.position, 1);
  EXPECT_EQ(joints[0].value.velocity, 2);
  EXPECT_EQ(joints[0].value.effort, 3);
  EXPECT_EQ(joints[0].time, 5.0);
  EXPECT_EQ(joints[0].count, 1u);
  // What was refused has not moved the order of the stamps.
  EXPECT_EQ(joints.put("a", {7, 8, 9}, 10.5, 5.3), Status::ok);
  EXPECT_EQ(joints[0].value.position, 7);
}

TEST(JointStates, NanVelocityAndEffortSayThatThereIsNone) {
  JointStates joints({"a"});
  EXPECT_EQ(joints.put("a", {1, nan, nan}, 10, 5.0), Status::ok);
  EXPECT_EQ(joints[0].value.position, 1);
  EXPECT_EQ(joints[0].value.velocity, 0);
  EXPECT_EQ(joints[0].value.effort, 0);
}

TEST(JointStates, AnAgeAtNoTimeIsInfinite) {
  JointStates joints({"a", "b"});
  EXPECT_EQ(joints.put("a", {}, 1, 5.0), Status::ok);
  EXPECT_EQ(joints.put("b", {}, 1, 5.0), Status::ok);
  EXPECT_EQ(joints.age(nan), infinity);
  EXPECT_EQ(joints.age(infinity), infinity);
  EXPECT_EQ(joints.age(4.0), 1);  // the caller's clock was set back
}

TEST(JointStates, RestartForgetsStampsOnly) {
  JointStates joints({"a"});
  EXPECT_EQ(joints.put("a", {1, 0, 0}, 100, 5.0), Status::ok);
  joints.restart();
  EXPECT_EQ(joints[0].value.position, 1);
  EXPECT_EQ(joints.put("a", {2, 0, 0}, 1, 5.1), Status::ok);
  EXPECT_EQ(joints[0].value.position, 2);
}

TEST(JointStates, RefusesBadLists) {
  EXPECT_THROW(JointStates({}), std::invalid_argument);
  EXPECT_THROW(JointStates({"a", ""}), std::invalid_argument);
  EXPECT_THROW(JointStates({"a", "b", "a"}), std::invalid_argument);
}

// v_world = R(q) v_base, q = x, y, z, w.
std::array<double, 3> rotated(const std::array<double, 4>& q, const std::array<double, 3>& v) {
  const auto [x, y, z, w] = q;
  const std::array<double, 3> t{2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]),
                                2 * (x * v[1] - y * v[0])};
  return {v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2],
          v[2] + w * t[2] + x * t[1] - y * t[0]};
}

TEST(RobotFrames, TheSameArrowInTheOtherWorld) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 100; ++k) {
    icat::Odometry enu;
    for (double& x : enu.position) x = normal(random);
    double square = 0;
    for (double& x : enu.orientation) {
      x = normal(random);
      square += x * x;
    }
    for (double& x : enu.orientation) x /= std::sqrt(square);
    for (double& x : enu.twist) x = normal(random);
    const icat::Odometry ned = icat::other_world(enu);
    // The linear velocity as an arrow in each world: x and y change places, z its sign.
    const auto east = rotated(enu.orientation, {enu.twist[0], enu.twist[1], enu.twist[2]});
    const auto north = rotated(ned.orientation, {ned.twist[0], ned.twist[1], ned.twist[2]});
    EXPECT_NEAR(north[0], east[1], 1e-14);
    EXPECT_NEAR(north[1], east[0], 1e-14);
    EXPECT_NEAR(north[2], -east[2], 1e-14);
    EXPECT_EQ(ned.position[0], enu.position[1]);
    EXPECT_EQ(ned.position[1], enu.position[0]);
    EXPECT_EQ(ned.position[2], -enu.position[2]);
    const icat::Odometry back = icat::other_world(ned);
    EXPECT_EQ(back.position, enu.position);
    EXPECT_EQ(back.twist, enu.twist);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_NEAR(back.orientation[i], enu.orientation[i], 1e-15);
    }
  }
  // Two worlds that begin where the robot does.
  icat::Odometry up;
  up.position = {1, 2, 3};
  up.orientation = {0.1, 0.5, -0.5, 0.7};
  up.twist = {1, 2, 3, 4, 5, 6};
  const icat::Odometry down = icat::other_base(up);
  const auto v = rotated(up.orientation, {1, 2, 3}), w = rotated(down.orientation, {1, -2, -3});
  EXPECT_EQ(down.position, (std::array<double, 3>{1, -2, -3}));
  EXPECT_EQ(down.twist, (icat::Twist{1, -2, -3, 4, -5, -6}));
  EXPECT_NEAR(w[0], v[0], 1e-15);
  EXPECT_NEAR(w[1], -v[1], 1e-15);
  EXPECT_NEAR(w[2], -v[2], 1e-15);
  // A vehicle that looks to the north, level: ENU's yaw of 90 degrees is NED's yaw of 0.
  icat::Odometry north;
  north.orientation = {0, 0, std::sqrt(0.5), std::sqrt(0.5)};
  EXPECT_NEAR(std::abs(icat::other_world(north).orientation[3]), 1, 1e-15);
}

}  // namespace
