// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A back-end moves a robot: a simulation, drives on a bus, an autopilot. It has three calls, and
/// the caller owns the loop, the clock and the thread.
///
/// - `read(time, state)` takes what has come until `time` and never waits. What has not come leaves
///   the state as it was; `state.time` is when the oldest part of it was measured.
/// - `write(time, command)`: the velocity ẏ from now on, until the next one.
/// - `healthy(time)`: the robot can be trusted with a command. All parts of it are there, work, and
///   were heard of lately.
///
/// A cycle reads, asks whether all is well, steps the controller and writes what it commands. When
/// the back-end is not healthy the caller stops the controller and goes on writing: a phase without
/// action in the table of a mission does that (docs/hardware.md). What stops the robot when nobody
/// writes any more is the back-end's own, and its documentation says how.
#pragma once

#include <concepts>

#include "icat/core/pose.hpp"
#include "icat/core/status.hpp"
#include "icat/core/types.hpp"
#include "icat/model/robot.hpp"

namespace icat {

/// What a back-end says of a robot of the type `R`.
template <JointedRobot R>
struct RobotState {
  /// Scalar type.
  using Scalar = typename R::Scalar;
  Vector<Scalar, Eigen::Dynamic> q;  ///< one entry for each of the robot's `joints`, rad or m
  Pose<Scalar> base;  ///< of the base in ⟨0⟩; the identity where nothing is known
  Vector<Scalar, R::size> velocity;  ///< ẏ as measured, n, base columns on the base
  double time{-infinity<double>};    ///< s: when the oldest part of it was measured

  /// All zero, at no time. Allocates.
  [[gnu::cold]] explicit RobotState(const R& robot)
      : q(detail::zeros<Vector<Scalar, Eigen::Dynamic>>(static_cast<Index>(robot.joints().size()))),
        base(IdentityPose{}),
        velocity(detail::zeros<Vector<Scalar, R::size>>(robot.dof())) {}
};

/// See the file comment. None of the calls throws, waits or allocates.
template <class B, class R>
concept BackEnd = JointedRobot<R> &&
    requires(B& back_end, const B& same, double time, RobotState<R>& state,
             const Vector<typename R::Scalar, R::size>& command) {
  { back_end.read(time, state) }
  noexcept->std::same_as<Status>;
  { back_end.write(time, command) }
  noexcept->std::same_as<Status>;
  { same.healthy(time) }
  noexcept->std::same_as<bool>;
};

}  // namespace icat
