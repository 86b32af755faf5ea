// SPDX-License-Identifier: BSD-3-Clause
// What the bytes of PD0 may do to the decoder, without a peer: frames and signs by the words of the
// manual, beams, order, damage.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "icat/adapters/dvl.hpp"
#include "icat/navigation/velocity_estimator.hpp"
#include "tests/hardware/dvl/frames.hpp"

namespace {

using frames::bad;
using frames::Bytes;
using frames::Pd0;
using icat::Pd0Decoder;

constexpr double degree = std::numbers::pi / 180;

icat::DvlSample decoded(const Pd0& frame, const icat::DvlOptions& options = {}) {
  Pd0Decoder dvl(options);
  EXPECT_EQ(dvl.put(frame.bytes(), 1), 1);
  return dvl.sample().value;
}
void expect_velocity(const icat::DvlVelocity& v, double x, double y, double z,
                     double tolerance = 1e-12) {
  EXPECT_TRUE(v.valid);
  EXPECT_NEAR(v.velocity[0], x, tolerance);
  EXPECT_NEAR(v.velocity[1], y, tolerance);
  EXPECT_NEAR(v.velocity[2], z, tolerance);
}

TEST(Pd0, AllFields) {
  Pd0 f;
  f.number = 0x031234;
  f.frame = 1;
  f.range = {713, 0, 70000, 1000};
  f.bottom = {100, -200, 300, 5};
  f.water = {10, 20, 30, bad};
  const icat::DvlSample s = decoded(f, {.beam_3 = 0});
  EXPECT_EQ(s.ensemble, 0x031234u);
  EXPECT_NEAR(s.instrument_time, 849357296.78, 1e-6);  // date -u +%s, less 946684800
  EXPECT_NEAR(s.heading, 75.2 * degree, 1e-12);
  EXPECT_NEAR(s.pitch, -2.31 * degree, 1e-12);
  EXPECT_NEAR(s.roll, 1.92 * degree, 1e-12);
  EXPECT_EQ(s.salinity, 35);
  EXPECT_NEAR(s.temperature, 21, 1e-12);
  EXPECT_EQ(s.speed_of_sound, 1524);
  EXPECT_NEAR(s.depth, 12.3, 1e-12);
  EXPECT_NEAR(s.range[0], 7.13, 1e-12);
  EXPECT_EQ(s.range[1], 0);
  EXPECT_NEAR(s.range[2], 700, 1e-9);  // more than two bytes hold
  EXPECT_NEAR(s.altitude, (7.13 + 700 + 10) / 3, 1e-9);
  EXPECT_TRUE(s.bottom.has_error);
  EXPECT_NEAR(s.bottom.error, 0.005, 1e-15);
  // The bottom goes past: the vehicle goes the other way; Y is ahead, X to starboard, Z up.
  expect_velocity(s.bottom, 0.2, -0.1, 0.3);
  expect_velocity(s.water, -0.02, -0.01, 0.03);
  EXPECT_FALSE(s.water.has_error);
}

TEST(Pd0, InstrumentTimeCountsFrom2000) {
  Pd0 f;
  f.clock = {0, 1, 1, 0, 0, 1, 50};
  EXPECT_NEAR(decoded(f).instrument_time, 1.5, 1e-12);
  f.clock = {24, 2, 29, 23, 59, 59, 99};
  EXPECT_NEAR(decoded(f).instrument_time, 762566399.99, 1e-6);
  f.clock = {23, 2, 29, 0, 0, 0, 0};  // there is none
  EXPECT_EQ(decoded(f).instrument_time, -1);
}

TEST(Pd0, SignsByTheManual) {
  // "If Beam 3 is going forward, then the Y velocity is negative", and so on.
  Pd0 f;
  f.frame = 1;
  f.bottom = {0, -500, 0, 0};
  expect_velocity(decoded(f, {.beam_3 = 0}).bottom, 0.5, 0, 0);
  f.bottom = {-500, 0, 0, 0};  // beam 2 goes forward: it is to starboard of beam 3
  expect_velocity(decoded(f, {.beam_3 = -90 * degree}).bottom, 0.5, 0, 0, 1e-9);
  f.bottom = {0, 0, 500, 0};  // the bottom goes towards the face of a unit that looks down
  expect_velocity(decoded(f, {.beam_3 = 0}).bottom, 0, 0, 0.5);
  // Beam 3 at 45 degrees: ahead is half way between beams 3 and 1.
  f.bottom = {1000, -1000, 0, 0};
  expect_velocity(decoded(f).bottom, std::sqrt(2.0), 0, 0, 1e-9);
  // Ship coordinates need no angle: starboard, forward, mast.
  f.frame = 2;
  f.bottom = {100, 200, 300, 0};
  expect_velocity(decoded(f, {.beam_3 = 1.234}).bottom, -0.2, -0.1, 0.3);
  f.frame = 3;
  const icat::DvlSample earth = decoded(f);
  EXPECT_EQ(earth.frame, icat::DvlFrame::earth);
  expect_velocity(earth.bottom, -0.2, -0.1, 0.3);
  EXPECT_FALSE(icat::dvl_measurement<double>(earth).beams[0]);
  // One that looks up: X and Z are the other way round.
  f.frame = 1;
  f.up = true;
  f.bottom = {100, 200, 300, 0};
  expect_velocity(decoded(f, {.beam_3 = 0}).bottom, -0.2, 0.1, -0.3);
}

// What each beam hears of a bottom that stands still while the instrument goes at v, mm/s: positive
// towards the head.
std::array<int, 4> beams_of(const std::array<double, 3>& v, double beam_3, double angle,
                            double c = 1) {
  std::array<int, 4> out{};
  const double azimuth[4] = {-90, 90, 0, 180};  // beams 1 … 4 from beam 3, clockwise from above
  for (std::size_t k = 0; k < 4; ++k) {
    const double a = beam_3 + azimuth[k] * degree;
    const double across = c * std::sin(angle);  // a concave head crosses its beams
    out[k] = static_cast<int>(std::lround(
        1000 * (across * (std::cos(a) * v[0] + std::sin(a) * v[1]) + std::cos(angle) * v[2])));
  }
  return out;
}

TEST(Pd0, BeamsMakeAVelocity) {
  for (const double beam_3 : {0.0, 45.0, -135.0, 200.0}) {
    for (int code = 0; code < 4; ++code) {
      for (const bool convex : {true, false}) {
        Pd0 f;
        f.convex = convex;
        f.angle_code = code;
        f.angle_byte = code == 3 ? 25 : 0;
        const double angle = (code == 0 ? 15 : code == 1 ? 20 : code == 2 ? 30 : 25) * degree;
        const std::array<double, 3> v{1.2, -0.4, 0.1};
        f.bottom = beams_of(v, beam_3 * degree, angle, convex ? 1 : -1);
        const auto four = decoded(f, {.beam_3 = beam_3 * degree}).bottom;
        // Half a mm/s of each beam, over 2 sin 15 degrees.
        expect_velocity(four, v[0], v[1], v[2], 2e-3);
        EXPECT_TRUE(four.has_error);
        EXPECT_NEAR(four.error, 0, 2e-3);
        for (std::size_t lost = 0; lost < 4; ++lost) {
          Pd0 three = f;
          three.bottom[lost] = bad;
          const auto got = decoded(three, {.beam_3 = beam_3 * degree}).bottom;
          expect_velocity(got, v[0], v[1], v[2], 5e-3);
          EXPECT_FALSE(got.has_error);
          for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(got.beams[k], k != lost);
          three.bottom[(lost + 1) % 4] = bad;
          EXPECT_FALSE(decoded(three).bottom.valid);
        }
      }
    }
  }
  Pd0 unknown;
  unknown.angle_code = 3;
  unknown.angle_byte = 0;
  EXPECT_FALSE(decoded(unknown).bottom.valid);
}

TEST(Pd0, ThreeBeamsOfTheInstrumentsOwn) {
  Pd0 f;
  f.frame = 2;
  f.bottom = {100, 200, 300, bad};
  f.range = {713, 714, 0, 716};
  auto v = decoded(f).bottom;
  EXPECT_TRUE(v.valid && !v.has_error);
  EXPECT_EQ(v.beams, (std::array<bool, 4>{true, true, false, true}));
  f.range = {713, 714, 715, 716};  // it does not say which
  EXPECT_EQ(decoded(f).bottom.beams, (std::array<bool, 4>{true, true, true, false}));
  f.bottom = {bad, bad, bad, bad};
  EXPECT_FALSE(decoded(f).bottom.valid);
  f.bottom = {100, bad, 300, 5};
  EXPECT_FALSE(decoded(f).bottom.valid);
  f.bottom = {9000, 9000, 0, 5};  // faster than the manual's range
  EXPECT_FALSE(decoded(f).bottom.valid);
  f.with_track = false;
  EXPECT_FALSE(decoded(f).bottom.valid);
}

TEST(Pd0, TiltsAreTakenBack) {
  // Level ship coordinates of a vehicle whose velocity on itself is known, by rotation matrices.
  const icat::Vector3<double> v(1.0, -0.3, 0.2);
  for (const bool gimbal : {false, true}) {
    Pd0 f;
    f.frame = 2;
    f.tilts = true;
    f.gimbal = gimbal;
    f.pitch = 1250;
    f.roll = -800;
    const double roll = -8 * degree;
    const double pitch =
        gimbal ? std::atan(std::tan(12.5 * degree) * std::cos(roll)) : 12.5 * degree;
    Eigen::Matrix3d R = (Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
                            .toRotationMatrix();
    const Eigen::Vector3d level = R * Eigen::Vector3d(v(0), v(1), v(2));
    f.bottom = {static_cast<int>(std::lround(-1000 * level(1))),
                static_cast<int>(std::lround(-1000 * level(0))),
                static_cast<int>(std::lround(1000 * level(2))), 0};
    expect_velocity(decoded(f).bottom, v(0), v(1), v(2), 2e-3);
  }
}

TEST(Pd0, OrderDoublesAndRestart) {
  Pd0Decoder dvl;
  Pd0 f;
  const auto put = [&](std::uint32_t number, double now) {
    f.number = number;
    return dvl.put(f.bytes(), now);
  };
  EXPECT_EQ(put(100, 1), 1);
  EXPECT_EQ(put(100, 1.1), 0);
  EXPECT_EQ(dvl.repeated(), 1u);
  EXPECT_EQ(put(99, 1.2), 0);
  EXPECT_EQ(dvl.late(), 1u);
  EXPECT_EQ(dvl.sample().value.ensemble, 100u);
  EXPECT_EQ(dvl.sample().time, 1);
  EXPECT_EQ(put(101, 1.3), 1);
  // Silence for more than a second: late still, by its clock; begun anew where the clock went on.
  EXPECT_EQ(put(50, 3), 0);
  f.clock[5] += 2;
  EXPECT_EQ(put(1, 3), 1);
  // A clock without battery begins anew, too.
  f.clock = {20, 1, 1, 0, 0, 0, 0};
  EXPECT_EQ(put(0xfffff0, 4.5), 0);
  EXPECT_EQ(put(0xfffff0, 14), 1);
  EXPECT_EQ(put(2, 14.1), 1);  // the number wraps around
}

TEST(Pd0, AgeOfTheBottom) {
  Pd0Decoder dvl;
  Pd0 f;
  EXPECT_TRUE(std::isinf(dvl.bottom_age(1)));
  EXPECT_EQ(dvl.put(f.bytes(), 1), 1);
  EXPECT_EQ(dvl.bottom_age(1.5), 0.5);
  EXPECT_TRUE(std::isinf(dvl.bottom_age(0.9)));  // the clock was set back
  EXPECT_TRUE(std::isinf(dvl.bottom_age(std::nan(""))));
  // An ensemble without bottom is a sample all the same.
  f.number = 2;
  f.bottom = {bad, bad, bad, bad};
  EXPECT_EQ(dvl.put(f.bytes(), 2), 1);
  EXPECT_EQ(dvl.bottom_age(2.5), 1.5);
  EXPECT_EQ(dvl.sample().age(2.5), 0.5);
}

TEST(Pd0, LimitsOfOptions) {
  EXPECT_THROW(Pd0Decoder({.beam_3 = 45}), std::invalid_argument);
  EXPECT_THROW(Pd0Decoder({.restart_after = 0}), std::invalid_argument);
  EXPECT_THROW(Pd0Decoder({.most_speed = std::nan("")}), std::invalid_argument);
  EXPECT_THROW(Pd0Decoder({.longest = 63}), std::invalid_argument);
  EXPECT_THROW(Pd0Decoder({.longest = 65536}), std::invalid_argument);
  // An ensemble that is longer is none, one that fits to the byte is one.
  Pd0 f;
  const int length = static_cast<int>(f.bytes().size()) - 2;
  Pd0Decoder fits({.longest = length}), small({.longest = length - 1});
  EXPECT_EQ(fits.put(f.bytes(), 0), 1);
  EXPECT_EQ(small.put(f.bytes(), 0), 0);
}

void expect_clean(const Pd0Decoder& dvl, const icat::DvlSample& clean) {
  if (dvl.sample().count == 0) return;
  const icat::DvlSample& s = dvl.sample().value;
  EXPECT_EQ(s.ensemble, clean.ensemble);
  EXPECT_EQ(s.bottom.velocity, clean.bottom.velocity);
  EXPECT_EQ(s.bottom.beams, clean.bottom.beams);
  EXPECT_EQ(s.range, clean.range);
  EXPECT_EQ(s.heading, clean.heading);
  EXPECT_EQ(s.instrument_time, clean.instrument_time);
}

TEST(Pd0, NoBitAndNoByteMakesAWrongValue) {
  const Pd0 f;
  const Bytes whole = f.bytes();
  const icat::DvlSample clean = decoded(f);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    for (int change = 1; change < 256; ++change) {
      Bytes damaged = whole;
      damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ change);
      Pd0Decoder dvl;
      EXPECT_EQ(dvl.put(damaged, 0), 0) << i << " " << change;
      ASSERT_FALSE(HasFailure());
    }
  }
  for (std::size_t cut = 0; cut < whole.size(); ++cut) {
    Pd0Decoder dvl;
    EXPECT_EQ(dvl.put({whole.data(), cut}, 0), 0);
    // Bytes lost in the middle.
    Pd0Decoder other;
    Bytes shorter = whole;
    shorter.erase(shorter.begin() + static_cast<std::ptrdiff_t>(cut));
    EXPECT_EQ(other.put(shorter, 0), 0);
    expect_clean(dvl, clean);
  }
}

