// SPDX-License-Identifier: BSD-3-Clause
// The kinematic layer: one TPIK over all columns, of which some may be given.
#include <gtest/gtest.h>

#include <icat/icat.hpp>

#include "support/allocation_counter.hpp"
#include "support/robots.hpp"

namespace {

using Robot = testing_support::Robot<double>;
using Controller = icat::Controller<Robot>;
using Objective = icat::Objective<double>;
using icat::Status;
using testing_support::message_of;
using testing_support::moved;
using Vector13d = icat::Vector<double, 13>;
using Matrix13d = Eigen::Matrix<double, 13, 13>;
namespace task = icat::task;

Robot placed_robot() {
  Robot robot = testing_support::make_robot<double>();
  const auto s = testing_support::random_states<double>(3, 21)[1];
  EXPECT_EQ(robot.update(s.q, s.vehicle), Status::ok);
  return robot;
}

/// A row that yields NaN while it is told to.
class Faulty : public icat::Task<Robot> {
 public:
  explicit Faulty(const Robot& robot) : Task(robot, "faulty", 3) {}
  bool bad{false};

 private:
  void compute() noexcept override { reference_(1) = bad ? NAN : 0; }
};

class ControllerTest : public testing::Test {
 protected:
  ControllerTest() { measured.setLinSpaced(0.05, -0.04); }

  Robot robot = placed_robot();
  icat::FrameId hand = robot.frame("tool");
  task::JointLimits<Robot> limits{robot, {.margin = 0.4, .gain = 0.5}};
  task::Attitude<Robot> attitude{robot, robot.base(), {.norm = Objective::at_most(0.2, 0.1)}};
  task::FramePose<Robot> tool{
      robot, hand, moved(robot.pose(hand), 0.3, -0.2, 0.1), {.name = "tool pose", .gain = 0.5}};
  task::FramePose<Robot> vehicle{
      robot, robot.base(), testing_support::make_pose<double>(1, 1, 1, 0, 0, 1), {.gain = 0.5}};
  task::Minimality<Robot> still_arm{robot, icat::joint_columns(robot)};
  std::vector<icat::Action<Robot>> actions{
      {"reach", {{limits}, {attitude}, {tool}}},
      {"travel", {{limits}, {attitude}, {vehicle}, {still_arm}}}};
  Vector13d measured;

  /// "reach" by hand.
  Vector13d solve(const Vector13d& rho0, const Matrix13d& Q0) {
    icat::Tpik<double, 13> tpik;
    EXPECT_EQ(tpik.reset(rho0, Q0), Status::ok);
    for (icat::Task<Robot>* t :
         std::initializer_list<icat::Task<Robot>*>{&limits, &attitude, &tool}) {
      t->update();
      EXPECT_EQ(tpik.add_level(t->jacobian(), t->activation(), t->reference()), Status::ok);
    }
    EXPECT_EQ(tpik.minimize_velocity(), Status::ok);
    return tpik.velocity();
  }
  /// "reach" by hand, some columns given.
  Vector13d solve_given(const std::vector<int>& given, const Vector13d& velocity) {
    Vector13d rho0 = Vector13d::Zero();
    Matrix13d Q0 = Matrix13d::Identity();
    for (const int c : given) {
      rho0(c) = velocity(c);
      Q0(c, c) = 0;
    }
    return solve(rho0, Q0);
  }
};

TEST_F(ControllerTest, WholeBodyEqualsTheSolver) {
  Controller controller(robot, actions);
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  EXPECT_FALSE(controller.in_transition());
  ASSERT_EQ(controller.step(0), Status::ok);
  EXPECT_FALSE(controller.in_transition());
  EXPECT_LT((controller.velocity() - solve_given({}, measured)).norm(), 1e-12);
  EXPECT_EQ(controller.command(), controller.velocity());
  EXPECT_EQ(controller.action(), "reach");
  EXPECT_TRUE(controller.has("travel"));
  EXPECT_FALSE(controller.has("fly"));
  EXPECT_EQ(&controller.robot(), &robot);
  EXPECT_EQ(controller.report().status(), Status::ok);
  // Nothing is given: what is measured does not matter.
  const Vector13d before = controller.velocity();
  ASSERT_EQ(controller.step(0, Vector13d::Constant(NAN)), Status::ok);
  EXPECT_EQ(controller.velocity(), before);
}

// --- given columns -------------------------------------------------------------------------------

TEST_F(ControllerTest, GivenColumnsKeepTheirMeasuredVelocity) {
  // Roll and pitch, as a block.
  Controller controller(robot, actions, {.given = icat::ColumnRange{10, 2}});
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0, measured), Status::ok);
  EXPECT_LT((controller.velocity() - solve_given({10, 11}, measured)).norm(), 1e-12);
  EXPECT_EQ(controller.velocity().segment<2>(10), measured.segment<2>(10));
  EXPECT_GT((controller.velocity() - solve_given({}, measured)).norm(), 0.01);
  Vector13d expected = controller.velocity();
  expected.segment<2>(10).setZero();
  EXPECT_EQ(controller.command(), expected);
  for (int c = 0; c < 13; ++c) EXPECT_EQ(controller.given(c), c == 10 || c == 11);
  // Without a measurement it does not go on, and soon stops.
  EXPECT_EQ(controller.step(0), Status::missing_velocity);
}

