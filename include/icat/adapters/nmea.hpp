// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// NMEA 0183: depth, position, velocity, heading and time from the sentences of sounders, GPS and
/// compasses, by any talker. Bytes in, plain values in SI units out.
///
///     $GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47<CR><LF>
///      └┬┘└┬┘ └──────────────────────────┬──────────────────────────┘ └┬┘
///    talker type                      fields          XOR of all from $ to *
///
/// | sentence | gives |
/// |---|---|
/// | DPT, DBT, DBS, DBK | depth of the water |
/// | GGA, GLL, RMC | position |
/// | RMC, VTG | velocity over ground |
/// | HDT, THS; HDM; HDG | true heading; magnetic heading; magnetic and, with a variation, true |
/// | ZDA, RMC | time and date, UTC |
///
/// Source: NMEA 0183, as "NMEA Revealed" (E. S. Raymond, gpsd) and IEC 61162-1 tell it. A sentence
/// that says of itself that it has no measurement (status V, quality 0, mode N, an empty field)
/// changes nothing. Neither does one with a wrong checksum, a malformed field, a value out of its
/// range, or an older time than the one before. The XOR of eight bits finds every single bit and
/// every odd number of flips in a column; two flips in one column pass; the gates of an estimator
/// must refuse them.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <string_view>

#include "icat/adapters/nmea_sample.hpp"
#include "icat/adapters/text_fields.hpp"
#include "icat/core/error.hpp"
#include "icat/core/received.hpp"
#include "icat/core/status.hpp"

namespace icat {

/// Decodes one line of NMEA 0183, sentence by sentence.
class NmeaDecoder {
 public:
  /// What is taken.
  struct Options {
    bool checksum_required = true;  ///< sentences without one are refused
    /// No position or velocity by dead reckoning, manual input or a simulator.
    bool satellites_only = true;
    /// After so long without a fix that has a time, s, > 0, one with an older time counts as new:
    /// the receiver has begun anew. The same holds for `utc`.
    double restart_after = 2;
  };
  /// The longest sentence without $ and the end of line; the standard says 79.
  static constexpr std::size_t longest = 120;

  /// Checksums required, satellites only.
  NmeaDecoder() noexcept = default;
  /// @throws std::invalid_argument on a `restart_after` that is not > 0.
  explicit NmeaDecoder(const Options& options) : options_(options) {
    detail::require_positive("NmeaDecoder", "restart_after", options.restart_after);
  }

  /// All of `bytes`, which came at `now`, s. Returns how many sentences brought something new. No
  /// allocation. After damage the next $ begins anew: no more is lost than the sentence itself.
  int put(std::span<const std::uint8_t> bytes, double now) noexcept {
    int fresh = 0;
    for (const std::uint8_t byte : bytes) fresh += put(byte, now) ? 1 : 0;
    return fresh;
  }
  /// One byte. Whether it ended a sentence that brought something new.
  bool put(std::uint8_t byte, double now) noexcept {
    const char c = static_cast<char>(byte);
    if (c == '$') {
      if (inside_) ++damaged_;
      inside_ = true;
      size_ = 0;
      return false;
    }
    if (!inside_) return false;
    if (c == '\r' || c == '\n') {
      inside_ = false;
      return sentence({buffer_.data(), size_}, now);
    }
    if (byte < 0x20 || byte > 0x7e || size_ == longest) {
      inside_ = false;
      ++damaged_;
      return false;
    }
    buffer_[size_++] = c;
    return false;
  }

  /// The last depth.
  const Received<NmeaDepth>& depth() const noexcept { return depth_; }
  /// The last fix. GGA, GLL and RMC of one time are one fix: the first of them counts, GGA adds
  /// what it alone knows.
  const Received<NmeaPosition>& position() const noexcept { return position_; }
  /// The last velocity over ground.
  const Received<NmeaVelocity>& velocity() const noexcept { return velocity_; }
  /// rad from true north, clockwise, [0, 2π).
  const Received<double>& true_heading() const noexcept { return true_heading_; }
  /// rad from magnetic north, deviation applied where HDG says one, [0, 2π).
  const Received<double>& magnetic_heading() const noexcept { return magnetic_heading_; }
  /// Magnetic variation, rad, east positive, as HDG or RMC last said it.
  const Received<double>& variation() const noexcept { return variation_; }
  /// s since 1970-01-01 UTC without leap seconds, to some microseconds.
  const Received<double>& utc() const noexcept { return utc_; }

