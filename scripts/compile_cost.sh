#!/usr/bin/env bash
# Compile time of user programs, as multiples of an include of Eigen/Dense alone: a Markdown table. A
# processor's clock drifts within a run, so the include is compiled right before each file, and the
# quotient of the two user times counts, the median of three. With --check a bound is exceeded where
# each of four quotients is more than 15 % above it, which is how far the same file differs from
# machine to machine: a bare Tpik took 2.60 times the include on one, 2.99 times on another, by the
# same compiler. With --instructions the compiler's instructions are counted, which do not differ from
# run to run: twenty minutes, and a bound may be exceeded by 5 %. The bounds are for g++. The command
# line and the replay of the examples are not in it: they are compiled once, in examples/support.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

check=false instructions=false tries="1 2 3" margin=1.15 unit=s
case ${1:-} in
  --check) check=true tries="1 2 3 4" ;;
  --instructions) check=true instructions=true tries=1 margin=1.05 unit="G instructions" ;;
esac
need g++:g++ libeigen3-dev time:/usr/bin/time
! $instructions || need valgrind:valgrind
CXX=g++ # whose bounds they are
need_compiler
sources=build/compile_cost
mkdir -p "$sources"
echo '#include <Eigen/Dense>' >"$sources/dense.cpp"
echo '#include <icat/icat.hpp>' >"$sources/icat.cpp"
eigen=${EIGEN3_INCLUDE_DIR:-/usr/include/eigen3}
[[ -d $eigen ]] || fail "no Eigen in $eigen: name its folder in EIGEN3_INCLUDE_DIR"

# compile <file> <flags>...: user seconds and megabytes, or instructions / 1e9 and 0
compile() {
  local file=$1
  shift
  if $instructions; then
    "$CXX" -std=c++20 "$@" -DICAT_PLOT_SCRIPT='""' -Iinclude -isystem "$eigen" -S "$file" \
      -o "$work/object.s" -wrapper valgrind,--tool=callgrind,--callgrind-out-file=/dev/null \
      2>"$work/count" || return
    awk '/Collected/ { print $NF / 1e9, 0 }' "$work/count"
    return
  fi
  /usr/bin/time -f '%U %M' -o "$work/time" "$CXX" -std=c++20 "$@" -DICAT_PLOT_SCRIPT='""' \
    -Iinclude -isystem "$eigen" -c "$file" -o "$work/object.o" >&2 || return
  tail -n1 "$work/time"
}
# row <what> <file> <flags> <times, or -> <megabytes, or ->
failures=0
row() {
  local i d s kilobytes ratio seconds megabytes pairs='' met=no
  ! $check || [[ $4 != - ]] || return 0
  for i in $tries; do
    read -r d _ < <(compile "$sources/dense.cpp" $3)
    read -r s kilobytes < <(compile "$2" $3)
    [[ -n $d && -n $s ]] || fail "$2 does not compile with $3"
    pairs+=$(awk -v d="$d" -v s="$s" -v k="$kilobytes" 'BEGIN { print s / d, s, k / 1024 }')$'\n'
    if $check; then
      read -r ratio seconds megabytes < <(sort -g <<<"${pairs%$'\n'}" | head -n1)
      within "$ratio" "$4" "$megabytes" "$5" "$margin" && break
    fi
  done
  $check || read -r ratio seconds megabytes < <(sort -g <<<"${pairs%$'\n'}" | sed -n 2p)
  within "$ratio" "$4" "$megabytes" "$5" "$margin" || failures=$((failures + 1))
  within "$ratio" "$4" "$megabytes" "$5" 1 && met=yes || met="**no**"
  local bound="≤ $4 ×"
  [[ $4 != - ]] || bound=–
  [[ $5 == - ]] || $instructions || bound+=", ≤ $5 MB"
  printf '| `%s`, `%s` | %s | %.2f × (%.2f %s)%s | %s |\n' "$1" "$3" "$bound" "$ratio" "$seconds" "$unit" \
    "$($instructions || printf ', %.0f MB' "$megabytes")" "$met"
}
# within <quotient> <bound, or -> <megabytes> <bound, or -> <margin of the quotient's bound>
within() {
  awk -v r="$1" -v b="$2" -v m="$3" -v c="$4" -v margin="$5" \
    'BEGIN { exit !((b == "-" || r <= margin * b) && (c == "-" || m <= c)) }'
}

# rows <flags>
rows() {
  local flags=$1 reach=(6 -) work=$sources/${1//[^A-Za-z0-9]/} # of its own: two may run at a time
  [[ $flags != -O0 ]] || reach=(4 400)
  mkdir -p "$work"
  row '#include <icat/icat.hpp>' "$sources/icat.cpp" "$flags" - -
  row 'Tpik<double, 13>' benchmarks/compile_cost/bare_tpik.cpp "$flags" 2.5 -
  row 00_reach examples/00_reach/main.cpp "$flags" "${reach[@]}"
  row 01_grasp examples/01_grasp/main.cpp "$flags" 9 -
  return "$failures"
}

echo "| compiling, as a multiple of \`#include <Eigen/Dense>\` | bound | measured | met |"
echo "|---|---|---|---|"
# Side by side where a check is in a hurry: both of a quotient's times are then of a busy machine.
if $check; then
  rows -O0 & pid=$!
  rows "-O2 -DNDEBUG" || failures=$?
  wait "$pid" || failures=$((failures + $?))
else
  for flags in -O0 "-O2 -DNDEBUG"; do rows "$flags" || true; done
fi
if $check && ((failures)); then
  fail "$failures of the bounds on compile time or memory are exceeded"
fi
