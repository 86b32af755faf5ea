// SPDX-License-Identifier: BSD-3-Clause
// The job with KDL: kdl_job <urdf> <scenarios.txt> <folder>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainiksolvervel_pinv_nso.hpp>
#include <kdl_parser/kdl_parser.hpp>

#include "job.hpp"

namespace {

void reach(const std::string& urdf, const job::Scenario& scenario,
           std::vector<Eigen::VectorXd>& path) {
  const double dt = job::dt;
  KDL::JntArray q(7);
  q.data = scenario.q;
  const KDL::Vector by(scenario.by.x(), scenario.by.y(), scenario.by.z());
  //! [job]
  KDL::Tree tree;
  if (!kdl_parser::treeFromFile(urdf, tree)) throw std::runtime_error("no tree");
  KDL::Chain chain;
  tree.getChain("panda_link0", "panda_hand", chain);
  KDL::JntArray weights(chain.getNrOfJoints()), qdot(chain.getNrOfJoints());
  weights.data.setOnes();
  KDL::ChainFkSolverPos_recursive fk(chain);
  KDL::ChainIkSolverVel_pinv_nso ik(chain, q, weights, 1e-5, 150, 2.0);  // posture: the start
  KDL::Frame now, goal;
  fk.JntToCart(q, goal);
  goal.p += by;
  for (int k = 0; k < job::steps; ++k) {  // there are no limits
    fk.JntToCart(q, now);
    const KDL::Twist twist = 2.0 * KDL::diff(now, goal);  // a gain of 2 1/s
    if (ik.CartToJnt(q, twist, qdot) < 0) throw std::runtime_error(ik.strError(ik.getError()));
    q.data += dt * qdot.data;
    path.push_back(q.data);
  }
  //! [job]
}

}  // namespace

int main(int, char** argv) {
  const std::string urdf = argv[1], folder = argv[3];
  for (const auto& scenario : job::read(argv[2])) {
    job::write(folder + "/KDL." + scenario.name,
               job::run(scenario, [&](const auto& s, auto& path) { reach(urdf, s, path); }));
  }
}
