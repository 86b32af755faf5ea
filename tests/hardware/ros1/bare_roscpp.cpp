// SPDX-License-Identifier: BSD-3-Clause
// C++17.
#include "tests/hardware/ros1/bare_roscpp.hpp"

#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64MultiArray.h>

namespace bare {
namespace {

struct Counter {
  long messages{0};
  void joint_states(const sensor_msgs::JointState&) { ++messages; }
  void odometry(const nav_msgs::Odometry&) { ++messages; }
};

}  // namespace

Costs costs(const std::string& prefix, std::size_t joints, int cycles) {
  ros::CallbackQueue joint_queue, odometry_queue;
  ros::NodeHandle joint_node, odometry_node;
  joint_node.setCallbackQueue(&joint_queue);
  odometry_node.setCallbackQueue(&odometry_queue);
  Counter heard_joints, heard_odometry;
  const auto joint_states =
      joint_node.subscribe(prefix + "/joint_states", 64, &Counter::joint_states, &heard_joints);
  const auto odometry =
      odometry_node.subscribe(prefix + "/odom", 64, &Counter::odometry, &heard_odometry);
  const auto twists = joint_node.advertise<geometry_msgs::Twist>(prefix + "/cmd_vel", 1);
  const auto velocities = joint_node.advertise<std_msgs::Float64MultiArray>(prefix + "/command", 1);
  for (int k = 0;
       k < 500 && (twists.getNumSubscribers() == 0 || velocities.getNumSubscribers() == 0 ||
                   joint_states.getNumPublishers() == 0 || odometry.getNumPublishers() == 0);
       ++k) {
    ros::WallDuration(0.01).sleep();
  }
  geometry_msgs::Twist twist;
  std_msgs::Float64MultiArray velocity;
  velocity.data.resize(joints);
  Costs made;
  for (int k = 0; k < cycles; ++k) {
    const long start = allocations_so_far();
    joint_queue.callAvailable(ros::WallDuration(0));
    const long after_joints = allocations_so_far();
    odometry_queue.callAvailable(ros::WallDuration(0));
    const long after_odometry = allocations_so_far();
    twists.publish(twist);
    const long after_twist = allocations_so_far();
    velocities.publish(velocity);
    made.joint_states += static_cast<double>(after_joints - start);
    made.odometry += static_cast<double>(after_odometry - after_joints);
    made.twist += static_cast<double>(after_twist - after_odometry);
    made.joint_velocities += static_cast<double>(allocations_so_far() - after_twist);
    ros::WallDuration(0.01).sleep();
  }
  made.joint_states /= static_cast<double>(heard_joints.messages);
  made.odometry /= static_cast<double>(heard_odometry.messages);
  made.twist /= cycles;
  made.joint_velocities /= cycles;
  return made;
}

}  // namespace bare
