// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The tasks of a configuration: the whole catalogue of icat/task but `FunctionTask`, which is
/// code.
#pragma once

#include "icat/adapters/yaml_live.hpp"

namespace icat::detail {

/// Makes tasks of sections.
class TaskMaker {
 public:
  using R = ConfiguredRobot;
  using Vector3d = Vector3<double>;

  explicit TaskMaker(const RobotContext& context) : context_(context) {}

  /// @throws std::invalid_argument on what the type's table or the task's constructor refuses.
  [[gnu::cold]] ConfiguredTask make(const ConfigFile& file, const ConfigNode& node,
                                    const ConfigNode::Name& called) const {
    const ConfigNode* type = node.find("type");
    const std::string where = "task '" + called.name + "'";
    if (!type) wrong(file, called.line, called.column, where, ": 'type' is missing");
    std::vector<std::string> types;
    for (const ConfigSection& s : task_sections) types.emplace_back(s.name);
    const auto found = std::find(types.begin(), types.end(), type->text);
    if (type->text == "function") {
      wrong(file, *type, where, ": a function is code: add the task in C++");
    }
    if (found == types.end()) {
      wrong(file, *type, where, ": no type '", type->text, "'", there_are(type->text, types));
    }
    const Section s(file, node, task_sections[found - types.begin()], where);
    ConfiguredTask result;
    result.name = called.name;
    result.type = s.text("type");
    at_place(s, node, [&] {
      dispatch(s, result);
      s.finish();
    });
    return result;
  }

 private:
  void dispatch(const Section& s, ConfiguredTask& c) const {
    struct Maker {
      std::string_view type;
      void (TaskMaker::*make)(const Section&, ConfiguredTask&) const;
    };
    static constexpr Maker makers[] = {{"joint_limits", &TaskMaker::joint_limits},
                                       {"joint_position", &TaskMaker::joint_position},
                                       {"frame_pose", &TaskMaker::frame_pose},
                                       {"frame_position", &TaskMaker::frame_position},
                                       {"frame_orientation", &TaskMaker::frame_orientation},
                                       {"frame_velocity", &TaskMaker::frame_velocity},
                                       {"attitude", &TaskMaker::attitude},
                                       {"look_at", &TaskMaker::look_at},
                                       {"occlusion", &TaskMaker::occlusion},
                                       {"frame_distance", &TaskMaker::frame_distance},
                                       {"center_of_mass", &TaskMaker::center_of_mass},
                                       {"manipulability", &TaskMaker::manipulability},
                                       {"clearance", &TaskMaker::clearance},
                                       {"self_clearance", &TaskMaker::self_clearance},
                                       {"minimality", &TaskMaker::minimality},
                                       {"given_velocity", &TaskMaker::given_velocity}};
    static_assert(std::size(makers) == std::size(task_sections));
    for (const Maker& maker : makers) {
      if (maker.type == c.type) return (this->*maker.make)(s, c);
    }
    invalid("the table has a type of task '", c.type, "' that nobody makes");
  }
  /// Keeps the task; what may change of it.
  template <class T>
  T& keep(std::unique_ptr<T> task, ConfiguredTask& c) const {
    T& t = *task;
    c.task = std::move(task);
    c.change = [&t, context = context_](const Section& s, std::string_view key) {
      return live_setter(t, s, key, context);
    };
    return t;
  }
  R& robot() const noexcept { return context_.robot; }
  static double gain(const Section& s) { return s.number("gain", 1); }
  static double max_rate(const Section& s) { return s.number("max_rate", infinity<double>); }
  static Vector3d axis(const Section& s, const char* name = "axis") {
    return s.vector(name).value_or(Vector3d(0, 0, 1));
  }
  static On axes_of(const Section& s, const char* otherwise) {
    return s.choice("axes_of", otherwise) == "frame" ? On::frame : On::reference;
  }
  /// Where the frame is at the start, in its reference.
  Pose<double> pose_now(FrameId frame, std::optional<FrameId> reference) const {
    const Pose<double> pose = robot().pose(frame);
    if (!reference) return pose;
    const Pose<double> from = robot().pose(*reference);
    const Matrix3<double> back = transpose(rotation(from));
    return make_pose(times(back, rotation(pose)), times(back, minus(origin(pose), origin(from))));
  }
  static std::vector<GoalMove> moves(const Section& s) {
    std::vector<GoalMove> all;
    for (const Section& m : s.sections("moves")) {
      all.push_back({m.number("from", 0), m.number("to", 0), *m.vector("by")});
      m.finish();
      const GoalMove& move = all.back();
      if (!(std::isfinite(move.from) && move.from < move.to && std::isfinite(move.to)) ||
          !all_finite(move.by)) {
        m.fail(m.node(), "'from' must be before 'to', and all finite");
      }
    }
    return all;
  }

