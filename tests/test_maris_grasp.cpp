// SPDX-License-Identifier: BSD-3-Clause
// The seven-level grasp of MARIS, in the mission of MARIS.
#include <gtest/gtest.h>

#include <icat/action/maris_grasp.hpp>
#include <icat/control/controller.hpp>
#include <icat/mission/maris_mission.hpp>
#include <icat/model/maris.hpp>
#include <icat/model/uvms.hpp>
#include <icat/sim/kinematic_plant.hpp>
#include <icat/task/column_tasks.hpp>

#include "support/allocation_counter.hpp"
#include "support/sanitized.hpp"

namespace {

using Robot = icat::KinematicTree<double, 13>;
using Pose = icat::Pose<double>;
using Vector3 = icat::Vector3<double>;
using Vector13 = icat::Vector<double, 13>;
using Objective = icat::Objective<double>;
using icat::Status;
namespace task = icat::task;

Pose at(double x, double y, double z, double pitch = 0, double yaw = 0) {
  const icat::Matrix3<double> turn = icat::axis_rotation<double>(Vector3(0, 0, 1), yaw) *
                                     icat::axis_rotation<double>(Vector3(0, 1, 0), pitch);
  return icat::detail::make_pose(turn, Vector3(x, y, z));
}

Robot make_robot() {
  return icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>(),
                                                .camera = at(0.45, 0, 0.35),  // looks down
                                                .tool = at(0, 0, 0.1)});
}

Eigen::VectorXd folded() {
  Eigen::VectorXd q(7);
  q << 0, 0.7, 0, -1.8, 0, 1.1, 0;
  return q;
}

/// A robot, its grasp, and the actions of the mission.
struct Diver {
  Diver()
      : robot(make_robot()),
        grasp(robot, {robot.frame("tool"), robot.frame(icat::maris_elbow), robot.frame("camera")},
              folded()),
        waypoint(
            robot, robot.base(), at(0, 0, 1),
            {.name = "waypoint", .gain = 0.5, .max_linear_rate = 0.2, .max_angular_rate = 0.2}),
        still_arm(robot, icat::joint_columns(robot)) {}

  std::vector<icat::Action<Robot>> actions() {
    return {{"survey", {{grasp.joint_limits}, {waypoint}, {still_arm}}},
            grasp.action(),
            {"carry", {{grasp.joint_limits}, {grasp.shape}}}};
  }

  Robot robot;
  icat::MarisGrasp<Robot> grasp;
  task::FramePose<Robot> waypoint;
  task::Minimality<Robot> still_arm;
};

TEST(MarisGrasp, SevenLevelsInTheOrderOfThePaper) {
  Diver diver;
  const std::vector<std::string> order{"joint limits",     "manipulability", "elbow occlusion",
                                       "camera centering", "tool position",  "tool orientation",
                                       "preferred shape"};
  // Alone, and among the others of the mission.
  const icat::Controller alone(diver.robot, {diver.grasp.action()});
  ASSERT_EQ(alone.hierarchy().size(), order.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    ASSERT_EQ(alone.hierarchy()[k].size(), 1u);
    EXPECT_EQ(alone.hierarchy()[k][0].task->name(), order[k]);
  }
  const icat::Controller all(diver.robot, diver.actions());
  std::size_t next = 0;
  for (const auto& level : all.hierarchy()) {
    for (const auto& entry : level) {
      if (next < order.size() && entry.task->name() == order[next]) ++next;
    }
  }
  EXPECT_EQ(next, order.size());
}

