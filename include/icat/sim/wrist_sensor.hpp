// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A wrist force/torque sensor with N signals, noise and drift; ours, [MARIS, II-C3] prints no
/// numbers:
///
///     V = S w + V₀ + d + σ n,    d a random walk of σ_d √s
#pragma once

#include <cmath>
#include <cstdint>

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/math/spatial_algebra.hpp"
#include "icat/sim/noise.hpp"

namespace icat {

/// See the file comment. Signals in volts, say.
template <class ScalarType, int N>
class WristSensor {
 public:
  /// Scalar type.
  using Scalar = ScalarType;
  /// What it is.
  struct Options {
    Eigen::Matrix<Scalar, N, 6> sensitivity;  ///< S, V/N and V/(N m)
    Vector<Scalar, N> zero = Filled{0};       ///< V₀
    double noise = 0.001;                     ///< σ of each signal, V
    double drift = 1e-5;                      ///< σ_d, V/√s
    std::uint64_t seed = 6;                   ///< of both
  };

  /// @throws std::invalid_argument on what is not finite or a deviation below 0.
  explicit WristSensor(const Options& options) : options_(options), noise_(options.seed) {
    if (!detail::all_finite(options.sensitivity) || !detail::all_finite(options.zero)) {
      detail::invalid("WristSensor: sensitivity and zero must be finite");
    }
    for (const double x : {options.noise, options.drift}) {
      if (!(x >= 0) || !std::isfinite(x)) {
        detail::invalid("WristSensor: a deviation must be finite and >= 0, got ", x);
      }
    }
  }

  /// `wrench` [N; N m] on the sensor, `dt` s, >= 0, after the last time. What is not finite is
  /// refused, the signal stays. No allocation.
  Status measure(const Vector6<Scalar>& wrench, double dt) noexcept {
    if (!detail::all_finite(wrench) || !std::isfinite(dt)) return Status::non_finite;
    if (dt < 0) return Status::time_reversed;
    for (Index i = 0; i < N; ++i) {
      drift_(i) += static_cast<Scalar>(options_.drift * std::sqrt(dt) * noise_.normal());
      Scalar sum = options_.zero(i) + drift_(i);
      for (Index k = 0; k < 6; ++k) sum += options_.sensitivity(i, k) * wrench(k);
      signal_(i) = sum + static_cast<Scalar>(options_.noise * noise_.normal());
    }
    return Status::ok;
  }
  /// V of the last measurement.
  const Vector<Scalar, N>& signal() const noexcept { return signal_; }

 private:
  Options options_;
  Noise noise_;
  Vector<Scalar, N> drift_ = Filled{0}, signal_ = Filled{0};
};

}  // namespace icat
