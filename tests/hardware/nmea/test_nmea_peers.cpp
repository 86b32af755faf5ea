// SPDX-License-Identifier: BSD-3-Clause
// nmea.hpp and local_ned.hpp against pynmea2 and pymap3d: values both ways, and a loop on a stream
// that is killed and started again.
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <random>
#include <sstream>
#include <string>

#include "icat/adapters/local_ned.hpp"
#include "icat/adapters/nmea.hpp"
#include "icat/adapters/nmea_sentence.hpp"
#include "tests/hardware/support/loop.hpp"
#include "tests/hardware/support/process.hpp"
#include "tests/hardware/support/sender.hpp"
#include "tests/hardware/support/tcp.hpp"

namespace {

using icat::NmeaDecoder;
using icat::NmeaSentence;

constexpr double degree = std::numbers::pi / 180;
constexpr double knot = 1852.0 / 3600;

std::span<const std::uint8_t> bytes(const std::string& s) {
  return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()};
}
std::vector<std::string> peer(std::vector<std::string> arguments) {
  std::vector<std::string> command{ICAT_PYTHON, ICAT_PEERS "/pynmea2_peer.py"};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return command;
}
std::string output_of(const std::vector<std::string>& command) {
  hardware::Process process(command);
  EXPECT_TRUE(process.wait_for("\ndone", 60)) << process.output();
  return process.output();
}

// What `nmea` has of the last sentence of `kind`, in pynmea2's units.
std::vector<double> values(const NmeaDecoder& nmea, const std::string& kind) {
  const auto& p = nmea.position().value;
  const double lat = p.latitude / degree, lon = p.longitude / degree;
  const auto& v = nmea.velocity().value;
  const double utc = nmea.utc().value;
  if (kind == "GGA") {
    return {lat, lon, p.utc, double(p.quality), double(p.satellites), p.hdop, p.altitude, p.geoid};
  }
  if (kind == "RMC") {
    return {lat, lon, p.utc, v.speed / knot, v.course / degree, 86400 * std::floor(utc / 86400)};
  }
  if (kind == "GLL") return {lat, lon, p.utc};
  if (kind == "VTG") return {v.course / degree, v.speed / knot};
  if (kind == "HDT") return {nmea.true_heading().value / degree};
  if (kind == "HDM") return {nmea.magnetic_heading().value / degree};
  if (kind == "DPT") return {nmea.depth().value.depth, nmea.depth().value.offset};
  return {nmea.depth().value.depth};
}

TEST(NmeaPeers, DecodesWhatPynmea2Writes) {
  std::istringstream lines(output_of(peer({"generate", "300"})));
  std::map<std::string, int> seen;
  for (std::string line; std::getline(lines, line) && line != "done";) {
    const std::size_t tab = line.find('\t');
    ASSERT_NE(tab, std::string::npos) << line;
    std::istringstream expected(line.substr(tab + 1));
    std::string kind;
    expected >> kind;
    NmeaDecoder nmea;
    ASSERT_EQ(nmea.put(bytes(line.substr(0, tab) + "\r\n"), 0), 1)
        << line << icat::describe(nmea.status());
    std::vector<double> want;
    for (double x; expected >> x;) want.push_back(x);
    ++seen[kind];
    if (kind == "ZDA") {
      const long days =
          icat::detail::text::days_from_civil(int(want[2]), int(want[1]), int(want[0]));
      ASSERT_NEAR(nmea.utc().value, 86400.0 * double(days) + want[3], 1e-6);
      continue;
    }
    if (kind == "HDG") {
      const double magnetic = want[0] + want[1], north = magnetic + want[2];
      ASSERT_NEAR(std::remainder(nmea.magnetic_heading().value / degree - magnetic, 360), 0, 1e-9);
      ASSERT_NEAR(std::remainder(nmea.true_heading().value / degree - north, 360), 0, 1e-9);
      continue;
    }
    const auto got = values(nmea, kind);
    ASSERT_EQ(got.size(), want.size()) << line;
    // 1e-12 degrees are 1e-7 m; both read the same digits.
    for (std::size_t i = 0; i < got.size(); ++i) {
      ASSERT_NEAR(got[i], want[i], 1e-12 * std::max(1.0, std::abs(want[i]))) << line << " " << i;
    }
  }
  EXPECT_EQ(seen.size(), 11u);
  for (const auto& [kind, count] : seen) EXPECT_EQ(count, 300) << kind;
}

