// SPDX-License-Identifier: BSD-3-Clause
// The solver takes shortcuts where they are exact (docs/solver.md). Here each is compared with the
// literal Eq. (20)–(23) on both sides of its switch.
#include <gtest/gtest.h>

#include <Eigen/QR>
#include <icat/tpik/tpik.hpp>

#include "support/linear_algebra.hpp"
#include "support/oracle_rule.hpp"
#include "support/panels.hpp"
#include "support/sanitized.hpp"

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// ẏ, and Q after the last level, against the literal formula in long double.
void expect_literal(const RandomHierarchy& h, double tolerance = 1e-9,
                    const icat::Tpik<double>::Options& options = {}) {
  icat::Tpik<double> tpik(h.dof, options);
  const auto& f = options.regularization;
  auto exact = oracle::start<long double>(h, {f.lambda, f.threshold, options.projection_weight});
  ASSERT_EQ(tpik.reset(h.rho0, h.Q0), icat::Status::ok);
  for (const auto& level : h.levels) {
    ASSERT_EQ(tpik.add_level(level.J, level.a, level.reference), icat::Status::ok);
    exact.add(level.J.cast<long double>(), level.a.cast<long double>(),
              level.reference.cast<long double>());
    EXPECT_LT((tpik.projector().cast<long double>() - exact.Q).norm(), tolerance);
    EXPECT_LT((tpik.velocity().cast<long double>() - exact.rho).norm(),
              tolerance * (1 + exact.rho.norm()));
  }
  ASSERT_EQ(tpik.minimize_velocity(), icat::Status::ok);
  exact.close();
  EXPECT_LT((tpik.velocity().cast<long double>() - exact.rho).norm(),
            tolerance * (1 + exact.rho.norm()));
}

RandomHierarchy empty(int dof) {
  RandomHierarchy h;
  h.dof = dof;
  h.rho0 = VectorXd::Zero(dof);
  h.Q0 = MatrixXd::Identity(dof, dof);
  return h;
}

/// m × n with these singular values.
MatrixXd with_singular_values(HierarchyGenerator& gen, const VectorXd& s, int n) {
  const auto m = s.size();
  const MatrixXd u = testing_support::orthogonal(gen.matrix(m, m));
  const MatrixXd v = testing_support::orthogonal(gen.matrix(n, n));
  return u * s.asDiagonal() * v.leftCols(m).transpose();
}

RandomLevel level(HierarchyGenerator& gen, const MatrixXd& J, const VectorXd& a) {
  return {J, a, gen.matrix(J.rows(), 1)};
}

constexpr double threshold = 1e-2;

// A binary level of full rank only shrinks the space, unless a singular value is regularized. The
// certificate is sure of σ² ≥ σ_t where Σ 1/σ² ≤ 1/σ_t: both its ends, and both sides of σ_t.
TEST(Paths, BinaryLevelsAroundTheThreshold) {
  HierarchyGenerator gen(1);
  for (const double square :
       {0.0, 1e-9, 0.5 * threshold, threshold * (1 - 1e-9), threshold, threshold * (1 + 1e-9),
        1.5 * threshold, 3.9 * threshold, 4.1 * threshold, 1.0}) {
    SCOPED_TRACE(square);
    RandomHierarchy h = empty(9);
    const VectorXd s = VectorXd::Constant(4, std::sqrt(square));
    VectorXd one = s;
    one.head(3).setOnes();
    for (const VectorXd& values : {s, one}) {
      h.levels = {level(gen, gen.matrix(1, 9), VectorXd::Ones(1)),
                  level(gen, with_singular_values(gen, values, 9), VectorXd::Ones(4)),
                  level(gen, gen.matrix(3, 9), VectorXd::Ones(3))};
      // f' is 1/λ² at most, so the roundings of a small square are amplified by that.
      expect_literal(h, 1e-8);
    }
  }
}

// One scalar task has a closed form.
TEST(Paths, ScalarTasksAroundTheThreshold) {
  HierarchyGenerator gen(2);
  for (const double square : {1e-12, 0.5 * threshold, threshold * (1 - 1e-12), threshold, 1.0}) {
    RandomHierarchy h = empty(5);
    h.levels = {level(gen, with_singular_values(gen, VectorXd::Constant(1, std::sqrt(square)), 5),
                      VectorXd::Ones(1)),
                level(gen, gen.matrix(2, 5), VectorXd::Ones(2))};
    expect_literal(h);
  }
}

