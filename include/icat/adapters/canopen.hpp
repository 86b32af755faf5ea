// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// CANopen [CiA 301]: network management, SYNC, heartbeat and emergency frames, the layout of
/// process data, and a node of the bus that is configured and watched. Bytes in, bytes out: any
/// driver of a bus carries the frames (socketcan.hpp is one), the caller owns loop and clock.
///
/// Identifiers are those of the predefined connection set [CiA 301, 7.3.5]. cia402.hpp makes a
/// drive of a node, drive_bus.hpp an arm of drives.
#pragma once

#include <cmath>
#include <utility>

#include "icat/adapters/canopen_sdo.hpp"
#include "icat/core/received.hpp"

namespace icat::canopen {

/// Commands of the network master to a node [CiA 301, 7.2.8.3].
enum class NmtCommand : std::uint8_t {
  start = 1,
  stop = 2,
  enter_pre_operational = 128,
  reset_node = 129,
  reset_communication = 130,
};

/// States of a node in its heartbeat [CiA 301, 7.2.8.3.2.2].
enum class NmtState : std::uint8_t {
  boot_up = 0,
  stopped = 4,
  operational = 5,
  pre_operational = 127,
};

/// A command to the node `node`, 1 to 127, or to all of them where it is 0.
constexpr CanFrame nmt_frame(NmtCommand command, int node) noexcept {
  return {0, 2, {static_cast<std::uint8_t>(command), static_cast<std::uint8_t>(node & 0x7f)}};
}
/// At this frame drives measure, and apply the data received before. Without counter.
constexpr CanFrame sync_frame() noexcept { return {0x80, 0, {}}; }
/// The heartbeat of the node `node`, 1 to 127.
constexpr CanFrame heartbeat_frame(int node, NmtState state) noexcept {
  return {0x700 + static_cast<std::uint32_t>(node & 0x7f), 1, {static_cast<std::uint8_t>(state)}};
}
/// Reads a heartbeat or boot-up of the node `node` into `state`. False where the frame is none, or
/// holds no state that there is; `state` stays.
constexpr bool decode_heartbeat(const CanFrame& frame, int node, NmtState& state) noexcept {
  if (frame.extended || frame.remote || frame.size != 1 || node < 1 || node > 127 ||
      frame.id != 0x700 + static_cast<std::uint32_t>(node)) {
    return false;
  }
  const auto value = static_cast<NmtState>(frame.data[0]);
  if (value != NmtState::boot_up && value != NmtState::stopped && value != NmtState::operational &&
      value != NmtState::pre_operational) {
    return false;
  }
  state = value;
  return true;
}

/// What a node reports once, when an error comes or goes [CiA 301, 7.2.7].
struct Emergency {
  std::uint16_t code{0};                 ///< 0: the error is gone
  std::uint8_t error_register{0};        ///< object 0x1001
  std::array<std::uint8_t, 5> detail{};  ///< of the manufacturer
};

/// The emergency of the node `node`, 1 to 127.
constexpr CanFrame emergency_frame(int node, const Emergency& e) noexcept {
  CanFrame frame{0x80 + static_cast<std::uint32_t>(node & 0x7f), 8, {}};
  frame.data[0] = static_cast<std::uint8_t>(e.code & 0xff);
  frame.data[1] = static_cast<std::uint8_t>(e.code >> 8);
  frame.data[2] = e.error_register;
  for (std::size_t i = 0; i < 5; ++i) frame.data[3 + i] = e.detail[i];
  return frame;
}
/// Reads an emergency of the node `node`. False where the frame is none; `emergency` stays.
constexpr bool decode_emergency(const CanFrame& frame, int node, Emergency& emergency) noexcept {
  if (frame.extended || frame.remote || frame.size != 8 || node < 1 || node > 127 ||
      frame.id != 0x80 + static_cast<std::uint32_t>(node)) {
    return false;
  }
  emergency.code = static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8);
  emergency.error_register = frame.data[2];
  for (std::size_t i = 0; i < 5; ++i) emergency.detail[i] = frame.data[3 + i];
  return true;
}

