// SPDX-License-Identifier: BSD-3-Clause
// Tasks of directions and distances: attitude, look-at, occlusion, distance, centre of mass; at
// random states, aligned, across, opposite, and where points coincide.
#include <gtest/gtest.h>

#include <icat/task/direction_tasks.hpp>
#include <icat/task/distance_tasks.hpp>
#include <memory>
#include <random>

#include "support/linear_algebra.hpp"
#include "support/task_checks.hpp"

namespace {

using icat::FrameId;
using icat::Pose;
using icat::Status;
using icat::Vector3;
using testing_support::gain;
using testing_support::make_pose;
using testing_support::make_torso;
using testing_support::message_of;
using testing_support::place;
using testing_support::Torso;
using testing_support::TorsoOf;
using testing_support::TreeState;
using testing_support::with_frame_at;
using Objective = icat::Objective<double>;
namespace task = icat::task;
constexpr double pi = std::numbers::pi;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class K>
class DirectionTasks : public testing::Test {};
TYPED_TEST_SUITE(DirectionTasks, testing_support::AllKinds);

template <class S>
Vector3<S> vector(double x, double y, double z) {
  return {S(x), S(y), S(z)};
}
template <class S>
icat::Objective<S> equal(double x) {
  return icat::Objective<S>::equal_to(S(x));
}

// Where things are in the awkward states below.
constexpr double target[3] = {1.0, -0.5, 2.5};

// One task of each kind and form, by number; the reference is γ (x* − x) with a fixed x*.
constexpr int case_count = 13;
template <class R>
std::unique_ptr<icat::Task<R>> make_case(const R& robot, int number) {
  using S = typename R::Scalar;
  const FrameId camera = robot.frame("camera"), elbow = robot.frame("left4"),
                hand = robot.frame("right_hand");
  const Vector3<S> point = vector<S>(target[0], target[1], target[2]);
  const Vector3<S> oblique = vector<S>(0.48, -0.6, 0.64), other = vector<S>(-0.6, 0, 0.8);
  const S g = S(gain);
  switch (number) {
    case 0:
      return std::make_unique<task::Attitude<R>>(robot, hand,
                                                 typename task::Attitude<R>::Options{.gain = g});
    case 1:
      return std::make_unique<task::Attitude<R>>(
          robot, hand, typename task::Attitude<R>::Options{.norm = equal<S>(0), .gain = g});
    case 2:
      return std::make_unique<task::Attitude<R>>(
          robot, hand,
          typename task::Attitude<R>::Options{.axis = oblique, .world_axis = other, .gain = g});
    case 3:
      return std::make_unique<task::Attitude<R>>(
          robot, hand,
          typename task::Attitude<R>::Options{
              .axis = oblique, .world_axis = other, .norm = equal<S>(0), .gain = g});
    case 4:
      return std::make_unique<task::LookAt<R>>(robot, camera, point,
                                               typename task::LookAt<R>::Options{.gain = g});
    case 5:
      return std::make_unique<task::LookAt<R>>(
          robot, camera, point,
          typename task::LookAt<R>::Options{.axis = oblique, .norm = equal<S>(0), .gain = g});
    case 6:
      return std::make_unique<task::LookAt<R>>(
          robot, camera, elbow, typename task::LookAt<R>::Options{.axis = oblique, .gain = g});
    case 7:
      return std::make_unique<task::LookAt<R>>(
          robot, camera, elbow, typename task::LookAt<R>::Options{.norm = equal<S>(0), .gain = g});
    case 8:
      return std::make_unique<task::Occlusion<R>>(robot, camera, elbow, equal<S>(1),
                                                  typename task::Occlusion<R>::Options{.gain = g});
    case 9:
      return std::make_unique<task::FrameDistance<R>>(
          robot, hand, point, equal<S>(1), typename task::FrameDistance<R>::Options{.gain = g});
    case 10:
      return std::make_unique<task::FrameDistance<R>>(
          robot, hand, elbow, equal<S>(1), typename task::FrameDistance<R>::Options{.gain = g});
    case 11:
      return std::make_unique<task::CenterOfMass<R>>(
          robot, point, typename task::CenterOfMass<R>::Options{.gain = g});
    default:
      return std::make_unique<task::CenterOfMass<R>>(
          robot, point,
          typename task::CenterOfMass<R>::Options{.axes = {true, true, false}, .gain = g});
  }
}

// The camera on, nearly on, across, nearly and exactly opposite to the target; the hand at it; the
// same for the hand's axes and those of ⟨0⟩.
std::vector<TreeState> aimed_states(Torso& robot) {
  const TreeState bent{"", testing_support::bent_torso(), Pose<double>::Identity()};
  const FrameId camera = robot.frame("camera"), hand = robot.frame("right_hand");
  std::vector<TreeState> states;
  for (const auto& [name, angle] : {std::pair{"on", 0.0},
                                    {"nearly on", 5e-3},
                                    {"across", pi / 2},
                                    {"behind", pi - 0.4},
                                    {"nearly opposite", pi - 5e-3},
                                    {"opposite", pi}}) {
    // z of the frame turned away from z of ⟨0⟩, along which the target is.
    states.push_back(
        with_frame_at(robot, bent, camera, make_pose<double>(1, -0.5, 1.5, angle, 0, 0)));
    states.back().name = std::string("camera ") + name;
    states.push_back(with_frame_at(robot, bent, hand, make_pose<double>(1, 1, 1, angle, 0, 0)));
    states.back().name = std::string("hand ") + name;
  }
  for (const double away : {0.0, 0.01, 0.08}) {
    states.push_back(
        with_frame_at(robot, bent, hand,
                      make_pose<double>(target[0], target[1], target[2] - away, 0.2, 0.3, 0.4)));
    states.back().name = "hand " + std::to_string(away) + " from the target";
    states.push_back(
        with_frame_at(robot, bent, camera,
                      make_pose<double>(target[0], target[1], target[2] - away, 0.2, 0.3, 0.4)));
    states.back().name = "camera " + std::to_string(away) + " from the target";
  }
  return states;
}

// Whether the task is in component form, whose ẋ is the velocity of the direction.
bool is_velocity(int number) { return number < 8 && number % 2 == 0; }

// The direction that the task of this number measures, components on its frame, and its u.
template <class R>
std::pair<Vector3<double>, Vector3<double>> direction(const R& robot, int number) {
  const Vector3<double> oblique(0.48, -0.6, 0.64), z(0, 0, 1);
  if (number < 4) {
    const Vector3<double> world = number < 2 ? z : Vector3<double>(-0.6, 0, 0.8);
    return {robot.pose(robot.frame("right_hand")).linear().transpose() * world,
            number < 2 ? z : oblique};
  }
  const auto camera = robot.pose(robot.frame("camera"));
  const Vector3<double> p = number == 4
                                ? Vector3<double>(target[0], target[1], target[2])
                                : Vector3<double>(robot.pose(robot.frame("left4")).translation());
  return {(camera.inverse() * p).normalized(), number == 4 ? z : oblique};
}

// The rows of the component form span all motions of the direction d across itself, unstretched,
// and along ξ they are the rate of the angle.
template <class Tree>
void expect_velocity_of_direction(Tree& robot, icat::Task<Tree>& task, int number,
                                  const TreeState& s) {
  const auto d_rate = testing_support::differentiate(
      robot, s, [&](const Tree& moved) { return Eigen::VectorXd(direction(moved, number).first); });
  task.update();
  const Eigen::MatrixXd J = task.jacobian();
  EXPECT_LT((J.transpose() * J - d_rate.transpose() * d_rate).norm(),
            1e-6 * (1 + d_rate.squaredNorm()));
  const auto [d, u] = direction(robot, number);
  const double angle = std::atan2(u.cross(d).norm(), u.dot(d));
  // Within 0.01 rad of π the way chosen may be the longer one.
  EXPECT_NEAR(task.reference().norm(), gain * angle,
              gain * (angle > pi - 0.01 ? 2 * (pi - angle) + 1e-9 : 1e-9));
  EXPECT_EQ(task.activation(), Eigen::VectorXd::Ones(2));
  if (angle < 1e-3 || angle > pi - 0.02) return;
  const Eigen::RowVectorXd angle_rate =
      testing_support::differentiate(robot, s, [&](const Tree& moved) {
        const auto [at, axis] = direction(moved, number);
        return icat::Vector<double, 1>(std::atan2(axis.cross(at).norm(), axis.dot(at)));
      });
  task.update();
  const Eigen::VectorXd n = -task.reference().normalized();  // along ξ
  EXPECT_LT((n.transpose() * J - angle_rate).norm(), 1e-5 * (1 + J.norm()));
}

TYPED_TEST(DirectionTasks, JacobiansAreExact) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  Torso twin = make_torso<Torso>();
  auto aimed = aimed_states(twin);
  const auto states = testing_support::all_torso_states(robot, sanitized ? 4 : 25, 11);
  for (int i = 0; i < case_count; ++i) {
    const auto t = make_case(robot, i);
    const auto exact = make_case(twin, i);
    const auto check = [&](const TreeState& s, bool kink) {
      SCOPED_TRACE(testing::Message() << i << ' ' << t->name() << ": " << s.name);
      // In the lens the direction turns within the step of the differences.
      const bool in_the_lens = s.name == "camera 0.000000 from the target";
      if constexpr (std::is_same_v<S, double>) {
        if (is_velocity(i) && !in_the_lens) {
          place(robot, s);
          expect_velocity_of_direction(robot, *t, i, s);
        }
      }
      if (!is_velocity(i) && !in_the_lens) testing_support::expect_exact(robot, *t, s);
      if constexpr (std::is_same_v<S, float>) {
        place(robot, s);
        place(twin, s);
        // Closer than its rounding float cannot tell where the target is.
        if (!in_the_lens) testing_support::expect_same(*t, *exact, kink);
      }
    };
    for (const TreeState& s : states) check(s, false);
    for (const TreeState& s : aimed) check(s, true);
  }
}

