// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A frame ⟨f⟩ of the robot to a goal: pose, position, orientation, velocity. The goal is given in
/// ⟨0⟩, or in another frame of the same robot: two hands on one object, a tool in front of a
/// camera.
///
///     r = p_goal − p,   φ the rotation vector from ⟨f⟩ to its goal, components on the reference
///
/// **Component form** [Coop, Eq. (15)], a row for each axis. All three axes: ẋ is the frame's
/// velocity, ẋ̄ = γ [r; φ], a straight line and one fixed axis. A part of them: x is that part of
/// −r or −φ, and J its exact derivative,
///
///     on the reference:  d/dt φ = J_r⁻¹(−φ) ω_goal − J_r⁻¹(φ) ω
///     on ⟨f⟩:            d/dt (Rᵀ r) = Rᵀ (v_goal − v − ω × r)
///     J_r⁻¹(φ) = I + [φ]×/2 + (1/θ² − cot(θ/2)/(2θ)) [φ]×²,  θ = ‖φ‖
///
/// **Norm form** [Coop, Eq. (14), Remark 1]: x = ‖r‖ or ‖φ‖ over the chosen axes, one row.
///
/// φ is the shorter rotation or, near π, the one in the sense that was begun, ‖φ‖ up to π + 1: see
/// half_turn.hpp. Where the sense changes, ẋ̄ of all three components fades to 0 and returns; for
/// some axes or a norm, whose rows reverse there, the activation fades. A goal that moves is
/// followed without lag where its velocity is given.
#pragma once

#include <optional>

#include "icat/math/half_turn.hpp"
#include "icat/math/rigid_motion.hpp"
#include "icat/task/relative_frame.hpp"

namespace icat {

/// Objectives of the norm form of a pose, such as `{at_most(0.2, 0.1), at_most(0.1, 0.05)}`.
template <class Scalar>
struct PoseNorms {
  Objective<Scalar> position;     ///< on ‖r‖, m
  Objective<Scalar> orientation;  ///< on ‖φ‖, rad
};

namespace detail {

/// J_r⁻¹(φ), see the file comment.
template <class Scalar>
Matrix3<Scalar> inverse_right_jacobian(const Vector3<Scalar>& phi) noexcept {
  const Scalar angle = norm(phi), sq = angle * angle;
  // Below 1e-2 the next term of the series is < 1e-12.
  const Scalar c = angle < static_cast<Scalar>(1e-2)
                       ? Scalar(1) / Scalar(12) + sq / Scalar(720)
                       : Scalar(1) / sq - std::cos(angle / Scalar(2)) /
                                              (std::sin(angle / Scalar(2)) * Scalar(2) * angle);
  const Matrix3<Scalar> S = skew(phi), S2 = times(S, S);
  Matrix3<Scalar> J;
  for (Index j = 0; j < 3; ++j) {
    for (Index i = 0; i < 3; ++i) {
      J(i, j) = (i == j ? Scalar(1) : Scalar(0)) + S(i, j) / Scalar(2) + c * S2(i, j);
    }
  }
  return J;
}

/// Linear or angular part of a goal.
template <class Scalar>
struct GoalPart {
  Axes axes;
  Scalar max_rate;
  std::optional<Objective<Scalar>> norm;

  Index rows() const noexcept { return norm && axes.count() > 0 ? 1 : axes.count(); }
};

/// What the tasks with a goal share.
template <FramedRobot R>
class FrameGoal : public ReactiveTask<R> {
 public:
  using Scalar = typename R::Scalar;

  /// The controlled frame.
  FrameId frame() const noexcept { return frame_.frame(); }
  /// Rows are components on ⟨0⟩.
  bool on_world() const noexcept { return frame_.absolute() && on_ == On::reference; }
  Remaining<Scalar> remaining() const noexcept override {
    Remaining<Scalar> left;
    if (linear_.axes.count() > 0) left.position = position_error_;
    if (angular_.axes.count() > 0) left.angle = orientation_error_;
    return left;
  }

