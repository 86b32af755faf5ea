// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Extracts the contour lines of a pipe from an image, with OpenCV. The program links OpenCV's
/// `core` and `imgproc`; docs/images_and_calibration.md has the lines of CMake.
///
/// The steps are those of [MARIS, IV]; how each is done is ours.
///
///     1. grey world: each channel times the gain that makes the three means equal
///     2. region: hue, saturation and value in a range, at half resolution, less the arm's mask
///     3. straight contours: the border of the region votes for directed lines (θ, ρ), the object
///        on their positive side; two that face each other are the long contours, a short one
///        across them, with all of the pipe on its positive side, an end
///     4. each long contour again at full resolution, to parts of a pixel (opencv_edges.hpp); of an
///        end, half an ellipse, the line through the two points where the long contours touch it
///
/// The distance of that line from the centre of the end is r²/D, with D the distance of the pipe:
/// the error of the origin of a `CylinderPose` is then smaller than its `rim_error`, which is for a
/// line fitted to the whole rim.
///
/// A picture is undistorted before, and a pixel has its centre at whole numbers, as OpenCV's
/// calibration has it. All buffers of this file keep their size from construction on; OpenCV's own
/// functions allocate as they like, so this belongs into a thread of the vision, not of the
/// control.
#pragma once

#include <algorithm>
#include <array>
#include <exception>
#include <opencv2/imgproc.hpp>
#include <span>
#include <vector>

#include "icat/adapters/opencv_edges.hpp"
#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/perception/cylinder_contours.hpp"
#include "icat/perception/directed_lines.hpp"

namespace icat {

/// What a pipe looks like. The colour is that of the trials [MARIS, VI-A2], yellow; the rest is
/// ours and fits pictures of about a megapixel.
struct PipeContoursOptions {
  int hue_min = 22;              ///< of 0 … 255 for a full turn, 31°
  int hue_max = 35;              ///< 49°
  int saturation_min = 63;       ///< of 255
  int value_min = 30;            ///< of 255, after the grey world
  double max_gain = 12;          ///< of a channel of the grey world, >= 1: more is noise
  double min_length = 60;        ///< of each long contour, px, > 0
  double max_convergence = 0.4;  ///< angle between the long contours, rad, in (0, 1)
  double min_support = 0.5;      ///< share of a line that must have an edge, in (0, 1]
  double min_contrast = 8;       ///< of an edge, levels of yellow (opencv_edges.hpp), > 0
  double mask_margin = 6;        ///< the mask of the arm grows by it, px, >= 0
  double deviation = 0.25;       ///< of each end of a line beyond noise, px, > 0: blur, shade
};

/// The pipe in the pictures of one camera. See the file comment.
class PipeContours {
 public:
  /// Lines of one picture at most: two long contours, two ends.
  static constexpr std::size_t most = 4;

  /// @param size     of the pictures, px, at least 64 × 64
  /// @param camera   0 left, 1 right: what the lines carry
  /// @param options  colour, sizes, errors
  /// @throws std::invalid_argument on a size, camera or option out of range.
  PipeContours(cv::Size size, int camera, const PipeContoursOptions& options = {})
      : size_(size),
        half_size_(size.width / 2, size.height / 2),
        camera_(camera),
        o_(options),
        border_(std::max(1, half_size_.width), std::max(1, half_size_.height)) {
    const char* const owner = "PipeContours";
    if (size.width < 64 || size.height < 64) detail::invalid(owner, ": a picture is too small");
    if (camera < 0 || camera > 1) detail::invalid(owner, ": camera must be 0 or 1, got ", camera);
    for (const int level : {o_.hue_min, o_.hue_max, o_.saturation_min, o_.value_min}) {
      if (level < 0 || level > 255) detail::invalid(owner, ": a level of colour is not in 0 … 255");
    }
    if (o_.hue_min > o_.hue_max) detail::invalid(owner, ": hue_min is above hue_max");
    detail::require_positive(owner, "max_gain", o_.max_gain);
    detail::require_positive(owner, "min_length", o_.min_length);
    detail::require_positive(owner, "max_convergence", o_.max_convergence);
    detail::require_positive(owner, "min_support", o_.min_support);
    detail::require_positive(owner, "min_contrast", o_.min_contrast);
    if (!(o_.mask_margin >= 0 && o_.mask_margin < 1000)) {
      detail::invalid(owner, ": mask_margin must be in [0, 1000), got ", o_.mask_margin);
    }
    detail::require_positive(owner, "deviation", o_.deviation);
    if (o_.max_gain < 1) detail::invalid(owner, ": max_gain must be >= 1, got ", o_.max_gain);
    if (o_.max_convergence >= 1) detail::invalid(owner, ": max_convergence must be < 1");
    if (o_.min_support > 1) detail::invalid(owner, ": min_support must be <= 1");
    mask_ = cv::Mat::zeros(half_size_, CV_8U);
    samples_.reserve(2048);
  }