  void joint_limits(const Section& s, ConfiguredTask& c) const {
    keep(std::make_unique<task::JointLimits<R>>(
             robot(),
             task::JointLimits<R>::Options{.name = c.name,
                                           .joints = context_.joints(s),
                                           .margin = s.per_joint("margin", 0.1),
                                           .to_middle = s.boolean("to_middle", false),
                                           .gain = gain(s),
                                           .max_rate = s.per_joint("max_rate", infinity<double>)}),
         c);
  }
  void joint_position(const Section& s, ConfiguredTask& c) const {
    const auto joints = joints_of(s, context_);
    auto& t = keep(
        std::make_unique<task::JointPosition<R>>(
            robot(), context_.joint_values(s, "goal", joints, true),
            task::JointPosition<R>::Options{.name = c.name,
                                            .joints = context_.joints(s),
                                            .norm = s.objective("norm"),
                                            .gain = gain(s),
                                            .max_rate = s.per_joint("max_rate", infinity<double>)}),
        c);
    c.measures = {{"joints", [&t, at = joint_indices(robot(), joints)] {
                     double largest = 0;
                     for (std::size_t k = 0; k < at.size(); ++k) {
                       double e = t.goal()(static_cast<Index>(k)) - t.robot().position(at[k]);
                       const auto& joint = t.robot().joints()[static_cast<std::size_t>(at[k])];
                       if (joint.continuous) e = std::remainder(e, 2 * std::numbers::pi);
                       largest = std::max(largest, std::abs(e));
                     }
                     return largest;
                   }}};
  }
  void frame_pose(const Section& s, ConfiguredTask& c) const {
    const FrameId frame = frame_of(s, "frame", robot());
    const auto reference = frame_if(s, "relative_to", robot());
    const Pose<double> goal = s.here("goal") ? pose_now(frame, reference) : *s.pose("goal");
    (void)s.known("goal", Value::goal_pose);
    task::FramePose<R>::Options options{.name = c.name,
                                        .relative_to = reference,
                                        .linear = s.axes("linear"),
                                        .angular = s.axes("angular"),
                                        .on = axes_of(s, "reference"),
                                        .gain = gain(s)};
    if (const auto norms = s.section("norms")) {
      options.norms = {*norms->objective("position"), *norms->objective("orientation")};
      norms->finish();
    }
    options.max_linear_rate = s.number("max_linear_rate", infinity<double>);
    options.max_angular_rate = s.number("max_angular_rate", infinity<double>);
    auto& t = keep(std::make_unique<task::FramePose<R>>(robot(), frame, goal, options), c);
    c.measures = {{"position", [&t] { return t.position_error(); }},
                  {"orientation", [&t] { return t.orientation_error(); }}};
    if (auto way = moves(s); !way.empty()) {
      c.move = [&t, goal, way](double time) {
        (void)t.set_goal(make_pose(rotation(goal), plus(origin(goal), GoalMove::sum(way, time))));
      };
    }
  }
  void frame_position(const Section& s, ConfiguredTask& c) const {
    const FrameId frame = frame_of(s, "frame", robot());
    const auto reference = frame_if(s, "relative_to", robot());
    (void)s.known("goal", Value::goal_point);
    const Vector3d goal = s.here("goal") ? origin(pose_now(frame, reference)) : *s.vector("goal");
    auto& t = keep(std::make_unique<task::FramePosition<R>>(
                       robot(), frame, goal,
                       task::FramePosition<R>::Options{.name = c.name,
                                                       .relative_to = reference,
                                                       .axes = s.axes("axes"),
                                                       .on = axes_of(s, "reference"),
                                                       .norm = s.objective("norm"),
                                                       .gain = gain(s),
                                                       .max_rate = max_rate(s)}),
                   c);
    c.measures = {{"position", [&t] { return t.position_error(); }}};
    if (auto way = moves(s); !way.empty()) {
      c.move = [&t, goal, way](double time) {
        (void)t.set_goal(plus(goal, GoalMove::sum(way, time)));
      };
    }
  }
  void frame_orientation(const Section& s, ConfiguredTask& c) const {
    const FrameId frame = frame_of(s, "frame", robot());
    const auto reference = frame_if(s, "relative_to", robot());
    (void)s.known("goal", Value::goal_turn);
    const Matrix3<double> goal =
        rotation(s.here("goal") ? pose_now(frame, reference) : *s.pose("goal"));
    auto& t = keep(std::make_unique<task::FrameOrientation<R>>(
                       robot(), frame, goal,
                       task::FrameOrientation<R>::Options{.name = c.name,
                                                          .relative_to = reference,
                                                          .axes = s.axes("axes"),
                                                          .on = axes_of(s, "reference"),
                                                          .norm = s.objective("norm"),
                                                          .gain = gain(s),
                                                          .max_rate = max_rate(s)}),
                   c);
    c.measures = {{"orientation", [&t] { return t.orientation_error(); }}};
  }
  void frame_velocity(const Section& s, ConfiguredTask& c) const {
    auto& t =
        keep(std::make_unique<task::FrameVelocity<R>>(
                 robot(), frame_of(s, "frame", robot()),
                 task::FrameVelocity<R>::Options{.name = c.name,
                                                 .relative_to = frame_if(s, "relative_to", robot()),
                                                 .linear = s.axes("linear"),
                                                 .angular = s.axes("angular"),
                                                 .on = axes_of(s, "frame")}),
             c);
    if (t.set_velocity(twist_of(s)) != Status::ok) s.fail(s.node(), "a velocity is not finite");
  }
  template <class T>
  static void measure_angle(T& t, ConfiguredTask& c) {
    c.measures = {{"angle", [&t] { return t.angle(); }}};
  }
  void attitude(const Section& s, ConfiguredTask& c) const {
    auto& t = keep(std::make_unique<task::Attitude<R>>(
                       robot(), frame_of(s, "frame", robot()),
                       task::Attitude<R>::Options{.name = c.name,
                                                  .axis = axis(s),
                                                  .world_axis = axis(s, "world_axis"),
                                                  .norm = s.objective("norm"),
                                                  .gain = gain(s),
                                                  .max_rate = max_rate(s)}),
                   c);
    measure_angle(t, c);
  }
  void look_at(const Section& s, ConfiguredTask& c) const {
    const FrameId camera = frame_of(s, "camera", robot());
    const auto frame = frame_if(s, "target_frame", robot());
    const auto target = s.vector("target");
    const task::LookAt<R>::Options options{.name = c.name,
                                           .axis = axis(s),
                                           .norm = s.objective("norm"),
                                           .gain = gain(s),
                                           .max_rate = max_rate(s)};
    auto& t = keep(frame ? std::make_unique<task::LookAt<R>>(robot(), camera, *frame, options)
                         : std::make_unique<task::LookAt<R>>(robot(), camera, *target, options),
                   c);
    measure_angle(t, c);
  }
  void occlusion(const Section& s, ConfiguredTask& c) const {
    auto& t =
        keep(std::make_unique<task::Occlusion<R>>(
                 robot(), frame_of(s, "camera", robot()), frame_of(s, "frame", robot()),
                 *s.objective("objective"),
                 task::Occlusion<R>::Options{
                     .name = c.name, .axis = axis(s), .gain = gain(s), .max_rate = max_rate(s)}),
             c);
    measure_angle(t, c);
  }
  template <class T>
  static void measure_objective(T& t, ConfiguredTask& c) {
    c.measures = {{"holds", [&t] { return t.objective().satisfied(t.value()) ? 0.0 : 1.0; }}};
  }
  void frame_distance(const Section& s, ConfiguredTask& c) const {
    const FrameId frame = frame_of(s, "frame", robot());
    const auto other = frame_if(s, "other_frame", robot());
    const auto point = s.vector("point");
    const Objective<double> objective = *s.objective("objective");
    const task::FrameDistance<R>::Options options{
        .name = c.name, .gain = gain(s), .max_rate = max_rate(s)};
    using Distance = task::FrameDistance<R>;
    auto& t = keep(other ? std::make_unique<Distance>(robot(), frame, *other, objective, options)
                         : std::make_unique<Distance>(robot(), frame, *point, objective, options),
                   c);
    measure_objective(t, c);
  }
  void center_of_mass(const Section& s, ConfiguredTask& c) const {
    (void)s.known("goal", Value::goal_point);
    const Vector3d goal = s.here("goal") ? Vector3d(robot().center_of_mass()) : *s.vector("goal");
    keep(std::make_unique<task::CenterOfMass<R>>(
             robot(), goal,
             task::CenterOfMass<R>::Options{
                 .name = c.name, .axes = s.axes("axes"), .gain = gain(s), .max_rate = max_rate(s)}),
         c);
  }
  void manipulability(const Section& s, ConfiguredTask& c) const {
    auto& t = keep(std::make_unique<task::Manipulability<R>>(
                       robot(), frame_of(s, "frame", robot()), *s.objective("objective"),
                       task::Manipulability<R>::Options{.name = c.name,
                                                        .joints = context_.joints(s),
                                                        .gain = gain(s),
                                                        .max_rate = max_rate(s)}),
                   c);
    measure_objective(t, c);
  }

