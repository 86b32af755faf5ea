// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The image of a cylinder: two long contours and the rims of its ends.
///
/// ⟨o⟩ sits in the middle of the cylinder, y along its axis d. In a camera with D the distance of
/// the axis, e₁ the way to its nearest point and e₂ = d × e₁, the planes through the camera that
/// touch the cylinder, of radius r, are
///
///     n = (r/D) e₁ ± √(1 − r²/D²) e₂,   nᵀ p = r on the axis,   l ∝ K⁻ᵀ n
///
/// The planes touch along p(s) − r n. An end is a circle whose picture is an ellipse; what a line
/// finder sees of it is the half that bounds the cylinder's picture, and a line fitted to that.
#pragma once

#include <optional>

#include "icat/perception/camera.hpp"

namespace icat {

/// The size of a cylinder. The pipes of the trials were of about this size [MARIS, VI-A2].
template <class Scalar>
struct CylinderShape {
  Scalar radius = static_cast<Scalar>(0.05);  ///< r, m, > 0
  Scalar length = Scalar(1);                  ///< L, m, > 0
};

/// A piece of a contour that lies in an image.
template <class Scalar>
struct ContourSegment {
  Pixel<Scalar> from{Scalar(0), Scalar(0)};  ///< px
  Pixel<Scalar> to{Scalar(0), Scalar(0)};    ///< px
  ContourLine<Scalar> line;                  ///< without covariance
  Scalar range{0};                           ///< of its middle from the camera, m
};

namespace detail {

/// A cylinder as one camera sees it, in ⟨k⟩.
template <class Scalar>
struct SeenCylinder {
  Vector3<Scalar> middle, d, e1, e2;
  Scalar distance{0}, radius{0}, half{0};

