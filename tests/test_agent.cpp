// SPDX-License-Identifier: BSD-3-Clause
// Agents with the papers' robot.
#include <gtest/gtest.h>

#include <icat/icat.hpp>

#include "support/carriers.hpp"

namespace {

using namespace testing_support;  // NOLINT
using Robot = Uvms;
using Agent = UvmsAgent;
using Vector13d = Vector13;
namespace task = icat::task;

TEST(Agent, BothCommandTheAgreedToolVelocity) {
  Pair pair(false);
  pair.start("carry");
  for (int k = 0; k < 5; ++k) pair.cycle(0.01 * k);
  const Vector6 agreed = pair.agents[0]->agreed_velocity();
  EXPECT_EQ(agreed, pair.agents[1]->agreed_velocity());
  EXPECT_GT(agreed.norm(), 0.05);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT((pair.tool_velocity(i) - agreed).norm(), 1e-12);
    EXPECT_EQ(pair.agents[i]->agreement_activation(), 1);
    EXPECT_EQ(pair.agents[i]->command(), pair.agents[i]->velocity());
  }
  // ẋ̄ on ⟨t⟩, which has the world's orientation here: γ times the way to go.
  EXPECT_LT((pair.agents[1]->desired() - 0.5 * twist(0.3, -0.2, -0.4)).norm(), 1e-12);
}

// From rest, with fades that differ: what holds the object moves alike from the first cycle.
TEST(Agent, InAFadeBothToolsMoveAlike) {
  for (const bool compensation : {false, true}) {
    Pair pair(false, compensation);
    ASSERT_EQ(pair.agents[0]->switch_to("carry", 0, 1), Status::ok);
    ASSERT_EQ(pair.agents[1]->switch_to("carry", 0, 0.3), Status::ok);
    std::array<Vector13d, 2> last{Vector13d::Zero(), Vector13d::Zero()};
    double fastest = 0;
    for (int k = 0; k < 150; ++k) {
      pair.cycle(0.01 * k);
      for (std::size_t i = 0; i < 2; ++i) {
        Vector13d actual = pair.agents[i]->velocity();
        if (compensation) actual.tail<6>().setZero();  // what is measured
        const Vector6 tool = pair.holder(i).tool_velocity(actual);
        EXPECT_LT((tool - pair.agents[i]->agreed_velocity()).norm(), compensation ? 1e-5 : 1e-9)
            << k;
        EXPECT_LT(pair.agents[i]->cut().norm(), compensation ? 1e-5 : 1e-9);
        fastest = std::max(fastest, tool.norm());
        // The agreement itself fades over 0.01 s.
        EXPECT_LT((pair.agents[i]->velocity() - last[i]).norm(), 0.2) << k;
        last[i] = pair.agents[i]->velocity();
      }
    }
    EXPECT_GT(fastest, 0.05);
  }
}

// A fault of its own, short or long: out and back without a jump, and a stop that is said again and
// again ends.
TEST(Agent, FaultsAndStopsFadeOutAndBack) {
  for (const int bad : {20, 80}) {
    Pair pair(false);
    pair.start("carry");
    for (int k = 0; k < 20; ++k) pair.cycle(0.01 * k);
    auto& agent = *pair.agents[0];
    Vector13d last = agent.command();
    const double speed = last.norm();
    double largest = 0;
    for (int k = 20; k < 400; ++k) {
      const double t = 0.01 * k;
      const bool stale = k < 20 + bad;
      if (k >= 200) {
        ASSERT_EQ(agent.stop(t, 1), Status::ok);
      }
      for (auto& a : pair.agents) ASSERT_EQ(a->propose(t), Status::ok);
      ASSERT_EQ(pair.agents[1]->receive(0, k, agent.send(k)), Status::ok);
      ASSERT_EQ(agent.receive(1, k, pair.agents[1]->send(k)), Status::ok);
      EXPECT_EQ(agent.step(t, {.state = stale ? 1.0 : 0.0}),
                stale ? Status::stale_state : Status::ok);
      largest = std::max(largest, (agent.command() - last).norm());
      last = agent.command();
      if (k == 199) {
        EXPECT_GT(last.norm(), 0.05);
      }
    }
    // The smooth step rises by 15/8 in the time of a ramp, 0.5 s, at most. In the middle of one the
    // velocity agreed on has changed meanwhile.
    EXPECT_LT(largest, bad == 20 ? 0.2 * speed : 1.1 * 15 / 8 / 0.5 * 0.01 * speed) << bad;
    EXPECT_LT(last.norm(), 1e-12);
  }
}

