// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The four estimators of [MARIS, V] in one object: pose, velocity and current of a vehicle.
///
///     gyros ──→ AttitudeEstimator ← AHRS        torque, gyro ──→ YawRateEstimator
///                  │ R, bias                                       │ r
///                  └──→ VelocityEstimator ← thrust, DVL ←──────────┘
///                          │ v, P_v
///                          └──→ PositionEstimator ← depth, GPS, landmark
///
/// Rates of roll and pitch are those of the gyros less their bias; the rate of yaw is the first
/// estimator's, which smooths it by the model. How the four are joined is ours.
#pragma once

#include "icat/core/step_clock.hpp"
#include "icat/navigation/attitude_estimator.hpp"
#include "icat/navigation/position_estimator.hpp"
#include "icat/navigation/velocity_estimator.hpp"
#include "icat/navigation/yaw_rate_estimator.hpp"

namespace icat {

/// See the file comment. After construction no allocation, no exception.
template <class Scalar>
class Navigation {
 public:
  /// Of each estimator.
  struct Options {
    /// Its bias noise and initial bias do not count.
    typename YawRateEstimator<Scalar>::Options yaw_rate{};
    typename VelocityEstimator<Scalar>::Options velocity{};  ///< and the DVL's place
    typename AttitudeEstimator<Scalar>::Options attitude{};  ///< of gyros and AHRS
    typename PositionEstimator<Scalar>::Options position{};  ///< of depth, GPS, landmark
  };

  /// @param model    of the vehicle
  /// @param start    ⟨v⟩ in ⟨0⟩ at first, as far as it is known
  /// @param options  noise
  /// @throws std::invalid_argument as the estimators do.
  explicit Navigation(const VehicleModel<Scalar>& model, const Pose<Scalar>& start,
                      const Options& options = Options())
      : clock_(1),
        attitude_(detail::rotation(start), options.attitude),
        yaw_rate_(model, without_bias(options.yaw_rate)),
        velocity_(model, options.velocity),
        position_(detail::origin(start), options.position) {}

  /// One step of all predictions. Returns the first error; the rest of the step is done all the
  /// same: without gyros the attitude stays, its variance grows and the rates of roll and pitch go
  /// to zero within seconds, without wrench the last one goes on. A yaw rate that the gate refuses
  /// is counted there and is no complaint. `clock_stalled`: the time stands still, or every step is
  /// longer than the longest. No allocation.
  /// @param now     s; differences count, see core/step_clock.hpp; longest step 1 s
  /// @param gyro    measured angular velocity on ⟨v⟩, rad/s
  /// @param wrench  of the thrusters, and what else is known but weight and drag, on ⟨v⟩, N, N m
  Status step(double now, const Vector3<Scalar>& gyro, const Vector6<Scalar>& wrench) noexcept {
    Status result = clock_.advance(now);
    if (result != Status::ok) return result;
    if (clock_.stalled()) result = Status::clock_stalled;
    const double dt = clock_.step();
    const auto note = [&](Status status) {
      if (result == Status::ok) result = status;
    };

    const Status wrench_status = detail::check_input(wrench);
    note(wrench_status);
    if (wrench_status == Status::ok) wrench_ = wrench;
    const Status gyro_status = attitude_.predict(gyro, dt);
    note(gyro_status);
    note(yaw_rate_.predict(wrench_(5), dt));
    if (gyro_status == Status::ok) {
      angular_ = detail::minus(gyro, attitude_.bias());
      const Status yaw = yaw_rate_.correct(angular_(2));
      if (yaw != Status::outlier) note(yaw);  // of thousand good ones three are
    } else {
      note(attitude_.coast(dt));
      // As the attitude does: no rate is known to last longer than a second.
      angular_ = detail::scaled(angular_, static_cast<Scalar>(std::exp(-dt)));
    }
    angular_(2) = yaw_rate_.rate();
    note(velocity_.predict(detail::column3(wrench_, 0, 0), attitude_.attitude(), angular_, dt));
    note(position_.predict(velocity_.velocity(), velocity_.velocity_covariance(),
                           attitude_.attitude(), dt));
    return result;
  }

  /// As `AttitudeEstimator::correct`.
  Status correct_attitude(const Matrix3<Scalar>& attitude, double age = 0) noexcept {
    return attitude_.correct(attitude, age);
  }
  /// As `VelocityEstimator::correct_dvl`.
  Status correct_dvl(const DvlMeasurement<Scalar>& measurement, double age = 0) noexcept {
    return velocity_.correct_dvl(measurement, age);
  }
  /// As `PositionEstimator::correct_depth`.
  Status correct_depth(Scalar depth, double age = 0) noexcept {
    return position_.correct_depth(depth, age);
  }
  /// As `PositionEstimator::correct_gps`.
  Status correct_gps(const Vector<Scalar, 2>& position, double age = 0) noexcept {
    return position_.correct_gps(position, age);
  }
  /// As `PositionEstimator::correct_landmark`.
  Status correct_landmark(const Vector3<Scalar>& position, double age = 0) noexcept {
    return position_.correct_landmark(position, age);
  }

  /// ⟨v⟩ in ⟨0⟩.
  Pose<Scalar> pose() const noexcept {
    return detail::make_pose(attitude_.attitude(), position_.position());
  }
  /// [v; ω] over ground, on ⟨v⟩, m/s, rad/s: the feedback of a velocity loop.
  Vector6<Scalar> velocity() const noexcept {
    Vector6<Scalar> twist;
    detail::set_column3(twist, 0, 0, velocity_.velocity());
    detail::set_column3(twist, 3, 0, angular_);
    return twist;
  }
  /// Of the water, north and east, m/s.
  const Vector<Scalar, 2>& current() const noexcept { return velocity_.current(); }

  /// With its covariance and the gate of the gyro.
  const YawRateEstimator<Scalar>& yaw_rate_estimator() const noexcept { return yaw_rate_; }
  /// With its covariance, the velocity through the water and the gate of the DVL.
  const VelocityEstimator<Scalar>& velocity_estimator() const noexcept { return velocity_; }
  /// With its covariance, the biases and the gates of heading and tilt.
  const AttitudeEstimator<Scalar>& attitude_estimator() const noexcept { return attitude_; }
  /// With its covariance and the gates of depth, GPS and landmark.
  const PositionEstimator<Scalar>& position_estimator() const noexcept { return position_; }
  /// Whether the caller's clock stands still.
  const StepClock& clock() const noexcept { return clock_; }

 private:
  // The attitude estimator knows the bias from the heading; taken off, there is none left.
  static typename YawRateEstimator<Scalar>::Options without_bias(
      typename YawRateEstimator<Scalar>::Options options) {
    options.initial_bias = options.bias_noise = Scalar(0);
    return options;
  }

  StepClock clock_;
  AttitudeEstimator<Scalar> attitude_;
  YawRateEstimator<Scalar> yaw_rate_;
  VelocityEstimator<Scalar> velocity_;
  PositionEstimator<Scalar> position_;
  Vector3<Scalar> angular_ = Filled{0};
  Vector6<Scalar> wrench_ = Filled{0};
};

}  // namespace icat
