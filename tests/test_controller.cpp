// SPDX-License-Identifier: BSD-3-Clause
// The kinematic layer and the kinematic plant.
#include <gtest/gtest.h>

#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>

#include "support/allocation_counter.hpp"
#include "support/states.hpp"

namespace {

using Robot = testing_support::Robot<double>;
using Objective = icat::Objective<double>;
using icat::Status;
using Vector6d = icat::Vector6<double>;
using Vector13d = icat::Vector<double, 13>;
namespace task = icat::task;

class ControllerTest : public testing::Test {
 protected:
  // Tasks are built here and not in place: bare braces there crash GCC 12.
  ControllerTest()
      : limits(robot, {.margin = 0.4, .gain = 0.5}),
        attitude(robot, {.norm = Objective::at_most(0.2, 0.1)}),
        tool(robot, {.gain = 0.5}),
        vehicle(robot, {.gain = 0.5}),
        still_arm(robot),
        actions{{"reach", {{limits}, {attitude}, {tool}}},
                {"travel", {{limits}, {attitude}, {vehicle}, {still_arm}}}} {
    const auto s = testing_support::random_states<double>(3, 21)[1];
    EXPECT_EQ(robot.update(s.q, s.vehicle), Status::ok);
    icat::Pose<double> goal = robot.tool();
    goal.translation() += icat::Vector3<double>(0.3, -0.2, 0.1);
    tool.set_goal(goal);
    vehicle.set_goal(testing_support::make_pose<double>(1, 1, 1, 0, 0, 1));
    measured << 0.1, -0.05, 0.02, 0.01, 0.03, -0.04;
  }

  Robot robot = testing_support::make_robot<double>();
  task::JointLimits<Robot> limits;
  task::HorizontalAttitude<Robot> attitude;
  task::ToolPose<Robot> tool;
  task::VehiclePose<Robot> vehicle;
  task::ArmMotionMinimality<Robot> still_arm;
  std::vector<icat::Action<Robot>> actions;
  Vector6d measured;

  using Controller = icat::Controller<Robot>;

  /// The same by hand.
  Vector13d solve(const Vector13d& rho0, const Eigen::Matrix<double, 13, 13>& Q0) {
    icat::Tpik<double, 13> tpik;
    EXPECT_EQ(tpik.reset(rho0, Q0), Status::ok);
    for (icat::Task<Robot>* t :
         std::initializer_list<icat::Task<Robot>*>{&limits, &attitude, &tool}) {
      t->update(robot);
      EXPECT_EQ(tpik.add_level(t->jacobian(), t->activation(), t->reference()), Status::ok);
    }
    EXPECT_EQ(tpik.minimize_velocity(), Status::ok);
    return tpik.velocity();
  }
};

TEST_F(ControllerTest, WholeBodyEqualsTheSolver) {
  Controller controller(robot, actions);
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0), Status::ok);
  const Vector13d expected = solve(Vector13d::Zero(), Eigen::Matrix<double, 13, 13>::Identity());
  EXPECT_LT((controller.velocity() - expected).norm(), 1e-12);
  EXPECT_EQ(controller.action(), "reach");
  EXPECT_EQ(controller.report().status(), Status::ok);
}

TEST_F(ControllerTest, NonActuatedComponentsKeepTheirMeasuredVelocity) {
  Controller controller(robot, actions, {.actuated = {true, true, true, false, false, true}});
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0, measured), Status::ok);
  Vector13d rho0 = Vector13d::Zero();
  Eigen::Matrix<double, 13, 13> Q0 = Eigen::Matrix<double, 13, 13>::Identity();
  rho0.segment<2>(10) = measured.segment<2>(3);
  Q0(10, 10) = Q0(11, 11) = 0;
  EXPECT_LT((controller.velocity() - solve(rho0, Q0)).norm(), 1e-12);
  EXPECT_EQ(controller.velocity().segment<2>(10), measured.segment<2>(3));
}

