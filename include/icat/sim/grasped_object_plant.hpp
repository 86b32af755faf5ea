// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Two vehicle-manipulators that hold one rigid object with firm grasps, in water.
///
/// Frame ⟨t_i⟩ is fixed to the end-effector of robot i and lies on the object's frame ⟨o⟩ when the
/// grasp closes: ⟨t_a⟩ ≡ ⟨t_b⟩ ≡ ⟨o⟩ [Coop, IV]. Twists V and wrenches w_i, which robot i exerts on
/// the object, are at the origin of ⟨o⟩ with components on it. Unknown are ÿ_i, V̇_o and w_i:
///
///     M_i ÿ_i + c_i = f_i − J_iᵀ w_i                            the robots
///     M_o V̇_o + c_o = w_a + w_b                                 the object
///     J_i ÿ_i + J̇_i ẏ_i = V̇_o − 2 ω (V_i − V_o) − ω² e_i        the grasps, ω = 1/(10 dt)
///
/// The last two terms take back the drift e_i of the pose of ⟨t_i⟩ in ⟨o⟩ (Baumgarte). With the
/// robots eliminated, S_i = J_i M_i⁻¹ J_iᵀ and u_i the acceleration of ⟨t_i⟩ were it free:
///
///     w_i = S_i⁻¹ (u_i − V̇_o),     (M_o + Σ S_i⁻¹) V̇_o = Σ S_i⁻¹ u_i − c_o
///
/// One Cholesky factor of 13 × 13 and two of 6 × 6 per robot's worth of work, nothing larger.
///
/// **Interaction.** Only the resultant of both wrenches moves the object. With each wrench taken at
/// its grasp, the end-effector's origin p_i, [f_i; m_i], the resultant is G x, x = [f_a; m_a; f_b;
/// m_b], G = [I 0 I 0; [p_a]× I [p_b]× I]. Of all x with that resultant the one of least norm (N
/// and N m alike) carries the load; the rest is internal and does not move it:
///
///     x_int = x − Gᵀ (G Gᵀ)⁻¹ G x,     interaction = (x_int,a − x_int,b)/2
///
/// the wrench with which robot a presses against robot b through the object, without the load that
/// they share evenly.
#pragma once

#include "icat/sim/hydrodynamic_plant.hpp"

namespace icat {

/// State and integration, see the file comment and `HydrodynamicPlant`.
template <class ScalarType, int ArmDof>
class GraspedObjectPlant {
 public:
  /// Scalar type.
  using Scalar = ScalarType;
  /// One of the two.
  using Robot = HydrodynamicPlant<Scalar, ArmDof>;
  /// ẏ, ÿ, f.
  using VectorN = typename Robot::VectorN;

  /// Closes both grasps on `object` with its frame ⟨o⟩ at `object_pose` in ⟨0⟩, the robots being
  /// where they are. The object starts with the velocity of the first robot's hand; a difference
  /// between both hands fades within some ten steps.
  /// @throws std::invalid_argument on a bad body or pose.
  GraspedObjectPlant(const Robot& first, const Robot& second, const RigidBody<Scalar>& object,
                     const Pose<Scalar>& object_pose)
      : robots_{first, second},
        body_("GraspedObjectPlant", "the object", object),
        inertia_(detail::Body<Scalar>::inertia(body_.place()).matrix()),
        pose_(object_pose) {
    if (!is_rigid(object_pose)) {
      detail::invalid("GraspedObjectPlant: the object's pose is not finite or not a rotation");
    }
    for (std::size_t i = 0; i < 2; ++i) {
      grasps_[i] = tip(i).inverse(Eigen::Isometry) * pose_;
      wrenches_[i].setZero();
    }
    velocity_ = robots_[0].dynamics().hand(grasps_[0]).twist;
    acceleration_.setZero();
  }

