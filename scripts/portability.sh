#!/usr/bin/env bash
# Builds and runs icat under many compilers, processors, flags and versions of Eigen, and prints the
# page of the docs about it. Without arguments everything, and the page; with names of builds
# (--list shows them) these alone; --page prints the page again, from the last run of each build. Of a
# build that was not run here, the page keeps the row that docs/portability.md has.
# Logs: build/portability/<name>.log.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

work=$PWD/build/portability
out=$PWD/out/portability
facts=$work/facts
mkdir -p "$work" "$facts"
root=$PWD
# What a row was measured on: rows may come from different runs.
revision=$(git rev-parse --short HEAD 2>/dev/null || echo unknown)
[[ -z $(git status --porcelain --untracked-files=no -- include tests examples cmake 2>/dev/null) ]] ||
  revision+=+
eigen5=5.0.1

# --- what a build leaves for the page ------------------------------------------------------------

# fact <key> <value>: of the build that is running.
fact() { printf '%s' "$2" >"$facts/$name.$1"; }
# get <build> <key>
get() {
  if [[ -f $facts/$1.$2 ]]; then
    cat "$facts/$1.$2"
  elif [[ -f $facts/$1.state ]]; then
    printf '**no**' # the build ended before it came to this
  else
    printf 'not run yet'
  fi
}

# --- parts of a build ----------------------------------------------------------------------------

# can_run <flags>: does the processor at hand have what they ask for?
can_run() {
  local flag has
  has=" $(sed -n '/^flags/{s/^[^:]*: //p;q}' /proc/cpuinfo) "
  local v2="cx16 popcnt sse4_1 sse4_2 ssse3" v3="abm avx2 bmi1 bmi2 f16c fma movbe"
  local v4="avx512bw avx512cd avx512dq avx512f avx512vl" wanted=
  case $1 in
    *x86-64-v4*) wanted="$v2 $v3 $v4" ;;
    *x86-64-v3*) wanted="$v2 $v3" ;;
    *x86-64-v2*) wanted=$v2 ;;
  esac
  for flag in $wanted; do [[ $has == *" $flag "* ]] || return 1; done
}

# The package that brings a compiler.
need_cxx() {
  case $1 in
    clang++-*) need "clang-${1##*-}:$1" ;;
    *) need "$1:$1" ;;
  esac
}

# user <folder> <compiler> <flags> <plain|system> <parts> [<option of CMake>...]: configures and
# builds tests/user_project.
user() {
  local folder=$1 cxx=$2 flags=$3 as=$4 parts=$5 warnings=
  # GCC before 13 finds '__Y' uninitialized in its own AVX-512 intrinsics where Eigen's predux uses
  # them; any sum over a vector of Eigen shows that. With AVX and -O3 it finds that Eigen reads past
  # short vectors, in loops that do not run that far.
  if [[ $cxx == *g++* && $cxx != clang* ]] && (($("$cxx" -dumpversion | cut -d. -f1) < 13)); then
    local macros
    macros=$("$cxx" $flags -dM -E -x c++ /dev/null)
    if grep -q __AVX512F__ <<<"$macros"; then
      warnings="-Wno-uninitialized;-Wno-maybe-uninitialized"
    elif grep -q __AVX__ <<<"$macros" && [[ $flags == *-O3* ]]; then
      warnings="-Wno-array-bounds;-Wno-maybe-uninitialized"
    fi
  fi
  cmake -G Ninja -S tests/user_project -B "$folder" -DCMAKE_BUILD_TYPE=None \
    "-DCMAKE_CXX_COMPILER=$cxx" "-DCMAKE_CXX_FLAGS=$flags" -DCMAKE_CXX_COMPILER_LAUNCHER=ccache \
    "-DICAT_AS=$as" "-DPARTS=$parts" "-DEXTRA_WARNINGS=$warnings" \
    "-DCMAKE_PREFIX_PATH=$work/prefix" "${@:6}"
  cmake --build "$folder" --parallel "$(parallel_jobs)"
}

