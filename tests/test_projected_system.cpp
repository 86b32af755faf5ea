// SPDX-License-Identifier: BSD-3-Clause
// The ways to f(M) Bᵀ e, one by one: which are certain, and that those that answer agree with
// `full`, which needs no certificate. Without this, one that always refused would only make a solve
// slow.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <icat/tpik/projected_system.hpp>

#include "support/linear_algebra.hpp"
#include "support/panels.hpp"
#include "support/random_hierarchy.hpp"

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Panel = icat::detail::Panel<double>;
using System = icat::detail::ProjectedSystem<double, icat::BellRegularization<double>>;

constexpr int n = 10;
constexpr double threshold = 1e-2;

/// A system of n free axes, of which `taken` leave after one partial row with activation `a` along
/// the first axis. The rest is orthogonal to it, but for what `along` says.
class ProjectedSystem : public testing::Test {
 protected:
  static constexpr Index columns = System::columns(n, 1) + 12 * n;

  ProjectedSystem() {
    icat::detail::PanelMemory<double> next(memory.data(), n);
    system.bind(n, 1, next);
    for (Panel* p : {&rows, &gram, &inverse, &btb, &u, &v}) *p = next.take(n);
    for (Panel* p : {&e, &rhs, &y, &z}) *p = next.take(1);
  }

  /// A partial row along the first axis leaves Q = I − a e₁e₁ᵀ, then axes from the last on are
  /// taken together with a part `slope` of the first.
  void start(double a, int taken = 0, double slope = 0) {
    system.reset();
    system.projector.reset();
    set(u, a * VectorXd::Unit(n, 0));
    set(v, VectorXd::Unit(n, 0));
    system.projector.gain(1, u, v);
    for (int k = 0; k < taken; ++k) {
      VectorXd row = VectorXd::Unit(n, n - 1 - k);
      row(0) = slope;
      set(u, row.head(n - k));
      system.projector.take(1, u);
    }
  }
  /// B, m × r, with its Gram matrices and e = 1.
  void level(const MatrixXd& B) {
    const Index m = B.rows(), r = B.cols();
    ASSERT_EQ(r, system.projector.free());
    if (m <= r) {
      set(rows, B.transpose());
      set(gram, B * B.transpose());
      set(inverse, testing_support::inverse(B * B.transpose()));
    } else {
      set(inverse, testing_support::inverse(B.transpose() * B));
    }
    set(btb, B.transpose() * B);
    set(e, VectorXd::Ones(m).head(std::min(m, Index(n))));
    set(rhs, B.transpose() * VectorXd::Ones(m));
  }
  VectorXd full() {
    set(rhs, Panels<double>::block(rhs, system.projector.free(), 1));
    EXPECT_TRUE(system.full(btb, rhs, z));
    system.reset();  // forget that eigenvalues were small
    return Panels<double>::block(z, system.projector.free(), 1);
  }
  static void set(Panel p, const MatrixXd& m) {
    icat::detail::clear(p, m.cols());
    Panels<double>::set(p, m);
  }

  std::vector<double> memory =
      std::vector<double>(static_cast<std::size_t>(columns * icat::detail::padded<double>(n)));
  System system{icat::BellRegularization<double>{}, 1.0};
  Panel rows, gram, inverse, btb, u, v, e, rhs, y, z;
};

/// m orthonormal rows of r columns that make `sine` with the first axis, each.
MatrixXd orthonormal(Index m, Index r, double sine) {
  MatrixXd B = MatrixXd::Zero(m, r);
  for (Index i = 0; i < m; ++i) B(i, i + 1) = 1;
  B(0, 0) = sine;
  B(0, 1) = std::sqrt(1 - sine * sine);
  return B;
}

// K = a², VᵀV = 1, and rows orthogonal to V: M has the eigenvalue a² there.
TEST_F(ProjectedSystem, RowsAreIndependentWhereThePartialRowIsAboveTheThreshold) {
  for (const int m : {1, 3, n - 2}) {
    for (const double a : {0.02, 0.0999, 0.1001, 0.4, 1 - 1e-9}) {
      SCOPED_TRACE(testing::Message() << m << ", " << a);
      start(a);
      level(orthonormal(m, n, 0));
      EXPECT_EQ(system.independent(m, rows, inverse), a * a > threshold);
      const VectorXd answer = orthonormal(m, n, 0) * full();
      EXPECT_LT((answer - VectorXd::Ones(m)).norm(), 1e-12);  // y = e, certain or not
    }
  }
}

// A row that makes an angle with the partial one: the smaller it is, the smaller M's eigenvalue.
TEST_F(ProjectedSystem, RowsAreIndependentAsLongAsTheyMakeAnAngleWithThePartialRow) {
  const double a = 0.5;
  for (const double sine : {0.0, 0.5, 0.9, 0.96, 0.999, 1.0}) {
    SCOPED_TRACE(sine);
    start(a);
    const MatrixXd B = orthonormal(2, n, sine);
    level(B);
    const MatrixXd M =
        B.transpose() * B + a * a * VectorXd::Unit(n, 0) * VectorXd::Unit(n, 0).transpose();
    const double least = testing_support::symmetric_eigenvalues(M.topLeftCorner(3, 3))(0);
    const bool certain = system.independent(2, rows, inverse);
    if (certain) {
      EXPECT_GT(least, threshold);
      EXPECT_LT((B * full() - VectorXd::Ones(2)).norm(), 1e-12);
    }
    EXPECT_EQ(certain, least > threshold) << least;  // the bound on (G − σ_t)⁻¹ costs little
  }
}

