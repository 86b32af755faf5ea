// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Factorizations of panels: Householder reflections, Cholesky factors, and the inverse of a
/// positive definite matrix by elimination (Golub & Van Loan, *Matrix
/// Computations*, 4.2, 5.1, 5.2).
#pragma once

#include "icat/math/panel.hpp"

namespace icat::detail {

/// A Householder reflection `I − tau v vᵀ`.
template <class Scalar>
struct Reflection {
  Scalar tau;
  Scalar length;  ///< what is left of x on its axis

  /// Maps x onto axis `k`; x becomes v. The identity for x = 0.
  [[gnu::noinline]] static Reflection make(Index rows, Scalar* x, Index k) noexcept {
    constexpr Scalar tiny = std::numeric_limits<Scalar>::min();
    Scalar square = dot(rows, x, x), unit(1);
    if (!(square > tiny)) {  // x may be small and is not zero for that
      unit = Scalar(0);
      for (Index i = 0; i < rows; ++i) unit = std::max(unit, std::abs(x[i]));
      if (!(unit >= tiny)) return {Scalar(0), Scalar(0)};
      scale(rows, Scalar(1) / unit, x, x);
      square = dot(rows, x, x);
    }
    const Scalar alpha = x[k];
    const Scalar beta = alpha > Scalar(0) ? -std::sqrt(square) : std::sqrt(square);
    scale(rows, Scalar(1) / (alpha - beta), x, x);
    set_element(x, k, Scalar(1));
    return {(beta - alpha) / beta, beta * unit};
  }
};

/// Of the `k` columns of x.
template <class Scalar>
[[gnu::noinline]] void reflect(Index rows, Scalar tau, const Scalar* v, Index k,
                               const Panel<Scalar>& x) noexcept {
  add_projection(rows, -tau, v, k, x, x);
}
/// C columns of x ← (I − t₂ v₂ v₂ᵀ)(I − t₁ v₁ v₁ᵀ) x, `overlap` = v₁ᵀ v₂: half the passes over x.
template <int C, class Scalar>
inline void reflect_twice(Index rows, Scalar t1, const Scalar* v1, Scalar t2, const Scalar* v2,
                          Scalar overlap, const Panel<Scalar>& x) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  Packet one[C], two[C];
  for (int c = 0; c < C; ++c) one[c] = two[c] = pset1<Packet>(Scalar(0));
  for (Index i = 0; i < rows; i += Simd<Scalar>::size) {
    const Packet a = ploadu<Packet>(v1 + i), b = ploadu<Packet>(v2 + i);
    for (int c = 0; c < C; ++c) {
      const Packet xi = ploadu<Packet>(x[c] + i);
      one[c] = pmadd(a, xi, one[c]);
      two[c] = pmadd(b, xi, two[c]);
    }
  }
  for (int c = 0; c < C; ++c) {
    const Scalar s1 = -t1 * predux(one[c]), s2 = -t2 * (predux(two[c]) + s1 * overlap);
    one[c] = pset1<Packet>(s1);
    two[c] = pset1<Packet>(s2);
  }
  for (Index i = 0; i < rows; i += Simd<Scalar>::size) {
    const Packet a = ploadu<Packet>(v1 + i), b = ploadu<Packet>(v2 + i);
    for (int c = 0; c < C; ++c) {
      pstoreu(x[c] + i, pmadd(b, two[c], pmadd(a, one[c], ploadu<Packet>(x[c] + i))));
    }
  }
}
/// Of the `k` columns of x.
template <class Scalar>
[[gnu::noinline]] void reflect_twice(Index rows, Scalar t1, const Scalar* v1, Scalar t2,
                                     const Scalar* v2, Scalar overlap, Index k,
                                     const Panel<Scalar>& x) noexcept {
  Index c = 0;
  for (; c + 2 <= k; c += 2) reflect_twice<2>(rows, t1, v1, t2, v2, overlap, x.from(c));
  if (c < k) reflect_twice<1>(rows, t1, v1, t2, v2, overlap, x.from(c));
}
/// `reflect` by a v that is zero above row `i` of n.
template <class Scalar>
void reflect_from(Index i, Index n, Scalar tau, const Scalar* v, Index k,
                  const Panel<Scalar>& x) noexcept {
  const Index top = packet_begin<Scalar>(i);
  reflect(n - top, tau, v + top, k, x.below(top));
}

