// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The underwater vehicle-manipulator system: a free-floating vehicle with an arm, a camera and a
/// tool.
///
/// Velocity ẏ = [q̇; v], v of ⟨v⟩ with respect to ⟨0⟩, components on ⟨v⟩ [Coop, Eq. (2)]. The tool
/// velocity with components on ⟨v⟩, with r from the origin of ⟨v⟩ to that of ⟨t⟩:
///
///     ẋ_t = [Jᵃ Jᵛ] ẏ,    Jᵛ = [ I  −[r]× ; 0  I ]
///
/// The vehicle's pose is a rotation and a position, so no attitude is singular.
#pragma once

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/model/robot.hpp"
#include "icat/model/serial_chain.hpp"

namespace icat {

/// On which frame a Jacobian has its components.
enum class Frame { world, vehicle, tool };

/// State and kinematics of the robot, updated once a cycle by `update`; all else reads.
template <class ScalarType, int ArmDof>
class Uvms {
 public:
  /// Scalar type.
  using Scalar = ScalarType;
  /// The arm's kinematics.
  using Arm = SerialChain<Scalar, ArmDof>;
  /// Joint positions or velocities.
  using VectorQ = Vector<Scalar, ArmDof>;
  /// Degrees of freedom at compile time.
  static constexpr int size = ArmDof + 6;
  /// 6 × size.
  using ToolJacobian = Eigen::Matrix<Scalar, 6, size>;

  /// What the robot is made of.
  struct Description {
    /// The arm.
    Arm arm;
    Pose<Scalar> arm_mount{detail::identity_pose<Scalar>()};  ///< arm base ⟨b⟩ in ⟨v⟩
    Pose<Scalar> camera{detail::identity_pose<Scalar>()};  ///< ⟨c⟩ in ⟨v⟩; looks along its z axis
    Pose<Scalar> tool{detail::identity_pose<Scalar>()};  ///< ⟨t⟩ in the end-effector frame ⟨e⟩
  };

  /// Starts at q = 0 with ⟨v⟩ = ⟨0⟩.
  /// @throws std::invalid_argument if a mounting pose is not finite or its rotation is none.
  explicit Uvms(const Description& description) : description_(description) {
    const auto check = [](const char* name, const Pose<Scalar>& pose) {
      if (!is_rigid(pose)) {
        detail::invalid("Uvms: the pose of the ", name, " is not finite or not a rotation");
      }
    };
    check("arm mount", description.arm_mount);
    check("camera", description.camera);
    check("tool", description.tool);
    compute(detail::zeros<VectorQ>(ArmDof), detail::identity_pose<Scalar>());
  }

  /// Degrees of freedom.
  static constexpr Index dof() noexcept { return size; }
  /// Number of joints.
  static constexpr Index arm_dof() noexcept { return ArmDof; }
  /// As given at construction; the tool as set last.
  const Description& description() const noexcept { return description_; }
  /// The arm.
  const Arm& arm() const noexcept { return description_.arm; }

  /// New state: joint positions (rad, m) and pose of ⟨v⟩ in ⟨0⟩. NaN, infinity or a matrix that is
  /// no rotation: refused, the state stays. No allocation.
  Status update(const VectorQ& q, const Pose<Scalar>& vehicle) noexcept {
    if (!detail::all_finite(q) || !detail::all_finite(vehicle.matrix())) return Status::non_finite;
    if (!is_rigid(vehicle)) return Status::not_a_rotation;
    compute(q, vehicle);
    return Status::ok;
  }

  /// Another tool frame ⟨t⟩ in ⟨e⟩, such as the frame of an object that was just grasped. Refused
  /// like a bad state. No allocation.
  Status set_tool(const Pose<Scalar>& tool) noexcept {
    if (!detail::all_finite(tool.matrix())) return Status::non_finite;
    if (!is_rigid(tool)) return Status::not_a_rotation;
    description_.tool = tool;
    compute(q_, vehicle_);
    return Status::ok;
  }

