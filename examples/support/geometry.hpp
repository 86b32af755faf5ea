// SPDX-License-Identifier: BSD-3-Clause
// Poses as people write them, and how far two are apart.
#pragma once

#include <algorithm>
#include <cmath>
#include <icat/math/rigid_motion.hpp>
#include <limits>

namespace support {

/// Turned by yaw about z, then pitch about the new y, then roll about the newest x (rad).
inline icat::Pose<double> pose(const icat::Vector3<double>& position, double roll, double pitch,
                               double yaw) {
  using Vector3 = icat::Vector3<double>;
  using Matrix3 = icat::Matrix3<double>;
  const Matrix3 turn = icat::axis_rotation<double>(Vector3(0, 0, 1), yaw) *
                       Matrix3(icat::axis_rotation<double>(Vector3(0, 1, 0), pitch) *
                               icat::axis_rotation<double>(Vector3(1, 0, 0), roll));
  icat::Pose<double> p;
  p.linear() = turn;
  p.translation() = position;
  p.makeAffine();
  return p;
}

/// ⟨g⟩ of a gripper that comes from above along z, turned half round against `p`.
inline icat::Pose<double> turned_half(icat::Pose<double> p) {
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 3; ++i) p.matrix()(i, j) *= -1;
  }
  return p;
}

/// m, rad.
struct Distance {
  double position, orientation;
};
inline Distance distance(const icat::Pose<double>& a, const icat::Pose<double>& b) {
  const icat::Matrix3<double> Ra = a.linear(), Rb = b.linear(), turn = Ra * Rb.transpose();
  const icat::Vector3<double> pa = a.translation(), pb = b.translation();
  return {(pa - pb).norm(), icat::rotation_log<double>(turn).norm()};
}

/// Of the direction to `point` from the z axis of ⟨c⟩ (`frame`), rad.
inline double angle_from_z(const icat::Pose<double>& frame, const icat::Vector3<double>& point) {
  const icat::Matrix3<double> R = frame.linear();
  const icat::Vector3<double> p = frame.translation(), d = point - p, z = R.col(2);
  return std::acos(std::clamp(z.dot(d) / d.norm(), -1.0, 1.0));
}

/// The smallest distance of a joint from a limit, rad or m.
template <class Robot>
double joint_margin(const Robot& robot) {
  double margin = std::numeric_limits<double>::infinity();
  icat::Index i = 0;
  for (const auto& joint : robot.joints()) {
    const double q = robot.position(i++);
    margin = std::min({margin, q - joint.lower, joint.upper - q});
  }
  return margin;
}

/// Velocity of `frame` under ẏ, components on itself.
template <class Robot, class Velocity>
icat::Vector6<double> twist(const Robot& robot, icat::FrameId frame, const Velocity& velocity) {
  const icat::Vector6<double> world = robot.jacobian(frame) * velocity;
  const icat::Matrix3<double> back = robot.pose(frame).linear().transpose();
  icat::Vector6<double> own;
  own << back * world.head<3>(), back * world.tail<3>();
  return own;
}

}  // namespace support
