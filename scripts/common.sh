# Sourced by the other scripts: what they share. Leaves the working directory at the project's root.
set -euo pipefail
export LC_ALL=C # numbers with a point
cd -P -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
[[ ! -d build || -w build ]] || {
  echo "error: $PWD/build belongs to somebody else: remove it" >&2
  exit 1
}

say() { printf '== %s\n' "$*"; }

fail() {
  printf 'error: %s\n' "$*" >&2
  exit 1
}

# is_there <what>: 'package', or 'package:command' where the command is what counts.
is_there() {
  if [[ $1 == *:* ]]; then
    command -v "${1#*:}" >/dev/null
  elif command -v dpkg-query >/dev/null; then
    [[ " $(dpkg-query -W -f='${db:Status-Status} ' "$1" 2>/dev/null)" == *" installed "* ]]
  fi # elsewhere CMake finds the library, or says that it is missing
}

# need <what>...: installs what is not there.
need() {
  local what missing=()
  for what in "$@"; do
    is_there "$what" || missing+=("${what%%:*}")
  done
  if ((${#missing[@]})); then
    apt_install "${missing[@]}"
  fi
}

apt_install() {
  local as_root=() log=build/apt.log reason
  command -v apt-get >/dev/null ||
    fail "missing: $*; install them, since this system has no apt-get"
  if ((EUID != 0)); then
    command -v sudo >/dev/null ||
      fail "missing: $*; installing them needs root or sudo"
    # A terminal can ask for the password, nothing else can.
    if [[ -t 0 ]]; then sudo -v; else sudo -n true 2>/dev/null; fi ||
      fail "missing: $*; sudo refused to install them"
    as_root=(sudo)
  fi
  local apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive
    apt-get -q -o DPkg::Lock::Timeout=120)
  update_and_install() {
    # A failed update matters only when a package cannot be had after it.
    "${apt[@]}" update || true
    "${apt[@]}" -o APT::Status-Fd=1 install -y --no-install-recommends "$@"
  }
  local title="Installing $*"
  ((${#title} <= 56)) || title=${title:0:53}... # with the bar, a line of a terminal
  step "$title" "$PWD/$log" update_and_install "$@" || {
    reason=$(grep -m1 -E '^(W: Failed to fetch|E:) ' "$log" || tail -n1 "$log")
    fail "apt could not install $*: ${reason#[EW]: } (log: $PWD/$log)"
  }
}

# python_tools: an environment of Python of the project's own.
venv=$PWD/build/venv
python_tools() {
  need python3:python3
  mkdir -p build
  [[ -x $venv/bin/pip ]] || python3 -m venv "$venv" >/dev/null || {
    need python3-venv
    python3 -m venv "$venv"
  }
}

# npm_peers: the packages of tests/hardware/package.json go to build/node.
npm_peers() {
  mkdir -p build/node
  cp tests/hardware/package.json build/node/
  npm install --prefix build/node --no-audit --no-fund --no-package-lock
}

# need_pinocchio: Pinocchio with the headers of its urdfdom, from PyPI.
need_pinocchio() {
  python_tools
  "$venv/bin/pip" install -q --disable-pip-version-check pin==4.1.0 cmeel-urdfdom-headers==3.0.0 ||
    fail "pip could not install Pinocchio"
}

# need_robot_data: the URDF files of example-robot-data, from PyPI, without their meshes.
need_robot_data() {
  local version=6.0.0 folder=build/robot_data wheel=build/wheel
  [[ ! -f $folder/$version ]] || return 0
  python_tools
  "$venv/bin/pip" download -q --disable-pip-version-check --no-deps -d "$wheel" \
    "example-robot-data==$version" || fail "pip could not download example-robot-data"
  rm -rf "$folder"
  "$venv/bin/python" - "$wheel" "$folder" <<'PYTHON'
import glob, os, sys, zipfile
wheel, folder = sys.argv[1:]
with zipfile.ZipFile(glob.glob(wheel + "/example_robot_data-*.whl")[0]) as files:
    for name in files.namelist():
        if name.endswith(".urdf"):
            path = os.path.join(folder, name.split("/robots/", 1)[1])
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with open(path, "wb") as out:
                out.write(files.read(name))
PYTHON
  rm -rf "$wheel"
  touch "$folder/$version"
}

# Stops when the compiler or CMake is too old; CXX chooses another compiler.
need_compiler() {
  export CXX=${CXX:-g++}
  local version
  command -v "$CXX" >/dev/null ||
    fail "no compiler '$CXX': CXX is the name or the path of one program"
  "$CXX" -fsyntax-only -x c++ - 2>/dev/null <<<'#include <vector>' ||
    fail "$CXX finds no C++ library (g++ has one: unset CXX)"
  "$CXX" -std=c++20 -fsyntax-only -x c++ - 2>/dev/null <<'CPP' ||
#include <concepts>
#if defined(__clang__) ? __clang_major__ < 14 : __GNUC__ < 11
#error too old
#endif
CPP
    fail "$CXX $("$CXX" -dumpversion) is too old: icat needs g++ >= 11 or clang++ >= 14 (set CXX)"
  version=$(cmake --version | sed -n '1s/[^0-9]*//p')
  [[ $(printf '%s\n' 3.22 "$version" | sort -V | head -n1) == 3.22 ]] ||
    fail "CMake $version is too old: icat needs 3.22"
}

# need_sanitizers: where those of clang are a package of their own, it carries the version in its name.
need_sanitizers() {
  mkdir -p build
  clang++ -fsanitize=address,undefined -x c++ - -o build/sanitizer_probe \
    2>/dev/null <<<'int main() {}' || need "libclang-rt-$(clang++ -dumpversion | cut -d. -f1)-dev"
}

# Parallel jobs: one per processor, if each has the 1.5 GB that a file full of Eigen may need.
parallel_jobs() {
  local by_memory by_cpu
  by_memory=$(awk '/^MemTotal:/ { print int($2 / 1500000) }' /proc/meminfo)
  by_cpu=$(nproc)
  echo $((by_memory < 1 ? 1 : by_memory < by_cpu ? by_memory : by_cpu))
}

# log_tail <file>: its last lines, for an error that the file explains.
log_tail() {
  tail -n 30 "$1" >&2
  printf 'log: %s\n' "$1" >&2
}

# step <title> <log> <command>...: one line; the command's output goes to the log and is shown on
# failure alone. On a terminal Ninja's [k/n] and apt's percentages move a bar.
step() {
  local title=$1 log=$2 line done all start=$SECONDS
  shift 2
  mkdir -p "$(dirname -- "$log")"
  if [[ -t 1 ]]; then
    printf '== %s' "$title"
    if ! "$@" 2>&1 </dev/null | tee "$log" | while IFS= read -r line; do
      if [[ $line =~ ^\[([0-9]+)/([1-9][0-9]*)\] ]]; then
        done=$((10#${BASH_REMATCH[1]})) all=${BASH_REMATCH[2]}
      elif [[ $line =~ ^(dl|pm)status:[^:]*:([0-9]+) ]]; then
        done=$((10#${BASH_REMATCH[2]})) all=100
      else
        continue
      fi
      printf '\r== %s [%-20.*s]' "$title" $((20 * done / all)) '####################'
    done; then
      printf '\n'
      log_tail "$log"
      return 1
    fi
    printf '\r\033[K'
  elif ! "$@" >"$log" 2>&1 </dev/null; then
    log_tail "$log"
    return 1
  fi
  say "$title ($((SECONDS - start)) s)"
}

# So that ccache keeps what is compiled with the precompiled headers of the tests.
export CCACHE_SLOPPINESS=pch_defines,time_macros

# build <preset> [<target>...]: configures and builds, all or the targets named.
build() {
  local targets=("${@:2}")
  local cache=build/$1/CMakeCache.txt
  # A folder that was configured elsewhere (a moved or copied clone), or whose programs another
  # compiler builds, is of no use.
  local compiler=build/$1.compiler
  mkdir -p build
  if [[ -f $cache ]] && ! { grep -qxF "CMAKE_HOME_DIRECTORY:INTERNAL=$PWD" "$cache" &&
    [[ $(cat "$compiler" 2>/dev/null) == "$("$CXX" --version)" ]]; }; then
    rm -rf -- "build/$1"
  fi
  "$CXX" --version >"$compiler"
  step "Configuring: $1" "$PWD/build/$1.configure.log" cmake --preset "$1" ||
    fail "CMake could not configure '$1'"
  step "Building: $1" "$PWD/build/$1.build.log" \
    cmake --build --preset "$1" --parallel "$(parallel_jobs)" \
    ${targets[@]:+--target "${targets[@]}"} || fail "'$1' does not build"
}
