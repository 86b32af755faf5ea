// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Signed distances of spheres and capsules whose gradients are continuous everywhere.
///
/// A distance f to a convex shape is convex, with kinks where the nearest point jumps: deep inside,
/// and, for a whole segment, wherever it is parallel to the other. Both are made smooth so that the
/// sum stays convex and has one nearest point p(s*), s* ∈ [0, 1], which moves continuously:
///
///     x = min_s φ(p(s)) − 4 b s (1 − s) − r,    b = bulge · length of the segment p
///     ẋ = ∇φ(p(s*)) · (velocity of the one at p(s*) − velocity of the other at p(s*))
///
/// The second line is the exact derivative, for s* is a minimum. The capsule is thicker by b in the
/// middle; p(s*) wanders from end to end while it tilts by 8 · bulge rad. Of two capsules only the
/// first is thicker; against a sphere none need be, b = 0. A strictly convex hull for the same end:
/// Escande, Miossec, Benallegue, Kheddar, *IEEE Transactions on Robotics* 30, 2014.
///
/// φ is f where f ≥ δ, δ = r/2, r the sum of the radii. Nearer, at a penetration deeper than r/2,
/// it is rounded. With d the distance to a segment or a point, and q_i = |p_i| − h_i for a box, |·|
/// rounded like d over at most h_i:
///
///     segment:  (d²/m + m) / 2,  m = max(d, δ)
///     box:      max_λ λᵀq + δ (1 − ‖λ‖²) / 2,  λ ≥ 0, ‖λ‖₂ ≤ 1 ≤ ‖λ‖₁;  for δ → 0 it is f
///     plane:    f
///
/// So, with f* the true distance,   x ≤ f* ≤ x + b     where f* ≥ −r/2,
///                                  |x − f*| ≤ max(b, r/2)    deeper, where x < 0 too.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "icat/core/status.hpp"
#include "icat/math/rigid_motion.hpp"

