#!/usr/bin/env bash
# Runs every benchmark; raw results go to out/benchmarks. Options are Google Benchmark's.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ cmake:cmake ninja-build:ninja libeigen3-dev libbenchmark-dev
need_compiler
build bench

mkdir -p out/benchmarks
for source in benchmarks/*_benchmark.cpp; do
  name=$(basename "$source" .cpp)
  say "Running: $name"
  "build/bench/benchmarks/$name" "--benchmark_out=out/benchmarks/$name.json" \
    --benchmark_out_format=json "$@" || fail "$name failed"
done
say "Results: $PWD/out/benchmarks"
