// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A tool velocity that comes from elsewhere: agreed on with another robot [Coop, IV-C], or from an
/// operator's joystick.
#pragma once

#include "icat/model/uvms.hpp"
#include "icat/task/task.hpp"

namespace icat::task {

/// ẋ_t = J_t ẏ with components on ⟨t⟩, all six to a given velocity.
template <VehicleManipulator R>
class ToolVelocity : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;

  /// Starts with velocity 0. Allocates.
  explicit ToolVelocity(const R& robot, std::string name = "tool velocity")
      : Task<R>(std::move(name), 6, robot.dof()) {}
  /// [linear; angular], components on ⟨t⟩, m/s, rad/s. One that is not finite makes the level be
  /// refused.
  void set_velocity(const Vector6<Scalar>& velocity) noexcept { this->reference_ = velocity; }

 private:
  void compute(const R& robot) noexcept override {
    this->jacobian_ = robot.tool_jacobian(Frame::tool);
  }
};

}  // namespace icat::task
