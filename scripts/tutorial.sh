#!/usr/bin/env bash
# The steps of docs/tutorial.md, each as it should be and with one line broken. tutorial.sh <n>: step n.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

need g++:g++ cmake:cmake ninja-build:ninja libeigen3-dev libcli11-dev libjs-three
need_compiler
build demo tutorial
echo
build/demo/examples/tutorial/tutorial ${1:+--step "$1"}
