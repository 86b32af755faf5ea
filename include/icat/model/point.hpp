// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A point that moves rigidly with a frame ⟨f⟩ of a robot, chosen while the robot works: an end of
/// a tool, a contact, what a sensor just saw. `point` is r, in ⟨f⟩:
///
///     p = p_f + R_f r,   J_p = J_lin − [R_f r]× J_ang
#pragma once

#include "icat/core/status.hpp"
#include "icat/math/spatial_algebra.hpp"
#include "icat/model/robot.hpp"

namespace icat {

/// Where the point `point` of `frame` (m, components on it) is in ⟨0⟩, m, at the robot's last
/// `update`. No allocation.
template <FramedRobot R>
Vector3<typename R::Scalar> point_position(const R& robot, FrameId frame,
                                           const Vector3<typename R::Scalar>& point) noexcept {
  return detail::transform(Pose<typename R::Scalar>(robot.pose(frame)), point);
}

/// Fills `J`, 3 × n, any Eigen matrix, map or block: ṗ = J ẏ for the point `point` of `frame` (m,
/// components on it), components on ⟨0⟩. Another size: refused, J stays. No allocation.
template <FramedRobot R, class M>
Status point_jacobian(const R& robot, FrameId frame, const Vector3<typename R::Scalar>& point,
                      M&& J) noexcept {
  if (J.rows() != 3 || J.cols() != robot.dof()) return Status::wrong_size;
  const auto& of_frame = robot.jacobian(frame);
  const Vector3<typename R::Scalar> r =
      detail::times(detail::rotation(Pose<typename R::Scalar>(robot.pose(frame))), point);
  for (Index j = 0; j < J.cols(); ++j) {
    detail::set_column3(J, 0, j, detail::velocity_at(of_frame, j, r));
  }
  return Status::ok;
}

}  // namespace icat
