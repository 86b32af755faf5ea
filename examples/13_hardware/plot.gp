# SPDX-License-Identifier: BSD-3-Clause
# The tool's error and what was commanded, one below the other. The program sets: folder, back_end.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/run.csv'
array colour[7] = ['#1f77b4', '#ff7f0e', '#2ca02c', '#d62728', '#9467bd', '#8c564b', '#17becf']
set terminal pngcairo size 1200,760 font 'sans,11' background 'white'
set output folder.'/run.png'
set multiplot layout 3,1 margins 0.08,0.83,0.07,0.95 spacing 0.05,0.06
set key outside right top
set title 'tool to its goal, moved by: '.back_end
set ylabel 'tool error (m, rad)'
set logscale y
set format y '10^{%L}'
plot csv using 't':'position_error' with lines lw 2 lc rgb colour[1] title 'position', \
  csv using 't':'orientation_error' with lines lw 2 lc rgb colour[2] title 'orientation', \
  csv using 't':(column('healthy') > 0 ? NaN : 1e-3) with points pt 7 ps 0.4 lc rgb '#d62728' title 'not healthy'
unset logscale y
unset title
set format y '%g'
set ylabel 'joints (rad/s)'
plot for [i=1:7] csv using 't':'c'.i with lines lw 2 lc rgb colour[i] title 'joint '.i
set ylabel 'vehicle (m/s, rad/s)'
set xlabel 't (s)'
plot for [i=1:4] csv using 't':(column(word('surge sway heave yaw_rate', i))) with lines lw 2 lc rgb colour[i] \
  title word("surge sway heave 'yaw rate'", i)
unset multiplot
