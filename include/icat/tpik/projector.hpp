// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The projector Q of a hierarchy, in a form in which a partially active row costs one column:
///
///     Q = L Nᵀ,   L = N − U Vᵀ      N: n × r orthonormal; U: n × p; V: r × p, p ≤ r
///
/// N are the *free axes*. Binary rows take theirs away; p is the number of partial or regularized
/// rows that still matter. While p = 0, Q is an orthogonal projector. Where p would reach r, U
/// becomes U Vᵀ and V = I: the *dense* form.
///
/// **Coordinates.** Reflections turn the axes so that the free ones are the first r. U keeps what
/// it has on axes that were taken after its first column came: it reaches the first b ≥ r axes.
#pragma once

#include "icat/math/factorization.hpp"
#include "icat/tpik/level_check.hpp"

namespace icat::detail {

/// For `n` degrees of freedom, in memory that it is given. Nothing allocates.
template <class Scalar>
class Projector {
 public:
  using Block = Panel<Scalar>;

  /// Columns of n rows that it needs, where at most `most` vectors are projected at a time.
  static constexpr Index columns(Index n, Index most) { return 6 * n + std::max(n, most) + 2; }
  void bind(Index n, Index most, PanelMemory<Scalar>& memory) noexcept {
    dof_ = n;
    for (Block* b : {&reflections_, &u_, &v_, &k_free_, &k_taken_, &v_gram_}) *b = memory.take(n);
    work_ = memory.take(std::max(n, most));
    tau_ = memory.take(1).data;
    overlap_ = memory.take(1).data;
  }

  /// Q = I.
  void reset() noexcept {
    free_ = turned_ = dof_;
    partial_ = 0;
    dense_ = weighed_ = false;
  }
  /// Q = 0.
  void reset_to_zero() noexcept {
    reset();
    free_ = 0;
  }
  /// Q = `Q0`. Zeros and ones on a diagonal [Coop, Eq. (31)] are a choice of axes.
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
    start();
    become_dense();
    for (Index j = 0; j < dof_; ++j) {
      for (Index i = 0; i < dof_; ++i) u_(i, j) = (i == j ? Scalar(1) : Scalar(0)) - Q0(i, j);
    }
  }

  Index free() const noexcept { return free_; }                           ///< r
  Index reach() const noexcept { return partial_ > 0 ? reach_ : free_; }  ///< b
  Index partial() const noexcept { return partial_; }                     ///< p
  bool orthogonal() const noexcept { return partial_ == 0; }
  bool dense() const noexcept { return dense_; }
  const Block& u() const noexcept { return u_; }  ///< b × p
  const Block& v() const noexcept { return v_; }  ///< r × p, unless dense

  /// x (n × k) in the axes.
  void turn(Index k, const Block& x) const noexcept { turn_by(turned_, k, x); }
  [[gnu::noinline]] void turn_back(Index k, const Block& x) const noexcept {
    Index i = free_;
    for (; i + 2 <= turned_; i += 2) {
      reflect_twice(i + 2, tau_[i], reflections_[i], tau_[i + 1], reflections_[i + 1], overlap_[i],
                    k, x);
    }
    if (i < turned_) reflect(i + 1, tau_[i], reflections_[i], k, x);
  }
  /// x (b × k, in the axes) ← Lᵀ x (r × k).
  [[gnu::noinline]] void restrict(Index k, const Block& x) const noexcept {
    if (partial_ > 0) transposed_product(reach_, partial_, k, u_, x, work_);
    for (Index c = 0; c < k; ++c) fill_up(free_, x[c]);
    if (dense_) {
      add(free_, k, Scalar(-1), work_, x);
    } else if (partial_ > 0) {
      product(Into::subtract, free_, k, partial_, v_, work_, x);
    }
  }
  /// out (b × k) = L x, x: r × k.
  [[gnu::noinline]] void extend(Index k, const Block& x, const Block& out) const noexcept {
    copy_rows(free_, k, x, out);
    if (partial_ == 0) return;
    if (!dense_) transposed_product(free_, partial_, k, v_, x, work_);
    product(Into::subtract, reach_, k, partial_, u_, dense_ ? x : work_, out);
  }

  /// `k` more partial rows: U gains `u` (b × k), V `v` (r × k).
  [[gnu::noinline]] void gain(Index k, const Block& u, const Block& v) noexcept {
    start();
    weighed_ = false;
    if (!dense_ && partial_ + k < free_) {
      copy(u, u_.from(partial_), k);
      copy(v, v_.from(partial_), k);
      partial_ += k;
      return;
    }
    become_dense();
    product(Into::add, reach_, free_, k, u, v, u_, By::transpose);
  }
  /// Q ← Q − L `change` Nᵀ, r × r.
  void gain(const Block& change) noexcept {
    start();
    become_dense();
    extend(free_, change, work_);
    add(reach_, free_, Scalar(1), work_, u_);
    weighed_ = false;
  }
  /// The span of `k` columns of `rows` (r × k, overwritten) is free no more.
  void take(Index k, const Block& rows) noexcept {
    if (k == free_) return reset_to_zero();
    if (dense_) weighed_ = false;
    const Index before = free_;
    for (Index i = 0; i < k; ++i) {
      const Index n = free_--;
      Scalar* x = reflections_[n - 1];
      copy_between(Index(0), n, rows[i], x);
      clear(reflections_.stride - padded<Scalar>(n), x + padded<Scalar>(n));
      const Scalar tau = tau_[n - 1] = Reflection<Scalar>::make(n, x, n - 1).tau;
      overlap_[n - 1] = n < turned_ ? dot(n, x, reflections_[n]) : Scalar(0);
      reflect(n, tau, x, k - i - 1, rows.from(i + 1));
      if (dense_) {  // U ← U (I − tau x xᵀ) without its last column
        product(Into::set, reach_, 1, n, u_, {x, 0}, work_);
        add_outer(reach_, n - 1, -tau, work_[0], x, 1, u_);
        --partial_;
      }
    }
    turn_by(before, partial_, u_);
    if (dense_ || partial_ == 0) return;
    turn_by(before, partial_, v_);
    if (weighed_) move_weights(before);
    for (Index c = 0; c < partial_; ++c) {
      for (Index i = free_; i < before; ++i) v_(i, c) = Scalar(0);
    }
    if (partial_ >= free_) become_dense();
  }

