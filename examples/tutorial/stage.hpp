// SPDX-License-Identifier: BSD-3-Clause
// What the steps share: the loop that runs them, and what is kept of it.
#pragma once

#include <algorithm>
#include <functional>
#include <icat/icat.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <optional>

#include "../support/geometry.hpp"
#include "../support/robot_replay.hpp"
#include "steps.hpp"

namespace tutorial {

//! [robot]
using Robot = icat::KinematicTree<double>;

// The arm of the MARIS project, seven joints: on a pedestal of 0.43 m, or on a base that moves.
inline Robot make_arm(const icat::Base<double>& base = icat::Base<double>::fixed()) {
  auto joints = icat::axes_chain(icat::maris_arm<double>(), "arm_base");
  joints.push_back(
      {"mount", "base", "arm_base", icat::JointType::fixed, icat::maris_arm_mount<double>()});
  return Robot({.joints = joints, .base = base});
}
//! [robot]

/// Bent in front of the robot, rad.
inline Eigen::VectorXd bent() {
  Eigen::VectorXd q(7);
  q << 0, -0.3, 0, -1.8, 0, 0.6, 0;
  return q;
}

/// A step in one of its forms.
struct Stage {
  bool broken;
  support::Replay* replay;  ///< null: none
  double seconds = 12;      ///< how long it runs
  double ask = 12;          ///< when it asks why, s
  double box = 0;           ///< edge of the base as it is drawn, m
  Outcome outcome = {};

  /// Runs the loop; `cycle(t)` steps the controller. `goal` of the tool, as it is then.
  template <class Controller>
  Outcome run(Robot& robot, icat::KinematicPlant<Robot>& plant, Controller& controller,
              const icat::Vector3<double>& goal, const std::function<icat::Status(double)>& cycle) {
    std::optional<support::RobotReplay<Controller>> view;
    if (replay) {
      view.emplace(
          *replay, controller,
          support::RobotReplayOptions{.frames = {"end_effector"},
                                      .name = broken ? "broken" : "whole",
                                      .title = broken ? "one line broken" : "as it should be",
                                      .base = {box, 0.7 * box, 0.5 * box},
                                      .base_at = {0, 0, -0.25 * box},
                                      .samples = 4000,
                                      .period = 0.1});
    }
    const icat::FrameId tool = robot.frame("end_effector");
    Eigen::VectorXd last = Eigen::VectorXd::Zero(robot.dof());
    outcome.margin = icat::infinity<double>;
    bool asked = false;
    //! [loop]
    const double dt = 0.01;  // s
    for (double t = 0; t < seconds; t += dt) {
      icat::Status status = robot.update(plant.q(), plant.base());  // as it is measured
      if (status == icat::Status::ok) status = cycle(t);            // steps the controller
      plant.step(controller.command(), t, dt);                      // moves the robot
      //! [loop]
      if (view) view->record(t, goal);
      if (!asked && t > ask - 1.5 * dt) {
        asked = true;
        ask_why(controller);
      }
      outcome.error = (goal - robot.pose(tool).translation()).norm();
      outcome.margin = std::min(outcome.margin, support::joint_margin(robot));
      outcome.largest_change =
          std::max(outcome.largest_change, (controller.command() - last).norm());
      last = controller.command();
    }
    return outcome;
  }

 private:
  template <class Controller>
  void ask_why(const Controller& controller) {
    const icat::Explainer<Controller> why(controller);
    outcome.text = why.text();
    for (const auto& t : why.tasks()) {
      Judgement judgement{.task = std::string(t.task), .verdict = t.verdict, .alarm = t.alarm};
      if (const auto* most = t.most()) {
        judgement.cause = most->cause;
        judgement.limit = most->limit;
        judgement.taken_by = std::string(most->task);
        if (most->column >= 0) judgement.column = why.column_name(most->column);
      }
      outcome.judgements.push_back(judgement);
    }
  }
};

}  // namespace tutorial
