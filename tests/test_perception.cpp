// SPDX-License-Identifier: BSD-3-Clause
// Cameras, contours, the pose of a pipe and its covariance.
#include <gtest/gtest.h>

#include <cstdlib>
#include <numbers>

#include "support/allocation_counter.hpp"
#include "support/chi_square.hpp"
#include "support/pipes.hpp"
#include "support/sanitized.hpp"

namespace {

using icat::Status;
using Vector3 = icat::Vector3<double>;
using Matrix3 = icat::Matrix3<double>;
using Pose = icat::Pose<double>;
using Line = icat::ContourLine<double>;
using Measurement = icat::CylinderMeasurement<double>;
using Estimator = icat::CylinderPose<double>;
using Pixel = icat::Pixel<double>;

const icat::CylinderShape<double> shape{};
const icat::StereoCamera<double> rig = icat::parallel_cameras<double>();
const Vector3 down(0, 0, 1);

/// Accepts whatever can be computed: thresholds have a test of their own.
Estimator tolerant(const icat::StereoCamera<double>& cameras = rig, double gravity_noise = 0) {
  return Estimator(
      cameras,
      {.gravity_noise = gravity_noise, .max_deviation = 1e6, .max_tilt = 1e6, .max_residual = 1e6});
}

/// A rig that is not as parallel and equal as in books.
icat::StereoCamera<double> skewed_rig() {
  auto cameras = rig;
  cameras[0].fx = 1180, cameras[0].cx = 640, cameras[1].fy = 1230, cameras[1].cy = 470;
  cameras[0].pose.linear() = icat::rotation_exp<double>(Vector3(0.02, -0.01, 0.03));
  cameras[1].pose.linear() = icat::rotation_exp<double>(Vector3(-0.03, -0.1, 0.02));
  cameras[1].pose.translation() = Vector3(0.27, 0.01, -0.02);
  return cameras;
}

Pose random_pipe(std::mt19937& rng) {
  std::uniform_real_distribution<double> u(-1, 1);
  const double x = u(rng), y = u(rng), z = u(rng), a = u(rng), b = u(rng), c = u(rng);
  Pose p = support::level_pipe(0.3 * x, 0.3 * y, 2 + z, std::numbers::pi * a);
  p.linear() = icat::rotation_exp<double>(Vector3(0.5 * b, 0.5 * c, 0)) * p.linear();
  // As gravity has it: x level.
  const Vector3 d = p.linear().col(1), level = down - down.dot(d) * d;
  p.linear() << d.cross(level).normalized(), d, level.normalized();
  return p;
}

// ---- Contours

// By the cylinder's surface itself: no point of it is on the wrong side of its contour, and some
// come within a thousandth of the picture's width of it.
TEST(Contours, EnclosesTheCylinder) {
  std::mt19937 rng(1);
  const auto cameras = skewed_rig();
  for (int n = 0; n < (sanitized ? 3 : 20); ++n) {
    const Pose pose = random_pipe(rng);
    for (const Line& line : support::contours(cameras, shape, pose, false)) {
      double nearest = HUGE_VAL, furthest = 0;
      for (int k = 0; k < 2000; ++k) {
        const double angle = std::numbers::pi * k / 100, along = 0.5 * ((k / 200) / 4.5 - 1);
        const Vector3 p(shape.radius * std::sin(angle), along, shape.radius * std::cos(angle));
        const auto& camera = cameras[static_cast<std::size_t>(line.camera)];
        Pixel pixel;
        if (!camera.project(camera.from_rig(pose * p), pixel)) continue;
        nearest = std::min(nearest, line.distance(pixel));
        furthest = std::max(furthest, line.distance(pixel));
      }
      EXPECT_GT(nearest, -1e-9);
      EXPECT_LT(nearest, 1e-3 * furthest);
    }
  }
}

TEST(Contours, SegmentsLieOnTheirLinesAndInTheImage) {
  std::mt19937 rng(2);
  int cut = 0, faces = 0, hidden = 0;
  for (int n = 0; n < 200; ++n) {
    const Pose pose = random_pipe(rng);
    for (int camera = 0; camera < 2; ++camera) {
      for (int side = 0; side < 2; ++side) {
        const auto line = icat::edge_line(rig, camera, shape, pose, side);
        const auto s = icat::edge_segment(rig, camera, shape, pose, side);
        // The half of a rim that bounds the picture has the centre of the end inside of it.
        const auto end = icat::end_segment(rig, camera, shape, pose, side);
        const auto& k = rig[static_cast<std::size_t>(camera)];
        const Vector3 center = k.from_rig(pose * Vector3(0, side - 0.5, 0));
        Pixel inside;
        if (end && k.project(center, inside)) {
          EXPECT_GT(end->line.distance(inside), 0);
          ++(center.dot(pose.linear().col(1)) * (side - 0.5) < 0 ? faces : hidden);
        }
        if (!s) continue;
        ASSERT_TRUE(line);
        for (const Pixel& p : {s->from, s->to}) {
          EXPECT_LT(std::abs(line->distance(p)), 1e-9);
          EXPECT_TRUE(p(0) > -1e-9 && p(0) < 1292 + 1e-9 && p(1) > -1e-9 && p(1) < 964 + 1e-9);
          if (p(0) < 1e-9 || p(1) < 1e-9 || p(0) > 1292 - 1e-9 || p(1) > 964 - 1e-9) ++cut;
        }
        // The nearest point of the pipe is at most r nearer than its axis, the furthest L/2 away.
        EXPECT_NEAR(s->range, pose.translation().norm(), 0.6);
      }
    }
  }
  EXPECT_TRUE(faces > 20 && hidden > 20);
  EXPECT_GT(cut, 20);  // some are cut by the border, or the test says nothing of it
}

TEST(Contours, OfACylinderThatCannotBeSeen) {
  const Pose around = support::level_pipe(0, 0, 0.03, 0), behind = support::level_pipe(0, 0, -2, 0);
  Pose none = support::level_pipe(0, 0, 2, 0);
  none.translation()(1) = NAN;
  for (int side = 0; side < 2; ++side) {
    EXPECT_FALSE(icat::edge_line(rig, 0, shape, around, side));
    EXPECT_FALSE(icat::edge_segment(rig, 0, shape, behind, side));
    EXPECT_FALSE(icat::end_segment(rig, 0, shape, behind, side));
    EXPECT_FALSE(icat::edge_line(rig, 0, shape, none, side));
    EXPECT_FALSE(icat::edge_segment(rig, 0, shape, none, side));
    EXPECT_FALSE(icat::end_segment(rig, 0, shape, none, side));
  }
  // Along the optical axis: the camera looks through the pipe's ends.
  Pose through = support::level_pipe(0.2, 0, 1.5, 0);
  through.linear() = icat::rotation_exp<double>(Vector3(std::numbers::pi / 2, 0, 0));
  EXPECT_TRUE(icat::edge_segment(rig, 0, shape, through, 0));
}

// ---- The pose

// Exact contours of random cylinders: axis and lateral position to 1e-9, from four planes, and from
// every two that are not nearly one; along the axis within what is stated of the rim.
TEST(CylinderPose, ExactContoursGiveTheCylinder) {
  std::mt19937 rng(3);
  const auto cameras = skewed_rig();
  const Estimator estimator = tolerant(cameras);
  double worst = 0, worst_along = 0;
  int pairs = 0, with_end = 0;
  for (int n = 0; n < (sanitized ? 100 : 500); ++n) {
    const Pose pose = random_pipe(rng);
    const auto lines = support::contours(cameras, shape, pose, true);
    Measurement m;
    ASSERT_EQ(estimator.measure(lines, down, m), Status::ok);
    const auto e = support::pipe_error(m.frame, pose);
    worst = std::max({worst, e.lateral, e.components.tail<3>().norm(), m.residual});
    if (m.end_seen) {
      ++with_end;
      EXPECT_LE(e.along, m.rim_error) << n;
      EXPECT_LT(m.rim_error, 0.1);  // 0.5 m of 0.7 m, of which r/D is a tenth
      worst_along = std::max(worst_along, e.along);
    }
    const auto edges = support::contours(cameras, shape, pose, false);
    for (std::size_t i = 0; i < edges.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const Line pair[2] = {edges[i], edges[j]};
        Measurement two;
        if (estimator.measure(pair, down, two) != Status::ok) continue;
        // Two planes that meet at a small angle carry rounding further: 1e-9 of 0.01 rad.
        const auto normal = [&](const Line& l) {
          icat::detail::LinePlane<double> plane;
          plane.set(cameras[static_cast<std::size_t>(l.camera)], l);
          return plane.n;
        };
        if (normal(pair[0]).cross(normal(pair[1])).norm() < 0.01) continue;
        ++pairs;
        const auto e2 = support::pipe_error(two.frame, m.frame);
        worst = std::max({worst, e2.lateral, e2.components.tail<3>().norm()});
      }
    }
  }
  std::printf("exact contours: %.1e, %d pairs; %d with an end, off by up to %.1f mm along\n", worst,
              pairs, with_end, 1e3 * worst_along);
  EXPECT_LT(worst, 1e-9);
  EXPECT_GT(pairs, 400);
  EXPECT_GT(with_end, 50);
}

