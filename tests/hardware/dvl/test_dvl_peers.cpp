// SPDX-License-Identifier: BSD-3-Clause
// PD0 against dolfyn, which reads the same files; streams of PD0 and PD6 that are killed and
// started again.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>
#include <sstream>

#include "icat/adapters/dvl.hpp"
#include "tests/hardware/dvl/frames.hpp"
#include "tests/hardware/support/loop.hpp"
#include "tests/hardware/support/process.hpp"
#include "tests/hardware/support/sender.hpp"
#include "tests/hardware/support/tcp.hpp"

namespace {

using frames::bad;
using frames::Pd0;

constexpr double degree = std::numbers::pi / 180;

// One line of what dolfyn reads.
struct Ensemble {
  double number, time, heading, pitch, roll, sound, depth, salinity, temperature;
  std::array<double, 4> range, velocity;
};

std::vector<Pd0> random_frames(std::mt19937& random, int frame, bool gimbal, bool up, bool convex,
                               int angle) {
  const auto integer = [&](int a, int b) {
    return std::uniform_int_distribution<int>(a, b)(random);
  };
  std::vector<Pd0> out;
  for (int k = 0; k < 60; ++k) {
    Pd0 f;
    f.number = static_cast<std::uint32_t>(1000 + 3 * k);
    f.frame = frame;
    f.gimbal = gimbal;
    f.up = up;
    f.convex = convex;
    f.angle_code = angle;
    f.angle_byte = angle == 0 ? 15 : angle == 1 ? 20 : 30;
    f.clock = {26, 11, 30, 12, k, integer(0, 59), integer(0, 99)};
    f.heading = integer(0, 35999);
    f.pitch = integer(-2000, 2000);
    f.roll = integer(-2000, 2000);
    f.salinity = integer(0, 40);
    f.temperature = integer(-500, 4000);
    f.speed_of_sound = integer(1400, 1600);
    f.depth = integer(1, 9999);
    for (auto& r : f.range) r = static_cast<std::uint32_t>(k % 7 == 0 ? 0 : integer(1, 300000));
    for (auto& b : f.bottom) b = integer(-3000, 3000);
    if (k % 10 == 3) f.bottom[3] = bad;
    if (k % 10 == 7) f.bottom = {bad, bad, bad, bad};
    if (k % 4 == 1) f.with_profile = false;
    f.fill = static_cast<std::uint8_t>(k % 3 == 0 ? 0x7f : 0);
    out.push_back(f);
  }
  return out;
}

std::vector<Ensemble> by_dolfyn(const std::vector<Pd0>& all, const std::string& frame,
                                std::string& told) {
  const std::string path = ::testing::TempDir() + "icat_dvl." + std::to_string(::getpid());
  {
    std::ofstream file(path, std::ios::binary);
    const auto write = [&](const Pd0& f) {
      const frames::Bytes b = f.bytes();
      file.write(reinterpret_cast<const char*>(b.data()), static_cast<std::streamsize>(b.size()));
    };
    for (const Pd0& f : all) write(f);
    write(all.back());  // dolfyn wants a header behind each ensemble
  }
  std::vector<std::string> command{ICAT_PYTHON, ICAT_PEERS "/dvl_peer.py", "read", path};
  if (!frame.empty()) command.push_back(frame);
  hardware::Process process(command);
  EXPECT_TRUE(process.wait_for("\ndone", 120)) << process.output();
  std::remove(path.c_str());
  std::istringstream lines(process.output());
  std::vector<Ensemble> out;
  std::string line;
  while (std::getline(lines, line) && line.rfind("begin", 0) != 0) {
  }
  told = line;
  while (std::getline(lines, line) && line != "done") {
    for (std::size_t at; (at = line.find("nan")) != std::string::npos;) line.replace(at, 3, "1e9");
    std::istringstream numbers(line);
    Ensemble e{};
    numbers >> e.number >> e.time >> e.heading >> e.pitch >> e.roll >> e.sound >> e.depth >>
        e.salinity >> e.temperature;
    for (double& x : e.range) numbers >> x;
    for (double& x : e.velocity) numbers >> x;
    EXPECT_TRUE(numbers) << line;
    out.push_back(e);
  }
  return out;
}

// dolfyn's velocities are of the bottom, on X, Y, Z of the instrument or on east, north, up.
TEST(DvlPeers, DolfynReadsTheSame) {
  std::mt19937 random(11);
  int compared = 0, turned = 0;
  for (int frame = 0; frame < 4; ++frame) {
    for (int variant = 0; variant < 2; ++variant) {
      const bool up = variant == 1, convex = variant == 0 || frame != 0;
      // Of the instrument's own pitch dolfyn always makes that of gimbals.
      const auto all = random_frames(random, frame, true, up, convex, 1 + variant);
      const std::string turn = frame == 0 ? "inst" : frame == 1 ? "earth" : "";
      std::string told;
      const auto theirs = by_dolfyn(all, turn, told);
      EXPECT_NE(told.find(convex ? "convex" : "concave"), std::string::npos) << told;
      EXPECT_NE(told.find(up ? "up" : "down"), std::string::npos) << told;
      ASSERT_GE(theirs.size(), all.size() - 1);
      icat::Pd0Decoder dvl({.beam_3 = 0});
      for (std::size_t i = 0; i < std::min(all.size(), theirs.size()); ++i) {
        const Ensemble& e = theirs[i];
        ASSERT_EQ(dvl.put(all[i].bytes(), static_cast<double>(i)), 1);
        const icat::DvlSample& s = dvl.sample().value;
        ASSERT_EQ(s.ensemble, e.number);
        ASSERT_NEAR(s.instrument_time, e.time, 1e-3);
        // dolfyn keeps float32.
        ASSERT_NEAR(s.heading / degree, e.heading, 5e-5);
        ASSERT_NEAR(s.pitch / degree, e.pitch, 5e-6);
        ASSERT_NEAR(s.roll / degree, e.roll, 5e-6);
        ASSERT_NEAR(s.speed_of_sound, e.sound, 1e-3);
        ASSERT_NEAR(s.depth, e.depth, 1e-4);
        ASSERT_NEAR(s.salinity, e.salinity, 1e-4);
        ASSERT_NEAR(s.temperature, e.temperature, 1e-4);
        for (std::size_t k = 0; k < 4; ++k) ASSERT_NEAR(s.range[k], e.range[k], 5e-4);
        ++compared;
        if (all[i].bottom[3] == bad || !s.bottom.valid) continue;  // dolfyn makes none of three
        // Ours, back to the bottom's, starboard, forward, up.
        const auto& v = s.bottom.velocity;
        Eigen::Vector3d ours(-v[1], -v[0], v[2]);
        if (frame == 0 && up) ours = Eigen::Vector3d(-ours(0), ours(1), -ours(2));
        if (frame == 1) {
          const double pitch = std::atan(std::tan(s.pitch) * std::cos(s.roll));
          const Eigen::Matrix3d R = (Eigen::AngleAxisd(s.heading, Eigen::Vector3d::UnitZ()) *
                                     Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                                     Eigen::AngleAxisd(s.roll, Eigen::Vector3d::UnitX()))
                                        .toRotationMatrix();
          const Eigen::Vector3d ned = R * Eigen::Vector3d(v[0], v[1], v[2]);
          ours = Eigen::Vector3d(-ned(1), -ned(0), ned(2));
        }
        for (int k = 0; k < 3; ++k) {
          ASSERT_NEAR(ours(k), e.velocity[static_cast<std::size_t>(k)], 2e-5)
              << frame << " " << variant << " " << i << " " << k;
        }
        ASSERT_NEAR(s.bottom.error, e.velocity[3], 2e-5);
        ++turned;
      }
    }
  }
  std::printf("dolfyn: %d ensembles compared, %d velocities within 2e-5 m/s\n", compared, turned);
  EXPECT_GT(turned, 200);
}

// A robot with a DVL, as far as the DVL is concerned: it may move while the bottom is seen.
template <class Decoder>
void loop(const char* form, double stream_rate) {
  hardware::Process sender(
      {ICAT_PYTHON, ICAT_PEERS "/dvl_peer.py", "stream", form, std::to_string(stream_rate)});
  hardware::Descriptor port;
  hardware::connect_to(sender, port);
  Decoder dvl;
  std::array<std::uint8_t, 4096> block;
  const double limit = 0.5, rate = 200, seconds = hardware::loop_seconds();
  const std::size_t most = static_cast<std::size_t>(rate * seconds) + 10;
  hardware::Latencies latencies(most);
  double command = 0;
  const auto cycle = [&](double now) {
    const auto before = dvl.sample().count;
    for (ssize_t n; (n = ::recv(port.get(), block.data(), block.size(), MSG_DONTWAIT)) > 0;) {
      dvl.put({block.data(), static_cast<std::size_t>(n)}, now);
    }
    // The range of beam 1 is the sender's clock, which is ours: 0.1 ms to the centimetre in PD0, to
    // the millimetre in PD6.
    if (dvl.sample().count != before) {
      const double unit = std::is_same_v<Decoder, icat::Pd0Decoder> ? 100 : 1000;
      const double sent = dvl.sample().value.range[0] * unit * 1e-4;
      latencies.add(std::remainder(now - sent, 16777216e-4));
    }
    command = dvl.bottom_age(now) <= limit ? 0.2 : 0.0;
  };
  hardware::run_loop(rate, 0.5, cycle);
  latencies = hardware::Latencies(most);
  const auto first = dvl.sample().count;
  const long made = hardware::run_loop(rate, seconds, cycle);
  char what[80];
  std::snprintf(what, sizeof what, "%s at %.0f ensembles/s", form, stream_rate);
  latencies.print(what, rate, seconds, made);
  EXPECT_EQ(made, 0);
  EXPECT_EQ(dvl.damaged(), 0u);
  EXPECT_GT(dvl.sample().count - first, 0.8 * stream_rate * seconds);
  EXPECT_LT(latencies.quantile(0.5), 0.02);
  EXPECT_EQ(command, 0.2);
  // The sender's bottom goes 0.1, −0.2, 0.01 past X, Y, Z, with beam 3 at 45 degrees.
  const auto& v = dvl.sample().value.bottom.velocity;
  EXPECT_NEAR(v[0], (0.2 + 0.1) * std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(v[1], (0.2 - 0.1) * std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(v[2], 0.01, 1e-12);

  sender.kill();
  double stopped = 0;
  hardware::run_loop(rate, 1, [&](double now) {
    cycle(now);
    if (command == 0 && stopped == 0) stopped = now;
  });
  EXPECT_EQ(command, 0);
  // In the first cycle after `limit`; 0.2 s are for a machine that is busy.
  EXPECT_GT(stopped - dvl.sample().time, limit);
  EXPECT_LT(stopped - dvl.sample().time, limit + 0.2);
  EXPECT_NEAR(v[2], 0.01, 1e-12);  // the last value stays

  // The numbers begin anew; more than a second has passed, and the clock went on.
  sender.start();
  hardware::connect_to(sender, port);
  hardware::run_loop(rate, 0.7, cycle);
  EXPECT_EQ(command, 0.2);
  EXPECT_LT(dvl.sample().value.ensemble, 100u);
}

TEST(DvlPeers, LoopPd0) { loop<icat::Pd0Decoder>("pd0", 100); }
TEST(DvlPeers, LoopPd6) { loop<icat::Pd6Decoder>("pd6", 50); }

}  // namespace
