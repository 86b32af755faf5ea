// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Actions: what a robot does in one phase of its mission, as a prioritized list of tasks
/// [Coop, III-A], [MARIS, III-B7].
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "icat/task/task.hpp"

namespace icat {

/// Tasks of equal priority. The tasks belong to the caller and must outlive whoever holds this.
template <Robot R>
using PriorityLevel = std::vector<std::reference_wrapper<Task<R>>>;

/// A name and its priority levels, the highest first:
/// `Action<Robot> grasp{"grasp", {{joint_limits}, {centering}, {tool}}};`
template <Robot R>
struct Action {
  /// What errors and logs call it.
  std::string name;
  /// The highest priority first.
  std::vector<PriorityLevel<R>> levels;
};

}  // namespace icat
