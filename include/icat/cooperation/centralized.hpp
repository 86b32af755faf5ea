// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The centralised baseline of [Coop, IV]: one solver for all robots that hold the object.
///
///     ẏ = [ẏ_1; …; ẏ_N],   G = [J_1 −J_2 ; J_2 −J_3 ; …],   G ẏ = 0     [Coop, Eq. (27)]
///
/// with J_i of the shared frame, components on itself,
///
///     Q₀ = I − a Gᵀ (G Gᵀ)⁻¹ G
///
/// `a` = 1 starts the iteration from the projector onto ker(G); between 0 and 1 the grasp's
/// constraint fades. The robots' hierarchies are merged level by level. It needs all states in one
/// place, which no acoustic modem can provide. It serves as a baseline for comparison, has no
/// limits but the solver's bounds, and does not scale rows in metres.
#pragma once

#include <vector>

#include "icat/action/level_stack.hpp"
#include "icat/control/command_ramp.hpp"
#include "icat/math/spatial_algebra.hpp"
#include "icat/tpik/tpik.hpp"

namespace icat {

/// See the file comment. After construction nothing allocates or throws.
template <FramedRobot R, class Regularization = BellRegularization<typename R::Scalar>>
class CentralizedController {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// ẏ of one robot.
  using Velocity = Vector<Scalar, R::size>;
  /// One robot and its actions; refers to a robot and tasks of the caller's.
  struct Member {
    std::reference_wrapper<const R> robot;  ///< the caller's
    FrameId tool;                           ///< its frame that is the object's
    std::vector<Action<R>> actions;         ///< the same names for all robots
  };
  /// Options of the solver; velocity bounds are those of one robot.
  using Options = typename Tpik<Scalar, R::size, Regularization>::Options;

  /// At least two robots with hierarchies of equally many levels. All are fully actuated.
  /// @throws std::invalid_argument on bad actions or options. Allocates.
  CentralizedController(const std::vector<Member>& members, const Options& options)
      : tpik_(total_dof(members), stacked(options, members)),
        ramp_(tpik_.dof(), TimeOptions{}),
        command_(detail::zeros<Rows>(tpik_.dof())) {
    for (const auto& m : members) {
      tools_.push_back(m.tool);
      velocities_.push_back(detail::zeros<Velocity>(m.robot.get().dof()));
      parts_.emplace_back(m.robot.get(), m.actions, TimeOptions{}.max_step, Scalar(1));
      for (const auto& action : m.actions) {
        if (parts_.front().has(action.name) && m.actions.size() == members[0].actions.size()) {
          continue;
        }
        detail::invalid("CentralizedController: all robots need the same actions, robot ",
                        parts_.size() - 1, " has '", action.name, "'");
      }
      if (parts_.back().levels().size() != parts_.front().levels().size()) {
        detail::invalid("CentralizedController: hierarchies of ", parts_.front().levels().size(),
                        " and ", parts_.back().levels().size(), " levels");
      }
    }
    const Index n = tpik_.dof();
    for (std::size_t k = 0; k < parts_.front().levels().size(); ++k) {
      Index rows = 0;
      for (const auto& part : parts_) rows += part.levels()[k].jacobian.rows();
      levels_.push_back({Matrix::Zero(rows, n), Rows::Zero(rows), Rows::Zero(rows), {}});
    }
    const Index constraints = 6 * static_cast<Index>(members.size() - 1);
    G_ = Matrix::Zero(constraints, n);
    Q0_ = Matrix::Zero(n, n);
    rho0_ = Rows::Zero(n);
  }

  /// As `Controller::start`, for all; a refusal changes nothing.
  Status start(std::string_view action, double time) noexcept {
    const Status status = all([&](auto& part) { return part.start(action, time); });
    if (status == Status::ok) ramp_.start();
    return status;
  }
  /// As `Controller::switch_to`, for all; a refusal changes nothing.
  Status switch_to(std::string_view action, double time, double duration) noexcept {
    if (!(duration > 0.0) || !std::isfinite(duration)) return Status::invalid_duration;
    const bool runs = !ramp_.rests();
    const Status status = all([&](auto& part) {
      return runs ? part.switch_to(action, time, duration) : part.start(action, time);
    });
    if (status == Status::ok) ramp_.resume(duration, command_, pending());
    return status;
  }

  /// One control cycle. `firmness` a in [0, 1]: 1 while the object is held, 0 without it. Bad input
  /// as in `Controller::step`.
  Status step(double time, Scalar firmness) noexcept {
    if (!(firmness >= Scalar(0) && firmness <= Scalar(1))) return Status::activation_out_of_range;
    Status status = all([&](auto& part) { return part.update(time); });
    const StepClock& clock = parts_.front().clock();
    const Cycle now = clock.since(time_);
    if (status == Status::not_started) return status;
    if (status == Status::ok && clock.stalled()) status = Status::clock_stalled;
    if (status == Status::ok) status = solve(firmness);
    ramp_.update(status, now);
    const Rows& wanted = ramp_.wanted(tpik_.velocity());
    Index from = 0;
    for (auto& velocity : velocities_) {
      for (Index c = 0; c < velocity.size(); ++c) {
        command_(from) = wanted(from);
        velocity(c) = command_(from++);
      }
    }
    return status;
  }

