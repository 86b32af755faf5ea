#!/usr/bin/env bash
# solve_cost.sh <revision>: what a solve costs here and with the headers of another revision, by user
# time and by instructions: a Markdown table. User times are of runs that alternate, the median of
# 21 quotients, for x86-64 without and with AVX2; the same code differs by up to 5 % between two
# builds, by where its loops happen to lie.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

revision=${1:?which revision to compare with?}
git rev-parse -q --verify "$revision^{commit}" >/dev/null || fail "no revision '$revision'"
need g++:g++ libeigen3-dev valgrind:valgrind
work=build/solve_cost
rm -rf "$work"
mkdir -p "$work/there"
git archive "$revision" include | tar x -C "$work/there"
eigen=${EIGEN3_INCLUDE_DIR:-/usr/include/eigen3}
for march in x86-64 x86-64-v3; do
  for side in here there; do
    include=include
    [[ $side == here ]] || include=$work/there/include
    g++ -std=c++20 -O3 -DNDEBUG "-march=$march" -I"$include" -isystem "$eigen" \
      benchmarks/solve_cost/main.cpp -o "$work/$march.$side"
  done
done
# seconds <program> <argument>...: user time
seconds() {
  local TIMEFORMAT=%3U
  { time "$@" >/dev/null; } 2>&1
}
# instructions <program> <pattern>: of a solve
instructions() {
  local rounds counts=()
  for rounds in 10 110; do
    counts+=("$(valgrind --tool=callgrind --callgrind-out-file=/dev/null "$1" "$2" "$rounds" 2>&1 |
      sed -n 's/.*Collected : //p')")
  done
  echo $(((counts[1] - counts[0]) / 500))
}
echo "| rows | processor | time, times that of $revision | instructions, times | instructions of a solve |"
echo "|---|---|---|---|---|"
for march in x86-64 x86-64-v3; do
  pattern=0
  for what in "0 or 1" "one partial" "two partial" "all partial"; do
    # About half a second.
    one=$(seconds "$work/$march.here" "$pattern" 1000)
    rounds=$(awk -v t="$one" 'BEGIN { print int(500 / (t + 0.001)) }')
    time=$(for i in {1..21}; do
      echo "$(seconds "$work/$march.here" "$pattern" "$rounds") $(seconds "$work/$march.there" "$pattern" "$rounds")"
    done | awk '{ print $1 / $2 }' | sort -g | sed -n 11p)
    here=$(instructions "$work/$march.here" "$pattern")
    there=$(instructions "$work/$march.there" "$pattern")
    awk -v w="$what" -v m="$march" -v t="$time" -v h="$here" -v o="$there" \
      'BEGIN { printf "| %s | %s | %.3f | %.3f | %d |\n", w, m, t, h / o, h }'
    pattern=$((pattern + 1))
  done
done
