// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The rows of one level in the free axes, and the inverse that its pseudo-inverse needs.
///
///     B = A^{1/2} J L,   S = BBᵀ or BᵀB, the smaller,   f(S) = f_large(S) + Σ f(σ_i) v_i v_iᵀ
///
/// The sum is over the eigenvalues below the threshold. As one matrix f(S) would lose digits: its
/// large values would meet the rounding of the others.
#pragma once

#include "icat/tpik/projected_system.hpp"

namespace icat::detail {

/// In memory that it is given; nothing allocates.
template <class Scalar, class Regularization>
class LevelRows {
 public:
  using Block = Panel<Scalar>;

  /// Columns of n rows that it needs.
  static constexpr Index columns(Index n, Index sides) {
    return ProjectedSystem<Scalar, Regularization>::columns(n, sides) + 5 * n + 2 * sides + 3;
  }
  LevelRows(const Regularization& regularization, Scalar projection_weight)
      : system(regularization, projection_weight) {}

  void bind(Index n, Index sides, PanelMemory<Scalar>& memory) noexcept {
    dof_ = n;
    sides_ = sides;
    system.bind(n, sides, memory);
    for (Block* b : {&bt, &g, &f, &change, &basis}) *b = memory.take(n);
    for (Block* b : {&e, &rhs}) *b = memory.take(sides);
    for (Scalar** x : {&a, &gains, &inverses}) *x = memory.take(1).data;
  }

  /// Begins a level of `active` rows with a > 0; then `row` for each, then `finish`.
  void begin(Index active) noexcept {
    active_ = active;
    stored_ = 0;
    binary = true;
    vanished = false;
    if (!folds()) return;
    for (Block b : {g, change, triangle(), weighted_triangle()}) clear(b, free());
    clear(rhs, sides_);
  }

  /// Active row `i` of a Jacobian (the first n columns count) and its activation; e is what is
  /// `wanted` of it (sides) less what `current` (n × sides, columns `step` apart) does already,
  /// both times `row_scale`. `N` is n, where that is known at compile time.
  template <int N>
  void row(const Input<Scalar>& jacobian, Index i, Scalar activation, const Scalar* wanted,
           const Scalar* current, Index step, Scalar row_scale) noexcept {
    if (stored_ == dof_) absorb();
    Scalar* x = bt[stored_];
    jacobian.template copy_row<N>(i, dof_, x);
    for (Index c = 0; c < sides_; ++c) {
      e(stored_, c) = row_scale * (wanted[c] - strided_dot<N>(dof_, x, 1, current + c * step));
    }
    if (row_scale != Scalar(1)) scale(dof_, row_scale, x, x);
    binary &= activation == Scalar(1);
    a[stored_++] = activation;
  }

  /// All rows are there. False if anything overflowed.
  bool finish() noexcept {
    absorb();
    rank = std::min(active_, free());
    return invert_gram();
  }
  /// More rows than free axes.
  bool tall() const noexcept { return active_ > free(); }

  /// out = f(S) in, S = g. Large values of f must not meet the rounding of others.
  [[gnu::noinline]] void invert(const Block& in, const Block& out) const noexcept {
    detail::product(Into::set, rank, sides_, rank, f, in, out);
    for (Index i = rank - below; i < rank; ++i) {
      add_projection(rank, inverses[i], basis[i], sides_, in, out);
    }
  }
  /// y ← S f(S) y, S = g: the identity but for the eigenvalues below the threshold.
  [[gnu::noinline]] void filter(const Block& y) const noexcept {
    for (Index i = rank - below; i < rank; ++i) {
      add_projection(rank, gains[i] - Scalar(1), basis[i], sides_, y, y);
    }
  }

  ProjectedSystem<Scalar, Regularization> system;
  Index rank{0};      ///< of S: m without vanished rows, or r of a tall level
  bool binary{true};  ///< all activations are 1
  bool regularized{false};
  bool vanished{false};  ///< zero rows left fewer than there were, and than there are free axes
  Index below{0};        ///< eigenvalues of S below the threshold
  Block bt{}, g{};       ///< Bᵀ, r × m, and S; of a tall level bt is its last chunk of rows
  Block f{}, basis{};    ///< f_large(S); if regularized V, of which the last `below` columns count
  Block change{};        ///< of a tall level that is not binary: C. Of a wide one free: r × r
  Block e{}, rhs{};      ///< A^{3/2} e, m × sides; of a tall level Bᵀ A^{3/2} e
  Scalar *a{}, *gains{}, *inverses{};  ///< activations; σ_i f(σ_i) and f(σ_i)

