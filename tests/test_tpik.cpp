// SPDX-License-Identifier: BSD-3-Clause
// What the solver promises beyond equality with the oracle: inactive levels, bounds, bad input.
#include <gtest/gtest.h>

#include <icat/tpik/null_space_guidance.hpp>
#include <icat/tpik/parametric_tpik.hpp>
#include <icat/tpik/tpik.hpp>

#include "support/oracle.hpp"
#include "support/sanitized.hpp"

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using icat::Status;
using Tpik = icat::Tpik<double>;
constexpr double inf = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(Tpik, ALevelOfActivationZeroChangesNothingExactly) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    const RandomHierarchy h = gen.hierarchy(4, 12);
    Tpik with(h.dof), without(h.dof);
    ASSERT_EQ(with.reset(h.rho0, h.Q0), Status::ok);
    ASSERT_EQ(without.reset(h.rho0, h.Q0), Status::ok);
    for (const auto& level : h.levels) {
      const int m = gen.integer(1, 8);
      ASSERT_EQ(with.add_level(gen.matrix(m, h.dof), VectorXd::Zero(m), gen.matrix(m, 1)),
                Status::ok);
      ASSERT_EQ(with.add_level(level.J, level.a, level.reference), Status::ok);
      ASSERT_EQ(without.add_level(level.J, level.a, level.reference), Status::ok);
      ASSERT_EQ(with.velocity(), without.velocity());
      ASSERT_EQ(with.projector(), without.projector());
    }
    ASSERT_EQ(with.minimize_velocity(), Status::ok);
    ASSERT_EQ(without.minimize_velocity(), Status::ok);
    ASSERT_EQ(with.velocity(), without.velocity());
  }
}

// A row of activation zero drops out exactly as well.
TEST(Tpik, ARowOfActivationZeroChangesNothingExactly) {
  HierarchyGenerator gen(4);
  const MatrixXd J = gen.matrix(5, 9);
  const VectorXd reference = gen.matrix(5, 1);
  VectorXd a = VectorXd::Ones(5);
  a(2) = 0;
  Tpik with(9), without(9);
  ASSERT_EQ(with.add_level(J, a, reference), Status::ok);
  MatrixXd J4(4, 9);
  VectorXd r4(4);
  for (int i = 0, k = 0; i < 5; ++i) {
    if (i == 2) continue;
    J4.row(k) = J.row(i);
    r4(k++) = reference(i);
  }
  ASSERT_EQ(without.add_level(J4, VectorXd::Ones(4), r4), Status::ok);
  EXPECT_EQ(with.velocity(), without.velocity());
  EXPECT_EQ(with.projector(), without.projector());
  EXPECT_EQ(with.report().levels()[0].rows, 5);
  EXPECT_EQ(with.report().levels()[0].active_rows, 4);
}

TEST(Tpik, LowerPrioritiesDoNotDisturbHigherOnes) {
  for (unsigned seed = 0; seed < 100; ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    const MatrixXd J1 = gen.matrix(3, 10), J2 = gen.matrix(6, 10), J3 = gen.matrix(5, 10);
    const VectorXd r1 = gen.matrix(3, 1), r2 = gen.matrix(6, 1), r3 = gen.matrix(5, 1);
    Tpik tpik(10);
    ASSERT_EQ(tpik.add_level(J1, VectorXd::Ones(3), r1), Status::ok);
    ASSERT_EQ(tpik.add_level(J2, VectorXd::Ones(6), r2), Status::ok);
    ASSERT_EQ(tpik.add_level(J3, VectorXd::Ones(5), r3), Status::ok);
    ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
    EXPECT_LT((J1 * tpik.velocity() - r1).norm(), 1e-9);
    // J2 may be within the regularization's reach; then priority is kept, tracking is damped.
    if (!tpik.report().levels()[1].regularized) {
      EXPECT_LT((J2 * tpik.velocity() - r2).norm(), 1e-9);
    }
  }
}

TEST(Tpik, ReportsRowsRatesAndRegularization) {
  icat::Tpik<double, 3> tpik;
  const Eigen::RowVector3d x(1, 0, 0), nearly_x(1, 0.05, 0);
  using One = Eigen::Matrix<double, 1, 1>;
  ASSERT_EQ(tpik.add_level(x, One(1.0), One(0.4)), Status::ok);
  ASSERT_EQ(tpik.add_level(nearly_x, One(1.0), One(-0.4)), Status::ok);
  ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
  const auto levels = tpik.report().levels();
  ASSERT_EQ(levels.size(), 3u);
  EXPECT_EQ(levels[0].active_rows, 1);
  EXPECT_FALSE(levels[0].regularized);
  EXPECT_NEAR(levels[0].requested_rate, 0.4, 1e-15);
  EXPECT_NEAR(levels[0].achieved_rate, 0.4, 1e-12);
  EXPECT_LT(levels[0].tracking_error, 1e-12);
  // What x leaves of nearly_x is 0.05, whose square is under the threshold of 0.01.
  EXPECT_TRUE(levels[1].regularized);
  EXPECT_GT(levels[1].tracking_error, 0.01);
  EXPECT_EQ(tpik.report().status(), Status::ok);
}

