// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The cooperation's messages over acoustic modems of the EvoLogics kind (S2C), as instant messages
///
///     AT*SENDIM,<length>,<address>,<flag>,<data>     flag: ack, noack
///
/// of at most 64 bytes; longer ones are cut, see acoustic_modem_parts.hpp. What the modem answers
/// is in acoustic_modem_answers.hpp, with the sources. Not tried on a device:
/// docs/acoustic_modem.md.
///
/// The channel is half-duplex and slow. The agents send in turns, in the order of their indices:
/// each after it has received the message of the one before it, or after a pause without messages.
/// The pauses differ, so that two agents that have sent at the same time do not do so again. The
/// queue holds one message: one that was not sent yet is replaced by the next one.
///
/// In each cycle `exchange` reads and writes the available bytes, without blocking; `ready` is true
/// in this agent's turn; `send` takes its message; `take` returns a received message, if it is
/// complete and valid.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <string_view>
#include <utility>
#include <vector>

#include "icat/adapters/acoustic_modem_answers.hpp"
#include "icat/adapters/acoustic_modem_options.hpp"
#include "icat/adapters/acoustic_modem_parts.hpp"
#include "icat/core/received.hpp"
#include "icat/core/status.hpp"

namespace icat {

/// What `AcousticModem::exchange` needs of a stream; `ByteStream` is one. None of the calls waits.
template <class S>
concept ModemStream = requires(S& stream, const S& same, double time, std::span<std::byte> in,
                               std::span<const std::byte> out) {
  { stream.open(time) }
  noexcept->std::same_as<bool>;
  { stream.read(in) }
  noexcept->std::same_as<std::size_t>;
  { stream.write(out) }
  noexcept->std::same_as<std::size_t>;
  { same.is_open() }
  noexcept->std::same_as<bool>;
  { same.openings() }
  noexcept->std::same_as<std::uint32_t>;
};

/// See the file comment. Belongs to one thread; after construction nothing allocates or throws.
class AcousticModem {
 public:
  /// Settings, see acoustic_modem_options.hpp.
  using Options = AcousticModemOptions;

  /// @throws std::invalid_argument on settings out of range. Allocates.
  explicit AcousticModem(const Options& options)
      : options_(detail::modem::validated(options)),
        agents_(options.addresses.size()),
        heard_from_(agents_),
        slot_(detail::modem::slot(options)) {}

  /// To be called in every cycle at `time`, s: opens `stream`, reads what has come, and writes what
  /// is to be sent. A time that runs backwards or is not finite counts as no time.
  template <ModemStream Stream>
  void exchange(Stream& stream, double time) noexcept {
    if (std::isfinite(time)) {
      const double step = time - time_;
      if (step > 0) elapsed_ += std::fmin(step, 1.0);
      time_ = time;
    }
    const bool open = stream.open(time);
    if (!open || !connected_ || stream.openings() != openings_) begin(open, stream.openings());
    std::array<std::byte, 1024> block;
    for (int k = 0; k < 4 && stream.is_open(); ++k) {  // bounded, whatever comes
      const std::size_t n = stream.read(block);
      if (n == 0) break;
      take_in(std::span<const std::byte>(block).first(std::min(n, block.size())));
    }
    if (!stream.is_open()) return begin(false, openings_);
    step();
    out_.advance(stream.write(out_.rest()));
  }

  /// It is this agent's turn, and there is nothing that waits to be sent: the moment to make a
  /// message. As of the last `exchange`.
  bool ready() const noexcept {
    return set_up() && !waiting_.is && !current_.is && !receiving() && elapsed_ >= turn_at_;
  }
  /// Puts `message` of `round` into the queue of one, in the place of any that waits there; the
  /// next `exchange` in this agent's turn sends it. Refused, and what waits stays: an empty message
  /// or one longer than `message_size` (`wrong_size`), a round that 32 bits do not hold
  /// (`round_out_of_range`).
  Status send(long long round, std::span<const std::byte> message) noexcept {
    if (message.empty() || message.size() > options_.message_size) return Status::wrong_size;
    if (round < INT32_MIN || round > INT32_MAX) return Status::round_out_of_range;
    waiting_.is = true;
    waiting_.round = static_cast<std::int32_t>(round);
    waiting_.size = message.size();
    waiting_.since = elapsed_;
    std::memcpy(waiting_.data.data(), message.data(), message.size());
    return Status::ok;
  }

