// SPDX-License-Identifier: BSD-3-Clause
// Tasks of a frame with a goal: every choice of axes, of the frame that they are on, of the frame
// that the goal is in, and of the form; at random states and where the error is 0 or half a turn.
#include <gtest/gtest.h>

#include <icat/control/controller.hpp>
#include <icat/task/frame_tasks.hpp>
#include <random>

#include "support/linear_algebra.hpp"
#include "support/task_checks.hpp"

namespace {

using icat::Axes;
using icat::On;
using icat::Pose;
using icat::Status;
using icat::Vector3;
using icat::Vector6;
using testing_support::difference;
using testing_support::differentiate;
using testing_support::gain;
using testing_support::make_pose;
using testing_support::make_torso;
using testing_support::message_of;
using testing_support::place;
using testing_support::roundings;
using testing_support::Torso;
using testing_support::TorsoOf;
using testing_support::TreeState;
namespace task = icat::task;
constexpr double pi = std::numbers::pi;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class K>
class FrameTasks : public testing::Test {};
TYPED_TEST_SUITE(FrameTasks, testing_support::AllKinds);

// Where the goal is, seen from the frame: here, somewhere, half a turn away about two axes, nearly.
const std::vector<std::pair<const char*, Pose<double>>>& errors() {
  static const std::vector<std::pair<const char*, Pose<double>>> all{
      {"at the goal", make_pose<double>(0, 0, 0, 0, 0, 0)},
      {"somewhere", make_pose<double>(0.4, -1, 0.3, 0.5, -0.4, 1)},
      {"turned little", make_pose<double>(0.1, 0, 0, 6e-3, -5e-3, 4e-3)},
      {"half a turn about x", make_pose<double>(0, 0, 0, pi, 0, 0)},
      {"half a turn about an oblique axis", make_pose<double>(0.1, 0, 0, pi, 0.6, 0)},
      {"nearly half a turn", make_pose<double>(0.1, 0.2, 0.1, 0.02, -0.03, pi - 0.03)}};
  return all;
}

// At the goal and at half a turn.
bool is_kink(const Pose<double>& error) {
  const double angle = icat::rotation_log<double>(error.linear()).norm();
  return angle < 1e-6 || angle > pi - 1e-6;
}

std::vector<Axes> choices() {
  std::vector<Axes> all;
  for (int bits = 1; bits < 8; ++bits) {
    all.push_back({(bits & 1) != 0, (bits & 2) != 0, (bits & 4) != 0});
  }
  return all;
}

template <class Tree>
std::vector<TreeState> some_states(const Tree& robot) {
  auto states = testing_support::random_tree_states(robot, sanitized ? 1 : 3, 11);
  const auto awkward = testing_support::awkward_torso_states();
  states.push_back(awkward[0]);  // stretched
  states.push_back(awkward[3]);  // gimbal lock up
  return states;
}

// ⟨frame⟩ in ⟨reference⟩, or in ⟨0⟩.
template <class Tree>
Pose<typename Tree::Scalar> seen_from(const Tree& robot, std::optional<icat::FrameId> reference,
                                      icat::FrameId frame) {
  return reference ? robot.pose(*reference).inverse() * robot.pose(frame) : robot.pose(frame);
}

// Its twist per ẏ, on the axes of the reference or of the frame as they are now; by differences in
// double, and for float by the double robot.
template <class Tree>
Eigen::MatrixXd twist(Tree& robot, const TreeState& s, std::optional<icat::FrameId> reference,
                      icat::FrameId frame, On on) {
  place(robot, s);
  const Pose<double> at = seen_from(robot, reference, frame);
  Eigen::MatrixXd J = differentiate(robot, s, [&](const Tree& moved) {
    return Vector6<double>(difference<double>(at, seen_from(moved, reference, frame)));
  });
  if (on == On::frame) {
    J.topRows(3) = (at.linear().transpose() * J.topRows(3)).eval();
    J.bottomRows(3) = (at.linear().transpose() * J.bottomRows(3)).eval();
  }
  return J;
}

std::vector<Eigen::Index> chosen(const Axes& linear, const Axes& angular) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < 6; ++i) {
    if (i < 3 ? linear[i] : angular[i - 3]) rows.push_back(i);
  }
  return rows;
}

// --- component form of all three axes: the frame's velocity --------------------------------------

TYPED_TEST(FrameTasks, AllAxesAreTheFramesVelocityAndTheReferenceIsTheError) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  Torso exact = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  for (const std::optional<icat::FrameId> reference :
       {std::optional<icat::FrameId>(), std::optional(robot.frame("right_hand"))}) {
    for (const On on : {On::reference, On::frame}) {
      const auto I = Pose<S>::Identity();
      task::FramePose<Tree> pose(robot, hand, I,
                                 {.relative_to = reference, .on = on, .gain = S(gain)});
      task::FramePosition<Tree> position(robot, hand, Vector3<S>(0, 0, 0),
                                         {.relative_to = reference, .on = on, .gain = S(gain)});
      task::FrameOrientation<Tree> orientation(
          robot, hand, I.linear(), {.relative_to = reference, .on = on, .gain = S(gain)});
      ASSERT_EQ(pose.rows(), 6);
      for (const TreeState& s : some_states(robot)) {
        SCOPED_TRACE(s.name);
        const Eigen::MatrixXd J = twist(exact, s, reference, hand, on);
        place(robot, s);
        const Pose<S> at = seen_from(robot, reference, hand);
        for (const auto& [name, error] : errors()) {
          SCOPED_TRACE(name);
          const Pose<S> goal = at * error.template cast<S>();
          ASSERT_EQ(pose.set_goal(goal), Status::ok);
          ASSERT_EQ(position.set_goal(goal.translation()), Status::ok);
          ASSERT_EQ(orientation.set_goal(goal.linear()), Status::ok);
          for (icat::Task<Tree>* t :
               std::initializer_list<icat::Task<Tree>*>{&pose, &position, &orientation}) {
            t->update();
          }
          Vector6<S> expected;
          expected << goal.translation() - at.translation(),
              icat::rotation_log<S>(goal.linear() * at.linear().transpose());
          // At π its largest component is positive.
          Eigen::Index largest = 0;
          expected.template tail<3>().cwiseAbs().maxCoeff(&largest);
          if (is_kink(error) && expected(3 + largest) < 0) expected.template tail<3>() *= S(-1);
          EXPECT_EQ(pose.position_error(), position.position_error());
          EXPECT_EQ(pose.orientation_error(), orientation.orientation_error());
          EXPECT_NEAR(pose.position_error(), expected.template head<3>().norm(), roundings<S>(100));
          EXPECT_NEAR(pose.orientation_error(), expected.template tail<3>().norm(),
                      roundings<S>(100));
          if (on == On::frame) {
            expected.template head<3>() =
                (at.linear().transpose() * expected.template head<3>()).eval();
            expected.template tail<3>() =
                (at.linear().transpose() * expected.template tail<3>()).eval();
          }
          // Differences in double; in float the rounding of ten products.
          const double tolerance = sizeof(S) == 4 ? 1e-4 : 1e-7;
          EXPECT_LT((pose.jacobian().template cast<double>() - J).norm(), tolerance);
          EXPECT_LT((position.jacobian().template cast<double>() - J.topRows(3)).norm(), tolerance);
          EXPECT_LT((orientation.jacobian().template cast<double>() - J.bottomRows(3)).norm(),
                    tolerance);
          const S rounding = roundings<S>(200);
          EXPECT_LT((pose.reference() - S(gain) * expected).norm(), rounding);
          EXPECT_LT((position.reference() - S(gain) * expected.template head<3>()).norm(),
                    rounding);
          EXPECT_LT((orientation.reference() - S(gain) * expected.template tail<3>()).norm(),
                    rounding);
          for (const auto* t :
               std::initializer_list<const icat::Task<Tree>*>{&pose, &position, &orientation}) {
            EXPECT_EQ(t->activation().minCoeff(), S(1));
          }
        }
      }
    }
  }
}

