// SPDX-License-Identifier: BSD-3-Clause
// On the host: compares what the targets printed with what the host computed, prints a table, and
// fails where a target is wrong. Writes the velocities of the control cycles for plot.gp.
//
//     compare <cycles.csv> <host> <host without packets> <host in double> {<processor> <target>}...
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace {

// Of a velocity, in rad/s and m/s. The solver divides by eigenvalues down to its threshold
// σ_t = 0.01 twice, for C and for z (docs/solver.md), so that a rounding of ε = 1.2e-7 may appear
// ε/σ_t² = 1.2e-3 large in a velocity of 1; the bounds of the example are 0.5 and 0.4. The order of
// the additions, which the width of the packets decides, and the C library's sine, cosine and
// hypotenuse differ in roundings. The table shows next to it what float loses against double on
// the host itself.
constexpr double tolerance = 1e-3;

// SysTick counts in steps of 40 instructions, and reading it takes some.
constexpr double counting_tolerance = 1e-3;

struct Run {
  using Velocities = std::vector<std::array<std::uint32_t, 13>>;
  std::map<std::string, Velocities> velocities;  ///< by "solve" and "cycle"
  std::map<std::string, std::uint32_t> figures;
  bool guarded = false;
};

[[noreturn]] void fail(const std::string& text) {
  std::fprintf(stderr, "error: %s\n", text.c_str());
  std::exit(1);
}

Run read(const std::string& file) {
  Run run;
  std::ifstream lines(file);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string kind, name;
    words >> kind >> name;
    if (kind == "solve" || kind == "cycle") {
      auto& velocities = run.velocities[kind];
      if (name != std::to_string(velocities.size())) fail(file + ": a line is missing: " + line);
      auto& velocity = velocities.emplace_back();
      for (auto& x : velocity) words >> std::hex >> x;
    } else if (kind == "figure") {
      words >> run.figures[name];
    } else if (kind == "guard") {
      run.guarded = true;
    } else {
      fail(file + ": " + line);
    }
    if (!words) fail(file + ": " + line);
  }
  return run;
}

double number(std::uint32_t bits) { return static_cast<double>(std::bit_cast<float>(bits)); }

/// A line for each control cycle: t, the host's 13 velocities, then those of each target.
void write_cycles(const std::string& file, const std::vector<Run>& runs) {
  std::ofstream csv(file);
  for (std::size_t i = 0; i < runs[0].velocities.at("cycle").size(); ++i) {
    csv << 0.01 * static_cast<double>(i);
    for (const Run& run : runs) {
      for (const std::uint32_t x : run.velocities.at("cycle").at(i)) csv << "," << number(x);
    }
    csv << "\n";
  }
  if (!csv) fail("cannot write " + file);
}

/// Of two runs, in solves or cycles.
struct Difference {
  double largest = 0;
  std::size_t count = 0, equal = 0;  ///< equal: in every bit
};
Difference compare(const Run& run, const Run& reference, const char* kind) {
  const auto& a = run.velocities.at(kind);
  const auto& b = reference.velocities.at(kind);
  if (a.size() != b.size()) fail(std::string("not as many lines of ") + kind);
  Difference difference;
  difference.count = a.size();
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference.equal += a[i] == b[i];
    for (std::size_t j = 0; j < a[i].size(); ++j) {
      const double d = std::abs(number(a[i][j]) - number(b[i][j]));
      if (!std::isfinite(d)) fail("a velocity that is not finite");
      difference.largest = std::max(difference.largest, d);
    }
  }
  return difference;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 7 || argc % 2 == 0) fail("wrong arguments");
  const Run host = read(argv[2]), no_packets = read(argv[3]), in_double = read(argv[4]);
  std::vector<Run> shown{host};

  std::printf(
      "| processor | flash, bytes | of it the recorded hierarchies | static memory | arena | of it "
      "one `Tpik<float, 13>` | highest stack | instructions per solve: median, maximum | per "
      "control cycle: median, maximum | largest difference to the host: solves, cycles | solves "
      "equal in every bit |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n");
  bool good = true;
  for (int i = 5; i + 1 < argc; i += 2) {
    const std::string name = argv[i];
    const Run target = read(argv[i + 1]);
    shown.push_back(target);
    const auto figure = [&](const char* what) {
      const auto found = target.figures.find(what);
      if (found == target.figures.end()) fail(name + " did not print its " + what);
      return found->second;
    };
    const Difference solves = compare(target, host, "solve"),
                     cycles = compare(target, host, "cycle"),
                     bits = compare(target, no_packets, "solve");
    std::printf(
        "| %s | %u | %u | %u | %u | %u | %u | %u, %u | %u, %u | %.1e, %.1e | %zu of %zu |\n",
        name.c_str(), figure("flash"), figure("recorded"), figure("static"), figure("arena"),
        figure("solver"), figure("stack"), figure("solve_median"), figure("solve_maximum"),
        figure("cycle_median"), figure("cycle_maximum"), solves.largest, cycles.largest, bits.equal,
        bits.count);
    const auto check = [&](bool holds, const char* what) {
      if (holds) return;
      std::fprintf(stderr, "error: %s: %s\n", name.c_str(), what);
      good = false;
    };
    check(solves.largest <= tolerance && cycles.largest <= tolerance,
          "the difference to the host is above the tolerance");
    // All but those in which the C library's functions, which are not the host's, take part.
    check(2 * bits.equal > bits.count, "most solves should equal the host's in every bit");
    check(target.guarded, "the guard against allocations was not seen at work");
    const double known = figure("known");
    check(std::abs(figure("counted") - known) <= counting_tolerance * known,
          "a loop of known length was counted wrongly");
  }
  std::printf(
      "\nTolerance of the differences: %.0e rad/s, m/s. On the host itself float differs from "
      "double by %.1e in the solves and by %.1e in the cycles.\n",
      tolerance, compare(host, in_double, "solve").largest,
      compare(host, in_double, "cycle").largest);
  write_cycles(argv[1], shown);
  return good ? 0 : 1;
}
