// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The hand of the MARIS project [MARIS, II-C]: three fingers, eight joints, three motors.
///
/// Frame ⟨h⟩: the middle of the palm, z out of it, x from the thumb to the two fingers, y along the
/// pipe. The thumb T has a proximal and a distal joint with axes parallel to the palm; FR (at +y)
/// and FL (at −y) are alike and have a palm joint more, about z. With c the direction in which a
/// finger closes, φ₁ = q_proximal, φ₂ = φ₁ + q_distal, and d(φ) = cos φ z + sin φ c:
///
///     proximal link   from  j = base + height z       to  k = j + l₁ d(φ₁)
///     distal link     from  k                         to  k + l₂ d(φ₂)
///
/// One motor moves one group of joints by cables in parallel, q_j = s_j θ: distal × 3, proximal ×
/// 3, palm × 2 with s = +1 for FR and −1 for FL, so that both turn towards the middle.
///
/// The paper prints the structure, diameters of 5 to 200 mm and the three kinds of grasp, and no
/// lengths or angles: those are ours, one set. Links are capsules. The proximal joints' end stops
/// are where parallel fingers are `widest` and `narrowest` apart: a pipe of 200 mm fits and one of
/// 210 mm does not, one of 5 mm is touched from both sides and one of 4 mm is not.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/math/rigid_motion.hpp"

namespace icat {

/// What one motor moves: an index into angles, speeds and currents.
enum HandGroup { distal_group, proximal_group, palm_group };
/// T, FR, FL.
enum HandFinger { thumb, right_finger, left_finger };

/// How the hand is before it closes, and how it closes.
enum class Preshape {
  parallel,  ///< distal links stay normal to the palm
  power,     ///< fingers wrap round, distal and proximal joints close each by themselves
  precision  ///< as parallel, FR and FL turned to the middle: fingertips oppose the thumb's
};

/// A pipe, as the hand meets it: a segment along x of its frame, with a radius.
template <class Scalar>
struct PipeShape {
  Scalar radius = static_cast<Scalar>(0.05);      ///< m, > 0
  Scalar half_length = static_cast<Scalar>(0.5);  ///< m, > 0; its ends count as round
};

/// What the three motors are told, indexed by `HandGroup`: positions, with the speed and the
/// current on the way. Motor angles are those of the gears' outputs, which are the joints' where no
/// cable is stretched.
template <class Scalar>
struct HandCommand {
  Vector3<Scalar> position = Filled{0};       ///< θ, rad
  Vector3<Scalar> speed = Filled{0};          ///< at most, rad/s, >= 0; 0: the motor is off
  Vector3<Scalar> current_limit = Filled{0};  ///< A, >= 0
};
/// What they say, likewise.
template <class Scalar>
struct HandReading {
  Vector3<Scalar> position = Filled{0};  ///< θ, rad
  Vector3<Scalar> speed = Filled{0};     ///< rad/s
  Vector3<Scalar> current = Filled{0};   ///< A, >= 0
};

/// A group of cables, gear and motor: τ_g = (k_t i − τ_f) N η is what the joints of a group get in
/// sum. [MARIS, II-C] names motor and gear; the numbers are ours. The worm gear is self-locking: η
/// < 1/2, and what the joints do never moves the motor.
template <class Scalar>
struct HandMotor {
  Scalar torque_constant = static_cast<Scalar>(0.04);  ///< k_t, N m/A
  Scalar ratio = Scalar(2000);                         ///< N
  Scalar efficiency = static_cast<Scalar>(0.3);        ///< η, in (0, 1/2)
  Scalar friction = static_cast<Scalar>(0.006);        ///< τ_f at the motor, N m
  Scalar inertia = static_cast<Scalar>(2e-6);          ///< of the rotor, kg m²
  Scalar maximum_current = static_cast<Scalar>(0.8);   ///< in continuous operation, A
  Scalar maximum_speed = static_cast<Scalar>(0.3);     ///< of the joints, rad/s
  Scalar cable_stiffness = Scalar(400);                ///< k_c of each joint, N m/rad