// Binary and not quite binary levels take different paths.
TEST(Paths, ActivationsNextToOne) {
  HierarchyGenerator gen(3);
  const RandomLevel first = level(gen, gen.matrix(2, 8), VectorXd::Ones(2));
  const RandomLevel second = level(gen, gen.matrix(3, 8), VectorXd::Ones(3));
  const RandomLevel third = level(gen, gen.matrix(4, 8), VectorXd::Ones(4));
  for (const double a : {1.0, std::nextafter(1.0, 0.0), 1 - 1e-9, 1 - 1e-3}) {
    SCOPED_TRACE(a);
    RandomHierarchy h = empty(8);
    h.levels = {first, second, third};
    h.levels[0].a(1) = a;
    expect_literal(h);
    h.levels[0].a(1) = 1;
    h.levels[1].a(2) = a;
    expect_literal(h);
  }
}

// (I − Q)ᵀ(I − Q) has the eigenvalue a² after a partial level: Cholesky above σ_t, QR steps below.
TEST(Paths, PartialLevelsAroundTheThreshold) {
  HierarchyGenerator gen(4);
  for (const double a : {1e-3, 0.05, 0.1 * (1 - 1e-9), 0.1, 0.1 * (1 + 1e-9), 0.15, 0.5}) {
    SCOPED_TRACE(a);
    RandomHierarchy h = empty(7);
    for (const int rows : {1, 3, 1, 2, 4}) {
      h.levels.push_back(level(gen, gen.matrix(rows, 7), VectorXd::Constant(rows, a)));
    }
    expect_literal(h);
  }
}

// As many rows as are free, one less, one more; and more than one chunk of n rows.
TEST(Paths, WideAndTallLevels) {
  HierarchyGenerator gen(5);
  for (const int rows : {4, 5, 6, 7, 15, 30}) {
    for (const double a : {1.0, 0.6}) {
      for (const double first : {1.0, 0.3}) {
        SCOPED_TRACE(rows);
        RandomHierarchy h = empty(7);
        h.levels = {level(gen, gen.matrix(2, 7), VectorXd::Constant(2, first)),
                    level(gen, gen.matrix(rows, 7), VectorXd::Constant(rows, a)),
                    level(gen, gen.matrix(3, 7), VectorXd::Ones(3))};
        expect_literal(h);
      }
    }
  }
}

// Rows that touch nothing new: repeated ones, and levels that come twice.
TEST(Paths, RowsThatTouchNothingNew) {
  HierarchyGenerator gen(6);
  for (const double a : {1.0, 0.4}) {
    RandomHierarchy h = empty(6);
    MatrixXd J = gen.matrix(3, 6);
    J.row(2) = J.row(0);
    h.levels = {level(gen, J, VectorXd::Constant(3, a)), level(gen, J, VectorXd::Constant(3, 0.7)),
                level(gen, J.row(1), VectorXd::Ones(1)),
                level(gen, gen.matrix(2, 6), VectorXd::Ones(2))};
    expect_literal(h);
  }
}

// A start that chooses coordinates, and the same in turned axes, which is dense.
TEST(Paths, StartsThatChooseCoordinatesAndOthers) {
  HierarchyGenerator gen(7);
  for (const bool turned : {false, true}) {
    RandomHierarchy h = empty(8);
    for (const int i : {1, 4, 7}) h.Q0(i, i) = 0;
    h.rho0 << 0, 0.3, 0, 0, -0.2, 0, 0, 0.1;
    MatrixXd axes = MatrixXd::Identity(8, 8);
    if (turned) axes = testing_support::orthogonal(gen.matrix(8, 8));
    h.Q0 = axes * h.Q0 * axes.transpose();
    h.rho0 = axes * h.rho0;
    for (const double a : {1.0, 0.5, 1.0}) {
      h.levels.push_back(level(gen, gen.matrix(2, 8), VectorXd::Constant(2, a)));
    }
    expect_literal(h);
  }
}

