// SPDX-License-Identifier: BSD-3-Clause
// The hand: links and joints, what motors and cables do, which pipes it holds and which it does
// not, and what the currents tell of that.
#include <gtest/gtest.h>

#include <cmath>
#include <icat/control/grasp_detector.hpp>
#include <icat/mission/maris_mission.hpp>
#include <icat/sim/grasp_plant.hpp>
#include <random>
#include <string>

#include "support/allocation_counter.hpp"
#include "support/sanitized.hpp"

namespace {

using icat::distal_group;
using icat::GraspState;
using icat::palm_group;
using icat::PipeShape;
using icat::Pose;
using icat::Preshape;
using icat::proximal_group;
using icat::Status;
using icat::Vector3;
using icat::Vector6;
using Hand = icat::MarisHand<double>;
using Angles = Hand::Angles;
using Plant = icat::HandPlant<double>;
using Detector = icat::GraspDetector<double>;
using Command = icat::HandCommand<double>;
using Reading = icat::HandReading<double>;

constexpr icat::HandFinger fingers[] = {icat::thumb, icat::right_finger, icat::left_finger};
constexpr Preshape shapes[] = {Preshape::parallel, Preshape::power, Preshape::precision};

/// A pipe along y of ⟨h⟩, its middle at (x, z).
Pose<double> across(double x, double z) {
  Pose<double> pose = icat::IdentityPose{};
  pose.matrix() << 0, -1, 0, x, 1, 0, 0, 0, 0, 0, 1, z, 0, 0, 0, 1;
  return pose;
}

TEST(MarisHand, EightJointsOnThreeMotors) {
  const Hand hand;
  int count[3] = {};
  for (const Hand::Joint& joint : Hand::joints) ++count[joint.group];
  EXPECT_EQ(count[distal_group], 3);
  EXPECT_EQ(count[proximal_group], 3);
  EXPECT_EQ(count[palm_group], 2);
  const Angles motors(0.3, -0.2, 0.1);
  const auto q = hand.coupled(motors);
  for (std::size_t j = 0; j < 8; ++j) {
    const Hand::Joint& joint = Hand::joints[j];
    EXPECT_EQ(q(static_cast<int>(j)), joint.sign * motors(joint.group)) << joint.name;
    EXPECT_EQ(hand.coupled(joint.finger, motors)(joint.group), q(static_cast<int>(j)));
    EXPECT_EQ(Hand::sign(joint.finger, joint.group), joint.sign);
  }
  // FR and FL are mirror images, and turn to the middle.
  for (int link = 0; link < 2; ++link) {
    const auto i = static_cast<std::size_t>(link);
    const auto right = hand.links(icat::right_finger, hand.coupled(icat::right_finger, motors))[i];
    const auto left = hand.links(icat::left_finger, hand.coupled(icat::left_finger, motors))[i];
    EXPECT_NEAR(right.to(0), left.to(0), 1e-15);
    EXPECT_NEAR(right.to(1), -left.to(1), 1e-15);
    EXPECT_NEAR(right.to(2), left.to(2), 1e-15);
  }
  const auto tip = [&](double turn) {
    return hand.links(icat::right_finger, {0, 0.5, turn})[1].to(1);
  };
  EXPECT_LT(tip(0.3), tip(0));
}

// ∂p/∂q of points fixed to the links. Central differences of 1e-6 rad: 1e-10 of rounding over 2e-6.
TEST(MarisHand, JacobianAgainstDifferences) {
  const Hand hand;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int run = 0; run < 100; ++run) {
    const Angles q(uniform(random), uniform(random), uniform(random));
    for (const auto f : fingers) {
      for (int link = 0; link < 2; ++link) {
        const double along = uniform(random);
        const auto point = [&](const Angles& at) -> Vector3<double> {
          const auto l = hand.links(f, at)[static_cast<std::size_t>(link)];
          return l.from + along * (l.to - l.from);
        };
        const auto J = hand.jacobian(f, q, link, point(q));
        for (int i = 0; i < 3; ++i) {
          Angles up = q, down = q;
          up(i) += 1e-6, down(i) -= 1e-6;
          const Vector3<double> rate = (point(up) - point(down)) / 2e-6;
          for (int k = 0; k < 3; ++k) EXPECT_NEAR(J(k, i), rate(k), 1e-9);
        }
      }
    }
  }
}