// Beyond the paper: the mean pulls the tool of a through its ceiling, the intersection does not.
TEST(Agent, TheMeanDisturbsASafetyTaskTheIntersectionOfSpansDoesNot) {
  for (const bool spans : {false, true}) {
    Pair pair(spans);
    pair.start("carry");
    for (int k = 0; k < 5; ++k) pair.cycle(0.01 * k);
    const double wanted = pair.a.ceiling.reference()(0);
    ASSERT_EQ(pair.a.ceiling.activation()(0), 1);
    ASSERT_GT(wanted, 0);  // down, away from it
    // Alone a would keep it.
    EXPECT_NEAR(pair.agents[0]->own().report().levels()[1].tracking_error, 0, 1e-9);
    const double sinking = pair.tool_velocity(0)(2);
    if (spans) {
      EXPECT_NEAR(sinking, wanted, 1e-6);  // float32
      // And what is free is still the mean.
      EXPECT_NEAR(pair.tool_velocity(0)(0), 0.15, 1e-6);
      EXPECT_NEAR(pair.tool_velocity(0)(1), -0.1, 1e-6);
    } else {
      EXPECT_LT(sinking, -0.02);  // up, against it
    }
    EXPECT_LT((pair.tool_velocity(0) - pair.tool_velocity(1)).norm(), 1e-12);
  }
}

TEST(Agent, TransitionsAreContinuousAndAloneIsThePlainController) {
  Pair pair(true);
  std::array<Vector13d, 2> last;
  const double dt = 1e-3;
  pair.start("alone");
  for (int k = 0; k <= 3000; ++k) {
    const double t = k * dt;
    for (auto& agent : pair.agents) {
      if (k == 500 || k == 1900) {
        ASSERT_EQ(agent->switch_to(k == 500 ? "carry" : "alone", t, 1), Status::ok);
      }
    }
    pair.cycle(t);
    for (std::size_t i = 0; i < 2; ++i) {
      const auto& v = pair.agents[i]->velocity();
      // The robots stand still, so only the activations change.
      if (k > 0) {
        EXPECT_LT((v - last[i]).norm(), 0.02) << k;
      }
      last[i] = v;
    }
    if (k == 400 || k == 3000) {
      for (auto& agent : pair.agents) {
        EXPECT_EQ(agent->agreement_activation(), 0);
        EXPECT_EQ(agent->velocity(), agent->own().velocity());
        EXPECT_LT((agent->second().velocity() - agent->own().velocity()).norm(),
                  k == 400 ? 10.0 : 1e-9);  // not solved before the first transition
      }
    }
  }
}

TEST(Agent, TheArmMakesUpForTheVehicle) {
  Pair pair(false, true);
  pair.start("carry");
  const Vector6 measured = twist(0.05, -0.03, 0.02, 0.01, 0.02, -0.01);
  for (int k = 0; k < 5; ++k) pair.cycle(0.01 * k, of_vehicle(measured));
  for (std::size_t i = 0; i < 2; ++i) {
    const Holder& h = pair.holder(i);
    Agent& agent = *pair.agents[i];
    // What goes to the vehicle is of the second hierarchy.
    EXPECT_EQ(agent.velocity().tail<6>(), agent.second().velocity().tail<6>());
    Vector13d actual = agent.velocity();
    actual.tail<6>() = measured;
    EXPECT_LT((h.tool_velocity(actual) - agent.agreed_velocity()).norm(), 1e-9);
    // The law of Eq. (24) says the same, and goes on saying it without a solver.
    ASSERT_EQ(agent.step_joint_law(0.05), Status::ok);
    const Vector13d solved = agent.velocity();
    ASSERT_EQ(agent.follow_joint_law(0.05, of_vehicle(measured)), Status::ok);
    EXPECT_LT((agent.velocity() - solved).norm(), 1e-9);
    ASSERT_EQ(agent.follow_joint_law(0.05, of_vehicle(-2 * measured)), Status::ok);
    actual.tail<6>() = -2 * measured;
    actual.head<7>() = agent.velocity().head<7>();
    EXPECT_LT((h.tool_velocity(actual) - agent.agreed_velocity()).norm(), 1e-9);
    EXPECT_EQ(agent.follow_joint_law(0.05, Vector13d::Constant(NAN)), Status::non_finite);
    EXPECT_TRUE(agent.velocity().allFinite());
  }
  Pair without(false);
  without.start("carry");
  EXPECT_EQ(without.agents[0]->step_joint_law(0), Status::not_started);
}

