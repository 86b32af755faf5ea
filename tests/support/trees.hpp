// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A tree with everything in it that a robot can have, states for it, and central differences.
#pragma once

#include <gtest/gtest.h>

#include <icat/math/numerical_differentiation.hpp>
#include <icat/model/kinematic_tree.hpp>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/sanitized.hpp"
#include "support/states.hpp"

namespace testing_support {

/// A scalar type and a size, for typed tests.
template <class S, int N>
struct Kind {
  using Scalar = S;
  static constexpr int size = N;
  template <int Columns>
  using Tree = icat::KinematicTree<S, N == Eigen::Dynamic ? N : Columns>;
};
/// Each takes seconds to compile: with sanitizers each scalar and each size once, not their
/// product.
using AllKinds =
    std::conditional_t<sanitized, testing::Types<Kind<float, Eigen::Dynamic>, Kind<double, 1>>,
                       testing::Types<Kind<float, 1>, Kind<float, Eigen::Dynamic>, Kind<double, 1>,
                                      Kind<double, Eigen::Dynamic>>>;

/// The text of the error that `f` ends in.
template <class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "no exception";
}

/// `base` in ⟨0⟩ and a position for each joint.
struct TreeState {
  std::string name;
  Eigen::VectorXd q;
  icat::Pose<double> base;
};

/// Positions of the joints and columns of the base moved by `y`, from the state `s`.
template <class Tree, class Y>
void displace(Tree& tree, const TreeState& s, const Y& y) {
  using S = typename Tree::Scalar;
  const icat::Index joints = static_cast<icat::Index>(tree.joints().size());
  const icat::Index k = tree.base_columns().count;
  const Eigen::Matrix<S, Eigen::Dynamic, 1> q = s.q.cast<S>() + y.head(joints);
  icat::Vector6<S> twist = icat::Vector6<S>::Zero();
  for (icat::Index j = 0; j < k; ++j) {
    twist += tree.base_motion().col(j) * y(tree.base_columns().first + j);
  }
  const icat::Pose<S> base = s.base.cast<S>();
  const auto status = tree.update(q, k == 0 ? base : icat::integrate(base, twist, S(1)));
  if (status != icat::Status::ok) throw std::runtime_error(icat::describe(status));
}
template <class Tree>
void place(Tree& tree, const TreeState& s) {
  displace(tree, s, Eigen::Matrix<typename Tree::Scalar, Eigen::Dynamic, 1>::Zero(tree.dof()));
}

/// ∂ `value(tree)` / ∂ẏ at the state `s`.
template <class Tree, class F>
Eigen::Matrix<typename Tree::Scalar, Eigen::Dynamic, Eigen::Dynamic> differentiate(
    Tree& tree, const TreeState& s, F&& value) {
  using Y = Eigen::Matrix<typename Tree::Scalar, Eigen::Dynamic, 1>;
  const auto J = icat::central_difference(
      [&](const Y& y) {
        displace(tree, s, y);
        return value(tree);
      },
      Y(Y::Zero(tree.dof())));
  place(tree, s);
  return J;
}

/// Central differences: truncation h² and rounding ε/h, both ε^{2/3} at the default step, times the
/// derivatives' size.
template <class S>
const S difference_tolerance = S(30) * std::pow(std::numeric_limits<S>::epsilon(), S(2) / S(3));

/// `count` roundings of numbers of order 1.
template <class S>
constexpr S roundings(int count) {
  return S(count) * std::numeric_limits<S>::epsilon();
}

