// SPDX-License-Identifier: BSD-3-Clause
// The least program that solves a hierarchy; scripts/compile_cost.sh measures what it costs to
// compile.
#include <icat/tpik/tpik.hpp>

int main() {
  icat::Tpik<double, 13> tpik;
  tpik.reset();
  const Eigen::Matrix<double, 3, 13> jacobian = Eigen::Matrix<double, 3, 13>::Ones();
  const Eigen::Vector3d activation(1, 1, 1), reference(1, 1, 1);
  icat::Status status = tpik.add_level(jacobian, activation, reference);
  const icat::Status closing = tpik.minimize_velocity();
  if (status == icat::Status::ok) status = closing;
  return status == icat::Status::ok ? 0 : 1;
}
