// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What agents send each other: float32 numbers, little-endian, nothing else. A tool velocity is 6
/// of them, 192 bits [Coop, IV-B]; with the span of the tool task 36 more, 1344 bits.
///
/// There is no header and no checksum: framing and integrity are the modem's.
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

}  // namespace icat
