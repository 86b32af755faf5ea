// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Settings of an exchange between agents, see agreement.hpp.
#pragma once

#include <optional>

#include "icat/cooperation/fusion.hpp"

namespace icat {

/// What an agent does that has heard nothing for too long.
enum class Fallback {
  stop,   ///< tool velocity 0
  alone,  ///< its own proposal, as if it were the only one
};

/// Settings of an exchange, with defaults. All agents need the same but `index`.
template <class Scalar>
struct AgreementOptions {
  std::size_t agents{2};  ///< how many, this one included, 2 … 1000
  std::size_t index{0};   ///< which of them this one is
  std::optional<FusionPolicy<Scalar>> policy = std::nullopt;  ///< f of Eq. (29); none: the mean
  bool spans{false};                                          ///< exchange them, see fusion.hpp
  bool latest{false};  ///< fuse one's own of this cycle with the last heard, see agreement.hpp
  double hold{1};      ///< s, > 0
  Fallback fallback{Fallback::stop};  ///< after that
  double fade{1};                     ///< s, > 0: into the fallback and back
  std::size_t ahead{4};   ///< rounds that a message may be ahead of this agent's own, 1 … 7
  Scalar max_linear{5};   ///< m/s, > 0: a faster proposal is implausible
  Scalar max_angular{5};  ///< rad/s, > 0: the same
  Scalar max_span{2};  ///< of ‖2T − I‖₂, ≥ 1: a projector has 1, two tasks that fade ≤ 5/3
  bool pace{
      false};  ///< slow down for one that cannot follow: all agents or none, see agreement.hpp
  double recovery{0.01};  ///< of the pace, per round at most, 0 … 1
};

namespace detail {

/// Rounds that may be open at once.
inline constexpr std::size_t agreement_rounds = 8;

/// @throws std::invalid_argument on settings out of range.
template <class Scalar>
const AgreementOptions<Scalar>& validated(const AgreementOptions<Scalar>& o) {
  if (o.agents < 2 || o.agents > 1000) {
    invalid("Agreement: agents must be in [2, 1000], got ", o.agents);
  }
  if (o.index >= o.agents) {
    invalid("Agreement: index must be < ", o.agents, ", got ", o.index);
  }
  if (o.policy && !o.policy->fuse) invalid("Agreement: the policy is empty");
  if (o.policy && o.policy->agents != 0 && o.policy->agents != o.agents) {
    invalid("Agreement: a policy for ", o.policy->agents, " agents, there are ", o.agents);
  }
  require_positive("Agreement", "hold", o.hold);
  require_positive("Agreement", "fade", o.fade);
  if (o.ahead < 1 || o.ahead >= agreement_rounds) {
    invalid("Agreement: ahead must be in [1, ", agreement_rounds - 1, "], got ", o.ahead);
  }
  require_positive("Agreement", "max_linear", o.max_linear);
  require_positive("Agreement", "max_angular", o.max_angular);
  if (!(o.max_span >= Scalar(1) && o.max_span <= Scalar(1e3))) {
    invalid("Agreement: max_span must be in [1, 1000], got ", o.max_span);
  }
  if (!(o.recovery > 0 && o.recovery <= 1)) {
    invalid("Agreement: recovery must be > 0 and <= 1, got ", o.recovery);
  }
  return o;
}

}  // namespace detail

}  // namespace icat
