// SPDX-License-Identifier: BSD-3-Clause
// Drives in virtual time, for what cannot be provoked in a peer: every start, every lost frame.
#pragma once

#include <map>
#include <vector>

#include "icat/adapters/drive_bus.hpp"

namespace model {

using icat::CanFrame;
using icat::canopen::DriveState;
using icat::canopen::NmtState;

constexpr std::uint16_t statusword(DriveState state) {
  switch (state) {
    case DriveState::switch_on_disabled:
      return 0x40;
    case DriveState::ready_to_switch_on:
      return 0x21;
    case DriveState::switched_on:
      return 0x33;
    case DriveState::operation_enabled:
      return 0x37;
    case DriveState::quick_stop_active:
      return 0x17;
    case DriveState::fault_reaction_active:
      return 0x0f;
    case DriveState::fault:
      return 0x08;
    default:
      return 0x00;
  }
}

struct Drive {
  int node{1};
  DriveState state{DriveState::not_ready_to_switch_on};
  NmtState nmt{NmtState::pre_operational};
  std::map<std::uint32_t, std::uint32_t> objects;  // index << 8 | subindex
  std::uint32_t device{0x20192};
  bool answers{true}, beats{true}, measures{true}, heals{true}, stays_in_quick_stop{false};
  bool reenables{true};  // transition 16
  bool acknowledged{false};
  double heartbeat_period{0.1}, next_heartbeat{0};
  std::uint16_t control{0}, extra_status{0};
  std::int32_t target{0}, position{0};
  int setpoints{0}, acknowledges{0}, acknowledges_for{0};  // cycles

