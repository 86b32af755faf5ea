// SPDX-License-Identifier: BSD-3-Clause
// Two robots that hold a pipe: grasps, interaction, and loops closed around the plants.
#include <gtest/gtest.h>

#include <icat/control/pi_loop.hpp>
#include <icat/control/sample_hold.hpp>
#include <numbers>

#include "support/allocation_counter.hpp"
#include "support/hydrodynamics.hpp"
#include "support/sanitized.hpp"

namespace {

using namespace testing_support;
using icat::Status;
constexpr double dt = 0.0005;

icat::Vector<double, 7> bent() {
  icat::Vector<double, 7> q;
  q << 0.2, 0.6, 0.1, -1.2, 0.1, 0.5, 0.1;
  return q;
}

icat::RigidBody<double> dry_pipe() {
  auto pipe = icat::maris_pipe_body<double>();
  dry(pipe);
  return pipe;
}

// Side by side, 3 m apart, with the pipe across; `speed`: of the whole, as one rigid body.
Pair make_pair(const Dynamics::Description& description, const icat::RigidBody<double>& pipe) {
  Plant::State a, b;
  a.q = b.q = bent();
  a.vehicle = make_pose<double>(0, -1.5, 2, 0, 0, 0);
  b.vehicle = make_pose<double>(0, 1.5, 2, 0, 0, 0);
  const Plant first(description, a), second(description, b);
  icat::Pose<double> object = first.vehicle() * first.dynamics().end_effector();
  object.translation().y() += 1.5;
  object.linear() = icat::axis_rotation<double>({0, 0, 1}, std::numbers::pi / 2);
  return {first, second, pipe, object};
}

// In vacuum, without gravity: nothing acts from outside.
Pair make_free_pair() {
  auto description = dry(maris_description());
  description.gravity = 0;
  return make_pair(description, dry_pipe());
}

// Generalized forces of the wrench w on ⟨t_i⟩.
VectorN pushing(const Pair& pair, std::size_t i, const Vector6& w) {
  return pair.robot(i).dynamics().hand(pair.grasp(i)).jacobian.transpose() * w;
}

double energy(const Plant& plant) {
  const auto dynamics = plant.dynamics();
  return dynamics.kinetic_energy(plant.velocity()) + dynamics.potential_energy();
}
Vector6 to_world(const icat::Pose<double>& frame, const Eigen::Vector3d& linear,
                 const Eigen::Vector3d& angular) {
  const Eigen::Vector3d force = frame.linear() * linear;
  Vector6 w;
  w << force, frame.linear() * angular + frame.translation().cross(force);
  return w;
}
// Everything's, on ⟨0⟩ at its origin. The pipe's frame is at its centre of mass.
Vector6 momentum(const Pair& pair, const icat::RigidBody<double>& pipe) {
  Vector6 sum = to_world(pair.object(), pipe.mass * pair.object_velocity().head<3>(),
                         pipe.inertia * pair.object_velocity().tail<3>());
  for (std::size_t i : {0u, 1u}) {
    const VectorN p = pair.robot(i).dynamics().mass_matrix() * pair.robot(i).velocity();
    sum += to_world(pair.robot(i).vehicle(), p.segment<3>(7), p.tail<3>());
  }
  return sum;
}

TEST(Grasp, DriftStaysBelowATenthOfAMillimetreInForcedMotion) {
  Pair pair = make_pair(maris_description(), icat::maris_pipe_body<double>());
  double metres = 0, radians = 0, fastest = 0, farthest = 0;
  const auto start = pair.object();
  for (int k = 0; k < (sanitized ? 500 : 20000); ++k) {
    std::array<VectorN, 2> force;
    for (std::size_t i : {0u, 1u}) {
      const double t = k * dt, sign = i == 0 ? 1 : -1;
      force[i].head<7>() = -3 * pair.robot(i).joint_velocity();
      force[i](1) += 6 * std::sin(2 * t);
      force[i](3) += sign * 5 * std::sin(3 * t + 1);
      force[i].tail<6>() << 100 * std::sin(t), sign * 60 * std::sin(1.3 * t),
          80 * std::sin(0.7 * t), 20 * std::sin(2 * t), sign * 20 * std::sin(1.1 * t),
          30 * std::sin(0.9 * t);
    }
    ASSERT_EQ(pair.step(force[0], force[1], dt), Status::ok);
    for (std::size_t i : {0u, 1u}) {
      metres = std::max(metres, pair.drift(i).head<3>().norm());
      radians = std::max(radians, pair.drift(i).tail<3>().norm());
    }
    fastest = std::max(fastest, pair.object_velocity().head<3>().norm());
    farthest = std::max(farthest, (pair.object().translation() - start.translation()).norm());
  }
  std::printf(
      "largest drift over 10 s: %.1e m, %.1e rad; the pipe went %.2f m away at up to %.2f m/s\n",
      metres, radians, farthest, fastest);
  EXPECT_LT(metres, 1e-4);
  EXPECT_LT(radians, 1e-4);
  if (!sanitized) {
    EXPECT_GT(farthest, 0.5);
  }
}

TEST(Grasp, MomentumIsConservedWithTheGraspClosed) {
  const auto pipe = dry_pipe();
  Pair pair = make_free_pair();
  // From rest: set going by a push of 0.5 s, then moved from inside only.
  VectorN push = VectorN::Zero();
  push.tail<6>() << 100, 30, -50, 10, 20, 15;
  for (int k = 0; k < 1000; ++k) ASSERT_EQ(pair.step(push, push, dt), Status::ok);
  const Vector6 before = momentum(pair, pipe);
  double worst = 0;
  for (int k = 0; k < (sanitized ? 500 : 8000); ++k) {
    std::array<VectorN, 2> force{VectorN::Zero(), VectorN::Zero()};
    for (std::size_t i : {0u, 1u}) {
      force[i].head<7>() = -3 * pair.robot(i).joint_velocity();
      force[i](3) += 5 * std::sin(3 * k * dt);
    }
    ASSERT_EQ(pair.step(force[0], force[1], dt), Status::ok);
    if (k % 20 == 19) worst = std::max(worst, (momentum(pair, pipe) - before).norm());
  }
  std::printf("momentum with the grasp closed: relative error %.1e\n", worst / before.norm());
  EXPECT_GT(before.norm(), 10);
  EXPECT_LT(worst, 1e-5 * before.norm());
}

// Grasps do no work; weight and buoyancy have their energy.
TEST(Grasp, EnergyIsConservedWithTheGraspClosed) {
  auto description = maris_description();
  description.vehicle.linear_drag.setZero();
  description.vehicle.quadratic_drag.setZero();
  const auto pipe = icat::maris_pipe_body<double>();
  const auto error = [&](double step) {
    Pair pair = make_pair(description, pipe);
    const auto total = [&] {
      const Vector6& V = pair.object_velocity();
      return energy(pair.robot(0)) + energy(pair.robot(1)) +
             (pipe.mass * V.head<3>().squaredNorm() + V.tail<3>().dot(pipe.inertia * V.tail<3>())) /
                 2 -
             (pipe.mass - pipe.displaced_mass) * 9.81 * pair.object().translation().z();
    };
    VectorN push = VectorN::Zero();
    push.tail<6>() << 100, 30, -50, 10, 20, 15;
    const int second = static_cast<int>(1 / step);
    for (int k = 0; k < second; ++k) EXPECT_EQ(pair.step(push, push, step), Status::ok);
    const double before = total();
    double worst = 0;
    for (int k = 0; k < (sanitized ? second / 10 : 2 * second); ++k) {
      EXPECT_EQ(pair.step(VectorN::Zero(), VectorN::Zero(), step), Status::ok);
      worst = std::max(worst, std::abs(total() - before));
    }
    const Plant& robot = pair.robot(0);
    return worst / robot.dynamics().kinetic_energy(robot.velocity());
  };
  const double coarse = error(0.001), fine = error(0.0005);
  std::printf("energy with the grasp closed: relative error %.1e at 1 kHz, %.1e at 2 kHz\n", coarse,
              fine);
  EXPECT_LT(fine, 1e-4);
  if (!sanitized) {
    EXPECT_GT(coarse / fine, 3);
  }
}

// The equations of the file comment, with the object's side written out.
TEST(Grasp, WrenchesMoveTheObjectAndTheHandsFollow) {
  const auto pipe = dry_pipe();
  Pair pair = make_free_pair();
  std::mt19937 rng(1);
  for (int k = 0; k < 50; ++k) {
    const VectorN a = random_vector(rng, 30), b = random_vector(rng, 30);
    const Vector6 before = pair.object_velocity();
    ASSERT_EQ(pair.step(a, b, dt), Status::ok);
    const Vector6 V = (before + pair.object_velocity()) / 2;
    const Vector6 change = (pair.object_velocity() - before) / dt;
    Vector6 expected;
    expected << pipe.mass * (change.head<3>() + V.tail<3>().cross(V.head<3>())),
        pipe.inertia * change.tail<3>() + V.tail<3>().cross(pipe.inertia * V.tail<3>());
    const Vector6 sum = pair.wrench(0) + pair.wrench(1);
    // The predicted middle velocity is not the mean, to first order of the step.
    EXPECT_LT((sum - expected).norm(), 1e-2 * (1 + pair.wrench(0).norm()));
    for (std::size_t i : {0u, 1u}) {
      const Vector6 hand = pair.robot(i).dynamics().hand(pair.grasp(i)).twist;
      // Joints of 3 g m² under random 30 N m: the accelerations are huge.
      EXPECT_LT((hand - pair.object_velocity()).norm(), 1e-3);
    }
  }
}

// Pressing with w against each other changes nothing but the interaction, and that by w.
TEST(Interaction, SqueezingDoesNotMoveAnything) {
  Pair pair = make_pair(maris_description(), icat::maris_pipe_body<double>());
  Vector6 w;
  w << 40, -10, 5, 3, -2, 8;
  VectorN push = VectorN::Zero();
  push.tail<6>() << 50, 10, -20, 3, 2, 1;
  Pair squeezed = pair;
  ASSERT_EQ(pair.step(push, 0.5 * push, dt), Status::ok);
  // At rest the first midpoint is the start, so the Jacobians are those of now.
  ASSERT_EQ(squeezed.step(push + pushing(squeezed, 0, w), 0.5 * push - pushing(squeezed, 1, w), dt),
            Status::ok);
  EXPECT_LT((squeezed.interaction() - pair.interaction() - w).norm(), 1e-9);
  EXPECT_LT((squeezed.wrench(0) + squeezed.wrench(1) - pair.wrench(0) - pair.wrench(1)).norm(),
            1e-9);
  EXPECT_LT((squeezed.object_velocity() - pair.object_velocity()).norm(), 1e-12);
  for (std::size_t i : {0u, 1u}) {
    // The wrenches' rounding, some 1e-11, times dt ‖M⁻¹Jᵀ‖, which is 0.27.
    EXPECT_LT((squeezed.robot(i).velocity() - pair.robot(i).velocity()).norm(), 1e-11);
  }

  // And for as long as it lasts: nothing but squeezing, for a second, in weightlessness.
  Pair still = make_free_pair();
  const auto start = still.object();
  for (int k = 0; k < 2000; ++k) {
    ASSERT_EQ(still.step(pushing(still, 0, w), -pushing(still, 1, w), dt), Status::ok);
  }
  EXPECT_LT((still.object().matrix() - start.matrix()).norm(), 1e-9);
  EXPECT_LT((still.interaction() - w).norm(), 1e-6);
}

// The same robot twice, doing the same: each gives half of what moves the pipe.
TEST(Interaction, IsZeroWhereBothDoTheSame) {
  Plant::State start;
  start.q = bent();
  const Plant robot(maris_description(), start);
  const auto pipe = dry_pipe();
  Pair pair(robot, robot, pipe, robot.vehicle() * robot.dynamics().end_effector());
  VectorN lift = VectorN::Zero();
  lift.tail<6>() << 5, 3, -200, 0, 4, 0;
  for (int k = 0; k < 1000; ++k) {
    ASSERT_EQ(pair.step(lift, lift, dt), Status::ok);
    ASSERT_LT(pair.interaction().norm(), 1e-9);
  }
  EXPECT_GT(pair.wrench(0).norm(), 10);
}

// Mirrored robots that lift share the load evenly: nothing of it is internal, though each has its
// lever.
TEST(Interaction, OfAMirroredLiftIsNone) {
  auto description = maris_description();
  Plant::State a, b;
  a.q << 0, 0.6, 0, -1.2, 0, 0.5, 0;
  b = a;
  a.vehicle = make_pose<double>(0, -1.5, 2, 0, 0, 0);
  b.vehicle = make_pose<double>(0, 1.5, 2, 0, 0, 0);
  const Plant first(description, a), second(description, b);
  icat::Pose<double> object = first.vehicle() * first.dynamics().end_effector();
  object.translation().y() += 1.5;
  object.linear() = icat::axis_rotation<double>({0, 0, 1}, std::numbers::pi / 2);
  Pair pair(first, second, dry_pipe(), object);
  VectorN lift = VectorN::Zero();
  lift.tail<6>() << 0, 0, -200, 0, 0, 0;
  for (int k = 0; k < 1000; ++k) ASSERT_EQ(pair.step(lift, lift, dt), Status::ok);
  EXPECT_LT(pair.interaction().norm(), 1e-6);
  EXPECT_GT(pair.wrench(0).head<3>().norm(), 1);
  EXPECT_GT(pair.wrench(0).tail<3>().norm(), 1);
}

TEST(Grasp, BadInputIsRefusedAndTheStateStays) {
  Pair pair = make_free_pair();
  const Pair before = pair;
  const VectorN zero = VectorN::Zero();
  VectorN bad = zero;
  bad(3) = NAN;
  EXPECT_EQ(pair.step(zero, bad, dt), Status::non_finite);
  EXPECT_EQ(pair.step(zero, zero, NAN), Status::non_finite);
  EXPECT_EQ(pair.step(zero, zero, 0), Status::non_finite);
  bad(3) = 1e308;
  EXPECT_EQ(pair.step(zero, bad, 1e9), Status::numerical_failure);
  EXPECT_EQ(pair.object().matrix(), before.object().matrix());
  EXPECT_EQ(pair.object_velocity(), before.object_velocity());
  for (std::size_t i : {0u, 1u}) EXPECT_EQ(pair.robot(i).velocity(), before.robot(i).velocity());

  auto object = pair.object();
  object.linear() *= 2;
  EXPECT_THROW(Pair(pair.robot(0), pair.robot(1), dry_pipe(), object), std::invalid_argument);
  auto pipe = dry_pipe();
  pipe.mass = -1;
  EXPECT_THROW(Pair(pair.robot(0), pair.robot(1), pipe, pair.object()), std::invalid_argument);
}

TEST(Grasp, NothingAllocates) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  Pair pair = make_pair(maris_description(), icat::maris_pipe_body<double>());
  Status status = Status::not_started;
  EXPECT_EQ(count_allocations([&] { status = pair.step(VectorN::Zero(), VectorN::Zero(), dt); }),
            0);
  EXPECT_EQ(status, Status::ok);
}

