// SPDX-License-Identifier: BSD-3-Clause
// Heartbeats, emergencies and process data of CANopen: what is read goes back to the same frame.
#include <algorithm>
#include <cstring>

#include "icat/adapters/cia402.hpp"

namespace {

void require(bool holds) {
  if (!holds) __builtin_trap();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace icat::canopen;
  if (size < 20) return 0;
  icat::CanFrame frame;
  std::memcpy(&frame.id, data, 4);
  const int node = data[4] & 0x7f;
  if (data[5] & 1) frame.id = (data[5] & 2 ? 0x700u : 0x80u) + static_cast<unsigned>(node);
  frame.size = data[6] % 9;
  frame.extended = (data[5] & 0x70) == 0x70;
  frame.remote = (data[5] & 0x8c) == 0x8c;
  std::copy_n(data + 7, frame.size, frame.data.begin());

  require(icat::bits_on_wire(frame) <= icat::worst_case_bits(frame.size, frame.extended));
  require(icat::bits_on_wire(frame) >= (frame.extended ? 67 : 47));
  NmtState state{};
  if (decode_heartbeat(frame, node, state)) require(heartbeat_frame(node, state) == frame);
  Emergency emergency;
  if (decode_emergency(frame, node, emergency)) require(emergency_frame(node, emergency) == frame);
  static_cast<void>(drive_state(static_cast<std::uint16_t>(data[7] | data[8] << 8)));
  static_cast<void>(describe_abort(frame.id));
  double number = 0;
  std::memcpy(&number, data + 8, 8);
  require(to_int32(number) >= -2147483647);

  // A mapping of some entries: each keeps its value, and does not touch the others.
  const auto bits = [&](std::size_t i) { return static_cast<std::uint8_t>(data[16 + i]); };
  try {
    const PdoMapping mapping{{0x6041, 0, bits(0)}, {0x6064, 0, bits(1)}, {0x6078, 0, bits(2)}};
    icat::CanFrame written{0x181, mapping.bytes(), {}};
    std::int64_t values[3];
    for (std::size_t i = 0; i < 3; ++i) {
      std::memcpy(&values[i], data + 2 + 4 * i, 8);
      mapping.put(written, i, values[i]);
    }
    for (std::size_t i = 0; i < 3; ++i) {
      const int above = 64 - mapping.entry(i).bits;
      const auto raw = static_cast<std::uint64_t>(values[i]) << above;
      require(mapping.get_unsigned(written, i) == raw >> above);
      require(mapping.get_signed(written, i) == static_cast<std::int64_t>(raw) >> above);
    }
  } catch (const std::invalid_argument&) {
  }
  return 0;
}
