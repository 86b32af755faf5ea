// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A frame of the robot to a goal frame: tool pose, its position or orientation alone, vehicle
/// pose.
///
///     r = p_goal − p,   ϑ the rotation vector from the frame to its goal, components on ⟨0⟩
///
/// Component form [Coop, Eq. (15)]: ẋ is the frame's velocity, ẋ̄ = γ [r; ϑ], a straight line and
/// one fixed axis. Norm form [Coop, Eq. (14), Remark 1]: x₁ = ‖r‖, x₂ = ‖ϑ‖, one row each. ϑ fades
/// out before it would flip at π, see rigid_motion.hpp.
#pragma once

#include <limits>
#include <optional>

#include "icat/math/rigid_motion.hpp"
#include "icat/model/uvms.hpp"
#include "icat/task/task.hpp"

namespace icat::task {

/// Objectives of the norm form, such as `{at_most(0.2, 0.1), at_most(0.1, 0.05)}` (m, rad).
template <class Scalar>
struct PoseNorms {
  /// On ‖r‖, m.
  Objective<Scalar> position{Objective<Scalar>::equal_to(Scalar(0))};
  /// On ‖ϑ‖, rad.
  Objective<Scalar> orientation{Objective<Scalar>::equal_to(Scalar(0))};
};

/// Settings of the pose tasks.
template <class Scalar>
struct PoseTaskOptions {
  std::string name{};                                                ///< empty: the task's own
  Pose<Scalar> goal{detail::identity_pose<Scalar>()};                ///< of the frame, in ⟨0⟩
  std::optional<PoseNorms<Scalar>> norms{};                          ///< given: the norm form
  Scalar gain{1};                                                    ///< γ, 1/s
  Scalar max_linear_rate{std::numeric_limits<Scalar>::infinity()};   ///< m/s
  Scalar max_angular_rate{std::numeric_limits<Scalar>::infinity()};  ///< rad/s
};

/// What the pose tasks share. `Linear`, `Angular`: which parts of the pose are controlled.
template <VehicleManipulator R, bool Linear, bool Angular>
class PoseTask : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings.
  using Options = PoseTaskOptions<Scalar>;

  /// A goal that is not finite makes the level be refused until there is a good one.
  void set_goal(const Pose<Scalar>& goal) noexcept { options_.goal = goal; }
  /// Of the frame, in ⟨0⟩.
  const Pose<Scalar>& goal() const noexcept { return options_.goal; }

 protected:
  /// @throws std::invalid_argument on settings out of range. Allocates.
  PoseTask(const R& robot, const Options& options, const char* name)
      : Task<R>(options.name.empty() ? name : options.name,
                (Linear + Angular) * (options.norms ? 1 : 3), robot.dof()),
        options_(options) {
    this->require_gain(options.gain);
    this->require_rate("max_linear_rate", options.max_linear_rate);
    this->require_rate("max_angular_rate", options.max_angular_rate);
    if (!is_rigid(options.goal)) {
      detail::invalid("task '", this->name(), "': the goal is not finite or not a rotation");
    }
  }

  /// `frame` in ⟨0⟩ and its Jacobian, 6 × dof, components on ⟨0⟩.
  template <class J>
  void set_rows(const Pose<Scalar>& frame, const J& jacobian) noexcept {
    Index row = 0;
    if constexpr (Linear) {
      const Vector3<Scalar> goal = detail::origin(options_.goal);
      set_part(row, detail::minus(goal, detail::origin(frame)), jacobian, 0,
               options_.max_linear_rate, options_.norms ? &options_.norms->position : nullptr,
               Scalar(1), detail::norm(goal));
    }
    if constexpr (Angular) {
      const Vector3<Scalar> phi = rotation_log<Scalar>(detail::times(
          detail::rotation(options_.goal), detail::transpose(detail::rotation(frame))));
      set_part(row, phi, jacobian, 3, options_.max_angular_rate,
               options_.norms ? &options_.norms->orientation : nullptr,
               half_turn_weight(detail::norm(phi)), Scalar(1));
    }
  }

