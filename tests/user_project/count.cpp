// SPDX-License-Identifier: BSD-3-Clause
// Solves hierarchies of the benchmarks' shape as often as told. Two runs differ by the instructions
// of the solves alone.
#include <cstdio>
#include <cstdlib>
#include <icat/tpik/tpik.hpp>

#include "../../benchmarks/hierarchy.hpp"

int main(int argc, char** argv) {
  const int solves = argc > 1 ? std::atoi(argv[1]) : 0;
  icat::Tpik<double, 13> tpik;
  for (const auto pattern : {bench::Pattern::steady, bench::Pattern::all_partial}) {
    const auto levels = bench::hierarchy<double>(pattern, 1);
    for (int i = 0; i < solves; ++i) bench::solve(tpik, levels);
  }
  std::printf("%.6f\n", tpik.velocity().norm());
}
