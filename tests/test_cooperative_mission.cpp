// SPDX-License-Identifier: BSD-3-Clause
// The figures of the cooperative mission.
#include <gtest/gtest.h>

#include "../examples/02_cooperative_mission/mission.hpp"

namespace {

using namespace cooperation;
constexpr double degree = std::numbers::pi / 180;

void expect_safe(const Result& r) {
  ASSERT_EQ(r.status, icat::Status::ok);
  ASSERT_EQ(r.ends.size(), 7u);
  EXPECT_EQ(r.outcome, "done");
  EXPECT_GT(r.joint_margin, 0);
  EXPECT_GT(r.distance, minimum_distance);
  EXPECT_GT(r.manipulability, minimum_manipulability);
  EXPECT_LT(r.attitude, maximum_attitude);
}

void expect_success(const Result& r) {
  expect_safe(r);
  for (std::size_t k = 0; k < 7; ++k) {
    EXPECT_NEAR(r.ends[k], paper_ends[k], 0.2 * paper_ends[k]) << phase_names[k];
    const double paper = duration(paper_ends, k);
    EXPECT_NEAR(duration(r.ends, k), paper, 0.25 * paper) << phase_names[k];
  }
  EXPECT_LT(r.pre_deployment_position, 1e-3);
  EXPECT_LT(r.pre_deployment_orientation, 0.1 * degree);
  EXPECT_LT(r.deployment_position, 1e-3);
  EXPECT_LT(r.deployment_orientation, 0.1 * degree);
  EXPECT_LT(r.mismatch, 1e-9);
  EXPECT_LT(r.drift, 2e-3);
  EXPECT_LT(r.drift_angle, 0.2 * degree);
  // No jump in 10 ms: accelerations below 10 m/s² (rad/s²) in norm, and no chattering.
  EXPECT_LT(r.step, 0.1);
  EXPECT_LT(r.event_step, 0.1);
  EXPECT_LT(r.chatter, 1e-6);
}

TEST(CooperativeMission, InStillWater) {
  const Result r = run({});
  expect_success(r);
  EXPECT_DOUBLE_EQ(r.bits_per_second, 192 / dt);
  // The pipe was carried over five metres, turned and set down.
  const Pose& last = r.samples.back().object;
  EXPECT_LT((last.translation() - deployment.translation()).norm(), 1e-3);
  EXPECT_GT((last.translation() - pipe_start.translation()).norm(), 5);
  // Every task has something to do on the way, the arms rest while the vehicles carry.
  for (std::size_t k = 0; k < task_names.size(); ++k) {
    double most = 0;
    for (const auto& s : r.samples) {
      for (const auto& robot : s.robots) most = std::max(most, robot.activations[k]);
    }
    EXPECT_GT(most, 0.01) << task_names[k];
  }
  for (const auto& s : r.samples) {
    if (s.phase == 3 && s.t > r.ends[2] + 0.5) {
      for (const auto& robot : s.robots) EXPECT_LT(robot.command.head<7>().norm(), 0.02) << s.t;
    }
  }
}

TEST(CooperativeMission, InACurrentTheArmsCompensate) {
  const Result without = run({.current = true});
  const Result with = run({.current = true, .compensation = true});
  expect_safe(without);
  expect_safe(with);
  // Of the second run the paper names the beginning and the end of transport.
  const auto& [begin, end] = paper_transport_in_current;
  EXPECT_NEAR(with.ends[2], begin, 0.2 * begin);
  EXPECT_NEAR(with.ends[3], end, 0.2 * end);
  EXPECT_NEAR(duration(with.ends, 3), end - begin, 0.25 * (end - begin));
  EXPECT_GT(with.object_speed_error, 0);
  EXPECT_GE(without.object_speed_error, 10 * with.object_speed_error);
  EXPECT_LT(with.drift, 2e-3);
  EXPECT_LT(with.drift_angle, 0.2 * degree);
  EXPECT_LT(with.step, 0.15);  // the arms do what the vehicles would do otherwise
}

// Agents are explained as controllers are: what each task loses adds up, with the vehicle as it is
// measured, and in a mission that goes well nothing alarms.
TEST(CooperativeMission, AgentsExplainThemselves) {
  using Explainer = icat::Explainer<icat::Agent<Robot>>;
  for (const bool compensation : {false, true}) {
    std::array<std::unique_ptr<Explainer>, 2> why;
    int alarms = 0, by_the_agreement = 0, by_the_base = 0;
    double worst = 0, held = 0;
    int cycle = 0;
    const Result r =
        run({.current = true, .compensation = compensation}, [&](double, const Agents& agents) {
          if (cycle++ % 5 != 0) return;
          for (std::size_t i = 0; i < 2; ++i) {
            if (!why[i]) why[i] = std::make_unique<Explainer>(*agents[i]);
            why[i]->update();
            if (why[i]->alarm() && ++alarms == 1) ADD_FAILURE() << why[i]->text();
            for (const auto& t : why[i]->tasks()) {
              double sum = 0;
              for (const auto& share : t.shares) {
                sum += share.amount;
                if (share.cause == icat::LossCause::held)
                  held = std::max(held, std::abs(share.amount));
                by_the_base += share.cause == icat::LossCause::base;
                by_the_agreement += share.task == "agreed velocity";
              }
              worst = std::max(worst, std::abs(sum - t.loss));
            }
          }
        });
    EXPECT_EQ(r.outcome, "done");
    EXPECT_EQ(alarms, 0);
    EXPECT_LT(worst, 1e-9);
    EXPECT_LT(held, 1e-9);  // no answer is an old one
    EXPECT_GT(by_the_agreement, 0);
    EXPECT_EQ(by_the_base > 0, compensation);  // only then it is measured
  }
}

// A phase that is not through in time is not followed by the next one.
TEST(CooperativeMission, TimeOutsFail) {
  const Result late = run({.patience = 0.3});  // 5 s for the 6 s of the way
  EXPECT_EQ(late.status, icat::Status::ok);
  EXPECT_EQ(late.outcome, "navigate took too long");
  EXPECT_EQ(late.ends.size(), 1u);
}

TEST(CooperativeMission, CentralizedBaseline) {
  const Result r = run({.centralized = true});
  expect_success(r);
  EXPECT_GT(r.bits_per_second, 50 * 192 / dt);
}

// Whatever the agents agree on by: both tools move as one.
TEST(CooperativeMission, WithOtherPolicies) {
  struct Exchange {
    icat::FusionPolicy<double> policy;
    bool spans;
    double bits;  // of a message
  };
  for (const auto& [policy, spans, bits] :
       {Exchange{icat::fusion::difficulty_weighted<double>(), false, 224},
        Exchange{icat::fusion::convex_combination<double>({0.3, 0.7}), false, 192},
        Exchange{icat::fusion::mean<double>(), true, 1344}}) {
    const Result r = run({.policy = policy, .spans = spans});
    expect_safe(r);
    EXPECT_DOUBLE_EQ(r.bits_per_second, bits / dt);
    EXPECT_LT(r.mismatch, 1e-9);
    EXPECT_LT(r.drift, 2e-3);
    EXPECT_LT(r.deployment_position, 1e-3);
  }
}

}  // namespace
