// SPDX-License-Identifier: BSD-3-Clause
// Base and joints in parallel: TPIK 1 for the base, TPIK 2 for the joints, and its law.
#include <gtest/gtest.h>

#include <icat/icat.hpp>

#include "support/allocation_counter.hpp"
#include "support/robots.hpp"

namespace {

using Robot = testing_support::Robot<double>;
using Tree = testing_support::Tree;
using Parallel = icat::ParallelController<Robot>;
using Objective = icat::Objective<double>;
using icat::Status;
using testing_support::message_of;
using testing_support::moved;
using Vector6d = icat::Vector6<double>;
using Vector7d = icat::Vector<double, 7>;
using Vector13d = icat::Vector<double, 13>;
namespace task = icat::task;

/// What every robot here does: hold its joints off their limits, reach, and spare its base.
template <class R>
struct Reach {
  Reach(const R& r, icat::FrameId frame)
      : robot(r),
        hand(frame),
        limits(r, {.margin = 0.3, .gain = 0.5}),
        tool(r, frame, moved(r.pose(frame), 0.3, -0.2, 0.1), {.gain = 0.5}),
        rest(r, icat::joint_columns(r)) {}

  std::vector<icat::Action<R>> actions() {
    return {{"reach", {{limits}, {tool}, {rest}}}, {"rest", {{limits}, {rest}}}};
  }
  /// "reach" by hand, as the robot is now; the columns `given` move as in `measured`.
  Eigen::VectorXd solve(const icat::Columns& given, const Eigen::VectorXd& measured) {
    const auto n = robot.dof();
    Eigen::VectorXd rho0 = Eigen::VectorXd::Zero(n);
    Eigen::MatrixXd Q0 = Eigen::MatrixXd::Identity(n, n);
    for (const icat::Index c : given) {
      rho0(c) = measured(c);
      Q0(c, c) = 0;
    }
    icat::Tpik<double> tpik(n);
    EXPECT_EQ(tpik.reset(rho0, Q0), Status::ok);
    for (icat::Task<R>* t : std::initializer_list<icat::Task<R>*>{&limits, &tool, &rest}) {
      t->update();
      EXPECT_EQ(tpik.add_level(t->jacobian(), t->activation(), t->reference()), Status::ok);
    }
    EXPECT_EQ(tpik.minimize_velocity(), Status::ok);
    return tpik.velocity();
  }

