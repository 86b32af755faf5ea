// SPDX-License-Identifier: BSD-3-Clause
// Tasks, controllers and agents as members of classes, initialised from bare braces, see
// test_member_initialisers.cpp.
#include <gtest/gtest.h>

#include <icat/icat.hpp>

namespace {

namespace task = icat::task;
using icat::Status;

template <class S>
class MemberTasks : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(MemberTasks, Scalars);

template <class S>
icat::KinematicTree<S, 13> make_robot() {
  auto description = typename icat::KinematicTree<S, 13>::Description{
      .joints = icat::axes_chain(icat::maris_arm<S>(), "vehicle"),
      .base = icat::Base<S>::free(),
      .masses = {{"vehicle", 100, {0, 0, 0}}, {"link4", 3, {0, 0, 0}}}};
  return icat::KinematicTree<S, 13>(description);
}

// All settings of the catalogue.
template <class S>
struct Settings {
  using R = icat::KinematicTree<S, 13>;
  icat::Axes axes{.z = false};
  icat::ColumnRange range{.first = 7, .count = 6};
  icat::Columns columns{range};
  icat::PerJoint<S> per_joint{S(0.1)};
  icat::PoseNorms<S> norms{.position = icat::Objective<S>::at_most(S(0.2), S(0.1)),
                           .orientation = icat::Objective<S>::at_most(S(0.1), S(0.05))};
  typename task::FramePose<R>::Options pose{.name = "pose", .gain = 2};
  typename task::FramePosition<R>::Options position{.axes = {.z = false}};
  typename task::FrameOrientation<R>::Options orientation{.on = icat::On::frame};
  typename task::FrameVelocity<R>::Options velocity{.angular = icat::no_axes};
  typename task::JointLimits<R>::Options limits{.joints = {"joint1"}, .margin = S(0.2)};
  typename task::JointPosition<R>::Options shape{.max_rate = {S(0.1)}};
  typename task::Attitude<R>::Options attitude{.axis = {1, 0, 0}};
  typename task::LookAt<R>::Options look{.max_rate = S(0.3)};
  typename task::Occlusion<R>::Options occlusion{.gain = 2};
  typename task::FrameDistance<R>::Options distance{.gain = 2};
  typename task::CenterOfMass<R>::Options center{.axes = {.z = false}};
  typename task::Manipulability<R>::Options dexterous{.joints = {"joint1", "joint2"}};
  typename task::FunctionTask<R>::Options own{.rows = 2};
  typename icat::Tpik<S, 13>::Options solver{.projection_weight = 10};
  typename icat::Controller<R>::Options controller{.given = icat::ColumnRange{10, 2}};
  typename icat::ParallelController<R>::Options parallel{.solver = {}};
  icat::AgreementOptions<S> agreement{.index = 1};
  typename icat::Agent<R>::Options agent{.compensation = true, .agreement = {.hold = 2}};
};

// A user's program.
template <class S>
struct Program {
  using Robot = icat::KinematicTree<S, 13>;
  using Objective = icat::Objective<S>;
  using Vector3 = icat::Vector3<S>;

  Robot robot{make_robot<S>()};
  icat::FrameId hand{robot.frame("end_effector")}, elbow{robot.frame(icat::maris_elbow)};
  icat::Pose<S> goal = icat::IdentityPose{};

