// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The contour lines of a pipe that a stereo rig on a vehicle detects, without images. [MARIS]
/// names the disturbances of its vision (turbid water, the arm in front of the pipe, ends out of
/// view) and gives no numbers; the model is ours.
///
/// - **Geometry**: both long contours and the half rims of the ends, cut at the border of each
///   image.
/// - **Arm**: what its hulls cover is not seen. With a mask the rest is fitted: the contour goes
///   from its first to its last free point. Without one, the border of the pipe's picture follows
///   the arm: covered points go to the nearest edge of the hull that covers them, and the line is
///   fitted to all of them.
/// - **Water**: the contrast of a contour at the range R is, with the attenuation c of the beam,
///
///       C = C₀ exp(−c R),   seen where C + contrast_noise · normal > threshold
///
///   so the probability to see a line is Φ((C − threshold) / contrast_noise).
/// - **Noise**: both ends of a line move across it by pixel_noise · C₀ / C, since an edge is found
///   the less well the fainter it is. The covariance of the lines says so.
///
/// Pictures are taken in the slots k / rate and handed over `latency` later. Only the noise is
/// random, and its seed is an option: the same calls give the same lines. Each line draws the same
/// number of random numbers in all cases.
#pragma once

#include <array>
#include <optional>
#include <span>

#include "icat/perception/arm_mask.hpp"
#include "icat/perception/cylinder_contours.hpp"
#include "icat/sim/sensors.hpp"

namespace icat {

/// The lines of a pair of images.
template <class Scalar>
struct PipeView {
  std::array<ContourLine<Scalar>, 8> line;  ///< the first `count` mean something
  int count{0};                             ///< 0 … 8

  /// What was found.
  std::span<const ContourLine<Scalar>> lines() const& noexcept {
    return {line.data(), static_cast<std::size_t>(count)};
  }
  /// Of a picture that ends with the expression nothing would be left.
  std::span<const ContourLine<Scalar>> lines() const&& = delete;
};

/// See the file comment.
template <class Scalar>
class StereoPipe {
 public:
  /// m, s, px. Contrast is a share of full light.
  struct Options {
    CylinderShape<Scalar> shape{};  ///< of the pipe
    double rate = 10;               ///< Hz, > 0 [MARIS, IV]
    double latency = 0.1;           ///< s
    double pixel_noise = 0.5;       ///< deviation at full contrast, px
    double attenuation = 0.2;       ///< c, 1/m: 0.2 clear, 1 slightly turbid, 3 very turbid
    double contrast = 0.8;          ///< C₀, in (0, 1]
    double contrast_noise = 0.02;   ///< deviation
    double threshold = 0.1;         ///< >= 0
    double shortest_edge = 60;      ///< of the visible part of a long contour, px, > 0
    double shortest_end = 12;       ///< the same of an end, px, > 0
    bool mask = true;               ///< what the arm covers is known
    std::uint64_t seed = 5;         ///< of all noise
  };

  /// Points of a contour that are asked whether the arm covers them.
  static constexpr int samples = 33;

  /// @param cameras  the rig
  /// @param mount    ⟨c⟩ in ⟨v⟩
  /// @param options  pipe, water, noise
  /// @throws std::invalid_argument on cameras or options out of range.
  StereoPipe(const StereoCamera<Scalar>& cameras, const Pose<Scalar>& mount,
             const Options& options = Options())
      : cameras_(cameras),
        mount_(mount),
        options_(options),
        line_("StereoPipe", options.rate, options.latency),
        noise_(options.seed) {
    const char* const owner = "StereoPipe";
    detail::check_cameras(owner, cameras);
    if (!is_rigid(mount)) detail::invalid(owner, ": the pose of the rig is not rigid");
    detail::require_positive(owner, "radius", options.shape.radius);
    detail::require_positive(owner, "length", options.shape.length);
    detail::require_non_negative(owner, "pixel_noise", options.pixel_noise);
    detail::require_non_negative(owner, "attenuation", options.attenuation);
    detail::require_non_negative(owner, "contrast_noise", options.contrast_noise);
    detail::require_non_negative(owner, "threshold", options.threshold);
    detail::require_positive(owner, "shortest_edge", options.shortest_edge);
    detail::require_positive(owner, "shortest_end", options.shortest_end);
    if (!(options.contrast > 0 && options.contrast <= 1)) {
      detail::invalid(owner, ": contrast must be in (0, 1], got ", options.contrast);
    }
  }

  /// To be called in each step of the simulation: the lines that have arrived at `time`, s, and the
  /// time of their images. An image without any line arrives, too, and so does one of poses that
  /// are not finite. Nothing where the time is not finite; where it is earlier than the last
  /// picture the schedule begins anew. No allocation.
  /// @param time     s
  /// @param vehicle  ⟨v⟩ in ⟨0⟩
  /// @param pipe     ⟨o⟩ in ⟨0⟩
  /// @param arm      what covers the pipe (`ArmMask::outline`); without hulls nothing does
  std::optional<Timed<PipeView<Scalar>>> observe(double time, const Pose<Scalar>& vehicle,
                                                 const Pose<Scalar>& pipe,
                                                 const ArmOutline<Scalar>& arm) noexcept {
    if (line_.due(time)) line_.send(time, picture(vehicle, pipe, arm));
    return line_.receive(time);
  }

