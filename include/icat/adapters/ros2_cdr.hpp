// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The bytes of four messages of ROS 2, as they are on the wire and in a bag:
/// `sensor_msgs/JointState`, `nav_msgs/Odometry`, `geometry_msgs/Twist`,
/// `std_msgs/Float64MultiArray`, in plain CDR (cdr.hpp). `encode` writes little endian, `decode`
/// reads either.
///
/// A message is decoded whole or not at all: one that is cut off, too long by more than the padding
/// to four bytes, or at odds with itself is refused, and what it was to be decoded into stays. What
/// `decode` gives are views into the bytes. Nothing here allocates or throws.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "icat/adapters/cdr.hpp"
#include "icat/adapters/robot_messages.hpp"
#include "icat/core/status.hpp"

namespace icat::ros2 {

/// `std_msgs/Header`.
struct Header {
  std::int32_t sec{0};          ///< s
  std::uint32_t nanosec{0};     ///< ns, below 1e9
  std::string_view frame_id{};  ///< of what is said
  /// s. A double knows today's time to a quarter of a microsecond.
  double stamp() const noexcept { return sec + 1e-9 * nanosec; }
};

/// The names of a message, one after the other.
class Strings {
 public:
  /// None.
  Strings() = default;
  /// `count` strings, the first of which `reader` reads next.
  Strings(const detail::cdr::Reader& reader, std::uint32_t count) noexcept
      : reader_(reader), left_(count) {}
  /// How many are left.
  std::size_t size() const noexcept { return left_; }
  /// Takes the next one; false where none is left.
  bool next(std::string_view& text) noexcept {
    if (left_ == 0) return false;
    --left_;
    text = reader_.string();
    return true;
  }

 private:
  detail::cdr::Reader reader_;
  std::uint32_t left_{0};
};

/// `sensor_msgs/JointState`. The three sequences have as many entries as there are names, or none.
struct JointStateMessage {
  Header header;     ///< its stamp is that of the measurement
  Strings name;      ///< of the joints
  Doubles position;  ///< rad or m
  Doubles velocity;  ///< rad/s or m/s
  Doubles effort;    ///< N m or N
};

/// `nav_msgs/Odometry`.
struct OdometryMessage {
  Header header;                              ///< its frame is that of the pose
  std::string_view child_frame_id;            ///< the frame of the twist
  Odometry odometry;                          ///< as it was sent, not checked
  std::array<double, 36> pose_covariance{};   ///< 6 × 6, rows one after the other
  std::array<double, 36> twist_covariance{};  ///< 6 × 6, rows one after the other
};

/// `std_msgs/Float64MultiArray`, without what its layout says of the dimensions, which controllers
/// do not look at.
struct Float64MultiArrayMessage {
  std::uint32_t dimensions{0};   ///< how many dimensions the layout has
  std::uint32_t data_offset{0};  ///< from the layout
  Doubles data;                  ///< all of them
};

}  // namespace icat::ros2

namespace icat::detail::cdr {

inline ros2::Header header(Reader& in) noexcept {
  ros2::Header header;
  header.sec = in.number<std::int32_t>();
  header.nanosec = in.number<std::uint32_t>();
  header.frame_id = in.string();
  return header;
}
inline void header(Writer& out, const ros2::Header& header) noexcept {
  out.number(header.sec);
  out.number(header.nanosec);
  out.string(header.frame_id);
}

}  // namespace icat::detail::cdr