// --- Sat ---------------------------------------------------------------------------------------

icat::VelocityBounds<double> random_bounds(HierarchyGenerator& gen, const VectorXd& rho0) {
  icat::VelocityBounds<double> b{VectorXd(rho0.size()), VectorXd(rho0.size())};
  for (Eigen::Index i = 0; i < rho0.size(); ++i) {
    b.lower(i) = std::min(rho0(i), 0.0) - gen.uniform(0, 0.5);
    b.upper(i) = std::max(rho0(i), 0.0) + gen.uniform(0, 0.5);
    if (gen.integer(0, 9) == 0) b.upper(i) = inf;
    if (gen.integer(0, 9) == 0) b.lower(i) = std::min(rho0(i), 0.0);
  }
  return b;
}

class Saturation : public testing::TestWithParam<int> {};

TEST_P(Saturation, StaysInsideTheBoundsAndKeepsEveryIncrementsDirection) {
  constexpr int per_shard = sanitized ? 40 : 520;
  int scaled_levels = 0;
  for (int i = 0; i < per_shard; ++i) {
    const unsigned seed = static_cast<unsigned>(GetParam() * per_shard + i);
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    const RandomHierarchy h = gen.hierarchy();
    const auto bounds = random_bounds(gen, h.rho0);
    Tpik tpik(h.dof, {.bounds = bounds});
    // Without bounds the same levels, with references that leave the same residual, give the
    // unscaled increments: Q does not depend on ρ.
    Tpik free(h.dof);
    ASSERT_EQ(tpik.reset(h.rho0, h.Q0), Status::ok);
    ASSERT_EQ(free.reset(h.rho0, h.Q0), Status::ok);
    for (const auto& level : h.levels) {
      const VectorXd before = tpik.velocity();
      const VectorXd free_before = free.velocity();
      const VectorXd same = level.reference + level.J * (free_before - before);
      ASSERT_EQ(tpik.add_level(level.J, level.a, level.reference), Status::ok);
      ASSERT_EQ(free.add_level(level.J, level.a, same), Status::ok);
      const VectorXd full = free.velocity() - free_before;
      const double s = tpik.report().levels().back().saturation_scale;
      ASSERT_GE(s, 0);
      ASSERT_LE(s, 1);
      // The rounding of the residual, amplified by the regularized inverse.
      ASSERT_LE((tpik.velocity() - before - s * full).norm(), 1e-10 * (1 + full.norm()));
      ASSERT_TRUE((tpik.velocity().array() >= bounds.lower.array()).all());
      ASSERT_TRUE((tpik.velocity().array() <= bounds.upper.array()).all());
      // s is the largest there is, component by component; what rounding leaves does not count.
      double expected = 1;
      for (Eigen::Index k = 0; k < h.dof; ++k) {
        if (std::abs(full(k)) <= 4096 * 2.22e-16 * full.cwiseAbs().maxCoeff()) continue;
        const double room = (full(k) > 0 ? bounds.upper(k) : bounds.lower(k)) - before(k);
        expected = std::min(expected, std::max(0.0, room / full(k)));
      }
      // `full` is a difference: of a small increment it keeps too few digits to judge by.
      if (full.cwiseAbs().maxCoeff() > 1e-2) {
        ASSERT_NEAR(s, expected, 1e-9);
      }
      if (s < 1) {
        ++scaled_levels;
        const double gap = std::min((tpik.velocity() - bounds.lower).minCoeff(),
                                    (bounds.upper - tpik.velocity()).minCoeff());
        ASSERT_LE(gap, 1e-12);
      }
    }
    ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
    ASSERT_TRUE((tpik.velocity().array() >= bounds.lower.array()).all());
    ASSERT_TRUE((tpik.velocity().array() <= bounds.upper.array()).all());
  }
  EXPECT_GT(scaled_levels, per_shard);  // the bounds do bite
}
// The seeds of the oracle's 2,080 hierarchies.
INSTANTIATE_TEST_SUITE_P(Seeds, Saturation, testing::Range(0, 4));

