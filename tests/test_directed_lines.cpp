// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <icat/perception/directed_lines.hpp>
#include <limits>
#include <random>

namespace {

using icat::BorderPoint;
using icat::DirectedLine;
using icat::DirectedLines;

constexpr double pi = std::numbers::pi;

// Points of a segment of the line (θ, ρ), from `low` to `high` along it, on whole pixels.
void add(DirectedLines& lines, double theta, double rho, double low, double high,
         double turned = 0) {
  const double nx = std::cos(theta), ny = std::sin(theta);
  for (double s = low; s <= high; s += 1) {
    const auto x = static_cast<float>(std::round(rho * nx - s * ny));
    const auto y = static_cast<float>(std::round(rho * ny + s * nx));
    const double n = theta + turned * std::sin(1.7 * s);
    ASSERT_TRUE(
        lines.add({x, y, static_cast<float>(std::cos(n)), static_cast<float>(std::sin(n))}));
  }
}

// The line of `lines` that is nearest in both.
const DirectedLine& nearest(const DirectedLines& lines, double theta, double rho) {
  std::size_t best = 0;
  double least = 1e9;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const double turn = std::remainder(std::atan2(lines[i].ny, lines[i].nx) - theta, 2 * pi);
    const double d = std::abs(turn) * 200 + std::abs(lines[i].rho - rho);
    if (d < least) least = d, best = i;
  }
  return lines[best];
}

// A point on whole pixels is 0.3 px off, rms, so a line of 100 px is right to 0.3 px / √100 in ρ
// and √12 / 100 of that in θ: five deviations. The normals are wrong by 4°.
constexpr double rho_bound = 5 * 0.03, theta_bound = 5 * 0.03 * 3.5 / 100;

TEST(DirectedLines, BothSidesOfABarInAllDirections) {
  DirectedLines lines(640, 480);
  for (double theta = -pi; theta <= pi; theta += 0.1) {
    lines.clear();
    add(lines, theta, 20, -80, 60, 0.07);
    add(lines, theta + pi, 15, -50, 90, 0.07);  // the opposite side: 35 px apart
    lines.find();
    ASSERT_EQ(lines.size(), 2u) << theta;
    for (const bool second : {false, true}) {
      const double t = theta + (second ? pi : 0), rho = second ? 15 : 20;
      const DirectedLine& l = nearest(lines, t, rho);
      EXPECT_NEAR(std::remainder(std::atan2(l.ny, l.nx) - t, 2 * pi), 0, theta_bound) << theta;
      EXPECT_NEAR(l.rho, rho, 2 * rho_bound) << theta;  // of the middle, 10 px from the segment's
      EXPECT_NEAR(l.low, second ? -50 : -80, 2);
      EXPECT_NEAR(l.high, second ? 90 : 60, 2);
      EXPECT_NEAR(l.distance(l.x(7), l.y(7)), 0, 1e-9);
    }
  }
}

// Two sides 3 px apart are told apart by their direction alone.
TEST(DirectedLines, SidesOfAThinBarAreNotMixedUp) {
  DirectedLines lines(640, 480);
  add(lines, 0.4, 10, -60, 60);
  add(lines, 0.4 + pi, -7, -60, 60);
  lines.find();
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_LT(lines[0].nx * lines[1].nx + lines[0].ny * lines[1].ny, -0.99);
}

TEST(DirectedLines, ALineInPiecesIsOne) {
  DirectedLines lines(640, 480);
  add(lines, 1.2, -40, -150, -60);
  add(lines, 1.2, -40, 70, 140);
  lines.find();
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_NEAR(lines[0].length(), 290, 3);
}

TEST(DirectedLines, OfNothingNothing) {
  DirectedLines lines(640, 480, 100);
  lines.find();
  EXPECT_EQ(lines.size(), 0u);
  EXPECT_FALSE(lines.add({std::numeric_limits<float>::quiet_NaN(), 0, 1, 0}));
  EXPECT_FALSE(lines.add({0, 0, 1, std::numeric_limits<float>::infinity()}));
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(lines.add({5e8f, 0, 1, 0}));  // far outside
  EXPECT_FALSE(lines.add({0, 0, 1, 0}));                                  // full
  lines.find();
  EXPECT_EQ(lines.size(), 0u);
}

// Points all over with any normal: an end is found, and no line that is not finite.
TEST(DirectedLines, NoiseEnds) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> x(-300, 300), angle(-3.2f, 3.2f);
  DirectedLines lines(640, 640);
  for (int i = 0; i < 16384; ++i) {
    const float a = angle(random);
    ASSERT_TRUE(lines.add({x(random), x(random), std::cos(a), std::sin(a)}));
  }
  lines.find();
  EXPECT_LE(lines.size(), DirectedLines::most);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    EXPECT_TRUE(std::isfinite(lines[i].rho + lines[i].low + lines[i].high));
    EXPECT_NEAR(std::hypot(lines[i].nx, lines[i].ny), 1, 1e-9);
  }
}

TEST(DirectedLines, RefusesSizes) {
  EXPECT_THROW(DirectedLines(0, 10), std::invalid_argument);
  EXPECT_THROW(DirectedLines(10, -1), std::invalid_argument);
  EXPECT_THROW(DirectedLines(20000, 10), std::invalid_argument);
}

}  // namespace
