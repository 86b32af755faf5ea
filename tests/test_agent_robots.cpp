// SPDX-License-Identifier: BSD-3-Clause
// Agents of other shapes: fixed arms, two arms on a torso, arms on a base that can do less.
#include <gtest/gtest.h>

#include <icat/icat.hpp>

#include "support/carriers.hpp"

namespace {

using namespace testing_support;  // NOLINT
namespace task = icat::task;

const Pose grasped = make_pose<double>(0.4, 0.1, 1.5, 0.2, -0.1, 0.3);

/// Two robots of any kind bring the object to its goal and hold it on the way. Where `sluggish`, a
/// base does but a part of what it is told, and the joints make up for it.
template <class A, class B>
void carry(A first, const char* first_hand, B second, const char* second_hand, bool sluggish) {
  const icat::FrameId hand_a = place(first, first_hand, grasped),
                      hand_b = place(second, second_hand, grasped);
  const Pose goal = moved(grasped, 0.05, 0.1, -0.08);
  Carrier<A> a(first, hand_a, goal,
               {.compensation = sluggish, .agreement = {.index = 0, .fade = 0.1}});
  Carrier<B> b(second, hand_b, goal,
               {.compensation = sluggish, .agreement = {.index = 1, .fade = 0.1}});
  Eigen::VectorXd actual_a = Eigen::VectorXd::Zero(first.dof());
  Eigen::VectorXd actual_b = Eigen::VectorXd::Zero(second.dof());
  const auto follow = [&](const auto& robot, const Eigen::VectorXd& command,
                          const Eigen::VectorXd& before) {
    const icat::ColumnRange base = robot.base_columns();
    Eigen::VectorXd actual = command;
    if (sluggish) {
      actual.segment(base.first, base.count) = 0.9 * before.segment(base.first, base.count) +
                                               0.05 * command.segment(base.first, base.count);
    }
    return actual;
  };
  for (int k = 0; k < 2000; ++k) {
    const double t = 0.01 * k;
    const Eigen::VectorXd measured_a = follow(first, a.agent.command(), actual_a);
    const Eigen::VectorXd measured_b = follow(second, b.agent.command(), actual_b);
    ASSERT_EQ(a.agent.propose(t, measured_a), Status::ok);
    ASSERT_EQ(b.agent.propose(t, measured_b), Status::ok);
    exchange(a.agent, b.agent, k);
    ASSERT_EQ(a.agent.step(t, measured_a), Status::ok);
    ASSERT_EQ(b.agent.step(t, measured_b), Status::ok);
    // What they really do: the joints as commanded, the base as measured.
    const auto really = [&](const auto& robot, const Eigen::VectorXd& command,
                            const Eigen::VectorXd& measured) {
      const icat::ColumnRange base = robot.base_columns();
      Eigen::VectorXd actual = command;
      if (sluggish) {
        actual.segment(base.first, base.count) = measured.segment(base.first, base.count);
      }
      return actual;
    };
    actual_a = really(first, a.agent.command(), measured_a);
    actual_b = really(second, b.agent.command(), measured_b);
    EXPECT_LT((a.tool_velocity(actual_a) - a.agent.agreed_velocity()).norm(), 1e-6) << t;
    EXPECT_LT((b.tool_velocity(actual_b) - b.agent.agreed_velocity()).norm(), 1e-6) << t;
    EXPECT_EQ(a.agent.agreed_velocity(), b.agent.agreed_velocity());
    ASSERT_EQ(drive(first, actual_a, 0.01), Status::ok);
    ASSERT_EQ(drive(second, actual_b, 0.01), Status::ok);
    EXPECT_LT(difference(first.pose(hand_a), second.pose(hand_b)).norm(), 2e-3);
  }
  EXPECT_LT(difference(first.pose(hand_a), goal).norm(), 1e-3);
  EXPECT_LT(difference(second.pose(hand_b), goal).norm(), 1e-3);
}

TEST(AgentOfAnyRobot, AFixedArmAndOneArmOfATorso) {
  carry(fixed_arm(), "end_effector", torso(), "right_end_effector", false);
}

TEST(AgentOfAnyRobot, BasesThatCanDoLessAndDoNotFollow) {
  carry(mobile_arm(icat::Base<double>::surface()), "end_effector",
        mobile_arm(icat::Base<double>::differential_drive()), "end_effector", true);
}

// The shared frame is that of the `FramePose`: the other arm goes on with its own.
TEST(AgentOfAnyRobot, EitherArmOfATorso) {
  for (const std::string side : {"left", "right"}) {
    Tree robot = torso();
    const icat::FrameId left = robot.frame("left_end_effector"),
                        right = robot.frame("right_end_effector");
    const bool is_left = side == "left";
    task::FramePose<Tree> shared(robot, is_left ? left : right,
                                 moved(robot.pose(is_left ? left : right), 0.1, 0, 0));
    task::FramePose<Tree> own(robot, is_left ? right : left,
                              moved(robot.pose(is_left ? right : left), 0, 0, 0.1));
    icat::Agent<Tree> agent(robot, {{"carry", {{shared}, {own}}}}, {{"carry", shared}},
                            {.agreement = {.fade = 0.01}});
    ASSERT_EQ(agent.start("carry", 0), Status::ok);
    Vector6 other;
    other << 0.02, -0.03, 0.01, 0.05, 0.01, -0.02;
    std::array<std::byte, icat::message_size(6)> bytes;
    ASSERT_EQ(icat::encode(other, bytes), Status::ok);
    for (int k = 0; k < 3; ++k) {
      ASSERT_EQ(agent.propose(0.1 * k), Status::ok);
      (void)agent.send(k);
      ASSERT_EQ(agent.receive(1, k, bytes), Status::ok);
      ASSERT_EQ(agent.step(0.1 * k), Status::ok);
    }
    const auto velocity_of = [&](icat::FrameId frame) {
      return Vector6(robot.jacobian(frame) * agent.velocity());
    };
    const icat::Matrix3<double> R = robot.pose(shared.frame()).linear();
    const Vector6 agreed = agent.agreed_velocity();
    EXPECT_LT((velocity_of(shared.frame()).head<3>() - R * agreed.head<3>()).norm(), 1e-9);
    EXPECT_LT((velocity_of(shared.frame()).tail<3>() - R * agreed.tail<3>()).norm(), 1e-9);
    EXPECT_LT((velocity_of(own.frame()) - own.reference()).norm(), 1e-9);
    EXPECT_LT((agreed - (other + agent.desired()) / 2).norm(), 1e-6);
  }
}

// Case M10.
TEST(AgentOfFloat, EpochSeconds) {
  using FloatRobot = icat::KinematicTree<float, 7>;
  FloatRobot robot({.joints = icat::axes_chain(icat::maris_arm<float>())});
  ASSERT_EQ(robot.update(bent_arm().cast<float>()), Status::ok);
  const icat::FrameId hand = robot.frame("end_effector");
  task::FramePose<FloatRobot> tool(robot, hand, moved(robot.pose(hand), 0.1, 0, 0));
  const std::vector<icat::Action<FloatRobot>> actions{{"alone", {{tool}}}, {"carry", {{tool}}}};
  icat::Agent<FloatRobot> agent(robot, actions, {{"carry", tool}},
                                {.agreement = {.fade = 0.5}, .filter = 0.1f});
  icat::CentralizedController<FloatRobot> central({{robot, hand, actions}, {robot, hand, actions}},
                                                  {});
  const double epoch = 1.76e9;
  ASSERT_EQ(agent.start("alone", epoch), Status::ok);
  ASSERT_EQ(agent.switch_to("carry", epoch, 1), Status::ok);
  ASSERT_EQ(central.switch_to("carry", epoch, 1), Status::ok);
  for (int k = 1; k <= 200; ++k) {
    const double t = epoch + 0.01 * k;
    ASSERT_EQ(agent.propose(t), Status::ok);
    ASSERT_EQ(agent.receive(1, k, agent.send(k)), Status::ok);
    ASSERT_EQ(agent.step(t), Status::ok);
    ASSERT_EQ(central.step(t, 1), Status::ok);
    EXPECT_EQ(agent.own().in_transition(), k < 100);
    if (k == 50) {
      EXPECT_NEAR(agent.agreement_activation(), 0.5, 1e-4);
    }
  }
  EXPECT_EQ(agent.agreement_activation(), 1);
  EXPECT_LT((agent.agreed_velocity() - agent.desired()).norm(), 1e-4f);
  EXPECT_GT(agent.velocity().norm(), 0.05f);
  EXPECT_LT((central.velocity(0) - agent.velocity()).norm(), 1e-4f);
}

}  // namespace
