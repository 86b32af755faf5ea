// SPDX-License-Identifier: BSD-3-Clause
// The papers' vehicle and arm as a model of MuJoCo.
#pragma once

#include <mujoco/mujoco.h>

#include <icat/sim/maris_dynamics.hpp>
#include <memory>
#include <string>

namespace support {

using MujocoModel = std::unique_ptr<mjModel, void (*)(mjModel*)>;

/// What stands around the robot, as MJCF.
struct MujocoScene {
  const char* option;      ///< the element <option>
  const char* world = "";  ///< elements of <worldbody>
  bool shapes = false;     ///< the robot can touch what is in `world`, not itself
};

/// Weight less buoyancy is 1 % of the weight, upwards [Coop, V-B]; the water's drag is MuJoCo's. A
/// seabed at z = 3.05 m, and the pipe of 01_grasp on it, 5 cm thick. 500 Hz.
MujocoScene pool();

/// MJCF of a robot: bodies "vehicle", "link1" …, joints "joint1" … with their ranges.
std::string mjcf(const icat::VehicleManipulatorDynamics<double, 7>::Description& robot,
                 const MujocoScene& scene);

/// Throws `std::runtime_error` with what MuJoCo says of it.
MujocoModel load_mujoco(const std::string& xml);

}  // namespace support