 private:
  Index free() const noexcept { return system.projector.free(); }
  Scalar threshold() const noexcept { return Scalar(system.regularization.threshold); }
  /// Rows come in chunks; `triangle` keeps R, RᵀR = BᵀB, as Rᵀ.
  bool folds() const noexcept { return active_ > dof_; }
  const Block& triangle() const noexcept { return system.scratch[4]; }
  /// The same of A^{1/2} B.
  const Block& weighted_triangle() const noexcept { return system.scratch[3]; }
  const Block& weighted_rows() const noexcept { return system.scratch[0]; }

  /// Makes the rows gathered so far Bᵀ, and e A^{3/2} e; a tall level sums them up.
  void absorb() noexcept {
    const Index r = free();
    system.projector.turn(stored_, bt);
    system.projector.restrict(stored_, bt);
    if (!folds()) drop_vanished();
    const Index k = stored_;
    if (!binary) {
      for (Index i = 0; i < k; ++i) {
        const Scalar root = std::sqrt(a[i]);
        scale(r, root, bt[i], bt[i]);
        for (Index c = 0; c < sides_; ++c) e(i, c) *= a[i] * root;
      }
    }
    if (!tall()) return gram(r, k, bt, g);
    if (!folds()) {
      product(Into::set, r, r, k, bt, bt, g, By::transpose);
      product(Into::set, r, sides_, k, bt, e, rhs);
      if (binary) return;
      weigh_rows(k);
      return product(Into::set, r, r, k, weighted_rows(), weighted_rows(), change, By::transpose);
    }
    product(Into::add, r, r, k, bt, bt, g, By::transpose);
    product(Into::add, r, sides_, k, bt, e, rhs);
    weigh_rows(k);
    product(Into::add, r, r, k, weighted_rows(), weighted_rows(), change, By::transpose);
    fold(k);
    stored_ = 0;
  }

  /// Rows that are zero on the free axes appear nowhere, like those with a = 0: tasks of the base
  /// where its velocity is given, for one.
  [[gnu::noinline]] void drop_vanished() noexcept {
    Index kept = 0;
    for (Index i = 0; i < active_; ++i) {
      if (bt(0, i) == Scalar(0) && dot(free(), bt[i], bt[i]) == Scalar(0)) continue;
      if (kept++ == i) continue;
      copy(bt.stride, bt[i], bt[kept - 1]);
      for (Index c = 0; c < sides_; ++c) e(kept - 1, c) = e(i, c);
      a[kept - 1] = a[i];
    }
    if (kept == active_) return;
    vanished = kept < std::min(active_, free());
    active_ = stored_ = kept;
    binary = std::count(a, a + kept, Scalar(1)) == kept;
  }
  /// BᵀA^{1/2} of a tall level's chunk.
  [[gnu::noinline]] void weigh_rows(Index k) noexcept {
    for (Index i = 0; i < k; ++i) scale(free(), std::sqrt(a[i]), bt[i], weighted_rows()[i]);
  }
  [[gnu::noinline]] void fold(Index k) noexcept {
    Scalar *w = system.scratch[1].data, *x = system.scratch[2].data;
    detail::fold(free(), k, weighted_rows(), weighted_triangle(), w, x);
    detail::fold(free(), k, bt, triangle(), w, x);
  }

