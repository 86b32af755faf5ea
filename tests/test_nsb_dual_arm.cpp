// SPDX-License-Identifier: BSD-3-Clause
// The planar dual-arm vehicle of [NSB]: its tasks, its simulation, and iCAT beside it.
#include <gtest/gtest.h>

#include <Eigen/QR>
#include <random>

#include "../examples/03_nsb_dual_arm/mission.hpp"
#include "support/linear_algebra.hpp"
#include "support/sanitized.hpp"
#include "support/trees.hpp"

namespace {

using namespace nsb;
using icat::Status;
using testing_support::TreeState;
using Vector2 = icat::Vector<double, 2>;

std::vector<TreeState> random_states(int count) {
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> u(-3, 3);
  std::vector<TreeState> states;
  while (static_cast<int>(states.size()) < count) {
    TreeState s{"random", Joints::Zero(), support::pose({u(rng), u(rng), 0}, 0, 0, u(rng))};
    for (double& q : s.q) q = u(rng);
    states.push_back(s);
  }
  return states;
}

double angle(const Pose& pose) { return std::atan2(pose(1, 0), pose(0, 0)); }

/// Goals at rest far away.
Tasks tasks_of(const Robot& robot) {
  return {robot, {{9, 8, 0}, {9, 9, 0}, 1}, icat::Objective<double>::equal_to(1)};
}
const double at_rest = 1e9;

TEST(NsbDualArm, JacobiansAreRight) {
  Robot robot = make_robot({});
  Tasks k = tasks_of(robot);
  ASSERT_EQ(k.follow(at_rest), Status::ok);
  for (const TreeState& s : random_states(200)) {
    // A part of σ_d − σ by central differences.
    const auto check = [&](icat::Task<Robot>& task, int first, int rows) {
      const Eigen::MatrixXd numerical = testing_support::differentiate(robot, s, [&](const Robot&) {
        task.update();
        return Eigen::VectorXd(-errors(k, at_rest).segment(first, rows));
      });
      task.update();
      EXPECT_LT((task.jacobian() - numerical).cwiseAbs().maxCoeff(), 1e-8) << task.name();
    };
    check(k.tool, 0, 3);
    check(k.level, 3, 1);
    check(k.distance, 4, 1);
    check(k.joint, 6, 1);
    // Away from its singularity and from end effectors that touch.
    k.view.update();
    const Vector3 p_e = robot.pose(robot.frame("arm1_link3")).translation() -
                        robot.pose(robot.frame("arm2_link2")).translation();
    if (k.view.value() > 0.01 && p_e.norm() > 0.1) check(k.view, 5, 1);
  }
}

// Eq. (2): both end effectors where Fig. 1 has them.
TEST(NsbDualArm, KinematicsOfTheFigure) {
  Robot robot = make_robot({});
  const Pose vehicle = support::pose({1, 2, 0}, 0, 0, 90 * degree);
  ASSERT_EQ(robot.update(Joints(Joints(0, 90, 90, -90, 0) * degree), vehicle), Status::ok);
  const auto at = [&](const char* frame) { return robot.pose(robot.frame(frame)); };
  const Pose tool = at("arm1_link3");
  // In ⟨b⟩: up by a link, then two to the right; one to the right, then up.
  const Vector3 arm1 = vehicle.inverse() * tool.translation(),
                arm2 = vehicle.inverse() * at("arm2_link2").translation();
  EXPECT_LT((arm1 - Vector3(-0.6 + 0.8, 0.25 + 0.4, 0)).norm(), 1e-12);
  EXPECT_LT((arm2 - Vector3(0.6 + 0.5, 0.25 + 0.4, 0)).norm(), 1e-12);
  EXPECT_LT((tool.translation() - Vector3(1 - 0.65, 2 + 0.2, 0)).norm(), 1e-12);
  EXPECT_NEAR(angle(tool), 90 * degree, 1e-12);
  Tasks k = tasks_of(robot);
  k.distance.update();
  EXPECT_NEAR(k.distance.values()(0), 0.2, 1e-12);
}

Eigen::Matrix3d cross(const Vector3& v) { return icat::skew(v); }

// Eq. (22) as printed, in ⟨b⟩, with the Moore-Penrose inverse of the cross-product matrix.
TEST(NsbDualArm, FieldOfViewIsTheEquation) {
  Robot robot = make_robot({});
  Tasks k = tasks_of(robot);
  for (const TreeState& s : random_states(100)) {
    testing_support::place(robot, s);
    const double q21 = s.q(0), q22 = s.q(1), l21 = 0.5, l22 = 0.4;
    const Vector3 p_e = s.base.inverse() * robot.pose(robot.frame("arm1_link3")).translation() -
                        s.base.inverse() * robot.pose(robot.frame("arm2_link2")).translation();
    const Vector3 a_des = p_e.normalized(), a(std::cos(q21 + q22), std::sin(q21 + q22), 0);
    Eigen::Matrix<double, 3, 2> J_p = Eigen::Matrix<double, 3, 2>::Zero(), J_o = J_p;  // Eq. (23)
    J_p << -l21 * std::sin(q21) - l22 * std::sin(q21 + q22), -l22 * std::sin(q21 + q22),
        l21 * std::cos(q21) + l22 * std::cos(q21 + q22), l22 * std::cos(q21 + q22), 0, 0;
    J_o.row(2).setOnes();
    const Eigen::Matrix3d S_p_inverse = testing_support::pseudo_inverse(cross(p_e), 1e-10);
    const Vector3 e = a_des - a;
    if (e.norm() < field_of_view_epsilon) continue;
    const Eigen::RowVector2d expected =
        e.transpose() / e.norm() * (-cross(a_des) * S_p_inverse * J_p + cross(a) * J_o);
    k.view.update();
    EXPECT_NEAR(k.view.value(), e.norm(), 1e-12);
    EXPECT_LT((k.view.jacobian().leftCols<2>() - expected).norm(), 1e-9);
    EXPECT_EQ(k.view.reference()(0), -k.view.value());
  }
}

// [NSB, Remark 2]: through a = a_des, exactly there too, with a lower task that pushes.
TEST(NsbDualArm, NoJumpWhereTheFieldOfViewIsSingular) {
  // All stretched: end effector 1 straight ahead of end effector 2.
  Robot robot = make_robot({.arm1 = {link(2), link(1), link(0.5)}});
  Tasks k = tasks_of(robot);
  const double step = field_of_view_epsilon / 100;
  icat::NullSpaceGuidance<double, 2> solver;
  Eigen::RowVector2d last_J;
  Vector2 last_velocity;
  bool exact = false, inside = false, left = false, right = false;
  for (int i = -300; i <= 300; ++i) {
    ASSERT_EQ(robot.update(Joints(0, i * step, 0, 0, 0)), Status::ok);
    k.view.update();
    const double sigma = k.view.value();
    const Eigen::RowVector2d J = k.view.jacobian().leftCols<2>();
    solver.reset();
    ASSERT_EQ(solver.add_task(J, k.view.reference()), Status::ok);
    ASSERT_EQ(solver.add_task(k.joint.jacobian().leftCols<2>(), icat::Vector<double, 1>(1.0)),
              Status::ok);
    const Vector2 velocity = solver.velocity();
    ASSERT_TRUE(J.allFinite() && velocity.allFinite());
    exact |= sigma == 0;
    inside |= sigma > 0 && sigma < field_of_view_epsilon;
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
  ASSERT_EQ(robot.update(Joints(Joints::Zero())), Status::ok);
  k.view.update();
  EXPECT_LT(k.view.jacobian().norm(), 1e-8);
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
  EXPECT_EQ(r.peak(7), 3 * degree);  // the bound on r is reached
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
  Robot robot = scenario.robot();
  const Line line = scenario.tasks(robot).line;
  for (const auto& s : r.samples) {
    if (s.t < 10 || s.t > shortened(scenario).length / scenario.speed) continue;
    ASSERT_EQ(robot.update(s.q, s.vehicle), Status::ok);
    const Pose tool = robot.pose(robot.frame("arm1_link3"));
    EXPECT_LT((tool.translation() - line.start - scenario.speed * s.t * line.direction()).norm(),
              1e-3);
    EXPECT_NEAR(angle(tool), scenario.slope + 90 * degree, 1e-3);
    EXPECT_NEAR(tool(1, 3) - s.vehicle(1, 3), 0.5 / 2 + 2.0 / 3 * (0.4 + 0.4 + 0.4), 1e-3);
  }
}

// Eq. (35), and what errors are.
TEST(NsbDualArm, Gains) {
  const Scenario scenario;
  Robot robot = scenario.robot();
  Tasks k = scenario.tasks(robot);
  ASSERT_EQ(k.follow(at_rest), Status::ok);
  for (icat::Task<Robot>* task : std::initializer_list<icat::Task<Robot>*>{
           &k.tool, &k.level, &k.distance, &k.view, &k.joint}) {
    task->update();
  }
  const Pose tool = robot.pose(robot.frame("arm1_link3")), goal = k.line.pose(at_rest);
  icat::Vector<double, 7> gains, error, rate;
  gains << 1, 1, 1, 3, 2, 1, 3;
  error << goal(0, 3) - tool(0, 3), goal(1, 3) - tool(1, 3), angle(goal) - angle(tool),
      -scenario.tilt, 0.5 / 2 + 2.0 / 3 * (0.4 + 0.4 + 0.4) - tool(1, 3), -k.view.value(),
      90 * degree - scenario.q(0);
  rate << k.tool.reference(), k.level.reference(), k.distance.reference(), k.view.reference(),
      k.joint.reference();
  EXPECT_LT((errors(k, at_rest) - error).norm(), 1e-12);
  EXPECT_LT((rate - gains.cwiseProduct(error)).norm(), 1e-12);
}

TEST(NsbDualArm, TheFollowerNeverMovesTheVehicle) {
  Scenario scenario = shortened({});
  scenario.length /= 10;
  const Result r = run_nsb(scenario);
  scenario.q.head<2>() << -2, 1;
  scenario.dimensions.arm2 = {link(0.3), link(0.9)};
  const Result other = run_nsb(scenario);
  ASSERT_EQ(r.samples.size(), other.samples.size());
  EXPECT_GT((r.samples[500].q - other.samples[500].q).head<2>().norm(), 0.1);
  for (std::size_t i = 0; i < r.samples.size(); ++i) {
    ASSERT_EQ(r.samples[i].vehicle.matrix(), other.samples[i].vehicle.matrix());
    ASSERT_EQ(r.samples[i].q.tail<3>(), other.samples[i].q.tail<3>());
    ASSERT_EQ(r.samples[i].velocity.tail<6>(), other.samples[i].velocity.tail<6>());
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