# The package for those who include icat as a system folder.
install_icat() {
  cmake -G Ninja -S . -B "$work/package" -DICAT_BUILD_TESTS=OFF -DICAT_BUILD_EXAMPLES=OFF \
    -DICAT_BUILD_BENCHMARKS=OFF
  rm -rf "$work/prefix"
  cmake --install "$work/package" --prefix "$work/prefix"
}

# oracle <folder> [<emulator>]: runs the oracle test in as many shards as there are jobs.
oracle() {
  local folder=$1 jobs pids=() i failed=0
  jobs=$(parallel_jobs)
  for ((i = 0; i < jobs; ++i)); do
    GTEST_TOTAL_SHARDS=$jobs GTEST_SHARD_INDEX=$i "${@:2}" "$folder/test_tpik_oracle" \
      >"$folder/oracle.$i.log" 2>&1 &
    pids+=($!)
  done
  for i in "${pids[@]}"; do wait "$i" || failed=1; done
  cat "$folder"/oracle.*.log
  # worst relative error <e>, <n> beyond 1e-9, worst <r> of the literal's
  fact worst "$(sed -n 's/^worst relative error \([^,]*\),.*/\1/p' "$folder"/oracle.*.log |
    sort -g | tail -n1)"
  fact beyond "$(sed -n 's/^worst .*, \([0-9]*\) beyond.*/\1/p' "$folder"/oracle.*.log |
    awk '{ n += $1 } END { print n + 0 }')"
  fact ratio "$(sed -n 's/^worst .*, worst \([0-9.]*\) of .*/\1/p' "$folder"/oracle.*.log |
    sort -g | tail -n1)"
  ((failed == 0))
}

# --- the builds ----------------------------------------------------------------------------------

# name | compiler | flags | icat as | examples | headers alone, which no flag changes: once with each
# compiler
x86_builds="
gcc11-v1|g++-11|-O2 -march=x86-64|plain|link|headers
gcc12-v1|g++-12|-O0 -march=x86-64|system|compile|
gcc12-v2|g++-12|-O2 -march=x86-64-v2|plain|compile|headers
gcc12-v3|g++-12|-O3 -march=x86-64-v3|plain|compile|
gcc12-v4|g++-12|-O1 -march=x86-64-v4|system|compile|
gcc12-native|g++-12|-O2 -march=native|plain|check|
clang14-v1|clang++-14|-O1 -march=x86-64|plain|check|headers
clang16-v2|clang++-16|-O3 -march=x86-64-v2|plain|check|headers
clang19-v3|clang++-19|-O2 -march=x86-64-v3|plain|check|headers
clang19-v4|clang++-19|-O0 -march=x86-64-v4|system|check|
clang19-native|clang++-19|-O3 -march=native|plain|check|"

x86() {
  local cxx flags as examples headers folder=$work/$name
  IFS='|' read -r _ cxx flags as examples headers < <(grep "^$name|" <<<"$x86_builds")
  need_cxx "$cxx"
  fact compiler "$("$cxx" --version | head -n1 | grep -oE '[0-9]+\.[0-9]+\.[0-9]+' | tail -n1)"
  user "$folder" "$cxx" "$flags" "$as" "$headers;examples;oracle" "-DEXAMPLES=$examples"
  fact compiles yes
  if can_run "$flags"; then
    oracle "$folder"
    fact passes yes
  else
    fact passes "not run: this processor lacks the instructions"
    fact worst - && fact beyond - && fact ratio -
  fi
}

