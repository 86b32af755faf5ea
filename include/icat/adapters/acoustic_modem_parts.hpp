// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A message of the cooperation (24 bytes, 168 with the span of the tool task) cut into instant
/// messages of an acoustic modem, which hold at most 64 bytes. Each part, little-endian:
///
///     byte 0         1010 ccii: c + 1 parts in all, this one is part i
///     byte 1         the agent that sends it
///     bytes 2 … 5    the round, 32 bits with sign
///     data           56 bytes; what is left in the last part
///     2 bytes        CRC-16 (polynomial 1021h, as in CRC-16/CCITT-FALSE) of all before it
///
/// The CRC of a part continues that of the part before it. So a part is accepted only after its own
/// predecessor: parts of two messages are never joined. The 8 bytes around the data make 32 bytes
/// of 24 (a third more on air) and 192 of 168 (a seventh more, 3 parts).
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

namespace icat {

/// A message that has arrived, and what the modem says of it. Plain data.
struct ModemMessage {
  /// Longest message: 4 parts.
  static constexpr std::size_t max_size = 224;
  std::size_t agent{0};                    ///< that sent it
  long long round{0};                      ///< of the exchange
  std::size_t size{0};                     ///< bytes of `data` that count
  std::array<std::byte, max_size> data{};  ///< the message
  int source{-1};                          ///< modem address of the sender
  double duration{0};  ///< s on air, all parts; when it came it was at least so old
  double rssi{0};      ///< dB re 1 V, of the last part
  int integrity{0};    ///< of the weakest part's signal
  bool newer{false};   ///< its round comes after the one before it from this agent
  /// The message as `Agent::receive` takes it.
  std::span<const std::byte> bytes() const noexcept { return {data.data(), size}; }
};

namespace detail::modem {

inline constexpr std::size_t max_part = 64, overhead = 8, max_payload = max_part - overhead;
inline constexpr std::size_t max_parts = ModemMessage::max_size / max_payload;

/// Goes on from `crc`; 0xffff at the beginning.
inline std::uint16_t crc16(std::span<const std::byte> bytes, std::uint16_t crc = 0xffff) noexcept {
  unsigned sum = crc;
  for (const std::byte b : bytes) {
    sum ^= std::to_integer<unsigned>(b) << 8;
    for (int k = 0; k < 8; ++k) sum = ((sum << 1) ^ ((sum & 0x8000u) ? 0x1021u : 0u)) & 0xffffu;
  }
  return static_cast<std::uint16_t>(sum);
}
/// Parts of a message of `size` bytes.
constexpr std::size_t part_count(std::size_t size) noexcept {
  return (size + max_payload - 1) / max_payload;
}
/// Bytes of part `i` of a message of `size` bytes.
constexpr std::size_t part_size(std::size_t size, std::size_t i) noexcept {
  return std::min(max_payload, size - i * max_payload) + overhead;
}

/// Writes part `i` of `message` (1 … 224 bytes), and moves `crc` on; 0xffff before the first part.
/// Returns its size.
inline std::size_t encode_part(std::uint8_t agent, std::int32_t round,
                               std::span<const std::byte> message, std::size_t i,
                               std::uint16_t& crc, std::span<std::byte, max_part> part) noexcept {
  const std::size_t size = part_size(message.size(), i);
  const std::size_t last = part_count(message.size()) - 1;
  const auto number = static_cast<std::uint32_t>(round);
  part[0] = static_cast<std::byte>(0xa0u | (last << 2) | i);
  part[1] = static_cast<std::byte>(agent);
  for (std::size_t k = 0; k < 4; ++k) {
    part[2 + k] = static_cast<std::byte>((number >> (8 * k)) & 0xffu);
  }
  std::memcpy(part.data() + 6, message.data() + i * max_payload, size - overhead);
  crc = crc16(part.first(size - 2), crc);
  part[size - 2] = static_cast<std::byte>(crc & 0xffu);
  part[size - 1] = static_cast<std::byte>(crc >> 8);
  return size;
}

/// A command to the modem, and how much of it was written. Whoever fills it keeps within `size`.
class Command {
 public:
  /// "+++", the number of a protocol, "AT*SENDIM,64,255,noack," and 64 bytes have room.
  static constexpr std::size_t size = 160;
  /// Empties it; in data mode a command begins with +++.
  void begin(bool data_mode) noexcept {
    clear();
    if (data_mode) append("+++");
  }
  void append(std::string_view text) noexcept { append(std::as_bytes(std::span(text))); }
  void append(int number) noexcept {
    char digits[12];
    const auto end = std::to_chars(digits, digits + sizeof digits, number).ptr;
    append(std::string_view(digits, static_cast<std::size_t>(end - digits)));
  }
  void append(std::span<const std::byte> bytes) noexcept {
    const std::size_t n = std::min(bytes.size(), size - size_);
    std::memcpy(bytes_.data() + size_, bytes.data(), n);
    size_ += n;
  }
  void clear() noexcept { at_ = size_ = 0; }
  /// What was not written yet.
  std::span<const std::byte> rest() const noexcept { return {bytes_.data() + at_, size_ - at_}; }
  void advance(std::size_t n) noexcept { at_ += std::min(n, size_ - at_); }

