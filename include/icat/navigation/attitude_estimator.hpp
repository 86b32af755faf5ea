// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Attitude R and bias b of the gyros: the third of four estimators in [MARIS, V], which prints no
/// equations. Ours is a multiplicative error-state filter on SO(3), so that no angle has a jump at
/// ±π and pitch may pass 90°:
///
///     R_true = R exp(δθ),  b_true = b + δb
///     R ← R exp((ω̃ − b) dt),   δθ ← exp((ω̃ − b) dt)ᵀ δθ − δb dt + w₁,   δb ← δb + w₂
///     R_z = exp(n) R_true:  R_z Rᵀ = turn about z · swing,  H = R
///
/// ω̃ are the gyros, R_z is what the AHRS measures. The error of the measurement about z is a
/// heading, from a magnetometer; about x and y it is a tilt, from gravity. Each has its own noise
/// and its own gate: near steel the heading is lost and the tilt is not.
#pragma once

#include "icat/math/rigid_motion.hpp"
#include "icat/navigation/history.hpp"
#include "icat/navigation/kalman.hpp"

namespace icat {

/// See the file comment. After construction no allocation, no exception.
template <class Scalar>
class AttitudeEstimator {
 public:
  /// Noise, standard deviations.
  struct Options {
    Scalar gyro_noise = static_cast<Scalar>(5e-4);         ///< w₁, rad/s/√Hz, > 0
    Scalar bias_noise = static_cast<Scalar>(1e-5);         ///< w₂, rad/s/√s
    Scalar tilt_noise = static_cast<Scalar>(0.035);        ///< of each AHRS measurement, rad, > 0
    Scalar heading_noise = static_cast<Scalar>(0.035);     ///< the same about z, rad, > 0
    Scalar initial_attitude = static_cast<Scalar>(0.035);  ///< of each axis at first, rad
    Scalar initial_bias = static_cast<Scalar>(0.005);      ///< of each gyro at first, rad/s
  };
  /// Of (δθ, δb), on ⟨v⟩.
  using Covariance = Matrix6<Scalar>;

  /// @param start    R at first, as the AHRS has it
  /// @param options  noise
  /// @throws std::invalid_argument on noise that is out of range, or a matrix that is no rotation.
  explicit AttitudeEstimator(const Matrix3<Scalar>& start, const Options& options = Options())
      : options_(options), attitude_(start) {
    const char* const owner = "AttitudeEstimator";
    if (!rotation(start)) detail::invalid(owner, ": the first attitude is not a rotation");
    detail::require_positive(owner, "gyro_noise", options.gyro_noise);
    detail::require_positive(owner, "tilt_noise", options.tilt_noise);
    detail::require_positive(owner, "heading_noise", options.heading_noise);
    detail::require_non_negative(owner, "bias_noise", options.bias_noise);
    detail::require_non_negative(owner, "initial_attitude", options.initial_attitude);
    detail::require_non_negative(owner, "initial_bias", options.initial_bias);
    for (Index i = 0; i < 6; ++i) {
      const Scalar deviation = i < 3 ? options.initial_attitude : options.initial_bias;
      P_(i, i) = deviation * deviation;
    }
  }

  /// The gyros measured `gyro`, ω̃ on ⟨v⟩ in rad/s, for `dt` s, >= 0; more than 1 s counts as 1 s.
  /// What is not finite, or faster than 10 rad/s (`implausible`), is refused and changes nothing.
  /// No allocation.
  Status predict(const Vector3<Scalar>& gyro, double dt) noexcept {
    Status status = detail::check_input(gyro);
    if (status == Status::ok && detail::norm(gyro) > Scalar(10)) status = Status::implausible;
    if (status == Status::ok) status = detail::check_step(dt);
    if (status != Status::ok) return status;
    const Scalar h = static_cast<Scalar>(dt);
    const Vector3<Scalar> turn = detail::scaled(detail::minus(gyro, bias_), h);
    const Matrix3<Scalar> step = rotation_exp<Scalar>(turn);
    attitude_ = orthonormal(detail::times(attitude_, step));
    Matrix6<Scalar> F = IdentityMatrix{};
    for (Index i = 0; i < 3; ++i) {
      for (Index j = 0; j < 3; ++j) F(i, j) = step(j, i);
      F(i, 3 + i) = -h;
    }
    grow(F, options_.gyro_noise * options_.gyro_noise * h, dt);
    return Status::ok;
  }

  /// `dt` s have passed without gyros: the attitude stays, and its variance grows as for a rate of
  /// 0.3 rad/s that changes every second. No allocation.
  Status coast(double dt) noexcept {
    const Status status = detail::check_step(dt);
    if (status != Status::ok) return status;
    const Matrix6<Scalar> F = IdentityMatrix{};
    grow(F, static_cast<Scalar>(0.09 * dt), dt);
    return Status::ok;
  }

