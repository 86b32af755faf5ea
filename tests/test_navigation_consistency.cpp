// SPDX-License-Identifier: BSD-3-Clause
// Whether the four estimators know how wrong they are: NEES and NIS over 100 seeded runs. The truth
// has the noise that the estimators assume, which is what these tests mean, but is integrated apart
// from them, in ten steps for one of theirs.
#include <gtest/gtest.h>

#include <cmath>
#include <icat/navigation/attitude_estimator.hpp>
#include <icat/navigation/position_estimator.hpp>
#include <icat/navigation/velocity_estimator.hpp>
#include <icat/navigation/yaw_rate_estimator.hpp>
#include <icat/sim/noise.hpp>

#include "support/chi_square.hpp"
#include "support/swimmer.hpp"

namespace {

using icat::Status;
using support::Consistency;
using Vector3 = icat::Vector3<double>;
using Matrix3 = icat::Matrix3<double>;

constexpr int runs = 100;
constexpr int steps = 4000;  // of dt
constexpr double dt = 0.01;
constexpr int fine = 10;  // steps of the truth in dt
constexpr double h = dt / fine;

// Instant k of twenty, or −1.
int instant(int step) {
  const int every = steps / Consistency::instants;
  return step % every == every - 1 ? step / every : -1;
}

TEST(NavigationConsistency, YawRate) {
  const icat::YawRateEstimator<double>::Options options;
  Consistency check;
  for (int run = 0; run < runs; ++run) {
    icat::Noise noise(static_cast<std::uint64_t>(run) + 1);
    icat::YawRateEstimator<double> estimator(support::vehicle_model(), options);
    support::Swimmer truth;
    truth.yaw_rate = options.initial_rate * noise.normal();
    double bias = options.initial_bias * noise.normal();
    for (int k = 0; k < steps; ++k) {
      const double torque = 20 * std::sin(0.5 * k * dt);
      for (int i = 0; i < fine; ++i) {
        truth.turn(torque, h);
        truth.yaw_rate += options.acceleration_noise * std::sqrt(h) * noise.normal();
      }
      bias += options.bias_noise * std::sqrt(dt) * noise.normal();
      ASSERT_EQ(estimator.predict(torque, dt), Status::ok);
      const Status status =
          estimator.correct(truth.yaw_rate + bias + options.gyro_noise * noise.normal());
      ASSERT_TRUE(status == Status::ok || status == Status::outlier);
      // The gate refuses 0.3 % of what is good, and the errors that this leaves make the mean over
      // all steps 0.6 % larger: outside the band of 400,000 innovations, inside that of 40,000.
      if (k % 10 == 9) check.innovation(estimator.gyro().distance(), 1);
      if (const int at = instant(k); at >= 0) {
        const icat::Vector<double, 2> e(truth.yaw_rate - estimator.rate(), bias - estimator.bias());
        check.state(at, support::normalized_square<2>(estimator.covariance(), e), 2);
      }
    }
  }
  check.expect("yaw rate");
}

// Turning at up to 0.3 rad/s, in a current, on four beams and sometimes on three.
TEST(NavigationConsistency, Velocity) {
  icat::VelocityEstimator<double>::Options options;
  options.dvl.position = {0.3, -0.1, 0.4};
  Consistency check;
  for (int run = 0; run < runs; ++run) {
    icat::Noise noise(static_cast<std::uint64_t>(run) + 1);
    icat::VelocityEstimator<double> estimator(support::vehicle_model(), options);
    support::Swimmer truth;
    truth.velocity = noise.vector<double, 3>(options.initial_velocity);
    truth.current.head<2>() = noise.vector<double, 2>(options.initial_current);
    truth.model.weight_in_water += options.initial_weight * noise.normal();
    truth.R = icat::rotation_exp<double>(Vector3(0.05, -0.1, 2));
    for (int k = 0; k < steps; ++k) {
      const double t = k * dt;
      const Vector3 force(60 * std::sin(0.4 * t), 40 * std::cos(0.3 * t), 15 * std::sin(t));
      const Vector3 angular(0.05 * std::sin(0.9 * t), 0.04 * std::cos(0.8 * t),
                            0.3 * std::sin(0.2 * t));
      for (int i = 0; i < fine; ++i) {
        truth.step(force, angular,
                   noise.vector<double, 3>(options.acceleration_noise / std::sqrt(h)), h);
      }
      truth.current.head<2>() += noise.vector<double, 2>(options.current_noise * std::sqrt(dt));
      truth.model.weight_in_water += options.weight_noise * std::sqrt(dt) * noise.normal();
      ASSERT_EQ(estimator.predict(force, truth.R, angular, dt), Status::ok);
      if (k % 10 == 9) {
        icat::DvlMeasurement<double> z;
        if (k % 40 == 39) z.beams[static_cast<std::size_t>(run % 4)] = false;
        const Vector3 u = truth.velocity + angular.cross(options.dvl.position);
        Matrix3 A = Matrix3::Zero();
        Vector3 y = Vector3::Zero();
        for (int b = 0; b < 4; ++b) {
          const double along = options.beam_noise * noise.normal();
          if (!z.beams[static_cast<std::size_t>(b)]) continue;
          const double azimuth = (45 + 90 * b) * std::numbers::pi / 180;
          const Vector3 d(0.5 * std::cos(azimuth), 0.5 * std::sin(azimuth), std::sqrt(0.75));
          A += d * d.transpose();
          y += d * (d.dot(u) + along);
        }
        z.velocity = A.inverse() * y;
        const Status status = estimator.correct_dvl(z);
        ASSERT_TRUE(status == Status::ok || status == Status::outlier);
        check.innovation(estimator.dvl().distance(), 3);
      }
      if (const int at = instant(k); at >= 0) {
        icat::Vector<double, 5> e;
        e << truth.velocity - estimator.velocity(), truth.current.head<2>() - estimator.current();
        check.state(at, support::normalized_square<5>(estimator.covariance(), e), 5);
      }
    }
  }
  check.expect("velocity and current");
}

// Rolling and pitching while yaw turns round and round.
TEST(NavigationConsistency, Attitude) {
  const icat::AttitudeEstimator<double>::Options options;
  Consistency check;
  for (int run = 0; run < runs; ++run) {
    icat::Noise noise(static_cast<std::uint64_t>(run) + 1);
    const Matrix3 start = icat::rotation_exp<double>(Vector3(0.2, -0.3, 0.05 * run));
    icat::AttitudeEstimator<double> estimator(start, options);
    Matrix3 R =
        start * icat::rotation_exp<double>(noise.vector<double, 3>(options.initial_attitude));
    Vector3 bias = noise.vector<double, 3>(options.initial_bias);
    for (int k = 0; k < steps; ++k) {
      const double t = k * dt;
      const Vector3 angular(0.3 * std::sin(0.9 * t), 0.2 * std::cos(0.8 * t), 0.4);
      for (int i = 0; i < fine; ++i) R = R * icat::rotation_exp<double>(Vector3(h * angular));
      const Vector3 gyro =
          angular + bias + noise.vector<double, 3>(options.gyro_noise / std::sqrt(dt));
      bias += noise.vector<double, 3>(options.bias_noise * std::sqrt(dt));
      ASSERT_EQ(estimator.predict(gyro, dt), Status::ok);
      if (k % 10 == 9) {
        const Vector3 error(options.tilt_noise * noise.normal(),
                            options.tilt_noise * noise.normal(),
                            options.heading_noise * noise.normal());
        const Status status = estimator.correct(icat::rotation_exp<double>(error) * R);
        ASSERT_TRUE(status == Status::ok || status == Status::outlier);
        check.innovation(estimator.heading().distance(), 1);
        check.innovation(estimator.tilt().distance(), 2);
      }
      if (const int at = instant(k); at >= 0) {
        const Matrix3 turn = estimator.attitude().transpose() * R;
        icat::Vector6<double> e;
        e << icat::rotation_log<double>(turn), bias - estimator.bias();
        check.state(at, support::normalized_square<6>(estimator.covariance(), e), 6);
      }
    }
  }
  check.expect("attitude and bias");
}

// GPS for 10 s, then under water with a depth sensor, and a landmark for 2 s.
TEST(NavigationConsistency, Position) {
  const icat::PositionEstimator<double>::Options options;
  const Matrix3 Pv = Vector3(4e-4, 9e-4, 1e-4).asDiagonal();  // m²/s²
  const double keep = std::exp(-dt / options.velocity_memory), fresh = std::sqrt(1 - keep * keep);
  Consistency check;
  for (int run = 0; run < runs; ++run) {
    icat::Noise noise(static_cast<std::uint64_t>(run) + 1);
    icat::PositionEstimator<double> estimator(Vector3(1, 2, 3), options);
    Vector3 p = Vector3(1, 2, 3) + noise.vector<double, 3>(options.initial_position);
    // A vehicle that does not turn: e is of constant covariance on ⟨0⟩.
    const Matrix3 R = icat::rotation_exp<double>(Vector3(0.1, 0.2, 0.7));
    const Vector3 velocity(0.3, 0.1, 0.05);
    const auto draw = [&] {
      const Vector3 known(0.02 * noise.normal(), 0.03 * noise.normal(), 0.01 * noise.normal());
      const Vector3 turned =
          Vector3(0, 0, options.heading_bias * noise.normal()).cross(R * velocity);
      return Vector3(R * known + noise.vector<double, 3>(options.velocity_bias) + turned);
    };
    Vector3 e = draw();
    for (int k = 0; k < steps; ++k) {
      p += dt * (R * velocity + e);
      e = keep * e + fresh * draw();
      ASSERT_EQ(estimator.predict(velocity, Pv, R, dt), Status::ok);
      const auto expect_known = [](Status status) {
        ASSERT_TRUE(status == Status::ok || status == Status::outlier);
      };
      if (k % 10 == 9) {
        expect_known(estimator.correct_depth(p(2) + options.depth_noise * noise.normal()));
        check.innovation(estimator.depth().distance(), 1);
      }
      if (k % 25 == 24 && k < 1000) {
        const icat::Vector<double, 2> n = noise.vector<double, 2>(options.gps_noise);
        expect_known(estimator.correct_gps(icat::Vector<double, 2>(p(0) + n(0), p(1) + n(1))));
        check.innovation(estimator.gps().distance(), 2);
      }
      if (k % 10 == 5 && k >= 3000 && k < 3200) {
        expect_known(
            estimator.correct_landmark(p + noise.vector<double, 3>(options.landmark_noise)));
        check.innovation(estimator.landmark().distance(), 3);
      }
      if (const int at = instant(k); at >= 0) {
        const Vector3 error = p - estimator.position();
        check.state(at, support::normalized_square<3>(estimator.covariance(), error), 3);
      }
    }
  }
  check.expect("position");
}

}  // namespace
