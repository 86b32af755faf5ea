// SPDX-License-Identifier: BSD-3-Clause
// What the allocation of thrusters costs, for docs/vehicle.md: random requests of which most
// saturate.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <icat/control/thruster_allocation.hpp>
#include <icat/model/maris.hpp>
#include <random>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;

template <class F>
std::vector<double> times(int runs, const F& f) {
  std::vector<double> us;
  for (int k = 0; k < runs; ++k) {
    const auto start = Clock::now();
    f(static_cast<std::size_t>(k));
    us.push_back(std::chrono::duration<double, std::micro>(Clock::now() - start).count());
  }
  std::sort(us.begin(), us.end());
  return us;
}

template <class Allocation>
void row(const char* layout, Allocation allocation, int runs) {
  std::mt19937 rng(1);
  std::normal_distribution<double> normal;
  std::vector<icat::Vector6<double>> requests(4096);
  for (auto& w : requests) {
    for (int i = 0; i < 6; ++i) w(i) = normal(rng) * (i < 3 ? 150 : 75);  // N, N m
  }
  const auto allocate =
      times(runs, [&](std::size_t k) { (void)allocation.allocate(requests[k % 4096]); });
  const auto fail = times(runs / 20, [&](std::size_t k) {
    const auto thruster = static_cast<icat::Index>(k / 2 % 3);
    (void)(k % 2 == 0 ? allocation.fail(thruster) : allocation.restore(thruster));
  });
  const auto half = [](const std::vector<double>& t) { return t[t.size() / 2]; };
  std::printf("| %s | %d | %.1f µs | %.1f µs | %.1f µs |\n", layout,
              static_cast<int>(allocation.half_spaces()), half(allocate),
              allocate[allocate.size() * 99 / 100], half(fail));
}

/// `n` thrusters of ±60 N in random places, pointing anywhere.
icat::ThrusterAllocation<double> anywhere(std::size_t n) {
  using enum icat::WrenchComponent;
  std::mt19937 rng(2);
  std::normal_distribution<double> normal;
  std::vector<icat::Thruster<double>> thrusters(n);
  for (auto& t : thrusters) {
    for (int i = 0; i < 3; ++i) {
      t.position(i) = normal(rng);
      t.direction(i) = normal(rng);
    }
    t.minimum = -60;
    t.maximum = 60;
  }
  return icat::ThrusterAllocation<double>(thrusters, {{roll, pitch, yaw}, {surge, sway, heave}});
}

}  // namespace

int main() {
  std::puts("| layout | half-spaces | `allocate` p50 | p99 | `fail`, `restore` |");
  std::puts("|---|---|---|---|---|");
  row("R2, eight thrusters, four components",
      icat::ThrusterAllocation<double, 8>(icat::r2_thrusters<double>()), 200'000);
  row("eight at random, six components in two groups", anywhere(8), 100'000);
  row("twelve at random, six components", anywhere(12), 20'000);
  row("sixteen at random, six components", anywhere(16), 4'000);
}
