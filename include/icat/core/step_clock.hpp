// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Converts the caller's time stamps, regular or not, to steps that add up to the time passed.
///
/// Only the difference from the last stamp counts:
///
///     within max_step      a step
///     further ahead        one step of the usual length
///     backwards, or reset  one step of 0
///     NaN or infinite      refused, nothing changes
///     unchanged            a step of 0
///
/// After each the next regular difference is an ordinary step again; after ten in a row that were
/// unchanged, or further ahead, the clock counts as stalled. Stamps with jitter go backwards, too:
/// differences that are longer than usual compensate this, so that the steps add up to the time
/// passed.
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
  double step;   ///< s since the last one, at most max_step; 0 where the stamps do not say
  double usual;  ///< the step, or what it usually is where that is 0; s, > 0
};
/// When something last had a cycle, and how long its cycles usually are.
struct CycleTime {
  double last{0};       ///< s, of `StepClock::elapsed`
  double usual{0.01};   ///< s, a mean of late
  bool regular{false};  ///< there was a cycle of more than 0 s
};

/// See the file comment. No allocation, no exception after construction.
class StepClock {
 public:
  /// Unchanged stamps, or stamps further ahead, in a row from which on the clock counts as stalled.
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
    // Stamps are rounded: epoch seconds to 2e-7 s.
    const bool ahead = difference > max_step_ + 1e-6;
    unchanged_ = started_ && difference == 0 ? std::min(unchanged_ + 1, stalled_after) : 0;
    ahead_ = ahead ? std::min(ahead_ + 1, stalled_after) : 0;
    if (difference < 0 || ahead) ++irregular_;
    last_ = now;
    started_ = true;
    if (ahead) {
      step_ = std::min(time_.usual, max_step_);
      owed_ = 0;
    } else if (difference > 0) {
      // Only what is clearly longer than usual pays, so that a jump costs one step alone.
      const double repaid = std::min(owed_, std::max(difference - 1.25 * time_.usual, 0.0));
      owed_ -= repaid;
      step_ = std::min(difference - repaid, max_step_);
    } else if (-difference < max_step_) {
      owed_ = std::min(owed_ - difference, max_step_);
    } else {
      owed_ = 0;  // another clock, not a late stamp
    }
    if (difference != 0 && !ahead) count(step_, time_);
    elapsed_ += step_;
    return Status::ok;
  }

  /// Of the last stamp, s, in [0, max_step].
  double step() const noexcept { return step_; }
  /// Sum of all steps, s: a time that never runs backwards.
  double elapsed() const noexcept { return elapsed_; }
  /// The cycle since `time.last`, which moves on to the present.
  Cycle since(CycleTime& time) const noexcept {
    const double step = std::clamp(elapsed_ - time.last, 0.0, max_step_);
    time.last = elapsed_;
    if (step > 0) count(step, time);
    return {step, step > 0 ? step : std::max(time.usual, shortest)};
  }
  /// Ten stamps in a row did not change, or were further ahead than max_step.
  bool stalled() const noexcept { return unchanged_ >= stalled_after || ahead_ >= stalled_after; }
  /// How many stamps went backwards or further ahead than max_step.
  long irregular() const noexcept { return irregular_; }
  /// As given at construction.
  double max_step() const noexcept { return max_step_; }

 private:
  static constexpr double shortest = 1e-4;  // s, of a usual cycle

  // A mean over some 30 steps; the first one at once.
  static void count(double step, CycleTime& time) noexcept {
    if (!time.regular && !(step > 0)) return;
    time.usual += (time.regular ? 1.0 / 32 : 1.0) * (step - time.usual);
    time.regular = true;
  }

  double max_step_;
  double last_{0}, step_{0}, elapsed_{0}, owed_{0};
  CycleTime time_;
  int unchanged_{0}, ahead_{0};
  long irregular_{0};
  bool started_{false};
};

}  // namespace icat