// Velocity loops at 2 kHz on the nominal inertia, 6 rad/s for the vehicle, 60 rad/s for joints.
struct Loops {
  using Joints = icat::PiLoop<double, 7>;
  using Vehicle = icat::PiLoop<double, 6>;
  explicit Loops(const Plant& plant)
      : Loops(icat::Vector<double, 13>(plant.dynamics().mass_matrix().diagonal())) {}
  explicit Loops(const VectorN& inertia)
      : joints(Joints::tuned(inertia.head<7>(), icat::Vector<double, 7>::Constant(60))),
        vehicle(Vehicle::tuned(inertia.tail<6>(), Vector6::Constant(6))) {}

  VectorN update(const VectorN& reference, const VectorN& measured) {
    EXPECT_EQ(
        joints.update(reference.head<7>(), measured.head<7>(), icat::Vector<double, 7>::Zero(), dt),
        Status::ok);
    EXPECT_EQ(vehicle.update(reference.tail<6>(), measured.tail<6>(), Vector6::Zero(), dt),
              Status::ok);
    VectorN force;
    force << joints.output(), vehicle.output();
    return force;
  }
  Joints joints;
  Vehicle vehicle;
};

// Smooth: 0 → speed → 0 over 10 s.
double bump(double t) { return 0.5 * (1 - std::cos(2 * std::numbers::pi * t / 10)); }

