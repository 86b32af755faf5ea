// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Yaw rate r and bias b of the gyro that measures it: the first of four estimators in [MARIS, V],
/// which prints no equations. Ours:
///
///     I ṙ = N − (d + D |r|) r + w₁,   ḃ = w₂,    z = r + b + n
///
/// Drag is taken at the end of a step, to first order (Rosenbrock's step): stable for any dt.
/// Alone, the estimator has nothing but the model to tell a bias from a rate: a torque that the
/// model does not know becomes a bias. Where a heading is measured, `AttitudeEstimator` knows the
/// bias better; `Navigation` takes it from there.
#pragma once

#include "icat/navigation/kalman.hpp"
#include "icat/navigation/vehicle_model.hpp"

namespace icat {

/// See the file comment. After construction no allocation, no exception.
template <class Scalar>
class YawRateEstimator {
 public:
  /// Noise, standard deviations.
  struct Options {
    Scalar acceleration_noise = static_cast<Scalar>(0.05);  ///< of w₁/I, rad/s²/√Hz
    Scalar bias_noise = static_cast<Scalar>(1e-5);          ///< of w₂, rad/s/√s
    Scalar gyro_noise = static_cast<Scalar>(0.005);         ///< n of each measurement, rad/s, > 0
    Scalar initial_rate = static_cast<Scalar>(0.1);         ///< of r at first, rad/s
    Scalar initial_bias = static_cast<Scalar>(0.005);       ///< of b at first, rad/s
  };

  /// r = 0, b = 0.
  /// @throws std::invalid_argument on a model or noise that is not finite, or below 0.
  explicit YawRateEstimator(const VehicleModel<Scalar>& model, const Options& options = Options())
      : model_(model), options_(options) {
    detail::check_model("YawRateEstimator", model);
    const auto check = [](const char* name, Scalar value) {
      detail::require_non_negative("YawRateEstimator", name, value);
    };
    check("acceleration_noise", options.acceleration_noise);
    check("bias_noise", options.bias_noise);
    check("initial_rate", options.initial_rate);
    check("initial_bias", options.initial_bias);
    detail::require_positive("YawRateEstimator", "gyro_noise", options.gyro_noise);
    P_(0, 0) = options.initial_rate * options.initial_rate;
    P_(1, 1) = options.initial_bias * options.initial_bias;
  }

  /// The torque N (`torque`, N m about z of ⟨v⟩) was there for `dt` s, >= 0; more than 1 s counts
  /// as 1 s. What is not finite is refused and changes nothing. No allocation.
  Status predict(Scalar torque, double dt) noexcept {
    const Vector<Scalar, 1> input(torque);
    Status status = detail::check_input(input);
    if (status == Status::ok) status = detail::check_step(dt);
    if (status != Status::ok) return status;
    const Scalar h = static_cast<Scalar>(dt), inertia = model_.inertia(5);
    const detail::SpreadDrag<Scalar> drag(model_.linear_drag(5), model_.quadratic_drag(5), rate_,
                                          P_(0, 0));
    const Scalar keep = Scalar(1) / (Scalar(1) + h * drag.slope / inertia);
    rate_ += keep * h * (torque - drag.force) / inertia;
    detail::Square<Scalar, 2> F = IdentityMatrix{};
    F(0, 0) = keep;
    Vector<Scalar, 2> q;
    q(0) = options_.acceleration_noise * options_.acceleration_noise * h;
    q(1) = options_.bias_noise * options_.bias_noise * h;
    detail::propagate<Scalar, 2>(P_, F, q);
    gate_.advance(dt);
    return Status::ok;
  }

  /// The gyro measured `rate`, rad/s. `outlier`: refused by the gate. No allocation.
  Status correct(Scalar rate) noexcept {
    const Vector<Scalar, 1> input(rate);
    const Status status = detail::check_input(input);
    if (status != Status::ok) return status;
    detail::Observation<Scalar, 2, 1> z;
    z.H(0, 0) = z.H(0, 1) = Scalar(1);
    z.R(0, 0) = options_.gyro_noise * options_.gyro_noise;
    z.innovation(0) = rate - rate_ - bias_;
    z.change(0) = z.innovation(0) - previous_;
    previous_ = z.innovation(0);
    Eigen::Matrix<Scalar, 1, 2> restarted = Filled{0};  // the rate is to blame, not the bias
    restarted(0, 0) = Scalar(1);
    const auto correction = detail::correct<Scalar, 2, 1>(P_, z, restarted, gate_);
    rate_ += correction.dx(0);
    bias_ += correction.dx(1);
    return correction.status;
  }

  /// r, rad/s.
  Scalar rate() const noexcept { return rate_; }
  /// b, rad/s.
  Scalar bias() const noexcept { return bias_; }
  /// Of (r, b).
  const detail::Square<Scalar, 2>& covariance() const noexcept { return P_; }
  /// Of the gyro.
  const MeasurementGate& gyro() const noexcept { return gate_; }

 private:
  VehicleModel<Scalar> model_;
  Options options_;
  Scalar rate_{0}, bias_{0}, previous_{0};
  detail::Square<Scalar, 2> P_ = Filled{0};
  MeasurementGate gate_;
};

}  // namespace icat
