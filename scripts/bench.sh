#!/usr/bin/env bash
# Runs every benchmark; a table, a chart and the raw results go to out/benchmarks. Options are
# Google Benchmark's.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ cmake:cmake ninja-build:ninja libeigen3-dev libbenchmark-dev libcli11-dev \
  gnuplot-nox:gnuplot valgrind:valgrind time:/usr/bin/time
need_compiler
say "Building for this processor: the programs may not run on another"
build bench

out=$PWD/out/benchmarks
rm -rf "$out"
mkdir -p "$out"
export ICAT_BENCHMARK_DIR=$out

say "Running: tpik_benchmark"
# Repetitions in random order spread disturbances over all cases; the fastest of each counts.
build/bench/benchmarks/tpik_benchmark --benchmark_repetitions=20 --benchmark_min_time=0.02 \
  --benchmark_enable_random_interleaving=true \
  "--benchmark_out=$out/tpik_benchmark.json" --benchmark_out_format=json "$@" ||
  fail "tpik_benchmark failed"

say "Running: mission_benchmark"
build/bench/benchmarks/mission_benchmark || fail "mission_benchmark failed"

say "Running: safe_gains, for docs/safety.md"
build/bench/benchmarks/safe_gains >"$out/safe_gains.md" || fail "safe_gains failed"

say "Running: saturation"
build/bench/benchmarks/saturation >"$out/saturation.md" || fail "saturation failed"

say "Running: thrusters, for docs/vehicle.md"
build/bench/benchmarks/thrusters >"$out/thrusters.md" || fail "thrusters failed"

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

say "Running: compile time of user programs"
./scripts/compile_cost.sh >"$out/compile_cost.md" || fail "compile_cost failed"

{
  echo "# Benchmarks"
  echo
  echo "Printed by \`./scripts/bench.sh\`; [the solver](solver.md) explains the method. Ratios are taken within one run. Y is the time of Eigen's HouseholderQR of a 28 × 13 dynamic double matrix. H has 13 degrees of freedom and level rows 7, 1, 1, 1, 1, 6, 6, 7, 6 and the closing 13, dense and random. *Steady*: activations 0 or 1, active rows 1, 0, 1, 1, 0, 0, 6, 0, 6, 13. *One row at 0.4*: as steady, with the joint limit's activation at 0.4; *transition*: in addition the manipulability's at 0.6. *All partial*: every activation between 0.05 and 0.95. *Onset*: as steady, with the activations of the six other joint limits, the distance and the attitude at 1e-3. The robot of 38 DoF has levels of 38 (joint limits), 6, 6, 6, 3 and 38 rows (posture) and the closing 38. The same program on the same machine differs by a tenth from run to run, most of all in Y."
  echo
  echo "$("$CXX" --version | head -n1), $(sed -n 's/^CMAKE_CXX_FLAGS_RELEASE:STRING=//p' build/bench/CMakeCache.txt), $(sed -n 's/^model name[[:space:]]*: //p' /proc/cpuinfo | head -n1); $(cat "$out/Y.md")"
  echo
  echo "| quantity | target | measured | met |"
  echo "|---|---|---|---|"
  cat "$out/solver.md" "$out/mission.md" "$out/worst_case.md"
  echo
  echo "Compile time of user programs, by \`./scripts/compile_cost.sh\`; \`./scripts/test.sh\` fails if a bound is exceeded by more than 15 %. User time, the median of three quotients, with the same compiler:"
  echo
  cat "$out/compile_cost.md"
  echo
  echo "Heap allocations after construction: 0, asserted in Release by \`tests/test_allocation.cpp\`."
  echo
  echo "![Time of a solve by pattern, and its growth with the degrees of freedom](images/solver.png)"
} >"$out/benchmarks.md"
(cd "$out" && rm -f Y.md solver.md mission.md worst_case.md compile_cost.md)

gnuplot -e "dir='$out'" benchmarks/plot.gp || fail "gnuplot failed"
cat "$out/benchmarks.md"
say "Results: $out"
