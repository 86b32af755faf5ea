// SPDX-License-Identifier: BSD-3-Clause
// What a modem might say, read by the parser and followed by the adapter.
#include <cmath>
#include <cstdint>
#include <icat/adapters/acoustic_modem.hpp>
#include <vector>

namespace {

void require(bool holds) {
  if (!holds) __builtin_trap();
}
using Bytes = std::span<const std::byte>;

// Order and content of all answers.
std::uint64_t digest(icat::ModemParser& parser, Bytes bytes, std::uint64_t sum) {
  parser.feed(bytes, [&](const icat::ModemAnswer& a) {
    require(std::isfinite(a.duration) && std::isfinite(a.rssi) && std::isfinite(a.velocity));
    require(a.duration >= 0 && a.integrity >= 0);
    require(a.source >= -1 && a.source <= 255 && a.destination >= -1 && a.destination <= 255);
    require(a.data.size() <= 2048);
    if (a.kind == icat::ModemAnswerKind::message) {
      require(a.source >= 0 && a.destination >= 0 && a.data.size() <= icat::ModemParser::max_data);
    }
    sum = sum * 1099511628211u + static_cast<std::uint64_t>(a.kind) + 1;
    for (const std::byte b : a.data) sum = (sum ^ std::to_integer<unsigned>(b)) * 1099511628211u;
  });
  return sum;
}

// Says a few bytes at a time, breaks now and then, and takes a few bytes at a time.
struct Script {
  bool open(double) noexcept { return up = !(hash() % 200 == 0); }
  bool is_open() const noexcept { return up; }
  std::uint32_t openings() const noexcept { return opened; }
  std::size_t read(std::span<std::byte> b) noexcept {
    const std::size_t n = std::min({b.size(), left.size(), std::size_t{1 + hash() % 97}});
    for (std::size_t k = 0; k < n; ++k) b[k] = left[k];
    left = left.subspan(n);
    return n;
  }
  std::size_t write(Bytes b) noexcept {
    const std::size_t n = std::min(b.size(), std::size_t{hash() % 60});
    for (const std::byte c : b.first(n)) written.push_back(c);
    return n;
  }
  std::uint32_t hash() noexcept { return state = state * 1664525u + 1013904223u, state >> 16; }
  bool up{true};
  std::uint32_t opened{1}, state{1};
  Bytes left;
  std::vector<std::byte> written;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const Bytes bytes(reinterpret_cast<const std::byte*>(data), size);
  icat::ModemParser whole, single;
  const std::uint64_t together = digest(whole, bytes, 1);
  std::uint64_t apart = 1;
  for (std::size_t k = 0; k < size; ++k) apart = digest(single, bytes.subspan(k, 1), apart);
  require(together == apart);

  const unsigned choice = size > 0 ? data[0] : 0;
  icat::AcousticModem modem({.addresses = {1, 2, 3},
                             .index = choice % 3,
                             .message_size = choice & 4 ? std::size_t{168} : std::size_t{24},
                             .mode = choice & 8 ? icat::ModemMode::data : icat::ModemMode::command,
                             .max_age = 20,
                             .retry = 0.01,
                             .answer_within = 0.5});
  Script script;
  script.left = bytes;
  script.state = choice;
  const std::vector<std::byte> message(choice & 4 ? 168 : 24);
  double time = 0;
  for (int k = 0; k < 2000 && (k < 200 || !script.left.empty()); ++k) {
    time += 0.005 * (script.hash() % 64);
    if (modem.ready()) require(modem.send(k, message) == icat::Status::ok);
    require(!modem.ready());
    modem.exchange(script, time);
    for (std::size_t agent = 0; agent < 4; ++agent) {
      const icat::ModemMessage* m = modem.take(agent);
      if (!m) continue;
      require(agent < 3 && agent != choice % 3 && m->agent == agent);
      require(m->size >= 1 && m->size <= icat::ModemMessage::max_size);
      require(m->integrity >= 100 && std::isfinite(m->duration));
      require(modem.last(agent).age(time) >= 0);
    }
    require(std::isfinite(modem.message_time()) && modem.last_refusal().size() <= 63);
  }
  // Each command is whole, or cut off by the end of a connection.
  const char first = choice & 8 ? '+' : 'A';
  require(script.written.empty() || script.written[0] == static_cast<std::byte>(first));
  return 0;
}