// Parallel fingers meet a pipe where base_x − l₁ sin q − r = R.
TEST(MarisHand, WhereJointsMeetAPipe) {
  const Hand hand;
  const auto& g = hand.geometry();
  EXPECT_NEAR(hand.aperture(hand.preshape(Preshape::parallel)), g.widest, 1e-12);
  for (const Preshape shape : {Preshape::parallel, Preshape::precision}) {
    Angles closed = hand.preshape(shape);
    closed(proximal_group) = hand.upper()(proximal_group);
    closed(distal_group) = hand.lean(shape) - closed(proximal_group);
    EXPECT_NEAR(hand.aperture(closed), g.narrowest, 1e-12);
    EXPECT_GE(closed(distal_group), hand.lower()(distal_group) - 1e-12);
  }
  for (const double diameter : {0.003, 0.004, 0.005, 0.05, 0.1, 0.2}) {
    for (const auto f : fingers) {
      const auto m = hand.meets(f, Preshape::parallel, {diameter / 2, 0.5}, across(0, 0.13));
      EXPECT_EQ(m.met, diameter > g.narrowest) << diameter;
      if (!m.met) continue;
      const double q = std::asin((g.base_x - g.radius - diameter / 2) / g.proximal);
      EXPECT_NEAR(m.motors(proximal_group), q, 1e-6);
      EXPECT_NEAR(hand.distance(f, hand.coupled(f, m.motors), {diameter / 2, 0.5}, across(0, 0.13)),
                  0, 1e-7);
    }
  }
  // Open, 200 mm are clear of all fingers and 210 mm of none.
  for (const auto f : fingers) {
    for (const Preshape shape : {Preshape::parallel, Preshape::power}) {
      const Angles q = hand.coupled(f, hand.preshape(shape));
      EXPECT_GT(hand.distance(f, q, {0.1, 0.5}, across(0, 0.13)), 0);
      EXPECT_LT(hand.distance(f, q, {0.105, 0.5}, across(0, 0.13)), 0);
    }
  }
  // A power grasp wraps round what its proximal links do not touch.
  const auto round = hand.meets(icat::thumb, Preshape::power, {0.015, 0.5}, across(0, 0.03));
  EXPECT_TRUE(round.met);
  EXPECT_EQ(round.motors(proximal_group), hand.upper()(proximal_group));
  EXPECT_GT(round.motors(distal_group), 1);
  // Beside the hand nothing is met.
  Pose<double> beside = across(0, 0.13);
  beside.matrix()(1, 3) = 0.7;
  for (const auto f : fingers) {
    EXPECT_FALSE(hand.meets(f, Preshape::power, {0.05, 0.5}, beside).met);
  }
}

TEST(MarisHand, NearestPointsOfSegments) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&] {
    return Vector3<double>(uniform(random), uniform(random), uniform(random));
  };
  const int steps = 60;
  for (int run = 0; run < (sanitized ? 20 : 200); ++run) {
    const Vector3<double> a = vector(), b = run % 10 == 0 ? a : vector(), c = vector();
    const Vector3<double> d = run % 10 == 1   ? c
                              : run % 10 == 2 ? Vector3<double>(c + (b - a))
                                              : vector();
    const auto n = icat::detail::nearest_points(a, b, c, d);
    double least = 10;
    for (int i = 0; i <= steps; ++i) {
      for (int k = 0; k <= steps; ++k) {
        const Vector3<double> p = a + (b - a) * i / steps, q = c + (d - c) * k / steps;
        least = std::min(least, (p - q).norm());
      }
    }
    EXPECT_LE(n.distance, least + 1e-12);
    EXPECT_GE(n.distance, least - 0.06);  // half a step of both segments, of 3.5 m at most
    EXPECT_NEAR(n.distance, (n.second - n.first).norm(), 1e-12);
  }
  // Parallel: in the middle of what lies side by side.
  const auto n = icat::detail::nearest_points<double>({0, 0, 0}, {1, 0, 0}, {0.5, 1, 0}, {3, 1, 0});
  EXPECT_NEAR(n.first(0), 0.75, 1e-12);
  EXPECT_NEAR(n.distance, 1, 1e-12);
}

