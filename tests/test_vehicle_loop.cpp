// SPDX-License-Identifier: BSD-3-Clause
// The vehicle's velocity loop, on the vehicle R2 in a current with thrusters that lag and saturate;
// and R2 itself.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "../examples/11_vehicle_loop/simulation.hpp"
#include "support/allocation_counter.hpp"
#include "support/sanitized.hpp"

namespace {

using icat::Status;
using r2::Vector3;
using r2::Vector6;

// The loop's wrench on a body that is exactly its model, heeled, turning, in a current, all six
// components commanded: the body follows the loop's model to the error of a wrench held for dt, so
// the feed-forward has every term of the dynamics.
double apart(double dt) {
  const auto body = icat::r2_vehicle_body<double>();
  const Vector3 current(0.3, -0.2, 0.1);
  r2::Plant::State start;
  start.vehicle.linear() = icat::axis_rotation<double>(Vector3(0.6, 0, 0.8), 0.7);
  start.velocity.head<3>() = -(start.vehicle.linear().transpose() * current);
  r2::Plant plant({.arm = {}, .vehicle = body, .links = {}}, start);
  Vector6 bandwidth;
  bandwidth << 1, 1, 1, 2, 2, 2;
  icat::VehicleLoop<double> loop(body, bandwidth);
  double worst = 0;
  const int steps = static_cast<int>(10 / dt);
  for (int k = 0; k < steps; ++k) {
    const double t = k * dt;
    const icat::Matrix3<double> R = plant.vehicle().linear();
    Vector6 velocity = plant.vehicle_velocity(), reference;
    velocity.head<3>() += R.transpose() * current;
    for (int i = 0; i < 6; ++i) reference(i) = 0.5 * std::sin((0.3 + 0.1 * i) * t + i);
    EXPECT_EQ(
        loop.step(
            t, {.reference = reference, .velocity = velocity, .attitude = R, .current = current}),
        Status::ok);
    worst = std::max(worst, (velocity - loop.model_velocity()).cwiseAbs().maxCoeff());
    EXPECT_EQ(plant.step(loop.wrench(), dt), Status::ok);
  }
  return worst;
}

TEST(VehicleLoop, TheFeedForwardIsTheWholeModel) {
  const double coarse = apart(0.004), fine = apart(0.002);
  EXPECT_LT(coarse, 5e-3);
  EXPECT_GT(coarse, 0);
  EXPECT_NEAR(fine / coarse, 0.5, 0.1);  // of first order in dt, and nothing else
}

TEST(VehicleLoop, AsInTheDocs) {
  const Vector6 reference(icat::Filled{0.1}), velocity(icat::Filled{0.0});
  const icat::Matrix3<double> attitude = icat::IdentityMatrix{};
  const Vector3 current(0.1, 0, 0);
  const double time = 0;
  //! [loop]
  icat::Vector6<double> bandwidth;
  bandwidth << 1, 1, 1, 0, 0, 2;  // rad/s; roll and pitch are not actuated
  icat::VehicleLoop<double> loop(icat::r2_vehicle_body<double>(), bandwidth);
  icat::ThrusterAllocation<double, 8> thrusters(icat::r2_thrusters<double>());

  icat::Status status = loop.step(time, {.reference = reference,  // in each cycle
                                         .velocity = velocity,
                                         .attitude = attitude,
                                         .current = current});
  const icat::Status allocation = thrusters.allocate(loop.wrench());
  const icat::Status told = loop.achieved(thrusters.achieved());
  //! [loop]
  EXPECT_EQ(status, Status::ok);
  EXPECT_EQ(allocation, Status::ok);
  EXPECT_EQ(told, Status::ok);
  EXPECT_EQ(loop.wrench()(3), 0);
  EXPECT_GT(thrusters.achieved()(0), 0);
}

// --- a step of the surge velocity, [MARIS, Fig. 14] ---------------------------------------------

// From behind, and from ahead.
const std::vector<double> currents =
    sanitized ? std::vector<double>{0.1} : std::vector<double>{0.1, -0.1};

TEST(VehicleLoop, AStepInACurrentSettlesWithoutOvershoot) {
  for (const double current : currents) {
    const auto whole = r2::run({.current = current});
    ASSERT_EQ(whole.status, Status::ok);
    EXPECT_LT(whole.settled, 5);
    EXPECT_LT(whole.overshoot, 0.1);
    // No steady bias.
    EXPECT_NEAR(whole.surge.back(), 0.2, 1e-4);

    const auto bare = r2::run({.current = current, .feed_forward = false});
    EXPECT_GT(bare.overshoot, whole.overshoot + 0.1);
    EXPECT_GT(bare.settled, whole.settled);
    // The vehicle is to follow a first-order lag; without the model it does not.
    EXPECT_GT(bare.deviation, 2 * whole.deviation);
  }
}

TEST(VehicleLoop, APayloadShowsUntilTheLoopIsTold) {
  for (const double current : currents) {
    const auto light = r2::run({.current = current});
    const auto heavy = r2::run({.current = current, .mass = 520});
    const auto told = r2::run({.current = current, .mass = 520, .model_mass = 520});
    ASSERT_EQ(heavy.status, Status::ok);
    EXPECT_GT(heavy.overshoot, light.overshoot + 0.001);
    EXPECT_GT(heavy.deviation, light.deviation + 0.01);
    EXPECT_LT(heavy.overshoot, 0.1);  // but the feed-forward's error is all there is
    EXPECT_NEAR(told.overshoot, light.overshoot, 0.001);
    EXPECT_NEAR(told.deviation, light.deviation, 0.01);
    // Where gains are all that a loop has, more mass costs more.
    const auto bare = r2::run({.current = current, .feed_forward = false});
    const auto bare_heavy = r2::run({.current = current, .mass = 520, .feed_forward = false});
    EXPECT_GT(bare_heavy.overshoot, bare.overshoot + 0.01);
  }
}

// While it runs: gains and feed-forward are those of the new body, what it had learnt stays.
TEST(VehicleLoop, ABodyChangesWhileItRuns) {
  const auto heavy = icat::r2_vehicle_body(520.0);
  icat::VehicleLoop<double> changed(icat::r2_vehicle_body<double>(), r2::bandwidth());
  icat::VehicleLoop<double> built(heavy, r2::bandwidth());
  changed.set_body(heavy);
  const Vector6 velocity(icat::Filled{0.0}), reference(icat::Filled{0.2});
  for (int k = 0; k < 200; ++k) {
    for (auto* loop : {&changed, &built}) {
      ASSERT_EQ(loop->step(0.01 * k, {.reference = reference,
                                      .velocity = velocity,
                                      .attitude = icat::IdentityMatrix{}}),
                Status::ok);
    }
    ASSERT_EQ(changed.wrench(), built.wrench());
  }
  const Vector6 integral = built.integral(), model = built.model_velocity();
  built.set_body(icat::r2_vehicle_body(350.0));
  EXPECT_EQ(built.integral(), integral);
  EXPECT_EQ(built.model_velocity(), model);
}

// A step that the thrusters cannot follow.
TEST(VehicleLoop, SaturationDoesNotWindItUp) {
  for (const double current : currents) {
    const auto told = r2::run({.speed = 0.5, .current = current});
    const auto winds = r2::run({.speed = 0.5, .current = current, .anti_windup = false});
    ASSERT_EQ(told.status, Status::ok);
    EXPECT_LT(told.overshoot, 0.005);
    EXPECT_GT(winds.overshoot, 0.05);
    if (sanitized) continue;
    // Out of reach for 10 s, then back to 0: at once.
    const auto back = r2::run({.speed = 0.9, .current = current, .back = 10});
    const auto late = r2::run({.speed = 0.9, .current = current, .anti_windup = false, .back = 10});
    EXPECT_LT(back.settled, 10 + 5);
    EXPECT_GT(late.settled, 10 + 8);
    EXPECT_LT(back.swing_back, 0.005);
  }
}

TEST(VehicleLoop, ACurrentThatIsToldDoesNotBlowItOff) {
  Status status = Status::ok;
  const auto blown = r2::turn(0.1, false, status), holds = r2::turn(0.1, true, status);
  EXPECT_EQ(status, Status::ok);
  EXPECT_GT(blown.back(), 3 * holds.back());
  EXPECT_LT(holds.back(), 0.03);
}

// A thruster that does nothing near zero makes a vehicle wander that would keep still. Noise of 2
// mm/s, as a velocity filter leaves it; more noise hides the difference, and moves the propellers
// through the zone.
TEST(VehicleLoop, TheDeadZoneMakesALimitCycle) {
  if (sanitized) GTEST_SKIP();
  Status status = Status::ok;
  const auto with = r2::station_keeping(0.05, 0.002, status);
  const auto without = r2::station_keeping(0, 0.002, status);
  EXPECT_EQ(status, Status::ok);
  for (const std::size_t minute : {0u, 1u}) EXPECT_GT(with[minute], 3 * without[minute]);
}

// --- input that is bad or late
// --------------------------------------------------------------------

icat::VehicleLoop<double>::Input input(double surge = 0.1) {
  icat::VehicleLoop<double>::Input in;
  in.reference = icat::Filled{0};
  in.reference(0) = surge;
  in.velocity = icat::Filled{0};
  in.attitude = icat::IdentityMatrix{};
  return in;
}
icat::VehicleLoop<double> make_loop() {
  return icat::VehicleLoop<double>(icat::r2_vehicle_body<double>(), r2::bandwidth());
}

TEST(VehicleLoop, BadInputIsHeldThenCoasts) {
  const double nan = std::nan(""), inf = icat::infinity<double>;
  struct Case {
    icat::VehicleLoop<double>::Input in = input();
    icat::InputAge age = {};
    Status status = Status::non_finite;
    bool lasting = false;
  };
  std::vector<Case> cases(9);
  cases[0].in.velocity(4) = nan;  // not controlled, but part of the model
  cases[1].in.reference(0) = inf;
  cases[2].in.current(1) = nan;
  cases[3].in.attitude(2, 2) = nan;
  cases[4].in.attitude *= 2, cases[4].status = Status::not_a_rotation;
  cases[5].in.velocity(0) = 1e200, cases[5].status = Status::implausible;
  cases[6].age.velocity = 0.2, cases[6].status = Status::stale_velocity, cases[6].lasting = true;
  cases[7].age.state = nan, cases[7].status = Status::stale_state, cases[7].lasting = true;
  cases[8].in.reference(5) = -1e7, cases[8].status = Status::implausible;
  for (const Case& bad : cases) {
    auto loop = make_loop();
    for (int k = 0; k < 100; ++k) ASSERT_EQ(loop.step(0.01 * k, input()), Status::ok);
    const Vector6 before = loop.wrench(), integral = loop.integral();
    EXPECT_GT(before(0), 10);
    double last = before(0);
    for (int k = 100; k < 200; ++k) {
      ASSERT_EQ(loop.step(0.01 * k, bad.in, bad.age), bad.status);
      ASSERT_TRUE(loop.wrench().allFinite());
      ASSERT_LE(loop.wrench()(0), last);  // never more, and without a jump
      ASSERT_GE(loop.wrench()(0), last - 0.04 * before(0));
      if (k < 109 && !bad.lasting) {
        ASSERT_EQ(loop.wrench(), before);
      }
      last = loop.wrench()(0);
    }
    EXPECT_EQ(loop.wrench().norm(), 0);
    EXPECT_EQ(loop.integral(), integral);
    // All is well again: from the velocity as it is now.
    auto moves = input();
    moves.velocity(0) = 0.05;
    ASSERT_EQ(loop.step(2, moves), Status::ok);
    EXPECT_EQ(loop.model_velocity()(0), 0.05);
    EXPECT_LT(std::abs(loop.wrench()(0)), 0.01 * before(0));
    for (int k = 201; k < 300; ++k) ASSERT_EQ(loop.step(0.01 * k, moves), Status::ok);
    EXPECT_GT(loop.wrench()(0), 10);
  }
  // What is not controlled may be commanded anything.
  auto loop = make_loop();
  auto in = input();
  in.reference(3) = nan;
  EXPECT_EQ(loop.step(0, in), Status::ok);
  EXPECT_TRUE(loop.wrench().allFinite());
}

TEST(VehicleLoop, TimeThatStandsStill) {
  auto loop = make_loop();
  EXPECT_EQ(loop.step(std::nan(""), input()), Status::non_finite);
  Status status = Status::ok;
  for (int k = 0; k < 50; ++k) status = loop.step(1, input());
  EXPECT_EQ(status, Status::clock_stalled);
  for (int k = 0; k < 10000; ++k) (void)loop.step(1, input());
  EXPECT_EQ(loop.wrench().norm(), 0);
}

TEST(VehicleLoop, WhatTheThrustersGaveMayBeNonsense) {
  auto loop = make_loop();
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-1, 1);
  const double huge[] = {1, 1e3, 1e30, 1e300, std::nan("")};
  for (int k = 0; k < 20000; ++k) {
    auto in = input(0.3 * u(random));
    in.velocity(0) = huge[random() % (random() % 4 == 0 ? 5 : 1)] * u(random);
    (void)loop.step(0.01 * k, in);
    ASSERT_TRUE(loop.wrench().allFinite());
    Vector6 gave = loop.wrench();
    gave(static_cast<int>(random() % 6)) *= huge[random() % 5] * u(random);
    (void)loop.achieved(gave);
    ASSERT_TRUE(loop.model_velocity().allFinite());
    ASSERT_TRUE(loop.integral().allFinite());
  }
}

