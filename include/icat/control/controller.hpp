// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The kinematic layer: runs actions on a robot and yields its velocity ẏ, one TPIK over all
/// columns.
///
/// Some columns may be *given*: roll and pitch of a vehicle that cannot control them, a joint whose
/// motor died. Their measured velocity enters [Coop, Eq. (31)], the others make up for it, and they
/// are never commanded.
#pragma once

#include "icat/control/given_tpik.hpp"

namespace icat {

/// Controls a robot whose state the caller keeps up to date before each step. The robot, the tasks
/// and this object belong to one thread. After construction nothing allocates or throws.
template <Robot R, class Regularization = BellRegularization<typename R::Scalar>>
class Controller {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// The solver.
  using Solver = Tpik<Scalar, R::size, Regularization>;
  /// ẏ, n.
  using Velocity = typename Solver::VectorN;

  /// Settings, with defaults.
  struct Options {
    Columns given{};                    ///< that are not commanded, see the file comment
    typename Solver::Options solver{};  ///< of the TPIK
  };

  /// Computes the unified hierarchy of `actions`. `robot` and the tasks must outlive this object.
  /// @throws std::invalid_argument on bad options or actions (see `unified_hierarchy`), or a task
  ///         that belongs to another robot.
  Controller(const R& robot, const std::vector<Action<R>>& actions)
      : Controller(robot, actions, Options{}) {}
  /// The same with options.
  [[gnu::cold]] Controller(const R& robot, const std::vector<Action<R>>& actions, Options options)
      : stack_(robot, actions),
        tpik_(robot, options.solver, options.given),
        velocity_(detail::zeros<Velocity>(robot.dof())),
        command_(velocity_) {}
  Controller(R&&, const std::vector<Action<R>>&) = delete;
  Controller(R&&, const std::vector<Action<R>>&, Options) = delete;

  /// Enters `action` at once, for a start in the middle of things. Time in s, on one clock.
  Status start(std::string_view action, double time) noexcept { return stack_.start(action, time); }
  /// Moves to `action` over `duration` seconds, from the activations as they are now (all 0 before
  /// the first action); also in the middle of another transition, also back. To the action that
  /// runs or is being entered: nothing changes, so it may be said in every cycle.
  Status switch_to(std::string_view action, double time, double duration) noexcept {
    return stack_.switch_to(action, time, duration);
  }
  /// From now on column `column` is given, or no more. The velocity changes at once, as the robot
  /// did.
  Status set_given(Index column, bool given) noexcept {
    if (column < 0 || column >= velocity_.size()) return Status::unknown_joint;
    tpik_.set_given(column, given);
    return Status::ok;
  }
  /// The column comes first.
  template <std::same_as<bool> B>
  Status set_given(B, bool) = delete;
  /// The same for the joint of this name, such as one whose motor died.
  Status set_given(std::string_view joint, bool given) noexcept requires JointedRobot<R> {
    return set_given(detail::column_of(stack_.robot(), joint), given);
  }

  /// One control cycle; given columns stand still. On bad input:
  /// - a level at fault: the iteration ends above it; its index is in the report, and what has a
  ///   higher priority is still served;
  /// - a time at fault, or no action yet: the velocity stays what it was.
  /// The velocity is always finite, and inside the bounds in what may be chosen.
  Status step(double time) noexcept {
    const Status status = stack_.update(time);
    if (status != Status::ok) return status;
    detail::fill(tpik_.measured(), Scalar(0));
    return run();
  }
  /// The same with the velocity that is measured, n; only its given columns count. One that is
  /// needed and not finite: zero velocity.
  Status step(double time, const Velocity& measured) noexcept {
    const Status status = stack_.update(time);
    return status == Status::ok ? solve(measured) : status;
  }
  /// The first half of `step`: phase activations and tasks at `time`.
  Status update(double time) noexcept { return stack_.update(time); }
  /// The second half of `step`: the TPIK for the levels as they are.
  Status solve(const Velocity& measured) noexcept {
    if (measured.size() != velocity_.size()) return Status::wrong_size;
    for (Index c = 0; c < velocity_.size(); ++c) tpik_.measured()(c) = measured(c);
    return run();
  }

  /// ẏ; given columns hold what was measured.
  const Velocity& velocity() const noexcept { return velocity_; }
  /// What goes to the back-end: ẏ with zeros in the given columns.
  const Velocity& command() const noexcept { return command_; }

  /// The robot it was built for.
  const R& robot() const noexcept { return stack_.robot(); }
  /// Whether column `column` is given.
  bool given(Index column) const noexcept { return tpik_.is_given(column); }
  /// Name of the action that runs or is being entered; empty before `start`.
  std::string_view action() const noexcept { return stack_.action(); }
  /// Whether there is an action of this name.
  bool has(std::string_view action) const noexcept { return stack_.has(action); }
  /// An action is being entered.
  bool in_transition() const noexcept { return stack_.in_transition(); }
  /// The unified hierarchy of the actions.
  const UnifiedHierarchy<R>& hierarchy() const noexcept { return stack_.hierarchy(); }
  /// aᵖ of every entry of the hierarchy, level by level.
  std::span<const double> phase_activations() const noexcept { return stack_.phase_activations(); }
  /// The levels of `hierarchy` as of the last step or `update`.
  std::span<const Level<Scalar, R::size>> levels() const noexcept { return stack_.levels(); }
  /// Of the solver; levels are those of `hierarchy`.
  const TpikReport<Scalar>& report() const noexcept { return tpik_.solver().report(); }

 private:
  Status run() noexcept {
    const Status status = tpik_.solve(stack_.levels());
    for (Index c = 0; c < velocity_.size(); ++c) {
      velocity_(c) = tpik_.solver().velocity()(c);
      command_(c) = given(c) ? Scalar(0) : velocity_(c);
    }
    return status;
  }

  LevelStack<R> stack_;
  detail::GivenTpik<R, Regularization> tpik_;
  Velocity velocity_, command_;
};

}  // namespace icat
