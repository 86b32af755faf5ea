// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The regularized system of Eq. (20) [Coop] under a projector Q = (N − U Vᵀ) Nᵀ (projector.hpp):
///
///     z = f(M) Bᵀ e,   M = BᵀB + η (I − Q)ᵀ(I − Q)        B: m × r, the rows in the free axes
///
/// With U_N the part of U on the free axes and U_t that on the ones taken, K = UᵀU, K₀ = U_NᵀU_N,
/// K_t = U_tᵀU_t, M on [free, taken] is
///
///     M = [ BᵀB + η V K Vᵀ    η V U_tᵀ ]        K_v = η K₀ − σ_t η / (η − σ_t) K_t
///         [ η U_t Vᵀ          η I      ]
///
/// Where no eigenvalue of M but zeros lies below the threshold σ_t, f(M) is the inverse, and
/// without the taken axes M is BᵀB + η V K₀ Vᵀ; their part of M − σ_t I leaves BᵀB + V K_v Vᵀ − σ_t
/// I. Each way below is exact; the first that is certain of that is taken.
#pragma once

#include "icat/math/regularization.hpp"
#include "icat/math/spectral_inverse.hpp"
#include "icat/tpik/projector.hpp"

namespace icat::detail {

/// For n degrees of freedom and `sides` right-hand sides, in memory that it is given. Nothing
/// allocates.
template <class Scalar, class Regularization>
class ProjectedSystem {
 public:
  using Block = Panel<Scalar>;

  /// Columns of n rows that it needs.
  static constexpr Index columns(Index n, Index sides) {
    return Projector<Scalar>::columns(n, sides) + SpectralInverse<Scalar>::columns(n) + 5 * n +
           2 * sides + 1;
  }
  ProjectedSystem(const Regularization& f, Scalar projection_weight)
      : regularization(f), sigma_(f.threshold), eta_(projection_weight) {}

  void bind(Index n, Index sides, PanelMemory<Scalar>& memory) noexcept {
    sides_ = sides;
    projector.bind(n, sides, memory);
    spectral.bind(n, memory);
    for (Block& b : scratch) b = memory.take(n);
    side_ = memory.take(sides);
    other_ = memory.take(sides);
    tau_ = memory.take(1).data;
  }
  void reset() noexcept { small_eigenvalues_ = false; }

  /// Rows that are independent of the partial ones, m + p ≤ r: then z can satisfy both, and B z =
  /// e. It is certain where K_v > 0, G = BBᵀ ≥ σ_t and VᵀV − VᵀBᵀ (G − σ_t I)⁻¹ B V > σ_t K_v⁻¹, of
  /// which (G − σ_t I)⁻¹ ≤ G⁻¹ + σ_t / (1 − σ_t tr G⁻¹) G⁻². `f` is G⁻¹.
  bool independent(Index m, const Block& jt, const Block& f) noexcept {
    const Index r = projector.free(), p = projector.partial();
    if (m + p > r || small_eigenvalues_) return false;
    const Scalar rest = Scalar(1) - sigma_ * trace(m, f);
    const auto& [s, bv, fbv, product_, unused] = scratch;
    if (!(rest > Scalar(0)) || !set_kv(s)) return false;
    transposed_product(r, m, p, jt, projector.v(), bv);
    product(Into::set, m, p, m, f, bv, fbv);
    if (p == 1) {  // the same with numbers
      const Scalar v =
          projector.v_gram()(0, 0) - dot(m, bv[0], fbv[0]) - sigma_ / rest * dot(m, fbv[0], fbv[0]);
      return s(0, 0) > Scalar(0) && s(0, 0) * v > sigma_;
    }
    // VᵀV − VᵀBᵀ (G⁻¹ + …) B V − σ_t K_v⁻¹ > 0
    if (!detail::invert(p, s, Scalar(0))) return false;
    for (Index j = 0; j < p; ++j) {
      combine(m, Scalar(1), bv[j], sigma_ / rest, fbv[j], bv[j]);
      combine(p, Scalar(1), projector.v_gram()[j], -sigma_, s[j], s[j]);
    }
    transposed_product(m, p, p, bv, fbv, product_);
    add(p, p, Scalar(-1), product_, s);
    return cholesky(p, s, product_);
  }

  /// z = M⁻¹ `rhs` by Cholesky factors, where BᵀB + V K_v Vᵀ − σ_t I has one. `btb` is BᵀB.
  bool regular(const Block& btb, const Block& rhs, const Block& z) noexcept {
    if (small_eigenvalues_ || !valid_kv()) return false;
    const Index r = projector.free();
    const auto& [m, shifted, factor, shifted_factor, vk] = scratch;
    projector.weigh();
    copy(btb, m, r);
    if (taken()) copy(btb, shifted, r);
    if (projector.dense()) {
      add(r, r, eta_, projector.k_free(), m);
      if (taken()) {
        (void)set_kv(vk);
        add(r, r, Scalar(1), vk, shifted);
      }
    } else {
      const Block& v = projector.v();
      add_weighted(r, v, projector.k_free(), eta_, vk, m);
      if (taken()) {
        (void)set_kv(factor);
        add_weighted(r, v, factor, Scalar(1), vk, shifted);
      }
    }
    // Both factors at a time: each is one long chain of operations that wait for each other.
    const Block& certificate = taken() ? shifted : m;
    for (Index j = 0; j < r; ++j) {
      if (!cholesky_column(r, j, certificate, sigma_, shifted_factor) ||
          !cholesky_column(r, j, m, Scalar(0), factor)) {
        return false;
      }
    }
    solve(r, factor, rhs, z);
    return true;
  }

