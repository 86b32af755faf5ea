// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A controller from a YAML file: robot, limits, tasks, actions and mission. The keys are those of
/// yaml_keys.hpp, listed in docs/configuration.md. An error message has file, line, column, the
/// wrong name and the names that exist.
///
/// Gains and goals may be read again at run time: `read_changes` reads and checks the file outside
/// the loop and refuses it as a whole where anything is wrong; `apply`, in the loop, cannot fail.
///
/// The program links yaml-cpp and urdfdom; docs/configuration.md has the lines of CMake. Everything
/// is `double` and of run-time size. A back-end (control/back_end.hpp) of the program moves the
/// configured robot.
#pragma once

#include <atomic>
#include <cstdint>

#include "icat/adapters/yaml_mission.hpp"

namespace icat {

/// What a simulated robot does with a command, see `KinematicPlant`.
struct ConfiguredPlant {
  double tracking_lag{0};                   ///< of the base, s
  Columns not_actuated{};                   ///< that do not do what they are told
  bool has_current{false};                  ///< a current carries the base
  Vector3<double> current = Filled{0};      ///< m/s, on ⟨0⟩: velocity, or amplitude
  double current_period{infinity<double>};  ///< s, of a sine; infinite: constant

  /// The current at `time` (s), m/s, on ⟨0⟩.
  Vector3<double> current_at(double time) const noexcept {
    if (current_period == infinity<double>) return current;
    const double wave = std::sin(2 * std::numbers::pi * time / current_period);
    return detail::scaled(current, wave);
  }
};

namespace detail {
/// A number that no configuration of the program had before. The address of a file would not do: a
/// later one may have it again.
inline std::uint64_t new_state() noexcept {
  static std::atomic<std::uint64_t> last{0};
  return last.fetch_add(1, std::memory_order_relaxed) + 1;
}
}  // namespace detail

/// Changes of gains and goals that were read and checked, and wait to be applied. Destroy them
/// outside the loop: that frees memory.
class ConfigurationChanges {
 public:
  /// How many values change; 0 once they were applied.
  std::size_t size() const noexcept { return applied_ ? 0 : setters_.size(); }

 private:
  friend class Configuration;
  std::vector<detail::Setter> setters_;
  std::unique_ptr<detail::ConfigFile> file_;
  std::uint64_t base_{0};  // the state of a configuration that they are changes of
  bool applied_{false};
};

/// See the file comment. Construction and `read_changes` read files, allocate and throw; nothing
/// else does. Robot, tasks, controller and mission stay where they are when it is moved.
class Configuration {
 public:
  /// The robot at its start.
  ConfiguredRobot& robot() noexcept { return *robot_; }
  /// Its controller.
  ConfiguredController& controller() noexcept { return *controller_; }
  /// Its mission; null where the file has none.
  Mission* mission() noexcept { return mission_.get(); }
  /// Positions at the start, one for each of the robot's joints, rad or m.
  const Vector<double, Eigen::Dynamic>& start_q() const noexcept { return start_q_; }
  /// Pose of the base at the start, in ⟨0⟩.
  const Pose<double>& start_base() const noexcept { return start_base_; }
  /// What the robot does with a command where it is simulated.
  const ConfiguredPlant& plant() const noexcept { return plant_; }
  /// Of the loop, s.
  double period() const noexcept { return period_; }

  /// The task called `name`, to be set while it runs:
  /// `task<task::FramePose<ConfiguredRobot>>("hand").set_goal(…)`.
  /// @throws std::invalid_argument with the names there are, or where it is of another type.
  template <class T = Task<ConfiguredRobot>>
  [[gnu::cold]] T& task(std::string_view name) {
    for (auto& t : tasks_) {
      if (t.name != name) continue;
      if (T* found = dynamic_cast<T*>(t.task.get())) return *found;
      detail::invalid(file_->name, ": task '", name, "' is of type '", t.type, "'");
    }
    detail::invalid(file_->name, ": no task '", name, "'",
                    detail::there_are(std::string(name), detail::task_names(tasks_)));
  }
  /// Names of the tasks, in the order of the file. Allocates.
  std::vector<std::string> tasks() const { return detail::task_names(tasks_); }

  /// Goals that move over time, at `time`, s. Before each step. No allocation.
  void update(double time) noexcept {
    for (const auto& t : tasks_) {
      if (t.move) t.move(time);
    }
  }