  /// τ_g of a current, N m, >= 0.
  constexpr Scalar torque(Scalar current) const noexcept {
    const Scalar motor = torque_constant * current - friction;
    return motor > Scalar(0) ? motor * ratio * efficiency : Scalar(0);
  }
  /// The current that moves the joints of a group against τ_g >= 0, A.
  constexpr Scalar current(Scalar torque) const noexcept {
    return (torque / (ratio * efficiency) + friction) / torque_constant;
  }
};

/// A link's axis, on ⟨h⟩, m.
template <class Scalar>
struct HandLink {
  Vector3<Scalar> from;  ///< nearer to the palm
  Vector3<Scalar> to;    ///< further away
};

namespace detail {

template <class Scalar>
[[gnu::cold]] void check_motor(const HandMotor<Scalar>& m) {
  for (const Scalar x : {m.torque_constant, m.ratio, m.efficiency, m.inertia, m.maximum_current,
                         m.maximum_speed, m.cable_stiffness}) {
    require_positive("HandMotor", "a number", x);
  }
  if (!(m.efficiency < static_cast<Scalar>(0.5))) {
    invalid("HandMotor: a worm gear with efficiency >= 1/2 does not lock, got ", m.efficiency);
  }
  if (!(m.friction >= Scalar(0)) || !(m.torque(m.maximum_current) > Scalar(0))) {
    invalid("HandMotor: friction must be >= 0 and less than the motor's torque, got ", m.friction);
  }
}

/// The nearest points of two segments: p = a + s (b − a), and likewise on the other.
template <class Scalar>
struct NearestPoints {
  Vector3<Scalar> first, second;
  Scalar distance;
};

/// Of the segments a to b and c to d. Of parallel ones the middle of what lies side by side. Either
/// may be a point.
template <class Scalar>
NearestPoints<Scalar> nearest_points(const Vector3<Scalar>& a, const Vector3<Scalar>& b,
                                     const Vector3<Scalar>& c, const Vector3<Scalar>& d) noexcept {
  const Vector3<Scalar> u = minus(b, a), v = minus(d, c), w = minus(a, c);
  const Scalar uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), uw = dot(u, w), vw = dot(v, w);
  const auto unit = [](Scalar x) { return std::clamp(x, Scalar(0), Scalar(1)); };
  const Scalar across = uu * vv - uv * uv;  // (‖u‖ ‖v‖ sin)²
  Scalar s(0), t(0);
  // Nearer to parallel than 1e-3 rad the place along them means nothing.
  if (across > static_cast<Scalar>(1e-6) * uu * vv) {
    s = unit((uv * vw - vv * uw) / across);
  } else if (uu > Scalar(0) && vv > Scalar(0)) {
    // c and d along the first one.
    const Scalar at_c = -uw / uu, at_d = at_c + uv / uu;
    s = (unit(std::min(at_c, at_d)) + unit(std::max(at_c, at_d))) / Scalar(2);
  }
  if (vv > Scalar(0)) t = unit((vw + s * uv) / vv);
  if (uu > Scalar(0)) s = unit((t * uv - uw) / uu);
  NearestPoints<Scalar> n{plus(a, s, u), plus(c, t, v), Scalar(0)};
  n.distance = norm(minus(n.second, n.first));
  return n;
}

}  // namespace detail

/// See the file comment. Angles of the three groups are a vector indexed by `HandGroup`, rad, those
/// of one finger one of distal, proximal and palm joint; the thumb's third is without effect.
template <class ScalarType>
class MarisHand {
 public:
  /// Scalar type.
  using Scalar = ScalarType;
  /// Indexed by `HandGroup`.
  using Angles = Vector3<Scalar>;
  /// Joints.
  static constexpr int joint_count = 8;
  /// Motors.
  static constexpr int motor_count = 3;

