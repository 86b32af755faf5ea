// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Teledyne's binary format PD0, as Doppler logs send it:
///
///     7F 7F | bytes | – | types | offset of each type … | types … | sum
///
/// Numbers have their low byte first, `bytes` counts all but the sum, which is that of all bytes
/// before it, modulo 65536. Of the types there are read the fixed leader 0000h (frame, beam angle),
/// the variable leader 0080h (number, time, attitude) and the bottom track 0600h (velocities,
/// ranges, water layer). Source: Pathfinder DVL Guide (P/N 95B-6116-00, April 2018), "PD0 Output
/// Data Format", Tables 32, 33, 34, 40, and "Decoding Sequence for PD0 Data".
///
/// Velocities come in the frame that the EX command chose:
///
///     EX00…   beams          made a velocity here, also of three beams
///     EX01…   instrument     turned by β, see dvl_sample.hpp
///     EX10…   ship           where tilts were used (EXxx1…) they are taken back here, if they are
///                            the ship's (EP…,1, as from the factory)
///     EX11…   earth          left as it is
///
///     X = c a (b₁ − b₂),  Y = c a (b₄ − b₃),  Z = b (b₁ + b₂ + b₃ + b₄),
///     e = d (b₁ + b₂ − b₃ − b₄),  a = 1 / (2 sinα),  b = 1 / (4 cosα),  d = a / √2,
///     c = 1 for convex heads, −1 for concave ones; of three beams the fourth is such that e = 0
///
/// Ask the instrument for beams or instrument coordinates: then nothing but the four beams enters.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "icat/adapters/dvl_sample.hpp"
#include "icat/adapters/text_fields.hpp"

namespace icat {

/// Ensembles of PD0 from bytes. After construction no allocation, no exception.
///
/// Damaged, doubled or late ensembles change nothing. After a false header the search continues at
/// its second byte, in all bytes received: the next ensemble is found at most `longest` bytes
/// later.
class Pd0Decoder : public DvlEnsembles {
 public:
  /// Allocates `options.longest` bytes.
  /// @throws std::invalid_argument on options out of range.
  [[gnu::cold]] explicit Pd0Decoder(const DvlOptions& options = DvlOptions())
      : DvlEnsembles("Pd0Decoder", options) {
    buffer_.resize(static_cast<std::size_t>(options.longest) + 2);
  }

  /// All of `bytes`, which came at `now`, s. Returns how many new ensembles they ended; the last
  /// one stays.
  int put(std::span<const std::uint8_t> bytes, double now) noexcept {
    int fresh = 0;
    for (const std::uint8_t byte : bytes) fresh += put(byte, now) ? 1 : 0;
    return fresh;
  }
  /// One byte. Whether it ended a new ensemble.
  bool put(std::uint8_t byte, double now) noexcept {
    // There is room: a header that asks for more is refused before the buffer is full.
    buffer_[size_++] = byte;
    bool fresh = false;
    while (size_ > 0) {
      const std::size_t length = expected();
      if (length == 0) {
        drop(1);
        seek();
        continue;
      }
      if (size_ < length) break;
      if (sum_is_right(length - 2)) {
        ++ensembles_;
        if (decode(length - 2, now)) fresh = true;
        drop(length);
      } else {
        ++damaged_;
        drop(1);
      }
      seek();
    }
    return fresh;
  }

 private:
  static constexpr std::uint8_t id = 0x7f;

  std::uint16_t u16(std::size_t at) const noexcept {
    return static_cast<std::uint16_t>(buffer_[at] | buffer_[at + 1] << 8);
  }
  std::int16_t i16(std::size_t at) const noexcept { return static_cast<std::int16_t>(u16(at)); }

