// SPDX-License-Identifier: BSD-3-Clause
// What the programs of this folder that have a real roscore share.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "icat/adapters/ros1.hpp"
#include "tests/hardware/ros1/roscore.hpp"
#include "tests/hardware/support/loop.hpp"

namespace hardware {

inline const std::vector<std::string> joint_names{"shoulder", "elbow", "wrist_of_the_left_arm"};

inline Roscore& roscore() {
  static Roscore core(ICAT_ROS_LOGS);
  return core;
}

inline icat::Ros1Options below(const std::string& prefix) {
  return {.joint_states = prefix + "/joint_states",
          .odometry = prefix + "/odom",
          .twist = prefix + "/cmd_vel",
          .joint_velocities = prefix + "/command"};
}

inline std::vector<std::string> robot(const std::string& mode, const std::string& prefix) {
  std::vector<std::string> command{ICAT_PEERS "/robot.py", mode, prefix};
  command.insert(command.end(), joint_names.begin(), joint_names.end());
  return command;
}

// Receives at 200 Hz until `done`; false after `seconds`.
template <class Done>
bool receive_until(icat::Ros1& ros, double seconds, Done done) {
  const double end = now() + seconds;
  while (now() < end) {
    EXPECT_EQ(ros.receive(now()), icat::Status::ok);
    if (done()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}
inline bool ready(icat::Ros1& ros, double seconds = 30) {
  return receive_until(ros, seconds, [&] {
    return ros.healthy(now()) && ros.twist_listeners() > 0 && ros.joint_listeners() > 0;
  });
}

}  // namespace hardware
