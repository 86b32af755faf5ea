// SPDX-License-Identifier: BSD-3-Clause
// The figures of the reference mission.
#include <gtest/gtest.h>

#include <memory>

#include "../examples/01_grasp/mission.hpp"
#include "support/sanitized.hpp"

namespace {

constexpr double degree = std::numbers::pi / 180;

void expect_success(const grasp::Result& r) {
  ASSERT_EQ(r.status, icat::Status::ok);
  ASSERT_EQ(r.phases.size(), 3u);
  EXPECT_EQ(r.outcome, "lifted");
  EXPECT_TRUE(r.grasped);
  EXPECT_TRUE(r.lifted);
  EXPECT_LT(r.grasp_position_error, 1e-3);
  EXPECT_LT(r.grasp_orientation_error, 0.1 * degree);
  EXPECT_LT(r.lift_position_error, 1e-3);
  EXPECT_LT(r.lift_orientation_error, 0.1 * degree);
  EXPECT_TRUE(r.violations.empty()) << r.violations.front();
  // From a few metres away, and up by half a metre.
  EXPECT_GT(r.samples.front().vehicle_position, 3.0);
  EXPECT_NEAR(r.samples.back().tool.translation().z(), grasp::pipe_centre.z() - 0.5, 1e-3);
}

TEST(GraspMission, FullyActuated) {
  const grasp::Result r = grasp::run({});
  expect_success(r);
  // Accelerations stay below 5 m/s² (rad/s²) in norm: no jump in 10 ms.
  EXPECT_LT(r.largest_step, 0.05);
  // Every inequality objective has something to do on the way.
  for (std::size_t i = 0; i < r.tasks.size(); ++i) {
    double most = 0;
    for (const auto& s : r.samples) most = std::max(most, s.activations[i]);
    EXPECT_GT(most, 0.01) << r.tasks[i];
  }
}

// A jump would not shrink with the period; a steep but continuous change does.
TEST(GraspMission, HalfThePeriodHalvesTheLargestChange) {
  if (sanitized) GTEST_SKIP();
  const double coarse = grasp::run({}, 0.01).largest_step;
  const double fine = grasp::run({}, 0.005).largest_step;
  EXPECT_LT(fine, 0.65 * coarse);
}

// A phase that is not through in time is not followed by the next one.
TEST(GraspMission, TimeOutsFail) {
  const grasp::Result late = grasp::run({.time_limit = 5});  // of the 20 s of the way
  EXPECT_EQ(late.status, icat::Status::ok);
  EXPECT_EQ(late.outcome, "not at the pipe");
  EXPECT_EQ(late.phases.size(), 1u);
  EXPECT_FALSE(late.grasped || late.lifted);
}

TEST(GraspMission, RollAndPitchNotActuated) {
  const grasp::Result r = grasp::run({.underactuated = true});
  expect_success(r);
  EXPECT_LT(r.largest_step, 0.05);
  for (const auto& s : r.samples) ASSERT_EQ(s.command.segment<2>(10).norm(), 0);
}

TEST(GraspMission, TheArmCompensatesTheCurrent) {
  if (sanitized) GTEST_SKIP();
  const grasp::Result without = grasp::run({.current = true});
  const grasp::Result with = grasp::run({.current = true, .compensation = true});
  ASSERT_EQ(without.status, icat::Status::ok);
  ASSERT_EQ(with.status, icat::Status::ok);
  EXPECT_EQ(without.outcome, "lifted");
  EXPECT_EQ(with.outcome, "lifted");
  EXPECT_TRUE(with.grasped);
  EXPECT_TRUE(with.violations.empty());
  EXPECT_TRUE(without.violations.empty());
  EXPECT_LT(without.largest_step, 0.05);
  EXPECT_GT(with.steady_error, 0);
  EXPECT_GE(without.steady_error, 10 * with.steady_error);
  EXPECT_LT(with.largest_step, 0.05);
}

// What goes as it should is explained without an alarm in every cycle, in a current, too.
TEST(GraspMission, NoExplanationAlarms) {
  if (sanitized) GTEST_SKIP();
  using Controller = icat::ParallelController<grasp::Robot>;
  std::unique_ptr<icat::Explainer<Controller>> why;
  int cycles = 0, alarms = 0;
  double worst = 0;
  const auto observe = [&](const grasp::Cycle& now) {
    if (!why) why = std::make_unique<icat::Explainer<Controller>>(now.controller);
    why->update();
    ++cycles;
    if (why->alarm() && ++alarms == 1) ADD_FAILURE() << why->text();
    for (const auto& t : why->tasks()) {
      double sum = 0;
      for (const auto& share : t.shares) sum += share.amount;
      worst = std::max(worst, std::abs(sum - t.loss));
    }
  };
  expect_success(grasp::run({.current = true, .compensation = true}, 0.01, observe));
  EXPECT_GT(cycles, 5000);
  EXPECT_EQ(alarms, 0);
  EXPECT_LT(worst, 1e-9);
}

TEST(GraspMission, VelocitiesStayInsideTheirBounds) {
  if (sanitized) GTEST_SKIP();
  for (const grasp::Variant& v :
       {grasp::Variant{}, grasp::Variant{.current = true, .compensation = true}}) {
    for (const auto& s : grasp::run(v).samples) {
      ASSERT_LE(s.command.head<10>().cwiseAbs().maxCoeff(), 0.5);
      ASSERT_LE(s.command.tail<3>().cwiseAbs().maxCoeff(), 0.4);
    }
  }
}

}  // namespace
