# Sourced after scripts/common.sh by the scripts here: peers and their environments, in build/peers.
work=$PWD/build/peers
problems=$work/problems
mkdir -p "$work"

# have <peer> <requirement>...: into its environment. Wheels alone: nothing is built.
have() {
  local peer=$1 environment=$work/$1
  shift
  [[ ! -f $environment/installed || $(cat "$environment/installed") != "$*" ]] || return 0
  say "Installing $peer"
  rm -rf "$environment"
  python3 -m venv "$environment" &&
    "$environment/bin/pip" install -q --disable-pip-version-check --only-binary :all: "$@" \
      >"$work/$peer.log" 2>&1 </dev/null &&
    echo "$*" >"$environment/installed"
}

# have_peer <peer>: with the versions that the pages tell of.
have_peer() {
  case $1 in
    placo) have placo placo==0.10.2 ;;
    pink) have pink pin-pink==4.4.0 pin==4.1.0 quadprog==0.1.14 ;;
    mink) have mink mink==1.3.0 mujoco==4.0.0 ;;
    # The wheels of tsid 1.10.0 crash with those of Pinocchio 4.0 and 4.1.
    tsid) have tsid tsid==1.7.1 pin==3.4.0 'cmeel-urdfdom<5' 'cmeel-tinyxml2<11' ;;
  esac
}

# find_libraries: what compiler and linker are told of the libraries of C++, once they are installed.
find_libraries() {
  read -ra icat_flags <<<"$(pkg-config --cflags eigen3 urdfdom console_bridge)"
  read -ra icat_libraries <<<"$(pkg-config --libs urdfdom console_bridge)"
  read -ra kdl_flags <<<"$(pkg-config --cflags eigen3 orocos-kdl)"
}

# cxx <program> <flag>...: into build/peers.
cxx() {
  local program=$1
  shift
  step "Building $program" "$work/$program.log" \
    "$CXX" -std=c++20 -O3 -DNDEBUG "$@" -o "$work/$program" || fail "$program does not build"
}
