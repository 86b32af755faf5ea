// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The solutions by which `Explainer` shares out losses; the mathematics is in explain.hpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "icat/control/loss_names.hpp"
#include "icat/math/range_projection.hpp"

namespace icat::detail {

/// Construction allocates; nothing else does.
template <class C>
class LossShares {
 public:
  using Scalar = typename C::Scalar;
  using Actions = typename C::Actions;
  using Robot = typename LossNames<C>::Robot;
  using Solver = typename Actions::Solver;
  using Velocity = typename Actions::Velocity;
  using RobotLevel = Level<Scalar, Robot::size>;
  using Rows = Vector<Scalar, Eigen::Dynamic>;
  using Share = LossShare<Scalar>;
  using Regularization = decltype(Solver::Options::regularization);

  [[gnu::cold]] explicit LossShares(const C& controller)
      : controller_(controller),
        names_(controller),
        solver_(GivenTpik<Robot, Regularization>::template make<Solver>(
            actions().robot().dof(), unbounded(actions().options()))),
        rho0_(zeros<Velocity>(actions().robot().dof())),
        actual_(rho0_),
        pushed_(rho0_),
        commanded_(rho0_),
        change_(rho0_),
        start_(identity<typename Solver::SquareN>(rho0_.size())),
        free_{rho0_, rho0_},
        cycle_(causes),
        range_(tallest(), rho0_.size()) {
    fill(free_.lower, -infinity<Scalar>);
    fill(free_.upper, infinity<Scalar>);
    for (Step& step : cycle_) step.velocity = rho0_;
    for (const auto& entries : hierarchy()) {
      for (const auto& entry : entries) {
        RobotLevel own;
        own.jacobian = zeros<JacobianMatrix<Scalar, Robot::size>>(entry.task->rows(), dof());
        own.activation = own.reference = own.row_scale = zeros<Rows>(entry.task->rows());
        own_.push_back(std::move(own));
      }
    }
    for (Rows* x : {&direction_, &rates_, &wanted_, &possible_}) *x = zeros<Rows>(tallest());
  }

  const Actions& actions() const noexcept { return Inside<C>::actions(controller_); }
  const UnifiedHierarchy<Robot>& hierarchy() const noexcept { return actions().hierarchy(); }
  /// Most shares of a task.
  std::size_t most() const noexcept { return hierarchy().size() + causes; }

  /// What all tasks share: the solutions of the whole cycle.
  void begin() noexcept {
    const auto& ramp = Inside<C>::ramp(controller_);
    const auto& base_ramp = Inside<C>::base_ramp(controller_);
    const ColumnRange base = Inside<C>::measured_base(controller_);
    steps_ = 0;
    stopped_ = -1;
    for (Index c = 0; c < dof(); ++c) {
      const bool given = actions().given(c);
      const Scalar measured = Inside<C>::measured(controller_)(c), y = controller_.velocity()(c);
      actual_(c) = base.holds(c) ? measured : y;
      commanded_(c) = y;
      pushed_(c) = given ? y : base.holds(c) ? base_ramp.last_wanted()(c) : ramp.last_wanted()(c);
    }
    give(ColumnRange{}, actual_);
    (void)solver_.set_bounds(free_);
    solve_all();
    step(failed_ < 0 ? LossCause::below : LossCause::refused, solver_.velocity());
    if (base.count > 0) move_base(base);
    (void)solver_.set_bounds(Inside<C>::bounds(controller_));
    solve_all();
    step(LossCause::bound, solver_.velocity());
    const bool solved = Inside<C>::status(controller_) == Status::ok && base.count == 0;
    // In a cycle that was solved, it was solved again for a base at its limits.
    command(solved ? LossCause::limit : LossCause::held, Inside<C>::answer(controller_));
    command(LossCause::ramp, pushed_);
    step(LossCause::limit, actual_);
    (void)solver_.set_bounds(free_);
    give(ColumnRange{}, actual_);
  }

