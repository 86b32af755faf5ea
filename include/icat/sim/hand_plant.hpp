// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Simulates the hand: motors, worm gears, cables, and contacts of the links.
///
/// Slow, so without inertia but for the motors' start. With the cables' stretch d_j = s_j θ_g −
/// q_j, a joint's torque is k_c d_j, and each finger is in balance with what it touches:
///
///     k_c (s_j θ_g − q_j) = Σ f_i n_iᵀ ∂p_i/∂q_j (+ end stops),   f_i = k_n max(0, depth_i)
///
/// of its two links against the pipe, n_i on the pipe. The stretch lags by `return_time`, so that
/// contact takes energy out; one implicit step is taken in each step. A finger that touches nothing
/// has q_j = s_j θ_g exactly. A motor has the torque of
/// its group against it, τ_g = Σ s_j k_c d_j:
///
///     current  k_t i = τ_g / (N η) + τ_f + N J θ̈ where it works against τ_g, at most the limit
///     speed    to the commanded one with a lag; it falls to 0 over the last 5 % below the limit
///     no power, no command: θ̇ = 0 whatever τ_g, and no current (worm gear)
///
/// Friction at the pads does not load the joints; fingers do not touch each other. Both are
/// simplifications of ours, as all numbers: [MARIS, II-C] prints about 150 N for each finger.
#pragma once

#include "icat/model/maris_hand.hpp"

namespace icat {

/// Where a part of the hand presses on the pipe. On ⟨h⟩.
template <class Scalar>
struct HandContact {
  Scalar force{0};                       ///< along the normal, N; 0: no contact
  Scalar depth{0};                       ///< of the pads' compression, m
  Vector3<Scalar> point = Filled{0};     ///< on the pipe, m
  Vector3<Scalar> normal = Filled{0};    ///< on the pipe, unit
  Vector3<Scalar> velocity = Filled{0};  ///< of the pad there, as the joints move, m/s
};

/// A pipe in the hand's frame.
template <class Scalar>
struct PipeInHand {
  PipeShape<Scalar> shape{};           ///< what it is
  Pose<Scalar> pose = IdentityPose{};  ///< its frame in ⟨h⟩
};

/// See the file comment.
template <class ScalarType>
class HandPlant {
 public:
  /// Scalar type.
  using Scalar = ScalarType;
  /// Model of the links.
  using Hand = MarisHand<Scalar>;
  /// Indexed by `HandGroup`.
  using Angles = typename Hand::Angles;
  /// Links of the fingers, T, FR, FL, proximal and distal; then two points of the palm.
  static constexpr int contact_count = 8;

  /// What the hand is made of.
  struct Options {
    HandMotor<Scalar> motor{};                        ///< of each group
    Scalar pad_stiffness = static_cast<Scalar>(1e5);  ///< k_n, N/m
    double return_time = 0.01;    ///< in which a finger that is let go comes back, s
    double time_constant = 0.02;  ///< of a motor's start, s
  };

  /// Open, as for `Preshape::parallel`.
  /// @throws std::invalid_argument on numbers out of range.
  [[gnu::cold]] explicit HandPlant(const Hand& hand = Hand(), const Options& options = Options())
      : hand_(hand), options_(options) {
    detail::check_motor(options.motor);
    detail::require_positive("HandPlant", "pad_stiffness", options.pad_stiffness);
    detail::require_positive("HandPlant", "time_constant", options.time_constant);
    detail::require_positive("HandPlant", "return_time", options.return_time);
    (void)set_motors(hand.preshape(Preshape::parallel));
  }

  /// Motors at `angles`, at rest, cables without load. What is not finite is refused.
  Status set_motors(const Angles& angles) noexcept {
    if (!detail::all_finite(angles)) return Status::non_finite;
    reading_ = {};
    reading_.position = angles;
    for (int f = 0; f < 3; ++f) finger_[static_cast<std::size_t>(f)] = limited(f, unloaded(f));
    for (Angles& stretch : stretch_) stretch = zero();
    for (auto& contact : contacts_) contact = {};
    return Status::ok;
  }
  /// Cut or there; without it the worm gears hold.
  void set_power(bool there) noexcept { power_ = there; }
  /// A motor that does not turn any more, whatever its current, or does again.
  void set_jammed(HandGroup group, bool jammed) noexcept {
    jammed_[static_cast<std::size_t>(group)] = jammed;
  }

