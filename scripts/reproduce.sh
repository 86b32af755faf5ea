#!/usr/bin/env bash
# Everything of one paper again: runs the examples that belong to it and writes a page that lays
# what they yield beside what the paper prints, table by table, figure by figure.
#   scripts/reproduce.sh coop               two vehicles, one pipe [Coop]
#   scripts/reproduce.sh nsb                a vehicle with two arms [NSB]
#   scripts/reproduce.sh maris [attempts]   46 grasps [MARIS]; 300 of each campaign, goes on where it
#                                           was stopped
#   scripts/reproduce.sh docs               the pages of what was run become those of docs/
# ICAT_EXAMPLES names a folder of programs that are built already, ICAT_OUTPUT the folder.
source "$(dirname -- "${BASH_SOURCE[0]}")/common.sh"

paper=${1:-} attempts=${2:-300}
output=${ICAT_OUTPUT:-out/reproduce}
packages=(g++:g++ cmake:cmake ninja-build:ninja libeigen3-dev libcli11-dev gnuplot-nox:gnuplot
  python3:python3 libjs-three)
case $paper in
  coop) programs=(02_cooperative_mission 04_table3) ;;
  nsb) programs=(03_nsb_dual_arm) ;;
  maris)
    # The campaign first: it is what may be stopped and gone on with.
    programs=(16_maris_campaign 01_grasp 10_navigation 11_vehicle_loop 12_velocity_feedback
      14_perception 15_calibration 17_hand)
    packages+=(libopencv-dev)
    [[ $attempts =~ ^[1-9][0-9]*$ ]] || fail "attempts: a number > 0, got $attempts"
    ;;
  docs)
    for page in "$output"/*/reproduce_*.md; do
      [[ -f $page ]] || fail "nothing was run: there is no page in $output"
      name=$(basename "$(dirname "$page")")
      python3 -B "scripts/reproduce/$name.py" "$output/$name" docs || fail "$name has no page"
    done
    exit
    ;;
  *) fail "there are the papers coop, nsb and maris, got '$paper'" ;;
esac

examples=${ICAT_EXAMPLES:-build/demo/examples}
if [[ -z ${ICAT_EXAMPLES:-} ]]; then
  need "${packages[@]}"
  need_compiler
  build demo "${programs[@]}"
fi

folder=$output/$paper
for program in "${programs[@]}"; do
  report=$folder/$program/report.txt
  if [[ $program == 16_maris_campaign ]]; then
    say "Running and drawing: $program, $attempts attempts of each campaign"
    mkdir -p "$folder/$program"
    ICAT_CAMPAIGN=$examples/$program ICAT_OUTPUT=$folder/$program \
      ./scripts/campaign.sh "$attempts" >"$report" || { log_tail "$report"; fail "$program failed"; }
  else
    rm -rf -- "${folder:?}/$program"
    step "Running and drawing: $program" "$report" \
      "$examples/$program" --output "$folder/$program" || fail "$program failed"
  fi
done
python3 -B "scripts/reproduce/$paper.py" "$folder" "$folder" || fail "no page of $paper"
say "Ours beside the paper's: $folder/reproduce_$paper.md"
