// SPDX-License-Identifier: BSD-3-Clause
// Tasks of joints and columns: limits, positions, manipulability, minimality, given velocities.
#include <gtest/gtest.h>

#include <icat/model/maris.hpp>
#include <icat/task/column_tasks.hpp>
#include <icat/task/joint_tasks.hpp>
#include <icat/task/manipulability.hpp>
#include <random>

#include "support/linear_algebra.hpp"
#include "support/task_checks.hpp"

namespace {

using icat::FrameId;
using icat::Index;
using icat::JointType;
using icat::Status;
using testing_support::gain;
using testing_support::make_pose;
using testing_support::make_torso;
using testing_support::message_of;
using testing_support::place;
using testing_support::roundings;
using testing_support::Torso;
using testing_support::TorsoOf;
using testing_support::TreeState;
using Names = std::vector<std::string>;
using Objective = icat::Objective<double>;
namespace task = icat::task;
constexpr double pi = std::numbers::pi;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class K>
class JointTasks : public testing::Test {};
TYPED_TEST_SUITE(JointTasks, testing_support::AllKinds);

const Names left_arm{"left1", "left2", "left3", "left4", "left5", "left6"};
const Names right_arm{"right1", "right2", "right3", "right4"};

// A chain of joints of given types and limits along x, "joint1" …
using Chain = icat::KinematicTree<double>;
struct Limits {
  JointType type;
  double lower, upper;
};
Chain chain(const std::vector<Limits>& joints) {
  Chain::Description description;
  std::string parent = "base";
  for (const Limits& limits : joints) {
    const std::string number = std::to_string(description.joints.size() + 1);
    icat::Joint<double> joint{"joint" + number, parent, "link" + number, limits.type};
    joint.origin = make_pose<double>(0.3, 0, 0, 0, 0, 0);
    joint.lower = limits.lower;
    joint.upper = limits.upper;
    parent = joint.link;
    description.joints.push_back(joint);
  }
  return Chain(description);
}
Eigen::VectorXd positions(std::initializer_list<double> q) {
  return Eigen::Map<const Eigen::VectorXd>(q.begin(), static_cast<Index>(q.size()));
}

// --- limits --------------------------------------------------------------------------------------

TYPED_TEST(JointTasks, LimitsFollowTheFormulasOnBothSides) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  // In another order than the robot's, and the endless waist among them.
  const Names names{"left2", "waist", "right3"};
  task::JointLimits<Tree> limits(
      robot, {.joints = names, .margin = {S(0.2), S(0.1), S(0.05)}, .gain = S(gain)});
  ASSERT_EQ(limits.rows(), 3);
  TreeState s{"", testing_support::bent_torso(), icat::Pose<double>::Identity()};
  const auto at = [&](double left2, double right3) {
    s.q(3) = left2;
    s.q(10) = right3;
    place(robot, s);
    limits.update();
  };
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(3, 20);
  J(0, 3) = J(1, 1) = J(2, 10) = 1;

  at(0, 0.1);  // inside
  EXPECT_EQ(limits.jacobian().template cast<double>(), J);
  EXPECT_EQ(limits.activation().norm(), S(0));
  EXPECT_EQ(limits.reference().norm(), S(0));
  at(-1.5, 0.275);  // half-way into the margins: left2 from −1.6, right3 to 0.3
  EXPECT_NEAR(limits.activation()(0), 0.5, 1e-5);
  EXPECT_NEAR(limits.reference()(0), gain * 0.1, 1e-5);
  EXPECT_NEAR(limits.activation()(2), 0.5, 1e-5);
  EXPECT_NEAR(limits.reference()(2), gain * -0.025, 1e-5);
  at(1.7, -0.2);  // beyond
  EXPECT_EQ(limits.activation()(0), S(1));
  EXPECT_NEAR(limits.reference()(0), gain * (1.45 - 1.7), 1e-5);
  EXPECT_EQ(limits.activation()(2), S(1));
  EXPECT_NEAR(limits.reference()(2), gain * (-0.05 + 0.2), 1e-5);
  EXPECT_EQ(limits.activation()(1), S(0));  // no limits, never active
}

TEST(JointLimits, OfAllJointsWithRatesOfTheirOwn) {
  Chain robot = chain({{JointType::revolute, -1, 1},
                       {JointType::continuous, 0, 0},
                       {JointType::prismatic, -INFINITY, 2},
                       {JointType::revolute, -INFINITY, INFINITY}});
  ASSERT_EQ(robot.update(positions({3, 100, 50, 1e6})), Status::ok);
  task::JointLimits<Chain> limits(robot, {.gain = 1, .max_rate = {0.5, 1, 0.25, 1}});
  limits.update();
  EXPECT_EQ(limits.jacobian(), Eigen::MatrixXd::Identity(4, 4));
  EXPECT_EQ(limits.reference(), positions({-0.5, 0, -0.25, 0}));
  EXPECT_EQ(limits.activation(), positions({1, 0, 1, 0}));
  ASSERT_EQ(limits.set_max_rate(2), Status::ok);
  EXPECT_EQ(limits.set_max_rate(0), Status::out_of_range);
  EXPECT_EQ(limits.set_max_rate(nan), Status::out_of_range);
  ASSERT_EQ(limits.set_gain(0.5), Status::ok);
  EXPECT_EQ(limits.set_gain(-1), Status::out_of_range);
  limits.update();
  EXPECT_EQ(limits.reference(), positions({0.5 * (0.9 - 3), 0, -2, 0}));
}