// Goals are seen from the vehicle and stay in the world while it moves on.
TEST(MarisGrasp, GoalsStayInTheWorldBetweenPictures) {
  Diver diver;
  const Pose vehicle = at(1, -2, 0.5, 0.1, 0.7), later = at(1.3, -2.2, 0.6, -0.1, 0.9);
  const Pose seen = at(0.8, 0.2, 1.5, 0.3, -0.4);
  const Vector3 object(0.1, -0.2, 1.4);       // on the camera
  for (const Pose& now : {vehicle, later}) {  // the picture arrives at once, or late
    ASSERT_EQ(diver.robot.update(folded(), now), Status::ok);
    ASSERT_EQ(diver.grasp.see_grasp(seen, vehicle), Status::ok);
    ASSERT_EQ(diver.grasp.see_object(object, vehicle), Status::ok);
    EXPECT_LT((diver.grasp.position.goal() - vehicle * seen.translation()).norm(), 1e-12);
    EXPECT_LT((diver.grasp.orientation.goal() - vehicle.linear() * seen.linear()).norm(), 1e-12);
    // The angle of the object is that of a vehicle where the picture was taken.
    ASSERT_EQ(diver.robot.update(folded(), vehicle), Status::ok);
    diver.grasp.centering.update();
    EXPECT_NEAR(diver.grasp.centering.angle(), std::atan2(object.head<2>().norm(), object.z()),
                1e-12);
  }
  // Refused: what is no picture; the goal stays.
  const Vector3 before = diver.grasp.position.goal();
  Pose bad = seen;
  bad.translation().x() = NAN;
  EXPECT_EQ(diver.grasp.see_grasp(bad, vehicle), Status::non_finite);
  EXPECT_EQ(diver.grasp.see_grasp(seen, bad), Status::non_finite);
  EXPECT_EQ(diver.grasp.see_object(Vector3(0, INFINITY, 1), vehicle), Status::non_finite);
  EXPECT_EQ(diver.grasp.see_object(object, bad), Status::non_finite);
  bad = seen;
  bad.matrix()(0, 0) += 0.1;
  EXPECT_EQ(diver.grasp.see_grasp(bad, vehicle), Status::not_a_rotation);
  EXPECT_EQ(diver.grasp.see_grasp(seen, bad), Status::not_a_rotation);
  EXPECT_EQ(diver.grasp.see_object(object, bad), Status::not_a_rotation);
  EXPECT_EQ(diver.grasp.position.goal(), before);
}

// What `see_object` makes of a picture takes the camera to be fixed to the vehicle.
TEST(MarisGrasp, RefusesACameraOnTheArm) {
  const Robot robot = make_robot();
  const icat::FrameId tool = robot.frame("tool"), elbow = robot.frame(icat::maris_elbow);
  EXPECT_THROW((icat::MarisGrasp<Robot>(robot, {tool, elbow, tool}, folded())),
               std::invalid_argument);
}

TEST(MarisGrasp, OfFloats) {
  using FloatRobot = icat::KinematicTree<float, 13>;
  FloatRobot robot = icat::uvms(icat::maris_arm<float>(), {.arm = icat::maris_arm_mount<float>()});
  const Eigen::VectorXf q = folded().cast<float>();
  const icat::Pose<float> vehicle = at(1, -2, 0.5, 0.1, 0.7).cast<float>();
  ASSERT_EQ(robot.update(q, vehicle), Status::ok);
  icat::MarisGrasp<FloatRobot> grasp(
      robot, {robot.frame("tool"), robot.frame(icat::maris_elbow), robot.frame("camera")}, q);
  EXPECT_LT((grasp.position.goal() - robot.pose(robot.frame("tool")).translation()).norm(), 1e-6f);
  const icat::Pose<float> seen = at(0.8, 0.2, 1.5, 0.3, -0.4).cast<float>();
  ASSERT_EQ(grasp.see_grasp(seen, vehicle), Status::ok);
  EXPECT_LT((grasp.position.goal() - vehicle * seen.translation()).norm(), 1e-6f);
  for (const auto& level : grasp.action().levels) {
    level[0].get().update();
    EXPECT_TRUE(level[0].get().jacobian().allFinite());
  }
}

TEST(MarisGrasp, DoesNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  Diver diver;
  icat::Controller<Robot> controller(diver.robot, diver.actions());
  bool met = false;
  icat::Mission mission =
      icat::maris_mission({.at_grasp = [&] { return met; }, .at_posture = [&] { return met; }});
  const Eigen::VectorXd q = folded();
  const Pose vehicle = at(1, -2, 0.5, 0.1, 0.7), seen = at(0.8, 0.2, 1.5, 0.3, -0.4);
  Status status = Status::ok;
  const long count = count_allocations([&] {
    for (int k = 0; k < 300 && status == Status::ok; ++k) {
      const double t = 0.01 * k;
      status = diver.robot.update(q, vehicle);
      if (status == Status::ok) status = diver.grasp.see_grasp(seen, vehicle);
      if (status == Status::ok) status = diver.grasp.see_object({0.1, 0, 1}, vehicle);
      if (k == 20) status = mission.raise("object detected");
      if (k == 150) status = mission.raise("grasp closed");
      met = k > 50;
      if (status == Status::ok) status = mission.step(t);
      if (status == Status::ok) status = mission.drive(controller, t);
      if (status == Status::ok) status = controller.step(t);
    }
  });
  EXPECT_EQ(count, 0);
  EXPECT_EQ(status, Status::ok);
  EXPECT_EQ(mission.phase(), "done");
}

