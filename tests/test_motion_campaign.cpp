// SPDX-License-Identifier: BSD-3-Clause
// A controller on a loop with delay to which everything is done in random order: started, stopped,
// switched, joints given and not, input that is stale: its limits hold in every cycle.
#include <gtest/gtest.h>

#include <deque>
#include <icat/icat.hpp>
#include <random>

#include "support/sanitized.hpp"

namespace {

using icat::Status;
using Tree = icat::KinematicTree<double, 5>;
using Velocity = icat::Vector<double, 5>;

constexpr double period = 0.02;

/// Two slides on a platform that moves in the plane.
struct Robot {
  explicit Robot(double acceleration)
      : tree(Tree::Description{
            .joints = {slide("a", "platform", acceleration), slide("b", "a", acceleration)},
            .base = icat::Base<double>::surface()}) {}
  static icat::Joint<double> slide(const char* name, const char* parent, double acceleration) {
    return {.name = name,
            .parent = parent,
            .link = name,
            .type = icat::JointType::prismatic,
            .lower = -0.5,
            .upper = 0.7,
            .max_velocity = 1,
            .max_acceleration = acceleration};
  }
  Tree tree;
};

/// Surge, sway, yaw.
icat::Vector6<double> robot_twist(const Velocity& y) {
  icat::Vector6<double> twist = icat::Vector6<double>::Zero();
  twist(0) = y(2);
  twist(1) = y(3);
  twist(5) = y(4);
  return twist;
}

std::string fault_of_run(unsigned seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  const auto chance = [&](double p) { return uniform(0, 1) < p; };
  const double acceleration = chance(0.7) ? uniform(0.3, 5) : icat::infinity<double>;
  Robot r(acceleration);
  Tree& robot = r.tree;
  icat::task::JointPosition<Tree> posture(robot, Eigen::Vector2d(2, -1), {.gain = 4});
  icat::task::FramePosition<Tree> reach(robot, robot.frame("b"), icat::Vector3<double>(2, 1, 0.5),
                                        {.gain = 3});
  icat::task::Minimality<Tree> rest(robot, robot.base_columns());
  const std::size_t delay = static_cast<std::size_t>(uniform(0, 5));
  const icat::MotionLimits<Tree> limits(robot,
                                        {.reaction_time = period * static_cast<double>(delay + 1),
                                         .base_velocity = {0.5, 0.5, 0.5},
                                         .base_acceleration = {0.4, 0.4, 1}});
  icat::Controller<Tree> controller(robot, {{"reach", {{reach}, {posture}}}, {"rest", {{rest}}}},
                                    {.limits = limits});
  std::deque<Eigen::Vector2d> arriving(delay + 1, Eigen::Vector2d::Zero());
  Eigen::Vector2d q = Eigen::Vector2d::Zero();
  icat::Pose<double> base = icat::Pose<double>::Identity();
  Velocity last = Velocity::Zero();
  bool given = false, was_given = false;
  for (int k = 0; k < 200; ++k) {
    const double t = period * k;
    if (k == 0 || chance(0.02)) (void)controller.start(chance(0.8) ? "reach" : "rest", t);
    if (chance(0.03))
      (void)controller.switch_to(chance(0.5) ? "reach" : "rest", t, uniform(0.1, 1));
    if (chance(0.02)) (void)controller.stop(t, uniform(0.05, 1));
    if (chance(0.02)) (void)controller.set_given("a", given = !given);
    if (chance(0.1)) {
      (void)reach.set_goal(icat::Vector3<double>(uniform(-2, 2), uniform(-2, 2), uniform(-1, 2)));
    }
    if (robot.update(arriving.front(), base) != Status::ok) return "update";
    Velocity measured = Velocity::Zero();
    if (chance(0.05)) measured(0) = NAN;
    (void)controller.step(t, measured, {.state = chance(0.1) ? 0.5 : 0.0});
    const Velocity command = controller.command();
    const auto text = [&](const char* what, int c, double by) {
      return std::string(what) + " of column " + std::to_string(c) + " by " + std::to_string(by) +
             " in cycle " + std::to_string(k);
    };
    if (!command.allFinite() || !controller.velocity().allFinite()) return text("infinite", 0, 0);
    for (int c = 0; c < 5; ++c) {
      const double a = c < 2 ? acceleration : c < 4 ? 0.4 : 1, v = c < 2 ? 1 : 0.5;
      // A column that is given is not commanded: it stops at once, and starts from rest.
      const bool free = c > 0 || (!given && !was_given);
      if (std::abs(command(c)) > v) return text("velocity", c, command(c));
      const double change = std::abs(command(c) - last(c)) - a * period;
      if (free && change > 1e-9) return text("acceleration", c, change);
      if (given && command(0) != 0) return text("given", 0, command(0));
    }
    was_given = given;
    last = command;
    q += period * command.head<2>();
    base = icat::integrate<double>(base, robot_twist(command), period);
    arriving.push_back(q);
    arriving.pop_front();
    for (int c = 0; c < 2; ++c) {
      const double over = std::max(q(c) - 0.7, -0.5 - q(c));
      if (over > 1e-9 && !(c == 0 && given)) return text("position", c, over);
    }
  }
  return "";
}

TEST(MotionCampaign, LimitsHoldWhateverIsDoneToAController) {
  unsigned faults = 0;
  for (unsigned seed = 0; seed < (sanitized ? 100 : 3000) && faults < 5; ++seed) {
    const std::string fault = fault_of_run(seed);
    if (fault.empty()) continue;
    ++faults;
    ADD_FAILURE() << "seed " << seed << ": " << fault;
  }
}

}  // namespace