TEST(CylinderPose, InSinglePrecision) {
  const auto cameras = icat::parallel_cameras<float>();
  const auto pose = support::level_pipe<float>(0.1, -0.1, 2, 0.4);
  const auto lines = support::contours(cameras, icat::CylinderShape<float>{}, pose, true);
  icat::CylinderMeasurement<float> m;
  ASSERT_EQ(icat::CylinderPose<float>(cameras).measure(lines, icat::Vector3<float>(0, 0, 1), m),
            Status::ok);
  const auto e = support::pipe_error(m.frame, pose);
  // ρ of 1000 px has an ε of 6e-5 px, of a pixel of 2 m / 1200; planes meet at 0.1 rad.
  EXPECT_LT(e.lateral, 1e-5f);
  EXPECT_LT(e.tilt, 1e-5f);
}

// The covariance by first order is the square of what a small change of a line does.
TEST(CylinderPose, CovarianceIsThatOfSmallChanges) {
  std::mt19937 rng(4);
  const auto cameras = skewed_rig();
  const Estimator estimator = tolerant(cameras);
  double worst = 0;
  for (int n = 0; n < (sanitized ? 12 : 40); ++n) {
    const Pose pose = random_pipe(rng);
    auto lines = support::contours(cameras, shape, pose, true);
    if (n % 3 == 1) lines = support::contours(cameras, shape, pose, false);  // five degrees
    if (n % 3 == 2) {  // two planes, and lines that do not belong together
      lines.resize(2);
      lines[1] = *icat::edge_line(cameras, 1, shape, pose, 0);
      lines[0].kind = icat::ContourKind::edge;
    }
    if (n % 2 == 0) lines[0].rho += 20, lines[0].theta += 0.01;
    for (std::size_t k = 0; k < lines.size(); ++k) {
      for (int j = 0; j < 2; ++j) {
        auto changed = lines;
        changed[k].covariance(j, j) = 1;
        Measurement m, more, less;
        if (estimator.measure(changed, down, m) != Status::ok) continue;
        const double step = j == 0 ? 1e-6 : 1e-3;
        (j == 0 ? changed[k].theta : changed[k].rho) += step;
        ASSERT_EQ(estimator.measure(changed, down, more), Status::ok);
        (j == 0 ? changed[k].theta : changed[k].rho) -= 2 * step;
        ASSERT_EQ(estimator.measure(changed, down, less), Status::ok);
        icat::Vector6<double> g;
        g << (more.frame.translation() - less.frame.translation()),
            icat::rotation_log<double>(more.frame.linear() * less.frame.linear().transpose());
        g /= 2 * step;
        for (int i = 0; i < 6; i += 3) {
          g.segment<3>(i) = m.frame.linear().transpose() * g.segment<3>(i).eval();
        }
        if (!m.end_seen) {
          EXPECT_EQ(m.covariance(1, 1), HUGE_VAL);
          m.covariance(1, 1) = g(1) = 0;
        }
        const double error = (m.covariance - g * g.transpose()).norm();
        worst = std::max(worst, error / (1e-12 + g.squaredNorm()));
      }
    }
  }
  std::printf("covariance against differences: %.1e\n", worst);
  EXPECT_LT(worst, 1e-4);  // of the differences: second order, and rounding over the step
}

