// SPDX-License-Identifier: BSD-3-Clause
// Explanations: causes that are known, shares that add up, and nothing to say where nothing is.
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <icat/icat.hpp>
#include <iostream>
#include <sstream>

#include "support/allocation_counter.hpp"
#include "support/random_hierarchy.hpp"
#include "support/robots.hpp"

namespace {

using Robot = testing_support::Tree;
using Controller = icat::Controller<Robot>;
using Explanation = icat::TaskExplanation<double>;
using icat::LimitKind;
using icat::LossCause;
using icat::Status;
using icat::Verdict;
using testing_support::drive;
using testing_support::message_of;
using testing_support::moved;
using Vector3d = icat::Vector3<double>;
namespace task = icat::task;

/// The MARIS arm, bolted down and bent.
Robot maris_arm() {
  Robot robot({.joints = icat::axes_chain(icat::maris_arm<double>())});
  EXPECT_EQ(robot.update(testing_support::bent_arm()), Status::ok);
  return robot;
}
/// Two links of 1 m that turn in the plane, stretched along x but for `bend` (rad) in the elbow.
Robot planar_arm(double bend) {
  Robot::Description d;
  const auto at = [](double x) { return testing_support::make_pose<double>(x, 0, 0, 0, 0, 0); };
  d.joints.push_back(
      {.name = "shoulder", .parent = "ground", .link = "upper", .lower = -2, .upper = 2});
  d.joints.push_back({.name = "elbow",
                      .parent = "upper",
                      .link = "lower",
                      .origin = at(1),
                      .lower = -2,
                      .upper = 2});
  d.joints.push_back({.name = "wrist",
                      .parent = "lower",
                      .link = "tip",
                      .type = icat::JointType::fixed,
                      .origin = at(1)});
  Robot robot(d);
  EXPECT_EQ(robot.update(Eigen::Vector2d(0, bend)), Status::ok);
  return robot;
}

template <class Scalar>
Scalar sum(const icat::TaskExplanation<Scalar>& t) {
  Scalar all(0);
  for (const auto& share : t.shares) all += share.amount;
  return all;
}
double part(const Explanation& t, LossCause cause) {
  double all = 0;
  for (const auto& share : t.shares) all += share.cause == cause ? share.amount : 0;
  return t.loss > 0 ? all / t.loss : 0;
}
const Explanation& find(const icat::Explainer<Controller>& e, std::string_view name) {
  for (const auto& t : e.tasks()) {
    if (t.task == name) return t;
  }
  ADD_FAILURE() << "no task " << name;
  return e.tasks()[0];
}
/// The sums, and the rates against the controller's own; the sentence says `words`.
void expect(const icat::Explainer<Controller>& e, std::string_view name, Verdict verdict,
            std::string_view words) {
  for (std::size_t i = 0; i < e.tasks().size(); ++i) {
    const Explanation& t = e.tasks()[i];
    EXPECT_NEAR(sum(t), t.loss, 1e-9 * std::max(1.0, t.loss)) << t.task;
    if (t.task != name) continue;
    EXPECT_EQ(t.verdict, verdict) << e.text();
    EXPECT_NE(e.sentence(i).find(words), std::string::npos) << e.text();
  }
}

class Explain : public testing::Test {
 protected:
  Robot robot = maris_arm();
  icat::FrameId hand = robot.frame("end_effector");
  task::JointLimits<Robot> limits{robot, {.margin = 0.3}};
  task::FramePose<Robot> tool{
      robot, hand, moved(robot.pose(hand), 0.1, -0.1, 0.05), {.name = "tool pose", .gain = 0.5}};
  task::JointPosition<Robot> shape{robot, testing_support::bent_arm(), {.name = "shape"}};
  std::vector<icat::Action<Robot>> reach{{"reach", {{limits}, {tool}, {shape}}},
                                         {"rest", {{limits}, {shape}}}};
};

// --- what is normal ------------------------------------------------------------------------------

TEST_F(Explain, ANormalReachNeverAlarms) {
  Controller controller(robot, reach);
  icat::Explainer<Controller> e(controller);
  EXPECT_EQ(e.status(), Status::not_started);
  EXPECT_FALSE(e.alarm());
  EXPECT_NE(e.text().find("has not done a cycle"), std::string::npos);
  ASSERT_EQ(controller.switch_to("reach", 0, 1), Status::ok);
  for (int i = 0; i < 1500; ++i) {
    ASSERT_EQ(controller.step(0.01 * i), Status::ok);
    if (i % 5 == 0) e.update();
    ASSERT_FALSE(e.alarm()) << i << "\n" << e.text();
    for (const auto& t : e.tasks()) ASSERT_NEAR(sum(t), t.loss, 1e-9);
    if (i == 5) expect(e, "tool pose", Verdict::fades, "the command is fading in");
    if (i == 200) {
      expect(e, "joint limits", Verdict::idle, "has nothing to do");
      expect(e, "tool pose", Verdict::met, "gets what it wants");
      EXPECT_LT(find(e, "tool pose").loss, 1e-9);
      expect(e, "shape", Verdict::yields, "'tool pose', which has priority");
    }
    ASSERT_EQ(drive(robot, controller.velocity(), 0.01), Status::ok);
  }
  // 15 s are 7 time constants: less than 1e-3 of 0.15 m is left.
  EXPECT_LT(find(e, "tool pose").position_left, 1.5e-4);
  ASSERT_EQ(controller.switch_to("rest", 15, 1), Status::ok);
  ASSERT_EQ(controller.step(15.5), Status::ok);
  e.update();
  EXPECT_FALSE(e.alarm()) << e.text();
  ASSERT_EQ(controller.step(15.6), Status::ok);
  while (controller.in_transition())
    ASSERT_EQ(controller.step(controller.clock().elapsed() + 1), Status::ok);
  e.update();
  expect(e, "tool pose", Verdict::off, "is not part of the action 'rest'");
  EXPECT_EQ(e.text().find("tool pose"), std::string::npos) << e.text();
}

TEST_F(Explain, AControllerThatIsExplainedDoesTheSame) {
  Robot other = robot;
  Controller controller(robot, reach), twin(robot, reach);
  icat::Explainer<Controller> e(controller);
  for (Controller* c : {&controller, &twin}) ASSERT_EQ(c->switch_to("reach", 0, 0.5), Status::ok);
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(controller.step(0.01 * i), Status::ok);
    e.update();
    ASSERT_EQ(twin.step(0.01 * i), Status::ok);
    ASSERT_EQ(controller.velocity(), twin.velocity());
    ASSERT_EQ(drive(robot, controller.velocity(), 0.01), Status::ok);
  }
}

