// SPDX-License-Identifier: BSD-3-Clause
// icat on the problems of problems.py: the controller as a user has it, and the solver alone.
// Arguments: the folder of the problems, what to call this build.
#include <algorithm>
#include <icat/adapters/urdf.hpp>
#include <icat/icat.hpp>
#include <memory>
#include <stdexcept>

#include "problems.hpp"

namespace {

using Robot = icat::KinematicTree<double>;
using Pose = icat::Pose<double>;

void expect(icat::Status status) {
  if (status != icat::Status::ok) throw std::runtime_error(icat::describe(status));
}

/// Joint limits, the frames from the first to the last, the centre of mass, the posture.
class Icat {
 public:
  struct State {
    Eigen::VectorXd q;
    Pose base;
  };
  struct Goal {
    std::vector<Pose> poses;
    Eigen::Vector3d com;
    Eigen::VectorXd posture;
  };

  explicit Icat(const peers::Problem& p)
      : robot_(icat::load_urdf<double>(
            p.urdf, {.base = p.free ? icat::Base<double>::free() : icat::Base<double>::fixed()})),
        limits_(robot_),
        posture_(robot_, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(p.joints.size())),
                 {.gain = 1 / peers::dt}) {
    for (const auto& joint : robot_.joints()) {
      const auto at = std::find(p.joints.begin(), p.joints.end(), joint.name);
      order_.push_back(at - p.joints.begin());
      columns_.push_back(joint.column);
    }
    icat::Action<Robot> action{"work", {{limits_}}};
    for (const auto& name : p.frames) {
      ids_.push_back(robot_.frame(name));
      frames_.push_back(std::make_unique<icat::task::FramePose<Robot>>(
          robot_, ids_.back(), Pose::Identity(),
          icat::task::FramePose<Robot>::Options{.name = name, .gain = 1 / peers::dt}));
      action.levels.push_back({*frames_.back()});
    }
    if (p.com) {
      com_ = std::make_unique<icat::task::CenterOfMass<Robot>>(
          robot_, Eigen::Vector3d::Zero(),
          icat::task::CenterOfMass<Robot>::Options{.gain = 1 / peers::dt});
      action.levels.push_back({*com_});
    }
    action.levels.push_back({posture_});
    controller_ =
        std::make_unique<icat::Controller<Robot>>(robot_, std::vector<icat::Action<Robot>>{action});
    expect(controller_->start("work", 0));
  }

  State state(const peers::State& from) const {
    State to{Eigen::VectorXd(from.q.size()), Pose::Identity()};
    for (std::size_t i = 0; i < order_.size(); ++i) {
      to.q(static_cast<Eigen::Index>(i)) = from.q(order_[i]);
    }
    to.base.translation() = from.base;
    return to;
  }
  void model(const State& state) { expect(robot_.update(state.q, state.base)); }
  Goal goal(const State& state) const {
    Goal goal{{}, robot_.center_of_mass(), state.q};
    for (const auto id : ids_) goal.poses.push_back(robot_.pose(id));
    return goal;
  }
  void target(const Goal& goal) {
    for (std::size_t i = 0; i < frames_.size(); ++i) expect(frames_[i]->set_goal(goal.poses[i]));
    if (com_) expect(com_->set_goal(goal.com));
    expect(posture_.set_goal(goal.posture));
  }
  void solve() { expect(controller_->step(time_ += peers::dt)); }
  Eigen::VectorXd velocity() const {
    Eigen::VectorXd v(static_cast<Eigen::Index>(order_.size()));
    for (std::size_t i = 0; i < order_.size(); ++i) {
      v(order_[i]) = controller_->velocity()(columns_[i]);
    }
    return v;
  }
  void move(Goal& goal, std::size_t frame, const Eigen::Vector3d& by) const {
    goal.poses[frame].translation() += by;
  }
  Eigen::Vector3d position(std::size_t frame) const {
    return robot_.pose(ids_[frame]).translation();
  }

  const Robot& robot() const { return robot_; }
  const icat::Controller<Robot>& controller() const { return *controller_; }

