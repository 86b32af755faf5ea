// SPDX-License-Identifier: BSD-3-Clause
// A robot with its tasks, PI velocity loops and agent, as it carries the pipe.
#pragma once

#include <icat/icat.hpp>
#include <icat/sim/grasped_object_plant.hpp>
#include <icat/sim/maris_dynamics.hpp>
#include <icat/sim/noise.hpp>
#include <icat/sim/thruster.hpp>

#include "../support/uvms.hpp"
#include "scene.hpp"

namespace table3 {

using Robot = icat::KinematicTree<double, 13>;
using Plant = icat::GraspedObjectPlant<double, 7>;
using Vector3 = icat::Vector3<double>;
using Vector6 = icat::Vector6<double>;
using Vector13 = icat::Vector<double, 13>;
using Joints = icat::Vector<double, 7>;
using Objective = icat::Objective<double>;

/// Its tool is the gripper until it holds the pipe.
inline Robot make_robot() {
  return icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>(),
                                                .tool = support::pose({0, 0, 0.1}, 0, 0, 0)});
}

/// After the grasp: the grippers came from above, the vehicles face along x of the world, level.
inline icat::HydrodynamicPlant<double, 7> plant_of(std::size_t index, const Parameters& p) {
  const Joints q = Eigen::Map<const Joints>(p.start[index].data());
  const double side = index == 0 ? -1 : 1;
  Robot robot = make_robot();
  const icat::Status status = robot.update(q, Pose::Identity());
  if (status != icat::Status::ok) icat::detail::invalid("the start is refused");
  Pose gripper = pipe_start;
  gripper.translation() += side * grasp_distance * pipe_start.linear().col(0);
  gripper.linear() = Vector3(-1, -1, 1).asDiagonal();
  icat::HydrodynamicPlant<double, 7>::State start;
  start.q = q;
  start.vehicle = gripper * robot.pose(robot.frame("tool")).inverse();
  return icat::HydrodynamicPlant<double, 7>(icat::maris_dynamics<double>(), start);
}

/// The eight thrusters of R2 [MARIS, III-D] on this vehicle: torque first, then force, since all
/// six components are controlled here. They lag, have less thrust backwards than forwards, and have
/// dead zones.
class Propulsion {
 public:
  /// The wrench that the thrusters achieve of a request, over `dt` s.
  icat::Status update(const Vector6& wanted, double dt, Vector6& given) {
    icat::Status status = allocation_.allocate(wanted);
    given.setZero();
    for (std::size_t i = 0; i < thrusters_.size(); ++i) {
      const icat::Status told =
          models_[i].update(allocation_.thrust()(static_cast<Eigen::Index>(i)), dt);
      if (status == icat::Status::ok) status = told;
      const Vector3 force = models_[i].thrust() * thrusters_[i].direction.normalized();
      given.head<3>() += force;
      given.tail<3>() += thrusters_[i].position.cross(force);
    }
    return status;
  }

 private:
  using enum icat::WrenchComponent;
  std::vector<icat::Thruster<double>> thrusters_ = icat::r2_thrusters<double>();
  icat::ThrusterAllocation<double, 8> allocation_{thrusters_,
                                                  {{roll, pitch, yaw}, {surge, sway, heave}}};
  std::array<icat::ThrusterModel<double>, 8> models_;
};

inline const std::vector<std::string> task_names{
    "joint limits", "vehicle distance", "manipulability", "horizontal attitude", "agreed velocity"};

/// A robot with its tasks, loops and agent.
class Side {
 public:
  Side(std::size_t index, const Plant& plant, const Row& row, const Parameters& p)
      : robot(holding(plant.grasp(index))),
        tool_frame_(robot.frame("tool")),
        joint_limits_(robot, {.margin = 0.2, .gain = 0.5}),
        distance_(robot, robot.base(), plant.robot(1 - index).vehicle().translation(),
                  Objective::at_least(p.distance, 0.5), {.gain = 0.5}),
        manipulability_(robot, tool_frame_, Objective::at_least(0.05, 0.04)),
        attitude_(robot, robot.base(), {.norm = Objective::at_most(0.2, 0.1), .gain = 0.5}),
        transport_(robot, tool_frame_, pre_deployment, carefully(p, "tool to pre-deployment")),
        deploy_(robot, tool_frame_, seabed, carefully(p, "tool to the seabed")),
        hold_(robot, tool_frame_, pipe_start, {.name = "hold"}),
        still_arm_(robot, icat::joint_columns(robot)),
        still_vehicle_(robot, robot.base_columns()),
        agent(robot,
              {{"hold", levels(hold_, still_arm_)},
               {"transport", levels(transport_, still_arm_)},
               {"deploy", levels(deploy_, still_vehicle_)}},
              {{"hold", hold_}, {"transport", transport_}, {"deploy", deploy_}},
              {.controller = {.solver = {.bounds = support::velocity_bounds(
                                             p.joint_speed, p.vehicle_speed, p.vehicle_turn)},
                              .characteristic_length = 1},  // rows as in the paper
               .compensation = row.compensation,
               .agreement = {.index = index,
                             .spans = row.spans,
                             .latest = p.latest && row.duplex == icat::Duplex::half,
                             .hold = p.hold,
                             .fallback = icat::Fallback::alone,
                             .fade = p.fade},
               .filter = row.filter ? p.filter : 0}),
        joints_(icat::PiLoop<double, 7>::tuned(nominal_inertia().head<7>(),
                                               Joints::Constant(p.joint_bandwidth))),
        vehicle_(icat::PiLoop<double, 6>::tuned(nominal_inertia().tail<6>(), vehicle_bandwidth(p))),
        feedback_(row.feedback, Vector6::Zero()),
        noise_(index + 1),
        sensors_(row.sensors),
        thrusters_(row.thrusters) {}

