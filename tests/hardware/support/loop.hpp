// SPDX-License-Identifier: BSD-3-Clause
// A control loop against a peer, timed: what the tests of tests/hardware share.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

#include "tests/support/allocation_counter.hpp"

namespace hardware {

/// s, monotonic.
inline double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// How long a loop runs against its peer, s: 10, or ICAT_LOOP_SECONDS.
inline double loop_seconds() {
  const char* seconds = std::getenv("ICAT_LOOP_SECONDS");
  return seconds ? std::atof(seconds) : 10;
}

/// Latencies in s, kept without allocation up to the size given.
class Latencies {
 public:
  explicit Latencies(std::size_t most) { values_.reserve(most); }
  void add(double seconds) {
    if (values_.size() < values_.capacity()) values_.push_back(seconds);
  }
  std::size_t size() const { return values_.size(); }
  /// 0.5 is the median, 1 the largest; infinite where there is none.
  double quantile(double q) const {
    if (values_.empty()) return 1.0 / 0.0;
    std::vector<double> sorted = values_;
    std::sort(sorted.begin(), sorted.end());
    return sorted[static_cast<std::size_t>(q * static_cast<double>(sorted.size() - 1) + 0.5)];
  }
  /// One line: what the documentation cites.
  void print(const char* what, double rate, double seconds, long allocations_made) const {
    std::printf(
        "%s: %.0f Hz for %.0f s: latency p50 %.2f ms, p99 %.2f ms, max %.2f ms (%zu); "
        "allocations on our side: %ld\n",
        what, rate, seconds, 1e3 * quantile(0.5), 1e3 * quantile(0.99), 1e3 * quantile(1), size(),
        allocations_made);
  }

 private:
  std::vector<double> values_;
};

/// Calls `cycle(time)` at `rate`, Hz, for `seconds`. Returns the allocations that the calls made in
/// this thread.
template <class Cycle>
long run_loop(double rate, double seconds, Cycle cycle) {
  using Clock = std::chrono::steady_clock;
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / rate));
  const long cycles = static_cast<long>(seconds * rate + 0.5);
  long made = 0;
  auto next = Clock::now();
  for (long k = 0; k < cycles; ++k) {
    std::this_thread::sleep_until(next);
    next += period;
    const long start = allocations;
    cycle(now());
    made += allocations - start;
  }
  return made;
}

}  // namespace hardware
