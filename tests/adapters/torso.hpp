// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One robot for all adapters, with nothing aligned: a lift, two arms, all kinds of joints, masses
/// off the axes, a root without mass. And what is compared: poses, Jacobians, the centre of mass,
/// and the velocities that one list of tasks gives.
#pragma once

#include <gtest/gtest.h>

#include <icat/icat.hpp>
#include <random>
#include <string>
#include <vector>

#include "support/allocation_counter.hpp"

namespace torso {

inline const char* const urdf = R"(<?xml version="1.0"?>
<robot name="torso">
  <link name="world_link"/>
  <link name="trunk"><inertial><origin xyz="0.02 -0.03 0.4"/><mass value="30"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1.1" iyz="0" izz="0.9"/></inertial></link>
  <joint name="mount" type="fixed"><parent link="world_link"/><child link="trunk"/>
    <origin xyz="0.1 -0.2 0.3" rpy="0.1 0.2 -0.3"/></joint>
  <link name="column"><inertial><origin xyz="0 0.05 0.1"/><mass value="8"/>
    <inertia ixx="0.2" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.1"/></inertial></link>
  <joint name="lift" type="prismatic"><parent link="trunk"/><child link="column"/>
    <origin xyz="0.05 0 0.6" rpy="0.02 -0.03 0.1"/><axis xyz="0.1 0.2 1"/>
    <limit lower="-0.1" upper="0.4" velocity="0.3" effort="1"/></joint>
  <link name="left_upper"><inertial><origin xyz="0.1 0.02 0"/><mass value="3"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
  <joint name="left_shoulder" type="revolute"><parent link="column"/><child link="left_upper"/>
    <origin xyz="0.05 0.2 0.3" rpy="0.3 -0.2 0.7"/><axis xyz="0.3 1 -0.2"/>
    <limit lower="-2" upper="1.5" velocity="1.5" effort="1"/></joint>
  <link name="left_lower"><inertial><origin xyz="0.12 -0.01 0.01"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <joint name="left_elbow" type="revolute"><parent link="left_upper"/><child link="left_lower"/>
    <origin xyz="0.3 0.01 -0.02" rpy="-0.4 0.1 0.2"/><axis xyz="0 1 0.1"/>
    <limit lower="-0.2" upper="2.4" velocity="2" effort="1"/></joint>
  <link name="left_hand"><inertial><origin xyz="0.05 0 0.02"/><mass value="0.7"/>
    <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.003"/></inertial></link>
  <joint name="left_wrist" type="continuous"><parent link="left_lower"/><child link="left_hand"/>
    <origin xyz="0.25 0 0.01" rpy="0.2 0.3 -0.5"/><axis xyz="1 0.2 0"/>
    <limit velocity="3" effort="1"/></joint>
  <link name="left_tip"/>
  <joint name="left_tip_joint" type="fixed"><parent link="left_hand"/><child link="left_tip"/>
    <origin xyz="0.1 0.02 0.03" rpy="0.5 0.6 0.7"/></joint>
  <link name="right_upper"><inertial><origin xyz="0.1 0.02 0"/><mass value="3"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
  <joint name="right_shoulder" type="revolute"><parent link="column"/><child link="right_upper"/>
    <origin xyz="0.04 -0.2 0.31" rpy="-0.3 -0.1 -0.6"/><axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="2" velocity="1.5" effort="1"/></joint>
  <link name="right_lower"><inertial><origin xyz="0.12 -0.01 0.01"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <joint name="right_elbow" type="revolute"><parent link="right_upper"/><child link="right_lower"/>
    <origin xyz="0.3 0.01 -0.02" rpy="0.4 -0.1 0.2"/><axis xyz="0.2 -1 0.1"/>
    <limit lower="-2.4" upper="0.2" velocity="2" effort="1"/></joint>
  <link name="right_tip"/>
  <joint name="right_tip_joint" type="fixed"><parent link="right_lower"/><child link="right_tip"/>
    <origin xyz="0.3 0.02 0.03" rpy="0.5 -0.6 0.7"/></joint>
</robot>)";

using Tree = icat::KinematicTree<double>;

struct State {
  Eigen::VectorXd q;  // in the order of `joints`
  icat::Pose<double> base;
};

/// Random states inside the limits; what has none turns up to ±3 rad.
template <class R>
std::vector<State> states(const R& robot, int count, unsigned seed, bool base_moves = true) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<State> states;
  for (int k = 0; k < count; ++k) {
    State s{Eigen::VectorXd(static_cast<Eigen::Index>(robot.joints().size())),
            icat::Pose<double>::Identity()};
    for (std::size_t i = 0; i < robot.joints().size(); ++i) {
      const double lower = std::max(robot.joints()[i].lower, -3.0);
      const double upper = std::min(robot.joints()[i].upper, 3.0);
      s.q(static_cast<Eigen::Index>(i)) = (lower + upper) / 2 + u(rng) * (upper - lower) / 2;
    }
    if (base_moves) {
      s.base.translation() << 2 * u(rng), 2 * u(rng), 2 * u(rng);
      s.base.linear() = icat::rotation_exp<double>({2 * u(rng), 2 * u(rng), 2 * u(rng)});
    }
    states.push_back(s);
  }
  return states;
}

