// SPDX-License-Identifier: BSD-3-Clause
// Messages of ROS 2 for test_ros2_cdr: their fields, their bytes, and what JavaScript calls them.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "icat/adapters/ros2_cdr.hpp"

namespace cdr_test {

namespace ros2 = icat::ros2;
using ByteVector = std::vector<std::uint8_t>;

inline std::string hex(const ByteVector& bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) {
    char two[3];
    std::snprintf(two, sizeof two, "%02x", byte);
    text += two;
  }
  return text;
}
inline ByteVector bytes(const std::string& hex) {
  ByteVector all;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    all.push_back(static_cast<std::uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  }
  return all;
}

template <class Numbers>
std::string json(const Numbers& values) {
  std::string text = "[";
  for (const double x : values) {
    char number[40];
    std::snprintf(number, sizeof number, "%s%.17g", text.size() > 1 ? "," : "", x);
    text += number;
  }
  return text + "]";
}
template <class Numbers>
std::string named(const Numbers& values, std::size_t first, const char* names) {
  std::string text = "{";
  for (std::size_t i = 0; names[i]; ++i) {
    char number[48];
    std::snprintf(number, sizeof number, "%s\"%c\":%.17g", i ? "," : "", names[i],
                  values[first + i]);
    text += number;
  }
  return text + "}";
}
inline std::string json(const ros2::Header& header) {
  return "{\"stamp\":{\"sec\":" + std::to_string(header.sec) +
         ",\"nanosec\":" + std::to_string(header.nanosec) + "},\"frame_id\":\"" +
         std::string(header.frame_id) + "\"}";
}

// What goes to the other side and comes back.
struct JointStateFields {
  ros2::Header header;
  std::vector<std::string_view> name;
  std::vector<double> position, velocity, effort;

  static constexpr const char* type = "sensor_msgs/JointState";
  ByteVector encode() const {
    ByteVector room(4096);
    room.resize(ros2::encode_joint_state(header, name, position, velocity, effort, room));
    return room;
  }
  std::string value() const {
    std::string names;
    for (const auto& n : name) names.append(names.empty() ? "\"" : ",\"").append(n).append("\"");
    return "{\"header\":" + json(header) + ",\"name\":[" + names +
           "],\"position\":" + json(position) + ",\"velocity\":" + json(velocity) +
           ",\"effort\":" + json(effort) + "}";
  }
  void expect(const ByteVector& message) const {
    ros2::JointStateMessage m;
    ASSERT_TRUE(ros2::decode(message, m));
    EXPECT_EQ(m.header.sec, header.sec);
    EXPECT_EQ(m.header.nanosec, header.nanosec);
    EXPECT_EQ(m.header.frame_id, header.frame_id);
    ASSERT_EQ(m.name.size(), name.size());
    std::string_view text;
    for (const auto& n : name) {
      ASSERT_TRUE(m.name.next(text));
      EXPECT_EQ(text, n);
    }
    EXPECT_FALSE(m.name.next(text));
    equal(m.position, position);
    equal(m.velocity, velocity);
    equal(m.effort, effort);
  }
  static void equal(const ros2::Doubles& one, const std::vector<double>& other) {
    ASSERT_EQ(one.size(), other.size());
    for (std::size_t i = 0; i < other.size(); ++i) EXPECT_EQ(one[i], other[i]);
  }
};
struct OdometryFields {
  ros2::OdometryMessage message;

  static constexpr const char* type = "nav_msgs/Odometry";
  ByteVector encode() const {
    ByteVector room(4096);
    room.resize(ros2::encode(message, room));
    return room;
  }
  std::string value() const {
    const icat::Odometry& o = message.odometry;
    return "{\"header\":" + json(message.header) + ",\"child_frame_id\":\"" +
           std::string(message.child_frame_id) +
           "\",\"pose\":{\"pose\":{\"position\":" + named(o.position, 0, "xyz") +
           ",\"orientation\":" + named(o.orientation, 0, "xyzw") +
           "},\"covariance\":" + json(message.pose_covariance) +
           "},\"twist\":{\"twist\":{\"linear\":" + named(o.twist, 0, "xyz") +
           ",\"angular\":" + named(o.twist, 3, "xyz") +
           "},\"covariance\":" + json(message.twist_covariance) + "}}";
  }
  void expect(const ByteVector& bytes) const {
    ros2::OdometryMessage m;
    ASSERT_TRUE(ros2::decode(bytes, m));
    EXPECT_EQ(m.header.sec, message.header.sec);
    EXPECT_EQ(m.header.nanosec, message.header.nanosec);
    EXPECT_EQ(m.header.frame_id, message.header.frame_id);
    EXPECT_EQ(m.child_frame_id, message.child_frame_id);
    EXPECT_EQ(m.odometry.position, message.odometry.position);
    EXPECT_EQ(m.odometry.orientation, message.odometry.orientation);
    EXPECT_EQ(m.odometry.twist, message.odometry.twist);
    EXPECT_EQ(m.pose_covariance, message.pose_covariance);
    EXPECT_EQ(m.twist_covariance, message.twist_covariance);
  }
};
struct TwistFields {
  icat::Twist twist;

