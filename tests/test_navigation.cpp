// SPDX-License-Identifier: BSD-3-Clause
// What the four estimators do with outliers, drop-outs, late and bad measurements, half turns and
// wrong starts. How well they know their errors: test_navigation_consistency.cpp.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <icat/navigation/navigation.hpp>
#include <icat/sim/noise.hpp>
#include <string>

#include "support/allocation_counter.hpp"
#include "support/sanitized.hpp"
#include "support/swimmer.hpp"

namespace {

using icat::MeasurementGate;
using icat::Status;
using support::Swimmer;
using support::vehicle_model;
using Vector3 = icat::Vector3<double>;
using Matrix3 = icat::Matrix3<double>;
using Dvl = icat::DvlMeasurement<double>;

constexpr double dt = 0.01;
constexpr double degree = std::numbers::pi / 180;
constexpr int runs = sanitized ? 10 : 100;

Matrix3 heading(double angle) { return icat::rotation_exp<double>(Vector3(0, 0, angle)); }

// ---- The gate

TEST(MeasurementGate, RefusesOutliersAndCountsThem) {
  MeasurementGate gate;
  EXPECT_TRUE(gate.stale());  // nothing has come yet
  EXPECT_EQ(gate.judge(8.9, 0, 1), MeasurementGate::Verdict::take);
  EXPECT_EQ(gate.judge(9.1, 0, 1), MeasurementGate::Verdict::refuse);
  EXPECT_EQ(gate.judge(16.2, 0, 3), MeasurementGate::Verdict::take);
  EXPECT_EQ(gate.judge(16.4, 0, 3), MeasurementGate::Verdict::refuse);
  EXPECT_EQ(gate.judge(NAN, 0, 3), MeasurementGate::Verdict::refuse);
  EXPECT_EQ(gate.outliers(), 3);
  EXPECT_FALSE(gate.stale());
  gate.advance(1.01);
  EXPECT_TRUE(gate.stale());
  EXPECT_NEAR(gate.age(), 1.01, 1e-12);
}

// Outliers of one opinion for 2 s are believed, five of them at least; of changing ones, none ever.
TEST(MeasurementGate, DoesNotStayClosedForEver) {
  const auto refused = [](double period, double change) {
    MeasurementGate gate;
    for (int k = 0; k < 10000; ++k) {
      if (gate.judge(100, change, 3) == MeasurementGate::Verdict::restart) return k;
      gate.advance(period);
    }
    return -1;
  };
  EXPECT_EQ(refused(0.1, 1), 20);
  EXPECT_EQ(refused(1, 1), 5);
  EXPECT_EQ(refused(0.1, 17), -1);
  EXPECT_EQ(refused(0.1, NAN), -1);
  // One good measurement, and the count begins anew.
  MeasurementGate gate;
  for (int k = 0; k < 100; ++k) {
    ASSERT_NE(gate.judge(k % 19 == 0 ? 1 : 100, 1, 3), MeasurementGate::Verdict::restart);
    gate.advance(0.1);
  }
}

// ---- Current and velocity

// In finer steps than the estimators'.
void swim(Swimmer& swimmer, const Vector3& force, const Vector3& angular,
          const Vector3& disturbance = Vector3::Zero()) {
  for (int i = 0; i < 10; ++i) swimmer.step(force, angular, disturbance, dt / 10);
}

// What 72 s with a current of 0.1 m/s from all sides say: how far off it is after 60 s, and the
// velocity in the ten seconds after that, without DVL, and when it is back.
struct CurrentCampaign {
  double worst_current = 0, squares = 0, worst_growth = 0, worst_after = 0;
};
CurrentCampaign swim_in_a_current(double acceleration_noise) {
  CurrentCampaign result;
  icat::VelocityEstimator<double>::Options options;
  options.acceleration_noise = acceleration_noise;
  for (int run = 0; run < runs; ++run) {
    icat::Noise noise(static_cast<std::uint64_t>(run) + 1);
    icat::VelocityEstimator<double> estimator(vehicle_model(), options);
    Swimmer swimmer;
    const double direction = 2 * std::numbers::pi * run / runs;
    swimmer.current = 0.1 * Vector3(std::cos(direction), std::sin(direction), 0);
    double before = 0, variance = 0;
    for (int k = 0; k < 7200; ++k) {
      const double t = k * dt;
      const Vector3 force(40, 10 * std::sin(0.2 * t), 0), still = Vector3::Zero();
      swim(swimmer, force, still,
           noise.vector<double, 3>(options.acceleration_noise / std::sqrt(dt)));
      EXPECT_EQ(estimator.predict(force, swimmer.R, still, dt), Status::ok);
      const bool lost = k >= 6000 && k < 7000;
      if (k % 12 == 0 && !lost) {
        const Vector3 n(std::sqrt(2.0) * 0.01 * noise.normal(),
                        std::sqrt(2.0) * 0.01 * noise.normal(),
                        0.01 / std::sqrt(3.0) * noise.normal());
        const Status status = estimator.correct_dvl({.velocity = swimmer.velocity + n});
        EXPECT_TRUE(status == Status::ok || status == Status::outlier);
      }
      const double error = (estimator.velocity() - swimmer.velocity).norm();
      if (k == 5999) {
        const double off = (estimator.current() - swimmer.current.head<2>()).norm();
        result.worst_current = std::max(result.worst_current, off);
        result.squares += off * off / runs;
        before = error;
      }
      if (lost) {
        result.worst_growth = std::max(result.worst_growth, error - before);
        EXPECT_GT(estimator.covariance()(0, 0), variance);  // in every step
        EXPECT_EQ(estimator.dvl().stale(), estimator.dvl().age() > 1);
      }
      variance = estimator.covariance()(0, 0);
      if (k > 7100) {  // a second later
        result.worst_after = std::max(result.worst_after, error);
        EXPECT_FALSE(estimator.dvl().stale());
      }
    }
  }
  std::printf(
      "thrust known to %.1f N/√Hz: current off by %.4f m/s rms, %.4f at worst; in the "
      "outage the error grows by %.4f, a second later it is %.4f\n",
      458 * acceleration_noise, std::sqrt(result.squares), result.worst_current,
      result.worst_growth, result.worst_after);
  return result;
}

// 0.1 m/s of current to 1 cm/s within 60 s, and 5 cm/s in 10 s without DVL, in each of 100 runs.
// What this takes is a model that is right to 0.005 m/s²/√Hz, the default; there is no more in the
// data: the estimate is consistent. At twice that it is true of the mean square.
TEST(VelocityEstimator, FindsTheCurrentAndLivesThroughAnOutage) {
  const CurrentCampaign calm = swim_in_a_current(0.005);
  EXPECT_LT(calm.worst_current, 0.01);
  EXPECT_LT(calm.worst_growth, 0.05);
  EXPECT_LT(calm.worst_after, 0.02);  // as before the outage: some four deviations, 0.005 m/s
  const CurrentCampaign rough = swim_in_a_current(0.01);
  EXPECT_LT(rough.squares, 0.01 * 0.01);
}

// Three beams measure all of the velocity, less well along the one that is gone; two do not.
TEST(VelocityEstimator, FourBeamsThreeBeamsAndFewer) {
  const auto after = [](std::array<bool, 4> beams) {
    icat::VelocityEstimator<double> estimator(vehicle_model());
    EXPECT_EQ(estimator.correct_dvl({.velocity = {0.1, 0, 0}, .beams = beams}), Status::ok);
    return estimator;
  };
  const auto four = after({true, true, true, true}), three = after({false, true, true, true});
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT(four.covariance()(i, i), three.covariance()(i, i)) << i;
    EXPECT_LT(three.covariance()(i, i), 0.01) << i;  // 0.1 m/s at first
  }
  // σ² / (2 sin²α) and σ² / (4 cos²α), beside the first 0.01.
  EXPECT_NEAR(1 / four.covariance()(0, 0), 100 + 0.5 / 1e-4, 1e-6);
  EXPECT_NEAR(1 / four.covariance()(2, 2), 100 + 3 / 1e-4, 1e-6);
  icat::VelocityEstimator<double> estimator(vehicle_model());
  EXPECT_EQ(estimator.correct_dvl({.velocity = {1, 0, 0}, .beams = {true, false, true, false}}),
            Status::not_measured);
  EXPECT_EQ(estimator.correct_dvl({.velocity = {1, 0, 0}, .beams = {false, false, false, false}}),
            Status::not_measured);
  EXPECT_EQ(estimator.velocity().norm(), 0);
  EXPECT_TRUE(estimator.dvl().stale());
}

