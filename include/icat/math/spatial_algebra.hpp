// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Algebra of vectors, rotations and poses in space, on plain values.
///
///     ⟨a⟩p = ⟨a⟩R⟨b⟩ ⟨b⟩p + ⟨a⟩o⟨b⟩,    T_a T_b = [ R_a R_b,  R_a o_b + o_a ]
///
/// Eigen computes the same, but makes a type for each expression and each block of a pose, and
/// compilers spend more time on those types than on the rest of a controller. Nothing allocates.
#pragma once

#include <cmath>

#include "icat/core/pose.hpp"

namespace icat::detail {

/// A x
template <class Scalar>
inline Vector3<Scalar> times(const Matrix3<Scalar>& A, const Vector3<Scalar>& x) noexcept {
  Vector3<Scalar> y;
  for (Index i = 0; i < 3; ++i) y(i) = A(i, 0) * x(0) + A(i, 1) * x(1) + A(i, 2) * x(2);
  return y;
}
/// Aᵀ x
template <class Scalar>
inline Vector3<Scalar> transposed_times(const Matrix3<Scalar>& A,
                                        const Vector3<Scalar>& x) noexcept {
  Vector3<Scalar> y;
  for (Index i = 0; i < 3; ++i) y(i) = A(0, i) * x(0) + A(1, i) * x(1) + A(2, i) * x(2);
  return y;
}
/// A B
template <class Scalar>
inline Matrix3<Scalar> times(const Matrix3<Scalar>& A, const Matrix3<Scalar>& B) noexcept {
  Matrix3<Scalar> C;
  for (Index j = 0; j < 3; ++j) {
    for (Index i = 0; i < 3; ++i) {
      C(i, j) = A(i, 0) * B(0, j) + A(i, 1) * B(1, j) + A(i, 2) * B(2, j);
    }
  }
  return C;
}
/// Aᵀ
template <class Scalar>
inline Matrix3<Scalar> transpose(const Matrix3<Scalar>& A) noexcept {
  Matrix3<Scalar> B;
  for (Index j = 0; j < 3; ++j) {
    for (Index i = 0; i < 3; ++i) B(i, j) = A(j, i);
  }
  return B;
}

/// a + s b
template <class Scalar>
inline Vector3<Scalar> plus(const Vector3<Scalar>& a, Scalar s, const Vector3<Scalar>& b) noexcept {
  return {a(0) + s * b(0), a(1) + s * b(1), a(2) + s * b(2)};
}
/// a + b
template <class Scalar>
inline Vector3<Scalar> plus(const Vector3<Scalar>& a, const Vector3<Scalar>& b) noexcept {
  return {a(0) + b(0), a(1) + b(1), a(2) + b(2)};
}
/// a − b
template <class Scalar>
inline Vector3<Scalar> minus(const Vector3<Scalar>& a, const Vector3<Scalar>& b) noexcept {
  return {a(0) - b(0), a(1) - b(1), a(2) - b(2)};
}
/// s a
template <class Scalar>
inline Vector3<Scalar> scaled(const Vector3<Scalar>& a, Scalar s) noexcept {
  return {s * a(0), s * a(1), s * a(2)};
}
/// aᵀ b
template <class Scalar>
inline Scalar dot(const Vector3<Scalar>& a, const Vector3<Scalar>& b) noexcept {
  return a(0) * b(0) + a(1) * b(1) + a(2) * b(2);
}
/// a × b
template <class Scalar>
inline Vector3<Scalar> cross(const Vector3<Scalar>& a, const Vector3<Scalar>& b) noexcept {
  return {a(1) * b(2) - a(2) * b(1), a(2) * b(0) - a(0) * b(2), a(0) * b(1) - a(1) * b(0)};
}
/// ‖a‖
template <class Scalar>
inline Scalar norm(const Vector3<Scalar>& a) noexcept {
  return std::sqrt(dot(a, a));
}

/// The rotation of a pose.
template <class Scalar>
inline Matrix3<Scalar> rotation(const Pose<Scalar>& pose) noexcept {
  Matrix3<Scalar> R;
  for (Index j = 0; j < 3; ++j) {
    for (Index i = 0; i < 3; ++i) R(i, j) = pose.matrix()(i, j);
  }
  return R;
}
/// The origin of a pose.
template <class Scalar>
inline Vector3<Scalar> origin(const Pose<Scalar>& pose) noexcept {
  return {pose.matrix()(0, 3), pose.matrix()(1, 3), pose.matrix()(2, 3)};
}
/// The pose of a rotation and an origin.
template <class Scalar>
inline Pose<Scalar> make_pose(const Matrix3<Scalar>& rotation,
                              const Vector3<Scalar>& origin) noexcept {
  Eigen::Matrix<Scalar, 4, 4> T;  // costs a compiler less than a pose without numbers
  for (Index i = 0; i < 3; ++i) {
    for (Index j = 0; j < 3; ++j) T(i, j) = rotation(i, j);
    T(i, 3) = origin(i);
    T(3, i) = Scalar(0);
  }
  T(3, 3) = Scalar(1);
  return Pose<Scalar>(T);
}
/// R = I, o = 0.
template <class Scalar>
inline Pose<Scalar> identity_pose() noexcept {
  return make_pose(identity<Matrix3<Scalar>>(3), Vector3<Scalar>(Scalar(0), Scalar(0), Scalar(0)));
}
/// T p
template <class Scalar>
[[gnu::noinline]] inline Vector3<Scalar> transform(const Pose<Scalar>& pose,
                                                   const Vector3<Scalar>& point) noexcept {
  return plus(times(rotation(pose), point), origin(pose));
}
/// T_a T_b
template <class Scalar>
[[gnu::noinline]] inline Pose<Scalar> compose(const Pose<Scalar>& a,
                                              const Pose<Scalar>& b) noexcept {
  return make_pose(times(rotation(a), rotation(b)), transform(a, origin(b)));
}

/// Rows `row`… of column `j` of a matrix.
template <class M>
inline Vector3<typename M::Scalar> column3(const M& m, Index row, Index j) noexcept {
  return {m(row, j), m(row + 1, j), m(row + 2, j)};
}
template <class M>
inline void set_column3(M& m, Index row, Index j, const Vector3<typename M::Scalar>& x) noexcept {
  for (Index i = 0; i < 3; ++i) m(row + i, j) = x(i);
}

/// v_j + ω_j × r: what column `j` = [v_j; ω_j] of a Jacobian, or a twist, does to a point that
/// moves with its frame, `r` from the frame's origin.
template <class M>
inline Vector3<typename M::Scalar> velocity_at(const M& m, Index j,
                                               const Vector3<typename M::Scalar>& r) noexcept {
  return plus(column3(m, 0, j), cross(column3(m, 3, j), r));
}

/// The elements `row`, `j`… of a matrix.
template <class M>
inline Vector3<typename M::Scalar> row3(const M& m, Index row, Index j) noexcept {
  return {m(row, j), m(row, j + 1), m(row, j + 2)};
}
template <class M>
inline void set_row3(M& m, Index row, Index j, const Vector3<typename M::Scalar>& x) noexcept {
  for (Index i = 0; i < 3; ++i) m(row, j + i) = x(i);
}
/// (I − d dᵀ) / length, the derivative of d = p / length by p.
template <class Scalar>
inline Matrix3<Scalar> direction_derivative(const Vector3<Scalar>& d, Scalar length) noexcept {
  Matrix3<Scalar> P;
  for (Index j = 0; j < 3; ++j) {
    for (Index i = 0; i < 3; ++i)
      P(i, j) = ((i == j ? Scalar(1) : Scalar(0)) - d(i) * d(j)) / length;
  }
  return P;
}

/// No NaN and no infinity in a matrix of any type that stores its elements.
template <class M>
inline bool all_finite(const M& m) noexcept {
  typename M::Scalar sum(0);  // zero but for infinities and NaN, which stay
  for (Index i = 0; i < m.size(); ++i) sum += m.data()[i] * typename M::Scalar(0);
  return sum == typename M::Scalar(0);
}

}  // namespace icat::detail