// The one reference point inside of [Coop, III-C, Remark]; a joint without limits has none.
TEST(JointLimitsReference, IsTheMiddleWhereThePapersIs) {
  icat::KinematicTree<double> robot(
      {.joints = {{.name = "bent", .parent = "base", .link = "one", .lower = -1, .upper = 3},
                  {.name = "free", .parent = "one", .link = "two"}}});
  task::JointLimits<icat::KinematicTree<double>> near(robot, {.margin = 0.5}),
      middle(robot, {.margin = 0.5, .to_middle = true, .gain = 2});
  ASSERT_EQ(robot.update(Eigen::Vector2d(-0.9, 0.7)), icat::Status::ok);
  near.update();
  middle.update();
  EXPECT_DOUBLE_EQ(near.reference()(0), 0.4);        // to −1 + 0.5
  EXPECT_DOUBLE_EQ(middle.reference()(0), 2 * 1.9);  // to 1
  EXPECT_EQ(middle.reference()(1), 0);
  EXPECT_EQ(near.activation(), middle.activation());
}

TEST(JointLimits, MarginsMayChangeWhileItRuns) {
  Chain robot = chain({{JointType::revolute, -2, 2},
                       {JointType::prismatic, 0, 0.08},
                       {JointType::revolute, -INFINITY, INFINITY}});
  ASSERT_EQ(robot.update(positions({1.95, 0.075, 9})), Status::ok);
  const auto expect = [&](task::JointLimits<Chain>& limits, const icat::PerJoint<double>& margin,
                          bool to_middle) {
    task::JointLimits<Chain> built(robot, {.margin = margin, .to_middle = to_middle});
    built.update();
    limits.update();
    EXPECT_EQ(limits.activation(), built.activation());
    EXPECT_EQ(limits.reference(), built.reference());
  };
  for (const bool to_middle : {false, true}) {
    task::JointLimits<Chain> limits(robot, {.margin = 0.3, .to_middle = to_middle});
    ASSERT_EQ(limits.set_margin(0.1), Status::ok);
    expect(limits, 0.1, to_middle);
    ASSERT_EQ(limits.set_margin(positions({0.5, 0.01, 3})), Status::ok);
    expect(limits, {0.5, 0.01, 3.0}, to_middle);
    // Refused: all of the old ones stay.
    for (const double bad : {0.0, -1.0, nan, static_cast<double>(INFINITY)}) {
      EXPECT_EQ(limits.set_margin(bad), Status::out_of_range);
      EXPECT_EQ(limits.set_margin(positions({0.2, 0.01, bad})),
                std::isfinite(bad) ? Status::out_of_range : Status::non_finite);
    }
    EXPECT_EQ(limits.set_margin(positions({0.2, 0.04, 1})), Status::out_of_range);  // no room
    EXPECT_EQ(limits.set_margin(positions({0.2, 0.01})), Status::wrong_size);
    expect(limits, {0.5, 0.01, 3.0}, to_middle);
  }
}

// M2: a long rail parked at its end leaves the margin gently, instead of going for its middle.
TEST(Cases, M2_ALongRailMovesOutOfTheMarginAndNoFurther) {
  Chain robot = chain({{JointType::prismatic, 0, 20}, {JointType::revolute, -2, 2}});
  task::JointLimits<Chain> limits(robot);
  Eigen::VectorXd q = positions({0, 0});
  for (int k = 0; k < 1000; ++k) {
    ASSERT_EQ(robot.update(q), Status::ok);
    limits.update();
    EXPECT_LE(std::abs(limits.reference()(0)), 0.1 + 1e-12);
    q(0) += 0.01 * limits.activation()(0) * limits.reference()(0);
  }
  EXPECT_GT(q(0), 0.03);
  EXPECT_LE(q(0), 0.1);
}

// M3: a slide shorter than the margin has a margin of its own; where one is given that does not fit
// the error says whose it is.
TEST(Cases, M3_AShortSlideHasRoom) {
  Chain robot = chain({{JointType::revolute, -2, 2}, {JointType::prismatic, 0, 0.08}});
  task::JointLimits<Chain> limits(robot, {.margin = 0.1});
  ASSERT_EQ(robot.update(positions({1.95, 0.01})), Status::ok);
  limits.update();
  EXPECT_NEAR(limits.activation()(0), 0.5, 1e-12);  // margin 0.1
  EXPECT_NEAR(limits.activation()(1), 0.5, 1e-12);  // margin 0.02, a quarter of the range
  EXPECT_NEAR(limits.reference()(1), 0.01, 1e-12);
  ASSERT_EQ(robot.update(positions({0, 0.04})), Status::ok);
  limits.update();
  EXPECT_EQ(limits.activation().norm(), 0);
  EXPECT_EQ(message_of([&] {
              task::JointLimits<Chain>(robot, {.margin = {0.1, 0.1}});
            }),
            "task 'joint limits': a margin of 0.1 leaves joint 'joint2' no room in [0, 0.08]");
  task::JointLimits<Chain> fits(robot, {.margin = {0.5, 0.01}});
  ASSERT_EQ(robot.update(positions({0, 0.075})), Status::ok);
  fits.update();
  EXPECT_NEAR(fits.activation()(1), 0.5, 1e-12);
}

// --- positions -----------------------------------------------------------------------------------

