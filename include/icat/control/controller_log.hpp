// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Records a controller with its robot and tasks in a `Log`, by their names:
///
///     joint/<joint>                 q, rad or m
///     velocity/<joint or column>    ẏ, as the controller has it; a column of the base is surge,
///                                   sway, heave, roll rate, pitch rate, yaw rate, or base <k>
///                                   where it moves along several of these
///     frame/<frame>                 pose in ⟨0⟩: the base, and the frames that are asked for
///     activation/<task>             the largest aⁱ aᵖ of its rows
///     error/<task>                  ‖A (ẋ̄ − J ẏ)‖: the part of the rate that is not achieved
///     task/<task>/<row>/reference   ẋ̄ of each row
///     task/<task>/<row>/achieved    J ẏ
///     task/<task>/<row>/activation  aⁱ aᵖ
///     report/level <k>              ‖A (ẋ̄ − J ρ)‖ of the solver's level k, from 1
///     report/failed level           its number, 0: none
///
/// with a prefix where a log has several robots. In J ẏ the base moves as it is measured, where a
/// `ParallelController` compensates for it. A task that stands twice in the unified hierarchy
/// is called `<task> (2)` there. The error is one of rates, as every task has it; what it means in
/// m or rad only the task knows: add a channel of your own for it.
#pragma once

#include <string>
#include <vector>

#include "icat/action/level_stack.hpp"
#include "icat/control/controller_inside.hpp"
#include "icat/control/log.hpp"
#include "icat/model/robot.hpp"

namespace icat {

/// What is recorded of a controller.
struct ControllerLogOptions {
  std::string prefix = {};               ///< of all names, such as "left/"
  std::vector<std::string> frames = {};  ///< whose poses are recorded, beside the base
  bool rows = true;                      ///< three channels for each row of each task
};

/// Of a `Controller`, or of a `ParallelController`, whose tasks are those of its first TPIK. The
/// log and the controller must outlive it.
template <class C>
class ControllerLog {
 public:
  /// Adds the channels. For configuration.
  /// @throws std::invalid_argument on a frame that the robot has not, and as `Log::add`.
  [[gnu::cold]] ControllerLog(Log& log, const C& controller, ControllerLogOptions options = {})
      : log_(log), controller_(controller) {
    const auto& robot = layer().robot();
    const std::string& p = options.prefix;
    column_names_ = List<std::string>(static_cast<std::size_t>(robot.dof()));
    moves_ = List<double>(column_names_.size());
    name_columns(robot);
    if constexpr (JointedRobot<Robot>) {
      for (const auto& j : robot.joints()) joints_.push_back(log.add(p + "joint/" + j.name));
    }
    for (const std::string& name : column_names_) {
      velocity_.push_back(log.add(p + "velocity/" + name));
    }
    if constexpr (FramedRobot<Robot>) {
      if constexpr (MobileRobot<Robot>) add_frame(p + "frame/base", robot.base());
      for (const std::string& f : options.frames) add_frame(p + "frame/" + f, robot.frame(f));
    }
    add_tasks(p, options.rows);
    for (std::size_t k = 0; k < layer().hierarchy().size(); ++k) {
      levels_.push_back(log.add(p + "report/level " + std::to_string(k + 1)));
    }
    failed_ = log.add(p + "report/failed level");
  }

  /// Records the controller after its step into the sample that `Log::begin` opened. No allocation.
  void record() noexcept {
    const auto& robot = layer().robot();
    if constexpr (JointedRobot<Robot>) {
      for (std::size_t i = 0; i < joints_.size(); ++i) {
        log_.set(joints_[i], double(robot.position(static_cast<Index>(i))));
      }
    }
    const auto& y = controller_.velocity();
    const auto& measured = detail::Inside<C>::measured(controller_);
    const ColumnRange base = detail::Inside<C>::measured_base(controller_);
    for (std::size_t i = 0; i < velocity_.size(); ++i) {
      const Index c = static_cast<Index>(i);
      log_.set(velocity_[i], double(y(c)));
      moves_[i] = double(base.holds(c) ? measured(c) : y(c));
    }
    if constexpr (FramedRobot<Robot>) {
      for (const Framed& f : frames_) log_.set(f.channel, robot.pose(f.frame));
    }
    for (const Entry& e : entries_) record(e);
    const auto& report = layer().report();
    std::size_t k = 0;
    for (const auto& level : report.levels()) {
      if (k == levels_.size()) break;
      log_.set(levels_[k++], double(level.tracking_error));
    }
    log_.set(failed_, double(report.failed_level() + 1));
  }