  /// More rows than free axes, G = BᵀB ≥ σ_t with its inverse `f`: K_v > 0 is enough. With
  /// η K₀ = L Lᵀ and H = G⁻¹ V L, z = G⁻¹ b − H (I + LᵀVᵀ H)⁻¹ Hᵀ b.
  [[gnu::cold]] bool corrected(const Block& f, const Block& rhs, const Block& z) noexcept {
    const Index r = projector.free(), p = projector.partial();
    const auto& [k, l, vl, h, s] = scratch;
    if (projector.dense() || !factor_k(k, s, l)) return false;
    product(Into::set, r, p, p, projector.v(), l, vl);
    product(Into::set, r, p, r, f, vl, h);
    transposed_product(r, p, p, vl, h, k);
    if (!correct(r, k, h, rhs, s)) return false;
    product(Into::set, r, sides_, r, f, rhs, z);
    product(Into::subtract, r, sides_, p, h, side_, z);
    return true;
  }
  /// As many rows as free axes, G = BBᵀ ≥ σ_t with its inverse `f`: the same in the coordinates of
  /// the rows. With H = G⁻¹ B V L, y = B z = e − H (I + HᵀH)⁻¹ Hᵀ e.
  [[gnu::cold]] bool corrected_rows(const Block& jt, const Block& f, const Block& e,
                                    const Block& y) noexcept {
    const Index r = projector.free(), p = projector.partial();
    const auto& [k, l, vl, h, s] = scratch;
    if (projector.dense() || !factor_k(k, s, l)) return false;
    product(Into::set, r, p, p, projector.v(), l, vl);
    transposed_product(r, r, p, jt, vl, k);
    product(Into::set, r, p, r, f, k, h);
    gram(r, p, h, k);
    if (!correct(r, k, h, e, s)) return false;
    copy_rows(r, sides_, e, y);
    product(Into::subtract, r, sides_, p, h, side_, y);
    return true;
  }

  /// Whether M has less than full rank by counting its rows.
  bool reduces(Index m) const noexcept {
    return !projector.dense() && m + projector.partial() + taken_rank() < projector.reach();
  }
  /// y = B z. M = F Fᵀ with F = [Bᵀ, √η V L₀, √η V R_tᵀ; 0, 0, √η I], K₀ = L₀ L₀ᵀ, K_t = R_tᵀ R_t,
  /// so that with S = FᵀF, which is smaller, y is the upper part of S f(S) [e; 0]. `g` is
  /// BBᵀ ≥ σ_t: where B has smaller singular values, y would lose digits that B z keeps.
  bool reduced(Index m, const Block& jt, const Block& g, const Block& e, const Block& y) noexcept {
    const Index r = projector.free(), p = projector.partial(), q = taken_rank(), w = p + q;
    const auto& [s, bv, factors, bvw, work] = scratch;
    projector.weigh();
    if (!cholesky(p, projector.k_free(), work)) return false;
    explicit_factor(p, work, factors);
    if (q > 0) {
      projector.copy_taken(work);
      triangularize(projector.reach() - r, p, work, bv, tau_);
      transpose(q, p, work, factors.from(p));
    }
    scale(p, w, std::sqrt(eta_), factors, factors);
    transposed_product(r, m, p, jt, projector.v(), bv);
    product(Into::set, m, w, p, bv, factors, bvw);
    product(Into::set, p, w, p, projector.v_gram(), factors, work);
    transposed_product(p, w, w, factors, work, bv);
    for (Index j = 0; j < m; ++j) copy(m, g[j], s[j]);
    for (Index j = 0; j < w; ++j) {
      for (Index i = 0; i < m; ++i) s(i, m + j) = s(m + j, i) = bvw(i, j);
      copy(w, bv[j], s[m + j] + m);
      if (j >= p) s(m + j, m + j) += eta_;
    }
    for (Index j = 0; j < m + w; ++j) fill_up(m + w, s[j]);
    copy_rows(m, sides_, e, other_);
    if (!filter(s, m + w, other_, side_, work)) return false;
    small_eigenvalues_ = spectral.below() > 0;
    copy_rows(m, sides_, side_, y);
    return true;
  }

