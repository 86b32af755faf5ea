// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Communication with a robot over ROS 1 (Noetic), through roscpp: joint states and odometry in,
/// twist and joint velocities out. Messages: sensor_msgs/JointState, nav_msgs/Odometry,
/// geometry_msgs/Twist, std_msgs/Float64MultiArray, the last as the group controllers of
/// ros_controllers take it.
///
/// This header is C++20 and includes nothing of roscpp, whose headers are not C++20: another source
/// of the program, compiled as C++17, includes ros1_boundary.hpp. docs/ros1.md has the lines of
/// CMake.
///
/// Frames are those of ROS (REP 103): x ahead, y to port, z up; robot_frames.hpp turns them into
/// the vehicle's of icat (y to starboard, z down) and back. The pose is that of the base in the
/// frame `header.frame_id`, the twist is on the base (`child_frame_id`), as nav_msgs/Odometry says;
/// the names of the frames are not looked at.
///
/// Threads: roscpp has three of its own, which do the input and output. `receive` runs in the
/// caller's thread and takes what they brought; the writes hand over to them. Both take locks of
/// roscpp's and allocate in roscpp (docs/ros1.md has the numbers); neither waits for a peer.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "icat/adapters/robot_messages.hpp"
#include "icat/adapters/ros1_link.hpp"
#include "icat/core/error.hpp"
#include "icat/core/received.hpp"
#include "icat/core/status.hpp"

namespace icat {

/// Names and limits of a `Ros1`. A topic whose name is empty is not used.
struct Ros1Options {
  std::string node = "icat";  ///< name of the node
  std::string master = "";    ///< http://host:port; empty: ROS_MASTER_URI, or that of ROS itself
  std::vector<std::string> arguments{};       ///< of `main`: those with := rename, as with rosrun
  std::string joint_states = "joint_states";  ///< sensor_msgs/JointState, in
  std::string odometry = "odom";              ///< nav_msgs/Odometry, in
  std::string twist = "cmd_vel";              ///< geometry_msgs/Twist, out
  /// std_msgs/Float64MultiArray, out: one entry for each joint.
  std::string joint_velocities = "joint_group_velocity_controller/command";
  /// Senders stamp their messages, and what has no stamp is refused. False: stamps are not looked
  /// at, and all that comes is new.
  bool stamped = true;
  double max_age = 0.2;    ///< s: what comes in is older, the robot is not healthy
  std::size_t queue = 64;  ///< messages of a topic between two calls of `receive`; the newest stay
  double master_timeout = 5;  ///< s, up to 3600: longest wait for each answer of the master
};

namespace detail::ros1 {

/// When a message came that waited for `receive`, which runs at `now`.
inline double arrival(double now, double waited) noexcept {
  return waited > 0 ? now - waited : now;
}

/// Gives `joints` what the message says of them. `wrong_size`: the arrays do not fit together, and
/// nothing is taken; else what the first joint of ours that was refused was refused for.
inline Status take(const JointStateView& message, JointStates& joints, double stamp,
                   double now) noexcept {
  const std::size_t n = message.name_count;
  if (message.position_count != n || (message.velocity_count != 0 && message.velocity_count != n) ||
      (message.effort_count != 0 && message.effort_count != n)) {
    return Status::wrong_size;
  }
  Status worst = Status::ok;
  for (std::size_t i = 0; i < n; ++i) {
    const Status status =
        joints.put(message.names[i],
                   {message.positions[i], message.velocity_count ? message.velocities[i] : 0.0,
                    message.effort_count ? message.efforts[i] : 0.0},
                   stamp, arrival(now, message.waited));
    if (status != Status::unknown_joint && worst == Status::ok) worst = status;
  }
  return worst;
}

/// Gives `odometry` the message, with a quaternion of norm 1 to rounding. `non_finite`,
/// `not_a_rotation`: a quaternion whose norm is not 1; `time_reversed`.
inline Status take(const OdometryView& message, Received<Odometry>& odometry, StampOrder& order,
                   double stamp, double now) noexcept {
  Odometry value;
  const auto copy = [](const auto& from, auto& to) {
    std::copy(std::begin(from), std::end(from), to.begin());
  };
  copy(message.position, value.position);
  copy(message.orientation, value.orientation);
  copy(message.twist, value.twist);
  const double came = arrival(now, message.waited);
  if (!std::isfinite(came)) return Status::non_finite;
  Status status = normalize(value);
  if (status == Status::ok) status = order.accept(stamp);
  if (status == Status::ok) odometry.put(value, came);
  return status;
}

}  // namespace detail::ros1

/// See the file comment. The caller owns loop and clock: `now` is any clock of the caller's, s.
class Ros1 final : private detail::ros1::Listener {
 public:
  /// Starts the node of this process, if it is the first (its name, master and arguments hold for
  /// all, even where no master answered it), and opens the topics. SIGINT stays the caller's;
  /// roscpp ignores SIGPIPE. The node lives until the process ends, the topics as long as this
  /// object.
  /// @param joints the robot's joints, in its order, by the names of the joint states
  /// @param options names and limits
  /// @throws std::invalid_argument on a bad list of joints, no topic at all, a number out of its
  ///   range, a name that ROS does not take, where no master answers. Allocates.
  [[gnu::cold]] explicit Ros1(std::vector<std::string> joints, Ros1Options options = {})
      : options_(std::move(options)), joints_(std::move(joints)), zeros_(joints_.size()) {
    detail::require_positive("ROS 1", "max_age", options_.max_age);
    detail::require_positive("ROS 1", "master_timeout", options_.master_timeout);
    if (options_.master_timeout > 3600) {
      detail::invalid("ROS 1: master_timeout must be at most 3600, got ", options_.master_timeout);
    }
    if (options_.queue == 0 || options_.queue > 100000) {
      detail::invalid("ROS 1: queue must be from 1 to 100000, got ", options_.queue);
    }
    if (options_.joint_states.empty() && options_.odometry.empty()) {
      detail::invalid("ROS 1: neither joint states nor odometry: the robot would not be heard of");
    }
    std::string error;
    link_ = detail::ros1::open(
        {options_.node, options_.master, options_.arguments, options_.joint_states,
         options_.odometry, options_.twist, options_.joint_velocities, joints_.size(),
         static_cast<unsigned>(options_.queue), options_.master_timeout},
        error);
    if (!link_) detail::invalid("ROS 1: ", error);
  }
  Ros1(const Ros1&) = delete;
  Ros1& operator=(const Ros1&) = delete;

