// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One iteration of [Coop, Eq. (22)], shared by `Tpik` and `ParametricTpik`.
///
/// With Q = L Nᵀ, L = N − U Vᵀ (projector.hpp), X = J L, B = A^{1/2} X over the rows of activation
/// a > 0 (a row with a = 0 drops out of Eq. (20) exactly), f the regularized inverse, e = ẋ̄ − J ρ:
///
///     z = f(M) Bᵀ A^{3/2} e,   M = BᵀB + η (I − Q)ᵀ(I − Q)                      W e = X z, Eq.
///     (20) C = X^{#,A,I} X = f(BᵀB) BᵀA B = Bᵀ f(BBᵀ) A B Δ = L C z,        Q ← Q − L C Nᵀ [Eq.
///     (22)]
///
/// How z is found: projected_system.hpp. Derivations: docs/solver.md.
///
/// **Erratum** [Coop, Eq. (20)]: `VᵀHV` is `V H Vᵀ` with M = V Σ Vᵀ.
#pragma once

#include "icat/tpik/projected_system.hpp"

namespace icat::detail {

/// The right-hand side has `sides` columns: ρ alone, or ρ̃ and P side by side. Sizes are run-time
/// values and the memory is somebody else's, so that one body serves all; nothing allocates.
template <class Scalar, class Regularization>
class PriorityIteration {
 public:
  using Block = Panel<Scalar>;
  using System = ProjectedSystem<Scalar, Regularization>;

  /// Columns of n rows that it needs.
  static constexpr Index columns(Index n, Index sides) {
    return System::columns(n, sides) + 5 * n + 6 * sides + 3;
  }

  PriorityIteration(const Regularization& regularization, Scalar projection_weight)
      : system_(regularization, projection_weight), eta_(projection_weight) {}

  void bind(Index n, Index sides, Scalar* memory_of_columns) noexcept {
    dof_ = n;
    sides_ = sides;
    PanelMemory<Scalar> memory(memory_of_columns, n);
    system_.bind(n, sides, memory);
    for (Block* b : {&jt_, &gram_, &f_, &weighted_, &basis_}) *b = memory.take(n);
    for (Block* b : {&increment, &e_, &rhs_, &y_, &z_, &side_}) *b = memory.take(sides);
    a_ = memory.take(1).data;
    gains_ = memory.take(1).data;
    inverses_ = memory.take(1).data;
  }

  Index dof() const noexcept { return dof_; }
  const Projector<Scalar>& projector() const noexcept { return system_.projector; }
  /// The projector, to be reset before the first level.
  Projector<Scalar>& start() noexcept {
    system_.reset();
    return system_.projector;
  }

  /// Begins a level of `active` rows with a > 0; then `row` for each, then `solve`.
  void begin(Index active) noexcept {
    active_ = active;
    stored_ = 0;
    binary_ = true;
    if (!folds()) return;
    for (Block b : {gram_, weighted_, triangle(), weighted_triangle()}) clear(b, free());
    clear(rhs_, sides_);
  }

  /// Active row `i` of a Jacobian (the first n columns count) and its activation; e is what is
  /// `wanted` of it (sides) less what `current` (n × sides, columns `step` apart) does already. `N`
  /// is n, where that is known at compile time.
  template <int N>
  void row(const Input<Scalar>& jacobian, Index i, Scalar a, const Scalar* wanted,
           const Scalar* current, Index step) noexcept {
    if (stored_ == dof_) absorb();
    jacobian.template copy_row<N>(i, dof_, jt_[stored_]);
    for (Index c = 0; c < sides_; ++c) {
      e_(stored_, c) = wanted[c] - jacobian.template row_dot<N>(i, dof_, current + c * step);
    }
    binary_ &= a == Scalar(1);
    a_[stored_++] = a;
  }

  /// Computes `increment`; `accept` then takes over the next projector. False, with nothing
  /// changed, if anything overflowed.
  bool solve() noexcept {
    regularized_ = false;
    if (free() == 0) {
      clear(increment, sides_);
      return true;
    }
    absorb();
    rank_ = std::min(active_, free());
    return invert_gram() && (tall() ? solve_tall() : solve_wide()) && extend();
  }

