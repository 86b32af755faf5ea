// SPDX-License-Identifier: BSD-3-Clause
// What roscpp costs by itself, for the comparison: plain data, since its headers are not C++20.
#pragma once

#include <cstddef>
#include <string>

namespace bare {

/// Heap allocations of the calling thread until now.
long allocations_so_far();

/// Allocations in this thread of one message of each kind: published, and received by a callback
/// that does nothing.
struct Costs {
  double twist{0};
  double joint_velocities{0};
  double joint_states{0};
  double odometry{0};
};

/// Publishes at 100 Hz for `cycles` on the topics that the robot of robot.py below `prefix` hears,
/// and receives what it answers. Needs a node that runs.
Costs costs(const std::string& prefix, std::size_t joints, int cycles);

}  // namespace bare