  /// `pose` is ⟨o⟩ in ⟨c⟩. False where the camera is inside of the endless cylinder, or for NaN.
  bool set(const PinholeCamera<Scalar>& camera, const CylinderShape<Scalar>& shape,
           const Pose<Scalar>& pose) noexcept {
    radius = shape.radius;
    half = shape.length / Scalar(2);
    middle = camera.from_rig(origin(pose));
    d = transposed_times(rotation(camera.pose), column3(pose.matrix(), 0, 1));
    const Vector3<Scalar> foot = plus(middle, -dot(d, middle), d);
    distance = norm(foot);
    if (!(distance > radius) || !std::isfinite(distance)) return false;
    e1 = scaled(foot, Scalar(1) / distance);
    e2 = cross(d, e1);
    return true;
  }
  /// Of the contour with e₂ · n >= 0 (`side` 0) or <= 0 (1).
  Vector3<Scalar> normal(int side) const noexcept {
    const Scalar share = radius / distance;
    const Scalar across = std::sqrt((Scalar(1) - share) * (Scalar(1) + share));
    return plus(scaled(e1, share), side == 0 ? across : -across, e2);
  }
};

/// l ∝ K⁻ᵀ n for a plane through a camera. False where it has no line: the plane is the one
/// parallel to the image.
template <class Scalar>
bool line_of_plane(const PinholeCamera<Scalar>& k, const Vector3<Scalar>& n,
                   ContourLine<Scalar>& line) noexcept {
  const Scalar a = n(0) / k.fx, b = n(1) / k.fy;
  const Scalar length = std::hypot(a, b);
  if (!(length > std::numeric_limits<Scalar>::epsilon() / k.fx)) return false;
  line.theta = std::atan2(b, a);
  line.rho = (k.cx * a + k.cy * b - n(2)) / length;
  return true;
}

}  // namespace detail

/// The line of a long contour, of the endless cylinder, wherever the image ends. Nothing where the
/// camera is inside of that, or for NaN. No allocation.
/// @param cameras  the rig
/// @param camera   0 left, 1 right
/// @param shape    radius and length
/// @param pose     ⟨o⟩ in ⟨c⟩
/// @param side     0 or 1, the two contours
template <class Scalar>
std::optional<ContourLine<Scalar>> edge_line(const StereoCamera<Scalar>& cameras, int camera,
                                             const CylinderShape<Scalar>& shape,
                                             const Pose<Scalar>& pose, int side) noexcept {
  const PinholeCamera<Scalar>& k = cameras[static_cast<std::size_t>(camera)];
  detail::SeenCylinder<Scalar> seen;
  ContourLine<Scalar> line;
  line.camera = camera;
  if (!seen.set(k, shape, pose) || !detail::line_of_plane(k, seen.normal(side), line)) {
    return std::nullopt;
  }
  return line;
}

/// The part of a long contour that the image holds; parameters of `edge_line`. Nothing where there
/// is none. No allocation.
template <class Scalar>
std::optional<ContourSegment<Scalar>> edge_segment(const StereoCamera<Scalar>& cameras, int camera,
                                                   const CylinderShape<Scalar>& shape,
                                                   const Pose<Scalar>& pose, int side) noexcept {
  const PinholeCamera<Scalar>& k = cameras[static_cast<std::size_t>(camera)];
  detail::SeenCylinder<Scalar> seen;
  ContourSegment<Scalar> segment;
  segment.line.camera = camera;
  if (!seen.set(k, shape, pose)) return std::nullopt;
  const Vector3<Scalar> n = seen.normal(side);
  if (!detail::line_of_plane(k, n, segment.line)) return std::nullopt;
  const Vector3<Scalar> touched = detail::plus(seen.middle, -seen.radius, n);
  Vector3<Scalar> a = detail::plus(touched, -seen.half, seen.d);
  Vector3<Scalar> b = detail::plus(touched, seen.half, seen.d);
  // A little more than `nearest`, so that rounding does not lose the whole segment.
  const Scalar near = static_cast<Scalar>(1.001 * PinholeCamera<Scalar>::nearest);
  Scalar low(0), high(1);
  if (!detail::clip(a(2) - near, b(2) - near, low, high)) return std::nullopt;
  const Vector3<Scalar> along = detail::minus(b, a);
  b = detail::plus(a, high, along);
  a = detail::plus(a, low, along);
  Pixel<Scalar> p, q;
  if (!k.project(a, p) || !k.project(b, q)) return std::nullopt;
  low = Scalar(0), high = Scalar(1);
  if (!detail::clip(p(0), q(0), low, high) || !detail::clip(p(1), q(1), low, high) ||
      !detail::clip(k.width - p(0), k.width - q(0), low, high) ||
      !detail::clip(k.height - p(1), k.height - q(1), low, high)) {
    return std::nullopt;
  }
  segment.from = detail::on_segment(p, q, low);
  segment.to = detail::on_segment(p, q, high);
  // The middle of the piece in the picture, in space: 1/z is linear along the picture.
  const Scalar s = (low + high) / Scalar(2);
  const Scalar share = s * a(2) / (s * a(2) + (Scalar(1) - s) * b(2));
  segment.range = detail::norm(detail::plus(a, share, detail::minus(b, a)));
  return segment;
}

/// A line fitted to nine points of the half rim that bounds the picture of an end, in equal steps
/// of the angle; parameters of `edge_line`, `side` 0 the end at −y, 1 that at +y. Nothing unless
/// all nine are in the image. No allocation.
template <class Scalar>
std::optional<ContourSegment<Scalar>> end_segment(const StereoCamera<Scalar>& cameras, int camera,
                                                  const CylinderShape<Scalar>& shape,
                                                  const Pose<Scalar>& pose, int side) noexcept {
  const PinholeCamera<Scalar>& k = cameras[static_cast<std::size_t>(camera)];
  detail::SeenCylinder<Scalar> seen;
  if (!seen.set(k, shape, pose)) return std::nullopt;
  const Vector3<Scalar> out = side == 0 ? detail::scaled(seen.d, Scalar(-1)) : seen.d;
  const Vector3<Scalar> center = detail::plus(seen.middle, seen.half, out);
  // Where the face of the end is seen, the far half of the rim is the contour, else the near one.
  const Scalar depth = detail::dot(out, center) < Scalar(0) ? seen.radius : -seen.radius;
  constexpr int count = 9;
  Pixel<Scalar> points[count], inside;
  // From where one long contour touches to where the other one does: e₁ n = ∓ r/D there.
  const Scalar from =
      std::asin(depth > Scalar(0) ? -seen.radius / seen.distance : seen.radius / seen.distance);
  for (int i = 0; i < count; ++i) {
    const Scalar angle = from + (std::numbers::pi_v<Scalar> - Scalar(2) * from) *
                                    static_cast<Scalar>(i) / static_cast<Scalar>(count - 1);
    const Vector3<Scalar> on_rim =
        detail::plus(detail::plus(center, depth * std::sin(angle), seen.e1),
                     seen.radius * std::cos(angle), seen.e2);
    if (!k.project(on_rim, points[i]) || !k.contains(points[i])) return std::nullopt;
  }
  ContourSegment<Scalar> segment;
  if (!k.project(detail::plus(center, Scalar(-0.1) * seen.half, out), inside) ||
      !detail::fit_line(points, count, segment.from, segment.to)) {
    return std::nullopt;
  }
  const Pixel<Scalar> towards(inside(0) - segment.from(0), inside(1) - segment.from(1));
  segment.line = line_through(segment.from, segment.to, towards, Scalar(0));
  segment.line.camera = camera;
  segment.line.kind = ContourKind::end;
  segment.range = detail::norm(center);
  return segment;
}

}  // namespace icat
