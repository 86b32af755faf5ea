// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The side of ros1.hpp that knows roscpp. The headers of roscpp's messages name
/// `std::allocator<void>::rebind`, which C++20 has not: include this file in one source of your
/// program, compiled as C++17, which includes nothing else of icat. docs/ros1.md has the lines of
/// CMake.
///
/// Messages: sensor_msgs/JointState, nav_msgs/Odometry, geometry_msgs/Twist,
/// std_msgs/Float64MultiArray of ROS Noetic.
#pragma once

#if __cplusplus >= 202002L
#error "icat: compile the source that includes ros1_boundary.hpp as C++17; see docs/ros1.md"
#endif

#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64MultiArray.h>

#include <algorithm>
#include <cstdlib>
#include <exception>

#include "icat/adapters/ros1_link.hpp"

namespace icat {
namespace detail {
namespace ros1 {

/// roscpp ends the program where it cannot split this.
inline bool names_master(const std::string& uri) {
  const std::string http = "http://";
  if (uri.compare(0, http.size(), http) != 0) return false;
  const std::size_t colon = uri.find(':', http.size());
  return colon != std::string::npos && colon > http.size() &&
         std::atoi(uri.c_str() + colon + 1) > 0;
}

/// One node for each process: the first to come starts it, and it lives until the process ends.
inline bool start_node(const Settings& settings, std::string& error) {
  if (!::ros::isInitialized()) {
    ::ros::M_string remappings;
    for (const std::string& argument : settings.arguments) {
      const std::size_t at = argument.find(":=");
      if (at != std::string::npos) remappings[argument.substr(0, at)] = argument.substr(at + 2);
    }
    const char* environment = std::getenv("ROS_MASTER_URI");
    if (!settings.master.empty()) {
      remappings["__master"] = settings.master;
    } else if (remappings.count("__master") == 0) {
      remappings["__master"] = environment ? environment : "http://localhost:11311";  // ROS's own
    }
    const std::string& master = remappings["__master"];
    if (!names_master(master)) {
      error =
          "the master must be given as http://<host>:<port> (ROS_MASTER_URI), got '" + master + "'";
      return false;
    }
    ::ros::init(remappings, settings.node,
                ::ros::init_options::NoSigintHandler | ::ros::init_options::NoRosout);
    // Its calls would wait for a master for ever.
    ::ros::master::setRetryTimeout(::ros::WallDuration(settings.master_timeout));
  }
  if (::ros::isShuttingDown()) {
    error = "the node was shut down, which is for the rest of the process";
    return false;
  }
  if (!::ros::master::check()) {
    error = "no master answers at " + ::ros::master::getURI() + ": is roscore running?";
    return false;
  }
  if (!::ros::isStarted()) {
    ::ros::start();
    // roscpp 1.15.15 leaves a thread to its own devices while statics are destroyed.
    std::atexit([] { ::ros::shutdown(); });
  }
  return true;
}

/// See Link.
class RosLink : public Link {
 public:
  explicit RosLink(const Settings& settings) {
    node_.setCallbackQueue(&queue_);
    const ::ros::TransportHints at_once = ::ros::TransportHints().tcpNoDelay();
    if (!settings.joint_states.empty()) {
      joint_states_ = node_.subscribe(settings.joint_states, settings.queue,
                                      &RosLink::on_joint_states, this, at_once);
    }
    if (!settings.odometry.empty()) {
      odometry_ =
          node_.subscribe(settings.odometry, settings.queue, &RosLink::on_odometry, this, at_once);
    }
    // The newest command is the one that counts: none waits behind another.
    if (!settings.twist.empty()) {
      twist_publisher_ = node_.advertise<geometry_msgs::Twist>(settings.twist, 1);
    }
    if (!settings.joint_velocities.empty()) {
      joint_publisher_ = node_.advertise<std_msgs::Float64MultiArray>(settings.joint_velocities, 1);
    }
    velocities_.data.resize(settings.joints);
  }
  /// Whether all that was asked for is open.
  bool open(const Settings& settings) const {
    return (settings.joint_states.empty() || joint_states_) &&
           (settings.odometry.empty() || odometry_) &&
           (settings.twist.empty() || twist_publisher_) &&
           (settings.joint_velocities.empty() || joint_publisher_);
  }

