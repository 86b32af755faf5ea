// SPDX-License-Identifier: BSD-3-Clause
// Ensembles of PD0 and PD6 as the manual describes them, for tests. Written apart from the
// decoders: bytes are put one after the other, by the numbers of the manual's tables.
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

namespace frames {

using Bytes = std::vector<std::uint8_t>;

constexpr int bad = -32768;

/// Raw values, in the units of the format.
struct Pd0 {
  std::uint32_t number = 1;
  int firmware = 51, revision = 40;
  int frame = 0;  // 0 beams, 1 instrument, 2 ship, 3 earth
  bool tilts = false, gimbal = false, up = false, convex = true;
  int angle_code = 2;  // 0: 15, 1: 20, 2: 30 degrees, 3: other
  int angle_byte = 30;
  std::array<int, 7> clock{26, 11, 30, 12, 34, 56, 78};
  int heading = 7520, pitch = -231, roll = 192, salinity = 35, temperature = 2100;
  int speed_of_sound = 1524, depth = 123;
  std::array<std::uint32_t, 4> range{713, 714, 715, 716};
  std::array<int, 4> bottom{24, -6, -20, -4}, water{bad, bad, bad, bad};
  bool with_profile = true, with_track = true;
  std::uint8_t fill = 0;  // what stands where nothing else does

  Bytes bytes() const {
    Bytes fixed(59, fill), variable(65, fill), track(85, fill), profile(2 + 8 * 2, fill);
    const auto u16 = [](Bytes& b, std::size_t byte_of_the_manual, int value) {
      b[byte_of_the_manual - 1] = static_cast<std::uint8_t>(value & 0xff);
      b[byte_of_the_manual] = static_cast<std::uint8_t>(value >> 8 & 0xff);
    };
    u16(fixed, 1, 0x0000);
    fixed[3 - 1] = static_cast<std::uint8_t>(firmware);
    fixed[4 - 1] = static_cast<std::uint8_t>(revision);
    fixed[5 - 1] = static_cast<std::uint8_t>(3 | (convex ? 8 : 0) | 0x40 | (up ? 0x80 : 0));
    fixed[6 - 1] = static_cast<std::uint8_t>(0x40 | angle_code);
    fixed[7 - 1] = 0;
    fixed[9 - 1] = 4;   // beams
    fixed[10 - 1] = 2;  // cells
    u16(fixed, 11, 1);
    u16(fixed, 13, 100);
    u16(fixed, 15, 50);
    fixed[22 - 1] = 0, fixed[23 - 1] = 1, fixed[24 - 1] = 0, fixed[25 - 1] = 0;
    fixed[26 - 1] = static_cast<std::uint8_t>(frame << 3 | (tilts ? 4 : 0) | 3);
    u16(fixed, 27, 0);
    u16(fixed, 29, 0);
    fixed[31 - 1] = static_cast<std::uint8_t>(gimbal ? 0x7d : 0x6d);
    u16(fixed, 33, 150);
    fixed[59 - 1] = static_cast<std::uint8_t>(angle_byte);

    u16(variable, 1, 0x0080);
    u16(variable, 3, static_cast<int>(number & 0xffff));
    for (std::size_t i = 0; i < 7; ++i) variable[5 - 1 + i] = static_cast<std::uint8_t>(clock[i]);
    variable[12 - 1] = static_cast<std::uint8_t>(number >> 16);
    u16(variable, 13, 0);
    u16(variable, 15, speed_of_sound);
    u16(variable, 17, depth);
    u16(variable, 19, heading);
    u16(variable, 21, pitch);
    u16(variable, 23, roll);
    u16(variable, 25, salinity);
    u16(variable, 27, temperature);
    variable[58 - 1] = 20;  // the clock once more, with its century
    for (std::size_t i = 0; i < 7; ++i) variable[59 - 1 + i] = static_cast<std::uint8_t>(clock[i]);

    u16(profile, 1, 0x0100);
    for (int i = 0; i < 8; ++i) u16(profile, static_cast<std::size_t>(3 + 2 * i), 100 * i);

    u16(track, 1, 0x0600);
    for (std::size_t k = 0; k < 4; ++k) {
      u16(track, 17 + 2 * k, static_cast<int>(range[k] & 0xffff));
      u16(track, 25 + 2 * k, bottom[k]);
      u16(track, 51 + 2 * k, water[k]);
      track[78 - 1 + k] = static_cast<std::uint8_t>(range[k] >> 16);
    }

    std::vector<Bytes> types{fixed, variable};
    if (with_profile) types.push_back(profile);
    if (with_track) types.push_back(track);
    Bytes out{0x7f, 0x7f, 0, 0, 0, static_cast<std::uint8_t>(types.size())};
    std::size_t offset = 6 + 2 * types.size();
    for (const Bytes& type : types) {
      out.push_back(static_cast<std::uint8_t>(offset & 0xff));
      out.push_back(static_cast<std::uint8_t>(offset >> 8));
      offset += type.size();
    }
    for (const Bytes& type : types) out.insert(out.end(), type.begin(), type.end());
    u16(out, 3, static_cast<int>(out.size()));
    unsigned sum = 0;
    for (const std::uint8_t b : out) sum += b;
    out.push_back(static_cast<std::uint8_t>(sum & 0xff));
    out.push_back(static_cast<std::uint8_t>(sum >> 8 & 0xff));
    return out;
  }
};

/// In mm/s and so on; the frames of a velocity must be given to agree.
struct Pd6 {
  std::string time = "26113012345678";
  double pitch = -2.31, roll = 1.92, heading = 75.2, altitude = 7.13;
  std::array<int, 4> instrument{24, -6, -20, -4};
  std::array<int, 3> ship{-13, 21, -20}, earth{17, 18, -20};
  char status = 'A';
  bool with_ranges = true;
  std::array<double, 4> range{71.31, 71.32, 71.32, 71.31};  // dm

  std::string text() const {
    char line[128];
    std::string out;
    const auto add = [&] { out += std::string(line) + "\r\n"; };
    std::snprintf(line, sizeof line, ":SA,%+6.2f,%+6.2f,%6.2f", pitch, roll, heading);
    add();
    std::snprintf(line, sizeof line, ":TS,%s,35.0,+21.0,%6.1f,1524.0,%3d", time.c_str(), 0.0, 0);
    add();
    if (with_ranges) {
      std::snprintf(line, sizeof line, ":RA,%7.2f,%7.2f,%7.2f,%7.2f,%7.2f", 0.0, range[0], range[1],
                    range[2], range[3]);
      add();
    }
    out += ":WI,-32768,-32768,-32768,-32768,V\r\n:WS,-32768,-32768,-32768,V\r\n";
    out +=
        ":WE,-32768,-32768,-32768,V\r\n:WD,       +0.00,       +0.00,       +0.00,  20.00,  "
        "0.00\r\n";
    const auto& i = instrument;
    std::snprintf(line, sizeof line, ":BI,%+6d,%+6d,%+6d,%+6d,%c", i[0], i[1], i[2], i[3], status);
    add();
    std::snprintf(line, sizeof line, ":BS,%+6d,%+6d,%+6d,%c", ship[0], ship[1], ship[2], status);
    add();
    std::snprintf(line, sizeof line, ":BE,%+6d,%+6d,%+6d,%c", earth[0], earth[1], earth[2], status);
    add();
    std::snprintf(line, sizeof line, ":BD,%+12.2f,%+12.2f,%+12.2f,%7.2f,%6.2f", -0.02, -0.03, 0.02,
                  altitude, 0.21);
    add();
    return out;
  }
};

}  // namespace frames
