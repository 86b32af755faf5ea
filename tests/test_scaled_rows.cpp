// SPDX-License-Identifier: BSD-3-Clause
// Rows in metres on their way to the solver: which they are, the option of controllers, what else
// solves.
#include <gtest/gtest.h>

#include <icat/icat.hpp>

#include "support/allocation_counter.hpp"
#include "support/sized_arms.hpp"

namespace {

using namespace testing_support;  // NOLINT
using icat::Status;
namespace task = icat::task;

using Vector6 = icat::Vector6<double>;

// --- rows

TEST(LengthPower, OfTheCatalogue) {
  Tree robot = mobile_arm_of(0.3, icat::Base<double>::free());
  const icat::FrameId hand = robot.frame("end_effector"), elbow = robot.frame("link4");
  const auto away = icat::Objective<double>::at_least(0.05, 0.1);
  const auto powers = [](const icat::Task<Tree>& t) {
    std::string text;
    for (icat::Index i = 0; i < t.rows(); ++i) text += std::to_string(t.length_power(i));
    return text;
  };
  const icat::Pose<double> goal = robot.pose(hand);
  EXPECT_EQ(powers(task::FramePose<Tree>(robot, hand, goal)), "111000");
  EXPECT_EQ(powers(task::FramePose<Tree>(robot, hand, goal, {.linear = {true, false, true}})),
            "11000");
  EXPECT_EQ(powers(task::FramePose<Tree>(robot, hand, goal,
                                         {.norms = icat::PoseNorms<double>{away, away}})),
            "10");
  EXPECT_EQ(powers(task::FramePosition<Tree>(robot, hand, goal.translation())), "111");
  EXPECT_EQ(powers(task::FrameOrientation<Tree>(robot, hand, goal.linear())), "000");
  EXPECT_EQ(powers(task::FrameVelocity<Tree>(robot, hand)), "111000");
  EXPECT_EQ(powers(task::FrameVelocity<Tree>(
                robot, hand, {.linear = {false, false, true}, .angular = {true, false, true}})),
            "100");
  EXPECT_EQ(powers(task::FrameDistance<Tree>(robot, hand, elbow, away)), "1");
  EXPECT_EQ(powers(task::Attitude<Tree>(robot, hand)), "00");
  EXPECT_EQ(powers(task::LookAt<Tree>(robot, hand, {1, 0, 0})), "00");
  EXPECT_EQ(powers(task::Occlusion<Tree>(robot, robot.base(), elbow, away)), "0");
  EXPECT_EQ(powers(task::Manipulability<Tree>(robot, hand, away)), "3");
  EXPECT_EQ(powers(task::Manipulability<Tree>(robot, elbow, away)), "0");
  EXPECT_EQ(powers(task::JointLimits<Tree>(robot)), "0000000");
  EXPECT_EQ(powers(task::Minimality<Tree>(robot, robot.base_columns())), "000000");
  using Body = icat::CollisionBody<double>;
  const std::vector<Body> bodies{Body::sphere(hand, {0, 0, 0}, 0.01),
                                 Body::sphere(elbow, {0, 0, 0}, 0.01)};
  EXPECT_EQ(powers(task::Clearance<Tree>(robot, bodies,
                                         {icat::Obstacle<double>::sphere({1, 0, 0}, 0.1)}, away)),
            "11");
  EXPECT_EQ(powers(task::SelfClearance<Tree>(robot, bodies, {{0, 1}}, away)), "1");
  Tree massive(
      {.joints = icat::axes_chain(spatial_arm<double>(0.3)), .masses = {{"link4", 1, {0, 0, 0}}}});
  task::CenterOfMass<Tree> centre(massive, {0, 0, 0});
  EXPECT_EQ(powers(centre), "111");
  EXPECT_EQ(centre.length_share(), 0.5);
  EXPECT_EQ(task::FramePosition<Tree>(robot, hand, goal.translation()).length_share(), 1.0);
  icat::Controller<Tree> controller(massive, {{"balance", {{centre}}}},
                                    {.characteristic_length = 0.6});
  ASSERT_EQ(controller.start("balance", 0), Status::ok);
  ASSERT_EQ(controller.step(0.01), Status::ok);
  for (const double scale : controller.levels()[0].scales()) EXPECT_DOUBLE_EQ(scale, 1 / 0.3);
  const auto nothing = [](const Tree&, auto, auto) {};
  EXPECT_EQ(powers(task::FunctionTask<Tree>(robot, away, nothing)), "0");
  EXPECT_EQ(powers(task::FunctionTask<Tree>(robot, away, nothing, {.rows = 2, .length_power = 1})),
            "11");
}

// --- the option

TEST(CharacteristicLengthOption, OneIsThePapersRows) {
  std::mt19937 rng(4);
  Tree robot = fixed_arm_of<double>(0.15);
  const icat::FrameId f = robot.frame("end_effector");
  for (int k = 0; k < 50; ++k) {
    ASSERT_EQ(robot.update(random_positions(robot, rng)), Status::ok);
    task::FramePose<Tree> t(robot, f, moved(robot.pose(f), 0.02, 0.01, 0));
    const Solved off(robot, t, 1);
    icat::Tpik<double> tpik(7);
    tpik.reset();
    ASSERT_EQ(tpik.add_level(t.jacobian(), t.activation(), t.reference()), Status::ok);
    ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
    EXPECT_EQ(off.velocity, tpik.velocity());  // to the last bit
    EXPECT_EQ(off.requested, tpik.report().levels()[0].requested_rate);
    // Whatever the option, rows and reports are in m/s.
    const Solved on(robot, t, {});
    EXPECT_EQ(on.rows, t.jacobian());
    EXPECT_EQ(on.requested, off.requested);
  }
}

TEST(CharacteristicLengthOption, IsOneNumberForTheWholeController) {
  Tree robot = fixed_arm_of<double>(0.3);
  const icat::FrameId f = robot.frame("end_effector");
  task::FramePose<Tree> t(robot, f, robot.pose(f));
  task::Manipulability<Tree> mu(robot, f, icat::Objective<double>::at_least(1e-3, 1e-3));
  icat::Controller<Tree> controller(robot, {{"go", {{mu}, {t}}}});
  EXPECT_NEAR(controller.characteristic_length(), 0.3, 1e-12);
  // The longest of the tasks' frames; 1 without any, or where no joint turns one.
  task::FramePosition<Tree> elbow(robot, robot.frame("link4"), {0, 0, 0});
  task::FramePosition<Tree> both(robot, robot.frame("link4"), {0, 0, 0}, {.relative_to = f});
  task::FramePosition<Tree> shoulder(robot, robot.frame("link2"), {0, 0, 0});
  task::FrameOrientation<Tree> turned(robot, f, robot.pose(f).linear());
  const auto length = [&](const icat::PriorityLevel<Tree>& tasks) {
    return icat::Controller<Tree>(robot, {{"go", {tasks}}}).characteristic_length();
  };
  const double elbow_reach = 0.577 / maris_reach * 0.3;
  EXPECT_NEAR(length({elbow}), elbow_reach, 1e-12);
  EXPECT_NEAR(length({elbow, shoulder, turned}), elbow_reach, 1e-12);
  EXPECT_NEAR(length({elbow, t}), 0.3, 1e-12);
  EXPECT_NEAR(length({both}), 0.3, 1e-12);
  EXPECT_EQ(length({shoulder, turned}), 1);
  EXPECT_NEAR(controller.levels()[0].row_scale(0), 1 / 0.027, 1e-9);
  const auto& scale = controller.levels()[1].row_scale;
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(scale(i), i < 3 ? 1 / 0.3 : 1, 1e-12);
  icat::Controller<Tree> chosen(robot, {{"go", {{t}}}}, {.characteristic_length = 0.5});
  EXPECT_EQ(chosen.characteristic_length(), 0.5);
  EXPECT_EQ(chosen.levels()[0].row_scale(0), 2);
  for (const double bad : {0.0, -0.3, double(NAN), double(INFINITY)}) {
    const std::string text = message_of([&] {
      icat::Controller<Tree>(robot, {{"go", {{t}}}}, {.characteristic_length = bad});
    });
    EXPECT_NE(text.find("controller: characteristic_length must be finite and > 0, got "),
              std::string::npos)
        << text;
  }
}

TEST(CharacteristicLengthOption, NothingAllocates) {
  Tree robot = fixed_arm_of<double>(0.3);
  const icat::FrameId f = robot.frame("end_effector");
  task::FramePose<Tree> t(robot, f, moved(robot.pose(f), 0.02, 0, 0));
  icat::Controller<Tree> controller(robot, {{"go", {{t}}}});
  ASSERT_EQ(controller.start("go", 0), Status::ok);
  ASSERT_EQ(controller.step(0), Status::ok);
  EXPECT_EQ(count_allocations([&] { (void)controller.step(0.01); }), 0);
}

// --- mobile robots, and what else solves

TEST(SmallMobileArm, LosesNothingWhereTheBaseIsGiven) {
  Tree robot = mobile_arm_of(0.15, icat::Base<double>::differential_drive());
  ASSERT_EQ(robot.update(bent_arm(), make_pose<double>(1, -2, 0, 0, 0, 0.8)), Status::ok);
  const icat::FrameId f = robot.frame("end_effector");
  task::FramePose<Tree> t(robot, f, moved(robot.pose(f), 0.01, 0.01, 0));
  const std::vector<icat::Action<Tree>> actions{{"go", {{t}}}};
  const auto lost = [&](std::optional<double> length, bool parallel) {
    Eigen::VectorXd measured = Eigen::VectorXd::Zero(9), velocity;
    measured(7) = 0.01;
    icat::Controller<Tree>::Options options{.limits = icat::unlimited,
                                            .characteristic_length = length};
    if (parallel) {
      icat::ParallelController<Tree> controller(robot, actions, options);
      EXPECT_EQ(controller.start("go", 0), Status::ok);
      EXPECT_EQ(controller.step_joints(0, measured), Status::ok);
      velocity = controller.command();
      // The law and the solver say the same.
      icat::ParallelController<Tree> law(robot, actions, options);
      EXPECT_EQ(law.start("go", 0), Status::ok);
      EXPECT_EQ(law.step_joint_law(0), Status::ok);
      EXPECT_EQ(law.follow_joint_law(0, measured), Status::ok);
      EXPECT_LT((law.command() - velocity).norm(), 1e-9 * velocity.norm());
      velocity.tail<2>() = measured.tail<2>();
    } else {
      options.given = robot.base_columns();
      icat::Controller<Tree> controller(robot, actions, options);
      EXPECT_EQ(controller.start("go", 0), Status::ok);
      EXPECT_EQ(controller.step(0, measured), Status::ok);
      velocity = controller.velocity();
    }
    const Eigen::VectorXd error = t.reference() - t.jacobian() * velocity;
    return error.norm() / t.reference().norm();
  };
  for (const bool parallel : {false, true}) {
    EXPECT_LT(lost({}, parallel), 0.01);
    EXPECT_GT(lost(1, parallel), 0.02);
  }
}

// What goes over the bus is in m/s, and so is the span.
TEST(SmallAgents, AgreeInMetres) {
  Tree robot = fixed_arm_of<double>(0.15);
  ASSERT_EQ(robot.update(bent_arm()), Status::ok);
  const icat::FrameId f = robot.frame("end_effector");
  task::FramePose<Tree> tool(robot, f, moved(robot.pose(f), 0.01, 0.02, 0));
  const icat::Matrix3<double> R = robot.pose(f).linear();
  const auto run = [&](std::optional<double> length) {
    icat::Agent<Tree> agent(
        robot, {{"carry", {{tool}}}}, {{"carry", tool}},
        {.controller = {.limits = icat::unlimited, .characteristic_length = length},
         .agreement = {.spans = true, .fade = 0.01}});
    EXPECT_NEAR(agent.own().characteristic_length(), length.value_or(0.15), 1e-12);
    EXPECT_NEAR(agent.second().characteristic_length(), length.value_or(0.15), 1e-12);
    EXPECT_EQ(agent.start("carry", 0), Status::ok);
    for (int k = 0; k < 5; ++k) {
      EXPECT_EQ(agent.propose(0.01 * k), Status::ok);
      EXPECT_EQ(agent.receive(1, k, agent.send(k)), Status::ok);  // the other says the same
      EXPECT_EQ(agent.step(0.01 * k), Status::ok);
    }
    const Vector6 goal = agent.desired();
    EXPECT_LT((R * goal.head<3>() - tool.reference().head<3>()).norm(), 1e-12);  // m/s
    const Vector6 tool_velocity = robot.jacobian(f) * agent.velocity();
    Vector6 agreed = agent.agreed_velocity();
    agreed << R * agreed.head<3>(), R * agreed.tail<3>();
    return std::pair{(tool_velocity - tool.reference()).norm() / tool.reference().norm(),
                     (agreed - tool.reference()).norm() / tool.reference().norm()};
  };
  EXPECT_LT(run({}).first, 0.01);
  EXPECT_LT(run({}).second, 0.01);
  EXPECT_GT(run(1).first, 0.05);
}

// --- the solver's part

TEST(RowScale, IsThatOfTheRows) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> u(-1, 1);
  const auto draw = [&](Eigen::Index rows, Eigen::Index cols) {
    return Eigen::MatrixXd(Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return u(rng); }));
  };
  for (int k = 0; k < 200; ++k) {
    icat::Tpik<double> tpik(7), by_hand(7);
    icat::ParametricTpik<double> law(7), law_by_hand(7);
    tpik.reset(), by_hand.reset(), law.reset(), law_by_hand.reset();
    for (const Eigen::Index rows : {1, 3, 9}) {  // the last has more rows than columns
      const Eigen::MatrixXd J = draw(rows, 7), V = draw(rows, 6);
      const Eigen::VectorXd x = draw(rows, 1), a = draw(rows, 1).cwiseAbs(),
                            s = (2 * draw(rows, 1)).array().exp();
      const std::span<const double> scale(s.data(), static_cast<std::size_t>(rows));
      ASSERT_EQ(tpik.add_level(J, a, x, scale), Status::ok);
      ASSERT_EQ(by_hand.add_level((s.asDiagonal() * J).eval(), a, s.cwiseProduct(x).eval()),
                Status::ok);
      Eigen::MatrixXd both(rows, 13);
      both << J, V;
      ASSERT_EQ(law.add_level(both, a, x, scale), Status::ok);
      ASSERT_EQ(law_by_hand.add_level((s.asDiagonal() * both).eval(), a, s.cwiseProduct(x).eval()),
                Status::ok);
      const auto& report = tpik.report().levels().back();
      EXPECT_NEAR(report.requested_rate, a.cwiseProduct(x).norm(), 1e-12);
      EXPECT_NEAR(report.tracking_error, a.cwiseProduct(x - J * tpik.velocity()).norm(), 1e-9);
    }
    EXPECT_LT((tpik.velocity() - by_hand.velocity()).norm(), 1e-8 * by_hand.velocity().norm());
    EXPECT_LT((law.P() - law_by_hand.P()).norm(), 1e-8 * law_by_hand.P().norm());
  }
}

TEST(RowScale, IsChecked) {
  icat::Tpik<double, 2> tpik;
  tpik.reset();
  const Eigen::Matrix2d J = Eigen::Matrix2d::Identity();
  const Eigen::Vector2d one = Eigen::Vector2d::Ones();
  for (const double bad : {0.0, -1.0, double(NAN), double(INFINITY)}) {
    const double scale[] = {1, bad};
    EXPECT_EQ(tpik.add_level(J, one, one, scale), Status::out_of_range);
    EXPECT_EQ(tpik.report().levels().back().bad_row, 1);
  }
  const double three[] = {1, 1, 1};
  EXPECT_EQ(tpik.add_level(J, one, one, three), Status::wrong_size);
  EXPECT_EQ(tpik.velocity(), Eigen::Vector2d::Zero());
  EXPECT_EQ(tpik.add_level(J, one, one, std::span(three).first(2)), Status::ok);
  EXPECT_EQ(tpik.velocity(), one);
}

}  // namespace
