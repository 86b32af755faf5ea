// SPDX-License-Identifier: BSD-3-Clause
// The sensors of sim/sensors.hpp, each by itself, and navigation by all of them together.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <icat/navigation/navigation.hpp>
#include <icat/sim/sensors.hpp>
#include <string>

#include "support/allocation_counter.hpp"
#include "support/chi_square.hpp"
#include "support/sanitized.hpp"
#include "support/swimmer.hpp"

namespace {

using icat::Status;
using Vector3 = icat::Vector3<double>;
using Matrix3 = icat::Matrix3<double>;
using Motion = icat::VehicleMotion<double>;

Motion at(double x, double y, double z, double yaw = 0) {
  Motion m;
  m.pose.linear() = icat::rotation_exp<double>(Vector3(0, 0, yaw));
  m.pose.translation() = Vector3(x, y, z);
  return m;
}

// ---- Random numbers

// The standard fixes the generator; Box and Muller's formulas say the rest.
TEST(Noise, IsTheSameEverywhere) {
  icat::Noise noise(5489), again(5489);
  std::mt19937_64 engine(5489);
  const double u1 = static_cast<double>(engine() >> 11) * std::pow(2, -53);
  const double u2 = static_cast<double>(engine() >> 11) * std::pow(2, -53);
  const double radius = std::sqrt(-2 * std::log(1 - u1));
  EXPECT_NEAR(noise.normal(), radius * std::cos(2 * std::numbers::pi * u2), 1e-14);
  EXPECT_NEAR(noise.normal(), radius * std::sin(2 * std::numbers::pi * u2), 1e-14);
  again.normal(), again.normal();
  for (int k = 0; k < 100; ++k) ASSERT_EQ(noise.normal(), again.normal());
}

// Moments of 1e5 normal numbers: deviations of mean, square and fourth power are 1/√n, √(2/n),
// √(96/n); four of each.
TEST(Noise, IsNormal) {
  icat::Noise noise(1);
  const int n = 100000;
  double sum = 0, squares = 0, fourth = 0, product = 0, last = 0;
  for (int k = 0; k < n; ++k) {
    const double x = noise.normal();
    sum += x / n;
    squares += x * x / n;
    fourth += x * x * x * x / n;
    product += x * last / n;
    last = x;
  }
  EXPECT_LT(std::abs(sum), 4 / std::sqrt(n));
  EXPECT_LT(std::abs(squares - 1), 4 * std::sqrt(2.0 / n));
  EXPECT_LT(std::abs(fourth - 3), 4 * std::sqrt(96.0 / n));
  EXPECT_LT(std::abs(product), 4 / std::sqrt(n));
}

// ---- Sensors

// Rate and latency, whatever the steps of the simulation; each measurement comes once.
TEST(Sensors, RateAndLatency) {
  for (const double step : {0.001, 0.01, 0.02}) {
    icat::DepthSensor<double> sensor({.rate = 10, .latency = 0.25, .noise = 0, .bias = 0});
    int count = 0;
    for (int k = 0; k * step < 10 - 1e-9; ++k) {
      const double t = k * step;
      const auto z = sensor.measure(t, at(0, 0, t));  // sinks by 1 m/s
      if (!z) continue;
      EXPECT_NEAR(z->time, 0.1 * count, step + 1e-9);
      EXPECT_NEAR(z->value, z->time, 1e-12);
      EXPECT_GE(t - z->time, 0.25 - 1e-6);
      EXPECT_LE(t - z->time, 0.25 + step + 1e-6);
      ++count;
    }
    EXPECT_EQ(count, 98) << step;  // of 100, two are on their way
  }
}

TEST(Sensors, TimesThatAreNoneAndClocksThatGoBack) {
  icat::DepthSensor<double> sensor({.rate = 10, .latency = 0.25, .noise = 0, .bias = 0});
  const double offset = 100;  // where the clock is after it went on
  const auto run = [&](double from, double to, double depth) {
    int count = 0;
    for (double t = from; t < to - 1e-9; t += 0.01) {
      for (const double none : {double(NAN), double(INFINITY), -double(INFINITY), 1e300}) {
        EXPECT_FALSE(sensor.measure(none, at(0, 0, 99)));
      }
      const auto z = sensor.measure(t, at(0, 0, depth));
      if (!z) continue;
      ++count;
      EXPECT_EQ(z->value, depth);  // none of before
      EXPECT_NEAR(t - z->time, 0.25, 0.01 + 1e-9);
    }
    return count;
  };
  EXPECT_EQ(run(offset, offset + 1, 5), 8);  // from 0, 0.1, … 0.7
  EXPECT_EQ(run(0, 1, 6), 8);
  EXPECT_EQ(run(-5, -4, 7), 8);
}

TEST(Sensors, TheSameSeedTheSameNumbers) {
  icat::Ahrs<double> a({.seed = 5}), b({.seed = 5}), c({.seed = 6});
  for (int k = 0; k < 100; ++k) {
    const auto x = a.measure(0.01 * k, {}), y = b.measure(0.01 * k, {}),
               z = c.measure(0.01 * k, {});
    ASSERT_TRUE(x && y && z);
    ASSERT_EQ(x->value.gyro, y->value.gyro);
    ASSERT_EQ(x->value.attitude, y->value.attitude);
    ASSERT_NE(x->value.gyro, z->value.gyro);
  }
}

// Mean and deviation of 10,000 gyro and heading measurements: the bias is in the mean.
TEST(Sensors, AhrsHasTheNoiseItWasGiven) {
  icat::Ahrs<double>::Options options;
  options.bias_noise = 0;
  icat::Ahrs<double> ahrs(options);
  Motion truth = at(0, 0, 0, 2);
  truth.velocity << 1, 2, 3, 0.1, -0.2, 0.3;
  const int n = 10000;
  double mean = 0, square = 0, heading = 0, heading_square = 0;
  for (int k = 0; k < n; ++k) {
    const auto z = ahrs.measure(0.01 * k, truth);
    ASSERT_TRUE(z);
    const double rate = z->value.gyro(2) - 0.3 - ahrs.bias()(2);
    const Matrix3 turn = z->value.attitude * truth.pose.linear().transpose();
    const double yaw = icat::rotation_log<double>(turn)(2);
    mean += rate / n, square += rate * rate / n;
    heading += yaw / n, heading_square += yaw * yaw / n;
  }
  const double gyro = 5e-4 * std::sqrt(100);  // a density over a hundredth of a second
  EXPECT_LT(std::abs(mean), 4 * gyro / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(square), gyro, 4 * gyro / std::sqrt(2.0 * n));
  EXPECT_NEAR(std::sqrt(heading_square - heading * heading), 0.01, 4 * 0.01 / std::sqrt(2.0 * n));
  EXPECT_LT(std::abs(heading), 4 * 0.0175);
  EXPECT_NE(ahrs.bias()(0), 0);
}

// The covariance of dvl.hpp is that of the errors, with four beams and with three.
TEST(Sensors, DvlErrorsHaveTheirCovariance) {
  for (const double loss : {0.0, 0.25}) {
    icat::Dvl<double>::Options options;
    options.bias = options.scale = 0;
    options.loss = loss;
    options.geometry.position = {0.2, 0.3, 0.4};
    icat::Dvl<double> dvl(options);
    Motion truth = at(0, 0, 5, 1);
    truth.velocity << 0.3, -0.1, 0.05, 0, 0, 0.2;
    const Vector3 moving =
        Vector3(0.3, -0.1, 0.05) + Vector3(0, 0, 0.2).cross(Vector3(0.2, 0.3, 0.4));
    double sum = 0, degrees = 0;
    int three = 0, fewer = 0;
    for (int k = 0; k < 2000; ++k) {
      const auto z = dvl.measure(0.125 * k, truth);
      ASSERT_TRUE(z);
      Matrix3 P;
      if (!icat::detail::dvl_covariance(options.geometry, z->value.beams, P)) {
        ++fewer;
        EXPECT_EQ(z->value.velocity.norm(), 0);
        continue;
      }
      int beams = 0;
      for (const bool found : z->value.beams) beams += found ? 1 : 0;
      three += beams == 3 ? 1 : 0;
      P *= 1e-4;  // (1 cm/s)²
      const Vector3 e = z->value.velocity - moving;
      sum += support::normalized_square<3>(P, e);
      degrees += 3;
    }
    EXPECT_TRUE(support::in_chi_square_band(sum, degrees)) << sum / degrees;
    // 4 · 0.25 · 0.75³ = 0.42 of all have three beams, 0.26 fewer; four deviations, 0.011.
    EXPECT_NEAR(three / 2000.0, loss > 0 ? 0.42 : 0, 0.044);
    EXPECT_NEAR(fewer / 2000.0, loss > 0 ? 0.26 : 0, 0.044);
  }
}

// Full at 1 m over the floor and above, gone at 0.5 m, in between with a chance.
TEST(Sensors, DvlLosesItsBeamsNearTheBottomAndFarFromIt) {
  const auto beams_at = [](double altitude, const Vector3& tilt = Vector3::Zero()) {
    icat::Dvl<double>::Options options;
    options.floor = 100;
    options.geometry.position = {0, 0, 0.4};
    icat::Dvl<double> dvl(options);
    Motion truth = at(0, 0, 100 - altitude - 0.4);
    truth.pose.linear() = icat::rotation_exp<double>(tilt);
    double beams = 0;
    for (int k = 0; k < 1000; ++k) {
      const auto z = dvl.measure(0.125 * k, truth);
      for (const bool found : z->value.beams) beams += found ? 1e-3 : 0;
    }
    return beams;
  };
  EXPECT_NEAR(beams_at(60), 4, 1e-9);
  EXPECT_NEAR(beams_at(1.001), 4, 1e-9);
  EXPECT_NEAR(beams_at(0.75), 2, 4 * std::sqrt(4 * 0.25 / 1000));
  EXPECT_EQ(beams_at(0.499), 0);
  EXPECT_EQ(beams_at(-3), 0);
  EXPECT_EQ(beams_at(80 * std::cos(std::numbers::pi / 6) + 0.01), 0);  // 80 m along the beam
  // Rolled by 70°, two beams look up.
  EXPECT_NEAR(beams_at(10, Vector3(70 * std::numbers::pi / 180, 0, 0)), 2, 1e-9);
}

TEST(Sensors, GpsAtTheSurfaceOnly) {
  icat::Gps<double> gps({.noise = 0.5, .bias = 0});
  int fixes = 0;
  for (int k = 0; k < 400; ++k) {
    const double t = 0.01 * k;
    if (const auto z = gps.measure(t, at(3, 4, t < 2 ? 0.1 : 0.3))) {
      ++fixes;
      EXPECT_LT((z->value - icat::Vector<double, 2>(3, 4)).norm(), 2.5);
      EXPECT_LT(t, 2);
    }
  }
  EXPECT_EQ(fixes, 8);
}

TEST(SensorErrors, ConfigurationThrowsWithNamesAndNumbers) {
  const auto refused = [](auto&& make, const char* text) {
    try {
      make();
      FAIL() << "accepted: " << text;
    } catch (const std::invalid_argument& error) {
      EXPECT_STREQ(error.what(), text);
    }
  };
  refused([] { icat::Ahrs<double>({.rate = 0}); }, "Ahrs: rate must be finite and > 0, got 0");
  refused([] { icat::Ahrs<double>({.tilt_bias = -1}); },
          "Ahrs: a deviation must be finite and >= 0, got -1");
  refused([] { icat::Dvl<double>({.loss = 2}); }, "Dvl: loss must be in [0, 1], got 2");
  refused([] { icat::DepthSensor<double>({.latency = -1}); },
          "DepthSensor: latency must be >= 0 and below a million slots, got -1 s at 10 Hz");
  refused([] { icat::Gps<double>({.noise = NAN}); }, "Gps: noise must be finite and >= 0, got nan");
}

TEST(SensorsAllocate, NothingWhileTheyMeasure) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  icat::Ahrs<double> ahrs({.latency = 0.05});
  icat::Dvl<double> dvl({.latency = 0.2});
  icat::DepthSensor<double> depth({.latency = 0.1});
  icat::Gps<double> gps({.latency = 0.3});
  int count = 0;
  EXPECT_EQ(count_allocations([&] {
              for (int k = 0; k < 1000; ++k) {
                const Motion truth;
                count += ahrs.measure(0.01 * k, truth) ? 1 : 0;
                count += dvl.measure(0.01 * k, truth) ? 1 : 0;
                count += depth.measure(0.01 * k, truth) ? 1 : 0;
                count += gps.measure(0.01 * k, truth) ? 1 : 0;
              }
            }),
            0);
  EXPECT_GT(count, 1200);
}