  /// The projector becomes that after the level solved last.
  void accept() noexcept {
    Projector<Scalar>& projector = system_.projector;
    if (free() == 0) return;
    if (binary_ && !regularized_) {
      tall() ? projector.reset_to_zero() : projector.take(rank_, jt_);
      return;
    }
    if (binary_ && rank_ > 1) {
      accept_regularized();
    } else if (tall()) {
      projector.gain(weighted_);
    } else if (regularized_ || std::find(a_, a_ + rank_, Scalar(1)) == a_ + rank_) {
      accept_partial();
    } else {
      accept_mixed();
    }
    if (projector.vanishes()) projector.reset_to_zero();
  }

  /// A closing level with J = I, A = I [Coop, Eq. (23)] for e = −`current` (n × sides, columns
  /// `step` apart). Nothing may come after it.
  bool close(const Scalar* current, Index step) noexcept {
    if (free() == 0) {
      clear(increment, sides_);
      return true;
    }
    for (Index c = 0; c < sides_; ++c) {
      for (Index i = 0; i < dof_; ++i) e_(i, c) = -current[i + c * step];
      fill_up(dof_, e_[c]);
    }
    Projector<Scalar>& projector = system_.projector;
    projector.turn(sides_, e_);
    projector.restrict(sides_, e_);  // Lᵀ e
    // M is at least η / (1 + η) I, the least of ‖Q x‖² + η ‖x − Q x‖² for ‖x‖ = 1.
    const bool regular = threshold() * (Scalar(1) + eta_) <= eta_;
    if (!projector.orthogonal() && (!regular || 2 * projector.partial() >= free())) {
      projector.become_dense();
    }
    return (projector.dense() ? close_dense(regular) : close_low_rank()) && extend();
  }

  /// A singular value of the last level's XᵀAX, in the span of its rows, lay below the threshold.
  bool regularized() const noexcept { return regularized_; }

  /// Column `j` of Q, n.
  const Scalar* projector_column(Index j) const noexcept {
    clear(z_, 1);
    z_(j, 0) = Scalar(1);
    projector().turn(1, z_);
    projector().extend(1, z_, side_);
    projector().turn_back(1, side_);
    return side_.data;
  }

  Block increment{};  ///< Δ of the level solved last; n × sides

 private:
  Index free() const noexcept { return system_.projector.free(); }
  Scalar threshold() const noexcept { return Scalar(system_.regularization.threshold); }
  bool tall() const noexcept { return active_ > free(); }
  /// Rows come in chunks; `triangle` keeps R, RᵀR = BᵀB, as Rᵀ.
  bool folds() const noexcept { return active_ > dof_; }
  Block triangle() const noexcept { return system_.scratch[4]; }
  /// The same of A^{1/2} B.
  Block weighted_triangle() const noexcept { return system_.scratch[3]; }
  Block weighted_rows() const noexcept { return system_.scratch[0]; }

  /// Makes the rows gathered so far Bᵀ, and e A^{3/2} e; a tall level sums them up.
  void absorb() noexcept {
    const Index k = stored_, r = free();
    system_.projector.turn(k, jt_);
    system_.projector.restrict(k, jt_);
    if (!binary_) {
      for (Index i = 0; i < k; ++i) {
        const Scalar root = std::sqrt(a_[i]);
        scale(r, root, jt_[i], jt_[i]);
        for (Index c = 0; c < sides_; ++c) e_(i, c) *= a_[i] * root;
      }
    }
    if (!tall()) return gram(r, k, jt_, gram_);
    if (!folds()) {
      product<Into::set>(r, r, k, jt_, transposed(jt_), gram_);
      product<Into::set>(r, sides_, k, jt_, elements(e_), rhs_);
      if (binary_) return;
      weigh_rows(k);
      return product<Into::set>(r, r, k, weighted_rows(), transposed(weighted_rows()), weighted_);
    }
    product<Into::add>(r, r, k, jt_, transposed(jt_), gram_);
    product<Into::add>(r, sides_, k, jt_, elements(e_), rhs_);
    weigh_rows(k);
    product<Into::add>(r, r, k, weighted_rows(), transposed(weighted_rows()), weighted_);
    fold(k);
    stored_ = 0;
  }

