// SPDX-License-Identifier: BSD-3-Clause
// Missions: tables that are refused, conditions, limits of time and events; the mission of MARIS,
// scripted, event by event and at random.
#include <gtest/gtest.h>

#include <cmath>
#include <icat/mission/maris_mission.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "support/allocation_counter.hpp"
#include "support/sanitized.hpp"

namespace {

using icat::Cause;
using icat::GraspFailure;
using icat::Mission;
using icat::Phase;
using icat::PhaseEnd;
using icat::Reaction;
using icat::Status;

std::string refusal(const std::vector<Phase>& phases, const std::vector<Reaction>& always = {}) {
  try {
    Mission mission(phases, always);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

const std::function<bool()> yes = [] { return true; };

/// There and back, each for 10 s, or until "stop".
std::vector<Phase> patrol() {
  return {{.name = "out",
           .action = "go",
           .time_limit = 10,
           .on_timeout = "back",
           .on = {{.event = "stop", .to = "end"}}},
          {.name = "back", .action = "return", .time_limit = 10, .on_timeout = "out"},
          {.name = "end", .end = PhaseEnd::success}};
}

TEST(Mission, RefusesTablesThatAreNone) {
  ASSERT_EQ(refusal(patrol()), "");
  const auto with = [](auto change) {
    std::vector<Phase> phases = patrol();
    change(phases);
    return refusal(phases);
  };
  EXPECT_EQ(refusal({}), "mission: no phase");
  EXPECT_EQ(with([](auto& p) { p[1].name = ""; }), "mission: a phase without a name");
  EXPECT_EQ(with([](auto& p) { p[1].name = "out"; }), "phase 'out' is there twice");
  EXPECT_EQ(with([](auto& p) { p[1].on_timeout = "nowhere"; }),
            "phase 'back': there is no phase 'nowhere'");
  EXPECT_EQ(with([](auto& p) { p[0].on[0].to = "nowhere"; }),
            "phase 'out': there is no phase 'nowhere'");
  EXPECT_EQ(with([](auto& p) {
              p[0].on[0].times = 2;
              p[0].on[0].otherwise = "nowhere";
            }),
            "phase 'out': there is no phase 'nowhere'");
  EXPECT_EQ(with([](auto& p) {
              p[0].until = yes;
              p[0].then = "nowhere";
            }),
            "phase 'out': there is no phase 'nowhere'");
  EXPECT_EQ(with([](auto& p) { p[0].on.clear(); }), "phase 'end' cannot be reached");
  EXPECT_EQ(with([](auto& p) {
              p[1].time_limit = icat::no_time_limit;
              p[1].on_timeout = "";
            }),
            "phase 'back' never ends");
  EXPECT_EQ(with([](auto& p) { p[2].on = {{.event = "stop", .to = "out"}}; }),
            "phase 'end' ends the mission, so nothing follows it");
  EXPECT_EQ(with([](auto& p) { p[1].until = yes; }),
            "phase 'back': until and then need each other");
  EXPECT_EQ(with([](auto& p) { p[1].then = "out"; }),
            "phase 'back': until and then need each other");
  EXPECT_EQ(with([](auto& p) { p[1].time_limit = icat::no_time_limit; }),
            "phase 'back': time_limit and on_timeout need each other");
  EXPECT_EQ(with([](auto& p) { p[1].on_timeout = ""; }),
            "phase 'back': time_limit and on_timeout need each other");
  EXPECT_EQ(with([](auto& p) { p[1].time_limit = -1; }),
            "phase 'back': time_limit must be > 0, got -1");
  EXPECT_EQ(with([](auto& p) { p[1].time_limit = NAN; }),
            "phase 'back': time_limit must be > 0, got nan");
  EXPECT_EQ(with([](auto& p) { p[1].fade = 0; }),
            "phase 'back': fade must be finite and > 0, got 0");
  EXPECT_EQ(with([](auto& p) { p[1].hold = 1; }),
            "phase 'back': hold must be finite, >= 0, and 0 without until, got 1");
  EXPECT_EQ(with([](auto& p) { p[0].on[0].event = ""; }), "phase 'out': an event without a name");
  EXPECT_EQ(with([](auto& p) { p[0].on[0].to = ""; }), "phase 'out': nothing follows 'stop'");
  EXPECT_EQ(with([](auto& p) { p[0].on.push_back(p[0].on[0]); }),
            "phase 'out': event 'stop' is there twice");
  EXPECT_EQ(with([](auto& p) { p[0].on[0].times = -1; }),
            "phase 'out': times of 'stop' must be >= 0, got -1");
  for (const bool times : {true, false}) {
    EXPECT_EQ(with([&](auto& p) {
                times ? void(p[0].on[0].times = 1) : void(p[0].on[0].otherwise = "back");
              }),
              "phase 'out': 'stop' needs both times and otherwise, or none");
  }
  EXPECT_EQ(refusal(patrol(), {{.event = "fault", .to = "nowhere"}}),
            "phase 'out': there is no phase 'nowhere'");
  EXPECT_EQ(refusal(patrol(), {{.to = "end"}}), "always: an event without a name");
  const Reaction fault{.event = "fault", .to = "end"};
  EXPECT_EQ(refusal(patrol(), {fault, fault}), "always: event 'fault' is there twice");
  EXPECT_THROW(Mission(patrol(), {}, 0), std::invalid_argument);
  icat::MarisMissionOptions options{.at_grasp = yes};
  EXPECT_THROW((void)maris_mission(options), std::invalid_argument);
  options.at_posture = yes;
  EXPECT_EQ(maris_mission(options).phase(), "survey");
  options.surveys_after_a_loss = 0;
  EXPECT_THROW((void)maris_mission(options), std::invalid_argument);
  options.surveys_after_a_loss = 3;
  options.settle = 0;
  EXPECT_THROW((void)maris_mission(options), std::invalid_argument);
}

TEST(Mission, AConditionHasToHold) {
  bool met = false;
  Mission mission(
      {{.name = "wait", .action = "a", .until = [&] { return met; }, .hold = 0.5, .then = "end"},
       {.name = "end", .end = PhaseEnd::success}});
  EXPECT_EQ(mission.phase(), "wait");
  EXPECT_FALSE(mission.entered());
  for (int k = 0; k <= 300; ++k) {
    met = (k >= 50 && k < 90) || k >= 200;  // 0.4 s are not enough
    ASSERT_EQ(mission.step(0.01 * k), Status::ok);
    EXPECT_EQ(mission.entered(), k == 0 || k == 250) << k;
    EXPECT_EQ(mission.phase(), k < 250 ? "wait" : "end") << k;
    EXPECT_NEAR(mission.time_in_phase(), 0.01 * (k < 250 ? k : k - 250), 1e-9);
  }
  EXPECT_EQ(mission.cause(), Cause::condition);
  EXPECT_EQ(mission.event(), "");
  EXPECT_EQ(mission.previous(), "wait");
  EXPECT_EQ(mission.end(), PhaseEnd::success);
  EXPECT_EQ(mission.index(), 1u);
}

TEST(Mission, TimeIsUpAfterTheLimitWhateverTheClockDoes) {
  Mission mission(patrol());
  const double epoch = 1.76e9;
  for (int k = 0; k <= 3500; ++k) {
    ASSERT_EQ(mission.step(epoch + 0.01 * k), Status::ok);
    EXPECT_EQ(mission.entered(), k % 1001 == 0) << k;
    EXPECT_EQ(mission.phase(), k / 1001 % 2 ? "back" : "out") << k;
  }
  EXPECT_EQ(mission.cause(), Cause::time_limit);
  EXPECT_STREQ(icat::describe(mission.cause()), "time limit");
  // An hour ahead, back, and no number: a step, nothing, refused.
  mission.restart();
  double t = epoch + 100;
  ASSERT_EQ(mission.step(t), Status::ok);
  EXPECT_TRUE(mission.entered());
  for (const double jump : {3600.0, -7200.0}) {
    ASSERT_EQ(mission.step(t += jump), Status::ok);
    EXPECT_LT(mission.time_in_phase(), 0.02);
  }
  const double before = mission.time_in_phase();
  EXPECT_EQ(mission.step(NAN), Status::non_finite);
  EXPECT_EQ(mission.step(INFINITY), Status::non_finite);
  EXPECT_EQ(mission.time_in_phase(), before);
  EXPECT_FALSE(mission.entered());
  EXPECT_EQ(mission.phase(), "out");
}

// A limit that never comes is no secret.
TEST(Mission, ClocksThatStall) {
  bool met = false;
  for (const double stride : {0.0, 2.0}) {  // stands still; each step longer than max_step
    std::vector<Phase> phases = patrol();
    phases[0].until = [&] { return met; };
    phases[0].hold = 0.5;
    phases[0].then = "end";
    Mission mission(phases);
    met = false;
    double t = 0;
    const auto go = [&](double time) {
      for (double passed = 0; passed < time - 1e-9; passed += 0.1) {
        ASSERT_EQ(mission.step(t += 0.1), Status::ok);
      }
    };
    go(5);
    Status status = Status::ok;
    for (int k = 1; k <= 20; ++k) {
      met = k >= 8;
      status = mission.step(t += stride);
      EXPECT_EQ(status, k < 10 ? Status::ok : Status::clock_stalled) << k;
      EXPECT_FALSE(mission.entered());
      EXPECT_EQ(mission.phase(), "out");
    }
    // What was not looked at did not hold.
    go(0.4);
    EXPECT_EQ(mission.phase(), "out");
    met = false;
    // An event is not lost meanwhile.
    for (int k = 0; k < 12; ++k) status = mission.step(t += stride);
    EXPECT_EQ(status, Status::clock_stalled);
    ASSERT_EQ(mission.raise("stop"), Status::ok);
    EXPECT_EQ(mission.step(t += stride), Status::clock_stalled);
    EXPECT_FALSE(mission.entered());
    go(0.1);
    EXPECT_TRUE(mission.entered());
    EXPECT_EQ(mission.phase(), "end");
  }
  // One that is stepped every 2 s says so beforehand.
  Mission slow = icat::maris_mission({.at_grasp = yes, .at_posture = yes, .max_step = 2});
  for (int k = 0; k <= 300; ++k) ASSERT_EQ(slow.step(2 * k), Status::ok);
  EXPECT_EQ(slow.phase(), "survey");
  ASSERT_EQ(slow.step(602), Status::ok);
  EXPECT_EQ(slow.phase(), "not found");
}

TEST(Mission, Events) {
  std::vector<Phase> phases = patrol();
  phases[0].on.push_back({.event = "obstacle", .to = "back", .times = 2, .otherwise = "end"});
  phases[1].on = {{.event = "fault", .to = "out"}};
  Mission mission(phases, {{.event = "fault", .to = "end"}});
  ASSERT_EQ(mission.step(0), Status::ok);
  ASSERT_EQ(mission.step(0.1), Status::ok);
  EXPECT_EQ(mission.raise("tide"), Status::unknown_event);
  EXPECT_EQ(mission.phase(), "out");
  EXPECT_EQ(mission.raise("obstacle"), Status::ok);
  EXPECT_EQ(mission.phase(), "back");
  EXPECT_EQ(mission.cause(), Cause::event);
  EXPECT_EQ(mission.event(), "obstacle");
  EXPECT_EQ(mission.previous(), "out");
  EXPECT_FALSE(mission.entered());  // that is for a step to say
  ASSERT_EQ(mission.step(0.2), Status::ok);
  EXPECT_TRUE(mission.entered());
  ASSERT_EQ(mission.step(0.3), Status::ok);
  EXPECT_FALSE(mission.entered());
  // Known, but not here.
  EXPECT_EQ(mission.raise("obstacle"), Status::ok);
  EXPECT_EQ(mission.raise("stop"), Status::ok);
  EXPECT_EQ(mission.phase(), "back");
  // Its own reaction goes before that of all; two obstacles are left through, the third is not.
  EXPECT_EQ(mission.raise("fault"), Status::ok);
  EXPECT_EQ(mission.phase(), "out");
  EXPECT_EQ(mission.raise("obstacle"), Status::ok);
  EXPECT_EQ(mission.raise("fault"), Status::ok);
  EXPECT_EQ(mission.raise("obstacle"), Status::ok);
  EXPECT_EQ(mission.phase(), "end");
  // The end is the end.
  for (const char* event : {"fault", "stop", "obstacle"}) {
    EXPECT_EQ(mission.raise(event), Status::ok);
    EXPECT_EQ(mission.phase(), "end");
  }
  for (int k = 0; k < 100; ++k) {
    ASSERT_EQ(mission.step(1 + k), Status::ok);
    EXPECT_EQ(mission.entered(), k == 0);
  }
  // Once more from the beginning, with all retries; copies are missions of their own.
  mission.restart();
  Mission copy = mission;
  EXPECT_EQ(mission.raise("obstacle"), Status::ok);
  EXPECT_EQ(mission.phase(), "back");
  EXPECT_EQ(mission.event(), "obstacle");
  EXPECT_EQ(copy.phase(), "out");
  EXPECT_EQ(copy.previous(), "");
  EXPECT_EQ(copy.event(), "");
  EXPECT_EQ(copy.cause(), Cause::start);
}

// Every phase is there for a step before its condition may end it, also where that is met already.
TEST(Mission, NoPhaseIsPassedUnseen) {
  std::vector<Phase> phases{{.name = "0", .on = {{.event = "go", .to = "1"}}}};
  for (int i = 1; i < 4; ++i) {
    phases.push_back({.name = std::to_string(i), .until = yes, .then = std::to_string(i + 1)});
  }
  phases.push_back({.name = "4", .end = PhaseEnd::failure});
  Mission mission(phases);
  ASSERT_EQ(mission.raise("go"), Status::ok);
  for (std::size_t i = 1; i <= 4; ++i) {
    ASSERT_EQ(mission.step(0.1 * static_cast<double>(i)), Status::ok);
    EXPECT_TRUE(mission.entered());
    EXPECT_EQ(mission.index(), i);
  }
  EXPECT_EQ(mission.end(), PhaseEnd::failure);
}

// A condition that finds something else: the event counts, not the condition.
TEST(Mission, AConditionMayRaiseAnEvent) {
  Mission* self = nullptr;
  Mission mission({{.name = "look",
                    .until =
                        [&] {
                          EXPECT_EQ(self->raise("fault"), Status::ok);
                          return true;
                        },
                    .then = "end",
                    .time_limit = 0.1,
                    .on_timeout = "end",
                    .on = {{.event = "fault", .to = "repair"}}},
                   {.name = "repair", .until = yes, .then = "end"},
                   {.name = "end", .end = PhaseEnd::success}});
  self = &mission;
  for (const char* phase : {"look", "repair", "end"}) {
    ASSERT_EQ(mission.step(0.2 * static_cast<double>(mission.index())), Status::ok);
    EXPECT_EQ(mission.phase(), phase);
    EXPECT_TRUE(mission.entered());
  }
}

/// Writes down what it is told.
struct Told {
  std::string text;
  Status switch_to(std::string_view action, double t, double fade) {
    text += std::string(action) + ' ' + std::to_string(int(t)) + ' ' + std::to_string(int(fade));
    text += ';';
    return action == "go" ? Status::ok : Status::unknown_action;
  }
  Status stop(double t, double fade) { return switch_to("stop", t, fade); }
  bool has(std::string_view action) const { return action == "go"; }
};

TEST(Mission, DrivesWhateverSwitches) {
  Mission mission(patrol());
  Told told;
  try {
    mission.check_actions(told);
    ADD_FAILURE();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "phase 'back': there is no action 'return'");
  }
  for (int k = 0; k < 12; ++k) {
    ASSERT_EQ(mission.step(k), Status::ok);
    EXPECT_EQ(mission.drive(told, k), k == 11 ? Status::unknown_action : Status::ok);
  }
  mission.restart();
  ASSERT_EQ(mission.raise("stop"), Status::ok);
  ASSERT_EQ(mission.step(12), Status::ok);
  (void)mission.drive(told, 12);
  EXPECT_EQ(told.text, "go 0 2;return 11 2;stop 12 2;");
}

// --- the mission of MARIS ------------------------------------------------------------------------

/// With a clock and conditions of its own.
class Maris {
 public:
  explicit Maris(double survey = 600)
      : mission(icat::maris_mission({.at_grasp = [this] { return at_grasp; },
                                     .at_posture = [this] { return at_posture; },
                                     .survey_limit = survey})) {
    pass(0.1);
  }
  Maris(const Maris&) = delete;

  void pass(double time) {
    for (double passed = 0; passed < time - 1e-9; passed += 0.1) {
      ASSERT_EQ(mission.step(t += 0.1), Status::ok);
    }
  }
  /// A word of a script: an event of the mission's, or what it finds out by itself.
  void say(const std::string& word) {
    if (word == "at grasp") {
      at_grasp = true;
      pass(0.7);  // it has to hold for 0.5 s from the first step that sees it
      at_grasp = false;
    } else if (word == "posture reached") {
      at_posture = true;
      pass(0.2);
      at_posture = false;
    } else if (word == "timeout") {
      pass(mission.phases()[mission.index()].time_limit < 1e6
               ? mission.phases()[mission.index()].time_limit + 0.2
               : 700);
    } else {
      ASSERT_EQ(mission.raise(word), Status::ok) << word;
      pass(0.1);
    }
  }

  bool at_grasp = false, at_posture = false;
  double t = 0;
  Mission mission;
};

const std::vector<std::string> words{
    "object detected", "object lost", "grasp closed",  "grasp empty", "at grasp",
    "posture reached", "timeout",     "out of bounds", "fault",       "grasp slipped"};

TEST(MarisMission, ScriptedWordForWord) {
  using Script = std::vector<std::pair<std::string, std::string>>;  // what happens, what follows
  const Script good{{"object detected", "approach"},
                    {"at grasp", "close"},
                    {"grasp closed", "carry"},
                    {"posture reached", "done"}};
  const Script thrice{{"object detected", "approach"}, {"object lost", "survey"},
                      {"object detected", "approach"}, {"object lost", "survey"},
                      {"object detected", "approach"}, {"object lost", "survey"},
                      {"object detected", "approach"}, {"object lost", "lost"},
                      {"object detected", "lost"}};
  const std::vector<std::pair<Script, GraspFailure>> scripts{
      {good, GraspFailure::none},
      {thrice, GraspFailure::lost},
      {{{"timeout", "not found"}}, GraspFailure::not_found},
      {{good[0], {"timeout", "not converged"}}, GraspFailure::not_converged},
      {{good[0], good[1], {"grasp empty", "empty grasp"}}, GraspFailure::empty_grasp},
      {{good[0], good[1], {"timeout", "empty grasp"}}, GraspFailure::empty_grasp},
      {{good[0], good[1], good[2], {"grasp empty", "slipped"}}, GraspFailure::slipped},
      {{good[0], good[1], good[2], {"grasp slipped", "slipped"}}, GraspFailure::slipped},
      {{good[0], good[1], {"grasp slipped", "slipped"}}, GraspFailure::slipped},
      {{good[0], good[1], good[2], {"timeout", "not converged"}}, GraspFailure::not_converged},
      {{good[0], {"out of bounds", "bounds"}, {"fault", "bounds"}}, GraspFailure::bounds},
      {{good[0], good[1], {"fault", "fault"}}, GraspFailure::fault}};
  for (const auto& [script, failure] : scripts) {
    Maris maris;
    for (const auto& [word, phase] : script) {
      maris.say(word);
      EXPECT_EQ(maris.mission.phase(), phase) << word;
    }
    EXPECT_EQ(icat::grasp_failure(maris.mission), failure);
    EXPECT_EQ(maris.mission.end(),
              failure == GraspFailure::none ? PhaseEnd::success : PhaseEnd::failure);
  }
  // 3 cm off after 0.4 s: not yet.
  Maris maris;
  maris.say("object detected");
  maris.at_grasp = true;
  maris.pass(0.4);
  maris.at_grasp = false;
  maris.pass(0.1);
  maris.at_grasp = true;
  maris.pass(0.4);
  EXPECT_EQ(maris.mission.phase(), "approach");
}

TEST(MarisMission, EveryEventInEveryPhase) {
  // What follows in each phase; where nothing is written, nothing changes.
  const std::vector<std::vector<std::string>> follows{
      // detected    lost      closed   empty          at grasp  posture  timeout
      {"approach", "", "", "", "", "", "not found"},
      {"", "survey", "", "", "close", "", "not converged"},
      {"", "", "carry", "empty grasp", "", "", "empty grasp"},
      {"", "", "", "slipped", "", "done", "not converged"}};
  const std::vector<std::string> way{"object detected", "at grasp", "grasp closed",
                                     "posture reached"};
  const std::vector<std::string> names{"survey", "approach", "close", "carry", "done"};
  for (std::size_t p = 0; p < names.size(); ++p) {
    for (std::size_t w = 0; w < words.size(); ++w) {
      Maris maris;
      for (std::size_t k = 0; k < p; ++k) maris.say(way[k]);
      ASSERT_EQ(maris.mission.phase(), names[p]);
      maris.say(words[w]);
      std::string expected = names[p];
      if (p < 4 && w < 7 && !follows[p][w].empty()) expected = follows[p][w];
      if (p < 4 && w == 7) expected = "bounds";
      if (p < 4 && w == 8) expected = "fault";
      if ((p == 2 || p == 3) && w == 9) expected = "slipped";
      EXPECT_EQ(maris.mission.phase(), expected) << names[p] << ": " << words[w];
    }
  }
  // And from each failure nothing leads away.
  const std::vector<std::vector<std::string>> ways{{"timeout"},
                                                   {way[0], "timeout"},
                                                   {way[0], way[1], "grasp empty"},
                                                   {way[0], way[1], way[2], "grasp empty"},
                                                   {"out of bounds"},
                                                   {"fault"}};
  for (const auto& script : ways) {
    for (const auto& word : words) {
      Maris maris;
      for (const auto& step : script) maris.say(step);
      const std::string phase(maris.mission.phase());
      ASSERT_EQ(maris.mission.end(), PhaseEnd::failure) << phase;
      maris.say(word);
      EXPECT_EQ(maris.mission.phase(), phase) << word;
    }
  }
}

// Whatever happens in whatever order: done comes after detected, at the grasp, closed, posture, in
// this order; the object counts as lost after four losses at least.
TEST(MarisMission, ARandomOrderOfEventsIsNeverDoneWithoutAGrasp) {
  const std::vector<std::string> needed{"object detected", "at grasp", "grasp closed",
                                        "posture reached"};
  std::mt19937 random(16);
  const int runs = sanitized ? 2000 : 100000;
  int done = 0, failures[8] = {};
  for (int run = 0; run < runs; ++run) {
    Maris maris(20);
    std::size_t seen = 0;
    int losses = 0;
    for (int k = 0; k < 25 && maris.mission.end() == PhaseEnd::none; ++k) {
      const bool rare = random() % 16 == 0;
      const std::string& word = words[rare ? 6 + random() % 4 : random() % 6];
      if (seen < needed.size() && word == needed[seen]) ++seen;
      if (word == "object lost") ++losses;
      if (word == "timeout") {
        maris.pass(3);  // some of it
      } else {
        maris.say(word);
      }
    }
    const GraspFailure failure = icat::grasp_failure(maris.mission);
    if (maris.mission.end() == PhaseEnd::success) {
      ++done;
      ASSERT_EQ(seen, needed.size()) << run;
      ASSERT_EQ(maris.mission.previous(), "carry");
      ASSERT_EQ(maris.mission.cause(), Cause::condition);
    }
    ASSERT_TRUE(failure != GraspFailure::lost || losses >= 4) << run;
    ++failures[static_cast<int>(failure)];
  }
  // Not for want of missions that succeed, or that fail in any way that is not slow.
  EXPECT_GT(done, runs / 100);
  for (const GraspFailure f : {GraspFailure::lost, GraspFailure::empty_grasp, GraspFailure::slipped,
                               GraspFailure::bounds, GraspFailure::fault}) {
    EXPECT_GT(failures[static_cast<int>(f)], 0) << static_cast<int>(f);
  }
}

TEST(MarisMission, DoesNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  bool met = false;
  Mission mission = icat::maris_mission(
      {.at_grasp = [&] { return met; }, .at_posture = [&] { return met; }, .survey_limit = 5});
  struct Silent {
    Status switch_to(std::string_view, double, double) noexcept { return Status::ok; }
    Status stop(double, double) noexcept { return Status::ok; }
  } controller;
  const long count = count_allocations([&] {
    for (int run = 0; run < 3; ++run) {
      mission.restart();
      for (int k = 0; k < 4000; ++k) {
        met = run == 1 && k % 1000 > 500;
        if (run == 1 && k == 100) (void)mission.raise("object detected");
        if (run == 1 && k == 700) (void)mission.raise("grasp closed");
        if (run == 2 && k == 10) (void)mission.raise("fault");
        (void)mission.raise("an event that no phase of this mission has ever heard of");
        (void)mission.step(0.01 * k);
        (void)mission.drive(controller, 0.01 * k);
      }
    }
  });
  EXPECT_EQ(count, 0);
  EXPECT_EQ(mission.phase(), "fault");
}

}  // namespace