TEST_F(ProjectedSystem, MoreRowsThanAreLeftAreNotIndependent) {
  start(0.5);
  level(orthonormal(n - 1, n, 0));
  EXPECT_TRUE(system.independent(n - 1, rows, inverse));
  level(MatrixXd::Identity(n, n));
  EXPECT_FALSE(system.independent(n, rows, inverse));
}

// Two more partial rows take the way for matrices.
TEST_F(ProjectedSystem, SeveralPartialRowsAreCertifiedTogether) {
  for (const double second : {0.05, 0.2}) {
    start(0.5);
    set(u, 0.5 * VectorXd::Unit(n, n - 1));
    set(v, VectorXd::Unit(n, n - 1));
    system.projector.gain(1, u, v);
    set(u, second * VectorXd::Unit(n, n - 2));
    set(v, VectorXd::Unit(n, n - 2));
    system.projector.gain(1, u, v);
    level(orthonormal(3, n, 0));
    EXPECT_EQ(system.independent(3, rows, inverse), second * second > threshold);
  }
}

// An axis was taken that the partial row leans on, so that the part c of ‖e₁‖² is left on free
// axes. M there and on the taken axis is [c a², a √(c (1 − c)); ·, 1]: without K_t the smaller
// eigenvalue would seem to be c² a².
TEST_F(ProjectedSystem, TakenAxesCountAgainstThePartialRow) {
  const double a = 0.5;
  for (const double c : {1.0, 0.5, 0.21, 0.202, 0.198, 0.1}) {
    SCOPED_TRACE(c);
    start(a, 1, std::sqrt(1 / c - 1));
    const Index r = system.projector.free();
    system.projector.weigh();
    EXPECT_NEAR(system.projector.v_gram()(0, 0), c, 1e-12);
    const double trace = 1 + c * a * a, determinant = c * c * a * a;
    const double least = trace / 2 - std::sqrt(trace * trace / 4 - determinant);
    const MatrixXd B = orthonormal(2, r, 0);
    level(B);
    EXPECT_EQ(system.independent(2, rows, inverse), least > threshold) << least;
    EXPECT_LT((B * full() - VectorXd::Ones(2)).norm(), 1e-12);
  }
}

// Tall levels: all that `corrected`, `regular` and `full` answer is the same.
TEST_F(ProjectedSystem, WaysAgreeOnTallLevels) {
  HierarchyGenerator gen(1);
  for (const double a : {0.05, 0.4, 0.9}) {
    start(a, 2, 0.5);
    const MatrixXd B = gen.matrix(n, system.projector.free());
    level(B);
    const VectorXd by_full = full();
    ASSERT_TRUE(system.corrected(inverse, rhs, z));  // G ≥ σ_t: K_v > 0 is enough
    EXPECT_LT((Panels<double>::block(z, by_full.size(), 1) - by_full).norm(), 1e-10);
    ASSERT_TRUE(system.regular(btb, rhs, z));
    EXPECT_LT((Panels<double>::block(z, by_full.size(), 1) - by_full).norm(), 1e-10);
  }
}

// As many rows as free axes: K_v > 0 is enough, which is c > σ_t with the c of
// TakenAxesCountAgainstThePartialRow, whatever a is.
TEST_F(ProjectedSystem, SquareLevelsAreCorrectedWhereThePartialRowIsLeft) {
  HierarchyGenerator gen(3);
  for (const double a : {0.02, 0.4}) {
    for (const double c : {1.0, 0.5, 0.02, 0.0101, 0.0099, 0.005}) {
      SCOPED_TRACE(testing::Message() << a << ", " << c);
      start(a, 1, std::sqrt(1 / c - 1));
      const Index r = system.projector.free();
      const MatrixXd B = testing_support::orthogonal(gen.matrix(r, r));  // G = I
      level(B);
      const VectorXd by_full = B * full();
      EXPECT_EQ(system.corrected_rows(rows, inverse, e, y), c > threshold);
      if (c <= threshold) continue;
      EXPECT_LT((Panels<double>::block(y, r, 1) - by_full).norm(), 1e-10);
      EXPECT_GT((by_full - VectorXd::Ones(r)).norm(), 1e-9);  // something was corrected
    }
  }
}
TEST_F(ProjectedSystem, DenseProjectorsAreNotCorrected) {
  HierarchyGenerator gen(4);
  start(0.4);
  level(gen.matrix(n, n));
  EXPECT_TRUE(system.corrected_rows(rows, inverse, e, y));
  EXPECT_TRUE(system.corrected(inverse, rhs, z));
  system.projector.become_dense();
  EXPECT_FALSE(system.corrected_rows(rows, inverse, e, y));
  EXPECT_FALSE(system.corrected(inverse, rhs, z));
}

// A wide level leaves a direction at a²: Cholesky factors above the threshold, `reduced` below.
TEST_F(ProjectedSystem, WaysAgreeOnWideLevels) {
  HierarchyGenerator gen(2);
  for (const double a : {0.05, 0.4}) {
    for (const int taken : {0, 3}) {
      SCOPED_TRACE(testing::Message() << a << ", " << taken);
      start(a, taken, 0.2);
      const Index r = system.projector.free();
      const MatrixXd B = gen.matrix(3, r);
      level(B);
      const VectorXd by_full = B * full();
      EXPECT_FALSE(system.regular(btb, rhs, z));  // M has zeros outside the rows
      system.reset();
      ASSERT_TRUE(system.reduces(3));
      ASSERT_TRUE(system.reduced(3, rows, gram, e, y));
      EXPECT_LT((Panels<double>::block(y, 3, 1) - by_full).norm(), 1e-10);
      EXPECT_FALSE(system.reduces(n));  // M has no more rows
    }
  }
}

}  // namespace
