// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Random numbers that are the same everywhere: the standard fixes the 64-bit numbers of
/// `std::mt19937_64` and leaves its distributions to each library. Normal ones by Box and Muller,
///
///     √(−2 ln u₁) cos(2π u₂),  √(−2 ln u₁) sin(2π u₂)
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "icat/core/types.hpp"

namespace icat {

/// The same numbers for the same seed, up to the rounding of sine and logarithm. No allocation.
class Noise {
 public:
  /// Another seed, other numbers.
  explicit Noise(std::uint64_t seed) : random_(seed) {}

  /// In [0, 1).
  double uniform() noexcept { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  /// Of mean 0 and deviation 1.
  double normal() noexcept {
    if (spare_there_) {
      spare_there_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    const double angle = 2 * std::numbers::pi * uniform();
    spare_ = radius * std::sin(angle);
    spare_there_ = true;
    return radius * std::cos(angle);
  }
  /// `N` of them, of this deviation.
  template <class Scalar, int N>
  Vector<Scalar, N> vector(double deviation) noexcept {
    Vector<Scalar, N> v;
    for (Index i = 0; i < N; ++i) v(i) = static_cast<Scalar>(deviation * normal());
    return v;
  }

 private:
  std::mt19937_64 random_;
  double spare_{0};
  bool spare_there_{false};
};

}  // namespace icat
