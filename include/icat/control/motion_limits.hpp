// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Hard limits of position, velocity and acceleration, kept in every cycle. Objectives (tasks)
/// shape motion; these bound it.
///
/// Each cycle they become a box [l, u] for the velocity. With T the reaction time of the loop, a
/// the limit of acceleration, dt the step and d the way to the upper limit of position, the
/// velocities that can still brake in time are
///
///     v T + v² / 2a ≤ d        v ≤ 2d / (T + √(T² + 2d/a)),     d/T without a limit of
///     acceleration
///
/// within the limits of velocity, and within the last command ± a dt. If it holds once it can be
/// kept for ever, by braking with a (docs/safety.md). The given state may be late by any time up to
/// T − dt; so d is measured from the farthest point to which the commands of that time can have
/// led.
///
/// The command is the farthest point in the box on the line from the last command, moved into the
/// box, to the desired velocity. The base and the joints have separate scales; a component that
/// must brake is limited separately.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "icat/control/command_history.hpp"
#include "icat/core/step_clock.hpp"
#include "icat/model/robot.hpp"
#include "icat/tpik/velocity_bounds.hpp"

namespace icat {

/// No limits at all.
struct Unlimited {};
/// As limits of motion, or as the option `limits` of a controller.
inline constexpr Unlimited unlimited{};

/// See the file comment. A controller copies it and works with the copy. Construction allocates and
/// throws; nothing else does.
template <Robot R>
class MotionLimits {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// ẏ, n.
  using Velocity = Vector<Scalar, R::size>;

  /// Settings, with defaults.
  struct Options {
    /// T, s, in (0, 10]: from a state to the end of the motion that was commanded for it. At least
    /// the longest period of the loop, plus delays, plus the lag of the servos, plus twice what the
    /// stamps jitter.
    double reaction_time{0.1};
    Scalar max_velocity{infinity<Scalar>};      ///< of every joint; its own where that is less
    Scalar max_acceleration{infinity<Scalar>};  ///< likewise
    /// In place of what the robot says of the joints of these names.
    std::vector<JointInfo<Scalar>> joints = EmptyList{};
    /// Of the base's columns, one each, > 0, or none: m/s, rad/s.
    std::vector<Scalar> base_velocity = EmptyList{};
    /// Likewise, m/s², rad/s².
    std::vector<Scalar> base_acceleration = EmptyList{};
  };

  /// Those of the robot it will be used for; nothing else may be asked of it but `of`.
  MotionLimits() {}  // not defaulted: see `infinity`
  /// None; likewise.
  MotionLimits(Unlimited) : unlimited_(true) {}  // NOLINT: converts on purpose
  /// The limits that the robot states.
  /// @throws std::invalid_argument on settings out of range, with the joint's name, or joints that
  ///         there are not.
  explicit MotionLimits(const R& robot) : MotionLimits(robot, Options{}) {}
  /// With settings.
  [[gnu::cold]] MotionLimits(const R& robot, Options options)
      : MotionLimits(robot.dof(), options.reaction_time) {
    take_joints(robot, options);
    take_base(robot, options);
  }
  /// For `robot`; its own limits get the reaction time `period`, s. Allocates.
  /// @throws std::invalid_argument on limits for another number of columns.
  [[gnu::cold]] MotionLimits of(const R& robot, double period) const {
    if (dof() == robot.dof()) return *this;
    if (dof() != 0) {
      detail::invalid("MotionLimits of ", dof(), " columns for a robot of ", robot.dof());
    }
    if (!unlimited_)
      return MotionLimits(robot, Options{.reaction_time = std::min(period, longest)});
    MotionLimits none(robot.dof(), std::min(period, longest));
    none.take_base(robot, Options{});
    return none;
  }

  /// n.
  Index dof() const noexcept { return static_cast<Index>(columns_.size()); }
  /// T, s.
  double reaction_time() const noexcept { return reaction_time_; }

