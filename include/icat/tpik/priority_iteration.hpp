// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One iteration of [Coop, Eq. (22)], shared by `Tpik` and `ParametricTpik`.
///
/// With Q = L Nᵀ, L = N − U Vᵀ (projector.hpp), X = J L, B = A^{1/2} X over the rows of activation
/// a > 0 (a row with a = 0 drops out of Eq. (20) exactly), f the regularized inverse, e = ẋ̄ − J ρ:
///
///     z = f(M) Bᵀ A^{3/2} e,   M = BᵀB + η (I − Q)ᵀ(I − Q)             so that W e = X z, Eq. (20)
///
///     C = X^{#,A,I} X = f(BᵀB) BᵀA B = Bᵀ f(BBᵀ) A B
///
///     Δ = L C z,   Q ← Q − L C Nᵀ                                                       Eq. (22)
///
/// B, f and C: level_rows.hpp; z: projected_system.hpp. Derivations: docs/solver.md.
///
/// **Convention**: [Coop, Eq. (20)] writes `VᵀHV`, with M = U Σ V; here M = V Σ Vᵀ, so it is
/// `V H Vᵀ`.
#pragma once

#include "icat/tpik/level_rows.hpp"

namespace icat::detail {

/// The right-hand side has `sides` columns: ρ alone, or ρ̃ and P side by side. Sizes are run-time
/// values and the memory is somebody else's, so that one body serves all; nothing allocates.
template <class Scalar, class Regularization>
class PriorityIteration {
 public:
  using Block = Panel<Scalar>;

  /// Columns of n rows that it needs.
  static constexpr Index columns(Index n, Index sides) {
    return LevelRows<Scalar, Regularization>::columns(n, sides) + 4 * sides;
  }

  PriorityIteration(const Regularization& regularization, Scalar projection_weight)
      : level_(regularization, projection_weight), eta_(projection_weight) {}

  [[gnu::cold]] [[gnu::noinline]] void bind(Index n, Index sides,
                                            Scalar* memory_of_columns) noexcept {
    PanelMemory<Scalar> memory(memory_of_columns, n);
    level_.bind(n, sides, memory);
    for (Block* b : {&increment, &y_, &z_, &side_}) *b = memory.take(sides);
    dof_ = n;
    sides_ = sides;
  }

  Index dof() const noexcept { return dof_; }
  const Projector<Scalar>& projector() const noexcept { return level_.system.projector; }
  /// The projector, to be reset before the first level.
  Projector<Scalar>& start() noexcept {
    system().reset();
    return q();
  }

  /// Begins a level of `active` rows with a > 0; then `row` for each (see LevelRows), then `solve`.
  void begin(Index active) noexcept { level_.begin(active); }
  template <int N>
  void row(const Input<Scalar>& jacobian, Index i, Scalar activation, const Scalar* wanted,
           const Scalar* current, Index step, Scalar row_scale) noexcept {
    level_.template row<N>(jacobian, i, activation, wanted, current, step, row_scale);
  }

  /// Computes `increment`; `accept` then takes over the next projector. False, with
  /// nothing changed, if anything overflowed.
  bool solve() noexcept {
    level_.regularized = level_.vanished = false;
    if (free() == 0) {
      clear(increment, sides_);
      return true;
    }
    if (!level_.finish()) return false;
    if (level_.rank == 0) {
      clear(increment, sides_);
      return true;
    }
    return (level_.tall() ? solve_tall() : solve_wide()) && extend();
  }

  /// The projector becomes that after the level solved last.
  void accept() noexcept {
    if (free() == 0 || level_.rank == 0) return;
    if (level_.binary && !level_.regularized) {
      level_.tall() ? q().reset_to_zero() : q().take(level_.rank, level_.bt);
      return;
    }
    if (level_.binary && level_.rank > 1) {
      accept_regularized();
    } else if (level_.tall()) {
      q().gain(level_.change);
    } else if (level_.regularized ||
               std::find(level_.a, level_.a + level_.rank, Scalar(1)) == level_.a + level_.rank) {
      accept_partial();
    } else if (parts_well()) {
      accept_mixed();
    } else {
      accept_partial();
      take_binary();
    }
    if (q().vanishes()) q().reset_to_zero();
  }

