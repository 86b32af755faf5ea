// SPDX-License-Identifier: BSD-3-Clause
// Servos, contact, gravity and errors of the simulation that is driven.
#include <gtest/gtest.h>

#include <icat/adapters/mujoco.hpp>
#include <icat/adapters/mujoco_plant.hpp>
#include <icat/model/uvms.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <icat/sim/plant_back_end.hpp>

#include "examples/support/mujoco/maris.hpp"
#include "tests/hardware/support/loop.hpp"

namespace {

using Uvms = icat::KinematicTree<double, 13>;
using Plant = icat::MujocoPlant<Uvms>;
using Velocity = icat::Vector<double, 13>;

static_assert(icat::VelocityPlant<Plant, Uvms>);
static_assert(icat::VelocityPlant<icat::MujocoPlant<icat::MujocoRobot>, icat::MujocoRobot>);
static_assert(icat::BackEnd<icat::PlantBackEnd<Uvms, Plant>, Uvms>);

Uvms uvms() {
  return icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>()});
}
support::MujocoModel in_pool() {
  return support::load_mujoco(support::mjcf(icat::maris_dynamics<double>(), support::pool()));
}
Eigen::VectorXd folded() {
  Eigen::VectorXd q(7);
  q << 0.3, 0.7, -0.2, -1.8, 0.4, 0.9, 0.1;
  return q;
}
icat::Pose<double> at(double x, double y, double z) {
  icat::Pose<double> pose = icat::Pose<double>::Identity();
  pose.translation() << x, y, z;
  pose.rotate(Eigen::AngleAxisd(0.8, Eigen::Vector3d(0.2, -0.1, 1).normalized()));
  return pose;
}

// Sine waves of every column: what a control loop may ask for.
Velocity wave(double t) {
  Velocity y;
  for (icat::Index i = 0; i < 13; ++i) {
    y(i) = 0.15 * std::sin(0.8 * t + static_cast<double>(i)) * (1 - std::exp(-t));
  }
  return y;
}

TEST(MujocoPlant, FollowsAsThePlantWithoutDynamics) {
  const auto model = in_pool();
  const Uvms robot = uvms();
  const auto start = at(-1, -1, 1);
  Plant plant(robot, *model, {.q = folded(), .base = start});
  icat::KinematicPlant<Uvms> ideal(robot, {.q = folded(), .base = start});
  double joint = 0, velocity = 0, position = 0;
  for (int k = 0; k < 2000; ++k) {
    const double t = 0.01 * k;
    ASSERT_EQ(plant.step(wave(t), t, 0.01), icat::Status::ok);
    ideal.step(wave(t), t, 0.01);
    joint = std::max(joint, (plant.q() - ideal.q()).cwiseAbs().maxCoeff());
    velocity = std::max(velocity, (plant.velocity() - wave(t)).cwiseAbs().maxCoeff());
    position = std::max(position, (plant.base().translation() - ideal.base().translation()).norm());
  }
  // A lag τ behind a wave of 0.15 · 0.8 per s² is 0.12 τ in velocity, with τ = 0.1 s at most; the
  // way is 0.15 τ behind. As much again for the water and for what arm and base do to each other;
  // the light joints of the wrist feel those most (measured: 0.020 rad).
  EXPECT_LT(velocity, 2 * 0.12 * 0.1);
  EXPECT_LT(joint, 0.03);
  EXPECT_LT(position, 2 * std::sqrt(3) * 0.15 * 0.1);
  EXPECT_GT((plant.base().translation() - start.translation()).norm(), 0.1);  // it went somewhere
}

// The robot may be another model, with its columns in another order.
TEST(MujocoPlant, ColumnsAreTheRobots) {
  const auto model = in_pool();
  const Uvms tree = uvms();
  const icat::MujocoRobot foreign(*model, "vehicle");  // base first
  Plant first(tree, *model, {.q = folded(), .base = at(0, 0, 1)});
  icat::MujocoPlant<icat::MujocoRobot> second(foreign, *model,
                                              {.q = folded(), .base = at(0, 0, 1)});
  for (int k = 0; k < 300; ++k) {
    const Velocity y = wave(0.01 * k);
    Eigen::VectorXd other(13);
    other << y.tail<6>(), y.head<7>();
    ASSERT_EQ(first.step(y, 0, 0.01), icat::Status::ok);
    ASSERT_EQ(second.step(other, 0, 0.01), icat::Status::ok);
  }
  EXPECT_EQ((first.q() - second.q()).norm(), 0);
  EXPECT_EQ((first.base().matrix() - second.base().matrix()).norm(), 0);
  EXPECT_EQ((first.velocity().tail<6>() - second.velocity().head<6>()).norm(), 0);
  // What both say of the hand is the same, too.
  Uvms a = tree;
  icat::MujocoRobot b(*model, "vehicle");
  ASSERT_EQ(a.update(first.q(), first.base()), icat::Status::ok);
  ASSERT_EQ(b.update(second.q(), second.base()), icat::Status::ok);
  const Eigen::Vector3d wrist(-0.1455, 0, 1.1345);  // MuJoCo's links have their frames at ⟨b⟩
  EXPECT_LT((a.pose(a.frame("link7")).translation() - b.pose(b.frame("link7")) * wrist).norm(),
            1e-9);
}

