// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A task of one's own from a lambda.
#pragma once

#include <functional>
#include <limits>

#include "icat/task/task.hpp"

namespace icat::task {

/// One or more scalars x(c) with their Jacobian, and one objective for all of them.
template <Robot R>
class FunctionTask : public Task<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  using typename Task<R>::Jacobian;
  using typename Task<R>::Rows;
  /// Fills x (rows) and J (rows × dof; zero at the first call, then as it was left). Called in the
  /// control step: must not throw, should not allocate. If it resizes either, the level is refused.
  using Function = std::function<void(const R& robot, Rows& x, Jacobian& J)>;
  /// Settings, with defaults.
  struct Options {
    /// What errors and logs call it.
    std::string name;
    /// Number of rows.
    Index rows{1};
    /// Fills x and J.
    Function evaluate;
    /// Of every row.
    Objective<Scalar> objective;
    /// γ, 1/s, > 0.
    Scalar gain{1};
    Scalar max_rate{std::numeric_limits<Scalar>::infinity()};  ///< of each row
  };

  /// @throws std::invalid_argument on settings out of range. Allocates.
  FunctionTask(const R& robot, Options options)
      : Task<R>(options.name, options.rows, robot.dof()),
        options_(options),
        x_(Rows::Zero(options.rows)) {
    this->require_gain(options.gain);
    this->require_rate("max_rate", options.max_rate);
    if (!options.evaluate) detail::invalid("task '", options.name, "': evaluate is empty");
  }

 private:
  void compute(const R& robot) noexcept override {
    options_.evaluate(robot, x_, this->jacobian_);
    if (x_.size() != this->rows()) {  // The lambda resized it: the solver is to refuse the level.
      this->reference_.setConstant(std::numeric_limits<Scalar>::quiet_NaN());
      return;
    }
    for (Index i = 0; i < this->rows(); ++i) {
      this->set_scalar(i, x_(i), options_.objective, options_.gain, options_.max_rate);
    }
  }

  Options options_;
  Rows x_;
};

}  // namespace icat::task
