// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A frame of a robot as seen from ⟨0⟩ or from another of its frames ⟨r⟩, which moves too:
///
///     p = R_rᵀ (p_f − p_r),   v = R_rᵀ (v_f − v_r − ω_r × (p_f − p_r)),   ω = R_rᵀ (ω_f − ω_r)
#pragma once

#include <algorithm>
#include <optional>

#include "icat/math/spatial_algebra.hpp"
#include "icat/task/axes.hpp"
#include "icat/task/task.hpp"

namespace icat::detail {

/// See the file comment.
template <FramedRobot R>
class RelativeFrame {
 public:
  using Scalar = typename R::Scalar;
  using Jacobian = Eigen::Matrix<Scalar, 6, R::size>;

  /// Allocates for robots of a size known at run time only; nothing else does.
  /// @throws std::invalid_argument with the `task`'s name where a frame is its own reference, or
  ///         another robot's.
  [[gnu::cold]] RelativeFrame(const R& robot, FrameId frame, std::optional<FrameId> reference,
                              const std::string& task)
      : frame_(frame), reference_(reference), jacobian_(zeros<Jacobian>(6, robot.dof())) {
    check_frame(robot, frame, task);
    if (reference) check_frame(robot, *reference, task);
    if (reference && *reference == frame) {
      invalid("task '", task, "': a frame cannot be relative to itself");
    }
  }

  /// Reads the robot's present state.
  void update(const R& robot) noexcept {
    const auto& J = robot.jacobian(frame_);
    pose_ = robot.pose(frame_);
    if (!reference_) {
      std::copy_n(J.data(), J.size(), jacobian_.data());
      return;
    }
    const Pose<Scalar> from = robot.pose(*reference_);
    const auto& K = robot.jacobian(*reference_);
    const Matrix3<Scalar> back = transpose(rotation(from));
    const Vector3<Scalar> r = minus(origin(pose_), origin(from));
    for (Index j = 0; j < J.cols(); ++j) {
      set_column3(jacobian_, 0, j, times(back, minus(column3(J, 0, j), velocity_at(K, j, r))));
      set_column3(jacobian_, 3, j, times(back, minus(column3(J, 3, j), column3(K, 3, j))));
    }
    pose_ = make_pose(times(back, rotation(pose_)), times(back, r));
  }
  FrameId frame() const noexcept { return frame_; }
  /// Seen from ⟨0⟩.
  bool absolute() const noexcept { return !reference_; }
  /// Of the frame in the reference.
  const Pose<Scalar>& pose() const noexcept { return pose_; }
  /// 6 × n, at the frame's origin, components on the reference.
  const Jacobian& jacobian() const noexcept { return jacobian_; }

 private:
  FrameId frame_;
  std::optional<FrameId> reference_;
  Pose<Scalar> pose_ = IdentityPose{};
  Jacobian jacobian_;
};

}  // namespace icat::detail
