// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The angle between an axis u of a frame and a direction: of the world (`Attitude`), or to a
/// target (`LookAt`, `Occlusion`).
///
/// With d the unit vector of the direction and A a constant rotation that takes u to z, the
/// misalignment of A R_fᵀ d from z is the angle θ, or the vector ξ = θ n, see rigid_motion.hpp;
/// near π, where n flips, about the axis that was begun with, see half_turn.hpp.
///
///     world:   d/dt (R_fᵀ d) = R_fᵀ (d × ω)
///     target:  d/dt (R_fᵀ (p − p_f)) = R_fᵀ (ṗ − v − ω × (p − p_f))
///
/// Component form: ẋ is the velocity Ξ d/dt (A R_fᵀ d) of that direction across itself, ẋ̄ = −γ ξ.
/// Norm form: an objective on θ, one row.
#pragma once

#include <optional>

#include "icat/math/half_turn.hpp"
#include "icat/math/rigid_motion.hpp"
#include "icat/task/task.hpp"

namespace icat {
namespace detail {

/// A rotation that takes the unit vector `u` to z.
template <class Scalar>
Matrix3<Scalar> rotation_to_z(const Vector3<Scalar>& u) noexcept {
  // Rows x, y, u, with x any vector across u.
  Vector3<Scalar> x = std::abs(u(0)) < static_cast<Scalar>(0.8)
                          ? Vector3<Scalar>(Scalar(1), Scalar(0), Scalar(0))
                          : Vector3<Scalar>(Scalar(0), Scalar(1), Scalar(0));
  x = plus(x, -dot(x, u), u);
  x = scaled(x, Scalar(1) / norm(x));
  const Vector3<Scalar> y = cross(u, x);
  Matrix3<Scalar> A;
  set_row3(A, 0, 0, x);
  set_row3(A, 1, 0, y);
  set_row3(A, 2, 0, u);
  return A;
}

/// What the tasks of an angle share.
template <FramedRobot R>
class DirectionTask : public ReactiveTask<R> {
 public:
  using Scalar = typename R::Scalar;

  /// θ of the last update, rad.
  Scalar angle() const noexcept { return angle_; }
  /// The angle of an axis that is to come to its direction; an objective may allow a part of it.
  Remaining<Scalar> remaining() const noexcept override {
    Remaining<Scalar> left;
    const bool comes = !norm_ || norm_->target(angle_) < angle_;
    left.angle = comes ? angle_ : Scalar(0);
    return left;
  }
  /// Another objective of the norm form; refused in the component form.
  Status set_objective(const Objective<Scalar>& norm) noexcept {
    if (!norm_) return Status::wrong_size;
    norm_ = norm;
    return Status::ok;
  }
  /// Another rate, rad/s; refused unless > 0.
  Status set_max_rate(Scalar rate) noexcept {
    if (!(rate > Scalar(0))) return Status::out_of_range;
    max_rate_ = rate;
    return Status::ok;
  }

 protected:
  [[gnu::cold]] DirectionTask(const R& robot, const std::string& name, FrameId frame,
                              const Vector3<Scalar>& axis,
                              const std::optional<Objective<Scalar>>& norm, Scalar gain,
                              Scalar max_rate)
      : ReactiveTask<R>(robot, name, norm ? 1 : 2, gain),
        frame_(frame),
        norm_(norm),
        max_rate_(max_rate) {
    this->require_frame(frame);
    this->require_rate("max_rate", max_rate);
    to_z_ = rotation_to_z<Scalar>(this->unit("axis", axis));
  }
  /// @throws std::invalid_argument unless `v` has length 1 to four digits.
  Vector3<Scalar> unit(const char* what, const Vector3<Scalar>& v) const {
    const Scalar length = icat::detail::norm(v);
    if (!(std::abs(length - Scalar(1)) < Scalar(1e-4))) {
      invalid("task '", this->name(), "': the ", what, " must have length 1, got ", length);
    }
    return scaled(v, Scalar(1) / length);
  }

  FrameId frame() const noexcept { return frame_; }

