// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One iteration of [Coop, Eq. (22)], shared by `Tpik` and `ParametricTpik`.
///
/// With X = J Q and B = A^{1/2} X over the rows of activation a > 0 (a row with a = 0 drops out of
/// Eq. (20) exactly), f the regularized inverse, e = ẋ̄ − J ρ:
///
///     z = f(BᵀB + η (I − Q)ᵀ(I − Q)) Bᵀ A^{3/2} e                             W e = X z, Eq. (20)
///     C = X^{#,A,I} X = f(BᵀB) BᵀA B = Bᵀ f(BBᵀ) A B
///     Δ = Q C z,        Q ← Q − Q C                                                   [Eq. (22)]
///
/// **Coordinates.** While every level is binary, of full rank and not regularized, Q is an
/// orthogonal projector. Reflections then turn the axes so that Q keeps the first r of them; later
/// levels work on those r alone. In these coordinates Q = I − Z (r × r), and Z = 0 until a level is
/// partial or regularized. While Z = 0, f(BᵀB) Bᵀ = Bᵀ f(BBᵀ) is all that z needs. Then rows touch
/// the first t axes, outside of which Z stays 0.
///
/// See docs/solver.md for the derivations.
///
/// **Erratum** [Coop, Eq. (20)]: `VᵀHV` is `V H Vᵀ` with M = V Σ Vᵀ.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "icat/math/panel.hpp"
#include "icat/math/regularization.hpp"
#include "icat/math/spectral_inverse.hpp"
#include "icat/tpik/level_check.hpp"

namespace icat::detail {

/// The right-hand side has `Columns` columns: ρ alone, or ρ̃ and P side by side.
template <class Scalar, int N, int Columns, class Regularization>
class PriorityIteration {
 public:
  using Square = Eigen::Matrix<Scalar, N, N>;
  using Coefficients = Panel<Scalar, N, Columns>;

  [[gnu::cold]] PriorityIteration(Index dof, const Regularization& regularization,
                                  Scalar projection_weight)
      : increment(zero_panel<Coefficients>(dof, Columns)),
        regularization_(regularization),
        eta_(projection_weight),
        dof_(dof),
        free_(dof),
        a_(zeros<Vector<Scalar, N>>(dof)),
        tau_(a_),
        reflectors_(zero_panel<Panel_>(dof, dof)),
        z_(reflectors_),
        k_(reflectors_),
        jt_(reflectors_),
        gram_(reflectors_),
        weighted_(reflectors_),
        left_(reflectors_),
        right_(reflectors_),
        u_(reflectors_),
        m_(reflectors_),
        f_(reflectors_),
        shifted_(reflectors_),
        e_(increment),
        c_(increment),
        image_(increment),
        small_(increment),
        spectral_(dof),
        projector_(dof, dof) {}

  Index dof() const noexcept { return dof_; }

  /// Q = I.
  void reset() noexcept {
    free_ = dof_;
    touched_ = 0;
    plain_ = true;
    small_eigenvalues_ = false;
  }

  /// Q = 0.
  void reset_to_zero() noexcept {
    reset();
    take_all();
  }

  /// Q = `Q0`. Zeros and ones on a diagonal [Coop, Eq. (31)] are a choice of coordinates.
  void reset(const Input<Scalar>& Q0) noexcept {
    reset();
    bool chooses = true;
    for (Index j = 0; j < dof_; ++j) {
      for (Index i = 0; i < dof_; ++i) {
        chooses &= Q0(i, j) == Scalar(0) || (i == j && Q0(i, j) == Scalar(1));
      }
    }
    if (chooses) {
      for (Index i = dof_; i-- > 0;) {
        if (Q0(i, i) == Scalar(0)) drop(i);
      }
      return;
    }
    plain_ = k_is_valid_ = false;
    touch_all();
    for (Index j = 0; j < dof_; ++j) {
      for (Index i = 0; i < dof_; ++i) z_(i, j) = (i == j ? Scalar(1) : Scalar(0)) - Q0(i, j);
    }
  }

  /// Begins a level of `active` rows with a > 0; then `row` for each, then `solve`.
  void begin(Index active) noexcept {
    active_ = active;
    stored_ = 0;
    binary_ = true;
    if (tall()) {
      clear(gram_, free_);
      clear(weighted_, free_);
      clear(c_, Columns);
    }
  }

