// SPDX-License-Identifier: BSD-3-Clause
// What a back-end is: the least that is one, what is none, the loop around it, plants as back-ends.
#include <gtest/gtest.h>

#include <icat/control/back_end.hpp>
#include <icat/control/controller.hpp>
#include <icat/core/received.hpp>
#include <icat/mission/mission.hpp>
#include <icat/model/kinematic_tree.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <icat/sim/plant_back_end.hpp>
#include <icat/task/joint_tasks.hpp>

#include "support/allocation_counter.hpp"
#include "support/archetypes.hpp"

namespace {

using Robot = icat::KinematicTree<double>;
using State = icat::RobotState<Robot>;
using Velocity = icat::Vector<double, Eigen::Dynamic>;

//! [own]
// Two drives on a link of your own: they take velocities and report positions.
class TwoDrives {
 public:
  // Takes the messages until `time`. Nothing blocks, allocates or throws.
  icat::Status read(double time, icat::RobotState<Robot>& state) noexcept {
    for (int i = 0; i < 100; ++i) {  // bounded: many messages must not delay the cycle
      const auto feedback = receive();
      if (!feedback) break;
      heard_.put(*feedback, time);
    }
    state.q = heard_.value;
    state.time = heard_.time;  // the controller stops if it is older than `hold`
    return icat::Status::ok;
  }
  icat::Status write(double, const Velocity& command) noexcept {
    send({command(0), command(1)});
    return icat::Status::ok;
  }
  bool healthy(double time) const noexcept { return enabled_ && heard_.fresh(time, 0.05); }
  //! [own]

  void plug(bool in) { plugged_ = in; }
  void enable(bool on) { enabled_ = on; }
  const Eigen::Vector2d& sent() const { return sent_; }

 private:
  struct Maybe {
    Eigen::Vector2d value;
    bool there;
    explicit operator bool() const { return there; }
    const Eigen::Vector2d& operator*() const { return value; }
  };
  // A link without delay, to drives without dynamics.
  Maybe receive() {
    const bool there = plugged_ && waiting_;
    waiting_ = false;
    return {at_, there};
  }
  void send(const Eigen::Vector2d& velocity) {
    sent_ = velocity;
    if (!plugged_) return;
    at_ += 0.01 * velocity;
    waiting_ = true;
  }