template <class Action>
std::string refusal(Action action) {
  try {
    action();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(MarisHand, RefusesWhatIsNoHand) {
  EXPECT_EQ(refusal([] { Hand{{.radius = -1}}; }),
            "MarisHand: a length must be finite and > 0, got -1");
  EXPECT_EQ(refusal([] { Hand{{.proximal = 0.01}}; }),
            "MarisHand: fingers of 0.01 m cannot be 0.0041 to 0.203 m apart");
  EXPECT_EQ(refusal([] { Hand{{.curl = 4}}; }), "MarisHand: curl must be in (0, pi), got 4");
  EXPECT_NE(refusal([] { Hand{{.turn = NAN}}; }), "");
  EXPECT_EQ(refusal([] { Plant(Hand(), {.motor = {.efficiency = 0.6}}); }),
            "HandMotor: a worm gear with efficiency >= 1/2 does not lock, got 0.6");
  EXPECT_NE(refusal([] { Plant(Hand(), {.motor = {.friction = 1}}); }), "");
  EXPECT_NE(refusal([] { Plant(Hand(), {.pad_stiffness = 0}); }), "");
  EXPECT_NE(refusal([] { Detector(Hand(), {.share = 1}); }), "");
  EXPECT_NE(refusal([] { Detector(Hand(), {.settle = 0}); }), "");
  EXPECT_NE(refusal([] { Detector(Hand(), {.settle = 2}); }), "");
  EXPECT_NE(refusal([] { Detector(Hand(), {.filter = NAN}); }), "");
  EXPECT_NE(
      refusal([] { icat::GraspPlant<double>(Plant(), {.shape = {.radius = 0}}, across(0, 0)); }),
      "");
  EXPECT_NE(refusal([] { icat::GraspPlant<double>(Plant(), {.friction = -1}, across(0, 0)); }), "");
  Plant plant;
  const Reading before = plant.reading();
  Command command{.position = {0, 0, 0}, .speed = {1, 1, 1}, .current_limit = {1, 1, 1}};
  EXPECT_EQ(plant.step(command, nullptr, -1), Status::time_reversed);
  EXPECT_EQ(plant.step(command, nullptr, NAN), Status::non_finite);
  command.speed(1) = -1;
  EXPECT_EQ(plant.step(command, nullptr, 0.01), Status::out_of_range);
  command.speed(1) = NAN;
  EXPECT_EQ(plant.step(command, nullptr, 0.01), Status::non_finite);
  command.speed(1) = 1;
  icat::PipeInHand<double> pipe;
  pipe.shape.radius = -1;
  EXPECT_EQ(plant.step(command, &pipe, 0.01), Status::out_of_range);
  pipe.shape.radius = 0.05;
  pipe.pose.matrix()(0, 0) = 2;
  EXPECT_EQ(plant.step(command, &pipe, 0.01), Status::not_a_rotation);
  EXPECT_EQ(plant.reading().position, before.position);
}

// --- motors and cables ---------------------------------------------------------------------------

TEST(HandPlant, JointsFollowTheirMotorsWithoutContact) {
  Plant plant;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  Command command;
  command.speed << 0.3, 0.2, 0.1;
  command.current_limit.setConstant(0.8);
  for (int k = 0; k < 5000; ++k) {
    if (k % 500 == 0) {
      for (int g = 0; g < 3; ++g) {
        const double low = plant.hand().lower()(g), high = plant.hand().upper()(g);
        command.position(g) = low + (high - low) * uniform(random);
      }
    }
    ASSERT_EQ(plant.step(command, nullptr, 0.002), Status::ok);
    const auto q = plant.joints();
    double sum[3] = {};
    for (std::size_t j = 0; j < 8; ++j) {
      sum[Hand::joints[j].group] += Hand::joints[j].sign * q(static_cast<int>(j));
    }
    for (int g = 0; g < 3; ++g) {
      const int count = g == palm_group ? 2 : 3;
      ASSERT_NEAR(sum[g], count * plant.reading().position(g), 1e-12);
      ASSERT_LE(std::abs(plant.reading().speed(g)), command.speed(g) + 1e-12);
      ASSERT_LE(plant.reading().current(g), 0.8);
    }
  }
  // It comes where it is told to, and draws nothing there.
  for (int k = 0; k < 4000; ++k) ASSERT_EQ(plant.step(command, nullptr, 0.005), Status::ok);
  for (int g = 0; g < 3; ++g) {
    EXPECT_NEAR(plant.reading().position(g), command.position(g), 1e-5);
    EXPECT_EQ(plant.reading().current(g), 0);
  }
}

// At the end stops τ = 3 k_c (θ − end): the motor stalls there with the torque of its limit, in
// steps of any length.
TEST(HandPlant, StallsAtItsCurrentLimit) {
  for (const double dt : {0.0005, 0.004, 0.02}) {
    Plant plant;
    const auto& motor = plant.options().motor;
    Command command;
    command.position = plant.reading().position;
    command.position(proximal_group) = 2;
    command.speed.setConstant(0.3);
    command.current_limit.setConstant(0.5);
    for (double t = 0; t < 20; t += dt) {
      ASSERT_EQ(plant.step(command, nullptr, dt), Status::ok);
      ASSERT_LE(plant.reading().current(proximal_group), 0.5);
    }
    const double stretch = motor.torque(0.5) / (3 * motor.cable_stiffness);
    EXPECT_NEAR(plant.reading().position(proximal_group),
                plant.hand().upper()(proximal_group) + stretch, 1e-6);
    EXPECT_NEAR(plant.reading().current(proximal_group), 0.5, 1e-3);
    EXPECT_NEAR(plant.reading().speed(proximal_group), 0, 1e-3);
    EXPECT_EQ(plant.finger(icat::thumb)(proximal_group), plant.hand().upper()(proximal_group));
  }
}

// --- pipes ---------------------------------------------------------------------------------------

struct Scene {
  double diameter = 0.1;
  double depth = 0.1;        ///< of the pipe in the hand
  double offset = 0;         ///< of the hand to the thumb's side, across the pipe
  double along = 0;          ///< of the hand along the pipe
  double yaw = 0, tilt = 0;  ///< of the hand about the vertical, and of its y axis from it
  double density = 1400;     ///< kg/m³
};

/// A hand over a pipe that lies on the floor along x of ⟨0⟩; z of ⟨h⟩ points down, y along the
/// pipe.
struct Rig {
  explicit Rig(const Scene& s = {})
      : plant(Plant(), options(s), lying(s.diameter)), start(hover(s)), hand(start) {}

  static icat::GraspPlant<double>::Options options(const Scene& s) {
    icat::GraspPlant<double>::Options o;
    const double r = s.diameter / 2, water = 1000 * M_PI * r * r;
    // A tube of 3 mm, open at its ends.
    const double share = std::min(1.0, 0.012 / s.diameter);
    o.body = icat::tube<double>(s.density * M_PI * r * r * share, r, 1);
    o.body.displaced_mass = water * share;
    o.body.added_mass << 0, water, water, 0, water / 12, water / 12;
    o.body.quadratic_drag << 0, 550 * s.diameter, 550 * s.diameter, 0, 17 * s.diameter,
        17 * s.diameter;
    o.shape = {r, 0.5};
    return o;
  }
  static Pose<double> lying(double diameter) {
    Pose<double> pose = icat::IdentityPose{};
    pose.matrix()(2, 3) = 4 - diameter / 2;
    return pose;
  }
  static Pose<double> hover(const Scene& s) {
    icat::Matrix3<double> R;
    R << 0, 1, 0, -1, 0, 0, 0, 0, 1;
    R = icat::axis_rotation<double>({0, 0, 1}, s.yaw) *
        icat::axis_rotation<double>({0, 1, 0}, s.tilt) * R;
    Vector3<double> o(s.along, s.offset, 4 - s.diameter / 2);
    o -= s.depth * R.col(2);
    return icat::detail::make_pose(R, o);
  }

  /// The hand goes on with `twist` on ⟨0⟩, its detector at 100 Hz.
  void pass(double time, const Vector3<double>& velocity = {0, 0, 0}) {
    for (double passed = 0; passed < time - 1e-9; passed += 0.01) {
      Vector6<double> twist = Vector6<double>::Zero();
      twist.head<3>() = hand.linear().transpose() * velocity;
      ASSERT_EQ(plant.step(detector.command(), hand, twist, 0.01), Status::ok);
      hand = icat::integrate<double>(hand, twist, 0.01);
      ASSERT_EQ(detector.step(t += 0.01, plant.hand().reading()), Status::ok);
      if (mission) {
        ASSERT_EQ(detector.tell(*mission), Status::ok);
      }
      if (!detector.event().empty()) events += std::string(detector.event()) + ";";
      for (const auto f : fingers) force = std::max(force, plant.hand().force(f));
    }
  }
  /// Opens, closes, waits for what the detector says.
  void grasp(Preshape shape, double current) {
    detector.preshape(shape);
    pass(4);
    ASSERT_EQ(detector.state(), GraspState::open);
    ASSERT_EQ(detector.close(0.3, current), Status::ok);
    for (int k = 0; k < 10 && detector.state() == GraspState::moving; ++k) pass(1);
  }
  /// 0.3 m in 4 s, smoothly.
  void lift() {
    for (int k = 0; k < 400; ++k) {
      const double u = (k + 0.5) / 400;
      pass(0.01, {0, 0, -0.3 / 4 * 30 * u * u * (1 - u) * (1 - u)});
    }
  }
  bool held() const { return !plant.on_floor() && plant.pipe_in_hand().translation().norm() < 0.3; }

  icat::GraspPlant<double> plant;
  Pose<double> start, hand;
  Detector detector;
  double t = 0, force = 0;
  std::string events;
  icat::Mission* mission = nullptr;
};

// The specification [MARIS, II-C]: 5 to 200 mm; precision, parallel and power grasps; about 150 N.
TEST(Grasp, DiametersOfTheSpecification) {
  struct Case {
    double diameter;
    Preshape shape;
    double depth, current;
    bool held;
  };
  // Depth: as far as the pipe comes between the open fingers. That of 210 mm stops at the tips,
  // 28 mm before its middle.
  const Case cases[] = {
      {0.004, Preshape::parallel, 0.14, 0.3, false}, {0.005, Preshape::parallel, 0.14, 0.3, true},
      {0.01, Preshape::precision, 0.155, 0.3, true}, {0.05, Preshape::precision, 0.14, 0.8, true},
      {0.05, Preshape::power, 0.1, 0.5, true},       {0.1, Preshape::power, 0.1, 0.5, true},
      {0.1, Preshape::parallel, 0.14, 0.8, true},    {0.2, Preshape::power, 0.13, 0.5, true},
      {0.2, Preshape::parallel, 0.13, 0.8, true},    {0.21, Preshape::power, 0.212, 0.5, false},
      {0.21, Preshape::parallel, 0.212, 0.8, false}};
  int number = 0;
  for (const Case& c : cases) {
    if (sanitized && ++number % 5 != 1) continue;
    SCOPED_TRACE(c.diameter * 1000);
    Rig rig({.diameter = c.diameter, .depth = c.depth});
    rig.grasp(c.shape, c.current);
    // What is pinched below its middle wedges between fingertips and floor: until it is lifted.
    const bool wedged = c.diameter > 0.2;
    if (!wedged) {
      EXPECT_EQ(rig.events, c.held ? "grasp closed;" : "grasp empty;");
    }
    rig.lift();
    rig.pass(3);
    EXPECT_EQ(rig.held(), c.held);
    EXPECT_EQ(rig.detector.state() == GraspState::grasped, c.held)
        << describe(rig.detector.state());
    EXPECT_LE(rig.force, 150);
    EXPECT_EQ(rig.plant.hand().fingers_touching(), c.held ? 3 : 0);
    // Opened, it lets go.
    rig.detector.open();
    rig.pass(8);
    EXPECT_EQ(rig.detector.state(), GraspState::open);
    EXPECT_EQ(rig.plant.hand().fingers_touching(), 0);
  }
}

TEST(Grasp, NothingBetweenTheFingersIsEmpty) {
  for (const Preshape shape : shapes) {
    if (sanitized && shape != Preshape::precision) continue;
    Rig rig({.along = 3});
    rig.grasp(shape, 0.5);
    EXPECT_EQ(rig.detector.state(), GraspState::empty);
    EXPECT_EQ(rig.events, "grasp empty;");
    EXPECT_EQ(rig.force, 0);
    // The estimate of the joints: end stops, to the last 5 % of the torque and the filter's rest.
    EXPECT_NEAR(rig.detector.joints()(proximal_group), Hand().upper()(proximal_group), 3e-4);
    EXPECT_EQ(rig.detector.command().speed.norm(), 0);
  }
}

// The worm gears hold: no power, no current, the same force, the pipe stays.
TEST(Grasp, HoldsWithoutPower) {
  Rig rig;
  rig.grasp(Preshape::power, 0.5);
  ASSERT_EQ(rig.detector.state(), GraspState::grasped);
  rig.pass(1);
  double before[3];
  for (const auto f : fingers) before[f] = rig.plant.hand().force(f);
  const Pose<double> pipe = rig.plant.pipe_in_hand();
  rig.plant.set_power(false);
  // Until the detector finds out, and longer: its test squeeze has no answer.
  rig.pass(6);
  EXPECT_EQ(rig.detector.state(), GraspState::fault);
  EXPECT_EQ(rig.plant.hand().reading().current.norm(), 0);
  for (const auto f : fingers) {
    EXPECT_GT(before[f], 10);
    EXPECT_NEAR(rig.plant.hand().force(f), before[f], 0.02 * before[f]);
  }
  // At rest it does not creep: what the dynamics have left over.
  EXPECT_LT((rig.plant.pipe_in_hand().translation() - pipe.translation()).norm(), 1e-4);
  rig.lift();
  EXPECT_TRUE(rig.held());
  // What carries it is its weight in water, on the wrist along gravity; what is left of the lift's
  // vibration is 2 %.
  const auto body = Rig::options({}).body;
  const double weight = (body.mass - body.displaced_mass) * 9.81;
  rig.pass(2);
  EXPECT_NEAR((rig.hand.linear() * rig.plant.wrench().head<3>())(2), weight, 0.02 * weight + 0.05);
}

// How far off the hand may be follows from geometry.
TEST(Grasp, MissesAndSlipsByGeometry) {
  const auto attempt = [](const Scene& setup, Preshape shape = Preshape::power) {
    Rig rig(setup);
    rig.grasp(shape, 0.5);
    const bool said = rig.detector.state() == GraspState::grasped;
    if (rig.detector.state() == GraspState::moving) return std::string("moving");
    rig.lift();
    rig.pass(3);
    return std::string(said ? "grasped" : "empty") + (rig.held() ? ", held" : ", left");
  };
  EXPECT_EQ(attempt({.offset = 0.03}), "grasped, held");
  if (sanitized) return;
  EXPECT_EQ(attempt({.yaw = 0.3}), "grasped, held");
  // Beyond the pipe's end, and too high: nothing to close on.
  EXPECT_EQ(attempt({.along = 0.7}), "empty, left");
  EXPECT_EQ(attempt({.depth = 0.26}), "empty, left");
  // Beside it: the pipe is outside of the fingers, pushed away at most.
  EXPECT_EQ(attempt({.offset = 0.21}).substr(5), ", left");
  // A third of a radian is straightened by fingers round the pipe and a palm; parallel fingertips
  // at its end only pinch it: it turns in them, and an end stays on the floor.
  EXPECT_EQ(attempt({.depth = 0.14, .along = 0.48}, Preshape::parallel), "grasped, left");
}

// Too heavy for friction: it closes, and slips on the way; the next test squeeze knows.
TEST(Grasp, SlipIsFoundByATestSqueeze) {
  bool posture = false;
  icat::Mission mission =
      icat::maris_mission({.at_grasp = [] { return true; }, .at_posture = [&] { return posture; }});
  ASSERT_EQ(mission.step(0), Status::ok);
  ASSERT_EQ(mission.raise("object detected"), Status::ok);
  for (int k = 1; k < 10; ++k) ASSERT_EQ(mission.step(0.1 * k), Status::ok);
  ASSERT_EQ(mission.phase(), "close");

  Rig rig({.diameter = 0.06, .depth = 0.145, .density = 80000});
  rig.mission = &mission;
  rig.grasp(Preshape::parallel, 0.3);
  ASSERT_EQ(rig.detector.state(), GraspState::grasped);
  EXPECT_EQ(mission.phase(), "carry");
  rig.lift();
  EXPECT_FALSE(rig.held());
  rig.pass(4);
  EXPECT_EQ(rig.events, "grasp closed;grasp slipped;");
  EXPECT_EQ(icat::grasp_failure(mission), icat::GraspFailure::slipped);
}

// No finger presses with more than 150 N, wherever the pipe is.
TEST(Grasp, ForceIsBounded) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  double most = 0;
  for (int run = 0; run < (sanitized ? 1 : 30); ++run) {
    const Scene setup{.diameter = 0.1 + 0.04 * uniform(random),
                      .depth = 0.12 + 0.02 * uniform(random),
                      .offset = 0.02 * uniform(random),
                      .along = 0.3 * uniform(random),
                      .yaw = 0.3 * uniform(random),
                      .tilt = 0.2 * uniform(random)};
    Rig rig(setup);
    rig.grasp(Preshape::power, 0.5);
    most = std::max(most, rig.force);
  }
  RecordProperty("most", std::to_string(most));
  std::printf("largest force of a finger: %.0f N\n", most);
  EXPECT_LE(most, 150);
  EXPECT_GT(most, 50);
}

TEST(Grasp, FaultsAreToldFromEmptyHands) {
  {  // No power from the start.
    Rig rig;
    rig.plant.set_power(false);
    rig.detector.preshape(Preshape::precision);
    rig.pass(2);
    EXPECT_EQ(rig.detector.state(), GraspState::fault);
    EXPECT_EQ(rig.events, "fault;");
    rig.plant.set_power(true);
    rig.detector.open();
    rig.pass(4);
    EXPECT_EQ(rig.detector.state(), GraspState::open);
  }
  {  // While it closes.
    Rig rig({.along = 3});
    rig.detector.preshape(Preshape::parallel);
    rig.pass(4);
    ASSERT_EQ(rig.detector.close(0.3, 0.5), Status::ok);
    rig.pass(1);
    rig.plant.set_power(false);
    rig.pass(2);
    EXPECT_EQ(rig.events, "fault;");
  }
  {  // Jammed while it opens.
    Rig rig({.along = 3});
    rig.plant.set_jammed(palm_group, true);
    rig.detector.preshape(Preshape::precision);
    rig.pass(2);
    EXPECT_EQ(rig.events, "fault;");
  }
}

TEST(Grasp, RefusedStepsChangeNothing) {
  Rig rig;
  const Command command;
  Vector6<double> twist = Vector6<double>::Zero();
  const Pose<double> before = rig.plant.pipe();
  EXPECT_EQ(rig.plant.step(command, rig.hand, twist, 2), Status::out_of_range);
  EXPECT_EQ(rig.plant.step(command, rig.hand, twist, -0.1), Status::time_reversed);
  twist(2) = NAN;
  EXPECT_EQ(rig.plant.step(command, rig.hand, twist, 0.01), Status::non_finite);
  twist(2) = 0;
  Pose<double> bent = rig.hand;
  bent.matrix()(0, 0) = 3;
  EXPECT_EQ(rig.plant.step(command, bent, twist, 0.01), Status::not_a_rotation);
  EXPECT_EQ(rig.plant.pipe().matrix(), before.matrix());
}

// --- the detector alone --------------------------------------------------------------------------

/// Motors that say what they are told to say, at 100 Hz.
struct Script {
  explicit Script(const Detector::Options& options = {}) : detector(Hand(), options) {
    reading.position = Hand().preshape(Preshape::parallel);
    detector.preshape(Preshape::parallel);
    pass(0.05);
    EXPECT_EQ(detector.state(), GraspState::open);
  }
  void pass(double time) {
    for (double passed = 0; passed < time - 1e-9; passed += 0.01) {
      reading.position += 0.01 * reading.speed;
      status = detector.step(t += 0.01, reading);
      if (!detector.event().empty()) events += std::string(detector.event()) + ";";
    }
  }
  void say(double speed, double current) {
    reading.speed(proximal_group) = speed;
    reading.current(proximal_group) = current;
  }
  Detector detector;
  Reading reading;
  double t = 100;
  Status status = Status::ok;
  std::string events;
};

TEST(GraspDetector, ASpikeIsNoGrasp) {
  Script s;
  ASSERT_EQ(s.detector.close(0.2, 0.5), Status::ok);
  s.say(0.2, 0.16);
  s.pass(1);
  // 50 ms of full current, moving or not.
  for (const double speed : {0.2, 0.0}) {
    s.say(speed, 0.5);
    s.pass(0.05);
    s.say(0.2, 0.16);
    s.pass(0.5);
    EXPECT_EQ(s.detector.state(), GraspState::moving);
  }
  // Full current for long, but moving: no grasp either. Still, but with little: neither.
  s.say(0.01, 0.5);
  s.pass(0.6);
  EXPECT_EQ(s.detector.state(), GraspState::moving);
  s.say(0, 0.25);
  s.pass(0.6);
  EXPECT_EQ(s.detector.state(), GraspState::moving);
  // Both, for 0.2 s; the filter needs 0.03 ln(0.5 − 0.25 over 0.2) s about before.
  s.say(0, 0.5);
  s.pass(0.19);
  EXPECT_EQ(s.detector.state(), GraspState::moving);
  s.pass(0.05);
  EXPECT_EQ(s.detector.state(), GraspState::grasped);
  EXPECT_EQ(s.events, "grasp closed;");
  EXPECT_EQ(s.detector.command().speed.norm(), 0);
}

// A loop that pauses: the time since the last reading is not that of the spike.
TEST(GraspDetector, AReadingAfterAPauseIsNoGrasp) {
  Script s;
  ASSERT_EQ(s.detector.close(0.2, 0.5), Status::ok);
  s.say(0.2, 0.16);
  s.pass(1);
  s.say(0, 0.5);
  ASSERT_EQ(s.detector.step(s.t += 0.2, s.reading), Status::ok);
  EXPECT_EQ(s.detector.state(), GraspState::moving);
  // In a slow loop it takes four.
  for (int k = 0; k < 2; ++k) ASSERT_EQ(s.detector.step(s.t += 0.2, s.reading), Status::ok);
  EXPECT_EQ(s.detector.state(), GraspState::moving);
  ASSERT_EQ(s.detector.step(s.t += 0.2, s.reading), Status::ok);
  EXPECT_EQ(s.detector.state(), GraspState::grasped);
}

// Whatever the readings say, a motor is told to go where its joints can go, and not much further:
// as far as its cables stretch.
TEST(GraspDetector, CommandsStayWithinTheHand) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Detector detector;
  const Hand hand;
  double t = 0;
  for (int k = 0; k < (sanitized ? 20000 : 200000); ++k) {
    switch (random() % 400) {
      case 0:
        detector.preshape(static_cast<Preshape>(random() % 3));
        break;
      case 1:
        (void)detector.close(uniform(random), uniform(random));
        break;
      case 2:
        (void)detector.close(0.3, 0.5);
        break;
      default:
        break;
    }
    Reading reading;
    for (int g = 0; g < 3; ++g) {
      reading.position(g) = std::pow(10, 20 * uniform(random)) * uniform(random);
      reading.speed(g) = random() % 2 ? 0.0 : uniform(random);
      reading.current(g) = uniform(random);
    }
    if (random() % 50 == 0) reading.current(1) = NAN;
    const GraspState before = detector.state();
    (void)detector.step(t += random() % 100 ? 0.01 : 20 * uniform(random), reading);
    EXPECT_TRUE(detector.event().empty() || detector.state() != before);
    const Command& c = detector.command();
    for (int g = 0; g < 3; ++g) {
      ASSERT_TRUE(std::isfinite(c.position(g)) && c.speed(g) >= 0 && c.current_limit(g) <= 0.8);
      if (!(c.speed(g) > 0)) continue;
      ASSERT_LE(c.position(g), std::max(hand.upper()(g), hand.preshape(Preshape::power)(g)) + 0.31);
      ASSERT_GE(c.position(g), hand.lower()(g) - 0.31);
    }
  }
}

