#!/usr/bin/env bash
# All that must pass: the tests in Release, the tests with sanitizers, the documentation.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ clang:clang++ cmake:cmake ninja-build:ninja ccache:ccache doxygen:doxygen \
  gnuplot-nox:gnuplot libeigen3-dev libgtest-dev libbenchmark-dev libcli11-dev libmujoco-dev
need_compiler

# Where the sanitizers of clang are a package of their own, it carries the version in its name.
mkdir -p build
if ! clang++ -fsanitize=address,undefined -x c++ - -o build/sanitizer_probe \
  2>/dev/null <<<'int main() {}'; then
  need "libclang-rt-$(clang++ -dumpversion | cut -d. -f1)-dev"
fi

for preset in release sanitize; do
  build "$preset"
  say "Testing: $preset"
  ctest --preset "$preset" --parallel "$(parallel_jobs)" || fail "tests fail: $preset"
done
build docs
say "All tests pass"