// --- other tasks ---------------------------------------------------------------------------------

TEST_F(Explain, AJointAtItsLimitTakesWhatTheTaskBelowWants) {
  // Joint 4 is 0.05 rad inside of its lower limit, and the shape wants it beyond.
  Eigen::VectorXd q = testing_support::bent_arm(), goal = q;
  const auto& joint = robot.joints()[3];
  q(3) = joint.lower + 0.05;
  goal(3) = joint.lower - 0.5;
  ASSERT_EQ(robot.update(q), Status::ok);
  ASSERT_EQ(shape.set_goal(goal), Status::ok);
  Controller controller(robot, reach);
  ASSERT_EQ(controller.start("rest", 0), Status::ok);
  ASSERT_EQ(controller.step(0), Status::ok);
  const auto e = icat::explain(controller);
  const Explanation& t = find(e, "shape");
  ASSERT_NE(t.most(), nullptr);
  EXPECT_EQ(t.most()->cause, LossCause::level);
  EXPECT_EQ(t.most()->task, "joint limits");
  EXPECT_EQ(t.most()->level, 0);
  EXPECT_EQ(t.most()->row, 3);
  EXPECT_EQ(t.most()->column, joint.column);
  EXPECT_TRUE(t.most()->alone);
  EXPECT_GT(t.most()->activation, 0.5);
  EXPECT_GT(part(t, LossCause::level), 0.99);
  EXPECT_FALSE(t.alarm);
  expect(e, "shape", Verdict::yields, "'joint limits', which has priority, decides how joint4 (at");
}

TEST_F(Explain, OfTwoTasksInConflictTheLowerLosesToTheHigher) {
  const Vector3d p = icat::detail::origin(robot.pose(hand));
  task::FramePosition<Robot> left(robot, hand, p + Vector3d(0, 0.1, 0), {.name = "left"});
  task::FramePosition<Robot> right(robot, hand, p - Vector3d(0, 0.1, 0), {.name = "right"});
  Controller ordered(robot, {{"go", {{left}, {right}}}});
  ASSERT_EQ(ordered.start("go", 0), Status::ok);
  ASSERT_EQ(ordered.step(0), Status::ok);
  const auto e = icat::explain(ordered);
  // It wants 0.1 m/s one way and gets 0.1 m/s the other.
  EXPECT_NEAR(find(e, "right").wanted, 0.1, 1e-12);
  EXPECT_NEAR(find(e, "right").loss, 0.2, 1e-6);
  EXPECT_EQ(find(e, "right").fraction(), 0);
  EXPECT_GT(part(find(e, "right"), LossCause::level), 0.9999);
  EXPECT_EQ(find(e, "right").most()->row, 1);  // y
  expect(e, "left", Verdict::met, "gets what it wants");
  expect(e, "right", Verdict::yields,
         "'right' gets 0 % of what it wants (0.1 m to go): 'left', which has priority");

  // Of equal rank both get the mean: nothing.
  Controller equal(robot, {{"go", {{left, right}}}});
  ASSERT_EQ(equal.start("go", 0), Status::ok);
  ASSERT_EQ(equal.step(0), Status::ok);
  const auto both = icat::explain(equal);
  for (const char* name : {"left", "right"}) {
    EXPECT_NEAR(find(both, name).loss, 0.1, 1e-6);
    EXPECT_GT(part(find(both, name), LossCause::equal), 0.99);
  }
  expect(both, "left", Verdict::yields, "'right', which has the same priority");
}

