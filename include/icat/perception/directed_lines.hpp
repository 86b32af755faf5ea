// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Straight lines in the border of a region of an image, by the vote of its points.
///
///     n = (cosθ, sinθ), into the region;  nᵀ p = ρ
///
/// The normal at a point of the border is known to some degrees, so the point votes only for lines
/// through it within 8° of this. The line with the most votes is fitted by least squares and its
/// points are removed; then the next. Opposite borders of a bar differ by π in θ and are never
/// mixed up. [MARIS, IV] looks for straight regular contours; how is ours.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "icat/core/error.hpp"

namespace icat {

/// A point of a border, px from the middle of the image; n, of length 1, points into the region.
struct BorderPoint {
  float x;            ///< to the right, px
  float y;            ///< down, px
  float nx;           ///< of n
  float ny;           ///< of n
  bool used = false;  ///< by a line that was found
};

/// A line with the region on its positive side, px from the middle of the image.
struct DirectedLine {
  double nx = 1;    ///< cosθ
  double ny = 0;    ///< sinθ
  double rho = 0;   ///< ρ, px
  double low = 0;   ///< where what was seen of it begins, along (−n_y, n_x), px
  double high = 0;  ///< where it ends, px
  int support = 0;  ///< points on it

  /// From (x, y) to the line, > 0 on the region's side, px.
  double distance(double x, double y) const noexcept { return nx * x + ny * y - rho; }
  /// Of the point at `s` along the line.
  double x(double s) const noexcept { return rho * nx - s * ny; }
  /// Of the point at `s` along the line.
  double y(double s) const noexcept { return rho * ny + s * nx; }
  /// Of what was seen, px.
  double length() const noexcept { return high - low; }
};

/// See the file comment.
class DirectedLines {
 public:
  /// Found in one image at most.
  static constexpr std::size_t most = 10;

  /// @param width, height  of the image, px, > 0
  /// @param most_points    of a border
  /// @throws std::invalid_argument on a size out of range.
  DirectedLines(int width, int height, std::size_t most_points = 16384)
      : most_points_(most_points) {
    if (width < 1 || height < 1 || width > 16384 || height > 16384) {
      detail::invalid("DirectedLines: a size must be in 1 … 16384, got ", width, " x ", height);
    }
    offsets_ = static_cast<int>(std::hypot(width, height) / 2) + 4;
    votes_.resize(static_cast<std::size_t>(angles * offsets_));
    points_.reserve(most_points);
  }

  /// Forgets all points. No allocation.
  void clear() noexcept {
    points_.clear();
    count_ = 0;
  }
  /// False where there are too many, or for NaN. No allocation.
  bool add(const BorderPoint& p) noexcept {
    if (points_.size() >= most_points_ || !std::isfinite(p.x + p.y + p.nx + p.ny)) return false;
    points_.push_back(p);
    return true;
  }

  /// The lines of the points, those with most votes first. No allocation.
  void find() noexcept {
    count_ = 0;
    std::fill(votes_.begin(), votes_.end(), 0);
    for (BorderPoint& p : points_) {
      p.used = false;
      vote(p, 1);
    }
    // Of a border without lines each attempt may take few points away, so attempts are counted.
    for (int attempt = 0; attempt < most_attempts && count_ < most; ++attempt) {
      const auto best = std::max_element(votes_.begin(), votes_.end());
      if (*best < fewest_votes) return;
      const int at = static_cast<int>(best - votes_.begin());
      const double angle = at / offsets_ * bin;
      DirectedLine line;
      line.nx = std::cos(angle), line.ny = std::sin(angle);
      line.rho = 2 * (at % offsets_ + 0.5 - offsets_ / 2.0);
      for (const double width : {4.0, 2.5, 2.0}) fit(line, width);
      bool taken = false;
      for (BorderPoint& p : points_) {
        if (p.used || !near(line, p, 3)) continue;
        p.used = taken = true;
        vote(p, -1);
      }
      if (!taken) return;  // the fit has left what voted for it
      if (line.support >= fewest_points) lines_[count_++] = line;
    }
  }

  /// How many were found.
  std::size_t size() const noexcept { return count_; }
  /// No check of `i`.
  const DirectedLine& operator[](std::size_t i) const noexcept { return lines_[i]; }

 private:
  static constexpr int angles = 180;
  static constexpr double bin = 2 * std::numbers::pi / angles;  // 2°; a bin of ρ has 2 px
  static constexpr int fewest_votes = 14, fewest_points = 6, most_attempts = 32;

  void vote(const BorderPoint& p, int weight) noexcept {
    const int first = static_cast<int>(std::lround(std::atan2(p.ny, p.nx) / bin));
    for (int k = first - 4; k <= first + 4; ++k) {
      const int angle = (k + 2 * angles) % angles;
      const double rho = std::cos(angle * bin) * p.x + std::sin(angle * bin) * p.y;
      const double offset = rho / 2 + offsets_ / 2.0;
      if (!(offset >= 1 && offset < offsets_ - 1)) continue;
      int* const at =
          &votes_[static_cast<std::size_t>(angle * offsets_ + static_cast<int>(offset))];
      at[-1] += weight, at[0] += 2 * weight, at[1] += weight;
    }
  }

  static bool near(const DirectedLine& c, const BorderPoint& p, double width) noexcept {
    return std::abs(c.distance(p.x, p.y)) < width && c.nx * p.nx + c.ny * p.ny > 0.94;
  }
  void fit(DirectedLine& c, double width) const noexcept {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
    for (const BorderPoint& p : points_) {
      if (p.used || !near(c, p, width)) continue;
      n += 1, x += p.x, y += p.y;
      xx += p.x * p.x, xy += p.x * p.y, yy += p.y * p.y;
    }
    c.support = static_cast<int>(n);
    if (c.support < fewest_points) return;
    x /= n, y /= n;
    xx -= n * x * x, xy -= n * x * y, yy -= n * y * y;
    const double along = std::atan2(2 * xy, xx - yy) / 2;
    double nx = -std::sin(along), ny = std::cos(along);
    if (nx * c.nx + ny * c.ny < 0) nx = -nx, ny = -ny;
    c.nx = nx, c.ny = ny, c.rho = nx * x + ny * y;
    c.low = 1e9, c.high = -1e9;
    c.support = 0;
    for (const BorderPoint& p : points_) {
      if (p.used || !near(c, p, width)) continue;
      const double s = -ny * p.x + nx * p.y;
      c.low = std::min(c.low, s), c.high = std::max(c.high, s);
      ++c.support;
    }
  }

  std::size_t most_points_;
  int offsets_;
  std::vector<int> votes_;
  std::vector<BorderPoint> points_;
  std::array<DirectedLine, most> lines_{};
  std::size_t count_ = 0;
};

}  // namespace icat
