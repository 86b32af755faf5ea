// SPDX-License-Identifier: BSD-3-Clause
// One attempt to grasp, from the survey to the posture for transport, in closed loop: plant,
// thrusters, sensors, navigation, vision, hand, mission, control. A campaign is a set of switches;
// everything else is one set of numbers. The conditions of an attempt and the sensors' noise are
// random, by its seed; the contacts of the hand decide whether it succeeds.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <icat/action/maris_grasp.hpp>
#include <icat/control/grasp_detector.hpp>
#include <icat/control/low_pass.hpp>
#include <icat/control/parallel_controller.hpp>
#include <icat/control/thruster_allocation.hpp>
#include <icat/control/vehicle_loop.hpp>
#include <icat/mission/maris_mission.hpp>
#include <icat/perception/arm_mask.hpp>
#include <icat/perception/frame_tracker.hpp>
#include <icat/perception/pose_history.hpp>
#include <icat/sim/grasp_plant.hpp>
#include <icat/sim/stereo_pipe.hpp>
#include <icat/sim/thruster.hpp>
#include <icat/task/column_tasks.hpp>
#include <vector>

#include "robot.hpp"

namespace campaign {

/// One attempt, see the file comment.
class Attempt {
 public:
  Attempt(const Switches& switches, std::uint64_t seed)
      : switches_(switches),
        conditions_(seed),
        mount_(conditions_.believed_mount(switches.errors)),
        robot_(make_robot(mount_)),
        plant_(icat::r2_dynamics<double>(),
               {.q = joints(1.2, -2.2, 1.0),
                .vehicle = switches.vehicle ? conditions_.start : conditions_.placed}),
        frames_{robot_.frame("tool"), robot_.frame(icat::maris_elbow), robot_.frame("camera")},
        grasp_(robot_, frames_, joints(0.6, -1.4, 0.8), {.linear_rate = 0.15, .angular_rate = 0.3}),
        waypoint_(
            robot_, robot_.base(), conditions_.waypoint,
            {.name = "waypoint", .gain = 0.5, .max_linear_rate = 0.2, .max_angular_rate = 0.2}),
        folded_(robot_, joints(1.2, -2.2, 1.0), {.name = "folded", .gain = 0.3, .max_rate = 0.3}),
        still_arm_(robot_, icat::joint_columns(robot_), "still arm"),
        still_vehicle_(robot_, robot_.base_columns(), "still vehicle"),
        controller_(robot_, actions(), options()),
        mission_(icat::maris_mission({.at_grasp = [this] { return at_grasp(); },
                                      .at_posture = [this] { return at_posture(); },
                                      .survey_limit = 90,
                                      .approach_limit = 60,
                                      .close_limit = 15,
                                      .carry_limit = 40})),
        loop_(trimmed(), bandwidth()),
        allocation_(icat::r2_thrusters<double>(60, -48)),
        thrusters_(8, icat::ThrusterModel<double>({.dead_zone = switches.errors.dead_zone})),
        drives_(icat::PiLoop<double, 7>::tuned(felt(), icat::Filled{100.0})),
        filter_(switches.filter ? 1 / 50.0 : 0),
        navigation_(model(), plant_.vehicle(), navigation_options()),
        ahrs_({.latency = switches.errors.gyro_latency,
               .gyro_noise = gyro_noise / std::sqrt(100.0),
               .seed = seed + 1000000}),
        dvl_({.latency = switches.errors.dvl_latency,
              .beam_noise = beam_noise,
              .floor = floor,
              .seed = seed + 2000000}),
        depth_({.seed = seed + 3000000}),
        cameras_(icat::parallel_cameras<double>(1000)),
        arm_(robot_, frames_.camera, cameras_, boxes()),
        eyes_(cameras_, camera_mount(),
              {.pixel_noise = switches.errors.pixel_noise,
               .attenuation = switches.attenuation,
               .seed = seed + 4000000}),
        estimator_(cameras_, {.towards = Vector3(0, -1, 0)}),
        tracker_(mount_),
        pool_(icat::HandPlant<double>(), {.body = icat::r2_pipe_body<double>(), .floor = support},
              conditions_.pipe),
        random_(seed + 5000000) {
    detector_.preshape(icat::Preshape::power);
  }
  Attempt(const Attempt&) = delete;
  Attempt& operator=(const Attempt&) = delete;

