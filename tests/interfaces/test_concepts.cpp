// SPDX-License-Identifier: BSD-3-Clause
// The concepts of robots ask for all that is called, and for no more: the least type that satisfies
// each runs every task and controller, and a type that lacks one thing does not satisfy it.
#include <gtest/gtest.h>

#include <icat/icat.hpp>
#include <memory>

#include "support/archetypes.hpp"
#include "support/trees.hpp"

namespace {

using icat::FramedRobot;
using icat::JointedRobot;
using icat::MassiveRobot;
using icat::MobileRobot;
using icat::Status;
namespace task = icat::task;

// --- what satisfies each -------------------------------------------------------------------------

template <class S, int N>
constexpr bool archetypes_are_least() {
  using namespace archetypes;
  static_assert(icat::Robot<Bare<S, N>>);
  static_assert(FramedRobot<Framed<S, N>>);
  static_assert(JointedRobot<Jointed<S, N>>);
  static_assert(MobileRobot<Mobile<S, N>>);
  static_assert(MassiveRobot<Massive<S, N>>);
  // And nothing besides.
  static_assert(!FramedRobot<Bare<S, N>> && !JointedRobot<Bare<S, N>> && !MassiveRobot<Bare<S, N>>);
  static_assert(!JointedRobot<Framed<S, N>> && !MobileRobot<Framed<S, N>> &&
                !MassiveRobot<Framed<S, N>>);
  static_assert(!FramedRobot<Jointed<S, N>> && !FramedRobot<Massive<S, N>>);
  static_assert(!JointedRobot<Mobile<S, N>>);
  static_assert(!std::is_copy_constructible_v<Mobile<S, N>>);
  return true;
}
static_assert(archetypes_are_least<double, 3>() && archetypes_are_least<double, Eigen::Dynamic>() &&
              archetypes_are_least<float, 3>() && archetypes_are_least<float, Eigen::Dynamic>());

template <class Tree>
constexpr bool tree_is_everything =
    FramedRobot<Tree>&& JointedRobot<Tree>&& MobileRobot<Tree>&& MassiveRobot<Tree>;
static_assert(tree_is_everything<icat::KinematicTree<double>> &&
              tree_is_everything<icat::KinematicTree<float, 4>>);

// --- what must not -------------------------------------------------------------------------------

using B = archetypes::Bare<double, 3>;
using F = archetypes::Framed<double, 3>;
using J = archetypes::Jointed<double, 3>;
using M = archetypes::Mobile<double, 3>;
using C = archetypes::Massive<double, 3>;

static_assert(!icat::Robot<int>);
static_assert(!icat::Robot<icat::SerialArm<double, 7>>);
struct NoScalar {
  enum : int { size = 3 };
  int dof() const;
};
static_assert(!icat::Robot<NoScalar>);
struct IntegerScalar : B {
  using Scalar = int;
};
static_assert(!icat::Robot<IntegerScalar>);
struct NoSize {
  using Scalar = double;
  int dof() const;
};
static_assert(!icat::Robot<NoSize>);
struct SizeAtRunTime : B {
  inline static int size = 3;
};
static_assert(!icat::Robot<SizeAtRunTime>);
struct NoDof : B {
  void dof() const = delete;
};
static_assert(!icat::Robot<NoDof>);
struct DofIsNotConst : B {
  int dof();
};
static_assert(!icat::Robot<DofIsNotConst>);

template <class Base>
struct NoFrame : Base {
  void frame(std::string_view) const = delete;
};
template <class Base>
struct FrameIsANumber : Base {
  icat::Index frame(std::string_view) const;
};
template <class Base>
struct NoPose : Base {
  void pose(icat::FrameId) const = delete;
};
template <class Base>
struct PoseOnlyConverts : Base {
  Eigen::Affine3d pose(icat::FrameId) const;
};
template <class Base>
struct PoseInFloat : Base {
  icat::Pose<float> pose(icat::FrameId) const;
};
template <class Base>
struct NoJacobian : Base {
  void jacobian(icat::FrameId) const = delete;
};
template <class Base>
struct JacobianByRows : Base {
  Eigen::Matrix<double, 6, 3, Eigen::RowMajor> jacobian(icat::FrameId) const;
};
template <class Base>
struct JacobianOfAnotherSize : Base {
  Eigen::Matrix<double, 6, Eigen::Dynamic> jacobian(icat::FrameId) const;
};
// A robot with a base is one with frames.
static_assert(!FramedRobot<NoFrame<F>> && !MobileRobot<NoFrame<M>>);
static_assert(!FramedRobot<FrameIsANumber<F>> && !MobileRobot<FrameIsANumber<M>>);
static_assert(!FramedRobot<NoPose<F>> && !MobileRobot<NoPose<M>>);
static_assert(!FramedRobot<PoseOnlyConverts<F>> && !FramedRobot<PoseInFloat<F>>);
static_assert(!FramedRobot<NoJacobian<F>> && !MobileRobot<NoJacobian<M>>);
static_assert(!FramedRobot<JacobianByRows<F>> && !FramedRobot<JacobianOfAnotherSize<F>>);

struct NoJoints : J {
  void joints() const = delete;
};
struct JointsThatVanish : J {
  std::vector<icat::JointInfo<double>> joints() const;
};
struct JointsOfAnotherType : J {
  struct Own {
    std::string name;
    operator const icat::JointInfo<double>&() const;
  };
  const std::vector<Own>& joints() const;
};
struct JointsWithoutAnEnd : J {
  struct List {
    int size() const;
    const icat::JointInfo<double>& operator[](std::size_t) const;
  };
  const List& joints() const;
};
struct JointsWithoutAnIndex : J {
  struct List {
    int size() const;
    const icat::JointInfo<double>*begin() const, *end() const;
  };
  const List& joints() const;
};
struct NoPosition : J {
  void position(icat::Index) const = delete;
};
static_assert(!JointedRobot<NoJoints> && !JointedRobot<JointsThatVanish> &&
              !JointedRobot<JointsOfAnotherType> && !JointedRobot<JointsWithoutAnEnd> &&
              !JointedRobot<JointsWithoutAnIndex> && !JointedRobot<NoPosition>);

struct NoBase : M {
  void base() const = delete;
};
struct BaseIsANumber : M {
  icat::Index base() const;
};
struct NoBaseColumns : M {
  void base_columns() const = delete;
};
struct BaseColumnsAreAPair : M {
  std::pair<icat::Index, icat::Index> base_columns() const;
};
struct NoBaseMotion : M {
  void base_motion() const = delete;
};
struct BaseMotionIsANumber : M {
  double base_motion() const;
};
static_assert(!MobileRobot<NoBase> && !MobileRobot<BaseIsANumber> && !MobileRobot<NoBaseColumns> &&
              !MobileRobot<BaseColumnsAreAPair> && !MobileRobot<NoBaseMotion> &&
              !MobileRobot<BaseMotionIsANumber>);

struct NoCenter : C {
  void center_of_mass() const = delete;
};
struct CenterInThePlane : C {
  Eigen::Vector2d center_of_mass() const;
};
struct NoCenterJacobian : C {
  void center_of_mass_jacobian() const = delete;
};
struct CenterJacobianOfSixRows : C {
  Eigen::Matrix<double, 6, 3> center_of_mass_jacobian() const;
};
static_assert(!MassiveRobot<NoCenter> && !MassiveRobot<CenterInThePlane> &&
              !MassiveRobot<NoCenterJacobian> && !MassiveRobot<CenterJacobianOfSixRows>);

// Where joints have no names there are none to look up.
template <class Controller>
concept TakesJointNames = requires(Controller& c) {
  c.set_given("a", true);
};
static_assert(TakesJointNames<icat::Controller<J>> && !TakesJointNames<icat::Controller<F>>);

// --- they run ------------------------------------------------------------------------------------

template <class K>
class Archetypes : public testing::Test {};
// Each costs twenty seconds of compilation; the other two compile above.
using Kinds =
    testing::Types<testing_support::Kind<float, 3>, testing_support::Kind<double, Eigen::Dynamic>>;
TYPED_TEST_SUITE(Archetypes, Kinds);

template <class S>
using Goal = icat::Objective<S>;

// Two seconds of `controller` on `robot`, whose columns are its state.
template <class R, class Controller>
void run(R& robot, Controller& controller) {
  using S = typename R::Scalar;
  ASSERT_EQ(controller.start("act", 0), Status::ok);
  for (int k = 0; k < 200; ++k) {
    ASSERT_EQ(controller.step(k * 0.01), Status::ok);
    for (std::size_t i = 0; i < 3; ++i) {
      robot.x[i] += S(0.01) * controller.velocity()(static_cast<icat::Index>(i));
    }
  }
}

// A task of the user's own.
template <class R>
class Own : public icat::Task<R> {
 public:
  explicit Own(const R& robot) : icat::Task<R>(robot, "own", 1) {}

