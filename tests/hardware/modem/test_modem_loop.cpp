// SPDX-License-Identifier: BSD-3-Clause
// Two robots that hold one object agree over two modems and the water between them, in real time.
// The modems are modem_emulator.py, written from the public command language.
#include <gtest/gtest.h>

#include <icat/adapters/acoustic_modem.hpp>
#include <icat/adapters/byte_stream.hpp>
#include <icat/sim/channel.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <map>

#include "support/carriers.hpp"
#include "tests/hardware/support/loop.hpp"
#include "tests/hardware/support/process.hpp"

namespace {

using namespace testing_support;  // NOLINT
using hardware::Latencies;
using hardware::loop_seconds;
using hardware::Process;
using icat::AcousticModem;
using icat::ByteStream;
using icat::ModemMessage;
using icat::TcpServer;
using ModemOptions = AcousticModem::Options;

constexpr double rate = 200, distance = 15;

// The modems, at ports that they choose and keep.
struct Water {
  explicit Water(const std::string& more = "", const std::string& modems = "1:0,2:0")
      : process(command(modems, more)) {
    EXPECT_TRUE(process.wait_for("ready", 10));
    std::istringstream out(process.output());
    std::string word;
    out >> word;
    std::string fixed;
    for (int port = 0, k = 1; out >> port; ++k) {
      ports.push_back(port);
      fixed += (k > 1 ? "," : "") + std::to_string(k) + ":" + std::to_string(port);
    }
    kept = command(fixed, more);
  }
  void stop() { process.kill(); }
  // Again, at the same ports.
  std::unique_ptr<Process> again() const {
    auto other = std::make_unique<Process>(kept);
    EXPECT_TRUE(other->wait_for("ready", 10));
    return other;
  }
  static std::vector<std::string> command(const std::string& modems, const std::string& more) {
    std::vector<std::string> all{ICAT_PYTHON,  ICAT_PEERS "/modem_emulator.py", "--modems", modems,
                                 "--distance", std::to_string(distance)};
    std::istringstream words(more);
    for (std::string word; words >> word;) all.push_back(word);
    return all;
  }
  Process process;
  std::vector<int> ports;
  std::vector<std::string> kept;
};

double cpu_seconds() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// A robot with its modem.
struct Side {
  Side(std::size_t i, int port, ModemOptions options, bool spans, double hold)
      : index(i),
        holder(i == 0 ? 0.3 : 2.5, -10, way()),
        plant(holder.robot, {.q = bent_arm(), .base = holder.robot.pose(holder.robot.base())}),
        agent(holder.robot, holder.actions(), {{"carry", holder.tool}},
              {.agreement = {.index = i, .spans = spans, .hold = hold, .fade = 0.5}}),
        stream(TcpServer{"127.0.0.1", port}),
        modem(with_index(options, i)) {
    EXPECT_EQ(holder.tool.set_gain(gain), Status::ok);
  }
  // Slow, as the channel is: the tools begin at 18 mm/s.
  static Vector6 way() { return twist(0.12, -0.08, -0.1); }
  static constexpr double gain = 0.1;
  static ModemOptions with_index(ModemOptions options, std::size_t i) {
    options.index = i;
    return options;
  }
  std::size_t index;
  Holder holder;
  icat::KinematicPlant<Uvms> plant;
  UvmsAgent agent;
  ByteStream stream;
  AcousticModem modem;
};

// What a robot does in each control cycle.
//! [cycle]
icat::Status cycle(icat::Agent<Uvms>& agent, AcousticModem& modem, ByteStream& stream,
                   const Vector13& measured, std::size_t partner, double time) {
  const icat::Status proposed = agent.propose(time, measured);
  if (modem.ready()) {  // this robot's turn to speak
    const long long round = agent.agreement().next_round();
    (void)modem.send(round, agent.send(round));
  }
  modem.exchange(stream, time);
  if (const ModemMessage* heard = modem.take(partner)) {
    (void)agent.receive(partner, heard->round, heard->bytes());  // refused: counts as lost
  }
  const icat::Status stepped = agent.step(time, measured);
  return proposed == icat::Status::ok ? stepped : proposed;
}
//! [cycle]

struct Team {
  Team(const Water& water, const ModemOptions& options, bool spans = false, double hold = 2)
      : sides{std::make_unique<Side>(0, water.ports[0], options, spans, hold),
              std::make_unique<Side>(1, water.ports[1], options, spans, hold)},
        latencies(10000) {
    for (auto& s : sides) {
      EXPECT_EQ(s->agent.start("carry", hardware::now()), Status::ok);
      rounds[s->index].reserve(10000);
    }
    grip = between();
    for (auto& times : said) times.fill({-1, 0});
  }
  // Returns the allocations of the cycles.
  long run(double seconds) {
    return hardware::run_loop(rate, seconds, [&](double time) {
      const double cpu = cpu_seconds();
      for (auto& s : sides) step(*s, time);
      longest = std::max(longest, cpu_seconds() - cpu);
      drift = std::max(drift, (between().translation() - grip.translation()).norm());
      agreed += sides[0]->agent.agreement().agreed() && sides[1]->agent.agreement().agreed();
      ++cycles;
    });
  }
  void step(Side& s, double time) {
    ASSERT_EQ(s.holder.robot.update(s.plant.q(), s.plant.base()), Status::ok);
    const auto& agreement = s.agent.agreement();
    const long long next = agreement.next_round();
    const bool speaks = s.modem.ready();
    const auto& last = s.modem.last(1 - s.index);
    const std::uint32_t before = last.count;
    EXPECT_EQ(cycle(s.agent, s.modem, s.stream, s.plant.velocity(), 1 - s.index, time), Status::ok);
    if (speaks) said[s.index][static_cast<std::size_t>(next) % kept] = {next, time};
    if (last.count != before) {
      const ModemMessage& m = last.value;
      const auto& [round, since] = said[1 - s.index][static_cast<std::size_t>(m.round) % kept];
      if (round == m.round) latencies.add(time - since);
      rounds[s.index].push_back(m.round);
    }
    s.plant.step(s.agent.command(), time, 1 / rate);
  }
  // Of b's tool on a's: where it was held.
  Pose between() const {
    const auto pose = [&](std::size_t i) {
      return sides[i]->holder.robot.pose(sides[i]->holder.hand);
    };
    return pose(0).inverse() * pose(1);
  }
  // Rounds that both heard of the other.
  std::size_t complete() const {
    std::size_t n = 0;
    for (const long long r : rounds[0]) {
      n += std::find(rounds[1].begin(), rounds[1].end(), r) != rounds[1].end();
    }
    return n;
  }
  double speed(std::size_t i) const {
    return sides[i]->holder.tool_velocity(sides[i]->agent.command()).norm();
  }
  bool healthy() const { return sides[0]->modem.healthy() && sides[1]->modem.healthy(); }