/// An object in the process data.
struct PdoEntry {
  std::uint16_t index;    ///< in the object dictionary
  std::uint8_t subindex;  ///< 0 where the object is a single value
  std::uint8_t bits;      ///< 8, 16, 24, 32, …, 64
};

/// A number that is written to an object while a node is configured.
struct SdoWrite {
  std::uint16_t index;    ///< in the object dictionary
  std::uint8_t subindex;  ///< 0 where the object is a single value
  std::uint8_t bytes;     ///< 1 to 4
  std::uint32_t value;    ///< two's complement where the object is signed
};

/// Which objects a process data object carries, and where they lie in its bytes [CiA 301, 7.2.2].
/// Whole bytes only, little-endian, one after the other.
class PdoMapping {
 public:
  /// @param entries in their order.
  /// @throws std::invalid_argument on no entry, above 8, bits that are no whole bytes, and above 64
  ///         bits in all.
  [[gnu::cold]] PdoMapping(std::initializer_list<PdoEntry> entries) {
    if (entries.size() < 1 || entries.size() > 8) {
      detail::invalid("PDO mapping: 1 to 8 entries, got ", entries.size());
    }
    int first = 0;
    for (const PdoEntry& entry : entries) {
      if (entry.bits < 8 || entry.bits > 64 || entry.bits % 8 != 0) {
        detail::invalid("PDO mapping: entry ", count_, " must be of 8, 16, …, 64 bits, got ",
                        entry.bits);
      }
      first_[count_] = static_cast<std::uint8_t>(first / 8);
      first += entry.bits;
      if (first > 64) detail::invalid("PDO mapping: more than 64 bits");
      entries_[count_++] = entry;
    }
    bytes_ = static_cast<std::uint8_t>(first / 8);
  }

  /// How many entries.
  std::size_t count() const noexcept { return count_; }
  /// The i-th entry.
  const PdoEntry& entry(std::size_t i) const noexcept { return entries_[i]; }
  /// How many bytes a frame has.
  std::uint8_t bytes() const noexcept { return bytes_; }

  /// Writes the i-th entry of `frame`, whose bits beyond those of the entry are cut off.
  void put(CanFrame& frame, std::size_t i, std::int64_t value) const noexcept {
    auto bits = static_cast<std::uint64_t>(value);
    for (std::size_t k = 0; k < entries_[i].bits / 8u; ++k, bits >>= 8) {
      frame.data[first_[i] + k] = static_cast<std::uint8_t>(bits & 0xff);
    }
  }
  /// The i-th entry of `frame`, a number without sign.
  std::uint64_t get_unsigned(const CanFrame& frame, std::size_t i) const noexcept {
    std::uint64_t bits = 0;
    for (std::size_t k = entries_[i].bits / 8u; k-- > 0;) {
      bits = bits << 8 | frame.data[first_[i] + k];
    }
    return bits;
  }
  /// The i-th entry of `frame`, a number with sign.
  std::int64_t get_signed(const CanFrame& frame, std::size_t i) const noexcept {
    const int above = 64 - entries_[i].bits;
    return static_cast<std::int64_t>(get_unsigned(frame, i) << above) >> above;
  }

  /// Appends to `writes` what makes a node use this mapping: `communication` is 0x1400 + k for what
  /// it receives, 0x1800 + k for what it sends; `id` the identifier of the frames; `type` 1 with
  /// every SYNC, 255 at once; `timeout`, s, 0 or how long a node that receives may hear nothing
  /// [CiA 301, 7.5.2.35 to 38]. Allocates.
  [[gnu::cold]] void configure(std::vector<SdoWrite>& writes, std::uint16_t communication,
                               std::uint32_t id, std::uint8_t type, double timeout = 0) const {
    const auto mapping = static_cast<std::uint16_t>(communication + 0x200);
    const std::uint32_t no_remote = communication >= 0x1800 ? 0x40000000u : 0u;
    writes.push_back({communication, 1, 4, 0x80000000u | no_remote | id});
    writes.push_back({communication, 2, 1, type});
    if (timeout > 0) {
      writes.push_back(
          {communication, 5, 2, static_cast<std::uint32_t>(std::lround(1000 * timeout))});
    }
    writes.push_back({mapping, 0, 1, 0});
    for (std::size_t i = 0; i < count_; ++i) {
      const PdoEntry& e = entries_[i];
      writes.push_back({mapping, static_cast<std::uint8_t>(i + 1), 4,
                        static_cast<std::uint32_t>(e.index) << 16 |
                            static_cast<std::uint32_t>(e.subindex) << 8 | e.bits});
    }
    writes.push_back({mapping, 0, 1, static_cast<std::uint32_t>(count_)});
    writes.push_back({communication, 1, 4, no_remote | id});
  }

