// SPDX-License-Identifier: BSD-3-Clause
// The planar dual-arm vehicle of [NSB]: its tasks, its simulation, and iCAT beside it.
#include <gtest/gtest.h>

#include <Eigen/QR>
#include <icat/math/numerical_differentiation.hpp>
#include <random>

#include "../examples/03_nsb_dual_arm/mission.hpp"
#include "support/sanitized.hpp"

namespace {

using namespace nsb;
using icat::Status;

std::vector<State> random_states(int count) {
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> u(-3, 3);
  std::vector<State> states;
  while (static_cast<int>(states.size()) < count) {
    State s;
    for (auto* v : {&s.vehicle, &s.q1}) *v << u(rng), u(rng), u(rng);
    s.q2 << u(rng), u(rng);
    states.push_back(s);
  }
  return states;
}

/// The Jacobian of `task` over ẏ, by central differences.
template <class Task>
auto numerical(const State& s, Task task) {
  return icat::central_difference(
      [&](const Velocity& y) { return Eigen::VectorXd(task(moved(s, y, 1)).value); },
      Velocity(Velocity::Zero()));
}

TEST(NsbDualArm, JacobiansAreRight) {
  const Dimensions d;
  for (const State& s : random_states(200)) {
    const auto check = [&](const char* name, auto task) {
      EXPECT_LT((task(s).jacobian - numerical(s, task)).cwiseAbs().maxCoeff(), 1e-8) << name;
    };
    check("tool pose", [&](const State& x) { return tool_pose(d, x); });
    check("vehicle orientation", [&](const State& x) { return vehicle_orientation(x); });
    check("vertical distance", [&](const State& x) { return vertical_distance(d, x); });
    check("first joint", [&](const State& x) { return first_joint(x); });
    // Away from its singularity and from end effectors that touch.
    const FieldOfView view = field_of_view(d, s);
    const double range = (arm1_points(d, s.q1).col(3) - arm2_points(d, s.q2).col(2)).norm();
    if (view.value(0) > 0.01 && range > 0.1) {
      check("field of view", [&](const State& x) -> TaskValue<1> { return field_of_view(d, x); });
    }
  }
}

// Eq. (2): both end effectors where Fig. 1 has them.
TEST(NsbDualArm, KinematicsOfTheFigure) {
  const Dimensions d;
  State s;
  s.vehicle << 1, 2, 90 * degree;
  s.q1 << 90 * degree, -90 * degree, 0;
  s.q2 << 0, 90 * degree;
  // In ⟨b⟩: up by a link, then two to the right; one to the right, then up.
  EXPECT_LT((arm1_points(d, s.q1).col(3) - Vector2(-0.6 + 0.8, 0.25 + 0.4)).norm(), 1e-12);
  EXPECT_LT((arm2_points(d, s.q2).col(2) - Vector2(0.6 + 0.5, 0.25 + 0.4)).norm(), 1e-12);
  EXPECT_LT((tool_pose(d, s).value - Vector3(1 - 0.65, 2 + 0.2, 90 * degree)).norm(), 1e-12);
  EXPECT_NEAR(vertical_distance(d, s).value(0), 0.2, 1e-12);
}

Eigen::Matrix3d cross(const Vector3& v) {
  return (Eigen::Matrix3d() << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0).finished();
}

// Eq. (22) as printed, in ⟨b⟩, with the Moore-Penrose inverse of the cross-product matrix.
TEST(NsbDualArm, FieldOfViewIsTheEquation) {
  const Dimensions d;
  for (const State& s : random_states(100)) {
    const double q21 = s.q2(0), q22 = s.q2(1), l21 = d.arm2(0), l22 = d.arm2(1);
    const Vector2 ee2 = arm2_points(d, s.q2).col(2);
    Vector3 p_e = Vector3::Zero();
    p_e.head<2>() = arm1_points(d, s.q1).col(3) - ee2;
    const Vector3 a_des = p_e.normalized(), a(std::cos(q21 + q22), std::sin(q21 + q22), 0);
    Eigen::Matrix<double, 3, 2> J_p = Eigen::Matrix<double, 3, 2>::Zero(), J_o = J_p;  // Eq. (23)
    J_p << -l21 * std::sin(q21) - l22 * std::sin(q21 + q22), -l22 * std::sin(q21 + q22),
        l21 * std::cos(q21) + l22 * std::cos(q21 + q22), l22 * std::cos(q21 + q22), 0, 0;
    J_o.row(2).setOnes();
    const Eigen::Matrix3d S_p_inverse =
        cross(p_e).completeOrthogonalDecomposition().pseudoInverse();
    const Vector3 e = a_des - a;
    if (e.norm() < field_of_view_epsilon) continue;
    const Eigen::RowVector2d expected =
        e.transpose() / e.norm() * (-cross(a_des) * S_p_inverse * J_p + cross(a) * J_o);
    const FieldOfView view = field_of_view(d, s);
    EXPECT_NEAR(view.value(0), e.norm(), 1e-12);
    EXPECT_LT((view.jacobian.tail<2>() - expected).norm(), 1e-9);
    EXPECT_EQ(view.weight, 1);
  }
}

// [NSB, Remark 2]: through a = a_des, exactly there too, with a lower task that pushes.
TEST(NsbDualArm, NoJumpWhereTheFieldOfViewIsSingular) {
  Dimensions d;
  d.arm1 << 2, 1, 0.5;  // all stretched: end effector 1 straight ahead of end effector 2
  const double step = field_of_view_epsilon / 100;
  icat::NullSpaceGuidance<double, 2> solver;
  Eigen::RowVector2d last_J;
  Vector2 last_velocity;
  bool exact = false, inside = false, left = false, right = false;
  for (int i = -300; i <= 300; ++i) {
    State s;
    s.q2(1) = i * step;
    const FieldOfView view = field_of_view(d, s);
    const Eigen::RowVector2d J = view.jacobian.tail<2>();
    solver.reset();
    ASSERT_EQ(solver.add_task(J, icat::Vector<double, 1>(-view.weight * view.value(0))),
              Status::ok);
    ASSERT_EQ(solver.add_task(first_joint(s).jacobian.tail<2>(), icat::Vector<double, 1>(1.0)),
              Status::ok);
    const Vector2 velocity = solver.velocity();
    ASSERT_TRUE(J.allFinite() && velocity.allFinite());
    exact |= view.value(0) == 0;
    inside |= view.value(0) > 0 && view.value(0) < field_of_view_epsilon;
    left |= J(1) < -0.5;
    right |= J(1) > 0.5;
    if (i > -300) {
      EXPECT_LT((J - last_J).norm(), 0.05) << i;
      EXPECT_LT((velocity - last_velocity).norm(), 10 * step) << i;
    }
    last_J = J;
    last_velocity = velocity;
  }
  EXPECT_TRUE(exact && inside && left && right);
  EXPECT_LT(field_of_view(d, State{}).jacobian.norm(), 1e-8);
}

Scenario shortened(Scenario s) {
  if (sanitized) s.length /= 6;
  return s;
}

void expect_within_bounds(const Result& r) {
  ASSERT_EQ(r.status, Status::ok);
  EXPECT_TRUE((r.peak.array() <= velocity_limits().array()).all()) << r.peak.transpose();
}

TEST(NsbDualArm, AllErrorsConvergeInTheOrderOfPriority) {
  const Scenario scenario;
  const Result r = run_nsb(shortened(scenario));
  expect_within_bounds(r);
  EXPECT_EQ(r.peak(2), 3 * degree);  // the bound on r is reached
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_GT(r.samples.front().task_error[k], 100 * tolerance) << k;
    EXPECT_LT(r.converged[k], 10) << k;  // and stays: that is what `converged` means
    EXPECT_LT(r.line_error[k], tolerance) << k;
    EXPECT_LT(r.last_error[k], 1e-6) << k;
  }
  EXPECT_LE(r.converged[0], r.converged[1]);
  EXPECT_LE(r.converged[1], r.converged[2]);
  EXPECT_LE(r.converged[3], r.converged[4]);
  // The scenario of the paper: a straight line at constant speed, its normal, the distance.
  const Line line = scenario.line();
  for (const auto& s : r.samples) {
    if (s.t < 10 || s.t > shortened(scenario).line().duration()) continue;
    const Vector3 tool = tool_pose(scenario.dimensions, s.state).value;
    EXPECT_LT((tool.head<2>() - line.start - scenario.speed * s.t * line.direction()).norm(), 1e-3);
    EXPECT_NEAR(tool.z(), scenario.slope + 90 * degree, 1e-3);
    EXPECT_NEAR(vertical_distance(scenario.dimensions, s.state).value(0),
                0.5 / 2 + 2.0 / 3 * (0.4 + 0.4 + 0.4), 1e-3);
  }
}

