// SPDX-License-Identifier: BSD-3-Clause
// Noise of the vehicle's measured velocity, and the low-pass against it [MARIS, VI-D]: the
// direction of each effect. docs/vehicle.md has the numbers, and those that the paper's account
// would let one expect and that do not come.
#include <gtest/gtest.h>

#include "../examples/12_velocity_feedback/simulation.hpp"

namespace {

using feedback::Result;

class VelocityFeedback : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    none = run({});
    fifty = run({.cutoff = 50});
  }
  static Result run(const feedback::Variant& variant) {
    Result r = feedback::run(variant);
    EXPECT_EQ(r.status, icat::Status::ok) << icat::describe(r.status);
    return r;
  }
  static inline Result none, fifty;
};

TEST_F(VelocityFeedback, WithoutNoiseNothingMoves) {
  const Result quiet = run({.noise = false});
  EXPECT_LT(quiet.position, 1e-4);
  EXPECT_LT(quiet.reference, 0.01 * none.reference);
}

TEST_F(VelocityFeedback, TheFilterQuietsArmAndVehicle) {
  EXPECT_GT(none.reference, 3 * fifty.reference);
  EXPECT_GT(none.acceleration, 3 * fifty.acceleration);
  EXPECT_GT(none.tool_speed, 1.2 * fifty.tool_speed);
  // Not more than white noise is filtered: the rest is motion.
  const double alpha = 1 - std::exp(-50 * 0.002);
  EXPECT_LT(none.reference, std::sqrt((2 - alpha) / alpha) * fifty.reference);
}

// What shakes the vehicle is the arm; and the vehicle, so shaken, moves the arm a little more.
TEST_F(VelocityFeedback, TheArmShakesTheVehicle) {
  const Result alone = run({.reaction = false}),
               alone_fifty = run({.cutoff = 50, .reaction = false});
  EXPECT_GT(none.acceleration, 10 * alone.acceleration);
  EXPECT_GT(fifty.acceleration, 10 * alone_fifty.acceleration);
  EXPECT_GT(fifty.rate, 1.5 * alone_fifty.rate);
  EXPECT_GT(fifty.reference, 1.05 * alone_fifty.reference);
}

// Too low a cut-off is late: the arm then drives the vehicle's swinging.
TEST_F(VelocityFeedback, TheCutOffHasABestRange) {
  Result best = none;
  for (const double cutoff : {5.0, 10.0, 20.0, 100.0}) {
    const Result r = run({.cutoff = cutoff});
    best.reference = std::min(best.reference, r.reference);
    best.position = std::min(best.position, r.position);
    best.tool_speed = std::min(best.tool_speed, r.tool_speed);
    if (cutoff > 5) continue;
    EXPECT_GT(r.position, 3 * fifty.position);
    EXPECT_GT(r.reference, 2 * fifty.reference);
    EXPECT_GT(r.rate, 3 * fifty.rate);
  }
  EXPECT_LT(fifty.reference, 2 * best.reference);
  EXPECT_LT(fifty.position, 2 * best.position);
  EXPECT_LT(fifty.tool_speed, 2 * best.tool_speed);
}

// What moves with the vehicle along x at q = 0, where the arm hangs along z: masses, and the water
// that vehicle and links take along.
TEST(R2, WeighsWhatItsPartsWeigh) {
  const icat::VehicleManipulatorDynamics<double, 7> robot(icat::r2_dynamics<double>());
  const double water = icat::r2_vehicle_body<double>().added_mass(0) + 1.01 * 29 + 3.57;
  EXPECT_NEAR(robot.mass_matrix()(7, 7), 400 + 29 + 4.59 + water, 1e-9);
}

// The mass that swings with the arm about the vehicle is some 0.4 of what swings in all: no
// oscillation by itself, but a feedback to reckon with.
TEST_F(VelocityFeedback, TheLoopGainIsBelowOne) {
  const double gain = feedback::loop_gain();
  EXPECT_GT(gain, 0.2);
  EXPECT_LT(gain, 0.6);
}

}  // namespace
