// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Frames of MAVLink 1 and 2 in a stream of bytes [mavlink.io, guide "Packet Serialization"],
/// and which of them are new. The tables of messages are those of the C headers that pymavlink's
/// generator writes; docs/mavlink.md has the commands.
///
/// A frame counts when its CRC holds. After one that does not, the search goes on with the byte
/// after its first: a damaged length costs no frame but its own.
#pragma once

// Whichever dialect the program has; ArduPilot's holds the common one.
#if !defined(MAVLINK_H)
#if __has_include(<ardupilotmega/mavlink.h>)
#include <ardupilotmega/mavlink.h>
#else
#include <common/mavlink.h>
#endif
#endif

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <span>

namespace icat {

/// Counts of a MAVLink stream. Each number wraps around.
struct MavlinkCounts {
  std::uint32_t frames{0};    ///< whole, with a CRC that holds
  std::uint32_t damaged{0};   ///< begins of frames whose CRC, length or flags do not hold
  std::uint32_t unknown{0};   ///< begins of frames of messages that the headers do not know
  std::uint32_t skipped{0};   ///< bytes that belong to no frame
  std::uint32_t foreign{0};   ///< frames of other systems or components
  std::uint32_t lost{0};      ///< gaps in the vehicle's numbering; what came late was counted, too
  std::uint32_t repeated{0};  ///< the vehicle's, that had come before
  std::uint32_t late{0};      ///< the vehicle's, older than what had come before
  std::uint32_t refused{0};   ///< whole, with invalid data: NaN, no rotation, implausible
  std::uint32_t reboots{0};   ///< the vehicle's clock began anew
};

namespace detail::mavlink {

/// Cuts a stream into frames. No allocation.
class FrameReader {
 public:
  /// Of a frame: header of 10, payload of 255, CRC of 2, signature of 13 bytes.
  static constexpr std::size_t longest = 280;

  /// Calls `sink(const mavlink_message_t&)` for each whole frame. A begin of a frame at the end of
  /// `bytes` waits for more.
  template <class Sink>
  void push(std::span<const std::uint8_t> bytes, MavlinkCounts& counts, Sink&& sink) noexcept {
    while (!bytes.empty()) {
      const std::size_t n = std::min(bytes.size(), buffer_.size() - size_);
      std::memcpy(buffer_.data() + size_, bytes.data(), n);
      size_ += n;
      bytes = bytes.subspan(n);
      scan(counts, sink);  // leaves less than `longest`
    }
  }

 private:
  enum class Verdict { frame, damaged, unknown, incomplete };

  template <class Sink>
  void scan(MavlinkCounts& counts, Sink& sink) noexcept {
    std::size_t at = 0;
    while (at < size_) {
      const std::uint8_t first = buffer_[at];
      if (first != MAVLINK_STX && first != MAVLINK_STX_MAVLINK1) {
        ++at;
        ++counts.skipped;
        continue;
      }
      std::size_t length = 1;
      const Verdict verdict = look({buffer_.data() + at, size_ - at}, length);
      if (verdict == Verdict::incomplete) break;
      at += length;
      if (verdict == Verdict::frame) {
        ++counts.frames;
        sink(static_cast<const mavlink_message_t&>(message_));
      } else {
        ++(verdict == Verdict::unknown ? counts.unknown : counts.damaged);
        ++counts.skipped;
      }
    }
    size_ -= at;
    std::memmove(buffer_.data(), buffer_.data() + at, size_);
  }

