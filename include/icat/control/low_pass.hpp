// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// First-order low-pass filter of a vector, discretized exactly for an input held over the step:
///
///     τ ẏ = u − y,     y ← y + (1 − exp(−dt/τ)) (u − y)
#pragma once

#include <cmath>

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/core/types.hpp"

namespace icat {

/// `N` components with one time constant.
template <class Scalar, int N>
class LowPass {
 public:
  /// Input and output.
  using VectorN = Vector<Scalar, N>;

  /// @param time_constant  τ, s; 0 lets everything through
  /// @param initial        the output before the first update
  /// @throws std::invalid_argument unless τ and `initial` are finite and τ >= 0.
  explicit LowPass(double time_constant, const VectorN& initial = Filled{0})
      : time_constant_(time_constant), value_(initial) {
    if (!(time_constant >= 0) || !std::isfinite(time_constant)) {
      detail::invalid("LowPass: time_constant must be finite and >= 0, got ", time_constant);
    }
    if (!initial.allFinite()) detail::invalid("LowPass: the initial value is not finite");
  }

  /// `input` was there for `dt` s, >= 0. What is not finite is refused, the output stays. No
  /// allocation.
  Status update(const VectorN& input, double dt) noexcept {
    if (!input.allFinite() || !std::isfinite(dt)) return Status::non_finite;
    if (dt < 0) return Status::time_reversed;
    const Scalar keep =
        time_constant_ > 0 ? static_cast<Scalar>(std::exp(-dt / time_constant_)) : Scalar(0);
    value_ = keep * value_ + (Scalar(1) - keep) * input;
    return Status::ok;
  }

  /// y.
  const VectorN& value() const noexcept { return value_; }
  /// Starts anew from `value`.
  void reset(const VectorN& value) noexcept { value_ = value; }

 private:
  double time_constant_;
  VectorN value_;
};

}  // namespace icat