  /// Joint positions, rad or m.
  const VectorQ& q() const noexcept { return q_; }
  /// ⟨v⟩ in ⟨0⟩.
  const Pose<Scalar>& vehicle() const noexcept { return vehicle_; }
  /// ⟨t⟩ in ⟨0⟩.
  const Pose<Scalar>& tool() const noexcept { return tool_; }
  /// ⟨c⟩ in ⟨0⟩.
  Pose<Scalar> camera() const noexcept { return detail::compose(vehicle_, description_.camera); }
  /// The arm, components on ⟨b⟩.
  const typename Arm::State& arm_state() const noexcept { return arm_state_; }
  /// μ and ∂μ/∂q at the present state. Computed when first asked for, kept until the next `update`;
  /// so not for two threads at once.
  const Manipulability<Scalar, ArmDof>& manipulability() const noexcept {
    if (!manipulability_known_) {
      manipulability_ = description_.arm.manipulability(arm_state_);
      manipulability_known_ = true;
    }
    return manipulability_;
  }

  /// 6 × size, rows linear then angular, velocity of ⟨t⟩ with respect to ⟨0⟩ at the tool's origin.
  const ToolJacobian& tool_jacobian(Frame frame) const noexcept {
    switch (frame) {
      case Frame::world:
        return jacobian_world_;
      case Frame::tool:
        return jacobian_tool_;
      case Frame::vehicle:
        break;
    }
    return jacobian_vehicle_;
  }

 private:
  void compute(const VectorQ& q, const Pose<Scalar>& vehicle) noexcept {
    q_ = q;
    vehicle_ = vehicle;
    manipulability_known_ = false;
    arm_state_ = description_.arm.state(q);
    const Pose<Scalar> v_e = detail::compose(description_.arm_mount, arm_state_.end_effector);
    const Pose<Scalar> v_t = detail::compose(v_e, description_.tool);
    tool_ = detail::compose(vehicle, v_t);
    const Matrix3<Scalar> v_R_b = detail::rotation(description_.arm_mount);
    const Vector3<Scalar> r = detail::origin(v_t);
    const Vector3<Scalar> offset = detail::minus(r, detail::origin(v_e));
    for (Index j = 0; j < ArmDof; ++j) {
      const Vector3<Scalar> linear =
          detail::times(v_R_b, detail::column3(arm_state_.jacobian, 0, j));
      const Vector3<Scalar> angular =
          detail::times(v_R_b, detail::column3(arm_state_.jacobian, 3, j));
      detail::set_column3(jacobian_vehicle_, 0, j,
                          detail::plus(linear, detail::cross(angular, offset)));
      detail::set_column3(jacobian_vehicle_, 3, j, angular);
    }
    const Matrix3<Scalar> r_cross = skew(r);
    for (Index j = 0; j < 3; ++j) {
      for (Index i = 0; i < 3; ++i) {
        const Scalar one = i == j ? Scalar(1) : Scalar(0);
        jacobian_vehicle_(i, ArmDof + j) = jacobian_vehicle_(3 + i, ArmDof + 3 + j) = one;
        jacobian_vehicle_(3 + i, ArmDof + j) = Scalar(0);
        jacobian_vehicle_(i, ArmDof + 3 + j) = -r_cross(i, j);
      }
    }
    rotate(detail::rotation(vehicle), jacobian_world_);
    rotate(detail::transpose(detail::rotation(v_t)), jacobian_tool_);
  }

  void rotate(const Matrix3<Scalar>& rotation, ToolJacobian& out) const noexcept {
    for (Index j = 0; j < size; ++j) {
      for (Index row = 0; row < 6; row += 3) {
        detail::set_column3(out, row, j,
                            detail::times(rotation, detail::column3(jacobian_vehicle_, row, j)));
      }
    }
  }

  Description description_;
  VectorQ q_;
  Pose<Scalar> vehicle_, tool_;
  typename Arm::State arm_state_;
  ToolJacobian jacobian_world_, jacobian_vehicle_, jacobian_tool_;
  mutable Manipulability<Scalar, ArmDof> manipulability_;
  mutable bool manipulability_known_{false};
};

}  // namespace icat
