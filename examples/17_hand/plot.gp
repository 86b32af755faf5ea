# SPDX-License-Identifier: BSD-3-Clause
# The counterparts of [MARIS, Figs 3 and 4] and [MARIS, Fig. 8]. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
scene = folder.'/postures.csv'
array colour[3] = ['#d62728', '#1f77b4', '#2ca02c']
set terminal pngcairo size 1200,620 font 'sans,11' background 'white'
set output folder.'/postures.png'
set multiplot layout 2,3 margins 0.055,0.985,0.09,0.94 spacing 0.06,0.13
set size ratio -1
set xrange [-0.2:0.2]
set xtics 0.1
set ytics 0.1
set xlabel 'x, from the thumb to the fingers (m)' offset 0,0.5
shapes = "parallel power precision"
do for [view=0:1] {
  if (view == 0) { set yrange [-0.02:0.23] } else { set yrange [-0.125:0.125] }
  set ylabel view == 0 ? 'z, out of the palm (m)' : 'y, along the pipe (m)' offset 1.5,0
  do for [k=0:2] {
    set title word(shapes, k+1).(view == 0 ? ': from the side' : ': from above')
    if (k == 0 && view == 0) { set key top center horizontal samplen 1 } else { unset key }
    set object 1 circle at 0, (k == 1 ? 0.1 : 0.14) size 0.05 fs empty border lc rgb '#d4a000' lw 2
    if (view == 1) { unset object 1 }
    plot for [f=0:2] scene index 6*k+f using 1:(view == 0 ? $3 : $2) with linespoints pt 7 ps 0.7 lw 1.5 dt 2 lc rgb colour[f+1] notitle, \
      for [f=0:2] scene index 6*k+3+f using 1:(view == 0 ? $3 : $2) with linespoints pt 7 ps 0.9 lw 4 lc rgb colour[f+1] title word('T FR FL', f+1)
  }
}
unset multiplot
unset object
reset
set encoding utf8
set datafile separator comma
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/wrist.csv'
array hue[3] = ['#1f77b4', '#ff7f0e', '#2ca02c']
set terminal pngcairo size 1200,420 font 'sans,11' background 'white'
set output folder.'/wrist.png'
set multiplot layout 1,2 margins 0.06,0.99,0.13,0.91 spacing 0.07,0.1
set xlabel 't (s)' offset 0,0.5
set key top center horizontal
do for [part=0:1] {
  set yrange [part == 0 ? -90 : -7:part == 0 ? 105 : 8]
  set title part == 0 ? '(a)  force (N)' : '(b)  torque (N m)'
  plot for [i=1:3] csv using 1:(column(1+3*part+i)) with lines lw 1 lc rgb hue[i] title word('x y z', i), \
    for [i=1:3] csv using 1:(column(7+3*part+i)) with lines lw 1.5 dt 2 lc rgb '#333333' title i == 1 ? 'reference' : ''
}
unset multiplot
set output
