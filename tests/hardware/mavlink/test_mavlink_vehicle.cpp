// SPDX-License-Identifier: BSD-3-Clause
// The vehicle against single frames at chosen times.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "icat/adapters/mavlink.hpp"

namespace {

// Frames of a vehicle, packed by the generated headers: the bytes themselves are checked by
// test_mavlink_frames.
struct ArduMode {
  std::uint32_t number = 4;
  bool armed = true;
  std::uint8_t state = MAV_STATE_ACTIVE;
  std::uint8_t type = MAV_TYPE_SUBMARINE;
};

class Vehicle : public ::testing::Test {
 protected:
  template <class Pack>
  void put(Pack pack, double now, std::uint8_t system = 1, std::uint8_t component = 1) {
    mavlink_message_t m;
    pack(system, component, &numbers, &m);
    std::uint8_t bytes[280];
    vehicle.receive({bytes, mavlink_msg_to_send_buffer(bytes, &m)}, now);
  }
  void heartbeat(double now, ArduMode mode = {}, std::uint8_t system = 1,
                 std::uint8_t component = 1) {
    put(
        [&](auto s, auto c, auto* n, auto* m) {
          mavlink_msg_heartbeat_pack_status(s, c, n, m, mode.type, MAV_AUTOPILOT_ARDUPILOTMEGA,
                                            static_cast<std::uint8_t>(1 | (mode.armed ? 128 : 0)),
                                            mode.number, mode.state);
        },
        now, system, component);
  }
  void attitude(std::uint32_t stamp, double now, float yaw = 0, float roll = 0, float rate = 0) {
    put(
        [&](auto s, auto c, auto* n, auto* m) {
          mavlink_msg_attitude_pack_status(s, c, n, m, stamp, roll, 0, yaw, 0, 0, rate);
        },
        now);
  }
  void quaternion(std::uint32_t stamp, double now, std::array<float, 4> q) {
    const float offset[4] = {};
    put(
        [&](auto s, auto c, auto* n, auto* m) {
          mavlink_msg_attitude_quaternion_pack_status(s, c, n, m, stamp, q[0], q[1], q[2], q[3], 0,
                                                      0, 0, offset);
        },
        now);
  }
  void position(std::uint32_t stamp, double now, float x = 0, float vx = 0) {
    put(
        [&](auto s, auto c, auto* n, auto* m) {
          mavlink_msg_local_position_ned_pack_status(s, c, n, m, stamp, x, 0, 0, vx, 0, 0);
        },
        now);
  }
  void answer(std::uint16_t command, std::uint8_t result, double now, std::uint8_t to = 255) {
    put(
        [&](auto s, auto c, auto* n, auto* m) {
          mavlink_msg_command_ack_pack_status(s, c, n, m, command, result, 0, 0, to,
                                              to == 0 ? 0 : MAV_COMP_ID_ONBOARD_COMPUTER);
        },
        now);
  }
  // What goes out at `now`, by message.
  std::vector<mavlink_message_t> sent(double now) {
    std::vector<mavlink_message_t> result;
    icat::MavlinkCounts counts;
    icat::detail::mavlink::FrameReader reader;
    reader.push(vehicle.send(now), counts, [&](const auto& m) { result.push_back(m); });
    EXPECT_EQ(counts.skipped, 0u);
    return result;
  }
  static std::size_t count(const std::vector<mavlink_message_t>& all, std::uint32_t id) {
    std::size_t n = 0;
    for (const auto& m : all) n += m.msgid == id;
    return n;
  }
  static mavlink_command_long_t command(const std::vector<mavlink_message_t>& all) {
    mavlink_command_long_t c{};
    for (const auto& m : all) {
      if (m.msgid == MAVLINK_MSG_ID_COMMAND_LONG) mavlink_msg_command_long_decode(&m, &c);
    }
    return c;
  }
  static mavlink_set_position_target_local_ned_t set_point(
      const std::vector<mavlink_message_t>& all) {
    mavlink_set_position_target_local_ned_t t{};
    t.vx = NAN;
    for (const auto& m : all) {
      if (m.msgid == MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED) {
        mavlink_msg_set_position_target_local_ned_decode(&m, &t);
      }
    }
    return t;
  }