// Turning on the spot, a DVL ahead of ⟨v⟩ moves sideways. Taken for a velocity of ⟨v⟩ it is wrong
// by ω r.
TEST(VelocityEstimator, LeverArmOfTheDvl) {
  const Vector3 place(0.6, 0, 0.3), angular(0, 0, 0.4);
  for (const bool told : {true, false}) {
    icat::VelocityEstimator<double>::Options options;
    if (told) options.dvl.position = place;
    icat::VelocityEstimator<double> estimator(vehicle_model(), options);
    Matrix3 R = Matrix3::Identity();
    for (int k = 0; k < 1000; ++k) {
      R = R * icat::rotation_exp<double>(Vector3(dt * angular));
      ASSERT_EQ(estimator.predict(Vector3::Zero(), R, angular, dt), Status::ok);
      if (k % 10 == 0) {
        const Status status = estimator.correct_dvl({.velocity = angular.cross(place)});
        EXPECT_TRUE(status == Status::ok || !told);
      }
    }
    if (told) {
      EXPECT_LT(estimator.velocity().norm(), 1e-12);
    } else {
      EXPECT_GT(estimator.velocity().norm(), 0.1);
    }
  }
}

// A measurement 0.3 s old while the vehicle speeds up by 0.1 m/s²: taken for the present it drags
// the estimate behind.
TEST(VelocityEstimator, LateMeasurements) {
  double error[2];
  for (const bool told : {false, true}) {
    icat::VelocityEstimator<double> estimator(vehicle_model());
    Swimmer swimmer;
    std::vector<Vector3> past;
    double worst = 0;
    for (int k = 0; k < 1000; ++k) {
      const Vector3 force(60 * std::sin(0.8 * k * dt), 0, 0), still = Vector3::Zero();
      swim(swimmer, force, still);
      past.push_back(swimmer.velocity);
      ASSERT_EQ(estimator.predict(force, swimmer.R, still, dt), Status::ok);
      if (k % 10 == 0 && k >= 30) {
        const Dvl late{.velocity = past[past.size() - 31]};
        ASSERT_EQ(estimator.correct_dvl(late, told ? 0.3 : 0), Status::ok);
      }
      if (k > 300) worst = std::max(worst, (estimator.velocity() - swimmer.velocity).norm());
    }
    error[told ? 1 : 0] = worst;
  }
  EXPECT_GT(error[0], 0.01);
  EXPECT_LT(error[1], 0.1 * error[0]);
  icat::VelocityEstimator<double> estimator(vehicle_model());
  EXPECT_EQ(estimator.correct_dvl({}, 0.51), Status::late_measurement);
  EXPECT_EQ(estimator.correct_dvl({}, -0.1), Status::time_reversed);
  EXPECT_EQ(estimator.correct_dvl({}, NAN), Status::non_finite);
}

// An error of the start is corrected by the first measurement, and not again by those that were
// under way at the time: each in its own estimator, seven of them.
TEST(LateMeasurements, CorrectAnErrorOnce) {
  icat::VelocityEstimator<double> velocity(vehicle_model(), {.initial_current = 0});
  icat::AttitudeEstimator<double> attitude(Matrix3::Identity());
  icat::PositionEstimator<double> position(Vector3::Zero(), {.initial_position = 1});
  const Matrix3 Pv = 1e-6 * Matrix3::Identity(), turned = heading(0.04);
  const Vector3 still = Vector3::Zero();
  double most[3] = {0, 0, 0};
  for (int k = 0; k < 200; ++k) {
    ASSERT_EQ(velocity.predict({7.1, 0, 0}, Matrix3::Identity(), still, dt), Status::ok);
    ASSERT_EQ(attitude.predict(still, dt), Status::ok);
    ASSERT_EQ(position.predict(still, Pv, Matrix3::Identity(), dt), Status::ok);
    if (k % 5 == 0 && k >= 35) {
      // At 0.1 m/s the drag is 8.2 N; the truth slows down a little.
      ASSERT_EQ(velocity.correct_dvl({.velocity = {0.1, 0, 0}}, 0.35), Status::ok);
      ASSERT_EQ(attitude.correct(turned, 0.35), Status::ok);
      ASSERT_EQ(position.correct_landmark({0.5, 0, 0}, 0.35), Status::ok);
    }
    most[0] = std::max(most[0], velocity.velocity()(0));
    most[1] = std::max(most[1], std::atan2(attitude.attitude()(1, 0), attitude.attitude()(0, 0)));
    most[2] = std::max(most[2], position.position()(0));
  }
  EXPECT_LT(most[0], 0.11);
  EXPECT_LT(most[1], 0.0401);
  EXPECT_LT(most[2], 0.5001);
  EXPECT_GT(most[1], 0.03);
  EXPECT_GT(most[2], 0.49);
}