TEST_F(ControllerTest, GivenMayChangeAtRunTimeByNameOrColumn) {
  Controller controller(robot, actions);
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  const auto expect = [&](const std::vector<int>& given) {
    ASSERT_EQ(controller.step(0, measured), Status::ok);
    EXPECT_LT((controller.velocity() - solve_given(given, measured)).norm(), 1e-12);
    for (const int c : given) {
      EXPECT_EQ(controller.velocity()(c), measured(c));
      EXPECT_EQ(controller.command()(c), 0);
    }
  };
  expect({});
  ASSERT_EQ(controller.set_given("joint3", true), Status::ok);
  expect({2});
  ASSERT_EQ(controller.set_given(12, true), Status::ok);
  expect({2, 12});
  ASSERT_EQ(controller.set_given(2, false), Status::ok);
  expect({12});
  EXPECT_EQ(controller.set_given("joint8", true), Status::unknown_joint);
  EXPECT_EQ(controller.set_given("tool", true), Status::unknown_joint);
  EXPECT_EQ(controller.set_given(13, true), Status::unknown_joint);
  EXPECT_EQ(controller.set_given(-1, true), Status::unknown_joint);
  expect({12});
  ASSERT_EQ(controller.set_given(12, false), Status::ok);
  expect({});
}

TEST_F(ControllerTest, BadGivenColumnsAreRefusedAtConstruction) {
  const auto with = [&](std::vector<icat::Index> given) {
    return message_of(
        [&] { Controller(robot, actions, {.given = icat::Columns(std::move(given))}); });
  };
  EXPECT_EQ(with({3, 13}), "the given columns: column 13 is not among the robot's 13");
  EXPECT_EQ(with({-1}), "the given columns: column -1 is not among the robot's 13");
  EXPECT_EQ(with({3, 4, 3}), "the given columns: column 3 stands twice");
}

// [Coop, Eq. (31)] starts the iteration from what is given, [MARIS, III-B8] puts it on top.
TEST_F(ControllerTest, BothFormulationsOfGivenColumnsAgree) {
  const std::vector<std::vector<icat::Index>> sets{
      {10, 11}, {2}, {0, 6, 12}, {7, 8, 9, 10, 11, 12}};
  for (const auto& columns : sets) {
    const icat::Columns given(columns);
    task::GivenVelocity<Robot> on_top(robot, given);
    auto with_task = actions;
    for (auto& action : with_task) {
      action.levels.insert(action.levels.begin(), icat::PriorityLevel<Robot>{on_top});
    }
    Controller coop(robot, actions, {.given = given, .limits = icat::unlimited}),
        maris(robot, with_task, {.limits = icat::unlimited});
    double t = 0;
    for (const auto& s : testing_support::all_states<double>(20, 22)) {
      SCOPED_TRACE(s.name);
      ASSERT_EQ(robot.update(s.q, s.vehicle), Status::ok);
      ASSERT_EQ(coop.start("reach", 0), Status::ok);
      ASSERT_EQ(maris.start("reach", 0), Status::ok);
      icat::Vector<double, Eigen::Dynamic> velocity(given.size());
      for (icat::Index i = 0; i < given.size(); ++i) velocity(i) = measured(given[i]);
      ASSERT_EQ(on_top.set_velocity(velocity), Status::ok);
      t += 0.01;
      ASSERT_EQ(coop.step(t, measured), Status::ok);
      ASSERT_EQ(maris.step(t), Status::ok);
      EXPECT_LT((coop.velocity() - maris.velocity()).norm(), 1e-9);
    }
  }
}

