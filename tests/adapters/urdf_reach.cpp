// SPDX-License-Identifier: BSD-3-Clause
// Any URDF, any frame: the frame goes 0.1 m along x. urdf_reach <file> <frame>
#include <icat/adapters/urdf.hpp>
#include <icat/icat.hpp>

int main(int, char** argv) {
  auto robot = icat::load_urdf<double>(argv[1]);  // fixed base
  Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.dof());
  for (const auto& joint : robot.joints()) {
    if (!joint.continuous) q(joint.column) = (joint.lower + joint.upper) / 2;
  }
  if (robot.update(q) != icat::Status::ok) return 1;
  const icat::FrameId hand = robot.frame(argv[2]);
  icat::Pose<double> goal = robot.pose(hand);
  goal.translation().x() += 0.1;
  icat::task::JointLimits limits(robot, {.margin = 0.05});
  icat::task::FramePose reach(robot, hand, goal, {.gain = 2.0});
  icat::Controller controller(robot, {{"reach", {{limits}, {reach}}}});
  icat::Status status = controller.start("reach", 0.0);
  for (double t = 0; t < 10 && status == icat::Status::ok; t += 0.01) {
    status = controller.step(t);
    q += 0.01 * controller.velocity();
    if (status == icat::Status::ok) status = robot.update(q);
  }
  return status == icat::Status::ok &&
                 (robot.pose(hand).translation() - goal.translation()).norm() < 1e-4
             ? 0
             : 1;
}