  static constexpr std::size_t kept = 64;
  std::array<std::unique_ptr<Side>, 2> sides;
  Latencies latencies;
  std::array<std::array<std::pair<long long, double>, kept>, 2> said;
  std::array<std::vector<long long>, 2> rounds;
  Pose grip;
  double longest{0}, drift{0};
  long agreed{0}, cycles{0};
};
const ModemOptions near{.range = distance};

TEST(ModemLoop, TwoRobotsAgreeAtTheModemsPace) {
  Water water;
  Team team(water, near);
  const long made = team.run(loop_seconds());
  team.latencies.print("acoustic modem, 24 bytes at 976 bit/s", rate, loop_seconds(), made);
  const double round_time = team.sides[0]->modem.round_time();
  std::printf(
      "acoustic modem: %zu rounds agreed on, one takes %.2f s at least; agreed in %.0f %% of the "
      "cycles; the tools drift by %.1f mm at most; longest cycle of both robots %.2f ms of CPU\n",
      team.complete(), round_time,
      100.0 * static_cast<double>(team.agreed) / static_cast<double>(team.cycles), 1e3 * team.drift,
      1e3 * team.longest);
  EXPECT_EQ(made, 0);
  EXPECT_LT(team.longest, 1 / rate);
  // Nothing is lost here: but for the first one, the rounds follow each other without a pause.
  EXPECT_GE(static_cast<double>(team.complete()), 0.8 * (loop_seconds() - 1) / round_time - 1);
  // A message lasts 0.1 s and 256 bits at 976 bit/s, and travels for 10 ms.
  EXPECT_GT(team.latencies.quantile(0), 0.1 + 256 / 976.0 + 0.01 - 1e-3);
  EXPECT_LT(team.latencies.quantile(0.5), team.sides[0]->modem.message_time() + 0.05);
  EXPECT_TRUE(team.healthy());
  for (auto& s : team.sides) {
    EXPECT_TRUE(s->agent.agreement().agreed());
    EXPECT_EQ(s->modem.malformed(), 0u);
    EXPECT_EQ(s->modem.counts().damaged + s->modem.counts().foreign, 0u);
  }
  // One robot knows of a round when it speaks, the other when it hears that: its tool is behind by
  // a message's time, and never faster than the first one was.
  EXPECT_LT(team.drift,
            Side::gain * Side::way().norm() * 1.5 * team.sides[0]->modem.message_time());
}

TEST(ModemLoop, SpansTakeThreePartsEach) {
  Water water;
  ModemOptions options = near;
  options.message_size = 168;
  Team team(water, options, true, 6);
  const long made = team.run(loop_seconds());
  team.latencies.print("acoustic modem, 168 bytes in 3 parts at 976 bit/s", rate, loop_seconds(),
                       made);
  std::printf("acoustic modem: %zu rounds with spans agreed on, one takes %.2f s at least\n",
              team.complete(), team.sides[0]->modem.round_time());
  EXPECT_EQ(made, 0);
  EXPECT_GE(team.complete(), static_cast<std::size_t>(loop_seconds() / 5));
  EXPECT_TRUE(team.sides[0]->agent.agreement().agreed());
  EXPECT_EQ(team.sides[0]->modem.counts().damaged, 0u);
}

// The modem goes, and comes back.
TEST(ModemLoop, WithoutTheModemTheRobotsStop) {
  Water water;
  Team team(water, near);
  long made = team.run(4);
  ASSERT_TRUE(team.sides[0]->agent.agreement().agreed());
  ASSERT_TRUE(team.sides[1]->agent.agreement().agreed());
  ASSERT_GT(team.speed(0), 0.005);
  water.stop();
  made += team.run(0.1);
  EXPECT_FALSE(team.healthy());     // known at once, as TCP says it
  EXPECT_GT(team.speed(0), 0.005);  // held
  // `hold` is 2 s, the fade takes 0.5 s.
  made += team.run(2.6);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_FALSE(team.sides[i]->agent.agreement().agreed());
    EXPECT_LT(team.speed(i), 1e-9);
    EXPECT_FALSE(team.sides[i]->modem.ready());
  }
  const auto process = water.again();
  made += team.run(4);
  EXPECT_TRUE(team.healthy());
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(team.sides[i]->stream.openings(), 2u);
    EXPECT_TRUE(team.sides[i]->agent.agreement().agreed());
    EXPECT_GT(team.speed(i), 0.002);
  }
  EXPECT_EQ(made, 0);
}

