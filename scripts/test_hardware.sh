#!/usr/bin/env bash
# Tests every hardware adapter against its peer and fuzzes every decoder: at most 30 minutes from a
# fresh clone on two cores. ICAT_LOOP_SECONDS and ICAT_FUZZ_SECONDS set longer runs.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ clang:clang++ cmake:cmake ninja-build:ninja ccache:ccache libeigen3-dev libgtest-dev \
  libmujoco-dev libbenchmark-dev libopencv-dev gnuplot-nox:gnuplot libcli11-dev cyclonedds-dev libfastrtps-dev nodejs:node npm:npm \
  libroscpp-dev libsensor-msgs-dev libnav-msgs-dev libgeometry-msgs-dev libstd-msgs-dev \
  python3-roslaunch:roscore python3-rostopic:rostopic python3-rospy python3-sensor-msgs \
  python3-nav-msgs python3-geometry-msgs python3-std-msgs \
  user-mode-linux kmod iproute2 gpsd libyaml-cpp-dev liburdfdom-dev \
  libboost-dev libjs-three chromium:chromium parallel:parallel openmpi-bin:mpirun
need_compiler
need_sanitizers
venv=$PWD/build/hardware_venv # the peers need another numpy than Pinocchio
python_tools
step "Installing the peers from PyPI" "$PWD/build/pip.log" "$venv/bin/pip" install -q \
  --disable-pip-version-check -r tests/hardware/requirements.txt || fail "pip could not install the peers"
step "Installing the peers from npm" "$PWD/build/npm.log" npm_peers || fail "npm could not install the peers"
SECONDS=0 # installing depends on the network

build fuzz
say "Fuzzing the decoders"
ctest --preset fuzz --parallel "$(parallel_jobs)" || fail "a decoder fails"

build bench tpik_benchmark # the one preset for the processor at hand
build hardware
say "Testing against the peers"
ctest --preset hardware --verbose >build/hardware.test.log 2>&1 ||
  { log_tail "$PWD/build/hardware.test.log"; fail "an adapter fails against its peer"; }
# The figures that the pages cite.
sed -nE 's/^[0-9]+: //; /latency|uml: not run|allocates|bus load|not healthy|tool error|^(acoustic modem|mavlink: |gpsd: |dolfyn|PD6|measurements)|tests passed/p' \
  build/hardware.test.log

say "On a microcontroller, in QEMU"
./scripts/microcontroller.sh >build/microcontroller.log 2>&1 ||
  { log_tail "$PWD/build/microcontroller.log"; fail "the solver fails on a microcontroller"; }

say "All adapters pass, in $((SECONDS / 60)) min $((SECONDS % 60)) s"
((SECONDS < 1800 || $(nproc) < 2 || ${ICAT_NIGHTLY:-0})) || fail "the tests took longer than 30 minutes"
