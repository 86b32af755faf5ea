// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The kinematic layer: runs actions on a robot and yields vehicle and joint velocities.
///
/// **Whole body**: one TPIK over ẏ = [q̇; v̄]. What the vehicle cannot actuate enters with its
/// measured velocity [Coop, Eq. (31)].
///
/// **Parallel** [MARIS, III-B9], [Coop, III-G]: TPIK 1 is the whole-body one, of which only v̄ is
/// kept; TPIK 2 takes all six vehicle velocities as measured, and only its q̇ is kept: the arm makes
/// up for what the vehicle does not track. Each may run at its own rate. For an arm loop that is
/// faster than any solver TPIK 2 also comes as a law in the vehicle's velocity [Coop, Eq. (24)].
#pragma once

#include <array>
#include <limits>
#include <string_view>
#include <vector>

#include "icat/action/transition.hpp"
#include "icat/action/unified_hierarchy.hpp"
#include "icat/math/spatial_algebra.hpp"
#include "icat/tpik/parametric_tpik.hpp"
#include "icat/tpik/tpik.hpp"

namespace icat {

/// How the two subsystems are coordinated, see the file comment.
enum class Scheme { whole_body, parallel };

/// Controls a robot whose state the caller keeps up to date before each step. The robot, the tasks
/// and this object belong to one thread. After construction nothing allocates or throws.
template <VehicleManipulator R, class Regularization = BellRegularization<typename R::Scalar>>
class Controller {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// The solver of both TPIKs.
  using Solver = Tpik<Scalar, R::size, Regularization>;
  /// ẏ, n.
  using Velocity = typename Solver::VectorN;
  /// Joints at compile time.
  static constexpr int arm_size = R::size == Eigen::Dynamic ? Eigen::Dynamic : R::size - 6;
  /// q̇, l.
  using JointVelocity = Vector<Scalar, arm_size>;

  /// One level of the hierarchy as the solver gets it, phase activations included.
  struct Level {
    JacobianMatrix<Scalar, R::size> jacobian;   ///< rows × n
    Vector<Scalar, Eigen::Dynamic> activation;  ///< rows, in [0, 1]
    Vector<Scalar, Eigen::Dynamic> reference;   ///< rows
  };

  /// Settings, with defaults.
  struct Options {
    /// Used by `step`.
    Scheme scheme{Scheme::whole_body};
    /// Which of surge, sway, heave, roll, pitch, yaw the vehicle can command.
    std::array<bool, 6> actuated{true, true, true, true, true, true};
    /// Options of both TPIKs.
    typename Solver::Options solver{};
  };

  /// Computes the unified hierarchy of `actions`. `robot` and the tasks must outlive this object.
  /// @throws std::invalid_argument on bad options or actions (see `unified_hierarchy`).
  Controller(const R& robot, const std::vector<Action<R>>& actions)
      : Controller(robot, actions, Options{}) {}
  /// The same with options.
  [[gnu::cold]] Controller(const R& robot, const std::vector<Action<R>>& actions, Options options)
      : robot_(robot),
        options_(options),
        hierarchy_(unified_hierarchy(actions)),
        transition_(count_entries()),
        targets_(transition_.count()),
        vehicle_tpik_(make_solver(robot, options)),
        arm_tpik_(make_solver(robot, options)),
        arm_law_(make_law(robot, options)),
        velocity_(detail::zeros<Velocity>(robot.dof())),
        rho0_(velocity_),
        joint_velocity_(detail::zeros<JointVelocity>(robot.arm_dof())),
        vehicle_velocity_(detail::zeros<Vector6<Scalar>>(6)),
        vehicle_Q0_(detail::identity<typename Solver::SquareN>(robot.dof())),
        arm_Q0_(vehicle_Q0_) {
    for (const auto& action : actions) names_.push_back(action.name);
    for (const auto& level : hierarchy_) {
      Index rows = 0;
      for (const auto& entry : level) {
        rows += entry.task->rows();
        if (std::find(tasks_.begin(), tasks_.end(), entry.task) == tasks_.end()) {
          tasks_.push_back(entry.task);
        }
      }
      const auto column = detail::zeros<Vector<Scalar, Eigen::Dynamic>>(rows);
      levels_.push_back(
          {detail::zeros<JacobianMatrix<Scalar, R::size>>(rows, robot.dof()), column, column});
    }
    for (Index i = 0; i < 6; ++i) {
      const Index j = robot.arm_dof() + i;
      arm_Q0_(j, j) = Scalar(0);
      if (!options.actuated[static_cast<std::size_t>(i)]) vehicle_Q0_(j, j) = Scalar(0);
    }
  }
  Controller(R&&, const std::vector<Action<R>>&) = delete;
  Controller(R&&, const std::vector<Action<R>>&, Options) = delete;

