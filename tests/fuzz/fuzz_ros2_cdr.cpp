// SPDX-License-Identifier: BSD-3-Clause
// Any bytes are a message of ROS 2 or not: what is decoded lies within them, is the same after it
// is encoded and decoded again, and never makes a joint or a base what is not finite.
#include <cstdlib>
#include <vector>

#include "icat/adapters/ros2_cdr.hpp"

namespace {

namespace ros2 = icat::ros2;

void require(bool holds) {
  if (!holds) __builtin_trap();
}
std::uint64_t bits(double x) { return std::bit_cast<std::uint64_t>(x); }
template <class A, class B>
bool same(const A& a, const B& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (bits(a[i]) != bits(b[i])) return false;
  }
  return true;
}
bool same(const ros2::Header& a, const ros2::Header& b) {
  return a.sec == b.sec && a.nanosec == b.nanosec && a.frame_id == b.frame_id;
}
void within(std::string_view text, ros2::Bytes bytes) {
  const auto* first = reinterpret_cast<const std::uint8_t*>(text.data());
  require(text.empty() ||
          (first >= bytes.data() && first + text.size() < bytes.data() + bytes.size()));
}
std::vector<double> values(const ros2::Doubles& from) {
  std::vector<double> to;
  for (std::size_t i = 0; i < from.size(); ++i) to.push_back(from[i]);
  return to;
}

void joint_state(ros2::Bytes bytes, std::vector<std::uint8_t>& room) {
  ros2::JointStateMessage m;
  if (!ros2::decode(bytes, m)) return;
  within(m.header.frame_id, bytes);
  std::vector<std::string_view> names;
  ros2::Strings rest = m.name;
  for (std::string_view name; rest.next(name); names.push_back(name)) within(name, bytes);
  require(names.size() == m.name.size());
  const auto position = values(m.position), velocity = values(m.velocity),
             effort = values(m.effort);
  const std::size_t size =
      ros2::encode_joint_state(m.header, names, position, velocity, effort, room);
  ros2::JointStateMessage again;
  require(size > 0 && ros2::decode(ros2::Bytes(room).first(size), again));
  require(same(m.header, again.header) && same(position, again.position) &&
          same(velocity, again.velocity) && same(effort, again.effort));
  for (const std::string_view name : names) {
    std::string_view other;
    require(again.name.next(other) && name == other);
  }

  icat::JointStates joints({"a", "b", "shoulder"});
  (void)ros2::put(m, 1, joints);
  const icat::JointStates once = joints;
  (void)ros2::put(m, 2, joints);  // doubled
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const icat::JointSample& s = joints[i].value;
    require(std::isfinite(s.position) && std::isfinite(s.velocity) && std::isfinite(s.effort));
    require(joints[i].count <= 1 && joints[i].count == once[i].count);
    require(joints[i].time == once[i].time);
    require(bits(s.position) == bits(once[i].value.position));
  }
}

void odometry(ros2::Bytes bytes, std::vector<std::uint8_t>& room) {
  ros2::OdometryMessage m, again;
  if (!ros2::decode(bytes, m)) return;
  within(m.header.frame_id, bytes);
  within(m.child_frame_id, bytes);
  const std::size_t size = ros2::encode(m, room);
  require(size > 0 && ros2::decode(ros2::Bytes(room).first(size), again));
  require(same(m.header, again.header) && m.child_frame_id == again.child_frame_id &&
          same(m.odometry.position, again.odometry.position) &&
          same(m.odometry.orientation, again.odometry.orientation) &&
          same(m.odometry.twist, again.odometry.twist) &&
          same(m.pose_covariance, again.pose_covariance) &&
          same(m.twist_covariance, again.twist_covariance));
  icat::Odometry o = m.odometry;
  if (icat::normalize(o) != icat::Status::ok) return;
  double square = 0;
  for (const double x : o.orientation) square += x * x;
  require(std::fabs(square - 1) < 1e-12);
  for (const double x : o.position) require(std::isfinite(x));
  for (const double x : o.twist) require(std::isfinite(x));
}

void twist(ros2::Bytes bytes, std::vector<std::uint8_t>& room) {
  icat::Twist t{}, again{};
  if (!ros2::decode(bytes, t)) return;
  const std::size_t size = ros2::encode(t, room);
  require(size == 52 && ros2::decode(ros2::Bytes(room).first(size), again) && same(t, again));
}

void multi_array(ros2::Bytes bytes, std::vector<std::uint8_t>& room) {
  ros2::Float64MultiArrayMessage m, again;
  if (!ros2::decode(bytes, m)) return;
  const auto data = values(m.data);
  const std::size_t size = ros2::encode_multi_array(data, room);
  require(size > 0 && ros2::decode(ros2::Bytes(room).first(size), again) && same(data, again.data));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // Of its own size, so that a byte too far is seen. An empty string of the length 0 takes a byte
  // and its padding more when it is written.
  const std::vector<std::uint8_t> input(data, data + size);
  std::vector<std::uint8_t> room(4 * size + 64);
  joint_state(input, room);
  odometry(input, room);
  twist(input, room);
  multi_array(input, room);
  return 0;
}