/// So many runs, or as many as ICAT_LIMIT_RUNS says, up to a hundred thousand.
int runs() {
  const char* told = std::getenv("ICAT_LIMIT_RUNS");
  return told ? std::clamp(std::atoi(told), 1000, 100000) : 4000;
}

// Baselines of 0.2 and 0.3 m, 2 m away. With 1 px the deviations are those of the covariance within
// 20 %, of which the number of runs makes 1/√(2n), 1.1 %; what the axis
// tilts, 2 degrees, is no small change any more. With a quarter of it the whole covariance is
// right: the sum of n NEES of k dimensions has the deviation √(2/(k n)) of its mean; five of them,
// and 2 %.
TEST(CylinderPose, NoiseIsWhatTheCovarianceSays) {
  if (sanitized) GTEST_SKIP() << "statistics";
  for (int scene = 0; scene < 8; ++scene) {
    const double baseline = scene % 2 ? 0.3 : 0.2, deviation = scene & 4 ? 0.25 : 1;
    const bool end = (scene & 2) == 0;
    const auto cameras = icat::parallel_cameras<double>(1200, baseline);
    const Pose pose = support::level_pipe(end ? -0.45 : 0.1, 0.1, 2, 0.5);
    const Estimator estimator(cameras, {.gravity_noise = 0.01 * deviation});
    icat::Noise noise(7);
    double squares[6] = {}, sum[6] = {}, expected[6] = {}, nees = 0;
    const int n = runs();
    Measurement exact;
    ASSERT_EQ(estimator.measure(support::contours(cameras, shape, pose, end), down, exact),
              Status::ok);
    ASSERT_EQ(exact.end_seen, end);
    for (int run = 0; run < n; ++run) {
      const auto lines = support::noisy_lines(cameras, pose, end, deviation, noise);
      const Vector3 tilt = noise.vector<double, 3>(0.01 * deviation);
      const Vector3 gravity = icat::detail::times(icat::rotation_exp<double>(tilt), down);
      Measurement m;
      ASSERT_EQ(estimator.measure(lines, gravity, m), Status::ok);
      // The rim has an error of its own: compared with what exact lines give.
      auto e = support::pipe_error(m.frame, exact.frame).components;
      if (!end) m.covariance(1, 1) = 1, e(1) = 0;
      for (int i = 0; i < 6; ++i) {
        squares[i] += e(i) * e(i) / n, sum[i] += e(i) / n, expected[i] += m.covariance(i, i) / n;
      }
      nees += support::normalized_square<6>(m.covariance, e) / n;
    }
    const int degrees = end ? 6 : 5;
    std::printf("%.2f px, baseline %.1f m, %s end, mm and 0.01 deg:", deviation, baseline,
                end ? "with" : "no");
    for (int i = 0; i < 6; ++i) {
      if (i == 1 && !end) continue;
      const double measured = std::sqrt(squares[i]), told = std::sqrt(expected[i]);
      const double unit = i < 3 ? 1e3 : 5730;
      std::printf(" %.2f/%.2f", measured * unit, told * unit);
      EXPECT_NEAR(measured / told, 1, 0.2) << i;
      EXPECT_LT(std::abs(sum[i]), 5 * told / std::sqrt(n) + 0.1 * told) << i;
    }
    std::printf("; NEES %.3f of 1\n", nees / degrees);
    if (deviation < 1) {
      EXPECT_NEAR(nees / degrees, 1, 5 * std::sqrt(2.0 / (degrees * n)) + 0.02);
    }
  }
}

