# SPDX-License-Identifier: BSD-3-Clause
# The first attempt of each campaign and of April without each cure. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
names = "'October 2015' 'December 2015' 'April 2016' 'no compensation' 'no filter' 'no DVL'"
file(i) = sprintf('%s/trace%d.csv', folder, i - 1)
set terminal pngcairo size 1800,800 font 'sans,10' background 'white'
set output folder.'/attempts.png'
set multiplot layout 3,6 columnsfirst margins 0.04,0.99,0.06,0.95 spacing 0.025,0.05
set key top right samplen 1.5
do for [i = 1:6] {
  unset xlabel
  set title word(names, i) noenhanced
  set logscale y
  set yrange [3:3000]
  plot file(i) using 1:(1e3*$2) with lines lw 2 lc rgb '#1f77b4' title 'palm off its place, mm', \
    30 with lines dt 2 lc rgb '#888888' notitle
  unset logscale y
  unset title
  set yrange [0:400]
  plot file(i) using 1:(1e3*sqrt($6**2+$7**2+$8**2)) with lines lw 1 lc rgb '#ff7f0e' \
    title 'vehicle, commanded, mm/s', \
    file(i) using 1:(1e3*sqrt($3**2+$4**2+$5**2)) with lines lw 2 lc rgb '#1f77b4' \
    title 'actual'
  set xlabel 't (s)' offset 0,0.5
  set yrange [0:2]
  plot file(i) using 1:9 with lines lw 1 lc rgb '#1f77b4' title 'joints commanded, rad/s'
}
unset multiplot