// ---- All together

// Largest errors after 60 s, m/s, rad; of the sums of squares over their covariance, how many.
struct Outcome {
  double velocity = 0, current = 0, heading = 0;
  double velocity_nees = 0, velocity_degrees = 0;  // every 5 s, as errors last one or two
  double position_nees = 0, position_degrees = 0;  // at the end
};

// 150 s of swimming in curves with a current of 0.1 m/s, 3 m over the floor. `bias` scales all
// constant errors of the sensors, `latency` is that of DVL and AHRS, `drag` the vehicle's against
// the model's.
Outcome swim(std::uint64_t seed, double bias, double latency, double drag) {
  icat::Ahrs<double>::Options ahrs_options;
  ahrs_options.tilt_bias *= bias;
  ahrs_options.heading_bias *= bias;
  ahrs_options.latency = latency / 10;
  ahrs_options.seed = 10 * seed;
  icat::Dvl<double>::Options dvl_options;
  dvl_options.bias *= bias;
  dvl_options.scale *= bias;
  dvl_options.latency = latency;
  dvl_options.geometry.position = {0.3, 0, 0.4};
  dvl_options.seed = 10 * seed + 1;
  icat::Ahrs<double> ahrs(ahrs_options);
  icat::Dvl<double> dvl(dvl_options);
  icat::DepthSensor<double> depth({.bias = 0.01 * bias, .seed = 10 * seed + 2});
  icat::Noise disturbance(10 * seed + 3);

  icat::VehicleModel<double> vehicle = support::vehicle_model();
  vehicle.weight_in_water = -29;  // it floats

  //! [navigation]
  icat::Navigation<double>::Options options;
  options.velocity.dvl = dvl_options.geometry;  // position and beam angle
  options.attitude.heading_noise = 0.02;        // rad; the next section says how to choose
  options.position.initial_position = 0.1;      // m
  icat::Navigation<double> navigation(vehicle, at(0, 0, 6.6).pose, options);
  //! [navigation]

  support::Swimmer swimmer;
  swimmer.model = vehicle;
  swimmer.model.linear_drag *= drag, swimmer.model.quadratic_drag *= drag;
  swimmer.current = {0.08, -0.06, 0};
  swimmer.position = {0, 0, 6.6};
  Motion truth = at(0, 0, 6.6);
  Outcome result;
  constexpr double dt = 0.01;
  const int steps = sanitized ? 8000 : 15000;
  Vector3 gyro = Vector3::Zero();
  for (int k = 0; k < steps; ++k) {
    const double now = k * dt;
    icat::Vector6<double> wrench = icat::Vector6<double>::Zero();
    wrench(0) = 45;
    wrench(2) = 29;
    wrench(5) = 8 * std::sin(0.15 * now);
    swimmer.turn(wrench(5), dt);
    const Vector3 angular(0, 0, swimmer.yaw_rate);
    swimmer.step(wrench.head<3>(), angular, disturbance.vector<double, 3>(0.005 / std::sqrt(dt)),
                 dt);
    truth.pose.linear() = swimmer.R;
    truth.pose.translation() = swimmer.position;
    truth.velocity << swimmer.velocity, angular;

    //! [loop]
    const auto inertial = ahrs.measure(now, truth);
    if (inertial) gyro = inertial->value.gyro;
    EXPECT_EQ(navigation.step(now, gyro, wrench), Status::ok);
    // Each measurement when it arrives, with its age. Refused ones are counted.
    if (inertial) {
      (void)navigation.correct_attitude(inertial->value.attitude, now - inertial->time);
    }
    if (const auto z = dvl.measure(now, truth)) {
      (void)navigation.correct_dvl(z->value, now - z->time);
    }
    if (const auto z = depth.measure(now, truth)) {
      (void)navigation.correct_depth(z->value, now - z->time);
    }
    const icat::Pose<double> pose = navigation.pose();                 // ⟨v⟩ in ⟨0⟩
    const icat::Vector6<double> velocity = navigation.velocity();      // over ground, on ⟨v⟩
    const icat::Vector<double, 2> flowing = navigation.current();      // north, east
    const bool blind = navigation.velocity_estimator().dvl().stale();  // for more than a second
    //! [loop]

    EXPECT_FALSE(blind && now > 1.5);
    if (now < 60) continue;
    const icat::Vector6<double> off = velocity - truth.velocity;
    const Matrix3 turn = pose.linear() * truth.pose.linear().transpose();
    result.velocity = std::max(result.velocity, off.head<3>().norm());
    result.current = std::max(result.current, (flowing - swimmer.current.head<2>()).norm());
    result.heading = std::max(result.heading, std::abs(icat::rotation_log<double>(turn)(2)));
    if (k % 500 == 0) {
      const Matrix3 P = navigation.velocity_estimator().velocity_covariance();
      result.velocity_nees += support::normalized_square<3>(P, Vector3(off.head<3>()));
      result.velocity_degrees += 3;
    }
    if (k == steps - 1) {
      const Vector3 away = pose.translation() - truth.pose.translation();
      const Matrix3 P = navigation.position_estimator().covariance();
      result.position_nees = support::normalized_square<3>(P, away);
      result.position_degrees = 3;
    }
  }
  return result;
}

