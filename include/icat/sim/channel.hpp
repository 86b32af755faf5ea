// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A communication channel between two agents, in simulated time.
///
/// There is a slot to send at every k / rate, k = 0, 1, … Full duplex: each slot serves both agents
/// (two modems). Half duplex: slot k serves agent k mod 2, they alternate (one modem). What is sent
/// at t arrives at t + latency, or is lost with the given probability. [Coop, V-B]
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include "icat/control/sample_hold.hpp"
#include "icat/core/error.hpp"

namespace icat {

/// Whether both agents send in the same slot or take turns.
enum class Duplex { full, half };

/// Carries values of type `Message`, such as the 6 floats of a tool velocity (192 bits).
template <class Message>
class Channel {
 public:
  /// Settings, with defaults.
  struct Options {
    double rate{100};             ///< slots per second, Hz
    double latency{0};            ///< from sending to arrival, s
    Duplex duplex{Duplex::full};  ///< see the file comment
    double loss{0};               ///< probability that a message is lost, 0 … 1
    std::uint32_t seed{1};        ///< of the losses; the same seed loses the same messages
  };

  /// Allocates what is under way at most.
  /// @throws std::invalid_argument on a rate that is not finite and > 0, a latency that is not
  /// finite and >= 0, or a probability outside 0 … 1.
  explicit Channel(const Options& options) : options_(options), random_(options.seed) {
    detail::require_positive("Channel", "rate", options.rate);
    if (!(options.latency >= 0) || !(options.latency * options.rate < 1e6)) {
      detail::invalid("Channel: latency must be >= 0 and below a million slots, got ",
                      options.latency, " s at ", options.rate, " Hz");
    }
    if (!(options.loss >= 0 && options.loss <= 1)) {
      detail::invalid("Channel: loss must be in [0, 1], got ", options.loss);
    }
    const auto under_way = static_cast<std::size_t>(options.latency * options.rate) + 2;
    for (auto& way : ways_) way.queue.resize(under_way);
  }

  /// Agent `sender` (0 or 1) offers `message` at `time` (s, not decreasing). True if it was sent: a
  /// slot of this agent has come since its last message. A lost one counts as sent. No allocation.
  bool send(int sender, double time, const Message& message) noexcept {
    if (!ready(sender, time)) return false;
    Way& way = ways_[index(sender)];
    way.slot = detail::slot_at(time, options_.rate);
    // The generator's 32 bits themselves: the standard's distributions differ between libraries.
    if (static_cast<double>(random_()) < options_.loss * 4294967296.0) return true;
    if (way.count == way.queue.size()) drop_oldest(way);  // nobody listens
    way.queue[(way.first + way.count++) % way.queue.size()] = {time + options_.latency, message};
    return true;
  }

  /// `send` would send: lets the sender prepare its message at the last moment.
  bool ready(int sender, double time) const noexcept {
    const long long slot = detail::slot_at(time, options_.rate);
    const bool served = options_.duplex == Duplex::full || slot % 2 == sender;
    return served && slot > ways_[index(sender)].slot;
  }

  /// The newest message for agent `receiver` (0 or 1) that has arrived at `time` (s, not
  /// decreasing) since it was last asked for; older ones are dropped. No allocation.
  std::optional<Message> receive(int receiver, double time) noexcept {
    Way& way = ways_[1 - index(receiver)];
    std::optional<Message> newest;
    // A millionth of a slot early counts, as for sending.
    while (way.count > 0 && way.queue[way.first].arrival <= time + 1e-6 / options_.rate) {
      newest = way.queue[way.first].message;
      drop_oldest(way);
    }
    return newest;
  }

 private:
  struct UnderWay {
    double arrival{};
    Message message{};
  };
  // From one agent to the other: a ring.
  struct Way {
    std::vector<UnderWay> queue;
    std::size_t first{0}, count{0};
    long long slot{-1};
  };

  static std::size_t index(int agent) noexcept { return agent == 0 ? 0 : 1; }
  static void drop_oldest(Way& way) noexcept {
    way.first = (way.first + 1) % way.queue.size();
    --way.count;
  }

  Options options_;
  std::mt19937 random_;
  std::array<Way, 2> ways_;
};

}  // namespace icat
