// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Base and joints coordinated in parallel [MARIS, III-B9], [Coop, III-G]: TPIK 1 over all columns,
/// of which only the base's velocity is kept; TPIK 2 with the base's velocity as measured, of which
/// only the joints' is kept: they compensate the tracking error of the base. Each may run at its
/// own rate, and TPIK 2 is also available as the arm law, see base_compensation.hpp.
#pragma once

#include "icat/control/base_compensation.hpp"
#include "icat/control/controller.hpp"

namespace icat {

/// See the file comment. As `Controller` in everything else; a measured velocity is an argument of
/// every step: that of the base, one number for each of its columns, on the base; or ẏ, n, of which
/// the base's and the given columns count. Where it is that of the base, given joints stand still.
/// Each layer, the base's and the joints', has its own period, limits, and judgement of late and
/// bad input.
template <MobileRobot R, class Regularization = BellRegularization<typename R::Scalar>>
class ParallelController {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// What solves TPIK 1.
  using Actions = ActionSolver<R, Regularization>;
  /// ẏ, n.
  using Velocity = typename Actions::Velocity;
  /// Settings, with defaults.
  using Options = typename Controller<R, Regularization>::Options;

  /// As `Controller`.
  /// @throws std::invalid_argument as `Controller`, or on a robot without joints.
  ParallelController(const R& robot, const std::vector<Action<R>>& actions)
      : ParallelController(robot, actions, Options{}) {}
  /// The same with options.
  [[gnu::cold]] ParallelController(const R& robot, const std::vector<Action<R>>& actions,
                                   Options options)
      : first_(robot, actions, options.given, options.solver, detail::longest_step(options),
               options.characteristic_length),
        second_(robot, options.solver, options.given, first_.levels()),
        limits_(options.limits.of(robot, options.time.max_step)),
        base_(robot.dof(), options.time),
        joints_(robot.dof(), options.time),
        hold_(options.time.hold),
        measured_(detail::zeros<Velocity>(robot.dof())),
        velocity_(measured_) {
    for (const Index c : options.given) limits_.set_given(c, true);
  }
  ParallelController(R&&, const std::vector<Action<R>>&) = delete;
  ParallelController(R&&, const std::vector<Action<R>>&, Options) = delete;

  /// As `Controller::start`.
  Status start(std::string_view action, double time) noexcept {
    const Status status = first_.start(action, time);
    if (status != Status::ok) return status;
    base_.ramp.start();
    joints_.ramp.start();
    return status;
  }
  /// As `Controller::switch_to`.
  Status switch_to(std::string_view action, double time, double duration) noexcept {
    if (!(duration > 0.0) || !std::isfinite(duration)) return Status::invalid_duration;
    const bool rests = base_.ramp.rests() && joints_.ramp.rests();
    const Status status =
        rests ? first_.start(action, time) : first_.switch_to(action, time, duration);
    if (status != Status::ok) return status;
    base_.ramp.resume(duration, limits_.command(), pending(base_));
    joints_.ramp.resume(duration, limits_.command(), pending(joints_));
    return status;
  }
  /// As `Controller::stop`.
  Status stop(double time, double duration) noexcept {
    if (!(duration > 0.0) || !std::isfinite(duration)) return Status::invalid_duration;
    const Status status = first_.tick(time);
    if (status != Status::ok) return status;
    base_.ramp.stop(duration, limits_.command(), pending(base_));
    joints_.ramp.stop(duration, limits_.command(), pending(joints_));
    return status;
  }
  /// As `Controller::set_given`.
  Status set_given(Index column, bool given) noexcept {
    if (column < 0 || column >= velocity_.size()) return Status::unknown_joint;
    if (first_.given(column) != given) limits_.set_given(column, given);
    if (given) {
      base_.ramp.forget(column);
      joints_.ramp.forget(column);
    }
    first_.set_given(column, given);
    second_.set_given(column, given);
    return Status::ok;
  }
  /// The column comes first.
  template <std::same_as<bool> B>
  Status set_given(B, bool) = delete;
  /// As `Controller::set_given`.
  Status set_given(std::string_view joint, bool given) noexcept requires JointedRobot<R> {
    return set_given(detail::column_of(first_.robot(), joint), given);
  }

