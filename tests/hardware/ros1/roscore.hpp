// SPDX-License-Identifier: BSD-3-Clause
// roscore on a port of its own, for one process of tests.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>

#include "tests/hardware/support/process.hpp"

namespace hardware {

/// A TCP port of the loopback that is free now.
inline int free_port() {
  const int handle = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  const bool done = ::bind(handle, reinterpret_cast<sockaddr*>(&address), size) == 0 &&
                    ::getsockname(handle, reinterpret_cast<sockaddr*>(&address), &size) == 0;
  ::close(handle);
  if (!done) throw std::runtime_error("no free port");
  return ntohs(address.sin_port);
}

/// Sets the environment of this process and its children, on the loopback, with logs below `logs`.
class Roscore {
 public:
  explicit Roscore(const std::string& logs) : port_(std::to_string(free_port())) {
    ::setenv("ROS_MASTER_URI", uri().c_str(), 1);
    ::setenv("ROS_IP", "127.0.0.1", 1);
    ::setenv("ROS_HOME", logs.c_str(), 1);
    ::setenv("ROS_LOG_DIR", logs.c_str(), 1);
    ::setenv("PYTHONUNBUFFERED", "1", 1);
    ::unsetenv("ROS_NAMESPACE");
    ::unsetenv("ROS_HOSTNAME");
  }
  std::string uri() const { return "http://127.0.0.1:" + port_; }
  bool start() {
    if (process_) return true;
    process_ = std::make_unique<Process>(std::vector<std::string>{"roscore", "-p", port_});
    return process_->wait_for("started core service [/rosout]", 60);
  }
  /// Its master and rosout are no children that a signal to its group reaches: it ends them itself.
  void stop() {
    if (process_) process_->kill(SIGINT);
    process_.reset();
  }
  ~Roscore() { stop(); }

 private:
  std::string port_;
  std::unique_ptr<Process> process_;
};

}  // namespace hardware
