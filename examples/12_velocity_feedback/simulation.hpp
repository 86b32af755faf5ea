// SPDX-License-Identifier: BSD-3-Clause
// The lesson of the MARIS trials [MARIS, VI-D]: TPIK 2 compensates the noise of the vehicle's
// measured velocity like a motion, the arm shakes the vehicle, and this motion is measured again. A
// first-order low-pass at 50 rad/s ended it. R2 and the arm, simulated with dynamics, hold a tool
// in place.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <icat/control/low_pass.hpp>
#include <icat/control/parallel_controller.hpp>
#include <icat/control/thruster_allocation.hpp>
#include <icat/control/vehicle_loop.hpp>
#include <icat/model/uvms.hpp>
#include <icat/sim/hydrodynamic_plant.hpp>
#include <icat/sim/maris_dynamics.hpp>
#include <icat/sim/thruster.hpp>
#include <icat/task/column_tasks.hpp>
#include <icat/task/frame_tasks.hpp>
#include <icat/task/joint_tasks.hpp>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

namespace feedback {

using Robot = icat::KinematicTree<double, 13>;
using Plant = icat::HydrodynamicPlant<double, 7>;
using Vector3 = icat::Vector3<double>;
using Vector6 = icat::Vector6<double>;
using Vector13 = icat::Vector<double, 13>;
using Joints = icat::Vector<double, 7>;

// One set for all runs. Of these the paper gives only the cut-off; noise and delay are typical of
// such sensors.
constexpr double plant_dt = 0.001;       // s, and of the joints' drives
constexpr int vehicle_every = 10;        // 100 Hz: the vehicle's loop and its thrusters
constexpr int law_every = 20;            // 50 Hz: TPIK 2, as a law
constexpr int base_every = 50;           // 20 Hz: TPIK 1
constexpr double linear_noise = 0.02;    // m/s, white, on each sample: a DVL
constexpr double angular_noise = 0.075;  // rad/s, the same: gyros on a hull that vibrates
constexpr double tool_gain = 0.5;        // 1/s
constexpr double unfiltered = std::numeric_limits<double>::infinity();

struct Variant {
  double cutoff = unfiltered;  ///< of the low-pass on the feedback, rad/s
  bool noise = true;           ///< on the feedback
  bool reaction = true;        ///< the arm's motion moves the vehicle
  double arm = 1;              ///< times as heavy as it is, gripper included
  int every = 2;               ///< ms, of the feedback and the arm's law: 500 Hz
  int delay = 15;              ///< ms, of the feedback
  double drives = 100;         ///< rad/s, both poles of each drive
  double mass = 400;           ///< of the vehicle, kg
  unsigned seed = 1;
};

struct Sample {
  double t;
  Vector6 feedback;  ///< as the controllers get it
  Joints reference;  ///< velocities of the joints
};

/// RMS of norms from `settled` on.
struct Result {
  double reference = 0;         ///< of the joints' reference velocities, rad/s
  double acceleration = 0;      ///< of the vehicle, true, in roll and pitch, rad/s²
  double rate = 0;              ///< its rates of roll and pitch, true, rad/s
  double position = 0;          ///< of the tool off its goal, m
  double orientation = 0;       ///< the same, rad
  double tool_speed = 0;        ///< of the tool, which is to stand still, m/s
  std::vector<Sample> samples;  ///< at 500 Hz
  icat::Status status = icat::Status::ok;
};
constexpr double settled = 5;  // s

/// The arm reaches down to the floor, as when it grasps.
inline Joints start() {
  Joints q;
  q << 0, 0.9, 0, -1.2, 0, 0.6, 0;
  return q;
}
inline Robot make_robot() {
  return icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>()});
}
inline Plant make_plant(double arm, double mass = 400) {
  auto description = icat::r2_dynamics<double>();
  description.vehicle = icat::r2_vehicle_body(mass);
  for (auto& link : description.links) {
    link.mass *= arm, link.inertia *= arm, link.added_mass *= arm, link.displaced_mass *= arm;
  }
  return Plant(description, {.q = start()});
}