TEST_F(Explain, ActivationsAndTransitionsAreNormal) {
  // Half active: the middle of the margin of joint 4.
  Eigen::VectorXd q = testing_support::bent_arm();
  q(3) = robot.joints()[3].lower + 0.15;
  ASSERT_EQ(robot.update(q), Status::ok);
  Controller controller(robot, {{"hold", {{limits}}}, {"reach", {{limits}, {tool}}}});
  ASSERT_EQ(controller.start("hold", 0), Status::ok);
  ASSERT_EQ(controller.step(0), Status::ok);
  icat::Explainer<Controller> e(controller);
  // Alone, a row of activation a gets a times what it wants.
  EXPECT_GT(part(find(e, "joint limits"), LossCause::activation), 0.5);
  expect(e, "joint limits", Verdict::fades, "near its threshold");
  EXPECT_FALSE(e.alarm());
  ASSERT_EQ(controller.switch_to("reach", 0, 1), Status::ok);
  for (int i = 1; i <= 5; ++i) ASSERT_EQ(controller.step(0.1 * i), Status::ok);
  e.update();
  EXPECT_NEAR(find(e, "tool pose").phase, 0.5, 1e-9);
  EXPECT_GT(part(find(e, "tool pose"), LossCause::transition), 0.5);
  expect(e, "tool pose", Verdict::fades, "the action is changing; its phase activation is 0.5");
  EXPECT_FALSE(e.alarm());
}

// --- the robot -----------------------------------------------------------------------------------

TEST(ExplainRobot, ASingularPostureAndAGoalOutOfReach) {
  // Stretched exactly, pulled outwards: no velocity moves the tip that way.
  Robot robot = planar_arm(0);
  const auto tip = robot.frame("tip");
  task::FramePosition<Robot> reach(robot, tip, Vector3d(3, 0, 0), {.name = "reach", .gain = 0.1});
  Controller controller(robot, {{"reach", {{reach}}}});
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0), Status::ok);
  icat::Explainer<Controller> e(controller);
  EXPECT_NEAR(find(e, "reach").loss, 0.1, 1e-12);
  EXPECT_NEAR(part(find(e, "reach"), LossCause::singular), 1, 1e-12);
  EXPECT_NEAR(find(e, "reach").position_left, 1, 1e-12);
  EXPECT_TRUE(find(e, "reach").alarm);
  expect(e, "reach", Verdict::blocked,
         "gets 0 % of what it wants (1 m to go): the robot cannot move that way");
  EXPECT_EQ(e.conclusion().find("Look here: 'reach' gets 0 %"), 0u) << e.conclusion();

  // Bent, it stretches by itself; then regularization is what keeps it from flying.
  ASSERT_EQ(robot.update(Eigen::Vector2d(0.3, 0.8)), Status::ok);
  for (int i = 1; i < 3000; ++i) {
    ASSERT_EQ(controller.step(0.01 * i), Status::ok);
    ASSERT_EQ(drive(robot, controller.velocity(), 0.01), Status::ok);
  }
  e.update();
  EXPECT_GT(part(find(e, "reach"), LossCause::singular) +
                part(find(e, "reach"), LossCause::regularization),
            0.99);
  EXPECT_TRUE(find(e, "reach").alarm) << e.text();
  expect(e, "reach", Verdict::blocked, "out of reach");
}

TEST_F(Explain, AMotorThatDied) {
  Eigen::VectorXd goal = testing_support::bent_arm();
  goal(3) += 0.4;
  goal(1) += 0.1;
  ASSERT_EQ(shape.set_goal(goal), Status::ok);
  Controller controller(robot, reach);
  ASSERT_EQ(controller.set_given("joint4", true), Status::ok);
  ASSERT_EQ(controller.start("rest", 0), Status::ok);
  ASSERT_EQ(controller.step(0), Status::ok);
  const auto e = icat::explain(controller);
  EXPECT_NEAR(find(e, "shape").loss, 0.4, 1e-12);
  EXPECT_NEAR(part(find(e, "shape"), LossCause::given), 1, 1e-12);
  EXPECT_EQ(find(e, "shape").most()->column, 3);
  EXPECT_TRUE(find(e, "shape").alarm);
  expect(e, "shape", Verdict::blocked, "joint4 is not commanded");

  // Where most is done all the same, it is told and no alarm.
  goal(1) += 1;
  ASSERT_EQ(shape.set_goal(goal), Status::ok);
  ASSERT_EQ(controller.step(0.01), Status::ok);
  const auto most = icat::explain(controller);
  expect(most, "shape", Verdict::blocked, "joint4 is not commanded");
  EXPECT_FALSE(most.alarm()) << most.text();
}

TEST_F(Explain, TwoCausesShareTheLossByTheirSquares) {
  // Across each other: 0.4 rad/s of joint 4, which is dead, and 0.8 of the rad/s of joint 2.
  Eigen::VectorXd goal = testing_support::bent_arm();
  goal(3) += 0.4;
  goal(1) += 1;
  ASSERT_EQ(shape.set_goal(goal), Status::ok);
  Controller controller(robot, {{"rest", {{shape}}}}, {.limits = {robot, {.max_velocity = 0.2}}});
  ASSERT_EQ(controller.set_given("joint4", true), Status::ok);
  ASSERT_EQ(controller.start("rest", 0), Status::ok);
  ASSERT_EQ(controller.step(0), Status::ok);
  const auto e = icat::explain(controller);
  const Explanation& t = find(e, "shape");
  EXPECT_NEAR(t.wanted, std::sqrt(1.16), 1e-12);
  EXPECT_NEAR(t.achieved, 0.2, 1e-12);
  EXPECT_NEAR(t.loss, std::sqrt(0.8), 1e-12);
  EXPECT_NEAR(part(t, LossCause::given), 0.16 / 0.8, 1e-12);
  EXPECT_NEAR(part(t, LossCause::bound), 0.64 / 0.8, 1e-12);
  expect(e, "shape", Verdict::limited, "joint2 is as fast as it may be");
}

