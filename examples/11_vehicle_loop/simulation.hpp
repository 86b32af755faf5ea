// SPDX-License-Identifier: BSD-3-Clause
// The vehicle R2 of [MARIS] with its thrusters in a current and its velocity loop, with and without
// each part of the loop: the counterpart of Fig. 14.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <icat/control/thruster_allocation.hpp>
#include <icat/control/vehicle_loop.hpp>
#include <icat/model/maris_bodies.hpp>
#include <icat/sim/hydrodynamic_plant.hpp>
#include <icat/sim/thruster.hpp>
#include <numbers>
#include <random>
#include <vector>

namespace r2 {

using Vector3 = icat::Vector3<double>;
using Vector6 = icat::Vector6<double>;
using Plant = icat::HydrodynamicPlant<double, 0>;
using Propeller = icat::ThrusterModel<double>::Options;

constexpr double control_dt = 0.01, plant_dt = 0.002;  // s

/// Both poles of each component, rad/s; roll and pitch are not actuated.
inline Vector6 bandwidth() {
  Vector6 w;
  w << 1, 1, 1, 0, 0, 2;
  return w;
}

/// Vehicle and thrusters in water that moves with `current`, on ⟨0⟩; at rest over the ground.
class Rig {
 public:
  Rig(double mass, const Vector3& current, const Propeller& propeller)
      : plant_({.arm = {}, .vehicle = icat::r2_vehicle_body(mass), .links = {}}, start(current)),
        current_(current),
        allocation_(icat::r2_thrusters<double>(propeller.maximum, propeller.minimum)),
        thrusters_(8, icat::ThrusterModel<double>(propeller)) {}

  /// Over the ground, components on ⟨v⟩.
  Vector6 velocity() const {
    Vector6 v = plant_.vehicle_velocity();
    v.head<3>() += attitude().transpose() * current_;
    return v;
  }
  icat::Matrix3<double> attitude() const { return plant_.vehicle().linear(); }
  /// From where it began, on ⟨0⟩.
  Vector3 position() const { return plant_.vehicle().translation() + time_ * current_; }
  double time() const { return time_; }

  /// A control period under `wrench`; what the allocation made of it.
  Vector6 push(const Vector6& wrench, icat::Status& status) {
    keep(status, allocation_.allocate(wrench));
    for (int k = 0; k < 5; ++k) {
      Vector6 force = Vector6::Zero();
      for (std::size_t i = 0; i < 8; ++i) {
        const auto column = static_cast<icat::Index>(i);
        keep(status, thrusters_[i].update(allocation_.thrust()(column), plant_dt));
        force += thrusters_[i].thrust() * allocation_.wrenches().col(column);
      }
      keep(status, plant_.step(force, plant_dt));
    }
    time_ += control_dt;
    return allocation_.achieved();
  }
  /// The first that was not ok.
  static void keep(icat::Status& all, icat::Status one) {
    if (all == icat::Status::ok) all = one;
  }

