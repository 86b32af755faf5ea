// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Seeded random hierarchies with everything in them that makes a solver stumble. A seed alone
/// reproduces one.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <vector>

struct RandomLevel {
  Eigen::MatrixXd J;
  Eigen::VectorXd a;
  Eigen::VectorXd reference;
};

struct RandomHierarchy {
  Eigen::Index dof;
  Eigen::VectorXd rho0;
  Eigen::MatrixXd Q0;
  std::vector<RandomLevel> levels;
};

/// Kinds of rows that are hard for any solver.
enum class Family {
  dependent,         ///< exact multiples, sums and copies of other rows
  nearly_dependent,  ///< the same, 1e-2 to 1e-12 apart
  scaled,            ///< rows scaled by 1e-4 to 1e4
  tall               ///< more rows than columns, at rank loss or 1e-2 to 1e-14 from it
};

class HierarchyGenerator {
 public:
  explicit HierarchyGenerator(unsigned seed) : rng_(seed) {}

  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(rng_); }
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng_);
  }
  double normal() { return std::normal_distribution<double>()(rng_); }
  Eigen::MatrixXd matrix(Eigen::Index rows, Eigen::Index cols) {
    Eigen::MatrixXd m(rows, cols);
    for (Eigen::Index i = 0; i < m.size(); ++i) m(i) = normal();
    return m;
  }

  Eigen::VectorXd activations(Eigen::Index rows) {
    Eigen::VectorXd a(rows);
    const int kind = integer(0, 5);
    for (Eigen::Index i = 0; i < rows; ++i) {
      switch (kind) {
        case 0:
        case 1:
          a(i) = 1;
          break;
        case 2:
          a(i) = 0;
          break;
        case 3:
          a(i) = integer(0, 1);
          break;
        case 4:
          a(i) = uniform(0, 1);
          break;
        default: {
          const double menu[] = {0, 1, uniform(0, 1), 1e-3};
          a(i) = menu[integer(0, 3)];
        }
      }
    }
    return a;
  }

  /// Dof 4…30, 1…12 levels of 1…n rows; zero rows, duplicates, rows 1e-9 and 1e-2 apart, within a
  /// level and across levels, scales down to 1e-3; both starts.
  RandomHierarchy hierarchy(int min_dof = 4, int max_dof = 30) {
    RandomHierarchy h;
    h.dof = integer(min_dof, max_dof);
    h.rho0 = Eigen::VectorXd::Zero(h.dof);
    h.Q0 = Eigen::MatrixXd::Identity(h.dof, h.dof);
    if (integer(0, 1) == 1) {
      for (int i = integer(1, 3); i > 0; --i) {
        const int k = integer(0, static_cast<int>(h.dof) - 1);
        h.rho0(k) = uniform(-0.2, 0.2);
        h.Q0(k, k) = 0;
      }
    }
    Eigen::MatrixXd seen(0, h.dof);
    for (int l = integer(1, 12); l > 0; --l) {
      const int most = integer(0, 3) == 0 ? static_cast<int>(h.dof) : std::min(6, int(h.dof));
      const int rows = integer(1, most);
      RandomLevel level{matrix(rows, h.dof), activations(rows), matrix(rows, 1)};
      if (integer(0, 3) == 0) level.J *= std::pow(10.0, -uniform(0, 3));
      for (int i = 0; i < rows; ++i) {
        const bool within = i > 0 && integer(0, 1) == 1;
        if (!within && seen.rows() == 0) continue;
        const Eigen::RowVectorXd other =
            within ? Eigen::RowVectorXd(level.J.row(integer(0, i - 1)))
                   : Eigen::RowVectorXd(seen.row(integer(0, static_cast<int>(seen.rows()) - 1)));
        switch (integer(0, 15)) {
          case 0:
            level.J.row(i).setZero();
            break;
          case 1:
            level.J.row(i) = other;
            break;
          case 2:
            level.J.row(i) = other + 1e-9 * level.J.row(i);
            break;
          case 3:
            level.J.row(i) = other + 1e-2 * level.J.row(i);
            break;
          default:
            break;
        }
      }
      seen.conservativeResize(seen.rows() + rows, h.dof);
      seen.bottomRows(rows) = level.J;
      h.levels.push_back(level);
    }
    return h;
  }

  /// Dof 2…7, 1…4 levels of 1…5 rows.
  RandomHierarchy hierarchy_of(Family family) {
    RandomHierarchy h;
    h.dof = integer(2, 7);
    h.rho0 = Eigen::VectorXd::Zero(h.dof);
    h.Q0 = Eigen::MatrixXd::Identity(h.dof, h.dof);
    Eigen::MatrixXd seen(0, h.dof);
    for (int l = integer(1, 4); l > 0; --l) {
      const bool tall = family == Family::tall && integer(0, 1) == 0;
      const int rows = tall ? static_cast<int>(h.dof) + integer(1, 5) : integer(1, 5);
      RandomLevel level{matrix(rows, h.dof), activations(rows), matrix(rows, 1)};
      if (tall) {
        const int rank = integer(1, static_cast<int>(h.dof));
        const double distance = integer(0, 2) == 0 ? 0 : std::pow(10.0, -uniform(2, 14));
        level.J = matrix(rows, rank) * matrix(rank, h.dof) + distance * level.J;
      }
      for (int i = 0; i < rows; ++i) {
        if (family == Family::scaled) level.J.row(i) *= std::pow(10.0, uniform(-4, 4));
        if (family == Family::dependent || family == Family::nearly_dependent) {
          Eigen::MatrixXd others(seen.rows() + i, h.dof);
          others << seen, level.J.topRows(i);
          const int last = static_cast<int>(others.rows()) - 1;
          if (last < 0 || integer(0, 1) == 0) continue;
          const double menu[] = {1, -1, 2, 0.5, uniform(-3, 3)};
          Eigen::RowVectorXd row = menu[integer(0, 4)] * others.row(integer(0, last));
          if (integer(0, 1) == 0) row += menu[integer(0, 4)] * others.row(integer(0, last));
          if (family == Family::nearly_dependent) {
            row += std::pow(10.0, -uniform(2, 12)) * level.J.row(i);
          }
          level.J.row(i) = row;
        }
      }
      seen.conservativeResize(seen.rows() + rows, h.dof);
      seen.bottomRows(rows) = level.J;
      h.levels.push_back(level);
    }
    return h;
  }

 private:
  std::mt19937 rng_;
};
