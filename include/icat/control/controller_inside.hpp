// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What both kinds of controllers keep to themselves, read alike: for explanations.
#pragma once

#include "icat/control/parallel_controller.hpp"

namespace icat::detail {

/// See the file comment. No allocation.
struct Inside {
  template <class R, class G>
  static const ActionSolver<R, G>& actions(const Controller<R, G>& c) noexcept {
    return c.solver_;
  }
  template <class R, class G>
  static const ActionSolver<R, G>& actions(const ParallelController<R, G>& c) noexcept {
    return c.first_;
  }
  template <class R, class G>
  static const auto& ramp(const Controller<R, G>& c) noexcept {
    return c.ramp_;
  }
  template <class R, class G>
  static const auto& ramp(const ParallelController<R, G>& c) noexcept {
    return c.joints_.ramp;
  }
  /// The same of the base.
  template <class R, class G>
  static const auto& base_ramp(const Controller<R, G>& c) noexcept {
    return c.ramp_;
  }
  template <class R, class G>
  static const auto& base_ramp(const ParallelController<R, G>& c) noexcept {
    return c.base_.ramp;
  }
  template <class R, class G>
  static const auto& answer(const Controller<R, G>& c) noexcept {
    return c.answer_;
  }
  template <class R, class G>
  static const auto& answer(const ParallelController<R, G>& c) noexcept {
    return c.joints_.answer;
  }
  /// Those in force.
  template <class R, class G>
  static const auto& bounds(const Controller<R, G>& c) noexcept {
    return c.solver_.options().bounds;
  }
  template <class R, class G>
  static const auto& bounds(const ParallelController<R, G>& c) noexcept {
    return c.second_.options().bounds;
  }
  /// The base, where it moves as measured, whatever is commanded.
  template <class R, class G>
  static ColumnRange measured_base(const Controller<R, G>&) noexcept {
    return {};
  }
  template <class R, class G>
  static ColumnRange measured_base(const ParallelController<R, G>& c) noexcept {
    return c.first_.robot().base_columns();
  }
  template <class R, class G>
  static Status status(const Controller<R, G>& c) noexcept {
    return c.ramp_.status();
  }
  template <class R, class G>
  static Status status(const ParallelController<R, G>& c) noexcept {
    const Status base = c.base_.ramp.status(), joints = c.joints_.ramp.status();
    const bool fine = joints == Status::ok || joints == Status::not_started;
    return fine && base != Status::not_started ? base : joints;
  }
  template <class C>
  static const auto& measured(const C& c) noexcept {
    return c.measured_;
  }
};

}  // namespace icat::detail
