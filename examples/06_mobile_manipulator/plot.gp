# SPDX-License-Identifier: BSD-3-Clause
# From above: wall, base, brush; and what is left of the errors. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/run.csv'
set terminal pngcairo size 1200,560 font 'sans,11' background 'white'
set output folder.'/paint.png'
set multiplot layout 1,2 margins 0.06,0.97,0.11,0.93 spacing 0.09,0.1
set size ratio -1
set title 'from above'
set xlabel 'x (m)'
set ylabel 'y (m)'
set xrange [-1:5]
set yrange [-1:5]
set key left top
set samples 400
set parametric
set trange [0:1.6]
plot 4.03*cos(t),4.03*sin(t) with lines lw 6 lc rgb '#bbbbbb' title 'wall', \
  csv using 2:3 with lines lw 2.5 lc rgb '#d62728' title 'brush', \
  csv using 5:6 with lines lw 2.5 lc rgb '#1f77b4' title 'chassis', \
  csv using 5:6:(0.25*cos($7)):(0.25*sin($7)) every 250 with vectors lw 2 lc rgb '#1f77b4' notitle
unset parametric
set size noratio
set title 'errors of the brush'
set xlabel 't (s)'
set ylabel 'm, rad'
set logscale y
set format y '10^{%T}'
set yrange [1e-5:2]
set xrange [0:40]
set key right top
plot csv using 1:($8>1e-12?$8:1e-12) with lines lw 2 lc rgb '#d62728' title 'position (m)', \
  csv using 1:($9>1e-12?$9:1e-12) with lines lw 2 lc rgb '#2ca02c' title 'axis against normal (rad)'
unset multiplot
