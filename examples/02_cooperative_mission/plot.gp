# SPDX-License-Identifier: BSD-3-Clause
# Pictures of one run. The program sets: folder, mission, tasks, ends, snapshots. Every fifth sample
# (20 Hz) shows all there is but in the zoom, and is read three times as fast.
set datafile separator comma
csv = folder.'/mission.csv'
set terminal pngcairo size 1400,1300 font 'sans,11' background 'white'
set grid lc rgb '#dddddd'
set linetype 9 lw 2 lc rgb '#999999' dt 2
last = real(word(ends, words(ends)))
borders = "do for [i=1:words(ends)-1] { x = real(word(ends, i)); set arrow i from x, graph 0 to x, graph 1 nohead dt 2 lc rgb '#666666' }"
eval borders
axes = 'surge sway heave roll_rate pitch_rate yaw_rate'

# Counterpart of Fig. 5 and 7.
set output folder.'/velocities.png'
set multiplot layout 3,2 title 'Velocities: '.mission.' (dashed: borders of the phases)'
set key outside right
set xrange [0:last]
do for [robot in 'a b'] {
  set title 'arm '.robot
  set ylabel 'rad/s'
  plot for [i=1:7] csv every 5 using 't':'qdot'.i.'_'.robot with lines lw 2 title 'joint '.i
  set title 'vehicle '.robot
  set ylabel 'm/s, rad/s'
  plot for [c in axes] csv every 5 using 't':'actual_'.c.'_'.robot with lines lw 2 title c noenhanced
}
set xrange [38:41]
do for [i=1:words(ends)-1] {
  x = real(word(ends, i))
  if (x < 38 || x > 41) { unset arrow i }
}
set xlabel 't (s)'
set title 'zoom of arm b'
set ylabel 'rad/s'
plot for [i=1:7] csv every ::3790::4110 using 't':'qdot'.i.'_b' with lines lw 2 title 'joint '.i
set title 'zoom of vehicle b'
set ylabel 'm/s, rad/s'
plot for [c in axes] csv every ::3790::4110 using 't':'actual_'.c.'_b' with lines lw 2 title c noenhanced
unset multiplot
set xrange [0:last]
eval borders

# Counterpart of Fig. 6 and 8.
set output folder.'/activations.png'
unset ylabel
set yrange [-0.05:1.05]
do for [i=1:8] { set linetype i lw 2 }
set multiplot layout 2,2 title 'Activations: '.mission.' (dashed: borders of the phases)'
do for [robot in 'a b'] {
  set title 'joint limits of arm '.robot
  plot for [i=1:7] csv every 5 using 't':'a_limit'.i.'_'.robot with lines lw 2 title 'joint '.i
  set title 'all other tasks of robot '.robot
  plot for [task in tasks] csv every 5 using 't':'a_'.task.'_'.robot with lines title task noenhanced
}
unset multiplot

# Counterpart of Fig. 4.
reset
set datafile separator comma
set output folder.'/scene.png'
set terminal pngcairo size 1500,800 font 'sans,11' background 'white'
set multiplot
set xrange [-2.2:5.4]
set yrange [-2.6:7.2]
set zrange [-3.05:0.2]
set xtics 2
set ytics 2
set ztics ('0' 0, '1' -1, '2' -2, '3' -3)
set xlabel 'x (m)'
set ylabel 'y (m)'
set grid
set view 62,30,1.32
set view equal xyz
set xyplane at -3.05
scene = folder.'/scene.csv'
names = "'start' 'grasp' 'transport' 'pre-deployment' 'deployment' 'end'"
set lmargin 0
set rmargin 0
set tmargin 0
set bmargin 0
set size 0.42,0.62
do for [k=0:5] {
  set origin (k%3)/3.0-0.04, 0.45-0.49*(k/3)
  set title sprintf('(%s) %s, t = %.1f s', substr('abcdef', k+1, k+1), word(names, k+1), real(word(snapshots, k+1))) offset 0,-4
  splot csv every 5 using 'object_x':'object_y':(-column('object_z')) with lines lw 1 dt 2 lc rgb '#d4a000' notitle, \
    for [b=0:2:2] scene index 5*k+b using 1:2:(-$3) with lines lw 1.5 lc rgb (b ? '#2ca02c' : '#1f77b4') notitle, \
    for [b=1:3:2] scene index 5*k+b using 1:2:(-$3) with lines lw 3 lc rgb '#d62728' notitle, \
    scene index 5*k+4 using 1:2:(-$3) with lines lw 7 lc rgb '#d4a000' notitle
}
unset multiplot
set output
