// SPDX-License-Identifier: BSD-3-Clause
// Flat ports by Snell's law, calibration by OpenCV on rendered boards, the cameras on the arm.
#include <gtest/gtest.h>

#include "examples/15_calibration/wrist.hpp"

namespace {

using namespace calibration;

TEST(Port, PixelsAndRaysAreInverse) {
  for (const double water : {1.0, 1.333}) {
    const PortRig rig = port_rig({.water_index = water});
    for (const double u : {0.0, 320.0, 650.5, 1291.0}) {
      for (const double v : {0.0, 478.2, 963.0}) {
        const Ray ray = rig.cameras[0](u, v);
        for (const double s : {0.2, 1.0, 4.0}) {
          const V p = ray.origin + s * ray.direction;
          const cv::Point2d pixel = rig.cameras[0].project(Vector3(p.x, p.y, p.z));
          // Sixty halvings, and twelve rounds of a contraction by 0.2: 1e-8 at the corners.
          EXPECT_NEAR(pixel.x, u, 1e-6);
          EXPECT_NEAR(pixel.y, v, 1e-6);
        }
      }
    }
  }
}

// Near the axis a flat port only makes the picture larger, n times, about a centre that is behind
// the lens: (n − 1) d_air + (n/n_g − 1) d_glass.
double apparent_shift(const Port& port) {
  return (port.water_index - 1) * port.air + (port.water_index / port.glass_index - 1) * port.glass;
}

TEST(Port, ParaxialMagnification) {
  Port port;
  port.tilt = 0;
  const Lens lens;
  const PortCamera camera(lens, port);
  for (const double z : {0.5, 2.0}) {
    const double small = 1e-3 * z;
    const double expected = port.water_index * lens.f * small / (z + apparent_shift(port));
    // The cosines and the distortion that are left out: 1e-6 of it.
    EXPECT_NEAR(camera.project(Vector3(small, 0, z)).x - lens.cx, expected, 1e-5 * expected);
  }
}

const StereoCalibration& calibrated(double water) {
  static const StereoCalibration in_air = calibrate(port_rig({.water_index = 1}), 10, 5),
                                 in_water = calibrate(port_rig({}), 10, 5);
  return water == 1 ? in_air : in_water;
}

TEST(Calibration, RecoversTheLensInAir) {
  const StereoCalibration& c = calibrated(1);
  ASSERT_EQ(c.views, 10);
  const Lens lens;
  const cv::Mat &K = c.cameras[0].matrix, &d = c.cameras[0].distortion;
  // Corners are found to 0.05 px; ten boards of 54 of them, each 300 px wide, give f to 0.05 px /
  // 300 px / √10 · 1173 px = 0.06 px where the tilt of each board is known. It is not, and depth
  // and f of a board that is tilted by up to 0.5 rad are told apart by a quarter of its width at
  // best: ten times as much, so 0.3 % is far from it. The pane adds 0.3 mm of apparent shift.
  EXPECT_NEAR(K.at<double>(0, 0), lens.f, 0.003 * lens.f);
  EXPECT_NEAR(K.at<double>(1, 1), lens.f, 0.003 * lens.f);
  EXPECT_NEAR(K.at<double>(0, 2), lens.cx, 4);
  EXPECT_NEAR(K.at<double>(1, 2), lens.cy, 4);
  EXPECT_NEAR(d.at<double>(0), lens.k1, 0.02);
  EXPECT_LT(c.error, 0.1);
  EXPECT_NEAR(c.right.translation().norm(), 0.25, 1e-3);
}

TEST(Calibration, InWaterThePinholeIsLongerAndDistortsTheOtherWay) {
  const StereoCalibration& c = calibrated(1.333);
  ASSERT_EQ(c.views, 10);
  const Lens lens;
  for (const Intrinsics& camera : c.cameras) {
    // n f on the axis; k1 takes the rest, over boards at 0.5 to 1.3 m: 1 %.
    EXPECT_NEAR(camera.matrix.at<double>(0, 0), 1.333 * lens.f, 0.01 * 1.333 * lens.f);
    EXPECT_GT(camera.distortion.at<double>(0), 0.1);  // a pincushion; the lens is a barrel
    EXPECT_LT(camera.error, 0.1);
  }
  std::printf("in water: reprojection %.3f and %.3f px, both %.3f px\n", c.cameras[0].error,
              c.cameras[1].error, c.error);
  EXPECT_LT(c.error, 0.1);
  EXPECT_NEAR(c.right.translation().norm(), 0.25, 2e-3);
}

// The pinhole of in-water parameters is not where the lens is, but the arm does not mind: what it
// wants to know is where things are.
TEST(Calibration, TheCamerasOnTheArm) {
  const PortRig rig = port_rig({});
  WristBoard wrist;
  const auto views = wrist.take(rig.cameras[0], 10, 21);
  ASSERT_EQ(views.size(), 10u);
  const Pose water = average(camera_in_arm(views, wrist.board(), calibrated(1.333).cameras[0]));
  const Pose shift = wrist.camera().inverse() * water;
  // Joints of 0.5 mrad over 1.2 m and corners of 0.05 px at 1.1 m are 1 mm and 1 mm a posture.
  EXPECT_NEAR(shift.translation().z(), -apparent_shift({}), 3e-3);
  EXPECT_LT(shift.translation().head<2>().norm(), 5e-3);

  const Pose air = average(camera_in_arm(views, wrist.board(), calibrated(1).cameras[0]));
  for (const double range : {1.0, 2.0}) {
    double worst_water = 0, worst_air = 0;
    for (const double x : {-0.2, 0.0, 0.25}) {
      for (const double y : {-0.15, 0.15}) {
        const Vector3 point(0.125 + x * range, y * range, range);
        std::array<cv::Point2d, 2> pixels;
        for (std::size_t k = 0; k < 2; ++k) {
          pixels[k] = rig.cameras[k].project(rig.poses[k].inverse() * point);
        }
        const Vector3 truth = wrist.camera() * point;
        const Vector3 by_water = water * triangulate(calibrated(1.333), pixels);
        const Vector3 by_air = air * triangulate(calibrated(1), pixels);
        worst_water = std::max(worst_water, (by_water - truth).norm());
        worst_air = std::max(worst_air, (by_air - truth).norm());
      }
    }
    std::printf("on the arm at %.0f m: in-water parameters %.1f mm, in-air %.1f mm at worst\n",
                range, 1e3 * worst_water, 1e3 * worst_air);
    // 0.1 px of both pictures, as reprojected, at 2 m: 4 / (1565 · 0.25) · 0.1 = 1 mm, and a
    // pinhole for boards at 0.5 to 1.3 m that is used at 2 m.
    EXPECT_LT(worst_water, 0.015);
    // In depth n − 1 of the range, a quarter of it is left, less what the mount made up for at
    // the board's range, 1.1 m.
    EXPECT_TRUE(range < 2 || worst_air > 0.1);
  }
}

TEST(Calibration, AverageOfPoses) {
  const Pose middle = support::pose({1, 2, 3}, 0.3, -0.4, 3.1);
  std::vector<Pose> poses;
  for (const double sign : {-1.0, 1.0}) {
    for (int axis = 0; axis < 3; ++axis) {
      Pose p = middle;
      Vector3 turn = Vector3::Zero();
      turn(axis) = 0.1 * sign;
      p.linear() *= icat::rotation_exp<double>(turn);
      p.translation() += turn;
      poses.push_back(p);
    }
  }
  const auto off = support::distance(average(poses), middle);
  EXPECT_LT(off.position, 1e-12);
  EXPECT_LT(off.orientation, 1e-9);
}

}  // namespace