TEST(VelocityEstimator, OutlierAndRestart) {
  icat::VelocityEstimator<double> estimator(vehicle_model());
  const auto cycle = [&](const Vector3& velocity) {
    for (int k = 0; k < 10; ++k) {
      EXPECT_EQ(estimator.predict(Vector3::Zero(), Matrix3::Identity(), Vector3::Zero(), dt),
                Status::ok);
    }
    return estimator.correct_dvl({.velocity = velocity});
  };
  for (int k = 0; k < 100; ++k) ASSERT_EQ(cycle(Vector3::Zero()), Status::ok);
  const double variance = estimator.covariance()(0, 0);
  EXPECT_EQ(cycle({0.8, 0, 0}), Status::outlier);
  EXPECT_EQ(estimator.velocity().norm(), 0);
  EXPECT_GT(estimator.covariance()(0, 0), variance);
  EXPECT_EQ(estimator.dvl().outliers(), 1);
  // A DVL that raves is not believed, and stale is said.
  icat::Noise noise(7);
  for (int k = 0; k < 100; ++k) EXPECT_EQ(cycle(noise.vector<double, 3>(50)), Status::outlier);
  EXPECT_LT(estimator.velocity().norm(), 1e-12);
  EXPECT_TRUE(estimator.dvl().stale());
  // One that is of one mind for 2 s is; the current does not follow it at once.
  int refused = 0;
  while (cycle({0.8, 0, 0}) == Status::outlier && refused < 1000) ++refused;
  EXPECT_EQ(refused, 20);
  EXPECT_NEAR(estimator.velocity()(0), 0.8, 0.01);
  EXPECT_LT(estimator.current().norm(), 0.1);
  EXPECT_EQ(estimator.dvl().restarts(), 1);
  EXPECT_EQ(cycle({0.78, 0, 0}), Status::ok);
}

// A horizontal force that nobody told the filter, or a current that is suddenly there, is a current
// to it: the DVL is refused until the velocity is restarted, and once is enough.
TEST(VelocityEstimator, AForceThatNobodyToldIsLearntAsACurrent) {
  for (const bool flows : {true, false}) {
    icat::VelocityEstimator<double> estimator(vehicle_model());
    icat::Noise noise(5);
    const auto model = vehicle_model();
    double v = 0, worst = 0;
    for (int k = 0; k < 10000; ++k) {
      const bool on = k > 3000;
      const double r = v - (on && flows ? 0.4 : 0), force = on && !flows ? 60 : 0;
      const double drag = (model.linear_drag(0) + model.quadratic_drag(0) * std::abs(r)) * r;
      v += dt * (force - drag) / model.inertia(0);
      ASSERT_EQ(estimator.predict(Vector3::Zero(), Matrix3::Identity(), Vector3::Zero(), dt),
                Status::ok);
      if (k % 12 == 0) {
        const Vector3 measured = Vector3(v, 0, 0) + noise.vector<double, 3>(0.01);
        (void)estimator.correct_dvl({.velocity = measured});
      }
      if (k > 4500) worst = std::max(worst, std::abs(estimator.velocity()(0) - v));
    }
    EXPECT_EQ(estimator.dvl().restarts(), 1) << flows;
    EXPECT_LT(worst, 0.03) << flows;
    if (flows) {
      EXPECT_NEAR(estimator.current()(0), 0.4, 0.03);
    }
  }
}

// Ballast is never exact, and a hand takes things: a weight is learnt, not fought with.
TEST(VelocityEstimator, LearnsTheWeight) {
  const auto model = vehicle_model();
  icat::VelocityEstimator<double> estimator(model);
  icat::VelocityEstimator<double> sure(model, {.initial_weight = 0});
  icat::Noise noise(5);
  double w = 0, weight = model.weight_in_water + 30, worst = 0;
  for (int k = 0; k < 12000; ++k) {
    if (k == 6000) weight += 25;
    const double drag = (model.linear_drag(2) + model.quadratic_drag(2) * std::abs(w)) * w;
    w += dt * (weight - drag) / model.inertia(2);
    for (auto* each : {&estimator, &sure}) {
      ASSERT_EQ(each->predict(Vector3::Zero(), Matrix3::Identity(), Vector3::Zero(), dt),
                Status::ok);
    }
    if (k % 12 == 0) {
      const icat::DvlMeasurement<double> z{.velocity =
                                               Vector3(0, 0, w) + noise.vector<double, 3>(0.01)};
      (void)estimator.correct_dvl(z);
      (void)sure.correct_dvl(z);
    }
    const bool settled = k > 1000 && (k < 6000 || k > 7000);
    if (settled) worst = std::max(worst, std::abs(estimator.velocity()(2) - w));
    if (k == 5999) {
      EXPECT_NEAR(estimator.weight_in_water(), weight, 3);
    }
  }
  EXPECT_NEAR(estimator.weight_in_water(), weight, 3);
  EXPECT_LE(estimator.dvl().restarts(), 1);
  EXPECT_LT(worst, 0.02);
  EXPECT_EQ(sure.weight_in_water(), model.weight_in_water);
  EXPECT_GT(sure.dvl().restarts(), 10);  // what it is for
}

// ---- Yaw rate

