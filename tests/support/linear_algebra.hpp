// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Decompositions for tests, compiled once: each costs some seconds in every file that asks Eigen.
#pragma once

#include <Eigen/Core>

namespace testing_support {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Q of a = Q R, square.
MatrixXd orthogonal(const MatrixXd& a);
/// Singular values, the largest first.
VectorXd singular_values(const MatrixXd& a);
/// The Moore-Penrose inverse; singular values up to `relative` times the largest, or up to
/// `absolute`, count as zero.
MatrixXd pseudo_inverse(const MatrixXd& a, double relative, double absolute = 0);
/// Of the symmetric a, the smallest first.
VectorXd symmetric_eigenvalues(const MatrixXd& a);
MatrixXd inverse(const MatrixXd& a);
double determinant(const MatrixXd& a);
/// x with a x = b, a square.
VectorXd solve(const MatrixXd& a, const VectorXd& b);
/// By elimination with complete pivoting.
Eigen::Index rank(const MatrixXd& a);

}  // namespace testing_support
