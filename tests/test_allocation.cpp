// SPDX-License-Identifier: BSD-3-Clause
// No heap allocation after construction, in whatever build type this is compiled.
#include <gtest/gtest.h>

#include <icat/icat.hpp>
#include <memory>

#include "support/allocation_counter.hpp"
#include "support/random_hierarchy.hpp"

namespace {

class Allocation : public testing::Test {
 protected:
  void SetUp() override {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
    GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  }
};

TEST_F(Allocation, TheCounterSeesEigen) {
  EXPECT_GT(count_allocations([] {
              Eigen::MatrixXd m(20, 20);
              m.setZero();
              volatile double keep = m(3, 3);
              (void)keep;
            }),
            0);
}

template <class Solver>
void solve(Solver& tpik, const RandomHierarchy& h, icat::Status& status) {
  status = tpik.reset(h.rho0, h.Q0);
  for (const auto& level : h.levels) {
    const icat::Status s = tpik.add_level(level.J, level.a, level.reference);
    if (s != icat::Status::ok) status = s;
  }
  if (tpik.minimize_velocity() != icat::Status::ok) status = icat::Status::numerical_failure;
  if (!tpik.projector().allFinite()) status = icat::Status::numerical_failure;
}

TEST_F(Allocation, NoneInTheSolver) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    RandomHierarchy h = gen.hierarchy();
    // A level taller than the degrees of freedom, and a refused one.
    const auto tall = h.dof + 5;
    h.levels.push_back({gen.matrix(tall, h.dof), Eigen::VectorXd::Ones(tall), gen.matrix(tall, 1)});
    icat::VelocityBounds<double> bounds{Eigen::VectorXd::Constant(h.dof, -0.5),
                                        Eigen::VectorXd::Constant(h.dof, 0.5)};
    constexpr icat::Saturation ways[] = {icat::Saturation::scale, icat::Saturation::redistribute};
    icat::Tpik<double> tpik(h.dof, {.saturation = ways[seed % 2]});
    icat::Status status = icat::Status::not_started;
    const icat::VelocityBounds<double> none;
    EXPECT_EQ(count_allocations([&] { status = tpik.set_bounds(none); }), 0);
    EXPECT_EQ(status, icat::Status::ok);
    EXPECT_EQ(count_allocations([&] { status = tpik.set_bounds(bounds); }), 0);
    EXPECT_EQ(status, icat::Status::ok);
    EXPECT_EQ(count_allocations([&] { solve(tpik, h, status); }), 0);
    EXPECT_EQ(status, icat::Status::ok);
    h.levels[0].reference(0) = NAN;
    EXPECT_EQ(count_allocations([&] { solve(tpik, h, status); }), 0);
    EXPECT_EQ(status, icat::Status::non_finite);
  }
}

TEST_F(Allocation, NoneInTheSolverAtSixtyFourDegreesOfFreedom) {
  const RandomHierarchy h = HierarchyGenerator(3).hierarchy(64, 64);
  icat::Tpik<double> tpik(h.dof);
  icat::Status status = icat::Status::not_started;
  EXPECT_EQ(count_allocations([&] { solve(tpik, h, status); }), 0);
  EXPECT_EQ(status, icat::Status::ok);
}

TEST_F(Allocation, NoneInTheSolverOfStaticSizeNorInItsConstruction) {
  const RandomHierarchy h = HierarchyGenerator(11).hierarchy(13, 13);
  icat::Status status = icat::Status::not_started;
  EXPECT_EQ(count_allocations([&] {
              icat::Tpik<double, 13> tpik;
              solve(tpik, h, status);
            }),
            0);
  EXPECT_EQ(status, icat::Status::ok);
}

