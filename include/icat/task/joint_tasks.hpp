// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Tasks of joints alone: away from their limits, to a position.
///
///     e_j = q*_j − q_j, for a continuous joint less whole turns
///
/// Near π, where the shorter rotation changes its sense, a continuous joint keeps the sense that
/// was begun, see half_turn.hpp. Where the sense changes, the error fades out and returns; in the
/// norm form the row does.
#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "icat/core/list.hpp"
#include "icat/math/half_turn.hpp"
#include "icat/task/task.hpp"

namespace icat {

/// One number for all joints of a task, or one for each.
template <class Scalar>
class PerJoint {
 public:
  /// For all.
  PerJoint(Scalar value) : values_(1, value), for_all_(true) {}  // NOLINT: converts on purpose
  /// For each, in the task's order of joints; a single one is for all.
  PerJoint(std::initializer_list<Scalar> values) : PerJoint(values.begin(), values.size()) {}
  /// The same.
  PerJoint(const std::vector<Scalar>& values)  // NOLINT: converts on purpose
      : PerJoint(values.data(), values.size()) {}

  /// Whether it is one number for all.
  bool for_all() const noexcept { return for_all_; }
  /// How many numbers there are.
  Index size() const noexcept { return static_cast<Index>(values_.size()); }
  /// Of joint `i` of the task.
  Scalar operator[](Index i) const noexcept {
    return values_[for_all_ ? 0 : static_cast<std::size_t>(i)];
  }
  /// The same number for all from now on. No allocation.
  void set_all(Scalar value) noexcept { values_.fill(value); }

 private:
  PerJoint(const Scalar* values, std::size_t count) : values_(count), for_all_(count == 1) {
    for (std::size_t i = 0; i < count; ++i) values_[i] = values[i];
  }

  List<Scalar> values_;
  bool for_all_;
};

namespace detail {

/// A task with a row for each of some joints.
template <JointedRobot R>
class JointTask : public ReactiveTask<R> {
 public:
  using Scalar = typename R::Scalar;

 protected:
  [[gnu::cold]] JointTask(const R& robot, const std::string& name,
                          const std::vector<std::string>& joints, bool one_row, Scalar gain)
      : ReactiveTask<R>(robot, name, count(robot, name, joints, one_row), gain),
        joints_(chosen(robot, name, joints)) {
    for (const Index i : joints_) columns_.push_back(info(i).column);
  }
  /// @throws std::invalid_argument on another number than one or one for each joint, or below 0.
  [[gnu::cold]] void check(const char* what, const PerJoint<Scalar>& values) const {
    if (!values.for_all() && values.size() != joint_count()) {
      invalid("task '", this->name(), "': ", what, " has ", values.size(), " numbers for ",
              joint_count(), " joints");
    }
    for (Index k = 0; k < values.size(); ++k) {
      if (!(values[k] > Scalar(0))) {
        const bool all = values.for_all();
        invalid("task '", this->name(), "': ", what, all ? " of all joints" : " of joint '",
                all ? std::string_view() : joint(k).name, all ? "" : "'", " must be > 0, got ",
                values[k]);
      }
    }
  }
  Index joint_count() const noexcept { return static_cast<Index>(joints_.size()); }
  /// The k-th joint of the task.
  decltype(auto) joint(Index k) const noexcept {
    return info(joints_[static_cast<std::size_t>(k)]);
  }
  Index column(Index k) const noexcept { return columns_[static_cast<std::size_t>(k)]; }
  Scalar position(Index k) const noexcept {
    return this->robot().position(joints_[static_cast<std::size_t>(k)]);
  }

