// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The type of a pose. Apart from types.hpp because the solver needs none, and Eigen's geometry is
/// a tenth of what its program costs to compile.
#pragma once

#include <Eigen/Geometry>

#include "icat/core/types.hpp"

namespace icat {

/// Rigid transform; a `Pose` called `a_b` maps components on ⟨b⟩ to components on ⟨a⟩.
template <class Scalar>
using Pose = Eigen::Transform<Scalar, 3, Eigen::Isometry>;

}  // namespace icat