TEST_F(Allocation, NoneInTheArmLaw) {
  const RandomHierarchy h = HierarchyGenerator(12).hierarchy(13, 13);
  icat::ParametricTpik<double, 7> fixed;
  icat::ParametricTpik<double> dynamic(7);
  const icat::Vector6<double> v = icat::Vector6<double>::Constant(0.1);
  icat::Status status = icat::Status::ok;
  const auto run = [&](auto& tpik) {
    tpik.reset();
    for (const auto& level : h.levels) {
      status = tpik.add_level(level.J, level.a, level.reference);
    }
    status = tpik.minimize_velocity();
  };
  icat::Vector<double, 7> qdot;
  EXPECT_EQ(count_allocations([&] {
              run(fixed);
              qdot = fixed.evaluate(v);
            }),
            0);
  EXPECT_EQ(count_allocations([&] { run(dynamic); }), 0);
  EXPECT_EQ(status, icat::Status::ok);
  EXPECT_TRUE(qdot.allFinite());
}

/// What agents and a centralised controller do, on two robots of one kind.
template <class Robot>
void cooperate(Robot& a, Robot& b, icat::FrameId hand, bool compensation) {
  icat::task::FramePose<Robot> tool_a(a, hand, icat::IdentityPose{}),
      tool_b(b, hand, icat::IdentityPose{});
  const std::vector<icat::Action<Robot>> actions_a{{"alone", {{tool_a}}}, {"carry", {{tool_a}}}};
  const std::vector<icat::Action<Robot>> actions_b{{"alone", {{tool_b}}}, {"carry", {{tool_b}}}};
  for (const bool spans : {false, true}) {
    const auto options = [&](std::size_t i) {
      return typename icat::Agent<Robot>::Options{.compensation = compensation,
                                                  .agreement = {.index = i, .spans = spans}};
    };
    icat::Agent<Robot> agent_a(a, actions_a, {{"carry", tool_a}}, options(0));
    icat::Agent<Robot> agent_b(b, actions_b, {{"carry", tool_b}}, options(1));
    icat::CentralizedController<Robot> central({{a, hand, actions_a}, {b, hand, actions_b}}, {});
    const auto still = icat::Vector<double, Robot::size>::Zero(a.dof()).eval();
    icat::Status status = icat::Status::ok;
    const auto check = [&](icat::Status s) {
      if (status == icat::Status::ok) status = s;
    };
    EXPECT_EQ(count_allocations([&] {
                check(agent_a.start("alone", 0));
                check(agent_b.start("alone", 0));
                check(central.start("carry", 0));
                for (int k = 0; k < 30; ++k) {
                  const double t = 0.1 * k;
                  if (k == 5) {
                    check(agent_a.switch_to("carry", t, 1));
                    check(agent_b.switch_to("carry", t, 1));
                  }
                  check(agent_a.propose(t));
                  check(agent_b.propose(t, still));
                  check(agent_a.receive(1, k, agent_b.send(k)));
                  check(agent_b.receive(0, k, agent_a.send(k)));
                  check(agent_a.step(t, still));
                  check(agent_b.step(t, still));
                  if (compensation) {
                    check(agent_a.step_joint_law(t));
                    check(agent_a.follow_joint_law(t, still));
                  }
                  check(central.step(t, 1));
                }
                check(agent_a.start("alone", 0));
                check(agent_a.step(0.1, still));
              }),
              0);
    EXPECT_EQ(status, icat::Status::ok) << icat::describe(status);
  }
}

// Whatever is heard.
TEST_F(Allocation, NoneInTheExchange) {
  using Agreement = icat::Agreement<double>;
  Agreement a({.spans = true, .pace = true}), b({.index = 1, .spans = true, .pace = true});
  icat::Vector6<double> v;
  v << 0.1, 0.2, 0.3, 0, 0.1, 0;
  const icat::Vector6<double> half = v / 4, fast = 1e3 * v;
  EXPECT_EQ(count_allocations([&] {
              for (int k = 0; k < 60; ++k) {
                (void)a.propose(k % 10 == 9 ? fast : v, v);
                (void)b.propose(v, v);
                const long long round = k == 20 ? 1LL << 40 : a.next_round();
                (void)b.receive(0, round, a.send(round));
                const long long other = k == 40 ? -5 : b.next_round();
                (void)a.receive(1, other, b.send(other));
                (void)a.update(0.1 * k);
                (void)b.update(0.1 * k);
                (void)a.achieved(a.velocity(), k % 7 == 0 ? half : v);
              }
            }),
            0);
  EXPECT_TRUE(a.agreed());
}

