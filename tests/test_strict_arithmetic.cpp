// SPDX-License-Identifier: BSD-3-Clause
// Compiled with flags of which the compiler's macros tell nothing: the solver refuses to exist.
#if defined(FAST_MATH_BY_PRAGMA)
#pragma GCC optimize("fast-math")
#endif
#include <cstdio>
#include <icat/tpik/null_space_guidance.hpp>
#include <icat/tpik/parametric_tpik.hpp>
#include <icat/tpik/tpik.hpp>
#include <string_view>

namespace {

template <class Solver>
int accepted(const char* name) {
  try {
    const Solver solver;
  } catch (const std::invalid_argument& e) {
    if (std::string_view(e.what()).find("icat was compiled with a flag") == 0) return 0;
    std::fprintf(stderr, "%s\n", e.what());
  }
  std::fprintf(stderr, "not refused: %s\n", name);
  return 1;
}

}  // namespace

int main() {
  return accepted<icat::Tpik<double, 7>>("Tpik, double") +
         accepted<icat::Tpik<float, 7>>("Tpik, float") +
         accepted<icat::ParametricTpik<double, 7>>("ParametricTpik") +
         accepted<icat::NullSpaceGuidance<double, 7>>("NullSpaceGuidance");
}