// M4: 0.07 rad are 0.07 rad, whichever way the encoder counts.
TEST(Cases, M4_AContinuousJointTakesTheShortWay) {
  Chain robot = chain({{JointType::continuous, 0, 0}, {JointType::revolute, -INFINITY, INFINITY}});
  task::JointPosition<Chain> position(robot, positions({3.2, 3.2}), {.gain = gain});
  const auto reference = [&](double q) {
    EXPECT_EQ(robot.update(positions({q, q})), Status::ok);
    position.update();
    return position.reference();
  };
  EXPECT_NEAR(reference(3.13)(0), gain * 0.07, 1e-12);
  EXPECT_NEAR(reference(3.13 - 2 * pi)(0), gain * 0.07, 1e-12);
  EXPECT_NEAR(reference(3.13 + 20 * pi)(0), gain * 0.07, 1e-12);
  EXPECT_NEAR(reference(-3.08)(0), gain * (3.2 + 3.08 - 2 * pi), 1e-12);
  // Without limits is not without end: such a joint unwinds.
  EXPECT_NEAR(reference(3.13 - 2 * pi)(1), gain * (0.07 + 2 * pi), 1e-12);

  // An encoder that wraps to ±π on the way.
  double q = 3.13, motion = 0;
  for (int k = 0; k < 1000; ++k) {
    const double v = reference(std::remainder(q, 2 * pi))(0);
    ASSERT_LE(std::abs(v), gain * 0.07 + 1e-9);
    q += 0.01 * v;
    motion += 0.01 * std::abs(v);
  }
  EXPECT_NEAR(motion, 0.07, 1e-6);
}

TYPED_TEST(JointTasks, PositionsComponentByComponent) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  Eigen::Matrix<S, 3, 1> goal(S(0.1), S(-0.4), S(1));
  task::JointPosition<Tree> position(
      robot, goal,
      {.joints = {"neck", "lift", "left6"}, .gain = S(gain), .max_rate = {S(0.1), S(5), S(5)}});
  const auto s = testing_support::random_tree_states(robot, 1, 3)[0];
  place(robot, s);
  position.update();
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(3, 20);
  J(0, 12) = J(1, 0) = J(2, 7) = 1;
  EXPECT_EQ(position.jacobian().template cast<double>(), J);
  EXPECT_EQ(position.activation().minCoeff(), S(1));
  Eigen::Vector3d expected =
      gain * (goal.template cast<double>() - Eigen::Vector3d(s.q(12), s.q(0), s.q(7)));
  // All are slowed alike, so the way stays straight.
  expected *= std::min(
      {1.0, 0.1 / std::abs(expected(0)), 5 / std::abs(expected(1)), 5 / std::abs(expected(2))});
  EXPECT_LT((position.reference().template cast<double>() - expected).norm(), 1e-5);
  EXPECT_LE(std::abs(position.reference()(0)), S(0.1) + roundings<S>(4));
  // Its own velocity is on top.
  const Eigen::Matrix<S, 3, 1> velocity(S(1), S(2), S(3));
  ASSERT_EQ(position.set_goal(goal, velocity), Status::ok);
  position.update();
  EXPECT_LT(
      (position.reference().template cast<double>() - expected - velocity.template cast<double>())
          .norm(),
      1e-5);
}

TYPED_TEST(JointTasks, TheNormOfPositionsHasAnExactJacobian) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  Torso twin = make_torso<Torso>();
  const Eigen::VectorXd goal = testing_support::bent_torso();
  const auto make = [&](auto& r) {
    using R = std::remove_reference_t<decltype(r)>;
    using T = typename R::Scalar;
    return task::JointPosition<R>(r, goal.template cast<T>(),
                                  {.norm = icat::Objective<T>::equal_to(T(0)), .gain = T(gain)});
  };
  auto t = make(robot);
  auto exact = make(twin);
  auto states = testing_support::all_torso_states(robot, 20, 12);
  // The endless waist at, near and beyond half a turn from its goal, alone and among others.
  for (const double waist : {pi, pi - 0.02, pi - 0.05, pi - 0.2, -pi + 0.03, 2 * pi + 0.3}) {
    for (const double neck : {0.2, 0.5}) {
      TreeState s{"waist " + std::to_string(waist), goal, icat::Pose<double>::Identity()};
      s.q(1) += waist;
      s.q(12) = neck;
      states.push_back(s);
    }
  }
  for (const TreeState& s : states) {
    SCOPED_TRACE(s.name);
    const bool kink = (s.q - goal).norm() < 1e-9 || s.name == "waist " + std::to_string(pi);
    testing_support::expect_exact(robot, t, s);
    if constexpr (std::is_same_v<S, float>) {
      place(robot, s);
      place(twin, s);
      testing_support::expect_same(t, exact, kink);
    }
  }
}

TEST(JointPosition, TheNormFollowsItsObjectiveAndFeedsForward) {
  Chain robot = chain({{JointType::revolute, -2, 2}, {JointType::continuous, 0, 0}});
  task::JointPosition<Chain> norm(robot, positions({0.3, 0.4}),
                                  {.norm = Objective::at_most(0.6, 0.2), .gain = gain});
  norm.update();  // 0.5 away
  ASSERT_EQ(norm.rows(), 1);
  EXPECT_NEAR(norm.activation()(0), 0.5, 1e-12);
  EXPECT_NEAR(norm.reference()(0), gain * (0.4 - 0.5), 1e-12);
  EXPECT_LT((norm.jacobian() - Eigen::RowVector2d(-0.6, -0.8)).norm(), 1e-12);
  ASSERT_EQ(norm.set_objective(Objective::equal_to(0)), Status::ok);
  const auto at = [&](double time, double v) {
    EXPECT_EQ(norm.set_goal(positions({0.3 + 0.7 * time, 0.4 - 0.2 * time}),
                            positions({0.7 * v, -0.2 * v})),
              Status::ok);
    norm.update();
    return norm.reference()(0);
  };
  const double h = 1e-6;
  EXPECT_NEAR(at(0, 1) - at(0, 0), -(at(h, 0) - at(-h, 0)) / (2 * h * -gain), 1e-8);

  task::JointPosition<Chain> components(robot, positions({0, 0}));
  EXPECT_EQ(components.set_objective(Objective::equal_to(0)), Status::wrong_size);
}

