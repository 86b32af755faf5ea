// SPDX-License-Identifier: BSD-3-Clause
// The centralised baseline: one solver for all robots that hold the object.
#include <gtest/gtest.h>

#include <icat/icat.hpp>

#include "support/carriers.hpp"

namespace {

using namespace testing_support;  // NOLINT
using Robot = Uvms;
using Vector13d = Vector13;
using UvmsCentral = icat::CentralizedController<Uvms>;
namespace task = icat::task;

TEST(Centralized, StaysInTheKernelOfTheGraspAndEqualsALevelOnTop) {
  Pair pair(false);
  UvmsCentral central({{pair.a.robot, pair.a.hand, pair.a.actions()},
                       {pair.b.robot, pair.b.hand, pair.b.actions()}},
                      {});
  ASSERT_EQ(central.start("carry", 0), Status::ok);
  ASSERT_EQ(central.step(0, 1), Status::ok);
  Eigen::Matrix<double, 6, 26> G;
  G << pair.a.robot.jacobian(pair.a.hand), -pair.b.robot.jacobian(pair.b.hand);
  icat::Vector<double, 26> y;
  y << central.velocity(0), central.velocity(1);
  EXPECT_LT((G * y).norm(), 1e-12);
  // The safety task of a comes first for both.
  const double wanted = pair.a.ceiling.reference()(0);
  EXPECT_NEAR(pair.a.tool_velocity(central.velocity(0))(2), wanted, 1e-9);
  // G ẏ = 0 as the first level of a plain hierarchy is the same problem.
  icat::Tpik<double, 26> tpik;
  tpik.reset();
  ASSERT_EQ(tpik.add_level(G, Vector6::Ones(), Vector6::Zero()), Status::ok);
  const auto stack = [&](icat::Task<Robot>& a, icat::Task<Robot>& b) {
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(a.rows() + b.rows(), 26);
    J.topLeftCorner(a.rows(), 13) = a.jacobian();
    J.bottomRightCorner(b.rows(), 13) = b.jacobian();
    Eigen::VectorXd activation(J.rows()), reference(J.rows());
    activation << a.activation(), b.activation();
    reference << a.reference(), b.reference();
    ASSERT_EQ(tpik.add_level(J, activation, reference), Status::ok);
  };
  stack(pair.a.ceiling, pair.b.ceiling);
  stack(pair.a.tool, pair.b.tool);
  stack(pair.a.still_vehicle, pair.b.still_vehicle);
  ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
  EXPECT_LT((tpik.velocity() - y).norm(), 1e-9);
  // Case C9.
  auto last = central.velocity(1);
  static_assert(std::is_same_v<decltype(last), Vector13d>);
  // Without the object, both are on their own.
  ASSERT_EQ(central.step(0, 0), Status::ok);
  EXPECT_GT((central.velocity(1) - last).norm(), 1e-3);
  for (auto& agent : pair.agents) {
    ASSERT_EQ(agent->start("alone", 0), Status::ok);
    ASSERT_EQ(agent->propose(0), Status::ok);
    ASSERT_EQ(agent->step(0), Status::ok);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT((central.velocity(i) - pair.agents[i]->velocity()).norm(), 1e-9);
  }
  EXPECT_EQ(central.step(0, 1.5), Status::activation_out_of_range);
  EXPECT_EQ(central.step(0, NAN), Status::activation_out_of_range);
}

TEST(Centralized, AnyNumberOfRobots) {
  Holder a(0.3, -10, twist(0.1, 0, 0)), b(2.5, -10, twist(0, 0.1, 0)), c(-2, -10, twist(0, 0, 0.1));
  UvmsCentral central({{a.robot, a.hand, a.actions()},
                       {b.robot, b.hand, b.actions()},
                       {c.robot, c.hand, c.actions()}},
                      {});
  ASSERT_EQ(central.start("carry", 0), Status::ok);
  ASSERT_EQ(central.step(0, 1), Status::ok);
  const Vector6 way = a.tool_velocity(central.velocity(0));
  EXPECT_GT(way.norm(), 0.01);
  EXPECT_LT((b.tool_velocity(central.velocity(1)) - way).norm(), 1e-12);
  EXPECT_LT((c.tool_velocity(central.velocity(2)) - way).norm(), 1e-12);
  EXPECT_EQ(message_of([&] {
              UvmsCentral({{a.robot, a.hand, a.actions()}}, {});
            }),
            "CentralizedController: needs at least two robots");
  EXPECT_EQ(message_of([&] { UvmsCentral({}, {}); }),
            "CentralizedController: needs at least two robots");
}

TEST(Centralized, BoundsAreThoseOfOneRobot) {
  Pair pair(false);
  const Vector13d upper = Vector13d::LinSpaced(0.01, 0.04);
  UvmsCentral central({{pair.a.robot, pair.a.hand, pair.a.actions()},
                       {pair.b.robot, pair.b.hand, pair.b.actions()}},
                      {.bounds = {-upper, upper}});
  ASSERT_EQ(central.start("carry", 0), Status::ok);
  ASSERT_EQ(central.step(0, 1), Status::ok);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_GT(central.velocity(i).norm(), 1e-3);
    EXPECT_LE((central.velocity(i).cwiseAbs() - upper).maxCoeff(), 0);
  }
}

