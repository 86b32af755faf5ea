// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Kernels for matrices of a robot's size (4 to 64), stored as *panels*: contiguous columns, filled
/// up with zeros to whole SIMD packets. The same few loops serve static and run-time sizes at the
/// same speed; nothing is peeled, nothing allocates, and little has to be compiled.
///
/// All loops begin at a multiple of the packet size (`packet_begin`): a packet that is read across
/// two that were just written would stall the processor.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "icat/core/types.hpp"

namespace icat::detail {

template <class Scalar>
struct Simd {
  using Packet = typename Eigen::internal::packet_traits<Scalar>::type;
  static constexpr Index size = Eigen::internal::unpacket_traits<Packet>::size;
};

/// Rows that a column of `n` takes in a panel.
template <class Scalar>
constexpr Index padded(Index n) {
  constexpr Index size = Simd<Scalar>::size;
  return n == Eigen::Dynamic ? n : (n + size - 1) / size * size;
}

/// First row of the packet that holds row `i`.
template <class Scalar>
constexpr Index packet_begin(Index i) {
  return i / Simd<Scalar>::size * Simd<Scalar>::size;
}

/// Zeros from row `n` to the end of its packet.
template <class Scalar>
inline void fill_up(Index n, Scalar* x) noexcept {
  for (Index i = n; i < padded<Scalar>(n); ++i) x[i] = Scalar(0);
}

/// n × k, column-major. Zero rows follow the n. Two rows at least: Eigen stores a single one by
/// rows.
template <class Scalar, int N, int K = N>
using Panel =
    Eigen::Matrix<Scalar,
                  N == 1 && Simd<Scalar>::size == 1 ? 2 : static_cast<int>(padded<Scalar>(N)), K>;

template <class P>
P zero_panel(Index n, Index columns) {
  constexpr int rows = P::RowsAtCompileTime;
  return zeros<P>(rows == Eigen::Dynamic ? padded<typename P::Scalar>(n) : rows, columns);
}

/// Columns that are `stride` apart.
template <class Scalar>
struct ColumnView {
  Scalar* data;
  Index stride;
  Scalar* operator[](Index j) const noexcept { return data + j * stride; }
  operator ColumnView<const Scalar>() const noexcept { return {data, stride}; }
};
template <class P>
ColumnView<typename P::Scalar> columns(P& p) noexcept {
  return {p.data(), p.outerStride()};
}
template <class P>
ColumnView<const typename P::Scalar> columns(const P& p) noexcept {
  return {p.data(), p.outerStride()};
}

/// A matrix that is read one element at a time: b(k, j) = data[k * inner + j * outer].
template <class Scalar>
struct Elements {
  const Scalar* data;
  Index inner, outer;
};
template <class P>
Elements<typename P::Scalar> elements(const P& p) noexcept {
  return {p.data(), 1, p.outerStride()};
}
template <class P>
Elements<typename P::Scalar> transposed(const P& p) noexcept {
  return {p.data(), p.outerStride(), 1};
}

enum class Into { set, add, subtract };

/// R packets by C columns of `c = a b`, `c += a b` or `c −= a b`, all in registers.
template <Into into, int R, int C, class Scalar>
inline void product_block(Index depth, const Scalar* a, Index lda, Elements<Scalar> b, Scalar* c,
                          Index ldc) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  constexpr Index size = Simd<Scalar>::size;
  Packet sum[C][R];
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) {
      sum[j][i] =
          into == Into::set ? pset1<Packet>(Scalar(0)) : ploadu<Packet>(c + i * size + j * ldc);
    }
  }
  for (Index k = 0; k < depth; ++k, a += lda, b.data += b.inner) {
    Packet factor[C];
    for (int j = 0; j < C; ++j) {
      factor[j] =
          pset1<Packet>(into == Into::subtract ? -b.data[j * b.outer] : b.data[j * b.outer]);
    }
    for (int i = 0; i < R; ++i) {
      const Packet ai = ploadu<Packet>(a + i * size);
      for (int j = 0; j < C; ++j) sum[j][i] = pmadd(ai, factor[j], sum[j][i]);
    }
  }
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) pstoreu(c + i * size + j * ldc, sum[j][i]);
  }
}

