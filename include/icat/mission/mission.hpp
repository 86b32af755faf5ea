// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A mission: phases that follow events. [MARIS, III-A] has one in three steps (look for the
/// object, grasp it, take it away), [Coop, Table I] one in seven; neither prints what happens on
/// the way when something fails, so the form of the table is ours.
///
/// A phase runs an action and ends in one of three ways: a condition has held for a while, an event
/// of its table is raised, its time is up. A phase that ends the mission has none of them; its name
/// says how the mission ended.
///
///     raise(event)   the phase that follows is entered at once; an event that the phase does not
///                    list is ignored, so that every event in every phase has a defined outcome
///     step(time)     the condition first, then the time limit; at most one phase is entered
///
/// Each phase is reported by a step before it may end, except by an event. A mission refers to no
/// robot: `drive` passes the action to any object with `switch_to` and `stop`.
#pragma once

#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "icat/core/list.hpp"
#include "icat/core/step_clock.hpp"

namespace icat {

/// How a phase ends the mission.
enum class PhaseEnd {
  none,     ///< it does not
  success,  ///< the mission's goal is reached
  failure   ///< the phase's name is the reason
};

/// Of a phase that may last as long as it takes.
inline constexpr double no_time_limit = std::numeric_limits<double>::infinity();

/// What follows an event.
struct Reaction {
  std::string event = "";      ///< its name
  std::string to = "";         ///< the phase that follows
  int times = 0;               ///< so often at most, from one phase; 0: without limit
  std::string otherwise = "";  ///< the phase that follows once `times` are used up
};

/// A row of the table.
struct Phase {
  std::string name = "";             ///< in reports and in the rows of other phases
  std::string action = "";           ///< of the controller; none: it stops
  double fade = 2;                   ///< s, > 0: into the action, or to a stop; "a couple" [Coop]
  std::function<bool()> until = {};  ///< a condition that ends it; must not throw
  /// s: so long the condition has to be met. > 0 where it asks for a task's error: that is of the
  /// task's last update, which an action that has just been entered has yet to bring.
  double hold = 0;
  std::string then = "";              ///< the phase that follows the condition
  double time_limit = no_time_limit;  ///< s: a phase that lasts longer is ended
  std::string on_timeout = "";        ///< the phase that follows the time limit
  std::vector<Reaction> on = {};      ///< events
  PhaseEnd end = PhaseEnd::none;      ///< it ends the mission
};

/// Why a phase was entered.
enum class Cause {
  start,       ///< it is the first
  condition,   ///< that of the phase before was met
  time_limit,  ///< that of the phase before was over
  event        ///< see `Mission::event`
};

/// One line for a log. No allocation.
constexpr const char* describe(Cause cause) noexcept {
  switch (cause) {
    case Cause::start:
      return "start";
    case Cause::condition:
      return "condition";
    case Cause::time_limit:
      return "time limit";
    case Cause::event:
      return "event";
  }
  return "unknown cause";
}

/// See the file comment. Construction allocates and throws; nothing else does.
class Mission {
 public:
  /// The first phase is where it begins. `always`: reactions of every phase that has none of its
  /// own to that event and does not end the mission. `max_step`: longest period of `step`, s; a
  /// clock that jumps further costs one usual step (step_clock.hpp).
  /// @throws std::invalid_argument on phases without a name or of the same name, phases that are
  ///         named but not there or cannot be reached, a phase without an end of its own, one end
  ///         without what follows, numbers out of range.
  [[gnu::cold]] explicit Mission(std::vector<Phase> phases, std::vector<Reaction> always = {},
                                 double max_step = 1)
      : phases_(std::move(phases)), clock_(max_step) {
    if (phases_.empty()) detail::invalid("mission: no phase");
    for (Phase& phase : phases_) {
      check(phase);
      if (phase.end != PhaseEnd::none) continue;
      for (const Reaction& r : always) {
        if (!handles(phase, r.event)) phase.on.push_back(r);
      }
    }
    check("always", always);
    connect();
    restart();
  }

  /// Back to the first phase, with nothing used up; the next step reports it.
  void restart() noexcept {
    used_.fill(0);
    enter(0, Cause::start);
    previous_ = -1;
  }

