# SPDX-License-Identifier: BSD-3-Clause
# The tray's way from the front and from above, and the errors. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/run.csv'
set terminal pngcairo size 1200,560 font 'sans,11' background 'white'
set output folder.'/tray.png'
set multiplot layout 1,3 margins 0.06,0.98,0.11,0.93 spacing 0.07,0.1
set size ratio -1
set title 'tray, from behind'
set key at graph 1,1.35
set xlabel 'y (m)'
set ylabel 'z (m)'
set xrange [0.6:-0.6]
plot csv using 6:7 with lines lw 5 lc rgb '#cccccc' title 'asked', csv using 3:4 with lines lw 2 lc rgb '#d62728' title 'tray'
set key default
set size noratio
set autoscale
set xrange [0:40]
set title 'torso'
set xlabel 't (s)'
set ylabel 'rad, m'
plot csv using 1:8 with lines lw 2 lc rgb '#1f77b4' title 'turn (rad)', csv using 1:9 with lines lw 2 lc rgb '#ff7f0e' title 'rise (m)'
set title 'errors'
set ylabel 'm, rad'
set logscale y
set format y '10^{%T}'
set yrange [1e-8:10]
plot csv using 1:($10>1e-9?$10:1e-9) with lines lw 2 lc rgb '#9467bd' title 'hand on tray (m)', \
  csv using 1:($11>1e-9?$11:1e-9) with lines lw 2 lc rgb '#2ca02c' title 'tilt (rad)', \
  csv using 1:($12>1e-9?$12:1e-9) with lines lw 2 lc rgb '#d62728' title 'tray off its loop (m)'
unset multiplot
