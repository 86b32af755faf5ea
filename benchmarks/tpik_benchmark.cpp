// SPDX-License-Identifier: BSD-3-Clause
// The solver against the yardstick Y, Eigen's HouseholderQR of a 28 × 13 dynamic matrix, in one
// run. Beside the JSON of Google Benchmark it writes a Markdown table and data for a chart into
// the folder that $ICAT_BENCHMARK_DIR names.
#include <benchmark/benchmark.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <icat/icat.hpp>
#include <iterator>
#include <map>
#include <string>

#include "hierarchy.hpp"

namespace {

using bench::Pattern;

void yardstick(benchmark::State& state) {
  const Eigen::MatrixXd m = Eigen::MatrixXd::Random(28, 13);
  Eigen::HouseholderQR<Eigen::MatrixXd> qr(28, 13);
  for (auto _ : state) benchmark::DoNotOptimize(qr.compute(m).matrixQR().data());
}

/// Five hierarchies in turn, so that no branch predictor knows them by heart; reported per solve.
template <class Scalar, int N>
void tpik(benchmark::State& state, Pattern pattern, int dof) {
  auto solver = [&] {
    if constexpr (N == Eigen::Dynamic) return icat::Tpik<Scalar>(dof);
    if constexpr (N != Eigen::Dynamic) return icat::Tpik<Scalar, N>();
  }();
  std::vector<bench::Hierarchy<Scalar>> hierarchies;
  for (unsigned seed = 0; seed < 5; ++seed) {
    hierarchies.push_back(bench::hierarchy<Scalar>(pattern, seed, dof));
  }
  std::size_t i = 0;
  for (auto _ : state) {
    bench::solve(solver, hierarchies[i++ % 5]);
    benchmark::DoNotOptimize(solver.velocity().data());
  }
}

struct Limits {
  const char* name;
  int count;
  double activation;
};
constexpr Limits limits[] = {{"none", 0, 0},
                             {"one at 0.4", 1, 0.4},
                             {"one at 0.03", 1, 0.03},
                             {"one at 0.97", 1, 0.97},
                             {"six at 0.4", 6, 0.4}};

void humanoid(benchmark::State& state, Limits active) {
  icat::Tpik<double> solver(38);
  std::vector<bench::Hierarchy<double>> hierarchies;
  for (unsigned seed = 0; seed < 5; ++seed) {
    hierarchies.push_back(bench::humanoid(seed, active.count, active.activation));
  }
  std::size_t i = 0;
  for (auto _ : state) {
    bench::solve(solver, hierarchies[i++ % 5]);
    benchmark::DoNotOptimize(solver.velocity().data());
  }
}

/// What is written by hand beside Eigen's own: f(S) of a 6 × 6 matrix with two eigenvalues below
/// the threshold, the product of two 13 × 13 matrices, a 6 × 6 positive definite solve.
struct ByHand {
  static constexpr int n = 13;
  Eigen::MatrixXd a = Eigen::MatrixXd::Random(n, n), b = Eigen::MatrixXd::Random(n, n);
  Eigen::Matrix<double, 6, 6> s;
  icat::BellRegularization<double> f;
  std::vector<double> memory = std::vector<double>(4000);
  icat::detail::PanelMemory<double> panels{memory.data(), n};
  icat::detail::Panel<double> pa = panels.take(n), pb = panels.take(n), pc = panels.take(n);

  ByHand() {
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(a.topLeftCorner(6, 6));
    const Eigen::Matrix<double, 6, 6> q = qr.householderQ();
    const icat::Vector<double, 6> values(1e-3, 5e-3, 0.3, 1, 2, 4);
    s = q * values.asDiagonal() * q.transpose();
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) pa(i, j) = a(i, j), pb(i, j) = b(i, j);
    }
  }
};

