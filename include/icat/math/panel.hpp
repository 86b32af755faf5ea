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

// The only file that uses packets, `Eigen::internal`: they are the same in these versions.
static_assert(EIGEN_VERSION_AT_LEAST(3, 4, 0), "icat needs Eigen 3.4 or later");

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

/// Zeros from row `n` to the end of its packet; in line, for inner loops.
template <class Scalar>
inline void inline_fill_up(Index n, Scalar* x) noexcept {
  // A bound that is not computed ahead: compilers make no call of memset of it.
  for (Index i = n; (i & (Simd<Scalar>::size - 1)) != 0; ++i) x[i] = Scalar(0);
}
template <class Scalar>
[[gnu::noinline]] void fill_up(Index n, Scalar* x) noexcept {
  inline_fill_up(n, x);
}

/// Zeros, ones and zeros, a packet of each: what elements of a packet are multiplied with to keep
/// the first or the last k of them.
template <class Scalar>
struct Masks {
  static constexpr Index size = Simd<Scalar>::size;
  Scalar data[3 * size]{};
  constexpr Masks() noexcept {
    for (Index i = 0; i < size; ++i) data[size + i] = Scalar(1);
  }
  auto first(Index k) const noexcept { return load(2 * size - k); }
  auto from(Index k) const noexcept { return load(size - k); }
  auto load(Index at) const noexcept {
    return Eigen::internal::ploadu<typename Simd<Scalar>::Packet>(data + at);
  }
};
template <class Scalar>
inline constexpr Masks<Scalar> masks{};

// A packet that is read right after one of its elements was written by itself stalls the processor
// until that has reached the cache. So the next two work within packets, whose elements are finite.

/// x_k = `value`.
template <class Scalar>
inline void set_element(Scalar* x, Index k, Scalar value) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  const Index top = packet_begin<Scalar>(k), at = k - top;
  const Packet others = padd(masks<Scalar>.first(at), masks<Scalar>.from(at + 1));
  const Packet own = psub(pset1<Packet>(Scalar(1)), others);
  pstoreu(x + top, pmadd(own, pset1<Packet>(value), pmul(ploadu<Packet>(x + top), others)));
}
/// out = x from `first` to before `last`, and zeros in the rest of those packets.
template <class Scalar>
[[gnu::noinline]] void copy_between(Index first, Index last, const Scalar* x,
                                    Scalar* out) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  constexpr Index size = Simd<Scalar>::size;
  const Index top = packet_begin<Scalar>(first);
  for (Index i = top; i < last; i += size) {
    Packet p = ploadu<Packet>(x + i);
    if (i < first) p = pmul(p, masks<Scalar>.from(first - i));
    if (i + size > last) p = pmul(p, masks<Scalar>.first(last - i));
    pstoreu(out + i, p);
  }
}

/// A panel: columns that are `stride` apart, each filled up with zeros to whole packets.
/// Most functions take it by reference: their many calls are then shorter, and cheaper to compile.
/// By value where a loop reads it after each call of another function.
template <class Scalar>
struct Panel {
  Scalar* data;
  Index stride;

  Scalar* operator[](Index j) const noexcept { return data + j * stride; }
  Scalar& operator()(Index i, Index j) const noexcept { return data[i + j * stride]; }
  /// Without its first columns.
  Panel from(Index column) const noexcept { return {data + column * stride, stride}; }
  /// Without the packets above row `i`.
  Panel below(Index i) const noexcept { return {data + packet_begin<Scalar>(i), stride}; }
};

/// Hands out panels of `n` rows, one behind the other.
template <class Scalar>
class PanelMemory {
 public:
  PanelMemory(Scalar* memory, Index n) noexcept : next_(memory), stride_(padded<Scalar>(n)) {}
  /// With all that was in that memory before.
  Panel<Scalar> take(Index columns) noexcept {
    next_ += columns * stride_;
    return {next_ - columns * stride_, stride_};
  }

 private:
  Scalar* next_;
  Index stride_;
};

/// `out = x`, n elements.
template <class Scalar>
[[gnu::noinline]] void copy(Index n, const Scalar* x, Scalar* out) noexcept {
  std::copy_n(x, n, out);
}
/// `x = 0`, n elements.
template <class Scalar>
[[gnu::noinline]] void clear(Index n, Scalar* x) noexcept {
  std::fill_n(x, n, Scalar(0));
}
template <class Scalar>
[[gnu::noinline]] void clear(const Panel<Scalar>& p, Index columns) noexcept {
  std::fill_n(p.data, columns * p.stride, Scalar(0));
}
template <class Scalar>
[[gnu::noinline]] void copy(const Panel<Scalar>& from, const Panel<Scalar>& to,
                            Index columns) noexcept {
  std::copy_n(from.data, columns * from.stride, to.data);
}

