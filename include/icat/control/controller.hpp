// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The kinematic layer: runs actions on a robot and yields the velocity to command, one TPIK over
/// all columns, within the robot's limits.
///
/// Some columns may be *given*: roll and pitch of a vehicle that cannot control them, a joint whose
/// motor failed. Their measured velocity enters [Coop, Eq. (31)], the other columns compensate it,
/// and they are never commanded.
///
/// A cycle: tasks at the robot's state; the box of `MotionLimits`; the solver's answer within it;
/// starting and stopping (command_ramp.hpp); the limits. The base is limited first, and the joints
/// are solved for its limited velocity.
#pragma once

#include "icat/control/action_solver.hpp"
#include "icat/control/command_ramp.hpp"
#include "icat/control/motion_limits.hpp"

namespace icat {

namespace detail {

template <class C>
struct Inside;  // what explains a controller reads it: see explain.hpp

/// No step may be longer than the reaction that the limits count on.
template <class Options>
double longest_step(const Options& options) noexcept {
  const double T =
      options.limits.dof() > 0 ? options.limits.reaction_time() : options.time.max_step;
  return std::min(options.time.max_step, T);
}

/// The columns of a robot's base; none where there is none.
template <Robot R>
ColumnRange base_columns(const R& robot) {
  if constexpr (MobileRobot<R>) return robot.base_columns();
  return {};
}

}  // namespace detail

/// Controls a robot whose state the caller keeps up to date before each step. The robot, the tasks
/// and this object belong to one thread. After construction nothing allocates or throws.
template <Robot R, class Regularization = BellRegularization<typename R::Scalar>>
class Controller {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// What solves.
  using Actions = ActionSolver<R, Regularization>;
  /// The solver.
  using Solver = typename Actions::Solver;
  /// ẏ, n.
  using Velocity = typename Solver::VectorN;

  /// Settings, with defaults.
  struct Options {
    Columns given{};                    ///< that are not commanded, see the file comment
    typename Solver::Options solver{};  ///< of the TPIK
    MotionLimits<R> limits{};           ///< the robot's own; or `icat::unlimited`
    TimeOptions time{};                 ///< late and bad input
    /// L, m, by which rows in metres are divided for the solver. None: the longest reach of the
    /// tasks' frames, see characteristic_length.hpp. 1: rows as in the papers.
    std::optional<Scalar> characteristic_length = std::nullopt;
  };

  /// Computes the unified hierarchy of `actions`. `robot` and the tasks must outlive this object.
  /// @throws std::invalid_argument on bad options or actions (see `unified_hierarchy`), or a task
  ///         that belongs to another robot.
  [[gnu::cold]] Controller(const R& robot, const std::vector<Action<R>>& actions)
      : Controller(robot, actions, defaults()) {}
  /// The same with options.
  [[gnu::cold]] Controller(const R& robot, const std::vector<Action<R>>& actions, Options options)
      : solver_(robot, actions, options.given, options.solver, detail::longest_step(options),
                options.characteristic_length),
        limits_(options.limits.of(robot, options.time.max_step)),
        ramp_(robot.dof(), options.time),
        hold_(options.time.hold),
        answer_(detail::zeros<Velocity>(robot.dof())),
        measured_(answer_),
        velocity_(answer_) {
    for (const Index c : options.given) limits_.set_given(c, true);
  }
  Controller(R&&, const std::vector<Action<R>>&) = delete;
  Controller(R&&, const std::vector<Action<R>>&, Options) = delete;

  /// Enters `action` at once, without a fade, for a robot that already moves. Time in s, on one
  /// clock.
  Status start(std::string_view action, double time) noexcept {
    const Status status = solver_.start(action, time);
    if (status == Status::ok) ramp_.start();
    return status;
  }
  /// Moves to `action` over `duration` seconds. While the robot is controlled the activations move
  /// from what they are now; also in the middle of another transition, also back. From rest, before
  /// the first action or after `stop`, all activations are in place at once, and the whole command
  /// fades in. If `action` runs or is being entered nothing changes, so it may be called in every
  /// cycle.
  Status switch_to(std::string_view action, double time, double duration) noexcept {
    if (!(duration > 0.0) || !std::isfinite(duration)) return Status::invalid_duration;
    const Status status =
        ramp_.rests() ? solver_.start(action, time) : solver_.switch_to(action, time, duration);
    if (status == Status::ok) ramp_.resume(duration, limits_.command(), pending());
    return status;
  }
  /// The command goes to zero over `duration` seconds, more slowly if acceleration limits require
  /// it, and stays there until `start` or `switch_to`. From any state.
  Status stop(double time, double duration) noexcept {
    if (!(duration > 0.0) || !std::isfinite(duration)) return Status::invalid_duration;
    const Status status = solver_.tick(time);
    if (status == Status::ok) ramp_.stop(duration, limits_.command(), pending());
    return status;
  }
  /// Makes column `column` given, or commanded again. The velocity changes at once.
  Status set_given(Index column, bool given) noexcept {
    if (column < 0 || column >= velocity_.size()) return Status::unknown_joint;
    if (solver_.given(column) != given) limits_.set_given(column, given);
    if (given) ramp_.forget(column);
    solver_.set_given(column, given);
    return Status::ok;
  }
  /// The column comes first.
  template <std::same_as<bool> B>
  Status set_given(B, bool) = delete;
  /// The same for the joint of this name, such as one whose motor failed.
  Status set_given(std::string_view joint, bool given) noexcept requires JointedRobot<R> {
    return set_given(detail::column_of(solver_.robot(), joint), given);
  }

