// SPDX-License-Identifier: BSD-3-Clause
// What an example shows in its replay: runs, each with a log and a scene. What it costs is compiled
// once, in replay.cpp.
#pragma once

#include <icat/control/log.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "recorder.hpp"

namespace icat {
struct ReplayRun;  // adapters/replay_scene.hpp
}

namespace support {

/// The page of an example, replay.html.
class Replay {
 public:
  /// `z_down`: ⟨0⟩ is NED.
  explicit Replay(const char* title, bool z_down = false);
  ~Replay();
  Replay(const Replay&) = delete;
  Replay& operator=(const Replay&) = delete;
  /// A run more, with memory for `samples`. What is returned lives as long as this object.
  icat::ReplayRun& add(const std::string& name, const std::string& title, std::size_t samples);
  /// Of the last run.
  icat::Log& log();
  /// From where one looks at first, see `icat::ReplayOptions`, rad.
  void look(double azimuth, double elevation);
  /// Two runs that are shown at first, where they exist.
  void show(const char* one, const char* other);
  /// Writes replay.html to `folder`, and with `logs` a CSV and an MCAP file of each run. Says where
  /// it is.
  void write(const std::string& folder, bool logs);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// A run with the papers' vehicles and arms.
class UvmsRun {
 public:
  using Pose = icat::Pose<double>;
  UvmsRun(Replay& replay, const char* name, const char* title, std::size_t samples);
  ~UvmsRun();
  UvmsRun(const UvmsRun&) = delete;
  UvmsRun& operator=(const UvmsRun&) = delete;

  /// A robot more. `prefix` of its channels, such as "a/"; `tasks`: names of the activations;
  /// `camera` on the vehicle, where it has one.
  void add_robot(const char* prefix, const std::vector<std::string>& tasks,
                 const std::optional<Pose>& camera, const char* color);
  /// A picture of the channels whose names begin with `channels`.
  void add_plot(const char* title, const char* channels, const char* unit, bool logarithmic);
  /// Where the sea ends: a grid.
  void add_ground(double x, double y, double z);
  /// A cylinder along x of its place in `frame`, a pose of the log or "".
  void add_pipe(const char* frame, const Pose& at, double length, double opacity);
  /// Three axes.
  void add_goal(const Pose& at);
  /// Another vehicle, and the sphere to keep out of, m.
  void add_vehicle(const Pose& at, double keep_off);
  /// The way of a pose of the log.
  void add_path(const char* frame);

  /// Of this run: `begin` a sample of it, then `record`, then what else there is.
  icat::Log& log() { return log_; }
  /// Robot `i`; as many activations as it has tasks.
  void record(std::size_t i, const RobotSample& sample, const double* activations);

 private:
  struct Robot;
  icat::ReplayRun& run_;
  icat::Log& log_;
  std::vector<Robot> robots_;
};

/// A run with a vehicle alone.
class VehicleRun {
 public:
  VehicleRun(Replay& replay, const char* name, const char* title, std::size_t samples,
             double ground);
  /// A sample: the pose, the velocity that is wanted and the one that is, components on ⟨v⟩. False
  /// where the log does not take it.
  bool record(double t, const icat::Pose<double>& pose, const icat::Vector6<double>& wanted,
              const icat::Vector6<double>& actual);
  icat::ReplayRun& run() { return run_; }
  icat::Log& log() { return log_; }

 private:
  icat::ReplayRun& run_;
  icat::Log& log_;
  icat::LogChannel vehicle_;
  std::vector<icat::LogChannel> wanted_, actual_;
};

}  // namespace support
