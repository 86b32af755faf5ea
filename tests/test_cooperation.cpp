// SPDX-License-Identifier: BSD-3-Clause
// Message, fusion and agreement.
#include <gtest/gtest.h>

#include <Eigen/QR>
#include <icat/cooperation/agreement.hpp>
#include <limits>
#include <memory>
#include <random>

#include "support/linear_algebra.hpp"

namespace {

using Vector6 = icat::Vector6<double>;
using Matrix6 = icat::Matrix6<double>;
using icat::Status;

// --- message -------------------------------------------------------------------------------------

template <class Scalar>
class Message : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Message, Scalars);

TYPED_TEST(Message, SixNumbersAre192BitsAndComeBack) {
  icat::Vector6<TypeParam> sent, received;
  sent << TypeParam(0.1), TypeParam(-2.5), TypeParam(0), TypeParam(1e-30), TypeParam(3e30),
      TypeParam(-0.7);
  std::array<std::byte, icat::message_size(6)> bytes;
  static_assert(8 * sizeof(bytes) == 192);
  ASSERT_EQ(icat::encode(sent, bytes), Status::ok);
  ASSERT_EQ(icat::decode(bytes, received), Status::ok);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(received(i), static_cast<TypeParam>(float(sent(i))));
  // 1.0f, the lowest byte first, whatever the machine.
  sent.setOnes();
  ASSERT_EQ(icat::encode(sent, bytes), Status::ok);
  EXPECT_EQ(bytes[0], std::byte{0});
  EXPECT_EQ(bytes[2], std::byte{0x80});
  EXPECT_EQ(bytes[3], std::byte{0x3f});
}

// "The exchange of velocities could be done at 25 and 50 Hz", with 976 bit/s at 5 Hz [Coop, I]:
// whole messages per second, in steps of a modem's round figures.
TEST(MessageRate, OfTheModemsOfThePaper) {
  struct Modem {
    double bits_per_second, rate;
  };
  constexpr double bits = 8.0 * icat::message_size(6);
  for (const auto& [capacity, rate] : {Modem{5e3, 25}, Modem{10e3, 50}, Modem{976, 5}}) {
    EXPECT_LE(rate * bits, capacity);
    EXPECT_GT(1.06 * rate * bits, capacity);  // the paper rounds down, by 6 % at most
  }
  // With the spans, 36 more numbers, the slowest modem takes more than a second.
  EXPECT_EQ(8 * icat::message_size(42), 1344u);
  EXPECT_LT(976.0 / (8.0 * icat::message_size(42)), 1);
}

TYPED_TEST(Message, RefusesWhatIsNoTwist) {
  constexpr TypeParam inf = std::numeric_limits<TypeParam>::infinity();
  const icat::Vector6<TypeParam> good = icat::Vector6<TypeParam>::Constant(TypeParam(0.5));
  std::array<std::byte, 24> bytes{};
  std::array<std::byte, 25> longer{};
  EXPECT_EQ(icat::encode(good, longer), Status::wrong_size);
  for (int i = 0; i < 6; ++i) {
    for (const TypeParam bad : {inf, -inf, std::numeric_limits<TypeParam>::quiet_NaN()}) {
      icat::Vector6<TypeParam> v = good;
      v(i) = bad;
      EXPECT_EQ(icat::encode(v, bytes), Status::non_finite);
      for (const std::byte b : bytes) ASSERT_EQ(b, std::byte{0}) << "something was written";
      // On the receiver's side: an exponent of all ones.
      std::array<std::byte, 24> wire{};
      ASSERT_EQ(icat::encode(good, wire), Status::ok);
      const auto word = std::bit_cast<std::uint32_t>(static_cast<float>(bad));
      for (std::size_t k = 0; k < 4; ++k) {
        wire[4 * static_cast<std::size_t>(i) + k] = static_cast<std::byte>(word >> (8 * k));
      }
      icat::Vector6<TypeParam> received = good;
      EXPECT_EQ(icat::decode(wire, received), Status::non_finite);
      EXPECT_EQ(received, good);
    }
  }
  icat::Vector6<TypeParam> received = good;
  const std::vector<std::byte> raw(60);
  for (const std::size_t length : {0u, 1u, 23u, 25u, 48u}) {
    EXPECT_EQ(icat::decode(std::span(raw).first(length), received), Status::wrong_size);
    EXPECT_EQ(received, good);
  }
}

TEST(MessageRange, WhatFloat32CannotHoldIsRefused) {
  std::array<std::byte, 24> bytes{};
  EXPECT_EQ(icat::encode(Vector6::Constant(1e39), bytes), Status::non_finite);
}

// What a little-endian machine wrote, as a constant: on every machine these bytes are these
// numbers.
TEST(MessageBytes, AreTheSameOnEveryMachine) {
  // clang-format off
  constexpr std::array<unsigned char, icat::message_size(8)> wire{
      0xcd, 0xcc, 0xcc, 0x3d,  // 0.1
      0x00, 0x00, 0x20, 0xc0,  // -2.5
      0x60, 0x42, 0xa2, 0x0d,  // 1e-30
      0x17, 0x76, 0x17, 0x72,  // 3e30
      0x33, 0x33, 0x33, 0xbf,  // -0.7
      0xdb, 0x0f, 0x49, 0x40,  // pi
      0xca, 0x02, 0x00, 0x00,  // 1e-42: subnormal
      0x00, 0x00, 0x00, 0x80,  // -0
  };
  // clang-format on
  const std::array<float, 8> numbers{0.1f, -2.5f, 1e-30f, 3e30f, -0.7f, 3.14159265f, 1e-42f, -0.0f};
  icat::Vector<float, 8> received;
  ASSERT_EQ(icat::decode(std::as_bytes(std::span(wire)), received), Status::ok);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(std::bit_cast<std::uint32_t>(received(static_cast<int>(i))),
              std::bit_cast<std::uint32_t>(numbers[i]));
  }
  std::array<std::byte, icat::message_size(8)> sent;
  ASSERT_EQ(icat::encode(received, sent), Status::ok);
  for (std::size_t i = 0; i < wire.size(); ++i) EXPECT_EQ(sent[i], std::byte{wire[i]}) << i;
}

// --- fusion --------------------------------------------------------------------------------------

Vector6 twist(double x, double y, double z, double wx = 0, double wy = 0, double wz = 0) {
  Vector6 v;
  v << x, y, z, wx, wy, wz;
  return v;
}

TEST(Fusion, Policies) {
  const std::vector<Vector6> said{twist(1, 0, 0), twist(0, 2, 0, 0, 0, 0.5)};
  const std::vector<double> difficulties{0, 0.5};
  const icat::Proposals<double> p{said, {}, difficulties};
  EXPECT_EQ(icat::fusion::mean<double>().fuse(p), (said[0] + said[1]) / 2);
  EXPECT_LT((icat::fusion::convex_combination<double>({0.25, 0.75}).fuse(p) -
             (0.25 * said[0] + 0.75 * said[1]))
                .norm(),
            1e-15);
  // The first is not hindered at all, so nearly all goes to the second.
  const auto policy = icat::fusion::difficulty_weighted<double>(1e-3);
  EXPECT_TRUE(policy.difficulties);
  EXPECT_LT((policy.fuse(p) - (1e-3 * said[0] + 0.501 * said[1]) / 0.502).norm(), 1e-15);
  const std::vector<double> none{0, 0};
  EXPECT_LT((policy.fuse({said, {}, none}) - (said[0] + said[1]) / 2).norm(), 1e-15);
  EXPECT_THROW(icat::fusion::convex_combination<double>({0.5, 0.6}), std::invalid_argument);
  EXPECT_THROW(icat::fusion::convex_combination<double>({1.5, -0.5}), std::invalid_argument);
  EXPECT_THROW(icat::fusion::difficulty_weighted<double>(0), std::invalid_argument);
}

