// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The sigmoid of every activation and transition.
///
///     s(u) = u³ (10 − 15 u + 6 u²)    on [0, 1], 0 below, 1 above
///
/// [Coop, Eq. (18)] asks for "any sigmoid function with a continuous behaviour from 0 to 1"; this
/// one has continuous first and second derivatives, so it causes no kinks in velocities.
#pragma once

namespace icat {

/// Rises from 0 to 1 as `u` goes from 0 to 1; exactly 0 and 1 outside. NaN gives NaN.
template <class Scalar>
constexpr Scalar smooth_step(Scalar u) noexcept {
  if (u <= Scalar(0)) return Scalar(0);
  if (u >= Scalar(1)) return Scalar(1);
  // Rounding could pass 1 by an ulp just below u = 1, and an activation above 1 is refused.
  const Scalar s = u * u * u * (Scalar(10) + u * (Scalar(6) * u - Scalar(15)));
  return s > Scalar(1) ? Scalar(1) : s;
}

/// Derivative of `smooth_step`; 0 outside [0, 1].
template <class Scalar>
constexpr Scalar smooth_step_derivative(Scalar u) noexcept {
  if (u <= Scalar(0) || u >= Scalar(1)) return Scalar(0);
  const Scalar w = u * (Scalar(1) - u);
  return Scalar(30) * w * w;
}

}  // namespace icat