  /// Lengths in m, angles in rad.
  struct Geometry {
    Scalar base_x = static_cast<Scalar>(0.08);       ///< of the fingers' bases; the thumb's: −
    Scalar base_y = static_cast<Scalar>(0.035);      ///< of FR; of FL: −
    Scalar height = static_cast<Scalar>(0.01);       ///< of the proximal axes over the palm
    Scalar proximal = static_cast<Scalar>(0.09);     ///< l₁
    Scalar distal = static_cast<Scalar>(0.09);       ///< l₂
    Scalar radius = static_cast<Scalar>(0.01);       ///< of the links
    Scalar palm_radius = static_cast<Scalar>(0.09);  ///< of the palm, a disk
    Scalar widest = static_cast<Scalar>(0.203);      ///< between parallel fingers, open
    Scalar narrowest = static_cast<Scalar>(0.0041);  ///< between parallel fingers, closed
    Scalar curl = static_cast<Scalar>(1.7);          ///< end stop of the distal joints
    Scalar turn = static_cast<Scalar>(0.33);         ///< of the palm joints, for precision
  };

  /// One of the eight joints.
  struct Joint {
    HandFinger finger;  ///< that it belongs to
    HandGroup group;    ///< that moves it
    int sign;           ///< s_j
    const char* name;   ///< for a log
  };
  /// T, FR, FL; each from the palm outwards.
  static constexpr std::array<Joint, joint_count> joints{
      {{thumb, proximal_group, 1, "T proximal"},
       {thumb, distal_group, 1, "T distal"},
       {right_finger, palm_group, 1, "FR palm"},
       {right_finger, proximal_group, 1, "FR proximal"},
       {right_finger, distal_group, 1, "FR distal"},
       {left_finger, palm_group, -1, "FL palm"},
       {left_finger, proximal_group, 1, "FL proximal"},
       {left_finger, distal_group, 1, "FL distal"}}};
  /// s of the joint of a finger in a group; 0 where it has none.
  static constexpr int sign(HandFinger finger, HandGroup group) noexcept {
    if (group != palm_group) return 1;
    return finger == thumb ? 0 : finger == right_finger ? 1 : -1;
  }

  /// @throws std::invalid_argument on lengths that are not > 0, angles out of range, and where the
  ///         fingers cannot be `widest` and `narrowest` apart.
  [[gnu::cold]] explicit MarisHand(const Geometry& geometry = Geometry()) : geometry_(geometry) {
    const Geometry& g = geometry;
    const Scalar lengths[] = {g.base_x, g.base_y,      g.height, g.proximal, g.distal,
                              g.radius, g.palm_radius, g.widest, g.narrowest};
    for (const Scalar length : lengths) detail::require_positive("MarisHand", "a length", length);
    if (!(g.curl > Scalar(0)) || !(g.curl < static_cast<Scalar>(std::numbers::pi))) {
      detail::invalid("MarisHand: curl must be in (0, pi), got ", g.curl);
    }
    if (!(g.turn >= Scalar(0)) || !(g.turn < Scalar(1))) {
      detail::invalid("MarisHand: turn must be in [0, 1), got ", g.turn);
    }
    const auto angle = [&](Scalar apart) {
      return (g.base_x - g.radius - apart / Scalar(2)) / g.proximal;
    };
    if (!(g.narrowest < g.widest) || !(angle(g.widest) > Scalar(-1)) ||
        !(angle(g.narrowest) < Scalar(1))) {
      detail::invalid("MarisHand: fingers of ", g.proximal, " m cannot be ", g.narrowest, " to ",
                      g.widest, " m apart");
    }
    upper_(proximal_group) = std::asin(angle(g.narrowest));
    lower_(proximal_group) = std::asin(angle(g.widest));
    upper_(distal_group) = g.curl;
    upper_(palm_group) = g.turn;
    lower_(palm_group) = Scalar(0);
    // Precision: fingers that are turned come less far, so their tips lean inwards as to be
    // `narrowest` apart at the end stop too.
    const Scalar reach =
        (Scalar(2) * (g.base_x - g.radius) - g.narrowest) / (Scalar(1) + std::cos(g.turn));
    const Scalar lean = (reach - g.proximal * std::sin(upper_(proximal_group))) / g.distal;
    if (!(std::abs(lean) < Scalar(1))) detail::invalid("MarisHand: turn is too much, ", g.turn);
    lean_ = std::asin(lean);
    lower_(distal_group) = std::min(lean_, Scalar(0)) - upper_(proximal_group);  // closed
  }