  const R& robot;
  icat::FrameId hand;
  task::JointLimits<R> limits;
  task::FramePose<R> tool;
  task::Minimality<R> rest;
};

/// The base's velocity `measured` among zeros.
template <class R>
Eigen::VectorXd spread(const R& robot, const Eigen::VectorXd& measured) {
  Eigen::VectorXd all = Eigen::VectorXd::Zero(robot.dof());
  all.segment(robot.base_columns().first, measured.size()) = measured;
  return all;
}
/// The joints' part of ẏ.
template <class R>
Eigen::VectorXd joints_of(const R& robot, const Eigen::VectorXd& velocity) {
  Eigen::VectorXd out(static_cast<icat::Index>(robot.joints().size()));
  for (std::size_t i = 0; i < robot.joints().size(); ++i) {
    out(static_cast<icat::Index>(i)) = velocity(robot.joints()[i].column);
  }
  return out;
}
template <class R>
Eigen::VectorXd base_of(const R& robot, const Eigen::VectorXd& velocity) {
  return velocity.segment(robot.base_columns().first, robot.base_columns().count);
}

/// Both TPIKs against the solver, each alone and both together, and the law, for a base that can do
/// k velocities.
template <class R>
void check_both(const R& robot, icat::FrameId hand) {
  Reach<R> reach(robot, hand);
  const auto k = robot.base_columns().count;
  const Eigen::VectorXd measured = Eigen::VectorXd::LinSpaced(k, 0.08, -0.05), newer = 2 * measured;
  icat::ParallelController<R> controller(robot, reach.actions(), {.limits = icat::unlimited}),
      apart(robot, reach.actions(), {.limits = icat::unlimited});
  for (auto* c : {&controller, &apart}) ASSERT_EQ(c->start("reach", 0), Status::ok);
  const icat::Columns base = robot.base_columns();

  ASSERT_EQ(controller.step(0, measured), Status::ok);
  const Eigen::VectorXd tpik1 = reach.solve({}, spread(robot, measured));
  const Eigen::VectorXd tpik2 = reach.solve(base, spread(robot, measured));
  const Eigen::VectorXd velocity = controller.velocity();
  EXPECT_LT((base_of(robot, velocity) - base_of(robot, tpik1)).norm(), 1e-10);
  EXPECT_LT((joints_of(robot, velocity) - joints_of(robot, tpik2)).norm(), 1e-10);
  EXPECT_GT(joints_of(robot, velocity).norm(), 0.01);
  EXPECT_EQ(controller.command(), controller.velocity());
  EXPECT_LT((controller.first().velocity() - tpik1).norm(), 1e-10);
  EXPECT_LT((controller.second().velocity() - tpik2).norm(), 1e-10);

  // One after the other is both.
  ASSERT_EQ(apart.step_base(0, measured), Status::ok);
  EXPECT_EQ(base_of(robot, apart.velocity()), base_of(robot, velocity));
  EXPECT_EQ(joints_of(robot, apart.velocity()).norm(), 0);
  ASSERT_EQ(apart.step_joints(0, measured), Status::ok);
  EXPECT_EQ(Eigen::VectorXd(apart.velocity()), velocity);
  EXPECT_EQ(apart.command(), controller.command());

  // Each at its own rate: the joints' on a newer measurement, the base's later.
  ASSERT_EQ(controller.step_joints(0.001, newer), Status::ok);
  const Eigen::VectorXd again = reach.solve(base, spread(robot, newer));
  EXPECT_LT((joints_of(robot, controller.velocity()) - joints_of(robot, again)).norm(), 1e-10);
  EXPECT_EQ(base_of(robot, controller.velocity()), base_of(robot, velocity));
  ASSERT_EQ(controller.step_base(0.002, newer), Status::ok);
  EXPECT_LT((base_of(robot, controller.velocity()) - base_of(robot, tpik1)).norm(), 1e-10);
  EXPECT_LT((joints_of(robot, controller.velocity()) - joints_of(robot, again)).norm(), 1e-10);

  // [Coop, Eq. (24)] and [MARIS, III-B9], for every measurement without another solve.
  ASSERT_EQ(controller.step_joint_law(0.003), Status::ok);
  for (const double scale : {0.0, 1.0, 2.0, -3.0}) {
    const Eigen::VectorXd v = scale * measured;
    ASSERT_EQ(controller.follow_joint_law(0.003, v), Status::ok);
    const Eigen::VectorXd law = joints_of(robot, controller.velocity());
    EXPECT_LT((law - joints_of(robot, reach.solve(base, spread(robot, v)))).norm(), 1e-9) << scale;
  }
}

TEST(ParallelController, EqualsBothTpiksAndTheLaw) {
  Robot robot = testing_support::make_robot<double>();
  for (const auto& s : testing_support::random_states<double>(10, 31)) {
    SCOPED_TRACE(s.name);
    ASSERT_EQ(robot.update(s.q, s.vehicle), Status::ok);
    check_both(robot, robot.frame("tool"));
  }
}

TEST(ParallelController, BasesThatCanDoLess) {
  using Base = icat::Base<double>;
  for (const auto& base : {Base::fixed(), Base::differential_drive(), Base::surface()}) {
    SCOPED_TRACE(base.columns());
    const Tree robot = testing_support::mobile_arm(base);
    check_both(robot, robot.frame("end_effector"));
  }
}

TEST(ParallelController, ColumnsOfTheBaseFirst) {
  using Permuted = testing_support::BaseFirst<Tree>;
  for (const auto& base : {icat::Base<double>::differential_drive(), icat::Base<double>::free()}) {
    SCOPED_TRACE(base.columns());
    const Tree tree = testing_support::mobile_arm(base);
    const Permuted permuted(tree);
    const icat::FrameId hand = tree.frame("end_effector");
    check_both(permuted, hand);

    Reach<Tree> reach(tree, hand);
    Reach<Permuted> same(permuted, hand);
    icat::ParallelController<Tree> controller(tree, reach.actions(), {.limits = icat::unlimited});
    icat::ParallelController<Permuted> other(permuted, same.actions(), {.limits = icat::unlimited});
    const Eigen::VectorXd measured = Eigen::VectorXd::LinSpaced(base.columns(), 0.08, -0.05);
    const auto both = [&](auto f) {
      EXPECT_EQ(f(controller), Status::ok);
      EXPECT_EQ(f(other), Status::ok);
    };
    both([](auto& c) { return c.set_given("joint2", true); });
    both([](auto& c) { return c.start("reach", 0); });
    both([&](auto& c) { return c.step(0, measured); });
    EXPECT_LT((other.velocity() - permuted.permuted(controller.velocity())).norm(), 1e-10);
    both([&](auto& c) { return c.step_joint_law(0); });
    both([&](auto& c) { return c.follow_joint_law(0, measured); });
    EXPECT_LT((other.velocity() - permuted.permuted(controller.velocity())).norm(), 1e-9);
  }
}

TEST(ParallelController, NeedsJoints) {
  const Tree boat({.base = icat::Base<double>::surface(), .root = "boat"});
  task::FramePosition<Tree> there(boat, boat.base(), {1, 2, 0});
  EXPECT_EQ(message_of([&] {
              icat::ParallelController<Tree>(boat, {{"go", {{there}}}});
            }),
            "BaseCompensation: the robot has no joints");
}

class ParallelTest : public testing::Test {
 protected:
  ParallelTest() {
    const auto s = testing_support::random_states<double>(1, 21)[0];
    EXPECT_EQ(robot.update(testing_support::bent_arm(), s.vehicle), Status::ok);
    measured << 0.1, -0.05, 0.02, 0.01, 0.03, -0.04;
  }
  Robot robot = testing_support::make_robot<double>();
  Reach<Robot> reach{robot, robot.frame("tool")};
  Vector6d measured;
};

// The point of it: whatever the base really does, the tool moves as it is to.
TEST_F(ParallelTest, JointsMakeUpForTheBase) {
  Parallel controller(robot, reach.actions(), {.limits = icat::unlimited});
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  Vector13d actual;
  for (const double scale : {0.0, 1.0, -1.0}) {
    ASSERT_EQ(controller.step(0, scale * measured), Status::ok);
    actual << controller.velocity().head<7>(), scale * measured;
    EXPECT_LT((reach.tool.jacobian() * actual - reach.tool.reference()).norm(), 1e-9) << scale;
    ASSERT_EQ(controller.step_joint_law(0), Status::ok);
    ASSERT_EQ(controller.follow_joint_law(0, scale * measured), Status::ok);
    actual.head<7>() = controller.velocity().head<7>();
    EXPECT_LT((reach.tool.jacobian() * actual - reach.tool.reference()).norm(), 1e-9) << scale;
  }
}

TEST_F(ParallelTest, GivenColumnsOfTheBase) {
  // Roll and pitch: TPIK 1 knows of them, TPIK 2 takes all six as measured anyway.
  const icat::Columns given = icat::ColumnRange{10, 2};
  Parallel controller(robot, reach.actions(), {.given = given, .limits = icat::unlimited}),
      later(robot, reach.actions(), {.limits = icat::unlimited});
  for (auto* c : {&controller, &later}) ASSERT_EQ(c->start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0, measured), Status::ok);
  const Eigen::VectorXd all = spread(robot, measured);
  EXPECT_LT((controller.velocity().tail<6>() - reach.solve(given, all).tail<6>()).norm(), 1e-10);
  EXPECT_LT(
      (controller.velocity().head<7>() - reach.solve(robot.base_columns(), all).head<7>()).norm(),
      1e-10);
  EXPECT_EQ(controller.velocity().segment<2>(10), measured.segment<2>(3));
  EXPECT_EQ(controller.command().segment<2>(10), Eigen::Vector2d::Zero());
  EXPECT_EQ(controller.command().segment<3>(7), controller.velocity().segment<3>(7));
  // The same at run time, and back.
  ASSERT_EQ(later.step(0, measured), Status::ok);
  const Vector13d before = later.velocity();
  for (const bool on : {true, false}) {
    ASSERT_EQ(later.set_given(10, on), Status::ok);
    ASSERT_EQ(later.set_given(11, on), Status::ok);
    ASSERT_EQ(later.step(0, measured), Status::ok);
    EXPECT_EQ(later.velocity(), on ? controller.velocity() : before);
  }
  EXPECT_EQ(later.set_given(13, true), Status::unknown_joint);
  EXPECT_EQ(later.set_given("vehicle", true), Status::unknown_joint);
}