  /// What `step` says of a command, without a step.
  static Status check(const HandCommand<Scalar>& command, double dt) noexcept {
    if (!std::isfinite(dt) || !detail::all_finite(command.position) ||
        !detail::all_finite(command.speed) || !detail::all_finite(command.current_limit)) {
      return Status::non_finite;
    }
    if (dt < 0) return Status::time_reversed;
    for (Index g = 0; g < 3; ++g) {
      if (command.speed(g) < Scalar(0) || command.current_limit(g) < Scalar(0)) {
        return Status::out_of_range;
      }
    }
    return Status::ok;
  }
  /// `command` for `dt` s, >= 0, with a pipe in reach or none (null). Non-finite input, a speed or
  /// limit below 0 and a pose that is none are refused, and nothing changes. The pipe should move
  /// less than a millimetre in `dt`; steps above 20 ms slow the motors down. No allocation.
  Status step(const HandCommand<Scalar>& command, const PipeInHand<Scalar>* pipe,
              double dt) noexcept {
    if (const Status status = check(command, dt); status != Status::ok) return status;
    if (pipe) {
      if (!is_rigid(pipe->pose)) return Status::not_a_rotation;
      if (!(pipe->shape.radius > Scalar(0)) || !(pipe->shape.half_length > Scalar(0)) ||
          !std::isfinite(pipe->shape.radius) || !std::isfinite(pipe->shape.half_length)) {
        return Status::out_of_range;
      }
    }
    for (int g = 0; g < 3; ++g) drive(static_cast<HandGroup>(g), command, static_cast<Scalar>(dt));
    for (auto& contact : contacts_) contact = {};
    for (int f = 0; f < 3; ++f) move_finger(f, pipe, static_cast<Scalar>(dt));
    if (pipe) touch_palm(*pipe);
    return Status::ok;
  }

  /// What the motors say.
  const HandReading<Scalar>& reading() const noexcept { return reading_; }
  /// Of the joints, in the order of `MarisHand::joints`, rad.
  Vector<Scalar, Hand::joint_count> joints() const noexcept {
    Vector<Scalar, Hand::joint_count> q;
    for (std::size_t j = 0; j < Hand::joint_count; ++j) {
      q(static_cast<Index>(j)) =
          finger_[static_cast<std::size_t>(Hand::joints[j].finger)](Hand::joints[j].group);
    }
    return q;
  }
  /// Joints of one finger, rad.
  const Angles& finger(HandFinger f) const noexcept { return finger_[static_cast<std::size_t>(f)]; }
  /// Of the last step; see `contact_count`.
  const std::array<HandContact<Scalar>, contact_count>& contacts() const noexcept {
    return contacts_;
  }
  /// Sum of the normal forces of a finger's links, N.
  Scalar force(HandFinger f) const noexcept {
    return contacts_[2 * std::size_t(f)].force + contacts_[2 * std::size_t(f) + 1].force;
  }
  /// How many fingers touch the pipe.
  int fingers_touching() const noexcept {
    int count = 0;
    for (const HandFinger f : {thumb, right_finger, left_finger}) count += force(f) > Scalar(0);
    return count;
  }
  /// The links' model.
  const Hand& hand() const noexcept { return hand_; }
  /// As constructed.
  const Options& options() const noexcept { return options_; }

 private:
  static Angles zero() noexcept { return {Scalar(0), Scalar(0), Scalar(0)}; }
  Angles unloaded(int f) const noexcept {
    return hand_.coupled(static_cast<HandFinger>(f), reading_.position);
  }
  Scalar limit(int f, Index g, bool up) const noexcept {
    if (g != palm_group) return up ? hand_.upper()(g) : hand_.lower()(g);
    const int sign = Hand::sign(static_cast<HandFinger>(f), palm_group);
    return (sign > 0) == up ? static_cast<Scalar>(sign) * hand_.upper()(g)
                            : static_cast<Scalar>(sign) * hand_.lower()(g);
  }
  Angles limited(int f, Angles q) const noexcept {
    for (Index g = 0; g < 3; ++g) q(g) = std::clamp(q(g), limit(f, g, false), limit(f, g, true));
    return q;
  }

