// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Starting, stopping, and refused input: the share of the solver's velocity that is commanded.
///
///     wanted = f · ((1 − s) · what was commanded when the ramp began + s · aim)
///
/// s goes from 0 to 1; the aim is the solver's answer, or zero after `stop`. From rest that is s
/// times the answer: the activations are all in place, so the order of priorities holds from the
/// first cycle. f goes to 0 while input is refused for longer than `hold`, and back to 1. f is
/// continuous, the answer is not: with the first input after a gap it jumps from its value before
/// the gap to the present solution, and the command by f times this jump. After `hold` + `ramp` f
/// is 0. Blending the two would command the old answer for longer; acceleration limits bound the
/// jump.
#pragma once

#include <algorithm>

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/core/step_clock.hpp"
#include "icat/core/types.hpp"
#include "icat/math/smooth_step.hpp"

namespace icat {

/// How old the inputs of a cycle are, s; NaN counts as too old.
struct InputAge {
  double state{0};     ///< of the robot, or of its joints where the base's pose has its own
  double velocity{0};  ///< that was measured
  double pose{0};      ///< of the base
};

/// Time limits of a controller for missing, late or refused input.
struct TimeOptions {
  double max_step{0.1};  ///< longest period of the loop, s, > 0; see StepClock
  double hold{0.1};      ///< s, > 0: after so long a fault, and for inputs of this age, it stops
  double ramp{0.5};      ///< s, > 0: then the command goes to zero, and back when all is well
};

namespace detail {

/// Which part of the state is older than `hold`, of both the older one; or `ok`.
inline Status check_age(const InputAge& age, double hold) noexcept {
  if (!(age.state <= hold) && !(age.pose > age.state)) return Status::stale_state;
  return age.pose <= hold ? Status::ok : Status::stale_pose;
}

/// What has lasted already when it is told: there is no point in holding on.
constexpr bool is_lasting(Status status) noexcept {
  return status == Status::clock_stalled || status == Status::stale_state ||
         status == Status::stale_pose || status == Status::stale_velocity ||
         status == Status::stale_reference || status == Status::implausible_position;
}

/// See the file comment. Construction allocates and throws; nothing else does.
template <class Scalar, int N>
class CommandRamp {
 public:
  using Velocity = Vector<Scalar, N>;

  [[gnu::cold]] CommandRamp(Index n, const TimeOptions& options)
      : hold_(options.hold), ramp_(options.ramp), from_(zeros<Velocity>(n)), wanted_(from_) {
    require_positive("the controller", "hold", hold_);
    require_positive("the controller", "ramp", ramp_);
  }

  /// At once, what the solver answers.
  void start() noexcept { aim(true, 0, from_, 0); }
  /// From `command` to what the solver answers; nothing changes where that is the aim already.
  /// `pending`: s since the last cycle, which the next one brings.
  void resume(double duration, const Velocity& command, double pending) noexcept {
    if (!runs_) aim(true, duration, command, pending);
  }
  /// From `command` to zero. Said again it may end earlier, not later.
  void stop(double duration, const Velocity& command, double pending) noexcept {
    if (runs_ || duration < duration_ - elapsed_) aim(false, duration, command, pending);
  }
  /// What is commanded in column `c` is none of this object's any more.
  void forget(Index c) noexcept { from_(c) = Scalar(0); }

  /// The outcome of a cycle. While input is refused time passes as usual, whatever the stamps say.
  void update(Status status, Cycle cycle) noexcept {
    status_ = status;
    elapsed_ += status == Status::ok ? cycle.step : cycle.usual;
    fault_ = status == Status::ok ? 0 : fault_ + cycle.usual;
    const bool down = status != Status::ok && (is_lasting(status) || fault_ > hold_);
    if (down) good_ = std::max(good_ - cycle.usual / ramp_, 0.0);
    if (status == Status::ok) good_ = std::min(good_ + cycle.step / ramp_, 1.0);
  }
  /// Wanted for the solver's `answer`, n.
  [[gnu::noinline]] const Velocity& wanted(const Velocity& answer) noexcept {
    const Scalar s = static_cast<Scalar>(share()), f = static_cast<Scalar>(gain());
    for (Index i = 0; i < from_.size(); ++i) {
      const Scalar aim = runs_ ? answer(i) : Scalar(0);
      wanted_(i) = s < Scalar(1) ? (Scalar(1) - s) * from_(i) + s * aim : aim;
      if (f < Scalar(1)) wanted_(i) *= f;
    }
    return wanted_;
  }
  /// What the last `wanted` answered, n.
  const Velocity& last_wanted() const noexcept { return wanted_; }
  /// Of the last `update`.
  Status status() const noexcept { return status_; }
  /// s.
  double share() const noexcept { return duration_ > 0 ? smooth_step(elapsed_ / duration_) : 1; }
  /// f.
  double gain() const noexcept { return smooth_step(good_); }
  /// What was commanded when the ramp began, n.
  const Velocity& from() const noexcept { return from_; }
  /// The aim is the solver's answer.
  bool runs() const noexcept { return runs_; }
  /// Nothing is commanded, or soon will not be.
  bool rests() const noexcept { return !runs_ || !(good_ > 0); }
  /// Nothing fades.
  bool settled() const noexcept { return share() >= 1 && good_ >= 1; }

 private:
  [[gnu::noinline]] void aim(bool run, double duration, const Velocity& command,
                             double pending) noexcept {
    runs_ = run;
    duration_ = duration;
    elapsed_ = -pending;
    for (Index i = 0; i < from_.size(); ++i) from_(i) = command(i);
  }

  double hold_, ramp_, elapsed_{0}, duration_{0}, fault_{0}, good_{1};
  bool runs_{false};
  Status status_{Status::not_started};
  Velocity from_, wanted_;
};

}  // namespace detail
}  // namespace icat
