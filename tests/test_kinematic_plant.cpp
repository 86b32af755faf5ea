// SPDX-License-Identifier: BSD-3-Clause
// The plant without dynamics, for robots with all kinds of bases.
#include <gtest/gtest.h>

#include <icat/model/maris.hpp>
#include <icat/model/uvms.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <string>

#include "support/allocation_counter.hpp"
#include "support/states.hpp"

namespace {

using testing_support::make_pose;
using Uvms = icat::KinematicTree<double, 13>;
using Tree = icat::KinematicTree<double>;
using VectorN = icat::Vector<double, 13>;
using Vector6 = icat::Vector6<double>;

const Uvms& uvms() {
  static const Uvms robot = icat::uvms<double, 7>(icat::maris_arm<double>());
  return robot;
}
Tree two_joints(const icat::Base<double>& base) {
  return Tree(
      {.joints =
           {{.name = "a", .parent = "base", .link = "upper"},
            {.name = "b", .parent = "upper", .link = "lower", .type = icat::JointType::continuous}},
       .base = base});
}
VectorN command(double surge, double yaw) {
  VectorN y = VectorN::LinSpaced(13, 0.1, 1.3);
  y.tail<6>() << surge, 0, 0, 0, 0, yaw;
  return y;
}

TEST(KinematicPlant, IntegratesExactlyAndLags) {
  icat::KinematicPlant plant(uvms(), {.tracking_lag = 0.5});
  const VectorN y = command(1, 0);
  const double dt = 0.1;
  plant.step(y, 0, dt);
  const double expected = 1 - std::exp(-dt / 0.5);
  EXPECT_NEAR(plant.velocity()(7), expected, 1e-15);
  EXPECT_NEAR(plant.base().translation().x(), dt * expected, 1e-15);
  EXPECT_LT((plant.velocity().head<7>() - y.head<7>()).norm(), 1e-15);
  EXPECT_LT((plant.q() - dt * y.head<7>()).norm(), 1e-15);

  // Without a lag: a circle, whatever the step.
  icat::KinematicPlant circle(uvms());
  for (int k = 0; k < 3; ++k) circle.step(command(1, 1), k, std::numbers::pi / 3);
  EXPECT_LT((circle.base().translation() - Eigen::Vector3d(0, 2, 0)).norm(), 1e-14);
}

TEST(KinematicPlant, ACurrentCarriesAFreeBaseAndIsMeasured) {
  const auto start = make_pose<double>(1, 2, 3, 0.1, -0.2, 0.7);
  double asked = -1;
  icat::KinematicPlant plant(uvms(), {.base = start, .current = [&](double time) {
                                        asked = time;
                                        return Eigen::Vector3d(0.1, 0.2, -0.3);
                                      }});
  for (int k = 0; k < 100; ++k) plant.step(VectorN::Zero(), 0.1 * k, 0.1);
  EXPECT_NEAR(asked, 9.9, 1e-12);
  EXPECT_LT((plant.base().translation() - start.translation() - Eigen::Vector3d(1, 2, -3)).norm(),
            1e-12);
  EXPECT_LT(
      (plant.base().linear() * plant.velocity().segment<3>(7) - Eigen::Vector3d(0.1, 0.2, -0.3))
          .norm(),
      1e-12);
}

TEST(KinematicPlant, WhatIsNotActuatedStays) {
  icat::KinematicPlant plant(uvms(), {.not_actuated = icat::Columns({2, 7, 12})});
  for (int k = 0; k < 10; ++k) plant.step(command(1, 1), 0, 0.1);
  EXPECT_EQ(plant.q()(2), 0);
  EXPECT_GT(plant.q()(3), 0.1);
  EXPECT_EQ(plant.velocity()(2), 0);
  EXPECT_TRUE(plant.base().matrix().isIdentity(1e-15));
}

TEST(KinematicPlant, BasesMoveAsTheyCan) {
  // Fixed: where it was put.
  const auto at = make_pose<double>(1, 2, 3, 0.1, 0.2, 0.3);
  const Tree bolted = two_joints(icat::Base<double>::fixed());
  icat::KinematicPlant fixed(bolted, {.q = Eigen::Vector2d(1, 2), .base = at});
  fixed.step(Eigen::Vector2d(1, -4), 0, 1);
  EXPECT_EQ(fixed.q(), Eigen::Vector2d(2, -2));
  EXPECT_EQ(fixed.base().matrix(), at.matrix());

  // Two wheels: the arc of a circle.
  const Tree rover = two_joints(icat::Base<double>::differential_drive());
  icat::KinematicPlant wheels(rover);
  for (int k = 0; k < 10; ++k) wheels.step(Eigen::Vector4d(0, 40, 0.5, 0.1), 0, 1);
  EXPECT_EQ(wheels.q()(1), 400);  // nothing wraps it
  EXPECT_LT(
      (wheels.base().translation() - 5 * Eigen::Vector3d(std::sin(1), 1 - std::cos(1), 0)).norm(),
      1e-13);
  EXPECT_EQ(wheels.velocity(), Eigen::Vector4d(0, 40, 0.5, 0.1));

  // The plant does where it goes what the robot's Jacobian says.
  Tree robot = two_joints(icat::Base<double>::surface());
  icat::KinematicPlant vessel(robot, {.q = Eigen::Vector2d(0.3, -0.2), .base = at});
  ASSERT_EQ(robot.update(vessel.q(), vessel.base()), icat::Status::ok);
  const auto lower = robot.frame("lower");
  icat::Vector<double, 5> y(0.1, 0.2, 0.3, -0.4, 0.5);
  const Eigen::VectorXd expected = robot.jacobian(lower) * y;
  const auto before = robot.pose(lower);
  vessel.step(y, 0, 1e-6);
  ASSERT_EQ(robot.update(vessel.q(), vessel.base()), icat::Status::ok);
  EXPECT_LT((testing_support::difference(before, robot.pose(lower)) / 1e-6 - expected).norm(),
            1e-5);
}

TEST(KinematicPlant, SinglePrecisionFollowsDouble) {
  const auto robot = icat::uvms<float, 7>(icat::maris_arm<float>());
  icat::KinematicPlant single(robot, {.tracking_lag = 0.3});
  icat::KinematicPlant exact(uvms(), {.tracking_lag = 0.3});
  for (int k = 0; k < 1000; ++k) {
    single.step(command(0.3, 0.2).cast<float>(), 0.01 * k, 0.01);
    exact.step(command(0.3, 0.2), 0.01 * k, 0.01);
  }
  EXPECT_LT((single.base().cast<double>().matrix() - exact.base().matrix()).norm(), 1e-4);
}

TEST(KinematicPlant, NothingAllocates) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  icat::KinematicPlant plant(uvms(),
                             {.current = [](double) { return Eigen::Vector3d(0.1, 0, 0); }});
  EXPECT_EQ(count_allocations([&] { plant.step(VectorN::Ones(), 0, 0.1); }), 0);
}

