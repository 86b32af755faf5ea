// SPDX-License-Identifier: BSD-3-Clause
// The vehicle-manipulator in water: what mechanics says of it. See test_dynamics_mujoco.cpp for the
// comparison with an engine.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <icat/math/numerical_differentiation.hpp>

#include "support/allocation_counter.hpp"
#include "support/hydrodynamics.hpp"
#include "support/linear_algebra.hpp"
#include "support/sanitized.hpp"

namespace {

using namespace testing_support;
using icat::Status;

Plant::State bent_start(unsigned seed, double speed) {
  std::mt19937 rng(seed);
  Plant::State start;
  start.q << 0.3, -0.7, 0.2, -1.3, 0.4, 0.6, 0.1;
  start.vehicle = make_pose<double>(1, 2, 3, 0.2, -0.3, 0.5);
  start.velocity = random_vector(rng, speed);
  return start;
}

double energy(const Plant& plant) {
  const auto dynamics = plant.dynamics();
  return dynamics.kinetic_energy(plant.velocity()) + dynamics.potential_energy();
}

// [force; moment] impulse on ⟨0⟩ at its origin: the last six rows of M ẏ, carried there.
Vector6 momentum(const Plant& plant) {
  const VectorN p = plant.dynamics().mass_matrix() * plant.velocity();
  const Eigen::Matrix3d R = plant.vehicle().linear();
  const Eigen::Vector3d linear = R * p.segment<3>(7);
  Vector6 m;
  m << linear, R * p.tail<3>() + plant.vehicle().translation().cross(linear);
  return m;
}

void no_drag(Dynamics::Description& d) {
  d.vehicle.linear_drag.setZero();
  d.vehicle.quadratic_drag.setZero();
}

// A vehicle with next to no arm.
Dynamics::Description bare_vehicle() {
  auto d = maris_description();
  d.gravity = 0;
  for (auto& link : d.links) {
    dry(link);
    link.mass *= 1e-7;
    link.inertia *= 1e-7;
  }
  return d;
}

TEST(Dynamics, MassMatrixIsSymmetricAndPositive) {
  Dynamics dynamics(maris_description());
  for (const auto& state : all_states<double>(100, 1)) {
    SCOPED_TRACE(state.name);
    ASSERT_EQ(dynamics.update(state.q, state.vehicle, VectorN::Zero()), Status::ok);
    const auto& M = dynamics.mass_matrix();
    EXPECT_TRUE(M == M.transpose());
    EXPECT_GT(testing_support::symmetric_eigenvalues(M)(0), 1e-4);
    // Mass of everything, and the vehicle's added mass.
    EXPECT_NEAR(M(7, 7), 329 + 158.4, 1e-9);
    EXPECT_NEAR(M(9, 9), 329 + 171.3, 1e-9);
  }
}

TEST(Dynamics, WeightAndBuoyancyAreTheGradientOfTheirEnergy) {
  for (const auto& description : {maris_description(), random_description(4)}) {
    Dynamics dynamics(description), displaced(description);
    for (const auto& state : random_states<double>(20, 2)) {
      SCOPED_TRACE(state.name);
      ASSERT_EQ(dynamics.update(state.q, state.vehicle, VectorN::Zero()), Status::ok);
      const VectorN gradient =
          icat::central_difference(
              [&](const VectorN& y) {
                EXPECT_EQ(displaced.update(
                              state.q + y.head<7>(),
                              icat::integrate<double>(state.vehicle, Vector6(y.tail<6>()), 1.0),
                              VectorN::Zero()),
                          Status::ok);
                return icat::Vector<double, 1>(displaced.potential_energy());
              },
              VectorN(VectorN::Zero()))
              .transpose();
      EXPECT_LT((dynamics.bias() - gradient).norm(), 1e-8 * gradient.norm());
    }
  }
}

TEST(Dynamics, BuoyancyLiftsAndRights) {
  Dynamics dynamics(maris_description());
  const double g = 9.81, roll = 0.3;
  ASSERT_EQ(dynamics.update(icat::Vector<double, 7>::Zero(), make_pose<double>(0, 0, 2, roll, 0, 0),
                            VectorN::Zero()),
            Status::ok);
  // Net force 1 % of the weight, upwards; c is what it takes to hold.
  const Eigen::Vector3d down(0, std::sin(roll), std::cos(roll));
  EXPECT_LT((dynamics.bias().segment<3>(7) - 0.01 * 329 * g * down).norm(), 1e-9);
  // The hull's moment; the arm's is a hundredth of its weight's.
  auto hull = maris_description();
  for (auto& link : hull.links) link.displaced_mass = link.mass;
  Dynamics righting(hull);
  ASSERT_EQ(righting.update(icat::Vector<double, 7>::Zero(), make_pose<double>(0, 0, 2, roll, 0, 0),
                            VectorN::Zero()),
            Status::ok);
  EXPECT_NEAR(righting.bias()(10), 303 * g * 0.05 * std::sin(roll), 1e-9);
}

TEST(Dynamics, JacobianAndItsDerivativeEqualTheKinematicModel) {
  const auto description = random_description(5);
  Dynamics dynamics(description);
  const auto e_t = make_pose<double>(0.1, -0.2, 0.3, 0.4, 0.5, 0.6);
  Robot<double> robot =
      icat::uvms<double, 7>(description.arm, {.arm = description.arm_mount, .tool = e_t});
  const icat::FrameId tool = robot.frame("tool");
  // Components on ⟨t⟩.
  const auto jacobian = [&] {
    const Eigen::Matrix3d back = robot.pose(tool).linear().transpose();
    Dynamics::Jacobian J = robot.jacobian(tool);
    J.topRows<3>() = (back * J.topRows<3>()).eval();
    J.bottomRows<3>() = (back * J.bottomRows<3>()).eval();
    return J;
  };
  std::mt19937 rng(6);
  for (const auto& state : random_states<double>(20, 7)) {
    SCOPED_TRACE(state.name);
    const VectorN y = random_vector(rng, 1);
    const auto twist_after = [&](double t) {
      displace(robot, state, VectorN(t * y));
      return Vector6(jacobian() * y);
    };
    const Vector6 numeric = (twist_after(1e-5) - twist_after(-1e-5)) / 2e-5;
    twist_after(0);
    ASSERT_EQ(dynamics.update(state.q, state.vehicle, y), Status::ok);
    const auto hand = dynamics.hand(e_t);
    EXPECT_LT((hand.jacobian - jacobian()).norm(), 1e-12);
    EXPECT_LT((hand.twist - jacobian() * y).norm(), 1e-12);
    EXPECT_LT((hand.bias_acceleration - numeric).norm(), 1e-7);
  }
}

TEST(Dynamics, AddedMassInClosedForm) {
  const auto description = bare_vehicle();
  Dynamics dynamics(description);
  const auto& body = description.vehicle;
  Eigen::Vector3d a, b;
  for (int i = 0; i < 3; ++i) {
    a(i) = 300 + body.added_mass(i);
    b(i) = 50 + body.added_mass(3 + i);
    EXPECT_NEAR(dynamics.mass_matrix()(7 + i, 7 + i), a(i), 1e-4);
    EXPECT_NEAR(dynamics.mass_matrix()(10 + i, 10 + i), b(i), 1e-4);
  }
  // Kirchhoff: ω × (A v) and ω × (B ω) + v × (A v), the last Munk's moment.
  auto still = description;
  no_drag(still);
  Dynamics free(still);
  const Eigen::Vector3d v(0.4, -0.3, 0.6), w(0.2, 0.5, -0.7);
  VectorN y = VectorN::Zero();
  y.tail<6>() << v, w;
  ASSERT_EQ(free.update(icat::Vector<double, 7>::Zero(), icat::Pose<double>::Identity(), y),
            Status::ok);
  const Eigen::Vector3d Av = a.cwiseProduct(v), Bw = b.cwiseProduct(w);
  EXPECT_LT((free.bias().segment<3>(7) - w.cross(Av)).norm(), 1e-4);
  EXPECT_LT((free.bias().tail<3>() - (w.cross(Bw) + v.cross(Av))).norm(), 1e-4);
}

// m u̇ = F − D u²: u = u_t tanh(t √(F D) / m), and m u̇ = −d u: u = u_0 e^{−d t / m}.
TEST(Dynamics, DragInClosedForm) {
  for (int axis = 0; axis < 6; ++axis) {
    SCOPED_TRACE(axis);
    auto quadratic = bare_vehicle();
    quadratic.vehicle.linear_drag.setZero();
    Plant fast(quadratic, {});
    const double F = axis < 3 ? 100 : 10;
    const double D = quadratic.vehicle.quadratic_drag(axis);
    const double m = (axis < 3 ? 300 : 50) + quadratic.vehicle.added_mass(axis);
    VectorN force = VectorN::Zero();
    force(7 + axis) = F;
    const double dt = 0.001, T = sanitized ? 1 : 12;
    const int steps = static_cast<int>(T / dt);
    for (int k = 0; k < steps; ++k) ASSERT_EQ(fast.step(force, dt), Status::ok);
    EXPECT_NEAR(fast.vehicle_velocity()(axis),
                std::sqrt(F / D) * std::tanh(T * std::sqrt(F * D) / m), 1e-5);

    auto linear = bare_vehicle();
    linear.vehicle.quadratic_drag.setZero();
    Plant::State moving;
    moving.velocity(7 + axis) = 0.5;
    Plant slow(linear, moving);
    for (int k = 0; k < steps; ++k) ASSERT_EQ(slow.step(VectorN::Zero(), dt), Status::ok);
    EXPECT_NEAR(slow.vehicle_velocity()(axis),
                0.5 * std::exp(-linear.vehicle.linear_drag(axis) * T / m), 1e-5);
  }
}

TEST(Dynamics, DragTakesPowerInEveryDirection) {
  auto wet = maris_description();
  wet.links[4].linear_drag << 1, 2, 3, 0.1, 0.2, 0.3;
  wet.links[4].quadratic_drag << 10, 20, 30, 1, 2, 3;
  auto still = wet;
  no_drag(still);
  still.links[4] = maris_description().links[4];
  Dynamics with(wet), without(still);
  std::mt19937 rng(8);
  for (const auto& state : random_states<double>(50, 9)) {
    const VectorN y = random_vector(rng, 1);
    ASSERT_EQ(with.update(state.q, state.vehicle, y), Status::ok);
    ASSERT_EQ(without.update(state.q, state.vehicle, y), Status::ok);
    EXPECT_GT((with.bias() - without.bias()).dot(y), 0.1);
    ASSERT_EQ(with.update(state.q, state.vehicle, VectorN::Zero()), Status::ok);
    ASSERT_EQ(without.update(state.q, state.vehicle, VectorN::Zero()), Status::ok);
    EXPECT_EQ(with.bias(), without.bias());
  }
}

// Halving the step divides the error by four.
template <class Error>
void expect_second_order(const char* what, Error&& error) {
  const double coarse = error(0.002), fine = error(0.001), finest = error(0.0005);
  std::printf("%s: relative error %.1e at 500 Hz, %.1e at 1 kHz, %.1e at 2 kHz\n", what, coarse,
              fine, finest);
  EXPECT_LT(finest, 1e-4);
  EXPECT_NEAR(coarse / fine, 4, 0.8);
  EXPECT_NEAR(fine / finest, 4, 0.8);
}

TEST(Integration, EnergyIsConservedToSecondOrderWithoutDragAndControl) {
  auto wet = maris_description();
  no_drag(wet);
  wet.links[3].added_mass << 2, 3, 0.5, 0.01, 0.02, 0.03;
  for (const auto& description : {wet, dry(wet)}) {
    expect_second_order("energy", [&](double dt) {
      Plant plant(description, bent_start(10, 0.5));
      const double before = energy(plant);
      const double kinetic = plant.dynamics().kinetic_energy(plant.velocity());
      double worst = 0;
      for (int k = 0; k < static_cast<int>(2 / dt); ++k) {
        EXPECT_EQ(plant.step(VectorN::Zero(), dt), Status::ok);
        if (k % 50 == 49) worst = std::max(worst, std::abs(energy(plant) - before));
      }
      return worst / kinetic;
    });
  }
}

TEST(Integration, MomentumIsConservedToSecondOrderUnderJointTorques) {
  auto description = dry(maris_description());
  description.gravity = 0;
  expect_second_order("momentum", [&](double dt) {
    Plant plant(description, bent_start(11, 0.5));
    const Vector6 before = momentum(plant);
    double worst = 0;
    for (int k = 0; k < static_cast<int>(2 / dt); ++k) {
      VectorN force = VectorN::Zero();
      force.head<7>() = -2 * plant.joint_velocity();
      force(3) += std::sin(3 * dt * k);
      EXPECT_EQ(plant.step(force, dt), Status::ok);
      if (k % 50 == 49) worst = std::max(worst, (momentum(plant) - before).norm());
    }
    return worst / before.norm();
  });
}

TEST(Integration, SinglePrecisionFollowsDouble) {
  const auto start = bent_start(12, 0.2);
  Plant plant(maris_description(), start);
  using F = icat::HydrodynamicPlant<float, 7>;
  F::State single{start.q.cast<float>(), icat::Pose<float>(start.vehicle.cast<float>()),
                  start.velocity.cast<float>()};
  F other(icat::maris_dynamics<float>(), single);
  VectorN force = VectorN::Zero();
  force.tail<6>() << 20, -10, 30, 1, 2, 3;
  for (int k = 0; k < 1000; ++k) {
    ASSERT_EQ(plant.step(force, 0.0005), Status::ok);
    ASSERT_EQ(other.step(force.cast<float>(), 0.0005), Status::ok);
  }
  EXPECT_LT((plant.q() - other.q().cast<double>()).norm(), 1e-3);
  EXPECT_LT((plant.vehicle().matrix() - other.vehicle().cast<double>().matrix()).norm(), 1e-3);
}

TEST(Dynamics, BadInputIsRefusedAndTheStateStays) {
  Dynamics dynamics(maris_description());
  const auto start = bent_start(15, 0.3);
  ASSERT_EQ(dynamics.update(start.q, start.vehicle, start.velocity), Status::ok);
  const VectorN before = dynamics.bias();
  auto bad = start;
  bad.q(2) = NAN;
  bad.vehicle.linear() *= 2;
  bad.velocity(5) = INFINITY;
  EXPECT_EQ(dynamics.update(bad.q, start.vehicle, start.velocity), Status::non_finite);
  EXPECT_EQ(dynamics.update(start.q, bad.vehicle, start.velocity), Status::not_a_rotation);
  EXPECT_EQ(dynamics.update(start.q, start.vehicle, bad.velocity), Status::non_finite);
  ASSERT_EQ(dynamics.update(start.q, start.vehicle, start.velocity), Status::ok);
  EXPECT_EQ(dynamics.bias(), before);
}

TEST(Integration, BadInputIsRefusedAndTheStateStays) {
  Plant plant(maris_description(), bent_start(13, 0.3));
  const Plant before = plant;
  VectorN force = VectorN::Zero();
  EXPECT_EQ(plant.step(force, NAN), Status::non_finite);
  force(4) = INFINITY;
  EXPECT_EQ(plant.step(force, 0.001), Status::non_finite);
  force(4) = 1e308;
  EXPECT_EQ(plant.step(force, 1e10), Status::numerical_failure);
  EXPECT_EQ(plant.q(), before.q());
  EXPECT_EQ(plant.velocity(), before.velocity());
  EXPECT_EQ(plant.vehicle().matrix(), before.vehicle().matrix());
}

TEST(Integration, NothingAllocates) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  Plant plant(maris_description(), bent_start(14, 0.3));
  Status status = Status::not_started;
  EXPECT_EQ(count_allocations([&] { status = plant.step(VectorN::Zero(), 0.0005); }), 0);
  EXPECT_EQ(status, Status::ok);
}