// --- values --------------------------------------------------------------------------------------

TEST(Directions, AnglesReferencesAndActivations) {
  Torso robot = make_torso<Torso>();
  const FrameId hand = robot.frame("right_hand");
  const TreeState bent{"", testing_support::bent_torso(), Pose<double>::Identity()};
  place(robot, with_frame_at(robot, bent, hand, make_pose<double>(1, 2, 3, 0.35, 0, 0)));
  task::Attitude<Torso> norm(robot, hand, {.norm = Objective::at_most(0.4, 0.1), .gain = gain});
  norm.update();
  EXPECT_NEAR(norm.angle(), 0.35, 1e-12);
  EXPECT_NEAR(norm.activation()(0), 0.5, 1e-9);
  EXPECT_NEAR(norm.reference()(0), gain * (0.3 - 0.35), 1e-12);
  task::Attitude<Torso> components(robot, hand, {.gain = gain});
  components.update();
  ASSERT_EQ(components.rows(), 2);
  EXPECT_NEAR(components.reference().norm(), gain * 0.35, 1e-12);
  EXPECT_EQ(components.activation(), Eigen::VectorXd::Ones(2));

  // A point of the cone of 0.5 rad half-way into the margin.
  task::LookAt<Torso> look(robot, hand,
                           robot.pose(hand) * Vector3<double>(0, std::sin(0.45), std::cos(0.45)),
                           {.norm = Objective::at_most(0.5, 0.1), .gain = gain});
  look.update();
  EXPECT_NEAR(look.angle(), 0.45, 1e-9);
  EXPECT_NEAR(look.activation()(0), 0.5, 1e-6);

  // A small step of what is asked for turns the frame towards the target.
  place(robot, bent);
  task::LookAt<Torso> turn(robot, hand, robot.pose(hand) * Vector3<double>(0, 1, 1));
  turn.update();
  EXPECT_NEAR(turn.angle(), pi / 4, 1e-9);
  testing_support::displace(robot, bent,
                            Eigen::VectorXd(1e-3 * turn.jacobian().transpose() * turn.reference()));
  turn.update();
  EXPECT_LT(turn.angle(), pi / 4 - 1e-4);
}