// What the page shows.
TEST(ModemLoop, IsMadeInTwoLines) {
  {
    //! [modem]
    icat::ByteStream stream(icat::TcpServer{"127.0.0.1", 9200});
    icat::AcousticModem modem({.addresses = {1, 2}, .index = 0, .range = 15});
    //! [modem]
    EXPECT_FALSE(modem.healthy());
    EXPECT_NEAR(modem.round_time(), 0.80, 0.01);
  }
  {
    //! [serial]
    icat::ByteStream line(icat::SerialPort{"/dev/ttyUSB0", 19200});
    icat::AcousticModem modem({.message_size = 168, .line_end = '\r', .range = 15});
    //! [serial]
    EXPECT_FALSE(line.is_open());
    EXPECT_NEAR(modem.round_time(), 3.83, 0.01);
  }
}

// Messages of `sides` without robots, as fast as they may; what is sent is known by its round.
struct Talk {
  Talk(const Water& water, std::size_t agents, const ModemOptions& options) {
    for (std::size_t i = 0; i < agents; ++i) {
      modems.push_back(std::make_unique<AcousticModem>(Side::with_index(options, i)));
      streams.push_back(std::make_unique<ByteStream>(TcpServer{"127.0.0.1", water.ports[i]}));
    }
    size = options.message_size;
  }
  std::vector<std::byte> message(std::size_t agent, long long round) const {
    std::mt19937 random(static_cast<unsigned>(1000 * round) + static_cast<unsigned>(agent));
    std::vector<std::byte> m(size);
    for (auto& b : m) b = static_cast<std::byte>(random());
    return m;
  }
  void run(double seconds) {
    hardware::run_loop(rate, seconds, [&](double time) {
      for (std::size_t i = 0; i < modems.size(); ++i) {
        AcousticModem& modem = *modems[i];
        if (modem.ready()) {
          ++sent;
          EXPECT_EQ(modem.send(sent, message(i, sent)), Status::ok);
        }
        modem.exchange(*streams[i], time);
        for (std::size_t j = 0; j < modems.size(); ++j) {
          const ModemMessage* m = modem.take(j);
          if (!m) continue;
          ++heard;
          const auto expected = message(j, m->round);
          wrong +=
              !std::equal(expected.begin(), expected.end(), m->bytes().begin(), m->bytes().end());
        }
      }
    });
  }
  std::uint32_t sum(std::uint32_t icat::ModemCounts::*count) const {
    std::uint32_t all = 0;
    for (const auto& m : modems) all += m->counts().*count;
    return all;
  }
  std::vector<std::unique_ptr<AcousticModem>> modems;
  std::vector<std::unique_ptr<ByteStream>> streams;
  std::size_t size;
  int sent{0}, heard{0}, wrong{0};
};
// Ten times as fast as the water allows, for the sake of numbers.
const ModemOptions fast{.bit_rate = 9760, .overhead = 0.01, .range = distance};
const char* const fast_water = "--rate 9760 --overhead 0.01 ";