TEST(VehicleLoop, ConstructionThrowsWithNamesAndNumbers) {
  const auto message = [](auto&& make) -> std::string {
    try {
      make();
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "no exception";
  };
  using Loop = icat::VehicleLoop<double>;
  const auto body = icat::r2_vehicle_body<double>();
  EXPECT_EQ(message([&] { Loop(body, Vector6(icat::Filled{-1})); }),
            "VehicleLoop: bandwidth 0 must be finite and >= 0, got -1");
  // Too large for gains; for a period none is refused.
  EXPECT_EQ(message([&] { Loop(body, Vector6(icat::Filled{1e200})); }),
            "VehicleLoop: bandwidth 0 is too large, got 1e+200");
  auto bad = body;
  bad.mass = 0;
  EXPECT_EQ(message([&] { Loop(bad, r2::bandwidth()); }),
            "VehicleLoop: mass of the vehicle must be finite and > 0, got 0");
  EXPECT_EQ(message([&] { Loop(body, r2::bandwidth(), {.hold = 0}); }),
            "the controller: hold must be finite and > 0, got 0");
  Loop loop(body, r2::bandwidth());
  bad = body;
  bad.quadratic_drag(2) = -3;
  EXPECT_EQ(message([&] { loop.set_body(bad); }),
            "VehicleLoop: quadratic_drag 2 of the vehicle must be finite and >= 0, got -3");
}

// What `cycles` leave of an error of 1 m/s on a body that is the model, for ωT = x, with the
// velocity so many cycles late.
double left(double x, std::size_t late, int cycles) {
  icat::RigidBody<double> body;  // in vacuum
  body.mass = 10;
  const double dt = 0.01;
  Vector6 bandwidth = Vector6::Zero();
  bandwidth(0) = x / dt;
  icat::VehicleLoop<double> loop(body, bandwidth, {.max_step = 1});
  std::vector<double> v(late + 1, 0.0);  // the first is measured
  icat::VehicleLoop<double>::Input in{.reference = Vector6::Zero(),
                                      .velocity = Vector6::Zero(),
                                      .attitude = icat::IdentityMatrix{}};
  for (int k = 0; k < cycles; ++k) {
    in.velocity(0) = v.front();
    if (loop.step(k * dt, in) != Status::ok) return 1e9;
    if (k == 0) v.assign(late + 1, 1.0);  // a push that the model does not know
    v.push_back(v.back() + loop.wrench()(0) / body.mass * dt);
    v.erase(v.begin());
  }
  return std::abs(v.back());
}

TEST(VehicleLoop, WhatThePeriodAllows) {
  for (const double x : {0.01, 0.25, 0.9, 1.9}) EXPECT_LT(left(x, 0, 2000), 1e-3) << x;
  EXPECT_GT(left(2.1, 0, 400), 1e3);
  EXPECT_LT(left(0.43, 1, 2000), 1e-3);
  EXPECT_GT(left(0.49, 1, 2000), 1e3);
}

TEST(VehicleLoop, Float) {
  icat::VehicleLoop<float> single(icat::r2_vehicle_body<float>(), r2::bandwidth().cast<float>());
  auto loop = make_loop();
  for (int k = 0; k < 300; ++k) {
    auto in = input();
    in.velocity(0) = 1e-4 * k;
    icat::VehicleLoop<float>::Input small;
    small.reference = in.reference.cast<float>();
    small.velocity = in.velocity.cast<float>();
    small.attitude = in.attitude.cast<float>();
    ASSERT_EQ(loop.step(0.01 * k, in), Status::ok);
    ASSERT_EQ(single.step(0.01 * k, small), Status::ok);
    ASSERT_NEAR(single.wrench()(0), loop.wrench()(0), 0.01);
    ASSERT_EQ(single.achieved(0.5F * single.wrench()), Status::ok);
    ASSERT_EQ(loop.achieved(0.5 * loop.wrench()), Status::ok);
  }
}

TEST(VehicleLoop, AllocatesNothing) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  auto loop = make_loop();
  auto bad = input();
  bad.velocity(0) = std::nan("");
  EXPECT_EQ(count_allocations([&] {
              for (int k = 0; k < 100; ++k) {
                (void)loop.step(0.01 * k, k % 3 ? input() : bad);
                (void)loop.achieved(loop.wrench());
              }
            }),
            0);
}