// --- parts of the axes, and norms: exact derivatives ---------------------------------------------

// Every state with every error, the goal set by `aim`.
template <class Tree, class T, class E, class Aim>
void expect_exact_everywhere(Tree& robot, T& t, Torso& reference_robot, E& exact,
                             std::optional<icat::FrameId> reference, bool norm, Aim&& aim) {
  using S = typename Tree::Scalar;
  for (const TreeState& s : some_states(robot)) {
    for (const auto& [name, error] : errors()) {
      SCOPED_TRACE(s.name + ", " + name);
      place(reference_robot, s);
      place(robot, s);
      const Pose<double> goal = seen_from(reference_robot, reference, exact.frame()) * error;
      aim(t, Pose<S>(goal.template cast<S>()));
      // A norm has a kink at 0, of which a difference sees both sides; at 0 to rounding, as where
      // half a turn leaves this axis alone, its direction is none.
      t.update();
      if (norm && std::abs(t.reference()(0)) < S(1e-9)) continue;
      testing_support::expect_exact(robot, t, s, norm ? 1e-5 : 1e-6);
      if constexpr (std::is_same_v<S, float>) {
        aim(exact, goal);
        testing_support::expect_same(t, exact, is_kink(error));
      }
      if (testing::Test::HasFailure()) return;
    }
  }
}

template <class Tree>
std::vector<std::optional<icat::FrameId>> references(const Tree& robot) {
  return {std::nullopt, robot.frame("camera")};
}

TYPED_TEST(FrameTasks, PositionsOfEveryChoiceOfAxesHaveExactJacobians) {
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  Torso twin = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  for (const auto& reference : references(robot)) {
    for (const On on : {On::reference, On::frame}) {
      for (const Axes& axes : choices()) {
        for (const bool norm : {false, true}) {
          if (!norm && axes.count() == 3) continue;  // the frame's velocity, see above
          SCOPED_TRACE(testing::Message()
                       << axes.x << axes.y << axes.z << " norm " << norm << " on " << int(on)
                       << " relative " << reference.has_value());
          const auto make = [&](auto& r) {
            using R = std::remove_reference_t<decltype(r)>;
            using T = typename R::Scalar;
            std::optional<icat::Objective<T>> objective;
            if (norm) objective = icat::Objective<T>::equal_to(T(0));
            return task::FramePosition<R>(r, hand, Vector3<T>(0, 0, 0),
                                          {.relative_to = reference,
                                           .axes = axes,
                                           .on = on,
                                           .norm = objective,
                                           .gain = T(gain)});
          };
          auto t = make(robot);
          auto exact = make(twin);
          ASSERT_EQ(t.rows(), norm ? 1 : axes.count());
          expect_exact_everywhere(robot, t, twin, exact, reference, norm,
                                  [](auto& x, const auto& goal) {
                                    ASSERT_EQ(x.set_goal(goal.translation()), Status::ok);
                                  });
        }
      }
    }
  }
}

TYPED_TEST(FrameTasks, OrientationsOfEveryChoiceOfAxesHaveExactJacobians) {
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  Torso twin = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  for (const auto& reference : references(robot)) {
    for (const On on : {On::reference, On::frame}) {
      for (const Axes& axes : choices()) {
        for (const bool norm : {false, true}) {
          if (!norm && axes.count() == 3) continue;
          SCOPED_TRACE(testing::Message()
                       << axes.x << axes.y << axes.z << " norm " << norm << " on " << int(on)
                       << " relative " << reference.has_value());
          const auto make = [&](auto& r) {
            using R = std::remove_reference_t<decltype(r)>;
            using T = typename R::Scalar;
            std::optional<icat::Objective<T>> objective;
            if (norm) objective = icat::Objective<T>::equal_to(T(0));
            return task::FrameOrientation<R>(r, hand, icat::Matrix3<T>::Identity(),
                                             {.relative_to = reference,
                                              .axes = axes,
                                              .on = on,
                                              .norm = objective,
                                              .gain = T(gain)});
          };
          auto t = make(robot);
          auto exact = make(twin);
          ASSERT_EQ(t.rows(), norm ? 1 : axes.count());
          expect_exact_everywhere(
              robot, t, twin, exact, reference, norm,
              [](auto& x, const auto& goal) { ASSERT_EQ(x.set_goal(goal.linear()), Status::ok); });
        }
      }
    }
  }
}

