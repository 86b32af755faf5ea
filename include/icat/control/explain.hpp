// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Why is my task not met? For each task the rate that it asks for, the rate that it gets, and the
/// causes of the difference: `icat::explain(controller)`, or an `Explainer` in the loop.
///
/// The loss of a task is the part of its reference that the command does not achieve, with its own
/// activations aⁱ:
///
///     l = aⁱ (ẋ̄ − J ẏ),     loss = ‖l‖
///
/// To divide it into shares, the cycle is solved again with one cause more each time, in the order
/// of `LossCause`: the task alone, without regularization; with it; with its activations; with the
/// given columns; below the highest level; below the two highest, …; beside its equals; all levels;
/// within the bounds; as commanded. With the rates ẋ₀ = ẋ̄, ẋ₁, …, ẋ_s = J ẏ of these solutions
///
///     share_i = (l / ‖l‖)ᵀ aⁱ (ẋ_{i−1} − ẋ_i),     Σ share_i = loss
///
/// but for rounding, for any solutions. If two causes would explain the same part, it is assigned
/// to the first. All of this is ours: [Coop] and [MARIS] order tasks and measure no losses.
///
/// A task below K active levels costs K + 1 solutions, and at most four more; docs/explain.md has
/// the times. The controller is read, never changed.
#pragma once

#include <cmath>
#include <numbers>
#include <string>

#include "icat/control/explanation_text.hpp"
#include "icat/control/loss_shares.hpp"

namespace icat {

/// Explains the last cycle of a `Controller` or a `ParallelController`, which must outlive it and
/// belongs to the same thread. Construction, `sentence` and `text` allocate; nothing else does.
template <class C>
class Explainer {
 public:
  /// Scalar type.
  using Scalar = typename C::Scalar;

  /// From when on a loss counts.
  struct Options {
    Scalar negligible{static_cast<Scalar>(1e-3)};  ///< met: a smaller loss, in the task's unit
    Scalar tolerated{static_cast<Scalar>(0.1)};    ///< met: a smaller part of what is wanted
    Scalar blocked{static_cast<Scalar>(0.5)};      ///< alarm: a larger part of what is wanted
  };

  /// Explains `controller` as it is.
  [[gnu::cold]] explicit Explainer(const C& controller) : Explainer(controller, Options{}) {}
  /// The same with options.
  /// @throws std::invalid_argument on an option that is not finite and > 0.
  [[gnu::cold]] Explainer(const C& controller, const Options& options)
      : controller_(controller), options_(options), losses_(controller) {
    detail::require_positive("Explainer", "negligible", options.negligible);
    detail::require_positive("Explainer", "tolerated", options.tolerated);
    detail::require_positive("Explainer", "blocked", options.blocked);
    std::size_t entries = 0;
    for (const auto& level : losses_.hierarchy()) entries += level.size();
    tasks_ = List<TaskExplanation<Scalar>>(entries);
    shares_ = List<LossShare<Scalar>>(entries * losses_.most());
    update();
  }
  explicit Explainer(const C&&) = delete;
  Explainer(const C&&, const Options&) = delete;
  Explainer(const Explainer&) = delete;
  Explainer& operator=(const Explainer&) = delete;

  /// Explains the last cycle, right after it: nothing may have changed since, but the robot's state
  /// may have.
  void update() noexcept {
    const auto& ramp = detail::Inside<C>::ramp(controller_);
    status_ = detail::Inside<C>::status(controller_);
    fading_ = ramp.gain() < 1 ? detail::Fading::recovers
              : ramp.runs()   ? detail::Fading::starts
                              : detail::Fading::stops;
    losses_.begin();
    std::size_t e = 0;
    for (std::size_t k = 0; k < losses_.hierarchy().size(); ++k) {
      Index first = 0;
      for (const auto& entry : losses_.hierarchy()[k]) {
        explain(*entry.task, e, k, first);
        first += entry.task->rows();
        ++e;
      }
    }
  }

  /// One for each entry of the unified hierarchy, level by level; a task that stands on two levels
  /// has two.
  std::span<const TaskExplanation<Scalar>> tasks() const noexcept {
    return {tasks_.data(), tasks_.size()};
  }
  /// Of the last cycle; `not_started` before the first.
  Status status() const noexcept { return status_; }
  /// The last cycle was refused, or a task alarms.
  bool alarm() const noexcept {
    for (const auto& t : tasks_) {
      if (t.alarm) return true;
    }
    return status_ != Status::ok && status_ != Status::not_started;
  }