TEST(Pd0, ACutEnsembleCostsNoOther) {
  Pd0 f;
  const Bytes whole = f.bytes();
  for (std::size_t cut = 0; cut < whole.size(); ++cut) {
    Pd0Decoder dvl({.longest = 512});
    EXPECT_EQ(dvl.put({whole.data(), cut}, 0), 0);
    int found = 0;
    for (std::uint32_t k = 1; k <= 5; ++k) {
      f.number = 10 + k;
      found += dvl.put(f.bytes(), 0);
    }
    ASSERT_EQ(found, 5) << cut;
  }
}

TEST(Pd0, FindsTheNextEnsembleWithinTheLongest) {
  std::mt19937 random(7);
  const int longest = 512;
  for (int run = 0; run < 3000; ++run) {
    Pd0Decoder dvl({.longest = longest});
    Pd0 f;
    f.number = 10;
    Bytes stream = f.bytes();
    if (run % 2 == 0) f.fill = 0x7f;  // sync bytes wherever nothing else stands
    // Damage of any kind: cut, flipped, or garbage that is full of headers.
    if (run % 3 == 0) stream.resize(random() % stream.size());
    for (int k = 0; k < static_cast<int>(random() % 4) && !stream.empty(); ++k) {
      stream[random() % stream.size()] = static_cast<std::uint8_t>(random());
    }
    for (int k = 0; k < static_cast<int>(random() % 300); ++k) {
      stream.push_back(random() % 3 == 0 ? 0x7f : static_cast<std::uint8_t>(random() % 4));
    }
    dvl.put(stream, 0);
    // From here on all is well; an ensemble is found when at most `longest` bytes more have come.
    std::size_t sent = 0;
    int found = 0;
    for (std::uint32_t number = 11; found == 0; ++number) {
      f.number = number;
      const Bytes next = f.bytes();
      sent += next.size();
      found = dvl.put(next, 0);
      ASSERT_LE(sent, static_cast<std::size_t>(longest) + 2 * next.size()) << run;
    }
    EXPECT_EQ(dvl.sample().value.bottom.valid, true);
    // And none after that is lost.
    const std::uint32_t last = dvl.sample().value.ensemble;
    f.number = last + 1;
    EXPECT_EQ(dvl.put(f.bytes(), 0), 1);
  }
}

