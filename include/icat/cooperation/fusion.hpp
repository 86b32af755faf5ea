// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Fusion policies: which tool velocity the agents agree on, given what each could do best alone
/// [Coop, Eq. (29)].
///
///     mean                  ẋ̂ = Σ ẋ_i / N                      what the paper uses
///     convex combination    ẋ̂ = Σ w_i ẋ_i,  Σ w_i = 1
///     difficulty-weighted   w_i ∝ ‖ẋ̄ − ẋ_i‖                    for who is hindered most
///
/// All agents must come to the same numbers, so a policy may depend on nothing but what all of them
/// know.
///
/// **Spans** (beyond the paper, which leaves it as future work [Coop, IV-B]). Agent i can reach the
/// tool velocities ẋ_i + range(T_i) without disturbing what has priority over its tool task, where
/// T_i = ∂ẋ_i/∂ẋ̄_i is how much of its reference that task gets through at its priority level: a
/// projector where activations are 0 or 1. The velocity agreed on is the point of the intersection
///
///     (I − T_i) ẋ̂ = (I − T_i) ẋ_i    for all i
///
/// next to what the policy says, found as a two-level task hierarchy, so that it moves smoothly
/// while an agent's tasks switch on and off. Where the intersection is empty it is the best
/// compromise.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "icat/core/error.hpp"
#include "icat/tpik/tpik.hpp"

namespace icat {

/// What the agents said, in the order of their indices.
template <class Scalar>
struct Proposals {
  std::span<const Vector6<Scalar>> velocities;  ///< ẋ_i, components on ⟨t⟩, m/s, rad/s
  std::span<const Matrix6<Scalar>> spans;       ///< T_i; empty where they are not exchanged
  Vector6<Scalar> desired;                      ///< ẋ̄_t, what the object should do
};

/// One's own policy is any callable of this kind, called in the control step: it must not throw and
/// should not allocate.
template <class Scalar>
using FusionPolicy = std::function<Vector6<Scalar>(const Proposals<Scalar>&)>;

namespace fusion {

/// Σ ẋ_i / N.
template <class Scalar>
FusionPolicy<Scalar> mean() {
  return [](const Proposals<Scalar>& p) {
    Vector6<Scalar> sum = Vector6<Scalar>::Zero();
    for (const auto& velocity : p.velocities) sum += velocity;
    return Vector6<Scalar>(sum / static_cast<Scalar>(p.velocities.size()));
  };
}

/// Σ w_i ẋ_i.
/// @throws std::invalid_argument unless the weights are ≥ 0 and their sum is 1, to rounding.
template <class Scalar>
FusionPolicy<Scalar> convex_combination(std::vector<Scalar> weights) {
  Scalar total(0);
  for (const Scalar w : weights) {
    if (!(w >= Scalar(0))) detail::invalid("convex_combination: a weight is ", w);
    total += w;
  }
  if (!(std::abs(total - Scalar(1)) <= Scalar(1e-5))) {
    detail::invalid("convex_combination: the weights must add up to 1, not ", total);
  }
  return [weights = std::move(weights)](const Proposals<Scalar>& p) {
    Vector6<Scalar> sum = Vector6<Scalar>::Zero();
    for (std::size_t i = 0; i < p.velocities.size() && i < weights.size(); ++i) {
      sum += weights[i] * p.velocities[i];
    }
    return sum;
  };
}

/// Each agent weighs as much as it is hindered, ‖ẋ̄ − ẋ_i‖; the mean where none is. `length` (m)
/// makes metres of radians in that norm. ẋ̄ is no part of the message: agents whose ẋ̄ differ agree
/// only as closely as that.
/// @throws std::invalid_argument unless length > 0.
template <class Scalar>
FusionPolicy<Scalar> difficulty_weighted(Scalar length = Scalar(1)) {
  detail::require_positive("difficulty_weighted", "length", length);
  return [length](const Proposals<Scalar>& p) {
    Vector6<Scalar> sum = Vector6<Scalar>::Zero(), plain = sum;
    Scalar total(0);
    for (const auto& velocity : p.velocities) {
      Vector6<Scalar> missing = p.desired - velocity;
      missing.template tail<3>() *= length;
      const Scalar difficulty = missing.norm();
      sum += difficulty * velocity;
      plain += velocity;
      total += difficulty;
    }
    // All weights are in [0, 1] and all velocities go to ẋ̄ with the total, so this does not jump.
    if (!(total > Scalar(0)))
      return Vector6<Scalar>(plain / static_cast<Scalar>(p.velocities.size()));
    return Vector6<Scalar>(sum / total);
  };
}

}  // namespace fusion

/// The point next to `preferred` that disturbs no agent, see the file comment.
template <class Scalar>
class SpanIntersection {
 public:
  /// For `agents` ≥ 1. Allocates; nothing else here does.
  explicit SpanIntersection(std::size_t agents)
      : rows_(JacobianMatrix<Scalar, 6>::Zero(static_cast<Index>(6 * agents), 6)),
        reference_(Vector<Scalar, Eigen::Dynamic>::Zero(rows_.rows())),
        active_(Vector<Scalar, Eigen::Dynamic>::Ones(rows_.rows())) {}

  /// `proposals` must have as many spans as agents were given. Bad input: zero velocity.
  Vector6<Scalar> nearest(const Vector6<Scalar>& preferred,
                          const Proposals<Scalar>& proposals) noexcept {
    for (std::size_t i = 0; i < proposals.spans.size(); ++i) {
      const Matrix6<Scalar> blocked = Matrix6<Scalar>::Identity() - proposals.spans[i];
      const Index row = static_cast<Index>(6 * i);
      rows_.template middleRows<6>(row) = blocked;
      reference_.template segment<6>(row) = blocked * proposals.velocities[i];
    }
    tpik_.reset();
    Status status = tpik_.add_level(rows_, active_, reference_);
    if (status == Status::ok) {
      status = tpik_.add_level(Matrix6<Scalar>::Identity(), Vector6<Scalar>::Ones(), preferred);
    }
    const Status closing = tpik_.minimize_velocity();
    if (status != Status::ok || closing != Status::ok) return Vector6<Scalar>::Zero();
    return tpik_.velocity();
  }

 private:
  Tpik<Scalar, 6> tpik_;
  JacobianMatrix<Scalar, 6> rows_;
  Vector<Scalar, Eigen::Dynamic> reference_, active_;
};

}  // namespace icat
