// SPDX-License-Identifier: BSD-3-Clause
// A user's program: Jacobians from KDL, which somebody else built with flags of their own, and
// velocities from icat.
#include <cstdio>
#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include "solver.hpp"

int main() {
  KDL::Chain chain;
  for (int i = 0; i < 7; ++i) {
    const auto axis = i % 2 == 0 ? KDL::Joint::RotZ : KDL::Joint::RotY;
    chain.addSegment(KDL::Segment(KDL::Joint(axis), KDL::Frame(KDL::Vector(0, 0, 0.2))));
  }
  KDL::ChainFkSolverPos_recursive position(chain);
  KDL::ChainJntToJacSolver jacobians(chain);
  KDL::JntArray q;
  q.data = Eigen::VectorXd::Constant(7, 0.4);  // allocated here, freed inside the library
  KDL::Jacobian jacobian(7);                   // allocated there
  KDL::Frame tool;
  position.JntToCart(q, tool);
  const KDL::Vector goal = tool.p + KDL::Vector(0.1, 0.05, -0.05);

  Eigen::VectorXd velocity(7);
  double error = 1;
  for (int k = 0; k < 200; ++k) {
    if (position.JntToCart(q, tool) < 0 || jacobians.JntToJac(q, jacobian) < 0) return 1;
    const KDL::Vector d = goal - tool.p;
    const Eigen::Vector3d to_go(d.x(), d.y(), d.z());
    const Eigen::MatrixXd linear = jacobian.data.topRows(3);
    error = to_go.norm();
    if (!solve(3, 7, linear.data(), to_go.data(), velocity.data())) return 1;
    q.data += 0.1 * velocity;
  }
  std::printf("tool error %.1e m\n", error);
  return error < 1e-6 ? 0 : 1;
}
