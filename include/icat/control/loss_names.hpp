// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Whose a share of a loss is: the task, row and column that count most in it. For `LossShares`.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "icat/control/controller_inside.hpp"
#include "icat/control/explanation.hpp"

namespace icat::detail {

/// Names are of the controller's cycle as it is. No allocation.
template <class C>
class LossNames {
 public:
  using Scalar = typename C::Scalar;
  using Actions = typename C::Actions;
  using Robot = std::remove_cvref_t<decltype(std::declval<const Actions&>().robot())>;
  using Velocity = typename Actions::Velocity;
  using RobotLevel = Level<Scalar, Robot::size>;
  using Share = LossShare<Scalar>;

  explicit LossNames(const C& controller) : controller_(controller) {}

  /// Row `row` of level `level`, which was refused; −1: no single one.
  void refused(Share& share, Index level, Index row) const noexcept {
    task(share, static_cast<std::size_t>(level), std::max(row, Index(0)));
    if (row < 0) share.row = -1;
  }
  /// The row of level `k`, but for the `count` from `first` on, whose rate changes most by
  /// `change`, and in it the column.
  void row(Share* share, std::size_t k, Index first, Index count,
           const Velocity& change) const noexcept {
    if (!share) return;
    const RobotLevel& level = actions().levels()[k];
    Scalar most(-1);
    Index row = -1;
    for (Index i = 0; i < level.activation.size(); ++i) {
      if (!(level.activation(i) > Scalar(0)) || (i >= first && i < first + count)) continue;
      Scalar rate(0);
      for (Index c = 0; c < change.size(); ++c) rate += level.jacobian(i, c) * change(c);
      const Scalar x = std::abs(level.activation(i) * level.row_scale(i) * rate);
      if (x > most) most = x, row = i;
    }
    if (row < 0) return;
    task(*share, k, row);
    share->activation = level.activation(row);
    Index columns = 0;
    most = Scalar(-1);
    for (Index c = 0; c < change.size(); ++c) {
      if (level.jacobian(row, c) == Scalar(0)) continue;
      ++columns;
      const Scalar x = std::abs(level.jacobian(row, c) * change(c));
      if (x > most) most = x, share->column = c;
    }
    share->alone = columns == 1;
  }
  /// Of the columns that `counts`, the one whose `change` takes most from the rows `jacobian` in
  /// the `direction` of the loss.
  template <class J, class D, class F>
  void column(Share* share, const J& jacobian, const D& direction, const Velocity& change,
              F counts) const noexcept {
    if (!share) return;
    Scalar most(0);
    for (Index c = 0; c < change.size(); ++c) {
      if (!counts(c)) continue;
      Scalar along(0);
      for (Index i = 0; i < jacobian.rows(); ++i) along += direction(i) * jacobian(i, c);
      const Scalar x = std::abs(along * change(c));
      if (x > most) most = x, share->column = c;
    }
  }
  /// The column that is at its bound after level `k` of a solution, and whether it is the upper
  /// one; −1: none.
  template <class Solver>
  static Index at_bound(const Solver& solver, Index k, bool& up) noexcept {
    const auto& options = solver.options();
    const auto& y = solver.velocity();
    const Scalar share = options.saturation == Saturation::scale
                             ? Scalar(1)
                             : Scalar(1) - Scalar(1) / Scalar(20 * (k + 2));
    for (Index c = 0; c < y.size(); ++c) {
      for (const bool upper : {false, true}) {
        const Scalar edge =
            share * (upper ? options.bounds.upper_of(c) : options.bounds.lower_of(c));
        const Scalar rounding = Scalar(64) * std::numeric_limits<Scalar>::epsilon();
        up = upper;
        if (std::abs(y(c) - edge) <= rounding * std::abs(edge)) return c;
      }
    }
    return -1;
  }
  /// Of the columns that the answer without bounds, `over`, moves beyond them, the one that is
  /// furthest; else `stopped`, which stopped a level on the way; else one that is near its bound in
  /// the answer `within`.
  void bound(Share& share, const Velocity& over, const Velocity& within, Index stopped,
             bool up) const noexcept {
    if (furthest(share, over, Scalar(1))) return;
    if (stopped >= 0) {
      const auto& bounds = Inside<C>::bounds(controller_);
      share.column = stopped;
      share.limit = kind(stopped, up, up ? bounds.upper_of(stopped) : -bounds.lower_of(stopped));
      return;
    }
    (void)furthest(share, within, static_cast<Scalar>(0.9));
  }
  /// Of the columns that the limits hold at an edge of their box, the one that is held most.
  /// `answer` is before the base was slowed, `wanted` before the limits, `command` after.
  void limit(Share& share, const Velocity& answer, const Velocity& wanted,
             const Velocity& command) const noexcept {
    const auto& limits = controller_.limits();
    Scalar most(0);
    for (Index c = 0; c < command.size(); ++c) {
      Scalar over = wanted(c) - command(c);
      if (over == Scalar(0)) over = answer(c) - command(c);
      const bool up = over > Scalar(0);
      const Scalar edge = up ? limits.upper()(c) : limits.lower()(c);
      const Scalar rounding =
          Scalar(16) * std::numeric_limits<Scalar>::epsilon() * (Scalar(1) + std::abs(edge));
      if (!(std::abs(over) > most) || !(std::abs(command(c) - edge) <= rounding)) continue;
      most = std::abs(over);
      share.column = c;
      const Scalar room = up ? limits.bounds().upper(c) : -limits.bounds().lower(c);
      const Scalar top = std::min(room, limits.max_velocity(c));
      const Scalar reached = up ? edge : -edge;
      share.limit = reached < top - rounding ? LimitKind::acceleration : kind(c, up, top);
    }
  }

