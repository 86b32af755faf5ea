// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The input checks of a priority level, shared by the solvers.
#pragma once

#include <cmath>

#include "icat/tpik/report.hpp"

namespace icat::detail {

/// Compile-time sizes that cannot match do not compile.
template <class J, class A, class R>
constexpr void assert_level_sizes() {
  constexpr int rows = J::RowsAtCompileTime;
  static_assert(A::ColsAtCompileTime == 1 || A::ColsAtCompileTime == Eigen::Dynamic,
                "the activation is a column vector");
  static_assert(R::ColsAtCompileTime == 1 || R::ColsAtCompileTime == Eigen::Dynamic,
                "the reference is a column vector");
  static_assert(rows == Eigen::Dynamic || A::RowsAtCompileTime == Eigen::Dynamic ||
                    rows == A::RowsAtCompileTime,
                "one activation for each row of the Jacobian");
  static_assert(rows == Eigen::Dynamic || R::RowsAtCompileTime == Eigen::Dynamic ||
                    rows == R::RowsAtCompileTime,
                "one reference for each row of the Jacobian");
}

/// Fills rows, active rows, status and bad row. Rows that are inactive are checked too.
template <class J, class A, class R>
LevelReport<typename J::Scalar> check_level(const J& jacobian, const A& activation,
                                            const R& reference, Index columns) noexcept {
  LevelReport<typename J::Scalar> level;
  level.rows = jacobian.rows();
  if (jacobian.cols() != columns || activation.cols() != 1 || reference.cols() != 1 ||
      activation.rows() != level.rows || reference.rows() != level.rows) {
    level.status = Status::wrong_size;
    return level;
  }
  // Zero but for infinities and NaN, which stay; Eigen's allFinite is not vectorized.
  using Scalar = typename J::Scalar;
  bool good = (jacobian * Scalar(0)).sum() == Scalar(0);
  for (Index i = 0; i < level.rows; ++i) {
    const Scalar a = activation(i);
    good &= a >= Scalar(0) && a <= Scalar(1) && reference(i) * Scalar(0) == Scalar(0);
    if (a > Scalar(0)) ++level.active_rows;
  }
  if (good) return level;
  for (Index i = 0; i < level.rows && level.bad_row < 0; ++i) {
    const Scalar a = activation(i);
    const bool finite =
        std::isfinite(a) && std::isfinite(reference(i)) && jacobian.row(i).allFinite();
    if (finite && a >= Scalar(0) && a <= Scalar(1)) continue;
    level.status = finite ? Status::activation_out_of_range : Status::non_finite;
    level.bad_row = i;
  }
  return level;
}

/// Sums what the report says of a level; `finish` makes norms of it.
template <class Scalar>
struct RateNorms {
  Scalar requested{0}, achieved{0}, error{0};
  void add(Scalar x, Scalar y) noexcept {
    requested += x * x;
    achieved += y * y;
    error += (x - y) * (x - y);
  }
  void finish(LevelReport<Scalar>& level) const noexcept {
    level.requested_rate = std::sqrt(requested);
    level.achieved_rate = std::sqrt(achieved);
    level.tracking_error = std::sqrt(error);
  }
};

}  // namespace icat::detail
