// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Actions, controller and mission of a configuration.
#pragma once

#include "icat/action/action.hpp"
#include "icat/adapters/yaml_tasks.hpp"
#include "icat/control/parallel_controller.hpp"
#include "icat/mission/mission.hpp"

namespace icat {

/// The controller that a configuration asks for: a `Controller`, or a `ParallelController` where
/// its kind is `parallel`. What both have; after construction nothing allocates or throws.
class ConfiguredController {
 public:
  /// ẏ, n.
  using Velocity = Vector<double, Eigen::Dynamic>;
  /// Settings.
  using Options = Controller<ConfiguredRobot>::Options;

  /// @throws std::invalid_argument as the controllers. Allocates.
  [[gnu::cold]] ConfiguredController(const ConfiguredRobot& robot,
                                     const std::vector<Action<ConfiguredRobot>>& actions,
                                     const Options& options, bool parallel) {
    if (parallel) {
      parallel_.emplace(robot, actions, options);
    } else {
      whole_body_.emplace(robot, actions, options);
    }
  }

  /// As `Controller::switch_to`; times in s.
  Status switch_to(std::string_view action, double time, double duration) noexcept {
    return parallel_ ? parallel_->switch_to(action, time, duration)
                     : whole_body_->switch_to(action, time, duration);
  }
  /// As `Controller::stop`; times in s.
  Status stop(double time, double duration) noexcept {
    return parallel_ ? parallel_->stop(time, duration) : whole_body_->stop(time, duration);
  }
  /// As `Controller::step` with ẏ as measured, n, and `ParallelController::step` with that of the
  /// base and the given columns.
  Status step(double time, const Velocity& measured, InputAge age = {}) noexcept {
    return parallel_ ? parallel_->step(time, measured, age)
                     : whole_body_->step(time, measured, age);
  }
  /// Whether there is an action of this name.
  bool has(std::string_view action) const noexcept {
    return parallel_ ? parallel_->has(action) : whole_body_->has(action);
  }
  /// Name of the action that runs or is being entered; empty before the first.
  std::string_view action() const noexcept {
    return parallel_ ? parallel_->action() : whole_body_->action();
  }
  /// An action is being entered, or the command fades in, out or back.
  bool in_transition() const noexcept {
    return parallel_ ? parallel_->in_transition() : whole_body_->in_transition();
  }
  /// ẏ, n; given columns hold what was measured.
  const Velocity& velocity() const noexcept {
    return parallel_ ? parallel_->velocity() : whole_body_->velocity();
  }
  /// What goes to the back-end, n: ẏ with zeros in the given columns.
  const Velocity& command() const noexcept {
    return parallel_ ? parallel_->command() : whole_body_->command();
  }
  /// The controller itself; null where it is the other kind.
  Controller<ConfiguredRobot>* whole_body() noexcept {
    return whole_body_ ? &*whole_body_ : nullptr;
  }
  /// The same.
  ParallelController<ConfiguredRobot>* parallel() noexcept {
    return parallel_ ? &*parallel_ : nullptr;
  }