  /// The rates of entry `e`, whose rows are those from `first` on of level `k`, and its loss in
  /// shares, at most `most`; how many there are. −1: its own input is bad.
  Index measure(std::size_t e, std::size_t k, Index first, TaskExplanation<Scalar>& t,
                Share* shares) noexcept {
    shares_ = shares;
    count_ = 0;
    RobotLevel& own = own_[e];
    if (!take_rows(levels()[k], first, t.phase, own)) return -1;
    weigh(own, t);
    if (!std::isfinite(t.loss) || !std::isfinite(t.wanted)) {
      t.wanted = t.achieved = t.loss = Scalar(0);
      return -1;
    }
    if (!(t.loss > Scalar(0))) return 0;
    reach(own);
    const bool partial = binary(own);
    solve(0, false, &own);
    add(LossCause::regularization, own);
    if (partial) {
      restore(levels()[k], first, t.phase, own);
      solve(0, false, &own);
      add(LossCause::activation, own);
    }
    if (t.phase < Scalar(1)) {
      restore(levels()[k], first, Scalar(1), own);
      solve(0, false, &own);
      add(LossCause::transition, own);
    }
    if (any_given_) {
      solve(0, true, &own);
      names_.column(add(LossCause::given, own), own.jacobian, direction_, change_,
                    [this](Index c) { return actions().given(c); });
    }
    for (std::size_t j = 0; j < k; ++j) {
      if (!is_active(j, 0, 0)) continue;
      solve(j + 1, true, &own);
      names_.row(add(LossCause::level, own), j, 0, 0, change_);
    }
    if (is_active(k, first, t.rows)) {
      solve(k + 1, true, nullptr);
      names_.row(add(LossCause::equal, own), k, first, t.rows, change_);
    }
    add_cycle(own, k);
    return static_cast<Index>(count_);
  }

 private:
  static constexpr std::size_t causes = static_cast<std::size_t>(LossCause::limit) + 1;
  // A solution of the whole cycle, and what it has more than the one before.
  struct Step {
    LossCause cause{LossCause::below};
    Velocity velocity;
  };

  static typename Solver::Options unbounded(typename Solver::Options options) {
    options.bounds = VelocityBounds<Scalar, Robot::size>{};
    return options;
  }
  Index tallest() const noexcept {
    Index rows = 1;
    for (const auto& level : hierarchy()) {
      for (const auto& entry : level) rows = std::max(rows, entry.task->rows());
    }
    return rows;
  }
  Index dof() const noexcept { return rho0_.size(); }
  std::span<const RobotLevel> levels() const noexcept { return actions().levels(); }

  // The given columns move as measured, those of `base` as in `velocity`.
  void give(ColumnRange base, const Velocity& velocity) noexcept {
    any_given_ = base.count > 0 || actions().any_given();
    for (Index c = 0; c < dof(); ++c) {
      const bool given = actions().given(c), moves = base.holds(c);
      rho0_(c) = given ? Inside<C>::measured(controller_)(c) : moves ? velocity(c) : Scalar(0);
      start_(c, c) = given || moves ? Scalar(0) : Scalar(1);
    }
  }
  // From what TPIK 1 asks of the base to what it does; the joints make up for each step.
  void move_base(ColumnRange base) noexcept {
    move_base(LossCause::base, base, cycle_[0].velocity);  // TPIK 2 may choose otherwise
    (void)solver_.set_bounds(actions().options().bounds);
    give(ColumnRange{}, actual_);
    solve_all();
    copy(solver_.velocity(), change_);
    give(base, cycle_[0].velocity);
    (void)solver_.set_bounds(free_);
    move_base(LossCause::bound, base, change_);
    move_base(LossCause::held, base, Inside<C>::base_answer(controller_));
    move_base(LossCause::ramp, base, pushed_);
    move_base(LossCause::limit, base, commanded_);
    move_base(LossCause::base, base, actual_);
  }
  void move_base(LossCause cause, ColumnRange base, const Velocity& velocity) noexcept {
    bool same = steps_ > 1;  // as the step before
    for (Index c = base.first; c < base.first + base.count; ++c) {
      same = same && (actions().given(c) || rho0_(c) == velocity(c));
    }
    if (same) return;
    give(base, velocity);
    solve_all();
    step(cause, solver_.velocity());
  }
  Status reset(bool given) noexcept {
    if (given && any_given_) return solver_.reset(rho0_, start_);
    solver_.reset();
    return Status::ok;
  }
  Status add_level(const RobotLevel& level) noexcept {
    return solver_.add_level(level.jacobian, level.activation, level.reference, level.scales());
  }
  // All levels, as the controller does.
  void solve_all() noexcept {
    failed_ = -1;
    Status status = reset(true);
    for (std::size_t k = 0; k < levels().size() && status == Status::ok; ++k) {
      status = add_level(levels()[k]);
      if (status != Status::ok) failed_ = static_cast<Index>(k);
      // Levels above and below may hide it in the answer.
      const auto solved = solver_.report().levels();
      if (stopped_ < 0 && !solved.empty() && solved.back().saturation_scale < Scalar(1)) {
        stopped_ = names_.at_bound(solver_, static_cast<Index>(k), stopped_up_);
      }
    }
    failed_row_ = solver_.report().failed_row();
    (void)solver_.minimize_velocity();
  }
  // The `count` highest levels and then `own`; `change_`: what the velocity loses to the last one.
  void solve(std::size_t count, bool given, const RobotLevel* own) noexcept {
    copy(solver_.velocity(), change_);
    (void)reset(given);
    for (std::size_t k = 0; k < count; ++k) (void)add_level(levels()[k]);
    if (own) (void)add_level(*own);
    for (Index c = 0; c < dof(); ++c) change_(c) -= solver_.velocity()(c);
  }
  // One step of the whole cycle.
  void step(LossCause cause, const Velocity& velocity) noexcept {
    cycle_[steps_].cause = cause;
    copy(velocity, cycle_[steps_++].velocity);
  }
  // The same on the way to the command, which does not change what moves as measured.
  void command(LossCause cause, const Velocity& velocity) noexcept {
    const ColumnRange base = Inside<C>::measured_base(controller_);
    step(cause, velocity);
    for (Index c = 0; c < dof(); ++c) {
      if (base.holds(c) || actions().given(c)) cycle_[steps_ - 1].velocity(c) = actual_(c);
    }
  }