TEST(Saturation, TheBoundLeftOverIsWhatTheNextLevelMayUse) {
  const VectorXd one = VectorXd::Ones(2);
  Tpik tpik(2, {.bounds = {-one, one}});
  using One = Eigen::Matrix<double, 1, 1>;
  ASSERT_EQ(tpik.add_level(Eigen::RowVector2d(1, 0), One(1.0), One(4.0)), Status::ok);
  EXPECT_EQ(tpik.velocity(), Eigen::Vector2d(1, 0));
  EXPECT_DOUBLE_EQ(tpik.report().levels()[0].saturation_scale, 0.25);
  ASSERT_EQ(tpik.add_level(Eigen::RowVector2d(0, 1), One(1.0), One(0.5)), Status::ok);
  EXPECT_NEAR(tpik.velocity()(1), 0.5, 1e-12);
  EXPECT_EQ(tpik.report().levels()[1].saturation_scale, 1);
}

// Rounding leaves an increment of some 1e-17 in a component that a higher level holds at its bound.
TEST(Saturation, RoundingDoesNotStopALevel) {
  for (unsigned seed = 0; seed < 1000; ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    const VectorXd bound = VectorXd::Constant(3, 1.0);
    Tpik tpik(3, {.bounds = {-bound, bound}});
    const Eigen::RowVector3d J1(gen.uniform(0.5, 2), 0, 0);
    const MatrixXd J2 = gen.matrix(2, 3);
    ASSERT_EQ(tpik.add_level(J1, VectorXd::Ones(1), VectorXd::Constant(1, 10.0)), Status::ok);
    const VectorXd r2 = J2 * tpik.velocity() + 0.01 * J2.rightCols(2) * Eigen::Vector2d(1, -1);
    ASSERT_EQ(tpik.add_level(J2, VectorXd::Ones(2), r2), Status::ok);
    EXPECT_GT(tpik.report().levels()[1].saturation_scale, 0.99);
    EXPECT_NEAR(tpik.velocity()(0), 1, 1e-14);
  }
}

TEST(Saturation, LowerPrioritiesDoNotDisturbHigherOnes) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    const VectorXd bound = VectorXd::Constant(10, 0.3);
    Tpik tpik(10, {.bounds = {-bound, bound}});
    const MatrixXd J1 = gen.matrix(3, 10);
    ASSERT_EQ(tpik.add_level(J1, VectorXd::Ones(3), gen.matrix(3, 1)), Status::ok);
    const VectorXd rate = J1 * tpik.velocity();
    ASSERT_EQ(tpik.add_level(gen.matrix(4, 10), VectorXd::Ones(4), gen.matrix(4, 1)), Status::ok);
    ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
    EXPECT_LT((J1 * tpik.velocity() - rate).norm(), 1e-9);
  }
}

// Sat as published is not continuous where a component is at its bound and a level pushes it on:
// the level is scaled to nothing at once. Documented under the README's limits.
TEST(Saturation, JumpsWhereALevelBeginsToPushAComponentPastItsBound) {
  const VectorXd one = VectorXd::Ones(2);
  const auto velocity = [&](double r0) {
    Tpik tpik(2, {.bounds = {-one, one}});
    const VectorXd half = VectorXd::Constant(1, 0.5);
    EXPECT_EQ(tpik.add_level(Eigen::RowVector2d(1, 0), half, VectorXd::Constant(1, 50.0)),
              Status::ok);
    EXPECT_EQ(tpik.add_level(MatrixXd::Identity(2, 2), one, Eigen::Vector2d(r0, 0.5)), Status::ok);
    return tpik.velocity()(1);
  };
  EXPECT_NEAR(velocity(1 - 1e-6), 0.5, 1e-3);
  EXPECT_NEAR(velocity(1 + 1e-6), 0.0, 1e-3);
}

TEST(Saturation, AComponentThatStartsOutsideMayOnlyComeBack) {
  const VectorXd one = VectorXd::Ones(2);
  Tpik tpik(2, {.bounds = {-one, one}});
  const Eigen::Vector2d rho0(3, 0);
  const Eigen::Matrix2d I = Eigen::Matrix2d::Identity();
  using One = Eigen::Matrix<double, 1, 1>;
  ASSERT_EQ(tpik.reset(rho0, I), Status::ok);
  ASSERT_EQ(tpik.add_level(Eigen::RowVector2d(1, 0), One(1.0), One(5.0)), Status::ok);
  EXPECT_EQ(tpik.velocity()(0), 3);
  EXPECT_EQ(tpik.report().levels()[0].saturation_scale, 0);
  ASSERT_EQ(tpik.reset(rho0, I), Status::ok);
  ASSERT_EQ(tpik.add_level(Eigen::RowVector2d(1, 0), One(1.0), One(-5.0)), Status::ok);
  EXPECT_DOUBLE_EQ(tpik.velocity()(0), -1);
}

// --- bounds that change -------------------------------------------------------------------------

