// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Sentences of NMEA 0183 for an instrument that needs position, heading or depth (a Doppler log,
/// an acoustic positioning system), and for tests. The formats are those of nmea.hpp; numbers have
/// a point whatever the locale.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <string_view>

#include "icat/adapters/nmea_sample.hpp"

namespace icat {

/// One sentence with its checksum and end of line; empty where it could not be written: a number
/// that is not finite or does not fit. No allocation, no exception.
class NmeaSentence {
 public:
  /// $<body>*hh. `body` is "GPGGA,…" without $ and checksum, at most 100 characters.
  explicit NmeaSentence(std::string_view body) noexcept {
    text(body);
    finish();
  }
  /// Position, with all that GGA has. Time: `position.utc`; empty where it is < 0.
  static NmeaSentence gga(const NmeaPosition& position, std::string_view talker = "GP") noexcept {
    NmeaSentence s(talker, "GGA,");
    s.time_of_day(position.utc);
    s.place(position);
    s.number(static_cast<double>(static_cast<int>(position.quality)), 0, 1);
    s.character(',');
    s.number(position.satellites, 0, 2);
    s.character(',');
    s.number(position.hdop, 2, 1);
    s.character(',');
    if (position.has_altitude) s.number(position.altitude, 3, 1);
    s.text(",M,");
    if (position.has_altitude) s.number(position.geoid, 3, 1);
    s.text(",M,,");
    s.finish();
    return s;
  }
  /// Position and velocity. `utc`: s since 1970, of the years 1980 … 2079, of which two digits are
  /// sent; the position's own time does not count.
  static NmeaSentence rmc(const NmeaPosition& position, const NmeaVelocity& velocity, double utc,
                          std::string_view talker = "GP") noexcept {
    NmeaSentence s(talker, "RMC,");
    if (!(utc >= 315532800 && utc < 3471292800 - 0.005)) return empty();
    // Rounded first, so that no second is the 60th.
    const long long centi = std::llround(utc * 100), day = centi / 8640000;
    s.time_of_day(static_cast<double>(centi % 8640000) / 100);
    s.text("A,");
    s.place(position);
    s.number(velocity.speed / detail::nmea::knot, 4, 1);
    s.character(',');
    if (velocity.has_course) s.heading_number(velocity.course);
    s.character(',');
    // The date of a count of days: the year is found by steps, at most 130 of them.
    int year = 1970, month = 1;
    while (detail::text::days_from_civil(year + 1, 1, 1) <= day) ++year;
    while (month < 12 && detail::text::days_from_civil(year, month + 1, 1) <= day) ++month;
    s.number(static_cast<double>(day - detail::text::days_from_civil(year, month, 1) + 1), 0, 2);
    s.number(month, 0, 2);
    s.number(year % 100, 0, 2);
    s.text(",,,A");
    s.finish();
    return s;
  }
  /// True heading, rad.
  static NmeaSentence hdt(double heading, std::string_view talker = "HE") noexcept {
    NmeaSentence s(talker, "HDT,");
    s.heading_number(heading);
    s.text(",T");
    s.finish();
    return s;
  }
  /// Depth below the transducer, with its offset.
  static NmeaSentence dpt(const NmeaDepth& depth, std::string_view talker = "SD") noexcept {
    NmeaSentence s(talker, "DPT,");
    s.number(depth.depth, 3, 1);
    s.character(',');
    s.number(depth.offset, 3, 1);
    s.finish();
    return s;
  }

  /// From $ to the line feed.
  std::string_view view() const noexcept { return {buffer_.data(), size_}; }
  /// The same as bytes.
  std::span<const std::uint8_t> bytes() const noexcept {
    return {reinterpret_cast<const std::uint8_t*>(buffer_.data()), size_};
  }

 private:
  struct Empty {};
  explicit NmeaSentence(Empty) noexcept : size_(0) {}
  NmeaSentence(std::string_view talker, std::string_view type) noexcept {
    text(talker);
    text(type);
  }
  static NmeaSentence empty() noexcept { return NmeaSentence(Empty{}); }

  void character(char c) noexcept {
    if (size_ < buffer_.size() - 5) {  // room for the checksum and the end of line
      buffer_[size_++] = c;
    } else {
      good_ = false;
    }
  }
  void text(std::string_view s) noexcept {
    for (const char c : s) {
      if (c < 0x20 || c > 0x7e || c == '$' || c == '*') good_ = false;
      character(c);
    }
  }
  // With `decimals` after the point and at least `width` digits before it.
  void number(double value, int decimals, int width) noexcept {
    double scaled = value;
    for (int i = 0; i < decimals; ++i) scaled *= 10;
    if (!(std::abs(scaled) < 1e15)) {
      good_ = false;
      return;
    }
    const long long whole = std::llround(scaled);
    if (whole < 0) character('-');
    digits(static_cast<unsigned long long>(whole < 0 ? -whole : whole), decimals, width);
  }
  void digits(unsigned long long value, int decimals, int width) noexcept {
    std::array<char, 24> out{};
    int n = 0;
    while (value > 0 || n < decimals + width) {
      out[static_cast<std::size_t>(n++)] = static_cast<char>('0' + value % 10);
      value /= 10;
    }
    while (n > 0) {
      if (n == decimals) character('.');
      character(out[static_cast<std::size_t>(--n)]);
    }
  }
  void time_of_day(double utc) noexcept {
    if (utc >= 0) {
      const long long centi = utc < 86401 ? std::llround(utc * 100) : 8640000;
      if (centi >= 8640000) {
        good_ = false;
        return;
      }
      number(static_cast<double>(centi / 360000), 0, 2);
      number(static_cast<double>(centi / 6000 % 60), 0, 2);
      digits(static_cast<unsigned long long>(centi % 6000), 2, 2);
    }
    character(',');
  }
  // Rounded to 1e-7 minutes (0.2 mm) before degrees and minutes are parted.
  void angle(double radians, int width, double most, char positive, char negative) noexcept {
    if (!(std::abs(radians) <= most)) {
      good_ = false;
      return;
    }
    constexpr long long degree = 600000000;
    const long long units =
        std::llround(std::abs(radians) / detail::nmea::degree * static_cast<double>(degree));
    digits(static_cast<unsigned long long>(units / degree), 0, width);
    digits(static_cast<unsigned long long>(units % degree), 7, 2);
    character(',');
    character(radians < 0 ? negative : positive);
    character(',');
  }
  void place(const NmeaPosition& p) noexcept {
    angle(p.latitude, 2, std::numbers::pi / 2, 'N', 'S');
    angle(p.longitude, 3, std::numbers::pi, 'E', 'W');
  }
  void heading_number(double radians) noexcept {
    double degrees = detail::nmea::wrap(radians) / detail::nmea::degree;
    if (degrees >= 359.99995) degrees = 0;
    number(degrees, 4, 1);
  }
  void finish() noexcept {
    if (!good_) {
      size_ = 0;
      return;
    }
    unsigned sum = 0;
    for (std::size_t i = 1; i < size_; ++i) sum ^= static_cast<unsigned char>(buffer_[i]);
    constexpr std::string_view hex = "0123456789ABCDEF";
    for (const char c : {'*', hex[sum >> 4], hex[sum & 15], '\r', '\n'}) buffer_[size_++] = c;
  }

  std::array<char, 128> buffer_{'$'};
  std::size_t size_{1};
  bool good_{true};
};

}  // namespace icat
