// SPDX-License-Identifier: BSD-3-Clause
// The characteristic length of a robot, and arms of one shape in four sizes: what they lose to
// regularization with their rows divided by it and without. The table of docs/tasks.md is printed
// here.
#include <gtest/gtest.h>

#include <cstdio>
#include <icat/icat.hpp>

#include "support/archetypes.hpp"
#include "support/linear_algebra.hpp"
#include "support/sized_arms.hpp"

namespace {

using namespace testing_support;  // NOLINT
using icat::Status;
namespace task = icat::task;

// --- the length

/// Of the frame "end_effector", or another.
template <class R>
double length_of(const R& robot, const char* frame = "end_effector") {
  return icat::characteristic_length(robot, robot.frame(frame));
}

TEST(CharacteristicLength, IsTheReachInEveryState) {
  std::mt19937 rng(1);
  for (const double reach : sizes) {
    Tree planar = planar_arm<double>(reach), spatial = fixed_arm_of<double>(reach);
    for (int k = 0; k < 20; ++k) {
      EXPECT_NEAR(length_of(planar, "tool"), reach, 1e-12);
      EXPECT_NEAR(length_of(spatial), reach, 1e-12);
      ASSERT_EQ(planar.update(random_positions(planar, rng)), Status::ok);
      ASSERT_EQ(spatial.update(random_positions(spatial, rng)), Status::ok);
    }
    EXPECT_NEAR(length_of(fixed_arm_of<float>(reach)), reach, 1e-6);
    // The elbow is nearer, the shoulder stands on the first axis.
    EXPECT_NEAR(length_of(spatial, "link4"), 0.577 / maris_reach * reach, 1e-12);
    EXPECT_EQ(length_of(spatial, "link2"), 0);
    // A model of somebody else's, known by its Jacobians alone.
    EXPECT_NEAR(length_of(BaseFirst<Tree>(spatial)), reach, 1e-12);
  }
  // From the torso's axis to the shoulder and along the arm; the other arm is not on the way.
  Tree two = torso();
  const double length = length_of(two, "left_end_effector");
  EXPECT_GT(length, maris_reach);
  EXPECT_LT(length, maris_reach + 0.6);
  ASSERT_EQ(two.update(random_positions(two, rng)), Status::ok);
  EXPECT_NEAR(length_of(two, "left_end_effector"), length, 1e-12);
}

TEST(CharacteristicLength, BoundsEveryLever) {
  std::mt19937 rng(2);
  Tree robot = fixed_arm_of<double>(0.3);
  double longest = 0;
  for (int k = 0; k < 2000; ++k) {
    ASSERT_EQ(robot.update(random_positions(robot, rng)), Status::ok);
    const auto& J = robot.jacobian(robot.frame("end_effector"));
    for (Eigen::Index j = 0; j < 7; ++j) longest = std::max(longest, J.col(j).head<3>().norm());
  }
  EXPECT_LE(longest, 0.3);
  EXPECT_GT(longest, 0.25);
}

TEST(CharacteristicLength, OfBasesSlidesAndWhatCannotMove) {
  // A base does not add to the reach; it is in m/s, and not made small by a longer arm.
  for (const auto& base : {icat::Base<double>::differential_drive(), icat::Base<double>::surface(),
                           icat::Base<double>::free()}) {
    EXPECT_NEAR(length_of(mobile_arm_of(0.15, base)), 0.15, 1e-12);
    EXPECT_EQ(length_of(mobile_arm_of(3, base)), 1);
    EXPECT_EQ(length_of(mobile_arm_of(3, base), "platform"), 0);
  }
  EXPECT_EQ(length_of(make_robot<double>()), 1);  // the papers' robot
  EXPECT_EQ(length_of(fixed_arm_of<double>(0.3), "base"), 0);

  // A cart on a rail with a wrist.
  std::vector<icat::Joint<double>> joints(3);
  joints[0] = {"x", "ground", "cart", icat::JointType::prismatic};
  joints[1] = {"turn", "cart", "wrist"};
  joints[2] = {"tip", "wrist", "tip", icat::JointType::fixed,
               make_pose<double>(0.05, 0, 0, 0, 0, 0)};
  EXPECT_NEAR(length_of(Tree({.joints = joints}), "tip"), 0.05, 1e-12);
  EXPECT_EQ(length_of(Tree({.joints = joints}), "cart"), 0);
  joints[2].origin.translation().x() = 2;
  EXPECT_EQ(length_of(Tree({.joints = joints}), "tip"), 1);

  // A mimic turns, too: its own axis counts.
  std::vector<icat::Joint<double>> finger(3);
  finger[0] = {"first", "palm", "one"};
  finger[1] = {"second", "one", "two", icat::JointType::revolute,
               make_pose<double>(0.04, 0, 0, 0, 0, 0)};
  finger[1].mimic = icat::Mimic<double>{"first", 0.7};
  finger[2] = {"tip", "two", "tip", icat::JointType::fixed, make_pose<double>(0.03, 0, 0, 0, 0, 0)};
  Tree hand({.joints = finger});
  EXPECT_NEAR(length_of(hand, "tip"), 0.07, 1e-12);
  ASSERT_EQ(hand.update(Eigen::VectorXd::Constant(1, 1.2)), Status::ok);
  EXPECT_NEAR(length_of(hand, "tip"), 0.07, 1e-12);

  // Nothing but frames, and slides alone.
  EXPECT_EQ(length_of(archetypes::Framed<double, 3>()), 0);
  EXPECT_EQ(length_of(archetypes::FramedAndJointed<double, 3>()), 0);
}

/// Of J with its rows in metres divided by the reach.
double smallest_singular_value(Eigen::MatrixXd J, double reach) {
  J.topRows(std::min<Eigen::Index>(3, J.rows())) /= reach;
  return testing_support::singular_values(J).minCoeff();
}

/// The part of the rate of the position that is lost, of a task whose goal is about a tenth of the
/// reach away: mean and largest over the states that are away from singularities, mean of all.
constexpr int states = 400;
struct Loss {
  double mean{0}, worst{0}, of_all{0};
  int away{0};
};
template <class S, class Make>
Loss loss(icat::KinematicTree<S> robot, double reach, const char* frame, bool divide, Make make) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> u(-1, 1);
  Loss sum;
  const icat::FrameId tool = robot.frame(frame);
  for (int k = 0; k < states; ++k) {
    EXPECT_EQ(robot.update(random_positions(robot, rng).template cast<S>()), Status::ok);
    icat::Pose<S> goal = moved(robot.pose(tool), 0.1 * reach * u(rng), 0.1 * reach * u(rng), 0);
    auto t = make(robot, tool, goal);
    const Solved solved(robot, t, divide ? std::nullopt : std::optional<S>(1));
    sum.of_all += solved.lost_linear / states;
    if (smallest_singular_value(solved.rows, reach) < 0.1) continue;
    ++sum.away;
    sum.mean += solved.lost_linear;
    sum.worst = std::max(sum.worst, solved.lost_linear);
  }
  sum.mean /= sum.away;
  return sum;
}
const auto planar_position = [](auto& robot, icat::FrameId f, const auto& goal) {
  using R = std::decay_t<decltype(robot)>;
  return task::FramePosition<R>(robot, f, goal.translation(), {.axes = {true, true, false}});
};
const auto position = [](auto& robot, icat::FrameId f, const auto& goal) {
  using R = std::decay_t<decltype(robot)>;
  return task::FramePosition<R>(robot, f, goal.translation());
};
const auto pose = [](auto& robot, icat::FrameId f, const auto& goal) {
  using R = std::decay_t<decltype(robot)>;
  return task::FramePose<R>(robot, f, goal);
};

