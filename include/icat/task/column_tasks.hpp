// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Velocities of columns of ẏ themselves: kept at zero, or given.
#pragma once

#include "icat/task/task.hpp"

namespace icat {
namespace detail {

/// Rows that select columns.
template <Robot R>
class ColumnTask : public Task<R> {
 protected:
  [[gnu::cold]] ColumnTask(const R& robot, const Columns& columns, const std::string& name)
      : Task<R>(robot, name, checked(robot, columns, name)) {
    for (Index k = 0; k < columns.size(); ++k) {
      this->jacobian_(k, columns[k]) = typename R::Scalar(1);
    }
  }

 private:
  [[gnu::cold]] static Index checked(const R& robot, const Columns& columns,
                                     const std::string& name) {
    check_columns(task_called(name), columns, robot.dof());
    return columns.size();
  }
  void compute() noexcept override {}
};

}  // namespace detail

namespace task {

/// ẏ_j = 0 for some columns: motion minimality of an arm, so that the vehicle moves, or of a
/// vehicle, so that the arm moves [Coop, III-D]. It belongs at the lowest priority.
/// `Minimality(robot, robot.base_columns())`, `Minimality(robot, joint_columns(robot))`.
template <Robot R>
class Minimality : public detail::ColumnTask<R> {
 public:
  /// @throws std::invalid_argument on no columns, or such that there are not. Allocates.
  [[gnu::cold]] Minimality(const R& robot, const Columns& columns,
                           const std::string& name = "minimality")
      : detail::ColumnTask<R>(robot, columns, name) {}
};

/// Measured velocities of columns that are not commanded [MARIS, III-B8]. It belongs at the highest
/// priority; an alternative to the controller's `given`.
template <Robot R>
class GivenVelocity : public detail::ColumnTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Starts with velocity 0.
  /// @throws std::invalid_argument on no columns, or such that there are not. Allocates.
  [[gnu::cold]] GivenVelocity(const R& robot, const Columns& columns,
                              const std::string& name = "given velocity")
      : detail::ColumnTask<R>(robot, columns, name) {}
  /// As measured, one for each column, m/s, rad/s; refused if not finite or of another number, the
  /// old one stays. `velocity` may be any Eigen vector.
  template <class V>
  Status set_velocity(const Eigen::MatrixBase<V>& velocity) noexcept {
    if (velocity.size() != this->rows()) return Status::wrong_size;
    for (Index k = 0; k < this->rows(); ++k) {
      if (!std::isfinite(velocity(k))) return Status::non_finite;
    }
    for (Index k = 0; k < this->rows(); ++k) this->reference_(k) = velocity(k);
    return Status::ok;
  }
};

}  // namespace task
}  // namespace icat