// --- R2
// -------------------------------------------------------------------------------------------

// A vehicle that was heeled and let go swings about upright. For small angles I φ̈ + d φ̇ + m_d g h φ
// = 0 with added mass in I; quadratic drag and sin φ matter less than 1 % at 0.02 rad.
TEST(R2, HeeledItSwingsBack) {
  const auto body = icat::r2_vehicle_body<double>();
  for (const int axis : {0, 1}) {
    const Vector3 about = Vector3::Unit(axis);
    r2::Plant::State start;
    start.vehicle.linear() = icat::axis_rotation<double>(about, 0.02);
    r2::Plant plant({.arm = {}, .vehicle = body, .links = {}}, start);
    const double inertia = body.inertia(axis, axis) + body.added_mass(3 + axis);
    const double stiffness = body.displaced_mass * 9.81 * 0.05;
    const double damping = body.linear_drag(3 + axis) / (2 * inertia);
    const double expected =
        2 * std::numbers::pi / std::sqrt(stiffness / inertia - damping * damping);
    std::vector<double> crossings;
    double before = 0.02;
    const double dt = 0.001;
    for (int k = 1; k * dt < 12; ++k) {
      ASSERT_EQ(plant.step(Vector6::Zero(), dt), Status::ok);
      const double angle =
          icat::rotation_log<double>(icat::Matrix3<double>(plant.vehicle().linear()))(axis);
      if ((angle < 0) != (before < 0)) crossings.push_back(k * dt);
      before = angle;
    }
    ASSERT_GE(crossings.size(), 3u);
    EXPECT_NEAR(crossings[2] - crossings[0], expected, 0.01 * expected) << axis;
  }
}