  /// One pair of pictures, now, whatever the rate. No allocation.
  PipeView<Scalar> picture(const Pose<Scalar>& vehicle, const Pose<Scalar>& pipe,
                           const ArmOutline<Scalar>& arm) noexcept {
    const Pose<Scalar> rig = detail::compose(vehicle, mount_);
    const Matrix3<Scalar> back = detail::transpose(detail::rotation(rig));
    const Pose<Scalar> seen = detail::make_pose(
        detail::times(back, detail::rotation(pipe)),
        detail::times(back, detail::minus(detail::origin(pipe), detail::origin(rig))));
    PipeView<Scalar> view;
    for (int camera = 0; camera < 2; ++camera) {
      for (int side = 0; side < 2; ++side) {
        const auto edge = edge_segment(cameras_, camera, options_.shape, seen, side);
        add(edge, options_.shortest_edge, arm, view);
        const auto end = end_segment(cameras_, camera, options_.shape, seen, side);
        add(end, options_.shortest_end, arm, view);
      }
    }
    return view;
  }

  /// C of a contour at this range, m.
  double contrast(double range) const noexcept {
    return options_.contrast * std::exp(-options_.attenuation * range);
  }
  /// The probability to see it, if nothing covers it.
  double detection_probability(double range) const noexcept {
    const double above = contrast(range) - options_.threshold;
    if (!(options_.contrast_noise > 0)) return above > 0 ? 1 : 0;
    return 0.5 * std::erfc(-above / (options_.contrast_noise * std::numbers::sqrt2));
  }

 private:
  void add(const std::optional<ContourSegment<Scalar>>& segment, double shortest,
           const ArmOutline<Scalar>& arm, PipeView<Scalar>& view) noexcept {
    const double faint = noise_.normal(), first = noise_.normal(), second = noise_.normal();
    if (!segment) return;
    const double seen = contrast(double(segment->range));
    if (!(seen + options_.contrast_noise * faint > options_.threshold)) return;
    Pixel<Scalar> from = segment->from, to = segment->to;
    if (!uncovered(*segment, arm[static_cast<std::size_t>(segment->line.camera)], from, to)) return;
    const double length = double(std::hypot(to(0) - from(0), to(1) - from(1)));
    if (!(length >= shortest)) return;
    const double deviation = options_.pixel_noise * options_.contrast / seen;
    const Pixel<Scalar> across(std::cos(segment->line.theta), std::sin(segment->line.theta));
    const Scalar a = static_cast<Scalar>(deviation * first);
    const Scalar b = static_cast<Scalar>(deviation * second);
    from = {from(0) + a * across(0), from(1) + a * across(1)};
    to = {to(0) + b * across(0), to(1) + b * across(1)};
    ContourLine<Scalar>& line = view.line[static_cast<std::size_t>(view.count++)];
    line = line_through(from, to, across, static_cast<Scalar>(deviation));
    line.camera = segment->line.camera;
    line.kind = segment->line.kind;
  }

  // From where to where the line finder has points. False where the arm leaves too few.
  bool uncovered(const ContourSegment<Scalar>& segment, const std::vector<ImageHull<Scalar>>& hulls,
                 Pixel<Scalar>& from, Pixel<Scalar>& to) const noexcept {
    std::array<Pixel<Scalar>, samples> points;
    int free = 0, first = -1, last = -1;
    for (int i = 0; i < samples; ++i) {
      const auto k = static_cast<std::size_t>(i);
      points[k] = detail::on_segment(segment.from, segment.to,
                                     static_cast<Scalar>(i) / static_cast<Scalar>(samples - 1));
      bool covered = false;
      for (const ImageHull<Scalar>& hull : hulls) {
        if (!hull.contains(points[k])) continue;
        covered = true;
        if (!options_.mask) points[k] = hull.nearest_edge(points[k]);
        break;
      }
      if (covered) continue;
      if (first < 0) first = i;
      last = i;
      ++free;
    }
    if (free == samples) return true;
    if (free < samples / 4) return false;  // most of it hidden: no contour to find
    if (!options_.mask) return detail::fit_line(points.data(), samples, from, to);
    from = points[static_cast<std::size_t>(first)];
    to = points[static_cast<std::size_t>(last)];
    return true;
  }

  StereoCamera<Scalar> cameras_;
  Pose<Scalar> mount_;
  Options options_;
  detail::SensorLine<PipeView<Scalar>> line_;
  Noise noise_;
};

}  // namespace icat