  /// One step of `seconds`, > 0, under the generalized forces of both robots, as in
  /// `HydrodynamicPlant::step`. What is not finite, or would become so: refused, the state stays.
  /// No allocation.
  Status step(const VectorN& first, const VectorN& second, double seconds) noexcept {
    const Scalar dt = static_cast<Scalar>(seconds);
    if (!(dt > Scalar(0)) || !std::isfinite(dt)) return Status::non_finite;  // 1/dt is needed
    const std::array<const VectorN*, 2> forces{&first, &second};
    const Scalar half = dt / Scalar(2);
    const Pose<Scalar> middle = integrate<Scalar>(pose_, velocity_, half);
    const Vector6<Scalar> V = velocity_ + half * acceleration_;
    const Scalar rate = Scalar(1) / (Scalar(10) * dt);

    const Matrix3<Scalar> R = Matrix3<Scalar>::Identity();
    Matrix6<Scalar> total = inertia_;
    Vector6<Scalar> acceleration =
        -body_
             .wrench(body_.place(), R, detail::Spatial<Scalar>::of(V),
                     detail::Spatial<Scalar>::zero(),
                     middle.linear().transpose() * robots_[0].dynamics_.gravity())
             .vector();
    std::array<Hand, 2> hands;
    for (std::size_t i = 0; i < 2; ++i) {
      Robot& robot = robots_[i];
      Hand& hand = hands[i];
      const Status status = robot.begin(*forces[i], dt);
      if (status != Status::ok) return status;
      const auto at = robot.dynamics_.hand(grasps_[i]);
      const Vector6<Scalar> error = difference(middle, robot.next_.vehicle * at.pose);

      hand.Y = at.jacobian.transpose();
      robot.factor_.solve_lower(hand.Y);
      Matrix6<Scalar> S;
      for (Index c = 0; c < 6; ++c) {
        for (Index r = c; r < 6; ++r) S(r, c) = S(c, r) = hand.Y.col(r).dot(hand.Y.col(c));
      }
      detail::Cholesky<Scalar, 6> factor;
      if (!factor.compute(S)) return Status::numerical_failure;
      hand.inertia.setIdentity();
      factor.solve(hand.inertia);
      hand.free = hand.Y.transpose().lazyProduct(robot.reduced_);
      hand.free += at.bias_acceleration + Scalar(2) * rate * (at.twist - V) + rate * rate * error;
      total += hand.inertia;
      acceleration += hand.inertia.lazyProduct(hand.free);
    }
    detail::Cholesky<Scalar, 6> factor;
    if (!factor.compute(total)) return Status::numerical_failure;
    factor.solve(acceleration);

    std::array<Vector6<Scalar>, 2> wrenches;
    for (std::size_t i = 0; i < 2; ++i) {
      Robot& robot = robots_[i];
      wrenches[i] = hands[i].inertia.lazyProduct(hands[i].free - acceleration);
      robot.reduced_ -= hands[i].Y.lazyProduct(wrenches[i]);
      robot.factor_.solve_upper(robot.reduced_);
      const Status status = robot.finish(dt);
      if (status != Status::ok) return status;
    }
    const Vector6<Scalar> velocity = velocity_ + dt * acceleration;
    const Pose<Scalar> pose = integrate<Scalar>(middle, velocity, half);
    if (!velocity.allFinite() || !detail::all_finite(pose.matrix())) {
      return Status::numerical_failure;
    }
    for (auto& robot : robots_) robot.accept();
    wrenches_ = wrenches;
    acceleration_ = acceleration;
    velocity_ = velocity;
    pose_ = pose;
    return Status::ok;
  }

  /// Robot 0 or 1.
  const Robot& robot(std::size_t i) const noexcept { return robots_[i]; }
  /// ⟨o⟩ in ⟨0⟩.
  const Pose<Scalar>& object() const noexcept { return pose_; }
  /// Twist of ⟨o⟩ with respect to ⟨0⟩, components on ⟨o⟩.
  const Vector6<Scalar>& object_velocity() const noexcept { return velocity_; }
  /// ⟨t_i⟩ in the end-effector frame ⟨e⟩ of robot `i`: the tool's mount while it holds the object.
  const Pose<Scalar>& grasp(std::size_t i) const noexcept { return grasps_[i]; }
  /// w_i, which robot `i` exerted on the object in the last step: [N; N m] at the origin of ⟨o⟩,
  /// components on ⟨o⟩.
  const Vector6<Scalar>& wrench(std::size_t i) const noexcept { return wrenches_[i]; }
  /// Of the last step: [N; N m], components on ⟨o⟩, see the file comment.
  Vector6<Scalar> interaction() const noexcept {
    Eigen::Matrix<Scalar, 6, 12> G;
    Vector<Scalar, 12> x;
    for (std::size_t i = 0; i < 2; ++i) {
      const Vector3<Scalar> p = grasps_[i].inverse(Eigen::Isometry).translation();
      const Index at = static_cast<Index>(6 * i);
      G.template middleCols<6>(at).setIdentity();
      G.template block<3, 3>(3, at) = skew(p);
      x.template segment<6>(at) = wrenches_[i];
      x.template segment<3>(at + 3) -= p.cross(wrenches_[i].template head<3>());
    }
    const Matrix6<Scalar> GGt = G.lazyProduct(G.transpose());
    Vector6<Scalar> load = G.lazyProduct(x);
    detail::Cholesky<Scalar, 6> factor;
    if (!factor.compute(GGt)) return Vector6<Scalar>::Zero();  // never: it has full rank
    factor.solve(load);
    x -= G.transpose().lazyProduct(load);
    return (x.template head<6>() - x.template tail<6>()) / Scalar(2);
  }
  /// How far ⟨t_i⟩ has come off ⟨o⟩: position (m) and rotation vector (rad), components on ⟨o⟩.
  Vector6<Scalar> drift(std::size_t i) const noexcept {
    return difference(pose_, tip(i) * grasps_[i]);
  }

 private:
  struct Hand {
    typename detail::Cholesky<Scalar, ArmDof + 6>::template Rows<6> Y;  // L⁻¹ Jᵀ
    Matrix6<Scalar> inertia;                                            // S⁻¹
    Vector6<Scalar> free;                                               // u
  };

  // Pose of `to` in `from`, as position and rotation vector.
  static Vector6<Scalar> difference(const Pose<Scalar>& from, const Pose<Scalar>& to) noexcept {
    const Matrix3<Scalar> back = from.linear().transpose();
    Vector6<Scalar> e;
    e.template head<3>() = back * (to.translation() - from.translation());
    e.template tail<3>() = rotation_log<Scalar>(back * to.linear());
    return e;
  }
  // ⟨e⟩ of robot i in ⟨0⟩, now.
  Pose<Scalar> tip(std::size_t i) const noexcept {
    return robots_[i].vehicle() * robots_[i].dynamics().end_effector();
  }

  std::array<Robot, 2> robots_;
  detail::Body<Scalar> body_;
  Matrix6<Scalar> inertia_;
  Pose<Scalar> pose_;
  Vector6<Scalar> velocity_, acceleration_;
  std::array<Pose<Scalar>, 2> grasps_;
  std::array<Vector6<Scalar>, 2> wrenches_;
};

}  // namespace icat
