// SPDX-License-Identifier: BSD-3-Clause
// Runs the reference mission, prints its summary, writes CSV and, where gnuplot is found, pictures.
#include <cstdio>
#include <ctime>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/reasons.hpp"
#include "../support/replay.hpp"
#include "../support/support.hpp"
#include "mission.hpp"

namespace {

constexpr double degree = std::numbers::pi / 180;

struct NamedVariant {
  const char* name;
  const char* title;
  grasp::Variant variant;
};
const NamedVariant variants[] = {
    {"plain", "fully actuated vehicle, still water", {}},
    {"underactuated", "roll and pitch not actuated", {.underactuated = true}},
    {"current", "sinusoidal current, no compensation", {.current = true}},
    {"compensated",
     "sinusoidal current, the arm compensates",
     {.current = true, .compensation = true}}};

std::string column_name(std::string name) {
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
}

void write_csv(const std::string& folder, const grasp::Result& r) {
  std::string header =
      "t,q1,q2,q3,q4,q5,q6,q7,qdot1,qdot2,qdot3,qdot4,qdot5,qdot6,qdot7,"
      "command_surge,command_sway,command_heave,command_roll_rate,command_pitch_rate,"
      "command_yaw_rate,actual_surge,actual_sway,actual_heave,actual_roll_rate,actual_pitch_rate,"
      "actual_yaw_rate,vehicle_x,vehicle_y,vehicle_z,tool_x,tool_y,tool_z,position_error,"
      "orientation_error,joint_margin,manipulability,centering,attitude,distance,"
      "vehicle_position,vehicle_orientation";
  for (const auto& task : r.tasks) header.append(",a_").append(column_name(task));
  support::Csv csv(folder, "mission.csv", header);
  for (const auto& s : r.samples) {
    csv.row(s.t, s.q, s.command, s.vehicle_velocity, s.vehicle.translation(), s.tool.translation(),
            s.position_error, s.orientation_error, s.joint_margin, s.manipulability, s.centering,
            s.attitude, s.distance, s.vehicle_position, s.vehicle_orientation, s.activations);
  }
}

// Snapshots for the 3-D view: hull and arm in turn.
void write_scene(const std::string& folder, const grasp::Result& r) {
  support::Strokes strokes(folder, "scene.csv");
  const auto add = [&](double t) {
    support::draw_robot(strokes, support::sample_at(r.samples, t));
  };
  const double end = r.samples.back().t, arrival = r.phases.size() > 1 ? r.phases[1].second : end;
  add(r.phases[0].second);
  for (int third = 1; third < 3; ++third) add(arrival / 3 * third);
  for (std::size_t k = 1; k < r.phases.size(); ++k) add(r.phases[k].second);
  add(end);
}

using Sentences = std::vector<std::pair<double, std::string>>;

void add_to(support::Replay& replay, const NamedVariant& v, const grasp::Result& r,
            const Sentences& reasons) {
  support::UvmsRun run(replay, v.name, v.title, r.samples.size());
  icat::Log& log = run.log();
  const auto position = log.add("error/tool position", "m"),
             orientation = log.add("error/tool orientation", "rad");
  run.add_plot("Errors of the tool", "error/", "m, rad", true);
  run.add_robot("", r.tasks, grasp::camera_mount(), "#d98a2b");
  run.add_ground(grasp::pipe_centre.x(), grasp::pipe_centre.y(), grasp::pipe_centre.z() + 0.06);
  run.add_pipe("", support::pose(grasp::pipe_centre, 0, 0, grasp::heading + std::numbers::pi / 2),
               2, 1);
  run.add_goal(grasp::grasp_goal());
  run.add_goal(grasp::lift_goal());
  run.add_vehicle(support::pose(grasp::companion, 0, 0, 0), grasp::companion_distance);
  auto reason = reasons.begin();
  for (const auto& s : r.samples) {
    if (!log.begin(s.t)) continue;
    run.record(0, s, s.activations.data());
    log.set(position, s.position_error);
    log.set(orientation, s.orientation_error);
    log.phase(s.t, s.action);
    for (; reason != reasons.end() && reason->first <= s.t; ++reason) {
      log.explain(s.t, reason->second);
    }
  }
}

void draw(const std::string& folder, const char* title, const grasp::Result& r) {
  std::string activations, names, times;
  for (const auto& task : r.tasks) activations.append(column_name(task)).append(" ");
  for (const auto& phase : r.phases) {
    names.append(phase.first).append(" ");
    times.append(std::to_string(phase.second)).append(" ");
  }
  support::draw(folder, {{"mission", title},
                         {"activations", activations},
                         {"phase_names", names},
                         {"phase_times", times}});
}

void print(const NamedVariant& v, const grasp::Result& r, double seconds) {
  std::printf("\n%s: %s\n", v.name, v.title);
  for (const auto& [action, t] : r.phases) std::printf("  %-9s from %6.2f s\n", action.c_str(), t);
  std::printf("  end        at %6.2f s\n", r.samples.back().t);
  if (v.variant.current) {
    std::printf("  tool error while holding the grasp   %8.3f mm at most over 10 s\n",
                r.steady_error * 1e3);
  } else {
    std::printf("  tool error at grasp                  %8.3f mm  %7.4f deg\n",
                r.grasp_position_error * 1e3, r.grasp_orientation_error / degree);
  }
  std::printf("  tool error after lifting %.1f m        %8.3f mm  %7.4f deg\n", grasp::lift_height,
              r.lift_position_error * 1e3, r.lift_orientation_error / degree);
  std::printf(" inequality objectives violated later ");
  if (r.violations.empty()) std::printf("    none");
  for (const auto& name : r.violations) std::printf(" [%s]", name.c_str());
  std::printf("\n  largest change of command in a cycle %8.4f\n", r.largest_step);
  std::printf("  computing time per cycle, with plant %8.1f us\n",
              seconds * 1e6 / static_cast<double>(r.samples.size()));
  if (r.outcome == "lifted") return;
  std::printf("  STOPPED: %s\n", r.outcome.empty() ? icat::describe(r.status) : r.outcome.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> names;
  for (const auto& v : variants) names.emplace_back(v.name);
  const auto arguments = support::parse(
      argc, argv, "The reference mission: navigate, grasp a pipe, lift it.", "out/01_grasp", names);

  support::Replay replay("A vehicle comes to a pipe, grasps it and lifts it", true);
  bool all_well = true;
  double without = 0, with = 0;
  for (const auto& v : variants) {
    if (!arguments.variant.empty() && arguments.variant != v.name) continue;
    const std::clock_t begin = std::clock();
    support::Reasons<icat::ParallelController<grasp::Robot>> compensated;
    support::Reasons<icat::Controller<grasp::Robot>> plain;
    const grasp::Result r = grasp::run(v.variant, 0.01, [&](const grasp::Cycle& now) {
      if (v.variant.compensation) {
        compensated.record(now.t, now.controller);
      } else {
        plain.record(now.t, now.whole_body);
      }
    });
    print(v, r,
          static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC - compensated.seconds() -
              plain.seconds());
    if (v.variant.current) (v.variant.compensation ? with : without) = r.steady_error;
    all_well = all_well && r.outcome == "lifted" && r.violations.empty();
    const std::string folder = arguments.output + "/" + v.name;
    write_csv(folder, r);
    write_scene(folder, r);
    add_to(replay, v, r, v.variant.compensation ? compensated.sentences() : plain.sentences());
    if (arguments.pictures) draw(folder, v.title, r);
  }
  if (with > 0 && without > 0) {
    std::printf("\nIn the current, the compensation makes the tool error %.0f times smaller.\n",
                without / with);
  }
  std::printf("\nCSV%s in %s\n", support::drawn() ? " and pictures" : "", arguments.output.c_str());
  replay.look(-1.5, 0.3);
  replay.show("current", "compensated");
  replay.write(arguments.output, arguments.logs);
  return all_well ? 0 : 1;
}
