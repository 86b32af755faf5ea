// SPDX-License-Identifier: BSD-3-Clause
// ros2_cdr.hpp against @foxglove/rosmsg2-serialization, and against what no message may be.
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "icat/adapters/ros2_cdr.hpp"
#include "tests/hardware/dds/ros2_messages.hpp"
#include "tests/support/allocation_counter.hpp"

namespace {

using icat::Status;
using namespace cdr_test;

TEST(Ros2Cdr, FoxgloveReadsAndWritesTheSameBytes) {
  const std::string jobs = ::testing::TempDir() + "ros2_cdr_jobs." + std::to_string(::getpid());
  {
    std::ofstream out(jobs);
    for_all([&](const auto& m) {
      out << "{\"type\":\"" << m.type << "\",\"hex\":\"" << hex(m.encode())
          << "\",\"value\":" << m.value() << "}\n";
    });
    // A layout, which is read but never written by us.
    out << R"({"type":"std_msgs/Float64MultiArray","value":{"layout":{"dim":[)"
        << R"({"label":"rows","size":2,"stride":6},{"label":"columns","size":3,"stride":3}],)"
        << R"("data_offset":1},"data":[1,2,3]}})"
        << "\n";
  }
  const std::string command = "NODE_PATH='" ICAT_NODE_MODULES "' '" ICAT_NODE "' '" ICAT_PEERS
                              "/foxglove.js' <'" +
                              jobs + "'";
  std::unique_ptr<FILE, int (*)(FILE*)> node(::popen(command.c_str(), "r"), ::pclose);
  std::string answers;
  char block[4096];
  while (const std::size_t n = std::fread(block, 1, sizeof block, node.get())) {
    answers.append(block, n);
  }
  const int result = ::pclose(node.release());
  std::remove(jobs.c_str());
  ASSERT_EQ(result, 0) << "foxglove.js says what differs";
  std::istringstream lines(answers);
  std::string little, big;
  int count = 0;
  for_all([&](const auto& m) {
    ASSERT_TRUE(std::getline(lines, little) && std::getline(lines, big));
    ASSERT_EQ(little.substr(0, 8), "00010000");
    ASSERT_EQ(big.substr(0, 8), "00000000");
    m.expect(bytes(little));
    m.expect(bytes(big));
    ++count;
  });
  while (std::getline(lines, little)) {
    const ByteVector b = bytes(little);
    ros2::Float64MultiArrayMessage m;
    ASSERT_TRUE(ros2::decode(b, m));
    EXPECT_EQ(m.dimensions, 2u);
    EXPECT_EQ(m.data_offset, 1u);
    JointStateFields::equal(m.data, {1, 2, 3});
    ++count;
  }
  EXPECT_EQ(count, 44 + 9 + 3 + 4 + 2);
}

TEST(Ros2Cdr, DecodesWhatItEncodes) {
  for_all([](const auto& m) { m.expect(m.encode()); });
}

// Nothing that is cut off, longer, or encoded in another way is a message; nor does any of it
// change what was there.
TEST(Ros2Cdr, RefusesWhatIsNoMessage) {
  for_all([](const auto& m) {
    const ByteVector good = m.encode();
    const auto decodes = [&](const ByteVector& b) {
      if constexpr (std::is_same_v<decltype(m), const JointStateFields&>) {
        ros2::JointStateMessage to;
        to.header.sec = 42;
        const bool ok = ros2::decode(b, to);
        EXPECT_TRUE(ok || to.header.sec == 42);
        return ok;
      } else if constexpr (std::is_same_v<decltype(m), const OdometryFields&>) {
        ros2::OdometryMessage to;
        to.header.sec = 42;
        const bool ok = ros2::decode(b, to);
        EXPECT_TRUE(ok || to.header.sec == 42);
        return ok;
      } else if constexpr (std::is_same_v<decltype(m), const TwistFields&>) {
        icat::Twist to{42};
        const bool ok = ros2::decode(b, to);
        EXPECT_TRUE(ok || to[0] == 42);
        return ok;
      } else {
        ros2::Float64MultiArrayMessage to;
        to.dimensions = 42;
        const bool ok = ros2::decode(b, to);
        EXPECT_TRUE(ok || to.dimensions == 42);
        return ok;
      }
    };
    ASSERT_TRUE(decodes(good));
    for (std::size_t size = 0; size < good.size(); ++size) {
      EXPECT_FALSE(decodes(ByteVector(good.begin(), good.begin() + static_cast<long>(size))));
    }
    ByteVector padded = good;
    for (int more = 1; more < 12; ++more) {
      padded.push_back(0);
      EXPECT_EQ(decodes(padded), more < 4) << more;
    }
    ByteVector twice = good;
    twice.insert(twice.end(), good.begin(), good.end());
    EXPECT_FALSE(decodes(twice));
    for (const int kind : {2, 3, 6, 7, 8, 9, 10, 11}) {  // parameter lists, version 2
      ByteVector other = good;
      other[1] = static_cast<std::uint8_t>(kind);
      EXPECT_FALSE(decodes(other)) << kind;
    }
    // Room for less than all of it.
    for (std::size_t size = 0; size < good.size(); ++size) {
      ByteVector room(size, 0xee);
      if constexpr (std::is_same_v<decltype(m), const JointStateFields&>) {
        EXPECT_EQ(
            ros2::encode_joint_state(m.header, m.name, m.position, m.velocity, m.effort, room), 0u);
      } else if constexpr (std::is_same_v<decltype(m), const OdometryFields&>) {
        EXPECT_EQ(ros2::encode(m.message, room), 0u);
      } else if constexpr (std::is_same_v<decltype(m), const TwistFields&>) {
        EXPECT_EQ(ros2::encode(m.twist, room), 0u);
      } else {
        EXPECT_EQ(ros2::encode_multi_array(m.data, room), 0u);
      }
    }
  });
}

TEST(Ros2Cdr, RefusesWhatIsAtOddsWithItself) {
  ros2::JointStateMessage m;
  JointStateFields f = messages().joints.back();
  f.header.nanosec = 1000000000;
  EXPECT_FALSE(ros2::decode(f.encode(), m));
  f.header.nanosec = 999999999;
  EXPECT_TRUE(ros2::decode(f.encode(), m));
  f.velocity.pop_back();
  EXPECT_TRUE(f.encode().empty());
  f.velocity.clear();
  ByteVector b = f.encode();
  b[4 + 8] = 0;  // the frame's name without its zero: everything behind it moves
  EXPECT_FALSE(ros2::decode(b, m));
  f.header.frame_id = "base";
  b = f.encode();
  ASSERT_TRUE(ros2::decode(b, m));
  ASSERT_EQ(b[4 + 12 + 4], 0);
  b[4 + 12 + 4] = 'x';  // the zero at the end of the frame's name
  EXPECT_FALSE(ros2::decode(b, m));
  // Lengths that overflow a size when they are multiplied or added.
  MultiArrayFields array{{1, 2}};
  for (const std::uint32_t length : {3u, 0x1fffffffu, 0x20000000u, 0x20000002u, 0xffffffffu}) {
    for (const std::size_t place : {4u, 12u}) {  // dimensions, data
      b = array.encode();
      std::memcpy(b.data() + place, &length, 4);
      ros2::Float64MultiArrayMessage to;
      EXPECT_FALSE(ros2::decode(b, to)) << length << " at " << place;
    }
  }
}

// In any order, among others, without all of the sequences; old, doubled, no numbers.
TEST(Ros2Cdr, JointStates) {
  const double nan = std::nan(""), infinite = INFINITY;
  icat::JointStates joints({"shoulder", "elbow"});
  const auto put = [&](std::int32_t sec, std::vector<double> position, std::vector<double> velocity,
                       double now) {
    JointStateFields f;
    f.header.sec = sec;
    f.name = {"elbow", "gripper", "shoulder"};
    f.position = std::move(position);
    f.velocity = std::move(velocity);
    const ByteVector b = f.encode();
    ros2::JointStateMessage m;
    EXPECT_TRUE(ros2::decode(b, m));
    Status status{};
    EXPECT_EQ(count_allocations([&] { status = ros2::put(m, now, joints); }), 0);
    return status;
  };
  EXPECT_EQ(put(10, {1, 2, 3}, {4, nan, nan}, 100), Status::ok);
  EXPECT_EQ(joints[0].value.position, 3);
  EXPECT_EQ(joints[0].value.velocity, 0);  // not measured
  EXPECT_EQ(joints[1].value.position, 1);
  EXPECT_EQ(joints[1].value.velocity, 4);
  EXPECT_EQ(put(10, {9, 9, 9}, {}, 101), Status::time_reversed);
  EXPECT_EQ(put(9, {9, 9, 9}, {}, 101), Status::time_reversed);
  EXPECT_EQ(put(11, {nan, nan, infinite}, {}, 101), Status::non_finite);
  EXPECT_EQ(put(11, {9, 9, 9}, {infinite, 0, infinite}, 101), Status::non_finite);
  EXPECT_EQ(put(11, {}, {9, 9, 9}, 101), Status::ok);  // no positions: nothing for us
  EXPECT_EQ(joints[0].value.position, 3);
  EXPECT_EQ(joints.age(101), 1);
  EXPECT_EQ(put(11, {5, nan, 6}, {}, 102), Status::ok);
  EXPECT_EQ(joints[0].value.position, 6);
  EXPECT_EQ(joints[1].value.velocity, 0);
  EXPECT_EQ(joints.age(102), 0);
}

TEST(Ros2Cdr, Orientations) {
  icat::Odometry o;
  EXPECT_EQ(icat::normalize(o), Status::ok);
  o.orientation = {0, 0, 0, 0};  // as a message is made
  EXPECT_EQ(icat::normalize(o), Status::not_a_rotation);
  o.orientation = {0, 0, 0.6, 0.805};
  EXPECT_EQ(icat::normalize(o), Status::ok);
  double square = 0;
  for (const double x : o.orientation) square += x * x;
  EXPECT_NEAR(square, 1, 1e-15);
  o.orientation = {0, 0, 0, 1.006};  // tf2 looks at the square
  EXPECT_EQ(icat::normalize(o), Status::not_a_rotation);
  o.orientation = {0, 0, std::nan(""), 1};
  EXPECT_EQ(icat::normalize(o), Status::non_finite);
  o.orientation = {0, 0, 0, 1};
  o.twist[5] = INFINITY;
  EXPECT_EQ(icat::normalize(o), Status::non_finite);
  o.twist[5] = 0;
  o.position[1] = -INFINITY;
  EXPECT_EQ(icat::normalize(o), Status::non_finite);
}

TEST(Ros2Cdr, AllocatesNothing) {
  const std::array<std::string_view, 2> names{"shoulder", "elbow"};
  const std::array<double, 2> position{0.5, 1};
  icat::JointStates joints({"shoulder", "elbow"});
  const double time = 1;
  EXPECT_EQ(count_allocations([&] {
              //! [cdr]
              std::array<std::uint8_t, 256> bytes;
              const std::size_t size = icat::ros2::encode_joint_state(
                  {.sec = 12, .nanosec = 34, .frame_id = "base"}, names, position, {}, {}, bytes);

              icat::ros2::JointStateMessage message;
              if (icat::ros2::decode({bytes.data(), size}, message)) {
                EXPECT_EQ(icat::ros2::put(message, time, joints), Status::ok);
              }
              //! [cdr]
            }),
            0);
  EXPECT_EQ(joints[1].value.position, 1);
}

}  // namespace