TEST(GraspDetector, TestSqueezes) {
  Script s;
  ASSERT_EQ(s.detector.close(0.2, 0.5), Status::ok);
  s.say(0, 0.5);
  s.pass(0.3);
  ASSERT_EQ(s.detector.state(), GraspState::grasped);
  const double held_at = s.reading.position(proximal_group);
  int squeezes = 0;
  bool before = false;
  // It holds: each squeeze meets its current at once. Off in between, with the worm gears' 0 A.
  for (int k = 0; k < 1000; ++k) {
    s.say(0, s.detector.command().speed(proximal_group) > 0 ? 0.5 : 0.0);
    s.pass(0.01);
    squeezes += s.detector.squeezing() && !before;
    before = s.detector.squeezing();
  }
  EXPECT_GE(squeezes, 4);
  EXPECT_LE(squeezes, 5);
  EXPECT_EQ(s.detector.state(), GraspState::grasped);
  // Gone: the motor goes on, with friction's current.
  for (int k = 0; k < 400; ++k) {
    const bool on = s.detector.command().speed(proximal_group) > 0;
    s.say(on ? 0.2 : 0.0, on ? 0.15 : 0.0);
    s.pass(0.01);
  }
  EXPECT_EQ(s.events, "grasp closed;grasp slipped;");
  // Found before the hand had closed: after `travel` and not much more.
  EXPECT_LT(s.reading.position(proximal_group) - held_at, 0.06);
}