// Case C2.
TEST(Centralized, AllSwitchOrNone) {
  Holder a(0.3, -10, twist(0.1, 0, 0)), b(2.5, -10, twist(0, 0.1, 0));
  const auto with = [&](const std::vector<icat::Action<Robot>>& actions) {
    return message_of([&] {
      UvmsCentral({{a.robot, a.hand, a.actions()}, {b.robot, b.hand, actions}}, {});
    });
  };
  auto actions = b.actions();
  actions[1].name = "move";
  EXPECT_EQ(with(actions),
            "CentralizedController: all robots need the same actions, robot 1 has 'move'");
  actions.pop_back();
  EXPECT_NE(with(actions).find("all robots need the same actions"), std::string::npos);
  actions = b.actions();
  actions.push_back({"more", {{b.tool}}});
  EXPECT_NE(with(actions).find("all robots need the same actions"), std::string::npos);
  for (auto& action : actions = b.actions()) action.levels.pop_back();
  EXPECT_EQ(with(actions), "CentralizedController: hierarchies of 4 and 3 levels");
  // Case C8.
  EXPECT_EQ(with(a.actions()), "action 'alone': task 'faulty' belongs to another robot");

  // Two actions of two robots, in another order.
  const auto two = [](Holder& h, bool turned) {
    std::vector<icat::Action<Robot>> list{{"carry", {{h.ceiling}, {h.tool}}},
                                          {"rest", {{h.ceiling}, {h.still_vehicle}}}};
    if (turned) std::swap(list[0], list[1]);
    return list;
  };
  UvmsCentral central({{a.robot, a.hand, two(a, false)}, {b.robot, b.hand, two(b, true)}}, {});
  EXPECT_EQ(central.step(0, 1), Status::not_started);
  ASSERT_EQ(central.start("carry", 1), Status::ok);
  ASSERT_EQ(central.step(1, 1), Status::ok);
  const Vector13d first = central.velocity(0), second = central.velocity(1);
  EXPECT_EQ(central.start("fly", 1), Status::unknown_action);
  EXPECT_EQ(central.start("rest", NAN), Status::non_finite);
  EXPECT_EQ(central.switch_to("fly", 1, 1), Status::unknown_action);
  EXPECT_EQ(central.switch_to("rest", 0.5, 1), Status::time_reversed);
  EXPECT_EQ(central.switch_to("rest", 1, 0), Status::invalid_duration);
  EXPECT_EQ(central.step(0.5, 1), Status::time_reversed);
  EXPECT_EQ(central.velocity(0), first);
  for (const double t : {1.0, 2.0}) {
    ASSERT_EQ(central.step(t, 1), Status::ok);
    EXPECT_EQ(central.velocity(0), first);
    EXPECT_EQ(central.velocity(1), second);
  }
  ASSERT_EQ(central.switch_to("rest", 2, 1), Status::ok);
  ASSERT_EQ(central.step(3, 1), Status::ok);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_LT(central.velocity(i).norm(), 1e-9);
}