TEST_F(ControllerTest, ParallelKeepsTheVehicleOfTpik1AndTheJointsOfTpik2) {
  Controller controller(robot, actions, {.scheme = icat::Scheme::parallel});
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0, measured), Status::ok);
  const Vector13d tpik1 = solve(Vector13d::Zero(), Eigen::Matrix<double, 13, 13>::Identity());
  Vector13d rho0 = Vector13d::Zero();
  rho0.tail<6>() = measured;
  Eigen::Matrix<double, 13, 13> Q0 = Eigen::Matrix<double, 13, 13>::Zero();
  Q0.topLeftCorner<7, 7>().setIdentity();
  const Vector13d tpik2 = solve(rho0, Q0);
  EXPECT_LT((controller.vehicle_velocity() - tpik1.tail<6>()).norm(), 1e-12);
  EXPECT_LT((controller.joint_velocity() - tpik2.head<7>()).norm(), 1e-12);

  // The arm's loop may run alone on a newer measurement.
  const Vector6d newer = 2 * measured;
  ASSERT_EQ(controller.step_arm(0.001, newer), Status::ok);
  rho0.tail<6>() = newer;
  EXPECT_LT((controller.joint_velocity() - solve(rho0, Q0).head<7>()).norm(), 1e-12);
  EXPECT_LT((controller.vehicle_velocity() - tpik1.tail<6>()).norm(), 1e-12);
  ASSERT_EQ(controller.step_vehicle(0.002, newer), Status::ok);
  EXPECT_LT((controller.vehicle_velocity() - tpik1.tail<6>()).norm(), 1e-12);
}

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
  Controller controller(robot, actions);
  EXPECT_EQ(controller.step(0), Status::not_started);
  EXPECT_EQ(controller.velocity(), Vector13d::Zero());
  EXPECT_EQ(controller.start("nowhere", 0), Status::unknown_action);
  EXPECT_EQ(controller.switch_to("nowhere", 0, 1), Status::unknown_action);
  EXPECT_EQ(controller.switch_to("reach", 0, -1), Status::invalid_duration);
  EXPECT_EQ(controller.action(), "");
  ASSERT_EQ(controller.start("reach", 1), Status::ok);
  ASSERT_EQ(controller.step(1), Status::ok);
  // A call that comes late keeps what there was; it does not stop the robot.
  const Vector13d before = controller.velocity();
  EXPECT_GT(before.norm(), 0);
  EXPECT_EQ(controller.step(0.5), Status::time_reversed);
  EXPECT_EQ(controller.step_arm(0.99, measured), Status::time_reversed);
  EXPECT_EQ(controller.step(NAN), Status::non_finite);
  EXPECT_EQ(controller.velocity(), before);

  icat::Pose<double> goal = tool.goal();
  goal.translation().y() = NAN;
  tool.set_goal(goal);
  EXPECT_EQ(controller.step(1.01), Status::non_finite);
  EXPECT_TRUE(controller.velocity().allFinite());
  const auto level = static_cast<std::size_t>(controller.report().failed_level());
  EXPECT_EQ(controller.hierarchy()[level][0].task->name(), "tool pose");
  EXPECT_EQ(controller.report().failed_row(), 1);
  // What stands above the level at fault is still served: here nothing is active, so it rests.
  Vector6d bad = measured;
  bad(3) = NAN;
  Controller passive(robot, actions, {.actuated = {true, true, true, false, true, true}});
  ASSERT_EQ(passive.start("travel", 0), Status::ok);
  EXPECT_EQ(passive.step(0, bad), Status::non_finite);
  EXPECT_EQ(passive.velocity(), Vector13d::Zero());
}

