// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Rotations, rotation vectors and twists.
///
///     exp(φ) = I + sinθ/θ [φ]× + (1 − cosθ)/θ² [φ]×²,  θ = ‖φ‖
///     T exp(ξ dt): a pose moved by the body twist ξ = [v; ω], held constant over dt, exactly
///
/// What is here has no memory: the direction of a rotation vector θ n, the error of an orientation,
/// flips at θ = π. Tasks that must not jump there: half_turn.hpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "icat/core/types.hpp"
#include "icat/math/spatial_algebra.hpp"

namespace icat {

/// Whether `pose` is finite and its rotation orthonormal and right-handed, to 1e-3: measured data
/// in single precision pass, a matrix that was never set or is scaled does not.
template <class Scalar>
bool is_rigid(const Pose<Scalar>& pose) noexcept {
  if (!detail::all_finite(pose.matrix())) return false;
  const Matrix3<Scalar> R = detail::rotation(pose);
  const Matrix3<Scalar> G = detail::times(detail::transpose(R), R);
  Scalar square(0);
  for (Index j = 0; j < 3; ++j) {
    for (Index i = 0; i < 3; ++i) {
      const Scalar d = G(i, j) - (i == j ? Scalar(1) : Scalar(0));
      square += d * d;
    }
  }
  const Vector3<Scalar> x = detail::column3(R, 0, 0), y = detail::column3(R, 0, 1),
                        z = detail::column3(R, 0, 2);
  return square < Scalar(1e-6) && detail::dot(detail::cross(x, y), z) > Scalar(0);
}

/// [a]×, the matrix of b ↦ a × b.
template <class Derived>
Matrix3<typename Derived::Scalar> skew(const Eigen::MatrixBase<Derived>& a) noexcept {
  using Scalar = typename Derived::Scalar;
  Matrix3<Scalar> m;
  for (Index i = 0; i < 3; ++i) m(i, i) = Scalar(0);
  m(2, 1) = a(0), m(1, 2) = -a(0);
  m(0, 2) = a(1), m(2, 0) = -a(1);
  m(1, 0) = a(2), m(0, 1) = -a(2);
  return m;
}

/// Rotation about the unit vector `axis` by `angle` (rad): cosθ I + sinθ [n]× + (1 − cosθ) n nᵀ.
template <class Scalar>
Matrix3<Scalar> axis_rotation(const Vector3<Scalar>& axis, Scalar angle) noexcept {
  const Scalar c = std::cos(angle), s = std::sin(angle);
  Matrix3<Scalar> R;
  for (Index j = 0; j < 3; ++j) {
    for (Index i = 0; i < 3; ++i) R(i, j) = (Scalar(1) - c) * axis(i) * axis(j);
    R(j, j) += c;
  }
  R(2, 1) += s * axis(0), R(1, 2) -= s * axis(0);
  R(0, 2) += s * axis(1), R(2, 0) -= s * axis(1);
  R(1, 0) += s * axis(2), R(0, 1) -= s * axis(2);
  return R;
}

/// Rotation matrix of the rotation vector `phi` (rad).
template <class Scalar>
Matrix3<Scalar> rotation_exp(const Vector3<Scalar>& phi) noexcept {
  const Scalar angle = detail::norm(phi);
  if (angle == Scalar(0)) return detail::identity<Matrix3<Scalar>>(3);
  return axis_rotation<Scalar>(detail::scaled(phi, Scalar(1) / angle), angle);
}

namespace detail {

/// Unit quaternion w + (x, y, z).
template <class Scalar>
struct UnitQuaternion {
  Scalar w;
  Vector3<Scalar> v;