 private:
  decltype(auto) info(Index i) const noexcept {
    return this->robot().joints()[static_cast<std::size_t>(i)];
  }
  // Before there is a task, so that the message has its name.
  [[gnu::cold]] static Index count(const R& robot, const std::string& name,
                                   const std::vector<std::string>& joints, bool one) {
    const auto indices = chosen(robot, name, joints);
    if (indices.size() == 0) invalid("task '", name, "': the robot has no joints");
    return one ? 1 : static_cast<Index>(indices.size());
  }
  [[gnu::cold]] static List<Index> chosen(const R& robot, const std::string& name,
                                          const std::vector<std::string>& joints) {
    auto indices = joint_indices(robot, joints, task_called(name));
    for (std::size_t i = 0; joints.empty() && i < robot.joints().size(); ++i) {
      indices.push_back(static_cast<Index>(i));
    }
    return indices;
  }

  List<Index> joints_, columns_;
};

}  // namespace detail

namespace task {

/// q_m ≤ q ≤ q_M for every joint [Coop, Eq. (10)], in the component form with the two activations
/// summed [Coop, III-C]. A joint without limits is never active.
template <JointedRobot R>
class JointLimits : public detail::JointTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "joint limits";  ///< in errors and logs
    /// By name; none: all.
    std::vector<std::string> joints = EmptyList{};
    /// β, rad or m. One for all is at most a quarter of each joint's range; one for each is taken
    /// as it is, and refused where there is no room.
    PerJoint<Scalar> margin = static_cast<Scalar>(0.1);
    /// x* is the middle of a joint's range, one point inside as in [Coop, III-C, Remark]; otherwise
    /// the near edge of the inactive range. The middle gives a larger rate, on a linear axis in
    /// proportion to its length.
    bool to_middle{false};
    Scalar gain{1};                                ///< γ, 1/s
    PerJoint<Scalar> max_rate = infinity<Scalar>;  ///< rad/s, m/s
  };

  /// Of all joints, with a margin of 0.1.
  /// @throws std::invalid_argument on settings out of range. Allocates.
  [[gnu::cold]] explicit JointLimits(const R& robot) : JointLimits(robot, Options{}) {}
  /// @throws std::invalid_argument on settings out of range, or joints that there are not.
  /// Allocates.
  [[gnu::cold]] JointLimits(const R& robot, Options options)
      : detail::JointTask<R>(robot, options.name, options.joints, false, options.gain),
        max_rate_(options.max_rate),
        to_middle_(options.to_middle),
        objectives_(static_cast<std::size_t>(this->joint_count())) {
    this->check("margin", options.margin);
    this->check("max_rate", options.max_rate);
    for (Index k = 0; k < this->joint_count(); ++k) {
      const auto& joint = this->joint(k);
      const Scalar margin =
          options.margin.for_all() ? widest(k, options.margin[k]) : options.margin[k];
      if (!std::isfinite(options.margin[k])) {
        detail::invalid("task '", this->name(), "': the margin of joint '", joint.name,
                        "' must be finite, got ", options.margin[k]);
      }
      if (!has_room(k, margin)) {
        detail::invalid("task '", this->name(), "': a margin of ", margin, " leaves joint '",
                        joint.name, "' no room in [", joint.lower, ", ", joint.upper, "]");
      }
      objectives_[static_cast<std::size_t>(k)] = objective(k, margin);
      this->jacobian_(k, this->column(k)) = Scalar(1);
    }
  }

