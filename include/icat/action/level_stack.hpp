// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Runs actions: from the tasks of the unified hierarchy and the phase activations to the levels
/// that a solver gets.
///
///     a_j = aⁱ_j(x_j) · aᵖ_j(p)          [Coop, Eq. (17)]
#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "icat/action/transition.hpp"
#include "icat/action/unified_hierarchy.hpp"
#include "icat/core/step_clock.hpp"

namespace icat {

/// One level of a hierarchy as a solver gets it, phase activations included.
template <class Scalar, int N>
struct Level {
  JacobianMatrix<Scalar, N> jacobian;         ///< rows × n
  Vector<Scalar, Eigen::Dynamic> activation;  ///< rows, in [0, 1]
  Vector<Scalar, Eigen::Dynamic> reference;   ///< rows
  /// What the solver multiplies each row of J and ẋ̄ with: L, or the task's share of it, to the
  /// power −`length_power`.
  Vector<Scalar, Eigen::Dynamic> row_scale;

  /// `row_scale` as `Tpik::add_level` takes it.
  std::span<const Scalar> scales() const noexcept {
    return {row_scale.data(), static_cast<std::size_t>(row_scale.size())};
  }
};

/// See the file comment. Construction allocates and throws; nothing else does.
template <Robot R>
class LevelStack {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// What a solver gets.
  using RobotLevel = Level<Scalar, R::size>;

  /// Computes the unified hierarchy of `actions`. `robot` and the tasks must outlive this object.
  /// `max_step`: of the clock, s. `length`: L, m; none: the largest of the tasks, 1
  /// where they have none.
  /// @throws std::invalid_argument on bad actions (see `unified_hierarchy`), a task that belongs to
  ///         another robot, or a bad `max_step` or `length`.
  [[gnu::cold]] LevelStack(const R& robot, const std::vector<Action<R>>& actions, double max_step,
                           std::optional<Scalar> length)
      : robot_(robot),
        length_(length ? *length : longest(actions)),
        clock_(max_step),
        hierarchy_(unified_hierarchy(checked(robot, actions))),
        transition_(count_entries()),
        targets_(transition_.count()),
        names_(actions.size()),
        levels_(hierarchy_.size()) {
    detail::require_positive("controller", "characteristic_length", length_);
    for (std::size_t a = 0; a < actions.size(); ++a) names_[a] = actions[a].name;
    for (std::size_t k = 0; k < levels_.size(); ++k) {
      Index rows = 0;
      for (const auto& entry : hierarchy_[k]) {
        rows += entry.task->rows();
        task_of_.push_back(detail::append_once(*entry.task, tasks_));
      }
      RobotLevel& level = levels_[k];
      level.jacobian.resize(rows, robot.dof());
      level.activation.resize(rows);
      level.reference.resize(rows);
      detail::fill(level.jacobian, Scalar(0));
      detail::fill(level.activation, Scalar(0));
      detail::fill(level.reference, Scalar(0));
      level.row_scale.resize(rows);
      Index row = 0;
      for (const auto& entry : hierarchy_[k]) {
        for (Index i = 0; i < entry.task->rows(); ++i) {
          const Scalar scale = row_scale(*entry.task, i);
          if (!(scale > Scalar(0) && scale < infinity<Scalar>)) {
            detail::invalid("task '", entry.task->name(), "': a characteristic_length of ", length_,
                            " to the power ", entry.task->length_power(i), " is no number");
          }
          level.row_scale(row++) = scale;
        }
      }
    }
    wanted_ = List<bool>(tasks_.size());
  }

  /// Enters `action` at once, without a fade, for a robot that already moves. A refusal changes
  /// nothing.
  Status start(std::string_view action, double time) noexcept {
    const std::size_t index = find(action);
    if (index == names_.size()) return Status::unknown_action;
    if (const Status status = clock_.advance(time); status != Status::ok) return status;
    enter(index);
    return Status::ok;
  }
  /// Moves to `action` over `duration` seconds, from the activations as they are now; also in the
  /// middle of another transition, also back. If `action` runs or is being entered nothing changes,
  /// so it may be called in every cycle. As the first action it is entered at once, so that its
  /// priorities hold; whoever commands fades the command in. A refusal changes nothing.
  Status switch_to(std::string_view action, double time, double duration) noexcept {
    const std::size_t index = find(action);
    if (index == names_.size()) return Status::unknown_action;
    if (!(duration > 0.0) || !std::isfinite(duration)) return Status::invalid_duration;
    if (const Status status = clock_.advance(time); status != Status::ok) return status;
    if (action_ == none) enter(index);
    if (index == action_) return Status::ok;
    set_targets(index);
    action_ = index;
    return transition_.start({targets_.data(), targets_.size()}, clock_.elapsed(), duration);
  }
  /// A stamp without a cycle.
  Status tick(double time) noexcept { return clock_.advance(time); }
  /// Phase activations at `time`, tasks at the robot's state, rows stacked into `levels`.
  Status update(double time) noexcept {
    const Status status = clock_.advance(time);
    return status == Status::ok ? refresh() : status;
  }
  /// The same at the last stamp.
  [[gnu::noinline]] Status refresh() noexcept {
    if (action_ == none) return Status::not_started;
    (void)transition_.update(clock_.elapsed());
    wanted_.fill(false);
    for (std::size_t k = 0; k < task_of_.size(); ++k) {
      if (transition_.values()[k] > 0) wanted_[task_of_[k]] = true;
    }
    for (std::size_t k = 0; k < tasks_.size(); ++k) {
      if (wanted_[k]) tasks_[k]->update();
    }
    std::size_t i = 0;
    for (std::size_t k = 0; k < hierarchy_.size(); ++k) {
      Index row = 0;
      for (const auto& entry : hierarchy_[k]) {
        stack(*entry.task, transition_.values()[i++], levels_[k], row);
        row += entry.task->rows();
      }
    }
    return Status::ok;
  }