  /// BᵀA^{1/2} of a tall level's chunk.
  void weigh_rows(Index k) noexcept {
    for (Index i = 0; i < k; ++i) scale(free(), std::sqrt(a_[i]), jt_[i], weighted_rows()[i]);
  }
  void fold(Index k) noexcept {
    Scalar *w = system_.scratch[1].data, *x = system_.scratch[2].data;
    if (!binary_ || folds()) detail::fold(free(), k, weighted_rows(), weighted_triangle(), w, x);
    detail::fold(free(), k, jt_, triangle(), w, x);
  }

  /// f_ = f(gram_) without the eigenvalues below the threshold, which are the last of basis_; of a
  /// tall level weighted_ = C.
  bool invert_gram() noexcept {
    const Index k = rank_;
    below_ = 0;
    if (k == 1) {
      const Scalar g = gram_(0, 0);
      regularized_ = !(g >= threshold());
      const Scalar f = system_.regularization.inverse(g);
      f_(0, 0) = regularized_ ? Scalar(0) : f;
      basis_(0, 0) = Scalar(1);
      fill_up(1, f_[0]);
      fill_up(1, basis_[0]);
      gains_[0] = g * f;
      inverses_[0] = f;
      below_ = regularized_ ? 1 : 0;
      if (tall()) weighted_(0, 0) = f * (binary_ ? g : weighted_(0, 0));
      return std::isfinite(g);
    }
    copy(gram_, f_, k);
    // The trace of the inverse bounds the inverse of the smallest eigenvalue; a Cholesky factor of
    // gram_ − σ_t I decides.
    if (!detail::invert(k, f_, threshold()) ||
        !(trace(k, f_) * threshold() <= Scalar(1) ||
          cholesky(k, gram_, system_.scratch[0], threshold()))) {
      return invert_spectrally();
    }
    if (tall() && !binary_) set_change(f_);
    return true;
  }
  void set_change(Block f) noexcept {
    const Block change = system_.scratch[0];
    product<Into::set>(rank_, rank_, rank_, f, elements(weighted_), change);
    copy(change, weighted_, rank_);
  }
  bool invert_spectrally() noexcept {
    const Index k = rank_;
    const Block work = system_.scratch[1];
    SpectralInverse<Scalar>& spectral = system_.spectral;
    if (tall() && !folds()) {
      clear(triangle(), k);
      clear(weighted_triangle(), k);
      weigh_rows(active_);
      fold(active_);
    }
    if (tall()) transpose(k, k, triangle(), basis_);
    copy(gram_, work, k);
    if (!spectral.compute(work, k, f_, system_.regularization, tall() ? &basis_ : &jt_,
                          tall() ? k : free())) {
      return false;
    }
    below_ = spectral.below();
    regularized_ = below_ > 0;
    copy(spectral.vectors(), basis_, k);
    for (Index i = k - below_; i < k; ++i) {
      gains_[i] = spectral.gain(i);
      inverses_[i] = spectral.inverse(i);
    }
    if (tall() && !binary_) {
      // W = BᵀAB = RᵀR, R that of A^{1/2} B: vᵀW loses digits for small v, (R v)ᵀR does not.
      set_change(f_);
      for (Index i = k - below_; i < k; ++i) {
        const Block v = basis_.from(i), rv = work, w = work.from(1);
        transposed_product(k, k, 1, weighted_triangle(), v, rv);
        product<Into::set>(k, 1, k, weighted_triangle(), elements(rv), w);
        for (Index j = 0; j < k; ++j) axpy(k, spectral.inverse(i) * w(j, 0), v[0], weighted_[j]);
      }
    }
    return true;
  }
  /// out = f(S) in, S = gram_. Large values of f must not meet the rounding of others.
  void invert(Block in, Block out) const noexcept {
    detail::product<Into::set>(rank_, sides_, rank_, f_, elements(in), out);
    for (Index c = 0; c < sides_; ++c) {
      for (Index i = rank_ - below_; i < rank_; ++i) {
        axpy(rank_, inverses_[i] * dot(rank_, basis_[i], in[c]), basis_[i], out[c]);
      }
    }
  }
  /// y ← S f(S) y, S = gram_: the identity but for the eigenvalues below the threshold.
  void filter(Block y) const noexcept {
    for (Index c = 0; c < sides_; ++c) {
      for (Index i = rank_ - below_; i < rank_; ++i) {
        axpy(rank_, (gains_[i] - Scalar(1)) * dot(rank_, basis_[i], y[c]), basis_[i], y[c]);
      }
    }
  }

