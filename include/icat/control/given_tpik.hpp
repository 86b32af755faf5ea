// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A TPIK of which some columns are given: they move as measured, whatever is commanded, and the
/// others are chosen with that known [Coop, Eq. (31)].
///
///     ρ₀ = the measured velocity in the given columns, 0 elsewhere;  Q₀ = I without their diagonal
#pragma once

#include <span>

#include "icat/action/level_stack.hpp"
#include "icat/tpik/tpik.hpp"

namespace icat::detail {

/// See the file comment. Construction allocates and throws; nothing else does.
template <Robot R, class Regularization>
class GivenTpik {
 public:
  using Scalar = typename R::Scalar;
  using Solver = Tpik<Scalar, R::size, Regularization>;
  using Velocity = typename Solver::VectorN;

  [[gnu::cold]] GivenTpik(const R& robot, const typename Solver::Options& options,
                          const Columns& given)
      : solver_(make<Solver>(robot.dof(), options)),
        measured_(zeros<Velocity>(robot.dof())),
        rho0_(measured_),
        start_(identity<typename Solver::SquareN>(robot.dof())),
        given_(static_cast<std::size_t>(robot.dof())),
        fixed_(options.bounds),
        bounds_{measured_, measured_} {
    check_columns("the given columns", given, robot.dof());
    for (const Index c : given) set_given(c, true);
  }

  void set_given(Index column, bool given) noexcept {
    given_[static_cast<std::size_t>(column)] = given;
    any_ = false;
    for (const bool is : given_) any_ = any_ || is;
  }
  bool is_given(Index column) const noexcept { return given_[static_cast<std::size_t>(column)]; }

  bool any_given() const noexcept { return any_; }
  /// Bounds from now on, within those of the options.
  Status set_bounds(const VelocityBounds<Scalar, R::size>& bounds) noexcept {
    for (Index c = 0; c < rho0_.size(); ++c) {
      bounds_.lower(c) = std::max(bounds.lower_of(c), fixed_.lower_of(c));
      bounds_.upper(c) = std::min(bounds.upper_of(c), fixed_.upper_of(c));
    }
    return solver_.set_bounds(bounds_);
  }

  /// What is measured; the given columns of it count. Set before `solve`.
  Velocity& measured() noexcept { return measured_; }
  /// The hierarchy for the velocity measured. On bad input as `Tpik`.
  Status solve(std::span<const Level<Scalar, R::size>> levels) noexcept {
    return solve(levels, ColumnRange{}, measured_);
  }
  /// The same where the columns `moving` move as in `as`.
  [[gnu::noinline]] Status solve(std::span<const Level<Scalar, R::size>> levels, ColumnRange moving,
                                 const Velocity& as) noexcept {
    Status status = Status::ok;
    if (any_ || moving.count > 0) {
      for (Index c = 0; c < rho0_.size(); ++c) {
        const bool moves = moving.holds(c);
        rho0_(c) = is_given(c) ? measured_(c) : moves ? as(c) : Scalar(0);
        start_(c, c) = is_given(c) || moves ? Scalar(0) : Scalar(1);
      }
      status = solver_.reset(rho0_, start_);
    } else {
      solver_.reset();
    }
    for (std::size_t k = 0; k < levels.size() && status == Status::ok; ++k) {
      status = solver_.add_level(levels[k].jacobian, levels[k].activation, levels[k].reference,
                                 levels[k].scales());
    }
    const Status closing = solver_.minimize_velocity();
    return status == Status::ok ? closing : status;
  }
  const Solver& solver() const noexcept { return solver_; }

  /// A solver of static or dynamic size.
  template <class S>
  static S make(Index dof, const typename S::Options& options) {
    if constexpr (std::is_constructible_v<S, Index, const typename S::Options&>) {
      return S(dof, options);
    } else {
      return S(options);
    }
  }

 private:
  Solver solver_;
  Velocity measured_, rho0_;
  typename Solver::SquareN start_;  // diagonal
  List<bool> given_;
  VelocityBounds<Scalar, R::size> fixed_, bounds_;
  bool any_{false};
};

}  // namespace icat::detail