  /// The boxes for a cycle; positions are the robot's. Where the stamps make the step 0, braking
  /// goes on as usual.
  void update(const R& robot, Cycle cycle) noexcept {
    update_base(cycle);
    update_joints(robot, cycle);
  }
  /// The same for the base alone.
  void update_base(Cycle cycle) noexcept { box(true, cycle); }
  /// The same for the others alone.
  void update_joints(const R& robot, Cycle cycle) noexcept {
    if constexpr (JointedRobot<R>) carry(robot, cycle);
    box(false, cycle);
  }

  /// Bounds for a solver, which always hold 0: position and velocity of the joints. They exclude
  /// the acceleration limits: a joint that cannot reverse at once would stop the whole level. They
  /// exclude the base's limits, too: a slow base must not slow the arm.
  const VelocityBounds<Scalar, R::size>& bounds() const noexcept { return bounds_; }
  /// l, n.
  const Velocity& lower() const noexcept { return lower_; }
  /// u, n.
  const Velocity& upper() const noexcept { return upper_; }

  /// The limit of velocity of column `c`, in [0, n); infinite where there is none.
  Scalar max_velocity(Index c) const noexcept {
    return columns_[static_cast<std::size_t>(c)].max_velocity;
  }

  /// Moves the base's columns of `command` towards `wanted` (n, finite). False: not all the way.
  bool limit_base(const Velocity& wanted) noexcept { return limit(true, wanted, command_); }
  /// The same for the others.
  bool limit_joints(const Velocity& wanted) noexcept { return limit(false, wanted, command_); }
  /// What both would make of `wanted`, n.
  void preview(const Velocity& wanted, Velocity& command) const noexcept {
    for (Index c = 0; c < dof(); ++c) command(c) = command_(c);
    (void)limit(true, wanted, command);
    (void)limit(false, wanted, command);
  }
  /// ẏ of the last cycle, n; 0 where nothing may be commanded.
  const Velocity& command() const noexcept { return command_; }
  /// Nothing may be commanded in column `column`, or something again.
  void set_given(Index column, bool given) noexcept {
    at(column).given = given;
    command_(column) = Scalar(0);
    free(column);
  }

  /// The first joint that is further outside its range than the range is wide, an index into
  /// `robot.joints()`; −1: none.
  Index implausible_joint(const R& robot) const noexcept {
    if constexpr (JointedRobot<R>) {
      for (const Column& column : columns_) {
        if (column.joint < 0) continue;
        const double q = static_cast<double>(robot.position(column.joint));
        const double width = column.upper - column.lower;
        if (!(q >= column.lower - width && q <= column.upper + width)) return column.joint;
      }
    }
    return -1;
  }

 private:
  static constexpr double longest = 10;  // s, of a reaction
  struct Column {
    Scalar max_velocity{infinity<Scalar>}, max_acceleration{infinity<Scalar>};
    Scalar down{infinity<Scalar>}, up{infinity<Scalar>};      // what can still brake, ≥ 0
    Scalar least{-infinity<Scalar>}, most{infinity<Scalar>};  // by position and velocity
    bool base{false}, given{false}, brakes{false};
    Index joint{-1};                // of a joint with a range
    double lower, upper;            // its range
    double moved, lowest, highest;  // where the own commands can have led, less where it was
  };