constexpr int runs = sanitized ? 2 : 12;

Outcome worst_of_runs(double bias, double latency, double drag) {
  Outcome worst;
  for (int run = 1; run <= runs; ++run) {
    const Outcome o = swim(static_cast<std::uint64_t>(run), bias, latency, drag);
    worst.velocity = std::max(worst.velocity, o.velocity);
    worst.current = std::max(worst.current, o.current);
    worst.heading = std::max(worst.heading, o.heading);
    worst.velocity_nees += o.velocity_nees, worst.velocity_degrees += o.velocity_degrees;
    worst.position_nees += o.position_nees, worst.position_degrees += o.position_degrees;
  }
  std::printf(
      "bias %g, latency %g s, drag %g: velocity %.4f, current %.4f m/s, heading %.4f rad; "
      "NEES %.2f, %.2f of 1\n",
      bias, latency, drag, worst.velocity, worst.current, worst.heading,
      worst.velocity_nees / worst.velocity_degrees, worst.position_nees / worst.position_degrees);
  return worst;
}

const Outcome& ideal() {
  static const Outcome outcome = worst_of_runs(0, 0, 1);
  return outcome;
}

// At most as large as its covariance says, in 97.5 of 100.
bool not_too_sure(double sum, double degrees) {
  return sum < support::chi_square_quantile(degrees, 1.96);
}