 private:
  Robot robot_;
  icat::task::JointLimits<Robot> limits_;
  icat::task::JointPosition<Robot> posture_;
  std::vector<icat::FrameId> ids_;
  std::vector<std::unique_ptr<icat::task::FramePose<Robot>>> frames_;
  std::unique_ptr<icat::task::CenterOfMass<Robot>> com_;
  std::unique_ptr<icat::Controller<Robot>> controller_;
  std::vector<Eigen::Index> order_, columns_;
  double time_{0};
};

/// The solver on the levels that the controller had at each state.
template <int N>
void measure_alone(const std::string& name, Icat& peer, const peers::Problem& p) {
  using Levels = std::vector<icat::Level<double, Eigen::Dynamic>>;
  std::vector<Icat::State> path;
  std::vector<Levels> recorded;
  for (const auto& state : p.path) path.push_back(peer.state(state));
  for (std::size_t k = 0; k < peers::states; ++k) {
    peer.model(path[k + 1]);
    const Icat::Goal goal = peer.goal(path[k + 1]);
    peer.model(path[k]);
    peer.target(goal);
    peer.solve();
    const auto levels = peer.controller().levels();
    recorded.emplace_back(levels.begin(), levels.end());
    Eigen::Index partial = 0;
    for (const auto& level : recorded.back()) {
      partial += (level.activation.array() > 0 && level.activation.array() < 1).count();
    }
    if (partial != (p.variant == "limit")) throw std::runtime_error("not the activations meant");
  }
  auto tpik = [&] {
    if constexpr (N == Eigen::Dynamic) {
      return icat::Tpik<double>(peer.robot().dof());
    } else {
      return icat::Tpik<double, N>();
    }
  }();
  const std::string part = N == Eigen::Dynamic ? "alone" : "alone, fixed size";
  const auto measure = [&](const std::string& what) {
    peers::Times times;
    std::size_t regularized = 0;
    const double end = peers::now() + 1e6 * peers::seconds;
    for (std::size_t k = 0; k < peers::states || peers::now() < end; ++k) {
      const Levels& levels = recorded[k % peers::states];
      const double start = peers::now();
      tpik.reset();
      for (const auto& level : levels) {
        expect(tpik.add_level(level.jacobian, level.activation, level.reference, level.scales()));
      }
      expect(tpik.minimize_velocity());
      if (k >= 100) times.values.push_back(peers::now() - start);
      const auto reports = tpik.report().levels();
      regularized += k < peers::states && std::any_of(reports.begin(), reports.end(),
                                                      [](const auto& l) { return l.regularized; });
    }
    times.say(name, p, what.c_str());
    std::printf("regularized\t%s\t%s\t%s\t%zu\n", name.c_str(), p.robot.c_str(), p.variant.c_str(),
                regularized);
  };
  measure(part);
  if (p.variant != "limit") return;
  for (Levels& levels : recorded)
    levels.front().activation.setZero();  // what the place alone costs
  measure(part + ", no limits");
}

}  // namespace

int main(int, char** argv) {
  const std::string folder = argv[1], name = argv[2];
  std::printf("version\t%s\t%d.%d.%d, Eigen %d.%d.%d, %s\n", name.c_str(), ICAT_VERSION_MAJOR,
              ICAT_VERSION_MINOR, ICAT_VERSION_PATCH, EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION,
              EIGEN_MINOR_VERSION, argv[3]);
  std::printf(
      "note\t%s\tstrict priorities: joint limits, each frame, centre of mass, posture; then hard "
      "limits of velocity and position on the command. Joint limits push within the default margin "
      "of 0.1 rad.\n",
      name.c_str());
  for (const std::string robot : peers::robots) {
    for (const std::string variant : peers::variants) {
      const peers::Problem p = peers::read(folder, robot, variant);
      Icat peer(p);
      peers::measure(name, peer, p);
      if (peers::counter()) continue;
      measure_alone<Eigen::Dynamic>(name, peer, p);
      if (robot == "panda") measure_alone<7>(name, peer, p);
      if (robot == "tiago") measure_alone<13>(name, peer, p);
      if (robot == "talos") measure_alone<38>(name, peer, p);
    }
  }
  if (peers::counter()) {
    peers::answers(name, folder, [](const auto& p) { return std::make_unique<Icat>(p); });
  }
}