TEST(Directions, RatesAreLimitedAsAWholeAndCanBeSet) {
  Torso robot = make_torso<Torso>();
  const FrameId hand = robot.frame("right_hand"), elbow = robot.frame("left4");
  const Vector3<double> point = robot.pose(hand) * Vector3<double>(1, 1, 1);
  task::LookAt<Torso> look(robot, hand, point, {.gain = 3, .max_rate = 0.2});
  look.update();
  EXPECT_NEAR(look.reference().norm(), 0.2, 1e-12);
  ASSERT_EQ(look.set_max_rate(0.4), Status::ok);
  look.update();
  EXPECT_NEAR(look.reference().norm(), 0.4, 1e-12);
  for (const double bad : {0.0, -2.0, nan}) {
    EXPECT_EQ(look.set_max_rate(bad), Status::out_of_range);
    EXPECT_EQ(look.set_gain(bad), Status::out_of_range);
  }
  EXPECT_EQ(look.set_objective(Objective::equal_to(0)), Status::wrong_size);
  look.update();
  EXPECT_NEAR(look.reference().norm(), 0.4, 1e-12);

  task::Occlusion<Torso> hidden(robot, robot.frame("camera"), elbow, Objective::at_least(3, 0.1),
                                {.gain = 100, .max_rate = 0.3});
  hidden.update();
  EXPECT_EQ(hidden.reference()(0), 0.3);
  ASSERT_EQ(hidden.set_objective(Objective::at_least(0.01, 0.005)), Status::ok);
  hidden.update();
  EXPECT_EQ(hidden.activation()(0), 0);
  // Without a minimum there is no cone to stay out of.
  EXPECT_EQ(hidden.set_objective(Objective::at_most(1, 0.1)), Status::out_of_range);
  EXPECT_EQ(hidden.set_objective(Objective::at_least(0, 0.1)), Status::out_of_range);
  hidden.update();
  EXPECT_EQ(hidden.activation()(0), 0);

  task::Attitude<Torso> attitude(robot, hand, {.norm = Objective::at_most(3, 0.1)});
  attitude.update();
  EXPECT_EQ(attitude.activation()(0), 0);
  ASSERT_EQ(attitude.set_objective(Objective::equal_to(0)), Status::ok);
  attitude.update();
  EXPECT_GT(attitude.activation()(0), 0.99);
}