  /// How people call column `c` of ẏ, in [0, n): its joint, or its place in the base.
  std::string column_name(Index c) const { return column(c).name; }
  /// Task `i` of `tasks` in a sentence, sometimes two.
  std::string sentence(std::size_t i) const {
    const auto t = plain(tasks_[i]);
    const auto* most = t.explanation.most();
    return detail::sentence_of(t.explanation, column(most ? most->column : -1), status_, fading_,
                               controller_.action());
  }
  /// The tasks of the action with their shares, and at the end what matters most in a sentence.
  std::string text() const {
    detail::Words out;
    out << "Action ";
    out.quoted(controller_.action()) << ", cycle: " << describe(status_) << "\n";
    for (std::size_t i = 0; i < tasks_.size(); ++i) append(out, i);
    out << conclusion() << "\n";
    return out.text;
  }
  /// What matters most, in a sentence: the last line of `text`.
  std::string conclusion() const {
    detail::Words out;
    if (status_ == Status::not_started) return "The controller has not done a cycle yet.";
    const Status fault = status_;
    if (fault != Status::ok && !refused()) {
      out << (detail::is_lasting(fault) ? "The robot stops: " : "This cycle is refused: ")
          << describe(fault) << ".";
      return out.text;
    }
    const std::size_t worst = most_urgent();
    if (worst == tasks_.size()) return "All is well: every task that wants to move does.";
    out << (alarm() ? "Look here: " : "No fault. ") << sentence(worst);
    return out.text;
  }

 private:
  // In double, for the words.
  struct Plain {
    TaskExplanation<double> explanation;
    List<LossShare<double>> shares;
  };

  void explain(const Task<typename detail::LossShares<C>::Robot>& task, std::size_t e,
               std::size_t k, Index first) noexcept {
    TaskExplanation<Scalar>& t = tasks_[e];
    t = TaskExplanation<Scalar>{};
    t.task = task.name();
    t.level = static_cast<Index>(k);
    t.rows = task.rows();
    t.phase = static_cast<Scalar>(losses_.actions().phase_activations()[e]);
    const Remaining<Scalar> left = task.remaining();
    t.position_left = left.position;
    t.angle_left = left.angle;
    if (!(t.phase > Scalar(0))) return;  // off
    t.half_turn = left.angle > std::numbers::pi_v<Scalar> - static_cast<Scalar>(0.01);
    LossShare<Scalar>* shares = shares_.data() + e * losses_.most();
    const Index count = losses_.measure(e, k, first, t, shares);
    if (count < 0) {
      t.verdict = Verdict::faulty;
      t.alarm = true;
      return;
    }
    t.shares = {shares, static_cast<std::size_t>(count)};
    t.verdict = judge(t);
    t.alarm = t.verdict == Verdict::faulty ||
              (t.verdict == Verdict::blocked && t.loss > options_.blocked * t.wanted &&
               t.wanted > options_.negligible);
  }
  Verdict judge(const TaskExplanation<Scalar>& t) const noexcept {
    if (t.active_rows == 0) return Verdict::idle;
    if (!(t.loss > options_.negligible) || !(t.loss > options_.tolerated * t.wanted)) {
      return Verdict::met;
    }
    const LossShare<Scalar>* most = t.most();
    switch (most ? most->cause : LossCause::below) {
      case LossCause::activation:
      case LossCause::transition:
      case LossCause::below:
        return Verdict::fades;
      case LossCause::held:
      case LossCause::ramp:
        return status_ == Status::ok ? Verdict::fades : Verdict::faulty;
      case LossCause::level:
      case LossCause::equal:
        return Verdict::yields;
      case LossCause::bound:
      case LossCause::limit:
        return most->limit == LimitKind::position ? Verdict::blocked : Verdict::limited;
      case LossCause::base:
        return Verdict::limited;  // one cycle cannot tell a current from a dead thruster
      case LossCause::refused:
        return Verdict::faulty;
      default:
        return Verdict::blocked;
    }
  }

