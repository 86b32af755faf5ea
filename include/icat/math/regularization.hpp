// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Singular-value oriented regularization, `h` of [Coop, Eq. (20)].
///
///     h(σ) = λ/2 (1 + cos(π σ / σ_t))   for 0 ≤ σ < σ_t,    0 for σ ≥ σ_t
///
/// A policy maps a singular value of `XᵀAX + η (I − Q)ᵀ(I − Q)` to its regularized inverse and
/// names the threshold σ_t from which on that is the plain inverse. Any type that satisfies
/// `RegularizationPolicy` will do.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <numbers>

#include "icat/core/error.hpp"

namespace icat {

/// `inverse(σ)` for σ ≥ 0, finite and never negative, equal to 1/σ for σ ≥ `threshold`. An optional
/// `validate()` throws on bad parameters; solvers call it once, at construction.
template <class Policy, class Scalar>
concept RegularizationPolicy = std::copyable<Policy> && requires(const Policy& p, Scalar sigma) {
  { p.inverse(sigma) }
  noexcept->std::convertible_to<Scalar>;
  { p.threshold } -> std::convertible_to<Scalar>;
};

namespace detail {

/// Raised cosine of height `lambda` on [0, threshold).
template <class Scalar>
Scalar bell(Scalar sigma, Scalar lambda, Scalar threshold) noexcept {
  if (!(sigma < threshold)) return Scalar(0);
  return lambda / Scalar(2) *
         (Scalar(1) + std::cos(std::numbers::pi_v<Scalar> * sigma / threshold));
}

}  // namespace detail

/// Eq. (20) of [Coop]: σ ↦ 1 / (σ + h(σ)).
template <class Scalar>
struct BellRegularization {
  Scalar lambda{Scalar(1e-4)};     ///< height of the bell, > 0
  Scalar threshold{Scalar(1e-2)};  ///< σ_t, > 0: singular values from here on are inverted exactly

  /// Regularized inverse of σ ≥ 0.
  Scalar inverse(Scalar sigma) const noexcept {
    return Scalar(1) / (sigma + detail::bell(sigma, lambda, threshold));
  }
  /// @throws std::invalid_argument unless both parameters are finite and > 0.
  void validate() const {
    detail::require_positive("BellRegularization", "lambda", lambda);
    detail::require_positive("BellRegularization", "threshold", threshold);
  }
};

/// The damped form in public use beside Eq. (20): σ ↦ σ / (σ² + h(σ)).
template <class Scalar>
struct DampedBellRegularization {
  Scalar lambda{Scalar(1e-4)};     ///< height of the bell, > 0
  Scalar threshold{Scalar(1e-2)};  ///< σ_t, > 0

  /// Regularized inverse of σ ≥ 0.
  Scalar inverse(Scalar sigma) const noexcept {
    if (!(sigma < threshold)) return Scalar(1) / sigma;
    return sigma / (sigma * sigma + detail::bell(sigma, lambda, threshold));
  }
  /// @throws std::invalid_argument unless both parameters are finite and > 0.
  void validate() const {
    detail::require_positive("DampedBellRegularization", "lambda", lambda);
    detail::require_positive("DampedBellRegularization", "threshold", threshold);
  }
};

}  // namespace icat