TEST(MujocoPlant, PeriodsThatAreNoMultipleOfTheStepAddUp) {
  const auto model = in_pool();
  Plant plant(uvms(), *model);
  const Velocity still = Velocity::Zero();
  for (int k = 1; k <= 1000; ++k) {
    ASSERT_EQ(plant.step(still, 0, 0.0033), icat::Status::ok);
    ASSERT_LE(std::abs(plant.data().time - 0.0033 * k), 0.001 + 1e-9) << k;  // half a step
  }
}

TEST(MujocoPlant, TheSeabedStopsTheVehicle) {
  const auto model = in_pool();
  std::vector<double> most(13, 1e9);
  most[9] = 500;  // heave, N
  Plant plant(uvms(), *model,
              {.q = Eigen::VectorXd::Constant(7, -0.1), .base = at(2, 2, 1.5), .max_force = most});
  Velocity down = Velocity::Zero();
  down(9) = 0.3;
  int contacts = 0;
  for (int k = 0; k < 1000; ++k) {
    ASSERT_EQ(plant.step(down, 0, 0.01), icat::Status::ok);
    contacts = std::max(contacts, plant.data().ncon);
    ASSERT_LE(std::abs(plant.force(9)), 500);
  }
  EXPECT_GT(contacts, 0);
  EXPECT_LT(plant.base().translation().z(), 3.05);  // 1.5 + 0.3 · 10 were there none
  EXPECT_LT(std::abs(plant.velocity()(9)), 0.05);
  // The integral did not wind up: away again at once.
  for (int k = 0; k < 100; ++k) ASSERT_EQ(plant.step(-down, 0, 0.01), icat::Status::ok);
  EXPECT_LT(plant.velocity()(9), -0.2);
}