TEST_F(Explain, LimitsOfPositionVelocityAndAcceleration) {
  Eigen::VectorXd goal = testing_support::bent_arm();
  goal(1) += 1;
  ASSERT_EQ(shape.set_goal(goal), Status::ok);
  const auto start = [&](Controller& c) {
    ASSERT_EQ(c.start("rest", 0), Status::ok);
    ASSERT_EQ(c.step(0), Status::ok);
  };
  {
    icat::VelocityBounds<double> bounds{Eigen::VectorXd::Constant(7, -0.2),
                                        Eigen::VectorXd::Constant(7, 0.2)};
    Controller c(robot, reach, {.solver = {.bounds = bounds}});
    start(c);
    const auto e = icat::explain(c);
    EXPECT_NEAR(find(e, "shape").loss, 0.8, 1e-12);
    EXPECT_NEAR(part(find(e, "shape"), LossCause::bound), 1, 1e-12);
    EXPECT_EQ(find(e, "shape").most()->column, 1);
    EXPECT_EQ(find(e, "shape").most()->limit, LimitKind::velocity);
    EXPECT_FALSE(e.alarm());
    expect(e, "shape", Verdict::limited, "joint2 is as fast as it may be");
  }
  {
    Controller c(robot, reach, {.limits = {robot, {.max_velocity = 0.3}}});
    start(c);
    const auto e = icat::explain(c);
    EXPECT_NEAR(find(e, "shape").loss, 0.7, 1e-12);
    EXPECT_EQ(find(e, "shape").most()->limit, LimitKind::velocity);
    expect(e, "shape", Verdict::limited, "joint2 is as fast as it may be");
  }
  {
    Controller c(robot, reach, {.limits = {robot, {.max_acceleration = 1}}});
    start(c);
    ASSERT_EQ(c.step(0.01), Status::ok);
    const auto e = icat::explain(c);
    // 0.01 s at 1 rad/s² are 0.01 rad/s of the rad/s that it wants.
    EXPECT_NEAR(find(e, "shape").loss, 0.99, 1e-9);
    EXPECT_NEAR(part(find(e, "shape"), LossCause::limit), 1, 1e-9);
    EXPECT_EQ(find(e, "shape").most()->column, 1);
    EXPECT_EQ(find(e, "shape").most()->limit, LimitKind::acceleration);
    EXPECT_FALSE(e.alarm());
    expect(e, "shape", Verdict::limited, "joint2 cannot speed up or brake faster");
  }
  {
    // No task of joint limits: the hard limit alone holds joint 2, 0.001 rad before its end.
    Eigen::VectorXd q = testing_support::bent_arm();
    q(1) = robot.joints()[1].upper - 0.001;
    ASSERT_EQ(robot.update(q), Status::ok);
    q(1) += 0.5;
    ASSERT_EQ(shape.set_goal(q), Status::ok);
    Controller c(robot, {{"rest", {{shape}}}});
    start(c);
    const auto e = icat::explain(c);
    EXPECT_GT(part(find(e, "shape"), LossCause::bound), 0.999);
    EXPECT_EQ(find(e, "shape").most()->column, 1);
    EXPECT_EQ(find(e, "shape").most()->limit, LimitKind::position);
    EXPECT_TRUE(find(e, "shape").alarm);
    expect(e, "shape", Verdict::blocked, "joint2 (at");
    expect(e, "shape", Verdict::blocked, "is near the end of its range");
  }
}

TEST_F(Explain, HalfATurnIsToldAndNoAlarm) {
  task::FrameOrientation<Robot> turn(
      robot, hand,
      (Eigen::AngleAxisd(std::numbers::pi, Vector3d::UnitZ()) * robot.pose(hand).linear()).eval(),
      {.name = "turn", .max_rate = 0.1});
  Controller controller(robot, {{"turn", {{turn}}}});
  ASSERT_EQ(controller.start("turn", 0), Status::ok);
  ASSERT_EQ(controller.step(0), Status::ok);
  const auto e = icat::explain(controller);
  const Explanation& t = find(e, "turn");
  EXPECT_TRUE(t.half_turn);
  EXPECT_NEAR(t.angle_left, std::numbers::pi, 1e-7);
  EXPECT_TRUE(std::isnan(t.position_left));
  EXPECT_FALSE(e.alarm()) << e.text();
  expect(e, "turn", Verdict::met, "both ways round are as long");
}

// --- time and input ------------------------------------------------------------------------------