TEST(Fusion, SpanIntersection) {
  icat::SpanIntersection<double> intersection(2);
  const Vector6 a = twist(0, 0, -0.1), b = twist(0.2, 0.3, 0.4, 0.1, 0.2, 0.3);
  const Vector6 mean = (a + b) / 2;
  std::vector<Matrix6> spans(2, Matrix6::Identity());
  const std::vector<Vector6> said{a, b};
  // Free agents: what the policy says.
  EXPECT_LT((intersection.nearest(mean, {said, spans, {}}) - mean).norm(), 1e-12);
  // a cannot give way along z, b not about x: each gets its own there, the mean elsewhere.
  spans[0](2, 2) = 0;
  spans[1](3, 3) = 0;
  Vector6 expected = mean;
  expected(2) = a(2);
  expected(3) = b(3);
  EXPECT_LT((intersection.nearest(mean, {said, spans, {}}) - expected).norm(), 1e-12);
  // Both along z: nothing satisfies both; half way.
  spans[1](2, 2) = 0;
  expected(2) = mean(2);
  EXPECT_LT((intersection.nearest(mean, {said, spans, {}}) - expected).norm(), 1e-12);
  // Smooth in between.
  Vector6 last =
      intersection.nearest(mean, {said, std::vector<Matrix6>(2, Matrix6::Identity()), {}});
  for (int k = 0; k <= 10000; ++k) {
    spans.assign(2, Matrix6::Identity());
    spans[0](2, 2) = 1 - icat::smooth_step(k / 10000.0);
    const Vector6 v = intersection.nearest(mean, {said, spans, {}});
    EXPECT_LT((v - last).norm(), 0.01) << k;
    last = v;
  }
  EXPECT_NEAR(last(2), a(2), 1e-12);
  EXPECT_EQ(intersection.status(), Status::ok);
  // Bad input.
  spans[0](0, 0) = NAN;
  EXPECT_EQ(intersection.nearest(mean, {said, spans, {}}), Vector6::Zero());
  EXPECT_EQ(intersection.status(), Status::non_finite);
}

// --- agreement -----------------------------------------------------------------------------------

using Agreement = icat::Agreement<double>;
using Options = icat::AgreementOptions<double>;

TEST(Agreement, AllComeToTheSameBits) {
  std::mt19937 gen(2);
  std::normal_distribution<double> n;
  for (const std::size_t count : {2u, 3u, 5u}) {
    for (const bool spans : {false, true}) {
      std::vector<Agreement> agents;
      for (std::size_t i = 0; i < count; ++i) {
        agents.emplace_back(Options{.agents = count, .index = i, .spans = spans, .fade = 0.1});
      }
      std::vector<Vector6> said(count);
      for (int round = 0; round < 20; ++round) {
        for (std::size_t i = 0; i < count; ++i) {
          said[i] = Vector6::NullaryExpr([&] { return n(gen); });
          ASSERT_EQ(agents[i].propose(said[i], Vector6::Zero()), Status::ok);
        }
        for (std::size_t i = 0; i < count; ++i) {
          const auto bytes = agents[i].send(round);
          ASSERT_EQ(bytes.size(), spans ? 168u : 24u);
          for (std::size_t j = 0; j < count; ++j) {
            if (j != i) {
              ASSERT_EQ(agents[j].receive(i, round, bytes), Status::ok);
            }
          }
        }
        for (auto& agent : agents) (void)agent.update(round);
      }
      Vector6 mean = Vector6::Zero();
      for (const auto& v : said) mean += v / static_cast<double>(count);
      for (auto& agent : agents) {
        EXPECT_TRUE(agent.agreed());
        EXPECT_EQ(agent.velocity(), agents[0].velocity());
        EXPECT_LT((agent.velocity() - mean).norm(), 1e-6);  // float32
      }
    }
  }
}

// A message that is lost, doubled or late, or an agent that starts late, spoils its own round only.
TEST(Agreement, ASpoiledRoundDoesNotSpoilTheNext) {
  enum class Fault { lost_there, lost_back, doubled, late, late_start };
  for (const Fault fault :
       {Fault::lost_there, Fault::lost_back, Fault::doubled, Fault::late, Fault::late_start}) {
    Agreement a(Options{.fade = 0.01}), b(Options{.index = 1, .fade = 0.01});
    std::vector<std::byte> kept;
    int apart = 0;
    for (int k = 0; k < 200; ++k) {
      const double t = 0.01 * k;
      ASSERT_EQ(a.propose(twist(std::sin(t), 0, 0), Vector6::Zero()), Status::ok);
      ASSERT_EQ(b.propose(twist(std::cos(t), 0, 0), Vector6::Zero()), Status::ok);
      const bool now = k == 100;
      const auto from_a = a.send(k);
      if (!(now && fault == Fault::lost_there)) {
        ASSERT_EQ(b.receive(0, k, from_a), Status::ok);
      }
      if (fault == Fault::late_start && k < 20) continue;
      const auto from_b = b.send(k);
      if (now && fault == Fault::late) {
        kept.assign(from_b.begin(), from_b.end());
      } else if (!(now && fault == Fault::lost_back)) {
        ASSERT_EQ(a.receive(1, k, from_b), Status::ok);
      }
      if (now && fault == Fault::doubled) {
        ASSERT_EQ(a.receive(1, k, from_b), Status::ok);
      }
      if (k == 103 && fault == Fault::late) {
        ASSERT_EQ(a.receive(1, 100, kept), Status::ok);
      }
      (void)a.update(t);
      (void)b.update(t);
      if (k > 25 && a.velocity() != b.velocity()) ++apart;
      if (k > 25) {
        EXPECT_NEAR(a.velocity()(0), (std::sin(t) + std::cos(t)) / 2, 0.02);
      }
    }
    EXPECT_LE(apart, 1) << static_cast<int>(fault);
  }
}

TEST(Agreement, ARefusedProposalIsNotSentAndTimeDoesNotRunBackwards) {
  Agreement agent(Options{.fade = 0.1});
  ASSERT_EQ(agent.propose(twist(1, 0, 0), Vector6::Zero()), Status::ok);
  EXPECT_EQ(agent.send(0).size(), 24u);
  EXPECT_EQ(agent.receive(1, 0, agent.send(0)), Status::ok);
  for (const double t : {0.0, 0.05, 0.2}) (void)agent.update(t);
  EXPECT_EQ(agent.velocity(), twist(1, 0, 0));
  EXPECT_EQ(agent.update(0.0), twist(1, 0, 0));
  EXPECT_EQ(agent.propose(Vector6::Constant(1e39), Vector6::Zero()), Status::non_finite);
  EXPECT_TRUE(agent.send(1).empty());
}

