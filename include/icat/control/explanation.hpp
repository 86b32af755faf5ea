// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The explanation of a task: the rate that it asks for, the rate that it gets, and the causes of
/// the difference, see explain.hpp. Ours; the papers measure no losses.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "icat/core/types.hpp"

namespace icat {

/// Causes of a loss of a task's rate, in the order in which they are measured.
enum class LossCause : std::uint8_t {
  singular,        ///< no velocity of the robot moves the rows that way
  regularization,  ///< nearly so: only a very fast velocity does
  activation,      ///< of its own rows, between 0 and 1
  transition,      ///< its phase activation is between 0 and 1: an action is being entered or left
  given,           ///< columns that are not commanded, such as a joint whose motor died
  level,           ///< a level of higher priority
  equal,           ///< tasks of the same priority
  below,           ///< lower levels, where rows act in part or are regularized, and least velocity
  refused,         ///< the solver stopped at a level with bad input, this one or one above it
  base,            ///< the base moves as measured, and TPIK 2 has the joints alone
  bound,           ///< velocity bounds within the solver: positions and velocities of joints
  held,            ///< the command is for an older state: input was refused, or another rate
  ramp,            ///< starting, stopping, or going to zero after a fault
  limit            ///< motion limits on the command
};

/// Which limit a joint is at.
enum class LimitKind : std::uint8_t { none, position, velocity, acceleration };

/// The verdict on a task.
enum class Verdict : std::uint8_t {
  off,      ///< not in the action that runs
  idle,     ///< no row is active: its objective holds
  met,      ///< it gets what it wants
  fades,    ///< it acts in part: starting, stopping, entering, or near its threshold
  yields,   ///< to tasks of higher or equal priority, as ordered
  limited,  ///< a joint or the base is as fast, or speeds up as fast, as it may, or is driven off
  blocked,  ///< by what does not pass: a posture, the end of a joint, a column that is not
            ///< commanded
  faulty    ///< input was refused, is old, or the clock stands still
};

/// A part of a task's loss.
template <class Scalar>
struct LossShare {
  LossCause cause{LossCause::below};  ///< who
  LimitKind limit{};                  ///< of `bound` and `limit`, where a column is named
  Scalar amount{0};                   ///< in the task's unit; negative where it helped
  Index level{-1};             ///< of `level`, `equal` and `refused`: which one of the hierarchy
  std::string_view task = {};  ///< there: the task whose row counts most; it must live on
  Index row{-1};               ///< that row of that task, from 0
  Scalar activation{0};        ///< of that row, in (0, 1], phase activation included
  /// Of ẏ: the column that counts most, −1: none. Of `level` and `equal` in that row; of `bound`
  /// and `limit` the one that is at its bound; else in the task.
  Index column{-1};
  bool alone{false};  ///< of `level` and `equal`: the row moves that column alone
};

/// Everything about a task on a level of the unified hierarchy. Rates are norms over the rows, each
/// times its own activation aⁱ. The unit is that of the rows; where some are in metres and others
/// not (a pose), those in metres are divided by the characteristic length L, and the unit is 1/s.
template <class Scalar>
struct TaskExplanation {
  std::string_view task = {};  ///< its name; it must live on
  Index level{0};              ///< of the hierarchy, 0 the highest
  Index rows{0};               ///< how many
  Index active_rows{0};        ///< with aⁱ > 0
  Scalar phase{0};             ///< aᵖ
  Verdict verdict{};           ///< in a word
  bool alarm{false};           ///< an operator should look at it
  Scalar wanted{0};            ///< ‖aⁱ ẋ̄‖
  Scalar achieved{0};          ///< ‖aⁱ J ẏ‖, ẏ as commanded and measured
  Scalar loss{0};              ///< ‖aⁱ (ẋ̄ − J ẏ)‖, the sum of the shares
  Scalar position_left{0};     ///< m, NaN: the task has no such error
  Scalar angle_left{0};        ///< rad, likewise
  bool half_turn{false};       ///< the error is within 0.01 rad of π
  /// In the order of `LossCause`; a higher level each. They live as long as the `Explainer`.
  std::span<const LossShare<Scalar>> shares = {};

  /// The largest share; null where there is none.
  const LossShare<Scalar>* most() const noexcept {
    const LossShare<Scalar>* largest = nullptr;
    for (const auto& share : shares) {
      if (!largest || share.amount > largest->amount) largest = &share;
    }
    return largest;
  }
  /// Part of what it wants that it gets, in [0, 1]: 1 − loss / wanted; 1 where it wants nothing.
  Scalar fraction() const noexcept {
    if (!(wanted > Scalar(0))) return Scalar(1);
    const Scalar part = Scalar(1) - loss / wanted;
    return part > Scalar(0) ? part : Scalar(0);
  }
};

/// A few words for a log. No allocation.
constexpr const char* describe(LossCause cause) noexcept {
  switch (cause) {
    case LossCause::singular:
      return "singular posture or out of reach";
    case LossCause::regularization:
      return "close to a singular posture";
    case LossCause::activation:
      return "its own activation";
    case LossCause::transition:
      return "change of action";
    case LossCause::given:
      return "columns that are not commanded";
    case LossCause::level:
      return "higher priority";
    case LossCause::equal:
      return "equal priority";
    case LossCause::below:
      return "lower priority";
    case LossCause::refused:
      return "bad input of a task";
    case LossCause::base:
      return "motion of the base";
    case LossCause::bound:
      return "limit of a joint";
    case LossCause::held:
      return "an older command";
    case LossCause::ramp:
      return "start or stop";
    case LossCause::limit:
      return "motion limit";
  }
  return "unknown cause";
}

}  // namespace icat
