// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Matrix types used throughout icat; poses are in pose.hpp.
///
/// Conventions, everywhere in the library: SI units (m, rad, s); 6-vectors are stacked
/// `[linear; angular]`; the system velocity is `ẏ = [q̇; v]` [Coop, Eq. (2)] with the vehicle
/// velocity `v` of frame ⟨v⟩ with respect to the inertial frame ⟨0⟩ and components on ⟨v⟩;
/// ⟨0⟩ is NED, z points down.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "icat/core/strict_arithmetic.hpp"

namespace icat {

/// No limit. A constant instead of a call: GCC 12 stops with an internal error where a class member
/// is initialised from bare braces and a default inside them calls a function, or a constructor
/// whose `noexcept` it has to work out. So no default in the library does either.
template <class Scalar>
inline constexpr Scalar infinity = std::numeric_limits<Scalar>::infinity();

using Eigen::Index;

/// Column vector of `N` components.
template <class Scalar, int N>
using Vector = Eigen::Matrix<Scalar, N, 1>;

/// Row-count unknown until run time, column count `N` (the degrees of freedom).
template <class Scalar, int N = Eigen::Dynamic>
using JacobianMatrix = Eigen::Matrix<Scalar, Eigen::Dynamic, N>;

/// Three components.
template <class Scalar>
using Vector3 = Vector<Scalar, 3>;
/// Six components, [linear; angular].
template <class Scalar>
using Vector6 = Vector<Scalar, 6>;
/// 3 × 3.
template <class Scalar>
using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;
/// 6 × 6.
template <class Scalar>
using Matrix6 = Eigen::Matrix<Scalar, 6, 6>;

namespace detail {

// What `setConstant`, `Zero`, `Identity` and `=` do, without a type of expression for each matrix
// type: compilers spend more on those than on the solver.

template <class M>
void fill(M& m, typename M::Scalar value) noexcept {
  typename M::Scalar* x = m.data();
  for (Index i = 0; i < m.size(); ++i) x[i] = value;
}
template <class M>
void copy(const M& from, M& to) noexcept {  // of one size
  for (Index i = 0; i < to.size(); ++i) to.data()[i] = from.data()[i];
}
template <class M>
M zeros(Index rows, Index cols = 1) {
  M m(rows, cols);
  fill(m, typename M::Scalar(0));
  return m;
}
template <class M>
void set_identity(M& m) noexcept {
  fill(m, typename M::Scalar(0));
  for (Index i = 0; i < m.rows() && i < m.cols(); ++i) m(i, i) = typename M::Scalar(1);
}
template <class M>
M identity(Index size) {
  M m(size, size);
  set_identity(m);
  return m;
}

}  // namespace detail

/// A number in every element, as a default of a member: a conversion, not the call of a function,
/// for the same reason as `infinity`. What has no fixed size is left empty.
struct Filled {
  double value;  ///< of every element
  /// As a matrix or vector.
  template <class Scalar, int Rows, int Cols, int Options>
  operator Eigen::Matrix<Scalar, Rows, Cols, Options>() const {  // NOLINT: converts on purpose
    Eigen::Matrix<Scalar, Rows, Cols, Options> m;
    detail::fill(m, static_cast<Scalar>(value));
    return m;
  }
};

/// The identity, as a default of a member like `Filled`. Square, of fixed size.
struct IdentityMatrix {
  /// As a matrix.
  template <class Scalar, int N>
  operator Eigen::Matrix<Scalar, N, N>() const {  // NOLINT: converts on purpose
    Eigen::Matrix<Scalar, N, N> m;
    detail::set_identity(m);
    return m;
  }
};

/// No elements, as a default of a member like `Filled`.
struct EmptyList {
  /// As a vector.
  template <class T>
  operator std::vector<T>() const {  // NOLINT: converts on purpose
    return std::vector<T>();
  }
};

/// Sum of two compile-time sizes, `Eigen::Dynamic` if either is.
constexpr int add_sizes(int a, int b) {
  return a == Eigen::Dynamic || b == Eigen::Dynamic ? Eigen::Dynamic : a + b;
}

}  // namespace icat
