// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Tasks of the camera fixed to the vehicle: keep the target in view, keep the elbow out of it.
///
/// With p the position of a point in the camera frame ⟨c⟩ and d = p/‖p‖, the misalignment of d from
/// the optical axis (z of ⟨c⟩) is the angle θ, or the vector ξ = θ n, see rigid_motion.hpp.
#pragma once

#include <algorithm>
#include <limits>
#include <optional>

#include "icat/math/rigid_motion.hpp"
#include "icat/task/task.hpp"

namespace icat::task {

/// The target roughly on the optical axis [Coop, Eq. (12)]: an objective on ‖ξ‖ where `norm` is
/// given, such as `at_most(0.3, 0.1)` rad; without, ξ component by component to zero.
template <VehicleManipulator R>
class CameraCentering : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    /// What errors and logs call it.
    std::string name = "camera centering";
    Vector3<Scalar> target{Scalar(0), Scalar(0), Scalar(0)};  ///< components on ⟨0⟩, m
    /// Given: the norm form with this objective. Not given: the component form.
    std::optional<Objective<Scalar>> norm{};
    /// γ, 1/s, > 0.
    Scalar gain{1};
    Scalar max_rate{std::numeric_limits<Scalar>::infinity()};  ///< rad/s
  };

  /// @throws std::invalid_argument on settings out of range. Allocates.
  CameraCentering(const R& robot, Options options)
      : Task<R>(options.name, options.norm ? 1 : 2, robot.dof()), options_(options) {
    this->require_gain(options.gain);
    this->require_rate("max_rate", options.max_rate);
    if (!detail::all_finite(options.target)) {
      detail::invalid("task '", options.name, "': the target is not finite");
    }
  }
  /// New target, components on ⟨0⟩, m.
  void set_target(const Vector3<Scalar>& target) noexcept { options_.target = target; }

 private:
  void compute(const R& robot) noexcept override {
    const Pose<Scalar>& v_c = robot.description().camera;
    const Matrix3<Scalar> c_R_v = detail::transpose(detail::rotation(v_c));
    // The target's position on ⟨v⟩ and on ⟨c⟩.
    const Vector3<Scalar> p_v =
        detail::transposed_times(detail::rotation(robot.vehicle()),
                                 detail::minus(options_.target, detail::origin(robot.vehicle())));
    const Vector3<Scalar> p = detail::times(c_R_v, detail::minus(p_v, detail::origin(v_c)));
    const Scalar range = detail::norm(p);
    if (!(range > Scalar(0))) {  // In the lens: no direction, no task.
      this->deactivate();
      return;
    }
    const Vector3<Scalar> d = detail::scaled(p, Scalar(1) / range);
    const Misalignment<Scalar> m = misalignment_from_z<Scalar>(d);
    // ṗ_v = −v₁ − ω × p_v for a target at rest, components on ⟨v⟩.
    const Matrix3<Scalar> d_p = detail::times(detail::direction_derivative(d, range), c_R_v);
    const Matrix3<Scalar> d_w = detail::times(d_p, skew(p_v));
    for (Index row = 0; row < this->rows(); ++row) {
      const Vector3<Scalar> g = options_.norm ? detail::row3(m.angle_gradient, 0, 0)
                                              : detail::row3(m.vector_gradient, row, 0);
      detail::set_row3(this->jacobian_, row, robot.arm_dof(),
                       detail::scaled(detail::transposed_times(d_p, g), Scalar(-1)));
      detail::set_row3(this->jacobian_, row, robot.arm_dof() + 3, detail::transposed_times(d_w, g));
      this->activation_(row) = Scalar(1);
    }
    if (options_.norm) {
      this->set_scalar(0, m.angle, *options_.norm, options_.gain, options_.max_rate);
      // Straight behind the camera the gradient flips; the row fades out before it does.
      this->activation_(0) *= half_turn_weight(m.angle);
    } else {
      this->set_error(0, Vector<Scalar, 2>(-m.vector(0), -m.vector(1)), options_.gain,
                      options_.max_rate);
    }
  }

  Options options_;
};

/// The elbow outside the camera's cone of vision [Coop, II-D3], [MARIS, III-B7]: the angle between
/// the optical axis and the line to the elbow, θ ≥ `minimum_angle`.
template <VehicleManipulator R>
class CameraOcclusion : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    /// What errors and logs call it.
    std::string name = "camera occlusion";
    Index elbow_joint;     ///< the joint whose point is the elbow
    Scalar minimum_angle;  ///< half the opening of the cone, rad
    Scalar margin;         ///< rad
    /// γ, 1/s, > 0.
    Scalar gain{1};
    Scalar max_rate{std::numeric_limits<Scalar>::infinity()};  ///< rad/s
  };

  /// @throws std::invalid_argument on settings out of range. Allocates.
  CameraOcclusion(const R& robot, Options options)
      : Task<R>(options.name, 1, robot.dof()),
        options_(options),
        objective_(Objective<Scalar>::at_least(options.minimum_angle, options.margin)) {
    this->require_gain(options.gain);
    this->require_rate("max_rate", options.max_rate);
    this->require_above_zero("minimum_angle", options.minimum_angle);
    if (options.elbow_joint < 0 || options.elbow_joint >= robot.arm_dof()) {
      detail::invalid("task '", options.name, "': elbow_joint must be in [0, ", robot.arm_dof() - 1,
                      "], got ", options.elbow_joint);
    }
  }

 private:
  void compute(const R& robot) noexcept override {
    const Pose<Scalar>& camera = robot.description().camera;
    const Matrix3<Scalar> v_R_b = detail::rotation(robot.description().arm_mount);
    const Matrix3<Scalar> c_R_v = detail::transpose(detail::rotation(camera));
    const Vector3<Scalar> elbow =
        detail::transform(robot.description().arm_mount,
                          detail::column3(robot.arm_state().points, 0, options_.elbow_joint));
    const Vector3<Scalar> p = detail::times(c_R_v, detail::minus(elbow, detail::origin(camera)));
    const Scalar range = detail::norm(p);
    if (!(range > Scalar(0))) {
      this->deactivate();
      return;
    }
    const Vector3<Scalar> d = detail::scaled(p, Scalar(1) / range);
    const Misalignment<Scalar> m = misalignment_from_z<Scalar>(d);
    // ∂θ/∂(elbow), components on ⟨b⟩.
    const Matrix3<Scalar> d_b =
        detail::times(detail::times(detail::direction_derivative(d, range), c_R_v), v_R_b);
    const Vector3<Scalar> g = detail::transposed_times(d_b, detail::row3(m.angle_gradient, 0, 0));
    const auto J = robot.arm().point_jacobian(robot.arm_state(), options_.elbow_joint);
    for (Index j = 0; j < robot.arm_dof(); ++j) {
      this->jacobian_(0, j) = detail::dot(g, detail::column3(J, 0, j));
    }
    this->set_scalar(0, m.angle, objective_, options_.gain, options_.max_rate);
    // On the optical axis the gradient flips; the row fades out before it does.
    const Scalar fade = std::min(Scalar(0.1), options_.minimum_angle / Scalar(2));
    this->activation_(0) *= smooth_step(m.angle / fade);
  }

  Options options_;
  Objective<Scalar> objective_;
};

}  // namespace icat::task