// The gyro says otherwise than the model for 2 s, as when the vehicle is held and pushed: it is
// believed, and the bias is not to blame.
TEST(YawRateEstimator, OutlierAndRestart) {
  icat::YawRateEstimator<double> estimator(vehicle_model());
  const auto cycle = [&](double rate) {
    EXPECT_EQ(estimator.predict(0, dt), Status::ok);
    return estimator.correct(rate);
  };
  for (int k = 0; k < 1000; ++k) ASSERT_EQ(cycle(0), Status::ok);
  EXPECT_EQ(cycle(0.5), Status::outlier);
  EXPECT_EQ(estimator.rate(), 0);
  EXPECT_EQ(cycle(0), Status::ok);
  int refused = 0;
  while (cycle(0.5) == Status::outlier && refused < 1000) ++refused;
  EXPECT_EQ(refused, 200);
  EXPECT_NEAR(estimator.rate(), 0.5, 0.005);
  EXPECT_LT(std::abs(estimator.bias()), 0.005);
}

// A constant bias under a torque that is known: told from the rate by the model alone.
TEST(YawRateEstimator, FindsTheBiasByTheModel) {
  icat::YawRateEstimator<double> estimator(vehicle_model(), {.acceleration_noise = 0.002});
  Swimmer swimmer;
  for (int k = 0; k < 6000; ++k) {
    const double torque = 10 * std::sin(0.3 * k * dt);
    for (int i = 0; i < 10; ++i) swimmer.turn(torque, dt / 10);
    ASSERT_EQ(estimator.predict(torque, dt), Status::ok);
    ASSERT_EQ(estimator.correct(swimmer.yaw_rate + 0.004), Status::ok);
  }
  EXPECT_NEAR(estimator.bias(), 0.004, 3e-4);
  EXPECT_NEAR(estimator.rate(), swimmer.yaw_rate, 3e-4);
}

// ---- Attitude

double yaw_of(const Matrix3& R) { return std::atan2(R(1, 0), R(0, 0)); }

// 350° → 10° and on, with noise: no step of the estimate is longer than the turn and three
// deviations of a correction.
TEST(AttitudeEstimator, NothingJumpsBeyondHalfATurn) {
  const icat::AttitudeEstimator<double>::Options options;
  icat::AttitudeEstimator<double> estimator(heading(350 * degree), options);
  icat::Noise noise(1);
  const double rate = 10 * degree;
  double truth = 350 * degree, worst_step = 0, worst = 0, last = yaw_of(estimator.attitude());
  for (int k = 0; k < 8000; ++k) {  // two turns, each through 0° and ±180°
    truth += rate * dt;
    const Vector3 gyro =
        Vector3(0, 0, rate) + noise.vector<double, 3>(options.gyro_noise / std::sqrt(dt));
    ASSERT_EQ(estimator.predict(gyro, dt), Status::ok);
    if (k % 10 == 0) {
      const Vector3 n = noise.vector<double, 3>(options.tilt_noise);
      // As an AHRS writes it: Euler angles, yaw in [0°, 360°).
      const double yaw = std::fmod(truth + n(2), 2 * std::numbers::pi);
      const Matrix3 measured = heading(yaw) * icat::rotation_exp<double>(Vector3(n(0), n(1), 0));
      const Status status = estimator.correct(measured);
      ASSERT_TRUE(status == Status::ok || status == Status::outlier);
    }
    const double now = yaw_of(estimator.attitude());
    worst_step = std::max(worst_step, std::abs(std::remainder(now - last, 2 * std::numbers::pi)));
    worst = std::max(worst, std::abs(std::remainder(now - truth, 2 * std::numbers::pi)));
    last = now;
  }
  EXPECT_LT(worst_step, rate * dt + 3 * options.heading_noise * 0.75);  // gain at first 0.5
  EXPECT_LT(worst, 3 * options.heading_noise);
  EXPECT_EQ(estimator.heading().restarts(), 0);
}

// Between two steps it turned at a constant rate: a measurement that is late and exact changes
// nothing, however long the steps are.
TEST(AttitudeEstimator, LateMeasurementsWhileItTurns) {
  const Vector3 rate(1, -2, 2);  // 3 rad/s
  for (const double step : {0.5, 0.1, 0.01}) {
    icat::AttitudeEstimator<double> estimator(heading(1));
    for (int k = 1; k * step < 5; ++k) {
      ASSERT_EQ(estimator.predict(rate, step), Status::ok);
      const double age = 0.037 * (k % 10);
      if (age > (k - 1) * step) continue;  // before all that is known
      const auto truth = [&](double t) -> Matrix3 {
        return heading(1) * icat::rotation_exp<double>(Vector3(t * rate));
      };
      ASSERT_EQ(estimator.correct(truth(k * step - age), age), Status::ok);
      const Matrix3 error = estimator.attitude().transpose() * truth(k * step);
      ASSERT_LT(icat::rotation_log<double>(error).norm(), 1e-9) << step << ' ' << age;
    }
  }
}

// Over the top: pitch through 90°, where Euler angles end.
TEST(AttitudeEstimator, PitchThroughARightAngle) {
  icat::AttitudeEstimator<double> estimator(Matrix3::Identity());
  Matrix3 R = Matrix3::Identity();
  for (int k = 0; k < 1000; ++k) {
    const Vector3 rate(0, 0.4, 0.05);
    R = R * icat::rotation_exp<double>(Vector3(dt * rate));
    ASSERT_EQ(estimator.predict(rate, dt), Status::ok);
    if (k % 10 == 0) {
      ASSERT_EQ(estimator.correct(R), Status::ok);
    }
    const Matrix3 error = estimator.attitude().transpose() * R;
    ASSERT_LT(icat::rotation_log<double>(error).norm(), 1e-9);
  }
}