  void boot(std::vector<CanFrame>& out) {
    nmt = NmtState::pre_operational;
    state = DriveState::not_ready_to_switch_on;
    out.push_back(icat::canopen::heartbeat_frame(node, NmtState::boot_up));
  }
  void controlword(std::uint16_t c) {
    const auto before = control;
    control = c;
    const auto low = c & 0xf;
    const bool voltage = low & 2, quick = !(low & 4);
    switch (state) {
      case DriveState::fault:
        if (heals && (c & 0x80) && !(before & 0x80)) state = DriveState::switch_on_disabled;
        return;
      case DriveState::switch_on_disabled:
        if ((low & 7) == 6) state = DriveState::ready_to_switch_on;
        return;
      case DriveState::ready_to_switch_on:
        if (!voltage || quick) state = DriveState::switch_on_disabled;
        if (low == 7 || low == 15) state = DriveState::switched_on;
        return;
      case DriveState::switched_on:
        if (!voltage || quick) state = DriveState::switch_on_disabled;
        if ((low & 7) == 6) state = DriveState::ready_to_switch_on;
        if (low == 15) state = DriveState::operation_enabled;
        return;
      case DriveState::operation_enabled:
        if (!voltage) {
          state = DriveState::switch_on_disabled;
        } else if (quick) {
          state = DriveState::quick_stop_active;
        } else if ((low & 7) == 6) {
          state = DriveState::ready_to_switch_on;
        } else if (low == 7) {
          state = DriveState::switched_on;
        }
        return;
      case DriveState::quick_stop_active:
        if (!voltage) state = DriveState::switch_on_disabled;
        if (low == 15 && stays_in_quick_stop && reenables) state = DriveState::operation_enabled;
        return;
      default:
        return;
    }
  }
  void take(const CanFrame& f, std::vector<CanFrame>& out) {
    const auto id = static_cast<std::uint32_t>(node);
    if (f.id == 0 && (f.data[1] == 0 || f.data[1] == node)) {
      if (f.data[0] == 1) nmt = NmtState::operational;
      if (f.data[0] == 128) nmt = NmtState::pre_operational;
    } else if (f.id == 0x600 + id && answers && f.data[0] != 0x80) {
      const std::uint32_t key = static_cast<std::uint32_t>(f.data[2]) << 16 |
                                static_cast<std::uint32_t>(f.data[1]) << 8 | f.data[3];
      CanFrame answer{0x580 + id, 8, {0x60, f.data[1], f.data[2], f.data[3]}};
      if (f.data[0] == 0x40) {
        answer.data[0] = 0x43;
        const std::uint32_t value = key == 0x100000 ? device : objects[key];
        for (unsigned i = 0; i < 4; ++i) {
          answer.data[4 + i] = static_cast<std::uint8_t>(value >> 8 * i);
        }
      } else {
        std::uint32_t value = 0;
        for (unsigned i = 0; i < 4; ++i) {
          value |= static_cast<std::uint32_t>(f.data[4 + i]) << 8 * i;
        }
        objects[key] = value;
      }
      out.push_back(answer);
    } else if (nmt == NmtState::operational && f.id == 0x200 + id) {
      const bool bit4 = control & 0x10;
      std::uint32_t value = 0;
      for (unsigned i = 0; i < 4; ++i) value |= static_cast<std::uint32_t>(f.data[2 + i]) << 8 * i;
      const auto c = static_cast<std::uint16_t>(f.data[0] | f.data[1] << 8);
      if (objects[0x606000] == 3) target = static_cast<std::int32_t>(value);
      if (objects[0x606000] == 1 && state == DriveState::operation_enabled) {
        if ((c & 0x10) && !bit4 && !acknowledged) {
          target = static_cast<std::int32_t>(value);
          ++setpoints;
        }
        if (c & 0x10) {
          acknowledged = true;
          acknowledges = acknowledges_for;
        } else if (--acknowledges <= 0) {
          acknowledged = false;
        }
      }
      controlword(c);
    } else if (nmt == NmtState::operational && f.id == 0x80) {
      // What goes on by itself.
      if (state == DriveState::not_ready_to_switch_on) state = DriveState::switch_on_disabled;
      if (state == DriveState::fault_reaction_active) state = DriveState::fault;
      if (!measures) return;
      const auto p = static_cast<std::uint32_t>(position);
      const unsigned s = statusword(state) | extra_status | (acknowledged ? 0x1000u : 0u);
      out.push_back(
          {0x180 + id,
           8,
           {static_cast<std::uint8_t>(s), static_cast<std::uint8_t>(s >> 8),
            static_cast<std::uint8_t>(p), static_cast<std::uint8_t>(p >> 8),
            static_cast<std::uint8_t>(p >> 16), static_cast<std::uint8_t>(p >> 24), 0, 0}});
      if (state == DriveState::quick_stop_active && !stays_in_quick_stop) {
        state = DriveState::switch_on_disabled;
      }
    }
  }
  void tick(double now, std::vector<CanFrame>& out) {
    if (now < next_heartbeat) return;
    next_heartbeat = now + heartbeat_period;
    if (beats) out.push_back(icat::canopen::heartbeat_frame(node, nmt));
  }
};

/// A bus and its drives, one cycle after the other at 100 Hz.
struct Line {
  icat::canopen::DriveBus bus;
  std::vector<Drive> drives;
  double now{100};
  std::vector<CanFrame> sent, back;
  std::size_t room{1000};  // frames that the transport takes in a cycle

  explicit Line(const std::vector<icat::canopen::DriveOptions>& options,
                const icat::canopen::DriveBusOptions& shared = {})
      : bus(options, shared) {
    for (const auto& o : options) {
      drives.emplace_back();
      drives.back().node = o.node;
    }
  }
  void cycle(double dt = 0.01) {
    now += dt;
    back.clear();
    for (Drive& d : drives) d.tick(now, back);
    for (const CanFrame& f : sent) {
      for (Drive& d : drives) d.take(f, back);
    }
    sent.clear();
    for (const CanFrame& f : back) bus.receive(f, now);
    bus.send(now, [&](const CanFrame& f) {
      if (sent.size() == room) return false;
      sent.push_back(f);
      return true;
    });
  }
  template <class Condition>
  bool until(Condition condition, double seconds) {
    for (const double end = now + seconds; now < end;) {
      cycle();
      if (condition()) return true;
    }
    return false;
  }
  bool ready() {
    return until([&] { return bus.ready(now); }, 5);
  }
  bool enable() {
    return ready() && bus.enable(now) == icat::Status::ok &&
           until([&] { return bus.enabled(); }, 5);
  }
};

}  // namespace model