 protected:
  [[gnu::cold]] FrameGoal(const R& robot, FrameId frame, std::optional<FrameId> reference,
                          const Pose<Scalar>& goal, const std::string& name, On on,
                          const GoalPart<Scalar>& linear, const GoalPart<Scalar>& angular,
                          Scalar gain)
      : ReactiveTask<R>(robot, name, linear.rows() + angular.rows(), gain),
        on_(on),
        linear_(linear),
        angular_(angular),
        goal_(goal),
        goal_velocity_(zeros<Vector6<Scalar>>(6)),
        frame_(robot, frame, reference, name) {
    if (linear.rows() > 0) {
      this->set_length_power(0, linear.rows(), 1);
      this->measure_reach(frame);
      if (reference) this->measure_reach(*reference);
    }
    this->require_rate("the largest linear rate", linear.max_rate);
    this->require_rate("the largest angular rate", angular.max_rate);
    if (!is_rigid(goal)) {
      invalid("task '", this->name(), "': the goal is not finite or not a rotation");
    }
  }

  Status set(const Pose<Scalar>& goal, const Vector6<Scalar>& velocity) noexcept {
    if (!all_finite(goal.matrix()) || !all_finite(velocity)) return Status::non_finite;
    if (!is_rigid(goal)) return Status::not_a_rotation;
    goal_ = goal;
    goal_velocity_ = velocity;
    return Status::ok;
  }
  static Status set_rate(GoalPart<Scalar>& part, Scalar rate) noexcept {
    if (!(rate > Scalar(0))) return Status::out_of_range;
    part.max_rate = rate;
    return Status::ok;
  }
  /// Only the objective may change, not the form: that would be another number of rows.
  static Status set_norm(GoalPart<Scalar>& part, const Objective<Scalar>& objective) noexcept {
    if (!part.norm) return Status::wrong_size;
    part.norm = objective;
    return Status::ok;
  }

  /// ‖r‖ over the chosen axes at the last update, m.
  Scalar position_error() const noexcept { return position_error_; }
  /// ‖φ‖ over the chosen axes at the last update, the short way: rad, at most π.
  Scalar orientation_error() const noexcept { return orientation_error_; }

  const Pose<Scalar>& goal_pose() const noexcept { return goal_; }
  GoalPart<Scalar>& linear() noexcept { return linear_; }
  GoalPart<Scalar>& angular() noexcept { return angular_; }

 private:
  // ẋ of a row is linear · v + angular · ω, its error what x is to lose.
  struct Row {
    Vector3<Scalar> linear, angular;
    Scalar error, forward;
  };

