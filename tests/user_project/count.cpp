// SPDX-License-Identifier: BSD-3-Clause
// Solves hierarchies of the benchmarks' shape: `count <solves> <float|double>`. Two runs differ by
// the instructions of the solves alone.
#include <cstdio>
#include <cstdlib>
#include <icat/tpik/tpik.hpp>
#include <string_view>

#include "../../benchmarks/hierarchy.hpp"

namespace {

template <class Scalar>
void solve(int solves) {
  icat::Tpik<Scalar, 13> tpik;
  for (const auto pattern : {bench::Pattern::steady, bench::Pattern::all_partial}) {
    const auto levels = bench::hierarchy<Scalar>(pattern, 1);
    for (int i = 0; i < solves; ++i) bench::solve(tpik, levels);
  }
  std::printf("%.6f\n", static_cast<double>(tpik.velocity().norm()));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const bool single = std::string_view(argv[2]) == "float";
  single ? solve<float>(std::atoi(argv[1])) : solve<double>(std::atoi(argv[1]));
}
