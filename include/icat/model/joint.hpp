// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Descriptions of a tree of links and joints: joint by joint, by Denavit–Hartenberg rows, or by
/// the axes at q = 0 as the papers do.
///
///     ⟨link⟩ in ⟨parent⟩ = origin · motion(q) · link
///     motion(q) = Rot(axis, q) or Trans(q axis)
///
/// Denavit–Hartenberg, θ or d the variable:
///
///     standard:          Rot(z, θ) Trans(z, d) Trans(x, a) Rot(x, α)
///     modified (Craig):  Rot(x, α) Trans(x, a) Rot(z, θ) Trans(z, d)
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "icat/core/error.hpp"
#include "icat/math/rigid_motion.hpp"

namespace icat {

/// Fixed; rotating within limits; rotating without limits; translating.
enum class JointType { fixed, revolute, continuous, prismatic };

/// The joint follows another: position = multiplier · (position of `joint`) + offset.
template <class Scalar>
struct Mimic {
  std::string joint;     ///< that it follows
  Scalar multiplier{1};  ///< 1, or rad/m, m/rad
  Scalar offset{0};      ///< rad or m
};

/// A joint and the link that it moves. Positions in rad or m.
template <class Scalar>
struct Joint {
  std::string name;                                       ///< unique
  std::string parent;                                     ///< link that carries it
  std::string link;                                       ///< link that it moves; unique
  JointType type{JointType::revolute};                    ///< kind of joint
  Pose<Scalar> origin = IdentityPose{};                   ///< pose of its frame in the parent's
  Vector3<Scalar> axis{Scalar(0), Scalar(0), Scalar(1)};  ///< unit length, on its frame
  Pose<Scalar> link_pose = IdentityPose{};                ///< of the link in the moved frame
  Scalar lower{-infinity<Scalar>};                        ///< none by default
  Scalar upper{infinity<Scalar>};                         ///< none by default
  Scalar max_velocity{infinity<Scalar>};                  ///< per s
  Scalar max_acceleration{infinity<Scalar>};              ///< per s²
  std::optional<Mimic<Scalar>> mimic{};                   ///< then it is no degree of freedom
};

/// Mass of a link.
template <class Scalar>
struct LinkMass {
  std::string link;        ///< its name
  Scalar mass;             ///< kg, ≥ 0
  Vector3<Scalar> center;  ///< centre of mass on the link, m
};

/// Which order the four factors have, see the file comment.
enum class DhConvention { standard, modified };

/// A row of a Denavit–Hartenberg table.
template <class Scalar>
struct DhRow {
  Scalar a;                             ///< m; of the link before in the modified convention
  Scalar alpha;                         ///< rad; likewise
  Scalar d;                             ///< m, at q = 0 for a prismatic joint
  Scalar theta;                         ///< rad, at q = 0 for a revolute one
  JointType type{JointType::revolute};  ///< kind of joint
  Scalar lower{-infinity<Scalar>};      ///< rad or m
  Scalar upper{infinity<Scalar>};       ///< rad or m
};

namespace detail {

/// The `number`-th of a chain, which `parent` carries.
template <class Scalar>
[[gnu::cold]] void name_in_chain(Joint<Scalar>& joint, std::size_t number,
                                 const std::string& parent, const std::string& prefix) {
  const std::string text = std::to_string(number);
  joint.name.append(prefix).append("joint").append(text);
  joint.link.append(prefix).append("link").append(text);
  joint.parent = parent;
}

}  // namespace detail

/// Joints "joint1", …, links "link1", …, all with `prefix` before their names, on the link `root`.
/// Allocates.
template <class Scalar>
[[gnu::cold]] std::vector<Joint<Scalar>> dh_chain(const std::vector<DhRow<Scalar>>& rows,
                                                  DhConvention convention,
                                                  const std::string& root = "base",
                                                  const std::string& prefix = "") {
  const Vector3<Scalar> x(Scalar(1), Scalar(0), Scalar(0)), z(Scalar(0), Scalar(0), Scalar(1));
  const Vector3<Scalar> none(Scalar(0), Scalar(0), Scalar(0));
  std::vector<Joint<Scalar>> joints(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const DhRow<Scalar>& row = rows[i];
    const Pose<Scalar> along_z =
        detail::make_pose(axis_rotation<Scalar>(z, row.theta), detail::scaled<Scalar>(z, row.d));
    const Pose<Scalar> along_x =
        detail::make_pose(axis_rotation<Scalar>(x, row.alpha), detail::scaled<Scalar>(x, row.a));
    Joint<Scalar>& joint = joints[i];
    detail::name_in_chain(joint, i + 1, i == 0 ? root : joints[i - 1].link, prefix);
    joint.type = row.type;
    if (convention == DhConvention::standard) {
      joint.link_pose = detail::compose(along_z, along_x);
    } else {
      joint.origin = detail::compose(along_x, along_z);
    }
    joint.lower = row.lower;
    joint.upper = row.upper;
  }
  return joints;
}

/// A joint of a chain by its axis at q = 0, components on the chain's base.
template <class Scalar>
struct JointAxis {
  JointType type{JointType::revolute};                     ///< kind of joint
  Vector3<Scalar> axis{Scalar(0), Scalar(0), Scalar(1)};   ///< unit length
  Vector3<Scalar> point{Scalar(0), Scalar(0), Scalar(0)};  ///< any point on the axis, m
  Scalar lower{-infinity<Scalar>};                         ///< rad or m
  Scalar upper{infinity<Scalar>};                          ///< rad or m
};

/// A chain of `Dof` joints by their axes at q = 0 and the end-effector's pose there.
template <class Scalar, int Dof>
struct SerialArm {
  std::array<JointAxis<Scalar>, static_cast<std::size_t>(Dof)> joints;  ///< from base to tip
  Pose<Scalar> end_effector = IdentityPose{};  ///< ⟨e⟩ in the base at q = 0
};

namespace detail {

/// `axes_chain` with room behind it for the joints of a larger robot.
template <class Scalar, int Dof>
[[gnu::cold]] std::vector<Joint<Scalar>> axes_chain(const SerialArm<Scalar, Dof>& arm,
                                                    const std::string& root,
                                                    const std::string& prefix, std::size_t more) {
  const Matrix3<Scalar> parallel = identity<Matrix3<Scalar>>(3);
  Vector3<Scalar> before(Scalar(0), Scalar(0), Scalar(0));
  std::vector<Joint<Scalar>> joints(arm.joints.size() + 1 + more);
  std::size_t i = 0;
  for (const JointAxis<Scalar>& at : arm.joints) {
    Joint<Scalar>& joint = joints[i];
    name_in_chain(joint, i + 1, i == 0 ? root : joints[i - 1].link, prefix);
    ++i;
    joint.type = at.type;
    joint.origin = make_pose(parallel, minus(at.point, before));
    joint.axis = at.axis;
    joint.lower = at.lower;
    joint.upper = at.upper;
    before = at.point;
  }
  Joint<Scalar>& tip = joints[i];
  tip.name.append(prefix).append("end_effector");
  tip.link = tip.name;
  tip.parent = i == 0 ? root : joints[i - 1].link;
  tip.type = JointType::fixed;
  tip.origin = make_pose(rotation(arm.end_effector), minus(origin(arm.end_effector), before));
  return joints;
}

}  // namespace detail

/// Joints "joint1", …, links "link1", …, all with `prefix` before their names, on the link `root`.
/// At q = 0 every link's frame is parallel to the root's, its origin the point of its joint. The
/// last one is "end_effector", fixed. Allocates.
template <class Scalar, int Dof>
[[gnu::cold]] std::vector<Joint<Scalar>> axes_chain(const SerialArm<Scalar, Dof>& arm,
                                                    const std::string& root = "base",
                                                    const std::string& prefix = "") {
  return detail::axes_chain(arm, root, prefix, 0);
}

}  // namespace icat
