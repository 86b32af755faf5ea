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

// Without noise the arm makes up for the swaying water; what moves then moves slowly.
TEST_F(VelocityFeedback, ItIsNoiseThatShakes) {
  const Result quiet = run({.noise = false});
  EXPECT_LT(quiet.position, 1e-3);
  EXPECT_LT(quiet.tool_speed, 0.1 * fifty.tool_speed);
  EXPECT_LT(quiet.acceleration, 0.1 * fifty.acceleration);
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
  EXPECT_GT(none.rate, 1.2 * alone.rate);
  EXPECT_GT(fifty.rate, 1.2 * alone_fifty.rate);
  EXPECT_GT(fifty.reference, alone_fifty.reference);
}

// Too low a cut-off is late: the arm makes up for where the vehicle was. With too high a one it
// shakes. Between, 50 rad/s is not far from the best.
TEST_F(VelocityFeedback, TheCutOffHasABestRange) {
  const Result two = run({.cutoff = 2}), ten = run({.cutoff = 10});
  EXPECT_GT(two.position, 2 * fifty.position);
  EXPECT_GT(two.reference, 1.2 * fifty.reference);
  EXPECT_GT(two.rate, 2 * fifty.rate);
  EXPECT_LT(fifty.position, 1.1 * std::min(none.position, ten.position));
  EXPECT_LT(fifty.reference, 2 * ten.reference);
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