  /// K₀ = U_NᵀU_N and K_t = U_tᵀU_t, p × p, of the rows of U on free axes and on those taken; and
  /// VᵀV, unless dense.
  const Block& k_free() const noexcept { return k_free_; }
  const Block& k_taken() const noexcept { return k_taken_; }
  const Block& v_gram() const noexcept { return v_gram_; }
  /// Makes them ready.
  [[gnu::noinline]] void weigh() noexcept {
    if (weighed_) return;
    weighed_ = true;
    if (!dense_) gram(free_, partial_, v_, v_gram_);
    if (reach_ == free_) {
      clear(k_taken_, partial_);
      return gram(free_, partial_, u_, k_free_);
    }
    copy_rows(free_, partial_, u_, work_);
    gram(free_, partial_, work_, k_free_);
    copy_taken(work_);
    gram(reach_ - free_, partial_, work_, k_taken_);
  }
  /// U_t, (b − r) × p.
  void copy_taken(const Block& out) const noexcept {
    copy_rows(reach_ - free_, partial_, {u_.data + free_, u_.stride}, out);
  }

  /// Z = U Vᵀ, b × r: in place.
  [[gnu::noinline]] void become_dense() noexcept {
    if (dense_) return;
    weighed_ = false;
    if (partial_ > 0) {
      product(Into::set, reach_, free_, partial_, u_, v_, work_, By::transpose);
      copy(work_, u_, free_);
    } else {
      clear(u_, free_);
    }
    partial_ = free_;
    dense_ = true;
  }

  /// Q is zero but for rounding: ‖Q‖² at most ε^{3/2}.
  [[gnu::noinline]] bool vanishes() const noexcept {
    if (!dense_) return free_ == 0;
    const Scalar limit =
        std::numeric_limits<Scalar>::epsilon() * std::sqrt(std::numeric_limits<Scalar>::epsilon());
    Scalar square(0);
    for (Index j = 0; j < free_; ++j) {
      for (Index i = 0; i < reach_; ++i) {
        const Scalar q = (i == j ? Scalar(1) : Scalar(0)) - u_(i, j);
        square += q * q;
      }
      if (!(square <= limit)) return false;
    }
    return true;
  }

 private:
  /// The first column of U may reach the axes that are free now.
  void start() noexcept {
    if (partial_ == 0) reach_ = free_;
  }

  /// x (k columns) by the reflections that took the axes from free_ to `end`, two at a time.
  [[gnu::noinline]] void turn_by(Index end, Index k, const Block& x) const noexcept {
    for (; end - 2 >= free_; end -= 2) {
      reflect_twice(end, tau_[end - 1], reflections_[end - 1], tau_[end - 2], reflections_[end - 2],
                    overlap_[end - 2], k, x);
    }
    if (end > free_) reflect(end, tau_[end - 1], reflections_[end - 1], k, x);
  }

  /// The rows from free_ to `end` are taken: they go from K₀ to K_t, and out of VᵀV.
  void move_weights(Index end) noexcept {
    const Index p = partial_, k = end - free_;
    transpose(k, p, {u_.data + free_, u_.stride}, work_);
    product(Into::subtract, p, p, k, work_, work_, k_free_, By::transpose);
    product(Into::add, p, p, k, work_, work_, k_taken_, By::transpose);
    transpose(k, p, {v_.data + free_, v_.stride}, work_);
    product(Into::subtract, p, p, k, work_, work_, v_gram_, By::transpose);
  }

  /// Takes axis i by exchanging it with the last free one, a reflection too.
  void drop(Index i) noexcept {
    const Index last = --free_;
    Scalar* x = reflections_[last];
    clear(reflections_.stride, x);
    tau_[last] = overlap_[last] = Scalar(0);
    if (i == last) {
      if (turned_ == last + 1) turned_ = last;
      return;
    }
    x[i] = Scalar(1);
    x[last] = Scalar(-1);
    tau_[last] = Scalar(1);
    if (last + 1 < turned_) overlap_[last] = dot(last + 1, x, reflections_[last + 1]);
  }

  Index dof_{0}, free_{0}, reach_{0}, partial_{0};
  Index turned_{0};  // the axes from here on were taken as they are
  bool dense_{false}, weighed_{false};
  Block reflections_{}, u_{}, v_{}, k_free_{}, k_taken_{}, v_gram_{}, work_{};
  // With column i of the reflections, v_i: the one that took axis i; and v_iᵀ v_{i+1}.
  Scalar *tau_{}, *overlap_{};
};

}  // namespace icat::detail
