// SPDX-License-Identifier: BSD-3-Clause
// A user's program: Jacobians from Pinocchio, which somebody else built with flags of their own,
// and velocities from icat.
#include <cstdio>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <string>

#include "solver.hpp"

int main() {
  pinocchio::Model model;
  pinocchio::JointIndex last = 0;
  const pinocchio::SE3 up(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, 0, 0.2));
  for (int i = 0; i < 7; ++i) {
    const std::string name = "joint" + std::to_string(i);
    last = i % 2 == 0 ? model.addJoint(last, pinocchio::JointModelRZ(), up, name)
                      : model.addJoint(last, pinocchio::JointModelRY(), up, name);
    model.appendBodyToJoint(last, pinocchio::Inertia::Random());
  }
  model.addFrame(pinocchio::Frame("tool", last, up, pinocchio::OP_FRAME));
  const pinocchio::FrameIndex tool = model.getFrameId("tool");
  pinocchio::Data data(model);

  Eigen::VectorXd q = Eigen::VectorXd::Constant(model.nq, 0.4);
  pinocchio::framesForwardKinematics(model, data, q);
  const Eigen::Vector3d goal = data.oMf[tool].translation() + Eigen::Vector3d(0.1, 0.05, -0.05);
  Eigen::VectorXd velocity(model.nv);
  double error = 1;
  for (int k = 0; k < 200; ++k) {
    pinocchio::framesForwardKinematics(model, data, q);
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(6, model.nv);
    pinocchio::computeFrameJacobian(model, data, q, tool, pinocchio::LOCAL_WORLD_ALIGNED, jacobian);
    const Eigen::MatrixXd linear = jacobian.topRows(3);
    const Eigen::Vector3d to_go = goal - data.oMf[tool].translation();
    error = to_go.norm();
    if (!solve(3, model.nv, linear.data(), to_go.data(), velocity.data())) return 1;
    q += 0.1 * velocity;
  }
  std::printf("tool error %.1e m\n", error);
  return error < 1e-6 ? 0 : 1;
}