/// What agent 0 commands while agent 1 falls silent after 1 s and speaks again at 4 s.
std::vector<Vector6> silence(icat::Fallback fallback, double dt) {
  Agreement agent(Options{.hold = 0.5, .fallback = fallback, .fade = 1});
  Agreement other(Options{.index = 1});
  EXPECT_EQ(agent.propose(twist(0.2, 0, 0), Vector6::Zero()), Status::ok);
  EXPECT_EQ(other.propose(twist(0.4, 0, 0), Vector6::Zero()), Status::ok);
  std::vector<Vector6> commanded;
  for (int k = 0; k * dt < 7; ++k) {
    const double t = k * dt;
    if (t <= 1 || t > 4) {
      EXPECT_EQ(agent.receive(1, k, other.send(k)), Status::ok);
    }
    EXPECT_EQ(agent.send(k).size(), 24u);
    commanded.push_back(agent.update(t));
  }
  return commanded;
}

TEST(Agreement, HoldsThenFallsBackThenReturns) {
  const double dt = 0.01;
  for (const auto fallback : {icat::Fallback::stop, icat::Fallback::alone}) {
    const auto v = silence(fallback, dt);
    const double alone = fallback == icat::Fallback::stop ? 0 : 0.2;
    const auto at = [&](double t) { return v[static_cast<std::size_t>(std::lround(t / dt))](0); };
    EXPECT_NEAR(at(1.0), 0.3, 1e-7);   // agreed, after it has faded in
    EXPECT_NEAR(at(1.49), 0.3, 1e-7);  // held for 0.5 s
    EXPECT_NEAR(at(2.01), (0.3 + alone) / 2, 3e-3);
    EXPECT_NEAR(at(2.6), alone, 1e-7);  // fallen back
    EXPECT_NEAR(at(4.0), alone, 1e-7);
    EXPECT_NEAR(at(5.1), 0.3, 1e-7);  // back again
    for (std::size_t k = 1; k < v.size(); ++k) {
      EXPECT_LT((v[k] - v[k - 1]).norm(), 0.3 * 1.9 * dt) << k;  // the step's steepest slope: 1.875
    }
  }
}

TEST(Agreement, ABadMessageIsNoMessage) {
  Agreement agent(Options{.hold = 0.5, .fade = 0.1});
  ASSERT_EQ(agent.propose(twist(1, 0, 0), Vector6::Zero()), Status::ok);
  (void)agent.send(0);
  const std::array<std::byte, 23> shorter{};
  std::array<std::byte, 24> nan;
  nan.fill(std::byte{0xff});
  EXPECT_EQ(agent.receive(1, 0, shorter), Status::wrong_size);
  EXPECT_EQ(agent.receive(1, 0, nan), Status::non_finite);
  const std::array<std::byte, 24> good{};
  EXPECT_EQ(agent.receive(0, 0, good), Status::unknown_agent);  // itself
  EXPECT_EQ(agent.receive(2, 0, good), Status::unknown_agent);
  (void)agent.update(0);
  EXPECT_FALSE(agent.agreed());
  EXPECT_EQ(agent.receive(1, 0, good), Status::ok);
  (void)agent.update(0.01);
  EXPECT_TRUE(agent.agreed());
}

// Nothing is sent once a proposal is withdrawn, and what was sent before still counts.
TEST(Agreement, AWithdrawnProposalIsNotSent) {
  Agreement agent(Options{.fade = 0.1});
  ASSERT_EQ(agent.propose(twist(1, 0, 0), Vector6::Zero()), Status::ok);
  const auto bytes = agent.send(0);
  const std::vector<std::byte> sent(bytes.begin(), bytes.end());
  agent.withdraw();
  EXPECT_TRUE(agent.send(1).empty());
  EXPECT_EQ(agent.receive(1, 0, sent), Status::ok);
  for (const double t : {0.0, 0.1}) (void)agent.update(t);
  EXPECT_EQ(agent.velocity(), twist(1, 0, 0));
  ASSERT_EQ(agent.propose(twist(2, 0, 0), Vector6::Zero()), Status::ok);
  EXPECT_EQ(agent.send(1).size(), 24u);
}

TEST(Agreement, StaysFinite) {
  Agreement agent(
      Options{.policy = {{.fuse = [](const auto&) { return Vector6::Constant(NAN).eval(); }}}});
  EXPECT_EQ(agent.propose(Vector6::Constant(NAN), Vector6::Zero()), Status::non_finite);
  EXPECT_TRUE(agent.send(0).empty());
  ASSERT_EQ(agent.propose(twist(1, 0, 0), Vector6::Zero()), Status::ok);
  (void)agent.send(0);
  EXPECT_EQ(agent.receive(1, 0, std::array<std::byte, 24>{}), Status::ok);
  EXPECT_TRUE(agent.update(0).allFinite());
  EXPECT_FALSE(agent.agreed());
  EXPECT_TRUE(agent.update(NAN).allFinite());
  EXPECT_TRUE(agent.update(1).allFinite());
}

TEST(Agreement, RefusesBadOptions) {
  EXPECT_THROW(Agreement(Options{.agents = 1}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.agents = 2, .index = 2}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.agents = static_cast<std::size_t>(-1)}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.policy = icat::FusionPolicy<double>{}}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.policy = icat::fusion::convex_combination<double>({1.0})}),
               std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.hold = 0}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.fade = -1}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.ahead = 0}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.ahead = 8}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.max_linear = 0}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.max_angular = NAN}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.max_span = 0.9}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.recovery = 0}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.recovery = 1.1}), std::invalid_argument);
}

// --- pace in a message ---------------------------------------------------------------------------

