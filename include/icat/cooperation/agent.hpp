// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One of several robots that hold the same object, ⟨t_a⟩ ≡ ⟨t_b⟩ ≡ ⟨o⟩ [Coop, IV]. Each control
/// cycle has three steps:
///
///  1. its own hierarchy, as if it were alone: ẏ_i and ẋ_i = J_t ẏ_i         [Coop, Eq. (28)]
///  2. the exchange of ẋ_i, and the velocity agreed on, ẋ̂_t                  [Coop, Eq. (29)]
///  3. a second hierarchy with J_t ẏ = ẋ̂_t on top                           [Coop, Eq. (30)]
///
/// with components on ⟨t⟩. In the second hierarchy the tool task is on top instead of in its
/// place; where an action begins or ends to be shared, one fades in while the other fades out. What
/// the vehicle does not track the arm makes up for, as in control/controller.hpp [Coop, IV-D].
///
/// ẋ̂_t is what all agents command as long as each can: one whose velocity bounds do not let it
/// moves its tool more slowly, and `second().report()` then shows a saturation scale below 1 on its
/// first level. Give the tool tasks rates that leave room.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "icat/control/controller.hpp"
#include "icat/control/low_pass.hpp"
#include "icat/cooperation/agreement.hpp"
#include "icat/model/uvms.hpp"
#include "icat/task/pose_tasks.hpp"
#include "icat/task/tool_velocity.hpp"

namespace icat {

/// An action in which the tool's velocity is agreed on, and its task that says where the object is
/// to go. Refers to a task of the caller's.
template <VehicleManipulator R>
struct SharedAction {
  /// Name of the action.
  std::string action;
  /// The task that the agreed velocity stands in for.
  std::reference_wrapper<task::ToolPose<R>> tool;
};

/// See the file comment. The robot, the tasks and this object belong to one thread; after
/// construction nothing allocates or throws.
template <VehicleManipulator R, class Regularization = BellRegularization<typename R::Scalar>>
class Agent {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// What runs either hierarchy.
  using AgentController = Controller<R, Regularization>;
  /// Settings, with defaults.
  struct Options {
    /// Of the second hierarchy and of actions that are not shared.
    typename AgentController::Options controller{};
    /// Of the exchange.
    AgreementOptions<Scalar> agreement{};
    /// Time constant of the filter on ẋ̂_t, s, ≥ 0; 0: none. The same for all agents.
    Scalar filter{0};
  };

  /// `robot` and the tasks must outlive this object.
  /// @throws std::invalid_argument on bad actions or options, or a shared action that is not among
  ///         `actions` or lacks its tool task. Allocates.
  Agent(const R& robot, const std::vector<Action<R>>& actions,
        const std::vector<SharedAction<R>>& shared, const Options& options)
      : robot_(robot),
        shared_(shared),
        agreed_velocity_(robot, "agreed velocity"),
        agreement_(options.agreement),
        filter_(options.filter),
        own_(robot, actions,
             {.actuated = options.controller.actuated, .solver = options.controller.solver}),
        second_(robot, with_agreement(actions, shared, agreed_velocity_), options.controller),
        scheme_(options.controller.scheme),
        actuated_(options.controller.actuated),
        velocity_(AgentController::Velocity::Zero(robot.dof())),
        sensitivity_(make_sensitivity(robot, options.controller)) {
    find_entries();
  }
  Agent(R&&, const std::vector<Action<R>>&, const std::vector<SharedAction<R>>&,
        const Options&) = delete;
  Agent(const Agent&) = delete;
  Agent& operator=(const Agent&) = delete;

  /// As `Controller::start`.
  Status start(std::string_view action, Scalar time) noexcept {
    const Status status = own_.start(action, time);
    return status == Status::ok ? second_.start(action, time) : status;
  }
  /// As `Controller::switch_to`.
  Status switch_to(std::string_view action, Scalar time, Scalar duration) noexcept {
    const Status status = own_.switch_to(action, time, duration);
    return status == Status::ok ? second_.switch_to(action, time, duration) : status;
  }