// The two parts stand one after the other, each as it is alone.
TYPED_TEST(FrameTasks, APoseIsAPositionAboveAnOrientation) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  const icat::FrameId hand = robot.frame("left_hand"), camera = robot.frame("camera");
  const Pose<S> goal = make_pose<S>(0.4, 0.3, 0.2, 0.5, 0.4, -1);
  const auto norm = icat::Objective<S>::at_most(S(0.2), S(0.1));
  const auto angle = icat::Objective<S>::at_most(S(0.5), S(0.2));
  for (const bool norms : {false, true}) {
    for (const auto& [linear, angular] :
         {std::pair{Axes{}, Axes{}}, std::pair{Axes{true, false, true}, Axes{false, false, true}},
          std::pair{Axes{false, true, false}, icat::no_axes},
          std::pair{icat::no_axes, Axes{true, true, false}}}) {
      SCOPED_TRACE(testing::Message() << linear.count() << angular.count() << norms);
      const std::optional<icat::PoseNorms<S>> both =
          norms ? std::optional(icat::PoseNorms<S>{norm, angle}) : std::nullopt;
      task::FramePose<Tree> pose(robot, hand, goal,
                                 {.relative_to = camera,
                                  .linear = linear,
                                  .angular = angular,
                                  .on = On::frame,
                                  .norms = both,
                                  .gain = S(gain),
                                  .max_linear_rate = S(0.3),
                                  .max_angular_rate = S(0.4)});
      const auto states = testing_support::random_tree_states(robot, 3, 21);
      const auto expect_rows = [&](icat::Task<Tree>& part, Eigen::Index first) {
        for (const TreeState& s : states) {
          place(robot, s);
          pose.update();
          part.update();
          EXPECT_EQ(pose.jacobian().middleRows(first, part.rows()), part.jacobian());
          EXPECT_EQ(pose.reference().segment(first, part.rows()), part.reference());
          EXPECT_EQ(pose.activation().segment(first, part.rows()), part.activation());
        }
        return part.rows();
      };
      Eigen::Index rows = 0;
      if (linear.count() > 0) {
        task::FramePosition<Tree> part(robot, hand, goal.translation(),
                                       {.relative_to = camera,
                                        .axes = linear,
                                        .on = On::frame,
                                        .norm = norms ? std::optional(norm) : std::nullopt,
                                        .gain = S(gain),
                                        .max_rate = S(0.3)});
        rows += expect_rows(part, 0);
      }
      if (angular.count() > 0) {
        task::FrameOrientation<Tree> part(robot, hand, goal.linear(),
                                          {.relative_to = camera,
                                           .axes = angular,
                                           .on = On::frame,
                                           .norm = norms ? std::optional(angle) : std::nullopt,
                                           .gain = S(gain),
                                           .max_rate = S(0.4)});
        rows += expect_rows(part, rows);
      }
      EXPECT_EQ(pose.rows(), rows);
    }
  }
}

// --- velocities ----------------------------------------------------------------------------------

TYPED_TEST(FrameTasks, VelocitiesOfEveryChoiceOfAxes) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  Torso exact = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("right_hand");
  Vector6<S> velocity;
  velocity << S(0.1), S(0.2), S(0.3), S(0.4), S(0.5), S(0.6);
  for (const auto& reference : references(robot)) {
    for (const On on : {On::reference, On::frame}) {
      for (const TreeState& s : some_states(robot)) {
        const Eigen::MatrixXd J = twist(exact, s, reference, hand, on);
        place(robot, s);
        for (const auto& [linear, angular] :
             {std::pair{Axes{}, Axes{}},
              std::pair{Axes{true, false, true}, Axes{false, false, true}},
              std::pair{Axes{false, true, false}, icat::no_axes},
              std::pair{icat::no_axes, Axes{true, true, false}}}) {
          task::FrameVelocity<Tree> t(
              robot, hand,
              {.relative_to = reference, .linear = linear, .angular = angular, .on = on});
          t.update();
          EXPECT_EQ(t.reference().norm(), S(0));
          ASSERT_EQ(t.set_velocity(velocity), Status::ok);
          t.update();
          const auto rows = chosen(linear, angular);
          ASSERT_EQ(t.rows(), static_cast<Eigen::Index>(rows.size()));
          for (Eigen::Index k = 0; k < t.rows(); ++k) {
            const Eigen::Index i = rows[static_cast<std::size_t>(k)];
            EXPECT_LT((t.jacobian().row(k).template cast<double>() - J.row(i)).norm(),
                      sizeof(S) == 4 ? 1e-4 : 1e-7);
            EXPECT_EQ(t.reference()(k), velocity(i));
            EXPECT_EQ(t.activation()(k), S(1));
          }
          // A bad one stops it.
          auto bad = velocity;
          bad(rows.front()) = S(nan);
          EXPECT_EQ(t.set_velocity(bad), Status::non_finite);
          EXPECT_EQ(t.reference().norm(), S(0));
        }
      }
    }
  }
}

// x of a row that is to follow a moving goal: ẋ = J ẏ + ∂x/∂t, so −∂x/∂t goes to the reference.
TEST(FrameGoals, FeedForwardIsTheErrorsDerivativeWithAMovingGoal) {
  Torso robot = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  Vector6<double> v;
  v << 0.3, -0.2, 0.5, 0.4, 0.7, -0.6;
  for (const auto& reference : references(robot)) {
    for (const On on : {On::reference, On::frame}) {
      for (const Axes& axes : choices()) {
        for (const bool norm : {false, true}) {
          SCOPED_TRACE(testing::Message()
                       << axes.x << axes.y << axes.z << " norm " << norm << " on " << int(on)
                       << " relative " << reference.has_value());
          std::optional<icat::PoseNorms<double>> norms;
          if (norm) {
            norms = icat::PoseNorms<double>{icat::Objective<double>::equal_to(0),
                                            icat::Objective<double>::equal_to(0)};
          }
          task::FramePose<Torso> t(robot, hand, Pose<double>::Identity(),
                                   {.relative_to = reference,
                                    .linear = axes,
                                    .angular = axes,
                                    .on = on,
                                    .norms = norms,
                                    .gain = gain});
          for (const TreeState& s : testing_support::random_tree_states(robot, 2, 31)) {
            place(robot, s);
            const Pose<double> goal =
                seen_from(robot, reference, hand) * make_pose<double>(0.4, -1, 0.3, 0.5, -0.4, 1);
            const auto at = [&](double time, const Vector6<double>& velocity) {
              Pose<double> moved = goal;
              moved.translation() += time * v.head<3>();
              moved.linear() = icat::rotation_exp<double>(time * v.tail<3>()) * goal.linear();
              if (t.set_goal(moved, velocity) != Status::ok) throw std::runtime_error("refused");
              t.update();
              return Eigen::VectorXd(t.reference());
            };
            const Vector6<double> still = Vector6<double>::Zero();
            const Eigen::VectorXd forward = at(0, v) - at(0, still);
            if (!norm && axes.count() == 3) {
              // Here ẋ is the frame's velocity, so it is the goal's.
              const icat::Matrix3<double> R =
                  on == On::frame ? icat::Matrix3<double>(
                                        seen_from(robot, reference, hand).linear().transpose())
                                  : icat::Matrix3<double>::Identity();
              EXPECT_LT((forward.head<3>() - R * v.head<3>()).norm(), 1e-14);
              EXPECT_LT((forward.tail<3>() - R * v.tail<3>()).norm(), 1e-14);
              continue;
            }
            const double h = 1e-6;
            const Eigen::VectorXd x_rate = (at(h, still) - at(-h, still)) / (2 * h * -gain);
            EXPECT_LT((forward + x_rate).norm(), 1e-8);
          }
        }
      }
    }
  }
}