  /// Both layers, for the same state and measurement: one number for each column of the base, or,
  /// as is needed where a joint is given, n, of which the base's and the given columns count. Bad
  /// input as in `Controller::step`, for each layer on its own.
  template <class V>
  Status step(double time, const Eigen::MatrixBase<V>& measured, InputAge age = {}) noexcept {
    const Status status = prepare(first_.update(time), measured, age);
    if (status == Status::not_started) return idle(status);
    const Status base = run_base(status);
    const Status joints = run_joints(status);
    return base == Status::ok ? joints : base;
  }
  /// TPIK 1 alone, at the base's rate: new velocities of the base.
  template <class V>
  Status step_base(double time, const Eigen::MatrixBase<V>& measured, InputAge age = {}) noexcept {
    const Status status = prepare(first_.update(time), measured, age);
    return status == Status::not_started ? idle(status) : run_base(status);
  }
  /// TPIK 2 alone, at the joints' rate: new velocities of the joints.
  template <class V>
  Status step_joints(double time, const Eigen::MatrixBase<V>& measured,
                     InputAge age = {}) noexcept {
    const Status status = prepare(first_.update(time), measured, age);
    return status == Status::not_started ? idle(status) : run_joints(status);
  }
  /// The law of TPIK 2 for the present state, to be followed by `follow_joint_law`; given joints
  /// stand still.
  Status step_joint_law(double time, InputAge age = {}) noexcept {
    for (Index c = 0; c < measured_.size(); ++c) {
      if (!second_.in_base(c)) measured_(c) = Scalar(0);
    }
    return solve_law(first_.update(time), age);
  }
  /// The same with given joints that move, until the next law, as in `measured`.
  template <class V>
  Status step_joint_law(double time, const Eigen::MatrixBase<V>& measured,
                        InputAge age = {}) noexcept {
    return solve_law(prepare(first_.update(time), measured, age), age);
  }
  /// New velocities of the joints by the law, without solving: q̇ = ρ̃ + P v for a newer measurement
  /// of the base. The law is as old as its state; what `age` says of state and pose is added.
  template <class V>
  Status follow_joint_law(double time, const Eigen::MatrixBase<V>& measured,
                          InputAge age = {}) noexcept {
    Status status = first_.tick(time);
    if (!(law_age_.state >= 0)) return Status::not_started;
    const double since = first_.clock().elapsed() - law_time_;
    age.state += law_age_.state + since;
    age.pose += law_age_.pose + since;
    status = prepare(status, measured, age);
    const Cycle now = first_.clock().since(joints_.time);
    limits_.update_joints(first_.robot(), now);
    if (status == Status::ok) second_.follow_law(measured_, joints_.answer);
    finish(joints_, status, now);
    (void)limits_.limit_joints(joints_.ramp.wanted(joints_.answer));
    take(false);
    return status;
  }

  /// ẏ: the base's columns of TPIK 1, the others of TPIK 2. Given columns hold what was measured.
  const Velocity& velocity() const noexcept { return velocity_; }
  /// What goes to the back-end: ẏ with zeros in the given columns.
  const Velocity& command() const noexcept { return limits_.command(); }
  /// The boxes and the last command.
  const MotionLimits<R>& limits() const noexcept { return limits_; }

  /// TPIK 1: its actions, hierarchy, levels, report, and clock.
  const Actions& first() const noexcept { return first_; }
  /// TPIK 2: its report.
  const BaseCompensation<R, Regularization>& second() const noexcept { return second_; }
  /// Name of the action that runs or is being entered; empty before `start`.
  std::string_view action() const noexcept { return first_.action(); }
  /// Whether there is an action of this name.
  bool has(std::string_view action) const noexcept { return first_.has(action); }
  /// An action is being entered, or a command fades in, out or back.
  bool in_transition() const noexcept {
    return first_.in_transition() || !base_.ramp.settled() || !joints_.ramp.settled();
  }