  [[gnu::cold]] MotionLimits(Index dof, double reaction_time)
      : reaction_time_(reaction_time),
        columns_(static_cast<std::size_t>(dof)),
        history_(dof, checked(reaction_time)),
        bounds_{detail::zeros<Velocity>(dof), detail::zeros<Velocity>(dof)},
        lower_(detail::zeros<Velocity>(dof)),
        upper_(lower_),
        command_(lower_) {
    for (Index c = 0; c < dof; ++c) free(c);
  }
  static double checked(double reaction_time) {
    detail::require_positive("MotionLimits", "reaction_time", reaction_time);
    if (reaction_time > longest) {
      detail::invalid("MotionLimits: reaction_time must be at most 10 s, got ", reaction_time);
    }
    return reaction_time;
  }
  [[gnu::cold]] void take_joints(const R& robot, const Options& options) {
    if (!(options.max_velocity > Scalar(0)) || !(options.max_acceleration > Scalar(0))) {
      detail::invalid("MotionLimits: limits of velocity and acceleration must be > 0");
    }
    if constexpr (JointedRobot<R>) {
      for (Index i = 0; i < static_cast<Index>(robot.joints().size()); ++i) {
        take(i, robot.joints()[static_cast<std::size_t>(i)], options);
      }
      for (const auto& given : options.joints) {
        const Index i = joint_index(robot, given.name, "MotionLimits");
        const Index column = robot.joints()[static_cast<std::size_t>(i)].column;
        at(column).joint = -1;
        take(i, given, options, column);
      }
    } else if (!options.joints.empty()) {
      detail::invalid("MotionLimits: limits of joints, but the robot states no joints");
    }
  }
  [[gnu::cold]] void take(Index i, const JointInfo<Scalar>& info, const Options& options) {
    take(i, info, options, info.column);
  }
  [[gnu::cold]] void take(Index i, const JointInfo<Scalar>& info, const Options& options, Index c) {
    if (!(info.lower < info.upper)) {
      detail::invalid("MotionLimits: joint '", info.name, "': limits must be in order, got [",
                      info.lower, ", ", info.upper, "]");
    }
    if (!(info.max_velocity > Scalar(0)) || !(info.max_acceleration > Scalar(0))) {
      detail::invalid("MotionLimits: joint '", info.name,
                      "': limits of velocity and acceleration must be > 0");
    }
    Column& column = at(c);
    column.max_velocity = std::min(info.max_velocity, options.max_velocity);
    column.max_acceleration = std::min(info.max_acceleration, options.max_acceleration);
    column.lower = static_cast<double>(info.lower);
    column.upper = static_cast<double>(info.upper);
    const bool ranged = std::isfinite(column.upper) || std::isfinite(column.lower);
    if (ranged && !info.continuous) column.joint = i;
  }
  [[gnu::cold]] void take_base(const R& robot, const Options& options) {
    std::size_t k = 0;
    if constexpr (MobileRobot<R>) {
      const ColumnRange base = robot.base_columns();
      k = static_cast<std::size_t>(base.count);
      for (Index j = 0; j < base.count; ++j) {
        Column& column = at(base.first + j);
        const auto i = static_cast<std::size_t>(j);
        column.base = true;
        if (options.base_velocity.size() == k) column.max_velocity = options.base_velocity[i];
        if (options.base_acceleration.size() == k) {
          column.max_acceleration = options.base_acceleration[i];
        }
        if (!(column.max_velocity > Scalar(0)) || !(column.max_acceleration > Scalar(0))) {
          detail::invalid("MotionLimits: limits of the base must be > 0");
        }
      }
    }
    for (const auto* limits : {&options.base_velocity, &options.base_acceleration}) {
      if (limits->empty() || limits->size() == k) continue;
      detail::invalid("MotionLimits: ", limits->size(), " limits of the base, which has ", k,
                      " columns");
    }
  }

  Column& at(Index c) noexcept { return columns_[static_cast<std::size_t>(c)]; }
  [[gnu::cold]] void free(Index c) noexcept {
    lower_(c) = bounds_.lower(c) = -infinity<Scalar>;
    upper_(c) = bounds_.upper(c) = infinity<Scalar>;
  }

  // How far the joints may still go, and with it how fast.
  void carry(const R& robot, Cycle cycle) noexcept {
    history_.push(command_, cycle.usual);
    const double T = std::max(reaction_time_, cycle.usual);
    for (Column& column : columns_) column.moved = column.lowest = column.highest = 0;
    // Any age of the state up to T − cycle must be safe, so the extremes count, not the ends.
    history_.from_newest(T - cycle.usual, [this](const double* velocity, double duration) {
      for (Column& column : columns_) {
        column.moved += *velocity++ * duration;
        column.lowest = std::min(column.lowest, column.moved);
        column.highest = std::max(column.highest, column.moved);
      }
    });
    for (Column& column : columns_) {
      if (column.joint < 0) continue;
      const double q = static_cast<double>(robot.position(column.joint));
      const double a = static_cast<double>(column.max_acceleration);
      column.up = static_cast<Scalar>(speed(column.upper - (q + column.highest), T, a));
      column.down = static_cast<Scalar>(speed(q + column.lowest - column.lower, T, a));
    }
  }
  // The largest v with v T + v² / 2a ≤ d.
  static double speed(double d, double T, double a) noexcept {
    if (!(d > 0)) return 0;
    if (d == infinity<double>) return d;
    return 2 * d / (T + std::sqrt(T * T + 2 * d / a));
  }

