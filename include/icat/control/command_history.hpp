// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The velocities commanded recently, for the prediction of the motion that they cause.
#pragma once

#include <algorithm>

#include "icat/core/list.hpp"
#include "icat/core/types.hpp"

namespace icat::detail {

/// Velocities of `n` columns, each with the time it was in force, as far back as `window` s.
/// Construction allocates; nothing else does.
class CommandHistory {
 public:
  /// Of nothing.
  CommandHistory() : CommandHistory(0, 0) {}
  [[gnu::cold]] CommandHistory(Index n, double window)
      : size_(static_cast<std::size_t>(n) + 1),
        // Two that follow each other last longer than `shortest` together.
        entries_(size_ * (2 * static_cast<std::size_t>(window / shortest) + 4)) {}

  /// `velocity` was in force for `duration` s, and is the newest.
  template <class V>
  void push(const V& velocity, double duration) noexcept {
    if (!(duration > 0)) return;
    const double before = entries_[newest_], together = before + duration;
    // Faster loops than 1 kHz share an entry, so that the memory is bounded.
    const bool shared = before > 0 && together <= shortest;
    if (!shared) newest_ = newest_ + size_ < entries_.size() ? newest_ + size_ : 0;
    double* entry = entries_.data() + newest_;
    entry[0] = shared ? together : duration;
    for (std::size_t i = 1; i < size_; ++i) {
      const double v = static_cast<double>(velocity(static_cast<Index>(i - 1)));
      entry[i] = shared ? entry[i] + duration / together * (v - entry[i]) : v;
    }
  }
  /// Calls `f(velocity, duration)` for what was in force during the last `window` s, from the
  /// newest back; `velocity` points to n numbers.
  template <class F>
  void from_newest(double window, F f) const noexcept {
    std::size_t k = newest_;
    for (std::size_t i = 0; i < entries_.size() && window > 0; i += size_) {
      const double duration = std::min(entries_[k], window);
      if (!(duration > 0)) return;
      f(entries_.data() + k + 1, duration);
      window -= duration;
      k = k > 0 ? k - size_ : entries_.size() - size_;
    }
  }

 private:
  static constexpr double shortest = 1e-3;  // s

  std::size_t size_{1}, newest_{0};
  List<double> entries_;  // duration and velocity, one after the other
};

}  // namespace icat::detail
