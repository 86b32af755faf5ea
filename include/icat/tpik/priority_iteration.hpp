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
    multiply_transposed(projector, projector, gram_);
    m_ = gram_;
    multiply_transposed(projector, current, image_);
    image_ = -image_;
    if (!apply_w() || !eigen_.compute(gram_)) return false;
    multiply(gram_, solved_, image_);
    apply_function(image_, solved_);
    multiply(projector, solved_, increment);
    return increment.allFinite();
  }

  /// A singular value of the last level's XᵀAX, in the span of its rows, lay below the threshold.
  bool regularized() const noexcept { return regularized_; }

  Square projector;        ///< Q_{k−1}, n × n
  Coefficients increment;  ///< Δ of the level solved last, n × Columns

 private:
  bool stored() const noexcept { return active_ <= dof(); }

  /// solved_ = f(m_ + η (I − Q)ᵀ(I − Q)) image_; both matrices are overwritten.
  bool apply_w() noexcept {
    scratch_ = -projector;
    scratch_.diagonal().array() += Scalar(1);
    multiply_transposed(scratch_, scratch_, inner_);
    m_ += projection_weight_ * inner_;
    if (!eigen_.compute(m_)) return false;
    apply_function(image_, solved_);
    return true;
  }

  /// out = V f(d) Vᵀ in, with the eigendecomposition computed last; `in` is overwritten.
  template <class In, class Out>
  void apply_function(In&& in, Out&& out) noexcept {
    multiply_transposed(eigen_.vectors(), in, out);
    for (Index i = 0; i < out.rows(); ++i) {
      out.row(i) *= regularization_.inverse(std::max(eigen_.values()(i), Scalar(0)));
    }
    in = out;
    multiply(eigen_.vectors(), in, out);
  }

  bool solve_stored() noexcept {
    const Index m = active_;
    const auto bt = bt_.leftCols(m);
    multiply_transposed(projector, jt_.leftCols(m), bt_.leftCols(m));
    for (Index i = 0; i < m; ++i) {
      bt_.col(i) *= std::sqrt(a_(i));
      e_.row(i) *= a_(i) * std::sqrt(a_(i));
    }
    m_.setZero();
    add_outer_square(bt, Scalar(1), m_);
    multiply(bt, e_.topRows(m), image_);
    if (!apply_w()) return false;
    multiply_transposed(bt, solved_, w_.topRows(m));
    for (Index i = 0; i < m; ++i) w_.row(i) *= a_(i);  // A^{3/2} W e, since B = A^{1/2} X

    multiply_transposed(bt, bt, gram_.topLeftCorner(m, m));
    if (!eigen_.compute(gram_.topLeftCorner(m, m))) return false;
    regularized_ = eigen_.values().minCoeff() < regularization_.threshold;
    apply_function(w_.topRows(m), e_.topRows(m));
    multiply(bt, e_.topRows(m), image_);
    multiply(projector, image_, increment);

    for (Index i = 0; i < m; ++i) inner_.row(i).noalias() = a_(i) * bt.col(i).transpose();
    apply_function(inner_.topRows(m), scratch_.topRows(m));
    multiply(projector, bt, jt_.leftCols(m));
    multiply(jt_.leftCols(m), scratch_.topRows(m), inner_);
    next_projector_ = projector - inner_;
    return true;
  }

  bool solve_summed() noexcept {
    next_projector_ = m_;  // XᵀAX, before η (I − Q)ᵀ(I − Q) is added to it
    if (!apply_w() || !eigen_.compute(next_projector_)) return false;
    regularized_ = eigen_.values().minCoeff() < regularization_.threshold;
    multiply(gram_, solved_, image_);
    apply_function(image_, solved_);
    multiply(projector, solved_, increment);
    apply_function(gram_, inner_);
    multiply(projector, inner_, scratch_);
    next_projector_ = projector - scratch_;
    return true;
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
  Coefficients image_, solved_;
  SymmetricEigen<Scalar, N> eigen_;
};

}  // namespace icat::detail