  /// Of the last whole sentence of a type above. `not_measured`: it says so itself;
  /// `time_reversed`: a fix or a time older than the last one; `implausible`: a malformed field or
  /// one out of range.
  Status status() const noexcept { return status_; }
  /// Sentences, of any type, whose checksum was right.
  std::uint32_t sentences() const noexcept { return sentences_; }
  /// Sentences that were cut, too long, or had a wrong checksum or a malformed field.
  std::uint32_t damaged() const noexcept { return damaged_; }

 private:
  using Fields = detail::text::Fields;

  bool sentence(std::string_view line, double now) noexcept {
    const std::size_t star = line.find('*');
    const bool summed = star != std::string_view::npos;
    if (summed) {
      unsigned sum = 0;
      for (const char c : line.substr(0, star)) sum ^= static_cast<unsigned char>(c);
      if (line.size() != star + 3 || detail::nmea::hex(line[star + 1]) < 0 ||
          detail::nmea::hex(line[star + 2]) < 0 ||
          static_cast<unsigned>(detail::nmea::hex(line[star + 1]) * 16 +
                                detail::nmea::hex(line[star + 2])) != sum) {
        ++damaged_;
        return false;
      }
      line = line.substr(0, star);
    }
    const std::size_t comma = line.find(',');
    if ((!summed && options_.checksum_required) || comma == std::string_view::npos) {
      ++damaged_;
      return false;
    }
    ++sentences_;
    if (comma != 5 || line[0] == 'P') return false;  // P: a manufacturer's own
    const std::string_view type = line.substr(2, 3);
    const Fields f(line.substr(6));
    const std::uint32_t before = news();
    Status status;
    if (type == "GGA") {
      status = gga(f, now);
    } else if (type == "RMC") {
      status = rmc(f, now);
    } else if (type == "GLL") {
      status = gll(f, now);
    } else if (type == "VTG") {
      status = vtg(f, now);
    } else if (type == "ZDA") {
      double time = 0;
      status = detail::nmea::parse_zda(f, time);
      if (status == Status::ok) status = take_utc(time, now);
    } else if (type == "HDT" || type == "THS" || type == "HDM") {
      status = heading(f, type, now);
    } else if (type == "HDG") {
      status = hdg(f, now);
    } else if (type == "DPT" || type == "DBT" || type == "DBS" || type == "DBK") {
      NmeaDepth d;
      status =
          type == "DPT" ? detail::nmea::parse_dpt(f, d) : detail::nmea::parse_below(f, type[2], d);
      if (status == Status::ok) depth_.put(d, now);
    } else {
      return false;
    }
    if (status == Status::implausible) ++damaged_;
    status_ = status;
    return news() != before;
  }
  std::uint32_t news() const noexcept {
    return depth_.count + position_.count + velocity_.count + true_heading_.count +
           magnetic_heading_.count + variation_.count + utc_.count;
  }

  Status judge(NmeaQuality quality) const noexcept {
    if (quality == NmeaQuality::none) return Status::not_measured;
    const bool satellites = quality < NmeaQuality::estimated;
    return satellites || !options_.satellites_only ? Status::ok : Status::not_measured;
  }
  // `time_reversed` where it is older than the last one; `same` where it is the same fix.
  Status order(double utc, double now, bool& same) const noexcept {
    same = false;
    if (fix_utc_.count == 0 || utc < 0) return Status::ok;
    // (−1 day, 1 day), over midnight the short way
    double step = std::fmod(utc - fix_utc_.value, 86400);
    if (step > 43200) step -= 86400;
    if (step < -43200) step += 86400;
    same = step == 0;
    return step < 0 && fix_utc_.fresh(now, options_.restart_after) ? Status::time_reversed
                                                                   : Status::ok;
  }
  Status take(const NmeaPosition& p, double now) noexcept {
    bool same = false;
    const Status status = order(p.utc, now, same);
    if (status != Status::ok) return status;
    if (!same) {
      position_.put(p, now);
      if (p.utc >= 0) fix_utc_.put(p.utc, now);
    } else if (p.has_altitude && !position_.value.has_altitude && p.utc == position_.value.utc) {
      // What GGA alone knows; the place is the first one's, so that it is no second measurement.
      NmeaPosition& kept = position_.value;
      kept.has_altitude = true;
      kept.altitude = p.altitude;
      kept.geoid = p.geoid;
      kept.hdop = p.hdop;
      kept.satellites = p.satellites;
    }
    return Status::ok;
  }
  // The same time again is no news.
  Status take_utc(double utc, double now) noexcept {
    if (utc < utc_.value && utc_.fresh(now, options_.restart_after)) return Status::time_reversed;
    if (utc != utc_.value) utc_.put(utc, now);
    return Status::ok;
  }

