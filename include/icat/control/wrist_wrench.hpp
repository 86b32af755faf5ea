// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Force and torque at the wrist, from a sensor that measures how its structure deforms [MARIS,
/// II-C3]. The paper names the sensor and its reference and prints no method; ours is the usual
/// one. With N signals V, V₀ those without load, on the sensor's frame ⟨s⟩:
///
///     w = C (V − V₀)                                           calibration, C 6 × N
///     C = (Σ w_k x_kᵀ) (Σ x_k x_kᵀ)⁻¹,  x_k = V_k − V₀         least squares over samples w_k, V_k
///     w_ext = w − w₀ − [(m − m_d) g; (m c − m_d c_b) × g]      without the hand itself
///
/// m, c: mass and centre of mass of the load on the sensor (the hand), m_d, c_b: mass and centre of
/// the water that it displaces, g on ⟨s⟩; in air m_d = 0. w₀ is the drift that `tare` takes off.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/math/cholesky.hpp"
#include "icat/math/rigid_motion.hpp"

namespace icat {

/// One line of a calibration: what the reference said, and the signals.
template <class Scalar, int N>
struct WrenchSample {
  Vector6<Scalar> wrench;    ///< [N; N m] on ⟨s⟩
  Vector<Scalar, N> signal;  ///< V
};

/// Of `calibrate_wrench`.
template <class Scalar, int N>
struct WrenchCalibration {
  Eigen::Matrix<Scalar, 6, N> matrix;  ///< C
  Vector<Scalar, N> zero;              ///< V₀
  Vector6<Scalar> residual;            ///< RMS of w − C (V − V₀) over the samples
  /// σ of each element of C, from the residuals: 0 for as many samples as signals.
  Eigen::Matrix<Scalar, 6, N> deviation;
};

/// Least squares, at configuration. Signals of any scale; sums are double. Allocates.
/// @throws std::invalid_argument on fewer samples than signals, on what is not finite, and where
///         the samples do not move every signal independently of the others (to 1e-6 of its scale).
template <class Scalar, int N>
[[gnu::cold]] WrenchCalibration<Scalar, N> calibrate_wrench(
    const std::vector<WrenchSample<Scalar, N>>& samples, const Vector<Scalar, N>& zero) {
  const std::size_t count = samples.size();
  if (count < static_cast<std::size_t>(N)) {
    detail::invalid("calibrate_wrench: ", count, " samples for ", N, " signals");
  }
  if (!detail::all_finite(zero)) detail::invalid("calibrate_wrench: zero is not finite");
  std::vector<Vector<double, N>> x(count);
  Vector<double, N> scale;
  detail::fill(scale, 0.0);
  for (std::size_t k = 0; k < count; ++k) {
    if (!detail::all_finite(samples[k].signal) || !detail::all_finite(samples[k].wrench)) {
      detail::invalid("calibrate_wrench: sample ", k, " is not finite");
    }
    for (Index i = 0; i < N; ++i) {
      x[k](i) = double(samples[k].signal(i)) - double(zero(i));
      scale(i) = std::max(scale(i), std::abs(x[k](i)));
    }
  }
  for (Index i = 0; i < N; ++i) {
    if (!(scale(i) > 0)) detail::invalid("calibrate_wrench: signal ", i, " does not move");
  }
  Eigen::Matrix<double, N, N> A;
  Eigen::Matrix<double, 6, N> b;
  detail::fill(A, 0.0);
  detail::fill(b, 0.0);
  for (std::size_t k = 0; k < count; ++k) {
    for (Index i = 0; i < N; ++i) {
      x[k](i) /= scale(i);
      for (Index j = 0; j <= i; ++j) A(i, j) += x[k](i) * x[k](j);
      for (Index r = 0; r < 6; ++r) b(r, i) += double(samples[k].wrench(r)) * x[k](i);
    }
  }
  // A pivot of 1e-12 of its diagonal: 1e-6 of the signal is its own.
  Vector<double, N> diagonal;
  for (Index i = 0; i < N; ++i) diagonal(i) = A(i, i);
  detail::Cholesky<double, N> factor;
  bool independent = factor.compute(A);
  Eigen::Matrix<double, N, N> inverse;
  for (Index i = 0; independent && i < N; ++i) {
    Vector<double, N> e;
    detail::fill(e, 0.0);
    e(i) = 1;
    factor.solve(e);
    for (Index j = 0; j < N; ++j) inverse(j, i) = e(j);
    // The inverse's diagonal is one over what of signal i the others do not explain.
    independent = e(i) * diagonal(i) < 1e12;
  }
  if (!independent) {
    detail::invalid("calibrate_wrench: the samples do not tell the ", N, " signals apart");
  }
  WrenchCalibration<Scalar, N> result;
  result.zero = zero;
  Eigen::Matrix<double, 6, N> C;
  for (Index r = 0; r < 6; ++r) {
    for (Index i = 0; i < N; ++i) {
      double sum = 0;
      for (Index j = 0; j < N; ++j) sum += b(r, j) * inverse(j, i);
      C(r, i) = sum;
      result.matrix(r, i) = static_cast<Scalar>(sum / scale(i));
    }
    double square = 0;
    for (std::size_t k = 0; k < count; ++k) {
      double error = double(samples[k].wrench(r));
      for (Index i = 0; i < N; ++i) error -= C(r, i) * x[k](i);
      square += error * error;
    }
    const double n = static_cast<double>(count), free = n - N;
    result.residual(r) = static_cast<Scalar>(std::sqrt(square / n));
    for (Index i = 0; i < N; ++i) {
      const double variance = free > 0 ? square / free * inverse(i, i) : 0;
      result.deviation(r, i) = static_cast<Scalar>(std::sqrt(variance) / scale(i));
    }
  }
  return result;
}

/// What hangs on the sensor. By default the hand in sea water: 4.5 daN in air, 1 daN in water
/// [MARIS, II-C]; where its centres are is ours.
template <class Scalar>
struct HandWeight {
  Scalar mass = static_cast<Scalar>(4.59);       ///< m, kg, >= 0
  Scalar displaced = static_cast<Scalar>(3.57);  ///< m_d, kg, >= 0; 0 in air
  Vector3<Scalar> centre{Scalar(0), Scalar(0), static_cast<Scalar>(0.1)};  ///< c, on ⟨s⟩, m
  /// c_b, on ⟨s⟩, m.
  Vector3<Scalar> centre_of_buoyancy{Scalar(0), Scalar(0), static_cast<Scalar>(0.1)};
  Scalar gravity = static_cast<Scalar>(9.81);  ///< along z of ⟨0⟩, m/s²