namespace icat {

/// A segment with a radius; a sphere where both ends are one.
template <class Scalar>
struct Capsule {
  Vector3<Scalar> from;  ///< m
  Vector3<Scalar> to;    ///< m
  Scalar radius;         ///< m
};

namespace detail {

/// Why a shape is refused.
template <class Scalar>
struct ShapeFault {
  Status status{Status::ok};
  const char* what{""};
  Scalar value{0};
};

/// The distance to a shape at a point, and its gradient there.
template <class Scalar>
struct DistanceAt {
  Scalar value;
  Vector3<Scalar> gradient;
};

template <class Scalar>
bool is_sphere(const Capsule<Scalar>& c) noexcept {
  return c.from(0) == c.to(0) && c.from(1) == c.to(1) && c.from(2) == c.to(2);
}

template <class Scalar>
ShapeFault<Scalar> check(const Capsule<Scalar>& c) noexcept {
  if (!all_finite(c.from) || !all_finite(c.to)) {
    return {Status::non_finite, "its points must be finite, got x", c.from(0)};
  }
  if (c.radius > Scalar(0) && std::isfinite(c.radius)) return {};
  return {std::isfinite(c.radius) ? Status::out_of_range : Status::non_finite,
          "its radius must be finite and > 0, got", c.radius};
}

/// φ of a segment, see the file comment.
template <class Scalar>
DistanceAt<Scalar> distance_at(const Capsule<Scalar>& c, const Vector3<Scalar>& p,
                               Scalar delta) noexcept {
  const Vector3<Scalar> axis = minus(c.to, c.from), r = minus(p, c.from);
  const Scalar square = dot(axis, axis);
  const Scalar t =
      square > Scalar(0) ? std::clamp(dot(r, axis) / square, Scalar(0), Scalar(1)) : Scalar(0);
  const Vector3<Scalar> d = plus(r, -t, axis);
  const Scalar distance = norm(d), m = std::max(distance, delta);
  return {(distance * (distance / m) + m) / Scalar(2), scaled(d, Scalar(1) / m)};
}

/// φ of a box on its own axes, see the file comment.
template <class Scalar>
DistanceAt<Scalar> distance_at_box(const Vector3<Scalar>& half, const Vector3<Scalar>& p,
                                   Scalar delta) noexcept {
  Vector3<Scalar> slope, y, lambda;  // y = q / δ
  Scalar square(0), sum(0);
  for (Index i = 0; i < 3; ++i) {
    const Scalar size = std::abs(p(i)), m = std::max(size, std::min(delta, half(i)));
    slope(i) = p(i) / m;
    y(i) = ((size * (size / m) + m) / Scalar(2) - half(i)) / delta;
    lambda(i) = std::max(y(i), Scalar(0));
    square += lambda(i) * lambda(i);
    sum += lambda(i);
  }
  // λ is the projection of y onto the set of the λ.
  if (square > Scalar(1)) {
    lambda = scaled(lambda, Scalar(1) / std::sqrt(square));
  } else if (sum < Scalar(1)) {
    Scalar level = -infinity<Scalar>;
    for (int pass = 0; pass < 3; ++pass) {
      Scalar above(-1);
      int count = 0;
      for (Index i = 0; i < 3; ++i) {
        if (y(i) > level) above += y(i), ++count;
      }
      level = above / static_cast<Scalar>(count);
    }
    for (Index i = 0; i < 3; ++i) lambda(i) = std::max(y(i) - level, Scalar(0));
  }
  DistanceAt<Scalar> at;
  at.value = delta * (dot(lambda, y) + (Scalar(1) - dot(lambda, lambda)) / Scalar(2));
  for (Index i = 0; i < 3; ++i) at.gradient(i) = lambda(i) * slope(i);
  return at;
}

}  // namespace detail

/// An obstacle in ⟨0⟩. Its construction checks nothing; the task that gets it does.
template <class Scalar>
class Obstacle {
 public:
  /// A ball; m.
  static Obstacle sphere(const Vector3<Scalar>& center, Scalar radius) noexcept {
    return capsule(center, center, radius);
  }
  /// A segment with a radius, such as a piece of pipe; m.
  static Obstacle capsule(const Vector3<Scalar>& from, const Vector3<Scalar>& to,
                          Scalar radius) noexcept {
    Obstacle o;
    o.round_ = {from, to, radius};
    return o;
  }
  /// The half space behind a plane, such as a floor or a wall: `point` on it, m, and `normal` out
  /// of it, of length 1.
  static Obstacle plane(const Vector3<Scalar>& point, const Vector3<Scalar>& normal) noexcept {
    Obstacle o;
    o.shape_ = Shape::plane;
    o.round_ = {point, point, Scalar(0)};
    o.vector_ = normal;
    return o;
  }
  /// A box: `pose` of its centre, its edges along the axes, of lengths `size`, m.
  static Obstacle box(const Pose<Scalar>& pose, const Vector3<Scalar>& size) noexcept {
    Obstacle o;
    o.shape_ = Shape::box;
    o.pose_ = pose;
    o.vector_ = detail::scaled(size, Scalar(0.5));
    return o;
  }

  /// The point that a velocity of the obstacle refers to: the sphere's centre, the capsule's first
  /// end, the plane's point, the box's centre; m.
  Vector3<Scalar> origin() const noexcept {
    return shape_ == Shape::box ? detail::origin(pose_) : round_.from;
  }
  /// Whether it is a sphere or a capsule.
  bool is_round() const noexcept { return shape_ == Shape::round; }
  /// Where `is_round`.
  const Capsule<Scalar>& round() const noexcept { return round_; }

  /// `ok`, or why it cannot be used.
  detail::ShapeFault<Scalar> check() const noexcept {
    if (is_round()) return detail::check(round_);
    if (!detail::all_finite(vector_) || !detail::all_finite(origin())) {
      return {Status::non_finite, "its numbers must be finite, got x", origin()(0)};
    }
    if (shape_ == Shape::plane) {
      const Scalar length = detail::norm(vector_);
      if (std::abs(length - Scalar(1)) < Scalar(1e-4)) return {};
      return {Status::out_of_range, "its normal must have length 1, got", length};
    }
    for (Index i = 0; i < 3; ++i) {
      if (!(vector_(i) > Scalar(0))) {
        return {Status::out_of_range, "its edges must be > 0, got", Scalar(2) * vector_(i)};
      }
    }
    if (!is_rigid(pose_)) {
      return {Status::not_a_rotation, "its pose must be a rotation, got x of",
              pose_.matrix()(0, 0)};
    }
    return {};
  }

