// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A measurement that comes at its own rate: taken in the slots k / rate, k = 0, 1, …, held
/// between.
#pragma once

#include <cmath>

#include "icat/core/error.hpp"

namespace icat {

namespace detail {

/// Index of the last slot k / rate that has come at `time`. A millionth of a slot early counts:
/// times that are sums of steps fall short by rounding. −1 for a time that is not finite.
inline long long slot_at(double time, double rate) noexcept {
  const double slot = std::floor(time * rate + 1e-6);
  return std::abs(slot) < 9e15 ? static_cast<long long>(slot) : -1;
}

}  // namespace detail

/// Such as the vehicle's velocity from a DVL, at 100 or 10 Hz [Coop, V-B].
template <class Value>
class SampleHold {
 public:
  /// @param rate     Hz
  /// @param initial  held before the first sample
  /// @throws std::invalid_argument unless the rate is finite and > 0.
  SampleHold(double rate, const Value& initial) : rate_(rate), held_(initial) {
    detail::require_positive("SampleHold", "rate", rate);
  }

  /// What is held at `time` (s, not decreasing), after `value`, which is the truth at this time,
  /// was sampled if a slot has come since the last call. Copies `value`, allocates nothing else.
  const Value& update(double time, const Value& value) noexcept {
    const long long slot = detail::slot_at(time, rate_);
    if (slot > slot_) {
      slot_ = slot;
      held_ = value;
    }
    return held_;
  }

 private:
  double rate_;
  Value held_;
  long long slot_{-1};
};

}  // namespace icat