  /// One control cycle; given joints stand still, given columns of the base need the other form. On
  /// bad input:
  /// - a level at fault: the iteration ends above it; its index is in the report, and what has a
  ///   higher priority is still served;
  /// - a time at fault: the solver's answer stays what it was;
  /// - what lasts longer than `hold`, and inputs that are older: the command goes to zero over
  ///   `ramp` seconds, and comes back when all is well.
  /// The velocity is always finite, and within the limits in what may be chosen.
  Status step(double time, InputAge age = {}) noexcept { return run(time, nullptr, age); }
  /// The same with the velocity that is measured, n; only its given columns count. One that is
  /// needed and not finite: `non_finite`.
  Status step(double time, const Velocity& measured, InputAge age = {}) noexcept {
    return run(time, &measured, age);
  }

  /// ẏ; given columns hold what was measured.
  const Velocity& velocity() const noexcept { return velocity_; }
  /// What goes to the back-end: ẏ with zeros in the given columns.
  const Velocity& command() const noexcept { return limits_.command(); }
  /// ẏ of the solver, before starting, stopping and the limits.
  const Velocity& answer() const noexcept { return answer_; }
  /// The limits changed the command from the solver's velocity.
  bool limited() const noexcept { return limited_; }
  /// The box of this cycle and the last command.
  const MotionLimits<R>& limits() const noexcept { return limits_; }
  /// After `implausible_position`: the joint's name; empty: none.
  std::string_view implausible_joint() const noexcept requires JointedRobot<R> {
    return implausible_ < 0 ? std::string_view{}
                            : solver_.robot().joints()[static_cast<std::size_t>(implausible_)].name;
  }

  /// The robot it was built for.
  const R& robot() const noexcept { return solver_.robot(); }
  /// Whether column `column` is given.
  bool given(Index column) const noexcept { return solver_.given(column); }
  /// Name of the action that runs or is being entered; empty before `start`.
  std::string_view action() const noexcept { return solver_.action(); }
  /// Whether there is an action of this name.
  bool has(std::string_view action) const noexcept { return solver_.has(action); }
  /// An action is being entered, or the command fades in, out or back.
  bool in_transition() const noexcept { return solver_.in_transition() || !ramp_.settled(); }
  /// The unified hierarchy of the actions.
  const UnifiedHierarchy<R>& hierarchy() const noexcept { return solver_.hierarchy(); }
  /// aᵖ of every entry of the hierarchy, level by level.
  std::span<const double> phase_activations() const noexcept { return solver_.phase_activations(); }
  /// The levels of `hierarchy` as of the last step.
  std::span<const Level<Scalar, R::size>> levels() const noexcept { return solver_.levels(); }
  /// Of the solver; levels are those of `hierarchy`.
  const TpikReport<Scalar>& report() const noexcept { return solver_.report(); }
  /// L of the rows, m: see `Options`.
  Scalar characteristic_length() const noexcept { return solver_.characteristic_length(); }
  /// What the stamps given so far amount to.
  const StepClock& clock() const noexcept { return solver_.clock(); }

 private:
  // Not inlined: GCC 12 warns where it sees vectors of dynamic size made and destroyed at once.
  [[gnu::noinline, gnu::cold]] static Options defaults() { return Options{}; }

  friend struct detail::Inside<Controller>;

  // Of a stamp without a cycle.
  double pending() const noexcept { return solver_.clock().elapsed() - time_.last; }
  Status run(double time, const Velocity* measured, const InputAge& age) noexcept {
    Status status = solver_.update(time);
    const Cycle now = solver_.clock().since(time_);
    if (status == Status::not_started) return status;
    limits_.update(solver_.robot(), now);
    if (status == Status::ok) status = check(measured, age);
    if (status == Status::ok) {
      (void)solver_.set_bounds(limits_.bounds());
      status = solver_.solve(measured_);
      detail::copy(solver_.velocity(), answer_);
    }
    ramp_.update(status, now);
    apply();
    return status;
  }
  // Whether the inputs are there and are new.
  Status check(const Velocity* measured, const InputAge& age) noexcept {
    if (solver_.clock().stalled()) return Status::clock_stalled;
    if (const Status old = detail::check_age(age, hold_); old != Status::ok) return old;
    implausible_ = limits_.implausible_joint(solver_.robot());
    if (implausible_ >= 0) return Status::implausible_position;
    if (measured && measured->size() != measured_.size()) return Status::wrong_size;
    if (!solver_.any_given()) return Status::ok;
    if (measured && !(age.velocity <= hold_)) return Status::stale_velocity;
    const ColumnRange base = detail::base_columns(solver_.robot());
    for (Index c = 0; c < measured_.size(); ++c) {
      if (!solver_.given(c)) continue;
      if (!measured && base.holds(c)) return Status::missing_velocity;
      const Scalar v = measured ? (*measured)(c) : Scalar(0);
      if (!std::isfinite(v)) return Status::non_finite;
      measured_(c) = v;
    }
    return Status::ok;
  }
  void apply() noexcept {
    const ColumnRange base = detail::base_columns(solver_.robot());
    bool all = limits_.limit_base(ramp_.wanted(answer_));
    if (!all && ramp_.runs() && ramp_.settled() &&
        solver_.solve(measured_, base, limits_.command()) == Status::ok) {
      detail::copy(solver_.velocity(), answer_);
    }
    all = limits_.limit_joints(ramp_.wanted(answer_)) && all;
    limited_ = !all;
    for (Index c = 0; c < velocity_.size(); ++c) {
      velocity_(c) = solver_.given(c) ? measured_(c) : limits_.command()(c);
    }
  }

  Actions solver_;
  MotionLimits<R> limits_;
  detail::CommandRamp<Scalar, R::size> ramp_;
  double hold_;
  CycleTime time_;
  Index implausible_{-1};
  bool limited_{false};
  Velocity answer_, measured_, velocity_;
};

}  // namespace icat
