// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What tasks and controllers need to know of a robot.
#pragma once

#include <concepts>

#include "icat/core/types.hpp"

namespace icat {

/// A scalar type, the number of degrees of freedom at compile time (`size`, or `Eigen::Dynamic`)
/// and at run time. Everything else is between a robot and the tasks that read it.
template <class R>
concept Robot = requires(const R& robot) {
  typename R::Scalar;
  { R::size } -> std::convertible_to<int>;
  { robot.dof() } -> std::convertible_to<Index>;
};

/// A robot whose velocity is `[q̇; v]`, the last six components those of its vehicle.
template <class R>
concept VehicleManipulator = Robot<R> && requires(const R& robot) {
  { robot.arm_dof() } -> std::convertible_to<Index>;
};

}  // namespace icat