  // Whether a task says more than the status of the cycle.
  bool refused() const noexcept {
    for (const auto& t : tasks_) {
      if (t.verdict == Verdict::faulty && (!t.most() || t.most()->cause == LossCause::refused)) {
        return true;
      }
    }
    return false;
  }
  // Alarms first, the highest of them; then the largest loss, of what fades last. None: their
  // number.
  std::size_t most_urgent() const noexcept {
    std::size_t worst = tasks_.size();
    Scalar least(3);
    for (std::size_t i = 0; i < tasks_.size(); ++i) {
      const TaskExplanation<Scalar>& t = tasks_[i];
      if (t.alarm) return i;
      if (t.verdict <= Verdict::met || !(t.wanted > options_.negligible)) continue;
      const Scalar rank = t.fraction() + Scalar(t.verdict == Verdict::fades ? 1 : 0);
      if (!(rank < least)) continue;
      least = rank;
      worst = i;
    }
    return worst;
  }

  void append(detail::Words& out, std::size_t i) const {
    const Plain t = plain(tasks_[i]);
    if (t.explanation.verdict == Verdict::off) return;
    out << (t.explanation.alarm ? "! " : "  ") << sentence(i) << "\n";
    if (t.explanation.verdict <= Verdict::met || t.shares.size() == 0) return;
    out << "    wants " << t.explanation.wanted << ", loses " << t.explanation.loss << ":\n";
    for (const auto& share : t.shares) {
      // Less than a hundredth explains nothing.
      if (!(std::abs(share.amount) >= 0.01 * t.explanation.loss)) continue;
      detail::append_share(out, share, t.explanation.loss, column(share.column).name);
    }
  }
  [[gnu::cold]] Plain plain(const TaskExplanation<Scalar>& t) const {
    Plain out;
    auto& x = out.explanation;
    x.task = t.task;
    x.verdict = t.verdict;
    x.alarm = t.alarm;
    x.half_turn = t.half_turn;
    x.phase = static_cast<double>(t.phase);
    x.wanted = static_cast<double>(t.wanted);
    x.loss = static_cast<double>(t.loss);
    x.position_left = static_cast<double>(t.position_left);
    x.angle_left = static_cast<double>(t.angle_left);
    for (const auto& share : t.shares) {
      out.shares.push_back({share.cause, share.limit, static_cast<double>(share.amount),
                            share.level, share.task, share.row,
                            static_cast<double>(share.activation), share.column, share.alone});
    }
    x.shares = {out.shares.data(), out.shares.size()};
    return out;
  }
  [[gnu::cold]] detail::ColumnWords column(Index c) const {
    detail::ColumnWords out;
    const auto& robot = losses_.actions().robot();
    if constexpr (JointedRobot<typename detail::LossShares<C>::Robot>) {
      for (std::size_t i = 0; i < robot.joints().size(); ++i) {
        const auto& joint = robot.joints()[i];
        if (joint.column != c) continue;
        out.name = joint.name;
        out.lower = static_cast<double>(joint.lower);
        out.upper = static_cast<double>(joint.upper);
        out.position = static_cast<double>(robot.position(static_cast<Index>(i)));
        out.ranged = !joint.continuous && std::isfinite(out.lower) && std::isfinite(out.upper);
        return out;
      }
    }
    const ColumnRange base = detail::base_columns(robot);
    detail::Words name;
    if (base.holds(c)) {
      name << "the base's ";
      if constexpr (MobileRobot<typename detail::LossShares<C>::Robot>) {
        append_axis(name, c - base.first);
      }
    } else {
      name << "column " << c;
    }
    out.name = name.text;
    return out;
  }
  // Of the base's column `j`: its axis, where it is one.
  [[gnu::cold]] void append_axis(detail::Words& out, Index j) const {
    constexpr const char* names[] = {"surge", "sway", "heave", "roll", "pitch", "yaw"};
    const auto& motion = losses_.actions().robot().base_motion();
    Index axis = -1, count = 0;
    for (Index i = 0; i < 6; ++i) {
      if (motion(i, j) != Scalar(0)) axis = i, ++count;
    }
    if (count == 1) {
      out << names[axis];
    } else {
      out << "column " << j;
    }
  }

  const C& controller_;
  Options options_;
  detail::LossShares<C> losses_;
  List<TaskExplanation<Scalar>> tasks_;
  List<LossShare<Scalar>> shares_;
  Status status_{Status::not_started};
  detail::Fading fading_{detail::Fading::starts};
};

/// Explains the last cycle of `controller`, once: `icat::explain(controller).text()`. Allocates; in
/// the loop keep an `Explainer` and update it.
template <class C>
Explainer<C> explain(const C& controller) {
  return Explainer<C>(controller);
}
/// The controller must outlive the explanation.
template <class C>
void explain(const C&& controller) = delete;

}  // namespace icat