  /// Of a rotation matrix, which may have lost its orthonormality to rounding; w ≥ 0. The largest
  /// of the four components is computed by a root, the others by divisions (Shepperd, *Journal of
  /// Guidance and Control* 1, 1978): nothing cancels.
  static UnitQuaternion of(const Matrix3<Scalar>& R) noexcept {
    const Scalar trace = R(0, 0) + R(1, 1) + R(2, 2);
    UnitQuaternion q;
    if (trace > Scalar(0)) {
      const Scalar t = std::sqrt(trace + Scalar(1));
      q.w = t / Scalar(2);
      const Scalar f = Scalar(1) / (Scalar(2) * t);
      q.v = {(R(2, 1) - R(1, 2)) * f, (R(0, 2) - R(2, 0)) * f, (R(1, 0) - R(0, 1)) * f};
    } else {
      Index i = R(1, 1) > R(0, 0) ? 1 : 0;
      if (R(2, 2) > R(i, i)) i = 2;
      const Index j = (i + 1) % 3, k = (i + 2) % 3;
      const Scalar t = std::sqrt(R(i, i) - R(j, j) - R(k, k) + Scalar(1));
      const Scalar f = Scalar(1) / (Scalar(2) * t);
      q.v(i) = t / Scalar(2);
      q.w = (R(k, j) - R(j, k)) * f;
      q.v(j) = (R(j, i) + R(i, j)) * f;
      q.v(k) = (R(k, i) + R(i, k)) * f;
    }
    const Scalar sign = q.w < Scalar(0) ? Scalar(-1) : Scalar(1);
    const Scalar length = std::sqrt(q.w * q.w + dot(q.v, q.v));
    q.w *= sign / length;
    q.v = scaled(q.v, sign / length);
    return q;
  }

  /// θ n with θ in [0, π] for w ≥ 0, else in [π, 2π].
  Vector3<Scalar> rotation_vector() const noexcept {
    const Scalar s = norm(v);
    // θ/sin(θ/2) → 2 at 0, to rounding below √ε.
    if (s < std::sqrt(std::numeric_limits<Scalar>::epsilon())) return scaled(v, Scalar(2));
    return scaled(v, Scalar(2) * std::atan2(s, w) / s);
  }

