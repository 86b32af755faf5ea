#!/usr/bin/env bash
# From a fresh clone to the pictures and replays of the missions, for any processor.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ cmake:cmake ninja-build:ninja libeigen3-dev libcli11-dev gnuplot-nox:gnuplot libjs-three
need_compiler
missions=(01_grasp 02_cooperative_mission)
build demo "${missions[@]}"

shopt -s nullglob
for mission in "${missions[@]}"; do
  rm -rf -- "out/$mission"
  step "Running and drawing: $mission" "$PWD/out/$mission/report.txt" \
    "build/demo/examples/$mission" --output "out/$mission" || fail "$mission failed"
  grep '^In the current' "out/$mission/report.txt" || true
done

echo
for mission in "${missions[@]}"; do
  echo "Report:   $PWD/out/$mission/report.txt"
  for picture in "$PWD/out/$mission"/*/*.png; do echo "Picture:  $picture"; done
done
echo
echo "Open in a browser, no network needed:"
for mission in "${missions[@]}"; do echo "Replay:   $PWD/out/$mission/replay.html"; done