TEST_F(ParallelTest, AGivenJointStandsStillInBothAndInTheLaw) {
  const Parallel::Options at_construction{.given = icat::joint_columns(robot, {"joint3"}),
                                          .limits = icat::unlimited};
  Parallel controller(robot, reach.actions(), at_construction),
      later(robot, reach.actions(), {.limits = icat::unlimited});
  for (auto* c : {&controller, &later}) ASSERT_EQ(c->start("reach", 0), Status::ok);
  ASSERT_EQ(later.set_given("joint3", true), Status::ok);
  const icat::Columns base_and_joint({2, 7, 8, 9, 10, 11, 12});
  const Eigen::VectorXd all = spread(robot, measured);
  for (auto* c : {&controller, &later}) {
    ASSERT_EQ(c->step(0, measured), Status::ok);
    EXPECT_EQ(c->velocity()(2), 0);
    EXPECT_EQ(c->command()(2), 0);
    EXPECT_LT((c->velocity().head<7>() - reach.solve(base_and_joint, all).head<7>()).norm(), 1e-10);
    EXPECT_LT(
        (c->velocity().tail<6>() - reach.solve(icat::ColumnRange{2, 1}, all).tail<6>()).norm(),
        1e-10);
    ASSERT_EQ(c->step_joint_law(0), Status::ok);
    const Vector13d solved = c->velocity();
    ASSERT_EQ(c->follow_joint_law(0, measured), Status::ok);
    EXPECT_EQ(c->velocity()(2), 0);
    EXPECT_LT((c->velocity() - solved).norm(), 1e-9);
  }
  ASSERT_EQ(later.set_given("joint3", false), Status::ok);
  ASSERT_EQ(later.step(0, measured), Status::ok);
  EXPECT_NE(later.velocity()(2), 0);
}

