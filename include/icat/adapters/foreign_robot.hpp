// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What the robots of pinocchio.hpp, kdl.hpp and mujoco.hpp share, and an adapter of your own may:
/// names of frames, joints and their limits, the base, and Jacobians that are computed when they
/// are asked for and kept until the next update. Kinematics are the foreign library's.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "icat/core/status.hpp"
#include "icat/math/rigid_motion.hpp"
#include "icat/model/base.hpp"
#include "icat/model/robot.hpp"

namespace icat {

/// Limits of a joint that its model lacks or has otherwise; what is not given stays.
template <class Scalar>
struct LimitChange {
  std::optional<Scalar> lower{};             ///< rad or m
  std::optional<Scalar> upper{};             ///< rad or m
  std::optional<Scalar> max_velocity{};      ///< rad/s or m/s
  std::optional<Scalar> max_acceleration{};  ///< rad/s² or m/s²
  std::optional<bool> continuous{};  ///< `true`: it turns without end, and has no lower and upper
};

/// A robot of another library, without its kinematics, see the file comment. An adapter derives
/// from it, adds frames and joints in its constructor, then `finish`es it. For one thread at a
/// time.
template <class ScalarType>
class ForeignRobot {
 public:
  /// Scalar type.
  using Scalar = ScalarType;
  /// Columns are counted at run time.
  static constexpr int size = Eigen::Dynamic;
  /// Of a frame, 6 × n.
  using Jacobian = Eigen::Matrix<Scalar, 6, Eigen::Dynamic>;
  /// Of a point, 3 × n.
  using PointJacobian = Eigen::Matrix<Scalar, 3, Eigen::Dynamic>;
  /// One entry for each of `joints`.
  using Positions = Vector<Scalar, Eigen::Dynamic>;

  /// n.
  Index dof() const noexcept { return dof_; }

  /// The frame called `name`.
  /// @throws std::invalid_argument with the names there are.
  [[gnu::cold]] FrameId frame(std::string_view name) const {
    return FrameId(detail::look_up(frames_, name, "frame"), name);
  }
  /// Number of frames.
  Index frame_count() const noexcept { return static_cast<Index>(frames_.size()); }
  /// As in the foreign model.
  const std::string& frame_name(FrameId frame) const noexcept { return at(frame).name; }

  /// Those that can be commanded one by one; the base is none of them.
  const std::vector<JointInfo<Scalar>>& joints() const noexcept { return joints_; }
  /// Of joint `i` of `joints`, rad or m.
  Scalar position(Index i) const noexcept { return q_(i); }
  /// Positions of all of `joints`, rad or m.
  const Positions& q() const noexcept { return q_; }
  /// Limits that the foreign model does not have, or has otherwise. For configuration, before tasks
  /// and controllers are built, since they may keep what they read.
  /// @throws std::invalid_argument on a name that is none, with those there are; on limits that are
  ///         out of order or not > 0; on a continuous joint with `lower` or `upper`.
  [[gnu::cold]] void set_limits(std::string_view joint, const LimitChange<Scalar>& change) {
    JointInfo<Scalar>& known = joints_[static_cast<std::size_t>(joint_index(*this, joint))];
    JointInfo<Scalar> info = known;
    if (change.lower || change.upper) info.continuous = false;
    if (change.continuous) {
      if (*change.continuous && (change.lower || change.upper)) {
        detail::invalid("joint '", joint, "' is to be continuous and to have an end");
      }
      info.continuous = *change.continuous;
    }
    info.lower = info.continuous ? -infinity<Scalar> : change.lower.value_or(info.lower);
    info.upper = info.continuous ? infinity<Scalar> : change.upper.value_or(info.upper);
    info.max_velocity = change.max_velocity.value_or(info.max_velocity);
    info.max_acceleration = change.max_acceleration.value_or(info.max_acceleration);
    check(info);
    known = std::move(info);
  }

  /// The frame of the base.
  FrameId base() const noexcept { return base_; }
  /// Where v stands in ẏ.
  ColumnRange base_columns() const noexcept { return base_columns_; }
  /// B, see robot.hpp.
  const typename Base<Scalar>::Motion& base_motion() const noexcept { return base_motion_; }

 protected:
  ForeignRobot() = default;

  // --- configuration