  std::vector<CollisionBody<double>> bodies(const Section& s,
                                            std::vector<std::string>& names) const {
    std::vector<CollisionBody<double>> all;
    for (const Section& b : s.sections("bodies")) {
      names.push_back(b.text("name"));
      const FrameId frame = frame_of(b, "frame", robot());
      const auto center = b.vector("center"), from = b.vector("from"), to = b.vector("to");
      const double radius = b.number("radius", 0);
      b.finish();
      if (center ? from || to : !from || !to) {
        b.fail(b.node(), "needs 'center', or 'from' and 'to'");
      }
      all.push_back(center ? CollisionBody<double>::sphere(frame, *center, radius)
                           : CollisionBody<double>::capsule(frame, *from, *to, radius));
    }
    return all;
  }
  void clearance(const Section& s, ConfiguredTask& c) const {
    std::vector<std::string> names;
    const auto all = bodies(s, names);
    keep(std::make_unique<task::Clearance<R>>(
             robot(), all, obstacles_of(s), *s.objective("objective"),
             task::Clearance<R>::Options{.name = c.name,
                                         .bulge = s.number("bulge", 0.02),
                                         .gain = gain(s),
                                         .max_rate = max_rate(s)}),
         c);
  }
  void self_clearance(const Section& s, ConfiguredTask& c) const {
    std::vector<std::string> names;
    const auto all = bodies(s, names);
    std::vector<BodyPair> pairs;
    (void)s.known("pairs", Value::pairs);
    for (const ConfigNode& pair : s.list(s.at("pairs"), "pairs")) {
      if (!pair.is(ConfigNode::Kind::list) || pair.items.size() != 2) {
        s.fail(pair, "a pair is a list of two bodies");
      }
      pairs.push_back({static_cast<Index>(s.look_up(pair.items[0], "body", names)),
                       static_cast<Index>(s.look_up(pair.items[1], "body", names))});
    }
    keep(std::make_unique<task::SelfClearance<R>>(
             robot(), all, pairs, *s.objective("objective"),
             task::SelfClearance<R>::Options{.name = c.name,
                                             .bulge = s.number("bulge", 0.02),
                                             .gain = gain(s),
                                             .max_rate = max_rate(s)}),
         c);
  }
  void minimality(const Section& s, ConfiguredTask& c) const {
    keep(std::make_unique<task::Minimality<R>>(robot(), context_.columns(s, "columns"), c.name), c);
  }
  void given_velocity(const Section& s, ConfiguredTask& c) const {
    auto& t = keep(
        std::make_unique<task::GivenVelocity<R>>(robot(), context_.columns(s, "columns"), c.name),
        c);
    const auto v = vector_of(s.numbers("velocity"));
    if (v.size() == 0) return;
    if (t.set_velocity(v) != Status::ok) {
      s.fail(s.at("velocity"), "'velocity' has ", v.size(), " numbers for ", t.rows(),
             " columns, or one is not finite");
    }
  }

  RobotContext context_;
};

}  // namespace icat::detail