TEST(R2, Bodies) {
  for (const double mass : {350.0, 400.0, 500.0}) {
    const auto body = icat::r2_vehicle_body(mass);
    EXPECT_EQ(body.mass, mass);
    // The box in its parts: along x less of it meets the water than along y and z.
    EXPECT_LT(body.added_mass(0), body.added_mass(1));
    EXPECT_LT(body.quadratic_drag(0), body.quadratic_drag(1));
    EXPECT_NEAR(body.quadratic_drag(0), 320 * 0.9 * 1.0, 1e-9);
    EXPECT_NEAR(body.quadratic_drag(2), 430 * 1.3 * 0.9, 1e-9);
    EXPECT_NEAR(body.inertia(2, 2), mass / 12 * (1.3 * 1.3 + 0.9 * 0.9), 1e-9);
  }
  // The gripper weighs 4.5 daN in air and 1 daN in water [MARIS, II-C]; all bodies are accepted.
  const auto links = icat::r2_link_bodies<double>();
  const auto bare = icat::maris_link_bodies<double>();
  EXPECT_NEAR(9.81 * (links[6].mass - bare[6].mass), 45, 0.1);
  EXPECT_NEAR(9.81 * (links[6].mass - links[6].displaced_mass + 0.02), 10, 0.1);
  // Two bodies as one: about the palm's centre the moments of weight and of buoyancy are those of
  // the hand alone, 0.1105 m beyond it.
  const double centre = (links[6].pose.translation() - bare[6].pose.translation()).z();
  EXPECT_NEAR(links[6].mass * centre, 4.59 * 0.1105, 1e-9);
  EXPECT_NEAR(links[6].displaced_mass * (centre + links[6].centre_of_buoyancy.z()), 3.57 * 0.1105,
              1e-9);
  const auto pipe = icat::r2_pipe_body<double>();
  EXPECT_GT(pipe.mass, pipe.displaced_mass);  // it lies on the floor
}

}  // namespace
