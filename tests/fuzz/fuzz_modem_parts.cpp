// SPDX-License-Identifier: BSD-3-Clause
// Parts of messages in any order: what comes together is exactly what makes these parts.
#include <array>
#include <cstdint>
#include <icat/adapters/acoustic_modem_parts.hpp>
#include <vector>

namespace {

void require(bool holds) {
  if (!holds) __builtin_trap();
}
using Bytes = std::span<const std::byte>;
using namespace icat::detail::modem;  // NOLINT

std::vector<std::vector<std::byte>> cut(std::uint8_t agent, std::int32_t round, Bytes message) {
  std::vector<std::vector<std::byte>> all;
  std::uint16_t crc = 0xffff;
  for (std::size_t i = 0; i < part_count(message.size()); ++i) {
    std::array<std::byte, max_part> part;
    const std::size_t n = encode_part(agent, round, message, i, crc, part);
    require(n > overhead && n <= max_part);
    all.emplace_back(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(n));
  }
  return all;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const Bytes bytes(reinterpret_cast<const std::byte*>(data), size);
  if (size < 8) return 0;
  const std::uint8_t agent = data[0];
  // Two messages cut from the input, and the input itself as a part.
  std::vector<std::vector<std::byte>> parts;
  std::size_t at = 8;
  for (int k = 0; k < 2; ++k) {
    const std::size_t length = std::min<std::size_t>(1 + data[1 + k] % 224, size - at);
    if (length == 0) break;
    const auto round = static_cast<std::int32_t>(data[3 + k] % 2);
    for (auto& part : cut(agent, round, bytes.subspan(at, length))) parts.push_back(part);
    at += length;
  }
  parts.emplace_back(bytes.begin(), bytes.end());

  Reassembly reassembly;
  icat::ModemMessage message;
  std::vector<std::vector<std::byte>> taken;
  for (std::size_t k = at; k < size; ++k) {
    std::vector<std::byte> part = parts[data[k] % parts.size()];
    if (data[k] & 0x80u) {  // with a bit changed
      ++k;
      const std::size_t bit = k < size ? data[k] : 0;
      part[bit % part.size()] ^= std::byte{1} << (bit / 32);
    }
    const PartResult result = reassembly.put(agent, part, message);
    require(reassembly.missing() < max_parts);
    if (result != PartResult::kept && result != PartResult::complete) continue;
    if ((part[0] & std::byte{3}) == std::byte{0}) taken.clear();
    taken.push_back(part);
    if (result == PartResult::kept) continue;
    require(message.agent == agent && message.size >= 1 && message.size <= message.data.size());
    require(cut(agent, static_cast<std::int32_t>(message.round), message.bytes()) == taken);
  }
  return 0;
}