  /// The newest message of `agent`, if one has come since the last call; else nullptr, also for an
  /// agent that there is not. Valid until the next `exchange`.
  const ModemMessage* take(std::size_t agent) noexcept {
    if (agent >= agents_) return nullptr;
    Heard& heard = heard_from_[agent];
    if (heard.taken == heard.last.count) return nullptr;
    heard.taken = heard.last.count;
    return &heard.last.value;
  }
  /// The last message of `agent`, and when it came on the caller's clock. `agent` must be one.
  const Received<ModemMessage>& last(std::size_t agent) const noexcept {
    return heard_from_[agent].last;
  }

  /// The connection stands, the modem is set up, and it has said something within `silence`. As of
  /// the last `exchange`.
  bool healthy() const noexcept { return set_up() && elapsed_ - spoke_at_ <= options_.silence; }
  /// What became of messages.
  const ModemCounts& counts() const noexcept { return counts_; }
  /// How often the modem said something that could not be read; wraps around.
  std::uint32_t malformed() const noexcept { return parser_.malformed(); }
  /// The last line that began with ERROR or BUSY, at most 63 characters; empty before the first.
  std::string_view last_refusal() const noexcept { return {refusal_.data(), refusal_size_}; }
  /// s that one message takes at most, with the way there and back and the pause.
  double message_time() const noexcept { return slot_; }
  /// s until every agent has spoken, if nothing is lost. `AgreementOptions::hold` must be longer.
  double round_time() const noexcept { return static_cast<double>(agents_) * slot_; }

 private:
  struct Outgoing {
    bool is{false};
    std::int32_t round{0};
    std::size_t size{0};
    double since{0};
    std::array<std::byte, ModemMessage::max_size> data{};
    std::size_t part{0};  // that is next, or on air
    std::uint16_t crc{0xffff};
  };
  struct Heard {
    detail::modem::Reassembly parts;
    Received<ModemMessage> last;
    std::uint32_t taken{0};
    double duration{0};
    int integrity{0};
  };
  enum class Awaiting { nothing, setup, message };

  bool set_up() const noexcept { return connected_ && setup_ >= options_.setup.size(); }
  bool receiving() const noexcept { return elapsed_ < receiving_until_; }

  // A connection begins, or there is none: nothing of the one before counts.
  void begin(bool open, std::uint32_t openings) noexcept {
    if (!open && !connected_) return;
    connected_ = open;
    openings_ = openings;
    parser_.reset();
    for (Heard& heard : heard_from_) heard.parts.reset();
    waiting_.is = current_.is = on_air_ = false;
    awaiting_ = Awaiting::nothing;
    setup_ = 0;
    out_.clear();
    receiving_until_ = spoke_at_ = fed_at_ = try_at_ = elapsed_;
    turn_at_ = elapsed_ + static_cast<double>(options_.index) * slot_;
  }