  /// Enters `action` at once, for a start in the middle of things.
  Status start(std::string_view action, Scalar time) noexcept {
    const std::size_t index = find(action);
    if (index == names_.size()) return Status::unknown_action;
    set_targets(index);
    const Status status = transition_.set(targets_, time);
    if (status == Status::ok) action_ = index;
    return status;
  }

  /// Moves to `action` over `duration` seconds, from the activations as they are now (all 0 before
  /// the first action); also in the middle of another transition, also back.
  Status switch_to(std::string_view action, Scalar time, Scalar duration) noexcept {
    const std::size_t index = find(action);
    if (index == names_.size()) return Status::unknown_action;
    set_targets(index);
    const Status status = transition_.start(targets_, time, duration);
    if (status == Status::ok) action_ = index;
    return status;
  }

  /// One control cycle by the scheme of the options. `measured` is the vehicle's velocity,
  /// components on ⟨v⟩. Times of all steps are on one clock. On bad input:
  /// - a level at fault: the iteration ends above it; its index is in the report, and what has a
  ///   higher priority is still served;
  /// - a measured velocity that is needed and not finite: zero velocity;
  /// - a time at fault, or no action yet: the velocity stays what it was.
  /// The velocity is always finite, and inside the bounds in what may be chosen.
  Status step(Scalar time,
              const Vector6<Scalar>& measured = detail::zeros<Vector6<Scalar>>(6)) noexcept {
    Status status = update(time);
    if (status != Status::ok) return status;
    status = solve(vehicle_tpik_, vehicle_Q0_, measured);
    take(vehicle_tpik_, 0, robot_.dof());
    if (options_.scheme == Scheme::parallel) {
      const Status arm = solve(arm_tpik_, arm_Q0_, measured);
      take(arm_tpik_, 0, robot_.arm_dof());
      if (status == Status::ok) status = arm;
    }
    return status;
  }
  /// TPIK 1 alone, at the vehicle's rate: a new `vehicle_velocity`.
  Status step_vehicle(Scalar time, const Vector6<Scalar>& measured) noexcept {
    Status status = update(time);
    if (status != Status::ok) return status;
    status = solve(vehicle_tpik_, vehicle_Q0_, measured);
    take(vehicle_tpik_, robot_.arm_dof(), robot_.dof());
    return status;
  }
  /// TPIK 2 alone, at the arm's rate: a new `joint_velocity`.
  Status step_arm(Scalar time, const Vector6<Scalar>& measured) noexcept {
    Status status = update(time);
    if (status != Status::ok) return status;
    status = solve(arm_tpik_, arm_Q0_, measured);
    take(arm_tpik_, 0, robot_.arm_dof());
    return status;
  }