// Eq. (35).
TEST(NsbDualArm, Gains) {
  const Scenario scenario;
  const Tasks k(scenario.dimensions, scenario.start, scenario.line(), scenario.vertical(), 1e9);
  icat::Vector<double, 7> gains;
  gains << 1, 1, 1, 3, 2, 1, 3;
  EXPECT_LT((k.rate - gains.cwiseProduct(k.error)).norm(), 1e-12);
}

TEST(NsbDualArm, TheFollowerNeverMovesTheVehicle) {
  Scenario scenario = shortened({});
  scenario.length /= 10;
  const Result r = run_nsb(scenario);
  scenario.start.q2 << -2, 1;
  scenario.dimensions.arm2 << 0.3, 0.9;
  const Result other = run_nsb(scenario);
  ASSERT_EQ(r.samples.size(), other.samples.size());
  EXPECT_GT((r.samples[500].state.q2 - other.samples[500].state.q2).norm(), 0.1);
  for (std::size_t i = 0; i < r.samples.size(); ++i) {
    ASSERT_EQ(r.samples[i].state.vehicle, other.samples[i].state.vehicle);
    ASSERT_EQ(r.samples[i].state.q1, other.samples[i].state.q1);
    ASSERT_EQ(r.samples[i].velocity.head<6>(), other.samples[i].velocity.head<6>());
  }
}

