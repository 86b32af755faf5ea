// SPDX-License-Identifier: BSD-3-Clause
// KDL on the problems of problems.py: its online solver for trees, and for the Panda the solver for
// a chain that also has a posture. Argument: the folder of the problems.
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainiksolvervel_pinv_nso.hpp>
#include <kdl/treefksolverpos_recursive.hpp>
#include <kdl/treeiksolverpos_online.hpp>
#include <kdl/treeiksolvervel_wdls.hpp>
#include <kdl_parser/kdl_parser.hpp>
#include <memory>
#include <stdexcept>

#include "problems.hpp"

namespace {

/// The robot; a free base as six joints before its root.
KDL::Tree load(const peers::Problem& p) {
  KDL::Tree robot;
  if (!kdl_parser::treeFromFile(p.urdf, robot)) throw std::runtime_error("no tree: " + p.urdf);
  if (!p.free) return robot;
  KDL::Tree tree("world");
  std::string parent = "world";
  const KDL::Joint::JointType types[] = {KDL::Joint::TransX, KDL::Joint::TransY, KDL::Joint::TransZ,
                                         KDL::Joint::RotX,   KDL::Joint::RotY,   KDL::Joint::RotZ};
  for (int i = 0; i < 6; ++i) {
    const std::string name = i < 5 ? "base" + std::to_string(i) : robot.getRootSegment()->first;
    tree.addSegment(KDL::Segment(name, KDL::Joint("base" + std::to_string(i), types[i])), parent);
    parent = name;
  }
  tree.addTree(robot, parent);  // all but its root
  return tree;
}

/// What both solvers need of the state.
class Kdl {
 public:
  struct State {
    KDL::JntArray q;
  };

  Kdl(const peers::Problem& p, const KDL::Tree& tree) : tree_(tree), fk_(tree_), frames_(p.frames) {
    columns_.resize(p.joints.size());
    for (const auto& [name, element] : tree_.getSegments()) {
      const auto joint = element.segment.getJoint().getName();
      const auto at = std::find(p.joints.begin(), p.joints.end(), joint);
      if (at == p.joints.end()) continue;
      columns_[static_cast<std::size_t>(at - p.joints.begin())] = element.q_nr;
    }
    for (unsigned i = 0; p.free && i < 3; ++i) {
      base_.push_back(tree_.getSegment("base" + std::to_string(i))->second.q_nr);
    }
    q_ = array(0);
  }
  State state(const peers::State& from) const {
    State to{array(0)};
    for (std::size_t i = 0; i < base_.size(); ++i) to.q(base_[i]) = from.base(Eigen::Index(i));
    for (std::size_t i = 0; i < columns_.size(); ++i) to.q(columns_[i]) = from.q(Eigen::Index(i));
    return to;
  }
  void model(const State& state) { q_ = state.q; }
  Eigen::Vector3d position(std::size_t frame) {
    const KDL::Vector p = pose(frame).p;
    return {p.x(), p.y(), p.z()};
  }

 protected:
  KDL::JntArray array(double value) const {
    KDL::JntArray result(tree_.getNrOfJoints());
    result.data.setConstant(value);
    return result;
  }
  KDL::Frame pose(std::size_t frame) {
    KDL::Frame result;
    fk_.JntToCart(q_, result, frames_[frame]);
    return result;
  }
  Eigen::VectorXd joints(const KDL::JntArray& rates) const {
    Eigen::VectorXd v(Eigen::Index(columns_.size()));
    for (std::size_t i = 0; i < columns_.size(); ++i) v(Eigen::Index(i)) = rates(columns_[i]);
    return v;
  }

  KDL::Tree tree_;
  KDL::TreeFkSolverPos_recursive fk_;
  std::vector<std::string> frames_;
  std::vector<unsigned> columns_, base_;
  KDL::JntArray q_;
};

/// TreeIkSolverPos_Online with TreeIkSolverVel_wdls.
class Tree : public Kdl {
 public:
  using Goal = KDL::Frames;