// Half a turn away is no second goal: from everywhere beside it the way leads to the true one.
TEST(JointPosition, HalfATurnFromTheGoalAttractsNothing) {
  Chain robot = chain({{JointType::continuous, 0, 0}, {JointType::revolute, -2, 2}});
  for (const bool norm : {false, true}) {
    for (const double e : {pi - 0.02, pi - 0.05, pi - 0.09, 3.0, 1.0}) {
      for (const double sign : {-1.0, 1.0}) {
        task::JointPosition<Chain> t(
            robot, positions({1, 0.5}),
            {.norm = norm ? std::optional(Objective::equal_to(0)) : std::nullopt, .gain = gain});
        ASSERT_EQ(robot.update(positions({1 - sign * e, 0.2})), Status::ok);
        t.update();
        const Eigen::VectorXd y = t.jacobian().transpose() * t.reference();
        EXPECT_GT(sign * y(0), 0) << norm << ' ' << e;
        EXPECT_GT(y(1), 0);
        EXPECT_GT(t.activation().minCoeff(), 0);
      }
    }
  }
}

// M13: what may change while it runs has a setter, and what is bad is refused.
TEST(Cases, M13_GoalsGainsAndRatesChangeWhileItRuns) {
  Chain robot = chain({{JointType::revolute, -2, 2}, {JointType::revolute, -2, 2}});
  const Eigen::VectorXd goal = positions({1, -1});
  task::JointPosition<Chain> t(robot, goal, {.gain = 1, .max_rate = {3, 3}});
  EXPECT_EQ(t.set_goal(positions({1, 2, 3})), Status::wrong_size);
  EXPECT_EQ(t.set_goal(positions({1})), Status::wrong_size);
  EXPECT_EQ(t.set_goal(positions({1, nan})), Status::non_finite);
  EXPECT_EQ(t.set_goal(positions({1, INFINITY})), Status::non_finite);
  EXPECT_EQ(t.set_goal(positions({0, 0}), positions({1})), Status::wrong_size);
  EXPECT_EQ(t.set_goal(positions({0, 0}), positions({nan, 1})), Status::non_finite);
  EXPECT_EQ(t.set_goal(positions({0, nan}), positions({1, 1})), Status::non_finite);
  EXPECT_EQ(t.set_gain(nan), Status::out_of_range);
  EXPECT_EQ(t.set_max_rate(0), Status::out_of_range);
  EXPECT_EQ(t.goal(), goal);
  t.update();
  EXPECT_EQ(t.reference(), goal);  // nothing of all that was taken
  ASSERT_EQ(t.set_goal(Eigen::Vector2d(2, 0)), Status::ok);
  ASSERT_EQ(t.set_gain(2), Status::ok);
  ASSERT_EQ(t.set_max_rate(1), Status::ok);
  t.update();
  EXPECT_EQ(t.reference(), positions({1, 0}));
  static_assert(noexcept(t.set_goal(goal))&& noexcept(t.set_gain(1))&& noexcept(t.set_max_rate(1)));
  // A goal without a velocity is at rest.
  ASSERT_EQ(t.set_goal(positions({0, 0}), positions({5, 5})), Status::ok);
  ASSERT_EQ(t.set_goal(positions({0, 0})), Status::ok);
  t.update();
  EXPECT_EQ(t.reference().norm(), 0);
}

// A step of the reference in an update in which the error turns by `step` rad: the steepest slope
// of the fade, 15/8, over 100 updates or 0.5 rad, of an error of at most π + 1; and its own step.
double largest_step(double step) { return gain * ((pi + 1) * 15 / 8 * (0.01 + step / 0.5) + step); }

TEST(JointPosition, NothingJumpsWhereAWaistTurnsOver) {
  Torso robot = make_torso<Torso>();
  const Eigen::VectorXd goal = testing_support::bent_torso();
  for (const bool norm : {false, true}) {
    task::JointPosition<Torso> t(
        robot, goal,
        {.norm = norm ? std::optional(Objective::at_most(0.5, 0.2)) : std::nullopt, .gain = gain});
    const auto [reference, push] = testing_support::steepest(robot, t, [&](double u) {
      TreeState s{"", goal, icat::Pose<double>::Identity()};
      s.q(1) += 2 * pi * u;
      s.q(4) += 0.3 * u;
      return s;
    });
    const int steps = sanitized ? 2'000 : 20'000;
    // The norm itself does not fade, its row does: where the way changes, nothing is asked for.
    if (!norm) {
      EXPECT_LT(reference / steps, largest_step(7.0 / steps));
    }
    EXPECT_LT(push / steps, 2 * largest_step(7.0 / steps));  // a² falls twice as fast as a
    EXPECT_GT(push, 1);
  }
}

// Half a turn away, with noise: the positive way, and on.
TYPED_TEST(JointTasks, AJointHalfATurnAwayMovesAndDoesNotDither) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  const Eigen::VectorXd goal = testing_support::bent_torso();
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (const bool norm : {false, true}) {
    for (const double noise : {0.0, 1e-9, 1e-6, 1e-3}) {
      for (const double turns : {-1.5, -0.5, 0.5, 3.5}) {
        SCOPED_TRACE(testing::Message() << norm << ' ' << noise << ' ' << turns);
        std::optional<icat::Objective<S>> objective;
        if (norm) objective = icat::Objective<S>::equal_to(S(0));
        task::JointPosition<Tree> t(robot, goal.template cast<S>(),
                                    {.norm = objective, .gain = S(gain)});
        TreeState s{"", goal, icat::Pose<double>::Identity()};
        const double start = goal(1) + 2 * pi * turns;
        double q = start;
        for (int k = 0; k < 300; ++k) {
          s.q(1) = q + noise * normal(random);
          place(robot, s);
          t.update();
          const double rate = static_cast<double>((t.jacobian().transpose() * t.reference())(1));
          if (k < 100) {  // held in place
            ASSERT_NEAR(rate, gain * pi, gain * 6 * noise + 1e-4);
          } else {
            q += 0.02 * rate;
          }
        }
        EXPECT_NEAR(q, start + pi, 5e-3);
      }
    }
  }
}

