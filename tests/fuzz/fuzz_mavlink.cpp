// SPDX-License-Identifier: BSD-3-Clause
// An ArduSub vehicle that hears anything, in pieces of any size, at any time, while its user asks
// for things: what it knows stays finite and in range, what it sends are frames with finite
// numbers. The first byte says whether the rest is a stream, or payloads that get a header and a
// CRC that hold: a fuzzer seldom finds a CRC by itself.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "icat/adapters/mavlink.hpp"

namespace {

void must(bool holds) {
  if (!holds) __builtin_trap();
}

void check(const icat::MavlinkVehicle& vehicle, double now) {
  const icat::Odometry o = vehicle.odometry();
  double norm = 0;
  for (const double x : o.orientation) norm += x * x;
  must(std::fabs(norm - 1) < 1e-12);
  for (const double x : o.position) must(std::fabs(x) <= 1e6);
  for (const double v : o.twist) must(std::fabs(v) <= 3 * 50);
  must(!(vehicle.age(now) < 0));
  const auto& c = vehicle.counts();
  must(vehicle.heartbeat().count + vehicle.attitude().count + vehicle.position().count + c.refused +
           c.foreign <=
       c.frames);
  if (!vehicle.healthy(now)) return;
  must(vehicle.heartbeat().count > 0 && vehicle.attitude().count > 0);
  must(vehicle.position().count > 0 && vehicle.age(now) <= 0.5);
}

// What goes out comes in again whole, and says nothing that no vehicle can do.
void check_sent(std::span<const std::uint8_t> bytes, bool healthy) {
  icat::MavlinkCounts counts;
  icat::detail::mavlink::FrameReader reader;
  std::size_t size = 0;
  reader.push(bytes, counts, [&](const mavlink_message_t& m) {
    std::uint8_t again[280];
    mavlink_message_t copy = m;
    const std::uint16_t crc =
        static_cast<std::uint16_t>(bytes[size + 10 + m.len] | bytes[size + 11 + m.len] << 8);
    copy.checksum = crc;
    const std::size_t n = mavlink_msg_to_send_buffer(again, &copy);
    must(size + n <= bytes.size() && std::memcmp(again, bytes.data() + size, n) == 0);
    size += n;
    if (m.msgid != MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED) return;
    mavlink_set_position_target_local_ned_t t;
    mavlink_msg_set_position_target_local_ned_decode(&m, &t);
    const float v[] = {t.vx, t.vy, t.vz, t.yaw_rate};
    for (const float x : v) must(std::fabs(x) <= 201 && (healthy || x == 0));
  });
  must(size == bytes.size() && counts.damaged + counts.skipped + counts.unknown == 0);
}

// A frame around a payload: byte 0 the message, 1 the sender, 2 the length.
std::vector<std::uint8_t> framed(std::span<const std::uint8_t> b, std::uint8_t number,
                                 std::size_t& used) {
  constexpr std::uint8_t ids[] = {MAVLINK_MSG_ID_HEARTBEAT, MAVLINK_MSG_ID_ATTITUDE,
                                  MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
                                  MAVLINK_MSG_ID_LOCAL_POSITION_NED, MAVLINK_MSG_ID_COMMAND_ACK};
  const std::uint8_t id = ids[b[0] % 5];
  std::size_t length = b[2] % 64;
  length = length < b.size() - 3 ? length : b.size() - 3;
  used = 3 + length;
  std::vector<std::uint8_t> f = {0xFD,   static_cast<std::uint8_t>(length),
                                 0,      0,
                                 number, static_cast<std::uint8_t>(b[1] < 8 ? 2 : 1),
                                 1,      id,
                                 0,      0};
  f.insert(f.end(), b.begin() + 3, b.begin() + 3 + static_cast<std::ptrdiff_t>(length));
  std::uint16_t crc = crc_calculate(f.data() + 1, static_cast<std::uint16_t>(f.size() - 1));
  crc_accumulate(mavlink_get_msg_entry(id)->crc_extra, &crc);
  f.push_back(static_cast<std::uint8_t>(crc & 0xFF));
  f.push_back(static_cast<std::uint8_t>(crc >> 8));
  return f;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const bool stream = data[0] % 2 == 0;
  std::span<const std::uint8_t> rest(data + 1, size - 1);
  icat::MavlinkVehicle vehicle;
  double now = 0;
  std::uint8_t number = 0;
  while (rest.size() > 3) {
    const std::uint8_t what = rest[0];
    now += 0.01 * (what % 16);
    if (what % 32 == 31) vehicle.arm();
    if (what % 32 == 30) vehicle.set_mode(icat::ArduSubMode::guided);
    if (what % 64 == 29) vehicle.disarm();
    rest = rest.subspan(1);
    std::size_t used = 0;
    if (stream) {
      used = std::min<std::size_t>(1 + what / 4, rest.size());
      vehicle.receive(rest.first(used), now);
    } else {
      number = static_cast<std::uint8_t>(number + (what % 8 == 0 ? what : 1));
      const auto frame = framed(rest, number, used);
      const std::uint32_t before = vehicle.counts().frames;
      vehicle.receive(frame, now);
      must(vehicle.counts().frames == before + 1);
    }
    rest = rest.subspan(used);
    check(vehicle, now);
    if (what % 3 == 0) {
      const double v = what % 128 == 127 ? NAN : what - 128.0;
      const bool well = vehicle.set_velocity({v / 10, 0.1, -0.1, v}, now) == icat::Status::ok;
      must(well == (std::fabs(v) <= 20));
    }
    check_sent(vehicle.send(now), vehicle.healthy(now));
  }
  return 0;
}
