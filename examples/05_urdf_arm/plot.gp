# SPDX-License-Identifier: BSD-3-Clause
# Error, manipulability, joint speed over time. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/run.csv'
set terminal pngcairo size 1200,700 font 'sans,11' background 'white'
set output folder.'/arm.png'
set multiplot layout 3,1 margins 0.08,0.98,0.09,0.96 spacing 0.05,0.06
set xrange [0:60]
set format x ''
set logscale y
set format y '10^{%T}'
set ylabel 'off the goal (m, rad)'
set yrange [1e-6:2]
plot csv using 1:($2>1e-9?$2:1e-9) with lines lw 2 lc rgb '#d62728' title 'position', csv using 1:($3>1e-9?$3:1e-9) with lines lw 2 lc rgb '#9467bd' title 'orientation'
set ylabel 'manipulability'
set autoscale y
plot csv using 1:4 with lines lw 2 lc rgb '#1f77b4' notitle
unset logscale y
set format y '%g'
set format x '%g'
set xlabel 't (s)'
set ylabel 'fastest joint (rad/s)'
plot csv using 1:5 with lines lw 2 lc rgb '#2ca02c' notitle
unset multiplot