// Given columns: measured in `velocity`, also in the compensation, and never commanded.
TEST(Agent, GivenColumns) {
  for (const bool compensation : {false, true}) {
    SCOPED_TRACE(compensation);
    Pair pair(false, compensation, twist(0.3, -0.2, 0.4), icat::Columns({2, 10, 11}));
    pair.start("carry");
    const Vector13d measured = Vector13d::LinSpaced(0.03, -0.02);
    for (int k = 0; k < 5; ++k) pair.cycle(0.01 * k, measured);
    for (std::size_t i = 0; i < 2; ++i) {
      const Agent& agent = *pair.agents[i];
      Vector13d command = agent.velocity();
      for (const int c : {2, 10, 11}) {
        EXPECT_EQ(agent.velocity()(c), measured(c)) << c;
        command(c) = 0;
      }
      EXPECT_EQ(agent.command(), command);
      Vector13d actual = agent.velocity();
      if (compensation) actual.tail<6>() = measured.tail<6>();
      // The six joints that are left to the compensation are regularized a little.
      EXPECT_LT((pair.holder(i).tool_velocity(actual) - agent.agreed_velocity()).norm(),
                compensation ? 1e-5 : 1e-9);
    }
  }
}

TEST(Agent, FilterAndCorrection) {
  Pair pair(false);
  auto& plain = *pair.agents[0];
  Agent slow(pair.a.robot, pair.a.actions(), {{"carry", pair.a.tool}},
             {.agreement = {.fade = 0.01}, .filter = 0.5});
  pair.start("carry");
  ASSERT_EQ(slow.start("carry", 0), Status::ok);
  const double dt = 0.01;
  for (int k = 0; k <= 100; ++k) {
    pair.cycle(dt * k);
    ASSERT_EQ(slow.propose(dt * k), Status::ok);
    (void)slow.send(k);
    ASSERT_EQ(slow.receive(1, k, pair.agents[1]->send(k)), Status::ok);
    const Vector6 correction = twist(0, 0.01, 0);
    ASSERT_EQ(slow.step(dt * k, Vector13d::Zero(), correction), Status::ok);
    const Vector6 commanded = pair.a.tool_velocity(slow.velocity());
    EXPECT_LT((commanded - correction - slow.agreed_velocity()).norm(), 1e-12);
  }
  // The input was there from 0.01 s on, at 0 s it faded in.
  const Vector6 expected = (1 - std::exp(-1.0 / 0.5)) * plain.agreed_velocity();
  EXPECT_LT((slow.agreed_velocity() - expected).norm(), 1e-3);
  EXPECT_THROW(Agent(pair.a.robot, pair.a.actions(), {{"carry", pair.a.tool}}, {.filter = -1}),
               std::invalid_argument);
}

