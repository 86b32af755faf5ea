// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A calibrated pair of pinhole cameras and oriented lines in their images.
///
///     (u, v, 1)ᵀ ∝ K ⟨k⟩p,   K = [f_x 0 c_x; 0 f_y c_y; 0 0 1]
///     line:  cosθ u + sinθ v − ρ = 0,  > 0 on the side of the object
///
/// ⟨k⟩ is a camera: z along its optical axis, x right and y down in the image. ⟨c⟩ is the rig, by
/// custom its left camera. Images are rectified: no distortion. [MARIS, VI-A] calibrates the
/// pinhole model in water, since the exact model of a camera behind a flat port is impractical.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "icat/core/error.hpp"
#include "icat/math/rigid_motion.hpp"

namespace icat {

/// (u, v), u to the right and v down, px.
template <class Scalar>
using Pixel = Vector<Scalar, 2>;

/// One camera of a rig.
template <class Scalar>
struct PinholeCamera {
  Scalar fx;                           ///< focal length, px, > 0
  Scalar fy;                           ///< the same downwards
  Scalar cx;                           ///< principal point, px
  Scalar cy;                           ///< the same downwards
  Scalar width;                        ///< of the image, px, > 0: u in [0, width]
  Scalar height;                       ///< of the image, px, > 0: v in [0, height]
  Pose<Scalar> pose = IdentityPose{};  ///< ⟨k⟩ in ⟨c⟩

  /// Points nearer to the image plane than this have no image, m.
  static constexpr double nearest = 0.05;

  /// The image of `point` (in ⟨k⟩, m). False, and `pixel` stays, where it is nearer than `nearest`
  /// along the axis, or NaN. It may lie outside of the image. No allocation.
  bool project(const Vector3<Scalar>& point, Pixel<Scalar>& pixel) const noexcept {
    if (!(point(2) >= static_cast<Scalar>(nearest)) || !detail::all_finite(point)) return false;
    pixel(0) = cx + fx * point(0) / point(2);
    pixel(1) = cy + fy * point(1) / point(2);
    return true;
  }
  /// Whether the image holds it; false for NaN. No allocation.
  bool contains(const Pixel<Scalar>& p) const noexcept {
    return p(0) >= Scalar(0) && p(0) <= width && p(1) >= Scalar(0) && p(1) <= height;
  }
  /// `point` of ⟨c⟩ in ⟨k⟩, m. No allocation.
  Vector3<Scalar> from_rig(const Vector3<Scalar>& point) const noexcept {
    return detail::transposed_times(detail::rotation(pose),
                                    detail::minus(point, detail::origin(pose)));
  }
};

/// Both cameras, 0 left, 1 right.
template <class Scalar>
using StereoCamera = std::array<PinholeCamera<Scalar>, 2>;

/// Two equal cameras side by side that look the same way, ⟨c⟩ the left one. The images of the
/// published rig have 1292 × 964 pixels; its focal length and baseline are not printed, and the
/// defaults are ours.
/// @param focal_length  px
/// @param baseline      m
/// @param width, height px
template <class Scalar>
StereoCamera<Scalar> parallel_cameras(Scalar focal_length = Scalar(1200),
                                      Scalar baseline = static_cast<Scalar>(0.25),
                                      Scalar width = Scalar(1292),
                                      Scalar height = Scalar(964)) noexcept {
  PinholeCamera<Scalar> left{focal_length,       focal_length, width / Scalar(2),
                             height / Scalar(2), width,        height};
  PinholeCamera<Scalar> right = left;
  right.pose = detail::make_pose(detail::identity<Matrix3<Scalar>>(3),
                                 Vector3<Scalar>(baseline, Scalar(0), Scalar(0)));
  return {left, right};
}

/// The part of the cylinder that a line is the image of.
enum class ContourKind {
  edge,  ///< one of the two long contours
  end    ///< the short contour at an end
};

/// A line in one of the images, with the object on its positive side.
template <class Scalar>
struct ContourLine {
  int camera{0};                                       ///< 0 left, 1 right
  ContourKind kind{ContourKind::edge};                 ///< of what
  Scalar theta{0};                                     ///< θ, rad, of the normal
  Scalar rho{0};                                       ///< ρ, px
  Eigen::Matrix<Scalar, 2, 2> covariance = Filled{0};  ///< of (θ, ρ), rad², rad px, px²