// A goal that turns on and on, back and forth; where it stops it is reached.
TEST(JointPosition, AGoalThatSwingsThroughHalfATurnIsFollowedWithoutAJump) {
  Chain robot = chain({{JointType::continuous, 0, 0}, {JointType::revolute, -2, 2}});
  for (const bool norm : {false, true}) {
    for (const double speed : {1e-3, 1e-2, 0.1}) {
      for (const double amplitude : {0.3, 0.6, 2.0}) {
        SCOPED_TRACE(testing::Message() << norm << ' ' << speed << ' ' << amplitude);
        task::JointPosition<Chain> t(
            robot, positions({0, 0.5}),
            {.norm = norm ? std::optional(Objective::equal_to(0)) : std::nullopt, .gain = gain});
        ASSERT_EQ(robot.update(positions({0, 0.2})), Status::ok);
        Eigen::VectorXd last;
        double step = 0;
        const int updates = static_cast<int>(20.3 * amplitude / speed);
        for (int k = 0; k < updates; ++k) {
          ASSERT_EQ(t.set_goal(positions({pi + amplitude * std::sin(k * speed / amplitude), 0.5})),
                    Status::ok);
          t.update();
          const Eigen::VectorXd push =
              t.jacobian().transpose() * t.activation().cwiseProduct(t.reference());
          if (k > 0) step = std::max(step, (push - last).norm());
          last = push;
        }
        EXPECT_LT(step, largest_step(speed));
        Eigen::VectorXd q = positions({0, 0.2});
        for (int k = 0; k < 700; ++k) {
          ASSERT_EQ(robot.update(q), Status::ok);
          t.update();
          q += 0.02 * (t.jacobian().transpose() * t.activation().cwiseProduct(t.reference()));
        }
        EXPECT_NEAR(std::remainder(t.goal()(0) - q(0), 2 * pi), 0, 1e-3);
        EXPECT_NEAR(q(1), 0.5, 1e-3);
      }
    }
  }
}

// --- manipulability ------------------------------------------------------------------------------

struct MeasureCase {
  const char* frame;
  Names joints;
};
std::vector<MeasureCase> measures() {
  return {{"left_hand", {}},                           // eight: torso and arm
          {"left_hand", left_arm},                     // six, the torso before them
          {"right_hand", {}},                          // six of all kinds
          {"right_hand", right_arm},                   // four
          {"right_hand", {"right4", "right1"}},        // two, in another order
          {"left_hand", {"waist", "left2", "left4"}},  // with others between
          {"left_hand", {"left2", "left4"}},           // neighbours
          {"camera", {"neck"}},
          // Mimics, the joint that they follow on another branch.
          {"finger3", {}},
          {"finger3", {"left3", "left5", "finger1"}},
          {"finger2", {"finger1"}}};
}

TYPED_TEST(JointTasks, ManipulabilityHasAnExactGradient) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  Torso twin = make_torso<Torso>();
  const auto states = testing_support::all_torso_states(robot, sanitized ? 5 : 30, 13);
  for (const MeasureCase& c : measures()) {
    SCOPED_TRACE(testing::Message() << c.frame << ' ' << c.joints.size());
    const auto make = [&](auto& r) {
      using R = std::remove_reference_t<decltype(r)>;
      using T = typename R::Scalar;
      return task::Manipulability<R>(r, r.frame(c.frame), icat::Objective<T>::equal_to(T(1)),
                                     {.joints = c.joints, .gain = T(gain)});
    };
    auto t = make(robot);
    auto exact = make(twin);
    for (const TreeState& s : states) {
      SCOPED_TRACE(s.name);
      testing_support::expect_exact(robot, t, s);
      place(robot, s);
      t.update();
      // √det of the Gram matrix of the columns that move the frame, the shorter side.
      const auto& J = robot.jacobian(robot.frame(c.frame));
      std::vector<Index> columns;
      for (const Index column :
           c.joints.empty() ? icat::joint_columns(robot) : icat::joint_columns(robot, c.joints)) {
        if (J.col(column).norm() > S(0)) columns.push_back(column);
      }
      Eigen::MatrixXd part(6, static_cast<Index>(columns.size()));
      for (Index k = 0; k < part.cols(); ++k) {
        part.col(k) = J.col(columns[static_cast<std::size_t>(k)]).template cast<double>();
      }
      const Eigen::MatrixXd gram = part.cols() < 6 ? Eigen::MatrixXd(part.transpose() * part)
                                                   : Eigen::MatrixXd(part * part.transpose());
      // A determinant within rounding of 0 has a root of √rounding.
      const double square = static_cast<double>(t.value() * t.value());
      const double determinant = testing_support::determinant(gram);
      EXPECT_NEAR(square, determinant,
                  (sizeof(S) == 4 ? 1e-5 : 1e-13) * std::max(1.0, determinant));
      EXPECT_NEAR(t.reference()(0), S(gain) * (S(1) - t.value()), roundings<S>(10));
      if constexpr (std::is_same_v<S, float>) {
        place(twin, s);
        // "stretched" is singular for the arms: the kink of μ.
        testing_support::expect_same(t, exact, s.name == "stretched");
      }
    }
  }
}

