// SPDX-License-Identifier: BSD-3-Clause
// The lesson of the MARIS trials [MARIS, VI-D]: TPIK 2 takes noise of the vehicle's measured
// velocity for motion and makes up for it, the arm shakes the vehicle, and that is measured again.
// A first-order low-pass at 50 rad/s ended it. R2 and the arm as dynamics hold a tool in place.
#pragma once

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <complex>
#include <icat/control/low_pass.hpp>
#include <icat/control/parallel_controller.hpp>
#include <icat/control/thruster_allocation.hpp>
#include <icat/control/vehicle_loop.hpp>
#include <icat/model/uvms.hpp>
#include <icat/sim/hydrodynamic_plant.hpp>
#include <icat/sim/maris_dynamics.hpp>
#include <icat/sim/thruster.hpp>
#include <icat/task/frame_tasks.hpp>
#include <icat/task/joint_tasks.hpp>
#include <limits>
#include <random>
#include <vector>

namespace feedback {

using Robot = icat::KinematicTree<double, 13>;
using Plant = icat::HydrodynamicPlant<double, 7>;
using Vector3 = icat::Vector3<double>;
using Vector6 = icat::Vector6<double>;
using Vector13 = icat::Vector<double, 13>;
using Joints = icat::Vector<double, 7>;
using Matrix6 = icat::Matrix6<double>;

// One set for all runs. The paper prints none of these but the filter.
constexpr double plant_dt = 0.001;        // s, and of the joints' drives
constexpr int feedback_every = 2;         // 500 Hz: velocity feedback, and the arm's law
constexpr int vehicle_every = 10;         // 100 Hz: the vehicle's loop and thrusters
constexpr int law_every = 20;             // 50 Hz: TPIK 2, as a law
constexpr int base_every = 50;            // 20 Hz: TPIK 1
constexpr double linear_noise = 0.02;     // m/s, white, each sample: a DVL's
constexpr double angular_noise = 0.075;   // rad/s, the same: gyros that vibrate
constexpr int delay = 15;                 // ms, of the feedback
constexpr double joint_bandwidth = 100;   // rad/s, both poles of each drive
constexpr double tool_gain = 0.5;         // 1/s
constexpr double unfiltered = std::numeric_limits<double>::infinity();

struct Variant {
  double cutoff = unfiltered;  ///< of the low-pass on the feedback, rad/s
  bool noise = true;           ///< on the feedback
  bool reaction = true;        ///< the arm's motion moves the vehicle
  bool compensation = true;    ///< the arm makes up for the vehicle's motion
};

struct Sample {
  double t;
  Vector6 seen;       ///< feedback as the arm gets it
  Joints reference;   ///< of the joints' velocities
  double tool_error;  ///< m
};

struct Result {
  std::vector<Sample> samples;  ///< at 500 Hz
  // RMS after 5 s:
  double reference = 0;      ///< of ‖q̇‖ as commanded, rad/s
  double turning = 0;        ///< of the vehicle's true angular velocity, rad/s
  double tool = 0;           ///< of the tool's position error, m
  double orientation = 0;    ///< of its orientation error, rad
  double shake = 0;          ///< of the tool's true velocity, m/s
  icat::Status status = icat::Status::ok;
};

/// The arm reaches down to the floor, as when it grasps.
inline Joints start() {
  Joints q;
  q << 0, 0.9, 0, -1.2, 0, 0.6, 0;
  return q;
}
inline Robot make_robot() {
  return icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>()});
}
inline Plant make_plant() {
  return Plant(icat::r2_dynamics<double>(), {.q = start()});
}

/// Robot, controllers and plant of one run.
class Run {
 public:
  explicit Run(const Variant& variant)
      : variant_(variant),
        robot_(make_robot()),
        plant_(make_plant()),
        limits_(robot_, {.margin = 0.1}),
        hold_(robot_, robot_.frame("tool"), goal(), {.gain = tool_gain}),
        controller_(robot_, {{"hold", {{limits_}, {hold_}}}},
                    {.given = icat::ColumnRange{robot_.base_columns().first + 3, 2},
                     .solver = {.bounds = speeds()}}),
        filter_(variant.cutoff == unfiltered ? 0 : 1 / variant.cutoff),
        vehicle_(icat::r2_vehicle_body<double>(), vehicle_bandwidth()),
        inertia_(plant_.dynamics().mass_matrix().inverse().diagonal().head<7>().cwiseInverse()),
        drives_(icat::PiLoop<double, 7>::tuned(inertia_, Joints::Constant(joint_bandwidth))),
        held_(drives_),
        allocation_(icat::r2_thrusters<double>(60, -48)),
        thrusters_(8),
        late_(delay + 1, Vector6::Zero()),
        q_(start()) {}

