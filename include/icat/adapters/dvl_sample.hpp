// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The measurements of a Teledyne Doppler log in one ensemble, on the axes of the vehicle; pd0.hpp
/// and pd6.hpp decode it. Frames, by the Pathfinder DVL Guide (P/N 95B-6116-00, April 2018),
/// chapter "Coordinate Frames", and "ADCP Coordinate Transformation" (P/N 951-6079-00):
///
///     instrument   X from beam 1 to beam 2, Y from beam 4 to beam 3, Z up for a unit that looks
///                  down
///     ship         starboard, forward, mast:  ⟨v⟩ = (forward, starboard, −mast)
///
/// and with the azimuth β of beam 3 from ahead, to starboard, of a unit that looks down
///
///     forward = Y cosβ − X sinβ,    starboard = Y sinβ + X cosβ,    mast = Z
///
/// Of one that looks up X and Z change sign first. PD0 has the velocity of the bottom past the
/// instrument, PD6 that of the instrument over the bottom; here all are of the vehicle.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "icat/core/error.hpp"
#include "icat/core/received.hpp"

namespace icat {

/// What a velocity has its components on.
enum class DvlFrame {
  vehicle,  ///< ⟨v⟩: x ahead, y to starboard, z down
  earth     ///< north, east, down, by the instrument's own compass
};

/// One velocity of the vehicle, m/s.
struct DvlVelocity {
  bool valid{false};                 ///< false: nothing was measured, `velocity` is 0
  std::array<double, 3> velocity{};  ///< on the sample's frame, m/s
  bool has_error{false};             ///< false: of three beams, or not measured
  double error{0};                   ///< error velocity, m/s: how far four beams disagree
  /// That went into it: the instrument's beams 1 … 4. Where three did and the instrument does not
  /// say which, beam 4 counts as the missing one.
  std::array<bool, 4> beams{};
};

/// One ensemble.
struct DvlSample {
  std::uint32_t ensemble{0};   ///< its number, which PD6 has not: 0
  double instrument_time{-1};  ///< s since 2000-01-01 on the instrument's clock; −1: not set
  DvlFrame frame{DvlFrame::vehicle};  ///< of the velocities
  double beam_3{0};                   ///< azimuth of beam 3, rad, as `DvlOptions` told it
  DvlVelocity bottom;                 ///< over ground
  DvlVelocity water;                  ///< through the layer of water below
  /// Distance of the bottom along the instrument's axis as beams 1 … 4 see it, m; 0: none seen, or
  /// not said. No tilt is made up for.
  std::array<double, 4> range{};
  double altitude{0};        ///< mean of those that see it, or the instrument's own, m; 0: none
  double heading{0};         ///< as the instrument knows it, rad, [0, 2π)
  double pitch{0};           ///< rad, bow up positive; beam 3 up where EP says instrument axes
  double roll{0};            ///< rad, starboard down positive; beam 1 up where EP says so
  double depth{0};           ///< of the transducer, m
  double temperature{0};     ///< °C
  double salinity{0};        ///< parts per thousand
  double speed_of_sound{0};  ///< m/s
};

/// Mounting, and limits of accepted values.
struct DvlOptions {
  /// β, rad: azimuth of beam 3 from ahead, to starboard positive. The default is how the manual
  /// recommends to mount it, and the beams of `DvlGeometry`. The instrument's own EA command does
  /// not enter, but where it sends ship coordinates.
  double beam_3 = std::numbers::pi / 4;
  /// After so long without a sample, s, > 0, an older number counts as new where the instrument's
  /// clock went on, after ten times as long an older clock, too: the instrument has begun anew.
  double restart_after = 1;
  /// Faster than this nothing moves, m/s, > 0: the manual's range.
  double most_speed = 10;
  /// Of PD0: longer ensembles are not decoded, bytes, 64 … 65535. So many bytes at most are waited
  /// for after damage.
  int longest = 2048;
  /// Of PD6, > 0: by so much, and 3 mm/s, may the speeds in its three frames differ.
  double agreement = 0.02;
};

namespace detail::dvl {

inline void check_options(const char* owner, const DvlOptions& o) {
  if (!(std::abs(o.beam_3) <= 2 * std::numbers::pi)) {
    invalid(owner, ": beam_3 must be within two pi, in rad, got ", o.beam_3);
  }
  require_positive(owner, "restart_after", o.restart_after);
  require_positive(owner, "most_speed", o.most_speed);
  require_positive(owner, "agreement", o.agreement);
  if (o.longest < 64 || o.longest > 65535) {
    invalid(owner, ": longest must be in [64, 65535] bytes, got ", o.longest);
  }
}

constexpr double degree = std::numbers::pi / 180;

/// Starboard, forward, mast of X, Y, Z of the instrument.
inline std::array<double, 3> ship_of_instrument(const std::array<double, 3>& v, double beam_3,
                                                bool looks_up) noexcept {
  const double x = looks_up ? -v[0] : v[0], z = looks_up ? -v[2] : v[2];
  const double c = std::cos(beam_3), s = std::sin(beam_3);
  return {v[1] * s + x * c, v[1] * c - x * s, z};
}

/// Which beams went into a velocity that the instrument computed itself.
inline std::array<bool, 4> beams_used(bool four, const std::array<double, 4>& range) noexcept {
  if (four) return {true, true, true, true};
  int seen = 0;
  for (const double r : range) seen += r > 0 ? 1 : 0;
  if (seen != 3) return {true, true, true, false};
  return {range[0] > 0, range[1] > 0, range[2] > 0, range[3] > 0};
}

/// Whether it can be: none faster than `most`.
inline bool plausible(const std::array<double, 3>& v, double most) noexcept {
  return std::hypot(v[0], v[1], v[2]) <= most;
}

}  // namespace detail::dvl

/// What `Pd0Decoder` and `Pd6Decoder` keep: the last ensemble, and what became of the others. No
/// allocation.
class DvlEnsembles {
 public:
  /// The last ensemble; its bottom track may be invalid.
  const Received<DvlSample>& sample() const noexcept { return sample_; }
  /// s at `now` since an ensemble with bottom track; infinite before the first, and where the
  /// caller's clock was set back behind it.
  double bottom_age(double now) const noexcept {
    return now >= bottom_time_ ? now - bottom_time_ : std::numeric_limits<double>::infinity();
  }
  /// Ensembles that were whole, of PD0 with the right sum.
  std::uint32_t ensembles() const noexcept { return ensembles_; }
  /// Of PD0 headers whose ensemble had another sum; false ones, within data, count too. Of PD6
  /// ensembles that had a damaged, missing or doubled line, or whose velocities disagree.
  std::uint32_t damaged() const noexcept { return damaged_; }
  /// Ensembles that had come before, of PD6 by their time.
  std::uint32_t repeated() const noexcept { return repeated_; }
  /// Ensembles older than the last one.
  std::uint32_t late() const noexcept { return late_; }