TEST(NsbDualArm, ConflictDegradesLowerTasksOnly) {
  const Result r = run_nsb(shortened(conflict()));
  expect_within_bounds(r);
  for (const std::size_t k : {0u, 1u, 3u, 4u}) EXPECT_LT(r.converged[k], 12) << k;
  EXPECT_LT(r.line_error[0], 1e-5);
  EXPECT_LT(r.last_error[0], 1e-6);
  EXPECT_LT(r.last_error[1], 1e-3);
  // What is missing of the reach: 1.1 arms, less links 1 and 2 upright and link 3 on the normal.
  const double missing = 1.1 * 1.2 - 0.8 - 0.4 * std::cos(15 * degree);
  EXPECT_NEAR(r.last_error[2], missing, sanitized ? 0.05 : 1e-3);
}

// The price of the projection: what the tool's motion does to a lower task is not taken out of it.
TEST(NsbDualArm, LowerErrorsOnTheLineAreProportionalToTheSpeed) {
  if (sanitized) GTEST_SKIP();
  Scenario scenario;
  const Result slow = run_nsb(scenario);
  scenario.speed *= 5;
  const Result fast = run_nsb(scenario);
  EXPECT_LT(fast.line_error[0], 1e-5);
  EXPECT_NEAR(fast.line_error[1] / slow.line_error[1], 5, 0.5);
  EXPECT_LT(run_icat(scenario).line_error[1], 1e-6);
}

TEST(NsbDualArm, WholeBodyDoesTheSameAndKeepsTheLimits) {
  const Result r = run_icat(shortened({}));
  expect_within_bounds(r);
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_LT(r.converged[k], 10) << k;
    EXPECT_LT(r.line_error[k], 1e-4) << k;
  }
}

TEST(NsbDualArm, WhereTheLineLeadsAnArmToItsLimit) {
  if (sanitized) GTEST_SKIP();
  Scenario scenario = joint_limit();
  const Result icat = run_icat(scenario), past = run_nsb(scenario);
  scenario.stops = true;
  const Result stopped = run_nsb(scenario);
  for (const Result* r : {&icat, &past, &stopped}) expect_within_bounds(*r);
  EXPECT_LE(icat.past_limit, 0);
  for (std::size_t k = 0; k < 5; ++k) EXPECT_LT(icat.line_error[k], tolerance) << k;
  EXPECT_GT(past.past_limit, 20 * degree);
  EXPECT_LE(stopped.past_limit, 0);
  EXPECT_GT(stopped.line_error[0], 10 * tolerance);  // the first task pays for it
}

}  // namespace
