# SPDX-License-Identifier: BSD-3-Clause
# Detection rate and error over range, a line for each turbidity. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/sweep.csv'
set terminal pngcairo size 1200,420 font 'sans,11' background 'white'
set output folder.'/sweep.png'
set multiplot layout 1,3 margins 0.05,0.99,0.13,0.92 spacing 0.06,0.1
set style line 1 lc rgb '#1f77b4' lw 2 pt 7
set style line 2 lc rgb '#2ca02c' lw 2 pt 7
set style line 3 lc rgb '#bcbd22' lw 2 pt 7
set style line 4 lc rgb '#ff7f0e' lw 2 pt 7
set style line 5 lc rgb '#d62728' lw 2 pt 7
set style line 6 lc rgb '#7f7f7f' lw 2 pt 7
scattering = "0.03 0.2 0.4 0.55 0.8 1.8"
set xlabel 'range (m)'
set xrange [0.8:4.2]
set title 'detected (%)'
set yrange [-5:105]
unset key
plot for [i=1:6] s = word(scattering, i) + 0 csv using 1:(abs($2-s)<1e-3 ? 100*$3 : 1/0) \
  with linespoints ls i title sprintf('b = %g /m', s)
set autoscale y
set logscale y
set format y '%g'
set title 'error across the axis (mm)'
set yrange [0.1:100]
plot for [i=1:6] s = word(scattering, i) + 0 csv using 1:(abs($2-s)<1e-3 ? 1000*$4 : 1/0) \
  with linespoints ls i
set title 'error along the axis, where an end is seen (mm)'
set key top right
plot for [i=1:6] s = word(scattering, i) + 0 csv using 1:(abs($2-s)<1e-3 ? 1000*$5 : 1/0) \
  with linespoints ls i title sprintf('b = %g /m', s)
unset multiplot
