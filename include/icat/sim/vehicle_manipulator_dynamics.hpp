// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Dynamics of a floating vehicle with a serial arm, in water:
///
///     M(q) ÿ + c(q, ẏ, gravity, buoyancy, drag) = f,   ẏ = [q̇; v],  f = [τ; w]
///
/// ÿ is the derivative of the components of ẏ, and w the wrench on the vehicle, [force; moment] at
/// the origin of ⟨v⟩, components on ⟨v⟩: f · ẏ is power.
///
/// c by the recursive Newton–Euler equations, M by composite rigid bodies (Featherstone, *Rigid
/// Body Dynamics Algorithms*, 2008, ch. 5, 6, 9), all in one frame, ⟨v⟩: then nothing has to be
/// carried from link to link, and the force F_i of a composite body under a unit acceleration of
/// joint i is at once the column of M that couples this joint with the vehicle. Added mass enters
/// as inertia that differs with the direction (Kirchhoff), see model/rigid_body.hpp.
#pragma once

#include <array>
#include <string>
#include <utility>

#include "icat/model/rigid_body.hpp"
#include "icat/model/uvms.hpp"

namespace icat {

/// M, c and what a grasp needs to know of the end-effector, for the state given to `update`. With
/// `ArmDof` 0 the vehicle alone.
template <class ScalarType, int ArmDof>
class VehicleManipulatorDynamics {
 public:
  /// Scalar type.
  using Scalar = ScalarType;
  /// Degrees of freedom.
  static constexpr int size = ArmDof + 6;
  /// Joint positions.
  using VectorQ = Vector<Scalar, ArmDof>;
  /// ẏ, ÿ, f.
  using VectorN = Vector<Scalar, size>;
  /// M.
  using MatrixN = Eigen::Matrix<Scalar, size, size>;
  /// 6 × size.
  using Jacobian = Eigen::Matrix<Scalar, 6, size>;

  /// What the robot is made of.
  struct Description {
    SerialArm<Scalar, ArmDof> arm;                ///< on its base ⟨b⟩
    Pose<Scalar> arm_mount = IdentityPose{};      ///< ⟨b⟩ in ⟨v⟩
    RigidBody<Scalar> vehicle;                    ///< `pose` in ⟨v⟩
    std::array<RigidBody<Scalar>, ArmDof> links;  ///< moved by joint i; `pose` in ⟨b⟩ at q = 0
    Scalar gravity{static_cast<Scalar>(9.81)};    ///< along z of ⟨0⟩, m/s²
  };

  /// Starts at q = 0, at rest, with ⟨v⟩ = ⟨0⟩.
  /// @throws std::invalid_argument on a body without positive mass and inertia, below-zero added
  /// mass, drag or displacement, poses that are none, or a bad arm (see `KinematicTree`).
  /// Allocates.
  explicit VehicleManipulatorDynamics(const Description& description)
      : VehicleManipulatorDynamics(description, std::make_index_sequence<ArmDof>()) {}

  /// New state: joint positions (rad, m), pose of ⟨v⟩ in ⟨0⟩, ẏ. NaN, infinity or a matrix that is
  /// no rotation: refused, the state stays. No allocation.
  Status update(const VectorQ& q, const Pose<Scalar>& vehicle, const VectorN& velocity) noexcept {
    using detail::cross_motion;
    if (!velocity.allFinite() || !detail::all_finite(vehicle.matrix())) return Status::non_finite;
    if (!is_rigid(vehicle)) return Status::not_a_rotation;
    if (const Status status = tree_.update(q); status != Status::ok) return status;
    pose_ = vehicle;
    const Vector3<Scalar> g = vehicle.linear().transpose() * gravity_;
    Spatial V = Spatial::of(velocity.template tail<6>());
    Spatial a = Spatial::zero();  // with ÿ = 0, seen from where ⟨v⟩ is now
    Spatial base_force = vehicle_.wrench(vehicle_.place(), Matrix3<Scalar>::Identity(), V, a, g);

    std::array<Spatial, ArmDof>& screw = screws_;
    std::array<Spatial, ArmDof> force;
    std::array<detail::SpatialInertia<Scalar>, ArmDof> composite;
    for (std::size_t i = 0; i < ArmDof; ++i) {
      const auto joint = static_cast<Index>(i);
      const Vector3<Scalar>& z = tree_.axis(joint);
      if (turns_[i]) {
        screw[i] = {tree_.axis_point(joint).cross(z), z};
      } else {
        screw[i] = {z, Vector3<Scalar>::Zero()};
      }
      const Scalar rate = velocity(joint);
      const Spatial motion{rate * screw[i].linear, rate * screw[i].angular};
      a += cross_motion(V, motion);
      V += motion;
      const Pose<Scalar>& link = tree_.moved_frame(joint);
      const Matrix3<Scalar> R = link.linear();
      const auto at = links_[i].place(R, link.translation());
      force[i] = links_[i].wrench(at, R, V, a, g);
      composite[i] = detail::Body<Scalar>::inertia(at);
    }
    end_effector_ = tree_.pose(tip_);
    end_effector_twist_ = V;
    end_effector_acceleration_ = a;

    for (std::size_t i = ArmDof; i-- > 0;) {
      const auto row = static_cast<Index>(i);
      bias_(row) = screw[i].dot(force[i]);
      const Spatial F = composite[i] * screw[i];
      for (std::size_t j = 0; j <= i; ++j) {
        mass_(row, static_cast<Index>(j)) = mass_(static_cast<Index>(j), row) = F.dot(screw[j]);
      }
      const Vector6<Scalar> column = F.vector();
      mass_.template block<6, 1>(ArmDof, row) = column;
      mass_.template block<1, 6>(row, ArmDof) = column.transpose();
      if (i > 0) {
        force[i - 1] += force[i];
        composite[i - 1] += composite[i];
      }
    }
    detail::SpatialInertia<Scalar> whole = vehicle_inertia_;
    if constexpr (ArmDof > 0) {
      whole += composite[0];
      base_force += force[0];
    }
    mass_.template bottomRightCorner<6, 6>() = whole.matrix();
    bias_.template tail<6>() = base_force.vector();
    return Status::ok;
  }