  /// z_ ← C z = Bᵀ f(BBᵀ) A y, y = B z
  bool solve_wide() noexcept {
    const Index r = free(), m = rank_;
    if (system_.projector.orthogonal() || (!regularized_ && system_.independent(m, jt_, f_))) {
      if (binary_ && !regularized_) {
        apply_wide(e_);
        return true;
      }
      for (Index c = 0; c < sides_; ++c) {
        std::copy_n(e_[c], m, y_[c]);
        fill_up(m, y_[c]);
      }
      if (regularized_) filter(y_);
    } else {
      const Block btb = weighted_;
      product<Into::set>(r, sides_, m, jt_, elements(e_), rhs_);
      product<Into::set>(r, r, m, jt_, transposed(jt_), btb);
      if (system_.regular(btb, rhs_, z_)) {
        transposed_product(r, m, sides_, jt_, z_, y_);
      } else if (system_.reduces(m)) {
        if (!system_.reduced(m, jt_, e_, y_)) return false;
      } else {
        if (!system_.full(btb, rhs_, z_)) return false;
        transposed_product(r, m, sides_, jt_, z_, y_);
      }
    }
    for (Index c = 0; c < sides_; ++c) {
      for (Index i = 0; i < m; ++i) y_(i, c) *= a_[i];
    }
    apply_wide(y_);
    return true;
  }
  void apply_wide(Block y) noexcept {
    invert(y, side_);
    product<Into::set>(free(), sides_, rank_, jt_, elements(side_), z_);
  }

  /// z_ ← C z = f(BᵀB) BᵀA B z
  bool solve_tall() noexcept {
    const Index r = free();
    if (system_.projector.orthogonal()) {
      invert(rhs_, z_);
    } else if ((regularized_ || !system_.corrected(f_, rhs_, z_)) &&
               !system_.regular(gram_, rhs_, z_) && !system_.full(gram_, rhs_, z_)) {
      return false;
    }
    if (binary_) {
      if (regularized_) filter(z_);
      return true;
    }
    copy(z_, side_, sides_);
    product<Into::set>(r, sides_, r, weighted_, elements(side_), z_);
    return true;
  }

  /// increment = L z_, in the axes that all began with.
  bool extend() noexcept {
    system_.projector.extend(sides_, z_, increment);
    system_.projector.turn_back(sides_, increment);
    return all_finite(sides_ * increment.stride, increment.data);
  }

  /// No row leaves: L C = (L B⁺) A B with B⁺ = Bᵀ f(BBᵀ).
  void accept_partial() noexcept {
    const auto& [left, u, w, unused, unused1] = system_.scratch;
    product<Into::set>(free(), rank_, rank_, jt_, elements(f_), left);
    for (Index i = rank_ - below_; i < rank_; ++i) {
      product<Into::set>(free(), 1, rank_, jt_, elements(basis_.from(i)), w);
      for (Index j = 0; j < rank_; ++j) axpy(free(), inverses_[i] * basis_(j, i), w[0], left[j]);
    }
    system_.projector.extend(rank_, left, u);
    for (Index i = 0; i < rank_; ++i) scale(free(), a_[i], jt_[i], jt_[i]);
    system_.projector.gain(rank_, u, jt_);
  }

  /// Binary rows, of which V = [v_i] belongs to the eigenvalues σ_i of BBᵀ or BᵀB below the
  /// threshold: C is the projector on the rows with σ_i f(σ_i) instead of 1 in the directions v_i,
  /// or Bᵀ v_i / √σ_i. The others leave.
  void accept_regularized() noexcept {
    const auto& [rows, u, v, unused, unused1] = system_.scratch;
    const Index r = free(), rest = rank_ - below_;
    if (tall()) {
      copy(basis_, rows, rank_);
    } else {
      product<Into::set>(r, rank_, rank_, jt_, elements(basis_), rows);
      for (Index i = rest; i < rank_; ++i) {
        const Scalar square = dot(r, rows[i], rows[i]);
        scale(r, square > Scalar(0) ? Scalar(1) / std::sqrt(square) : Scalar(0), rows[i], rows[i]);
      }
    }
    system_.projector.extend(below_, rows.from(rest), u);
    for (Index i = 0; i < below_; ++i) scale(u.stride, gains_[rest + i], u[i], u[i]);
    copy(rows.from(rest), v, below_);
    system_.projector.gain(below_, u, v);
    system_.projector.take(rest, rows);
  }