/// The motion of the vehicle that the arm causes when it compensates a motion of the vehicle, as a
/// share of that motion: the largest eigenvalue of −M_vv⁻¹ M_vq P, P = −J_q^+ J_v, by power
/// iteration.
inline double loop_gain(double arm = 1) {
  const Plant plant = make_plant(arm);
  const Plant::Dynamics& dynamics = plant.dynamics();
  const auto hand = dynamics.hand(icat::Pose<double>::Identity());
  icat::Matrix6<double> JJ, M;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      JJ(i, j) = 0;
      for (int k = 0; k < 7; ++k) JJ(i, j) += hand.jacobian(i, k) * hand.jacobian(j, k);
      M(i, j) = dynamics.mass_matrix()(7 + i, 7 + j);
    }
  }
  icat::detail::Cholesky<double, 6> joints, vehicle;
  if (!joints.compute(JJ) || !vehicle.compute(M)) return 0;
  Vector6 v = icat::Filled{1};
  double gain = 0;
  for (int n = 0; n < 200; ++n) {
    Vector6 x = icat::Filled{0}, push = x;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) x(i) += hand.jacobian(i, 7 + j) * v(j);
    }
    joints.solve(x);
    for (int k = 0; k < 7; ++k) {
      double speed = 0;  // of joint k
      for (int i = 0; i < 6; ++i) speed -= hand.jacobian(i, k) * x(i);
      for (int i = 0; i < 6; ++i) push(i) -= dynamics.mass_matrix()(7 + i, k) * speed;
    }
    vehicle.solve(push);
    gain = push.norm();
    v = push / gain;
  }
  return gain;
}

/// The water sways along x: velocity, m/s, and way since 0, m. All bodies weigh what they displace,
/// to 1 %, so that they are carried along, and the dynamics are those in still water with ⟨0⟩
/// swaying too.
inline double current(double t) { return 0.05 * std::sin(2 * std::numbers::pi * t / 10); }
inline double carried(double t) {
  return 0.05 * 10 / (2 * std::numbers::pi) * (1 - std::cos(2 * std::numbers::pi * t / 10));
}

/// Sees the controllers 20 times a second, and the place where they hold the tool.
using Watch =
    std::function<void(double, const icat::ParallelController<Robot>&, const Vector3& goal)>;

/// Robot, controllers and plant of one run.
class Simulation {
 public:
  explicit Simulation(const Variant& variant)
      : variant_(variant),
        robot_(make_robot()),
        tool_(robot_.frame("tool")),
        plant_(make_plant(variant.arm, variant.mass)),
        limits_(robot_, {.margin = 0.1}),
        hold_(robot_, tool_, goal(), {.gain = tool_gain}),
        // Without this level TPIK 1 shares the work between arm and vehicle, whose slow loop then
        // answers rolling with sway, late: a swinging of its own that builds up in minutes.
        still_(robot_, robot_.base_columns()),
        controller_(robot_, {{"hold", {{limits_}, {hold_}, {still_}}}},
                    {.given = icat::ColumnRange{robot_.base_columns().first + 3, 2},  // roll, pitch
                     .solver = {.bounds = speeds()}}),
        filter_(variant.cutoff == unfiltered ? 0 : 1 / variant.cutoff),
        vehicle_(icat::r2_vehicle_body(variant.mass), bandwidth()),
        allocation_(icat::r2_thrusters<double>(60, -48)),
        thrusters_(8),
        inertia_(felt()),
        drives_(icat::PiLoop<double, 7>::tuned(inertia_, icat::Filled{variant.drives})),
        held_(drives_),
        arriving_(static_cast<std::size_t>(variant.delay) + 1, Vector6(icat::Filled{0})),
        random_(variant.seed),
        q_(start()) {}

  Result run(double duration, const Watch& watch) {
    keep(controller_.start("hold", 0));
    const int steps = static_cast<int>(std::lround(duration / plant_dt));
    for (int k = 0; k < steps && result_.status == icat::Status::ok; ++k) {
      const double t = k * plant_dt;
      vehicle_now_ = plant_.vehicle();
      vehicle_now_.translation().x() += carried(t);
      Vector6& velocity = arriving_[static_cast<std::size_t>(k) % arriving_.size()];
      velocity = plant_.vehicle_velocity();
      for (int i = 0; i < 3; ++i) velocity(i) += vehicle_now_.linear()(0, i) * current(t);
      velocity_now_ = velocity;
      if (k % variant_.every == 0) control(k, t);
      if (watch && k % base_every == 0) watch(t, controller_, hold_.goal().translation());
      move();
      if (k % variant_.every == 0 && t >= settled) measure();
    }
    for (double* sum : {&result_.reference, &result_.acceleration, &result_.rate, &result_.position,
                        &result_.orientation, &result_.tool_speed}) {
      *sum = std::sqrt(*sum / std::max(counted_, 1));
    }
    return std::move(result_);
  }

 private:
  static icat::VelocityBounds<double, 13> speeds() {
    Vector13 most = icat::Filled{0.3};
    for (int i = 0; i < 7; ++i) most(i) = 1;
    return {-most, most};
  }
  static Vector6 bandwidth() {
    Vector6 w;
    w << 1, 1, 1, 0, 0, 2;
    return w;
  }
  icat::Pose<double> goal() {
    keep(robot_.update(start(), icat::Pose<double>::Identity()));
    return robot_.pose(tool_);
  }
  // The inertia of a drive when all else is free, 1/(M⁻¹)ᵢᵢ.
  Joints felt() const {
    icat::detail::Cholesky<double, 13> factor;
    (void)factor.compute(plant_.dynamics().mass_matrix());
    Joints inertia;
    for (int i = 0; i < 7; ++i) {
      Vector13 unit = icat::Filled{0};
      unit(i) = 1;
      factor.solve_lower(unit);
      inertia(i) = 1 / unit.squaredNorm();
    }
    return inertia;
  }
  void keep(icat::Status status) {
    if (result_.status == icat::Status::ok) result_.status = status;
  }