TEST(Directions, TargetsCanBeSetOrAreRefused) {
  Torso robot = make_torso<Torso>();
  const FrameId hand = robot.frame("right_hand"), elbow = robot.frame("left4");
  const Vector3<double> zero(0, 0, 0), bad(0, nan, 0), far(0, 0, INFINITY);
  task::LookAt<Torso> look(robot, hand, robot.pose(hand) * Vector3<double>(0, 0, 1));
  look.update();
  EXPECT_NEAR(look.angle(), 0, 1e-7);
  EXPECT_EQ(look.set_target(bad), Status::non_finite);
  EXPECT_EQ(look.set_target(far), Status::non_finite);
  EXPECT_EQ(look.set_target(zero, bad), Status::non_finite);
  look.update();
  EXPECT_NEAR(look.angle(), 0, 1e-7);
  ASSERT_EQ(look.set_target(robot.pose(hand) * Vector3<double>(0, 1, 0)), Status::ok);
  look.update();
  EXPECT_NEAR(look.angle(), pi / 2, 1e-12);
  task::LookAt<Torso> at_frame(robot, hand, elbow);
  EXPECT_EQ(at_frame.set_target(zero), Status::wrong_size);

  task::Attitude<Torso> attitude(robot, hand);
  attitude.update();
  const double before = attitude.angle();
  EXPECT_EQ(attitude.set_world_axis(bad), Status::non_finite);
  EXPECT_EQ(attitude.set_world_axis({0, 0, 2}), Status::out_of_range);
  EXPECT_EQ(attitude.set_world_axis(zero), Status::out_of_range);
  attitude.update();
  EXPECT_EQ(attitude.angle(), before);
  ASSERT_EQ(attitude.set_world_axis(robot.pose(hand).linear().col(2)), Status::ok);
  attitude.update();
  EXPECT_NEAR(attitude.angle(), 0, 1e-7);

  task::FrameDistance<Torso> distance(robot, hand, zero, Objective::at_least(1, 0.1));
  EXPECT_EQ(distance.set_point(bad), Status::non_finite);
  EXPECT_EQ(distance.set_point(zero, far), Status::non_finite);
  distance.update();
  EXPECT_NEAR(distance.value(), robot.pose(hand).translation().norm(), 1e-12);
  ASSERT_EQ(distance.set_point(robot.pose(hand) * Vector3<double>(0, 3, 0)), Status::ok);
  distance.update();
  EXPECT_NEAR(distance.value(), 3, 1e-12);
  task::FrameDistance<Torso> to_frame(robot, hand, elbow, Objective::at_least(1, 0.1));
  EXPECT_EQ(to_frame.set_point(zero), Status::wrong_size);
  ASSERT_EQ(distance.set_max_rate(0.2), Status::ok);
  EXPECT_EQ(distance.set_max_rate(0), Status::out_of_range);
  distance.set_objective(Objective::at_most(1, 0.1));
  distance.update();
  EXPECT_EQ(distance.reference()(0), -0.2);
  EXPECT_EQ(distance.activation()(0), 1);

  task::CenterOfMass<Torso> balance(robot, robot.center_of_mass(), {.max_rate = 0.5});
  EXPECT_EQ(balance.set_goal(bad), Status::non_finite);
  EXPECT_EQ(balance.set_goal(zero, bad), Status::non_finite);
  balance.update();
  EXPECT_LT(balance.reference().norm(), 1e-15);
  ASSERT_EQ(balance.set_goal(robot.center_of_mass() + Vector3<double>(3, 0, 4)), Status::ok);
  balance.update();
  EXPECT_LT((balance.reference() - Vector3<double>(0.3, 0, 0.4)).norm(), 1e-12);
  ASSERT_EQ(balance.set_max_rate(1), Status::ok);
  EXPECT_EQ(balance.set_max_rate(0), Status::out_of_range);
  EXPECT_EQ(balance.set_max_rate(nan), Status::out_of_range);
  balance.update();
  EXPECT_LT((balance.reference() - Vector3<double>(0.6, 0, 0.8)).norm(), 1e-12);
  // An axis that does not count slows nothing down.
  task::CenterOfMass<Torso> across(robot, robot.center_of_mass() + Vector3<double>(3, 0, 4),
                                   {.axes = {true, true, false}, .max_rate = 0.5});
  across.update();
  EXPECT_LT((across.reference() - Eigen::Vector2d(0.5, 0)).norm(), 1e-12);
}

