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
/// the other fades out. The joints of a `MobileRobot` may compensate the tracking error of its
/// base, see control/base_compensation.hpp [Coop, IV-D].
///
/// Limits come before the agreement: an agent proposes what its own box of `MotionLimits` allows.
/// If the box still reduces the agreed velocity, the tool does not move as agreed: `cut` says by
/// how much, and the next proposals are as slow. Choose maximum rates of the tool tasks well below
/// the limits.
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

/// An action with an agreed tool velocity, and its task with the goal of the object. Refers to a
/// task of the caller's.
template <FramedRobot R>
struct SharedAction {
  /// Name of the action.
  std::string action;
  /// The task that the agreed velocity replaces; its frame is ⟨t⟩.
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
  /// What solves either hierarchy.
  using Actions = ActionSolver<R, Regularization>;
  /// ẏ, n.
  using Velocity = typename Actions::Velocity;
  /// Settings, with defaults.
  struct Options {
    /// As of a controller: given columns, both hierarchies, limits, late and bad input.
    typename Controller<R, Regularization>::Options controller{};
    /// The joints compensate the tracking error of the base; for a `MobileRobot` only.
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
        own_(robot, actions, options.controller.given, options.controller.solver,
             detail::longest_step(options.controller), options.controller.characteristic_length),
        second_(robot, with_agreement(actions, shared, agreed_velocity_), options.controller.given,
                options.controller.solver, detail::longest_step(options.controller),
                options.controller.characteristic_length),
        limits_(options.controller.limits.of(robot, options.controller.time.max_step)),
        ramp_(robot.dof(), options.controller.time),
        law_ramp_(ramp_),
        hold_(options.controller.time.hold),
        measured_(detail::zeros<Velocity>(robot.dof())),
        velocity_(measured_),
        allowed_(measured_),
        answer_(measured_),
        sensitivity_(detail::GivenTpik<R, Regularization>::template make<Sensitivity>(
            robot.dof(), {options.controller.solver.regularization,
                          options.controller.solver.projection_weight})) {
    for (const Index c : options.controller.given) limits_.set_given(c, true);
    if constexpr (MobileRobot<R>) {
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

  /// As `Controller::start`. A refusal changes nothing.
  Status start(std::string_view action, double time) noexcept {
    const Status status = own_.start(action, time);
    if (status != Status::ok) return status;
    ramp_.start();
    law_ramp_.start();
    return second_.start(action, time);
  }
  /// As `Controller::switch_to`. A refusal changes nothing. In a fade from rest the tool follows
  /// the agreed velocity from the first cycle; the other tasks fade in.
  Status switch_to(std::string_view action, double time, double duration) noexcept {
    if (!(duration > 0.0) || !std::isfinite(duration)) return Status::invalid_duration;
    const bool runs = !ramp_.rests();
    Status status = runs ? own_.switch_to(action, time, duration) : own_.start(action, time);
    if (status != Status::ok) return status;
    status = runs ? second_.switch_to(action, time, duration) : second_.start(action, time);
    ramp_.resume(duration, command(), pending());
    law_ramp_.resume(duration, command(), pending());
    return status;
  }
  /// As `Controller::stop`; while the command goes to zero so do the proposals.
  Status stop(double time, double duration) noexcept {
    if (!(duration > 0.0) || !std::isfinite(duration)) return Status::invalid_duration;
    Status status = own_.tick(time);
    if (status == Status::ok) status = second_.tick(time);
    if (status != Status::ok) return status;
    ramp_.stop(duration, command(), pending());
    law_ramp_.stop(duration, command(), pending());
    return status;
  }

  /// Step 1; given columns as in `Controller::step`. Bad input as in `Controller::step`; then the
  /// last proposal is withdrawn: there is nothing to send until the next valid one.
  Status propose(double time, InputAge age = {}) noexcept { return propose(time, nullptr, age); }
  /// The same with the velocity that is measured, n; its given columns count.
  Status propose(double time, const Velocity& measured, InputAge age = {}) noexcept {
    return propose(time, &measured, age);
  }
  /// Step 2, out: the proposal as bytes, see `Agreement::send`.
  std::span<const std::byte> send(long long round) noexcept { return agreement_.send(round); }
  /// Step 2, in: what agent `sender` sent, see `Agreement::receive`.
  Status receive(std::size_t sender, long long round, std::span<const std::byte> bytes) noexcept {
    return agreement_.receive(sender, round, bytes);
  }
  /// Step 3, for the robot's state of `propose`, to be called in every cycle, whatever `propose`
  /// answered; for robots without given columns or compensation. Bad input as in
  /// `Controller::step`.
  Status step(double time, InputAge age = {}) noexcept {
    return step(time, nullptr, detail::zeros<Vector6<Scalar>>(6), age);
  }
  /// The same with the velocity that is measured, n: its given columns count and, where
  /// compensated, those of the base. `correction` (components on ⟨t⟩) is added to ẋ̂_t, such as a
  /// small velocity along a measured interaction force [Coop, V-B].
  Status step(double time, const Velocity& measured,
              const Vector6<Scalar>& correction = detail::zeros<Vector6<Scalar>>(6),
              InputAge age = {}) noexcept {
    return step(time, &measured, correction, age);
  }

  /// The law of the compensation on the second hierarchy [Coop, IV-D], for a joint loop faster than
  /// `step`, to be followed by `follow_joint_law`. Given joints stand still.
  Status step_joint_law(double time, InputAge age = {}) noexcept requires MobileRobot<R> {
    detail::fill(allowed_, Scalar(0));
    return step_joint_law(time, allowed_, age);
  }
  /// The same with given joints that move, until the next law, as in `measured`, n.
  Status step_joint_law(double time, const Velocity& measured,
                        InputAge age = {}) noexcept requires MobileRobot<R> {
    if (!compensation_) return Status::not_started;
    Status status = second_.update(time);
    if (status != Status::ok) return status;
    if (const Status old = detail::check_age(age, hold_); old != Status::ok) return old;
    status = compensation_->solve_law(second_.levels(), measured);
    if (status != Status::ok) return status;
    law_time_ = second_.clock().elapsed();
    law_age_ = age;
    return status;
  }
  /// New velocities of the joints by the law, as `ParallelController::follow_joint_law`; of
  /// `measured`, n, the base's columns count.
  Status follow_joint_law(double time, const Velocity& measured,
                          InputAge age = {}) noexcept requires MobileRobot<R> {
    if (!compensation_ || !(law_age_.state >= 0)) return Status::not_started;
    Status status = second_.tick(time);
    const double since = second_.clock().elapsed() - law_time_;
    age.state += law_age_.state + since;
    age.pose += law_age_.pose + since;
    if (status == Status::ok) status = check(second_, &measured, true, age);
    const Cycle now = second_.clock().since(law_cycle_);
    limits_.update_joints(robot_, now);
    if (status == Status::ok) compensation_->follow_law(measured_, answer_);
    law_ramp_.update(status, now);
    (void)limits_.limit_joints(law_ramp_.wanted(answer_));
    take();
    return status;
  }

  /// ẏ; given columns hold what was measured.
  const Velocity& velocity() const noexcept { return velocity_; }
  /// What goes to the back-end: ẏ with zeros in the given columns.
  const Velocity& command() const noexcept { return limits_.command(); }
  /// The boxes and the last command.
  const MotionLimits<R>& limits() const noexcept { return limits_; }
  /// What the tool is commanded less ẋ̂_t and the correction, components on ⟨t⟩: zero to rounding
  /// unless limits cut it, nothing is agreed on or held, or the robot stops.
  const Vector6<Scalar>& cut() const noexcept { return cut_; }
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
  /// Name of the action that runs or is being entered; empty before `start`.
  std::string_view action() const noexcept { return own_.action(); }
  /// State of the exchange.
  const Agreement<Scalar>& agreement() const noexcept { return agreement_; }
  /// Its own hierarchy, step 1.
  const Actions& own() const noexcept { return own_; }
  /// The second hierarchy, step 3.
  const Actions& second() const noexcept { return second_; }

 private:
  friend struct detail::Inside<Agent>;

  // Of a stamp without a cycle.
  double pending() const noexcept { return own_.clock().elapsed() - own_time_.last; }
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
  Status propose(double time, const Velocity* measured, const InputAge& age) noexcept {
    proposed_ = own_.update(time);
    cycle_ = own_.clock().since(own_time_);
    if (proposed_ == Status::not_started) return withdraw();
    limits_.update(robot_, cycle_);
    opened_ = true;
    if (proposed_ == Status::ok) proposed_ = check(own_, measured, false, age);
    if (proposed_ == Status::ok) {
      (void)own_.set_bounds(limits_.bounds());
      proposed_ = own_.solve(measured_);
    }
    if (proposed_ != Status::ok) return withdraw();
    limits_.preview(ramp_.wanted(own_.velocity()), allowed_);
    for (Index c = 0; c < allowed_.size(); ++c) {
      if (own_.given(c)) allowed_(c) = measured_(c);
    }
    const Vector6<Scalar> velocity = tool_velocity(allowed_);
    return agreement_.options().spans ? agreement_.propose(velocity, desired(), span())
                                      : agreement_.propose(velocity, desired());
  }
  Status withdraw() noexcept {
    agreement_.withdraw();
    return proposed_;
  }
  Status step(double time, const Velocity* measured, const Vector6<Scalar>& correction,
              const InputAge& age) noexcept {
    Status status = second_.tick(time);
    const Cycle now = second_.clock().since(second_time_);
    if (second_.action().empty()) return Status::not_started;
    if (!opened_) {
      cycle_ = now;
      limits_.update(robot_, now);
    }
    opened_ = false;
    if (status == Status::ok && !detail::all_finite(correction)) status = Status::non_finite;
    if (status == Status::ok) status = check(second_, measured, compensates(), age);
    if (status == Status::ok) {
      const Vector6<Scalar>& agreed = agreement_.update(second_.clock().elapsed());
      const double passed = second_.clock().since(filter_time_).step;
      (void)filter_.update(agreed, filtered_ ? passed : 0);
      filtered_ = true;
      commanded_ = filter_.value();
      for (Index i = 0; i < 6; ++i) commanded_(i) += correction(i);
      status = agreed_velocity_.set_velocity(commanded_);
      if (status == Status::ok) status = second_.refresh();
      if (status == Status::ok) status = solve_second();
    }
    // The levels of a refused proposal are no better here.
    if (status == Status::ok) status = proposed_;
    proposed_ = Status::ok;
    ramp_.update(status, cycle_);
    command_towards(status);
    return status;
  }
  // The answer of the second hierarchy, the joints' compensated.
  Status solve_second() noexcept {
    (void)second_.set_bounds(limits_.bounds());
    // Alone and settled, both hierarchies are the same.
    const bool same =
        !(agreement_activation() > 0) && !own_.in_transition() && !second_.in_transition();
    Status status = same ? Status::ok : second_.solve(measured_);
    answer_ = same ? own_.velocity() : second_.velocity();
    if constexpr (MobileRobot<R>) {
      if (compensation_) {
        (void)compensation_->set_bounds(limits_.bounds());
        const Status joints = compensation_->solve(second_.levels(), measured_);
        if (status == Status::ok) status = joints;
        for (Index c = 0; c < answer_.size(); ++c) answer_(c) = made_up(c, answer_);
      }
    }
    return status;
  }
  // Starting, stopping and limits.
  void command_towards(Status status) noexcept {
    Velocity& wanted = allowed_;
    const Velocity& faded = ramp_.wanted(answer_);
    for (Index c = 0; c < wanted.size(); ++c) wanted(c) = faded(c);
    const Scalar rest = static_cast<Scalar>(1 - ramp_.share());
    const Scalar whole = static_cast<Scalar>(ramp_.gain());
    const Scalar held = static_cast<Scalar>(agreement_activation());
    const bool solved = status == Status::ok && ramp_.runs();
    if (solved && rest > Scalar(0) && held > Scalar(0) &&
        second_.solve(measured_, top_level_ + 1) == Status::ok) {
      // What has not faded in yet gives way to the object: the others that hold it do not fade.
      if constexpr (MobileRobot<R>) {
        if (compensation_) {
          (void)compensation_->solve(second_.levels().first(top_level_ + 1), measured_);
        }
      }
      for (Index c = 0; c < wanted.size(); ++c) {
        wanted(c) += whole * rest * held * (made_up(c, second_.velocity()) - ramp_.from()(c));
      }
    }
    bool all = limits_.limit_base(wanted);
    if (!all && solved && !compensates() && ramp_.settled() &&
        second_.solve(measured_, detail::base_columns(robot_), command()) == Status::ok) {
      for (Index c = 0; c < wanted.size(); ++c) wanted(c) = second_.velocity()(c);
    }
    (void)limits_.limit_joints(wanted);
    take();
    // What is made up for moves as measured.
    const ColumnRange base = compensates() ? detail::base_columns(robot_) : ColumnRange{};
    for (Index c = 0; c < wanted.size(); ++c) {
      wanted(c) = base.holds(c) ? measured_(c) : velocity_(c);
    }
    const Vector6<Scalar> velocity = tool_velocity(wanted);
    for (Index i = 0; i < 6; ++i) cut_(i) = held * (velocity(i) - commanded_(i));
    // Only what the limits cut is something that the others can help with.
    if (solved && !(held < Scalar(1)) && !(whole < Scalar(1)))
      (void)agreement_.achieved(commanded_, velocity);
  }
  // Column `c` of `whole`, or of the joints that make up for the base.
  Scalar made_up(Index c, const Velocity& whole) const noexcept {
    if constexpr (MobileRobot<R>) {
      if (compensation_ && !compensation_->in_base(c)) return compensation_->velocity()(c);
    }
    return whole(c);
  }
  bool compensates() const noexcept {
    if constexpr (MobileRobot<R>) return compensation_.has_value();
    return false;
  }
  // Whether the inputs are there and are new.
  Status check(const Actions& actions, const Velocity* measured, bool needs_base,
               const InputAge& age) noexcept {
    if (actions.clock().stalled()) return Status::clock_stalled;
    if (const Status old = detail::check_age(age, hold_); old != Status::ok) return old;
    if (limits_.implausible_joint(robot_) >= 0) return Status::implausible_position;
    if (measured && measured->size() != measured_.size()) return Status::wrong_size;
    if (!actions.any_given() && !needs_base) return Status::ok;
    if (measured && !(age.velocity <= hold_)) return Status::stale_velocity;
    const ColumnRange base = detail::base_columns(robot_);
    for (Index c = 0; c < measured_.size(); ++c) {
      if (!actions.given(c) && !(needs_base && base.holds(c))) continue;
      if (!measured && base.holds(c)) return Status::missing_velocity;
      const Scalar v = measured ? (*measured)(c) : Scalar(0);
      if (!std::isfinite(v)) return Status::non_finite;
      measured_(c) = v;
    }
    return Status::ok;
  }
  // J_t ẏ, components on ⟨t⟩.
  Vector6<Scalar> tool_velocity(const Velocity& y) const noexcept {
    const auto& J = robot_.jacobian(tool_);
    auto velocity = detail::zeros<Vector6<Scalar>>(6);
    for (Index j = 0; j < robot_.dof(); ++j) {
      for (Index i = 0; i < 6; ++i) velocity(i) += J(i, j) * y(j);
    }
    return on_tool(velocity);
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
  void take() noexcept {
    for (Index c = 0; c < velocity_.size(); ++c) {
      velocity_(c) = own_.given(c) ? measured_(c) : command()(c);
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
    for (std::size_t k = 0; k < second_.hierarchy().size(); ++k) {
      for (const auto& entry : second_.hierarchy()[k]) {
        if (entry.task == &agreed_velocity_) top_entry_ = i, top_level_ = k;
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
      (void)sensitivity_.add_level(rows, level.activation, level.reference, level.scales());
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
  Actions own_, second_;
  MotionLimits<R> limits_;
  detail::CommandRamp<Scalar, R::size> ramp_, law_ramp_;
  double hold_;
  std::optional<Compensation> compensation_;
  Velocity measured_, velocity_, allowed_, answer_;
  Vector6<Scalar> commanded_ = Filled{0}, cut_ = Filled{0};
  Sensitivity sensitivity_;
  std::vector<ToolEntry> tools_;
  CycleTime own_time_, second_time_, filter_time_, law_cycle_;
  double law_time_{0};
  InputAge law_age_{-1};
  Cycle cycle_{0, 0};
  bool opened_{false}, filtered_{false};
  Status proposed_{Status::ok};
  std::size_t top_entry_{static_cast<std::size_t>(-1)}, top_level_{0}, last_tool_level_{0};
  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> extended_;
};

}  // namespace icat