VectorXd solve_with(Tpik& tpik, const RandomHierarchy& h) {
  EXPECT_EQ(tpik.reset(h.rho0, h.Q0), Status::ok);
  for (const auto& level : h.levels) {
    EXPECT_EQ(tpik.add_level(level.J, level.a, level.reference), Status::ok);
  }
  EXPECT_EQ(tpik.minimize_velocity(), Status::ok);
  return tpik.velocity();
}

TEST(Bounds, NoneByDefault) {
  const icat::VelocityBounds<float, 3> fixed;
  const icat::VelocityBounds<double> dynamic;
  for (Eigen::Index i = 0; i < 3; ++i) {
    EXPECT_EQ(fixed.lower(i), -icat::infinity<float>);
    EXPECT_EQ(fixed.upper(i), icat::infinity<float>);
    EXPECT_EQ(dynamic.lower_of(i), -inf);
    EXPECT_EQ(dynamic.upper_of(i), inf);
  }
  EXPECT_EQ(dynamic.lower.size(), 0);
  EXPECT_FALSE(fixed.any(3));
  EXPECT_FALSE(dynamic.any(3));
  EXPECT_EQ(fixed.check(3), Status::ok);
  EXPECT_EQ(dynamic.check(3), Status::ok);
}

TEST(Bounds, SetInEachCycleTheyAreThoseOfANewSolver) {
  HierarchyGenerator gen(17);
  const RandomHierarchy h = gen.hierarchy(6, 12);
  Tpik changing(h.dof);
  const VectorXd free = solve_with(changing, h);
  for (int cycle = 0; cycle < 50; ++cycle) {
    SCOPED_TRACE(cycle);
    const auto bounds = random_bounds(gen, h.rho0);
    Tpik fresh(h.dof, {.bounds = bounds});
    ASSERT_EQ(changing.set_bounds(bounds), Status::ok);
    EXPECT_EQ(changing.options().bounds.upper, bounds.upper);
    EXPECT_EQ(solve_with(changing, h), solve_with(fresh, h));
  }
  ASSERT_EQ(changing.set_bounds({}), Status::ok);
  EXPECT_EQ(solve_with(changing, h), free);
}

TEST(Bounds, OneSideAlone) {
  const VectorXd one = VectorXd::Ones(2);
  Tpik tpik(2, {.bounds = {.upper = one}});
  for (const double sign : {1.0, -1.0}) {
    tpik.reset();
    ASSERT_EQ(tpik.add_level(MatrixXd::Identity(2, 2), one, 4 * sign * one), Status::ok);
    EXPECT_EQ(tpik.velocity(), sign > 0 ? one : VectorXd(-4 * one));
  }
}

TEST(Bounds, BadOnesAreRefusedAndChangeNothing) {
  const VectorXd half = VectorXd::Constant(3, 0.5);
  Tpik tpik(3, {.bounds = {-half, half}});
  icat::Tpik<double, 3> fixed({.bounds = {-half, half}});
  const auto refused = [&](double low, double high, Status status) {
    VectorXd lower = -VectorXd::Ones(3), upper = VectorXd::Ones(3);
    lower(1) = low;
    upper(2) = high;
    EXPECT_EQ(tpik.set_bounds({lower, upper}), status);
    EXPECT_EQ(fixed.set_bounds({lower, upper}), status);
    EXPECT_EQ(tpik.options().bounds.lower, -half);
    EXPECT_EQ(fixed.options().bounds.upper, half);
  };
  refused(nan, 1, Status::non_finite);
  refused(-1, nan, Status::non_finite);
  refused(0.1, nan, Status::non_finite);
  refused(0.1, 1, Status::out_of_range);
  refused(-1, -0.1, Status::out_of_range);
  refused(inf, 1, Status::out_of_range);
  EXPECT_EQ(tpik.set_bounds({VectorXd::Zero(2), VectorXd::Zero(3)}), Status::wrong_size);
  EXPECT_EQ(tpik.set_bounds({VectorXd::Zero(3), VectorXd::Zero(4)}), Status::wrong_size);
  EXPECT_EQ(tpik.options().bounds.lower, -half);
  EXPECT_EQ(tpik.set_bounds({VectorXd::Zero(3), VectorXd::Zero(3)}), Status::ok);  // stand still
}

// --- bad input ---------------------------------------------------------------------------------

template <class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "no exception";
}

