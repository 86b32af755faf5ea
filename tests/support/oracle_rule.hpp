// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// By what rule the solver is judged against the literal formula.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "oracle.hpp"

namespace oracle {

template <class Solver>
void run(Solver& tpik, const RandomHierarchy& h) {
  ASSERT_EQ(tpik.reset(h.rho0, h.Q0), icat::Status::ok);
  for (const auto& level : h.levels) {
    ASSERT_EQ(tpik.add_level(level.J, level.a, level.reference), icat::Status::ok);
  }
  ASSERT_EQ(tpik.minimize_velocity(), icat::Status::ok);
}

inline double relative_error(const Eigen::VectorXd& x, const Vec<long double>& exact) {
  return static_cast<double>((x.cast<long double>() - exact).norm() / std::max(exact.norm(), 1.0L));
}

inline double relative_error(const Eigen::MatrixXd& Q, const Mat<long double>& exact) {
  return static_cast<double>((Q.cast<long double>() - exact).norm() /
                             std::sqrt(static_cast<long double>(exact.rows())));
}

/// New place of each of `size` things; in order 0 each keeps its own.
inline Eigen::PermutationMatrix<Eigen::Dynamic> places(HierarchyGenerator& gen, Eigen::Index size,
                                                       int order) {
  Eigen::PermutationMatrix<Eigen::Dynamic> p(size);
  p.setIdentity();
  for (int i = static_cast<int>(size) - 1; order > 0 && i > 0; --i) {
    std::swap(p.indices()(i), p.indices()(gen.integer(0, i)));
  }
  return p;
}

/// The literal formula in `Real` on the first `levels` levels, and the closing one if `close`, with
/// columns and rows in another order; ρ and Q are turned back. In exact arithmetic every order
/// gives the same.
template <class Real>
LiteralTpik<Real> literal_in_order(int order, const RandomHierarchy& h, std::size_t levels,
                                   bool close, const Parameters<Real>& p) {
  HierarchyGenerator gen(static_cast<unsigned>(order));
  const auto columns = places(gen, h.dof, order);
  LiteralTpik<Real> tpik{p, columns * h.rho0.cast<Real>(),
                         columns * h.Q0.cast<Real>() * columns.transpose(), Vec<Real>::Zero(h.dof)};
  for (std::size_t l = 0; l < levels; ++l) {
    const RandomLevel& level = h.levels[l];
    const auto rows = places(gen, level.a.size(), order);
    tpik.add(rows * level.J.cast<Real>() * columns.transpose(), rows * level.a.cast<Real>(),
             rows * level.reference.cast<Real>());
  }
  if (close) tpik.close();
  tpik.rho = (columns.transpose() * tpik.rho).eval();
  tpik.Q = (columns.transpose() * tpik.Q * columns).eval();
  return tpik;
}

/// The one rule, in every build: an error is at most `floor`, or ten times what the
/// literal formula itself loses in `Real`. What it loses depends on the order of its sums, thus on
/// compiler and flags, and one order may be lucky by some powers of ten: the worst of eight counts.
/// `error_of` measures a LiteralTpik<Real> as `error` was measured. Returns the error in units of
/// what the literal formula loses; 0 up to `floor`.
template <class Real, class ErrorOf>
double expect_as_good_as_literal(double error, double floor, const RandomHierarchy& h,
                                 std::size_t levels, bool close, const Parameters<Real>& p,
                                 const ErrorOf& error_of) {
  if (error <= floor) return 0;
  double literal = 0;
  for (int order = 0; order < 8; ++order) {
    literal = std::max(literal, error_of(literal_in_order<Real>(order, h, levels, close, p)));
  }
  EXPECT_LE(error, 10 * literal);
  return error / literal;
}

struct Judged {
  double error, by_literal;
};

/// The velocity of a whole hierarchy.
template <class Real>
Judged expect_exact(const Eigen::VectorXd& velocity, const RandomHierarchy& h,
                    const Parameters<Real>& p = {}, double floor = 1e-9) {
  const Vec<long double> exact = solve<long double>(h, {p.lambda, p.threshold, p.eta, p.form});
  const double error = relative_error(velocity, exact);
  return {error, expect_as_good_as_literal<Real>(
                     error, floor, h, h.levels.size(), true, p, [&](const auto& l) {
                       return relative_error(Eigen::VectorXd(l.rho.template cast<double>()), exact);
                     })};
}

}  // namespace oracle