// A joint that turns while nobody drives it: the others make up for what is measured of it.
TEST_F(ParallelTest, AGivenJointMovesAsMeasuredInBothAndInTheLaw) {
  Parallel controller(robot, reach.actions(),
                      {.given = icat::joint_columns(robot, {"joint3"}), .limits = icat::unlimited});
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  const icat::Columns base_and_joint({2, 7, 8, 9, 10, 11, 12});
  double t = 0;
  for (const double speed : {0.15, -0.3, 0.0}) {
    SCOPED_TRACE(speed);
    Vector13d all = spread(robot, measured);
    all(2) = speed;
    all(0) = NAN;  // of columns that are chosen nothing is needed
    ASSERT_EQ(controller.step(t += 0.01, all), Status::ok);
    all(0) = 0;
    EXPECT_EQ(controller.velocity()(2), speed);
    EXPECT_EQ(controller.command()(2), 0);
    EXPECT_LT((controller.velocity().head<7>() - reach.solve(base_and_joint, all).head<7>()).norm(),
              1e-10);
    EXPECT_LT(
        (controller.velocity().tail<6>() - reach.solve(icat::ColumnRange{2, 1}, all).tail<6>())
            .norm(),
        1e-10);
    Vector13d actual = all;
    actual.head<7>() = controller.velocity().head<7>();
    EXPECT_LT((reach.tool.jacobian() * actual - reach.tool.reference()).norm(), 1e-9);

    ASSERT_EQ(controller.step_joint_law(t, all), Status::ok);
    const Vector7d solved = controller.velocity().head<7>();
    ASSERT_EQ(controller.follow_joint_law(t, all), Status::ok);
    EXPECT_EQ(controller.command()(2), 0);
    EXPECT_LT((controller.velocity().head<7>() - solved).norm(), 1e-9);
  }
  // Another measurement of the base alone: the joint stands still again.
  ASSERT_EQ(controller.step(t += 0.01, measured), Status::ok);
  EXPECT_EQ(controller.velocity()(2), 0);
  // NaN where it is needed.
  Vector13d bad = spread(robot, measured);
  bad(2) = NAN;
  EXPECT_EQ(controller.step(t += 0.01, bad), Status::non_finite);
  EXPECT_TRUE(controller.velocity().allFinite());
  EXPECT_EQ(controller.step_joint_law(t, bad), Status::non_finite);
  EXPECT_EQ(controller.step_joint_law(t, Eigen::VectorXd::Zero(12)), Status::wrong_size);
}

