// SPDX-License-Identifier: BSD-3-Clause
// Runs the reference mission, prints its summary, writes CSV and, where gnuplot is found, pictures.
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "../support/command_line.hpp"
#include "../support/support.hpp"
#include "mission.hpp"

namespace {

namespace fs = std::filesystem;
constexpr double degree = std::numbers::pi / 180;

struct NamedVariant {
  const char* name;
  const char* title;
  grasp::Variant variant;
};
const std::vector<NamedVariant> variants{
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

void write_csv(const fs::path& file, const grasp::Result& r) {
  std::ofstream out(file);
  out.precision(9);
  out << "t";
  for (int i = 1; i <= 7; ++i) out << ",q" << i;
  for (int i = 1; i <= 7; ++i) out << ",qdot" << i;
  for (const char* c : {"surge", "sway", "heave", "roll_rate", "pitch_rate", "yaw_rate"}) {
    out << ",command_" << c << ",actual_" << c;
  }
  out << ",vehicle_x,vehicle_y,vehicle_z,tool_x,tool_y,tool_z,position_error,orientation_error,"
         "joint_margin,manipulability,centering,attitude,distance,vehicle_position,"
         "vehicle_orientation";
  for (const auto& task : r.tasks) out << ",a_" << column_name(task);
  out << '\n';
  for (const auto& s : r.samples) {
    out << s.t;
    for (int i = 0; i < 7; ++i) out << ',' << s.q(i);
    for (int i = 0; i < 7; ++i) out << ',' << s.command(i);
    for (int i = 0; i < 6; ++i) out << ',' << s.command(7 + i) << ',' << s.vehicle_velocity(i);
    for (int i = 0; i < 3; ++i) out << ',' << s.vehicle.translation()(i);
    for (int i = 0; i < 3; ++i) out << ',' << s.tool.translation()(i);
    out << ',' << s.position_error << ',' << s.orientation_error << ',' << s.joint_margin << ','
        << s.manipulability << ',' << s.centering << ',' << s.attitude << ',' << s.distance << ','
        << s.vehicle_position << ',' << s.vehicle_orientation;
    for (const double a : s.activations) out << ',' << a;
    out << '\n';
  }
}

// Snapshots for the 3-D view: blocks of points, hull and arm in turn.
void write_scene(const fs::path& file, const grasp::Result& r) {
  std::ofstream out(file);
  const auto point = [&](const grasp::Vector3& p) {
    out << p.x() << ',' << p.y() << ',' << p.z() << '\n';
  };
  std::vector<double> times;
  for (const auto& phase : r.phases) times.push_back(phase.second);
  times.push_back(r.samples.back().t);
  times.insert(times.begin() + 1, times[1] / 3);
  times.insert(times.begin() + 2, times[2] / 3 * 2);
  for (const double t : times) {
    const auto s = std::find_if(r.samples.begin(), r.samples.end(),
                                [&](const auto& sample) { return sample.t >= t - 1e-9; });
    // The hull, a box of 1.0 × 0.6 × 0.73 m, drawn in one stroke, then the arm.
    const double x = 0.5, y = 0.3, top = -0.3, bottom = 0.43;
    for (const auto& p : std::vector<grasp::Vector3>{{x, y, top},
                                                     {-x, y, top},
                                                     {-x, -y, top},
                                                     {x, -y, top},
                                                     {x, y, top},
                                                     {x, y, bottom},
                                                     {-x, y, bottom},
                                                     {-x, y, top},
                                                     {-x, y, bottom},
                                                     {-x, -y, bottom},
                                                     {-x, -y, top},
                                                     {-x, -y, bottom},
                                                     {x, -y, bottom},
                                                     {x, -y, top},
                                                     {x, -y, bottom},
                                                     {x, y, bottom}}) {
      point(s->vehicle * p);
    }
    out << "\n\n";
    for (int j = 0; j < s->arm.cols(); ++j) point(s->arm.col(j));
    out << "\n\n";
  }
}

bool draw(const fs::path& folder, const char* title, const grasp::Result& r) {
  std::string variables = "folder = " + support::quoted(folder.string()) +
                          "\nmission = " + support::quoted(title) + "\nactivations = '";
  for (const auto& task : r.tasks) variables += column_name(task) + ' ';
  variables += "'\nphase_names = '";
  for (const auto& phase : r.phases) variables += phase.first + ' ';
  variables += "'\nphase_times = '";
  for (const auto& phase : r.phases) variables += std::to_string(phase.second) + ' ';
  return support::draw(variables + "'");
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
  std::printf("  inequality objectives left again     ");
  if (r.violations.empty()) std::printf("    none");
  for (const auto& name : r.violations) std::printf(" [%s]", name.c_str());
  std::printf("\n  largest change of command in a cycle %8.4f\n", r.largest_step);
  std::printf("  computing time per cycle, with plant %8.1f us\n",
              seconds * 1e6 / static_cast<double>(r.samples.size()));
  if (r.status != icat::Status::ok) std::printf("  STOPPED: %s\n", icat::describe(r.status));
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> names;
  for (const auto& v : variants) names.emplace_back(v.name);
  const auto arguments = support::parse(
      argc, argv, "The reference mission: navigate, grasp a pipe, lift it.", "out/01_grasp", names);

  bool all_well = true, drawn = arguments.pictures;
  double without = 0, with = 0;
  for (const auto& v : variants) {
    if (!arguments.variant.empty() && arguments.variant != v.name) continue;
    const auto begin = std::chrono::steady_clock::now();
    const grasp::Result r = grasp::run(v.variant);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    print(v, r, elapsed.count());
    if (v.variant.current) (v.variant.compensation ? with : without) = r.steady_error;
    const bool must_grasp = !v.variant.current || v.variant.compensation;
    all_well = all_well && r.status == icat::Status::ok && r.violations.empty() && r.lifted &&
               (r.grasped || !must_grasp);
    const fs::path folder = fs::path(arguments.output) / v.name;
    fs::create_directories(folder);
    write_csv(folder / "mission.csv", r);
    write_scene(folder / "scene.csv", r);
    if (drawn) drawn = draw(folder, v.title, r);
  }
  if (with > 0 && without > 0) {
    std::printf("\nIn the current, the compensation makes the tool error %.0f times smaller.\n",
                without / with);
  }
  std::printf("\nCSV%s in %s\n", drawn ? " and pictures" : "", arguments.output.c_str());
  return all_well ? 0 : 1;
}
