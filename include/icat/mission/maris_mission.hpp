// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The mission of the trials [MARIS, III-A]: survey until the vision detects the object for the
/// first time, grasp it, success seen in the currents of the hand's motors, take the arm to a
/// posture for transportation. The paper says no more; phases, retries, limits of time and reasons
/// of failure are ours:
///
///     phase      action   ends by                          what follows
///     survey     survey   object detected                  approach
///                         time                             not found
///     approach   grasp    at_grasp for 0.5 s               close
///                         object lost                      survey, 3 times, then lost
///                         time                             not converged
///     close      grasp    grasp closed                     carry
///                         grasp empty, time                empty grasp
///                         grasp slipped                    slipped
///     carry      carry    at_posture                       done
///                         grasp slipped, grasp empty       slipped
///                         time                             not converged
///     done       carry    the mission
///     failures   none     the mission
///
/// and from the first four: out of bounds → bounds, fault → fault.
#pragma once

#include "icat/mission/mission.hpp"

namespace icat {

/// Conditions and limits of `maris_mission`.
struct MarisMissionOptions {
  /// The tool is where it is to close, such as 2 cm and 5 degrees from its goal.
  std::function<bool()> at_grasp = {};
  /// The arm has the posture for transportation, such as each joint to 0.05 rad.
  std::function<bool()> at_posture = {};
  double settle = 0.5;           ///< s, > 0: so long `at_grasp` has to hold
  double survey_limit = 600;     ///< s
  double approach_limit = 120;   ///< s
  double close_limit = 10;       ///< s
  double carry_limit = 60;       ///< s
  int surveys_after_a_loss = 3;  ///< at most, > 0
  double fade = 2;               ///< s
  double max_step = 1;           ///< s, see `Mission`
};

/// Why a grasp failed. For a log there is `Mission::phase`, whose name says the same.
enum class GraspFailure {
  none,           ///< it did not, or not yet
  not_found,      ///< no detection within the time of the survey
  lost,           ///< lost from sight more often than surveys are allowed
  not_converged,  ///< the tool or the arm did not come to its goal in time
  empty_grasp,    ///< the hand closed on nothing
  slipped,        ///< the hand became empty on the way
  bounds,         ///< the vehicle left where it may be
  fault           ///< of the robot
};

namespace detail {

// The phases of failure, in the order of GraspFailure.
inline constexpr const char* grasp_failures[] = {
    "", "not found", "lost", "not converged", "empty grasp", "slipped", "bounds", "fault"};

}  // namespace detail

/// The mission of the file comment. Its events: "object detected", at the first detection that is
/// sure; "object lost", not seen for 3 s or so, which is for the vision to judge; "grasp closed",
/// "grasp empty" and "grasp slipped" from the hand (control/grasp_detector.hpp); "out of bounds"
/// and "fault" from the operator or a supervising program. The mission itself detects that a time
/// limit has passed or the posture is reached. Its actions: "survey", "grasp", "carry".
/// @throws std::invalid_argument without conditions, or on numbers out of range (see `Mission`).
[[gnu::cold]] inline Mission maris_mission(const MarisMissionOptions& options) {
  const auto& o = options;
  if (o.surveys_after_a_loss < 1) {
    detail::invalid("maris_mission: surveys_after_a_loss must be > 0, got ",
                    o.surveys_after_a_loss);
  }
  // When the approach begins, the errors of its tasks are still those of before.
  detail::require_positive("maris_mission", "settle", o.settle);
  std::vector<Phase> phases{
      {.name = "survey",
       .action = "survey",
       .fade = o.fade,
       .time_limit = o.survey_limit,
       .on_timeout = "not found",
       .on = {{.event = "object detected", .to = "approach"}}},
      {.name = "approach",
       .action = "grasp",
       .fade = o.fade,
       .until = o.at_grasp,
       .hold = o.settle,
       .then = "close",
       .time_limit = o.approach_limit,
       .on_timeout = "not converged",
       .on = {{.event = "object lost",
               .to = "survey",
               .times = o.surveys_after_a_loss,
               .otherwise = "lost"}}},
      {.name = "close",
       .action = "grasp",
       .fade = o.fade,
       .time_limit = o.close_limit,
       .on_timeout = "empty grasp",
       .on = {{.event = "grasp closed", .to = "carry"},
              {.event = "grasp empty", .to = "empty grasp"},
              {.event = "grasp slipped", .to = "slipped"}}},
      {.name = "carry",
       .action = "carry",
       .fade = o.fade,
       .until = o.at_posture,
       .then = "done",
       .time_limit = o.carry_limit,
       .on_timeout = "not converged",
       .on = {{.event = "grasp slipped", .to = "slipped"},
              {.event = "grasp empty", .to = "slipped"}}},
      {.name = "done", .action = "carry", .fade = o.fade, .end = PhaseEnd::success}};
  for (const char* reason : detail::grasp_failures) {
    if (*reason == '\0') continue;
    phases.push_back({.name = reason, .fade = o.fade, .end = PhaseEnd::failure});
  }
  return Mission(std::move(phases),
                 {{.event = "out of bounds", .to = "bounds"}, {.event = "fault", .to = "fault"}},
                 o.max_step);
}

/// Why a mission of `maris_mission` failed.
inline GraspFailure grasp_failure(const Mission& mission) noexcept {
  if (mission.end() != PhaseEnd::failure) return GraspFailure::none;
  for (int i = 1; i < 8; ++i) {
    if (mission.phase() == detail::grasp_failures[i]) return static_cast<GraspFailure>(i);
  }
  return GraspFailure::none;
}

}  // namespace icat
