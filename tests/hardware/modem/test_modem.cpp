// SPDX-License-Identifier: BSD-3-Clause
// What a modem says, messages cut into parts, and the adapter against a modem that follows a
// script. The exchanges are typed from public sources, named where they stand.
#include <gtest/gtest.h>

#include <icat/adapters/acoustic_modem.hpp>
#include <random>
#include <string>
#include <vector>

#include "tests/support/allocation_counter.hpp"

namespace {

using icat::AcousticModem;
using icat::ModemAnswer;
using icat::ModemParser;
using icat::Status;
using Kind = icat::ModemAnswerKind;
using Options = AcousticModem::Options;
namespace modem = icat::detail::modem;

std::span<const std::byte> bytes(const std::string& text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}
std::string text(std::span<const std::byte> b) {
  return {reinterpret_cast<const char*>(b.data()), b.size()};
}

// One line for each answer: "kind source>destination duration rssi integrity velocity data".
std::string told(const ModemAnswer& a) {
  std::string line = std::to_string(static_cast<int>(a.kind)) + " " + std::to_string(a.source) +
                     ">" + std::to_string(a.destination);
  if (a.kind == Kind::message) {
    char numbers[96];
    std::snprintf(numbers, sizeof numbers, " %.6f %g %d %g", a.duration, a.rssi, a.integrity,
                  a.velocity);
    line += numbers;
  }
  return line + " " + text(a.data);
}
std::vector<std::string> answers(ModemParser& parser, const std::string& stream) {
  std::vector<std::string> all;
  parser.feed(bytes(stream), [&](const ModemAnswer& a) { all.push_back(told(a)); });
  return all;
}
// Fed whole, byte by byte, and cut anywhere into two.
std::vector<std::string> answers(const std::string& stream) {
  ModemParser whole;
  const auto all = answers(whole, stream);
  for (std::size_t cut = 0; cut <= stream.size(); ++cut) {
    ModemParser parser;
    auto parts = answers(parser, stream.substr(0, cut));
    for (auto& a : answers(parser, stream.substr(cut))) parts.push_back(a);
    EXPECT_EQ(parts, all) << cut;
  }
  ModemParser parser;
  std::vector<std::string> single;
  for (const char c : stream) {
    for (auto& a : answers(parser, std::string(1, c))) single.push_back(a);
  }
  EXPECT_EQ(single, all);
  return all;
}
std::string line(Kind kind, const std::string& rest) {
  return std::to_string(static_cast<int>(kind)) + " " + rest;
}
using Lines = std::vector<std::string>;

// The forms that EviNS, the manufacturer's own software, lists and parses (src/role_at.erl:
// answer_split, recv_extract_helper, delivered_extract, sendstart_extract, …).
TEST(ModemParser, ReadsTheFormsOfEviNS) {
  EXPECT_EQ(answers("OK\r\n"), Lines{line(Kind::ok, "-1>-1 OK")});
  EXPECT_EQ(answers("ERROR WRONG FORMAT\r\n"),
            Lines{line(Kind::error, "-1>-1 ERROR WRONG FORMAT")});
  EXPECT_EQ(answers("BUSY BACKOFF STATE\r\n"), Lines{line(Kind::busy, "-1>-1 BUSY BACKOFF STATE")});
  EXPECT_EQ(
      answers("DELIVEREDIM,2\r\nFAILEDIM,3\r\nCANCELEDIM,254\r\n"),
      (Lines{line(Kind::delivered, "-1>2 DELIVEREDIM,2"), line(Kind::failed, "-1>3 FAILEDIM,3"),
             line(Kind::canceled, "-1>254 CANCELEDIM,254")}));
  EXPECT_EQ(answers("SENDSTART,2,im,140983,0\r\nSENDEND,2,im,1142208916,140983\r\nRECVSTART\r\n"
                    "RECVEND,1142329880,99999,-45,180\r\nRECVFAILED,0.02,-75,20\r\n"),
            (Lines{line(Kind::send_start, "-1>-1 SENDSTART,2,im,140983,0"),
                   line(Kind::send_end, "-1>-1 SENDEND,2,im,1142208916,140983"),
                   line(Kind::receive_start, "-1>-1 RECVSTART"),
                   line(Kind::receive_end, "-1>-1 RECVEND,1142329880,99999,-45,180"),
                   line(Kind::receive_failed, "-1>-1 RECVFAILED,0.02,-75,20")}));
  // RECVIM[,p<pid>],len,src,dst,flag,dur,rssi,int,vel,data
  const std::string data("a,b\r\nOK\r\nRECVIM,3,\0,x", 22);
  const std::string said = line(Kind::message, "1>2 0.140983 -45 180 -0.05 ") + data;
  const std::string tail = "22,1,2,noack,140983,-45,180,-0.05," + data + "\r\n";
  EXPECT_EQ(answers("RECVIM," + tail), Lines{said});
  EXPECT_EQ(answers("RECVIM,p0," + tail), Lines{said});
  // Of a message of another kind, nothing of which is taken for an answer.
  EXPECT_EQ(answers("RECV,6,1,2,976,-45,180,1000,0.1,OK\r\nOK\r\nOK\r\n").size(), 1u);
  EXPECT_EQ(answers("RECVPBM,6,1,2,976,-45,180,0.1,OK\r\nOK\r\nOK\r\n").size(), 1u);
  EXPECT_EQ(answers("RECVIMS,6,1,2,12345,976,-45,180,0.1,OK\r\nOK\r\nOK\r\n").size(), 1u);
  // Reports of the hardware that answer no command.
  EXPECT_EQ(answers("ERROR OVERLOAD\r\n"), Lines{line(Kind::other, "-1>-1 ERROR OVERLOAD")});
}

// The example in the tests of the Rock project's driver (drivers-usbl_evologics), in data mode.
TEST(ModemParser, ReadsTheExampleOfRock) {
  const std::string data("\x31\x32\x01\x00\x35", 5);
  EXPECT_EQ(answers("+++AT:37:RECVIM,5,1,2,ack,312,14,11,0.03," + data + "\r\n"),
            Lines{line(Kind::message, "1>2 0.000312 14 11 0.03 ") + data});
}
// From the log of a modem in the readme of dmac2, a ROS 2 driver, and as DUNE reads OK.
TEST(ModemParser, ReadsTheAnswersOfAModem) {
  EXPECT_EQ(answers("+++AT?MODE:2:AT\r\n"), Lines{line(Kind::other, "-1>-1 AT")});
  EXPECT_EQ(answers("+++AT@CTRL:2:OK\r\n[*]OK\r\n"),
            (Lines{line(Kind::ok, "-1>-1 OK"), line(Kind::ok, "-1>-1 [*]OK")}));
}

TEST(ModemParser, GoesOnBehindWhatIsNoAnswer) {
  const std::string good = "RECVIM,3,1,2,ack,1000,-45,180,0.1,abc\r\n";
  const std::string said = line(Kind::message, "1>2 0.001000 -45 180 0.1 abc");
  for (const std::string bad :
       {"\x80\xff,\n\r", "RECVIM,\r\n", "RECVIM,9999,1,2,ack,1,1,1,1,x\r\n",
        "RECVIM,-1,1,2,ack,1,1,1,1,x\r\n", "RECVIM,3,1,2,ack,1000,-45,180,0.1,ab\r\n",
        "RECVIM,3,1,2,ack,1000,-45,180,0.1,abcd\r\n", "RECVIM,3,1,2,perhaps,1,1,1,1,abc\r\n",
        "RECVIM,3,256,2,ack,1,1,1,1,abc\r\n", "RECVIM,3,1,2,ack,1,nan,1,1,abc\r\n",
        "RECVIM,3,1,2,ack,1,1,1e9,1,abc\r\n", "RECVIM,3,1,2,ack,1,1,1,1.2.3,abc\r\n",
        "RECVIM,3,1,2\r\n", "+++AT:9999:x\r\n", "+++AT:5:RECVIM\r\n", "+++AT:12:RECVIM,3,1,2\r\n",
        "DELIVEREDIM,two\r\n", "DELIVEREDIM,\r\n", "OKAY\r\n", "\r\n"}) {
    ModemParser parser;
    Lines all = answers(parser, bad + "\r\n" + good + good);
    std::erase_if(all, [](const std::string& l) { return l.starts_with("12 "); });  // other lines
    EXPECT_EQ(all, (Lines{said, said})) << bad;
  }
  // Firmware 1.6 has one more number before the data.
  EXPECT_TRUE(answers("RECVIM,3,1,2,ack,1000,-45,180,1000,0.1,abc\r\n").empty());
  // The head of a wrapped answer ends with its line, whatever has come behind it (a find of the
  // fuzzer's).
  EXPECT_EQ(answers("+++AT@CTRL1\r\nBUSY AT@CTRL:2:OK\r\n").size(), 1u);
  // Noise without end.
  ModemParser parser;
  std::mt19937 random(1);
  for (int k = 0; k < 100; ++k) {
    std::string noise(100, ' ');
    for (char& c : noise) c = static_cast<char>(32 + random() % 90);
    EXPECT_TRUE(answers(parser, noise).empty());
  }
  EXPECT_EQ(answers(parser, "\r\n" + good).back(), said);
  EXPECT_GT(parser.malformed(), 0u);
}

TEST(ModemParser, GivesUpWhatWillNotBeComplete) {
  ModemParser parser;
  EXPECT_TRUE(answers(parser, "RECVIM,60,1,2,ack,1000,-45,180,0.1,ab\r\nOK\r\n").empty());
  EXPECT_TRUE(parser.incomplete());
  Lines all;
  parser.give_up([&](const ModemAnswer& a) { all.push_back(told(a)); });
  EXPECT_EQ(all, Lines{line(Kind::ok, "-1>-1 OK")});
  EXPECT_FALSE(parser.incomplete());
}

std::string message(std::size_t size, int seed = 0) {
  std::string m(size, ' ');
  for (std::size_t k = 0; k < size; ++k) {
    m[k] = static_cast<char>(k * 37 + static_cast<std::size_t>(seed) * 101);
  }
  return m;
}
std::vector<std::string> parts(const std::string& m, std::int32_t round, std::uint8_t agent = 1) {
  std::vector<std::string> all;
  std::uint16_t crc = 0xffff;
  for (std::size_t i = 0; i < modem::part_count(m.size()); ++i) {
    std::array<std::byte, modem::max_part> part;
    const std::size_t n = modem::encode_part(agent, round, bytes(m), i, crc, part);
    all.push_back(text(std::span<const std::byte>(part).first(n)));
  }
  return all;
}
using modem::PartResult;

TEST(ModemParts, HaveTheSizesOfThePage) {
  EXPECT_EQ(modem::crc16(bytes("123456789")), 0x29b1);  // the check value of CRC-16/CCITT-FALSE
  ASSERT_EQ(parts(message(24), 7).size(), 1u);
  EXPECT_EQ(parts(message(24), 7)[0].size(), 32u);
  EXPECT_EQ(parts(message(168), 7).size(), 3u);
  for (const auto& p : parts(message(168), 7)) EXPECT_EQ(p.size(), 64u);
  EXPECT_EQ(parts(message(172), 7).size(), 4u);  // spans and difficulties
  EXPECT_EQ(parts(message(24), -2, 5)[0].substr(0, 6), std::string("\xa0\x05\xfe\xff\xff\xff", 6));
}
TEST(ModemParts, ComeTogetherAgain) {
  for (std::size_t size = 1; size <= icat::ModemMessage::max_size; ++size) {
    modem::Reassembly reassembly;
    icat::ModemMessage out;
    for (const int round : {-2147483647 - 1, -1, 0, 2147483647}) {
      const std::string m = message(size, round & 0xff);
      const auto all = parts(m, round);
      for (std::size_t i = 0; i < all.size(); ++i) {
        ASSERT_EQ(reassembly.put(1, bytes(all[i]), out),
                  i + 1 < all.size() ? PartResult::kept : PartResult::complete);
        ASSERT_EQ(reassembly.missing(), all.size() - 1 - i);
      }
      EXPECT_EQ(text(out.bytes()), m);
      EXPECT_EQ(out.round, round);
      EXPECT_EQ(out.agent, 1u);
    }
  }
}
// Parts lost, doubled, swapped and of two messages of one round: whatever comes out was sent whole.
TEST(ModemParts, OfTwoMessagesNeverMakeOne) {
  std::mt19937 random(3);
  int complete = 0, doubled = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    modem::Reassembly reassembly;
    icat::ModemMessage out;
    std::vector<std::string> sent, stream;
    for (int k = 0; k < 4; ++k) {
      sent.push_back(message(random() % 2 ? 168 : 172, trial + k));
      for (const auto& p : parts(sent.back(), static_cast<int>(random() % 2))) {
        if (random() % 4 > 0) stream.push_back(p);
        if (random() % 8 == 0) stream.push_back(p);
      }
    }
    if (random() % 2) std::swap(stream[random() % stream.size()], stream[random() % stream.size()]);
    for (const auto& p : stream) {
      const PartResult result = reassembly.put(1, bytes(p), out);
      doubled += result == PartResult::doubled;
      if (result != PartResult::complete) continue;
      ++complete;
      ASSERT_NE(std::find(sent.begin(), sent.end(), text(out.bytes())), sent.end());
    }
  }
  EXPECT_GT(complete, 1000);
  EXPECT_GT(doubled, 1000);
}
TEST(ModemParts, WithAWrongBitAreRefused) {
  for (const std::size_t size : {std::size_t{24}, std::size_t{168}}) {
    const auto all = parts(message(size), 9);
    for (std::size_t i = 0; i < all.size(); ++i) {
      for (std::size_t bit = 0; bit < 8 * all[i].size(); ++bit) {
        modem::Reassembly reassembly;
        icat::ModemMessage out;
        for (std::size_t k = 0; k < i; ++k) (void)reassembly.put(1, bytes(all[k]), out);
        std::string wrong = all[i];
        wrong[bit / 8] = static_cast<char>(wrong[bit / 8] ^ (1 << (bit % 8)));
        const PartResult result = reassembly.put(1, bytes(wrong), out);
        ASSERT_TRUE(result == PartResult::damaged || result == PartResult::foreign)
            << i << " " << bit;
        // What was begun is left: there is one chance in 65536 for a wrong part, not many.
        if (result == PartResult::damaged && i > 0) {
          ASSERT_EQ(reassembly.put(1, bytes(all[i]), out), PartResult::damaged);
        }
      }
      for (std::size_t n = 0; n < all[i].size(); ++n) {
        modem::Reassembly reassembly;
        icat::ModemMessage out;
        for (std::size_t k = 0; k < i; ++k) (void)reassembly.put(1, bytes(all[k]), out);
        const PartResult result = reassembly.put(1, bytes(all[i].substr(0, n)), out);
        ASSERT_TRUE(result == PartResult::damaged || result == PartResult::foreign)
            << i << " " << n;
      }
    }
  }
}