 private:
  std::optional<Controller<ConfiguredRobot>> whole_body_;
  std::optional<ParallelController<ConfiguredRobot>> parallel_;
};

namespace detail {

using ConfiguredTasks = std::vector<ConfiguredTask>;

inline std::vector<std::string> task_names(const ConfiguredTasks& tasks) {
  std::vector<std::string> names;
  for (const auto& t : tasks) names.push_back(t.name);
  return names;
}

/// The actions behind the key `actions` of `top`.
inline std::vector<Action<ConfiguredRobot>> actions_of(const Section& top, ConfiguredTasks& tasks) {
  (void)top.known("actions", Value::levels);
  const ConfigNode& all = top.at("actions");
  top.map(all, "actions");
  const auto names = task_names(tasks);
  std::vector<Action<ConfiguredRobot>> actions;
  for (std::size_t i = 0; i < all.items.size(); ++i) {
    Action<ConfiguredRobot> action{all.names[i].name, {}};
    const Section here = top.called("action '" + action.name + "'");
    const auto task_at = [&](const ConfigNode& at) {
      return std::ref(*tasks[here.look_up(at, "task", names)].task);
    };
    for (const ConfigNode& level : here.list(all.items[i], action.name.c_str())) {
      action.levels.emplace_back();
      if (level.is(ConfigNode::Kind::list)) {
        for (const ConfigNode& item : level.items) action.levels.back().push_back(task_at(item));
      } else {
        action.levels.back().push_back(task_at(level));
      }
    }
    actions.push_back(std::move(action));
  }
  return actions;
}

/// The controller behind the key `controller` of `top`.
inline std::unique_ptr<ConfiguredController> controller_of(
    const Section& top, const RobotContext& context,
    const std::vector<Action<ConfiguredRobot>>& actions, double period) {
  ConfiguredController::Options options;
  options.limits = context.limits(top.section("limits"));
  bool parallel = false;
  const auto section = top.section("controller");
  if (section) {
    const Section& s = *section;
    parallel = s.choice("kind", "whole_body") == "parallel";
    options.given = context.columns(s, "given");
    auto& solver = options.solver;
    if (const auto r = s.section("regularization")) {
      solver.regularization.lambda = r->number("lambda", solver.regularization.lambda);
      solver.regularization.threshold = r->number("threshold", solver.regularization.threshold);
      r->finish();
    }
    solver.projection_weight = s.number("projection_weight", solver.projection_weight);
    const std::string saturation = s.choice("saturation", "scale");
    solver.saturation = saturation == "redistribute"       ? Saturation::redistribute
                        : saturation == "continuous_scale" ? Saturation::continuous_scale
                                                           : Saturation::scale;
    if (const auto b = s.section("velocity_bounds")) {
      const Index n = context.robot.dof();
      const ColumnRange base_columns = context.robot.base_columns();
      const auto joints = b->per_joint("joints", infinity<double>);
      const auto base = b->numbers("base");
      b->finish();
      if (!joints.for_all() && joints.size() != base_columns.first) {
        b->fail(b->at("joints"), "'joints' has ", joints.size(), " numbers for ",
                base_columns.first, " joints");
      }
      if (!base.empty() && static_cast<Index>(base.size()) != base_columns.count) {
        b->fail(b->at("base"), "'base' has ", base.size(), " numbers for ", base_columns.count,
                " columns");
      }
      auto& upper = solver.bounds.upper;
      upper = zeros<Vector<double, Eigen::Dynamic>>(n);
      fill(upper, infinity<double>);
      for (Index c = 0; c < base_columns.first; ++c) upper(c) = joints[c];
      for (std::size_t k = 0; k < base.size(); ++k) {
        upper(base_columns.first + static_cast<Index>(k)) = base[k];
      }
      solver.bounds.lower = upper;
      for (Index c = 0; c < n; ++c) solver.bounds.lower(c) = -upper(c);
    }
    options.time.max_step = s.number("max_step", options.time.max_step);
    options.time.hold = s.number("hold", options.time.hold);
    options.time.ramp = s.number("ramp", options.time.ramp);
    const double length = s.number("characteristic_length", 0);
    if (length > 0) options.characteristic_length = length;
    s.finish();
  }
  const double longest = longest_step(options);
  if (period > longest * (1 + 1e-9)) {
    top.fail(top.at("period"), "a 'period' of ", period, " s is longer than the longest step, ",
             longest, " s: 'max_step' of the controller, or 'reaction_time' of the limits");
  }
  return at_place(top, section ? section->node() : top.at("actions"), [&] {
    return std::make_unique<ConfiguredController>(context.robot, actions, options, parallel);
  });
}

/// All that has to be met for a phase to end.
class Condition {
 public:
  Condition(const Section& phase, const ConfiguredTasks& tasks,
            const ConfiguredController& controller)
      : controller_(&controller) {
    for (const Section& s : phase.sections("until")) add(s, tasks);
  }
  bool empty() const noexcept { return parts_.empty() && !settled_; }
  /// With the errors of the robot as it is now, also of a task that no action has updated yet.
  bool operator()() const {
    if (settled_ && controller_->in_transition()) return false;
    for (const Part& part : parts_) {
      part.task->update();
      if (!(part.measure() < part.limit)) return false;
    }
    return true;
  }

 private:
  struct Part {
    AnyTask* task;
    std::function<double()> measure;
    double limit;
  };

