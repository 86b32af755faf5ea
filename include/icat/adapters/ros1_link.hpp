// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The interface between ros1.hpp (C++20) and ros1_boundary.hpp (C++17, with roscpp): plain data
/// only. Users include one of those two. C++17.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace icat {
namespace detail {
namespace ros1 {

/// A sensor_msgs/JointState as it came. The arrays are the message's: they end with the call.
struct JointStateView {
  const std::string* names;
  const double* positions;
  const double* velocities;
  const double* efforts;
  std::size_t name_count;
  std::size_t position_count;
  std::size_t velocity_count;
  std::size_t effort_count;
  double stamp;   // s, of the header
  double waited;  // s, between its arrival and this call
};

/// A nav_msgs/Odometry as it came, without covariances.
struct OdometryView {
  double position[3];
  double orientation[4];  // x, y, z, w
  double twist[6];        // linear, angular
  double stamp;           // s, of the header
  double waited;          // s, between its arrival and this call
};

/// Who gets what comes.
class Listener {
 public:
  virtual void joint_states(const JointStateView& message) noexcept = 0;
  virtual void odometry(const OdometryView& message) noexcept = 0;

 protected:
  ~Listener() = default;
};

/// What to open. A topic without a name is not opened.
struct Settings {
  std::string node;
  std::string master;
  std::vector<std::string> arguments;
  std::string joint_states;
  std::string odometry;
  std::string twist;
  std::string joint_velocities;
  std::size_t joints{0};  // entries of a command
  unsigned queue{1};      // messages of a topic that wait
  double master_timeout{1};
};

/// The topics of a node.
class Link {
 public:
  virtual ~Link() = default;
  /// Gives the listener all that has come, without waiting.
  virtual void receive(Listener& listener) noexcept = 0;
  /// Sends 6 numbers; false where roscpp could not.
  virtual bool send_twist(const double* twist) noexcept = 0;
  /// Sends `Settings::joints` numbers; false where roscpp could not.
  virtual bool send_joint_velocities(const double* velocities) noexcept = 0;
  virtual unsigned twist_listeners() const noexcept = 0;
  virtual unsigned joint_listeners() const noexcept = 0;
  /// False once the node was told to shut down.
  virtual bool running() const noexcept = 0;
};

/// In ros1_boundary.hpp. Null with a sentence in `error` where it fails. Does not throw.
std::unique_ptr<Link> open(const Settings& settings, std::string& error);

}  // namespace ros1
}  // namespace detail
}  // namespace icat