  /// φ at `p`, see the file comment; the radius is not counted. No allocation.
  detail::DistanceAt<Scalar> distance_at(const Vector3<Scalar>& p, Scalar delta) const noexcept {
    if (shape_ == Shape::round) return detail::distance_at(round_, p, delta);
    const Vector3<Scalar> r = detail::minus(p, origin());
    if (shape_ == Shape::plane) return {detail::dot(vector_, r), vector_};
    const Matrix3<Scalar> R = detail::rotation(pose_);
    const auto at = detail::distance_at_box(vector_, detail::transposed_times(R, r), delta);
    return {at.value, detail::times(R, at.gradient)};
  }

 private:
  enum class Shape { round, plane, box };

  Obstacle() = default;

  Shape shape_{Shape::round};
  Capsule<Scalar> round_{
      {Scalar(0), Scalar(0), Scalar(0)}, {Scalar(0), Scalar(0), Scalar(0)}, Scalar(0)};
  Vector3<Scalar> vector_{Scalar(0), Scalar(0), Scalar(0)};  // a normal, or half of the edges
  Pose<Scalar> pose_ = IdentityPose{};
};

/// How near two shapes are.
template <class Scalar>
struct Proximity {
  Scalar distance;           ///< x, m; below 0 in penetration
  Vector3<Scalar> gradient;  ///< ∇φ, away from the other; length ≤ 1, 1 but deep inside
  Vector3<Scalar> point;     ///< p(s*): where ∇φ takes the velocities of both
};

namespace detail {

/// s*, see the file comment: the zero of a slope that rises with s by 8 · bulge at least. False
/// position with halved weights (Illinois), 8 steps as a rule; after 20 bisection, so 68 at most.
template <class Scalar>
Scalar nearest_parameter(const Capsule<Scalar>& capsule, const Obstacle<Scalar>& other,
                         Scalar bulge, Scalar delta) noexcept {
  constexpr Scalar tolerance = Scalar(16) * std::numeric_limits<Scalar>::epsilon();
  const Vector3<Scalar> axis = minus(capsule.to, capsule.from);
  const Scalar length = norm(axis);
  if (!(length > Scalar(0))) return Scalar(0);
  const auto slope = [&](Scalar s) noexcept {
    const auto at = other.distance_at(plus(capsule.from, s, axis), delta);
    return dot(at.gradient, axis) / length + Scalar(8) * bulge * (s - Scalar(0.5));
  };
  Scalar low(0), high(1), below = slope(low), above = slope(high);
  if (below >= Scalar(0)) return low;
  if (above <= Scalar(0)) return high;
  int side = 0;
  Scalar s(0.5);
  for (int i = 0; high - low > tolerance; ++i) {
    s = i < 20 ? low + (high - low) * (below / (below - above)) : (low + high) / Scalar(2);
    const Scalar value = slope(s);
    if (std::abs(value) <= tolerance) break;
    if (value < Scalar(0)) {
      low = s, below = value;
      if (side < 0) above /= Scalar(2);
      side = -1;
    } else {
      high = s, above = value;
      if (side > 0) below /= Scalar(2);
      side = 1;
    }
  }
  return s;
}

}  // namespace detail

/// Of a capsule and an obstacle, see the file comment; `bulge` > 0. Bounded time, no allocation.
template <class Scalar>
Proximity<Scalar> proximity(const Capsule<Scalar>& capsule, const Obstacle<Scalar>& obstacle,
                            Scalar bulge) noexcept {
  const Vector3<Scalar> axis = detail::minus(capsule.to, capsule.from);
  if (obstacle.is_round() && detail::is_sphere(obstacle.round()) && !detail::is_sphere(capsule)) {
    const auto whole = Obstacle<Scalar>::capsule(capsule.from, capsule.to, capsule.radius);
    Proximity<Scalar> mirrored = proximity(obstacle.round(), whole, bulge);
    mirrored.gradient = detail::scaled(mirrored.gradient, Scalar(-1));
    return mirrored;
  }
  const Scalar radius =
      capsule.radius + (obstacle.is_round() ? obstacle.round().radius : Scalar(0));
  const Scalar delta = radius / Scalar(2);
  const Scalar s = detail::nearest_parameter(capsule, obstacle, bulge, delta);
  const Vector3<Scalar> point = detail::plus(capsule.from, s, axis);
  const auto at = obstacle.distance_at(point, delta);
  const Scalar thicker = Scalar(4) * bulge * detail::norm(axis) * s * (Scalar(1) - s);
  return {at.value - thicker - radius, at.gradient, point};
}

}  // namespace icat
