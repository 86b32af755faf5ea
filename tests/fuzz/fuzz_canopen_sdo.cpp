// SPDX-License-Identifier: BSD-3-Clause
// An SDO client: against any answers, and against a server whose frames are lost, doubled and late.
#include <algorithm>
#include <deque>
#include <vector>

#include "icat/adapters/canopen_sdo.hpp"

namespace {

using icat::CanFrame;
using icat::canopen::SdoClient;
using icat::canopen::SdoState;

void require(bool holds) {
  if (!holds) __builtin_trap();
}

struct Input {
  const std::uint8_t* data;
  std::size_t size;
  std::uint8_t next() { return size > 0 ? (--size, *data++) : std::uint8_t{0}; }
};

// What comes is whatever the input says.
void any_answers(Input in) {
  SdoClient client(1, 0.5, 32);
  double now = 0;
  while (in.size > 0) {
    const std::uint8_t what = in.next();
    if (what < 40) {
      const bool idle = client.state() != SdoState::busy;
      const bool began = client.upload(0x1008, what & 1, now);
      require(!began || idle);
    } else if (what < 80) {
      const std::vector<std::uint8_t> bytes(what - 40u, what);
      const bool began = client.download(0x1008, what & 1, bytes, now);
      require(!began || (!bytes.empty() && bytes.size() <= 32));
    } else if (what < 200) {
      CanFrame f{what < 190 ? 0x581u : what + 0x500u, 8, {}};
      if (what > 185) f.size = what % 9;
      for (auto& byte : f.data) byte = in.next();
      if (what & 1) f.data[1] = 0x08, f.data[2] = 0x10, f.data[3] &= 1;
      client.receive(f, now);
    } else if (what < 230) {
      client.send([&](const CanFrame& f) {
        require(f.id == 0x601 && f.size == 8 && !f.extended && !f.remote);
        return what > 205;
      });
    } else {
      now += (what - 230) * 0.05 - 0.1;
      client.advance(now);
    }
    require(client.data().size() <= 32);
    require(client.state() != SdoState::done || client.abort_code() == 0);
  }
  client.advance(now + 1);
  client.advance(now + 3);
  require(client.state() != SdoState::busy);
}

// A server of one object, by the book.
struct Server {
  std::vector<std::uint8_t> object, buffer;
  std::size_t moved{0};
  std::uint8_t toggle{0};
  bool uploading{false}, downloading{false};
  void take(const CanFrame& f, std::deque<CanFrame>& out) {
    CanFrame answer{0x581, 8, {}};
    const std::uint8_t c = f.data[0];
    if (c == 0x80) {
      uploading = downloading = false;
      return;
    }
    const auto abort = [&] {
      uploading = downloading = false;
      answer.data = {0x80, 0x08, 0x10, 0, 0, 0, 3, 5};
    };
    if (c == 0x40) {
      answer.data = {0x41, 0x08, 0x10, 0, static_cast<std::uint8_t>(object.size())};
      moved = 0;
      toggle = 0;
      uploading = object.size() > 4;
      downloading = false;
      if (!uploading) {
        answer.data[0] = static_cast<std::uint8_t>(0x43 | (4 - object.size()) << 2);
        std::copy(object.begin(), object.end(), answer.data.begin() + 4);
      }
    } else if (c >> 5 == 1) {
      answer.data = {0x60, 0x08, 0x10, 0};
      buffer.clear();
      toggle = 0;
      uploading = false;
      downloading = !(c & 2);
      if (c & 2) object.assign(f.data.begin() + 4, f.data.begin() + 8 - (c >> 2 & 3));
    } else if (c >> 5 == 3 && uploading && (c & 0x10) == toggle) {
      const std::size_t n = std::min<std::size_t>(7, object.size() - moved);
      std::copy_n(object.begin() + static_cast<long>(moved), n, answer.data.begin() + 1);
      moved += n;
      answer.data[0] =
          static_cast<std::uint8_t>(toggle | (7 - n) << 1 | (moved == object.size() ? 1 : 0));
      toggle ^= 0x10;
      uploading = moved < object.size();
    } else if (c >> 5 == 0 && downloading && (c & 0x10) == toggle) {
      buffer.insert(buffer.end(), f.data.begin() + 1, f.data.begin() + 8 - (c >> 1 & 7));
      answer.data[0] = static_cast<std::uint8_t>(0x20 | toggle);
      toggle ^= 0x10;
      if (c & 1) {
        object = buffer;
        downloading = false;
      }
    } else {
      abort();
    }
    out.push_back(answer);
  }
};

// A transfer that says it is done has done it, whatever the line loses, doubles or holds back.
void bad_line(Input in) {
  SdoClient client(1, 0.5, 32);
  Server server;
  std::vector<std::uint8_t> wanted(1 + in.next() % 32u);
  for (auto& byte : wanted) byte = in.next();
  server.object = wanted;
  const std::vector<std::uint8_t> other(1 + in.next() % 32u, 0xa5);
  const bool writes = in.next() & 1;
  // A frame that is held back for longer is lost: the client promises nothing for answers that come
  // later than two time-outs.
  constexpr double latest = 0.45;
  std::deque<std::pair<CanFrame, double>> there, back;
  std::deque<CanFrame> answers;
  double now = 0;
  for (int step = 0; step < 400 && in.size > 0; ++step) {
    if (client.state() != SdoState::busy) {
      writes ? client.download(0x1008, 0, other, now) : client.upload(0x1008, 0, now);
    }
    client.send([&](const CanFrame& f) { return there.emplace_back(f, now), true; });
    const auto times = [](std::uint8_t fate) {
      return (fate & 0x0c) == 0x0c ? 0 : (fate & 0x30) == 0x30 ? 2 : 1;
    };
    const std::uint8_t fate = in.next();
    while (!there.empty() && now - there.front().second > latest) there.pop_front();
    if (!there.empty() && (fate & 3) != 3) {
      for (int k = 0; k < times(fate); ++k) server.take(there.front().first, answers);
      there.pop_front();
      for (const CanFrame& f : answers) back.emplace_back(f, now);
      answers.clear();
    }
    const std::uint8_t other_fate = in.next();
    while (!back.empty() && now - back.front().second > latest) back.pop_front();
    if (!back.empty() && (other_fate & 3) != 3) {
      for (int k = 0; k < times(other_fate); ++k) client.receive(back.front().first, now);
      back.pop_front();
    }
    if (client.state() == SdoState::done) {
      if (writes) {
        require(server.object == other);
      } else {
        require(
            std::equal(wanted.begin(), wanted.end(), client.data().begin(), client.data().end()));
      }
    }
    now += other_fate >> 6 == 3 ? 0.6 : 0.01;
    client.advance(now);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const Input in{data + 1, size - 1};
  data[0] & 1 ? any_answers(in) : bad_line(in);
  return 0;
}
