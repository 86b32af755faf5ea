// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Robots of other shapes: a fixed arm, an arm on wheels or on the surface, a torso with two arms,
/// and a robot of somebody else's whose columns stand in another order.
#pragma once

#include <icat/model/kinematic_tree.hpp>
#include <icat/model/maris.hpp>

#include "support/states.hpp"

namespace testing_support {

using Tree = icat::KinematicTree<double>;
using FixedArm = icat::KinematicTree<double, 7>;

/// A bent arm, away from its limits.
inline Eigen::VectorXd bent_arm() {
  Eigen::VectorXd q(7);
  q << 0.2, 0.7, -0.1, -1.6, 0.3, 0.9, 0;
  return q;
}

/// The MARIS arm, bolted down and bent; frame "end_effector".
inline FixedArm fixed_arm() {
  FixedArm robot({.joints = icat::axes_chain(icat::maris_arm<double>())});
  if (robot.update(bent_arm()) != icat::Status::ok) std::abort();
  return robot;
}

/// The MARIS arm upright on a base, somewhere; frames "platform", "end_effector".
inline Tree mobile_arm(const icat::Base<double>& base) {
  Tree::Description description{.joints = icat::axes_chain(icat::maris_arm<double>(), "arm_base"),
                                .base = base};
  description.joints.push_back({"mount", "platform", "arm_base", icat::JointType::fixed,
                                make_pose<double>(0.2, 0.05, 0.4, 0, 0, 0.5)});
  Tree robot(description);
  if (robot.update(bent_arm(), make_pose<double>(1, -2, 0, 0, 0, 0.8)) != icat::Status::ok) {
    std::abort();
  }
  return robot;
}

/// Two MARIS arms on one turning torso, 15 columns; joints "torso", "left_joint1" …, frames
/// "left_end_effector", "right_end_effector".
inline Tree torso() {
  Tree::Description description;
  description.joints.push_back({"torso", "ground", "chest"});
  for (const std::string side : {"left", "right"}) {
    const double y = side == "left" ? 0.3 : -0.3;
    for (auto joint : icat::axes_chain(icat::maris_arm<double>(), "arm_base")) {
      for (std::string* name : {&joint.name, &joint.parent, &joint.link})
        *name = side + "_" + *name;
      description.joints.push_back(joint);
    }
    description.joints.push_back({side + "_mount", "chest", side + "_arm_base",
                                  icat::JointType::fixed, make_pose<double>(0, y, 1, -y, 0, 0)});
  }
  Tree robot(description);
  Eigen::VectorXd q(15);
  q << 0.1, bent_arm(), bent_arm();
  if (robot.update(q) != icat::Status::ok) std::abort();
  return robot;
}

/// A robot of somebody else's with all that controllers ask for: the tree given, but with ẏ = [v;
/// q̇], and Jacobians that are values.
template <class T>
class BaseFirst {
 public:
  using Scalar = typename T::Scalar;
  static constexpr int size = T::size;
  using Velocity = icat::Vector<Scalar, size>;

  explicit BaseFirst(const T& tree) : tree_(tree), joints_(tree.joints()) {
    for (auto& joint : joints_) joint.column += tree.base_columns().count;
  }
  icat::Index dof() const { return tree_.dof(); }

  icat::FrameId frame(std::string_view name) const { return tree_.frame(name); }
  icat::Pose<Scalar> pose(icat::FrameId frame) const noexcept { return tree_.pose(frame); }
  Eigen::Matrix<Scalar, 6, size> jacobian(icat::FrameId frame) const noexcept {
    const auto& J = tree_.jacobian(frame);
    const icat::Index k = base_columns().count;
    Eigen::Matrix<Scalar, 6, size> permuted(6, dof());
    permuted << J.rightCols(k), J.leftCols(dof() - k);
    return permuted;
  }

  const std::vector<icat::JointInfo<Scalar>>& joints() const noexcept { return joints_; }
  Scalar position(icat::Index i) const noexcept { return tree_.position(i); }

  icat::FrameId base() const noexcept { return tree_.base(); }
  icat::ColumnRange base_columns() const noexcept { return {0, tree_.base_columns().count}; }
  const auto& base_motion() const noexcept { return tree_.base_motion(); }

  /// A velocity of the tree's as one of this robot's.
  Velocity permuted(const Velocity& velocity) const {
    const icat::Index k = base_columns().count;
    Velocity out(dof());
    out << velocity.tail(k), velocity.head(dof() - k);
    return out;
  }

 private:
  T tree_;
  std::vector<icat::JointInfo<Scalar>> joints_;
};
static_assert(icat::MobileRobot<BaseFirst<Tree>> && icat::JointedRobot<BaseFirst<Tree>>);

/// ẏ held for `dt`: the state of a tree moves on.
template <class T, class V>
icat::Status drive(T& robot, const V& velocity, double time) {
  using Scalar = typename T::Scalar;
  const Scalar dt = static_cast<Scalar>(time);
  const icat::ColumnRange base = robot.base_columns();
  const icat::Vector<Scalar, Eigen::Dynamic> q =
      robot.q() + dt * velocity.head(robot.dof() - base.count);
  const icat::Vector6<Scalar> twist = robot.base_motion() * velocity.tail(base.count);
  return robot.update(q, icat::integrate(robot.pose(robot.base()), twist, dt));
}

/// `pose` moved by (x, y, z), m.
template <class Scalar>
icat::Pose<Scalar> moved(icat::Pose<Scalar> pose, double x, double y, double z) {
  pose.translation() += icat::Vector3<Scalar>(Scalar(x), Scalar(y), Scalar(z));
  return pose;
}

/// What `f` throws.
template <class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "no exception";
}

}  // namespace testing_support
