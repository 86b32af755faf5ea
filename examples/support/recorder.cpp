// SPDX-License-Identifier: BSD-3-Clause
#include "recorder.hpp"

#include <cmath>

#include "geometry.hpp"

namespace support {

void record_posture(const Uvms& robot, icat::FrameId tool, icat::FrameId tip, RobotSample& s) {
  s.vehicle = robot.pose(robot.base());
  s.tool = robot.pose(tool);
  s.q = robot.q();
  s.joint_margin = joint_margin(robot);
  s.attitude = std::acos(std::clamp(s.vehicle.matrix()(2, 2), -1.0, 1.0));
  for (std::size_t j = 0; j < 7; ++j) {
    s.arm[j] = robot.pose(robot.frame("link" + std::to_string(j + 1))).translation();
  }
  s.arm[7] = robot.pose(robot.frame("end_effector")).translation();
  s.arm[8] = robot.pose(tip).translation();
}

void Recorder::record(const Command& command, const icat::Vector6<double>& vehicle_velocity,
                      RobotSample& s) {
  s.command = command;
  s.vehicle_velocity = vehicle_velocity;
  record_posture(robot_, tool_, tip_, s);
  manipulability_.update();
  s.manipulability = manipulability_.value();
  s.centering = angle_from_z(robot_.pose(camera_), target_);
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