  void compute() noexcept override {
    frame_.update(this->robot());
    const Matrix3<Scalar> turn = rotation(frame_.pose());
    if (linear_.axes.count() > 0) {
      const Vector3<Scalar> goal = origin(goal_);
      const Vector3<Scalar> error = minus(goal, origin(frame_.pose()));
      const bool exact = on_ == On::frame && linear_.axes.count() < 3;
      Row rows[3];
      for (Index i = 0, k = 0; i < 3; ++i) {
        if (!linear_.axes[i]) continue;
        const Vector3<Scalar> b = axis(turn, i);
        // b · (v + ω × r) = b · v + (r × b) · ω
        rows[k++] = {b, exact ? cross(error, b) : scaled(b, Scalar(0)), dot(b, error),
                     dot(b, column3(goal_velocity_, 0, 0))};
      }
      position_error_ = finish(0, linear_, rows, Scalar(1), Scalar(1), norm(goal));
    }
    if (angular_.axes.count() > 0) {
      const Vector3<Scalar> phi = way_.update(times(rotation(goal_), transpose(turn)));
      const Vector3<Scalar> omega = column3(goal_velocity_, 3, 0);
      const bool exact = angular_.axes.count() < 3, on_frame = on_ == On::frame;
      const Vector3<Scalar> x = on_frame ? transposed_times(turn, phi) : phi;
      Matrix3<Scalar> D;
      if (exact) D = inverse_right_jacobian<Scalar>(on_frame ? scaled(x, Scalar(-1)) : x);
      Row rows[3];
      for (Index i = 0, k = 0; i < 3; ++i) {
        if (!angular_.axes[i]) continue;
        Vector3<Scalar> b = axis(turn, i), forward = b;
        if (exact) {
          b = on_frame ? times(turn, row3(D, i, 0)) : row3(D, i, 0);
          forward = on_frame ? b : column3(D, 0, i);
        }
        rows[k++] = {scaled(b, Scalar(0)), b, x(i), dot(forward, omega)};
      }
      const Scalar weight = way_.weight();
      // The rows of a part of φ turn over where the way changes, those of all of ω do not.
      const Scalar error = finish(linear_.rows(), angular_, rows, exact ? Scalar(1) : weight,
                                  exact ? weight : Scalar(1), Scalar(1));
      const Scalar angle = norm(phi), pi = std::numbers::pi_v<Scalar>;
      orientation_error_ = angle > pi ? error * (Scalar(2) * pi / angle - Scalar(1)) : error;
    }
  }

  /// Axis `i` on the reference.
  Vector3<Scalar> axis(const Matrix3<Scalar>& turn, Index i) const noexcept {
    if (on_ == On::frame) return column3(turn, 0, i);
    Vector3<Scalar> e(Scalar(0), Scalar(0), Scalar(0));
    e(i) = Scalar(1);
    return e;
  }

  /// Writes the rows of a part from row `first` on; the norm of the error. `error_fade` is a factor
  /// of the error's rate, `row_fade` of the activation; `magnitude` that of the numbers whose
  /// difference the error is.
  Scalar finish(Index first, const GoalPart<Scalar>& part, const Row* rows, Scalar error_fade,
                Scalar row_fade, Scalar magnitude) noexcept {
    const Index count = part.axes.count();
    Scalar square(0);
    for (Index k = 0; k < count; ++k) square += rows[k].error * rows[k].error;
    const Scalar distance = std::sqrt(square), rate = this->gain() * distance;
    if (!part.norm) {
      const Scalar scale = rate > part.max_rate ? part.max_rate / rate : Scalar(1);
      for (Index k = 0; k < count; ++k) {
        write(first + k, rows[k].linear, rows[k].angular);
        this->reference_(first + k) =
            (scale * this->gain()) * rows[k].error * error_fade + rows[k].forward;
        this->activation_(first + k) = row_fade;
      }
      return distance;
    }
    const Scalar fade = error_fade * row_fade;  // one of the two is 1
    // The mean of both sides of the kink at distance 0, as far as rounding can tell.
    const Scalar rounding = Scalar(8) * std::numeric_limits<Scalar>::epsilon() * magnitude;
    const Scalar factor = distance > rounding ? Scalar(-1) / distance : Scalar(0);
    const Vector3<Scalar> none(Scalar(0), Scalar(0), Scalar(0));
    Row sum{none, none, Scalar(0), Scalar(0)};
    for (Index k = 0; k < count; ++k) {
      const Scalar d = factor * rows[k].error;
      sum.linear = plus(sum.linear, d, rows[k].linear);
      sum.angular = plus(sum.angular, d, rows[k].angular);
      sum.forward += d * rows[k].forward;
    }
    write(first, sum.linear, sum.angular);
    this->set_scalar(first, distance, *part.norm, part.max_rate, fade);
    this->reference_(first) += sum.forward;
    return distance;
  }
  static bool is_zero(const Vector3<Scalar>& v) noexcept {
    return v(0) == Scalar(0) && v(1) == Scalar(0) && v(2) == Scalar(0);
  }
  void write(Index row, const Vector3<Scalar>& linear, const Vector3<Scalar>& angular) noexcept {
    const auto& J = frame_.jacobian();
    const bool moves = !is_zero(linear), turns = !is_zero(angular);
    for (Index j = 0; j < J.cols(); ++j) {
      Scalar rate(0);
      if (moves) rate = dot(linear, column3(J, 0, j));
      if (turns) rate += dot(angular, column3(J, 3, j));
      this->jacobian_(row, j) = rate;
    }
  }

