// SPDX-License-Identifier: BSD-3-Clause
// Message, fusion and agreement.
#include <gtest/gtest.h>

#include <icat/cooperation/agreement.hpp>
#include <random>

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
  // Bad input.
  spans[0](0, 0) = NAN;
  EXPECT_EQ(intersection.nearest(mean, {said, spans, {}}), Vector6::Zero());
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

// A clock that was set back: the agreement is too old, the velocity fades from what it was.
TEST(Agreement, RestartsAtAnEarlierTime) {
  Agreement agent(Options{.hold = 0.5, .fade = 1});
  ASSERT_EQ(agent.propose(twist(1, 0, 0), Vector6::Zero()), Status::ok);
  ASSERT_EQ(agent.receive(1, 0, agent.send(0)), Status::ok);
  for (const double t : {100.0, 100.4}) (void)agent.update(t);
  ASSERT_EQ(agent.receive(1, 1, agent.send(1)), Status::ok);
  for (const double t : {100.5, 101.0}) (void)agent.update(t);
  ASSERT_EQ(agent.velocity(), twist(1, 0, 0));
  agent.restart(0);
  EXPECT_EQ(agent.update(0), twist(1, 0, 0));
  EXPECT_FALSE(agent.agreed());
  EXPECT_LT((agent.update(0.5) - twist(0.5, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(agent.update(1), Vector6::Zero());
  ASSERT_EQ(agent.receive(1, 2, agent.send(2)), Status::ok);
  for (const double t : {1.0, 1.25, 1.5}) (void)agent.update(t);
  EXPECT_LT((agent.velocity() - twist(0.5, 0, 0)).norm(), 1e-7);
  EXPECT_TRUE(agent.agreed());
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
}

}  // namespace