  void control(int k, double t) {
    Vector6 feedback = arriving_[static_cast<std::size_t>(k + 1) % arriving_.size()];
    for (int i = 0; i < 6 && variant_.noise; ++i) {
      feedback(i) += (i < 3 ? linear_noise : angular_noise) * normal_(random_);
    }
    keep(robot_.update(q_, vehicle_now_));
    const double dt = plant_dt * variant_.every;
    //! [filter]
    keep(filter_.update(feedback, dt));  // icat::LowPass<double, 6>, time constant 1/ω
    const Vector6 measured = filter_.value();
    if (k % base_every == 0) keep(controller_.step_base(t, measured));  // TPIK 1
    if (k % law_every == 0) keep(controller_.step_joint_law(t));        // TPIK 2
    keep(controller_.follow_joint_law(t, measured));
    //! [filter]
    if (k % vehicle_every == 0) {
      keep(vehicle_.step(t, {.reference = controller_.command().tail<6>(),
                             .velocity = measured,
                             .attitude = vehicle_now_.linear()}));
      keep(allocation_.allocate(vehicle_.wrench()));
      keep(vehicle_.achieved(allocation_.achieved()));
    }
    reference_ = controller_.command().head<7>();
    result_.samples.push_back({t, measured, reference_});
  }

  void move() {
    const Joints still = icat::Filled{0};
    Vector13 force = icat::Filled{0};
    for (std::size_t i = 0; i < 8; ++i) {
      const auto column = static_cast<icat::Index>(i);
      keep(thrusters_[i].update(allocation_.thrust()(column), plant_dt));
      for (int j = 0; j < 6; ++j) {
        force(7 + j) += thrusters_[i].thrust() * allocation_.wrenches()(j, column);
      }
    }
    keep(drives_.update(reference_, speed_, still, plant_dt));
    if (variant_.reaction) {
      force.head<7>() = drives_.output();
      keep(plant_.step(force, plant_dt));
      q_ = plant_.q();
      speed_ = plant_.joint_velocity();
    } else {
      // The vehicle carries an arm that holds still; the moving arm has no reaction on it.
      keep(held_.update(still, plant_.joint_velocity(), still, plant_dt));
      force.head<7>() = held_.output();
      keep(plant_.step(force, plant_dt));
      for (int i = 0; i < 7; ++i) {
        speed_(i) += plant_dt * drives_.output()(i) / inertia_(i);
        q_(i) += plant_dt * speed_(i);
      }
    }
  }

  void measure() {
    ++counted_;
    Vector13 velocity;
    velocity << speed_, velocity_now_;
    double linear = 0;
    for (int i = 0; i < 3; ++i) {
      double v = 0;
      for (int j = 0; j < 13; ++j) v += robot_.jacobian(tool_)(i, j) * velocity(j);
      linear += v * v;
    }
    const auto square = [](double x) { return x * x; };
    result_.reference += reference_.squaredNorm();
    result_.acceleration += square(plant_.acceleration()(10)) + square(plant_.acceleration()(11));
    result_.rate += square(velocity(10)) + square(velocity(11));
    result_.position += square(hold_.position_error());
    result_.orientation += square(hold_.orientation_error());
    result_.tool_speed += linear;
  }

  Variant variant_;
  Result result_;
  Robot robot_;
  icat::FrameId tool_;
  Plant plant_;
  icat::task::JointLimits<Robot> limits_;
  icat::task::FramePose<Robot> hold_;
  icat::task::Minimality<Robot> still_;
  icat::ParallelController<Robot> controller_;
  icat::LowPass<double, 6> filter_;
  icat::VehicleLoop<double> vehicle_;
  icat::ThrusterAllocation<double, 8> allocation_;
  std::vector<icat::ThrusterModel<double>> thrusters_;
  Joints inertia_;
  icat::PiLoop<double, 7> drives_, held_;
  icat::Pose<double> vehicle_now_;  // over the ground
  Vector6 velocity_now_;
  std::vector<Vector6> arriving_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  Joints q_, speed_ = icat::Filled{0}, reference_ = icat::Filled{0};
  int counted_ = 0;
};

inline Result run(const Variant& variant, double duration = 30, const Watch& watch = {}) {
  return Simulation(variant).run(duration, watch);
}

}  // namespace feedback
