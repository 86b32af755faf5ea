// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Kinematics of a serial arm with revolute and prismatic joints.
///
/// The arm is described at q = 0 in its base frame ⟨b⟩: each joint's axis and a point on it, and
/// the pose of the end-effector ⟨e⟩ (product of exponentials). No frames have to be assigned to
/// links.
///
///     J = [ z_j × (p_e − p_j) ; z_j ]  revolute,    [ z_j ; 0 ]  prismatic
///     μ = √det(J Jᵀ) = Π σ_k                                             [MARIS, Eq. (14)]
///     ∂μ/∂q_i = Σ_k (Π_{l≠k} σ_l) u_kᵀ (∂J/∂q_i) v_k    (J = Σ σ_k u_k v_kᵀ)
///
/// The last line equals μ tr(∂J/∂q_i J^#) without its 0 · ∞ at a singular arm.
#pragma once

#include <array>
#include <cmath>
#include <limits>

#include "icat/core/error.hpp"
#include "icat/core/types.hpp"
#include "icat/math/rigid_motion.hpp"
#include "icat/math/symmetric_eigen.hpp"

namespace icat {

/// Turns about its axis, or slides along it.
enum class JointType { revolute, prismatic };

/// One joint, at q = 0, components on ⟨b⟩. Positions and limits in rad or m.
template <class Scalar>
struct Joint {
  /// Kind of joint.
  JointType type{JointType::revolute};
  Vector3<Scalar> axis{Vector3<Scalar>::UnitZ()};  ///< unit length
  Vector3<Scalar> point{Vector3<Scalar>::Zero()};  ///< any point on the axis
  /// Lower limit; none by default.
  Scalar lower{-std::numeric_limits<Scalar>::infinity()};
  /// Upper limit; none by default.
  Scalar upper{std::numeric_limits<Scalar>::infinity()};
};

/// Where everything is for one q, components on ⟨b⟩.
template <class Scalar, int Dof>
struct ChainState {
  Eigen::Matrix<Scalar, 3, Dof> axes;      ///< z_j
  Eigen::Matrix<Scalar, 3, Dof> points;    ///< p_j, moved by the joints before j
  Pose<Scalar> end_effector;               ///< ⟨e⟩ in ⟨b⟩
  Eigen::Matrix<Scalar, 6, Dof> jacobian;  ///< rows [linear; angular], at the origin of ⟨e⟩
};

/// μ and its gradient.
template <class Scalar, int Dof>
struct Manipulability {
  Scalar value;                            ///< μ
  Eigen::Matrix<Scalar, 1, Dof> gradient;  ///< ∂μ/∂q
};

/// Arm of `Dof` joints. Immutable; no member function allocates.
template <class Scalar, int Dof>
class SerialChain {
  static_assert(Dof >= 1, "the number of joints is known at compile time");

 public:
  /// Joint positions or velocities.
  using VectorQ = Vector<Scalar, Dof>;
  /// What `state` returns.
  using State = ChainState<Scalar, Dof>;
  /// From base to end-effector.
  using Joints = std::array<Joint<Scalar>, static_cast<std::size_t>(Dof)>;

  /// @param joints        from base to end-effector
  /// @param end_effector  pose of ⟨e⟩ in ⟨b⟩ at q = 0
  /// @throws std::invalid_argument on an axis that is not of unit length or limits out of order.
  SerialChain(const Joints& joints, const Pose<Scalar>& end_effector)
      : joints_(joints), end_effector_(end_effector) {
    for (Index j = 0; j < Dof; ++j) {
      const auto& joint = joints_[static_cast<std::size_t>(j)];
      // Four digits: what a data sheet gives. It is normalized below.
      if (!(std::abs(joint.axis.norm() - Scalar(1)) < Scalar(1e-4))) {
        detail::invalid("SerialChain: axis of joint ", j, " must have length 1, got ",
                        joint.axis.norm());
      }
      if (!joint.point.allFinite()) {
        detail::invalid("SerialChain: point of joint ", j, " is not finite");
      }
      if (!(joint.lower < joint.upper)) {
        detail::invalid("SerialChain: limits of joint ", j, " must be in order, got [", joint.lower,
                        ", ", joint.upper, "]");
      }
      joints_[static_cast<std::size_t>(j)].axis.normalize();
      lower_(j) = joint.lower;
      upper_(j) = joint.upper;
    }
    if (!is_rigid(end_effector)) {
      detail::invalid("SerialChain: the end-effector's pose is not finite or not a rotation");
    }
  }

  /// Degrees of freedom.
  static constexpr Index dof() noexcept { return Dof; }
  /// From base to end-effector, axes normalized.
  const Joints& joints() const noexcept { return joints_; }
  /// Lower joint limits, rad or m.
  const VectorQ& lower_limits() const noexcept { return lower_; }
  /// Upper joint limits, rad or m.
  const VectorQ& upper_limits() const noexcept { return upper_; }

