// SPDX-License-Identifier: BSD-3-Clause
#include "replay.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <icat/adapters/csv.hpp>
#include <icat/adapters/mcap.hpp>
#include <icat/adapters/replay.hpp>
#include <utility>

#include "geometry.hpp"

namespace support {

struct Replay::Parts {
  std::vector<std::unique_ptr<icat::Log>> logs;
  std::vector<std::unique_ptr<icat::ReplayRun>> runs;
  icat::ReplayOptions options;
};

Replay::Replay(const char* title, bool z_down) : parts_(std::make_unique<Parts>()) {
  parts_->options.title = title;
  parts_->options.z_down = z_down;
}
Replay::~Replay() = default;

icat::ReplayRun& Replay::add(const std::string& name, const std::string& title,
                             std::size_t samples) {
  parts_->logs.push_back(std::make_unique<icat::Log>(icat::Log::Options{.samples = samples}));
  parts_->runs.push_back(std::make_unique<icat::ReplayRun>(
      icat::ReplayRun{.name = name, .title = title, .log = parts_->logs.back().get()}));
  return *parts_->runs.back();
}

icat::Log& Replay::log() { return *parts_->logs.back(); }

void Replay::look(double azimuth, double elevation) {
  parts_->options.azimuth = azimuth;
  parts_->options.elevation = elevation;
}

void Replay::show(const char* one, const char* other) {
  parts_->options.shown.clear();
  for (const std::string name : {one, other}) {
    for (const auto& run : parts_->runs) {
      if (run->name == name) parts_->options.shown.push_back(name);
    }
  }
}

void Replay::write(const std::string& folder, bool logs) {
  namespace fs = std::filesystem;
  if (parts_->runs.empty()) return;
  fs::create_directories(folder);
  std::vector<icat::ReplayRun> runs;
  for (const auto& run : parts_->runs) runs.push_back(*run);
  const fs::path path = fs::absolute(fs::path(folder) / "replay.html");
  if (!icat::write_replay(path.string(), {.folder = ICAT_REPLAY_FOLDER, .three = ICAT_THREE_JS},
                          runs, parts_->options)) {
    std::printf("No replay: %s cannot be written\n", path.c_str());
    return;
  }
  if (!fs::exists(ICAT_THREE_JS)) {
    std::printf("three.js not found (Debian: libjs-three): the replay has no 3-D picture\n");
  }
  for (const auto& run : parts_->runs) {
    const fs::path file = fs::path(folder) / run->name;
    if (logs && !(icat::write_csv(*run->log, file.string() + ".csv") &&
                  icat::write_mcap(*run->log, file.string() + ".mcap"))) {
      std::printf("The log of %s cannot be written\n", run->name.c_str());
    }
  }
  std::printf("Replay: %s\n", path.c_str());
}

using icat::ReplayForm;

struct UvmsRun::Robot {
  std::vector<icat::LogChannel> joints, velocity, arm, activations, state;
  icat::LogChannel vehicle, tool;
};

UvmsRun::UvmsRun(Replay& replay, const char* name, const char* title, std::size_t samples)
    : run_(replay.add(name, title, samples)), log_(replay.log()) {}
UvmsRun::~UvmsRun() = default;

void UvmsRun::add_plot(const char* title, const char* channels, const char* unit,
                       bool logarithmic) {
  run_.plots.push_back({title, {channels}, unit, 0, 0, logarithmic});
}
void UvmsRun::add_ground(double x, double y, double z) {
  icat::ReplayShape s{.form = ReplayForm::ground, .size = {14, 0, 0}};
  s.at.translation() << x, y, z;
  run_.shapes.push_back(s);
}
void UvmsRun::add_pipe(const char* frame, const Pose& at, double length, double opacity) {
  const Pose along_x = pose({0, 0, 0}, 0, std::acos(0.0), 0);
  run_.shapes.push_back({.form = ReplayForm::cylinder,
                         .frame = frame,
                         .at = at * along_x,
                         .size = {0.05, length, 0},
                         .color = "#b5651d",
                         .opacity = opacity});
}
void UvmsRun::add_goal(const Pose& at) {
  run_.shapes.push_back({.form = ReplayForm::axes, .at = at, .size = {0.25, 0, 0}});
}
void UvmsRun::add_vehicle(const Pose& at, double keep_off) {
  run_.shapes.push_back(
      {.form = ReplayForm::box, .at = at, .size = {1.0, 0.6, 0.5}, .color = "#7d8b99"});
  run_.shapes.push_back({.form = ReplayForm::sphere,
                         .at = at,
                         .size = {keep_off, 0, 0},
                         .color = "#d1495b",
                         .opacity = 0.12});
}
void UvmsRun::add_path(const char* frame) {
  run_.shapes.push_back({.form = ReplayForm::path, .frame = frame, .color = "#8a4b14"});
}

void UvmsRun::add_robot(const char* name, const std::vector<std::string>& tasks,
                        const std::optional<Pose>& camera, const char* paint) {
  const std::string prefix(name), color(paint);
  icat::Log& log = log_;
  Robot robot;
  for (int j = 1; j <= 7; ++j) {
    robot.joints.push_back(log.add(prefix + "joint/q" + std::to_string(j), "rad"));
  }
  for (int j = 1; j <= 7; ++j) {
    robot.velocity.push_back(log.add(prefix + "joint velocity/q" + std::to_string(j), "rad/s"));
  }
  for (const char* axis : {"surge", "sway", "heave", "roll rate", "pitch rate", "yaw rate"}) {
    robot.velocity.push_back(log.add(prefix + "vehicle velocity/" + axis, "m/s, rad/s"));
  }
  robot.vehicle = log.add(prefix + "vehicle", "m", icat::LogKind::pose);
  robot.tool = log.add(prefix + "tool", "m", icat::LogKind::pose);
  for (int j = 0; j < 9; ++j) {
    robot.arm.push_back(log.add(prefix + "arm/" + std::to_string(j), "m", icat::LogKind::point));
  }
  for (const auto& task : tasks)
    robot.activations.push_back(log.add(prefix + "activation/" + task));
  for (const char* what : {"joint margin", "manipulability", "attitude", "camera centering"}) {
    robot.state.push_back(log.add(prefix + "state/" + what));
  }

  auto& shapes = run_.shapes;
  // The hull: floats above, a frame with skids below, the camera ahead.
  const auto part = [&](icat::Vector3<double> at, std::array<double, 3> size, const char* tint) {
    icat::ReplayShape s{.form = ReplayForm::box, .frame = prefix + "vehicle", .size = size};
    s.at.translation() = at;
    s.color = tint;
    shapes.push_back(s);
  };
  part({0, 0, -0.16}, {1.0, 0.6, 0.28}, color.c_str());
  part({0, 0, 0.1}, {0.86, 0.46, 0.24}, "#46535f");
  for (const double side : {-1.0, 1.0}) part({0, side * 0.25, 0.39}, {1.0, 0.06, 0.08}, "#2b3640");
  for (const double side : {-1.0, 1.0}) {
    part({0, side * 0.25, 0.28}, {0.5, 0.03, 0.14}, "#2b3640");
  }
  if (camera) {
    shapes.push_back({.form = ReplayForm::sphere,
                      .frame = prefix + "vehicle",
                      .at = *camera,
                      .size = {0.06, 0, 0},
                      .color = "#11181f"});
    shapes.push_back({.form = ReplayForm::cone,
                      .frame = prefix + "vehicle",
                      .at = *camera,
                      .size = {0.35, 1.4, 0},
                      .color = "#f4d35e",
                      .opacity = 0.16});
  }
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
  run_.plots.push_back({"Activations" + who, {prefix + "activation/"}, "", -0.03, 1.03});
  run_.plots.push_back({"Joint velocities" + who, {prefix + "joint velocity/"}});
  run_.plots.push_back({"Vehicle velocity" + who, {prefix + "vehicle velocity/"}});
  robots_.push_back(std::move(robot));
}

void UvmsRun::record(std::size_t i, const RobotSample& s, const double* activations) {
  const Robot& robot = robots_[i];
  for (std::size_t j = 0; j < 7; ++j) {
    log_.set(robot.joints[j], s.q(static_cast<icat::Index>(j)));
  }
  for (std::size_t j = 0; j < 13; ++j) {
    log_.set(robot.velocity[j], s.command(static_cast<icat::Index>(j)));
  }
  log_.set(robot.vehicle, s.vehicle);
  log_.set(robot.tool, s.tool);
  for (std::size_t j = 0; j < 9; ++j) {
    log_.set(robot.arm[j], s.arm[j].x(), s.arm[j].y(), s.arm[j].z());
  }
  const double state[] = {s.joint_margin, s.manipulability, s.attitude, s.centering};
  for (std::size_t j = 0; j < 4; ++j) log_.set(robot.state[j], state[j]);
  for (const auto& channel : robot.activations) log_.set(channel, *activations++);
}

namespace {
constexpr std::array<std::pair<const char*, int>, 4> moves{
    {{"Surge", 0}, {"Sway", 1}, {"Heave", 2}, {"Yaw rate", 5}}};
}

VehicleRun::VehicleRun(Replay& replay, const char* name, const char* title, std::size_t samples,
                       double ground)
    : run_(replay.add(name, title, samples)), log_(replay.log()) {
  vehicle_ = log_.add("vehicle", "m", icat::LogKind::pose);
  for (const auto& [move, row] : moves) {
    const std::string group = move;
    const char* unit = row < 3 ? "m/s" : "rad/s";
    wanted_.push_back(log_.add(group + "/commanded", unit));
    actual_.push_back(log_.add(group + "/actual", unit));
    run_.plots.push_back({group, {group + "/"}, unit});
  }
  const auto box = [&](double ahead, std::array<double, 3> size, const char* color) {
    icat::ReplayShape s{.form = ReplayForm::box, .frame = "vehicle", .size = size, .color = color};
    s.at.translation().x() = ahead;
    run_.shapes.push_back(s);
  };
  box(0, {1.0, 0.6, 0.5}, "#d98a2b");
  box(0.52, {0.06, 0.5, 0.4}, "#2b3640");  // the bow
  run_.shapes.push_back({.form = ReplayForm::path, .frame = "vehicle", .color = "#d1495b"});
  icat::ReplayShape floor{.form = ReplayForm::ground, .size = {26, 0, 0}};
  floor.at.translation().z() = ground;
  run_.shapes.push_back(floor);
}

bool VehicleRun::record(double t, const icat::Pose<double>& pose,
                        const icat::Vector6<double>& wanted, const icat::Vector6<double>& actual) {
  if (!log_.begin(t)) return false;
  log_.set(vehicle_, pose);
  for (std::size_t i = 0; i < moves.size(); ++i) {
    log_.set(wanted_[i], wanted(moves[i].second));
    log_.set(actual_[i], actual(moves[i].second));
  }
  return true;
}

}  // namespace support