  PipeContours(const PipeContours&) = delete;  ///< a copy would share the buffers
  PipeContours& operator=(const PipeContours&) = delete;
  PipeContours(PipeContours&&) = default;  ///< can be moved

  /// Forgets the arm. No allocation.
  void clear_mask() noexcept {
    mask_.setTo(0);
    masked_ = false;
  }
  /// What this convex polygon covers is the arm, in the pictures to come, until `clear_mask`. It
  /// may lie outside of the picture. `wrong_size` for less than three corners or more than 64,
  /// `non_finite`; both leave the mask as it was.
  Status add_mask(std::span<const Pixel<double>> polygon) noexcept {
    std::array<cv::Point, 64> corners;
    if (polygon.size() < 3 || polygon.size() > corners.size()) return Status::wrong_size;
    constexpr int shift = 4;  // bits of a fraction
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      for (int k = 0; k < 2; ++k) {
        if (!std::isfinite(polygon[i](k))) return Status::non_finite;
        // A corner at infinity, as of a link beside the camera, stays in the range of integers.
        const double x = std::clamp(to_half(polygon[i](k)), -1e4, 1e4) * (1 << shift);
        (k == 0 ? corners[i].x : corners[i].y) = cvRound(x);
      }
    }
    try {
      const int count = static_cast<int>(polygon.size());
      const int margin = 1 + 2 * cvRound(o_.mask_margin / 2);
      cv::fillConvexPoly(mask_, corners.data(), count, 255, cv::LINE_8, shift);
      const cv::Point* const outline = corners.data();
      if (margin > 1) {  // a thick outline grows it
        cv::polylines(mask_, &outline, &count, 1, true, 255, margin, cv::LINE_8, shift);
      }
    } catch (const std::exception&) {
      return Status::numerical_failure;
    }
    masked_ = true;
    return Status::ok;
  }

  /// Looks for the pipe. Anything but `ok` leaves no lines:
  /// - `wrong_size`: not 8 bits in three channels (blue, green, red), or of another size
  /// - `not_measured`: no two long contours in the colour
  /// - `numerical_failure`: OpenCV threw
  Status find(const cv::Mat& bgr) noexcept {
    count_ = 0;
    if (bgr.type() != CV_8UC3 || bgr.size() != size_) return Status::wrong_size;
    try {
      if (!find_region(bgr)) return Status::not_measured;
      find_border();
      border_.find();
      return select(bgr) ? Status::ok : Status::not_measured;
    } catch (const std::exception&) {
      count_ = 0;
      return Status::numerical_failure;
    }
  }

  /// Of the last picture: the two long contours, then the ends, with covariance.
  std::span<const ContourLine<double>> lines() const noexcept { return {lines_.data(), count_}; }
  /// The same with the points from where to where they were seen; their ranges are 0.
  std::span<const ContourSegment<double>> segments() const noexcept {
    return {segments_.data(), count_};
  }
  /// 255 where the colour is that of the pipe, at half resolution.
  const cv::Mat& region() const noexcept { return region_; }
  /// 255 where the arm is, at half resolution.
  const cv::Mat& mask() const noexcept { return mask_; }
  /// Gains of the grey world: blue, green, red.
  const std::array<double, 3>& gains() const noexcept { return gains_; }
  /// As given at construction.
  const PipeContoursOptions& options() const noexcept { return o_; }

