// SPDX-License-Identifier: BSD-3-Clause
// What all tasks share, objectives, and tasks from lambdas. The catalogue is in test_frame_tasks,
// test_direction_tasks and test_joint_tasks.
#include <gtest/gtest.h>

#include <icat/task/function_task.hpp>

#include "support/task_checks.hpp"

namespace {

using icat::Index;
using icat::Status;
using testing_support::gain;
using testing_support::make_torso;
using testing_support::message_of;
using testing_support::place;
using testing_support::roundings;
using testing_support::Torso;
using testing_support::TorsoOf;
using testing_support::TreeState;
namespace task = icat::task;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// --- objectives ----------------------------------------------------------------------------------

template <class S>
class Objectives : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Objectives, Scalars);

TYPED_TEST(Objectives, ActivationsFollowTheFormulas) {
  using S = TypeParam;
  using O = icat::Objective<S>;
  const S near = roundings<S>(40);
  const O at_most = O::at_most(S(0.1), S(0.05));  // [Coop, Fig. 2]
  EXPECT_EQ(at_most.activation(S(0.2)), S(1));
  EXPECT_EQ(at_most.activation(S(0.1)), S(1));
  EXPECT_NEAR(at_most.activation(S(0.05)), 0, near);
  EXPECT_EQ(at_most.activation(S(-3)), S(0));
  EXPECT_NEAR(at_most.activation(S(0.075)), 0.5, near);
  EXPECT_TRUE(at_most.satisfied(S(0.1)));
  EXPECT_FALSE(at_most.satisfied(S(0.11)));
  const O at_least = O::at_least(S(0.02), S(0.01));  // [MARIS, Eq. (16)]
  EXPECT_EQ(at_least.activation(S(0.01)), S(1));
  EXPECT_NEAR(at_least.activation(S(0.025)), 0.5, near);
  EXPECT_EQ(at_least.activation(S(0.031)), S(0));
  EXPECT_EQ(at_least.upper(), S(INFINITY));
  const O between = O::between(S(-1), S(3), S(0.5));
  EXPECT_EQ(between.activation(S(1)), S(0));
  EXPECT_EQ(between.activation(S(-1.2)), S(1));
  EXPECT_EQ(between.activation(S(3)), S(1));
  EXPECT_NEAR(between.activation(S(2.75)), 0.5, near);
  EXPECT_NEAR(between.activation(S(-0.75)), 0.5, near);
  EXPECT_EQ(between.lower(), S(-1));
  EXPECT_EQ(between.upper(), S(3));
  const O equal = O::equal_to(S(2));
  EXPECT_EQ(equal.activation(S(123)), S(1));
  EXPECT_EQ(equal.activation(S(2)), S(1));
  EXPECT_TRUE(std::isnan(at_most.activation(S(nan))));
  const O free = O::between(S(-INFINITY), S(INFINITY), S(1));
  EXPECT_EQ(free.activation(std::numeric_limits<S>::max()), S(0));
  EXPECT_EQ(free.target(S(1e30)), S(1e30));
}

// The reference point is the near edge of the range of rest: the way out of the margin, no further.
TYPED_TEST(Objectives, TheReferencePointIsTheNearEdgeOfTheRangeOfRest) {
  using S = TypeParam;
  using O = icat::Objective<S>;
  const O between = O::between(S(-1), S(3), S(0.5));
  EXPECT_EQ(between.target(S(7)), S(2.5));
  EXPECT_EQ(between.target(S(2.75)), S(2.5));
  EXPECT_EQ(between.target(S(1)), S(1));
  EXPECT_EQ(between.target(S(-0.75)), S(-0.5));
  EXPECT_EQ(O::at_most(S(4), S(1)).target(S(9)), S(3));
  EXPECT_EQ(O::at_most(S(4), S(1)).target(S(-9)), S(-9));
  EXPECT_EQ(O::at_least(S(4), S(1)).target(S(-9)), S(5));
  EXPECT_EQ(O::at_least(S(4), S(1)).target(S(9)), S(9));
  EXPECT_EQ(O::equal_to(S(2)).target(S(9)), S(2));
  // Where it is not active nothing is asked for; where it is, the way inside.
  for (S x = S(-2); x < S(4); x += S(0.01)) {
    const S way = between.target(x) - x;
    if (between.activation(x) == S(0)) {
      EXPECT_NEAR(way, 0, roundings<S>(8));
    }
    EXPECT_TRUE(way * (x - S(1)) <= S(0));
  }
  // Another one, inside.
  EXPECT_EQ(between.toward(S(0)).target(S(7)), S(0));
  EXPECT_EQ(between.toward(S(0)).target(S(-7)), S(0));
  EXPECT_EQ(between.toward(S(0)).activation(S(2.75)), between.activation(S(2.75)));
}

