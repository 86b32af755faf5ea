// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Null-space-based guidance, [NSB, Eq. (31)–(34)]: S. Moe, G. Antonelli, K. Y. Pettersen,
/// *Null-Space-Based Behavior Guidance of Planar Dual-Arm UVMS*, 2014.
///
///     ζ = J₁⁺ r₁ + (I − J₁⁺J₁) J₂⁺ r₂ + (I − J₁₂⁺J₁₂) J₃⁺ r₃ + …,   J₁₂ = [J₁; J₂]
///     r_k = σ̇_k,d + Λ_k e_k,   e_k = σ_k,d − σ_k
///
/// **Erratum** [NSB, Eq. (34)]: the error of the follower's first term is e₂₁; Eq. (31)–(33) need
/// none.
///
/// **Projector.** I − J⁺J is the orthogonal projector onto the null space of *all* rows so far, so
/// an orthonormal basis B of their span is all that is kept: I − BBᵀ. New rows enter by modified
/// Gram-Schmidt, twice, which keeps B orthonormal to rounding. Nothing depends on how the tasks are
/// scaled against each other.
///
/// **Pseudo-inverse.** Jacobi rotations of pairs of rows, of J and r alike, make the rows of J
/// mutually orthogonal (a one-sided SVD); then J⁺r = Σ jᵢ rᵢ / ‖jᵢ‖². It is exact, not damped, as
/// the paper has it; a singular value of no more than √ε times the task's largest counts as zero:
/// with half of the digits gone it is rounding rather than motion. Such a direction is neither
/// moved along nor kept from the tasks below. So at a singularity ζ is finite, but may jump; where
/// that matters, see `Tpik`.
///
/// **Against `Tpik`.** A lower task does not account for the effect of the higher ones on it, so it
/// is not achieved while they move, unless the tasks are orthogonal. In return none amplifies
/// another's velocity: each term is its own J_k⁺ r_k, shortened by a projection.
#pragma once

#include <Eigen/Jacobi>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <limits>

#include "icat/core/error.hpp"
#include "icat/tpik/level_check.hpp"

namespace icat {

/// Solver for `N` degrees of freedom (`Eigen::Dynamic`: given at construction). Call `reset`, then
/// `add_task` from the highest priority down; read `velocity`. After construction nothing allocates
/// or throws. Not safe to share between threads; distinct objects are.
template <std::floating_point Scalar, int N = Eigen::Dynamic>
class NullSpaceGuidance {
 public:
  /// Velocity, n.
  using VectorN = Vector<Scalar, N>;

  /// Static size. No allocation.
  NullSpaceGuidance() requires(N != Eigen::Dynamic) : NullSpaceGuidance(N, 0) {}
  /// Dynamic size. @throws std::invalid_argument unless `dof` ≥ 1. Allocates.
  explicit NullSpaceGuidance(Index dof) requires(N == Eigen::Dynamic) : NullSpaceGuidance(dof, 0) {}

  /// Degrees of freedom, n.
  Index dof() const noexcept { return velocity_.size(); }

  /// ζ = 0, no task. No allocation.
  void reset() noexcept {
    velocity_.setZero();
    rank_ = 0;
    report_.clear();
  }

  /// The next term of Eq. (33).
  /// @param jacobian       m × n, any m ≥ 0, of any rank
  /// @param reference_rate m, σ̇_d + Λ (σ_d − σ)
  /// @return `ok`, or why the task was refused: it then changed nothing, later tasks may follow,
  ///         and the report names the task (as its level) and row. `regularized` of the report
  ///         means: rank below min(m, n). No allocation, no exception.
  template <class J, class R>
  Status add_task(const Eigen::MatrixBase<J>& jacobian,
                  const Eigen::MatrixBase<R>& reference_rate) noexcept {
    const auto active = Vector<Scalar, Eigen::Dynamic>::Ones(jacobian.rows());
    const detail::Readable<J> j(jacobian.derived());
    const detail::Readable<R> r(reference_rate.derived());
    const auto input = detail::level_input<Scalar>(j, active, r);
    LevelReport<Scalar> level = detail::check_level(input, dof());
    if (level.status == Status::ok && level.rows > 0) {
      level.status = solve(j, r, level);
      if (level.status == Status::ok) {
        detail::report_rates<N>(input, dof(), velocity_.data(), level);
      }
    }
    report_.add(level);
    return level.status;
  }

  /// ζ of the tasks so far, n. Always finite, and within `implausible_speed`.
  const VectorN& velocity() const noexcept { return velocity_; }
  /// Since the last reset; a level is a task.
  const TpikReport<Scalar>& report() const noexcept { return report_; }

 private:
  static constexpr int NPlusOne = add_sizes(N, 1);

  NullSpaceGuidance(Index dof, int)
      : velocity_(VectorN::Zero(validated(dof))),
        increment_(velocity_),
        next_(velocity_),
        rows_(dof, dof + 1),
        rate_(dof + 1),
        basis_(dof, dof),
        tolerance_(std::sqrt(std::numeric_limits<Scalar>::epsilon())) {}

