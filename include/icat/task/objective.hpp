// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Control objectives: equality or inequality on a scalar x, their activation and reference point.
///
///     x = x₀           aⁱ = 1,                                            x* = x₀
///     x ≤ x_M          aⁱ = s((x − (x_M − β)) / β)   [Coop, Eq. (18)]     x* = x_M − β
///     x ≥ x_m          aⁱ = s(((x_m + β) − x) / β)   [MARIS, Eq. (16)]    x* = x_m + β
///     x_m ≤ x ≤ x_M    the sum of the two            [Coop, III-C]        x* = (x_m + x_M) / 2
///
/// with s the smooth step. The reference rate is ẋ̄ = γ (x* − x) [Coop, Eq. (8), (9)]; x* may be
/// replaced by any point where the inequality holds.
#pragma once

#include <cmath>
#include <limits>

#include "icat/core/error.hpp"
#include "icat/math/smooth_step.hpp"

namespace icat {

/// One scalar objective, see the file comment. Immutable; only construction throws.
template <class Scalar>
class Objective {
 public:
  /// x = `value`.
  static Objective equal_to(Scalar value) {
    if (!std::isfinite(value)) detail::invalid("Objective: value must be finite, got ", value);
    Objective o;
    o.equality_ = true;
    o.target_ = value;
    return o;
  }
  /// x ≤ `maximum`, active from `maximum − margin` on. All throw unless `margin` (β) is > 0.
  static Objective at_most(Scalar maximum, Scalar margin) {
    return Objective(-infinity, maximum, margin);
  }
  /// x ≥ `minimum`, active up to `minimum + margin`.
  static Objective at_least(Scalar minimum, Scalar margin) {
    return Objective(minimum, infinity, margin);
  }
  /// `minimum` ≤ x ≤ `maximum`; either may be infinite. Throws unless
  /// minimum + margin < maximum − margin.
  static Objective between(Scalar minimum, Scalar maximum, Scalar margin) {
    return Objective(minimum, maximum, margin);
  }

  /// The same objective with another reference point x*, which must satisfy it.
  Objective toward(Scalar target) const {
    if (equality_ || !(target >= lower_ && target <= upper_)) {
      detail::invalid("Objective: reference point ", target, " is outside [", lower_, ", ", upper_,
                      "]");
    }
    Objective o = *this;
    o.target_ = target;
    return o;
  }

  /// aⁱ(x), in [0, 1]; NaN for NaN.
  Scalar activation(Scalar x) const noexcept {
    if (equality_) return Scalar(1);
    return smooth_step((x - upper_) / margin_ + Scalar(1)) +
           smooth_step((lower_ - x) / margin_ + Scalar(1));
  }
  /// x*.
  Scalar target() const noexcept { return target_; }
  /// Whether the objective holds at x.
  bool satisfied(Scalar x) const noexcept {
    return equality_ ? x == target_ : x >= lower_ && x <= upper_;
  }

 private:
  static constexpr Scalar infinity = std::numeric_limits<Scalar>::infinity();

  Objective() = default;
  Objective(Scalar lower, Scalar upper, Scalar margin)
      : lower_(lower), upper_(upper), margin_(margin) {
    detail::require_positive("Objective", "margin", margin);
    if (!(lower + margin < upper - margin) || lower == infinity || upper == -infinity) {
      detail::invalid("Objective: no room between minimum ", lower, " and maximum ", upper,
                      " for two margins of ", margin);
    }
    const bool has_lower = std::isfinite(lower), has_upper = std::isfinite(upper);
    target_ = has_lower && has_upper ? (lower + upper) / Scalar(2)
              : has_upper            ? upper - margin
              : has_lower            ? lower + margin
                                     : Scalar(0);
  }

  bool equality_{false};
  Scalar lower_{-infinity}, upper_{infinity}, margin_{1}, target_{0};
};

}  // namespace icat