  Status gga(const Fields& f, double now) noexcept {
    NmeaPosition p;
    double quality = 0, satellites = 0;
    if (f.count != 14 || !detail::nmea::in_range(f[5], 0, 8, quality) || f[5].size() != 1) {
      return Status::implausible;
    }
    p.quality = static_cast<NmeaQuality>(static_cast<int>(quality));
    if (const Status s = judge(p.quality); s != Status::ok) return s;
    if (!f[0].empty() && !detail::nmea::time_of_day(f[0], p.utc)) return Status::implausible;
    if (const Status s = detail::nmea::place(f, 1, p); s != Status::ok) return s;
    if (!f[6].empty() && !detail::nmea::in_range(f[6], 0, 99, satellites))
      return Status::implausible;
    p.satellites = static_cast<int>(satellites);
    if (!f[7].empty() && !detail::nmea::in_range(f[7], 0, 1000, p.hdop)) return Status::implausible;
    if (!f[8].empty()) {
      if (!detail::nmea::in_range(f[8], -1e5, 1e5, p.altitude) || f[9] != "M")
        return Status::implausible;
      p.has_altitude = true;
    }
    if (!f[10].empty() && (!detail::nmea::in_range(f[10], -200, 200, p.geoid) || f[11] != "M")) {
      return Status::implausible;
    }
    return take(p, now);
  }

  Status gll(const Fields& f, double now) noexcept {
    NmeaPosition p;
    p.quality = NmeaQuality::autonomous;
    if ((f.count != 6 && f.count != 7) || (f[5] != "A" && f[5] != "V")) return Status::implausible;
    if (f.count == 7 && !f[6].empty()) {
      if (const Status s = detail::nmea::from_mode(f[6], p.quality); s != Status::ok) return s;
    }
    if (f[5] == "V") return Status::not_measured;
    if (const Status s = judge(p.quality); s != Status::ok) return s;
    if (!f[4].empty() && !detail::nmea::time_of_day(f[4], p.utc)) return Status::implausible;
    if (const Status s = detail::nmea::place(f, 0, p); s != Status::ok) return s;
    return take(p, now);
  }

  Status rmc(const Fields& f, double now) noexcept {
    NmeaPosition p;
    NmeaVelocity v;
    p.quality = NmeaQuality::autonomous;
    if (f.count < 11 || f.count > 13 || (f[1] != "A" && f[1] != "V")) return Status::implausible;
    if (f.count > 11 && !f[11].empty()) {
      if (const Status s = detail::nmea::from_mode(f[11], p.quality); s != Status::ok) return s;
    }
    if (f[1] == "V") return Status::not_measured;
    if (const Status s = judge(p.quality); s != Status::ok) return s;
    double date = -1, variation = 0;
    if (!detail::nmea::time_of_day(f[0], p.utc)) return Status::implausible;
    if (!f[8].empty()) {
      const int day = detail::text::parse_digits(f[8], 0, 2);
      const int month = detail::text::parse_digits(f[8], 2, 2);
      const int two = detail::text::parse_digits(f[8], 4, 2);
      const int year = two < 80 ? 2000 + two : 1900 + two;
      if (f[8].size() != 6 || two < 0 || !detail::text::is_date(year, month, day)) {
        return Status::implausible;
      }
      date = 86400.0 * static_cast<double>(detail::text::days_from_civil(year, month, day));
    }
    if (const Status s = detail::nmea::place(f, 2, p); s != Status::ok) return s;
    const bool has_speed = !f[6].empty();
    if (has_speed && !detail::nmea::in_range(f[6], 0, 2000, v.speed)) return Status::implausible;
    v.speed *= detail::nmea::knot;
    if (!detail::nmea::course(f[7], v)) return Status::implausible;
    if (!f[9].empty() && !detail::nmea::signed_angle(f[9], f[10], variation))
      return Status::implausible;

    const Status status = take(p, now);
    if (status != Status::ok) return status;
    if (p.utc == rmc_utc_) return Status::ok;  // doubled, or of a receiver that repeats itself
    rmc_utc_ = p.utc;
    if (has_speed) velocity_.put(v, now);
    // Another sentence may know a later time: the fix is one all the same.
    if (date >= 0) (void)take_utc(date + p.utc, now);
    if (!f[9].empty()) variation_.put(variation, now);
    return Status::ok;
  }

