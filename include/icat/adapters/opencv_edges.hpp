// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A line that is known to some pixels, to parts of one: where along short profiles across it the
/// colour of a picture changes most, and the line of least squares through these points. Used by
/// opencv.hpp.
///
///     yellow = 255 ((R + G)/2 − B) / (R + G + B)     after the grey world
///
/// A share, since a pipe is dark at its contours, where it turns away from the light: the edge of
/// its brightness lies inside of the pipe.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "icat/perception/camera.hpp"

namespace icat::detail {

/// A picture in which edges are looked for. Refers to what it is made of.
struct EdgePicture {
  const cv::Mat& bgr;                  // CV_8UC3
  const cv::Mat& mask;                 // half resolution, 255: the arm; or empty
  const std::array<double, 3>& gains;  // blue, green, red
  double contrast;                     // least rise within 3 px, levels

  /// Whether there is something to see.
  bool open(double u, double v) const noexcept {
    if (!(u >= 0 && v >= 0 && u < bgr.cols - 1 && v < bgr.rows - 1)) return false;
    const int i = std::min(static_cast<int>(u / 2), mask.cols - 1);
    const int j = std::min(static_cast<int>(v / 2), mask.rows - 1);
    return mask.empty() || mask.at<unsigned char>(j, i) == 0;
  }

  /// Between pixels.
  double yellow(double u, double v) const noexcept {
    const int i = static_cast<int>(u), j = static_cast<int>(v);
    const double a = u - i, b = v - j;
    const cv::Vec3b* const top = bgr.ptr<cv::Vec3b>(j) + i;
    const cv::Vec3b* const low = bgr.ptr<cv::Vec3b>(j + 1) + i;
    double sum = 0, total = 10;  // of next to no light no colour
    for (int c = 0; c < 3; ++c) {
      const double grey =
          gains[static_cast<std::size_t>(c)] * ((1 - b) * ((1 - a) * top[0][c] + a * top[1][c]) +
                                                b * ((1 - a) * low[0][c] + a * low[1][c]));
      sum += (c == 0 ? -1 : 0.5) * grey;
      total += grey;
    }
    return 255 * sum / total;
  }

  /// How far from (u, v) along (dx, dy), of length 1, yellow rises most, px, within ±`reach` (at
  /// most `farthest`). False where it does not, or outside of the picture.
  bool edge(double u, double v, double dx, double dy, int reach, double& at) const noexcept {
    std::array<double, 2 * (farthest + wing) + 1> profile;
    const int n = reach + wing;
    for (int k = -n; k <= n; ++k) {
      const double x = u + k * dx, y = v + k * dy;
      if (!(x >= 0 && y >= 0 && x < bgr.cols - 1 && y < bgr.rows - 1)) return false;
      profile[static_cast<std::size_t>(k + n)] = yellow(x, y);
    }
    const auto rise = [&](int k) {
      const double* const p = &profile[static_cast<std::size_t>(k + n)];
      return (p[2] + p[1] - p[-1] - p[-2]) / 2;
    };
    int best = -reach;
    for (int k = -reach; k <= reach; ++k) {
      if (rise(k) > rise(best)) best = k;
    }
    if (std::abs(best) == reach || rise(best) < contrast) return false;
    const double before = rise(best - 1), top = rise(best), after = rise(best + 1);
    const double bend = before - 2 * top + after;
    at = best + (bend < 0 ? 0.5 * (before - after) / bend : 0);
    return true;
  }

  static constexpr int farthest = 60, wing = 2;
};

/// An edge found at `along` a line, `across` it, px; `bulge` is what a third coefficient
/// multiplies.
struct EdgeSample {
  double along, across, bulge;
  bool taken = true;
};

/// across = offset + slope · along [+ height · bulge], by least squares, without what is further
/// off than 2.5 deviations, `gate` px at least.
struct EdgeFit {
  double offset = 0, slope = 0, height = 0;
  double variance = 0;           // of one sample, px²
  int count = 0;                 // samples taken
  double covariance[2][2] = {};  // of offset and slope, of independent samples

  bool fit(std::vector<EdgeSample>& samples, bool bulging, double gate) noexcept {
    const int m = bulging ? 3 : 2;
    for (int round = 0; round < 4; ++round) {
      double A[3][3] = {}, right[3] = {}, inverse[3][3];
      count = 0;
      for (const EdgeSample& s : samples) {
        if (!s.taken) continue;
        ++count;
        const double row[3] = {1, s.along, s.bulge};
        for (int i = 0; i < m; ++i) {
          right[i] += row[i] * s.across;
          for (int j = 0; j < m; ++j) A[i][j] += row[i] * row[j];
        }
      }
      if (count < 8 || !invert(A, m, inverse)) return false;
      double x[3] = {};
      for (int i = 0; i < m; ++i) {
        for (int j = 0; j < m; ++j) x[i] += inverse[i][j] * right[j];
      }
      offset = x[0], slope = x[1], height = x[2];
      const auto residual = [&](const EdgeSample& s) {
        return s.across - offset - slope * s.along - height * s.bulge;
      };
      variance = 0;
      for (const EdgeSample& s : samples) variance += s.taken ? residual(s) * residual(s) : 0;
      variance /= count - m;
      for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < 2; ++j) covariance[i][j] = variance * inverse[i][j];
      }
      if (round == 3) break;
      const double allowed = std::max(gate, 2.5 * std::sqrt(variance));
      for (EdgeSample& s : samples) s.taken = std::abs(residual(s)) < allowed;
    }
    return std::isfinite(offset + slope + height + variance);
  }

 private:
  // Gauss and Jordan, of a positive definite matrix. False where it is not.
  static bool invert(double (&A)[3][3], int m, double (&inverse)[3][3]) noexcept {
    double scale[3];
    for (int i = 0; i < m; ++i) {
      scale[i] = A[i][i];
      for (int j = 0; j < m; ++j) inverse[i][j] = i == j ? 1 : 0;
    }
    for (int k = 0; k < m; ++k) {
      if (!(A[k][k] > 1e-9 * scale[k])) return false;
      const double pivot = A[k][k];
      for (int j = 0; j < m; ++j) A[k][j] /= pivot, inverse[k][j] /= pivot;
      for (int i = 0; i < m; ++i) {
        if (i == k) continue;
        const double factor = A[i][k];
        for (int j = 0; j < m; ++j) {
          A[i][j] -= factor * A[k][j];
          inverse[i][j] -= factor * inverse[k][j];
        }
      }
    }
    return true;
  }
};

}  // namespace icat::detail