  /// As constructed.
  const Geometry& geometry() const noexcept { return geometry_; }
  /// End stops of the joints of each group (of a palm joint, times its sign), rad.
  const Angles& lower() const noexcept { return lower_; }
  /// See `lower`.
  const Angles& upper() const noexcept { return upper_; }

  /// q_distal + q_proximal that the shape keeps; `power` only while it is open.
  Scalar lean(Preshape shape) const noexcept {
    return shape == Preshape::precision ? lean_ : Scalar(0);
  }
  /// The open hand of a shape.
  Angles preshape(Preshape shape) const noexcept {
    Angles a = lower_;
    a(distal_group) = lean(shape) - lower_(proximal_group);
    if (shape == Preshape::precision) a(palm_group) = upper_(palm_group);
    return a;
  }

  /// q_j = s_j θ, in the order of `joints`, cables without load.
  Vector<Scalar, joint_count> coupled(const Angles& motors) const noexcept {
    Vector<Scalar, joint_count> q;
    for (std::size_t j = 0; j < joint_count; ++j) {
      q(static_cast<Index>(j)) = static_cast<Scalar>(joints[j].sign) * motors(joints[j].group);
    }
    return q;
  }
  /// Of one finger, cables without load.
  Angles coupled(HandFinger finger, const Angles& motors) const noexcept {
    Angles q = motors;
    q(palm_group) *= static_cast<Scalar>(sign(finger, palm_group));
    return q;
  }

  /// Where a finger's palm joint, or the thumb's foot, is; on ⟨h⟩, m.
  Vector3<Scalar> base(HandFinger finger) const noexcept {
    const Geometry& g = geometry_;
    if (finger == thumb) return {-g.base_x, Scalar(0), g.height};
    return {g.base_x, finger == right_finger ? g.base_y : -g.base_y, g.height};
  }
  /// c: where a finger closes to, unit, on ⟨h⟩. `q`: of this finger, rad.
  Vector3<Scalar> closing_direction(HandFinger finger, const Angles& q) const noexcept {
    if (finger == thumb) return {Scalar(1), Scalar(0), Scalar(0)};
    return {-std::cos(q(palm_group)), -std::sin(q(palm_group)), Scalar(0)};
  }
  /// The proximal (0) and the distal (1) link of a finger. `q`: of this finger, rad.
  std::array<HandLink<Scalar>, 2> links(HandFinger finger, const Angles& q) const noexcept {
    const Vector3<Scalar> c = closing_direction(finger, q);
    const auto along = [&](Scalar angle) -> Vector3<Scalar> {
      const Scalar s = std::sin(angle);
      return {s * c(0), s * c(1), std::cos(angle)};
    };
    const Scalar first = q(proximal_group), second = first + q(distal_group);
    const Vector3<Scalar> j = base(finger);
    const Vector3<Scalar> k = detail::plus(j, geometry_.proximal, along(first));
    return {{{j, k}, {k, detail::plus(k, geometry_.distal, along(second))}}};
  }
  /// How a point fixed to link 0 or 1 of a finger, at `p` on ⟨h⟩, moves with each of its joints,
  /// m/rad; column by column as in `Angles`.
  Matrix3<Scalar> jacobian(HandFinger finger, const Angles& q, int link,
                           const Vector3<Scalar>& p) const noexcept {
    const Vector3<Scalar> c = closing_direction(finger, q), j = base(finger);
    const Vector3<Scalar> axis(-c(1), c(0), Scalar(0));  // z × c: turns z to c
    Matrix3<Scalar> J;
    detail::fill(J, Scalar(0));
    detail::set_column3(J, 0, proximal_group, detail::cross(axis, detail::minus(p, j)));
    if (link == 1) {
      const Vector3<Scalar> k = links(finger, q)[0].to;
      detail::set_column3(J, 0, distal_group, detail::cross(axis, detail::minus(p, k)));
    }
    if (finger != thumb) {
      J(0, palm_group) = -(p(1) - j(1));
      J(1, palm_group) = p(0) - j(0);
    }
    return J;
  }

