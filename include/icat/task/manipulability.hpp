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
/// Where a mimic is on the way, J_j is a sum over the joints that move with column j, and so is
/// ∂/∂q_i. A robot that has mimics says what each of its joints does (`for_each_joint_of`, see
/// kinematic_tree.hpp); of another the columns of the joints on the way from the base to a frame
/// must be in that order, as they are in every tree.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "icat/core/list.hpp"
#include "icat/math/spatial_algebra.hpp"
#include "icat/task/task.hpp"

namespace icat {
namespace detail {

/// μ and μ (J^#)ᵀ of a 6 × m matrix J. Construction allocates; nothing else does.
template <class ScalarType>
class ManipulabilityMeasure {
 public:
  using Scalar = ScalarType;
  explicit ManipulabilityMeasure(Index columns)
      : wide_(columns >= 6),
        rows_(wide_ ? columns : 6),
        side_(wide_ ? 6 : columns),
        q_(static_cast<std::size_t>(rows_ * side_)) {}

  /// The element of J in row `i` and column `j`, to be set before `compute`; after it, that of
  /// μ (J^#)ᵀ.
  Scalar& operator()(Index i, Index j) noexcept { return q_[place(i, j)]; }
  Scalar operator()(Index i, Index j) const noexcept { return q_[place(i, j)]; }

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
        q_.fill(Scalar(0));
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
  std::size_t place(Index i, Index j) const noexcept {
    return static_cast<std::size_t>(wide_ ? rows_ * i + j : rows_ * j + i);
  }
  // A column of Q.
  Scalar* column(Index j) noexcept { return q_.data() + rows_ * j; }
  Scalar dot(Index a, Index b) noexcept {
    const Scalar *x = column(a), *y = column(b);
    Scalar sum(0);
    for (Index i = 0; i < rows_; ++i) sum += x[i] * y[i];
    return sum;
  }
  void add(Index a, Scalar s, Index b) noexcept {
    Scalar *x = column(a), *y = column(b);
    for (Index i = 0; i < rows_; ++i) x[i] += s * y[i];
  }
  void scale(Index a, Scalar s) noexcept {
    Scalar* x = column(a);
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
  List<Scalar> q_;  // rows × side by columns: Jᵀ if it is wide, else J; then Q; then Y
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
  /// @throws std::invalid_argument on settings out of range, no joint that moves the frame, or one
  ///         of `joints` that does not. Allocates.
  [[gnu::cold]] Manipulability(const R& robot, FrameId frame, const Objective<Scalar>& objective)
      : Manipulability(robot, frame, objective, Options{}) {}
  /// The same with options.
  [[gnu::cold]] Manipulability(const R& robot, FrameId frame, const Objective<Scalar>& objective,
                               Options options)
      : ScalarTask<R>(robot, options.name, objective, options.gain, options.max_rate),
        frame_(frame),
        chosen_(moving(robot, frame, options.joints, options.name)),
        place_(static_cast<std::size_t>(robot.dof()), Index{-1}),
        measure_(static_cast<Index>(chosen_.size())) {
    // With J's first three rows divided by L, μ is μ / L³; that of fewer joints has no such power.
    if (chosen_.size() >= 6) {
      this->set_length_power(0, 1, 3);
      this->measure_reach(frame);
    }
    List<bool> joints(place_.size());
    for (const Index c : joint_columns(robot)) joints[static_cast<std::size_t>(c)] = true;
    joints_ = marked(joints);
    Index k = 0;
    for (const Index c : chosen_) place_[static_cast<std::size_t>(c)] = k++;
  }

 private:
  // Which columns, in ascending order.
  static List<Index> marked(const List<bool>& marks) {
    List<Index> columns;
    for (std::size_t c = 0; c < marks.size(); ++c) {
      if (marks[c]) columns.push_back(static_cast<Index>(c));
    }
    return columns;
  }
  // Columns of those of `names` that move the frame.
  static List<Index> moving(const R& robot, FrameId frame, const std::vector<std::string>& names,
                            const std::string& task) {
    detail::check_frame(robot, frame, task);
    List<bool> moved(static_cast<std::size_t>(robot.dof()));
    const auto& J = robot.jacobian(frame);
    const Columns wanted = names.empty() ? joint_columns(robot)
                                         : joint_columns(robot, names, detail::task_called(task));
    for (Index k = 0; k < wanted.size(); ++k) {
      bool moves = false;
      for (Index i = 0; i < 6; ++i) moves = moves || J(i, wanted[k]) != Scalar(0);
      if (moves) {
        moved[static_cast<std::size_t>(wanted[k])] = true;
      } else if (!names.empty()) {
        detail::invalid("task '", task, "': joint '", names[static_cast<std::size_t>(k)],
                        "' does not move the frame");
      }
    }
    const List<Index> columns = marked(moved);
    if (columns.size() == 0) {
      detail::invalid("task '", task, "': no joint moves the frame");
    }
    return columns;
  }

  void compute() noexcept override {
    const R& robot = this->robot();
    const auto& J = robot.jacobian(frame_);
    for (std::size_t k = 0; k < chosen_.size(); ++k) {
      for (Index i = 0; i < 6; ++i) measure_(i, static_cast<Index>(k)) = J(i, chosen_[k]);
    }
    this->set_value(measure_.compute());
    detail::fill(this->jacobian_, Scalar(0));
    // From the frame to the base. With a · (b × c) = b · (c × a) the sums over j are the same for
    // all i but for where they begin; those over j before i are all but the others.
    const Vector3<Scalar> none(Scalar(0), Scalar(0), Scalar(0));
    Vector3<Scalar> after = none, turned = none;
    const auto visit = [&](Index c, const Vector3<Scalar>& linear, const Vector3<Scalar>& angular) {
      const Index k = place_[static_cast<std::size_t>(c)];
      if (k >= 0) {
        const Vector3<Scalar> y = detail::column3(measure_, 0, k);
        after = detail::plus(after,
                             detail::plus(detail::cross(linear, y),
                                          detail::cross(angular, detail::column3(measure_, 3, k))));
        turned = detail::plus(turned, detail::cross(y, angular));
      }
      this->jacobian_(0, c) += detail::dot(angular, after) - detail::dot(linear, turned);
    };
    if constexpr (requires { robot.for_each_joint_of(frame_, visit); }) {
      robot.for_each_joint_of(frame_, visit);
    } else {
      for (std::size_t i = joints_.size(); i-- > 0;) {
        visit(joints_[i], detail::column3(J, 0, joints_[i]), detail::column3(J, 3, joints_[i]));
      }
    }
    for (const Index c : joints_) {
      this->jacobian_(0, c) += detail::dot(detail::column3(J, 0, c), turned);
    }
  }

  FrameId frame_;
  List<Index> joints_;  // columns of all joints, ascending
  List<Index> chosen_;  // those of the task
  List<Index> place_;   // of each column of ẏ among them; −1
  detail::ManipulabilityMeasure<Scalar> measure_;
};

}  // namespace task
}  // namespace icat
