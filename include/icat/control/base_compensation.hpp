// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// TPIK 2 of [MARIS, III-B9]: all columns of the base move as measured, and the joints compensate
/// the tracking error of the base. For a joint loop that is faster than the solver it is also
/// available as the arm law in the base's velocity [Coop, Eq. (24)]: q̇ = ρ̃ + P v.
#pragma once

#include <cmath>

#include "icat/control/given_tpik.hpp"
#include "icat/tpik/parametric_tpik.hpp"

namespace icat {

/// See the file comment. It solves the levels of a controller that is stepped by somebody else.
/// After construction nothing allocates or throws.
template <MobileRobot R, class Regularization = BellRegularization<typename R::Scalar>>
class BaseCompensation {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// The solver.
  using Solver = Tpik<Scalar, R::size, Regularization>;
  /// ẏ, n.
  using Velocity = typename Solver::VectorN;
  /// Velocities of the columns that are not the base's, in their order.
  using JointVelocity = Vector<Scalar, Eigen::Dynamic>;

  /// `given`: columns besides the base's that are not commanded.
  /// `levels`: those that will be solved, for their sizes.
  /// @throws std::invalid_argument on bad options, or a robot without joints.
  [[gnu::cold]] BaseCompensation(const R& robot, const typename Solver::Options& options,
                                 const Columns& given,
                                 std::span<const Level<Scalar, R::size>> levels)
      : tpik_(robot, options, given),
        base_(robot.base_columns()),
        law_(joints(robot), {options.regularization, options.projection_weight}),
        bounds_{detail::zeros<JointVelocity>(robot.dof() - base_.count),
                detail::zeros<JointVelocity>(robot.dof() - base_.count)},
        joint_velocity_(detail::zeros<JointVelocity>(robot.dof() - base_.count)),
        wanted_(joint_velocity_) {
    for (Index c = 0; c < robot.dof(); ++c) {
      if (in_base(c)) {
        tpik_.set_given(c, true);
        continue;
      }
      columns_.push_back(c);
    }
    Index rows = 0;
    for (const auto& level : levels) rows = std::max(rows, level.jacobian.rows());
    split_.resize(rows, joint_velocity_.size() + 6);
    reference_.resize(rows);
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      bounds_.lower(static_cast<Index>(k)) = options.bounds.lower_of(columns_[k]);
      bounds_.upper(static_cast<Index>(k)) = options.bounds.upper_of(columns_[k]);
    }
  }

  /// Column `column` is given from now on, or no more; those of the base always are.
  void set_given(Index column, bool given) noexcept {
    if (!in_base(column)) tpik_.set_given(column, given);
  }
  /// Whether column `column` is the base's.
  bool in_base(Index column) const noexcept { return base_.holds(column); }

  /// TPIK 2 on `levels` for the velocity `measured`, n, of which the base's and the given columns
  /// count. One that is needed and not finite: zero velocity.
  Status solve(std::span<const Level<Scalar, R::size>> levels, const Velocity& measured) noexcept {
    const Status status = take(measured);
    return status == Status::ok ? tpik_.solve(levels) : status;
  }
  /// Bounds of `solve` from now on, n, within those of the options.
  Status set_bounds(const VelocityBounds<Scalar, R::size>& bounds) noexcept {
    return tpik_.set_bounds(bounds);
  }
  /// ẏ of the last `solve`; the base's columns hold what was measured.
  const Velocity& velocity() const noexcept { return tpik_.solver().velocity(); }
  /// Of the last `solve`.
  const TpikReport<Scalar>& report() const noexcept { return tpik_.solver().report(); }
  /// Of the solver, with the bounds in force.
  const typename Solver::Options& options() const noexcept { return tpik_.solver().options(); }

