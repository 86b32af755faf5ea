// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A priority level as the solvers read it, and the checks of that input.
///
/// The solvers accept any Eigen type, but one body of code works on all of them: what has an
/// address is read by address and strides, a constant such as `Ones(m)` coefficient by coefficient.
/// Any other expression is evaluated first, which allocates if its size is known at run time only.
#pragma once

#include <cmath>
#include <span>
#include <type_traits>

#include "icat/math/panel.hpp"
#include "icat/tpik/report.hpp"

namespace icat {

/// A speed above that of any robot, in m/s or rad/s: a level, or a given velocity, that would take
/// a component of ẏ beyond it is refused (`implausible`). The bell amplifies a rate by 50 at most,
/// so that valid rates stay far below it; a Jacobian or a measurement with 1e200 does not.
inline constexpr double implausible_speed = 1e6;

}  // namespace icat

namespace icat::detail {

/// `ok`, `numerical_failure` (not finite) or `implausible`.
template <class Scalar>
[[gnu::noinline]] Status check_speeds(Index n, const Scalar* velocity) noexcept {
  if (!all_finite(n, velocity)) return Status::numerical_failure;
  for (Index i = 0; i < n; ++i) {
    if (std::abs(velocity[i]) > Scalar(implausible_speed)) return Status::implausible;
  }
  return Status::ok;
}

template <class T>
inline constexpr bool is_constant = false;
template <class Op, class Plain>
inline constexpr bool is_constant<Eigen::CwiseNullaryOp<Op, Plain>> = true;

/// What `Input` reads of an argument of type `T`: itself, or its value.
template <class T>
using Readable = std::conditional_t<(T::Flags & Eigen::DirectAccessBit) != 0 || is_constant<T>,
                                    const T&, const typename T::PlainObject>;

/// Sum of x_j y_j over `size`, or N if that is known at compile time; x is `step` apart.
template <int N, class Scalar>
inline Scalar strided_dot(Index size, const Scalar* x, Index step, const Scalar* y) noexcept {
  const Index n = N == Eigen::Dynamic ? size : N;
  // Four chains of additions that need not wait for each other.
  Scalar s0(0), s1(0), s2(0), s3(0);
  Index j = 0;
  for (; j + 4 <= n; j += 4, x += 4 * step) {
    s0 += x[0] * y[j];
    s1 += x[step] * y[j + 1];
    s2 += x[2 * step] * y[j + 2];
    s3 += x[3 * step] * y[j + 3];
  }
  for (; j < n; ++j, x += step) s0 += x[0] * y[j];
  return (s0 + s1) + (s2 + s3);
}

/// A matrix or vector of a type that is its own `Readable`. It must outlive this; nothing is
/// copied.
template <class Scalar>
class Input {
 public:
  template <class Derived>
  Input(const Eigen::MatrixBase<Derived>& x) noexcept  // NOLINT: converts on purpose
      : rows(x.rows()), cols(x.cols()) {
    static_assert(std::is_same_v<typename Derived::Scalar, Scalar>,
                  "Jacobian, activation and reference have the scalar type of the solver");
    if constexpr ((Derived::Flags & Eigen::DirectAccessBit) != 0) {
      data_ = x.derived().data();
      row_step_ = Derived::IsRowMajor ? x.derived().outerStride() : x.derived().innerStride();
      column_step_ = Derived::IsRowMajor ? x.derived().innerStride() : x.derived().outerStride();
    } else {
      expression_ = &x.derived();
      coefficient_ = [](const void* e, Index i, Index j) {
        return static_cast<const Derived*>(e)->coeff(i, j);
      };
    }
  }

  Scalar operator()(Index i, Index j = 0) const noexcept {
    return data_ ? data_[i * row_step_ + j * column_step_] : coefficient_(expression_, i, j);
  }

  /// Row `i`, of which the first `n` elements meet `y`; `N` where n is known at compile time.
  template <int N>
  Scalar row_dot(Index i, Index size, const Scalar* y) const noexcept {
    if (data_) return strided_dot<N>(size, data_ + i * row_step_, column_step_, y);
    const Index n = N == Eigen::Dynamic ? size : N;
    Scalar sum(0);
    for (Index j = 0; j < n; ++j) sum += (*this)(i, j) * y[j];
    return sum;
  }
  /// The same for the four rows from `i` on.
  template <int N>
  void rows_dot(Index i, Index size, const Scalar* y, Scalar* out) const noexcept {
    if (!data_ || row_step_ != 1) {
      for (Index k = 0; k < 4; ++k) out[k] = row_dot<N>(i + k, size, y);
      return;
    }
    const Index n = N == Eigen::Dynamic ? size : N;
    Scalar sum[4]{};
    const Scalar* x = data_ + i;
    for (Index j = 0; j < n; ++j, x += column_step_) {
      for (int k = 0; k < 4; ++k) sum[k] += x[k] * y[j];
    }
    std::copy_n(sum, 4, out);
  }
  /// Copies the first `n` elements of row `i`.
  template <int N>
  void copy_row(Index i, Index size, Scalar* out) const noexcept {
    const Index n = N == Eigen::Dynamic ? size : N;
    if (!data_) {
      for (Index j = 0; j < n; ++j) out[j] = (*this)(i, j);
      return;
    }
    const Scalar* x = data_ + i * row_step_;
    const Index step = column_step_;
    Index j = 0;
    for (; j + 4 <= n; j += 4, x += 4 * step) {
      out[j] = x[0];
      out[j + 1] = x[step];
      out[j + 2] = x[2 * step];
      out[j + 3] = x[3 * step];
    }
    for (; j < n; ++j, x += step) out[j] = *x;
  }

