// SPDX-License-Identifier: BSD-3-Clause
#include "replay.hpp"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <icat/adapters/csv.hpp>
#include <icat/adapters/mcap.hpp>
#include <icat/adapters/replay.hpp>

namespace support {

Replay::Replay(std::string title, bool z_down) {
  options_.title = std::move(title);
  options_.z_down = z_down;
}

icat::ReplayRun& Replay::add(const std::string& name, const std::string& title,
                             std::size_t samples) {
  logs_.push_back(std::make_unique<icat::Log>(icat::Log::Options{.samples = samples}));
  runs_.push_back(std::make_unique<icat::ReplayRun>(
      icat::ReplayRun{.name = name, .title = title, .log = logs_.back().get()}));
  return *runs_.back();
}

icat::Log& Replay::log(const icat::ReplayRun& run) {
  return **std::find_if(logs_.begin(), logs_.end(),
                        [&](const auto& log) { return log.get() == run.log; });
}

void Replay::look(double azimuth, double elevation) {
  options_.azimuth = azimuth;
  options_.elevation = elevation;
}

void Replay::show(const std::vector<std::string>& names) {
  options_.shown.clear();
  for (const auto& name : names) {
    for (const auto& run : runs_) {
      if (run->name == name) options_.shown.push_back(name);
    }
  }
}

void Replay::write(const std::string& folder, bool logs) {
  namespace fs = std::filesystem;
  if (runs_.empty()) return;
  fs::create_directories(folder);
  std::vector<icat::ReplayRun> runs;
  for (const auto& run : runs_) runs.push_back(*run);
  const fs::path path = fs::absolute(fs::path(folder) / "replay.html");
  if (!icat::write_replay(path.string(), {.folder = ICAT_REPLAY_FOLDER, .three = ICAT_THREE_JS},
                          runs, options_)) {
    std::printf("No replay: %s cannot be written\n", path.c_str());
    return;
  }
  if (!fs::exists(ICAT_THREE_JS)) {
    std::printf("three.js not found (Debian: libjs-three): the replay has no 3-D picture\n");
  }
  for (const auto& run : runs_) {
    const fs::path file = fs::path(folder) / run->name;
    if (logs && !(icat::write_csv(*run->log, file.string() + ".csv") &&
                  icat::write_mcap(*run->log, file.string() + ".mcap"))) {
      std::printf("The log of %s cannot be written\n", run->name.c_str());
    }
  }
  std::printf("Replay: %s\n", path.c_str());
}

UvmsLog::UvmsLog(icat::Log& log, icat::ReplayRun& run, const std::string& prefix,
                 const std::vector<std::string>& tasks, const icat::Pose<double>& camera,
                 const std::string& color)
    : log_(log) {
  for (int j = 1; j <= 7; ++j) {
    joints_.push_back(log.add(prefix + "joint/q" + std::to_string(j), "rad"));
  }
  for (int j = 1; j <= 7; ++j) {
    velocity_.push_back(log.add(prefix + "joint velocity/q" + std::to_string(j), "rad/s"));
  }
  for (const char* name : {"surge", "sway", "heave", "roll rate", "pitch rate", "yaw rate"}) {
    velocity_.push_back(log.add(prefix + "vehicle velocity/" + name, "m/s, rad/s"));
  }
  vehicle_ = log.add(prefix + "vehicle", "m", icat::LogKind::pose);
  tool_ = log.add(prefix + "tool", "m", icat::LogKind::pose);
  for (int j = 0; j < 9; ++j) {
    arm_.push_back(log.add(prefix + "arm/" + std::to_string(j), "m", icat::LogKind::point));
  }
  for (const auto& task : tasks) activations_.push_back(log.add(prefix + "activation/" + task));
  for (const char* name : {"joint margin", "manipulability", "attitude", "camera centering"}) {
    state_.push_back(log.add(prefix + "state/" + name));
  }

  using icat::ReplayForm;
  auto& shapes = run.shapes;
  // The hull: floats above, a frame with skids below, the camera ahead.
  const auto part = [&](icat::Vector3<double> at, std::array<double, 3> size, const char* paint) {
    icat::ReplayShape s{.form = ReplayForm::box, .frame = prefix + "vehicle", .size = size};
    s.at.translation() = at;
    s.color = paint;
    shapes.push_back(s);
  };
  part({0, 0, -0.16}, {1.0, 0.6, 0.28}, color.c_str());
  part({0, 0, 0.1}, {0.86, 0.46, 0.24}, "#46535f");
  for (const double side : {-1.0, 1.0}) part({0, side * 0.25, 0.39}, {1.0, 0.06, 0.08}, "#2b3640");
  for (const double side : {-1.0, 1.0}) {
    part({0, side * 0.25, 0.28}, {0.5, 0.03, 0.14}, "#2b3640");
  }
  shapes.push_back({.form = ReplayForm::sphere,
                    .frame = prefix + "vehicle",
                    .at = camera,
                    .size = {0.06, 0, 0},
                    .color = "#11181f"});
  shapes.push_back({.form = ReplayForm::cone,
                    .frame = prefix + "vehicle",
                    .at = camera,
                    .size = {0.35, 1.4, 0},
                    .color = "#f4d35e",
                    .opacity = 0.16});
  for (int j = 0; j < 8; ++j) {
    shapes.push_back({.form = ReplayForm::bone,
                      .frame = prefix + "arm/" + std::to_string(j),
                      .size = {0.045 - 0.002 * j, 0, 0},
                      .to = prefix + "arm/" + std::to_string(j + 1),
                      .color = j % 2 ? "#e9edf0" : "#c9d2d9"});
  }
  shapes.push_back(
      {.form = ReplayForm::path, .frame = prefix + "tool", .size = {}, .color = "#d1495b"});
  shapes.push_back(
      {.form = ReplayForm::path, .frame = prefix + "vehicle", .size = {}, .color = color});
  const std::string who = prefix.empty() ? "" : " of " + prefix.substr(0, prefix.size() - 1);
  run.plots.push_back({"Activations" + who, {prefix + "activation/"}, "", -0.03, 1.03});
  run.plots.push_back({"Joint velocities" + who, {prefix + "joint velocity/"}});
  run.plots.push_back({"Vehicle velocity" + who, {prefix + "vehicle velocity/"}});
}

void UvmsLog::record(const RobotSample& s) {
  for (std::size_t j = 0; j < 7; ++j) log_.set(joints_[j], s.q(static_cast<icat::Index>(j)));
  for (std::size_t j = 0; j < 13; ++j) {
    log_.set(velocity_[j], s.command(static_cast<icat::Index>(j)));
  }
  log_.set(vehicle_, s.vehicle);
  log_.set(tool_, s.tool);
  for (std::size_t j = 0; j < 9; ++j) log_.set(arm_[j], s.arm[j].x(), s.arm[j].y(), s.arm[j].z());
  const double state[] = {s.joint_margin, s.manipulability, s.attitude, s.centering};
  for (std::size_t i = 0; i < 4; ++i) log_.set(state_[i], state[i]);
}

}  // namespace support