// Case M5: a motor dies on the way; the others do its work.
TEST_F(ControllerTest, TheOthersDoTheWorkOfADeadJoint) {
  for (const bool bounded : {false, true}) {
    robot = placed_robot();
    Controller::Options options;
    if (bounded) {
      options.solver.bounds = {Vector13d::Constant(-0.5), Vector13d::Constant(0.5)};
    }
    Controller controller(robot, actions, options);
    ASSERT_EQ(controller.switch_to("reach", 0, 0.5), Status::ok);
    double stuck = 0;
    for (int k = 0; k < 3000; ++k) {
      if (k == 100) {
        ASSERT_EQ(controller.set_given("joint3", true), Status::ok);
        stuck = robot.position(2);
      }
      ASSERT_EQ(controller.step(0.01 * k), Status::ok);
      if (k == 99) {
        EXPECT_GT(std::abs(controller.velocity()(2)), 1e-3) << "it was needed";
      }
      if (k >= 100) {
        ASSERT_EQ(controller.command()(2), 0);
      }
      ASSERT_EQ(testing_support::drive(robot, controller.velocity(), 0.01), Status::ok);
    }
    EXPECT_EQ(robot.position(2), stuck);
    EXPECT_LT(testing_support::difference(robot.pose(hand), tool.goal()).norm(), 1e-5);
  }
}

// A broken joint that sags is made up for as well, and the tool does not sag with it.
TEST_F(ControllerTest, WhatADeadJointDoesIsMadeUpFor) {
  Controller controller(robot, actions);
  ASSERT_EQ(controller.set_given("joint3", true), Status::ok);
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  Vector13d sagging = Vector13d::Zero();
  sagging(2) = 0.1;
  ASSERT_EQ(controller.step(0, sagging), Status::ok);
  EXPECT_EQ(controller.velocity()(2), 0.1);
  EXPECT_LT((tool.jacobian() * controller.velocity() - tool.reference()).norm(), 1e-9);
}

TEST_F(ControllerTest, BoundsHoldInWhatMayBeChosen) {
  Controller::Options options{.given = icat::joint_columns(robot, {"joint2"})};
  options.solver.bounds = {Vector13d::Constant(-0.05), Vector13d::Constant(0.05)};
  Controller controller(robot, actions, options);
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  Vector13d fast = Vector13d::Zero();
  fast(1) = 0.4;  // outside
  double t = 0;
  for (const auto& s : testing_support::all_states<double>(20, 23)) {
    SCOPED_TRACE(s.name);
    ASSERT_EQ(robot.update(s.q, s.vehicle), Status::ok);
    ASSERT_EQ(controller.step(t += 0.01, fast), Status::ok);
    for (int c = 0; c < 13; ++c) {
      if (c != 1) {
        EXPECT_LE(std::abs(controller.velocity()(c)), 0.05);
      }
    }
    EXPECT_EQ(controller.velocity()(1), 0.4);
    EXPECT_EQ(controller.command()(1), 0);
  }
}

// --- errors --------------------------------------------------------------------------------------

TEST_F(ControllerTest, SwitchingBackAndForthNeverJumps) {
  Controller controller(robot, actions);
  ASSERT_EQ(controller.switch_to("travel", 0, 1), Status::ok);
  const double dt = 1e-3;
  Vector13d last = Vector13d::Zero();
  double worst = 0;
  const char* names[] = {"reach", "travel"};
  for (int cycle = 0; cycle < 5000; ++cycle) {
    const double t = cycle * dt;
    if (cycle % 337 == 100) {
      ASSERT_EQ(controller.switch_to(names[(cycle / 337) % 2], t, 0.5), Status::ok);
      ASSERT_TRUE(controller.in_transition());
    }
    ASSERT_EQ(controller.step(t), Status::ok);
    worst = std::max(worst, (controller.velocity() - last).norm());
    last = controller.velocity();
  }
  // ẏ is of order 1; a switch without transition would show as an increment of that order.
  EXPECT_LT(worst, 0.05);
  Controller hard(robot, actions);
  ASSERT_EQ(hard.start("travel", 0), Status::ok);
  ASSERT_EQ(hard.step(0), Status::ok);
  last = hard.velocity();
  ASSERT_EQ(hard.start("reach", 0), Status::ok);
  ASSERT_EQ(hard.step(0), Status::ok);
  EXPECT_GT((hard.velocity() - last).norm(), 0.3);
}

