// SPDX-License-Identifier: BSD-3-Clause
// The mission of 13_hardware against each of its back-ends, as a user runs it.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>

#include "tests/hardware/support/loop.hpp"
#include "tests/hardware/support/process.hpp"

namespace {

using hardware::Process;

/// The program, and what it says.
class Example {
 public:
  explicit Example(const std::string& back_end, std::vector<std::string> more = {})
      : folder_(std::string(ICAT_OUTPUT) + "/" + back_end),
        process_(command(back_end, std::move(more))) {}

  bool wait_for(const std::string& text, double seconds) {
    return process_.wait_for(text, seconds);
  }
  struct Entered {
    double time;
    std::string phase;
  };
  /// "   3.15 s  reach" a line.
  std::vector<Entered> phases() const {
    std::vector<Entered> all;
    std::istringstream lines(process_.output());
    for (std::string line; std::getline(lines, line);) {
      Entered e;
      std::string unit;
      std::istringstream words(line);
      if (words >> e.time >> unit >> e.phase && unit == "s") all.push_back(e);
    }
    return all;
  }
  std::string names() const {
    std::string all;
    for (const auto& e : phases()) all += e.phase + " ";
    return all;
  }
  /// At the end, m.
  double tool_error() const {
    const std::string key = "tool error ";
    const std::size_t at = process_.output().find(key);
    return at == std::string::npos ? 1e9
                                   : 1e-3 * std::atof(process_.output().c_str() + at + key.size());
  }
  /// The largest of all commanded velocities from `begin` to `end`, s.
  double largest_command(double begin, double end) const {
    std::ifstream file(folder_ + "/run.csv");
    std::string line;
    std::getline(file, line);
    double largest = -1;
    while (std::getline(file, line)) {
      std::istringstream cells(line);
      std::string cell;
      double t = 0;
      for (int column = 0; std::getline(cells, cell, ','); ++column) {
        const double x = std::atof(cell.c_str());
        if (column == 0) t = x;
        if (column >= 18 && t >= begin && t <= end) largest = std::max(largest, std::abs(x));
      }
    }
    return largest;
  }

 private:
  std::vector<std::string> command(const std::string& back_end, std::vector<std::string> more) {
    std::vector<std::string> all{ICAT_EXAMPLE, "--no-pictures", "--output",
                                 folder_,      "--back-end",    back_end};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }

  std::string folder_;
  Process process_;
};

// The mission holds the goal for 3 s once it was within 2 mm for a second: at its end it is there.
constexpr double tolerance = 2e-3;

void report(const char* back_end, const Example& example) {
  std::printf("13_hardware on %s: tool error %.3f mm after %.2f s\n", back_end,
              1e3 * example.tool_error(), example.phases().back().time);
}

TEST(HardwareExample, WithoutDynamics) {
  Example example("kinematic");
  ASSERT_TRUE(example.wait_for("tool error", 60));
  EXPECT_EQ(example.names(), "reach hold held ");
  EXPECT_LT(example.tool_error(), tolerance);
  report("kinematic", example);
}

TEST(HardwareExample, Mujoco) {
  Example example("mujoco");
  ASSERT_TRUE(example.wait_for("tool error", 60));
  EXPECT_EQ(example.names(), "reach hold held ");
  EXPECT_LT(example.tool_error(), tolerance);
  report("mujoco", example);
}

// One that the system has just called free.
int free_port() {
  const int file = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof at;
  ::bind(file, reinterpret_cast<sockaddr*>(&at), size);
  ::getsockname(file, reinterpret_cast<sockaddr*>(&at), &size);
  ::close(file);
  return ntohs(at.sin_port);
}

// `peer` dies while the robot moves, and is there again after 2 s. `limit`: how old what it says
// may be, s.
void dies_in_the_middle(Process& peer, const char* back_end, const std::string& option,
                        const std::string& value, double limit) {
  Example example(back_end, {option, value});
  // In motion for 2.5 s. On a busy machine a peer may be late before.
  double since = 0;
  std::size_t phases_then = 0;
  for (const double give_up = hardware::now() + 60; hardware::now() < give_up;) {
    (void)example.wait_for("tool error", 0.02);
    const auto now = example.phases();
    if (now.size() != phases_then) since = hardware::now();
    phases_then = now.size();
    if (!now.empty() && now.back().phase == "reach" && hardware::now() - since > 2.5) break;
  }
  const double moved = hardware::now() - since;
  peer.kill();
  std::this_thread::sleep_for(std::chrono::seconds(2));
  peer.start();
  ASSERT_TRUE(example.wait_for("tool error", 120));

  const auto phases = example.phases();
  ASSERT_GE(phases.size(), phases_then + 4) << example.names();
  EXPECT_TRUE(example.names().ends_with("reach hold held ")) << example.names();
  EXPECT_LT(example.tool_error(), tolerance);
  ASSERT_EQ(phases[phases_then - 1].phase, "reach") << example.names();
  ASSERT_EQ(phases[phases_then].phase, "standby") << example.names();
  ASSERT_EQ(phases[phases_then + 1].phase, "reach") << example.names();
  const double began = phases[phases_then - 1].time, killed = began + moved;
  const double lost = phases[phases_then].time, found = phases[phases_then + 1].time;
  // The rest is what schedules of two processes on a busy machine differ by.
  EXPECT_GT(lost - killed, limit - 0.2);
  EXPECT_LT(lost - killed, limit + 0.3);
  EXPECT_GT(found - killed, 2);
  // It moved before, and stands from a second after: 0.5 s at the limits of acceleration.
  EXPECT_GT(example.largest_command(began + 1, killed), 0.1);
  EXPECT_EQ(example.largest_command(lost + 1, found - 0.1), 0);
  std::printf(
      "13_hardware on %s: killed, not healthy after %.2f s, again %.2f s after it came back\n",
      back_end, lost - killed, found - killed - 2);
  report(back_end, example);
}

// Attitude and position may be 0.5 s old (MavlinkOptions::max_age).
TEST(HardwareExample, ArduSubDiesInTheMiddle) {
  const std::string port = std::to_string(free_port());
  Process autopilot({ICAT_PYTHON, ICAT_PEERS "/../mavlink/autopilot.py", "--port", port});
  ASSERT_TRUE(autopilot.wait_for("ready", 20));
  dies_in_the_middle(autopilot, "ardusub", "--udp", port, 0.5);
}

// Inside User Mode Linux, where there is a CAN line. Measurements may be 0.2 s old
// (canopen_arm.hpp).
TEST(HardwareExampleOnCan, TheDrivesDieInTheMiddle) {
  const char* line = std::getenv("ICAT_CAN_INTERFACE");
  ASSERT_NE(line, nullptr) << "run it by tests/hardware/canopen/uml.sh";
  Process drives({ICAT_PYTHON, ICAT_PEERS "/../canopen/drives.py", "--nodes", "1,2,3,4,5,6,7",
                  "--interface", line});
  ASSERT_TRUE(drives.wait_for("ready", 60));
  dies_in_the_middle(drives, "canopen", "--can", line, 0.2);
}

}  // namespace
