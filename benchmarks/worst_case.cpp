// SPDX-License-Identifier: BSD-3-Clause
// Solves 2,000 random hierarchies of H's shape one by one, for callgrind to count the instructions
// of each call of `solve_one` (scripts/bench.sh).
#include <valgrind/callgrind.h>

#include <icat/tpik/tpik.hpp>

#include "hierarchy.hpp"

int main() {
  icat::Tpik<double, 13> tpik;
  for (unsigned seed = 0; seed < 2000; ++seed) {
    const auto levels = bench::hierarchy<double>(bench::Pattern::random, seed);
    CALLGRIND_ZERO_STATS;
    CALLGRIND_TOGGLE_COLLECT;
    bench::solve(tpik, levels);
    CALLGRIND_TOGGLE_COLLECT;
    CALLGRIND_DUMP_STATS;
  }
}
