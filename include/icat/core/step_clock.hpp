// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// From the caller's time stamps, whatever they do, to steps that add up.
///
/// What counts is the difference from the last stamp, clipped to [0, max_step]:
///
///     far ahead            one step of max_step
///     backwards, or reset  one step of 0
///     NaN or infinite      refused, nothing changes
///     unchanged            a step of 0; after ten in a row the clock counts as stalled
///
/// After each the next regular difference is an ordinary step again. Stamps that jitter go
/// backwards too: what such a one takes away from the sum is repaid by the differences that are
/// longer than usual, so that the steps add up to the time that passed.
///
/// The library reads no clock. Stamps are `double` whatever the scalar type of the robot: epoch
/// seconds do not fit into a `float`.
#pragma once

#include <algorithm>
#include <cmath>

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"

namespace icat {

/// A control cycle, as long as the stamps say.
struct Cycle {
  double step;   ///< s since the last one; 0 where the stamps do not say
  double usual;  ///< the step, or what it usually is where that is 0; s, > 0
};

/// See the file comment. No allocation, no exception after construction.
class StepClock {
 public:
  /// Unchanged stamps in a row from which on the clock counts as stalled.
  static constexpr int stalled_after = 10;

  /// @param max_step longest step, s, > 0
  /// @throws std::invalid_argument unless it is finite and > 0.
  [[gnu::cold]] explicit StepClock(double max_step) : max_step_(max_step) {
    detail::require_positive("StepClock", "max_step", max_step);
  }

  /// The next stamp, s. `non_finite`: refused.
  [[gnu::noinline]] Status advance(double now) noexcept {
    step_ = 0;
    if (!std::isfinite(now)) return Status::non_finite;
    const double difference = started_ ? now - last_ : 0;
    unchanged_ = started_ && difference == 0 ? std::min(unchanged_ + 1, stalled_after) : 0;
    if (difference < 0 || difference > max_step_) ++irregular_;
    last_ = now;
    started_ = true;
    if (difference > 0) {
      // Only what is clearly longer than usual pays, so that a jump costs one step alone.
      const double usual = std::min(difference, max_step_);
      const double repaid = std::min(owed_, std::max(usual - 1.25 * nominal_, 0.0));
      owed_ -= repaid;
      step_ = usual - repaid;
    } else if (-difference < max_step_) {
      owed_ = std::min(owed_ - difference, max_step_);
    } else {
      owed_ = 0;  // another clock, not a late stamp
    }
    if (difference != 0 && difference <= max_step_) {
      // A mean over some 30 steps; the first regular one at once.
      nominal_ += (regular_ ? 1.0 / 32 : 1.0) * (step_ - nominal_);
      regular_ = regular_ || step_ > 0;
      if (!regular_) nominal_ = first_nominal;
    }
    elapsed_ += step_;
    return Status::ok;
  }

  /// Of the last stamp, s, in [0, max_step].
  double step() const noexcept { return step_; }
  /// Sum of all steps, s: a time that never runs backwards.
  double elapsed() const noexcept { return elapsed_; }
  /// The cycle since `last`, a value of `elapsed`, which moves on to the present one.
  Cycle since(double& last) const noexcept {
    const double step = std::max(elapsed_ - last, 0.0);
    last = elapsed_;
    return {step, step > 0 ? step : nominal_};
  }
  /// Mean step of late, s; 0.01 before the first.
  double nominal() const noexcept { return nominal_; }
  /// Ten stamps in a row did not change.
  bool stalled() const noexcept { return unchanged_ >= stalled_after; }
  /// How many stamps went backwards or further ahead than max_step.
  long irregular() const noexcept { return irregular_; }
  /// As given at construction.
  double max_step() const noexcept { return max_step_; }

 private:
  static constexpr double first_nominal = 0.01;

  double max_step_;
  double last_{0}, step_{0}, elapsed_{0}, nominal_{first_nominal}, owed_{0};
  int unchanged_{0};
  long irregular_{0};
  bool started_{false}, regular_{false};
};

}  // namespace icat
