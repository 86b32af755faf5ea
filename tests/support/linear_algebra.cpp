// SPDX-License-Identifier: BSD-3-Clause
#include "linear_algebra.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace testing_support {

MatrixXd orthogonal(const MatrixXd& a) { return Eigen::HouseholderQR<MatrixXd>(a).householderQ(); }

VectorXd singular_values(const MatrixXd& a) {
  return Eigen::JacobiSVD<MatrixXd>(a).singularValues();
}

MatrixXd pseudo_inverse(const MatrixXd& a, double relative, double absolute) {
  const Eigen::JacobiSVD<MatrixXd> svd(a, Eigen::ComputeThinU | Eigen::ComputeThinV);
  VectorXd inverse = svd.singularValues();
  const double smallest = std::max(relative * inverse(0), absolute);
  for (double& s : inverse) s = s > smallest ? 1 / s : 0;
  return svd.matrixV() * inverse.asDiagonal() * svd.matrixU().transpose();
}

VectorXd symmetric_eigenvalues(const MatrixXd& a) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

MatrixXd inverse(const MatrixXd& a) { return a.inverse(); }
double determinant(const MatrixXd& a) { return a.determinant(); }
VectorXd solve(const MatrixXd& a, const VectorXd& b) { return a.partialPivLu().solve(b); }
Eigen::Index rank(const MatrixXd& a) { return a.fullPivLu().rank(); }

}  // namespace testing_support