// What made a level be refused must not outlive the task's part in it.
TEST_F(ControllerTest, RecoversWhenTheFaultIsGone) {
  Controller controller(robot, actions);
  const icat::Pose<double> good = tool.goal();
  icat::Pose<double> bad = good;
  bad.translation().x() = NAN;
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  tool.set_goal(bad);
  EXPECT_EQ(controller.step(0.01), Status::non_finite);
  ASSERT_EQ(controller.switch_to("travel", 0.02, 0.5), Status::ok);
  EXPECT_EQ(controller.step(0.1), Status::non_finite);  // still fading out
  EXPECT_EQ(controller.step(0.6), Status::ok);
  EXPECT_GT(controller.velocity().norm(), 0);
  tool.set_goal(good);
  ASSERT_EQ(controller.switch_to("reach", 0.7, 0.5), Status::ok);
  EXPECT_EQ(controller.step(1.0), Status::ok);
}

TEST_F(ControllerTest, ATaskThatResizesWhatItYieldsIsRefused) {
  using Function = task::FunctionTask<Robot>;
  Function grows(robot, {.name = "grows",
                         .evaluate =
                             [](const Robot& r, Function::Rows&, Function::Jacobian& J) {
                               J = r.tool_jacobian(icat::Frame::world).topRows<3>();
                             },
                         .objective = Objective::equal_to(0)});
  Function shrinks(
      robot, {.name = "shrinks",
              .rows = 2,
              .evaluate = [](const Robot&, Function::Rows& x, Function::Jacobian&) { x.resize(1); },
              .objective = Objective::equal_to(0)});
  for (Function* f : {&grows, &shrinks}) {
    Controller controller(robot, {{"reach", {{limits}, {*f}, {tool}}}});
    ASSERT_EQ(controller.start("reach", 0), Status::ok);
    EXPECT_EQ(controller.step(0), Status::non_finite);
    EXPECT_EQ(controller.report().failed_level(), 1);
    EXPECT_TRUE(controller.velocity().allFinite());
  }
}

TEST_F(ControllerTest, DoesNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  Controller controller(robot, actions, {.scheme = icat::Scheme::parallel});
  const auto s = testing_support::random_states<double>(3, 22)[2];
  Status status = Status::not_started;
  EXPECT_EQ(count_allocations([&] {
              (void)controller.switch_to("reach", 0, 0.1);
              for (int i = 0; i < 50; ++i) {
                (void)robot.update(s.q, s.vehicle);
                if (i == 5) (void)controller.switch_to("travel", 0.01 * i, 0.1);
                status = controller.step(0.01 * i, measured);
              }
            }),
            0);
  EXPECT_EQ(status, Status::ok);
}

TEST(KinematicPlant, HoldsVelocitiesOverTheStepAndLags) {
  icat::KinematicPlant<double, 7>::Options options;
  options.vehicle = testing_support::make_pose<double>(0, 0, 0, 0, 0, std::numbers::pi / 2);
  options.current = [](double t) { return icat::Vector3<double>(t, 0, 0); };
  options.actuated[4] = false;
  icat::KinematicPlant<double, 7> plant(options);
  Vector6d v;
  v << 1, 0, 0, 0, 0.7, 0;
  const icat::Vector<double, 7> qdot = icat::Vector<double, 7>::Constant(0.1);
  plant.step(qdot, v, 2, 0.5);
  EXPECT_NEAR(plant.q()(3), 0.05, 1e-15);
  // Surge is along y of the world, the current of 2 m/s along x; pitch is not actuated.
  EXPECT_LT((plant.vehicle().translation() - icat::Vector3<double>(1, 0.5, 0)).norm(), 1e-12);
  EXPECT_NEAR(plant.vehicle_velocity()(0), 1, 1e-12);
  EXPECT_NEAR(plant.vehicle_velocity()(1), -2, 1e-12);
  EXPECT_EQ(plant.vehicle_velocity()(4), 0);

  options.current = {};
  options.tracking_lag = 0.5;
  icat::KinematicPlant<double, 7> slow(options);
  for (int i = 0; i < 50; ++i) slow.step(qdot, v, 0.01 * i, 0.01);
  EXPECT_NEAR(slow.vehicle_velocity()(0), 1 - std::exp(-1), 1e-12);
  options.tracking_lag = -1;
  EXPECT_THROW((icat::KinematicPlant<double, 7>(options)), std::invalid_argument);
}

}  // namespace
