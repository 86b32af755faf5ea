# SPDX-License-Identifier: BSD-3-Clause
# The counterparts of [NSB, Fig. 4a-4d, 5a, 5b], and what happens at a joint limit.
# The program sets: folder, times.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'

# Fig. 4a-4d.
scene = folder.'/snapshots.csv'
set terminal pngcairo size 1200,1080 font 'sans,11' background 'white'
set output folder.'/snapshots.png'
set multiplot layout 2,2 margins 0.06,0.98,0.12,0.94 spacing 0.07,0.1
set size ratio -1
set xrange [-1.1:1.6]
set yrange [-0.45:1.85]
set xlabel 'x (m)' offset 0,0.5
set ylabel 'y (m)' offset 1.5,0
unset key
do for [i=1:4] {
  b = 5*(i-1)
  set title sprintf('(%s)  t = %s s', word('a b c d', i), word(times, i))
  if (i == 3) { set key at screen 0.5,0.02 center bottom horizontal maxrows 1 width 2 }
  plot scene index 20 using 1:2 with lines lw 2 dt 2 lc rgb '#2ca02c' title 'line', \
    scene index b using 1:2 with filledcurves closed fs solid 0.25 border lc rgb '#555555' title 'vehicle', \
    scene index b+1 using 1:2 with linespoints lw 4 pt 7 ps 0.9 lc rgb '#1f77b4' title 'arm 1', \
    scene index b+2 using 1:2 with linespoints lw 4 pt 7 ps 0.9 lc rgb '#ff7f0e' title 'arm 2', \
    scene index b+3 using 1:2 with lines lw 2.5 dt (6,5) lc rgb '#9467bd' title 'arm 2 points', \
    scene index b+4 using 1:2 with points pt 7 ps 1.6 lc rgb '#d62728' title 'reference'
  unset key
}
unset multiplot

# Fig. 5a, 5b: the first 20 s on the left, all of it on a logarithmic scale on the right.
set size noratio
csv = folder.'/line_nsb.csv'
set terminal pngcairo size 1200,800 font 'sans,11' background 'white'
set output folder.'/errors.png'
unset title
set key default
set key inside top right vertical opaque
set autoscale
set xlabel 't (s)' offset 0,0.5
array names[6] = ['tool position (m)', 'tool orientation (rad)', 'vehicle orientation (rad)', 'vertical distance (m)', 'field of view', 'first joint (rad)']
array colors[6] = ['#1f77b4', '#17becf', '#2ca02c', '#d62728', '#9467bd', '#ff7f0e']
error(k) = k == 1 ? sqrt(column('error_x')**2+column('error_y')**2) : column(word('x error_psi error_orientation error_distance error_view error_joint', k))
set multiplot layout 2,2 margins 0.07,0.98,0.07,0.95 spacing 0.08,0.12
do for [unit=1:2] {
  first = unit == 1 ? 1 : 5
  last = unit == 1 ? 4 : 6
  set title unit == 1 ? '(a)  leader: vehicle and arm 1' : '(b)  follower: arm 2'
  set ylabel 'error' offset 1,0
  set xrange [0:20]
  unset logscale y
  set format y '%g'
  set autoscale y
  plot 0 with lines lc rgb '#999999' notitle, \
    for [k=first:last] csv using 't':(error(k)) with lines lw 2 lc rgb colors[k] title names[k]
  set xrange [0:270]
  set logscale y
  set format y '10^{%L}'
  set yrange [1e-9:3]
  set ylabel '|error|'
  set title unit == 1 ? '(a)  the whole run' : '(b)  the whole run'
  plot 1e-3 with lines dt 2 lc rgb '#999999' title 'tolerance', \
    for [k=first:last] csv using 't':(abs(error(k))) with lines lw 2 lc rgb colors[k] title names[k]
}
unset multiplot

# The joint limit.
set output folder.'/limit.png'
set terminal pngcairo size 1200,700 font 'sans,11' background 'white'
unset logscale y
set autoscale y
set format y '%g'
set xrange [0:140]
set key top left
file(m) = folder.'/limit_'.word('nsb nsb_stops icat', m).'.csv'
method(m) = m == 1 ? 'NSB' : m == 2 ? 'NSB, joints stop at their limits' : 'iCAT'
style = '#1f77b4 #d62728 #2ca02c'
width(m) = 6.6 - 1.6*m  # what lies below stays visible
set multiplot layout 2,1 margins 0.08,0.98,0.08,0.94 spacing 0.08,0.13
set title 'Third joint of arm 1'
set ylabel 'q_{13} (deg)' offset 0,0
set yrange [0:60]
plot 30 with lines dt 2 lw 2 lc rgb '#555555' title 'limit', \
  for [m=1:3] file(m) using 't':(column('q13')*180/pi) with lines lw width(m) lc rgb word(style, m) title method(m)
set title 'Tool: largest of the errors in x, y (m) and orientation (rad)'
set ylabel 'error' offset 0,0
set yrange [0:0.03]
set key top right
max3(a, b, c) = (a > b ? a : b) > c ? (a > b ? a : b) : c
plot for [m=1:3] file(m) using 't':(max3(abs(column('error_x')), abs(column('error_y')), abs(column('error_psi')))) \
  with lines lw width(m) lc rgb word(style, m) title method(m)
unset multiplot
set output