/// The triangle R of `a = Y R` (rows × cols) takes the place of a; reflection k is I − tau_k v_k
/// v_kᵀ with v_k zero above row k. Returns their number.
template <class Scalar>
[[gnu::noinline]] Index triangularize(Index rows, Index cols, const Panel<Scalar>& a,
                                      const Panel<Scalar>& v, Scalar* tau) noexcept {
  const Index steps = std::min(rows, cols);
  for (Index k = 0; k < steps; ++k) {
    const Index top = packet_begin<Scalar>(k), n = rows - top;
    Scalar* x = v[k] + top;
    copy_between(k, rows, a[k], v[k]);
    const auto r = Reflection<Scalar>::make(n, x, k - top);
    tau[k] = r.tau;
    clear(rows - k, a[k] + k);
    a(k, k) = r.length;
    reflect(n, r.tau, x, cols - k - 1, a.from(k + 1).below(top));
  }
  return steps;
}

/// R of RᵀR + `rows` `rows`ᵀ, R as its transpose `triangle`, r × r; `rows` (r × k) is overwritten.
/// Two columns of scratch.
template <class Scalar>
[[gnu::noinline]] void fold(Index r, Index k, const Panel<Scalar>& rows,
                            const Panel<Scalar>& triangle, Scalar* w, Scalar* x) noexcept {
  for (Index i = 0; i < r; ++i) {  // a reflection of row i onto its diagonal, across the columns
    Scalar square(0);
    for (Index c = 0; c < k; ++c) square += rows(i, c) * rows(i, c);
    if (!(square > std::numeric_limits<Scalar>::min())) continue;
    const Scalar alpha = triangle(i, i), length = std::sqrt(alpha * alpha + square);
    const Scalar beta = alpha > Scalar(0) ? -length : length;
    const Scalar tau = (beta - alpha) / beta, unit = Scalar(1) / (alpha - beta);
    for (Index c = 0; c < k; ++c) x[c] = rows(i, c) * unit;
    copy(triangle.stride, triangle[i], w);
    product(Into::add, r, 1, k, rows, {x, 0}, {w, 0});
    axpy(r, -tau, w, triangle[i]);
    add_outer(r, k, -tau, w, x, 1, rows);
  }
}

/// An implicit QR step on the symmetric tridiagonal matrix from `start` to `end` (Golub & Van Loan,
/// 8.3); column k of `vectors` has `rows` + k elements, n at most.
template <class Scalar>
void qr_step(Index start, Index end, Scalar* diagonal, Scalar* sub, Index rows, Index n,
             const Panel<Scalar>& vectors) noexcept {
  const Scalar half = (diagonal[end - 1] - diagonal[end]) / Scalar(2);
  const Scalar e = sub[end - 1];
  const Scalar h = std::sqrt(half * half + e * e);
  const Scalar shift = diagonal[end] - e * (e / (half + (half >= Scalar(0) ? h : -h)));
  Scalar x = diagonal[start] - shift;
  Scalar z = sub[start];
  for (Index k = start; k < end; ++k) {
    const Scalar r2 = x * x + z * z;
    if (!(r2 > std::numeric_limits<Scalar>::min())) break;
    const Scalar r = std::sqrt(r2);
    const Scalar inverse = r * (Scalar(1) / r2);  // Both long operations at a time.
    const Scalar c = x * inverse;
    const Scalar s = z * inverse;
    const Scalar dk = diagonal[k], dk1 = diagonal[k + 1], ek = sub[k];
    const Scalar w = s * (dk - dk1) - Scalar(2) * c * ek;
    diagonal[k] = dk - s * w;
    diagonal[k + 1] = dk1 + s * w;
    sub[k] = -c * w - ek;
    if (k > start) sub[k - 1] = r;
    x = sub[k];
    if (k + 1 < end) {
      z = s * sub[k + 1];
      sub[k + 1] *= c;
    }
    rotate(std::min(rows + k, n), c, s, vectors[k], vectors[k + 1]);
  }
}