  /// The AHRS measured `attitude` from ⟨v⟩ to ⟨0⟩ `age` s ago, 0 … 0.5. `outlier`: the gate refused
  /// the heading, the tilt or both; the other is taken. `late_measurement`: too old. No allocation.
  Status correct(const Matrix3<Scalar>& attitude, double age = 0) noexcept {
    const Status status = detail::check_age(age);
    if (status != Status::ok) return status;
    if (!detail::all_finite(attitude)) return Status::non_finite;
    if (!rotation(attitude)) return Status::not_a_rotation;

    // A turn about z of ⟨0⟩ after a swing, of the quaternion w + v; w >= 0. So the swing is what
    // gravity says, whatever the heading.
    const Matrix3<Scalar> then = orthonormal(history_.at(time_ - age, time_, attitude_));
    const Matrix3<Scalar> turned = detail::times(attitude, detail::transpose(then));
    const auto error = detail::UnitQuaternion<Scalar>::of(turned);
    const Scalar half = std::atan2(error.v(2), error.w);
    const Scalar c = std::cos(half), s = std::sin(half);
    detail::UnitQuaternion<Scalar> swing;
    swing.w = c * error.w + s * error.v(2);
    swing.v = {c * error.v(0) + s * error.v(1), c * error.v(1) - s * error.v(0), Scalar(0)};
    const Vector3<Scalar> tilt = swing.rotation_vector();
    // Near half a turn the angles jump, the rotation does not.
    const Vector3<Scalar> change =
        rotation_log<Scalar>(detail::times(turned, detail::transpose(previous_)));
    previous_ = turned;

    detail::Observation<Scalar, 6, 1> heading_z;
    for (Index j = 0; j < 3; ++j) heading_z.H(0, j) = attitude_(2, j);
    heading_z.R(0, 0) = options_.heading_noise * options_.heading_noise;
    heading_z.innovation(0) = Scalar(2) * half;
    heading_z.change(0) = change(2);
    const auto first = detail::correct<Scalar, 6, 1>(P_, heading_z, heading_z.H, heading_);

    detail::Observation<Scalar, 6, 2> tilt_z;
    for (Index i = 0; i < 2; ++i) {
      tilt_z.innovation(i) = tilt(i);
      for (Index j = 0; j < 3; ++j) {
        tilt_z.H(i, j) = attitude_(i, j);
        tilt_z.innovation(i) -= attitude_(i, j) * first.dx(j);  // corrected already
      }
      tilt_z.R(i, i) = options_.tilt_noise * options_.tilt_noise;
      tilt_z.change(i) = change(i);
    }
    const auto second = detail::correct<Scalar, 6, 2>(P_, tilt_z, tilt_z.H, tilt_);

    const Vector3<Scalar> turn =
        detail::plus(detail::column3(first.dx, 0, 0), detail::column3(second.dx, 0, 0));
    bias_ = detail::plus(
        bias_, detail::plus(detail::column3(first.dx, 3, 0), detail::column3(second.dx, 3, 0)));
    const Matrix3<Scalar> on_world = rotation_exp<Scalar>(detail::times(attitude_, turn));
    attitude_ = orthonormal(detail::times(on_world, attitude_));
    history_.for_each([&](Matrix3<Scalar>& R) { R = detail::times(on_world, R); });
    return first.status != Status::ok ? first.status : second.status;
  }

  /// R, from ⟨v⟩ to ⟨0⟩.
  const Matrix3<Scalar>& attitude() const noexcept { return attitude_; }
  /// b, rad/s.
  const Vector3<Scalar>& bias() const noexcept { return bias_; }
  /// Of (δθ, δb).
  const Covariance& covariance() const noexcept { return P_; }
  /// Of the AHRS's heading.
  const MeasurementGate& heading() const noexcept { return heading_; }
  /// Of its tilt.
  const MeasurementGate& tilt() const noexcept { return tilt_; }

 private:
  static bool rotation(const Matrix3<Scalar>& R) noexcept {
    return is_rigid(detail::make_pose(R, Vector3<Scalar>(Scalar(0), Scalar(0), Scalar(0))));
  }
  static Matrix3<Scalar> orthonormal(const Matrix3<Scalar>& R) noexcept {
    return detail::UnitQuaternion<Scalar>::of(R).matrix();
  }
  void grow(const Matrix6<Scalar>& F, Scalar angle_variance, double dt) noexcept {
    const Scalar bias_variance =
        options_.bias_noise * options_.bias_noise * static_cast<Scalar>(dt);
    Vector6<Scalar> q;
    for (Index i = 0; i < 6; ++i) q(i) = i < 3 ? angle_variance : bias_variance;
    detail::propagate<Scalar, 6>(P_, F, q);
    time_ += dt;
    history_.record(time_, attitude_);
    heading_.advance(dt);
    tilt_.advance(dt);
  }

  Options options_;
  Matrix3<Scalar> attitude_;
  Vector3<Scalar> bias_ = Filled{0};
  Covariance P_ = Filled{0};
  Matrix3<Scalar> previous_ = IdentityMatrix{};  // the last R_z Rᵀ
  MeasurementGate heading_, tilt_;
  detail::History<Matrix3<Scalar>> history_;
  double time_{0};
};

}  // namespace icat
