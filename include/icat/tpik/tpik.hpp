// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Task-priority inverse kinematics of the iCAT framework, [Coop, Eq. (20)–(23)], [MARIS, Eq.
/// (12)].
///
///     ρ₀ = 0, Q₀ = I
///     X_k = J_k Q_{k−1}
///     W_k = X_k X_k^{#,A_k,Q_{k−1}}
///     Q_k = Q_{k−1} (I − X_k^{#,A_k,I} X_k)
///     ρ_k = ρ_{k−1} + Sat( Q_{k−1} X_k^{#,A_k,I} W_k (ẋ̄_k − J_k ρ_{k−1}) )
///     ẏ   = ρ_{N+1}, from one more iteration with J = I, A = I, ẋ̄ = 0
///
/// Call `reset`, `add_level` from the highest priority down, `minimize_velocity`; read `velocity`.
#pragma once

#include <concepts>

#include "icat/tpik/level_check.hpp"
#include "icat/tpik/redistribution.hpp"
#include "icat/tpik/stored_iteration.hpp"
#include "icat/tpik/velocity_bounds.hpp"

namespace icat {

/// Solver for `N` degrees of freedom (`Eigen::Dynamic`: given at construction). After construction
/// nothing allocates or throws. Not safe to share between threads; distinct objects are.
template <std::floating_point Scalar, int N = Eigen::Dynamic,
          RegularizationPolicy<Scalar> Regularization = BellRegularization<Scalar>>
class Tpik {
 public:
  /// Velocity, n.
  using VectorN = Vector<Scalar, N>;
  /// n × n.
  using SquareN = Eigen::Matrix<Scalar, N, N>;

  /// Settings, with defaults.
  struct Options {
    /// Policy and its parameters.
    Regularization regularization{};
    Scalar projection_weight{1};  ///< η of Eq. (20), > 0; the paper has 1
    /// None by default; `set_bounds` changes them.
    VelocityBounds<Scalar, N> bounds{};
    Saturation saturation{Saturation::scale};  ///< of a level at the bounds; as published
  };

  /// Static size, default options. All constructors throw `std::invalid_argument` on parameters out
  /// of range.
  Tpik() requires(N != Eigen::Dynamic) : Tpik(N, Options{}, 0) {}
  /// Static size. Throws as above. No allocation.
  explicit Tpik(const Options& options) requires(N != Eigen::Dynamic) : Tpik(N, options, 0) {}
  /// Dynamic size, default options. Throws as above. Allocates.
  explicit Tpik(Index dof) requires(N == Eigen::Dynamic) : Tpik(dof, Options{}, 0) {}
  /// Dynamic size. Throws as above. Allocates.
  Tpik(Index dof, const Options& options) requires(N == Eigen::Dynamic) : Tpik(dof, options, 0) {}

  /// Degrees of freedom.
  Index dof() const noexcept { return rho_.size(); }
  /// As given at construction; the bounds are those in force, n components each.
  const Options& options() const noexcept { return options_; }

  /// Bounds on ẏ (rad/s, m/s) from the next level on: call it before `reset`, as often as each
  /// cycle. Bounds that `VelocityBounds::check` refuses (wrong size, NaN, 0 outside) change
  /// nothing. No allocation.
  Status set_bounds(const VelocityBounds<Scalar, N>& bounds) noexcept {
    const Status status = bounds.check(dof());
    if (status != Status::ok) return status;
    for (Index i = 0; i < dof(); ++i) {
      options_.bounds.lower(i) = bounds.lower_of(i);
      options_.bounds.upper(i) = bounds.upper_of(i);
    }
    bounded_ = bounds.any(dof());
    return status;
  }

  /// ρ₀ = 0, Q₀ = I. No allocation.
  void reset() noexcept {
    detail::fill(rho_, Scalar(0));
    iteration_.start().reset();
    clear();
  }

