#!/usr/bin/env bash
# Runs every benchmark; a table, a chart and the raw results go to out/benchmarks. Options are
# Google Benchmark's.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ cmake:cmake ninja-build:ninja libeigen3-dev libbenchmark-dev libcli11-dev \
  gnuplot-nox:gnuplot valgrind:valgrind
need_compiler
build bench

out=$PWD/out/benchmarks
rm -rf "$out"
mkdir -p "$out"
export ICAT_BENCHMARK_DIR=$out

say "Running: tpik_benchmark"
# Repetitions in random order share the machine's moods; the fastest of each counts.
build/bench/benchmarks/tpik_benchmark --benchmark_repetitions=20 --benchmark_min_time=0.02 \
  --benchmark_enable_random_interleaving=true \
  "--benchmark_out=$out/tpik_benchmark.json" --benchmark_out_format=json "$@" ||
  fail "tpik_benchmark failed"

say "Running: mission_benchmark"
build/bench/benchmarks/mission_benchmark || fail "mission_benchmark failed"

say "Running: worst_case, under callgrind"
counts=$out/callgrind
mkdir -p "$counts"
valgrind --tool=callgrind --collect-atstart=no "--callgrind-out-file=$counts/out" \
  build/bench/benchmarks/worst_case >"$out/callgrind.log" 2>&1 || 
  fail "worst_case failed ($out/callgrind.log)"
find "$counts" -name 'out.*' -exec awk '/^(totals|summary):/ { n = $2 } END { print n }' {} \; |
  sort -n | awk 'BEGIN { CONVFMT = "%d" } $1 > 0' >"$out/worst_case.txt"
rm -rf "$counts"
awk '{ n[NR] = $1 } END {
  m = n[int((NR + 1) / 2)]; r = n[NR] / m
  printf "| worst case of %d random hierarchies: instructions, maximum against median (%d) | ≤ 4 × | %.2f × | %s |\n", NR, m, r, r <= 4 ? "yes" : "**no**"
}' "$out/worst_case.txt" >"$out/worst_case.md"

say "Running: the cost of the include"
# seconds <header>: user time to compile it alone, the fastest of five
seconds() {
  for _ in 1 2 3 4 5; do
    { TIMEFORMAT=%U; time "$CXX" -std=c++20 -O2 -fsyntax-only -Iinclude "-I$eigen" -x c++ - <<<"#include <$1>"; } 2>&1
  done | sort -n | head -n1
}
eigen=$(sed -n 's/^Eigen3_DIR:PATH=//p' build/bench/CMakeCache.txt)
eigen=${eigen%/share/*}/include/eigen3
awk -v dense="$(seconds Eigen/Dense)" -v icat="$(seconds icat/icat.hpp)" 'BEGIN {
  d = icat - dense
  printf "| `#include <icat/icat.hpp>` beyond `#include <Eigen/Dense>` | ≤ 0.5 s | %.2f s | %s |\n", d, d <= 0.5 ? "yes" : "**no**"
}' >"$out/include.md"

{
  cat "$out/Y.md"
  echo
  echo "| quantity | target | measured | met |"
  echo "|---|---|---|---|"
  cat "$out/solver.md" "$out/mission.md" "$out/worst_case.md" "$out/include.md"
} >"$out/table.md"

gnuplot -e "dir='$out'" benchmarks/plot.gp || fail "gnuplot failed"
cat "$out/table.md"
say "Results: $out"
