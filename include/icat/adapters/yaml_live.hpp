// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// What of a configured task may change while it runs: values are read and checked first, outside
/// the loop, and then set by calls that cannot fail, throw nothing and allocate nothing.
#pragma once

#include <functional>
#include <memory>

#include "icat/adapters/yaml_robot.hpp"
#include "icat/adapters/yaml_task_keys.hpp"
#include "icat/task/clearance.hpp"
#include "icat/task/column_tasks.hpp"
#include "icat/task/direction_tasks.hpp"
#include "icat/task/distance_tasks.hpp"
#include "icat/task/frame_tasks.hpp"
#include "icat/task/joint_tasks.hpp"
#include "icat/task/manipulability.hpp"

namespace icat::detail {

using AnyTask = Task<ConfiguredRobot>;
/// Sets what was read. Its call does not allocate or throw.
using Setter = std::function<void()>;

/// A part of the way of a goal: from rest to rest by the smooth step.
struct GoalMove {
  double from, to;
  Vector3<double> by;

  /// How far it is at `time`.
  static Vector3<double> sum(const std::vector<GoalMove>& moves, double time) noexcept {
    Vector3<double> way(0, 0, 0);
    for (const GoalMove& m : moves) {
      const double share = smooth_step((time - m.from) / (m.to - m.from));
      way = plus(way, share, m.by);
    }
    return way;
  }
};

/// A task, and what a configuration does with it.
struct ConfiguredTask {
  std::string name, type;
  std::unique_ptr<AnyTask> task;
  /// What conditions ask of it.
  std::vector<std::pair<const char*, std::function<double()>>> measures;
  /// Of the live key `key`, whose new value the section has.
  std::function<Setter(const Section&, std::string_view key)> change;
  std::function<void(double time)> move;  // of the goal; or empty
};

/// The obstacles of a clearance.
inline std::vector<Obstacle<double>> obstacles_of(const Section& s) {
  std::vector<Obstacle<double>> all;
  for (const Section& o : s.sections("obstacles")) {
    const auto sphere = o.section("sphere"), capsule = o.section("capsule"),
               plane = o.section("plane"), box = o.section("box");
    o.finish();
    if (sphere) {
      all.push_back(
          Obstacle<double>::sphere(*sphere->vector("center"), sphere->number("radius", 0)));
      sphere->finish();
    } else if (capsule) {
      all.push_back(Obstacle<double>::capsule(*capsule->vector("from"), *capsule->vector("to"),
                                              capsule->number("radius", 0)));
      capsule->finish();
    } else if (plane) {
      all.push_back(Obstacle<double>::plane(*plane->vector("point"), *plane->vector("normal")));
      plane->finish();
    } else {
      all.push_back(Obstacle<double>::box(*box->pose("pose"), *box->vector("size")));
      box->finish();
    }
  }
  return all;
}

/// [linear; angular] of a velocity that is set.
inline Vector6<double> twist_of(const Section& s) {
  auto twist = zeros<Vector6<double>>(6);
  set_column3(twist, 0, 0, s.vector("linear_velocity").value_or(Vector3<double>(0, 0, 0)));
  set_column3(twist, 3, 0, s.vector("angular_velocity").value_or(Vector3<double>(0, 0, 0)));
  return twist;
}

/// Numbers as a vector.
inline Vector<double, Eigen::Dynamic> vector_of(const std::vector<double>& numbers) {
  auto v = zeros<Vector<double, Eigen::Dynamic>>(static_cast<Index>(numbers.size()));
  for (std::size_t i = 0; i < numbers.size(); ++i) v(static_cast<Index>(i)) = numbers[i];
  return v;
}
inline Vector<double, Eigen::Dynamic> vector_of(const PerJoint<double>& numbers) {
  auto v = zeros<Vector<double, Eigen::Dynamic>>(numbers.size());
  for (Index i = 0; i < numbers.size(); ++i) v(i) = numbers[i];
  return v;
}

/// The joints of a joint task: those that it lists, or all.
inline std::vector<std::string> joints_of(const Section& s, const RobotContext& context) {
  const auto named = context.joints(s);
  return named.empty() ? joint_names(context.robot) : named;
}

/// See the file comment: the setter of the live key `key` of the task `t`.
template <class T>
[[gnu::cold]] Setter live_setter(T& t, const Section& s, std::string_view key,
                                 const RobotContext& context) {
  if constexpr (requires { t.set_gain(1.0); }) {
    if (key == "gain") return [&t, gain = s.number("gain", 1)] { (void)t.set_gain(gain); };
  }
  if constexpr (requires { t.set_max_rate(1.0); }) {
    if (key == "max_rate") {
      double rate = infinity<double>;
      if constexpr (std::is_base_of_v<JointTask<ConfiguredRobot>, T>) {
        const PerJoint<double> rates = s.per_joint("max_rate", rate);
        if (!rates.for_all()) {
          s.fail(s.at("max_rate"), "'max_rate' may change to one number for all joints only");
        }
        rate = rates[0];
      } else {
        rate = s.number("max_rate", rate);
      }
      return [&t, rate] { (void)t.set_max_rate(rate); };
    }
  }
  if constexpr (requires { t.set_max_rates(1.0, 1.0); }) {
    if (key == "max_linear_rate" || key == "max_angular_rate") {
      const double linear = s.number("max_linear_rate", infinity<double>),
                   angular = s.number("max_angular_rate", infinity<double>);
      return [&t, linear, angular] { (void)t.set_max_rates(linear, angular); };
    }
  }
  if constexpr (requires { t.set_margin(1.0); }) {
    if (key == "margin") {
      const PerJoint<double> margin = s.per_joint("margin", 0.1);
      if (margin.for_all()) return [&t, m = margin[0]] { (void)t.set_margin(m); };
      return [&t, m = vector_of(margin)] { (void)t.set_margin(m); };
    }
  }
  if constexpr (requires(const Objective<double>& o) { t.set_objective(o); }) {
    if (key == "objective" || key == "norm") {
      const Objective<double> o = *s.objective(key == "norm" ? "norm" : "objective");
      return [&t, o] { (void)t.set_objective(o); };
    }
  }
  if constexpr (requires(const PoseNorms<double>& n) { t.set_norms(n); }) {
    if (key == "norms") {
      const Section below = *s.section("norms");
      const PoseNorms<double> n{*below.objective("position"), *below.objective("orientation")};
      return [&t, n] { (void)t.set_norms(n); };
    }
  }
  if (key == "goal") {
    const ConfigNode& at = s.at("goal");
    if (s.here("goal")) s.fail(at, "'here' is where it is at the start: say another goal");
    if (s.node().find("moves")) s.fail(at, "'goal' may not change where it 'moves'");
    if constexpr (requires(const Pose<double>& p) { t.set_goal(p); }) {
      return [&t, goal = *s.pose("goal")] { (void)t.set_goal(goal); };
    } else if constexpr (std::is_same_v<T, task::FrameOrientation<ConfiguredRobot>>) {
      return [&t, goal = rotation(*s.pose("goal"))] { (void)t.set_goal(goal); };
    } else if constexpr (std::is_same_v<T, task::JointPosition<ConfiguredRobot>>) {
      return [&t, goal = context.joint_values(s, "goal", joints_of(s, context), true)] {
        (void)t.set_goal(goal);
      };
    } else if constexpr (requires(const Vector3<double>& v) { t.set_goal(v); }) {
      return [&t, goal = *s.vector("goal")] { (void)t.set_goal(goal); };
    }
  }
  if constexpr (requires(const Vector3<double>& v) { t.set_target(v); }) {
    if (key == "target") return [&t, to = *s.vector("target")] { (void)t.set_target(to); };
  }
  if constexpr (requires(const Vector3<double>& v) { t.set_point(v); }) {
    if (key == "point") return [&t, to = *s.vector("point")] { (void)t.set_point(to); };
  }
  if constexpr (requires(const Vector3<double>& v) { t.set_world_axis(v); }) {
    if (key == "world_axis") {
      const auto axis = s.vector("world_axis").value_or(Vector3<double>(0, 0, 1));
      return [&t, axis] { (void)t.set_world_axis(axis); };
    }
  }
  if constexpr (std::is_same_v<T, task::FrameVelocity<ConfiguredRobot>>) {
    if (key == "linear_velocity" || key == "angular_velocity") {
      return [&t, twist = twist_of(s)] { (void)t.set_velocity(twist); };
    }
  }
  if constexpr (std::is_same_v<T, task::GivenVelocity<ConfiguredRobot>>) {
    if (key == "velocity") {
      auto v = vector_of(s.numbers("velocity"));
      if (v.size() == 0) v = zeros<Vector<double, Eigen::Dynamic>>(t.rows());
      return [&t, v] { (void)t.set_velocity(v); };
    }
  }
  if constexpr (std::is_same_v<T, task::Clearance<ConfiguredRobot>>) {
    if (key == "obstacles") {
      return [&t, all = obstacles_of(s)] {
        for (std::size_t i = 0; i < all.size(); ++i) {
          (void)t.set_obstacle(static_cast<Index>(i), all[i]);
        }
      };
    }
  }
  invalid("the table of '", s.table().name, "' says that '", key,
          "' may change, and nothing changes it");
}

}  // namespace icat::detail
