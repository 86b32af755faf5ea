// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Manipulability of a frame by some joints, with its gradient:
///
///     μ = √det(J Jᵀ) = Π σ_k,  J = Σ σ_k u_k v_kᵀ the columns of those joints  [MARIS, Eq. (14)]
///     ∂μ/∂q_i = Σ_k (Π_{l≠k} σ_l) u_kᵀ (∂J/∂q_i) v_k
///     ∂J_j/∂q_i = [ω_i × v_j; ω_i × ω_j] for i at or before j on the way to the frame,
///                 [ω_j × v_i; 0] after it
///
/// The second line equals μ tr(∂J/∂q_i J^#) without its 0 · ∞ at a singular arm. For fewer than six
/// joints μ = √det(JᵀJ). μ has a kink at a singular arm; the gradient leaves out the part of a
/// vanished σ_k, which is the mean of both sides.
///
/// On the way from the base to a frame the columns of joints must be in that order, as they are in
/// every tree of this library and of the adapters, and none may be moved by a mimic.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "icat/math/spatial_algebra.hpp"
#include "icat/math/symmetric_eigen.hpp"
#include "icat/task/task.hpp"

namespace icat {
namespace detail {

/// μ and ∂μ/∂q of a 6 × m block of the frame's Jacobian.
template <class Scalar>
class ManipulabilityMeasure {
 public:
  explicit ManipulabilityMeasure(const std::vector<Index>& columns)
      : columns_(columns),
        m_(static_cast<Index>(columns.size())),
        eigen_(6),
        long_side_(zeros<Matrix>(std::max<Index>(m_, 6), std::min<Index>(m_, 6))),
        y_(zeros<Matrix>(6, m_)) {}

  /// μ of the columns of `J`. No allocation.
  template <class Jacobian>
  Scalar compute(const Jacobian& J) noexcept {
    // Element (i, k) of J for six rows, of Jᵀ for fewer than six columns: the side that has full
    // rank.
    const bool tall = m_ < 6;
    const Index side = tall ? m_ : 6, other = tall ? 6 : m_;
    const auto at = [&](Index i, Index k) { return tall ? J(k, column(i)) : J(i, column(k)); };
    Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, 6> gram(side, side);
    for (Index i = 0; i < side; ++i) {
      for (Index j = 0; j <= i; ++j) {
        Scalar sum(0);
        for (Index k = 0; k < other; ++k) sum += at(i, k) * at(j, k);
        gram(i, j) = gram(j, i) = sum;
      }
    }
    fill(y_, Scalar(0));
    if (!eigen_.compute(gram)) return Scalar(0);

    // σ_k from J itself: the square root of a small eigenvalue of the Gram matrix is noise.
    // Singular vectors of the short side, and σ_k times those of the long one.
    const auto& short_side = eigen_.vectors();
    Scalar sigma[6], largest(0), value(1);
    for (Index k = 0; k < side; ++k) {
      Scalar square(0);
      for (Index i = 0; i < other; ++i) {
        Scalar sum(0);
        for (Index l = 0; l < side; ++l) sum += at(l, i) * short_side(l, k);
        long_side_(i, k) = sum;
        square += sum * sum;
      }
      sigma[k] = std::sqrt(square);
      value *= sigma[k];
      largest = sigma[k] > largest ? sigma[k] : largest;
    }
    // Below this σ_k is rounding, and so would be the direction divided by it.
    const Scalar rounding = Scalar(16) * std::numeric_limits<Scalar>::epsilon() * largest;
    for (Index k = 0; k < side; ++k) {
      if (!(sigma[k] > rounding)) continue;
      Scalar others(1);
      for (Index l = 0; l < side; ++l) {
        if (l != k) others *= sigma[l];
      }
      const Scalar weight = others / sigma[k];
      for (Index j = 0; j < m_; ++j) {
        for (Index i = 0; i < 6; ++i) {
          y_(i, j) += weight * (tall ? long_side_(i, k) * short_side(j, k)
                                     : short_side(i, k) * long_side_(j, k));
        }
      }
    }
    return value;
  }

  /// ∂μ/∂q for the joint in column `c` of `J`, after `compute`.
  template <class Jacobian>
  Scalar gradient(const Jacobian& J, Index c) const noexcept {
    const Vector3<Scalar> linear_i = column3(J, 0, c), angular_i = column3(J, 3, c);
    Scalar sum(0);
    for (Index j = 0; j < m_; ++j) {
      const Vector3<Scalar> linear_j = column3(J, 0, column(j)),
                            angular_j = column3(J, 3, column(j));
      const Vector3<Scalar> y_linear = column3(y_, 0, j);
      if (c <= column(j)) {
        sum += dot(cross(angular_i, linear_j), y_linear) +
               dot(cross(angular_i, angular_j), column3(y_, 3, j));
      } else {
        sum += dot(cross(angular_j, linear_i), y_linear);
      }
    }
    return sum;
  }

 private:
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  Index column(Index k) const noexcept { return columns_[static_cast<std::size_t>(k)]; }

  std::vector<Index> columns_;
  Index m_;
  SymmetricEigen<Scalar, 6> eigen_;
  Matrix long_side_, y_;  // y: μ (J^#)ᵀ
};

}  // namespace detail

namespace task {

/// μ ≥ μ_m, or another objective [Coop, Eq. (11)], [MARIS, Eq. (14)–(18)].
template <FramedRobot R>
requires JointedRobot<R>
class Manipulability : public ScalarTask<R> {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// Settings, with defaults.
  struct Options {
    std::string name = "manipulability";  ///< in errors and logs
    /// By name; none: all that move the frame.
    std::vector<std::string> joints = std::initializer_list<std::string>{};
    Scalar gain{1};                     ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};  ///< in the unit of μ per second
  };

  /// `objective` in the unit of μ (m³ for a revolute arm of six joints or more), such as
  /// `at_least(0.08, 0.01)`.
  /// @throws std::invalid_argument on settings out of range, or no joint that moves the frame.
  ///         Allocates.
  Manipulability(const R& robot, FrameId frame, const Objective<Scalar>& objective)
      : Manipulability(robot, frame, objective, Options{}) {}
  /// The same with options.
  Manipulability(const R& robot, FrameId frame, const Objective<Scalar>& objective, Options options)
      : ScalarTask<R>(robot, options.name, objective, options.gain, options.max_rate),
        frame_(frame),
        joints_(moving(robot, frame, {}, options.name)),
        measure_(moving(robot, frame, options.joints, options.name)) {}

 private:
  // Columns of those of `names` that move the frame, in ascending order.
  static std::vector<Index> moving(const R& robot, FrameId frame,
                                   const std::vector<std::string>& names, const std::string& task) {
    std::vector<Index> columns;
    const auto& J = robot.jacobian(frame);
    for (const Index c : joint_columns(robot, names, "task '" + task + "'")) {
      bool moves = false;
      for (Index i = 0; i < 6; ++i) moves = moves || J(i, c) != Scalar(0);
      if (moves) columns.push_back(c);
    }
    if (columns.empty()) detail::invalid("task '", task, "': no joint moves the frame");
    std::sort(columns.begin(), columns.end());
    return columns;
  }

  void compute() noexcept override {
    const auto& J = this->robot().jacobian(frame_);
    const Scalar value = measure_.compute(J);
    for (const Index c : joints_) this->jacobian_(0, c) = measure_.gradient(J, c);
    this->set_value(value);
  }

  FrameId frame_;
  std::vector<Index> joints_;  // columns of all joints that move the frame
  detail::ManipulabilityMeasure<Scalar> measure_;
};

}  // namespace task
}  // namespace icat
