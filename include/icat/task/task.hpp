// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A task: reads its robot, yields Jacobian, reference rate and activation of its rows.
///
///     ẋ = J ẏ,   ẋ̄ = γ (x* − x),   a = aⁱ(x)          [Coop, Eq. (6)–(9), (17), (18)]
///
/// The phase activation aᵖ of Eq. (17) is not the task's: the actions it stands in supply it. A
/// task is reactive [MARIS, III-B] if its reference follows from the robot's state, non-reactive if
/// the caller sets it.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "icat/core/list.hpp"
#include "icat/core/status.hpp"
#include "icat/math/spatial_algebra.hpp"
#include "icat/model/characteristic_length.hpp"
#include "icat/model/robot.hpp"
#include "icat/task/objective.hpp"

namespace icat {

/// The remaining error of a task; NaN if it has no such error.
template <class Scalar>
struct Remaining {
  Scalar position{std::numeric_limits<Scalar>::quiet_NaN()};  ///< m
  Scalar angle{std::numeric_limits<Scalar>::quiet_NaN()};     ///< rad, the short way: at most π
};

/// Base of all tasks. Construction allocates and throws; nothing else does. A task belongs to the
/// robot it was built for, which must outlive it and stay where it is. It is an object with an
/// identity: one may stand in many actions, so it cannot be copied.
template <Robot R>
class Task {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// rows × dof.
  using Jacobian = JacobianMatrix<Scalar, R::size>;
  /// One component for each row.
  using Rows = Vector<Scalar, Eigen::Dynamic>;

  virtual ~Task() = default;
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;

  /// What errors and logs call it.
  const std::string& name() const noexcept { return name_; }
  /// The robot it belongs to.
  const R& robot() const noexcept { return robot_; }
  /// Number of rows.
  Index rows() const noexcept { return rows_; }

  /// Reads the robot's present state.
  void update() noexcept { compute(); }

  /// J, rows × dof.
  const Jacobian& jacobian() const noexcept { return jacobian_; }
  /// ẋ̄, rows.
  const Rows& reference() const noexcept { return reference_; }
  /// aⁱ, rows, in [0, 1].
  const Rows& activation() const noexcept { return activation_; }
  /// The power of the metre in the unit of row `row`: 1 for a distance, 0 for an angle or a column
  /// of ẏ. Controllers divide rows by that power of the characteristic length when they solve.
  Index length_power(Index row) const noexcept {
    return length_powers_[static_cast<std::size_t>(row)];
  }
  /// What the rows are divided by is this share of the characteristic length: 1, but for the centre
  /// of mass, which moves less than a tool does.
  Scalar length_share() const noexcept { return length_share_; }
  /// The largest of the frames that its rows in metres are of, m; 0: none.
  Scalar characteristic_length() const noexcept { return characteristic_length_; }

  /// The remaining error at the last update, for explanations and logs; by default NaN.
  virtual Remaining<Scalar> remaining() const noexcept { return {}; }

 protected:
  /// Rows are active, all else 0.
  /// @throws std::invalid_argument on less than one row.
  [[gnu::cold]] Task(const R& robot, std::string name, Index rows)
      : robot_(robot), name_(std::move(name)), rows_(rows) {
    if (rows < 1) detail::invalid("task '", name_, "': needs a row at least, got ", rows);
    jacobian_ = detail::zeros<Jacobian>(rows, robot.dof());
    reference_ = detail::zeros<Rows>(rows);
    activation_ = detail::zeros<Rows>(rows);
    detail::fill(activation_, Scalar(1));
    length_powers_ = List<Index>(static_cast<std::size_t>(rows));
  }
  /// Of the `count` rows from `first` on; 0 unless said otherwise. For constructors.
  [[gnu::cold]] void set_length_power(Index first, Index count, Index power) {
    for (Index i = 0; i < count; ++i) length_powers_[static_cast<std::size_t>(first + i)] = power;
  }
  /// For constructors; > 0.
  [[gnu::cold]] void set_length_share(Scalar share) { length_share_ = share; }
  /// `frame` is one that rows in metres are of. For constructors.
  [[gnu::cold]] void measure_reach(FrameId frame) requires FramedRobot<R> {
    characteristic_length_ =
        std::max(characteristic_length_, icat::characteristic_length(robot_, frame));
  }

  /// Fills `jacobian_`, `reference_` and `activation_`; what is not filled keeps its value.
  virtual void compute() noexcept = 0;

