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
    Vector3<Scalar> target{Vector3<Scalar>::Zero()};  ///< components on ⟨0⟩, m
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
    if (!options.target.allFinite()) {
      detail::invalid("task '", options.name, "': the target is not finite");
    }
  }
  /// New target, components on ⟨0⟩, m.
  void set_target(const Vector3<Scalar>& target) noexcept { options_.target = target; }

 private:
  void compute(const R& robot) noexcept override {
    const Pose<Scalar>& v_c = robot.description().camera;
    const Matrix3<Scalar> c_R_v = v_c.linear().transpose();
    const Vector3<Scalar> p_v =
        robot.vehicle().linear().transpose() * (options_.target - robot.vehicle().translation());
    const Vector3<Scalar> p = c_R_v * (p_v - v_c.translation());
    const Scalar range = p.norm();
    auto J = this->jacobian_.template rightCols<6>();
    if (!(range > Scalar(0))) {  // In the lens: no direction, no task.
      J.setZero();
      this->reference_.setZero();
      this->activation_.setZero();
      return;
    }
    const Vector3<Scalar> d = p / range;
    const Misalignment<Scalar> m = misalignment_from_z<Scalar>(d);
    // ṗ_v = −v₁ − ω × p_v for a target at rest, components on ⟨v⟩.
    const Matrix3<Scalar> d_p = (Matrix3<Scalar>::Identity() - d * d.transpose()) / range * c_R_v;
    const Matrix3<Scalar> d_w = d_p * skew(p_v);
    if (options_.norm) {
      J.template leftCols<3>() = -m.angle_gradient * d_p;
      J.template rightCols<3>() = m.angle_gradient * d_w;
      this->set_scalar(0, m.angle, *options_.norm, options_.gain, options_.max_rate);
      // Straight behind the camera the gradient flips; the row fades out before it does.
      this->activation_(0) *= half_turn_weight(m.angle);
    } else {
      J.template leftCols<3>() = -m.vector_gradient * d_p;
      J.template rightCols<3>() = m.vector_gradient * d_w;
      this->activation_.setOnes();
      this->set_error(0, Vector<Scalar, 2>(-m.vector), options_.gain, options_.max_rate);
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
    const auto& description = robot.description();
    const Pose<Scalar>& mount = description.arm_mount;
    const Matrix3<Scalar> c_R_v = description.camera.linear().transpose();
    const Vector3<Scalar> elbow =
        mount * Vector3<Scalar>(robot.arm_state().points.col(options_.elbow_joint));
    const Vector3<Scalar> p = c_R_v * (elbow - description.camera.translation());
    const Scalar range = p.norm();
    auto J = this->jacobian_.row(0).head(robot.arm_dof());
    J.setZero();
    if (!(range > Scalar(0))) {
      this->reference_.setZero();
      this->activation_.setZero();
      return;
    }
    const Vector3<Scalar> d = p / range;
    const Misalignment<Scalar> m = misalignment_from_z<Scalar>(d);
    const Eigen::Matrix<Scalar, 1, 3> g =
        (m.angle_gradient - m.angle_gradient.dot(d.transpose()) * d.transpose()) / range * c_R_v *
        mount.linear();
    J = g.lazyProduct(robot.arm().point_jacobian(robot.arm_state(), options_.elbow_joint));
    this->set_scalar(0, m.angle, objective_, options_.gain, options_.max_rate);
    // On the optical axis the gradient flips; the row fades out before it does.
    const Scalar fade = std::min(Scalar(0.1), options_.minimum_angle / Scalar(2));
    this->activation_(0) *= smooth_step(m.angle / fade);
  }

  Options options_;
  Objective<Scalar> objective_;
};

}  // namespace icat::task
