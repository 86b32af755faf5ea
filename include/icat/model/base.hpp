// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The motions of a base: a constant 6 × k matrix B from its columns v of ẏ to its twist [linear;
/// angular] with components on itself.
#pragma once

#include <initializer_list>

#include "icat/core/error.hpp"
#include "icat/math/spatial_algebra.hpp"

namespace icat {

/// B, see the file comment. Axes of the base: x forward, and z up or down as in ⟨0⟩.
template <class Scalar>
class Base {
 public:
  /// 6 × k, k ≤ 6.
  using Motion = Eigen::Matrix<Scalar, 6, Eigen::Dynamic, Eigen::ColMajor, 6, 6>;

  /// Bolted down: k = 0.
  Base() : motion_(detail::zeros<Motion>(6, 0)) {}
  /// Any B.
  /// @throws std::invalid_argument on another size, numbers that are not finite, or a column of
  ///         zeros.
  template <class M>
  explicit Base(const Eigen::MatrixBase<M>& motion) : motion_(6, checked(motion)) {
    for (Index j = 0; j < motion_.cols(); ++j) {
      for (Index i = 0; i < 6; ++i) motion_(i, j) = motion.derived().coeff(i, j);
    }
    if (!detail::all_finite(motion_)) detail::invalid("Base: the motion is not finite");
    for (Index j = 0; j < motion_.cols(); ++j) {
      Scalar sum(0);
      for (Index i = 0; i < 6; ++i) sum += std::abs(motion_(i, j));
      if (!(sum > Scalar(0))) detail::invalid("Base: column ", j, " of the motion is zero");
    }
  }
  /// Bolted down: k = 0.
  static Base fixed() { return Base(); }
  /// Surge, sway, heave, roll, pitch, yaw: k = 6.
  static Base free() { return unit({0, 1, 2, 3, 4, 5}); }
  /// Surge, sway, yaw, as a vessel on the surface or an omnidirectional platform: k = 3.
  static Base surface() { return unit({0, 1, 5}); }
  /// Surge, yaw, as two driven wheels: k = 2. It cannot move sideways, so a goal beside it needs a
  /// path from a planner.
  static Base differential_drive() { return unit({0, 5}); }

  /// B.
  const Motion& motion() const noexcept { return motion_; }
  /// k.
  Index columns() const noexcept { return motion_.cols(); }

 private:
  template <class M>
  static Index checked(const Eigen::MatrixBase<M>& motion) {
    if (motion.rows() != 6 || motion.cols() > 6) {
      detail::invalid("Base: the motion must be 6 x k, k <= 6, got ", motion.rows(), " x ",
                      motion.cols());
    }
    return motion.cols();
  }
  static Base unit(std::initializer_list<Index> axes) {
    Base base;
    base.motion_ = detail::zeros<Motion>(6, static_cast<Index>(axes.size()));
    Index j = 0;
    for (const Index axis : axes) base.motion_(axis, j++) = Scalar(1);
    return base;
  }

  Motion motion_;
};

}  // namespace icat
