// SPDX-License-Identifier: BSD-3-Clause
// Force and torque at the wrist: the calibration against a known sensor, the hand's own weight.
#include <gtest/gtest.h>

#include <cmath>
#include <icat/control/wrist_wrench.hpp>
#include <icat/sim/wrist_sensor.hpp>
#include <random>
#include <string>

#include "support/allocation_counter.hpp"

namespace {

using icat::Status;
using icat::Vector3;
using icat::Vector6;
template <int N>
using Sample = icat::WrenchSample<double, N>;

// The ATI Gamma 10-130 of [MARIS, Fig. 8]: 130 N and 10 N m.
constexpr double force_range = 130, torque_range = 10;

/// A sensor whose six signals mix all components, some volts at full range.
template <int N>
typename icat::WristSensor<double, N>::Options sensor(double noise) {
  typename icat::WristSensor<double, N>::Options o;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < N; ++i) {
    o.zero(i) = 0.5 * uniform(random);
    for (int k = 0; k < 6; ++k) {
      const double own = i % 6 == k ? 2 : 0;
      o.sensitivity(i, k) = (own + 0.5 * uniform(random)) / (k < 3 ? force_range : torque_range);
    }
  }
  o.noise = noise;
  o.drift = 0;
  return o;
}

/// As on a bench, beside a reference that is much better than the sensor.
template <int N>
std::vector<Sample<N>> bench(icat::WristSensor<double, N>& wrist, int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Sample<N>> samples;
  for (int k = 0; k < count; ++k) {
    Sample<N> s;
    for (int i = 0; i < 6; ++i)
      s.wrench(i) = uniform(random) * (i < 3 ? force_range : torque_range);
    EXPECT_EQ(wrist.measure(s.wrench, 0.01), Status::ok);
    s.signal = wrist.signal();
    samples.push_back(s);
  }
  return samples;
}

// Without noise C is S⁻¹. With noise each element is within 4.5 of its own σ, which 36 normal
// numbers pass with probability 2e-4, and σ falls as 1/√samples.
TEST(WristWrench, CalibrationRecoversCToTheNoise) {
  const auto options = sensor<6>(0);
  const icat::Matrix6<double> C = options.sensitivity.inverse();
  icat::WristSensor<double, 6> exact(options);
  const auto perfect = icat::calibrate_wrench<double, 6>(bench<6>(exact, 50, 1), options.zero);
  EXPECT_LT((perfect.matrix - C).norm(), 1e-10 * C.norm());
  EXPECT_LT(perfect.residual.norm(), 1e-10);

  double deviation[2] = {};
  for (const int count : {100, 10000}) {
    icat::WristSensor<double, 6> wrist(sensor<6>(0.003));
    const auto fit = icat::calibrate_wrench<double, 6>(bench<6>(wrist, count, 2), options.zero);
    for (int r = 0; r < 6; ++r) {
      for (int i = 0; i < 6; ++i) {
        EXPECT_LT(std::abs(fit.matrix(r, i) - C(r, i)), 4.5 * fit.deviation(r, i)) << r << ' ' << i;
      }
    }
    deviation[count == 100 ? 0 : 1] = fit.deviation(0, 0);
    // The residual is the noise through C.
    for (int r = 0; r < 6; ++r) {
      EXPECT_NEAR(fit.residual(r), 0.003 * C.row(r).norm(), 0.25 * 0.003 * C.row(r).norm());
      EXPECT_LT(fit.residual(r), 0.01 * (r < 3 ? force_range : torque_range));
    }
  }
  EXPECT_NEAR(deviation[0] / deviation[1], 10, 2.5);

  // And no smaller than its σ: χ²/36, over 40 sensors. Correlated within one; of one alone its
  // deviation is below 0.5, so that of the mean is below 0.08.
  double square = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    auto noisy = sensor<6>(0.003);
    noisy.seed = seed;
    icat::WristSensor<double, 6> wrist(noisy);
    const auto fit = icat::calibrate_wrench<double, 6>(bench<6>(wrist, 100, seed), options.zero);
    const auto error = (fit.matrix - C).cwiseQuotient(fit.deviation).eval();
    square += error.squaredNorm() / 36 / 40;
  }
  EXPECT_NEAR(square, 1, 0.25);
}

