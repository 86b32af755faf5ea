// SPDX-License-Identifier: BSD-3-Clause
// A sender of sensors' bytes: a process that says which port it listens at.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/hardware/support/process.hpp"
#include "tests/hardware/support/tcp.hpp"

namespace hardware {

/// Connects `port` to a sender that has just started: it writes "port <number> port".
inline void connect_to(Process& sender, Descriptor& port) {
  ASSERT_TRUE(sender.wait_for(" port\n", 30));
  port.reset(
      connect_within(static_cast<std::uint16_t>(std::atoi(sender.output().c_str() + 5)), 10));
  ASSERT_GE(port.get(), 0);
}

}  // namespace hardware
