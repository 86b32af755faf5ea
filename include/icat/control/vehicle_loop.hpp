// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The velocity loop of a vehicle: a PI loop for each component of the wrench, with feed-forward
/// [MARIS, III-C]. The paper prints neither equations nor gains; these are ours.
///
/// A model of the vehicle follows the reference r as a first-order lag, and the vehicle follows the
/// model, ṽ, with both poles at −ω, the bandwidth of the component:
///
///     ã = ω (r − ṽ)
///     u = w(ṽ, ã) + 2 m ω (ṽ − v) + s,   ṡ = m ω² (ṽ − v)
///
/// m is what the component's inertia is in the body, added mass included. The feed-forward w is the
/// wrench that the body takes to move so through water that moves with the current ĉ, seen from the
/// water (Kirchhoff's equations, drag, weight and buoyancy of model/rigid_body.hpp):
///
///     w(ṽ, ã) = M ã_r + V_r ×* (M V_r) − w_drag(V_r) − w_weight
///     V_r = ṽ − [Rᵀ ĉ; 0],   ã_r = ã + [ω̃ × Rᵀ ĉ; 0]
///
/// A component that is not controlled counts in w as measured.
///
/// Anti-windup. Thrusters achieve u* instead of u, and the model moves only by u*:
///
///     d/dt ṽ = ã − (u − u*) / m
///
/// For a vehicle that differs from the model by a force d, the error e = ṽ − v then obeys
/// m ė = −2 m ω e − s − d for any u*: s goes to −d, and does not wind up in saturation.
#pragma once

#include <algorithm>
#include <cmath>

#include "icat/control/command_ramp.hpp"
#include "icat/control/pi_loop.hpp"
#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/core/step_clock.hpp"
#include "icat/core/types.hpp"
#include "icat/math/rigid_motion.hpp"
#include "icat/model/rigid_body.hpp"
#include "icat/tpik/level_check.hpp"

namespace icat {

/// See the file comment. After construction nothing allocates or throws but `set_body`.
template <class Scalar>
class VehicleLoop {
 public:
  /// Along and about the axes of ⟨v⟩.
  using Vector6 = icat::Vector6<Scalar>;

  /// Of one cycle.
  struct Input {
    Vector6 reference;         ///< r, of ⟨v⟩ over the ground, components on ⟨v⟩: m/s, rad/s
    Vector6 velocity;          ///< v, the same as measured; all six
    Matrix3<Scalar> attitude;  ///< R, ⟨v⟩ in ⟨0⟩, z down
    Vector3<Scalar> current = Filled{0};  ///< ĉ, of the water over the ground, on ⟨0⟩, m/s
  };

  /// @param body       what the vehicle is thought to be; its `pose` in ⟨v⟩
  /// @param bandwidth  ω of each component, rad/s; 0: it is not controlled, its wrench is 0
  /// @param time       as of controllers: input that is refused for longer than `hold` takes the
  ///                   wrench to zero, and the vehicle coasts
  ///                   The period is the caller's, so no bandwidth is refused for it: ω times the
  ///                   period has to stay well below 1/2 (docs/vehicle.md)
  /// @throws std::invalid_argument on a bandwidth that is not finite and >= 0, or makes gains that
  /// are not finite, on a bad body (see `VehicleManipulatorDynamics`) or time.
  [[gnu::cold]] VehicleLoop(const RigidBody<Scalar>& body, const Vector6& bandwidth,
                            const TimeOptions& time = TimeOptions())
      : body_(owner, "the vehicle", body),
        bandwidth_(checked(bandwidth)),
        loop_(typename PiLoop<Scalar, 6>::Options{}),
        clock_(time.max_step),
        ramp_(6, time),
        hold_(time.hold) {
    set_body(body);
    detail::fill(model_, Scalar(0));
    detail::fill(acceleration_, Scalar(0));
    detail::fill(lacking_, Scalar(0));
    detail::fill(answer_, Scalar(0));
    detail::fill(wrench_, Scalar(0));
    ramp_.start();
  }

  /// Changes the vehicle's model, such as for a payload; gains follow, model state and integral
  /// continue. Not for the control step.
  /// @throws std::invalid_argument on a bad body, and changes nothing then.
  [[gnu::cold]] void set_body(const RigidBody<Scalar>& body) {
    const detail::Body<Scalar> checked_body(owner, "the vehicle", body);
    const Matrix6<Scalar> M = detail::Body<Scalar>::inertia(checked_body.place()).matrix();
    Vector6 inertia;
    for (Index i = 0; i < 6; ++i) {
      inertia(i) = M(i, i);
      const Scalar gain = inertia(i) * std::max(Scalar(2), bandwidth_(i)) * bandwidth_(i);
      if (!std::isfinite(gain)) {
        detail::invalid(owner, ": bandwidth ", i, " is too large, got ", bandwidth_(i));
      }
    }
    loop_.retune(PiLoop<Scalar, 6>::tuned(inertia, bandwidth_));
    body_ = checked_body;
    inertia_ = inertia;
  }

