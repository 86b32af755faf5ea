// SPDX-License-Identifier: BSD-3-Clause
// NMEA 0183: whatever comes, values are finite and in range, a byte at a time is the same as all at
// once, and what was decoded is encoded and decoded to the same.
#include <cmath>
#include <cstring>
#include <numbers>

#include "icat/adapters/nmea.hpp"
#include "icat/adapters/nmea_sentence.hpp"

namespace {

void require(bool condition) {
  if (!condition) __builtin_trap();
}
bool within(double value, double least, double most) { return value >= least && value <= most; }
bool heading(double value) {
  return within(value, 0, 2 * std::numbers::pi) && value < 6.28318530718;
}

void check(const icat::NmeaDecoder& nmea) {
  constexpr double half = std::numbers::pi / 2 + 1e-12, whole = std::numbers::pi + 1e-12;
  const auto& p = nmea.position().value;
  require(within(p.latitude, -half, half) && within(p.longitude, -whole, whole));
  require(p.utc == -1 || within(p.utc, 0, 86401));
  require(within(p.altitude, -1e5, 1e5) && within(p.geoid, -200, 200) && within(p.hdop, 0, 1000));
  require(p.satellites >= 0 && p.satellites <= 99);
  require((nmea.position().count == 0) == (p.quality == icat::NmeaQuality::none));
  require(p.quality < icat::NmeaQuality::estimated);
  require(within(nmea.velocity().value.speed, 0, 1200) && heading(nmea.velocity().value.course));
  require(heading(nmea.true_heading().value) && heading(nmea.magnetic_heading().value));
  require(within(nmea.variation().value, -whole, whole));
  require(within(nmea.depth().value.depth, 0, 12001));
  require(within(nmea.depth().value.offset, -1000, 1000));
  require(within(nmea.utc().value, 0, 3e11));
  for (const auto& t : {nmea.depth().time, nmea.position().time, nmea.utc().time}) {
    require(t == 5 || t < -1e300);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  icat::NmeaDecoder strict, again, loose({.checksum_required = false});
  strict.put({data, size}, 5);
  for (std::size_t i = 0; i < size; ++i) {
    again.put(data[i], 5);
    loose.put(data[i], 5);
  }
  check(strict);
  check(loose);
  require(strict.sentences() == again.sentences() && strict.damaged() == again.damaged());

  // The input as a body: with a right checksum it is judged by its fields alone.
  const std::size_t length = size < 100 ? size : 100;
  const icat::NmeaSentence body({reinterpret_cast<const char*>(data), length});
  icat::NmeaDecoder fields;
  fields.put(body.bytes(), 5);
  check(fields);

  // Decoded, encoded, decoded.
  for (const icat::NmeaDecoder* nmea : {&strict, &loose, &fields}) {
    icat::NmeaPosition p = nmea->position().value;
    if (p.utc >= 86399.995) p.utc = 0;
    icat::NmeaDecoder back;
    if (nmea->position().count > 0) {
      require(back.put(icat::NmeaSentence::gga(p).bytes(), 5) == 1);
      require(std::abs(back.position().value.latitude - p.latitude) < 2e-11);
      require(std::abs(back.position().value.longitude - p.longitude) < 2e-11);
      require(std::abs(back.position().value.altitude - (p.has_altitude ? p.altitude : 0)) < 1e-3);
    }
    if (nmea->depth().count > 0) {
      icat::NmeaDepth d = nmea->depth().value;
      d.depth = std::fmin(d.depth, 12000);
      require(back.put(icat::NmeaSentence::dpt(d).bytes(), 5) == 1);
      require(std::abs(back.depth().value.depth - d.depth) < 1e-3);
    }
    if (nmea->true_heading().count > 0) {
      require(back.put(icat::NmeaSentence::hdt(nmea->true_heading().value).bytes(), 5) == 1);
      const double error = back.true_heading().value - nmea->true_heading().value;
      require(std::abs(std::remainder(error, 2 * std::numbers::pi)) < 1e-6);
    }
  }
  return 0;
}