  // Of a frame, `length` becomes its own and `message_` is filled.
  Verdict look(std::span<const std::uint8_t> b, std::size_t& length) noexcept {
    const bool second = b[0] == MAVLINK_STX;  // MAVLink 2
    const std::size_t header = second ? 10 : 6;
    if (second && b.size() > 2 && (b[2] & ~MAVLINK_IFLAG_SIGNED) != 0) return Verdict::damaged;
    if (b.size() < header) return Verdict::incomplete;
    const std::uint32_t id =
        second ? b[7] | std::uint32_t{b[8]} << 8 | std::uint32_t{b[9]} << 16 : std::uint32_t{b[5]};
    const mavlink_msg_entry_t* entry = mavlink_get_msg_entry(id);
    if (!entry) return Verdict::unknown;
    const std::size_t payload = b[1];
    // MAVLink 2 cuts zeros at the end, and a newer peer may have more fields at the end.
    if (!second && payload < entry->min_msg_len) return Verdict::damaged;
    const bool is_signed = second && (b[2] & MAVLINK_IFLAG_SIGNED) != 0;
    const std::size_t whole = header + payload + 2 + (is_signed ? MAVLINK_SIGNATURE_BLOCK_LEN : 0);
    if (b.size() < whole) return Verdict::incomplete;
    std::uint16_t crc =
        crc_calculate(b.data() + 1, static_cast<std::uint16_t>(header + payload - 1));
    crc_accumulate(entry->crc_extra, &crc);
    const std::uint8_t* sent = b.data() + header + payload;
    if (sent[0] != (crc & 0xFF) || sent[1] != crc >> 8) return Verdict::damaged;

    std::memset(&message_, 0, sizeof message_);
    message_.magic = b[0];
    message_.len = b[1];
    message_.seq = b[second ? 4 : 2];
    message_.sysid = b[second ? 5 : 3];
    message_.compid = b[second ? 6 : 4];
    message_.msgid = id & 0xFFFFFF;
    std::memcpy(_MAV_PAYLOAD_NON_CONST(&message_), b.data() + header, payload);
    length = whole;
    return Verdict::frame;
  }

  std::array<std::uint8_t, 2 * longest> buffer_{};
  std::size_t size_{0};
  mavlink_message_t message_{};
};

/// A COMMAND_LONG.
struct Command {
  std::uint16_t id;
  float first, second;  // parameters; the others are zero
  std::uint8_t confirmation;
};

/// Our frames, numbered, in a buffer that holds one of each kind. No allocation.
class FrameWriter {
 public:
  FrameWriter(std::uint8_t system, std::uint8_t component) noexcept
      : system_(system), component_(component) {}
  void clear() noexcept { size_ = 0; }
  std::span<const std::uint8_t> bytes() const noexcept { return {buffer_.data(), size_}; }

  void heartbeat() noexcept {
    mavlink_message_t m;
    mavlink_msg_heartbeat_pack_status(system_, component_, &numbers_, &m,
                                      MAV_TYPE_ONBOARD_CONTROLLER, MAV_AUTOPILOT_INVALID, 0, 0,
                                      MAV_STATE_ACTIVE);
    append(m);
  }
  /// MANUAL_CONTROL at rest.
  void sticks(std::uint8_t target_system) noexcept {
    mavlink_manual_control_t c{};
    c.target = target_system;
    c.z = 500;  // ArduSub's axis of thrust runs from 0 to 1000
    mavlink_message_t m;
    mavlink_msg_manual_control_encode_status(system_, component_, &numbers_, &m, &c);
    append(m);
  }
  void command(std::uint8_t target_system, std::uint8_t target_component,
               const Command& command) noexcept {
    mavlink_command_long_t c{};
    c.target_system = target_system;
    c.target_component = target_component;
    c.command = command.id;
    c.confirmation = command.confirmation;
    c.param1 = command.first;
    c.param2 = command.second;
    mavlink_message_t m;
    mavlink_msg_command_long_encode_status(system_, component_, &numbers_, &m, &c);
    append(m);
  }
  /// A velocity on NED, m/s, and a rate of the yaw angle, rad/s. ArduSub turns what comes in a
  /// frame of the body by the yaw alone, so the frame is the world's.
  void set_point(std::uint8_t target_system, std::uint8_t target_component,
                 const std::array<double, 3>& velocity, double yaw_rate) noexcept {
    mavlink_set_position_target_local_ned_t t{};
    t.coordinate_frame = MAV_FRAME_LOCAL_NED;
    t.type_mask = POSITION_TARGET_TYPEMASK_X_IGNORE | POSITION_TARGET_TYPEMASK_Y_IGNORE |
                  POSITION_TARGET_TYPEMASK_Z_IGNORE | POSITION_TARGET_TYPEMASK_AX_IGNORE |
                  POSITION_TARGET_TYPEMASK_AY_IGNORE | POSITION_TARGET_TYPEMASK_AZ_IGNORE |
                  POSITION_TARGET_TYPEMASK_YAW_IGNORE;
    t.target_system = target_system;
    t.target_component = target_component;
    t.vx = static_cast<float>(velocity[0]);
    t.vy = static_cast<float>(velocity[1]);
    t.vz = static_cast<float>(velocity[2]);
    t.yaw_rate = static_cast<float>(yaw_rate);
    mavlink_message_t m;
    mavlink_msg_set_position_target_local_ned_encode_status(system_, component_, &numbers_, &m, &t);
    append(m);
  }