TEST_F(Explain, AClockThatStandsStill) {
  Controller controller(robot, reach);
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0.01), Status::ok);
  icat::Explainer<Controller> e(controller);
  EXPECT_FALSE(e.alarm());
  Status status = Status::ok;
  for (int i = 0; i < 100; ++i) status = controller.step(0.01);
  ASSERT_EQ(status, Status::clock_stalled);
  e.update();
  EXPECT_EQ(e.status(), Status::clock_stalled);
  EXPECT_TRUE(e.alarm());
  EXPECT_NEAR(part(find(e, "tool pose"), LossCause::ramp), 1, 1e-6) << e.text();
  expect(e, "tool pose", Verdict::faulty, "the time stamps do not change");
  EXPECT_EQ(e.conclusion(), "The robot stops: the time stamps do not change.");
}

TEST_F(Explain, StateThatIsOldAndAStop) {
  Controller controller(robot, reach);
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0.01), Status::ok);
  icat::Explainer<Controller> e(controller);
  // The command holds for an older state, then goes to zero.
  ASSERT_EQ(drive(robot, controller.velocity(), 1), Status::ok);
  ASSERT_EQ(controller.step(0.02, {.state = 1}), Status::stale_state);
  e.update();
  EXPECT_TRUE(e.alarm());
  EXPECT_GT(part(find(e, "tool pose"), LossCause::held), 0.9) << e.text();
  EXPECT_EQ(e.conclusion(), "The robot stops: the robot's state is too old.");
  ASSERT_EQ(controller.step(0.03), Status::ok);
  ASSERT_EQ(controller.stop(0.03, 0.1), Status::ok);
  for (int i = 4; i < 30; ++i) ASSERT_EQ(controller.step(0.01 * i), Status::ok);
  e.update();
  EXPECT_FALSE(e.alarm()) << e.text();
  EXPECT_NEAR(part(find(e, "tool pose"), LossCause::ramp), 1, 1e-9) << e.text();
  expect(e, "tool pose", Verdict::fades, "the controller was told to stop");
}

/// A row that yields NaN while it is told to.
class Faulty : public icat::Task<Robot> {
 public:
  explicit Faulty(const Robot& robot) : Task(robot, "camera", 3) {}
  bool bad{false};

 private:
  void compute() noexcept override { reference_(1) = bad ? NAN : 0; }
};

TEST_F(Explain, InputThatIsRefusedIsNamedBelowToo) {
  Faulty camera(robot);
  Controller controller(robot, {{"reach", {{limits}, {camera}, {tool}}}});
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0), Status::ok);
  icat::Explainer<Controller> e(controller);
  EXPECT_FALSE(e.alarm());
  camera.bad = true;
  ASSERT_EQ(controller.step(0.01), Status::non_finite);
  e.update();
  EXPECT_TRUE(e.alarm());
  expect(e, "joint limits", Verdict::idle, "has nothing to do");
  expect(e, "camera", Verdict::faulty, "has bad input");
  EXPECT_EQ(find(e, "camera").loss, 0);
  expect(e, "tool pose", Verdict::faulty, "the input of 'camera' is bad in row 1");
  const auto* most = find(e, "tool pose").most();
  EXPECT_EQ(most->level, 1);
  EXPECT_EQ(most->row, 1);
  EXPECT_NEAR(part(find(e, "tool pose"), LossCause::refused), 1, 1e-6);
  EXPECT_EQ(e.conclusion(), "Look here: 'camera' has bad input, and nothing is done for it.");
}

// --- base and joints in parallel -----------------------------------------------------------------

TEST(ExplainParallel, ABaseThatDoesNotDoWhatItIsAskedFor) {
  Robot robot = testing_support::mobile_arm(icat::Base<double>::surface());
  const auto hand = robot.frame("end_effector");
  task::FramePosition<Robot> tool(robot, hand,
                                  icat::detail::origin(robot.pose(hand)) + Vector3d(20, 0, 0),
                                  {.name = "tool", .max_rate = 0.5});
  task::FramePose<Robot> travel(robot, robot.base(), moved(robot.pose(robot.base()), 10, 0, 0),
                                {.name = "travel", .max_linear_rate = 0.3});
  icat::ParallelController<Robot> controller(robot, {{"go", {{tool}, {travel}}}});
  ASSERT_EQ(controller.start("go", 0), Status::ok);
  // The current drives it the other way.
  const Vector3d drift(-0.2, 0.05, 0.1);
  ASSERT_EQ(controller.step(0, drift), Status::ok);
  icat::Explainer<icat::ParallelController<Robot>> e(controller);
  const auto check = [&e] {
    for (const auto& t : e.tasks()) EXPECT_NEAR(sum(t), t.loss, 1e-9) << t.task;
  };
  check();
  const auto& t = e.tasks()[1];
  ASSERT_EQ(t.task, "travel");
  EXPECT_EQ(t.verdict, Verdict::limited) << e.text();
  EXPECT_EQ(t.most()->cause, LossCause::base) << e.text();
  EXPECT_TRUE(robot.base_columns().holds(t.most()->column));
  EXPECT_NE(e.sentence(1).find("what the base does, most of all for the base's surge"),
            std::string::npos);
  EXPECT_EQ(part(t, LossCause::held), 0);
  EXPECT_EQ(e.tasks()[0].verdict, Verdict::met) << e.text();

  // A base that does what it is asked for.
  for (int i = 1; i < 20; ++i) {
    const Eigen::VectorXd velocity = controller.velocity();
    ASSERT_EQ(controller.step(0.01 * i, velocity), Status::ok);
  }
  e.update();
  check();
  EXPECT_LT(std::abs(part(e.tasks()[1], LossCause::base)), 1e-6) << e.text();
  EXPECT_FALSE(e.alarm()) << e.text();

  // Joints that follow their law go by an older state.
  ASSERT_EQ(controller.step_joint_law(0.2), Status::ok);
  ASSERT_EQ(controller.follow_joint_law(0.21, drift), Status::ok);
  e.update();
  check();
  EXPECT_EQ(e.status(), Status::ok);
}