TEST(Agent, RefusesWhatCannotBeShared) {
  Holder h(0, 1, Vector6::Zero()), foreign(1, 1, Vector6::Zero());
  const auto with = [&](std::vector<icat::SharedAction<Robot>> shared,
                        std::vector<icat::Action<Robot>> actions) {
    return message_of([&] { Agent(h.robot, actions, shared, Agent::Options{}); });
  };
  EXPECT_EQ(with({{"carry", h.tool}}, h.actions()), "no exception");
  EXPECT_EQ(with({}, h.actions()), "Agent: no action is shared");
  EXPECT_EQ(with({{"fly", h.tool}}, h.actions()), "Agent: no action 'fly' to be shared");
  EXPECT_EQ(with({{"carry", h.tool}, {"carry", h.tool}}, h.actions()),
            "Agent: action 'carry' does not contain task 'tool' or is shared twice");
  task::FramePose<Robot> other(h.robot, h.hand, object(), {.name = "other"});
  EXPECT_EQ(with({{"carry", other}}, h.actions()),
            "Agent: action 'carry' does not contain task 'other' or is shared twice");
  const auto norm = icat::Objective<double>::at_most(0.1, 0.05);
  task::FramePose<Robot> norm_form(h.robot, h.hand, object(),
                                   {.name = "norm", .norms = {{norm, norm}}});
  EXPECT_EQ(with({{"carry", norm_form}}, {{"carry", {{norm_form}}}}),
            "Agent: the shared task 'norm' must be in component form, six rows, not 2");
  // One object, one frame.
  task::FramePose<Robot> camera(h.robot, h.robot.frame("camera"), object(), {.name = "camera"});
  EXPECT_EQ(
      with({{"carry", h.tool}, {"film", camera}}, {{"carry", {{h.tool}}}, {"film", {{camera}}}}),
      "Agent: the shared tasks 'tool' and 'camera' move different frames");
  // Case C8.
  EXPECT_EQ(with({{"carry", foreign.tool}}, foreign.actions()),
            "action 'alone': task 'faulty' belongs to another robot");
}
static_assert(!std::is_constructible_v<Agent, Robot, std::vector<icat::Action<Robot>>,
                                       std::vector<icat::SharedAction<Robot>>, Agent::Options>);

TEST(Agent, ABadCycleKeepsItFinite) {
  Pair pair(true, true);
  pair.start("carry");
  for (int k = 0; k < 5; ++k) pair.cycle(0.01 * k);
  auto& agent = *pair.agents[0];
  EXPECT_EQ(agent.step(0.05, Vector13d::Constant(NAN)), Status::non_finite);
  EXPECT_TRUE(agent.velocity().allFinite());
  // The second hierarchy stands above the fault and goes on with what was agreed.
  pair.a.faulty.bad = true;
  EXPECT_EQ(agent.propose(0.06), Status::non_finite);
  EXPECT_EQ(agent.step(0.06, Vector13d::Zero()), Status::non_finite);
  EXPECT_TRUE(agent.velocity().allFinite());
  EXPECT_GT(agent.agreed_velocity().norm(), 0.01);
  Vector13d actual = agent.velocity();
  actual.tail<6>().setZero();
  EXPECT_LT((pair.a.tool_velocity(actual) - agent.agreed_velocity()).norm(), 1e-9);
  EXPECT_EQ(agent.switch_to("fly", 0.06, 1), Status::unknown_action);
}

// What is not actuated cannot give way: the joints that a safety task holds must stay.
TEST(Agent, SpansKnowWhatIsGiven) {
  for (const bool given : {false, true}) {
    Holder a(0.3, -10, twist(0.3, 0.2, 0.1)), b(2.5, -10, twist(-0.2, 0.1, 0.3));
    task::FunctionTask<Robot> lock(a.robot, icat::Objective<double>::at_least(5, 0.1),
                                   [](const Robot& r, auto x, auto J) {
                                     x << r.q()(1), r.q()(3);
                                     J(0, 1) = J(1, 3) = 1;
                                   },
                                   {.name = "lock", .rows = 2, .gain = 1e-9});
    const std::vector<icat::Action<Robot>> actions{{"carry", {{lock}, {a.tool}}}};
    Agent::Options options{.agreement = {.spans = true, .fade = 0.01}};
    if (given) options.controller.given = a.robot.base_columns();
    Agent first(a.robot, actions, {{"carry", a.tool}}, options);
    Agent second(b.robot, b.actions(), {{"carry", b.tool}},
                 {.agreement = {.index = 1, .spans = true, .fade = 0.01}});
    ASSERT_EQ(first.start("carry", 0), Status::ok);
    ASSERT_EQ(second.start("carry", 0), Status::ok);
    for (int k = 0; k < 5; ++k) {
      ASSERT_EQ(first.propose(0.01 * k, Vector13d::Zero()), Status::ok);
      ASSERT_EQ(second.propose(0.01 * k), Status::ok);
      ASSERT_EQ(second.receive(0, k, first.send(k)), Status::ok);
      ASSERT_EQ(first.receive(1, k, second.send(k)), Status::ok);
      ASSERT_EQ(first.step(0.01 * k, Vector13d::Zero()), Status::ok);
    }
    EXPECT_GT(first.velocity().norm(), 1e-3);
    // 0.3 rad/s if the vehicle counted as free; what is left is the regularization of a short arm.
    EXPECT_NEAR(first.velocity()(1), 0, 0.02) << given;
    EXPECT_NEAR(first.velocity()(3), 0, 0.02) << given;
  }
}