  /// Between the thumb's tip and the fingers', along x, less the radii, m, >= 0. `motors`: without
  /// load.
  Scalar aperture(const Angles& motors) const noexcept {
    Scalar apart = infinity<Scalar>;
    const Scalar t = links(thumb, coupled(thumb, motors))[1].to(0);
    for (const HandFinger f : {right_finger, left_finger}) {
      apart = std::min(apart, links(f, coupled(f, motors))[1].to(0) - t);
    }
    return std::max(apart - Scalar(2) * geometry_.radius, Scalar(0));
  }

  /// Between a finger and a pipe, its frame `pipe` in ⟨h⟩, m; below 0 in penetration, infinite
  /// where a number is none.
  Scalar distance(HandFinger finger, const Angles& q, const PipeShape<Scalar>& shape,
                  const Pose<Scalar>& pipe) const noexcept {
    const auto end = ends(shape, pipe);
    Scalar least = infinity<Scalar>;
    for (const HandLink<Scalar>& link : links(finger, q)) {
      const auto near = detail::nearest_points(link.from, link.to, end.from, end.to);
      least = std::min(least, near.distance);
    }
    return least - geometry_.radius - shape.radius;
  }

  /// Where a finger of a closing hand meets a pipe that does not move.
  struct Meeting {
    bool met;       ///< it does, before its end stop
    Angles motors;  ///< there, or at the end, rad
  };
  /// From the open hand of `preshape` on, the proximal joints close; of `power` the distal ones
  /// after them. To 1e-6 rad where the pipe is not passed within 5 mrad. No allocation.
  Meeting meets(HandFinger finger, Preshape preshape, const PipeShape<Scalar>& shape,
                const Pose<Scalar>& pipe) const noexcept {
    const auto gap = [&](const Angles& motors) {
      return distance(finger, coupled(finger, motors), shape, pipe);
    };
    Angles a = this->preshape(preshape);
    for (const HandGroup group : {proximal_group, distal_group}) {
      if (group == distal_group && preshape != Preshape::power) break;
      const auto to = [&](Scalar angle) {
        Angles b = a;
        b(group) = angle;
        if (preshape != Preshape::power) b(distal_group) = lean(preshape) - angle;
        return b;
      };
      const Scalar from = a(group), range = upper_(group) - from;
      const int steps = 1 + static_cast<int>(range / static_cast<Scalar>(0.005));
      for (int i = 0; i <= steps; ++i) {
        const auto at = [&](int k) {
          return from + range * static_cast<Scalar>(k) / static_cast<Scalar>(steps);
        };
        if (!(gap(to(at(i))) <= Scalar(0))) continue;
        Scalar low = at(std::max(i - 1, 0)), high = at(i);
        for (int k = 0; k < 16; ++k) {
          const Scalar middle = (low + high) / Scalar(2);
          (gap(to(middle)) <= Scalar(0) ? high : low) = middle;
        }
        return {true, to(high)};
      }
      a = to(upper_(group));
    }
    return {false, a};
  }

  /// The pipe's axis on ⟨h⟩.
  static HandLink<Scalar> ends(const PipeShape<Scalar>& shape, const Pose<Scalar>& pipe) noexcept {
    const Vector3<Scalar> o = detail::origin(pipe);
    const Vector3<Scalar> d = detail::column3(pipe.matrix(), 0, 0);
    return {detail::plus(o, -shape.half_length, d), detail::plus(o, shape.half_length, d)};
  }

 private:
  Geometry geometry_;
  Angles lower_, upper_;
  Scalar lean_{0};
};

}  // namespace icat