 private:
  std::array<PdoEntry, 8> entries_{};
  std::array<std::uint8_t, 8> first_{};
  std::size_t count_{0};
  std::uint8_t bytes_{0};
};

/// Times of a node.
struct NodeOptions {
  double heartbeat_period{0.1};  ///< s: of the node. Silence of more than three of them is a loss
  double sdo_timeout{0.5};       ///< s: how long an answer to one write may take
  double retry{1};               ///< s: between two tries to configure a node that does not answer
};

/// States of a node until it is operational.
enum class NodePhase {
  waiting,      ///< for the next try to configure it
  configuring,  ///< one object after the other
  starting,     ///< configured; its heartbeat does not say yet that it is operational
  running,      ///< operational, heard of within three periods
  refused,  ///< an object could not be written: `failure`. A boot-up of the node, or `configure`
            ///< begins anew
};

/// Why a node is no longer running.
enum class NodeLoss {
  none,       ///< it was never lost
  silent,     ///< no heartbeat for more than three periods
  restarted,  ///< it sent a boot-up
  left        ///< its heartbeat says that it is not operational
};

/// A node of the bus: it is put into pre-operational, asked for its profile, configured by writes
/// one after the other, started, and watched. A node that is lost, or restarts, is configured again
/// as soon as it answers. Construction allocates, nothing else does.
class Node {
 public:
  /// `configuration` is written in its order; the node's heartbeat is set by the node itself.
  /// `profile` is what the lower half of object 0x1000 must say, 402 for a drive.
  /// @throws std::invalid_argument on a node, period or time out of range.
  [[gnu::cold]] Node(int node, std::uint16_t profile, std::vector<SdoWrite> configuration,
                     const NodeOptions& options = {})
      : node_(node),
        profile_(profile),
        options_(options),
        sdo_(node, options.sdo_timeout),
        writes_(std::move(configuration)) {
    detail::require_positive("CANopen node", "heartbeat_period", options.heartbeat_period);
    detail::require_positive("CANopen node", "retry", options.retry);
    if (options.heartbeat_period < 0.001 || options.heartbeat_period > 20) {
      detail::invalid("CANopen node: heartbeat_period must be 0.001 to 20 s, got ",
                      options.heartbeat_period);
    }
    const long period = std::lround(1000 * options.heartbeat_period);
    writes_.insert(writes_.begin(), {0x1017, 0, 2, static_cast<std::uint32_t>(period)});
  }

