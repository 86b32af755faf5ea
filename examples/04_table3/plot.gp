# SPDX-License-Identifier: BSD-3-Clause
# The program sets: folder, rows, study.
set datafile separator comma
set terminal pngcairo size 1400,1000 font 'sans,11' background 'white'
set output folder.'/forces.png'
set grid lc rgb '#dddddd'
array colour[6] = ['#1f77b4', '#ff7f0e', '#2ca02c', '#d62728', '#9467bd', '#8c564b']
set xlabel 't (s)'
set logscale y
set yrange [0.01:300]
set multiplot layout 2,2 title 'Interaction with the pipe over time'
set key outside right
set title 'force, without the force modification'
set ylabel 'force (N)'
plot for [i=1:6] folder.'/'.word(rows,i).'.csv' using 't':'force' with lines lw 2 lc rgb colour[i] title word(rows,i)
set title 'force, with it'
plot for [i=7:11] folder.'/'.word(rows,i).'.csv' using 't':'force' with lines lw 2 lc rgb colour[i-6] title word(rows,i)
set title 'moment, without the force modification'
set ylabel 'moment (N m)'
plot for [i=1:6] folder.'/'.word(rows,i).'.csv' using 't':'moment' with lines lw 2 lc rgb colour[i] title word(rows,i)
set title 'moment, with it'
plot for [i=7:11] folder.'/'.word(rows,i).'.csv' using 't':'moment' with lines lw 2 lc rgb colour[i-6] title word(rows,i)
unset multiplot
if (study eq 'yes') {
  set output folder.'/sensitivity.png'
  set terminal pngcairo size 1200,500 font 'sans,11' background 'white'
  set multiplot layout 1,2 title 'Mean interaction force of each row'
  set yrange [0.02:1000]
  set ylabel 'F mean (N)'
  set xtics ('T1' 1, 'T2' 2, 'T3' 3, 'T4' 4, 'T5' 5, 'T6' 6, 'T7' 7, 'T8' 8, 'T9' 9, 'T10' 10, 'T11' 11)
  set xrange [0.5:11.5]
  unset xlabel
  set key top right inside
  csv = folder.'/sensitivity.csv'
  set title 'bandwidth of the joint loops (rad/s)'
  plot for [k=0:3] csv index k using 1:2 with linespoints pt 7 title word('50 75 100 125', k+1), \
       csv index 11 using 1:2 with linespoints pt 7 lw 2.5 lc rgb 'black' title 'paper'
  set title 'other choices'
  plot csv index 2 using 1:2 with linespoints pt 7 title 'as chosen', \
       csv index 5 using 1:2 with linespoints pt 7 title 'joint speed 0.25 rad/s', \
       csv index 6 using 1:2 with linespoints pt 7 title 'both arms folded', \
       csv index 7 using 1:2 with linespoints pt 7 title 'half duplex fuses whole rounds', \
       csv index 11 using 1:2 with linespoints pt 7 lw 2.5 lc rgb 'black' title 'paper'
  unset multiplot
}
set output
