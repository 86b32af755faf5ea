// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The scenarios for programs in C++: what job.py does for those in Python.
#pragma once

#include <Eigen/Dense>
#include <exception>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace job {

constexpr double dt = 0.01;  // s
constexpr int steps = 1000;

struct Scenario {
  std::string name;
  Eigen::Vector3d by;  // m, from where the hand is
  double cost;         // of the posture, where costs count
  Eigen::VectorXd q;   // start, rad
};

inline std::vector<Scenario> read(const std::string& file) {
  std::vector<Scenario> scenarios;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("#")) continue;
    std::istringstream words(line);
    Scenario s{{}, {}, 0, Eigen::VectorXd(7)};
    words >> s.name;
    for (double& x : s.by) words >> x;
    words >> s.cost;
    for (double& x : s.q) words >> x;
    if (!words) throw std::runtime_error("not a scenario: " + line);
    scenarios.push_back(s);
  }
  if (scenarios.empty()) throw std::runtime_error("no scenarios in " + file);
  return scenarios;
}

struct Path {
  std::string refusal;  // what was thrown
  std::vector<Eigen::VectorXd> q;
};

/// `reach(scenario, path)` does the job and appends each q to `path`.
template <class Reach>
Path run(const Scenario& scenario, const Reach& reach) {
  Path path;
  try {
    reach(scenario, path.q);
  } catch (const std::exception& error) {
    path.refusal = error.what();
  }
  return path;
}

inline void write(const std::string& file, const Path& path) {
  std::ofstream out(file);
  out.precision(17);
  out << path.refusal << "\n";
  for (const auto& q : path.q) out << q.head<7>().transpose() << "\n";
}

/// Without a line: the file is not there, so the program of the peer did not come to its end.
inline Path load(const std::string& file) {
  Path path;
  std::ifstream in(file);
  if (!std::getline(in, path.refusal)) throw std::runtime_error("cannot read " + file);
  Eigen::VectorXd q(7);
  while (in >> q(0) >> q(1) >> q(2) >> q(3) >> q(4) >> q(5) >> q(6)) path.q.push_back(q);
  return path;
}

}  // namespace job
