// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What a robot's middleware carries, as plain data: ros1.hpp and dds.hpp fill and send these.
/// Units and frames are those of ROS: metres, radians, a base with x ahead, y to port, z up [REP
/// 103, REP 105]; `icat` has no opinion on which way z points as long as all of a program agrees.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>
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

/// A velocity of the base, [linear; angular] on the base, m/s, rad/s.
using Twist = std::array<double, 6>;

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

  /// A sample of the joint `name`, stamped `stamp` by its sender (s), which came at `now` (s).
  /// `unknown_joint`: not ours; `non_finite`; `time_reversed`: not newer than what there is, which
  /// stays. No allocation.
  Status put(std::string_view name, const JointSample& sample, double stamp, double now) noexcept {
    for (std::size_t i = 0; i < names_.size(); ++i) {
      if (names_[i] != name) continue;
      if (!std::isfinite(sample.position) || !std::isfinite(sample.velocity) ||
          !std::isfinite(sample.effort) || !std::isfinite(stamp)) {
        return Status::non_finite;
      }
      if (samples_[i].count > 0 && stamp <= stamps_[i]) return Status::time_reversed;
      stamps_[i] = stamp;
      samples_[i].put(sample, now);
      return Status::ok;
    }
    return Status::unknown_joint;
  }
  /// Forgets the stamps, not the samples: for a sender that began anew, with a clock of its own.
  void restart() noexcept {
    for (double& stamp : stamps_) stamp = -std::numeric_limits<double>::infinity();
  }

  /// How many joints.
  std::size_t size() const noexcept { return names_.size(); }
  /// Of the i-th joint.
  const std::string& name(std::size_t i) const noexcept { return names_[i]; }
  /// Of the i-th joint: the last sample, and when it came.
  const Received<JointSample>& operator[](std::size_t i) const noexcept { return samples_[i]; }
  /// Of the joint that was heard of least lately, s at `now`; infinite until all were heard of.
  double age(double now) const noexcept {
    double oldest = 0;
    for (const auto& sample : samples_) oldest = std::fmax(oldest, sample.age(now));
    return oldest;
  }

 private:
  std::vector<std::string> names_;
  std::vector<Received<JointSample>> samples_;
  std::vector<double> stamps_;
};

}  // namespace icat
