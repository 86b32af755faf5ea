// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Fusion policies: which tool velocity the agents agree on, given what each could do best alone
/// [Coop, Eq. (29)].
///
///     mean                  ẋ̂ = Σ ẋ_i / N                      what the paper uses
///     convex combination    ẋ̂ = Σ w_i ẋ_i,  Σ w_i = 1
///     difficulty-weighted   w_i ∝ ‖ẋ̄ − ẋ_i‖                    for who is hindered most
///     no faster than the slowest                               any of these, with a bound
///
/// All agents must compute the same numbers, so a policy may depend only on the sent numbers. The
/// agents' ẋ̄ differ, by the gain times the drift between the tools, and weights that depend on
/// them increase this drift. So the difficulty is sent too if a policy needs it, one number more.
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

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "icat/core/error.hpp"
#include "icat/tpik/tpik.hpp"

namespace icat {

/// What the agents said, in the order of their indices.
template <class Scalar>
struct Proposals {
  std::span<const Vector6<Scalar>> velocities;  ///< ẋ_i, components on ⟨t⟩, m/s, rad/s
  std::span<const Matrix6<Scalar>> spans;       ///< T_i; empty where they are not exchanged
  std::span<const Scalar> difficulties;  ///< ‖ẋ̄ − ẋ_i‖; 0 where they are not exchanged
};

/// One's own policy needs `fuse` alone.
template <class Scalar>
struct FusionPolicy {
  /// Called in the control step: must not throw and should not allocate.
  std::function<Vector6<Scalar>(const Proposals<Scalar>&)> fuse;
  bool difficulties{false};  ///< it needs them: they are exchanged
  std::size_t agents{0};     ///< it is made for so many; 0: for any number
};

namespace fusion {

/// Σ ẋ_i / N.
template <class Scalar>
FusionPolicy<Scalar> mean() {
  return {.fuse = [](const Proposals<Scalar>& p) {
    Vector6<Scalar> sum = Vector6<Scalar>::Zero();
    for (const auto& velocity : p.velocities) sum += velocity;
    return Vector6<Scalar>(sum / static_cast<Scalar>(p.velocities.size()));
  }};
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
  const std::size_t agents = weights.size();
  return {.fuse =
              [weights = std::move(weights)](const Proposals<Scalar>& p) {
                Vector6<Scalar> sum = Vector6<Scalar>::Zero();
                for (std::size_t i = 0; i < weights.size(); ++i)
                  sum += weights[i] * p.velocities[i];
                return sum;
              },
          .agents = agents};
}

/// Each agent weighs as much as it is hindered: w_i ∝ ‖ẋ̄ − ẋ_i‖ + `even`. Far below `even` (> 0)
/// the weights are even, so that rounding does not choose between agents that nothing hinders.
/// @throws std::invalid_argument unless even > 0.
template <class Scalar>
FusionPolicy<Scalar> difficulty_weighted(Scalar even = Scalar(1e-3)) {
  detail::require_positive("difficulty_weighted", "even", even);
  return {.fuse =
              [even](const Proposals<Scalar>& p) {
                Vector6<Scalar> sum = Vector6<Scalar>::Zero();
                Scalar total(0);
                for (std::size_t i = 0; i < p.velocities.size(); ++i) {
                  const Scalar weight = p.difficulties[i] + even;
                  sum += weight * p.velocities[i];
                  total += weight;
                }
                return Vector6<Scalar>(sum / total);
              },
          .difficulties = true};
}

/// What `policy` says, its linear and its angular velocity each no faster than the slowest of the
/// proposals; where all propose the same it changes nothing. It does not distinguish an agent that
/// cannot move faster from one that need not: a robot at its goal holds back one that must give
/// way. Spans are applied afterwards, and may make it faster again. Allocates.
template <class Scalar>
FusionPolicy<Scalar> no_faster_than_slowest(FusionPolicy<Scalar> policy = mean<Scalar>()) {
  const auto speed = [](const Vector6<Scalar>& v, Index part) {
    return std::sqrt(v(part) * v(part) + v(part + 1) * v(part + 1) + v(part + 2) * v(part + 2));
  };
  FusionPolicy<Scalar> slow = policy;
  slow.fuse = [fuse = std::move(policy.fuse), speed](const Proposals<Scalar>& p) {
    Vector6<Scalar> fused = fuse(p);
    for (Index part = 0; part < 6; part += 3) {
      Scalar slowest = speed(p.velocities.front(), part);
      for (const auto& velocity : p.velocities) slowest = std::min(slowest, speed(velocity, part));
      const Scalar fast = speed(fused, part);
      for (Index i = part; i < part + 3 && fast > slowest; ++i) fused(i) *= slowest / fast;
    }
    return fused;
  };
  return slow;
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

  /// `proposals` must have as many spans as agents were given. Bad input: zero velocity, and
  /// `status` says why.
  Vector6<Scalar> nearest(const Vector6<Scalar>& preferred,
                          const Proposals<Scalar>& proposals) noexcept {
    for (std::size_t i = 0; i < proposals.spans.size(); ++i) {
      const Index row = static_cast<Index>(6 * i);
      for (Index k = 0; k < 6; ++k) {
        reference_(row + k) = Scalar(0);
        for (Index j = 0; j < 6; ++j) {
          rows_(row + k, j) = (k == j ? Scalar(1) : Scalar(0)) - proposals.spans[i](k, j);
          reference_(row + k) += rows_(row + k, j) * proposals.velocities[i](j);
        }
      }
    }
    tpik_.reset();
    Status status = tpik_.add_level(rows_, active_, reference_);
    if (status == Status::ok) {
      status = tpik_.add_level(Matrix6<Scalar>::Identity(), Vector6<Scalar>::Ones(), preferred);
    }
    const Status closing = tpik_.minimize_velocity();
    status_ = status == Status::ok ? closing : status;
    if (status_ != Status::ok) return detail::zeros<Vector6<Scalar>>(6);
    return tpik_.velocity();
  }
  /// Of the last `nearest`.
  Status status() const noexcept { return status_; }

 private:
  Tpik<Scalar, 6> tpik_;
  JacobianMatrix<Scalar, 6> rows_;
  Vector<Scalar, Eigen::Dynamic> reference_, active_;
  Status status_{Status::ok};
};

}  // namespace icat
