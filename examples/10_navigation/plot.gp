# SPDX-License-Identifier: BSD-3-Clause
# Path, current, error of the velocity, error of the position. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
csv = folder.'/run.csv'
set terminal pngcairo size 1200,900 font 'sans,11' background 'white'
set output folder.'/navigation.png'
set multiplot layout 2,2 margins 0.07,0.98,0.07,0.95 spacing 0.09,0.11
band = '#c6dbef'
set style fill solid 1.0 noborder

set title 'path'
set xlabel 'east (m)'
set ylabel 'north (m)'
set size ratio -1
set xrange [-5.15:14.85]
set yrange [-1.2:12.8]
set key at 8,7
plot csv using 3:2 with lines lw 2.5 lc rgb '#1f77b4' title 'true', \
  csv using 6:5 with lines lw 1.5 lc rgb '#ff7f0e' title 'estimated', \
  csv using ($14==1?$6:1/0):5 with lines lw 4 lc rgb '#d62728' title 'without DVL'

set size noratio
set key default
set xlabel 't (s)'
set xrange [0:210]
set title 'current of the water, two deviations'
set ylabel 'm/s'
set yrange [-0.3:0.3]
plot csv using 1:($9-2*$11):($9+2*$11) with filledcurves lc rgb band notitle, \
  csv using 1:($10-2*$11):($10+2*$11) with filledcurves lc rgb '#fdd0a2' notitle, \
  0.08 with lines lw 1 dt 2 lc rgb 'black' title 'true', \
  -0.06 with lines lw 1 dt 2 lc rgb 'black' notitle, \
  csv using 1:9 with lines lw 2 lc rgb '#1f77b4' title 'north', \
  csv using 1:10 with lines lw 2 lc rgb '#ff7f0e' title 'east'

set title 'surge: error and two deviations'
set ylabel 'cm/s'
set yrange [-3:4]
plot csv using 1:(-200*$13):(200*$13) with filledcurves lc rgb band title 'two deviations', \
  csv using 1:($14==1?-2.8:1/0) with lines lw 6 lc rgb '#d62728' title 'without DVL', \
  csv using 1:(100*$12) with lines lw 1.5 lc rgb '#1f77b4' title 'error'

set title 'north: error and two deviations'
set ylabel 'm'
set yrange [-3:4]
plot csv using 1:(-2*$7):(2*$7) with filledcurves lc rgb band title 'two deviations', \
  csv using 1:($14==1?-2.8:1/0) with lines lw 6 lc rgb '#d62728' title 'without DVL', \
  csv using 1:($5-$2) with lines lw 2 lc rgb '#1f77b4' title 'error'
unset multiplot
