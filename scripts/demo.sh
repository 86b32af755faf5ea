#!/usr/bin/env bash
# From a fresh clone to the pictures of the missions.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ cmake:cmake ninja-build:ninja libeigen3-dev libcli11-dev gnuplot-nox:gnuplot
need_compiler
missions=(01_grasp 02_cooperative_mission)
build demo "${missions[@]}"

for example in "${missions[@]}"; do
  say "Running: $example"
  "build/demo/examples/$example" --output "out/$example" || fail "$example failed"
  say "Pictures: $PWD/out/$example"
done