// On land: 29 kg on a wall; the integral holds them from the first step on.
TEST(MujocoPlant, AnArmInAirDoesNotSag) {
  const auto model = support::load_mujoco(
      "<mujoco><compiler angle='radian'/><worldbody><body name='base' pos='0 0 1'>"
      "<geom type='box' size='.1 .1 .1' contype='0'/><body name='upper'><joint name='joint1' "
      "axis='0 1 0'/>"
      "<geom type='capsule' fromto='0 0 0 .5 0 0' size='.05' mass='20' contype='0'/>"
      "<body name='lower' pos='.5 0 0'><joint name='joint2' axis='0 1 0'/>"
      "<geom type='capsule' fromto='0 0 0 .4 0 0' size='.04' mass='9' contype='0'/>"
      "</body></body></body></worldbody></mujoco>");
  const icat::MujocoRobot robot(*model, "base");
  icat::MujocoPlant<icat::MujocoRobot> plant(robot, *model);
  EXPECT_LT((plant.base().translation() - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
  const Eigen::VectorXd start = plant.q();
  for (int k = 0; k < 500; ++k) {
    ASSERT_EQ(plant.step(Eigen::Vector2d::Zero(), 0, 0.01), icat::Status::ok);
  }
  EXPECT_LT((plant.q() - start).norm(), 1e-9);
  EXPECT_GT(std::abs(plant.force(0)), 9.81 * (20 * 0.25 + 9 * 0.7) * 0.99);  // N m
  // While it swings the weight's torque changes by d = 55 and 4 N m/s, and the integral follows:
  // the velocity is 4τ² M⁻¹ d off, 0.04 rad/s in the lighter joint.
  for (int k = 0; k < 200; ++k) {
    ASSERT_EQ(plant.step(Eigen::Vector2d(0.5, -0.3), 0, 0.01), icat::Status::ok);
  }
  EXPECT_NEAR(plant.velocity()(0), 0.5, 0.05);
  EXPECT_NEAR(plant.velocity()(1), -0.3, 0.05);
}

TEST(MujocoPlant, WhatIsNotActuatedIsFree) {
  const auto model = in_pool();
  Plant plant(uvms(), *model,
              {.q = folded(), .base = at(0, 0, 1), .not_actuated = icat::Columns({1, 10, 11})});
  for (int k = 0; k < 100; ++k) ASSERT_EQ(plant.step(wave(k), 0, 0.01), icat::Status::ok);
  for (const icat::Index c : {1, 10, 11}) EXPECT_EQ(plant.force(c), 0);
  EXPECT_NE(plant.force(0), 0);
}

TEST(MujocoPlant, ASimulationThatBreaksIsNotHealthy) {
  const auto model = in_pool();
  const Uvms robot = uvms();
  Plant plant(robot, *model, {.q = folded()});
  icat::PlantBackEnd back_end(robot, plant);
  icat::RobotState<Uvms> state(robot);
  ASSERT_EQ(back_end.read(0, state), icat::Status::ok);
  ASSERT_EQ(back_end.write(0, wave(1)), icat::Status::ok);
  ASSERT_EQ(back_end.read(0.1, state), icat::Status::ok);
  EXPECT_TRUE(back_end.healthy(0.1));
  mju_user_warning = [](const char*) {};  // which goes to a file otherwise
  plant.data().qvel[3] = 1e12;
  const Eigen::VectorXd q = plant.q();
  EXPECT_EQ(back_end.read(0.2, state), icat::Status::numerical_failure);
  EXPECT_FALSE(back_end.healthy(0.2));
  EXPECT_EQ(state.time, 0.1);
  EXPECT_EQ((plant.q() - q).norm(), 0);
  EXPECT_EQ(back_end.read(0.3, state), icat::Status::numerical_failure);
}

TEST(MujocoPlant, BadInputIsRefused) {
  const auto model = in_pool();
  Plant plant(uvms(), *model, {.q = folded()});
  Velocity bad = Velocity::Zero();
  bad(4) = std::nan("");
  EXPECT_EQ(plant.step(bad, 0, 0.01), icat::Status::non_finite);
  EXPECT_EQ(plant.step(Velocity::Zero(), 0, std::nan("")), icat::Status::non_finite);
  EXPECT_EQ(plant.data().time, 0);

  const icat::MujocoRobot robot(*model, "vehicle");
  icat::MujocoPlant<icat::MujocoRobot> dynamic(robot, *model);
  EXPECT_EQ(dynamic.step(Eigen::VectorXd::Zero(3), 0, 0.01), icat::Status::wrong_size);
}

std::string message(const Uvms& robot, const mjModel& model, Plant::Options options) {
  try {
    Plant plant(robot, model, std::move(options));
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(MujocoPlant, ErrorsNameWhatIsWrong) {
  const auto model = in_pool();
  const Uvms robot = uvms();
  EXPECT_EQ(message(robot, *model, {.q = Eigen::Vector3d::Zero()}),
            "MujocoPlant: q has 3 entries for 7 joints");
  EXPECT_EQ(message(robot, *model, {.joint_lag = 0.005}),
            "MujocoPlant: a lag must be at least five time steps of 0.002 s, got 0.005");
  EXPECT_EQ(message(robot, *model, {.base_body = "boat"}),
            "MujocoPlant: the model has no body 'boat'");
  EXPECT_EQ(message(robot, *model, {.base_body = "link1"}),
            "MujocoPlant: the base must be Base::free() on a free joint, or fixed on a fixed body; "
            "'link1' has none, the robot's base 6 columns");
  EXPECT_EQ(message(robot, *model, {.max_force = {1, 2}}),
            "MujocoPlant: max_force has 2 entries for 13 columns");
  EXPECT_EQ(message(robot, *model, {.not_actuated = icat::Columns({13})}),
            "MujocoPlant: column 13 is not among the robot's 13");
  const auto other = support::load_mujoco(
      "<mujoco><worldbody><body name='vehicle'><freejoint/><geom size='1'/><body>"
      "<joint name='joint1'/><geom size='1'/></body></body></worldbody></mujoco>");
  EXPECT_EQ(message(robot, *other, {}),
            "MujocoPlant: the model has no joint 'joint2'; there are 'joint1'");
}

// Latency: how long a control loop waits for read and write.
TEST(MujocoPlant, ALoopInRealTime) {
  const auto model = in_pool();
  const Uvms robot = uvms();
  Plant plant(robot, *model, {.q = folded(), .base = at(0, 0, 1)});
  icat::PlantBackEnd back_end(robot, plant);
  icat::RobotState<Uvms> state(robot);
  const double rate = 200, seconds = hardware::loop_seconds();
  hardware::Latencies latencies(static_cast<std::size_t>(rate * seconds) + 1);
  const double start = hardware::now();
  bool well = true;
  const long made = hardware::run_loop(rate, seconds, [&](double now) {
    well = back_end.read(now, state) == icat::Status::ok && well;
    well = back_end.write(now, wave(now - start)) == icat::Status::ok && well;
    latencies.add(hardware::now() - now);
  });
  latencies.print("mujoco_plant, read and write", rate, seconds, made);
  EXPECT_TRUE(well);
  EXPECT_EQ(made, 0);
  EXPECT_NEAR(plant.data().time, seconds, 0.05);  // it kept up with the clock
  EXPECT_LT(latencies.quantile(0.5), 0.005);      // the period
}

}  // namespace