// Tasks of columns that are given have zero rows: alone in a level, beside others, partial, and
// with a start that takes the last columns, or others.
TEST(Paths, RowsOfGivenColumns) {
  HierarchyGenerator gen(17);
  for (const bool last : {true, false}) {
    for (const double a : {1.0, 0.5}) {
      SCOPED_TRACE(testing::Message() << last << ", " << a);
      RandomHierarchy h = empty(9);
      const int given = last ? 5 : 2;
      for (int i = given; i < given + 4; ++i) h.Q0(i, i) = 0;
      h.rho0.segment(given, 4).setConstant(0.3);
      const auto rows = [&](int m) {
        MatrixXd J = MatrixXd::Zero(m, 9);
        J.middleCols(given, 4) = gen.matrix(m, 4);
        return J;
      };
      MatrixXd mixed = gen.matrix(3, 9);
      mixed.row(1) = rows(1);
      VectorXd weights = VectorXd::Ones(3);
      weights(1) = a;
      h.levels = {level(gen, rows(1), VectorXd::Constant(1, a)),
                  level(gen, rows(6), VectorXd::Constant(6, a)),
                  level(gen, mixed, weights),
                  level(gen, gen.matrix(1, 9), VectorXd::Constant(1, a)),
                  level(gen, rows(12), VectorXd::Ones(12)),
                  level(gen, gen.matrix(6, 9), VectorXd::Ones(6))};
      expect_literal(h);
    }
  }
}

// Where a general hierarchy has used up every direction, what follows is nothing.
TEST(Paths, NothingLeft) {
  HierarchyGenerator gen(8);
  RandomHierarchy h = empty(6);
  h.levels = {level(gen, gen.matrix(1, 6), VectorXd::Constant(1, 0.5)),
              level(gen, gen.matrix(6, 6), VectorXd::Ones(6)),
              level(gen, gen.matrix(4, 6), VectorXd::Constant(4, 0.5)),
              level(gen, gen.matrix(2, 6), VectorXd::Ones(2))};
  expect_literal(h);
}

// A partial row is a column of V. Levels below it are independent of it where m + p ≤ r, and it is
// certain where a² is well above σ_t: both sides of either, with axes taken before and after it.
TEST(Paths, RowsIndependentOfPartialOnesOrNot) {
  HierarchyGenerator gen(10);
  for (const double a : {0.03, 0.0999, 0.1, 0.1001, 0.12, 0.4, 0.97, 1 - 1e-9}) {
    for (const int partial : {1, 2, 3}) {
      for (const int rows : {1, 9 - 3 - partial - 1, 9 - 3 - partial, 9 - 3 - partial + 1, 7}) {
        SCOPED_TRACE(testing::Message() << a << ", " << partial << " partial, " << rows);
        RandomHierarchy h = empty(9);
        h.levels = {level(gen, gen.matrix(2, 9), VectorXd::Ones(2)),
                    level(gen, gen.matrix(partial, 9), VectorXd::Constant(partial, a)),
                    level(gen, gen.matrix(1, 9), VectorXd::Ones(1)),
                    level(gen, gen.matrix(rows, 9), VectorXd::Ones(rows)),
                    level(gen, gen.matrix(2, 9), VectorXd::Constant(2, 0.7))};
        expect_literal(h);
      }
    }
  }
}

// Rows that lie in the span of a partial one, nearly or not: no certificate holds near it.
TEST(Paths, RowsAlongAPartialOne) {
  HierarchyGenerator gen(11);
  for (const double distance : {0.0, 1e-9, 1e-3, 0.09, 0.1, 0.11, 1.0}) {
    SCOPED_TRACE(distance);
    RandomHierarchy h = empty(8);
    const MatrixXd row = gen.matrix(1, 8).rowwise().normalized();
    MatrixXd J = gen.matrix(2, 8);
    J.row(0) = row + distance * gen.matrix(1, 8);
    h.levels = {level(gen, row, VectorXd::Constant(1, 0.4)), level(gen, J, VectorXd::Ones(2)),
                level(gen, gen.matrix(2, 8), VectorXd::Ones(2))};
    expect_literal(h);
  }
}