  /// Step 1. Errors, and what `measured` is for, as in `Controller::step`; on one the last proposal
  /// stays.
  Status propose(Scalar time, const Vector6<Scalar>& measured = Vector6<Scalar>::Zero()) noexcept {
    if (const Status status = own_.step(time, measured); status != Status::ok) return status;
    const auto& J = robot_.tool_jacobian(Frame::tool);
    const Vector6<Scalar> velocity = J * own_.velocity();
    if (!agreement_.options().spans) return agreement_.propose(velocity, desired());
    return agreement_.propose(velocity, desired(), span());
  }
  /// Step 2, out: the proposal as bytes, see `Agreement::send`.
  std::span<const std::byte> send(long long round) noexcept { return agreement_.send(round); }
  /// Step 2, in: what agent `sender` sent, see `Agreement::receive`.
  Status receive(std::size_t sender, long long round, std::span<const std::byte> bytes) noexcept {
    return agreement_.receive(sender, round, bytes);
  }
  /// Step 3, for the robot's state of `propose`; errors as in `Controller::step`. `correction`
  /// (components on ⟨t⟩) is added to ẋ̂_t, such as a small velocity along a measured interaction
  /// force [Coop, V-B].
  Status step(Scalar time, const Vector6<Scalar>& measured = Vector6<Scalar>::Zero(),
              const Vector6<Scalar>& correction = Vector6<Scalar>::Zero()) noexcept {
    const bool first = !std::isfinite(last_time_);
    (void)filter_.update(agreement_.update(time), first ? Scalar(0) : time - last_time_);
    if (time > last_time_) last_time_ = time;
    agreed_velocity_.set_velocity(filter_.value() + correction);
    // Alone and settled, both hierarchies are the same.
    const bool same =
        !(agreement_activation() > Scalar(0)) && !own_.in_transition() && !second_.in_transition();
    Status status = Status::ok;
    if (!same) {
      status = second_.step(time, measured);
      velocity_ = second_.velocity();
    } else {
      velocity_ = own_.velocity();
      if (scheme_ == Scheme::whole_body) {
        status = second_.update(time);
      } else {
        status = second_.step_arm(time, measured);
        for (Index i = 0; i < robot_.arm_dof(); ++i) velocity_(i) = second_.joint_velocity()(i);
      }
    }
    return status;
  }

  /// The arm law of the second hierarchy [Coop, IV-D], for an arm loop faster than `step`: after it
  /// `joint_velocity(measured)` answers every new measurement. See `Controller::step_arm_law`.
  Status step_arm_law(Scalar time) noexcept { return second_.step_arm_law(time); }
  /// See `Controller::joint_velocity`.
  auto joint_velocity(const Vector6<Scalar>& measured) const noexcept {
    return second_.joint_velocity(measured);
  }

  /// ẏ = [q̇; v̄]; v̄ with components on ⟨v⟩.
  const typename AgentController::Velocity& velocity() const noexcept { return velocity_; }
  /// q̇ of `velocity`, rad/s or m/s.
  auto joint_velocity() const noexcept { return velocity_.head(robot_.arm_dof()); }
  /// v̄ of `velocity`.
  auto vehicle_velocity() const noexcept { return velocity_.template tail<6>(); }
  /// ẋ̂_t after the filter, components on ⟨t⟩.
  const Vector6<Scalar>& agreed_velocity() const noexcept { return filter_.value(); }
  /// aᵖ of ẋ̂_t on top of the second hierarchy: 0 alone, 1 in a shared action. The object may be
  /// held firmly only at 1.
  Scalar agreement_activation() const noexcept {
    const auto phases = second_.phase_activations();
    return top_entry_ < phases.size() ? phases[top_entry_] : Scalar(0);
  }
  /// ẋ̄_t, components on ⟨t⟩: what the tool tasks of shared actions ask for, weighted by their aᵖ.
  Vector6<Scalar> desired() const noexcept {
    auto sum = detail::zeros<Vector6<Scalar>>(6);
    for (const auto& [entry, tool] : tools_) {
      const Scalar phase = own_.phase_activations()[entry];
      if (!(phase > Scalar(0))) continue;
      for (Index i = 0; i < 6; ++i) sum(i) += phase * tool->reference()(i);
    }
    const Matrix3<Scalar> R_t = detail::rotation(robot_.tool());
    for (Index part = 0; part < 6; part += 3) {
      detail::set_column3(sum, part, 0,
                          detail::transposed_times(R_t, detail::column3(sum, part, 0)));
    }
    return sum;
  }
  /// State of the exchange.
  const Agreement<Scalar>& agreement() const noexcept { return agreement_; }
  /// Its own hierarchy, step 1.
  const AgentController& own() const noexcept { return own_; }
  /// The second hierarchy, step 3.
  const AgentController& second() const noexcept { return second_; }

 private:
  // The whole system as "arm", the tool's reference as the six parameters.
  using Sensitivity = ParametricTpik<Scalar, R::size, 6, Regularization>;

  static Sensitivity make_sensitivity(const R& robot,
                                      const typename AgentController::Options& options) {
    const typename Sensitivity::Options o{options.solver.regularization,
                                          options.solver.projection_weight};
    if constexpr (R::size == Eigen::Dynamic) {
      return Sensitivity(robot.dof(), o);
    } else {
      return Sensitivity(o);
    }
  }

