// SPDX-License-Identifier: BSD-3-Clause
// What a simulated rig sees of a pipe, and the way from there to a goal.
#include <gtest/gtest.h>

#include <icat/perception/arm_mask.hpp>
#include <icat/perception/frame_tracker.hpp>
#include <icat/perception/pose_history.hpp>
#include <icat/sim/stereo_pipe.hpp>

#include "support/allocation_counter.hpp"
#include "support/pipes.hpp"
#include "support/sanitized.hpp"
#include "support/states.hpp"

namespace {

using icat::Status;
using testing_support::make_pose;
using Vector3 = icat::Vector3<double>;
using Pose = icat::Pose<double>;
using Pixel = icat::Pixel<double>;
using Measurement = icat::CylinderMeasurement<double>;
using Estimator = icat::CylinderPose<double>;
using Sim = icat::StereoPipe<double>;

const auto rig = icat::parallel_cameras<double>();

// ---- The simulated rig

/// Looks down from the front of the vehicle.
const Pose mount = make_pose<double>(0.45, 0, 0.35, 0, 0, 0);
const Pose hovering = make_pose<double>(1.5, 1, 1.8, 0.02, -0.03, 0.4);
const icat::ArmOutline<double> no_arm{};
/// ⟨o⟩ in ⟨0⟩ of a pipe at `in_camera` of the hovering vehicle.
Pose seen_at(const Pose& in_camera) { return hovering * mount * in_camera; }
const Vector3 down_in_camera = icat::gravity_in_camera<double>(hovering, mount);

TEST(StereoPipe, WithoutNoiseItShowsThePipe) {
  Sim sim(rig, mount, {.pixel_noise = 0, .contrast_noise = 0});
  // Level in ⟨0⟩, 1.9 m below the cameras.
  const Pose pipe = make_pose<double>(2, 1.2, 4, 0, 0, 0.2);
  const auto view = sim.picture(hovering, pipe, no_arm);
  EXPECT_EQ(view.count, 8);  // four long ones and both ends in each image
  Measurement m;
  ASSERT_EQ(Estimator(rig).measure(view.lines(), down_in_camera, m), Status::ok);
  ASSERT_TRUE(m.end_seen);
  const auto e = support::pipe_error(Pose(hovering * mount * m.frame), pipe);
  EXPECT_LT(e.lateral, 1e-9);
  EXPECT_LT(e.tilt, 1e-9);
  EXPECT_LE(e.along, m.rim_error);
  EXPECT_LT(m.rim_error, 0.03);
}

// At 10 Hz, each 0.1 s late, with the time at which it was taken; empty pictures come too.
TEST(StereoPipe, RateLatencyAndSeeds) {
  Sim a(rig, mount), b(rig, mount), c(rig, mount, {.seed = 6});
  const Pose pipe = seen_at(support::level_pipe(0, 0, 2, 0.3));
  int count = 0;
  for (int k = 0; k < 200; ++k) {
    const double t = 0.01 * k;
    Pose where = pipe;
    if (k >= 100) where.translation()(2) -= 100;  // gone
    const auto x = a.observe(t, hovering, where, no_arm), y = b.observe(t, hovering, where, no_arm),
               z = c.observe(t, hovering, where, no_arm);
    EXPECT_FALSE(a.observe(NAN, hovering, where, no_arm));
    if (!x) continue;
    ASSERT_TRUE(y && z);
    EXPECT_NEAR(x->time, 0.1 * count, 1e-9);
    EXPECT_NEAR(t - x->time, 0.1, 0.01 + 1e-9);
    ++count;
    EXPECT_EQ(x->value.count, x->time < 0.99 ? y->value.count : 0);
    for (int i = 0; i < x->value.count; ++i) {
      const auto n = static_cast<std::size_t>(i);
      EXPECT_EQ(x->value.line[n].rho, y->value.line[n].rho);
      EXPECT_NE(x->value.line[n].rho, z->value.line[n].rho);
    }
  }
  EXPECT_EQ(count, 19);
  EXPECT_EQ(count_allocations([&] { (void)a.picture(hovering, pipe, no_arm); }), 0);
}

// How often a line is seen is Φ of contrast less threshold over its noise, to four deviations of
// 1600 lines that are seen or not; so is the noise of ρ, to four of n, and it grows as 1/C.
TEST(StereoPipe, WaterDecidesWhatIsSeen) {
  double clear = 0, turbid = 0, very = 0;
  for (const double attenuation : {0.2, 0.9, 1.0, 1.1, 3.0}) {
    Sim sim(rig, mount, {.attenuation = attenuation, .seed = 11});
    const Pose in_camera = support::level_pipe(0, 0, 2, 0.7);
    const Pose pipe = seen_at(in_camera);
    int seen = 0;
    const int n = sanitized ? 100 : 400;
    double squares = 0;
    double range = 0, p = 0;  // the four contours have ranges that differ by some cm
    for (int i = 0; i < 4; ++i) {
      const double r = icat::edge_segment(rig, i / 2, {}, in_camera, i % 2)->range;
      range += r / 4, p += sim.detection_probability(r) / 4;
    }
    for (int k = 0; k < n; ++k) {
      const auto view = sim.picture(hovering, pipe, no_arm);
      for (const auto& line : view.lines()) {
        if (line.kind != icat::ContourKind::edge) continue;
        ++seen;
        // Of the middle of the line, whose offset has half the variance of an end.
        double nearest = HUGE_VAL;
        for (int side = 0; side < 2; ++side) {
          const auto s = icat::edge_segment(rig, line.camera, {}, in_camera, side);
          const Pixel middle = (s->from + s->to) / 2;
          if (std::abs(line.distance(middle)) < std::abs(nearest)) nearest = line.distance(middle);
        }
        squares += nearest * nearest;
      }
    }
    const double share = seen / (4.0 * n);
    std::printf("attenuation %.1f/m: seen %.3f of lines, expected %.3f\n", attenuation, share, p);
    EXPECT_NEAR(share, p, 4 * std::sqrt(p * (1 - p) / (4 * n)) + 1e-6);
    if (seen > 100) {
      const double deviation = 0.5 * std::exp(attenuation * range) / std::sqrt(2.0);
      EXPECT_NEAR(std::sqrt(squares / seen) / deviation, 1,
                  4 / std::sqrt(2.0 * seen) + 0.02);  // 0.02 for a range that is the mean
    }
    (attenuation < 0.5 ? clear : attenuation < 2 ? turbid : very) = share;
  }
  EXPECT_EQ(clear, 1);  // the pictures of the trials: seen, seen at times, never
  EXPECT_GT(turbid, 0.1);
  EXPECT_LT(turbid, 0.9);
  EXPECT_EQ(very, 0);
}

// With half of it covered a contour has half its length, so four times the variance of its angle,
// to a sample or two of 33; the covered end is gone. Under a hull as large as the image all is.
TEST(StereoPipe, WhatIsCoveredIsNotSeen) {
  const Pose pipe = seen_at(support::level_pipe(0, 0, 2, 0));
  Sim sim(rig, mount);
  icat::ArmOutline<double> arm{std::vector<icat::ImageHull<double>>(1), {}};
  const auto view = sim.picture(hovering, pipe, arm);
  const double middle = 1292 / 2.0;
  arm[0][0].set(std::vector<Pixel>{{-1, -1}, {middle, -1}, {middle, 999}, {-1, 999}});
  const auto half = sim.picture(hovering, pipe, arm);
  ASSERT_EQ(view.count, 8);
  ASSERT_EQ(half.count, 7);
  for (std::size_t k = 0; k < 7; ++k) {
    if (half.line[k].kind != icat::ContourKind::edge) continue;
    double whole = 0;  // of the same camera: both contours are as long as each other
    for (const auto& line : view.lines()) {
      const bool same = line.kind == icat::ContourKind::edge && line.camera == half.line[k].camera;
      if (same) whole = line.covariance(0, 0);
    }
    const double ratio = half.line[k].covariance(0, 0) / whole;
    EXPECT_NEAR(ratio, half.line[k].camera == 0 ? 4 : 1, half.line[k].camera == 0 ? 0.6 : 0.05);
  }
  arm[0][0].set(std::vector<Pixel>{{-1, -1}, {1999, -1}, {1999, 999}, {-1, 999}});
  const auto right = sim.picture(hovering, pipe, arm);
  ASSERT_EQ(right.count, 4);
  for (const auto& line : right.lines()) EXPECT_EQ(line.camera, 1);
}

// The hand before the pipe: without the mask the lines follow the arm, with it none does.
TEST(StereoPipe, TheMaskKeepsTheArmOutOfTheContours) {
  auto robot = icat::uvms(icat::maris_arm<double>(),
                          {.arm = icat::maris_arm_mount<double>(), .camera = mount});
  const std::vector<icat::FrameBox<double>> boxes{
      {robot.frame("link7"), Vector3(-0.12, -0.12, -0.14), Vector3(0.12, 0.12, 0.30)}};
  icat::ArmMask mask(robot, robot.frame("camera"), rig, std::span(boxes));
  int crossed = 0, wrong_without = 0, wrong_with = 0, pictures = 0;
  Sim with(rig, mount), without(rig, mount, {.mask = false});
  const Estimator estimator(rig, {.max_residual = 1});
  for (int k = 0; k < 100; ++k) {
    const double sway = 0.5 * std::sin(0.3 * k);
    icat::Vector<double, 7> q;
    q << 0.3 * std::sin(0.17 * k), -0.2 + 0.2 * sway, 0.3 * sway, -0.3, 0, 0.3, 0.5 * sway;
    ASSERT_EQ(robot.update(q, hovering), Status::ok);
    ASSERT_EQ(mask.update(), Status::ok);
    const Pose hand = mount.inverse() * hovering.inverse() * robot.pose(boxes[0].frame);
    // Across the pipe's picture, wherever the hand is.
    Pose in_camera = support::level_pipe(0, 0, 1.9, 0.9);
    in_camera.translation()(0) = hand(0, 3) / hand(2, 3) * 1.9 + 0.15;
    in_camera.translation()(1) = hand(1, 3) / hand(2, 3) * 1.9 + 0.08;
    const Pose pipe = seen_at(in_camera);
    const Vector3 down = in_camera.linear().col(2);
    for (const bool masked : {false, true}) {
      Sim& sim = masked ? with : without;
      Measurement m;
      const auto view = sim.picture(hovering, pipe, mask.outline());
      if (estimator.measure(view.lines(), down, m) != Status::ok) continue;
      ++pictures;
      const auto e = support::pipe_error(m.frame, in_camera);
      // Ten deviations: chance does not make one.
      const bool wrong = e.components(0) * e.components(0) > 100 * m.covariance(0, 0) ||
                         e.components(2) * e.components(2) > 100 * m.covariance(2, 2);
      (masked ? wrong_with : wrong_without) += wrong;
    }
    const auto s = icat::edge_segment(rig, 0, {}, in_camera, 0);
    double low, high;
    if (s && mask.outline()[0][0].covers(s->from, s->to, low, high)) ++crossed;
  }
  std::printf("arm across in %d of 100: %d wrong without the mask, %d with it, of %d\n", crossed,
              wrong_without, wrong_with, pictures);
  EXPECT_GT(crossed, 50);
  EXPECT_GT(pictures, 100);
  EXPECT_GT(wrong_without, 30);
  EXPECT_EQ(wrong_with, 0);
}

// Half of the pipe out of view: the error along the axis is all that is left open.
TEST(StereoPipe, OutOfViewOfTheEndsTheAxisIsSeen) {
  Sim sim(rig, mount, {.pixel_noise = 0.5, .contrast_noise = 0});
  const Pose in_camera = support::level_pipe(0.1, 0.1, 0.5, 0.1);  // 0.54 m of floor in view
  const Pose pipe = seen_at(in_camera);
  const Estimator estimator(rig);
  for (int k = 0; k < 100; ++k) {
    const auto view = sim.picture(hovering, pipe, no_arm);
    Measurement m;
    ASSERT_EQ(estimator.measure(view.lines(), in_camera.linear().col(2), m), Status::ok);
    EXPECT_FALSE(m.end_seen) << view.count;
    const auto e = support::pipe_error(m.frame, in_camera);
    for (const int i : {0, 2, 3, 5}) {
      EXPECT_LT(std::abs(e.components(i)), 5 * std::sqrt(m.covariance(i, i))) << i;
    }
    EXPECT_GT(e.along, 0.01);
  }
}

TEST(StereoPipe, ConstructionChecks) {
  const auto bad = [](Sim::Options o) { EXPECT_THROW(Sim(rig, mount, o), std::invalid_argument); };
  bad({.shape = {.radius = 0}}), bad({.shape = {.length = NAN}}), bad({.rate = 0});
  bad({.latency = -1}), bad({.pixel_noise = -1}), bad({.attenuation = NAN}), bad({.contrast = 0});
  bad({.contrast = 2}), bad({.contrast_noise = -1}), bad({.threshold = -1});
  bad({.shortest_edge = 0}), bad({.shortest_end = -1});
  Pose none = mount;
  none.linear() *= 2;
  EXPECT_THROW(Sim(rig, none), std::invalid_argument);
}

// What the docs say of range and water: share of pictures in which a pipe is found, and how far
// off, across and along. 200 pictures each, headings all around.
TEST(StereoPipe, RangeAndWater) {
  if (sanitized) GTEST_SKIP() << "statistics";
  const Estimator estimator(rig);
  double last_share = 2, last_across = 0;
  for (const double attenuation : {0.2, 0.6, 1.0}) {
    for (const double range : {1.0, 1.5, 2.0, 3.0}) {
      Sim sim(rig, mount, {.attenuation = attenuation});
      double across = 0, along = 0;
      int found = 0, ends = 0;
      const int n = 200;
      for (int k = 0; k < n; ++k) {
        const Pose in_camera = support::level_pipe(0.1, 0, range, 2 * std::numbers::pi / n * k);
        const auto view = sim.picture(hovering, seen_at(in_camera), no_arm);
        Measurement m;
        if (estimator.measure(view.lines(), in_camera.linear().col(2), m) != Status::ok) continue;
        const auto e = support::pipe_error(m.frame, in_camera);
        ++found;
        if (m.end_seen) ++ends, along += e.along * e.along;
        // Without an end the origin is elsewhere on the axis, and no point of it is off by more.
        across += e.lateral * e.lateral;
      }
      const double share = 1.0 * found / n;
      std::printf("attenuation %.1f/m, range %.1f m: found %.0f %%, with an end %.0f %%",
                  attenuation, range, 100 * share, 100.0 * ends / n);
      if (ends > 0) {
        std::printf(", rms %.1f mm across, %.1f mm along", 1e3 * std::sqrt(across / found),
                    1e3 * std::sqrt(along / ends));
      }
      std::printf("\n");
      EXPECT_GT(share, attenuation < 0.5 ? 0.95 : -1.0);  // in clear water always
      if (range == 2.0) {
        EXPECT_LE(share, last_share);
        EXPECT_GT(across / found, last_across);
        last_share = share, last_across = across / found;
      }
    }
  }
}

// ---- From pictures to a goal

/// A vehicle that is never still.
Pose vehicle_at(double t) {
  return make_pose<double>(1.5 + 0.1 * std::sin(0.5 * t), 1 + 0.08 * std::sin(0.7 * t + 1),
                           1.8 + 0.05 * std::sin(0.4 * t), 0.03 * std::sin(1.1 * t),
                           0.03 * std::sin(1.3 * t), 0.4 + 0.15 * std::sin(0.3 * t));
}

// Half a minute at 100 Hz: pictures at 10 Hz that come 0.1 s late, a second without light, an arm
// that moves across; the goal of the tool, on the moving vehicle.
TEST(Chain, FromPicturesToTheGoalOfTheTool) {
  //! [chain]
  const icat::StereoCamera<double> cameras = icat::parallel_cameras<double>();
  auto robot = icat::uvms(icat::maris_arm<double>(),
                          {.arm = icat::maris_arm_mount<double>(), .camera = mount});
  const std::vector<icat::FrameBox<double>> boxes{
      {robot.frame("link5"), Vector3(-0.12, -0.12, -0.14), Vector3(0.12, 0.12, 0.40)},
      {robot.frame("link7"), Vector3(-0.12, -0.12, -0.14), Vector3(0.12, 0.12, 0.30)}};
  icat::ArmMask arm(robot, robot.frame("camera"), cameras, std::span(boxes));
  icat::StereoPipe<double> eyes(cameras, mount);        // in simulation; else lines from images
  const icat::CylinderPose<double> estimator(cameras);  // lines to a pipe
  icat::FrameTracker<double> tracker(mount);            // from image to image
  icat::PoseHistory<double> history;                    // images arrive late
  const Pose grasp = make_pose<double>(0, 0.1, -0.05, 0, 0.5, 0);  // ⟨g⟩ on the pipe
  //! [chain]
  const int steps = sanitized ? 1300 : 3000;
  const Pose pipe = make_pose<double>(2, 1.2, 4, 0, 0, 0.7);
  double squares = 0, worst = 0;
  int count = 0, pictures = 0, measured = 0;
  for (int k = 0; k < steps; ++k) {
    const double now = 0.01 * k;
    icat::Vector<double, 7> q;
    q << 0.4 * std::sin(0.5 * now), -0.1, 0.2, -0.3 + 0.3 * std::sin(0.4 * now), 0, 0.3, 0;
    ASSERT_EQ(robot.update(q, vehicle_at(now)), Status::ok);
    const bool light = now < 10 || now > 11;
    const Pose there = light ? pipe : make_pose<double>(0, 0, -50, 0, 0, 0);
    //! [loop]
    const Pose vehicle = vehicle_at(now);  // from the navigation
    ASSERT_EQ(arm.update(), Status::ok);
    ASSERT_EQ(history.record(now, vehicle), Status::ok);
    ASSERT_EQ(tracker.predict(vehicle), Status::ok);
    const auto view = eyes.observe(now, vehicle, there, arm.outline());
    if (view) {
      Pose then;  // of the vehicle, at the time of the image
      ASSERT_EQ(history.at(view->time, then), Status::ok);
      const Vector3 gravity = icat::gravity_in_camera(then, mount);
      icat::CylinderMeasurement<double> seen;
      if (estimator.measure(view->value.lines(), gravity, seen) == Status::ok) {
        (void)tracker.update(seen, then);
      } else {
        tracker.miss();
      }
    }
    // While tracker.valid():
    const Pose in_vehicle = tracker.grasp(grasp);                      // ᵛT_g, for the tool
    const Vector3 end = tracker.point_in_camera(Vector3(0, -0.5, 0));  // ᶜp_l, to keep in view
    //! [loop]
    pictures += view.has_value();
    measured += view && tracker.misses() == 0;
    if (tracker.valid() && now >= 2) {
      const Pose goal = vehicle * in_vehicle;
      // Which of both directions was seen first is the tracker's.
      const Pose truth = pipe * grasp,
                 turned = pipe * make_pose<double>(0, 0, 0, 0, 0, std::numbers::pi) * grasp;
      const double error = std::min((goal.translation() - truth.translation()).norm(),
                                    (goal.translation() - turned.translation()).norm());
      squares += error * error;
      worst = std::max(worst, error);
      EXPECT_NEAR(end.norm(), 2, 1);
      ++count;
    }
  }
  std::printf("%d pictures, %d measured; goal off by %.1f mm rms, %.1f mm at worst\n", pictures,
              measured, 1e3 * std::sqrt(squares / count), 1e3 * worst);
  EXPECT_EQ(count, steps - 200);  // never lost
  EXPECT_LT(std::sqrt(squares / count), 0.02);
  EXPECT_LT(worst, 0.06);
}

}  // namespace
