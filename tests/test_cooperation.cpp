// SPDX-License-Identifier: BSD-3-Clause
// Message, fusion, agreement, agents, and the centralised baseline.
#include <gtest/gtest.h>

#include <icat/icat.hpp>
#include <memory>
#include <random>

namespace {

using Robot = icat::Uvms<double, 7>;
using Vector6 = icat::Vector6<double>;
using Matrix6 = icat::Matrix6<double>;
using Pose = icat::Pose<double>;
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

TEST(Agreement, StaysFinite) {
  Agreement agent(
      Options{.policy = {.fuse = [](const auto&) { return Vector6::Constant(NAN).eval(); }}});
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
  EXPECT_THROW(Agreement(Options{.policy = {}}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.policy = icat::fusion::convex_combination<double>({1.0})}),
               std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.hold = 0}), std::invalid_argument);
  EXPECT_THROW(Agreement(Options{.fade = -1}), std::invalid_argument);
}

// --- agents --------------------------------------------------------------------------------------

/// A robot that holds an object somewhere in front of it, with a task that keeps the tool from
/// rising: a lower bound on its depth, as a ceiling of rock would be.
struct Holder {
  explicit Holder(double yaw, double shallowest, const Vector6& goal)
      : robot({.arm = icat::maris_arm<double>(), .arm_mount = icat::maris_arm_mount<double>()}),
        ceiling(robot, {.name = "ceiling",
                        .evaluate =
                            [](const Robot& r, auto& x, auto& J) {
                              x(0) = r.tool().translation().z();
                              J.row(0) = r.tool_jacobian(icat::Frame::world).row(2);
                            },
                        .objective = icat::Objective<double>::at_least(shallowest, 0.1)}),
        tool(robot, icat::task::PoseTaskOptions<double>{.name = "tool", .gain = 0.5}),
        still_vehicle(robot) {
    icat::Vector<double, 7> q;
    q << 0.2, 0.7, -0.1, -1.6, 0.3, 0.9, 0;
    Pose vehicle = Pose::Identity();
    vehicle.linear() = icat::axis_rotation<double>({0, 0, 1}, yaw);
    EXPECT_EQ(robot.update(q, vehicle), Status::ok);
    // The object's frame has the world's orientation and is at the origin.
    EXPECT_EQ(robot.set_tool(robot.tool().inverse() * object()), Status::ok);
    Pose target = object();
    target.translation() += goal.head<3>();
    tool.set_goal(target);
  }
  static Pose object() {
    Pose p = Pose::Identity();
    p.translation() << 0.4, 0.1, 1.5;
    return p;
  }
  std::vector<icat::Action<Robot>> actions() {
    return {{"alone", {{ceiling}, {tool}, {still_vehicle}}},
            {"carry", {{ceiling}, {tool}, {still_vehicle}}}};
  }
  Robot robot;
  icat::task::FunctionTask<Robot> ceiling;
  icat::task::ToolPose<Robot> tool;
  icat::task::VehicleMotionMinimality<Robot> still_vehicle;
};

struct Pair {
  // a, at a depth of 1.5 m, is 2 cm too close to its ceiling; b does not know of it.
  explicit Pair(bool spans, icat::Scheme scheme = icat::Scheme::whole_body,
                const Vector6& goal = twist(0.3, -0.2, -0.4))
      : a(0.3, 1.52, goal), b(2.5, -10, goal) {
    std::size_t i = 0;
    for (Holder* h : {&a, &b}) {
      agents.push_back(std::make_unique<icat::Agent<Robot>>(
          h->robot, h->actions(), std::vector<icat::SharedAction<Robot>>{{"carry", h->tool}},
          icat::Agent<Robot>::Options{.controller = {.scheme = scheme},
                                      .agreement = {.index = i++, .spans = spans, .fade = 0.01}}));
    }
  }
  void cycle(double t, const Vector6& measured = Vector6::Zero()) {
    const long long round = round_++;
    for (auto& agent : agents) ASSERT_EQ(agent->propose(t, measured), Status::ok);
    ASSERT_EQ(agents[1]->receive(0, round, agents[0]->send(round)), Status::ok);
    ASSERT_EQ(agents[0]->receive(1, round, agents[1]->send(round)), Status::ok);
    for (auto& agent : agents) ASSERT_EQ(agent->step(t, measured), Status::ok);
  }
  Vector6 tool_velocity(std::size_t i) const {
    const Holder& h = i == 0 ? a : b;
    return h.robot.tool_jacobian(icat::Frame::tool) * agents[i]->velocity();
  }
  Holder a, b;
  std::vector<std::unique_ptr<icat::Agent<Robot>>> agents;
  long long round_ = 0;
};