  task::FramePose<Robot> reach{robot, robot.frame("end_effector"), goal, {.gain = S(0.5)}};
  task::FramePose<Robot> coarse{robot,
                                hand,
                                goal,
                                {.name = "coarse",
                                 .relative_to = robot.base(),
                                 .norms = {{.position = Objective::at_most(S(0.2), S(0.1)),
                                            .orientation = Objective::at_most(S(0.1), S(0.05))}},
                                 .max_linear_rate = S(0.2)}};
  task::FramePose<Robot> plain{robot, hand, icat::IdentityPose{}};
  task::FramePosition<Robot> position{
      robot, hand, {1, 2, 3}, {.axes = {.x = false}, .on = icat::On::frame}};
  task::FrameOrientation<Robot> orientation{
      robot, hand, icat::Matrix3<S>::Identity(), {.norm = Objective::at_most(S(0.1), S(0.05))}};
  task::FrameVelocity<Robot> jog{robot, hand, {.angular = icat::no_axes}};
  task::JointLimits<Robot> limits{robot, {.margin = S(0.2), .max_rate = S(0.5)}};
  task::JointLimits<Robot> some{robot,
                                {.joints = {"joint1", "joint2"}, .margin = {S(0.2), S(0.3)}}};
  task::JointPosition<Robot> shape{
      robot, icat::Vector<S, 7>::Zero(), {.norm = Objective::at_most(S(0.3), S(0.1))}};
  task::Attitude<Robot> attitude{robot, robot.base(), {.norm = Objective::at_most(S(0.2), S(0.1))}};
  task::LookAt<Robot> look{robot, hand, Vector3(1, 2, 3), {.gain = 2}};
  task::LookAt<Robot> look_at_elbow{robot, robot.base(), elbow};
  task::Occlusion<Robot> occlusion{
      robot, robot.base(), elbow, Objective::at_least(S(0.3), S(0.1)), {.gain = 2}};
  task::FrameDistance<Robot> distance{
      robot, hand, Vector3(1, 2, 3), Objective::at_least(1, S(0.1)), {.max_rate = S(0.2)}};
  task::CenterOfMass<Robot> center{robot, {0, 0, 1}, {.axes = {.z = false}}};
  task::Manipulability<Robot> dexterous{
      robot, hand, Objective::at_least(S(0.05), S(0.01)), {.gain = S(0.2)}};
  task::Minimality<Robot> still{robot, robot.base_columns()};
  task::Minimality<Robot> still_arm{robot, icat::joint_columns(robot, {"joint1"}), "still arm"};
  task::GivenVelocity<Robot> given{robot, icat::ColumnRange{10, 2}};
  task::FunctionTask<Robot> own{robot,
                                Objective::equal_to(1),
                                [](const Robot& r, auto x, auto J) {
                                  x(0) = r.position(0);
                                  J(0, 0) = 1;
                                },
                                {.name = "own"}};

  std::vector<icat::Action<Robot>> actions{{"reach", {{limits}, {reach}}},
                                           {"all",
                                            {{limits, some},
                                             {attitude, dexterous, distance, occlusion},
                                             {look, look_at_elbow, center, own, given},
                                             {coarse, plain, position, orientation, jog},
                                             {shape, still, still_arm}}}};
  icat::Controller<Robot> controller{robot,
                                     {{"reach", {{limits}, {reach}}}},
                                     {.given = icat::ColumnRange{10, 2},
                                      .solver = {.bounds = {icat::Vector<S, 13>::Constant(-1),
                                                            icat::Vector<S, 13>::Constant(1)}}}};
  icat::Controller<Robot> defaults{robot, {{"reach", {{limits}, {reach}}}}};
  icat::Controller<Robot> dead_joint{
      robot, {{"reach", {{reach}}}}, {.given = icat::joint_columns(robot, {"joint3"})}};
  icat::ParallelController<Robot> parallel{robot, actions, {.solver = {.projection_weight = 2}}};
  icat::ParallelController<Robot> parallel_defaults{robot, actions};
  icat::Agent<Robot> agent{robot,
                           {{"reach", {{limits}, {reach}}}},
                           {{"reach", reach}},
                           {.controller = {.given = icat::ColumnRange{10, 2}},
                            .compensation = true,
                            .agreement = {.index = 1, .fallback = icat::Fallback::alone},
                            .filter = S(0.2)}};
  icat::Agent<Robot> alone{robot, {{"reach", {{reach}}}}, {{"reach", reach}}, {}};
  icat::CentralizedController<Robot> central{
      {{robot, hand, {{"reach", {{reach}}}}}, {robot, hand, {{"reach", {{plain}}}}}}, {}};
  icat::CentralizedController<Robot> bounded{
      {{robot, hand, {{"reach", {{reach}}}}}, {robot, hand, {{"reach", {{plain}}}}}},
      {.bounds = {icat::Vector<S, 13>::Constant(-1), icat::Vector<S, 13>::Constant(1)}}};
};

// With a constructor of its own, within another class, and as a base.
template <class S>
class Mission : private Settings<S> {
 public:
  Mission() {}
  const Settings<S>& settings() const { return *this; }
  Program<S>& program() { return program_; }

