#!/usr/bin/env bash
# What takes longer than test.sh may: the random campaigns at full length.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ cmake:cmake ninja-build:ninja ccache:ccache libeigen3-dev libgtest-dev
need_compiler
cmake --preset release >/dev/null || fail "configuring: release"
cmake --build --preset release --target test_motion_limits test_carry_campaign test_perception >/dev/null ||
  fail "building: the campaigns"
say "A million loops within limits"
ICAT_LIMIT_RUNS=1000000 build/release/tests/test_motion_limits || fail "a joint exceeded a limit"
say "Covariance of a pipe's pose, 100,000 images"
ICAT_LIMIT_RUNS=100000 build/release/tests/test_perception || fail "a covariance is wrong"
say "100,000 missions of two robots over a bad channel"
ICAT_CARRY_RUNS=100000 build/release/tests/test_carry_campaign || fail "a promise was broken"
say "The code of docs/coming_from.md"
./benchmarks/peers/same_job.sh >/dev/null || fail "the same job has another outcome"
say "Adapters against their peers, decoders ten minutes each"
ICAT_LOOP_SECONDS=30 ICAT_FUZZ_SECONDS=600 ICAT_NIGHTLY=1 ./scripts/test_hardware.sh || fail "an adapter fails"
say "What a user's file costs to compile"
./scripts/compile_cost.sh --instructions || fail "compiling costs more than it may"
say "Compilers, processors, flags and versions of Eigen"
./scripts/portability.sh || fail "a build fails"