  /// f = f(g) without the eigenvalues below the threshold, which are the last of basis; of a
  /// tall level change = C.
  bool invert_gram() noexcept {
    const Index k = rank;
    below = 0;
    if (k == 0) return true;
    if (k == 1) {
      const Scalar square = g(0, 0);
      regularized = !(square >= threshold());
      const Scalar inverse = system.regularization.inverse(square);
      f(0, 0) = regularized ? Scalar(0) : inverse;
      basis(0, 0) = Scalar(1);
      fill_up(1, f[0]);
      fill_up(1, basis[0]);
      gains[0] = square * inverse;
      inverses[0] = inverse;
      below = regularized ? 1 : 0;
      if (tall()) change(0, 0) = inverse * (binary ? square : change(0, 0));
      return std::isfinite(square);
    }
    copy(g, f, k);
    // The trace of the inverse bounds the inverse of the smallest eigenvalue; a Cholesky factor of
    // g − σ_t I decides.
    if (!detail::invert(k, f, threshold() * smallest)) return invert_spectrally();
    const Scalar inverses_sum = trace(k, f) * threshold();
    if (!(inverses_sum <= Scalar(1) || cholesky(k, g, system.scratch[0], threshold()))) {
      return set_apart(inverses_sum) || invert_spectrally();
    }
    if (tall() && !binary) set_change();
    return true;
  }
  /// change ← f change
  [[gnu::noinline]] void set_change() noexcept {
    const Block& weighted = system.scratch[0];
    copy(change, weighted, rank);
    product(Into::set, rank, rank, rank, f, weighted, change);
  }
  /// F of S = F Fᵀ for a tall level, of S = FᵀF for another.
  [[gnu::cold]] [[gnu::noinline]] Factor<Scalar> factor() const noexcept {
    if (!tall()) return {bt, free(), false};
    return folds() ? Factor<Scalar>{triangle(), free(), true} : Factor<Scalar>{bt, active_, true};
  }
  /// One eigenvalue λ of S below the threshold and its vector v, by power steps of f = S⁻¹. It is
  /// the only one where the trace of f without 1/λ is at most 1/σ_t; `sum` is σ_t times the trace.
  [[gnu::cold]] [[gnu::noinline]] bool set_apart(Scalar sum) noexcept {
    const Index k = rank;
    const Block& work = system.scratch[1];
    Scalar *v = basis[k - 1], *w = work[0];
    // 1/λ is the norm of f, which is at most the root of the sum of its squares.
    Scalar squares(0);
    for (Index j = 0; j < k; ++j) squares += dot(k, f[j], f[j]);
    if (!(sum - threshold() * std::sqrt(squares) <= Scalar(1))) return false;
    if (!dominant_vector(k, f, v, w)) return false;
    const Factor<Scalar> of_g = factor();
    of_g.apply(k, 1, {v, 0}, work.from(1));
    const Scalar value = dot(of_g.rows, work[1], work[1]);
    if (!(value >= smallest * threshold() && sum - threshold() / value <= Scalar(1))) return false;
    // f has errors of ε ‖S‖ / λ², in units of 1 / σ_t at most 1e-8 in double (ε 2²⁵), which the
    // literal formula has not where its inverse is flat.
    constexpr Scalar digits = Scalar(1 << 25);
    if (!(trace(k, g) * threshold() <= digits * value * value)) return false;
    // f ← (I − v vᵀ) f (I − v vᵀ)
    product(Into::set, k, 1, k, f, {v, 0}, {w, 0});
    axpy(k, dot(k, v, w) / Scalar(-2), v, w);
    subtract_symmetric(Index(0), Index(0), k, v, w, f);
    // The reflection of v onto the last axis has v for its last column, but for the sign.
    copy(work.stride, v, w);
    const Scalar tau = Reflection<Scalar>::make(k, w, k - 1).tau;
    clear(basis, k - 1);
    for (Index j = 0; j < k - 1; ++j) basis(j, j) = Scalar(1);
    add_outer(k, k - 1, -tau, w, w, 1, basis);
    below = 1;
    inverses[k - 1] = system.regularization.inverse(value);
    gains[k - 1] = value * inverses[k - 1];
    set_regularized();
    return true;
  }
  [[gnu::cold]] [[gnu::noinline]] bool invert_spectrally() noexcept {
    const Index k = rank;
    const Block& work = system.scratch[1];
    SpectralInverse<Scalar>& spectral = system.spectral;
    copy(g, work, k);
    const Factor<Scalar> of_g = factor();
    if (!spectral.compute(work, k, f, system.regularization, &of_g)) return false;
    below = spectral.below();
    copy(spectral.vectors(), basis, k);
    for (Index i = k - below; i < k; ++i) {
      gains[i] = spectral.gain(i);
      inverses[i] = spectral.inverse(i);
    }
    set_regularized();
    return true;
  }
  /// f, basis, gains and inverses are there.
  [[gnu::cold]] [[gnu::noinline]] void set_regularized() noexcept {
    regularized = below > 0;
    if (!tall() || binary) return;
    // W = BᵀAB = RᵀR, R that of A^{1/2} B or these rows: vᵀW loses digits for small v, (R v)ᵀR does
    // not.
    set_change();
    const Index k = rank, rows = folds() ? k : active_;
    if (!folds()) weigh_rows(rows);
    const Block& weighted = folds() ? weighted_triangle() : weighted_rows();
    for (Index i = k - below; i < k; ++i) {
      const Block v = basis.from(i), rv = system.scratch[1], w = rv.from(1);
      transposed_product(k, rows, 1, weighted, v, rv);
      product(Into::set, k, 1, rows, weighted, rv, w);
      add_outer(k, k, inverses[i], v[0], w[0], 1, change);
    }
  }

  /// Of the threshold: below it eigenvalues are left to SpectralInverse.
  static constexpr Scalar smallest = Scalar(1e-2);
  Index dof_{0}, sides_{0}, active_{0}, stored_{0};
};

}  // namespace icat::detail