TEST_F(ControllerTest, BadInputLeavesASafeVelocityAndNamesTheLevel) {
  Faulty faulty(robot);
  actions[0].levels.insert(actions[0].levels.begin() + 2, icat::PriorityLevel<Robot>{faulty});
  Controller controller(robot, actions, {.limits = icat::unlimited});
  EXPECT_EQ(controller.step(0), Status::not_started);
  EXPECT_EQ(controller.velocity(), Vector13d::Zero());
  EXPECT_EQ(controller.start("nowhere", 0), Status::unknown_action);
  EXPECT_EQ(controller.switch_to("nowhere", 0, 1), Status::unknown_action);
  EXPECT_EQ(controller.switch_to("reach", 0, -1), Status::invalid_duration);
  EXPECT_EQ(controller.start("reach", NAN), Status::non_finite);
  EXPECT_EQ(controller.action(), "");
  ASSERT_EQ(controller.start("reach", 1), Status::ok);
  ASSERT_EQ(controller.step(1), Status::ok);
  // A call that comes late keeps what there was; it does not stop the robot.
  const Vector13d before = controller.velocity();
  EXPECT_GT(before.norm(), 0);
  EXPECT_EQ(controller.step(0.99, measured), Status::ok);
  EXPECT_EQ(controller.step(NAN), Status::non_finite);
  EXPECT_EQ(controller.switch_to("travel", NAN, 1), Status::non_finite);
  EXPECT_EQ(controller.action(), "reach");
  EXPECT_EQ(controller.velocity(), before);

  faulty.bad = true;
  EXPECT_EQ(controller.step(1.01), Status::non_finite);
  EXPECT_TRUE(controller.velocity().allFinite());
  const auto level = static_cast<std::size_t>(controller.report().failed_level());
  EXPECT_EQ(controller.hierarchy()[level][0].task->name(), "faulty");
  EXPECT_EQ(controller.report().failed_row(), 1);
  // What stands above the level at fault is still served, what stands below is not.
  icat::Tpik<double, 13> above;
  for (icat::Task<Robot>* t : std::initializer_list<icat::Task<Robot>*>{&limits, &attitude}) {
    ASSERT_EQ(above.add_level(t->jacobian(), t->activation(), t->reference()), Status::ok);
  }
  ASSERT_EQ(above.minimize_velocity(), Status::ok);
  EXPECT_LT((controller.velocity() - above.velocity()).norm(), 1e-12);
  // The goal of a task cannot be what is at fault: the task keeps the old one.
  const icat::Pose<double> goal = tool.goal();
  EXPECT_EQ(tool.set_goal(moved(goal, NAN, 0, 0)), Status::non_finite);
  EXPECT_EQ(tool.goal().matrix(), goal.matrix());
  // What is measured badly in a given column stops the robot, if it lasts.
  Vector13d bad = measured;
  bad(10) = NAN;
  Controller passive(robot, actions, {.given = icat::ColumnRange{10, 1}});
  ASSERT_EQ(passive.start("travel", 0), Status::ok);
  ASSERT_EQ(passive.step(0, measured), Status::ok);
  const Vector13d command = passive.command();
  EXPECT_GT(command.norm(), 0);
  for (int k = 1; k <= 100; ++k) {
    EXPECT_EQ(passive.step(0.01 * k, bad), Status::non_finite);
    EXPECT_TRUE(passive.velocity().allFinite());
    if (k <= 10) {
      EXPECT_EQ(passive.command(), command);
    }
  }
  EXPECT_EQ(passive.command(), Vector13d::Zero());
}