 private:
  static Plant::State start(const Vector3& current) {
    Plant::State state;
    state.velocity.head<3>() = -current;
    return state;
  }
  Plant plant_;  // in a frame that drifts with the water
  Vector3 current_;
  icat::ThrusterAllocation<double, 8> allocation_;
  std::vector<icat::ThrusterModel<double>> thrusters_;
  double time_ = 0;
};

// --- a step of the surge velocity ----------------------------------------------------------------

/// The loop as it is, or without a part of it.
struct Step {
  double speed = 0.2, current = 0.1;  ///< m/s, along x; the water comes from ahead if < 0
  double mass = 400;                  ///< of the vehicle, kg
  double model_mass = 400;            ///< in the loop's model
  bool feed_forward = true;           ///< false: PI alone, with the same gains
  bool current_told = true;           ///< the loop is given the current
  bool anti_windup = true;            ///< the loop is given what the thrusters achieve
  double back = 1e9;                  ///< s, then the reference is 0 again
};

struct StepResult {
  std::vector<double> surge;  ///< each control period from the step on, m/s
  double overshoot = 0;       ///< share of the step
  double settled = 0;         ///< s, from then on within 2 % of the step
  double deviation = 0;       ///< share of the step, largest, from the first-order lag of 1/ω
  double swing_back = 0;      ///< m/s, largest speed backwards
  icat::Status status = icat::Status::ok;
};

/// Sees every control period: the time since the step, s, the rig and the reference.
using Watch = std::function<void(double, const Rig&, const Vector6&)>;

/// The vehicle keeps still for 20 s, then it is told to go ahead for 30 s.
inline StepResult run(const Step& setup, const Watch& watch = {}) {
  const Vector3 current(setup.current, 0, 0);
  Rig rig(setup.mass, current, {});
  const auto model = icat::r2_vehicle_body(setup.model_mass);
  icat::VehicleLoop<double> loop(model, bandwidth());
  Vector6 inertia = model.added_mass;
  inertia.head<3>().array() += model.mass;
  inertia.tail<3>() += model.inertia.diagonal();
  icat::PiLoop<double, 6> pi(icat::PiLoop<double, 6>::tuned(inertia, bandwidth()));
  StepResult result;
  for (int k = -2000; k < 3000; ++k) {
    const double t = k * control_dt;
    Vector6 reference = Vector6::Zero();
    reference(0) = t >= 0 && t < setup.back ? setup.speed : 0;
    const Vector6 velocity = rig.velocity();
    if (watch) watch(t, rig, reference);
    if (k >= 0) {
      result.surge.push_back(velocity(0));
      result.overshoot = std::max(result.overshoot, velocity(0) / setup.speed - 1);
      result.swing_back = std::max(result.swing_back, -velocity(0));
      const double lag = setup.speed * (1 - std::exp(-bandwidth()(0) * t));
      result.deviation = std::max(result.deviation, std::abs(velocity(0) - lag) / setup.speed);
      if (std::abs(reference(0) - velocity(0)) > 0.02 * setup.speed) {
        result.settled = t + control_dt;
      }
    }
    if (!setup.feed_forward) {
      Rig::keep(result.status, pi.update(reference, velocity, Vector6::Zero(), control_dt));
      (void)rig.push(pi.output(), result.status);
      continue;
    }
    const icat::Status status =
        loop.step(t, {.reference = reference,
                      .velocity = velocity,
                      .attitude = rig.attitude(),
                      .current = setup.current_told ? current : Vector3(Vector3::Zero())});
    const Vector6 achieved = rig.push(loop.wrench(), result.status);
    if (setup.anti_windup) Rig::keep(result.status, loop.achieved(achieved));
    Rig::keep(result.status, status);
  }
  return result;
}

// --- turning on the spot -------------------------------------------------------------------------

/// How far a vehicle that turns once round on the spot in 30 s is from where it was, m, each
/// control period: the current comes from all sides in turn.
inline std::vector<double> turn(double current, bool told, icat::Status& status) {
  const Vector3 water(current, 0, 0);
  Rig rig(400, water, {});
  icat::VehicleLoop<double> loop(icat::r2_vehicle_body<double>(), bandwidth());
  Vector3 begin = Vector3::Zero();
  std::vector<double> off;
  for (int k = -2000; k < 4000; ++k) {
    Vector6 reference = Vector6::Zero();
    reference(5) = k >= 0 && k < 3000 ? 2 * std::numbers::pi / 30 : 0;
    if (k == 0) begin = rig.position();
    if (k >= 0) off.push_back((rig.position() - begin).head<2>().norm());
    Rig::keep(status, loop.step(rig.time(), {.reference = reference,
                                             .velocity = rig.velocity(),
                                             .attitude = rig.attitude(),
                                             .current = told ? water : Vector3(Vector3::Zero())}));
    Rig::keep(status, loop.achieved(rig.push(loop.wrench(), status)));
  }
  return off;
}

// --- keeping a place -----------------------------------------------------------------------------

/// RMS of the velocity along x and y, m/s, in the second minute and in the third, in which the
/// vehicle keeps its place. White noise of `noise` m/s on the velocity that it is told.
inline std::array<double, 2> station_keeping(double dead_zone, double noise, icat::Status& status) {
  Rig rig(400, Vector3::Zero(), {.dead_zone = dead_zone});
  icat::VehicleLoop<double> loop(icat::r2_vehicle_body<double>(), bandwidth());
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::array<double, 2> squares{};
  for (int k = 0; k < 18000; ++k) {
    Vector6 velocity = rig.velocity(), reference = Vector6::Zero();
    if (k >= 6000) squares[k >= 12000] += velocity.head<2>().squaredNorm();
    const Vector3 off = Vector3(0.1, 0.1, 0) - rig.position();
    reference.head<3>() = 0.3 * (rig.attitude().transpose() * off);
    for (int i = 0; i < 3; ++i) velocity(i) += noise * normal(random);
    Rig::keep(status, loop.step(rig.time(), {.reference = reference,
                                             .velocity = velocity,
                                             .attitude = rig.attitude()}));
    Rig::keep(status, loop.achieved(rig.push(loop.wrench(), status)));
  }
  return {std::sqrt(squares[0] / 6000), std::sqrt(squares[1] / 6000)};
}

}  // namespace r2
