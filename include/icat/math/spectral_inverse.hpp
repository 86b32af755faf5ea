// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// `f(S) = V diag(f(σ)) Vᵀ` for a symmetric positive semi-definite S = V diag(σ) Vᵀ and a
/// regularized inverse f, where f(σ) = 1/σ from a threshold on.
///
/// 1. Householder reflections make S tridiagonal, S = H T Hᵀ. With a vector b, where f(S) b is
///    wanted, the first reflection maps b to the first axis; T then ends where the Krylov space of
///    b does, so that directions S does not move never appear.
/// 2. A Sturm sequence counts the eigenvalues of T below the threshold.
/// 3. Implicit QR steps (Golub & Van Loan, *Matrix Computations*, 8.3) run until so many have been
///    found. What is left of T has none: there f is the inverse, by L D Lᵀ.
///
/// Without an eigenvalue below the threshold, which is the common case, no QR step is taken.
#pragma once

#include <cmath>
#include <limits>

#include "icat/math/factorization.hpp"

namespace icat::detail {

/// F (`rows` × n) as it is, or `transposed`.
template <class Scalar>
struct Factor {
  Panel<Scalar> panel;
  Index rows;
  bool transposed;

  /// out = F x, x: n × k.
  [[gnu::noinline]] void apply(Index n, Index k, const Panel<Scalar>& x,
                               const Panel<Scalar>& out) const noexcept {
    if (transposed) return transposed_product(n, rows, k, panel, x, out);
    product(Into::set, rows, k, n, panel, x, out);
  }
};

/// For matrices up to n × n, in memory that it is given. Nothing allocates.
template <class Scalar>
class SpectralInverse {
 public:
  using Square = Panel<Scalar>;

  /// Columns of n rows that it needs.
  static constexpr Index columns(Index n) { return 2 * n + 7; }
  void bind(Index n, PanelMemory<Scalar>& memory) noexcept {
    householder_ = memory.take(n);
    vectors_ = memory.take(n);
    for (Scalar** x : {&tau_, &diagonal_, &sub_, &value_, &pivot_, &p_, &y_}) {
      *x = memory.take(1).data;
    }
  }

  /// `z = f(S) b`, n elements and the zeros after them. `s` (leading n × n) is overwritten. False
  /// if anything overflowed.
  template <class Regularization>
  bool apply(const Square& s, Index n, const Scalar* b, Scalar* z,
             const Regularization& f) noexcept {
    return evaluate(false, s, n, b, z, f);
  }
  /// The same for `z = S f(S) b`: the identity but for eigenvalues below the threshold, so that no
  /// digits are lost where f is large.
  template <class Regularization>
  bool filter(const Square& s, Index n, const Scalar* b, Scalar* z,
              const Regularization& f) noexcept {
    return evaluate(true, s, n, b, z, f);
  }

  /// `out` = the part of f(S) of eigenvalues from the threshold on, leading n × n, zeros after each
  /// column's n; the others are the last `below` columns of `vectors`. Where S = FᵀF is given with
  /// its `factor` F, they are as accurate as the singular values of F.
  template <class Regularization>
  bool compute(const Square& s, Index n, const Square& out, const Regularization& f,
               const Factor<Scalar>* factor = nullptr) noexcept {
    if (!prepare(s, n, Scalar(f.threshold))) return false;
    if (!(large_ ? rotate_all(s, f) : diagonalize(s, f))) return false;
    sort(unit_ * Scalar(f.threshold));
    if (factor != nullptr) refine(*factor, f);
    copy(vectors_, householder_, n);
    solve<false>(householder_.data, householder_.stride, n);
    for (Index i = n - below_; i < n; ++i) clear(householder_.from(i), 1);
    product(Into::set, n, n, n, householder_, vectors_, out, By::transpose);
    // Rows below n are left over from earlier levels.
    for (Index j = 0; j < n; ++j) {
      if (!all_finite(n, out[j])) return false;
    }
    return true;
  }
  /// `out` (n × k) += the part of the others times `in`. As one matrix they would lose digits: f is
  /// large there.
  void add_small(Index k, const Square& in, const Square& out) const noexcept {
    add_small(k, in, out, [&](Index i) { return value_[i]; });
  }
  /// `y` (n × k) ← S f(S) y
  void filter(Index k, const Square& y) const noexcept {
    add_small(k, y, y, [&](Index i) { return gain(i) - Scalar(1); });
  }