  /// Start of a system that is not fully actuated [Coop, Eq. (31)] or constrained [Coop, IV]:
  /// `rho0` (n) is the given velocity, `Q0` (n × n) the projector onto the velocities that may be
  /// chosen. On bad input (wrong size, not finite, faster than `implausible_speed`) ρ₀ = 0 and Q₀ =
  /// 0, so that nothing moves; the report holds the status.
  template <class R, class Q>
  Status reset(const Eigen::MatrixBase<R>& rho0, const Eigen::MatrixBase<Q>& Q0) noexcept {
    clear();
    const detail::Readable<R> rho0_value(rho0.derived());
    const detail::Readable<Q> Q0_value(Q0.derived());
    const detail::Input<Scalar> velocity(rho0_value), projector(Q0_value);
    const bool by_row = velocity.rows == 1;
    const bool sized = velocity.rows * velocity.cols == dof() && (by_row || velocity.cols == 1) &&
                       projector.rows == dof() && projector.cols == dof();
    Status status = !sized                                    ? Status::wrong_size
                    : velocity.finite() && projector.finite() ? Status::ok
                                                              : Status::non_finite;
    if (status == Status::ok) {
      for (Index i = 0; i < dof(); ++i) rho_(i) = by_row ? velocity(0, i) : velocity(i);
      status = detail::check_speeds(dof(), rho_.data());
    }
    if (status != Status::ok) {
      detail::fill(rho_, Scalar(0));
      iteration_.start().reset_to_zero();
      report_.fail(status, -1, -1);
      return status;
    }
    iteration_.start().reset(projector);
    return Status::ok;
  }

  /// One iteration of Eq. (22).
  /// @param jacobian   m × n, any m ≥ 0; an Eigen matrix, map or block. An expression is evaluated
  ///                   first, which allocates if its size is known at run time only; so for all.
  /// @param activation m, the diagonal of A, in [0, 1]
  /// @param reference  m, the reference rate ẋ̄
  /// @param row_scale  m, each finite and > 0, or none: row i of J and ẋ̄ counts multiplied with
  ///                   it, such as one in metres with 1 / characteristic length; the report's
  ///                   rates are those of the rows as they are
  /// @return `ok`, or why the level was refused: it then changed nothing, later levels may follow,
  ///         and the report names the level and its row. A level of activation 0 changes nothing,
  ///         exactly. No allocation, no exception.
  template <class J, class A, class R>
  Status add_level(const Eigen::MatrixBase<J>& jacobian, const Eigen::MatrixBase<A>& activation,
                   const Eigen::MatrixBase<R>& reference,
                   std::span<const Scalar> row_scale = {}) noexcept {
    const detail::Readable<J> j(jacobian.derived());
    const detail::Readable<A> a(activation.derived());
    const detail::Readable<R> r(reference.derived());
    return add(detail::level_input<Scalar>(j, a, r, row_scale));
  }

  /// The closing level of Eq. (23), which keeps ẏ continuous: call it last, always. Listed in the
  /// report as a level of n rows.
  Status minimize_velocity() noexcept {
    LevelReport<Scalar> level;
    level.rows = level.active_rows = dof();
    if (!iteration_.close(rho_.data(), 0)) {
      level.status = Status::numerical_failure;
    } else if (advance(level, true)) {
      Scalar square(0);
      for (Index i = 0; i < dof(); ++i) square += rho_(i) * rho_(i);
      level.achieved_rate = level.tracking_error = std::sqrt(square);
    }
    report_.add(level);
    return level.status;
  }

  /// ρ after the last level, n: after `minimize_velocity`, ẏ. Always finite, and within
  /// `implausible_speed`.
  const VectorN& velocity() const noexcept { return rho_; }
  /// Q after the last `add_level`, n × n: the projector for the levels below. Formed when asked
  /// for, in O(n³); no allocation.
  const SquareN& projector() const noexcept { return iteration_.projector_matrix(); }
  /// Since the last reset.
  const TpikReport<Scalar>& report() const noexcept { return report_; }

 private:
  [[gnu::cold]] Tpik(Index dof, const Options& options, int)
      : options_(validated(options, dof)),
        iteration_(dof, options.regularization, options.projection_weight),
        redistribution_(N != Eigen::Dynamic || options.saturation == Saturation::redistribute ? dof
                                                                                              : 0),
        rho_(detail::zeros<VectorN>(dof)),
        next_rho_(detail::zeros<VectorN>(dof)) {
    // Memory for all that `set_bounds` may bring.
    options_.bounds.lower.resize(dof);
    options_.bounds.upper.resize(dof);
    (void)set_bounds(options.bounds);  // validated
  }