 private:
  // A pixel of half resolution covers four: its centre is between theirs.
  static double to_half(double x) noexcept { return (x - 0.5) / 2; }
  static double to_full(double x) noexcept { return 2 * x + 0.5; }
  double middle_x() const noexcept { return (half_size_.width - 1) / 2.0; }
  double middle_y() const noexcept { return (half_size_.height - 1) / 2.0; }

  bool find_region(const cv::Mat& bgr) {
    const cv::Rect even(0, 0, 2 * half_size_.width, 2 * half_size_.height);
    cv::resize(bgr(even), half_, half_size_, 0, 0, cv::INTER_AREA);
    if (masked_) cv::bitwise_not(mask_, unmasked_);
    const cv::Scalar mean = masked_ ? cv::mean(half_, unmasked_) : cv::mean(half_);
    const double grey = (mean[0] + mean[1] + mean[2]) / 3;
    if (!(grey > 1)) return false;  // black
    lut_.create(1, 256, CV_8UC3);
    for (int c = 0; c < 3; ++c) {
      gains_[static_cast<std::size_t>(c)] = std::min(o_.max_gain, grey / std::max(mean[c], 1e-3));
      for (int i = 0; i < 256; ++i) {
        lut_.at<cv::Vec3b>(0, i)[c] =
            cv::saturate_cast<unsigned char>(i * gains_[static_cast<std::size_t>(c)]);
      }
    }
    cv::LUT(half_, lut_, half_);
    cv::cvtColor(half_, hsv_, cv::COLOR_BGR2HSV_FULL);
    cv::inRange(hsv_, cv::Scalar(o_.hue_min, o_.saturation_min, o_.value_min),
                cv::Scalar(o_.hue_max, 255, 255), region_);
    // Few wrong pixels, in or out, do not count.
    cv::medianBlur(region_, region_, 5);
    if (masked_) region_.setTo(0, mask_);
    return true;
  }