// A tenth of the signals is lost, a seventh arrives with a wrong bit that the modem does not
// report, every third message is told twice.
TEST(ModemLoop, BadWaterMakesMessagesFewNotWrong) {
  for (const std::size_t size : {std::size_t{24}, std::size_t{168}}) {
    Water water(std::string(fast_water) + "--loss 0.1 --damage 0.15 --hide --double 3 --seed 2");
    ModemOptions options = fast;
    options.message_size = size;
    Talk talk(water, 2, options);
    talk.run(loop_seconds() / 2);
    std::printf("acoustic modem, bad water: %d messages of %zu bytes sent, %d heard, %d wrong\n",
                talk.sent, size, talk.heard, talk.wrong);
    EXPECT_EQ(talk.wrong, 0);
    EXPECT_GT(talk.heard, 2);
    EXPECT_LT(talk.heard, talk.sent);
    EXPECT_GT(talk.sum(&icat::ModemCounts::damaged), 0u);
    EXPECT_GT(talk.sum(&icat::ModemCounts::doubled), 0u);
  }
}
TEST(ModemLoop, AcknowledgedInDataMode) {
  Water water(fast_water);
  ModemOptions options = fast;
  options.message_size = 168;
  options.acknowledge = true;
  options.mode = icat::ModemMode::data;
  Talk talk(water, 2, options);
  talk.run(3);
  std::printf("acoustic modem, acknowledged: %d messages of 168 bytes sent, %d heard\n", talk.sent,
              talk.heard);
  EXPECT_EQ(talk.wrong, 0);
  EXPECT_GT(talk.heard, 5);
  EXPECT_GE(talk.heard + 1, talk.sent);
  EXPECT_EQ(talk.sum(&icat::ModemCounts::failed), 0u);
}
TEST(ModemLoop, ThreeSpeakInTurns) {
  Water water(fast_water, "1:0,2:0,3:0");
  ModemOptions options = fast;
  options.addresses = {1, 2, 3};
  Talk talk(water, 3, options);
  talk.run(3);
  EXPECT_EQ(talk.wrong, 0);
  // Each message is heard by two, but for those at the beginning and the end.
  EXPECT_GT(talk.sent, 20);
  EXPECT_GE(talk.heard, 2 * talk.sent - 6);
}

// The same agents over the simulated channel, at the modem's pace: what the adapter costs beside
// it.
TEST(ModemLoop, CostsLittleBesideTheSimulatedChannel) {
  Water water;
  Talk talk(water, 2, near);
  Latencies modem(10000), simulated(10000);
  using Message = std::array<std::byte, 24>;
  icat::Channel<Message> channel({.rate = 1 / talk.modems[0]->message_time(),
                                  .latency = talk.modems[0]->message_time() - 0.02,
                                  .duplex = icat::Duplex::half});
  Message message{};
  int heard = 0;
  hardware::run_loop(rate, 3, [&](double time) {
    const double begin = hardware::now();
    for (std::size_t i = 0; i < 2; ++i) {
      if (talk.modems[i]->ready()) (void)talk.modems[i]->send(1, message);
      talk.modems[i]->exchange(*talk.streams[i], time);
      heard += talk.modems[i]->take(1 - i) != nullptr;
    }
    const double middle = hardware::now();
    for (int i = 0; i < 2; ++i) {
      (void)channel.send(i, time, message);
      heard += channel.receive(i, time).has_value();
    }
    modem.add(middle - begin);
    simulated.add(hardware::now() - middle);
  });
  std::printf(
      "acoustic modem: two modems cost %.1f us in the median cycle, %.1f us at p99; the "
      "simulated channel %.2f us\n",
      1e6 * modem.quantile(0.5), 1e6 * modem.quantile(0.99), 1e6 * simulated.quantile(0.5));
  EXPECT_GT(heard, 8);
  EXPECT_LT(modem.quantile(0.5), 1e-3);  // a fifth of the cycle
}

}  // namespace