/// Which column of `robot` is column j of `tree`.
template <class R>
std::vector<Eigen::Index> columns(const Tree& tree, const R& robot) {
  std::vector<Eigen::Index> columns;
  for (const auto& joint : tree.joints()) {
    const auto i = static_cast<std::size_t>(icat::joint_index(robot, joint.name));
    columns.push_back(robot.joints()[i].column);
  }
  for (Eigen::Index j = 0; j < tree.base_columns().count; ++j) {
    columns.push_back(robot.base_columns().first + j);
  }
  return columns;
}

/// The tree's positions in the order of the robot's joints.
template <class R>
Eigen::VectorXd positions(const Tree& tree, const R& robot, const Eigen::VectorXd& q) {
  Eigen::VectorXd other(q.size());
  for (std::size_t i = 0; i < tree.joints().size(); ++i) {
    other(icat::joint_index(robot, tree.joints()[i].name)) = q(static_cast<Eigen::Index>(i));
  }
  return other;
}

/// Columns in the order of the tree.
template <class M>
Eigen::MatrixXd ordered(const M& J, const std::vector<Eigen::Index>& columns) {
  Eigen::MatrixXd result(J.rows(), J.cols());
  for (std::size_t j = 0; j < columns.size(); ++j) {
    result.col(static_cast<Eigen::Index>(j)) = J.col(columns[j]);
  }
  return result;
}

/// The largest difference of any pose and Jacobian of any link, now.
template <class R>
double difference(const Tree& tree, const R& robot) {
  const auto map = columns(tree, robot);
  double worst = 0;
  for (Eigen::Index i = 0; i < tree.frame_count(); ++i) {
    const icat::FrameId mine(i), other = robot.frame(tree.frame_name(mine));
    const Eigen::Matrix4d poses = tree.pose(mine).matrix() - robot.pose(other).matrix();
    worst = std::max(worst, poses.cwiseAbs().maxCoeff());
    const Eigen::MatrixXd J = ordered(robot.jacobian(other), map) - tree.jacobian(mine);
    worst = std::max(worst, J.cwiseAbs().maxCoeff());
  }
  return worst;
}

/// The same of the centre of mass.
template <class R>
double center_difference(const Tree& tree, const R& robot) {
  const Eigen::MatrixXd J = ordered(robot.center_of_mass_jacobian(), columns(tree, robot)) -
                            tree.center_of_mass_jacobian();
  return std::max({(tree.center_of_mass() - robot.center_of_mass()).cwiseAbs().maxCoeff(),
                   J.cwiseAbs().maxCoeff(), std::abs(tree.mass() - robot.mass())});
}

/// Name, limits and whether it is continuous, of each joint.
template <class R>
void expect_same_joints(const Tree& tree, const R& robot) {
  ASSERT_EQ(tree.joints().size(), robot.joints().size());
  ASSERT_EQ(tree.dof(), robot.dof());
  for (const auto& mine : tree.joints()) {
    SCOPED_TRACE(mine.name);
    const auto& other =
        robot.joints()[static_cast<std::size_t>(icat::joint_index(robot, mine.name))];
    EXPECT_EQ(mine.lower, other.lower);
    EXPECT_EQ(mine.upper, other.upper);
    EXPECT_EQ(mine.max_velocity, other.max_velocity);
    EXPECT_EQ(mine.max_acceleration, other.max_acceleration);
    EXPECT_EQ(mine.continuous, other.continuous);
  }
}

/// What is no state is refused and changes nothing; what is one allocates nothing. The base is
/// free.
template <class R>
void expect_refusals_and_no_allocation(R& robot) {
  using icat::Status;
  const auto s = states(robot, 2, 3);
  ASSERT_EQ(robot.update(s[0].q, s[0].base), Status::ok);
  const icat::FrameId tip = robot.frame("left_tip");
  const Eigen::Matrix4d before = robot.pose(tip).matrix();
  for (const icat::FrameId other :
       {icat::FrameId(tip.index(), "elsewhere"), icat::FrameId(robot.frame_count())}) {
    EXPECT_THROW(icat::task::Attitude<R>(robot, other), std::invalid_argument);
  }
  EXPECT_NO_THROW(icat::task::Attitude<R>(robot, tip));
  Eigen::VectorXd bad = s[1].q;
  for (const double number : {std::nan(""), icat::infinity<double>}) {
    bad(2) = number;
    EXPECT_EQ(robot.update(bad), Status::non_finite);
    EXPECT_EQ(robot.update(bad, s[1].base), Status::non_finite);
  }
  EXPECT_EQ(robot.update(Eigen::VectorXd::Zero(3)), Status::wrong_size);
  icat::Pose<double> pose = s[1].base;
  pose.matrix()(0, 3) = std::nan("");
  EXPECT_EQ(robot.update(s[1].q, pose), Status::non_finite);
  pose.matrix() *= 2;
  pose.matrix()(0, 3) = 0;
  EXPECT_EQ(robot.update(s[1].q, pose), Status::not_a_rotation);
  EXPECT_EQ(robot.pose(tip).matrix(), before);
  EXPECT_EQ(count_allocations([&] {
              ASSERT_EQ(robot.update(s[1].q, s[1].base), Status::ok);
              for (icat::Index i = 0; i < robot.frame_count(); ++i) {
                ASSERT_EQ(robot.jacobian(icat::FrameId(i)).cols(), robot.dof());
                ASSERT_EQ(robot.pose(icat::FrameId(i)).matrix()(3, 3), 1);
              }
              ASSERT_EQ(robot.center_of_mass_jacobian().cols(), robot.dof());
            }),
            0);
}

