// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A drive on CANopen [CiA 402-2, IEC 61800-7-201]: its state machine, and profile velocity (mode
/// 3) and profile position (mode 1) over process data:
///
///     from us   {0x6040 controlword, 0x60FF target velocity}, or {0x6040, 0x607A target position}
///     from it   {0x6041 statusword, 0x6064 position, 0x6078 current} with every SYNC, and where it
///               is asked for, {0x606C velocity}
///
/// Both are in the units of the drive, 32 bits with sign; how many of them make a radian is an
/// option of each drive. drive_bus.hpp makes an arm of drives.
#pragma once

#include <string>

#include "icat/adapters/canopen.hpp"
#include "icat/core/status.hpp"

namespace icat::canopen {

/// Where a drive is [CiA 402-2, 6.2].
enum class DriveState {
  unknown,  ///< a statusword that is none of the others
  not_ready_to_switch_on,
  switch_on_disabled,
  ready_to_switch_on,
  switched_on,
  operation_enabled,  ///< the only one in which it moves as it is told
  quick_stop_active,
  fault_reaction_active,
  fault,
};

/// The state in a statusword (0x6041).
constexpr DriveState drive_state(std::uint16_t statusword) noexcept {
  switch (statusword & 0x4f) {
    case 0x00:
      return DriveState::not_ready_to_switch_on;
    case 0x40:
      return DriveState::switch_on_disabled;
    case 0x0f:
      return DriveState::fault_reaction_active;
    case 0x08:
      return DriveState::fault;
    default:
      break;
  }
  switch (statusword & 0x6f) {
    case 0x21:
      return DriveState::ready_to_switch_on;
    case 0x23:
      return DriveState::switched_on;
    case 0x27:
      return DriveState::operation_enabled;
    case 0x07:
      return DriveState::quick_stop_active;
    default:
      return DriveState::unknown;
  }
}

/// The controlword (0x6040) that takes a drive in `state` one step closer to operation; 0 where it
/// goes on by itself. A fault needs an edge of bit 7, which `Drive` makes. Out of a quick stop the
/// drive goes by itself, or on enable (transition 16, where its 0x605A is 5 to 8).
constexpr std::uint16_t controlword_to_enable(DriveState state) noexcept {
  switch (state) {
    case DriveState::switch_on_disabled:
      return 0x06;  // shutdown
    case DriveState::ready_to_switch_on:
      return 0x07;  // switch on
    case DriveState::switched_on:
    case DriveState::operation_enabled:
    case DriveState::quick_stop_active:
      return 0x0f;  // enable operation
    default:
      return 0x00;
  }
}

/// What a drive follows; the value is that of object 0x6060.
enum class DriveMode : std::uint8_t { profile_position = 1, profile_velocity = 3 };

/// The requested state of a drive.
enum class DriveRequest {
  off,         ///< without torque
  quick_stop,  ///< to stand as fast as its option allows
  enabled,     ///< in operation
};

/// A number in a drive's units, rounded, and kept inside 32 bits with sign. NaN counts as 0.
inline std::int32_t to_int32(double value) noexcept {
  if (!(value == value)) return 0;
  constexpr double most = 2147483647;
  return static_cast<std::int32_t>(std::nearbyint(value < -most  ? -most
                                                  : value > most ? most
                                                                 : value));
}

/// Settings of a drive and of the joint that it moves.
struct DriveOptions {
  std::string name;                             ///< of the joint, for messages
  int node{0};                                  ///< 1 to 127
  DriveMode mode{DriveMode::profile_velocity};  ///< what it follows
  double counts_per_radian{0};   ///< units of 0x6064 for a radian of the joint, gear counted in.
                                 ///< Negative where the drive turns against the joint
  double zero{0};                ///< rad: the joint at position 0 of the drive
  double velocity_units{0};      ///< units of 0x60FF for 1 rad/s; 0: as `counts_per_radian`
  double acceleration_units{0};  ///< units of 0x6083 for 1 rad/s², > 0; 0: as the size of
                                 ///< `velocity_units`
  double rated_current{1};       ///< A: 0x6078 counts thousandths of it
  double max_velocity{10};       ///< rad/s: what is commanded is cut to it
  double acceleration{0};        ///< rad/s²: 0x6083 and 0x6084; 0 leaves the drive's own
  double quick_stop_deceleration{0};  ///< rad/s²: 0x6085; 0 leaves the drive's own
  bool velocity_feedback{false};      ///< asks for 0x606C in a second frame
  bool quick_stop_when_alone{true};   ///< 0x6007 = 3: quick stop when the drive misses us. Where it
                                      ///< has no such object: false, and set by other means
};

/// What a drive measures with a SYNC.
struct DriveSample {
  double position{0};           ///< of the joint, rad
  double current{0};            ///< A
  std::uint16_t statusword{0};  ///< 0x6041
};

/// One drive. drive_bus.hpp calls it. Construction allocates, nothing else does.
class Drive {
 public:
  /// `master` is the node that we are, whose heartbeat the drive watches; `timeout`, s, how long
  /// the drive may hear no command, 0 where it is not to watch.
  /// @throws std::invalid_argument with the name of the drive, on options out of range.
  [[gnu::cold]] Drive(const DriveOptions& options, int master, double timeout,
                      const NodeOptions& node)
      : options_(checked(options)),
        sent_{{0x6040, 0, 16}, {target_object(), 0, 32}},
        sample_map_{{0x6041, 0, 16}, {0x6064, 0, 32}, {0x6078, 0, 16}},
        velocity_map_{{0x606C, 0, 32}},
        node_(options.node, 402, configuration(master, timeout, node), node) {}

