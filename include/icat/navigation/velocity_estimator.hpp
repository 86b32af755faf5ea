// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Linear velocity over ground and the current of the water: the second of four estimators in
/// [MARIS, V], which prints no equations. Ours, x = (u, v, w, c_N, c_E, W), v on ⟨v⟩, c on ⟨0⟩:
///
///     v_r = v − Rᵀ c,   M (v̇_r + w₁) = f + Rᵀ W z − (d + D |v_r|) v_r − ω × M v_r
///     ċ = w₂,   Ẇ = w₃
///     z = v + ω × r + n                                         (DVL at r, see dvl.hpp)
///
/// The model of thrust and drag yields the velocity through the water, the DVL measures the
/// velocity over ground; the current is the difference. Without DVL the prediction continues with
/// the last current. An error of the drag appears as a current: 10 % of it are 5 % of the speed. So
/// does a horizontal force that is not in f. A vertical one appears as weight W in water, which is
/// never known exactly: ballast, or a load in the hand. If the gate restarts the velocity, the
/// variances of current and weight grow, too.
///
/// The attitude R is taken as exact, and water moves horizontally only. Drag is taken at the end of
/// a step, to first order (Rosenbrock's step): stable for any dt.
#pragma once

#include "icat/math/rigid_motion.hpp"
#include "icat/navigation/dvl.hpp"
#include "icat/navigation/history.hpp"
#include "icat/navigation/kalman.hpp"
#include "icat/navigation/vehicle_model.hpp"

namespace icat {

/// See the file comment. After construction no allocation, no exception.
template <class Scalar>
class VelocityEstimator {
 public:
  /// Noise, standard deviations; and the instrument.
  struct Options {
    Scalar acceleration_noise = static_cast<Scalar>(0.005);  ///< w₁, m/s²/√Hz, > 0
    Scalar current_noise = static_cast<Scalar>(3e-4);        ///< w₂, m/s/√s
    Scalar beam_noise = static_cast<Scalar>(0.01);           ///< of each beam, m/s, > 0
    Scalar initial_velocity = static_cast<Scalar>(0.1);      ///< of v at first, m/s
    Scalar initial_current = static_cast<Scalar>(0.3);       ///< of c at first, m/s
    Scalar weight_noise = static_cast<Scalar>(0.1);          ///< w₃, N/√s
    Scalar initial_weight = static_cast<Scalar>(30);         ///< of W at first, N; 0: it is known
    DvlGeometry<Scalar> dvl{};                               ///< place and beams
  };
  /// Of (v, c).
  using Covariance = detail::Square<Scalar, 5>;

  /// v = 0, c = 0, W that of the model.
  /// @throws std::invalid_argument on a model, noise or geometry that is out of range.
  explicit VelocityEstimator(const VehicleModel<Scalar>& model, const Options& options = Options())
      : model_(model), options_(options) {
    detail::check_model("VelocityEstimator", model);
    detail::check_geometry("VelocityEstimator", options.dvl);
    detail::require_positive("VelocityEstimator", "acceleration_noise", options.acceleration_noise);
    detail::require_positive("VelocityEstimator", "beam_noise", options.beam_noise);
    const auto check = [](const char* name, Scalar value) {
      detail::require_non_negative("VelocityEstimator", name, value);
    };
    check("current_noise", options.current_noise);
    check("initial_velocity", options.initial_velocity);
    check("initial_current", options.initial_current);
    check("weight_noise", options.weight_noise);
    check("initial_weight", options.initial_weight);
    for (int i = 0; i < 6; ++i) {
      const Scalar deviation = i < 3   ? options.initial_velocity
                               : i < 5 ? options.initial_current
                                       : options.initial_weight;
      P_(i, i) = deviation * deviation;
    }
  }