  On on_;
  GoalPart<Scalar> linear_, angular_;
  Pose<Scalar> goal_;
  Vector6<Scalar> goal_velocity_;
  RelativeFrame<R> frame_;
  RotationWay<Scalar> way_;
  Scalar position_error_{0}, orientation_error_{0};
};

}  // namespace detail

namespace task {

/// A frame to a goal pose [Coop, Eq. (14), (15)].
template <FramedRobot R>
class FramePose : public detail::FrameGoal<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "frame pose";                        ///< in errors and logs
    std::optional<FrameId> relative_to = std::nullopt;      ///< the reference; none: ⟨0⟩
    Axes linear{};                                          ///< of the position
    Axes angular{};                                         ///< of the orientation
    On on{On::reference};                                   ///< whose axes
    std::optional<PoseNorms<Scalar>> norms = std::nullopt;  ///< given: the norm form
    Scalar gain{1};                                         ///< γ, 1/s
    Scalar max_linear_rate{infinity<Scalar>};               ///< m/s, of the error's part
    Scalar max_angular_rate{infinity<Scalar>};              ///< rad/s, of the error's part
  };

  /// `goal` in the reference.
  /// @throws std::invalid_argument on settings out of range. Allocates.
  [[gnu::cold]] FramePose(const R& robot, FrameId frame, const Pose<Scalar>& goal)
      : FramePose(robot, frame, goal, Options{}) {}
  /// The same with options.
  [[gnu::cold]] FramePose(const R& robot, FrameId frame, const Pose<Scalar>& goal, Options options)
      : detail::FrameGoal<R>(
            robot, frame, options.relative_to, goal, options.name, options.on,
            {options.linear, options.max_linear_rate,
             options.norms ? std::optional(options.norms->position) : std::nullopt},
            {options.angular, options.max_angular_rate,
             options.norms ? std::optional(options.norms->orientation) : std::nullopt},
            options.gain) {}

  using detail::FrameGoal<R>::position_error;
  using detail::FrameGoal<R>::orientation_error;

  /// In the reference.
  const Pose<Scalar>& goal() const noexcept { return this->goal_pose(); }
  /// Another goal, and its velocity [linear; angular] at its origin, components on the reference:
  /// refused if not finite or no rotation, the old goal stays. Near π the way that was begun stays,
  /// unless the goal jumps by more than 0.5 rad.
  Status set_goal(const Pose<Scalar>& goal,
                  const Vector6<Scalar>& velocity = detail::zeros<Vector6<Scalar>>(6)) noexcept {
    return this->set(goal, velocity);
  }
  /// Other rates, m/s and rad/s; refused unless > 0.
  Status set_max_rates(Scalar linear, Scalar angular) noexcept {
    if (!(linear > Scalar(0))) return Status::out_of_range;
    const Status status = this->set_rate(this->angular(), angular);
    return status == Status::ok ? this->set_rate(this->linear(), linear) : status;
  }
  /// Other objectives of the norm form; refused in the component form.
  Status set_norms(const PoseNorms<Scalar>& norms) noexcept {
    const Status status = this->set_norm(this->linear(), norms.position);
    return status == Status::ok ? this->set_norm(this->angular(), norms.orientation) : status;
  }
};