  /// A closing level with J = I, A = I [Coop, Eq. (23)] for e = −`current` (n × sides, columns
  /// `step` apart). Nothing may come after it.
  [[gnu::noinline]] bool close(const Scalar* current, Index step) noexcept {
    if (free() == 0) {
      clear(increment, sides_);
      return true;
    }
    for (Index c = 0; c < sides_; ++c) {
      for (Index i = 0; i < dof_; ++i) level_.e(i, c) = -current[i + c * step];
      fill_up(dof_, level_.e[c]);
    }
    q().turn(sides_, level_.e);
    q().restrict(sides_, level_.e);  // Lᵀ e
    // M is at least η / (1 + η) I, the least of ‖Q x‖² + η ‖x − Q x‖² for ‖x‖ = 1.
    const bool regular = threshold() * (Scalar(1) + eta_) <= eta_;
    if (!q().orthogonal() && (!regular || 2 * q().partial() >= free())) {
      q().become_dense();
    }
    return (q().dense() ? close_dense(regular) : close_low_rank()) && extend();
  }

  /// A singular value of the last level's XᵀAX, in the span of its rows, lay below the threshold.
  bool regularized() const noexcept { return level_.regularized || level_.vanished; }

  /// Column `j` of Q, n.
  const Scalar* projector_column(Index j) const noexcept {
    clear(side_, 1);
    if (free() == 0) return side_.data;
    clear(z_, 1);
    z_(j, 0) = Scalar(1);
    projector().turn(1, z_);
    projector().extend(1, z_, side_);
    projector().turn_back(1, side_);
    return side_.data;
  }

  Block increment{};  ///< Δ of the level solved last; n × sides

 private:
  ProjectedSystem<Scalar, Regularization>& system() noexcept { return level_.system; }
  Projector<Scalar>& q() noexcept { return level_.system.projector; }
  Index free() const noexcept { return level_.system.projector.free(); }
  Scalar threshold() const noexcept { return Scalar(level_.system.regularization.threshold); }

  /// z_ ← C z = Bᵀ f(BBᵀ) A y, y = B z
  bool solve_wide() noexcept {
    const Index m = level_.rank;
    if (q().orthogonal() || (!level_.regularized && system().independent(m, level_.bt, level_.f))) {
      if (level_.binary && !level_.regularized) {
        apply_wide(level_.e);
        return true;
      }
      copy_rows(m, sides_, level_.e, y_);
      if (level_.regularized) level_.filter(y_);
    } else if (!solve_dependent()) {
      return false;
    }
    for (Index c = 0; c < sides_; ++c) {
      for (Index i = 0; i < m; ++i) y_(i, c) *= level_.a[i];
    }
    apply_wide(y_);
    return true;
  }
  /// y_ = B z where rows and partial rows depend on each other, or nothing is certain.
  [[gnu::cold]] bool solve_dependent() noexcept {
    const Index r = free(), m = level_.rank;
    if (m == r && !level_.regularized &&
        system().corrected_rows(level_.bt, level_.f, level_.e, y_)) {
      return true;
    }
    const bool spans = m + q().partial() >= r;  // else M has zeros, and no Cholesky factor
    if (!spans && !level_.regularized && system().reduces(m) &&
        system().reduced(m, level_.bt, level_.g, level_.e, y_)) {
      return true;
    }
    const Block& btb = level_.change;
    product(Into::set, r, sides_, m, level_.bt, level_.e, level_.rhs);
    product(Into::set, r, r, m, level_.bt, level_.bt, btb, By::transpose);
    if (!(spans && system().regular(btb, level_.rhs, z_)) && !system().full(btb, level_.rhs, z_)) {
      return false;
    }
    transposed_product(r, m, sides_, level_.bt, z_, y_);
    return true;
  }
  [[gnu::noinline]] void apply_wide(const Block& y) noexcept {
    level_.invert(y, side_);
    product(Into::set, free(), sides_, level_.rank, level_.bt, side_, z_);
  }

  /// z_ ← C z = f(BᵀB) BᵀA B z
  bool solve_tall() noexcept {
    const Index r = free();
    if (q().orthogonal()) {
      level_.invert(level_.rhs, z_);
    } else if ((level_.regularized || !system().corrected(level_.f, level_.rhs, z_)) &&
               !system().regular(level_.g, level_.rhs, z_) &&
               !system().full(level_.g, level_.rhs, z_)) {
      return false;
    }
    if (level_.binary) {
      if (level_.regularized) level_.filter(z_);
      return true;
    }
    copy(z_, side_, sides_);
    product(Into::set, r, sides_, r, level_.change, side_, z_);
    return true;
  }

