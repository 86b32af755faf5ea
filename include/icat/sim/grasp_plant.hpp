// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Simulates a pipe on the floor and a hand that closes on it and lifts it.
///
/// There is no rule for success: contact forces alone decide whether the pipe is held. The pipe is
/// a free body in water (rigid_body.hpp); the hand's links and palm (hand_plant.hpp) and the floor
/// press on it. At each contact, with the normal force f and the sliding velocity v_t of the pipe
/// on what it touches,
///
///     f = max(0, f_pad − c v_n),    ‖f_t‖ ≤ μ f,    f_t = −k_t s − c v_t,    ṡ = v_t
///
/// s, the tangential compression of the pad, is kept where ‖k_t s‖ ≤ μ f (Coulomb's friction with
/// pads of Dahl's kind: at rest it holds without creeping). So a grasp misses where no link meets
/// the pipe, pushes it away where one side alone does, squeezes it out where it is met beyond its
/// middle, and loses it on the way where friction does not carry weight and acceleration.
///
/// The hand's motion is given; `wrench` is the wrench of the pipe on the hand. Semi-implicit Euler
/// steps of at most 0.5 ms, shorter for light pipes. [MARIS] prints no model of it: this one and
/// its numbers are ours; μ = 0.2 is that of wet plastics.
#pragma once

#include "icat/math/cholesky.hpp"
#include "icat/model/maris_bodies.hpp"
#include "icat/sim/hand_plant.hpp"

namespace icat {

/// See the file comment.
template <class ScalarType>
class GraspPlant {
 public:
  /// Scalar type.
  using Scalar = ScalarType;
  /// SI units.
  struct Options {
    RigidBody<Scalar> body{};                                ///< the pipe, along x of its frame
    PipeShape<Scalar> shape{};                               ///< the pipe
    Scalar friction = static_cast<Scalar>(0.2);              ///< μ of the hand's pads
    Scalar floor_friction = static_cast<Scalar>(0.3);        ///< μ of the floor
    Scalar floor = static_cast<Scalar>(4);                   ///< z of the floor in ⟨0⟩, m
    Scalar floor_stiffness = static_cast<Scalar>(2e4);       ///< N/m
    Scalar tangential_stiffness = static_cast<Scalar>(1e4);  ///< k_t, N/m
    Scalar damping = Scalar(40);                             ///< c, N s/m
    Scalar gravity = static_cast<Scalar>(9.81);              ///< along z of ⟨0⟩, m/s²
  };

  /// The pipe at rest at `pose` in ⟨0⟩.
  /// @throws std::invalid_argument on a bad body, pose or number.
  [[gnu::cold]] GraspPlant(const HandPlant<Scalar>& hand, const Options& options,
                           const Pose<Scalar>& pose)
      : hand_(hand), options_(options), body_("GraspPlant", "the pipe", options.body), pose_(pose) {
    detail::require_positive("GraspPlant", "radius", options.shape.radius);
    detail::require_positive("GraspPlant", "half_length", options.shape.half_length);
    detail::require_positive("GraspPlant", "floor_stiffness", options.floor_stiffness);
    detail::require_positive("GraspPlant", "tangential_stiffness", options.tangential_stiffness);
    for (const Scalar x : {options.friction, options.floor_friction, options.damping}) {
      if (!(x >= Scalar(0)) || !std::isfinite(x)) {
        detail::invalid("GraspPlant: friction and damping must be finite and >= 0, got ", x);
      }
    }
    if (!std::isfinite(options.floor) || !std::isfinite(options.gravity)) {
      detail::invalid("GraspPlant: floor and gravity must be finite");
    }
    if (!is_rigid(pose)) detail::invalid("GraspPlant: the pipe's pose is none");
    // An explicit step with several contacts is stable for k dt² and c dt well below the mass.
    const double mass = double(options.body.mass);
    const double k =
        std::max({double(hand.options().pad_stiffness), double(options.tangential_stiffness),
                  double(options.floor_stiffness)});
    longest_ = std::min(longest_, std::sqrt(mass / (20 * k)));
    longest_ = std::min(longest_, mass / (5 * std::max(double(options.damping), 1e-6)));
    if (!(longest_ > 1e-5)) {
      detail::invalid("GraspPlant: a pipe of ", mass, " kg is too light for pads so stiff");
    }
    if (!inertia_.compute(detail::Body<Scalar>::inertia(body_.place()).matrix())) {
      detail::invalid("GraspPlant: the pipe's inertia is not positive");
    }
  }