void spectral_by_hand(benchmark::State& state) {
  ByHand h;
  icat::detail::SpectralInverse<double> spectral;
  spectral.bind(6, h.panels);
  for (auto _ : state) {
    for (int j = 0; j < 6; ++j) std::copy_n(h.s.data() + 6 * j, 6, h.pa[j]);
    benchmark::DoNotOptimize(spectral.compute(h.pa, 6, h.pb, h.f));
  }
}
void spectral_by_eigen(benchmark::State& state) {
  ByHand h;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> solver;
  for (auto _ : state) {
    solver.compute(h.s);
    icat::Vector<double, 6> values = solver.eigenvalues();
    for (double& x : values) x = h.f.inverse(x);
    const Eigen::Matrix<double, 6, 6> inverse =
        solver.eigenvectors() * values.asDiagonal() * solver.eigenvectors().transpose();
    benchmark::DoNotOptimize(inverse.data());
  }
}
void product_by_hand(benchmark::State& state) {
  ByHand h;
  for (auto _ : state) {
    icat::detail::product(icat::detail::Into::set, 13, 13, 13, h.pa, h.pb, h.pc);
    benchmark::DoNotOptimize(h.pc.data);
    benchmark::ClobberMemory();
  }
}
void product_by_eigen(benchmark::State& state) {
  ByHand h;
  Eigen::MatrixXd c(13, 13);
  for (auto _ : state) {
    c.noalias() = h.a * h.b;
    benchmark::DoNotOptimize(c.data());
    benchmark::ClobberMemory();
  }
}
void cholesky_by_hand(benchmark::State& state) {
  ByHand h;
  icat::detail::Cholesky<double, 6> cholesky;
  for (auto _ : state) {
    icat::Vector<double, 6> x = h.s.col(0);
    benchmark::DoNotOptimize(cholesky.compute(h.s));
    cholesky.solve(x);
    benchmark::DoNotOptimize(x.data());
  }
}
void cholesky_by_eigen(benchmark::State& state) {
  ByHand h;
  Eigen::LLT<Eigen::Matrix<double, 6, 6>> cholesky;
  for (auto _ : state) {
    icat::Vector<double, 6> x = h.s.col(0);
    cholesky.compute(h.s);
    cholesky.solveInPlace(x);
    benchmark::DoNotOptimize(x.data());
  }
}

void inactive_level(benchmark::State& state) {
  const Eigen::MatrixXd jacobian = Eigen::MatrixXd::Random(6, 13);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(6), reference = Eigen::VectorXd::Ones(6);
  icat::Tpik<double, 13> solver;
  for (auto _ : state) {
    solver.reset();
    for (int i = 0; i < 10; ++i) {
      benchmark::DoNotOptimize(solver.add_level(jacobian, zero, reference));
    }
  }
}

void arm_law_evaluated(benchmark::State& state) {
  icat::ParametricTpik<double, 7> law;
  bench::solve(law, bench::hierarchy<double>(Pattern::steady, 0));
  icat::Vector6<double> v = icat::Vector6<double>::Constant(0.1);
  for (auto _ : state) {
    benchmark::DoNotOptimize(v.data());
    benchmark::DoNotOptimize(law.evaluate(v));
  }
}

struct Pair {
  const char* name;
  void (*by_hand)(benchmark::State&);
  void (*by_eigen)(benchmark::State&);
};
constexpr Pair pairs[] = {
    {"f(S), 6 × 6, against SelfAdjointEigenSolver", spectral_by_hand, spectral_by_eigen},
    {"a product, 13 × 13, against Eigen's", product_by_hand, product_by_eigen},
    {"Cholesky factor and solution, 6 × 6, against LLT", cholesky_by_hand, cholesky_by_eigen}};

constexpr int sizes[] = {7, 13, 20, 26, 32, 64};

void add_all() {
  const std::pair<const char*, Pattern> patterns[] = {{"steady", Pattern::steady},
                                                      {"one partial", Pattern::one_partial},
                                                      {"transition", Pattern::transition},
                                                      {"all partial", Pattern::all_partial},
                                                      {"onset", Pattern::onset}};
  benchmark::RegisterBenchmark("Y", yardstick);
  for (const auto& [name, pattern] : patterns) {
    const std::string n = name;
    const Pattern p = pattern;
    const auto add = [&](const std::string& kind, auto function) {
      benchmark::RegisterBenchmark((n + "/" + kind).c_str(),
                                   [=](benchmark::State& s) { function(s, p, 13); });
    };
    add("static", tpik<double, 13>);
    add("dynamic", tpik<double, Eigen::Dynamic>);
    add("float", tpik<float, 13>);
  }
  for (const Limits& l : limits) {
    benchmark::RegisterBenchmark((std::string("humanoid/") + l.name).c_str(),
                                 [=](benchmark::State& s) { humanoid(s, l); });
  }
  for (const Pair& p : pairs) {
    benchmark::RegisterBenchmark((std::string("by hand/") + p.name).c_str(), p.by_hand);
    benchmark::RegisterBenchmark((std::string("by Eigen/") + p.name).c_str(), p.by_eigen);
  }
  benchmark::RegisterBenchmark("inactive level", inactive_level);
  benchmark::RegisterBenchmark("arm law evaluated", arm_law_evaluated);
  for (const int dof : sizes) {
    benchmark::RegisterBenchmark(
        ("growth/" + std::to_string(dof)).c_str(),
        [=](benchmark::State& s) { tpik<double, Eigen::Dynamic>(s, Pattern::all_partial, dof); });
  }
}

