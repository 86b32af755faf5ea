// SPDX-License-Identifier: BSD-3-Clause
// The counterpart of Fig. 14 of [MARIS]: a step of the surge velocity in a current, with the whole
// velocity loop and without each of its parts.
#include <cstdio>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/replay.hpp"
#include "../support/support.hpp"
#include "simulation.hpp"

namespace {

icat::Status status = icat::Status::ok;

r2::StepResult step(const char* name, const r2::Step& setup, const r2::Watch& watch = {}) {
  r2::StepResult r = r2::run(setup, watch);
  r2::Rig::keep(status, r.status);
  std::printf("%-44s overshoot %5.2f %%, 2 %% after %5.2f s\n", name, 100 * r.overshoot, r.settled);
  return r;
}

// The same, in the replay.
r2::StepResult shown_step(support::Replay& replay, const char* name, const r2::Step& setup) {
  support::VehicleRun run(replay, name, name, 5000, 1.5);
  return step(name, setup, [&](double t, const r2::Rig& rig, const r2::Vector6& reference) {
    icat::Pose<double> pose = icat::IdentityPose{};
    pose.linear() = rig.attitude();
    pose.translation() = rig.position();
    if (!run.record(t, pose, reference, rig.velocity())) return;
    const bool still = reference(0) == 0;
    run.log().phase(t, still ? "still" : "ahead");
    run.log().explain(t, still ? "The vehicle is told to keep still in a current of 0.1 m/s."
                               : "The vehicle is told to go ahead at 0.2 m/s.");
  });
}

void step_responses(const std::string& folder, support::Replay& replay) {
  const auto whole = shown_step(replay, "PI with feed-forward", {});
  const auto bare = shown_step(replay, "PI alone", {.feed_forward = false});
  const auto payload = step("30 % more mass", {.mass = 520});
  const auto retuned = step("30 % more mass, told", {.mass = 520, .model_mass = 520});
  const auto heavy = step("30 % more mass, PI alone", {.mass = 520, .feed_forward = false});
  const auto blind = step("the current not told", {.current_told = false});
  const auto beyond = step("0.5 m/s, beyond the thrusters", {.speed = 0.5});
  const auto winds =
      step("0.5 m/s, achieved wrench not given", {.speed = 0.5, .anti_windup = false});
  const auto blown = r2::turn(0.1, false, status), holds = r2::turn(0.1, true, status);
  std::printf("turning on the spot it is displaced by %.1f mm; with the current known by %.1f mm\n",
              1e3 * *std::max_element(blown.begin(), blown.end()),
              1e3 * *std::max_element(holds.begin(), holds.end()));
  support::Csv csv(folder, "step.csv",
                   "t,whole,bare,payload,retuned,heavy,blind,beyond,winds,blown,holds");
  for (std::size_t k = 0; k < whole.surge.size(); k += 5) {
    csv.row({static_cast<double>(k) * r2::control_dt, whole.surge[k], bare.surge[k],
             payload.surge[k], retuned.surge[k], heavy.surge[k], blind.surge[k], beyond.surge[k],
             winds.surge[k], blown[k], holds[k]});
  }
}

}  // namespace

int main(int argc, char** argv) {
  const auto arguments = support::parse(
      argc, argv, "A step of the surge velocity in a current of 0.1 m/s.", "out/11_vehicle_loop");
  support::Replay replay("A step of the surge velocity in a current", true);
  step_responses(arguments.output, replay);
  std::printf("keeping a place with a dead zone of 5 %% of full thrust, and without:\n");
  for (const double noise : {0.002, 0.005, 0.02}) {
    const auto with = r2::station_keeping(0.05, noise, status);
    const auto without = r2::station_keeping(0, noise, status);
    std::printf("  noise %4.1f mm/s: %.2f mm/s RMS, %.2f mm/s\n", 1e3 * noise, 1e3 * with[1],
                1e3 * without[1]);
  }
  if (arguments.pictures) support::draw(arguments.output);
  std::printf("%s\n", icat::describe(status));
  replay.write(arguments.output, arguments.logs);
  return status == icat::Status::ok ? 0 : 1;
}