 private:
  void compute() noexcept override { this->jacobian_(0, 0) = typename R::Scalar(1); }
};

TYPED_TEST(Archetypes, ARobotRunsTasksOfColumns) {
  using S = typename TypeParam::Scalar;
  using R = archetypes::Bare<S, TypeParam::size>;
  R robot;
  robot.x = {S(0.3), S(0.5), S(-0.2)};
  Own<R> own(robot);
  task::Minimality<R> minimality(robot, icat::ColumnRange{0, 3});
  task::GivenVelocity<R> given(robot, {2});
  task::FunctionTask<R> function(robot, Goal<S>::equal_to(S(2)),
                                 [](const R& r, auto x, auto block) {
                                   x(0) = r.x[1];
                                   block(0, 1) = S(1);
                                 },
                                 {.gain = S(5)});
  icat::Controller<R> controller(robot, {{"act", {{given}, {function}, {own}, {minimality}}}},
                                 {.given = {0}});
  run(robot, controller);
  EXPECT_NEAR(robot.x[1], 2, 1e-3);
  EXPECT_EQ(controller.set_given(0, false), Status::ok);
}

template <class R>
std::vector<std::unique_ptr<icat::Task<R>>> frame_tasks(const R& robot) {
  using S = typename R::Scalar;
  const auto far = Goal<S>::at_least(S(0.1), S(0.05));
  const icat::FrameId tip = robot.frame("tip"), other = icat::FrameId(3);
  const icat::Vector3<S> point(S(0.2), S(1), S(2));
  std::vector<std::unique_ptr<icat::Task<R>>> tasks;
  tasks.push_back(std::make_unique<task::FramePose<R>>(robot, tip, icat::Pose<S>::Identity()));
  tasks.push_back(std::make_unique<task::FramePosition<R>>(robot, tip, point));
  tasks.push_back(
      std::make_unique<task::FrameOrientation<R>>(robot, tip, icat::Matrix3<S>::Identity()));
  tasks.push_back(std::make_unique<task::FrameVelocity<R>>(robot, tip));
  tasks.push_back(std::make_unique<task::Attitude<R>>(robot, tip));
  tasks.push_back(std::make_unique<task::LookAt<R>>(robot, tip, point));
  tasks.push_back(std::make_unique<task::LookAt<R>>(robot, tip, other));
  tasks.push_back(std::make_unique<task::Occlusion<R>>(robot, tip, other, far));
  tasks.push_back(std::make_unique<task::FrameDistance<R>>(robot, tip, point, far));
  tasks.push_back(std::make_unique<task::FrameDistance<R>>(robot, tip, other, far));
  return tasks;
}

template <class R>
icat::Action<R> action_of(const std::vector<std::unique_ptr<icat::Task<R>>>& tasks) {
  icat::Action<R> action{"act", {}};
  for (const auto& t : tasks) action.levels.push_back({*t});
  return action;
}

TYPED_TEST(Archetypes, AFramedRobotRunsTasksOfFrames) {
  using S = typename TypeParam::Scalar;
  using R = archetypes::Framed<S, TypeParam::size>;
  R robot;
  robot.x = {S(0.3), S(0.5), S(-0.2)};
  const auto tasks = frame_tasks(robot);
  icat::Controller<R> controller(robot, {action_of(tasks)});
  run(robot, controller);
  EXPECT_LT(std::abs(robot.x[1]), S(0.5 * 0.2));  // e⁻² of the way is left
}

TYPED_TEST(Archetypes, AFramedRobotHasPoints) {
  using S = typename TypeParam::Scalar;
  archetypes::Framed<S, TypeParam::size> robot;
  robot.x = {S(0.3), S(0.5), S(-0.2)};
  const icat::Vector3<S> point(S(1), S(2), S(3));
  typename archetypes::Massive<S, TypeParam::size>::CenterJacobian jacobian(3, 3);
  EXPECT_EQ(icat::point_position(robot, robot.frame("tip"), point)(0), S(0.3) + S(1));
  EXPECT_EQ(icat::point_jacobian(robot, robot.frame("tip"), point, jacobian), Status::ok);
  EXPECT_EQ(jacobian, jacobian.Identity(3, 3));
}

TYPED_TEST(Archetypes, AFramedRobotCooperates) {
  using S = typename TypeParam::Scalar;
  using R = archetypes::Framed<S, TypeParam::size>;
  R a, b;
  const auto goal = testing_support::make_pose<S>(0.5, 0, 0, 0, 0, 0);
  const icat::FrameId tip = a.frame("tip");
  task::FramePose<R> tool_a(a, tip, goal), tool_b(b, tip, goal);
  icat::Agent<R> agent(a, {{"act", {{tool_a}}}}, {{"act", tool_a}}, {.agreement = {.index = 0}});
  ASSERT_EQ(agent.start("act", 0), Status::ok);
  ASSERT_EQ(agent.propose(0), Status::ok);
  ASSERT_FALSE(agent.send(0).empty());
  ASSERT_EQ(agent.step(0), Status::ok);
  EXPECT_NEAR(agent.own().velocity()(0), 0.5, 1e-6);
  icat::CentralizedController<R> central(
      {{a, tip, {{"act", {{tool_a}}}}}, {b, tip, {{"act", {{tool_b}}}}}}, {});
  ASSERT_EQ(central.start("act", 0), Status::ok);
  ASSERT_EQ(central.step(0, S(1)), Status::ok);
  // Compensation is for robots with a base.
  EXPECT_EQ(testing_support::message_of([&] {
              icat::Agent<R>(a, {{"act", {{tool_a}}}}, {{"act", tool_a}}, {.compensation = true});
            }),
            "Agent: compensation needs a robot with a base");
}

TYPED_TEST(Archetypes, AJointedRobotRunsTasksOfJoints) {
  using S = typename TypeParam::Scalar;
  using R = archetypes::Jointed<S, TypeParam::size>;
  R robot;
  robot.x = {S(1.5), S(0.5), S(-0.2)};
  task::JointLimits<R> limits(robot, {.gain = S(5)});
  task::JointPosition<R> position(robot, icat::Vector3<S>(S(0), S(0.1), S(7)), {.gain = S(5)});
  icat::Controller<R> controller(robot, {{"act", {{limits}, {position}}}});
  run(robot, controller);
  EXPECT_LT(robot.x[0], S(1));
  EXPECT_NEAR(robot.x[2], 7, 1e-2);
  EXPECT_EQ(controller.set_given("b", true), Status::ok);
  EXPECT_EQ(controller.set_given("d", true), Status::unknown_joint);
}

TYPED_TEST(Archetypes, FramesAndJointsMakeManipulability) {
  using S = typename TypeParam::Scalar;
  using R = archetypes::FramedAndJointed<S, TypeParam::size>;
  static_assert(FramedRobot<R> && JointedRobot<R>);
  R robot;
  task::Manipulability<R> mu(robot, robot.frame("tip"), Goal<S>::at_least(S(2), S(0.1)));
  icat::Controller<R> controller(robot, {{"act", {{mu}}}});
  run(robot, controller);
  EXPECT_NEAR(mu.value(), 1, 1e-6);
}

TYPED_TEST(Archetypes, AMobileRobotIsCoordinatedInParallel) {
  using S = typename TypeParam::Scalar;
  using R = archetypes::Mobile<S, TypeParam::size>;
  R robot;
  robot.x = {S(0.3), S(0.5), S(-0.2)};
  const auto tasks = frame_tasks(robot);
  icat::ParallelController<R> controller(robot, {action_of(tasks)});
  ASSERT_EQ(controller.start("act", 0), Status::ok);
  const Eigen::Matrix<S, 2, 1> measured(S(0.1), S(-0.1));
  EXPECT_EQ(controller.step(0, measured), Status::ok);
  EXPECT_TRUE(controller.velocity().allFinite());
  EXPECT_NEAR(controller.command()(2), 0.2, 1e-5);
  EXPECT_EQ(controller.step_joint_law(0), Status::ok);
  EXPECT_EQ(controller.follow_joint_law(0, measured), Status::ok);
  EXPECT_NEAR(controller.command()(2), 0.2, 1e-5);

  task::FramePose<R> tool(robot, robot.frame("tip"), icat::Pose<S>::Identity());
  icat::Agent<R> agent(robot, {{"alone", {{tool}}}, {"act", {{tool}}}}, {{"act", tool}},
                       {.compensation = true});
  ASSERT_EQ(agent.start("alone", 0), Status::ok);
  ASSERT_EQ(agent.propose(0), Status::ok);
  typename icat::Agent<R>::Velocity all = icat::Agent<R>::Velocity::Zero(3);
  all.template head<2>() = measured;
  EXPECT_EQ(agent.step(0), Status::missing_velocity);
  ASSERT_EQ(agent.step(0, all), Status::ok);
  ASSERT_EQ(agent.step_joint_law(0), Status::ok);
  ASSERT_EQ(agent.follow_joint_law(0, all), Status::ok);
  EXPECT_NEAR(agent.velocity()(2), 0.2, 1e-5);
}

TYPED_TEST(Archetypes, AMassiveRobotMovesItsCentreOfMass) {
  using S = typename TypeParam::Scalar;
  using R = archetypes::Massive<S, TypeParam::size>;
  R robot;
  task::CenterOfMass<R> balance(robot, icat::Vector3<S>(S(1), S(2), S(3)), {.gain = S(5)});
  icat::Controller<R> controller(robot, {{"act", {{balance}}}});
  run(robot, controller);
  EXPECT_NEAR(robot.x[2], 3, 1e-3);
}

}  // namespace