/// `c (rows × cols) = a (rows × depth) b (depth × cols)`, or added to or subtracted from c. Whole
/// packets of rows are computed. `c` must not overlap `a` or `b`.
template <Into into, class Scalar>
void product(Index rows, Index cols, Index depth, ColumnView<const Scalar> a, Elements<Scalar> b,
             ColumnView<Scalar> c) noexcept {
  constexpr Index size = Simd<Scalar>::size;
  Index i = 0;
  const auto sweep = [&]<int R>(std::integral_constant<int, R>) {
    Elements<Scalar> bj = b;
    Index j = 0;
    for (; j + 2 <= cols; j += 2, bj.data += 2 * b.outer) {
      product_block<into, R, 2>(depth, a.data + i, a.stride, bj, c[j] + i, c.stride);
    }
    if (j < cols) product_block<into, R, 1>(depth, a.data + i, a.stride, bj, c[j] + i, c.stride);
    i += R * size;
  };
  while (rows - i > 3 * size) sweep(std::integral_constant<int, 4>{});
  if (rows - i > size) sweep(std::integral_constant<int, 2>{});
  if (rows - i > 0) sweep(std::integral_constant<int, 1>{});
}
template <Into into, class A, class C>
void product(Index rows, Index cols, Index depth, const A& a, Elements<typename A::Scalar> b,
             C& c) noexcept {
  product<into, typename A::Scalar>(rows, cols, depth, columns(a), b, columns(c));
}

/// Sum of a_i b_i over `rows`, rounded up to packets.
template <class Scalar>
inline Scalar dot(Index rows, const Scalar* a, const Scalar* b) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  constexpr Index size = Simd<Scalar>::size;
  Packet even = pset1<Packet>(Scalar(0)), odd = even;
  Index i = 0;
  for (; i + size < rows; i += 2 * size) {
    even = pmadd(ploadu<Packet>(a + i), ploadu<Packet>(b + i), even);
    odd = pmadd(ploadu<Packet>(a + i + size), ploadu<Packet>(b + i + size), odd);
  }
  if (i < rows) even = pmadd(ploadu<Packet>(a + i), ploadu<Packet>(b + i), even);
  return predux(padd(even, odd));
}

/// No NaN and no infinity among `n` elements.
template <class Scalar>
inline bool all_finite(Index n, const Scalar* x) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  constexpr Index size = Simd<Scalar>::size;
  // Zero but for infinities and NaN, which stay.
  const Packet zero = pset1<Packet>(Scalar(0));
  Packet sum = zero;
  const Index whole = n / size * size;
  for (Index i = 0; i < whole; i += size) sum = pmadd(ploadu<Packet>(x + i), zero, sum);
  Scalar rest = predux(sum);
  for (Index i = whole; i < n; ++i) rest += x[i] * Scalar(0);
  return rest == Scalar(0);
}

/// C elements of `aᵀ x`, for columns of a side by side.
template <int C, class Scalar>
inline void dots(Index rows, ColumnView<const Scalar> a, const Scalar* x, Scalar* out) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  Packet sum[C];
  for (int j = 0; j < C; ++j) sum[j] = pset1<Packet>(Scalar(0));
  for (Index i = 0; i < rows; i += Simd<Scalar>::size) {
    const Packet xi = ploadu<Packet>(x + i);
    for (int j = 0; j < C; ++j) sum[j] = pmadd(ploadu<Packet>(a[j] + i), xi, sum[j]);
  }
  for (int j = 0; j < C; ++j) out[j] = predux(sum[j]);
}

/// `c (k × l) = aᵀ b`
template <class A, class B, class C>
void transposed_product(Index rows, Index k, Index l, const A& a, const B& b, C& c) noexcept {
  const auto ca = columns(a);
  const auto cb = columns(b);
  const auto cc = columns(c);
  for (Index j = 0; j < l; ++j) {
    Index i = 0;
    for (; i + 4 <= k; i += 4) dots<4>(rows, {ca[i], ca.stride}, cb[j], cc[j] + i);
    for (; i < k; ++i) cc[j][i] = dot(rows, ca[i], cb[j]);
    fill_up(k, cc[j]);
  }
}

/// `c (k × k) = aᵀ a`
template <class A, class C>
void gram(Index rows, Index k, const A& a, C& c) noexcept {
  const auto ca = columns(a);
  const auto cc = columns(c);
  for (Index j = 0; j < k; ++j) {
    Index i = j;
    for (; i + 4 <= k; i += 4) dots<4>(rows, {ca[i], ca.stride}, ca[j], cc[j] + i);
    for (; i < k; ++i) cc[j][i] = dot(rows, ca[i], ca[j]);
    for (i = j + 1; i < k; ++i) cc[i][j] = cc[j][i];
    fill_up(k, cc[j]);
  }
}

/// `y += s x`
template <class Scalar>
inline void axpy(Index rows, Scalar s, const Scalar* x, Scalar* y) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  const Packet factor = pset1<Packet>(s);
  for (Index i = 0; i < rows; i += Simd<Scalar>::size) {
    pstoreu(y + i, pmadd(ploadu<Packet>(x + i), factor, ploadu<Packet>(y + i)));
  }
}

