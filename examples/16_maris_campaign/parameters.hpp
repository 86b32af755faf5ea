// SPDX-License-Identifier: BSD-3-Clause
// The switches of each campaign and the one set of numbers that all share.
#pragma once

#include <icat/core/types.hpp>
#include <string>
#include <vector>

namespace campaign {

/// All numbers are ours. What is not default elsewhere in the library and what was tuned, and on
/// what, is told in docs/campaign.md.
struct Parameters {
  // Tuned on October and December.
  static constexpr double tether = 4;      ///< N, deviation of the umbilical's pull, north and east
  static constexpr double near = 0.03;     ///< m, the palm to its goal, to close the hand
  static constexpr double parallel = 0.15; ///< rad, the same
  static constexpr double diver = 0.03;    ///< m, how far the hand-held vehicle wanders
  // Not tuned.
  static constexpr double trim = 1;           ///< N, deviation of weight from what is known
  static constexpr double sway_time = 5;      ///< s, in which half of the pull changes
  static constexpr double gyro_noise = 0.075; ///< rad/s on each sample at 100 Hz: 12_velocity_feedback
  static constexpr double beam_noise = 0.02;  ///< m/s on each beam of the DVL, the same
  static constexpr double pixel_noise = 0.5;  ///< px
  static constexpr double palm_above = 0.11;  ///< m, over the pipe's axis
};
constexpr double floor = 4, support = 3.95, radius = 0.05;   // m: the pipe is 5 cm off the floor
constexpr double survey_depth = 1.9, placed_depth = 2.1;      // m
constexpr double control_dt = 0.01, plant_dt = 0.001;         // s
constexpr int steps = 10;                                     // of the plant in one of control

/// What differs between campaigns.
struct Switches {
  const char* name;
  bool vehicle;        ///< controlled, or held by hand
  double attenuation;  ///< of the water, 1/m
  bool dvl, compensation, filter;
};
constexpr double clear = 0.2, very_turbid = 2;  // 1/m
inline constexpr Switches sets[] = {
    {"October 2015", false, very_turbid, false, false, false},
    {"December 2015", true, clear, false, false, false},
    {"April 2016", true, clear, true, true, true},
    {"April, no compensation", true, clear, true, false, true},
    {"April, no filter", true, clear, true, true, false},
    {"April, no DVL", true, clear, false, false, true},
};
constexpr int set_count = 6;

/// How an attempt ended.
struct Result {
  std::string outcome;  ///< the mission's last phase: "done", or why not
  double time = 0;      ///< s
  double position = 0;  ///< true error of the palm when the hand begins to close, m; 0: never
  double across = 0;    ///< of that across the pipe, m
  double angle = 0;     ///< rad
  double lag = 0;       ///< RMS of actual less commanded velocity of the vehicle, approaching, m/s
  double shake = 0;     ///< RMS of the joints' velocities, approaching, rad/s
  double seen = 0;      ///< share of pictures with a measurement
};
/// For the picture, ten a second.
struct Sample {
  double t, error;                        ///< s, m
  icat::Vector3<double> actual, command;  ///< of the vehicle, m/s
  double joints;                          ///< rad/s, norm
  std::string phase;
};

}  // namespace campaign