eigen5() {
  need_cxx g++-12
  python_tools
  local folder=$work/eigen5
  mkdir -p "$folder/wheel"
  "$venv/bin/pip" download -q --no-deps -d "$folder/wheel" "eigency==$eigen5.1"
  "$venv/bin/python" -m zipfile -e "$folder"/wheel/eigency-*.whl "$folder/wheel"
  # The wheel has the headers alone.
  cat >"$folder/Eigen3Config.cmake" <<CMAKE
if(NOT TARGET Eigen3::Eigen)
  add_library(Eigen3::Eigen INTERFACE IMPORTED)
  target_include_directories(Eigen3::Eigen INTERFACE "$folder/wheel/eigency/eigen")
endif()
CMAKE
  echo "set(PACKAGE_VERSION $eigen5)" >"$folder/Eigen3ConfigVersion.cmake"
  user "$folder/build" g++-12 "-O2 -march=x86-64-v3" plain "headers;examples;solver" \
    -DEXAMPLES=check "-DEigen3_DIR=$folder"
  # It is Eigen 5 that was compiled.
  grep -q "eigency/eigen/Eigen/Core" < <(ninja -C "$folder/build" -t deps)
  can_run x86-64-v3 || { echo "this processor has no AVX2: compiled, not run" && return 0; }
  oracle "$folder/build"
  local test
  for test in test_tpik test_tpik_continuity test_tpik_paths test_parametric_tpik \
    test_null_space_guidance; do
    "$folder/build/$test"
  done
}

no_exceptions() {
  local cxx
  for cxx in g++-12 clang++-19; do
    need_cxx "$cxx"
    user "$work/no-exceptions-$cxx" "$cxx" -O2 plain no_exceptions
    "$work/no-exceptions-$cxx/test_no_exceptions"
  done
}

fast_math() {
  local cxx flags common=(-std=c++20 -O2 -Iinclude -isystem "$(eigen_folder)")
  while IFS='|' read -r cxx flags; do
    need_cxx "$cxx"
    echo "does not compile: $cxx $flags"
    if "$cxx" "${common[@]}" $flags -fsyntax-only tests/consumer/main.cpp >"$work/refusal" 2>&1; then
      echo "was not refused"
      return 1
    fi
    grep -m1 "icat must not be compiled with" "$work/refusal"
  done <<'BUILDS'
g++-12|-ffast-math
g++-12|-Ofast
g++-12|-ffinite-math-only
g++-12|-funsafe-math-optimizations
g++-11|-ffast-math
g++-11|-ffinite-math-only
clang++-19|-ffast-math
clang++-19|-Ofast
clang++-19|-ffinite-math-only
BUILDS
  while IFS='|' read -r cxx flags; do
    need_cxx "$cxx"
    echo "no solver is constructed: $cxx $flags"
    "$cxx" "${common[@]}" $flags tests/test_strict_arithmetic.cpp -o "$work/refusal_by_solver"
    "$work/refusal_by_solver"
  done <<'BUILDS'
g++-12|-DFAST_MATH_BY_PRAGMA
g++-11|-funsafe-math-optimizations
g++-11|-ffast-math -fno-finite-math-only
clang++-14|-fno-honor-nans
clang++-14|-fassociative-math -fno-signed-zeros
clang++-19|-fno-honor-nans
clang++-19|-funsafe-math-optimizations
clang++-19|-ffast-math -fno-finite-math-only
BUILDS
}

eigen_folder() {
  local folder
  for folder in /usr/include/eigen3 /usr/local/include/eigen3; do
    if [[ -d $folder ]]; then echo "$folder" && return; fi
  done
  fail "no folder of Eigen"
}

