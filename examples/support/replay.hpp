// SPDX-License-Identifier: BSD-3-Clause
// What an example shows in its replay: runs, each with a log and a scene. The writer is compiled
// once, in replay.cpp.
#pragma once

#include <icat/adapters/replay_scene.hpp>
#include <memory>
#include <string>
#include <vector>

#include "recorder.hpp"

namespace support {

/// The page of an example, replay.html.
class Replay {
 public:
  /// `z_down`: ⟨0⟩ is NED.
  explicit Replay(std::string title, bool z_down = false);
  /// A run more, with memory for `samples`. What is returned lives as long as this object.
  icat::ReplayRun& add(const std::string& name, const std::string& title, std::size_t samples);
  /// Of a run of this object.
  icat::Log& log(const icat::ReplayRun& run);
  /// From where one looks at first, see `icat::ReplayOptions`, rad.
  void look(double azimuth, double elevation);
  /// Runs that are shown at first, where they exist.
  void show(const std::vector<std::string>& names);
  /// Writes replay.html to `folder`, and with `logs` a CSV and an MCAP file of each run. Says where
  /// it is.
  void write(const std::string& folder, bool logs = false);

 private:
  std::vector<std::unique_ptr<icat::Log>> logs_;
  std::vector<std::unique_ptr<icat::ReplayRun>> runs_;
  icat::ReplayOptions options_;
};

/// The papers' vehicle and arm in a log and a scene.
class UvmsLog {
 public:
  /// `prefix` of its channels, such as "a/"; `tasks`: names of the activations; `camera` on the
  /// vehicle.
  UvmsLog(icat::Log& log, icat::ReplayRun& run, const std::string& prefix,
          const std::vector<std::string>& tasks, const icat::Pose<double>& camera,
          const std::string& color);
  /// In the sample that `Log::begin` opened; as many activations as there are tasks.
  template <class Activations>
  void record(const RobotSample& sample, const Activations& activations) {
    record(sample);
    std::size_t i = 0;
    for (const double a : activations) log_.set(activations_[i++], a);
  }

 private:
  void record(const RobotSample& sample);

  icat::Log& log_;
  std::vector<icat::LogChannel> joints_, velocity_, arm_, activations_, state_;
  icat::LogChannel vehicle_, tool_;
};

}  // namespace support