// On loads that it has not seen, with drift, and more signals than components: RMS below 1 % of 130
// N and 10 N m.
TEST(WristWrench, ResidualOnOtherLoads) {
  auto options = sensor<8>(0.003);
  options.drift = 1e-4;
  icat::WristSensor<double, 8> wrist(options);
  const auto zero = options.zero;
  const auto samples = bench<8>(wrist, 500, 3);
  //! [calibration]
  const auto fit = icat::calibrate_wrench<double, 8>(samples, zero);  // at configuration
  icat::WristWrench<double, 8> estimate(fit, {.mass = 0, .displaced = 0});
  //! [calibration]
  Vector6<double> square = Vector6<double>::Zero();
  const auto loads = bench<8>(wrist, 1000, 4);
  for (const auto& s : loads) {
    ASSERT_EQ(estimate.update(s.signal, icat::Matrix3<double>::Identity()), Status::ok);
    square += (estimate.wrench() - s.wrench).cwiseAbs2() / double(loads.size());
  }
  for (int r = 0; r < 6; ++r) {
    EXPECT_LT(std::sqrt(square(r)), 0.01 * (r < 3 ? force_range : torque_range));
    EXPECT_GT(std::sqrt(square(r)), 1e-4 * (r < 3 ? force_range : torque_range));
  }
}

TEST(WristWrench, TheHandsOwnWeightIsTakenOff) {
  const auto options = sensor<6>(0);
  icat::WrenchCalibration<double, 6> exact;
  exact.matrix = options.sensitivity.inverse();
  exact.zero = options.zero;
  icat::WristSensor<double, 6> wrist(options);
  const icat::HandWeight<double> weight{.centre = {0.01, -0.02, 0.1},
                                        .centre_of_buoyancy = {0, 0.01, 0.12}};
  icat::WristWrench<double, 6> estimate(exact, weight);
  std::mt19937 random(6);
  std::uniform_real_distribution<double> uniform(-3, 3);
  for (int run = 0; run < 50; ++run) {
    const Vector3<double> phi(uniform(random), uniform(random), uniform(random));
    const icat::Matrix3<double> R = icat::rotation_exp<double>(phi);
    const Vector3<double> g = R.transpose() * Vector3<double>(0, 0, 9.81);
    // Weight at its centre, buoyancy at its own, and somebody who pulls.
    Vector6<double> pull, own;
    for (int i = 0; i < 6; ++i) pull(i) = uniform(random);
    own.head<3>() = 4.59 * g - 3.57 * g;
    own.tail<3>() = weight.centre.cross(4.59 * g) - weight.centre_of_buoyancy.cross(3.57 * g);
    ASSERT_EQ(wrist.measure(own + pull, 0.01), Status::ok);
    ASSERT_EQ(estimate.update(wrist.signal(), R), Status::ok);
    EXPECT_LT((estimate.wrench() - pull).norm(), 1e-11);
    EXPECT_LT((estimate.total() - own - pull).norm(), 1e-11);
  }
  // 1 daN in water [MARIS, II-C]; level, straight down.
  const auto level = weight.wrench(icat::Matrix3<double>::Identity());
  EXPECT_NEAR(level(2), 10, 0.01);
  // Drift, taken off while the hand hangs free.
  const icat::Matrix3<double> R = icat::Matrix3<double>::Identity();
  Vector6<double> drift;
  drift << 1, -2, 3, 0.1, 0.2, -0.3;
  ASSERT_EQ(wrist.measure(level + drift, 0.01), Status::ok);
  ASSERT_EQ(estimate.update(wrist.signal(), R), Status::ok);
  EXPECT_LT((estimate.wrench() - drift).norm(), 1e-11);
  estimate.tare();
  EXPECT_LT(estimate.wrench().norm(), 1e-12);
  EXPECT_LT((estimate.offset() - drift).norm(), 1e-11);
}

