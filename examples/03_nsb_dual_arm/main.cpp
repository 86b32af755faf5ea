// SPDX-License-Identifier: BSD-3-Clause
// Runs the dual-arm vehicle of [NSB], prints null-space-based guidance and iCAT side by side,
// writes CSV and, where gnuplot is found, pictures.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "../support/command_line.hpp"
#include "../support/support.hpp"
#include "mission.hpp"

namespace {

namespace fs = std::filesystem;

struct Run {
  const char *scenario, *method, *file;
  nsb::Scenario settings;
  nsb::Result result;
};

void write_csv(const fs::path& file, const nsb::Result& r) {
  std::ofstream out(file);
  out.precision(9);
  out << "t,x,y,psi,q11,q12,q13,q21,q22,reference_x,reference_y,reference_psi,"
         "error_x,error_y,error_psi,error_orientation,error_distance,error_view,error_joint,"
         "u,v,r,qdot11,qdot12,qdot13,qdot21,qdot22\n";
  const auto row = [&](const auto& v) {
    for (const double x : v) out << ',' << x;
  };
  for (std::size_t i = 0; i < r.samples.size(); i += 5) {
    const auto& s = r.samples[i];
    out << s.t;
    row(s.state.vehicle);
    row(s.state.q1);
    row(s.state.q2);
    row(s.reference);
    row(s.error);
    row(s.velocity);
    out << '\n';
  }
}

constexpr std::array<double, 4> snapshots{0, 4, 125, 250};  // s

// Five blocks for each snapshot: hull, arm 1, arm 2, pointing direction, reference; then the line.
void write_snapshots(const fs::path& file, const nsb::Scenario& scenario, const nsb::Result& r) {
  std::ofstream out(file);
  const auto point = [&](const nsb::Vector2& p) { out << p.x() << ',' << p.y() << '\n'; };
  for (const double t : snapshots) {
    const auto s = std::find_if(r.samples.begin(), r.samples.end(),
                                [&](const nsb::Sample& sample) { return sample.t >= t - 1e-9; });
    const auto& d = scenario.dimensions;
    const auto in_body = [&](const nsb::Vector2& p) {
      point(s->state.vehicle.head<2>() + nsb::rotation(s->state.vehicle.z()) * p);
    };
    for (const auto& [x, y] : {std::pair{1, 1}, {-1, 1}, {-1, -1}, {1, -1}, {1, 1}}) {
      in_body({x * d.length / 2, y * d.height / 2});
    }
    const auto arm1 = nsb::arm1_points(d, s->state.q1);
    const auto arm2 = nsb::arm2_points(d, s->state.q2);
    out << "\n\n";
    for (int j = 0; j < 4; ++j) in_body(arm1.col(j));
    out << "\n\n";
    for (int j = 0; j < 3; ++j) in_body(arm2.col(j));
    out << "\n\n";
    const double angle = s->state.q2.sum();
    in_body(arm2.col(2));
    in_body(arm2.col(2) + 1.15 * (arm1.col(3) - arm2.col(2)).norm() *
                              nsb::Vector2(std::cos(angle), std::sin(angle)));
    out << "\n\n";
    point(s->reference.head<2>());
    out << "\n\n";
  }
  point(scenario.line().start);
  point(scenario.line().end);
}

bool draw(const fs::path& folder) {
  std::string variables = "folder = " + support::quoted(folder.string()) + "\ntimes = '";
  for (const double t : snapshots) variables += std::to_string(static_cast<int>(t)) + " ";
  return support::draw(variables + "'");
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
  const char* tasks[] = {"tool pose (m, rad)", "vehicle orientation (rad)", "vertical distance (m)",
                         "field of view", "first joint (rad)"};
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
  row(runs, "  u (m/s, at most 3)", [](const auto& r) { return number(r.peak(0), 2); });
  row(runs, "  v (m/s, at most 2)", [](const auto& r) { return number(r.peak(1), 2); });
  row(runs, "  r (deg/s, at most 3)",
      [](const auto& r) { return number(r.peak(2) / nsb::degree, 1); });
  row(runs, "  arm 1 (deg/s, at most 10)", [](const auto& r) {
    return number(r.peak.template segment<3>(3).maxCoeff() / nsb::degree, 1);
  });
  row(runs, "  arm 2 (deg/s, at most 10)",
      [](const auto& r) { return number(r.peak.template tail<2>().maxCoeff() / nsb::degree, 1); });
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
      {"line", "iCAT", "line_icat", line, nsb::run_icat(line)},
      {"conflict", "NSB", "conflict_nsb", conflict, nsb::run_nsb(conflict)},
      {"conflict", "iCAT", "conflict_icat", conflict, nsb::run_icat(conflict)},
      {"limit", "NSB", "limit_nsb", limit, nsb::run_nsb(limit)},
      {"limit", "NSB, stops", "limit_nsb_stops", stops, nsb::run_nsb(stops)},
      {"limit", "iCAT", "limit_icat", limit, nsb::run_icat(limit)}};
  print(runs);
  const nsb::Order order = nsb::random_starts(100);
  std::printf(
      "\nNSB from %d random starts: all errors below %g on the line from %d of them, in the order\n"
      "of priority for the leader from %d, for the follower from %d.\n",
      order.starts, nsb::tolerance, order.converged, order.leader, order.follower);

  fs::create_directories(arguments.output);
  bool all_well = true;
  for (const Run& run : runs) {
    write_csv(fs::path(arguments.output) / (std::string(run.file) + ".csv"), run.result);
    all_well = all_well && run.result.status == icat::Status::ok;
    if (run.settings.reach < 1 && !run.settings.stops) {
      for (const double error : run.result.last_error) all_well &= error < nsb::tolerance;
    }
  }
  write_snapshots(fs::path(arguments.output) / "snapshots.csv", line, runs[0].result);
  const bool drawn = arguments.pictures && draw(arguments.output);
  std::printf("\nCSV%s in %s\n", drawn ? " and pictures" : "", arguments.output.c_str());
  return all_well ? 0 : 1;
}