/// A free torso on a lift and a waist that turns without end, with two arms (6R like the first six
/// joints of the MARIS arm, singular at 0; and RRPR), a head with a camera, and a gripper of three
/// fingers, two of which are mimics. 14 joints and the columns of `base`.
///
///     pelvis ─ torso ─ chest ┬ left1 … left6 ─ left_hand ┬ finger1
///                            │                           ├ finger2 (mimics 1)
///                            │                           └ finger3 (mimics 2)
///                            ├ right1 … right4 ─ right_hand
///                            └ head ─ camera
template <class S>
std::vector<icat::Joint<S>> torso_joints() {
  using V = icat::Vector3<S>;
  using icat::JointType;
  const V x = V::UnitX(), y = V::UnitY(), z = V::UnitZ(), oblique(S(0.6), S(0), S(0.8));
  const auto at = [](double px, double py, double pz) { return make_pose<S>(px, py, pz, 0, 0, 0); };
  std::vector<icat::Joint<S>> joints;
  const auto add = [&](const char* name, const char* parent, const char* link, JointType type,
                       const icat::Pose<S>& origin, const V& axis, double lower,
                       double upper) -> icat::Joint<S>& {
    joints.push_back({.name = name,
                      .parent = parent,
                      .link = link,
                      .type = type,
                      .origin = origin,
                      .axis = axis,
                      .lower = S(lower),
                      .upper = S(upper)});
    return joints.back();
  };
  const auto R = JointType::revolute, P = JointType::prismatic, F = JointType::fixed;
  add("lift", "pelvis", "torso", P, make_pose<S>(0.1, 0, -0.3, 0.1, -0.2, 0.3), -z, 0, 0.4);
  add("waist", "torso", "chest", JointType::continuous, make_pose<S>(0, 0.02, -0.3, 0.1, 0, 0), z,
      0, 0);
  add("left1", "chest", "left1", R, make_pose<S>(0.1, -0.25, -0.1, 0.4, 0.3, -0.2), z, -2.9, 2.9);
  add("left2", "left1", "left2", R, at(0, 0, 0.283), y, -1.6, 1.65);
  add("left3", "left2", "left3", R, at(0, 0, 0), z, -2.9, 2.9);
  add("left4", "left3", "left4", R, at(-0.1455, 0, 0.4315), y, -2.95, 0.01);
  add("left5", "left4", "left5", R, at(0, 0, 0), z, -2.9, 2.9);
  add("left6", "left5", "left6", R, at(0, 0, 0.42), y, -1.65, 1.25);
  add("left_wrist", "left6", "left_hand", F, make_pose<S>(0.01, 0.02, 0.15, 0.3, -0.5, 0.7), z, 0,
      0);
  add("right1", "chest", "right1", R, make_pose<S>(0.1, 0.25, -0.1, -0.4, 0.3, 0.2), oblique, -2,
      2);
  add("right2", "right1", "right2", R, at(0.02, 0.2, 0.1), y, -2, 2).link_pose =
      make_pose<S>(0.02, -0.03, 0.1, 0.2, 0.1, -0.4);
  add("right3", "right2", "right3", P, at(0, 0.1, 0.2), oblique, -0.1, 0.3);
  add("right4", "right3", "right4", R, at(0.1, 0, 0.1), x, -3, 3);
  add("right_wrist", "right4", "right_hand", F, make_pose<S>(0.1, 0, 0.1, 1, 0.2, -0.3), z, 0, 0);
  add("neck", "chest", "head", R, at(0.05, 0, -0.4), y, -1, 1);
  add("camera_mount", "head", "camera", F, make_pose<S>(0.1, 0.03, -0.05, -0.2, 1.2, 0.4), z, 0, 0);
  add("finger1", "left_hand", "finger1", P, at(0, 0.03, 0.1), y, 0, 0.05);
  add("finger2", "left_hand", "finger2", P, at(0, -0.03, 0.1), y, 0, 0).mimic =
      icat::Mimic<S>{"finger1", S(-1), S(0.01)};
  add("finger3", "left_hand", "finger3", R, at(0, 0, 0.12), x, 0, 0).mimic =
      icat::Mimic<S>{"finger2", S(12), S(0.3)};
  return joints;
}
inline constexpr int torso_joint_count = 14, torso_columns = 20;