  /// Misalignment of the direction `d` of ⟨0⟩, and its rate by ḋ, components on ⟨0⟩.
  void measure(const Vector3<Scalar>& d) noexcept {
    turn_ = times(to_z_, transpose(rotation(this->robot().pose(frame_))));
    const Vector3<Scalar> at = times(turn_, d);
    misalignment_ = misalignment_from_z<Scalar>(at);
    angle_ = misalignment_.angle;
    // An axis is held to come down from π; to stay up there (`Occlusion`) none leads.
    const Scalar pi = std::numbers::pi_v<Scalar>;
    down_ = !norm_ || norm_->target(pi) < pi;
    way_.update(at, down_ && (!norm_ || norm_->target(angle_) < angle_), misalignment_);
  }
  /// Gradient of row `row` by the direction, components on ⟨0⟩.
  Vector3<Scalar> gradient(Index row) const noexcept {
    return transposed_times(turn_, !norm_  ? row3(misalignment_.vector_rate, row, 0)
                                   : down_ ? way_.gradient(misalignment_)
                                           : row3(misalignment_.angle_gradient, 0, 0));
  }
  /// References and activations; `feed_forward` for each row, `fade` of the angle near 0.
  void finish(const Scalar* feed_forward, Scalar fade) noexcept {
    if (norm_) {
      // Without an axis the gradient flips straight behind; the row fades out before it does.
      if (!down_) {
        fade *= smooth_step((std::numbers::pi_v<Scalar> - angle_) / static_cast<Scalar>(0.1));
      }
      this->set_scalar(0, down_ ? way_.angle() : angle_, *norm_, max_rate_, fade);
      this->reference_(0) += feed_forward[0];
      return;
    }
    const Scalar x = misalignment_.vector(0), y = misalignment_.vector(1);
    const Scalar rate = this->gain() * std::sqrt(x * x + y * y);
    const Scalar scale = rate > max_rate_ ? max_rate_ / rate : Scalar(1);
    for (Index i = 0; i < 2; ++i) {
      this->reference_(i) = -scale * this->gain() * misalignment_.vector(i) + feed_forward[i];
      this->activation_(i) = Scalar(1);
    }
  }

 private:
  FrameId frame_;
  std::optional<Objective<Scalar>> norm_;
  Scalar max_rate_, angle_{0};
  Matrix3<Scalar> to_z_, turn_;
  Misalignment<Scalar> misalignment_;
  DirectionWay<Scalar> way_;
  bool down_{true};
};

/// The direction from a frame to a point of ⟨0⟩ or to the origin of another frame.
template <FramedRobot R>
class TargetTask : public DirectionTask<R> {
 public:
  using Scalar = typename R::Scalar;

 protected:
  [[gnu::cold]] TargetTask(const R& robot, const std::string& name, FrameId frame,
                           const Vector3<Scalar>& axis, std::optional<FrameId> target,
                           const Vector3<Scalar>& point,
                           const std::optional<Objective<Scalar>>& norm, Scalar gain,
                           Scalar max_rate)
      : DirectionTask<R>(robot, name, frame, axis, norm, gain, max_rate),
        target_(target),
        point_(point),
        velocity_(zeros<Vector3<Scalar>>(3)) {
    if (target) this->require_frame(*target);
    this->require_finite("target", point);
    if (target && *target == frame) {
      invalid("task '", name, "': a frame has no direction to itself");
    }
  }
  Status set(const Vector3<Scalar>& point, const Vector3<Scalar>& velocity) noexcept {
    if (!all_finite(point) || !all_finite(velocity)) return Status::non_finite;
    if (target_) return Status::wrong_size;
    point_ = point;
    velocity_ = velocity;
    return Status::ok;
  }
  /// Everything; `near_fade`: the angle over which the row fades in from 0, or 0 for none.
  void aim(Scalar near_fade) noexcept {
    const R& robot = this->robot();
    const Vector3<Scalar> from = origin(robot.pose(this->frame()));
    const Vector3<Scalar> p = minus(target_ ? origin(robot.pose(*target_)) : point_, from);
    const Scalar range = norm(p);
    if (!(range > Scalar(0))) {  // In the lens: no direction, no task.
      this->deactivate();
      return;
    }
    const Vector3<Scalar> d = scaled(p, Scalar(1) / range);
    this->measure(d);
    const Matrix3<Scalar> D = direction_derivative(d, range);
    const auto& J = robot.jacobian(this->frame());
    Scalar feed_forward[2] = {Scalar(0), Scalar(0)};
    for (Index row = 0; row < this->rows(); ++row) {
      // ẋ = g · (ṗ − v − ω × p); the target's own motion goes to the reference or to its columns.
      const Vector3<Scalar> g = transposed_times(D, this->gradient(row));
      for (Index j = 0; j < J.cols(); ++j) this->jacobian_(row, j) = -dot(g, velocity_at(J, j, p));
      if (target_) {
        const auto& K = robot.jacobian(*target_);
        for (Index j = 0; j < K.cols(); ++j) {
          this->jacobian_(row, j) += dot(g, column3(K, 0, j));
        }
      } else {
        feed_forward[row] = -dot(g, velocity_);
      }
    }
    this->finish(feed_forward,
                 near_fade > Scalar(0) ? smooth_step(this->angle() / near_fade) : Scalar(1));
  }