// Matrices of known singular values, down to what is singular as far as rounding can tell.
TEST(Manipulability, TheMeasureIsThatOfTheSingularValues) {
  std::mt19937 rng(5);
  std::normal_distribution<double> normal;
  const auto orthogonal = [&](Index n, Index columns) {
    Eigen::MatrixXd a(n, n);
    for (Index i = 0; i < a.size(); ++i) a(i) = normal(rng);
    return Eigen::MatrixXd(testing_support::orthogonal(a).leftCols(columns));
  };
  for (const Index m : {1, 2, 3, 5, 6, 7, 12}) {
    const Index side = std::min<Index>(m, 6);
    for (const double smallest : {1.0, 1e-2, 1e-5, 1e-9, 0.0}) {
      SCOPED_TRACE(testing::Message() << m << ' ' << smallest);
      Eigen::VectorXd sigma(side), others = Eigen::VectorXd::Ones(side);
      for (Index k = 0; k < side; ++k) sigma(k) = 1 + 0.3 * static_cast<double>(k);
      sigma(side - 1) = m == 1 ? 1 : smallest;
      for (Index k = 0; k < side; ++k) {
        for (Index l = 0; l < side; ++l) others(k) *= l == k ? 1 : sigma(l);
      }
      const Eigen::MatrixXd u = orthogonal(6, side), v = orthogonal(m, side);
      const Eigen::MatrixXd J = u * sigma.asDiagonal() * v.transpose();
      icat::detail::ManipulabilityMeasure<double> measure(m);
      for (Index j = 0; j < m; ++j) {
        for (Index i = 0; i < 6; ++i) measure(i, j) = J(i, j);
      }
      // J itself is known to some 1e-15, and so are its singular values.
      EXPECT_NEAR(measure.compute(), sigma.prod(), 1e-14 * others.maxCoeff());
      Eigen::MatrixXd Y = u * others.asDiagonal() * v.transpose();
      if (sigma.minCoeff() == 0) Y.setZero();
      const double tolerance = sigma.minCoeff() > 0 ? 1e-14 / sigma.minCoeff() : 0;
      for (Index j = 0; j < m; ++j) {
        for (Index i = 0; i < 6; ++i) {
          EXPECT_NEAR(measure(i, j), Y(i, j), tolerance * others.maxCoeff());
        }
      }
    }
  }
}

// [MARIS]'s μ tr(∂J/∂q_i J^#), where it can be evaluated.
TEST(Manipulability, TheGradientIsThatOfTheTraceFormula) {
  using Tree = icat::KinematicTree<double, 7>;
  Tree arm({.joints = icat::axes_chain(icat::maris_arm<double>())});
  const FrameId tip = arm.frame("end_effector");
  task::Manipulability<Tree> mu(arm, tip, Objective::at_least(0.02, 0.01));
  for (const auto& state : testing_support::random_states<double>(20, 3)) {
    const auto jacobian = [&](const icat::Vector<double, 7>& q) {
      EXPECT_EQ(arm.update(q), Status::ok);
      return Eigen::Matrix<double, 6, 7>(arm.jacobian(tip));
    };
    const auto J = jacobian(state.q);
    mu.update();
    EXPECT_NEAR(mu.value(), std::sqrt(testing_support::determinant(J * J.transpose())), 1e-9);
    const Eigen::RowVectorXd gradient = mu.jacobian();
    const double value = mu.value();
    const Eigen::Matrix<double, 7, 6> pinv =
        J.transpose() * testing_support::inverse(J * J.transpose());
    for (Index i = 0; i < 7; ++i) {
      icat::Vector<double, 7> plus = state.q, minus = state.q;
      plus(i) += 1e-6;
      minus(i) -= 1e-6;
      const Eigen::Matrix<double, 6, 7> dJ = (jacobian(plus) - jacobian(minus)) / 2e-6;
      EXPECT_NEAR(gradient(i), value * (dJ * pinv).trace(), 1e-8);
    }
  }
  // Stretched: singular, and no NaN.
  ASSERT_EQ(arm.update(icat::Vector<double, 7>::Zero()), Status::ok);
  mu.update();
  EXPECT_NEAR(mu.value(), 0, 1e-9);
  EXPECT_TRUE(mu.jacobian().allFinite());
  EXPECT_EQ(mu.activation()(0), 1);
}

// A mimic after the joint that it follows, before it, and of another that is a mimic.
TEST(Manipulability, MimicsOnTheWay) {
  std::vector<icat::Joint<double>> joints;
  for (int i = 0; i < 7; ++i) {
    const std::string number = std::to_string(i + 1), before = std::to_string(i);
    icat::Joint<double> joint{"joint" + number, i == 0 ? "base" : "link" + before, "link" + number,
                              i == 4 ? JointType::prismatic : JointType::revolute};
    joint.origin = make_pose<double>(0.3, 0.1 * i, -0.2, 0.4 * i, 0.7, -0.3);
    joints.push_back(joint);
  }
  joints[0].mimic = icat::Mimic<double>{"joint4", -0.7, 0.2};
  joints[4].mimic = icat::Mimic<double>{"joint2", 0.4, 0.1};
  joints[5].mimic = icat::Mimic<double>{"joint5", 2, 0};
  Chain robot({.joints = joints, .base = icat::Base<double>::free()});
  ASSERT_EQ(robot.joints().size(), 4u);
  for (const Names& names :
       std::vector<Names>{{}, {"joint4", "joint2"}, {"joint2"}, {"joint4", "joint7"}}) {
    task::Manipulability<Chain> mu(robot, robot.frame("link7"), Objective::equal_to(1),
                                   {.joints = names, .gain = gain});
    for (const TreeState& s : testing_support::random_tree_states(robot, 10, 23)) {
      testing_support::expect_exact(robot, mu, s, 1e-7);
      EXPECT_GT(mu.jacobian().norm(), 1e-3);
    }
  }
}

