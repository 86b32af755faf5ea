// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Between the frames of ROS (REP 103: a world with x east, y north, z up; a base with x ahead, y
/// to port, z up) and those of marine craft (a world with x north, y east, z down; a vehicle with x
/// ahead, y to starboard, z down). Each function is its own inverse. Joints need none: an angle is
/// the same in both.
#pragma once

#include <cmath>

#include "icat/adapters/robot_messages.hpp"

namespace icat {

/// The same velocity on the other base: y and z change their sign, linear and angular. No
/// allocation.
constexpr Twist other_base(const Twist& twist) noexcept {
  return {twist[0], -twist[1], -twist[2], twist[3], -twist[4], -twist[5]};
}

/// The same pose and velocity where the world is turned over, too, half a turn about its x: for
/// odometry whose world begins where the robot does, as most does, so that its x has no direction
/// of the compass. No allocation.
constexpr Odometry other_base(const Odometry& odometry) noexcept {
  const auto& p = odometry.position;
  const auto& q = odometry.orientation;
  return {{p[0], -p[1], -p[2]}, {q[0], -q[1], -q[2], q[3]}, other_base(odometry.twist)};
}

/// The same pose and velocity between a world with x to the east and z up and one with x to the
/// north and z down, and on the other base. No allocation.
inline Odometry other_world(const Odometry& odometry) noexcept {
  const auto& p = odometry.position;
  const auto& q = odometry.orientation;
  // q_world ∘ q ∘ q_base, where q_world swaps x and y and turns z over, (√½, √½, 0, 0), and q_base
  // is half a turn about x, (1, 0, 0, 0).
  const double h = std::sqrt(0.5);
  return {{p[1], p[0], -p[2]},
          {-h * (q[0] + q[1]), h * (q[1] - q[0]), h * (q[2] - q[3]), -h * (q[2] + q[3])},
          other_base(odometry.twist)};
}

}  // namespace icat
