#!/usr/bin/env bash
# The campaigns of grasps at full length: 300 attempts each, ablations included. When started again
# it continues where it was stopped.
#   scripts/campaign.sh [attempts]               threads of one program
#   scripts/campaign.sh [attempts] parallel [n]  n parts by GNU parallel
#   scripts/campaign.sh [attempts] mpi [n]       n parts by Open MPI's mpirun
# ICAT_CAMPAIGN names a program that is already built, ICAT_OUTPUT the folder of the results.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

attempts=${1:-300} how=${2:-threads} parts=${3:-$(nproc)}
program=${ICAT_CAMPAIGN:-build/demo/examples/16_maris_campaign}
output=${ICAT_OUTPUT:-out/16_maris_campaign}
if [[ -z ${ICAT_CAMPAIGN:-} ]]; then
  need g++:g++ cmake:cmake ninja-build:ninja libeigen3-dev libcli11-dev gnuplot-nox:gnuplot
  need_compiler
  build demo 16_maris_campaign
fi

part=("$program" --attempts "$attempts" --jobs 1 --no-pictures --output "$output")
case $how in
  threads) "$program" --attempts "$attempts" --output "$output" ;;
  parallel)
    need parallel:parallel
    seq "$parts" | parallel -q --will-cite -j "$(nproc)" "${part[@]}" --shard "{}/$parts" ||
      fail "a part failed"
    "$program" --merge --output "$output"
    ;;
  mpi)
    need openmpi-bin:mpirun
    # Any batch system that numbers its processes will do.
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
    # shellcheck disable=SC2016 # the variables are those of each process
    mpirun --oversubscribe --bind-to none -n "$parts" bash -c \
      'exec "$@" --shard "$((OMPI_COMM_WORLD_RANK + 1))/$OMPI_COMM_WORLD_SIZE"' part "${part[@]}" ||
      fail "a part failed"
    "$program" --merge --output "$output"
    ;;
  *) fail "the second argument must be threads, parallel or mpi, got $how" ;;
esac
