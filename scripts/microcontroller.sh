#!/usr/bin/env bash
# icat without operating system: builds examples/microcontroller for a Cortex-M7 and a Cortex-M4F,
# runs both in QEMU, compares their velocities with the host's, and prints a table, also to
# out/microcontroller/table.md. Where gnuplot is found, out/microcontroller/cycles.png shows the cycles.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ cmake:cmake libeigen3-dev gcc-arm-none-eabi:arm-none-eabi-g++ \
  libstdc++-arm-none-eabi-newlib qemu-system-arm:qemu-system-arm
need_compiler
arm-none-eabi-g++ -std=c++20 -fsyntax-only -x c++ - 2>/dev/null <<'CPP' ||
#include <concepts>
#if __GNUC__ < 11
#error too old
#endif
CPP
  fail "arm-none-eabi-g++ $(arm-none-eabi-g++ -dumpversion) is too old: icat needs 11, with its libstdc++"

source=examples/microcontroller
build=build/microcontroller
out=out/microcontroller
mkdir -p "$build/generated" "$out"

warnings=(-Wall -Wextra -Wpedantic -Wshadow -Wconversion)
# The same on both sides: no exceptions, and no product and sum in one rounding, so that what the
# host and the targets compute can be equal in every bit.
flags=(-std=c++20 -O2 -DNDEBUG "${warnings[@]}" -fno-exceptions -fno-rtti -ffp-contract=off
  -Iinclude -isystem "${EIGEN3_INCLUDE_DIR:-/usr/include/eigen3}" "-I$build/generated")

# host <name> [<flag>...]: builds and runs the program here.
host() {
  "$CXX" "${flags[@]}" "${@:2}" "$source/main.cpp" "$source/host.cpp" -o "$build/$1" ||
    fail "the program does not build for the host"
  "$build/$1" >"$build/$1.txt" || fail "the program fails on the host"
}

# target <name> <board of QEMU> <flag>...: builds and runs the program for a processor.
target() {
  # nano.specs: the C and C++ libraries for small processors, themselves without exceptions;
  # _printf_float: so that errors of construction show their numbers.
  arm-none-eabi-g++ "${flags[@]}" -mthumb -mfloat-abi=hard "${@:3}" \
    -ffunction-sections -fdata-sections -Wl,--gc-sections --specs=nano.specs -u _printf_float \
    -nostartfiles -T "$source/cortex_m.ld" \
    "$source/main.cpp" "$source/board.cpp" -o "$build/$1.elf" || fail "$1 does not build"
  # icount: the virtual clock counts instructions, see board.cpp.
  timeout 60 qemu-system-arm -M "$2" -nographic -monitor none -serial none -icount shift=0 \
    -chardev stdio,id=text -semihosting-config enable=on,target=native,chardev=text \
    -kernel "$build/$1.elf" >"$build/$1.txt" </dev/null || {
    grep '^error' "$build/$1.txt" >&2 || true
    fail "$1 fails ($build/$1.txt)"
  }
}

say "Recording the hierarchies of 01_grasp"
"$CXX" "${flags[@]}" "$source/record.cpp" examples/support/{geometry,recorder,csv}.cpp \
  -o "$build/record" || fail "record does not build"
"$build/record" >"$build/generated/recorded.hpp" || fail "record fails"
"$CXX" "${flags[@]}" "$source/compare.cpp" -o "$build/compare" || fail "compare does not build"

say "Running on the host"
host host
host host_no_packets -DEIGEN_DONT_VECTORIZE # in the order of the targets' additions
host host_double -DSCALAR=double

say "Running on the Cortex-M7"
target cortex_m7 mps2-an500 -mcpu=cortex-m7 -mfpu=fpv5-d16
say "Running on the Cortex-M4F"
target cortex_m4f mps2-an386 -mcpu=cortex-m4 -mfpu=fpv4-sp-d16

say "Running on the Cortex-M7, with products and sums in one rounding"
target cortex_m7_fused mps2-an500 -mcpu=cortex-m7 -mfpu=fpv5-d16 -ffp-contract=fast
figure() { sed -n "s/^figure $2 //p" "$build/$1.txt"; }

status=0
"$build/compare" "$out/cycles.csv" "$build"/host{,_no_packets,_double}.txt \
  Cortex-M7 "$build/cortex_m7.txt" Cortex-M4F "$build/cortex_m4f.txt" >"$out/table.md" || status=1
printf '\nA controller takes %s bytes, its solver included. With `-ffp-contract=fast`, which is the default of GCC, a solve on the Cortex-M7 takes %s instructions in the median and a control cycle %s.\n' \
  "$(figure cortex_m7 controller)" "$(figure cortex_m7_fused solve_median)" \
  "$(figure cortex_m7_fused cycle_median)" >>"$out/table.md"
cat "$out/table.md"
if command -v gnuplot >/dev/null; then
  gnuplot -e "folder = '$out'" "$source/plot.gp" || fail "no picture"
fi
((status == 0)) || fail "the targets are not right"
say "Table: $PWD/$out/table.md"
