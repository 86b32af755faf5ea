// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Whether an estimator's covariance is that of its errors.
///
/// An error e of dimension n with the covariance P has eᵀ P⁻¹ e of χ² with n degrees of freedom
/// (NEES for the state, NIS for an innovation). The sum over N independent ones has N n of them;
/// its 95 % band is by Wilson and Hilferty's cube root, right to 1e-4 from 100 degrees on.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <icat/navigation/kalman.hpp>

namespace support {

/// z = ±1.96: 2.5 % on each side.
inline double chi_square_quantile(double degrees, double z) {
  const double s = 2 / (9 * degrees), root = 1 - s + z * std::sqrt(s);
  return degrees * root * root * root;
}
inline bool in_chi_square_band(double sum, double degrees) {
  return sum > chi_square_quantile(degrees, -1.96) && sum < chi_square_quantile(degrees, 1.96);
}

/// eᵀ P⁻¹ e
template <int N>
double normalized_square(const icat::detail::Square<double, N>& P,
                         const icat::Vector<double, N>& e) {
  icat::detail::Square<double, N> W;
  return icat::detail::invert<double, N>(P, W) ? icat::detail::quadratic_form<double, N>(W, e)
                                               : HUGE_VAL;
}

/// Sums over runs at twenty instants, and over all of the innovations.
class Consistency {
 public:
  static constexpr int instants = 20;

  void state(int instant, double nees, int dimension) {
    nees_[static_cast<std::size_t>(instant)] += nees;
    degrees_[static_cast<std::size_t>(instant)] += dimension;
  }
  void innovation(double nis, int dimension) {
    nis_ += nis;
    nis_degrees_ += dimension;
  }

  /// Of twenty independent sums one is outside its band; more than four are in one test of 400.
  void expect(const char* what) const {
    int outside = 0;
    double all = 0, degrees = 0;
    for (std::size_t i = 0; i < instants; ++i) {
      ASSERT_GT(degrees_[i], 0);
      if (!in_chi_square_band(nees_[i], degrees_[i])) ++outside;
      all += nees_[i];
      degrees += degrees_[i];
    }
    std::printf("%s: NEES %.3f of 1, %d of %d instants outside; NIS %.4f of 1 in [%.4f, %.4f]\n",
                what, all / degrees, outside, instants, nis_ / nis_degrees_,
                chi_square_quantile(nis_degrees_, -1.96) / nis_degrees_,
                chi_square_quantile(nis_degrees_, 1.96) / nis_degrees_);
    EXPECT_LE(outside, 4) << what;
    EXPECT_TRUE(in_chi_square_band(nis_, nis_degrees_)) << what;
  }

 private:
  std::array<double, instants> nees_{}, degrees_{};
  double nis_{0}, nis_degrees_{0};
};

}  // namespace support