 private:
  const Actions& actions() const noexcept { return Inside<C>::actions(controller_); }
  // The task on level `k` that row `row` of the level belongs to.
  void task(Share& share, std::size_t k, Index row) const noexcept {
    share.level = static_cast<Index>(k);
    for (const auto& entry : actions().hierarchy()[k]) {
      if (row < entry.task->rows()) {
        share.task = entry.task->name();
        share.row = row;
        return;
      }
      row -= entry.task->rows();
    }
  }
  // The column whose velocity is the largest multiple of its bound, more than `least` times.
  bool furthest(Share& share, const Velocity& y, Scalar least) const noexcept {
    const ColumnRange base = Inside<C>::measured_base(controller_);
    const auto& bounds = Inside<C>::bounds(controller_);
    Scalar largest(0), most = least;
    for (Index c = 0; c < y.size(); ++c) largest = std::max(largest, std::abs(y(c)));
    const Scalar nothing = static_cast<Scalar>(1e-6) * largest;
    for (Index c = 0; c < y.size(); ++c) {
      if (base.holds(c) || actions().given(c) || !(std::abs(y(c)) > nothing)) continue;
      const bool up = y(c) > Scalar(0);
      const Scalar edge = up ? bounds.upper_of(c) : -bounds.lower_of(c);
      const Scalar ratio = std::abs(y(c)) / std::max(edge, nothing);
      if (!(ratio > most)) continue;
      most = ratio;
      share.column = c;
      share.limit = kind(c, up, edge);
    }
    return share.column >= 0;
  }
  // Whether it is the joint's position that allows the speed `edge` at most.
  LimitKind kind(Index c, bool up, Scalar edge) const noexcept {
    const auto& limits = controller_.limits();
    const Scalar mine = up ? limits.bounds().upper(c) : -limits.bounds().lower(c);
    const bool position = mine <= edge && mine < limits.max_velocity(c);
    return position ? LimitKind::position : LimitKind::velocity;
  }

 private:
  const C& controller_;
};

}  // namespace icat::detail
