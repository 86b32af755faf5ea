// SPDX-License-Identifier: BSD-3-Clause
// ros1.hpp against Debian's roscore, rostopic and a robot on rospy (robot.py). One node, so one
// program, in the order in which the tests stand here: the last ones end the master and the node.
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <thread>

#include "tests/hardware/ros1/ros1_test.hpp"

namespace {

using hardware::below;
using hardware::joint_names;
using hardware::now;
using hardware::Process;
using hardware::ready;
using hardware::receive_until;
using hardware::robot;
using hardware::roscore;
using icat::Ros1;
using icat::Ros1Options;
using icat::Status;

std::string refusal(const Ros1Options& options) {
  try {
    Ros1 ros(joint_names, options);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "none";
}

class Ros1Test : public testing::Test {
 protected:
  static void SetUpTestSuite() { ASSERT_TRUE(roscore().start()) << "roscore does not start"; }
};

TEST(Ros1Construction, SaysThatThereIsNoMaster) {
  const std::string uri = roscore().uri();
  ::signal(SIGINT, SIG_DFL);
  for (const char* bad : {"nonsense", "http://", "http://host", "http://:1", "https://host:1"}) {
    Ros1Options options;
    options.master = bad;
    EXPECT_EQ(refusal(options),
              "ROS 1: the master must be given as http://<host>:<port> (ROS_MASTER_URI), got '" +
                  std::string(bad) + "'");
  }
  Ros1Options options;
  options.node = "no name";
  EXPECT_NE(refusal(options).find("no name"), std::string::npos) << refusal(options);
  // The first that gets to the master decides for the process, its arguments, too.
  options.node = "icat";
  options.arguments = {"program", "--other", "/first/joint_states:=/renamed/joint_states",
                       "/first/odom:=/renamed/odom"};
  const double start = now();
  EXPECT_EQ(refusal(options), "ROS 1: no master answers at " + uri + ": is roscore running?");
  EXPECT_LT(now() - start, 2);
}

TEST_F(Ros1Test, LeavesSigintToTheCallerAndRenamesTopics) {
  Ros1 ros(joint_names, below("/first"));
  struct sigaction action {};
  ASSERT_EQ(::sigaction(SIGINT, nullptr, &action), 0);
  EXPECT_EQ(action.sa_handler, SIG_DFL);
  Process peer(robot("echo", "/renamed"));
  EXPECT_TRUE(receive_until(ros, 30, [&] { return ros.healthy(now()); }));
}

TEST_F(Ros1Test, RefusesNamesThatRosDoesNotTake) {
  EXPECT_NE(refusal({.twist = "a b"}).find("a b"), std::string::npos) << refusal({.twist = "a b"});
  // The same name for messages of two kinds.
  EXPECT_NE(refusal({.twist = "/two", .joint_velocities = "/two"}), "none");
}

// What Debian's own tools say and hear.
TEST_F(Ros1Test, Rostopic) {
  Ros1Options options = below("/tools");
  options.max_age = 0.5;  // a machine that tests do not own alone
  Ros1 ros(joint_names, options);
  Process joints({"rostopic", "pub", "-r", "50", "-s", "/tools/joint_states",
                  "sensor_msgs/JointState",
                  "{header: {stamp: now}, name: [wrist_of_the_left_arm, other, shoulder, elbow], "
                  "position: [3.5, 9, 1.5, -2.5], velocity: [0.3, 9, 0.1, 0.2], effort: []}"});
  Process odometry({"rostopic", "pub", "-r", "50", "-s", "/tools/odom", "nav_msgs/Odometry",
                    "{header: {stamp: now, frame_id: odom}, child_frame_id: base_link, "
                    "pose: {pose: {position: {x: 1, y: -2, z: 3}, "
                    "orientation: {x: 0.6, y: 0, z: 0, w: 0.8}}}, "
                    "twist: {twist: {linear: {x: 1, y: 2, z: 3}, angular: {x: 4, y: 5, z: 6}}}}"});
  Process twists({"rostopic", "echo", "-p", "/tools/cmd_vel"});
  Process velocities({"rostopic", "echo", "-p", "/tools/command"});
  ASSERT_TRUE(ready(ros));
  EXPECT_EQ(ros.joints()[0].value.position, 1.5);
  EXPECT_EQ(ros.joints()[1].value.position, -2.5);
  EXPECT_EQ(ros.joints()[2].value.position, 3.5);
  EXPECT_EQ(ros.joints()[2].value.velocity, 0.3);
  EXPECT_EQ(ros.joints()[2].value.effort, 0);
  const icat::Odometry& at = ros.odometry().value;
  EXPECT_EQ(at.position, (std::array<double, 3>{1, -2, 3}));
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(at.orientation[i], (std::array<double, 4>{0.6, 0, 0, 0.8})[i], 1e-15);
  }
  EXPECT_EQ(at.twist, (icat::Twist{1, 2, 3, 4, 5, 6}));

  for (int k = 0; k < 20; ++k) {
    EXPECT_EQ(ros.receive(now()), Status::ok);
    EXPECT_EQ(ros.write_twist({0.5, -0.25, 0.125, 1.5, -2.5, 3.5}, now()), Status::ok);
    EXPECT_EQ(ros.write_joint_velocities(std::array{0.75, -1.25, 2.25}, now()), Status::ok);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_TRUE(twists.wait_for(",0.5,-0.25,0.125,1.5,-2.5,3.5\n", 20)) << twists.output();
  EXPECT_TRUE(velocities.wait_for("0.75,-1.25,2.25\n", 20)) << velocities.output();

  // The robot falls silent: what the caller goes on commanding goes out as zero.
  joints.kill();
  const double killed = now();
  ASSERT_TRUE(receive_until(ros, 5, [&] { return !ros.healthy(now()); }));
  EXPECT_LT(now() - killed, 1.5);
  for (int k = 0; k < 20; ++k) {
    EXPECT_EQ(ros.receive(now()), Status::ok);
    EXPECT_EQ(ros.write_twist({0.5, 0, 0, 0, 0, 0}, now()), Status::stale_state);
    EXPECT_EQ(ros.write_joint_velocities(std::array{0.75, 0.0, 0.0}, now()), Status::stale_state);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_TRUE(twists.wait_for(",0.0,0.0,0.0,0.0,0.0,0.0\n", 20)) << twists.output();
  EXPECT_TRUE(velocities.wait_for("0.0,0.0,0.0\n", 20)) << velocities.output();
}

TEST_F(Ros1Test, BadMessagesLeaveTheGoodOnes) {
  Ros1Options options = below("/bad");
  options.queue = 1000;
  Ros1 ros(joint_names, options);
  Process peer(robot("bad", "/bad"));
  ASSERT_TRUE(receive_until(ros, 30, [&] { return ros.joints()[0].count > 0; }));
  ASSERT_TRUE(peer.wait_for("sent", 30));
  receive_until(ros, 0.5, [] { return false; });
  for (std::size_t i = 0; i < joint_names.size(); ++i) {
    EXPECT_EQ(ros.joints()[i].count, 1u);
    EXPECT_EQ(ros.joints()[i].value.position, 1);
    EXPECT_EQ(ros.joints()[i].value.velocity, 0.5);
  }
  EXPECT_EQ(ros.odometry().count, 1u);
  EXPECT_EQ(ros.odometry().value.position[0], 1);
  EXPECT_EQ(ros.odometry().value.orientation[3], 1);
  // 8 of joints and 7 of odometry that parse and are wrong, and what of the noise parses.
  EXPECT_GE(ros.refused().count, 15u);
  EXPECT_FALSE(ros.healthy(now()));
}

// The loop of a user: three joints go to a goal, and the robot stops when the loop ends.
TEST_F(Ros1Test, AUsersLoop) {
  Process peer(robot("echo", "/user"));
  ASSERT_TRUE(peer.wait_for("ready", 30));
  const std::array goal{0.5, -0.5, 0.2};
  const double end = now() + 8;
  const auto running = [&] { return now() < end; };
  const auto wait_for_the_next_cycle = [] {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  };
  std::string reported;
  const auto report = [&](const char* text) { reported = text; };
  //! [loop]
  icat::Ros1 robot({"shoulder", "elbow", "wrist_of_the_left_arm"},
                   {.joint_states = "/user/joint_states",
                    .odometry = "/user/odom",
                    .twist = "/user/cmd_vel",
                    .joint_velocities = "/user/command"});
  while (running()) {
    const double time = now();  // the caller's clock, s
    (void)robot.receive(time);
    std::array<double, 3> velocity;
    for (std::size_t i = 0; i < 3; ++i) {
      velocity[i] = 2 * (goal[i] - robot.joints()[i].value.position);
    }
    // Zeros are sent while the robot is not healthy.
    const icat::Status status = robot.write_joint_velocities(velocity, time);
    if (status != icat::Status::ok) report(icat::describe(status));
    (void)robot.write_twist({0.1, 0, 0, 0, 0, 0}, time);
    wait_for_the_next_cycle();
  }
  robot.stop();
  //! [loop]
  EXPECT_EQ(reported, "the robot's state is too old");  // until the connection is made
  ASSERT_TRUE(receive_until(robot, 2, [&] {
    return robot.joints()[0].value.velocity == 0 && robot.odometry().value.twist[0] == 0;
  }));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(robot.joints()[i].value.position, goal[i], 0.01);
  }
}

TEST_F(Ros1Test, KillingTheRobotStopsAndStartingItAgainIsNormalWork) {
  Process peer(robot("echo", "/killed"));
  Ros1 ros(joint_names, below("/killed"));
  ASSERT_TRUE(ready(ros));
  const double start = now();
  double killed = 0, stopped = 0, started = 0, well = 0;
  std::array<double, 3> before{};
  while (well == 0 && now() < start + 60) {
    const double time = now();
    EXPECT_EQ(ros.receive(time), Status::ok);
    if (killed == 0 && time > start + 1 && ros.healthy(time)) {
      peer.kill();
      killed = time;
      for (std::size_t i = 0; i < 3; ++i) before[i] = ros.joints()[i].value.position;
    }
    const Status status = ros.write_joint_velocities(std::array{0.1, 0.1, 0.1}, time);
    EXPECT_EQ(status == Status::ok, ros.healthy(time));
    if (killed > 0 && stopped == 0 && status == Status::stale_state) {
      stopped = time;
      // The last values stay, with their age.
      EXPECT_GT(std::max(ros.joints().age(time), ros.odometry().age(time)), 0.2);
      EXPECT_NEAR(ros.joints()[0].value.position, before[0], 0.1 * 0.05);  // what was on its way
    }
    // roscpp has seen the connection end.
    if (stopped > 0 && started == 0 && time > stopped + 0.5) {
      EXPECT_EQ(ros.joint_listeners(), 0u);
      peer.start();
      started = time;
    }
    if (started > 0 && status == Status::ok && ros.joint_listeners() > 0 &&
        ros.joints()[0].value.velocity == 0.1) {
      well = time;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  ASSERT_GT(well, 0);
  // max_age and a period, and what a busy machine adds.
  EXPECT_LT(stopped - killed, 0.2 + 0.3);
  std::printf("ROS 1, robot killed: latency of the stop %.2f s, of work after it starts %.2f s\n",
              stopped - killed, well - started);
}

TEST_F(Ros1Test, ARobotThatComesBackWithAnEarlierClockIsTaken) {
  Ros1 ros(joint_names, below("/clock"));
  auto peer = std::make_unique<Process>(robot("echo", "/clock"));
  ASSERT_TRUE(ready(ros));
  peer = std::make_unique<Process>(robot("behind", "/clock"));
  ASSERT_TRUE(receive_until(ros, 5, [&] { return !ros.healthy(now()); }));
  const auto refused = ros.refused().count;
  ASSERT_TRUE(ready(ros));
  EXPECT_EQ(ros.refused().count, refused + 2);  // one message of joints, one of odometry
  EXPECT_EQ(ros.refused().value, Status::time_reversed);
}

// A loop that stood still finds messages in the queue. Their age counts from when they came.
TEST_F(Ros1Test, WhatWaitedForTheLoopIsOld) {
  Ros1 ros(joint_names, below("/stall"));
  Process peer(robot("echo", "/stall"));
  ASSERT_TRUE(ready(ros));
  EXPECT_EQ(ros.receive(now()), Status::ok);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  peer.kill();
  std::this_thread::sleep_for(std::chrono::milliseconds(400));
  const auto before = ros.joints()[0].count;
  EXPECT_EQ(ros.receive(now()), Status::ok);
  EXPECT_GT(ros.joints()[0].count, before);
  EXPECT_GT(ros.joints().age(now()), 0.39);
  EXPECT_GT(ros.odometry().age(now()), 0.39);
  EXPECT_FALSE(ros.healthy(now()));
}

// Connections do not need the master. What comes after it does; roscpp does not tell a master that
// began anew what it has, a new object does.
TEST_F(Ros1Test, WithoutTheMasterConnectionsWorkOn) {
  auto ros = std::make_unique<Ros1>(joint_names, below("/master"));
  Process peer(robot("echo", "/master"));
  ASSERT_TRUE(ready(*ros));
  roscore().stop();
  const auto answers = [&](double velocity) {
    return receive_until(*ros, 10, [&] {
      (void)ros->write_joint_velocities(std::array{velocity, 0.0, 0.0}, now());
      return ros->healthy(now()) && ros->joints()[0].value.velocity == velocity;
    });
  };
  ASSERT_TRUE(answers(0.3));
  receive_until(*ros, 2, [] { return false; });
  ASSERT_TRUE(answers(0.4));
  ASSERT_TRUE(roscore().start());
  ASSERT_TRUE(answers(0.5));

  // A robot that starts now is not found by the old object.
  peer.kill();
  peer.start();
  ASSERT_TRUE(peer.wait_for("ready", 30));
  EXPECT_FALSE(ready(*ros, 3));
  ros.reset();
  ros = std::make_unique<Ros1>(joint_names, below("/master"));
  ASSERT_TRUE(ready(*ros));
  ASSERT_TRUE(answers(0.6));

  roscore().stop();
  EXPECT_NE(refusal(below("/none")).find("is roscore running?"), std::string::npos);
  const double start = now();
  ros.reset();  // does not wait for the master
  EXPECT_LT(now() - start, 1);
  ASSERT_TRUE(roscore().start());
}

// The master ends a node whose name another takes.
TEST_F(Ros1Test, ANodeThatIsShutDownIsNotHealthy) {
  Ros1 ros(joint_names, below("/usurped"));
  Process peer(robot("echo", "/usurped"));
  ASSERT_TRUE(ready(ros));
  Process usurper({ICAT_PEERS "/robot.py", "usurp"});
  ASSERT_TRUE(receive_until(ros, 30, [&] {
    return ros.write_twist({0.1, 0, 0, 0, 0, 0}, now()) == Status::not_started;
  }));
  EXPECT_FALSE(ros.healthy(now()));
  EXPECT_EQ(ros.write_joint_velocities(std::array{0.1, 0.1, 0.1}, now()), Status::not_started);
  ros.stop();
  EXPECT_FALSE(ready(ros, 1));
  EXPECT_EQ(refusal({}), "ROS 1: the node was shut down, which is for the rest of the process");
}

}  // namespace
