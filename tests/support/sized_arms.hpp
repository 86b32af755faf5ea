// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Arms of one shape in sizes of choice, and the answer of a controller that has one task.
#pragma once

#include <gtest/gtest.h>

#include <icat/icat.hpp>
#include <optional>

#include "support/robots.hpp"

namespace testing_support {

inline constexpr double sizes[] = {0.15, 0.3, 1, 3};  // reach, m
inline constexpr double maris_reach = 0.132 + 0.42 + 0.1455 + 0.4315;

/// Three links in a plane, 0.4, 0.35 and 0.25 of the `reach`; frame "tool".
template <class S>
icat::KinematicTree<S> planar_arm(double reach) {
  std::vector<icat::DhRow<S>> rows;
  for (const double a : {0.4, 0.35, 0.25}) rows.push_back({S(a * reach), S(0), S(0), S(0)});
  auto joints = icat::dh_chain<S>(rows, icat::DhConvention::standard);
  joints.back().link = "tool";
  return icat::KinematicTree<S>({.joints = joints});
}

/// The seven joints of the MARIS arm, of another size.
template <class S>
icat::SerialArm<S, 7> spatial_arm(double reach) {
  auto arm = icat::maris_arm<S>();
  const S scale = S(reach / maris_reach);
  for (auto& joint : arm.joints) joint.point *= scale;
  arm.end_effector.translation() *= scale;
  return arm;
}
template <class S>
icat::KinematicTree<S> fixed_arm_of(double reach) {
  return icat::KinematicTree<S>({.joints = icat::axes_chain(spatial_arm<S>(reach), "base")});
}
/// The same on `base`, off its middle.
inline Tree mobile_arm_of(double reach, const icat::Base<double>& base) {
  auto joints = icat::axes_chain(spatial_arm<double>(reach), "arm_base");
  joints.push_back({"mount", "platform", "arm_base", icat::JointType::fixed,
                    make_pose<double>(0.2 * reach, 0.1 * reach, 0.3 * reach, 0, 0, 0.5)});
  return Tree({.joints = joints, .base = base});
}

/// Joint positions of all sizes alike.
template <class T>
Eigen::VectorXd random_positions(const T& robot, std::mt19937& rng) {
  std::uniform_real_distribution<double> u(0, 1);
  Eigen::VectorXd q(static_cast<Eigen::Index>(robot.joints().size()));
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const auto& joint = robot.joints()[static_cast<std::size_t>(i)];
    const double low = std::max<double>(joint.lower, -2.9),
                 high = std::min<double>(joint.upper, 2.9);
    q(i) = low + (high - low) * u(rng);
  }
  return q;
}

/// A controller that has `tool` alone, and its answer in the state of the robot.
struct Solved {
  template <class R>
  Solved(const R& robot, icat::Task<R>& tool, std::optional<typename R::Scalar> length) {
    icat::Controller<R> controller(robot, {{"go", {{tool}}}},
                                   {.limits = icat::unlimited, .characteristic_length = length});
    EXPECT_EQ(controller.start("go", 0), icat::Status::ok);
    EXPECT_EQ(controller.step(0), icat::Status::ok);
    velocity = controller.answer().template cast<double>();
    const auto& level = controller.report().levels()[0];
    regularized = level.regularized;
    requested = level.requested_rate;
    lost = level.tracking_error / level.requested_rate;
    const Eigen::VectorXd wanted = tool.reference().template cast<double>();
    const Eigen::VectorXd did = tool.jacobian().template cast<double>() * velocity;
    const Eigen::Index m = std::min<Eigen::Index>(3, wanted.size());
    lost_linear = (wanted - did).head(m).norm() / wanted.head(m).norm();
    rows = controller.levels()[0].jacobian.template cast<double>();
  }
  Eigen::VectorXd velocity;
  Eigen::MatrixXd rows;
  bool regularized;
  double requested, lost, lost_linear;
};

}  // namespace testing_support
