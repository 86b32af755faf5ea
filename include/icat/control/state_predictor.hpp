// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Extrapolates a late state by the commands given since it was measured.
///
/// A feedback of gain g on a state that is τ seconds old is unstable for g τ > π/2 and oscillates
/// for g τ > 1/e; near a joint limit g is the speed divided by the margin, some 10 to 30 1/s, so 50
/// ms are too long. The extrapolated state has no delay, if the robot follows its commands: only
/// the period limits the loop's gain. The delay may be wrong by some 20 % (docs/safety.md).
///
///     q(t) = q(t − τ) + ∫ q̇ dt,     ⁰T_b(t) = ⁰T_b(t − τ) Π exp(B v dt)
#pragma once

#include <cmath>

#include "icat/control/command_history.hpp"
#include "icat/core/step_clock.hpp"
#include "icat/math/rigid_motion.hpp"
#include "icat/model/robot.hpp"

namespace icat {

/// Settings of a `StatePredictor`.
struct PredictorOptions {
  double delay{0};       ///< age of the state that arrives, s, in [0, 10]
  double max_step{0.1};  ///< longest step, s, > 0; see StepClock
};

/// See the file comment. Construction allocates and throws; nothing else does.
template <JointedRobot R>
class StatePredictor {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// ẏ, n.
  using Velocity = Vector<Scalar, R::size>;
  /// One entry for each of `robot.joints()`, rad or m.
  using Positions = Vector<Scalar, Eigen::Dynamic>;
  /// Joints and base.
  struct State {
    Positions q;                              ///< of the joints
    Pose<Scalar> base_pose = IdentityPose{};  ///< ⟨b⟩ in ⟨0⟩
  };

  /// @throws std::invalid_argument on settings out of range.
  [[gnu::cold]] StatePredictor(const R& robot, PredictorOptions options)
      : delay_(checked(options.delay)),
        clock_(options.max_step),
        history_(robot.dof(), options.delay),
        command_(detail::zeros<Velocity>(robot.dof())) {
    for (const auto& joint : robot.joints()) columns_.push_back(joint.column);
    state_.q = detail::zeros<Positions>(static_cast<Index>(columns_.size()));
    if constexpr (MobileRobot<R>) {
      const ColumnRange base = robot.base_columns();
      base_first_ = base.first;
      motion_ = detail::zeros<JacobianMatrix<Scalar>>(6, base.count);
      for (Index j = 0; j < base.count; ++j) {
        for (Index i = 0; i < 6; ++i) motion_(i, j) = robot.base_motion()(i, j);
      }
    }
  }

  /// The positions at `time`, s, of which `q` (one entry a joint) arrives now and is `delay` old. A
  /// `q` of another size is returned as it was predicted last; numbers that are not finite pass.
  template <class Q>
  const Positions& predict(const Eigen::MatrixBase<Q>& q, double time) noexcept {
    advance(time);
    if (q.size() != state_.q.size()) return state_.q;
    for (Index i = 0; i < q.size(); ++i) state_.q(i) = q(i);
    history_.from_newest(delay_, [this](const double* velocity, double duration) {
      for (Index i = 0; i < state_.q.size(); ++i) {
        const Index column = columns_[static_cast<std::size_t>(i)];
        state_.q(i) += static_cast<Scalar>(velocity[column] * duration);
      }
    });
    return state_.q;
  }
  /// The same with the base's pose.
  template <class Q>
  const State& predict(const Eigen::MatrixBase<Q>& q, const Pose<Scalar>& base_pose,
                       double time) noexcept requires MobileRobot<R> {
    (void)predict(q, time);
    auto moved = detail::identity_pose<Scalar>();
    history_.from_newest(delay_, [&](const double* velocity, double duration) {
      auto twist = detail::zeros<Vector6<Scalar>>(6);
      for (Index j = 0; j < motion_.cols(); ++j) {
        for (Index i = 0; i < 6; ++i) {
          twist(i) += motion_(i, j) * static_cast<Scalar>(velocity[base_first_ + j]);
        }
      }
      moved = detail::compose(
          integrate(detail::identity_pose<Scalar>(), twist, static_cast<Scalar>(duration)), moved);
    });
    state_.base_pose = detail::compose(base_pose, moved);
    return state_;
  }
  /// `velocity` (n) is commanded from `time` on, s; columns that are given move as measured. What
  /// is not finite is refused.
  Status command(const Velocity& velocity, double time) noexcept {
    if (velocity.size() != command_.size()) return Status::wrong_size;
    if (!detail::all_finite(velocity) || !std::isfinite(time)) return Status::non_finite;
    advance(time);
    for (Index c = 0; c < command_.size(); ++c) command_(c) = velocity(c);
    return Status::ok;
  }

 private:
  static double checked(double delay) {
    if (!(delay >= 0 && delay <= 10)) {
      detail::invalid("StatePredictor: delay must be in [0, 10] s, got ", delay);
    }
    return delay;
  }
  void advance(double time) noexcept {
    if (clock_.advance(time) == Status::ok) history_.push(command_, clock_.step());
  }

  double delay_;
  StepClock clock_;
  detail::CommandHistory history_;
  Velocity command_;
  State state_;
  List<Index> columns_;
  Index base_first_{0};
  JacobianMatrix<Scalar> motion_;
};

}  // namespace icat