  /// What is not finite or no rotation is refused and changes nothing. No allocation.
  /// @param force     f, of the thrusters and what else is known but weight and drag, on ⟨v⟩, N
  /// @param attitude  R from ⟨v⟩ to ⟨0⟩, at the end of the step
  /// @param angular   ω on ⟨v⟩, rad/s
  /// @param dt        s, >= 0; more than 1 s counts as 1 s
  Status predict(const Vector3<Scalar>& force, const Matrix3<Scalar>& attitude,
                 const Vector3<Scalar>& angular, double dt) noexcept {
    Status status = detail::check_input(force);
    if (status == Status::ok) status = detail::check_input(angular);
    if (status == Status::ok) status = detail::check_step(dt);
    if (status != Status::ok) return status;
    if (!is_rigid(detail::make_pose(attitude, Vector3<Scalar>(0, 0, 0)))) {
      return Status::not_a_rotation;
    }
    if (!started_) attitude_ = attitude;
    started_ = true;
    const Scalar h = static_cast<Scalar>(dt);
    const Vector3<Scalar> water = water_velocity();

    // B = ∂v_r⁺/∂v_r
    Matrix3<Scalar> B;
    Matrix6<Scalar> F = IdentityMatrix{};
    Vector3<Scalar> momentum, next;
    for (Index i = 0; i < 3; ++i) momentum(i) = model_.inertia(i) * water(i);
    const Vector3<Scalar> turning = detail::cross(angular, momentum);
    const Matrix3<Scalar> W = skew(angular);
    for (Index i = 0; i < 3; ++i) {
      const Scalar m = model_.inertia(i);
      const detail::SpreadDrag<Scalar> drag(model_.linear_drag(i), model_.quadratic_drag(i),
                                            water(i), water_variance(i));
      const Scalar keep = Scalar(1) / (Scalar(1) + h * drag.slope / m);
      const Scalar weight = attitude_(2, i) * model_.weight_in_water;
      F(i, 5) = keep * h * attitude_(2, i) / m;
      next(i) = water(i) + keep * h * (force(i) + weight - drag.force - turning(i)) / m;
      for (Index j = 0; j < 3; ++j) {
        B(i, j) = i == j ? keep : -keep * h * W(i, j) * model_.inertia(j) / m;
      }
    }

    for (Index i = 0; i < 3; ++i) {
      for (Index j = 0; j < 3; ++j) F(i, j) = B(i, j);
      for (Index j = 0; j < 2; ++j) {
        F(i, 3 + j) = attitude(j, i);
        for (Index k = 0; k < 3; ++k) F(i, 3 + j) -= B(i, k) * attitude_(j, k);
      }
    }
    attitude_ = attitude;
    velocity_ = detail::plus(next, current_on_vehicle());
    const Scalar qv = options_.acceleration_noise * options_.acceleration_noise * h;
    const Scalar qc = options_.current_noise * options_.current_noise * h;
    Vector6<Scalar> q;
    for (Index i = 0; i < 5; ++i) q(i) = i < 3 ? qv : qc;
    q(5) = options_.initial_weight > Scalar(0) ? options_.weight_noise * options_.weight_noise * h
                                               : Scalar(0);
    detail::propagate<Scalar, 6>(P_, F, q);

    angular_ = angular;
    time_ += dt;
    history_.record(time_, at_instrument());
    gate_.advance(dt);
    return Status::ok;
  }

