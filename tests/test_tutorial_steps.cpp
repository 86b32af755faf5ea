// SPDX-License-Identifier: BSD-3-Clause
// The six steps of docs/tutorial.md, whole and broken: what `explain` names as the cause, what came
// of it, and that the page shows what is printed.
#include <gtest/gtest.h>

#include <fstream>
#include <iostream>
#include <sstream>

#include "../examples/support/replay.hpp"
#include "../examples/tutorial/steps.hpp"

namespace {

using icat::LimitKind;
using icat::LossCause;
using icat::Verdict;
using tutorial::Form;
using tutorial::Judgement;
using tutorial::Outcome;

std::string read(const std::string& path) {
  const std::string here = __FILE__;
  std::ifstream file(here.substr(0, here.rfind("tests")) + path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}
Outcome run_step(int step, Form form) {
  const Outcome outcome = tutorial::run(step, form);
  std::cout << outcome.text << "\n";
  EXPECT_NE(read("docs/tutorial.md").find("```\n" + outcome.text + "```\n"), std::string::npos)
      << "docs/tutorial.md does not show what step " << step << " prints";
  return outcome;
}
Judgement of(const Outcome& outcome, std::string_view task) {
  for (const auto& j : outcome.judgements) {
    if (j.task == task) return j;
  }
  ADD_FAILURE() << "no task " << task;
  return {};
}
bool alarm(const Outcome& outcome) {
  for (const auto& j : outcome.judgements) {
    if (j.alarm) return true;
  }
  return false;
}

TEST(TutorialSteps, OneReachesAPoint) {
  const Outcome whole = run_step(1, Form::whole);
  EXPECT_LT(whole.error, 1e-4);
  EXPECT_FALSE(alarm(whole));
  const Outcome broken = run_step(1, Form::broken);
  EXPECT_GT(broken.error, 0.1);
  const Judgement reach = of(broken, "reach");
  EXPECT_TRUE(reach.alarm);
  EXPECT_EQ(reach.verdict, Verdict::blocked);
  EXPECT_TRUE(reach.cause == LossCause::singular || reach.cause == LossCause::regularization);
}

TEST(TutorialSteps, TwoOrdersPriorities) {
  const Outcome whole = run_step(2, Form::whole);
  EXPECT_GT(whole.margin, 0.02);
  EXPECT_FALSE(alarm(whole));
  EXPECT_EQ(of(whole, "reach").cause, LossCause::level);
  EXPECT_EQ(of(whole, "reach").taken_by, "joint limits");
  const Outcome broken = run_step(2, Form::broken);
  EXPECT_LT(broken.margin, 1e-3);  // against the hard limit
  const Judgement limits = of(broken, "joint limits"), reach = of(broken, "reach");
  EXPECT_EQ(limits.verdict, Verdict::yields);
  EXPECT_EQ(limits.cause, LossCause::level);
  EXPECT_EQ(limits.taken_by, "reach");
  EXPECT_TRUE(reach.alarm);
  EXPECT_EQ(reach.cause, LossCause::bound);
  EXPECT_EQ(reach.limit, LimitKind::position);
  // README.md shows the last line.
  const std::size_t last = broken.text.rfind('\n', broken.text.size() - 2) + 1;
  EXPECT_NE(read("README.md").find("```\n" + broken.text.substr(last) + "```\n"),
            std::string::npos);
}

TEST(TutorialSteps, ThreeChangesActions) {
  const Outcome whole = run_step(3, Form::whole);
  EXPECT_EQ(of(whole, "park").cause, LossCause::transition);
  const Outcome broken = run_step(3, Form::broken);
  const Judgement park = of(broken, "park");
  EXPECT_EQ(park.verdict, Verdict::limited);
  EXPECT_EQ(park.cause, LossCause::limit);
  EXPECT_EQ(park.limit, LimitKind::acceleration);
  EXPECT_FALSE(alarm(whole) || alarm(broken));
}

TEST(TutorialSteps, FourRidesOnAVehicle) {
  const Outcome whole = run_step(4, Form::whole);
  EXPECT_LT(whole.error, 2e-3);
  EXPECT_FALSE(alarm(whole));
  const Outcome broken = run_step(4, Form::broken);
  EXPECT_GT(broken.error, 0.1);
  const Judgement reach = of(broken, "reach");
  EXPECT_EQ(reach.verdict, Verdict::limited);
  EXPECT_EQ(reach.cause, LossCause::base);
  EXPECT_EQ(reach.column, "the base's surge");
}

TEST(TutorialSteps, FiveFollowsAPoint) {
  const Outcome whole = run_step(5, Form::whole);
  EXPECT_LT(whole.error, 2e-3);
  EXPECT_FALSE(alarm(whole));
  const Outcome broken = run_step(5, Form::broken);
  EXPECT_GT(broken.error, 0.05);
  const Judgement follow = of(broken, "follow");
  EXPECT_EQ(follow.verdict, Verdict::limited);
  EXPECT_EQ(follow.cause, LossCause::bound);
  EXPECT_EQ(follow.limit, LimitKind::velocity);
}

TEST(TutorialSteps, SixWritesATask) {
  const Outcome whole = run_step(6, Form::whole);
  EXPECT_FALSE(alarm(whole));
  EXPECT_EQ(of(whole, "reach").cause, LossCause::level);
  EXPECT_EQ(of(whole, "reach").taken_by, "clear of the table");
  const Outcome broken = run_step(6, Form::broken);
  EXPECT_TRUE(of(broken, "clear of the table").alarm);
  const Judgement reach = of(broken, "reach");
  EXPECT_EQ(reach.verdict, Verdict::faulty);
  EXPECT_EQ(reach.cause, LossCause::refused);
  EXPECT_EQ(reach.taken_by, "clear of the table");
}

}  // namespace