  /// [N; N m] on the sensor at the origin of ⟨s⟩, on ⟨s⟩; `attitude` from ⟨s⟩ to ⟨0⟩. No
  /// allocation.
  Vector6<Scalar> wrench(const Matrix3<Scalar>& attitude) const noexcept {
    const Vector3<Scalar> g = detail::scaled(detail::row3(attitude, 2, 0), gravity);  // Rᵀ z
    const Vector3<Scalar> arm =
        detail::plus(detail::scaled(centre, mass), -displaced, centre_of_buoyancy);
    const Vector3<Scalar> force = detail::scaled(g, mass - displaced);
    const Vector3<Scalar> moment = detail::cross(arm, g);
    Vector6<Scalar> w;
    for (Index i = 0; i < 3; ++i) w(i) = force(i), w(3 + i) = moment(i);
    return w;
  }
};

/// The wrench of the world on the hand. Slow motion: inertia and drag of the hand are part of it.
template <class ScalarType, int N>
class WristWrench {
 public:
  /// Scalar type.
  using Scalar = ScalarType;
  /// @throws std::invalid_argument on what is not finite or a mass below 0.
  [[gnu::cold]] explicit WristWrench(const WrenchCalibration<Scalar, N>& calibration,
                                     const HandWeight<Scalar>& weight = HandWeight<Scalar>())
      : calibration_(calibration), weight_(weight) {
    if (!detail::all_finite(calibration.matrix) || !detail::all_finite(calibration.zero)) {
      detail::invalid("WristWrench: the calibration is not finite");
    }
    for (const Scalar m : {weight.mass, weight.displaced}) {
      if (!(m >= Scalar(0)) || !std::isfinite(m)) {
        detail::invalid("WristWrench: masses must be finite and >= 0, got ", m);
      }
    }
    if (!detail::all_finite(weight.centre) || !detail::all_finite(weight.centre_of_buoyancy) ||
        !std::isfinite(weight.gravity)) {
      detail::invalid("WristWrench: centres and gravity must be finite");
    }
  }

  /// Signals, and the attitude from ⟨s⟩ to ⟨0⟩, of one time. What is none is refused, the wrench
  /// stays. No allocation.
  Status update(const Vector<Scalar, N>& signal, const Matrix3<Scalar>& attitude) noexcept {
    if (!detail::all_finite(signal)) return Status::non_finite;
    const Vector3<Scalar> origin(Scalar(0), Scalar(0), Scalar(0));
    if (!is_rigid(detail::make_pose(attitude, origin))) return Status::not_a_rotation;
    const Vector6<Scalar> own = weight_.wrench(attitude);
    Vector6<Scalar> all;
    for (Index r = 0; r < 6; ++r) {
      Scalar sum(0);
      for (Index i = 0; i < N; ++i) {
        sum += calibration_.matrix(r, i) * (signal(i) - calibration_.zero(i));
      }
      all(r) = sum;
    }
    if (!detail::all_finite(all)) return Status::numerical_failure;
    for (Index r = 0; r < 6; ++r) {
      total_(r) = all(r);
      rest_(r) = all(r) - own(r);
    }
    return Status::ok;
  }
  /// Call it while the hand hangs free: the wrench of the last update is drift. A mean over some
  /// updates is better: `tare(mean)`.
  void tare() noexcept { offset_ = rest_; }
  /// w₀, [N; N m]. Refused where it is not finite.
  Status tare(const Vector6<Scalar>& offset) noexcept {
    if (!detail::all_finite(offset)) return Status::non_finite;
    offset_ = offset;
    return Status::ok;
  }

  /// w_ext of the last update: [N; N m] at the origin of ⟨s⟩, on ⟨s⟩.
  Vector6<Scalar> wrench() const noexcept {
    Vector6<Scalar> w;
    for (Index r = 0; r < 6; ++r) w(r) = rest_(r) - offset_(r);
    return w;
  }
  /// w, with the hand's own weight.
  const Vector6<Scalar>& total() const noexcept { return total_; }
  /// w₀.
  const Vector6<Scalar>& offset() const noexcept { return offset_; }

 private:
  WrenchCalibration<Scalar, N> calibration_;
  HandWeight<Scalar> weight_;
  Vector6<Scalar> total_ = Filled{0}, rest_ = Filled{0}, offset_ = Filled{0};
};

}  // namespace icat
