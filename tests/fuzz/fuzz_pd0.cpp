// SPDX-License-Identifier: BSD-3-Clause
// PD0: whatever comes, values are finite and in range, a byte at a time is the same as all at once,
// and an ensemble that follows is found. The input is also taken as a body that gets its sum right.
#include <cmath>
#include <numbers>
#include <vector>

#include "icat/adapters/pd0.hpp"

namespace {

void require(bool condition) {
  if (!condition) __builtin_trap();
}
bool within(double value, double least, double most) { return value >= least && value <= most; }

void check(const icat::Pd0Decoder& dvl) {
  const icat::DvlSample& s = dvl.sample().value;
  for (const icat::DvlVelocity& v : {s.bottom, s.water}) {
    double square = 0;
    for (const double x : v.velocity) square += x * x;
    require(square <= 100.0001);
    require(std::isfinite(v.error) && (v.valid || (square == 0 && !v.has_error)));
    int count = 0;
    for (const bool b : v.beams) count += b ? 1 : 0;
    require(v.valid ? count >= 3 : count == 0);
    require(!v.has_error || count == 4);
  }
  for (const double r : s.range) require(within(r, 0, 167772.16));
  require(within(s.altitude, 0, 167772.16));
  require(within(s.heading, 0, 2 * std::numbers::pi) && std::isfinite(s.pitch + s.roll));
  require(within(s.instrument_time, -1, 8.1e9) && s.ensemble <= 0xffffff);
  require(dvl.sample().count > 0 ? dvl.sample().time == 5 : dvl.bottom_age(5) > 1e300);
}

// A whole ensemble with a number that is not like any other.
std::vector<std::uint8_t> whole(std::uint32_t number) {
  std::vector<std::uint8_t> b(10 + 42 + 42 + 85, 0);
  b[0] = b[1] = 0x7f;
  b[5] = 2;
  const std::size_t fixed = 10, variable = 52;
  b[6] = static_cast<std::uint8_t>(fixed);
  b[8] = static_cast<std::uint8_t>(variable);
  b[variable] = 0x80;
  b[variable + 2] = static_cast<std::uint8_t>(number);
  b[variable + 3] = static_cast<std::uint8_t>(number >> 8);
  b[variable + 11] = static_cast<std::uint8_t>(number >> 16);
  b[2] = static_cast<std::uint8_t>(b.size());
  unsigned sum = 0;
  for (const std::uint8_t x : b) sum += x;
  b.push_back(static_cast<std::uint8_t>(sum));
  b.push_back(static_cast<std::uint8_t>(sum >> 8));
  return b;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  icat::Pd0Decoder dvl, again;
  dvl.put({data, size}, 5);
  for (std::size_t i = 0; i < size; ++i) again.put(data[i], 5);
  check(dvl);
  require(dvl.ensembles() == again.ensembles() && dvl.damaged() == again.damaged());
  require(dvl.sample().count == again.sample().count);

  // With its length and sum put right, so that what is inside is reached.
  if (size >= 10 && size <= 2046) {
    std::vector<std::uint8_t> b(data, data + size);
    b[0] = b[1] = 0x7f;
    b[2] = static_cast<std::uint8_t>(size);
    b[3] = static_cast<std::uint8_t>(size >> 8);
    unsigned sum = 0;
    for (const std::uint8_t x : b) sum += x;
    b.push_back(static_cast<std::uint8_t>(sum));
    b.push_back(static_cast<std::uint8_t>(sum >> 8));
    icat::Pd0Decoder inside;
    inside.put(b, 5);
    check(inside);
  }

  // After at most as many bytes as the longest has, all is well. Long after, so that the number
  // is no matter.
  bool found = false;
  std::size_t sent = 0;
  for (std::uint32_t number = 1; !found; ++number) {
    const auto next = whole(number);
    found = dvl.put(next, 1e6) > 0;
    sent += next.size();
    require(sent <= 2050 + 2 * next.size());
  }
  return 0;
}
