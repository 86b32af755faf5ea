// SPDX-License-Identifier: BSD-3-Clause
// The vehicle against autopilot.py: pymavlink's messages over UDP, and what ArduSub does with them.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <optional>
#include <string>

#include "icat/adapters/mavlink_back_end.hpp"
#include "icat/adapters/udp.hpp"
#include "icat/model/kinematic_tree.hpp"
#include "tests/hardware/support/loop.hpp"
#include "tests/hardware/support/process.hpp"

namespace {

using hardware::now;
using Robot = icat::KinematicTree<double>;

std::string free_port() { return std::to_string(icat::UdpSocket::listen("127.0.0.1", 0).port()); }

// A vehicle that has surge, sway, heave and yaw, and no arm.
Robot robot() {
  Eigen::Matrix<double, 6, 4> motion = Eigen::Matrix<double, 6, 4>::Zero();
  motion(0, 0) = motion(1, 1) = motion(2, 2) = motion(5, 3) = 1;
  return Robot({.base = icat::Base<double>(motion), .root = "rov"});
}

class Mavlink : public ::testing::Test {
 protected:
  Mavlink() : port(free_port()) {}

  void start(const std::vector<std::string>& options = {}) {
    std::vector<std::string> command{ICAT_PYTHON, std::string(ICAT_PEERS) + "/autopilot.py",
                                     "--port", port};
    command.insert(command.end(), options.begin(), options.end());
    autopilot.emplace(command);
    ASSERT_TRUE(autopilot->wait_for("ready", 20));
    if (!socket) {
      socket.emplace(
          icat::UdpSocket::connect("127.0.0.1", static_cast<std::uint16_t>(std::stoi(port))));
    }
  }
  // A cycle with the wish `v`, or none.
  void cycle(const std::array<double, 4>* v) {
    std::uint8_t bytes[2048];
    for (std::size_t n; (n = socket->receive(bytes)) > 0;) vehicle.receive({bytes, n}, now());
    if (v) {
      EXPECT_EQ(vehicle.set_velocity(*v, now()), icat::Status::ok);
    }
    socket->send(vehicle.send(now()));
  }
  void run(double seconds, const std::array<double, 4>* v = nullptr) {
    hardware::run_loop(100, seconds, [&](double) { cycle(v); });
  }
  // Until `what`, for `seconds` at most.
  template <class What>
  bool until(What what, double seconds, const std::array<double, 4>* v = nullptr) {
    const double end = now() + seconds;
    while (!what() && now() < end) run(0.01, v);
    return what();
  }
  bool until_healthy() {
    vehicle.set_mode(icat::ArduSubMode::guided);
    vehicle.arm();
    return until([&] { return vehicle.healthy(now()); }, 10);
  }