  static const Options& validated(const Options& options, Index dof) {
    if (dof < 1) detail::invalid("Tpik: dof must be >= 1, got ", dof);
    if constexpr (requires { options.regularization.validate(); }) {
      options.regularization.validate();
    }
    detail::require_positive("Tpik", "projection_weight", options.projection_weight);
    options.bounds.validate("Tpik", dof);
    return options;
  }

  void clear() noexcept {
    report_.clear();
    place_ = 0;
  }

  Status add(const detail::LevelInput<Scalar>& input) noexcept {
    ++place_;
    if (options_.saturation != Saturation::scale) {
      share_ = Scalar(1) - Scalar(1) / Scalar(20 * (place_ + 1));
    }
    LevelReport<Scalar> level = detail::check_level(input, dof());
    if (level.status == Status::ok && level.active_rows > 0) {
      iteration_.begin(level.active_rows);
      for (Index i = 0; i < level.rows; ++i) {
        const Scalar a = input.activation(i), wanted = input.reference(i);
        if (!(a > Scalar(0))) continue;
        iteration_.template row<N>(input.jacobian, i, a, &wanted, rho_.data(), 0, input.scale(i));
      }
      if (!iteration_.solve()) {
        level.status = Status::numerical_failure;
      } else if (advance(level, false)) {
        level.regularized = iteration_.regularized();
        detail::report_rates<N>(input, dof(), rho_.data(), level);
      }
    }
    report_.add(level);
    return level.status;
  }

  /// ρ += Sat(Δ), and Q becomes that after the level; false, and both as they were, where that
  /// is no speed.
  bool advance(LevelReport<Scalar>& level, bool closing) noexcept {
    const Scalar* increment = iteration_.increment.data;
    const Scalar share = bounded_ && !closing ? share_ : Scalar(1);
    detail::copy(dof(), rho_.data(), next_rho_.data());
    if (bounded_) {
      level.saturation_scale = options_.bounds.scale(dof(), rho_.data(), increment, share);
      options_.bounds.advance(dof(), next_rho_.data(), increment, level.saturation_scale, share);
    } else {
      for (Index i = 0; i < dof(); ++i) next_rho_(i) += increment[i];
    }
    level.status = detail::check_speeds(dof(), next_rho_.data());
    if (level.status != Status::ok) return false;
    if (!closing) iteration_.accept();
    if (level.saturation_scale < Scalar(1)) saturate(level, share);
    detail::copy(dof(), next_rho_.data(), rho_.data());
    return true;
  }

  /// The increment passes a bound, and next_rho_ is ρ + Sat(Δ) as published.
  [[gnu::cold]] void saturate(LevelReport<Scalar>& level, Scalar share) noexcept {
    const Scalar* increment = iteration_.increment.data;
    // A component that starts outside may stay there.
    const auto lower = [&](Index i) { return std::min(share * options_.bounds.lower(i), rho_(i)); };
    const auto upper = [&](Index i) { return std::max(share * options_.bounds.upper(i), rho_(i)); };
    if (options_.saturation != Saturation::redistribute) {
      for (Index i = 0; i < dof(); ++i) {
        const Scalar wanted = rho_(i) + increment[i];
        level.saturated += wanted < lower(i) || wanted > upper(i) ? 1 : 0;
      }
      return;
    }
    const Scalar s =
        redistribution_.solve(iteration_.projector_matrix(), rho_.data(), increment, lower, upper);
    const Scalar* shared = redistribution_.increment.data();
    if (detail::check_speeds(dof(), shared) != Status::ok) return;  // as published, then
    level.saturated = redistribution_.held();
    level.saturation_steps = redistribution_.steps();
    const Scalar rest = options_.bounds.scale(dof(), rho_.data(), shared, share);
    level.saturation_scale = s * rest;
    detail::copy(dof(), rho_.data(), next_rho_.data());
    options_.bounds.advance(dof(), next_rho_.data(), shared, rest, share);
  }

  Options options_;
  Scalar share_{1};      // of the bounds, that the present level may use
  Index place_{0};       // of the present level, from 1
  bool bounded_{false};  // any component of options_.bounds
  detail::StoredIteration<Scalar, N, 1, Regularization> iteration_;
  detail::Redistribution<Scalar, N> redistribution_;
  VectorN rho_, next_rho_;
  TpikReport<Scalar> report_;
};

}  // namespace icat