TEST(TpikErrors, ConfigurationThrowsWithNamesAndNumbers) {
  using Fixed = icat::Tpik<double, 3>;
  EXPECT_EQ(message_of([] { Fixed({.regularization = {.lambda = -2}}); }),
            "BellRegularization: lambda must be finite and > 0, got -2");
  EXPECT_EQ(message_of([] { Fixed({.regularization = {.threshold = nan}}); }),
            "BellRegularization: threshold must be finite and > 0, got nan");
  EXPECT_EQ(message_of([] { Fixed({.projection_weight = 0}); }),
            "Tpik: projection_weight must be finite and > 0, got 0");
  EXPECT_EQ(message_of([] { Fixed({.projection_weight = inf}); }),
            "Tpik: projection_weight must be finite and > 0, got inf");
  EXPECT_EQ(message_of([] { Tpik(0); }), "Tpik: dof must be >= 1, got 0");
  EXPECT_EQ(message_of([] {
              Tpik(3, {.bounds = {VectorXd::Zero(2), VectorXd::Zero(3)}});
            }),
            "Tpik: velocity bounds have 2 and 3 components, need 3");
  EXPECT_EQ(message_of([] {
              Fixed({.bounds = {{-1, 0.25, -1}, {1, 0.5, 1}}});
            }),
            "Tpik: velocity bounds of component 1 must hold 0, got [0.25, 0.5]");
  EXPECT_EQ(message_of([] {
              Fixed({.bounds = {{-1, -1, nan}, {1, 1, 1}}});
            }),
            "Tpik: velocity bounds of component 2 must hold 0, got [nan, 1]");
}

struct BadLevel {
  const char* name;
  Status status;
  int row;
  void (*spoil)(MatrixXd&, VectorXd&, VectorXd&);
};

class BadInput : public testing::TestWithParam<BadLevel> {};

TEST_P(BadInput, LeavesThePreviousVelocityAndNamesLevelAndRow) {
  HierarchyGenerator gen(1);
  Tpik tpik(8);
  ASSERT_EQ(tpik.add_level(gen.matrix(2, 8), VectorXd::Ones(2), gen.matrix(2, 1)), Status::ok);
  const VectorXd rho = tpik.velocity();
  const MatrixXd Q = tpik.projector();
  MatrixXd J = gen.matrix(4, 8);
  VectorXd a = VectorXd::Ones(4), r = gen.matrix(4, 1);
  GetParam().spoil(J, a, r);
  EXPECT_EQ(tpik.add_level(J, a, r), GetParam().status);
  EXPECT_EQ(tpik.velocity(), rho);
  EXPECT_EQ(tpik.projector(), Q);
  EXPECT_EQ(tpik.report().status(), GetParam().status);
  EXPECT_EQ(tpik.report().failed_level(), 1);
  EXPECT_EQ(tpik.report().failed_row(), GetParam().row);
  // The solver goes on; the first fault stays in the report until the next reset.
  EXPECT_EQ(tpik.add_level(gen.matrix(2, 8), VectorXd::Ones(2), gen.matrix(2, 1)), Status::ok);
  EXPECT_EQ(tpik.minimize_velocity(), Status::ok);
  EXPECT_TRUE(tpik.velocity().allFinite());
  EXPECT_EQ(tpik.report().status(), GetParam().status);
  tpik.reset();
  EXPECT_EQ(tpik.report().status(), Status::ok);
  EXPECT_EQ(tpik.report().failed_level(), -1);
}

INSTANTIATE_TEST_SUITE_P(
    Levels, BadInput,
    testing::Values(
        BadLevel{"NanInJacobian", Status::non_finite, 2,
                 [](MatrixXd& J, VectorXd&, VectorXd&) { J(2, 3) = nan; }},
        BadLevel{"NanInInactiveRow", Status::non_finite, 2,
                 [](MatrixXd& J, VectorXd& a, VectorXd&) { J(2, 3) = nan, a(2) = 0; }},
        BadLevel{"InfinityInJacobian", Status::non_finite, 3,
                 [](MatrixXd& J, VectorXd&, VectorXd&) { J(3, 0) = -inf; }},
        BadLevel{"NanInReference", Status::non_finite, 0,
                 [](MatrixXd&, VectorXd&, VectorXd& r) { r(0) = nan; }},
        BadLevel{"InfinityInReference", Status::non_finite, 1,
                 [](MatrixXd&, VectorXd&, VectorXd& r) { r(1) = inf; }},
        BadLevel{"NanInActivation", Status::non_finite, 1,
                 [](MatrixXd&, VectorXd& a, VectorXd&) { a(1) = nan; }},
        BadLevel{"ActivationAboveOne", Status::activation_out_of_range, 1,
                 [](MatrixXd&, VectorXd& a, VectorXd&) { a(1) = std::nextafter(1.0, 2.0); }},
        BadLevel{"ActivationBelowZero", Status::activation_out_of_range, 3,
                 [](MatrixXd&, VectorXd& a, VectorXd&) { a(3) = -1e-300; }},
        BadLevel{"TooFewColumns", Status::wrong_size, -1,
                 [](MatrixXd& J, VectorXd&, VectorXd&) { J.conservativeResize(4, 7); }},
        BadLevel{"ActivationTooShort", Status::wrong_size, -1,
                 [](MatrixXd&, VectorXd& a, VectorXd&) { a.conservativeResize(3); }},
        BadLevel{"ReferenceTooLong", Status::wrong_size, -1,
                 [](MatrixXd&, VectorXd&, VectorXd& r) { r = VectorXd::Zero(5); }},
        BadLevel{"Overflow", Status::numerical_failure, -1,
                 [](MatrixXd& J, VectorXd&, VectorXd&) { J *= 1e200; }},
        BadLevel{"OverflowOfTheVelocity", Status::numerical_failure, -1,
                 [](MatrixXd& J, VectorXd&, VectorXd& r) { J *= 0.5, r.setConstant(1.7e308); }}),
    [](const auto& test) { return test.param.name; });