// From everywhere the direction turns towards its goal, also from just before half a turn.
TEST(Directions, HalfATurnAttractsNothing) {
  Torso robot = make_torso<Torso>();
  const FrameId hand = robot.frame("right_hand");
  const TreeState bent{"", testing_support::bent_torso(), Pose<double>::Identity()};
  for (const bool norm : {false, true}) {
    const std::optional<Objective> objective =
        norm ? std::optional(Objective::equal_to(0)) : std::nullopt;
    task::Attitude<Torso> attitude(robot, hand, {.norm = objective, .gain = gain});
    task::LookAt<Torso> look(robot, hand, Vector3<double>(0, 0, 50),
                             {.norm = objective, .gain = gain});
    for (icat::Task<Torso>* t : std::initializer_list<icat::Task<Torso>*>{&attitude, &look}) {
      for (const double angle : {0.5, 2.0, 2.6, 2.7, 3.0, pi - 0.09, pi - 0.05, pi - 1e-2}) {
        const TreeState s =
            with_frame_at(robot, bent, hand, make_pose<double>(0, 0, 0, angle, 0, 0));
        place(robot, s);
        t->update();
        const Eigen::VectorXd y = t->jacobian().transpose() * t->reference();
        const Eigen::Vector3d omega = robot.jacobian(hand).bottomRows(3) * y;
        EXPECT_LT(omega.x(), 0) << t->name() << ' ' << norm << ' ' << angle;
        EXPECT_GT(t->activation().minCoeff(), 0);
      }
    }
  }
}

// Lets the task alone move a free body by steps of `dt`; how much its frame turned at first.
template <class Tree>
double follow(Tree& robot, icat::Task<Tree>& t, TreeState& s, FrameId frame, int steps, double dt) {
  double first = 0;
  for (int k = 0; k < steps; ++k) {
    place(robot, s);
    t.update();
    const Eigen::MatrixXd J = t.jacobian().template cast<double>();
    const Eigen::VectorXd rate =
        t.reference().template cast<double>().cwiseProduct(t.activation().template cast<double>());
    const Eigen::MatrixXd G =
        J * J.transpose() + 1e-9 * Eigen::MatrixXd::Identity(J.rows(), J.rows());
    const Eigen::VectorXd y = J.transpose() * testing_support::solve(G, rate);
    if (k == 0) first = (robot.jacobian(frame).template cast<double>() * y).tail(3).norm();
    s.q += dt * y.head(14);
    s.base = icat::integrate<double>(s.base, y.tail(6), dt);
  }
  place(robot, s);
  t.update();
  return first;
}

// Straight behind and nearly, without and with noise that would choose another axis each time.
TYPED_TEST(DirectionTasks, WhatIsStraightBehindIsTurnedTo) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  const FrameId hand = robot.frame("right_hand");
  const TreeState bent{"", testing_support::bent_torso(), Pose<double>::Identity()};
  for (const bool norm : {false, true}) {
    const std::optional<icat::Objective<S>> objective =
        norm ? std::optional(equal<S>(0)) : std::nullopt;
    for (const double offset : {0.0, 1e-7, 1e-4, 0.02}) {
      for (const double turn : {0.0, 1.0, 2.0, 3.0, 4.0, 5.0}) {
        for (const bool looks : {false, true}) {
          SCOPED_TRACE(testing::Message() << norm << offset << ' ' << turn << ' ' << looks);
          task::Attitude<Tree> attitude(robot, hand, {.norm = objective, .gain = S(gain)});
          task::LookAt<Tree> look(robot, hand, vector<S>(0, 0, 50),
                                  {.norm = objective, .gain = S(gain)});
          icat::Task<Tree>& t = looks ? static_cast<icat::Task<Tree>&>(look) : attitude;
          Pose<double> behind = make_pose<double>(0, 0, 0, pi - offset, 0, 0);
          behind.linear() =
              icat::rotation_exp<double>(Vector3<double>(0, 0, turn)) * behind.linear();
          TreeState s = with_frame_at(robot, bent, hand, behind);
          const double first = follow(robot, t, s, hand, 60, 0.1);
          EXPECT_GT(first, 3 * gain);
          EXPECT_LT(looks ? look.angle() : attitude.angle(), S(2e-3));
        }
      }
    }
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    for (const double noise : {1e-9, 1e-6, 1e-3}) {
      task::Attitude<Tree> t(robot, hand, {.norm = objective, .gain = S(gain)});
      Eigen::VectorXd last;
      for (int k = 0; k < 200; ++k) {
        place(robot, with_frame_at(robot, bent, hand,
                                   make_pose<double>(0, 0, 0, pi + noise * normal(random),
                                                     noise * normal(random), 0)));
        t.update();
        const Eigen::VectorXd push =
            (t.jacobian().transpose() * t.activation().cwiseAbs2().cwiseProduct(t.reference()))
                .template cast<double>();
        if (k > 0) {
          // Of |J|² γ π, the noise and roundings.
          EXPECT_LT((push - last).norm(),
                    100 * (20 * noise + 100 * std::numeric_limits<S>::epsilon()));
        }
        last = push;
      }
    }
  }
}