// Out of view of its ends the axis is as good, and the origin is on it.
TEST(CylinderPose, WithoutAnEndOnlyTheOriginIsUnknown) {
  const Estimator estimator(rig);
  const Pose pose = support::level_pipe(0.1, 0.1, 1.1, 0.1);  // 1.2 m of floor are in view
  Measurement m;
  ASSERT_EQ(estimator.measure(support::contours(rig, {.length = 3.0}, pose, true), down, m),
            Status::ok);
  EXPECT_FALSE(m.end_seen);
  EXPECT_EQ(m.covariance(1, 1), HUGE_VAL);
  EXPECT_EQ(m.rim_error, 0);
  const auto e = support::pipe_error(m.frame, pose);
  EXPECT_LT(e.lateral, 1e-9);
  EXPECT_LT(e.components.tail<3>().norm(), 1e-9);
  EXPECT_GT(e.along, 0.05);
  EXPECT_LT(std::abs(m.frame.translation().dot(m.frame.linear().col(1))), 1e-9);  // nearest to ⟨c⟩
}

TEST(CylinderPose, DirectionAndAxesOfTheFrame) {
  const Pose pose = support::level_pipe(-0.4, 0, 2, 0.3);
  const auto lines = support::contours(rig, shape, pose, true);
  Measurement m;
  ASSERT_EQ(Estimator(rig).measure(lines, 9.81 * down, m), Status::ok);
  EXPECT_LT(m.frame.linear()(0, 1), 0);  // towards −x unless told else
  EXPECT_NEAR(m.frame.linear()(2, 2), 1, 1e-9);
  ASSERT_EQ(Estimator(rig, {.towards = Vector3(1, 0, 0)}).measure(lines, down, m), Status::ok);
  EXPECT_GT(m.frame.linear()(0, 1), 0);
  EXPECT_TRUE(icat::is_rigid(m.frame));
}