// A robot that follows a moving goal with feed-forward has no lag.
TEST(FrameGoals, AMovingGoalIsFollowedWithoutLag) {
  Torso robot = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  TreeState s{"bent", testing_support::bent_torso(), make_pose<double>(0.3, 0.2, 1, 0, 0, 0.7)};
  place(robot, s);
  const Pose<double> start = robot.pose(hand);
  task::FramePose<Torso> t(robot, hand, start, {.gain = 1});
  icat::Controller<Torso> controller(robot, {{"follow", {{t}}}});
  ASSERT_EQ(controller.start("follow", 0), Status::ok);
  Vector6<double> v;
  v << 0.05, -0.02, 0.03, 0.1, 0.2, -0.1;
  const double dt = 1e-3;
  for (int k = 0; k < 1000; ++k) {
    Pose<double> goal = start;
    goal.translation() += k * dt * v.head<3>();
    goal.linear() = icat::rotation_exp<double>(k * dt * v.tail<3>()) * start.linear();
    ASSERT_EQ(t.set_goal(goal, v), Status::ok);
    ASSERT_EQ(controller.step(k * dt), Status::ok);
    const Eigen::VectorXd y = controller.velocity();
    s.q += dt * y.head(14);
    s.base = icat::integrate<double>(s.base, y.tail(6), dt);
    place(robot, s);
  }
  Pose<double> goal = start;
  goal.translation() += 1.0 * v.head<3>();
  goal.linear() = icat::rotation_exp<double>(v.tail<3>()) * start.linear();
  // Without the velocity it would lag by v / γ, 60 mm; Euler's steps leave their curvature.
  EXPECT_LT(difference<double>(goal, robot.pose(hand)).norm(), 1e-4);
}

// --- half a turn ---------------------------------------------------------------------------------

// The largest step of the reference in an update in which the error turns by `step` rad: γ times
// the steepest slope of the fade, 15/8, over 100 updates or 0.5 rad, of an angle of at most π + 1;
// and the error's own step, whose axis turns by half as much.
double largest_step(double step) {
  return gain * ((pi + 1) * 15 / 8 * (0.01 + step / 0.5) + 2 * step);
}

// Rotation vectors of half a turn; their largest component is positive, or the first of two.
const std::vector<Vector3<double>>& half_turns() {
  static const std::vector<Vector3<double>> all = [] {
    std::vector<Vector3<double>> axes{{1, 0, 0}, {0, 1, 0},  {0, 0, 1},
                                      {1, 1, 0}, {1, -1, 0}, {0, 1, -1},
                                      {1, 1, 1}, {1, -1, 1}, {-0.36, -0.48, 0.8}};
    for (auto& axis : axes) axis *= pi / axis.norm();
    return axes;
  }();
  return all;
}

// Lets the task alone move a free body, the torso's base, by steps of `dt`; how it turned at first.
template <class Tree>
Vector3<double> follow(Tree& robot, icat::Task<Tree>& t, TreeState& s, icat::FrameId frame,
                       int steps, double dt) {
  Vector3<double> first(0, 0, 0);
  for (int k = 0; k < steps; ++k) {
    place(robot, s);
    t.update();
    const Eigen::MatrixXd J = t.jacobian().template cast<double>();
    const Eigen::VectorXd rate =
        t.reference().template cast<double>().cwiseProduct(t.activation().template cast<double>());
    const Eigen::VectorXd y =
        J.transpose() *
        testing_support::solve(
            J * J.transpose() + 1e-9 * Eigen::MatrixXd::Identity(J.rows(), J.rows()), rate);
    if (k == 0) first = (robot.jacobian(frame).template cast<double>() * y).template tail<3>();
    s.q += dt * y.head(14);
    s.base = icat::integrate<double>(s.base, y.tail(6), dt);
  }
  place(robot, s);
  t.update();
  return first;
}

// Exactly half a turn away, to rounding on either side: the way is the one documented, and it leads
// to the goal in all forms.
TYPED_TEST(FrameTasks, AGoalTurnedByHalfATurnIsReached) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  const icat::FrameId hand = robot.frame("left_hand");
  for (const On on : {On::reference, On::frame}) {
    for (const bool norm : {false, true}) {
      for (const Axes& axes : {Axes{}, Axes{true, true, false}, Axes{false, false, true}}) {
        for (const Vector3<double>& phi : half_turns()) {
          for (const double beyond : {0.0, -1e-6, 1e-6}) {
            if (beyond != 0 && (sanitized || axes.count() < 3)) continue;
            SCOPED_TRACE(testing::Message() << int(on) << norm << axes.count() << ' '
                                            << phi.transpose() << ' ' << beyond);
            std::optional<icat::Objective<S>> objective;
            if (norm) objective = icat::Objective<S>::equal_to(S(0));
            TreeState s{"bent", testing_support::bent_torso(), Pose<double>::Identity()};
            place(robot, s);
            const icat::Matrix3<double> goal = icat::rotation_exp<double>((1 + beyond) * phi) *
                                               robot.pose(hand).linear().template cast<double>();
            task::FrameOrientation<Tree> t(
                robot, hand, goal.template cast<S>(),
                {.axes = axes, .on = on, .norm = objective, .gain = S(gain)});
            const Vector3<double> first = follow(robot, t, s, hand, 60, 0.1);
            if (axes.count() == 3) {
              EXPECT_NEAR(first.dot(phi), gain * pi * pi, 1e-3);
              // A norm leaves free how the frame turns across.
              if (!norm) {
                EXPECT_LT((first - gain * phi).norm(), 1e-4);
              }
            }
            EXPECT_LT(t.orientation_error(), 2e-3);
          }
        }
      }
    }
  }
}

