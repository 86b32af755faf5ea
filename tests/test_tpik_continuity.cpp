// SPDX-License-Identifier: BSD-3-Clause
// Activations sweep from 0 to 1 and ẏ follows without a jump; the classical projector jumps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <icat/tpik/tpik.hpp>

#include "support/linear_algebra.hpp"
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
  return testing_support::pseudo_inverse(m, 0, 1e-10);
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

// --- at the velocity bounds ---------------------------------------------------------------------

/// A smooth curve of hierarchies: rows that turn, vanish, cross a row of a level above or of their
/// own, references that swing, activations that come and go. A seed alone reproduces one.
class Curve {
 public:
  explicit Curve(unsigned seed) : gen_(seed), dof_(gen_.integer(3, 8)), start_(gen_.uniform(0, 1)) {
    levels_.resize(static_cast<std::size_t>(gen_.integer(2, 5)));
    for (std::size_t k = 0; k < levels_.size(); ++k) {
      for (int rows = gen_.integer(1, std::min(4, dof_)); rows > 0; --rows) {
        Row row{.middle = gen_.matrix(1, dof_), .swing = 0.5 * gen_.matrix(1, dof_)};
        row.reference = gen_.normal();
        row.reference_swing = gen_.normal();
        row.phase = gen_.uniform(0, 6.28);
        row.speed = gen_.uniform(0.5, 1.5);
        row.kind = gen_.integer(0, 3);
        row.partial = gen_.integer(0, 2) == 0;
        if (k > 0) row.level = static_cast<std::size_t>(gen_.integer(0, static_cast<int>(k) - 1));
        row.other = gen_.integer(0, 3);
        levels_[k].push_back(row);
      }
    }
  }
  int dof() const { return dof_; }

  /// A turn takes 50 to 200 s; rows' angles are 2π t / turn.
  RandomHierarchy at(double t) const {
    RandomHierarchy h{dof_, VectorXd::Zero(dof_), MatrixXd::Identity(dof_, dof_), {}};
    for (std::size_t k = 0; k < levels_.size(); ++k) {
      const auto n = static_cast<Eigen::Index>(levels_[k].size());
      RandomLevel level{MatrixXd(n, dof_), VectorXd::Ones(n), VectorXd(n)};
      for (Eigen::Index i = 0; i < n; ++i) {
        const Row& row = levels_[k][static_cast<std::size_t>(i)];
        const double angle = 6.2832 * row.speed * (start_ + t / 100) + row.phase;
        level.J.row(i) = row.middle + std::sin(angle) * row.swing;
        if (row.kind == 1) level.J.row(i) *= std::cos(angle);
        if (row.kind == 2 && k > 0) {
          const auto& above = h.levels[row.level].J;
          level.J.row(i) = above.row(row.other % above.rows()) + std::cos(angle) * level.J.row(i);
        }
        if (row.kind == 3 && i > 0) {
          level.J.row(i) = level.J.row(i - 1) + std::cos(angle) * level.J.row(i);
        }
        level.reference(i) = row.reference + std::sin(1.3 * angle) * row.reference_swing;
        if (row.partial) {
          const double s = std::clamp(0.5 + std::sin(0.7 * angle + 1), 0.0, 1.0);
          level.a(i) = s * s * (3 - 2 * s);
        }
      }
      h.levels.push_back(level);
    }
    return h;
  }

 private:
  struct Row {
    Eigen::RowVectorXd middle, swing;
    double reference{0}, reference_swing{0}, phase{0}, speed{0};
    int kind{0};  // 1 vanishes, 2 crosses a row of a level above, 3 one of its own level
    bool partial{false};
    std::size_t level{0};  // for kind 2, with the row
    int other{0};
  };
  HierarchyGenerator gen_;
  int dof_;
  double start_;
  std::vector<std::vector<Row>> levels_;
};

/// Counts alternating steps: three in a row of changing sign, each above 1e-3, in a component.
class Alternations {
 public:
  void add(const VectorXd& step) {
    for (Eigen::Index i = 0; i < step.size() && before_.size() > 0; ++i) {
      const double a = before_(i), b = last_(i), c = step(i);
      if (a * b < 0 && b * c < 0 && std::min({std::abs(a), std::abs(b), std::abs(c)}) > 1e-3) {
        ++count;
      }
    }
    before_ = last_;
    last_ = step;
  }
  int count = 0;

