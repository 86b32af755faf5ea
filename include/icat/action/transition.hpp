// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Phase activations aᵖ of [Coop, Eq. (17)] and how they move from one action to the next.
///
///     aᵖ(t) = a_start + (a_target − a_start) s((t − t₀) / T)
///
/// `a_start` is the value at the time of the switch, whatever it is, so a switch may be reversed or
/// redirected half-way without a jump. Time is the caller's, in seconds, as `double` whatever the
/// scalar type of the robot.
#pragma once

#include <cmath>
#include <span>

#include "icat/core/list.hpp"
#include "icat/core/status.hpp"
#include "icat/core/types.hpp"
#include "icat/math/smooth_step.hpp"

namespace icat {

/// Values in [0, 1] that move together from what they are to new targets.
class Transition {
 public:
  /// `count` activations, all 0. Allocates; nothing else here does.
  explicit Transition(std::size_t count) : start_(count), target_(count), value_(count) {}

  /// Number of activations.
  std::size_t count() const noexcept { return value_.size(); }

  /// All values at once, for the start of a mission: there is nothing to be continuous with.
  Status set(std::span<const double> values, double now) noexcept {
    if (const Status status = check(values); status != Status::ok) return status;
    if (!std::isfinite(now)) return Status::non_finite;
    for (std::size_t i = 0; i < count(); ++i) start_[i] = target_[i] = value_[i] = values[i];
    begin_ = -infinity<double>;  // long over
    now_ = now;
    return Status::ok;
  }

  /// From the present values to `targets` (in [0, 1]) over `duration` seconds from `now` on.
  Status start(std::span<const double> targets, double now, double duration) noexcept {
    if (const Status status = check(targets); status != Status::ok) return status;
    if (const Status status = check(now, duration); status != Status::ok) return status;
    (void)update(now);
    for (std::size_t i = 0; i < count(); ++i) {
      start_[i] = value_[i];
      target_[i] = targets[i];
    }
    begin_ = now;
    duration_ = duration;
    return Status::ok;
  }

  /// What `start` would say of a time and a duration.
  Status check(double now, double duration) const noexcept {
    if (!(duration > 0.0) || !std::isfinite(duration)) return Status::invalid_duration;
    if (!std::isfinite(now)) return Status::non_finite;
    return now < now_ ? Status::time_reversed : Status::ok;
  }

  /// Values at time `now`, which may stand still but not run backwards.
  Status update(double now) noexcept {
    if (!std::isfinite(now)) return Status::non_finite;
    if (now < now_) return Status::time_reversed;
    now_ = now;
    const double s = smooth_step((now - begin_) / duration_);
    for (std::size_t i = 0; i < count(); ++i) {
      // As a convex combination it stays in [0, 1] and ends on the target exactly.
      value_[i] = (1.0 - s) * start_[i] + s * target_[i];
      if (value_[i] > 1.0) value_[i] = 1.0;
    }
    return Status::ok;
  }

  /// The present activations.
  std::span<const double> values() const noexcept { return {value_.data(), count()}; }
  /// The last transition is over.
  bool finished() const noexcept { return now_ >= begin_ + duration_; }

 private:
  Status check(std::span<const double> values) const noexcept {
    if (values.size() != count()) return Status::wrong_size;
    for (const double a : values) {
      if (!(a >= 0.0 && a <= 1.0)) return Status::activation_out_of_range;
    }
    return Status::ok;
  }

  List<double> start_, target_, value_;
  double begin_{-infinity<double>}, duration_{1}, now_{-infinity<double>};
};

}  // namespace icat
