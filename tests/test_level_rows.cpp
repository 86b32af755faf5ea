// SPDX-License-Identifier: BSD-3-Clause
// f(S) of a level's rows: which way makes it, and that it is right on both sides of each switch.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <icat/tpik/stored_iteration.hpp>

#include "support/linear_algebra.hpp"
#include "support/panels.hpp"
#include "support/random_hierarchy.hpp"

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Rows = icat::detail::LevelRows<double, icat::BellRegularization<double>>;

constexpr int n = 9;
constexpr double threshold = 1e-2;
const icat::BellRegularization<double> bell;

struct Level {
  Level() {
    icat::detail::PanelMemory<double> next(memory.data(), n);
    rows.bind(n, 1, next);
  }
  void finish(const MatrixXd& J, const VectorXd& a) {
    rows.system.reset();
    rows.system.projector.reset();
    rows.begin(J.rows());
    const VectorXd current = VectorXd::Zero(n);
    for (Index i = 0; i < J.rows(); ++i) {
      const double wanted = J.row(i).sum();
      rows.row<n>(J, i, a(i), &wanted, current.data(), 0, 1.0);
    }
    rows.regularized = rows.vanished = false;
    ASSERT_TRUE(rows.finish());
  }
  /// Whether a spectral decomposition was made of S.
  bool spectrally() { return rows.below == 0 ? false : rows.system.spectral.below() > 0; }
  MatrixXd f() {
    const Index k = rows.rank;
    MatrixXd f = Panels<double>::block(rows.f, k, k);
    for (Index i = k - rows.below; i < k; ++i) {
      const VectorXd v = Panels<double>::block(rows.basis.from(i), k, 1);
      f += rows.inverses[i] * v * v.transpose();
    }
    return f;
  }

  std::vector<double> memory = std::vector<double>(
      static_cast<std::size_t>(Rows::columns(n, 1) * icat::detail::padded<double>(n)));
  Rows rows{bell, 1.0};
};

MatrixXd with_eigenvalues(HierarchyGenerator& gen, const VectorXd& squares, int rows, int columns) {
  const Index k = squares.size();
  const MatrixXd u = testing_support::orthogonal(gen.matrix(rows, rows)).leftCols(k);
  const MatrixXd v = testing_support::orthogonal(gen.matrix(columns, columns)).leftCols(k);
  return u * squares.cwiseSqrt().asDiagonal() * v.transpose();
}
MatrixXd exact(const MatrixXd& S) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> e(S);
  VectorXd values = e.eigenvalues();
  for (double& x : values) x = bell.inverse(std::max(x, 0.0));
  return e.eigenvectors() * values.asDiagonal() * e.eigenvectors().transpose();
}

// One eigenvalue below the threshold is set apart where power steps find it, and no other is near:
// from a hundredth of the threshold on. Others, and several, are found spectrally.
TEST(LevelRows, OneSmallEigenvalueIsSetApart) {
  for (const int rows : {2, 5, 9, 14, 23}) {
    for (const double small : {0.9, 0.3, 0.02, 0.011, 0.009, 1e-5, 0.0}) {
      for (const double second : {40.0, 4.0, 0.3}) {
        SCOPED_TRACE(testing::Message() << rows << " rows, " << small << ", " << second);
        HierarchyGenerator gen(static_cast<unsigned>(rows));
        const int k = std::min(rows, n);
        VectorXd squares = VectorXd::LinSpaced(k, 0.5, 1.5);
        squares(0) = small * threshold;
        squares(1) = second * threshold;
        const MatrixXd J = with_eigenvalues(gen, squares, rows, n);
        Level level;
        level.finish(J, VectorXd::Ones(rows));
        const bool alone = second > 1;
        EXPECT_TRUE(level.rows.regularized);
        EXPECT_EQ(level.rows.below, alone ? 1 : 2);
        EXPECT_EQ(level.spectrally(), !(alone && small < 0.05 * second && small > 0.01));
        const MatrixXd S = rows > n ? MatrixXd(J.transpose() * J) : MatrixXd(J * J.transpose());
        // Rounding of S, amplified by f' ≤ 1/λ² at 1e-4.
        EXPECT_LT((level.f() - exact(S)).norm(), 1e-7);
        const VectorXd v = Panels<double>::block(level.rows.basis.from(k - 1), k, 1);
        const MatrixXd V = Panels<double>::block(level.rows.basis, k, k);
        EXPECT_LT((V.transpose() * V - MatrixXd::Identity(k, k)).norm(), 1e-13);
        EXPECT_LT((S * v - v.dot(S * v) * v).norm(), 1e-13);
      }
    }
  }
}