  /// How many eigenvalues of the last S, or of its part that the last b excites, lay below the
  /// threshold.
  Index below() const noexcept { return below_; }
  /// After `compute`: V, of which the last `below` columns belong to those eigenvalues.
  const Square& vectors() const noexcept { return vectors_; }
  /// f(σ) and σ f(σ) of column `i`, one of those.
  Scalar inverse(Index i) const noexcept { return value_[i]; }
  Scalar gain(Index i) const noexcept { return diagonal_[i] * value_[i]; }

 private:
  template <class Weight>
  void add_small(Index k, const Square& in, const Square& out, Weight weight) const noexcept {
    for (Index i = n_ - below_; i < n_; ++i) {
      add_projection(n_, weight(i), vectors_[i], k, in, out);
    }
  }

  [[gnu::noinline]] void set_identity() noexcept {
    clear(vectors_, n_);
    for (Index i = 0; i < n_; ++i) vectors_(i, i) = Scalar(1);
  }

  template <class Regularization>
  bool evaluate(bool times_s, const Square& s, Index n, const Scalar* b, Scalar* z,
                const Regularization& f) noexcept {
    if (!prepare(s, n, Scalar(f.threshold))) return false;
    clear(padded<Scalar>(n), z);
    const auto function = [&](Scalar* y) {
      if (times_s) {
        for (Index i = rest_; i < size_; ++i) y[i] *= gain(i) / unit_;
      } else {
        solve<true>(y, 1, 1);
      }
    };
    if (large_) {
      if (!rotate_all(s, f)) return false;
      transposed_product(n, n, 1, vectors_, {const_cast<Scalar*>(b), 0}, {y_, 0});
      function(y_);
      product(Into::set, n, 1, n, vectors_, {y_, 0}, {z, 0});
      return all_finite(n, z);
    }
    Scalar* v = householder_[0];
    copy_between(Index(0), n, b, v);
    const auto first = Reflection<Scalar>::make(n, v, 0);
    below_ = 0;
    if (first.length == Scalar(0)) return true;
    tau_[0] = first.tau;
    update(s, 0, v, first.tau);
    tridiagonalize(s, 1);
    below_ = count_below(unit_ * Scalar(f.threshold), size_);
    if (below_ == 0) {
      rest_ = size_;
      z[0] = first.length;
      function(z);
    } else {
      set_identity();
      if (!deflate(f, 2)) return false;
      for (Index i = 0; i < size_; ++i) y_[i] = vectors_(0, i) * first.length;
      function(y_);
      product(Into::set, size_, 1, size_, vectors_, {y_, 0}, {z, 0});
      clear(padded<Scalar>(n) - size_, z + size_);
    }
    for (Index i = reflections_; i-- > 0;) {
      reflect_from(i, n_, tau_[i], householder_[i], 1, {z, 0});
    }
    return all_finite(n, z);
  }

  /// V and the eigenvalues below the threshold, by steps 1 to 3.
  template <class Regularization>
  bool diagonalize(const Square& s, const Regularization& f) noexcept {
    tridiagonalize(s, 0);
    below_ = count_below(unit_ * Scalar(f.threshold), size_);
    set_identity();
    for (Index i = reflections_; i-- > 0;) {
      reflect_from(i + 1, n_, tau_[i], householder_[i], n_ - i - 1, vectors_.from(i + 1));
    }
    return deflate(f, n_);
  }

  /// V and all eigenvalues, by Jacobi's rotations.
  template <class Regularization>
  [[gnu::cold]] [[gnu::noinline]] bool rotate_all(const Square& s,
                                                  const Regularization& f) noexcept {
    set_identity();
    if (!jacobi(n_, s, vectors_)) return false;
    rest_ = below_ = 0;
    for (Index i = 0; i < n_; ++i) {
      diagonal_[i] = s(i, i);
      if (!(diagonal_[i] >= unit_ * Scalar(f.threshold))) ++below_;
      value_[i] = f.inverse(std::max(diagonal_[i], Scalar(0)) / unit_);
    }
    return true;
  }

  /// S of any size comes near 1 (exactly, by a power of two), so that no square overflows or
  /// vanishes. False if it is not finite.
  [[gnu::noinline]] bool prepare(const Square& s, Index n, Scalar threshold) noexcept {
    n_ = size_ = n;
    reflections_ = 0;
    scale_ = Scalar(0);
    for (Index i = 0; i < n; ++i) scale_ = std::max(scale_, s(i, i));
    if (!std::isfinite(scale_)) return false;
    large_ = scale_ > Scalar(1e6) * threshold;
    unit_ = Scalar(1);
    constexpr Scalar usual = Scalar(1 << 20);
    if (scale_ > Scalar(0) && !(scale_ < usual && scale_ * usual > Scalar(1))) {
      const int exponent = std::clamp(std::ilogb(scale_), std::numeric_limits<Scalar>::min_exponent,
                                      std::numeric_limits<Scalar>::max_exponent - 3);
      unit_ = std::ldexp(Scalar(1), -exponent);
      scale(n, n, unit_, s, s);
      scale_ *= unit_;
    }
    return true;
  }

