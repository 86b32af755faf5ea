// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Any number of drives on one CAN line, that move together or not at all: the joints of an arm and
/// its gripper. A cycle is
///
///     while a frame is there: bus.receive(frame, now)
///     bus.command_velocity(i, …) for each drive
///     bus.send(now, send)
///
/// and `send` hands out, once in a period, a command to each drive and then SYNC, so that what the
/// drives measure at this SYNC comes before the next cycle; and at any time our heartbeat,
/// configuration and starts. Where the transport takes too few frames in a call, the next call goes
/// on with the drive at which it ended.
///
/// **What stops the arm.** Each of these makes `send` command a quick stop to all drives, in the
/// same call, and until `enable` is called again: a drive's heartbeat is silent for more than three
/// periods; a drive restarts, or leaves the operational state; its measurements are older than
/// `feedback_timeout`; it has a fault, or leaves operation by itself; it does not reach operation
/// within `start_timeout`; time that is set back by more than a period. `cause` and `culprit` say
/// which. Where the caller goes on sending but commands nothing for `hold`, the velocity is 0; in
/// profile position a drive completes the move that it has begun.
///
/// **What stops the arm when our program ends.** Each drive watches our heartbeat (0x1016: three
/// periods) and our commands (0x1400, 5: `command_timeout`), and makes a quick stop of its own
/// (0x6007 = 3).
#pragma once

#include "icat/adapters/cia402.hpp"

namespace icat::canopen {

/// What all drives of a bus share.
struct DriveBusOptions {
  int master{127};               ///< the node that we are, 1 to 127, none of the drives
  double period{0.01};           ///< s: from SYNC to SYNC
  double heartbeat_period{0.1};  ///< s: of the drives and of us
  double feedback_timeout{0.1};  ///< s: measurements older than that stop the arm
  double hold{0.1};              ///< s: a velocity older than that counts as 0
  double command_timeout{0.1};   ///< s: drives that hear no command for that long stop by
                                 ///< themselves; 0 where they cannot watch it (no object 0x1400, 5)
  double start_timeout{3};       ///< s: from `enable` to the operation of all drives
  double sdo_timeout{0.5};       ///< s: an answer to one write of the configuration
  double retry{1};               ///< s: between two tries to configure a drive that does not answer
};

/// Why an arm does not move.
enum class StopCause {
  none,             ///< it does, or was never enabled
  requested,        ///< `stop` or `disable`
  heartbeat_lost,   ///< of a drive, for more than three periods
  restarted,        ///< a drive sent a boot-up
  not_operational,  ///< a drive left the operational state of the network
  feedback_lost,    ///< no measurements of a drive for more than `feedback_timeout`
  fault,            ///< of a drive, after operation, or one that three resets do not end
  left_operation,   ///< a drive left operation by itself
  start_timed_out,  ///< a drive did not come to operation
  clock_set_back,   ///< the caller's time went back by more than a period
};

/// One line for a log. No allocation.
constexpr const char* describe(StopCause cause) noexcept {
  switch (cause) {
    case StopCause::none:
      return "not stopped";
    case StopCause::requested:
      return "stopped by request";
    case StopCause::heartbeat_lost:
      return "no heartbeat for more than three periods";
    case StopCause::restarted:
      return "the drive restarted";
    case StopCause::not_operational:
      return "the drive left the operational state of the network";
    case StopCause::feedback_lost:
      return "no measurements";
    case StopCause::fault:
      return "the drive has a fault";
    case StopCause::left_operation:
      return "the drive left operation by itself";
    case StopCause::start_timed_out:
      return "the drive did not come to operation in time";
    case StopCause::clock_set_back:
      return "the clock was set back";
  }
  return "unknown";
}

/// See the file comment. Construction allocates and throws, nothing else does.
class DriveBus {
 public:
  /// @param drives in the order of the robot's joints.
  /// @param options of the bus.
  /// @throws std::invalid_argument on no drive, two drives of one node or one of ours, and on
  ///         options out of range, with the name of the drive.
  [[gnu::cold]] explicit DriveBus(const std::vector<DriveOptions>& drives,
                                  const DriveBusOptions& options = {})
      : options_(options) {
    if (drives.empty()) detail::invalid("drive bus: no drive");
    const auto check = [](const char* name, double value, double least, double most) {
      if (value >= least && value <= most) return;
      detail::invalid("drive bus: ", name, " must be ", least, " to ", most, ", got ", value);
    };
    check("master", options.master, 1, 127);
    check("period", options.period, 0.0005, 1);
    check("heartbeat_period", options.heartbeat_period, 0.001, 20);
    check("feedback_timeout", options.feedback_timeout, 2 * options.period, 10);
    check("hold", options.hold, options.period, 10);
    if (options.command_timeout != 0) {
      check("command_timeout", options.command_timeout, 2 * options.period, 10);
    }
    check("start_timeout", options.start_timeout, 0.1, 60);
    const NodeOptions node{options.heartbeat_period, options.sdo_timeout, options.retry};
    drives_.reserve(drives.size());
    for (const DriveOptions& drive : drives) {
      if (drive.node == options.master) {
        detail::invalid("drive '", drive.name, "': node ", drive.node, " is the master");
      }
      for (const Drive& other : drives_) {
        if (other.options().node == drive.node) {
          detail::invalid("drives '", other.options().name, "' and '", drive.name,
                          "' are both node ", drive.node);
        }
      }
      drives_.emplace_back(drive, options.master, options.command_timeout, node);
    }
  }

