// SPDX-License-Identifier: BSD-3-Clause
// The mission of 01_grasp, unchanged, on MuJoCo.
#include <gtest/gtest.h>

#include <icat/adapters/mujoco_plant.hpp>

#include "examples/01_grasp/mission.hpp"
#include "examples/support/mujoco/maris.hpp"

namespace {

constexpr double degree = std::numbers::pi / 180;

grasp::Result run(const grasp::Variant& variant, int* contacts) {
  const grasp::Robot robot = grasp::make_robot();
  const auto model =
      support::load_mujoco(support::mjcf(icat::maris_dynamics<double>(), support::pool()));
  //! [plant]
  icat::MujocoPlant<grasp::Robot> plant(
      robot, *model, {.q = support::folded_arm(), .base = grasp::start(variant)});
  icat::PlantBackEnd back_end(robot, plant);
  //! [plant]
  return grasp::run(variant, 0.01, back_end,
                    [&](const auto&...) { *contacts = std::max(*contacts, plant.data().ncon); });
}

// The thresholds are those of the mission without dynamics, tests/test_grasp_mission.cpp.
void expect_success(const grasp::Result& r) {
  ASSERT_EQ(r.status, icat::Status::ok);
  EXPECT_EQ(r.outcome, "lifted");
  EXPECT_LT(r.grasp_position_error, 1e-3);
  EXPECT_LT(r.grasp_orientation_error, 0.1 * degree);
  EXPECT_LT(r.lift_position_error, 1e-3);
  EXPECT_LT(r.lift_orientation_error, 0.1 * degree);
  EXPECT_TRUE(r.violations.empty()) << r.violations.front();
}
void print(const char* what, const grasp::Result& r) {
  std::printf(
      "01_grasp on MuJoCo, %s: 100 Hz, %.2f s; tool error at the grasp %.3f mm, %.4f deg, lifted "
      "%.3f mm, %.4f deg\n",
      what, r.samples.back().t, 1e3 * r.grasp_position_error, r.grasp_orientation_error / degree,
      1e3 * r.lift_position_error, r.lift_orientation_error / degree);
  for (const auto& [phase, t] : r.phases) std::printf("  %s from %.2f s\n", phase.c_str(), t);
}

TEST(GraspOnMujoco, WholeBody) {
  int contacts = 0;
  const grasp::Result r = run({}, &contacts);
  print("whole body", r);
  expect_success(r);
  EXPECT_EQ(contacts, 0);
}

TEST(GraspOnMujoco, TheArmMakesUpForTheVehicle) {
  int contacts = 0;
  const grasp::Result r = run({.compensation = true}, &contacts);
  print("arm and vehicle in parallel", r);
  expect_success(r);
}

}  // namespace
