// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// One of several robots that hold the same object, ⟨t_a⟩ ≡ ⟨t_b⟩ ≡ ⟨o⟩ [Coop, IV]. Each control
/// cycle has three steps:
///
///  1. its own hierarchy, as if it were alone: ẏ_i and ẋ_i = J_t ẏ_i         [Coop, Eq. (28)]
///  2. the exchange of ẋ_i, and the velocity agreed on, ẋ̂_t                  [Coop, Eq. (29)]
///  3. a second hierarchy with J_t ẏ = ẋ̂_t on top                           [Coop, Eq. (30)]
///
/// with components on ⟨t⟩, the frame of the shared tasks. In the second hierarchy the tool task is
/// on top instead of in its place; where an action begins or ends to be shared, one fades in while
/// the other fades out. What the base of a `MobileRobot` does not track its joints may make up for,
/// see control/base_compensation.hpp [Coop, IV-D].
///
/// ẋ̂_t is what all agents command as long as each can: one whose velocity bounds do not let it
/// moves its tool more slowly, and `second().report()` then shows a saturation scale below 1 on its
/// first level. Give the tool tasks rates that leave room.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "icat/control/base_compensation.hpp"
#include "icat/control/controller.hpp"
#include "icat/control/low_pass.hpp"
#include "icat/cooperation/agreement.hpp"
#include "icat/task/frame_tasks.hpp"

namespace icat {

/// An action in which the tool's velocity is agreed on, and its task that says where the object is
/// to go. Refers to a task of the caller's.
template <FramedRobot R>
struct SharedAction {
  /// Name of the action.
  std::string action;
  /// The task that the agreed velocity stands in for; its frame is ⟨t⟩.
  std::reference_wrapper<task::FramePose<R>> tool;
};

namespace detail {

/// Where there is no base there is nothing to make up for.
struct NoCompensation {};
template <class R, class Regularization>
struct CompensationOf {
  using type = NoCompensation;
};
template <MobileRobot R, class Regularization>
struct CompensationOf<R, Regularization> {
  using type = BaseCompensation<R, Regularization>;
};

}  // namespace detail

/// See the file comment. The robot, the tasks and this object belong to one thread; after
/// construction nothing allocates or throws.
template <FramedRobot R, class Regularization = BellRegularization<typename R::Scalar>>
class Agent {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// What runs either hierarchy.
  using AgentController = Controller<R, Regularization>;
  /// ẏ, n.
  using Velocity = typename AgentController::Velocity;
  /// Settings, with defaults.
  struct Options {
    /// Of both hierarchies.
    typename AgentController::Options controller{};
    /// The joints make up for what the base does not track; for a `MobileRobot` only.
    bool compensation{false};
    /// Of the exchange.
    AgreementOptions<Scalar> agreement{};
    /// Time constant of the filter on ẋ̂_t, s, ≥ 0; 0: none. The same for all agents.
    Scalar filter{0};
  };

  /// `robot` and the tasks must outlive this object.
  /// @throws std::invalid_argument on bad actions or options, no shared action, shared actions with
  ///         tools of different frames, or one that is not among `actions` or lacks its tool task.
  ///         Allocates.
  [[gnu::cold]] Agent(const R& robot, const std::vector<Action<R>>& actions,
                      const std::vector<SharedAction<R>>& shared, const Options& options)
      : robot_(robot),
        tool_(common_tool(shared)),
        shared_(shared),
        agreed_velocity_(robot, tool_, {.name = "agreed velocity"}),
        agreement_(options.agreement),
        filter_(options.filter),
        own_(robot, actions, options.controller),
        second_(robot, with_agreement(actions, shared, agreed_velocity_), options.controller),
        measured_(detail::zeros<Velocity>(robot.dof())),
        velocity_(measured_),
        command_(measured_),
        sensitivity_(detail::GivenTpik<R, Regularization>::template make<Sensitivity>(
            robot.dof(), {options.controller.solver.regularization,
                          options.controller.solver.projection_weight})) {
    if constexpr (MobileRobot<R>) {
      no_velocity_ =
          detail::zeros<Vector<Scalar, Eigen::Dynamic>>(robot.dof() - robot.base_columns().count);
      if (options.compensation) {
        compensation_.emplace(robot, options.controller.solver, options.controller.given,
                              second_.levels());
      }
    } else if (options.compensation) {
      detail::invalid("Agent: compensation needs a robot with a base");
    }
    find_entries();
  }
  Agent(R&&, const std::vector<Action<R>>&, const std::vector<SharedAction<R>>&,
        const Options&) = delete;
  Agent(const Agent&) = delete;
  Agent& operator=(const Agent&) = delete;