  // How many bytes the ensemble at the front has with its sum, as far as is known; 0: it is none.
  std::size_t expected() const noexcept {
    if (buffer_[0] != id || (size_ > 1 && buffer_[1] != id)) return 0;
    if (size_ < 6) return 6;
    const std::size_t bytes = u16(2), types = buffer_[5], header = 6 + 2 * types;
    if (types < 2 || bytes < header + 2 * types) return 0;
    if (bytes > static_cast<std::size_t>(options_.longest)) return 0;
    std::size_t last = header - 2;
    for (std::size_t i = 0; i < types && 8 + 2 * i <= size_; ++i) {
      const std::size_t offset = u16(6 + 2 * i);
      if (offset < last + 2 || offset + 2 > bytes) return 0;
      if (size_ >= offset + 2 && i == 0 && u16(offset) != 0) return 0;
      last = offset;
    }
    return bytes + 2;
  }
  void drop(std::size_t count) noexcept {
    std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(count),
              buffer_.begin() + static_cast<std::ptrdiff_t>(size_), buffer_.begin());
    size_ -= count;
  }
  // To the next byte that may begin a header.
  void seek() noexcept {
    const auto end = buffer_.begin() + static_cast<std::ptrdiff_t>(size_);
    drop(static_cast<std::size_t>(std::find(buffer_.begin(), end, id) - buffer_.begin()));
  }
  bool sum_is_right(std::size_t bytes) const noexcept {
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < bytes; ++i) sum += buffer_[i];
    return (sum & 0xffff) == u16(bytes);
  }

  bool decode(std::size_t bytes, double now) noexcept {
    std::size_t fixed = 0, variable = 0, track = 0;
    std::size_t fixed_size = 0, variable_size = 0, track_size = 0;
    const std::size_t types = buffer_[5];
    for (std::size_t i = 0; i < types; ++i) {
      const std::size_t offset = u16(6 + 2 * i);
      const std::size_t size = (i + 1 < types ? u16(8 + 2 * i) : bytes) - offset;
      switch (u16(offset)) {
        case 0x0000:
          fixed = offset, fixed_size = size;
          break;
        case 0x0080:
          variable = offset, variable_size = size;
          break;
        case 0x0600:
          track = offset, track_size = size;
          break;
        default:
          break;
      }
    }
    if (fixed_size < 32 || variable_size < 28) {
      ++damaged_;
      return false;
    }
    DvlSample s;
    s.beam_3 = options_.beam_3;
    s.ensemble = u16(variable + 2) + (static_cast<std::uint32_t>(buffer_[variable + 11]) << 16);
    leader(variable, s);
    if (track_size >= 58) bottom_track(fixed, fixed_size, track, track_size, s);
    // By the short way of 24 bits.
    const std::uint32_t step = (s.ensemble - sample_.value.ensemble) & 0xffffff;
    return take(s, step > 0x800000 ? step - 16777216.0 : step, now);
  }

  void leader(std::size_t at, DvlSample& s) const noexcept {
    const auto part = [&](std::size_t i) { return static_cast<int>(buffer_[at + i]); };
    if (detail::text::is_date(2000 + part(4), part(5), part(6)) && part(7) < 24 && part(8) < 60 &&
        part(9) < 60 && part(10) < 100) {
      const long days = detail::text::days_from_civil(2000 + part(4), part(5), part(6)) -
                        detail::text::days_from_civil(2000, 1, 1);
      s.instrument_time = 86400.0 * static_cast<double>(days) + part(7) * 3600 + part(8) * 60 +
                          part(9) + part(10) / 100.0;
    }
    s.speed_of_sound = u16(at + 14);
    s.depth = u16(at + 16) * 0.1;
    s.heading = std::fmod(u16(at + 18) * 0.01, 360) * detail::dvl::degree;
    s.pitch = i16(at + 20) * 0.01 * detail::dvl::degree;
    s.roll = i16(at + 22) * 0.01 * detail::dvl::degree;
    s.salinity = i16(at + 24);
    s.temperature = i16(at + 26) * 0.01;
  }

  // What of the fixed leader a velocity needs.
  struct Setup {
    int frame;    // 0 … 3: beams, instrument, ship, earth
    bool tilts;   // were used
    bool gimbal;  // pitch is that of the instrument's own pendulum
    bool looks_up;
    double convex;  // c
    double angle;   // α, rad; 0: not said
  };

  void bottom_track(std::size_t fixed, std::size_t fixed_size, std::size_t at, std::size_t size,
                    DvlSample& s) const noexcept {
    Setup setup;
    const std::uint8_t low = buffer_[fixed + 4], high = buffer_[fixed + 5];
    const std::uint8_t ex = buffer_[fixed + 25];
    setup.frame = ex >> 3 & 3;
    setup.tilts = (ex & 4) != 0;
    setup.gimbal = (buffer_[fixed + 30] & 0x10) != 0;
    setup.looks_up = (low & 0x80) != 0;
    setup.convex = (low & 8) != 0 ? 1 : -1;
    constexpr std::array<double, 4> angles{15, 20, 30, 0};
    double degrees = angles[high & 3];
    // Where there is a byte for it, it knows better.
    if (fixed_size >= 59 && buffer_[fixed + 58] >= 5 && buffer_[fixed + 58] <= 60) {
      degrees = buffer_[fixed + 58];
    }
    setup.angle = degrees * detail::dvl::degree;

    double sum = 0;
    int seen = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      std::uint32_t centimetres = u16(at + 16 + 2 * k);
      if (size >= 81) centimetres += static_cast<std::uint32_t>(buffer_[at + 77 + k]) << 16;
      s.range[k] = centimetres * 0.01;
      sum += s.range[k];
      seen += centimetres > 0 ? 1 : 0;
    }
    if (seen > 0) s.altitude = sum / seen;
    s.frame = setup.frame == 3 ? DvlFrame::earth : DvlFrame::vehicle;
    s.bottom = velocity(at + 24, setup, s, s.range);
    s.water = velocity(at + 50, setup, s, {});
  }

  DvlVelocity velocity(std::size_t at, const Setup& setup, const DvlSample& s,
                       const std::array<double, 4>& range) const noexcept {
    constexpr int bad = -32768;
    std::array<double, 4> v{};
    std::array<bool, 4> good{};
    int count = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const int raw = i16(at + 2 * k);
      good[k] = raw != bad;
      v[k] = good[k] ? raw * 0.001 : 0;
      count += good[k] ? 1 : 0;
    }
    DvlVelocity out;
    std::array<double, 3> ship{};
    if (setup.frame == 0) {
      if (count < 3 || setup.angle == 0) return out;
      solve_fourth(v, good);
      const double a = setup.convex / (2 * std::sin(setup.angle));
      const double b = 1 / (4 * std::cos(setup.angle));
      out.error = std::sqrt(0.5) / (2 * std::sin(setup.angle)) * (v[0] + v[1] - v[2] - v[3]);
      ship = detail::dvl::ship_of_instrument(
          {a * (v[0] - v[1]), a * (v[3] - v[2]), b * (v[0] + v[1] + v[2] + v[3])}, options_.beam_3,
          setup.looks_up);
      out.beams = good;
    } else {
      if (!good[0] || !good[1] || !good[2]) return out;
      ship = {v[0], v[1], v[2]};
      if (setup.frame == 1) {
        ship = detail::dvl::ship_of_instrument(ship, options_.beam_3, setup.looks_up);
      }
      out.error = v[3];
      out.beams = detail::dvl::beams_used(good[3], range);
    }
    out.has_error = count == 4;
    if (!out.has_error) out.error = 0;
    // Starboard, forward, mast, or east, north, up, of the bottom past the instrument.
    out.velocity = {-ship[1], -ship[0], ship[2]};
    if (setup.frame == 2 && setup.tilts) out.velocity = without_tilts(out.velocity, setup, s);
    out.valid = detail::dvl::plausible(out.velocity, options_.most_speed);
    return out.valid ? out : DvlVelocity{};
  }
  // b₁ + b₂ = b₃ + b₄.
  static void solve_fourth(std::array<double, 4>& v, const std::array<bool, 4>& good) noexcept {
    for (std::size_t k = 0; k < 4; ++k) {
      if (good[k]) continue;
      const std::size_t beside = k ^ 1, other = k < 2 ? 2 : 0;
      v[k] = v[other] + v[other + 1] - v[beside];
    }
  }
  // (R_y(pitch) R_x(roll))ᵀ, with the pitch that gimbals would have measured.
  static std::array<double, 3> without_tilts(const std::array<double, 3>& v, const Setup& setup,
                                             const DvlSample& s) noexcept {
    const double pitch = setup.gimbal ? std::atan(std::tan(s.pitch) * std::cos(s.roll)) : s.pitch;
    const double cp = std::cos(pitch), sp = std::sin(pitch);
    const double cr = std::cos(s.roll), sr = std::sin(s.roll);
    const double x = cp * v[0] - sp * v[2], z = sp * v[0] + cp * v[2];
    return {x, cr * v[1] + sr * z, -sr * v[1] + cr * z};
  }

  std::vector<std::uint8_t> buffer_;
  std::size_t size_{0};
};

}  // namespace icat
