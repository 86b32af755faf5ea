# SPDX-License-Identifier: BSD-3-Clause
# The tray's way from behind, the torso, and the errors. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/run.csv'
set terminal pngcairo size 1200,480 font 'sans,11' background 'white'
set output folder.'/tray.png'
set multiplot
set size ratio -1 0.36,1
set origin 0,0
set title 'tray, from behind'
set xlabel 'y (m)'
set ylabel 'z (m)'
set xrange [0.6:-0.6]
set yrange [0.7:1.6]
plot csv using 6:7 with lines lw 5 lc rgb '#cccccc' title 'asked', \
  csv using 3:4 with lines lw 2 lc rgb '#d62728' title 'tray'
set size noratio 0.32,1
set origin 0.36,0
set xrange [0:40]
set yrange [-0.8:1]
set title 'torso'
set xlabel 't (s)'
set ylabel 'rad, m'
plot csv using 1:8 with lines lw 2 lc rgb '#1f77b4' title 'turn (rad)', \
  csv using 1:9 with lines lw 2 lc rgb '#ff7f0e' title 'rise (m)'
set origin 0.68,0
set title 'errors'
set ylabel 'm, rad'
set logscale y
set format y '10^{%T}'
set yrange [1e-8:1]
plot csv using 1:($10>1e-9?$10:1e-9) with lines lw 2 lc rgb '#9467bd' title 'hand on tray (m)', \
  csv using 1:($11>1e-9?$11:1e-9) with lines lw 2 lc rgb '#2ca02c' title 'tilt (rad)', \
  csv using 1:($12>1e-9?$12:1e-9) with lines lw 2 lc rgb '#d62728' title 'tray off its loop (m)'
unset multiplot