  /// Takes a frame that came at `now`, s. Returns whether it was this drive's. Process data count
  /// only while the node is running: before, the drive may lay them out in another way.
  bool receive(const CanFrame& frame, double now) noexcept {
    if (!std::isfinite(now)) return false;
    if (node_.receive(frame, now)) {
      if (node_.phase() != NodePhase::running) sampled_ = false;
      return true;
    }
    if (frame.extended || frame.remote) return false;
    const auto node = static_cast<std::uint32_t>(options_.node);
    const bool running = node_.phase() == NodePhase::running;
    if (frame.id == 0x180 + node) {
      if (frame.size != sample_map_.bytes() || !running) return true;
      DriveSample sample;
      sample.statusword = static_cast<std::uint16_t>(sample_map_.get_unsigned(frame, 0));
      sample.position =
          static_cast<double>(sample_map_.get_signed(frame, 1)) / options_.counts_per_radian +
          options_.zero;
      sample.current =
          static_cast<double>(sample_map_.get_signed(frame, 2)) * options_.rated_current / 1000;
      sample_.put(sample, now);
      sampled_ = true;
      return true;
    }
    if (frame.id == 0x280 + node && options_.velocity_feedback) {
      if (frame.size != velocity_map_.bytes() || !running) return true;
      velocity_.put(
          static_cast<double>(velocity_map_.get_signed(frame, 0)) / options_.velocity_units, now);
      return true;
    }
    return false;
  }

  /// Looks at the clock, at `now`, s. Call it once in a cycle.
  void advance(double now) noexcept {
    node_.advance(now);
    if (node_.phase() != NodePhase::running) sampled_ = false;
  }

  /// A velocity of the joint, rad/s, given at `now`, s; cut to `max_velocity`. `non_finite`, and
  /// `out_of_range` in the other mode: refused, the last one stays.
  Status command_velocity(double velocity, double now) noexcept {
    if (options_.mode != DriveMode::profile_velocity) return Status::out_of_range;
    if (!std::isfinite(velocity) || !std::isfinite(now)) return Status::non_finite;
    const double most = options_.max_velocity;
    target_.put(velocity < -most ? -most : velocity > most ? most : velocity, now);
    return Status::ok;
  }
  /// A position of the joint, rad, to go to, given at `now`, s. It reaches the drive by the
  /// handshake of new set-points, which takes some cycles; of several meanwhile the last counts.
  /// `non_finite`, and `out_of_range` beyond the drive's 32 bits and in the other mode: refused.
  Status command_position(double position, double now) noexcept {
    if (options_.mode != DriveMode::profile_position) return Status::out_of_range;
    if (!std::isfinite(position) || !std::isfinite(now)) return Status::non_finite;
    const double units = (position - options_.zero) * options_.counts_per_radian;
    if (!(std::abs(units) <= 2147483647)) return Status::out_of_range;
    if (std::isfinite(target_.time) && target_.value == position) {
      target_.time = now;
      return Status::ok;
    }
    target_.put(position, now);
    new_setpoint_ = true;
    return Status::ok;
  }
  /// Forgets the command: velocity 0, no set-point.
  void clear_command() noexcept {
    target_.value = 0;
    target_.time = -std::numeric_limits<double>::infinity();
    new_setpoint_ = false;
    in_handshake_ = false;
  }
  /// From `now`, s, on a fault is reset up to three times, and a quick stop that the drive stays in
  /// for a second is left by taking the torque off.
  void begin_enabling(double now) noexcept {
    resets_ = 3;
    asked_ = now;
  }

