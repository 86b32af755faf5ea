// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What an `Agent` keeps to itself, for `explain`: its second hierarchy, with the agreed velocity
/// on top, is what is explained.
#pragma once

#include "icat/control/controller_inside.hpp"
#include "icat/cooperation/agent.hpp"

namespace icat::detail {

/// See control/controller_inside.hpp. No allocation.
template <class R, class G>
struct Inside<Agent<R, G>> {
  using C = Agent<R, G>;

  static const ActionSolver<R, G>& actions(const C& c) noexcept { return c.second_; }
  static const auto& ramp(const C& c) noexcept { return c.ramp_; }
  static const auto& base_ramp(const C& c) noexcept { return c.ramp_; }
  static const auto& answer(const C& c) noexcept { return c.answer_; }
  static const auto& base_answer(const C& c) noexcept { return c.answer_; }
  static const auto& bounds(const C& c) noexcept {
    if constexpr (MobileRobot<R>) {
      if (c.compensates()) return c.compensation_->options().bounds;
    }
    return c.second_.options().bounds;
  }
  static ColumnRange measured_base(const C& c) noexcept {
    if constexpr (MobileRobot<R>) {
      if (c.compensates()) return c.robot_.base_columns();
    }
    return {};
  }
  static Status status(const C& c) noexcept { return c.ramp_.status(); }
  static const auto& measured(const C& c) noexcept { return c.measured_; }
};

}  // namespace icat::detail