TEST(Agent, BothCommandTheAgreedToolVelocity) {
  Pair pair(false);
  for (auto& agent : pair.agents) ASSERT_EQ(agent->start("carry", 0), Status::ok);
  for (int k = 0; k < 5; ++k) pair.cycle(0.01 * k);
  const Vector6 agreed = pair.agents[0]->agreed_velocity();
  EXPECT_EQ(agreed, pair.agents[1]->agreed_velocity());
  EXPECT_GT(agreed.norm(), 0.05);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT((pair.tool_velocity(i) - agreed).norm(), 1e-12);
    EXPECT_EQ(pair.agents[i]->agreement_activation(), 1);
  }
  // ẋ̄ on ⟨t⟩, which has the world's orientation here: γ times the way to go.
  EXPECT_LT((pair.agents[1]->desired() - 0.5 * twist(0.3, -0.2, -0.4)).norm(), 1e-12);
}

// Beyond the paper: the mean pulls the tool of a through its ceiling, the intersection does not.
TEST(Agent, TheMeanDisturbsASafetyTaskTheIntersectionOfSpansDoesNot) {
  for (const bool spans : {false, true}) {
    Pair pair(spans);
    for (auto& agent : pair.agents) ASSERT_EQ(agent->start("carry", 0), Status::ok);
    for (int k = 0; k < 5; ++k) pair.cycle(0.01 * k);
    const double wanted = pair.a.ceiling.reference()(0);
    ASSERT_EQ(pair.a.ceiling.activation()(0), 1);
    ASSERT_GT(wanted, 0);  // down, away from it
    // Alone a would keep it.
    EXPECT_NEAR(pair.agents[0]->own().report().levels()[0].tracking_error, 0, 1e-9);
    const double sinking = pair.tool_velocity(0)(2);
    if (spans) {
      EXPECT_NEAR(sinking, wanted, 1e-6);  // float32
      // And what is free is still the mean.
      EXPECT_NEAR(pair.tool_velocity(0)(0), 0.15, 1e-6);
      EXPECT_NEAR(pair.tool_velocity(0)(1), -0.1, 1e-6);
    } else {
      EXPECT_LT(sinking, -0.02);  // up, against it
    }
    EXPECT_LT((pair.tool_velocity(0) - pair.tool_velocity(1)).norm(), 1e-12);
  }
}

TEST(Agent, TransitionsAreContinuousAndAloneIsThePlainController) {
  Pair pair(true);
  std::array<icat::Vector<double, 13>, 2> last;
  const double dt = 1e-3;
  for (auto& agent : pair.agents) ASSERT_EQ(agent->start("alone", 0), Status::ok);
  for (int k = 0; k <= 3000; ++k) {
    const double t = k * dt;
    for (auto& agent : pair.agents) {
      if (k == 500 || k == 1900) {
        ASSERT_EQ(agent->switch_to(k == 500 ? "carry" : "alone", t, 1), Status::ok);
      }
    }
    pair.cycle(t);
    for (std::size_t i = 0; i < 2; ++i) {
      const auto& v = pair.agents[i]->velocity();
      // The robots stand still, so only the activations change.
      if (k > 0) {
        EXPECT_LT((v - last[i]).norm(), 0.02) << k;
      }
      last[i] = v;
    }
    if (k == 400 || k == 3000) {
      for (auto& agent : pair.agents) {
        EXPECT_EQ(agent->agreement_activation(), 0);
        EXPECT_EQ(agent->velocity(), agent->own().velocity());
        EXPECT_LT((agent->second().velocity() - agent->own().velocity()).norm(),
                  k == 400 ? 10.0 : 1e-9);  // not solved before the first transition
      }
    }
  }
}

