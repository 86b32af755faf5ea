// SPDX-License-Identifier: BSD-3-Clause
// What the missions with the papers' vehicle and arm record in each cycle, and how they draw it.
#pragma once

#include <array>
#include <icat/model/kinematic_tree.hpp>
#include <icat/task/manipulability.hpp>

#include "csv.hpp"

namespace support {

/// Seven joints and the vehicle's six velocities.
using Uvms = icat::KinematicTree<double, 13>;
using Command = icat::Vector<double, 13>;

/// A cycle of one robot.
struct RobotSample {
  Command command;                         ///< [q̇; v̄]
  icat::Vector6<double> vehicle_velocity;  ///< as it was over the cycle before
  icat::Pose<double> vehicle, tool;
  icat::Vector<double, 7> q;
  double joint_margin;                       ///< to the closest limit, rad
  double manipulability;                     ///< m³
  double attitude;                           ///< of the vehicle's z axis from the vertical, rad
  double centering;                          ///< of the target from the camera's axis, rad
  std::array<icat::Vector3<double>, 9> arm;  ///< in the world, from the mount to the tip
};

/// Fills in what is drawn of the robot as it is now: pose of the vehicle, tool, joints, arm.
void record_posture(const Uvms& robot, icat::FrameId tool, icat::FrameId tip, RobotSample& sample);

/// Fills samples of one robot.
class Recorder {
 public:
  /// `tip`: where the drawing of the arm ends. `target`: of the camera, in ⟨0⟩.
  Recorder(const Uvms& robot, icat::FrameId tool, icat::FrameId tip, icat::FrameId camera,
           const icat::Vector3<double>& target, icat::task::Manipulability<Uvms>& manipulability)
      : robot_(robot),
        tool_(tool),
        tip_(tip),
        camera_(camera),
        target_(target),
        manipulability_(manipulability) {}
  /// The robot as it is now, with the command of this cycle and the velocity of the one before.
  void record(const Command& command, const icat::Vector6<double>& vehicle_velocity,
              RobotSample& sample);

 private:
  const Uvms& robot_;
  icat::FrameId tool_, tip_, camera_;
  icat::Vector3<double> target_;
  icat::task::Manipulability<Uvms>& manipulability_;
};

/// Two strokes: the hull, a box of 1.0 × 0.6 × 0.73 m, and the arm.
void draw_robot(Strokes& strokes, const RobotSample& sample);

}  // namespace support