  mavlink_status_t numbers{};
  icat::MavlinkVehicle vehicle{icat::MavlinkOptions{.telemetry_rate = 0}};
};

TEST_F(Vehicle, IsHealthyWhenAllIsFreshAndItObeys) {
  EXPECT_FALSE(vehicle.healthy(0));
  EXPECT_EQ(vehicle.age(0), std::numeric_limits<double>::infinity());
  heartbeat(0);
  attitude(1000, 0);
  EXPECT_FALSE(vehicle.healthy(0));
  position(1000, 0);
  EXPECT_TRUE(vehicle.healthy(0));
  EXPECT_TRUE(vehicle.healthy(0.5));
  EXPECT_FALSE(vehicle.healthy(0.51));  // max_age
  EXPECT_FALSE(vehicle.healthy(NAN));
  EXPECT_FALSE(vehicle.healthy(-1));  // the clock jumped back: nothing is known of now
  attitude(4000, 3.1);
  position(4000, 3.1);
  EXPECT_FALSE(vehicle.healthy(3.1));  // the heartbeat
  for (const ArduMode& not_obeying :
       {ArduMode{.number = 2}, ArduMode{.armed = false}, ArduMode{.state = MAV_STATE_CRITICAL}}) {
    heartbeat(3.1);
    EXPECT_TRUE(vehicle.healthy(3.1));
    heartbeat(3.1, not_obeying);
    EXPECT_FALSE(vehicle.healthy(3.1));
  }
}

TEST_F(Vehicle, IgnoresOthers) {
  heartbeat(0, {}, 2, 1);
  heartbeat(0, {}, 1, 100);
  heartbeat(0, {.type = MAV_TYPE_QUADROTOR});
  EXPECT_EQ(vehicle.heartbeat().count, 0u);
  EXPECT_EQ(vehicle.counts().foreign, 2u);
  EXPECT_EQ(vehicle.counts().refused, 1u);
}

TEST_F(Vehicle, RefusesNonsenseAndKeepsTheLastValue) {
  attitude(1000, 1, 0.5f);
  position(1000, 1, 3);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinite = std::numeric_limits<float>::infinity();
  attitude(1010, 2, nan);
  attitude(1010, 2, infinite);
  attitude(1010, 2, 90);  // degrees
  attitude(1010, 2, 0, 0, nan);
  attitude(1010, 2, 0, 0, 100);
  quaternion(1010, 2, {1, 0.1f, 0, 0});
  quaternion(1010, 2, {0, 0, 0, 0});
  quaternion(1010, 2, {nan, 0, 0, 0});
  position(1010, 2, nan);
  position(1010, 2, 1e7f);
  position(1010, 2, 0, 60);
  EXPECT_EQ(vehicle.counts().refused, 11u);
  EXPECT_EQ(vehicle.age(2), 1);
  EXPECT_EQ(vehicle.odometry().position[0], 3);
  quaternion(1005, 3,
             {std::sqrt(0.5f), 0, 0, std::sqrt(0.5f)});  // older than the nonsense: it counts
  EXPECT_EQ(vehicle.attitude().time, 3);
  EXPECT_NEAR(vehicle.odometry().orientation[2], std::sqrt(0.5), 1e-7);
}

TEST_F(Vehicle, GivesTheTwistOnTheBody) {
  attitude(1000, 0, 1.57079632679f);  // nose to the east
  position(1000, 0, 0, 0.5f);         // to the north: to port
  EXPECT_NEAR(vehicle.odometry().twist[1], -0.5, 1e-7);
  EXPECT_NEAR(vehicle.odometry().twist[0], 0, 1e-7);
}

TEST_F(Vehicle, KnowsLateStampsFromAReboot) {
  attitude(50000, 0);
  position(50000, 0, 1);
  for (int k = 0; k < 20; ++k) position(49000 + static_cast<std::uint32_t>(k), 0.01 * k, 2);
  EXPECT_EQ(vehicle.odometry().position[0], 1);  // a burst that is late
  position(50100, 0.3, 3);
  EXPECT_EQ(vehicle.odometry().position[0], 3);
  for (int k = 0; k < 60; ++k) {
    attitude(100 + static_cast<std::uint32_t>(10 * k), 1 + 0.01 * k);
    position(100 + static_cast<std::uint32_t>(10 * k), 1 + 0.01 * k, 4);
    if (k < 50) {
      EXPECT_EQ(vehicle.odometry().position[0], 3) << k;
    }
  }
  EXPECT_EQ(vehicle.odometry().position[0], 4);
  EXPECT_EQ(vehicle.counts().reboots, 1u);
  EXPECT_NEAR(vehicle.position().time, 1.59, 1e-9);
}

// Our clock is set back by an hour just after the vehicle started anew.
TEST_F(Vehicle, KnowsARebootAlsoWhenTheClockJumpsBack) {
  position(50000, 4000, 1);
  for (std::uint32_t k = 0; k < 10; ++k) position(100 + 10 * k, 4000 + 0.01 * k, 2);
  for (std::uint32_t k = 0; k < 60; ++k) position(200 + 10 * k, 400 + 0.01 * k, 2);
  EXPECT_EQ(vehicle.odometry().position[0], 2);
  EXPECT_EQ(vehicle.counts().reboots, 1u);
}

TEST_F(Vehicle, RefusesFlagsThatItDoesNotKnow) {
  mavlink_message_t m;
  mavlink_msg_local_position_ned_pack_status(1, 1, &numbers, &m, 1, 2, 3, 4, 5, 6, 7);
  std::uint8_t bytes[280];
  const std::size_t n = mavlink_msg_to_send_buffer(bytes, &m);
  bytes[2] = 2;  // a flag that changes what follows; the CRC is right
  std::uint16_t crc = crc_calculate(bytes + 1, static_cast<std::uint16_t>(n - 3));
  crc_accumulate(mavlink_get_msg_entry(m.msgid)->crc_extra, &crc);
  bytes[n - 2] = static_cast<std::uint8_t>(crc & 0xFF);
  bytes[n - 1] = static_cast<std::uint8_t>(crc >> 8);
  vehicle.receive({bytes, n}, 0);
  EXPECT_EQ(vehicle.position().count, 0u);
  EXPECT_EQ(vehicle.counts().damaged, 1u);
}

TEST_F(Vehicle, StampsWrapAround) {
  position(0xFFFFFFF0u, 0, 1);
  position(5, 0.02, 2);
  EXPECT_EQ(vehicle.odometry().position[0], 2);
  EXPECT_EQ(vehicle.counts().reboots, 0u);
}

TEST_F(Vehicle, SendsZeroUnlessItIsWishedAndHealthy) {
  const std::uint32_t id = MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED;
  EXPECT_EQ(count(sent(0), id), 0u);  // until there is a wish
  heartbeat(0);
  attitude(1000, 0, 1.57079632679f);
  position(1000, 0);
  EXPECT_EQ(vehicle.set_velocity({0.3, 0.1, 0.05, 0.2}, 0), icat::Status::ok);
  auto t = set_point(sent(0));
  EXPECT_EQ(t.coordinate_frame, MAV_FRAME_LOCAL_NED);
  EXPECT_EQ(t.type_mask, 0x5C7);
  EXPECT_EQ(t.target_system, 1);
  EXPECT_NEAR(t.vx, -0.1, 1e-7);  // starboard is south
  EXPECT_NEAR(t.vy, 0.3, 1e-7);
  EXPECT_NEAR(t.vz, 0.05, 1e-7);
  EXPECT_NEAR(t.yaw_rate, 0.2, 1e-7);
  EXPECT_EQ(count(sent(0.01), id), 0u);  // each wish once
  EXPECT_EQ(count(sent(0.25), id), 0u);
  t = set_point(sent(0.26));  // the wish is too old
  EXPECT_EQ(t.vy, 0);
  EXPECT_EQ(t.yaw_rate, 0);
  EXPECT_EQ(count(sent(0.3), id), 0u);
  EXPECT_EQ(count(sent(0.37), id), 1u);  // 10 Hz
  for (const double bad : {double{NAN}, 1e300, 21.0}) {
    EXPECT_NE(vehicle.set_velocity({0.3, 0.1, 0.05, bad}, 0.4), icat::Status::ok);
    t = set_point(sent(0.4));
    EXPECT_EQ(t.vy, 0);
    EXPECT_EQ(t.yaw_rate, 0);
  }
  EXPECT_EQ(vehicle.set_velocity({0.3, 0, 0, 0}, 0.49), icat::Status::ok);
  EXPECT_NEAR(set_point(sent(0.49)).vy, 0.3, 1e-7);
  EXPECT_EQ(vehicle.set_velocity({0.3, 0, 0, 0}, 0.6), icat::Status::ok);
  EXPECT_EQ(set_point(sent(0.6)).vy, 0);  // attitude and position are too old
}

TEST_F(Vehicle, HeartbeatEachSecondAndSticksWhileGuided) {
  int beats = 0, sticks = 0;
  for (int k = 0; k < 500; ++k) {
    const double now = 0.01 * k;
    if (k == 200) heartbeat(now, {.number = 19});
    if (k == 300) heartbeat(now);
    const auto all = sent(now);
    beats += static_cast<int>(count(all, MAVLINK_MSG_ID_HEARTBEAT));
    const int n = static_cast<int>(count(all, MAVLINK_MSG_ID_MANUAL_CONTROL));
    sticks += n;
    if (k < 300) {
      EXPECT_EQ(n, 0) << k;
    }
    for (const auto& m : all) {
      if (m.msgid != MAVLINK_MSG_ID_MANUAL_CONTROL) continue;
      mavlink_manual_control_t c;
      mavlink_msg_manual_control_decode(&m, &c);
      EXPECT_TRUE(c.target == 1 && c.x == 0 && c.y == 0 && c.z == 500 && c.r == 0);
    }
  }
  EXPECT_EQ(beats, 5);
  EXPECT_NEAR(sticks, 10, 1);                                 // 2 s at 5 Hz
  EXPECT_EQ(count(sent(3.0), MAVLINK_MSG_ID_HEARTBEAT), 1u);  // the clock jumped back
}

TEST_F(Vehicle, RequestsAreRepeatedFiveTimes) {
  vehicle.arm();
  std::vector<double> times;
  for (int k = 0; k < 500; ++k) {
    const auto all = sent(0.01 * k);
    if (count(all, MAVLINK_MSG_ID_COMMAND_LONG) == 0) continue;
    times.push_back(0.01 * k);
    EXPECT_EQ(command(all).command, MAV_CMD_COMPONENT_ARM_DISARM);
    EXPECT_EQ(command(all).confirmation, times.size() - 1);
    EXPECT_EQ(command(all).param1, 1);
    EXPECT_EQ(vehicle.arm_request(), icat::MavlinkRequest::pending);
  }
  ASSERT_EQ(times.size(), 5u);
  EXPECT_NEAR(times[4], 2.0, 0.05);
  EXPECT_EQ(vehicle.arm_request(), icat::MavlinkRequest::unanswered);
}

TEST_F(Vehicle, RequestsAreDoneWhenAnsweredAndShown) {
  vehicle.arm();
  vehicle.set_mode(icat::ArduSubMode::guided);
  auto c = command(sent(0));
  EXPECT_EQ(c.command, MAV_CMD_DO_SET_MODE);  // the mode first
  EXPECT_EQ(c.param1, 1);
  EXPECT_EQ(c.param2, 4);
  heartbeat(0.01, {.number = 19, .armed = false});
  answer(MAV_CMD_COMPONENT_ARM_DISARM, MAV_RESULT_ACCEPTED, 0.02);  // to another question
  answer(MAV_CMD_DO_SET_MODE, MAV_RESULT_ACCEPTED, 0.02, 254);      // to somebody else
  heartbeat(0.03, {.armed = false});
  EXPECT_EQ(vehicle.mode_request(), icat::MavlinkRequest::pending);
  answer(MAV_CMD_DO_SET_MODE, MAV_RESULT_ACCEPTED, 0.04);
  EXPECT_EQ(vehicle.mode_request(), icat::MavlinkRequest::pending);
  heartbeat(1, {.armed = false});
  EXPECT_EQ(vehicle.mode_request(), icat::MavlinkRequest::done);
  EXPECT_EQ(command(sent(1)).command, MAV_CMD_COMPONENT_ARM_DISARM);
  answer(MAV_CMD_COMPONENT_ARM_DISARM, MAV_RESULT_TEMPORARILY_REJECTED, 1.1);
  EXPECT_EQ(command(sent(1.5)).confirmation, 1);
  answer(MAV_CMD_COMPONENT_ARM_DISARM, MAV_RESULT_FAILED, 1.6);
  EXPECT_EQ(vehicle.arm_request(), icat::MavlinkRequest::refused);
  EXPECT_EQ(count(sent(2.6), MAVLINK_MSG_ID_COMMAND_LONG), 0u);
}

// ArduSub refuses GUIDED while its filter has no position, and would arm in the mode that it is in.
TEST_F(Vehicle, DoesNotArmInAnotherMode) {
  vehicle.set_mode(icat::ArduSubMode::guided);
  vehicle.arm();
  EXPECT_EQ(command(sent(0)).command, MAV_CMD_DO_SET_MODE);
  answer(MAV_CMD_DO_SET_MODE, MAV_RESULT_FAILED, 0.1);
  EXPECT_EQ(vehicle.mode_request(), icat::MavlinkRequest::refused);
  EXPECT_EQ(vehicle.arm_request(), icat::MavlinkRequest::refused);
  EXPECT_EQ(count(sent(1), MAVLINK_MSG_ID_COMMAND_LONG), 0u);
  // The same where nobody answers; who asks for arming alone gets it in any mode.
  vehicle.set_mode(icat::ArduSubMode::guided);
  vehicle.arm();
  for (int k = 0; k < 500; ++k) {
    const auto all = sent(2 + 0.01 * k);
    if (count(all, MAVLINK_MSG_ID_COMMAND_LONG) > 0) {
      EXPECT_EQ(command(all).command, MAV_CMD_DO_SET_MODE);
    }
  }
  EXPECT_EQ(vehicle.arm_request(), icat::MavlinkRequest::unanswered);
  vehicle.arm();
  EXPECT_EQ(command(sent(8)).command, MAV_CMD_COMPONENT_ARM_DISARM);
}

TEST_F(Vehicle, DisarmingDoesNotWait) {
  vehicle.set_mode(icat::ArduSubMode::guided);
  EXPECT_EQ(command(sent(0)).command, MAV_CMD_DO_SET_MODE);
  vehicle.disarm();
  const auto c = command(sent(0.005));
  EXPECT_EQ(c.command, MAV_CMD_COMPONENT_ARM_DISARM);
  EXPECT_EQ(c.param1, 0);
  // An answer that was meant for arming does not end it: the heartbeat shows that it is armed.
  answer(MAV_CMD_COMPONENT_ARM_DISARM, MAV_RESULT_ACCEPTED, 0.01);
  heartbeat(0.5);
  EXPECT_EQ(vehicle.arm_request(), icat::MavlinkRequest::pending);
  heartbeat(1.5, {.armed = false});
  EXPECT_EQ(vehicle.arm_request(), icat::MavlinkRequest::done);
  EXPECT_EQ(command(sent(1.5)).command, MAV_CMD_DO_SET_MODE);  // then what waited
}

TEST_F(Vehicle, AsksForTelemetryUntilItComes) {
  vehicle = icat::MavlinkVehicle();
  std::vector<std::uint32_t> asked;
  const auto run = [&](int from, int to, bool telemetry) {
    asked.clear();
    for (int k = from; k < to; ++k) {
      const double now = 0.01 * k;
      const auto stamp = static_cast<std::uint32_t>(1000 + 10 * k);
      if (k % 100 == 0) heartbeat(now);
      if (telemetry) attitude(stamp, now);
      if (telemetry) position(stamp, now);
      const auto all = sent(now);
      if (count(all, MAVLINK_MSG_ID_COMMAND_LONG) == 0) continue;
      EXPECT_EQ(command(all).command, MAV_CMD_SET_MESSAGE_INTERVAL);
      EXPECT_EQ(command(all).param2, 20000);  // us of 50 Hz
      asked.push_back(static_cast<std::uint32_t>(command(all).param1));
      if (from >= 2000) answer(MAV_CMD_SET_MESSAGE_INTERVAL, MAV_RESULT_ACCEPTED, now);
    }
  };
  run(0, 2000, false);  // it never answers
  EXPECT_GT(asked.size(), 30u);
  EXPECT_LE(asked.size(), 40u);  // twice a second
  run(2000, 3000, true);
  EXPECT_LE(asked.size(), 2u);  // what was pending
  run(3000, 3100, false);
  EXPECT_EQ(asked.size(), 0u);
  run(3100, 3300, false);  // it fell silent but for its heartbeat
  EXPECT_EQ(asked, (std::vector<std::uint32_t>{MAVLINK_MSG_ID_ATTITUDE,
                                               MAVLINK_MSG_ID_LOCAL_POSITION_NED}));
}

TEST(MavlinkVehicle, RefusesOptionsThatMakeNoSense) {
  EXPECT_THROW(icat::MavlinkVehicle({.telemetry_rate = -1}), std::invalid_argument);
  EXPECT_THROW(icat::MavlinkVehicle({.telemetry_rate = NAN}), std::invalid_argument);
  EXPECT_THROW(icat::MavlinkVehicle({.max_age = 0}), std::invalid_argument);
  EXPECT_THROW(icat::MavlinkVehicle({.system = 1, .component = 1}), std::invalid_argument);
}

}  // namespace
