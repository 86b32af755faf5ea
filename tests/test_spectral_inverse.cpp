// SPDX-License-Identifier: BSD-3-Clause
// f(S) of projectors and of matrices with many equal eigenvalues, which a hierarchy makes of its
// lower levels.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <icat/math/regularization.hpp>
#include <icat/math/spectral_inverse.hpp>
#include <random>

namespace {

using Matrix = Eigen::MatrixXd;
using Panel = icat::detail::Panel<double, Eigen::Dynamic>;
using Column = icat::detail::Panel<double, Eigen::Dynamic, 1>;

// Seen in a torso of 16 joints: two eigenvalues of 1 beside ten of 0, and no diagonal element above
// 0.43. What an element of 1 leaves of rounding passed for an element still to be eliminated.
TEST(SpectralInverse, ConvergesForEqualEigenvalues) {
  std::mt19937 rng(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const icat::BellRegularization<double> f;
  for (int k = 0; k < 40000; ++k) {
    const int n = 4 + k % 21, rank = 1 + static_cast<int>(rng() % static_cast<unsigned>(n));
    const Matrix A = Matrix::NullaryExpr(n, rank, [&] { return normal(rng); });
    const Matrix Q = Eigen::HouseholderQR<Matrix>(A).householderQ() * Matrix::Identity(n, rank);
    Eigen::VectorXd values = Eigen::VectorXd::Ones(rank);
    for (int i = 0; k % 2 == 1 && i < rank; ++i) {
      if (rng() % 3 == 0) values(i) = std::pow(10.0, -12 * uniform(rng));
    }
    const Matrix product = Q * values.asDiagonal() * Q.transpose();
    const Matrix S = (product + product.transpose()) / 2;

    auto s = icat::detail::zero_panel<Panel>(n, n), out = s;
    s.topLeftCorner(n, n) = S;
    icat::detail::SpectralInverse<double, Eigen::Dynamic> inverse(n);
    ASSERT_TRUE(inverse.compute(s, n, out, f)) << "matrix " << k << ", " << n << " x " << n;

    auto b = icat::detail::zero_panel<Column>(n, 1), z = b;
    for (int i = 0; i < n; ++i) b(i, 0) = normal(rng);
    s.topLeftCorner(n, n) = S;
    ASSERT_TRUE(inverse.apply(s, n, b.data(), z.data(), f)) << "matrix " << k;

    // Where no eigenvalue is small, f is the inverse on the range.
    if (k % 2 == 1) continue;
    const Matrix value = S * out.topLeftCorner(n, n) * S;
    EXPECT_LT((value - S).norm(), 1e-12 * n) << "matrix " << k;  // n² products of rounding 1e-16
  }
}

}  // namespace
