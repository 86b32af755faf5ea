// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Manipulability of a frame by some joints, with its gradient:
///
///     μ = √det(J Jᵀ) = Π σ_k,  J = Σ σ_k u_k v_kᵀ the columns of those joints  [MARIS, Eq. (14)]
///     ∂μ/∂q_i = Σ_j y_jᵀ ∂J_j/∂q_i,  Y = μ (J^#)ᵀ
///     ∂J_j/∂q_i = [ω_i × v_j; ω_i × ω_j] for i at or before j on the way to the frame,
///                 [ω_j × v_i; 0] after it
///
/// The second line is μ tr(∂J/∂q_i J^#). For fewer than six joints μ = √det(JᵀJ). With the
/// orthogonal Q and the triangular R of Jᵀ, or of J for fewer than six joints, μ = Π |r_kk| and
/// Y = μ Q R⁻ᵀ (transposed or not): both are as exact as J is, also near a singular arm. μ has a
/// kink there, where the gradient is 0, the mean of both sides.
///
/// On the way from the base to a frame the columns of joints must be in that order, as they are in
/// every tree of this library and of the adapters, and none may be moved by a mimic.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "icat/math/spatial_algebra.hpp"
#include "icat/task/task.hpp"

namespace icat {
namespace detail {

/// μ and μ (J^#)ᵀ of a 6 × m matrix J. Construction allocates; nothing else does.
template <class Scalar>
class ManipulabilityMeasure {
 public:
  explicit ManipulabilityMeasure(Index columns)
      : wide_(columns >= 6),
        rows_(wide_ ? columns : 6),
        side_(wide_ ? 6 : columns),
        q_(static_cast<std::size_t>(rows_ * side_)) {}

  /// The element of J in row `i` and column `j`, to be set before `compute`; after it, that of
  /// μ (J^#)ᵀ.
  Scalar& operator()(Index i, Index j) noexcept { return wide_ ? at(j, i) : at(i, j); }

  /// μ; where J has not full rank as far as rounding can tell, all is 0.
  Scalar compute() noexcept {
    // Gram–Schmidt with column pivoting; each column once more, for what rounding left of the
    // others in it.
    const Scalar rounding = Scalar(16) * std::numeric_limits<Scalar>::epsilon();
    Scalar R[6][6], value(1);
    Index order[6] = {0, 1, 2, 3, 4, 5};
    for (Index k = 0; k < side_; ++k) {
      Scalar largest(-1);
      Index pivot = k;
      for (Index c = k; c < side_; ++c) {
        const Scalar square = dot(order[c], order[c]);
        if (square > largest) {
          largest = square;
          pivot = c;
        }
      }
      std::swap(order[k], order[pivot]);
      for (Index j = 0; j < k; ++j) std::swap(R[j][k], R[j][pivot]);
      for (Index j = 0; j < k; ++j) R[j][k] += take_out(order[j], order[k]);
      R[k][k] = std::sqrt(dot(order[k], order[k]));
      if (!(R[k][k] > rounding * R[0][0])) {
        std::fill(q_.begin(), q_.end(), Scalar(0));
        return Scalar(0);
      }
      value *= R[k][k];
      scale(order[k], Scalar(1) / R[k][k]);
      for (Index c = k + 1; c < side_; ++c) R[k][c] = take_out(order[k], order[c]);
    }
    // Y Rᵀ = μ Q, from the last column on.
    for (Index k = side_; k-- > 0;) {
      scale(order[k], value);
      for (Index c = k + 1; c < side_; ++c) add(order[k], -R[k][c], order[c]);
      scale(order[k], Scalar(1) / R[k][k]);
    }
    return value;
  }

 private:
  Scalar& at(Index i, Index j) noexcept { return q_[static_cast<std::size_t>(rows_ * j + i)]; }
  Scalar dot(Index a, Index b) noexcept {
    const Scalar *x = &at(0, a), *y = &at(0, b);
    Scalar sum(0);
    for (Index i = 0; i < rows_; ++i) sum += x[i] * y[i];
    return sum;
  }
  void add(Index a, Scalar s, Index b) noexcept {
    Scalar *x = &at(0, a), *y = &at(0, b);
    for (Index i = 0; i < rows_; ++i) x[i] += s * y[i];
  }
  void scale(Index a, Scalar s) noexcept {
    Scalar* x = &at(0, a);
    for (Index i = 0; i < rows_; ++i) x[i] *= s;
  }
  // Takes the part along the unit vector a out of b; how much it was.
  Scalar take_out(Index a, Index b) noexcept {
    const Scalar part = dot(a, b);
    add(b, -part, a);
    return part;
  }

  bool wide_;
  Index rows_, side_;
  std::vector<Scalar> q_;  // rows × side by columns: Jᵀ if it is wide, else J; then Q; then Y
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
        chosen_(moving(robot, frame, options.joints, options.name)),
        measure_(static_cast<Index>(chosen_.size())) {
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
    Index k = 0;
    for (const Index c : chosen_) {
      for (Index i = 0; i < 6; ++i) measure_(i, k) = J(i, c);
      ++k;
    }
    this->set_value(measure_.compute());
    // With a · (b × c) = b · (c × a) the sums over j > i, and over j < i, are sums over j that grow
    // from joint to joint.
    const Vector3<Scalar> none(Scalar(0), Scalar(0), Scalar(0));
    Vector3<Scalar> before = none, after = none;
    k = 0;
    for (const Index c : joints_) {
      this->jacobian_(0, c) = detail::dot(detail::column3(J, 0, c), before);
      if (!is_chosen(k, c)) continue;
      before = detail::plus(before, detail::cross(y(0, k), detail::column3(J, 3, c)));
      ++k;
    }
    for (std::size_t i = joints_.size(); i-- > 0;) {
      const Index c = joints_[i];
      const Vector3<Scalar> linear = detail::column3(J, 0, c), angular = detail::column3(J, 3, c);
      if (is_chosen(k - 1, c)) {
        --k;
        after = detail::plus(
            after, detail::plus(detail::cross(linear, y(0, k)), detail::cross(angular, y(3, k))));
      }
      this->jacobian_(0, c) += detail::dot(angular, after);
    }
  }
  bool is_chosen(Index k, Index column) const noexcept {
    return k >= 0 && k < static_cast<Index>(chosen_.size()) &&
           chosen_[static_cast<std::size_t>(k)] == column;
  }
  // Three rows of column `k` of μ (J^#)ᵀ.
  Vector3<Scalar> y(Index row, Index k) noexcept {
    return {measure_(row, k), measure_(row + 1, k), measure_(row + 2, k)};
  }

  FrameId frame_;
  std::vector<Index> joints_, chosen_;  // columns of all joints that move the frame; of the task's
  detail::ManipulabilityMeasure<Scalar> measure_;
};

}  // namespace task
}  // namespace icat
