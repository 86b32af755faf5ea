// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The electric 7-DoF arm of the MARIS project, its pose under the vehicle, and the vehicle's
/// thrusters.
#pragma once

#include <vector>

#include "icat/model/joint.hpp"
#include "icat/model/thruster.hpp"

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

/// Eight thrusters of the vehicle R2: 0 to 3 horizontal, front right, front left, back left, back
/// right, at (±0.45, ±0.30) m, turned by −45°, 45°, 135°, −135° from x about z; 4 to 7 vertical at
/// the same places in this order, positive thrust downwards. Published are four and four [MARIS];
/// places, angles and limits are ours. The horizontal ones reach 170 N along an axis, as the forces
/// of [Coop, V-B], and 127 N m.
/// @param maximum, minimum  of each, N
template <class Scalar>
[[gnu::cold]] std::vector<Thruster<Scalar>> r2_thrusters(Scalar maximum = Scalar(60),
                                                         Scalar minimum = Scalar(-60)) {
  // Signs of x and y of the place, of x and y of the direction.
  constexpr int signs[4][4] = {{1, 1, 1, -1}, {1, -1, 1, 1}, {-1, -1, -1, 1}, {-1, 1, -1, -1}};
  const auto length = static_cast<Scalar>(0.45), width = static_cast<Scalar>(0.30);
  std::vector<Thruster<Scalar>> thrusters;
  for (const bool horizontal : {true, false}) {
    for (const auto& sign : signs) {
      Thruster<Scalar> t;
      t.position(0) = static_cast<Scalar>(sign[0]) * length;
      t.position(1) = static_cast<Scalar>(sign[1]) * width;
      t.direction(0) = static_cast<Scalar>(horizontal ? sign[2] : 0);
      t.direction(1) = static_cast<Scalar>(horizontal ? sign[3] : 0);
      t.direction(2) = static_cast<Scalar>(horizontal ? 0 : 1);
      t.minimum = minimum;
      t.maximum = maximum;
      thrusters.push_back(t);
    }
  }
  return thrusters;
}

}  // namespace icat