/// Keeps the fastest repetition of each benchmark: what disturbs a run only adds to it.
class Fastest : public benchmark::ConsoleReporter {
 public:
  std::map<std::string, double> ns;

  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration) continue;
      const std::string name = run.run_name.function_name;
      const double t = 1e9 * run.real_accumulated_time / static_cast<double>(run.iterations);
      ns[name] = ns.count(name) ? std::min(ns[name], t) : t;
    }
    std::vector<Run> medians;
    for (const Run& run : runs) {
      if (run.aggregate_name == "median" || run.repetitions == 1) medians.push_back(run);
    }
    if (!medians.empty()) ConsoleReporter::ReportRuns(medians);
  }
};

void write(std::map<std::string, double>& ns, const std::string& dir) {
  const double y = ns["Y"];
  std::ofstream table(dir + "/solver.md");
  const auto row = [&](const std::string& what, const std::string& target, double value,
                       double limit, const std::string& unit, int digits) {
    char measured[64];
    std::snprintf(measured, sizeof measured, "%.*f%s", digits, value, unit.c_str());
    table << "| " << what << " | " << target << " | " << measured << " | "
          << (value <= limit ? "yes" : "**no**") << " |\n";
  };
  row("steady, static size", "≤ 0.9 Y", ns["steady/static"] / y, 0.9, " Y", 2);
  row("one row at 0.4", "≤ 1.2 Y", ns["one partial/static"] / y, 1.2, " Y", 2);
  row("transition", "≤ 1.8 Y", ns["transition/static"] / y, 1.8, " Y", 2);
  row("onset", "≤ 6 Y", ns["onset/static"] / y, 6, " Y", 2);
  row("all partial", "≤ 8 Y", ns["all partial/static"] / y, 8, " Y", 2);
  const double none = ns["humanoid/none"];
  row("38 DoF, no limit active", "–", none / y, 1e9, " Y", 2);
  const double most[] = {0, 1.25, 2, 2, 1.6};
  for (std::size_t i = 1; i < std::size(limits); ++i) {
    char target[32];
    std::snprintf(target, sizeof target, "≤ %.2f ×", most[i]);
    row(std::string("38 DoF, limits: ") + limits[i].name + ", against none", target,
        ns[std::string("humanoid/") + limits[i].name] / none, most[i], " ×", 2);
  }
  double dynamic = 0, single = 0;
  for (const char* p : {"steady", "one partial", "transition", "all partial", "onset"}) {
    const std::string n = p;
    dynamic = std::max(dynamic, ns[n + "/dynamic"] / ns[n + "/static"]);
    single = std::max(single, ns[n + "/float"] / ns[n + "/static"]);
  }
  row("dynamic size, the worst pattern", "≤ 1.1 × static", dynamic, 1.1, " ×", 2);
  row("float, the worst pattern", "< 1 × double", single, 1, " ×", 2);
  row("a fully inactive level, 6 rows", "≤ 50 ns", ns["inactive level"] / 10, 50, " ns", 0);
  row("arm law `ρ̃ + P v`, evaluated", "≤ 100 ns", ns["arm law evaluated"], 100, " ns", 0);

  // Least squares of log t over log n.
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  std::ofstream growth(dir + "/growth.dat");
  for (const int dof : sizes) {
    const double t = ns["growth/" + std::to_string(dof)];
    growth << dof << ' ' << t / 1000 << '\n';
    const double lx = std::log(dof), ly = std::log(t);
    n += 1, sx += lx, sy += ly, sxx += lx * lx, sxy += lx * ly;
  }
  row("growth, 7 to 64 DoF, all partial: exponent", "≤ 3",
      (n * sxy - sx * sy) / (n * sxx - sx * sx), 3, "", 2);
  std::ofstream bars(dir + "/patterns.dat");
  for (const Pair& p : pairs) {
    row(std::string("written by hand: ") + p.name, "< 1 ×",
        ns[std::string("by hand/") + p.name] / ns[std::string("by Eigen/") + p.name], 1, " ×", 2);
  }
  for (const char* p : {"steady", "one partial", "transition", "all partial", "onset"}) {
    const std::string s = p;
    bars << '"' << p << "\" " << ns[s + "/static"] / y << ' ' << ns[s + "/dynamic"] / y << ' '
         << ns[s + "/float"] / y << '\n';
  }
  std::ofstream(dir + "/Y.md") << "Y = " << std::round(y / 10) / 100 << " µs\n";
}

}  // namespace

int main(int argc, char** argv) {
  add_all();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  Fastest reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  if (const char* dir = std::getenv("ICAT_BENCHMARK_DIR")) write(reporter.ns, dir);
}