TEST(TpikErrors, ABadStartMovesNothing) {
  Tpik tpik(4);
  MatrixXd Q = MatrixXd::Identity(4, 4);
  VectorXd rho = VectorXd::Zero(4);
  HierarchyGenerator gen(2);
  rho(1) = nan;
  EXPECT_EQ(tpik.reset(rho, Q), Status::non_finite);
  EXPECT_EQ(tpik.add_level(gen.matrix(2, 4), VectorXd::Ones(2), VectorXd::Ones(2)), Status::ok);
  EXPECT_EQ(tpik.minimize_velocity(), Status::ok);
  EXPECT_EQ(tpik.velocity(), VectorXd::Zero(4));
  EXPECT_EQ(tpik.report().status(), Status::non_finite);
  EXPECT_EQ(tpik.reset(VectorXd::Zero(3), Q), Status::wrong_size);
  EXPECT_EQ(tpik.reset(VectorXd::Zero(4), MatrixXd::Identity(3, 4)), Status::wrong_size);
}

TEST(TpikErrors, ALevelWithoutRowsIsFine) {
  Tpik tpik(4);
  EXPECT_EQ(tpik.add_level(MatrixXd(0, 4), VectorXd(0), VectorXd(0)), Status::ok);
  EXPECT_EQ(tpik.velocity(), VectorXd::Zero(4));
}

TEST(TpikErrors, MoreLevelsThanTheReportHoldsAreSolved) {
  Tpik tpik(80);
  const Eigen::Matrix<double, 1, 1> one(1.0);
  for (int i = 0; i < 80; ++i) {
    ASSERT_EQ(tpik.add_level(MatrixXd::Identity(80, 80).row(i), one, one), Status::ok);
  }
  EXPECT_LT((tpik.velocity() - VectorXd::Ones(80)).norm(), 1e-12);
  EXPECT_EQ(tpik.report().levels().size(), 64u);
  EXPECT_EQ(tpik.add_level(MatrixXd::Identity(80, 80).row(3), one, nan * one), Status::non_finite);
  EXPECT_EQ(tpik.report().failed_level(), 80);
}

// A user's policy needs `inverse` and `threshold`, no more.
struct Truncation {
  double threshold = 1e-6;
  double inverse(double sigma) const noexcept { return sigma < threshold ? 0 : 1 / sigma; }
};
static_assert(icat::RegularizationPolicy<Truncation, double>);
static_assert(icat::RegularizationPolicy<icat::BellRegularization<float>, float>);
static_assert(!icat::RegularizationPolicy<int, double>);

TEST(Tpik, TakesAUsersPolicy) {
  icat::Tpik<double, 3, Truncation> tpik;
  const Eigen::RowVector3d row(2, 0, 0);
  using One = Eigen::Matrix<double, 1, 1>;
  ASSERT_EQ(tpik.add_level(row, One(1.0), One(1.0)), Status::ok);
  ASSERT_EQ(tpik.add_level(row, One(1.0), One(-1.0)), Status::ok);
  ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
  EXPECT_LT((tpik.velocity() - Eigen::Vector3d(0.5, 0, 0)).norm(), 1e-15);
}

/// ẏ of one level.
template <class J, class A, class R>
VectorXd solve_one(const J& jacobian, const A& activation, const R& reference) {
  Tpik tpik(5);
  EXPECT_EQ(tpik.add_level(jacobian, activation, reference), Status::ok);
  EXPECT_EQ(tpik.minimize_velocity(), Status::ok);
  return tpik.velocity();
}

