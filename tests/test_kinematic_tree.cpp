// SPDX-License-Identifier: BSD-3-Clause
// The serial chain, the MARIS arm and the vehicle-manipulator.
#include <gtest/gtest.h>

#include <icat/math/numerical_differentiation.hpp>

#include "support/states.hpp"

namespace {

using testing_support::all_states;
using testing_support::State;

template <class S>
class Models : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Models, Scalars);

// Central differences: truncation h² and rounding ε/h, both ε^{2/3} at the default step, times the
// derivatives' size.
template <class S>
const S difference_tolerance = S(30) * std::pow(std::numeric_limits<S>::epsilon(), S(2) / S(3));

TYPED_TEST(Models, MarisArmHasThePublishedJacobian) {
  using S = TypeParam;
  const auto arm = icat::maris_arm<S>();
  const auto J = arm.jacobian(icat::Vector<S, 7>::Zero());
  const double linear[7][3] = {{0, -0.1455, 0}, {0.9835, 0, 0.1455}, {0, -0.1455, 0}, {0.552, 0, 0},
                               {0, 0, 0},       {0.132, 0, 0},       {0, 0, 0}};
  for (int j = 0; j < 7; ++j) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(J(i, j), linear[j][i], 1e-6) << i << ' ' << j;
    EXPECT_EQ(J(j % 2 ? 4 : 5, j), S(1));
  }
  EXPECT_NEAR(arm.pose(icat::Vector<S, 7>::Zero()).translation().z(), 1.2665, 1e-6);
  EXPECT_EQ(arm.lower_limits()(3), S(-2.95));
  EXPECT_EQ(arm.upper_limits()(3), S(0.01));
}

TYPED_TEST(Models, ArmJacobianEqualsCentralDifferences) {
  using S = TypeParam;
  const auto arm = icat::maris_arm<S>();
  for (const auto& state : all_states<S>(50, 1)) {
    SCOPED_TRACE(state.name);
    const icat::Pose<S> at = arm.pose(state.q);
    const auto numeric = icat::central_difference(
        [&](const auto& q) { return testing_support::difference<S>(at, arm.pose(q)); }, state.q);
    EXPECT_LT((arm.jacobian(state.q) - numeric).norm(), difference_tolerance<S>);
    const auto s = arm.state(state.q);
    const auto elbow = icat::central_difference(
        [&](const auto& q) { return icat::Vector3<S>(arm.state(q).points.col(3)); }, state.q);
    EXPECT_LT((arm.point_jacobian(s, 3) - elbow).norm(), difference_tolerance<S>);
  }
}

TYPED_TEST(Models, ManipulabilityGradientEqualsCentralDifferences) {
  using S = TypeParam;
  const auto arm = icat::maris_arm<S>();
  for (const auto& state : all_states<S>(100, 2)) {
    SCOPED_TRACE(state.name);
    const auto m = arm.manipulability(state.q);
    const auto J = arm.jacobian(state.q);
    const Eigen::Matrix<double, 6, 7> Jd = J.template cast<double>();
    EXPECT_NEAR(m.value, std::sqrt(std::max(0.0, (Jd * Jd.transpose()).determinant())),
                sizeof(S) == 4 ? 1e-6 : 1e-9);
    const auto numeric = icat::central_difference(
        [&](const auto& q) { return icat::Vector<S, 1>(arm.manipulability(q).value); }, state.q);
    // At the kink the central difference averages both sides, and so does the gradient.
    EXPECT_LT((m.gradient - numeric).norm(), difference_tolerance<S>);
  }
}

// The formula of [MARIS], μ tr(∂J/∂q_i J^#), where it can be evaluated.
TYPED_TEST(Models, ManipulabilityGradientEqualsTheTraceFormula) {
  if constexpr (std::is_same_v<TypeParam, double>) {
    const auto arm = icat::maris_arm<double>();
    for (const auto& state : testing_support::random_states<double>(20, 3)) {
      const auto J = arm.jacobian(state.q);
      const Eigen::Matrix<double, 7, 6> pinv = J.transpose() * (J * J.transpose()).inverse();
      const auto m = arm.manipulability(state.q);
      for (int i = 0; i < 7; ++i) {
        icat::Vector<double, 7> plus = state.q, minus = state.q;
        plus(i) += 1e-6;
        minus(i) -= 1e-6;
        const Eigen::Matrix<double, 6, 7> dJ = (arm.jacobian(plus) - arm.jacobian(minus)) / 2e-6;
        EXPECT_NEAR(m.gradient(i), m.value * (dJ * pinv).trace(), 1e-8);
      }
    }
  }
}

