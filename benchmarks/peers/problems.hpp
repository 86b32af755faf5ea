// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What problems.py has written, and its measuring, for peers in C++; see there.
#pragma once

#include <dlfcn.h>

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <string>
#include <vector>

namespace peers {

constexpr double dt = 0.01;      // s
constexpr double seconds = 0.4;  // of measuring, for each problem and round
constexpr std::size_t states = 1000;

struct State {
  Eigen::Vector3d base;  // of a free base, which does not turn
  Eigen::VectorXd q, v;
};

struct Problem {
  std::string robot, variant, urdf;
  bool free, com;
  std::vector<std::string> frames, joints;
  Eigen::VectorXd lower, upper, speed;
  std::vector<State> path;  // one more than there are cycles
};

inline Problem read(const std::string& folder, const std::string& robot,
                    const std::string& variant) {
  std::ifstream in(folder + "/" + robot + "." + variant);
  Problem p{robot, variant, {}, {}, {}, {}, {}, {}, {}, {}, {}};
  std::size_t frames = 0, joints = 0;
  in >> p.urdf >> p.free >> p.com >> frames;
  p.frames.resize(frames);
  for (auto& name : p.frames) in >> name;
  in >> joints;
  p.joints.resize(joints);
  for (auto& name : p.joints) in >> name;
  const auto vector = [&](std::size_t size) {
    Eigen::VectorXd values(static_cast<Eigen::Index>(size));
    for (double& value : values) in >> value;
    return values;
  };
  for (auto* limit : {&p.lower, &p.upper, &p.speed}) *limit = vector(joints);
  for (std::size_t k = 0; k <= states; ++k) {
    const Eigen::Vector3d base = vector(3);
    p.path.push_back({base, vector(joints), {}});
  }
  if (!in) throw std::runtime_error("cannot read the problem " + robot + "." + variant);
  for (std::size_t k = 0; k < states; ++k) p.path[k].v = (p.path[k + 1].q - p.path[k].q) / dt;
  p.path[states].v = p.path[states - 1].v;
  return p;
}

/// The counter of allocations.cpp, where that is loaded.
inline auto counter() {
  return reinterpret_cast<long (*)()>(dlsym(RTLD_DEFAULT, "peers_allocations"));
}

inline double quantile(std::vector<double> values, double at) {
  std::sort(values.begin(), values.end());
  const auto i = static_cast<std::size_t>(at * static_cast<double>(values.size()));
  return values[std::min(values.size() - 1, i)];
}

inline double now() {  // µs
  const auto time = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double, std::micro>(time).count();
}

struct Times {
  std::vector<double> values;
  void say(const std::string& name, const Problem& p, const char* part) const {
    std::printf("time\t%s\t%s\t%s\t%s\t%.4g\t%.4g\n", name.c_str(), p.robot.c_str(),
                p.variant.c_str(), part, quantile(values, 0.5), quantile(values, 0.99));
  }
};

/// A peer has `State state(peers::State)`, `model(State)`, `Goal goal(State)`, `target(Goal)`,
/// `solve()` and `velocity()`, of the joints.
template <class Peer>
void measure(const std::string& name, Peer& peer, const Problem& p) {
  std::vector<decltype(peer.state(p.path[0]))> path;
  std::vector<decltype(peer.goal(path[0]))> goals;
  for (const State& state : p.path) path.push_back(peer.state(state));
  for (const auto& state : path) {
    peer.model(state);
    goals.push_back(peer.goal(state));
  }
  goals.erase(goals.begin());
  if (const auto count = counter()) {
    std::vector<double> errors;
    for (std::size_t k = 0; k < states; ++k) {
      peer.target(goals[k]);
      peer.model(path[k]);
      peer.solve();
      errors.push_back((peer.velocity() - p.path[k].v).cwiseAbs().maxCoeff());
    }
    const long before = count();
    for (std::size_t k = 0; k < 100; ++k) {
      peer.target(goals[k]);
      peer.model(path[k]);
      peer.solve();
    }
    std::printf("allocations\t%s\t%s\t%s\t%g\n", name.c_str(), p.robot.c_str(), p.variant.c_str(),
                static_cast<double>(count() - before) / 100);
    std::printf("error\t%s\t%s\t%s\t%.3g\n", name.c_str(), p.robot.c_str(), p.variant.c_str(),
                quantile(errors, 0.5));
    return;
  }
  Times target, model, solve, total;
  const double end = now() + 1e6 * seconds;
  for (std::size_t k = 0; k < states || now() < end; ++k) {
    const auto& goal = goals[k % states];
    const auto& state = path[k % states];
    const double a = now();
    peer.target(goal);
    const double b = now();
    peer.model(state);
    const double c = now();
    peer.solve();
    const double d = now();
    if (k < 100) continue;  // they warm up
    target.values.push_back(b - a);
    model.values.push_back(c - b);
    solve.values.push_back(d - c);
    total.values.push_back(d - a);
  }
  target.say(name, p, "target");
  model.say(name, p, "model");
  solve.say(name, p, "solve");
  total.say(name, p, "total");
}

/// Answers, integrated from `q`.
struct Run {
  std::vector<Eigen::VectorXd> path, answers;
};

template <class Peer, class Goal>
Run loop(Peer& peer, Eigen::VectorXd q, const Goal& goal, double duration) {
  Run run{{q}, {}};
  Eigen::VectorXd v = Eigen::VectorXd::Zero(q.size());
  for (double t = 0; t < duration - dt / 2; t += dt) {
    peer.model(peer.state({Eigen::Vector3d::Zero(), q, v}));
    peer.target(goal);
    peer.solve();
    v = peer.velocity();
    q += dt * v;
    run.answers.push_back(v);
    run.path.push_back(q);
  }
  peer.model(peer.state({Eigen::Vector3d::Zero(), q, v}));
  return run;
}

/// Of the last second: the largest speed, the largest change between two cycles; and how far the
/// limits were passed.
inline std::string outcome(const Problem& p, const Run& run) {
  double speed = 0, jump = 0, past = -1e9;
  for (std::size_t k = run.answers.size() - 100; k < run.answers.size(); ++k) {
    speed = std::max(speed, run.answers[k].cwiseAbs().maxCoeff());
    jump = std::max(jump, (run.answers[k] - run.answers[k - 1]).cwiseAbs().maxCoeff());
  }
  for (const auto& q : run.path) {
    past = std::max({past, (q - p.upper).maxCoeff(), (p.lower - q).maxCoeff()});
  }
  return std::to_string(speed) + "\t" + std::to_string(jump) + "\t" + std::to_string(past);
}

/// What a peer answers on the Panda, as problems.py does it. `make(problem)` builds one; it also
/// has `move(Goal&, frame, by)` and `position(frame)`.
template <class Make>
void answers(const std::string& name, const std::string& folder, const Make& make,
             bool two_frames = true) {
  Problem p = read(folder, "panda", "clear");
  const Eigen::VectorXd start = p.path[0].q;
  const auto attempt = [&](const char* what, const auto& scenario) {
    try {
      auto peer = make(p);
      const auto state = peer->state({Eigen::Vector3d::Zero(), start, 0 * start});
      peer->model(state);
      std::printf("answer\t%s\t%s\t%s\n", name.c_str(), what,
                  scenario(*peer, peer->goal(state)).c_str());
    } catch (const std::exception& error) {
      std::printf("answer\t%s\t%s\traises\t%s\n", name.c_str(), what, error.what());
    }
  };
  attempt("out of reach", [&](auto& peer, auto goal) {
    const Eigen::Vector3d by(1, 0, 0), wanted = peer.position(0) + by;
    peer.move(goal, 0, by);
    const Run run = loop(peer, start, goal, 10);
    return std::to_string((peer.position(0) - wanted).norm()) + "\t" + outcome(p, run);
  });
  attempt("outside limits", [&](auto& peer, auto goal) {
    Eigen::VectorXd q = start;
    q(3) = p.upper(3) + 0.05;
    const Run run = loop(peer, q, goal, 10);
    double inside = 0, speed = 0;
    for (std::size_t k = 0; k < run.path.size(); ++k) {
      if (run.path[k](3) > p.upper(3) + 1e-6) inside = dt * static_cast<double>(k + 1);
    }
    for (const auto& v : run.answers) speed = std::max(speed, v.cwiseAbs().maxCoeff());
    return std::to_string(run.answers[0](3)) + "\t" + std::to_string(inside) + "\t" +
           std::to_string(speed);
  });
  if (!two_frames) return;
  p.frames = {"panda_hand", "panda_link8"};
  attempt("conflict", [&](auto& peer, auto goal) {
    const Eigen::Vector3d by(0, 0.2, 0), first = peer.position(0), second = peer.position(1) + by;
    peer.move(goal, 1, by);
    const Run run = loop(peer, start, goal, 10);
    return std::to_string((peer.position(0) - first).norm()) + "\t" +
           std::to_string((peer.position(1) - second).norm()) + "\t" + outcome(p, run);
  });
}

inline const char* const robots[] = {"panda", "tiago", "talos"};
inline const char* const variants[] = {"clear", "limit"};

}  // namespace peers