  Result run(double duration) {
    keep(controller_.start("hold", 0));
    const int steps = static_cast<int>(std::lround(duration / plant_dt));
    int counted = 0;
    for (int k = 0; k < steps && result_.status == icat::Status::ok; ++k) {
      const double t = k * plant_dt;
      late_[static_cast<std::size_t>(k) % late_.size()] = plant_.vehicle_velocity();
      if (k % feedback_every == 0) {
        control(k, t);
        if (t >= 5) {
          ++counted;
          const Joints reference = controller_.command().head<7>();
          const Sample& last = result_.samples.back();
          result_.reference += reference.squaredNorm();
          result_.turning += plant_.vehicle_velocity().tail<3>().squaredNorm();
          result_.tool += last.tool_error * last.tool_error;
          Vector13 velocity = plant_.velocity();
          velocity.head<7>() = speed_;
          result_.shake += (robot_.jacobian(robot_.frame("tool")) * velocity).head<3>().squaredNorm();
          result_.orientation += hold_.orientation_error() * hold_.orientation_error();
        }
      }
      move();
    }
    for (double* sum : {&result_.reference, &result_.turning, &result_.tool, &result_.orientation,
                        &result_.shake}) {
      *sum = std::sqrt(*sum / std::max(counted, 1));
    }
    return std::move(result_);
  }

 private:
  static icat::VelocityBounds<double, 13> speeds() {
    Vector13 most;
    most << Joints::Constant(1), Vector3::Constant(0.3), Vector3::Constant(0.3);
    return {-most, most};
  }
  static Vector6 vehicle_bandwidth() {
    Vector6 w;
    w << 1, 1, 1, 0, 0, 2;
    return w;
  }
  icat::Pose<double> goal() {
    keep(robot_.update(start(), icat::Pose<double>::Identity()));
    return robot_.pose(robot_.frame("tool"));
  }
  void keep(icat::Status status) {
    if (result_.status == icat::Status::ok) result_.status = status;
  }

  void control(int k, double t) {
    // The newest sample that has arrived.
    Vector6 seen = late_[static_cast<std::size_t>(k + 1) % late_.size()];
    if (variant_.noise) {
      for (int i = 0; i < 6; ++i) seen(i) += (i < 3 ? linear_noise : angular_noise) * normal_(random_);
    }
    //! [filter]
    keep(filter_.update(seen, feedback_every * plant_dt));
    const Vector6 measured = filter_.value();
    //! [filter]
    keep(robot_.update(q_, plant_.vehicle()));
    const Vector6 still = Vector6::Zero();
    //! [rates]
    if (k % base_every == 0) keep(controller_.step_base(t, measured));
    if (k % law_every == 0) keep(controller_.step_joint_law(t));
    keep(controller_.follow_joint_law(t, variant_.compensation ? measured : still));
    //! [rates]
    if (k % vehicle_every == 0) {
      keep(vehicle_.step(t, {.reference = controller_.command().tail<6>(),
                             .velocity = measured,
                             .attitude = plant_.vehicle().linear()}));
      keep(allocation_.allocate(vehicle_.wrench()));
      keep(vehicle_.achieved(allocation_.achieved()));
    }
    const Vector3 off =
        robot_.pose(robot_.frame("tool")).translation() - hold_.goal().translation();
    result_.samples.push_back({t, measured, controller_.command().head<7>(), off.norm()});
  }

  void move() {
    Vector13 force = Vector13::Zero();
    for (std::size_t i = 0; i < 8; ++i) {
      const auto column = static_cast<icat::Index>(i);
      keep(thrusters_[i].update(allocation_.thrust()(column), plant_dt));
      force.tail<6>() += thrusters_[i].thrust() * allocation_.wrenches().col(column);
    }
    const Joints reference = controller_.command().head<7>();
    keep(drives_.update(reference, speed_, Joints::Zero(), plant_dt));
    if (variant_.reaction) {
      force.head<7>() = drives_.output();
    } else {
      // The vehicle carries an arm that is held; the arm that moves is nobody's load.
      keep(held_.update(Joints::Zero(), plant_.joint_velocity(), Joints::Zero(), plant_dt));
      force.head<7>() = held_.output();
    }
    keep(plant_.step(force, plant_dt));
    if (variant_.reaction) {
      q_ = plant_.q();
      speed_ = plant_.joint_velocity();
    } else {
      speed_ += plant_dt * drives_.output().cwiseQuotient(inertia_);
      q_ += plant_dt * speed_;
    }
  }

  Variant variant_;
  Robot robot_;
  Plant plant_;
  Result result_;
  icat::task::JointLimits<Robot> limits_;
  icat::task::FramePose<Robot> hold_;
  icat::ParallelController<Robot> controller_;
  icat::LowPass<double, 6> filter_;
  icat::VehicleLoop<double> vehicle_;
  Joints inertia_;  // that a drive feels when all else is free
  icat::PiLoop<double, 7> drives_, held_;
  icat::ThrusterAllocation<double, 8> allocation_;
  std::vector<icat::ThrusterModel<double>> thrusters_;
  std::vector<Vector6> late_;
  Joints q_, speed_ = Joints::Zero();
  std::mt19937 random_{1};
  std::normal_distribution<double> normal_;
};

inline Result run(const Variant& variant, double duration = 30) {
  return Run(variant).run(duration);
}

}  // namespace feedback
