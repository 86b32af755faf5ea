// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Memory for kernels that work on panels.
#pragma once

#include <icat/math/panel.hpp>
#include <vector>

/// Room for 20 n columns of n rows.
template <class S>
class Panels {
 public:
  explicit Panels(Eigen::Index n)
      : next(nullptr, n),
        rows_(icat::detail::padded<S>(n)),
        memory_(static_cast<std::size_t>(20 * n * rows_)) {
    next = icat::detail::PanelMemory<S>(memory_.data(), n);
  }
  icat::detail::Panel<S> take(Eigen::Index columns) { return next.take(columns); }

  static Eigen::MatrixXd block(icat::detail::Panel<S> p, Eigen::Index rows, Eigen::Index columns) {
    Eigen::MatrixXd m(rows, columns);
    for (Eigen::Index j = 0; j < columns; ++j) {
      for (Eigen::Index i = 0; i < rows; ++i) m(i, j) = static_cast<double>(p(i, j));
    }
    return m;
  }
  static void set(icat::detail::Panel<S> p, const Eigen::MatrixXd& m) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) {
      for (Eigen::Index i = 0; i < m.rows(); ++i) p(i, j) = static_cast<S>(m(i, j));
      icat::detail::fill_up(m.rows(), p[j]);
    }
  }

  icat::detail::PanelMemory<S> next;

 private:
  Eigen::Index rows_;
  std::vector<S> memory_;
};
