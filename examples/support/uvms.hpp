// SPDX-License-Identifier: BSD-3-Clause
// What the examples with the papers' vehicle and arm share.
#pragma once

#include <array>
#include <cmath>
#include <icat/core/pose.hpp>
#include <icat/model/robot.hpp>
#include <icat/tpik/velocity_bounds.hpp>
#include <numbers>
#include <string>

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

/// Joints, end-effector and `tip` of the arm in the world, from the mount on.
template <class Robot>
std::array<icat::Vector3<double>, 9> arm_points(const Robot& robot, icat::FrameId tip) {
  std::array<icat::Vector3<double>, 9> points;
  for (std::size_t j = 0; j < 7; ++j) {
    points[j] = robot.pose(robot.frame("link" + std::to_string(j + 1))).translation();
  }
  points[7] = robot.pose(robot.frame("end_effector")).translation();
  points[8] = robot.pose(tip).translation();
  return points;
}

/// The hull in the world, a box of 1.0 × 0.6 × 0.73 m, drawn in one stroke.
inline std::array<icat::Vector3<double>, 16> hull_points(const icat::Pose<double>& vehicle) {
  const double x = 0.5, y = 0.3, top = -0.3, bottom = 0.43;
  std::array<icat::Vector3<double>, 16> points{{{x, y, top},
                                                {-x, y, top},
                                                {-x, -y, top},
                                                {x, -y, top},
                                                {x, y, top},
                                                {x, y, bottom},
                                                {-x, y, bottom},
                                                {-x, y, top},
                                                {-x, y, bottom},
                                                {-x, -y, bottom},
                                                {-x, -y, top},
                                                {-x, -y, bottom},
                                                {x, -y, bottom},
                                                {x, -y, top},
                                                {x, -y, bottom},
                                                {x, y, bottom}}};
  for (auto& p : points) p = vehicle * p;
  return points;
}

}  // namespace support
