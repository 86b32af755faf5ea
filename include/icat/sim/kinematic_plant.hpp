// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A vehicle-manipulator without dynamics, for simulation.
///
///     q̇ as commanded
///     τ v̇_r = v̄ − v_r                       the vehicle tracks with a lag τ (0: at once)
///     v = v_r + ᵛR₀ w(t)                     and is carried along by a current w
///     (q, ⁰T_v) integrated exactly for velocities held over the step
#pragma once

#include <array>
#include <cmath>
#include <functional>

#include "icat/core/error.hpp"
#include "icat/math/rigid_motion.hpp"

namespace icat {

/// State and integration, see the file comment.
template <class Scalar, int ArmDof>
class KinematicPlant {
 public:
  /// Joint positions or velocities.
  using VectorQ = Vector<Scalar, ArmDof>;
  /// Settings, with defaults.
  struct Options {
    VectorQ q{detail::zeros<VectorQ>(ArmDof)};              ///< at the start, rad or m
    Pose<Scalar> vehicle{detail::identity_pose<Scalar>()};  ///< ⟨v⟩ in ⟨0⟩ at the start
    Scalar tracking_lag{0};                                 ///< τ, s
    std::array<bool, 6> actuated{true, true, true, true, true, true};  ///< else v_r stays 0
    std::function<Vector3<Scalar>(Scalar time)> current{};  ///< w, components on ⟨0⟩, m/s
  };

  /// @throws std::invalid_argument on a state that is not finite or a lag below 0.
  explicit KinematicPlant(const Options& options)
      : options_(options), q_(options.q), vehicle_(options.vehicle) {
    if (!detail::all_finite(q_) || !detail::all_finite(vehicle_.matrix())) {
      detail::invalid("KinematicPlant: the initial state is not finite");
    }
    if (!(options.tracking_lag >= Scalar(0))) {
      detail::invalid("KinematicPlant: tracking_lag must be >= 0, got ", options.tracking_lag);
    }
    relative_ = velocity_ = detail::zeros<Vector6<Scalar>>(6);
  }

  /// From `time` to `time + dt` under the commands q̇ and v̄ (components on ⟨v⟩).
  template <class Q, class V>
  void step(const Q& joint_velocity, const V& vehicle_velocity, Scalar time, Scalar dt) {
    const Scalar keep =
        options_.tracking_lag > Scalar(0) ? std::exp(-dt / options_.tracking_lag) : Scalar(0);
    for (Index i = 0; i < 6; ++i) {
      if (!options_.actuated[static_cast<std::size_t>(i)]) continue;
      relative_(i) = vehicle_velocity(i) + keep * (relative_(i) - vehicle_velocity(i));
    }
    velocity_ = relative_;
    if (options_.current) {
      const Vector3<Scalar> w =
          detail::transposed_times(detail::rotation(vehicle_), options_.current(time));
      for (Index i = 0; i < 3; ++i) velocity_(i) += w(i);
    }
    for (Index i = 0; i < ArmDof; ++i) q_(i) += dt * joint_velocity(i);
    vehicle_ = integrate(vehicle_, velocity_, dt);
  }

  /// Joint positions, rad or m.
  const VectorQ& q() const noexcept { return q_; }
  /// ⟨v⟩ in ⟨0⟩.
  const Pose<Scalar>& vehicle() const noexcept { return vehicle_; }
  /// v over the last step, with respect to ⟨0⟩, components on ⟨v⟩: what a DVL and gyros measure.
  const Vector6<Scalar>& vehicle_velocity() const noexcept { return velocity_; }

 private:
  Options options_;
  VectorQ q_;
  Pose<Scalar> vehicle_;
  Vector6<Scalar> relative_, velocity_;
};

}  // namespace icat
