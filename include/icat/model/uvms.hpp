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
    Pose<Scalar> arm_mount{Pose<Scalar>::Identity()};  ///< arm base ⟨b⟩ in ⟨v⟩
    Pose<Scalar> camera{Pose<Scalar>::Identity()};  ///< ⟨c⟩ in ⟨v⟩; looks along its z axis
    Pose<Scalar> tool{Pose<Scalar>::Identity()};    ///< ⟨t⟩ in the end-effector frame ⟨e⟩
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
    compute(VectorQ::Zero(), Pose<Scalar>::Identity());
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
    if (!q.allFinite() || !vehicle.matrix().allFinite()) return Status::non_finite;
    if (!is_rigid(vehicle)) return Status::not_a_rotation;
    compute(q, vehicle);
    return Status::ok;
  }

  /// Another tool frame ⟨t⟩ in ⟨e⟩, such as the frame of an object that was just grasped. Refused
  /// like a bad state. No allocation.
  Status set_tool(const Pose<Scalar>& tool) noexcept {
    if (!tool.matrix().allFinite()) return Status::non_finite;
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
  Pose<Scalar> camera() const noexcept { return vehicle_ * description_.camera; }
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
    const Pose<Scalar> v_e = description_.arm_mount * arm_state_.end_effector;
    const Pose<Scalar> v_t = v_e * description_.tool;
    tool_ = vehicle * v_t;
    const Matrix3<Scalar> v_R_b = description_.arm_mount.linear();
    const Vector3<Scalar> offset = v_t.translation() - v_e.translation();
    for (Index j = 0; j < ArmDof; ++j) {
      const Vector3<Scalar> linear = v_R_b * arm_state_.jacobian.col(j).template head<3>();
      const Vector3<Scalar> angular = v_R_b * arm_state_.jacobian.col(j).template tail<3>();
      jacobian_vehicle_.col(j) << linear + angular.cross(offset), angular;
    }
    auto Jv = jacobian_vehicle_.template rightCols<6>();
    Jv.setIdentity();
    Jv.template topRightCorner<3, 3>() = -skew(v_t.translation());
    rotate(vehicle.linear(), jacobian_world_);
    rotate(v_t.linear().transpose(), jacobian_tool_);
  }

  template <class R>
  void rotate(const R& rotation, ToolJacobian& out) const noexcept {
    const Matrix3<Scalar> m = rotation;
    for (Index j = 0; j < size; ++j) {
      out.col(j).template head<3>() = m * jacobian_vehicle_.col(j).template head<3>();
      out.col(j).template tail<3>() = m * jacobian_vehicle_.col(j).template tail<3>();
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
