#!/usr/bin/env bash
# Pictures of docs/gallery.md: builds and runs the examples that have a replay, opens the replays in
# headless Chromium and writes what it shows to docs/images/gallery_*.png, each under 200 kB.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ cmake:cmake ninja-build:ninja libeigen3-dev libcli11-dev gnuplot-nox:gnuplot libjs-three \
  liburdfdom-dev libyaml-cpp-dev chromium:chromium nodejs:node npm:npm
need_compiler
step "Installing Chromium's driver" "$PWD/build/npm.log" npm_peers || fail "npm could not install it"
examples=(01_grasp 05_urdf_arm 06_mobile_manipulator 07_two_arms 08_rov 09_obstacles 13_hardware icat_run)
build demo "${examples[@]}"

# run <name> <program> [<argument>...]
run() {
  step "Running: $1" "$PWD/out/$1/report.txt" "build/demo/examples/$2" "${@:3}" --output "out/$1" ||
    fail "$1 fails"
}
# photo <name> <time> <azimuth> <elevation> <distance factor> <width> <height>
photo() {
  local picture=docs/images/gallery_$1.png
  NODE_PATH=build/node/node_modules node tests/hardware/replay/screenshot.js \
    "out/$1/replay.html" "$picture" "${@:2}" || fail "no picture of $1"
  (($(stat -c %s "$picture") < 200000)) || fail "$picture is heavier than 200 kB"
}

for name in "${examples[@]}"; do
  [[ $name == icat_run ]] || run "$name" "$name"
done
run 00_reach icat_run/icat_run examples/00_reach/mission.yaml --z-down
run icat_run icat_run/icat_run examples/01_grasp/mission.yaml --z-down
cp out/13_hardware/run.png docs/images/gallery_13_hardware.png
# That of the microcontroller is scripts/microcontroller.sh's: out/microcontroller/cycles.png.

photo 00_reach 5 -0.9 0.35 0.8 1200 720
photo 01_grasp 40 -1.5 0.3 1.05 1200 590
photo 05_urdf_arm 34 -0.9 0.3 0.72 1200 720
photo 06_mobile_manipulator 20 3.5 0.35 0.6 1200 720
photo 07_two_arms 13 -0.9 0.35 0.8 1200 720
photo 08_rov 20 -0.9 0.35 0.8 1200 740
photo 09_obstacles 8.5 -0.9 0.35 0.8 1200 720
photo icat_run 25 -1.5 0.3 0.95 1200 720
say "Pictures: $PWD/docs/images/gallery_*.png"