  /// The law for `levels` and the velocity `measured`, n, of which the given joints count: until
  /// the next law they move like that. After it `follow_law` answers every new measurement of the
  /// base without solving. A velocity that is needed and not finite: a law of zero velocity.
  Status solve_law(std::span<const Level<Scalar, R::size>> levels,
                   const Velocity& measured) noexcept {
    const Status status = take(measured);
    return status == Status::ok ? run_law(levels) : status;
  }
  /// q̇ = ρ̃ + P v of the last `solve_law`, for the base's velocity `measured`; scaled as a whole
  /// into the velocity bounds. Zero where `measured` is of the wrong size, or it or what follows
  /// from it is not finite or faster than `implausible_speed`.
  template <class V>
  const JointVelocity& joint_velocity(const Eigen::MatrixBase<V>& measured) noexcept {
    detail::fill(joint_velocity_, Scalar(0));
    if (measured.size() != base_.count) return joint_velocity_;
    const auto rho = law_.rho();
    const auto P = law_.P();
    for (Index i = 0; i < wanted_.size(); ++i) {
      wanted_(i) = rho(i);
      for (Index j = 0; j < base_.count; ++j) wanted_(i) += P(i, j) * measured(j);
      // Nothing may be commanded there, not even what rounding leaves.
      if (tpik_.is_given(columns_[static_cast<std::size_t>(i)])) wanted_(i) = Scalar(0);
    }
    if (detail::check_speeds(wanted_.size(), wanted_.data()) != Status::ok) return joint_velocity_;
    const Index n = wanted_.size();
    const Scalar scale = bounds_.scale(n, joint_velocity_.data(), wanted_.data());
    bounds_.advance(n, joint_velocity_.data(), wanted_.data(), scale);
    return joint_velocity_;
  }
  /// The same into the columns of `velocity`, n, that are not the base's; of `measured`, n, the
  /// base's count.
  void follow_law(const Velocity& measured, Velocity& velocity) noexcept {
    Eigen::Matrix<Scalar, Eigen::Dynamic, 1, 0, 6, 1> v(base_.count);
    for (Index j = 0; j < base_.count; ++j) v(j) = measured(base_.first + j);
    (void)joint_velocity(v);
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      velocity(columns_[k]) = joint_velocity_(static_cast<Index>(k));
    }
  }

 private:
  using Law = ParametricTpik<Scalar, Eigen::Dynamic, 6, Regularization>;

  Status take(const Velocity& measured) noexcept {
    if (measured.size() != tpik_.measured().size()) return Status::wrong_size;
    detail::copy(measured, tpik_.measured());
    return Status::ok;
  }
  Status run_law(std::span<const Level<Scalar, R::size>> levels) noexcept {
    const Index l = joint_velocity_.size();
    law_.reset();
    Status status = Status::ok;
    for (std::size_t k = 0; k < levels.size() && status == Status::ok; ++k) {
      const auto& level = levels[k];
      const Index rows = level.jacobian.rows();
      if (rows > split_.rows()) return Status::wrong_size;
      for (Index i = 0; i < rows; ++i) {
        // What a given joint does is known: it moves from the Jacobian to the reference.
        reference_(i) = level.reference(i);
        for (Index j = 0; j < l; ++j) {
          const Index c = columns_[static_cast<std::size_t>(j)];
          const bool given = tpik_.is_given(c);
          split_(i, j) = given ? Scalar(0) : level.jacobian(i, c);
          if (given) reference_(i) -= level.jacobian(i, c) * tpik_.measured()(c);
        }
        for (Index j = 0; j < 6; ++j) {
          split_(i, l + j) = j < base_.count ? level.jacobian(i, base_.first + j) : Scalar(0);
        }
      }
      status = law_.add_level(split_.topRows(rows), level.activation, reference_.head(rows),
                              level.scales());
    }
    const Status closing = law_.minimize_velocity();
    return status == Status::ok ? closing : status;
  }
  static Index joints(const R& robot) {
    const Index n = robot.dof() - robot.base_columns().count;
    if (n < 1) detail::invalid("BaseCompensation: the robot has no joints");
    if (robot.base_columns().count > 6) {
      detail::invalid("BaseCompensation: a base of ", robot.base_columns().count, " columns");
    }
    return n;
  }

  detail::GivenTpik<R, Regularization> tpik_;
  ColumnRange base_;
  List<Index> columns_;  // those that are not the base's
  Law law_;
  VelocityBounds<Scalar, Eigen::Dynamic> bounds_;
  JointVelocity joint_velocity_, wanted_, reference_;
  Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic> split_;
};

}  // namespace icat
