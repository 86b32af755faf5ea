// SPDX-License-Identifier: BSD-3-Clause
// Runs the mission of a YAML file on a plant without dynamics, prints its phases, writes CSV and a
// replay. If the mission fails, it says why.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <icat/adapters/yaml_schema.hpp>
#include <icat/control/explain.hpp>
#include <optional>

#include "../support/csv.hpp"
#include "run.hpp"
#include "view.hpp"

namespace {

// Names are free in a configuration; in a line of CSV they are not.
std::string column_name(std::string prefix, const std::string& name) {
  for (const char c : name) {
    const bool good = static_cast<unsigned char>(c) > ' ' && c != ',' && c != ';' && c != '"';
    prefix.append(1, good ? c : '_');
  }
  return prefix;
}

std::string why(icat::ConfiguredController& controller) {
  return controller.parallel() ? icat::explain(*controller.parallel()).text()
                               : icat::explain(*controller.whole_body()).text();
}

int run_file(const std::string& file, const std::string& output, const std::string& changes,
             double at, bool z_down) {
  icat::Configuration config = icat::load_yaml(file);
  if (!config.mission()) {
    std::fprintf(stderr, "%s: has no 'mission', so there is nothing to run\n", file.c_str());
    return 2;
  }
  std::optional<icat::ConfigurationChanges> change;
  if (!changes.empty()) change = config.read_changes(changes);

  run::Plant plant = run::make_plant(config);
  icat::PlantBackEnd back_end(config.robot(), plant);
  std::string header = "t,phase";
  for (const auto& joint : config.robot().joints()) {
    header.append(column_name(",q_", joint.name));
  }
  for (icat::Index c = 0; c < config.robot().dof(); ++c) {
    header.append(",v").append(std::to_string(c + 1));
  }
  std::vector<icat::Task<run::Robot>*> tasks;
  for (const std::string& name : config.tasks()) {
    tasks.push_back(&config.task(name));
    header.append(column_name(",activation_", name)).append(column_name(",reference_", name));
  }
  support::Csv csv(output, "run.csv", header);
  run::View view(config, file, z_down);

  const icat::Mission& mission = *config.mission();
  std::size_t phase = mission.phases().size();
  std::vector<double> row;
  const icat::Status status = run::mission(
      config, back_end,
      [&](double t) {
        if (!change || t < at) return;
        if (config.apply(*change) == icat::Status::ok) std::printf("%8.2f s  changes\n", t);
        change.reset();
      },
      [&](double t, const icat::RobotState<run::Robot>& state) {
        if (mission.index() != phase) {
          std::printf("%8.2f s  %s\n", t, std::string(mission.phase()).c_str());
          phase = mission.index();
        }
        row.clear();
        for (const auto* task : tasks) {
          row.push_back(task->activation().maxCoeff());
          row.push_back(task->reference().norm());
        }
        csv.row(t, static_cast<double>(phase), state.q, config.controller().command(), row);
        view.record(t);
      });
  const bool success = mission.end() == icat::PhaseEnd::success;
  const char* end = mission.end() == icat::PhaseEnd::none ? icat::describe(status)
                    : success                             ? "success"
                                                          : "failure";
  std::printf("%s: %s\n", std::string(mission.phase()).c_str(), end);
  if (!success) std::printf("\nThe last cycle:\n%s\n", why(config.controller()).c_str());
  if (!csv.written()) {
    std::fprintf(stderr, "%s/run.csv cannot be written\n", output.c_str());
    return 2;
  }
  std::printf("CSV in %s\n", output.c_str());
  view.write(output);
  return success ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  std::string file, output = "out/icat_run", changes;
  double at = 0;
  bool schema = false, keys = false, check = false, z_down = false;
  CLI::App app{"Runs the mission of a YAML file on a plant without dynamics."};
  app.add_option("mission", file, "the YAML file");
  app.add_option("--output", output, "folder of the CSV file and the replay")
      ->capture_default_str();
  CLI::Option* with = app.add_option("--changes", changes, "a file with other gains and goals");
  app.add_option("--at", at, "when they are applied, s")->needs(with)->capture_default_str();
  app.add_flag("--z-down", z_down, "the world's z axis points down, for the replay");
  app.add_flag("--check", check, "read the file, run nothing");
  app.add_flag("--schema", schema, "print the JSON schema for editors");
  app.add_flag("--keys", keys, "print all keys, as Markdown");
  CLI11_PARSE(app, argc, argv);
  if (schema) return std::fputs(icat::configuration_schema().c_str(), stdout) < 0;
  if (keys) return std::fputs(icat::configuration_tables().c_str(), stdout) < 0;
  if (file.empty()) {
    std::fputs("Say which mission; --help says how.\n", stderr);
    return 2;
  }
  try {
    if (!check) return run_file(file, output, changes, at, z_down);
    (void)icat::load_yaml(file);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
