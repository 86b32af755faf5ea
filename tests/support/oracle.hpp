// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// [Coop, Eq. (20)–(25)] written down as printed (errata applied), with a full SVD and no thought
/// for speed: the oracle of the solver's tests. `Real` may be long double.
#pragma once

#include <Eigen/Core>

#include "random_hierarchy.hpp"

namespace oracle {

template <class Real>
using Mat = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
template <class Real>
using Vec = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

enum class Form { bell, damped };

template <class Real>
struct Parameters {
  Real lambda = Real(1e-4);
  Real threshold = Real(1e-2);
  Real eta = 1;
  Form form = Form::bell;
};

/// X^{#,A,Q}, Eq. (20). Compiled once for each scalar, in oracle.cpp: the SVDs are slow to compile.
template <class Real>
Mat<Real> pseudo_inverse(const Mat<Real>& X, const Vec<Real>& a, const Mat<Real>& Q,
                         const Parameters<Real>& p);

/// Eq. (21)–(23).
template <class Real>
struct LiteralTpik {
  Parameters<Real> p;
  Vec<Real> rho;
  Mat<Real> Q;
  Vec<Real> increment;

  void add(const Mat<Real>& J, const Vec<Real>& a, const Vec<Real>& reference) {
    const Mat<Real> I = Mat<Real>::Identity(Q.rows(), Q.rows());
    const Mat<Real> X = J * Q;
    const Mat<Real> W = X * pseudo_inverse<Real>(X, a, Q, p);
    const Mat<Real> X_I = pseudo_inverse<Real>(X, a, I, p);
    increment = Q * X_I * W * (reference - J * rho);
    rho += increment;
    Q = (Q * (I - X_I * X)).eval();
  }
  void close() {
    const Eigen::Index n = Q.rows();
    const Mat<Real> keep = Q;
    add(Mat<Real>::Identity(n, n), Vec<Real>::Ones(n), Vec<Real>::Zero(n));
    Q = keep;
  }
};

template <class Real>
LiteralTpik<Real> start(const RandomHierarchy& h, const Parameters<Real>& p = {}) {
  return {p, h.rho0.cast<Real>(), h.Q0.cast<Real>(), Vec<Real>::Zero(h.dof)};
}

/// ẏ of the whole hierarchy.
template <class Real>
Vec<Real> solve(const RandomHierarchy& h, const Parameters<Real>& p = {}) {
  auto tpik = start<Real>(h, p);
  for (const auto& level : h.levels) {
    tpik.add(level.J.cast<Real>(), level.a.cast<Real>(), level.reference.cast<Real>());
  }
  tpik.close();
  return tpik.rho;
}

}  // namespace oracle