  /// Binary rows leave. With B⁺ = Bᵀ G⁻¹ and b, p the binary and the partial rows, V gains B⁺_p, U
  /// gains L Bᵀ_p − L Bᵀ (G⁻¹)_p (1 − A_p) G_pp, and the free axes lose B⁺_b.
  void accept_mixed() noexcept {
    const auto& [left, lb, weights, u, v] = system_.scratch;
    const Index m = rank_;
    product<Into::set>(free(), m, m, jt_, elements(f_), left);
    system_.projector.extend(m, jt_, lb);
    Index binary = 0, partial = 0;
    for (Index i = 0; i < m; ++i) {
      if (a_[i] == Scalar(1)) {
        std::copy_n(left[i], left.stride, jt_[binary++]);
        continue;
      }
      Scalar* w = weights[partial];
      std::fill_n(w, weights.stride, Scalar(0));
      for (Index j = 0; j < m; ++j) {
        if (a_[j] < Scalar(1)) axpy(m, (Scalar(1) - a_[j]) * gram_(j, i), f_[j], w);
      }
      std::copy_n(lb[i], lb.stride, u[partial]);
      std::copy_n(left[i], left.stride, v[partial++]);
    }
    product<Into::subtract>(system_.projector.reach(), partial, m, lb, elements(weights), u);
    system_.projector.gain(partial, u, v);
    system_.projector.take(binary, jt_);
  }

  /// All axes: L is b × r.
  bool close_dense(bool regular) noexcept {
    Projector<Scalar>& projector = system_.projector;
    const auto& [l, m, factor, shifted, unused] = system_.scratch;
    const Index r = free();
    for (Index j = 0; j < r; ++j) {
      scale(l.stride, Scalar(-1), projector.u()[j], l[j]);
      l(j, j) += Scalar(1);
    }
    gram(projector.reach(), r, l, gram_);
    if (regular) {
      projector.weigh();
      for (Index j = 0; j < r; ++j) {
        combine(r, eta_, projector.k_free()[j], Scalar(1), gram_[j], m[j]);
      }
      if (!cholesky(r, m, factor)) return false;
      system_.solve(r, factor, e_, z_);
    } else if (!system_.full(gram_, e_, z_)) {
      return false;
    }
    return close_with(r, z_);
  }

  /// Only the span Y of V and U_N differs from Q = I: with Y R = [V U_N] and K = UᵀU, LᵀL on it is
  /// I − R_V R_Uᵀ − R_U R_Vᵀ + R_V K R_Vᵀ, and M without the taken axes has η R_V K₀ R_Vᵀ more.
  bool close_low_rank() noexcept {
    Projector<Scalar>& projector = system_.projector;
    const auto& [m, triangle_, reflections, rk, factor] = system_.scratch;
    const Index r = free(), p = projector.partial(), d = 2 * p;
    const Scalar f = system_.regularization.inverse(Scalar(1));
    Scalar* tau = a_;
    if (p > 0) {
      copy(projector.v(), triangle_, p);
      for (Index c = 0; c < p; ++c) {
        std::copy_n(projector.u()[c], r, triangle_[p + c]);
        std::fill_n(triangle_[p + c] + r, triangle_.stride - r, Scalar(0));
      }
      triangularize(r, d, triangle_, reflections, tau);
      const Block ru = triangle_.from(p);
      clear(gram_, d);
      for (Index j = 0; j < d; ++j) gram_(j, j) = Scalar(1);
      product<Into::subtract>(d, d, p, triangle_, transposed(ru), gram_);
      product<Into::subtract>(d, d, p, ru, transposed(triangle_), gram_);
      projector.weigh();
      system_.add_weighted(d, triangle_, projector.k_free(), Scalar(1), rk, gram_);
      if (projector.reach() > r) {
        system_.add_weighted(d, triangle_, projector.k_taken(), Scalar(1), rk, gram_);
      }
      copy(gram_, m, d);
      system_.add_weighted(d, triangle_, projector.k_free(), eta_, rk, m);
      for (Index c = 0; c < sides_; ++c) {
        for (Index i = 0; i < d; ++i) reflect_from(i, r, tau[i], reflections[i], e_[c]);
      }
      if (!cholesky(d, m, factor)) return false;
      system_.solve(d, factor, e_, z_);
      if (!close_with(d, z_)) return false;
    }
    for (Index c = 0; c < sides_; ++c) {
      for (Index i = d; i < r; ++i) z_(i, c) = f * f * e_(i, c);
      fill_up(r, z_[c]);
      for (Index i = d; i-- > 0;) reflect_from(i, r, tau[i], reflections[i], z_[c]);
    }
    return true;
  }

