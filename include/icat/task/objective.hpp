// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Control objectives: equality or inequality on a scalar x, their activation and reference point.
///
///     x = x₀           aⁱ = 1,                                            x* = x₀
///     x ≤ x_M          aⁱ = s((x − (x_M − β)) / β)   [Coop, Eq. (18)]     x* = min(x, x_M − β)
///     x ≥ x_m          aⁱ = s(((x_m + β) − x) / β)   [MARIS, Eq. (16)]    x* = max(x, x_m + β)
///     x_m ≤ x ≤ x_M    the sum of the two            [Coop, III-C]        x* = both
///
/// with s the smooth step. The reference rate is ẋ̄ = γ (x* − x) [Coop, Eq. (8), (9)]. x* is the
/// near edge of the inactive range, where aⁱ = 0: the task moves out of the margin and no further.
/// `toward` sets one point inside instead [Coop, III-C, Remark].
#pragma once

#include <cmath>

#include "icat/core/error.hpp"
#include "icat/core/list.hpp"
#include "icat/core/types.hpp"
#include "icat/math/smooth_step.hpp"

namespace icat {

/// One scalar objective, see the file comment. Immutable; only construction throws.
template <class Scalar>
class Objective {
 public:
  /// x = `value`.
  static Objective equal_to(Scalar value) {
    require_finite("value", value);
    Objective o;
    o.equality_ = o.fixed_target_ = true;
    o.target_ = o.lower_ = o.upper_ = value;
    return o;
  }
  /// x ≤ `maximum`, active from `maximum − margin` on. All throw unless `margin` (β) is > 0.
  static Objective at_most(Scalar maximum, Scalar margin) {
    require_finite("maximum", maximum);
    return Objective(-infinity<Scalar>, maximum, margin);
  }
  /// x ≥ `minimum`, active up to `minimum + margin`.
  static Objective at_least(Scalar minimum, Scalar margin) {
    require_finite("minimum", minimum);
    return Objective(minimum, infinity<Scalar>, margin);
  }
  /// `minimum` ≤ x ≤ `maximum`; either may be infinite. Throws unless
  /// minimum + margin < maximum − margin.
  static Objective between(Scalar minimum, Scalar maximum, Scalar margin) {
    return Objective(minimum, maximum, margin);
  }

  /// The same objective with another reference point x*, which must satisfy it.
  Objective toward(Scalar target) const {
    if (equality_ || !(target >= lower_ && target <= upper_) || !std::isfinite(target)) {
      detail::invalid("Objective: reference point ", target, " is outside [", lower_, ", ", upper_,
                      "]");
    }
    Objective o = *this;
    o.target_ = target;
    o.fixed_target_ = true;
    return o;
  }

  /// aⁱ(x), in [0, 1]; NaN for NaN.
  Scalar activation(Scalar x) const noexcept {
    if (equality_) return Scalar(1);
    return smooth_step((x - upper_) / margin_ + Scalar(1)) +
           smooth_step((lower_ - x) / margin_ + Scalar(1));
  }
  /// x*, for x where it depends on it.
  Scalar target(Scalar x) const noexcept {
    if (fixed_target_) return target_;
    const Scalar low = lower_ + margin_, high = upper_ - margin_;
    return x < low ? low : x > high ? high : x;
  }
  /// The smallest x at which the objective holds; −∞ where there is none.
  Scalar lower() const noexcept { return lower_; }
  /// The largest x at which the objective holds; ∞ where there is none.
  Scalar upper() const noexcept { return upper_; }
  /// Whether the objective holds at x.
  bool satisfied(Scalar x) const noexcept { return x >= lower_ && x <= upper_; }

 private:
  friend class List<Objective>;
  Objective() = default;
  Objective(Scalar lower, Scalar upper, Scalar margin)
      : lower_(lower), upper_(upper), margin_(margin) {
    detail::require_positive("Objective", "margin", margin);
    if (!(lower + margin < upper - margin) || lower == infinity<Scalar> ||
        upper == -infinity<Scalar>) {
      detail::invalid("Objective: no room between minimum ", lower, " and maximum ", upper,
                      " for two margins of ", margin);
    }
  }
  static void require_finite(const char* what, Scalar value) {
    if (!std::isfinite(value)) {
      detail::invalid("Objective: ", what, " must be finite, got ", value);
    }
  }

  bool equality_{false}, fixed_target_{false};
  Scalar lower_{-infinity<Scalar>}, upper_{infinity<Scalar>}, margin_{1}, target_{0};
};

}  // namespace icat