// A heading that is wrong from the start, by half a turn too, where noise makes the innovation flip
// between +π and −π: refused for 2 s, then taken; the tilt is taken all the time.
TEST(AttitudeEstimator, ALockedOutHeadingRecovers) {
  for (const double wrong : {40 * degree, -120 * degree, std::numbers::pi}) {
    icat::AttitudeEstimator<double>::Options options;
    options.initial_attitude = 0.02;
    icat::AttitudeEstimator<double> estimator(heading(wrong), options);
    icat::Noise noise(3);
    int refused = 0, taken = -1;
    for (int k = 0; k < 1000; ++k) {
      ASSERT_EQ(estimator.predict(Vector3::Zero(), dt), Status::ok);
      const Vector3 n = noise.vector<double, 3>(0.02);
      const Status status = estimator.correct(icat::rotation_exp<double>(n));
      if (status == Status::outlier && taken < 0) ++refused;
      if (status == Status::ok && taken < 0) taken = k;
      if (k == 100) {
        EXPECT_TRUE(estimator.heading().stale());
        EXPECT_FALSE(estimator.tilt().stale());
      }
    }
    EXPECT_EQ(refused, 200) << wrong;
    EXPECT_EQ(estimator.heading().restarts(), 1);
    EXPECT_LT(icat::rotation_log<double>(estimator.attitude()).norm(), 0.02) << wrong;
    EXPECT_LT(estimator.bias().norm(), 0.005);  // not to blame
  }
}

// The same upside down, where the heading means nothing: tilt first, then the heading.
TEST(AttitudeEstimator, ALockedOutTiltRecovers) {
  for (const double wrong : {50 * degree, -std::numbers::pi}) {
    icat::AttitudeEstimator<double> estimator(icat::rotation_exp<double>(Vector3(wrong, 0, 0)));
    icat::Noise noise(4);
    for (int k = 0; k < 1000; ++k) {
      ASSERT_EQ(estimator.predict(Vector3::Zero(), dt), Status::ok);
      (void)estimator.correct(icat::rotation_exp<double>(noise.vector<double, 3>(0.02)));
    }
    EXPECT_EQ(estimator.tilt().restarts(), 1) << wrong;
    EXPECT_LT(icat::rotation_log<double>(estimator.attitude()).norm(), 0.02) << wrong;
  }
}

// The magnetometer beside a steel pipe: its heading is off by 60° for a second. Tilt goes on.
TEST(AttitudeEstimator, AHeadingOutlierLeavesTheTilt) {
  icat::AttitudeEstimator<double> estimator(Matrix3::Identity());
  const Matrix3 rolled = icat::rotation_exp<double>(Vector3(0.05, 0, 0));
  for (int k = 0; k < 100; ++k) {
    ASSERT_EQ(estimator.predict(Vector3::Zero(), dt), Status::ok);
    ASSERT_EQ(estimator.correct(heading(60 * degree) * rolled), Status::outlier);
  }
  EXPECT_LT(std::abs(yaw_of(estimator.attitude())), 0.001);
  EXPECT_NEAR(estimator.attitude()(2, 1), 0.05, 0.005);
  EXPECT_EQ(estimator.heading().outliers(), 100);
  EXPECT_EQ(estimator.tilt().outliers(), 0);
}

// Late by 0.2 s at 0.5 rad/s: 0.1 rad.
TEST(AttitudeEstimator, LateMeasurements) {
  for (const bool told : {true, false}) {
    icat::AttitudeEstimator<double> estimator(Matrix3::Identity());
    for (int k = 1; k <= 1000; ++k) {
      ASSERT_EQ(estimator.predict(Vector3(0, 0, 0.5), dt), Status::ok);
      if (k > 20) {
        ASSERT_EQ(estimator.correct(heading(0.5 * dt * (k - 20)), told ? 0.2 : 0), Status::ok);
      }
    }
    const double error = std::remainder(yaw_of(estimator.attitude()) - 5, 2 * std::numbers::pi);
    if (told) {
      EXPECT_LT(std::abs(error), 1e-4);
    } else {
      EXPECT_LT(error, -0.05);
    }
  }
}

// ---- Position

// Dead reckoning: the deviation grows like the time at first. A GPS outlier is refused, a landmark
// brings the position home.
TEST(PositionEstimator, DriftsAndComesHome) {
  icat::PositionEstimator<double> estimator(
      Vector3::Zero(),
      {.velocity_bias = 0, .heading_bias = 0, .velocity_memory = 5, .initial_position = 0.1});
  const Matrix3 Pv = 1e-4 * Matrix3::Identity();
  double last = 0;
  for (int k = 0; k < 1000; ++k) {
    ASSERT_EQ(estimator.predict({0.3, 0, 0}, Pv, heading(std::numbers::pi / 2), dt), Status::ok);
    ASSERT_GT(estimator.covariance()(0, 0), last);
    last = estimator.covariance()(0, 0);
    if (k % 10 == 0) {
      ASSERT_EQ(estimator.correct_depth(0), Status::ok);
    }
  }
  EXPECT_NEAR(estimator.position()(1), 3, 1e-9);
  // 2 T² (t/T − 1 + exp(−t/T)) σ², the variance of what e adds up to; sums of steps of dt.
  EXPECT_NEAR(estimator.covariance()(0, 0), 0.01 + 50 * (1 + std::exp(-2)) * 1e-4, 2e-5);
  EXPECT_LT(estimator.covariance()(2, 2), 4e-4);
  EXPECT_EQ(estimator.correct_gps({40, 3}), Status::outlier);
  EXPECT_NEAR(estimator.position()(1), 3, 1e-9);
  EXPECT_EQ(estimator.correct_landmark({0.1, 3.1, 0}), Status::ok);
  EXPECT_NEAR(estimator.position()(0), 0.1, 0.02);
  EXPECT_LT(estimator.covariance()(0, 0), 0.0025);
  EXPECT_FALSE(estimator.depth().stale());
  EXPECT_TRUE(estimator.gps().stale());
}

TEST(PositionEstimator, LateMeasurements) {
  icat::PositionEstimator<double> estimator(Vector3::Zero(), {.initial_position = 1});
  const Matrix3 Pv = 1e-6 * Matrix3::Identity();
  for (int k = 1; k <= 1000; ++k) {
    ASSERT_EQ(estimator.predict({0.5, 0, 0}, Pv, Matrix3::Identity(), dt), Status::ok);
    if (k % 25 == 0) {
      ASSERT_EQ(estimator.correct_landmark({0.5 * dt * (k - 25), 0, 0}, 0.25), Status::ok);
    }
  }
  EXPECT_NEAR(estimator.position()(0), 5, 1e-3);
}

// ---- All of them

template <class S>
class AnyScalar : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(AnyScalar, Scalars);