  /// z = f(M) `rhs` with f(M) evaluated on all axes that Q reaches. `btb` is BᵀB.
  bool full(const Block& btb, const Block& rhs, const Block& z) noexcept {
    const Index r = projector.free(), b = projector.reach(), p = projector.partial();
    const auto& [m, product_, out, unused, unused_] = scratch;
    Block uv = projector.u();
    if (projector.dense()) {
      projector.weigh();
      for (Index j = 0; j < r; ++j) {
        combine(r, eta_, projector.k_free()[j], Scalar(1), btb[j], m[j]);
      }
      if (taken()) add(r, r, eta_, projector.k_taken(), m);
    } else {
      product(Into::set, b, r, p, uv, projector.v(), product_, By::transpose);
      uv = product_;
      gram(b, r, uv, m);
      for (Index j = 0; j < r; ++j) combine(r, eta_, m[j], Scalar(1), btb[j], m[j]);
    }
    for (Index j = 0; j < r; ++j) {
      for (Index i = r; i < b; ++i) m(i, j) = eta_ * uv(i, j);
      fill_up(b, m[j]);
    }
    for (Index i = r; i < b; ++i) {
      clear(m.from(i), 1);
      for (Index j = 0; j < r; ++j) m(j, i) = m(i, j);
      m(i, i) = eta_;
    }
    copy_rows(r, sides_, rhs, other_);
    return spectrally(m, b, other_, z, out);
  }

  /// out = s f(s) in (n × sides); `s` is overwritten, `square` scratch.
  [[gnu::noinline]] bool filter(const Block& s, Index n, const Block& in, const Block& out,
                                const Block& square) noexcept {
    if (sides_ == 1) return spectral.filter(s, n, in.data, out.data, regularization);
    if (!spectral.compute(s, n, square, regularization)) return false;
    copy_rows(n, sides_, in, out);
    spectral.filter(sides_, out);
    return true;
  }
  /// z = (l lᵀ)⁻¹ rhs
  [[gnu::noinline]] void solve(Index n, const Block& l, const Block& rhs, const Block& z) noexcept {
    copy_rows(n, sides_, rhs, side_);
    for (Index c = 0; c < sides_; ++c) cholesky_solve(n, l, side_[c], z[c]);
  }
  /// s += weight · r k rᵀ, for r (n × p) and symmetric k; `rk` is scratch.
  [[gnu::noinline]] void add_weighted(Index n, const Block& r, const Block& k, Scalar weight,
                                      const Block& rk, const Block& s) noexcept {
    const Index p = projector.partial();
    product(Into::set, n, p, p, r, k, rk);
    scale(n, p, weight, rk, rk);
    product(Into::add, n, n, p, rk, r, s, By::transpose);
  }

  Regularization regularization;
  Projector<Scalar> projector;
  SpectralInverse<Scalar> spectral;
  Block scratch[5]{};  ///< n × n each, free between calls

 private:
  bool taken() const noexcept { return projector.reach() > projector.free(); }
  /// Rank of U_t, at most.
  Index taken_rank() const noexcept {
    return std::min(projector.partial(), projector.reach() - projector.free());
  }
  bool valid_kv() const noexcept { return !taken() || eta_ > sigma_; }
  [[gnu::noinline]] bool set_kv(const Block& kv) noexcept {
    if (!valid_kv()) return false;
    projector.weigh();
    const Index p = projector.partial();
    scale(p, p, eta_, projector.k_free(), kv);
    if (taken()) add(p, p, -sigma_ * eta_ / (eta_ - sigma_), projector.k_taken(), kv);
    return true;
  }
  /// L of η K₀ = L Lᵀ, where K_v > 0; `k` and `s` are scratch.
  [[gnu::noinline]] bool factor_k(const Block& k, const Block& s, const Block& l) noexcept {
    const Index p = projector.partial();
    if (!set_kv(k) || !cholesky(p, k, l)) return false;
    scale(p, p, eta_, projector.k_free(), k);
    if (!cholesky(p, k, s)) return false;
    explicit_factor(p, s, l);
    return true;
  }
  /// side_ = (I + k)⁻¹ hᵀ b, h: r × p; `s` is scratch.
  [[gnu::noinline]] bool correct(Index r, const Block& k, const Block& h, const Block& b,
                                 const Block& s) noexcept {
    const Index p = projector.partial();
    for (Index j = 0; j < p; ++j) k(j, j) += Scalar(1);
    if (!cholesky(p, k, s)) return false;
    transposed_product(r, p, sides_, h, b, other_);
    for (Index c = 0; c < sides_; ++c) cholesky_solve(p, s, other_[c], side_[c]);
    return true;
  }
  /// z = f(m) rhs; `m` is overwritten, `square` scratch.
  bool spectrally(const Block& m, Index n, const Block& rhs, const Block& z,
                  const Block& square) noexcept {
    if (sides_ == 1) {
      if (!spectral.apply(m, n, rhs.data, z.data, regularization)) return false;
    } else {
      if (!spectral.compute(m, n, square, regularization)) return false;
      product(Into::set, n, sides_, n, square, rhs, z);
      spectral.add_small(sides_, rhs, z);
    }
    small_eigenvalues_ = spectral.below() > 0;
    return true;
  }

  Scalar sigma_, eta_;  // σ_t, η
  Index sides_{0};
  bool small_eigenvalues_{false};  // the last M had some; the next is likely to
  Block side_{}, other_{};
  Scalar* tau_{};
};

}  // namespace icat::detail