  // Where the region ends because the pipe does, not the picture or the view past the arm.
  void find_border() {
    border_.clear();
    if (masked_) cv::dilate(mask_, near_mask_, cv::Mat(), cv::Point(-1, -1), 2);
    cv::findContours(region_, contours_, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
    constexpr int reach = 5;
    for (const std::vector<cv::Point>& contour : contours_) {
      const int n = static_cast<int>(contour.size());
      if (n < 4 * reach) continue;
      const double sign = cv::contourArea(contour, true) > 0 ? 1 : -1;  // which side is inside
      for (int i = 0; i < n; ++i) {
        const cv::Point p = contour[static_cast<std::size_t>(i)];
        if (p.x < 3 || p.y < 3 || p.x >= half_size_.width - 3 || p.y >= half_size_.height - 3 ||
            (masked_ && near_mask_.at<unsigned char>(p))) {
          continue;
        }
        const cv::Point a = contour[static_cast<std::size_t>((i + n - reach) % n)];
        const cv::Point b = contour[static_cast<std::size_t>((i + reach) % n)];
        const double tx = b.x - a.x, ty = b.y - a.y, chord = std::hypot(tx, ty);
        if (chord < reach) continue;  // a corner
        border_.add({static_cast<float>(p.x - middle_x()), static_cast<float>(p.y - middle_y()),
                     static_cast<float>(-sign * ty / chord), static_cast<float>(sign * tx / chord),
                     false});
      }
    }
  }

  // The two long contours and the ends.
  bool select(const cv::Mat& bgr) noexcept {
    const DirectedLine *first = nullptr, *second = nullptr;
    int best = 0;
    for (std::size_t i = 0; i < border_.size(); ++i) {
      for (std::size_t j = i + 1; j < border_.size(); ++j) {
        const DirectedLine &a = border_[i], &b = border_[j];
        if (a.support + b.support > best && faces(a, b)) {
          first = &a, second = &b;
          best = a.support + b.support;
        }
      }
    }
    if (!first) return false;
    const detail::EdgePicture picture{bgr, masked_ ? mask_ : none_, gains_, o_.min_contrast};
    if (!add_edge(picture, *first) || !add_edge(picture, *second)) {
      count_ = 0;
      return false;
    }
    for (std::size_t i = 0; i < border_.size() && count_ < most; ++i) {
      const DirectedLine& c = border_[i];
      if (&c != first && &c != second && ends(c, *first, *second)) (void)add_end(picture, c);
    }
    return true;
  }

  bool faces(const DirectedLine& a, const DirectedLine& b) const noexcept {
    const double shortest = o_.min_length / 2;
    if (a.length() < shortest || b.length() < shortest) return false;
    if (-(a.nx * b.nx + a.ny * b.ny) < std::cos(o_.max_convergence)) return false;
    const double s = (a.low + a.high) / 2, t = (b.low + b.high) / 2;
    const double gap = b.distance(a.x(s), a.y(s)), other = a.distance(b.x(t), b.y(t));
    if (gap < 4 || other < 4) return false;
    // Longer than wide, and beside each other: a's ends, from b.
    const double p = -b.ny * a.x(a.low) + b.nx * a.y(a.low);
    const double q = -b.ny * a.x(a.high) + b.nx * a.y(a.high);
    const double common = std::min(b.high, std::max(p, q)) - std::max(b.low, std::min(p, q));
    return common > 0.5 * std::min(a.length(), b.length()) &&
           std::max(a.length(), b.length()) > 1.2 * std::max(gap, other);
  }

  bool ends(const DirectedLine& c, const DirectedLine& a, const DirectedLine& b) const noexcept {
    const double s = (c.low + c.high) / 2, x = c.x(s), y = c.y(s);
    const double from_a = a.distance(x, y), from_b = b.distance(x, y);
    const double width = from_a + from_b;
    if (from_a < 0.25 * width || from_b < 0.25 * width) return false;
    if (c.length() < 0.4 * width || c.length() > 1.3 * width) return false;
    if (std::abs(c.nx * a.nx + c.ny * a.ny) > 0.6) return false;
    for (const DirectedLine* const e : {&a, &b}) {  // all of the pipe is on one side
      for (const double t : {e->low, e->high}) {
        if (c.distance(e->x(t), e->y(t)) < -0.25 * width) return false;
      }
    }
    return true;
  }

  // A long contour at full resolution. False where too little of it is an edge.
  bool add_edge(const detail::EdgePicture& picture, const DirectedLine& c) noexcept {
    const double low = 2 * c.low + 6, high = 2 * c.high - 6, middle = (low + high) / 2;
    if (!(high - low >= o_.min_length)) return false;
    const double u = to_full(middle_x() + c.x(middle / 2));
    const double v = to_full(middle_y() + c.y(middle / 2));
    samples_.clear();
    int asked = 0;
    for (double s = low - middle; s <= high - middle; s += 2) {
      const double x = u - s * c.ny, y = v + s * c.nx;
      double across = 0;
      if (!picture.open(x, y)) continue;
      ++asked;
      if (samples_.size() < samples_.capacity() && picture.edge(x, y, c.nx, c.ny, 6, across)) {
        samples_.push_back({s, across, 0});
      }
    }
    detail::EdgeFit fit;
    if (!fit.fit(samples_, false, 0.7) || fit.count < o_.min_support * asked) return false;
    const auto point = [&](double s) {
      const double across = fit.offset + fit.slope * s;
      return Pixel<double>(u - s * c.ny + across * c.nx, v + s * c.nx + across * c.ny);
    };
    put(ContourKind::edge, point(low - middle), point(high - middle), c.nx, c.ny, point(0), fit);
    return true;
  }

  // An end: half an ellipse between the long contours. The line through its two outermost points.
  bool add_end(const detail::EdgePicture& picture, const DirectedLine& c) noexcept {
    const double u0 = to_full(middle_x() + c.x(0)), v0 = to_full(middle_y() + c.y(0));
    // Where the line c meets the long contours, along it; e: their direction, into the pipe.
    std::array<double, 2> met{};
    double ex = 0, ey = 0;
    for (std::size_t k = 0; k < 2; ++k) {
      const ContourLine<double>& l = lines_[k];
      const double nx = std::cos(l.theta), ny = std::sin(l.theta);
      const double steep = -nx * c.ny + ny * c.nx;
      if (std::abs(steep) < 0.3) return false;
      met[k] = -l.distance({u0, v0}) / steep;
      const double sign = -ny * c.nx + nx * c.ny > 0 ? 1 : -1;
      ex -= sign * ny, ey += sign * nx;
    }
    const double length = std::hypot(ex, ey), width = std::abs(met[1] - met[0]);
    const double middle = (met[0] + met[1]) / 2;
    if (!(length > 1) || !(width > 8)) return false;
    ex /= length, ey /= length;
    const double u = u0 - middle * c.ny, v = v0 + middle * c.nx;
    const int reach = std::clamp(cvRound(0.4 * width), 8, detail::EdgePicture::farthest);
    constexpr int count = 48;
    samples_.clear();
    int asked = 0;
    for (int k = 0; k < count; ++k) {
      const double angle = (k + 0.5) * CV_PI / count, s = -std::cos(angle) * width / 2;
      if (width / 2 - std::abs(s) < 2.5) continue;  // the long contour is too near
      const double x = u - s * c.ny, y = v + s * c.nx;
      double across = 0;
      if (!picture.open(x, y)) continue;
      ++asked;
      if (picture.edge(x, y, ex, ey, reach, across)) {
        samples_.push_back({s, across, std::sin(angle)});
      }
    }
    detail::EdgeFit fit;
    if (asked < count / 3 || !fit.fit(samples_, true, 1.5) || fit.count < o_.min_support * asked ||
        std::abs(fit.height) > width) {
      return false;
    }
    const auto point = [&](double s) {
      const double across = fit.offset + fit.slope * s;
      return Pixel<double>(u - s * c.ny + across * ex, v + s * c.nx + across * ey);
    };
    put(ContourKind::end, point(-width / 2), point(width / 2), ex, ey, point(0), fit);
    return true;
  }

  // Back to (θ, ρ), about `middle`, where offset and slope are.
  void put(ContourKind kind, const Pixel<double>& from, const Pixel<double>& to, double nx,
           double ny, const Pixel<double>& middle, const detail::EdgeFit& fit) noexcept {
    ContourSegment<double>& segment = segments_[count_];
    segment.from = from, segment.to = to;
    segment.line = line_through<double>(from, to, {nx, ny}, 1);
    // Samples 2 px apart share pixels: half of them count. `deviation` is that of an end.
    const double length = std::hypot(to(0) - from(0), to(1) - from(1));
    const double shared = o_.deviation * o_.deviation;
    const double angle = 2 * fit.covariance[1][1] + 2 * shared / (length * length);
    const double across = 2 * fit.covariance[0][0] + shared / 2;
    const double mixed = 2 * fit.covariance[0][1];
    const double theta = segment.line.theta;
    const double t = std::cos(theta) * middle(1) - std::sin(theta) * middle(0);  // dρ/dθ
    // θ grows as the slope does where the normal is a quarter turn ahead of the line: as here, a
    // positive slope moves later points along n, which turns n back.
    segment.line.camera = camera_;
    segment.line.kind = kind;
    segment.line.covariance(0, 0) = angle;
    segment.line.covariance(0, 1) = segment.line.covariance(1, 0) = t * angle - mixed;
    segment.line.covariance(1, 1) = across + t * t * angle - 2 * t * mixed;
    lines_[count_++] = segment.line;
  }

  cv::Size size_, half_size_;
  int camera_;
  PipeContoursOptions o_;
  bool masked_ = false;
  std::array<double, 3> gains_{1, 1, 1};
  const cv::Mat none_;
  cv::Mat half_, hsv_, region_, mask_, unmasked_, near_mask_, lut_;
  std::vector<std::vector<cv::Point>> contours_;
  DirectedLines border_;
  std::vector<detail::EdgeSample> samples_;
  std::size_t count_ = 0;
  std::array<ContourSegment<double>, most> segments_{};
  std::array<ContourLine<double>, most> lines_{};
};

}  // namespace icat
