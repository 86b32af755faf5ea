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
        side_(std::min<Index>(m_, 6)),
        eigen_(6),
        block_(zeros<Block>(6, m_)),
        y_(block_) {}

  /// μ of the columns of `J`. No allocation.
  template <class Jacobian>
  Scalar compute(const Jacobian& J) noexcept {
    for (Index j = 0; j < m_; ++j) {
      for (Index i = 0; i < 6; ++i) block_(i, j) = J(i, column(j));
    }
    fill(y_, Scalar(0));
    return solve(side_);
  }

  /// ∂μ/∂q for the joint in column `c` of `J`, after `compute`.
  template <class Jacobian>
  Scalar gradient(const Jacobian& J, Index c) const noexcept {
    const Vector3<Scalar> linear_i = column3(J, 0, c), angular_i = column3(J, 3, c);
    Scalar sum(0);
    for (Index j = 0; j < m_; ++j) {
      const Vector3<Scalar> linear_j = column3(block_, 0, j), angular_j = column3(block_, 3, j);
      const Vector3<Scalar> y_linear = column3(y_, 0, j);
      if (c <= column(j)) {
        sum += dot(angular_i, plus(cross(linear_j, y_linear), cross(angular_j, column3(y_, 3, j))));
      } else {
        sum += dot(cross(angular_j, linear_i), y_linear);
      }
    }
    return sum;
  }

 private:
  using Block = Eigen::Matrix<Scalar, 6, Eigen::Dynamic>;
  using Small = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, 6>;
  Index column(Index k) const noexcept { return columns_[static_cast<std::size_t>(k)]; }
  static Scalar dot6(const Scalar* a, const Scalar* b) noexcept {
    return (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5]);
  }

  Scalar solve(Index side) noexcept {
    // J Jᵀ, or JᵀJ for fewer than six columns: the side that has full rank.
    const bool tall = side < 6;
    const Scalar* J = block_.data();
    Small S(side, side);
    fill(S, Scalar(0));
    for (Index j = 0; j < m_; ++j) {
      for (Index b = 0; b < side; ++b) {
        if (tall) {
          S(b, j) = dot6(J + 6 * b, J + 6 * j);
          continue;
        }
        const Scalar x = J[6 * j + b];
        for (Index a = 0; a < side; ++a) S(a, b) += J[6 * j + a] * x;
      }
    }
    if (!eigen_.compute(S)) return Scalar(0);

    // σ_k from J itself: the square root of a small eigenvalue of the Gram matrix is noise.
    const auto& V = eigen_.vectors();
    Scalar sigma[6], largest(0), value(1);
    for (Index k = 0; k < side; ++k) {
      Scalar square(0);
      for (Index i = 0; i < (tall ? 6 : m_); ++i) {
        Scalar sum(0);
        for (Index l = 0; l < side; ++l) sum += (tall ? J[6 * l + i] : J[6 * i + l]) * V(l, k);
        square += sum * sum;
      }
      sigma[k] = std::sqrt(square);
      value *= sigma[k];
      largest = sigma[k] > largest ? sigma[k] : largest;
    }
    // y = μ (J^#)ᵀ = A J or J A, A = Σ_k (Π_{l≠k} σ_l / σ_k) s_k s_kᵀ over that side's vectors.
    // Below `rounding` σ_k is noise, and so would be what is divided by it.
    const Scalar rounding = Scalar(16) * std::numeric_limits<Scalar>::epsilon() * largest;
    fill(S, Scalar(0));
    for (Index k = 0; k < side; ++k) {
      if (!(sigma[k] > rounding)) continue;
      Scalar weight = Scalar(1) / sigma[k];
      for (Index l = 0; l < side; ++l) {
        if (l != k) weight *= sigma[l];
      }
      for (Index b = 0; b < side; ++b) {
        const Scalar factor = weight * V(b, k);
        for (Index a = 0; a < side; ++a) S(a, b) += factor * V(a, k);
      }
    }
    for (Index j = 0; j < m_; ++j) {
      for (Index l = 0; l < side; ++l) {
        const Scalar factor = tall ? S(l, j) : J[6 * j + l];
        const Scalar* x = tall ? J + 6 * l : S.data() + 6 * l;
        for (Index i = 0; i < 6; ++i) y_(i, j) += factor * x[i];
      }
    }
    return value;
  }

  std::vector<Index> columns_;
  Index m_, side_;
  SymmetricEigen<Scalar, 6> eigen_;
  Block block_, y_;  // the columns, and μ (J^#)ᵀ
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
    std::vector<std::string> joints = EmptyList{};
    Scalar gain{1};                     ///< γ, 1/s
    Scalar max_rate{infinity<Scalar>};  ///< in the unit of μ per second
  };

  /// `objective` in the unit of μ (m³ for a revolute arm of six joints or more), such as
  /// `at_least(0.08, 0.01)`.
  /// @throws std::invalid_argument on settings out of range, no joint that moves the frame, one of
  ///         `joints` that does not, or a mimic among those that do. Allocates.
  [[gnu::cold]] Manipulability(const R& robot, FrameId frame, const Objective<Scalar>& objective)
      : Manipulability(robot, frame, objective, Options{}) {}
  /// The same with options.
  [[gnu::cold]] Manipulability(const R& robot, FrameId frame, const Objective<Scalar>& objective,
                               Options options)
      : ScalarTask<R>(robot, options.name, objective, options.gain, options.max_rate),
        frame_(frame),
        joints_(moving(robot, frame, {}, options.name)),
        measure_(moving(robot, frame, options.joints, options.name)) {
    if constexpr (requires { robot.moved_by_mimic(frame); }) {
      if (robot.moved_by_mimic(frame)) {
        detail::invalid("task '", options.name, "': a mimic is among the joints of the frame");
      }
    }
  }

 private:
  // Columns of those of `names` that move the frame, in ascending order.
  static std::vector<Index> moving(const R& robot, FrameId frame,
                                   const std::vector<std::string>& names, const std::string& task) {
    std::vector<Index> columns;
    const auto& J = robot.jacobian(frame);
    const Columns wanted =
        names.empty() ? joint_columns(robot) : joint_columns(robot, names, "task '" + task + "'");
    for (Index k = 0; k < wanted.size(); ++k) {
      bool moves = false;
      for (Index i = 0; i < 6; ++i) moves = moves || J(i, wanted[k]) != Scalar(0);
      if (moves) {
        columns.push_back(wanted[k]);
      } else if (!names.empty()) {
        detail::invalid("task '", task, "': joint '", names[static_cast<std::size_t>(k)],
                        "' does not move the frame");
      }
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