// Whatever was there before: a target at rest is reached.
TEST(Directions, ATargetAtRestIsReachedFromEveryMemory) {
  Torso robot = make_torso<Torso>();
  const FrameId hand = robot.frame("right_hand");
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  // In the norm form also to a minimum straight behind and to a value shortly before.
  for (const auto& [objective, goal] : std::vector<std::pair<std::optional<Objective>, double>>{
           {std::nullopt, 0}, {Objective::equal_to(0), 0}, {Objective::equal_to(3.0), 3.0}}) {
    for (int trial = 0; trial < (sanitized ? 5 : 60); ++trial) {
      SCOPED_TRACE(testing::Message() << goal << ' ' << trial);
      task::Attitude<Torso> t(robot, hand, {.norm = objective, .gain = gain});
      TreeState s{"", testing_support::bent_torso(), Pose<double>::Identity()};
      const double end = 2 * pi * uniform(random), speed = 0.01 + 0.2 * uniform(random),
                   offset = uniform(random) < 0.5 ? 0 : 0.5 * uniform(random);
      for (double angle = 0; angle < end; angle += speed) {
        s = with_frame_at(robot, {"", testing_support::bent_torso(), Pose<double>::Identity()},
                          hand, make_pose<double>(0, 0, 0, angle, offset, 0.3));
        place(robot, s);
        t.update();
      }
      // A norm has no direction at 0, from where it is to grow.
      if (goal > 0 && !(t.angle() > 1e-3)) continue;
      follow(robot, t, s, hand, 350, 0.1);
      EXPECT_NEAR(t.angle(), goal, 1e-3);
    }
  }
}

// What moves by itself is made up for: where J ẏ is the feed-forward the error stands still.
TEST(Directions, FeedForwardFollowsAMovingTarget) {
  Torso robot = make_torso<Torso>();
  const FrameId hand = robot.frame("right_hand");
  const Vector3<double> point(1, -0.5, 2.5), v(0.3, -0.2, 0.5), still(0, 0, 0);
  const double h = 1e-6;
  const auto expect_forward = [&](auto& t, auto&& set) {
    double most = 0;
    for (const TreeState& s : testing_support::random_tree_states(robot, 5, 3)) {
      const auto at = [&](double time, const Eigen::VectorXd& y, const Vector3<double>& velocity) {
        testing_support::displace(robot, s, Eigen::VectorXd(time * y));
        if (set(time, velocity) != Status::ok) throw std::runtime_error("refused");
        t.update();
        return Eigen::VectorXd(t.reference());
      };
      const Eigen::VectorXd rest = Eigen::VectorXd::Zero(20);
      const Eigen::VectorXd forward = at(0, rest, v) - at(0, rest, still);
      most = std::max(most, forward.norm());
      const Eigen::MatrixXd J = t.jacobian();
      const Eigen::VectorXd y = J.transpose() * testing_support::solve(J * J.transpose(), forward);
      const Eigen::VectorXd change = (at(h, y, still) - at(-h, y, still)) / (2 * h);
      EXPECT_LT(change.norm(), 1e-7) << t.name() << ": " << s.name;
    }
    EXPECT_GT(most, 0.05) << t.name();
  };
  for (const bool norm : {false, true}) {
    const std::optional<Objective> objective =
        norm ? std::optional(Objective::equal_to(0)) : std::nullopt;
    task::LookAt<Torso> look(robot, hand, point, {.norm = objective, .gain = gain});
    expect_forward(look, [&](double time, const Vector3<double>& velocity) {
      return look.set_target(point + time * v, velocity);
    });
    // Only directions: a unit vector moves across itself.
    const Vector3<double> axis(0.48, -0.6, 0.64), across = v - axis * axis.dot(v);
    task::Attitude<Torso> attitude(robot, hand, {.norm = objective, .gain = gain});
    expect_forward(attitude, [&](double time, const Vector3<double>& velocity) {
      return attitude.set_world_axis((axis + time * across).normalized(),
                                     velocity == still ? still : across);
    });
  }
  task::FrameDistance<Torso> distance(robot, hand, point, Objective::equal_to(1), {.gain = gain});
  expect_forward(distance, [&](double time, const Vector3<double>& velocity) {
    return distance.set_point(point + time * v, velocity);
  });
  task::CenterOfMass<Torso> balance(robot, point, {.axes = {true, false, true}, .gain = gain});
  expect_forward(balance, [&](double time, const Vector3<double>& velocity) {
    return balance.set_goal(point + time * v, velocity);
  });
}

// --- where there is no direction -----------------------------------------------------------------