  /// The wrench for this cycle. Refused: NaN, infinity, speeds beyond 1e6, an attitude that is no
  /// rotation, input that is too old. The wrench then stays for `hold`, goes to zero, and comes
  /// back when all is well, from the velocity as it is measured then. No allocation.
  /// @param time  s, any origin, see StepClock
  /// @param input what is wanted and what is measured
  /// @param age   of attitude (`state` or `pose`) and `velocity`
  Status step(double time, const Input& input, InputAge age = {}) noexcept {
    Status status = clock_.advance(time);
    if (status == Status::ok) status = check(input, age);
    const Cycle now = clock_.since(time_);
    move_model(static_cast<Scalar>(now.step));
    if (status == Status::ok) status = control(input, now.step);
    ramp_.update(status, now);
    if (status != Status::ok && ramp_.gain() < 1) restarts_ = true;
    detail::copy(ramp_.wanted(answer_), wrench_);
    return achieved(wrench_) == Status::ok ? status : Status::numerical_failure;
  }

  /// The part of the last wrench that the thrusters achieved, see `ThrusterAllocation::achieved`;
  /// without a call, all of it. NaN or infinity: refused, all of it counts as achieved.
  Status achieved(const Vector6& wrench) noexcept {
    const bool finite = wrench.allFinite();
    for (Index i = 0; i < 6; ++i) {
      lacking_(i) = answer_(i) - (finite ? wrench(i) : wrench_(i));
    }
    return finite ? Status::ok : Status::non_finite;
  }

  /// u, [force; torque] at the origin of ⟨v⟩, components on ⟨v⟩: N, N m; 0 where not controlled.
  const Vector6& wrench() const noexcept { return wrench_; }
  /// ṽ: where the vehicle should be on its way to the reference; m/s, rad/s.
  const Vector6& model_velocity() const noexcept { return model_; }
  /// s, the integral part: the wrench that the model does not contain, N and N m.
  const Vector6& integral() const noexcept { return loop_.integral(); }

 private:
  static constexpr const char* owner = "VehicleLoop";

  [[gnu::cold]] static Vector6 checked(const Vector6& bandwidth) {
    for (Index i = 0; i < 6; ++i) {
      if (!(bandwidth(i) >= Scalar(0)) || !std::isfinite(bandwidth(i))) {
        detail::invalid(owner, ": bandwidth ", i, " must be finite and >= 0, got ", bandwidth(i));
      }
    }
    return bandwidth;
  }
  bool controlled(Index i) const noexcept { return bandwidth_(i) > Scalar(0); }

  Status check(const Input& in, const InputAge& age) const noexcept {
    if (clock_.stalled()) return Status::clock_stalled;
    if (const Status old = detail::check_age(age, hold_); old != Status::ok) return old;
    if (!(age.velocity <= hold_)) return Status::stale_velocity;
    Scalar largest(0);
    bool finite = true;
    const auto look = [&](Scalar x) {
      finite = finite && std::isfinite(x);
      largest = std::max(largest, std::abs(x));
    };
    for (Index i = 0; i < 6; ++i) look(in.velocity(i));
    for (Index i = 0; i < 6; ++i) {
      if (controlled(i)) look(in.reference(i));
    }
    for (Index i = 0; i < 3; ++i) look(in.current(i));
    for (Index i = 0; i < 9; ++i) finite = finite && std::isfinite(in.attitude.data()[i]);
    if (!finite) return Status::non_finite;
    if (largest > Scalar(implausible_speed)) return Status::implausible;
    const Vector3<Scalar> origin = Filled{0};
    return is_rigid(detail::make_pose(in.attitude, origin)) ? Status::ok : Status::not_a_rotation;
  }

  // With what it was told to do, and what the thrusters left of that, for `dt` s.
  void move_model(Scalar dt) noexcept {
    for (Index i = 0; i < 6; ++i) {
      if (!controlled(i)) continue;
      // A step longer than 1/ω would overshoot the reference.
      const Scalar h = std::min(dt, Scalar(1) / bandwidth_(i));
      model_(i) += h * (acceleration_(i) - lacking_(i) / inertia_(i));
      // NaN, too.
      if (!(std::abs(model_(i)) <= Scalar(implausible_speed))) restarts_ = true;
    }
  }

  Status control(const Input& in, double dt) noexcept {
    for (Index i = 0; i < 6; ++i) {
      if (restarts_ || !controlled(i)) model_(i) = in.velocity(i);
      acceleration_(i) = controlled(i) ? bandwidth_(i) * (in.reference(i) - model_(i)) : Scalar(0);
    }
    restarts_ = false;
    const Matrix3<Scalar> back = in.attitude.transpose();
    const Vector3<Scalar> water = back * in.current, down = Scalar(9.81) * back.col(2);
    auto V = detail::Spatial<Scalar>::of(model_), a = detail::Spatial<Scalar>::of(acceleration_);
    V.linear -= water;
    a.linear += V.angular.cross(water);
    const Matrix3<Scalar> here = IdentityMatrix{};
    const Vector6 feed_forward = body_.wrench(body_.place(), here, V, a, down).vector();
    const Status status = loop_.update(model_, in.velocity, feed_forward, dt);
    for (Index i = 0; i < 6; ++i) answer_(i) = controlled(i) ? loop_.output()(i) : Scalar(0);
    return status;
  }

  detail::Body<Scalar> body_;
  Vector6 bandwidth_, inertia_;
  PiLoop<Scalar, 6> loop_;
  StepClock clock_;
  CycleTime time_;
  detail::CommandRamp<Scalar, 6> ramp_;
  double hold_;
  Vector6 model_, acceleration_, lacking_, answer_, wrench_;  // ṽ, ã, u − u*; u before the ramp, u
  bool restarts_{true};
};

}  // namespace icat
