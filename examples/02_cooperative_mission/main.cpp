// SPDX-License-Identifier: BSD-3-Clause
// Runs the cooperative mission in still water, in a current, and with one solver for both robots;
// prints its figures beside the paper's, writes CSV and, where gnuplot is found, pictures.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <map>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/reasons.hpp"
#include "../support/replay.hpp"
#include "../support/support.hpp"
#include "mission.hpp"

namespace {

namespace fs = std::filesystem;
constexpr double degree = std::numbers::pi / 180;

struct NamedVariant {
  const char* name;
  const char* title;
  cooperation::Variant variant;
};
const std::vector<NamedVariant> variants{
    {"plain", "still water", {}},
    {"current", "sinusoidal current, no compensation", {.current = true}},
    {"compensated",
     "sinusoidal current, the arms compensate",
     {.current = true, .compensation = true}},
    {"centralized", "still water, one solver for both", {.centralized = true}}};

void write_csv(const fs::path& folder, const cooperation::Result& r) {
  std::string header = "t,phase,grasped";
  for (const char* robot : {"_a", "_b"}) {
    const auto add = [&](const std::string& column) { header += ',' + column + robot; };
    for (const char* joint : {"q", "qdot"}) {
      for (int i = 1; i <= 7; ++i) add(joint + std::to_string(i));
    }
    for (const char* column : {"surge",
                               "sway",
                               "heave",
                               "roll_rate",
                               "pitch_rate",
                               "yaw_rate",
                               "actual_surge",
                               "actual_sway",
                               "actual_heave",
                               "actual_roll_rate",
                               "actual_pitch_rate",
                               "actual_yaw_rate",
                               "vehicle_x",
                               "vehicle_y",
                               "vehicle_z",
                               "tool_x",
                               "tool_y",
                               "tool_z",
                               "joint_margin",
                               "manipulability",
                               "attitude",
                               "centering"}) {
      add(column);
    }
    for (int i = 1; i <= 7; ++i) add("a_limit" + std::to_string(i));
    for (const char* task : cooperation::task_names) add(std::string("a_") + task);
  }
  header +=
      ",object_x,object_y,object_z,position_error,orientation_error,distance,mismatch,"
      "agreed_x,agreed_y,agreed_z,agreed_wx,agreed_wy,agreed_wz";
  support::Csv csv(folder, "mission.csv", header);
  for (const auto& s : r.samples) {
    std::vector<double> robots;
    const auto add = [&](const auto& values) {
      robots.insert(robots.end(), values.begin(), values.end());
    };
    for (const auto& x : s.robots) {
      add(x.q), add(x.command), add(x.vehicle_velocity);
      add(x.vehicle.translation()), add(x.tool.translation());
      add(std::array{x.joint_margin, x.manipulability, x.attitude, x.centering});
      add(x.limit_activations), add(x.activations);
    }
    csv.row(s.t, s.phase, s.grasped, robots, s.object.translation(), s.position_error,
            s.orientation_error, s.distance, s.mismatch, s.agreed);
  }
}

// The moments of Fig. 4: start, grasp, transport, pre-deployment, deployment, end.
std::vector<double> snapshot_times(const cooperation::Result& r) {
  return {0, r.ends[1], (r.ends[2] + r.ends[3]) / 2, r.ends[3], r.ends[4], r.samples.back().t};
}

// Hull and arm of either robot, the pipe.
void write_scene(const fs::path& folder, const cooperation::Result& r) {
  support::Strokes strokes(folder, "scene.csv");
  for (const double t : snapshot_times(r)) {
    const auto& s = support::sample_at(r.samples, t);
    for (const auto& robot : s.robots) support::draw_robot(strokes, robot);
    const cooperation::Vector3 end(1.7, 0, 0);
    strokes.add({s.object * -end, s.object * end});
  }
}

using Reasons = std::array<support::Reasons<icat::Agent<cooperation::Robot>>, 2>;

void add_to(support::Replay& replay, const NamedVariant& v, const cooperation::Result& r,
            const Reasons& reasons) {
  support::UvmsRun run(replay, v.name, v.title, r.samples.size());
  icat::Log& log = run.log();
  std::vector<std::string> tasks(cooperation::task_names.begin(), cooperation::task_names.end());
  for (std::string& task : tasks) std::replace(task.begin(), task.end(), '_', ' ');
  const auto object = log.add("object", "m", icat::LogKind::pose),
             position = log.add("error/object position", "m"),
             orientation = log.add("error/object orientation", "rad"),
             mismatch = log.add("error/mismatch of the tools", "m/s, rad/s"),
             distance = log.add("distance/between the vehicles", "m");
  run.add_plot("Errors of the object", "error/", "m, rad, m/s", true);
  run.add_robot("a/", tasks, cooperation::camera_mount(), "#d98a2b");
  run.add_robot("b/", tasks, cooperation::camera_mount(), "#3d8fb5");
  run.add_plot("Distance", "distance/", "", false);
  run.add_pipe("object", cooperation::Pose::Identity(), 3.6, 1);
  run.add_pipe("", cooperation::pre_deployment, 3.6, 0.2);
  run.add_pipe("", cooperation::deployment, 3.6, 0.2);
  run.add_path("object");
  run.add_ground(1.5, 2.5, 3.06);
  bool held = false;
  std::size_t reason = 0;
  const auto &of_a = reasons[0].sentences(), &of_b = reasons[1].sentences();
  for (const auto& s : r.samples) {
    if (!log.begin(s.t)) continue;
    for (std::size_t i = 0; i < 2; ++i) run.record(i, s.robots[i], s.robots[i].activations.data());
    log.set(object, s.object);
    log.set(position, s.position_error);
    log.set(orientation, s.orientation_error);
    if (s.grasped) log.set(mismatch, s.mismatch);
    log.set(distance, s.distance);
    log.phase(s.t, cooperation::phase_names[s.phase]);
    if (s.grasped != held) log.event(s.t, held ? "both let go of the pipe" : "both hold the pipe");
    held = s.grasped;
    for (; reason < of_a.size() && of_a[reason].first <= s.t; ++reason) {
      log.explain(s.t, "a: " + of_a[reason].second + "\nb: " + of_b[reason].second);
    }
  }
}

// Fig. 2: the activation of x <= 0.1 with β = 0.05.
void write_activation(const fs::path& folder, bool pictures) {
  const auto objective = cooperation::Objective::at_most(0.1, 0.05);
  {
    support::Csv csv(folder, "activation.csv", "x,a");
    for (int k = 0; k <= 150; ++k) csv.row({0.001 * k, objective.activation(0.001 * k)});
  }
  if (pictures) support::draw(folder, {}, ICAT_EXAMPLE_FOLDER "/activation.gp");
  std::printf(
      "\n| Fig. 2 | x = 0.05 | 0.0625 | 0.075 | 0.0875 | 0.1 |\n|---|---|---|---|---|---|\n");
  std::printf("| activation |");
  for (const double x : {0.05, 0.0625, 0.075, 0.0875, 0.1}) {
    std::printf(" %.3f |", objective.activation(x));
  }
  std::printf("\n");
}

// [Coop, Table I], of the actions as they are: where a task stands in them.
void print_activations() {
  cooperation::Side side(-1, {});
  const auto actions = side.actions();
  using Task = icat::Task<cooperation::Robot>;
  const std::vector<std::pair<const char*, std::vector<const Task*>>> rows{
      {"joint limits", {&side.joint_limits}},
      {"vehicle distance", {&side.vehicle_distance}},
      {"manipulability", {&side.manipulability}},
      {"camera centering", {&side.centering}},
      {"horizontal attitude", {&side.attitude}},
      {"vehicle pose", {&side.vehicle_pose}},
      {"tool pose", {&side.tool_grasp, &side.tool_transport, &side.tool_deploy, &side.tool_away}},
      {"still arm", {&side.still_arm}},
      {"still vehicle", {&side.still_vehicle}}};
  const auto active = [](const icat::Action<cooperation::Robot>& action, const auto& tasks) {
    for (const auto& level : action.levels) {
      for (const Task& task : level) {
        if (std::find(tasks.begin(), tasks.end(), &task) != tasks.end()) return true;
      }
    }
    return false;
  };
  std::printf("\n| activation, Table I |");
  for (const auto& action : actions) std::printf(" %s |", action.name.c_str());
  std::printf("\n|---|---|---|---|---|---|---|---|\n");
  for (const auto& [name, tasks] : rows) {
    std::printf("| %s |", name);
    bool before = active(actions[0], tasks);
    for (const auto& action : actions) {
      const bool now = active(action, tasks);
      std::printf(before == now ? " %d |" : " %d → %d |", before ? 1 : 0, now ? 1 : 0);
      before = now;
    }
    std::printf("\n");
  }
}

// What each robot sends in a cycle.
void print_message() {
  std::printf("\n| a message has | numbers | bits |\n|---|---|---|\n");
  for (const bool spans : {false, true}) {
    icat::Agreement<double> agreement({.spans = spans});
    const auto v = cooperation::Vector6::Zero();
    if (agreement.propose(v, v) != icat::Status::ok) continue;
    const std::size_t bytes = agreement.send(0).size();
    std::printf("| %s | %zu | %zu |\n", spans ? "velocity and spans" : "velocity",
                bytes / sizeof(float), 8 * bytes);
  }
}

void draw(const fs::path& folder, const char* title, const cooperation::Result& r) {
  std::string tasks, ends, snapshots;
  for (const char* task : cooperation::task_names) tasks += std::string(task) + ' ';
  for (const double end : r.ends) ends += std::to_string(end) + ' ';
  for (const double t : snapshot_times(r)) snapshots += std::to_string(t) + ' ';
  support::draw(folder,
                {{"mission", title}, {"tasks", tasks}, {"ends", ends}, {"snapshots", snapshots}});
}

// When the phases end, or how long they take. The paper names two moments of its second run.
void print_phases(const std::map<std::string, cooperation::Result>& results, bool durations) {
  const auto value = [&](const auto& ends, std::size_t k) {
    return durations ? cooperation::duration(ends, k) : ends[k];
  };
  std::printf("\n| phase %s (s) | paper |", durations ? "takes" : "ends at");
  for (const auto& v : variants) {
    if (results.contains(v.name)) std::printf(" %s |", v.name);
  }
  std::printf(" paper, in the current, compensated |\n|---|---|---|");
  for (std::size_t i = 0; i < results.size(); ++i) std::printf("---|");
  std::printf("\n");
  for (std::size_t k = 0; k < 7; ++k) {
    std::printf("| %s | %.2f |", cooperation::phase_names[k], value(cooperation::paper_ends, k));
    for (const auto& v : variants) {
      const auto r = results.find(v.name);
      if (r == results.end()) continue;
      if (k < r->second.ends.size()) {
        std::printf(" %.2f |", value(r->second.ends, k));
      } else {
        std::printf(" - |");
      }
    }
    const auto& [begin, end] = cooperation::paper_transport_in_current;
    if (k == 2 && !durations) {
      std::printf(" %.2f |\n", begin);
    } else if (k == 3) {
      std::printf(" %.2f |\n", durations ? end - begin : end);
    } else {
      std::printf(" |\n");
    }
  }
}

void print_figures(const NamedVariant& v, const cooperation::Result& r, double seconds) {
  std::printf("\n%s: %s\n\n| | |\n|---|---|\n", v.name, v.title);
  std::printf("| object at pre-deployment | %.3f mm, %.4f deg |\n", r.pre_deployment_position * 1e3,
              r.pre_deployment_orientation / degree);
  std::printf("| object at deployment | %.3f mm, %.4f deg |\n", r.deployment_position * 1e3,
              r.deployment_orientation / degree);
  std::printf("| tools' mismatch while grasped, at most | %.1e |\n", r.mismatch);
  std::printf("| drift of the relative tool pose, at most | %.3f mm, %.4f deg |\n", r.drift * 1e3,
              r.drift_angle / degree);
  if (!v.variant.centralized) {
    std::printf("| error of the object velocity, RMS | %.1e |\n", r.object_speed_error);
  }
  std::printf("| joint limit margin, at least | %.3f rad |\n", r.joint_margin);
  std::printf("| vehicle distance, at least (limit %.1f) | %.3f m |\n",
              cooperation::minimum_distance, r.distance);
  std::printf("| manipulability, at least (limit %.3f) | %.4f |\n",
              cooperation::minimum_manipulability, r.manipulability);
  std::printf("| attitude, at most (limit %.2f) | %.3f rad |\n", cooperation::maximum_attitude,
              r.attitude);
  std::printf("| change of the command in a cycle, at most | %.4f |\n", r.step);
  std::printf("| the same at grasp and release | %.4f |\n", r.event_step);
  std::printf("| largest change of alternating sign over three cycles | %.1e |\n", r.chatter);
  std::printf("| faster than real time on one core | %.0f x |\n", r.samples.back().t / seconds);
  if (r.outcome == "done") return;
  std::printf("\nSTOPPED: %s\n", r.outcome.empty() ? icat::describe(r.status) : r.outcome.c_str());
}

void print_comparison(const cooperation::Result& own, const cooperation::Result& central) {
  std::printf("\n| | decentralised | centralised |\n|---|---|---|\n");
  std::printf("| object at deployment | %.3f mm, %.4f deg | %.3f mm, %.4f deg |\n",
              own.deployment_position * 1e3, own.deployment_orientation / degree,
              central.deployment_position * 1e3, central.deployment_orientation / degree);
  std::printf("| joint limit margin, at least | %.3f rad | %.3f rad |\n", own.joint_margin,
              central.joint_margin);
  std::printf("| transport takes | %.2f s | %.2f s |\n", own.ends[3] - own.ends[2],
              central.ends[3] - central.ends[2]);
  std::printf("| bits exchanged per second and robot | %.0f | %.0f |\n", own.bits_per_second,
              central.bits_per_second);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> names;
  for (const auto& v : variants) names.emplace_back(v.name);
  const auto arguments = support::parse(
      argc, argv, "Two vehicles grasp a pipe, carry it to another place and set it down.",
      "out/02_cooperative_mission", names);

  std::map<std::string, cooperation::Result> results;
  support::Replay replay("Two vehicles grasp a pipe, carry it and set it down", true);
  bool all_well = true;
  for (const auto& v : variants) {
    if (!arguments.variant.empty() && arguments.variant != v.name) continue;
    const std::clock_t begin = std::clock();
    double seconds = 0;
    Reasons reasons;
    {
      support::ProgressBar bar(v.name);
      results[v.name] =
          cooperation::run(v.variant, [&](double t, const cooperation::Agents& agents) {
            bar.show(t / 60);
            if (v.variant.centralized) return;  // one solver for both, and nothing explains it
            for (std::size_t i = 0; i < 2; ++i) reasons[i].record(t, *agents[i]);
          });
      seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC - reasons[0].seconds() -
                reasons[1].seconds();
    }
    const auto& r = results[v.name];
    print_figures(v, r, seconds);
    all_well = all_well && r.outcome == "done";
    if (r.outcome != "done") continue;
    const fs::path folder = fs::path(arguments.output) / v.name;
    write_csv(folder, r);
    write_scene(folder, r);
    add_to(replay, v, r, reasons);
    if (arguments.pictures) draw(folder, v.title, r);
  }
  print_phases(results, false);
  print_phases(results, true);
  print_activations();
  print_message();
  write_activation(arguments.output, arguments.pictures);
  if (arguments.variant.empty() && all_well) {
    print_comparison(results["plain"], results["centralized"]);
    std::printf(
        "\nIn the current, the compensation makes the error of the object's velocity "
        "%.0f times smaller.\n",
        results["current"].object_speed_error / results["compensated"].object_speed_error);
  }
  std::printf("\nCSV%s in %s\n", support::drawn() ? " and pictures" : "", arguments.output.c_str());
  replay.look(-2.4, 0.4);
  replay.show("current", "compensated");
  replay.write(arguments.output, arguments.logs);
  return all_well ? 0 : 1;
}
