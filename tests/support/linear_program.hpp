// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A plain linear program, as textbooks have it: two-phase simplex on a dense tableau, Bland's
/// rule. Slow, and unlike anything in the library.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

/// max cᵀ x with A x = b, 0 ≤ x ≤ u; nothing if there is no such x.
inline std::optional<double> maximum(const Eigen::MatrixXd& A, const Eigen::VectorXd& b,
                                     const Eigen::VectorXd& u, const Eigen::VectorXd& c) {
  // Variables: x, its slack to u, one artificial for each equation.
  const Eigen::Index m = A.rows(), n = A.cols(), rows = m + n, real = 2 * n, cols = real + m;
  Eigen::MatrixXd t = Eigen::MatrixXd::Zero(rows + 2, cols + 1);  // last rows: phase 1, phase 2
  std::vector<Eigen::Index> basis(static_cast<std::size_t>(rows));
  for (Eigen::Index i = 0; i < m; ++i) {
    const double sign = b(i) < 0 ? -1 : 1;
    t.row(i).head(n) = sign * A.row(i);
    t(i, cols) = sign * b(i);
    t(i, real + i) = 1;
    basis[static_cast<std::size_t>(i)] = real + i;
    t.row(rows) -= t.row(i);
    t(rows, real + i) = 0;
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    t(m + i, i) = t(m + i, n + i) = 1;
    t(m + i, cols) = u(i);
    basis[static_cast<std::size_t>(m + i)] = n + i;
  }
  t.row(rows + 1).head(n) = -c.transpose();
  const auto pivot = [&](Eigen::Index r, Eigen::Index j) {
    t.row(r) /= t(r, j);
    for (Eigen::Index i = 0; i < rows + 2; ++i) {
      if (i != r && t(i, j) != 0) t.row(i) -= t(i, j) * t.row(r).eval();
    }
    basis[static_cast<std::size_t>(r)] = j;
  };
  const auto optimize = [&](Eigen::Index cost) {
    for (int step = 0; step < 1000; ++step) {
      Eigen::Index enter = 0;
      while (enter < real && t(cost, enter) > -1e-10) ++enter;
      if (enter == real) return;
      Eigen::Index leave = -1;
      double ratio = 0;
      for (Eigen::Index i = 0; i < rows; ++i) {
        if (t(i, enter) < 1e-9) continue;
        const double at = t(i, cols) / t(i, enter);
        const bool earlier = leave >= 0 && basis[static_cast<std::size_t>(i)] <
                                               basis[static_cast<std::size_t>(leave)];
        if (leave < 0 || at < ratio - 1e-12 || (at < ratio + 1e-12 && earlier)) {
          leave = i;
          ratio = at;
        }
      }
      if (leave < 0) return;
      pivot(leave, enter);
    }
  };
  optimize(rows);
  if (t(rows, cols) < -1e-8) return std::nullopt;
  for (Eigen::Index i = 0; i < rows; ++i) {  // artificials leave, or their row is redundant
    if (basis[static_cast<std::size_t>(i)] < real) continue;
    Eigen::Index j = 0;
    t.row(i).head(real).cwiseAbs().maxCoeff(&j);
    if (std::abs(t(i, j)) > 1e-7) {
      pivot(i, j);
    } else {
      t.row(i).setZero();
    }
  }
  optimize(rows + 1);
  return t(rows + 1, cols);
}
