// SPDX-License-Identifier: BSD-3-Clause
// A hand over a tube that lies on the floor: it closes and lifts.
#pragma once

#include <algorithm>
#include <icat/control/grasp_detector.hpp>
#include <icat/sim/grasp_plant.hpp>
#include <numbers>
#include <string_view>

#include "../support/geometry.hpp"

namespace bench {

using Pose = icat::Pose<double>;

/// A pipe along y of ⟨h⟩, `depth` in front of the palm.
inline Pose across(double depth) {
  return support::pose({0, 0, depth}, 0, 0, std::numbers::pi / 2);
}

/// ⟨0⟩ has z down; the pipe lies along x.
class Rig {
 public:
  Rig(double diameter, double depth)
      : plant_(icat::HandPlant<double>(), options(diameter),
               support::pose({0, 0, floor_depth - diameter / 2}, 0, 0, 0)) {
    // z of ⟨h⟩ down, y along the pipe.
    hand_ = support::pose({0, 0, floor_depth - diameter / 2 - depth}, 0, 0, -std::numbers::pi / 2);
  }

  /// Opens, closes, waits for what the detector says.
  void grasp(icat::Preshape shape, double current) {
    detector_.preshape(shape);
    pass(4, 0);
    keep(detector_.close(0.3, current));
    for (int k = 0; k < 10 && detector_.state() == icat::GraspState::moving; ++k) pass(1, 0);
  }
  /// By 0.3 m in 4 s, then waits.
  void lift() {
    for (int k = 0; k < 400; ++k) {
      const double u = (k + 0.5) / 400;
      pass(0.01, 0.3 / 4 * 30 * u * u * (1 - u) * (1 - u));
    }
    pass(3, 0);
  }
  bool held() const {
    return !plant_.on_floor() && plant_.pipe_in_hand().translation().norm() < 0.3;
  }
  /// What the detector makes of its currents.
  std::string_view said() const { return icat::describe(detector_.state()); }
  /// The largest of a finger so far, N.
  double force() const { return force_; }
  icat::Status status() const { return status_; }

 private:
  static constexpr double floor_depth = 4;

  /// PVC, 3 mm thick, open at its ends, 1 m long; what it displaces and what it drags along.
  static icat::GraspPlant<double>::Options options(double diameter) {
    icat::GraspPlant<double>::Options o;
    const double r = diameter / 2, water = 1000 * std::numbers::pi * r * r;
    const double wall = std::min(1.0, 0.012 / diameter);
    o.body = icat::tube<double>(1.4 * water * wall, r, 1);
    o.body.displaced_mass = water * wall;
    o.body.added_mass << 0, water, water, 0, water / 12, water / 12;
    o.body.quadratic_drag << 0, 550 * diameter, 550 * diameter, 0, 17 * diameter, 17 * diameter;
    o.shape = {r, 0.5};
    o.floor = floor_depth;
    return o;
  }
  void keep(icat::Status status) {
    if (status_ == icat::Status::ok) status_ = status;
  }
  /// The hand rises with `speed`, m/s; its detector at 100 Hz.
  void pass(double time, double speed) {
    icat::Vector6<double> twist = icat::Vector6<double>::Zero();
    twist(2) = -speed;
    for (double passed = 0; passed < time - 1e-9; passed += 0.01) {
      keep(plant_.step(detector_.command(), hand_, twist, 0.01));
      hand_ = icat::integrate<double>(hand_, twist, 0.01);
      keep(detector_.step(time_ += 0.01, plant_.hand().reading()));
      for (const auto f : {icat::thumb, icat::right_finger, icat::left_finger}) {
        force_ = std::max(force_, plant_.hand().force(f));
      }
    }
  }

  icat::GraspPlant<double> plant_;
  Pose hand_ = Pose::Identity();
  icat::GraspDetector<double> detector_;
  icat::Status status_ = icat::Status::ok;
  double time_ = 0, force_ = 0;
};

}  // namespace bench
