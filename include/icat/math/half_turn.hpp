// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Errors of rotation with memory: they keep their sense of rotation near half a turn.
///
/// A rotation by θ about n equals a rotation by 2π − θ about −n. The shorter of the two ("way")
/// changes its sense at π: a rate that always takes it jumps there, and noise makes it alternate;
/// no continuous rate without memory has one attractor only (Bhat & Bernstein, *Systems & Control
/// Letters* 39, 2000). So the way is stored, as a number or two, from update to update:
///
/// - At first it is the short way. Within 0.01 rad of π, where noise would choose, it is the turn
///   whose axis has a positive largest component (of nearly equal ones the first), for a joint the
///   positive turn, for a direction the turn about x.
/// - It stays the way that it was up to π + 0.5 rad.
/// - Beyond, it fades out, over 100 updates or, where the angle goes on, by the angle up to
///   π + 1 rad; then it is the short way again, which fades in over 100 updates. A fade ends after
///   so many updates for any motion of the angle: a goal at rest is reached from every state.
/// - Where the error jumps by more than 0.5 rad from one update to the next, as with a new goal, it
///   starts anew.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "icat/math/rigid_motion.hpp"
#include "icat/math/smooth_step.hpp"

namespace icat::detail {

/// Numbers of the file comment; rad.
template <class Scalar>
struct HalfTurn {
  static constexpr Scalar pi = std::numbers::pi_v<Scalar>;
  static constexpr Scalar band = Scalar(0.5);                     ///< beyond π, and a jump
  static constexpr Scalar undecided = static_cast<Scalar>(0.01);  ///< before π, at first
  static constexpr Scalar updates = Scalar(100);                  ///< of a fade
};

/// How much the way that was chosen counts.
template <class Scalar>
class WayShare {
 public:
  /// Of a way that is new and need not fade in.
  void restart() noexcept { share_ = Scalar(1); }
  /// `angle` in [0, 2π] on the way. Whether the other way is to be taken from now on.
  bool update(Scalar angle) noexcept {
    using H = HalfTurn<Scalar>;
    const Scalar step = Scalar(1) / H::updates, room = (H::pi - angle) / H::band + Scalar(2);
    share_ += angle > H::pi + H::band ? -step : step;
    share_ = std::clamp(std::min(share_, room), Scalar(0), Scalar(1));
    return share_ == Scalar(0);
  }
  /// In [0, 1].
  Scalar weight() const noexcept { return smooth_step(share_); }

 private:
  Scalar share_{1};
};

/// The error of a joint that turns without end.
template <class Scalar>
class AngleWay {
 public:
  /// `difference` (rad) by whole turns nearer to 0: at most π + 1 in magnitude.
  Scalar update(Scalar difference) noexcept {
    using H = HalfTurn<Scalar>;
    constexpr Scalar turn = Scalar(2) * H::pi;
    Scalar e = std::remainder(difference, turn);
    if (begun_ && std::abs(std::remainder(e - last_, turn)) < H::band) {
      if (std::abs(e - last_) > H::pi) e -= std::copysign(turn, e);
      if (share_.update(std::abs(e))) e -= std::copysign(turn, e);
    } else {
      begun_ = true;
      share_.restart();
      if (e < H::undecided - H::pi) e += turn;
    }
    return last_ = e;
  }
  /// In [0, 1].
  Scalar weight() const noexcept { return share_.weight(); }

 private:
  Scalar last_{0};
  bool begun_{false};
  WayShare<Scalar> share_;
};

/// The error of an orientation.
template <class Scalar>
class RotationWay {
 public:
  RotationWay() noexcept {
    last_.w = Scalar(0);
    fill(last_.v, Scalar(0));
  }
  /// Rotation vector of `turn` (rad), at most π + 1 in magnitude.
  Vector3<Scalar> update(const Matrix3<Scalar>& turn) noexcept {
    using H = HalfTurn<Scalar>;
    auto q = UnitQuaternion<Scalar>::of(turn);
    // The two ways are q and −q; the cosine of half the turn from the last one to this.
    const Scalar cosine = q.w * last_.w + dot(q.v, last_.v);
    if (std::abs(cosine) > std::cos(H::band / Scalar(2))) {
      if (cosine < Scalar(0)) reverse(q);
      if (share_.update(Scalar(2) * std::atan2(norm(q.v), q.w))) reverse(q);
    } else {  // also at first, when the last one is 0
      share_.restart();
      if (q.w < H::undecided / Scalar(2) && !positive(q.v)) reverse(q);
    }
    last_ = q;
    return q.rotation_vector();
  }
  /// In [0, 1].
  Scalar weight() const noexcept { return share_.weight(); }

