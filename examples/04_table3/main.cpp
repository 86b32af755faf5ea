// SPDX-License-Identifier: BSD-3-Clause
// Runs the rows of [Coop, Table III], prints the paper's table beside its own, writes CSV and,
// where gnuplot is found, pictures. With --sensitivity: how the table changes with two choices.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/support.hpp"
#include "table.hpp"

namespace {

namespace fs = std::filesystem;

const char* yes(bool b) { return b ? "yes" : "no"; }

void print(const table3::Table& t) {
  std::printf(
      "| test | comp. | comms | filter | force mod. | fbk Hz | final error | F max | F mean | F "
      "std "
      "| M max | M mean | M std | x real time "
      "|\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (std::size_t i = 0; i < t.results.size(); ++i) {
    const auto& row = table3::rows[i];
    const auto& r = t.results[i];
    char comms[32] = "no";
    if (row.rate > 0) {
      std::snprintf(comms, sizeof comms, "%s %.0f Hz%s",
                    row.duplex == icat::Duplex::full ? "FD" : "HD", row.rate,
                    row.latency > 0 ? ", late" : "");
    }
    std::printf("| %s | %s | %s | %s | %s | %.0f |", row.name, yes(row.compensation), comms,
                yes(row.filter), yes(row.force), row.feedback);
    if (r.aborted) {
      std::printf(" aborted at %.1f s | %.2f | | | | | |", r.end, r.force.max);
    } else {
      std::printf(" %.4f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f |", r.final_error, r.force.max,
                  r.force.mean, r.force.deviation, r.moment.max, r.moment.mean, r.moment.deviation);
    }
    std::printf(" %.0f |\n", t.real_time[i]);
    if (i < table3::published.size()) {
      const auto& p = table3::published[i];
      if (p.force_max > 0) {
        std::printf("| paper | | | | | | %.4f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | |\n",
                    p.final_error, p.force_max, p.force_mean, p.force_std, p.moment_max,
                    p.moment_mean, p.moment_std);
      } else {
        std::printf("| paper | | | | | | aborted | | | | | | | |\n");
      }
    }
  }
  std::printf("\n| must hold | |\n|---|---|\n");
  for (const auto& relation : table3::relations(t)) {
    std::printf("| %s | %s |\n", relation.text, relation.holds ? "yes" : "NO");
  }
  const auto c = table3::correlations(t);
  std::printf("| rank correlation with the paper, F mean (at least 0.85) | %.2f |\n", c.force_mean);
  std::printf("| F max (at least 0.8) | %.2f |\n", c.force_max);
  std::printf("| M mean (at least 0.7) | %.2f |\n", c.moment_mean);
  double peak = 0, mean = 0, drift = 0;
  for (const auto& r : t.results) {
    peak = std::max(peak, r.thrust_peak);
    mean = std::max(mean, r.thrust_mean);
    drift = std::max(drift, r.drift);
  }
  std::printf("| vehicle force along an axis, largest of all rows: peak, mean | %.0f N, %.0f N |\n",
              peak, mean);
  std::printf("| drift of the grasps, at most | %.1e m |\n", drift);
}

void write_csv(const std::string& folder, const std::string& name, const table3::Result& r) {
  std::string header =
      "t,fx,fy,fz,mx,my,mz,force,moment,position_error,orientation_error,object_speed";
  for (const char* robot : {"_a", "_b"}) {
    for (const char* c : {"agreed_vx", "agreed_vy", "agreed_vz", "agreed_wx", "agreed_wy",
                          "agreed_wz", "thrust_fx", "thrust_fy", "thrust_fz"}) {
      header += std::string(",") + c + robot;
    }
  }
  support::Csv csv(folder, name + ".csv", header);
  for (const auto& s : r.samples) {
    csv.row(s.t, s.interaction, s.interaction.head<3>().norm(), s.interaction.tail<3>().norm(),
            s.position_error, s.orientation_error, s.object_speed, s.agreed[0],
            s.vehicle_wrench[0].head<3>(), s.agreed[1], s.vehicle_wrench[1].head<3>());
  }
}

void sensitivity(const fs::path& folder) {
  struct Choice {
    const char* name;
    double table3::Parameters::*member;
    std::vector<double> values;
  };
  const std::vector<Choice> choices{
      {"joint_bandwidth", &table3::Parameters::joint_bandwidth, {50, 70, 100, 120}},
      {"joint_speed", &table3::Parameters::joint_speed, {0.1, 0.15, 0.25, 0.5}}};
  std::ofstream csv(folder / "sensitivity.csv");
  std::printf(
      "\nF mean (N; - where aborted), and how many of the relations hold\n\n| | T1 | T2 | T3 | T4 "
      "| T5 | T6 | T7 | T8 | T9 | T10 | T11 | hold "
      "|\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const auto& choice : choices) {
    for (const double value : choice.values) {
      table3::Parameters p;
      p.*choice.member = value;
      support::ProgressBar bar(choice.name);
      const auto t = table3::run_all(p, 11, [&](double share) { bar.show(share); });
      std::printf("| %s = %g |", choice.name, value);
      csv << "# " << choice.name << " = " << value << "\n# row,force mean (N)\n";
      for (int i = 1; i <= 11; ++i) {
        csv << i << ',' << t[i].force.mean << '\n';
        if (t[i].aborted) {
          std::printf(" - |");
        } else {
          std::printf(" %.2f |", t[i].force.mean);
        }
      }
      csv << "\n\n";
      const auto all = table3::relations(t);
      std::printf(" %d of %zu |\n",
                  static_cast<int>(
                      std::count_if(all.begin(), all.end(), [](const auto& r) { return r.holds; })),
                  all.size());
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const auto arguments = support::parse(
      argc, argv, "The hydrodynamic runs of Table III: two vehicles carry a pipe.", "out/04_table3",
      {}, {"--sensitivity", "vary the two most influential choices, too"});

  table3::Table t;
  {
    support::ProgressBar bar("Table III");
    t = table3::run_all({}, table3::rows.size(), [&](double share) { bar.show(share); });
  }
  print(t);
  std::string names;
  for (std::size_t i = 0; i < t.results.size(); ++i) {
    std::string name = table3::rows[i].name;
    std::replace(name.begin(), name.end(), ' ', '_');
    write_csv(arguments.output, name, t.results[i]);
    names += name + ' ';
  }
  if (arguments.extended) sensitivity(arguments.output);
  const bool drawn = arguments.pictures &&
                     support::draw(arguments.output,
                                   {{"rows", names}, {"study", arguments.extended ? "yes" : "no"}});
  std::printf("\nCSV%s in %s\n", drawn ? " and pictures" : "", arguments.output.c_str());
  bool all_well = true;
  for (const auto& r : t.results) all_well = all_well && r.status == icat::Status::ok;
  return all_well ? 0 : 1;
}
