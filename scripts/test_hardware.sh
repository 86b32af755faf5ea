#!/usr/bin/env bash
# Every adapter of hardware against its peer, and every decoder against libFuzzer: at most 30 minutes
# from a fresh clone on two cores. ICAT_LOOP_SECONDS and ICAT_FUZZ_SECONDS make it longer.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ clang:clang++ cmake:cmake ninja-build:ninja ccache:ccache libeigen3-dev libgtest-dev \
  libmujoco-dev libcli11-dev gpsd
need_compiler
need_sanitizers
python_tools
step "Installing the peers from PyPI" "$PWD/build/pip.log" "$venv/bin/pip" install -q \
  --disable-pip-version-check -r tests/hardware/requirements.txt || fail "pip could not install the peers"
SECONDS=0 # installing depends on the network

build fuzz
say "Fuzzing the decoders"
ctest --preset fuzz --parallel "$(parallel_jobs)" || fail "a decoder fails"

build hardware
say "Testing against the peers"
ctest --preset hardware --verbose >build/hardware.test.log 2>&1 ||
  { log_tail "$PWD/build/hardware.test.log"; fail "an adapter fails against its peer"; }
grep -E 'latency|bus load|tests passed' build/hardware.test.log | sed 's/^[0-9]*: //'

say "All adapters pass, in $((SECONDS / 60)) min $((SECONDS % 60)) s"
((SECONDS < 1800 || $(nproc) < 2 || ${ICAT_NIGHTLY:-0})) || fail "the tests took longer than 30 minutes"
