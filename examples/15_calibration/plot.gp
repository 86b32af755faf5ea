# SPDX-License-Identifier: BSD-3-Clause
# Error over range by parameters from the air and from the water. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/range.csv'
set terminal pngcairo size 760,440 font 'sans,11' background 'white'
set output folder.'/range.png'
set xlabel 'range (m)'
set ylabel 'error of a point, rms (mm)'
set logscale y
set format y '%g'
set key bottom right
plot csv using 1:(1000*$2) with lines lw 2 dt 2 lc rgb '#d62728' title 'in-air, in the camera', \
  csv using 1:(1000*$3) with linespoints lw 2 pt 7 lc rgb '#d62728' title 'in-air, on the arm', \
  csv using 1:(1000*$4) with lines lw 2 dt 2 lc rgb '#1f77b4' title 'in-water, in the camera', \
  csv using 1:(1000*$5) with linespoints lw 2 pt 7 lc rgb '#1f77b4' title 'in-water, on the arm'
