// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The last value received from outside, and its time of arrival. If an input is lost, late or
/// damaged, the value before stays, and its age grows.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

namespace icat {

/// See the file comment. No allocation but the value's own.
template <class T>
struct Received {
  T value{};  ///< as it came; T{} before the first one
  double time{
      -std::numeric_limits<double>::infinity()};  ///< s, on the caller's clock: when it came
  std::uint32_t count{0};                         ///< how many came; wraps around

  /// A new value, which came at `now`, s.
  void put(const T& received, double now) noexcept {
    value = received;
    time = now;
    ++count;
  }
  /// s at `now`; infinite before the first value.
  double age(double now) const noexcept { return now - time; }
  /// Whether the time of arrival differs from `now` by at most `limit`, s: after a clock was set
  /// back a value from after `now` is as doubtful as an old one. False where either is NaN.
  bool fresh(double now, double limit) const noexcept { return std::abs(age(now)) <= limit; }
};

}  // namespace icat