  /// Takes a frame that came at `now`, s. Returns whether it was one of a drive.
  bool receive(const CanFrame& frame, double now) noexcept {
    if (!std::isfinite(now)) return false;
    for (Drive& drive : drives_) {
      if (drive.receive(frame, now)) return true;
    }
    return false;
  }
  /// One cycle at `now`, s. Hands at most 3 n + 2 frames to `send`, `bool(const CanFrame&)`, which
  /// must not throw and returns false where the transport takes no more. Returns whether all were
  /// taken; what was not is sent first at the next call, commands as they are then. A time that is
  /// not finite does nothing.
  template <class Send>
  bool send(double now, Send&& send) noexcept {
    if (!std::isfinite(now)) return false;
    advance(now);
    // Before all else: where the transport takes too little, it would be the last one in each call.
    if (!(now < next_heartbeat_)) {
      if (!send(heartbeat_frame(options_.master, NmtState::operational))) return false;
      next_heartbeat_ = now + options_.heartbeat_period;
    }
    if (!in_cycle_ && !(now < next_ - options_.period / 4)) {
      in_cycle_ = true;
      unserved_ = drives_.size();
    }
    // On from the drive at which the transport took no more, so that none is left out for ever.
    for (; unserved_ > 0; --unserved_, first_ = (first_ + 1) % drives_.size()) {
      Drive& drive = drives_[first_];
      if (!drive.node().configured()) continue;
      if (!send(drive.command_frame(request_, enabled_, options_.hold, now))) return false;
    }
    if (in_cycle_) {
      if (!send(sync_frame())) return false;
      in_cycle_ = false;
      // On the grid of the first call, so that a caller's jitter does not add up.
      const bool on_grid = now - next_ < options_.period / 2;
      next_ = (on_grid ? next_ : now) + options_.period;
    }
    for (Drive& drive : drives_) {
      if (!drive.node().send(send)) return false;
    }
    return true;
  }

  /// Asks for operation: from whatever state, also from a fault, which is reset, and from a quick
  /// stop, which is left by taking the torque off where the drive stays in it for a second. Until
  /// the first call the torque is off. `not_started` where a drive is not `ready`: nothing happens.
  /// Commands count once all drives operate. Until a stop, further calls change nothing.
  Status enable(double now) noexcept {
    if (request_ == DriveRequest::enabled) return Status::ok;
    if (!ready(now)) return Status::not_started;
    request_ = DriveRequest::enabled;
    cause_ = StopCause::none;
    culprit_ = 0;
    since_ = now;
    enabled_ = false;
    for (Drive& drive : drives_) {
      drive.clear_command();
      drive.begin_enabling(now);
    }
    return Status::ok;
  }
  /// A quick stop of all drives.
  void stop() noexcept { halt(DriveRequest::quick_stop, StopCause::requested, 0); }
  /// Takes the torque off all drives, at once. An arm without brakes falls.
  void disable() noexcept { halt(DriveRequest::off, StopCause::requested, 0); }

  /// A velocity of the i-th joint, rad/s, given at `now`, s; cut to the drive's `max_velocity`.
  /// `unknown_joint`; `not_started` before all drives operate; otherwise as in `Drive`.
  Status command_velocity(std::size_t i, double velocity, double now) noexcept {
    if (i >= drives_.size()) return Status::unknown_joint;
    if (!enabled_) return Status::not_started;
    return drives_[i].command_velocity(velocity, now);
  }
  /// A position of the i-th joint, rad; the same answers.
  Status command_position(std::size_t i, double position, double now) noexcept {
    if (i >= drives_.size()) return Status::unknown_joint;
    if (!enabled_) return Status::not_started;
    return drives_[i].command_position(position, now);
  }

