// SPDX-License-Identifier: BSD-3-Clause
// Runs all rows, each in its own thread, and tests the paper's relations between them.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdio>
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

/// The first `count` rows. `watch(share)` is called from the calling thread while they run,
/// `record(row, cycle)` from the thread of the row.
template <class Watch>
Table run_all(const Parameters& p, std::size_t count, Watch watch,
              const std::function<void(std::size_t, const Cycle&)>& record = {}) {
  Table table;
  table.results.resize(count);
  table.real_time.resize(count);
  std::vector<std::atomic<double>> progress(count);
  std::atomic<std::size_t> finished{0};
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < count; ++i) {
    threads.emplace_back([&, i] {
      double begin = thread_seconds();
      table.results[i] = run(rows[i], p, [&](const Cycle& now) {
        progress[i] = now.sample.t / (p.duration + p.deployment);
        const double before = thread_seconds();
        if (record) record(i, now);
        begin += thread_seconds() - before;  // no part of what the row cost
      });
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

/// One number of a row.
enum class Quantity { force_max, force_mean, moment_max, moment_mean };
inline constexpr std::array<const char*, 4> quantity_names{"F max", "F mean", "M max", "M mean"};

/// Of T1 … T11, as the paper prints it.
inline double printed(Quantity q, int t) {
  const Published& p = published[static_cast<std::size_t>(t - 1)];
  return std::array{p.force_max, p.force_mean, p.moment_max,
                    p.moment_mean}[static_cast<std::size_t>(q)];
}
/// As simulated.
inline double simulated(const Table& table, Quantity q, int t) {
  const Part& p = table[t].transport;
  return std::array{p.force.max, p.force.mean, p.moment.max,
                    p.moment.mean}[static_cast<std::size_t>(q)];
}

/// A relation that the paper states or shows: both sides, there and here.
struct Relation {
  std::string text, paper, ours;
  bool holds, holds_in_print;
};

/// `greater` > `factor` · `smaller`.
struct Comparison {
  Quantity quantity;
  int greater, smaller;
  double factor = 1;
};

/// [Coop, V-B]: the text, and where it gives no number how clearly the table shows it.
inline std::vector<Comparison> comparisons() {
  constexpr Quantity F = Quantity::force_mean, X = Quantity::force_max, M = Quantity::moment_mean;
  std::vector<Comparison> all{
      // Communication reduces the mean and the largest forces significantly, the filter far more.
      {F, 2, 3},
      {X, 2, 3},
      {M, 2, 3},
      {F, 3, 4, 3},
      {M, 3, 4, 3},
      // Latency costs, half duplex more, but less than no communication at all.
      {F, 5, 4},
      {F, 6, 5, 2},
      {M, 6, 5, 2},
      {F, 2, 6},
      {M, 2, 6},
      // The force modification helps in every scheme, and so does communication beside it.
      {F, 2, 7, 3},
      {F, 4, 8},
      {F, 5, 9},
      {F, 6, 10, 2},
      {M, 2, 7},
      {M, 4, 8},
      {M, 5, 9},
      {M, 6, 10},
      {F, 7, 8},
      {F, 7, 9},
      {F, 10, 9},
      // Rare feedback costs.
      {X, 11, 10},
      {F, 11, 10}};
  for (const int t : {4, 5, 7, 8, 9, 10, 11}) all.push_back({X, 6, t});
  return all;
}

inline std::string number(double x) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f", x);
  return text.data();
}

inline std::vector<Relation> relations(const Table& t) {
  bool complete = true;
  double largest_error = 0, largest_published = 0;
  for (int i = 2; i <= 11; ++i) {
    complete = complete && !t[i].aborted;
    largest_error = std::max(largest_error, t[i].transport.final_error);
    largest_published = std::max(largest_published, published[std::size_t(i - 1)].final_error);
  }
  std::vector<Relation> all{
      {"T1 aborts at the force limit", "aborts", "F max " + number(t[1].transport.force.max),
       t[1].aborted && t[1].status == icat::Status::ok, true},
      {"T2 ... T11 complete, final error < 0.05 m", number(largest_published) + " m",
       number(largest_error) + " m", complete && largest_error < 0.05, largest_published < 0.05}};
  for (const auto& [q, greater, smaller, factor] : comparisons()) {
    const double a = simulated(t, q, greater), b = simulated(t, q, smaller);
    const double pa = printed(q, greater), pb = printed(q, smaller);
    std::string text = quantity_names[static_cast<std::size_t>(q)];
    text += ": T" + std::to_string(greater) + " > ";
    if (factor > 1) text += std::to_string(static_cast<int>(factor)) + " ";
    text += "T" + std::to_string(smaller);
    all.push_back({text, number(pa) + ", " + number(pb), number(a) + ", " + number(b),
                   a > factor * b, pa > factor * pb});
  }
  // "Evident mainly in terms of the maximum values of the interaction forces."
  const auto ratio = [](auto of, Quantity q) { return of(q, 11) / of(q, 10); };
  const auto ours = [&](Quantity q, int i) { return simulated(t, q, i); };
  const double x = ratio(ours, Quantity::force_max), f = ratio(ours, Quantity::force_mean);
  const double px = ratio(printed, Quantity::force_max), pf = ratio(printed, Quantity::force_mean);
  all.push_back({"T11 / T10: more in F max than in F mean", number(px) + ", " + number(pf),
                 number(x) + ", " + number(f), x > f, px > pf});
  return all;
}

/// How far the table is from the paper's: the mean over T2 … T11 of |log10(here / there)|, of F
/// mean, F max and M mean. 0.3 is a factor of two.
inline double distance_from_paper(const Table& t) {
  double sum = 0;
  int count = 0;
  for (const Quantity q : {Quantity::force_mean, Quantity::force_max, Quantity::moment_mean}) {
    for (int i = 2; i <= 11; ++i, ++count) {
      sum += std::abs(std::log10(simulated(t, q, i) / printed(q, i)));
    }
  }
  return sum / count;
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

/// Rank correlation with the paper over T2 … T11.
inline double correlation(const Table& t, Quantity q) {
  std::vector<double> ours, theirs;
  for (int i = 2; i <= 11; ++i) {
    ours.push_back(simulated(t, q, i));
    theirs.push_back(printed(q, i));
  }
  return spearman(ours, theirs);
}

}  // namespace table3
