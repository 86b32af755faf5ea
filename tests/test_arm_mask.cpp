// SPDX-License-Identifier: BSD-3-Clause
// Where the arm is in both images.
#include <gtest/gtest.h>

#include <icat/perception/arm_mask.hpp>
#include <random>

#include "support/allocation_counter.hpp"
#include "support/sanitized.hpp"
#include "support/states.hpp"

namespace {

using icat::Status;
using Vector3 = icat::Vector3<double>;
using Pose = icat::Pose<double>;
using Pixel = icat::Pixel<double>;

const auto rig = icat::parallel_cameras<double>();

TEST(ImageHull, HoldsWhatItsPointsEnclose) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> u(-100, 100);
  for (int n = 0; n < (sanitized ? 9 : 100); ++n) {
    std::vector<Pixel> points(static_cast<std::size_t>(3 + 2 * n % 18));
    for (Pixel& p : points) p = {u(rng), u(rng)};
    icat::ImageHull<double> hull;
    hull.set(points);
    for (int k = 0; k < 20; ++k) {
      // Inside: a mean with random weights. Any point: by the lines through every two points.
      Pixel inside(0, 0);
      double sum = 0;
      for (const Pixel& p : points) {
        const double w = 0.01 + std::abs(u(rng));
        inside += w * p, sum += w;
      }
      EXPECT_TRUE(hull.contains(inside / sum));
      const Pixel any(u(rng), u(rng));
      bool outside = false;
      for (const Pixel& a : points) {
        for (const Pixel& b : points) {
          const auto side = [&](const Pixel& p) {
            return (b(0) - a(0)) * (p(1) - a(1)) - (b(1) - a(1)) * (p(0) - a(0));
          };
          bool border = &a != &b;
          for (const Pixel& p : points) border = border && side(p) >= -1e-9;
          outside = outside || (border && side(any) < 0);
        }
      }
      EXPECT_EQ(hull.contains(any), !outside);
      double low = 0, high = 0;
      const Pixel q(u(rng), u(rng));
      const bool covered = hull.covers(any, q, low, high);
      for (int s = 0; s <= 20; ++s) {
        const bool within = covered && s / 20.0 >= low && s / 20.0 <= high;
        EXPECT_EQ(hull.contains(any + s / 20.0 * (q - any)), within);
      }
      // The nearest point of the edge is on it, and no corner is nearer.
      const Pixel edge = hull.nearest_edge(any), in = inside / sum;
      EXPECT_TRUE(hull.contains(edge + 1e-6 * (in - edge)));
      EXPECT_FALSE(hull.contains(edge - 1e-6 * (in - edge)));
      for (const Pixel& c : hull.corners()) {
        EXPECT_LE((edge - any).norm(), (c - any).norm() + 1e-9);
      }
    }
  }
  icat::ImageHull<double> hull;
  const std::vector<Pixel> flat{{0, 0}, {1, 1}, {2, 2}, {2, 2}}, none{{0, 0}, {1, NAN}, {2, 0}};
  for (const auto& points : {flat, none, std::vector<Pixel>{}}) {
    hull.set(points);
    EXPECT_EQ(hull.corners().size(), 0u);
    EXPECT_FALSE(hull.contains({1, 1}));
    double low, high;
    EXPECT_FALSE(hull.covers({0, 0}, {2, 2}, low, high));
  }
}

// Points of the boxes in front of a camera are hidden, and nothing beyond the corners of the boxes,
// also where the camera sits in the middle of the arm.
TEST(ArmMask, IsThePictureOfTheBoxes) {
  auto robot = testing_support::make_robot<double>();
  const std::vector<icat::FrameBox<double>> boxes{
      {robot.frame("link5"), Vector3(-0.12, -0.12, -0.14), Vector3(0.12, 0.12, 0.40)},
      {robot.frame("link7"), Vector3(-0.12, -0.12, -0.14), Vector3(0.12, 0.12, 0.30)}};
  icat::ArmMask mask(robot, robot.frame("camera"), rig, std::span(boxes));
  int whole = 0, cut = 0, empty = 0;
  for (const auto& state : testing_support::random_states<double>(sanitized ? 30 : 100, 6)) {
    ASSERT_EQ(robot.update(state.q, state.vehicle), Status::ok);
    EXPECT_EQ(count_allocations([&] { EXPECT_EQ(mask.update(), Status::ok); }), 0);
    const Pose back = robot.pose(robot.frame("camera")).inverse();
    for (std::size_t n = 0; n < 4; ++n) {
      const auto& box = boxes[n / 2];
      const int camera = static_cast<int>(n % 2);
      const auto& k = rig[n % 2];
      const auto corners = mask.outline()[n % 2][n / 2].corners();
      Pixel middle(0, 0);
      for (const Pixel& c : corners) middle += c / static_cast<double>(corners.size());
      std::vector<Pixel> pictures;  // of the box's corners
      int before = 0, behind = 0;
      for (int i = 0; i < 216; ++i) {
        const Vector3 share((i % 6) / 5.0, (i / 6 % 6) / 5.0, (i / 36) / 5.0);
        const Vector3 point = box.lower + share.cwiseProduct(box.upper - box.lower);
        const Vector3 at = k.from_rig(back * robot.pose(box.frame) * point);
        Pixel p;
        if (at(2) < 0.051 || !k.project(at, p)) {
          ++behind;
          continue;
        }
        ++before;
        if ((share.array() * (1 - share.array())).sum() < 1e-9) pictures.push_back(p);
        ASSERT_TRUE(mask.hides(camera, p + 1e-9 * (middle - p)));  // but for rounding
      }
      if (before == 0) {
        ++empty;
      } else if (behind > 0) {
        ++cut;
      } else {
        ++whole;
        for (const Pixel& c : corners) {
          double nearest = HUGE_VAL;
          for (const Pixel& p : pictures) nearest = std::min(nearest, (p - c).norm());
          EXPECT_LT(nearest, 1e-6);
        }
      }
    }
  }
  EXPECT_GT(whole, 5);
  EXPECT_GT(cut, 5);
  EXPECT_GT(empty, 5);
}

TEST(ArmMask, ConstructionChecks) {
  const auto robot = testing_support::make_robot<double>();
  const auto camera = robot.frame("camera");
  using Boxes = std::vector<icat::FrameBox<double>>;
  const auto make = [&](icat::FrameId frame, const Boxes& boxes) {
    return icat::ArmMask(robot, frame, rig, std::span(boxes));
  };
  EXPECT_THROW(make(icat::FrameId(99), {}), std::invalid_argument);
  EXPECT_THROW(make(camera, {{icat::FrameId(99), Vector3(0, 0, 0), Vector3(1, 1, 1)}}),
               std::invalid_argument);
  EXPECT_THROW(make(camera, {{camera, Vector3(0, 0, 0), Vector3(1, 0, 1)}}), std::invalid_argument);
  EXPECT_THROW(make(camera, {{camera, Vector3(0, 0, 0), Vector3(1, NAN, 1)}}),
               std::invalid_argument);
  EXPECT_FALSE(make(camera, {}).hides(0, {100, 100}));
}

}  // namespace