  /// increment = L z_, in the axes that all began with.
  [[gnu::noinline]] bool extend() noexcept {
    q().extend(sides_, z_, increment);
    q().turn_back(sides_, increment);
    return all_finite(sides_ * increment.stride, increment.data);
  }

  /// A singular value of C that Q − Q C does not notice: of a row that repeats another, say.
  static bool negligible(Scalar gain) noexcept {
    return gain <= std::numeric_limits<Scalar>::epsilon();
  }
  /// Binary and partial rows of a level can be told apart: with κ the condition of G = BBᵀ, U Vᵀ of
  /// accept_mixed has an error of ε κ^{3/2}, since its terms grow with κ and cancel: 1e-11 at 1e3.
  bool parts_well() const noexcept {
    return trace(level_.rank, level_.g) * trace(level_.rank, level_.f) <= Scalar(1e3);
  }
  /// No row leaves: L C = (L B⁺) A B with B⁺ = Bᵀ f(BBᵀ).
  void accept_partial() noexcept {
    if (level_.rank == 1 && negligible(level_.a[0] * level_.gains[0])) return;
    const auto& [left, u, w, unused, unused1] = system().scratch;
    product(Into::set, free(), level_.rank, level_.rank, level_.bt, level_.f, left);
    for (Index i = level_.rank - level_.below; i < level_.rank; ++i) {
      product(Into::set, free(), 1, level_.rank, level_.bt, level_.basis.from(i), w);
      for (Index j = 0; j < level_.rank; ++j)
        axpy(free(), level_.inverses[i] * level_.basis(j, i), w[0], left[j]);
    }
    q().extend(level_.rank, left, u);
    for (Index i = 0; i < level_.rank; ++i) scale(free(), level_.a[i], level_.bt[i], level_.bt[i]);
    q().gain(level_.rank, u, level_.bt);
  }

  /// After accept_partial the binary rows leave, Q B⁺_b = 0.
  [[gnu::cold]] void take_binary() noexcept {
    const auto& [left, rows, unused, unused1, unused2] = system().scratch;
    Index binary = 0;
    for (Index i = 0; i < level_.rank; ++i) {
      if (level_.a[i] == Scalar(1)) copy(left.stride, left[i], rows[binary++]);
    }
    q().take(binary, rows);
  }

  /// Binary rows, of which V = [v_i] belongs to the eigenvalues σ_i of BBᵀ or BᵀB below the
  /// threshold: C is the projector on the rows with σ_i f(σ_i) instead of 1 in the directions v_i,
  /// or Bᵀ v_i / √σ_i. The others leave.
  void accept_regularized() noexcept {
    const auto& [rows, u, v, scaled, unused] = system().scratch;
    const Index r = free(), rest = level_.rank - level_.below;
    if (level_.tall()) {
      copy(level_.basis, rows, level_.rank);
    } else {
      product(Into::set, r, level_.rank, level_.rank, level_.bt, level_.basis, rows);
      for (Index i = rest; i < level_.rank; ++i) {
        const Scalar square = dot(r, rows[i], rows[i]);
        scale(r, square > Scalar(0) ? Scalar(1) / std::sqrt(square) : Scalar(0), rows[i], rows[i]);
      }
    }
    Index gained = 0;
    for (Index i = rest; i < level_.rank; ++i) {
      if (negligible(level_.gains[i])) continue;
      copy(rows.stride, rows[i], v[gained]);
      scale(rows.stride, level_.gains[i], rows[i], scaled[gained++]);
    }
    q().extend(gained, scaled, u);
    q().gain(gained, u, v);
    q().take(rest, rows);
  }

