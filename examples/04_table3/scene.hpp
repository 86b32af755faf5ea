// SPDX-License-Identifier: BSD-3-Clause
// The rows of [Coop, Table III] with the paper's numbers, and one set of gains, filters and limits
// for all rows.
#pragma once

#include <array>
#include <icat/math/rigid_motion.hpp>
#include <icat/sim/channel.hpp>
#include <numbers>
#include <vector>

#include "../support/geometry.hpp"

namespace table3 {

using Pose = icat::Pose<double>;

// --- the rows ------------------------------------------------------------------------------------

/// One row of the table.
struct Row {
  const char* name;
  bool compensation = true;
  double rate = 0;  ///< Hz, 0: no communication
  icat::Duplex duplex = icat::Duplex::full;
  double latency = 0;  ///< s
  bool filter = false;
  bool force = false;      ///< the force modification
  double feedback = 100;   ///< of the vehicle's velocity, Hz
  double loss = 0;         ///< share of messages lost
  bool spans = false;      ///< exchanged too
  bool thrusters = false;  ///< the vehicles have some, which lag and have dead zones
  bool sensors = false;    ///< the vehicle's velocity is noisy
};

/// [Coop, Table III], and what is not in it.
inline const std::vector<Row> rows{
    {.name = "T1", .compensation = false},
    {.name = "T2"},
    {.name = "T3", .rate = 100},
    {.name = "T4", .rate = 100, .filter = true},
    {.name = "T5", .rate = 1, .latency = 1, .filter = true},
    {.name = "T6", .rate = 1, .duplex = icat::Duplex::half, .latency = 1, .filter = true},
    {.name = "T7", .force = true},
    {.name = "T8", .rate = 100, .filter = true, .force = true},
    {.name = "T9", .rate = 1, .latency = 1, .filter = true, .force = true},
    {.name = "T10",
     .rate = 1,
     .duplex = icat::Duplex::half,
     .latency = 1,
     .filter = true,
     .force = true},
    {.name = "T11",
     .rate = 1,
     .duplex = icat::Duplex::half,
     .latency = 1,
     .filter = true,
     .force = true,
     .feedback = 10},
    {.name = "T9 loss", .rate = 1, .latency = 1, .filter = true, .force = true, .loss = 0.1},
    {.name = "T4 spans", .rate = 100, .filter = true, .spans = true},
    {.name = "T2 thrusters", .thrusters = true},
    {.name = "T4 thrusters", .rate = 100, .filter = true, .thrusters = true},
    {.name = "T8 thrusters", .rate = 100, .filter = true, .force = true, .thrusters = true},
    {.name = "T4 sensors", .rate = 100, .filter = true, .sensors = true},
    {.name = "T8 sensors", .rate = 100, .filter = true, .force = true, .sensors = true}};

/// What the paper prints for T1 … T11; 0 where it aborted.
struct Published {
  double final_error, force_max, force_mean, force_std, moment_max, moment_mean, moment_std;
};
inline const std::array<Published, 11> published{{{0, 0, 0, 0, 0, 0, 0},
                                                  {0.0059, 63.29, 41.53, 18.09, 25.78, 13.52, 5.9},
                                                  {0.0039, 41.08, 26.52, 12.81, 16.09, 10.86, 4.7},
                                                  {0.004, 9.9, 1.78, 1.72, 5.13, 0.99, 0.75},
                                                  {0.0258, 10.1, 5.42, 2.53, 6.71, 1.87, 0.81},
                                                  {0.0305, 78.5, 29.03, 17.29, 14.55, 5.11, 3.34},
                                                  {0.0077, 9.64, 2.66, 2.25, 16.02, 5.99, 2.52},
                                                  {0.0039, 5.03, 0.89, 0.9, 5.7, 0.82, 0.92},
                                                  {0.0259, 5.07, 1.14, 1.12, 5.63, 1.19, 0.8},
                                                  {0.0109, 13.42, 3.19, 2.75, 8.17, 2.16, 1.36},
                                                  {0.0347, 24.81, 4.05, 4.37, 6.92, 2.13, 1.35}}};

// --- one set of parameters -----------------------------------------------------------------------

/// What the paper leaves open. The same for all rows; varied by the sensitivity study alone.
struct Parameters {
  double join = 2.5;               ///< s, holding the pipe while the exchange begins [Coop, V-A]
  double duration = 40;            ///< s, until the pipe is at pre-deployment, `join` included
  double deployment = 20;          ///< s, from there to the seabed
  double ramp = 0.5;               ///< s, from holding the pipe to carrying it
  double tool_gain = 0.2;          ///< 1/s
  double tool_linear = 0.15;       ///< m/s
  double tool_angular = 0.15;      ///< rad/s
  double joint_speed = 0.15;       ///< rad/s, bound of each joint
  double distance = 2;             ///< m, between the vehicles, active half a metre before
  double vehicle_speed = 0.5;      ///< m/s, bound along each axis
  double vehicle_turn = 0.3;       ///< rad/s, bound about each axis
  double joint_bandwidth = 100;    ///< rad/s, of the PI loops
  double vehicle_bandwidth = 0.9;  ///< rad/s, along the axes
  double turn_bandwidth = 3;       ///< rad/s, about them
  double filter = 1.5;             ///< s, time constant of the filter on the agreed velocity
  double force_gain = 2e-4;        ///< m/s per N of interaction force
  double moment_gain = 6e-4;       ///< rad/s per N m of interaction moment
  double force_limit = 200;        ///< N, of the interaction force: the run is aborted
  double hold = 4;                 ///< s, how long an agreement is held
  double fade = 0.1;               ///< s, into the first agreement
  bool latest = true;              ///< half duplex: see icat::AgreementOptions
  /// After the grasp, rad. Arm a is folded; arm b is stretched so far that its manipulability task
  /// is active.
  std::array<std::array<double, 7>, 2> start{
      {{0, 1.4, 0, -2.4, 0, 1.0, 0}, {0, 0.5, 0, -1.2, 0, 0.7, 0}}};
};

inline constexpr double plant_dt = 1.0 / 2000, control_dt = 0.01;
inline constexpr double grasp_distance = 1.5;

// [Coop, V-B]. The pipe lies along x of ⟨o⟩ and along y of the world, so that the rotation about y
// and z of the world by π/2 rolls and turns it but leaves it horizontal.
inline constexpr double quarter = std::numbers::pi / 2;
inline const Pose pipe_start = support::pose({0.5, 0.5, 3}, 0, 0, quarter);
inline const Pose pre_deployment =
    support::pose({0.75, 0.75, 2.5}, 0, quarter, quarter) * support::pose({0, 0, 0}, 0, 0, quarter);
inline const Pose seabed =
    support::pose({0.75, 0.75, 3}, 0, quarter, quarter) * support::pose({0, 0, 0}, 0, 0, quarter);

}  // namespace table3