 private:
  void append(const mavlink_message_t& m) noexcept {
    size_ += mavlink_msg_to_send_buffer(buffer_.data() + size_, &m);
  }

  std::uint8_t system_, component_;
  mavlink_status_t numbers_{};
  std::array<std::uint8_t, 4 * FrameReader::longest> buffer_{};
  std::size_t size_{0};
};

/// The numbering of a sender's frames, 0 to 255 and anew.
class Numbering {
 public:
  /// Whether `number`, which came at `now`, s, is newer than those before. After a second without
  /// any, it begins anew.
  bool next(std::uint8_t number, double now, MavlinkCounts& counts) noexcept {
    const auto ahead = static_cast<std::uint8_t>(number - last_);
    const bool anew = !heard_ || !(now - time_ <= 1);
    if (!anew && ahead == 0) return ++counts.repeated, false;
    if (!anew && ahead > 127) return ++counts.late, false;
    if (!anew) counts.lost += ahead - 1u;
    heard_ = true;
    last_ = number;
    time_ = now;
    return true;
  }

 private:
  bool heard_{false};
  std::uint8_t last_{0};
  double time_{0};
};

/// The vehicle's stamps of one message, ms since it started, wrapping after 49.7 days.
class Stamps {
 public:
  enum class Place { newer, repeated, older, rebooted };
  /// Where `stamp` stands. One that is older is late on its way, or the vehicle started anew: it
  /// did when for half a second nothing else has come, three at least, each newer than the one
  /// before.
  Place place(std::uint32_t stamp, double now) noexcept {
    if (!heard_ || after(stamp, last_)) return take(stamp), Place::newer;
    if (stamp == last_ || (rising_ > 0 && stamp == candidate_)) return Place::repeated;
    if (rising_ == 0 || !after(stamp, candidate_)) {
      rising_ = 0;
      since_ = now;
    }
    if (now < since_) since_ = now;  // a clock that was set back
    candidate_ = stamp;
    if (++rising_ < 3 || !(now - since_ >= 0.5)) return Place::older;
    take(stamp);
    return Place::rebooted;
  }
  /// The next stamp is right, whichever it is.
  void forget() noexcept { heard_ = false; }

 private:
  static bool after(std::uint32_t a, std::uint32_t b) noexcept {
    return static_cast<std::int32_t>(a - b) > 0;
  }
  void take(std::uint32_t stamp) noexcept {
    last_ = stamp;
    heard_ = true;
    rising_ = 0;
  }

  bool heard_{false};
  std::uint32_t last_{0};
  std::uint32_t candidate_{0};
  std::uint32_t rising_{0};
  double since_{0};
};

}  // namespace detail::mavlink
}  // namespace icat
