// SPDX-License-Identifier: BSD-3-Clause
// Eigen alone, a product that needs memory from the heap: is a set of flags sound at all?
#include <Eigen/Core>
#include <cstdio>

int main() {
  for (const int n : {50, 200, 400}) {
    const Eigen::MatrixXd a = Eigen::MatrixXd::Constant(n, n, 0.5), b = 2 * a;
    if ((a * b)(n - 1, n - 1) != 0.5 * n) return 1;
  }
  std::puts("products are right");
}
