// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Robots that hold one object: the papers' pair with a ceiling above one of them, and any robot
/// put where its frame is on the object.
#pragma once

#include <gtest/gtest.h>

#include <icat/cooperation/agent.hpp>
#include <icat/task/column_tasks.hpp>
#include <icat/task/function_task.hpp>
#include <icat/task/joint_tasks.hpp>
#include <memory>

#include "support/robots.hpp"

namespace testing_support {

using icat::Status;
using Uvms = Robot<double>;
using UvmsAgent = icat::Agent<Uvms>;
using Vector6 = icat::Vector6<double>;
using Vector13 = icat::Vector<double, 13>;
using Pose = icat::Pose<double>;

inline Vector6 twist(double x, double y, double z, double wx = 0, double wy = 0, double wz = 0) {
  Vector6 v;
  v << x, y, z, wx, wy, wz;
  return v;
}
/// Of the vehicle, among zeros.
inline Vector13 of_vehicle(const Vector6& v) {
  Vector13 all = Vector13::Zero();
  all.tail<6>() = v;
  return all;
}

/// What cannot be solved while it is told so.
class Faulty : public icat::Task<Uvms> {
 public:
  explicit Faulty(const Uvms& robot) : Task(robot, "faulty", 1) { activation_(0) = 0; }
  bool bad{false};

 private:
  void compute() noexcept override { reference_(0) = bad ? NAN : 0; }
};

inline Pose object() { return make_pose<double>(0.4, 0.1, 1.5, 0, 0, 0); }

/// Its tool is the object's frame, which has the world's orientation.
inline Uvms holding(double yaw) {
  Uvms robot = icat::uvms(icat::maris_arm<double>(), {.arm = icat::maris_arm_mount<double>()});
  EXPECT_EQ(robot.update(bent_arm(), make_pose<double>(0, 0, 0, 0, 0, yaw)), Status::ok);
  const icat::FrameId end = robot.frame("end_effector");
  EXPECT_EQ(robot.set_frame(robot.frame("tool"), end, robot.pose(end).inverse() * object()),
            Status::ok);
  return robot;
}

/// A robot that holds an object somewhere in front of it, with a task that keeps the tool from
/// rising: a lower bound on its depth, as a ceiling of rock would be.
struct Holder {
  Holder(double yaw, double shallowest, const Vector6& way)
      : robot(holding(yaw)),
        hand(robot.frame("tool")),
        ceiling(robot, icat::Objective<double>::at_least(shallowest, 0.1),
                [frame = hand](const Uvms& r, auto x, auto J) {
                  x(0) = r.pose(frame).translation().z();
                  J.row(0) = r.jacobian(frame).row(2);
                },
                {.name = "ceiling"}),
        tool(robot, hand, moved(object(), way(0), way(1), way(2)), {.name = "tool", .gain = 0.5}),
        faulty(robot),
        still_vehicle(robot, robot.base_columns()) {}
  Holder(const Holder&) = delete;

  std::vector<icat::Action<Uvms>> actions() {
    return {{"alone", {{faulty}, {ceiling}, {tool}, {still_vehicle}}},
            {"carry", {{faulty}, {ceiling}, {tool}, {still_vehicle}}}};
  }
  /// ẋ_t for ẏ, components on ⟨t⟩, which are the world's.
  Vector6 tool_velocity(const Vector13& velocity) const { return robot.jacobian(hand) * velocity; }

  Uvms robot;
  icat::FrameId hand;
  icat::task::FunctionTask<Uvms> ceiling;
  icat::task::FramePose<Uvms> tool;
  Faulty faulty;
  icat::task::Minimality<Uvms> still_vehicle;
};

struct Pair {
  // a, at a depth of 1.5 m, is 2 cm too close to its ceiling; b does not know of it.
  explicit Pair(bool spans, bool compensation = false, const Vector6& way = twist(0.3, -0.2, -0.4),
                icat::Columns given = {})
      : a(0.3, 1.52, way), b(2.5, -10, way) {
    std::size_t i = 0;
    for (Holder* h : {&a, &b}) {
      agents.push_back(std::make_unique<UvmsAgent>(
          h->robot, h->actions(), std::vector<icat::SharedAction<Uvms>>{{"carry", h->tool}},
          UvmsAgent::Options{.controller = {.given = given},
                             .compensation = compensation,
                             .agreement = {.index = i++, .spans = spans, .fade = 0.01}}));
    }
  }
  void start(const char* action, double time = 0) {
    for (auto& agent : agents) ASSERT_EQ(agent->start(action, time), Status::ok);
  }
  void cycle(double t, const Vector13& measured = Vector13::Zero()) {
    const long long round = round_++;
    for (auto& agent : agents) ASSERT_EQ(agent->propose(t, measured), Status::ok);
    ASSERT_EQ(agents[1]->receive(0, round, agents[0]->send(round)), Status::ok);
    ASSERT_EQ(agents[0]->receive(1, round, agents[1]->send(round)), Status::ok);
    for (auto& agent : agents) ASSERT_EQ(agent->step(t, measured), Status::ok);
  }
  const Holder& holder(std::size_t i) const { return i == 0 ? a : b; }
  Vector6 tool_velocity(std::size_t i) const {
    return holder(i).tool_velocity(agents[i]->velocity());
  }
  Holder a, b;
  std::vector<std::unique_ptr<UvmsAgent>> agents;
  long long round_ = 0;
};

/// Puts the robot where its frame is at `pose`.
template <class R>
icat::FrameId place(R& robot, const char* frame, const Pose& pose) {
  const icat::FrameId hand = robot.frame(frame);
  const Pose base = pose * robot.pose(hand).inverse() * robot.pose(robot.base());
  EXPECT_EQ(robot.update(robot.q(), base), Status::ok);
  return hand;
}

/// A robot, what it does in "carry", and its agent.
template <class R>
struct Carrier {
  using Options = typename icat::Agent<R>::Options;
  Carrier(const R& r, icat::FrameId frame, const Pose& goal, Options options)
      : robot(r),
        hand(frame),
        limits(r, {.margin = 0.05}),
        tool(r, frame, goal, {.name = "tool", .gain = 0.5}),
        agent(r, {{"carry", {{limits}, {tool}}}}, {{"carry", tool}}, options) {
    EXPECT_EQ(agent.start("carry", 0), Status::ok);
  }
  /// ẋ_t for ẏ, components on ⟨t⟩.
  Vector6 tool_velocity(const Eigen::VectorXd& velocity) const {
    const Vector6 v = robot.jacobian(hand) * velocity;
    const icat::Matrix3<double> back = robot.pose(hand).linear().transpose();
    Vector6 out;
    out << back * v.head<3>(), back * v.tail<3>();
    return out;
  }
  const R& robot;
  icat::FrameId hand;
  icat::task::JointLimits<R> limits;
  icat::task::FramePose<R> tool;
  icat::Agent<R> agent;
};

/// One round between two agents.
template <class A, class B>
void exchange(A& a, B& b, long long round) {
  ASSERT_EQ(b.receive(0, round, a.send(round)), Status::ok);
  ASSERT_EQ(a.receive(1, round, b.send(round)), Status::ok);
}

}  // namespace testing_support