 private:
  VectorXd before_, last_;
};

struct AtTheBounds {
  int jumps = 0;         ///< curves with a step of ẏ that does not shrink with time
  double largest = 0;    ///< such a step
  int alternations = 0;  ///< of ẏ
  int commanded = 0;     ///< alternations of the command behind motion limits
  double command = 0;    ///< its largest step
};

constexpr double period = 1e-3, acceleration = 5;  // s; rad/s²

/// 10 s of each of 60 curves, with bounds of ±0.5 rad/s. The command moves from the last one
/// towards ẏ along a line, by `acceleration` times `period` at most in each component.
AtTheBounds walk_curves(icat::Saturation saturation) {
  AtTheBounds all;
  constexpr int cycles = sanitized ? 300 : 10'000;
  for (unsigned seed = 0; seed < (sanitized ? 6 : 60); ++seed) {
    const Curve curve(seed);
    const VectorXd bound = VectorXd::Constant(curve.dof(), 0.5);
    icat::Tpik<double> tpik(curve.dof(), {.bounds = {-bound, bound}, .saturation = saturation});
    const auto velocity = [&](double t) { return icat_velocity(tpik, curve.at(t)); };
    Alternations answer, commands;
    VectorXd last = velocity(0), command = last;
    double worst = 0, at = 0;
    for (int cycle = 1; cycle <= cycles; ++cycle) {
      const VectorXd y = velocity(cycle * period);
      answer.add(y - last);
      const double step = (y - last).lpNorm<Eigen::Infinity>();
      if (step > worst) at = (cycle - 1) * period;
      worst = std::max(worst, step);
      last = y;
      const double far = (y - command).lpNorm<Eigen::Infinity>();
      const VectorXd move = std::min(1.0, acceleration * period / far) * (y - command);
      command += move;
      commands.add(move);
      all.command = std::max(all.command, move.lpNorm<Eigen::Infinity>());
    }
    all.alternations += answer.count;
    all.commanded += commands.count;
    // The worst step walked in ten, of which the worst in ten, and so on down to 1e-6 of it.
    double width = period;
    for (int depth = 0; depth < 6; ++depth, width /= 10) {
      const double from = at;
      VectorXd previous = velocity(from);
      worst = 0;
      for (int k = 1; k <= 10; ++k) {
        const VectorXd y = velocity(from + width * k / 10);
        const double step = (y - previous).lpNorm<Eigen::Infinity>();
        if (step > worst) at = from + width * (k - 1) / 10;
        worst = std::max(worst, step);
        previous = y;
      }
    }
    if (worst > 1e-3) ++all.jumps;
    all.largest = std::max(all.largest, worst);
  }
  testing::Test::RecordProperty("jumps", all.jumps);
  std::printf("jumps %d, up to %.3g; alternations %d, behind motion limits %d, steps to %.3g\n",
              all.jumps, all.largest, all.alternations, all.commanded, all.command);
  return all;
}

// Documented, see docs/solver.md: as published ẏ jumps at the bounds.
TEST(ContinuityAtTheBounds, PublishedScalingJumps) {
  const AtTheBounds all = walk_curves(icat::Saturation::scale);
  EXPECT_LE(all.command, acceleration * period * (1 + 1e-9));
  if (!sanitized) {
    EXPECT_GT(all.jumps, 10);
    EXPECT_GT(all.largest, 0.3);
  }
}

TEST(ContinuityAtTheBounds, ContinuousScalingDoesNot) {
  const AtTheBounds all = walk_curves(icat::Saturation::continuous_scale);
  EXPECT_EQ(all.jumps, 0);
  EXPECT_EQ(all.commanded, 0);
  EXPECT_LE(all.command, acceleration * period * (1 + 1e-9));
}

TEST(ContinuityAtTheBounds, RedistributionDoesNot) {
  const AtTheBounds all = walk_curves(icat::Saturation::redistribute);
  EXPECT_EQ(all.jumps, 0);
  EXPECT_EQ(all.commanded, 0);
  EXPECT_LE(all.command, acceleration * period * (1 + 1e-9));
}

}  // namespace
