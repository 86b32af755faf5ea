// SPDX-License-Identifier: BSD-3-Clause
#include "recorder.hpp"

#include <cmath>

#include "geometry.hpp"

namespace support {

void Recorder::record(const Command& command, const icat::Vector6<double>& vehicle_velocity,
                      RobotSample& s) {
  s.command = command;
  s.vehicle_velocity = vehicle_velocity;
  s.vehicle = robot_.pose(robot_.base());
  s.tool = robot_.pose(tool_);
  s.q = robot_.q();
  s.joint_margin = joint_margin(robot_);
  manipulability_.update();
  s.manipulability = manipulability_.value();
  s.attitude = std::acos(std::clamp(s.vehicle.matrix()(2, 2), -1.0, 1.0));
  s.centering = angle_from_z(robot_.pose(camera_), target_);
  for (std::size_t j = 0; j < 7; ++j) {
    s.arm[j] = robot_.pose(robot_.frame("link" + std::to_string(j + 1))).translation();
  }
  s.arm[7] = robot_.pose(robot_.frame("end_effector")).translation();
  s.arm[8] = robot_.pose(tip_).translation();
}

void draw_robot(Strokes& strokes, const RobotSample& sample) {
  const double x = 0.5, y = 0.3, top = -0.3, bottom = 0.43;
  std::array<icat::Vector3<double>, 16> hull{{{x, y, top},
                                              {-x, y, top},
                                              {-x, -y, top},
                                              {x, -y, top},
                                              {x, y, top},
                                              {x, y, bottom},
                                              {-x, y, bottom},
                                              {-x, y, top},
                                              {-x, y, bottom},
                                              {-x, -y, bottom},
                                              {-x, -y, top},
                                              {-x, -y, bottom},
                                              {x, -y, bottom},
                                              {x, -y, top},
                                              {x, -y, bottom},
                                              {x, y, bottom}}};
  for (auto& p : hull) p = sample.vehicle * p;
  strokes.add(hull);
  strokes.add(sample.arm);
}

}  // namespace support