  void drive(HandGroup g, const HandCommand<Scalar>& command, Scalar dt) noexcept {
    const HandMotor<Scalar>& m = options_.motor;
    const Scalar before = reading_.speed(g),
                 limit = std::min(command.current_limit(g), m.maximum_current);
    const Scalar away = command.position(g) - reading_.position(g);
    const Scalar fastest = std::min(command.speed(g), m.maximum_speed);
    reading_.speed(g) = reading_.current(g) = Scalar(0);
    // The drive's own position loop; nearer than this it rests.
    constexpr double gain = 50, rest = 1e-6;
    if (!power_ || !(fastest > Scalar(0)) || !(limit > Scalar(0))) return;
    if (!(std::abs(away) > static_cast<Scalar>(rest))) return;
    if (jammed_[static_cast<std::size_t>(g)]) {
      reading_.current(g) = limit;
      return;
    }
    Scalar load(0), stiffness(0);
    for (int f = 0; f < 3; ++f) {
      const Scalar sign = static_cast<Scalar>(Hand::sign(static_cast<HandFinger>(f), g));
      load += m.cable_stiffness * sign *
              (sign * reading_.position(g) - finger_[static_cast<std::size_t>(f)](g));
      stiffness += m.cable_stiffness * sign * sign;
    }
    const Scalar against = away > Scalar(0) ? load : -load;
    const Scalar spare = std::max(m.torque(limit) - against, Scalar(0));
    // Torque left for the gear of a motor at its limit falls with speed; so does not overshoot.
    const Scalar margin = static_cast<Scalar>(0.05) * m.torque(limit);
    const Scalar share = spare < margin ? spare / margin : Scalar(1);
    const Scalar wanted = std::clamp(static_cast<Scalar>(gain) * away, -fastest, fastest) * share;
    const Scalar from = wanted * before < Scalar(0) ? Scalar(0) : before;
    Scalar speed = wanted;
    if (std::abs(wanted) > std::abs(from)) {
      speed += std::exp(-dt / static_cast<Scalar>(options_.time_constant)) * (from - wanted);
    }
    // Neither past the end of the way nor, in a long step, past the torque that there is.
    const Scalar step = std::min({std::abs(speed) * dt, std::abs(away), spare / stiffness});
    reading_.position(g) += away > Scalar(0) ? step : -step;
    reading_.speed(g) = dt > Scalar(0) ? (away > Scalar(0) ? step : -step) / dt : Scalar(0);
    Scalar current = m.current(std::max(against, Scalar(0)));
    if (dt > Scalar(0)) {
      current += std::max((std::abs(speed) - std::abs(from)) / dt, Scalar(0)) * m.ratio *
                 m.inertia / m.torque_constant;
    }
    reading_.current(g) = std::min(current, limit);
  }

  HandContact<Scalar> touch(int f, int link, const Angles& q,
                            const PipeInHand<Scalar>& pipe) const noexcept {
    const auto axis = Hand::ends(pipe.shape, pipe.pose);
    const HandLink<Scalar> bone =
        hand_.links(static_cast<HandFinger>(f), q)[static_cast<std::size_t>(link)];
    const auto near = detail::nearest_points(bone.from, bone.to, axis.from, axis.to);
    HandContact<Scalar> c;
    c.depth = hand_.geometry().radius + pipe.shape.radius - near.distance;
    // A pipe whose axis goes through a link has no side to be pushed to.
    if (!(c.depth > Scalar(0)) || !(near.distance > static_cast<Scalar>(1e-6))) return {};
    c.normal = detail::scaled(detail::minus(near.second, near.first), Scalar(1) / near.distance);
    c.point = detail::plus(near.second, -pipe.shape.radius, c.normal);
    c.force = options_.pad_stiffness * c.depth;
    return c;
  }

  void move_finger(int f, const PipeInHand<Scalar>* pipe, Scalar dt) noexcept {
    const HandFinger finger = static_cast<HandFinger>(f);
    const Angles reference = unloaded(f), before = finger_[static_cast<std::size_t>(f)];
    Angles& stretch = stretch_[static_cast<std::size_t>(f)];
    const Scalar stiffness = options_.motor.cable_stiffness;
    // c/dt: at once where nothing moves, dt = 0.
    const Scalar drag =
        dt > Scalar(0) ? stiffness * static_cast<Scalar>(options_.return_time) / dt : Scalar(0);
    Angles q;  // where the cables, as they are stretched, carry the finger
    for (Index i = 0; i < 3; ++i) q(i) = reference(i) - stretch(i);
    q = limited(f, q);
    bool touching = false;
    if (pipe) {
      Matrix3<Scalar> A;
      Vector3<Scalar> g;
      detail::fill(A, Scalar(0));
      for (Index i = 0; i < 3; ++i) {
        A(i, i) = stiffness + drag;
        g(i) = stiffness * (reference(i) - q(i));
      }
      for (int link = 0; link < 2; ++link) {
        const HandContact<Scalar> c = touch(f, link, q, *pipe);
        if (!(c.force > Scalar(0))) continue;
        touching = true;
        const Vector3<Scalar> J =
            detail::transposed_times(hand_.jacobian(finger, q, link, c.point), c.normal);
        for (Index i = 0; i < 3; ++i) {
          g(i) -= c.force * J(i);
          for (Index k = 0; k < 3; ++k) A(i, k) += options_.pad_stiffness * J(i) * J(k);
        }
      }
      if (touching) q = implicit_step(f, A, g, q);
    }
    if (!touching) {
      // Nothing left of the stretch: the coupling holds to the last digit.
      for (Index i = 0; i < 3; ++i) {
        Scalar left = stretch(i) * drag / (stiffness + drag);
        if (std::abs(left) < static_cast<Scalar>(1e-5)) left = Scalar(0);
        q(i) = reference(i) - left;
      }
      q = limited(f, q);
    }
    finger_[static_cast<std::size_t>(f)] = q;
    for (Index i = 0; i < 3; ++i) {
      // What an end stop holds is no stretch that comes back.
      const Scalar inside = std::clamp(reference(i), limit(f, i, false), limit(f, i, true));
      stretch(i) = q(i) == inside ? Scalar(0) : reference(i) - q(i);
    }
    if (!pipe) return;
    for (int link = 0; link < 2; ++link) {
      HandContact<Scalar> c = touch(f, link, q, *pipe);
      if (c.force > Scalar(0) && dt > Scalar(0)) {
        const Vector3<Scalar> rate = detail::scaled(detail::minus(q, before), Scalar(1) / dt);
        c.velocity = detail::times(hand_.jacobian(finger, q, link, c.point), rate);
      }
      contacts_[static_cast<std::size_t>(2 * f + link)] = c;
    }
  }