TEST_F(ParallelTest, BoundsHoldInBothAndInTheLaw) {
  Parallel::Options options;
  Vector13d upper = Vector13d::Constant(0.04);
  upper(1) = 0.02;
  options.solver.bounds = {-upper, upper};
  options.limits = icat::unlimited;
  Parallel bounded(robot, reach.actions(), options),
      free(robot, reach.actions(), {.limits = icat::unlimited});
  double t = 0;
  bool active = false, inactive = false;
  for (auto* c : {&bounded, &free}) ASSERT_EQ(c->start("reach", 0), Status::ok);
  for (const auto& s : testing_support::all_states<double>(20, 32)) {
    SCOPED_TRACE(s.name);
    ASSERT_EQ(robot.update(s.q, s.vehicle), Status::ok);
    // There already, or not.
    ASSERT_EQ(reach.tool.set_goal(moved(robot.pose(reach.hand), s.q(0) > 0 ? 0.3 : 0, 0, 0)),
              Status::ok);
    t += 0.01;
    ASSERT_EQ(bounded.step(t, measured), Status::ok);
    EXPECT_LE((bounded.velocity().cwiseAbs() - upper).maxCoeff(), 0);
    for (auto* c : {&bounded, &free}) ASSERT_EQ(c->step_joint_law(t), Status::ok);
    for (const double scale : {1.0, 0.01, -5.0}) {
      const Vector6d v = scale * measured;
      for (auto* c : {&bounded, &free}) ASSERT_EQ(c->follow_joint_law(t, v), Status::ok);
      const Vector7d wanted = free.velocity().head<7>(), law = bounded.velocity().head<7>();
      EXPECT_LE((law.cwiseAbs() - upper.head<7>()).maxCoeff(), 0);
      // Scaled as a whole, no more than needed.
      const double over = (wanted.cwiseAbs().array() / upper.head<7>().array()).maxCoeff();
      EXPECT_LT((law - wanted / std::max(1.0, over)).norm(), 1e-12);
      (over > 1 ? active : inactive) = true;
    }
  }
  EXPECT_TRUE(active);
  EXPECT_TRUE(inactive);
}

