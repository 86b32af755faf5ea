// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The velocity of the chosen columns as an affine function of that of the given ones: in the
/// papers the arm law, in the velocity of the vehicle [Coop, Eq. (24), (25)].
///
///     q̇ = ρ̃ + P v
///     ρ̃_k = ρ̃_{k−1} + Q_{k−1} X_k^{#,A_k,I} W_k (ẋ̄_k − J_kᵃ ρ̃_{k−1})
///     P_k = P_{k−1} − Q_{k−1} X_k^{#,A_k,I} W_k (J_kᵃ P_{k−1} + J_kᵛ)
///     ρ̃₀ = 0, P₀ = 0, Q₀ = I over the chosen columns, X_k = J_kᵃ Q_{k−1}
///
/// Evaluated on the latest measured v, it is optimal for that v, so their loop may run faster
/// than the solver. It equals [MARIS]'s TPIK 2 (`Tpik` with all the vehicle's components given).
///
/// **Erratum** [Coop, Eq. (25)]: as printed, `P_k = (I − Q X^# W) Jᵃ − Q X^# W Jᵛ` has dimensions
/// that do not fit; the form above follows from ρ_k = ρ̃_k + P_k v in Eq. (22).
#pragma once

#include "icat/tpik/level_check.hpp"
#include "icat/tpik/stored_iteration.hpp"

namespace icat {

/// `N` chosen columns, `Parameters` given velocities (6 for a vehicle). Velocity bounds are no part
/// of it: the saturation depends on v, so the law would not be affine. Saturate its result
/// (`VelocityBounds`), or use `Tpik::reset(rho0, Q0)`.
template <std::floating_point Scalar, int N = Eigen::Dynamic, int Parameters = 6,
          RegularizationPolicy<Scalar> Regularization = BellRegularization<Scalar>>
class ParametricTpik {
 public:
  /// Velocity, n.
  using VectorN = Vector<Scalar, N>;
  /// n × n.
  using SquareN = Eigen::Matrix<Scalar, N, N>;
  /// N × Parameters.
  using ParameterMatrix = Eigen::Matrix<Scalar, N, Parameters>;

  /// Settings, with defaults.
  struct Options {
    /// Policy and its parameters.
    Regularization regularization{};
    Scalar projection_weight{1};  ///< η of Eq. (20), > 0
  };

  /// Static size, default options. All constructors throw `std::invalid_argument` on parameters out
  /// of range.
  ParametricTpik() requires(N != Eigen::Dynamic) : ParametricTpik(N, Options{}, 0) {}
  /// Static size. Throws as above. No allocation.
  explicit ParametricTpik(const Options& options) requires(N != Eigen::Dynamic)
      : ParametricTpik(N, options, 0) {}
  /// Dynamic size, default options. Throws as above. Allocates.
  explicit ParametricTpik(Index dof) requires(N == Eigen::Dynamic)
      : ParametricTpik(dof, Options{}, 0) {}
  /// Dynamic size. Throws as above. Allocates.
  ParametricTpik(Index dof, const Options& options) requires(N == Eigen::Dynamic)
      : ParametricTpik(dof, options, 0) {}

  /// Number of chosen columns.
  Index dof() const noexcept { return law_.rows(); }

  /// ρ̃ = 0, P = 0, Q = I. No allocation.
  void reset() noexcept {
    detail::fill(law_, Scalar(0));
    iteration_.start().reset();
    report_.clear();
  }

  /// One iteration. `jacobian` is `[Jᵃ Jᵛ]`, m × (N + Parameters); the rest as in
  /// `Tpik::add_level`, and so are errors (for each element of ρ̃ and P) and allocation. The
  /// report's rates are those for v = 0.
  template <class J, class A, class R>
  Status add_level(const Eigen::MatrixBase<J>& jacobian, const Eigen::MatrixBase<A>& activation,
                   const Eigen::MatrixBase<R>& reference,
                   std::span<const Scalar> row_scale = {}) noexcept {
    const detail::Readable<J> j(jacobian.derived());
    const detail::Readable<A> a(activation.derived());
    const detail::Readable<R> r(reference.derived());
    return add(detail::level_input<Scalar>(j, a, r, row_scale));
  }

