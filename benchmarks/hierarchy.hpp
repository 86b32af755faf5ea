// SPDX-License-Identifier: BSD-3-Clause
// The benchmarks' hierarchies: random dense rows in the shape of the published cooperative mission.
#pragma once

#include <Eigen/Core>
#include <random>
#include <vector>

namespace bench {

template <class Scalar>
struct Level {
  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> jacobian;
  Eigen::Matrix<Scalar, Eigen::Dynamic, 1> activation, reference;
};
template <class Scalar>
using Hierarchy = std::vector<Level<Scalar>>;

/// What the rows' activations are; the closing level follows always.
enum class Pattern {
  steady,       ///< 0 or 1: active rows 1, 0, 1, 1, 0, 0, 6, 0, 6
  one_partial,  ///< steady, with the joint limit at 0.4
  transition,   ///< steady, with the joint limit at 0.4 and the manipulability at 0.6
  all_partial,  ///< every row between 0.05 and 0.95
  onset,        ///< steady, with the other joint limits, the distance and the attitude at 1e-3
  random        ///< every row any of these
};

inline constexpr int rows[] = {7, 1, 1, 1, 1, 6, 6, 7, 6};
inline constexpr int active_rows[] = {1, 0, 1, 1, 0, 0, 6, 0, 6};

/// `dof` degrees of freedom; rows in proportion to H, whose 13 are the default.
template <class Scalar>
Hierarchy<Scalar> hierarchy(Pattern pattern, unsigned seed, int dof = 13) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> element(-1, 1), partial(0.05, 0.95), any(0, 1);
  Hierarchy<Scalar> levels;
  for (int k = 0; k < 9; ++k) {
    // One row stays one: joint limits and tool poses grow with a robot, attitude does not.
    const auto scaled = [&](int n) { return n > 1 ? (n * dof + 12) / 13 : n; };
    const int m = scaled(rows[k]);
    Level<Scalar> level;
    level.jacobian.resize(m, dof);
    for (auto& x : level.jacobian.reshaped()) x = static_cast<Scalar>(element(generator));
    level.activation.resize(m);
    level.reference.resize(m);
    for (int i = 0; i < m; ++i) {
      level.reference(i) = static_cast<Scalar>(element(generator));
      const bool active = i < scaled(active_rows[k]);
      double a = active ? 1 : 0;
      if ((pattern == Pattern::transition || pattern == Pattern::one_partial) && active && k == 0) {
        a = 0.4;
      }
      if (pattern == Pattern::transition && active && k == 2) a = 0.6;
      if (pattern == Pattern::all_partial) a = partial(generator);
      if (pattern == Pattern::onset && !active && k < 5) a = 1e-3;
      if (pattern == Pattern::random) {
        const double kind = any(generator);
        a = kind < 0.3 ? 0 : kind < 0.6 ? 1 : kind < 0.9 ? partial(generator) : 1e-3;
      }
      level.activation(i) = static_cast<Scalar>(a);
    }
    levels.push_back(std::move(level));
  }
  return levels;
}

/// A humanoid of 38 columns: limits of all joints, of which `limits` are active at `a`, three
/// frames of 6, 6 and 6 rows, the centre of mass, posture.
inline Hierarchy<double> humanoid(unsigned seed, int limits, double a) {
  constexpr int dof = 38;
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> element(-1, 1);
  Hierarchy<double> levels;
  for (const int m : {dof, 6, 6, 6, 3, dof}) {
    Level<double> level{Eigen::MatrixXd::Identity(m, dof), Eigen::VectorXd::Ones(m),
                        Eigen::VectorXd(m)};
    for (auto& x : level.jacobian.reshaped()) x = m < dof ? element(generator) : x;
    for (auto& x : level.reference) x = element(generator);
    if (levels.empty()) {
      level.activation.setZero();
      for (int i = 0; i < limits; ++i) level.activation((7 * i + 3) % dof) = a;
    }
    levels.push_back(std::move(level));
  }
  return levels;
}

template <class Solver, class Levels>
void solve(Solver& tpik, const Levels& levels) {
  tpik.reset();
  for (const auto& level : levels) {
    (void)tpik.add_level(level.jacobian, level.activation, level.reference);
  }
  (void)tpik.minimize_velocity();
}

}  // namespace bench