TEST(Agent, TheArmMakesUpForTheVehicle) {
  Pair pair(false, icat::Scheme::parallel);
  for (auto& agent : pair.agents) ASSERT_EQ(agent->start("carry", 0), Status::ok);
  const Vector6 measured = twist(0.05, -0.03, 0.02, 0.01, 0.02, -0.01);
  for (int k = 0; k < 5; ++k) pair.cycle(0.01 * k, measured);
  for (std::size_t i = 0; i < 2; ++i) {
    const Holder& h = i == 0 ? pair.a : pair.b;
    icat::Vector<double, 13> actual = pair.agents[i]->velocity();
    actual.tail<6>() = measured;
    EXPECT_LT(
        (h.robot.tool_jacobian(icat::Frame::tool) * actual - pair.agents[i]->agreed_velocity())
            .norm(),
        1e-9);
    // The law of Eq. (24) says the same, and goes on saying it without a solver.
    ASSERT_EQ(pair.agents[i]->step_arm_law(0.05), Status::ok);
    EXPECT_LT((pair.agents[i]->joint_velocity(measured) - pair.agents[i]->joint_velocity()).norm(),
              1e-9);
    actual.tail<6>() = -2 * measured;
    actual.head<7>() = pair.agents[i]->joint_velocity(Vector6(-2 * measured));
    EXPECT_LT(
        (h.robot.tool_jacobian(icat::Frame::tool) * actual - pair.agents[i]->agreed_velocity())
            .norm(),
        1e-9);
    EXPECT_TRUE(pair.agents[i]->joint_velocity(Vector6(Vector6::Constant(NAN))).isZero());
  }
}

TEST(Agent, FilterAndCorrection) {
  Pair pair(false);
  auto& plain = *pair.agents[0];
  icat::Agent<Robot> slow(pair.a.robot, pair.a.actions(), {{"carry", pair.a.tool}},
                          icat::Agent<Robot>::Options{.agreement = {.fade = 0.01}, .filter = 0.5});
  for (auto& agent : pair.agents) ASSERT_EQ(agent->start("carry", 0), Status::ok);
  ASSERT_EQ(slow.start("carry", 0), Status::ok);
  const double dt = 0.01;
  for (int k = 0; k <= 100; ++k) {
    pair.cycle(dt * k);
    ASSERT_EQ(slow.propose(dt * k), Status::ok);
    (void)slow.send(k);
    ASSERT_EQ(slow.receive(1, k, pair.agents[1]->send(k)), Status::ok);
    const Vector6 correction = twist(0, 0.01, 0);
    ASSERT_EQ(slow.step(dt * k, Vector6::Zero(), correction), Status::ok);
    const Vector6 commanded = pair.a.robot.tool_jacobian(icat::Frame::tool) * slow.velocity();
    EXPECT_LT((commanded - correction - slow.agreed_velocity()).norm(), 1e-12);
  }
  // The input was there from 0.01 s on, at 0 s it faded in.
  const Vector6 expected = (1 - std::exp(-1.0 / 0.5)) * plain.agreed_velocity();
  EXPECT_LT((slow.agreed_velocity() - expected).norm(), 1e-3);
  EXPECT_THROW(icat::Agent<Robot>(pair.a.robot, pair.a.actions(), {{"carry", pair.a.tool}},
                                  icat::Agent<Robot>::Options{.filter = -1}),
               std::invalid_argument);
}

TEST(Agent, RefusesWhatCannotBeShared) {
  Holder h(0, 1, Vector6::Zero());
  const auto with = [&](std::vector<icat::SharedAction<Robot>> shared) {
    icat::Agent<Robot> agent(h.robot, h.actions(), shared, icat::Agent<Robot>::Options{});
  };
  EXPECT_NO_THROW(with({}));
  EXPECT_THROW(with({{"fly", h.tool}}), std::invalid_argument);
  EXPECT_THROW(with({{"carry", h.tool}, {"carry", h.tool}}), std::invalid_argument);
  icat::task::ToolPose<Robot> norm(
      h.robot, icat::task::PoseTaskOptions<double>{.norms = icat::task::PoseNorms<double>{}});
  const auto norm_form = [&] {
    icat::Agent<Robot> agent(h.robot, {{"carry", {{norm}}}}, {{"carry", norm}},
                             icat::Agent<Robot>::Options{});
  };
  EXPECT_THROW(norm_form(), std::invalid_argument);
  icat::task::ToolPose<Robot> other(h.robot, icat::task::PoseTaskOptions<double>{});
  EXPECT_THROW(with({{"carry", other}}), std::invalid_argument);
}

