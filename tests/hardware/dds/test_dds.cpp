// SPDX-License-Identifier: BSD-3-Clause
// dds.hpp against a robot that another vendor's DDS makes, in a process of its own.
#include <dds/ddsrt/log.h>
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <string>

#include "icat/adapters/dds.hpp"
#include "tests/hardware/support/loop.hpp"
#include "tests/hardware/support/process.hpp"

namespace {

// What Cyclone DDS allocates in our thread, apart from us.
thread_local long cyclone_allocations = 0;

template <class Call>
void* counted_apart(Call call) {
  const long before = allocations;
  void* memory = call();
  cyclone_allocations += allocations - before;
  allocations = before;
  return memory;
}
template <class F>
F* library(const char* name) {
  return reinterpret_cast<F*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

// In front of the library's own, through which it asks for all of its memory.
extern "C" {
void* ddsrt_malloc(std::size_t size) {
  static const auto call = library<void*(std::size_t)>("ddsrt_malloc");
  return counted_apart([&] { return call(size); });
}
void* ddsrt_malloc_s(std::size_t size) {
  static const auto call = library<void*(std::size_t)>("ddsrt_malloc_s");
  return counted_apart([&] { return call(size); });
}
void* ddsrt_calloc(std::size_t count, std::size_t size) {
  static const auto call = library<void*(std::size_t, std::size_t)>("ddsrt_calloc");
  return counted_apart([&] { return call(count, size); });
}
void* ddsrt_calloc_s(std::size_t count, std::size_t size) {
  static const auto call = library<void*(std::size_t, std::size_t)>("ddsrt_calloc_s");
  return counted_apart([&] { return call(count, size); });
}
void* ddsrt_realloc(void* old, std::size_t size) {
  static const auto call = library<void*(void*, std::size_t)>("ddsrt_realloc");
  return counted_apart([&] { return call(old, size); });
}
void* ddsrt_realloc_s(void* old, std::size_t size) {
  static const auto call = library<void*(void*, std::size_t)>("ddsrt_realloc_s");
  return counted_apart([&] { return call(old, size); });
}
}

namespace {

using hardware::now;

// Domains from 100 on have ports that Linux gives to anyone. Two runs on one machine do not meet.
const unsigned domain = 40 + static_cast<unsigned>(::getpid()) % 60;

// All that is said stays on the loopback.
const char* const loopback = R"(<CycloneDDS><Domain><General>
  <Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
  <AllowMulticast>false</AllowMulticast></General>
  <Discovery><ParticipantIndex>auto</ParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>)";

std::vector<std::string> peer(double ahead, const char* mode = "") {
  return {ICAT_DDS_PEER, std::to_string(domain), std::to_string(ahead), mode};
}

const std::vector<std::string> joints{"shoulder", "elbow", "wrist"};

struct Robot {
  icat::DdsParticipant participant{{.domain = domain, .configuration = loopback}};
  icat::DdsJointStates arm{participant, "joint_states", joints};
  icat::DdsOdometry odometry{participant, "odom"};
  icat::DdsJointCommands commands{participant, "/arm_controller/commands", 3};
  icat::DdsTwist twist{participant, "cmd_vel"};

  // Whether all four topics have their other side and a state came within `seconds`.
  bool found(double seconds) {
    const double end = now() + seconds;
    while (now() < end) {
      const double time = now();
      arm.read(time);
      odometry.read(time);
      if (arm.states().age(time) < 0.1 && odometry.last().fresh(time, 0.1) &&
          commands.subscribers() > 0 && twist.subscribers() > 0) {
        return true;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  }
};

std::string hex(icat::ros2::Bytes bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    char two[3];
    std::snprintf(two, sizeof two, "%02x", byte);
    text += two;
  }
  return text;
}

TEST(Dds, IsUsedLikeThis) {
  hardware::Process process(peer(0));
  const double start = now();
  const std::string configuration = loopback;
  const std::vector<std::string> names = joints;
  //! [dds]
  icat::DdsParticipant participant({.domain = domain, .configuration = configuration});
  icat::DdsJointStates arm(participant, "joint_states", names);
  icat::DdsJointCommands commands(participant, "arm_controller/commands", names.size());
  std::vector<double> velocity(names.size());

  auto cycle = [&](double time) {
    arm.read(time);  // takes new messages, never blocks
    const bool heard = arm.states().age(time) < 0.1;
    for (std::size_t i = 0; i < names.size(); ++i) {
      velocity[i] = heard ? -0.5 * arm.states()[i].value.position : 0;
    }
    return commands.write(velocity);
  };
  //! [dds]
  while (now() - start < 20 &&
         !(arm.states().age(now()) < 0.1 && std::fabs(arm.states()[2].value.position) < 0.29)) {
    EXPECT_EQ(cycle(now()), icat::Status::ok);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_LT(arm.states()[2].value.position, 0.29);  // it was at 0.3
}

// What Fast DDS gets is byte for byte what ros2_cdr.hpp writes, which test_ros2_cdr gives to a
// third: Cyclone DDS has its own encoder.
TEST(Dds, SendsTheBytesOfRos2) {
  hardware::Process process(peer(0));
  Robot robot;
  ASSERT_TRUE(robot.found(20));
  const std::vector<double> velocity{0.25, -1e-3, 3};
  const icat::Twist twist{1, -2, 3, -0.1, 0.2, 1e-300};
  EXPECT_EQ(robot.commands.write(velocity), icat::Status::ok);
  EXPECT_EQ(robot.twist.write(twist), icat::Status::ok);
  std::array<std::uint8_t, 256> room;
  const icat::ros2::Bytes bytes(room);
  std::size_t size = icat::ros2::encode_multi_array(velocity, room);
  EXPECT_TRUE(process.wait_for("commands " + hex(bytes.first(size)) + "\n", 5)) << process.output();
  size = icat::ros2::encode(twist, room);
  EXPECT_TRUE(process.wait_for("twist " + hex(bytes.first(size)) + "\n", 5)) << process.output();
}

TEST(Dds, LoopAt200Hz) {
  hardware::Process process(peer(0));
  cyclone_allocations = 0;
  Robot robot;
  const long all_of_cyclone = cyclone_allocations;
  ASSERT_TRUE(robot.found(20));
  const double seconds = hardware::loop_seconds(), rate = 200;
  hardware::Latencies latencies(static_cast<std::size_t>(2 * rate * seconds));
  std::array<double, 3> velocity{};
  icat::Twist twist{};
  long sent = 0, lost = 0, refused_writes = 0, wrong_bases = 0;
  cyclone_allocations = 0;
  const long ours = hardware::run_loop(rate, seconds, [&](double) {
    ++sent;
    velocity = {1e-4 * static_cast<double>(sent % 5000 + 1), -0.1, 0.1};
    twist[0] = velocity[0];
    const double start = now();
    refused_writes += robot.commands.write(velocity) != icat::Status::ok;
    refused_writes += robot.twist.write(twist) != icat::Status::ok;
    // For the figure only: a user's loop looks once in a cycle.
    double time = start;
    do {
      std::this_thread::sleep_for(std::chrono::microseconds(50));
      time = now();
      robot.arm.read(time);
    } while (robot.arm.states()[0].value.velocity != velocity[0] && time - start < 0.004);
    if (robot.arm.states()[0].value.velocity == velocity[0]) {
      latencies.add(time - start);
    } else {
      ++lost;
    }
    robot.odometry.read(now());
    wrong_bases += !robot.odometry.last().fresh(now(), 0.1);
  });
  latencies.print("Cyclone DDS to Fast DDS and back, command to joint state", rate, seconds, ours);
  std::printf(
      "Cyclone DDS allocates %.2f times a cycle in the same thread; latency above 4 ms: %ld of "
      "%ld\n",
      static_cast<double>(cyclone_allocations) / static_cast<double>(sent), lost, sent);
  EXPECT_EQ(ours, 0);
  EXPECT_GT(all_of_cyclone, 0) << "the library's calls are not seen";
  EXPECT_EQ(refused_writes, 0);
  // A machine that does other things may keep the peer waiting: nine of ten are in time at least.
  EXPECT_LT(lost, sent / 10);
  EXPECT_LT(wrong_bases, sent / 10);
  EXPECT_EQ(robot.arm.refused(), 0u);
  EXPECT_EQ(robot.arm.states()[2].value.velocity, 0.1);
  EXPECT_EQ(robot.arm.states()[2].value.effort, 0);  // the peer says none
  EXPECT_EQ(robot.odometry.last().value.position, (std::array<double, 3>{1, 2, 3}));
  EXPECT_NEAR(robot.odometry.last().value.orientation[3], std::sqrt(0.5), 1e-15);
}

// The stop when the robot is not heard of is ours: the command is zero from then on, and what it
// was told last goes on where a controller has no time-out of its own.
TEST(Dds, PeerIsKilledAndComesBackWithAnotherClock) {
  Robot robot;
  std::array<double, 3> velocity{};
  bool stopped = false;
  const auto cycle = [&](double time) {
    robot.arm.read(time);
    stopped = !(robot.arm.states().age(time) < 0.1);
    velocity = stopped ? std::array<double, 3>{} : std::array<double, 3>{0.1, 0.1, 0.1};
    EXPECT_EQ(robot.commands.write(velocity), icat::Status::ok);
  };
  double heard = 0;
  {
    hardware::Process process(peer(0));
    ASSERT_TRUE(robot.found(20));
    hardware::run_loop(200, 1, cycle);
    EXPECT_FALSE(stopped);
    EXPECT_EQ(robot.arm.states()[0].value.velocity, 0.1);
    process.kill();
    hardware::run_loop(200, 1, cycle);
    EXPECT_TRUE(stopped);
    EXPECT_EQ(velocity[0], 0);
    const double age = robot.arm.states().age(now());
    EXPECT_GT(age, 0.9);
    EXPECT_LT(age, 1.5);  // it had the last one shortly before it was killed
    EXPECT_EQ(robot.arm.states()[0].value.velocity, 0.1);  // the last value stays
    heard = robot.arm.states()[0].time;
  }
  // Its clock is behind that of the one before: without `restart` every stamp would be an old one.
  hardware::Process process(peer(-1000));
  ASSERT_TRUE(process.wait_for("ready", 20));
  const double start = now();
  ASSERT_TRUE(robot.found(30));
  EXPECT_GT(robot.arm.states()[0].time, heard);
  const double found = now() - start;
  EXPECT_EQ(robot.arm.states()[0].value.velocity, 0);  // it was told nothing yet
  double obeyed = 0;
  hardware::run_loop(200, 2, [&](double time) {
    cycle(time);
    if (obeyed == 0 && robot.arm.states()[0].value.velocity == 0.1) obeyed = time - start;
  });
  std::printf(
      "after a restart of the peer: latency of the first state %.0f ms, of the first command "
      "%.0f ms\n",
      1e3 * found, 1e3 * obeyed);
  EXPECT_GT(obeyed, 0);
  EXPECT_FALSE(stopped);
  EXPECT_EQ(robot.arm.states()[0].value.velocity, 0.1);
  EXPECT_EQ(robot.arm.refused(), 0u);
}

// A command that is none stops the robot: what it was told last would go on.
TEST(Dds, ABadCommandIsZero) {
  hardware::Process process(peer(0));
  Robot robot;
  ASSERT_TRUE(robot.found(20));
  const auto obeyed = [&](double velocity) {
    for (const double end = now() + 5; now() < end;) {
      robot.arm.read(now());
      if (robot.arm.states()[0].value.velocity == velocity) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  };
  const std::array<double, 3> good{0.1, 0.1, 0.1};
  EXPECT_EQ(robot.commands.write(good), icat::Status::ok);
  EXPECT_TRUE(obeyed(0.1));
  EXPECT_EQ(robot.commands.write(std::array<double, 3>{0.1, NAN, 0.1}), icat::Status::non_finite);
  EXPECT_TRUE(obeyed(0));
  EXPECT_EQ(robot.commands.write(good), icat::Status::ok);
  EXPECT_TRUE(obeyed(0.1));
  EXPECT_EQ(robot.commands.write(std::array<double, 2>{0.1, 0.1}), icat::Status::wrong_size);
  EXPECT_TRUE(obeyed(0));
  EXPECT_EQ(robot.twist.write({INFINITY}), icat::Status::non_finite);
  std::array<std::uint8_t, 64> room;
  const std::size_t size = icat::ros2::encode(icat::Twist{}, room);
  EXPECT_TRUE(process.wait_for("twist " + hex(icat::ros2::Bytes(room).first(size)) + "\n", 5));
}

// The robot dies while the loop stands still: what lay in the queue is as old as it is.
TEST(Dds, WaitingIsAge) {
  hardware::Process process(peer(0));
  Robot robot;
  ASSERT_TRUE(robot.found(20));
  std::this_thread::sleep_for(std::chrono::milliseconds(200));  // something waits
  process.kill();
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  const double time = now();
  EXPECT_GT(robot.arm.read(time), 0);
  EXPECT_GT(robot.odometry.read(time), 0);
  EXPECT_GT(robot.arm.states().age(time), 0.45);
  EXPECT_FALSE(robot.odometry.last().fresh(time, 0.45));
}

// A peer that hangs, and acknowledges nothing: `write` waits for nobody, and it goes on with the
// newest command when the peer does.
TEST(Dds, PeerHangs) {
  hardware::Process process(peer(0));
  Robot robot;
  ASSERT_TRUE(robot.found(20));
  double longest = 0, value = 0;
  const auto cycle = [&](double time) {
    robot.arm.read(time);
    value += 1e-4;
    const double start = now();
    EXPECT_EQ(robot.commands.write(std::array<double, 3>{value, value, value}), icat::Status::ok);
    longest = std::fmax(longest, now() - start);
  };
  ::kill(process.pid(), SIGSTOP);
  hardware::run_loop(200, 2, cycle);
  EXPECT_GT(robot.arm.states().age(now()), 1.5);
  // What DDS waits by default is 0.1 s. A write takes some 0.05 ms; the rest is the machine's.
  EXPECT_LT(longest, 0.05);
  ::kill(process.pid(), SIGCONT);
  hardware::run_loop(200, 1, cycle);
  EXPECT_LT(robot.arm.states().age(now()), 0.1);
  EXPECT_NEAR(robot.arm.states()[0].value.velocity, value, 20e-4);  // of the last 0.1 s
}

// Cyclone DDS logs what it finds wrong itself.
struct Silence {
  Silence() {
    set([](void*, const dds_log_data_t*) {});
  }
  ~Silence() { set(nullptr); }
  static void set(dds_log_write_fn_t sink) {
    dds_set_log_sink(sink, nullptr);
    dds_set_trace_sink(sink, nullptr);
  }
};

// Cut off, doubled, late and no numbers, each after a good one: never a wrong value.
TEST(Dds, WhatIsDamagedLeavesTheLastValue) {
  const Silence silence;
  hardware::Process process(peer(0, "dirty"));
  Robot robot;
  ASSERT_TRUE(robot.found(20));
  const std::array<double, 3> velocity{0.1, -0.1, 0.2};
  double most = 0;
  hardware::run_loop(200, 2, [&](double time) {
    robot.arm.read(time);
    robot.odometry.read(time);
    for (std::size_t i = 0; i < 3; ++i) {
      most = std::fmax(most, std::fabs(robot.arm.states()[i].value.velocity));
      most = std::fmax(most, std::fabs(robot.arm.states()[i].value.position));
    }
    most = std::fmax(most, std::fabs(robot.odometry.last().value.twist[0]));
    EXPECT_EQ(robot.commands.write(velocity), icat::Status::ok);
    EXPECT_EQ(robot.twist.write({0.1}), icat::Status::ok);
  });
  EXPECT_LT(most, 2);  // the positions, after 2 s at 0.2 rad/s; the damaged ones say 99
  EXPECT_TRUE(robot.arm.states().age(now()) < 0.1);
  EXPECT_GT(robot.arm.refused(), 100u);
  EXPECT_GT(robot.odometry.refused(), 50u);
}

// Cyclone DDS turns the bytes, by what dds_types.hpp says of the messages.
TEST(Dds, BigEndianPeer) {
  hardware::Process process(peer(0, "big"));
  const std::array<double, 3> velocity{0.1, 0.2, 0.3};
  Robot robot;
  ASSERT_TRUE(robot.found(20));
  hardware::run_loop(200, 0.5, [&](double time) {
    robot.arm.read(time);
    robot.odometry.read(time);
    EXPECT_EQ(robot.commands.write(velocity), icat::Status::ok);
    EXPECT_EQ(robot.twist.write({1, 2, 3, 4, 5, 6}), icat::Status::ok);
  });
  const icat::JointStates& arm = robot.arm.states();
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(arm[i].value.velocity, velocity[i]) << arm.name(i);
    EXPECT_NEAR(arm[i].value.position, 0.1 * static_cast<double>(i + 1), 0.3) << arm.name(i);
  }
  EXPECT_EQ(arm[0].value.effort, 3);
  EXPECT_EQ(arm[1].value.effort, 4);
  EXPECT_EQ(arm[2].value.effort, 2);
  EXPECT_EQ(robot.odometry.last().value.position, (std::array<double, 3>{1, 2, 3}));
  EXPECT_EQ(robot.odometry.last().value.twist, (icat::Twist{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(robot.arm.refused() + robot.odometry.refused(), 0u);
}

TEST(Dds, RefusesWhatCannotBe) {
  const Silence silence;
  const auto says = [](const char* what, auto make) {
    try {
      make();
      ADD_FAILURE() << what;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
    }
  };
  says("participant of domain '4000000000'",
       [] { icat::DdsParticipant p({.domain = 4000000000}); });
  says("domain", [] { icat::DdsParticipant p({.domain = domain, .configuration = "<nonsense"}); });
  Robot robot;
  auto& p = robot.participant;
  says("'' is no name", [&] { icat::DdsTwist t(p, ""); });
  says("'//a' is no name", [&] { icat::DdsTwist t(p, "//a"); });
  says("topic 'rt/a b'", [&] { icat::DdsTwist t(p, "a b"); });
  says("no joint", [&] { icat::DdsJointCommands c(p, "c", 0); });
  says("no joint", [&] { icat::DdsJointStates s(p, "s", {}); });
  EXPECT_EQ(robot.commands.write(std::array<double, 2>{}), icat::Status::wrong_size);
  EXPECT_EQ(robot.commands.write(std::array<double, 3>{0, NAN, 0}), icat::Status::non_finite);
  EXPECT_EQ(robot.twist.write({INFINITY}), icat::Status::non_finite);
  EXPECT_EQ(robot.arm.read(0), 0);
  EXPECT_EQ(robot.commands.write(std::array<double, 3>{}), icat::Status::ok);  // nobody listens
  // Without its participant, which a program must not do, nothing is sent, and nothing comes.
  { const icat::DdsParticipant gone = std::move(robot.participant); }
  EXPECT_EQ(robot.commands.write(std::array<double, 3>{}), icat::Status::not_sent);
  EXPECT_EQ(robot.arm.read(0), 0);
  EXPECT_EQ(robot.arm.publishers() + robot.twist.subscribers(), 0);
}

}  // namespace
