// SPDX-License-Identifier: BSD-3-Clause
// Runs the rows of [Coop, Table III], prints the paper's table beside its own, writes CSV and,
// where gnuplot is found, pictures. With --sensitivity: how the table changes with the choices.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <icat/model/maris_bodies.hpp>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/reasons.hpp"
#include "../support/replay.hpp"
#include "../support/support.hpp"
#include "table.hpp"

namespace {

namespace fs = std::filesystem;

const char* yes(bool b) { return b ? "yes" : "no"; }

// [Coop, Table II], of the vehicles that the runs are made with.
void print_vehicle() {
  const auto body = icat::maris_vehicle_body<double>();
  const auto row = [](const char* name, const icat::Vector6<double>& v) {
    std::printf("| %s | %g %g %g | %g %g %g |\n", name, v(0), v(1), v(2), v(3), v(4), v(5));
  };
  std::printf("\n| vehicle, Table II | along its axes | about them |\n|---|---|---|\n");
  row("added mass", body.added_mass);
  row("linear drag", body.linear_drag);
  row("quadratic drag", body.quadratic_drag);
  std::printf("| mass | %g | |\n", body.mass);
}

void print(const table3::Table& t) {
  std::printf(
      "| test | comp. | comms | filter | force mod. | fbk Hz | final error | F max | F mean | F "
      "std "
      "| M max | M mean | M std | x real time "
      "|\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (std::size_t i = 0; i < t.results.size(); ++i) {
    const auto& row = table3::rows[i];
    const auto& r = t.results[i];
    const auto& p = r.transport;
    char comms[32] = "no";
    if (row.rate > 0) {
      std::snprintf(comms, sizeof comms, "%s %.0f Hz%s",
                    row.duplex == icat::Duplex::full ? "FD" : "HD", row.rate,
                    row.latency > 0 ? ", late" : "");
    }
    std::printf("| %s | %s | %s | %s | %s | %.0f |", row.name, yes(row.compensation), comms,
                yes(row.filter), yes(row.force), row.feedback);
    if (r.aborted) {
      std::printf(" aborted at %.1f s | %.2f | | | | | |", r.end, p.force.max);
    } else {
      std::printf(" %.4f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f |", p.final_error, p.force.max,
                  p.force.mean, p.force.deviation, p.moment.max, p.moment.mean, p.moment.deviation);
    }
    std::printf(" %.0f |\n", t.real_time[i]);
    if (i < table3::published.size()) {
      const auto& paper = table3::published[i];
      if (paper.force_max > 0) {
        std::printf("| paper | | | | | | %.4f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | |\n",
                    paper.final_error, paper.force_max, paper.force_mean, paper.force_std,
                    paper.moment_max, paper.moment_mean, paper.moment_std);
      } else {
        std::printf("| paper | | | | | | aborted | | | | | | | |\n");
      }
    }
  }
  std::printf("\n| the paper says | there | here | holds here |\n|---|---|---|---|\n");
  for (const auto& relation : table3::relations(t)) {
    std::printf("| %s | %s | %s | %s |\n", relation.text.c_str(), relation.paper.c_str(),
                relation.ours.c_str(), relation.holds ? "yes" : "NO");
  }
  std::printf(
      "\n| deployment | final error | F max | F mean | M max | M mean |\n"
      "|---|---|---|---|---|---|\n");
  for (std::size_t i = 0; i < t.results.size(); ++i) {
    const auto& r = t.results[i];
    const auto& p = r.deployment;
    if (r.deployed) {
      std::printf("| %s | %.4f | %.2f | %.2f | %.2f | %.2f |\n", table3::rows[i].name,
                  p.final_error, p.force.max, p.force.mean, p.moment.max, p.moment.mean);
    } else {
      std::printf("| %s | aborted at %.1f s | | | | |\n", table3::rows[i].name, r.end);
    }
  }
  std::printf("\n| of all rows | |\n|---|---|\n");
  using table3::Quantity;
  const double distance = table3::distance_from_paper(t);
  std::printf("| mean factor between here and there | %.2f |\n", std::pow(10, distance));
  std::printf("| rank correlation with the paper: F mean, F max, M mean | %.2f, %.2f, %.2f |\n",
              table3::correlation(t, Quantity::force_mean),
              table3::correlation(t, Quantity::force_max),
              table3::correlation(t, Quantity::moment_mean));
  double peak = 0, mean = 0, drift = 0;
  for (const auto& r : t.results) {
    peak = std::max(peak, r.thrust_peak);
    mean = std::max(mean, r.thrust_mean);
    drift = std::max(drift, r.drift);
  }
  std::printf(
      "| vehicle force along an axis, the largest: peak, mean (paper 150-170 N, 30-50 N) | %.0f N, "
      "%.0f N |\n",
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

// A row in the replay.
class Film {
 public:
  Film(support::Replay& replay, std::size_t row, const char* name, const char* title)
      : row_(row), run_(replay, name, title, 6100) {
    run_.add_plot("Errors of the pipe", "error/", "m, rad", true);
    run_.add_plot("Interaction", "interaction/", "N, N m", false);
    run_.add_robot("a/", table3::task_names, {}, "#d98a2b");
    run_.add_robot("b/", table3::task_names, {}, "#3d8fb5");
    run_.add_pipe("object", table3::Pose::Identity(), 3.6, 1);
    run_.add_pipe("", table3::pre_deployment, 3.6, 0.2);
    run_.add_pipe("", table3::seabed, 3.6, 0.2);
    run_.add_path("object");
    run_.add_ground(0.7, 0.7, 3.06);
  }
  void record(std::size_t row, const table3::Cycle& now) {
    const auto& s = now.sample;
    if (row != row_ || !log_.begin(s.t)) return;
    std::string why[2];
    for (std::size_t i = 0; i < 2; ++i) {
      const table3::Side& side = *now.sides[i];
      support::RobotSample robot{};
      robot.manipulability = robot.centering = std::nan("");  // not measured
      robot.command = side.agent.velocity();
      const auto tool = side.robot.frame("tool");
      support::record_posture(side.robot, tool, side.robot.frame("end_effector"), robot);
      robot.arm[8] =
          now.plant.object() * table3::Vector3((i == 0 ? -1 : 1) * table3::grasp_distance, 0, 0);
      run_.record(i, robot, side.activations().data());
      reasons_[i].record(s.t, side.agent);
      if (!reasons_[i].sentences().empty()) why[i] = reasons_[i].sentences().back().second;
    }
    log_.set(object_, now.plant.object());
    log_.set(position_, s.position_error);
    log_.set(orientation_, s.orientation_error);
    log_.set(force_, s.interaction.head<3>().norm());
    log_.set(moment_, s.interaction.tail<3>().norm());
    log_.phase(s.t, now.sides[0]->agent.action());
    log_.explain(s.t, "a: " + why[0] + "\nb: " + why[1]);
  }

 private:
  std::size_t row_;
  support::UvmsRun run_;
  icat::Log& log_ = run_.log();
  icat::LogChannel object_ = log_.add("object", "m", icat::LogKind::pose),
                   position_ = log_.add("error/position", "m"),
                   orientation_ = log_.add("error/orientation", "rad"),
                   force_ = log_.add("interaction/force", "N"),
                   moment_ = log_.add("interaction/moment", "N m");
  support::Reasons<icat::Agent<table3::Robot>> reasons_[2];
};

void sensitivity(const fs::path& folder) {
  using table3::Parameters;
  struct Choice {
    const char* name;
    void (*make)(Parameters&);
  };
  // The first four and some of the others are drawn.
  const std::vector<Choice> choices{
      {"joint_bandwidth = 50", [](Parameters& p) { p.joint_bandwidth = 50; }},
      {"joint_bandwidth = 75", [](Parameters& p) { p.joint_bandwidth = 75; }},
      {"as chosen", [](Parameters&) {}},
      {"joint_bandwidth = 125", [](Parameters& p) { p.joint_bandwidth = 125; }},
      {"joint_speed = 0.18", [](Parameters& p) { p.joint_speed = 0.18; }},
      {"joint_speed = 0.25", [](Parameters& p) { p.joint_speed = 0.25; }},
      {"both arms folded", [](Parameters& p) { p.start[1] = p.start[0]; }},
      {"half duplex fuses whole rounds", [](Parameters& p) { p.latest = false; }},
      {"vehicles too near one another",
       [](Parameters& p) {
         p.distance = 2.5;
         p.joint_speed = 0.25;
         p.start = {{{1.2, 1.1, 0, -1.3, 0, 0.2, -1.2}, {-1.2, 1.1, 0, -1.3, 0, 0.2, 1.2}}};
       }},
      {"filter = 2", [](Parameters& p) { p.filter = 2; }},
      {"no moment in the force modification", [](Parameters& p) { p.moment_gain = 0; }}};
  std::ofstream csv(folder / "sensitivity.csv");
  std::printf(
      "\nF mean (N; - where aborted), the mean factor between here and the paper, and how many of "
      "the relations hold\n\n| | T1 | T2 | T3 | T4 | T5 | T6 | T7 | T8 | T9 | T10 | T11 | factor | "
      "hold |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const auto& choice : choices) {
    Parameters p;
    choice.make(p);
    p.deployment = 0;
    support::ProgressBar bar(choice.name);
    const auto t = table3::run_all(p, 11, [&](double share) { bar.show(share); });
    std::printf("| %s |", choice.name);
    csv << "# " << choice.name << "\n# row,force mean (N)\n";
    for (int i = 1; i <= 11; ++i) {
      csv << i << ',' << t[i].transport.force.mean << '\n';
      if (t[i].aborted) {
        std::printf(" - |");
      } else {
        std::printf(" %.2f |", t[i].transport.force.mean);
      }
    }
    csv << "\n\n";
    const auto all = table3::relations(t);
    std::printf(" %.1f | %d of %zu |\n", std::pow(10, table3::distance_from_paper(t)),
                static_cast<int>(
                    std::count_if(all.begin(), all.end(), [](const auto& r) { return r.holds; })),
                all.size());
  }
  csv << "# paper\n# row,force mean (N)\n";
  for (int i = 2; i <= 11; ++i) {
    csv << i << ',' << table3::printed(table3::Quantity::force_mean, i) << '\n';
  }
}

}  // namespace

int main(int argc, char** argv) {
  const auto arguments =
      support::parse(argc, argv, "The hydrodynamic runs of Table III: two vehicles carry a pipe.",
                     "out/04_table3", {}, {"--sensitivity", "vary the choices, too"});

  support::Replay replay("Two vehicles with dynamics carry a pipe and set it down", true);
  Film alone(replay, 1, "T2, alone", "T2: nothing is exchanged");
  Film together(replay, 7, "T8, together",
                "T8: velocities exchanged at 100 Hz, filter, force modification");
  table3::Table t;
  {
    support::ProgressBar bar("Table III");
    t = table3::run_all(
        {}, table3::rows.size(), [&](double share) { bar.show(share); },
        [&](std::size_t row, const table3::Cycle& now) {
          alone.record(row, now);
          together.record(row, now);
        });
  }
  print(t);
  print_vehicle();
  std::string names;
  for (std::size_t i = 0; i < t.results.size(); ++i) {
    std::string name = table3::rows[i].name;
    std::replace(name.begin(), name.end(), ' ', '_');
    write_csv(arguments.output, name, t.results[i]);
    names += name + ' ';
  }
  if (arguments.extended) sensitivity(arguments.output);
  if (arguments.pictures) {
    support::draw(arguments.output,
                  {{"rows", names}, {"study", arguments.extended ? "yes" : "no"}});
  }
  std::printf("\nCSV%s in %s\n", support::drawn() ? " and pictures" : "", arguments.output.c_str());
  replay.look(-2.4, 0.4);
  replay.write(arguments.output, arguments.logs);
  bool all_well = true;
  for (const auto& r : t.results) all_well = all_well && r.status == icat::Status::ok;
  return all_well ? 0 : 1;
}
