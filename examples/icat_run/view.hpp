// SPDX-License-Identifier: BSD-3-Clause
// The replay of a configured robot: its first frame that a task moves to a goal, and that goal.
#pragma once

#include <algorithm>
#include <functional>
#include <icat/adapters/yaml.hpp>
#include <icat/task/frame_tasks.hpp>
#include <optional>

#include "../support/robot_replay.hpp"
#include "run.hpp"

namespace run {

/// Draws nothing where there are two controllers, or no such task.
class View {
 public:
  View(icat::Configuration& config, const std::string& title, bool z_down)
      : replay_(title.c_str(), z_down) {
    if (!config.controller().whole_body()) return;
    const Robot& robot = config.robot();
    for (const std::string& name : config.tasks()) {
      auto* task = &config.task(name);
      if (auto* pose = dynamic_cast<icat::task::FramePose<Robot>*>(task)) {
        add(robot, *pose, [pose] { return icat::Vector3<double>(pose->goal().translation()); });
      }
      if (auto* point = dynamic_cast<icat::task::FramePosition<Robot>*>(task)) {
        add(robot, *point, [point] { return point->goal(); });
      }
    }
    if (goals_.empty()) return;
    const bool free = robot.base_columns().count == 6;
    support::RobotReplayOptions options{.frames = {frame_}};
    if (free) options.base = {1.0, 0.6, 0.5};
    if (z_down) {  // the seabed lies below all goals
      for (const Goal& g : goals_) options.ground = std::max(options.ground, g.at().z() + 0.3);
    }
    view_.emplace(replay_, *config.controller().whole_body(), options);
  }

  /// After the controller's step.
  void record(double t) {
    if (!view_) return;
    const Goal* goal = &goals_[0];
    for (const Goal& g : goals_) {
      if (g.task->activation().maxCoeff() > goal->task->activation().maxCoeff()) goal = &g;
    }
    view_->record(t, goal->at());
  }
  void write(const std::string& folder) {
    if (view_) replay_.write(folder, false);
  }

 private:
  struct Goal {
    const icat::Task<Robot>* task;
    std::function<icat::Vector3<double>()> at;
  };
  // A goal on the world, of a frame that joints move.
  template <class T, class At>
  void add(const Robot& robot, const T& task, At at) {
    const std::string& name = robot.frame_name(task.frame());
    bool moves = false;
    robot.for_each_joint_of(task.frame(), [&](auto&&...) { moves = true; });
    if (!task.on_world() || !moves || (!goals_.empty() && name != frame_)) return;
    frame_ = name;
    goals_.push_back({&task, at});
  }

  support::Replay replay_;
  std::optional<support::RobotReplay<icat::Controller<Robot>>> view_;
  std::string frame_;
  std::vector<Goal> goals_;
};

}  // namespace run