  /// I + 2 w [v]× + 2 [v]×²
  Matrix3<Scalar> matrix() const noexcept {
    Matrix3<Scalar> R;
    for (Index j = 0; j < 3; ++j) {
      for (Index i = 0; i < 3; ++i) R(i, j) = Scalar(2) * v(i) * v(j);
      const Scalar a = v((j + 1) % 3), b = v((j + 2) % 3);
      R(j, j) = Scalar(1) - Scalar(2) * (a * a + b * b);
    }
    const Vector3<Scalar> t = scaled(v, Scalar(2) * w);
    R(2, 1) += t(0), R(1, 2) -= t(0);
    R(0, 2) += t(1), R(2, 0) -= t(1);
    R(1, 0) += t(2), R(0, 1) -= t(2);
    return R;
  }
};

}  // namespace detail

/// Rotation vector of `rotation`, ‖·‖ ≤ π. At π one of the two axes is returned.
template <class Scalar>
Vector3<Scalar> rotation_log(const Matrix3<Scalar>& rotation) noexcept {
  return detail::UnitQuaternion<Scalar>::of(rotation).rotation_vector();
}

/// `pose` after the body twist `twist` = [linear; angular] (components on the moving frame) was
/// held for `dt`. The result's rotation is re-orthonormalized, so that steps can be chained for
/// ever.
template <class Scalar>
Pose<Scalar> integrate(const Pose<Scalar>& pose, const Vector6<Scalar>& twist, Scalar dt) noexcept {
  const Vector3<Scalar> phi = detail::scaled(detail::column3(twist, 3, 0), dt);
  const Vector3<Scalar> d = detail::scaled(detail::column3(twist, 0, 0), dt);
  const Scalar angle = detail::norm(phi);
  const Scalar sq = angle * angle;
  // (1 − cosθ)/θ² and (θ − sinθ)/θ³; below 1e-2 the next term of the series is < 1e-10 relative.
  const bool small = angle < Scalar(1e-2);
  const Scalar half_sin = std::sin(angle / Scalar(2));
  const Scalar b = small ? Scalar(0.5) - sq / Scalar(24) + sq * sq / Scalar(720)
                         : Scalar(2) * half_sin * half_sin / sq;
  const Scalar c = small ? Scalar(1) / Scalar(6) - sq / Scalar(120) + sq * sq / Scalar(5040)
                         : (angle - std::sin(angle)) / (sq * angle);
  const Vector3<Scalar> phi_d = detail::cross(phi, d);
  const Vector3<Scalar> step =
      detail::plus(detail::plus(d, b, phi_d), c, detail::cross(phi, phi_d));
  const Matrix3<Scalar> R = detail::times(detail::rotation(pose), rotation_exp<Scalar>(phi));
  return detail::make_pose(detail::UnitQuaternion<Scalar>::of(R).matrix(),
                           detail::transform(pose, step));
}

/// Misalignment of the unit vector `d` from the z axis of the frame its components are on.
///
/// `angle` θ in [0, π] with gradient `angle_gradient` = ∂θ/∂d, which is 0 at θ = 0 and π, where θ
/// has a kink; and the misalignment vector ξ = θ n, n = z × d / ‖z × d‖, which has no z component:
/// `vector` = (ξ_x, ξ_y); exactly at π, about x.
///
/// `vector_rate` Ξ is what goes with ξ as a velocity: Ξ ḋ is z × ḋ after d was turned to z the
/// short way. Along n that is θ̇, across it sinθ times the rate of n, and both equal ξ̇ for small θ.
/// Ξ never vanishes: Ξᵀ Ξ = I − d dᵀ. At π, where n flips, its rows turn over.
template <class Scalar>
struct Misalignment {
  /// θ, rad.
  Scalar angle;
  /// ∂θ/∂d.
  Eigen::Matrix<Scalar, 1, 3> angle_gradient;
  /// (ξ_x, ξ_y), rad.
  Vector<Scalar, 2> vector;
  /// Ξ.
  Eigen::Matrix<Scalar, 2, 3> vector_rate;
};

namespace detail {

/// Ξ of a d nearer to −z than to z that is turned to −z the short way, and then about (x, y) by π.
template <class Scalar>
void set_misalignment_rate(Misalignment<Scalar>& m, const Vector3<Scalar>& d, Scalar x,
                           Scalar y) noexcept {
  // The first turn takes v across d to v + (d − z) v_z / (1 − d_z), the second is a reflection of
  // x and y at the axis; z × turns that by a right angle.
  const Scalar k = Scalar(1) / (Scalar(1) - d(2)), r = x * x - y * y, p = Scalar(2) * x * y;
  set_row3(m.vector_rate, 0, 0, Vector3<Scalar>(-p, r, k * (r * d(1) - p * d(0))));
  set_row3(m.vector_rate, 1, 0, Vector3<Scalar>(r, p, k * (r * d(0) + p * d(1))));
}

}  // namespace detail

/// See `Misalignment`. `d` has unit length. No allocation.
template <class Scalar>
Misalignment<Scalar> misalignment_from_z(const Vector3<Scalar>& d) noexcept {
  Misalignment<Scalar> m;
  const Scalar s = std::hypot(d(0), d(1));
  const Scalar theta = m.angle = std::atan2(s, d(2));
  detail::fill(m.angle_gradient, Scalar(0));
  // Nearer to the kink than the rounding of d its direction is unknown.
  const bool known = s > Scalar(8) * std::numeric_limits<Scalar>::epsilon();
  if (known) {
    m.angle_gradient(0) = d(2) * d(0) / s;
    m.angle_gradient(1) = d(2) * d(1) / s;
    m.angle_gradient(2) = -s;
  }

  // ξ = g (−d_y, d_x)
  const Scalar g = theta < Scalar(1e-3) ? Scalar(1) + theta * theta / Scalar(6) : theta / s;
  const bool opposite = d(2) < Scalar(0) && !known;
  m.vector(0) = opposite ? theta : -g * d(1);
  m.vector(1) = opposite ? Scalar(0) : g * d(0);

  if (d(2) < Scalar(0)) {
    detail::set_misalignment_rate(m, d, known ? -d(1) / s : Scalar(1),
                                  known ? d(0) / s : Scalar(0));
    return m;
  }
  // The turn from d to z takes v across d to v − (d + z) v_z / (1 + d_z).
  const Scalar k = Scalar(1) / (Scalar(1) + d(2));
  detail::set_row3(m.vector_rate, 0, 0, Vector3<Scalar>(Scalar(0), Scalar(-1), k * d(1)));
  detail::set_row3(m.vector_rate, 1, 0, Vector3<Scalar>(Scalar(1), Scalar(0), -k * d(0)));
  return m;
}

}  // namespace icat