// A goal that swings through half a turn and far beyond, back and forth, with noise or without.
TEST(FrameGoals, AGoalThatSwingsThroughHalfATurnIsFollowedWithoutAJump) {
  Torso robot = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  place(robot, {"bent", testing_support::bent_torso(), Pose<double>::Identity()});
  const icat::Matrix3<double> at = robot.pose(hand).linear();
  const Vector3<double> axis(0.36, -0.48, 0.8);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (const double noise : {0.0, 1e-9, 1e-6, 1e-3}) {
    for (const double speed : {1e-3, 1e-2, 0.1}) {  // rad per update
      for (const double amplitude : {0.3, 0.6, 2.0}) {
        SCOPED_TRACE(testing::Message() << noise << ' ' << speed << ' ' << amplitude);
        task::FrameOrientation<Torso> t(robot, hand, at, {.gain = gain});
        Eigen::VectorXd last;
        double step = 0, error = 0;
        const int updates = static_cast<int>(20 * amplitude / speed);
        for (int k = 0; k < updates; ++k) {
          const double angle = pi + amplitude * std::sin(k * speed / amplitude);
          const Vector3<double> disturbed =
              angle * axis +
              noise * Vector3<double>(normal(random), normal(random), normal(random));
          ASSERT_EQ(t.set_goal(icat::rotation_exp<double>(disturbed) * at), Status::ok);
          t.update();
          if (k > 0) step = std::max(step, (t.reference() - last).norm());
          last = t.reference();
          error = std::max(error, t.orientation_error());
          if (amplitude < 0.45) {  // the way stays what it was
            EXPECT_LT((t.reference() / gain - disturbed).norm(), 1e-9);
          }
        }
        EXPECT_LT(step, largest_step(speed + 10 * noise));
        EXPECT_LT(error, pi + 1e-9);
        EXPECT_GT(error, pi - speed - 10 * noise - 1e-9);
      }
    }
  }
}

// Noise at half a turn chooses nothing: it goes on as it began.
TYPED_TEST(FrameTasks, NoiseAtHalfATurnDoesNotDither) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  const icat::FrameId hand = robot.frame("left_hand");
  place(robot, {"bent", testing_support::bent_torso(), Pose<double>::Identity()});
  const icat::Matrix3<S> at = robot.pose(hand).linear();
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (const double noise : {1e-9, 1e-6, 1e-3}) {
    for (const Vector3<double>& phi : half_turns()) {
      task::FrameOrientation<Tree> t(robot, hand, at, {.gain = S(gain)});
      for (int k = 0; k < 300; ++k) {
        const Vector3<double> disturbed =
            phi + noise * Vector3<double>(normal(random), normal(random), normal(random));
        ASSERT_EQ(t.set_goal(icat::rotation_exp<S>(disturbed.cast<S>()) * at), Status::ok);
        t.update();
        ASSERT_LT((t.reference().template cast<double>() - gain * phi).norm(),
                  gain * 6 * noise + roundings<S>(500));
      }
    }
  }
}

// Whatever a task remembers, on whatever way it is, half through a change or not: a goal at rest is
// reached, soon.
TEST(FrameGoals, AGoalAtRestIsReachedFromEveryMemory) {
  Torso robot = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (const bool norm : {false, true}) {
    for (const Axes& axes : {Axes{}, Axes{true, false, true}}) {
      for (int trial = 0; trial < (sanitized ? 5 : 60); ++trial) {
        SCOPED_TRACE(testing::Message() << norm << axes.count() << ' ' << trial);
        std::optional<icat::Objective<double>> objective;
        if (norm) objective = icat::Objective<double>::equal_to(0);
        TreeState s{"bent", testing_support::bent_torso(), Pose<double>::Identity()};
        place(robot, s);
        const icat::Matrix3<double> at = robot.pose(hand).linear();
        task::FrameOrientation<Torso> t(robot, hand, at,
                                        {.axes = axes, .norm = objective, .gain = gain});
        const Vector3<double> axis = Vector3<double>::Random().normalized();
        const double end = 2 * pi * uniform(random), speed = 0.01 + 0.2 * uniform(random);
        for (double angle = 0; angle < end; angle += speed) {
          ASSERT_EQ(t.set_goal(icat::rotation_exp<double>(angle * axis) * at), Status::ok);
          t.update();
        }
        follow(robot, t, s, hand, 350, 0.1);
        EXPECT_LT(t.orientation_error(), 1e-3);
      }
    }
  }
}

// A pose that is not a number is forgotten with the next good one.
TEST(FrameGoals, TheWayRecoversFromNaN) {
  icat::detail::RotationWay<double> way;
  icat::detail::AngleWay<double> angle;
  icat::detail::DirectionWay<double> direction;
  const Vector3<double> phi(0.5, -0.2, 3.0);
  for (int k = 0; k < 3; ++k) {
    EXPECT_LT((way.update(icat::rotation_exp<double>(phi)) - phi).norm(), 1e-12);
    EXPECT_TRUE(way.update(icat::Matrix3<double>::Constant(nan)).hasNaN());
    EXPECT_EQ(way.weight(), 1);
    EXPECT_NEAR(angle.update(2 * pi + 3), 3, 1e-12);
    EXPECT_TRUE(std::isnan(angle.update(nan)));
    EXPECT_EQ(angle.weight(), 1);
    const Vector3<double> d(0, std::sin(3.0), std::cos(3.0));
    auto m = icat::misalignment_from_z<double>(d);
    direction.update(d, true, m);
    EXPECT_LT((m.vector - Eigen::Vector2d(-3, 0)).norm(), 1e-12);
    const Vector3<double> bad(nan, 0, 0);
    m = icat::misalignment_from_z<double>(bad);
    direction.update(bad, true, m);
  }
}

// --- no jump -------------------------------------------------------------------------------------

