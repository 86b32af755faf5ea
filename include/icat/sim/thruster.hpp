// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Simulates a thruster whose thrust differs from the command: a propeller whose speed lags, with
/// less thrust backwards than forwards, and a dead zone near zero speed.
///
///     n_cmd = Sat₋₁₁( sign(f) √(|f| / f_max) ),   τ ṅ = n_cmd − n
///     f = f_max n |n|,   f = 0 while |n| < √dead_zone
///
/// f_max is `maximum` forwards, −`minimum` backwards; n is the shaft's speed over that of full
/// thrust. The inverse of the command uses the propeller's curve but not its dead zone, as a
/// controller would. [MARIS, VI-C] reports poor thrust near zero speed as a cause of failed grasps
/// and prints no model: this one and its numbers are ours.
#pragma once

#include <algorithm>
#include <cmath>

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/core/types.hpp"

namespace icat {

/// One thruster, see the file comment.
template <class Scalar>
class ThrusterModel {
 public:
  /// What it is. Without the three effects it would be: time constant 0, limits alike, dead zone 0.
  struct Options {
    Scalar maximum = 60;          ///< thrust at full speed forwards, N
    Scalar minimum = -48;         ///< backwards, N
    double time_constant = 0.15;  ///< τ, s; 0 follows at once
    /// No thrust below this share of the full one, in [0, 1).
    Scalar dead_zone = static_cast<Scalar>(0.05);
  };

  /// At rest.
  /// @throws std::invalid_argument unless all are finite, minimum <= 0 <= maximum, τ >= 0, the dead
  /// zone in [0, 1).
  explicit ThrusterModel(const Options& options = Options()) : options_(options) {
    if (!(options.minimum <= Scalar(0)) || !(options.maximum >= Scalar(0)) ||
        !std::isfinite(options.minimum) || !std::isfinite(options.maximum)) {
      detail::invalid("ThrusterModel: limits must be finite, minimum <= 0 <= maximum, got ",
                      options.minimum, " and ", options.maximum);
    }
    if (!(options.time_constant >= 0) || !std::isfinite(options.time_constant)) {
      detail::invalid("ThrusterModel: time_constant must be finite and >= 0, got ",
                      options.time_constant);
    }
    if (!(options.dead_zone >= Scalar(0)) || !(options.dead_zone < Scalar(1))) {
      detail::invalid("ThrusterModel: dead_zone must be in [0, 1), got ", options.dead_zone);
    }
  }

  /// `command`, N, was there for `dt` s, >= 0; the speed at the end is exact. What is not finite is
  /// refused, the speed stays. No allocation.
  Status update(Scalar command, double dt) noexcept {
    if (!std::isfinite(command) || !std::isfinite(dt)) return Status::non_finite;
    if (dt < 0) return Status::time_reversed;
    const Scalar full = command < Scalar(0) ? -options_.minimum : options_.maximum;
    Scalar wanted(0);
    if (full > Scalar(0)) wanted = std::sqrt(std::min(std::abs(command) / full, Scalar(1)));
    if (command < Scalar(0)) wanted = -wanted;
    const double keep = options_.time_constant > 0 ? std::exp(-dt / options_.time_constant) : 0;
    speed_ = wanted + static_cast<Scalar>(keep) * (speed_ - wanted);
    return Status::ok;
  }

  /// f, N.
  Scalar thrust() const noexcept {
    const Scalar share = speed_ * speed_;
    if (share < options_.dead_zone) return Scalar(0);
    return share * (speed_ < Scalar(0) ? options_.minimum : options_.maximum);
  }
  /// n, in [−1, 1].
  Scalar speed() const noexcept { return speed_; }
  /// At rest again.
  void reset() noexcept { speed_ = Scalar(0); }

 private:
  Options options_;
  Scalar speed_{0};
};

}  // namespace icat
