// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The set of wrenches of thrusts within bounds. The image of a box, Z = {G f : lower ≤ f ≤ upper},
/// is a zonotope, and each of its facets is parallel to p − 1 columns of G, where p is the number
/// of its rows. So one half-space for each choice of p − 1 independent columns describes it
/// exactly:
///
///     Z = {z : −below_k ≤ ν_kᵀ z ≤ above_k},   ν_k ⟂ the chosen columns,
///     above_k = Σᵢ max(ν_kᵀ gᵢ lowerᵢ, ν_kᵀ gᵢ upperᵢ),   below_k the same of −ν_k
///
/// Every half-space contains Z for any ν_k, so that rounding in ν_k never cuts a part of Z off. A
/// linear program over Z along a line is then one pass over a list, in a time that is known.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "icat/core/list.hpp"
#include "icat/core/types.hpp"

namespace icat::detail {

/// Zonotopes of up to six rows, in one list that is allocated once.
template <class Scalar>
class Zonotopes {
 public:
  /// Where a zonotope is in the list.
  struct Set {
    Index rows, first, end;
  };
  /// From a point along a direction.
  struct Ray {
    Scalar exit;   ///< the largest factor of the direction inside
    Scalar depth;  ///< distance from the point to the nearest facet, within the last rows
  };

  /// @param room  of half-spaces
  explicit Zonotopes(std::size_t room) : spaces_(room) {}

  /// Forgets all of them.
  void clear() noexcept { size_ = 0; }

  /// Adds the zonotope of the columns `g`, each of `rows` numbers; `stride` from one to the next,
  /// `n` of them. Columns of rank `rows`.
  Set add(Index rows, Index n, Index stride, const Scalar* g, const Scalar* lower,
          const Scalar* upper) noexcept {
    const Set empty{rows, size_, size_};
    const Index chosen = rows - 1;
    Index pick[6];  // pick[0] < pick[1] < …
    for (Index i = 0; i < chosen; ++i) pick[i] = i;
    if (chosen > n) return empty;
    while (true) {
      HalfSpace& space = spaces_[static_cast<std::size_t>(size_)];
      if (normal(rows, stride, g, lower, upper, pick, space)) {
        space.above = space.below = Scalar(0);
        for (Index i = 0; i < n; ++i) {
          Scalar along(0);
          for (Index j = 0; j < rows; ++j) along += space.normal[j] * g[i * stride + j];
          space.above += std::max(along * lower[i], along * upper[i]);
          space.below += std::max(-along * lower[i], -along * upper[i]);
        }
        ++size_;
      }
      Index last = chosen - 1;
      while (last >= 0 && pick[last] == n - chosen + last) --last;
      if (last < 0) break;
      ++pick[last];
      for (Index i = last + 1; i < chosen; ++i) pick[i] = pick[i - 1] + 1;
    }
    return {rows, empty.first, size_};
  }

  /// What the last coordinate may be where the others are those of `point`.
  void interval(const Set& set, const Scalar* point, Scalar& lower, Scalar& upper) const noexcept {
    lower = -infinity<Scalar>;
    upper = infinity<Scalar>;
    for (Index k = set.first; k < set.end; ++k) {
      const HalfSpace& space = spaces_[static_cast<std::size_t>(k)];
      const Scalar last = space.normal[set.rows - 1];
      if (std::abs(last) <= negligible) continue;
      Scalar at(0);
      for (Index j = 0; j + 1 < set.rows; ++j) at += space.normal[j] * point[j];
      const Scalar one = (space.above - at) / last, other = -(space.below + at) / last;
      upper = std::min(upper, std::max(one, other));
      lower = std::max(lower, std::min(one, other));
    }
    if (lower > upper) lower = upper = (lower + upper) / Scalar(2);  // by rounding
  }

  /// From the first `fixed` coordinates of `point`, the others 0, along `direction`, which has the
  /// others.
  Ray ray(const Set& set, Index fixed, const Scalar* point,
          const Scalar* direction) const noexcept {
    Ray answer{infinity<Scalar>, infinity<Scalar>};
    for (Index k = set.first; k < set.end; ++k) {
      const HalfSpace& space = spaces_[static_cast<std::size_t>(k)];
      Scalar at(0), rate(0), square(0);
      for (Index j = 0; j < fixed; ++j) at += space.normal[j] * point[j];
      for (Index j = fixed; j < set.rows; ++j) {
        rate += space.normal[j] * direction[j - fixed];
        square += space.normal[j] * space.normal[j];
      }
      if (!(square > negligible * negligible)) continue;
      const Scalar above = std::max(space.above - at, Scalar(0));
      const Scalar below = std::max(space.below + at, Scalar(0));
      answer.depth = std::min(answer.depth, std::min(above, below) / std::sqrt(square));
      if (rate > Scalar(0)) answer.exit = std::min(answer.exit, above / rate);
      if (rate < Scalar(0)) answer.exit = std::min(answer.exit, below / -rate);
    }
    return answer;
  }

  /// Half-spaces in the list.
  Index size() const noexcept { return size_; }

 private:
  struct HalfSpace {
    Scalar normal[6], above, below;
  };
  static constexpr Scalar negligible = Scalar(1000) * std::numeric_limits<Scalar>::epsilon();

  /// The unit vector that is normal to the columns `pick`, by elimination with full pivoting. False
  /// where they depend on each other.
  static bool normal(Index rows, Index stride, const Scalar* g, const Scalar* lower,
                     const Scalar* upper, const Index* pick, HalfSpace& space) noexcept {
    Scalar m[5][6];
    Index order[6];
    for (Index j = 0; j < rows; ++j) order[j] = j;
    for (Index r = 0; r + 1 < rows; ++r) {
      Scalar square(0);
      for (Index j = 0; j < rows; ++j) {
        m[r][j] = g[pick[r] * stride + j];
        square += m[r][j] * m[r][j];
      }
      const Scalar norm = std::sqrt(square);
      if (!(norm * std::max(-lower[pick[r]], upper[pick[r]]) > negligible)) return false;
      for (Index j = 0; j < rows; ++j) m[r][j] /= norm;
    }
    for (Index step = 0; step + 1 < rows; ++step) {
      Index row = step, col = step;
      for (Index r = step; r + 1 < rows; ++r) {
        for (Index j = step; j < rows; ++j) {
          if (!(std::abs(m[r][j]) > std::abs(m[row][col]))) continue;
          row = r;
          col = j;
        }
      }
      if (!(std::abs(m[row][col]) > negligible)) return false;
      for (Index j = 0; j < rows; ++j) std::swap(m[row][j], m[step][j]);
      for (Index r = 0; r + 1 < rows; ++r) std::swap(m[r][col], m[r][step]);
      std::swap(order[col], order[step]);
      for (Index r = step + 1; r + 1 < rows; ++r) {
        const Scalar factor = m[r][step] / m[step][step];
        for (Index j = step; j < rows; ++j) m[r][j] -= factor * m[step][j];
      }
    }
    Scalar v[6], square(1);
    v[rows - 1] = Scalar(1);
    for (Index r = rows - 1; r-- > 0;) {
      v[r] = Scalar(0);
      for (Index j = r + 1; j < rows; ++j) v[r] -= m[r][j] * v[j];
      v[r] /= m[r][r];
      square += v[r] * v[r];
    }
    const Scalar norm = std::sqrt(square);
    for (Index j = 0; j < rows; ++j) space.normal[order[j]] = v[j] / norm;
    return true;
  }

  List<HalfSpace> spaces_;
  Index size_{0};
};

}  // namespace icat::detail
