# SPDX-License-Identifier: BSD-3-Clause
# Feedback and joint references without and with the filter; the sweep. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
run = folder.'/run.csv'
sweep = folder.'/sweep.csv'
array colour[7] = ['#1f77b4', '#ff7f0e', '#2ca02c', '#d62728', '#9467bd', '#8c564b', '#17becf']
array component[6] = ['surge', 'sway', 'heave', 'roll', 'pitch', 'yaw']
set terminal png size 1100,560 font 'sans,9'
set output folder.'/feedback.png'
set multiplot layout 2,3 columnsfirst margins 0.05,0.985,0.08,0.94 spacing 0.055,0.13
set xrange [10:12]
set xtics 0.5
set xlabel 't (s)' offset 0,0.5
set key opaque samplen 1 height 0.3
do for [f=0:1] {
  set yrange [-0.32:0.42]
  set key top right horizontal maxcols 6 noopaque
  set title f == 0 ? 'feedback, no filter (m/s, rad/s)' : 'feedback, filter 50 rad/s (m/s, rad/s)'
  plot for [i=6:1:-1] run using 1:($2==f ? column(2+i) : NaN) with lines lw 1 lc rgb colour[i] title component[i]
  set yrange [-0.7:0.7]
  set title f == 0 ? 'joint references, no filter (rad/s)' : 'joint references, filter 50 rad/s (rad/s)'
  plot for [i=1:7] run using 1:($2==f ? column(8+i) : NaN) with lines lw 1 lc rgb colour[i] notitle
}
set xrange [1.6:1300]
set logscale xy
set xtics ('2' 2, '5' 5, '10' 10, '20' 20, '50' 50, '100' 100, '200' 200, 'none' 1000)
set xlabel 'cut-off of the filter (rad/s)' offset 0,0.5
set key top left vertical maxcols 1
set yrange [0.01:10]
set title 'RMS: what shakes'
plot sweep using 1:3 with linespoints pt 7 lw 2 lc rgb '#d62728' title 'vehicle, roll and pitch (rad/s²)', \
  sweep using 1:2 with linespoints pt 7 lw 2 lc rgb '#1f77b4' title 'joint references (rad/s)', \
  sweep using 1:7 with linespoints pt 7 lw 2 lc rgb '#2ca02c' title 'tool (m/s)'
set yrange [1:100]
set key top right
set title 'RMS: what wanders'
plot sweep using 1:(1e3*$5) with linespoints pt 7 lw 2 lc rgb '#9467bd' title 'tool off its goal (mm)', \
  sweep using 1:(1e3*$4) with linespoints pt 7 lw 2 lc rgb '#8c564b' title 'vehicle, roll and pitch (mrad/s)'
unset multiplot
