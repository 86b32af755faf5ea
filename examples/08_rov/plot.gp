# SPDX-License-Identifier: BSD-3-Clause
# The hull's tilt and the tool's error with and without the measured rates. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/run.csv'
set terminal pngcairo size 1200,560 font 'sans,11' background 'white'
set output folder.'/hold.png'
set multiplot layout 1,2 margins 0.07,0.98,0.11,0.93 spacing 0.09,0.1
set xrange [0:40]
set xlabel 't (s)'
set title 'tilt of the hull'
set ylabel 'deg'
plot csv using 1:($2==1?$4*57.2958:1/0) with lines lw 2 lc rgb '#1f77b4' notitle
set title 'tool off the valve'
set ylabel 'mm'
set logscale y
set yrange [0.01:500]
plot csv using 1:($2==0?1e3*$3:1/0) with lines lw 2 lc rgb '#ff7f0e' title 'roll and pitch taken for still', \
  csv using 1:($2==1?1e3*$3:1/0) with lines lw 2 lc rgb '#2ca02c' title 'with the measured rates'
unset multiplot
