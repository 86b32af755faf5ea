// SPDX-License-Identifier: BSD-3-Clause
// The control loop through ros1.hpp, timed, with a robot on rospy, and what roscpp alone costs.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <thread>

#include "tests/hardware/ros1/bare_roscpp.hpp"
#include "tests/hardware/ros1/ros1_test.hpp"

long bare::allocations_so_far() { return allocations; }

namespace {

using hardware::below;
using hardware::joint_names;
using hardware::now;
using hardware::Process;
using hardware::ready;
using hardware::robot;
using hardware::roscore;
using icat::Ros1;
using icat::Ros1Options;
using icat::Status;

// From the call that sends a command to the `receive` that finds it in the joint states. Between
// two cycles the loop looks every 0.1 ms, so that its own period does not count.
struct Measured {
  hardware::Latencies latencies{20000};
  long allocations_made{0};
  double twists{0}, velocities{0}, joint_states{0}, odometries{0};
};

template <class Ros>
void measure(Ros& ros, double rate, double seconds, Measured& measured) {
  std::vector<double> sent_at(static_cast<std::size_t>(rate * seconds) + 2);
  std::size_t k = 0, seen = 0;
  const auto look = [&] {
    const double time = now();
    (void)ros.receive(time);
    const auto index = static_cast<std::size_t>(std::lround(ros.joints()[0].value.velocity * 1e3));
    if (index > seen && index <= k) {
      measured.latencies.add(time - sent_at[index]);
      seen = index;
    }
  };
  const auto joints_before = ros.joints()[0].count, odometries_before = ros.odometry().count;
  measured.allocations_made = hardware::run_loop(rate, seconds, [&](double time) {
    look();
    const double v = 1e-3 * static_cast<double>(++k);
    sent_at[k] = time;
    EXPECT_EQ(ros.write_joint_velocities(std::array{v, v, v}, time), Status::ok);
    EXPECT_EQ(ros.write_twist({v, v, v, v, v, v}, time), Status::ok);
    while (now() < time + 0.8 / rate) {
      std::this_thread::sleep_for(std::chrono::microseconds(100));
      look();
    }
  });
  measured.twists = measured.velocities = static_cast<double>(k);
  measured.joint_states = ros.joints()[0].count - joints_before;
  measured.odometries = ros.odometry().count - odometries_before;
}

TEST(Ros1Loop, LatencyAndAllocations) {
  const double rate = 200, seconds = hardware::loop_seconds();
  ASSERT_TRUE(roscore().start());
  Process peer(robot("echo", "/loop"));
  ASSERT_TRUE(peer.wait_for("ready", 30));
  { Ros1 starts_the_node(joint_names, below("/nobody")); }
  const bare::Costs costs = bare::costs("/loop", joint_names.size(), 300);
  Ros1Options options = below("/loop");
  options.max_age = 1;
  Ros1 ros(joint_names, options);
  ASSERT_TRUE(ready(ros));
  Measured m;
  measure(ros, rate, seconds, m);
  const double of_roscpp = costs.twist * m.twists + costs.joint_velocities * m.velocities +
                           costs.joint_states * m.joint_states + costs.odometry * m.odometries;
  std::printf(
      "roscpp alone allocates: twist %.2f, joint velocities %.2f, joint states %.2f, "
      "odometry %.2f; in this loop %.0f, counted %ld\n",
      costs.twist, costs.joint_velocities, costs.joint_states, costs.odometry, of_roscpp,
      m.allocations_made);
  // test_ros1_link counts ours without roscpp, exactly. Here one of ours for each cycle or message
  // would be at least `rate` a second; roscpp's deques make its own share uneven by less.
  const long ours = m.allocations_made - std::lround(of_roscpp);
  m.latencies.print("ROS 1, rospy", rate, seconds, std::max(0L, ours));
  EXPECT_LT(static_cast<double>(ours), 0.1 * rate * seconds);
  // An answer that comes with the next one in one `receive` is not seen by itself.
  EXPECT_GT(static_cast<double>(m.latencies.size()), 0.5 * rate * seconds);
}

// The same where the robot does not ask for TCP_NODELAY, as no controller of ros_controllers does.
TEST(Ros1Loop, WithoutNodelay) {
  const double rate = 200, seconds = std::min(3.0, hardware::loop_seconds());
  ASSERT_TRUE(roscore().start());
  Process peer(robot("nagle", "/nagle"));
  Ros1Options options = below("/nagle");
  options.max_age = 1;
  Ros1 ros(joint_names, options);
  ASSERT_TRUE(ready(ros));
  Measured m;
  measure(ros, rate, seconds, m);
  std::printf(
      "ROS 1, rospy without TCP_NODELAY: latency p50 %.2f ms, p99 %.2f ms, max %.2f ms; "
      "commands seen in the answers: %zu of %.0f\n",
      1e3 * m.latencies.quantile(0.5), 1e3 * m.latencies.quantile(0.99),
      1e3 * m.latencies.quantile(1), m.latencies.size(), rate * seconds);
  // Where Nagle's algorithm waits for a delayed acknowledgement, the half of all is 40 ms late.
  EXPECT_LT(m.latencies.quantile(0.5), 0.02);
}

}  // namespace