# must work? | flags of the program | what the page says about it
foreign_variants="
yes|-O2|
-|-O2 -mavx|
-|-O2 -march=native|
-|-O2 -march=native -DEIGEN_MAX_ALIGN_BYTES=16|
-|-O2 -march=native -DEIGEN_MAX_STATIC_ALIGN_BYTES=16|
-|-O2 -march=native -DEIGEN_MAX_ALIGN_BYTES=16 -DEIGEN_MALLOC_ALREADY_ALIGNED=1|
yes|-O2 -march=native -mno-avx|
yes|-O2 -march=x86-64-v2|
yes|-O2|\`-O2\`, with icat in a shared library of its own at \`-march=native\`"

# How a program ended.
outcome() {
  local rc=0
  "$@" || rc=$?
  if ((rc == 0)); then
    echo works
  elif ((rc > 128)); then
    echo "crashes (SIG$(kill -l $((rc - 128))))"
  else
    echo "wrong result"
  fi
}

foreign() {
  need_cxx g++-12
  need liborocos-kdl-dev
  need_pinocchio
  local prefix source=tests/user_project/foreign folder=$work/foreign must flags label i=0
  prefix=$(echo "$venv"/lib/python*/site-packages/cmeel.prefix)
  mkdir -p "$folder"
  local common=(-std=c++20 -DNDEBUG -Iinclude -isystem "$(eigen_folder)")
  local pinocchio=(-isystem "$prefix/include" -DBOOST_MPL_LIMIT_LIST_SIZE=30
    -DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS
    -DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION)  # calls go into the library
  local libraries=("-L$prefix/lib" -lpinocchio_default "-Wl,-rpath,$prefix/lib"
    "-Wl,-rpath-link,$prefix/lib")
  # Nothing but `solve` is seen from outside, so that no function of Eigen exists twice.
  ccache g++-12 "${common[@]}" -O2 -march=native -fPIC -fvisibility=hidden \
    -fvisibility-inlines-hidden -c "$source/solver.cpp" -o "$folder/apart.o"
  g++-12 -shared -Wl,-Bsymbolic "$folder/apart.o" -o "$folder/libapart.so"

  # The adapters that hand no matrix of Eigen to their library, and so take any flags. What the tests
  # do with KDL's own matrices is left out.
  need liburdfdom-dev
  need libmujoco-dev
  local adapter adapters=()
  for adapter in urdf kdl mujoco; do
    (
      ccache g++-12 "${common[@]}" -Itests -DICAT_ROBOT_DATA='""' -DICAT_SNAPSHOT='""' \
        -O2 -march=native -c "tests/adapters/test_$adapter.cpp" -o "$folder/adapter_$adapter.o"
      g++-12 "$folder/adapter_$adapter.o" -o "$folder/adapter_$adapter" -lgtest_main -lgtest \
        -lorocos-kdl -lmujoco -lurdfdom_model -lconsole_bridge
      "$folder/adapter_$adapter" --gtest_filter='-*KdlsOwn'
    ) &
    adapters+=($!)
  done
  for adapter in "${adapters[@]}"; do wait "$adapter" || return 1; done

  local failed=0 eigen kdl pin solver program
  : >"$facts/foreign.rows"
  while IFS='|' read -r must flags label; do
    [[ -n $must ]] || continue
    i=$((i + 1))
    echo "-- $flags $label"
    solver=$folder/solver$i.o
    # Two jobs: Pinocchio takes as long as the rest.
    ccache g++-12 "${common[@]}" "${pinocchio[@]}" $flags -c "$source/pinocchio.cpp" \
      -o "$folder/pinocchio$i.o" &
    ccache g++-12 "${common[@]}" $flags -c "$source/solver.cpp" -o "$solver"
    ccache g++-12 "${common[@]}" $flags -c "$source/kdl.cpp" -o "$folder/kdl$i.o"
    ccache g++-12 "${common[@]}" $flags -c "$source/large_product.cpp" -o "$folder/eigen$i.o"
    wait $!
    [[ -n $label ]] && solver=$folder/libapart.so
    g++-12 "$folder/eigen$i.o" -o "$folder/eigen$i"
    g++-12 "$folder/kdl$i.o" "$solver" "-Wl,-rpath,$folder" -lorocos-kdl -o "$folder/kdl$i"
    g++-12 "$folder/pinocchio$i.o" "$solver" "-Wl,-rpath,$folder" "${libraries[@]}" \
      -o "$folder/pinocchio$i"
    eigen=$(outcome "$folder/eigen$i" 2>>"$folder/run.log" | tail -n1)
    kdl=$(outcome "$folder/kdl$i" 2>>"$folder/run.log" | tail -n1)
    pin=$(outcome "$folder/pinocchio$i" 2>>"$folder/run.log" | tail -n1)
    echo "Eigen alone: $eigen; KDL: $kdl; Pinocchio: $pin"
    echo "| ${label:-\`$flags\`} | $eigen | $kdl | $pin |" >>"$facts/foreign.rows"
    for program in "$eigen" "$kdl" "$pin"; do
      [[ $must != yes || $program == works ]] || failed=1
    done
  done <<<"$foreign_variants"
  ((failed == 0))
}

# cross <triple> <processor> <flags> <parts>
cross() {
  need "g++-$1:$1-g++" qemu-user:qemu-aarch64
  user "$work/$name" "$1-g++" "$3" plain "$4" -DCMAKE_SYSTEM_NAME=Linux \
    "-DCMAKE_SYSTEM_PROCESSOR=$2" -DCMAKE_EXE_LINKER_FLAGS=-static
}

# instructions <program> <solves> <float|double>: with one instruction in each block that the
# emulator translates, and no block linked to the next, its trace has a line for each instruction.
instructions() {
  { qemu-aarch64 -singlestep -d nochain,exec -D /dev/fd/3 "$1" "$2" "$3" 3>&1 >&4 |
    grep -c '^Trace'; } 4>&2
}

arm64() {
  cross aarch64-linux-gnu aarch64 -O2 "oracle;message;mission;count"
  local folder=$work/$name scalar kind oracle n=()
  # It takes far longer than all else, which runs beside it: one of its shards ends before the others.
  oracle "$folder" qemu-aarch64 >"$folder/oracle.log" 2>&1 &
  oracle=$!
  trap "wait $oracle" EXIT  # after a failure, too: the next build would run beside it
  qemu-aarch64 "$folder/test_grasp_mission"
  for scalar in double float; do
    n=()
    for kind in vector scalar; do
      n+=($(($(instructions "$folder/count_$kind" 12 $scalar) - \
        $(instructions "$folder/count_$kind" 2 $scalar))))
    done
    echo "instructions of 10 solves each of two hierarchies, $scalar: ${n[*]}"
    ((n[0] < n[1]))  # packets are used
    fact "neon_$scalar" "$(awk "BEGIN { printf \"%.2f\", ${n[1]} / ${n[0]} }")"
  done
  for kind in vector scalar; do
    n=$(aarch64-linux-gnu-objdump -d --no-show-raw-insn "$folder/count_$kind" |
      awk '/<.*>:$/ { f = $2 } f ~ /icat/ && $2 ~ /^fml[as]$/ && $3 ~ /\.(2d|4s)/ { ++k } END { print k + 0 }')
    echo "fmla and fmls on NEON registers in functions of icat, $kind: $n"
    fact "fmla_$kind" "$n"
  done
  qemu-aarch64 "$folder/test_cooperation"
  wait "$oracle" || { cat "$folder/oracle.log" && return 1; }
  cat "$folder/oracle.log"
}

big_endian() {
  cross s390x-linux-gnu s390x -O1 message
  qemu-s390x "$work/$name/test_cooperation"
}

arm32() {
  # `long double` is `double` there: the exact formula that judges float is, too, and double cannot
  # be judged.
  cross arm-linux-gnueabihf armv7l -O2 "oracle;tpik"
  qemu-arm "$work/$name/test_tpik_oracle" --gtest_filter='*SinglePrecision*'
  qemu-arm "$work/$name/test_tpik"
}

# name | function | what
other_builds="
eigen5|eigen5|Eigen $eigen5 (PyPI), g++-12, \`-O2 -march=x86-64-v3\`: headers, examples, all tests of the solver
no-exceptions|no_exceptions|\`-fno-exceptions -fno-rtti\`, g++-12 and clang++-19: the control step, and errors in the user's handler
fast-math|fast_math|\`-ffast-math\` and the like, g++-11, g++-12, clang++-14 and clang++-19: refused by the compiler or by the solver
foreign|foreign|programs beside KDL and Pinocchio: the table below
arm64|arm64|ARM64 (aarch64-linux-gnu-g++ under qemu-aarch64): oracle test, messages, the grasp mission; NEON is used
big-endian|big_endian|big endian (s390x-linux-gnu-g++ under qemu-s390x): messages written by a little-endian machine, and the whole cooperation test
arm32|arm32|32-bit ARM (arm-linux-gnueabihf-g++ under qemu-arm): the solver in float against the literal formula, and the solver's tests"
[[ -x scripts/microcontroller.sh ]] && other_builds+="
microcontroller|microcontroller|Cortex-M: the table below"
microcontroller() { ./scripts/microcontroller.sh; }

# run <name> <function>: in a shell of its own with a log of its own; one line about the outcome.
failures=()
run() {
  local start=$SECONDS state=passes
  name=$1
  rm -f "$facts/$name".*
  # Not as a condition: bash would go on after an error.
  (
    set -euo pipefail
    "$2"
  ) >"$work/$name.log" 2>&1 </dev/null &
  wait $! || state=FAILS
  fact time "$((SECONDS - start)) s"
  fact revision "$revision"
  if [[ $state == passes ]]; then fact state yes; else
    fact state '**no**'
    failures+=("$name")
  fi
  printf '%-16s %-7s %s\n' "$name" "$state" "$(get "$name" time)"
  if [[ $state != passes ]]; then tail -n 20 "$work/$name.log" | sed 's/^/    /'; fi
}

function_of() {
  if grep -q "^$1|" <<<"$x86_builds"; then echo x86; else
    sed -n "s/^$1|\([^|]*\)|.*/\1/p" <<<"$other_builds"
  fi
}

# kept <build>: whether to print its row of the present page, since it was not run here.
kept() { [[ ! -f $facts/$1.state ]] && grep "^| $1 |" docs/portability.md; }

page() {
  cat <<'MD'
# Portability

This page says which compilers, processors, flags and libraries icat was built and run with, and which combinations crash. `./scripts/portability.sh` prints it: it builds and runs each compiler, processor, optimization level and library once, not all combinations. `./scripts/portability.sh --list` prints the names of the builds, and `./scripts/portability.sh gcc12-v3 arm64` runs two of them. Each row names the revision on which it was measured (`+`: with uncommitted changes); `--page` joins the last run of each build, so rows may come from different runs.

## What to know first

**`-march=native` and foreign libraries.** Eigen aligns its memory for the widest packets of the processor that it is compiled for: 16 bytes without options, 32 with AVX, 64 with AVX-512. A library from a package (Pinocchio or KDL) uses 16. A program that is compiled with `-march=native`, `-march=x86-64-v3` or `-mavx` disagrees with that library about the alignment of matrices and about how their memory is freed, and crashes, usually at the first call that passes a matrix. This happens with every library that has Eigen in its interface, with icat or without. icat adds no flags to a program. The [table below](#beside-foreign-libraries) shows what was tried. What works:

- Compile without `-march`, or up to `-march=x86-64-v2`. `-march=native -mno-avx` allows all instructions that need no wide registers.
- Compile everything that has Eigen in its interface, including the foreign library, with the same flags (not tried here).
- Put the control loop into a shared library of its own, compiled with `-march=native -fvisibility=hidden -fvisibility-inlines-hidden` and linked with `-Wl,-Bsymbolic`, and pass plain pointers to numbers: `tests/user_project/foreign/solver.hpp` is an example.

`EIGEN_MAX_ALIGN_BYTES=16` and `EIGEN_MAX_STATIC_ALIGN_BYTES=16` do not help: memory from the heap is still aligned for wide packets. With `EIGEN_MALLOC_ALREADY_ALIGNED=1` on top the small programs run, but Eigen itself crashes in a product of 200 × 200.

**`-ffast-math` is refused.** With `-ffast-math`, `-Ofast` or `-ffinite-math-only` the compiler drops every check for NaN and infinity, and with `-funsafe-math-optimizations` or `-fassociative-math` it reorders sums, on whose order bounds on rounding errors depend. icat does not compile with them and says why, where the compiler tells a program of its flags. GCC before 12 tells nothing of the last two, clang nothing of parts of `-ffast-math` such as `-fno-honor-nans`, and a pragma is never told: there each solver tries when it is constructed whether NaN is seen and sums keep their order, and throws. Not refused, since the same trial finds nothing wrong: clang's `-fno-honor-infinities` and `-fassociative-math` alone, and flags that neither drop checks nor reorder, such as `-fapprox-func`.

**`-fno-exceptions -fno-rtti` is fine.** The control step throws nothing. An error of configuration, which would otherwise throw, calls the handler given to `icat::set_error_handler`, or else `std::abort`.

**GCC before 13 with AVX-512 warns about its own header.** With `-Wall`, `-O1` or more and AVX-512, GCC 11 and 12 report `'__Y'` as uninitialized inside their own intrinsics, wherever Eigen sums up a packet (`Eigen::internal::predux`). Including icat as a system folder does not suppress the warning, since it is in GCC's header. Add `-Wno-uninitialized -Wno-maybe-uninitialized` there, as the builds below do. With AVX at `-O3` they also warn, inside Eigen, that short vectors are read past their end (`-Warray-bounds`, `-Wmaybe-uninitialized`), in loops that do not run that far; build gcc12-v3 switches these two off. No other warning is switched off in them.

## One rule for every build

The oracle test compares the solver with the literal formula in `long double` on 2,080 random hierarchies. An error must be at most 1e-9, or ten times the error of the literal formula itself in `double`. That error depends on the order of its sums, and thus on compiler and flags; the worst of eight orders of rows and columns counts, so that the result does not depend on chance. The same rule holds in every build below. In the few hierarchies beyond 1e-9 the error of the literal formula is about as large: see the last columns.

## x86-64

The examples and the oracle test compile with `-Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror` in a user's project, and, once with each compiler, so does each header alone (gcc11-v1, gcc12-v2, clang14-v1, clang16-v2, clang19-v3; Clang after a precompiled `Eigen/Dense`, so that GCC alone shows that a header includes what it needs). Examples, and headers among the adapters, that need a foreign library are not among them. *plain*: icat's include folder as it is, by `add_subdirectory`; *system*: as an installed package. Eigen is 3.4 here. *Beyond 1e-9* counts hierarchies; *times the literal's* is the largest error among them in units of the literal formula's, at most 10.

| build | compiler | flags | icat as | compiles | oracle test passes | worst relative error | beyond 1e-9 | times the literal's | time | revision |
|---|---|---|---|---|---|---|---|---|---|---|
MD
  local build cxx flags as examples what key
  while IFS='|' read -r build cxx flags as examples; do
    [[ -n $build ]] || continue
    kept "$build" && continue
    echo "| $build | $cxx ($(get "$build" compiler)) | \`$flags\` | $as | $(get "$build" compiles) | $(get "$build" passes) | $(get "$build" worst) | $(get "$build" beyond) | $(get "$build" ratio) | $(get "$build" time) | $(get "$build" revision) |"
  done <<<"$x86_builds"
  cat <<'MD'

The examples of gcc11-v1 are linked, those of gcc12-v1 to gcc12-v4 compiled; the others check them without generating code, before which clang finds all that it warns of.

## Other processors, libraries and flags

| build | what | passes | worst relative error | beyond 1e-9 | times the literal's | time | revision |
|---|---|---|---|---|---|---|---|
MD
  while IFS='|' read -r build _ what; do
    [[ -n $build ]] || continue
    kept "$build" && continue
    printf '| %s | %s | %s ' "$build" "$what" "$(get "$build" state)"
    for key in worst beyond ratio; do
      if [[ -f $facts/$build.$key ]]; then printf '| %s ' "$(get "$build" $key)"; else printf '| - '; fi
    done
    echo "| $(get "$build" time) | $(get "$build" revision) |"
  done <<<"$other_builds"
  echo
  if [[ -f $facts/arm64.state ]]; then
    cat <<MD
**NEON.** The solves of two hierarchies of the benchmarks' shape (13 degrees of freedom, one steady, one with all rows partial) need $(get arm64 neon_double) times as many instructions with \`EIGEN_DONT_VECTORIZE\` as without in \`double\`, $(get arm64 neon_float) times in \`float\`. A NEON register holds two doubles or four floats. Functions of icat contain $(get arm64 fmla_vector) fused multiply-adds on whole NEON registers, without vectorization $(get arm64 fmla_scalar). The instructions are counted as lines of the trace of \`qemu-aarch64 -singlestep -d nochain,exec\`: a run with twelve solves minus a run with two. They are instructions, not time: measure that on the board.
MD
  else
    grep '^\*\*NEON' docs/portability.md
  fi
  cat <<'MD'

**32-bit ARM.** There `long double` is the same as `double`, so the solver in `float` is compared with the literal formula in `double`; the solver in `double` has its own tests.

## Beside foreign libraries

The program, compiled with g++-12, takes Jacobians from the library and velocities from icat, and passes positions back to the library; KDL is from apt, Pinocchio 4.1 from PyPI. *Eigen alone* multiplies matrices of up to 400 × 400 without a foreign library.

| flags of the program | Eigen alone | KDL | Pinocchio |
|---|---|---|---|
MD
  if [[ -f $facts/foreign.state ]]; then
    cat "$facts/foreign.rows"
  else
    sed -n '/^| flags of the program/,/^$/{/^| `/p}' docs/portability.md
  fi
  if [[ -f out/microcontroller/table.md ]]; then
    printf '\n## Microcontrollers\n\nPrinted by `./scripts/microcontroller.sh`.\n\n'
    cat out/microcontroller/table.md
  fi
  printf '\nThe builds of the last run: %s, %s processors, %s min.\n' \
    "$(sed -n '/^model name/{s/^[^:]*: //p;q}' /proc/cpuinfo)" "$(nproc)" \
    "$(for build in $names; do get "$build" time && echo; done | awk '$1 + 0 > 0 { s += $1 } END { print int((s + 59) / 60) }')"
}

# --- main ----------------------------------------------------------------------------------------

names=$(cut -d'|' -f1 <<<"$x86_builds$other_builds" | sed '/^$/d')
if [[ ${1-} == --list ]]; then
  echo "$names"
  exit
elif [[ ${1-} == --page ]]; then
  page
  exit
fi
for build in "$@"; do
  grep -qxF -- "$build" <<<"$names" || fail "no build '$build'; there are: ${names//$'\n'/ }"
done

need cmake:cmake ninja-build:ninja ccache:ccache libeigen3-dev googletest libcli11-dev
[[ ${CXX:-g++} != g++ ]] || need g++:g++
need_compiler
say "Logs: $work"
install_icat >"$work/package.log" 2>&1 || fail "icat does not install ($work/package.log)"
for build in ${*:-$names}; do
  run "$build" "$(function_of "$build")"
done

if (($# == 0)); then
  ((SECONDS < 3600 || $(nproc) < 2)) || failures+=("all together: longer than an hour")
  mkdir -p "$out"
  page >"$out/portability.md"
  cat "$out/portability.md"
  say "Results: $out"
fi
((${#failures[@]} == 0)) || fail "these builds fail: ${failures[*]}"
