// SPDX-License-Identifier: BSD-3-Clause
// The solver against the literal Eq. (20)–(23), over random hierarchies.
#include <gtest/gtest.h>

#include <icat/tpik/tpik.hpp>

#include "support/oracle.hpp"
#include "support/sanitized.hpp"

namespace {

using oracle::Vec;

template <class Solver>
void run(Solver& tpik, const RandomHierarchy& h) {
  ASSERT_EQ(tpik.reset(h.rho0, h.Q0), icat::Status::ok);
  for (const auto& level : h.levels) {
    ASSERT_EQ(tpik.add_level(level.J, level.a, level.reference), icat::Status::ok);
  }
  ASSERT_EQ(tpik.minimize_velocity(), icat::Status::ok);
}

double relative_error(const Eigen::VectorXd& x, const Vec<long double>& exact) {
  return static_cast<double>((x.cast<long double>() - exact).norm() / std::max(exact.norm(), 1.0L));
}

// Shards, so that two cores share the long-double SVDs. 8 × 260 = 2,080 hierarchies.
class Oracle : public testing::TestWithParam<int> {};

TEST_P(Oracle, EqualsTheLiteralFormula) {
  constexpr int per_shard = sanitized ? 20 : 260;
  double worst = 0;
  for (int i = 0; i < per_shard; ++i) {
    const unsigned seed = static_cast<unsigned>(GetParam() * per_shard + i);
    SCOPED_TRACE(seed);
    const RandomHierarchy h = HierarchyGenerator(seed).hierarchy();
    icat::Tpik<double> tpik(h.dof);
    run(tpik, h);
    const Vec<long double> exact = oracle::solve<long double>(h);
    const double error = relative_error(tpik.velocity(), exact);
    worst = std::max(worst, error);
    if (error > 1e-9) {
      EXPECT_LE(error, 10 * relative_error(oracle::solve<double>(h), exact));
    }
  }
  RecordProperty("worst_relative_error", std::to_string(worst));
  std::printf("worst relative error %.2e\n", worst);
}

INSTANTIATE_TEST_SUITE_P(Seeds, Oracle, testing::Range(0, 8));

TEST(Oracle, EqualsTheLiteralFormulaWithOtherPoliciesAndWeight) {
  for (unsigned seed = 5000; seed < 5100; ++seed) {
    SCOPED_TRACE(seed);
    const RandomHierarchy h = HierarchyGenerator(seed).hierarchy(4, 15);
    oracle::Parameters<long double> p{1e-2L, 5e-2L, 10, oracle::Form::damped};
    oracle::Parameters<double> p_double{1e-2, 5e-2, 10, oracle::Form::damped};
    icat::Tpik<double, Eigen::Dynamic, icat::DampedBellRegularization<double>> tpik(
        h.dof, {.regularization = {.lambda = 1e-2, .threshold = 5e-2}, .projection_weight = 10});
    run(tpik, h);
    const Vec<long double> exact = oracle::solve<long double>(h, p);
    const double error = relative_error(tpik.velocity(), exact);
    if (error > 1e-9) {
      EXPECT_LE(error, 10 * relative_error(oracle::solve<double>(h, p_double), exact));
    }
  }
}

// Static sizes run the same body; each compiles its own kernels, so check some against the oracle.
template <int N>
void static_equals_oracle() {
  for (unsigned seed = 7000; seed < 7060; ++seed) {
    SCOPED_TRACE(seed);
    const RandomHierarchy h = HierarchyGenerator(seed).hierarchy(N, N);
    icat::Tpik<double, N> tpik;
    run(tpik, h);
    const Vec<long double> exact = oracle::solve<long double>(h);
    const double error = relative_error(tpik.velocity(), exact);
    if (error > 1e-9) {
      EXPECT_LE(error, 10 * relative_error(oracle::solve<double>(h), exact));
    }
  }
}
TEST(Oracle, StaticSizesEqualTheLiteralFormula) {
  static_equals_oracle<4>();
  static_equals_oracle<7>();
  static_equals_oracle<13>();
}

// The projector and the increment of every level, not only the end.
TEST(Oracle, EveryLevelEqualsTheLiteralFormula) {
  for (unsigned seed = 9000; seed < 9060; ++seed) {
    SCOPED_TRACE(seed);
    const RandomHierarchy h = HierarchyGenerator(seed).hierarchy(4, 16);
    auto exact = oracle::start<long double>(h);
    auto literal = oracle::start<double>(h);
    icat::Tpik<double> tpik(h.dof);
    ASSERT_EQ(tpik.reset(h.rho0, h.Q0), icat::Status::ok);
    for (const auto& level : h.levels) {
      exact.add(level.J.cast<long double>(), level.a.cast<long double>(),
                level.reference.cast<long double>());
      literal.add(level.J, level.a, level.reference);
      ASSERT_EQ(tpik.add_level(level.J, level.a, level.reference), icat::Status::ok);
      const double e_Q = static_cast<double>(
          (tpik.projector().cast<long double>() - exact.Q).norm() / std::sqrt(h.dof));
      const double literal_Q =
          static_cast<double>((literal.Q.cast<long double>() - exact.Q).norm() / std::sqrt(h.dof));
      EXPECT_LE(e_Q, std::max(1e-9, 10 * literal_Q));
      EXPECT_LE(relative_error(tpik.velocity(), exact.rho),
                std::max(1e-9, 10 * relative_error(literal.rho, exact.rho)));
    }
  }
}

// More rows than degrees of freedom take the other path through the Gram matrix.
TEST(Oracle, LevelsWithMoreRowsThanDegreesOfFreedom) {
  for (unsigned seed = 100; seed < 160; ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    RandomHierarchy h = gen.hierarchy(4, 10);
    const int rows = static_cast<int>(h.dof) + gen.integer(1, 20);
    const RandomLevel tall{gen.matrix(rows, h.dof),
                           Eigen::VectorXd::NullaryExpr(rows, [&] { return gen.uniform(0.01, 1); }),
                           gen.matrix(rows, 1)};
    h.levels.insert(h.levels.begin() + gen.integer(0, static_cast<int>(h.levels.size()) - 1), tall);
    icat::Tpik<double> tpik(h.dof);
    run(tpik, h);
    const Vec<long double> exact = oracle::solve<long double>(h);
    const double error = relative_error(tpik.velocity(), exact);
    EXPECT_LE(error, std::max(1e-9, 10 * relative_error(oracle::solve<double>(h), exact)));
  }
}

// float against the literal formula in float: no worse than ten times its error.
TEST(Oracle, SinglePrecisionIsAsGoodAsTheLiteralFormulaInSinglePrecision) {
  for (unsigned seed = 300; seed < 400; ++seed) {
    SCOPED_TRACE(seed);
    const RandomHierarchy h = HierarchyGenerator(seed).hierarchy(4, 15);
    icat::Tpik<float> tpik(h.dof);
    ASSERT_EQ(tpik.reset(h.rho0.cast<float>(), h.Q0.cast<float>()), icat::Status::ok);
    for (const auto& level : h.levels) {
      ASSERT_EQ(tpik.add_level(level.J.cast<float>().eval(), level.a.cast<float>().eval(),
                               level.reference.cast<float>().eval()),
                icat::Status::ok);
    }
    ASSERT_EQ(tpik.minimize_velocity(), icat::Status::ok);
    // The inputs rounded to float are the problem that is solved.
    RandomHierarchy rounded = h;
    rounded.rho0 = h.rho0.cast<float>().cast<double>();
    for (auto& level : rounded.levels) {
      level.J = level.J.cast<float>().cast<double>().eval();
      level.a = level.a.cast<float>().cast<double>().eval();
      level.reference = level.reference.cast<float>().cast<double>().eval();
    }
    const Vec<long double> exact = oracle::solve<long double>(rounded);
    const double error = relative_error(tpik.velocity().cast<double>(), exact);
    const double literal = relative_error(oracle::solve<float>(rounded).cast<double>(), exact);
    // 5e-2 · 1e-9 scaled by the ratio of the machine epsilons would be 0.5; ask for 1e-2.
    EXPECT_LE(error, std::max(1e-2, 10 * literal));
  }
}

}  // namespace