  /// Takes a frame that came at `now`, s: heartbeat, emergency, answer. Returns whether it was one
  /// of this node's.
  bool receive(const CanFrame& frame, double now) noexcept {
    if (!std::isfinite(now)) return false;
    NmtState state{};
    if (decode_heartbeat(frame, node_, state)) {
      heartbeat_.put(state, now);
      if (state == NmtState::boot_up) {
        configured_ = false;
        restart(NodeLoss::restarted, now);
      } else if (phase_ == NodePhase::starting && state == NmtState::operational) {
        phase_ = NodePhase::running;
        configured_ = true;
      } else if (phase_ == NodePhase::running && state != NmtState::operational) {
        restart(NodeLoss::left, now);
      }
      return true;
    }
    Emergency emergency;
    if (decode_emergency(frame, node_, emergency)) {
      emergency_.put(emergency, now);
      return true;
    }
    return sdo_.receive(frame, now);
  }
  /// Looks at the clock and takes the next step, at `now`, s. Call it once in a cycle.
  void advance(double now) noexcept {
    if (!std::isfinite(now)) return;
    if (now < since_) since_ = now;  // a clock that was set back
    if (heartbeat_.time > now) heartbeat_.time = now;
    sdo_.advance(now);
    switch (phase_) {
      case NodePhase::waiting:
        if (now - since_ >= wait_) begin(now);
        break;
      case NodePhase::configuring:
        step(now);
        break;
      case NodePhase::starting:
        if (!(now - since_ <= 3 * options_.heartbeat_period + options_.sdo_timeout)) wait(now);
        break;
      case NodePhase::running:
        if (!heartbeat_.fresh(now, 3 * options_.heartbeat_period)) restart(NodeLoss::silent, now);
        break;
      case NodePhase::refused:
        break;
    }
  }
  /// Passes pending frames to `send`, `bool(const CanFrame&)`: at most a command and a frame of a
  /// transfer. Returns false where `send` did: what was not sent stays.
  template <class Send>
  bool send(Send&& send) noexcept {
    if (has_command_) {
      if (!send(nmt_frame(command_, node_))) return false;
      has_command_ = false;
    }
    return sdo_.send(send);
  }
  /// Begins to configure it anew at the next `advance`.
  void configure() noexcept {
    phase_ = NodePhase::waiting;
    wait_ = 0;
    sdo_.reset();
  }

  /// 1 to 127.
  int id() const noexcept { return node_; }
  /// Where it is.
  NodePhase phase() const noexcept { return phase_; }
  /// Whether it was running since its last boot-up: it lays out process data as it was told.
  bool configured() const noexcept { return configured_; }
  /// Why it stopped running, the last time that it did.
  NodeLoss loss() const noexcept { return loss_; }
  /// Its last heartbeat.
  const Received<NmtState>& heartbeat() const noexcept { return heartbeat_; }
  /// Its last emergency. One that says that the error is gone has the code 0.
  const Received<Emergency>& emergency() const noexcept { return emergency_; }
  /// Its transfers. They are the node's own until it is running, and the caller's from then on.
  SdoClient& sdo() noexcept { return sdo_; }
  /// The same, to look at: where `refused`, the index, subindex and abort code of what was refused.
  const SdoClient& sdo() const noexcept { return sdo_; }

 private:
  void tell(NmtCommand command) noexcept {
    command_ = command;
    has_command_ = true;
  }
  void restart(NodeLoss why, double now) noexcept {
    if (phase_ == NodePhase::running) loss_ = why;
    configure();
    since_ = now;
  }
  void wait(double now) noexcept {
    phase_ = NodePhase::waiting;
    since_ = now;
    wait_ = options_.retry;
  }
  void begin(double now) noexcept {
    since_ = now;
    // The abort of a transfer that timed out may still be on its way.
    if (!sdo_.upload(0x1000, 0, now)) return;
    tell(NmtCommand::enter_pre_operational);
    next_ = 0;
    phase_ = NodePhase::configuring;
  }
  void step(double now) noexcept {
    switch (sdo_.state()) {
      case SdoState::busy:
        return;
      case SdoState::done:
        break;
      case SdoState::aborted:
        phase_ = NodePhase::refused;
        return;
      default:
        wait(now);
        return;
    }
    if (next_ == 0 && (sdo_.data().size() != 4 || (sdo_.value() & 0xffff) != profile_)) {
      phase_ = NodePhase::refused;
      return;
    }
    if (next_ == writes_.size()) {
      tell(NmtCommand::start);
      since_ = now;
      phase_ = NodePhase::starting;
      return;
    }
    const SdoWrite& write = writes_[next_++];
    sdo_.download(write.index, write.subindex, write.value, write.bytes, now);
  }

  int node_;
  std::uint16_t profile_;
  NodeOptions options_;
  SdoClient sdo_;
  std::vector<SdoWrite> writes_;
  std::size_t next_{0};
  Received<NmtState> heartbeat_;
  Received<Emergency> emergency_;
  NodePhase phase_{NodePhase::waiting};
  NodeLoss loss_{NodeLoss::none};
  double since_{0};
  double wait_{0};
  NmtCommand command_{};
  bool has_command_{false};
  bool configured_{false};
};

}  // namespace icat::canopen