TEST(ExplainParallel, ABaseThatStartsIsNotABaseThatIsDrivenOff) {
  Robot robot = testing_support::mobile_arm(icat::Base<double>::surface());
  task::FramePose<Robot> travel(robot, robot.base(), moved(robot.pose(robot.base()), 10, 0, 0),
                                {.name = "travel", .max_linear_rate = 0.3});
  icat::ParallelController<Robot> controller(robot, {{"go", {{travel}}}});
  ASSERT_EQ(controller.switch_to("go", 0, 1), Status::ok);
  ASSERT_EQ(controller.step(0.02, Vector3d::Zero()), Status::ok);
  ASSERT_EQ(controller.step(0.1, Vector3d(controller.command().tail<3>())), Status::ok);
  const auto e = icat::explain(controller);
  const Explanation& t = e.tasks()[0];
  EXPECT_EQ(t.verdict, Verdict::fades) << e.text();
  EXPECT_EQ(t.most()->cause, LossCause::ramp) << e.text();
  EXPECT_NEAR(sum(t), t.loss, 1e-12);
  EXPECT_NE(e.sentence(0).find("the command is fading in"), std::string::npos) << e.text();
}

// The controller slows the base, solves for the joints again, and slows these too.
TEST(ExplainRobot, LimitsOfTheBaseAndOfTheJointsAreOneShare) {
  Robot robot = testing_support::mobile_arm(icat::Base<double>::surface());
  const auto hand = robot.frame("end_effector");
  task::FramePosition<Robot> tool(
      robot, hand, icat::detail::origin(robot.pose(hand)) + Vector3d(1, 1, 0), {.name = "tool"});
  task::FramePose<Robot> travel(robot, robot.base(), moved(robot.pose(robot.base()), 1, 1, 0),
                                {.name = "travel"});
  Controller controller(robot, {{"go", {{travel}, {tool}}}},
                        {.limits = {robot,
                                    {.max_acceleration = 0.5,
                                     .base_velocity = {0.1, 0.1, 0.1},
                                     .base_acceleration = {5, 5, 5}}}});
  ASSERT_EQ(controller.start("go", 0), Status::ok);
  for (int i = 0; i < 5; ++i) ASSERT_EQ(controller.step(0.01 * i), Status::ok);
  const auto e = icat::explain(controller);
  for (const auto& t : e.tasks()) EXPECT_NEAR(sum(t), t.loss, 1e-9) << e.text();
  const Explanation& base = find(e, "travel");
  ASSERT_EQ(base.most()->cause, LossCause::limit) << e.text();
  EXPECT_NEAR(part(base, LossCause::limit), 1, 1e-9) << e.text();
  EXPECT_EQ(base.most()->column, robot.base_columns().first) << e.text();
  EXPECT_EQ(base.most()->limit, LimitKind::velocity) << e.text();
  EXPECT_GT(part(find(e, "tool"), LossCause::limit), 0.99) << e.text();
  EXPECT_FALSE(e.alarm());
}

// --- sums ----------------------------------------------------------------------------------------

/// Columns and nothing else.
template <class S, int N>
struct Columns {
  using Scalar = S;
  static constexpr int size = N;
  icat::Index n;
  icat::Index dof() const { return n; }
};
template <class R>
class Random : public icat::Task<R> {
 public:
  Random(const R& robot, const RandomLevel& level, int number)
      : icat::Task<R>(robot, "task " + std::to_string(number), level.J.rows()), level_(level) {
    // Some in metres, some not.
    this->set_length_power(0, level.J.rows() / 2, 1);
  }

 private:
  void compute() noexcept override {
    using S = typename R::Scalar;
    for (icat::Index i = 0; i < this->rows(); ++i) {
      for (icat::Index j = 0; j < level_.J.cols(); ++j) {
        this->jacobian_(i, j) = static_cast<S>(level_.J(i, j));
      }
      this->reference_(i) = static_cast<S>(level_.reference(i));
      this->activation_(i) = static_cast<S>(level_.a(i));
    }
  }
  RandomLevel level_;
};