TYPED_TEST(DirectionTasks, UndefinedDirectionsAreZeroNotNan) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  const FrameId camera = robot.frame("camera"), hand = robot.frame("right_hand");
  const Vector3<S> lens = robot.pose(camera).translation();
  task::LookAt<Tree> look(robot, camera, lens);
  look.update();
  EXPECT_EQ(look.activation().norm(), S(0));
  EXPECT_EQ(look.jacobian().norm(), S(0));
  // It comes back.
  ASSERT_EQ(look.set_target(lens + vector<S>(0, 0, 1)), Status::ok);
  look.update();
  EXPECT_EQ(look.activation().minCoeff(), S(1));
  task::FrameDistance<Tree> distance(robot, hand, robot.pose(hand).translation(),
                                     icat::Objective<S>::at_least(S(1), S(0.5)));
  distance.update();
  EXPECT_EQ(distance.jacobian().norm(), S(0));
  EXPECT_EQ(distance.activation()(0), S(0));
  EXPECT_EQ(distance.reference()(0), S(1.5));
  // To come together nothing has to fade: at distance 0 it is done.
  task::FrameDistance<Tree> meet(robot, hand, robot.pose(hand).translation(),
                                 icat::Objective<S>::at_most(S(1), S(0.5)));
  meet.update();
  EXPECT_EQ(meet.activation()(0), S(0));
  EXPECT_EQ(meet.reference()(0), S(0));
}

// --- no jump -------------------------------------------------------------------------------------

// What is bounded is the step of each update: behind, the axis comes round in a number of them.
TEST(Directions, NothingJumpsThroughAlignedAndOpposite) {
  Torso robot = make_torso<Torso>();
  const FrameId camera = robot.frame("camera"), hand = robot.frame("right_hand");
  const TreeState bent{"", testing_support::bent_torso(), Pose<double>::Identity()};
  for (const bool norm : {false, true}) {
    for (const double offset : {0.0, 1e-7, 1e-3, 0.1}) {
      SCOPED_TRACE(testing::Message() << norm << ' ' << offset);
      const std::optional<Objective> objective =
          norm ? std::optional(Objective::at_most(0.3, 0.1)) : std::nullopt;
      task::Attitude<Torso> attitude(robot, hand, {.norm = objective, .gain = gain});
      task::LookAt<Torso> look(robot, camera, Vector3<double>(target[0], target[1], target[2]),
                               {.norm = objective, .gain = gain});
      for (icat::Task<Torso>* t : std::initializer_list<icat::Task<Torso>*>{&attitude, &look}) {
        const FrameId frame = t == &look ? camera : hand;
        const auto [reference, push] = testing_support::steepest(robot, *t, [&](double u) {
          return with_frame_at(robot, bent, frame,
                               make_pose<double>(1, -0.5, 1.5, 2 * pi * u, offset, 0));
        });
        // γ times an angle of at most π + 0.5, whose axis turns by π/100; of the sweep itself, the
        // axis at least 0.5 rad from π. The rows turn by twice as much.
        const int steps = sanitized ? 2'000 : 20'000;
        const double step = gain * ((pi + 0.5) * pi / 100 + 3 * (pi + 0.5) * 2 * pi / steps);
        EXPECT_LT(reference / steps, step) << t->name();
        EXPECT_LT(push / steps, 3 * 6 * step) << t->name();  // |J| is 5
        EXPECT_GT(push, 1) << t->name();
      }
    }
  }
}

// The arm swings through the optical axis; the hand flies through the point.
TEST(Directions, NothingJumpsThroughTheAxisNorThroughAPoint) {
  Torso robot = make_torso<Torso>();
  const FrameId elbow = robot.frame("left4"), hand = robot.frame("left_hand");
  TreeState bent{"", testing_support::bent_torso(), Pose<double>::Identity()};
  place(robot, bent);
  // A camera on the chest with the elbow on its axis in the middle of the swing.
  const Vector3<double> sight =
      (robot.pose(elbow).translation() - Vector3<double>(0, 0, 3)).normalized();
  Pose<double> camera = Pose<double>::Identity();
  camera.linear() =
      Eigen::Quaterniond::FromTwoVectors(Vector3<double>::UnitZ(), sight).toRotationMatrix();
  camera.translation() = robot.pose(elbow).translation() - 0.6 * sight;
  const FrameId chest = robot.frame("chest");
  const FrameId eye =
      robot.add_frame("eye", chest, Pose<double>(robot.pose(chest).inverse() * camera));
  task::Occlusion<Torso> occlusion(robot, eye, elbow, Objective::at_least(0.3, 0.1),
                                   {.gain = gain});
  const auto swing = [&](double u) {
    TreeState s = bent;
    s.q(3) += 1.2 * (u - 0.5);
    return s;
  };
  auto [reference, push] = testing_support::steepest(robot, occlusion, swing);
  EXPECT_LT(reference, 100);
  EXPECT_LT(push, 1000);
  EXPECT_GT(push, 1);
  place(robot, bent);
  occlusion.update();
  EXPECT_LT(occlusion.activation()(0), 1e-6);

  task::FrameDistance<Torso> apart(robot, hand, Vector3<double>(0, 0, 0),
                                   Objective::at_least(0.8, 0.1), {.gain = gain});
  std::tie(reference, push) = testing_support::steepest(robot, apart, [&](double u) {
    return with_frame_at(robot, bent, hand, make_pose<double>(2 * u - 1, 0, 0, 0, 0, 0));
  });
  EXPECT_LT(reference, 100);
  EXPECT_LT(push, 1000);
  EXPECT_GT(push, 1);
}