  icat::Status see(const Vector3& other) { return distance_.set_point(other); }
  /// ẏ as the kinematic loop gets it: the vehicle's, the joints' is not needed.
  Vector13 measured(double t, const Vector6& truth) {
    Vector13 velocity = Vector13::Zero();
    velocity.tail<6>() = feedback_.update(t, truth);
    if (sensors_) {
      velocity.segment<3>(7) += noise_.vector<double, 3>(linear_noise);
      velocity.tail<3>() += noise_.vector<double, 3>(angular_noise);
    }
    return velocity;
  }
  /// Velocity of the tool under the agent's own hierarchy, components on it.
  Vector6 own_tool_velocity() const {
    return support::twist(robot, tool_frame_, agent.own().velocity());
  }
  /// Largest activation of each task whose name is in `task_names`.
  std::array<double, 5> activations() const {
    return {joint_limits_.activation().maxCoeff(), distance_.activation().maxCoeff(),
            manipulability_.activation().maxCoeff(), attitude_.activation().maxCoeff(),
            agent.agreement_activation()};
  }
  /// Torques and vehicle wrench of the PI loops, each 2 kHz step.
  icat::Status forces(const Vector13& velocity, Vector13& out) {
    const icat::Status arm =
        joints_.update(agent.velocity().head<7>(), velocity.head<7>(), Joints::Zero(), plant_dt);
    icat::Status hull =
        vehicle_.update(agent.velocity().tail<6>(), velocity.tail<6>(), Vector6::Zero(), plant_dt);
    Vector6 wrench = vehicle_.output();
    if (thrusters_ && hull == icat::Status::ok) {
      hull = propulsion_.update(vehicle_.output(), plant_dt, wrench);
    }
    out << joints_.output(), wrench;
    return arm == icat::Status::ok ? hull : arm;
  }

  Robot robot;

 private:
  /// [Coop, III-E]; the arm rests in transport, the vehicle in deployment [Coop, Table I].
  std::vector<icat::PriorityLevel<Robot>> levels(icat::task::FramePose<Robot>& tool,
                                                 icat::task::Minimality<Robot>& still) {
    return {{joint_limits_}, {distance_}, {manipulability_}, {attitude_}, {tool}, {still}};
  }
  static icat::task::FramePose<Robot>::Options carefully(const Parameters& p, const char* name) {
    return {.name = name,
            .gain = p.tool_gain,
            .max_linear_rate = p.tool_linear,
            .max_angular_rate = p.tool_angular};
  }
  static Vector6 vehicle_bandwidth(const Parameters& p) {
    Vector6 b;
    b << Vector3::Constant(p.vehicle_bandwidth), Vector3::Constant(p.turn_bandwidth);
    return b;
  }
  /// The inertia of each axis when the others are free, 1/(M⁻¹)ᵢᵢ, in the nominal posture.
  static Vector13 nominal_inertia() {
    icat::HydrodynamicPlant<double, 7>::State nominal;
    nominal.q << 0, 0.4, 0.3, -1.6, 0, 0.8, 0;
    const icat::HydrodynamicPlant<double, 7> plant(icat::maris_dynamics<double>(), nominal);
    const Eigen::Matrix<double, 13, 13> M = plant.dynamics().mass_matrix();
    return M.inverse().diagonal().cwiseInverse();
  }
  static Robot holding(const Pose& grasp) {
    Robot robot = make_robot();
    const icat::Status status =
        robot.set_frame(robot.frame("tool"), robot.frame("end_effector"), grasp);
    if (status != icat::Status::ok) icat::detail::invalid("the grasp is refused");
    return robot;
  }
  icat::FrameId tool_frame_;
  icat::task::JointLimits<Robot> joint_limits_;
  icat::task::FrameDistance<Robot> distance_;
  icat::task::Manipulability<Robot> manipulability_;
  icat::task::Attitude<Robot> attitude_;
  icat::task::FramePose<Robot> transport_, deploy_, hold_;
  icat::task::Minimality<Robot> still_arm_, still_vehicle_;

 public:
  icat::Agent<Robot> agent;

 private:
  icat::PiLoop<double, 7> joints_;
  icat::PiLoop<double, 6> vehicle_;
  icat::SampleHold<Vector6> feedback_;
  static constexpr double linear_noise = 0.02, angular_noise = 0.05;  // m/s, rad/s, each sample
  icat::Noise noise_;
  bool sensors_, thrusters_;
  Propulsion propulsion_;
};

}  // namespace table3
