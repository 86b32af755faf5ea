// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What is asked of a vehicle by COMMAND_LONG, one thing at a time, until COMMAND_ACK answers
/// [mavlink.io, "Command Protocol"]. A change of mode and arming are done when the heartbeat shows
/// them too: a late answer to an earlier request is not taken for this one's.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "icat/adapters/mavlink_frames.hpp"

namespace icat {

/// The state of a request to the vehicle.
enum class MavlinkRequest {
  none,       ///< nothing was asked
  pending,    ///< asked, or about to be
  done,       ///< the vehicle says yes, and its heartbeat shows it
  refused,    ///< the vehicle says no; its own text (STATUSTEXT) says why
  unanswered  ///< five tries brought no answer
};

namespace detail::mavlink {

// Whether what is done each `period` is to be done; also where the clock jumped back.
inline bool is_due(double last, double now, double period) noexcept {
  return !(now >= last && now - last < period);
}

/// See the file comment. No allocation.
class Requests {
 public:
  enum Kind : std::size_t { mode, arming, attitude_rate, position_rate, count };

  void ask(Kind kind, float first, float second) noexcept {
    Request& r = all_[kind];
    r = {r.command, first, second, MavlinkRequest::pending, 0, false};
    if (active_ == kind) active_ = count;
    if (kind == arming && first == 0) active_ = arming, asked_ = never_;  // no waiting to disarm
  }
  MavlinkRequest state(Kind kind) const noexcept { return all_[kind].state; }

  /// Whether `command` is to be sent at `now`, s.
  bool due(double now, Command& command) noexcept {
    if (active_ == count) {
      active_ = 0;
      while (active_ < count && all_[active_].state != MavlinkRequest::pending) ++active_;
      if (active_ == count) return false;
      asked_ = never_;
    }
    Request& r = all_[active_];
    // The heartbeat that must show it comes each second.
    if (!is_due(asked_, now, r.agreed ? 2.5 : 0.5)) return false;
    if (r.tries == 5) return settle(MavlinkRequest::unanswered), false;
    command = {r.command, r.first, r.second, r.tries};
    ++r.tries;
    asked_ = now;
    return true;
  }

  /// A COMMAND_ACK for us, which came at `now`.
  void answered(std::uint16_t id, std::uint8_t result, double now) noexcept {
    if (active_ == count || all_[active_].command != id || all_[active_].tries == 0) return;
    Request& r = all_[active_];
    if (result == MAV_RESULT_ACCEPTED) {
      if (active_ > arming) return settle(MavlinkRequest::done);
      if (!r.agreed) asked_ = now;
      r.agreed = true;
    } else if (result == MAV_RESULT_IN_PROGRESS) {
      asked_ = now;
    } else if (result != MAV_RESULT_TEMPORARILY_REJECTED) {
      settle(MavlinkRequest::refused);
    }
  }
  /// A heartbeat of the vehicle.
  void heard(std::uint32_t its_mode, bool armed) noexcept {
    if (active_ > arming || !all_[active_].agreed) return;
    const Request& r = all_[active_];
    const bool shown =
        active_ == mode ? static_cast<float>(its_mode) == r.second : armed == (r.first != 0);
    if (shown) settle(MavlinkRequest::done);
  }

 private:
  struct Request {
    std::uint16_t command;
    float first, second;
    MavlinkRequest state;
    std::uint8_t tries;
    bool agreed;
  };
  static constexpr double never_ = -std::numeric_limits<double>::infinity();

  void settle(MavlinkRequest state) noexcept {
    all_[active_].state = state;
    // In a mode that nobody asked for the thrusters stay off.
    Request& arm = all_[arming];
    const bool waits = arm.state == MavlinkRequest::pending && arm.first != 0;
    if (active_ == mode && state != MavlinkRequest::done && waits) arm.state = state;
    active_ = count;
  }

  std::array<Request, count> all_{
      {{MAV_CMD_DO_SET_MODE, 0, 0, MavlinkRequest::none, 0, false},
       {MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, MavlinkRequest::none, 0, false},
       {MAV_CMD_SET_MESSAGE_INTERVAL, 0, 0, MavlinkRequest::none, 0, false},
       {MAV_CMD_SET_MESSAGE_INTERVAL, 0, 0, MavlinkRequest::none, 0, false}}};
  std::size_t active_{count};  // the one that waits for its answer
  double asked_{never_};
};

}  // namespace detail::mavlink
}  // namespace icat
