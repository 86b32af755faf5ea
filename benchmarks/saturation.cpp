// SPDX-License-Identifier: BSD-3-Clause
// The ways of saturation side by side on the same runs: the table of docs/solver.md, printed as
// Markdown. Random hierarchies, and a 7R arm whose tool is to follow random velocities.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <icat/model/kinematic_tree.hpp>
#include <icat/model/maris.hpp>
#include <icat/tpik/tpik.hpp>
#include <random>

#include "hierarchy.hpp"

namespace {

using Hierarchies = std::vector<bench::Hierarchy<double>>;

/// What one way does on one set of hierarchies; over those in which something saturates as
/// published. The tool's level is the first of six rows.
struct Result {
  double error{0};      ///< mean of ‖ẋ̄ − J ẏ‖ / ‖ẋ̄‖ of the tool's level
  double kept{0};       ///< share of the hierarchies where that is below 1 %
  double above{0};      ///< mean error of the first active level
  double disturbed{0};  ///< largest change of the tool's rate by the levels below
  double steps{0};      ///< mean of a hierarchy
  long most_steps{0};
  double time{0};  ///< s for each hierarchy
  int count{0};
};

/// Over active rows.
double rate_error(const bench::Level<double>& level, const Eigen::VectorXd& y) {
  const auto A = level.activation.asDiagonal();
  return (A * (level.reference - level.jacobian * y)).norm() / (A * level.reference).norm();
}

template <int N>
Result run(const Hierarchies& hierarchies, double bound, icat::Saturation saturation) {
  const icat::Vector<double, N> b = icat::Vector<double, N>::Constant(bound);
  icat::Tpik<double, N> published({.bounds = {-b, b}});
  icat::Tpik<double, N> tpik({.bounds = {-b, b}, .saturation = saturation});
  Result r;
  std::vector<const bench::Hierarchy<double>*> saturated;
  for (const auto& h : hierarchies) {
    bench::solve(published, h);
    bool any = false;
    for (const auto& level : published.report().levels()) any |= level.saturated > 0;
    if (!any) continue;
    saturated.push_back(&h);
    tpik.reset();
    Eigen::VectorXd rate;
    const bench::Level<double>*first = nullptr, *tool = nullptr;
    for (const auto& level : h) {
      (void)tpik.add_level(level.jacobian, level.activation, level.reference);
      if (level.activation.sum() == 0) continue;
      if (first == nullptr) first = &level;
      if (tool != nullptr || level.activation.sum() != 6) continue;
      tool = &level;
      rate = level.jacobian * tpik.velocity();
    }
    (void)tpik.minimize_velocity();
    const Eigen::VectorXd y = tpik.velocity();
    r.disturbed = std::max(r.disturbed, (tool->jacobian * y - rate).norm());
    const double error = rate_error(*tool, y);
    r.error += error;
    r.kept += error < 0.01 ? 1 : 0;
    r.above += rate_error(*first, y);
    long steps = 0;
    for (const auto& level : tpik.report().levels()) steps += level.saturation_steps;
    r.steps += static_cast<double>(steps);
    r.most_steps = std::max(r.most_steps, steps);
  }
  r.count = static_cast<int>(saturated.size());
  // The fastest of ten rounds.
  r.time = 1e9;
  for (int round = 0; round < 10; ++round) {
    const auto start = std::chrono::steady_clock::now();
    for (const auto* h : saturated) bench::solve(tpik, *h);
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start;
    r.time = std::min(r.time, spent.count() / r.count);
  }
  r.error /= r.count;
  r.kept /= r.count;
  r.above /= r.count;
  r.steps /= r.count;
  return r;
}

template <int N>
void print(const char* name, const Hierarchies& hierarchies, double bound) {
  constexpr std::pair<icat::Saturation, const char*> ways[] = {
      {icat::Saturation::scale, "`scale`"},
      {icat::Saturation::continuous_scale, "`continuous_scale`"},
      {icat::Saturation::redistribute, "`redistribute`"}};
  const double published = run<N>(hierarchies, bound, icat::Saturation::scale).time;
  for (const auto& [way, text] : ways) {
    const Result r = run<N>(hierarchies, bound, way);
    std::printf("| %s (%d) | %s | %.0e | %.3f | %.0f %% | %.0e | %.1f, %ld | %.2f |\n", name,
                r.count, text, r.above, r.error, 100 * r.kept, r.disturbed, r.steps, r.most_steps,
                r.time / published);
  }
}

/// Random states and tool velocities of the MARIS arm; below the tool a posture.
Hierarchies arm_hierarchies() {
  icat::KinematicTree<double, 7> arm({.joints = icat::axes_chain(icat::maris_arm<double>())});
  const icat::FrameId tool = arm.frame("end_effector");
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> any(-1, 1);
  Hierarchies all;
  for (int k = 0; k < 1000; ++k) {
    Eigen::Matrix<double, 7, 1> q;
    q << 0, 0.7, 0, -1.6, 0, 0.9, 0;
    for (auto& x : q) x += 0.5 * any(generator);
    if (arm.update(q) != icat::Status::ok) continue;
    bench::Level<double> hand{arm.jacobian(tool), Eigen::VectorXd::Ones(6), Eigen::VectorXd(6)};
    for (auto& x : hand.reference) x = 0.2 * any(generator);
    bench::Level<double> posture{Eigen::MatrixXd::Identity(7, 7), Eigen::VectorXd::Ones(7),
                                 Eigen::VectorXd(-0.5 * q)};
    all.push_back({hand, posture});
  }
  return all;
}

}  // namespace

int main() {
  std::printf(
      "| hierarchies (of them at the bounds) | saturation | error of the first level | of the "
      "tool's | kept to 1 %% | disturbed from below | steps: mean, most | time |\n"
      "|---|---|---|---|---|---|---|---|\n");
  Hierarchies random;
  for (unsigned seed = 0; seed < 1000; ++seed) {
    random.push_back(bench::hierarchy<double>(bench::Pattern::steady, seed));
  }
  print<13>("13 DoF, bounds ±2", random, 2);
  print<13>("13 DoF, bounds ±0.8", random, 0.8);
  print<7>("7R arm, bounds ±0.5 rad/s", arm_hierarchies(), 0.5);
}
