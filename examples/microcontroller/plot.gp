# SPDX-License-Identifier: BSD-3-Clause
# Joints on the host and on the Cortex-M7; what differs, on both processors. Set: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/cycles.csv'
array colour[7] = ['#1f77b4', '#ff7f0e', '#2ca02c', '#d62728', '#9467bd', '#8c564b', '#17becf']
largest(first) = (m = 0, sum [j=2:14] (d = abs(column(j+first)-column(j)), m = d > m ? d : m, 0), m > 1e-9 ? m : 1e-9)
set terminal pngcairo size 1200,520 font 'sans,11' background 'white'
set output folder.'/cycles.png'
set multiplot layout 1,2 margins 0.06,0.98,0.11,0.93 spacing 0.08,0.1
set xlabel 't (s)'
set xrange [0:4]
set title 'joints: host (lines), Cortex-M7 (points)'
set ylabel 'velocity (rad/s)'
set key bottom right maxrows 4
plot for [j=1:7] csv using 1:(column(1+j)) with lines lw 2 lc rgb colour[j] title 'joint '.j, \
  for [j=1:7] csv using 1:(column(14+j)) every 20 with points pt 7 ps 0.8 lc rgb colour[j] notitle
set title 'largest difference to the host, of 13 velocities'
set ylabel 'rad/s, m/s'
set logscale y
set format y '10^{%T}'
set yrange [1e-9:1e-2]
set key bottom right maxrows 3
plot csv using 1:(largest(13)) with lines lw 2 lc rgb '#1f77b4' title 'Cortex-M7', \
  csv using 1:(largest(26)) with lines lw 2 lc rgb '#ff7f0e' title 'Cortex-M4F', \
  1e-3 with lines dt 2 lc rgb '#555555' title 'tolerance'
unset multiplot