// Where the frame is set on another link its gradient is that of the new way.
TEST(Manipulability, OfAFrameThatWasSetElsewhere) {
  Torso robot = make_torso<Torso>();
  const FrameId tool =
      robot.add_frame("tool", robot.frame("left5"), make_pose<double>(0.1, 0, 0.2, 0, 0, 0));
  task::Manipulability<Torso> mu(robot, tool, Objective::equal_to(1), {.gain = gain});
  ASSERT_EQ(robot.set_frame(tool, robot.frame("left_hand"), make_pose<double>(0, 0, 0.1, 1, 0, 0)),
            Status::ok);
  for (const TreeState& s : testing_support::random_tree_states(robot, 5, 29)) {
    testing_support::expect_exact(robot, mu, s);
  }
}

TEST(Manipulability, ObjectivesRatesAndBends) {
  Torso robot = make_torso<Torso>();
  const FrameId hand = robot.frame("left_hand");
  TreeState s{"", testing_support::bent_torso(), icat::Pose<double>::Identity()};
  place(robot, s);
  task::Manipulability<Torso> mu(robot, hand, Objective::at_least(1000, 1),
                                 {.joints = left_arm, .gain = gain, .max_rate = 0.3});
  mu.update();
  EXPECT_EQ(mu.activation()(0), 1);
  EXPECT_EQ(mu.reference()(0), 0.3);
  ASSERT_EQ(mu.set_max_rate(0.1), Status::ok);
  EXPECT_EQ(mu.set_max_rate(nan), Status::out_of_range);
  mu.update();
  EXPECT_EQ(mu.reference()(0), 0.1);
  mu.set_objective(Objective::at_least(1e-9, 1e-9));
  mu.update();
  EXPECT_EQ(mu.activation()(0), 0);
  // The rate has no kink where the arm goes through a singularity.
  mu.set_objective(Objective::at_least(0.05, 0.05));
  const auto [reference, push] = testing_support::steepest(robot, mu, [&](double u) {
    s.q(5) = -1.47 + 1.48 * (2 * u - 1);
    return s;
  });
  EXPECT_LT(reference, 100);
  EXPECT_LT(push, 1e6);  // μ has a kink, its gradient a jump
}

// --- columns -------------------------------------------------------------------------------------

TYPED_TEST(JointTasks, ColumnsAreKeptStillOrGiven) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  place(robot, testing_support::random_tree_states(robot, 1, 3)[0]);
  task::Minimality<Tree> base(robot, robot.base_columns());
  task::Minimality<Tree> joints(robot, icat::joint_columns(robot));
  task::Minimality<Tree> some(robot, {7, 2});
  task::GivenVelocity<Tree> given(robot, {18, 17}, "roll and pitch");
  const Eigen::Matrix<S, 2, 1> v(S(0.1), S(-0.2));
  ASSERT_EQ(given.set_velocity(v), Status::ok);
  for (icat::Task<Tree>* t :
       std::initializer_list<icat::Task<Tree>*>{&base, &joints, &some, &given}) {
    t->update();
    EXPECT_EQ(t->activation().minCoeff(), S(1));
  }
  const Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic> I =
      Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>::Identity(20, 20);
  EXPECT_EQ(base.jacobian(), I.bottomRows(6));
  EXPECT_EQ(joints.jacobian(), I.topRows(14));
  EXPECT_EQ(some.jacobian().row(0), I.row(7));
  EXPECT_EQ(some.jacobian().row(1), I.row(2));
  EXPECT_EQ(given.jacobian().row(0), I.row(18));
  EXPECT_EQ(given.jacobian().row(1), I.row(17));
  EXPECT_EQ(base.reference().norm() + joints.reference().norm() + some.reference().norm(), S(0));
  EXPECT_EQ(given.reference(), v);
  EXPECT_EQ(given.name(), "roll and pitch");
  // Refused: the old one stays.
  EXPECT_EQ(given.set_velocity(Eigen::Matrix<S, 3, 1>::Zero()), Status::wrong_size);
  EXPECT_EQ(given.set_velocity(Eigen::Matrix<S, 2, 1>(S(0), S(nan))), Status::non_finite);
  EXPECT_EQ(given.set_velocity(Eigen::Matrix<S, 2, 1>(S(INFINITY), S(0))), Status::non_finite);
  EXPECT_EQ(given.reference(), v);
}

// --- configuration -------------------------------------------------------------------------------

// C7: what is required is an argument.
static_assert(!std::is_constructible_v<task::JointPosition<Torso>, const Torso&>);
static_assert(!std::is_constructible_v<task::JointPosition<Torso>, const Torso&,
                                       task::JointPosition<Torso>::Options>);
static_assert(!std::is_constructible_v<task::Manipulability<Torso>, const Torso&, FrameId>);
static_assert(!std::is_constructible_v<task::Manipulability<Torso>, const Torso&, Objective>);
static_assert(!std::is_constructible_v<task::Minimality<Torso>, const Torso&>);
static_assert(!std::is_constructible_v<task::GivenVelocity<Torso>, const Torso&>);
static_assert(std::is_constructible_v<task::JointLimits<Torso>, const Torso&>);