  static constexpr const char* type = "geometry_msgs/Twist";
  ByteVector encode() const {
    ByteVector room(64);
    room.resize(ros2::encode(twist, room));
    return room;
  }
  std::string value() const {
    return "{\"linear\":" + named(twist, 0, "xyz") + ",\"angular\":" + named(twist, 3, "xyz") + "}";
  }
  void expect(const ByteVector& bytes) const {
    icat::Twist t{};
    ASSERT_TRUE(ros2::decode(bytes, t));
    EXPECT_EQ(t, twist);
  }
};
struct MultiArrayFields {
  std::vector<double> data;

  static constexpr const char* type = "std_msgs/Float64MultiArray";
  ByteVector encode() const {
    ByteVector room(4096);
    room.resize(ros2::encode_multi_array(data, room));
    return room;
  }
  std::string value() const {
    return "{\"layout\":{\"dim\":[],\"data_offset\":0},\"data\":" + json(data) + "}";
  }
  void expect(const ByteVector& bytes) const {
    ros2::Float64MultiArrayMessage m;
    ASSERT_TRUE(ros2::decode(bytes, m));
    EXPECT_EQ(m.dimensions, 0u);
    EXPECT_EQ(m.data_offset, 0u);
    JointStateFields::equal(m.data, data);
  }
};

inline std::vector<double> random_numbers(std::size_t count) {
  static std::mt19937 generator(17);
  std::uniform_real_distribution<double> mantissa(-1, 1), exponent(-200, 200);
  std::vector<double> values(count);
  for (double& x : values) x = mantissa(generator) * std::pow(10, exponent(generator));
  return values;
}
template <std::size_t N>
void fill(std::array<double, N>& values) {
  const auto from = random_numbers(N);
  std::copy(from.begin(), from.end(), values.begin());
}

inline std::vector<JointStateFields> joint_states() {
  std::vector<JointStateFields> all;
  // Names of every length modulo 8, so that the padding is seen.
  const std::vector<std::string_view> names{
      "", "a", "ab", "abc", "abcd", "abcde", "abcdef", "abcdefg", "abcdefgh", "shoulder_pan"};
  for (std::size_t count = 0; count <= names.size(); ++count) {
    for (const bool velocity : {false, true}) {
      for (const bool effort : {false, true}) {
        JointStateFields f;
        f.header = {static_cast<std::int32_t>(1700000000 + count),
                    static_cast<std::uint32_t>(999999999 - count), names[count % names.size()]};
        f.name.assign(names.begin(), names.begin() + static_cast<long>(count));
        f.position = random_numbers(count);
        if (velocity) f.velocity = random_numbers(count);
        if (effort) f.effort = random_numbers(count);
        all.push_back(f);
      }
    }
  }
  all[0].header.sec = -1;
  return all;
}
inline std::vector<OdometryFields> odometries() {
  std::vector<OdometryFields> all(9);
  for (std::size_t i = 0; i < all.size(); ++i) {
    auto& m = all[i].message;
    m.header = {1700000000, 1, std::string_view("odometry").substr(0, i)};
    m.child_frame_id = std::string_view("base_link").substr(i);
    fill(m.odometry.position);
    fill(m.odometry.orientation);
    fill(m.odometry.twist);
    fill(m.pose_covariance);
    fill(m.twist_covariance);
  }
  return all;
}
inline std::vector<TwistFields> twists() {
  std::vector<TwistFields> all(3);
  for (auto& t : all) fill(t.twist);
  return all;
}
inline std::vector<MultiArrayFields> multi_arrays() {
  std::vector<MultiArrayFields> all;
  for (const std::size_t n : {0u, 1u, 7u, 100u}) all.push_back({random_numbers(n)});
  return all;
}

// The same ones for each that asks.
struct Messages {
  std::vector<JointStateFields> joints = joint_states();
  std::vector<OdometryFields> odometry = odometries();
  std::vector<TwistFields> twist = twists();
  std::vector<MultiArrayFields> arrays = multi_arrays();
};
inline const Messages& messages() {
  static const Messages all;
  return all;
}
template <class F>
void for_all(F f) {
  for (const auto& m : messages().joints) f(m);
  for (const auto& m : messages().odometry) f(m);
  for (const auto& m : messages().twist) f(m);
  for (const auto& m : messages().arrays) f(m);
}

}  // namespace cdr_test
