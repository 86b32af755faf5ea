// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A back-end moves a robot: a simulation, drives on a bus, an autopilot. It has three calls, and
/// the caller owns the loop, the clock and the thread.
///
/// - `read(time, state)` takes the measurements that have arrived until `time` and never blocks. A
/// part of the state without a new measurement stays as it was; `state.time` is the time at which
/// the oldest part was measured.
/// - `write(time, command)` commands the velocity ẏ, which holds until the next call.
/// - `healthy(time)`: the robot can accept a command. All its parts are connected, work, and have
/// reported lately.
///
/// A cycle reads, checks `healthy`, steps the controller and writes its command. When the back-end
/// is not healthy the caller stops the controller and continues to write: a phase without action in
/// the table of a mission does that (docs/hardware.md). Each back-end documents what stops the
/// robot when the program no longer writes.
#pragma once

#include <concepts>

#include "icat/core/pose.hpp"
#include "icat/core/status.hpp"
#include "icat/core/types.hpp"
#include "icat/model/robot.hpp"

namespace icat {

/// The state of a robot of the type `R`, as a back-end measures it.
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