  /// `watch` sees ten cycles a second.
  Result run(const std::function<void(const Attempt&)>& watch = {}) {
    for (long k = 0; mission_.end() == icat::PhaseEnd::none && k < 40000; ++k) {
      time_ = control_dt * static_cast<double>(k);
      sense(k);
      look(k);
      decide();
      control(k);
      if (watch && k % 10 == 0) watch(*this);
      for (int i = 0; i < steps; ++i) move();
      if (bad_ != Status::ok) break;
    }
    return finish();
  }
  // As of the present cycle.
  Sample sample() const {
    const Pose off = (pipe() * at(0, 0, -palm_above)).inverse() * palm();
    return {time_, off.translation().norm(), plant_.vehicle_velocity().head<3>(),
            controller_.command().segment<3>(7), reference_.norm()};
  }
  const icat::ParallelController<Robot>& controller() const { return controller_; }
  std::string_view phase() const { return mission_.phase(); }
  /// Where the palm shall be, in the estimated ⟨0⟩.
  Pose goal() const { return goal_; }
  /// The pipe where it truly is from the robot, in the estimated ⟨0⟩.
  Pose seen_pipe() const { return navigation_.pose() * plant_.vehicle().inverse() * pool_.pipe(); }

 private:
  // --- how it is made ----------------------------------------------------------------------------
  std::vector<icat::Action<Robot>> actions() {
    return {{"survey", {{grasp_.joint_limits}, {waypoint_}, {still_arm_}}},
            grasp_.action(),
            {"carry", {{grasp_.joint_limits}, {folded_}, {still_vehicle_}}}};
  }
  icat::ParallelController<Robot>::Options options() const {
    Vector13 most = icat::Filled{0.3};
    for (int i = 0; i < 7; ++i) most(i) = 0.8;
    // Roll and pitch are not actuated; a vehicle that is held by hand not at all.
    const auto given = switches_.vehicle ? icat::ColumnRange{10, 2} : robot_.base_columns();
    return {.given = given, .solver = {.bounds = {-most, most}}};
  }
  std::vector<icat::FrameBox<double>> boxes() const {
    return {{robot_.frame("link5"), Vector3(-0.12, -0.12, -0.14), Vector3(0.12, 0.12, 0.40)},
            {robot_.frame("link7"), Vector3(-0.12, -0.12, -0.14), Vector3(0.12, 0.12, 0.30)}};
  }
  // What a drive feels when all else is free, 1/(M⁻¹)ᵢᵢ.
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
  Vector3 rounded(Vector3 gyro) const {
    const double step = switches_.errors.gyro_step;
    for (int i = 0; i < 3 && step > 0; ++i) gyro(i) = step * std::round(gyro(i) / step);
    return gyro;
  }
  void keep(Status status) {
    if (bad_ == Status::ok) bad_ = status;
  }

  // --- what is known -----------------------------------------------------------------------------
  void sense(long k) {
    const icat::VehicleMotion<double> truth{plant_.vehicle(), plant_.vehicle_velocity()};
    const auto inertial = ahrs_.measure(time_, truth);
    if (inertial) gyro_ = rounded(inertial->value.gyro);
    (void)navigation_.step(time_, gyro_, pushed_);
    if (inertial) {
      (void)navigation_.correct_attitude(inertial->value.attitude, time_ - inertial->time);
    }
    const auto ground = dvl_.measure(time_, truth);
    if (ground && switches_.dvl) {
      (void)navigation_.correct_dvl(ground->value, time_ - ground->time);
    }
    const auto depth = depth_.measure(time_, truth);
    if (depth) (void)navigation_.correct_depth(depth->value, time_ - depth->time);
    (void)filter_.update(navigation_.velocity(), k == 0 ? 0 : control_dt);
    const Pose vehicle = navigation_.pose();
    keep(robot_.update(plant_.q(), vehicle));
    (void)history_.record(time_, vehicle);
    (void)tracker_.predict(vehicle);
  }

  /// ⟨o⟩ of the vision, which has y along the pipe, x of its plant, and z down.
  Pose pipe() const {
    const Vector3 y = pool_.pipe().linear().col(0);
    Pose pose = pool_.pipe();
    const Vector3 z = (Vector3::UnitZ() - y.z() * y).normalized();
    pose.linear() << y.cross(z), y, z;
    return pose;
  }

  void look(long k) {
    if (k % 10 == 0) (void)arm_.update();
    const auto view = eyes_.observe(time_, plant_.vehicle(), pipe(), arm_.outline());
    if (!view) return;
    ++pictures_;
    Pose then;
    icat::CylinderMeasurement<double> seen;
    if (history_.at(view->time, then) == Status::ok &&
        estimator_.measure(view->value.lines(), icat::gravity_in_camera(then, mount_), seen) ==
            Status::ok) {
      ++seen_;
      (void)tracker_.update(seen, then);
    } else {
      tracker_.miss();
    }
    if (!tracker_.valid()) return;
    goal_ = navigation_.pose() * tracker_.grasp(at(0, 0, -palm_above));
    const Pose off = offset();
    // From above: nearer only as the fingers come to stand on both sides of the pipe.
    const double aside = std::abs(off.translation().x()) + 0.1 * angle(off);
    const double above = std::clamp(5 * (aside - 0.02), 0.0, 0.25);
    const Pose vehicle = navigation_.pose();
    (void)grasp_.see_grasp(tracker_.grasp(at(0, 0, -palm_above - above)), vehicle);
    (void)grasp_.see_object(tracker_.point_in_camera(Vector3(0, 0, 0)), vehicle);
  }