/// Jacobians are central differences. `step(j, h)` moves the robot as its library moves it when ẏ_j
/// is 1 for h seconds, always from the state that the robot is in now.
template <class R, class Step>
void expect_derivatives(R& robot, icat::FrameId frame, Step&& step) {
  const Eigen::MatrixXd J = robot.jacobian(frame), center = robot.center_of_mass_jacobian();
  const double h = 1e-6;
  for (icat::Index j = 0; j < robot.dof(); ++j) {
    icat::Pose<double> poses[2];
    Eigen::Vector3d centers[2];
    for (const int side : {0, 1}) {
      step(j, side ? h : -h);
      poses[side] = robot.pose(frame);
      centers[side] = robot.center_of_mass();
    }
    icat::Vector6<double> numeric;
    numeric << (poses[1].translation() - poses[0].translation()) / (2 * h),
        icat::rotation_log<double>(poses[1].linear() * poses[0].linear().transpose()) / (2 * h);
    EXPECT_LT((numeric - J.col(j)).norm(), 1e-8) << j;
    EXPECT_LT(((centers[1] - centers[0]) / (2 * h) - center.col(j)).norm(), 1e-8) << j;
  }
}

/// Limits, a hand, the other hand with respect to it, the centre of mass, rest: in that order.
template <class R>
struct Tasks {
  icat::task::JointLimits<R> limits;
  icat::task::FramePose<R> left;
  icat::task::FramePosition<R> right;
  icat::task::CenterOfMass<R> center;
  icat::task::Minimality<R> rest;
  icat::Controller<R> controller;

  Tasks(const R& robot, const icat::Pose<double>& goal, const Eigen::Vector3d& right_goal,
        const Eigen::Vector3d& balance)
      : limits(robot, {.margin = 0.2}),
        left(robot, robot.frame("left_tip"), goal, {.gain = 1.5}),
        right(robot, robot.frame("right_tip"), right_goal,
              {.relative_to = robot.frame("left_hand"), .gain = 0.7}),
        center(robot, balance, {.gain = 0.5}),
        rest(robot, icat::joint_columns(robot)),
        // Bounds that are reached answer to rounding.
        controller(robot, {{"work", {{limits}, {left}, {right}, {center}, {rest}}}},
                   {.limits = icat::unlimited}) {}
};

/// `update(robot, state)` moves the foreign robot as the tree was; for ten states 50 steps each,
/// the velocities differ by at most 1e-9.
template <class R, class Update>
void expect_same_velocities(Tree& tree, R& robot, Update&& update, bool base_moves) {
  const auto map = columns(tree, robot);
  double worst = 0, largest = 0;
  for (State& s : states(tree, 10, 7, base_moves)) {
    const State to = states(tree, 1, 8, base_moves)[0];
    ASSERT_EQ(tree.update(to.q, to.base), icat::Status::ok);
    const icat::Pose<double> goal = tree.pose(tree.frame("left_tip"));
    const Eigen::Vector3d right(-0.1, -0.4, 0.05), balance = tree.center_of_mass();
    ASSERT_EQ(tree.update(s.q, s.base), icat::Status::ok);
    update(robot, s);
    Tasks<Tree> mine(tree, goal, right, balance);
    Tasks<R> other(robot, goal, right, balance);
    ASSERT_EQ(mine.controller.switch_to("work", 0, 0.3), icat::Status::ok);
    ASSERT_EQ(other.controller.switch_to("work", 0, 0.3), icat::Status::ok);
    for (int k = 1; k <= 50; ++k) {
      ASSERT_EQ(mine.controller.step(0.02 * k), icat::Status::ok);
      ASSERT_EQ(other.controller.step(0.02 * k), icat::Status::ok);
      const Eigen::VectorXd y = mine.controller.velocity();
      const Eigen::VectorXd z = ordered(other.controller.velocity().transpose(), map).transpose();
      worst = std::max(worst, (y - z).cwiseAbs().maxCoeff());
      largest = std::max(largest, y.cwiseAbs().maxCoeff());
      s.q += 0.02 * y.head(s.q.size());
      if (y.size() > s.q.size()) s.base = icat::integrate<double>(s.base, y.tail<6>(), 0.02);
      ASSERT_EQ(tree.update(s.q, s.base), icat::Status::ok);
      update(robot, s);
    }
  }
  EXPECT_GT(largest, 0.1);
  EXPECT_LT(worst, 1e-9);
  std::printf("velocities: largest %.3g, worst difference %.1e\n", largest, worst);
}

}  // namespace torso
