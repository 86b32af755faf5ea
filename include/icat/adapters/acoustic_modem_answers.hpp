// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Parses the answers of an acoustic modem of the EvoLogics kind (S2C) from a stream of bytes. Each
/// answer ends in CR LF; a message that was received states its length, and its data may hold any
/// bytes, CR and LF too:
///
///     OK   [*]OK   ERROR <text>   BUSY <text>           answers to a command
///     RECVIM,<length>,<source>,<destination>,<flag>,<duration>,<rssi>,<integrity>,<velocity>,<data>
///     DELIVEREDIM,<a>   FAILEDIM,<a>   CANCELEDIM,<a>   of a message with acknowledgement
///     SENDSTART,…   SENDEND,…   RECVSTART   RECVEND,…   RECVFAILED,…   extended notification
///
/// In data mode each answer is wrapped: `+++AT<command>:<length>:<answer>` CR LF. A length may be
/// preceded by `p<protocol>,`. Sources: the manufacturer's own software, EviNS (src/role_at.erl)
/// and the ROS driver dmac (src/parser.h, msg/DMACPayload.msg), for firmware 1.7 and later.
/// Firmware 1.6 has one more field in RECVIM; its messages are refused, never misread.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

namespace icat {

/// Kinds of answers.
enum class ModemAnswerKind : std::uint8_t {
  ok,              ///< the last command was taken
  busy,            ///< it was not, but may be later
  error,           ///< it was refused
  message,         ///< an instant message came
  delivered,       ///< the receiver has acknowledged ours
  failed,          ///< it has not
  canceled,        ///< the modem has dropped ours
  send_start,      ///< the modem transmits
  send_end,        ///< no more
  receive_start,   ///< a signal arrives
  receive_end,     ///< no more
  receive_failed,  ///< it could not be decoded
  other,           ///< any other line
};

/// One answer. Plain data; `data` is valid until the parser is fed again.
struct ModemAnswer {
  ModemAnswerKind kind{ModemAnswerKind::other};  ///< which of the fields below count
  int source{-1};                                ///< modem address 0 … 255 of a message
  int destination{-1};  ///< of a message, or of ours that was delivered, failed or canceled
  double duration{0};   ///< s on air, of a message
  double rssi{0};       ///< dB re 1 V, of a message
  int integrity{0};     ///< of its signal; above 100 counts as good [dmac, DMACPayload.msg]
  double velocity{0};   ///< m/s, relative, of a message
  std::span<const std::byte> data{};  ///< of a message; else the line without CR LF
};

namespace detail::modem {

/// Digits, perhaps with a sign: false where there is anything else, or it is out of range.
inline bool integer(std::string_view text, long long low, long long high,
                    long long& value) noexcept {
  const bool negative = !text.empty() && text.front() == '-';
  if (negative) text.remove_prefix(1);
  if (text.empty() || text.size() > 10) return false;
  long long sum = 0;
  for (const char c : text) {
    if (c < '0' || c > '9') return false;
    sum = 10 * sum + (c - '0');
  }
  if (negative) sum = -sum;
  if (sum < low || sum > high) return false;
  value = sum;
  return true;
}
/// Digits with at most one point, perhaps with a sign, ±`limit`. The standard's functions depend on
/// the locale or may allocate.
inline bool real(std::string_view text, double limit, double& value) noexcept {
  const bool negative = !text.empty() && text.front() == '-';
  if (negative) text.remove_prefix(1);
  if (text.empty() || text.size() > 15) return false;
  double sum = 0, unit = 1;
  bool point = false, digits = false;
  for (const char c : text) {
    if (c == '.' && !point) {
      point = true;
    } else if (c >= '0' && c <= '9') {
      sum = 10 * sum + (c - '0');
      if (point) unit *= 10;
      digits = true;
    } else {
      return false;
    }
  }
  if (!digits || sum / unit > limit) return false;
  value = negative ? -sum / unit : sum / unit;
  return true;
}

/// A name of the protocol and how its line goes on.
struct BinaryAnswer {
  std::string_view name;  // with the comma
  std::size_t fields;     // between the length and the data
};
inline constexpr BinaryAnswer binary_answers[] = {
    {"RECVIM,", 7}, {"RECVIMS,", 7}, {"RECVPBM,", 6}, {"RECV,", 7}};

struct LineAnswer {
  std::string_view begin;
  ModemAnswerKind kind;
};
// ERROR EFAULT and ERROR OVERLOAD are reports of the hardware, no answers to a command.
inline constexpr LineAnswer line_answers[] = {
    {"OK", ModemAnswerKind::ok},
    {"[*]OK", ModemAnswerKind::ok},
    {"BUSY", ModemAnswerKind::busy},
    {"ERROR EFAULT", ModemAnswerKind::other},
    {"ERROR OVERLOAD", ModemAnswerKind::other},
    {"ERROR", ModemAnswerKind::error},
    {"DELIVEREDIM,", ModemAnswerKind::delivered},
    {"FAILEDIM,", ModemAnswerKind::failed},
    {"CANCELEDIM,", ModemAnswerKind::canceled},
    {"CANCELLEDIM,", ModemAnswerKind::canceled},
    {"SENDSTART,", ModemAnswerKind::send_start},
    {"SENDEND,", ModemAnswerKind::send_end},
    {"RECVSTART", ModemAnswerKind::receive_start},
    {"RECVEND,", ModemAnswerKind::receive_end},
    {"RECVFAILED,", ModemAnswerKind::receive_failed},
};

}  // namespace detail::modem

/// See the file comment. No allocation at all.
class ModemParser {
 public:
  /// Longest data of a message that is read; instant messages have at most 64.
  static constexpr std::size_t max_data = 1024;