TEST(MessagePace, NeedsNoNumberOfItsOwn) {
  std::array<std::byte, 24> bytes;
  const Vector6 sent = (Vector6() << 0.1, -2.5, 0, 1e-30, -4.9, 1).finished();
  ASSERT_EQ(icat::encode(sent, bytes), Status::ok);
  for (int below = icat::pace_steps; below >= 0; --below) {
    const double pace = 1 - static_cast<double>(below) / icat::pace_steps;
    ASSERT_EQ(icat::encode_pace(pace, bytes), Status::ok);
    ASSERT_EQ(icat::decode_pace(bytes), pace) << below;
    Vector6 received;
    ASSERT_EQ(icat::decode(bytes, received), Status::ok);
    for (int i = 0; i < 6; ++i) {
      ASSERT_NEAR(received(i), sent(i), 5e-7 * std::abs(sent(i)) + 1e-44) << i;
    }
  }
  // The full pace is twelve zeros; what is between two steps is the slower one.
  for (std::size_t k = 0; k < 6; ++k) EXPECT_EQ(bytes[4 * k] & std::byte{3}, std::byte{0});
  ASSERT_EQ(icat::encode_pace(1 - 1e-6, bytes), Status::ok);
  EXPECT_EQ(icat::decode_pace(bytes), 1 - 1.0 / icat::pace_steps);
  const auto before = bytes;
  for (const double bad : {-0.1, 1.1, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_EQ(icat::encode_pace(bad, bytes), Status::out_of_range);
  }
  EXPECT_EQ(icat::encode_pace(0.5, std::span(bytes).first(23)), Status::wrong_size);
  EXPECT_EQ(bytes, before);
  EXPECT_EQ(icat::decode_pace(std::span(bytes).first(23)), 1);
}

// --- rounds --------------------------------------------------------------------------------------

/// Two agents, one round every 10 ms on a channel that takes `latency` rounds. An agreement is held
/// for a round and a half only: `agreed` means that this round or the last one was agreed on.
struct Line {
  using Bytes = std::vector<std::byte>;
  struct Letter {
    long long round, due;
    Bytes bytes;
  };
  explicit Line(int late = 0, bool schedule = false) : latency(late), scheduled(schedule) {
    for (std::size_t i = 0; i < 2; ++i) replace(i);
  }
  static Options options(std::size_t i) { return {.index = i, .hold = 0.015, .fade = 1e-3}; }
  /// A robot that is switched off and on.
  void replace(std::size_t i) { agents[i] = std::make_unique<Agreement>(options(i)); }
  /// Every agent sends, and hears what is due.
  void round(bool connected = true) {
    ++now;
    const double t = 0.01 * ++ticks;
    for (std::size_t i = 0; i < 2; ++i) {
      const double wave = std::sin(0.1 * t + static_cast<double>(i));
      ASSERT_EQ(agents[i]->propose(twist(0.2 * wave, 0, 0), Vector6::Zero()), Status::ok);
      const long long number = scheduled ? now : agents[i]->next_round();
      const auto bytes = agents[i]->send(number);
      if (connected) way[i].push_back({number, now + latency, {bytes.begin(), bytes.end()}});
    }
    for (std::size_t i = 0; i < 2; ++i) {
      for (auto& letter : way[i]) {
        if (letter.due == now) last = agents[1 - i]->receive(i, letter.round, letter.bytes);
      }
    }
    for (auto& agent : agents) (void)agent->update(t);
  }
  bool agreed() const { return agents[0]->agreed() && agents[1]->agreed(); }
  /// How many rounds it takes until all those after it are agreed on.
  int rounds_to_heal() {
    int needed = 0;
    for (int k = 1; k <= 60; ++k) {
      round();
      if (!agreed()) needed = k + 1;
    }
    return needed;
  }
  int bound() const { return static_cast<int>(Agreement::open_rounds) + 2 + 2 * latency; }

  int latency;
  bool scheduled;
  long long now{0};  // the number of the schedule
  int ticks{0};
  Status last{Status::ok};
  std::array<std::unique_ptr<Agreement>, 2> agents;
  std::array<std::vector<Letter>, 2> way;
};

// Case C4, numbers from a schedule.
TEST(AgreementRounds, WhatIsOutOfReachIsRefusedAndChangesNothing) {
  constexpr long long most = std::numeric_limits<long long>::max();
  constexpr auto least = std::numeric_limits<long long>::min();
  Line line(0, true);
  for (int k = 0; k < 20; ++k) line.round();
  ASSERT_TRUE(line.agreed());
  Agreement& a = *line.agents[0];
  const std::array<std::byte, 24> zeros{};
  std::vector<long long> numbers{line.now + 5, line.now - 8, 1LL << 40, -1, most, least, most - 1};
  for (int k = 0; k < 8; ++k) numbers.push_back(1000000000000LL + k);
  for (const long long number : numbers) {
    EXPECT_EQ(a.receive(1, number, zeros), Status::round_out_of_range) << number;
    line.round();
    EXPECT_TRUE(line.agreed()) << number;
    EXPECT_EQ(a.velocity(), line.agents[1]->velocity()) << number;
  }
  EXPECT_TRUE(a.send(most).empty());
  EXPECT_TRUE(a.send(least).empty());
  // In reach.
  EXPECT_EQ(a.receive(1, line.now + 4, zeros), Status::ok);
  EXPECT_EQ(a.receive(1, line.now - 7, zeros), Status::ok);
}

// A robot that is switched off and on comes back with the number of the schedule, and the schedule
// may begin anew.
TEST(AgreementRounds, AScheduleMayBeginAnew) {
  Line line(0, true);
  for (const long long number : {1000000LL, 0LL, -500LL, 1LL << 40, 7LL}) {
    line.now = number;
    for (int k = 0; k < 2; ++k) line.round();
    EXPECT_TRUE(line.agreed()) << number;
    EXPECT_EQ(line.agents[0]->velocity(), line.agents[1]->velocity());
    line.replace(1);
  }
}

// Case C4, numbers in the modem's header.
TEST(AgreementRounds, AgentsThatCountApartMeetAgain) {
  enum class Fault { none, peer, own, own_set_back, ahead, negative, deaf, eight_wrong, stuck };
  int worst = 0;
  for (int latency = 0; latency <= 3; ++latency) {
    for (const Fault fault :
         {Fault::none, Fault::peer, Fault::own, Fault::own_set_back, Fault::ahead, Fault::negative,
          Fault::deaf, Fault::eight_wrong, Fault::stuck}) {
      SCOPED_TRACE(testing::Message() << latency << ' ' << static_cast<int>(fault));
      Line line(latency);
      (void)line.agents[0]->send(1000000);
      for (int k = 0; k < 40; ++k) line.round();
      ASSERT_TRUE(line.agreed());
      Agreement& a = *line.agents[0];
      const std::array<std::byte, 24> zeros{};
      if (fault == Fault::peer) line.replace(1);
      if (fault == Fault::own) line.replace(0);
      if (fault == Fault::own_set_back) (void)a.send(0);
      if (fault == Fault::ahead) (void)a.send(1LL << 40);
      if (fault == Fault::negative) {
        line.replace(0);
        line.replace(1);
        (void)line.agents[0]->send(-1000000);
        (void)line.agents[1]->send(-2000000);
      }
      if (fault == Fault::deaf) {
        for (int k = 0; k < 500; ++k) {
          line.round(false);
          if (k % 3 == 0) (void)a.send(a.next_round());  // and one counts faster
        }
      }
      if (fault == Fault::eight_wrong) {
        for (int k = 0; k < 8; ++k) {
          EXPECT_EQ(a.receive(1, 1000000000000LL + k, zeros), Status::round_out_of_range);
        }
        EXPECT_EQ(a.next_round(), 1000000000007LL);
      }
      if (fault == Fault::stuck) {  // doubled numbers are no count
        const long long next = a.next_round();
        for (int k = 0; k < 100; ++k) (void)a.receive(1, 1LL << 40, zeros);
        EXPECT_EQ(a.next_round(), next);
      }
      const int needed = line.rounds_to_heal();
      EXPECT_LE(needed, line.bound());
      worst = std::max(worst, needed - 2 * latency);
      EXPECT_EQ(line.last, Status::ok);
    }
  }
  RecordProperty("rounds_to_heal", worst);
  // At the end of the numbers it begins anew.
  Line line;
  for (auto& agent : line.agents) (void)agent->send(Agreement::largest_round - 3);
  EXPECT_LE(line.rounds_to_heal(), line.bound());
}

// A later round that another agent has begun is joined at once.
TEST(AgreementRounds, WhoMissedCyclesJoinsTheOthers) {
  Line line;
  for (int k = 0; k < 20; ++k) line.round();
  Agreement &a = *line.agents[0], &b = *line.agents[1];
  const long long begun = a.next_round() + 3;
  for (long long round = a.next_round(); round <= begun; ++round) {
    const auto bytes = a.send(round);
    EXPECT_EQ(b.receive(0, round, bytes), Status::ok);
  }
  EXPECT_EQ(b.next_round(), begun);
  EXPECT_EQ(a.receive(1, begun, b.send(b.next_round())), Status::ok);
  for (Agreement* agent : {&a, &b}) {
    (void)agent->update(1);
    EXPECT_TRUE(agent->agreed());
  }
  EXPECT_EQ(b.next_round(), begun + 1);
}

// What was put aside before the first round of its own does not stand in the way later.
TEST(AgreementRounds, AnAgentThatStartsLateForgetsWhatIsOutOfReach) {
  Agreement a(Options{.fade = 0.01}), b(Options{.index = 1});
  const std::array<std::byte, 24> zeros{};
  for (int k = 0; k < 8; ++k) EXPECT_EQ(a.receive(1, (1LL << 40) + 10 * k + k, zeros), Status::ok);
  ASSERT_EQ(a.propose(twist(0.1, 0, 0), Vector6::Zero()), Status::ok);
  ASSERT_EQ(b.propose(twist(0.1, 0, 0), Vector6::Zero()), Status::ok);
  for (int k = 0; k < 8; ++k) {
    (void)a.send(k);
    EXPECT_EQ(a.receive(1, k, b.send(k)), Status::ok);
    EXPECT_EQ(a.receive(1, k, b.send(k)), Status::ok);
    (void)a.update(2 * k);
    EXPECT_TRUE(a.agreed()) << k;  // held for 1 s: each round anew
  }
}

// Five agents, of which two have counted elsewhere.
TEST(AgreementRounds, MoreThanTwoMeetAgain) {
  std::vector<Agreement> agents;
  for (std::size_t i = 0; i < 5; ++i) {
    agents.emplace_back(Options{.agents = 5, .index = i, .hold = 0.015, .fade = 1e-3});
    ASSERT_EQ(agents[i].propose(twist(0.1, 0, 0), Vector6::Zero()), Status::ok);
    (void)agents[i].send(i < 3 ? 1000000 : static_cast<long long>(i));
  }
  for (int k = 0; k < 30; ++k) {
    std::array<long long, 5> numbers{};
    for (std::size_t i = 0; i < 5; ++i) {
      numbers[i] = agents[i].next_round();
      const auto bytes = agents[i].send(numbers[i]);
      for (std::size_t j = 0; j < 5; ++j) {
        if (j != i) (void)agents[j].receive(i, numbers[i], bytes);
      }
    }
    for (auto& agent : agents) {
      (void)agent.update(0.01 * k);
      if (k >= 10) {
        EXPECT_TRUE(agent.agreed()) << k;
      }
    }
  }
}

// --- what is implausible -------------------------------------------------------------------------

/// What an agent would send that checks nothing.
template <int N>
std::vector<std::byte> raw(const icat::Vector<double, N>& numbers) {
  std::vector<std::byte> bytes(icat::message_size(static_cast<std::size_t>(numbers.size())));
  EXPECT_EQ(icat::encode(numbers, bytes), Status::ok);
  return bytes;
}

// Case C5: refused, not heard, and the velocity is held.
TEST(AgreementPlausibility, ImplausibleNumbersAreNotHeard) {
  struct Case {
    const char* what;
    int at;
    double value;
  };
  // [ẋ; difficulty; T by columns]
  const std::vector<Case> cases{{"negative difficulty", 6, -0.002},
                                {"large difficulty", 6, 1e9},
                                {"too fast", 0, 3e38},
                                {"a little too fast", 1, 5.01},
                                {"turns too fast", 5, -5.01},
                                {"large span", 7, 1e30},
                                {"span", 7 + 8, -3},
                                {"span", 7 + 14, 1.6},
                                {"span", 7 + 1, 1.8}};
  Options options{.policy = icat::fusion::difficulty_weighted<double>(),
                  .spans = true,
                  .hold = 0.5,
                  .fade = 0.01};
  Agreement a(options);
  options.index = 1;
  Agreement b(options);
  ASSERT_EQ(a.propose(twist(0.2, 0, 0), Vector6::Zero()), Status::ok);
  ASSERT_EQ(b.propose(twist(0.1, 0.1, 0), Vector6::Zero()), Status::ok);
  long long k = 0;
  const auto cycle = [&](const std::vector<std::byte>* bad) {
    const auto sent = b.send(k);
    const Status status = bad ? a.receive(1, k, *bad) : a.receive(1, k, sent);
    (void)a.send(k);
    (void)a.update(0.01 * static_cast<double>(k++));
    return status;
  };
  for (int i = 0; i < 5; ++i) ASSERT_EQ(cycle(nullptr), Status::ok);
  const Vector6 agreed = a.velocity();
  ASSERT_GT(agreed.norm(), 0.1);
  const auto good = b.send(k);
  icat::Vector<double, 43> numbers;
  ASSERT_EQ(icat::decode(good, numbers), Status::ok);
  for (const Case& c : cases) {
    auto bad = numbers;
    bad(c.at) = c.value;
    const auto bytes = raw(bad);
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(cycle(&bytes), Status::implausible) << c.what << ' ' << c.value;
      EXPECT_EQ(a.velocity(), agreed) << c.what;
    }
    EXPECT_EQ(cycle(nullptr), Status::ok);
    EXPECT_EQ(a.velocity(), agreed) << c.what;
  }
  auto ones = numbers;
  ones.tail<36>().setOnes();  // each number may be one of a projector, together they are none
  const auto bytes = raw(ones);
  EXPECT_EQ(cycle(&bytes), Status::implausible);
}

