// SPDX-License-Identifier: BSD-3-Clause
// ros1.hpp without roscpp: what it takes, what it refuses, what it sends, and that none of it
// allocates. The link here is the test's.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "icat/adapters/ros1.hpp"
#include "tests/support/allocation_counter.hpp"

namespace {

namespace link = icat::detail::ros1;
using icat::Status;

const double nan = std::nan("");
const double infinity = std::numeric_limits<double>::infinity();

// Hands over what the test puts there; keeps what is sent.
struct FakeLink : link::Link {
  inline static FakeLink* last = nullptr;
  inline static std::string refusal;

  explicit FakeLink(const link::Settings& s) : settings(s), velocities(s.joints) { last = this; }
  void receive(link::Listener& listener) noexcept override {
    if (joints) listener.joint_states(*joints);
    if (base) listener.odometry(*base);
    joints = nullptr;
    base = nullptr;
  }
  bool send_twist(const double* t) noexcept override {
    std::copy(t, t + 6, twist.begin());
    ++sent;
    return up;
  }
  bool send_joint_velocities(const double* v) noexcept override {
    std::copy(v, v + velocities.size(), velocities.begin());
    ++sent;
    return up;
  }
  unsigned twist_listeners() const noexcept override { return 1; }
  unsigned joint_listeners() const noexcept override { return 2; }
  bool running() const noexcept override { return up; }

  link::Settings settings;
  const link::JointStateView* joints{nullptr};
  const link::OdometryView* base{nullptr};
  icat::Twist twist{};
  std::vector<double> velocities;
  int sent{0};
  bool up{true};
};

}  // namespace

std::unique_ptr<link::Link> link::open(const Settings& settings, std::string& error) {
  error = FakeLink::refusal;
  if (!error.empty()) return nullptr;
  return std::make_unique<FakeLink>(settings);
}

namespace {

struct Ros1Link : testing::Test {
  icat::Ros1 ros{{"a", "b"}};
  FakeLink& fake{*FakeLink::last};
  std::vector<std::string> names{"b", "somebody_else", "a"};
  std::vector<double> positions{2, 9, 1}, velocities{0.2, 9, 0.1}, efforts{20, 90, 10};
  link::OdometryView base{{1, 2, 3}, {0, 0, 0, 1}, {1, 2, 3, 4, 5, 6}, 10, 0};

