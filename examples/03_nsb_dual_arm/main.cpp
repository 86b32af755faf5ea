// SPDX-License-Identifier: BSD-3-Clause
// Simulates the dual-arm vehicle of [NSB], prints results of null-space-based guidance and of iCAT,
// writes CSV and, where gnuplot is found, pictures.
#include <cstdio>
#include <filesystem>
#include <string>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/reasons.hpp"
#include "../support/robot_replay.hpp"
#include "../support/support.hpp"
#include "mission.hpp"

namespace {

namespace fs = std::filesystem;

struct Run {
  const char *scenario, *method, *file;
  nsb::Scenario settings;
  nsb::Result result;
  std::vector<std::pair<double, std::string>> reasons = {};
};

Run run_icat(const char* scenario, const char* file, const nsb::Scenario& settings) {
  support::Reasons<icat::Controller<nsb::Robot>> reasons;
  nsb::Result result = nsb::run_icat(
      settings, [&](double t, const auto& controller) { reasons.record(t, controller); });
  return {scenario, "iCAT", file, settings, std::move(result), reasons.sentences()};
}

constexpr const char* tasks[] = {"tool pose (m, rad)", "vehicle orientation (rad)",
                                 "vertical distance (m)", "field of view", "first joint (rad)"};
constexpr std::size_t every = 10;  // samples of the replay: ten a second

void write_csv(const std::string& folder, const std::string& name, const nsb::Result& r) {
  support::Csv csv(folder, name + ".csv",
                   "t,x,y,psi,q21,q22,q11,q12,q13,reference_x,reference_y,reference_psi,"
                   "error_x,error_y,error_psi,error_orientation,error_distance,error_view,"
                   "error_joint,qdot21,qdot22,qdot11,qdot12,qdot13,u,v,r");
  const auto in_plane = [](const nsb::Pose& p) {
    return nsb::Vector3(p(0, 3), p(1, 3), std::atan2(p(1, 0), p(0, 0)));
  };
  for (std::size_t i = 0; i < r.samples.size(); i += 5) {
    const auto& s = r.samples[i];
    csv.row(s.t, in_plane(s.vehicle), s.q, in_plane(s.reference), s.error, s.velocity);
  }
}

constexpr std::array<double, 4> snapshots{0, 4, 125, 250};  // s

// Five blocks for each snapshot: hull, arm 1, arm 2, pointing direction, reference; then the line.
void write_snapshots(const std::string& folder, const nsb::Scenario& scenario,
                     const nsb::Result& r) {
  support::Strokes strokes(folder, "snapshots.csv");
  nsb::Robot robot = scenario.robot();
  const auto at = [&](const std::vector<const char*>& frames) {
    std::vector<nsb::Vector3> points;
    for (const char* f : frames) points.push_back(robot.pose(robot.frame(f)).translation());
    return points;
  };
  const double x = scenario.dimensions.length / 2, y = scenario.dimensions.height / 2;
  for (const double t : snapshots) {
    const auto& s = support::sample_at(r.samples, t);
    if (robot.update(s.q, s.vehicle) != icat::Status::ok) return;
    std::vector<nsb::Vector3> hull{{x, y, 0}, {-x, y, 0}, {-x, -y, 0}, {x, -y, 0}, {x, y, 0}};
    for (auto& corner : hull) corner = s.vehicle * corner;
    strokes.add(hull);
    const auto arm1 = at({"arm1", "arm1_link1", "arm1_link2", "arm1_link3"});
    const auto arm2 = at({"arm2", "arm2_link1", "arm2_link2"});
    strokes.add(arm1);
    strokes.add(arm2);
    const double range = (arm1.back() - arm2.back()).norm();
    strokes.add(
        {arm2.back(), robot.pose(robot.frame("arm2_link2")) * nsb::Vector3(1.15 * range, 0, 0)});
    strokes.add({s.reference.translation()});
  }
  strokes.add(
      {r.samples.front().reference.translation(), r.samples.back().reference.translation()});
}

void draw(const std::string& folder) {
  std::string times;
  for (const double t : snapshots) times += std::to_string(static_cast<int>(t)) + " ";
  support::draw(folder, {{"times", times}});
}

void add_to(support::Replay& replay, const Run& run) {
  nsb::Robot robot = run.settings.robot();
  auto& shown = replay.add(std::string(run.scenario) + ", " + run.method,
                           run.method + std::string(", scenario ") + run.scenario,
                           run.result.samples.size() / every + 1);
  icat::Log& log = replay.log();
  const std::vector<std::string> frames{"arm1_link3", "arm2_link2"};
  const auto vehicle = log.add("frame/base", "m", icat::LogKind::pose),
             hand = log.add("frame/" + frames[0], "m", icat::LogKind::pose),
             camera = log.add("frame/" + frames[1], "m", icat::LogKind::pose);
  const auto& size = run.settings.dimensions;
  support::RobotPicture picture(shown, log, robot,
                                {.frames = frames,
                                 .base = {size.length, size.height, 0.3},
                                 .ground = -0.4,
                                 .ground_edge = 18});
  shown.shapes.push_back({.form = icat::ReplayForm::path, .frame = "goal", .color = "#2fa36b"});
  shown.shapes.push_back({.form = icat::ReplayForm::cone,
                          .frame = "frame/" + frames[1],
                          .at = support::pose({0, 0, 0}, 0, 90 * nsb::degree, 0),
                          .size = {0.1, 1.2, 0},
                          .color = "#f4d35e",
                          .opacity = 0.3});
  shown.plots = {{"Errors of the tasks", {"error/"}, "m, rad", 0, 0, true},
                 {"Velocities of the joints", {"joint velocity/"}},
                 {"Velocities of the vehicle", {"vehicle velocity/"}}};
  std::vector<icat::LogChannel> errors, velocities;
  for (const char* task : tasks) errors.push_back(log.add(std::string("error/") + task));
  for (const auto& joint : robot.joints()) {
    velocities.push_back(log.add("joint velocity/" + joint.name, "rad/s"));
  }
  for (const char* name : {"surge", "sway", "yaw rate"}) {
    velocities.push_back(log.add(std::string("vehicle velocity/") + name, "m/s, rad/s"));
  }
  bool was_past = false;
  auto reason = run.reasons.begin();
  for (std::size_t i = 0; i < run.result.samples.size(); i += every) {
    const auto& s = run.result.samples[i];
    if (!log.begin(s.t) || robot.update(s.q, s.vehicle) != icat::Status::ok) continue;
    log.set(vehicle, s.vehicle);
    log.set(hand, robot.pose(robot.frame(frames[0])));
    log.set(camera, robot.pose(robot.frame(frames[1])));
    picture.record();
    picture.set_goal(s.reference.translation());
    for (std::size_t k = 0; k < errors.size(); ++k) log.set(errors[k], s.task_error[k]);
    for (std::size_t k = 0; k < velocities.size(); ++k) {
      log.set(velocities[k], s.velocity(static_cast<icat::Index>(k)));
    }
    log.phase(s.t,
              s.t < run.settings.length / run.settings.speed ? "along the line" : "at its end");
    const bool past = support::joint_margin(robot) < -1e-3;
    if (past != was_past) {
      log.event(s.t, past ? "A joint passes its limit." : "All joints are within their limits.");
    }
    was_past = past;
    for (; reason != run.reasons.end() && reason->first <= s.t; ++reason) {
      log.explain(s.t, reason->second);
    }
  }
}

template <class Cell>
void row(const std::vector<Run>& runs, const char* name, Cell cell) {
  std::printf("%-31s", name);
  for (const Run& run : runs) std::printf("%11s", cell(run.result).c_str());
  std::printf("\n");
}

std::string number(double value, int digits) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

void print(const std::vector<Run>& runs) {
  std::printf("%-31s", "");
  for (const Run& run : runs) std::printf("%11s", run.scenario);
  std::printf("\n%-31s", "");
  for (const Run& run : runs) std::printf("%11s", run.method);
  std::printf("\nerror below %g from (s)\n", nsb::tolerance);
  for (std::size_t k = 0; k < 5; ++k) {
    row(runs, (std::string("  ") + tasks[k]).c_str(), [&](const nsb::Result& r) {
      return r.converged[k] > r.samples.back().t ? "never" : number(r.converged[k], 2);
    });
  }
  std::printf("largest error, second half of the line\n");
  for (std::size_t k = 0; k < 5; ++k) {
    row(runs, (std::string("  ") + tasks[k]).c_str(),
        [&](const nsb::Result& r) { return number(r.line_error[k], 4); });
  }
  std::printf("peak velocity\n");
  row(runs, "  u (m/s, at most 3)", [](const auto& r) { return number(r.peak(5), 2); });
  row(runs, "  v (m/s, at most 2)", [](const auto& r) { return number(r.peak(6), 2); });
  row(runs, "  r (deg/s, at most 3)",
      [](const auto& r) { return number(r.peak(7) / nsb::degree, 1); });
  row(runs, "  arm 1 (deg/s, at most 10)", [](const auto& r) {
    return number(r.peak.template segment<3>(2).maxCoeff() / nsb::degree, 1);
  });
  row(runs, "  arm 2 (deg/s, at most 10)",
      [](const auto& r) { return number(r.peak.template head<2>().maxCoeff() / nsb::degree, 1); });
  row(runs, "largest change in 10 ms", [](const auto& r) { return number(r.largest_step, 3); });
  row(runs, "joint past its limit (deg)", [](const auto& r) {
    return r.past_limit > 0 ? number(r.past_limit / nsb::degree, 1) : "no";
  });
}

}  // namespace