/// A rotation that makes [a c; c b] diagonal (Golub & Van Loan, 8.5); c is not zero.
template <class Scalar>
struct JacobiRotation {
  Scalar cosine, sine, tangent;

  static JacobiRotation make(Scalar a, Scalar b, Scalar c) noexcept {
    const Scalar zeta = (b - a) / (Scalar(2) * c);
    const Scalar t = (zeta >= Scalar(0) ? Scalar(1) : Scalar(-1)) /
                     (std::abs(zeta) + std::hypot(Scalar(1), zeta));
    const Scalar cosine = Scalar(1) / std::sqrt(Scalar(1) + t * t);
    return {cosine, cosine * t, t};
  }
};

/// Makes the positive semi-definite `s` diagonal, V ← V times the rotations. Slow, but the small
/// eigenvalues of a matrix with large ones keep their digits. False if 30 sweeps do not do (six
/// are usual).
template <class Scalar>
[[gnu::cold]] [[gnu::noinline]] bool jacobi(Index n, const Panel<Scalar>& s,
                                            const Panel<Scalar>& v) noexcept {
  for (int sweep = 0; sweep < 30; ++sweep) {
    bool rotated = false;
    for (Index i = 0; i < n; ++i) {
      for (Index j = i + 1; j < n; ++j) {
        const Scalar a = s(i, i), b = s(j, j), c = s(i, j);
        const Scalar nothing = std::max(std::numeric_limits<Scalar>::epsilon() *
                                            std::sqrt(std::abs(a)) * std::sqrt(std::abs(b)),
                                        std::numeric_limits<Scalar>::min());
        if (!(std::abs(c) > nothing)) continue;
        rotated = true;
        const auto r = JacobiRotation<Scalar>::make(a, b, c);
        rotate(n, r.cosine, -r.sine, s[i], s[j]);
        rotate(n, r.cosine, -r.sine, v[i], v[j]);
        for (Index k = 0; k < n; ++k) {
          const Scalar x = s(i, k), y = s(j, k);
          s(i, k) = r.cosine * x - r.sine * y;
          s(j, k) = r.cosine * y + r.sine * x;
        }
        s(i, i) = a - r.tangent * c;
        s(j, j) = b + r.tangent * c;
        s(i, j) = s(j, i) = Scalar(0);
      }
    }
    if (!rotated) return true;
  }
  return false;
}

/// Gauss and Jordan's inverse of a positive definite matrix, in its place. False, with the matrix
/// spoilt, at a pivot below `least`: pivots are Schur complements, so none is smaller than the
/// smallest eigenvalue.
template <class Scalar>
[[gnu::noinline]] bool invert(Index n, Panel<Scalar> s, Scalar least) noexcept {
  for (Index p = 0; p < n; ++p) {
    const Scalar pivot = s(p, p);
    if (!(pivot >= least) || !(pivot > Scalar(0))) return false;
    set_element(s[p], p, Scalar(1));
    scale(n, Scalar(1) / pivot, s[p], s[p]);
    for (Index j = 0; j < n; ++j) {
      if (j == p) continue;
      const Scalar factor = -s(p, j);
      set_element(s[j], p, Scalar(0));
      inline_axpy(n, factor, s[p], s[j]);
    }
  }
  return true;
}