  // False where a number is none.
  static bool take_rows(const RobotLevel& level, Index first, Scalar phase,
                        RobotLevel& own) noexcept {
    Scalar sum(0);  // zero but for infinities and NaN, which stay
    for (Index i = 0; i < own.reference.size(); ++i) {
      for (Index j = 0; j < own.jacobian.cols(); ++j) {
        own.jacobian(i, j) = level.jacobian(first + i, j);
        sum += own.jacobian(i, j) * Scalar(0);
      }
      own.reference(i) = level.reference(first + i);
      own.row_scale(i) = level.row_scale(first + i);
      sum += own.reference(i) * Scalar(0) + level.activation(first + i) * Scalar(0);
    }
    restore(level, first, phase, own);
    return sum == Scalar(0);
  }
  // Activations without the phase's part; rounding must not make a binary one partial.
  static void restore(const RobotLevel& level, Index first, Scalar phase,
                      RobotLevel& own) noexcept {
    for (Index i = 0; i < own.activation.size(); ++i) {
      const Scalar a = level.activation(first + i);
      own.activation(i) = a >= phase ? (phase < Scalar(1) ? Scalar(1) : a) : a / phase;
    }
  }
  // To 0 or 1; whether one was neither.
  static bool binary(RobotLevel& own) noexcept {
    bool partial = false;
    for (Index i = 0; i < own.activation.size(); ++i) {
      Scalar& a = own.activation(i);
      partial = partial || (a > Scalar(0) && a < Scalar(1));
      a = a > Scalar(0) ? Scalar(1) : Scalar(0);
    }
    return partial;
  }
  static Scalar rate(const RobotLevel& level, Index row, const Velocity& y) noexcept {
    Scalar sum(0);
    for (Index j = 0; j < y.size(); ++j) sum += level.jacobian(row, j) * y(j);
    return sum;
  }