// --- robots of other shapes ---

const Pose grasped = make_pose<double>(0.4, 0.1, 1.5, 0.2, -0.1, 0.3);

/// Two robots, each with its frame on the object.
template <class R>
struct Central {
  Central(const R& first, icat::FrameId first_hand, const R& second, icat::FrameId second_hand)
      : a(first, first_hand, moved(grasped, 0.1, 0, 0)),
        b(second, second_hand, moved(grasped, 0, 0.1, 0)),
        controller(
            {{first, first_hand, {{"carry", {{a}}}}}, {second, second_hand, {{"carry", {{b}}}}}},
            {}) {
    EXPECT_EQ(controller.start("carry", 0), Status::ok);
    EXPECT_EQ(controller.step(0, 1), Status::ok);
  }
  task::FramePose<R> a, b;
  icat::CentralizedController<R> controller;
};

TEST(CentralizedOfAnyRobot, FixedArms) {
  FixedArm first = fixed_arm(), second = first;
  const icat::FrameId hand = place(first, "end_effector", grasped);
  Eigen::VectorXd q = bent_arm();
  q(0) += 1;
  q(3) += 0.3;
  ASSERT_EQ(second.update(q), Status::ok);
  ASSERT_EQ(place(second, "end_effector", grasped), hand);
  Central<FixedArm> central(first, hand, second, hand);
  const Vector6 va = first.jacobian(hand) * central.controller.velocity(0);
  const Vector6 vb = second.jacobian(hand) * central.controller.velocity(1);
  EXPECT_GT(va.norm(), 0.03);
  EXPECT_LT((va - vb).norm(), 1e-12);
  EXPECT_EQ(central.controller.exchanged_numbers(0), 6u * 7 + 7 + 6 * (7 + 2));
}

// Robots of different numbers of columns, each with the frame it was given.
TEST(CentralizedOfAnyRobot, ATorsoAndAnArmOnWheels) {
  Tree two_arms = torso();
  Tree wheels = mobile_arm(icat::Base<double>::differential_drive());
  const icat::FrameId left = place(two_arms, "left_end_effector", grasped);
  const icat::FrameId hand = place(wheels, "end_effector", grasped);
  Central<Tree> central(two_arms, left, wheels, hand);
  ASSERT_EQ(central.controller.velocity(0).size(), 15);
  ASSERT_EQ(central.controller.velocity(1).size(), 9);
  const Vector6 va = two_arms.jacobian(left) * central.controller.velocity(0);
  const Vector6 vb = wheels.jacobian(hand) * central.controller.velocity(1);
  EXPECT_GT(va.norm(), 0.03);
  EXPECT_LT((va - vb).norm(), 1e-12);
  // The right arm has nothing to do with it.
  EXPECT_LT(central.controller.velocity(0).tail<7>().norm(), 1e-9);

  // The same with columns in another order.
  using Permuted = BaseFirst<Tree>;
  const Permuted two_arms_2(two_arms), wheels_2(wheels);
  Central<Permuted> permuted(two_arms_2, left, wheels_2, hand);
  EXPECT_LT((permuted.controller.velocity(0) - two_arms_2.permuted(central.controller.velocity(0)))
                .norm(),
            1e-10);
  EXPECT_LT(
      (permuted.controller.velocity(1) - wheels_2.permuted(central.controller.velocity(1))).norm(),
      1e-10);
}

}  // namespace