/// The arm alone, of a vehicle that is held, to a goal whose position it reaches, but not pointing
/// back at the shoulder; the levels of `action`. Errors after a minute, m and rad.
std::pair<double, double> reach(bool position_first) {
  Diver diver;
  icat::Action<Robot> action = diver.grasp.action();
  if (!position_first) std::swap(action.levels[4], action.levels[5]);
  icat::Controller<Robot> controller(diver.robot, {action}, {.given = diver.robot.base_columns()});
  icat::KinematicPlant<Robot> plant(diver.robot,
                                    {.q = folded(), .not_actuated = diver.robot.base_columns()});
  EXPECT_EQ(diver.robot.update(plant.q(), plant.base()), Status::ok);
  // 0.8 m from the shoulder. Pointing across or back, the hand would need a longer arm.
  const Pose goal = at(0.167 - 0.48, 0, 0.713 + 0.64, 2.0);
  EXPECT_EQ(diver.grasp.see_grasp(goal, plant.base()), Status::ok);
  EXPECT_EQ(diver.grasp.see_object(Vector3(0, 0, 1), plant.base()), Status::ok);
  EXPECT_EQ(controller.switch_to("grasp", 0, 2), Status::ok);
  for (int k = 0; k < 6000; ++k) {
    EXPECT_EQ(diver.robot.update(plant.q(), plant.base()), Status::ok);
    EXPECT_EQ(controller.step(0.01 * k, plant.velocity()), Status::ok);
    plant.step(controller.command(), 0.01 * k, 0.01);
  }
  return {diver.grasp.position.position_error(), diver.grasp.orientation.orientation_error()};
}

TEST(MarisGrasp, PositionWinsOverOrientation) {
  const auto [position, orientation] = reach(true);
  const auto [other_position, other_orientation] = reach(false);
  EXPECT_LT(position, 1e-6);
  EXPECT_NEAR(orientation, 1.5, 0.1);
  // In the other order it is the other way round.
  EXPECT_LT(other_orientation, 1e-6);
  EXPECT_NEAR(other_position, 0.66, 0.01);
}

// --- the whole mission, scripted -----------------------------------------------------------------

struct Outcome {
  std::vector<std::string> phases;
  std::vector<double> activations = std::vector<double>(7);  ///< largest of each level of the grasp
  double largest_step = 0;                                   ///< of the command in a cycle
  double position_error = 0, orientation_error = 0;          ///< when the hand closes, m, rad
  double last_command = 0;                                   ///< norm
  double end = 0;                                            ///< s
  icat::PhaseEnd how = icat::PhaseEnd::none;
};

/// What is raised, so many seconds after a phase was entered.
struct Word {
  const char* phase;
  double after;
  const char* event;
};