/// `v` ← the eigenvector of the largest eigenvalue of the positive definite `s`, by power steps
/// from its largest column; `w` is scratch. False unless each step brings it nearer by a factor of
/// 16: another eigenvalue is near.
template <class Scalar>
[[gnu::noinline]] bool dominant_vector(Index n, const Panel<Scalar>& s, Scalar* v,
                                       Scalar* w) noexcept {
  Index largest = 0;
  for (Index i = 1; i < n; ++i) largest = s(i, i) > s(largest, largest) ? i : largest;
  const Scalar* x = s[largest];
  const Scalar nothing = Scalar(n) * std::numeric_limits<Scalar>::epsilon();
  Scalar before = infinity<Scalar>;
  for (bool first = true;; first = false) {
    const Scalar length = std::sqrt(dot(n, x, x));
    if (!(length > Scalar(0)) || !std::isfinite(length)) return false;
    scale(n, Scalar(1) / length, x, w);
    combine(n, Scalar(1), w, Scalar(-1), v, v);
    const Scalar change = dot(n, v, v);
    scale(n, Scalar(1), w, v);
    if (!first) {
      if (change <= nothing * nothing) return true;
      if (!(change < before / Scalar(256))) return false;
      before = change;
    }
    product(Into::set, n, 1, n, s, {v, 0}, {w, 0});
    x = w;
  }
}

template <class Scalar>
Scalar trace(Index n, const Panel<Scalar>& s) noexcept {
  Scalar sum(0);
  for (Index i = 0; i < n; ++i) sum += s(i, i);
  return sum;
}

/// Column `j` of the Cholesky factor of `s − shift I`, after those before it; lower triangle, with
/// the inverse of the diagonal on it and anything above. False unless the matrix is positive
/// definite so far.
template <class Scalar>
[[gnu::noinline]] bool cholesky_column(Index n, Index j, const Panel<Scalar>& s, Scalar shift,
                                       const Panel<Scalar>& l) noexcept {
  const Index top = packet_begin<Scalar>(j);
  Scalar* x = l[j];
  scale(n - top, Scalar(1), s[j] + top, x + top);
  product(Into::subtract, n - top, 1, j, l.below(j), {l.data + j, l.stride}, {x + top, 0},
          By::transpose);
  const Scalar pivot = x[j] - shift;
  if (!(pivot > Scalar(0))) return false;
  const Scalar inverse = Scalar(1) / std::sqrt(pivot);
  scale(n - top, inverse, x + top, x + top);
  set_element(x, j, inverse);
  return true;
}

/// Whether `s − shift I` is positive definite; `l` is its factor then, as above.
template <class Scalar>
[[gnu::noinline]] bool cholesky(Index n, const Panel<Scalar>& s, const Panel<Scalar>& l,
                                Scalar shift = Scalar(0)) noexcept {
  for (Index j = 0; j < n; ++j) {
    if (!cholesky_column(n, j, s, shift, l)) return false;
  }
  return true;
}

/// The lower triangle alone, with its diagonal and zeros above it.
template <class Scalar>
[[gnu::noinline]] void explicit_factor(Index n, const Panel<Scalar>& l,
                                       const Panel<Scalar>& out) noexcept {
  for (Index j = 0; j < n; ++j) {
    clear(j, out[j]);
    copy(n - j, l[j] + j, out[j] + j);
    out(j, j) = Scalar(1) / l(j, j);
    fill_up(n, out[j]);
  }
}

/// `x = (l lᵀ)⁻¹ b`, with zeros after the n elements of x; `b` is overwritten.
template <class Scalar>
[[gnu::noinline]] void cholesky_solve(Index n, const Panel<Scalar>& l, Scalar* b,
                                      Scalar* x) noexcept {
  for (Index j = 0; j < n; ++j) {
    const Index top = packet_begin<Scalar>(j);
    const Scalar y = b[j] * l(j, j);
    axpy(n - top, -y, l[j] + top, b + top);
    x[j] = y;  // b is spoilt from `top` to j
  }
  // From below, x takes the place of zeros in b.
  for (Index j = 0; j < padded<Scalar>(n); ++j) b[j] = Scalar(0);
  for (Index j = n; j-- > 0;) {
    const Index top = packet_begin<Scalar>(j);
    b[j] = (x[j] - dot(n - top, l[j] + top, b + top)) * l(j, j);
  }
  for (Index j = 0; j < padded<Scalar>(n); ++j) x[j] = b[j];
}

}  // namespace icat::detail