  Status vtg(const Fields& f, double now) noexcept {
    NmeaVelocity v;
    if ((f.count != 8 && f.count != 9) || f[1] != "T") return Status::implausible;
    if (f.count == 9 && !f[8].empty()) {
      NmeaQuality quality = NmeaQuality::none;
      if (const Status s = detail::nmea::from_mode(f[8], quality); s != Status::ok) return s;
      if (const Status s = judge(quality); s != Status::ok) return s;
    }
    if (f[4].empty() && f[6].empty()) return Status::not_measured;
    if (!f[4].empty()) {
      if (!detail::nmea::in_range(f[4], 0, 2000, v.speed) || f[5] != "N")
        return Status::implausible;
      v.speed *= detail::nmea::knot;
    } else {
      if (!detail::nmea::in_range(f[6], 0, 4000, v.speed) || f[7] != "K")
        return Status::implausible;
      v.speed /= 3.6;
    }
    if (!detail::nmea::course(f[0], v)) return Status::implausible;
    velocity_.put(v, now);
    return Status::ok;
  }

  Status heading(const Fields& f, std::string_view type, double now) noexcept {
    double value = 0;
    if (f.count != 2) return Status::implausible;
    if (type == "THS") {
      if (f[1].size() != 1 || std::string_view("AEMSV").find(f[1][0]) == std::string_view::npos) {
        return Status::implausible;
      }
      if (f[1] != "A") return Status::not_measured;
    } else if (f[1] != (type == "HDT" ? "T" : "M")) {
      return Status::implausible;
    }
    if (f[0].empty()) return Status::not_measured;
    if (!detail::nmea::in_range(f[0], 0, 360, value)) return Status::implausible;
    (type == "HDM" ? magnetic_heading_ : true_heading_)
        .put(detail::nmea::wrap(value * detail::nmea::degree), now);
    return Status::ok;
  }

  Status hdg(const Fields& f, double now) noexcept {
    double value = 0, deviation = 0, variation = 0;
    if (f.count != 5) return Status::implausible;
    if (f[0].empty()) return Status::not_measured;
    if (!detail::nmea::in_range(f[0], 0, 360, value) ||
        (!f[1].empty() && !detail::nmea::signed_angle(f[1], f[2], deviation)) ||
        (!f[3].empty() && !detail::nmea::signed_angle(f[3], f[4], variation))) {
      return Status::implausible;
    }
    value = value * detail::nmea::degree + deviation;
    magnetic_heading_.put(detail::nmea::wrap(value), now);
    if (!f[3].empty()) {
      variation_.put(variation, now);
      true_heading_.put(detail::nmea::wrap(value + variation), now);
    }
    return Status::ok;
  }

  Options options_{};
  double rmc_utc_{-1};
  Received<double> fix_utc_;  // of the last fix that has a time
  std::array<char, longest> buffer_{};
  std::size_t size_{0};
  bool inside_{false};
  Received<NmeaDepth> depth_;
  Received<NmeaPosition> position_;
  Received<NmeaVelocity> velocity_;
  Received<double> true_heading_, magnetic_heading_, variation_, utc_;
  Status status_{Status::not_measured};
  std::uint32_t sentences_{0}, damaged_{0};
};

}  // namespace icat