TEST(AgreementPlausibility, SpansOfEveryKindOfTaskAreHeard) {
  Agreement agent(Options{.spans = true});
  std::mt19937 gen(4);
  std::normal_distribution<double> n;
  std::uniform_real_distribution<double> u(0, 1);
  // Symmetric with eigenvalues in 0 … 1, binary or not.
  const auto tool = [&](bool binary) {
    const Matrix6 any = Matrix6::NullaryExpr([&] { return n(gen); });
    const Matrix6 q = testing_support::orthogonal(any);
    const Vector6 d = Vector6::NullaryExpr([&] { return binary ? std::round(u(gen)) : u(gen); });
    return Matrix6(q * d.asDiagonal() * q.transpose());
  };
  for (int k = 0; k < 2000; ++k) {
    EXPECT_EQ(agent.propose(Vector6::Zero(), Vector6::Zero(), tool(k % 2 == 0)), Status::ok);
    // Two shared tasks at different priorities: I − T = (I − T₂)(I − T₁), no longer symmetric.
    const Matrix6 I = Matrix6::Identity();
    const Matrix6 T = I - (I - tool(k % 2 == 0)) * (I - tool(k % 4 < 2));
    EXPECT_EQ(agent.propose(Vector6::Zero(), Vector6::Zero(), T), Status::ok);
    EXPECT_LE(testing_support::singular_values(2 * T - I)(0), 5.0 / 3 + 1e-12);
  }
  // The limit is what it says.
  for (const double norm : {1.99, 2.01}) {
    Matrix6 T = 0.5 * Matrix6::Identity();
    T(4, 1) = norm / 2;
    T(1, 1) = 0.5;
    const double of = testing_support::singular_values(2 * T - Matrix6::Identity())(0);
    EXPECT_EQ(agent.propose(Vector6::Zero(), Vector6::Zero(), T),
              of <= 2 ? Status::ok : Status::implausible);
  }
}

TEST(AgreementPlausibility, OnesOwnProposalIsJudgedAlike) {
  Agreement agent(Options{.policy = icat::fusion::difficulty_weighted<double>(),
                          .max_linear = 0.5,
                          .max_angular = 0.2});
  EXPECT_EQ(agent.propose(twist(0.3, 0, 0.4, 0, 0.2), Vector6::Zero()), Status::ok);
  EXPECT_FALSE(agent.send(0).empty()) << "at the limit";
  EXPECT_EQ(agent.propose(twist(0.3, 0.1, 0.4), Vector6::Zero()), Status::implausible);
  EXPECT_TRUE(agent.send(1).empty());
  EXPECT_EQ(agent.propose(twist(0, 0, 0, 0.2, 0.1), Vector6::Zero()), Status::implausible);
  // A far goal is no fault.
  EXPECT_EQ(agent.propose(Vector6::Zero(), Vector6::Constant(1e6)), Status::ok);
  EXPECT_FALSE(agent.send(2).empty());
  EXPECT_EQ(agent.propose(Vector6::Zero(), Vector6::Constant(NAN)), Status::non_finite);
  icat::Agreement<float> single(icat::AgreementOptions<float>{});
  EXPECT_EQ(single.propose(icat::Vector6<float>::Constant(1e30f), icat::Vector6<float>::Zero()),
            Status::implausible);
}