  /// ẏ of robot `index` [q̇; v̄].
  const Velocity& velocity(std::size_t index) const noexcept { return velocities_[index]; }
  /// Numbers that go between a robot and whoever solves for all, in the last cycle: Jacobian,
  /// reference and activation of each row that is active, the tool's Jacobian, and ẏ back.
  std::size_t exchanged_numbers(std::size_t index) const noexcept {
    const auto n = static_cast<std::size_t>(robot(index).dof());
    std::size_t numbers = 6 * n + n;
    for (const auto& level : parts_[index].levels()) {
      for (Index i = 0; i < level.activation.size(); ++i) {
        if (level.activation(i) > Scalar(0)) numbers += n + 2;
      }
    }
    return numbers;
  }
  /// Report of the solver; levels are those of the robots' hierarchies.
  const TpikReport<Scalar>& report() const noexcept { return tpik_.report(); }

 private:
  // Of a stamp without a cycle.
  double pending() const noexcept { return parts_.front().clock().elapsed() - time_.last; }
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  using Rows = Vector<Scalar, Eigen::Dynamic>;
  using Solver = Tpik<Scalar, Eigen::Dynamic, Regularization>;

  static Index total_dof(const std::vector<Member>& members) {
    if (members.size() < 2) detail::invalid("CentralizedController: needs at least two robots");
    Index n = 0;
    for (const auto& m : members) n += m.robot.get().dof();
    return n;
  }
  static typename Solver::Options stacked(const Options& options,
                                          const std::vector<Member>& members) {
    typename Solver::Options o;
    o.regularization = options.regularization;
    o.projection_weight = options.projection_weight;
    o.saturation = options.saturation;
    const auto copies = static_cast<Index>(members.size());
    o.bounds = {options.bounds.lower.replicate(copies, 1),
                options.bounds.upper.replicate(copies, 1)};
    return o;
  }
  template <class F>
  Status all(F f) noexcept {
    Status first = Status::ok;
    for (auto& part : parts_) {
      const Status status = f(part);
      if (first == Status::ok) first = status;
    }
    return first;
  }

  Status solve(Scalar firmness) noexcept {
    form_start(firmness);
    Status status = tpik_.reset(rho0_, Q0_);
    for (std::size_t k = 0; k < levels_.size() && status == Status::ok; ++k) {
      auto& level = levels_[k];
      Index row = 0, column = 0;
      for (std::size_t i = 0; i < parts_.size(); ++i) {
        const auto& own = parts_[i].levels()[k];
        const Index rows = own.jacobian.rows();
        level.jacobian.block(row, column, rows, own.jacobian.cols()) = own.jacobian;
        level.activation.segment(row, rows) = own.activation;
        level.reference.segment(row, rows) = own.reference;
        row += rows;
        column += own.jacobian.cols();
      }
      status = tpik_.add_level(level.jacobian, level.activation, level.reference);
    }
    const Status closing = tpik_.minimize_velocity();
    return status == Status::ok ? closing : status;
  }

  /// Q₀, see the file comment: I − a BᵀB with an orthonormal basis B of the rows of G.
  void form_start(Scalar firmness) noexcept {
    detail::fill(G_, Scalar(0));
    Index column = 0;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const auto& J = robot(i).jacobian(tools_[i]);
      const Matrix3<Scalar> R_t = detail::rotation(Pose<Scalar>(robot(i).pose(tools_[i])));
      const Index row = 6 * static_cast<Index>(i);
      for (Index c = 0; c < J.cols(); ++c) {
        for (Index part = 0; part < 6; part += 3) {
          const Vector3<Scalar> x = detail::transposed_times(R_t, detail::column3(J, part, c));
          if (i + 1 < parts_.size()) detail::set_column3(G_, row + part, column + c, x);
          if (i == 0) continue;
          detail::set_column3(G_, row - 6 + part, column + c, detail::scaled(x, Scalar(-1)));
        }
      }
      column += J.cols();
    }
    detail::set_identity(Q0_);
    if (!(firmness > Scalar(0))) return;
    for (Index k = 0; k < G_.rows(); ++k) {
      if (!orthonormalize(k)) continue;
      for (Index j = 0; j < Q0_.cols(); ++j) {
        for (Index i = 0; i < Q0_.rows(); ++i) Q0_(i, j) -= firmness * G_(k, i) * G_(k, j);
      }
    }
  }
  /// Makes row `k` of G orthogonal to those before it and of length 1; false, and zero, where
  /// nothing but rounding is left of it.
  bool orthonormalize(Index k) noexcept {
    const Scalar before = G_.row(k).norm();
    // Twice: where little of the row remains, the first pass leaves rounding of all of it.
    for (int pass = 0; pass < 2; ++pass) {
      for (Index l = 0; l < k; ++l) {
        Scalar dot(0);
        for (Index j = 0; j < G_.cols(); ++j) dot += G_(k, j) * G_(l, j);
        for (Index j = 0; j < G_.cols(); ++j) G_(k, j) -= dot * G_(l, j);
      }
    }
    const Scalar rest = G_.row(k).norm();
    const bool kept = rest > std::sqrt(std::numeric_limits<Scalar>::epsilon()) * before;
    for (Index j = 0; j < G_.cols(); ++j) G_(k, j) = kept ? G_(k, j) / rest : Scalar(0);
    return kept;
  }

  const R& robot(std::size_t i) const noexcept { return parts_[i].robot(); }

  std::vector<FrameId> tools_;
  std::vector<LevelStack<R>> parts_;
  Solver tpik_;
  detail::CommandRamp<Scalar, Eigen::Dynamic> ramp_;
  Rows command_;
  CycleTime time_;
  std::vector<Level<Scalar, Eigen::Dynamic>> levels_;
  Matrix G_, Q0_;
  Rows rho0_;
  std::vector<Velocity> velocities_;
};

}  // namespace icat