// Whatever type the input has, it is read as what it is.
TEST(Tpik, InputOfAnyEigenType) {
  HierarchyGenerator gen(11);
  const MatrixXd J = gen.matrix(3, 5), wide = gen.matrix(6, 10), A = gen.matrix(3, 3);
  const Eigen::Vector3d a(1, 0.5, 1), r(0.1, -0.2, 0.3);
  const VectorXd expected = solve_one(J, a, r);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  EXPECT_EQ(solve_one(RowMajor(J), a, r), expected);
  const MatrixXd Jt = J.transpose();
  EXPECT_EQ(solve_one(Jt.transpose(), a, r), expected);
  MatrixXd larger = wide;
  larger.block(2, 4, 3, 5) = J;
  EXPECT_EQ(solve_one(larger.block(2, 4, 3, 5), a, r), expected);
  const MatrixXd sparse = MatrixXd::NullaryExpr(6, 10, [&](Eigen::Index i, Eigen::Index j) {
    return i % 2 == 0 && j % 2 == 0 ? J(i / 2, j / 2) : nan;
  });
  using Stride = Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>;
  EXPECT_EQ(
      solve_one(Eigen::Map<const MatrixXd, 0, Stride>(sparse.data(), 3, 5, Stride(12, 2)), a, r),
      expected);
  EXPECT_EQ(solve_one(J.row(0), Eigen::Matrix<double, 1, 1>(1.0), r.head<1>()),
            solve_one(MatrixXd(J.row(0)), VectorXd::Ones(1), VectorXd(r.head<1>())));
  // Expressions: a product is evaluated before it is read, a constant is not.
  const MatrixXd product = A * J;
  EXPECT_EQ(solve_one(A * J, VectorXd::Ones(3), A * r),
            solve_one(product, Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(A * r)));
  const Eigen::Matrix<double, 3, 3> F = A;
  const Eigen::Matrix<double, 3, 5> G = J;
  EXPECT_EQ(solve_one(F * G + G, 0.5 * a, F * r),
            solve_one(MatrixXd(F * G + G), Eigen::Vector3d(0.5 * a), Eigen::Vector3d(F * r)));

  Tpik column(5), row(5);
  const VectorXd rho0 = gen.matrix(5, 1);
  ASSERT_EQ(column.reset(rho0, MatrixXd::Identity(5, 5)), Status::ok);
  ASSERT_EQ(row.reset(rho0.transpose(), A.row(0).sum() * MatrixXd::Zero(5, 5)), Status::ok);
  EXPECT_EQ(column.velocity(), row.velocity());
}

// A level whose products overflow is refused, and leaves nothing behind.
template <class Scalar, int N>
void recovers_from_overflow(Scalar huge) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    const auto matrix = [&](int rows, int cols) {
      return gen.matrix(rows, cols).cast<Scalar>().eval();
    };
    using Ones = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;
    icat::Tpik<Scalar, N> used, fresh;
    ASSERT_EQ(used.add_level((huge * matrix(6, N)).eval(), Ones::Ones(6), matrix(6, 1)),
              Status::numerical_failure);
    used.reset();
    auto jacobian = matrix(3, N);
    jacobian.row(1) = jacobian.row(0) + Scalar(1e-2) * jacobian.row(1);  // nearly singular
    jacobian.row(2) = jacobian.row(0);
    const auto reference = matrix(3, 1);
    ASSERT_EQ(fresh.add_level(jacobian, Ones::Ones(3), reference), Status::ok);
    ASSERT_EQ(used.add_level(jacobian, Ones::Ones(3), reference), Status::ok);
    ASSERT_EQ(used.velocity(), fresh.velocity());
  }
}
TEST(Tpik, AnOverflowLeavesNothingBehind) {
  recovers_from_overflow<float, 13>(1e20f);
  recovers_from_overflow<double, 13>(1e160);
  recovers_from_overflow<double, 7>(1e160);
}

TEST(Regularization, BellsMeetThePlainInverseAtTheThreshold) {
  const auto check = [](const auto& policy, auto value_at_zero) {
    using S = decltype(value_at_zero);
    const S t = policy.threshold;
    EXPECT_EQ(policy.inverse(t), S(1) / t);
    EXPECT_EQ(policy.inverse(2 * t), S(1) / (2 * t));
    EXPECT_EQ(policy.inverse(S(0)), value_at_zero);
    const S below = std::nextafter(t, S(0));
    EXPECT_NEAR(policy.inverse(below) * t, 1, 10 * std::numeric_limits<S>::epsilon());
  };
  check(icat::BellRegularization<double>{}, 1e4);
  check(icat::BellRegularization<float>{}, 1 / 1e-4f);
  check(icat::DampedBellRegularization<double>{}, 0.0);
  check(icat::DampedBellRegularization<float>{}, 0.0f);
  // Half-way up the bell, h = λ/2.
  EXPECT_NEAR(icat::BellRegularization<double>{}.inverse(5e-3), 1 / (5e-3 + 5e-5), 1e-9);
}

// --- numbers that are finite, and no speeds
// -------------------------------------------------------

template <class Scalar>
class Implausible : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Implausible, Scalars);

