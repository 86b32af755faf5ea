// SPDX-License-Identifier: BSD-3-Clause
// Activations sweep from 0 to 1 and ẏ follows without a jump; the classical projector jumps.
#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <icat/tpik/tpik.hpp>

#include "support/random_hierarchy.hpp"
#include "support/sanitized.hpp"

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using icat::Status;

constexpr int steps = 10'000;

VectorXd icat_velocity(icat::Tpik<double>& tpik, const RandomHierarchy& h) {
  EXPECT_EQ(tpik.reset(h.rho0, h.Q0), Status::ok);
  for (const auto& level : h.levels) {
    EXPECT_EQ(tpik.add_level(level.J, level.a, level.reference), Status::ok);
  }
  EXPECT_EQ(tpik.minimize_velocity(), Status::ok);
  return tpik.velocity();
}

MatrixXd plain_pseudo_inverse(const MatrixXd& m) {
  Eigen::JacobiSVD<MatrixXd> svd(m, Eigen::ComputeThinU | Eigen::ComputeThinV);
  VectorXd inverse = svd.singularValues();
  for (auto& s : inverse) s = s > 1e-10 ? 1 / s : 0;
  return svd.matrixV() * inverse.asDiagonal() * svd.matrixU().transpose();
}

/// The task-priority solution of Siciliano & Slotine over the rows whose activation is above 0,
/// rows weighted by it: to which the projector is blind.
VectorXd classical_velocity(const RandomHierarchy& h) {
  VectorXd rho = VectorXd::Zero(h.dof);
  MatrixXd P = MatrixXd::Identity(h.dof, h.dof);
  for (const auto& level : h.levels) {
    const MatrixXd AJ = level.a.asDiagonal() * level.J;
    const MatrixXd pinv = plain_pseudo_inverse(AJ * P);
    rho += pinv * (level.a.asDiagonal() * level.reference - AJ * rho);
    P -= pinv * AJ * P;
  }
  return rho;
}

struct Sweep {
  double icat = 0;             ///< largest ‖Δẏ‖ between two of the 10,000 steps
  double icat_tenth = 0;       ///< largest ‖Δẏ‖ when that one step is walked in ten
  double classical = 0;        ///< the classical solution's ‖Δẏ‖ in the first of the steps
  double classical_tenth = 0;  ///< likewise, walked in ten
};

/// Moves `activation` from 0 to 1 in 10,000 steps, and the worst of them in ten more.
Sweep sweep(RandomHierarchy& h, double& activation) {
  icat::Tpik<double> tpik(h.dof);
  const auto walk = [&](double from, double to, int count, auto&& velocity, double& at) {
    double most = 0;
    VectorXd last;
    for (int i = 0; i <= count; ++i) {
      activation = from + (to - from) * i / count;
      const VectorXd y = velocity();
      if (i > 0 && (y - last).norm() > most) {
        most = (y - last).norm();
        at = activation;
      }
      last = y;
    }
    return most;
  };
  const auto ours = [&] { return icat_velocity(tpik, h); };
  const auto theirs = [&] { return classical_velocity(h); };
  constexpr double step = 1.0 / steps;
  Sweep s;
  double at = 0, unused = 0;
  s.icat = walk(0, 1, steps, ours, at);
  s.icat_tenth = walk(std::max(0.0, at - step), at, 10, ours, unused);
  s.classical = walk(0, step, 1, theirs, unused);
  s.classical_tenth = walk(0, step, 10, theirs, unused);
  return s;
}

// O(step) twice over. ‖Δẏ‖ ≤ C step, where C, the Lipschitz constant of ẏ in an activation, is some
// thousands: rates are of order 1 and the bell lets each level amplify by 1/(2 √λ) = 50 at most.
// And a tenth of the worst step must bring clearly less than the whole: a jump would bring it all.
constexpr double lipschitz = 6000;

void expect_continuous(const Sweep& s) {
  EXPECT_LE(s.icat * steps, lipschitz);
  EXPECT_LE(s.icat_tenth, std::max(0.3 * s.icat, 1e-9));
}

