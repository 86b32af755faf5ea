// SPDX-License-Identifier: BSD-3-Clause
// On the host: runs the mission of 01_grasp and prints a header with some of its hierarchies, as
// the solver got them, evenly spaced over the mission. The microcontroller solves them again.
#include <cstdio>
#include <vector>

#include "../01_grasp/mission.hpp"

namespace {

constexpr std::size_t wanted = 64;  ///< some 2.5 kB each

/// One cycle: the rows of all levels, one after the other.
struct Recorded {
  std::vector<float> jacobian, activation, reference;
};

/// Hexadecimal, so that the compiler reads the same bits.
void print(const char* name, const char* size, const std::vector<Recorded>& cycles,
           std::vector<float> Recorded::*part) {
  std::printf("inline constexpr float %s[count][%s] = {\n", name, size);
  for (const Recorded& cycle : cycles) {
    std::printf("{");
    for (const float x : cycle.*part) std::printf("%af,", static_cast<double>(x));
    std::printf("},\n");
  }
  std::printf("};\n");
}

}  // namespace

int main() {
  std::vector<Recorded> cycles;
  std::vector<icat::Index> level_rows;
  const grasp::Result result = grasp::run({}, 0.01, [&](const grasp::Cycle& now) {
    Recorded cycle;
    level_rows.clear();
    for (const auto& level : now.controller.first().levels()) {
      level_rows.push_back(level.jacobian.rows());
      for (icat::Index i = 0; i < level.jacobian.rows(); ++i) {
        for (icat::Index j = 0; j < level.jacobian.cols(); ++j) {
          cycle.jacobian.push_back(static_cast<float>(level.jacobian(i, j)));
        }
        cycle.activation.push_back(static_cast<float>(level.activation(i)));
        cycle.reference.push_back(static_cast<float>(level.reference(i)));
      }
    }
    cycles.push_back(std::move(cycle));
  });
  if (!result.lifted || cycles.size() < wanted) {
    std::fprintf(stderr, "the mission failed\n");
    return 1;
  }
  std::vector<Recorded> chosen;
  for (std::size_t i = 0; i < wanted; ++i) {
    chosen.push_back(cycles[i * (cycles.size() - 1) / (wanted - 1)]);
  }

  std::printf("// Written by record.cpp.\n#pragma once\n\nnamespace recorded {\n\n");
  std::printf("inline constexpr int count = %zu, columns = 13;\n", wanted);
  std::printf("inline constexpr int level_rows[] = {");
  for (const icat::Index n : level_rows) std::printf("%d,", static_cast<int>(n));
  std::printf("};\ninline constexpr int rows = %zu;\n", chosen[0].reference.size());
  print("jacobians", "rows * columns", chosen, &Recorded::jacobian);
  print("activations", "rows", chosen, &Recorded::activation);
  print("references", "rows", chosen, &Recorded::reference);
  std::printf("\n}  // namespace recorded\n");
}
