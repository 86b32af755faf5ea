// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Matrix products as loops over contiguous columns.
///
/// At the sizes of robots (4 to 64) they are as fast as Eigen's blocked product, never allocate for
/// run-time sizes, and compile in a tenth of the time.
#pragma once

#include "icat/core/types.hpp"

namespace icat::detail {

/// `c = a b`. `c` must not overlap `a` or `b`.
template <class A, class B, class C>
void multiply(const A& a, const B& b, C&& c) noexcept {
  for (Index j = 0; j < b.cols(); ++j) {
    auto out = c.col(j);
    out = a.col(0) * b(0, j);
    for (Index k = 1; k < a.cols(); ++k) out += a.col(k) * b(k, j);
  }
}

/// `c = aᵀ b`. `c` must not overlap `a` or `b`.
template <class A, class B, class C>
void multiply_transposed(const A& a, const B& b, C&& c) noexcept {
  for (Index j = 0; j < b.cols(); ++j) {
    for (Index i = 0; i < a.cols(); ++i) c(i, j) = a.col(i).dot(b.col(j));
  }
}

/// `c += w a aᵀ`, both triangles.
template <class A, class C, class Scalar>
void add_outer_square(const A& a, Scalar w, C&& c) noexcept {
  for (Index j = 0; j < c.cols(); ++j) {
    for (Index k = 0; k < a.cols(); ++k) c.col(j) += (w * a(j, k)) * a.col(k);
  }
}

}  // namespace icat::detail