  void receive(Listener& listener) noexcept override {
    listener_ = &listener;
    try {
      queue_.callAvailable(::ros::WallDuration(0));
    } catch (...) {  // of roscpp's, some of which are no std::exception: what has not come ages
    }
    listener_ = nullptr;
  }
  bool send_twist(const double* twist) noexcept override {
    twist_.linear.x = twist[0];
    twist_.linear.y = twist[1];
    twist_.linear.z = twist[2];
    twist_.angular.x = twist[3];
    twist_.angular.y = twist[4];
    twist_.angular.z = twist[5];
    return send(twist_publisher_, twist_);
  }
  bool send_joint_velocities(const double* velocities) noexcept override {
    std::copy(velocities, velocities + velocities_.data.size(), velocities_.data.begin());
    return send(joint_publisher_, velocities_);
  }
  unsigned twist_listeners() const noexcept override { return listeners(twist_publisher_); }
  unsigned joint_listeners() const noexcept override { return listeners(joint_publisher_); }
  bool running() const noexcept override { return ::ros::ok(); }

 private:
  using JointStateEvent = ::ros::MessageEvent<sensor_msgs::JointState const>;
  using OdometryEvent = ::ros::MessageEvent<nav_msgs::Odometry const>;

  template <class Message>
  static bool send(const ::ros::Publisher& publisher, const Message& message) noexcept {
    try {
      if (!publisher || !::ros::ok()) return false;
      publisher.publish(message);
      return true;
    } catch (...) {
      return false;
    }
  }
  static unsigned listeners(const ::ros::Publisher& publisher) noexcept {
    try {
      return publisher ? publisher.getNumSubscribers() : 0;
    } catch (...) {
      return 0;
    }
  }
  /// s, on the clock of ROS, which may have been set meanwhile.
  static double waited(const ::ros::Time& arrival) {
    return std::max(0.0, (::ros::Time::now() - arrival).toSec());
  }

  void on_joint_states(const JointStateEvent& event) {
    const sensor_msgs::JointState& m = *event.getMessage();
    listener_->joint_states({m.name.data(), m.position.data(), m.velocity.data(), m.effort.data(),
                             m.name.size(), m.position.size(), m.velocity.size(), m.effort.size(),
                             m.header.stamp.toSec(), waited(event.getReceiptTime())});
  }
  void on_odometry(const OdometryEvent& event) {
    const nav_msgs::Odometry& m = *event.getMessage();
    const geometry_msgs::Pose& pose = m.pose.pose;
    const geometry_msgs::Twist& twist = m.twist.twist;
    listener_->odometry(
        {{pose.position.x, pose.position.y, pose.position.z},
         {pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w},
         {twist.linear.x, twist.linear.y, twist.linear.z, twist.angular.x, twist.angular.y,
          twist.angular.z},
         m.header.stamp.toSec(),
         waited(event.getReceiptTime())});
  }

  Listener* listener_{nullptr};
  ::ros::CallbackQueue queue_;  // before what puts into it
  ::ros::NodeHandle node_;
  ::ros::Subscriber joint_states_;
  ::ros::Subscriber odometry_;
  ::ros::Publisher twist_publisher_;
  ::ros::Publisher joint_publisher_;
  geometry_msgs::Twist twist_;
  std_msgs::Float64MultiArray velocities_;
};

/// See ros1_link.hpp. Emitted where this file is included, though nobody calls it there.
__attribute__((used)) inline std::unique_ptr<Link> open(const Settings& settings,
                                                        std::string& error) {
  try {
    if (!start_node(settings, error)) return nullptr;
    std::unique_ptr<RosLink> link(new RosLink(settings));
    if (link->open(settings)) return link;
    error = "the master at " + ::ros::master::getURI() + " does not open the topics";
  } catch (const std::exception& reason) {  // a name that ROS does not take, no socket
    error = reason.what();
  } catch (...) {  // XmlRpc's, boost's interruption of a thread
    error = "roscpp failed without a reason";
  }
  return nullptr;
}

}  // namespace ros1
}  // namespace detail
}  // namespace icat
