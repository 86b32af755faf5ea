#!/usr/bin/env bash
# All checks before a merge except test_hardware.sh: the tests in Release, the tests with sanitizers,
# the documentation, the demo as in the README, the compile time of user programs, and that all this
# takes no longer than 25 minutes from a fresh clone on two cores.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ clang:clang++ cmake:cmake ninja-build:ninja ccache:ccache doxygen:doxygen \
  gnuplot-nox:gnuplot libeigen3-dev libgtest-dev libcli11-dev libmujoco-dev \
  liburdfdom-dev liborocos-kdl-dev time:/usr/bin/time git:git
need_compiler

git rev-parse -q --verify HEAD >/dev/null ||
  fail "the demo is run in a clone of this folder: it must be a clone itself, and git must trust its owner (git config --global --add safe.directory '$PWD')"
need_sanitizers
need_pinocchio
need_robot_data
SECONDS=0 # installing depends on the network

for preset in release sanitize; do
  build "$preset"
  say "Testing: $preset"
  ctest --preset "$preset" --parallel "$(parallel_jobs)" || fail "tests fail: $preset"
done
build docs

# A newcomer's first minute: a fresh clone in a folder whose path has a space, without a compiler
# cache.
clone="$PWD/build/a fresh clone"
rm -rf "$clone"
git clone -q . "$clone"
[[ -z $(git status --porcelain) ]] || say "The demo is run without the uncommitted changes"
start=$SECONDS
say "Demo, in a fresh clone"
CCACHE_DISABLE=1 "$clone/scripts/demo.sh" || fail "the demo fails"
demo=$((SECONDS - start))
for mission in 01_grasp 02_cooperative_mission; do
  compgen -G "$clone/out/$mission/*/*.png" >/dev/null && [[ -s $clone/out/$mission/replay.html ]] ||
    fail "the demo left no pictures or no replay of $mission"
done
rm -rf "$clone"
say "The demo took $demo s"
((demo < 60 || $(nproc) < 2)) || fail "the demo took $demo s; its limit is 60 s"

say "Compile time of user programs"
./scripts/compile_cost.sh --check

say "All tests pass, in $((SECONDS / 60)) min $((SECONDS % 60)) s"
((SECONDS < 1500 || $(nproc) < 2)) || fail "the tests took longer than 25 minutes"