  std::string port;
  std::optional<hardware::Process> autopilot;
  std::optional<icat::UdpSocket> socket;
  icat::MavlinkVehicle vehicle;
};

TEST_F(Mavlink, FollowsVelocities) {
  start({"--lag", "0.2", "--roll", "0.1", "--pitch", "-0.2", "--yaw", "0.7", "--depth", "5"});
  ASSERT_TRUE(until_healthy());
  EXPECT_TRUE(until([&] { return vehicle.arm_request() == icat::MavlinkRequest::done; }, 3));
  EXPECT_EQ(vehicle.mode_request(), icat::MavlinkRequest::done);
  const std::array<double, 4> wish{0.3, -0.2, 0.1, 0.25};
  run(2.5, &wish);
  // What is left after 2.5 s of a lag of 0.2 s is 4e-6; what turns at 0.25 rad/s has turned by
  // 2e-2 until a message of 50 Hz and a velocity of 100 Hz is there, and the lag of 0.2 s leaves
  // the velocity 0.05 behind: 0.07 of 0.37 m/s.
  auto o = vehicle.odometry();
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(o.twist[i], wish[i], 0.026) << i;
  EXPECT_NEAR(o.twist[5], 0.25, 1e-3);
  EXPECT_GT(o.position[2], 5);
  EXPECT_EQ(vehicle.counts().damaged, 0u);
  EXPECT_EQ(vehicle.counts().lost, 0u);
  EXPECT_EQ(vehicle.counts().reboots, 0u);

  // No wish: zero goes out after 0.25 s, and the vehicle stops; it stays healthy.
  run(2);
  o = vehicle.odometry();
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(o.twist[i], 0, 1e-3) << i;
  EXPECT_TRUE(vehicle.healthy(now()));

  // A mode of its own takes it out of our hands.
  vehicle.set_mode(icat::ArduSubMode::alt_hold);
  EXPECT_TRUE(until([&] { return !vehicle.healthy(now()); }, 3, &wish));
  run(0.5, &wish);
  EXPECT_NEAR(vehicle.odometry().twist[0], 0, 1e-3);
  vehicle.disarm();
  EXPECT_TRUE(until([&] { return vehicle.arm_request() == icat::MavlinkRequest::done; }, 3));
  EXPECT_FALSE(vehicle.heartbeat().value.armed);
}

TEST_F(Mavlink, ARefusalIsTold) {
  start({"--refuse-arming"});
  vehicle.arm();
  EXPECT_TRUE(until([&] { return vehicle.arm_request() == icat::MavlinkRequest::refused; }, 5));
}

// The documented stop when we are gone: the autopilot's own.
TEST_F(Mavlink, WithoutUsTheVehicleStops) {
  start({"--lag", "0.1"});
  ASSERT_TRUE(until_healthy());
  const std::array<double, 4> wish{0.3, 0, 0, 0.1};
  run(1, &wish);
  // On a busy machine telemetry may have been late just now, and zero the last that went out.
  ASSERT_TRUE(until([&] { return vehicle.healthy(now()); }, 5, &wish));
  EXPECT_GT(vehicle.odometry().twist[0], 0.25);
  EXPECT_TRUE(autopilot->wait_for("no set-points", 5)) << autopilot->output();
  EXPECT_TRUE(autopilot->wait_for("failsafe pilot", 5));
  EXPECT_TRUE(autopilot->wait_for("disarmed", 5));

  // We are back: it is not healthy, and nothing arms it by itself.
  run(2, &wish);
  EXPECT_FALSE(vehicle.healthy(now()));
  EXPECT_TRUE(vehicle.heartbeat().value.failsafe);
  EXPECT_NEAR(vehicle.odometry().twist[0], 0, 1e-3);
  ASSERT_TRUE(until_healthy());
  run(1, &wish);
  EXPECT_GT(vehicle.odometry().twist[0], 0.25);
}

// A socket that keeps what goes out.
struct Tap {
  icat::UdpSocket& socket;
  icat::detail::mavlink::FrameReader reader{};
  icat::MavlinkCounts counts{};
  mavlink_set_position_target_local_ned_t last{};