template <class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "no exception";
}

TEST(KinematicPlant, ErrorsNameWhatIsWrong) {
  using Plant = icat::KinematicPlant<Uvms>;
  const auto message = [](const Plant::Options& options) {
    return message_of([&] { Plant plant(uvms(), options); });
  };
  EXPECT_EQ(message({.q = Eigen::Vector3d::Zero()}),
            "KinematicPlant: q has 3 entries for 7 joints");
  EXPECT_EQ(message({.q = icat::Vector<double, 7>::Constant(NAN)}),
            "KinematicPlant: q is not finite");
  icat::Pose<double> none = icat::Pose<double>::Identity();
  none.linear() *= 2;
  EXPECT_EQ(message({.base = none}),
            "KinematicPlant: the base's pose is not finite or not a rotation");
  EXPECT_EQ(message({.tracking_lag = -1}), "KinematicPlant: tracking_lag must be >= 0, got -1");
  EXPECT_EQ(message({.not_actuated = icat::Columns(std::vector<icat::Index>{13})}),
            "KinematicPlant: column 13 is not among the robot's 13");
  const Tree rover = two_joints(icat::Base<double>::differential_drive());
  EXPECT_EQ(message_of([&] {
              icat::KinematicPlant plant(
                  rover, {.current = [](double) { return Eigen::Vector3d(1, 0, 0); }});
            }),
            "KinematicPlant: a current carries a free base only: surge, sway, heave, roll, pitch, "
            "yaw");
  icat::KinematicPlant plant(rover);
  EXPECT_EQ(message_of([&] { plant.step(Eigen::Vector2d(1, 0), 0, 1); }),
            "KinematicPlant: a command of 2 columns, not 4");
}

}  // namespace