// A modem that says what the test lets it say.
struct Script {
  bool open(double) noexcept { return up; }
  bool is_open() const noexcept { return up; }
  std::uint32_t openings() const noexcept { return opened; }
  std::size_t read(std::span<std::byte> b) noexcept {
    const std::size_t n = std::min(b.size(), says.size());
    std::memcpy(b.data(), says.data(), n);
    says.erase(0, n);
    return n;
  }
  std::size_t write(std::span<const std::byte> b) noexcept {
    const std::size_t n = std::min(b.size(), at_once);
    heard.append(reinterpret_cast<const char*>(b.data()), n);
    return n;
  }
  bool up{true};
  std::uint32_t opened{1};
  std::size_t at_once{1000};
  std::string says, heard;
};
struct Desk {
  explicit Desk(const Options& options) : modem(options) {}
  // Cycles of 5 ms; what the modem heard in them.
  std::string run(double seconds, const std::string& says = "") {
    script.says += says;
    script.heard.clear();
    for (const double end = time + seconds - 1e-9; time < end; time += 0.005) {
      modem.exchange(script, time);
    }
    return script.heard;
  }
  AcousticModem modem;
  Script script;
  double time{100};
};
const Options plain{.setup = {}};
std::string command(const std::string& part, const char* flag = "noack") {
  return "AT*SENDIM," + std::to_string(part.size()) + ",2," + flag + "," + part + "\n";
}
std::string received(const std::string& part, int source = 2, int destination = 1,
                     int integrity = 180) {
  return "RECVIM," + std::to_string(part.size()) + "," + std::to_string(source) + "," +
         std::to_string(destination) + ",noack,362295,-45," + std::to_string(integrity) + ",0.02," +
         part + "\r\n";
}