// The hand turns through a whole turn, past error 0 and π. Where the way changes it fades over a
// number of updates: what is bounded is the step of each update.
TEST(FrameGoals, NothingJumpsThroughZeroAndHalfATurn) {
  Torso robot = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  const TreeState bent{"bent", testing_support::bent_torso(), Pose<double>::Identity()};
  for (const bool norm : {false, true}) {
    for (const Axes& axes : choices()) {
      for (const double offset : {0.0, 1e-7, 1e-3}) {
        if (sanitized && offset != 1e-3) continue;
        SCOPED_TRACE(testing::Message() << axes.x << axes.y << axes.z << norm << ' ' << offset);
        std::optional<icat::Objective<double>> objective;
        if (norm) objective = icat::Objective<double>::at_most(0.1, 0.05);
        task::FrameOrientation<Torso> t(robot, hand, icat::Matrix3<double>::Identity(),
                                        {.axes = axes, .norm = objective, .gain = gain});
        const auto [reference, push] = testing_support::steepest(robot, t, [&](double u) {
          return testing_support::with_frame_at(
              robot, bent, hand, make_pose<double>(0.3, 0.2, 1, 2 * pi * u, offset, 0));
        });
        const int steps = sanitized ? 2'000 : 20'000;
        const double step = 2 * pi / steps;  // rad
        if (!norm && axes.count() == 3) {
          EXPECT_LT(reference / steps, largest_step(step));
        }
        EXPECT_LT(push / steps, 10 * largest_step(step));  // |J| is 5
        if (axes.x) {                                      // it turns about x
          EXPECT_GT(push, 1);
        }
      }
    }
  }
}

// It flies through its goal.
TEST(FrameGoals, NothingJumpsThroughTheGoal) {
  Torso robot = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  const TreeState bent{"bent", testing_support::bent_torso(), Pose<double>::Identity()};
  task::FramePose<Torso> t(
      robot, hand, Pose<double>::Identity(),
      {.norms = icat::PoseNorms<double>{icat::Objective<double>::at_most(0.2, 0.1),
                                        icat::Objective<double>::at_most(0.2, 0.1)},
       .gain = gain});
  const auto [reference, push] = testing_support::steepest(robot, t, [&](double u) {
    return testing_support::with_frame_at(robot, bent, hand,
                                          make_pose<double>(2 * u - 1, 0, 0, 0, 0, 0));
  });
  EXPECT_LT(reference, 100);
  EXPECT_LT(push, 1000);
  EXPECT_GT(push, 1);
}

// --- activations, rates --------------------------------------------------------------------------

TEST(FrameGoals, RatesAreLimitedAsAWholeAndCanBeSet) {
  Torso robot = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  const Pose<double> at = robot.pose(hand);
  Pose<double> goal = at;
  goal.translation() += Vector3<double>(3, 4, 0);
  goal.linear() = icat::rotation_exp<double>(Vector3<double>(0, 0.6, 0.8)) * at.linear();
  task::FramePose<Torso> t(robot, hand, goal,
                           {.gain = 1, .max_linear_rate = 0.5, .max_angular_rate = 0.1});
  t.update();
  EXPECT_LT((t.reference().head<3>() - Vector3<double>(0.3, 0.4, 0)).norm(), 1e-12);
  EXPECT_LT((t.reference().tail<3>() - Vector3<double>(0, 0.06, 0.08)).norm(), 1e-12);
  // The goal's own velocity is on top.
  Vector6<double> v = Vector6<double>::Zero();
  v(2) = 7;
  ASSERT_EQ(t.set_goal(goal, v), Status::ok);
  t.update();
  EXPECT_LT((t.reference().head<3>() - Vector3<double>(0.3, 0.4, 7)).norm(), 1e-12);
  ASSERT_EQ(t.set_goal(goal), Status::ok);  // at rest again
  ASSERT_EQ(t.set_max_rates(1, 0.2), Status::ok);
  t.update();
  EXPECT_LT((t.reference().head<3>() - Vector3<double>(0.6, 0.8, 0)).norm(), 1e-12);
  EXPECT_LT((t.reference().tail<3>() - Vector3<double>(0, 0.12, 0.16)).norm(), 1e-12);
  for (const double bad : {0.0, -1.0, nan}) {
    EXPECT_EQ(t.set_max_rates(bad, 3), Status::out_of_range);
    EXPECT_EQ(t.set_max_rates(3, bad), Status::out_of_range);
  }
  t.update();  // neither was taken
  EXPECT_LT((t.reference().head<3>() - Vector3<double>(0.6, 0.8, 0)).norm(), 1e-12);
  EXPECT_LT((t.reference().tail<3>() - Vector3<double>(0, 0.12, 0.16)).norm(), 1e-12);
}

TEST(FrameGoals, NormsFollowTheirObjectives) {
  Torso robot = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  const Pose<double> at = robot.pose(hand);
  Pose<double> goal = at;
  goal.translation() += Vector3<double>(0.09, 0.12, 0);  // 0.15 m
  goal.linear() = icat::rotation_exp<double>(Vector3<double>(0, 0, 0.4)) * at.linear();
  using O = icat::Objective<double>;
  task::FramePose<Torso> t(
      robot, hand, goal,
      {.norms = icat::PoseNorms<double>{O::at_most(0.2, 0.1), O::at_most(0.1, 0.05)}, .gain = 2});
  t.update();
  ASSERT_EQ(t.rows(), 2);
  EXPECT_NEAR(t.activation()(0), 0.5, 1e-12);
  EXPECT_NEAR(t.reference()(0), 2 * (0.1 - 0.15), 1e-12);
  EXPECT_EQ(t.activation()(1), 1);
  EXPECT_NEAR(t.reference()(1), 2 * (0.05 - 0.4), 1e-12);
  ASSERT_EQ(t.set_norms({O::at_most(0.1, 0.05), O::at_most(1, 0.5)}), Status::ok);
  t.update();
  EXPECT_EQ(t.activation()(0), 1);
  EXPECT_EQ(t.activation()(1), 0);
  task::FramePose<Torso> components(robot, hand, goal);
  EXPECT_EQ(components.set_norms({O::equal_to(0), O::equal_to(0)}), Status::wrong_size);
}

// --- cases from the field ------------------------------------------------------------------------