// What made a level be refused must not outlive the task's part in it.
TEST_F(ControllerTest, RecoversWhenTheFaultIsGone) {
  Faulty faulty(robot);
  actions[0].levels.push_back({faulty});
  Controller controller(robot, actions);
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  faulty.bad = true;
  EXPECT_EQ(controller.step(0.01), Status::non_finite);
  ASSERT_EQ(controller.switch_to("travel", 0.02, 0.5), Status::ok);
  EXPECT_EQ(controller.step(0.1), Status::non_finite);  // still fading out
  for (int k = 11; k <= 60; ++k) (void)controller.step(0.01 * k);
  EXPECT_EQ(controller.step(0.61), Status::ok);
  EXPECT_GT(controller.velocity().norm(), 0);
  faulty.bad = false;
  ASSERT_EQ(controller.switch_to("reach", 0.7, 0.5), Status::ok);
  EXPECT_EQ(controller.step(1.0), Status::ok);
}

// A task of the user's that breaks what it yields; `FunctionTask` gets blocks and cannot.
enum class Resized { reference, rows, columns };
template <class R>
class Resizing : public icat::Task<R> {
 public:
  Resizing(const R& robot, Resized what) : icat::Task<R>(robot, "resizing", 2), what_(what) {}

 private:
  void compute() noexcept override {
    const icat::Index n = this->robot().dof();
    if (what_ == Resized::reference) this->reference_.resize(1);
    if (what_ == Resized::rows) this->jacobian_.setZero(3, n);
    if constexpr (R::size == Eigen::Dynamic) {
      if (what_ == Resized::columns) this->jacobian_.setZero(2, n - 1);
    }
  }
  Resized what_;
};

template <class R>
void expect_refused(const R& robot, Resized what) {
  Resizing<R> resizing(robot, what);
  task::JointLimits<R> limits(robot);
  task::Minimality<R> still(robot, robot.base_columns());
  icat::Controller<R> controller(robot, {{"reach", {{limits}, {resizing}, {still}}}});
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  EXPECT_EQ(controller.step(0), Status::non_finite);
  EXPECT_EQ(controller.report().failed_level(), 1);
  EXPECT_TRUE(controller.velocity().allFinite());
}

TEST_F(ControllerTest, ATaskThatResizesWhatItYieldsIsRefused) {
  for (const Resized what : {Resized::reference, Resized::rows}) expect_refused(robot, what);
  const auto of_dynamic_size = testing_support::mobile_arm(icat::Base<double>::surface());
  for (const Resized what : {Resized::reference, Resized::rows, Resized::columns}) {
    expect_refused(of_dynamic_size, what);
  }
}

// Case C8: the task would read the state of another robot.
TEST_F(ControllerTest, ATaskOfAnotherRobotIsRefused) {
  const Robot other = placed_robot();
  task::FramePose<Robot> foreign(other, hand, other.pose(hand), {.name = "its tool"});
  actions[1].levels[2] = {foreign};
  EXPECT_EQ(message_of([&] { Controller(robot, actions); }),
            "action 'travel': task 'its tool' belongs to another robot");
  EXPECT_NO_THROW(Controller(other, {{"reach", {{foreign}}}}));
}

// Nothing outlives a robot that is a temporary.
static_assert(std::is_constructible_v<Controller, const Robot&, std::vector<icat::Action<Robot>>>);
static_assert(!std::is_constructible_v<Controller, Robot, std::vector<icat::Action<Robot>>>);
static_assert(!std::is_constructible_v<Controller, Robot, std::vector<icat::Action<Robot>>,
                                       Controller::Options>);

// Case C9: what `auto` keeps is of its cycle, not of the next one.
TEST_F(ControllerTest, AutoKeepsTheVelocityOfItsCycle) {
  Controller controller(robot, actions, {.given = icat::ColumnRange{10, 2}});
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0, measured), Status::ok);
  auto last = controller.velocity();
  auto last_command = controller.command();
  static_assert(std::is_same_v<decltype(last), Vector13d>);
  static_assert(std::is_same_v<decltype(last_command), Vector13d>);
  const Vector13d copy = last, copy_command = last_command;
  ASSERT_EQ(controller.start("travel", 0), Status::ok);
  ASSERT_EQ(controller.step(0, measured), Status::ok);
  EXPECT_GT((controller.velocity() - last).norm(), 0.1);
  EXPECT_EQ(last, copy);
  EXPECT_EQ(last_command, copy_command);
}

