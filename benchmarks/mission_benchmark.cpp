// SPDX-License-Identifier: BSD-3-Clause
// The solver and the whole control cycle on the recorded mission of examples/01_grasp: percentiles,
// and the throughput of independent robots over all cores. Writes rows of a Markdown table into the
// folder that $ICAT_BENCHMARK_DIR names.
#include <Eigen/QR>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "../examples/01_grasp/mission.hpp"
#include "hierarchy.hpp"

namespace {

using Clock = std::chrono::steady_clock;

double us_since(Clock::time_point start) {
  return std::chrono::duration<double, std::micro>(Clock::now() - start).count();
}

double percentile(std::vector<double>& sorted, double p) {
  return sorted[static_cast<std::size_t>(p * static_cast<double>(sorted.size() - 1))];
}

/// Fastest of many: what disturbs a measurement only adds to it.
double yardstick() {
  const Eigen::MatrixXd m = Eigen::MatrixXd::Random(28, 13);
  Eigen::HouseholderQR<Eigen::MatrixXd> qr(28, 13);
  double best = 1e9, sink = 0;
  for (int i = 0; i < 300; ++i) {
    const auto start = Clock::now();
    for (int k = 0; k < 100; ++k) sink += qr.compute(m).matrixQR()(0, 0);
    best = std::min(best, us_since(start) / 100);
  }
  return sink == 1 ? 0 : best;
}

}  // namespace

int main() {
  const char* dir = std::getenv("ICAT_BENCHMARK_DIR");
  std::ofstream table(std::string(dir ? dir : ".") + "/mission.md");

  // Every cycle of the variant with both TPIKs: its hierarchy, and the cycle run once more.
  std::vector<bench::Hierarchy<double>> recorded;
  std::vector<double> cycle;
  grasp::run({.current = true, .compensation = true}, 0.01, [&](const grasp::Cycle& now) {
    bench::Hierarchy<double> levels;
    std::size_t i = 0;
    for (const auto& level : now.controller.first().hierarchy()) {
      for (const auto& entry : level) {
        const double phase = now.controller.first().phase_activations()[i++];
        levels.push_back(
            {entry.task->jacobian(), phase * entry.task->activation(), entry.task->reference()});
      }
    }
    recorded.push_back(std::move(levels));
    const icat::Vector<double, 7> q = now.robot.q();
    const grasp::Pose vehicle = now.robot.pose(now.robot.base());
    const auto start = Clock::now();
    (void)now.robot.update(q, vehicle);
    (void)now.controller.step(now.t, now.vehicle_velocity);
    cycle.push_back(us_since(start));
  });

  constexpr int solves = 100'000;
  icat::Tpik<double, 13> tpik;
  std::vector<double> time;
  time.reserve(solves);
  for (int i = 0; i < solves; ++i) {
    const auto start = Clock::now();
    bench::solve(tpik, recorded[static_cast<std::size_t>(i) % recorded.size()]);
    time.push_back(us_since(start));
  }
  const double y = yardstick();
  std::sort(time.begin(), time.end());
  std::sort(cycle.begin(), cycle.end());

  // Robots side by side: each thread has its own solver.
  const unsigned threads = std::max(1u, std::thread::hardware_concurrency());
  const auto run = [&] {
    icat::Tpik<double, 13> own;
    for (int i = 0; i < solves; ++i) {
      bench::solve(own, recorded[static_cast<std::size_t>(i) % recorded.size()]);
    }
  };
  const auto start = Clock::now();
  std::vector<std::thread> workers;
  for (unsigned i = 0; i < threads; ++i) workers.emplace_back(run);
  for (auto& worker : workers) worker.join();
  const double throughput = threads * double(solves) / us_since(start);

  char line[256];
  const auto emit = [&] {
    std::fputs(line, stdout);
    table << line;
  };
  const double median = percentile(cycle, 0.5);
  std::snprintf(line, sizeof line,
                "| one control cycle (state update, tasks, TPIK 1 and 2), median of the mission | "
                "≤ 5 Y | %.2f Y (%.1f µs) | %s |\n",
                median / y, median, median <= 5 * y ? "yes" : "**no**");
  emit();
  // Half of what the solver took before, 31.8 µs at Y = 2.94 µs.
  std::snprintf(
      line, sizeof line,
      "| 100,000 solves of the recorded mission: p50, p99, maximum | p99 ≤ 5.4 Y | %.1f, %.1f, "
      "%.1f µs (p99: %.2f Y) | %s |\n",
      percentile(time, 0.5), percentile(time, 0.99), time.back(), percentile(time, 0.99) / y,
      percentile(time, 0.99) <= 5.4 * y ? "yes" : "**no**");
  emit();
  std::snprintf(
      line, sizeof line,
      "| throughput, %u independent robots on %u cores | – | %.2f million solves/s | – |\n",
      threads, threads, throughput);
  emit();
}