TEST_F(ParallelTest, BadInputLeavesASafeVelocity) {
  Parallel controller(robot, reach.actions(),
                      {.given = icat::ColumnRange{10, 2}, .limits = icat::unlimited});
  EXPECT_EQ(controller.step(0, measured), Status::not_started);
  EXPECT_EQ(controller.step_base(0, measured), Status::not_started);
  EXPECT_EQ(controller.step_joints(0, measured), Status::not_started);
  EXPECT_EQ(controller.step_joint_law(0), Status::not_started);
  EXPECT_EQ(controller.follow_joint_law(0, measured), Status::not_started);
  EXPECT_EQ(controller.start("nowhere", 0), Status::unknown_action);
  EXPECT_EQ(controller.switch_to("nowhere", 0, 1), Status::unknown_action);
  EXPECT_EQ(controller.action(), "");
  ASSERT_EQ(controller.start("reach", 1), Status::ok);
  EXPECT_FALSE(controller.in_transition());
  ASSERT_EQ(controller.step(1, measured), Status::ok);
  const Vector13d before = controller.velocity(), command = controller.command();
  const auto unchanged = [&] {
    return controller.velocity() == before && controller.command() == command;
  };
  EXPECT_EQ(controller.step_joints(NAN, measured), Status::non_finite);
  EXPECT_EQ(controller.step_joint_law(NAN), Status::non_finite);
  const Eigen::VectorXd wrong = Eigen::VectorXd::Zero(12);
  EXPECT_EQ(controller.step(1, wrong), Status::wrong_size);
  EXPECT_EQ(controller.step_base(1, wrong), Status::wrong_size);
  EXPECT_EQ(controller.step_joints(1, wrong), Status::wrong_size);
  ASSERT_EQ(controller.step_joint_law(1), Status::ok);
  EXPECT_EQ(controller.follow_joint_law(1, wrong), Status::wrong_size);
  EXPECT_TRUE(unchanged());

  // NaN that lasts stops both.
  Vector6d bad = measured;
  bad(0) = NAN;
  for (int k = 1; k <= 100; ++k) {
    EXPECT_EQ(controller.step(1 + 0.01 * k, bad), Status::non_finite);
    EXPECT_TRUE(controller.velocity().allFinite());
  }
  EXPECT_EQ(controller.command(), Vector13d::Zero());
  for (int k = 101; k <= 200; ++k) {
    ASSERT_EQ(controller.step(1 + 0.01 * k, measured), Status::ok);
  }
  EXPECT_TRUE(unchanged());
}

// Each layer judges on its own.
TEST_F(ParallelTest, StaleInputStopsTheLayerThatGetsIt) {
  Parallel controller(robot, reach.actions());
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0, measured), Status::ok);
  const Vector13d before = controller.command();
  ASSERT_GT(before.head<7>().norm(), 0.01);
  ASSERT_GT(before.tail<6>().norm(), 0.01);
  double t = 0;
  const auto run = [&](double base_age, double joints_age, Status base, Status joints) {
    for (int k = 0; k < 100; ++k) {
      t += 0.01;
      EXPECT_EQ(controller.step_base(t, measured, {.velocity = base_age}), base);
      EXPECT_EQ(controller.step_joints(t, measured, {.velocity = joints_age}), joints);
    }
  };
  run(0.05, 0.2, Status::ok, Status::stale_velocity);
  EXPECT_EQ(controller.command().head<7>(), Vector7d::Zero());
  EXPECT_EQ(controller.command().tail<6>(), before.tail<6>());
  run(0.2, 0.05, Status::stale_velocity, Status::ok);
  EXPECT_EQ(controller.command().tail<6>(), Vector6d::Zero());
  EXPECT_EQ(controller.command().head<7>(), before.head<7>());
  // The law: it is as old as its state, and NaN is too old.
  ASSERT_EQ(controller.step_joint_law(t), Status::ok);
  EXPECT_EQ(controller.follow_joint_law(t + 0.05, measured), Status::ok);
  EXPECT_EQ(controller.follow_joint_law(t + 0.05, measured, {.state = 0.06}), Status::stale_state);
  EXPECT_EQ(controller.follow_joint_law(t + 0.05, measured, {.velocity = NAN}),
            Status::stale_velocity);
  for (int k = 12; k < 100; ++k) {
    EXPECT_EQ(controller.follow_joint_law(t + 0.01 * k, measured), Status::stale_state);
  }
  EXPECT_EQ(controller.command().head<7>(), Vector7d::Zero());
}

TEST_F(ParallelTest, SwitchesOnceForBoth) {
  Parallel controller(robot, reach.actions());
  ASSERT_EQ(controller.switch_to("reach", 0, 1), Status::ok);
  Vector13d last = Vector13d::Zero();
  for (int k = 0; k <= 2000; ++k) {
    const double t = 1e-3 * k;
    if (k == 500) {
      ASSERT_EQ(controller.switch_to("rest", t, 0.7), Status::ok);
      EXPECT_EQ(controller.action(), "rest");
    }
    ASSERT_EQ(controller.step(t, measured), Status::ok);
    if (k > 0) {  // at rest already TPIK 2 makes up for the base
      EXPECT_LT((controller.velocity() - last).norm(), 0.02) << k;
    }
    last = controller.velocity();
    EXPECT_EQ(controller.in_transition(), k < 1200);
  }
}

