// SPDX-License-Identifier: BSD-3-Clause
// The counterparts of Figs 17 and 18 of [MARIS]: a dynamic vehicle and arm with noisy velocity
// feedback, without and with a low-pass at 50 rad/s; the sweep of the cut-off; and the effect of
// the arm's reaction on the vehicle.
#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/robot_replay.hpp"
#include "../support/support.hpp"
#include "simulation.hpp"

using feedback::Result;

namespace {

void print(const char* name, const Result& r) {
  std::printf("%-24s %8.3f %10.3f %10.4f %8.2f %8.4f %9.1f   %s\n", name, r.reference,
              r.acceleration, r.rate, 1e3 * r.position, r.orientation, 1e3 * r.tool_speed,
              icat::describe(r.status));
}

/// A run that is in the replay.
Result shown_run(support::Replay& replay, const char* title, double cutoff) {
  std::optional<support::RobotReplay<icat::ParallelController<feedback::Robot>>> view;
  const support::RobotReplayOptions options{.frames = {"tool"},
                                            .name = cutoff == 50 ? "filter" : "no filter",
                                            .title = title,
                                            .base = {1.0, 0.6, 0.6},
                                            .ground = 2.2,
                                            .samples = 610,
                                            .rows = false};
  return feedback::run({.cutoff = cutoff}, 30,
                       [&](double t, const auto& controller, const auto& goal) {
                         if (!view) {
                           view.emplace(replay, controller, options);
                           auto& plots = view->run().plots;
                           std::reverse(plots.begin(), plots.end());  // velocities first
                         }
                         view->record(t, goal);
                       });
}

/// The table, and what the picture is drawn from; `none` and `fifty` without and with the filter.
bool sweep_cutoffs(const std::string& folder, support::Replay& replay, Result& none,
                   Result& fifty) {
  support::Csv run(folder, "run.csv", "t,filtered,u,v,w,p,q,r,q1,q2,q3,q4,q5,q6,q7");
  support::Csv sweep(folder, "sweep.csv",
                     "cutoff,reference,acceleration,rate,position,orientation,tool_speed");
  bool ok = true;
  for (const double cutoff : {2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, feedback::unfiltered}) {
    char name[32];
    std::snprintf(name, sizeof name, "filter %g rad/s", cutoff);
    const bool open = cutoff == feedback::unfiltered;
    Result r = open || cutoff == 50 ? shown_run(replay, open ? "no filter" : name, cutoff)
                                    : feedback::run({.cutoff = cutoff});
    print(open ? "no filter" : name, r);
    ok = ok && r.status == icat::Status::ok;
    sweep.row({open ? 1000 : cutoff, r.reference, r.acceleration, r.rate, r.position, r.orientation,
               r.tool_speed});
    if (!open && cutoff != 50) continue;
    for (const auto& s : r.samples) {
      if (s.t >= 10 && s.t < 12) run.row(s.t, open ? 0 : 1, s.feedback, s.reference);
    }
    (open ? none : fifty) = std::move(r);
  }
  return ok;
}

/// The filter's factors with other parameters than those of the table.
bool vary(const char* name, feedback::Variant variant) {
  const Result none = feedback::run(variant);
  variant.cutoff = 50;
  const Result fifty = feedback::run(variant);
  std::printf("%-24s %8.1f %10.1f %10.2f\n", name, none.reference / fifty.reference,
              none.acceleration / fifty.acceleration, none.rate / fifty.rate);
  return none.status == icat::Status::ok && fifty.status == icat::Status::ok;
}

}  // namespace

int main(int argc, char** argv) {
  const auto arguments =
      support::parse(argc, argv, "Noise of the vehicle's velocity, and the filter against it.",
                     "out/12_velocity_feedback");
  std::printf(
      "RMS                       joints    vehicle    vehicle     tool     tool      tool\n"
      "                           rad/s     rad/s^2      rad/s       mm      rad      mm/s\n");
  Result none, fifty;
  support::Replay replay("Noise of the measured velocity, with and without a filter", true);
  const bool ok = sweep_cutoffs(arguments.output, replay, none, fifty);
  const Result alone = feedback::run({.reaction = false});
  const Result alone_fifty = feedback::run({.cutoff = 50, .reaction = false});
  const Result heavy = feedback::run({.arm = 2}),
               heavy_fifty = feedback::run({.cutoff = 50, .arm = 2});
  const Result quiet = feedback::run({.noise = false});
  print("no reaction, no filter", alone);
  print("no reaction, 50 rad/s", alone_fifty);
  print("no noise, no filter", quiet);
  print("arm twice, no filter", heavy);
  print("arm twice, 50 rad/s", heavy_fifty);

  const double dt = feedback::plant_dt * feedback::Variant{}.every;
  const double alpha = 1 - std::exp(-50 * dt), k = feedback::loop_gain();
  std::printf(
      "\nThe filter divides the joints' velocities by %.1f (white noise: %.1f), the vehicle's\n"
      "acceleration by %.1f, its rates by %.2f, the tool's speed by %.2f, the tool's error by "
      "%.2f.\n",
      none.reference / fifty.reference, std::sqrt((2 - alpha) / alpha),
      none.acceleration / fifty.acceleration, none.rate / fifty.rate,
      none.tool_speed / fifty.tool_speed, none.position / fifty.position);
  std::printf(
      "The arm's reaction multiplies the vehicle's acceleration by %.0f, with the filter by %.0f;\n"
      "its rates by %.2f, %.2f; the joints' velocities by %.2f, %.2f. The loop's gain is %.2f,\n"
      "which explains a factor of %.2f.\n",
      none.acceleration / alone.acceleration, fifty.acceleration / alone_fifty.acceleration,
      none.rate / alone.rate, fifty.rate / alone_fifty.rate, none.reference / alone.reference,
      fifty.reference / alone_fifty.reference, k, 1 / (1 - k));
  std::printf("Noise that the arm follows causes a tool error of %.4f rad, with any filter.\n",
              feedback::angular_noise * std::sqrt(3 * dt / (2 * feedback::tool_gain)));
  std::printf("With an arm twice as heavy the gain is %.2f.\n", feedback::loop_gain(2));
  std::printf("The filter divides, with\n");
  bool others = vary("drives of 30 rad/s", {.drives = 30});
  others = vary("drives of 300 rad/s", {.drives = 300}) && others;
  others = vary("a delay of 1 ms", {.delay = 1}) && others;
  others = vary("a delay of 20 ms", {.delay = 20}) && others;
  others = vary("a vehicle of 350 kg", {.mass = 350}) && others;
  others = vary("feedback at 100 Hz", {.every = 10}) && others;
  if (arguments.pictures) support::draw(arguments.output);
  replay.write(arguments.output, arguments.logs);
  return ok && others && none.reference > 3 * fifty.reference ? 0 : 1;
}
