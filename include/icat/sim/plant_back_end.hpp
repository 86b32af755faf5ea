// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A plant as a back-end (control/back_end.hpp), for missions in simulated time, or in real time
/// with a part of the robot simulated.
///
///     read(time)   moves the plant from the last `time` to this one under the command that is held
///     write        holds a command
///     healthy      the plant can be moved
///
/// `KinematicPlant` and `MujocoPlant` are such plants.
#pragma once

#include <concepts>

#include "icat/control/back_end.hpp"
#include "icat/core/step_clock.hpp"
#include "icat/math/spatial_algebra.hpp"

namespace icat {

/// What follows a commanded velocity: `step(command, time, dt)` moves it on by dt, s, and answers
/// nothing or a `Status`; `q`, `base` and `velocity` are as in `RobotState`.
template <class P, class R>
concept VelocityPlant = JointedRobot<R> &&
    requires(P& plant, const P& same, const Vector<typename R::Scalar, R::size>& velocity,
             double time) {
  plant.step(velocity, time, time);
  { same.q() } -> detail::Just<Vector<typename R::Scalar, Eigen::Dynamic>>;
  { same.base() } -> detail::Just<Pose<typename R::Scalar>>;
  { same.velocity() } -> detail::Just<Vector<typename R::Scalar, R::size>>;
};

/// See the file comment. What a plant throws in a step ends the program; it throws nothing at
/// commands of the right size.
template <JointedRobot R, VelocityPlant<R> P>
class PlantBackEnd {
 public:
  /// ẏ, n.
  using Velocity = Vector<typename R::Scalar, R::size>;

  /// Moves `plant`, which must outlive it, from the first `read` on. A `time` that jumps ahead by
  /// more than `max_step`, s, moves it by a usual step (step_clock.hpp). Allocates.
  /// @throws std::invalid_argument on a max_step that is not finite and > 0.
  [[gnu::cold]] PlantBackEnd(const R& robot, P& plant, double max_step = 1)
      : plant_(&plant), clock_(max_step), command_(detail::zeros<Velocity>(robot.dof())) {}

  /// The plant as it is at `time`, s. `non_finite`, or what the plant refused: `state` stays as it
  /// was. No allocation.
  Status read(double time, RobotState<R>& state) noexcept {
    if (const Status status = clock_.advance(time); status != Status::ok) return status;
    const double dt = clock_.step();
    if (dt > 0) status_ = advance(time - dt, dt);
    if (status_ != Status::ok) return status_;
    state.q = plant_->q();
    state.base = plant_->base();
    state.velocity = plant_->velocity();
    state.time = time;
    return Status::ok;
  }
  /// `command` from now on. `wrong_size`, `non_finite`: refused, the last one stays. No allocation.
  Status write(double time, const Velocity& command) noexcept {
    (void)time;
    if (command.size() != command_.size()) return Status::wrong_size;
    if (!detail::all_finite(command)) return Status::non_finite;
    detail::copy(command, command_);
    return Status::ok;
  }
  /// The plant's last step went well.
  bool healthy(double time) const noexcept {
    (void)time;
    return status_ == Status::ok;
  }

 private:
  Status advance(double time, double dt) noexcept {
    if constexpr (requires { Status(plant_->step(command_, time, dt)); }) {
      return plant_->step(command_, time, dt);
    } else {
      plant_->step(command_, time, dt);
      return Status::ok;
    }
  }

  P* plant_;
  StepClock clock_;
  Velocity command_;
  Status status_{Status::ok};
};

}  // namespace icat
