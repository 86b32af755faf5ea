// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Plain CDR, version 1, which is how DDS and bags of ROS 2 encode a message [OMG DDSI-RTPS 2.5,
/// 10; DDS-XTypes 1.3, 7.4.1]: four bytes say which byte order, then every number is aligned to its
/// size, counted from the end of these four. A string is its length with the zero at its end, then
/// its bytes; a sequence is its length, then its elements. Nothing here allocates or throws.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <string_view>
#include <utility>

/// Messages of ROS 2 as bytes.
namespace icat::ros2 {

/// The bytes of one message, with the four that say how it is encoded.
using Bytes = std::span<const std::uint8_t>;

}  // namespace icat::ros2

namespace icat::detail::cdr {

// The bytes of a number, in the other order where `swap`.
template <class T>
T load(const std::uint8_t* from, bool swap) noexcept {
  std::array<std::uint8_t, sizeof(T)> bytes;
  std::memcpy(bytes.data(), from, sizeof(T));
  if (swap) {
    for (std::size_t i = 0; i < sizeof(T) / 2; ++i) {
      std::swap(bytes[i], bytes[sizeof(T) - 1 - i]);
    }
  }
  return std::bit_cast<T>(bytes);
}

}  // namespace icat::detail::cdr

namespace icat::ros2 {

/// A sequence of float64 within the bytes of a message.
class Doubles {
 public:
  /// None.
  Doubles() = default;
  /// `count` of them from `first`, in the other order of bytes where `swap`.
  Doubles(const std::uint8_t* first, std::uint32_t count, bool swap) noexcept
      : first_(first), count_(count), swap_(swap) {}
  /// How many.
  std::size_t size() const noexcept { return count_; }
  /// The i-th, i < size().
  double operator[](std::size_t i) const noexcept {
    return detail::cdr::load<double>(first_ + 8 * i, swap_);
  }

 private:
  const std::uint8_t* first_{nullptr};
  std::uint32_t count_{0};
  bool swap_{false};
};

}  // namespace icat::ros2

namespace icat::detail::cdr {

// Reads one message from its first byte to its last. After an error all numbers are 0, all
// sequences empty, and `complete` is false.
class Reader {
 public:
  Reader() = default;
  explicit Reader(ros2::Bytes message) noexcept {
    // 00 00: big endian; 00 01: little endian; then two bytes of options.
    ok_ = message.size() >= 4 && message[0] == 0 && message[1] <= 1;
    if (!ok_) return;
    swap_ = (message[1] == 1) != (std::endian::native == std::endian::little);
    data_ = message.subspan(4);
  }

  template <class T>
  T number() noexcept {
    const std::size_t at = (place_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    if (!ok_ || at > data_.size() || data_.size() - at < sizeof(T)) return fail(T{});
    place_ = at + sizeof(T);
    return load<T>(data_.data() + at, swap_);
  }
  template <std::size_t N>
  void numbers(std::array<double, N>& to) noexcept {
    for (double& x : to) x = number<double>();
  }
  // Some writers give an empty string the length 0, without the zero at its end.
  std::string_view string() noexcept {
    const std::uint32_t length = number<std::uint32_t>();
    if (!ok_ || length == 0) return {};
    if (data_.size() - place_ < length || data_[place_ + length - 1] != 0) {
      return fail(std::string_view{});
    }
    const auto* first = reinterpret_cast<const char*>(data_.data() + place_);
    place_ += length;
    return {first, length - 1};
  }
  // No padding before the elements where there are none.
  ros2::Doubles doubles() noexcept {
    const std::uint32_t count = number<std::uint32_t>();
    if (!ok_ || count == 0) return {};
    const std::size_t at = (place_ + 7) / 8 * 8;
    if (at > data_.size() || (data_.size() - at) / 8 < count) return fail(ros2::Doubles{});
    place_ = at + 8 * std::size_t{count};
    return {data_.data() + at, count, swap_};
  }
  bool ok() const noexcept { return ok_; }
  // All is read; what is left is at most the padding to a multiple of four.
  bool complete() const noexcept { return ok_ && data_.size() - place_ < 4; }

 private:
  template <class T>
  T fail(T nothing) noexcept {
    ok_ = false;
    return nothing;
  }

  ros2::Bytes data_;
  std::size_t place_{0};
  bool ok_{false};
  bool swap_{false};
};

// Writes one message. After it ran out of room `size` is 0.
class Writer {
 public:
  explicit Writer(std::span<std::uint8_t> to) noexcept : to_(to), ok_(to.size() >= 4) {
    if (ok_) std::memcpy(to_.data(), "\0\1\0\0", 4);
  }

  template <class T>
  void number(T value) noexcept {
    align(sizeof(T));
    auto bytes = std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(value);
    if constexpr (std::endian::native != std::endian::little) {
      for (std::size_t i = 0; i < sizeof(T) / 2; ++i) {
        std::swap(bytes[i], bytes[sizeof(T) - 1 - i]);
      }
    }
    append(bytes.data(), sizeof(T));
  }
  template <class Numbers>
  void numbers(const Numbers& values) noexcept {
    for (const double x : values) number(x);
  }
  void string(std::string_view text) noexcept {
    if (!fits(text.size() + 1)) return;
    number(static_cast<std::uint32_t>(text.size() + 1));
    if (!text.empty()) append(text.data(), text.size());
    append("", 1);
  }
  void doubles(std::span<const double> values) noexcept {
    if (!fits(values.size())) return;
    number(static_cast<std::uint32_t>(values.size()));
    numbers(values);
  }
  bool fits(std::size_t count) noexcept {
    if (count > std::numeric_limits<std::uint32_t>::max()) ok_ = false;
    return ok_;
  }
  std::size_t size() const noexcept { return ok_ ? place_ : 0; }

 private:
  void align(std::size_t to) noexcept {
    while (ok_ && (place_ - 4) % to != 0) append("", 1);
  }
  void append(const void* bytes, std::size_t count) noexcept {
    if (!ok_ || to_.size() - place_ < count) {
      ok_ = false;
      return;
    }
    std::memcpy(to_.data() + place_, bytes, count);
    place_ += count;
  }

  std::span<std::uint8_t> to_;
  std::size_t place_{4};
  bool ok_;
};

}  // namespace icat::detail::cdr