// Binary and partial rows in one level: the binary ones leave, whatever p is already.
TEST(Paths, BinaryRowsBesidePartialOnes) {
  HierarchyGenerator gen(12);
  for (const int before : {0, 1, 4}) {
    for (const int binary : {0, 1, 3}) {
      for (const int partial : {1, 3}) {
        RandomHierarchy h = empty(10);
        VectorXd a = VectorXd::Constant(binary + partial, 0.6);
        a.tail(binary).setOnes();
        h.levels = {level(gen, gen.matrix(before, 10), VectorXd::Constant(before, 0.5)),
                    level(gen, gen.matrix(binary + partial, 10), a),
                    level(gen, gen.matrix(2, 10), VectorXd::Ones(2)),
                    level(gen, gen.matrix(3, 10), VectorXd::Constant(3, 0.2))};
        expect_literal(h);
      }
    }
  }
}

// The same where the level is ill conditioned: what is exact for rows of one size cancels, and each
// part has to be formed from rows that do not.
TEST(Paths, BinaryRowsBesidePartialOnesNearlyDependent) {
  RandomHierarchy h = empty(5);
  MatrixXd J(4, 5), below(2, 5);
  J << -0.400084, -0.577535, -0.531082, 0.359535, 0.171794,  //
      9.18473, 13.6003, 13.8085, -2.43595, -2.28577,         //
      4.65021, 7.0101, 7.25258, -1.28786, -1.21359,          //
      8.81569, 12.6424, 13.0259, -2.16854, -2.73389;
  below << 0.100132, -0.0764282, 0.153983, -0.0834527, -0.0890457,  //
      -0.171953, -0.103863, 0.0346293, -0.145989, 0.0160302;
  h.levels = {{J, Eigen::Vector4d(1, 0.385054, 0.972488, 0.186314),
               Eigen::Vector4d(-1.28807, 35.2212, 18.2968, 33.4335)},
              {below, VectorXd::Ones(2), Eigen::Vector2d(1.26125, -2.41295)}};
  expect_literal(h);

  // The closing level alone: one direction of U is long, and cancels in U Vᵀ.
  h = empty(6);
  J.resize(3, 6);
  J << 127.361, 4.98917, -144.509, 74.8377, -79.4671, -128.266,  //
      -3717.38, -144.747, 4214.66, -2181.06, 2314.2, 3733.32,    //
      1302.54, 50.4511, -1476.46, 764.033, -810.579, -1307.87;
  h.levels = {
      {J, Eigen::Vector3d(1, 0.0586825, 0.425459), Eigen::Vector3d(0.928261, 0.0286205, 0.83696)}};
  icat::Tpik<double> tpik(6);
  oracle::run(tpik, h);
  oracle::expect_exact<double>(tpik.velocity(), h);

  // Both sides of the condition from which the rows are not told apart, and far beyond.
  for (unsigned seed = 0; seed < (sanitized ? 50 : 2000); ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    h = empty(gen.integer(3, 8));
    for (int l = gen.integer(1, 3); l > 0; --l) {
      const int m = gen.integer(2, static_cast<int>(h.dof));
      const double largest = gen.uniform(0, 3);
      VectorXd values(m), a(m);
      for (double& x : values) {
        const double decades = gen.uniform(0, 1) + (gen.integer(0, 1) == 0 ? 0 : largest);
        x = std::sqrt(threshold * std::pow(10.0, decades));
      }
      for (double& x : a) x = gen.integer(0, 1) == 0 ? gen.uniform(0.02, 1) : 1.0;
      const MatrixXd B = with_singular_values(gen, values, static_cast<int>(h.dof));
      h.levels.push_back(level(gen, a.cwiseSqrt().cwiseInverse().asDiagonal() * B, a));
    }
    icat::Tpik<double> solver(h.dof);
    oracle::run(solver, h);
    oracle::expect_exact<double>(solver.velocity(), h);
  }
}

