#!/usr/bin/env bash
# One job in icat and in its peers (same_job/): the table of docs/coming_from.md, which must have it.
source "$(dirname -- "${BASH_SOURCE[0]}")/../../scripts/common.sh"
source benchmarks/peers/common.sh

need g++:g++ pkg-config:pkg-config libeigen3-dev liburdfdom-dev liborocos-kdl-dev libkdl-parser-dev
need_compiler
python_tools
need_robot_data
export PYTHONDONTWRITEBYTECODE=1 # none beside the sources

home=benchmarks/peers/same_job
folder=$work/same_job
rm -rf "$folder"
mkdir -p "$folder" out/benchmarks
python3 benchmarks/peers/problems.py build/robot_data "$problems"
urdf=$problems/panda.urdf

find_libraries
cxx same_job_icat "${icat_flags[@]}" -Iinclude $home/icat_job.cpp "${icat_libraries[@]}"
cxx same_job_kdl "${kdl_flags[@]}" $home/kdl_job.cpp -lkdl_parser -lorocos-kdl
"$work/same_job_kdl" "$urdf" $home/scenarios.txt "$folder" || fail "KDL does not come to its end"
for name in pink mink placo tsid; do
  have_peer "$name" || fail "pip could not install $name ($work/$name.log)"
  "$work/$name/bin/python" "$home/${name}_job.py" "$urdf" $home/scenarios.txt "$folder" \
    >"$work/$name.job.log" 2>&1 || { log_tail "$work/$name.job.log"; fail "$name does not come to its end"; }
  say "$name $(cat "$folder/$name.version")"
done
table=out/benchmarks/same_job.md
"$work/same_job_icat" "$urdf" $home/scenarios.txt "$folder" pink mink placo tsid KDL >"$table" ||
  fail "icat does not do the job"
cat "$table"
python3 - "$table" docs/coming_from.md <<'PYTHON' || fail "docs/coming_from.md has another table"
import sys
table, page = (open(name).read() for name in sys.argv[1:])
sys.exit(table not in page)
PYTHON
