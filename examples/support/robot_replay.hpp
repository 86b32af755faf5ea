// SPDX-License-Identifier: BSD-3-Clause
// Any robot that is a KinematicTree, with its controller, in a replay: a line to make it, a line in
// the loop.
#pragma once

#include <algorithm>
#include <icat/adapters/replay_scene.hpp>
#include <icat/control/controller_log.hpp>
#include <icat/control/explain.hpp>
#include <string_view>
#include <utility>

#include "replay.hpp"

namespace support {

/// How the robot is drawn, and what for.
struct RobotReplayOptions {
  std::vector<std::string> frames;            ///< ends of its limbs; the first one leaves a path
  std::string name = "run", title = "";       ///< of the run
  std::array<double, 3> base = {0, 0, 0};     ///< a box around the base, m
  std::array<double, 3> base_at = {0, 0, 0};  ///< its centre on the base
  double radius = 0.035;                      ///< of the links, m
  double ground = 0;                          ///< height of the grid in ⟨0⟩, m
  double ground_edge = 6;                     ///< of the grid, m
  std::size_t samples = 13000;                ///< as many as are recorded
  double period = 0.25;                       ///< s, between explanations: as often as one reads
  bool rows = true;                           ///< channels for each row of each task
};

/// The robot, its base, the goal and the ground. The run's log has the poses "frame/base" and of
/// `frames`; the robot must outlive it.
template <class Robot>
class RobotPicture {
 public:
  RobotPicture(icat::ReplayRun& run, icat::Log& log, const Robot& robot,
               const RobotReplayOptions& options)
      : log_(log), robot_(robot) {
    using icat::ReplayForm;
    for (const auto& joint : robot.joints()) {
      links_.push_back(log.add("link/" + joint.name, "m", icat::LogKind::point));
    }
    goal_ = log.add("goal", "m", icat::LogKind::point);
    // From each frame to the base: bones between the axes of its joints.
    const char* colors[] = {"#e07f2e", "#e9edf0"};
    std::vector<std::string> drawn;
    for (const auto& frame : options.frames) {
      std::string end = "frame/" + frame;
      const auto bone_to = [&](const std::string& start) {
        const std::string both = start + end;
        if (std::find(drawn.begin(), drawn.end(), both) == drawn.end()) {
          run.shapes.push_back({.form = ReplayForm::bone,
                                .frame = start,
                                .size = {options.radius, 0, 0},
                                .to = end,
                                .color = colors[drawn.size() % 2]});
          drawn.push_back(both);
        }
        end = start;
      };
      robot.for_each_joint_of(robot.frame(frame), [&](icat::Index column, auto&&, auto&&) {
        for (const auto& joint : robot.joints()) {
          if (joint.column == column) bone_to("link/" + joint.name);
        }
      });
      bone_to("frame/base");
      run.shapes.push_back({.form = ReplayForm::axes,
                            .frame = "frame/" + frame,
                            .size = {4 * options.radius, 0, 0}});
    }
    if (options.base[0] > 0) {
      icat::ReplayShape box{.form = ReplayForm::box,
                            .frame = "frame/base",
                            .size = options.base,
                            .color = "#5b6b79",
                            .opacity = 0.85};
      box.at.translation() << options.base_at[0], options.base_at[1], options.base_at[2];
      run.shapes.push_back(box);
    }
    icat::ReplayShape ground{.form = ReplayForm::ground, .size = {options.ground_edge, 0, 0}};
    ground.at.translation().z() = options.ground;
    run.shapes.push_back(ground);
    run.shapes.push_back({.form = ReplayForm::path,
                          .frame = "frame/" + options.frames[0],
                          .size = {},
                          .color = "#0b6e99"});
    run.shapes.push_back({.form = ReplayForm::sphere,
                          .frame = "goal",
                          .size = {0.8 * options.radius, 0, 0},
                          .color = "#2fa36b",
                          .opacity = 0.7});
  }

  /// The links as the robot is now, into the sample that is open.
  void record() {
    for (std::size_t i = 0; i < links_.size(); ++i) {
      const auto& p = robot_.axis_point(static_cast<icat::Index>(i));
      log_.set(links_[i], p(0), p(1), p(2));
    }
  }
  /// The place where the first frame shall be, m.
  void set_goal(const icat::Vector3<double>& goal) {
    log_.set(goal_, goal.x(), goal.y(), goal.z());
  }

 private:
  icat::Log& log_;
  const Robot& robot_;
  std::vector<icat::LogChannel> links_;
  icat::LogChannel goal_;
};

/// See above. The controller must outlive it.
template <class Controller>
class RobotReplay {
 public:
  RobotReplay(Replay& replay, const Controller& controller, const RobotReplayOptions& options)
      : run_(replay.add(options.name, options.title, options.samples)),
        log_(replay.log()),
        controller_(controller),
        recorder_(log_, controller, {.frames = options.frames, .rows = options.rows}),
        picture_(run_, log_, robot_of(controller), options),
        explainer_(controller),
        period_(options.period) {
    run_.plots = {{"Activations", {"activation/"}, "", -0.03, 1.03},
                  {"Rates that tasks ask for and do not get", {"error/"}, "m/s, rad/s", 0, 0, true},
                  {"Velocities", {"velocity/"}, "rad/s, m/s"}};
  }

  /// After the controller's step at `t`; in `phase` of a mission.
  void record(double t, std::string_view phase) {
    if (!log_.begin(t)) return;
    recorder_.record();
    picture_.record();
    log_.phase(t, phase);
    if (t < next_explanation_) return;
    next_explanation_ = t + period_;
    explainer_.update();
    log_.explain(t, explainer_.conclusion());
  }
  /// The same; the phase is the controller's action.
  void record(double t) { record(t, controller_.action()); }
  /// The same with the place where the first frame shall be, m.
  void record(double t, const icat::Vector3<double>& goal) {
    record(t);
    picture_.set_goal(goal);
  }
  /// The same in `phase` of a mission.
  void record(double t, const icat::Vector3<double>& goal, std::string_view phase) {
    record(t, phase);
    picture_.set_goal(goal);
  }
  /// For shapes and plots of one's own.
  icat::ReplayRun& run() { return run_; }
  icat::Log& log() { return log_; }

 private:
  static const auto& robot_of(const Controller& controller) {
    if constexpr (requires { controller.first(); }) {
      return controller.first().robot();
    } else {
      return controller.robot();
    }
  }
  using Robot = std::remove_cvref_t<decltype(robot_of(std::declval<const Controller&>()))>;

  icat::ReplayRun& run_;
  icat::Log& log_;
  const Controller& controller_;
  icat::ControllerLog<Controller> recorder_;
  RobotPicture<Robot> picture_;
  icat::Explainer<Controller> explainer_;
  double period_, next_explanation_ = 0;
};

}  // namespace support