// White noise alone: the velocity is consistent, through the errors of attitude and rate too.
TEST(NavigationWithSensors, WithoutConstantErrors) {
  const Outcome& o = ideal();
  EXPECT_TRUE(support::in_chi_square_band(o.velocity_nees, o.velocity_degrees));
  EXPECT_TRUE(not_too_sure(o.position_nees, o.position_degrees));
  EXPECT_LT(o.current, 0.01);
}

// A bias of 2 mm/s and of one degree is seen by no filter. It adds to what noise does (velocity: an
// error of 5 mm/s a component, 4.6 deviations of its norm in 2000 independent ones); the position
// counts with it.
TEST(NavigationWithSensors, WithConstantErrors) {
  const Outcome o = worst_of_runs(1, 0, 1);
  EXPECT_LT(o.velocity, 4.6 * 0.005 + 3 * std::sqrt(3) * 0.002);
  EXPECT_LT(o.heading, 3 * 0.0175 + 0.005);
  EXPECT_TRUE(not_too_sure(o.position_nees, o.position_degrees));
}

// DVL 0.2 s late, AHRS 0.02 s: with their ages, hardly worse than in time, and known.
TEST(NavigationWithSensors, LateMeasurements) {
  const Outcome& in_time = ideal();
  const Outcome late = worst_of_runs(0, 0.2, 1);
  EXPECT_LT(late.velocity, 1.2 * in_time.velocity);
  EXPECT_LT(late.current, 1.2 * in_time.current);
  EXPECT_TRUE(support::in_chi_square_band(late.velocity_nees, late.velocity_degrees));
}

// Drag 10 % larger than the model's: 50 u + 320 u² of 45 N gives u = 0.305 and 0.288 m/s. The
// difference is taken for a current.
TEST(NavigationWithSensors, WrongDragBecomesCurrent) {
  const Outcome o = worst_of_runs(0, 0, 1.1);
  EXPECT_GT(o.current, 0.305 - 0.288 - 0.01);
  EXPECT_LT(o.current, 0.305 - 0.288 + 0.01);
}

}  // namespace