  /// Binary rows leave. With B⁺ = Bᵀ G⁻¹ and b, p the binary and the partial rows, V gains B⁺_p, U
  /// gains L Bᵀ_p − L Bᵀ (G⁻¹)_p (1 − A_p) G_pp, and the free axes lose B⁺_b.
  void accept_mixed() noexcept {
    const auto& [left, lb, weights, u, v] = system().scratch;
    const Index m = level_.rank;
    product(Into::set, free(), m, m, level_.bt, level_.f, left);
    q().extend(m, level_.bt, lb);
    Index binary = 0, partial = 0;
    for (Index i = 0; i < m; ++i) {
      if (level_.a[i] == Scalar(1)) {
        copy(left.stride, left[i], level_.bt[binary++]);
        continue;
      }
      Scalar* w = weights[partial];
      clear(weights.stride, w);
      for (Index j = 0; j < m; ++j) {
        if (level_.a[j] < Scalar(1))
          axpy(m, (Scalar(1) - level_.a[j]) * level_.g(j, i), level_.f[j], w);
      }
      copy(lb.stride, lb[i], u[partial]);
      copy(left.stride, left[i], v[partial++]);
    }
    product(Into::subtract, q().reach(), partial, m, lb, weights, u);
    q().gain(partial, u, v);
    q().take(binary, level_.bt);
  }

  /// All axes: L is b × r.
  bool close_dense(bool regular) noexcept {
    const auto& [l, m, factor, shifted, unused] = system().scratch;
    const Index r = free();
    for (Index j = 0; j < r; ++j) {
      scale(l.stride, Scalar(-1), q().u()[j], l[j]);
      l(j, j) += Scalar(1);
    }
    gram(q().reach(), r, l, level_.g);
    if (regular) {
      q().weigh();
      for (Index j = 0; j < r; ++j) {
        combine(r, eta_, q().k_free()[j], Scalar(1), level_.g[j], m[j]);
      }
      if (!cholesky(r, m, factor)) return false;
      system().solve(r, factor, level_.e, z_);
    } else if (!system().full(level_.g, level_.e, z_)) {
      return false;
    }
    return close_with(r, z_);
  }

  /// Only the span Y of V and U_N differs from Q = I: with Y R = [V U_N], T = U_N Vᵀ on it is
  /// R_U R_Vᵀ, LᵀL is (I − T)ᵀ(I − T) + R_V U_tᵀU_t R_Vᵀ, and M without the taken axes has η TᵀT
  /// more. T is formed first: the columns of U may be long where they cancel in T.
  bool close_low_rank() noexcept {
    const auto& [m, triangle_, reflections, t, factor] = system().scratch;
    const Index r = free(), p = q().partial(), d = 2 * p;
    const Scalar f = system().regularization.inverse(Scalar(1));
    Scalar* tau = level_.a;
    if (p > 0) {
      copy(q().v(), triangle_, p);
      copy_rows(r, p, q().u(), triangle_.from(p));
      triangularize(r, d, triangle_, reflections, tau);
      product(Into::set, d, d, p, triangle_.from(p), triangle_, t, By::transpose);
      gram(d, d, t, m);
      scale(d, d, Scalar(-1), t, t);
      for (Index j = 0; j < d; ++j) t(j, j) += Scalar(1);
      gram(d, d, t, level_.g);
      if (const Index taken = q().reach() - r; taken > 0) {
        q().copy_taken(factor);
        product(Into::set, taken, d, p, factor, triangle_, t, By::transpose);
        gram(taken, d, t, factor);
        add(d, d, Scalar(1), factor, level_.g);
      }
      for (Index j = 0; j < d; ++j) combine(d, eta_, m[j], Scalar(1), level_.g[j], m[j]);
      for (Index i = 0; i < d; ++i) reflect_from(i, r, tau[i], reflections[i], sides_, level_.e);
      if (!cholesky(d, m, factor)) return false;
      system().solve(d, factor, level_.e, z_);
      if (!close_with(d, z_)) return false;
    }
    for (Index c = 0; c < sides_; ++c) {
      for (Index i = d; i < r; ++i) z_(i, c) = f * f * level_.e(i, c);
      fill_up(r, z_[c]);
    }
    for (Index i = d; i-- > 0;) reflect_from(i, r, tau[i], reflections[i], sides_, z_);
    return true;
  }

  /// z ← f(S) S z, S the Gram matrix of the level: z itself where no eigenvalue lies below the
  /// threshold.
  bool close_with(Index n, const Block& z) noexcept {
    const auto& [s, factor, reflections, square, unused] = system().scratch;
    if (cholesky(n, level_.g, factor, threshold())) return true;
    copy(level_.g, s, n);
    copy_rows(n, sides_, z, side_);
    return system().filter(s, n, side_, z, square);
  }

  LevelRows<Scalar, Regularization> level_;
  Scalar eta_;
  Index dof_{0}, sides_{0};
  Block y_{}, z_{}, side_{};
};

}  // namespace icat::detail
