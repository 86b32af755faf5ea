// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One vehicle-manipulator in water, moved by joint torques and a wrench on the vehicle.
///
/// The midpoint rule with one evaluation of the dynamics per step, of second order:
///
///     (q, ⁰T_v)½ = (q, ⁰T_v) moved by ẏ over dt/2,   ẏ½ = ẏ + dt/2 ÿ of the step before
///     ÿ = M⁻¹(f − c) at the midpoint,                ẏ ← ẏ + dt ÿ
///     (q, ⁰T_v) = (q, ⁰T_v)½ moved by the new ẏ over dt/2
///
/// Poses are moved exactly (`integrate`), so rotations stay rotations.
#pragma once

#include "icat/core/status.hpp"
#include "icat/math/cholesky.hpp"
#include "icat/sim/vehicle_manipulator_dynamics.hpp"

namespace icat {

template <class, int>
class GraspedObjectPlant;

/// State and integration, see the file comment.
template <class ScalarType, int ArmDof>
class HydrodynamicPlant {
 public:
  /// M and c.
  using Dynamics = VehicleManipulatorDynamics<ScalarType, ArmDof>;
  /// Scalar type.
  using Scalar = ScalarType;
  /// Joint positions or velocities.
  using VectorQ = typename Dynamics::VectorQ;
  /// ẏ, ÿ, f.
  using VectorN = typename Dynamics::VectorN;

  /// Where it starts.
  struct State {
    VectorQ q{VectorQ::Zero()};                      ///< rad or m
    Pose<Scalar> vehicle{Pose<Scalar>::Identity()};  ///< ⟨v⟩ in ⟨0⟩
    VectorN velocity{VectorN::Zero()};               ///< ẏ
  };

  /// @throws std::invalid_argument on a bad description (see `Dynamics`) or a start that is not
  /// finite or has no rotation.
  HydrodynamicPlant(const typename Dynamics::Description& description, const State& start)
      : dynamics_(description), state_(start), middle_(start) {
    if (!start.q.allFinite() || !start.velocity.allFinite() || !is_rigid(start.vehicle)) {
      detail::invalid("HydrodynamicPlant: the start is not finite or its pose not a rotation");
    }
    acceleration_.setZero();
  }

  /// One step of `dt` s under f = [τ; w] (N m or N; w at the origin of ⟨v⟩, components on ⟨v⟩),
  /// held over the step. What is not finite, or would become so: refused, the state stays. No
  /// allocation.
  Status step(const VectorN& force, Scalar dt) noexcept {
    const Status status = begin(force, dt);
    if (status != Status::ok) return status;
    factor_.solve_upper(reduced_);
    return finish(reduced_, dt);
  }

  /// Joint positions, rad or m.
  const VectorQ& q() const noexcept { return state_.q; }
  /// ⟨v⟩ in ⟨0⟩.
  const Pose<Scalar>& vehicle() const noexcept { return state_.vehicle; }
  /// ẏ.
  const VectorN& velocity() const noexcept { return state_.velocity; }
  /// q̇, rad/s or m/s.
  VectorQ joint_velocity() const noexcept { return state_.velocity.template head<ArmDof>(); }
  /// v with respect to ⟨0⟩, components on ⟨v⟩: what a DVL and gyros measure.
  Vector6<Scalar> vehicle_velocity() const noexcept { return state_.velocity.template tail<6>(); }
  /// ÿ of the last step.
  const VectorN& acceleration() const noexcept { return acceleration_; }
  /// The dynamics at the present state. Computed anew: for start-up, logs and tests.
  Dynamics dynamics() const noexcept {
    Dynamics now = dynamics_;
    now.update(state_.q, state_.vehicle, state_.velocity);
    return now;
  }

 private:
  // Holds its robots' steps open while it solves for the wrenches between them.
  friend class GraspedObjectPlant<Scalar, ArmDof>;

  // To the midpoint; then reduced_ = L⁻¹(f − c) with M = L Lᵀ.
  Status begin(const VectorN& force, Scalar dt) noexcept {
    if (!force.allFinite() || !std::isfinite(dt)) return Status::non_finite;
    middle_.velocity = state_.velocity + (dt / Scalar(2)) * acceleration_;
    middle_.q = state_.q + (dt / Scalar(2)) * state_.velocity.template head<ArmDof>();
    middle_.vehicle = integrate<Scalar>(state_.vehicle, vehicle_velocity(), dt / Scalar(2));
    dynamics_.update(middle_.q, middle_.vehicle, middle_.velocity);
    if (!factor_.compute(dynamics_.mass_matrix())) return Status::numerical_failure;
    reduced_ = force - dynamics_.bias();
    factor_.solve_lower(reduced_);
    return Status::ok;
  }

  // From the midpoint to the end of the step.
  Status finish(const VectorN& acceleration, Scalar dt) noexcept {
    const VectorN velocity = state_.velocity + dt * acceleration;
    if (!velocity.allFinite()) return Status::numerical_failure;
    acceleration_ = acceleration;
    state_.velocity = velocity;
    state_.q = middle_.q + (dt / Scalar(2)) * velocity.template head<ArmDof>();
    state_.vehicle = integrate<Scalar>(middle_.vehicle, vehicle_velocity(), dt / Scalar(2));
    return Status::ok;
  }

  Dynamics dynamics_;
  State state_, middle_;
  VectorN acceleration_, reduced_;
  detail::Cholesky<Scalar, ArmDof + 6> factor_;
};

}  // namespace icat