  /// The arm law of [Coop, Eq. (24)] for the present state: after it `joint_velocity(measured)`
  /// answers every new measurement without solving.
  Status step_arm_law(Scalar time) noexcept {
    Status status = update(time);
    if (status != Status::ok) return status;
    arm_law_.reset();
    for (std::size_t k = 0; k < levels_.size() && status == Status::ok; ++k) {
      const Level& level = levels_[k];
      status = arm_law_.add_level(level.jacobian, level.activation, level.reference);
    }
    const Status closing = arm_law_.minimize_velocity();
    return status == Status::ok ? closing : status;
  }
  /// Phase activations at `time`, tasks at the robot's state, rows stacked into `levels`: what each
  /// step does before it solves.
  Status update(Scalar time) noexcept {
    if (action_ == none) return Status::not_started;
    if (const Status status = transition_.update(time); status != Status::ok) return status;
    for (Task<R>* task : tasks_) {
      if (wanted(task)) task->update(robot_);
    }
    std::size_t i = 0;
    for (std::size_t k = 0; k < hierarchy_.size(); ++k) {
      Index row = 0;
      for (const auto& entry : hierarchy_[k]) {
        stack(*entry.task, transition_.values()[i++], levels_[k], row);
        row += entry.task->rows();
      }
    }
    return Status::ok;
  }

  /// ẏ = [q̇; v̄]; v̄ with components on ⟨v⟩. Components that are not actuated hold what was measured.
  const Velocity& velocity() const noexcept { return velocity_; }
  /// q̇ of `velocity`, rad/s or m/s.
  const JointVelocity& joint_velocity() const noexcept { return joint_velocity_; }
  /// q̇ = ρ̃ + P v for the vehicle's velocity `measured`, components on ⟨v⟩; scaled as a whole into
  /// the velocity bounds. Of the last `step_arm_law`; zero velocity where `measured` is not finite.
  JointVelocity joint_velocity(const Vector6<Scalar>& measured) const noexcept {
    auto velocity = detail::zeros<JointVelocity>(robot_.arm_dof());
    if (!detail::all_finite(measured)) return velocity;
    const JointVelocity wanted = arm_law_.evaluate(measured);
    if (!detail::all_finite(wanted)) return velocity;
    if (!options_.solver.bounds) return wanted;
    const auto& bounds = *options_.solver.bounds;
    const Index n = robot_.arm_dof();
    const Scalar scale = bounds.scale(n, velocity.data(), wanted.data());
    bounds.advance(n, velocity.data(), wanted.data(), scale);
    return velocity;
  }
  /// v̄ of `velocity`, components on ⟨v⟩.
  const Vector6<Scalar>& vehicle_velocity() const noexcept { return vehicle_velocity_; }

  /// Name of the action that runs or is being entered; empty before `start`.
  std::string_view action() const noexcept {
    return action_ == none ? std::string_view{} : std::string_view{names_[action_]};
  }
  /// An action is being entered.
  bool in_transition() const noexcept { return action_ != none && !transition_.finished(); }
  /// The unified hierarchy of the actions.
  const UnifiedHierarchy<R>& hierarchy() const noexcept { return hierarchy_; }
  /// aᵖ of every entry of the hierarchy, level by level.
  std::span<const Scalar> phase_activations() const noexcept { return transition_.values(); }
  /// The levels of `hierarchy` as of the last step or `update`.
  std::span<const Level> levels() const noexcept { return levels_; }
  /// Reports of the two solvers; levels are those of `hierarchy`.
  const TpikReport<Scalar>& report() const noexcept { return vehicle_tpik_.report(); }
  /// Report of TPIK 2.
  const TpikReport<Scalar>& arm_report() const noexcept { return arm_tpik_.report(); }

 private:
  using Law = ParametricTpik<Scalar, arm_size, 6, Regularization>;
  static constexpr std::size_t none = static_cast<std::size_t>(-1);