  /// The closing level, which minimizes their motion; call it last, always.
  Status minimize_velocity() noexcept {
    LevelReport<Scalar> level;
    level.rows = level.active_rows = dof();
    if (!iteration_.close(law_.data(), dof())) {
      level.status = Status::numerical_failure;
    } else {
      (void)advance(level);
    }
    report_.add(level);
    return level.status;
  }

  /// ρ̃, N.
  auto rho() const noexcept { return law_.col(0); }
  /// P, N × Parameters.
  auto P() const noexcept { return law_.template rightCols<Parameters>(); }
  /// q̇ = ρ̃ + P v. `v` in the frame of the Jacobian's last columns (⟨v⟩ for a vehicle).
  VectorN evaluate(const Vector<Scalar, Parameters>& v) const noexcept {
    VectorN velocity(dof());
    detail::copy(dof(), law_.data(), velocity.data());
    for (Index c = 1; c < columns; ++c) {
      for (Index i = 0; i < dof(); ++i) velocity(i) += law_(i, c) * v(c - 1);
    }
    return velocity;
  }
  /// Q over the chosen columns, N × N. Formed when asked for.
  const SquareN& projector() const noexcept { return iteration_.projector_matrix(); }
  /// Since the last reset.
  const TpikReport<Scalar>& report() const noexcept { return report_; }

 private:
  static constexpr int columns = 1 + Parameters;
  using Law = Eigen::Matrix<Scalar, N, columns>;  // [ρ̃ P]

  [[gnu::cold]] ParametricTpik(Index dof, const Options& options, int)
      : iteration_(validated(options, dof), options.regularization, options.projection_weight),
        law_(detail::zeros<Law>(dof, columns)),
        next_law_(law_) {}

  static Index validated(const Options& options, Index dof) {
    if (dof < 1) detail::invalid("ParametricTpik: dof must be >= 1, got ", dof);
    if constexpr (requires { options.regularization.validate(); }) {
      options.regularization.validate();
    }
    detail::require_positive("ParametricTpik", "projection_weight", options.projection_weight);
    return dof;
  }

  Status add(const detail::LevelInput<Scalar>& input) noexcept {
    const Index l = dof();
    LevelReport<Scalar> level = detail::check_level(input, l + Parameters);
    if (level.status == Status::ok && level.active_rows > 0) {
      iteration_.begin(level.active_rows);
      for (Index i = 0; i < level.rows; ++i) {
        const Scalar a = input.activation(i);
        if (!(a > Scalar(0))) continue;
        Scalar wanted[columns] = {input.reference(i)};
        for (Index c = 1; c < columns; ++c) wanted[c] = -input.jacobian(i, l + c - 1);
        iteration_.template row<N>(input.jacobian, i, a, wanted, law_.data(), dof(),
                                   input.scale(i));
      }
      if (!iteration_.solve()) {
        level.status = Status::numerical_failure;
      } else if (advance(level)) {
        iteration_.accept();
        level.regularized = iteration_.regularized();
        detail::report_rates<N>(input, l, law_.data(), level);
      }
    }
    report_.add(level);
    return level.status;
  }

  bool advance(LevelReport<Scalar>& level) noexcept {
    const auto& increment = iteration_.increment;
    for (Index c = 0; c < columns; ++c) {
      for (Index i = 0; i < dof(); ++i) next_law_(i, c) = law_(i, c) + increment(i, c);
    }
    level.status = detail::check_speeds(law_.size(), next_law_.data());
    if (level.status != Status::ok) return false;
    detail::copy(law_.size(), next_law_.data(), law_.data());
    return true;
  }

  detail::StoredIteration<Scalar, N, columns, Regularization> iteration_;
  Law law_, next_law_;
  TpikReport<Scalar> report_;
};

}  // namespace icat