  /// The frame of process data for `request`, at `now`, s. `moving`: whether the command counts; it
  /// does for as long as it is at most `hold` old, s.
  CanFrame command_frame(DriveRequest request, bool moving, double hold, double now) noexcept {
    CanFrame frame{0x200 + static_cast<std::uint32_t>(options_.node), sent_.bytes(), {}};
    std::uint16_t control = 0;
    if (request == DriveRequest::quick_stop) control = 0x02;
    if (request == DriveRequest::enabled) {
      control = controlword_to_enable(state());
      if (state() == DriveState::fault) control = reset_fault(now);
      if (state() == DriveState::quick_stop_active && now - asked_ > 1) control = 0;
    }
    std::int32_t value = 0;
    if (options_.mode == DriveMode::profile_velocity) {
      const bool counts = moving && target_.fresh(now, hold);
      value = counts ? to_int32(target_.value * options_.velocity_units) : 0;
    } else {
      if (moving) control = static_cast<std::uint16_t>(control | handshake());
      value = setpoint_;
    }
    sent_.put(frame, 0, control);
    sent_.put(frame, 1, value);
    return frame;
  }

  /// What it measured last. The age tells whether it still does.
  const Received<DriveSample>& sample() const noexcept { return sample_; }
  /// Its last velocity, rad/s; nothing ever comes without `velocity_feedback`.
  const Received<double>& velocity() const noexcept { return velocity_; }
  /// By its last statusword; `unknown` before the first one since the node runs.
  DriveState state() const noexcept {
    return sampled_ ? drive_state(sample_.value.statusword) : DriveState::unknown;
  }
  /// Whether it has reached its target (statusword, bit 10), by its last statusword. False while a
  /// set-point is on its way to it.
  bool target_reached() const noexcept {
    return !new_setpoint_ && !in_handshake_ && (sample_.value.statusword & 0x0400) != 0;
  }
  /// Whether a fault may still go away by a reset, at `now`, s.
  bool may_reset_fault(double now) const noexcept {
    return resets_ > 0 || now - edge_ <= reset_interval;
  }
  /// Heartbeat, emergencies, configuration, transfers.
  const Node& node() const noexcept { return node_; }
  /// The same.
  Node& node() noexcept { return node_; }
  /// As checked; no unit is 0 any more.
  const DriveOptions& options() const noexcept { return options_; }

  /// Nothing is of the future at `now`, s, also where the clock was set back.
  void limit_times(double now) noexcept {
    for (double* time : {&sample_.time, &velocity_.time, &target_.time, &edge_, &asked_}) {
      if (*time > now) *time = now;
    }
  }

 private:
  static constexpr double reset_interval = 0.2;  // s