  /// `command` for `dt` s, >= 0 and at most 1. `hand`: ⟨h⟩ in ⟨0⟩ at the beginning, `twist`: its
  /// [v; ω] over ground on ⟨h⟩ meanwhile. Refused input changes nothing; `numerical_failure`: the
  /// state would not be finite, and stays that of the last good part of the step. No allocation.
  Status step(const HandCommand<Scalar>& command, const Pose<Scalar>& hand,
              const Vector6<Scalar>& twist, double dt) noexcept {
    const Status status = HandPlant<Scalar>::check(command, dt);
    if (status != Status::ok) return status;
    if (!detail::all_finite(twist)) return Status::non_finite;
    if (dt > 1) return Status::out_of_range;
    if (!is_rigid(hand)) return Status::not_a_rotation;
    const int parts = std::max(1, static_cast<int>(std::ceil(dt / longest_ - 1e-9)));
    const double part = dt / parts;
    Pose<Scalar> at = hand;
    Vector6<Scalar> sum = Filled{0};
    for (int i = 0; i < parts; ++i) {
      const Status done = part_step(command, at, twist, part, sum);
      if (done != Status::ok) return done;
      at = integrate<Scalar>(at, twist, static_cast<Scalar>(part));
    }
    for (Index i = 0; i < 6; ++i) wrench_(i) = sum(i) / static_cast<Scalar>(parts);
    pipe_in_hand_ = relative(at);
    return Status::ok;
  }

  /// The hand.
  const HandPlant<Scalar>& hand() const noexcept { return hand_; }
  /// Its faults.
  void set_power(bool there) noexcept { hand_.set_power(there); }
  /// Likewise.
  void set_jammed(HandGroup group, bool jammed) noexcept { hand_.set_jammed(group, jammed); }
  /// The pipe in ⟨0⟩.
  const Pose<Scalar>& pipe() const noexcept { return pose_; }
  /// Its twist over ground, on itself.
  const Vector6<Scalar>& pipe_velocity() const noexcept { return velocity_; }
  /// The pipe in ⟨h⟩ after the last step; before the first, the identity.
  const Pose<Scalar>& pipe_in_hand() const noexcept { return pipe_in_hand_; }
  /// The pipe touches the floor.
  bool on_floor() const noexcept { return on_floor_; }
  /// [N; N m] of the pipe on the hand at the origin of ⟨h⟩, on ⟨h⟩; mean of the last step.
  const Vector6<Scalar>& wrench() const noexcept { return wrench_; }

 private:
  Pose<Scalar> relative(const Pose<Scalar>& hand) const noexcept {
    const Matrix3<Scalar> back = detail::transpose(detail::rotation(hand));
    const Vector3<Scalar> o =
        detail::times(back, detail::minus(detail::origin(pose_), detail::origin(hand)));
    return detail::make_pose(detail::times(back, detail::rotation(pose_)), o);
  }

  // What acts at the point r from the pipe's origin, on ⟨0⟩: its normal and its friction. `sliding`
  // of the pipe, on ⟨0⟩; `stretch` is moved on. Returns the force on the pipe.
  Vector3<Scalar> contact_force(Scalar pad, Scalar friction, const Vector3<Scalar>& normal,
                                const Vector3<Scalar>& sliding, Vector3<Scalar>& stretch,
                                Scalar dt) const noexcept {
    using detail::dot;
    using detail::plus;
    using detail::scaled;
    const Scalar leaving = dot(sliding, normal);
    const Scalar force = std::max(pad - options_.damping * leaving, Scalar(0));
    const Vector3<Scalar> along = plus(sliding, -leaving, normal);
    stretch = plus(stretch, dt, along);
    stretch = plus(stretch, -dot(stretch, normal), normal);
    const Scalar most = friction * force, k = options_.tangential_stiffness;
    const Scalar length = detail::norm(stretch);
    if (k * length > most) stretch = scaled(stretch, most / (k * length));
    Vector3<Scalar> tangential =
        scaled(plus(scaled(stretch, k), options_.damping, along), Scalar(-1));
    const Scalar size = detail::norm(tangential);
    if (size > most) tangential = scaled(tangential, most / size);
    return plus(tangential, force, normal);
  }