TYPED_TEST(Models, ArmsWithPrismaticJointsAndFewJoints) {
  using S = TypeParam;
  using V = icat::Vector3<S>;
  using J = icat::Joint<S>;
  icat::Pose<S> tip = icat::Pose<S>::Identity();
  tip.translation() = V(S(0.3), S(0.1), S(0.5));
  const icat::SerialChain<S, 4> arm(
      {J{icat::JointType::revolute, V::UnitZ(), V::Zero(), -1, 1},
       J{icat::JointType::prismatic, V(S(0.6), 0, S(0.8)), V::Zero(), -1, 1},
       J{icat::JointType::revolute, V::UnitY(), V(S(0.2), 0, S(0.2)), -1, 1},
       J{icat::JointType::prismatic, V::UnitX(), V::Zero(), -1, 1}},
      tip);
  for (int i = 0; i < 20; ++i) {
    const icat::Vector<S, 4> q = icat::Vector<S, 4>::Random();
    const icat::Pose<S> at = arm.pose(q);
    const auto numeric = icat::central_difference(
        [&](const auto& x) { return testing_support::difference<S>(at, arm.pose(x)); }, q);
    EXPECT_LT((arm.jacobian(q) - numeric).norm(), difference_tolerance<S>);
    const auto gradient = icat::central_difference(
        [&](const auto& x) { return icat::Vector<S, 1>(arm.manipulability(x).value); }, q);
    EXPECT_LT((arm.manipulability(q).gradient - gradient).norm(), difference_tolerance<S>);
    const Eigen::Matrix<double, 6, 4> jacobian = arm.jacobian(q).template cast<double>();
    EXPECT_NEAR(arm.manipulability(q).value,
                std::sqrt((jacobian.transpose() * jacobian).determinant()), 1e-5);
  }
}

TYPED_TEST(Models, ToolJacobianEqualsCentralDifferencesInEveryFrame) {
  using S = TypeParam;
  auto robot = testing_support::make_robot<S>();
  using Y = icat::Vector<S, 13>;
  for (const auto& state : all_states<S>(50, 4)) {
    SCOPED_TRACE(state.name);
    testing_support::displace(robot, state, Y(Y::Zero()));
    const icat::Pose<S> at = robot.tool();
    const auto numeric = icat::central_difference(
        [&](const Y& y) {
          auto moved = robot;
          testing_support::displace(moved, state, y);
          return testing_support::difference<S>(at, moved.tool());
        },
        Y(Y::Zero()));
    const auto on = [&](const icat::Matrix3<S>& rotation) {
      Eigen::Matrix<S, 6, 13> m = numeric;
      m.template topRows<3>() = (rotation.transpose() * m.template topRows<3>()).eval();
      m.template bottomRows<3>() = (rotation.transpose() * m.template bottomRows<3>()).eval();
      return m;
    };
    const S tolerance = difference_tolerance<S> * 2;
    EXPECT_LT((robot.tool_jacobian(icat::Frame::world) - numeric).norm(), tolerance);
    EXPECT_LT((robot.tool_jacobian(icat::Frame::vehicle) - on(robot.vehicle().linear())).norm(),
              tolerance);
    EXPECT_LT((robot.tool_jacobian(icat::Frame::tool) - on(robot.tool().linear())).norm(),
              tolerance);
  }
}

TYPED_TEST(Models, BadStatesAreRefused) {
  using S = TypeParam;
  auto robot = testing_support::make_robot<S>();
  const auto good = testing_support::random_states<S>(1, 5)[0];
  ASSERT_EQ(robot.update(good.q, good.vehicle), icat::Status::ok);
  const icat::Pose<S> tool = robot.tool();
  auto q = good.q;
  q(2) = std::numeric_limits<S>::quiet_NaN();
  EXPECT_EQ(robot.update(q, good.vehicle), icat::Status::non_finite);
  auto vehicle = good.vehicle;
  vehicle.translation().x() = std::numeric_limits<S>::infinity();
  EXPECT_EQ(robot.update(good.q, vehicle), icat::Status::non_finite);
  vehicle = good.vehicle;
  vehicle.linear() *= S(2);
  EXPECT_EQ(robot.update(good.q, vehicle), icat::Status::not_a_rotation);
  vehicle = good.vehicle;
  vehicle.linear().col(0) *= S(-1);
  EXPECT_EQ(robot.update(good.q, vehicle), icat::Status::not_a_rotation);
  EXPECT_EQ(robot.tool().matrix(), tool.matrix());
  EXPECT_EQ(robot.q(), good.q);
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

TEST(ModelErrors, ConfigurationThrowsWithNamesAndNumbers) {
  using Chain = icat::SerialChain<double, 1>;
  using J = icat::Joint<double>;
  const auto I = icat::Pose<double>::Identity();
  EXPECT_EQ(message_of([&] {
              Chain({J{.axis = {0, 0, 2}}}, I);
            }),
            "SerialChain: axis of joint 0 must have length 1, got 2");
  EXPECT_EQ(message_of([&] { Chain({J{.lower = 1, .upper = -1}}, I); }),
            "SerialChain: limits of joint 0 must be in order, got [1, -1]");
  EXPECT_EQ(message_of([&] {
              Chain({J{.point = {0, NAN, 0}}}, I);
            }),
            "SerialChain: point of joint 0 is not finite");
  auto bad = I;
  bad.translation().x() = NAN;
  EXPECT_EQ(message_of([&] { Chain({J{}}, bad); }),
            "SerialChain: the end-effector's pose is not finite or not a rotation");
  EXPECT_EQ(
      message_of([&] { icat::Uvms<double, 7>({.arm = icat::maris_arm<double>(), .camera = bad}); }),
      "Uvms: the pose of the camera is not finite or not a rotation");
}

static_assert(icat::VehicleManipulator<icat::Uvms<double, 7>>);
static_assert(icat::Robot<icat::Uvms<float, 4>>);
static_assert(!icat::Robot<icat::SerialChain<double, 7>>);
static_assert(!icat::VehicleManipulator<int>);

}  // namespace
