// SPDX-License-Identifier: BSD-3-Clause
// gpsd as another consumer of the same bytes: what NmeaSentence writes, gpsd and NmeaDecoder read,
// and they agree.
#include <gtest/gtest.h>
#include <poll.h>

#include <cmath>
#include <cstdio>
#include <ctime>
#include <map>
#include <string>

#include "icat/adapters/nmea.hpp"
#include "icat/adapters/nmea_sentence.hpp"
#include "tests/hardware/support/process.hpp"
#include "tests/hardware/support/tcp.hpp"

namespace {

using icat::NmeaSentence;

constexpr double degree = std::numbers::pi / 180;

// "name":value in one report of gpsd's JSON; NaN where there is none.
double field(const std::string& report, const std::string& name) {
  const std::size_t at = report.find("\"" + name + "\":");
  return at == std::string::npos ? std::nan("") : std::atof(report.c_str() + at + name.size() + 3);
}

TEST(Gpsd, ReadsTheSame) {
  std::uint16_t source_port = 0;
  hardware::Descriptor listener(hardware::listen_at(source_port)), source, reports;
  ASSERT_GE(listener.get(), 0);
  const std::uint16_t gpsd_port = hardware::free_port();
  hardware::Process gpsd({"gpsd", "-N", "-n", "-S", std::to_string(gpsd_port),
                          "tcp://127.0.0.1:" + std::to_string(source_port)});
  pollfd waiting{listener.get(), POLLIN, 0};
  ASSERT_EQ(::poll(&waiting, 1, 20000), 1) << "gpsd does not connect";
  source.reset(::accept(listener.get(), nullptr, nullptr));
  ASSERT_GE(source.get(), 0);
  reports.reset(hardware::connect_within(gpsd_port, 20));
  ASSERT_GE(reports.get(), 0);
  const std::string watch = "?WATCH={\"enable\":true,\"json\":true};\n";
  ASSERT_GT(::send(reports.get(), watch.data(), watch.size(), MSG_NOSIGNAL), 0);

  // gpsd minds the date of its own computer.
  const double start = std::floor(static_cast<double>(std::time(nullptr)));
  icat::NmeaDecoder nmea;
  struct Sent {
    icat::NmeaPosition position;
    icat::NmeaVelocity velocity;
  };
  std::map<long, Sent> sent;  // by the last digits of the time, in s
  std::string text;
  int compared = 0;
  double worst_place = 0, worst_speed = 0, worst_track = 0;
  for (int k = 0; k < 40 && compared < 20; ++k) {
    icat::NmeaPosition p;
    p.latitude = (44.0 + 0.0001 * k) * degree;
    p.longitude = (-9.8 - 0.0002 * k) * degree;
    p.utc = std::fmod(start + k, 86400);
    p.quality = icat::NmeaQuality::autonomous;
    p.satellites = 9;
    p.hdop = 0.9;
    p.has_altitude = true;
    p.altitude = 12.5;
    const icat::NmeaVelocity v{2 + 0.1 * k, true, 1 + 0.02 * k};
    for (const NmeaSentence& line : {NmeaSentence::gga(p), NmeaSentence::rmc(p, v, start + k)}) {
      ASSERT_FALSE(line.view().empty());
      nmea.put(line.bytes(), k);
      ASSERT_GT(::send(source.get(), line.view().data(), line.view().size(), MSG_NOSIGNAL), 0);
    }
    sent[std::lround(start + k)] = {nmea.position().value, nmea.velocity().value};
    pollfd ready{reports.get(), POLLIN, 0};
    while (::poll(&ready, 1, 150) > 0) {
      char block[4096];
      const ssize_t n = ::recv(reports.get(), block, sizeof block, 0);
      ASSERT_GT(n, 0);
      text.append(block, static_cast<std::size_t>(n));
    }
    for (std::size_t end; (end = text.find('\n')) != std::string::npos; text.erase(0, end + 1)) {
      const std::string report = text.substr(0, end);
      if (report.find("\"class\":\"TPV\"") == std::string::npos || !(field(report, "mode") >= 2)) {
        continue;
      }
      const std::size_t at = report.find("\"time\":\"");
      std::tm date{};
      if (at == std::string::npos ||
          !::strptime(report.c_str() + at + 8, "%Y-%m-%dT%H:%M:%S", &date)) {
        continue;
      }
      const auto found = sent.find(static_cast<long>(::timegm(&date)));
      ASSERT_NE(found, sent.end()) << report;
      const Sent& s = found->second;
      if (!std::isfinite(field(report, "speed")) || !std::isfinite(field(report, "track")))
        continue;
      worst_place =
          std::max({worst_place, std::abs(field(report, "lat") - s.position.latitude / degree),
                    std::abs(field(report, "lon") - s.position.longitude / degree)});
      worst_speed = std::max(worst_speed, std::abs(field(report, "speed") - s.velocity.speed));
      worst_track =
          std::max(worst_track, std::abs(field(report, "track") - s.velocity.course / degree));
      EXPECT_NEAR(field(report, "altMSL"), s.position.altitude, 1e-3);
      ++compared;
    }
  }
  std::printf("gpsd: %d reports compared: place within %.1e deg, speed %.1e m/s, track %.1e deg\n",
              compared, worst_place, worst_speed, worst_track);
  EXPECT_GE(compared, 20);
  EXPECT_LT(worst_place, 1e-9);  // gpsd prints nine digits: 0.1 mm
  EXPECT_LT(worst_speed, 1e-3);  // three
  EXPECT_LT(worst_track, 1e-3);  // four
}

}  // namespace
