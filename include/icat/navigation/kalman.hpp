// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The two steps of a Kalman filter, for covariances of a small fixed size, in plain loops:
///
///     P ← F P Fᵀ + Q
///     S = H P Hᵀ + R,  K = P Hᵀ S⁻¹,  A = I − K H,  P ← A P Aᵀ + K R Kᵀ   (Joseph's form)
///
/// Each element and its mirror are computed once, so that P is symmetric to the last digit, and
/// Joseph's form keeps it positive where rounding would not (float).
#pragma once

#include <algorithm>
#include <cmath>

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/core/types.hpp"
#include "icat/navigation/measurement_gate.hpp"

namespace icat::detail {

/// N × N.
template <class Scalar, int N>
using Square = Eigen::Matrix<Scalar, N, N>;

/// Numbers beyond this are refused as measurements, in any unit.
inline constexpr double implausible_measurement = 1e6;

/// Of a measurement or an input.
template <class M>
Status check_input(const M& m) noexcept {
  for (Index i = 0; i < m.size(); ++i) {
    if (!std::isfinite(m.data()[i])) return Status::non_finite;
  }
  for (Index i = 0; i < m.size(); ++i) {
    if (!(std::abs(m.data()[i]) <= typename M::Scalar(implausible_measurement))) {
      return Status::implausible;
    }
  }
  return Status::ok;
}

/// Whether `dt` can be the duration of a step; clipped to a second, as clocks jump.
inline Status check_step(double& dt) noexcept {
  if (!std::isfinite(dt)) return Status::non_finite;
  if (dt < 0) return Status::time_reversed;
  dt = std::min(dt, 1.0);
  return Status::ok;
}

/// Throws unless `value` is finite and >= 0.
template <class Scalar>
void require_non_negative(const char* owner, const char* name, Scalar value) {
  if (!(value >= Scalar(0)) || value > std::numeric_limits<Scalar>::max()) {
    invalid(owner, ": ", name, " must be finite and >= 0, got ", value);
  }
}

/// A P Aᵀ, symmetric.
template <class Scalar, int N, int M>
Square<Scalar, M> congruence(const Eigen::Matrix<Scalar, M, N>& A,
                             const Square<Scalar, N>& P) noexcept {
  Eigen::Matrix<Scalar, M, N> AP;
  for (int i = 0; i < M; ++i) {
    for (int j = 0; j < N; ++j) {
      Scalar sum(0);
      for (int k = 0; k < N; ++k) sum += A(i, k) * P(k, j);
      AP(i, j) = sum;
    }
  }
  Square<Scalar, M> S;
  for (int i = 0; i < M; ++i) {
    for (int j = 0; j <= i; ++j) {
      Scalar sum(0);
      for (int k = 0; k < N; ++k) sum += AP(i, k) * A(j, k);
      S(i, j) = S(j, i) = sum;
    }
  }
  return S;
}

/// P ← F P Fᵀ + diag(q)
template <class Scalar, int N>
void propagate(Square<Scalar, N>& P, const Square<Scalar, N>& F,
               const Vector<Scalar, N>& q) noexcept {
  P = congruence<Scalar, N, N>(F, P);
  for (int i = 0; i < N; ++i) P(i, i) += q(i);
}

/// S⁻¹ of a symmetric positive S by its Cholesky factor. False where it is not positive.
template <class Scalar, int M>
bool invert(const Square<Scalar, M>& S, Square<Scalar, M>& inverse) noexcept {
  Square<Scalar, M> W;  // inverse of the factor L, S = L Lᵀ, built row by row beside L
  Square<Scalar, M> L;
  for (int i = 0; i < M; ++i) {
    for (int j = 0; j <= i; ++j) {
      Scalar sum = S(i, j);
      for (int k = 0; k < j; ++k) sum -= L(i, k) * L(j, k);
      if (i == j && !(sum > Scalar(0))) return false;
      L(i, j) = i == j ? std::sqrt(sum) : sum / L(j, j);
    }
    for (int j = 0; j <= i; ++j) {
      Scalar sum(i == j ? 1 : 0);
      for (int k = j; k < i; ++k) sum -= L(i, k) * W(k, j);
      W(i, j) = sum / L(i, i);
    }
  }
  for (int i = 0; i < M; ++i) {
    for (int j = 0; j <= i; ++j) {
      Scalar sum(0);
      for (int k = i; k < M; ++k) sum += W(k, i) * W(k, j);
      inverse(i, j) = inverse(j, i) = sum;
    }
  }
  return true;
}

/// yᵀ W y
template <class Scalar, int M>
Scalar quadratic_form(const Square<Scalar, M>& W, const Vector<Scalar, M>& y) noexcept {
  Scalar sum(0);
  for (int i = 0; i < M; ++i) {
    for (int j = 0; j < M; ++j) sum += y(i) * W(i, j) * y(j);
  }
  return sum;
}

/// One measurement.
template <class Scalar, int N, int M>
struct Observation {
  Eigen::Matrix<Scalar, M, N> H = Filled{0};
  Square<Scalar, M> R = Filled{0};
  Vector<Scalar, M> innovation = Filled{0};
  Vector<Scalar, M> change = Filled{0};  ///< from the innovation before it
};
/// What it does to the state, x ← x + dx, and to its error, e ← A e.
template <class Scalar, int N>
struct Correction {
  Status status = Status::ok;
  Vector<Scalar, N> dx = Filled{0};
  Square<Scalar, N> A = IdentityMatrix{};
};

/// Asks the gate; corrects P unless it refuses. In a restart `restarted` (M × N), H less what is
/// not to blame, says whose variance grows.
template <class Scalar, int N, int M>
Correction<Scalar, N> correct(Square<Scalar, N>& P, const Observation<Scalar, N, M>& z,
                              const Eigen::Matrix<Scalar, M, N>& restarted,
                              MeasurementGate& gate) noexcept {
  Correction<Scalar, N> result;
  Square<Scalar, M> S = congruence<Scalar, N, M>(z.H, P), W;
  for (int i = 0; i < M * M; ++i) S.data()[i] += z.R.data()[i];
  if (!invert<Scalar, M>(S, W)) {
    result.status = Status::numerical_failure;
    return result;
  }
  // Both outliers have the noise of a measurement, so their difference has twice its covariance.
  const auto verdict = gate.judge(double(quadratic_form<Scalar, M>(W, z.innovation)),
                                  double(quadratic_form<Scalar, M>(W, z.change)) / 2, M);
  if (verdict == MeasurementGate::Verdict::refuse) {
    result.status = Status::outlier;
    return result;
  }
  if (verdict == MeasurementGate::Verdict::restart) {
    for (int m = 0; m < M; ++m) {
      const Scalar variance = z.innovation(m) * z.innovation(m);
      for (int i = 0; i < N; ++i) {
        for (int j = 0; j < N; ++j) P(i, j) += restarted(m, i) * variance * restarted(m, j);
      }
    }
    S = congruence<Scalar, N, M>(z.H, P);
    for (int i = 0; i < M * M; ++i) S.data()[i] += z.R.data()[i];
    if (!invert<Scalar, M>(S, W)) {
      result.status = Status::numerical_failure;
      return result;
    }
  }
  Eigen::Matrix<Scalar, N, M> K;
  for (int i = 0; i < N; ++i) {
    Scalar PH[M];
    for (int m = 0; m < M; ++m) {
      PH[m] = Scalar(0);
      for (int k = 0; k < N; ++k) PH[m] += P(i, k) * z.H(m, k);
    }
    for (int m = 0; m < M; ++m) {
      K(i, m) = Scalar(0);
      for (int k = 0; k < M; ++k) K(i, m) += PH[k] * W(k, m);
      result.dx(i) += K(i, m) * z.innovation(m);
    }
    for (int j = 0; j < N; ++j) {
      for (int m = 0; m < M; ++m) result.A(i, j) -= K(i, m) * z.H(m, j);
    }
  }
  P = congruence<Scalar, N, N>(result.A, P);
  const Square<Scalar, N> noise = congruence<Scalar, M, N>(K, z.R);
  for (int i = 0; i < N * N; ++i) P.data()[i] += noise.data()[i];
  return result;
}

}  // namespace icat::detail
