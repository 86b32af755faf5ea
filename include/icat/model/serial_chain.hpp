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
  Vector3<Scalar> axis{Scalar(0), Scalar(0), Scalar(1)};   ///< unit length
  Vector3<Scalar> point{Scalar(0), Scalar(0), Scalar(0)};  ///< any point on the axis
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
      const Scalar length = detail::norm(joint.axis);
      if (!(std::abs(length - Scalar(1)) < Scalar(1e-4))) {
        detail::invalid("SerialChain: axis of joint ", j, " must have length 1, got ", length);
      }
      if (!detail::all_finite(joint.point)) {
        detail::invalid("SerialChain: point of joint ", j, " is not finite");
      }
      if (!(joint.lower < joint.upper)) {
        detail::invalid("SerialChain: limits of joint ", j, " must be in order, got [", joint.lower,
                        ", ", joint.upper, "]");
      }
      joints_[static_cast<std::size_t>(j)].axis = detail::scaled(joint.axis, Scalar(1) / length);
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
    Matrix3<Scalar> R = detail::identity<Matrix3<Scalar>>(3);
    Vector3<Scalar> t(Scalar(0), Scalar(0), Scalar(0));
    for (Index j = 0; j < Dof; ++j) {
      const auto& joint = joints_[static_cast<std::size_t>(j)];
      const Vector3<Scalar> axis = detail::times(R, joint.axis);
      const Vector3<Scalar> point = detail::plus(detail::times(R, joint.point), t);
      detail::set_column3(s.axes, 0, j, axis);
      detail::set_column3(s.points, 0, j, point);
      if (joint.type == JointType::revolute) {
        R = detail::times(R, axis_rotation<Scalar>(joint.axis, q(j)));
        t = detail::minus(point, detail::times(R, joint.point));
      } else {
        t = detail::plus(t, q(j), axis);
      }
    }
    s.end_effector = detail::compose(detail::make_pose(R, t), end_effector_);
    const Vector3<Scalar> end = detail::origin(s.end_effector);
    for (Index j = 0; j < Dof; ++j) {
      const Vector3<Scalar> z = detail::column3(s.axes, 0, j);
      Vector3<Scalar> linear = z, angular(Scalar(0), Scalar(0), Scalar(0));
      if (joints_[static_cast<std::size_t>(j)].type == JointType::revolute) {
        linear = detail::cross(z, detail::minus(end, detail::column3(s.points, 0, j)));
        angular = z;
      }
      detail::set_column3(s.jacobian, 0, j, linear);
      detail::set_column3(s.jacobian, 3, j, angular);
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
    auto J = detail::zeros<Eigen::Matrix<Scalar, 3, Dof>>(3, Dof);
    const Vector3<Scalar> point = detail::column3(s.points, 0, j);
    for (Index i = 0; i < j; ++i) {
      const Vector3<Scalar> z = detail::column3(s.axes, 0, i);
      const bool turns = joints_[static_cast<std::size_t>(i)].type == JointType::revolute;
      detail::set_column3(
          J, 0, i,
          turns ? detail::cross(z, detail::minus(point, detail::column3(s.points, 0, i))) : z);
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
    // Element (i, k) of J for six rows, of Jᵀ for fewer than six columns: the side that has full
    // rank.
    const auto at = [&](Index i, Index k) { return Dof < 6 ? J(k, i) : J(i, k); };
    constexpr Index other = Dof < 6 ? 6 : Dof;
    Eigen::Matrix<Scalar, side, side> gram;
    for (Index i = 0; i < side; ++i) {
      for (Index j = 0; j <= i; ++j) {
        Scalar sum(0);
        for (Index k = 0; k < other; ++k) sum += at(i, k) * at(j, k);
        gram(i, j) = gram(j, i) = sum;
      }
    }
    detail::SymmetricEigen<Scalar, side> eigen(side);
    Manipulability<Scalar, Dof> m{Scalar(0), detail::zeros<Eigen::Matrix<Scalar, 1, Dof>>(1, Dof)};
    if (!eigen.compute(gram)) return m;

    // σ_k from J itself: the square root of a small eigenvalue of the Gram matrix is noise.
    // Singular vectors of the short side, and σ_k times those of the long one.
    const auto& short_side = eigen.vectors();
    Eigen::Matrix<Scalar, other, side> long_side;
    Vector<Scalar, side> sigma;
    Scalar largest(0);
    m.value = Scalar(1);
    for (Index k = 0; k < side; ++k) {
      Scalar square(0);
      for (Index i = 0; i < other; ++i) {
        Scalar sum(0);
        for (Index l = 0; l < side; ++l) sum += at(l, i) * short_side(l, k);
        long_side(i, k) = sum;
        square += sum * sum;
      }
      sigma(k) = std::sqrt(square);
      m.value *= sigma(k);
      largest = sigma(k) > largest ? sigma(k) : largest;
    }
    // Below this σ_k is rounding, and so would be the direction divided by it.
    const Scalar rounding = Scalar(16) * std::numeric_limits<Scalar>::epsilon() * largest;
    auto y = detail::zeros<Eigen::Matrix<Scalar, 6, Dof>>(6, Dof);  // μ (J^#)ᵀ
    for (Index k = 0; k < side; ++k) {
      if (!(sigma(k) > rounding)) continue;
      Scalar others(1);
      for (Index l = 0; l < side; ++l) {
        if (l != k) others *= sigma(l);
      }
      const Scalar weight = others / sigma(k);
      for (Index j = 0; j < Dof; ++j) {
        for (Index i = 0; i < 6; ++i) {
          y(i, j) += weight * (Dof < 6 ? long_side(i, k) * short_side(j, k)
                                       : short_side(i, k) * long_side(j, k));
        }
      }
    }
    // ∂J_j/∂q_i: joint i carries axis j along if i ≤ j, and the end-effector in any case.
    for (Index i = 0; i < Dof; ++i) {
      const Vector3<Scalar> linear_i = detail::column3(J, 0, i);
      const Vector3<Scalar> angular_i = detail::column3(J, 3, i);
      for (Index j = 0; j < Dof; ++j) {
        const Vector3<Scalar> linear_j = detail::column3(J, 0, j);
        const Vector3<Scalar> angular_j = detail::column3(J, 3, j);
        const Vector3<Scalar> y_linear = detail::column3(y, 0, j);
        if (i <= j) {
          m.gradient(i) +=
              detail::dot(detail::cross(angular_i, linear_j), y_linear) +
              detail::dot(detail::cross(angular_i, angular_j), detail::column3(y, 3, j));
        } else {
          m.gradient(i) += detail::dot(detail::cross(angular_j, linear_i), y_linear);
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
