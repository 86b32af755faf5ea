// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A task of one's own from a lambda.
#pragma once

#include <functional>
#include <type_traits>

#include "icat/task/task.hpp"

namespace icat::task {

/// One or more scalars x(c) with their Jacobian, and one objective for all of them.
template <Robot R>
class FunctionTask : public ReactiveTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// x, rows: a block of fixed size.
  using Values = Eigen::Map<Vector<Scalar, Eigen::Dynamic>>;
  /// J, rows × dof: a block of fixed size; zero at the first call, then as it was left.
  using Block = Eigen::Map<JacobianMatrix<Scalar, R::size>>;
  /// Fills x and J. Called in the control step: must not throw, should not allocate.
  using Function = std::function<void(const R& robot, Values x, Block J)>;
  /// Settings, with defaults.
  struct Options {
    std::string name = "function";      ///< in errors and logs
    Index rows{1};                      ///< number of scalars
    Scalar gain{1};                     ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};  ///< of each row
    Index length_power{0};              ///< of the metre in x: 1 for a distance, 0 for an angle
  };

  /// @throws std::invalid_argument on settings out of range or an empty function. Allocates.
  [[gnu::cold]] FunctionTask(const R& robot, const Objective<Scalar>& objective,
                             std::type_identity_t<Function> function)
      : FunctionTask(robot, objective, std::move(function), Options{}) {}
  /// The same with options.
  [[gnu::cold]] FunctionTask(const R& robot, const Objective<Scalar>& objective,
                             std::type_identity_t<Function> function, Options options)
      : ReactiveTask<R>(robot, options.name, options.rows, options.gain),
        objective_(objective),
        function_(std::move(function)),
        max_rate_(options.max_rate),
        x_(detail::zeros<Vector<Scalar, Eigen::Dynamic>>(options.rows)) {
    this->set_length_power(0, options.rows, options.length_power);
    this->require_rate("max_rate", options.max_rate);
    if (!function_) detail::invalid("task '", options.name, "': the function is empty");
  }
  /// Another objective. Its construction throws on bad numbers, so build it outside the loop.
  void set_objective(const Objective<Scalar>& objective) noexcept { objective_ = objective; }
  /// Another limit of the rate of each row; refused unless > 0.
  Status set_max_rate(Scalar rate) noexcept {
    if (!(rate > Scalar(0))) return Status::out_of_range;
    max_rate_ = rate;
    return Status::ok;
  }
  /// x of the last update.
  const Vector<Scalar, Eigen::Dynamic>& values() const noexcept { return x_; }

 private:
  void compute() noexcept override {
    auto& J = this->jacobian_;
    function_(this->robot(), Values(x_.data(), x_.size()), Block(J.data(), J.rows(), J.cols()));
    for (Index i = 0; i < this->rows(); ++i) this->set_scalar(i, x_(i), objective_, max_rate_);
  }

  Objective<Scalar> objective_;
  Function function_;
  Scalar max_rate_;
  Vector<Scalar, Eigen::Dynamic> x_;
};

}  // namespace icat::task
