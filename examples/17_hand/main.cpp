// SPDX-License-Identifier: BSD-3-Clause
// The hand of [MARIS, II-C]: how its joints stand in the three kinds of grasp (Figs 3 and 4), which
// pipes it holds and how hard it presses, and its wrist sensor beside a reference (Fig. 8).
#include <cmath>
#include <cstdio>
#include <icat/control/wrist_wrench.hpp>
#include <icat/sim/wrist_sensor.hpp>
#include <string>
#include <vector>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/support.hpp"
#include "bench.hpp"

namespace {

using icat::Preshape;
using icat::Vector3;
using icat::Vector6;
using Hand = icat::MarisHand<double>;

constexpr icat::HandFinger fingers[] = {icat::thumb, icat::right_finger, icat::left_finger};

const char* name_of(Preshape shape) {
  return shape == Preshape::parallel ? "parallel"
         : shape == Preshape::power  ? "power"
                                     : "precision";
}

/// The hand open, then closed on a pipe of 100 mm, in each shape; one block for each finger.
void write_postures(const std::string& folder) {
  support::Strokes strokes(folder, "postures.csv");
  const Hand hand;
  const icat::PipeShape<double> pipe{};
  for (const Preshape shape : {Preshape::parallel, Preshape::power, Preshape::precision}) {
    const icat::Pose<double> place = bench::across(shape == Preshape::power ? 0.1 : 0.14);
    for (const bool closed : {false, true}) {
      for (const auto finger : fingers) {
        icat::Vector3<double> motors = hand.preshape(shape);
        if (closed) motors = hand.meets(finger, shape, pipe, place).motors;
        const auto links = hand.links(finger, hand.coupled(finger, motors));
        const Vector3<double> base = hand.base(finger);
        strokes.add(
            {Vector3<double>(base(0), base(1), 0), links[0].from, links[1].from, links[1].to});
      }
    }
  }
  int count[icat::palm_group + 1] = {};
  for (const Hand::Joint& joint : Hand::joints) ++count[joint.group];
  std::printf("%d joints on %d motors: distal %d, proximal %d, palm %d\n", Hand::joint_count,
              Hand::motor_count, count[icat::distal_group], count[icat::proximal_group],
              count[icat::palm_group]);
}

struct Case {
  double diameter;  ///< m
  Preshape shape;
  double depth;    ///< of the pipe in the hand, m; 210 mm stop at the fingertips
  double current;  ///< A
  bool inside;     ///< of the diameters of the specification
};

/// Grasps, lifts, and says what came of it.
bool hold_pipes() {
  const Case cases[] = {
      {0.004, Preshape::parallel, 0.14, 0.3, false}, {0.005, Preshape::parallel, 0.14, 0.3, true},
      {0.05, Preshape::precision, 0.14, 0.8, true},  {0.1, Preshape::parallel, 0.14, 0.8, true},
      {0.1, Preshape::power, 0.1, 0.5, true},        {0.2, Preshape::power, 0.13, 0.5, true},
      {0.21, Preshape::power, 0.212, 0.5, false}};
  bool as_specified = true;
  double largest = 0;
  std::printf("\n%-14s %-10s %8s %10s %14s\n", "pipe", "grasp", "held", "the hand", "finger, most");
  for (const Case& c : cases) {
    bench::Rig rig(c.diameter, c.depth);
    rig.grasp(c.shape, c.current);
    const std::string said(rig.said());
    rig.lift();
    std::printf("%6.0f mm      %-10s %8s %10s %10.0f N\n", 1e3 * c.diameter, name_of(c.shape),
                rig.held() ? "held" : "left", said.c_str(), rig.force());
    largest = std::max(largest, rig.force());
    as_specified = as_specified && rig.held() == c.inside && rig.status() == icat::Status::ok;
  }
  std::printf("largest force of a finger: %.0f N\n", largest);
  return as_specified && largest <= 150;
}

/// A push and a turn on each axis after the other, as somebody makes by hand.
Vector6<double> load(double t) {
  Vector6<double> w = Vector6<double>::Zero();
  for (int i = 0; i < 6; ++i) {
    const double u = t - 2 * i;
    if (u < 0 || u > 3) continue;
    const double bump = std::sin(M_PI * u / 3) * std::sin(2 * M_PI * u / 1.5);
    w(i) = bump * (i < 3 ? 80 : 6);
  }
  return w;
}

/// Calibrated on random loads, then compared on others that it has not seen.
bool compare_wrist(const std::string& folder) {
  // The reference of [MARIS, Fig. 8] measures 130 N and 10 N m.
  constexpr double force_range = 130, torque_range = 10, dt = 0.01;
  constexpr int signals = 8;
  icat::Noise random(5);
  const auto uniform = [&] { return 2 * random.uniform() - 1; };
  icat::WristSensor<double, signals>::Options options;
  for (int i = 0; i < signals; ++i) {
    options.zero(i) = 0.5 * uniform();
    for (int k = 0; k < 6; ++k) {
      const double own = i % 6 == k ? 2 : 0;  // V at full range; the axes mix
      options.sensitivity(i, k) = (own + 0.5 * uniform()) / (k < 3 ? force_range : torque_range);
    }
  }
  options.noise = 0.003;
  options.drift = 1e-4;
  icat::WristSensor<double, signals> wrist(options);
  std::vector<icat::WrenchSample<double, signals>> samples(500);
  for (auto& s : samples) {
    for (int i = 0; i < 6; ++i) s.wrench(i) = uniform() * (i < 3 ? force_range : torque_range);
    if (wrist.measure(s.wrench, dt) != icat::Status::ok) return false;
    s.signal = wrist.signal();
  }
  const auto fit = icat::calibrate_wrench<double, signals>(samples, options.zero);
  icat::WristWrench<double, signals> estimate(fit, {.mass = 0, .displaced = 0});

  support::Csv csv(folder, "wrist.csv",
                   "t,fx,fy,fz,tx,ty,tz,ref_fx,ref_fy,ref_fz,ref_tx,ref_ty,ref_tz");
  Vector6<double> square = Vector6<double>::Zero();
  constexpr int steps = 1400;
  for (int k = 0; k < steps; ++k) {
    const Vector6<double> w = load(k * dt);
    if (wrist.measure(w, dt) != icat::Status::ok ||
        estimate.update(wrist.signal(), icat::Matrix3<double>::Identity()) != icat::Status::ok) {
      return false;
    }
    const Vector6<double> got = estimate.wrench();
    square += (got - w).cwiseAbs2() / steps;
    csv.row(k * dt, got, w);
  }
  const double force = std::sqrt(square.head<3>().maxCoeff());
  const double torque = std::sqrt(square.tail<3>().maxCoeff());
  std::printf(
      "\nwrist beside the reference, rms of the worst axis: %.2f N, %.3f N m; of its range %.2f "
      "%%, "
      "%.2f %%\n",
      force, torque, 100 * force / force_range, 100 * torque / torque_range);
  return force < 0.01 * force_range && torque < 0.01 * torque_range;
}

}  // namespace

int main(int argc, char** argv) {
  const auto arguments = support::parse(
      argc, argv, "The hand of the MARIS project: postures, grasps, forces, wrist.", "out/17_hand");
  write_postures(arguments.output);
  const bool holds = hold_pipes();
  const bool measures = compare_wrist(arguments.output);
  if (arguments.pictures) support::draw(arguments.output);
  return holds && measures ? 0 : 1;
}