TEST(ClosedLoop, OneRobotFollowsASmoothVelocity) {
  Plant::State start;
  start.q = bent();
  Plant plant(maris_description(), start);
  Loops loops(plant);
  double worst_joint = 0, worst_vehicle = 0, largest_jump = 0;
  VectorN previous = VectorN::Zero();
  const int steps = sanitized ? 500 : 20000;
  for (int k = 0; k < steps; ++k) {
    VectorN reference = VectorN::Zero();
    reference.tail<6>() << 0.3, 0.1, -0.1, 0, 0, 0.05;
    reference.head<7>() << 0.05, 0.03, -0.05, 0.04, 0.05, -0.04, 0.1;
    reference *= bump(k * dt);
    const VectorN force = loops.update(reference, plant.velocity());
    ASSERT_EQ(plant.step(force, dt), Status::ok);
    if (k < 4000) {  // buoyancy, which no one feeds forward, is being taken over
      previous = force;
      continue;
    }
    const VectorN error = reference - plant.velocity();
    worst_joint = std::max(worst_joint, error.head<7>().cwiseAbs().maxCoeff());
    worst_vehicle = std::max(worst_vehicle, error.tail<6>().cwiseAbs().maxCoeff());
    largest_jump = std::max(largest_jump, (force - previous).cwiseAbs().maxCoeff());
    previous = force;
  }
  std::printf(
      "one robot: velocity error %.1e rad/s, vehicle %.1e; force changes by at most %.2f a step\n",
      worst_joint, worst_vehicle, largest_jump);
  EXPECT_LT(worst_joint, 5e-3);
  EXPECT_LT(worst_vehicle, 2e-2);
  EXPECT_LT(largest_jump, 1);
}