// M12: a 4R arm cannot do six rows; with those that are wanted it jogs at the speed asked for.
TEST(Cases, M12_AnArmOfFourJointsJogsSideways) {
  using J = icat::Joint<double>;
  const auto along_x = [](double x) { return make_pose<double>(x, 0, 0, 0, 0, 0); };
  icat::KinematicTree<double, 4> arm(
      {.joints = {J{"turn", "base", "column"},
                  J{.name = "shoulder", .parent = "column", .link = "upper", .axis = {0, 1, 0}},
                  J{.name = "elbow",
                    .parent = "upper",
                    .link = "lower",
                    .origin = along_x(0.4),
                    .axis = {0, 1, 0}},
                  J{.name = "wrist",
                    .parent = "lower",
                    .link = "hand",
                    .origin = along_x(0.3),
                    .axis = {0, 1, 0}}}});
  const icat::FrameId tip = arm.add_frame("tip", arm.frame("hand"), along_x(0.1));
  ASSERT_EQ(arm.update(icat::Vector<double, 4>(0.3, -0.6, 1.1, -0.4)), Status::ok);
  using Arm = icat::KinematicTree<double, 4>;
  Vector6<double> sideways = Vector6<double>::Zero();
  sideways(1) = 0.05;
  const auto speed = [&](const icat::Axes& angular, On on) {
    task::FrameVelocity<Arm> jog(arm, tip, {.angular = angular, .on = on});
    EXPECT_EQ(jog.set_velocity(sideways), Status::ok);
    icat::Controller<Arm> controller(arm, {{"jog", {{jog}}}});
    EXPECT_EQ(controller.start("jog", 0), Status::ok);
    EXPECT_EQ(controller.step(0), Status::ok);
    Vector3<double> v = arm.jacobian(tip).topRows<3>() * controller.velocity();
    if (on == On::frame) v = arm.pose(tip).linear().transpose() * v;
    return v;
  };
  for (const On on : {On::reference, On::frame}) {
    EXPECT_LT((speed(icat::no_axes, on) - sideways.head<3>()).norm(), 1e-6);
    // All six compete; this is what was reported.
    EXPECT_LT(speed(Axes{}, on).y(), 0.04);
  }
}

// M14: two arms are two frames of one tree, and columns can be kept still.
TEST(Cases, M14_TwoHandsHoldTheirRelativePose) {
  Torso robot = make_torso<Torso>();
  const icat::FrameId left = robot.frame("left_hand"), right = robot.frame("right_hand");
  TreeState s{"bent", testing_support::bent_torso(), make_pose<double>(0.3, 0.2, 1, 0.1, 0, 0.7)};
  place(robot, s);
  const Pose<double> held = robot.pose(right).inverse() * robot.pose(left);
  Pose<double> goal = robot.pose(left);
  goal.translation() += Vector3<double>(0.2, -0.1, -0.3);
  goal.linear() = icat::rotation_exp<double>(Vector3<double>(0.2, 0.3, -0.4)) * goal.linear();
  task::FramePose<Torso> together(robot, left, held, {.name = "together", .relative_to = right});
  task::FramePose<Torso> carry(robot, left, goal, {.name = "carry", .gain = 3});
  icat::Controller<Torso> controller(robot, {{"carry", {{together}, {carry}}}});
  ASSERT_EQ(controller.start("carry", 0), Status::ok);
  const double dt = 0.01;
  double worst = 0;
  for (int k = 0; k < 400; ++k) {
    ASSERT_EQ(controller.step(k * dt), Status::ok);
    const Eigen::VectorXd y = controller.velocity();
    s.q += dt * y.head(14);
    s.base = icat::integrate<double>(s.base, y.tail(6), dt);
    place(robot, s);
    worst = std::max(
        worst, difference<double>(held, robot.pose(right).inverse() * robot.pose(left)).norm());
  }
  EXPECT_LT(difference<double>(goal, robot.pose(left)).norm(), 1e-3);
  EXPECT_LT(worst, 2e-2);  // what Euler's steps of 10 ms leave at the start
  EXPECT_LT(difference<double>(held, robot.pose(right).inverse() * robot.pose(left)).norm(), 1e-3);
}

// C6: what is no rotation is no goal.
TYPED_TEST(FrameTasks, C6_AGoalThatIsNoRotationIsRefusedAndTheOldOneStays) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  const icat::FrameId hand = robot.frame("left_hand");
  const Pose<S> goal = make_pose<S>(1, 2, 3, 0.1, 0.2, 0.3);
  Vector6<S> velocity = Vector6<S>::Constant(S(0.1));
  task::FramePose<Tree> pose(robot, hand, goal);
  task::FrameOrientation<Tree> orientation(robot, hand, goal.linear());
  task::FramePosition<Tree> position(robot, hand, goal.translation());
  ASSERT_EQ(pose.set_goal(goal, velocity), Status::ok);
  pose.update();
  const auto before = pose.reference();
  icat::Matrix3<S> reflection = goal.linear();
  reflection.col(1) *= S(-1);
  for (const icat::Matrix3<S>& bad : {icat::Matrix3<S>(icat::Matrix3<S>::Zero()),
                                      icat::Matrix3<S>(S(2) * goal.linear()), reflection}) {
    Pose<S> p = goal;
    p.linear() = bad;
    EXPECT_EQ(pose.set_goal(p), Status::not_a_rotation);
    EXPECT_EQ(orientation.set_goal(bad), Status::not_a_rotation);
    EXPECT_EQ(message_of([&] { task::FramePose<Tree>(robot, hand, p, {.name = "reach"}); }),
              "task 'reach': the goal is not finite or not a rotation");
    EXPECT_EQ(message_of([&] { task::FrameOrientation<Tree>(robot, hand, bad); }),
              "task 'frame orientation': the goal is not finite or not a rotation");
  }
  for (const double number : {nan, double(INFINITY)}) {
    Pose<S> p = goal;
    p.translation().y() = S(number);
    EXPECT_EQ(pose.set_goal(p), Status::non_finite);
    EXPECT_EQ(position.set_goal(p.translation()), Status::non_finite);
    icat::Matrix3<S> R = goal.linear();
    R(2, 1) = S(number);
    EXPECT_EQ(orientation.set_goal(R), Status::non_finite);
    auto v = velocity;
    v(5) = S(number);
    EXPECT_EQ(pose.set_goal(Pose<S>::Identity(), v), Status::non_finite);
    EXPECT_EQ(position.set_goal(Vector3<S>(0, 0, 0), v.template tail<3>()), Status::non_finite);
    EXPECT_EQ(orientation.set_goal(icat::Matrix3<S>::Identity(), v.template tail<3>()),
              Status::non_finite);
  }
  EXPECT_EQ(pose.goal().matrix(), goal.matrix());
  EXPECT_EQ(orientation.goal(), goal.linear());
  EXPECT_EQ(position.goal(), goal.translation());
  pose.update();
  EXPECT_EQ(pose.reference(), before);  // the velocity stays too
}