  /// Active row `i` of a Jacobian (the first n columns count) and its activation; e is what is
  /// `wanted` of it (1 × Columns) less what `current` (n × Columns) does already.
  template <class Current>
  void row(const Input<Scalar>& jacobian, Index i, Scalar a, const Scalar* wanted,
           const Current& current) noexcept {
    if (stored_ == dof_) absorb();
    jacobian.template copy_row<N>(i, dof_, at(jt_, stored_));
    // Eigen stores a single row by rows.
    const Index step = Current::IsRowMajor ? 1 : current.outerStride();
    for (Index c = 0; c < Columns; ++c) {
      const Scalar* y = current.data() + c * step;
      e_(stored_, c) = wanted[c] - jacobian.template row_dot<N>(i, dof_, y);
    }
    binary_ &= a == Scalar(1);
    a_(stored_++) = a;
  }

  /// Computes `increment` (Δ, n × Columns); `accept` then takes over the next projector.
  /// False, with nothing changed, if anything overflowed.
  bool solve() noexcept {
    clear(increment, Columns);
    regularized_ = shrinks_ = false;
    if (free_ == 0) return true;
    absorb();
    rank_ = std::min(active_, free_);
    if (!invert_gram()) return false;
    shrinks_ = plain_ && binary_ && !regularized_;
    if (!shrinks_) touch();
    const Index n = shrinks_ ? free_ : touched_;
    // C = left_ right_ᵀ, as (Bᵀ f(BBᵀ)) (A B) or f(BᵀB) (BᵀA B)
    if (tall()) {
      copy(f_, left_, n);
    } else {
      product<Into::set>(n, rank_, rank_, jt_, elements(f_), left_);
    }
    if (shrinks_) {  // C z = z
      product<Into::set>(n, Columns, rank_, left_, elements(tall() ? c_ : e_), increment);
    } else {
      copy(left_, u_, rank_);
      if (plain_) {
        product<Into::set>(n, Columns, rank_, left_, elements(tall() ? c_ : e_), image_);
      } else {
        if (!tall()) product<Into::set>(n, Columns, rank_, jt_, elements(e_), c_);
        set_m(tall() ? gram_ : jt_, !tall());
        if (!regularize(c_, image_)) return false;
        product<Into::subtract>(n, rank_, n, z_, elements(left_), u_);
      }
      if (tall()) {
        copy(weighted_, right_, n);
      } else {
        for (Index k = 0; k < rank_; ++k) scale(n, a_(k), at(jt_, k), at(right_, k));
      }
      transposed_product(n, rank_, Columns, right_, image_, small_);
      product<Into::set>(n, Columns, rank_, u_, elements(small_), increment);
      // Every element of both factors of C takes part in Δ: if Δ is finite, so are they.
    }
    turn_back(increment, Columns);
    return finite(increment, Columns);
  }

  /// The projector becomes that after the level solved last.
  void accept() noexcept {
    if (free_ == 0) return;
    if (shrinks_) {
      shrink();
      return;
    }
    if (plain_) {
      clear(z_, free_);
      clear(k_, free_);
      plain_ = false;
      k_is_valid_ = true;
    }
    update_k();
    product<Into::add>(touched_, touched_, rank_, u_, transposed(right_), z_);
    if (nothing_left()) take_all();
  }

  /// A closing level with J = I, A = I [Coop, Eq. (23)] for e = −`current` (n × Columns). The
  /// projector is not touched: nothing comes after it.
  template <class Current>
  bool close(const Current& current) noexcept {
    clear(increment, Columns);
    if (free_ == 0) return true;
    for (Index c = 0; c < Columns; ++c) {
      for (Index i = 0; i < dof_; ++i) c_(i, c) = -current(i, c);
    }
    turn(c_, Columns);
    // Where nothing was touched, X = Q = 1, so that Q X^{#,I,I} W = f(1)².
    const Index n = touched_;
    const Scalar f = regularization_.inverse(Scalar(1));
    for (Index c = 0; c < Columns; ++c) {
      for (Index i = n; i < free_; ++i) increment(i, c) = f * f * c_(i, c);
    }
    if (n > 0) {
      for (Index j = 0; j < n; ++j) {  // X = I − Z
        scale(n, Scalar(-1), at(z_, j), at(left_, j));
        left_(j, j) += Scalar(1);
      }
      gram(n, n, left_, gram_);
      transposed_product(n, n, Columns, left_, c_, small_);
      set_m(gram_, false);
      if (!regularize(small_, image_)) return false;
      product<Into::set>(n, Columns, n, gram_, elements(image_), c_);
      copy(gram_, m_, n);
      if (!spectral(c_, image_)) return false;
      product<Into::set>(n, Columns, n, left_, elements(image_), small_);
      for (Index c = 0; c < Columns; ++c) std::copy_n(at(small_, c), n, at(increment, c));
    }
    turn_back(increment, Columns);
    return finite(increment, Columns);
  }