  bool plugged_{true}, enabled_{true}, waiting_{true};
  Eigen::Vector2d at_{0.3, 0.5}, sent_{0, 0};
  icat::Received<Eigen::Vector2d> heard_{{0, 0}};
};

// --- the concept
// -----------------------------------------------------------------------------------

// Nothing but the three calls: no copy, no default.
template <class R>
struct Archetype {
  explicit Archetype(int) {}
  Archetype(const Archetype&) = delete;
  Archetype& operator=(const Archetype&) = delete;
  icat::Status read(double, icat::RobotState<R>&) noexcept { return icat::Status::ok; }
  icat::Status write(double, const icat::Vector<typename R::Scalar, R::size>&) noexcept {
    return icat::Status::ok;
  }
  bool healthy(double) const noexcept { return true; }
};
using Jointed = archetypes::Jointed<float, 3>;
static_assert(icat::BackEnd<Archetype<Jointed>, Jointed>);
static_assert(icat::BackEnd<Archetype<Robot>, Robot>);
static_assert(icat::BackEnd<TwoDrives, Robot>);
static_assert(!icat::BackEnd<Archetype<Robot>, Jointed>);

struct ThrowingRead : Archetype<Robot> {
  icat::Status read(double, State&) { return icat::Status::ok; }
};
struct SilentWrite : Archetype<Robot> {
  void write(double, const Velocity&) noexcept {}
};
struct HealthThatChanges : Archetype<Robot> {
  bool healthy(double) noexcept { return true; }
};
struct Unhealthy : Archetype<Robot> {
  bool healthy(double) const = delete;
};
static_assert(!icat::BackEnd<ThrowingRead, Robot>);
static_assert(!icat::BackEnd<SilentWrite, Robot>);
static_assert(!icat::BackEnd<HealthThatChanges, Robot>);
static_assert(!icat::BackEnd<Unhealthy, Robot>);
static_assert(!icat::BackEnd<int, Robot>);

// A plant that the library does not know: no more than what a back-end asks of it.
struct Sliding {
  Velocity x = Velocity::Zero(2), v = Velocity::Zero(2);
  icat::Pose<double> pose = icat::Pose<double>::Identity();
  icat::Status answer = icat::Status::ok;
  icat::Status step(const Velocity& command, double, double dt) {
    if (answer != icat::Status::ok) return answer;
    v = command;
    x += dt * v;
    return answer;
  }
  const Velocity& q() const { return x; }
  const icat::Pose<double>& base() const { return pose; }
  const Velocity& velocity() const { return v; }
};
static_assert(icat::VelocityPlant<Sliding, Robot>);
static_assert(icat::VelocityPlant<icat::KinematicPlant<Robot>, Robot>);
static_assert(!icat::VelocityPlant<Sliding, Jointed>);
static_assert(!icat::VelocityPlant<int, Robot>);

// --- the loop
// --------------------------------------------------------------------------------------

Robot arm() {
  using Joint = icat::Joint<double>;
  std::vector<Joint> joints(2);
  const char* names[] = {"shoulder", "elbow"};
  for (std::size_t i = 0; i < 2; ++i) {
    joints[i].name = names[i];
    joints[i].link = i == 0 ? "upper" : "lower";
    joints[i].parent = i == 0 ? "base" : "upper";
    joints[i].type = icat::JointType::revolute;
    joints[i].axis = {0, 0, 1};
    joints[i].origin.translation() << (i == 0 ? 0 : 0.5), 0, 0;
    joints[i].lower = -2;
    joints[i].upper = 2;
    joints[i].max_velocity = 1;
  }
  return Robot({.joints = joints});
}

struct Loop {
  Robot robot = arm();
  icat::task::JointPosition<Robot> pose{robot, Eigen::Vector2d(0.6, -0.4), {.gain = 2}};
  icat::Controller<Robot> controller{robot, {{"reach", {{pose}}}}};
  //! [mission]
  icat::Mission mission{
      {{.name = "standby", .fade = 0.2, .on = {{.event = "well", .to = "reach"}}},
       {.name = "reach", .action = "reach", .on = {{.event = "lost", .to = "standby"}}}}};
  //! [mission]
  State state{robot};