TEST(GraspDetector, ReadingsThatAreNone) {
  Script s;
  ASSERT_EQ(s.detector.close(0.2, 0.5), Status::ok);
  s.say(0.2, 0.16);
  s.pass(0.3);
  s.say(0.2, NAN);
  s.reading.speed.setZero();
  s.pass(0.5);
  EXPECT_EQ(s.status, Status::non_finite);
  EXPECT_EQ(s.detector.state(), GraspState::moving);
  s.say(0.2, 0.16);
  s.pass(0.9);
  EXPECT_EQ(s.detector.state(), GraspState::moving);
  s.say(0.2, INFINITY);
  s.pass(1.1);
  EXPECT_EQ(s.events, "fault;");
  EXPECT_EQ(s.detector.command().speed.norm(), 0);
  // A time that is none changes nothing.
  Script other;
  EXPECT_EQ(other.detector.step(NAN, other.reading), Status::non_finite);
  EXPECT_EQ(other.detector.state(), GraspState::open);
  EXPECT_EQ(other.detector.close(0, 0.5), Status::out_of_range);
  EXPECT_EQ(other.detector.close(0.2, 0.2), Status::out_of_range);  // 60 % of it is friction
  EXPECT_EQ(other.detector.close(NAN, 0.5), Status::non_finite);
  EXPECT_EQ(other.detector.state(), GraspState::open);
  // More current than was allowed, and a motor without an answer.
  ASSERT_EQ(other.detector.close(0.2, 0.5), Status::ok);
  other.say(0.2, 0.9);
  other.pass(0.3);
  EXPECT_EQ(other.events, "fault;");
  Script silent;
  ASSERT_EQ(silent.detector.close(0.2, 0.5), Status::ok);
  silent.pass(1.1);
  EXPECT_EQ(silent.events, "fault;");
}

