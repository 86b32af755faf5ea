// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Teledyne's text formats PD6 and PD13 of Doppler logs, one line after the other:
///
///     :SA,±pitch,±roll,heading            degrees
///     :TS,YYMMDDhhmmsscc,salinity,temperature,depth,speed of sound,test result
///     :RA,pressure,range 1,…,range 4      PD13 only; ranges in decimetres
///     :WI,±x,±y,±z,±error,S               water layer, instrument's axes, mm/s; S: A good, V bad
///     :WS,… :WE,… :WD,…                   on the ship's and the earth's axes; distance made good
///     :BI,±x,±y,±z,±error,S               the same for the bottom
///     :BS,±starboard,±forward,±mast,S
///     :BE,±east,±north,±up,S
///     :BD,±east,±north,±up,range,time     m, s
///
/// Source: Pathfinder DVL Guide (P/N 95B-6116-00, April 2018), "Special Output Data Formats",
/// Tables 50 and 51. Velocities are of the instrument over the bottom. Those of :BI are taken and
/// turned by β (dvl_sample.hpp); the instrument must look down.
///
/// **There is no checksum.** An ensemble is taken whole at its :BD line or not at all: every line
/// must be to the letter of its format, in this order, with :SA, :TS, :BI, :BS, :BE and :BD there,
/// and the three velocities of one thing must be equally fast, as turns leave them. A damaged digit
/// that changes the speed by less than `agreement` gets through. Prefer PD0.
#pragma once

#include <span>
#include <string_view>

#include "icat/adapters/dvl_sample.hpp"
#include "icat/adapters/text_fields.hpp"

namespace icat {

/// Ensembles of PD6 or PD13 from bytes. No allocation, no exception after construction.
class Pd6Decoder : public DvlEnsembles {
 public:
  /// The longest line.
  static constexpr std::size_t longest = 100;

  /// @throws std::invalid_argument on options out of range.
  [[gnu::cold]] explicit Pd6Decoder(const DvlOptions& options = DvlOptions())
      : DvlEnsembles("Pd6Decoder", options) {}

  /// All of `bytes`, which came at `now`, s. Returns how many new ensembles they ended; the last
  /// one stays. After damage all is well from the next :SA line on.
  int put(std::span<const std::uint8_t> bytes, double now) noexcept {
    int fresh = 0;
    for (const std::uint8_t byte : bytes) fresh += put(byte, now) ? 1 : 0;
    return fresh;
  }
  /// One byte. Whether it ended a new ensemble.
  bool put(std::uint8_t byte, double now) noexcept {
    if (byte == '\n') {
      std::string_view text(buffer_.data(), size_);
      if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
      const bool whole = good_;
      size_ = 0;
      good_ = true;
      if (whole && text.empty()) return false;
      if (whole && line(text)) return stage_ == last && finish(now);
      spoil();
      return false;
    }
    if (size_ == longest || ((byte < 0x20 || byte > 0x7e) && byte != '\r')) {
      good_ = false;
    } else {
      buffer_[size_++] = static_cast<char>(byte);
    }
    return false;
  }

 private:
  using Fields = detail::text::Fields;
  static constexpr std::array<std::string_view, 11> order{":SA", ":TS", ":RA", ":WI", ":WS", ":WE",
                                                          ":WD", ":BI", ":BS", ":BE", ":BD"};
  static constexpr int last = 10;

  // One velocity in its three frames, as far as they have come.
  struct Track {
    std::array<bool, 3> there{}, valid{};
    std::array<std::array<double, 3>, 3> velocity{};
    bool has_error{false};
    double error{0};
  };

  void spoil() noexcept {
    if (stage_ >= 0) ++damaged_;
    stage_ = -1;
  }

  // False: not to the letter, or out of turn.
  bool line(std::string_view text) noexcept {
    if (text.size() < 4 || text[0] != ':' || text[3] != ',') return false;
    int stage = 0;
    while (stage <= last && order[static_cast<std::size_t>(stage)] != text.substr(0, 3)) ++stage;
    if (stage > last) {
      // A line of another kind, as the system's health, which may stand anywhere.
      return detail::text::is_upper(text[1]) && detail::text::is_upper(text[2]);
    }
    const Fields f(text.substr(4));
    if (stage == 0) {
      spoil();
      ensemble_ = DvlSample{};
      ensemble_.beam_3 = options_.beam_3;
      bottom_ = water_ = Track{};
      bits_ = 0;
    } else if (stage_ < 0) {
      return true;  // of an ensemble that is lost
    } else if (stage <= stage_) {
      return false;
    }
    bool good = false;
    switch (stage) {
      case 0:
        good = attitude(f);
        break;
      case 1:
        good = time(f);
        break;
      case 2:
        good = ranges(f);
        break;
      case 3:
      case 4:
      case 5:
        good = velocity(f, static_cast<std::size_t>(stage - 3), water_);
        break;
      case 7:
      case 8:
      case 9:
        good = velocity(f, static_cast<std::size_t>(stage - 7), bottom_);
        break;
      default:
        good = distance(f, stage == last);
        break;
    }
    stage_ = stage;
    bits_ |= 1u << stage;
    return good;
  }

  // Blanks stand for leading zeros.
  static std::string_view trimmed(std::string_view s) noexcept {
    const std::size_t at = s.find_first_not_of(' ');
    return at == std::string_view::npos ? std::string_view() : s.substr(at);
  }
  static bool number(std::string_view s, int decimals, bool sign, double least, double most,
                     double& value) noexcept {
    s = trimmed(s);
    return (sign ? detail::text::parse_signed(s, value, decimals, true)
                 : detail::text::parse_unsigned(s, value, decimals)) &&
           value >= least && value <= most;
  }