  /// A singular value of the last level's XᵀAX, in the span of its rows, lay below the threshold.
  bool regularized() const noexcept { return regularized_; }

  /// Q, n × n: formed when asked for.
  [[gnu::cold]] const Square& projector() const noexcept {
    for (Index j = 0; j < dof_; ++j) {  // column j of Q = H (I − Z) Hᵀ
      clear(image_, 1);
      image_(j, 0) = Scalar(1);
      turn(image_, 1);
      std::copy_n(image_.data(), image_.outerStride(), small_.data());
      if (!plain_) {
        product<Into::subtract>(touched_, 1, touched_, z_, elements(image_), small_);
      }
      turn_back(small_, 1);
      for (Index i = 0; i < dof_; ++i) projector_(i, j) = small_(i, 0);
    }
    return projector_;
  }

  Coefficients increment;  ///< Δ of the level solved last; n rows

 private:
  using Panel_ = Panel<Scalar, N>;

  template <class P>
  static auto at(P& p, Index column) noexcept {
    return p.data() + column * p.outerStride();
  }
  template <class P>
  static void clear(P& p, Index columns) noexcept {
    std::fill_n(p.data(), columns * p.outerStride(), Scalar(0));
  }
  static void copy(const Panel_& from, Panel_& to, Index columns) noexcept {
    std::copy_n(from.data(), columns * from.outerStride(), to.data());
  }
  template <class P>
  static bool finite(const P& p, Index columns) noexcept {
    return all_finite(columns * p.outerStride(), p.data());
  }

  bool tall() const noexcept { return active_ > free_; }

  /// To the present coordinates, of which only the free ones are kept.
  template <class P>
  void turn(P& p, Index columns) const noexcept {
    for (Index i = dof_; i-- > free_;) {
      if (tau_(i) == Scalar(0)) continue;
      for (Index c = 0; c < columns; ++c) reflect(i + 1, tau_(i), at(reflectors_, i), at(p, c));
    }
    for (Index c = 0; c < columns; ++c) {
      std::fill_n(at(p, c) + free_, dof_ - free_, Scalar(0));
    }
    for (Index i = 0; i < touched_; ++i) {
      if (tau_(i) == Scalar(0)) continue;
      for (Index c = 0; c < columns; ++c) {
        const Index top = packet_begin<Scalar>(i);
        reflect(free_ - top, tau_(i), at(reflectors_, i) + top, at(p, c) + top);
      }
    }
  }
  template <class P>
  void turn_back(P& p, Index columns) const noexcept {
    for (Index i = touched_; i-- > 0;) {
      if (tau_(i) == Scalar(0)) continue;
      for (Index c = 0; c < columns; ++c) {
        const Index top = packet_begin<Scalar>(i);
        reflect(free_ - top, tau_(i), at(reflectors_, i) + top, at(p, c) + top);
      }
    }
    for (Index i = free_; i < dof_; ++i) {
      if (tau_(i) == Scalar(0)) continue;
      for (Index c = 0; c < columns; ++c) reflect(i + 1, tau_(i), at(reflectors_, i), at(p, c));
    }
  }

  /// Makes the rows gathered so far Bᵀ, and e A^{3/2} e; sums them up.
  void absorb() noexcept {
    const Index k = stored_;
    turn(jt_, k);
    if (touched_ > 0) {
      transposed_product(touched_, touched_, k, z_, jt_, left_);
      for (Index i = 0; i < k; ++i) axpy(touched_, Scalar(-1), at(left_, i), at(jt_, i));
    }
    if (!binary_) {
      for (Index i = 0; i < k; ++i) {
        const Scalar root = std::sqrt(a_(i));
        scale(free_, root, at(jt_, i), at(jt_, i));
        for (Index c = 0; c < Columns; ++c) e_(i, c) *= a_(i) * root;
      }
    }
    if (!tall()) {
      gram(free_, k, jt_, gram_);
      return;
    }
    product<Into::add>(free_, free_, k, jt_, transposed(jt_), gram_);
    product<Into::add>(free_, Columns, k, jt_, elements(e_), c_);
    for (Index i = 0; i < k; ++i) scale(free_, a_(i), at(jt_, i), at(left_, i));
    product<Into::add>(free_, free_, k, left_, transposed(jt_), weighted_);
    stored_ = 0;
  }

