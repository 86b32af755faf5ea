// SPDX-License-Identifier: BSD-3-Clause
// An arm of two drives: any frames, any times, any calls, from a start at which it works.
#include <cmath>
#include <cstring>

#include "../hardware/canopen/model_drives.hpp"

namespace {

using namespace icat::canopen;
using icat::CanFrame;

void require(bool holds) {
  if (!holds) __builtin_trap();
}

struct Input {
  const std::uint8_t* data;
  std::size_t size;
  std::uint8_t next() { return size > 0 ? (--size, *data++) : std::uint8_t{0}; }
  double number() {
    std::uint8_t bytes[8];
    for (auto& byte : bytes) byte = next();
    double value = 0;
    std::memcpy(&value, bytes, 8);
    return value;
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 4) return 0;
  Input in{data, size};
  const std::uint8_t kind = in.next();
  DriveOptions one{.name = "one", .node = 1, .counts_per_radian = 1e4, .velocity_feedback = true};
  DriveOptions two{.name = "two", .node = 2, .counts_per_radian = -2e4, .zero = 1};
  if (kind & 1) two.mode = DriveMode::profile_position;
  model::Line line({one, two});
  if (kind & 6) require(line.enable());
  DriveBus& bus = line.bus;
  double now = line.now, latest = now;
  int request = bus.enabled() ? 2 : 0;  // 0 off, 1 quick stop, 2 enabled

  const auto send = [&](bool takes) {
    int frames = 0;
    bus.send(now, [&](const CanFrame& f) {
      require(++frames <= 3 * 2 + 2);
      require(f.size <= 8 && !f.extended && !f.remote);
      const bool known = f.id == 0 || f.id == 0x80 || f.id == 0x77f || f.id == 0x201 ||
                         f.id == 0x202 || f.id == 0x601 || f.id == 0x602;
      require(known);
      if (f.id == 0x201 || f.id == 0x202) {
        const unsigned control = f.data[0] | static_cast<unsigned>(f.data[1]) << 8;
        if (bus.cause() != StopCause::none && bus.cause() != StopCause::requested) request = 1;
        if (request == 0) require(control == 0);
        if (request == 1) require(control == 2);
        std::uint32_t bits = 0;
        for (unsigned i = 0; i < 4; ++i) bits |= static_cast<std::uint32_t>(f.data[2 + i]) << 8 * i;
        const auto target = static_cast<std::int32_t>(bits);
        if (f.id == 0x201) {
          require(std::abs(static_cast<double>(target)) <= 10 * 1e4);
          require(bus.enabled() || target == 0);
        }
      }
      return takes;
    });
  };
  for (int step = 0; step < 500 && in.size > 0; ++step) {
    const std::uint8_t what = in.next();
    switch (what % 12) {
      case 0:
      case 1:
      case 2:
      case 3: {
        constexpr std::uint32_t ids[] = {0x181, 0x182, 0x281, 0x701, 0x702, 0x581, 0x582, 0x81};
        CanFrame f{what & 0x80 ? in.next() * 8u : ids[what >> 4 & 7], 8, {}};
        f.size = what % 12 == 3 ? in.next() % 16 : f.id >= 0x700 ? 1 : 8;
        for (auto& byte : f.data) byte = in.next();
        if (what % 12 == 3) f.extended = in.next() & 1;
        bus.receive(f, what % 12 == 2 ? now - 0.1 : now);
        break;
      }
      case 4:
        now += in.next() * 0.001;
        break;
      case 5:
        send(what < 128);
        break;
      case 6: {
        const double time = what < 64 ? in.number() : now + in.number();
        if (!std::isfinite(time)) {
          const double before = now;
          now = time;
          send(true);
          bus.receive({0x181, 8, {0x37, 2}}, time);
          now = before;
        } else if (std::abs(time) < 1e6) {
          now = time;
        }
        break;
      }
      case 7:
        static_cast<void>(bus.command_velocity(what & 16 ? 0 : in.next() % 3u, in.number(), now));
        break;
      case 8:
        static_cast<void>(bus.command_position(what & 16 ? 1 : in.next() % 3u, in.number(), now));
        break;
      case 9:
        if (what & 16) {
          bus.stop();
          request = 1;
        } else if (what & 32) {
          bus.disable();
          request = 0;
        } else if (bus.enable(now) == icat::Status::ok) {
          request = 2;
        }
        break;
      case 10:
        if (what & 16) bus.configure(what >> 5 & 1);
        if (!(what & 16)) bus.sdo(what >> 5 & 1).upload(0x1008, 0, now);
        break;
      case 11:  // the drives go on as they should
        line.now = now;
        line.drives[0].next_heartbeat = std::min(line.drives[0].next_heartbeat, now + 0.1);
        line.drives[1].next_heartbeat = std::min(line.drives[1].next_heartbeat, now + 0.1);
        for (int k = 0; k < (what >> 4); ++k) line.cycle();
        now = line.now;
        if (bus.cause() != StopCause::none && bus.cause() != StopCause::requested) request = 1;
        break;
      default:
        break;
    }
    latest = std::max(latest, now);
    for (std::size_t i = 0; i < 2; ++i) {
      const auto& sample = bus.drive(i).sample();
      require(std::isfinite(sample.value.position) && std::isfinite(sample.value.current));
      require(std::abs(sample.value.position) <= 2147483648.0 / 1e4 + 1);
      require(std::isfinite(bus.drive(i).velocity().value));
      require(!(sample.time > latest));
    }
    require(!bus.healthy(now) || bus.enabled());
    require(!bus.enabled() || bus.cause() == StopCause::none);
    require(!bus.healthy(latest + 1));
  }
  // It comes back, whatever was.
  line.now = latest + 10;
  for (auto& d : line.drives) {
    d.next_heartbeat = 0;
    d.state = DriveState::switch_on_disabled;
  }
  if (bus.drive(0).node().phase() == NodePhase::refused) bus.configure(0);
  if (bus.drive(1).node().phase() == NodePhase::refused) bus.configure(1);
  line.until([&] { return false; }, 0.5);
  bus.stop();
  require(line.enable());
  return 0;
}