// Rows that are zero appear nowhere. A level that had no more rows than axes, or has fewer now, has
// a zero singular value.
TEST(LevelRows, ZeroRowsAppearNowhere) {
  HierarchyGenerator gen(1);
  for (const int rows : {1, 4, 9}) {
    for (const int zeros : {0, 1, 3, rows}) {
      if (zeros > rows) continue;
      SCOPED_TRACE(testing::Message() << zeros << " of " << rows);
      MatrixXd J = gen.matrix(rows, n), rest(rows - zeros, n);
      VectorXd a = VectorXd::Constant(rows, 0.5);
      Index k = 0;
      for (Index i = 0; i < rows; ++i) {
        // The first row, the last, and one between.
        const bool zero =
            zeros == rows || (zeros > 0 && (i == 0 || (zeros == 3 && i % 2 == 1 && i < 4)));
        if (zero) J.row(i).setZero();
        if (zero) continue;
        rest.row(k++) = J.row(i);
        a(i) = 1;
      }
      ASSERT_EQ(k, rows - zeros);
      Level with, without;
      with.finish(J, a);
      without.finish(rest, VectorXd::Ones(k));
      EXPECT_EQ(with.rows.rank, std::min<Index>(k, n));
      EXPECT_EQ(with.rows.binary, true);
      EXPECT_EQ(with.rows.vanished, k < std::min(rows, n));
      EXPECT_EQ(with.rows.tall(), k > n);
      EXPECT_EQ((with.f() - without.f()).norm(), 0);
      for (Index i = 0; i < std::min<Index>(k, n); ++i)
        EXPECT_EQ(with.rows.e(i, 0), without.rows.e(i, 0));
    }
  }
}

// A row that repeats another leaves a singular value of zero in C, which is no partial row; one
// that nearly does leaves a small one, which is.
TEST(LevelRows, RepeatedRowsAreNoPartialRows) {
  HierarchyGenerator gen(2);
  for (const double off : {0.0, 1e-12, 1e-9, 1e-6, 1e-3}) {
    for (const double a : {1.0, 0.5}) {
      SCOPED_TRACE(testing::Message() << off << ", " << a);
      MatrixXd J = gen.matrix(3, n);
      J.row(2) = J.row(0) + off * gen.matrix(1, n);
      icat::detail::StoredIteration<double, n, 1, icat::BellRegularization<double>> q(n, bell, 1);
      const VectorXd current = VectorXd::Zero(n);
      const double wanted = 1;
      const auto solve = [&](Index first, Index count, double activation) {
        q.begin(count);
        for (Index i = first; i < first + count; ++i) {
          q.row<n>(MatrixXd(J), i, activation, &wanted, current.data(), 0, 1.0);
        }
        ASSERT_TRUE(q.solve());
        q.accept();
      };
      // In one level: σ is 2 off², beside f(0) = 1e4.
      solve(0, 3, 1);
      const bool felt = off > 1e-10;
      EXPECT_EQ(q.projector().partial(), felt ? 1 : 0);
      EXPECT_EQ(q.projector().free(), n - 2);
      // As a level of its own.
      q.start().reset();
      solve(0, 2, 1);
      solve(2, 1, a);
      EXPECT_EQ(q.projector().partial(), felt ? 1 : 0);
    }
  }
}

}  // namespace
