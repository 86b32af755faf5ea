// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The planar vehicle with two arms of [NSB, II] and its five tasks [NSB, III].
///
///     η_b = [x y ψ]              the vehicle, in the inertial plane; y points up
///     ẏ   = [u v r q̇₁ q̇₂]        u, v on the vehicle frame ⟨b⟩; ζ₁ = its first six, ζ₂ = its last
///     two η_i^b = k_i(q_i)           end effectors in ⟨b⟩, Eq. (4), (5) η_i = η_b + R(ψ) k_i(q_i)
///     in the inertial frame, Eq. (2), (3)
///
/// **Errata.** Eq. (3), (23): `q12` in the second arm is `q22`. Eq. (13): J₁₂ has six columns.
/// Eq. (20): the rotation's (1,2) entry is `−sin`. Eq. (22): a, a_des and p_e are taken in ⟨b⟩, as
/// J_p and J_o are.
///
/// A Jacobian has all eight columns. The paper's are the first six (leader) or the last two
/// (follower); one solver for the whole body takes all.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <icat/core/types.hpp>

namespace nsb {

using Vector2 = icat::Vector<double, 2>;
using Vector3 = icat::Vector3<double>;
using Velocity = icat::Vector<double, 8>;

/// Of the vehicle and the links, m. The paper gives none.
struct Dimensions {
  double length = 1.2, height = 0.5;
  Vector3 arm1{0.4, 0.4, 0.4};
  Vector2 arm2{0.5, 0.4};
};

struct State {
  Vector3 vehicle = Vector3::Zero();  ///< x (m), y (m), ψ (rad)
  Vector3 q1 = Vector3::Zero();       ///< rad
  Vector2 q2 = Vector2::Zero();       ///< rad
};

/// σ (m rows) and its Jacobian (m × 8).
template <int Rows>
struct TaskValue {
  icat::Vector<double, Rows> value;
  Eigen::Matrix<double, Rows, 8> jacobian = Eigen::Matrix<double, Rows, 8>::Zero();
};

inline Eigen::Matrix2d rotation(double angle) { return Eigen::Rotation2Dd(angle).matrix(); }
/// A quarter turn, dR/dψ = R S.
inline Vector2 turned(const Vector2& v) { return {-v.y(), v.x()}; }

/// Joints and end effector of a planar arm in ⟨b⟩, one for each column.
template <int Links>
Eigen::Matrix<double, 2, Links + 1> points(const Vector2& base,
                                           const icat::Vector<double, Links>& links,
                                           const icat::Vector<double, Links>& q) {
  Eigen::Matrix<double, 2, Links + 1> p;
  p.col(0) = base;
  double angle = 0;
  for (int j = 0; j < Links; ++j) {
    angle += q(j);
    p.col(j + 1) = p.col(j) + links(j) * Vector2(std::cos(angle), std::sin(angle));
  }
  return p;
}
inline auto arm1_points(const Dimensions& d, const Vector3& q) {
  return points<3>({-d.length / 2, d.height / 2}, d.arm1, q);
}
inline auto arm2_points(const Dimensions& d, const Vector2& q) {
  return points<2>({d.length / 2, d.height / 2}, d.arm2, q);
}
/// Velocity of the end effector, the last point, over the joint velocities, in ⟨b⟩.
template <int Points>
Eigen::Matrix<double, 2, Points - 1> position_jacobian(
    const Eigen::Matrix<double, 2, Points>& points) {
  Eigen::Matrix<double, 2, Points - 1> J;
  for (int j = 0; j < Points - 1; ++j) {
    J.col(j) = turned(Vector2(points.col(Points - 1) - points.col(j)));
  }
  return J;
}

/// σ₁₁ = η₁, position (m) and angle (rad) of end effector 1 in the inertial frame, Eq. (8)–(10).
inline TaskValue<3> tool_pose(const Dimensions& d, const State& s) {
  const auto p = arm1_points(d, s.q1);
  const Eigen::Matrix2d R = rotation(s.vehicle.z());
  TaskValue<3> t;
  t.value << s.vehicle.head<2>() + R * p.col(3), s.vehicle.z() + s.q1.sum();
  t.jacobian.topLeftCorner<2, 2>() = R;
  t.jacobian.block<2, 1>(0, 2) = R * turned(p.col(3));
  t.jacobian.block<2, 3>(0, 3) = R * position_jacobian<4>(p);
  t.jacobian.block<1, 4>(2, 2).setOnes();
  return t;
}

/// σ₁₂ = ψ, rad, Eq. (11)–(13).
inline TaskValue<1> vehicle_orientation(const State& s) {
  TaskValue<1> t;
  t.value << s.vehicle.z();
  t.jacobian(2) = 1;
  return t;
}

/// σ₁₃ = y_ee1 − y_b, m, Eq. (14)–(16).
inline TaskValue<1> vertical_distance(const Dimensions& d, const State& s) {
  const TaskValue<3> tool = tool_pose(d, s);
  TaskValue<1> t;
  t.value << tool.value.y() - s.vehicle.y();
  t.jacobian.rightCols<6>() = tool.jacobian.block<1, 6>(1, 2);
  return t;
}

/// ε of [NSB, Remark 2].
inline constexpr double field_of_view_epsilon = 1e-3;

struct FieldOfView : TaskValue<1> {
  double weight;  ///< min(1, ‖a_des − a‖/ε)
};

/// σ₂₁ = ‖a_des − a‖, Eq. (17)–(23): a is where arm 2 points, a_des where end effector 1 is.
///
/// Remark 2: the Jacobian divides by ε where the norm is smaller. J₂₁ then passes through 0 instead
/// of jumping from one sign to the other, but J₂₁⁺ grows as J₂₁ shrinks: a rate of −λσ₂₁ would make
/// the arm chatter with ±λε. So give the rate the factor that the Jacobian has, `weight`: J⁺ rate
/// is then what it is without Remark 2, and smooth.
inline FieldOfView field_of_view(const Dimensions& d, const State& s) {
  const auto p1 = arm1_points(d, s.q1);
  const auto p2 = arm2_points(d, s.q2);
  const Vector2 p_e = p1.col(3) - p2.col(2);
  const double range = std::max(p_e.norm(), 1e-9);  // the end effectors in one place: no direction
  const Vector2 a_des = p_e / range;
  const double angle = s.q2.sum();
  const Vector2 a{std::cos(angle), std::sin(angle)};

  FieldOfView t;
  Vector2 difference = a_des - a;
  t.value << difference.norm();
  t.weight = std::min(1.0, t.value(0) / field_of_view_epsilon);
  // Below rounding the difference has no direction. J = 0 would hand its null space to the next
  // task for a cycle; so the limit, with what is left of its length.
  constexpr double rounding = 1e-12;
  if (t.value(0) < rounding) difference = rounding * turned(a);
  const Vector2 unit = difference / std::max(t.value(0), field_of_view_epsilon);
  // In the plane −S(a_des) S(p_e)⁺ x = −(I − a_des a_desᵀ) x / ‖p_e‖, and S(a) [0 0 1]ᵀ =
  // −turned(a).
  const Vector2 along = (unit - a_des * a_des.dot(unit)) / range;
  t.jacobian.segment<3>(3) = along.transpose() * position_jacobian<4>(p1);
  t.jacobian.tail<2>() = -along.transpose() * position_jacobian<3>(p2);
  t.jacobian.tail<2>().array() -= unit.dot(turned(a));
  return t;
}

/// σ₂₂ = q₂₁, rad, Eq. (24)–(26).
inline TaskValue<1> first_joint(const State& s) {
  TaskValue<1> t;
  t.value << s.q2(0);
  t.jacobian(6) = 1;
  return t;
}

/// The state after `dt` seconds of velocity ẏ, second order in dt.
inline State moved(const State& s, const Velocity& y, double dt) {
  State next;
  next.vehicle.head<2>() =
      s.vehicle.head<2>() + rotation(s.vehicle.z() + y(2) * dt / 2) * y.head<2>() * dt;
  next.vehicle.z() = s.vehicle.z() + y(2) * dt;
  next.q1 = s.q1 + y.segment<3>(3) * dt;
  next.q2 = s.q2 + y.tail<2>() * dt;
  return next;
}

}  // namespace nsb