  link::JointStateView view(double stamp, double waited = 0) const {
    return {names.data(),     positions.data(),  velocities.data(), efforts.data(), names.size(),
            positions.size(), velocities.size(), efforts.size(),    stamp,          waited};
  }
  Status put(const link::JointStateView& message, double now) {
    const auto before = ros.refused().count;
    fake.joints = &message;
    EXPECT_EQ(ros.receive(now), Status::ok);
    return ros.refused().count == before ? Status::ok : ros.refused().value;
  }
  Status put(const link::OdometryView& message, double now) {
    const auto before = ros.refused().count;
    fake.base = &message;
    EXPECT_EQ(ros.receive(now), Status::ok);
    return ros.refused().count == before ? Status::ok : ros.refused().value;
  }
  void all_is_well(double now) {
    EXPECT_EQ(put(view(1000 + now), now), Status::ok);
    base.stamp = 1000 + now;
    EXPECT_EQ(put(base, now), Status::ok);
    EXPECT_TRUE(ros.healthy(now));
  }
};

TEST_F(Ros1Link, TakesJointsInAnyOrderAmongOthers) {
  EXPECT_EQ(put(view(10), 5), Status::ok);
  EXPECT_EQ(ros.joints()[0].value.position, 1);
  EXPECT_EQ(ros.joints()[0].value.velocity, 0.1);
  EXPECT_EQ(ros.joints()[0].value.effort, 10);
  EXPECT_EQ(ros.joints()[1].value.position, 2);
  EXPECT_EQ(ros.joints()[1].time, 5);
  velocities.clear();
  efforts.clear();
  EXPECT_EQ(put(view(11), 6), Status::ok);
  EXPECT_EQ(ros.joints()[0].value.velocity, 0);
  EXPECT_EQ(ros.joints()[0].value.effort, 0);
}

TEST_F(Ros1Link, RefusesArraysThatDoNotFitTogether) {
  for (auto* array : {&positions, &velocities, &efforts}) {
    for (const std::size_t size : {std::size_t{0}, std::size_t{2}, std::size_t{4}}) {
      if (size == 0 && array != &positions) continue;
      const std::vector<double> good = *array;
      array->resize(size);
      EXPECT_EQ(put(view(10), 5), Status::wrong_size);
      *array = good;
    }
  }
  EXPECT_EQ(ros.joints()[0].count, 0u);
}

TEST_F(Ros1Link, OneBadJointLeavesTheOthers) {
  positions[2] = nan;  // a
  EXPECT_EQ(put(view(10), 5), Status::non_finite);
  EXPECT_EQ(ros.joints()[0].count, 0u);
  EXPECT_EQ(ros.joints()[1].value.position, 2);
  EXPECT_FALSE(ros.healthy(5));
}

TEST_F(Ros1Link, StampsAreNeededUnlessTheOptionsSayOtherwise) {
  EXPECT_EQ(put(view(0), 5), Status::clock_stalled);
  base.stamp = 0;
  EXPECT_EQ(put(base, 5), Status::clock_stalled);
  EXPECT_EQ(put(view(10), 5), Status::ok);
  EXPECT_EQ(put(view(10), 6), Status::time_reversed);
  EXPECT_EQ(ros.joints()[0].time, 5);

  icat::Ros1 lax({"a", "b"}, {.stamped = false});
  for (int k = 1; k < 4; ++k) {
    const auto message = view(0);
    FakeLink::last->joints = &message;
    FakeLink::last->base = &base;
    EXPECT_EQ(lax.receive(k), Status::ok);
    EXPECT_EQ(lax.joints()[0].time, k);
    EXPECT_EQ(lax.odometry().time, k);
  }
  EXPECT_EQ(lax.refused().count, 0u);
}

// A loop that stood still finds old messages: their age counts from when they came.
TEST_F(Ros1Link, WaitingIsAge) {
  EXPECT_EQ(put(view(10, 0.15), 5), Status::ok);
  EXPECT_NEAR(ros.joints().age(5), 0.15, 1e-12);
  base.waited = 0.15;
  EXPECT_EQ(put(base, 5), Status::ok);
  EXPECT_NEAR(ros.odometry().age(5), 0.15, 1e-12);
  EXPECT_TRUE(ros.healthy(5.04));
  EXPECT_FALSE(ros.healthy(5.06));
}

TEST_F(Ros1Link, OdometryHasAQuaternionOfNormOne) {
  base.orientation[3] = 1.004;
  EXPECT_EQ(put(base, 5), Status::ok);
  EXPECT_EQ(ros.odometry().value.orientation[3], 1);
  for (const double w : {0.0, 0.994, 1.006, -1.006, 1e200}) {
    base.stamp += 1;
    base.orientation[3] = w;
    EXPECT_EQ(put(base, 6), Status::not_a_rotation) << w;
  }
  for (double* number : {&base.position[1], &base.orientation[0], &base.twist[5]}) {
    for (const double bad : {nan, infinity, -infinity}) {
      link::OdometryView message = base;
      message.orientation[3] = 1;
      const std::size_t at = static_cast<std::size_t>(number - &base.position[0]);
      (&message.position[0])[at] = bad;
      EXPECT_EQ(put(message, 6), Status::non_finite);
    }
  }
  EXPECT_EQ(ros.odometry().time, 5);
  EXPECT_EQ(ros.odometry().value.twist[5], 6);
}

TEST_F(Ros1Link, ACommandNeedsAHealthyRobot) {
  const icat::Twist twist{1, 2, 3, 4, 5, 6};
  const double velocity[] = {1, 2};
  EXPECT_EQ(ros.write_twist(twist, 5), Status::stale_state);
  EXPECT_EQ(ros.write_joint_velocities(velocity, 5), Status::stale_state);
  all_is_well(5);
  EXPECT_EQ(ros.write_twist(twist, 5.1), Status::ok);
  EXPECT_EQ(fake.twist, twist);
  EXPECT_EQ(ros.write_joint_velocities(velocity, 5.1), Status::ok);
  EXPECT_EQ(fake.velocities, (std::vector<double>{1, 2}));
  const int before = fake.sent;
  EXPECT_EQ(ros.write_twist(twist, 5.3), Status::stale_state);
  EXPECT_EQ(fake.twist, icat::Twist{});
  EXPECT_EQ(ros.write_joint_velocities(velocity, 5.3), Status::stale_state);
  EXPECT_EQ(fake.velocities, (std::vector<double>{0, 0}));
  EXPECT_EQ(fake.sent, before + 2);
  all_is_well(6);
  EXPECT_EQ(ros.write_twist(twist, 6), Status::ok);
  EXPECT_EQ(fake.twist, twist);
  EXPECT_EQ(ros.write_twist(twist, nan), Status::stale_state);
  EXPECT_EQ(fake.twist, icat::Twist{});
}

TEST_F(Ros1Link, ACallersClockThatIsSetBackMakesNothingFresh) {
  all_is_well(1000);
  EXPECT_FALSE(ros.healthy(5));
  EXPECT_EQ(put(view(2001), 5), Status::ok);
  EXPECT_FALSE(ros.healthy(5));
  base.stamp = 2001;
  EXPECT_EQ(put(base, 5), Status::ok);
  EXPECT_TRUE(ros.healthy(5));
}

TEST_F(Ros1Link, ABadCommandIsZero) {
  all_is_well(5);
  EXPECT_EQ(ros.write_twist({1, nan, 0, 0, 0, 0}, 5), Status::non_finite);
  EXPECT_EQ(fake.twist, icat::Twist{});
  EXPECT_EQ(ros.write_joint_velocities(std::array{1.0, infinity}, 5), Status::non_finite);
  EXPECT_EQ(fake.velocities, (std::vector<double>{0, 0}));
  EXPECT_EQ(ros.write_joint_velocities(std::array{1.0, 2.0}, 5), Status::ok);
  EXPECT_EQ(ros.write_joint_velocities(std::array{1.0}, 5), Status::wrong_size);
  EXPECT_EQ(fake.velocities, (std::vector<double>{0, 0}));
  EXPECT_EQ(ros.write_joint_velocities(std::array{1.0, 2.0, 3.0}, 5), Status::wrong_size);
  EXPECT_EQ(ros.write_joint_velocities(std::array{1.0, 2.0}, 5), Status::ok);
  ros.stop();
  EXPECT_EQ(fake.velocities, (std::vector<double>{0, 0}));
  EXPECT_EQ(ros.receive(nan), Status::non_finite);
}

TEST_F(Ros1Link, ANodeThatWasShutDownIsNotHealthy) {
  all_is_well(5);
  fake.up = false;
  EXPECT_FALSE(ros.healthy(5));
  EXPECT_EQ(ros.write_twist({}, 5), Status::not_started);
}

TEST_F(Ros1Link, ATopicThatIsNotUsedIsNotAwaited) {
  icat::Ros1 arm({"a", "b"}, {.odometry = ""});
  const auto message = view(10);
  FakeLink::last->joints = &message;
  EXPECT_EQ(arm.receive(5), Status::ok);
  EXPECT_TRUE(arm.healthy(5));
  icat::Ros1 vehicle({"a"}, {.joint_states = ""});
  FakeLink::last->base = &base;
  EXPECT_EQ(vehicle.receive(5), Status::ok);
  EXPECT_TRUE(vehicle.healthy(5));
}

TEST_F(Ros1Link, NothingOfItAllocates) {
  const double velocity[] = {1, 2};
  long made = 0;
  for (int k = 1; k < 1000; ++k) {
    const auto joints = view(k % 7 == 0 ? 0 : 0.01 * k);
    base.stamp = 0.01 * k;
    made += count_allocations([&] {
      fake.joints = &joints;
      fake.base = &base;
      (void)ros.receive(0.01 * k);
      (void)ros.write_twist({0.1, 0, 0, 0, 0, 0}, 0.01 * k);
      (void)ros.write_joint_velocities(velocity, 0.01 * k + (k % 3));
      (void)ros.healthy(0.01 * k);
      ros.stop();
    });
  }
  EXPECT_EQ(made, 0);
}

TEST(Ros1, RefusesBadSettings) {
  EXPECT_THROW(icat::Ros1({}), std::invalid_argument);
  EXPECT_THROW(icat::Ros1({"a", "a"}), std::invalid_argument);
  for (const double bad : {0.0, -1.0, nan, infinity}) {
    EXPECT_THROW(icat::Ros1({"a"}, {.max_age = bad}), std::invalid_argument);
    EXPECT_THROW(icat::Ros1({"a"}, {.master_timeout = bad}), std::invalid_argument);
  }
  EXPECT_THROW(icat::Ros1({"a"}, {.master_timeout = 1e10}), std::invalid_argument);
  EXPECT_THROW(icat::Ros1({"a"}, {.queue = 0}), std::invalid_argument);
  EXPECT_THROW(icat::Ros1({"a"}, {.joint_states = "", .odometry = ""}), std::invalid_argument);
  FakeLink::refusal = "no master";
  try {
    icat::Ros1({"a"});
    ADD_FAILURE();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "ROS 1: no master");
  }
  FakeLink::refusal.clear();
}

}  // namespace
