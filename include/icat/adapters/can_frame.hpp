// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A frame of classical CAN, and how many bits it takes on the wire [ISO 11898-1:2015, 10.4, 10.5]:
///
///     11-bit identifier   34 + 8 n bits that are stuffed, 13 that are not
///     29-bit identifier   54 + 8 n                        13
///
/// where n bytes are carried, and a bit of the other kind is stuffed in after five equal ones.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace icat {

/// A frame of classical CAN.
struct CanFrame {
  std::uint32_t id{0};                 ///< 11 bits, or 29 where `extended`
  std::uint8_t size{0};                ///< how many bytes of `data` are carried, 0 to 8
  std::array<std::uint8_t, 8> data{};  ///< zero beyond `size`
  bool extended{false};                ///< a 29-bit identifier
  bool remote{false};                  ///< asks for a frame; carries none of `data`

  /// Same frame.
  bool operator==(const CanFrame&) const = default;
};

/// The most bits that a frame of `size` bytes can take, interframe space counted in. `size` above 8
/// counts as 8.
constexpr int worst_case_bits(int size, bool extended = false) noexcept {
  const int stuffed = (extended ? 54 : 34) + 8 * (size < 0 ? 0 : size > 8 ? 8 : size);
  return stuffed + (stuffed - 1) / 4 + 13;
}

namespace detail::can {

// The bits of a frame one after the other: CRC and stuffing as they come.
class BitCounter {
 public:
  constexpr void put(std::uint32_t value, int bits) noexcept {
    for (int i = bits - 1; i >= 0; --i) put((value >> i & 1u) != 0);
  }
  // The checksum itself is stuffed, too.
  constexpr void put_checksum() noexcept { put(checksum_, 15); }
  constexpr int count() const noexcept { return count_; }

 private:
  constexpr void put(bool bit) noexcept {
    const bool flip = bit != ((checksum_ >> 14 & 1u) != 0);
    checksum_ = (checksum_ << 1 & 0x7fffu) ^ (flip ? 0x4599u : 0u);
    ++count_;
    run_ = run_ > 0 && bit == last_ ? run_ + 1 : 1;
    last_ = bit;
    if (run_ == 5) {
      ++count_;
      last_ = !bit;
      run_ = 1;
    }
  }
  std::uint32_t checksum_{0};
  int count_{0};
  int run_{0};
  bool last_{false};
};

}  // namespace detail::can

/// The bits that this very frame takes, interframe space counted in. No allocation.
constexpr int bits_on_wire(const CanFrame& frame) noexcept {
  detail::can::BitCounter bits;
  bits.put(0, 1);  // start of frame
  if (frame.extended) {
    bits.put(frame.id >> 18 & 0x7ffu, 11);
    bits.put(3, 2);  // substitute remote request, identifier extension
    bits.put(frame.id & 0x3ffffu, 18);
    bits.put(frame.remote ? 4 : 0, 3);
  } else {
    bits.put(frame.id & 0x7ffu, 11);
    bits.put(frame.remote ? 4 : 0, 3);
  }
  const std::uint8_t size = frame.size > 8 ? std::uint8_t{8} : frame.size;
  bits.put(size, 4);
  if (!frame.remote) {
    for (std::size_t i = 0; i < size; ++i) bits.put(frame.data[i], 8);
  }
  bits.put_checksum();
  return bits.count() + 13;
}

}  // namespace icat