  /// As `Controller::start`. A refusal changes nothing. At a time before the last one it starts
  /// anew: what was agreed before counts as old.
  Status start(std::string_view action, double time) noexcept {
    const Status status = own_.start(action, time);
    if (status != Status::ok) return status;
    if (time < last_time_) {
      agreement_.restart(time);
      last_time_ = -infinity<double>;
    }
    second_time_ = time;
    return second_.start(action, time);
  }
  /// As `Controller::switch_to`. A refusal changes nothing.
  Status switch_to(std::string_view action, double time, double duration) noexcept {
    if (time < second_time_) return Status::time_reversed;
    const Status status = own_.switch_to(action, time, duration);
    return status == Status::ok ? second_.switch_to(action, time, duration) : status;
  }

  /// Step 1, given columns standing still. Errors as in `Controller::step`; on one the last
  /// proposal is withdrawn: there is nothing to send until a better one comes.
  Status propose(double time) noexcept { return propose(time, still_velocity()); }
  /// The same with the velocity that is measured, n; its given columns count.
  Status propose(double time, const Velocity& measured) noexcept {
    const Status status = own_.step(time, measured);
    if (status != Status::ok) {
      agreement_.withdraw();
      return status;
    }
    const auto& J = robot_.jacobian(tool_);
    auto velocity = detail::zeros<Vector6<Scalar>>(6);
    for (Index j = 0; j < robot_.dof(); ++j) {
      for (Index i = 0; i < 6; ++i) velocity(i) += J(i, j) * own_.velocity()(j);
    }
    velocity = on_tool(velocity);
    if (!agreement_.options().spans) return agreement_.propose(velocity, desired());
    return agreement_.propose(velocity, desired(), span());
  }
  /// Step 2, out: the proposal as bytes, see `Agreement::send`.
  std::span<const std::byte> send(long long round) noexcept { return agreement_.send(round); }
  /// Step 2, in: what agent `sender` sent, see `Agreement::receive`.
  Status receive(std::size_t sender, long long round, std::span<const std::byte> bytes) noexcept {
    return agreement_.receive(sender, round, bytes);
  }
  /// Step 3, for the robot's state of `propose`, given columns and, where compensated, the base
  /// standing still. Errors as in `Controller::step`.
  Status step(double time) noexcept { return step(time, still_velocity()); }
  /// The same with the velocity that is measured, n: its given columns count and, where
  /// compensated, those of the base. `correction` (components on ⟨t⟩) is added to ẋ̂_t, such as a
  /// small velocity along a measured interaction force [Coop, V-B].
  Status step(double time, const Velocity& measured,
              const Vector6<Scalar>& correction = detail::zeros<Vector6<Scalar>>(6)) noexcept {
    if (measured.size() != robot_.dof()) return Status::wrong_size;
    if (!std::isfinite(time) || !detail::all_finite(correction)) return Status::non_finite;
    if (time < last_time_) return Status::time_reversed;
    const bool first = !std::isfinite(last_time_);
    (void)filter_.update(agreement_.update(time),
                         static_cast<Scalar>(first ? 0 : time - last_time_));
    last_time_ = time;
    Vector6<Scalar> commanded = filter_.value();
    for (Index i = 0; i < 6; ++i) commanded(i) += correction(i);
    (void)agreed_velocity_.set_velocity(commanded);
    Status status = update_second(time);
    if (status != Status::ok) return status;
    // Alone and settled, both hierarchies are the same.
    const bool same =
        !(agreement_activation() > 0) && !own_.in_transition() && !second_.in_transition();
    if (!same) status = second_.solve(measured);
    take(same ? own_.velocity() : second_.velocity(), false);
    if constexpr (MobileRobot<R>) {
      if (compensation_) {
        const Status joints = compensation_->solve(second_.levels(), measured);
        take(compensation_->velocity(), true);
        if (status == Status::ok) status = joints;
      }
    }
    return status;
  }