 private:
  friend struct detail::Inside<ParallelController>;

  struct Layer {
    Layer(Index n, const TimeOptions& options)
        : ramp(n, options), answer(detail::zeros<Velocity>(n)) {}
    detail::CommandRamp<Scalar, R::size> ramp;
    Velocity answer;
    CycleTime time;
  };
  // Of a stamp without a cycle.
  double pending(const Layer& layer) const noexcept {
    return first_.clock().elapsed() - layer.time.last;
  }

  // `status` of the clock and the tasks; then whether the inputs are there and are new.
  template <class V>
  Status prepare(Status status, const Eigen::MatrixBase<V>& measured,
                 const InputAge& age) noexcept {
    if (status != Status::ok) return status;
    if (first_.clock().stalled()) return Status::clock_stalled;
    if (const Status old = detail::check_age(age, hold_); old != Status::ok) return old;
    if (!(age.velocity <= hold_)) return Status::stale_velocity;
    if (limits_.implausible_joint(first_.robot()) >= 0) return Status::implausible_position;
    const ColumnRange base = first_.robot().base_columns();
    const bool all = measured.size() == measured_.size();
    if (!all && measured.size() != base.count) return Status::wrong_size;
    for (Index c = 0; c < measured_.size(); ++c) {
      const bool in_base = second_.in_base(c);
      if (!in_base && !first_.given(c)) continue;
      const Scalar v = all ? measured(c) : in_base ? measured(c - base.first) : Scalar(0);
      if (!std::isfinite(v)) return Status::non_finite;
      measured_(c) = v;
    }
    return Status::ok;
  }
  void finish(Layer& layer, Status status, Cycle now) noexcept { layer.ramp.update(status, now); }
  // Time before the first action is none of a cycle's.
  Status idle(Status status) noexcept {
    (void)first_.clock().since(base_.time);
    (void)first_.clock().since(joints_.time);
    return status;
  }
  Status solve_law(Status status, const InputAge& age) noexcept {
    if (status == Status::ok) status = detail::check_age(age, hold_);
    if (status != Status::ok) return status;
    status = second_.solve_law(first_.levels(), measured_);
    if (status != Status::ok) return status;
    law_time_ = first_.clock().elapsed();
    law_age_ = age;
    return status;
  }
  Status run_base(Status status) noexcept {
    const Cycle now = first_.clock().since(base_.time);
    limits_.update_base(now);
    if (status == Status::ok) {
      (void)first_.set_bounds(limits_.bounds());
      status = first_.solve(measured_);
      detail::copy(first_.velocity(), base_.answer);
    }
    finish(base_, status, now);
    (void)limits_.limit_base(base_.ramp.wanted(base_.answer));
    take(true);
    return status;
  }
  Status run_joints(Status status) noexcept {
    const Cycle now = first_.clock().since(joints_.time);
    limits_.update_joints(first_.robot(), now);
    if (status == Status::ok) {
      (void)second_.set_bounds(limits_.bounds());
      status = second_.solve(first_.levels(), measured_);
      detail::copy(second_.velocity(), joints_.answer);
    }
    finish(joints_, status, now);
    (void)limits_.limit_joints(joints_.ramp.wanted(joints_.answer));
    take(false);
    return status;
  }
  // The base's columns, or the others, are new.
  void take(bool base) noexcept {
    for (Index c = 0; c < velocity_.size(); ++c) {
      if (second_.in_base(c) != base) continue;
      velocity_(c) = first_.given(c) ? measured_(c) : limits_.command()(c);
    }
  }

  Actions first_;
  BaseCompensation<R, Regularization> second_;
  MotionLimits<R> limits_;
  Layer base_, joints_;
  double hold_, law_time_{0};
  InputAge law_age_{-1};
  Velocity measured_, velocity_;
};

}  // namespace icat
