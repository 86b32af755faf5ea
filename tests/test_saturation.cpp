// SPDX-License-Identifier: BSD-3-Clause
// What happens at the velocity bounds: the ways of saturation beside the published one. The
// published one: test_tpik.cpp; continuity of all three: test_tpik_continuity.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <icat/model/kinematic_tree.hpp>
#include <icat/tpik/tpik.hpp>

#include "support/linear_algebra.hpp"
#include "support/random_hierarchy.hpp"
#include "support/robots.hpp"
#include "support/sanitized.hpp"

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using icat::Saturation;
using icat::Status;
using Tpik = icat::Tpik<double>;

VectorXd solve(Tpik& tpik, const RandomHierarchy& h) {
  EXPECT_EQ(tpik.reset(h.rho0, h.Q0), Status::ok);
  for (const auto& level : h.levels) {
    EXPECT_EQ(tpik.add_level(level.J, level.a, level.reference), Status::ok);
  }
  EXPECT_EQ(tpik.minimize_velocity(), Status::ok);
  return tpik.velocity();
}

Tpik bounded(Eigen::Index dof, double bound, Saturation saturation) {
  const VectorXd b = VectorXd::Constant(dof, bound);
  return Tpik(dof, {.bounds = {-b, b}, .saturation = saturation});
}

TEST(Saturation, BitwiseAsPublishedWhereNothingSaturates) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE(seed);
    const RandomHierarchy h = HierarchyGenerator(seed).hierarchy(4, 12);
    Tpik free(h.dof);
    const VectorXd y = solve(free, h);
    for (const auto s :
         {Saturation::scale, Saturation::continuous_scale, Saturation::redistribute}) {
      Tpik tpik = bounded(h.dof, 1e4, s);
      EXPECT_EQ(solve(tpik, h), y);
      for (const auto& level : tpik.report().levels()) {
        EXPECT_EQ(level.saturated, 0);
        EXPECT_EQ(level.saturation_steps, 0);
        EXPECT_EQ(level.saturation_scale, 1);
      }
    }
  }
}

// Bounds hold exactly, whatever the hierarchy; a level that is added changes the rates of none
// above that is wholly active and not regularized: their rows are not in the range of Q.
template <class Scalar>
void expect_bounds_and_priorities(Saturation saturation) {
  int saturated = 0, kept = 0;
  Eigen::Index most_steps = -1000;
  for (unsigned seed = 0; seed < (sanitized ? 60 : 600); ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    const RandomHierarchy h = gen.hierarchy(4, 14);
    const icat::Vector<Scalar, Eigen::Dynamic> bound =
        VectorXd::Constant(h.dof, 0.3).cast<Scalar>();
    icat::Tpik<Scalar> tpik(h.dof, {.bounds = {-bound, bound}, .saturation = saturation});
    ASSERT_EQ(tpik.reset(h.rho0.cast<Scalar>(), h.Q0.cast<Scalar>()), Status::ok);
    std::vector<std::pair<MatrixXd, VectorXd>> above;
    bool projects = true;  // Q is an orthogonal projector
    for (std::size_t k = 0; k <= h.levels.size(); ++k) {
      if (k < h.levels.size()) {
        const auto& level = h.levels[k];
        ASSERT_EQ(tpik.add_level(level.J.cast<Scalar>(), level.a.cast<Scalar>(),
                                 level.reference.cast<Scalar>()),
                  Status::ok);
      } else {
        ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
      }
      ASSERT_LE(tpik.velocity().cwiseAbs().maxCoeff(), bound(0));
      const auto report = tpik.report().levels().back();
      ASSERT_GE(report.saturation_scale, 0);
      ASSERT_LE(report.saturation_scale, 1);
      saturated += report.saturated > 0 ? 1 : 0;
      most_steps = std::max(most_steps, report.saturation_steps - 4 * h.dof);
      const VectorXd y = tpik.velocity().template cast<double>();
      for (const auto& [J, rate] : above) {
        // Rounding: of Q against the level's rows, of size J times n. Multipliers are up to 1/ε of
        // what a component is taken back, where hardly any null space is left.
        const double rounding = std::numeric_limits<Scalar>::epsilon() *
                                (saturation == Saturation::redistribute ? 1e3 : 1);
        ASSERT_LE((J * y - rate).norm(), 1e3 * rounding * (1 + J.norm()));
        ++kept;
      }
      if (k == h.levels.size()) break;
      const auto& level = h.levels[k];
      projects =
          projects && !report.regularized && (level.a.array() == level.a.array().round()).all();
      if (projects && report.active_rows == report.rows) above.emplace_back(level.J, level.J * y);
    }
  }
  EXPECT_GT(saturated, sanitized ? 50 : 1000);
  EXPECT_GT(kept, sanitized ? 20 : 400);
  EXPECT_LT(most_steps, 0);  // the bound on time is never what ends the search
}
TEST(Saturation, BoundsHoldAndPrioritiesAreKept) {
  for (const auto s : {Saturation::scale, Saturation::continuous_scale, Saturation::redistribute}) {
    SCOPED_TRACE(static_cast<int>(s));
    expect_bounds_and_priorities<double>(s);
    expect_bounds_and_priorities<float>(s);
  }
}

