// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Central differences, for checking a Jacobian of one's own. Not for the control loop.
///
///     ∂f/∂x_i ≈ (f(x + h e_i) − f(x − h e_i)) / 2h,    error O(h²) + O(ε/h)
#pragma once

#include <cmath>
#include <limits>

#include "icat/core/types.hpp"

namespace icat {

/// Jacobian (m × n) of `f`: ℝⁿ → ℝᵐ at `x`. The default step balances truncation and rounding. For
/// a state on a manifold, let `f` take the displacement and differentiate at 0. Allocates.
template <class F, class Derived>
auto central_difference(F&& f, const Eigen::MatrixBase<Derived>& x,
                        typename Derived::Scalar h =
                            std::cbrt(std::numeric_limits<typename Derived::Scalar>::epsilon())) {
  using Scalar = typename Derived::Scalar;
  using Column = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;
  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> jacobian;
  typename Derived::PlainObject at = x;
  for (Index i = 0; i < x.size(); ++i) {
    at(i) = x(i) + h;
    const Column plus = f(at);
    at(i) = x(i) - h;
    const Column minus = f(at);
    at(i) = x(i);
    if (i == 0) jacobian.resize(plus.size(), x.size());
    jacobian.col(i) = (plus - minus) / (Scalar(2) * h);
  }
  return jacobian;
}

}  // namespace icat
