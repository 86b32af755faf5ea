// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What controllers keep to themselves, read alike: for explanations. `Agent` has its own in
/// cooperation/agent_inside.hpp.
#pragma once

#include "icat/control/parallel_controller.hpp"

namespace icat::detail {

/// See the file comment. No allocation.
template <class R, class G>
struct Inside<Controller<R, G>> {
  using C = Controller<R, G>;

  /// The levels that are solved.
  static const ActionSolver<R, G>& actions(const C& c) noexcept { return c.solver_; }
  static const auto& ramp(const C& c) noexcept { return c.ramp_; }
  /// The same of the base.
  static const auto& base_ramp(const C& c) noexcept { return c.ramp_; }
  static const auto& answer(const C& c) noexcept { return c.answer_; }
  /// The same of the base, where that is measured.
  static const auto& base_answer(const C& c) noexcept { return c.answer_; }
  /// Those in force.
  static const auto& bounds(const C& c) noexcept { return c.solver_.options().bounds; }
  /// The base, where it moves as measured, whatever is commanded.
  static ColumnRange measured_base(const C&) noexcept { return {}; }
  static Status status(const C& c) noexcept { return c.ramp_.status(); }
  static const auto& measured(const C& c) noexcept { return c.measured_; }
};

/// See the file comment. No allocation.
template <class R, class G>
struct Inside<ParallelController<R, G>> {
  using C = ParallelController<R, G>;

  static const ActionSolver<R, G>& actions(const C& c) noexcept { return c.first_; }
  static const auto& ramp(const C& c) noexcept { return c.joints_.ramp; }
  static const auto& base_ramp(const C& c) noexcept { return c.base_.ramp; }
  static const auto& answer(const C& c) noexcept { return c.joints_.answer; }
  static const auto& base_answer(const C& c) noexcept { return c.first_.velocity(); }
  static const auto& bounds(const C& c) noexcept { return c.second_.options().bounds; }
  static ColumnRange measured_base(const C& c) noexcept { return c.first_.robot().base_columns(); }
  static Status status(const C& c) noexcept {
    const Status base = c.base_.ramp.status(), joints = c.joints_.ramp.status();
    const bool fine = joints == Status::ok || joints == Status::not_started;
    return fine && base != Status::not_started ? base : joints;
  }
  static const auto& measured(const C& c) noexcept { return c.measured_; }
};

}  // namespace icat::detail