TEST(Grasp, DoesNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  Rig rig;
  icat::GraspPlant<double>& plant = rig.plant;
  const Pose<double> hand = rig.hand;
  const Vector6<double> twist = Vector6<double>::Zero();
  icat::Mission mission =
      icat::maris_mission({.at_grasp = [] { return true; }, .at_posture = [] { return true; }});
  //! [hand]
  icat::GraspDetector<double> detector;
  detector.preshape(icat::Preshape::power);
  //! [hand]
  Status status = Status::ok;
  double t = 0;
  const long count = count_allocations([&] {
    for (int k = 0; k < 900; ++k) {
      t += 0.01;
      if (k == 300) {
        //! [close]
        status = detector.close(0.3, 0.5);  // rad/s, A
        //! [close]
      }
      //! [cycle]
      status = plant.step(detector.command(), hand, twist, 0.01);  // ⟨h⟩ in ⟨0⟩ and its twist
      status = detector.step(t, plant.hand().reading());           // currents, speeds, positions
      status = detector.tell(mission);                             // "grasp closed", …
      //! [cycle]
    }
  });
  EXPECT_EQ(count, 0);
  EXPECT_EQ(status, Status::ok);
  EXPECT_EQ(detector.state(), GraspState::grasped);
}

TEST(Grasp, Float) {
  icat::HandPlant<float> hand;
  icat::GraspDetector<float> detector;
  icat::PipeInHand<float> pipe;
  pipe.pose = across(0, 0.13).cast<float>();
  double t = 0;
  const auto pass = [&](int steps) {
    for (int k = 0; k < steps; ++k) {
      ASSERT_EQ(hand.step(detector.command(), &pipe, 0.001), Status::ok);
      ASSERT_EQ(detector.step(t += 0.001, hand.reading()), Status::ok);
    }
  };
  detector.preshape(Preshape::parallel);
  pass(50);
  ASSERT_EQ(detector.close(0.3F, 0.5F), Status::ok);
  pass(6000);
  EXPECT_EQ(detector.state(), GraspState::grasped);
  EXPECT_EQ(hand.fingers_touching(), 3);
}

}  // namespace
