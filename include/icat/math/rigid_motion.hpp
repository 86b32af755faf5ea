// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Rotations, rotation vectors and twists.
///
///     exp(φ) = I + sinθ/θ [φ]× + (1 − cosθ)/θ² [φ]×²,  θ = ‖φ‖
///     T exp(ξ dt): a pose moved by the body twist ξ = [v; ω], held constant over dt, exactly
///
/// The error of an orientation is its rotation vector θ n, whose direction flips at θ = π. No
/// continuous vector field on the rotations has one attractor only (Bhat & Bernstein, *Systems &
/// Control Letters* 39, 2000), so the error here fades to 0 over the last 0.1 rad before π, where
/// it has an unstable equilibrium, in exchange for never jumping.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "icat/core/types.hpp"
#include "icat/math/smooth_step.hpp"

namespace icat {

/// Width in rad of the zone before π in which orientation errors fade out.
inline constexpr double half_turn_fade = 0.1;
/// The same for the misalignment vector; wider, because there the Jacobian fades too.
inline constexpr double misalignment_fade = 0.5;

/// 1 up to π − `fade`, from there smoothly to 0 at `angle` = π.
template <class Scalar>
Scalar half_turn_weight(Scalar angle, Scalar fade = Scalar(half_turn_fade)) noexcept {
  return smooth_step((std::numbers::pi_v<Scalar> - angle) / fade);
}

/// Whether `pose` is finite and its rotation orthonormal and right-handed, to 1e-3: measured data
/// in single precision pass, a matrix that was never set or is scaled does not.
template <class Scalar>
bool is_rigid(const Pose<Scalar>& pose) noexcept {
  const Matrix3<Scalar> R = pose.linear();
  return pose.matrix().allFinite() &&
         (R.transpose() * R - Matrix3<Scalar>::Identity()).norm() < Scalar(1e-3) &&
         R.determinant() > Scalar(0);
}

/// [a]×, the matrix of b ↦ a × b.
template <class Derived>
Matrix3<typename Derived::Scalar> skew(const Eigen::MatrixBase<Derived>& a) noexcept {
  using Scalar = typename Derived::Scalar;
  Matrix3<Scalar> m;
  m << Scalar(0), -a(2), a(1), a(2), Scalar(0), -a(0), -a(1), a(0), Scalar(0);
  return m;
}

/// Rotation about the unit vector `axis` by `angle` (rad).
template <class Scalar>
Matrix3<Scalar> axis_rotation(const Vector3<Scalar>& axis, Scalar angle) noexcept {
  return Eigen::AngleAxis<Scalar>(angle, axis).toRotationMatrix();
}

/// Rotation matrix of the rotation vector `phi` (rad).
template <class Scalar>
Matrix3<Scalar> rotation_exp(const Vector3<Scalar>& phi) noexcept {
  const Scalar angle = phi.norm();
  if (angle == Scalar(0)) return Matrix3<Scalar>::Identity();
  return axis_rotation<Scalar>(phi / angle, angle);
}

/// Rotation vector of `rotation`, ‖·‖ ≤ π. At π one of the two axes is returned.
template <class Scalar>
Vector3<Scalar> rotation_log(const Matrix3<Scalar>& rotation) noexcept {
  Eigen::Quaternion<Scalar> q(rotation);
  if (q.w() < Scalar(0)) q.coeffs() = -q.coeffs();
  const Scalar s = q.vec().norm();
  // θ/sin(θ/2) → 2 at 0, to rounding below √ε.
  if (s < std::sqrt(std::numeric_limits<Scalar>::epsilon())) return Scalar(2) * q.vec();
  return (Scalar(2) * std::atan2(s, q.w()) / s) * q.vec();
}

/// Rotation vector (components on the common frame) that turns `current` into `goal`, faded at π:
/// continuous in both arguments everywhere.
template <class Scalar>
Vector3<Scalar> orientation_error(const Matrix3<Scalar>& current,
                                  const Matrix3<Scalar>& goal) noexcept {
  const Vector3<Scalar> phi = rotation_log<Scalar>(goal * current.transpose());
  return half_turn_weight(phi.norm()) * phi;
}

/// `pose` after the body twist `twist` = [linear; angular] (components on the moving frame) was
/// held for `dt`. The result's rotation is re-orthonormalized, so that steps can be chained for
/// ever.
template <class Scalar>
Pose<Scalar> integrate(const Pose<Scalar>& pose, const Vector6<Scalar>& twist, Scalar dt) noexcept {
  const Vector3<Scalar> phi = twist.template tail<3>() * dt;
  const Vector3<Scalar> d = twist.template head<3>() * dt;
  const Scalar angle = phi.norm();
  const Scalar sq = angle * angle;
  // (1 − cosθ)/θ² and (θ − sinθ)/θ³; below 1e-2 the next term of the series is < 1e-10 relative.
  const bool small = angle < Scalar(1e-2);
  const Scalar half_sin = std::sin(angle / Scalar(2));
  const Scalar b = small ? Scalar(0.5) - sq / Scalar(24) + sq * sq / Scalar(720)
                         : Scalar(2) * half_sin * half_sin / sq;
  const Scalar c = small ? Scalar(1) / Scalar(6) - sq / Scalar(120) + sq * sq / Scalar(5040)
                         : (angle - std::sin(angle)) / (sq * angle);
  const Vector3<Scalar> step = d + b * phi.cross(d) + c * phi.cross(phi.cross(d));
  Pose<Scalar> next;
  next.translation() = pose.translation() + pose.linear() * step;
  next.linear() = Eigen::Quaternion<Scalar>(pose.linear() * rotation_exp<Scalar>(phi))
                      .normalized()
                      .toRotationMatrix();
  next.makeAffine();
  return next;
}

/// Misalignment of the unit vector `d` from the z axis of the frame its components are on.
///
/// `angle` θ in [0, π] with gradient `angle_gradient` = ∂θ/∂d; and the misalignment vector
/// ξ = θ n, n = z × d / ‖z × d‖, which has no z component: `vector` = (ξ_x, ξ_y), faded to 0
/// before π, with derivative `vector_gradient` = ∂ξ/∂d (2 × 3). ξ and its derivative are smooth
/// everywhere; the gradient of θ is 0 at θ = 0 and π, where θ has a kink.
template <class Scalar>
struct Misalignment {
  /// θ, rad.
  Scalar angle;
  /// ∂θ/∂d.
  Eigen::Matrix<Scalar, 1, 3> angle_gradient;
  /// (ξ_x, ξ_y), rad.
  Vector<Scalar, 2> vector;
  /// ∂ξ/∂d.
  Eigen::Matrix<Scalar, 2, 3> vector_gradient;
};

/// See `Misalignment`. `d` has unit length. No allocation.
template <class Scalar>
Misalignment<Scalar> misalignment_from_z(const Vector3<Scalar>& d) noexcept {
  constexpr Scalar pi = std::numbers::pi_v<Scalar>;
  Misalignment<Scalar> m;
  const Scalar s = std::hypot(d(0), d(1));
  m.angle = std::atan2(s, d(2));
  m.angle_gradient.setZero();
  // Nearer to the kink than the rounding of d its direction is unknown.
  if (s > Scalar(8) * std::numeric_limits<Scalar>::epsilon()) {
    m.angle_gradient << d(2) * d(0) / s, d(2) * d(1) / s, -s;
  }

  // ξ = g(θ) (−d_y, d_x), g = θ w(θ) / sinθ, with w the fade. Both ends by their series.
  const Scalar theta = m.angle;
  const Scalar rest = pi - theta;
  const Scalar fade = Scalar(misalignment_fade);
  Scalar g, g_slope;  // and dg/dθ
  if (theta < Scalar(1e-3)) {
    g = Scalar(1) + theta * theta / Scalar(6);
    g_slope = theta / Scalar(3);
  } else if (rest < Scalar(1e-4)) {
    // w = 10 u³ + O(u⁴), u = rest / fade: g ≈ 10 π rest² / fade³.
    g = Scalar(10) * pi * rest * rest / (fade * fade * fade);
    g_slope = -Scalar(20) * pi * rest / (fade * fade * fade);
  } else {
    const Scalar w = half_turn_weight(theta, fade);
    const Scalar w_slope = -smooth_step_derivative(rest / fade) / fade;
    const Scalar sine = std::sin(theta);
    g = theta * w / sine;
    g_slope = ((w + theta * w_slope) - g * std::cos(theta)) / sine;
  }
  m.vector << -g * d(1), g * d(0);
  m.vector_gradient.row(0) = -d(1) * g_slope * m.angle_gradient;
  m.vector_gradient.row(1) = d(0) * g_slope * m.angle_gradient;
  m.vector_gradient(0, 1) -= g;
  m.vector_gradient(1, 0) += g;
  return m;
}

}  // namespace icat