  /// The law of the compensation on the second hierarchy [Coop, IV-D], for a joint loop faster than
  /// `step`: after it `joint_velocity(measured)` answers every new measurement of the base. Given
  /// joints stand still.
  Status step_joint_law(double time) noexcept requires MobileRobot<R> {
    return step_joint_law(time, still_velocity());
  }
  /// The same with given joints that move, until the next law, as in `measured`, n.
  Status step_joint_law(double time, const Velocity& measured) noexcept requires MobileRobot<R> {
    if (!compensation_) return Status::not_started;
    const Status status = update_second(time);
    return status == Status::ok ? compensation_->solve_law(second_.levels(), measured) : status;
  }
  /// See `BaseCompensation::joint_velocity`; zeros without compensation.
  template <class V>
  const Vector<Scalar, Eigen::Dynamic>& joint_velocity(
      const Eigen::MatrixBase<V>& measured) noexcept requires MobileRobot<R> {
    return compensation_ ? compensation_->joint_velocity(measured) : no_velocity_;
  }

  /// ẏ; given columns hold what was measured.
  const Velocity& velocity() const noexcept { return velocity_; }
  /// What goes to the back-end: ẏ with zeros in the given columns.
  const Velocity& command() const noexcept { return command_; }
  /// ẋ̂_t after the filter, components on ⟨t⟩.
  const Vector6<Scalar>& agreed_velocity() const noexcept { return filter_.value(); }
  /// aᵖ of ẋ̂_t on top of the second hierarchy: 0 alone, 1 in a shared action. The object may be
  /// held firmly only at 1.
  double agreement_activation() const noexcept {
    const auto phases = second_.phase_activations();
    return top_entry_ < phases.size() ? phases[top_entry_] : 0;
  }
  /// ẋ̄_t, components on ⟨t⟩: what the tool tasks of shared actions ask for, weighted by their aᵖ.
  Vector6<Scalar> desired() const noexcept {
    auto sum = detail::zeros<Vector6<Scalar>>(6);
    for (const auto& [entry, tool] : tools_) {
      const Scalar phase = static_cast<Scalar>(own_.phase_activations()[entry]);
      if (!(phase > Scalar(0))) continue;
      for (Index i = 0; i < 6; ++i) sum(i) += phase * tool->reference()(i);
    }
    return on_tool(sum);
  }
  /// State of the exchange.
  const Agreement<Scalar>& agreement() const noexcept { return agreement_; }
  /// Its own hierarchy, step 1.
  const AgentController& own() const noexcept { return own_; }
  /// The second hierarchy, step 3.
  const AgentController& second() const noexcept { return second_; }

 private:
  // All columns as chosen ones, the tool's reference as the six parameters.
  using Sensitivity = ParametricTpik<Scalar, R::size, 6, Regularization>;
  using Compensation = typename detail::CompensationOf<R, Regularization>::type;

