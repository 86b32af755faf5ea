#!/usr/bin/env bash
# From a fresh clone to the pictures of the reference mission.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ cmake:cmake ninja-build:ninja libeigen3-dev libcli11-dev gnuplot-nox:gnuplot
need_compiler
build demo

say "Running: 01_grasp"
build/demo/examples/01_grasp --output out/01_grasp || fail "the mission failed"
say "Pictures: $PWD/out/01_grasp"