 private:
  Program<S> program_{};
};

// Not a template: there the compiler resolves defaults at another time.
struct Arm {
  using Robot = icat::KinematicTree<double, 7>;
  Robot robot{{.joints = icat::axes_chain(icat::maris_arm<double>())}};
  icat::Pose<double> goal = robot.pose(robot.frame("end_effector"));
  task::JointLimits<Robot> limits{robot, {.margin = 0.05}};
  task::FramePose<Robot> reach{robot, robot.frame("end_effector"), goal, {.gain = 0.5}};
  icat::Controller<Robot> controller{
      robot, {{"reach", {{limits}, {reach}}}}, {.given = icat::joint_columns(robot, {"joint2"})}};
  icat::Agent<Robot> agent{
      robot, {{"reach", {{limits}, {reach}}}}, {{"reach", reach}}, {.agreement = {.hold = 2}}};
};

TYPED_TEST(MemberTasks, AreWhatTheBracesSay) {
  using S = TypeParam;
  Mission<S> mission;
  const Settings<S>& settings = mission.settings();
  EXPECT_FALSE(settings.pose.relative_to);
  EXPECT_FALSE(settings.pose.norms);
  EXPECT_EQ(settings.pose.max_linear_rate, icat::infinity<S>);
  EXPECT_EQ(settings.pose.gain, 2);
  EXPECT_EQ(settings.position.axes.count(), 2);
  EXPECT_EQ(settings.limits.joints.size(), 1u);
  EXPECT_EQ(settings.shape.max_rate[5], S(0.1));
  EXPECT_EQ(settings.controller.given.size(), 2);
  EXPECT_EQ(settings.parallel.given.size(), 0);
  EXPECT_EQ(settings.agreement.agents, 2u);
  EXPECT_EQ(settings.agent.controller.given.size(), 0);
  EXPECT_EQ(settings.agent.filter, 0);

  Program<S>& program = mission.program();
  EXPECT_EQ(program.reach.gain(), S(0.5));
  EXPECT_EQ(program.coarse.rows(), 2);
  EXPECT_EQ(program.position.rows(), 2);
  EXPECT_EQ(program.some.rows(), 2);
  EXPECT_EQ(program.own.name(), "own");
  EXPECT_TRUE(program.controller.given(11));
  EXPECT_TRUE(program.dead_joint.given(2));
  EXPECT_FALSE(program.defaults.given(2));
  EXPECT_TRUE(program.agent.second().given(10));
  EXPECT_EQ(program.agent.agreement().options().index, 1u);
  for (auto* controller : {&program.controller, &program.defaults, &program.dead_joint}) {
    ASSERT_EQ(controller->start("reach", 0), Status::ok);
    EXPECT_EQ(controller->step(0, icat::Vector<S, 13>::Zero()), Status::ok);
    EXPECT_GT(controller->velocity().norm(), 0);
  }
  for (auto* controller : {&program.parallel, &program.parallel_defaults}) {
    ASSERT_EQ(controller->start("all", 0), Status::ok);
    EXPECT_EQ(controller->step(0, icat::Vector6<S>::Zero()), Status::ok);
  }
  for (auto* agent : {&program.agent, &program.alone}) {
    ASSERT_EQ(agent->start("reach", 0), Status::ok);
    EXPECT_EQ(agent->propose(0, icat::Vector<S, 13>::Zero()), Status::ok);
    EXPECT_EQ(agent->step(0, icat::Vector<S, 13>::Zero()), Status::ok);
  }
  for (auto* central : {&program.central, &program.bounded}) {
    ASSERT_EQ(central->start("reach", 0), Status::ok);
    EXPECT_EQ(central->step(0, 1), Status::ok);
  }
}

TEST(MemberTasks, OutsideOfTemplates) {
  Arm arm;
  ASSERT_EQ(arm.controller.start("reach", 0), Status::ok);
  EXPECT_EQ(arm.controller.step(0), Status::ok);
  EXPECT_TRUE(arm.controller.given(1));
  ASSERT_EQ(arm.agent.start("reach", 0), Status::ok);
  EXPECT_EQ(arm.agent.propose(0), Status::ok);
}

}  // namespace