  void add(const Section& s, const ConfiguredTasks& tasks) {
    (void)s.text("task");
    const bool holds = s.boolean("holds", false), settled = s.boolean("settled", false);
    const std::pair<const char*, double> limits[] = {{"position", s.number("position", 0)},
                                                     {"orientation", s.number("orientation", 0)},
                                                     {"angle", s.number("angle", 0)},
                                                     {"joints", s.number("joints", 0)},
                                                     {"holds", 0.5}};
    s.finish();
    settled_ = settled_ || settled;
    for (const char* name : {"holds", "settled"}) {
      if (s.has(name) && !(name[0] == 'h' ? holds : settled)) {
        s.fail(s.at(name), "'", name, "' can only be true");
      }
    }
    bool any = settled;
    for (const auto& [name, limit] : limits) {
      if (!s.has(name)) continue;
      any = true;
      if (!s.has("task")) s.fail(s.at(name), "'", name, "' needs 'task'");
      const ConfiguredTask& t = tasks[s.look_up(s.at("task"), "task", task_names(tasks))];
      std::vector<std::string> measures;
      for (const auto& [measure, ask] : t.measures) measures.emplace_back(measure);
      const auto found = std::find(measures.begin(), measures.end(), name);
      if (found == measures.end()) {
        s.fail(s.at(name), "a task of type '", t.type, "' has no '", name, "'",
               there_are(name, measures));
      }
      parts_.push_back({t.task.get(),
                        t.measures[static_cast<std::size_t>(found - measures.begin())].second,
                        limit});
    }
    if (!any || (s.has("task") && s.node().items.size() == 1)) {
      s.fail(s.node(), "nothing has to be met");
    }
  }

  const ConfiguredController* controller_;
  std::vector<Part> parts_;
  bool settled_{false};
};

/// The name of a phase behind the key `name`; empty where there is no such key.
inline std::string phase_at(const Section& s, const char* name,
                            const std::vector<std::string>& phases) {
  const std::string text = s.text(name);
  if (s.has(name)) (void)s.look_up(s.at(name), "phase", phases);
  return text;
}
inline std::vector<Reaction> reactions_of(const Section& s, const char* key,
                                          const std::vector<std::string>& phases) {
  std::vector<Reaction> all;
  for (const Section& r : s.sections(key)) {
    all.push_back({r.text("event"), phase_at(r, "to", phases), r.integer("times", 0),
                   phase_at(r, "otherwise", phases)});
    r.finish();
  }
  return all;
}

/// The mission behind the key `mission` of `top`; none where there is no such key.
inline std::unique_ptr<Mission> mission_of(const Section& top, const ConfiguredTasks& tasks,
                                           const std::vector<Action<ConfiguredRobot>>& actions,
                                           const ConfiguredController& controller, double period) {
  const auto section = top.section("mission");
  if (!section) return nullptr;
  const auto rows = section->sections("phases");
  std::vector<std::string> names, action_names;
  for (const Section& row : rows) names.push_back(row.text("name"));
  for (const auto& action : actions) action_names.push_back(action.name);
  std::vector<Phase> phases;
  for (const Section& s : rows) {
    Phase phase{.name = s.text("name"), .action = s.text("action")};
    if (s.has("action")) (void)s.look_up(s.at("action"), "action", action_names);
    phase.fade = s.number("fade", phase.fade);
    const Condition until(s, tasks, controller);
    if (!until.empty()) phase.until = until;
    phase.hold = s.number("hold", 0);
    phase.then = phase_at(s, "then", names);
    phase.time_limit = s.number("time_limit", no_time_limit);
    phase.on_timeout = phase_at(s, "on_timeout", names);
    phase.on = reactions_of(s, "events", names);
    const std::string end = s.choice("end", "");
    phase.end = end.empty()        ? PhaseEnd::none
                : end == "success" ? PhaseEnd::success
                                   : PhaseEnd::failure;
    s.finish();
    phases.push_back(std::move(phase));
  }
  const auto always = reactions_of(*section, "always", names);
  const double max_step = section->number("max_step", 1);
  section->finish();
  if (period > max_step) section->fail(section->at("max_step"), "'max_step' is below the period");
  // What the mission says of a phase stands at that phase.
  const auto place = [&](std::string_view error) -> const ConfigNode& {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (error.starts_with("phase '" + names[i] + "'")) return rows[i].node();
    }
    return section->node();
  };
  try {
    return std::make_unique<Mission>(std::move(phases), always, max_step);
  } catch (const std::invalid_argument& error) {
    section->fail(place(error.what()), error.what());
  }
}

}  // namespace detail
}  // namespace icat
