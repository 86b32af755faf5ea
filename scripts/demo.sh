#!/usr/bin/env bash
# From a fresh clone to the pictures and replays of the missions, for any processor.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

[[ ${CXX:-g++} != g++ ]] || need g++:g++
need cmake:cmake ninja-build:ninja libeigen3-dev libcli11-dev gnuplot-nox:gnuplot libjs-three
need_compiler
missions=(01_grasp 02_cooperative_mission)
build demo "${missions[@]}"

# run <mission>...: side by side, since most of the time is gnuplot's.
run() {
  local mission i=0 pids=() failed=0
  for mission in "$@"; do
    rm -rf -- "out/$mission"
    mkdir -p "out/$mission"
    "build/demo/examples/$mission" --output "out/$mission" >"out/$mission/report.txt" 2>&1 &
    pids+=($!)
  done
  for mission in "$@"; do
    wait "${pids[i++]}" || { failed=1; echo "$mission failed:"; tail "out/$mission/report.txt"; }
  done
  return "$failed"
}
shopt -s nullglob
step "Running and drawing: ${missions[*]}" "$PWD/build/missions.log" run "${missions[@]}" ||
  fail "a mission failed"
for mission in "${missions[@]}"; do
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