// C7: what is required is an argument.
static_assert(!std::is_constructible_v<task::FramePose<Torso>, const Torso&>);
static_assert(!std::is_constructible_v<task::FramePose<Torso>, const Torso&, icat::FrameId>);
static_assert(!std::is_constructible_v<task::FramePose<Torso>, const Torso&, icat::FrameId,
                                       task::FramePose<Torso>::Options>);
static_assert(!std::is_constructible_v<task::FramePosition<Torso>, const Torso&, icat::FrameId>);
static_assert(!std::is_constructible_v<task::FrameOrientation<Torso>, const Torso&, icat::FrameId>);
static_assert(!std::is_constructible_v<task::FrameVelocity<Torso>, const Torso&>);
static_assert(std::is_constructible_v<task::FramePose<Torso>, const Torso&, icat::FrameId,
                                      const Pose<double>&, task::FramePose<Torso>::Options>);

// --- configuration -------------------------------------------------------------------------------

TEST(FrameGoals, SettersOfTheOtherTasks) {
  Torso robot = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  using O = icat::Objective<double>;
  const Vector3<double> away = robot.pose(hand).translation() + Vector3<double>(0, 0, 2);
  task::FramePosition<Torso> position(robot, hand, away);
  ASSERT_EQ(position.set_max_rate(0.25), Status::ok);
  for (const double bad : {0.0, -1.0, nan}) {
    EXPECT_EQ(position.set_max_rate(bad), Status::out_of_range);
    EXPECT_EQ(position.set_gain(bad), Status::out_of_range);
  }
  EXPECT_EQ(position.set_gain(INFINITY), Status::out_of_range);
  EXPECT_EQ(position.set_objective(O::equal_to(0)), Status::wrong_size);
  position.update();
  EXPECT_NEAR(position.reference()(2), 0.25, 1e-12);
  EXPECT_EQ(position.gain(), 1);
  ASSERT_EQ(position.set_max_rate(INFINITY), Status::ok);
  ASSERT_EQ(position.set_gain(3), Status::ok);
  ASSERT_EQ(position.set_goal(away, Vector3<double>(0.1, 0, 0)), Status::ok);
  position.update();
  EXPECT_LT((position.reference() - Vector3<double>(0.1, 0, 6)).norm(), 1e-12);

  task::FrameOrientation<Torso> orientation(
      robot, hand, icat::rotation_exp<double>(Vector3<double>(1, 0, 0)) * robot.pose(hand).linear(),
      {.norm = O::at_most(2, 0.5)});
  orientation.update();
  EXPECT_EQ(orientation.activation()(0), 0);
  ASSERT_EQ(orientation.set_objective(O::equal_to(0)), Status::ok);
  ASSERT_EQ(orientation.set_max_rate(0.5), Status::ok);
  EXPECT_EQ(orientation.set_max_rate(0), Status::out_of_range);
  orientation.update();
  EXPECT_EQ(orientation.activation()(0), 1);
  EXPECT_NEAR(orientation.reference()(0), -0.5, 1e-12);
}

TEST(FrameGoals, ErrorsOfConfigurationNameTheTask) {
  const Torso robot = make_torso<Torso>();
  const icat::FrameId hand = robot.frame("left_hand");
  const Pose<double> goal = Pose<double>::Identity();
  const auto text = [&](task::FramePose<Torso>::Options options) {
    return message_of([&] { task::FramePose<Torso>(robot, hand, goal, options); });
  };
  EXPECT_EQ(text({.name = "reach", .gain = -0.5}),
            "task 'reach': gain must be finite and > 0, got -0.5");
  EXPECT_EQ(text({.gain = nan}), "task 'frame pose': gain must be finite and > 0, got nan");
  EXPECT_EQ(text({.gain = INFINITY}), "task 'frame pose': gain must be finite and > 0, got inf");
  EXPECT_EQ(text({.max_linear_rate = 0}),
            "task 'frame pose': the largest linear rate must be > 0, got 0");
  EXPECT_EQ(text({.max_angular_rate = nan}),
            "task 'frame pose': the largest angular rate must be > 0, got nan");
  EXPECT_EQ(text({.linear = icat::no_axes, .angular = icat::no_axes}),
            "task 'frame pose': needs a row at least, got 0");
  EXPECT_EQ(message_of([&] {
              task::FramePosition<Torso>(robot, hand, {0, nan, 0}, {.name = "place"});
            }),
            "task 'place': the goal is not finite or not a rotation");
  EXPECT_EQ(message_of([&] {
              task::FrameVelocity<Torso>(robot, hand,
                                         {.linear = icat::no_axes, .angular = icat::no_axes});
            }),
            "task 'frame velocity': needs a row at least, got 0");
}

TYPED_TEST(FrameTasks, UpdatesDoNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  const icat::FrameId hand = robot.frame("left_hand"), camera = robot.frame("camera");
  const Pose<S> goal = make_pose<S>(1, 2, 3, 0.1, 0.2, 0.3);
  const auto norm = icat::Objective<S>::at_most(S(0.2), S(0.1));
  task::FramePose<Tree> pose(robot, hand, goal, {.relative_to = camera});
  task::FramePose<Tree> norms(robot, hand, goal, {.norms = icat::PoseNorms<S>{norm, norm}});
  task::FramePosition<Tree> position(robot, hand, goal.translation(), {.on = On::frame});
  task::FrameOrientation<Tree> orientation(robot, hand, goal.linear(),
                                           {.axes = {true, false, false}});
  task::FrameVelocity<Tree> velocity(robot, hand, {.relative_to = camera});
  const auto s = testing_support::random_tree_states(robot, 1, 5)[0];
  for (icat::Task<Tree>* t : std::initializer_list<icat::Task<Tree>*>{&pose, &norms, &position,
                                                                      &orientation, &velocity}) {
    EXPECT_EQ(testing_support::update_allocations(robot, *t, s), 0) << t->name();
  }
  EXPECT_EQ(count_allocations([&] {
              (void)pose.set_goal(goal, Vector6<S>::Zero());
              (void)position.set_goal(goal.translation());
              (void)orientation.set_goal(goal.linear());
              (void)velocity.set_velocity(Vector6<S>::Ones());
              (void)norms.set_norms({norm, norm});
              (void)pose.set_max_rates(S(1), S(1));
            }),
            0);
}

}  // namespace