// --- what is lost

TEST(SmallAndLargeArms, TheTable) {
  std::printf(
      "\n| rows in metres | reach | planar arm, position | 7R arm, position | 7R arm, pose |\n"
      "|---|---|---|---|---|\n");
  for (const bool divide : {false, true}) {
    for (const double reach : sizes) {
      const Loss columns[] = {
          loss(planar_arm<double>(reach), reach, "tool", divide, planar_position),
          loss(fixed_arm_of<double>(reach), reach, "end_effector", divide, position),
          loss(fixed_arm_of<double>(reach), reach, "end_effector", divide, pose)};
      std::printf("| %s | %g m |", divide ? "over the reach" : "as they are", reach);
      for (const Loss& l : columns) {
        std::printf(" %.1f %%, %.1f %%; %.1f %% |", 1e2 * l.mean, 1e2 * l.worst, 1e2 * l.of_all);
      }
      std::printf("\n");
      for (const Loss& l : columns) {
        EXPECT_GT(l.away, 100);
        if (divide || reach >= 1) {
          EXPECT_LT(l.worst, 0.01) << reach;
        } else {
          EXPECT_GT(l.worst, 0.1) << reach;
        }
      }
    }
  }
  std::printf("\n");
}

TEST(SmallAndLargeArms, LoseNothingInFloat) {
  for (const double reach : sizes) {
    EXPECT_LT(loss(planar_arm<float>(reach), reach, "tool", true, planar_position).worst, 0.01);
    EXPECT_LT(loss(fixed_arm_of<float>(reach), reach, "end_effector", true, pose).worst, 0.01);
  }
}