  Status part_step(const HandCommand<Scalar>& command, const Pose<Scalar>& hand,
                   const Vector6<Scalar>& twist, double part, Vector6<Scalar>& wrench) noexcept {
    const Scalar dt = static_cast<Scalar>(part);
    const PipeInHand<Scalar> pipe{options_.shape, relative(hand)};
    // Out of reach there is nothing to look for.
    const auto& g = hand_.hand().geometry();
    const Scalar reach = g.base_x + g.base_y + g.height + g.proximal + g.distal + g.palm_radius +
                         options_.shape.half_length + Scalar(2) * options_.shape.radius;
    const bool near = detail::norm(detail::origin(pipe.pose)) < reach;
    const Status status = hand_.step(command, near ? &pipe : nullptr, part);
    if (status != Status::ok) return status;

    const Matrix3<Scalar> R = detail::rotation(pose_), H = detail::rotation(hand);
    const Vector3<Scalar> o = detail::origin(pose_);
    const Vector3<Scalar> v = detail::times(R, detail::column3(velocity_, 0, 0));
    const Vector3<Scalar> w = detail::times(R, detail::column3(velocity_, 3, 0));
    Vector3<Scalar> force(Scalar(0), Scalar(0), Scalar(0)), moment = force;  // at o, on ⟨0⟩
    const auto add = [&](const Vector3<Scalar>& f, const Vector3<Scalar>& r) {
      force = detail::plus(force, f);
      moment = detail::plus(moment, detail::cross(r, f));
    };
    for (std::size_t i = 0; i < stretch_.size(); ++i) {
      const HandContact<Scalar>& c = hand_.contacts()[i];
      if (!(c.force > Scalar(0))) {
        stretch_[i] = Filled{0};
        continue;
      }
      const Vector3<Scalar> r = detail::minus(detail::transform(hand, c.point), o);
      const Vector3<Scalar> pad =
          detail::times(H, detail::plus(detail::velocity_at(twist, Index(0), c.point), c.velocity));
      const Vector3<Scalar> sliding = detail::minus(detail::plus(v, detail::cross(w, r)), pad);
      // The pad turns with the hand.
      Vector3<Scalar> s = detail::times(H, stretch_[i]);
      const Vector3<Scalar> f =
          contact_force(c.force, options_.friction, detail::times(H, c.normal), sliding, s, dt);
      stretch_[i] = detail::transposed_times(H, s);
      add(f, r);
      const Vector3<Scalar> back = detail::scaled(detail::transposed_times(H, f), Scalar(-1));
      const Vector3<Scalar> turn = detail::cross(c.point, back);
      for (Index k = 0; k < 3; ++k) wrench(k) += back(k), wrench(3 + k) += turn(k);
    }
    on_floor_ = false;
    const auto end = MarisHand<Scalar>::ends(options_.shape, pose_);
    for (std::size_t i = 0; i < 2; ++i) {
      const Vector3<Scalar>& p = i == 0 ? end.from : end.to;
      const Scalar depth = p(2) + options_.shape.radius - options_.floor;
      if (!(depth > Scalar(0))) {
        floor_stretch_[i] = Filled{0};
        continue;
      }
      on_floor_ = true;
      const Vector3<Scalar> up(Scalar(0), Scalar(0), Scalar(-1));
      const Vector3<Scalar> r = detail::plus(detail::minus(p, o), -options_.shape.radius, up);
      add(contact_force(options_.floor_stiffness * depth, options_.floor_friction, up,
                        detail::plus(v, detail::cross(w, r)), floor_stretch_[i], dt),
          r);
    }

    const Vector3<Scalar> weight(Scalar(0), Scalar(0), options_.gravity);
    Vector6<Scalar> a =
        body_
            .wrench(body_.place(), detail::identity<Matrix3<Scalar>>(3),
                    detail::Spatial<Scalar>::of(velocity_), detail::Spatial<Scalar>::zero(),
                    detail::transposed_times(R, weight))
            .vector();
    const Vector3<Scalar> f = detail::transposed_times(R, force),
                          m = detail::transposed_times(R, moment);
    for (Index i = 0; i < 3; ++i) {
      a(i) = f(i) - a(i);
      a(3 + i) = m(i) - a(3 + i);
    }
    inertia_.solve(a);
    Vector6<Scalar> next;
    for (Index i = 0; i < 6; ++i) next(i) = velocity_(i) + dt * a(i);
    const Pose<Scalar> moved = integrate<Scalar>(pose_, next, dt);
    if (!detail::all_finite(next) || !detail::all_finite(moved.matrix())) {
      return Status::numerical_failure;
    }
    velocity_ = next;
    pose_ = moved;
    return Status::ok;
  }

  HandPlant<Scalar> hand_;
  Options options_;
  double longest_{5e-4};  // s
  detail::Body<Scalar> body_;
  detail::Cholesky<Scalar, 6> inertia_;
  Pose<Scalar> pose_, pipe_in_hand_ = IdentityPose{};
  Vector6<Scalar> velocity_ = Filled{0}, wrench_ = Filled{0};
  std::array<Vector3<Scalar>, HandPlant<Scalar>::contact_count> stretch_{zeros<8>()};  // on ⟨h⟩
  std::array<Vector3<Scalar>, 2> floor_stretch_{zeros<2>()};                           // on ⟨0⟩
  bool on_floor_{false};

  template <std::size_t N>
  static std::array<Vector3<Scalar>, N> zeros() noexcept {
    std::array<Vector3<Scalar>, N> all;
    for (auto& x : all) x = Filled{0};
    return all;
  }
};

}  // namespace icat
