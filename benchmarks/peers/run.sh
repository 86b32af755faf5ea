#!/usr/bin/env bash
# icat beside its peers on the same problems; the page goes to out/benchmarks/peers.md and, once it
# is to stay, to docs/peers.md. Peers come from the package registries, each Python one into an
# environment of its own; one that cannot be had is named in the page.
source "$(dirname -- "${BASH_SOURCE[0]}")/../../scripts/common.sh"
source benchmarks/peers/common.sh

need g++:g++ cmake:cmake pkg-config:pkg-config python3:python3 libeigen3-dev liburdfdom-dev \
  liborocos-kdl-dev libkdl-parser-dev
need_compiler
python_tools
need_robot_data

home=benchmarks/peers
results=$work/results.tsv
mkdir -p out/benchmarks
: >"$results"

# missing <peer> <log>: why, by the last line of the log, without the path of this folder.
missing() {
  local why
  why=$(tail -n1 "$2")
  printf 'missing\t%s\t%s\n' "$1" "${why//"$PWD/"/}" >>"$results"
}

peers=()
for name in placo pink mink tsid; do
  if have_peer "$name"; then
    peers+=("$name")
  else
    missing "$name" "$work/$name.log"
  fi
done

find_libraries
cxx icat "${icat_flags[@]}" -Iinclude $home/icat_peers.cpp "${icat_libraries[@]}"
cxx icat_native -march=native "${icat_flags[@]}" -Iinclude $home/icat_peers.cpp \
  "${icat_libraries[@]}"
cxx kdl "${kdl_flags[@]}" $home/kdl_peers.cpp -lkdl_parser -lorocos-kdl
cxx allocations.so -fPIC -shared $home/allocations.cpp

export PYTHONDONTWRITEBYTECODE=1 # none beside the sources
python3 $home/problems.py build/robot_data "$problems"

# An environment may name a kernel of OpenBLAS that fits another processor.
unset OPENBLAS_CORETYPE OPENBLAS_L2_SIZE

log=$work/round.log
# run <program> <argument>...: what it says counts when it comes to its end.
run() { "$@" >"$work/round.tsv" 2>"$log" && cat "$work/round.tsv" >>"$results"; }
# all: every peer once.
all() {
  local name
  run "$work/icat" "$problems" icat -O3 || fail "icat: $(tail -n1 "$log")"
  run "$work/icat_native" "$problems" "icat, native" "-O3 -march=native" ||
    fail "icat, native: $(tail -n1 "$log")"
  run "$work/kdl" "$problems" "$(pkg-config --modversion orocos-kdl)" ||
    fail "KDL: $(tail -n1 "$log")"
  for name in "${peers[@]}"; do
    run "$work/$name/bin/python" "$home/${name}_peer.py" "$problems" ||
      missing "$name" "$log"
  done
}
say "Counting allocations, asking awkward questions"
(export LD_PRELOAD=$work/allocations.so && all)
for round in 1 2 3; do
  say "Measuring: round $round of 3"
  all
done

python3 $home/page.py "$results" "$problems" \
  "$("$CXX" --version | head -n1); $(sed -n 's/^model name[[:space:]]*: //p' /proc/cpuinfo | head -n1); $(python3 --version)" \
  >out/benchmarks/peers.md || fail "no page"
cat out/benchmarks/peers.md
say "Results: $PWD/out/benchmarks/peers.md"
