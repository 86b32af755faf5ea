// SPDX-License-Identifier: BSD-3-Clause
// The vehicle against bytes that pymavlink packed, damaged, dropped, doubled and put out of order.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "icat/adapters/mavlink.hpp"

namespace {

using Bytes = std::vector<std::uint8_t>;

struct Frame {
  Bytes bytes;
  std::string kind;
  std::vector<double> values;
};

std::vector<Frame> record(int count, int seed) {
  const std::string command = "\"" ICAT_PYTHON "\" \"" ICAT_PEERS "/record.py\" " +
                              std::to_string(count) + " " + std::to_string(seed);
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
  std::vector<Frame> frames;
  char line[2048];
  while (pipe && std::fgets(line, sizeof line, pipe.get())) {
    std::istringstream words(line);
    std::string hex;
    Frame f;
    words >> hex >> f.kind;
    for (double v; words >> v;) f.values.push_back(v);
    for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
      f.bytes.push_back(static_cast<std::uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
    }
    frames.push_back(f);
  }
  return frames;
}

// What the vehicle must know after the frames that came whole, by their place in the recording.
struct Expected {
  const Frame* heartbeat = nullptr;
  const Frame* attitude = nullptr;
  const Frame* position = nullptr;
  std::size_t newest = 0;  // place + 1
  std::uint32_t whole = 0;

  void take(const std::vector<Frame>& all, std::size_t place) {
    const Frame& f = all[place];
    ++whole;
    if (f.kind == "HEARTBEAT" && place + 1 > newest) heartbeat = &f;
    if (f.kind == "ATTITUDE" && (!attitude || f.values[0] > attitude->values[0])) attitude = &f;
    if (f.kind == "POSITION" && (!position || f.values[0] > position->values[0])) position = &f;
    newest = std::max(newest, place + 1);
  }
  void check(const icat::MavlinkVehicle& vehicle) const {
    EXPECT_EQ(vehicle.counts().frames, whole);
    EXPECT_EQ(vehicle.counts().reboots, 0u);
    if (heartbeat) {
      EXPECT_EQ(static_cast<double>(vehicle.heartbeat().value.mode), heartbeat->values[0]);
      EXPECT_EQ(vehicle.heartbeat().value.armed, heartbeat->values[1] == 1);
    }
    ASSERT_EQ(vehicle.heartbeat().count > 0, heartbeat != nullptr);
    ASSERT_EQ(vehicle.attitude().count > 0, attitude != nullptr);
    ASSERT_EQ(vehicle.position().count > 0, position != nullptr);
    if (attitude) {
      const auto& v = attitude->values;
      const Eigen::Quaterniond q = Eigen::AngleAxisd(v[3], Eigen::Vector3d::UnitZ()) *
                                   Eigen::AngleAxisd(v[2], Eigen::Vector3d::UnitY()) *
                                   Eigen::AngleAxisd(v[1], Eigen::Vector3d::UnitX());
      const auto& a = vehicle.attitude().value;
      const Eigen::Quaterniond got(a.orientation[3], a.orientation[0], a.orientation[1],
                                   a.orientation[2]);
      EXPECT_LT(got.angularDistance(q), 1e-7);  // acos of what rounds at 1e-16
      for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(a.rates[i], v[4 + i]);
    }
    if (position) {
      const auto& p = vehicle.position().value;
      for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(p.position[i], position->values[1 + i]);
        EXPECT_EQ(p.velocity[i], position->values[4 + i]);
      }
    }
  }
};

TEST(MavlinkFrames, DamagedStreamsKeepWhatIsWhole) {
  const std::vector<Frame> frames = record(400, 7);
  ASSERT_EQ(frames.size(), 400u);
  std::mt19937 draw(3);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(draw() % n); };
  std::uint32_t damaged = 0, lost = 0, repeated = 0, late = 0;
  for (int trial = 0; trial < 100; ++trial) {
    SCOPED_TRACE(trial);
    // Neighbours change places; then each frame is whole, lost, doubled or damaged.
    std::vector<std::size_t> order(frames.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    for (std::size_t i = 0; i + 4 < order.size(); ++i) {
      if (below(10) == 0) std::swap(order[i], order[i + 1 + below(3)]);
    }
    icat::MavlinkVehicle vehicle;
    Expected expected;
    Bytes pending;
    double now = 0;
    for (const std::size_t place : order) {
      Bytes b = frames[place].bytes;
      // A signature is not looked at: the frame is whole without it.
      const std::size_t end = b.size() - (b[0] == 0xFD && b[2] == 1 ? 13 : 0);
      switch (below(12)) {
        case 0:  // one byte, or two that are neighbours: a CRC of 16 bits sees each of these
          b[below(end)] ^= static_cast<std::uint8_t>(1 + below(255));
          break;
        case 1: {
          const std::size_t at = 10 + below(end - 11);
          b[at] ^= static_cast<std::uint8_t>(1 + below(255));
          b[at + 1] ^= static_cast<std::uint8_t>(below(255));
          break;
        }
        case 2:
          b.resize(below(end));
          break;
        case 3:
          b.clear();
          break;
        case 4:
          expected.take(frames, place);
          expected.take(frames, place);
          b.insert(b.end(), frames[place].bytes.begin(), frames[place].bytes.end());
          break;
        case 5:  // noise in between, with begins of frames in it
          expected.take(frames, place);
          for (std::size_t k = below(40); k > 0; --k) {
            b.push_back(below(4) == 0 ? 0xFD : static_cast<std::uint8_t>(below(256)));
          }
          break;
        default:
          expected.take(frames, place);
      }
      pending.insert(pending.end(), b.begin(), b.end());
      // In pieces that end anywhere.
      while (!pending.empty() && below(3) != 0) {
        const std::size_t n = 1 + below(pending.size());
        vehicle.receive({pending.data(), n}, now);
        pending.erase(pending.begin(), pending.begin() + static_cast<std::ptrdiff_t>(n));
      }
      now += 1e-3;
    }
    pending.resize(pending.size() + 300);  // a false begin waits for no more than 280 bytes
    vehicle.receive(pending, now);
    expected.check(vehicle);
    damaged += vehicle.counts().damaged;
    lost += vehicle.counts().lost;
    repeated += vehicle.counts().repeated;
    late += vehicle.counts().late;
  }
  EXPECT_GT(damaged, 0u);
  EXPECT_GT(lost, 0u);
  EXPECT_GT(repeated, 0u);
  EXPECT_GT(late, 0u);
}

}  // namespace