// Goals alike relative to the reach; singular states too.
TEST(SmallAndLargeArms, MoveAlike) {
  double difference = 0, without = 0;
  for (int k = 0; k < 100; ++k) {
    Eigen::VectorXd first[2];
    for (const double reach : sizes) {
      std::mt19937 rng(static_cast<unsigned>(k));
      Tree robot = fixed_arm_of<double>(reach);
      ASSERT_EQ(robot.update(random_positions(robot, rng)), Status::ok);
      const icat::FrameId f = robot.frame("end_effector");
      task::FramePose<Tree> t(robot, f, moved(robot.pose(f), 0.1 * reach, -0.05 * reach, 0));
      for (const bool divide : {true, false}) {
        const Solved solved(robot, t, divide ? std::nullopt : std::optional<double>(1));
        Eigen::VectorXd& reference = first[divide];
        if (reference.size() == 0) reference = solved.velocity;
        double& worst = divide ? difference : without;
        worst = std::max(worst, (solved.velocity - reference).norm() / reference.norm());
      }
    }
  }
  EXPECT_LT(difference, 1e-9);
  EXPECT_GT(without, 0.1);
}

TEST(SmallAndLargeArms, AreRegularizedAtTheSamePlaceOfTheTable) {
  // The elbow of the planar arm stretches from 1.5 rad on; where the regularization begins.
  std::printf("\n| rows in metres | 0.15 m | 0.3 m | 1 m | 3 m |\n|---|---|---|---|---|\n");
  double begins[2][4];
  for (const bool divide : {false, true}) {
    for (std::size_t i = 0; i < 4; ++i) {
      const double reach = sizes[i];
      Tree robot = planar_arm<double>(reach);
      const icat::FrameId f = robot.frame("tool");
      double bend = 1.5;
      for (; bend > 1e-3; bend *= 0.99) {
        ASSERT_EQ(robot.update(Eigen::Vector3d(0.3, bend, -bend / 2)), Status::ok);
        task::FramePosition<Tree> t(robot, f,
                                    moved(robot.pose(f), 0.1 * reach, 0.1 * reach, 0).translation(),
                                    {.axes = {true, true, false}});
        if (Solved(robot, t, divide ? std::nullopt : std::optional<double>(1)).regularized) break;
      }
      begins[divide][i] = bend;
    }
    std::printf("| %s |", divide ? "over the reach" : "as they are");
    for (const double bend : begins[divide]) std::printf(" %.2f rad |", bend);
    std::printf("\n");
  }
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(begins[true][i], begins[true][2]);
  EXPECT_EQ(begins[false][2], begins[true][2]);
  for (std::size_t i : {0u, 1u}) EXPECT_EQ(begins[false][i], 1.5);  // always
  EXPECT_LT(begins[false][3], begins[true][3] / 2);
}

// The manipulability of a small arm is that of a large one times the cube of its size.
TEST(SmallAndLargeArms, KeepTheirManipulabilityAlike) {
  Eigen::VectorXd first;
  for (const double reach : sizes) {
    Tree robot = fixed_arm_of<double>(reach);
    ASSERT_EQ(robot.update(bent_arm()), Status::ok);
    const double cube = reach * reach * reach;
    task::Manipulability<Tree> mu(robot, robot.frame("end_effector"),
                                  icat::Objective<double>::at_least(cube, cube));
    const Solved on(robot, mu, {});
    EXPECT_LT(on.lost, 0.05) << reach;
    if (first.size() == 0) first = on.velocity;
    EXPECT_LT((on.velocity - first).norm(), 1e-9 * first.norm());
    if (reach < 0.5) {
      EXPECT_GT(Solved(robot, mu, 1).lost, 0.5);
    }
  }
}

}  // namespace