  // Rates; `rates_` begins with the reference; `direction_` is l / ‖l‖ times the rows' weights.
  void weigh(const RobotLevel& own, TaskExplanation<Scalar>& t) noexcept {
    bool mixed = false;
    for (Index i = 1; i < t.rows; ++i) mixed = mixed || own.row_scale(i) != own.row_scale(0);
    Scalar wanted(0), achieved(0), loss(0);
    for (Index i = 0; i < t.rows; ++i) {
      const Scalar a = own.activation(i), w = mixed ? a * own.row_scale(i) : a;
      const Scalar x = w * own.reference(i), y = w * rate(own, i, actual_);
      t.active_rows += a > Scalar(0) ? 1 : 0;
      wanted += x * x;
      achieved += y * y;
      loss += (x - y) * (x - y);
      rates_(i) = own.reference(i);
      direction_(i) = w * (x - y);
    }
    t.wanted = std::sqrt(wanted);
    t.achieved = std::sqrt(achieved);
    t.loss = std::sqrt(loss);
    for (Index i = 0; i < t.rows; ++i) direction_(i) /= t.loss > Scalar(0) ? t.loss : Scalar(1);
  }
  // What the robot can do at all, in the metric of the solver, of the rows that are active.
  void reach(const RobotLevel& own) noexcept {
    const Index rows = own.reference.size();
    Index active = 0;
    for (Index i = 0; i < rows; ++i) {
      if (!(own.activation(i) > Scalar(0))) continue;
      for (Index j = 0; j < dof(); ++j) {
        range_(active, j) = own.row_scale(i) * own.jacobian(i, j);
      }
      wanted_(active++) = own.row_scale(i) * own.reference(i);
    }
    range_.project(active, wanted_.data(), possible_.data());
    active = 0;
    Scalar amount(0);
    for (Index i = 0; i < rows; ++i) {
      if (!(own.activation(i) > Scalar(0))) continue;
      const Scalar now = possible_(active++) / own.row_scale(i);
      amount += direction_(i) * (rates_(i) - now);
      rates_(i) = now;
    }
    push(LossCause::singular, amount);
  }
  Share* push(LossCause cause, Scalar amount) noexcept {
    if (amount == Scalar(0)) return nullptr;
    Share& share = shares_[count_++];
    share = Share{};
    share.cause = cause;
    share.amount = amount;
    return &share;
  }
  // What the rates lose by `y` instead of what was before.
  Scalar lose(const RobotLevel& own, const Velocity& y) noexcept {
    Scalar amount(0);
    for (Index i = 0; i < own.reference.size(); ++i) {
      if (direction_(i) == Scalar(0)) continue;
      const Scalar now = rate(own, i, y);
      amount += direction_(i) * (rates_(i) - now);
      rates_(i) = now;
    }
    return amount;
  }
  Share* add(LossCause cause, const RobotLevel& own) noexcept {
    return push(cause, lose(own, solver_.velocity()));
  }
  // The steps of the whole cycle; two of one cause are one share.
  void add_cycle(const RobotLevel& own, std::size_t k) noexcept {
    Scalar amounts[causes] = {};
    for (std::size_t i = 0; i < steps_; ++i) {
      const bool refused =
          cycle_[i].cause == LossCause::refused && failed_ <= static_cast<Index>(k);
      const LossCause cause =
          cycle_[i].cause == LossCause::refused && !refused ? LossCause::below : cycle_[i].cause;
      amounts[static_cast<std::size_t>(cause)] += lose(own, cycle_[i].velocity);
    }
    for (std::size_t i = 0; i < causes; ++i) {
      Share* share = push(static_cast<LossCause>(i), amounts[i]);
      if (!share) continue;
      if (share->cause == LossCause::refused) names_.refused(*share, failed_, failed_row_);
      if (share->cause == LossCause::bound) {
        const std::size_t at = steps_ - 4;
        names_.bound(*share, cycle_[at - 1].velocity, cycle_[at].velocity, stopped_, stopped_up_);
      }
      if (share->cause == LossCause::limit) {
        const bool parallel = Inside<C>::measured_base(controller_).count > 0;
        names_.limit(*share, parallel ? pushed_ : cycle_[steps_ - 4].velocity, pushed_, commanded_);
      }
      if (share->cause != LossCause::base) continue;
      for (Index c = 0; c < dof(); ++c) change_(c) = commanded_(c) - actual_(c);
      names_.column(share, own.jacobian, direction_, change_, [](Index) { return true; });
    }
  }

  // Whether a row of level `k` counts, besides the `count` from `first` on.
  bool is_active(std::size_t k, Index first, Index count) const noexcept {
    const auto& a = levels()[k].activation;
    for (Index i = 0; i < a.size(); ++i) {
      if ((i < first || i >= first + count) && a(i) > Scalar(0)) return true;
    }
    return false;
  }

  const C& controller_;
  LossNames<C> names_;
  Solver solver_;
  Velocity rho0_, actual_, pushed_, commanded_, change_;
  typename Solver::SquareN start_;  // diagonal
  VelocityBounds<Scalar, Robot::size> free_;
  List<Step> cycle_;
  RangeProjection<Scalar> range_;
  List<RobotLevel> own_;  // the rows of each entry
  Rows direction_, rates_, wanted_, possible_;
  Share* shares_{nullptr};
  std::size_t steps_{0}, count_{0};
  Index failed_{-1}, failed_row_{-1};
  Index stopped_{-1};  // the first column that stopped a level at its bound
  bool stopped_up_{false};
  bool any_given_{false};
};

}  // namespace icat::detail