TEST(JointErrors, NameTheTaskAndTheJoint) {
  const Chain robot = chain({{JointType::revolute, -1, 1}, {JointType::prismatic, 0, 0.5}});
  const auto limits = [&](task::JointLimits<Chain>::Options options) {
    return message_of([&] { task::JointLimits<Chain>(robot, options); });
  };
  EXPECT_EQ(limits({.name = "stops", .joints = {"joint3"}}),
            "task 'stops': no joint 'joint3'; there are 'joint1', 'joint2'");
  EXPECT_EQ(limits({.joints = {"joint1", "joint1"}}),
            "task 'joint limits': joint 'joint1' stands twice");
  EXPECT_EQ(limits({.margin = {0.1, 0.1, 0.1}}),
            "task 'joint limits': margin has 3 numbers for 2 joints");
  EXPECT_EQ(limits({.margin = -0.1}),
            "task 'joint limits': margin of all joints must be > 0, got -0.1");
  EXPECT_EQ(limits({.margin = {0.1, nan}}),
            "task 'joint limits': margin of joint 'joint2' must be > 0, got nan");
  EXPECT_EQ(limits({.margin = INFINITY}),
            "task 'joint limits': the margin of joint 'joint1' must be finite, got inf");
  EXPECT_EQ(limits({.max_rate = {1.0, 0.0}}),
            "task 'joint limits': max_rate of joint 'joint2' must be > 0, got 0");
  EXPECT_EQ(limits({.gain = nan}), "task 'joint limits': gain must be finite and > 0, got nan");

  const auto position = [&](const Eigen::VectorXd& goal,
                            task::JointPosition<Chain>::Options options = {}) {
    return message_of([&] { task::JointPosition<Chain>(robot, goal, options); });
  };
  EXPECT_EQ(position(positions({1, 2, 3}), {.name = "shape"}),
            "task 'shape': a goal of 3 numbers for 2 joints");
  EXPECT_EQ(position(positions({1, nan})), "task 'joint position': the goal is not finite");
  EXPECT_EQ(position(positions({1}), {.joints = {"elbow"}, .norm = Objective::equal_to(0)}),
            "task 'joint position': no joint 'elbow'; there are 'joint1', 'joint2'");
  EXPECT_EQ(position(positions({1, 2}), {.max_rate = 0.0}),
            "task 'joint position': max_rate of all joints must be > 0, got 0");

  // A robot without joints.
  const Chain hull({.joints = {}, .base = icat::Base<double>::surface(), .root = "hull"});
  EXPECT_EQ(message_of([&] { task::JointLimits<Chain>{hull}; }),
            "task 'joint limits': the robot has no joints");
  EXPECT_EQ(message_of([&] {
              task::JointPosition<Chain>(hull, Eigen::VectorXd(0),
                                         {.norm = Objective::equal_to(0)});
            }),
            "task 'joint position': the robot has no joints");

  const Torso torso = make_torso<Torso>();
  const auto mu = [&](const char* frame, task::Manipulability<Torso>::Options options) {
    return message_of([&] {
      task::Manipulability<Torso>(torso, torso.frame(frame), Objective::at_least(1, 0.1), options);
    });
  };
  EXPECT_EQ(mu("pelvis", {.name = "mu"}), "task 'mu': no joint moves the frame");
  EXPECT_EQ(mu("left_hand", {.joints = right_arm}),
            "task 'manipulability': joint 'right1' does not move the frame");
  // √det of a column that stands twice would always be 0.
  EXPECT_EQ(mu("left_hand", {.joints = {"left1", "left1"}}),
            "task 'manipulability': joint 'left1' stands twice");
  EXPECT_EQ(mu("left_hand", {.max_rate = 0}), "task 'manipulability': max_rate must be > 0, got 0");

  EXPECT_EQ(message_of([&] {
              task::Minimality<Torso>(torso, {3, 20}, "rest");
            }),
            "task 'rest': column 20 is not among the robot's 20");
  EXPECT_EQ(message_of([&] { task::Minimality<Torso>(torso, {-1}); }),
            "task 'minimality': column -1 is not among the robot's 20");
  EXPECT_EQ(message_of([&] {
              task::GivenVelocity<Torso>(torso, {3, 3});
            }),
            "task 'given velocity': column 3 stands twice");
  EXPECT_EQ(message_of([&] { task::Minimality<Torso>(torso, icat::Columns()); }),
            "task 'minimality': needs a row at least, got 0");
}

TYPED_TEST(JointTasks, UpdatesAndSettersDoNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  const icat::Vector<S, Eigen::Dynamic> goal = testing_support::bent_torso().template cast<S>();
  const icat::Vector<S, Eigen::Dynamic> still = S(0) * goal;
  const icat::Vector<S, Eigen::Dynamic> margins = icat::Vector<S, 14>::Constant(S(0.01));
  task::JointLimits<Tree> limits(robot);
  task::JointPosition<Tree> position(robot, goal);
  task::JointPosition<Tree> norm(robot, goal, {.norm = icat::Objective<S>::equal_to(S(0))});
  task::Manipulability<Tree> left(robot, robot.frame("left_hand"),
                                  icat::Objective<S>::at_least(S(1), S(0.1)));
  task::Manipulability<Tree> right(robot, robot.frame("right_hand"),
                                   icat::Objective<S>::at_least(S(1), S(0.1)),
                                   {.joints = right_arm});
  task::Minimality<Tree> minimality(robot, {3});
  task::GivenVelocity<Tree> given(robot, {3});
  const auto s = testing_support::random_tree_states(robot, 1, 5)[0];
  for (icat::Task<Tree>* t : std::initializer_list<icat::Task<Tree>*>{
           &limits, &position, &norm, &left, &right, &minimality, &given}) {
    EXPECT_EQ(testing_support::update_allocations(robot, *t, s), 0) << t->name();
  }
  EXPECT_EQ(count_allocations([&] {
              (void)position.set_goal(goal);
              (void)position.set_goal(goal, still);
              (void)position.set_max_rate(S(1));
              (void)limits.set_max_rate(S(1));
              (void)limits.set_gain(S(1));
              (void)limits.set_margin(S(0.05));
              (void)limits.set_margin(margins);
              (void)given.set_velocity(icat::Vector<S, 1>(S(1)));
            }),
            0);
}

}  // namespace
