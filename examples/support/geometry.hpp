// SPDX-License-Identifier: BSD-3-Clause
// Poses from positions and angles, and the distance of two poses.
#pragma once

#include <algorithm>
#include <cmath>
#include <icat/math/rigid_motion.hpp>
#include <icat/model/robot.hpp>
#include <limits>

namespace support {

/// Turned by yaw about z, then pitch about the new y, then roll about the newest x (rad).
icat::Pose<double> pose(const icat::Vector3<double>& position, double roll, double pitch,
                        double yaw);
/// `p` moved by `by`, on its own axes (m).
icat::Pose<double> moved(const icat::Pose<double>& p, const icat::Vector3<double>& by);
/// ⟨g⟩ of a gripper that comes from above along z, turned half round against `p`.
icat::Pose<double> turned_half(icat::Pose<double> p);

/// m, rad.
struct Distance {
  double position, orientation;
};
Distance distance(const icat::Pose<double>& a, const icat::Pose<double>& b);

/// Of the direction to `point` from the z axis of ⟨c⟩ (`frame`), rad.
double angle_from_z(const icat::Pose<double>& frame, const icat::Vector3<double>& point);

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
