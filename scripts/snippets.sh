#!/usr/bin/env bash
# Writes the code that the Markdown pages show, from the sources that they name above each block.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

cmake -DUPDATE=ON -P tests/documentation.cmake