int main(int argc, char** argv) {
  const auto arguments = support::parse(
      argc, argv, "Null-space-based guidance of a planar dual-arm vehicle, and iCAT beside it.",
      "out/03_nsb_dual_arm");

  const nsb::Scenario line, conflict = nsb::conflict(), limit = nsb::joint_limit();
  nsb::Scenario stops = limit;
  stops.stops = true;
  const std::vector<Run> runs{
      {"line", "NSB", "line_nsb", line, nsb::run_nsb(line)},
      run_icat("line", "line_icat", line),
      {"conflict", "NSB", "conflict_nsb", conflict, nsb::run_nsb(conflict)},
      run_icat("conflict", "conflict_icat", conflict),
      {"limit", "NSB", "limit_nsb", limit, nsb::run_nsb(limit)},
      {"limit", "NSB, stops", "limit_nsb_stops", stops, nsb::run_nsb(stops)},
      run_icat("limit", "limit_icat", limit)};
  print(runs);
  const nsb::Order order = nsb::random_starts(100);
  std::printf(
      "\nNSB from %d random starts: all errors below %g on the line from %d of them, in the order\n"
      "of priority for the leader from %d, for the follower from %d.\n",
      order.starts, nsb::tolerance, order.converged, order.leader, order.follower);

  support::Replay replay("Null-space-based guidance and iCAT on a planar vehicle with two arms");
  bool all_well = true;
  for (const Run& run : runs) {
    write_csv(arguments.output, run.file, run.result);
    all_well = all_well && run.result.status == icat::Status::ok;
    if (run.settings.reach < 1 && !run.settings.stops) {
      add_to(replay, run);
      for (const double error : run.result.last_error) all_well &= error < nsb::tolerance;
    }
  }
  write_snapshots(arguments.output, line, runs[0].result);
  if (arguments.pictures) draw(arguments.output);
  std::printf("\nCSV%s in %s\n", support::drawn() ? " and pictures" : "", arguments.output.c_str());
  replay.look(-90 * nsb::degree, 85 * nsb::degree);
  replay.show("limit, NSB", "limit, iCAT");
  replay.write(arguments.output, arguments.logs);
  return all_well ? 0 : 1;
}