 private:
  std::optional<FrameId> target_;
  Vector3<Scalar> point_, velocity_;
};

}  // namespace detail

namespace task {

/// An axis of a frame along an axis of ⟨0⟩, such as a vehicle held horizontal [Coop, Eq. (13)]: by
/// default z along z.
template <FramedRobot R>
class Attitude : public detail::DirectionTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "attitude";                                ///< in errors and logs
    Vector3<Scalar> axis{Scalar(0), Scalar(0), Scalar(1)};        ///< unit, on the frame
    Vector3<Scalar> world_axis{Scalar(0), Scalar(0), Scalar(1)};  ///< unit, on ⟨0⟩
    std::optional<Objective<Scalar>> norm = std::nullopt;         ///< on θ; given: the norm form
    Scalar gain{1};                                               ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};                            ///< rad/s
  };

  /// @throws std::invalid_argument on settings out of range. Allocates.
  [[gnu::cold]] Attitude(const R& robot, FrameId frame) : Attitude(robot, frame, Options{}) {}
  /// The same with options.
  [[gnu::cold]] Attitude(const R& robot, FrameId frame, Options options)
      : detail::DirectionTask<R>(robot, options.name, frame, options.axis, options.norm,
                                 options.gain, options.max_rate),
        world_axis_(this->unit("world_axis", options.world_axis)) {}

  /// Another axis of ⟨0⟩, of length 1, and its derivative (1/s); refused otherwise.
  Status set_world_axis(const Vector3<Scalar>& axis,
                        const Vector3<Scalar>& rate = detail::zeros<Vector3<Scalar>>(3)) noexcept {
    if (!detail::all_finite(axis) || !detail::all_finite(rate)) return Status::non_finite;
    const Scalar length = detail::norm(axis);
    if (!(std::abs(length - Scalar(1)) < Scalar(1e-4))) return Status::out_of_range;
    world_axis_ = detail::scaled(axis, Scalar(1) / length);
    rate_ = rate;
    return Status::ok;
  }

 private:
  void compute() noexcept override {
    this->measure(world_axis_);
    const auto& J = this->robot().jacobian(this->frame());
    Scalar feed_forward[2] = {Scalar(0), Scalar(0)};
    for (Index row = 0; row < this->rows(); ++row) {
      feed_forward[row] = -detail::dot(this->gradient(row), rate_);
      const Vector3<Scalar> g = detail::cross(this->gradient(row), world_axis_);  // g·(d×ω)
      for (Index j = 0; j < J.cols(); ++j) {
        this->jacobian_(row, j) = detail::dot(g, detail::column3(J, 3, j));
      }
    }
    this->finish(feed_forward, Scalar(1));
  }

  Vector3<Scalar> world_axis_, rate_{Scalar(0), Scalar(0), Scalar(0)};
};