TEST(ObjectiveErrors, SayTheNumbers) {
  using O = icat::Objective<double>;
  const auto text = [](auto&& f) { return message_of([&] { (void)f(); }); };
  EXPECT_EQ(text([] { return O::at_most(1, 0); }),
            "Objective: margin must be finite and > 0, got 0");
  EXPECT_EQ(text([] { return O::at_least(1, nan); }),
            "Objective: margin must be finite and > 0, got nan");
  EXPECT_EQ(text([] { return O::at_most(nan, 1); }), "Objective: maximum must be finite, got nan");
  EXPECT_EQ(text([] { return O::equal_to(nan); }), "Objective: value must be finite, got nan");
  EXPECT_EQ(text([] { return O::equal_to(INFINITY); }), "Objective: value must be finite, got inf");
  EXPECT_EQ(text([] { return O::between(0, 0.08, 0.1); }),
            "Objective: no room between minimum 0 and maximum 0.08 for two margins of 0.1");
  EXPECT_EQ(text([] { return O::between(0, 0.2, 0.1); }),
            "Objective: no room between minimum 0 and maximum 0.2 for two margins of 0.1");
  EXPECT_NE(text([] { return O::between(nan, 1, 0.1); }), "no exception");
  EXPECT_NE(text([] { return O::between(INFINITY, INFINITY, 0.1); }), "no exception");
  EXPECT_NE(text([] { return O::between(-INFINITY, -INFINITY, 0.1); }), "no exception");
  EXPECT_EQ(text([] { return O::at_most(1, 0.5).toward(2); }),
            "Objective: reference point 2 is outside [-inf, 1]");
  EXPECT_NE(text([] { return O::equal_to(1).toward(1); }), "no exception");
}

// C11: what is not finite is no bound and no reference point.
TEST(Cases, C11_InfiniteBoundsAndReferencePointsAreRefused) {
  using O = icat::Objective<double>;
  const auto text = [](auto&& f) { return message_of([&] { (void)f(); }); };
  EXPECT_EQ(text([] { return O::at_least(1, 0.1).toward(INFINITY); }),
            "Objective: reference point inf is outside [1, inf]");
  EXPECT_EQ(text([] { return O::at_most(1, 0.1).toward(-INFINITY); }),
            "Objective: reference point -inf is outside [-inf, 1]");
  EXPECT_EQ(text([] { return O::at_most(1, 0.1).toward(nan); }),
            "Objective: reference point nan is outside [-inf, 1]");
  EXPECT_EQ(text([] { return O::at_most(INFINITY, 0.1); }),
            "Objective: maximum must be finite, got inf");
  EXPECT_EQ(text([] { return O::at_least(-INFINITY, 0.1); }),
            "Objective: minimum must be finite, got -inf");
  EXPECT_EQ(text([] { return O::at_most(1, INFINITY); }),
            "Objective: margin must be finite and > 0, got inf");
}

// --- the base of all tasks -----------------------------------------------------------------------

class Own : public icat::Task<Torso> {
 public:
  Own(const Torso& robot, Index rows) : icat::Task<Torso>(robot, "own", rows) {}

 private:
  void compute() noexcept override { ++reference_(0); }
};

TEST(Tasks, OfTheUsersOwnBeginActiveAndBelongToTheirRobot) {
  const Torso robot = make_torso<Torso>();
  Own own(robot, 3);
  EXPECT_EQ(own.name(), "own");
  EXPECT_EQ(&own.robot(), &robot);
  EXPECT_EQ(own.rows(), 3);
  EXPECT_EQ(own.jacobian(), Eigen::MatrixXd::Zero(3, 20));
  EXPECT_EQ(own.reference(), Eigen::VectorXd::Zero(3));
  EXPECT_EQ(own.activation(), Eigen::VectorXd::Ones(3));
  own.update();
  EXPECT_EQ(own.reference()(0), 1);
  EXPECT_EQ(message_of([&] { Own(robot, 0); }), "task 'own': needs a row at least, got 0");
  // It has an identity: actions refer to it.
  static_assert(!std::is_copy_constructible_v<Own> && !std::is_move_constructible_v<Own> &&
                !std::is_copy_assignable_v<Own>);
}

// --- tasks from lambdas --------------------------------------------------------------------------

template <class K>
class FunctionTasks : public testing::Test {};
TYPED_TEST_SUITE(FunctionTasks, testing_support::AllKinds);

// Depth and the lift's height above it.
template <class Tree>
void depth_and_lift(const Tree& robot, typename task::FunctionTask<Tree>::Values x,
                    typename task::FunctionTask<Tree>::Block J) {
  const auto base = robot.base();
  x(0) = robot.pose(base).translation().z();
  J.row(0) = robot.jacobian(base).row(2);
  x(1) = x(0) - robot.position(0);
  J.row(1) = J.row(0);
  J(1, 0) -= typename Tree::Scalar(1);
}