// A small eigenvalue may be set apart where S⁻¹ is sure of the others: it is less so the larger S.
// With a flat inverse, λ = 1, the literal formula loses nothing there.
TEST(Paths, SmallEigenvaluesUnderAFlatInverse) {
  RandomHierarchy h = empty(4);
  MatrixXd first(3, 4), second(2, 4), third(2, 4);
  first << 0.278623098, 0.226385645, 0.19776781, -0.415953485,  //
      0.268980503, 0.475011749, 0.469430333, -0.5736002,        //
      -0.095111747, 0.019079581, -0.118012529, 0.041257075;
  second << 8.55238957, -2.12078251, 15.8555345, -2.85651902,  //
      4.07592476, -5.59684621, -2.14379415, 7.06937141;
  third << 6.76862518, 16.6814998, -16.8095933, 28.3383052,  //
      4.5205026, 11.1822213, -11.4808455, 18.9971031;
  h.levels = {{first, Eigen::Vector3d(0.84381736, 0.280041438, 1),
               Eigen::Vector3d(0.943097066, -0.50118889, 1.9876029616)},
              {second, Eigen::Vector2d(0.34357888, 1), Eigen::Vector2d(29.2526528, 13.354157)},
              {third, Eigen::Vector2d(1, 1), Eigen::Vector2d(9.76076433, 6.56634116)}};
  icat::Tpik<double> tpik(4, {.regularization = {.lambda = 1}});
  oracle::run(tpik, h);
  oracle::expect_exact<double>(tpik.velocity(), h, {.lambda = 1}, 1e-11);
}

// A tall level below partial rows: G^{-1} with a correction where it is certain; not where a
// direction of G is small, or where p has reached r.
TEST(Paths, TallLevelsBelowPartialRows) {
  HierarchyGenerator gen(13);
  for (const double least : {1.0, 0.11, 0.1, 0.09, 0.0}) {
    for (const int partial : {1, 2, 5, 6}) {
      for (const double a : {1.0, 0.6}) {
        SCOPED_TRACE(testing::Message() << least << ", " << partial << ", " << a);
        RandomHierarchy h = empty(6);
        VectorXd values = VectorXd::Ones(6);
        values(5) = least;
        const MatrixXd J = with_singular_values(gen, values, 6);
        MatrixXd twice(12, 6);
        twice << J, J;
        h.levels = {level(gen, gen.matrix(partial, 6), VectorXd::Constant(partial, 0.4)),
                    level(gen, gen.matrix(1, 6), VectorXd::Ones(1)),
                    level(gen, twice / std::sqrt(2.0), VectorXd::Constant(12, a)),
                    level(gen, gen.matrix(2, 6), VectorXd::Ones(2))};
        expect_literal(h);
      }
    }
  }
}

// Regularized binary rows leave but for the directions of small eigenvalues; one, some, all of
// them, of wide levels and tall ones, with partial rows above and without.
TEST(Paths, RegularizedBinaryLevels) {
  HierarchyGenerator gen(14);
  for (const int rows : {1, 2, 4, 8, 20}) {
    for (int small = 0; small <= std::min(rows, 4); ++small) {
      for (const int partial : {0, 1}) {
        SCOPED_TRACE(testing::Message() << rows << " rows, " << small << " small");
        RandomHierarchy h = empty(8);
        const int rank = std::min(rows, 8);
        VectorXd values = VectorXd::Ones(rank);
        for (int i = 0; i < small; ++i) values(i) = i % 2 ? 0 : 0.05;
        MatrixXd J = with_singular_values(gen, values, 8);
        if (rows > rank)
          J = MatrixXd(with_singular_values(gen, VectorXd::Ones(8), rows).transpose() * J);
        h.levels = {level(gen, gen.matrix(partial, 8), VectorXd::Constant(partial, 0.5)),
                    level(gen, J, VectorXd::Ones(rows)),
                    level(gen, gen.matrix(2, 8), VectorXd::Ones(2)),
                    level(gen, gen.matrix(2, 8), VectorXd::Constant(2, 0.3))};
        // f' is 1/λ² at most.
        expect_literal(h, 1e-8);
      }
    }
  }
}