  //! [loop]
  template <icat::BackEnd<Robot> B>
  icat::Status cycle(B& back_end, double time) {
    icat::Status status = back_end.read(time, state);
    if (status == icat::Status::ok) status = robot.update(state.q, state.base);
    (void)mission.raise(back_end.healthy(time) && status == icat::Status::ok ? "well" : "lost");
    (void)mission.step(time);
    (void)mission.drive(controller, time);
    const double age = time - state.time;
    (void)controller.step(time, icat::InputAge{.state = age, .velocity = age, .pose = age});
    return back_end.write(time, controller.command());
  }
  //! [loop]
};

TEST(BackEnd, TheLoopCompilesWithTheLeast) {
  Loop loop;
  Archetype<Robot> least(0);
  for (int k = 0; k < 10; ++k) ASSERT_EQ(loop.cycle(least, 0.01 * k), icat::Status::ok);
}

TEST(BackEnd, WhatIsLostStopsTheControllerAndWhatComesBackStartsIt) {
  Loop loop;
  TwoDrives drives;
  drives.enable(false);
  double time = 0, fastest = 0;
  const auto run = [&](double seconds) {
    Eigen::Vector2d last = drives.sent();
    for (const double end = time + seconds; time < end; time += 0.01) {
      ASSERT_EQ(loop.cycle(drives, time), icat::Status::ok);
      fastest = std::max(fastest, (drives.sent() - last).norm());
      last = drives.sent();
    }
  };
  run(0.5);  // not enabled yet
  EXPECT_EQ(loop.mission.phase(), "standby");
  EXPECT_EQ(drives.sent().norm(), 0);
  drives.enable(true);
  run(1);
  EXPECT_EQ(loop.mission.phase(), "reach");
  EXPECT_GT(drives.sent().norm(), 0.1);

  drives.plug(false);
  run(0.05 + 0.2 + 0.03);  // heard of last, the stop, and some cycles
  EXPECT_EQ(loop.mission.phase(), "standby");
  EXPECT_EQ(drives.sent().norm(), 0);  // it goes on writing

  drives.plug(true);
  run(6);
  EXPECT_EQ(loop.mission.phase(), "reach");
  EXPECT_LT((loop.state.q - Eigen::Vector2d(0.6, -0.4)).norm(), 1e-3);
  EXPECT_LT(fastest, 0.1);  // 0.9 rad/s within 0.2 s are 0.045 per cycle
}

// --- plants
// ----------------------------------------------------------------------------------------

TEST(PlantBackEnd, HoldsTheCommandFromReadToRead) {
  const Robot robot = arm();
  icat::KinematicPlant<Robot> plant(robot, {.q = Eigen::Vector2d(0.1, 0.2)});
  icat::PlantBackEnd back_end(robot, plant);
  State state(robot);
  EXPECT_EQ(state.time, -icat::infinity<double>);
  ASSERT_EQ(back_end.read(5, state), icat::Status::ok);
  EXPECT_EQ(state.q(1), 0.2);
  EXPECT_EQ(state.time, 5);
  ASSERT_EQ(back_end.write(5, Eigen::Vector2d(1, -1)), icat::Status::ok);
  const long before = allocations;
  ASSERT_EQ(back_end.read(5.5, state), icat::Status::ok);
  ASSERT_EQ(back_end.read(5.75, state), icat::Status::ok);
  EXPECT_EQ(allocations, before);
  EXPECT_NEAR(state.q(0), 0.1 + 0.75, 1e-12);
  EXPECT_EQ(state.velocity(1), -1);
  EXPECT_TRUE(back_end.healthy(5.75));

  // Refused: what is held stays.
  EXPECT_EQ(back_end.write(6, Eigen::Vector3d::Zero()), icat::Status::wrong_size);
  EXPECT_EQ(back_end.write(6, Eigen::Vector2d(std::nan(""), 0)), icat::Status::non_finite);
  EXPECT_EQ(back_end.read(std::nan(""), state), icat::Status::non_finite);
  EXPECT_EQ(state.time, 5.75);
  ASSERT_EQ(back_end.read(6, state), icat::Status::ok);
  EXPECT_NEAR(state.q(0), 0.1 + 1, 1e-12);
  // A clock that jumps moves the plant by no more than a usual step; one that runs back by none.
  ASSERT_EQ(back_end.read(1e9, state), icat::Status::ok);
  EXPECT_LT(state.q(0), 0.1 + 1 + 0.51);
  const double q = state.q(0);
  ASSERT_EQ(back_end.read(0, state), icat::Status::ok);
  EXPECT_EQ(state.q(0), q);
}

TEST(PlantBackEnd, APlantThatFailsIsNotHealthy) {
  const Robot robot = arm();
  Sliding plant;
  icat::PlantBackEnd back_end(robot, plant);
  State state(robot);
  ASSERT_EQ(back_end.read(0, state), icat::Status::ok);
  plant.answer = icat::Status::numerical_failure;
  EXPECT_EQ(back_end.read(0.1, state), icat::Status::numerical_failure);
  EXPECT_FALSE(back_end.healthy(0.1));
  EXPECT_EQ(state.time, 0);
  plant.answer = icat::Status::ok;
  EXPECT_EQ(back_end.read(0.2, state), icat::Status::ok);
  EXPECT_TRUE(back_end.healthy(0.2));
}

}  // namespace
