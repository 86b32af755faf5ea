// SPDX-License-Identifier: BSD-3-Clause
// Agents of robots of somebody else's: columns in another order, nothing but frames.
#include <gtest/gtest.h>

#include <icat/icat.hpp>

#include "support/carriers.hpp"

namespace {

using namespace testing_support;  // NOLINT
namespace task = icat::task;

const Pose grasped = make_pose<double>(0.4, 0.1, 1.5, 0.2, -0.1, 0.3);

TEST(AgentOfAnyRobot, PermutedColumnsGivePermutedVelocities) {
  using Permuted = BaseFirst<Tree>;
  Tree tree = mobile_arm(icat::Base<double>::free());
  const icat::FrameId hand = place(tree, "end_effector", grasped);
  const Permuted permuted(tree);
  const Pose goal = moved(grasped, 0.05, 0.1, -0.08);
  const icat::AgreementOptions<double> agreement{.spans = true, .fade = 0.1};
  const auto given = icat::joint_columns(tree, {"joint2"});
  const auto same_given = icat::joint_columns(permuted, {"joint2"});
  ASSERT_NE(given[0], same_given[0]);
  Carrier<Tree> a(tree, hand, goal,
                  {.controller = {.given = given}, .compensation = true, .agreement = agreement});
  Carrier<Permuted> b(
      permuted, hand, goal,
      {.controller = {.given = same_given}, .compensation = true, .agreement = agreement});
  icat::AgreementOptions<double> third = agreement;
  third.index = 1;
  icat::Agreement<double> other(third);
  ASSERT_EQ(other.propose(Vector6::Constant(0.02), Vector6::Zero()), Status::ok);
  const Eigen::VectorXd measured = Eigen::VectorXd::LinSpaced(13, -0.05, 0.02);
  for (int k = 0; k < 5; ++k) {
    const double t = 0.1 * k;
    ASSERT_EQ(a.agent.propose(t, measured), Status::ok);
    ASSERT_EQ(b.agent.propose(t, permuted.permuted(measured)), Status::ok);
    const auto said_a = a.agent.send(k), said_b = b.agent.send(k);
    ASSERT_EQ(said_a.size(), icat::message_size(42));
    icat::Vector<double, 42> numbers_a, numbers_b;
    ASSERT_EQ(icat::decode(said_a, numbers_a), Status::ok);
    ASSERT_EQ(icat::decode(said_b, numbers_b), Status::ok);
    EXPECT_LT((numbers_a - numbers_b).norm(), 1e-6);
    for (auto receive : {0, 1}) {
      ASSERT_EQ(receive == 0 ? a.agent.receive(1, k, other.send(k))
                             : b.agent.receive(1, k, other.send(k)),
                Status::ok);
    }
    ASSERT_EQ(a.agent.step(t, measured), Status::ok);
    ASSERT_EQ(b.agent.step(t, permuted.permuted(measured)), Status::ok);
    EXPECT_LT((b.agent.velocity() - permuted.permuted(a.agent.velocity())).norm(), 1e-6);
    EXPECT_LT((b.agent.command() - permuted.permuted(a.agent.command())).norm(), 1e-6);
    EXPECT_EQ(b.agent.velocity()(same_given[0]), measured(given[0]));
    EXPECT_EQ(b.agent.command()(same_given[0]), 0);
  }
  EXPECT_GT(a.agent.velocity().norm(), 0.05);
  ASSERT_EQ(a.agent.step_joint_law(0.5), Status::ok);
  ASSERT_EQ(b.agent.step_joint_law(0.5), Status::ok);
  ASSERT_EQ(a.agent.follow_joint_law(0.5, measured), Status::ok);
  ASSERT_EQ(b.agent.follow_joint_law(0.5, permuted.permuted(measured)), Status::ok);
  EXPECT_GT(a.agent.velocity().head<7>().norm(), 0.01);
  EXPECT_LT((b.agent.velocity() - permuted.permuted(a.agent.velocity())).norm(), 1e-6);
}

/// Nothing but frames: the least that an agent needs.
class FramesOnly {
 public:
  using Scalar = double;
  static constexpr int size = 7;
  explicit FramesOnly(const FixedArm& arm) : arm_(arm) {}
  icat::Index dof() const { return arm_.dof(); }
  icat::FrameId frame(std::string_view name) const { return arm_.frame(name); }
  Pose pose(icat::FrameId frame) const noexcept { return arm_.pose(frame); }
  Eigen::Matrix<double, 6, 7> jacobian(icat::FrameId frame) const noexcept {
    return arm_.jacobian(frame);
  }

 private:
  FixedArm arm_;
};
static_assert(icat::FramedRobot<FramesOnly>);
static_assert(!icat::JointedRobot<FramesOnly> && !icat::MobileRobot<FramesOnly>);
template <class Agent>
concept HasLaw = requires(Agent& agent) {
  agent.step_joint_law(0);
};
static_assert(HasLaw<icat::Agent<FixedArm>> && !HasLaw<icat::Agent<FramesOnly>>);

TEST(AgentOfAnyRobot, ARobotThatIsNothingButFrames) {
  FixedArm arm = fixed_arm();
  const icat::FrameId hand = place(arm, "end_effector", grasped);
  const FramesOnly frames(arm);
  const Pose goal = moved(grasped, 0.05, 0.1, -0.08);
  task::FramePose<FixedArm> tool(arm, hand, goal);
  task::FramePose<FramesOnly> same_tool(frames, hand, goal);
  icat::Agent<FixedArm> a(arm, {{"carry", {{tool}}}}, {{"carry", tool}},
                          {.controller = {.characteristic_length = 1},  // frames alone have none
                           .agreement = {.index = 0, .fade = 0.1}});
  icat::Agent<FramesOnly> b(frames, {{"carry", {{same_tool}}}}, {{"carry", same_tool}},
                            {.agreement = {.index = 1, .fade = 0.1}});
  ASSERT_EQ(a.start("carry", 0), Status::ok);
  ASSERT_EQ(b.start("carry", 0), Status::ok);
  for (int k = 0; k < 3; ++k) {
    ASSERT_EQ(a.propose(0.1 * k), Status::ok);
    ASSERT_EQ(b.propose(0.1 * k), Status::ok);
    exchange(a, b, k);
    ASSERT_EQ(a.step(0.1 * k), Status::ok);
    ASSERT_EQ(b.step(0.1 * k), Status::ok);
    EXPECT_EQ(a.velocity(), b.velocity());
  }
  EXPECT_GT(a.velocity().norm(), 0.05);
  EXPECT_EQ(message_of([&] {
              icat::Agent<FramesOnly>(frames, {{"carry", {{same_tool}}}}, {{"carry", same_tool}},
                                      {.compensation = true});
            }),
            "Agent: compensation needs a robot with a base");
}

}  // namespace
