// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The electric 7-DoF arm of the MARIS project, and where it sits under the vehicle.
#pragma once

#include "icat/model/joint.hpp"

namespace icat {

/// Seven revolute joints with their limits. At q = 0 the arm is stretched along z of ⟨b⟩ and all
/// frames are parallel to ⟨b⟩.
template <class Scalar>
[[gnu::cold]] SerialArm<Scalar, 7> maris_arm() {
  const Vector3<Scalar> y(Scalar(0), Scalar(1), Scalar(0)), z(Scalar(0), Scalar(0), Scalar(1));
  const auto at = [](double px, double pz) {
    return Vector3<Scalar>(static_cast<Scalar>(px), Scalar(0), static_cast<Scalar>(pz));
  };
  const auto joint = [](const Vector3<Scalar>& axis, const Vector3<Scalar>& point, double lower,
                        double upper) {
    return JointAxis<Scalar>{JointType::revolute, axis, point, static_cast<Scalar>(lower),
                             static_cast<Scalar>(upper)};
  };
  const Pose<Scalar> end_effector =
      detail::make_pose(detail::identity<Matrix3<Scalar>>(3), at(-0.1455, 1.2665));
  return {{joint(z, at(0, 0), -2.9, 2.9),               //
           joint(y, at(0, 0.283), -1.6, 1.65),          //
           joint(z, at(0, 0.283), -2.9, 2.9),           //
           joint(y, at(-0.1455, 0.7145), -2.95, 0.01),  //
           joint(z, at(-0.1455, 0.7145), -2.9, 2.9),    //
           joint(y, at(-0.1455, 1.1345), -1.65, 1.25),  //
           joint(z, at(-0.1455, 1.1345), -2.8, 2.8)},
          end_effector};
}

/// The link whose origin is the elbow.
inline constexpr const char* maris_elbow = "link4";

/// ⟨b⟩ in ⟨v⟩, of which z points down: under the hull, turned by π about z. (Published with z up
/// as (0.167, 0, −0.43) m, turned by π about x and z.)
template <class Scalar>
Pose<Scalar> maris_arm_mount() {
  auto rotation = detail::identity<Matrix3<Scalar>>(3);
  rotation(0, 0) = rotation(1, 1) = Scalar(-1);
  return detail::make_pose(
      rotation, Vector3<Scalar>(static_cast<Scalar>(0.167), Scalar(0), static_cast<Scalar>(0.43)));
}

}  // namespace icat
