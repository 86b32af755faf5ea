// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What every task is checked for, whatever robot and scalar it has.
///
/// In double the Jacobian is compared with central differences. In float it is compared with that
/// of the same task in double: differences in float would hide an error of 1e-3.
#pragma once

#include <gtest/gtest.h>

#include <icat/task/task.hpp>

#include "support/allocation_counter.hpp"
#include "support/sanitized.hpp"
#include "support/trees.hpp"

namespace testing_support {

using Torso = icat::KinematicTree<double>;
template <class K>
using TorsoOf = typename K::template Tree<torso_columns>;

/// Of all tasks that are checked.
inline constexpr double gain = 2;

/// A fade of fifth order leaves this much where it ends within rounding.
inline constexpr double inactive = 1e-9;

/// A row that counts has as its Jacobian −∂(reference)/∂ẏ / γ; the reference must be γ (x* − x)
/// with a fixed x*. Rows that have faded out need only be finite: what they are faded for is a jump
/// of x or of J.
template <class Tree>
void expect_exact(Tree& robot, icat::Task<Tree>& task, const TreeState& s,
                  double tolerance = 1e-5) {
  place(robot, s);
  task.update();
  const Eigen::MatrixXd J = task.jacobian().template cast<double>();
  const Eigen::VectorXd a = task.activation().template cast<double>();
  ASSERT_TRUE(J.allFinite() && task.reference().allFinite() && a.allFinite());
  ASSERT_TRUE((a.array() >= 0).all() && (a.array() <= 1).all());
  if constexpr (std::is_same_v<typename Tree::Scalar, double>) {
    const auto numeric = differentiate(robot, s, [&](const Tree&) {
      task.update();
      return Eigen::VectorXd(task.reference() / -gain);
    });
    for (Eigen::Index i = 0; i < J.rows(); ++i) {
      if (!(a(i) > inactive)) continue;
      EXPECT_LT((J.row(i) - numeric.row(i)).norm(), tolerance * (1 + J.row(i).norm()))
          << "row " << i << "\n"
          << J.row(i) << "\n"
          << numeric.row(i);
    }
    task.update();
  }
}

/// `task` on a robot in the state of that of `exact`. What goes to the solver, a² Jᵀ ẋ̄, is
/// continuous and so the same to a rounding of the state times its slope; away from kinks J is too.
template <class Tree>
void expect_same(icat::Task<Tree>& task, icat::Task<Torso>& exact, bool kink = false) {
  using S = typename Tree::Scalar;
  task.update();
  exact.update();
  const auto push = [](const auto& t) {
    return Eigen::VectorXd(
        (t.jacobian().transpose() * t.activation().cwiseAbs2().cwiseProduct(t.reference()))
            .template cast<double>());
  };
  // Some ten products deep, the slopes of fades are in the hundreds.
  const double rounding = 10 * static_cast<double>(std::numeric_limits<S>::epsilon());
  EXPECT_LT((push(task) - push(exact)).norm(), 2e3 * rounding) << task.name();
  if (kink) return;
  for (Eigen::Index i = 0; i < exact.rows(); ++i) {
    if (!(exact.activation()(i) > inactive)) continue;
    EXPECT_LT((task.jacobian().row(i).template cast<double>() - exact.jacobian().row(i)).norm(),
              200 * rounding * (1 + exact.jacobian().row(i).norm()))
        << task.name() << " row " << i;
  }
}

/// The largest changes, per unit of the parameter, of the reference and of a² Jᵀ ẋ̄ while the robot
/// goes through `at(0)` … `at(1)`.
template <class Tree, class F>
std::pair<double, double> steepest(Tree& robot, icat::Task<Tree>& task, F&& at) {
  constexpr int steps = sanitized ? 2'000 : 20'000;
  Eigen::VectorXd last_reference, last_push;
  double reference = 0, push = 0;
  for (int i = 0; i <= steps; ++i) {
    place(robot, at(double(i) / steps));
    task.update();
    const Eigen::VectorXd now =
        (task.jacobian().transpose() * task.activation().cwiseAbs2().cwiseProduct(task.reference()))
            .template cast<double>();
    if (i > 0) {
      reference = std::max(
          reference,
          static_cast<double>((task.reference().template cast<double>() - last_reference).norm()));
      push = std::max(push, (now - last_push).norm());
    }
    last_reference = task.reference().template cast<double>();
    last_push = now;
  }
  return {reference * steps, push * steps};
}

/// Heap allocations of an update after `place`.
template <class Tree>
long update_allocations(Tree& robot, icat::Task<Tree>& task, const TreeState& s) {
  place(robot, s);
  return count_allocations([&] { task.update(); });
}

/// The state whose base makes `frame` have the pose `wanted` in ⟨0⟩.
template <class Tree>
TreeState with_frame_at(Tree& robot, TreeState s, icat::FrameId frame,
                        const icat::Pose<double>& wanted) {
  place(robot, s);
  const icat::Pose<double> f = robot.pose(frame).template cast<double>();
  s.base = wanted * f.inverse() * s.base;
  return s;
}

}  // namespace testing_support