  // q + A⁻¹ g, with the joints that would pass an end stop at it. A is positive: its pivots are >=
  // k_c.
  Angles implicit_step(int f, const Matrix3<Scalar>& A, const Vector3<Scalar>& g,
                       const Angles& q) const noexcept {
    std::array<bool, 3> stopped{};
    Angles next = q;
    for (int pass = 0; pass < 3; ++pass) {
      Matrix3<Scalar> M = A;
      Vector3<Scalar> x = g;
      for (Index i = 0; i < 3; ++i) {
        if (!stopped[static_cast<std::size_t>(i)]) continue;
        const Scalar fixed = next(i) - q(i);
        for (Index k = 0; k < 3; ++k) {
          if (!stopped[static_cast<std::size_t>(k)]) x(k) -= A(k, i) * fixed;
          M(i, k) = M(k, i) = Scalar(0);
        }
        M(i, i) = Scalar(1);
        x(i) = fixed;
      }
      for (Index i = 0; i < 3; ++i) {  // elimination without pivots
        for (Index k = i + 1; k < 3; ++k) {
          const Scalar factor = M(k, i) / M(i, i);
          for (Index j = i; j < 3; ++j) M(k, j) -= factor * M(i, j);
          x(k) -= factor * x(i);
        }
      }
      for (Index i = 2; i >= 0; --i) {
        for (Index j = i + 1; j < 3; ++j) x(i) -= M(i, j) * x(j);
        x(i) /= M(i, i);
      }
      bool passed = false;
      for (Index i = 0; i < 3; ++i) {
        if (stopped[static_cast<std::size_t>(i)]) continue;
        next(i) = q(i) + x(i);
        const Scalar inside = std::clamp(next(i), limit(f, i, false), limit(f, i, true));
        if (inside != next(i)) stopped[static_cast<std::size_t>(i)] = passed = true;
        next(i) = inside;
      }
      if (!passed) break;
    }
    return next;
  }

  // Two points, so that a pipe that lies on the palm does not rock on one.
  void touch_palm(const PipeInHand<Scalar>& pipe) noexcept {
    const Scalar radius = hand_.geometry().palm_radius;
    const Vector3<Scalar> o = detail::origin(pipe.pose);
    const Vector3<Scalar> d = detail::column3(pipe.pose.matrix(), 0, 0);
    const Scalar flat = d(0) * d(0) + d(1) * d(1);
    const Scalar foot =
        flat > static_cast<Scalar>(1e-6) ? -(o(0) * d(0) + o(1) * d(1)) / flat : Scalar(0);
    for (int side = 0; side < 2; ++side) {
      const Scalar s = std::clamp(foot + (side == 0 ? radius : -radius) / Scalar(2),
                                  -pipe.shape.half_length, pipe.shape.half_length);
      const Vector3<Scalar> p = detail::plus(o, s, d);
      HandContact<Scalar> c;
      c.depth = pipe.shape.radius - p(2);
      const bool over = p(0) * p(0) + p(1) * p(1) < radius * radius;
      if (!over || !(c.depth > Scalar(0)) || !(p(2) > -pipe.shape.radius)) continue;
      c.normal = {Scalar(0), Scalar(0), Scalar(1)};
      c.point = detail::plus(p, -pipe.shape.radius, c.normal);
      c.force = options_.pad_stiffness * c.depth;
      contacts_[static_cast<std::size_t>(6 + side)] = c;
    }
  }

  Hand hand_;
  Options options_;
  HandReading<Scalar> reading_{};
  std::array<Angles, 3> finger_{zero(), zero(), zero()}, stretch_{zero(), zero(), zero()};
  std::array<HandContact<Scalar>, contact_count> contacts_{};
  std::array<bool, 3> jammed_{};
  bool power_{true};
};

}  // namespace icat