 private:
  static void reverse(UnitQuaternion<Scalar>& q) noexcept {
    q.w = -q.w;
    q.v = scaled(q.v, Scalar(-1));
  }
  static bool positive(const Vector3<Scalar>& v) noexcept {
    Index largest = 0;
    for (Index i = 1; i < 3; ++i) {
      if (static_cast<Scalar>(0.9) * std::abs(v(i)) > std::abs(v(largest))) largest = i;
    }
    return v(largest) > Scalar(0);
  }

  UnitQuaternion<Scalar> last_;
  WayShare<Scalar> share_;
};

/// The misalignment of a direction d from z.
///
/// Opposite to z every axis across z is a short way, so the memory is the axis m. While θ > π − 0.5
/// it is held, however n swings about it; below, the angle β from n to m goes to 0 by π/100 in each
/// update, and m = n. The angle on the way is π − (π − θ) cos β: θ for m = n, 2π − θ for m = −n,
/// smooth at π. Ξ is z × ḋ after d was turned to −z the short way and then about m by π to z; for
/// m = n that is `Misalignment`'s.
template <class Scalar>
class DirectionWay {
 public:
  /// `m` of the unit vector `d`: its vector and rate become those of the way. Nothing is held
  /// unless `hold`.
  void update(const Vector3<Scalar>& d, bool hold, Misalignment<Scalar>& m) noexcept {
    using H = HalfTurn<Scalar>;
    const Scalar s = std::hypot(d(0), d(1));
    const bool known = s > Scalar(8) * std::numeric_limits<Scalar>::epsilon();
    const Scalar nx = known ? -d(1) / s : Scalar(1), ny = known ? d(0) / s : Scalar(0);
    const bool jumped = !(dot(d, last_) > std::cos(H::band));  // also at first, when last_ is 0
    last_ = d;
    if (hold && m.angle > H::pi - (jumped ? H::undecided : H::band)) {
      if (jumped) x_ = Scalar(1), y_ = Scalar(0);
      lag_ = std::atan2(nx * y_ - ny * x_, nx * x_ + ny * y_);
    } else {
      const Scalar step = H::pi / H::updates;
      lag_ = jumped || std::abs(lag_) <= step ? Scalar(0) : lag_ - std::copysign(step, lag_);
      const Scalar c = std::cos(lag_), t = std::sin(lag_);
      x_ = c * nx - t * ny;
      y_ = t * nx + c * ny;
    }
    angle_ = H::pi - (H::pi - m.angle) * std::cos(lag_);
    if (follows()) return;
    m.vector(0) = angle_ * x_;
    m.vector(1) = angle_ * y_;
    if (d(2) < Scalar(0)) {
      set_misalignment_rate(m, d, x_, y_);
    } else {
      const Scalar c = std::cos(Scalar(2) * lag_), t = std::sin(Scalar(2) * lag_);
      const Vector3<Scalar> a = row3(m.vector_rate, 0, 0), b = row3(m.vector_rate, 1, 0);
      set_row3(m.vector_rate, 0, 0, plus(scaled(a, c), -t, b));
      set_row3(m.vector_rate, 1, 0, plus(scaled(a, t), c, b));
    }
  }
  /// The way is the short way, and d not beyond a right angle.
  bool follows() const noexcept { return lag_ == Scalar(0) && last_(2) >= Scalar(0); }
  /// On the way, rad.
  Scalar angle() const noexcept { return angle_; }
  /// Its derivative by d.
  Vector3<Scalar> gradient(const Misalignment<Scalar>& m) const noexcept {
    if (follows()) return row3(m.angle_gradient, 0, 0);
    return plus(scaled(row3(m.vector_rate, 0, 0), x_), y_, row3(m.vector_rate, 1, 0));
  }

 private:
  Vector3<Scalar> last_{Scalar(0), Scalar(0), Scalar(0)};
  Scalar x_{1}, y_{0}, lag_{0}, angle_{0};
};

}  // namespace icat::detail