 private:
  // The object that has tasks, levels and a report.
  static const auto& layer_of(const C& c) noexcept {
    if constexpr (requires { c.first(); }) {
      return c.first();
    } else {
      return c;
    }
  }
  const auto& layer() const noexcept { return layer_of(controller_); }
  using Robot = std::remove_cvref_t<decltype(layer_of(std::declval<const C&>()).robot())>;

  struct Framed {
    LogChannel channel;
    FrameId frame{0};
  };
  struct Entry {
    std::size_t level{0};
    Index first{0}, rows{0};  // of the level
    LogChannel activation, error;
    List<LogChannel> parts;  // reference, achieved, activation of each row; or none
  };

  void name_columns(const auto& robot) {
    if constexpr (JointedRobot<Robot>) {
      for (const auto& j : robot.joints()) {
        column_names_[static_cast<std::size_t>(j.column)] = j.name;
      }
    }
    if constexpr (MobileRobot<Robot>) {
      const ColumnRange base = robot.base_columns();
      for (Index k = 0; k < base.count; ++k) {
        column_names_[static_cast<std::size_t>(base.first + k)] = base_column(robot, k);
      }
    }
    for (std::size_t c = 0; c < column_names_.size(); ++c) {
      if (column_names_[c].empty()) column_names_[c] = "column " + std::to_string(c + 1);
    }
  }
  static std::string base_column(const auto& robot, Index k) {
    const char* six[] = {"surge", "sway", "heave", "roll rate", "pitch rate", "yaw rate"};
    const auto& motion = robot.base_motion();
    Index axis = -1, count = 0;
    for (Index i = 0; i < 6; ++i) {
      if (motion(i, k) != 0) axis = i, ++count;
    }
    return count == 1 ? six[axis] : "base " + std::to_string(k + 1);
  }
  void add_frame(const std::string& name, FrameId frame) {
    frames_.push_back({log_.add(name, "m", LogKind::pose), frame});
  }
  void add_tasks(const std::string& prefix, bool rows) {
    List<std::string> names;
    std::size_t k = 0;
    for (const auto& level : layer().hierarchy()) {
      Index row = 0;
      for (const auto& entry : level) {
        std::size_t times = 1;
        for (const std::string& other : names) times += other == entry.task->name();
        names.push_back(entry.task->name());
        std::string name = entry.task->name();
        if (times > 1) name.append(" (").append(std::to_string(times)).append(")");
        Entry e;
        e.level = k;
        e.first = row;
        e.rows = entry.task->rows();
        e.activation = log_.add(prefix + "activation/" + name);
        e.error = log_.add(prefix + "error/" + name);
        for (Index i = 0; rows && i < e.rows; ++i) {
          const std::string part = prefix + "task/" + name + "/" + std::to_string(i + 1);
          for (const char* what : {"/reference", "/achieved", "/activation"}) {
            e.parts.push_back(log_.add(part + what));
          }
        }
        row += e.rows;
        entries_.push_back(std::move(e));
      }
      ++k;
    }
  }
  [[gnu::noinline]] void record(const Entry& e) noexcept {
    const auto& level = layer().levels()[e.level];
    double largest = 0, sum = 0;
    for (Index i = 0; i < e.rows; ++i) {
      const Index r = e.first + i;
      double achieved = 0;
      for (std::size_t c = 0; c < moves_.size(); ++c) {
        achieved += double(level.jacobian(r, static_cast<Index>(c))) * moves_[c];
      }
      const double reference = double(level.reference(r)), a = double(level.activation(r));
      if (a > largest) largest = a;
      const double off = a * (reference - achieved);
      if (a > 0) sum += off * off;
      if (e.parts.size() == 0) continue;
      const std::size_t p = 3 * static_cast<std::size_t>(i);
      log_.set(e.parts[p], reference);
      log_.set(e.parts[p + 1], achieved);
      log_.set(e.parts[p + 2], a);
    }
    log_.set(e.activation, largest);
    log_.set(e.error, std::sqrt(sum));
  }

  Log& log_;
  const C& controller_;
  List<std::string> column_names_;
  List<double> moves_;  // ẏ, for what is achieved
  List<LogChannel> joints_, velocity_, levels_;
  List<Framed> frames_;
  List<Entry> entries_;
  LogChannel failed_;
};

}  // namespace icat
