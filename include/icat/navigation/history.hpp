// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What was estimated during the last half second, for measurements that come late.
///
/// A measurement of age a is compared with the estimate of a seconds ago; what it corrects there is
/// corrected here and in all of the history, as an error that has lasted from then until now. That
/// is exact for a constant error, and for 0.2 s of a velocity whose errors last seconds it is
/// nearly so; the estimator counts as new what has come to the error since. To go back and repeat
/// all steps since would take a time that depends on the delay.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "icat/core/status.hpp"
#include "icat/core/types.hpp"
#include "icat/math/rigid_motion.hpp"

namespace icat::detail {

/// On the line from `a` to `b`.
template <class Scalar>
Vector3<Scalar> between(const Vector3<Scalar>& a, const Vector3<Scalar>& b, Scalar share) noexcept {
  return plus(a, share, minus(b, a));
}
/// On the shortest turn from `a` to `b`, which is that of a constant rate up to half a turn;
/// element by element between them lies no rotation.
template <class Scalar>
Matrix3<Scalar> between(const Matrix3<Scalar>& a, const Matrix3<Scalar>& b, Scalar share) noexcept {
  const Vector3<Scalar> turn = rotation_log<Scalar>(times(transpose(a), b));
  return times(a, rotation_exp<Scalar>(scaled(turn, share)));
}

/// A ring of vectors or rotations.
template <class Value>
class History {
 public:
  /// Oldest measurement, s.
  static constexpr double length = 0.5;

  /// `value` was there at `time`, s, not decreasing. Kept every 10 ms at most.
  void record(double time, const Value& value) noexcept {
    if (count_ > 0 && time - times_[newest_] < 0.009) return;
    newest_ = (newest_ + 1) % size;
    if (count_ < size) ++count_;
    times_[newest_] = time;
    values_[newest_] = value;
  }

  /// The value at `time`, between its neighbours; `present` at `now`.
  Value at(double time, double now, const Value& present) const noexcept {
    const Value* later = &present;
    double later_time = now;
    for (std::size_t k = 0; k < count_; ++k) {
      const std::size_t i = (newest_ + size - k) % size;
      if (times_[i] <= time) {
        const double span = later_time - times_[i];
        const auto share =
            static_cast<typename Value::Scalar>(span > 0 ? (time - times_[i]) / span : 1.0);
        return between(values_[i], *later, share);
      }
      later = &values_[i];
      later_time = times_[i];
    }
    return *later;  // before all that is known
  }

  /// `f(value)` for all of them.
  template <class F>
  void for_each(F&& f) noexcept {
    for (std::size_t k = 0; k < count_; ++k) f(values_[(newest_ + size - k) % size]);
  }

 private:
  static constexpr std::size_t size = 64;  // 9 ms each: more than `length`

  std::array<Value, size> values_{};
  std::array<double, size> times_{};
  std::size_t newest_{0}, count_{0};
};

/// Whether a measurement of this age can be used. A microsecond from the future counts as now:
/// stamps are rounded.
inline Status check_age(double& age) noexcept {
  if (!std::isfinite(age)) return Status::non_finite;
  if (age < -1e-6) return Status::time_reversed;
  age = std::max(age, 0.0);
  return age > History<Vector<double, 1>>::length ? Status::late_measurement : Status::ok;
}

}  // namespace icat::detail
