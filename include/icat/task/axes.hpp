// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Which axes a task controls, and on which frame they are.
#pragma once

#include "icat/core/types.hpp"

namespace icat {

/// Some of x, y and z.
struct Axes {
  bool x{true};  ///< x counts
  bool y{true};  ///< y counts
  bool z{true};  ///< z counts

  /// Whether axis `i` counts, 0 for x.
  constexpr bool operator[](Index i) const noexcept { return i == 0 ? x : i == 1 ? y : z; }
  /// How many count.
  constexpr Index count() const noexcept { return Index{x} + Index{y} + Index{z}; }
};

/// None of them.
inline constexpr Axes no_axes{false, false, false};

/// The frame whose axes are meant: the one that the goal is given in (⟨0⟩ unless the task is
/// relative to another), or the controlled frame itself.
enum class On { reference, frame };

}  // namespace icat
