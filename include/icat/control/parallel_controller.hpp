// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Base and joints coordinated in parallel [MARIS, III-B9], [Coop, III-G]: TPIK 1 over all columns,
/// of which only the base's velocity is kept; TPIK 2 with the base's velocity as measured, of which
/// only the joints' is kept: they make up for what the base does not track. Each may run at its own
/// rate, and TPIK 2 also comes as a law, see base_compensation.hpp.
#pragma once

#include "icat/control/base_compensation.hpp"
#include "icat/control/controller.hpp"

namespace icat {

/// See the file comment. As `Controller` in everything else; a measured velocity is an argument of
/// every step: that of the base, one number for each of its columns, on the base; or ẏ, n, of which
/// the base's and the given columns count. Where it is that of the base, given joints stand still.
template <MobileRobot R, class Regularization = BellRegularization<typename R::Scalar>>
class ParallelController {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// TPIK 1.
  using BaseController = Controller<R, Regularization>;
  /// ẏ, n.
  using Velocity = typename BaseController::Velocity;
  /// Of the columns that are not the base's, in their order.
  using JointVelocity = typename BaseCompensation<R, Regularization>::JointVelocity;
  /// Settings, with defaults.
  using Options = typename BaseController::Options;

  /// As `Controller`.
  /// @throws std::invalid_argument as `Controller`, or on a robot without joints.
  ParallelController(const R& robot, const std::vector<Action<R>>& actions)
      : ParallelController(robot, actions, Options{}) {}
  /// The same with options.
  [[gnu::cold]] ParallelController(const R& robot, const std::vector<Action<R>>& actions,
                                   Options options)
      : first_(robot, actions, options),
        second_(robot, options.solver, options.given, first_.levels()),
        measured_(detail::zeros<Velocity>(robot.dof())),
        velocity_(measured_),
        command_(measured_) {}
  ParallelController(R&&, const std::vector<Action<R>>&) = delete;
  ParallelController(R&&, const std::vector<Action<R>>&, Options) = delete;

  /// As `Controller::start`.
  Status start(std::string_view action, double time) noexcept { return first_.start(action, time); }
  /// As `Controller::switch_to`.
  Status switch_to(std::string_view action, double time, double duration) noexcept {
    return first_.switch_to(action, time, duration);
  }
  /// As `Controller::set_given`.
  Status set_given(Index column, bool given) noexcept {
    const Status status = first_.set_given(column, given);
    if (status == Status::ok) second_.set_given(column, given);
    return status;
  }
  /// The column comes first.
  template <std::same_as<bool> B>
  Status set_given(B, bool) = delete;
  /// As `Controller::set_given`.
  Status set_given(std::string_view joint, bool given) noexcept requires JointedRobot<R> {
    return set_given(detail::column_of(first_.robot(), joint), given);
  }

  /// Both, for the same state and measurement. Errors as in `Controller::step`.
  template <class V>
  Status step(double time, const Eigen::MatrixBase<V>& measured) noexcept {
    Status status = prepare(time, measured);
    if (status != Status::ok) return status;
    status = solve_base();
    const Status joints = solve_joints();
    return status == Status::ok ? joints : status;
  }
  /// TPIK 1 alone, at the base's rate: new velocities of the base.
  template <class V>
  Status step_base(double time, const Eigen::MatrixBase<V>& measured) noexcept {
    const Status status = prepare(time, measured);
    return status == Status::ok ? solve_base() : status;
  }
  /// TPIK 2 alone, at the joints' rate: new velocities of the joints.
  template <class V>
  Status step_joints(double time, const Eigen::MatrixBase<V>& measured) noexcept {
    const Status status = prepare(time, measured);
    return status == Status::ok ? solve_joints() : status;
  }
  /// The law of TPIK 2 for the present state: after it `joint_velocity(measured)` answers every new
  /// measurement of the base without solving. Given joints stand still.
  Status step_joint_law(double time) noexcept {
    const Status status = first_.update(time);
    return status == Status::ok ? second_.solve_law(first_.levels()) : status;
  }
  /// The same with given joints that move, until the next law, as in `measured`.
  template <class V>
  Status step_joint_law(double time, const Eigen::MatrixBase<V>& measured) noexcept {
    const Status status = prepare(time, measured);
    return status == Status::ok ? second_.solve_law(first_.levels(), measured_) : status;
  }
  /// q̇ of the last `step_joint_law` for the base's velocity, see
  /// `BaseCompensation::joint_velocity`.
  template <class V>
  const JointVelocity& joint_velocity(const Eigen::MatrixBase<V>& measured) noexcept {
    return second_.joint_velocity(measured);
  }

  /// ẏ: the base's columns of TPIK 1, the others of TPIK 2. Given columns hold what was measured.
  const Velocity& velocity() const noexcept { return velocity_; }
  /// What goes to the back-end: ẏ with zeros in the given columns.
  const Velocity& command() const noexcept { return command_; }

  /// TPIK 1: its actions, hierarchy, levels and report.
  const BaseController& first() const noexcept { return first_; }
  /// TPIK 2: its report.
  const BaseCompensation<R, Regularization>& second() const noexcept { return second_; }
  /// Name of the action that runs or is being entered; empty before `start`.
  std::string_view action() const noexcept { return first_.action(); }
  /// An action is being entered.
  bool in_transition() const noexcept { return first_.in_transition(); }

 private:
  template <class V>
  Status prepare(double time, const Eigen::MatrixBase<V>& measured) noexcept {
    // There are joints, so n is not the number of the base's columns.
    const ColumnRange base = first_.robot().base_columns();
    const bool all = measured.size() == measured_.size();
    if (!all && measured.size() != base.count) return Status::wrong_size;
    for (Index c = 0; c < measured_.size(); ++c) {
      measured_(c) = all ? measured(c) : second_.in_base(c) ? measured(c - base.first) : Scalar(0);
    }
    return first_.update(time);
  }
  Status solve_base() noexcept {
    const Status status = first_.solve(measured_);
    take(true, first_.velocity());
    return status;
  }
  Status solve_joints() noexcept {
    const Status status = second_.solve(first_.levels(), measured_);
    take(false, second_.velocity());
    return status;
  }
  // The base's columns, or the others, are those of `solution`.
  void take(bool base, const Velocity& solution) noexcept {
    for (Index c = 0; c < velocity_.size(); ++c) {
      if (second_.in_base(c) != base) continue;
      velocity_(c) = solution(c);
      command_(c) = first_.given(c) ? Scalar(0) : solution(c);
    }
  }

  BaseController first_;
  BaseCompensation<R, Regularization> second_;
  Velocity measured_, velocity_, command_;
};

}  // namespace icat