// A minute of turning in a current, without noise of the sensors: what is estimated is what is.
TYPED_TEST(AnyScalar, NavigatesForAMinute) {
  using S = TypeParam;
  using V3 = icat::Vector3<S>;
  typename icat::Navigation<S>::Options options;
  options.position.initial_position = S(1);
  icat::Navigation<S> navigation(vehicle_model<S>(), icat::Pose<S>::Identity(), options);
  Swimmer swimmer;
  swimmer.current = {0.1, -0.05, 0};
  for (int k = 0; k < 6000; ++k) {
    icat::Vector6<double> wrench;
    wrench << 50, 0, 0, 0, 0, 10 * std::sin(0.1 * k * dt);
    swimmer.turn(wrench(5), dt);
    const Vector3 angular(0, 0, swimmer.yaw_rate);
    swim(swimmer, wrench.template head<3>(), angular);
    ASSERT_EQ(navigation.step(k * dt, angular.cast<S>(), wrench.cast<S>()), Status::ok);
    if (k % 10 == 0) {
      ASSERT_EQ(navigation.correct_attitude(swimmer.R.cast<S>()), Status::ok);
      const V3 velocity = swimmer.velocity.cast<S>();
      ASSERT_EQ(navigation.correct_dvl({.velocity = velocity}), Status::ok);
      ASSERT_EQ(navigation.correct_depth(S(swimmer.position(2))), Status::ok);
    }
  }
  const Vector3 position = navigation.pose().translation().template cast<double>();
  const icat::Vector6<double> twist = navigation.velocity().template cast<double>();
  const icat::Vector<double, 2> current = navigation.current().template cast<double>();
  EXPECT_LT((position - swimmer.position).norm(), 0.05);  // of 20 m; Euler's steps of 0.01 s
  EXPECT_LT((twist.head<3>() - swimmer.velocity).norm(), 2e-3);
  EXPECT_NEAR(twist(5), swimmer.yaw_rate, 1e-3);
  EXPECT_LT((current - swimmer.current.head<2>()).norm(), 2e-3);
  // Covariances: symmetric, positive.
  const auto& P = navigation.velocity_estimator().covariance();
  const auto& Q = navigation.attitude_estimator().covariance();
  for (int i = 0; i < 5; ++i) {
    EXPECT_GT(P(i, i), S(0));
    EXPECT_GT(Q(i, i), S(0));
    for (int j = 0; j < 5; ++j) {
      EXPECT_EQ(P(i, j), P(j, i));
      EXPECT_LE(P(i, j) * P(i, j), P(i, i) * P(j, j));
      EXPECT_EQ(Q(i, j), Q(j, i));
    }
  }
}

// NaN, infinity and the absurd change nothing, whichever sensor they come from.
TYPED_TEST(AnyScalar, RefusesWhatIsNoMeasurement) {
  using S = TypeParam;
  using V3 = icat::Vector3<S>;
  using V2 = icat::Vector<S, 2>;
  using M3 = icat::Matrix3<S>;
  icat::Navigation<S> navigation(vehicle_model<S>(), icat::Pose<S>::Identity());
  const V3 gyro(S(0), S(0), S(0.1));
  icat::Vector6<S> wrench = icat::Filled{1};
  double now = 0;
  for (; now < 1; now += dt) ASSERT_EQ(navigation.step(now, gyro, wrench), Status::ok);
  const auto pose = navigation.pose();
  const auto velocity = navigation.velocity();
  const auto P = navigation.velocity_estimator().covariance();
  for (const S bad : {S(NAN), S(INFINITY), S(-INFINITY), S(1e30)}) {
    const Status expected = bad == S(1e30) ? Status::implausible : Status::non_finite;
    M3 R = M3::Identity();
    R(1, 1) = bad;
    EXPECT_EQ(navigation.correct_attitude(R),
              bad == S(1e30) ? Status::not_a_rotation : Status::non_finite);
    EXPECT_EQ(navigation.correct_dvl({.velocity = V3(S(0), bad, S(0))}), expected);
    EXPECT_EQ(navigation.correct_depth(bad), expected);
    EXPECT_EQ(navigation.correct_gps(V2(S(0), bad)), expected);
    EXPECT_EQ(navigation.correct_landmark(V3(bad, S(0), S(0))), expected);
    icat::YawRateEstimator<S> yaw(vehicle_model<S>());
    EXPECT_EQ(yaw.correct(bad), expected);
    EXPECT_EQ(yaw.predict(bad, dt), expected);
    EXPECT_EQ(yaw.rate(), S(0));
  }
  EXPECT_EQ(navigation.step(NAN, gyro, wrench), Status::non_finite);
  EXPECT_EQ(navigation.pose().matrix(), pose.matrix());
  EXPECT_EQ(navigation.velocity(), velocity);
  EXPECT_EQ(navigation.velocity_estimator().covariance(), P);
  // Without gyros or wrench a step is done all the same, and its doubt grows.
  const S before = navigation.attitude_estimator().covariance()(0, 0);
  const V3 there = navigation.pose().translation();
  EXPECT_EQ(navigation.step(now += dt, V3(S(NAN), S(0), S(0)), wrench), Status::non_finite);
  EXPECT_GT(navigation.attitude_estimator().covariance()(0, 0) - before, S(5e-4));
  EXPECT_NE(V3(navigation.pose().translation()), there);
  EXPECT_EQ(navigation.step(now += dt, V3(S(0), S(20), S(0)), wrench), Status::implausible);
  for (int k = 0; k < 110; ++k) {
    EXPECT_EQ(navigation.step(now += dt, V3(S(0), S(NAN), S(0)), wrench), Status::non_finite);
  }
  EXPECT_TRUE(navigation.yaw_rate_estimator().gyro().stale());
  wrench(2) = S(INFINITY);
  EXPECT_EQ(navigation.step(now += dt, gyro, wrench), Status::non_finite);
  EXPECT_TRUE(navigation.velocity().allFinite());
}

