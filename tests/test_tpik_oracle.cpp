// SPDX-License-Identifier: BSD-3-Clause
// The solver against the literal Eq. (20)–(23), over random hierarchies.
#include <gtest/gtest.h>

#include <icat/tpik/tpik.hpp>

#include "support/oracle_rule.hpp"
#include "support/sanitized.hpp"

namespace {

using namespace oracle;

// Shards, so that two cores share the long-double SVDs. 8 × 260 = 2,080 hierarchies.
class Oracle : public testing::TestWithParam<int> {};

TEST_P(Oracle, EqualsTheLiteralFormula) {
  constexpr int per_shard = sanitized ? 20 : 260;
  Judged worst{};
  int beyond = 0;
  for (int i = 0; i < per_shard; ++i) {
    const unsigned seed = static_cast<unsigned>(GetParam() * per_shard + i);
    SCOPED_TRACE(seed);
    const RandomHierarchy h = HierarchyGenerator(seed).hierarchy();
    icat::Tpik<double> tpik(h.dof);
    run(tpik, h);
    const Judged judged = expect_exact<double>(tpik.velocity(), h);
    worst = {std::max(worst.error, judged.error), std::max(worst.by_literal, judged.by_literal)};
    beyond += judged.error > 1e-9;
  }
  // Read by scripts/portability.sh.
  std::printf("worst relative error %.1e, %d beyond 1e-9, worst %.2f of the literal's\n",
              worst.error, beyond, worst.by_literal);
}

INSTANTIATE_TEST_SUITE_P(Seeds, Oracle, testing::Range(0, 8));

TEST(Oracle, EqualsTheLiteralFormulaWithOtherPoliciesAndWeight) {
  for (unsigned seed = 5000; seed < 5100; ++seed) {
    SCOPED_TRACE(seed);
    const RandomHierarchy h = HierarchyGenerator(seed).hierarchy(4, 15);
    icat::Tpik<double, Eigen::Dynamic, icat::DampedBellRegularization<double>> tpik(
        h.dof, {.regularization = {.lambda = 1e-2, .threshold = 5e-2}, .projection_weight = 10});
    run(tpik, h);
    expect_exact<double>(tpik.velocity(), h, {1e-2, 5e-2, 10, oracle::Form::damped});
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
    expect_exact<double>(tpik.velocity(), h);
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
    icat::Tpik<double> tpik(h.dof);
    ASSERT_EQ(tpik.reset(h.rho0, h.Q0), icat::Status::ok);
    for (std::size_t levels = 1; levels <= h.levels.size(); ++levels) {
      const RandomLevel& level = h.levels[levels - 1];
      exact.add(level.J.cast<long double>(), level.a.cast<long double>(),
                level.reference.cast<long double>());
      ASSERT_EQ(tpik.add_level(level.J, level.a, level.reference), icat::Status::ok);
      const auto expect = [&](double error, const auto& error_of) {
        expect_as_good_as_literal<double>(error, 1e-9, h, levels, false, {}, error_of);
      };
      expect(relative_error(Eigen::MatrixXd(tpik.projector()), exact.Q),
             [&](const auto& l) { return relative_error(l.Q, exact.Q); });
      expect(relative_error(Eigen::VectorXd(tpik.velocity()), exact.rho),
             [&](const auto& l) { return relative_error(l.rho, exact.rho); });
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
    expect_exact<double>(tpik.velocity(), h);
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
    // 1e-9 scaled by the ratio of the machine epsilons would be 0.5; ask for 1e-2.
    expect_exact<float>(tpik.velocity().cast<double>(), rounded, {}, 1e-2);
  }
}

}  // namespace
