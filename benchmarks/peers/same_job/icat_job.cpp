// SPDX-License-Identifier: BSD-3-Clause
// The job with icat, and what everybody's answers are worth.
//
//     icat_job <urdf> <scenarios.txt>                     icat's answers are right
//     icat_job <urdf> <scenarios.txt> <folder> <peer>...  and a table with those of the peers
#include <cmath>
#include <cstdio>
#include <icat/adapters/urdf.hpp>
#include <icat/icat.hpp>

#include "job.hpp"

namespace {

void reach(const std::string& urdf, const job::Scenario& scenario,
           std::vector<Eigen::VectorXd>& path) {
  const double dt = job::dt;
  const Eigen::Vector3d by = scenario.by;
  //! [job]
  auto robot = icat::load_urdf<double>(urdf);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.dof());
  q.head(7) = scenario.q;
  if (robot.update(q) != icat::Status::ok) throw std::invalid_argument("not a posture");
  const icat::FrameId hand = robot.frame("panda_hand");
  icat::Pose<double> goal = robot.pose(hand);
  goal.translation() += by;
  icat::task::JointLimits limits(robot);
  icat::task::FramePose reach(robot, hand, goal, {.gain = 2});  // 1/s
  icat::task::JointPosition posture(robot, q, {.gain = 2});     // 1/s
  icat::Controller controller(robot, {{"reach", {{limits}, {reach}, {posture}}}});
  icat::Status status = controller.start("reach", 0);
  for (int k = 0; k < job::steps && status == icat::Status::ok; ++k) {
    status = controller.step(k * dt);  // the URDF's limits of position and velocity are kept
    q += dt * controller.velocity();
    if (status == icat::Status::ok) status = robot.update(q);
    path.push_back(q);
  }
  //! [job]
  if (status != icat::Status::ok) throw std::runtime_error(icat::describe(status));
}

struct Judge {
  icat::KinematicTree<double> robot;
  icat::FrameId hand;

  explicit Judge(const std::string& urdf)
      : robot(icat::load_urdf<double>(urdf)), hand(robot.frame("panda_hand")) {}

  icat::Pose<double> pose(const Eigen::VectorXd& q7) {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.dof());
    q.head(7) = q7.head<7>();
    if (robot.update(q) != icat::Status::ok) return icat::Pose<double>::Identity();
    return robot.pose(hand);
  }

  struct Verdict {
    double position = NAN, posture = NAN;  // at the end: off the goal (m), off the start (rad)
    double step = 0;                       // largest change of a velocity in the last second, rad/s
    double past = -1e9;                    // furthest beyond a limit, rad
    double inside = 0;                     // s until all joints are inside their limits
  };
  Verdict judge(const job::Scenario& s, const std::vector<Eigen::VectorXd>& path) {
    Verdict v;
    if (path.size() < 110 || !path.back().allFinite()) return v;
    icat::Pose<double> goal = pose(s.q);
    goal.translation() += s.by;
    v.position = (pose(path.back()).translation() - goal.translation()).norm();
    v.posture = (path.back().head<7>() - s.q).norm();
    for (std::size_t k = 0; k < path.size(); ++k) {
      double past = -1e9;
      for (Eigen::Index i = 0; i < 7; ++i) {
        const auto& joint = robot.joints()[static_cast<std::size_t>(i)];
        past = std::max({past, path[k](i) - joint.upper, joint.lower - path[k](i)});
      }
      v.past = std::max(v.past, past);
      if (past > 1e-6) v.inside = job::dt * static_cast<double>(k + 2);
      if (k + 100 < path.size()) continue;
      const Eigen::VectorXd change = path[k] - 2 * path[k - 1] + path[k - 2];
      v.step = std::max(v.step, change.head<7>().cwiseAbs().maxCoeff() / job::dt);
    }
    return v;
  }
};

std::string cell(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}
std::string past(double x) {
  return x < 1e-6 ? "inside its limits" : "past a limit by " + cell("%.2g rad", x);
}
std::string rests(double step) {
  return step < 1e-3 ? "rests" : "its velocity changes by " + cell("%.2g rad/s a step", step);
}

void say(Judge& judge, const std::string& name, const std::vector<job::Scenario>& scenarios,
         const std::vector<job::Path>& paths) {
  std::printf("| %s ", name.c_str());
  for (std::size_t i = 0; i < scenarios.size(); ++i) {
    const auto& [refusal, path] = paths[i];
    if (!refusal.empty()) {
      std::printf("| raises `%s` ", refusal.substr(0, refusal.find(':')).c_str());
      continue;
    }
    const Judge::Verdict v = judge.judge(scenarios[i], path);
    if (std::isnan(v.position) || v.position > 10) {
      std::printf("| diverges ");
    } else if (v.past > 1) {
      std::printf("| does not settle, far past its limits ");  // no figure: rounding decides it
    } else if (scenarios[i].name == "far") {
      std::printf("| %s, %s, %s ", cell("%.0f mm", 1e3 * v.position).c_str(), rests(v.step).c_str(),
                  past(v.past).c_str());
    } else if (scenarios[i].name == "beyond") {
      std::printf("| %s, inside after %s ", cell("%.3f mm", 1e3 * v.position).c_str(),
                  cell("%.2f s", v.inside).c_str());
    } else {
      std::printf("| %s, posture %s, %s ", cell("%.3f mm", 1e3 * v.position).c_str(),
                  cell("%.2f rad", v.posture).c_str(), past(v.past).c_str());
    }
  }
  std::printf("|\n");
}

/// What the page says of icat.
bool right(const job::Scenario& s, const Judge::Verdict& v) {
  const bool inside = s.name == "beyond" ? v.inside < 1 : v.past < 1e-6;
  const bool there = s.name == "far" ? v.position > 0.5 : v.position < 1e-3;
  return inside && there && v.step < 1e-3;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string urdf = argv[1], folder = argc > 3 ? argv[3] : "";
  const auto scenarios = job::read(argv[2]);
  Judge judge(urdf);
  std::vector<job::Path> mine;
  bool good = true;
  for (const auto& scenario : scenarios) {
    mine.push_back(job::run(scenario, [&](const auto& s, auto& path) { reach(urdf, s, path); }));
    if (!folder.empty()) job::write(folder + "/icat." + scenario.name, mine.back());
    if (mine.back().refusal.empty() && right(scenario, judge.judge(scenario, mine.back().q))) {
      continue;
    }
    std::fprintf(stderr, "wrong: %s %s\n", scenario.name.c_str(), mine.back().refusal.c_str());
    good = false;
  }
  std::printf(
      "| | goal within reach | the posture weighs as much as the hand | goal out of reach | start "
      "beyond a limit |\n|---|---|---|---|---|\n");
  say(judge, "icat", scenarios, mine);
  for (int i = 4; i < argc; ++i) {
    std::vector<job::Path> paths;
    for (const auto& s : scenarios) {
      paths.push_back(job::load(folder + "/" + argv[i] + "." + s.name));
    }
    say(judge, argv[i], scenarios, paths);
  }
  return good ? 0 : 1;
}