  /// What is new in the file at the path `path`, whose other values must be those of this
  /// configuration. Reads the file, allocates; may run beside the loop in a thread of its own, but
  /// not while `apply` does.
  /// @throws std::invalid_argument on whatever a configuration is refused for, and on what may not
  ///         change while it runs, with its name. Nothing is changed then.
  ConfigurationChanges read_changes(const std::string& path) const {
    return changes(std::make_unique<detail::ConfigFile>(detail::config_file(path)));
  }
  /// The same of a text, which errors call `name`.
  ConfigurationChanges parse_changes(const std::string& text, const std::string& name) const {
    return changes(std::make_unique<detail::ConfigFile>(detail::config_text(text, name)));
  }
  /// Makes the changes, all of them, between two steps. `out_of_range`: they were read for another
  /// configuration, or before others that were applied since, or are applied already; nothing is
  /// changed then. No allocation, and nothing is freed.
  Status apply(ConfigurationChanges& changes) noexcept {
    if (changes.applied_ || !file_ || changes.base_ != state_) return Status::out_of_range;
    for (const detail::Setter& set : changes.setters_) set();
    changes.applied_ = true;
    file_.swap(changes.file_);
    state_ = detail::new_state();
    return Status::ok;
  }

  /// Of a file that was read. For `load_yaml`.
  /// @throws std::invalid_argument as `load_yaml`.
  [[gnu::cold]] explicit Configuration(std::unique_ptr<detail::ConfigFile> file)
      : file_(std::move(file)), parts_(std::make_unique<detail::RobotParts>()) {
    const detail::Section top(*file_, file_->root, detail::top_section, "");
    (void)top.text("about");
    period_ = top.number("period", 0.01);
    if (!std::isfinite(period_)) top.fail(top.at("period"), "'period' must be finite");
    const detail::Section robot = *top.section("robot");
    *parts_ = detail::robot_parts(robot);
    try {
      robot_ = std::make_unique<ConfiguredRobot>(parts_->description);
    } catch (const std::invalid_argument& error) {
      detail::wrong(*file_, detail::place_of(robot, error.what()), error.what());
    }
    detail::add_frames(robot, *robot_);
    robot.finish();
    const detail::RobotContext context{*robot_, *parts_};
    read_start(top, context);
    read_plant(top, context);
    read_tasks(top, context);
    const auto actions = detail::actions_of(top, tasks_);
    controller_ = detail::controller_of(top, context, actions, period_);
    mission_ = detail::mission_of(top, tasks_, actions, *controller_, period_);
    top.finish();
  }

 private:
  void read_start(const detail::Section& top, const detail::RobotContext& context) {
    start_base_ = detail::identity_pose<double>();
    start_q_ =
        detail::zeros<Vector<double, Eigen::Dynamic>>(static_cast<Index>(robot_->joints().size()));
    const auto s = top.section("start");
    if (!s) return;
    start_q_ = context.joint_values(*s, "q", detail::joint_names(*robot_), false);
    start_base_ = s->pose("base").value_or(start_base_);
    s->finish();
    if (const Status status = robot_->update(start_q_, start_base_); status != Status::ok) {
      s->fail(s->node(), describe(status));
    }
  }
  void read_plant(const detail::Section& top, const detail::RobotContext& context) {
    const auto s = top.section("plant");
    if (!s) return;
    plant_.tracking_lag = s->number("tracking_lag", 0);
    if (!std::isfinite(plant_.tracking_lag)) {
      s->fail(s->at("tracking_lag"), "'tracking_lag' must be finite");
    }
    plant_.not_actuated = context.columns(*s, "not_actuated");
    if (const auto current = s->section("current")) {
      plant_.has_current = true;
      plant_.current = *current->vector("velocity");
      plant_.current_period = current->number("period", infinity<double>);
      current->finish();
      if (!detail::all_finite(plant_.current)) {
        current->fail(current->at("velocity"), "'velocity' must be finite");
      }
      if (parts_->base != "free") current->fail(current->node(), "only a free base is carried");
    }
    s->finish();
  }
  void read_tasks(const detail::Section& top, const detail::RobotContext& context) {
    (void)top.known("tasks", detail::Value::tasks);
    const detail::ConfigNode& all = top.at("tasks");
    top.map(all, "tasks");
    const detail::TaskMaker maker(context);
    for (std::size_t i = 0; i < all.items.size(); ++i) {
      tasks_.push_back(maker.make(*file_, all.items[i], all.names[i]));
    }
  }

  // --- changes