/// Random hierarchies with given columns, bounds and equals, each in a transition: sums within
/// `tolerance`, rates as in the controller's report, and the recalculated answer its own.
template <class R>
void expect_sums(unsigned seed, double tolerance, int least, int most) {
  SCOPED_TRACE(seed);
  using S = typename R::Scalar;
  using C = icat::Controller<R>;
  HierarchyGenerator gen(seed);
  const RandomHierarchy h = gen.hierarchy(least, most);
  R robot{h.dof};
  std::vector<std::unique_ptr<Random<R>>> tasks;
  icat::Action<R> all{"all", {}}, some{"some", {}};
  for (const auto& level : h.levels) {
    tasks.push_back(std::make_unique<Random<R>>(robot, level, static_cast<int>(tasks.size())));
    if (tasks.size() > 1 && gen.integer(0, 3) == 0) {
      all.levels.back().push_back(*tasks.back());
    } else {
      all.levels.push_back({*tasks.back()});
    }
  }
  some.levels.push_back(all.levels.back());
  typename C::Options options{.limits = icat::unlimited, .characteristic_length = S(0.7)};
  const bool bounded = gen.integer(0, 1) == 1;
  if (bounded) {
    options.solver.bounds.lower = C::Velocity::Constant(h.dof, S(-0.5));
    options.solver.bounds.upper = C::Velocity::Constant(h.dof, S(0.5));
    options.solver.saturation = icat::Saturation(gen.integer(0, 2));
  }
  C controller(robot, {all, some}, options);
  typename C::Velocity measured = C::Velocity::Zero(h.dof);
  for (icat::Index c = 0; c < h.dof; ++c) {
    measured(c) = static_cast<S>(h.rho0(c));
    ASSERT_EQ(controller.set_given(c, h.Q0(c, c) == 0), Status::ok);
  }
  ASSERT_EQ(controller.start("all", 0), Status::ok);
  for (int step = 0; step < 2; ++step) {
    if (step == 1) {
      ASSERT_EQ(controller.switch_to("some", 0, 0.3), Status::ok);
    }
    ASSERT_EQ(controller.step(0.1 * step, measured), Status::ok);
    icat::Explainer<C> e(controller);
    for (const auto& t : e.tasks()) {
      ASSERT_NEAR(double(sum(t)), double(t.loss), tolerance * std::max(1.0, double(t.loss)));
      ASSERT_LE(t.shares.size(), controller.hierarchy().size() + 14);
      for (const auto& share : t.shares) {
        // Nothing limits, ramps or holds: what was solved again is what was commanded.
        ASSERT_TRUE(share.cause < LossCause::held || std::abs(share.amount) < S(tolerance))
            << describe(share.cause) << " " << share.amount;
        if (share.cause == LossCause::level) {
          ASSERT_LT(share.level, t.level);
          ASSERT_GT(share.activation, 0);
        }
      }
    }
    ASSERT_FALSE(e.text().empty());
  }
}

TEST(ExplainSums, SharesAddUpToTheLoss) {
  // Of up to 12 levels.
  for (unsigned seed = 0; seed < 60; ++seed) {
    expect_sums<Columns<double, Eigen::Dynamic>>(seed, 1e-9, 4, 20);
  }
  // Of static size, in single precision: 0.02 is 2e5 of its roundings, 1e-9 is 4e6 of double's.
  for (unsigned seed = 0; seed < 20; ++seed) expect_sums<Columns<float, 9>>(seed, 0.02, 9, 9);
}

TEST(ExplainSums, TheLossIsTheSolversOwn) {
  const Robot robot = maris_arm();
  const auto hand = robot.frame("end_effector");
  task::JointLimits<Robot> limits(robot, {.margin = 1.0});
  task::FramePosition<Robot> tool(robot, hand, Vector3d(0.3, 0.2, -0.1), {.name = "tool"});
  Controller controller(robot, {{"reach", {{limits}, {tool}}}}, {.limits = icat::unlimited});
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  ASSERT_EQ(controller.step(0), Status::ok);
  const auto e = icat::explain(controller);
  // The last level, all active: what comes below moves nothing of it.
  const auto& level = controller.report().levels()[1];
  EXPECT_NEAR(find(e, "tool").wanted, level.requested_rate, 1e-12);
  EXPECT_NEAR(find(e, "tool").achieved, level.achieved_rate, 1e-9);
  EXPECT_NEAR(find(e, "tool").loss, level.tracking_error, 1e-9);
}

// --- its cost ------------------------------------------------------------------------------------

TEST_F(Explain, AllocatesNothingInTheLoop) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  Controller controller(robot, reach);
  ASSERT_EQ(controller.set_given("joint4", true), Status::ok);
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  icat::Explainer<Controller> e(controller);
  Status status = Status::ok;
  EXPECT_EQ(count_allocations([&] {
              for (int i = 0; i < 20; ++i) {
                status = controller.step(0.01 * std::min(i, 5));
                e.update();
                (void)e.alarm();
              }
            }),
            0);
  EXPECT_EQ(status, Status::clock_stalled);
}

TEST_F(Explain, RefusesBadOptions) {
  Controller controller(robot, reach);
  using E = icat::Explainer<Controller>;
  EXPECT_EQ(message_of([&] { E(controller, {.negligible = 0}); }),
            "Explainer: negligible must be finite and > 0, got 0");
  EXPECT_EQ(message_of([&] { E(controller, {.tolerated = -1}); }),
            "Explainer: tolerated must be finite and > 0, got -1");
  EXPECT_EQ(message_of([&] { E(controller, {.blocked = NAN}); }),
            "Explainer: blocked must be finite and > 0, got nan");
}

