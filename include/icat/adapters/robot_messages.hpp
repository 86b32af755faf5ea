// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What a robot's middleware carries, as plain data: ros1.hpp and dds.hpp fill and send these.
/// Units and frames are those of ROS: metres, radians, a base with x ahead, y to port, z up [REP
/// 103, REP 105]; `icat` works with either direction of z, if the whole program uses the same.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "icat/core/error.hpp"
#include "icat/core/received.hpp"
#include "icat/core/status.hpp"

namespace icat {

/// What is measured of a joint.
struct JointSample {
  double position{0};  ///< rad or m
  double velocity{0};  ///< rad/s or m/s; 0 where the sender says none
  double effort{0};    ///< N m or N; 0 where the sender says none
};

/// Pose and velocity of a base.
struct Odometry {
  std::array<double, 3> position{};               ///< of the base in the frame of the odometry, m
  std::array<double, 4> orientation{0, 0, 0, 1};  ///< x, y, z, w, of norm 1
  std::array<double, 6> twist{};                  ///< [linear; angular] on the base, m/s, rad/s
};

/// Whether `odometry` is finite and its orientation one: `non_finite`, `not_a_rotation`. The square
/// of a quaternion's norm may be 0.01 away from 1, as tf2 has it; it is brought to the norm 1.
/// Where it is refused `odometry` stays. No allocation.
inline Status normalize(Odometry& odometry) noexcept {
  double sum = 0, square = 0;  // 0 · x is no number where x is none, or infinite
  for (const double x : odometry.position) sum += 0 * x;
  for (const double x : odometry.twist) sum += 0 * x;
  for (const double x : odometry.orientation) sum += 0 * x;
  if (!std::isfinite(sum)) return Status::non_finite;
  for (const double x : odometry.orientation) square += x * x;
  if (!(std::abs(square - 1) <= 0.01)) return Status::not_a_rotation;
  const double norm = std::sqrt(square);
  for (double& x : odometry.orientation) x /= norm;
  return Status::ok;
}

/// A velocity of the base, [linear; angular] on the base, m/s, rad/s.
using Twist = std::array<double, 6>;

/// The order of one sender's stamps. A message that is not newer than the last accepted one is
/// doubled or late, and dropped. A stamp that is older by more than `set_back` comes from a clock
/// that was set back, or from a restarted sender, if a second, newer one confirms it: after one
/// stamp that is too far ahead one message is lost, not all that follow. (After a smaller error the
/// stamps are newer again within `set_back`.) Copies, no allocation.
class StampOrder {
 public:
  /// s: farther than this a message does not fall behind another on its way.
  static constexpr double set_back = 1;

  /// `ok`: newer, and from now on the last. `non_finite`, `time_reversed`: to be dropped.
  Status accept(double stamp) noexcept {
    if (!std::isfinite(stamp)) return Status::non_finite;
    const bool newer = stamp > last_;
    const bool behind = stamp < last_ - set_back;
    if (newer || (behind && stamp > suspect_)) {
      last_ = stamp;
      suspect_ = std::numeric_limits<double>::infinity();
      return Status::ok;
    }
    if (behind) suspect_ = stamp;
    return Status::time_reversed;
  }
  /// Takes whatever comes next.
  void restart() noexcept { *this = StampOrder(); }

 private:
  double last_{-std::numeric_limits<double>::infinity()};
  double suspect_{std::numeric_limits<double>::infinity()};  // far behind, not confirmed
};

/// The joints of a robot, each with its last sample and the stamp of its sender. A message may hold
/// any of them in any order, among others that are not ours.
class JointStates {
 public:
  /// @param names the robot's joints, in its order. Allocates.
  /// @throws std::invalid_argument on an empty list, an empty name, or the same name twice.
  [[gnu::cold]] explicit JointStates(std::vector<std::string> names)
      : names_(std::move(names)), samples_(names_.size()), stamps_(names_.size()) {
    if (names_.empty()) detail::invalid("joint states: no joint");
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (names_[i].empty()) detail::invalid("joint states: joint ", i, " has no name");
      for (std::size_t k = 0; k < i; ++k) {
        if (names_[k] == names_[i]) detail::invalid("joint states: two joints '", names_[i], "'");
      }
    }
  }

  /// A sample of the joint `name`, stamped `stamp` by its sender (s), which came at `now` (s). A
  /// velocity or effort of NaN says that the sender has none (joint_state_broadcaster of ROS 2 does
  /// so), and counts as 0. What is refused leaves the sample that there is: `unknown_joint`: not
  /// ours; `non_finite`: the position, `stamp` or `now`, or an infinite velocity or effort;
  /// `time_reversed`: doubled or late, see StampOrder. No allocation.
  Status put(std::string_view name, JointSample sample, double stamp, double now) noexcept {
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (names_[i] != name) continue;
      if (std::isnan(sample.velocity)) sample.velocity = 0;
      if (std::isnan(sample.effort)) sample.effort = 0;
      if (!std::isfinite(sample.position) || !std::isfinite(sample.velocity) ||
          !std::isfinite(sample.effort) || !std::isfinite(now)) {
        return Status::non_finite;
      }
      const Status status = stamps_[i].accept(stamp);
      if (status == Status::ok) samples_[i].put(sample, now);
      return status;
    }
    return Status::unknown_joint;
  }
  /// Forgets the stamps, not the samples: for a sender that is known to have begun anew, with a
  /// clock of its own. Without it StampOrder costs one sample of each joint.
  void restart() noexcept {
    for (StampOrder& stamp : stamps_) stamp.restart();
  }

  /// How many joints.
  std::size_t size() const noexcept { return names_.size(); }
  /// Of the i-th joint.
  const std::string& name(std::size_t i) const noexcept { return names_[i]; }
  /// Of the i-th joint: the last sample, and when it came.
  const Received<JointSample>& operator[](std::size_t i) const noexcept { return samples_[i]; }
  /// Of the joint that was heard of least lately, s at `now`; infinite until all were heard of, and
  /// where `now` is NaN. A sample from after `now` is as old as it is early: where the caller's
  /// clock was set back, nothing looks fresh for it.
  double age(double now) const noexcept {
    double oldest = 0;
    for (const auto& sample : samples_) {
      const double age = std::abs(sample.age(now));
      if (std::isnan(age)) return std::numeric_limits<double>::infinity();
      if (age > oldest) oldest = age;
    }
    return oldest;
  }

 private:
  std::vector<std::string> names_;
  std::vector<Received<JointSample>> samples_;
  std::vector<StampOrder> stamps_;
};

}  // namespace icat