/// A frame's origin to a goal [MARIS, III-B7].
template <FramedRobot R>
class FramePosition : public detail::FrameGoal<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "frame position";                   ///< in errors and logs
    std::optional<FrameId> relative_to = std::nullopt;     ///< the reference; none: ⟨0⟩
    Axes axes{};                                           ///< which count
    On on{On::reference};                                  ///< whose axes
    std::optional<Objective<Scalar>> norm = std::nullopt;  ///< on ‖r‖, m; given: the norm form
    Scalar gain{1};                                        ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};                     ///< m/s, of the error's part
  };

  /// `goal` in the reference, m.
  /// @throws std::invalid_argument on settings out of range. Allocates.
  [[gnu::cold]] FramePosition(const R& robot, FrameId frame, const Vector3<Scalar>& goal)
      : FramePosition(robot, frame, goal, Options{}) {}
  /// The same with options.
  [[gnu::cold]] FramePosition(const R& robot, FrameId frame, const Vector3<Scalar>& goal,
                              Options options)
      : detail::FrameGoal<R>(robot, frame, options.relative_to, at(goal), options.name, options.on,
                             {options.axes, options.max_rate, options.norm},
                             {no_axes, infinity<Scalar>, std::nullopt}, options.gain) {}

  using detail::FrameGoal<R>::position_error;

  /// In the reference, m.
  Vector3<Scalar> goal() const noexcept { return detail::origin(this->goal_pose()); }
  /// Another goal and its velocity (m/s), both on the reference; refused if not finite.
  Status set_goal(const Vector3<Scalar>& goal,
                  const Vector3<Scalar>& velocity = detail::zeros<Vector3<Scalar>>(3)) noexcept {
    auto twist = detail::zeros<Vector6<Scalar>>(6);
    detail::set_column3(twist, 0, 0, velocity);
    return this->set(at(goal), twist);
  }
  /// Another rate, m/s; refused unless > 0.
  Status set_max_rate(Scalar rate) noexcept { return this->set_rate(this->linear(), rate); }
  /// Another objective of the norm form; refused in the component form.
  Status set_objective(const Objective<Scalar>& norm) noexcept {
    return this->set_norm(this->linear(), norm);
  }

 private:
  static Pose<Scalar> at(const Vector3<Scalar>& point) noexcept {
    return detail::make_pose(detail::identity<Matrix3<Scalar>>(3), point);
  }
};

/// A frame's orientation to a goal [MARIS, III-B7].
template <FramedRobot R>
class FrameOrientation : public detail::FrameGoal<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "frame orientation";                ///< in errors and logs
    std::optional<FrameId> relative_to = std::nullopt;     ///< the reference; none: ⟨0⟩
    Axes axes{};                                           ///< components of φ that count
    On on{On::reference};                                  ///< whose axes
    std::optional<Objective<Scalar>> norm = std::nullopt;  ///< on ‖φ‖, rad; given: the norm form
    Scalar gain{1};                                        ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};                     ///< rad/s, of the error's part
  };

  /// `goal`: the rotation from ⟨f⟩ to the reference that is wanted.
  /// @throws std::invalid_argument on settings out of range. Allocates.
  [[gnu::cold]] FrameOrientation(const R& robot, FrameId frame, const Matrix3<Scalar>& goal)
      : FrameOrientation(robot, frame, goal, Options{}) {}
  /// The same with options.
  [[gnu::cold]] FrameOrientation(const R& robot, FrameId frame, const Matrix3<Scalar>& goal,
                                 Options options)
      : detail::FrameGoal<R>(robot, frame, options.relative_to, turned(goal), options.name,
                             options.on, {no_axes, infinity<Scalar>, std::nullopt},
                             {options.axes, options.max_rate, options.norm}, options.gain) {}

  using detail::FrameGoal<R>::orientation_error;

  /// See the constructor.
  Matrix3<Scalar> goal() const noexcept { return detail::rotation(this->goal_pose()); }
  /// Another goal and its angular velocity (rad/s, on the reference); refused if not finite or no
  /// rotation, the old goal stays. Near π the way that was begun stays, unless the goal jumps by
  /// more than 0.5 rad.
  Status set_goal(const Matrix3<Scalar>& goal,
                  const Vector3<Scalar>& velocity = detail::zeros<Vector3<Scalar>>(3)) noexcept {
    auto twist = detail::zeros<Vector6<Scalar>>(6);
    detail::set_column3(twist, 3, 0, velocity);
    return this->set(turned(goal), twist);
  }
  /// Another rate, rad/s; refused unless > 0.
  Status set_max_rate(Scalar rate) noexcept { return this->set_rate(this->angular(), rate); }
  /// Another objective of the norm form; refused in the component form.
  Status set_objective(const Objective<Scalar>& norm) noexcept {
    return this->set_norm(this->angular(), norm);
  }

 private:
  static Pose<Scalar> turned(const Matrix3<Scalar>& rotation) noexcept {
    return detail::make_pose(rotation, Vector3<Scalar>(Scalar(0), Scalar(0), Scalar(0)));
  }
};