// Two causes may be large and of opposite sign.
TEST(ExplainWords, PerCentHaveNoExponent) {
  icat::LossShare<double> share;
  share.cause = LossCause::below;
  for (const auto& [amount, says] :
       {std::pair(2.376, "2376 %"), {-0.291, "-291 %"}, {0.0, "(0 %"}, {-1e-6, "(0 %"}}) {
    icat::detail::Words out;
    share.amount = amount;
    icat::detail::append_share(out, share, 0.1, "");
    EXPECT_NE(out.text.find(says), std::string::npos) << out.text;
  }
}

// --- docs/explain.md -----------------------------------------------------------------------------

/// What is printed stands on the page, word for word.
void expect_on_page(const std::string& text) {
  std::cout << text << "\n";
  const std::string here = __FILE__;
  std::ifstream file(here.substr(0, here.rfind("tests")) + "docs/explain.md");
  std::stringstream page;
  page << file.rdbuf();
  EXPECT_NE(page.str().find("```\n" + text + "```\n"), std::string::npos);
}

TEST(ExplainDocs, ThePageShowsWhatIsPrinted) {
  Robot robot = maris_arm();
  //! [tasks]
  task::JointLimits<Robot> limits(robot, {.margin = 0.2});
  task::FramePosition<Robot> tool(robot, robot.frame("end_effector"), {0.7, -0.8, -0.6},
                                  {.name = "tool", .gain = 0.5});
  icat::Controller<Robot> controller(robot, {{"reach", {{limits}, {tool}}}});
  //! [tasks]
  ASSERT_EQ(controller.start("reach", 0), Status::ok);
  const auto run = [&](double from, double to) {
    for (double t = from; t < to; t += 0.01) {
      ASSERT_EQ(controller.step(t), Status::ok);
      ASSERT_EQ(drive(robot, controller.velocity(), 0.01), Status::ok);
    }
  };
  run(0, 20);
  //! [text]
  const std::string text = icat::explain(controller).text();
  //! [text]
  expect_on_page(text);

  // On the way to another shape a motor dies.
  Eigen::VectorXd goal = testing_support::bent_arm();
  ASSERT_EQ(robot.update(goal), Status::ok);
  goal(3) += 0.4;
  goal(1) += 0.2;
  task::JointPosition<Robot> shape(robot, goal, {.name = "shape", .gain = 0.5});
  icat::Controller<Robot> loop(robot, {{"fold", {{limits}, {shape}}}});
  std::string blame;
  //! [loop]
  icat::Explainer<icat::Controller<Robot>> why(loop);  // reserves its memory
  ASSERT_EQ(loop.start("fold", 0), Status::ok);
  ASSERT_EQ(loop.set_given("joint4", true), Status::ok);  // its motor failed
  ASSERT_EQ(loop.step(0), Status::ok);
  why.update();  // no allocation, no exception
  for (const auto& t : why.tasks()) {
    if (t.alarm && t.most() && t.most()->cause == icat::LossCause::given) {
      blame = why.column_name(t.most()->column);
    }
  }
  //! [loop]
  EXPECT_EQ(blame, "joint4");
  expect_on_page(why.text());
  for (int i = 0; i < 100; ++i) (void)loop.step(0);
  why.update();
  expect_on_page(why.text());
}

/// Not a test: `--gtest_also_run_disabled_tests --gtest_filter=*Cost` prints the table of the page.
TEST(ExplainDocs, DISABLED_Cost) {
  Robot robot = maris_arm();
  task::JointLimits<Robot> limits(robot, {.margin = 1.5});
  task::FramePosition<Robot> tool(robot, robot.frame("end_effector"), {0.7, -0.8, -0.6});
  std::vector<std::unique_ptr<task::Minimality<Robot>>> more;
  std::cout << "| active levels | step, µs | update, µs |\n|---|---|---|\n";
  for (const std::size_t levels : {2u, 4u, 7u}) {
    icat::Action<Robot> action{"reach", {{limits}, {tool}}};
    for (icat::Index c = 0; action.levels.size() < levels; ++c) {
      more.push_back(std::make_unique<task::Minimality<Robot>>(robot, icat::Columns{c}));
      action.levels.push_back({*more.back()});
    }
    Controller controller(robot, {action});
    ASSERT_EQ(controller.start("reach", 0), Status::ok);
    icat::Explainer<Controller> e(controller);
    double best[2] = {1, 1}, time = 0;
    for (int run = 0; run < 50; ++run) {
      for (int what = 0; what < 2; ++what) {
        const auto begin = std::chrono::steady_clock::now();
        for (int i = 0; i < 20; ++i) {
          if (what == 0) (void)controller.step(time += 0.001);
          if (what == 1) e.update();
        }
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
        best[what] = std::min(best[what], took.count() / 20);
      }
    }
    std::cout << "| " << levels << " | " << best[0] * 1e6 << " | " << best[1] * 1e6 << " |\n";
  }
}

}  // namespace