  void take_in(std::span<const std::byte> bytes) noexcept {
    fed_at_ = elapsed_;
    parser_.feed(bytes, [this](const ModemAnswer& answer) { handle(answer); });
  }
  void handle(const ModemAnswer& answer) noexcept {
    spoke_at_ = elapsed_;
    switch (answer.kind) {
      case ModemAnswerKind::ok:
        return accepted();
      case ModemAnswerKind::busy:
      case ModemAnswerKind::error:
        return refused(answer);
      case ModemAnswerKind::message:
        somebody_speaks();
        return received(answer);
      case ModemAnswerKind::delivered:
        if (on_air_ && options_.acknowledge) part_is_sent();
        return;
      case ModemAnswerKind::failed:
      case ModemAnswerKind::canceled:
        if (!on_air_) return;
        ++counts_.failed;
        return give_up();
      case ModemAnswerKind::send_start:
        // Its end will be told; should it not be, this is late enough.
        if (on_air_ && !options_.acknowledge) on_air_until_ = elapsed_ + 2 * part_time();
        return;
      case ModemAnswerKind::send_end:
        if (!options_.acknowledge && on_air_) part_is_sent();
        return;
      case ModemAnswerKind::receive_start:
        receiving_until_ =
            elapsed_ + 1.25 * detail::modem::air_time(options_, detail::modem::max_part);
        return;
      case ModemAnswerKind::receive_end:
      case ModemAnswerKind::receive_failed:
        return somebody_speaks();
      case ModemAnswerKind::other:
        // The answer to a question among the commands of `setup`.
        if (awaiting_ == Awaiting::setup && options_.setup[setup_].find('?') < 64) accepted();
        return;
    }
  }
  // A signal has ended; the next part of the same message may follow.
  void somebody_speaks() noexcept {
    receiving_until_ = elapsed_;
    turn_at_ = std::fmax(turn_at_, elapsed_ + 2 * options_.guard);
  }
  void accepted() noexcept {
    if (awaiting_ == Awaiting::setup) ++setup_;
    if (awaiting_ == Awaiting::message) {
      on_air_ = true;
      on_air_until_ = elapsed_ + (options_.acknowledge ? options_.deliver_within : part_time());
    }
    awaiting_ = Awaiting::nothing;
  }
  void refused(const ModemAnswer& answer) noexcept {
    refusal_size_ = std::min(answer.data.size(), refusal_.size());
    std::memcpy(refusal_.data(), answer.data.data(), refusal_size_);
    const Awaiting what = std::exchange(awaiting_, Awaiting::nothing);
    if (what == Awaiting::nothing) return;
    const bool busy = answer.kind == ModemAnswerKind::busy;
    ++(busy ? counts_.busy : counts_.refused);
    if (busy) {
      try_at_ = elapsed_ + options_.retry;
    } else if (what == Awaiting::setup) {
      ++setup_;  // a firmware without this command
    } else {
      give_up();
    }
  }
  void received(const ModemAnswer& answer) noexcept {
    using detail::modem::PartResult;
    const int own = options_.addresses[options_.index];
    std::size_t agent = 0;
    while (agent < agents_ && options_.addresses[agent] != answer.source) ++agent;
    if (agent == agents_ || agent == options_.index ||
        (answer.destination != own && answer.destination != broadcast)) {
      return void(++counts_.foreign);
    }
    if (answer.integrity < options_.min_integrity) return void(++counts_.weak);
    Heard& heard = heard_from_[agent];
    const PartResult result = heard.parts.put(agent, answer.data, message_);
    counts_.foreign += result == PartResult::foreign;
    counts_.damaged += result == PartResult::damaged;
    counts_.doubled += result == PartResult::doubled;
    if (result != PartResult::kept && result != PartResult::complete) return;
    const bool first = (std::to_integer<unsigned>(answer.data[0]) & 3u) == 0;
    heard.duration = (first ? 0 : heard.duration) + answer.duration;
    heard.integrity = first ? answer.integrity : std::min(heard.integrity, answer.integrity);
    if (result == PartResult::kept) {
      const double left =
          static_cast<double>(heard.parts.missing()) *
          (detail::modem::air_time(options_, detail::modem::max_part) + options_.guard);
      turn_at_ = std::fmax(turn_at_, elapsed_ + 1.25 * left);
      return;
    }
    ++counts_.received;
    message_.source = answer.source;
    message_.duration = heard.duration;
    message_.rssi = answer.rssi;
    message_.integrity = heard.integrity;
    message_.newer = heard.last.count == 0 || message_.round > heard.last.value.round;
    heard.last.put(message_, time_);
    const std::size_t before_me = (options_.index + agents_ - agent) % agents_ - 1;
    turn_at_ = elapsed_ + options_.guard + static_cast<double>(before_me) * slot_;
  }

  double part_time() const noexcept {
    return detail::modem::air_time(options_,
                                   detail::modem::part_size(current_.size, current_.part));
  }
  void part_is_sent() noexcept {
    on_air_ = false;
    current_.crc = next_crc_;
    if (++current_.part < detail::modem::part_count(current_.size)) return;
    current_.is = false;
    ++counts_.sent;
    others_turn();
  }
  void give_up() noexcept {
    current_.is = on_air_ = false;
    others_turn();
  }
  // Until others should have spoken. Two agents that have not heard each other, and spoke up to
  // n − 1 messages apart, do not speak at the same time again: their pauses differ by n + ½.
  void others_turn() noexcept {
    const double n = static_cast<double>(agents_), i = static_cast<double>(options_.index);
    turn_at_ = elapsed_ + slot_ * (n - 0.5 + i * (n + 0.5));
  }

