// SPDX-License-Identifier: BSD-3-Clause
// Solves five hierarchies of the benchmarks in turn: `main <pattern> <rounds>`.
// scripts/solve_cost.sh measures what that takes with this revision's headers and with another's.
#include <cstdlib>
#include <icat/tpik/tpik.hpp>
#include <iostream>

#include "../hierarchy.hpp"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const auto pattern = static_cast<bench::Pattern>(std::atoi(argv[1]));
  const int rounds = std::atoi(argv[2]);
  std::vector<bench::Hierarchy<double>> hierarchies;
  for (unsigned seed = 0; seed < 5; ++seed) {
    hierarchies.push_back(bench::hierarchy<double>(pattern, seed));
  }
  icat::Tpik<double, 13> tpik;
  double sum = 0;
  for (int i = 0; i < rounds; ++i) {
    for (const auto& levels : hierarchies) {
      bench::solve(tpik, levels);
      sum += tpik.velocity().sum();
    }
  }
  std::cout << sum << '\n';  // so that nothing is left out
}