TYPED_TEST(FunctionTasks, HaveTheValuesAndJacobianOfTheLambda) {
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  task::FunctionTask<Tree> t(robot, icat::Objective<S>::between(S(-9), S(9), S(1)).toward(S(1.5)),
                             depth_and_lift<Tree>, {.rows = 2, .gain = S(gain)});
  ASSERT_EQ(t.rows(), 2);
  for (const TreeState& s : testing_support::all_torso_states(robot, 5, 3)) {
    SCOPED_TRACE(s.name);
    place(robot, s);
    t.update();
    EXPECT_NEAR(t.values()(0), s.base.translation().z(), 1e-6);
    EXPECT_NEAR(t.values()(1), s.base.translation().z() - s.q(0), 1e-6);
    for (Index i = 0; i < 2; ++i) {
      EXPECT_NEAR(t.reference()(i), S(gain) * (S(1.5) - t.values()(i)), roundings<S>(20));
    }
    if constexpr (std::is_same_v<S, double>) {
      const auto numeric = testing_support::differentiate(robot, s, [&](const Tree&) {
        t.update();
        return Eigen::VectorXd(t.values());
      });
      t.update();
      EXPECT_LT((t.jacobian() - numeric).norm(), 1e-7);
    }
  }
}

TEST(FunctionTask, ObjectivesAndRates) {
  const Torso robot = make_torso<Torso>();
  double value = 5;
  using O = icat::Objective<double>;
  task::FunctionTask<Torso> t(robot, O::at_most(2, 1),
                              [&value](const Torso&, auto x, auto J) {
                                x(0) = value;
                                J(0, 3) += 1;  // as it was left: not cleared in between
                              },
                              {.gain = 2, .max_rate = 3});
  t.update();
  EXPECT_EQ(t.reference()(0), -3);
  EXPECT_EQ(t.activation()(0), 1);
  EXPECT_EQ(t.jacobian()(0, 3), 1);  // zero at the first call
  EXPECT_EQ(t.jacobian().norm(), 1);
  ASSERT_EQ(t.set_max_rate(7), Status::ok);
  EXPECT_EQ(t.set_max_rate(0), Status::out_of_range);
  EXPECT_EQ(t.set_max_rate(nan), Status::out_of_range);
  t.update();
  EXPECT_EQ(t.reference()(0), -7);
  EXPECT_EQ(t.jacobian()(0, 3), 2);
  ASSERT_EQ(t.set_gain(1), Status::ok);
  t.set_objective(O::equal_to(4.5));
  t.update();
  EXPECT_EQ(t.reference()(0), -0.5);
  value = 1;
  t.set_objective(O::at_most(2, 0.5));
  t.update();
  EXPECT_EQ(t.activation()(0), 0);
}

template <class M>
concept Resizable = requires(M& m) {
  m.conservativeResize(1, 1);
};

// C10: rows that cannot be are refused; the lambda gets blocks of fixed size, and nothing that it
// could resize.
TEST(Cases, C10_RowsBelowOneAreRefusedAndBlocksAreFixed) {
  const Torso robot = make_torso<Torso>();
  const auto equal = icat::Objective<double>::equal_to(0);
  for (const Index rows : {Index(-1), Index(0)}) {
    EXPECT_EQ(message_of([&] {
                task::FunctionTask<Torso>(robot, equal, [](const Torso&, auto, auto) {},
                                          {.name = "f", .rows = rows});
              }),
              "task 'f': needs a row at least, got " + std::to_string(rows));
  }
  EXPECT_EQ(message_of([&] { task::FunctionTask<Torso>(robot, equal, nullptr); }),
            "task 'function': the function is empty");
  EXPECT_EQ(message_of([&] {
              task::FunctionTask<Torso>(robot, equal, [](const Torso&, auto, auto) {},
                                        {.max_rate = 0});
            }),
            "task 'function': max_rate must be > 0, got 0");
  using F = task::FunctionTask<Torso>;
  static_assert(!Resizable<F::Block> && !Resizable<F::Values> && Resizable<F::Jacobian>);
  static_assert(
      !std::is_constructible_v<F::Function, void (*)(const Torso&, F::Rows&, F::Jacobian&)>);
  const double* first = nullptr;
  Index rows = 0, columns = 0;
  F t(robot, equal,
      [&](const Torso&, F::Values x, F::Block J) {
        x.setZero();
        first = J.data();
        rows = J.rows();
        columns = J.cols();
      },
      {.rows = 3});
  t.update();
  EXPECT_EQ(rows, 3);
  EXPECT_EQ(columns, 20);
  EXPECT_EQ(first, t.jacobian().data());
  // C7: what is required is an argument.
  static_assert(!std::is_constructible_v<F, const Torso&, icat::Objective<double>>);
  static_assert(!std::is_constructible_v<F, const Torso&, F::Options>);
}

TYPED_TEST(FunctionTasks, UpdatesDoNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  using S = typename TypeParam::Scalar;
  using Tree = TorsoOf<TypeParam>;
  Tree robot = make_torso<Tree>();
  task::FunctionTask<Tree> t(robot, icat::Objective<S>::equal_to(S(0)), depth_and_lift<Tree>,
                             {.rows = 2});
  EXPECT_EQ(testing_support::update_allocations(
                robot, t, testing_support::random_tree_states(robot, 1, 5)[0]),
            0);
}

}  // namespace