// A fusion that says what no agent could mean counts as if nothing had been heard.
TEST(AgreementPlausibility, AnImplausibleFusionIsNotFollowed) {
  bool wild = false;
  Agreement agent(Options{
      .policy = {{.fuse =
                      [&](const auto& p) { return Vector6((wild ? 1e3 : 1) * p.velocities[0]); }}},
      .fade = 0.01});
  ASSERT_EQ(agent.propose(twist(0.1, 0, 0), Vector6::Zero()), Status::ok);
  for (int k = 0; k < 6; ++k) {
    wild = k >= 3;
    ASSERT_EQ(agent.receive(1, k, agent.send(k)), Status::ok);
    (void)agent.update(0.01 * k);
    if (k > 0) {
      EXPECT_NEAR(agent.velocity()(0), 0.1, 1e-7) << k;
    }
  }
}

// --- the latest of each --------------------------------------------------------------------------

// In turns, one message a second, a second late: each has its own present proposal and the other's
// last one that has arrived.
TEST(AgreementLatest, OnesOwnPresentWithTheLastHeard) {
  std::vector<Agreement> agents;
  for (const std::size_t i : {0u, 1u}) {
    agents.emplace_back(Options{.index = i, .latest = true, .hold = 3, .fade = 0.05});
  }
  const auto says = [](std::size_t i, double t) {
    return i == 0 ? twist(std::sin(t), 0, 0.1) : twist(0, std::cos(t), 0.3, 0, 0, 0.2 * t);
  };
  std::vector<std::byte> under_way;
  std::array<double, 2> heard{-1, -1};  // when that was said
  int fused = 0;
  for (int k = 0; k < 1000; ++k) {
    const double t = 0.01 * k;
    for (const std::size_t i : {0u, 1u}) {
      ASSERT_EQ(agents[i].propose(says(i, t), Vector6::Zero()), Status::ok);
    }
    if (k % 100 == 0) {
      const auto slot = static_cast<std::size_t>(k / 100), sender = slot % 2;
      if (slot > 0) {
        const std::size_t before = 1 - sender;
        ASSERT_EQ(agents[sender].receive(before, k / 100 - 1, under_way), Status::ok);
        heard[sender] = t - 1;
      }
      const auto bytes = agents[sender].send(k / 100);
      ASSERT_EQ(bytes.size(), 24u);
      under_way.assign(bytes.begin(), bytes.end());
    }
    for (const std::size_t i : {0u, 1u}) {
      const Vector6 velocity = agents[i].update(t);
      ASSERT_EQ(agents[i].agreed(), heard[i] >= 0) << t;
      if (k < 210) continue;  // faded in
      const Vector6 mean = (says(i, t) + says(1 - i, heard[i])) / 2;
      ASSERT_LT((velocity - mean).norm(), 1e-6) << t;  // float32
      ++fused;
    }
  }
  EXPECT_GT(fused, 1000);
}

// All of the others have to be heard again within `hold`, and there has to be something to say.
TEST(AgreementLatest, FallsBackWhereOneIsNotHeardAndReturns) {
  enum class Silent { nobody, another, itself };
  for (const Silent silent : {Silent::nobody, Silent::another, Silent::itself}) {
    std::vector<Agreement> agents;
    for (std::size_t i = 0; i < 3; ++i) {
      agents.emplace_back(
          Options{.agents = 3, .index = i, .latest = true, .hold = 0.5, .fade = 0.05});
    }
    bool fell_back = false;
    for (int k = 0; k < 600; ++k) {
      const double t = 0.01 * k;
      const bool quiet = silent != Silent::nobody && 200 <= k && k < 400;
      for (std::size_t i = 0; i < 3; ++i) {
        ASSERT_EQ(agents[i].propose(twist(0.1 * double(i), 0, 0), Vector6::Zero()), Status::ok);
      }
      if (quiet && silent == Silent::itself) agents[0].withdraw();
      if (k % 10 == 0) {
        const auto sender = static_cast<std::size_t>(k / 10 % 3);
        const auto bytes = agents[sender].send(k / 10);
        if (!bytes.empty() && !(quiet && silent == Silent::another && sender == 2)) {
          for (std::size_t i = 0; i < 3; ++i) {
            if (i != sender) {
              ASSERT_EQ(agents[i].receive(sender, k / 10, bytes), Status::ok);
            }
          }
        }
      }
      for (auto& agent : agents) (void)agent.update(t);
      if (quiet && k > 300) {
        EXPECT_FALSE(agents[0].agreed());
        EXPECT_EQ(agents[0].velocity(), Vector6::Zero());
        fell_back = true;
      } else if ((60 < k && k < 200) || k > 460) {
        EXPECT_TRUE(agents[0].agreed()) << k;
        EXPECT_LT((agents[0].velocity() - twist(0.1, 0, 0)).norm(), 1e-6) << k;
      }
    }
    EXPECT_EQ(fell_back, silent != Silent::nobody);
  }
}

