// SPDX-License-Identifier: BSD-3-Clause
// The channel between two agents.
#include <gtest/gtest.h>

#include <icat/sim/channel.hpp>
#include <string>
#include <vector>

#include "support/allocation_counter.hpp"

namespace {

using Channel = icat::Channel<int>;
using icat::Duplex;

struct Event {
  int receiver, sent, received;  // control steps
  bool operator==(const Event&) const = default;
};

// Both agents offer the number of the step, every step of 10 ms.
std::vector<Event> run(Channel& channel, int steps, std::array<int, 2>* sent = nullptr) {
  std::vector<Event> events;
  double time = 0;
  for (int k = 0; k < steps; ++k, time += 0.01) {
    for (int agent : {0, 1}) {
      const bool taken = channel.send(agent, time, k);
      if (sent && taken) ++(*sent)[static_cast<std::size_t>(agent)];
    }
    for (int agent : {0, 1}) {
      if (const auto m = channel.receive(agent, time)) events.push_back({agent, *m, k});
    }
  }
  return events;
}

TEST(Channel, FullDuplexWithoutLatencyGivesEveryStep) {
  Channel channel({.rate = 100});
  const auto events = run(channel, 1000);
  ASSERT_EQ(events.size(), 2000u);
  for (const Event& e : events) EXPECT_EQ(e.sent, e.received);
}

TEST(Channel, FullDuplexAtOneHertzWithOneSecondOfLatency) {
  Channel channel({.rate = 1, .latency = 1});
  const std::vector<Event> expected{{0, 0, 100},   {1, 0, 100},   {0, 100, 200},
                                    {1, 100, 200}, {0, 200, 300}, {1, 200, 300}};
  EXPECT_EQ(run(channel, 301), expected);
}

TEST(Channel, HalfDuplexAlternates) {
  Channel channel({.rate = 1, .latency = 1, .duplex = Duplex::half});
  const std::vector<Event> expected{{1, 0, 100}, {0, 100, 200}, {1, 200, 300}, {0, 300, 400}};
  EXPECT_EQ(run(channel, 401), expected);
}

TEST(Channel, LatencyLongerThanTheIntervalKeepsSeveralUnderWay) {
  Channel channel({.rate = 100, .latency = 0.255});
  const auto events = run(channel, 1000);
  ASSERT_EQ(events.size(), 2u * (1000 - 26));
  for (const Event& e : events) EXPECT_EQ(e.received - e.sent, 26);
}

TEST(Channel, WhoAsksLateGetsTheNewestThatHasArrived) {
  Channel channel({.rate = 100, .latency = 0.05});
  for (int k = 0; k <= 1000; ++k) {
    EXPECT_TRUE(channel.send(0, 0.01 * k, k));
    EXPECT_FALSE(channel.send(0, 0.01 * k + 0.001, -1)) << "the slot is used";
  }
  EXPECT_EQ(channel.receive(1, 10), 995);
  EXPECT_EQ(channel.receive(1, 10), std::nullopt);
  EXPECT_EQ(channel.receive(0, 10), std::nullopt);
  EXPECT_EQ(channel.receive(1, 11), 1000);
}

TEST(Channel, LosesTheShareItShouldAndTheSameWithTheSameSeed) {
  const auto received = [](double loss, std::uint32_t seed) {
    Channel channel({.rate = 100, .loss = loss, .seed = seed});
    std::array<int, 2> sent{};
    auto events = run(channel, 10000, &sent);
    EXPECT_EQ(sent[0], 10000);  // the sender does not know
    EXPECT_EQ(sent[1], 10000);
    return events;
  };
  // Five standard deviations, √(n p (1 − p)) each.
  EXPECT_NEAR(static_cast<double>(received(0.3, 1).size()), 14000, 5 * 65);
  EXPECT_EQ(received(0.3, 1), received(0.3, 1));
  EXPECT_NE(received(0.3, 1), received(0.3, 2));
  EXPECT_EQ(received(0, 1).size(), 20000u);
  EXPECT_EQ(received(1, 1).size(), 0u);
}

TEST(Channel, NothingAllocatesWhileItRuns) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  Channel channel({.rate = 100, .latency = 0.2, .loss = 0.1});
  int received = 0;
  EXPECT_EQ(count_allocations([&] {
              for (int k = 0; k < 100; ++k) {
                channel.send(0, 0.01 * k, k);
                channel.send(1, 0.01 * k, k);
                if (channel.receive(1, 0.01 * k)) ++received;
              }
            }),
            0);
  EXPECT_GT(received, 0);
}

TEST(Channel, ConfigurationThrowsWithNamesAndNumbers) {
  const auto message = [](const Channel::Options& options) -> std::string {
    try {
      Channel channel(options);
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "no exception";
  };
  EXPECT_EQ(message({.rate = 0}), "Channel: rate must be finite and > 0, got 0");
  EXPECT_EQ(message({.rate = 1, .latency = -1}),
            "Channel: latency must be >= 0 and below a million slots, got -1 s at 1 Hz");
  EXPECT_EQ(message({.loss = 1.5}), "Channel: loss must be in [0, 1], got 1.5");
}

}  // namespace