namespace icat::ros2 {

/// False where `bytes` are no JointState; `message` stays then. Its views live as long as `bytes`.
inline bool decode(Bytes bytes, JointStateMessage& message) noexcept {
  detail::cdr::Reader in(bytes);
  JointStateMessage m;
  m.header = detail::cdr::header(in);
  const std::uint32_t names = in.number<std::uint32_t>();
  m.name = Strings(in, names);
  for (std::uint32_t i = 0; in.ok() && i < names; ++i)
    in.string();  // each takes four bytes or more
  m.position = in.doubles();
  m.velocity = in.doubles();
  m.effort = in.doubles();
  const auto fits = [&](const Doubles& d) { return d.size() == 0 || d.size() == names; };
  if (!in.complete() || m.header.nanosec >= 1000000000u || !fits(m.position) || !fits(m.velocity) ||
      !fits(m.effort)) {
    return false;
  }
  message = m;
  return true;
}

/// False where `bytes` are no Odometry; `message` stays then. Its views live as long as `bytes`.
inline bool decode(Bytes bytes, OdometryMessage& message) noexcept {
  detail::cdr::Reader in(bytes);
  OdometryMessage m;
  m.header = detail::cdr::header(in);
  m.child_frame_id = in.string();
  in.numbers(m.odometry.position);
  in.numbers(m.odometry.orientation);
  in.numbers(m.pose_covariance);
  in.numbers(m.odometry.twist);
  in.numbers(m.twist_covariance);
  if (!in.complete() || m.header.nanosec >= 1000000000u) return false;
  message = m;
  return true;
}

/// False where `bytes` are no Twist; `twist` stays then.
inline bool decode(Bytes bytes, Twist& twist) noexcept {
  detail::cdr::Reader in(bytes);
  Twist t;
  in.numbers(t);
  if (!in.complete()) return false;
  twist = t;
  return true;
}

/// False where `bytes` are no Float64MultiArray; `message` stays then. Its view lives as long as
/// `bytes`.
inline bool decode(Bytes bytes, Float64MultiArrayMessage& message) noexcept {
  detail::cdr::Reader in(bytes);
  Float64MultiArrayMessage m;
  m.dimensions = in.number<std::uint32_t>();
  for (std::uint32_t i = 0; in.ok() && i < m.dimensions; ++i) {
    in.string();
    in.number<std::uint32_t>();  // size
    in.number<std::uint32_t>();  // stride
  }
  m.data_offset = in.number<std::uint32_t>();
  m.data = in.doubles();
  if (!in.complete()) return false;
  message = m;
  return true;
}

/// A JointState. The three sequences have as many entries as there are names, or none. Returns how
/// many bytes of `to` it takes; 0 where it does not fit or the sizes do not.
inline std::size_t encode_joint_state(const Header& header, std::span<const std::string_view> names,
                                      std::span<const double> position,
                                      std::span<const double> velocity,
                                      std::span<const double> effort,
                                      std::span<std::uint8_t> to) noexcept {
  for (const auto& values : {position, velocity, effort}) {
    if (!values.empty() && values.size() != names.size()) return 0;
  }
  detail::cdr::Writer out(to);
  detail::cdr::header(out, header);
  if (!out.fits(names.size())) return 0;
  out.number(static_cast<std::uint32_t>(names.size()));
  for (const std::string_view name : names) out.string(name);
  out.doubles(position);
  out.doubles(velocity);
  out.doubles(effort);
  return out.size();
}

/// An Odometry. Returns how many bytes of `to` it takes; 0 where it does not fit.
inline std::size_t encode(const OdometryMessage& message, std::span<std::uint8_t> to) noexcept {
  detail::cdr::Writer out(to);
  detail::cdr::header(out, message.header);
  out.string(message.child_frame_id);
  out.numbers(message.odometry.position);
  out.numbers(message.odometry.orientation);
  out.numbers(message.pose_covariance);
  out.numbers(message.odometry.twist);
  out.numbers(message.twist_covariance);
  return out.size();
}

/// A Twist. Returns how many bytes of `to` it takes: 52; 0 where it does not fit.
inline std::size_t encode(const Twist& twist, std::span<std::uint8_t> to) noexcept {
  detail::cdr::Writer out(to);
  out.numbers(twist);
  return out.size();
}

/// A Float64MultiArray of an empty layout, which is what controllers take. Returns how many bytes
/// of `to` it takes; 0 where it does not fit.
inline std::size_t encode_multi_array(std::span<const double> data,
                                      std::span<std::uint8_t> to) noexcept {
  detail::cdr::Writer out(to);
  out.number(std::uint32_t{0});  // dimensions
  out.number(std::uint32_t{0});  // data_offset
  out.doubles(data);
  return out.size();
}

/// All of our joints in `message`, which came at `now`, s, into `joints`. A message without
/// positions has nothing for us; a sequence that is empty counts as zeros, as NaN does
/// (`JointStates::put`). Returns `ok`, or why a joint's sample was refused: `non_finite`,
/// `time_reversed`. No allocation.
inline Status put(const JointStateMessage& message, double now, JointStates& joints) noexcept {
  const auto of = [](const Doubles& values, std::size_t i) {
    return i < values.size() ? values[i] : 0;
  };
  Status worst = Status::ok;
  Strings names = message.name;
  std::string_view name;
  for (std::size_t i = 0; i < message.position.size() && names.next(name); ++i) {
    const Status status =
        joints.put(name, {message.position[i], of(message.velocity, i), of(message.effort, i)},
                   message.header.stamp(), now);
    if (status != Status::ok && status != Status::unknown_joint) worst = status;
  }
  return worst;
}

}  // namespace icat::ros2
