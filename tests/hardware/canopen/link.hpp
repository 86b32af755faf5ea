// SPDX-License-Identifier: BSD-3-Clause
// A CAN line with the drives of drives.py on it: a socket pair, or the interface that
// ICAT_CAN_INTERFACE names (uml.sh).
#pragma once

#include <sys/socket.h>

#include <cstdlib>
#include <stdexcept>
#include <string>

#include "icat/adapters/socketcan.hpp"
#include "tests/hardware/support/process.hpp"

namespace hardware {

class CanLine {
 public:
  explicit CanLine(const std::string& nodes)
      : interface_(interface()), can_(open()), drives_(command(nodes)) {
    if (!drives_.wait_for("ready", 30)) throw std::runtime_error("the drives do not start");
  }
  ~CanLine() {
    if (far_ >= 0) ::close(far_);
  }
  icat::SocketCan& can() { return can_; }
  Process& drives() { return drives_; }
  /// After a kill.
  void restart() {
    drives_.start();
    if (!drives_.wait_for("ready", 30)) throw std::runtime_error("the drives do not start");
  }
  static std::string interface() {
    const char* name = std::getenv("ICAT_CAN_INTERFACE");
    return name ? name : "";
  }

 private:
  icat::SocketCan open() {
    if (!interface_.empty()) return icat::SocketCan(interface_);
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends) != 0) throw std::runtime_error("socketpair");
    ::fcntl(ends[0], F_SETFD, FD_CLOEXEC);
    far_ = ends[1];  // inherited by the drives
    return icat::SocketCan::from_descriptor(ends[0]);
  }
  std::vector<std::string> command(const std::string& nodes) const {
    std::vector<std::string> c{ICAT_PYTHON, ICAT_PEERS "/drives.py", "--nodes", nodes};
    if (interface_.empty()) {
      c.insert(c.end(), {"--descriptor", std::to_string(far_)});
    } else {
      c.insert(c.end(), {"--interface", interface_});
    }
    return c;
  }

  std::string interface_;
  int far_{-1};
  icat::SocketCan can_;
  Process drives_;
};

}  // namespace hardware