  /// Turns the untouched axes so that the level's rows touch only one more each.
  void touch() noexcept {
    if (tall()) {
      touch_all();
      return;
    }
    for (Index k = 0; k < rank_ && touched_ < free_; ++k) {
      const Index t = touched_, top = packet_begin<Scalar>(t), n = free_ - top;
      Scalar* x = at(jt_, k);
      Scalar* v = at(reflectors_, t);
      std::fill_n(v + top, t - top, Scalar(0));
      std::copy_n(x + t, free_ - t, v + t);
      fill_up(free_, v);
      const auto r = Reflection<Scalar>::make(n, v + top, t - top);
      std::fill_n(x + t, free_ - t, Scalar(0));
      // Rounding is no direction: the row lies in what is touched already.
      if (r.length * r.length <= square_of_rounding() * gram_(k, k)) continue;
      x[t] = r.length;
      tau_(t) = r.tau;
      for (Index c = k + 1; c < rank_; ++c) reflect(n, r.tau, v + top, at(jt_, c) + top);
      ++touched_;
    }
  }
  void touch_all() noexcept {
    for (; touched_ < free_; ++touched_) tau_(touched_) = Scalar(0);
  }
  Scalar square_of_rounding() const noexcept {
    const Scalar rounding = Scalar(dof_) * std::numeric_limits<Scalar>::epsilon();
    return rounding * rounding;
  }

  /// f_ = f(gram_), k × k.
  bool invert_gram() noexcept {
    const Index k = rank_;
    if (k == 1) {
      const Scalar g = gram_(0, 0);
      regularized_ = !(g >= regularization_.threshold);
      clear(f_, 1);
      f_(0, 0) = regularization_.inverse(g);
      return std::isfinite(g);
    }
    copy(gram_, f_, k);
    if (invert(f_, k)) return true;
    copy(gram_, m_, k);
    if (!spectral_.compute(m_, k, f_, regularization_, tall() ? nullptr : &jt_, free_))
      return false;
    regularized_ = spectral_.below() > 0;
    return true;
  }

  /// Gauss and Jordan's inverse of a positive definite matrix. True if no eigenvalue can lie below
  /// the threshold, since the trace of the inverse bounds the inverse of the smallest.
  bool invert(Panel_& s, Index k) const noexcept {
    const Scalar threshold = regularization_.threshold;
    for (Index p = 0; p < k; ++p) {
      const Scalar pivot = s(p, p);  // a Schur complement, so no smaller than any eigenvalue
      if (!(pivot >= threshold)) return false;
      s(p, p) = Scalar(1);
      scale(k, Scalar(1) / pivot, at(s, p), at(s, p));
      for (Index j = 0; j < k; ++j) {
        if (j == p) continue;
        const Scalar factor = -s(p, j);
        s(p, j) = Scalar(0);
        axpy(k, factor, at(s, p), at(s, j));
      }
    }
    Scalar trace(0);
    for (Index p = 0; p < k; ++p) trace += s(p, p);
    return trace * threshold <= Scalar(1);
  }

  void make_k() noexcept {
    if (k_is_valid_) return;
    gram(touched_, touched_, z_, k_);
    k_is_valid_ = true;
  }

  /// m_ = η ZᵀZ + (Bᵀ B or G)
  void set_m(const Panel_& b_or_gram, bool factor) noexcept {
    make_k();
    const Index n = touched_;
    if (factor) {
      for (Index j = 0; j < n; ++j) scale(n, eta_, at(k_, j), at(m_, j));
      product<Into::add>(n, n, rank_, b_or_gram, transposed(b_or_gram), m_);
    } else {
      for (Index j = 0; j < n; ++j) {
        combine(n, eta_, at(k_, j), Scalar(1), at(b_or_gram, j), at(m_, j));
      }
    }
    for (Index j = 0; j < n; ++j) fill_up(n, at(m_, j));
  }

  /// K = ZᵀZ, where Z grows by U Vᵀ of few columns: K + P Vᵀ + V Pᵀ, P = ZᵀU + V (UᵀU) / 2.
  void update_k() noexcept {
    const Index n = touched_;
    k_is_valid_ = k_is_valid_ && 3 * rank_ <= n;
    if (!k_is_valid_) return;
    transposed_product(n, n, rank_, z_, u_, left_);
    gram(n, rank_, u_, gram_);
    for (Index j = 0; j < rank_; ++j) scale(rank_, Scalar(0.5), at(gram_, j), at(gram_, j));
    product<Into::add>(n, rank_, rank_, right_, elements(gram_), left_);
    product<Into::add>(n, n, rank_, left_, transposed(right_), k_);
    product<Into::add>(n, n, rank_, right_, transposed(left_), k_);
  }