// References that agree: the pipe follows, with small interaction. References that differ by
// 5 mm/s: the integrals charge, as [Coop, V-B] tells of T2.
TEST(ClosedLoop, TwoRobotsCarryThePipe) {
  double at_end[2] = {};
  for (const double disagreement : {0.0, 0.005}) {
    Pair pair = make_pair(maris_description(), icat::maris_pipe_body<double>());
    std::array<Loops, 2> loops{Loops(pair.robot(0)), Loops(pair.robot(1))};
    // DVL and gyros at 100 Hz; joints at 2 kHz.
    std::array<icat::SampleHold<Vector6>, 2> feedback{
        icat::SampleHold<Vector6>(100, Vector6::Zero()),
        icat::SampleHold<Vector6>(100, Vector6::Zero())};
    const auto start = pair.object();
    double drift = 0, largest_jump = 0, largest_vehicle_force = 0, force_max = 0;
    Vector6 previous = Vector6::Zero();
    const int steps = sanitized ? 500 : 20000;
    for (int k = 0; k < steps; ++k) {
      std::array<VectorN, 2> force;
      for (std::size_t i : {0u, 1u}) {
        VectorN reference = VectorN::Zero();
        reference(7) = 0.2 * bump(k * dt);
        reference(8) = i == 0 ? disagreement : 0;  // towards the other one
        VectorN measured = pair.robot(i).velocity();
        measured.tail<6>() = feedback[i].update(k * dt, pair.robot(i).vehicle_velocity());
        force[i] = loops[i].update(reference, measured);
        largest_vehicle_force =
            std::max(largest_vehicle_force, force[i].tail<6>().cwiseAbs().maxCoeff());
      }
      ASSERT_EQ(pair.step(force[0], force[1], dt), Status::ok);
      drift = std::max({drift, pair.drift(0).norm(), pair.drift(1).norm()});
      if (k > 100) {
        largest_jump =
            std::max(largest_jump, (pair.interaction() - previous).cwiseAbs().maxCoeff());
      }
      previous = pair.interaction();
      force_max = std::max(force_max, pair.interaction().head<3>().norm());
    }
    const double travelled = pair.object().translation().x() - start.translation().x();
    std::printf(
        "two robots, references %.0f mm/s apart: drift %.1e, travelled %.3f m, interaction up to "
        "%.2f N, at the end %.2f N and %.2f N m; it changes by at most %.2f a step; vehicle force "
        "up to %.0f N\n",
        1000 * disagreement, drift, travelled, force_max, pair.interaction().head<3>().norm(),
        pair.interaction().tail<3>().norm(), largest_jump, largest_vehicle_force);
    EXPECT_LT(drift, 1e-4);
    if (!sanitized) {
      EXPECT_NEAR(travelled, 1, 0.1);
    }
    EXPECT_LT(largest_jump, 1);
    at_end[disagreement > 0] = pair.interaction().norm();
  }
  if (!sanitized) {
    EXPECT_GT(at_end[1], 3 * at_end[0]);
  }
}

}  // namespace