TEST(Agent, StepReportsWhatTheControllerReports) {
  Pair pair(false);
  auto& agent = *pair.agents[0];
  EXPECT_EQ(agent.step(0), Status::not_started);
  ASSERT_EQ(agent.start("alone", 1), Status::ok);
  ASSERT_EQ(agent.propose(1), Status::ok);
  EXPECT_EQ(agent.step(1), Status::ok);
  EXPECT_EQ(agent.step(NAN), Status::non_finite);
  EXPECT_EQ(agent.step(0.5), Status::ok);  // a step of 0
}

// --- refusals change nothing ---------------------------------------------------------------------

/// All that a switch changes, in both hierarchies.
struct Phase {
  explicit Phase(const Agent& agent) {
    for (const auto* controller : {&agent.own(), &agent.second()}) {
      names.emplace_back(controller->action());
      moving.push_back(controller->in_transition());
      const auto a = controller->phase_activations();
      activations.emplace_back(a.begin(), a.end());
    }
  }
  bool operator==(const Phase&) const = default;
  std::vector<std::string> names;
  std::vector<bool> moving;
  std::vector<std::vector<double>> activations;
};

// Case C1. The law of the joints moves the second hierarchy's clock on alone.
TEST(Agent, ARefusedSwitchChangesNeitherHierarchy) {
  for (const bool law : {false, true}) {
    SCOPED_TRACE(law);
    Pair pair(false, law);
    auto& agent = *pair.agents[0];
    const Phase nothing(agent);
    EXPECT_EQ(agent.start("fly", 0), Status::unknown_action);
    EXPECT_EQ(agent.start("carry", NAN), Status::non_finite);
    EXPECT_EQ(agent.switch_to("carry", 0, 0), Status::invalid_duration);
    EXPECT_EQ(Phase(agent), nothing);
    pair.start("alone");
    pair.cycle(1);
    if (law) {
      ASSERT_EQ(agent.step_joint_law(2), Status::ok);
    } else {
      ASSERT_EQ(agent.step(2, Vector13d::Zero()), Status::ok);
    }
    const Phase before(agent);
    EXPECT_EQ(agent.switch_to("fly", 2, 1), Status::unknown_action);
    EXPECT_EQ(agent.switch_to("carry", NAN, 1), Status::non_finite);
    EXPECT_EQ(agent.switch_to("carry", 2, -1), Status::invalid_duration);
    EXPECT_EQ(agent.switch_to("carry", 2, NAN), Status::invalid_duration);
    EXPECT_EQ(Phase(agent), before);
    // What is accepted is carried out by both.
    ASSERT_EQ(agent.switch_to("carry", 2, 1), Status::ok);
    const auto until = [&](double from, double to) {
      for (double t = from; t <= to; t += 0.1) {
        ASSERT_EQ(agent.propose(t), Status::ok);
        ASSERT_EQ(agent.step(t, Vector13d::Zero()), Status::ok);
      }
    };
    until(2.1, 2.5);
    EXPECT_EQ(agent.own().action(), "carry");
    EXPECT_EQ(agent.second().action(), "carry");
    EXPECT_TRUE(agent.own().in_transition());
    EXPECT_TRUE(agent.second().in_transition());
    // Half-way it may be refused as well, and goes on.
    EXPECT_EQ(agent.switch_to("alone", INFINITY, 1), Status::non_finite);
    until(2.6, 3.15);
    EXPECT_EQ(agent.agreement_activation(), 1);
  }
}