  /// L, m: see `Level::row_scale`.
  Scalar characteristic_length() const noexcept { return length_; }
  /// The clock of the stamps given so far.
  const StepClock& clock() const noexcept { return clock_; }
  /// The robot it was built for.
  const R& robot() const noexcept { return robot_; }
  /// Name of the action that runs or is being entered; empty before `start`.
  std::string_view action() const noexcept {
    return action_ == none ? std::string_view{} : std::string_view{names_[action_]};
  }
  /// Whether there is an action of this name.
  bool has(std::string_view action) const noexcept { return find(action) != names_.size(); }
  /// An action is being entered.
  bool in_transition() const noexcept { return action_ != none && !transition_.finished(); }
  /// The unified hierarchy of the actions.
  const UnifiedHierarchy<R>& hierarchy() const noexcept { return hierarchy_; }
  /// aᵖ of every entry of the hierarchy, level by level.
  std::span<const double> phase_activations() const noexcept { return transition_.values(); }
  /// The levels of `hierarchy` as of the last `update`.
  std::span<const RobotLevel> levels() const noexcept { return {levels_.data(), levels_.size()}; }

 private:
  static constexpr std::size_t none = static_cast<std::size_t>(-1);

  [[gnu::cold]] static const std::vector<Action<R>>& checked(
      const R& robot, const std::vector<Action<R>>& actions) {
    for (const auto& action : actions) {
      for (const auto& level : action.levels) {
        for (const Task<R>& task : level) {
          if (&task.robot() != &robot) {
            detail::invalid("action '", action.name, "': task '", task.name(),
                            "' belongs to another robot");
          }
        }
      }
    }
    return actions;
  }
  [[gnu::cold]] static Scalar longest(const std::vector<Action<R>>& actions) {
    Scalar length(0);
    for (const auto& action : actions) {
      for (const auto& level : action.levels) {
        for (const Task<R>& task : level) length = std::max(length, task.characteristic_length());
      }
    }
    return length > Scalar(0) ? length : Scalar(1);
  }
  /// Rows `row`… of `level` are those of `task` with the phase activation `phase`.
  void stack(const Task<R>& task, double phase, RobotLevel& level, Index row) const noexcept {
    // Without activation old values could be what made the level be refused; the solver checks
    // inactive rows too.
    const bool active = phase > 0, good = fits(task), use = active && good;
    const Index rows = task.rows(), n = robot_.dof(), pitch = level.jacobian.rows();
    // Column by column; a task that is alone on its level, at once.
    const Index blocks = rows == pitch ? 1 : n, length = rows == pitch ? rows * n : rows;
    for (Index b = 0; b < blocks; ++b) {
      Scalar* to = level.jacobian.data() + row + b * pitch;
      if (use) {
        std::copy_n(task.jacobian().data() + b * length, length, to);
      } else {
        std::fill_n(to, length, Scalar(0));
      }
    }
    for (Index i = 0; i < rows; ++i) {
      level.activation(row + i) =
          use ? static_cast<Scalar>(phase) * task.activation()(i) : Scalar(0);
      level.reference(row + i) = use      ? task.reference()(i)
                                 : active ? std::numeric_limits<Scalar>::quiet_NaN()
                                          : Scalar(0);
    }
  }
  /// A task of the user's may have resized what it yields; its level is then refused.
  bool fits(const Task<R>& task) const noexcept {
    return task.jacobian().rows() == task.rows() && task.jacobian().cols() == robot_.dof() &&
           task.reference().size() == task.rows() && task.activation().size() == task.rows();
  }
  /// L, or the task's share of it, to the power −`length_power`.
  Scalar row_scale(const Task<R>& task, Index row) const noexcept {
    const Scalar length = task.length_share() * length_;
    Scalar product(1);
    Index power = task.length_power(row);
    for (; power > 0; --power) product /= length;
    for (; power < 0; ++power) product *= length;
    return product;
  }
  std::size_t count_entries() const {
    std::size_t count = 0;
    for (const auto& level : hierarchy_) count += level.size();
    return count;
  }
  [[gnu::noinline]] std::size_t find(std::string_view action) const noexcept {
    std::size_t index = 0;
    while (index < names_.size() && names_[index] != action) ++index;
    return index;
  }
  [[gnu::noinline]] void enter(std::size_t action) noexcept {
    set_targets(action);
    (void)transition_.set({targets_.data(), targets_.size()}, clock_.elapsed());
    action_ = action;
  }
  [[gnu::noinline]] void set_targets(std::size_t action) noexcept {
    std::size_t i = 0;
    for (const auto& level : hierarchy_) {
      for (const auto& entry : level) targets_[i++] = entry.in_action[action] ? 1 : 0;
    }
  }

  const R& robot_;
  Scalar length_;
  StepClock clock_;
  UnifiedHierarchy<R> hierarchy_;
  Transition transition_;
  List<double> targets_;
  List<std::string> names_;
  List<Task<R>*> tasks_;
  List<std::size_t> task_of_;  // which of them, for each entry
  List<bool> wanted_;          // those with a phase activation
  List<RobotLevel> levels_;
  std::size_t action_{none};
};

}  // namespace icat
