// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The result of a control step. Steps never throw; construction and configuration do (error.hpp).
#pragma once

namespace icat {

/// Outcome of a control-step function. Anything but `ok` means: the input was refused, and the
/// object keeps its previous values, finite and inside its bounds.
enum class [[nodiscard]] Status{
    ok,
    non_finite,               ///< NaN or infinity in the input
    wrong_size,               ///< rows or columns do not match
    activation_out_of_range,  ///< an activation outside [0, 1]
    out_of_range,             ///< a setting outside its range
    not_a_rotation,           ///< a matrix that is no rotation
    numerical_failure,        ///< finite input, but its products overflow the scalar type
    time_reversed,            ///< the caller's time is before the previous one
    invalid_duration,         ///< a transition must take a finite time > 0
    not_started,              ///< no action has been started yet
    unknown_action,           ///< no action of that name or index
    unknown_joint,            ///< no joint or column of that name or index
    unknown_agent,            ///< no other agent of that index
    unknown_event,            ///< no phase of the mission knows an event of that name
    clock_stalled,            ///< ten stamps in a row did not change
    stale_state,              ///< the robot's state is older than `hold`
    stale_pose,               ///< the base's pose is older than `hold`
    stale_velocity,           ///< the measured velocity is older than `hold`
    stale_reference,          ///< the reference that is to be followed is older than `hold`
    missing_velocity,         ///< a given or compensated column of the base was not measured
    implausible_position,     ///< a joint is further outside its range than the range is wide
    round_out_of_range,       ///< a message of a round too far from this agent's own
    implausible,              ///< finite numbers beyond those of any working robot
    outlier,                  ///< a measurement too far from the estimate
    late_measurement,         ///< a measurement older than the history that is kept
    not_measured,             ///< the sensor reports that it has no measurement
    not_sent,                 ///< a bus or middleware did not take the command
};

/// One line for a log. No allocation.
constexpr const char* describe(Status status) noexcept {
  switch (status) {
    case Status::ok:
      return "ok";
    case Status::non_finite:
      return "NaN or infinity in the input";
    case Status::wrong_size:
      return "wrong size of Jacobian, activation or reference";
    case Status::activation_out_of_range:
      return "activation outside [0, 1]";
    case Status::out_of_range:
      return "a setting outside its range";
    case Status::not_a_rotation:
      return "a rotation matrix that is not orthonormal";
    case Status::numerical_failure:
      return "overflow in the solver";
    case Status::time_reversed:
      return "time runs backwards";
    case Status::invalid_duration:
      return "the duration of a transition must be finite and > 0";
    case Status::not_started:
      return "no action has been started";
    case Status::unknown_action:
      return "unknown action";
    case Status::unknown_joint:
      return "unknown joint";
    case Status::unknown_agent:
      return "unknown agent";
    case Status::unknown_event:
      return "unknown event";
    case Status::clock_stalled:
      return "the time stamps do not change";
    case Status::stale_state:
      return "the robot's state is too old";
    case Status::stale_pose:
      return "the base's pose is too old";
    case Status::stale_reference:
      return "the reference is too old";
    case Status::stale_velocity:
      return "the measured velocity is too old";
    case Status::missing_velocity:
      return "a velocity of the base that must be measured is missing";
    case Status::implausible_position:
      return "a joint far outside its range: degrees for radians?";
    case Status::round_out_of_range:
      return "a round too far from this agent's own";
    case Status::implausible:
      return "an implausible velocity, difficulty or span";
    case Status::outlier:
      return "a measurement too far from the estimate";
    case Status::late_measurement:
      return "a measurement that comes too late";
    case Status::not_measured:
      return "a sensor without a measurement";
    case Status::not_sent:
      return "a bus or middleware did not take the command";
  }
  return "unknown status";
}

}  // namespace icat