 protected:
  /// @throws std::invalid_argument on options out of range, in the name of `owner`.
  DvlEnsembles(const char* owner, const DvlOptions& options) : options_(options) {
    detail::dvl::check_options(owner, options);
  }
  ~DvlEnsembles() = default;

  /// Whether `s` is the last one from now on; `ahead` of the one before by its number or time: 0 is
  /// the same one, < 0 is late, unless the instrument has begun anew.
  bool take(const DvlSample& s, double ahead, double now) noexcept {
    if (sample_.count > 0 && ahead == 0) {
      ++repeated_;
      return false;
    }
    if (sample_.count > 0 && ahead < 0) {
      const bool later = s.instrument_time < 0 || s.instrument_time > sample_.value.instrument_time;
      if (sample_.fresh(now, (later ? 1 : 10) * options_.restart_after)) {
        ++late_;
        return false;
      }
    }
    sample_.put(s, now);
    if (s.bottom.valid) bottom_time_ = now;
    return true;
  }

  DvlOptions options_;          ///< as given
  Received<DvlSample> sample_;  ///< the last one
  std::uint32_t ensembles_{0};  ///< see `ensembles`
  std::uint32_t damaged_{0};    ///< see `damaged`

 private:
  double bottom_time_{-std::numeric_limits<double>::infinity()};
  std::uint32_t repeated_{0}, late_{0};
};

}  // namespace icat
