// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The distance from a frame's origin to a point or to another frame, and the centre of mass.
///
///     x = ‖d‖, d = p_b − p_a,   ẋ = dᵀ (ṗ_b − ṗ_a) / x
#pragma once

#include <optional>

#include "icat/math/spatial_algebra.hpp"
#include "icat/task/axes.hpp"
#include "icat/task/task.hpp"

namespace icat::task {

/// ‖d‖ from a frame to a point of ⟨0⟩, such as another vehicle [Coop, Eq. (16)], or to another
/// frame of the robot.
template <FramedRobot R>
class FrameDistance : public ScalarTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "frame distance";  ///< in errors and logs
    Scalar gain{1};                       ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};    ///< m/s
  };

  /// `point` in ⟨0⟩, m; `objective` on ‖d‖, such as `at_least(2, 0.5)`, m.
  /// @throws std::invalid_argument on settings out of range. Allocates.
  [[gnu::cold]] FrameDistance(const R& robot, FrameId frame, const Vector3<Scalar>& point,
                              const Objective<Scalar>& objective)
      : FrameDistance(robot, frame, point, objective, Options{}) {}
  /// The same with options.
  [[gnu::cold]] FrameDistance(const R& robot, FrameId frame, const Vector3<Scalar>& point,
                              const Objective<Scalar>& objective, Options options)
      : FrameDistance(robot, frame, std::nullopt, point, objective, options) {}
  /// To the origin of another frame.
  [[gnu::cold]] FrameDistance(const R& robot, FrameId frame, FrameId other,
                              const Objective<Scalar>& objective)
      : FrameDistance(robot, frame, other, objective, Options{}) {}
  /// The same with options.
  [[gnu::cold]] FrameDistance(const R& robot, FrameId frame, FrameId other,
                              const Objective<Scalar>& objective, Options options)
      : FrameDistance(robot, frame, std::optional<FrameId>(other),
                      detail::zeros<Vector3<Scalar>>(3), objective, options) {}

  /// Another point (m) and its velocity (m/s), on ⟨0⟩; refused if not finite, or where the distance
  /// is that to a frame.
  Status set_point(const Vector3<Scalar>& point,
                   const Vector3<Scalar>& velocity = detail::zeros<Vector3<Scalar>>(3)) noexcept {
    if (!detail::all_finite(point) || !detail::all_finite(velocity)) return Status::non_finite;
    if (other_) return Status::wrong_size;
    point_ = point;
    velocity_ = velocity;
    return Status::ok;
  }

 private:
  [[gnu::cold]] FrameDistance(const R& robot, FrameId frame, std::optional<FrameId> other,
                              const Vector3<Scalar>& point, const Objective<Scalar>& objective,
                              const Options& options)
      : ScalarTask<R>(robot, options.name, objective, options.gain, options.max_rate),
        frame_(frame),
        other_(other),
        point_(point),
        velocity_(detail::zeros<Vector3<Scalar>>(3)) {
    this->require_frame(frame);
    if (other) this->require_frame(*other);
    this->set_length_power(0, 1, 1);
    this->measure_reach(frame);
    if (other) this->measure_reach(*other);
    this->require_finite("point", point);
    if (other && *other == frame) {
      detail::invalid("task '", options.name, "': the distance of a frame to itself");
    }
  }

  void compute() noexcept override {
    const R& robot = this->robot();
    const Vector3<Scalar> to = other_ ? detail::origin(robot.pose(*other_)) : point_;
    const Vector3<Scalar> d = detail::minus(to, detail::origin(robot.pose(frame_)));
    const Scalar distance = detail::norm(d);
    const Vector3<Scalar> n =
        detail::scaled(d, distance > Scalar(0) ? Scalar(1) / distance : Scalar(0));
    const auto& J = robot.jacobian(frame_);
    for (Index j = 0; j < J.cols(); ++j) {
      this->jacobian_(0, j) = -detail::dot(n, detail::column3(J, 0, j));
    }
    if (other_) {
      const auto& K = robot.jacobian(*other_);
      for (Index j = 0; j < K.cols(); ++j) {
        this->jacobian_(0, j) += detail::dot(n, detail::column3(K, 0, j));
      }
    }
    // Where the two coincide the gradient flips; a row that pushes apart fades out before it does.
    const Scalar apart = this->objective().lower();
    this->set_value(distance,
                    apart > Scalar(0) ? smooth_step(Scalar(10) * distance / apart) : Scalar(1));
    if (!other_) this->reference_(0) -= detail::dot(n, velocity_);
  }

  FrameId frame_;
  std::optional<FrameId> other_;
  Vector3<Scalar> point_, velocity_;
};

/// The centre of mass to a goal.
template <MassiveRobot R>
class CenterOfMass : public ReactiveTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "center of mass";  ///< in errors and logs
    Axes axes{};                          ///< of ⟨0⟩, which count
    Scalar gain{1};                       ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};    ///< m/s, of the error's part
  };

  /// `goal` in ⟨0⟩, m.
  /// @throws std::invalid_argument on settings out of range. Allocates.
  [[gnu::cold]] CenterOfMass(const R& robot, const Vector3<Scalar>& goal)
      : CenterOfMass(robot, goal, Options{}) {}
  /// The same with options.
  [[gnu::cold]] CenterOfMass(const R& robot, const Vector3<Scalar>& goal, Options options)
      : ReactiveTask<R>(robot, options.name, options.axes.count(), options.gain),
        options_(options),
        goal_(goal),
        velocity_(detail::zeros<Vector3<Scalar>>(3)) {
    this->set_length_power(0, this->rows(), 1);
    this->set_length_share(Scalar(0.5));  // a uniform arm's is at half its reach
    this->require_rate("max_rate", options.max_rate);
    this->require_finite("goal", goal);
    if (!(robot.mass() > Scalar(0))) {
      detail::invalid("task '", options.name, "': the robot has no masses");
    }
  }

  /// Another goal (m) and its velocity (m/s), on ⟨0⟩; refused if not finite.
  Status set_goal(const Vector3<Scalar>& goal,
                  const Vector3<Scalar>& velocity = detail::zeros<Vector3<Scalar>>(3)) noexcept {
    if (!detail::all_finite(goal) || !detail::all_finite(velocity)) return Status::non_finite;
    goal_ = goal;
    velocity_ = velocity;
    return Status::ok;
  }
  /// Another rate, m/s; refused unless > 0.
  Status set_max_rate(Scalar rate) noexcept {
    if (!(rate > Scalar(0))) return Status::out_of_range;
    options_.max_rate = rate;
    return Status::ok;
  }

 private:
  void compute() noexcept override {
    const Vector3<Scalar> error =
        detail::minus(goal_, Vector3<Scalar>(this->robot().center_of_mass()));
    const auto& J = this->robot().center_of_mass_jacobian();
    Scalar square(0);
    for (Index i = 0; i < 3; ++i) {
      if (options_.axes[i]) square += error(i) * error(i);
    }
    const Scalar rate = this->gain() * std::sqrt(square);
    const Scalar scale = rate > options_.max_rate ? options_.max_rate / rate : Scalar(1);
    Index row = 0;
    for (Index i = 0; i < 3; ++i) {
      if (!options_.axes[i]) continue;
      for (Index j = 0; j < J.cols(); ++j) this->jacobian_(row, j) = J(i, j);
      this->reference_(row++) = scale * this->gain() * error(i) + velocity_(i);
    }
  }

  Options options_;
  Vector3<Scalar> goal_, velocity_;
};

}  // namespace icat::task
