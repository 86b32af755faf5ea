// SPDX-License-Identifier: BSD-3-Clause
// PD6 and PD13: the ensemble that the manual prints, and what damage may do to a format without a
// checksum.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <string>

#include "icat/adapters/dvl.hpp"
#include "tests/hardware/dvl/frames.hpp"

namespace {

using frames::Pd6;
using icat::Pd6Decoder;

constexpr double degree = std::numbers::pi / 180;

int put(Pd6Decoder& dvl, const std::string& s, double now = 0) {
  return dvl.put({reinterpret_cast<const std::uint8_t*>(s.data()), s.size()}, now);
}

// Pathfinder DVL Guide, P/N 95B-6116-00 (April 2018), page 222: "a realistic output from a
// Pathfinder locked onto the bottom".
const std::string printed =
    ":SA, -2.31, +1.92, 75.20\r\n"
    ":TS,04081111563644,35.0,+21.0, 0.0,1524.0, 0\r\n"
    ":RA, 0.00, 71.31, 71.32, 71.32, 71.31\r\n"
    ":WI,-32768,-32768,-32768,-32768,V\r\n"
    ":WS,-32768,-32768,-32768,V\r\n"
    ":WE,-32768,-32768,-32768,V\r\n"
    ":WD, +0.00, +0.00, +0.00, 20.00, 0.00\r\n"
    ":BI, +24, -6, -20, -4,A\r\n"
    ":BS, -13, +21, -20,A\r\n"
    ":BE, +17, +18, -20,A\r\n"
    ":BD, -0.02, -0.03, +0.02, 7.13, 0.21\r\n";

TEST(Pd6, TheManualsEnsemble) {
  // Its :BI and :BS differ by a turn of −135 degrees: so it was mounted.
  Pd6Decoder dvl({.beam_3 = -135 * degree});
  ASSERT_EQ(put(dvl, printed, 2), 1);
  const icat::DvlSample& s = dvl.sample().value;
  EXPECT_EQ(dvl.sample().time, 2);
  EXPECT_TRUE(s.bottom.valid);
  // :BS: 21 ahead, −13 to starboard, −20 away from the bottom; whole mm/s.
  EXPECT_NEAR(s.bottom.velocity[0], 0.021, 6e-4);
  EXPECT_NEAR(s.bottom.velocity[1], -0.013, 6e-4);
  EXPECT_NEAR(s.bottom.velocity[2], 0.020, 1e-12);
  EXPECT_NEAR(s.bottom.error, -0.004, 1e-12);
  // By heading, pitch and roll these are :BE, north 18, east 17, up −20.
  const Eigen::Matrix3d R = (Eigen::AngleAxisd(75.2 * degree, Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(-2.31 * degree, Eigen::Vector3d::UnitY()) *
                             Eigen::AngleAxisd(1.92 * degree, Eigen::Vector3d::UnitX()))
                                .toRotationMatrix();
  const Eigen::Vector3d ned = R * Eigen::Vector3d(s.bottom.velocity.data());
  EXPECT_NEAR(ned(0), 0.018, 1.5e-3);
  EXPECT_NEAR(ned(1), 0.017, 1.5e-3);
  EXPECT_NEAR(ned(2), 0.020, 1.5e-3);
  EXPECT_FALSE(s.water.valid);
  EXPECT_NEAR(s.range[0], 7.131, 1e-12);
  EXPECT_EQ(s.altitude, 7.13);
  EXPECT_NEAR(s.pitch, -2.31 * degree, 1e-12);
  EXPECT_NEAR(s.roll, 1.92 * degree, 1e-12);
  EXPECT_NEAR(s.heading, 75.2 * degree, 1e-12);
  EXPECT_EQ(s.salinity, 35);
  EXPECT_EQ(s.temperature, 21);
  EXPECT_EQ(s.speed_of_sound, 1524);
  EXPECT_NEAR(s.instrument_time, 145540596.44, 1e-6);  // 2004-08-11 11:56:36.44
}

TEST(Pd6, BottomBadWaterGoodThreeBeams) {
  Pd6 f;
  f.status = 'V';
  f.instrument = {-32768, -32768, -32768, -32768};
  f.ship = f.earth = {-32768, -32768, -32768};
  Pd6Decoder dvl({.beam_3 = 0});
  EXPECT_EQ(put(dvl, f.text(), 3), 1);
  EXPECT_FALSE(dvl.sample().value.bottom.valid);
  EXPECT_GT(dvl.bottom_age(3), 1e9);

  // Status good and numbers bad contradict each other.
  f.status = 'A';
  f.time = "26113012345679";
  EXPECT_EQ(put(dvl, f.text()), 0);

  Pd6 three;
  three.time = "26113012345680";
  three.instrument[3] = -32768;
  three.range[1] = 0;
  EXPECT_EQ(put(dvl, three.text()), 1);
  const auto& v = dvl.sample().value.bottom;
  EXPECT_TRUE(v.valid && !v.has_error);
  EXPECT_EQ(v.beams, (std::array<bool, 4>{true, false, true, true}));

  std::string water = Pd6().text();
  water.replace(water.find(":WI"), water.find(":WD") - water.find(":WI"),
                ":WI, +24, -6, -20, -4,A\r\n:WS, -13, +21, -20,A\r\n:WE, +17, +18, -20,A\r\n");
  Pd6Decoder other({.beam_3 = 0});
  EXPECT_EQ(put(other, water), 1);
  EXPECT_TRUE(other.sample().value.water.valid);
  EXPECT_NEAR(other.sample().value.water.velocity[0], -0.006, 1e-12);
  EXPECT_NEAR(other.sample().value.water.velocity[1], 0.024, 1e-12);
}

TEST(Pd6, LinesToTheLetter) {
  const auto with = [](const std::string& from, const std::string& to) {
    std::string s = printed;
    const std::size_t at = s.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return s.replace(at, from.size(), to);
  };
  const std::pair<const char*, const char*> changes[] = {
      {":SA, -2.31, +1.92", ":SA, -2.31, 1.92"},
      {"75.20", "375.20"},
      {"75.20", "75.2"},
      {"-2.31", "-2:31"},
      {"04081111563644", "04131111563644"},
      {"04081111563644", "0408111156364"},
      {"04081111563644", "04081124563644"},
      {"1524.0, 0", "1524.0"},
      {":BI, +24", ":BI, 24"},
      {":BI, +24", ":BI, +2 4"},
      {":BI, +24", ":BI, +24.0"},
      {":BI, +24", ":BI, +240"},
      {":BI, +24", ":BI, +99999"},
      {"-4,A", "-4,B"},
      {"-4,A", "-4,AA"},
      {"-4,A", "-4"},
      {":BI, +24, -6, -20, -4,A\r\n", ""},
      {":BS, -13, +21, -20,A\r\n", ""},
      {":BE, +17, +18, -20,A\r\n", ""},
      {":BD, -0.02", ":BD, -0,02"},
      {":BE", ":BS"},
      {":WI", "WI"},
      {":WI", ":wI"},
      {"\r\n:BE", ":BE"},
      {":BS, -13", ":BS, -93"},
      {":TS", ":SA"},
      {":BE, +17, +18, -20,A\r\n", ":BE, +17, +18, -20,A\r\n:BE, +17, +18, -20,A\r\n"}};
  for (const auto& [from, to] : changes) {
    Pd6Decoder dvl;
    EXPECT_EQ(put(dvl, with(from, to)), 0) << from << " → " << to;
    EXPECT_GE(dvl.damaged(), 1u) << from << " → " << to;
    EXPECT_EQ(put(dvl, printed), 1);  // and all is well
  }
  // A line of another kind, or an empty one, harms nothing.
  Pd6Decoder dvl;
  EXPECT_EQ(put(dvl, with(":BD", ":HM,G,G,0000,0000,24.000,1.000,20.000\r\n\r\n:BD")), 1);
  EXPECT_EQ(dvl.damaged(), 0u);
}

TEST(Pd6, OrderDoublesAndRestart) {
  Pd6Decoder dvl;
  Pd6 f;
  EXPECT_EQ(put(dvl, f.text(), 1), 1);
  EXPECT_EQ(put(dvl, f.text(), 1.1), 0);
  EXPECT_EQ(dvl.repeated(), 1u);
  f.time = "26113012345600";
  EXPECT_EQ(put(dvl, f.text(), 1.2), 0);
  EXPECT_EQ(dvl.late(), 1u);
  EXPECT_EQ(dvl.sample().time, 1);
  EXPECT_EQ(put(dvl, f.text(), 3), 0);
  EXPECT_EQ(put(dvl, f.text(), 12), 1);  // its clock was set back
}

TEST(Pd6, CutAndGarbage) {
  std::mt19937 random(3);
  for (std::size_t cut = 0; cut < printed.size(); ++cut) {
    Pd6Decoder dvl;
    // To the carriage return of its last line.
    EXPECT_EQ(put(dvl, printed.substr(0, cut)), 0) << cut;
    std::string garbage(random() % 400, ' ');
    for (char& c : garbage) c = static_cast<char>(random());
    put(dvl, garbage + "\n");
    EXPECT_EQ(dvl.sample().count, cut + 1 == printed.size() ? dvl.sample().count : 0u);
    EXPECT_EQ(put(dvl, Pd6().text()), 1) << cut;
  }
}

// Without a checksum some damage passes. What passes has the right speed, by three lines, or is no
// velocity.
TEST(Pd6, WhatABitCanDo) {
  Pd6 f;
  f.instrument = {300, 400, -50, 3};
  f.ship = {495, 71, -50};  // turned by 45 degrees
  f.earth = {-250, 433, -50};
  const std::string whole = f.text();
  Pd6Decoder reference;
  ASSERT_EQ(put(reference, whole), 1);
  const auto clean = reference.sample().value;
  const double speed = std::hypot(300, 400, 50) * 1e-3;
  int flips = 0, taken = 0, wrong = 0;
  double worst = 0;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit, ++flips) {
      std::string damaged = whole;
      damaged[i] = static_cast<char>(damaged[i] ^ (1 << bit));
      Pd6Decoder dvl;
      if (put(dvl, damaged) != 1) continue;
      ++taken;
      const auto& v = dvl.sample().value.bottom;
      ASSERT_TRUE(v.valid);
      double error = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        error = std::max(error, std::abs(v.velocity[k] - clean.bottom.velocity[k]));
      }
      if (error > 0) ++wrong;
      worst = std::max(worst, error);
      // 2 % and 3 mm/s of what the other frames say.
      EXPECT_NEAR(std::hypot(v.velocity[0], v.velocity[1], v.velocity[2]), speed,
                  0.02 * speed + 0.005);
    }
  }
  std::printf(
      "PD6: of %d single bits %d pass, %d of them change the velocity, by up to %.0f mm/s\n", flips,
      taken, wrong, 1e3 * worst);
  EXPECT_LT(wrong, flips / 50);
  EXPECT_LT(worst, 0.05);
}

}  // namespace
