# SPDX-License-Identifier: BSD-3-Clause
# The first attempt of each set. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
names = "'October 2015' 'December 2015' 'April 2016' 'no compensation' 'no filter' 'no DVL'"
file(i) = sprintf('%s/trace%d.csv', folder, i - 1)
set terminal pngcairo size 1200,800 font 'sans,11' background 'white'
set output folder.'/attempts.png'
set multiplot layout 3,6 columnsfirst margins 0.075,0.99,0.12,0.95 spacing 0.012,0.045
unset key
set xtics 20
do for [i = 1:6] {
  unset xlabel
  set title word(names, i) noenhanced
  set xrange [0:90]
  # All have the same scales: numbers stand at the left alone.
  set format y (i == 1 ? '%g' : '')
  set ylabel (i == 1 ? 'palm off its place (mm)' : '') offset 0.5,0
  set logscale y
  set yrange [3:3000]
  set format x ''
  plot file(i) using 1:(1e3*$2) with lines lw 2 lc rgb '#1f77b4', \
    30 with lines dt 2 lc rgb '#555555'
  unset logscale y
  unset title
  set ylabel (i == 1 ? 'vehicle (mm/s)' : '')
  set yrange [0:400]
  plot file(i) using 1:(1e3*sqrt($6**2+$7**2+$8**2)) with lines lw 1 lc rgb '#ff7f0e', \
    file(i) using 1:(1e3*sqrt($3**2+$4**2+$5**2)) with lines lw 2 lc rgb '#1f77b4'
  set format x '%g'
  set xlabel 't (s)' offset 0,0.5
  set ylabel (i == 1 ? 'joints commanded (rad/s)' : '')
  set yrange [0:1.2]
  if (i == 6) {
    set label 1 'actual' at screen 0.1,0.025 tc rgb '#1f77b4'
    set label 2 'commanded to the vehicle' at screen 0.2,0.025 tc rgb '#ff7f0e'
    set label 3 'commanded to the joints' at screen 0.45,0.025 tc rgb '#2ca02c'
    set label 4 '- - - below 30 mm the hand closes' at screen 0.68,0.025 tc rgb '#555555'
  }
  plot file(i) using 1:9 with lines lw 1 lc rgb '#2ca02c'
}
unset multiplot
