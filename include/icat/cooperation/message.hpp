// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What agents send each other: float32 numbers, little-endian, nothing else. A tool velocity is 6
/// of them, 192 bits [Coop, IV-B]; with the span of the tool task 36 more, 1344 bits.
///
/// There is no header and no checksum: the modem must provide framing and integrity.
///
/// The **pace** of an agent, the fraction of the agreed velocity that it can follow (see
/// agreement.hpp), is sent in the two lowest bits of each of the six numbers of a tool velocity,
/// twelve bits in all. The numbers keep 22 of 24 bits, with an error below 5e-7 of the number.
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "icat/core/status.hpp"
#include "icat/core/types.hpp"

namespace icat {

/// Bytes of a message of `numbers` numbers.
constexpr std::size_t message_size(std::size_t numbers) noexcept { return 4 * numbers; }

/// Writes all coefficients of `values`, column by column, rounded to float32. `bytes` must be
/// exactly as long as the message. NaN, infinity and what float32 cannot hold: refused, nothing is
/// written. No allocation.
template <class Derived>
Status encode(const Eigen::DenseBase<Derived>& values, std::span<std::byte> bytes) noexcept {
  if (bytes.size() != message_size(static_cast<std::size_t>(values.size()))) {
    return Status::wrong_size;
  }
  constexpr double largest = std::numeric_limits<float>::max();
  for (Index j = 0; j < values.cols(); ++j) {
    for (Index i = 0; i < values.rows(); ++i) {
      if (!(std::abs(static_cast<double>(values(i, j))) <= largest)) return Status::non_finite;
    }
  }
  std::size_t at = 0;
  for (Index j = 0; j < values.cols(); ++j) {
    for (Index i = 0; i < values.rows(); ++i) {
      const auto word = std::bit_cast<std::uint32_t>(static_cast<float>(values(i, j)));
      for (int byte = 0; byte < 4; ++byte) {
        bytes[at++] = static_cast<std::byte>((word >> (8 * byte)) & 0xffu);
      }
    }
  }
  return Status::ok;
}

/// Reads what `encode` wrote into `values`, whose size says what is expected. A wrong length, NaN
/// or infinity: refused, `values` stay. No allocation.
template <class Derived>
Status decode(std::span<const std::byte> bytes, Eigen::DenseBase<Derived>& values) noexcept {
  if (bytes.size() != message_size(static_cast<std::size_t>(values.size()))) {
    return Status::wrong_size;
  }
  const auto number = [&](std::size_t k) {
    std::uint32_t word = 0;
    for (std::size_t byte = 0; byte < 4; ++byte) {
      word |= static_cast<std::uint32_t>(bytes[4 * k + byte]) << (8 * byte);
    }
    return std::bit_cast<float>(word);
  };
  const auto count = static_cast<std::size_t>(values.size());
  for (std::size_t k = 0; k < count; ++k) {
    if (!std::isfinite(number(k))) return Status::non_finite;
  }
  std::size_t k = 0;
  for (Index j = 0; j < values.cols(); ++j) {
    for (Index i = 0; i < values.rows(); ++i) {
      values(i, j) = static_cast<typename Derived::Scalar>(number(k++));
    }
  }
  return Status::ok;
}

/// How many steps a pace of 0 is below a pace of 1.
constexpr int pace_steps = 4095;

/// Puts `pace`, 0 … 1, into the two lowest bits of each of the six numbers of the tool velocity at
/// the front of `bytes`, rounded to what is not faster. A pace of 1 is twelve zeros. Too few bytes,
/// or no fraction: refused, nothing is written. No allocation.
inline Status encode_pace(double pace, std::span<std::byte> bytes) noexcept {
  if (bytes.size() < message_size(6)) return Status::wrong_size;
  if (!(pace >= 0 && pace <= 1)) return Status::out_of_range;
  // What was decoded is encoded as the same bits: rounding is no step down.
  auto below = static_cast<unsigned>(std::ceil((1 - pace) * pace_steps - 1e-9));
  for (std::size_t k = 0; k < 6; ++k, below >>= 2) {
    bytes[4 * k] = (bytes[4 * k] & std::byte{0xfc}) | static_cast<std::byte>(below & 3u);
  }
  return Status::ok;
}

/// What `encode_pace` wrote; 1 where there is less than a tool velocity.
inline double decode_pace(std::span<const std::byte> bytes) noexcept {
  if (bytes.size() < message_size(6)) return 1;
  unsigned below = 0;
  for (std::size_t k = 6; k-- > 0;) {
    below = (below << 2) | (std::to_integer<unsigned>(bytes[4 * k]) & 3u);
  }
  return 1 - static_cast<double>(below) / pace_steps;
}

}  // namespace icat
