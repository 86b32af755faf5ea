# SPDX-License-Identifier: BSD-3-Clause
# Steps of the surge velocity, and a turn on the spot, in a current. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/step.csv'
set terminal pngcairo size 1200,400 font 'sans,10' background 'white'
set output folder.'/step.png'
set multiplot layout 1,3 margins 0.05,0.985,0.13,0.92 spacing 0.055,0.1
set xlabel 't (s)' offset 0,0.5
set key bottom right samplen 2
set xrange [0:12]
set yrange [0:*]
set title 'surge, step of 0.2 m/s (m/s)'
plot 0.2 with lines lw 1 dt 2 lc rgb '#888888' notitle, \
  csv using 1:6 with lines lw 2 dt 3 lc rgb '#ff7f0e' title 'PI alone, 30 % more mass', \
  csv using 1:3 with lines lw 2 lc rgb '#ff7f0e' title 'PI alone', \
  csv using 1:4 with lines lw 2 dt 3 lc rgb '#1f77b4' title 'with feed-forward, 30 % more mass', \
  csv using 1:2 with lines lw 2 lc rgb '#1f77b4' title 'with feed-forward'
set title 'surge, step beyond the thrusters (m/s)'
plot 0.5 with lines lw 1 dt 2 lc rgb '#888888' notitle, \
  csv using 1:9 with lines lw 2 lc rgb '#ff7f0e' title 'achieved thrust not told', \
  csv using 1:8 with lines lw 2 lc rgb '#1f77b4' title 'told'
set xrange [0:30]
set key top left
set title 'turning on the spot: off its place (mm)'
plot csv using 1:(1e3*$10) with lines lw 2 lc rgb '#ff7f0e' title 'current not told', \
  csv using 1:(1e3*$11) with lines lw 2 lc rgb '#1f77b4' title 'told'
unset multiplot