Outcome run(double dt, const std::vector<Word>& script) {
  Diver diver;
  Robot& robot = diver.robot;
  const icat::MarisGrasp<Robot>& grasp = diver.grasp;
  // A pipe on the seabed; the hand comes from above, across it.
  const Pose pipe = at(1.5, 0.8, 3, 0, 0.5), down = at(1.5, 0.8, 3, 0, 0.5 + std::numbers::pi + 2);
  const Vector3 end_of_pipe = pipe * Vector3(0, 0.35, 0);

  //! [mission]
  const auto at_grasp = [&] {  // 2 cm and 5 degrees
    return grasp.position.position_error() < 0.02 && grasp.orientation.orientation_error() < 0.087;
  };
  const auto at_posture = [&] { return (robot.q() - folded()).cwiseAbs().maxCoeff() < 0.05; };
  icat::Mission mission = icat::maris_mission({.at_grasp = at_grasp, .at_posture = at_posture});
  //! [mission]
  Vector13 bounds;
  bounds << icat::Vector<double, 7>::Constant(1), 0.5, 0.5, 0.5, 0.8, 0.8, 0.8;
  // Roll and pitch are not actuated, as in the trials.
  icat::Controller<Robot> controller(
      robot, diver.actions(),
      {.given = icat::ColumnRange{10, 2}, .solver = {.bounds = {-bounds, bounds}}});
  mission.check_actions(controller);
  // The elbow in view, the arm near a singular shape, the hand turned nearly to its limit.
  Eigen::VectorXd q(7);
  q << 0, 0.45, 0, -1.6, 0, 0.5, 2.68;
  icat::KinematicPlant<Robot> plant(
      robot, {.q = q, .base = at(-2, -1, 0.8), .not_actuated = icat::ColumnRange{10, 2}});
  Outcome result;
  EXPECT_EQ(robot.update(plant.q(), plant.base()), Status::ok);
  EXPECT_EQ(diver.waypoint.set_goal(pipe * at(-0.9, 0, -1.6)), Status::ok);

  Vector13 last = Vector13::Zero();
  const int picture = static_cast<int>(std::lround(0.1 / dt));
  std::size_t said = 0;
  for (int k = 0; k * dt < 200 && result.end == 0; ++k) {
    const double t = k * dt;
    EXPECT_EQ(robot.update(plant.q(), plant.base()), Status::ok);
    if (k % picture == 0) {  // at 10 Hz, in the frames of the camera and the vehicle
      const Pose vehicle = plant.base(), camera = robot.pose(robot.frame("camera"));
      const Pose grasp_in_vehicle = vehicle.inverse() * down;
      const Vector3 end_in_camera = camera.inverse() * end_of_pipe;
      //! [picture]
      Status seen = diver.grasp.see_grasp(grasp_in_vehicle, vehicle);  // at the time of the image
      if (seen == Status::ok) seen = diver.grasp.see_object(end_in_camera, vehicle);
      //! [picture]
      EXPECT_EQ(seen, Status::ok);
    }
    if (said < script.size() && mission.phase() == script[said].phase &&
        mission.time_in_phase() > script[said].after) {
      EXPECT_EQ(mission.raise(script[said++].event), Status::ok);
    }
    //! [cycle]
    Status status = mission.step(t);
    if (status == Status::ok) status = mission.drive(controller, t);
    const Status control = controller.step(t, plant.velocity());  // also after an error
    //! [cycle]
    EXPECT_EQ(status, Status::ok);
    EXPECT_EQ(control, Status::ok);
    if (mission.entered()) {
      result.phases.emplace_back(mission.phase());
      if (mission.phase() == "close") {
        result.position_error = grasp.position.position_error();
        result.orientation_error = grasp.orientation.orientation_error();
      }
    }
    plant.step(controller.command(), t, dt);
    result.largest_step = std::max(result.largest_step, (controller.command() - last).norm());
    last = controller.command();
    std::size_t entry = 0;
    for (const auto& level : controller.hierarchy()) {
      for (const auto& e : level) {
        const double phase = controller.phase_activations()[entry++];
        const icat::Task<Robot>* const tasks[] = {
            &grasp.joint_limits, &grasp.manipulability, &grasp.occlusion, &grasp.centering,
            &grasp.position,     &grasp.orientation,    &grasp.shape};
        for (std::size_t i = 0; mission.action() == "grasp" && i < 7; ++i) {
          if (e.task != tasks[i]) continue;
          result.activations[i] =
              std::max(result.activations[i], phase * e.task->activation().maxCoeff());
        }
      }
    }
    result.last_command = last.norm();
    // Three seconds more, for what fades.
    if (mission.end() != icat::PhaseEnd::none && mission.time_in_phase() > 3) result.end = t;
  }
  result.how = mission.end();
  return result;
}

using Names = std::vector<std::string>;

TEST(MarisGrasp, EachOfTheSevenLevelsHasSomethingToDoInTheMission) {
  const Outcome r = run(0.01, {{"survey", 12, "object detected"}, {"close", 2, "grasp closed"}});
  EXPECT_EQ(r.phases, (Names{"survey", "approach", "close", "carry", "done"}));
  EXPECT_EQ(r.how, icat::PhaseEnd::success);
  EXPECT_LT(r.position_error, 0.02);
  EXPECT_LT(r.orientation_error, 5 * std::numbers::pi / 180);
  for (std::size_t i = 0; i < 7; ++i) EXPECT_GT(r.activations[i], 0.01) << "level " << i + 1;
}

// A jump would not shrink with the period; a steep but continuous change does.
TEST(MarisGrasp, TheCommandIsContinuousThroughEverySwitch) {
  if (sanitized) GTEST_SKIP();
  const std::vector<std::pair<std::vector<Word>, Names>> scripts{
      {{{"survey", 12, "object detected"},
        {"approach", 4, "object lost"},
        {"survey", 1, "object detected"},  // while the one before still fades
        {"close", 0.5, "grasp closed"}},
       {"survey", "approach", "survey", "approach", "close", "carry", "done"}},
      {{{"survey", 12, "object detected"}, {"close", 0.5, "grasp empty"}},
       {"survey", "approach", "close", "empty grasp"}},
      {{{"survey", 12, "object detected"}, {"approach", 1, "fault"}},
       {"survey", "approach", "fault"}},
      {{{"survey", 5, "out of bounds"}}, {"survey", "bounds"}}};
  for (const auto& [script, phases] : scripts) {
    const Outcome coarse = run(0.01, script), fine = run(0.005, script);
    EXPECT_EQ(coarse.phases, phases);
    EXPECT_EQ(fine.phases, phases);
    EXPECT_LT(coarse.largest_step, 0.05);  // 5 m/s², rad/s² in norm
    EXPECT_LT(fine.largest_step, 0.65 * coarse.largest_step);
    EXPECT_EQ(coarse.last_command == 0, coarse.how == icat::PhaseEnd::failure);
  }
}

