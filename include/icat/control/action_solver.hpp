// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Runs actions on a robot and solves for its velocity ẏ, one TPIK over all columns. The controller
/// (controller.hpp) decides which part of it is commanded.
///
/// Some columns may be *given*: roll and pitch of a vehicle that cannot control them, a joint whose
/// motor failed. Their measured velocity enters [Coop, Eq. (31)], and the other columns compensate
/// it.
#pragma once

#include "icat/control/given_tpik.hpp"

namespace icat {

/// The robot, the tasks and this object belong to one thread. After construction nothing allocates
/// or throws.
template <Robot R, class Regularization = BellRegularization<typename R::Scalar>>
class ActionSolver {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// The solver.
  using Solver = Tpik<Scalar, R::size, Regularization>;
  /// ẏ, n.
  using Velocity = typename Solver::VectorN;

  /// Computes the unified hierarchy of `actions`. `robot` and the tasks must outlive this object.
  /// `max_step` and `length` as in `LevelStack`.
  /// @throws std::invalid_argument on bad options or actions (see `unified_hierarchy`), or a task
  ///         that belongs to another robot.
  [[gnu::cold]] ActionSolver(const R& robot, const std::vector<Action<R>>& actions,
                             const Columns& given, const typename Solver::Options& options,
                             double max_step, std::optional<Scalar> length)
      : stack_(robot, actions, max_step, length),
        tpik_(robot, options, given),
        velocity_(detail::zeros<Velocity>(robot.dof())) {}

  /// See `LevelStack`.
  Status start(std::string_view action, double time) noexcept { return stack_.start(action, time); }
  /// See `LevelStack`.
  Status switch_to(std::string_view action, double time, double duration) noexcept {
    return stack_.switch_to(action, time, duration);
  }
  /// From now on column `column`, in [0, n), is given, or no more.
  void set_given(Index column, bool given) noexcept { tpik_.set_given(column, given); }
  /// Velocity bounds from now on, within those of the options; see `Tpik::set_bounds`.
  Status set_bounds(const VelocityBounds<Scalar, R::size>& bounds) noexcept {
    return tpik_.set_bounds(bounds);
  }
  /// A stamp, s, without a cycle.
  Status tick(double time) noexcept { return stack_.tick(time); }
  /// The first half of a cycle: phase activations and tasks at `time`, s.
  Status update(double time) noexcept { return stack_.update(time); }
  /// The same at the last stamp.
  Status refresh() noexcept { return stack_.refresh(); }
  /// The second half: the TPIK for the levels as they are and the velocity that is measured, n;
  /// only its given columns count. Bad levels as in `Tpik`; a needed velocity that is not finite:
  /// zero.
  Status solve(const Velocity& measured) noexcept {
    return solve(measured, ColumnRange{}, measured);
  }
  /// The same for the `count` highest levels alone.
  Status solve(const Velocity& measured, std::size_t count) noexcept {
    return solve(stack_.levels().first(count), measured, ColumnRange{}, measured);
  }
  /// The same where the columns `moving` move as in `as`, n, whatever else is given.
  Status solve(const Velocity& measured, ColumnRange moving, const Velocity& as) noexcept {
    return solve(stack_.levels(), measured, moving, as);
  }

  /// ẏ of the last `solve`, n; given columns hold what was measured.
  const Velocity& velocity() const noexcept { return velocity_; }
  /// The robot it was built for.
  const R& robot() const noexcept { return stack_.robot(); }
  /// L, m: see `Level::row_scale`.
  Scalar characteristic_length() const noexcept { return stack_.characteristic_length(); }
  /// What the stamps given so far amount to.
  const StepClock& clock() const noexcept { return stack_.clock(); }
  /// Whether column `column` is given.
  bool given(Index column) const noexcept { return tpik_.is_given(column); }
  /// Whether any is.
  bool any_given() const noexcept { return tpik_.any_given(); }
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
  /// The levels of `hierarchy` as of the last `update`.
  std::span<const Level<Scalar, R::size>> levels() const noexcept { return stack_.levels(); }
  /// Of the solver; levels are those of `hierarchy`.
  const TpikReport<Scalar>& report() const noexcept { return tpik_.solver().report(); }
  /// Its options, with the bounds in force.
  const typename Solver::Options& options() const noexcept { return tpik_.solver().options(); }

 private:
  Status solve(std::span<const Level<Scalar, R::size>> levels, const Velocity& measured,
               ColumnRange moving, const Velocity& as) noexcept {
    if (measured.size() != velocity_.size()) return Status::wrong_size;
    detail::copy(measured, tpik_.measured());
    const Status status = tpik_.solve(levels, moving, as);
    detail::copy(tpik_.solver().velocity(), velocity_);
    return status;
  }

  LevelStack<R> stack_;
  detail::GivenTpik<R, Regularization> tpik_;
  Velocity velocity_;
};

}  // namespace icat
