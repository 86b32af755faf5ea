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
///
/// The water is still. In a current c that is the same everywhere and always, let ⟨0⟩ here drift
/// with it: nothing in the dynamics changes, and over the ground the vehicle is at t + c time and
/// moves with v + [Rᵀ c; 0].
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
    VectorQ q = Filled{0};                  ///< rad or m
    Pose<Scalar> vehicle = IdentityPose{};  ///< ⟨v⟩ in ⟨0⟩
    VectorN velocity = Filled{0};           ///< ẏ
  };

  /// @throws std::invalid_argument on a bad description (see `Dynamics`) or a start that is not
  /// finite or has no rotation.
  HydrodynamicPlant(const typename Dynamics::Description& description, const State& start)
      : dynamics_(description), state_(start), next_(start) {
    if (!start.q.allFinite() || !start.velocity.allFinite() || !is_rigid(start.vehicle)) {
      detail::invalid("HydrodynamicPlant: the start is not finite or its pose not a rotation");
    }
    acceleration_.setZero();
  }

  /// One step of `dt` s under f = [τ; w] (N m or N; w at the origin of ⟨v⟩, components on ⟨v⟩),
  /// held over the step. What is not finite, or would become so: refused, the state stays. No
  /// allocation.
  Status step(const VectorN& force, double dt) noexcept {
    Status status = begin(force, static_cast<Scalar>(dt));
    if (status != Status::ok) return status;
    factor_.solve_upper(reduced_);
    status = finish(static_cast<Scalar>(dt));
    if (status == Status::ok) accept();
    return status;
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
  /// The dynamics at the present state, until the next step. Computed when first asked for: for
  /// start-up, logs and tests; so one plant is not for two threads at once. No allocation.
  const Dynamics& dynamics() const noexcept {
    if (!at_present_) {
      at_present_ = dynamics_.update(state_.q, state_.vehicle, state_.velocity) == Status::ok;
    }
    return dynamics_;
  }

 private:
  // Holds its robots' steps open while it solves for the wrenches between them.
  friend class GraspedObjectPlant<Scalar, ArmDof>;

  // A step has three parts: to the midpoint, then reduced_ = L⁻¹(f − c) with M = L Lᵀ, …
  Status begin(const VectorN& force, Scalar dt) noexcept {
    if (!force.allFinite() || !std::isfinite(dt)) return Status::non_finite;
    next_.velocity = state_.velocity + (dt / Scalar(2)) * acceleration_;
    next_.q = state_.q + (dt / Scalar(2)) * state_.velocity.template head<ArmDof>();
    next_.vehicle = integrate<Scalar>(state_.vehicle, vehicle_velocity(), dt / Scalar(2));
    at_present_ = false;
    if (dynamics_.update(next_.q, next_.vehicle, next_.velocity) != Status::ok) {
      return Status::numerical_failure;
    }
    if (!factor_.compute(dynamics_.mass_matrix())) return Status::numerical_failure;
    reduced_ = force - dynamics_.bias();
    factor_.solve_lower(reduced_);
    return Status::ok;
  }

  // … to the end of the step, with ÿ in reduced_, …
  Status finish(Scalar dt) noexcept {
    next_.velocity = state_.velocity + dt * reduced_;
    next_.q += (dt / Scalar(2)) * next_.velocity.template head<ArmDof>();
    next_.vehicle = integrate<Scalar>(
        next_.vehicle, Vector6<Scalar>(next_.velocity.template tail<6>()), dt / Scalar(2));
    const bool finite = next_.velocity.allFinite() && next_.q.allFinite() &&
                        detail::all_finite(next_.vehicle.matrix());
    return finite ? Status::ok : Status::numerical_failure;
  }

  // … and from then on that is the state.
  void accept() noexcept {
    acceleration_ = reduced_;
    state_ = next_;
  }

  mutable Dynamics dynamics_;
  mutable bool at_present_{false};
  State state_, next_;
  VectorN acceleration_, reduced_;
  detail::Cholesky<Scalar, ArmDof + 6> factor_;
};

}  // namespace icat
