// SPDX-License-Identifier: BSD-3-Clause
#include "oracle.hpp"

#include <Eigen/SVD>
#include <cmath>
#include <numbers>

namespace oracle {

template <class Real>
Mat<Real> pseudo_inverse(const Mat<Real>& X, const Vec<Real>& a, const Mat<Real>& Q,
                         const Parameters<Real>& p) {
  const Eigen::Index n = X.cols();
  const Mat<Real> I = Mat<Real>::Identity(n, n);
  const Mat<Real> A = a.asDiagonal();
  const Mat<Real> M = X.transpose() * A * X + p.eta * (I - Q).transpose() * (I - Q);
  // M is square: no QR before the rotations, which would take half of the time to compile.
  Eigen::JacobiSVD<Mat<Real>, Eigen::NoQRPreconditioner> svd(
      M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Vec<Real> inverse(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Real s = svd.singularValues()(i);
    const Real h = s < p.threshold
                       ? p.lambda / 2 * (1 + std::cos(std::numbers::pi_v<Real> * s / p.threshold))
                       : Real(0);
    if (p.form == Form::bell) {
      inverse(i) = s + h == Real(0) ? Real(0) : 1 / (s + h);
    } else {
      inverse(i) = s == Real(0) ? Real(0) : s / (s * s + h);
    }
  }
  // M is symmetric PSD, so V diag V^T and V diag U^T differ by rounding only.
  return svd.matrixV() * inverse.asDiagonal() * svd.matrixV().transpose() * X.transpose() * A * A;
}

template Mat<float> pseudo_inverse(const Mat<float>&, const Vec<float>&, const Mat<float>&,
                                   const Parameters<float>&);
template Mat<double> pseudo_inverse(const Mat<double>&, const Vec<double>&, const Mat<double>&,
                                    const Parameters<double>&);
template Mat<long double> pseudo_inverse(const Mat<long double>&, const Vec<long double>&,
                                         const Mat<long double>&, const Parameters<long double>&);

}  // namespace oracle