  /// @throws std::invalid_argument with this task's name unless `value` > 0; infinity is fine.
  void require_rate(const char* what, Scalar value) const {
    if (!(value > Scalar(0))) {
      detail::invalid("task '", name_, "': ", what, " must be > 0, got ", value);
    }
  }
  /// @throws std::invalid_argument with this task's name unless all is finite.
  template <class M>
  void require_finite(const char* what, const M& values) const {
    if (!detail::all_finite(values)) {
      detail::invalid("task '", name_, "': the ", what, " is not finite");
    }
  }
  /// @throws std::invalid_argument with this task's name where `frame` is another robot's, see
  ///         `FrameId`.
  void require_frame(FrameId frame) const requires FramedRobot<R> {
    detail::check_frame(robot_, frame, name_);
  }
  /// No row counts: there is no direction to move in.
  void deactivate() noexcept {
    detail::fill(jacobian_, Scalar(0));
    detail::fill(reference_, Scalar(0));
    detail::fill(activation_, Scalar(0));
  }

  /// J, rows × dof.
  Jacobian jacobian_;
  /// ẋ̄, rows.
  Rows reference_;
  /// aⁱ, rows.
  Rows activation_;

 private:
  const R& robot_;
  std::string name_;
  Index rows_;
  List<Index> length_powers_;
  Scalar characteristic_length_{0};
  Scalar length_share_{1};
};

/// A task with a gain γ.
template <Robot R>
class ReactiveTask : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;

  /// γ, 1/s.
  Scalar gain() const noexcept { return gain_; }
  /// Another γ, 1/s; refused unless finite and > 0.
  Status set_gain(Scalar gain) noexcept {
    if (!(gain > Scalar(0)) || !std::isfinite(gain)) return Status::out_of_range;
    gain_ = gain;
    return Status::ok;
  }

 protected:
  /// @throws std::invalid_argument unless γ is finite and > 0, or on less than one row.
  [[gnu::cold]] ReactiveTask(const R& robot, std::string name, Index rows, Scalar gain)
      : Task<R>(robot, std::move(name), rows), gain_(gain) {
    if (!(gain > Scalar(0)) || !std::isfinite(gain)) {
      detail::invalid("task '", this->name(), "': gain must be finite and > 0, got ", gain);
    }
  }

  /// Row `i` controls the scalar x, whose Jacobian the caller writes. `fade` in [0, 1] is a factor
  /// of its activation.
  [[gnu::noinline]] void set_scalar(Index i, Scalar x, const Objective<Scalar>& objective,
                                    Scalar max_rate, Scalar fade = Scalar(1)) noexcept {
    this->reference_(i) = std::clamp(gain_ * (objective.target(x) - x), -max_rate, max_rate);
    this->activation_(i) = fade * objective.activation(x);
  }

 private:
  Scalar gain_;
};

/// A reactive task of one scalar x with one objective.
template <Robot R>
class ScalarTask : public ReactiveTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;

  /// x of the last update.
  Scalar value() const noexcept { return value_; }
  /// The objective on x.
  const Objective<Scalar>& objective() const noexcept { return objective_; }
  /// Another objective. Its construction throws on bad numbers, so build it outside the loop.
  void set_objective(const Objective<Scalar>& objective) noexcept { objective_ = objective; }
  /// Another limit of |ẋ̄|; refused unless > 0.
  Status set_max_rate(Scalar rate) noexcept {
    if (!(rate > Scalar(0))) return Status::out_of_range;
    max_rate_ = rate;
    return Status::ok;
  }

 protected:
  /// @throws std::invalid_argument unless γ is finite and > 0 and `max_rate` > 0.
  [[gnu::cold]] ScalarTask(const R& robot, std::string name, const Objective<Scalar>& objective,
                           Scalar gain, Scalar max_rate)
      : ReactiveTask<R>(robot, std::move(name), 1, gain),
        objective_(objective),
        max_rate_(max_rate) {
    this->require_rate("max_rate", max_rate);
  }
  /// The reference and activation for `x`; the Jacobian is the caller's.
  void set_value(Scalar x, Scalar fade = Scalar(1)) noexcept {
    value_ = x;
    this->set_scalar(0, x, objective_, max_rate_, fade);
  }

 private:
  Objective<Scalar> objective_;
  Scalar max_rate_, value_{0};
};

}  // namespace icat
