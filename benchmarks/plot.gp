# The chart of scripts/bench.sh: gnuplot -e "dir='…'" plot.gp
set terminal pngcairo size 1100,460 font "sans,11"
set output dir."/solver.png"
set multiplot layout 1,2

set title "Time of a solve, H (13 DoF, 10 levels)"
set ylabel "× Y (Householder QR, 28 × 13)"
set style data histograms
set style histogram clustered gap 1
set style fill solid 0.8 noborder
set yrange [0:*]
set grid ytics
set key top left
set xtics font "sans,9"
plot dir."/patterns.dat" using 2:xtic(1) title "static", '' using 3 title "dynamic", \
  '' using 4 title "float"

set title "Growth, every row partial"
set xlabel "degrees of freedom"
set ylabel "µs"
set logscale xy
set fit quiet logfile "/dev/null"
set xrange [6:80]
set yrange [*:*]
set xtics (7, 13, 20, 32, 64) font "sans,11"
f(x) = a * x**b
a = 0.05; b = 2
fit log10(f(x)) dir."/growth.dat" using 1:(log10($2)) via a, b
plot dir."/growth.dat" using 1:2 with points pt 7 title "measured", \
  f(x) with lines title sprintf("∝ n^{%.2f}", b)
unset multiplot