TEST(NmeaPeers, Pynmea2ReadsWhatIsEncoded) {
  std::mt19937 random(5);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  const std::string path = ::testing::TempDir() + "icat_nmea." + std::to_string(::getpid());
  std::vector<std::vector<double>> want;
  {
    std::ofstream file(path, std::ios::binary);
    for (int k = 0; k < 500; ++k) {
      icat::NmeaPosition p;
      p.latitude = uniform(-90, 90) * degree;
      p.longitude = uniform(-180, 180) * degree;
      p.utc = std::floor(uniform(0, 8639999)) / 100;
      p.quality = icat::NmeaQuality::differential;
      p.satellites = k % 20;
      p.has_altitude = true;
      p.altitude = uniform(-50, 5000);
      p.geoid = uniform(-100, 100);
      p.hdop = 0.5 + k % 7;
      const icat::NmeaVelocity v{uniform(0, 20), true, uniform(0, 6.283)};
      const double day = 86400.0 * std::floor(uniform(3652, 24000)), heading = uniform(0, 6.283);
      file << NmeaSentence::gga(p).view() << NmeaSentence::rmc(p, v, day + p.utc).view()
           << NmeaSentence::hdt(heading).view()
           << NmeaSentence::dpt({uniform(0, 100), {}, uniform(-2, 2)}).view();
      want.push_back({p.latitude / degree, p.longitude / degree, p.utc, 2, double(p.satellites),
                      p.hdop, p.altitude, p.geoid});
      want.push_back({p.latitude / degree, p.longitude / degree, p.utc, v.speed / knot,
                      v.course / degree, day});
      want.push_back({heading / degree});
      want.push_back({});
    }
  }
  std::istringstream lines(output_of(peer({"parse", path})));
  std::remove(path.c_str());
  std::size_t at = 0;
  for (std::string line; std::getline(lines, line) && line != "done"; ++at) {
    std::istringstream values(line);
    std::string kind;
    values >> kind;
    ASSERT_LT(at, want.size());
    for (std::size_t i = 0; i < want[at].size(); ++i) {
      double got = 0;
      ASSERT_TRUE(values >> got) << line;
      // Half of the last digit that is sent: minutes 1e-7, altitude 1e-3, knots and degrees 1e-4.
      const double step = kind == "GGA"            ? (i < 3 ? 1e-9 : 5.1e-4)
                          : i < 3 && kind == "RMC" ? 1e-9
                                                   : 5.1e-5;
      ASSERT_NEAR(got, want[at][i], step) << line << " " << i;
    }
  }
  EXPECT_EQ(at, want.size());
}

TEST(NmeaPeers, LocalFrameIsThatOfPymap3d) {
  std::istringstream lines(output_of(peer({"ned"})));
  int count = 0;
  double largest = 0;
  for (std::string line; std::getline(lines, line) && line != "done"; ++count) {
    std::istringstream numbers(line);
    double x[9];
    for (double& v : x) ASSERT_TRUE(numbers >> v);
    const icat::LocalNed origin({x[0] * degree, x[1] * degree, x[2]});
    const auto got = origin.ned({x[3] * degree, x[4] * degree, x[5]});
    for (std::size_t i = 0; i < 3; ++i) largest = std::max(largest, std::abs(got[i] - x[6 + i]));
  }
  EXPECT_EQ(count, 2000);
  EXPECT_LT(largest, 1e-7);  // differences of 6e6 m in double: 1e-9 each
}

// Reads without waiting, decodes, and says what a back-end would: whether the robot may move.
TEST(NmeaPeers, LoopAgainstAStream) {
  hardware::Process sender(peer({"stream", "200"}));
  hardware::Descriptor port;
  hardware::connect_to(sender, port);
  NmeaDecoder nmea;
  std::array<std::uint8_t, 4096> block;
  const double limit = 0.5, rate = 200, seconds = hardware::loop_seconds();
  hardware::Latencies latencies(static_cast<std::size_t>(rate * seconds) + 10);
  double command = 0;
  const auto cycle = [&](double now) {
    const auto before = nmea.depth().count;
    for (ssize_t n; (n = ::recv(port.get(), block.data(), block.size(), MSG_DONTWAIT)) > 0;) {
      nmea.put({block.data(), static_cast<std::size_t>(n)}, now);
    }
    // The peer sends its clock, which is ours, as a depth: from sending to what we know of it.
    if (nmea.depth().count != before) {
      latencies.add(std::remainder(now - nmea.depth().value.depth, 10000.0));
    }
    command = nmea.depth().fresh(now, limit) ? 0.2 : 0.0;
  };
  hardware::run_loop(rate, 0.5, cycle);  // until it is warm
  latencies = hardware::Latencies(static_cast<std::size_t>(rate * seconds) + 10);
  const auto first = nmea.depth().count;
  const long made = hardware::run_loop(rate, seconds, cycle);
  latencies.print("NMEA 0183 from pynmea2", rate, seconds, made);
  EXPECT_EQ(made, 0);
  EXPECT_EQ(nmea.damaged(), 0u);
  EXPECT_GT(nmea.depth().count - first, 0.8 * rate * seconds);
  EXPECT_LT(latencies.quantile(0.5), 0.02);  // two periods of both sides
  EXPECT_EQ(command, 0.2);

  // The sender dies: the last value stays, its age grows, and the loop stops the robot at `limit`.
  sender.kill();
  const double depth = nmea.depth().value.depth;
  double stopped = 0;
  hardware::run_loop(rate, 1, [&](double now) {
    cycle(now);
    if (command == 0 && stopped == 0) stopped = now;
  });
  EXPECT_EQ(command, 0);
  // In the first cycle after `limit`; 0.2 s are for a machine that is busy.
  EXPECT_GT(stopped - nmea.depth().time, limit);
  EXPECT_LT(stopped - nmea.depth().time, limit + 0.2);
  EXPECT_GT(nmea.depth().age(hardware::now()), limit);
  EXPECT_LT(std::abs(nmea.depth().value.depth - depth), 1);

  sender.start();
  hardware::connect_to(sender, port);
  hardware::run_loop(rate, 0.5, cycle);
  EXPECT_EQ(command, 0.2);
  EXPECT_EQ(nmea.damaged(), 0u);
}

}  // namespace