  /// The palm in the frame of its goal, as far as is known.
  Pose offset() const { return goal_.inverse() * robot_.pose(frames_.tool); }
  static double angle(const Pose& pose) { return icat::rotation_log<double>(pose.linear()).norm(); }
  bool at_grasp() const {
    const Pose off = offset();
    return off.translation().norm() < near_grasp && angle(off) < parallel;
  }
  bool at_posture() const {
    return (plant_.q() - joints(1.2, -2.2, 1.0)).cwiseAbs().maxCoeff() < 0.1;
  }

  // --- what is done ------------------------------------------------------------------------------
  void decide() {
    const std::string_view phase = mission_.phase();
    if (phase == "survey" && tracker_.valid()) (void)mission_.raise("object detected");
    if (phase == "approach" && !tracker_.valid()) (void)mission_.raise("object lost");
    if (phase == "close" && !closing_) {
      closing_ = true;
      keep(detector_.close(0.3, 0.5));
      const Pose off = (pipe() * at(0, 0, -palm_above)).inverse() * palm();
      result_.position = off.translation().norm();
      result_.angle = angle(off);
    }
    const Vector3 p = plant_.vehicle().translation();
    if (p.head<2>().norm() > 5 || p.z() > floor - 0.6 || p.z() < 0) {
      (void)mission_.raise("out of bounds");
    }
    (void)detector_.step(time_, pool_.hand().reading());
    (void)detector_.tell(mission_);
    if (phase == "survey") {  // round and round, half a metre wider each time
      const int leg = static_cast<int>(mission_.time_in_phase() / 8);
      constexpr double x[] = {0, 1, 1, -1, -1}, y[] = {0, 0, 1, 1, -1};
      const double wide = 0.4 * (1 + leg / 5);
      (void)waypoint_.set_goal(conditions_.waypoint * at(wide * x[leg % 5], wide * y[leg % 5], 0));
    }
    keep(mission_.step(time_));
    keep(mission_.drive(controller_, time_));
  }

  void control(long k) {
    Vector6 base = filter_.value();
    if (!switches_.compensation) {  // it is taken to do as it is told
      base =
          switches_.vehicle ? Vector6(controller_.command().tail<6>()) : Vector6(Vector6::Zero());
    }
    const bool driven = mission_.end() == icat::PhaseEnd::none;
    // TPIK 1 plans for a vehicle that does not roll or pitch: that comes and goes faster than the
    // vehicle can answer (12_velocity_feedback), and is left to the arm.
    Vector6 level = base;
    level.segment<2>(3).setZero();
    if (k % 5 == 0 && driven) keep(controller_.step_base(time_, level));
    if (!switches_.compensation && switches_.vehicle) base = controller_.command().tail<6>();
    if (driven) keep(controller_.step_joints(time_, base));
    reference_ = controller_.command().head<7>();
    if (k % 5 == 0) drives_.retune(icat::PiLoop<double, 7>::tuned(felt(), icat::Filled{100.0}));
    if (switches_.vehicle) {
      Vector3 current = Vector3::Zero();
      current.head<2>() = navigation_.current();
      keep(loop_.step(time_, {.reference = controller_.command().tail<6>(),
                              .velocity = filter_.value(),
                              .attitude = navigation_.pose().linear(),
                              .current = current}));
      keep(allocation_.allocate(loop_.wrench()));
      pushed_ = allocation_.achieved();
      keep(loop_.achieved(pushed_));
    }
    if (mission_.phase() != "approach") return;
    const Vector3 off = (plant_.vehicle_velocity() - controller_.command().tail<6>()).head<3>();
    lag_ += off.squaredNorm();
    shake_ += reference_.squaredNorm();
    ++approaching_;
  }

  Pose palm() const { return plant_.vehicle() * plant_.dynamics().hand(palm_mount()).pose; }