  /// Reports an event. `unknown_event` if no phase lists it; otherwise `ok`, whether or not the
  /// present phase lists it.
  Status raise(std::string_view event) noexcept {
    Status status = Status::unknown_event;
    for (std::size_t p = 0; p < phases_.size(); ++p) {
      const std::vector<Reaction>& on = phases_[p].on;
      for (std::size_t i = 0; i < on.size(); ++i) {
        if (on[i].event != event) continue;
        status = Status::ok;
        if (p != phase_) continue;
        const std::size_t r = first_reaction_[p] + i;
        const bool left = on[i].times == 0 || used_[r] < on[i].times;
        if (left && on[i].times > 0) ++used_[r];
        event_ = i;
        enter(left ? to_[r] : otherwise_[r], Cause::event);
        return status;
      }
    }
    return status;
  }

  /// A cycle at `time`, s, on one clock. `non_finite`, and `clock_stalled`, where the time stands
  /// still or every step is longer than max_step: refused, no condition is asked and no limit
  /// ends a phase; what `raise` enters meanwhile is reported by the next step that is `ok`.
  Status step(double time) noexcept {
    Status status = clock_.advance(time);
    entered_ = false;
    if (status == Status::ok && clock_.stalled()) {
      status = Status::clock_stalled;
      met_ = false;  // for all that is known
    }
    if (status != Status::ok) return status;
    if (!reported_) {
      reported_ = entered_ = true;
      return status;
    }
    const Phase& phase = phases_[phase_];
    if (phase.end != PhaseEnd::none) return status;
    const bool met = phase.until && phase.until();  // which may raise an event
    if (reported_) {
      if (met && !met_) met_from_ = clock_.elapsed();
      met_ = met;
      if (met && clock_.elapsed() - met_from_ >= phase.hold - rounding) {
        enter(then_[phase_], Cause::condition);
      }
    }
    if (reported_ && time_in_phase() > phase.time_limit + rounding) {
      enter(on_timeout_[phase_], Cause::time_limit);
    }
    if (!reported_) reported_ = entered_ = true;
    return status;
  }
  /// The last step reported a phase that was entered, by itself or by an event before it. The same
  /// phase once more counts.
  bool entered() const noexcept { return entered_; }
  /// Tells `controller` what `entered` says: `switch_to`, or `stop` where the phase has no action.
  /// After every step, for every controller that there is; `time` as in the step.
  template <class Controller>
  Status drive(Controller& controller, double time) const noexcept {
    if (!entered_) return Status::ok;
    return action().empty() ? controller.stop(time, fade())
                            : controller.switch_to(action(), time, fade());
  }
  /// @throws std::invalid_argument where `controller` has not all actions of the table. Before the
  ///         mission, since `drive` would tell too late.
  template <class Controller>
  [[gnu::cold]] void check_actions(const Controller& controller) const {
    for (const Phase& phase : phases_) {
      if (phase.action.empty() || controller.has(phase.action)) continue;
      detail::invalid("phase '", phase.name, "': there is no action '", phase.action, "'");
    }
  }

  /// Name of the present phase.
  std::string_view phase() const noexcept { return phases_[phase_].name; }
  /// Its row in the table.
  std::size_t index() const noexcept { return phase_; }
  /// Its action; empty: none.
  std::string_view action() const noexcept { return phases_[phase_].action; }
  /// Of its action, s.
  double fade() const noexcept { return phases_[phase_].fade; }
  /// Since it was entered, s.
  double time_in_phase() const noexcept { return clock_.elapsed() - entered_at_; }
  /// Why it was entered.
  Cause cause() const noexcept { return cause_; }
  /// The event that it was entered by; empty: none.
  std::string_view event() const noexcept {
    if (cause_ != Cause::event) return {};
    return phases_[static_cast<std::size_t>(previous_)].on[event_].event;
  }
  /// The phase before; empty at the start.
  std::string_view previous() const noexcept {
    return previous_ < 0 ? std::string_view{} : phases_[static_cast<std::size_t>(previous_)].name;
  }
  /// How the mission ended, or that it did not yet.
  PhaseEnd end() const noexcept { return phases_[phase_].end; }
  /// The phases, those of `always` among their reactions.
  const std::vector<Phase>& phases() const noexcept { return phases_; }

 private:
  static constexpr double rounding = 1e-6;  // s, of times that are sums of steps

  void enter(std::size_t phase, Cause cause) noexcept {
    previous_ = static_cast<long>(phase_);
    phase_ = phase;
    cause_ = cause;
    entered_at_ = clock_.elapsed();
    met_ = reported_ = entered_ = false;
  }