TEST(WristWrench, Refusals) {
  const auto refused = [](auto action) -> std::string {
    try {
      action();
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  const auto options = sensor<6>(0.001);
  icat::WristSensor<double, 6> wrist(options);
  auto samples = bench<6>(wrist, 20, 7);
  const auto fit = [&] { (void)icat::calibrate_wrench<double, 6>(samples, options.zero); };
  EXPECT_EQ(refused(fit), "");
  auto good = samples;
  samples.resize(5);
  EXPECT_EQ(refused(fit), "calibrate_wrench: 5 samples for 6 signals");
  samples = good;
  samples[3].wrench(2) = NAN;
  EXPECT_EQ(refused(fit), "calibrate_wrench: sample 3 is not finite");
  samples = good;
  for (auto& s : samples) s.signal(4) = s.signal(1) - options.zero(1) + options.zero(4);
  EXPECT_EQ(refused(fit), "calibrate_wrench: the samples do not tell the 6 signals apart");
  for (auto& s : samples) s.signal(4) = options.zero(4);
  EXPECT_EQ(refused(fit), "calibrate_wrench: signal 4 does not move");
  // The same load over and over.
  samples.assign(20, good[0]);
  EXPECT_NE(refused(fit), "");

  const auto calibration = icat::calibrate_wrench<double, 6>(good, options.zero);
  EXPECT_EQ(refused([&] { icat::WristWrench<double, 6>(calibration, {.mass = -1}); }),
            "WristWrench: masses must be finite and >= 0, got -1");
  icat::WristWrench<double, 6> estimate(calibration);
  const icat::Matrix3<double> R = icat::Matrix3<double>::Identity();
  ASSERT_EQ(estimate.update(good[1].signal, R), Status::ok);
  const Vector6<double> before = estimate.wrench();
  icat::Vector<double, 6> bad = good[2].signal;
  bad(0) = NAN;
  EXPECT_EQ(estimate.update(bad, R), Status::non_finite);
  bad(0) = 1e308;
  EXPECT_EQ(estimate.update(bad, R), Status::numerical_failure);
  EXPECT_EQ(estimate.update(good[2].signal, 2 * R), Status::not_a_rotation);
  Vector6<double> offset = before;
  offset(1) = NAN;
  EXPECT_EQ(estimate.tare(offset), Status::non_finite);
  EXPECT_EQ(estimate.wrench(), before);
  EXPECT_EQ(wrist.measure(offset, 0.01), Status::non_finite);
  EXPECT_EQ(wrist.measure(before, -1), Status::time_reversed);
  EXPECT_NE(refused([&] {
              auto o = options;
              o.noise = -1;
              icat::WristSensor<double, 6>{o};
            }),
            "");
#ifndef ICAT_TEST_NO_MALLOC_COUNT
  EXPECT_EQ(count_allocations([&] {
              for (int k = 0; k < 10; ++k) {
                (void)wrist.measure(before, 0.01);
                (void)estimate.update(wrist.signal(), R);
                estimate.tare();
              }
            }),
            0);
#endif
}

TEST(WristWrench, Float) {
  const auto options = sensor<6>(0.001);
  icat::WristSensor<double, 6> wrist(options);
  std::vector<icat::WrenchSample<float, 6>> samples;
  for (const auto& s : bench<6>(wrist, 200, 8)) {
    samples.push_back({s.wrench.cast<float>(), s.signal.cast<float>()});
  }
  const auto fit = icat::calibrate_wrench<float, 6>(samples, options.zero.cast<float>());
  icat::WristWrench<float, 6> estimate(fit, {.mass = 0, .displaced = 0});
  ASSERT_EQ(estimate.update(samples[9].signal, icat::Matrix3<float>::Identity()), Status::ok);
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(estimate.wrench()(i), samples[9].wrench(i),
                0.01F * float(i < 3 ? force_range : torque_range));
  }
}

}  // namespace