/// `out = s x + t y`, which may be one of x and y.
template <class Scalar>
inline void combine(Index rows, Scalar s, const Scalar* x, Scalar t, const Scalar* y,
                    Scalar* out) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  const Packet ps = pset1<Packet>(s), pt = pset1<Packet>(t);
  for (Index i = 0; i < rows; i += Simd<Scalar>::size) {
    pstoreu(out + i, pmadd(ps, ploadu<Packet>(x + i), pmul(pt, ploadu<Packet>(y + i))));
  }
}

/// `y = s x`, which may be the same.
template <class Scalar>
inline void scale(Index rows, Scalar s, const Scalar* x, Scalar* y) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  const Packet factor = pset1<Packet>(s);
  for (Index i = 0; i < rows; i += Simd<Scalar>::size) {
    pstoreu(y + i, pmul(ploadu<Packet>(x + i), factor));
  }
}

/// A Householder reflection `I − tau v vᵀ`.
template <class Scalar>
struct Reflection {
  Scalar tau;
  Scalar length;  ///< what is left of x on its axis

  /// Maps x onto axis `k`; x becomes v. The identity for x = 0.
  static Reflection make(Index rows, Scalar* x, Index k) noexcept {
    const Scalar square = dot(rows, x, x);
    if (!(square > std::numeric_limits<Scalar>::min())) return {Scalar(0), Scalar(0)};
    const Scalar alpha = x[k];
    const Scalar beta = alpha > Scalar(0) ? -std::sqrt(square) : std::sqrt(square);
    scale(rows, Scalar(1) / (alpha - beta), x, x);
    x[k] = Scalar(1);
    return {(beta - alpha) / beta, beta};
  }
};

template <class Scalar>
inline void reflect(Index rows, Scalar tau, const Scalar* v, Scalar* x) noexcept {
  axpy(rows, -tau * dot(rows, v, x), v, x);
}

/// Column `j` of the Cholesky factor of `s − shift I`, after those before it; lower triangle, with
/// the inverse of the diagonal on it and anything above. False unless the matrix is positive
/// definite so far.
template <class P>
inline bool cholesky_column(Index n, Index j, const P& s, typename P::Scalar shift, P& l) noexcept {
  using Scalar = typename P::Scalar;
  const auto cl = columns(l);
  const Index top = packet_begin<Scalar>(j);
  Scalar* x = cl[j];
  scale(n - top, Scalar(1), columns(s)[j] + top, x + top);
  product<Into::subtract, Scalar>(n - top, 1, j, {cl.data + top, cl.stride},
                                  {cl.data + j, cl.stride, 0}, {x + top, 0});
  const Scalar pivot = x[j] - shift;
  if (!(pivot > Scalar(0))) return false;
  const Scalar inverse = Scalar(1) / std::sqrt(pivot);
  scale(n - top, inverse, x + top, x + top);
  x[j] = inverse;
  return true;
}

/// `x = (l lᵀ)⁻¹ b`, with zeros after the n elements of x; `b` is overwritten.
template <class P>
void cholesky_solve(Index n, const P& l, typename P::Scalar* b, typename P::Scalar* x) noexcept {
  using Scalar = typename P::Scalar;
  const auto cl = columns(l);
  for (Index j = 0; j < n; ++j) {
    const Index top = packet_begin<Scalar>(j);
    const Scalar y = b[j] * cl[j][j];
    axpy(n - top, -y, cl[j] + top, b + top);
    x[j] = y;  // b is spoilt from `top` to j
  }
  // From below, x takes the place of zeros in b.
  for (Index j = 0; j < padded<Scalar>(n); ++j) b[j] = Scalar(0);
  for (Index j = n; j-- > 0;) {
    const Index top = packet_begin<Scalar>(j);
    b[j] = (x[j] - dot(n - top, cl[j] + top, b + top)) * cl[j][j];
  }
  for (Index j = 0; j < padded<Scalar>(n); ++j) x[j] = b[j];
}

/// (a, b) ← (c a + s b, c b − s a)
template <class Scalar>
inline void rotate(Index rows, Scalar c, Scalar s, Scalar* a, Scalar* b) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  const Packet pc = pset1<Packet>(c), ps = pset1<Packet>(s);
  for (Index i = 0; i < rows; i += Simd<Scalar>::size) {
    const Packet x = ploadu<Packet>(a + i), y = ploadu<Packet>(b + i);
    pstoreu(a + i, padd(pmul(pc, x), pmul(ps, y)));
    pstoreu(b + i, psub(pmul(pc, y), pmul(ps, x)));
  }
}

}  // namespace icat::detail