  [[gnu::cold]] static DriveOptions checked(DriveOptions o) {
    const std::string owner = "drive '" + o.name + "'";
    if (o.velocity_units == 0) o.velocity_units = o.counts_per_radian;
    if (o.acceleration_units == 0) o.acceleration_units = std::abs(o.velocity_units);
    const auto check = [&](const char* name, double value, double least, double most) {
      if (value >= least && value <= most) return;
      detail::invalid(owner, ": ", name, " must be ", least, " to ", most, ", got ", value);
    };
    check("the size of counts_per_radian", std::abs(o.counts_per_radian), 1e-3, 1e9);
    check("the size of velocity_units", std::abs(o.velocity_units), 1e-3, 1e9);
    check("acceleration_units", o.acceleration_units, 1e-3, 1e9);
    check("zero", o.zero, -1e6, 1e6);
    check("rated_current", o.rated_current, 1e-3, 1e4);
    check("max_velocity", o.max_velocity, 1e-6, 1e4);
    check("acceleration", o.acceleration, 0, 1e6);
    check("quick_stop_deceleration", o.quick_stop_deceleration, 0, 1e6);
    if (o.mode != DriveMode::profile_position && o.mode != DriveMode::profile_velocity) {
      detail::invalid(owner, ": mode must be 1 or 3, got ", static_cast<int>(o.mode));
    }
    return o;
  }
  std::uint16_t target_object() const noexcept {
    return options_.mode == DriveMode::profile_velocity ? 0x60FF : 0x607A;
  }
  [[gnu::cold]] std::vector<SdoWrite> configuration(int master, double timeout,
                                                    const NodeOptions& node) const {
    const auto id = static_cast<std::uint32_t>(options_.node);
    std::vector<SdoWrite> writes;
    const auto silence = static_cast<std::uint32_t>(std::lround(3000 * node.heartbeat_period));
    writes.push_back({0x1016, 1, 4, static_cast<std::uint32_t>(master) << 16 | silence});
    // Immediately, not with the next SYNC: a quick stop waits for nothing.
    sent_.configure(writes, 0x1400, 0x200 + id, 255, timeout);
    sample_map_.configure(writes, 0x1800, 0x180 + id, 1);
    if (options_.velocity_feedback) velocity_map_.configure(writes, 0x1801, 0x280 + id, 1);
    writes.push_back({0x6060, 0, 1, static_cast<std::uint32_t>(options_.mode)});
    const auto units = [](double value) {
      return static_cast<std::uint32_t>(std::max(1, to_int32(value)));
    };
    if (options_.acceleration > 0) {
      const std::uint32_t value = units(options_.acceleration * options_.acceleration_units);
      writes.push_back({0x6083, 0, 4, value});
      writes.push_back({0x6084, 0, 4, value});
    }
    if (options_.quick_stop_deceleration > 0) {
      writes.push_back(
          {0x6085, 0, 4, units(options_.quick_stop_deceleration * options_.acceleration_units)});
    }
    if (options_.mode == DriveMode::profile_position) {
      const double most = options_.max_velocity * std::abs(options_.velocity_units);
      writes.push_back({0x6081, 0, 4, units(most)});
    }
    if (options_.quick_stop_when_alone) writes.push_back({0x6007, 0, 2, 3});
    return writes;
  }

  // Bit 7 is high for half of the interval, and was low before.
  std::uint16_t reset_fault(double now) noexcept {
    if (resets_ > 0 && !(now - edge_ <= reset_interval)) {
      --resets_;
      edge_ = now;
    }
    return now - edge_ <= reset_interval / 2 ? 0x80 : 0x00;
  }
  // Bits 4 and 5 of the controlword [CiA 402-2, 10.3]: a set-point is new on the edge of bit 4, and
  // the drive says by bit 12 of the statusword that it has it.
  std::uint16_t handshake() noexcept {
    const bool acknowledged = (sample_.value.statusword & 0x1000) != 0;
    if (in_handshake_ && acknowledged) {
      in_handshake_ = false;
    } else if (!in_handshake_ && new_setpoint_ && !acknowledged) {
      in_handshake_ = true;
      new_setpoint_ = false;
      setpoint_ = to_int32((target_.value - options_.zero) * options_.counts_per_radian);
    }
    return in_handshake_ ? 0x30 : 0x20;
  }

  DriveOptions options_;
  PdoMapping sent_;
  PdoMapping sample_map_;
  PdoMapping velocity_map_;
  Node node_;
  Received<DriveSample> sample_;
  Received<double> velocity_;
  Received<double> target_;
  double edge_{-std::numeric_limits<double>::infinity()};
  double asked_{0};
  int resets_{0};
  bool sampled_{false};
  bool new_setpoint_{false};
  bool in_handshake_{false};
  std::int32_t setpoint_{0};
};

}  // namespace icat::canopen
