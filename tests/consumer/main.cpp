// SPDX-License-Identifier: BSD-3-Clause
// One priority level, solved by a program that knows nothing but the target icat::icat.
#include <cmath>
#include <icat/icat.hpp>
#include <iostream>

int main() {
  const Eigen::Matrix<double, 1, 3> jacobian(1.0, 0.0, 0.0);
  const Eigen::Matrix<double, 1, 1> activation(1.0);
  const Eigen::Matrix<double, 1, 1> reference(1.0);

  icat::Tpik<double, 3> tpik;
  tpik.reset();
  const bool solved = tpik.add_level(jacobian, activation, reference) == icat::Status::ok &&
                      tpik.minimize_velocity() == icat::Status::ok;
  const Eigen::Vector3d velocity = tpik.velocity();

  std::cout << "icat " << ICAT_VERSION_STRING << ": " << velocity.transpose() << '\n';
  return solved && (velocity - Eigen::Vector3d::UnitX()).norm() < 1e-9 ? 0 : 1;
}
