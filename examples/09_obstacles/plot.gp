# SPDX-License-Identifier: BSD-3-Clause
# The tool's way from above, and the distances. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/run.csv'
set terminal pngcairo size 1200,520 font 'sans,11' background 'white'
set output folder.'/obstacles.png'
set multiplot layout 1,2 margins 0.06,0.98,0.11,0.93 spacing 0.09,0.1
set size ratio -1
set title 'tool from above'
set xlabel 'x (m)'
set ylabel 'y (m)'
set xrange [-0.6:1.1]
set yrange [-0.8:0.8]
h = 0.08
c = cos(0.4)
s = sin(0.4)
set object 1 polygon from 0.6+h*c-h*s,h*s+h*c to 0.6-h*c-h*s,-h*s+h*c to 0.6-h*c+h*s,-h*s-h*c to 0.6+h*c+h*s,h*s-h*c to 0.6+h*c-h*s,h*s+h*c fs solid 0.4 fc rgb '#888888'
plot csv using 2:3 with lines lw 2 lc rgb '#d62728' title 'tool', \
  csv using 5:6 every 100 with points pt 2 ps 1.5 lc rgb '#000000' title 'goals', \
  csv using (0.35):10 with lines lw 6 lc rgb '#b0d0ff' title 'ball, above'
unset object 1
set size noratio
set title 'smallest distances'
set xlabel 't (s)'
set ylabel 'distance (m)'
set xrange [0:44]
set yrange [0:0.4]
plot csv using 1:7 with lines lw 2 lc rgb '#1f77b4' title 'to obstacles', \
  csv using 1:8 with lines lw 2 lc rgb '#ff7f0e' title 'to itself', \
  0.02 with lines dt 2 lc rgb '#555555' title 'asked: 0.02'
unset multiplot