/// The first `rows` of `columns`, with zeros below them.
template <class Scalar>
[[gnu::noinline]] void copy_rows(Index rows, Index columns, const Panel<Scalar>& from,
                                 const Panel<Scalar>& to) noexcept {
  for (Index c = 0; c < columns; ++c) {
    std::copy_n(from[c], rows, to[c]);
    std::fill_n(to[c] + rows, to.stride - rows, Scalar(0));
  }
}
/// out (cols × rows) = pᵀ, p: rows × cols
template <class Scalar>
[[gnu::noinline]] void transpose(Index rows, Index cols, const Panel<Scalar>& p,
                                 const Panel<Scalar>& out) noexcept {
  for (Index i = 0; i < rows; ++i) {
    for (Index j = 0; j < cols; ++j) out(j, i) = p(i, j);
    inline_fill_up(cols, out[i]);
  }
}

enum class Into { set, add, subtract };
enum class By { matrix, transpose };

/// A matrix that is read one element at a time: b(k, j) = data[k * inner + j * outer].
template <class Scalar>
struct Elements {
  const Scalar* data;
  Index inner, outer;
};

/// R packets by C columns of `c = a b`, `c += a b` or `c −= a b`, all in registers.
template <int R, int C, class Scalar>
inline void product_block(Into into, Index depth, const Scalar* a, Index lda, Elements<Scalar> b,
                          Scalar* c, Index ldc) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  constexpr Index size = Simd<Scalar>::size;
  const Scalar sign = into == Into::subtract ? Scalar(-1) : Scalar(1);
  Packet sum[C][R];
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) {
      sum[j][i] =
          into == Into::set ? pset1<Packet>(Scalar(0)) : ploadu<Packet>(c + i * size + j * ldc);
    }
  }
  for (Index k = 0; k < depth; ++k, a += lda, b.data += b.inner) {
    Packet factor[C];
    for (int j = 0; j < C; ++j) factor[j] = pset1<Packet>(sign * b.data[j * b.outer]);
    for (int i = 0; i < R; ++i) {
      const Packet ai = ploadu<Packet>(a + i * size);
      for (int j = 0; j < C; ++j) sum[j][i] = pmadd(ai, factor[j], sum[j][i]);
    }
  }
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) pstoreu(c + i * size + j * ldc, sum[j][i]);
  }
}

/// `c (rows × cols) = a (rows × depth) b (depth × cols)`, or added to or subtracted from c; b or
/// its transpose. Whole packets of rows are computed. `c` must not overlap `a` or `b`.
template <class Scalar>
[[gnu::noinline]] void product(Into into, Index rows, Index cols, Index depth,
                               const Panel<Scalar>& a, const Panel<Scalar>& b,
                               const Panel<Scalar>& c, By form = By::matrix) noexcept {
  const bool plain = form == By::matrix;
  constexpr Index size = Simd<Scalar>::size;
  Index i = 0;
  const auto sweep = [&]<int R>(std::integral_constant<int, R>) {
    Elements<Scalar> bj{b.data, plain ? 1 : b.stride, plain ? b.stride : 1};
    Index j = 0;
    for (; j + 2 <= cols; j += 2, bj.data += 2 * bj.outer) {
      product_block<R, 2>(into, depth, a.data + i, a.stride, bj, c[j] + i, c.stride);
    }
    if (j < cols) product_block<R, 1>(into, depth, a.data + i, a.stride, bj, c[j] + i, c.stride);
    i += R * size;
  };
  while (rows - i > size) sweep(std::integral_constant<int, 2>{});
  if (rows - i > 0) sweep(std::integral_constant<int, 1>{});
}