// An eigenvalue at the threshold, to rounding, beside one of zero: whether it counts as below may
// differ from one step to the next.
TEST(Paths, EigenvaluesAtTheThresholdBesideZero) {
  for (unsigned seed = 0; seed < 3000; ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    const int n = gen.integer(4, 9), rows = gen.integer(3, n - 1);
    MatrixXd J = with_singular_values(gen, VectorXd::Ones(rows), n);
    VectorXd a = VectorXd::Ones(rows);
    a(gen.integer(0, rows - 2)) = threshold;
    J.row(rows - 1) = J.row(0) + J.row(1);
    RandomHierarchy h = empty(n);
    h.levels = {level(gen, J, a), level(gen, gen.matrix(1, n), VectorXd::Ones(1))};
    expect_literal(h);
  }
}

// Two-sided Jacobi rotations from 10⁶ σ_t on.
TEST(Paths, LargeRowsBesideSmallOnes) {
  HierarchyGenerator gen(15);
  for (const double largest : {50.0, 99.0, 101.0, 300.0}) {
    RandomHierarchy h = empty(7);
    VectorXd values(4);
    values << largest, 1, 0.07, 0.01;
    const MatrixXd J = with_singular_values(gen, values, 7);
    h.levels = {level(gen, gen.matrix(1, 7), VectorXd::Constant(1, 0.5)),
                level(gen, J, VectorXd::Ones(4)),
                level(gen, J.bottomRows(2), VectorXd::Constant(2, 0.5)),
                level(gen, gen.matrix(2, 7), VectorXd::Ones(2))};
    expect_literal(h, 1e-8);
  }
}

// The closing level needs no certificate while σ_t ≤ η / (1 + η), and less than half of the axes
// may be touched.
TEST(Paths, ClosingLevels) {
  HierarchyGenerator gen(16);
  for (const double sigma : {1e-2, 0.49, 0.51, 2.0}) {
    for (const double eta : {0.5, 1.0, 10.0}) {
      for (const int partial : {1, 2, 3, 4, 6}) {
        RandomHierarchy h = empty(8);
        h.levels = {level(gen, gen.matrix(1, 8), VectorXd::Ones(1)),
                    level(gen, gen.matrix(partial, 8), VectorXd::Constant(partial, 0.95))};
        expect_literal(
            h, 1e-9,
            {.regularization = {.lambda = 1e-2, .threshold = sigma}, .projection_weight = eta});
      }
    }
  }
}

// Tiny rows and activations are a negligible effect, and huge ones no failure.
template <class S>
class Sizes : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Sizes, Scalars);

TYPED_TEST(Sizes, OfAnyPower) {
  using S = TypeParam;
  using Vector2 = icat::Vector<S, 2>;
  using Vector1 = icat::Vector<S, 1>;
  constexpr int last = std::numeric_limits<S>::max_exponent10;
  Eigen::Matrix<S, 2, 3> unit;
  unit << 1, 2, 3, 2, 1, -1;
  const Eigen::Matrix<S, 1, 3> other(1, 1, 0);
  const auto solve = [&](S row, S a, S of_other) {
    icat::Tpik<S, 3> tpik;
    EXPECT_EQ(tpik.add_level(row * unit, Vector2(a, a), Vector2(1, 1)), icat::Status::ok);
    EXPECT_EQ(tpik.add_level(other, Vector1(of_other), Vector1(1)), icat::Status::ok);
    EXPECT_EQ(tpik.minimize_velocity(), icat::Status::ok);
    return tpik.velocity();
  };
  for (const S of_other : {S(1), S(0.5)}) {
    const auto alone = solve(0, 1, of_other);
    for (int power = -last; power < last / 2 - 1; ++power) {
      SCOPED_TRACE(power);
      const S size = std::pow(S(10), S(power));
      const auto y = solve(size, 1, of_other);
      if (power > 0) {
        EXPECT_LT((unit * y - Vector2(1, 1) / size).norm(),
                  100 * std::numeric_limits<S>::epsilon() * y.norm())
            << y;
        continue;
      }
      const auto faint = solve(1, size, of_other);
      if (power > -last / 4 - 4) continue;  // felt
      EXPECT_LT((y - alone).norm(), S(1e-6)) << y;
      EXPECT_LT((faint - alone).norm(), S(1e-6)) << faint;
    }
  }
}