  static Solver make_solver(const R& robot, const Options& options) {
    if constexpr (R::size == Eigen::Dynamic) {
      return Solver(robot.dof(), options.solver);
    } else {
      return Solver(options.solver);
    }
  }
  static Law make_law(const R& robot, const Options& options) {
    const typename Law::Options law{options.solver.regularization,
                                    options.solver.projection_weight};
    if constexpr (R::size == Eigen::Dynamic) {
      return Law(robot.arm_dof(), law);
    } else {
      return Law(law);
    }
  }
  /// Components `begin` to `end` of the velocity are those of `tpik`.
  void take(const Solver& tpik, Index begin, Index end) noexcept {
    const Index joints = robot_.arm_dof();
    for (Index i = begin; i < end; ++i) {
      velocity_(i) = tpik.velocity()(i);
      (i < joints ? joint_velocity_(i) : vehicle_velocity_(i - joints)) = velocity_(i);
    }
  }
  /// Rows `row`… of `level` are those of `task` with the phase activation `phase`.
  void stack(const Task<R>& task, Scalar phase, Level& level, Index row) const noexcept {
    const bool active = phase > Scalar(0), good = fits(task);
    for (Index i = 0; i < task.rows(); ++i) {
      // Without activation old values could be what made the level be refused; the solver checks
      // inactive rows too.
      const bool use = active && good;
      for (Index j = 0; j < robot_.dof(); ++j) {
        level.jacobian(row + i, j) = use ? task.jacobian()(i, j) : Scalar(0);
      }
      level.activation(row + i) = use ? phase * task.activation()(i) : Scalar(0);
      level.reference(row + i) = use      ? task.reference()(i)
                                 : active ? std::numeric_limits<Scalar>::quiet_NaN()
                                          : Scalar(0);
    }
  }
  std::size_t count_entries() const {
    std::size_t count = 0;
    for (const auto& level : hierarchy_) count += level.size();
    return count;
  }
  std::size_t find(std::string_view action) const noexcept {
    return static_cast<std::size_t>(std::find(names_.begin(), names_.end(), action) -
                                    names_.begin());
  }
  void set_targets(std::size_t action) noexcept {
    std::size_t i = 0;
    for (const auto& level : hierarchy_) {
      for (const auto& entry : level)
        targets_[i++] = entry.in_action[action] ? Scalar(1) : Scalar(0);
    }
  }
  /// A task may have resized what it yields; its level is then refused.
  bool fits(const Task<R>& task) const noexcept {
    return task.jacobian().rows() == task.rows() && task.jacobian().cols() == robot_.dof() &&
           task.reference().size() == task.rows() && task.activation().size() == task.rows();
  }
  bool wanted(const Task<R>* task) const noexcept {
    std::size_t i = 0;
    for (const auto& level : hierarchy_) {
      for (const auto& entry : level) {
        if (transition_.values()[i++] > Scalar(0) && entry.task == task) return true;
      }
    }
    return false;
  }

  Status solve(Solver& tpik, const typename Solver::SquareN& Q0,
               const Vector6<Scalar>& measured) noexcept {
    // Measured velocities count where Q₀ leaves no choice.
    for (Index i = 0; i < 6; ++i) {
      const Index j = robot_.arm_dof() + i;
      rho0_(j) = Q0(j, j) == Scalar(0) ? measured(i) : Scalar(0);
    }
    Status status = tpik.reset(rho0_, Q0);
    for (std::size_t k = 0; k < levels_.size() && status == Status::ok; ++k) {
      status = tpik.add_level(levels_[k].jacobian, levels_[k].activation, levels_[k].reference);
    }
    const Status closing = tpik.minimize_velocity();
    return status == Status::ok ? closing : status;
  }

  const R& robot_;
  Options options_;
  UnifiedHierarchy<R> hierarchy_;
  Transition<Scalar> transition_;
  std::vector<Scalar> targets_;
  std::vector<std::string> names_;
  std::vector<Task<R>*> tasks_;
  std::vector<Level> levels_;
  std::size_t action_{none};
  Solver vehicle_tpik_, arm_tpik_;
  Law arm_law_;
  Velocity velocity_, rho0_;
  JointVelocity joint_velocity_;
  Vector6<Scalar> vehicle_velocity_;
  typename Solver::SquareN vehicle_Q0_, arm_Q0_;
};

}  // namespace icat