// The newest counts, whatever is doubled or overtaken; a count that begins anew is followed.
TEST(AgreementLatest, TheNewestCounts) {
  Agreement a(Options{.latest = true, .hold = 10, .fade = 0.01}),
      b(Options{.index = 1, .latest = true, .hold = 10, .fade = 0.01});
  const auto said = [&](double x, long long round) {
    EXPECT_EQ(b.propose(twist(x, 0, 0), Vector6::Zero()), Status::ok);
    const auto bytes = b.send(round);
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  const auto first = said(0.1, 0), second = said(0.2, 1), third = said(0.3, 2);
  ASSERT_EQ(a.propose(Vector6::Zero(), Vector6::Zero()), Status::ok);
  double t = 0;
  const auto velocity = [&] {
    (void)a.update(t += 0.02);
    return a.update(t += 0.02)(0);
  };
  (void)a.send(0);
  EXPECT_EQ(velocity(), 0);  // nothing was heard
  ASSERT_EQ(a.receive(1, 1, second), Status::ok);
  EXPECT_NEAR(velocity(), 0.1, 1e-7);
  ASSERT_EQ(a.receive(1, 0, first), Status::ok);
  EXPECT_NEAR(velocity(), 0.1, 1e-7);
  ASSERT_EQ(a.receive(1, 2, third), Status::ok);
  ASSERT_EQ(a.receive(1, 1, second), Status::ok);
  EXPECT_NEAR(velocity(), 0.15, 1e-7);
  // Out of reach, or no velocity.
  EXPECT_EQ(a.receive(1, 100, first), Status::round_out_of_range);
  EXPECT_EQ(a.receive(1, 3, std::span(first).first(23)), Status::wrong_size);
  EXPECT_NEAR(velocity(), 0.15, 1e-7);
  (void)a.send(-50);
  ASSERT_EQ(a.receive(1, -50, first), Status::ok);
  EXPECT_NEAR(velocity(), 0.05, 1e-7);
}

// What both always propose, they agree on, whether of one round or of the latest; the slower one's
// pace and the spans count as well.
TEST(AgreementLatest, WithSpansAndPace) {
  Agreement a(Options{.spans = true, .latest = true, .hold = 10, .fade = 0.01, .pace = true}),
      b(Options{.index = 1, .spans = true, .latest = true, .hold = 10, .fade = 0.01, .pace = true});
  // b cannot do anything else along z than it proposes.
  Matrix6 span = Matrix6::Identity();
  span(2, 2) = 0;
  for (int k = 0; k < 3; ++k) {
    ASSERT_EQ(a.propose(twist(0.2, 0, -0.1), Vector6::Zero()), Status::ok);
    ASSERT_EQ(b.propose(twist(0.4, 0, 0.1), Vector6::Zero(), span), Status::ok);
    ASSERT_EQ(a.receive(1, k, b.send(k)), Status::ok);
    ASSERT_EQ(b.receive(0, k, a.send(k)), Status::ok);
    for (Agreement* agent : {&a, &b}) (void)agent->update(0.02 * k);
  }
  EXPECT_LT((a.velocity() - twist(0.3, 0, 0.1)).norm(), 1e-6);
  EXPECT_LT((b.velocity() - twist(0.3, 0, 0.1)).norm(), 1e-6);
  // b follows half of it: its own pace counts at once, the other one hears of it.
  ASSERT_EQ(b.achieved(b.velocity(), 0.5 * b.velocity()), Status::ok);
  ASSERT_EQ(b.propose(twist(0.4, 0, 0.1), Vector6::Zero(), span), Status::ok);
  EXPECT_LT((b.update(0.1) - twist(0.15, 0, 0.05)).norm(), 1e-6);
  EXPECT_LT((a.update(0.1) - twist(0.3, 0, 0.1)).norm(), 1e-6);
  ASSERT_EQ(a.receive(1, 3, b.send(3)), Status::ok);
  EXPECT_LT((a.update(0.2) - twist(0.15, 0, 0.05)).norm(), 1e-4);  // steps of the pace
}

// --- anything at all -----------------------------------------------------------------------------

TEST(AgreementFuzz, NeverImplausibleNeverStuck) {
  for (const bool rich : {false, true}) {
    for (const auto& [scheduled, latest] : {std::pair{false, false}, std::pair{true, false},
                                            std::pair{false, true}, std::pair{true, true}}) {
      std::mt19937 gen(7);
      const auto pick = [&](int n) {
        return static_cast<int>(gen() % static_cast<std::uint32_t>(n));
      };
      std::vector<Agreement> agents;
      for (std::size_t i = 0; i < 2; ++i) {
        Options options{.index = i,
                        .spans = rich,
                        .latest = latest,
                        .hold = 0.015,
                        .fade = 1e-3,
                        .pace = rich == scheduled};
        if (rich) options.policy = icat::fusion::difficulty_weighted<double>();
        agents.emplace_back(options);
      }
      std::vector<std::pair<long long, std::vector<std::byte>>> old(64);
      int accepted = 0, refused = 0;
      const auto hear = [&](std::size_t to, long long round, std::span<const std::byte> bytes) {
        const Status status = agents[to].receive(1 - to, round, bytes);
        ++(status == Status::ok ? accepted : refused);
      };
      long long now = 0, quiet = 0;
      for (int episode = 0; episode < 250; ++episode) {
        for (int k = 0; k < 60; ++k, ++now) {
          const bool healed = k >= 40;
          if (k == 40) quiet = now;
          for (std::size_t i = 0; i < 2; ++i) {
            Agreement& agent = agents[i];
            Vector6 v = Vector6::NullaryExpr([&] { return 0.01 * (pick(201) - 100); });
            if (!healed && pick(20) == 0) v(pick(6)) = pick(2) ? 1e30 : NAN;
            (void)agent.propose(v, Vector6::Zero());
            if (!healed && pick(5) == 0) {  // what became of it is anything, too
              (void)agent.achieved(agent.velocity(), 0.01 * pick(150) * agent.velocity());
            }
            long long round = scheduled ? now : agent.next_round();
            // A computer that is set to anywhere, within what the counters can meet in again.
            if (!healed && pick(400) == 0) round = static_cast<long long>(gen()) - (1LL << 31);
            const auto sent = agent.send(round);
            std::vector<std::byte> bytes(sent.begin(), sent.end());
            if (healed) {
              hear(1 - i, round, bytes);
              continue;
            }
            old[static_cast<std::size_t>(pick(64))] = {round, bytes};
            for (int copies = pick(4); copies > 0; --copies) {
              auto letter = pick(2) ? old[static_cast<std::size_t>(pick(64))]
                                    : std::pair{round, bytes};  // doubled, reordered, delayed
              auto& [number, body] = letter;
              switch (pick(8)) {
                case 0:
                  body.resize(static_cast<std::size_t>(pick(200)));
                  break;
                case 1:
                  for (auto& b : body) b = static_cast<std::byte>(pick(256));
                  break;
                case 2:
                  if (!body.empty()) {
                    body[static_cast<std::size_t>(pick(static_cast<int>(body.size())))] ^=
                        static_cast<std::byte>(1 << pick(8));
                  }
                  break;
                case 3:
                  number = static_cast<long long>((std::uint64_t{gen()} << 32) | gen());
                  break;
                case 4:
                  number += pick(41) - 20;
                  break;
                case 5:
                  number ^= 1LL << pick(64 - 1);
                  break;
                default:
                  break;
              }
              hear(1 - i, number, body);
            }
          }
          for (auto& agent : agents) {
            const Vector6& v = agent.update(0.01 * static_cast<double>(now));
            ASSERT_TRUE(v.allFinite());
            ASSERT_LE(v.head<3>().norm(), 5 * (1 + 1e-5));
            ASSERT_LE(v.tail<3>().norm(), 5 * (1 + 1e-5));
            if (healed && now - quiet >= 10) {
              ASSERT_TRUE(agent.agreed()) << episode << ' ' << k << ' ' << scheduled << latest;
              if (!latest) {
                ASSERT_EQ(agent.velocity(), agents[0].velocity());
              }
            }
          }
        }
      }
      EXPECT_GT(refused, 5000);
      EXPECT_GT(accepted, 12000);
    }
  }
}

// --- pace ----------------------------------------------------------------------------------------

TEST(Fusion, NoFasterThanTheSlowest) {
  const auto policy = icat::fusion::no_faster_than_slowest<double>();
  std::mt19937 gen(9);
  std::normal_distribution<double> n;
  for (int k = 0; k < 1000; ++k) {
    std::vector<Vector6> said(3);
    for (auto& v : said) v = Vector6::NullaryExpr([&] { return n(gen); });
    if (k % 10 == 0) said[1] *= 1e-3;
    if (k % 100 == 0) said[2].tail<3>().setZero();
    const Vector6 mean = icat::fusion::mean<double>().fuse({said, {}, {}});
    const Vector6 slow = policy.fuse({said, {}, {}});
    for (int part = 0; part < 6; part += 3) {
      double slowest = said[0].segment<3>(part).norm();
      for (const auto& v : said) slowest = std::min(slowest, v.segment<3>(part).norm());
      const double expected = std::min(slowest, mean.segment<3>(part).norm());
      EXPECT_NEAR(slow.segment<3>(part).norm(), expected, 1e-12);
      EXPECT_NEAR(slow.segment<3>(part).dot(mean.segment<3>(part)),
                  expected * mean.segment<3>(part).norm(), 1e-12);  // the same way
    }
    const std::vector<Vector6> same(3, said[0]);
    EXPECT_LT((policy.fuse({same, {}, {}}) - said[0]).norm(), 1e-15);
  }
  EXPECT_TRUE(icat::fusion::no_faster_than_slowest(icat::fusion::difficulty_weighted<double>())
                  .difficulties);
}

/// Two robots that carry one object; each proposes a velocity and can do no more than a speed. What
/// one hears takes `latency` rounds more.
struct Carriers {
  explicit Carriers(int latency_, bool pace = true) : latency(latency_) {
    Options options{.pace = pace};
    options.hold = 1;
    options.fade = 0.1;
    for (std::size_t i = 0; i < 2; ++i) {
      options.index = i;
      agents.emplace_back(options);
    }
  }
  void round() {
    for (std::size_t i = 0; i < 2; ++i) {
      ASSERT_EQ(agents[i].propose(wish[i], Vector6::Zero()), Status::ok);
      const auto bytes = agents[i].send(k);
      letters[i].emplace_back(bytes.begin(), bytes.end());
    }
    if (k >= latency) {
      const auto at = static_cast<std::size_t>(k - latency);
      for (std::size_t i = 0; i < 2; ++i) {
        ASSERT_EQ(agents[1 - i].receive(i, k - latency, letters[i][at]), Status::ok);
      }
    }
    for (std::size_t i = 0; i < 2; ++i) {
      asked[i] = agents[i].update(0.01 * k);
      done[i] = asked[i] * std::min(1.0, can[i] / std::max(asked[i].head<3>().norm(), 1e-12));
      ASSERT_EQ(agents[i].achieved(asked[i], done[i]), Status::ok);
    }
    ASSERT_EQ(asked[0], asked[1]);
    ++k;
  }
  double apart() const { return (done[0] - done[1]).norm(); }

  int latency, k{0};
  std::vector<Agreement> agents;
  std::array<Vector6, 2> wish{twist(0.2, 0, 0, 0, 0.1), twist(0.4, 0, 0, 0, 0.2)}, asked, done;
  std::array<double, 2> can{1, 1};
  std::array<std::vector<std::vector<std::byte>>, 2> letters;
};

TEST(AgreementPace, AllSlowDownForOneThatCannotFollow) {
  for (int latency = 0; latency <= 3; ++latency) {
    SCOPED_TRACE(latency);
    const int d = latency + 1;  // rounds until the others hear of a cut
    Carriers pair(latency);
    for (int k = 0; k < 30; ++k) pair.round();
    const Vector6 f = twist(0.3, 0, 0, 0, 0.15);
    ASSERT_LT((pair.asked[0] - f).norm(), 1e-6);
    ASSERT_EQ(pair.agents[0].pace(), 1);
    ASSERT_EQ(pair.apart(), 0);
    // The first one can do a third of it from now on: torn by (1 − c)‖ẋ̂‖ for d rounds.
    pair.can[0] = 0.1;
    for (int k = 0; k < d; ++k) {
      pair.round();
      EXPECT_LE(pair.apart(), (1 - 0.1 / 0.3) * f.norm() + 1e-6);
      EXPECT_GT(pair.apart(), 0.1);
    }
    // Then by no more than what is tried, in the same direction.
    double torn = 0;
    for (int k = 0; k < 2000; ++k) {
      pair.round();
      EXPECT_LE(pair.apart(), d * 0.01 * f.norm()) << k;
      EXPECT_NEAR(pair.asked[0](4) / pair.asked[0](0), 0.5, 1e-5);
      EXPECT_GT(pair.asked[0](0), 0.1 - 0.3 * 2 / icat::pace_steps);
      torn += pair.apart() / 2000;
    }
    EXPECT_LT(torn, 2e-3 * f.norm());
    // It can follow again: within 1 / recovery rounds and those of the first steps.
    pair.can[0] = 1;
    double last = pair.asked[0](0);
    for (int k = 0; k < 110 + 2 * d; ++k) {
      pair.round();
      if (k > 2 * d) {  // what was tried before the last cut has passed
        EXPECT_GE(pair.asked[0](0), last - 1e-6);
      }
      EXPECT_LE(pair.asked[0](0) - last, 0.0101 * 0.3 + 1e-6);
      last = pair.asked[0](0);
      EXPECT_EQ(pair.apart(), 0);
    }
    EXPECT_EQ(pair.agents[0].agreed_pace(), 1);
    EXPECT_LT((pair.asked[0] - f).norm(), 1e-6);
  }
}

// The limit that is met while all is regained at full rate, the worst case of the bound.
TEST(AgreementPace, TheBoundHoldsWhileThePaceIsRegained) {
  for (int latency = 0; latency <= 3; ++latency) {
    Carriers pair(latency);
    const int d = latency + 1;
    for (int k = 0; k < 30; ++k) pair.round();
    pair.can[0] = 0;
    for (int k = 0; k < 2 * d; ++k) pair.round();
    EXPECT_LT(pair.asked[0].norm(), 1e-3);
    pair.can[0] = 0.2;
    double worst = 0;
    for (int k = 0; k < 300; ++k) {
      pair.round();
      worst = std::max(worst, pair.apart());
    }
    EXPECT_GT(worst, 1e-4);
    EXPECT_LE(worst, d * 0.01 * pair.wish[0].norm() * 1.5 + 1e-6);  // ‖f‖ is 1.5 of it
    EXPECT_NEAR(pair.asked[0](0), 0.2, d * 0.01 * 0.3 + 1e-4);
  }
}

TEST(AgreementPace, WithoutACutItIsThePapersMean) {
  Carriers with(0), without(0, false);
  for (int k = 0; k < 50; ++k) {
    with.round();
    without.round();
    EXPECT_LT((with.asked[0] - without.asked[0]).norm(), 5e-7);
  }
  without.can[0] = 0.1;
  for (int k = 0; k < 50; ++k) without.round();
  EXPECT_GT(without.apart(), 0.1);
  EXPECT_EQ(without.agents[0].pace(), 1);
  // One that need not move does not hold back the other.
  with.wish[0].setZero();
  with.round();
  EXPECT_NEAR(with.asked[1](0), 0.2, 1e-6);
  EXPECT_EQ(with.apart(), 0);
}

TEST(AgreementPace, RoundingIsNoCutAndBadInputChangesNothing) {
  Carriers pair(0);
  for (int k = 0; k < 30; ++k) pair.round();
  Agreement& a = pair.agents[0];
  const Vector6 asked = pair.asked[0];
  ASSERT_EQ(a.achieved(asked, (1 - 5e-5) * asked), Status::ok);
  ASSERT_EQ(a.achieved(twist(0.1, 0, 0, 1e-7), twist(0.1, 0, 0, -1e-7)), Status::ok);
  EXPECT_EQ(a.pace(), 1);
  ASSERT_EQ(a.achieved(asked, Vector6::Constant(NAN)), Status::non_finite);
  ASSERT_EQ(a.achieved(Vector6::Constant(INFINITY), asked), Status::non_finite);
  EXPECT_EQ(a.pace(), 1);
  // The part that loses most counts.
  Vector6 done = asked;
  done.tail<3>() *= 0.25;
  ASSERT_EQ(a.achieved(asked, done), Status::ok);
  EXPECT_NEAR(a.pace(), 0.25, 1e-12);
  // The wrong way is no way.
  ASSERT_EQ(a.achieved(asked, -asked), Status::ok);
  EXPECT_EQ(a.pace(), 0);
}

}  // namespace
