// SPDX-License-Identifier: BSD-3-Clause
#include "solver.hpp"

#include <icat/tpik/tpik.hpp>

bool solve(int rows, int dof, const double* jacobian, const double* rate,
           double* velocity) noexcept {
  icat::Tpik<double> tpik(dof);
  tpik.reset();
  const Eigen::VectorXd activation = Eigen::VectorXd::Ones(rows);
  const bool solved =
      tpik.add_level(Eigen::Map<const Eigen::MatrixXd>(jacobian, rows, dof), activation,
                     Eigen::Map<const Eigen::VectorXd>(rate, rows)) == icat::Status::ok &&
      tpik.minimize_velocity() == icat::Status::ok;
  Eigen::Map<Eigen::VectorXd>(velocity, dof) = tpik.velocity();
  return solved;
}