  // Disturbing forces on the vehicle, on ⟨v⟩: the umbilical and, in October, the diver.
  Vector6 pull() {
    const double k = plant_dt / sway_time;
    for (int i = 0; i < 3; ++i) {
      sway_(i) += -k * sway_(i) + std::sqrt(2 * k) * random_.normal();
    }
    const Pose& vehicle = plant_.vehicle();
    Vector3 force = conditions_.tether + 0.5 * umbilical * sway_;
    force.z() = conditions_.tether.z() + 0.5 * trim * sway_.z();
    Vector6 wrench = Vector6::Zero();
    if (!switches_.vehicle) {
      const Vector3 held = conditions_.placed.translation() + diver * sway_;
      const Vector6 v = plant_.vehicle_velocity();
      force += 400 * (held - vehicle.translation()) - 400 * (vehicle.linear() * v.head<3>());
      force.z() -= weight();
      const Vector3 turn =
          icat::rotation_log<double>(vehicle.linear().transpose() * conditions_.placed.linear());
      wrench.tail<3>() = 100 * turn - 100 * v.tail<3>();
    }
    wrench.head<3>() = vehicle.linear().transpose() * force;
    return wrench;
  }

  void move() {
    Vector13 force = icat::Filled{0};
    force.tail<6>() = pull();
    for (std::size_t i = 0; i < 8; ++i) {
      const auto column = static_cast<icat::Index>(i);
      const double thrust = switches_.vehicle ? allocation_.thrust()(column) : 0;
      (void)thrusters_[i].update(thrust, plant_dt);
      for (int j = 0; j < 6; ++j) {
        force(7 + j) += thrusters_[i].thrust() * allocation_.wrenches()(j, column);
      }
    }
    (void)drives_.update(reference_, plant_.joint_velocity(), Joints(Joints::Zero()), plant_dt);
    force.head<7>() += drives_.output();
    // Far from the pipe nothing touches; the hand is open.
    if (closing_ || near_) {
      const auto hand = plant_.dynamics().hand(palm_mount());
      keep(pool_.step(detector_.command(), plant_.vehicle() * hand.pose, hand.twist, plant_dt));
      for (int i = 0; i < 13; ++i) {
        for (int j = 0; j < 6; ++j) force(i) += hand.jacobian(j, i) * pool_.wrench()(j);
      }
    }
    if (++moved_ % 25 == 0) {
      Vector3 p = pool_.pipe().inverse() * palm().translation();
      p.x() = std::max(std::abs(p.x()) - 0.5, 0.0);
      near_ = p.norm() < 0.4;
    }
    keep(plant_.step(force, plant_dt));
  }

  Result finish() {
    const auto share = [](double sum, long n) {
      return n > 0 ? std::sqrt(sum / static_cast<double>(n)) : 0;
    };
    result_.time = time_;
    result_.lag = share(lag_, approaching_);
    result_.shake = share(shake_, approaching_);
    result_.seen = pictures_ > 0 ? static_cast<double>(seen_) / static_cast<double>(pictures_) : 0;
    result_.outcome = std::string(mission_.phase());
    if (bad_ != Status::ok) result_.outcome = "fault";
    // The mission decides by the motors' currents; this checks the true pose of the pipe.
    if (mission_.end() == icat::PhaseEnd::success &&
        (pool_.on_floor() || pool_.hand().fingers_touching() < 2)) {
      result_.outcome = "not held";
    }
    return result_;
  }

  Switches switches_;
  Conditions conditions_;
  Pose mount_;
  Robot robot_;
  Plant plant_;
  icat::GraspFrames frames_;
  icat::MarisGrasp<Robot> grasp_;
  icat::task::FramePose<Robot> waypoint_;
  icat::task::JointPosition<Robot> folded_;
  icat::task::Minimality<Robot> still_arm_, still_vehicle_;
  icat::ParallelController<Robot> controller_;
  icat::Mission mission_;
  icat::VehicleLoop<double> loop_;
  icat::ThrusterAllocation<double, 8> allocation_;
  std::vector<icat::ThrusterModel<double>> thrusters_;
  icat::PiLoop<double, 7> drives_;
  icat::LowPass<double, 6> filter_;
  icat::Navigation<double> navigation_;
  icat::Ahrs<double> ahrs_;
  icat::Dvl<double> dvl_;
  icat::DepthSensor<double> depth_;
  icat::StereoCamera<double> cameras_;
  icat::ArmMask<Robot> arm_;
  icat::StereoPipe<double> eyes_;
  icat::CylinderPose<double> estimator_;
  icat::FrameTracker<double> tracker_;
  icat::PoseHistory<double> history_;
  icat::GraspPlant<double> pool_;
  icat::GraspDetector<double> detector_;
  icat::Noise random_;
  Pose goal_ = Pose::Identity();
  Vector3 gyro_ = Vector3::Zero(), sway_ = Vector3::Zero();
  Vector6 pushed_ = Vector6::Zero();
  Joints reference_ = Joints::Zero();
  double time_ = 0, lag_ = 0, shake_ = 0;
  long approaching_ = 0, pictures_ = 0, seen_ = 0, moved_ = 0;
  bool closing_ = false, near_ = false;
  Status bad_ = Status::ok;
  Result result_;
};

}  // namespace campaign