// The minimum of the header's problem by trying all 3ⁿ sets of components at their bounds.
VectorXd minimum(const MatrixXd& G, const VectorXd& p, double bound) {
  const Eigen::Index n = p.size();
  double best = 1e300;
  VectorXd answer = p;
  int sets = 1;
  for (Eigen::Index i = 0; i < n; ++i) sets *= 3;
  for (int set = 0; set < sets; ++set) {
    std::vector<Eigen::Index> held;
    VectorXd target = p;
    for (Eigen::Index i = 0, rest = set; i < n; ++i, rest /= 3) {
      if (rest % 3 == 0) continue;
      held.push_back(i);
      target(i) = rest % 3 == 1 ? bound : -bound;
    }
    VectorXd x = p;
    double cost = 0;
    if (!held.empty()) {
      const MatrixXd g = G(held, held);
      if (testing_support::rank(g) < g.rows()) continue;
      const VectorXd mu = testing_support::solve(g, (target - p)(held));
      x += G(Eigen::all, held) * mu;
      cost = mu.dot(g * mu);
    }
    if ((x.cwiseAbs().array() > bound + 1e-9).any()) continue;
    if (cost < best) {
      best = cost;
      answer = x;
    }
  }
  return answer;
}

TEST(Redistribution, IsTheMinimum) {
  Eigen::Index most = 0;
  for (unsigned seed = 0; seed < (sanitized ? 100 : 1000); ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    const Eigen::Index n = gen.integer(2, 5), rank = gen.integer(0, static_cast<int>(n));
    MatrixXd Q = MatrixXd::Zero(n, n);
    if (rank > 0) {
      const MatrixXd B = testing_support::orthogonal(gen.matrix(n, rank)).leftCols(rank);
      Q = B * B.transpose();
    }
    const double bound = 0.5;
    const VectorXd rho = (0.4 * gen.matrix(n, 1)).cwiseMin(0.4).cwiseMax(-0.4);
    const VectorXd delta = gen.matrix(n, 1);
    if (((rho + delta).cwiseAbs().array() <= bound).all()) continue;
    icat::detail::Redistribution<double, Eigen::Dynamic> r(n);
    const double s = r.solve(
        Q, rho.data(), delta.data(), [&](Eigen::Index) { return -bound; },
        [&](Eigen::Index) { return bound; });
    const MatrixXd G = Q * Q.transpose() + 1e-3 * delta * delta.transpose() / delta.squaredNorm();
    // The inverse of G's part: 1 / (ε d²) at most, of a component d of Δ's direction of 1e-3 here.
    EXPECT_LE((rho + r.increment - minimum(G, rho + delta, bound)).norm(), 1e-7);
    EXPECT_GE(s, 0);
    EXPECT_LE(s, 1);
    most = std::max(most, r.held());
  }
  EXPECT_GE(most, 3);
}