TEST_F(Allocation, NoneInTheCooperation) {
  using Robot = icat::KinematicTree<double, 13>;
  Robot a = icat::uvms(icat::maris_arm<double>()), b = a;
  cooperate(a, b, a.frame("tool"), true);
}

TEST_F(Allocation, NoneInTheCooperationOfRobotsOfASizeKnownAtRunTime) {
  icat::KinematicTree<double> a({.joints = icat::axes_chain(icat::maris_arm<double>())}), b = a;
  cooperate(a, b, a.frame("end_effector"), false);
}

// Every task of the catalogue, the tree they read, and the controller they stand in.
template <class Robot>
void control(Robot& robot) {
  namespace task = icat::task;
  using Objective = icat::Objective<double>;
  const icat::FrameId hand = robot.frame("end_effector"), base = robot.base();
  const icat::Vector3<double> point(1, 2, 3);
  task::JointLimits<Robot> limits(robot);
  task::JointPosition<Robot> shape(robot, Eigen::VectorXd::Zero(7));
  task::Attitude<Robot> attitude(robot, base);
  task::LookAt<Robot> look(robot, hand, point);
  task::Occlusion<Robot> occlusion(robot, base, hand, Objective::at_least(0.3, 0.1));
  task::FrameDistance<Robot> distance(robot, hand, point, Objective::at_least(1, 0.1));
  task::Manipulability<Robot> dexterous(robot, hand, Objective::at_least(0.1, 0.01));
  task::CenterOfMass<Robot> center(robot, point);
  task::FramePosition<Robot> position(robot, hand, point);
  task::FrameOrientation<Robot> orientation(robot, hand, icat::Matrix3<double>::Identity());
  task::FramePose<Robot> pose(robot, hand, icat::IdentityPose{}, {.relative_to = base});
  task::FrameVelocity<Robot> velocity(robot, hand);
  task::Minimality<Robot> still(robot, icat::joint_columns(robot));
  task::GivenVelocity<Robot> given(robot, icat::joint_columns(robot, {"joint2"}));
  task::FunctionTask<Robot> own(robot, Objective::equal_to(1), [](const Robot& r, auto x, auto J) {
    x(0) = r.position(0);
    J(0, 0) = 1;
  });
  icat::Controller<Robot> controller(robot, {{"all",
                                              {{given, limits},
                                               {attitude, look, occlusion, distance},
                                               {dexterous, center, position, orientation, own},
                                               {pose, velocity},
                                               {shape, still}}},
                                             {"reach", {{limits}, {pose}}}});
  const auto measured = icat::Vector<double, Robot::size>::Constant(robot.dof(), 0.1).eval();
  icat::Vector<double, 7> q = icat::Vector<double, 7>::Constant(-0.4);
  icat::Status status = icat::Status::ok;
  EXPECT_EQ(count_allocations([&] {
              status = controller.start("reach", 0);
              for (int k = 0; k < 30 && status == icat::Status::ok; ++k) {
                const double t = 0.1 * k;
                q(2) = 0.01 * k;
                status = robot.update(q);
                if (k == 5) status = controller.switch_to("all", t, 1);
                if (k == 9) status = controller.set_given("joint4", true);
                if (status == icat::Status::ok) status = controller.step(t, measured);
                if (status == icat::Status::ok) status = pose.set_goal(robot.pose(hand));
                volatile double keep = controller.velocity()(0) + controller.command()(0);
                (void)keep;
              }
            }),
            0);
  EXPECT_EQ(status, icat::Status::ok) << icat::describe(status);
}

TEST_F(Allocation, NoneInTreesTasksAndControllers) {
  const auto joints = icat::axes_chain(icat::maris_arm<double>(), "vehicle");
  const std::vector<icat::LinkMass<double>> masses{{"vehicle", 10, {0, 0, 0}},
                                                   {"link3", 2, {0, 0, 0.1}}};
  icat::KinematicTree<double, 13> of_static_size(
      {.joints = joints, .base = icat::Base<double>::free(), .masses = masses});
  control(of_static_size);
  icat::KinematicTree<double> of_dynamic_size(
      {.joints = joints, .base = icat::Base<double>::surface(), .masses = masses});
  control(of_dynamic_size);
}

}  // namespace