/// Sum of a_i b_i over `rows`, rounded up to packets; in line, for inner loops.
template <class Scalar>
inline Scalar inline_dot(Index rows, const Scalar* a, const Scalar* b) noexcept {
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

template <class Scalar>
[[gnu::noinline]] Scalar dot(Index rows, const Scalar* a, const Scalar* b) noexcept {
  return inline_dot(rows, a, b);
}

/// No NaN and no infinity among `n` elements.
template <class Scalar>
[[gnu::noinline]] bool all_finite(Index n, const Scalar* x) noexcept {
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
inline void dots(Index rows, const Panel<Scalar>& a, const Scalar* x, Scalar* out) noexcept {
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

/// `out (k) = aᵀ x`
template <class Scalar>
[[gnu::noinline]] void dots(Index rows, Index k, Panel<Scalar> a, const Scalar* x,
                            Scalar* out) noexcept {
  Index i = 0;
  for (; i + 4 <= k; i += 4) dots<4>(rows, a.from(i), x, out + i);
  if (i + 2 <= k) dots<2>(rows, a.from(i), x, out + i), i += 2;
  if (i < k) out[i] = inline_dot(rows, a[i], x);
}

/// `c (k × l) = aᵀ b`
template <class Scalar>
[[gnu::noinline]] void transposed_product(Index rows, Index k, Index l, const Panel<Scalar>& a,
                                          const Panel<Scalar>& b, const Panel<Scalar>& c) noexcept {
  for (Index j = 0; j < l; ++j) {
    dots(rows, k, a, b[j], c[j]);
    inline_fill_up(k, c[j]);
  }
}

/// `c (k × k) = aᵀ a`
template <class Scalar>
[[gnu::noinline]] void gram(Index rows, Index k, const Panel<Scalar>& a,
                            const Panel<Scalar>& c) noexcept {
  for (Index j = 0; j < k; ++j) {
    dots(rows, k - j, a.from(j), a[j], c[j] + j);
    for (Index i = j + 1; i < k; ++i) c(j, i) = c(i, j);
    inline_fill_up(k, c[j]);
  }
}

/// `y += s x`; in line, for inner loops.
template <class Scalar>
inline void inline_axpy(Index rows, Scalar s, const Scalar* x, Scalar* y) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  const Packet factor = pset1<Packet>(s);
  for (Index i = 0; i < rows; i += Simd<Scalar>::size) {
    pstoreu(y + i, pmadd(ploadu<Packet>(x + i), factor, ploadu<Packet>(y + i)));
  }
}
template <class Scalar>
[[gnu::noinline]] void axpy(Index rows, Scalar s, const Scalar* x, Scalar* y) noexcept {
  inline_axpy(rows, s, x, y);
}

/// `out = s x + t y`, which may be one of x and y.
template <class Scalar>
[[gnu::noinline]] void combine(Index rows, Scalar s, const Scalar* x, Scalar t, const Scalar* y,
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
[[gnu::noinline]] void scale(Index rows, Scalar s, const Scalar* x, Scalar* y) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  const Packet factor = pset1<Packet>(s);
  for (Index i = 0; i < rows; i += Simd<Scalar>::size) {
    pstoreu(y + i, pmul(ploadu<Packet>(x + i), factor));
  }
}

/// `to += s from`, `k` columns.
template <class Scalar>
[[gnu::noinline]] void add(Index rows, Index k, Scalar s, const Panel<Scalar>& from,
                           const Panel<Scalar>& to) noexcept {
  for (Index c = 0; c < k; ++c) inline_axpy(rows, s, from[c], to[c]);
}
/// `to = s from`, `k` columns; they may be the same.
template <class Scalar>
[[gnu::noinline]] void scale(Index rows, Index k, Scalar s, const Panel<Scalar>& from,
                             const Panel<Scalar>& to) noexcept {
  for (Index c = 0; c < k; ++c) scale(rows, s, from[c], to[c]);
}

/// `out += s v vᵀ in`, `k` columns; `in` and `out` may be the same.
template <class Scalar>
[[gnu::noinline]] void add_projection(Index rows, Scalar s, const Scalar* v, Index k,
                                      const Panel<Scalar>& in, const Panel<Scalar>& out) noexcept {
  for (Index c = 0; c < k; ++c) inline_axpy(rows, s * inline_dot(rows, v, in[c]), v, out[c]);
}
/// `out += s v wᵀ`, `k` columns; elements of w are `step` apart.
template <class Scalar>
[[gnu::noinline]] void add_outer(Index rows, Index k, Scalar s, const Scalar* v, const Scalar* w,
                                 Index step, const Panel<Scalar>& out) noexcept {
  for (Index c = 0; c < k; ++c) inline_axpy(rows, s * w[c * step], v, out[c]);
}

/// `s −= v wᵀ + w vᵀ` in the columns from `first` to n and whole packets of rows from `top`.
template <class Scalar>
[[gnu::noinline]] void subtract_symmetric(Index first, Index top, Index n, const Scalar* v,
                                          const Scalar* w, const Panel<Scalar>& s) noexcept {
  using namespace Eigen::internal;
  using Packet = typename Simd<Scalar>::Packet;
  for (Index c = first; c < n; ++c) {
    const Packet vc = pset1<Packet>(-v[c]), wc = pset1<Packet>(-w[c]);
    Scalar* column = s[c];
    for (Index i = top; i < n; i += Simd<Scalar>::size) {
      pstoreu(column + i, pmadd(vc, ploadu<Packet>(w + i),
                                pmadd(wc, ploadu<Packet>(v + i), ploadu<Packet>(column + i))));
    }
  }
}

/// (a, b) ← (c a + s b, c b − s a)
template <class Scalar>
[[gnu::noinline]] void rotate(Index rows, Scalar c, Scalar s, Scalar* a, Scalar* b) noexcept {
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