  explicit Tree(const peers::Problem& p)
      : Kdl(p, load(p)), velocity_solver_(tree_, p.frames), next_(q_) {
    velocity_solver_.setLambda(1e-3);
    KDL::JntArray lower = array(-1e9), upper = array(1e9), step = array(1e9);
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      lower(columns_[i]) = p.lower(Eigen::Index(i));
      upper(columns_[i]) = p.upper(Eigen::Index(i));
      step(columns_[i]) = peers::dt * p.speed(Eigen::Index(i));
    }
    solver_ = std::make_unique<KDL::TreeIkSolverPos_Online>(
        tree_.getNrOfJoints(), p.frames, lower, upper, step, 1.0, 1.0, fk_, velocity_solver_);
  }
  Goal goal(const State&) {
    Goal goal;
    for (std::size_t i = 0; i < frames_.size(); ++i) goal[frames_[i]] = pose(i);
    return goal;
  }
  void target(const Goal& goal) {
    for (const auto& [name, frame] : goal) goal_[name] = frame;
  }
  void solve() {
    if (solver_->CartToJnt(q_, goal_, next_) < 0) throw std::runtime_error("the solver fails");
  }
  Eigen::VectorXd velocity() const {
    KDL::JntArray rates = next_;
    rates.data = (next_.data - q_.data) / peers::dt;
    return joints(rates);
  }
  void move(Goal& goal, std::size_t frame, const Eigen::Vector3d& by) const {
    goal[frames_[frame]].p += KDL::Vector(by.x(), by.y(), by.z());
  }

 private:
  KDL::TreeIkSolverVel_wdls velocity_solver_;
  std::unique_ptr<KDL::TreeIkSolverPos_Online> solver_;
  KDL::Frames goal_;
  KDL::JntArray next_;
};

/// ChainIkSolverVel_pinv_nso, for one frame.
class Chain : public Kdl {
 public:
  struct Goal {
    KDL::Frame frame;
    KDL::JntArray posture;
  };

  explicit Chain(const peers::Problem& p) : Kdl(p, load(p)), rates_(q_) {
    tree_.getChain(tree_.getRootSegment()->first, p.frames[0], chain_);
    chain_fk_ = std::make_unique<KDL::ChainFkSolverPos_recursive>(chain_);
    solver_ = std::make_unique<KDL::ChainIkSolverVel_pinv_nso>(chain_, q_, array(1), 1e-5, 150,
                                                               1 / peers::dt);
  }
  Goal goal(const State& state) { return {pose(0), state.q}; }
  void target(const Goal& goal) {
    goal_ = goal.frame;
    solver_->setOptPos(goal.posture);
  }
  void model(const State& state) {
    q_ = state.q;
    chain_fk_->JntToCart(q_, now_);
  }
  void solve() {
    if (solver_->CartToJnt(q_, KDL::diff(now_, goal_, peers::dt), rates_) < 0) {
      throw std::runtime_error("the solver fails");
    }
  }
  Eigen::VectorXd velocity() const { return joints(rates_); }
  void move(Goal& goal, std::size_t, const Eigen::Vector3d& by) const {
    goal.frame.p += KDL::Vector(by.x(), by.y(), by.z());
  }

 private:
  KDL::Chain chain_;
  std::unique_ptr<KDL::ChainFkSolverPos_recursive> chain_fk_;
  std::unique_ptr<KDL::ChainIkSolverVel_pinv_nso> solver_;
  KDL::Frame goal_, now_;
  KDL::JntArray rates_;
};

}  // namespace

int main(int, char** argv) {
  const std::string folder = argv[1], tree = "KDL, tree", chain = "KDL, chain";
  std::printf("version\t%s\t%s\nversion\t%s\t%s\n", tree.c_str(), argv[2], chain.c_str(), argv[2]);
  std::printf(
      "note\t%s\tonly frames, by damped least squares; the step is scaled to the velocity limits "
      "and cut at the position limits. No posture, no centre of mass. *Solve* includes its "
      "model.\n",
      tree.c_str());
  std::printf(
      "note\t%s\tone frame by the pseudo-inverse, the posture in its null space. No limits.\n",
      chain.c_str());
  for (const std::string robot : peers::robots) {
    for (const std::string variant : peers::variants) {
      const peers::Problem p = peers::read(folder, robot, variant);
      Tree peer(p);
      peers::measure(tree, peer, p);
      if (robot != "panda") continue;
      Chain arm(p);
      peers::measure(chain, arm, p);
    }
  }
  if (!peers::counter()) return 0;
  peers::answers(tree, folder, [](const auto& p) { return std::make_unique<Tree>(p); });
  peers::answers(
      chain, folder, [](const auto& p) { return std::make_unique<Chain>(p); }, false);
}