  // What is to be written next, if anything.
  void step() noexcept {
    if (parser_.incomplete() && elapsed_ - fed_at_ > options_.answer_within) {
      fed_at_ = elapsed_;
      parser_.give_up([this](const ModemAnswer& answer) { handle(answer); });
    }
    if (awaiting_ != Awaiting::nothing && elapsed_ - asked_at_ > options_.answer_within) {
      ++counts_.unanswered;
      if (awaiting_ == Awaiting::setup) ++setup_;
      if (awaiting_ == Awaiting::message) give_up();
      awaiting_ = Awaiting::nothing;
    }
    if (on_air_ && elapsed_ >= on_air_until_) {
      if (options_.acknowledge) {
        ++counts_.failed;
        give_up();
      } else {
        part_is_sent();
      }
    }
    if (awaiting_ != Awaiting::nothing || !out_.rest().empty() || elapsed_ < try_at_) return;
    if (setup_ < options_.setup.size()) {
      out_.begin(options_.mode == ModemMode::data);
      out_.append(options_.setup[setup_]);
      return finish_command(Awaiting::setup);
    }
    if (on_air_) return;
    if (waiting_.is && elapsed_ - waiting_.since > options_.max_age) {
      waiting_.is = false;
      ++counts_.expired;
    }
    const bool begun = current_.is && current_.part > 0;
    // What is begun is nearly there: it may be older.
    const double oldest = options_.max_age + (begun ? 2 * slot_ : 0.0);
    if (current_.is && elapsed_ - current_.since > oldest) {
      ++counts_.expired;
      return give_up();
    }
    if (!begun) {
      if (elapsed_ < turn_at_ || receiving()) return;
      if (waiting_.is) {
        current_ = waiting_;
        current_.part = 0;
        current_.crc = 0xffff;
        waiting_.is = false;
      }
    }
    if (current_.is) send_part();
  }
  void send_part() noexcept {
    std::array<std::byte, detail::modem::max_part> part;
    next_crc_ = current_.crc;
    const std::size_t size =
        detail::modem::encode_part(static_cast<std::uint8_t>(options_.index), current_.round,
                                   std::span<const std::byte>(current_.data).first(current_.size),
                                   current_.part, next_crc_, part);
    out_.begin(options_.mode == ModemMode::data);
    out_.append("AT*SENDIM,");
    out_.append(static_cast<int>(size));
    out_.append(",");
    out_.append(agents_ == 2 ? options_.addresses[1 - options_.index] : broadcast);
    out_.append(options_.acknowledge ? ",ack," : ",noack,");
    out_.append(std::span<const std::byte>(part).first(size));
    finish_command(Awaiting::message);
  }
  void finish_command(Awaiting what) noexcept {
    out_.append({&options_.line_end, 1});
    awaiting_ = what;
    asked_at_ = elapsed_;
  }

  static constexpr int broadcast = 255;

  Options options_;
  std::size_t agents_;
  std::vector<Heard> heard_from_;
  double slot_;
  ModemParser parser_;
  ModemMessage message_;
  ModemCounts counts_;
  Outgoing waiting_, current_;
  detail::modem::Command out_;
  std::size_t setup_{0}, refusal_size_{0};
  std::array<char, 63> refusal_{};
  std::uint16_t next_crc_{0xffff};
  std::uint32_t openings_{0};
  Awaiting awaiting_{Awaiting::nothing};
  bool connected_{false}, on_air_{false};
  // The caller's clock, and the sum of its steps, on which all below is told.
  double time_{std::numeric_limits<double>::quiet_NaN()}, elapsed_{0};
  double turn_at_{0}, try_at_{0}, asked_at_{0}, on_air_until_{0}, receiving_until_{0};
  double spoke_at_{0}, fed_at_{0};
};

}  // namespace icat