  /// S ← (I − tau v vᵀ) S (I − tau v vᵀ) = S − v wᵀ − w vᵀ, w = p − (tau/2) (pᵀv) v, p = tau S v,
  /// from row and column k on, above which v is zero. What is above, in the same packets, is lost.
  [[gnu::noinline]] void update(const Square& s, Index k, Scalar* v, Scalar tau) noexcept {
    ++reflections_;
    const Index top = packet_begin<Scalar>(k), rows = n_ - top;
    Scalar* w = p_;
    product(Into::set, rows, 1, n_ - k, s.from(k).below(k), {v + k, 0}, {w + top, 0});
    combine(rows, tau, w + top, -tau * (tau * dot(rows, w + top, v + top)) / Scalar(2), v + top,
            w + top);
    subtract_symmetric(k, top, n_, v, w, s);
  }

  /// With a first vector, T ends with its Krylov space.
  void tridiagonalize(const Square& s, Index first) noexcept {
    const Index n = n_;
    const Scalar nothing = scale_ * Scalar(n) * std::numeric_limits<Scalar>::epsilon();
    // That of a diagonal element of this size in a semi-definite matrix.
    const Scalar coupling = std::sqrt(scale_ * nothing);
    for (Index j = 0; j < n; ++j) {
      diagonal_[j] = s(j, j);
      if (j + 1 == n) break;
      if (j + 2 == n) {
        sub_[j] = s(j + 1, j);
        continue;
      }
      const Index k = j + 1, top = packet_begin<Scalar>(k);
      Scalar* v = householder_[reflections_];
      copy_between(k, n, s[j], v);
      const auto r = Reflection<Scalar>::make(n - top, v + top, k - top);
      sub_[j] = r.length;
      if (first == 1 && std::abs(r.length) <= coupling &&
          (std::abs(r.length) <= nothing || rest_is_nothing(s, k, nothing))) {
        size_ = k;
        return;
      }
      tau_[reflections_] = r.tau;
      update(s, k, v, r.tau);
    }
    if (first == 1 && n > 1 && diagonal_[n - 1] <= nothing) size_ = n - 1;
  }

  /// The trailing block of S, semi-definite, is rounding.
  bool rest_is_nothing(const Square& s, Index from, Scalar nothing) const noexcept {
    Scalar trace(0);
    for (Index i = from; i < n_; ++i) trace += std::abs(s(i, i));
    return trace <= nothing;
  }

  /// Step 2.
  [[gnu::noinline]] Index count_below(Scalar threshold, Index n) const noexcept {
    Index below = 0;
    Scalar q(1);
    for (Index i = 0; i < n; ++i) {
      q = diagonal_[i] - threshold - (i > 0 ? sub_[i - 1] * sub_[i - 1] / q : Scalar(0));
      if (!(q > Scalar(0))) ++below;
      if (q == Scalar(0)) q = -std::numeric_limits<Scalar>::min();
    }
    return below;
  }

  /// Step 3. From `rest_` on T is diagonal, with `value_` = f(σ). Column k of the vectors has
  /// `rows` + k elements, and one more with every step.
  template <class Regularization>
  bool deflate(const Regularization& f, Index rows) noexcept {
    // What a step leaves of rounding, ε ‖T‖; the largest diagonal element of S may be smaller.
    Scalar norm(0);
    for (Index i = 0; i < size_; ++i) {
      norm = std::max(norm, std::abs(diagonal_[i]) + (i > 0 ? std::abs(sub_[i - 1]) : Scalar(0)) +
                                (i + 1 < size_ ? std::abs(sub_[i]) : Scalar(0)));
    }
    const Scalar nothing = norm * std::numeric_limits<Scalar>::epsilon();
    const Scalar threshold = unit_ * Scalar(f.threshold);
    Index left = below_;
    Index end = size_ - 1;
    // LAPACK's bound: 30 steps for each eigenvalue; about 1.7 are needed.
    for (Index steps = 30 * size_; end >= 0;) {
      // An eigenvalue at the threshold may count as below it here and not there: all are found when
      // none is counted in what is left.
      if (left <= 0) left = count_below(threshold, end + 1);
      if (left == 0) break;
      if (end == 0 || std::abs(sub_[end - 1]) <= nothing) {
        if (end > 0) sub_[end - 1] = Scalar(0);
        if (!(diagonal_[end] >= threshold)) --left;
        value_[end] = f.inverse(std::max(diagonal_[end], Scalar(0)) / unit_);
        --end;
        continue;
      }
      if (steps-- == 0) return false;
      Index start = end - 1;
      while (start > 0 && !(std::abs(sub_[start - 1]) <= nothing)) --start;
      qr_step(start, end, diagonal_, sub_, rows++, n_, vectors_);
    }
    rest_ = end + 1;
    return true;
  }