  /// Whether all drives are configured and heard of: `enable` would begin.
  bool ready(double now) const noexcept {
    if (!(now >= last_ - options_.period)) return false;  // a clock that was set back
    for (const Drive& drive : drives_) {
      if (drive.node().phase() != NodePhase::running || !current(drive, now)) return false;
    }
    return true;
  }
  /// Whether all drives operate: commands count. As of the last `send`.
  bool enabled() const noexcept { return enabled_; }
  /// Whether the arm can accept a command at `now`, s: all drives operate, and none is silent.
  bool healthy(double now) const noexcept {
    if (!enabled_ || !ready(now)) return false;
    for (const Drive& drive : drives_) {
      if (drive.state() != DriveState::operation_enabled) return false;
      if (!drive.node().heartbeat().fresh(now, 3 * options_.heartbeat_period)) return false;
    }
    return true;
  }
  /// Why the arm was stopped.
  StopCause cause() const noexcept { return cause_; }
  /// Which drive was the cause; 0 where none was.
  std::size_t culprit() const noexcept { return culprit_; }

  /// How many drives.
  std::size_t size() const noexcept { return drives_.size(); }
  /// The i-th drive.
  const Drive& drive(std::size_t i) const noexcept { return drives_[i]; }
  /// Transfers of the i-th drive, for the caller's own objects once it is running; `send` carries
  /// them.
  SdoClient& sdo(std::size_t i) noexcept { return drives_[i].node().sdo(); }
  /// Begins to configure the i-th drive anew, one that refused for example.
  void configure(std::size_t i) noexcept { drives_[i].node().configure(); }

 private:
  bool current(const Drive& drive, double now) const noexcept {
    return drive.state() != DriveState::unknown &&
           drive.sample().fresh(now, options_.feedback_timeout);
  }
  void halt(DriveRequest request, StopCause cause, std::size_t culprit) noexcept {
    request_ = request;
    cause_ = cause;
    culprit_ = culprit;
    enabled_ = false;
    unserved_ = drives_.size();
    for (Drive& drive : drives_) drive.clear_command();
  }
  void advance(double now) noexcept {
    if (now < last_) {
      if (last_ - now > options_.period && request_ == DriveRequest::enabled) {
        halt(DriveRequest::quick_stop, StopCause::clock_set_back, 0);
      }
      next_ = std::min(next_, now + options_.period);
      next_heartbeat_ = std::min(next_heartbeat_, now + options_.heartbeat_period);
      since_ = std::min(since_, now);
    }
    last_ = now;
    for (Drive& drive : drives_) {
      drive.limit_times(now);
      drive.advance(now);
    }
    if (request_ != DriveRequest::enabled) return;
    bool all = true;
    for (std::size_t i = 0; i < drives_.size(); ++i) {
      const StopCause cause = check(drives_[i], now);
      if (cause != StopCause::none) return halt(DriveRequest::quick_stop, cause, i);
      all = all && drives_[i].state() == DriveState::operation_enabled;
    }
    enabled_ = enabled_ || all;
  }
  StopCause check(const Drive& drive, double now) const noexcept {
    if (drive.node().phase() != NodePhase::running) {
      switch (drive.node().loss()) {
        case NodeLoss::restarted:
          return StopCause::restarted;
        case NodeLoss::left:
          return StopCause::not_operational;
        default:
          return StopCause::heartbeat_lost;
      }
    }
    if (!drive.sample().fresh(now, options_.feedback_timeout)) return StopCause::feedback_lost;
    const DriveState state = drive.state();
    if (state == DriveState::operation_enabled) return StopCause::none;
    if (state == DriveState::fault || state == DriveState::fault_reaction_active) {
      if (enabled_ || !drive.may_reset_fault(now)) return StopCause::fault;
    }
    if (enabled_) return StopCause::left_operation;
    return now - since_ <= options_.start_timeout ? StopCause::none : StopCause::start_timed_out;
  }

  DriveBusOptions options_;
  std::vector<Drive> drives_;
  DriveRequest request_{DriveRequest::off};
  StopCause cause_{StopCause::none};
  std::size_t culprit_{0};
  bool enabled_{false};
  bool in_cycle_{false};     // SYNC is due, after the commands
  std::size_t unserved_{0};  // drives, from the first_ on, that a command is due to
  std::size_t first_{0};
  double since_{0};
  double last_{-std::numeric_limits<double>::infinity()};
  double next_{-std::numeric_limits<double>::infinity()};
  double next_heartbeat_{-std::numeric_limits<double>::infinity()};
};

}  // namespace icat::canopen
