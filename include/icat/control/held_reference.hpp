// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Holds the newest reference for the loop that follows it: v̄ for the vehicle's velocity loop, q̇
/// for the drives of the arm, which run faster than the controller [MARIS, III-B9]. The time-out is
/// ours: a reference that is older than `hold` goes to zero over `ramp`, and returns over `ramp`
/// (command_ramp.hpp). The first one fades in over `ramp`, too.
#pragma once

#include "icat/control/command_ramp.hpp"
#include "icat/math/spatial_algebra.hpp"

namespace icat {

/// See the file comment. Construction allocates and throws; nothing else does.
template <class Scalar, int N>
class HeldReference {
 public:
  /// The reference.
  using VectorN = Vector<Scalar, N>;

  /// Zero until the first `set`. `hold` has to be longer than the period of `set`.
  /// @throws std::invalid_argument on times that are not finite and > 0, or no size.
  [[gnu::cold]] explicit HeldReference(const TimeOptions& options = {}, Index size = N)
      : hold_(options.hold),
        fade_(options.ramp),
        clock_(options.max_step),
        ramp_(checked(size), options),
        held_(detail::zeros<VectorN>(size)),
        value_(held_) {}

  /// A new reference. A value that is not finite or of another size is refused: the one before
  /// stays, and its age grows.
  Status set(const VectorN& reference) noexcept {
    if (reference.size() != held_.size()) return Status::wrong_size;
    if (!detail::all_finite(reference)) return Status::non_finite;
    detail::copy(reference, held_);
    ramp_.resume(fade_, value_, 0);  // from zero; does nothing after the first
    age_ = 0;
    return Status::ok;
  }
  /// A cycle of the reader at `time`, s. `stale_reference`: it is on its way to zero, or there;
  /// so it is where the time is at fault.
  Status update(double time) noexcept {
    Status status = clock_.advance(time);
    const Cycle cycle = clock_.since(time_);
    age_ += status == Status::ok ? cycle.step : cycle.usual;
    if (status == Status::ok && clock_.stalled()) status = Status::clock_stalled;
    // A billionth of a second late counts as in time: times are sums of steps.
    if (status == Status::ok && !(age_ <= hold_ + 1e-9)) status = Status::stale_reference;
    ramp_.update(status, cycle);
    detail::copy(ramp_.wanted(held_), value_);
    return status;
  }
  /// The reference to follow.
  const VectorN& value() const noexcept { return value_; }
  /// Of the reference, s; infinite before the first.
  double age() const noexcept { return age_; }

 private:
  static Index checked(Index size) {
    if (size < 1) detail::invalid("HeldReference: needs a component at least, got ", size);
    return size;
  }

  double hold_, fade_, age_{infinity<double>};
  StepClock clock_;
  CycleTime time_;
  detail::CommandRamp<Scalar, N> ramp_;
  VectorN held_, value_;
};

}  // namespace icat