  /// out = f(m_) in, up to what m_ maps to zero; m_ is overwritten.
  bool regularize(const Coefficients& in, Coefficients& out) noexcept {
    // Where m_ − σ_t I has a Cholesky factor, f is the inverse. Both factors at a time: each is
    // one long chain of operations that wait for each other.
    const Index n = touched_;
    bool regular = !small_eigenvalues_;
    for (Index j = 0; j < n && regular; ++j) {
      regular = cholesky_column(n, j, m_, Scalar(regularization_.threshold), shifted_) &&
                cholesky_column(n, j, m_, Scalar(0), f_);
    }
    if (regular) {
      for (Index c = 0; c < Columns; ++c) {
        std::copy_n(at(in, c), n, at(small_, c));
        fill_up(n, at(small_, c));
        cholesky_solve(n, f_, at(small_, c), at(out, c));
      }
      return finite(out, Columns);
    }
    if (!spectral(in, out)) return false;
    small_eigenvalues_ = spectral_.below() > 0;
    return true;
  }

  /// out = f(m_) in; m_ is overwritten.
  bool spectral(const Coefficients& in, Coefficients& out) noexcept {
    if constexpr (Columns == 1) {
      return spectral_.apply(m_, touched_, in.data(), out.data(), regularization_);
    } else {
      if (!spectral_.compute(m_, touched_, f_, regularization_)) return false;
      product<Into::set>(touched_, Columns, touched_, f_, elements(in), out);
      return true;
    }
  }

  /// Drops coordinate i by exchanging it with the last free one, a reflection too.
  void drop(Index i) noexcept {
    const Index last = --free_;
    tau_(last) = Scalar(0);
    if (i == last) return;
    std::fill_n(at(reflectors_, last), reflectors_.outerStride(), Scalar(0));
    reflectors_(i, last) = Scalar(1);
    reflectors_(last, last) = Scalar(-1);
    tau_(last) = Scalar(1);
  }

  /// The span of the level's rows (columns of Bᵀ) goes to the last free coordinates.
  void shrink() noexcept {
    if (rank_ == free_) {
      take_all();
      return;
    }
    for (Index k = 0; k < rank_; ++k) {
      const Index n = free_--;
      Scalar* v = at(reflectors_, n - 1);
      std::copy_n(at(jt_, k), n, v);
      fill_up(n, v);
      tau_(n - 1) = Reflection<Scalar>::make(n, v, n - 1).tau;
      for (Index c = k + 1; c < rank_; ++c) {
        reflect(n, tau_(n - 1), v, at(jt_, c));
        jt_(n - 1, c) = Scalar(0);
      }
    }
  }

  /// Q is zero: there is nothing left to turn.
  void take_all() noexcept {
    for (Index i = 0; i < dof_; ++i) tau_(i) = Scalar(0);
    free_ = touched_ = 0;
  }

  /// Q is zero but for rounding. ‖M⁻¹‖ is then 1 and ‖C‖ at most 1, so that what follows would
  /// change ρ by less than 2 ‖Q‖² ‖J‖ ‖e‖.
  bool nothing_left() noexcept {
    const Scalar limit =
        std::numeric_limits<Scalar>::epsilon() * std::sqrt(std::numeric_limits<Scalar>::epsilon());
    Scalar square(0);
    if (touched_ < free_) return false;
    for (Index j = 0; j < free_; ++j) {
      const Scalar* z = at(z_, j);
      for (Index i = 0; i < free_; ++i) {
        const Scalar q = (i == j ? Scalar(1) : Scalar(0)) - z[i];
        square += q * q;
      }
      if (!(square <= limit)) return false;
    }
    return true;
  }

  Regularization regularization_;
  Scalar eta_;
  Index dof_, free_;  // n, r
  Index active_{0}, stored_{0}, rank_{0};
  Index touched_{0};               // Z is zero but for its first rows and columns
  bool plain_{true};               // Z = 0
  bool k_is_valid_{false};         // k_ = ZᵀZ
  bool small_eigenvalues_{false};  // The last M had some; the next is likely to.
  bool binary_{true}, regularized_{false}, shrinks_{false};  // the present level
  Vector<Scalar, N> a_, tau_;
  // column i: the reflection that made coordinate i the first one not free, or the last touched
  Panel_ reflectors_;
  Panel_ z_, k_;  // I − Q, and its square
  Panel_ jt_, gram_, weighted_, left_, right_, u_, m_, f_, shifted_;
  Coefficients e_, c_;
  mutable Coefficients image_, small_;  // scratch between calls
  SpectralInverse<Scalar, N> spectral_;
  mutable Square projector_;
};

}  // namespace icat::detail
