# SPDX-License-Identifier: BSD-3-Clause
# The counterpart of [Coop, Fig. 2]. The program sets: folder.
set datafile separator comma
set encoding utf8
set grid lt 1 lw 0.6 lc rgb '#dddddd'
set terminal pngcairo size 560,340 font 'sans,11' background 'white'
set output folder.'/activation.png'
set title 'activation of x ≤ 0.1, β = 0.05'
set xlabel 'x' offset 0,0.5
set yrange [-0.05:1.05]
unset key
plot folder.'/activation.csv' using 1:2 with lines lw 2.5 lc rgb '#1f77b4'
set output