// A binary row leaves whatever its size, also where the square of its pseudo-inverse vanishes.
TYPED_TEST(Sizes, OfBinaryRowsBesidePartialOnes) {
  using S = TypeParam;
  using Vector2 = icat::Vector<S, 2>;
  Eigen::Matrix<S, 2, 3> rows;
  rows << 1, S(0.2), 0, 0, S(0.1), 0;
  const auto solve = [&](S size) {
    icat::Tpik<S, 3> tpik;
    const Vector2 wanted = size * rows.rowwise().sum();
    EXPECT_EQ(tpik.add_level(size * rows, Vector2(1, S(0.5)), wanted), icat::Status::ok);
    EXPECT_EQ(tpik.add_level(Eigen::Matrix<S, 1, 3>(1, 1, 1), icat::Vector<S, 1>(1),
                             icat::Vector<S, 1>(1)),
              icat::Status::ok);
    EXPECT_EQ(tpik.minimize_velocity(), icat::Status::ok);
    return tpik.velocity();
  };
  const auto usual = solve(S(1e4));
  const double last = sizeof(S) == 8 ? 154 : 19;
  for (double power = last - 4; power <= last; power += 0.25) {
    const auto y = solve(S(std::pow(10.0, power)));
    EXPECT_LT((y - usual).norm(), 1000 * std::numeric_limits<S>::epsilon()) << power << "\n" << y;
  }
}

template <class S>
class Spectral : public testing::Test {};
TYPED_TEST_SUITE(Spectral, Scalars);

// f(S) b and f(S) against Eigen's eigendecomposition in long double, where rounding is amplified by
// f' ≤ 1/λ² = 100 here.
TYPED_TEST(Spectral, EqualsTheEigendecomposition) {
  using S = TypeParam;
  const icat::BellRegularization<S> f{S(0.1), S(0.2)};
  HierarchyGenerator gen(9);
  constexpr int largest = 20;
  Panels<S> memory(largest);
  icat::detail::SpectralInverse<S> spectral;
  spectral.bind(largest, memory.next);
  const auto matrix = memory.take(largest), out = memory.take(largest);
  const auto unit = memory.take(largest);
  const auto in = memory.take(1), z = memory.take(1);
  for (int n = 1; n <= largest; ++n) {
    for (int kind = 0; kind < 5; ++kind) {
      SCOPED_TRACE(n * 10 + kind);
      // Regular, rank deficient, all small, clustered, zero.
      VectorXd sigma(n);
      for (int i = 0; i < n; ++i) {
        sigma(i) = kind == 0   ? gen.uniform(0.25, 2)
                   : kind == 1 ? (i % 2 ? 0 : gen.uniform(0.05, 2))
                   : kind == 2 ? gen.uniform(0, 0.19)
                   : kind == 3 ? (i % 3 ? 0.1 : 1.0)
                               : 0;
      }
      const MatrixXd v = testing_support::orthogonal(gen.matrix(n, n));
      const MatrixXd exact_S = v * sigma.asDiagonal() * v.transpose();
      VectorXd inverse(n);
      const icat::BellRegularization<double> exact_f{0.1, 0.2};
      for (int i = 0; i < n; ++i) inverse(i) = exact_f.inverse(sigma(i));
      const MatrixXd exact = v * inverse.asDiagonal() * v.transpose();
      const VectorXd b = exact_S * VectorXd(gen.matrix(n, 1));

      const double rounding = 3e3 * n * static_cast<double>(std::numeric_limits<S>::epsilon());
      memory.set(matrix, exact_S);
      ASSERT_TRUE(spectral.compute(matrix, n, out, f));
      EXPECT_EQ(spectral.below(), (sigma.array() < 0.2).count());
      memory.set(unit, Eigen::MatrixXd::Identity(n, n));
      spectral.add_small(n, unit, out);
      EXPECT_LT((memory.block(out, n, n) - exact).norm(), rounding * (1 + exact.norm()));

      memory.set(matrix, exact_S);
      memory.set(in, b);
      ASSERT_TRUE(spectral.apply(matrix, n, in.data, z.data, f));
      EXPECT_LT((memory.block(z, n, 1) - exact * b).norm(), rounding * (1 + (exact * b).norm()));
    }
  }
}

}  // namespace
