// SPDX-License-Identifier: BSD-3-Clause
// A six-axis arm carries a tool from one side of a post to the other, over a table and under a ball
// that swings across its path. It avoids collisions with all three, and between its own links.
#include <cstdio>
#include <icat/icat.hpp>
#include <numbers>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/geometry.hpp"
#include "../support/robot_replay.hpp"
#include "../support/support.hpp"

using Vector3 = icat::Vector3<double>;
using Objective = icat::Objective<double>;
using Obstacle = icat::Obstacle<double>;
using Body = icat::CollisionBody<double>;
constexpr double pi = std::numbers::pi;

icat::KinematicTree<double, 6> make_robot() {
  auto joints = icat::dh_chain<double>({{0, pi / 2, 0.3, 0},
                                        {-0.425, 0, 0, 0},
                                        {-0.392, 0, 0, 0},
                                        {0, pi / 2, 0.109, 0},
                                        {0, -pi / 2, 0.095, 0},
                                        {0, 0, 0.082, 0}},
                                       icat::DhConvention::standard);
  for (auto& joint : joints) joint.lower = -2 * pi, joint.upper = 2 * pi;
  return icat::KinematicTree<double, 6>({.joints = joints});
}

int main(int argc, char** argv) {
  const auto arguments =
      support::parse(argc, argv, "An arm avoids obstacles and self-collision.", "out/09_obstacles");
  auto robot = make_robot();
  const icat::FrameId tool = robot.frame("link6");
  icat::Vector<double, 6> q;
  q << -2.3, -1.1, 1.6, -2.0, -1.57, 0;
  if (robot.update(q) != icat::Status::ok) return 1;

  //! [tasks]
  const Vector3 origin(0, 0, 0);
  const std::vector<Body> bodies{
      Body::capsule(robot.frame("link2"), origin, {0.425, 0, 0}, 0.06),       // upper arm
      Body::capsule(robot.frame("link3"), origin, {0.392, 0, 0}, 0.05),       // forearm
      Body::capsule(robot.frame("link6"), {0, 0, -0.08}, {0, 0, 0.02}, 0.05)  // wrist and tool
  };
  const std::vector<Obstacle> obstacles{
      Obstacle::plane(origin, {0, 0, 1}),                                          // table
      Obstacle::box(support::pose({0.6, 0, 0.25}, 0, 0, 0.4), {0.16, 0.16, 0.5}),  // post
      Obstacle::sphere({0.3, -0.4, 0.9}, 0.1)};                                    // ball
  icat::task::Clearance clearance(robot, bodies, obstacles, Objective::at_least(0.02, 0.06),
                                  {.gain = 4});
  const std::vector<Body> parts{bodies[1], bodies[2],
                                Body::capsule(robot.frame("base"), origin, {0, 0, 0.3}, 0.08)};
  icat::task::SelfClearance self(robot, parts, {{0, 2}, {1, 2}}, Objective::at_least(0.02, 0.06),
                                 {.gain = 4});
  icat::task::JointLimits limits(robot);
  icat::task::FramePosition carry(robot, tool, robot.pose(tool).translation(),
                                  {.gain = 2, .max_rate = 0.3});
  icat::task::Attitude down(robot, tool, {.name = "tool down", .world_axis = {0, 0, -1}});
  icat::Controller controller(robot, {{"carry", {{limits}, {clearance, self}, {carry}, {down}}}},
                              {.solver = {.regularization = {.lambda = 0.01, .threshold = 0.05}}});
  //! [tasks]

  support::Replay replay("An arm avoids obstacles and self-collision");
  support::RobotReplay view(replay, controller, {.frames = {"link6"}, .samples = 9000});
  const auto swinging = view.log().add("ball", "m", icat::LogKind::point);
  view.run().shapes.push_back({.form = icat::ReplayForm::box,
                               .at = support::pose({0.6, 0, 0.25}, 0, 0, 0.4),
                               .size = {0.16, 0.16, 0.5},
                               .color = "#7d8b99"});
  view.run().shapes.push_back(
      {.form = icat::ReplayForm::sphere, .frame = "ball", .color = "#d1495b"});
  support::Csv csv(arguments.output, "run.csv",
                   "t,x,y,z,goal_x,goal_y,clearance,self,error,ball_y");
  const double dt = 0.005;
  double nearest = 1, own = 1, worst_step = 0, error = 1;
  icat::Vector<double, 6> last = icat::Vector<double, 6>::Zero();
  clearance.update(), self.update();  // what `smallest` says before the first cycle
  icat::Status status = controller.switch_to("carry", 0, 0.5);
  for (double t = 0; t < 44 && status == icat::Status::ok; t += dt) {
    // From one side to the other in 4 s, every 10 s.
    const double phase = std::fmod(t + 5, 20);
    const double side =
        -1 + 2 * icat::smooth_step(phase / 4) - 2 * icat::smooth_step((phase - 10) / 4);
    const Vector3 goal(0.5, 0.35 * side, 0.25), ball(0.35, 0.25 * std::sin(t), 0.85);
    const icat::Vector6<double> swing{0, 0.25 * std::cos(t), 0, 0, 0, 0};
    status = clearance.set_obstacle(2, Obstacle::sphere(ball, 0.1), swing);
    if (status == icat::Status::ok) status = carry.set_goal(goal);
    if (status == icat::Status::ok) status = controller.step(t);
    q += dt * controller.velocity();
    if (status == icat::Status::ok) status = robot.update(q);

    view.record(t, goal);
    view.log().set(swinging, ball.x(), ball.y(), ball.z());
    const Vector3 at = robot.pose(tool).translation();
    nearest = std::min(nearest, clearance.smallest()), own = std::min(own, self.smallest());
    worst_step = std::max(worst_step, (controller.velocity() - last).norm());
    last = controller.velocity();
    error = (goal - at).norm();
    csv.row({t, at.x(), at.y(), at.z(), goal.x(), goal.y(), clearance.smallest(), self.smallest(),
             error, ball.y()});
  }
  std::printf(
      "%s: never nearer than %.0f mm to an obstacle, %.0f mm to itself; at the goal to %.1e mm;\n"
      "the largest change of a command in %.0f ms is %.3f rad/s\n",
      icat::describe(status), 1e3 * nearest, 1e3 * own, 1e3 * error, 1e3 * dt, worst_step);
  if (arguments.pictures) support::draw(arguments.output);
  replay.write(arguments.output, arguments.logs);
  const bool safe = status == icat::Status::ok && nearest > 0.015 && own > 0.015;
  return safe && error < 1e-3 && worst_step < 0.3 ? 0 : 1;
}
