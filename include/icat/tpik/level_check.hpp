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
  for (Index i = 0; i < level.rows; ++i) {
    const auto a = activation(i);
    if (!std::isfinite(a) || !std::isfinite(reference(i)) || !jacobian.row(i).allFinite()) {
      level.status = Status::non_finite;
    } else if (a < 0 || a > 1) {
      level.status = Status::activation_out_of_range;
    }
    if (level.status != Status::ok) {
      level.bad_row = i;
      return level;
    }
    if (a > 0) ++level.active_rows;
  }
  return level;
}

}  // namespace icat::detail