// --- configuration -------------------------------------------------------------------------------

// C7: what is required is an argument.
static_assert(!std::is_constructible_v<task::LookAt<Torso>, const Torso&, FrameId>);
static_assert(!std::is_constructible_v<task::LookAt<Torso>, const Torso&, FrameId,
                                       task::LookAt<Torso>::Options>);
static_assert(!std::is_constructible_v<task::Occlusion<Torso>, const Torso&, FrameId, FrameId>);
static_assert(!std::is_constructible_v<task::Occlusion<Torso>, const Torso&, FrameId, Objective>);
static_assert(!std::is_constructible_v<task::FrameDistance<Torso>, const Torso&, FrameId,
                                       const Vector3<double>&>);
static_assert(
    !std::is_constructible_v<task::FrameDistance<Torso>, const Torso&, FrameId, Objective>);
static_assert(!std::is_constructible_v<task::CenterOfMass<Torso>, const Torso&>);
static_assert(!std::is_constructible_v<task::Attitude<Torso>, const Torso&>);
static_assert(std::is_constructible_v<task::LookAt<Torso>, const Torso&, FrameId, FrameId>);

TEST(Directions, ErrorsOfConfigurationNameTheTask) {
  const Torso robot = make_torso<Torso>();
  const FrameId hand = robot.frame("right_hand"), elbow = robot.frame("left4");
  const Vector3<double> point(1, 2, 3), bad(0, nan, 0);
  EXPECT_EQ(message_of([&] { task::LookAt<Torso>(robot, hand, bad, {.name = "watch"}); }),
            "task 'watch': the target is not finite");
  EXPECT_EQ(message_of([&] {
              task::LookAt<Torso>(robot, hand, point, {.axis = {0, 0, 2}});
            }),
            "task 'look at': the axis must have length 1, got 2");
  EXPECT_EQ(message_of([&] {
              task::Attitude<Torso>(robot, hand, {.axis = {0, 0, nan}});
            }),
            "task 'attitude': the axis must have length 1, got nan");
  EXPECT_EQ(message_of([&] {
              task::Attitude<Torso>(robot, hand, {.world_axis = {0, 0, 0}});
            }),
            "task 'attitude': the world_axis must have length 1, got 0");
  EXPECT_EQ(message_of([&] { task::Attitude<Torso>(robot, hand, {.gain = 0}); }),
            "task 'attitude': gain must be finite and > 0, got 0");
  EXPECT_EQ(message_of([&] { task::Attitude<Torso>(robot, hand, {.max_rate = -1}); }),
            "task 'attitude': max_rate must be > 0, got -1");
  EXPECT_EQ(
      message_of([&] { task::Occlusion<Torso>(robot, hand, elbow, Objective::at_most(1, 0.1)); }),
      "task 'occlusion': the objective needs a minimum > 0, got -inf");
  EXPECT_EQ(message_of([&] {
              task::FrameDistance<Torso>(robot, hand, bad, Objective::at_least(1, 0.1),
                                         {.name = "keep off"});
            }),
            "task 'keep off': the point is not finite");
  EXPECT_EQ(message_of([&] {
              task::FrameDistance<Torso>(robot, hand, point, Objective::at_least(1, 0.1),
                                         {.max_rate = 0});
            }),
            "task 'frame distance': max_rate must be > 0, got 0");
  EXPECT_EQ(message_of([&] { task::CenterOfMass<Torso>(robot, bad); }),
            "task 'center of mass': the goal is not finite");
  EXPECT_EQ(message_of([&] { task::CenterOfMass<Torso>(robot, point, {.axes = icat::no_axes}); }),
            "task 'center of mass': needs a row at least, got 0");
}

TYPED_TEST(DirectionTasks, UpdatesDoNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  const auto s = testing_support::random_tree_states(robot, 1, 5)[0];
  for (int i = 0; i < case_count; ++i) {
    const auto t = make_case(robot, i);
    EXPECT_EQ(testing_support::update_allocations(robot, *t, s), 0) << t->name();
  }
}

}  // namespace
