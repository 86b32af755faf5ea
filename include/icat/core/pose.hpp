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

/// R = I, o = 0, as a default of a member: a conversion, not the call of a function, for the same
/// reason as `infinity`.
struct IdentityPose {
  /// As a pose.
  template <class Scalar>
  operator Pose<Scalar>() const {  // NOLINT: converts on purpose
    Eigen::Matrix<Scalar, 4, 4> T;
    for (Index j = 0; j < 4; ++j) {
      for (Index i = 0; i < 4; ++i) T(i, j) = i == j ? Scalar(1) : Scalar(0);
    }
    return Pose<Scalar>(T);  // a pose that is born without its numbers has its last row written
  }
};

}  // namespace icat