TEST(Dvl, GoesIntoTheEstimator) {
  // Beam 3 at 45 degrees is the front right one of DvlGeometry, beam 4 the back left one.
  icat::DvlSample s;
  s.beam_3 = 45 * degree;
  s.bottom.valid = true;
  s.bottom.beams = {true, true, false, true};
  auto m = icat::dvl_measurement<double>(s);
  EXPECT_EQ(m.beams, (std::array<bool, 4>{false, true, true, true}));
  s.bottom.beams = {true, true, true, false};
  EXPECT_EQ(icat::dvl_measurement<double>(s).beams, (std::array<bool, 4>{true, true, false, true}));
  // Beam 3 at 135 degrees is the back right one.
  s.bottom.beams = {true, true, false, true};
  s.beam_3 = 135 * degree;
  EXPECT_EQ(icat::dvl_measurement<double>(s).beams, (std::array<bool, 4>{true, false, true, true}));
  s.beam_3 = -45 * degree;
  EXPECT_EQ(icat::dvl_measurement<double>(s).beams, (std::array<bool, 4>{true, true, true, false}));
  // The same beams by geometry: of each beam of DvlGeometry, the instrument's nearest in azimuth.
  icat::DvlGeometry<double> geometry;
  for (const double beam_3 : {45.0, 135.0, -45.0, -135.0}) {
    for (std::size_t lost = 0; lost < 4; ++lost) {
      s.bottom.beams = {true, true, true, true};
      s.bottom.beams[lost] = false;
      s.beam_3 = beam_3 * degree;
      const auto beams = icat::dvl_measurement<double>(s).beams;
      const double azimuth = (beam_3 + std::array<double, 4>{-90, 90, 0, 180}[lost]) * degree;
      for (int i = 0; i < 4; ++i) {
        const auto b = geometry.beam(i);
        const bool same =
            std::abs(std::remainder(std::atan2(b(1), b(0)) - azimuth, 6.2831853)) < 0.1;
        EXPECT_EQ(beams[static_cast<std::size_t>(i)], !same);
      }
    }
  }

  icat::VehicleModel<double> model;
  for (int i = 0; i < 6; ++i) model.inertia(i) = i < 3 ? 400 : 60;
  icat::VelocityEstimator<double> estimator(model);
  Pd0Decoder decoder;
  const icat::Matrix3<double> attitude = icat::Matrix3<double>::Identity();
  std::uint32_t taken = 0;
  bool stop = false;
  for (int k = 0; k < 400; ++k) {
    const double now = 0.01 * k;
    EXPECT_EQ(estimator.predict({0, 0, 0}, attitude, {0, 0, 0}, 0.01), icat::Status::ok);
    Bytes came;
    if (k % 10 == 0) {
      Pd0 f;
      f.number = static_cast<std::uint32_t>(k + 1);
      f.bottom = beams_of({0.2, -0.1, 0.05}, 45 * degree, 30 * degree);
      came = f.bytes();
    }
    //! [dvl]
    decoder.put(came, now);
    if (const auto& dvl = decoder.sample(); dvl.count != taken) {
      taken = dvl.count;
      (void)estimator.correct_dvl(icat::dvl_measurement<double>(dvl.value), now - dvl.time);
    }
    stop = decoder.bottom_age(now) > 1;  // no bottom for a second: model velocity
    //! [dvl]
    EXPECT_FALSE(stop);
  }
  EXPECT_NEAR(estimator.velocity()(0), 0.2, 0.01);
  EXPECT_NEAR(estimator.velocity()(1), -0.1, 0.01);
  EXPECT_NEAR(estimator.velocity()(2), 0.05, 0.01);
}

}  // namespace