  /// Takes `bytes` as they came and calls `each(answer)` for every answer that is complete.
  /// Anything else is skipped up to the next end of a line, and counted.
  template <class Each>
  void feed(std::span<const std::byte> bytes, Each&& each) noexcept {
    while (!bytes.empty()) {
      const std::size_t n = std::min(bytes.size(), buffer_.size() - size_);
      std::memcpy(buffer_.data() + size_, bytes.data(), n);
      size_ += n;
      bytes = bytes.subspan(n);
      parse(each);
      if (size_ == buffer_.size()) give_up(each);
    }
  }
  /// What is incomplete will never be complete: it is skipped up to the next end of a line, and
  /// what stands behind that is read. For a stream that was silent too long.
  template <class Each>
  void give_up(Each&& each) noexcept {
    if (size_ == 0) return;
    skips_ = true;
    ++malformed_;
    parse(each);
  }
  /// Forgets what is incomplete.
  void reset() noexcept {
    size_ = 0;
    skips_ = false;
  }
  /// Whether an answer is incomplete.
  bool incomplete() const noexcept { return size_ > 0; }
  /// How often something was skipped; wraps around.
  std::uint32_t malformed() const noexcept { return malformed_; }

 private:
  static constexpr std::size_t more = 0, bad = static_cast<std::size_t>(-1);
  static constexpr std::size_t longest_header = 128;

