// SPDX-License-Identifier: BSD-3-Clause
// Runs a configuration on a back-end.
#pragma once

#include <icat/adapters/yaml.hpp>
#include <icat/control/back_end.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <icat/sim/plant_back_end.hpp>

namespace run {

using Robot = icat::ConfiguredRobot;
using Plant = icat::KinematicPlant<Robot>;

/// What a command does to the robot, as the configuration says.
inline Plant make_plant(icat::Configuration& config) {
  const icat::ConfiguredPlant plant = config.plant();
  Plant::Options options{.q = config.start_q(),
                         .base = config.start_base(),
                         .tracking_lag = plant.tracking_lag,
                         .not_actuated = plant.not_actuated};
  if (plant.has_current) options.current = [plant](double t) { return plant.current_at(t); };
  return Plant(config.robot(), options);
}

/// Runs the mission to its end, or until something fails. Every cycle ends with `observe(t,
/// state)`; `between(t)` is called before it.
//! [loop]
template <icat::BackEnd<Robot> BackEnd, class Between, class Observe>
icat::Status mission(icat::Configuration& config, BackEnd& back_end, Between between,
                     Observe observe) {
  icat::Mission& mission = *config.mission();
  icat::ConfiguredController& controller = config.controller();
  icat::RobotState<Robot> state(config.robot());
  const auto supervise = [&](double t) {
    const icat::Status status = mission.step(t);
    return status == icat::Status::ok ? mission.drive(controller, t) : status;
  };
  icat::Status status = supervise(0);
  for (long cycle = 0; status == icat::Status::ok && mission.end() == icat::PhaseEnd::none;
       ++cycle) {
    const double t = static_cast<double>(cycle) * config.period();
    between(t);
    config.update(t);  // goals that move
    status = back_end.read(t, state);
    if (status == icat::Status::ok) status = config.robot().update(state.q, state.base);
    if (status == icat::Status::ok) status = controller.step(t, state.velocity);
    if (status == icat::Status::ok) status = back_end.write(t, controller.command());
    observe(t, state);
    if (status == icat::Status::ok) status = supervise(t);
  }
  return status;
}
//! [loop]

}  // namespace run