  /// Takes all that came since the last call, at most `queue` messages of each topic. Never waits.
  /// `non_finite`: `now`, and nothing is taken; else `ok`, whatever came (see `refused`).
  Status receive(double now) noexcept {
    if (!std::isfinite(now)) return Status::non_finite;
    now_ = now;
    link_->receive(*this);
    return Status::ok;
  }
  /// Each joint's last sample and when it came: to roscpp, not to `receive`.
  const JointStates& joints() const noexcept { return joints_; }
  /// The last odometry and when it came. Its quaternion has norm 1 to rounding.
  const Received<Odometry>& odometry() const noexcept { return odometry_; }
  /// Messages that were not taken whole, and why the last was not: `clock_stalled`: it has no stamp
  /// (see `stamped`); `time_reversed`: doubled or late (StampOrder); `wrong_size`: arrays that do
  /// not fit together, or no positions; `non_finite`; `not_a_rotation`: a quaternion, the square of
  /// whose norm is farther than 0.01 from 1. What does not even parse, roscpp drops, and this does
  /// not count.
  const Received<Status>& refused() const noexcept { return refused_; }

  /// The node runs, and all joints and the odometry were heard of within `max_age`. Where the
  /// caller's clock was set back by more than that, nothing was until it is heard of again.
  bool healthy(double now) const noexcept {
    return link_->running() &&
           (options_.joint_states.empty() || joints_.age(now) <= options_.max_age) &&
           (options_.odometry.empty() || std::abs(odometry_.age(now)) <= options_.max_age);
  }

  /// Sends a velocity of the base, on the base, in the frame of ROS. Anything but `ok` sends zero
  /// instead: `stale_state`: not healthy; `non_finite`. `not_started`: there is no topic for it, or
  /// the node was shut down, and nothing is sent.
  Status write_twist(const Twist& twist, double now) noexcept {
    Status status = healthy(now) ? Status::ok : Status::stale_state;
    if (!finite(twist)) status = Status::non_finite;
    const Twist zero{};
    return sent(link_->send_twist((status == Status::ok ? twist : zero).data()), status);
  }
  /// Sends velocities of all joints, rad/s or m/s, in their order. Anything but `ok` sends zeros
  /// instead: `stale_state`: not healthy; `non_finite`; `wrong_size`. `not_started`: there is no
  /// topic for it, or the node was shut down, and nothing is sent.
  Status write_joint_velocities(std::span<const double> velocities, double now) noexcept {
    Status status = healthy(now) ? Status::ok : Status::stale_state;
    if (!finite(velocities)) status = Status::non_finite;
    if (velocities.size() != zeros_.size()) status = Status::wrong_size;
    return sent(
        link_->send_joint_velocities(status == Status::ok ? velocities.data() : zeros_.data()),
        status);
  }
  /// Sends zeros on both topics: before the loop ends, since a velocity controller of ROS need not
  /// have a watchdog (docs/ros1.md).
  void stop() noexcept {
    const Twist zero{};
    link_->send_twist(zero.data());
    link_->send_joint_velocities(zeros_.data());
  }
  /// How many nodes are connected to the twists: 0, nobody hears them.
  unsigned twist_listeners() const noexcept { return link_->twist_listeners(); }
  /// How many nodes are connected to the joint velocities: 0, nobody hears them.
  unsigned joint_listeners() const noexcept { return link_->joint_listeners(); }

 private:
  static bool finite(std::span<const double> values) noexcept {
    return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
  }
  static Status sent(bool done, Status status) noexcept {
    return done ? status : Status::not_started;
  }
  /// The stamp to go by; 0 where the sender had to give one and did not.
  double stamp(double of_sender) noexcept { return options_.stamped ? of_sender : ++sequence_; }
  void count(Status status) noexcept {
    if (status != Status::ok) refused_.put(status, now_);
  }

  void joint_states(const detail::ros1::JointStateView& message) noexcept override {
    const double by = stamp(message.stamp);
    count(by == 0 ? Status::clock_stalled : detail::ros1::take(message, joints_, by, now_));
  }
  void odometry(const detail::ros1::OdometryView& message) noexcept override {
    const double by = stamp(message.stamp);
    count(by == 0 ? Status::clock_stalled
                  : detail::ros1::take(message, odometry_, odometry_order_, by, now_));
  }

  Ros1Options options_;
  JointStates joints_;
  Received<Odometry> odometry_;
  StampOrder odometry_order_;
  Received<Status> refused_;
  std::vector<double> zeros_;
  double now_{0};
  double sequence_{0};
  std::unique_ptr<detail::ros1::Link> link_;
};

}  // namespace icat
