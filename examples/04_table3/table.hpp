// SPDX-License-Identifier: BSD-3-Clause
// All rows, each in its own thread, and what must hold between them as in the paper.
#pragma once

#include <atomic>
#include <ctime>
#include <numeric>
#include <thread>

#include "simulation.hpp"

namespace table3 {

struct Table {
  std::vector<Result> results;    ///< as `rows`
  std::vector<double> real_time;  ///< how much faster than real time each row ran on its core
  const Result& operator[](int t) const {
    return results[static_cast<std::size_t>(t - 1)];
  }  ///< T1 …
};

/// Processor time of the calling thread, s.
inline double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// The first `count` rows. `watch(share)` is called from the calling thread while they run.
template <class Watch>
Table run_all(const Parameters& p, std::size_t count, Watch watch) {
  Table table;
  table.results.resize(count);
  table.real_time.resize(count);
  std::vector<std::atomic<double>> progress(count);
  std::atomic<std::size_t> finished{0};
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < count; ++i) {
    threads.emplace_back([&, i] {
      const double begin = thread_seconds();
      table.results[i] = run(rows[i], p, [&](double t) { progress[i] = t / p.duration; });
      table.real_time[i] = table.results[i].end / (thread_seconds() - begin);
      progress[i] = 1;
      ++finished;
    });
  }
  while (finished < count) {
    double sum = 0;
    for (const auto& share : progress) sum += share;
    watch(sum / static_cast<double>(count));
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  for (auto& thread : threads) thread.join();
  return table;
}

struct Relation {
  const char* text;
  bool holds;
};

/// What the paper's table says about itself.
inline std::vector<Relation> relations(const Table& t) {
  const auto F = [&](int i) { return t[i].force.mean; };
  const auto X = [&](int i) { return t[i].force.max; };
  const auto M = [&](int i) { return t[i].moment.mean; };
  bool complete = true, largest = true;
  for (int i = 2; i <= 11; ++i) complete = complete && !t[i].aborted && t[i].final_error < 0.05;
  for (const int i : {4, 5, 7, 8, 9, 10, 11}) largest = largest && X(i) < X(6);
  return {{"T1 aborts at the force limit", t[1].aborted && t[1].status == icat::Status::ok},
          {"T2 ... T11 complete, final error < 0.05 m", complete},
          {"F mean: T2 > T3", F(2) > F(3)},
          {"F mean: T3 > 3 T4", F(3) > 3 * F(4)},
          {"F mean: T5 > T4", F(5) > F(4)},
          {"F mean: T6 > 2 T5", F(6) > 2 * F(5)},
          {"F mean: T7 < T2/3", F(7) < F(2) / 3},
          {"F mean: T8 < T4", F(8) < F(4)},
          {"F mean: T9 < T5", F(9) < F(5)},
          {"F mean: T10 < T6/2", F(10) < F(6) / 2},
          {"F mean: T10 > T9", F(10) > F(9)},
          {"F max: T6 largest of T4 ... T11", largest},
          {"F max: T11 > T10", X(11) > X(10)},
          {"M mean: T2 > T3", M(2) > M(3)},
          {"M mean: T3 > T4", M(3) > M(4)},
          {"M mean: T8 < T4", M(8) < M(4)},
          {"M mean: T9 < T5", M(9) < M(5)},
          {"M mean: T10 < T6", M(10) < M(6)}};
}

/// Spearman's rank correlation; no ties.
inline double spearman(const std::vector<double>& a, const std::vector<double>& b) {
  const auto ranks = [](const std::vector<double>& v) {
    std::vector<double> r;
    for (const double x : v) {
      r.push_back(
          static_cast<double>(std::count_if(v.begin(), v.end(), [&](double y) { return y < x; })));
    }
    return r;
  };
  const auto ra = ranks(a), rb = ranks(b);
  double sum = 0;
  for (std::size_t i = 0; i < ra.size(); ++i) sum += (ra[i] - rb[i]) * (ra[i] - rb[i]);
  const double n = static_cast<double>(a.size());
  return 1 - 6 * sum / (n * (n * n - 1));
}

struct Correlations {
  double force_mean, force_max, moment_mean;
};

/// With the paper, over T2 … T11.
inline Correlations correlations(const Table& t) {
  std::vector<double> f, x, m, pf, px, pm;
  for (int i = 2; i <= 11; ++i) {
    const Published& p = published[static_cast<std::size_t>(i - 1)];
    f.push_back(t[i].force.mean);
    x.push_back(t[i].force.max);
    m.push_back(t[i].moment.mean);
    pf.push_back(p.force_mean);
    px.push_back(p.force_max);
    pm.push_back(p.moment_mean);
  }
  return {spearman(f, pf), spearman(x, px), spearman(m, pm)};
}

}  // namespace table3