TEST_F(ControllerTest, DoesNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  Controller controller(robot, actions);
  const auto s = testing_support::random_states<double>(3, 22)[2];
  Status status = Status::not_started;
  EXPECT_EQ(count_allocations([&] {
              (void)controller.switch_to("reach", 0, 0.1);
              for (int i = 0; i < 50; ++i) {
                (void)robot.update(s.q, s.vehicle);
                if (i == 5) (void)controller.switch_to("travel", 0.01 * i, 0.1);
                if (i == 20) (void)controller.stop(0.01 * i, 0.1);
                if (i == 40) (void)controller.switch_to("travel", 0.01 * i, 0.1);
                if (i == 7) (void)controller.set_given("joint3", true);
                status = controller.step(0.01 * i, measured);
              }
            }),
            0);
  EXPECT_EQ(status, Status::ok);
}

// --- robots of other shapes ----------------------------------------------------------------------

// Case M10: a float holds no cycle of 10 ms in seconds since 1970; times are double.
TEST(ControllerOfFloat, EpochSeconds) {
  using FloatRobot = testing_support::Robot<float>;
  FloatRobot robot = testing_support::make_robot<float>();
  const auto s = testing_support::random_states<float>(3, 21)[1];
  ASSERT_EQ(robot.update(s.q, s.vehicle), Status::ok);
  const icat::FrameId hand = robot.frame("tool");
  const auto goal = moved(robot.pose(hand), 0.1, -0.2, 0.1);
  task::FramePose<FloatRobot> tool(robot, hand, goal, {.gain = 1});
  icat::Controller<FloatRobot> controller(robot, {{"reach", {{tool}}}});
  const double epoch = 1.76e9;
  ASSERT_EQ(controller.switch_to("reach", epoch, 1), Status::ok);
  for (int k = 1; k <= 1500; ++k) {
    ASSERT_EQ(controller.step(epoch + 0.01 * k), Status::ok);
    EXPECT_EQ(controller.in_transition(), k < 100) << k;
    if (k == 50) {
      EXPECT_NEAR((controller.velocity().norm() / controller.answer().norm()), 0.5, 1e-3);
    }
    ASSERT_EQ(testing_support::drive(robot, controller.velocity(), 0.01), Status::ok);
  }
  EXPECT_LT(testing_support::difference(robot.pose(hand), goal).norm(), 1e-3f);
}

// A fixed arm, of static size and of one known at run time; also with a dead joint, to a goal that
// the others can reach.
template <class Arm>
void reach(Arm robot) {
  for (const bool dead : {false, true}) {
    const icat::FrameId hand = robot.frame("end_effector");
    const Eigen::VectorXd start = testing_support::bent_arm();
    Eigen::VectorXd there = start;
    there << 0.5, 0.9, -0.1, -1.2, 0.1, 0.6, 0.4;
    ASSERT_EQ(robot.update(there), Status::ok);
    const icat::Pose<double> goal = robot.pose(hand);
    ASSERT_EQ(robot.update(start), Status::ok);
    task::JointLimits<Arm> limits(robot, {.margin = 0.05});
    task::FramePose<Arm> tool(robot, hand, goal, {.gain = 2});
    icat::Controller<Arm> controller(robot, {{"reach", {{limits}, {tool}}}});
    EXPECT_EQ(controller.velocity().size(), 7);
    ASSERT_EQ(controller.set_given("joint3", dead), Status::ok);
    ASSERT_EQ(controller.start("reach", 0), Status::ok);
    for (int k = 0; k < 1000; ++k) {
      ASSERT_EQ(controller.step(0.01 * k), Status::ok);
      ASSERT_EQ(testing_support::drive(robot, controller.velocity(), 0.01), Status::ok);
    }
    EXPECT_LT(testing_support::difference(robot.pose(hand), goal).norm(), 1e-6);
    EXPECT_EQ(robot.position(2) == start(2), dead);
  }
}
TEST(ControllerOfOtherRobots, FixedArm) {
  reach(testing_support::fixed_arm());
  reach(testing_support::Tree({.joints = icat::axes_chain(icat::maris_arm<double>())}));
}