  bool attitude(const Fields& f) noexcept {
    DvlSample& s = ensemble_;
    if (f.count != 3 || !number(f[0], 2, true, -90, 90, s.pitch) ||
        !number(f[1], 2, true, -180, 180, s.roll) || !number(f[2], 2, false, 0, 360, s.heading)) {
      return false;
    }
    s.pitch *= detail::dvl::degree;
    s.roll *= detail::dvl::degree;
    s.heading = std::fmod(s.heading, 360) * detail::dvl::degree;
    return true;
  }
  bool time(const Fields& f) noexcept {
    DvlSample& s = ensemble_;
    double test = 0;
    if (f.count != 6 || f[0].size() != 14 || !number(f[1], 1, false, 0, 99, s.salinity) ||
        !number(f[2], 1, true, -99, 99, s.temperature) ||
        !number(f[3], 1, false, 0, 12000, s.depth) ||
        !number(f[4], 1, false, 0, 2000, s.speed_of_sound) ||
        !number(f[5], 0, false, 0, 999, test)) {
      return false;
    }
    std::array<int, 7> part{};
    for (std::size_t i = 0; i < 7; ++i) {
      part[i] = detail::text::parse_digits(f[0], 2 * i, 2);
      if (part[i] < 0) return false;
    }
    const int year = 2000 + part[0];
    if (!detail::text::is_date(year, part[1], part[2]) || part[3] > 23 || part[4] > 59 ||
        part[5] > 59) {
      return false;
    }
    const long days = detail::text::days_from_civil(year, part[1], part[2]) -
                      detail::text::days_from_civil(2000, 1, 1);
    s.instrument_time = 86400.0 * static_cast<double>(days) + part[3] * 3600 + part[4] * 60 +
                        part[5] + part[6] / 100.0;
    return true;
  }
  bool ranges(const Fields& f) noexcept {
    double pressure = 0;
    if (f.count != 5 || !number(f[0], 2, false, 0, 1e6, pressure)) return false;
    for (std::size_t k = 0; k < 4; ++k) {
      if (!number(f[k + 1], 2, false, 0, 1e6, ensemble_.range[k])) return false;
      ensemble_.range[k] *= 0.1;
    }
    return true;
  }
  bool velocity(const Fields& f, std::size_t frame, Track& track) noexcept {
    const std::size_t numbers = frame == 0 ? 4 : 3;
    if (f.count != numbers + 1 || (f[numbers] != "A" && f[numbers] != "V")) return false;
    bool all = f[numbers] == "A";
    for (std::size_t i = 0; i < numbers; ++i) {
      double value = 0;
      if (!number(f[i], 0, true, -32768, 32767, value)) return false;
      if (i == 3) {
        track.has_error = value != -32768;
        track.error = value * 0.001;
      } else {
        track.velocity[frame][i] = value * 0.001;
        // Bad numbers and a good status contradict each other.
        if (all && value == -32768) return false;
      }
    }
    track.there[frame] = true;
    track.valid[frame] = all;
    return true;
  }
  bool distance(const Fields& f, bool bottom) noexcept {
    double value = 0, range = 0;
    if (f.count != 5) return false;
    for (std::size_t i = 0; i < 3; ++i) {
      if (!number(f[i], 2, true, -1e8, 1e8, value)) return false;
    }
    if (!number(f[3], 2, false, 0, 1e4, range) || !number(f[4], 2, false, 0, 1e6, value)) {
      return false;
    }
    if (bottom) ensemble_.altitude = range;
    return true;
  }

  // False: its frames contradict each other.
  bool judge(const Track& track, const std::array<double, 4>& range,
             DvlVelocity& out) const noexcept {
    for (std::size_t i = 1; i < 3; ++i) {
      if (!track.there[0] || !track.there[i] || !track.valid[0] || !track.valid[i]) continue;
      const auto& a = track.velocity[0];
      const auto& b = track.velocity[i];
      const double first = std::hypot(a[0], a[1], a[2]), other = std::hypot(b[0], b[1], b[2]);
      if (std::abs(first - other) > 0.003 + options_.agreement * first) return false;
    }
    // Alone it could not be checked.
    const bool checked = (track.there[1] && track.valid[1]) || (track.there[2] && track.valid[2]);
    if (!track.there[0] || !track.valid[0] || !checked) return true;
    const std::array<double, 3> ship =
        detail::dvl::ship_of_instrument(track.velocity[0], options_.beam_3, false);
    if (!detail::dvl::plausible(ship, options_.most_speed)) return true;
    out.valid = true;
    out.velocity = {ship[1], ship[0], -ship[2]};
    out.has_error = track.has_error;
    out.error = out.has_error ? track.error : 0;
    out.beams = detail::dvl::beams_used(out.has_error, range);
    return true;
  }

  bool finish(double now) noexcept {
    constexpr unsigned required = 1u << 0 | 1u << 1 | 1u << 7 | 1u << 8 | 1u << 9 | 1u << 10;
    DvlSample& s = ensemble_;
    const bool whole = (bits_ & required) == required && judge(bottom_, s.range, s.bottom) &&
                       judge(water_, {}, s.water);
    if (!whole) {
      spoil();
      return false;
    }
    stage_ = -1;
    ++ensembles_;
    return take(s, s.instrument_time - sample_.value.instrument_time, now);
  }

  std::array<char, longest> buffer_{};
  std::size_t size_{0};
  bool good_{true};  // of the line so far
  int stage_{-1};    // of the last line; −1: outside of an ensemble, or in one that is lost
  unsigned bits_{0};
  DvlSample ensemble_;
  Track bottom_, water_;
};

}  // namespace icat