  /// The eigenvalues of S are good to ε ‖S‖, which for a small one means few digits, and f' is as
  /// large as 1/λ² there. One-sided Jacobi rotations make the columns of F V orthogonal that belong
  /// to small ones; their squared norms are the eigenvalues.
  template <class Regularization>
  [[gnu::cold]] void refine(const Factor<Scalar>& factor, const Regularization& f) noexcept {
    const Square &c = householder_, &v = vectors_;
    const Index rows = factor.rows;
    const Scalar rounding = Scalar(rows) * std::numeric_limits<Scalar>::epsilon();
    const Index first = n_ - below_;
    factor.apply(n_, below_, v.from(first), c.from(first));
    for (Index i = first; i < n_; ++i) value_[i] = dot(rows, c[i], c[i]);
    bool rotated = true;
    for (int sweep = 0; sweep < 4 && rotated; ++sweep) {
      rotated = false;
      for (Index i = first; i < n_; ++i) {
        for (Index j = i + 1; j < n_; ++j) {
          const Scalar product = dot(rows, c[i], c[j]);
          if (!(std::abs(product) > rounding * std::sqrt(value_[i]) * std::sqrt(value_[j]))) {
            continue;
          }
          rotated = true;
          const auto r = JacobiRotation<Scalar>::make(value_[i], value_[j], product);
          rotate(rows, r.cosine, -r.sine, c[i], c[j]);
          rotate(n_, r.cosine, -r.sine, v[i], v[j]);
          for (const Index k : {i, j}) value_[k] = dot(rows, c[k], c[k]);
        }
      }
    }
    for (Index i = first; i < n_; ++i) {
      diagonal_[i] = value_[i];
      value_[i] = f.inverse(value_[i]);
    }
  }

  /// Eigenvalues below the threshold go last, and into S's own unit.
  [[gnu::noinline]] void sort(Scalar threshold) noexcept {
    Index last = size_;
    for (Index i = size_; i-- > rest_;) {
      if (!(diagonal_[i] < threshold)) continue;
      --last;
      std::swap_ranges(vectors_[i], vectors_[i] + vectors_.stride, vectors_[last]);
      std::swap(diagonal_[i], diagonal_[last]);
      std::swap(value_[i], value_[last]);
      diagonal_[last] = std::max(diagonal_[last], Scalar(0)) / unit_;
    }
    below_ = size_ - last;
  }

  /// Columns y_0 … y_{size−1} ← what f(T) makes of them.
  template <bool one>
  void solve(Scalar* y, Index stride, Index rows) noexcept {
    const auto times = [&](Index i, Scalar s) {
      if constexpr (one) {
        y[i] *= s;
      } else {
        scale(rows, s, y + i * stride, y + i * stride);
      }
    };
    const auto subtract = [&](Index from, Index to, Scalar s) {
      if constexpr (one) {
        y[to] -= s * y[from];
      } else {
        axpy(rows, -s, y + from * stride, y + to * stride);
      }
    };
    for (Index i = rest_; i < size_; ++i) times(i, value_[i]);
    for (Index i = 0; i < rest_; ++i) {
      Scalar pivot = diagonal_[i];
      if (i > 0) {
        const Scalar l = sub_[i - 1] * pivot_[i - 1];
        pivot -= l * sub_[i - 1];
        subtract(i - 1, i, l);
      }
      pivot_[i] = Scalar(1) / pivot;
    }
    for (Index i = rest_; i-- > 0;) {
      times(i, unit_ * pivot_[i]);
      if (i + 1 < rest_) subtract(i + 1, i, sub_[i] * pivot_[i]);
    }
  }

  Square householder_{}, vectors_{};
  Scalar *tau_{}, *diagonal_{}, *sub_{}, *value_{}, *pivot_{}, *p_{}, *y_{};
  Index n_{0}, size_{0}, reflections_{0}, rest_{0}, below_{0};
  bool large_{false};
  Scalar scale_{0}, unit_{1};  // of S as it is worked on: its largest element, and its unit
};

}  // namespace icat::detail