  /// No NaN, no infinity.
  bool finite() const noexcept {
    if (data_ && row_step_ == 1 && column_step_ == rows) return all_finite(rows * cols, data_);
    Scalar sum(0);  // zero but for infinities and NaN, which stay
    for (Index j = 0; j < cols; ++j) {
      for (Index i = 0; i < rows; ++i) sum += (*this)(i, j) * Scalar(0);
    }
    return sum == Scalar(0);
  }

  const Index rows, cols;

 private:
  const Scalar* data_{nullptr};
  Index row_step_{0}, column_step_{0};
  const void* expression_{nullptr};
  Scalar (*coefficient_)(const void*, Index, Index){nullptr};
};

/// J, a and ẋ̄ of a level, and what its rows are multiplied with; none: 1.
template <class Scalar>
struct LevelInput {
  Input<Scalar> jacobian, activation, reference;
  std::span<const Scalar> row_scale;

  Scalar scale(Index i) const noexcept {
    return row_scale.empty() ? Scalar(1) : row_scale[static_cast<std::size_t>(i)];
  }
};

/// Compile-time sizes that cannot match do not compile.
template <class Scalar, class J, class A, class R>
LevelInput<Scalar> level_input(const Eigen::MatrixBase<J>& jacobian,
                               const Eigen::MatrixBase<A>& activation,
                               const Eigen::MatrixBase<R>& reference,
                               std::span<const Scalar> row_scale = {}) noexcept {
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
  return {jacobian, activation, reference, row_scale};
}

/// The first row at fault, and what is wrong with it.
template <class Scalar>
[[gnu::cold]] void find_bad_row(const LevelInput<Scalar>& input, Index columns,
                                LevelReport<Scalar>& level) noexcept {
  for (Index i = 0; i < level.rows && level.bad_row < 0; ++i) {
    const Scalar a = input.activation(i);
    bool finite = std::isfinite(a) && std::isfinite(input.reference(i));
    for (Index j = 0; j < columns; ++j) finite = finite && std::isfinite(input.jacobian(i, j));
    const bool in_range = a >= Scalar(0) && a <= Scalar(1),
               scaled = input.scale(i) > Scalar(0) && input.scale(i) < infinity<Scalar>;
    if (finite && in_range && scaled) continue;
    level.status = !finite    ? Status::non_finite
                   : in_range ? Status::out_of_range
                              : Status::activation_out_of_range;
    level.bad_row = i;
  }
}

/// Fills rows, active rows, status and bad row. Rows that are inactive are checked too.
template <class Scalar>
LevelReport<Scalar> check_level(const LevelInput<Scalar>& input, Index columns) noexcept {
  const auto& [jacobian, activation, reference, row_scale] = input;
  LevelReport<Scalar> level;
  level.rows = jacobian.rows;
  if (jacobian.cols != columns || activation.cols != 1 || reference.cols != 1 ||
      activation.rows != level.rows || reference.rows != level.rows ||
      (!row_scale.empty() && static_cast<Index>(row_scale.size()) != level.rows)) {
    level.status = Status::wrong_size;
    return level;
  }
  bool good = jacobian.finite();
  for (const Scalar scale : row_scale) good &= scale > Scalar(0) && scale < infinity<Scalar>;
  for (Index i = 0; i < level.rows; ++i) {
    const Scalar a = activation(i);
    good &= a >= Scalar(0) && a <= Scalar(1) && reference(i) * Scalar(0) == Scalar(0);
    if (a > Scalar(0)) ++level.active_rows;
  }
  if (!good) find_bad_row(input, columns, level);
  return level;
}

/// What the report says of a solved level, as if rows were not scaled, of which the first `columns`
/// columns of the Jacobian meet the velocity `rho`. Rows without activation do not count.
template <int N, class Scalar>
void report_rates(const LevelInput<Scalar>& input, Index columns, const Scalar* rho,
                  LevelReport<Scalar>& level) noexcept {
  Scalar requested(0), achieved(0), error(0), rates[4];
  for (Index i = 0, end; i < level.rows; i = end) {
    end = i;
    while (end < level.rows && end < i + 4 && input.activation(end) > Scalar(0)) ++end;
    if (end == i + 4) {
      input.jacobian.template rows_dot<N>(i, columns, rho, rates);
    } else {
      for (Index k = i; k < end; ++k) {
        rates[k - i] = input.jacobian.template row_dot<N>(k, columns, rho);
      }
    }
    for (Index k = i; k < end; ++k) {
      const Scalar y = input.activation(k) * rates[k - i];
      const Scalar x = input.activation(k) * input.reference(k);
      requested += x * x;
      achieved += y * y;
      error += (x - y) * (x - y);
    }
    if (end == i) ++end;  // not active
  }
  level.requested_rate = std::sqrt(requested);
  level.achieved_rate = std::sqrt(achieved);
  level.tracking_error = std::sqrt(error);
}

}  // namespace icat::detail
