// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The characteristic length L: rows in metres are divided by it, so that singular values, and what
/// they are compared with, do not depend on the robot's size. For a frame
///
///     L = Σ_k ‖x_{k−1} − x_k‖,  x₀ the frame's origin,
///         x_k the point nearest to x_{k−1} on the axis of the k-th joint from the frame to the
///         base
///
/// That is the frame's reach: the lever of any joint is at most as long. A revolute joint moves all
/// x before it and leaves its own unchanged, so L does not depend on the state. Prismatic joints
/// count with their present position. Khan and Angeles (2006) choose the L that minimizes a
/// condition number; the reach needs no search, and that of the papers' arm, for which their σ_t is
/// chosen, is 1.1 m.
#pragma once

#include "icat/core/list.hpp"
#include "icat/math/spatial_algebra.hpp"
#include "icat/model/robot.hpp"

namespace icat {
namespace detail {

/// The way from a frame to the base, on which joints are passed one by one.
template <class Scalar>
struct ReachWay {
  Vector3<Scalar> at{Scalar(0), Scalar(0), Scalar(0)};  ///< x_k, from the frame's origin
  Scalar length{0};
  bool slides{false};  ///< a joint on it is a slide

  /// The next joint, by its column of the frame's Jacobian; zero where it is not on the way.
  void pass(const Vector3<Scalar>& linear, const Vector3<Scalar>& angular) noexcept {
    const Scalar square = dot(angular, angular);
    if (!(square > Scalar(1e-12))) {
      slides = slides || dot(linear, linear) > Scalar(0);
      return;
    }
    // From x to the axis through −v × ω / ω², along ω.
    const Vector3<Scalar> to = minus(scaled(cross(linear, angular), Scalar(-1) / square), at);
    const Vector3<Scalar> across = plus(to, -dot(angular, to) / square, angular);
    length += norm(across);
    at = plus(at, across);
  }
};

}  // namespace detail

/// L of a frame in metres, see the file comment. 0 where no joint turns the frame, or less than
/// 1 mm away from it, and for a robot without joints. At most 1 where a slide or the base
/// translates the frame: their columns are in m/s, of size 1, and divided by more they would be
/// small. Columns of the joints on the way from the base to the frame are in that order, as they
/// are in every tree. For configuration.
template <FramedRobot R>
[[gnu::cold]] typename R::Scalar characteristic_length(const R& robot, FrameId frame) {
  using Scalar = typename R::Scalar;
  detail::ReachWay<Scalar> way;
  if constexpr (JointedRobot<R>) {
    const auto visit = [&way](Index, const Vector3<Scalar>& linear,
                              const Vector3<Scalar>& angular) { way.pass(linear, angular); };
    if constexpr (requires { robot.for_each_joint_of(frame, visit); }) {
      robot.for_each_joint_of(frame, visit);
    } else {
      List<bool> joint(static_cast<std::size_t>(robot.dof()));
      for (const auto& info : robot.joints()) joint[static_cast<std::size_t>(info.column)] = true;
      const auto& J = robot.jacobian(frame);
      for (Index c = robot.dof(); c-- > 0;) {
        if (!joint[static_cast<std::size_t>(c)]) continue;
        visit(c, detail::column3(J, 0, c), detail::column3(J, 3, c));
      }
    }
  }
  if constexpr (MobileRobot<R>) {
    const auto& B = robot.base_motion();
    for (Index j = 0; j < B.cols(); ++j) {
      for (Index i = 0; i < 3; ++i) way.slides = way.slides || B(i, j) != Scalar(0);
    }
  }
  if (!(way.length >= Scalar(1e-3))) return Scalar(0);
  return way.slides && way.length > Scalar(1) ? Scalar(1) : way.length;
}

}  // namespace icat