  template <class Each>
  void parse(Each& each) noexcept {
    std::size_t at = 0;
    while (at < size_) {
      const std::string_view text(buffer_.data() + at, size_ - at);
      if (skips_) {
        const std::size_t end = text.find("\r\n");
        if (end == text.npos) {
          at = size_ - (text.ends_with('\r') ? 1 : 0);  // its LF may come
          break;
        }
        at += end + 2;
        skips_ = false;
        continue;
      }
      ModemAnswer answer;
      bool speaks = false;
      const std::size_t used = frame(text, true, answer, speaks);
      if (used == more) break;
      if (used == bad) {
        skips_ = true;
        ++malformed_;
        continue;
      }
      if (speaks) each(static_cast<const ModemAnswer&>(answer));
      at += used;
    }
    skip(at);
  }
  void skip(std::size_t n) noexcept {
    std::memmove(buffer_.data(), buffer_.data() + n, size_ - n);
    size_ -= n;
  }
  /// How many characters at the front of `text` are the first answer, with its CR LF; `speaks`
  /// where it says something. `more` where it is incomplete, `bad` where it is none.
  std::size_t frame(std::string_view text, bool may_be_wrapped, ModemAnswer& answer,
                    bool& speaks) noexcept {
    if (may_be_wrapped && text.starts_with("+++AT")) return wrapped(text, answer, speaks);
    for (const auto& known : detail::modem::binary_answers) {
      if (text.starts_with(known.name)) return binary(text, known, answer, speaks);
    }
    const std::size_t end = text.find("\r\n");
    if (end == text.npos) return more;
    const std::string_view whole = text.substr(0, end);
    // Behind noise a wrapped answer may begin in the middle of a line.
    if (const auto at = whole.find("+++AT"); may_be_wrapped && at != whole.npos) return at;
    line(whole, answer);
    speaks = !whole.empty();
    return end + 2;
  }
  std::size_t wrapped(std::string_view text, ModemAnswer& answer, bool& speaks) noexcept {
    std::string_view head = text.substr(0, longest_header);
    const auto line_end = head.find("\r\n");
    head = head.substr(0, line_end);  // no further, whatever has come already
    for (auto colon = head.find(':'); colon != head.npos; colon = head.find(':', colon + 1)) {
      const auto second = head.find(':', colon + 1);
      if (second == head.npos) break;
      long long length = 0;
      if (!detail::modem::integer(head.substr(colon + 1, second - colon - 1), 1,
                                  max_data + longest_header, length)) {
        continue;
      }
      const std::size_t begin = second + 1, size = static_cast<std::size_t>(length) + 2;
      if (text.size() < begin + size) return more;
      const std::string_view body = text.substr(begin, size);
      if (!body.ends_with("\r\n")) return bad;
      if (frame(body, false, answer, speaks) != size) {
        // An answer of several lines, none of ours.
        speaks = false;
        ++malformed_;
      }
      return begin + size;
    }
    return text.size() < longest_header && line_end == text.npos ? more : bad;
  }
  std::size_t binary(std::string_view text, const detail::modem::BinaryAnswer& known,
                     ModemAnswer& answer, bool& speaks) noexcept {
    const std::string_view head = text.substr(0, longest_header);
    std::array<std::string_view, 9> fields;  // the length, and up to 7
    std::size_t count = 0, at = known.name.size();
    while (count < known.fields + 1) {
      const std::size_t comma = head.find(',', at);
      const std::string_view field = head.substr(at, comma - at);
      if (field.find('\r') != field.npos) return bad;
      if (comma == head.npos) return head.size() < longest_header ? more : bad;
      at = comma + 1;
      if (count == 0 && field.starts_with('p')) continue;  // the protocol's number
      fields[count++] = field;
    }
    long long length = 0;
    if (!detail::modem::integer(fields[0], 0, max_data, length)) return bad;
    const std::size_t size = static_cast<std::size_t>(length);
    if (text.size() < at + size + 2) return more;
    if (text.substr(at + size, 2) != "\r\n") return bad;
    if (known.name == "RECVIM,") {
      answer.data = std::as_bytes(std::span(text.data() + at, size));
      speaks = message(fields, answer);
      if (!speaks) ++malformed_;
    }
    return at + size + 2;
  }
  static bool message(const std::array<std::string_view, 9>& fields, ModemAnswer& answer) noexcept {
    using namespace detail::modem;  // NOLINT
    long long source = 0, destination = 0, microseconds = 0, quality = 0;
    const std::string_view flag = fields[3];
    if (!integer(fields[1], 0, 255, source) || !integer(fields[2], 0, 255, destination) ||
        (flag != "ack" && flag != "noack" && flag != "force") ||
        !integer(fields[4], 0, 1'000'000'000, microseconds) || !real(fields[5], 1e6, answer.rssi) ||
        !integer(fields[6], 0, 1'000'000, quality) || !real(fields[7], 1e6, answer.velocity)) {
      return false;
    }
    answer.kind = ModemAnswerKind::message;
    answer.source = static_cast<int>(source);
    answer.destination = static_cast<int>(destination);
    answer.duration = 1e-6 * static_cast<double>(microseconds);
    answer.integrity = static_cast<int>(quality);
    return true;
  }
  static void line(std::string_view text, ModemAnswer& answer) noexcept {
    answer.data = std::as_bytes(std::span(text.data(), text.size()));
    for (const auto& known : detail::modem::line_answers) {
      if (!text.starts_with(known.begin)) continue;
      const std::string_view rest = text.substr(known.begin.size());
      long long address = -1;
      if (known.begin.ends_with("IM,")) {
        if (!detail::modem::integer(rest, 0, 255, address)) return;
      } else if (known.kind == ModemAnswerKind::ok && !rest.empty()) {
        return;
      }
      answer.destination = static_cast<int>(address);
      answer.kind = known.kind;
      return;
    }
  }

  std::array<char, max_data + 2 * longest_header + 512> buffer_{};
  std::size_t size_{0};
  bool skips_{false};  // up to the next end of a line
  std::uint32_t malformed_{0};
};

}  // namespace icat