TEST(Agent, ABadCycleKeepsItFinite) {
  Pair pair(true, icat::Scheme::parallel);
  for (auto& agent : pair.agents) ASSERT_EQ(agent->start("carry", 0), Status::ok);
  for (int k = 0; k < 5; ++k) pair.cycle(0.01 * k);
  auto& agent = *pair.agents[0];
  EXPECT_EQ(agent.step(0.05, Vector6::Constant(NAN)), Status::non_finite);
  EXPECT_TRUE(agent.velocity().allFinite());
  Pose nowhere = Pose::Identity();
  nowhere.translation().setConstant(NAN);
  pair.a.tool.set_goal(nowhere);
  EXPECT_EQ(agent.propose(0.06), Status::non_finite);
  EXPECT_EQ(agent.step(0.06), Status::ok);  // goes on with what was agreed
  EXPECT_TRUE(agent.velocity().allFinite());
  EXPECT_EQ(agent.switch_to("fly", 0.06, 1), Status::unknown_action);
}

// What is not actuated cannot give way: the joints that a safety task holds must stay.
TEST(Agent, SpansKnowWhatIsNotActuated) {
  for (const bool actuated : {true, false}) {
    Holder a(0.3, -10, twist(0.3, 0.2, 0.1)), b(2.5, -10, twist(-0.2, 0.1, 0.3));
    icat::task::FunctionTask<Robot> lock(a.robot,
                                         {.name = "lock",
                                          .rows = 2,
                                          .evaluate =
                                              [](const Robot& r, auto& x, auto& J) {
                                                x << r.q()(1), r.q()(3);
                                                J(0, 1) = J(1, 3) = 1;
                                              },
                                          .objective = icat::Objective<double>::at_least(5, 0.1),
                                          .gain = 1e-9});
    const std::vector<icat::Action<Robot>> actions{{"carry", {{lock}, {a.tool}}}};
    icat::Agent<Robot>::Options options;
    options.agreement.spans = true;
    options.agreement.fade = 0.01;
    options.controller.actuated.fill(actuated);
    icat::Agent<Robot> first(a.robot, actions, {{"carry", a.tool}}, options);
    options.agreement.index = 1;
    options.controller.actuated.fill(true);
    icat::Agent<Robot> second(b.robot, b.actions(), {{"carry", b.tool}}, options);
    ASSERT_EQ(first.start("carry", 0), Status::ok);
    ASSERT_EQ(second.start("carry", 0), Status::ok);
    for (int k = 0; k < 5; ++k) {
      ASSERT_EQ(first.propose(0.01 * k), Status::ok);
      ASSERT_EQ(second.propose(0.01 * k), Status::ok);
      ASSERT_EQ(second.receive(0, k, first.send(k)), Status::ok);
      ASSERT_EQ(first.receive(1, k, second.send(k)), Status::ok);
      ASSERT_EQ(first.step(0.01 * k), Status::ok);
    }
    EXPECT_GT(first.velocity().norm(), 1e-3);
    // 0.3 rad/s if the vehicle counted as free; what is left is the regularization of a short arm.
    EXPECT_NEAR(first.velocity()(1), 0, 0.02) << actuated;
    EXPECT_NEAR(first.velocity()(3), 0, 0.02) << actuated;
  }
}

TEST(Agent, StepReportsWhatTheControllerReports) {
  Pair pair(false);
  auto& agent = *pair.agents[0];
  EXPECT_EQ(agent.step(0), Status::not_started);
  ASSERT_EQ(agent.start("alone", 1), Status::ok);
  ASSERT_EQ(agent.propose(1), Status::ok);
  EXPECT_EQ(agent.step(1), Status::ok);
  EXPECT_EQ(agent.step(NAN), Status::non_finite);
  EXPECT_EQ(agent.step(0.5), Status::time_reversed);
}