// The least that a controller needs: no frames, no joints.
struct Least {
  using Scalar = double;
  static constexpr int size = 2;
  static icat::Index dof() { return 2; }
};
TEST(ControllerOfOtherRobots, TheLeastThatARobotCanBe) {
  using Function = task::FunctionTask<Least>;
  const Least robot;
  Function sum(robot, Objective::equal_to(1),
               [](const Least&, Function::Values x, Function::Block J) {
                 x(0) = 0;
                 J.setOnes();
               });
  icat::Controller<Least> controller(robot, {{"sum", {{sum}}}}, {.given = icat::ColumnRange{1, 1}});
  ASSERT_EQ(controller.start("sum", 0), Status::ok);
  ASSERT_EQ(controller.step(0, Eigen::Vector2d(7, 0.25)), Status::ok);
  EXPECT_LT((controller.velocity() - Eigen::Vector2d(0.75, 0.25)).norm(), 1e-12);
  EXPECT_LT((controller.command() - Eigen::Vector2d(0.75, 0)).norm(), 1e-12);
}

TEST(ControllerOfOtherRobots, TwoArmsAreTwoFramesOfOneTree) {
  using Tree = testing_support::Tree;
  Tree robot = testing_support::torso();
  const icat::FrameId left = robot.frame("left_end_effector"),
                      right = robot.frame("right_end_effector");
  // The right hand keeps its place beside the left one, which moves.
  const icat::Pose<double> between = robot.pose(left).inverse() * robot.pose(right);
  const icat::Pose<double> goal = moved(robot.pose(left), 0.1, 0, -0.1);
  task::JointLimits<Tree> limits(robot);
  task::FramePose<Tree> together(robot, right, between, {.relative_to = left, .gain = 5});
  task::FramePose<Tree> carry(robot, left, goal);
  icat::Controller<Tree> controller(robot, {{"carry", {{limits}, {together}, {carry}}}});
  ASSERT_EQ(controller.start("carry", 0), Status::ok);
  for (int k = 0; k < 1500; ++k) {
    ASSERT_EQ(controller.step(0.01 * k), Status::ok);
    ASSERT_EQ(testing_support::drive(robot, controller.velocity(), 0.01), Status::ok);
    EXPECT_LT(
        (robot.pose(left).inverse() * robot.pose(right) * between.inverse()).translation().norm(),
        1e-3);
  }
  EXPECT_LT(testing_support::difference(robot.pose(left), goal).norm(), 1e-5);
  // A measurement of another size is refused, and the robot keeps its velocity.
  const Eigen::VectorXd before = controller.velocity();
  EXPECT_EQ(controller.step(15, Eigen::VectorXd::Zero(13)), Status::wrong_size);
  EXPECT_EQ(controller.velocity(), before);
}

// The order of the columns is the robot's own.
TEST(ControllerOfOtherRobots, PermutedColumnsGivePermutedVelocities) {
  using Tree = testing_support::Tree;
  using Permuted = testing_support::BaseFirst<Tree>;
  const Tree tree = testing_support::mobile_arm(icat::Base<double>::surface());
  const Permuted permuted(tree);
  const auto run = [](const auto& robot, const Eigen::VectorXd& measured) -> Eigen::VectorXd {
    using R = std::decay_t<decltype(robot)>;
    const icat::FrameId hand = robot.frame("end_effector");
    task::JointLimits<R> limits(robot, {.margin = 0.3});
    task::Manipulability<R> dexterous(robot, hand, Objective::at_least(0.2, 0.05));
    task::FramePose<R> tool(robot, hand, moved(robot.pose(hand), 0.3, 0.2, 0.1));
    task::Minimality<R> still(robot, robot.base_columns());
    icat::Controller<R> controller(robot, {{"reach", {{limits}, {dexterous}, {tool}, {still}}}});
    EXPECT_EQ(controller.set_given("joint2", true), Status::ok);
    EXPECT_EQ(controller.set_given(robot.base_columns().first + 1, true), Status::ok);
    EXPECT_EQ(controller.start("reach", 0), Status::ok);
    EXPECT_EQ(controller.step(0, measured), Status::ok);
    return controller.velocity();
  };
  const Eigen::VectorXd measured = Eigen::VectorXd::LinSpaced(10, -0.1, 0.2);
  const Eigen::VectorXd expected = run(tree, measured);
  EXPECT_GT(expected.norm(), 0.1);
  EXPECT_LT((run(permuted, permuted.permuted(measured)) - permuted.permuted(expected)).norm(),
            1e-10);
}

}  // namespace
