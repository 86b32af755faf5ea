// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The values of NMEA 0183 sentences, and the decoding of their fields. nmea.hpp decodes,
/// nmea_sentence.hpp encodes.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string_view>

#include "icat/adapters/text_fields.hpp"
#include "icat/core/status.hpp"

namespace icat {

/// Depth of the water, as an echo sounder has it. A vehicle's own depth it is only where the
/// sensor measures pressure and speaks DBS or DPT all the same; the depth above the bottom else.
struct NmeaDepth {
  /// What the depth is below.
  enum class Datum { transducer, surface, keel };
  double depth{0};                 ///< m
  Datum datum{Datum::transducer};  ///< DBS says surface, DBK keel, DBT and DPT the transducer
  /// Of DPT, m: the transducer is so far below the surface (> 0), or above the keel (< 0). Added to
  /// `depth` it is the depth below surface or keel; 0 where nothing is known.
  double offset{0};
};

/// How a position came about: field 6 of GGA, and the mode of GLL and RMC.
enum class NmeaQuality {
  none = 0,
  autonomous = 1,
  differential = 2,
  precise = 3,
  rtk = 4,
  rtk_float = 5,
  estimated = 6,
  manual = 7,
  simulator = 8
};

/// A fix of GPS.
struct NmeaPosition {
  double latitude{0};   ///< rad, north positive
  double longitude{0};  ///< rad, east positive
  double utc{-1};       ///< s since midnight; −1 where the sentence has no time
  NmeaQuality quality{NmeaQuality::none};  ///< of the first sentence with this time
  bool has_altitude{false};                ///< GGA alone has one
  double altitude{0};                      ///< above the geoid, m
  double geoid{0};    ///< the geoid above the ellipsoid, m; 0 where it is not said
  double hdop{0};     ///< horizontal dilution of precision; 0 where it is not said
  int satellites{0};  ///< in use; 0 where it is not said
};

/// Velocity over ground.
struct NmeaVelocity {
  double speed{0};         ///< m/s, >= 0
  bool has_course{false};  ///< at rest there may be none
  double course{0};        ///< rad from true north, clockwise, [0, 2π)
};

namespace detail::nmea {

constexpr double degree = std::numbers::pi / 180;
constexpr double knot = 1852.0 / 3600;

inline int hex(char c) noexcept {
  if (text::is_digit(c)) return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

inline bool in_range(std::string_view s, double least, double most, double& value) noexcept {
  return text::parse_signed(s, value) && value >= least && value <= most;
}
// hhmmss.sss, s since midnight; a leap second is the 60th.
inline bool time_of_day(std::string_view s, double& value) noexcept {
  const int h = text::parse_digits(s, 0, 2), m = text::parse_digits(s, 2, 2);
  double seconds = 0;
  if (h < 0 || h > 23 || m < 0 || m > 59 || !(s.size() == 6 || (s.size() > 7 && s[6] == '.')) ||
      !text::parse_unsigned(s.substr(4), seconds) || seconds >= 61) {
    return false;
  }
  value = h * 3600 + m * 60 + seconds;
  return true;
}
// ddmm.mmm or dddmm.mmm with its hemisphere, rad.
inline bool angle(std::string_view s, std::string_view side, bool latitude,
                  double& value) noexcept {
  const std::size_t wide = latitude ? 2 : 3;
  const int whole = text::parse_digits(s, 0, wide);
  double minutes = 0;
  if (whole < 0 || s.size() < wide + 2 || (s.size() > wide + 2 && s[wide + 2] != '.') ||
      !text::is_digit(s[wide]) || !text::is_digit(s[wide + 1]) ||
      !text::parse_unsigned(s.substr(wide), minutes) || minutes >= 60) {
    return false;
  }
  const double degrees = whole + minutes / 60;
  if (degrees > (latitude ? 90 : 180)) return false;
  const bool positive = side == (latitude ? "N" : "E");
  if (!positive && side != (latitude ? "S" : "W")) return false;
  value = (positive ? degrees : -degrees) * degree;
  return true;
}
inline double wrap(double radians) noexcept {
  constexpr double turn = 2 * std::numbers::pi;
  radians = std::fmod(radians, turn);
  if (radians < 0) radians += turn;
  return radians >= turn ? 0 : radians;  // NaN stays
}

inline Status from_mode(std::string_view mode, NmeaQuality& quality) noexcept {
  if (mode.size() != 1) return Status::implausible;
  constexpr std::string_view letters = "NADPRFEMS";
  const std::size_t at = letters.find(mode[0]);
  if (at == std::string_view::npos) return Status::implausible;
  quality = static_cast<NmeaQuality>(at);
  return Status::ok;
}
// Of latitude, its side, longitude, its side.
inline Status place(const text::Fields& f, std::size_t at, NmeaPosition& p) noexcept {
  if (f[at].empty() && f[at + 2].empty()) return Status::not_measured;
  const bool good =
      angle(f[at], f[at + 1], true, p.latitude) && angle(f[at + 2], f[at + 3], false, p.longitude);
  return good ? Status::ok : Status::implausible;
}
inline bool course(std::string_view s, NmeaVelocity& v) noexcept {
  if (s.empty()) return true;
  if (!in_range(s, 0, 360, v.course)) return false;
  v.course = wrap(v.course * degree);
  v.has_course = true;
  return true;
}
inline bool signed_angle(std::string_view s, std::string_view side, double& value) noexcept {
  if (!in_range(s, 0, 180, value) || (side != "E" && side != "W")) return false;
  value *= side == "E" ? degree : -degree;
  return true;
}

// Of ZDA, s since 1970.
inline Status parse_zda(const text::Fields& f, double& utc) noexcept {
  double time = 0;
  if (f.count != 6) return Status::implausible;
  if (f[0].empty() || f[1].empty() || f[2].empty() || f[3].empty()) return Status::not_measured;
  if (f[1].size() > 2 || f[2].size() > 2 || f[3].size() != 4) return Status::implausible;
  const int day = text::parse_digits(f[1], 0, f[1].size());
  const int month = text::parse_digits(f[2], 0, f[2].size());
  const int year = text::parse_digits(f[3], 0, 4);
  if (!time_of_day(f[0], time) || !text::is_date(year, month, day)) return Status::implausible;
  utc = 86400.0 * static_cast<double>(text::days_from_civil(year, month, day)) + time;
  return Status::ok;
}

inline Status parse_dpt(const text::Fields& f, NmeaDepth& d) noexcept {
  if (f.count != 2 && f.count != 3) return Status::implausible;
  if (f[0].empty()) return Status::not_measured;
  if (!in_range(f[0], 0, 12000, d.depth)) return Status::implausible;
  if (!f[1].empty() && !in_range(f[1], -1000, 1000, d.offset)) return Status::implausible;
  return Status::ok;
}

// Feet, metres, fathoms: the first of metres, feet, fathoms that is there.
inline Status parse_below(const text::Fields& f, char what, NmeaDepth& d) noexcept {
  if (f.count != 6 || f[1] != "f" || f[3] != "M" || f[5] != "F") return Status::implausible;
  d.datum = what == 'T'   ? NmeaDepth::Datum::transducer
            : what == 'S' ? NmeaDepth::Datum::surface
                          : NmeaDepth::Datum::keel;
  constexpr std::array<std::size_t, 3> order{2, 0, 4};
  constexpr std::array<double, 3> metres{1, 0.3048, 1.8288};
  for (std::size_t i = 0; i < 3; ++i) {
    if (f[order[i]].empty()) continue;
    if (!in_range(f[order[i]], 0, 12000 / metres[i], d.depth)) return Status::implausible;
    d.depth *= metres[i];
    return Status::ok;
  }
  return Status::not_measured;
}

}  // namespace detail::nmea
}  // namespace icat