// --- centralised ---------------------------------------------------------------------------------

TEST(Centralized, StaysInTheKernelOfTheGraspAndEqualsALevelOnTop) {
  Pair pair(false);
  icat::CentralizedController<Robot> central(
      {{pair.a.robot, pair.a.actions()}, {pair.b.robot, pair.b.actions()}}, {});
  ASSERT_EQ(central.start("carry", 0), Status::ok);
  ASSERT_EQ(central.step(0, 1), Status::ok);
  Eigen::Matrix<double, 6, 26> G;
  G << pair.a.robot.tool_jacobian(icat::Frame::tool),
      -pair.b.robot.tool_jacobian(icat::Frame::tool);
  icat::Vector<double, 26> y;
  y << central.velocity(0), central.velocity(1);
  EXPECT_LT((G * y).norm(), 1e-12);
  // The safety task of a comes first for both.
  const double wanted = pair.a.ceiling.reference()(0);
  EXPECT_NEAR((pair.a.robot.tool_jacobian(icat::Frame::world) * central.velocity(0))(2), wanted,
              1e-9);
  // G ẏ = 0 as the first level of a plain hierarchy is the same problem.
  icat::Tpik<double, 26> tpik;
  tpik.reset();
  ASSERT_EQ(tpik.add_level(G, Vector6::Ones(), Vector6::Zero()), Status::ok);
  for (const bool first : {true, false}) {
    const auto stack = [&](icat::Task<Robot>& a, icat::Task<Robot>& b) {
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(a.rows() + b.rows(), 26);
      J.topLeftCorner(a.rows(), 13) = a.jacobian();
      J.bottomRightCorner(b.rows(), 13) = b.jacobian();
      Eigen::VectorXd activation(J.rows()), reference(J.rows());
      activation << a.activation(), b.activation();
      reference << a.reference(), b.reference();
      ASSERT_EQ(tpik.add_level(J, activation, reference), Status::ok);
    };
    if (first) {
      stack(pair.a.ceiling, pair.b.ceiling);
    } else {
      stack(pair.a.tool, pair.b.tool);
      stack(pair.a.still_vehicle, pair.b.still_vehicle);
    }
  }
  ASSERT_EQ(tpik.minimize_velocity(), Status::ok);
  EXPECT_LT((tpik.velocity() - y).norm(), 1e-9);
  // Without the object, both are on their own.
  ASSERT_EQ(central.step(0, 0), Status::ok);
  for (auto& agent : pair.agents) {
    ASSERT_EQ(agent->start("alone", 0), Status::ok);
    ASSERT_EQ(agent->propose(0), Status::ok);
    ASSERT_EQ(agent->step(0), Status::ok);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT((central.velocity(i) - pair.agents[i]->velocity()).norm(), 1e-9);
  }
  EXPECT_EQ(central.step(0, 1.5), Status::activation_out_of_range);
}

TEST(Centralized, AnyNumberOfRobots) {
  Holder a(0.3, -10, twist(0.1, 0, 0)), b(2.5, -10, twist(0, 0.1, 0)), c(-2, -10, twist(0, 0, 0.1));
  icat::CentralizedController<Robot> central(
      {{a.robot, a.actions()}, {b.robot, b.actions()}, {c.robot, c.actions()}}, {});
  ASSERT_EQ(central.start("carry", 0), Status::ok);
  ASSERT_EQ(central.step(0, 1), Status::ok);
  const Vector6 object = a.robot.tool_jacobian(icat::Frame::tool) * central.velocity(0);
  EXPECT_GT(object.norm(), 0.01);
  EXPECT_LT((b.robot.tool_jacobian(icat::Frame::tool) * central.velocity(1) - object).norm(),
            1e-12);
  EXPECT_LT((c.robot.tool_jacobian(icat::Frame::tool) * central.velocity(2) - object).norm(),
            1e-12);
  const auto one = [&] { icat::CentralizedController<Robot>({{a.robot, a.actions()}}, {}); };
  EXPECT_THROW(one(), std::invalid_argument);
}

}  // namespace
