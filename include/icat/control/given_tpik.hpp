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
        free_(identity<typename Solver::SquareN>(robot.dof())) {
    check_columns("the given columns", given, robot.dof());
    for (const Index c : given) set_given(c, true);
  }

  void set_given(Index column, bool given) noexcept {
    free_(column, column) = given ? Scalar(0) : Scalar(1);
    any_ = false;
    for (Index c = 0; c < free_.cols(); ++c) any_ = any_ || is_given(c);
  }
  bool is_given(Index column) const noexcept { return free_(column, column) == Scalar(0); }

  /// What is measured; the given columns of it count. Set before `solve`.
  Velocity& measured() noexcept { return measured_; }
  /// The hierarchy for the velocity measured. On bad input as `Tpik`.
  Status solve(std::span<const Level<Scalar, R::size>> levels) noexcept {
    Status status = Status::ok;
    if (any_) {
      for (Index c = 0; c < rho0_.size(); ++c) rho0_(c) = is_given(c) ? measured_(c) : Scalar(0);
      status = solver_.reset(rho0_, free_);
    } else {
      solver_.reset();
    }
    for (std::size_t k = 0; k < levels.size() && status == Status::ok; ++k) {
      status = solver_.add_level(levels[k].jacobian, levels[k].activation, levels[k].reference);
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
  typename Solver::SquareN free_;
  bool any_{false};
};

}  // namespace icat::detail