  /// cosθ u + sinθ v − ρ: the distance from the line, > 0 on the side of the object, px.
  Scalar distance(const Pixel<Scalar>& p) const noexcept {
    return std::cos(theta) * p(0) + std::sin(theta) * p(1) - rho;
  }
};

/// The line through two pixels, with its normal on the side of `towards` (a direction in the
/// image). Both ends have an error of `deviation` (px) across the line, independent of each other:
///
///     var θ = 2σ²/l²,  ρ = offset at the middle + t θ,  var offset = σ²/2
///
/// t is where the middle lies along the line, so θ and ρ are correlated. Two equal pixels give NaN,
/// which every estimator refuses. No allocation.
template <class Scalar>
ContourLine<Scalar> line_through(const Pixel<Scalar>& from, const Pixel<Scalar>& to,
                                 const Pixel<Scalar>& towards, Scalar deviation) noexcept {
  const Scalar x = to(0) - from(0), y = to(1) - from(1);
  const Scalar length = std::hypot(x, y);
  Scalar nx = -y / length, ny = x / length;
  if (nx * towards(0) + ny * towards(1) < Scalar(0)) nx = -nx, ny = -ny;
  const Scalar mx = (from(0) + to(0)) / Scalar(2), my = (from(1) + to(1)) / Scalar(2);
  const Scalar t = nx * my - ny * mx;  // dρ/dθ at the middle
  const Scalar variance = deviation * deviation;
  const Scalar angle = Scalar(2) * variance / (length * length);
  ContourLine<Scalar> line;
  line.theta = std::atan2(ny, nx);
  line.rho = nx * mx + ny * my;
  line.covariance(0, 0) = angle;
  line.covariance(0, 1) = line.covariance(1, 0) = t * angle;
  line.covariance(1, 1) = variance / Scalar(2) + t * t * angle;
  return line;
}

namespace detail {

/// Throws unless both cameras can take pictures.
template <class Scalar>
[[gnu::cold]] void check_cameras(const char* owner, const StereoCamera<Scalar>& cameras) {
  for (const PinholeCamera<Scalar>& k : cameras) {
    require_positive(owner, "fx", k.fx);
    require_positive(owner, "fy", k.fy);
    require_positive(owner, "width", k.width);
    require_positive(owner, "height", k.height);
    if (!std::isfinite(k.cx) || !std::isfinite(k.cy)) {
      invalid(owner, ": the principal point is not finite");
    }
    if (!is_rigid(k.pose)) invalid(owner, ": the pose of a camera is not rigid");
  }
}

/// The part of `from` … `to` between the shares `low` and `high` of it where a linear function that
/// is `a` at `from` and `b` at `to` is >= 0. False where none is left.
template <class Scalar>
bool clip(Scalar a, Scalar b, Scalar& low, Scalar& high) noexcept {
  if (!(a >= Scalar(0)) && !(b >= Scalar(0))) return false;
  if (a < Scalar(0)) {
    low = std::max(low, a / (a - b));
  } else if (b < Scalar(0)) {
    high = std::min(high, a / (a - b));
  }
  return low < high;
}

/// a + s (b − a)
template <class Scalar>
Pixel<Scalar> on_segment(const Pixel<Scalar>& a, const Pixel<Scalar>& b, Scalar s) noexcept {
  return {a(0) + s * (b(0) - a(0)), a(1) + s * (b(1) - a(1))};
}

/// The line of least squares of the distances of `count` >= 2 points; `from` and `to` are the
/// first and the last of them on it. False where the points have no direction.
template <class Scalar>
bool fit_line(const Pixel<Scalar>* points, int count, Pixel<Scalar>& from,
              Pixel<Scalar>& to) noexcept {
  Scalar mx(0), my(0), xx(0), xy(0), yy(0);
  for (int i = 0; i < count; ++i) {
    mx += points[i](0) / static_cast<Scalar>(count);
    my += points[i](1) / static_cast<Scalar>(count);
  }
  for (int i = 0; i < count; ++i) {
    const Scalar x = points[i](0) - mx, y = points[i](1) - my;
    xx += x * x, xy += x * y, yy += y * y;
  }
  if (!(xx + yy > Scalar(0)) || !std::isfinite(xx + yy)) return false;
  const Scalar angle = std::atan2(Scalar(2) * xy, xx - yy) / Scalar(2);  // of the larger axis
  const Scalar c = std::cos(angle), s = std::sin(angle);
  const auto on_line = [&](const Pixel<Scalar>& p) {
    const Scalar along = c * (p(0) - mx) + s * (p(1) - my);
    return Pixel<Scalar>(mx + along * c, my + along * s);
  };
  from = on_line(points[0]);
  to = on_line(points[count - 1]);
  return true;
}

}  // namespace detail
}  // namespace icat
