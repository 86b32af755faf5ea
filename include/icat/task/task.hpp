// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A task: reads the robot, yields Jacobian, reference rate and activation of its rows.
///
///     ẋ = J ẏ,   ẋ̄ = γ (x* − x),   a = aⁱ(x)          [Coop, Eq. (6)–(9), (17), (18)]
///
/// The phase activation aᵖ of Eq. (17) is not the task's: the actions it stands in supply it.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "icat/model/robot.hpp"
#include "icat/task/objective.hpp"

namespace icat {

/// Base of all tasks. Construction allocates and throws; `update` does neither. A task is an object
/// with an identity: one may stand in many actions, so it cannot be copied.
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
  /// Number of rows.
  Index rows() const noexcept { return rows_; }

  /// Reads the robot's present state.
  void update(const R& robot) noexcept { compute(robot); }

  /// J, rows × dof.
  const Jacobian& jacobian() const noexcept { return jacobian_; }
  /// ẋ̄, rows.
  const Rows& reference() const noexcept { return reference_; }
  /// aⁱ, rows, in [0, 1].
  const Rows& activation() const noexcept { return activation_; }

 protected:
  /// Rows are active, all else 0.
  Task(std::string name, Index rows, Index dof)
      : jacobian_(detail::zeros<Jacobian>(rows, dof)),
        reference_(detail::zeros<Rows>(rows)),
        activation_(reference_),
        name_(std::move(name)),
        rows_(rows) {
    detail::fill(activation_, Scalar(1));
  }

  /// Fills `jacobian_`, `reference_` and `activation_`; what is not filled keeps its value.
  virtual void compute(const R& robot) noexcept = 0;

  /// Throws with this task's name unless γ > 0 and the rate limit > 0 (infinity: none).
  void require_gain(Scalar gain) const { require_above_zero("gain", gain); }
  /// @throws std::invalid_argument with this task's name unless `rate` > 0; infinity is fine.
  void require_rate(const char* what, Scalar rate) const {
    if (!(rate > Scalar(0))) {
      detail::invalid("task '", name_, "': ", what, " must be > 0, got ", rate);
    }
  }
  /// @throws std::invalid_argument with this task's name unless `value` is finite and > 0.
  void require_above_zero(const char* what, Scalar value) const {
    if (!(value > Scalar(0)) || !std::isfinite(value)) {
      detail::invalid("task '", name_, "': ", what, " must be > 0, got ", value);
    }
  }

  /// Row `i` controls the scalar x, whose Jacobian the caller writes.
  void set_scalar(Index i, Scalar x, const Objective<Scalar>& objective, Scalar gain,
                  Scalar max_rate) noexcept {
    reference_(i) = std::clamp(gain * (objective.target() - x), -max_rate, max_rate);
    activation_(i) = objective.activation(x);
  }
  /// Rows `i`… drive `error` to zero component by component along a straight line: the rate is
  /// limited as a whole.
  template <class Error>
  void set_error(Index i, const Error& error, Scalar gain, Scalar max_rate) noexcept {
    Scalar square(0);
    for (Index k = 0; k < error.size(); ++k) square += error(k) * error(k);
    const Scalar rate = gain * std::sqrt(square);
    const Scalar scale = rate > max_rate ? max_rate / rate : Scalar(1);
    for (Index k = 0; k < error.size(); ++k) reference_(i + k) = (scale * gain) * error(k);
  }

  /// Row k of `jacobian_` ← eₖ of column `column` + k, for all rows: x is what those columns move.
  void select_columns(Index column) noexcept {
    for (Index k = 0; k < rows_; ++k) jacobian_(k, column + k) = Scalar(1);
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
  std::string name_;
  Index rows_;
};

}  // namespace icat