  /// Everything at once, for `q` (Dof).
  State state(const VectorQ& q) const noexcept {
    State s;
    Matrix3<Scalar> R = Matrix3<Scalar>::Identity();
    Vector3<Scalar> t = Vector3<Scalar>::Zero();
    for (Index j = 0; j < Dof; ++j) {
      const auto& joint = joints_[static_cast<std::size_t>(j)];
      s.axes.col(j) = R * joint.axis;
      s.points.col(j) = R * joint.point + t;
      if (joint.type == JointType::revolute) {
        R = (R * axis_rotation<Scalar>(joint.axis, q(j))).eval();
        t = s.points.col(j) - R * joint.point;
      } else {
        t += q(j) * s.axes.col(j);
      }
    }
    s.end_effector.linear() = R * end_effector_.linear();
    s.end_effector.translation() = R * end_effector_.translation() + t;
    s.end_effector.makeAffine();
    for (Index j = 0; j < Dof; ++j) {
      const Vector3<Scalar> z = s.axes.col(j);
      if (joints_[static_cast<std::size_t>(j)].type == JointType::revolute) {
        const Vector3<Scalar> arm = s.end_effector.translation() - s.points.col(j);
        s.jacobian.col(j) << z.cross(arm), z;
      } else {
        s.jacobian.col(j) << z, Vector3<Scalar>::Zero();
      }
    }
    return s;
  }

  /// ⟨e⟩ in ⟨b⟩.
  Pose<Scalar> pose(const VectorQ& q) const noexcept { return state(q).end_effector; }

  /// 6 × Dof, rows linear then angular, at the origin of ⟨e⟩, components on ⟨b⟩.
  Eigen::Matrix<Scalar, 6, Dof> jacobian(const VectorQ& q) const noexcept {
    return state(q).jacobian;
  }

  /// Jacobian (3 × Dof, components on ⟨b⟩) of the point of joint `j`, such as an elbow.
  Eigen::Matrix<Scalar, 3, Dof> point_jacobian(const State& s, Index j) const noexcept {
    Eigen::Matrix<Scalar, 3, Dof> J = Eigen::Matrix<Scalar, 3, Dof>::Zero();
    for (Index i = 0; i < j; ++i) {
      const Vector3<Scalar> z = s.axes.col(i);
      const Vector3<Scalar> arm = s.points.col(j) - s.points.col(i);
      J.col(i) = joints_[static_cast<std::size_t>(i)].type == JointType::revolute
                     ? Vector3<Scalar>(z.cross(arm))
                     : z;
    }
    return J;
  }

  /// μ and ∂μ/∂q; for fewer than six joints μ = √det(JᵀJ). μ has a kink at a singular arm; the
  /// gradient leaves out the part of a vanished σ_k, which is the mean of both sides.
  Manipulability<Scalar, Dof> manipulability(const VectorQ& q) const noexcept {
    return manipulability(state(q));
  }
  /// The same for a state at hand.
  Manipulability<Scalar, Dof> manipulability(const State& s) const noexcept {
    constexpr int side = Dof < 6 ? Dof : 6;
    const auto& J = s.jacobian;
    Eigen::Matrix<Scalar, side, side> gram;
    if constexpr (Dof < 6) {
      gram = J.transpose().lazyProduct(J);
    } else {
      gram = J.lazyProduct(J.transpose());
    }
    detail::SymmetricEigen<Scalar, side> eigen(side);
    Manipulability<Scalar, Dof> m{Scalar(0), Eigen::Matrix<Scalar, 1, Dof>::Zero()};
    if (!eigen.compute(gram)) return m;

    // σ_k from J itself: the square root of a small eigenvalue of the Gram matrix is noise.
    Eigen::Matrix<Scalar, 6, side> u;
    Eigen::Matrix<Scalar, Dof, side> v;
    Vector<Scalar, side> sigma;
    for (Index k = 0; k < side; ++k) {
      if constexpr (Dof < 6) {
        v.col(k) = eigen.vectors().col(k);
        u.col(k) = J.lazyProduct(v.col(k));
        sigma(k) = u.col(k).norm();
      } else {
        u.col(k) = eigen.vectors().col(k);
        v.col(k) = J.transpose().lazyProduct(u.col(k));
        sigma(k) = v.col(k).norm();
      }
    }
    m.value = sigma.prod();
    // Below this σ_k is rounding, and so would be the direction divided by it.
    const Scalar rounding = Scalar(16) * std::numeric_limits<Scalar>::epsilon() * sigma.maxCoeff();
    Eigen::Matrix<Scalar, Dof, 6> y = Eigen::Matrix<Scalar, Dof, 6>::Zero();  // μ J^#
    for (Index k = 0; k < side; ++k) {
      if (!(sigma(k) > rounding)) continue;
      Scalar others(1);
      for (Index l = 0; l < side; ++l) {
        if (l != k) others *= sigma(l);
      }
      y += (others / sigma(k)) * v.col(k) * u.col(k).transpose();
    }
    // ∂J_j/∂q_i: joint i carries axis j along if i ≤ j, and the end-effector in any case.
    for (Index i = 0; i < Dof; ++i) {
      const Vector3<Scalar> linear_i = J.col(i).template head<3>();
      const Vector3<Scalar> angular_i = J.col(i).template tail<3>();
      for (Index j = 0; j < Dof; ++j) {
        const Vector3<Scalar> linear_j = J.col(j).template head<3>();
        const Vector3<Scalar> angular_j = J.col(j).template tail<3>();
        const Vector3<Scalar> y_linear = y.row(j).template head<3>();
        if (i <= j) {
          const Vector3<Scalar> y_angular = y.row(j).template tail<3>();
          m.gradient(i) +=
              angular_i.cross(linear_j).dot(y_linear) + angular_i.cross(angular_j).dot(y_angular);
        } else {
          m.gradient(i) += angular_j.cross(linear_i).dot(y_linear);
        }
      }
    }
    return m;
  }

 private:
  Joints joints_;
  Pose<Scalar> end_effector_;
  VectorQ lower_, upper_;
};

}  // namespace icat
