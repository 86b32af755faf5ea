// SPDX-License-Identifier: BSD-3-Clause
// PD6: whatever comes, values are finite and in range, a byte at a time is the same as all at once,
// and the ensemble after the next end of line is taken.
#include <cmath>
#include <numbers>
#include <string_view>

#include "icat/adapters/pd6.hpp"

namespace {

void require(bool condition) {
  if (!condition) __builtin_trap();
}
bool within(double value, double least, double most) { return value >= least && value <= most; }

void check(const icat::Pd6Decoder& dvl) {
  const icat::DvlSample& s = dvl.sample().value;
  for (const icat::DvlVelocity& v : {s.bottom, s.water}) {
    double square = 0;
    for (const double x : v.velocity) square += x * x;
    require(square <= 100.0001 && within(v.error, -32.768, 32.767));
    int count = 0;
    for (const bool b : v.beams) count += b ? 1 : 0;
    require(v.valid ? count >= 3 : count == 0 && square == 0 && !v.has_error);
    require(!v.has_error || count == 4);
  }
  for (const double r : s.range) require(within(r, 0, 1e5));
  require(within(s.altitude, 0, 1e4) && within(s.depth, 0, 12000));
  require(within(s.heading, 0, 2 * std::numbers::pi));
  require(within(s.pitch, -1.5708, 1.5708) && within(s.roll, -3.1416, 3.1416));
  require(within(s.instrument_time, -1, 3.2e9));
  require(within(s.temperature, -99, 99) && within(s.speed_of_sound, 0, 2000));
  require(dvl.sample().count > 0 ? dvl.sample().time == 5 : dvl.bottom_age(5) > 1e300);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  icat::Pd6Decoder dvl, again;
  dvl.put({data, size}, 5);
  for (std::size_t i = 0; i < size; ++i) again.put(data[i], 5);
  check(dvl);
  require(dvl.ensembles() == again.ensembles() && dvl.damaged() == again.damaged());

  constexpr std::string_view whole =
      "\r\n:SA, -2.31, +1.92, 75.20\r\n:TS,04081111563644,35.0,+21.0, 0.0,1524.0, 0\r\n"
      ":BI, +24, -6, -20, -4,A\r\n:BS, -13, +21, -20,A\r\n:BE, +17, +18, -20,A\r\n"
      ":BD, -0.02, -0.03, +0.02, 7.13, 0.21\r\n";
  const auto before = dvl.ensembles();
  dvl.put({reinterpret_cast<const std::uint8_t*>(whole.data()), whole.size()}, 1e6);
  require(dvl.ensembles() == before + 1);
  require(dvl.sample().value.bottom.valid);
  return 0;
}
