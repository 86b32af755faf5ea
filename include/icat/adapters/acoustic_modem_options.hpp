// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Settings and counts of an acoustic modem, see acoustic_modem.hpp.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "icat/adapters/acoustic_modem_parts.hpp"
#include "icat/core/error.hpp"

namespace icat {

/// How commands reach the modem.
enum class ModemMode {
  command,  ///< "AT…", as on its TCP ports
  data,     ///< "+++AT…", beside a stream of data that this adapter does not use
};

/// Counts of messages; each number wraps around.
struct ModemCounts {
  std::uint32_t sent{0};        ///< messages whose last part was transmitted
  std::uint32_t received{0};    ///< whole messages of other agents
  std::uint32_t busy{0};        ///< "BUSY": tried again later
  std::uint32_t refused{0};     ///< "ERROR": given up
  std::uint32_t failed{0};      ///< not acknowledged by the receiver, or canceled
  std::uint32_t unanswered{0};  ///< commands that the modem did not answer
  std::uint32_t expired{0};     ///< too old before it was this agent's turn
  std::uint32_t damaged{0};     ///< parts that do not fit, see acoustic_modem_parts.hpp
  std::uint32_t doubled{0};     ///< parts and messages that came before
  std::uint32_t weak{0};        ///< parts whose signal is below `min_integrity`
  std::uint32_t foreign{0};     ///< messages that are no parts, or of modems that are no agents
};

/// Settings, with defaults. They are all that the adapter knows of your modem.
struct AcousticModemOptions {
  std::vector<int> addresses{1, 2};    ///< modem of each agent, 1 … 254, in the agents' order
  std::size_t index{0};                ///< which of them this agent is
  std::size_t message_size{24};        ///< bytes of the longest message that is sent, 1 … 224
  bool acknowledge{false};             ///< ask for acknowledgements; for two agents only
  ModemMode mode{ModemMode::command};  ///< how commands reach the modem
  char line_end{'\n'};                 ///< of commands: LF over TCP, CR over a serial line
  /// Commands after the connection: take control, and extended notification.
  std::vector<std::string> setup{"AT@CTRL", "AT@ZX1"};
  double bit_rate{976};      ///< bit/s of instant messages, > 0 [Coop, I: the slowest modem]
  double overhead{0.1};      ///< s, ≥ 0, that a part takes on air beside its bits
  double range{100};         ///< m, ≥ 0: largest distance of two agents
  double guard{0.02};        ///< s, ≥ 0, between hearing and speaking
  int min_integrity{100};    ///< a weaker signal is not trusted
  double max_age{1};         ///< s, > 0: an older message is not sent any more
  double retry{0.1};         ///< s, > 0, until a busy modem is asked again
  double answer_within{1};   ///< s, > 0: until a command counts as unanswered
  double deliver_within{5};  ///< s, > 0: until a message counts as not acknowledged
  double silence{5};         ///< s, > 0: a modem that says nothing so long is not healthy
};

namespace detail::modem {

inline constexpr double sound_speed = 1500;  // m/s

/// @throws std::invalid_argument on settings out of range.
[[gnu::cold]] inline const AcousticModemOptions& validated(const AcousticModemOptions& o) {
  if (o.addresses.size() < 2 || o.addresses.size() > 255) {
    invalid("AcousticModem: addresses of 2 … 255 agents, got ", o.addresses.size());
  }
  for (std::size_t i = 0; i < o.addresses.size(); ++i) {
    if (o.addresses[i] < 1 || o.addresses[i] > 254) {
      invalid("AcousticModem: an address must be in [1, 254], got ", o.addresses[i]);
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (o.addresses[i] == o.addresses[j]) {
        invalid("AcousticModem: agents ", j, " and ", i, " have the address ", o.addresses[i]);
      }
    }
  }
  if (o.index >= o.addresses.size()) {
    invalid("AcousticModem: index must be < ", o.addresses.size(), ", got ", o.index);
  }
  if (o.message_size < 1 || o.message_size > ModemMessage::max_size) {
    invalid("AcousticModem: message_size must be in [1, ", ModemMessage::max_size, "], got ",
            o.message_size);
  }
  if (o.acknowledge && o.addresses.size() > 2) {
    invalid("AcousticModem: messages to several agents are not acknowledged");
  }
  if (o.line_end != '\n' && o.line_end != '\r') {
    invalid("AcousticModem: line_end must be \\n or \\r");
  }
  for (const std::string& command : o.setup) {
    if (!command.starts_with("AT") || command.size() > 64 ||
        command.find_first_of("\r\n") != std::string::npos) {
      invalid("AcousticModem: no command of at most 64 characters: '", command, "'");
    }
  }
  const std::pair<const char*, double> positive[] = {{"bit_rate", o.bit_rate},
                                                     {"max_age", o.max_age},
                                                     {"retry", o.retry},
                                                     {"answer_within", o.answer_within},
                                                     {"deliver_within", o.deliver_within},
                                                     {"silence", o.silence}};
  for (const auto& [name, value] : positive) {
    require_positive("AcousticModem", name, value);
  }
  const std::pair<const char*, double> not_negative[] = {
      {"overhead", o.overhead}, {"range", o.range}, {"guard", o.guard}};
  for (const auto& [name, value] : not_negative) {
    if (!(value >= 0 && std::isfinite(value))) {
      invalid("AcousticModem: ", name, " must be finite and >= 0, got ", value);
    }
  }
  return o;
}
/// s on air of a part of `bytes`.
inline double air_time(const AcousticModemOptions& o, std::size_t bytes) noexcept {
  return o.overhead + 8 * static_cast<double>(bytes) / o.bit_rate;
}
/// s that a message takes with the way there and back.
inline double slot(const AcousticModemOptions& o) noexcept {
  const double way = o.range / sound_speed;
  double sum = 2 * way + o.guard;
  for (std::size_t i = 0; i < part_count(o.message_size); ++i) {
    sum += air_time(o, part_size(o.message_size, i));
    if (o.acknowledge) sum += o.overhead + 2 * way;
  }
  return sum;
}

}  // namespace detail::modem

}  // namespace icat