  /// Another margin for all joints, rad or m, at most a quarter of each one's range; refused unless
  /// finite and > 0.
  Status set_margin(Scalar margin) noexcept {
    if (!(margin > Scalar(0)) || !std::isfinite(margin)) return Status::out_of_range;
    for (Index k = 0; k < this->rows(); ++k) {
      if (!has_room(k, widest(k, margin))) return Status::out_of_range;
    }
    for (Index k = 0; k < this->rows(); ++k) set_objective(k, widest(k, margin));
    return Status::ok;
  }
  /// Another margin for each joint of the task, rad or m, any Eigen vector. Refused if not finite,
  /// not > 0, of another size, or where it leaves a joint no room; then the old ones stay.
  template <class V>
  Status set_margin(const Eigen::MatrixBase<V>& margins) noexcept {
    if (margins.size() != this->rows()) return Status::wrong_size;
    for (Index k = 0; k < this->rows(); ++k) {
      if (!std::isfinite(margins(k))) return Status::non_finite;
      if (!(margins(k) > Scalar(0)) || !has_room(k, margins(k))) return Status::out_of_range;
    }
    for (Index k = 0; k < this->rows(); ++k) set_objective(k, margins(k));
    return Status::ok;
  }
  /// Another rate for all joints, rad/s or m/s; refused unless > 0.
  Status set_max_rate(Scalar rate) noexcept {
    if (!(rate > Scalar(0))) return Status::out_of_range;
    max_rate_.set_all(rate);
    return Status::ok;
  }

 private:
  // One margin for all is at most this.
  Scalar widest(Index k, Scalar margin) const noexcept {
    return std::min(margin, (this->joint(k).upper - this->joint(k).lower) / Scalar(4));
  }
  bool has_room(Index k, Scalar margin) const noexcept {
    return this->joint(k).lower + margin < this->joint(k).upper - margin;
  }
  // Throws nothing where there is room.
  Objective<Scalar> objective(Index k, Scalar margin) const {
    const auto& joint = this->joint(k);
    const auto inside = Objective<Scalar>::between(joint.lower, joint.upper, margin);
    const Scalar middle = (joint.lower + joint.upper) / Scalar(2);
    return to_middle_ && std::isfinite(middle) ? inside.toward(middle) : inside;
  }
  void set_objective(Index k, Scalar margin) noexcept {
    objectives_[static_cast<std::size_t>(k)] = objective(k, margin);
  }
  void compute() noexcept override {
    for (Index k = 0; k < this->rows(); ++k) {
      this->set_scalar(k, this->position(k), objectives_[static_cast<std::size_t>(k)],
                       max_rate_[k]);
    }
  }

  PerJoint<Scalar> max_rate_;
  bool to_middle_;
  List<Objective<Scalar>> objectives_;
};

