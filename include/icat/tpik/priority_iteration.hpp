// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One iteration of [Coop, Eq. (22)], shared by `Tpik` and `ParametricTpik`.
///
/// With X = J Q and B = A^{1/2} X over the rows of activation a > 0 (a row with a = 0 drops out of
/// Eq. (20) exactly), f the regularized inverse, e = ẋ̄ − J ρ:
///
///     W e = X f(BᵀB + η (I − Q)ᵀ(I − Q)) Bᵀ A^{3/2} e                                [Eq. (20)]
///     Δ   = Q X^{#,A,I} W e,        Q ← Q − Q X^{#,A,I} X                            [Eq. (22)]
///
/// Since f(BᵀB) Bᵀ = Bᵀ f(BBᵀ), the second pseudo-inverse needs only the m × m Gram matrix BBᵀ:
///
///     X^{#,A,I} = Bᵀ f(BBᵀ) A^{3/2}                     (at most n active rows)
///     X^{#,A,I} X = f(XᵀAX) (XᵀAAX)                     (more: sums over rows, nothing stored)
///
/// **Erratum** [Coop, Eq. (20)]: `VᵀHV` is `V H Vᵀ` with M = V Σ Vᵀ.
#pragma once

#include <algorithm>
#include <cmath>

#include "icat/math/column_products.hpp"
#include "icat/math/regularization.hpp"
#include "icat/math/symmetric_eigen.hpp"

namespace icat::detail {

/// The right-hand side has `Columns` columns: ρ alone, or ρ̃ and P side by side.
template <class Scalar, int N, int Columns, class Regularization>
class PriorityIteration {
 public:
  using Coefficients = Eigen::Matrix<Scalar, N, Columns>;
  using Square = Eigen::Matrix<Scalar, N, N>;

  PriorityIteration(Index dof, const Regularization& regularization, Scalar projection_weight)
      : projector(Square::Identity(dof, dof)),
        increment(Coefficients::Zero(dof, Columns)),
        regularization_(regularization),
        projection_weight_(projection_weight),
        jt_(dof, dof),
        bt_(dof, dof),
        e_(dof, Columns),
        w_(dof, Columns),
        a_(dof),
        m_(dof, dof),
        gram_(dof, dof),
        inner_(dof, dof),
        scratch_(dof, dof),
        next_projector_(dof, dof),
        image_(dof, Columns),
        solved_(dof, Columns),
        spectral_(dof, Columns),
        factor_(2 * dof, dof),
        rotated_(2 * dof, dof),
        eigen_(dof) {}

  Index dof() const noexcept { return projector.rows(); }

  /// Begins a level of `active` rows with a > 0; then `row` for each, then `solve`.
  void begin(Index active) noexcept {
    active_ = active;
    next_ = 0;
    if (!stored()) {
      m_.setZero();
      gram_.setZero();
      image_.setZero();
    }
  }

  /// One active row: its Jacobian (1 × n), activation and residual e (1 × Columns).
  template <class J, class E>
  void row(const Eigen::MatrixBase<J>& jacobian, Scalar a,
           const Eigen::MatrixBase<E>& residual) noexcept {
    if (stored()) {
      jt_.col(next_) = jacobian.transpose();
      e_.row(next_) = residual;
      a_(next_++) = a;
      return;
    }
    jt_.col(0) = jacobian.transpose();
    multiply_transposed(projector, jt_.leftCols(1), bt_.leftCols(1));
    const auto x = bt_.leftCols(1);
    add_outer_square(x, a, m_);
    add_outer_square(x, a * a, gram_);
    for (Index c = 0; c < Columns; ++c) image_.col(c) += (a * a * residual(c)) * x.col(0);
  }

  /// Computes `increment` (Δ, n × Columns) and the next projector; `accept` takes the latter over.
  /// False, with nothing changed, if anything overflowed.
  bool solve() noexcept {
    const bool solved = stored() ? solve_stored() : solve_summed();
    return solved && increment.allFinite() && next_projector_.allFinite();
  }
  void accept() noexcept { projector = next_projector_; }

  /// A closing level with J = I, A = I [Coop, Eq. (23)] for e = −`current`. The projector is not
  /// touched: nothing comes after it.
  bool close(const Coefficients& current) noexcept {
    factor_.topRows(dof()) = projector;
    multiply_transposed(projector, projector, m_);
    gram_ = m_;
    if (!decompose_w(dof())) return false;
    solved_ = -current;
    apply_rotated(rotated_.topRows(dof()), solved_, image_);  // W e
    if (!eigen_.compute(gram_)) return false;
    auto c = rotated_.topRows(dof());
    rotate_and_refine(projector, projector, c);
    apply_rotated(c, image_, increment);
    return increment.allFinite();
  }

  /// A singular value of the last level's XᵀAX, in the span of its rows, lay below the threshold.
  bool regularized() const noexcept { return regularized_; }

  Square projector;        ///< Q_{k−1}, n × n
  Coefficients increment;  ///< Δ of the level solved last, n × Columns

 private:
  bool stored() const noexcept { return active_ <= dof(); }