// Outliers at the edge of what is plausible, for so long that they are believed, and back.
TYPED_TEST(AnyScalar, SurvivesTheLargestNumbers) {
  using S = TypeParam;
  using V3 = icat::Vector3<S>;
  icat::Navigation<S> navigation(vehicle_model<S>(), icat::Pose<S>::Identity());
  const V3 still(S(0), S(0), S(0));
  icat::Vector6<S> wrench = icat::Filled{0};
  double now = 0;
  for (const S level : {S(0.1), S(1e6), S(0.1)}) {
    for (int k = 0; k < 1000; ++k, now += dt) {
      (void)navigation.step(now, still, wrench);
      if (k % 10 == 0) {
        (void)navigation.correct_dvl({.velocity = V3(level, -level, level)});
        (void)navigation.correct_depth(level);
      }
      ASSERT_TRUE(navigation.velocity().allFinite() && navigation.pose().matrix().allFinite());
      ASSERT_TRUE(navigation.velocity_estimator().covariance().allFinite());
    }
  }
  const icat::Vector6<S> velocity = navigation.velocity();
  EXPECT_NEAR(double(velocity(0)), 0.1, 0.01);
  EXPECT_GE(navigation.velocity_estimator().dvl().restarts(), 2);
}

// Anything in any order: what comes out is finite, a rotation, and its variances are positive.
TYPED_TEST(AnyScalar, SurvivesAnyOrderOfAnything) {
  using S = TypeParam;
  icat::Noise noise(11);
  icat::Navigation<S> navigation(vehicle_model<S>(), icat::Pose<S>::Identity());
  const auto value = [&](double deviation) {
    const double kind = noise.uniform();
    return static_cast<S>(kind < 0.01   ? NAN
                          : kind < 0.02 ? HUGE_VAL
                          : kind < 0.04 ? 1e5 * noise.normal()
                                        : deviation * noise.normal());
  };
  const auto vector = [&](double deviation) {
    return icat::Vector3<S>(value(deviation), value(deviation), value(deviation));
  };
  double now = 0;
  int taken = 0;
  const auto count = [&](Status status) { taken += status == Status::ok ? 1 : 0; };
  for (int k = 0; k < (sanitized ? 20000 : 100000); ++k) {
    const double age = noise.uniform() < 0.5 ? 0.0 : 0.6 * noise.uniform();
    switch (static_cast<int>(8 * noise.uniform())) {
      case 0: {
        icat::Matrix3<S> R = icat::rotation_exp<S>(vector(0.3));
        count(navigation.correct_attitude(R, age));
        break;
      }
      case 1: {
        icat::DvlMeasurement<S> z{.velocity = vector(0.1)};
        for (bool& beam : z.beams) beam = noise.uniform() < 0.9;
        count(navigation.correct_dvl(z, age));
        break;
      }
      case 2:
        count(navigation.correct_depth(value(1), age));
        break;
      case 3:
        count(navigation.correct_gps({value(3), value(3)}, age));
        break;
      case 4:
        count(navigation.correct_landmark(vector(1), age));
        break;
      default: {
        icat::Vector6<S> wrench;
        wrench << vector(50), vector(5);
        now += noise.uniform() < 0.01 ? 2 * noise.normal() : 0.02 * noise.uniform();
        count(navigation.step(now, vector(0.1), wrench));
      }
    }
    ASSERT_TRUE(navigation.velocity().allFinite()) << k;
    ASSERT_TRUE(navigation.current().allFinite()) << k;
    ASSERT_TRUE(icat::is_rigid(navigation.pose())) << k;
    for (int i = 0; i < 5; ++i) {
      ASSERT_GT(navigation.velocity_estimator().covariance()(i, i), S(0)) << k;
      ASSERT_GT(navigation.attitude_estimator().covariance()(i, i), S(0)) << k;
      ASSERT_GT(navigation.position_estimator().covariance()(i % 3, i % 3), S(0)) << k;
    }
  }
  EXPECT_GT(taken, sanitized ? 4000 : 20000);
}

TEST(Navigation, DropOutsGrowAndGoStale) {
  icat::Navigation<double> navigation(vehicle_model(), icat::Pose<double>::Identity());
  const icat::Vector6<double> wrench = icat::Vector6<double>::Zero();
  const auto& attitude = navigation.attitude_estimator();
  const auto& velocity = navigation.velocity_estimator();
  const auto& position = navigation.position_estimator();
  double now = 0;
  for (int k = 0; k < 1000; ++k, now += dt) {
    ASSERT_EQ(navigation.step(now, Vector3::Zero(), wrench), Status::ok);
    if (k % 10 != 9) continue;
    ASSERT_EQ(navigation.correct_attitude(Matrix3::Identity()), Status::ok);
    ASSERT_EQ(navigation.correct_dvl({}), Status::ok);
    ASSERT_EQ(navigation.correct_depth(0), Status::ok);
    ASSERT_EQ(navigation.correct_gps({0, 0}), Status::ok);
    ASSERT_EQ(navigation.correct_landmark({0, 0, 0}), Status::ok);
  }
  double last[4] = {0, 0, 0, 0};
  for (int k = 1; k <= 300; ++k, now += dt) {
    ASSERT_EQ(navigation.step(now, Vector3::Zero(), wrench), Status::ok);
    const double variance[4] = {attitude.covariance()(0, 0), attitude.covariance()(2, 2),
                                velocity.covariance()(1, 1), position.covariance()(2, 2)};
    for (int i = 0; i < 4; ++i) {
      ASSERT_GT(variance[i], last[i]) << i;
      last[i] = variance[i];
    }
    if (k == 100) continue;  // a second to the bit
    for (const MeasurementGate* gate : {&attitude.heading(), &attitude.tilt(), &velocity.dvl(),
                                        &position.depth(), &position.gps(), &position.landmark()}) {
      ASSERT_EQ(gate->stale(), k > 100) << k;
      ASSERT_NEAR(gate->age(), k * dt, 1e-9);
    }
  }
}