TEST(CylinderPose, WhatIsRefused) {
  const Estimator estimator(rig);
  const Pose pose = support::level_pipe(0.1, 0, 2, 0.7);
  const auto good = support::contours(rig, shape, pose, false);
  Measurement m;
  ASSERT_EQ(estimator.measure(good, down, m), Status::ok);
  const Measurement before = m;
  const auto expect = [&](Status status, const std::vector<Line>& lines,
                          const Vector3& gravity = down) {
    EXPECT_EQ(estimator.measure(lines, gravity, m), status) << icat::describe(status);
    EXPECT_EQ(m.frame.matrix(), before.frame.matrix());
  };
  expect(Status::not_measured, {});
  expect(Status::not_measured, {good[0]});
  expect(Status::not_measured, {good[0], good[0]});  // one plane
  auto lines = good;
  lines.push_back(good[0]);
  expect(Status::wrong_size, lines);
  for (const double bad : {double(NAN), HUGE_VAL}) {
    for (double Line::*member : {&Line::theta, &Line::rho}) {
      lines = good;
      lines[2].*member = bad;
      expect(Status::non_finite, lines);
    }
    lines = good;
    lines[1].covariance(0, 1) = bad;
    expect(Status::non_finite, lines);
    expect(Status::non_finite, good, Vector3(0, bad, 1));
  }
  lines = good;
  lines[0].camera = 2;
  expect(Status::out_of_range, lines);
  lines = good;
  lines[0].covariance(1, 1) = -1;
  expect(Status::out_of_range, lines);
  expect(Status::out_of_range, good, Vector3::Zero());
  expect(Status::not_measured, good, pose.linear().col(1));  // upright: no down across the axis
  lines = good;
  lines[3].rho += 60;  // 10 cm at 2 m
  expect(Status::outlier, lines);
  // Along the baseline both cameras see one upper contour: what noise makes of it is no axis.
  const auto level = support::contours(rig, shape, support::level_pipe(0, 0.2, 2, 0.002), false);
  std::vector<Line> pair{level[0], level[2]};
  for (Line& l : pair) l.covariance << 1e-6, 0, 0, 1;
  expect(Status::not_measured, pair);
  lines = good;
  lines[0].covariance << 1e-6, 1, 1, 1;  // no covariance: below 0 in a direction
  expect(Status::out_of_range, lines);
  // Normals that point away from it: the same contours are those of a pipe behind the camera.
  for (const std::size_t count : {2u, 4u}) {
    lines.assign(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(count));
    for (Line& l : lines) l.theta += std::numbers::pi, l.rho = -l.rho;
    expect(Status::outlier, lines);
  }
  lines = good;
  lines[0].rho = 1e300;  // finite, and no place in an image
  expect(Status::implausible, lines);
}

TEST(CylinderPose, ConstructionChecks) {
  const auto bad = [&](auto change) {
    Estimator::Options options;
    auto cameras = rig;
    change(options, cameras);
    EXPECT_THROW(Estimator(cameras, options), std::invalid_argument);
  };
  bad([](auto& o, auto&) { o.shape.radius = 0; });
  bad([](auto& o, auto&) { o.shape.length = NAN; });
  bad([](auto& o, auto&) { o.towards.setZero(); });
  bad([](auto& o, auto&) { o.gravity_noise = -1; });
  bad([](auto& o, auto&) { o.max_deviation = 0; });
  bad([](auto& o, auto&) { o.max_tilt = -1; });
  bad([](auto& o, auto&) { o.max_residual = NAN; });
  bad([](auto&, auto& c) { c[0].fx = 0; });
  bad([](auto&, auto& c) { c[1].cy = NAN; });
  bad([](auto&, auto& c) { c[1].pose.linear() *= 2; });
}

TEST(CylinderPose, AllocatesNothing) {
  const Estimator estimator(rig);
  const auto lines = support::contours(rig, shape, support::level_pipe(-0.4, 0.1, 2, 0.5), true);
  Measurement m;
  EXPECT_EQ(count_allocations([&] { ASSERT_EQ(estimator.measure(lines, down, m), Status::ok); }),
            0);
}

}  // namespace