/// Joints to positions q*, such as an arm's preferred shape [Coop, II-D2], [MARIS, III-B7]:
/// component by component to zero, or an objective on ‖q − q*‖ where `norm` is given (Coop,
/// Remark 1).
template <JointedRobot R>
class JointPosition : public detail::JointTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// q*, one entry for each joint of the task.
  using Positions = Vector<Scalar, Eigen::Dynamic>;
  /// Settings, with defaults.
  struct Options {
    std::string name = "joint position";  ///< in errors and logs
    /// By name; none: all.
    std::vector<std::string> joints = EmptyList{};
    /// Given: the norm form with this objective. Not given: the component form.
    std::optional<Objective<Scalar>> norm = std::nullopt;
    Scalar gain{1};  ///< γ, 1/s
    /// Of each joint, rad/s or m/s; on the way all are slowed alike. In the norm form the smallest
    /// limits the rate of the norm.
    PerJoint<Scalar> max_rate = infinity<Scalar>;
  };

  /// `goal`: rad or m.
  /// @throws std::invalid_argument on settings out of range, or joints that there are not.
  /// Allocates.
  [[gnu::cold]] JointPosition(const R& robot, const Positions& goal)
      : JointPosition(robot, goal, Options{}) {}
  /// The same with options.
  [[gnu::cold]] JointPosition(const R& robot, const Positions& goal, Options options)
      : detail::JointTask<R>(robot, options.name, options.joints, options.norm.has_value(),
                             options.gain),
        norm_(options.norm),
        max_rate_(options.max_rate),
        goal_(goal),
        velocity_(detail::zeros<Positions>(this->joint_count())),
        error_(velocity_),
        ways_(static_cast<std::size_t>(this->joint_count())) {
    this->check("max_rate", options.max_rate);
    if (goal.size() != this->joint_count()) {
      detail::invalid("task '", this->name(), "': a goal of ", goal.size(), " numbers for ",
                      this->joint_count(), " joints");
    }
    this->require_finite("goal", goal);
    for (Index k = 0; !norm_ && k < this->rows(); ++k) {
      this->jacobian_(k, this->column(k)) = Scalar(1);
    }
  }

  /// q*.
  const Positions& goal() const noexcept { return goal_; }
  /// Another q*, at rest; refused if not finite or of another size. `goal` may be any Eigen vector.
  template <class Q>
  Status set_goal(const Eigen::MatrixBase<Q>& goal) noexcept {
    const Status status = take(goal, goal_);
    if (status == Status::ok) detail::fill(velocity_, Scalar(0));
    return status;
  }
  /// Another q* that moves with `velocity`, rad/s or m/s.
  template <class Q, class V>
  Status set_goal(const Eigen::MatrixBase<Q>& goal, const Eigen::MatrixBase<V>& velocity) noexcept {
    if (goal.size() != this->joint_count()) return Status::wrong_size;
    for (Index k = 0; k < goal.size(); ++k) {
      if (!std::isfinite(goal(k))) return Status::non_finite;
    }
    const Status status = take(velocity, velocity_);
    return status == Status::ok ? take(goal, goal_) : status;
  }
  /// Another objective of the norm form; refused in the component form.
  Status set_objective(const Objective<Scalar>& norm) noexcept {
    if (!norm_) return Status::wrong_size;
    norm_ = norm;
    return Status::ok;
  }
  /// Another rate for all joints, rad/s or m/s; refused unless > 0.
  Status set_max_rate(Scalar rate) noexcept {
    if (!(rate > Scalar(0))) return Status::out_of_range;
    max_rate_.set_all(rate);
    return Status::ok;
  }

 private:
  template <class Q>
  Status take(const Eigen::MatrixBase<Q>& from, Positions& to) noexcept {
    if (from.size() != to.size()) return Status::wrong_size;
    for (Index k = 0; k < to.size(); ++k) {
      if (!std::isfinite(from(k))) return Status::non_finite;
    }
    for (Index k = 0; k < to.size(); ++k) to(k) = from(k);
    return Status::ok;
  }

  void compute() noexcept override {
    Scalar square(0), slowest(infinity<Scalar>), scale(1), fade(1);
    for (Index k = 0; k < this->joint_count(); ++k) {
      Scalar e = goal_(k) - this->position(k);
      if (this->joint(k).continuous) {
        auto& way = ways_[static_cast<std::size_t>(k)];
        e = way.update(e);
        // The norm itself must not fade: it would look like the goal.
        (norm_ ? fade : e) *= way.weight();
      }
      error_(k) = e;
      square += e * e;
      const Scalar limit = max_rate_[k], rate = this->gain() * std::abs(e);
      slowest = std::min(slowest, limit);
      if (rate * scale > limit) scale = limit / rate;
    }
    if (!norm_) {
      for (Index k = 0; k < this->rows(); ++k) {
        this->reference_(k) = scale * this->gain() * error_(k) + velocity_(k);
      }
      return;
    }
    const Scalar distance = std::sqrt(square);
    Scalar forward(0);
    for (Index k = 0; k < this->joint_count(); ++k) {
      // At distance 0 the mean of both sides of the kink.
      const Scalar d = distance > Scalar(0) ? -error_(k) / distance : Scalar(0);
      this->jacobian_(0, this->column(k)) = d;
      forward += d * velocity_(k);
    }
    this->set_scalar(0, distance, *norm_, slowest, fade);
    this->reference_(0) += forward;
  }

  std::optional<Objective<Scalar>> norm_;
  PerJoint<Scalar> max_rate_;
  Positions goal_, velocity_, error_;
  List<detail::AngleWay<Scalar>> ways_;  // of the continuous joints
};

}  // namespace task
}  // namespace icat