template <class F>
std::string message_of(F&& f) {
  try {
    f();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "no exception";
}

TEST(DynamicsErrors, ConfigurationThrowsWithNamesAndNumbers) {
  const auto message = [](auto&& change) {
    auto d = maris_description();
    change(d);
    return message_of([&] { Dynamics dynamics(d); });
  };
  const std::string owner = "VehicleManipulatorDynamics: ";
  EXPECT_EQ(message([](auto& d) { d.vehicle.mass = 0; }),
            owner + "mass of the vehicle must be finite and > 0, got 0");
  EXPECT_EQ(message([](auto& d) { d.links[3].inertia.setZero(); }),
            owner + "inertia of link 3 must be symmetric and positive");
  EXPECT_EQ(message([](auto& d) { d.links[2].inertia(0, 1) = 1; }),
            owner + "inertia of link 2 must be symmetric and positive");
  EXPECT_EQ(message([](auto& d) { d.vehicle.added_mass(2) = -1; }),
            owner + "added_mass 2 of the vehicle must be finite and >= 0, got -1");
  EXPECT_EQ(message([](auto& d) { d.vehicle.linear_drag(1) = -1; }),
            owner + "linear_drag 1 of the vehicle must be finite and >= 0, got -1");
  EXPECT_EQ(message([](auto& d) { d.vehicle.quadratic_drag(1) = INFINITY; }),
            owner + "quadratic_drag 1 of the vehicle must be finite and >= 0, got inf");
  EXPECT_EQ(message([](auto& d) { d.links[6].displaced_mass = -2; }),
            owner + "displaced_mass of link 6 must be finite and >= 0, got -2");
  EXPECT_EQ(message([](auto& d) { d.vehicle.centre_of_buoyancy(0) = NAN; }),
            owner + "centre_of_buoyancy of the vehicle is not finite");
  EXPECT_EQ(message([](auto& d) { d.links[0].pose.linear() *= 2; }),
            owner + "pose of link 0 is not finite or not a rotation");
  EXPECT_EQ(message([](auto& d) { d.arm_mount.linear() *= 2; }),
            "KinematicTree: joint 'arm_base': its origin is not finite or not a rotation");
  EXPECT_EQ(message([](auto& d) { d.gravity = NAN; }), owner + "gravity must be finite, got nan");
  EXPECT_EQ(message_of([] { Plant(maris_description(), {.velocity = VectorN::Constant(NAN)}); }),
            "HydrodynamicPlant: the start is not finite or its pose not a rotation");
}

}  // namespace
