// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Position p on ⟨0⟩ by dead reckoning, corrected by what there is: depth, GPS at the surface, a
/// landmark that vision tracks. The fourth of four estimators in [MARIS, V], which prints no
/// equations. Ours:
///
///     p ← p + R v dt,     e ← exp(−dt/T) e + w,   E = cov(e) = R P_v Rᵀ + σ_v² I + σ_ψ² u uᵀ
///
/// The velocity v comes from an estimator that knows its own covariance P_v, but not the constant
/// errors σ_v of the DVL and σ_ψ of the heading, u = z × R v. The error e is not white: it lasts, T
/// of it. So e is considered and not estimated (Schmidt–Kalman filter): with C = cov(p, e),
///
///     P ← P + dt (C + Cᵀ) + dt² E,   C ← exp(−dt/T) (C + dt E)
///
/// and without other measurements the standard deviation of p grows in proportion to time at first,
/// then to its square root.
#pragma once

#include "icat/math/rigid_motion.hpp"
#include "icat/navigation/history.hpp"
#include "icat/navigation/kalman.hpp"

namespace icat {

/// See the file comment. After construction no allocation, no exception. With float, put the origin
/// within some hundred metres.
template <class Scalar>
class PositionEstimator {
 public:
  /// Noise, standard deviations.
  struct Options {
    Scalar depth_noise = static_cast<Scalar>(0.05);     ///< of each measurement, m, > 0
    Scalar gps_noise = static_cast<Scalar>(1.5);        ///< of each, north and east, m, > 0
    Scalar landmark_noise = static_cast<Scalar>(0.05);  ///< of each, each axis, m, > 0
    Scalar velocity_bias = static_cast<Scalar>(0.003);  ///< σ_v, m/s
    Scalar heading_bias = static_cast<Scalar>(0.02);    ///< σ_ψ, rad
    double velocity_memory = 30;                        ///< T, s, > 0
    Scalar initial_position = static_cast<Scalar>(5);   ///< of each axis at first, m
  };

  /// @param start    p at first, m
  /// @param options  noise and constant errors
  /// @throws std::invalid_argument on noise that is out of range, or a position that is not finite.
  explicit PositionEstimator(const Vector3<Scalar>& start, const Options& options = Options())
      : options_(options), position_(start) {
    const char* const owner = "PositionEstimator";
    if (!detail::all_finite(start)) detail::invalid(owner, ": the first position is not finite");
    detail::require_positive(owner, "depth_noise", options.depth_noise);
    detail::require_positive(owner, "gps_noise", options.gps_noise);
    detail::require_positive(owner, "landmark_noise", options.landmark_noise);
    detail::require_non_negative(owner, "velocity_bias", options.velocity_bias);
    detail::require_non_negative(owner, "heading_bias", options.heading_bias);
    detail::require_positive(owner, "velocity_memory", options.velocity_memory);
    detail::require_non_negative(owner, "initial_position", options.initial_position);
    for (Index i = 0; i < 3; ++i) P_(i, i) = options.initial_position * options.initial_position;
  }

  /// What is not finite or no rotation is refused and changes nothing. No allocation.
  /// @param velocity    v over ground, on ⟨v⟩, m/s
  /// @param covariance  P_v, on ⟨v⟩
  /// @param attitude    R from ⟨v⟩ to ⟨0⟩
  /// @param dt          s, >= 0; more than 1 s counts as 1 s
  Status predict(const Vector3<Scalar>& velocity, const Matrix3<Scalar>& covariance,
                 const Matrix3<Scalar>& attitude, double dt) noexcept {
    Status status = detail::check_input(velocity);
    if (status == Status::ok) status = detail::check_input(covariance);
    if (status == Status::ok) status = detail::check_step(dt);
    if (status != Status::ok) return status;
    if (!is_rigid(detail::make_pose(attitude, position_))) return Status::not_a_rotation;
    const Scalar h = static_cast<Scalar>(dt);
    const Scalar keep = static_cast<Scalar>(std::exp(-dt / options_.velocity_memory));
    const Vector3<Scalar> over_ground = detail::times(attitude, velocity);
    position_ = detail::plus(position_, h, over_ground);
    Matrix3<Scalar> E = detail::congruence<Scalar, 3, 3>(attitude, covariance);
    const Vector3<Scalar> u(-options_.heading_bias * over_ground(1),
                            options_.heading_bias * over_ground(0), Scalar(0));
    for (Index i = 0; i < 3; ++i) {
      E(i, i) += options_.velocity_bias * options_.velocity_bias;
      for (Index j = 0; j < 3; ++j) E(i, j) += u(i) * u(j);
    }
    for (Index i = 0; i < 3; ++i) {
      for (Index j = 0; j <= i; ++j) {
        P_(i, j) += h * (C_(i, j) + C_(j, i)) + h * h * E(i, j);
        P_(j, i) = P_(i, j);
      }
    }
    for (Index i = 0; i < 3; ++i) {
      for (Index j = 0; j < 3; ++j) {
        // No correlation above 1, also where E has just become smaller.
        const Scalar most = std::sqrt(std::max(P_(i, i) * E(j, j), Scalar(0)));
        C_(i, j) = std::clamp(keep * (C_(i, j) + h * E(i, j)), -most, most);
      }
    }
    time_ += dt;
    history_.record(time_, position_);
    depth_.gate.advance(dt);
    gps_.gate.advance(dt);
    landmark_.gate.advance(dt);
    return Status::ok;
  }

