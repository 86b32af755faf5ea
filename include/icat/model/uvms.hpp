// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The papers' robot, an underwater vehicle-manipulator system: a free vehicle with an arm, a
/// camera and a tool, as a `KinematicTree`.
///
/// ẏ = [q̇; v], v of ⟨v⟩ with respect to ⟨0⟩, components on ⟨v⟩ [Coop, Eq. (2)]. The vehicle's pose
/// is a rotation and a position, so no attitude is singular.
#pragma once

#include "icat/model/kinematic_tree.hpp"

namespace icat {

/// Where things are.
template <class Scalar>
struct UvmsMounts {
  Pose<Scalar> arm = IdentityPose{};     ///< the arm's base in ⟨v⟩
  Pose<Scalar> camera = IdentityPose{};  ///< in ⟨v⟩; it looks along its z axis
  Pose<Scalar> tool = IdentityPose{};    ///< in the end-effector's frame
};

namespace detail {

/// What `uvms` is made of, for a tree of static or dynamic size.
template <class Tree, class Scalar, int Dof>
[[gnu::cold]] typename Tree::Description uvms_description(const SerialArm<Scalar, Dof>& arm,
                                                          const UvmsMounts<Scalar>& mounts) {
  typename Tree::Description description{.joints = axes_chain(arm, "arm_base", "", 3),
                                         .base = Base<Scalar>::free()};
  Joint<Scalar>* joint = description.joints.data() + description.joints.size();
  const auto mount = [&](const char* parent, const char* link, const Pose<Scalar>& pose) {
    --joint;
    joint->name = joint->link = link;
    joint->parent = parent;
    joint->type = JointType::fixed;
    joint->origin = pose;
  };
  mount("vehicle", "camera", mounts.camera);
  mount("end_effector", "tool", mounts.tool);
  mount("vehicle", "arm_base", mounts.arm);
  return description;
}

}  // namespace detail

/// A vehicle-manipulator with `Dof` joints and `Dof` + 6 columns. Its frames: "vehicle",
/// "arm_base", "link1" …, "end_effector", "tool", "camera".
/// @throws std::invalid_argument on a bad arm or mount. Allocates.
template <class Scalar, int Dof>
[[gnu::cold]] KinematicTree<Scalar, Dof + 6> uvms(const SerialArm<Scalar, Dof>& arm,
                                                  const UvmsMounts<Scalar>& mounts = {}) {
  using Tree = KinematicTree<Scalar, Dof + 6>;
  return Tree(detail::uvms_description<Tree>(arm, mounts));
}

}  // namespace icat