  /// The DVL measured `measurement` `age` s ago, 0 … 0.5. `not_measured`: fewer than three beams.
  /// `outlier`: refused by the gate. `late_measurement`: too old. No allocation.
  Status correct_dvl(const DvlMeasurement<Scalar>& measurement, double age = 0) noexcept {
    detail::Observation<Scalar, 6, 3> z;
    Status status = detail::check_age(age);
    if (status != Status::ok) return status;
    if (!detail::dvl_covariance(options_.dvl, measurement.beams, z.R)) return Status::not_measured;
    status = detail::check_input(measurement.velocity);
    if (status != Status::ok) return status;
    const Scalar variance = options_.beam_noise * options_.beam_noise;
    for (Index i = 0; i < 9; ++i) z.R.data()[i] *= variance;
    for (Index i = 0; i < 3; ++i) z.H(i, i) = Scalar(1);
    const Vector3<Scalar> expected = history_.at(time_ - age, time_, at_instrument());
    z.innovation = detail::minus(measurement.velocity, expected);
    z.change = detail::minus(z.innovation, previous_);
    previous_ = z.innovation;
    // The error has grown since by what no measurement of then can know.
    Vector3<Scalar> since;
    for (Index i = 0; i < 3; ++i) {
      since(i) = std::min(
          options_.acceleration_noise * options_.acceleration_noise * static_cast<Scalar>(age),
          P_(i, i) / Scalar(2));
      P_(i, i) -= since(i);
    }
    const long restarts = gate_.restarts();
    const auto correction = detail::correct<Scalar, 6, 3>(P_, z, z.H, gate_);
    for (Index i = 0; i < 3; ++i) P_(i, i) += since(i);
    if (correction.status != Status::ok) return correction.status;
    if (gate_.restarts() != restarts) doubt(z.innovation);
    const Vector3<Scalar> dv = detail::column3(correction.dx, 0, 0);
    velocity_ = detail::plus(velocity_, dv);
    for (Index i = 0; i < 2; ++i) current_(i) += correction.dx(3 + i);
    model_.weight_in_water += correction.dx(5);
    history_.for_each([&](Vector3<Scalar>& then) { then = detail::plus(then, dv); });
    return Status::ok;
  }

  /// v over ground, on ⟨v⟩, m/s.
  const Vector3<Scalar>& velocity() const noexcept { return velocity_; }
  /// v_r through the water, on ⟨v⟩, m/s.
  Vector3<Scalar> water_velocity() const noexcept {
    return detail::minus(velocity_, current_on_vehicle());
  }
  /// c, north and east, m/s.
  const Vector<Scalar, 2>& current() const noexcept { return current_; }
  /// W, weight less buoyancy, N.
  Scalar weight_in_water() const noexcept { return model_.weight_in_water; }
  /// Of (v, c).
  Covariance covariance() const noexcept {
    Covariance P;
    for (Index j = 0; j < 5; ++j) {
      for (Index i = 0; i < 5; ++i) P(i, j) = P_(i, j);
    }
    return P;
  }
  /// Of v alone.
  Matrix3<Scalar> velocity_covariance() const noexcept {
    Matrix3<Scalar> P;
    for (Index j = 0; j < 3; ++j) {
      for (Index i = 0; i < 3; ++i) P(i, j) = P_(i, j);
    }
    return P;
  }
  /// Of the DVL.
  const MeasurementGate& dvl() const noexcept { return gate_; }

 private:
  Vector3<Scalar> current_on_vehicle() const noexcept {
    return detail::transposed_times(attitude_,
                                    Vector3<Scalar>(current_(0), current_(1), Scalar(0)));
  }
  // Current or weight may be what led the velocity astray. No more doubt than at first.
  void doubt(const Vector3<Scalar>& error) noexcept {
    const Vector3<Scalar> on_world = detail::times(attitude_, error);
    for (Index i = 0; i < 3; ++i) {
      const Scalar doubt = i < 2 ? std::min(std::abs(on_world(i)), options_.initial_current)
                                 : options_.initial_weight;
      P_(3 + i, 3 + i) = std::max(P_(3 + i, 3 + i), doubt * doubt);
    }
  }
  // Of component i of v_r.
  Scalar water_variance(Index i) const noexcept {
    const Scalar n = attitude_(0, i), e = attitude_(1, i);
    return P_(i, i) - Scalar(2) * (n * P_(i, 3) + e * P_(i, 4)) + n * n * P_(3, 3) +
           Scalar(2) * n * e * P_(3, 4) + e * e * P_(4, 4);
  }
  Vector3<Scalar> at_instrument() const noexcept {
    return detail::plus(velocity_, detail::cross(angular_, options_.dvl.position));
  }

  VehicleModel<Scalar> model_;
  Options options_;
  Vector3<Scalar> velocity_ = Filled{0}, angular_ = Filled{0}, previous_ = Filled{0};
  Vector<Scalar, 2> current_ = Filled{0};
  Matrix3<Scalar> attitude_ = IdentityMatrix{};
  Matrix6<Scalar> P_ = Filled{0};
  MeasurementGate gate_;
  detail::History<Vector3<Scalar>> history_;
  double time_{0};
  bool started_{false};
};

}  // namespace icat