// The clock is set back; what was agreed on gets no younger by that.
TEST(Agent, GoesOnAtAnEarlierTime) {
  Pair pair(false);
  pair.start("carry", 1000);
  for (int k = 0; k < 5; ++k) pair.cycle(1000 + 0.01 * k);
  const Vector6 agreed = pair.agents[0]->agreed_velocity();
  auto& agent = *pair.agents[0];
  const double hold = agent.agreement().options().hold, fade = agent.agreement().options().fade;
  EXPECT_EQ(agent.step(0), Status::ok);
  EXPECT_EQ(agent.agreed_velocity(), agreed);
  double t = 0;
  for (; t < hold - 0.02; t += 0.01) {
    EXPECT_EQ(agent.step(t), Status::ok);
    EXPECT_TRUE(agent.agreement().agreed());
  }
  for (; t < hold + fade + 0.03; t += 0.01) EXPECT_EQ(agent.step(t), Status::ok);
  EXPECT_FALSE(agent.agreement().agreed());  // it stops where nobody is heard
  EXPECT_EQ(agent.agreed_velocity(), Vector6::Zero());
}

// Case C3.
TEST(Agent, NothingIsSentAfterARefusedOwnHierarchy) {
  Pair pair(false, false, twist(0.3, -0.2, -0.4), icat::ColumnRange{10, 1});
  auto& agent = *pair.agents[0];
  const Vector13d still = Vector13d::Zero();
  EXPECT_EQ(agent.propose(0, still), Status::not_started);
  EXPECT_TRUE(agent.send(0).empty());
  pair.start("carry");
  for (int k = 0; k < 5; ++k) pair.cycle(0.01 * k);
  const Vector6 agreed = agent.agreed_velocity();
  Vector13d bad = still;
  bad(10) = NAN;
  const auto refused = [&](Status expected, Status status) {
    EXPECT_EQ(status, expected);
    EXPECT_TRUE(agent.send(100).empty()) << icat::describe(expected);
    ASSERT_EQ(agent.propose(0.1, still), Status::ok);
    EXPECT_EQ(agent.send(5).size(), 24u);
  };
  pair.a.faulty.bad = true;
  const Status faulty = agent.propose(0.1, still);
  pair.a.faulty.bad = false;
  refused(Status::non_finite, faulty);
  refused(Status::non_finite, agent.propose(0.1, bad));
  refused(Status::non_finite, agent.propose(NAN, still));
  // And the agreement of before holds on meanwhile.
  pair.a.faulty.bad = true;
  EXPECT_EQ(agent.propose(0.11, still), Status::non_finite);
  pair.a.faulty.bad = false;
  EXPECT_EQ(agent.step(0.11, still), Status::non_finite);
  EXPECT_EQ(agent.agreed_velocity(), agreed);
}

// Case C9.
TEST(Agent, AutoKeepsTheVelocityOfItsCycle) {
  Pair pair(false, true);
  pair.start("carry");
  for (int k = 0; k < 2; ++k) pair.cycle(0.01 * k);
  auto& agent = *pair.agents[1];
  auto velocity = agent.velocity();
  auto command = agent.command();
  auto agreed = agent.agreed_velocity();
  static_assert(std::is_same_v<decltype(velocity), Vector13d>);
  static_assert(std::is_same_v<decltype(command), Vector13d>);
  static_assert(std::is_same_v<decltype(agreed), Vector6>);
  const Vector13d copy = velocity;
  pair.cycle(0.03, of_vehicle(Vector6::Constant(0.1)));
  EXPECT_GT((agent.velocity() - velocity).norm(), 0.01);
  EXPECT_EQ(velocity, copy);
  EXPECT_EQ(command, copy);
}

}  // namespace