  /// M, size × size, symmetric: kg, kg m, kg m².
  const MatrixN& mass_matrix() const noexcept { return mass_; }
  /// c, size: N, N m.
  const VectorN& bias() const noexcept { return bias_; }
  /// ⟨e⟩ in ⟨v⟩.
  const Pose<Scalar>& end_effector() const noexcept { return end_effector_; }
  /// A frame fixed to the end-effector: everything at its origin, components on itself.
  struct Hand {
    Pose<Scalar> pose;                  ///< in ⟨v⟩
    Jacobian jacobian;                  ///< J, rows linear then angular
    Vector6<Scalar> twist;              ///< J ẏ
    Vector6<Scalar> bias_acceleration;  ///< J̇ ẏ: the twist's derivative at ÿ = 0
  };
  /// The frame with pose `e_t` in ⟨e⟩. No allocation.
  Hand hand(const Pose<Scalar>& e_t) const noexcept {
    Hand h;
    h.pose = end_effector_ * e_t;
    const Matrix3<Scalar> back = h.pose.linear().transpose();
    const Vector3<Scalar> r = h.pose.translation();
    // A twist or its derivative, from the origin of ⟨v⟩ to this frame.
    const auto carry = [&](const Spatial& V, auto&& out) {
      out.template head<3>() = back * (V.linear + V.angular.cross(r));
      out.template tail<3>() = back * V.angular;
    };
    for (std::size_t i = 0; i < ArmDof; ++i) {
      carry(screws_[i], h.jacobian.col(static_cast<Index>(i)));
    }
    auto Jv = h.jacobian.template rightCols<6>();
    Jv.template topLeftCorner<3, 3>() = back;
    Jv.template topRightCorner<3, 3>() = -back * skew(r);
    Jv.template bottomLeftCorner<3, 3>().setZero();
    Jv.template bottomRightCorner<3, 3>() = back;
    carry(end_effector_twist_, h.twist);
    carry(end_effector_acceleration_, h.bias_acceleration);
    return h;
  }

  /// ½ ẏᵀ M ẏ, J, with the state given to `update`; added mass counts.
  Scalar kinetic_energy(const VectorN& velocity) const noexcept {
    return velocity.dot(mass_.lazyProduct(velocity)) / Scalar(2);
  }
  /// Of weight and buoyancy, J, 0 with all centres at the origin of ⟨0⟩, with the state given to
  /// `update`.
  Scalar potential_energy() const noexcept {
    Scalar energy = vehicle_.potential_energy(pose_ * vehicle_.place().p, pose_.linear(), gravity_);
    for (std::size_t i = 0; i < ArmDof; ++i) {
      const Pose<Scalar> link = pose_ * tree_.moved_frame(static_cast<Index>(i));
      energy += links_[i].potential_energy(link * links_[i].place().p, link.linear(), gravity_);
    }
    return energy;
  }

  /// Gravity, components on ⟨0⟩, m/s².
  const Vector3<Scalar>& gravity() const noexcept { return gravity_; }

 private:
  using Spatial = detail::Spatial<Scalar>;

  template <std::size_t... I>
  VehicleManipulatorDynamics(const Description& description, std::index_sequence<I...>)
      : tree_(uvms<Scalar, ArmDof>(description.arm, {.arm = description.arm_mount})),
        tip_(tree_.frame("end_effector")),
        turns_{(description.arm.joints[I].type != JointType::prismatic)...},
        vehicle_(owner, "the vehicle", description.vehicle),
        links_{
            detail::Body<Scalar>(owner, "link " + std::to_string(I), on_link(description, I))...},
        vehicle_inertia_(detail::Body<Scalar>::inertia(vehicle_.place())),
        gravity_(Scalar(0), Scalar(0), description.gravity) {
    if (!gravity_.allFinite()) {
      detail::invalid(owner, ": gravity must be finite, got ", description.gravity);
    }
    (void)update(VectorQ::Zero(), Pose<Scalar>::Identity(), VectorN::Zero());
  }

  // Link i, fixed to the tree's frame: at q = 0 parallel to ⟨b⟩, its origin the joint's point.
  static RigidBody<Scalar> on_link(const Description& description, std::size_t i) {
    RigidBody<Scalar> body = description.links[i];
    body.pose.translation() -= description.arm.joints[i].point;
    return body;
  }

  static constexpr const char* owner = "VehicleManipulatorDynamics";

  KinematicTree<Scalar, size> tree_;  // ⟨v⟩ stays on ⟨0⟩ here: all in ⟨v⟩
  FrameId tip_;
  std::array<bool, ArmDof> turns_;
  detail::Body<Scalar> vehicle_;
  std::array<detail::Body<Scalar>, ArmDof> links_;
  detail::SpatialInertia<Scalar> vehicle_inertia_;
  Vector3<Scalar> gravity_;

  MatrixN mass_;
  VectorN bias_;
  Pose<Scalar> pose_;  // of ⟨v⟩ in ⟨0⟩
  std::array<Spatial, ArmDof> screws_;
  Pose<Scalar> end_effector_;
  Spatial end_effector_twist_, end_effector_acceleration_;
};

}  // namespace icat