  [[gnu::noinline]] void box(bool base, Cycle cycle) noexcept {
    for (Index c = 0; c < dof(); ++c) {
      Column& column = at(c);
      if (column.base != base || column.given) continue;
      const Scalar last = command_(c), a = column.max_acceleration;
      const Scalar highest = column.most = std::min(column.max_velocity, column.up);
      const Scalar lowest = column.least = -std::min(column.max_velocity, column.down);
      column.brakes = last > highest || last < lowest;
      lower_(c) = lowest;
      upper_(c) = highest;
      if (!base) {
        bounds_.lower(c) = lowest;
        bounds_.upper(c) = highest;
      }
      if (a < infinity<Scalar>) {
        const Scalar gain = a * static_cast<Scalar>(cycle.step);
        const Scalar loss = a * static_cast<Scalar>(cycle.usual);
        // Towards zero at least as far as in a usual cycle.
        const Scalar from = std::min(last - gain, std::max(Scalar(0), last - loss));
        const Scalar to = std::max(last + gain, std::min(Scalar(0), last + loss));
        lower_(c) = std::clamp(lowest, from, to);
        upper_(c) = std::clamp(highest, from, to);
      }
    }
  }

  [[gnu::noinline]] bool limit(bool base, const Velocity& wanted, Velocity& out) const noexcept {
    const auto mine = [&](const Column& column) { return column.base == base && !column.given; };
    // The base as a whole, so that it keeps its direction.
    Scalar whole(1);
    for (Index c = 0; base && c < dof(); ++c) {
      const Column& column = columns_[static_cast<std::size_t>(c)];
      if (!mine(column) || std::abs(wanted(c)) <= column.most) continue;
      whole = std::min(whole, column.most / std::abs(wanted(c)));
    }
    Scalar scale(1);
    bool all = true;
    for (Index c = 0; c < dof(); ++c) {
      const Column& column = columns_[static_cast<std::size_t>(c)];
      if (!mine(column)) continue;
      const Scalar aim = std::clamp(whole * wanted(c), column.least, column.most);
      all = all && aim == wanted(c);
      if (aim >= lower_(c) && aim <= upper_(c)) continue;
      all = false;
      if (column.brakes) continue;
      const Scalar from = std::clamp(command_(c), lower_(c), upper_(c));
      const Scalar room = (aim > upper_(c) ? upper_(c) : lower_(c)) - from;
      scale = std::min(scale, room / (aim - from));
    }
    for (Index c = 0; c < dof(); ++c) {
      const Column& column = columns_[static_cast<std::size_t>(c)];
      if (!mine(column)) continue;
      Scalar next = std::clamp(whole * wanted(c), column.least, column.most);
      if (scale < Scalar(1) && !column.brakes) {
        const Scalar from = std::clamp(command_(c), lower_(c), upper_(c));
        next = from + scale * (next - from);
      }
      out(c) = std::clamp(next, lower_(c), upper_(c));
    }
    return all;
  }

  double reaction_time_{0.1};
  bool unlimited_{false};
  List<Column> columns_;
  detail::CommandHistory history_;
  VelocityBounds<Scalar, R::size> bounds_;
  // Also where the default constructor leaves the rest empty: a copy reads them.
  Velocity lower_ = detail::zeros<Velocity>(R::size == Eigen::Dynamic ? 0 : R::size);
  Velocity upper_ = lower_, command_ = lower_;
};

}  // namespace icat
