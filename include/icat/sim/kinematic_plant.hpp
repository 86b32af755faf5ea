// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Any robot without dynamics, for simulation.
///
///     q̇ as commanded
///     τ v̇_r = v̄ − v_r                       the base tracks with a lag τ (0: at once)
///     v = v_r + ᵇR₀ w(t)                     and is carried along by a current w
///     (q, ⁰T_b) integrated exactly for velocities held over the step, the base's twist being B v
#pragma once

#include <cmath>
#include <functional>
#include <utility>

#include "icat/math/rigid_motion.hpp"
#include "icat/model/base.hpp"
#include "icat/model/robot.hpp"

namespace icat {

/// State and integration of a robot of the type `R`, see the file comment. The robot itself stays
/// where it is: `update` it with `q` and `base`.
template <JointedRobot R>
class KinematicPlant {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// One entry for each of the robot's `joints`, rad or m.
  using Positions = Vector<Scalar, Eigen::Dynamic>;
  /// ẏ, n.
  using Velocity = Vector<Scalar, R::size>;
  /// Settings, with defaults.
  struct Options {
    Positions q = Filled{0};               ///< at the start; empty: 0
    Pose<Scalar> base = IdentityPose{};    ///< its pose in ⟨0⟩ at the start
    double tracking_lag{0};                ///< τ, s
    Columns not_actuated = ColumnRange{};  ///< their q̇ or v_r stays 0
    std::function<Vector3<Scalar>(double time)> current = nullptr;  ///< w, on ⟨0⟩, m/s
  };

  /// The robot at q = 0, its base on ⟨0⟩.
  explicit KinematicPlant(const R& robot) : KinematicPlant(robot, Options{}) {}
  /// `robot` is not needed afterwards. Allocates. (`options` by value: GCC 12 deduces `R` only so.)
  /// @throws std::invalid_argument on a q of another size, a start that is not finite or no pose, a
  ///         lag below 0, columns that are not the robot's, a current where the base is not
  ///         `Base::free()`, a column of the robot that belongs neither to a joint nor to the base.
  [[gnu::cold]] KinematicPlant(const R& robot, Options options)
      : options_(std::move(options)),
        base_motion_(detail::zeros<typename Base<Scalar>::Motion>(6, 0)),
        joints_(joint_columns(robot)),
        actuated_(static_cast<std::size_t>(robot.dof()), true),
        q_(options_.q),
        base_(options_.base),
        relative_(detail::zeros<Velocity>(robot.dof())),
        velocity_(relative_) {
    if constexpr (MobileRobot<R>) take_base(robot);
    check(robot.dof());
    for (const Index i : options_.not_actuated) actuated_[static_cast<std::size_t>(i)] = false;
  }

  /// From `time` to `time + dt` (s) under the command ẏ (n), base columns with components on the
  /// base. Allocates nothing if the current does not.
  /// @throws std::invalid_argument on a command of another size.
  void step(const Velocity& command, double time, double dt) {
    if (command.size() != velocity_.size()) {
      detail::invalid("KinematicPlant: a command of ", command.size(), " columns, not ",
                      velocity_.size());
    }
    const Scalar keep = options_.tracking_lag > 0
                            ? static_cast<Scalar>(std::exp(-dt / options_.tracking_lag))
                            : Scalar(0);
    const Scalar step = static_cast<Scalar>(dt);
    for (Index i = 0; i < joints_.size(); ++i) {
      const Index c = joints_[i];
      if (actuated(c)) velocity_(c) = command(c);
      q_(i) += step * velocity_(c);
    }
    for (Index j = 0; j < columns_.count; ++j) {
      const Index c = columns_.first + j;
      if (actuated(c)) relative_(c) = command(c) + keep * (relative_(c) - command(c));
      velocity_(c) = relative_(c);
    }
    if (options_.current) {
      const Vector3<Scalar> w =
          detail::transposed_times(detail::rotation(base_), options_.current(time));
      for (Index i = 0; i < 3; ++i) velocity_(columns_.first + i) += w(i);
    }
    Vector6<Scalar> twist;
    for (Index i = 0; i < 6; ++i) {
      twist(i) = Scalar(0);
      for (Index j = 0; j < columns_.count; ++j) {
        twist(i) += base_motion_(i, j) * velocity_(columns_.first + j);
      }
    }
    if (columns_.count > 0) base_ = integrate(base_, twist, step);
  }

  /// Positions of the robot's `joints`, rad or m; what turns without end is not wrapped.
  const Positions& q() const noexcept { return q_; }
  /// The base's pose in ⟨0⟩.
  const Pose<Scalar>& base() const noexcept { return base_; }
  /// ẏ over the last step, n; base columns with respect to ⟨0⟩, components on the base: what a DVL
  /// and gyros measure, or wheels that do not slip.
  const Velocity& velocity() const noexcept { return velocity_; }

 private:
  bool actuated(Index column) const noexcept { return actuated_[static_cast<std::size_t>(column)]; }

  [[gnu::cold]] void take_base(const R& robot) {
    columns_ = robot.base_columns();
    const auto& B = robot.base_motion();
    base_motion_ = detail::zeros<typename Base<Scalar>::Motion>(6, columns_.count);
    for (Index j = 0; j < columns_.count; ++j) {
      for (Index i = 0; i < 6; ++i) base_motion_(i, j) = B(i, j);
    }
  }

  [[gnu::cold]] void check(Index n) {
    if (q_.size() == 0) q_ = detail::zeros<Positions>(joints_.size());
    if (q_.size() != joints_.size()) {
      detail::invalid("KinematicPlant: q has ", q_.size(), " entries for ", joints_.size(),
                      " joints");
    }
    if (!detail::all_finite(q_)) detail::invalid("KinematicPlant: q is not finite");
    if (!is_rigid(base_)) {
      detail::invalid("KinematicPlant: the base's pose is not finite or not a rotation");
    }
    if (!(options_.tracking_lag >= 0)) {
      detail::invalid("KinematicPlant: tracking_lag must be >= 0, got ", options_.tracking_lag);
    }
    detail::check_columns("KinematicPlant", options_.not_actuated, n);
    bool free = columns_.count == 6;
    for (Index j = 0; j < columns_.count; ++j) {
      for (Index i = 0; i < 6; ++i) free = free && base_motion_(i, j) == Scalar(i == j ? 1 : 0);
    }
    if (options_.current && !free) {
      detail::invalid("KinematicPlant: a current carries a free base only: surge, sway, heave, ",
                      "roll, pitch, yaw");
    }
    List<bool> moved(static_cast<std::size_t>(n));
    for (const Index c : joints_) moved[static_cast<std::size_t>(c)] = true;
    for (Index j = 0; j < columns_.count; ++j) {
      moved[static_cast<std::size_t>(columns_.first + j)] = true;
    }
    for (Index c = 0; c < n; ++c) {
      if (!moved[static_cast<std::size_t>(c)]) {
        detail::invalid("KinematicPlant: column ", c, " is neither a joint's nor the base's");
      }
    }
  }

  Options options_;
  ColumnRange columns_;  // of the base
  typename Base<Scalar>::Motion base_motion_;
  Columns joints_;
  List<bool> actuated_;
  Positions q_;
  Pose<Scalar> base_;
  Velocity relative_, velocity_;
};

}  // namespace icat