// Case: a 7R arm whose null space is free while one joint reaches its bound.
TEST(Redistribution, TheToolKeepsItsVelocityWhileAJointIsAtItsBound) {
  const auto arm = testing_support::fixed_arm();
  const MatrixXd J = arm.jacobian(arm.frame("end_effector"));
  VectorXd tool(6);
  tool << 0.1, -0.05, 0.08, 0.1, 0.05, -0.1;
  const auto run = [&](const VectorXd& bound, Saturation saturation) {
    Tpik tpik(7, {.bounds = {-bound, bound}, .saturation = saturation});
    EXPECT_EQ(tpik.add_level(J, VectorXd::Ones(6), tool), Status::ok);
    EXPECT_EQ(tpik.minimize_velocity(), Status::ok);
    return tpik;
  };
  const VectorXd far = VectorXd::Constant(7, 10);
  const VectorXd free = run(far, Saturation::redistribute).velocity();
  ASSERT_LT((J * free - tool).norm(), 1e-12);
  const MatrixXd null_space =
      MatrixXd::Identity(7, 7) - testing_support::pseudo_inverse(J, 1e-10) * J;
  Eigen::Index largest = 0;
  null_space.colwise().norm().maxCoeff(&largest);
  const VectorXd n = null_space.col(largest).normalized();
  int tried = 0;
  for (int joint = 0; joint < 7; ++joint) {
    SCOPED_TRACE(joint);
    if (std::abs(free(joint)) < 0.01 || n(joint) * n(joint) < 0.02) continue;
    ++tried;
    VectorXd bound = far;
    bound(joint) = 0.7 * std::abs(free(joint));
    const Tpik scaled = run(bound, Saturation::scale),
               shared = run(bound, Saturation::redistribute);
    // The level slows by ε d²/q, see redistribution.hpp: d the joint's part of the increment's
    // direction, q = n² that of the null space.
    const double d = free(joint) / free.norm();
    const double tolerance = 1e-3 * d * d / (n(joint) * n(joint));
    EXPECT_LE((J * shared.velocity() - tool).norm(), tolerance * tool.norm());
    EXPECT_LE((J * shared.velocity() - tool).norm(), 0.01 * tool.norm());
    EXPECT_GE((J * scaled.velocity() - tool).norm(), 0.29 * tool.norm());
    EXPECT_LE(std::abs(shared.velocity()(joint)), bound(joint));
    EXPECT_EQ(shared.report().levels()[0].saturated, 1);
    EXPECT_EQ(shared.report().levels()[0].saturation_steps, 1);
    EXPECT_GE(shared.report().levels()[0].saturation_scale, 1 - tolerance);
    EXPECT_EQ(scaled.report().levels()[0].saturated, 1);
  }
  EXPECT_GE(tried, 3);
}

// Where no null space is left nobody can take over: the level is scaled.
TEST(Redistribution, ScalesWhatNobodyCanTakeOver) {
  Tpik tpik = bounded(2, 1, Saturation::redistribute);
  const VectorXd one = VectorXd::Ones(2);
  ASSERT_EQ(tpik.add_level(MatrixXd::Identity(2, 2), one, Eigen::Vector2d(4, 2)), Status::ok);
  EXPECT_NEAR(tpik.velocity()(0), 0.975, 1e-12);
  EXPECT_NEAR(tpik.velocity()(1), 0.975 / 2, 1e-12);
  EXPECT_NEAR(tpik.report().levels()[0].saturation_scale, 0.975 / 4, 1e-12);
}

// Some share of the bounds is left for every level, in its place: also after inactive ones.
TEST(Saturation, EveryLevelFindsRoom) {
  Tpik tpik = bounded(2, 1, Saturation::continuous_scale);
  using One = Eigen::Matrix<double, 1, 1>;
  const Eigen::RowVector2d x(1, 0), y(0, 1);
  ASSERT_EQ(tpik.add_level(x, One(0.5), One(50.0)), Status::ok);
  EXPECT_NEAR(tpik.velocity()(0), 1 - 0.05 / 2, 1e-9);
  ASSERT_EQ(tpik.add_level(x, One(0.0), One(50.0)), Status::ok);
  EXPECT_NEAR(tpik.velocity()(0), 1 - 0.05 / 2, 1e-9);
  ASSERT_EQ(tpik.add_level(x, One(1.0), One(50.0)), Status::ok);
  EXPECT_NEAR(tpik.velocity()(0), 1 - 0.05 / 4, 1e-9);
  ASSERT_EQ(tpik.add_level(y, One(1.0), One(-50.0)), Status::ok);
  EXPECT_NEAR(tpik.velocity()(1), -1 + 0.05 / 5, 1e-9);
}

}  // namespace