// --- one after the other -------------------------------------------------------------------------

/// The tool to a goal some metres away; seconds until it is there, to 1 cm and 1 degree. With
/// `sequential` the vehicle comes near, then the arm reaches.
double fetch(bool sequential) {
  Diver diver;
  Robot& robot = diver.robot;
  const Pose goal = at(1.5, 0.8, 3, 0, std::numbers::pi), hover = at(1.2, 0.6, 1.4);
  EXPECT_EQ(diver.waypoint.set_goal(hover), Status::ok);
  task::FramePose<Robot> tool(
      robot, robot.frame("tool"), goal,
      {.name = "tool", .gain = 0.5, .max_linear_rate = 0.2, .max_angular_rate = 0.2});
  task::Minimality<Robot> still_vehicle(robot, robot.base_columns(), "still vehicle");
  task::JointLimits<Robot>& limits = diver.grasp.joint_limits;
  icat::Controller<Robot> controller(robot,
                                     {{"drive", {{diver.still_arm}, {limits}, {diver.waypoint}}},
                                      {"reach", {{still_vehicle}, {limits}, {tool}}},
                                      {"both", {{limits}, {tool}}}});
  // What others have: a controller of the vehicle that knows no arm, one of an arm on a rock.
  icat::Controller<Robot> vehicle(robot, {{"drive", {{diver.waypoint}}}},
                                  {.given = icat::joint_columns(robot)}),
      arm(robot, {{"reach", {{limits}, {tool}}}}, {.given = robot.base_columns()});
  EXPECT_EQ(vehicle.start("drive", 0), Status::ok);
  EXPECT_EQ(arm.start("reach", 0), Status::ok);

  icat::KinematicPlant<Robot> plant(robot, {.q = folded(), .base = at(-2, -1, 0.8)});
  const auto near = [](double position, double orientation) {
    return position < 0.01 && orientation < std::numbers::pi / 180;
  };
  const auto fetched = [&] { return near(tool.position_error(), tool.orientation_error()); };
  std::vector<icat::Phase> phases;
  if (sequential) {
    phases.push_back({.name = "drive",
                      .action = "drive",
                      .until =
                          [&] {
                            return near(diver.waypoint.position_error(),
                                        diver.waypoint.orientation_error());
                          },
                      .then = "reach"});
  }
  phases.push_back({.name = "reach",
                    .action = sequential ? "reach" : "both",
                    .until = fetched,
                    .then = "fetched"});
  phases.push_back({.name = "fetched", .end = icat::PhaseEnd::success});
  icat::Mission mission(phases);
  const Vector13 rest = Vector13::Zero();
  for (int k = 0; k < 10000; ++k) {
    const double t = 0.01 * k;
    EXPECT_EQ(robot.update(plant.q(), plant.base()), Status::ok);
    diver.waypoint.update();
    tool.update();
    EXPECT_EQ(mission.step(t), Status::ok);
    if (mission.end() == icat::PhaseEnd::success) return t;
    EXPECT_EQ(mission.drive(controller, t), Status::ok);
    EXPECT_EQ(controller.step(t), Status::ok);
    if (sequential && !controller.in_transition()) {
      const bool drives = mission.phase() == "drive";
      icat::Controller<Robot>& alone = drives ? vehicle : arm;
      EXPECT_EQ(alone.step(t, rest), Status::ok);
      EXPECT_LT((controller.answer() - alone.answer()).norm(), 1e-9) << t;
      EXPECT_LT(
          drives ? controller.answer().head<7>().norm() : controller.answer().tail<6>().norm(),
          1e-12);
    }
    plant.step(controller.command(), t, 0.01);
  }
  ADD_FAILURE();
  return 100;
}

// [MARIS] against controllers that move the vehicle first and the arm then: that is a special case,
// with minimality on top, and takes longer.
TEST(MarisGrasp, VehicleThenArmIsASpecialCaseAndSlower) {
  const double sequential = fetch(true), coordinated = fetch(false);
  std::printf("vehicle, then arm: %.2f s; together: %.2f s\n", sequential, coordinated);
  EXPECT_LT(coordinated, sequential);
}

}  // namespace
