// SPDX-License-Identifier: BSD-3-Clause
// What the examples with the papers' vehicle and arm share.
#pragma once

#include <cmath>
#include <icat/core/types.hpp>
#include <icat/tpik/velocity_bounds.hpp>
#include <numbers>

namespace support {

/// The arm folded in front of the vehicle, rad.
inline icat::Vector<double, 7> folded_arm() {
  icat::Vector<double, 7> q;
  q << 0, 0.7, 0, -1.8, 0, 1.1, 0;
  return q;
}

/// Of each joint (rad/s), of the vehicle along (m/s) and about (rad/s) each axis.
inline icat::VelocityBounds<double, 13> velocity_bounds(double joint, double speed, double turn) {
  icat::Vector<double, 13> limit;
  limit.head<7>().setConstant(joint);
  limit.segment<3>(7).setConstant(speed);
  limit.tail<3>().setConstant(turn);
  return {-limit, limit};
}

/// A current of up to 0.05 m/s, period 10 s, along x of the world.
inline icat::Vector3<double> sinusoidal_current(double t) {
  return {0.05 * std::sin(2 * std::numbers::pi * t / 10), 0, 0};
}

}  // namespace support
