// SPDX-License-Identifier: BSD-3-Clause
// Kernels that work within packets, against plain loops, for every place in a packet.
#include <gtest/gtest.h>

#include <icat/math/factorization.hpp>
#include <random>

#include "support/linear_algebra.hpp"

namespace {

using icat::Index;

template <class S>
class Panels : public testing::Test {
 protected:
  static constexpr Index most = 37;
  using Matrix = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>;

  Matrix random(Index rows, Index cols) {
    std::uniform_real_distribution<S> element(-1, 1);
    return Matrix::NullaryExpr(rows, cols, [&] { return element(rng_); });
  }
  /// With what `margin` says beyond its rows, as after a level of more rows.
  icat::detail::Panel<S> panel(const Matrix& m, S margin = 0) {
    const auto p = memory_.take(m.cols());
    std::fill_n(p.data, m.cols() * p.stride, margin);
    for (Index j = 0; j < m.cols(); ++j) std::copy_n(m.col(j).data(), m.rows(), p[j]);
    return p;
  }
  static Matrix block(icat::detail::Panel<S> p, Index rows, Index cols) {
    Matrix m(rows, cols);
    for (Index j = 0; j < cols; ++j) std::copy_n(p[j], rows, m.col(j).data());
    return m;
  }
  void SetUp() override {
    values_.assign(60000, S(0));
    memory_ = icat::detail::PanelMemory<S>(values_.data(), most);
  }
  void again() { memory_ = icat::detail::PanelMemory<S>(values_.data(), most); }

  std::mt19937 rng_{3};
  std::vector<S> values_;
  icat::detail::PanelMemory<S> memory_{nullptr, most};
};
using Scalars = testing::Types<double, float>;
TYPED_TEST_SUITE(Panels, Scalars);

TYPED_TEST(Panels, AnElementIsReplacedAndNoOther) {
  for (Index k = 0; k < this->most; ++k) {
    this->again();
    const auto m = this->random(this->most, 1);
    const auto p = this->panel(m);
    icat::detail::set_element(p.data, k, TypeParam(7.5));
    for (Index i = 0; i < this->most; ++i) {
      EXPECT_EQ(p(i, 0), i == k ? TypeParam(7.5) : m(i, 0)) << k << ' ' << i;
    }
  }
}

TYPED_TEST(Panels, AColumnIsCutAtBothEnds) {
  for (Index first = 0; first < this->most; ++first) {
    for (Index last = first + 1; last <= this->most; ++last) {
      this->again();
      const auto m = this->random(this->most, 1), before = this->random(this->most, 1);
      const auto from = this->panel(m, 9), to = this->panel(before, 9);
      icat::detail::copy_between(first, last, from.data, to.data);
      const Index top = icat::detail::packet_begin<TypeParam>(first),
                  end = icat::detail::padded<TypeParam>(last);
      for (Index i = top; i < end; ++i) {
        ASSERT_EQ(to(i, 0), i >= first && i < last ? m(i, 0) : TypeParam(0))
            << first << ' ' << last;
      }
      for (Index i = 0; i < this->most; ++i) {
        if (i < top || i >= end) {
          ASSERT_EQ(to(i, 0), before(i, 0)) << first << ' ' << last;
        }
      }
    }
  }
}

TYPED_TEST(Panels, TwoReflectionsAtATimeAreOneAfterTheOther) {
  const TypeParam rounding = 50 * std::numeric_limits<TypeParam>::epsilon();
  for (Index n = 2; n <= this->most; ++n) {
    for (const Index k : {1, 2, 5}) {
      this->again();
      const auto v = this->panel(this->random(n, 2)), x = this->panel(this->random(n, k)),
                 y = this->memory_.take(k);
      TypeParam tau[2];
      for (Index i = 0; i < 2; ++i) {
        tau[i] = icat::detail::Reflection<TypeParam>::make(n, v[i], n - 1 - i).tau;
      }
      icat::detail::copy(x, y, k);
      for (Index i = 0; i < 2; ++i) icat::detail::reflect(n, tau[i], v[i], k, x);
      icat::detail::reflect_twice(n, tau[0], v[0], tau[1], v[1], icat::detail::dot(n, v[0], v[1]),
                                  k, y);
      const typename TestFixture::Matrix difference = this->block(x, n, k) - this->block(y, n, k);
      EXPECT_LT(difference.norm(), rounding * static_cast<TypeParam>(n)) << n << ' ' << k;
    }
  }
}

TYPED_TEST(Panels, TheInverseIsTheInverse) {
  for (Index n = 1; n <= 20; ++n) {
    this->again();
    const auto a = this->random(n, n + 3);
    const typename TestFixture::Matrix s = a * a.transpose();
    const auto p = this->panel(s);
    ASSERT_TRUE(icat::detail::invert(n, p, TypeParam(1e-6)));
    const Eigen::MatrixXd exact = testing_support::inverse(s.template cast<double>());
    const double error = (this->block(p, n, n).template cast<double>() - exact).norm();
    const double condition = exact.norm() * s.template cast<double>().norm();
    EXPECT_LT(error, 10 * condition * exact.norm() * std::numeric_limits<TypeParam>::epsilon());
  }
}

}  // namespace
