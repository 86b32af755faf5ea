// SPDX-License-Identifier: BSD-3-Clause
// Every task of the catalogue: Jacobian against central differences at random and awkward states,
// no jump of a reference, activations and references by the formulas.
#include <gtest/gtest.h>

#include <functional>
#include <icat/math/numerical_differentiation.hpp>
#include <icat/task/camera_tasks.hpp>
#include <icat/task/function_task.hpp>
#include <icat/task/joint_tasks.hpp>
#include <icat/task/pose_tasks.hpp>
#include <icat/task/vehicle_tasks.hpp>
#include <memory>

#include "support/sanitized.hpp"
#include "support/states.hpp"

namespace {

using Robot = testing_support::Robot<double>;
using State = testing_support::State<double>;
using Objective = icat::Objective<double>;
using Task = icat::Task<Robot>;
using Y = icat::Vector<double, 13>;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using icat::Vector3;
namespace task = icat::task;
constexpr double pi = std::numbers::pi;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

const Vector3<double> target(1.0, -0.5, 2.5);
constexpr double gain = 2;

struct Case {
  const char* name;
  std::function<std::unique_ptr<Task>(const Robot&)> make;
};

template <class T, class O>
std::unique_ptr<Task> make(const Robot& robot, O options) {
  return std::make_unique<T>(robot, options);
}

icat::Vector<double, 7> preferred() {
  icat::Vector<double, 7> q;
  q << 0.3, -0.7, 0.2, -1.3, 0.4, 0.6, 0.1;
  return q;
}

// Tasks whose reference is γ (x* − x), so that −∂(reference)/∂c / γ is the Jacobian.
std::vector<Case> scalar_cases() {
  using PoseOptions = task::PoseTaskOptions<double>;
  const auto goal = testing_support::make_pose<double>(0.3, 0.2, 1, 0.1, 0.2, 0.3);
  const task::PoseNorms<double> norms{Objective::at_most(0.2, 0.1), Objective::at_most(0.1, 0.05)};
  return {
      {"JointLimits",
       [](const Robot& r) {
         return make<task::JointLimits<Robot>>(r, task::JointLimits<Robot>::Options{.gain = gain});
       }},
      {"Manipulability",
       [](const Robot& r) {
         return make<task::Manipulability<Robot>>(
             r,
             task::Manipulability<Robot>::Options{.minimum = 0.05, .margin = 0.05, .gain = gain});
       }},
      {"PreferredShape",
       [](const Robot& r) {
         return make<task::PreferredShape<Robot>>(
             r, task::PreferredShape<Robot>::Options{.shape = preferred(), .gain = gain});
       }},
      {"PreferredShapeNorm",
       [](const Robot& r) {
         return make<task::PreferredShape<Robot>>(
             r, task::PreferredShape<Robot>::Options{
                    .shape = preferred(), .norm = Objective::at_most(0.5, 0.2), .gain = gain});
       }},
      {"CameraOcclusion",
       [](const Robot& r) {
         return make<task::CameraOcclusion<Robot>>(
             r, task::CameraOcclusion<Robot>::Options{
                    .elbow_joint = 3, .minimum_angle = 0.3, .margin = 0.1, .gain = gain});
       }},
      {"CameraCenteringNorm",
       [](const Robot& r) {
         return make<task::CameraCentering<Robot>>(
             r, task::CameraCentering<Robot>::Options{
                    .target = target, .norm = Objective::at_most(0.3, 0.1), .gain = gain});
       }},
      {"CameraCentering",
       [](const Robot& r) {
         return make<task::CameraCentering<Robot>>(
             r, task::CameraCentering<Robot>::Options{.target = target, .gain = gain});
       }},
      {"HorizontalAttitudeNorm",
       [](const Robot& r) {
         return make<task::HorizontalAttitude<Robot>>(
             r, task::HorizontalAttitude<Robot>::Options{.norm = Objective::at_most(0.3, 0.1),
                                                         .gain = gain});
       }},
      {"HorizontalAttitude",
       [](const Robot& r) {
         return make<task::HorizontalAttitude<Robot>>(
             r, task::HorizontalAttitude<Robot>::Options{.gain = gain});
       }},
      {"VehicleDistance",
       [](const Robot& r) {
         return make<task::VehicleDistance<Robot>>(
             r, task::VehicleDistance<Robot>::Options{
                    .other = {0.3, 0.2, 1}, .minimum = 1, .margin = 0.2, .gain = gain});
       }},
      {"ToolPoseNorm",
       [=](const Robot& r) {
         return make<task::ToolPose<Robot>>(
             r, PoseOptions{.goal = goal, .norms = norms, .gain = gain});
       }},
      {"ToolPositionNorm",
       [=](const Robot& r) {
         return make<task::ToolPosition<Robot>>(
             r, PoseOptions{.goal = goal, .norms = norms, .gain = gain});
       }},
      {"ToolOrientationNorm",
       [=](const Robot& r) {
         return make<task::ToolOrientation<Robot>>(
             r, PoseOptions{.goal = goal, .norms = norms, .gain = gain});
       }},
      {"VehiclePoseNorm",
       [=](const Robot& r) {
         return make<task::VehiclePose<Robot>>(
             r, PoseOptions{.goal = goal, .norms = norms, .gain = gain});
       }},
      {"FunctionTask", [](const Robot& r) {
         using F = task::FunctionTask<Robot>;
         return make<F>(r,
                        F::Options{.name = "depth and x",
                                   .rows = 2,
                                   .evaluate =
                                       [](const Robot& robot, F::Rows& x, F::Jacobian& J) {
                                         x(0) = robot.vehicle().translation().z();
                                         x(1) = robot.vehicle().translation().x();
                                         J.row(0).segment<3>(7) = robot.vehicle().linear().row(2);
                                         J.row(1).segment<3>(7) = robot.vehicle().linear().row(0);
                                       },
                                   .objective = Objective::between(0, 3, 0.5),
                                   .gain = gain});
       }}};
}

class ScalarTasks : public testing::TestWithParam<Case> {};

TEST_P(ScalarTasks, JacobianEqualsCentralDifferences) {
  Robot robot = testing_support::make_robot<double>();
  const auto task = GetParam().make(robot);
  auto states = testing_support::all_states<double>(60, 11);
  // The camera exactly on, exactly off, and exactly opposite to the target; the vehicle at the
  // other vehicle and at its goal; the preferred shape.
  const icat::Pose<double> v_c = robot.description().camera;
  for (const auto& [name, angle] :
       {std::pair{"aligned", 0.0}, {"across", pi / 2}, {"opposite", pi}}) {
    icat::Pose<double> camera = testing_support::make_pose<double>(1, -0.5, 1.5, angle, 0, 0);
    states.push_back({name, preferred(), camera * v_c.inverse()});
  }
  for (auto& s : states) {
    SCOPED_TRACE(s.name);
    testing_support::displace(robot, s, Y(Y::Zero()));
    task->update(robot);
    const MatrixXd J = task->jacobian();
    ASSERT_TRUE(J.allFinite());
    ASSERT_TRUE(task->reference().allFinite());
    ASSERT_TRUE((task->activation().array() >= 0).all() && (task->activation().array() <= 1).all());
    const auto numeric = icat::central_difference(
        [&](const Y& y) {
          testing_support::displace(robot, s, y);
          task->update(robot);
          return VectorXd(task->reference() / -gain);
        },
        Y(Y::Zero()));
    // At a kink the difference, of step 6e-6, leaves a term of first order.
    EXPECT_LT((J - numeric).norm(), 1e-5 * (1 + J.norm()));
  }
}

INSTANTIATE_TEST_SUITE_P(Catalogue, ScalarTasks, testing::ValuesIn(scalar_cases()),
                         [](const auto& test) { return test.param.name; });

// Tasks whose ẋ is the velocity of a frame.
struct FrameCase {
  const char* name;
  bool tool, linear, angular;
};
class FrameTasks : public testing::TestWithParam<FrameCase> {};

std::unique_ptr<Task> make_frame_task(const FrameCase& c, const Robot& robot,
                                      const icat::Pose<double>& goal) {
  const task::PoseTaskOptions<double> options{.goal = goal, .gain = gain};
  if (!c.tool) return make<task::VehiclePose<Robot>>(robot, options);
  if (!c.angular) return make<task::ToolPosition<Robot>>(robot, options);
  if (!c.linear) return make<task::ToolOrientation<Robot>>(robot, options);
  return make<task::ToolPose<Robot>>(robot, options);
}

TEST_P(FrameTasks, JacobianEqualsCentralDifferencesAndReferenceIsTheError) {
  const FrameCase c = GetParam();
  Robot robot = testing_support::make_robot<double>();
  for (const auto& s : testing_support::all_states<double>(60, 12)) {
    SCOPED_TRACE(s.name);
    testing_support::displace(robot, s, Y(Y::Zero()));
    const icat::Pose<double> frame = c.tool ? robot.tool() : robot.vehicle();
    // Zero error, a general one, and half a turn.
    for (const auto& error : {testing_support::make_pose<double>(0, 0, 0, 0, 0, 0),
                              testing_support::make_pose<double>(0.4, -1, 0.3, 0.5, -0.4, 1),
                              testing_support::make_pose<double>(0, 0, 0, pi, 0, 0)}) {
      const icat::Pose<double> goal = frame * error;
      const auto task = make_frame_task(c, robot, goal);
      task->update(robot);
      const auto numeric = icat::central_difference(
          [&](const Y& y) {
            auto moved = robot;
            testing_support::displace(moved, s, y);
            return testing_support::difference<double>(frame,
                                                       c.tool ? moved.tool() : moved.vehicle());
          },
          Y(Y::Zero()));
      icat::Vector6<double> expected;
      expected << goal.translation() - frame.translation(),
          icat::orientation_error<double>(frame.linear(), goal.linear());
      const int first = c.linear ? 0 : 3, rows = 3 * (c.linear + c.angular);
      ASSERT_EQ(task->rows(), rows);
      EXPECT_LT((task->jacobian() - numeric.middleRows(first, rows)).norm(), 1e-7);
      EXPECT_LT((task->reference() - gain * expected.segment(first, rows)).norm(), 1e-12);
      EXPECT_EQ(task->activation(), VectorXd::Ones(rows));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Catalogue, FrameTasks,
                         testing::Values(FrameCase{"ToolPose", true, true, true},
                                         FrameCase{"ToolPosition", true, true, false},
                                         FrameCase{"ToolOrientation", true, false, true},
                                         FrameCase{"VehiclePose", false, true, true}),
                         [](const auto& test) { return test.param.name; });

// --- no jump -------------------------------------------------------------------------------------

// The vehicle turns about an axis through its whole turn, past error 0 and past π, in 20,000 steps;
// reference, and the row that goes into the solver, a² Jᵀ ẋ̄, move by O(step).
TEST(NoJump, ReferencesThroughZeroAndHalfATurn) {
  std::vector<Case> cases = scalar_cases();
  const auto goal = testing_support::make_pose<double>(0, 0, 0, 0, 0, 0);
  for (const FrameCase& c :
       {FrameCase{"ToolPose", true, true, true}, FrameCase{"ToolOrientation", true, false, true},
        FrameCase{"VehiclePose", false, true, true}}) {
    cases.push_back({c.name, [=](const Robot& r) { return make_frame_task(c, r, goal); }});
  }
  for (const Case& c : cases) {
    SCOPED_TRACE(c.name);
    Robot robot = testing_support::make_robot<double>();
    const auto task = c.make(robot);
    constexpr int steps = sanitized ? 2'000 : 20'000;
    for (const double offset : {0.0, 1e-7, 1e-3}) {
      VectorXd last_reference, last_push;
      double reference_step = 0, push_step = 0;
      for (int i = 0; i <= steps; ++i) {
        const double angle = 2 * pi * i / steps;
        // Turns about the tool's x axis when the tool is judged, about the vehicle's otherwise.
        const State s{"", preferred(),
                      testing_support::make_pose<double>(0.3, 0.2, 1, angle, offset, 0)};
        testing_support::displace(robot, s, Y(Y::Zero()));
        task->update(robot);
        const VectorXd push = task->jacobian().transpose() *
                              task->activation().cwiseAbs2().cwiseProduct(task->reference());
        if (i > 0) {
          reference_step = std::max(reference_step, (task->reference() - last_reference).norm());
          push_step = std::max(push_step, (push - last_push).norm());
        }
        last_reference = task->reference();
        last_push = push;
      }
      // A fade over 0.1 rad of a rate γ π at |J| of order 2: some hundreds per rad.
      EXPECT_LT(reference_step * steps, 2500);
      EXPECT_LT(push_step * steps, 10'000);
    }
  }
}

// The arm swings through the optical axis, the vehicle flies through the other vehicle and its
// goal.
TEST(NoJump, ReferencesThroughTheKinksOfPositions) {
  Robot robot = testing_support::make_robot<double>();
  const auto sweep = [&](Task& t, const std::function<State(double)>& at, bool push_too) {
    constexpr int steps = sanitized ? 2'000 : 20'000;
    VectorXd last_reference, last_push;
    double reference_step = 0, push_step = 0, most_active = 0;
    for (int i = 0; i <= steps; ++i) {
      testing_support::displace(robot, at(2.0 * i / steps - 1), Y(Y::Zero()));
      t.update(robot);
      const VectorXd push =
          t.jacobian().transpose() * t.activation().cwiseAbs2().cwiseProduct(t.reference());
      most_active = std::max(most_active, t.activation().maxCoeff());
      if (i > 0) {
        reference_step = std::max(reference_step, (t.reference() - last_reference).norm());
        push_step = std::max(push_step, (push - last_push).norm());
      }
      last_reference = t.reference();
      last_push = push;
    }
    EXPECT_LT(reference_step * steps, 100) << t.name();
    if (push_too) {
      EXPECT_LT(push_step * steps, 1000) << t.name();
    }
    EXPECT_GT(most_active, 0.9) << t.name();
  };

  // A camera that looks along the first joint's swing, the elbow on its axis in the middle.
  Robot::Description d = robot.description();
  const Vector3<double> elbow =
      d.arm_mount * Vector3<double>(d.arm.state(preferred()).points.col(3));
  d.camera.translation() = elbow - d.arm_mount.linear() * Vector3<double>(0, 0, 0.5);
  d.camera.linear() = d.arm_mount.linear();
  robot = Robot(d);
  task::CameraOcclusion<Robot> occlusion(
      robot, {.elbow_joint = 3, .minimum_angle = 0.3, .margin = 0.1, .gain = gain});
  sweep(
      occlusion,
      [](double u) {
        icat::Vector<double, 7> q = preferred();
        q(1) += 0.8 * u;
        return State{"", q, icat::Pose<double>::Identity()};
      },
      true);

  const auto fly = [](double u) {
    return State{"", preferred(), testing_support::make_pose<double>(u, 0, 0, 0, 0, 0)};
  };
  task::VehicleDistance<Robot> distance(
      robot, {.other = {0, 0, 0}, .minimum = 0.8, .margin = 0.1, .gain = gain});
  sweep(distance, fly, true);
  task::VehiclePose<Robot> vehicle(
      robot,
      {.norms = task::PoseNorms<double>{Objective::at_most(0.2, 0.1), Objective::at_most(0.2, 0.1)},
       .gain = gain});
  sweep(vehicle, fly, true);

  // Joints from limit to limit; μ has a kink where the arm is singular, its rate has not.
  const auto bend = [](double u) {
    icat::Vector<double, 7> q = preferred();
    q(3) = -1.47 + 1.48 * u;
    return State{"", q, icat::Pose<double>::Identity()};
  };
  task::JointLimits<Robot> limits(robot, {.gain = gain});
  sweep(limits, bend, true);
  task::Manipulability<Robot> mu(robot, {.minimum = 0.05, .margin = 0.05, .gain = gain});
  sweep(mu, bend, false);
  task::PreferredShape<Robot> shape(
      robot, {.shape = preferred(), .norm = Objective::at_most(0.5, 0.2), .gain = gain});
  sweep(shape, bend, true);
}

// --- objectives ----------------------------------------------------------------------------------

TEST(Objectives, ActivationsFollowTheFormulas) {
  const auto at_most = Objective::at_most(0.1, 0.05);  // [Coop, Fig. 2]
  EXPECT_EQ(at_most.activation(0.2), 1);
  EXPECT_EQ(at_most.activation(0.1), 1);
  EXPECT_EQ(at_most.activation(0.05), 0);
  EXPECT_EQ(at_most.activation(-3), 0);
  EXPECT_NEAR(at_most.activation(0.075), 0.5, 1e-12);
  EXPECT_EQ(at_most.target(), 0.05);
  EXPECT_TRUE(at_most.satisfied(0.1));
  EXPECT_FALSE(at_most.satisfied(0.11));
  const auto at_least = Objective::at_least(0.02, 0.01);  // [MARIS, Eq. (16)]
  EXPECT_EQ(at_least.activation(0.01), 1);
  EXPECT_NEAR(at_least.activation(0.025), 0.5, 1e-12);
  EXPECT_EQ(at_least.activation(0.031), 0);
  EXPECT_NEAR(at_least.target(), 0.03, 1e-15);
  const auto between = Objective::between(-1, 3, 0.5);
  EXPECT_EQ(between.activation(1), 0);
  EXPECT_EQ(between.activation(-1.2), 1);
  EXPECT_EQ(between.activation(3), 1);
  EXPECT_NEAR(between.activation(2.75), 0.5, 1e-12);
  EXPECT_EQ(between.target(), 1);
  const auto equal = Objective::equal_to(2);
  EXPECT_EQ(equal.activation(123), 1);
  EXPECT_EQ(equal.target(), 2);
  EXPECT_EQ(between.toward(0).target(), 0);
  EXPECT_TRUE(std::isnan(at_most.activation(nan)));
  const auto free = Objective::between(-INFINITY, INFINITY, 1);
  EXPECT_EQ(free.activation(1e300), 0);
  EXPECT_TRUE(std::isfinite(free.target()));
}

template <class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "no exception";
}

TEST(TaskErrors, ConfigurationThrowsWithNamesAndNumbers) {
  const Robot robot = testing_support::make_robot<double>();
  EXPECT_EQ(message_of([&] { task::ToolPose<Robot>(robot, {.gain = -0.5}); }),
            "task 'tool pose': gain must be > 0, got -0.5");
  EXPECT_EQ(message_of([&] { task::ToolPose<Robot>(robot, {.max_linear_rate = 0}); }),
            "task 'tool pose': max_linear_rate must be > 0, got 0");
  EXPECT_EQ(message_of([&] { task::JointLimits<Robot>(robot, {.name = "arm", .gain = nan}); }),
            "task 'arm': gain must be > 0, got nan");
  EXPECT_EQ(message_of([&] { task::JointLimits<Robot>(robot, {.margin = 2}); }),
            "Objective: no room between minimum -1.6 and maximum 1.65 for two margins of 2");
  EXPECT_EQ(message_of([&] { Objective::at_most(1, 0); }),
            "Objective: margin must be finite and > 0, got 0");
  EXPECT_EQ(message_of([&] { Objective::at_most(nan, 1); }).substr(0, 20), "Objective: no room b");
  EXPECT_EQ(message_of([&] { Objective::equal_to(nan); }),
            "Objective: value must be finite, got nan");
  EXPECT_EQ(message_of([&] { Objective::at_most(1, 0.5).toward(2); }),
            "Objective: reference point 2 is outside [-inf, 1]");
  EXPECT_EQ(message_of([&] {
              task::CameraOcclusion<Robot>(robot,
                                           {.elbow_joint = 7, .minimum_angle = 1, .margin = 0.1});
            }),
            "task 'camera occlusion': elbow_joint must be in [0, 6], got 7");
  EXPECT_EQ(message_of([&] {
              task::FunctionTask<Robot>(
                  robot, {.name = "f", .evaluate = {}, .objective = Objective::equal_to(0)});
            }),
            "task 'f': evaluate is empty");
  EXPECT_EQ(
      message_of([&] {
        task::VehicleDistance<Robot>(robot, {.other = {nan, 0, 0}, .minimum = 1, .margin = 1});
      }),
      "task 'vehicle distance': the other vehicle's position is not finite");
  EXPECT_EQ(message_of([&] {
              task::CameraCentering<Robot>(robot, {.target = {0, nan, 0}});
            }),
            "task 'camera centering': the target is not finite");
  icat::Pose<double> goal = icat::Pose<double>::Identity();
  goal.linear() *= 2;
  EXPECT_EQ(message_of([&] { task::ToolPose<Robot>(robot, {.goal = goal}); }),
            "task 'tool pose': the goal is not finite or not a rotation");
  icat::Vector<double, 7> shape = icat::Vector<double, 7>::Constant(nan);
  EXPECT_EQ(message_of([&] { task::PreferredShape<Robot>(robot, {.shape = shape}); }),
            "task 'preferred shape': the shape is not finite");
}

// --- the rest of the catalogue -------------------------------------------------------------------

TEST(Catalogue, MotionMinimalityAndNonActuatedVelocity) {
  Robot robot = testing_support::make_robot<double>();
  task::ArmMotionMinimality arm(robot);
  task::VehicleMotionMinimality vehicle(robot);
  task::NonActuatedVelocity passive(robot, {true, true, true, false, false, true});
  icat::Vector6<double> v;
  v << 1, 2, 3, 4, 5, 6;
  passive.set_measured(v);
  for (Task* t : std::initializer_list<Task*>{&arm, &vehicle, &passive}) t->update(robot);
  const MatrixXd I = MatrixXd::Identity(13, 13);
  EXPECT_EQ(arm.jacobian(), I.topRows(7));
  EXPECT_EQ(vehicle.jacobian(), I.bottomRows(6));
  EXPECT_EQ(passive.jacobian(), I.bottomRows(6));
  EXPECT_EQ(arm.reference(), VectorXd::Zero(7));
  EXPECT_EQ(vehicle.reference(), VectorXd::Zero(6));
  EXPECT_EQ(passive.reference(), v);
  EXPECT_EQ(passive.activation(), (VectorXd(6) << 0, 0, 0, 1, 1, 0).finished());
}

TEST(Catalogue, RatesAreLimitedAsAWhole) {
  Robot robot = testing_support::make_robot<double>();
  icat::Pose<double> goal = robot.tool();
  goal.translation() += Vector3<double>(3, 4, 0);
  task::ToolPose tool(robot, {.goal = goal, .gain = 1, .max_linear_rate = 0.5});
  tool.update(robot);
  EXPECT_LT((tool.reference().head<3>() - Vector3<double>(0.3, 0.4, 0)).norm(), 1e-12);
  task::VehicleDistance distance(
      robot, {.other = {0.5, 0, 0}, .minimum = 2, .margin = 0.5, .max_rate = 0.2});
  distance.update(robot);
  EXPECT_EQ(distance.reference()(0), 0.2);
  EXPECT_EQ(distance.activation()(0), 1);
}

TEST(Catalogue, UndefinedDirectionsAreZeroNotNan) {
  Robot robot = testing_support::make_robot<double>();
  task::CameraCentering centering(robot, {.target = robot.camera().translation()});
  centering.update(robot);
  EXPECT_EQ(centering.activation(), VectorXd::Zero(2));
  EXPECT_TRUE(centering.jacobian().allFinite());
  task::VehicleDistance distance(
      robot, {.other = robot.vehicle().translation(), .minimum = 1, .margin = 0.5});
  distance.update(robot);
  EXPECT_EQ(distance.jacobian().norm(), 0);
  EXPECT_EQ(distance.reference()(0), 1.5);
}

TEST(Catalogue, WorksInSinglePrecision) {
  auto robot = testing_support::make_robot<float>();
  using FloatRobot = testing_support::Robot<float>;
  task::JointLimits limits(robot, {.margin = 0.1f});
  task::Manipulability mu(robot, {.minimum = 0.02f, .margin = 0.01f});
  task::CameraCentering centering(robot, {.target = {1, 2, 3}});
  task::HorizontalAttitude attitude(robot);
  task::ToolPose tool(robot, {.gain = 0.5f});
  for (const auto& s : testing_support::all_states<float>(10, 1)) {
    ASSERT_EQ(robot.update(s.q, s.vehicle), icat::Status::ok);
    for (icat::Task<FloatRobot>* t : std::initializer_list<icat::Task<FloatRobot>*>{
             &limits, &mu, &centering, &attitude, &tool}) {
      t->update(robot);
      EXPECT_TRUE(t->jacobian().allFinite() && t->reference().allFinite()) << t->name() << s.name;
    }
  }
}

}  // namespace