  static bool handles(const Phase& phase, const std::string& event) {
    for (const Reaction& r : phase.on) {
      if (r.event == event) return true;
    }
    return false;
  }
  [[gnu::cold]] static void check(const std::string& where, const Reaction& r) {
    if (r.event.empty()) detail::invalid(where, ": an event without a name");
    if (r.times < 0) {
      detail::invalid(where, ": times of '", r.event, "' must be >= 0, got ", r.times);
    }
    if ((r.times > 0) == r.otherwise.empty()) {
      detail::invalid(where, ": '", r.event, "' needs both times and otherwise, or none");
    }
  }
  [[gnu::cold]] static void check(const std::string& where, const std::vector<Reaction>& on) {
    for (const Reaction& r : on) {
      check(where, r);
      for (const Reaction& other : on) {
        if (&other != &r && other.event == r.event) {
          detail::invalid(where, ": event '", r.event, "' is there twice");
        }
      }
    }
  }
  [[gnu::cold]] void check(const Phase& phase) const {
    if (phase.name.empty()) detail::invalid("mission: a phase without a name");
    const std::string where = "phase '" + phase.name + "'";
    for (const Phase& other : phases_) {
      if (&other != &phase && other.name == phase.name) detail::invalid(where, " is there twice");
    }
    detail::require_positive(where.c_str(), "fade", phase.fade);
    const bool condition = static_cast<bool>(phase.until),
               limited = phase.time_limit != no_time_limit;
    if (condition == phase.then.empty()) {
      detail::invalid(where, ": until and then need each other");
    }
    if (!(phase.hold >= 0 && phase.hold < no_time_limit) || (phase.hold > 0 && !condition)) {
      detail::invalid(where, ": hold must be finite, >= 0, and 0 without until, got ", phase.hold);
    }
    if (!(phase.time_limit > 0)) {
      detail::invalid(where, ": time_limit must be > 0, got ", phase.time_limit);
    }
    if (limited == phase.on_timeout.empty()) {
      detail::invalid(where, ": time_limit and on_timeout need each other");
    }
    check(where, phase.on);
    const bool exits = condition || limited || !phase.on.empty();
    if (phase.end == PhaseEnd::none && !exits) detail::invalid(where, " never ends");
    if (phase.end != PhaseEnd::none && exits) {
      detail::invalid(where, " ends the mission, so nothing follows it");
    }
  }
  // The index of a phase that may be none.
  std::size_t find(const Phase& from, const std::string& name) const {
    if (name.empty()) return phases_.size();
    for (std::size_t i = 0; i < phases_.size(); ++i) {
      if (phases_[i].name == name) return i;
    }
    detail::invalid("phase '", from.name, "': there is no phase '", name, "'");
  }
  [[gnu::cold]] void connect() {
    for (const Phase& phase : phases_) {
      then_.push_back(find(phase, phase.then));
      on_timeout_.push_back(find(phase, phase.on_timeout));
      first_reaction_.push_back(to_.size());
      for (const Reaction& r : phase.on) {
        if (r.to.empty()) {
          detail::invalid("phase '", phase.name, "': nothing follows '", r.event, "'");
        }
        to_.push_back(find(phase, r.to));
        otherwise_.push_back(find(phase, r.otherwise));
        used_.push_back(0);
      }
    }
    // Which can be reached: as many rounds as there are phases suffice.
    List<bool> reached(phases_.size() + 1);  // one for "none"
    reached[0] = true;
    for (std::size_t round = 0; round < phases_.size(); ++round) {
      for (std::size_t p = 0; p < phases_.size(); ++p) {
        if (!reached[p]) continue;
        reached[then_[p]] = reached[on_timeout_[p]] = true;
        for (std::size_t i = 0; i < phases_[p].on.size(); ++i) {
          const std::size_t r = first_reaction_[p] + i;
          reached[to_[r]] = reached[otherwise_[r]] = true;
        }
      }
    }
    for (std::size_t p = 0; p < phases_.size(); ++p) {
      if (!reached[p]) detail::invalid("phase '", phases_[p].name, "' cannot be reached");
    }
  }

  std::vector<Phase> phases_;
  // Rows of what follows; of reactions one after the other, from first_reaction_ of a phase on.
  List<std::size_t> then_, on_timeout_, first_reaction_, to_, otherwise_;
  List<int> used_;
  StepClock clock_;
  std::size_t phase_{0}, event_{0};  // event_: a row of the phase before
  long previous_{-1};
  Cause cause_{Cause::start};
  double entered_at_{0}, met_from_{0};
  bool met_{false}, reported_{false}, entered_{false};
};

}  // namespace icat
