# SPDX-License-Identifier: BSD-3-Clause
# Pictures of one run. The program sets: folder, mission, activations, phase_names, phase_times. Every
# fifth sample (20 Hz) shows all there is, and is read three times as fast.
set datafile separator comma
csv = folder.'/mission.csv'
set terminal pngcairo size 1200,800 font 'sans,11' background 'white'
set grid lc rgb '#dddddd'
set key outside right
set xlabel 't (s)'

# Dashed borders between the phases, with the name of the one that begins.
phase_borders = "do for [i=1:words(phase_times)] { \
  x = real(word(phase_times, i)); \
  set arrow i from x, graph 0 to x, graph 1 nohead dt 2 lc rgb '#666666'; \
  set label i word(phase_names, i) at x, graph 0.97 offset 0.5,0 tc rgb '#666666' }"
eval phase_borders

set output folder.'/velocities.png'
set multiplot layout 2,1 title 'Velocities: '.mission
set ylabel 'joints (rad/s)'
plot for [i=1:7] csv every 5 using 't':'qdot'.i with lines lw 2 title 'joint '.i
set ylabel 'vehicle (m/s, rad/s)'
plot for [c in 'surge sway heave roll_rate pitch_rate yaw_rate'] \
  csv every 5 using 't':'actual_'.c with lines lw 2 title c noenhanced
unset multiplot

set output folder.'/activations.png'
unset label
unset ylabel
set xlabel offset 0,0.8
set ytics 0.5
set yrange [-0.05:1.05]
set multiplot layout (words(activations)+1)/2,2 title 'Activations: '.mission
unset key
do for [i=1:words(activations)] {
  a = word(activations, i)
  set title a noenhanced offset 0,-0.7
  plot csv every 5 using 't':'a_'.a with filledcurves y1=0 fs solid 0.4 lc rgb '#1f77b4'
}
unset multiplot
unset title
set key outside right
set autoscale y
set ytics autofreq
set xlabel offset 0,0

eval phase_borders
set output folder.'/errors.png'
set multiplot layout 2,1 title 'Errors and objectives: '.mission
set logscale y
set format y '10^{%L}'
set ylabel 'tool error'
plot csv every 5 using 't':'position_error' with lines lw 2 title 'position (m)', \
     csv every 5 using 't':'orientation_error' with lines lw 2 title 'orientation (rad)'
unset logscale y
set format y '%g'
set ylabel 'objectives'
plot csv every 5 using 't':'joint_margin' with lines lw 2 title 'margin to joint limits (rad)', \
     csv every 5 using 't':'manipulability' with lines lw 2 title 'manipulability', \
     csv every 5 using 't':'centering' with lines lw 2 title 'camera misalignment (rad)', \
     csv every 5 using 't':'attitude' with lines lw 2 title 'tilt (rad)', \
     csv every 5 using 't':'distance' with lines lw 2 title 'vehicle distance (m)'
unset multiplot

unset arrow
unset label
unset ylabel
set output folder.'/scene.png'
set terminal pngcairo size 1200,800 font 'sans,11' background 'white'
set title mission offset 0,-3
set key at screen 0.95,0.9
set xlabel 'x (m)' offset 0,0
set ylabel 'y (m)'
set zlabel 'depth z (m)' rotate
set xtics 1
set ytics 1
set ztics ('0' 0, '1' -1, '2' -2, '3' -3)
set view 68,28,1.75
set view equal xyz
set xyplane at -3.05
set zrange [-3.05:0.2]
set lmargin screen 0
set rmargin screen 1
set tmargin screen 1
set bmargin screen 0
scene = folder.'/scene.csv'
stats scene nooutput
blocks = STATS_blocks
set parametric
set urange [0:2*pi]
set vrange [0:pi]
set isosamples 13,7
# The pipe lies across the heading of 0.6 rad; the companion's sphere is the distance to keep.
dx = -1.5*sin(0.6)
dy = 1.5*cos(0.6)
set arrow 1 from 0.5-dx,0.5-dy,-3 to 0.5+dx,0.5+dy,-3 nohead lw 8 lc rgb '#d4a000'
set label 1 'pipe' at 0.5-dx,0.5-dy,-3 offset 1,0
splot -1.3+cos(u)*sin(v), -0.3+sin(u)*sin(v), -1.4+cos(v) with lines lw 0.5 lc rgb '#e0a0a0' title 'another vehicle keeps its distance', \
  csv every 5 using (column('vehicle_x')):(column('vehicle_y')):(-column('vehicle_z')) with lines lw 2 lc rgb '#1f77b4' title 'path of the vehicle', \
  csv every 5 using (column('tool_x')):(column('tool_y')):(-column('tool_z')) with lines lw 2 lc rgb '#2ca02c' title 'path of the tool', \
  for [b=0:blocks-2:2] scene index b using 1:2:(-$3) with lines lw 1 lc rgb '#555555' notitle, \
  for [b=1:blocks-1:2] scene index b using 1:2:(-$3) with linespoints lw 3 pt 7 ps 0.8 lc rgb '#d62728' notitle
set output