TEST_F(ParallelTest, AutoKeepsTheVelocityOfItsCycle) {
  Parallel controller(robot, reach.actions());
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0, measured), Status::ok);
  auto velocity = controller.velocity();
  auto command = controller.command();
  static_assert(std::is_same_v<decltype(velocity), Vector13d>);
  static_assert(std::is_same_v<decltype(command), Vector13d>);
  const Vector13d copy = velocity;
  ASSERT_EQ(controller.step(0, 2 * measured), Status::ok);
  EXPECT_GT((controller.velocity() - velocity).norm(), 1e-3);
  EXPECT_EQ(velocity, copy);
  EXPECT_EQ(command, copy);
}
static_assert(!std::is_constructible_v<Parallel, Robot, std::vector<icat::Action<Robot>>>);

TEST_F(ParallelTest, ATaskOfAnotherRobotIsRefused) {
  const Robot other = testing_support::make_robot<double>();
  EXPECT_EQ(message_of([&] { Parallel(other, reach.actions()); }),
            "action 'reach': task 'joint limits' belongs to another robot");
}

TEST_F(ParallelTest, DoesNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  Tree tree = testing_support::mobile_arm(icat::Base<double>::free());
  Reach<Tree> dynamic(tree, tree.frame("end_effector"));
  const auto s = testing_support::random_states<double>(3, 22)[2];
  const Vector13d all = spread(robot, measured);
  const auto run = [&](auto& moving, auto& controller) {
    Status status = Status::not_started;
    EXPECT_EQ(count_allocations([&] {
                (void)controller.switch_to("reach", 0, 0.1);
                for (int i = 0; i < 50; ++i) {
                  const double t = 0.01 * i;
                  (void)moving.update(s.q, s.vehicle);
                  if (i == 5) (void)controller.switch_to("rest", t, 0.1);
                  if (i == 7) (void)controller.set_given("joint3", true);
                  status = controller.step(t, measured);
                  if (status == Status::ok) status = controller.step_base(t, measured);
                  if (status == Status::ok) status = controller.step_joints(t, measured);
                  if (status == Status::ok) status = controller.step_joint_law(t);
                  if (status == Status::ok) status = controller.step_joint_law(t, all);
                  if (status == Status::ok) status = controller.follow_joint_law(t, measured);
                }
              }),
              0);
    EXPECT_EQ(status, Status::ok);
  };
  Parallel controller(robot, reach.actions());
  run(robot, controller);
  icat::ParallelController<Tree> of_dynamic_size(tree, dynamic.actions());
  run(tree, of_dynamic_size);
}

TEST(ParallelControllerOfFloat, EpochSeconds) {
  using FloatRobot = testing_support::Robot<float>;
  FloatRobot robot = testing_support::make_robot<float>();
  const auto s = testing_support::random_states<float>(3, 21)[1];
  ASSERT_EQ(robot.update(s.q, s.vehicle), Status::ok);
  const icat::FrameId hand = robot.frame("tool");
  const auto goal = moved(robot.pose(hand), 0.1, -0.2, 0.1);
  task::FramePose<FloatRobot> tool(robot, hand, goal);
  icat::ParallelController<FloatRobot> controller(robot, {{"reach", {{tool}}}});
  const double epoch = 1.76e9;
  ASSERT_EQ(controller.switch_to("reach", epoch, 1), Status::ok);
  icat::Vector6<float> measured = icat::Vector6<float>::Zero();
  for (int k = 1; k <= 1500; ++k) {
    ASSERT_EQ(controller.step(epoch + 0.01 * k, measured), Status::ok);
    measured = controller.velocity().tail<6>();
    ASSERT_EQ(testing_support::drive(robot, controller.velocity(), 0.01), Status::ok);
    EXPECT_EQ(controller.in_transition(), k < 100) << k;
  }
  EXPECT_LT(testing_support::difference(robot.pose(hand), goal).norm(), 1e-3f);
}

}  // namespace