TYPED_TEST(Implausible, HugeNumbersAreRefusedAndTheRestIsServed) {
  using S = TypeParam;
  using M = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>;
  using V = icat::Vector<S, Eigen::Dynamic>;
  // 3e38 and 1e30 for float.
  const S most = std::numeric_limits<S>::max(),
          huge = std::is_same_v<S, float> ? S(1e30) : S(1e200);
  for (const S bad : {S(1e7), huge, most}) {
    for (const bool negative : {false, true}) {
      const S x = negative ? -bad : bad;
      icat::Tpik<S> tpik(4);
      V one = V::Ones(1);
      M J = M::Zero(1, 4), K = M::Zero(1, 4);
      J(0, 0) = 1;
      K(0, 1) = 1;
      ASSERT_EQ(tpik.add_level(J, one, V(V::Constant(1, S(0.1)))), Status::ok);
      const V before = tpik.velocity();
      // A reference.
      const Status status = tpik.add_level(K, one, V(V::Constant(1, x)));
      EXPECT_EQ(status, Status::implausible);
      EXPECT_EQ(V(tpik.velocity()), before);
      EXPECT_EQ(tpik.report().status(), status);
      EXPECT_EQ(tpik.report().failed_level(), 1);
      ASSERT_EQ(tpik.add_level(K, one, V(V::Constant(1, S(0.2)))), Status::ok);
      ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
      EXPECT_NEAR(tpik.velocity()(1), S(0.2), S(1e-6));

      // A measurement: nothing moves.
      V rho0 = V::Zero(4);
      rho0(2) = x;
      M Q0 = M::Identity(4, 4);
      Q0(2, 2) = 0;
      EXPECT_EQ(tpik.reset(rho0, Q0), Status::implausible);
      EXPECT_EQ(tpik.report().status(), Status::implausible);
      EXPECT_EQ(tpik.velocity().norm(), 0);
      EXPECT_EQ(tpik.add_level(J, one, one), Status::ok);
      EXPECT_EQ(tpik.minimize_velocity(), Status::ok);
      EXPECT_EQ(tpik.velocity().norm(), 0);

      // An element of a Jacobian, in a column that is given and in one that is not.
      for (const Eigen::Index column : {2, 1}) {
        SCOPED_TRACE(column);
        rho0(2) = S(0.1);
        ASSERT_EQ(tpik.reset(rho0, Q0), Status::ok);
        M L = K;
        L(0, column) = x;
        (void)tpik.add_level(L, one, one);
        (void)tpik.minimize_velocity();
        EXPECT_LE(tpik.velocity().cwiseAbs().maxCoeff(), S(icat::implausible_speed));

        icat::ParametricTpik<S, Eigen::Dynamic, 1> law(3);
        M split(1, 4);
        split << L(0, 0), L(0, 1), L(0, 3), L(0, 2);
        const Status refused = law.add_level(split, one, one);
        (void)law.minimize_velocity();
        EXPECT_LE(law.rho().cwiseAbs().maxCoeff(), S(icat::implausible_speed));
        EXPECT_LE(law.P().cwiseAbs().maxCoeff(), S(icat::implausible_speed));
        if (column == 2) {
          EXPECT_NE(refused, Status::ok);
        }
      }

      // Bounds take it.
      const V bound = V::Constant(4, S(0.5));
      icat::Tpik<S> bounded(4, {.bounds = {-bound, bound}});
      ASSERT_EQ(bounded.add_level(K, one, V(V::Constant(1, x / 2))), Status::ok);
      EXPECT_LE(bounded.velocity().cwiseAbs().maxCoeff(), S(0.5));

      icat::NullSpaceGuidance<S> guidance(4);
      ASSERT_EQ(guidance.add_task(J, V(V::Constant(1, S(0.1)))), Status::ok);
      EXPECT_EQ(guidance.add_task(K, V(V::Constant(1, x))), Status::implausible);
      EXPECT_NEAR(guidance.velocity().norm(), S(0.1), S(1e-6));
    }
  }
}

// A copy has memory of its own, of its own size.
TEST(Tpik, CopiesOfOtherSize) {
  icat::Tpik<double> small(4), large(12);
  const MatrixXd J = HierarchyGenerator(1).matrix(2, 12);
  const VectorXd a = VectorXd::Constant(2, 0.5), reference = VectorXd::Ones(2);
  ASSERT_EQ(large.add_level(J, a, reference), Status::ok);
  small = large;
  EXPECT_EQ(small.dof(), 12);
  EXPECT_EQ(small.projector(), large.projector());
  const icat::Tpik<double> copy(small);
  ASSERT_EQ(small.add_level(J, a, reference), Status::ok);
  ASSERT_EQ(small.minimize_velocity(), Status::ok);
  EXPECT_EQ(copy.projector(), large.projector());
  EXPECT_EQ(copy.velocity(), large.velocity());
}

}  // namespace