  [[gnu::cold]] ConfigurationChanges changes(std::unique_ptr<detail::ConfigFile> file) const {
    {
      // It must be good by itself; what it builds is thrown away.
      Configuration whole(std::make_unique<detail::ConfigFile>(*file));
    }
    ConfigurationChanges result;
    const detail::ConfigNode &before = file_->root, &now = file->root;
    for (std::size_t i = 0; i < detail::top_section.count; ++i) {
      const detail::ConfigKey& key = detail::top_section.keys[i];
      const std::string_view name = key.name;
      if (name == "about") continue;
      const auto *was = before.find(name), *is = now.find(name);
      if (name == "tasks") {
        compare_tasks(*file, *was, *is, result);
      } else if (const auto* place = difference(now, was, is)) {
        detail::wrong(*file, *place, "'", name, "' may not change while it runs; ",
                      "gains and goals of tasks may");
      }
    }
    result.file_ = std::move(file);
    result.base_ = state_;
    return result;
  }
  void compare_tasks(const detail::ConfigFile& file, const detail::ConfigNode& before,
                     const detail::ConfigNode& now, ConfigurationChanges& result) const {
    const auto names = detail::task_names(tasks_);
    for (const auto& name : now.names) {
      if (before.find(name.name)) continue;
      detail::wrong(file, name.line, name.column, "task '", name.name,
                    "' is new, and may not come while it runs",
                    detail::there_are(name.name, names));
    }
    for (const auto& t : tasks_) {
      const auto* is = now.find(t.name);
      if (!is) detail::wrong(file, now, "task '", t.name, "' is gone, and may not while it runs");
      compare_task(file, t, *before.find(t.name), *is, result);
    }
  }
  static void compare_task(const detail::ConfigFile& file, const detail::ConfiguredTask& t,
                           const detail::ConfigNode& before, const detail::ConfigNode& now,
                           ConfigurationChanges& result) {
    const std::string where = "task '" + t.name + "'";
    for (const detail::ConfigSection& table : detail::task_sections) {
      if (t.type != table.name) continue;
      std::vector<std::string> may;
      for (std::size_t i = 0; i < table.count; ++i) {
        if (table.keys[i].live) may.emplace_back(table.keys[i].name);
      }
      for (std::size_t i = 0; i < table.count; ++i) {
        const detail::ConfigKey& key = table.keys[i];
        const std::string_view name = key.name;
        const auto *was = before.find(name), *is = now.find(name);
        const auto* place = difference(now, was, is);
        if (!place) continue;
        if (!key.live) {
          detail::wrong(file, *place, where, ": '", name, "' may not change while it runs; ",
                        detail::listed(may), " may");
        }
        // With or without them the task is another one.
        const bool form = name == "norm" || name == "norms" || name == "target" || name == "point";
        if (form && (!was || !is)) {
          detail::wrong(file, *place, where, ": '", name,
                        "' may change while it runs, not come or go");
        }
        if (name == "obstacles" && was->items.size() != is->items.size()) {
          detail::wrong(file, *place, where, ": the number of obstacles may not change, ",
                        was->items.size(), " before");
        }
        result.setters_.push_back(t.change(detail::Section(file, now, table, where), name));
      }
    }
  }
  /// Where in the new file `is` differs from `was`; null: nowhere. `parent`: of what is not there.
  static const detail::ConfigNode* difference(const detail::ConfigNode& parent,
                                              const detail::ConfigNode* was,
                                              const detail::ConfigNode* is) {
    if (!was && !is) return nullptr;
    if (!was) return is;
    if (!is) return &parent;
    if (was->kind != is->kind || was->names.size() != is->names.size() ||
        was->items.size() != is->items.size()) {
      return is;
    }
    if (is->is(detail::ConfigNode::Kind::scalar)) return same(*was, *is) ? nullptr : is;
    for (std::size_t i = 0; i < is->items.size(); ++i) {
      const bool map = is->is(detail::ConfigNode::Kind::map);
      const auto* other = map ? was->find(is->names[i].name) : &was->items[i];
      if (const auto* place = difference(*is, other, &is->items[i])) return place;
    }
    return nullptr;
  }
  /// Whether two scalars say the same: 0.5 and 0.50 do.
  static bool same(const detail::ConfigNode& a, const detail::ConfigNode& b) {
    if (a.text == b.text) return true;
    std::string_view rest_a = a.text, rest_b = b.text;
    double x = 0, y = 0;
    return detail::take_number(rest_a, x) && detail::take_number(rest_b, y) && x == y &&
           rest_a == rest_b;
  }

  std::unique_ptr<detail::ConfigFile> file_;
  std::uint64_t state_{detail::new_state()};
  std::unique_ptr<detail::RobotParts> parts_;
  std::unique_ptr<ConfiguredRobot> robot_;
  detail::ConfiguredTasks tasks_;
  std::unique_ptr<ConfiguredController> controller_;
  std::unique_ptr<Mission> mission_;
  Vector<double, Eigen::Dynamic> start_q_;
  Pose<double> start_base_ = IdentityPose{};
  ConfiguredPlant plant_;
  double period_{0.01};
};

/// The configuration of the file at the path `path`. Reads files, allocates.
/// @throws std::invalid_argument on what is wrong: "mission.yaml:12:5: task 'hand': unknown key …".
[[gnu::cold]] inline Configuration load_yaml(const std::string& path) {
  return Configuration(std::make_unique<detail::ConfigFile>(detail::config_file(path)));
}
/// The configuration that `text` is; errors call it `name`, from whose folder paths are taken.
/// @throws std::invalid_argument as `load_yaml`.
[[gnu::cold]] inline Configuration parse_yaml(const std::string& text,
                                              const std::string& name = "configuration") {
  return Configuration(std::make_unique<detail::ConfigFile>(detail::config_text(text, name)));
}

}  // namespace icat
