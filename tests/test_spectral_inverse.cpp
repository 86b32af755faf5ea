// SPDX-License-Identifier: BSD-3-Clause
// f(S) of projectors and of matrices with many equal eigenvalues, which a hierarchy makes of its
// lower levels.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <icat/math/regularization.hpp>
#include <icat/math/spectral_inverse.hpp>
#include <random>

#include "support/linear_algebra.hpp"
#include "support/panels.hpp"

namespace {

using Matrix = Eigen::MatrixXd;

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
    const Matrix Q = testing_support::orthogonal(A).leftCols(rank);
    Eigen::VectorXd values = Eigen::VectorXd::Ones(rank);
    for (int i = 0; k % 2 == 1 && i < rank; ++i) {
      if (rng() % 3 == 0) values(i) = std::pow(10.0, -12 * uniform(rng));
    }
    const Matrix product = Q * values.asDiagonal() * Q.transpose();
    const Matrix S = (product + product.transpose()) / 2;

    Panels<double> memory(n);
    icat::detail::SpectralInverse<double> inverse;
    inverse.bind(n, memory.next);
    const auto s = memory.take(n), out = memory.take(n), unit = memory.take(n), b = memory.take(1),
               z = memory.take(1);
    memory.set(s, S);
    ASSERT_TRUE(inverse.compute(s, n, out, f)) << "matrix " << k << ", " << n << " x " << n;
    memory.set(unit, Eigen::MatrixXd::Identity(n, n));
    inverse.add_small(n, unit, out);

    memory.set(b, Matrix::NullaryExpr(n, 1, [&] { return normal(rng); }));
    memory.set(s, S);
    ASSERT_TRUE(inverse.apply(s, n, b.data, z.data, f)) << "matrix " << k;

    // Where no eigenvalue is small, f is the inverse on the range.
    if (k % 2 == 1) continue;
    const Matrix value = S * memory.block(out, n, n) * S;
    EXPECT_LT((value - S).norm(), 1e-12 * n) << "matrix " << k;  // n² products of rounding 1e-16
  }
}

}  // namespace