TEST(AcousticModem, SetsUpAndSpeaks) {
  Desk desk({});
  EXPECT_EQ(desk.run(0.1), "AT@CTRL\n");
  EXPECT_FALSE(desk.modem.ready());
  EXPECT_EQ(desk.run(0.1, "OK\r\n"), "AT@ZX1\n");
  EXPECT_EQ(desk.run(0.1, "ERROR UNKNOWN COMMAND\r\n"), "");  // works without
  EXPECT_EQ(desk.modem.last_refusal(), "ERROR UNKNOWN COMMAND");
  EXPECT_TRUE(desk.modem.healthy());
  ASSERT_TRUE(desk.modem.ready());
  const std::string m = message(24);
  ASSERT_EQ(desk.modem.send(7, bytes(m)), Status::ok);
  EXPECT_FALSE(desk.modem.ready());
  EXPECT_EQ(desk.run(0.1), command(parts(m, 7, 0)[0]));
  EXPECT_EQ(desk.run(0.1, "OK\r\n"), "");
  EXPECT_EQ(desk.modem.counts().sent, 0u);
  // 0.1 s and 256 bits at 976 bit/s; then it is the other one's turn.
  desk.run(0.3);
  EXPECT_EQ(desk.modem.counts().sent, 1u);
  EXPECT_FALSE(desk.modem.ready());
  desk.run(1.4 * desk.modem.message_time());
  EXPECT_FALSE(desk.modem.ready());
  desk.run(0.2 * desk.modem.message_time());
  EXPECT_TRUE(desk.modem.ready());  // nothing was heard
  // A modem that says nothing more.
  EXPECT_TRUE(desk.modem.healthy());
  desk.run(6);
  EXPECT_FALSE(desk.modem.healthy());
}
TEST(AcousticModem, SpeaksAfterTheOther) {
  Desk desk({.addresses = {2, 1}, .index = 1, .setup = {}});
  desk.run(0.3);
  EXPECT_FALSE(desk.modem.ready());  // agent 0 begins
  const std::string m = message(24), part = parts(m, 3, 0)[0];
  desk.run(0.01, received(part));
  const icat::ModemMessage* heard = desk.modem.take(0);
  ASSERT_TRUE(heard);
  EXPECT_EQ(text(heard->bytes()), m);
  EXPECT_EQ(heard->round, 3);
  EXPECT_EQ(heard->source, 2);
  EXPECT_NEAR(heard->duration, 0.362295, 1e-9);
  EXPECT_EQ(heard->integrity, 180);
  EXPECT_TRUE(heard->newer);
  EXPECT_NEAR(desk.modem.last(0).age(desk.time), 0.01, 0.006);
  EXPECT_FALSE(desk.modem.take(0));
  EXPECT_FALSE(desk.modem.take(1));
  EXPECT_FALSE(desk.modem.take(9));
  desk.run(0.02);
  EXPECT_TRUE(desk.modem.ready());
  // While something arrives nobody speaks.
  desk.run(0.05, "RECVSTART\r\n");
  EXPECT_FALSE(desk.modem.ready());
  desk.run(0.05, "RECVFAILED,0.02,-75,20\r\n");
  EXPECT_TRUE(desk.modem.ready());
  // The same again is no news; an older one is, and says that it is older.
  desk.run(0.01, received(part));
  EXPECT_FALSE(desk.modem.take(0));
  EXPECT_EQ(desk.modem.counts().doubled, 1u);
  desk.run(0.01, received(parts(m, 2, 0)[0]));
  ASSERT_TRUE((heard = desk.modem.take(0)));
  EXPECT_FALSE(heard->newer);
}
TEST(AcousticModem, OfThreeSpeakInTheirOrder) {
  const Options options{.addresses = {11, 12, 13}, .index = 0, .setup = {}};
  Desk desk(options);
  desk.run(0.01);
  ASSERT_EQ(desk.modem.send(1, bytes(message(24))), Status::ok);
  EXPECT_EQ(desk.run(0.05).substr(0, 17), "AT*SENDIM,32,255,");
  desk.run(0.5, "OK\r\n");
  // Agent 1 was heard: agent 2 is next, and has a message's time.
  desk.run(0.1, received(parts(message(24), 1, 1)[0], 12, 255));
  EXPECT_FALSE(desk.modem.ready());
  EXPECT_TRUE(desk.modem.take(1));
  desk.run(0.05, received(parts(message(24), 1, 2)[0], 13, 255));
  EXPECT_TRUE(desk.modem.take(2));
  EXPECT_TRUE(desk.modem.ready());
}
TEST(AcousticModem, TakesNothingThatIsNotRightAndForIt) {
  Desk desk(plain);
  const std::string m = message(24), part = parts(m, 3)[0];
  std::string wrong = part;
  wrong[10] ^= 1;
  for (const std::string& said :
       {received(wrong), received(part, 3), received(part, 1), received(part, 2, 7),
        received(part, 2, 1, 60), received(part.substr(0, 31)), received("hello"), received(""),
        received(parts(m, 3, 0)[0])}) {
    desk.run(0.01, said);
    EXPECT_FALSE(desk.modem.take(1));
    EXPECT_EQ(desk.modem.last(1).count, 0u);
  }
  const auto& counts = desk.modem.counts();
  EXPECT_EQ(counts.damaged, 2u);
  EXPECT_EQ(counts.weak, 1u);
  EXPECT_EQ(counts.foreign, 6u);
  desk.run(0.01, received(part, 2, 255));
  EXPECT_TRUE(desk.modem.take(1));
}
TEST(AcousticModem, SendsTheNewestOnly) {
  Desk desk(plain);
  desk.run(0.01);
  for (int k = 0; k < 5; ++k) ASSERT_EQ(desk.modem.send(k, bytes(message(24, k))), Status::ok);
  EXPECT_EQ(desk.run(0.05), command(parts(message(24, 4), 4, 0)[0]));
  // Refused for now, it gives way to a newer one.
  EXPECT_EQ(desk.run(0.05, "BUSY BACKOFF STATE\r\n"), "");
  ASSERT_EQ(desk.modem.send(5, bytes(message(24, 5))), Status::ok);
  EXPECT_EQ(desk.run(0.1), command(parts(message(24, 5), 5, 0)[0]));
  // Refused for good, or not answered, it is given up.
  EXPECT_EQ(desk.run(3, "ERROR OUT OF RANGE\r\n"), "");
  ASSERT_EQ(desk.modem.send(6, bytes(message(24, 6))), Status::ok);
  EXPECT_EQ(desk.run(3), command(parts(message(24, 6), 6, 0)[0]));
  EXPECT_EQ(desk.modem.counts().busy, 1u);
  EXPECT_EQ(desk.modem.counts().refused, 1u);
  EXPECT_EQ(desk.modem.counts().unanswered, 1u);
  EXPECT_EQ(desk.modem.counts().sent, 0u);
  // Too old before its turn comes.
  desk.run(0.01, "RECVSTART\r\n");
  Options patient = plain;
  patient.max_age = 0.3;
  Desk other(patient);
  other.run(0.01, "RECVSTART\r\n");
  ASSERT_EQ(other.modem.send(1, bytes(message(24))), Status::ok);
  EXPECT_EQ(other.run(2), "");
  EXPECT_EQ(other.modem.counts().expired, 1u);
  EXPECT_TRUE(other.modem.ready());
}
TEST(AcousticModem, CutsWhatIsLongAndKeepsItTogether) {
  Options options = plain;
  options.message_size = 168;
  Desk desk(options);
  desk.script.at_once = 7;  // the system takes a few bytes at a time
  desk.run(0.01);
  const std::string m = message(168, 1);
  const auto all = parts(m, 4, 0);
  ASSERT_EQ(desk.modem.send(4, bytes(m)), Status::ok);
  EXPECT_EQ(desk.run(0.1), command(all[0]));
  // A newer one does not come between its parts.
  ASSERT_EQ(desk.modem.send(5, bytes(message(168, 2))), Status::ok);
  EXPECT_EQ(desk.run(0.1, "OK\r\nSENDSTART,2,im,624590,0\r\n"), "");
  EXPECT_EQ(desk.run(0.1, "SENDEND,2,im,1,624590\r\n"), command(all[1]));
  EXPECT_EQ(desk.run(0.05, "BUSY DELIVERING INSTANT MESSAGE\r\n"), "");
  EXPECT_EQ(desk.run(0.15), command(all[1]));
  EXPECT_EQ(desk.run(0.1, "OK\r\nSENDEND,2,im,1,624590\r\n"), command(all[2]));
  EXPECT_EQ(desk.run(0.1, "OK\r\nSENDEND,2,im,1,624590\r\n"), "");
  EXPECT_EQ(desk.modem.counts().sent, 1u);

  // One whose parts find the modem busy for too long is left.
  Desk busy(options);
  busy.run(0.01);
  ASSERT_EQ(busy.modem.send(4, bytes(m)), Status::ok);
  EXPECT_EQ(busy.run(0.1), command(all[0]));
  EXPECT_EQ(busy.run(0.1, "OK\r\nSENDEND,2,im,1,624590\r\n"), command(all[1]));
  for (int k = 0; k < 60; ++k) busy.run(0.1, "BUSY DELIVERING INSTANT MESSAGE\r\n");
  EXPECT_EQ(busy.modem.counts().expired, 1u);
  busy.run(1.6 * busy.modem.message_time());
  EXPECT_TRUE(busy.modem.ready());

  Desk receiver({.addresses = {2, 1}, .index = 1, .message_size = 168, .setup = {}});
  receiver.run(0.01, received(all[0]));
  EXPECT_FALSE(receiver.modem.take(0));
  receiver.run(0.3);
  EXPECT_FALSE(receiver.modem.ready());  // there are more parts to come
  receiver.run(0.01, received(all[1]) + received(all[1], 2, 1, 120));
  receiver.run(0.05, received(all[2]));
  const icat::ModemMessage* heard = receiver.modem.take(0);
  ASSERT_TRUE(heard);
  EXPECT_EQ(text(heard->bytes()), m);
  EXPECT_NEAR(heard->duration, 3 * 0.362295, 1e-9);
  EXPECT_EQ(receiver.modem.counts().doubled, 1u);
  // One that is not acknowledged is given up whole.
  options.acknowledge = true;
  Desk asking(options);
  asking.run(0.01);
  ASSERT_EQ(asking.modem.send(4, bytes(m)), Status::ok);
  EXPECT_EQ(asking.run(0.1), command(all[0], "ack"));
  EXPECT_EQ(asking.run(1, "OK\r\nSENDSTART,2,im,1,0\r\nSENDEND,2,im,1,1\r\n"), "");
  EXPECT_EQ(asking.run(0.1, "DELIVEREDIM,2\r\n"), command(all[1], "ack"));
  EXPECT_EQ(asking.run(1, "OK\r\nFAILEDIM,2\r\n"), "");
  EXPECT_EQ(asking.modem.counts().failed, 1u);
}
TEST(AcousticModem, BeginsAnewWithEachConnection) {
  Desk desk({.mode = icat::ModemMode::data, .setup = {"AT?AL"}});
  EXPECT_EQ(desk.run(0.1), "+++AT?AL\n");
  desk.run(0.1, "+++AT?AL:1:1\r\n");
  ASSERT_TRUE(desk.modem.ready());
  ASSERT_EQ(desk.modem.send(1, bytes(message(24))), Status::ok);
  EXPECT_EQ(desk.run(0.1), "+++" + command(parts(message(24), 1, 0)[0]));
  desk.script.up = false;
  desk.run(0.1);
  EXPECT_FALSE(desk.modem.healthy());
  EXPECT_FALSE(desk.modem.ready());
  desk.script.up = true;
  ++desk.script.opened;
  EXPECT_EQ(desk.run(0.1), "+++AT?AL\n");
  EXPECT_FALSE(desk.modem.ready());
  EXPECT_EQ(desk.run(0.1, "+++AT?AL:1:1\r\n"), "");  // nothing of before is sent
  EXPECT_TRUE(desk.modem.healthy());
  EXPECT_TRUE(desk.modem.ready());
}
// Times that are none, or run backwards, cost nothing but time.
TEST(AcousticModem, AnyClockWill) {
  Desk desk(plain);
  desk.run(0.1);
  for (const double t : {double(NAN), double(INFINITY), -1e300, 1e300, 5.0, 4.0}) {
    desk.modem.exchange(desk.script, t);
  }
  EXPECT_TRUE(desk.modem.ready());
  desk.time = -1e6;
  desk.run(0.1, received(parts(message(24), 3)[0]));
  EXPECT_TRUE(desk.modem.take(1));
  EXPECT_TRUE(desk.modem.last(1).fresh(desk.time, 0.2));
  Desk lost(plain);
  lost.script.says = received(parts(message(24), 3)[0]);
  lost.modem.exchange(lost.script, NAN);
  EXPECT_TRUE(lost.modem.take(1));
  EXPECT_FALSE(lost.modem.last(1).fresh(0, 1e9));
}
TEST(AcousticModem, RefusesWhatItCannotSend) {
  Desk desk(plain);
  EXPECT_EQ(desk.modem.send(1, {}), Status::wrong_size);
  EXPECT_EQ(desk.modem.send(1, bytes(message(25))), Status::wrong_size);
  EXPECT_EQ(desk.modem.send(1LL << 31, bytes(message(24))), Status::round_out_of_range);
  EXPECT_EQ(desk.modem.send(-(1LL << 31) - 1, bytes(message(24))), Status::round_out_of_range);
  EXPECT_TRUE(desk.run(0.1).empty());
  for (const Options& bad : std::vector<Options>{
           {.addresses = {1}},
           {.addresses = {1, 1}},
           {.addresses = {0, 1}},
           {.addresses = {1, 255}},
           {.index = 2},
           {.message_size = 0},
           {.message_size = 225},
           {.addresses = {1, 2, 3}, .acknowledge = true},
           {.line_end = ' '},
           {.setup = {"ATZ0\nATZ0"}},
           {.setup = {"hello"}},
           {.setup = {"AT" + std::string(63, 'x')}},
           {.bit_rate = 0},
           {.overhead = -1},
           {.range = NAN},
           {.guard = INFINITY},
           {.silence = NAN},
       }) {
    EXPECT_THROW(AcousticModem{bad}, std::invalid_argument);
  }
}
// The longest command has room, and nothing allocates.
TEST(AcousticModem, DoesNotAllocate) {
  Desk desk(
      {.addresses = {254, 253}, .message_size = 224, .mode = icat::ModemMode::data, .setup = {}});
  const std::string m = message(224);
  desk.script.says.reserve(10000);
  desk.script.heard.reserve(10000);
  const long made = count_allocations([&] {
    for (int k = 0; k < 2000; ++k) {
      if (desk.modem.ready()) (void)desk.modem.send(k, bytes(m));
      if (k % 10 == 0)
        desk.script.says.append("OK\r\nRECVSTART\r\nRECVEND,1,1,-45,180\r\nERROR OVERLOAD\r\n");
      desk.script.heard.clear();
      desk.modem.exchange(desk.script, 0.005 * k);
    }
  });
  EXPECT_EQ(made, 0);
  EXPECT_GT(desk.modem.counts().sent, 1u);
}

}  // namespace