  static Index validated(Index dof) {
    detail::require_strict_arithmetic<Scalar>();
    if (dof < 1) detail::invalid("NullSpaceGuidance: dof must be >= 1, got ", dof);
    return dof;
  }

  /// Not `ok`, and nothing changed, if anything overflowed or is faster than any robot.
  template <class J, class R>
  Status solve(const J& jacobian, const R& reference_rate, LevelReport<Scalar>& level) noexcept {
    Index count = std::min(level.rows, dof());
    const Index full_rank = count;
    load(jacobian, reference_rate);
    if (!orthogonalize(count)) return Status::numerical_failure;
    count = keep_significant(count);
    increment_.setZero();
    for (Index i = 0; i < count; ++i) increment_ += rate_(i) * rows_.col(i);
    project(increment_);
    next_ = velocity_ + increment_;
    const Status status = detail::check_speeds(dof(), next_.data());
    if (status != Status::ok) return status;
    velocity_ = next_;
    for (Index i = 0; i < count && rank_ < dof(); ++i) {
      project(rows_.col(i));
      const Scalar rest = rows_.col(i).norm();
      if (rest > tolerance_) basis_.col(rank_++) = rows_.col(i) / rest;
    }
    level.regularized = count < full_rank;
    return Status::ok;
  }

  /// Rows of J as columns, and r, both over the largest element of J, which J⁺r does not notice but
  /// squares do. Givens rotations fold what is more than n rows into n.
  template <class J, class R>
  void load(const J& jacobian, const R& reference_rate) noexcept {
    const Index n = dof(), m = jacobian.rows();
    const Scalar largest = jacobian.cwiseAbs().maxCoeff();
    const Scalar scale = largest > Scalar(0) ? largest : Scalar(1);
    rows_.setZero();
    rate_.setZero();
    for (Index i = 0; i < m; ++i) {
      const Index at = m > n ? n : i;
      for (Index j = 0; j < n; ++j) rows_(j, at) = jacobian(i, j) / scale;
      rate_(at) = reference_rate(i) / scale;
      for (Index j = 0; m > n && j < n; ++j) {
        if (rows_(j, n) == Scalar(0)) continue;
        Eigen::JacobiRotation<Scalar> givens;
        givens.makeGivens(rows_(j, j), rows_(j, n));
        rotate(j, n, givens);
      }
    }
  }

  void rotate(Index p, Index q, const Eigen::JacobiRotation<Scalar>& rotation) noexcept {
    rows_.applyOnTheRight(p, q, rotation);
    rate_.applyOnTheRight(p, q, rotation);
  }

  /// Jacobi sweeps; six are usual, thirty are the bound on time.
  bool orthogonalize(Index count) noexcept {
    constexpr Scalar epsilon = std::numeric_limits<Scalar>::epsilon();
    const Scalar rounding = Scalar(dof()) * epsilon;
    const Scalar nothing = epsilon * epsilon * rows_.leftCols(count).squaredNorm();
    for (int sweep = 0; sweep < 30; ++sweep) {
      bool orthogonal = true;
      for (Index p = 0; p < count; ++p) {
        for (Index q = p + 1; q < count; ++q) {
          const Scalar pp = rows_.col(p).squaredNorm(), qq = rows_.col(q).squaredNorm();
          const Scalar pq = rows_.col(p).dot(rows_.col(q));
          if (std::min(pp, qq) <= nothing || std::abs(pq) <= rounding * std::sqrt(pp * qq)) {
            continue;
          }
          Eigen::JacobiRotation<Scalar> jacobi;
          jacobi.makeJacobi(pp, pq, qq);
          rotate(p, q, jacobi);
          orthogonal = false;
        }
      }
      if (orthogonal) return true;
    }
    return false;
  }

  /// Moves the rows of significant singular values to the front, as unit vectors with r over the
  /// singular value; how many they are.
  Index keep_significant(Index count) noexcept {
    Scalar largest(0);
    for (Index i = 0; i < count; ++i) largest = std::max(largest, rows_.col(i).norm());
    Index kept = 0;
    for (Index i = 0; i < count; ++i) {
      const Scalar sigma = rows_.col(i).norm();
      if (!(sigma > tolerance_ * largest)) continue;
      rate_(kept) = rate_(i) / sigma;
      for (Index j = 0; j < dof(); ++j) rows_(j, kept) = rows_(j, i) / sigma;
      ++kept;
    }
    return kept;
  }

  /// x ← (I − BBᵀ) x, twice: where little of x remains, the first pass leaves rounding of all.
  template <class X>
  void project(X&& x) const noexcept {
    for (int pass = 0; pass < 2; ++pass) {
      for (Index k = 0; k < rank_; ++k) x -= basis_.col(k).dot(x) * basis_.col(k);
    }
  }

  VectorN velocity_, increment_, next_;
  Eigen::Matrix<Scalar, N, NPlusOne> rows_;
  Eigen::Matrix<Scalar, 1, NPlusOne> rate_;
  Eigen::Matrix<Scalar, N, N> basis_;
  Index rank_{0};
  Scalar tolerance_;
  TpikReport<Scalar> report_;
};

}  // namespace icat