/// A frame's velocity follows a given one: agreed on with another robot [Coop, IV-C], or from an
/// operator's joystick. Non-reactive.
template <FramedRobot R>
class FrameVelocity : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "frame velocity";                ///< in errors and logs
    std::optional<FrameId> relative_to = std::nullopt;  ///< the reference; none: ⟨0⟩
    Axes linear{};                                      ///< of the linear velocity
    Axes angular{};                                     ///< of the angular velocity
    On on{On::frame};                                   ///< whose axes
  };

  /// Starts with velocity 0.
  /// @throws std::invalid_argument without any axis. Allocates.
  [[gnu::cold]] FrameVelocity(const R& robot, FrameId frame)
      : FrameVelocity(robot, frame, Options{}) {}
  /// The same with options.
  [[gnu::cold]] FrameVelocity(const R& robot, FrameId frame, Options options)
      : Task<R>(robot, options.name, options.linear.count() + options.angular.count()),
        options_(options),
        frame_(robot, frame, options.relative_to, options.name) {
    if (options.linear.count() > 0) {
      this->set_length_power(0, options.linear.count(), 1);
      this->measure_reach(frame);
      if (options.relative_to) this->measure_reach(*options.relative_to);
    }
  }

  /// [linear; angular] at the origin of ⟨f⟩, m/s, rad/s, of which the chosen axes count. NaN or
  /// infinity among them is refused, and the velocity is 0 until a valid one is set, since keeping
  /// an old velocity is not as safe as keeping an old goal.
  Status set_velocity(const Vector6<Scalar>& velocity) noexcept {
    bool good = true;
    for (Index i = 0; i < 6; ++i) good = good && (!counts(i) || std::isfinite(velocity(i)));
    Index row = 0;
    for (Index i = 0; i < 6; ++i) {
      if (counts(i)) this->reference_(row++) = good ? velocity(i) : Scalar(0);
    }
    return good ? Status::ok : Status::non_finite;
  }

 private:
  bool counts(Index i) const noexcept {
    return i < 3 ? options_.linear[i] : options_.angular[i - 3];
  }
  void compute() noexcept override {
    frame_.update(this->robot());
    const Matrix3<Scalar> turn = detail::rotation(frame_.pose());
    const auto& J = frame_.jacobian();
    Index row = 0;
    for (Index i = 0; i < 6; ++i) {
      if (!counts(i)) continue;
      const Index part = i < 3 ? 0 : 3;
      for (Index j = 0; j < J.cols(); ++j) {
        this->jacobian_(row, j) =
            options_.on == On::reference
                ? J(i, j)
                : detail::dot(detail::column3(turn, 0, i - part), detail::column3(J, part, j));
      }
      ++row;
    }
  }

  Options options_;
  detail::RelativeFrame<R> frame_;
};

}  // namespace task
}  // namespace icat