  /// Whether `name` was free; if not, nothing is added.
  [[gnu::cold]] bool add_frame(std::string name) {
    if (detail::index_of(frames_, name) >= 0) return false;
    frames_.push_back({std::move(name), {}, 0});
    return true;
  }
  /// A joint, `info.column` as well.
  /// @throws std::invalid_argument on a name that stands twice, and limits that are out of order.
  [[gnu::cold]] void add_joint(JointInfo<Scalar> info) {
    if (detail::index_of(joints_, info.name) >= 0) {
      detail::invalid("two joints are called '", info.name, "'");
    }
    check(info);
    joints_.push_back(std::move(info));
  }
  /// All joints are at 0 now. `base` has as many columns as `motion`, from `first_column` on.
  [[gnu::cold]] void finish(Index dof, FrameId base, Index first_column,
                            const Base<Scalar>& motion) {
    dof_ = dof;
    base_ = base;
    base_columns_ = {first_column, motion.columns()};
    base_motion_ = motion.motion();
    q_ = detail::zeros<Positions>(static_cast<Index>(joints_.size()));
    for (Frame& f : frames_) f.jacobian = detail::zeros<Jacobian>(6, dof);
    center_jacobian_ = detail::zeros<PointJacobian>(3, dof);
  }

  // --- control step: no allocation, no exception

  /// Whether `q` may be the positions of `joints`.
  template <class Q>
  Status check_positions(const Eigen::MatrixBase<Q>& q) const noexcept {
    if (q.size() != q_.size()) return Status::wrong_size;
    return all_finite(q) ? Status::ok : Status::non_finite;
  }
  /// Whether `pose` is a pose.
  Status check_pose(const Pose<Scalar>& pose) const noexcept {
    if (!detail::all_finite(pose.matrix())) return Status::non_finite;
    return is_rigid(pose) ? Status::ok : Status::not_a_rotation;
  }
  /// NaN and infinity fail.
  template <class Q>
  static bool all_finite(const Eigen::MatrixBase<Q>& q) noexcept {
    Scalar sum(0);
    for (Index i = 0; i < q.size(); ++i) sum += Scalar(0) * q(i);
    return sum == Scalar(0);
  }
  /// Whether two poses are the same to what measured data lose, 1e-3 (rad or m).
  static bool same_pose(const Pose<Scalar>& a, const Pose<Scalar>& b) noexcept {
    Scalar square(0);
    for (Index j = 0; j < 4; ++j) {
      for (Index i = 0; i < 3; ++i) {
        const Scalar d = a.matrix()(i, j) - b.matrix()(i, j);
        square += d * d;
      }
    }
    return square < Scalar(1e-6);
  }
  /// From now on joint `i` is at `position`; `moved` follows.
  void set_position(Index i, Scalar position) noexcept { q_(i) = position; }
  /// What was kept is of the past.
  void moved() noexcept { ++state_; }
  /// The Jacobian of `frame`, by `fill(J)` unless it is known; J is 0 before.
  template <class Fill>
  const Jacobian& kept_jacobian(FrameId frame, Fill&& fill) const noexcept {
    const Frame& f = at(frame);
    if (f.of_state != state_) {
      detail::fill(f.jacobian, Scalar(0));
      fill(f.jacobian);
      f.of_state = state_;
    }
    return f.jacobian;
  }
  /// The centre of mass and its Jacobian, by `fill(c, J)` unless they are known; both are 0 before.
  template <class Fill>
  void keep_center(Fill&& fill) const noexcept {
    if (center_of_state_ == state_) return;
    detail::fill(center_, Scalar(0));
    detail::fill(center_jacobian_, Scalar(0));
    fill(center_, center_jacobian_);
    center_of_state_ = state_;
  }
  /// As `keep_center` left it.
  const Vector3<Scalar>& kept_center() const noexcept { return center_; }
  /// As `keep_center` left it.
  const PointJacobian& kept_center_jacobian() const noexcept { return center_jacobian_; }

 private:
  struct Frame {
    std::string name;
    mutable Jacobian jacobian;
    mutable std::uint64_t of_state;
  };

  const Frame& at(FrameId frame) const noexcept {
    return frames_[static_cast<std::size_t>(frame.index())];
  }
  [[gnu::cold]] static void check(const JointInfo<Scalar>& info) {
    if (!(info.lower < info.upper)) {
      detail::invalid("joint '", info.name, "': limits must be in order, got [", info.lower, ", ",
                      info.upper, "]");
    }
    if (!(info.max_velocity > Scalar(0)) || !(info.max_acceleration > Scalar(0))) {
      detail::invalid("joint '", info.name,
                      "': limits of velocity and acceleration must be > 0, got ", info.max_velocity,
                      " and ", info.max_acceleration);
    }
  }

  Index dof_{0};
  std::vector<Frame> frames_;
  std::vector<JointInfo<Scalar>> joints_;
  Positions q_;
  FrameId base_{0};
  ColumnRange base_columns_;
  typename Base<Scalar>::Motion base_motion_;
  std::uint64_t state_{1};  // a frame that was never asked for is of state 0
  mutable std::uint64_t center_of_state_{0};
  mutable Vector3<Scalar> center_;
  mutable PointJacobian center_jacobian_;
};

}  // namespace icat