  /// Decomposes M = m_ + η (I − Q)ᵀ(I − Q) = V diag(d) Vᵀ. The first `rows` of factor_ hold X̃ with
  /// X̃ᵀX̃ = m_; the first `rows` of rotated_ become X̃ V. With no rows, only eigen_ is filled.
  bool decompose_w(Index rows) noexcept {
    scratch_ = -std::sqrt(projection_weight_) * projector;
    scratch_.diagonal().array() += std::sqrt(projection_weight_);
    multiply_transposed(scratch_, scratch_, inner_);
    m_ += inner_;
    if (!eigen_.compute(m_)) return false;
    if (rows == 0) return true;
    factor_.middleRows(rows, dof()) = scratch_;
    rotate_and_refine(factor_.topRows(rows), factor_.topRows(rows + dof()),
                      rotated_.topRows(rows + dof()));
    return true;
  }

  /// `out` = `wanted` V, where `wanted` are the first rows of F and eigen_ is that of FᵀF. Where
  /// small eigenvalues count, eigen_ is sharpened first: on the bell f' is as large as 1/λ².
  /// Answers whether that was so.
  template <class Wanted, class F, class Out>
  bool rotate_and_refine(const Wanted& wanted, const F& factor, Out&& out) noexcept {
    if (!(eigen_.values().minCoeff() < regularization_.threshold)) {
      multiply(wanted, eigen_.vectors(), out.topRows(wanted.rows()));
      return false;
    }
    multiply(factor, eigen_.vectors(), out);
    eigen_.refine(out);
    return true;
  }

  /// out = C f(d) Cᵀ in, C = F V: nothing large is multiplied by something that ought to vanish, as
  /// it would be in Fᵀ (V f(d) Vᵀ).
  template <class C, class In, class Out>
  void apply_rotated(const C& c, const In& in, Out&& out) noexcept {
    auto s = spectral_.topRows(c.cols());
    multiply_transposed(c, in, s);
    scale_rows(s);
    multiply(c, s, out);
  }

  /// Row i times f(d_i).
  template <class S>
  void scale_rows(S&& s) const noexcept {
    for (Index i = 0; i < s.rows(); ++i) {
      s.row(i) *= regularization_.inverse(std::max(eigen_.values()(i), Scalar(0)));
    }
  }

  bool solve_stored() noexcept {
    const Index m = active_;
    const auto bt = bt_.leftCols(m);
    auto e = e_.topRows(m);
    multiply_transposed(projector, jt_.leftCols(m), bt_.leftCols(m));
    for (Index i = 0; i < m; ++i) {
      bt_.col(i) *= std::sqrt(a_(i));
      e.row(i) *= a_(i) * std::sqrt(a_(i));
    }
    m_.setZero();
    add_outer_square(bt, Scalar(1), m_);
    factor_.topRows(m) = bt.transpose();
    if (!decompose_w(m)) return false;
    auto w = w_.topRows(m);
    apply_rotated(rotated_.topRows(m), e, w);
    for (Index i = 0; i < m; ++i) w.row(i) *= a_(i);  // A^{3/2} W e, since B = A^{1/2} X

    multiply_transposed(bt, bt, gram_.topLeftCorner(m, m));
    if (!eigen_.compute(gram_.topLeftCorner(m, m))) return false;
    auto c = rotated_.topLeftCorner(dof(), m);  // Bᵀ U
    regularized_ = rotate_and_refine(bt, bt, c);
    multiply_transposed(eigen_.vectors(), w, e);
    scale_rows(e);
    multiply(c, e, image_);
    multiply(projector, image_, increment);

    for (Index i = 0; i < m; ++i) inner_.row(i).noalias() = a_(i) * bt.col(i).transpose();
    auto s = scratch_.topRows(m);
    multiply_transposed(eigen_.vectors(), inner_.topRows(m), s);
    scale_rows(s);
    multiply(projector, c, jt_.leftCols(m));
    multiply(jt_.leftCols(m), s, inner_);
    next_projector_ = projector - inner_;
    return true;
  }

  bool solve_summed() noexcept {
    next_projector_ = m_;  // XᵀAX, before η (I − Q)ᵀ(I − Q) is added to it
    if (!decompose_w(0)) return false;
    apply_function(image_, solved_);
    if (!eigen_.compute(next_projector_)) return false;
    regularized_ = eigen_.values().minCoeff() < regularization_.threshold;
    multiply(gram_, solved_, image_);
    apply_function(image_, solved_);
    multiply(projector, solved_, increment);
    apply_function(gram_, inner_);
    multiply(projector, inner_, scratch_);
    next_projector_ = projector - scratch_;
    return true;
  }

  /// out = V f(d) Vᵀ in; `in` is overwritten.
  template <class In, class Out>
  void apply_function(In& in, Out& out) noexcept {
    multiply_transposed(eigen_.vectors(), in, out);
    scale_rows(out);
    in = out;
    multiply(eigen_.vectors(), in, out);
  }

  Regularization regularization_;
  Scalar projection_weight_;
  Index active_{0};
  Index next_{0};
  bool regularized_{false};
  Square jt_, bt_;  // columns: active rows of J, of B
  Coefficients e_, w_;
  Vector<Scalar, N> a_;
  Square m_, gram_, inner_, scratch_, next_projector_;
  Coefficients image_, solved_, spectral_;
  static constexpr int twice = add_sizes(N, N);
  Eigen::Matrix<Scalar, twice, N> factor_, rotated_;
  SymmetricEigen<Scalar, N> eigen_;
};

}  // namespace icat::detail
