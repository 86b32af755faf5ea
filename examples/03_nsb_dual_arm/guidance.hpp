// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Two ways to guide the dual-arm vehicle along a line with the same tasks, gains and velocity
/// bounds:
///
/// - `LeaderFollower`, [NSB, Eq. (33), (34)]: ζ₁ = [u v r q̇₁] and ζ₂ = q̇₂ solved separately by
///   null-space projection, each component then cut off at its bound, Eq. (36);
/// - `WholeBody`: one iCAT hierarchy over all eight, joint limits on top.
#pragma once

#include <icat/task/objective.hpp>
#include <icat/tpik/null_space_guidance.hpp>
#include <icat/tpik/tpik.hpp>
#include <numbers>
#include <vector>

#include "dual_arm.hpp"

namespace nsb {

inline constexpr double degree = std::numbers::pi / 180;
using Joints = icat::Vector<double, 5>;  ///< q₁, q₂

/// [NSB, Eq. (36)].
inline Velocity velocity_limits() {
  Velocity limits = Velocity::Constant(10 * degree);
  limits.head<3>() << 3, 2, 3 * degree;
  return limits;
}

/// The reference of σ₁₁: a point that goes along a line at constant speed and waits at its end, and
/// an orientation normal to the line, to its left.
struct Line {
  Vector2 start, end;  ///< m
  double speed;        ///< m/s

  Vector2 direction() const { return (end - start).normalized(); }
  double duration() const { return (end - start).norm() / speed; }
  Vector3 pose(double t) const {
    Vector3 pose;
    pose << start + direction() * speed * std::min(t, duration()),
        std::atan2(direction().y(), direction().x()) + std::numbers::pi / 2;
    return pose;
  }
  Vector3 rate(double t) const {
    Vector3 rate = Vector3::Zero();
    if (t < duration()) rate.head<2>() = speed * direction();
    return rate;
  }
};

/// The five tasks at one moment, with e = σ_d − σ and σ̇_d + Λe of each, Λ of [NSB, Eq. (35)].
struct Tasks {
  TaskValue<3> tool;
  TaskValue<1> orientation, distance, joint;
  FieldOfView view;
  icat::Vector<double, 7> error, rate;  ///< σ₁₁ (3 rows), σ₁₂, σ₁₃, σ₂₁, σ₂₂

  Tasks(const Dimensions& d, const State& s, const Line& line, double vertical, double t)
      : tool(tool_pose(d, s)),
        orientation(vehicle_orientation(s)),
        distance(vertical_distance(d, s)),
        joint(first_joint(s)),
        view(field_of_view(d, s)) {
    error << line.pose(t) - tool.value, -orientation.value, vertical - distance.value(0),
        -view.value, std::numbers::pi / 2 - joint.value(0);
    rate << line.rate(t) + 1 * error.head<3>(), 3 * error(3), 2 * error(4),
        1 * view.weight * error(5), 3 * error(6);
  }
};

class LeaderFollower {
 public:
  /// ẏ, saturated.
  Velocity operator()(const Tasks& k, const State&) noexcept {
    leader_.reset();
    follower_.reset();
    add(leader_, k.tool.jacobian.leftCols<6>(), k.rate.head<3>());
    add(leader_, k.orientation.jacobian.leftCols<6>(), k.rate.segment<1>(3));
    add(leader_, k.distance.jacobian.leftCols<6>(), k.rate.segment<1>(4));
    add(follower_, k.view.jacobian.rightCols<2>(), k.rate.segment<1>(5));
    add(follower_, k.joint.jacobian.rightCols<2>(), k.rate.segment<1>(6));
    Velocity y;
    y << leader_.velocity(), follower_.velocity();
    return y.cwiseMax(-velocity_limits()).cwiseMin(velocity_limits());
  }
  icat::Status status() const noexcept {
    const icat::Status leader = leader_.report().status();
    return leader == icat::Status::ok ? follower_.report().status() : leader;
  }

 private:
  template <class Solver, class J, class R>
  static void add(Solver& solver, const J& jacobian, const R& rate) noexcept {
    (void)solver.add_task(jacobian, rate);  // A refusal is in the report, see `status`.
  }
  icat::NullSpaceGuidance<double, 6> leader_;
  icat::NullSpaceGuidance<double, 2> follower_;
};

class WholeBody {
 public:
  /// Limits of the five joints, active within `margin` of them, rad.
  WholeBody(const Joints& lower, const Joints& upper, double margin)
      : tpik_({.bounds = {-velocity_limits(), velocity_limits()}}) {
    limits_jacobian_.rightCols<5>().setIdentity();
    for (int j = 0; j < 5; ++j) {
      limits_.push_back(icat::Objective<double>::between(lower(j), upper(j), margin));
    }
  }

  /// ẏ, within the same bounds.
  Velocity operator()(const Tasks& k, const State& s) noexcept {
    Joints q, activation, rate;
    q << s.q1, s.q2;
    for (int j = 0; j < 5; ++j) {
      const auto& limit = limits_[static_cast<std::size_t>(j)];
      activation(j) = limit.activation(q(j));
      rate(j) = 0.5 * (limit.target(q(j)) - q(j));
    }
    tpik_.reset();
    add(limits_jacobian_, activation, rate);
    add(k.tool.jacobian, Vector3::Ones(), k.rate.head<3>());
    add(k.orientation.jacobian, one_, k.rate.segment<1>(3));
    add(k.distance.jacobian, one_, k.rate.segment<1>(4));
    add(k.view.jacobian, one_, k.rate.segment<1>(5));
    add(k.joint.jacobian, one_, k.rate.segment<1>(6));
    (void)tpik_.minimize_velocity();
    return tpik_.velocity();
  }
  icat::Status status() const noexcept { return tpik_.report().status(); }

 private:
  template <class J, class A, class R>
  void add(const J& jacobian, const A& activation, const R& rate) noexcept {
    (void)tpik_.add_level(jacobian, activation, rate);  // A refusal is in the report.
  }
  icat::Tpik<double, 8> tpik_;
  std::vector<icat::Objective<double>> limits_;
  Eigen::Matrix<double, 5, 8> limits_jacobian_ = Eigen::Matrix<double, 5, 8>::Zero();
  const icat::Vector<double, 1> one_ = icat::Vector<double, 1>::Ones();
};

}  // namespace nsb
