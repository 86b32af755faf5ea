// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Tasks of the vehicle alone: horizontal attitude, distance to another vehicle, motion minimality,
/// velocity of what is not actuated. Its pose is in pose_tasks.hpp.
#pragma once

#include <array>
#include <limits>
#include <optional>

#include "icat/math/rigid_motion.hpp"
#include "icat/task/task.hpp"

namespace icat::task {

/// The vehicle's z axis along the world's [Coop, Eq. (13)]: an objective on the angle ‖φ‖ between
/// them where `norm` is given; without, φ component by component to zero.
template <VehicleManipulator R>
class HorizontalAttitude : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    /// What errors and logs call it.
    std::string name = "horizontal attitude";
    std::optional<Objective<Scalar>> norm{};  ///< rad
    /// γ, 1/s, > 0.
    Scalar gain{1};
    Scalar max_rate{std::numeric_limits<Scalar>::infinity()};  ///< rad/s
  };

  /// @throws std::invalid_argument on settings out of range. Allocates.
  explicit HorizontalAttitude(const R& robot) : HorizontalAttitude(robot, Options{}) {}
  /// @throws std::invalid_argument on settings out of range. Allocates.
  HorizontalAttitude(const R& robot, Options options)
      : Task<R>(options.name, options.norm ? 1 : 2, robot.dof()), options_(options) {
    this->require_gain(options.gain);
    this->require_rate("max_rate", options.max_rate);
  }

 private:
  void compute(const R& robot) noexcept override {
    const Vector3<Scalar> k = detail::row3(robot.vehicle().matrix(), 2, 0);  // z of ⟨0⟩ on ⟨v⟩
    const Misalignment<Scalar> m = misalignment_from_z<Scalar>(k);
    const Matrix3<Scalar> k_w = skew(k);  // k̇ = k × ω
    for (Index row = 0; row < this->rows(); ++row) {
      const Vector3<Scalar> g = options_.norm ? detail::row3(m.angle_gradient, 0, 0)
                                              : detail::row3(m.vector_gradient, row, 0);
      detail::set_row3(this->jacobian_, row, robot.arm_dof() + 3, detail::transposed_times(k_w, g));
    }
    if (options_.norm) {
      this->set_scalar(0, m.angle, *options_.norm, options_.gain, options_.max_rate);
      // Upside down the gradient flips; the row fades out before it does.
      this->activation_(0) *= half_turn_weight(m.angle);
    } else {
      this->set_error(0, Vector<Scalar, 2>(-m.vector(0), -m.vector(1)), options_.gain,
                      options_.max_rate);
    }
  }

  Options options_;
};

/// ‖d‖ ≥ d_m, d from this vehicle to another [Coop, Eq. (16)]. The other's position is the caller's
/// to keep up to date; its velocity is not compensated.
template <VehicleManipulator R>
class VehicleDistance : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    /// What errors and logs call it.
    std::string name = "vehicle distance";
    /// @cond
    static constexpr Scalar unset = std::numeric_limits<Scalar>::quiet_NaN();
    /// @endcond
    Vector3<Scalar> other{unset, unset,
                          unset};  ///< origin of the other vehicle's frame, components on ⟨0⟩, m
    Scalar minimum;                ///< d_m, m
    Scalar margin;                 ///< m
    /// γ, 1/s, > 0.
    Scalar gain{1};
    Scalar max_rate{std::numeric_limits<Scalar>::infinity()};  ///< m/s
  };

  /// @throws std::invalid_argument on settings out of range. Allocates.
  VehicleDistance(const R& robot, Options options)
      : Task<R>(options.name, 1, robot.dof()),
        options_(options),
        objective_(Objective<Scalar>::at_least(options.minimum, options.margin)) {
    this->require_gain(options.gain);
    this->require_rate("max_rate", options.max_rate);
    this->require_above_zero("minimum", options.minimum);
    if (!detail::all_finite(options.other)) {
      detail::invalid("task '", options.name, "': the other vehicle's position is not finite");
    }
  }
  /// New position of the other vehicle, components on ⟨0⟩, m.
  void set_other(const Vector3<Scalar>& position) noexcept { options_.other = position; }

 private:
  void compute(const R& robot) noexcept override {
    const Vector3<Scalar> d = detail::minus(options_.other, detail::origin(robot.vehicle()));
    const Scalar distance = detail::norm(d);
    const Scalar factor = distance > Scalar(0) ? Scalar(-1) / distance : Scalar(0);
    detail::set_row3(
        this->jacobian_, 0, robot.arm_dof(),
        detail::scaled(detail::transposed_times(detail::rotation(robot.vehicle()), d), factor));
    this->set_scalar(0, distance, objective_, options_.gain, options_.max_rate);
    // Where the two coincide the gradient flips; the row fades out before it does.
    this->activation_(0) *= smooth_step(Scalar(10) * distance / options_.minimum);
  }

  Options options_;
  Objective<Scalar> objective_;
};

/// v = 0 [Coop, III-D]: leaves the work to the arm. Goes to the bottom of the hierarchy.
template <VehicleManipulator R>
class VehicleMotionMinimality : public Task<R> {
 public:
  /// @throws std::invalid_argument on settings out of range. Allocates.
  explicit VehicleMotionMinimality(const R& robot, std::string name = "vehicle motion minimality")
      : Task<R>(std::move(name), 6, robot.dof()) {
    this->select_columns(robot.arm_dof());
  }

 private:
  void compute(const R&) noexcept override {}
};

/// The measured velocity of the components that are not actuated [MARIS, III-B8]. Goes to the top
/// of the hierarchy; an alternative to `Tpik::reset(rho0, Q0)`.
template <VehicleManipulator R>
class NonActuatedVelocity : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// `actuated`: which of surge, sway, heave, roll, pitch, yaw the vehicle can command.
  NonActuatedVelocity(const R& robot, const std::array<bool, 6>& actuated,
                      std::string name = "non-actuated velocity")
      : Task<R>(std::move(name), 6, robot.dof()) {
    this->select_columns(robot.arm_dof());
    for (std::size_t i = 0; i < 6; ++i) {
      this->activation_(static_cast<Index>(i)) = actuated[i] ? Scalar(0) : Scalar(1);
    }
  }
  /// v measured, components on ⟨v⟩.
  void set_measured(const Vector6<Scalar>& velocity) noexcept { this->reference_ = velocity; }

 private:
  void compute(const R&) noexcept override {}
};

}  // namespace icat::task