  static std::vector<Action<R>> with_agreement(std::vector<Action<R>> actions,
                                               const std::vector<SharedAction<R>>& shared,
                                               Task<R>& agreed) {
    for (const auto& s : shared) {
      const auto action = std::find_if(actions.begin(), actions.end(),
                                       [&](const auto& a) { return a.name == s.action; });
      if (action == actions.end()) {
        detail::invalid("Agent: no action '", s.action, "' to be shared");
      }
      bool found = false;
      for (auto& level : action->levels) {
        found =
            std::erase_if(level, [&](Task<R>& task) { return &task == &s.tool.get(); }) || found;
      }
      if (!found) {
        detail::invalid("Agent: action '", s.action, "' does not contain task '",
                        s.tool.get().name(), "' or is shared twice");
      }
      if (s.tool.get().rows() != 6) {
        detail::invalid("Agent: the shared task '", s.tool.get().name(),
                        "' must be in component form, six rows, not ", s.tool.get().rows());
      }
      std::erase_if(action->levels, [](const auto& level) { return level.empty(); });
      action->levels.insert(action->levels.begin(), PriorityLevel<R>{agreed});
    }
    return actions;
  }

  /// Where the agreed velocity and the shared tool tasks stand among the phase activations.
  void find_entries() {
    std::size_t i = 0;
    for (const auto& level : second_.hierarchy()) {
      for (const auto& entry : level) {
        if (entry.task == &agreed_velocity_) top_entry_ = i;
        ++i;
      }
    }
    i = 0;
    for (std::size_t k = 0; k < own_.hierarchy().size(); ++k) {
      for (const auto& entry : own_.hierarchy()[k]) {
        for (const auto& s : shared_) {
          if (entry.task != &s.tool.get()) continue;
          if (tools_.empty() || tools_.back().entry != i) tools_.push_back({i, &s.tool.get()});
          last_tool_level_ = k;
        }
        ++i;
      }
    }
    Index rows = 0;
    for (const auto& level : own_.levels()) rows = std::max(rows, level.jacobian.rows());
    extended_.setZero(rows, robot_.dof() + 6);
  }

  /// Velocity bounds are no part of it.
  /// T = ∂ẋ_i/∂ẋ̄_i at the tool task's priority level, components on ⟨t⟩.
  Matrix6<Scalar> span() noexcept {
    const Matrix3<Scalar> R_t = detail::rotation(robot_.tool());
    const Index n = robot_.dof(), first = robot_.arm_dof();
    sensitivity_.reset();
    std::size_t entry_index = 0;
    for (std::size_t k = 0; k <= last_tool_level_ && k < own_.hierarchy().size(); ++k) {
      const auto& level = own_.levels()[k];
      const auto rows = extended_.topRows(level.jacobian.rows());
      for (Index j = 0; j < n + 6; ++j) {
        // What is not actuated is not free.
        const bool free = j < n && (j < first || actuated_[static_cast<std::size_t>(j - first)]);
        for (Index i = 0; i < rows.rows(); ++i) {
          extended_(i, j) = free ? level.jacobian(i, j) : Scalar(0);
        }
      }
      Index row = 0;
      for (const auto& entry : own_.hierarchy()[k]) {
        for (const auto& tool : tools_) {
          if (tool.entry != entry_index) continue;
          // The level's residual is ẋ̄ − J ẏ − Jᵛ p: with Jᵛ = −R, p adds to the reference.
          for (Index j = 0; j < 3; ++j) {
            for (Index i = 0; i < 3; ++i) {
              extended_(row + i, n + j) = extended_(row + 3 + i, n + 3 + j) = -R_t(i, j);
            }
          }
        }
        row += entry.task->rows();
        ++entry_index;
      }
      (void)sensitivity_.add_level(rows, level.activation, level.reference);
    }
    const auto& J = robot_.tool_jacobian(Frame::tool);
    const auto& P = sensitivity_.P();
    Matrix6<Scalar> T;
    for (Index j = 0; j < 6; ++j) {
      for (Index i = 0; i < 6; ++i) {
        T(i, j) = Scalar(0);
        for (Index k = 0; k < n; ++k) T(i, j) += J(i, k) * P(k, j);
      }
    }
    return T;
  }

  struct ToolEntry {
    std::size_t entry;
    const task::ToolPose<R>* tool;
  };

  const R& robot_;
  std::vector<SharedAction<R>> shared_;
  task::ToolVelocity<R> agreed_velocity_;
  Agreement<Scalar> agreement_;
  LowPass<Scalar, 6> filter_;
  AgentController own_, second_;
  Scheme scheme_;
  std::array<bool, 6> actuated_;
  typename AgentController::Velocity velocity_;
  Sensitivity sensitivity_;
  std::vector<ToolEntry> tools_;
  Scalar last_time_{-std::numeric_limits<Scalar>::infinity()};
  std::size_t top_entry_{static_cast<std::size_t>(-1)}, last_tool_level_{0};
  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> extended_;
};

}  // namespace icat