TEST(Continuity, ConflictingTasks) {
  // x ≤ … fades in above "x towards the other side", with a third task that shares its direction.
  RandomHierarchy h{4, VectorXd::Zero(4), MatrixXd::Identity(4, 4), {}};
  const auto level = [&](MatrixXd J, VectorXd reference) {
    h.levels.push_back({J, VectorXd::Ones(J.rows()), reference});
  };
  level(Eigen::RowVector4d(1, 0, 0, 0), VectorXd::Constant(1, -1.0));
  level((MatrixXd(2, 4) << 1, 0, 0, 0, 0, 1, 0, 0).finished(), Eigen::Vector2d(1, 0.5));
  level((MatrixXd(2, 4) << 1, 1, 0, 0, 0, 0, 1, 0).finished(), Eigen::Vector2d(0.3, 0.2));
  const Sweep s = sweep(h, h.levels[0].a(0));
  expect_continuous(s);
  EXPECT_GT(s.classical, 0.5);  // −1 against 1, in one step of 1e-4
  EXPECT_GT(s.classical_tenth, 0.99 * s.classical);
}

TEST(Continuity, SingularTasks) {
  // Two rows 1e-3 apart and a third that depends on both, under a row that fades in.
  RandomHierarchy h{5, VectorXd::Zero(5), MatrixXd::Identity(5, 5), {}};
  HierarchyGenerator gen(5);
  MatrixXd J = gen.matrix(3, 5);
  J.row(1) = J.row(0) + 1e-3 * J.row(1);
  J.row(2) = J.row(0) - J.row(1);
  h.levels.push_back({gen.matrix(1, 5), VectorXd::Ones(1), VectorXd::Ones(1)});
  h.levels.push_back({J, VectorXd::Ones(3), Eigen::Vector3d(0.1, 0.1, -0.2)});
  h.levels.push_back({J.topRows(1), VectorXd::Ones(1), VectorXd::Ones(1)});
  using Place = std::pair<std::size_t, int>;
  for (const auto& [l, r] : {Place{0, 0}, Place{1, 0}, Place{1, 1}, Place{1, 2}, Place{2, 0}}) {
    SCOPED_TRACE(testing::Message() << "level " << l << " row " << r);
    const Sweep s = sweep(h, h.levels[l].a(r));
    expect_continuous(s);
    h.levels[l].a(r) = 1;
  }
}

TEST(Continuity, RandomHierarchiesWithConflictsAndSingularRows) {
  int classical_jumps = 0;
  for (unsigned seed = 0; seed < (sanitized ? 2 : 24); ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    RandomHierarchy h = gen.hierarchy(4, 8);
    if (h.levels.size() > 5) h.levels.resize(5);
    auto& level =
        h.levels[static_cast<std::size_t>(gen.integer(0, static_cast<int>(h.levels.size()) - 1))];
    const auto row = gen.integer(0, static_cast<int>(level.a.size()) - 1);
    const Sweep s = sweep(h, level.a(row));
    expect_continuous(s);
    if (s.classical > 0.05 && s.classical_tenth > 0.99 * s.classical) ++classical_jumps;
  }
  if (!sanitized) {
    EXPECT_GT(classical_jumps, 5);
  }
}

// The increments shrink with the step, which a jump would not do.
TEST(Continuity, HalvingTheStepHalvesTheIncrement) {
  RandomHierarchy h{3, VectorXd::Zero(3), MatrixXd::Identity(3, 3), {}};
  h.levels.push_back({Eigen::RowVector3d(1, 0, 0), VectorXd::Ones(1), VectorXd::Constant(1, -1.0)});
  h.levels.push_back({Eigen::RowVector3d(1, 1e-3, 0), VectorXd::Ones(1), VectorXd::Ones(1)});
  icat::Tpik<double> tpik(3);
  const auto largest = [&](int n) {
    double most = 0;
    VectorXd last = VectorXd::Zero(3);
    for (int i = 0; i <= n; ++i) {
      h.levels[0].a(0) = static_cast<double>(i) / n;
      const VectorXd y = icat_velocity(tpik, h);
      if (i > 0) most = std::max(most, (y - last).norm());
      last = y;
    }
    return most;
  };
  const double coarse = largest(5'000), fine = largest(10'000), finest = largest(20'000);
  EXPECT_LT(fine, 0.6 * coarse);
  EXPECT_LT(finest, 0.6 * fine);
}

// The closing level is what makes ẏ continuous: without it, ρ_N is not small in what Q_N leaves.
TEST(Continuity, TheClosingLevelIsNotSkipped) {
  HierarchyGenerator gen(8);
  icat::Tpik<double> tpik(6);
  const MatrixXd J = gen.matrix(2, 6);
  ASSERT_EQ(tpik.add_level(J, VectorXd::Constant(2, 0.5), VectorXd::Ones(2)), Status::ok);
  const VectorXd open = tpik.velocity();
  ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
  EXPECT_GT((tpik.velocity() - open).norm(), 1e-3);
}

}  // namespace