/// A camera turned to its target, camera centering [Coop, Eq. (12)]: the target on an axis of the
/// camera's frame, z by default. The camera may sit on any link, the target on another.
template <FramedRobot R>
class LookAt : public detail::TargetTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "look at";                           ///< in errors and logs
    Vector3<Scalar> axis{Scalar(0), Scalar(0), Scalar(1)};  ///< unit, on the camera's frame
    /// Given: the norm form with this objective on θ, such as `at_most(0.3, 0.1)` rad.
    std::optional<Objective<Scalar>> norm = std::nullopt;
    Scalar gain{1};                     ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};  ///< rad/s
  };

  /// `target` in ⟨0⟩, m.
  /// @throws std::invalid_argument on settings out of range. Allocates.
  [[gnu::cold]] LookAt(const R& robot, FrameId camera, const Vector3<Scalar>& target)
      : LookAt(robot, camera, target, Options{}) {}
  /// The same with options.
  [[gnu::cold]] LookAt(const R& robot, FrameId camera, const Vector3<Scalar>& target,
                       Options options)
      : detail::TargetTask<R>(robot, options.name, camera, options.axis, std::nullopt, target,
                              options.norm, options.gain, options.max_rate) {}
  /// The target is the origin of another frame of the robot.
  [[gnu::cold]] LookAt(const R& robot, FrameId camera, FrameId target)
      : LookAt(robot, camera, target, Options{}) {}
  /// The same with options.
  [[gnu::cold]] LookAt(const R& robot, FrameId camera, FrameId target, Options options)
      : detail::TargetTask<R>(robot, options.name, camera, options.axis, target,
                              detail::zeros<Vector3<Scalar>>(3), options.norm, options.gain,
                              options.max_rate) {}

  /// Another target (m) and its velocity (m/s), on ⟨0⟩; refused if not finite, or where the target
  /// is a frame.
  Status set_target(const Vector3<Scalar>& target,
                    const Vector3<Scalar>& velocity = detail::zeros<Vector3<Scalar>>(3)) noexcept {
    return this->set(target, velocity);
  }

 private:
  void compute() noexcept override { this->aim(Scalar(0)); }
};

/// A frame, such as an elbow, out of the camera's cone of vision [Coop, II-D3], [MARIS, III-B7]:
/// θ, from the camera's axis to the line to the frame's origin, kept above a minimum.
template <FramedRobot R>
class Occlusion : public detail::TargetTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "occlusion";                         ///< in errors and logs
    Vector3<Scalar> axis{Scalar(0), Scalar(0), Scalar(1)};  ///< unit, on the camera's frame
    Scalar gain{1};                                         ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};                      ///< rad/s
  };

  /// `objective`: such as `at_least(half the opening of the cone, margin)`, rad.
  /// @throws std::invalid_argument on settings out of range. Allocates.
  [[gnu::cold]] Occlusion(const R& robot, FrameId camera, FrameId frame,
                          const Objective<Scalar>& objective)
      : Occlusion(robot, camera, frame, objective, Options{}) {}
  /// The same with options.
  [[gnu::cold]] Occlusion(const R& robot, FrameId camera, FrameId frame,
                          const Objective<Scalar>& objective, Options options)
      : detail::TargetTask<R>(robot, options.name, camera, options.axis, frame,
                              detail::zeros<Vector3<Scalar>>(3), objective, options.gain,
                              options.max_rate) {
    near_fade_ = fade_for(objective);
    if (!(near_fade_ > Scalar(0))) {
      detail::invalid("task '", options.name, "': the objective needs a minimum > 0, got ",
                      objective.lower());
    }
  }
  /// Another objective, with a minimum > 0; refused otherwise.
  Status set_objective(const Objective<Scalar>& objective) noexcept {
    if (!(fade_for(objective) > Scalar(0))) return Status::out_of_range;
    near_fade_ = fade_for(objective);
    return detail::TargetTask<R>::set_objective(objective);
  }

 private:
  // On the optical axis the gradient flips; the row fades out before it does.
  static Scalar fade_for(const Objective<Scalar>& objective) noexcept {
    return std::min(static_cast<Scalar>(0.1), objective.lower() / Scalar(2));
  }
  void compute() noexcept override { this->aim(near_fade_); }

  Scalar near_fade_;
};

}  // namespace task
}  // namespace icat