 private:
  std::array<std::byte, size> bytes_{};
  std::size_t at_{0}, size_{0};
};

/// What became of a part.
enum class PartResult : std::uint8_t {
  foreign,   // no part, or of another agent
  damaged,   // wrong size or CRC, or what belongs before it was lost
  doubled,   // came before
  kept,      // there are more to come
  complete,  // the message is there
};

/// Parts of one agent, which come in their order or not at all. No allocation.
class Reassembly {
 public:
  /// On `complete`, and only then, `message` has the agent, round, size and data.
  PartResult put(std::size_t agent, std::span<const std::byte> part,
                 ModemMessage& message) noexcept {
    if (part.size() <= overhead || part.size() > max_part) return PartResult::foreign;
    const unsigned first = std::to_integer<unsigned>(part[0]);
    if ((first & 0xf0u) != 0xa0u || std::to_integer<std::size_t>(part[1]) != agent) {
      return PartResult::foreign;
    }
    const std::size_t i = first & 3u, count = ((first >> 2) & 3u) + 1;
    if (i >= count || (i + 1 < count && part.size() != max_part)) return PartResult::foreign;
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      word |= std::to_integer<std::uint32_t>(part[2 + k]) << (8 * k);
    }
    const auto round = static_cast<std::int32_t>(word);
    const auto crc =
        static_cast<std::uint16_t>(std::to_integer<unsigned>(part[part.size() - 2]) |
                                   (std::to_integer<unsigned>(part[part.size() - 1]) << 8));
    const bool known = any_ && i == last_ && count == count_ && round == round_ && crc == crc_;
    if (known) return PartResult::doubled;
    const bool next = i == 0 || (any_ && i == last_ + 1 && count == count_ && round == round_);
    const std::uint16_t from = i == 0 ? std::uint16_t{0xffff} : crc_;
    if (!next || crc16(part.first(part.size() - 2), from) != crc) {
      // What was begun will not go on: the sender has left it.
      if (last_ + 1 < count_) any_ = false;
      return PartResult::damaged;
    }
    any_ = true;
    last_ = i;
    count_ = count;
    round_ = round;
    crc_ = crc;
    const std::size_t payload = part.size() - overhead;
    std::memcpy(data_.data() + i * max_payload, part.data() + 6, payload);
    if (i + 1 < count) return PartResult::kept;
    const bool again = delivered_ && round == delivered_round_ && crc == delivered_crc_;
    delivered_ = true;
    delivered_round_ = round;
    delivered_crc_ = crc;
    if (again) return PartResult::doubled;
    message.agent = agent;
    message.round = round;
    message.size = i * max_payload + payload;
    message.data = data_;
    std::fill(message.data.begin() + static_cast<std::ptrdiff_t>(message.size), message.data.end(),
              std::byte{0});
    return PartResult::complete;
  }
  /// Parts of the message that is under way which have not come; 0 where none is.
  std::size_t missing() const noexcept { return any_ ? count_ - 1 - last_ : 0; }
  /// Forgets what was begun.
  void reset() noexcept {
    if (missing() > 0) any_ = false;
  }

 private:
  std::array<std::byte, ModemMessage::max_size> data_{};
  std::size_t last_{0}, count_{0};  // of the last part
  std::int32_t round_{0}, delivered_round_{0};
  std::uint16_t crc_{0}, delivered_crc_{0};
  bool any_{false}, delivered_{false};
};

}  // namespace detail::modem

}  // namespace icat
