// SPDX-License-Identifier: BSD-3-Clause
// An arm from a URDF: its tool follows a line that leads through a singularity (the wrist's axes
// align), then out of the workspace and back. The motion neither stops nor jumps: unreachable goals
// are approached as far as possible.
#include <cstdio>
#include <optional>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/robot_replay.hpp"
#include "../support/support.hpp"
#include "arm.hpp"

int main(int argc, char** argv) {
  const auto arguments = support::parse(
      argc, argv, "An arm from a URDF moves beyond its workspace.", "out/05_urdf_arm");
  support::Replay replay("An arm moves through a singularity and out of its workspace");
  std::optional<support::RobotReplay<arm::Controller>> view;
  support::Csv csv(arguments.output, "run.csv", "t,error,turn,mu,speed,step,height,reach");
  double worst_step = 0, farthest = 0, least = 1, end = 1;
  Eigen::VectorXd last = Eigen::VectorXd::Zero(6);
  const icat::Status status =
      arm::run(ICAT_EXAMPLE_FOLDER "/arm.urdf", [&](const arm::Cycle& cycle) {
        if (!view)
          view.emplace(replay, cycle.controller, support::RobotReplayOptions{.frames = {"tool"}});
        view->record(cycle.t, cycle.goal);
        end = (cycle.goal - cycle.tool).norm();
        const double step = (cycle.velocity - last).norm();
        last = cycle.velocity;
        worst_step = std::max(worst_step, step);
        least = std::min(least, cycle.manipulability);
        farthest = std::max(farthest, end);
        csv.row({cycle.t, end, cycle.turn, cycle.manipulability, last.cwiseAbs().maxCoeff(), step,
                 cycle.tool.z(), cycle.tool.head<2>().norm()});
      });
  std::printf(
      "%s: manipulability down to %.1e; out of the workspace the tool stays %.0f mm short;\n"
      "back at its goal to %.1e mm; the largest change of a command in %.0f ms is %.3f rad/s\n",
      icat::describe(status), least, 1e3 * farthest, 1e3 * end, 1e3 * arm::dt, worst_step);
  if (arguments.pictures) support::draw(arguments.output);
  replay.write(arguments.output, arguments.logs);
  return status == icat::Status::ok && end < 1e-4 && farthest > 0.1 && worst_step < 0.1 ? 0 : 1;
}
