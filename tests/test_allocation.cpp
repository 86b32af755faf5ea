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
    icat::Tpik<double> tpik(h.dof, {.bounds = bounds});
    icat::Status status = icat::Status::not_started;
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

TEST_F(Allocation, NoneInTheCooperation) {
  using Robot = icat::Uvms<double, 7>;
  Robot a({.arm = icat::maris_arm<double>()}), b({.arm = icat::maris_arm<double>()});
  icat::task::ToolPose<Robot> tool_a(a, icat::task::PoseTaskOptions<double>{});
  icat::task::ToolPose<Robot> tool_b(b, icat::task::PoseTaskOptions<double>{});
  const std::vector<icat::Action<Robot>> actions_a{{"alone", {{tool_a}}}, {"carry", {{tool_a}}}};
  const std::vector<icat::Action<Robot>> actions_b{{"alone", {{tool_b}}}, {"carry", {{tool_b}}}};
  for (const bool spans : {false, true}) {
    const auto options = [&](std::size_t i) {
      return icat::Agent<Robot>::Options{.controller = {.scheme = icat::Scheme::parallel},
                                         .agreement = {.index = i, .spans = spans}};
    };
    icat::Agent<Robot> agent_a(a, actions_a, {{"carry", tool_a}}, options(0));
    icat::Agent<Robot> agent_b(b, actions_b, {{"carry", tool_b}}, options(1));
    icat::CentralizedController<Robot> central({{a, actions_a}, {b, actions_b}}, {});
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
                  check(agent_b.propose(t));
                  check(agent_a.receive(1, k, agent_b.send(k)));
                  check(agent_b.receive(0, k, agent_a.send(k)));
                  check(agent_a.step(t));
                  check(agent_b.step(t));
                  check(agent_a.step_arm_law(t));
                  volatile double keep = agent_a.joint_velocity(icat::Vector6<double>::Ones())(0);
                  (void)keep;
                  check(central.step(t, 1));
                }
              }),
              0);
    EXPECT_EQ(status, icat::Status::ok) << icat::describe(status);
  }
}

}  // namespace