  /// z ← f(S) S z, S = gram_: z itself where no eigenvalue lies below the threshold.
  bool close_with(Index n, Block z) noexcept {
    const auto& [s, factor, reflections, square, unused] = system_.scratch;
    if (cholesky(n, gram_, factor, threshold())) return true;
    product<Into::set>(n, sides_, n, gram_, elements(z), side_);
    copy(gram_, s, n);
    return system_.regularize(s, n, side_, z, square);
  }

  System system_;
  Scalar eta_;
  Index dof_{0}, sides_{0};
  Index active_{0}, stored_{0}, rank_{0};  // rows of the present level; of gram_
  bool binary_{true}, regularized_{false};
  Block jt_{}, gram_{};     // Bᵀ, r × m, and BBᵀ; of a tall level a chunk, and BᵀB
  Block f_{}, weighted_{};  // f(gram_); of a tall level BᵀA B, then C
  Block e_{}, rhs_{}, y_{}, z_{}, side_{};
  Block basis_{};  // eigenvectors of gram_, if regularized; the last below_ with small eigenvalues
  Index below_{0};
  Scalar *a_{}, *gains_{}, *inverses_{};  // activations; σ f(σ) and f(σ) of those
};

/// With memory of its own, for `N` degrees of freedom. Construction of dynamic size allocates;
/// nothing else does.
template <class Scalar, int N, int Sides, class Regularization>
class StoredIteration : public PriorityIteration<Scalar, Regularization> {
  using Base = PriorityIteration<Scalar, Regularization>;

 public:
  using Square = Eigen::Matrix<Scalar, N, N>;

  [[gnu::cold]] StoredIteration(Index dof, const Regularization& regularization,
                                Scalar projection_weight)
      : Base(regularization, projection_weight), projector_(dof, dof) {
    if constexpr (N == Eigen::Dynamic) memory_ = zeros<Memory>(size(dof));
    this->bind(dof, Sides, memory_.data());
    this->start().reset();
  }
  StoredIteration(const StoredIteration& other)
      : Base(other), memory_(other.memory_), projector_(other.projector_) {
    this->bind(other.dof(), Sides, memory_.data());
  }
  StoredIteration& operator=(const StoredIteration& other) {
    Base::operator=(other);
    memory_ = other.memory_;
    this->bind(other.dof(), Sides, memory_.data());
    return *this;
  }

  /// Q, n × n: formed when asked for.
  [[gnu::cold]] const Square& projector_matrix() const noexcept {
    for (Index j = 0; j < this->dof(); ++j) {
      const Scalar* column = this->projector_column(j);
      std::copy_n(column, this->dof(), projector_.data() + j * this->dof());
    }
    return projector_;
  }

 private:
  static constexpr Index size(Index n) { return Base::columns(n, Sides) * padded<Scalar>(n); }
  struct Fixed {
    alignas(typename Simd<Scalar>::Packet) Scalar values[N == Eigen::Dynamic ? 1 : size(N)]{};
    Scalar* data() noexcept { return values; }
  };
  using Memory = std::conditional_t<N == Eigen::Dynamic, Vector<Scalar, Eigen::Dynamic>, Fixed>;

  Memory memory_;
  mutable Square projector_;
};

}  // namespace icat::detail