template <class S>
std::vector<icat::LinkMass<S>> torso_masses() {
  using V = icat::Vector3<S>;
  const auto mass = [](const char* link, double m, double x, double y, double z) {
    return icat::LinkMass<S>{link, S(m), V(S(x), S(y), S(z))};
  };
  return {mass("pelvis", 9, 0.02, 0, -0.1), mass("chest", 6, 0, 0.03, -0.2),
          mass("left4", 2.5, 0.01, 0, 0.2), mass("left_hand", 1, 0, 0, 0.05),
          mass("right3", 3, 0.1, 0, 0.1),   mass("camera", 0.7, 0, 0, 0.02),
          mass("finger1", 0.2, 0, 0, 0.01), mass("finger2", 0.3, 0, 0.01, 0.01),
          mass("finger3", 0.4, 0, 0.02, 0)};
}

/// The torso on any base; `Tree` has the scalar type and the size.
template <class Tree>
Tree make_torso(
    const icat::Base<typename Tree::Scalar>& base = icat::Base<typename Tree::Scalar>::free()) {
  using S = typename Tree::Scalar;
  return Tree({.joints = torso_joints<S>(), .base = base, .masses = torso_masses<S>()});
}

/// Positions within the limits, ±3 where there are none, and any pose of the base.
template <class Tree>
std::vector<TreeState> random_tree_states(const Tree& tree, int count, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<TreeState> states;
  for (int i = 0; i < count; ++i) {
    TreeState s{"random " + std::to_string(i), Eigen::VectorXd(tree.joints().size()), {}};
    for (icat::Index j = 0; j < s.q.size(); ++j) {
      const auto& joint = tree.joints()[static_cast<std::size_t>(j)];
      const double lower = std::max(-3.0, static_cast<double>(joint.lower));
      const double upper = std::min(3.0, static_cast<double>(joint.upper));
      s.q(j) = (lower + upper) / 2 + (upper - lower) / 2 * u(rng);
    }
    // One by one: the order of arguments is the compiler's.
    double p[6];
    for (double& x : p) x = u(rng);
    s.base = make_pose<double>(2 * p[0], 2 * p[1], 2 * p[2], 3.1 * p[3], 1.5 * p[4], 3.1 * p[5]);
    states.push_back(s);
  }
  return states;
}

/// A bent torso: nothing stretched, nothing at a limit.
inline Eigen::VectorXd bent_torso() {
  Eigen::VectorXd q(torso_joint_count);
  q << 0.2, 0.5, 0.3, -0.7, 0.2, -1.3, 0.4, 0.6, 0.4, -0.8, 0.1, 0.9, 0.2, 0.02;
  return q;
}

/// Bent and singular, joints at their limits, the waist at π; gimbal lock, level, upside down.
inline std::vector<TreeState> awkward_torso_states() {
  constexpr double pi = std::numbers::pi;
  const auto at = [](double roll, double pitch, double yaw) {
    return make_pose<double>(0.3, 0.2, 1, roll, pitch, yaw);
  };
  const Eigen::VectorXd bent = bent_torso(), zero = Eigen::VectorXd::Zero(torso_joint_count);
  Eigen::VectorXd half = bent, limit = bent;
  half(1) = pi;
  limit(2) = -2.9;
  limit(5) = 0.01;
  limit(10) = 0.3;
  return {{"stretched", zero, at(0.1, 0.2, 0.3)},
          {"at limits", limit, at(0.1, 0.2, 0.3)},
          {"waist at half a turn", half, at(0.1, 0.2, 0.3)},
          {"gimbal lock up", bent, at(0, pi / 2, 0)},
          {"gimbal lock down", bent, at(0.4, -pi / 2, 0)},
          {"level", bent, at(0, 0, 0.7)},
          {"upside down", bent, at(pi, 0, 0)},
          {"half a turn", bent, at(0, 0, pi)},
          {"origin", bent, icat::Pose<double>::Identity()}};
}

template <class Tree>
std::vector<TreeState> all_torso_states(const Tree& tree, int random_count, unsigned seed) {
  auto states = awkward_torso_states();
  for (auto& s : random_tree_states(tree, random_count, seed)) states.push_back(s);
  return states;
}

}  // namespace testing_support