  /// ⟨v⟩ was at this depth (z of ⟨0⟩, m) `age` s ago, 0 … 0.5. `outlier`: refused by the gate.
  /// `late_measurement`: too old. No allocation.
  Status correct_depth(Scalar depth, double age = 0) noexcept {
    return correct<1>(Vector<Scalar, 1>(depth), 2, options_.depth_noise, age, depth_);
  }
  /// ⟨v⟩ was here, north and east, m. As `correct_depth`.
  Status correct_gps(const Vector<Scalar, 2>& position, double age = 0) noexcept {
    return correct<2>(position, 0, options_.gps_noise, age, gps_);
  }
  /// ⟨v⟩ was here, as computed from a landmark, m. As `correct_depth`.
  Status correct_landmark(const Vector3<Scalar>& position, double age = 0) noexcept {
    return correct<3>(position, 0, options_.landmark_noise, age, landmark_);
  }

  /// p, m.
  const Vector3<Scalar>& position() const noexcept { return position_; }
  /// Of p.
  const Matrix3<Scalar>& covariance() const noexcept { return P_; }
  /// Of the depth sensor.
  const MeasurementGate& depth() const noexcept { return depth_.gate; }
  /// Of the GPS; stale under water.
  const MeasurementGate& gps() const noexcept { return gps_.gate; }
  /// Of the landmark.
  const MeasurementGate& landmark() const noexcept { return landmark_.gate; }

 private:
  template <int M>
  struct Sensor {
    MeasurementGate gate;
    Vector<Scalar, M> previous = Filled{0};  // innovation
  };

  // Components `first`, … of p.
  template <int M>
  Status correct(const Vector<Scalar, M>& measured, Index first, Scalar noise, double age,
                 Sensor<M>& sensor) noexcept {
    Status status = detail::check_age(age);
    if (status == Status::ok) status = detail::check_input(measured);
    if (status != Status::ok) return status;
    const Vector3<Scalar> expected = history_.at(time_ - age, time_, position_);
    detail::Observation<Scalar, 3, M> z;
    for (Index i = 0; i < M; ++i) {
      z.H(i, first + i) = Scalar(1);
      z.R(i, i) = noise * noise;
      z.innovation(i) = measured(i) - expected(first + i);
      z.change(i) = z.innovation(i) - sensor.previous(i);
    }
    sensor.previous = z.innovation;
    const auto correction = detail::correct<Scalar, 3, M>(P_, z, z.H, sensor.gate);
    if (correction.status != Status::ok) return correction.status;
    C_ = detail::times(correction.A, C_);
    position_ = detail::plus(position_, correction.dx);
    history_.for_each([&](Vector3<Scalar>& p) { p = detail::plus(p, correction.dx); });
    return Status::ok;
  }

  Options options_;
  Vector3<Scalar> position_;
  Matrix3<Scalar> P_ = Filled{0}, C_ = Filled{0};
  Sensor<1> depth_;
  Sensor<2> gps_;
  Sensor<3> landmark_;
  detail::History<Vector3<Scalar>> history_;
  double time_{0};
};

}  // namespace icat
