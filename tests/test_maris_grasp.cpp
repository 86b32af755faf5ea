// SPDX-License-Identifier: BSD-3-Clause
// The seven-level grasp of MARIS, in the mission of MARIS.
#include <gtest/gtest.h>

#include <icat/action/maris_grasp.hpp>
#include <icat/control/controller.hpp>
#include <icat/mission/maris_mission.hpp>
#include <icat/model/maris.hpp>
#include <icat/model/uvms.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <icat/task/column_tasks.hpp>

#include "support/sanitized.hpp"

namespace {

using Robot = icat::KinematicTree<double, 13>;
using Pose = icat::Pose<double>;
using Vector3 = icat::Vector3<double>;
using Vector13 = icat::Vector<double, 13>;
using Objective = icat::Objective<double>;
using icat::Status;
namespace task = icat::task;

Pose at(double x, double y, double z, double pitch = 0, double yaw = 0) {
  const icat::Matrix3<double> turn = icat::axis_rotation<double>(Vector3(0, 0, 1), yaw) *
                                     icat::axis_rotation<double>(Vector3(0, 1, 0), pitch);
  return icat::detail::make_pose(turn, Vector3(x, y, z));
}

Robot make_robot() {
  return icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>(),
                                                .camera = at(0.45, 0, 0.35),  // looks down
                                                .tool = at(0, 0, 0.1)});
}

Eigen::VectorXd folded() {
  Eigen::VectorXd q(7);
  q << 0, 0.7, 0, -1.8, 0, 1.1, 0;
  return q;
}

/// A robot, its grasp, and the actions of the mission.
struct Diver {
  Diver()
      : robot(make_robot()),
        grasp(robot, {robot.frame("tool"), robot.frame(icat::maris_elbow), robot.frame("camera")},
              folded()),
        waypoint(robot, robot.base(), at(0, 0, 1),
                 {.name = "waypoint", .gain = 0.5, .max_linear_rate = 0.2, .max_angular_rate = 0.2}),
        still_arm(robot, icat::joint_columns(robot)) {}

  std::vector<icat::Action<Robot>> actions() {
    return {{"survey", {{grasp.joint_limits}, {waypoint}, {still_arm}}},
            grasp.action(),
            {"carry", {{grasp.joint_limits}, {grasp.shape}}}};
  }

  Robot robot;
  icat::MarisGrasp<Robot> grasp;
  task::FramePose<Robot> waypoint;
  task::Minimality<Robot> still_arm;
};

TEST(MarisGrasp, SevenLevelsInTheOrderOfThePaper) {
  Diver diver;
  const std::vector<std::string> order{"joint limits",     "manipulability", "elbow occlusion",
                                       "camera centering", "tool position",  "tool orientation",
                                       "preferred shape"};
  // Alone, and among the others of the mission.
  const icat::Controller alone(diver.robot, {diver.grasp.action()});
  ASSERT_EQ(alone.hierarchy().size(), order.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    ASSERT_EQ(alone.hierarchy()[k].size(), 1u);
    EXPECT_EQ(alone.hierarchy()[k][0].task->name(), order[k]);
  }
  const icat::Controller all(diver.robot, diver.actions());
  std::size_t next = 0;
  for (const auto& level : all.hierarchy()) {
    for (const auto& entry : level) {
      if (next < order.size() && entry.task->name() == order[next]) ++next;
    }
  }
  EXPECT_EQ(next, order.size());
}
}  // namespace