// What counts of the caller's time are steps: jumps cost one usual step, a gap its own length.
TEST(Navigation, ClocksThatJump) {
  icat::Navigation<double> navigation(vehicle_model(), icat::Pose<double>::Identity());
  icat::Vector6<double> wrench = icat::Vector6<double>::Zero();
  wrench(0) = 40;
  double now = 1.7e9;
  const auto step = [&](double after) {
    now += after;
    const Vector3 before = navigation.pose().translation();
    EXPECT_EQ(navigation.step(now, Vector3::Zero(), wrench), Status::ok);
    return Vector3(navigation.pose().translation() - before).norm();
  };
  for (int k = 0; k < 2000; ++k) step(dt);
  const double speed = navigation.velocity()(0);
  EXPECT_NEAR(step(dt), speed * dt, 1e-5);
  EXPECT_NEAR(step(1e6), speed * dt, 1e-4);
  EXPECT_EQ(step(-1e6), 0);
  EXPECT_NEAR(step(0.5), speed * 0.5, 1e-3);
  EXPECT_NEAR(navigation.velocity()(0), speed, 1e-3);
  // Stamps that do not change, and a loop slower than the longest step: said.
  for (const double after : {0.0, 2.0}) {
    Status status = Status::ok;
    for (int k = 0; k < 20; ++k) {
      status = navigation.step(now += after, Vector3::Zero(), wrench);
    }
    EXPECT_EQ(status, Status::clock_stalled) << after;
    step(dt);
  }
}

// A measurement is of now although rounding says of the future.
TEST(Navigation, AgesAreRounded) {
  icat::Navigation<double> navigation(vehicle_model(), icat::Pose<double>::Identity());
  for (const auto& [age, status] : {std::pair(-1e-16, Status::ok), std::pair(-2e-7, Status::ok),
                                    std::pair(-1e-3, Status::time_reversed)}) {
    EXPECT_EQ(navigation.correct_attitude(Matrix3::Identity(), age), status);
    EXPECT_EQ(navigation.correct_dvl({}, age), status);
    EXPECT_EQ(navigation.correct_depth(0, age), status);
  }
}

// Gyros that die while it rolls: it does not roll for ever.
TEST(Navigation, WithoutGyrosItDoesNotTurnForEver) {
  icat::Navigation<double> navigation(vehicle_model(), icat::Pose<double>::Identity());
  const icat::Vector6<double> wrench = icat::Vector6<double>::Zero();
  double now = 0, last = 0;
  for (int k = 0; k < 1000; ++k) {
    const Vector3 gyro(k < 500 ? 0.5 : NAN, -0.2, 0);
    (void)navigation.step(now += dt, gyro, wrench);
    const double rate = navigation.velocity()(3);
    if (k > 0) {
      EXPECT_LT(std::abs(rate - last), 0.006);  // no jump
    }
    last = rate;
  }
  EXPECT_LT(navigation.velocity().tail<3>().norm(), 0.01);
}

TEST(NavigationAllocates, Nothing) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  icat::Navigation<double> navigation(vehicle_model(), icat::Pose<double>::Identity());
  const icat::Vector6<double> wrench = icat::Vector6<double>::Ones();
  bool ok = true;
  EXPECT_EQ(count_allocations([&] {
              for (int k = 0; k < 100; ++k) {
                ok = ok && navigation.step(k * dt, Vector3::Zero(), wrench) == Status::ok;
                ok = ok && navigation.correct_attitude(Matrix3::Identity(), 0.1) == Status::ok;
                ok = ok && navigation.correct_dvl({}, 0.1) == Status::ok;
                ok = ok && navigation.correct_depth(0.001) == Status::ok;
                ok = ok && navigation.correct_gps({0, 0}) == Status::ok;
                ok = ok && navigation.correct_landmark({0, 0, 0}) == Status::ok;
                ok = ok && navigation.correct_depth(1e5) == Status::outlier;
              }
            }),
            0);
  EXPECT_TRUE(ok);
}

// Members initialised from bare braces, as GCC 12 likes them least: tests/interfaces.
template <class S>
struct Program {
  icat::VehicleModel<S> vehicle{.inertia = icat::Filled{100}, .weight_in_water = S(-5)};
  typename icat::Navigation<S>::Options options{
      .velocity = {.beam_noise = S(0.02), .dvl = {.position = {S(1), S(0), S(0)}}},
      .position = {.gps_noise = S(3)}};
  icat::Navigation<S> navigation{vehicle, icat::IdentityPose{}, options};
  icat::Navigation<S> another{vehicle, icat::IdentityPose{}, {.attitude = {.tilt_noise = S(0.1)}}};
  icat::DvlMeasurement<S> measurement{.beams = {true, true, true, false}};
};

TYPED_TEST(AnyScalar, IsAMemberOfAClass) {
  Program<TypeParam> program;
  EXPECT_EQ(program.navigation.correct_dvl(program.measurement), Status::ok);
  EXPECT_EQ(program.another.correct_dvl(program.measurement), Status::ok);
}

template <class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "no exception";
}

TEST(NavigationErrors, ConfigurationThrowsWithNamesAndNumbers) {
  EXPECT_EQ(message_of([] { icat::VelocityEstimator<double>(icat::VehicleModel<double>{}); }),
            "VelocityEstimator: inertia 0 must be finite and > 0, got 0");
  EXPECT_EQ(message_of([] { icat::VelocityEstimator<double>(vehicle_model(), {.beam_noise = 0}); }),
            "VelocityEstimator: beam_noise must be finite and > 0, got 0");
  EXPECT_EQ(message_of([] {
              icat::VelocityEstimator<double>(vehicle_model(), {.dvl = {.beam_angle = 30}});
            }),
            "VelocityEstimator: beam_angle must be in (0, 1.5) rad, got 30");
  EXPECT_EQ(message_of([] { icat::YawRateEstimator<double>(vehicle_model(), {.gyro_noise = -1}); }),
            "YawRateEstimator: gyro_noise must be finite and > 0, got -1");
  EXPECT_EQ(message_of([] { icat::AttitudeEstimator<double>{Matrix3::Zero()}; }),
            "AttitudeEstimator: the first attitude is not a rotation");
  EXPECT_EQ(
      message_of([] { icat::AttitudeEstimator<double>(Matrix3::Identity(), {.bias_noise = NAN}); }),
      "AttitudeEstimator: bias_noise must be finite and >= 0, got nan");
  EXPECT_EQ(message_of([] { icat::PositionEstimator<double>(Vector3(0, 0, INFINITY)); }),
            "PositionEstimator: the first position is not finite");
  EXPECT_EQ(
      message_of([] { icat::PositionEstimator<double>(Vector3::Zero(), {.velocity_memory = 0}); }),
      "PositionEstimator: velocity_memory must be finite and > 0, got 0");
}

}  // namespace
