// SPDX-License-Identifier: BSD-3-Clause
// The switches of each campaign and the one set of numbers that all share.
#pragma once

#include <icat/core/types.hpp>
#include <string>

namespace campaign {

/// Whoever changes what an attempt does gives this another number: results of another revision are
/// not gone on with.
constexpr int revision = 1;

// All numbers are ours; docs/campaign.md tells where they come from. Tuned, on December and
// October:
constexpr double umbilical = 1;       // N, deviation of the umbilical's pull, north and east
constexpr double very_turbid = 1.31;  // 1/m, attenuation of the water
// Not tuned:
constexpr double clear = 0.2;         // 1/m
constexpr double near_grasp = 0.03;   // m, the palm to its goal, for the hand to close
constexpr double parallel = 0.15;     // rad, the same
constexpr double diver = 0.03;        // m, by which a vehicle that is held by hand wanders
constexpr double trim = 1;            // N, deviation of the weight in water from what is known
constexpr double sway_time = 5;       // s, memory of what changes in these pulls
constexpr double gyro_noise = 0.075;  // rad/s on each sample at 100 Hz, as 12_velocity_feedback
constexpr double beam_noise = 0.02;   // m/s on each beam of the DVL, likewise
constexpr double palm_above = 0.11;   // m, over the pipe's axis
constexpr double floor = 4, support = 3.95, radius = 0.05;  // m: the pipe is 5 cm off the floor
constexpr double survey_depth = 1.9, placed_depth = 2.1;    // m
constexpr double control_dt = 0.01, plant_dt = 0.001;       // s
constexpr int steps = 10;                                   // of the plant in one of control

/// Errors that the paper and its sensors leave open, and that the three campaigns share.
struct Errors {
  double mount_shift = 0, mount_turn = 0;  ///< of the cameras as calibrated, m and rad, deviations
  double pixel_noise = 0.5;                ///< px
  double gyro_step = 0;                    ///< rad/s, to which gyros are rounded; 0: not
  double gyro_latency = 0.01, dvl_latency = 0;  ///< s
  double dead_zone = 0.05;                      ///< of a thruster, share of its full thrust
};
/// At the upper end of what is to be expected, all at once: a mount by a board that is 2.4 mm and
/// 7 mrad from where it is thought to be (15_calibration), and rounded, late, noisy sensors.
inline constexpr Errors large{.mount_shift = 0.0024,
                              .mount_turn = 0.007,
                              .pixel_noise = 2,
                              .gyro_step = 0.02,
                              .gyro_latency = 0.02,
                              .dvl_latency = 0.1};

inline constexpr Errors no_dead_zone{.dead_zone = 0};

/// What differs between campaigns.
struct Switches {
  const char* name;
  bool vehicle;        ///< controlled, or held by hand
  double attenuation;  ///< of the water, 1/m
  bool dvl, compensation, filter;
  Errors errors = {};
};
constexpr int set_count = 8;
inline constexpr Switches sets[set_count] = {
    {"October 2015", false, very_turbid, false, false, false},
    {"December 2015", true, clear, false, false, false},
    {"April 2016", true, clear, true, true, true},
    {"April without compensation", true, clear, true, false, true},
    {"April without filter", true, clear, true, true, false},
    {"April without DVL", true, clear, false, false, true},
    {"April with larger errors", true, clear, true, true, true, large},
    {"December without dead zone", true, clear, false, false, false, no_dead_zone},
};

/// How an attempt ended.
struct Result {
  std::string outcome;  ///< the mission's last phase: "done", or why not
  double time = 0;      ///< s
  double position = 0;  ///< true error of the palm when the hand begins to close, m; 0: never
  double angle = 0;     ///< the same, rad
  double lag = 0;       ///< RMS of actual less commanded velocity of the vehicle, approaching, m/s
  double shake = 0;     ///< RMS of the joints' velocities, approaching, rad/s
  double seen = 0;      ///< share of pictures with a measurement
};
/// For the picture, ten a second.
struct Sample {
  double t, error;                        ///< s, m
  icat::Vector3<double> actual, command;  ///< of the vehicle, m/s
  double joints;                          ///< norm of the references, rad/s
};

}  // namespace campaign