  static FrameId common_tool(const std::vector<SharedAction<R>>& shared) {
    if (shared.empty()) detail::invalid("Agent: no action is shared");
    for (const auto& s : shared) {
      if (!(s.tool.get().frame() == shared.front().tool.get().frame())) {
        detail::invalid("Agent: the shared tasks '", shared.front().tool.get().name(), "' and '",
                        s.tool.get().name(), "' move different frames");
      }
    }
    return shared.front().tool.get().frame();
  }
  Status update_second(double time) noexcept {
    const Status status = second_.update(time);
    if (status == Status::ok) second_time_ = time;
    return status;
  }
  const Velocity& still_velocity() noexcept {
    detail::fill(measured_, Scalar(0));
    return measured_;
  }
  /// A twist with components on ⟨0⟩, on ⟨t⟩.
  Vector6<Scalar> on_tool(const Vector6<Scalar>& twist) const noexcept {
    const Matrix3<Scalar> R_t = detail::rotation(Pose<Scalar>(robot_.pose(tool_)));
    Vector6<Scalar> out;
    for (Index part = 0; part < 6; part += 3) {
      detail::set_column3(out, part, 0,
                          detail::transposed_times(R_t, detail::column3(twist, part, 0)));
    }
    return out;
  }
  /// All columns are those of `solution`, or all but the base's.
  void take(const Velocity& solution, bool joints_only) noexcept {
    for (Index c = 0; c < velocity_.size(); ++c) {
      if constexpr (MobileRobot<R>) {
        if (joints_only && compensation_->in_base(c)) continue;
      }
      velocity_(c) = solution(c);
      command_(c) = own_.given(c) ? Scalar(0) : solution(c);
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
      if (!s.tool.get().on_world()) {
        detail::invalid("Agent: the shared task '", s.tool.get().name(),
                        "' must have its goal and its axes on the world");
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

  /// T = ∂ẋ_i/∂ẋ̄_i at the tool task's priority level, components on ⟨t⟩. Velocity bounds are no
  /// part of it.
  Matrix6<Scalar> span() noexcept {
    const Matrix3<Scalar> R_t = detail::rotation(Pose<Scalar>(robot_.pose(tool_)));
    const Index n = robot_.dof();
    sensitivity_.reset();
    std::size_t entry_index = 0;
    for (std::size_t k = 0; k <= last_tool_level_ && k < own_.hierarchy().size(); ++k) {
      const auto& level = own_.levels()[k];
      const auto rows = extended_.topRows(level.jacobian.rows());
      for (Index j = 0; j < n + 6; ++j) {
        const bool free = j < n && !own_.given(j);
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
    const auto& J = robot_.jacobian(tool_);
    const auto& P = sensitivity_.P();
    Matrix6<Scalar> T;
    for (Index j = 0; j < 6; ++j) {
      auto column = detail::zeros<Vector6<Scalar>>(6);
      for (Index k = 0; k < n; ++k) {
        for (Index i = 0; i < 6; ++i) column(i) += J(i, k) * P(k, j);
      }
      column = on_tool(column);
      for (Index i = 0; i < 6; ++i) T(i, j) = column(i);
    }
    return T;
  }

  struct ToolEntry {
    std::size_t entry;
    const task::FramePose<R>* tool;
  };

  const R& robot_;
  FrameId tool_;
  std::vector<SharedAction<R>> shared_;
  task::FrameVelocity<R> agreed_velocity_;
  Agreement<Scalar> agreement_;
  LowPass<Scalar, 6> filter_;
  AgentController own_, second_;
  std::optional<Compensation> compensation_;
  Vector<Scalar, Eigen::Dynamic> no_velocity_;
  Velocity measured_, velocity_, command_;
  Sensitivity sensitivity_;
  std::vector<ToolEntry> tools_;
  // Of the last step, and of the second hierarchy, which the law moves on too.
  double last_time_{-infinity<double>}, second_time_{-infinity<double>};
  std::size_t top_entry_{static_cast<std::size_t>(-1)}, last_tool_level_{0};
  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> extended_;
};

}  // namespace icat
