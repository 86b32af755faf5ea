// SPDX-License-Identifier: BSD-3-Clause
// The largest gain of a task with which a joint comes to rest, against the period of
// the loop and the age of the state: a Markdown table for docs/safety.md.
#include <cmath>
#include <cstdio>
#include <deque>
#include <icat/icat.hpp>
#include <numbers>

namespace {

using Joint = icat::KinematicTree<double, 1>;

/// Whether a joint that is `period` · `late` s behind comes to rest, told `told` of its delay.
bool comes_to_rest(double gain, double period, int late, bool predicted, double told) {
  Joint robot(Joint::Description{.joints = {{"joint", "base", "link"}}});
  icat::task::JointPosition<Joint> hold(robot, icat::Vector<double, 1>(0.0), {.gain = gain});
  icat::Controller<Joint> controller(robot, {{"hold", {{hold}}}});
  icat::StatePredictor<Joint> predictor(robot, {.delay = told * period * late});
  std::deque<double> past(static_cast<std::size_t>(late) + 1, 0.01);
  if (controller.start("hold", 0) != icat::Status::ok) return false;
  const int cycles = 2000 + 400 * late;
  for (int k = 0; k < cycles; ++k) {
    const double t = k * period;
    const icat::Vector<double, 1> arrived(past.front());
    const auto status =
        predicted ? robot.update(predictor.predict(arrived, t)) : robot.update(arrived);
    if (status != icat::Status::ok || controller.step(t) != icat::Status::ok) return false;
    if (predictor.command(controller.velocity(), t) != icat::Status::ok) return false;
    past.push_back(past.back() + period * controller.command()(0));
    past.pop_front();
    if (!(std::abs(past.back()) < 1)) return false;
  }
  return std::abs(past.back()) < 0.01;
}

/// By bisection, 1/s.
double largest_gain(double period, int late, bool predicted, double told) {
  double low = 0, high = 4 / period;
  for (int i = 0; i < 20; ++i) {
    const double middle = (low + high) / 2;
    (comes_to_rest(middle, period, late, predicted, told) ? low : high) = middle;
  }
  return low;
}

}  // namespace

int main() {
  std::puts(
      "| period | delay | derived | measured | with `StatePredictor` | delay set 20 % short | "
      "20 % long |\n|---|---|---|---|---|---|---|");
  for (const double period : {0.001, 0.01, 0.05}) {
    for (const int late : {0, 1, 3, 10}) {
      const double derived = 2 / period * std::sin(std::numbers::pi / (2 * (2 * late + 1)));
      std::printf("| %g ms | %g ms | %.3g | %.3g | %.3g | %.3g | %.3g |\n", 1e3 * period,
                  1e3 * period * late, derived, largest_gain(period, late, false, 1),
                  largest_gain(period, late, true, 1), largest_gain(period, late, true, 0.8),
                  largest_gain(period, late, true, 1.2));
    }
  }
}