 private:
  /// `error` is driven by the three rows of `jacobian` from `part` on.
  template <class J>
  void set_part(Index& row, const Vector3<Scalar>& error, const J& jacobian, Index part,
                Scalar max_rate, const Objective<Scalar>* objective, Scalar fade,
                Scalar magnitude) noexcept {
    const Index dof = jacobian.cols();
    if (!objective) {
      this->set_error(row, error, options_.gain, max_rate);
      for (Index i = 0; i < 3; ++i, ++row) {
        for (Index j = 0; j < dof; ++j) this->jacobian_(row, j) = jacobian(part + i, j);
        this->reference_(row) *= fade;
      }
      return;
    }
    const Scalar distance = detail::norm(error);
    // The mean of both sides of the kinks, at distance 0 (as far as rounding can tell) and at π.
    const Scalar rounding = Scalar(8) * std::numeric_limits<Scalar>::epsilon() * magnitude;
    const bool smooth = distance > rounding && fade > Scalar(0);
    const Vector3<Scalar> direction =
        detail::scaled(error, smooth ? Scalar(-1) / distance : Scalar(0));
    for (Index j = 0; j < dof; ++j) {
      this->jacobian_(row, j) = detail::dot(direction, detail::column3(jacobian, part, j));
    }
    this->set_scalar(row, distance, *objective, options_.gain, max_rate);
    this->activation_(row) *= fade;
    ++row;
  }

  Options options_;
};

/// Tool frame to its goal [Coop, Eq. (15)].
template <VehicleManipulator R>
class ToolPose : public PoseTask<R, true, true> {
 public:
  /// @throws std::invalid_argument on settings out of range. Allocates.
  ToolPose(const R& robot, const PoseTaskOptions<typename R::Scalar>& options)
      : PoseTask<R, true, true>(robot, options, "tool pose") {}

 private:
  void compute(const R& robot) noexcept override {
    this->set_rows(robot.tool(), robot.tool_jacobian(Frame::world));
  }
};

/// End-effector linear position control [MARIS, III-B7]; the goal's orientation does not matter.
template <VehicleManipulator R>
class ToolPosition : public PoseTask<R, true, false> {
 public:
  /// @throws std::invalid_argument on settings out of range. Allocates.
  ToolPosition(const R& robot, const PoseTaskOptions<typename R::Scalar>& options)
      : PoseTask<R, true, false>(robot, options, "tool position") {}

 private:
  void compute(const R& robot) noexcept override {
    this->set_rows(robot.tool(), robot.tool_jacobian(Frame::world));
  }
};

/// End-effector angular position control [MARIS, III-B7]; the goal's position does not matter.
template <VehicleManipulator R>
class ToolOrientation : public PoseTask<R, false, true> {
 public:
  /// @throws std::invalid_argument on settings out of range. Allocates.
  ToolOrientation(const R& robot, const PoseTaskOptions<typename R::Scalar>& options)
      : PoseTask<R, false, true>(robot, options, "tool orientation") {}

 private:
  void compute(const R& robot) noexcept override {
    this->set_rows(robot.tool(), robot.tool_jacobian(Frame::world));
  }
};

/// Vehicle frame to its goal [Coop, Eq. (14)].
template <VehicleManipulator R>
class VehiclePose : public PoseTask<R, true, true> {
 public:
  /// @throws std::invalid_argument on settings out of range. Allocates.
  VehiclePose(const R& robot, const PoseTaskOptions<typename R::Scalar>& options)
      : PoseTask<R, true, true>(robot, options, "vehicle pose"),
        jacobian_world_(detail::zeros<Jacobian6>(6, robot.dof())) {}

 private:
  using Jacobian6 = Eigen::Matrix<typename R::Scalar, 6, R::size>;

  void compute(const R& robot) noexcept override {
    const auto rotation = detail::rotation(robot.vehicle());
    for (Index j = 0; j < 3; ++j) {
      detail::set_column3(jacobian_world_, 0, robot.arm_dof() + j, detail::column3(rotation, 0, j));
      detail::set_column3(jacobian_world_, 3, robot.arm_dof() + 3 + j,
                          detail::column3(rotation, 0, j));
    }
    this->set_rows(robot.vehicle(), jacobian_world_);
  }

  Jacobian6 jacobian_world_;
};

}  // namespace icat::task