  std::size_t receive(std::span<std::uint8_t> into) noexcept { return socket.receive(into); }
  bool send(std::span<const std::uint8_t> bytes) noexcept {
    reader.push(bytes, counts, [&](const mavlink_message_t& m) {
      if (m.msgid == MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED) {
        mavlink_msg_set_position_target_local_ned_decode(&m, &last);
      }
    });
    return socket.send(bytes);
  }
};

// From a set-point to the first LOCAL_POSITION_NED that reflects it: the vehicle has no lag, and
// each set-point is another velocity. In the middle the autopilot dies and comes back.
TEST_F(Mavlink, LoopAt200Hz) {
  const double rate = 200;
  vehicle = icat::MavlinkVehicle({.telemetry_rate = rate});
  start({"--lag", "0"});
  Tap tap{*socket};
  const Robot body = robot();
  icat::MavlinkBackEnd<Robot, Tap> back_end(body, vehicle, tap);
  static_assert(icat::BackEnd<icat::MavlinkBackEnd<Robot, Tap>, Robot>);
  icat::RobotState<Robot> state(body);
  icat::Vector<double, Robot::size> velocity = icat::Vector<double, Robot::size>::Zero(body.dof());
  ASSERT_TRUE(until_healthy());

  constexpr long steps = 4000;
  std::array<double, steps> sent_at{};
  const auto velocity_of = [](long k) { return 0.1 + 1e-4 * static_cast<double>(k % steps); };
  long cycles = 0, seen = -1, unhealthy = 0;
  icat::Status worst = icat::Status::ok;
  const double seconds = hardware::loop_seconds();
  hardware::Latencies latencies(static_cast<std::size_t>(2 * rate * seconds) + 100);
  const auto cycle = [&](double time) {
    const std::uint32_t before = vehicle.position().count;
    icat::Status status = back_end.read(time, state);
    if (status != icat::Status::ok) worst = status;
    if (vehicle.position().count != before && back_end.healthy(time)) {
      const long k = std::lround((state.velocity(0) - 0.1) * 1e4);
      if (k >= 0 && k < steps && k != seen && sent_at[static_cast<std::size_t>(k)] > 0) {
        latencies.add(time - sent_at[static_cast<std::size_t>(k)]);
        seen = k;
      }
    }
    unhealthy += !back_end.healthy(time);
    velocity(0) = velocity_of(cycles);
    velocity(3) = 0.05;
    sent_at[static_cast<std::size_t>(cycles % steps)] = now();
    ++cycles;
    status = back_end.write(time, velocity);
    if (status != icat::Status::ok) worst = status;
  };

  long made = hardware::run_loop(rate, seconds / 2, cycle);
  EXPECT_EQ(unhealthy, 0);
  EXPECT_EQ(worst, icat::Status::ok);
  EXPECT_NEAR(std::hypot(tap.last.vx, tap.last.vy), velocity_of(cycles - 1), 1e-5);
  EXPECT_NEAR(tap.last.yaw_rate, 0.05, 1e-6);
  EXPECT_NEAR(state.velocity(3), 0.05, 1e-6);
  const icat::Odometry o = vehicle.odometry();
  EXPECT_NEAR(std::atan2(state.base(1, 0), state.base(0, 0)),
              2 * std::atan2(o.orientation[2], o.orientation[3]), 1e-9);
  EXPECT_GT(state.base(1, 0), 0.01);

  // Dead: within max_age the vehicle is not healthy, and what goes out is zero.
  autopilot->kill();
  const double died = now();
  double noticed = 0;
  made += hardware::run_loop(rate, 1, [&](double time) {
    cycle(time);
    if (noticed == 0 && !back_end.healthy(time)) noticed = time - died;
  });
  EXPECT_GT(noticed, 0);
  EXPECT_LT(noticed, 0.5 + 0.1);  // max_age, and a cycle that comes late
  EXPECT_FALSE(back_end.healthy(now()));
  EXPECT_EQ(tap.last.vx, 0);
  EXPECT_EQ(tap.last.yaw_rate, 0);
  EXPECT_LT(state.time, died + 0.1);  // the last value, with its age
  EXPECT_GT(state.velocity(0), 0.1 - 1e-6);

  // Back, with a clock that began anew: rates are asked again; mode and arming only by us.
  start({"--lag", "0", "--uptime", "5000"});
  made += hardware::run_loop(rate, 2, cycle);
  EXPECT_FALSE(back_end.healthy(now()));
  EXPECT_EQ(vehicle.counts().reboots, 1u);
  ASSERT_TRUE(until_healthy());
  EXPECT_TRUE(until([&] { return vehicle.age(now()) < 0.02; }, 3));  // 4 Hz until it was asked
  unhealthy = 0;
  const std::size_t before = latencies.size();
  made += hardware::run_loop(rate, seconds / 2, cycle);
  EXPECT_EQ(unhealthy, 0);

  latencies.print("mavlink: set-point to telemetry", rate, seconds, made);
  std::printf("mavlink: loss noticed after %.2f s; frames %u, lost %u, damaged %u\n", noticed,
              vehicle.counts().frames, vehicle.counts().lost, vehicle.counts().damaged);
  EXPECT_EQ(made, 0);
  // The peer hands on one set-point of four at least, before and after its death; a latency above
  // max_age would be a vehicle that is not healthy.
  EXPECT_GT(static_cast<double>(before), rate * seconds / 8);
  EXPECT_GT(static_cast<double>(latencies.size() - before), rate * seconds / 8);
  EXPECT_LT(latencies.quantile(1), 0.5);
}

// Nothing comes; what goes out is kept.
struct Sink {
  std::size_t receive(std::span<std::uint8_t>) noexcept { return 0; }
  bool send(std::span<const std::uint8_t>) noexcept { return true; }
};

TEST(MavlinkBackEnd, TakesBasesWhoseColumnsAreUnitMotions) {
  icat::MavlinkVehicle vehicle;
  Sink sink;
  const Robot free({.base = icat::Base<double>::free(), .root = "rov"});
  icat::MavlinkBackEnd back_end(free, vehicle, sink);
  icat::RobotState state(free);
  EXPECT_EQ(back_end.read(0, state), icat::Status::not_measured);
  EXPECT_FALSE(back_end.healthy(0));
  icat::Vector<double, Robot::size> v = icat::Vector<double, Robot::size>::Constant(6, 0.1);
  EXPECT_EQ(back_end.write(0, v), icat::Status::ok);
  v(3) = NAN;  // roll, which goes nowhere
  EXPECT_EQ(back_end.write(0, v), icat::Status::non_finite);
  v(3) = 0;
  v(0) = 21;
  EXPECT_EQ(back_end.write(0, v), icat::Status::implausible);
  v(0) = 0.1;
  EXPECT_EQ(back_end.write(0, v.head(5)), icat::Status::wrong_size);
  EXPECT_EQ(back_end.write(0, v.replicate(2, 1)), icat::Status::wrong_size);

  Eigen::Matrix<double, 6, 2> motion = Eigen::Matrix<double, 6, 2>::Zero();
  motion(0, 0) = motion(0, 1) = motion(5, 1) = 1;
  const Robot skew({.base = icat::Base<double>(motion), .root = "rov"});
  EXPECT_THROW((icat::MavlinkBackEnd<Robot, Sink>(skew, vehicle, sink)), std::invalid_argument);
}

// What a user writes: the page shows it.
TEST_F(Mavlink, AFewLines) {
  start();
  const Robot body = robot();
  const auto port_number = static_cast<std::uint16_t>(std::stoi(port));
  icat::Vector<double, Robot::size> command = icat::Vector<double, Robot::size>::Zero(body.dof());
  //! [loop]
  auto udp = icat::UdpSocket::connect("127.0.0.1", port_number);  // or listen("192.168.2.1", 14550)
  icat::MavlinkVehicle rov;
  icat::MavlinkBackEnd back_end(body, rov, udp);
  icat::RobotState state(body);
  rov.set_mode(icat::ArduSubMode::guided);
  rov.arm();
  hardware::run_loop(100, 4, [&](double time) {
    icat::Status status = back_end.read(time, state);
    const bool well = status == icat::Status::ok && back_end.healthy(time);
    command(0) = well ? 0.2 : 0;  // your controller's velocity
    status = back_end.write(time, command);
  });
  //! [loop]
  const double ahead = state.base.translation().x();
  EXPECT_GT(ahead, 0.1);
}

TEST(Udp, NamesWhatIsWrong) {
  EXPECT_THROW(icat::UdpSocket::connect("rov.local", 1), std::invalid_argument);
  auto taken = icat::UdpSocket::listen("127.0.0.1", 0);
  EXPECT_THROW(icat::UdpSocket::listen("127.0.0.1", taken.port()), std::invalid_argument);
}

TEST(Udp, NeverWaitsAndAnswersTheLastSender) {
  auto a = icat::UdpSocket::listen("127.0.0.1", 0);
  auto b = icat::UdpSocket::connect("127.0.0.1", a.port());
  std::uint8_t bytes[16];
  const std::uint8_t word[3] = {1, 2, 3};
  EXPECT_EQ(a.receive(bytes), 0u);
  EXPECT_FALSE(a.send(word));  // to whom?
  EXPECT_TRUE(b.send(word));
  EXPECT_EQ(a.receive(bytes), 3u);
  EXPECT_EQ(bytes[2], 3);
  EXPECT_TRUE(a.send(word));
  EXPECT_EQ(b.receive(bytes), 3u);
  // A peer that is gone and comes back.
  const std::uint16_t port = a.port();
  { auto gone = std::move(a); }
  EXPECT_TRUE(b.send(word));  // nobody takes it
  auto again = icat::UdpSocket::listen("127.0.0.1", port);
  EXPECT_TRUE(b.send(word));
  EXPECT_EQ(again.receive(bytes), 3u);
}

}  // namespace
