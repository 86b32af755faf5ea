// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The robot of a configuration, where it begins, and its limits.
#pragma once

#include "icat/adapters/urdf.hpp"
#include "icat/adapters/yaml_values.hpp"
#include "icat/control/motion_limits.hpp"
#include "icat/model/maris.hpp"
#include "icat/model/uvms.hpp"

namespace icat {

/// Any robot that a configuration describes.
using ConfiguredRobot = KinematicTree<double>;

namespace detail {

/// Throws what `make` throws, with the place in the file.
template <class Make>
auto at_place(const Section& s, const ConfigNode& at, Make&& make) -> decltype(make()) {
  try {
    return make();
  } catch (const std::invalid_argument& error) {
    if (std::string_view(error.what()).starts_with(s.file().name + ":")) throw;  // has a place
    wrong(s.file(), at, error.what());
  }
}

inline Base<double> base_called(const std::string& name) {
  if (name == "free") return Base<double>::free();
  if (name == "surface") return Base<double>::surface();
  if (name == "differential_drive") return Base<double>::differential_drive();
  return Base<double>::fixed();
}

/// The robot and what its model does not say.
struct RobotParts {
  ConfiguredRobot::Description description;
  std::string base = "free";
};

/// How positions of a joint are measured.
inline Unit unit_of(JointType type) noexcept {
  return type == JointType::prismatic ? Unit::length : Unit::angle;
}
/// The same of a joint by its name.
inline Unit unit_of(const ConfiguredRobot::Description& description, const std::string& joint) {
  for (const auto& j : description.joints) {
    if (j.name == joint) return unit_of(j.type);
  }
  return Unit::joint;
}

inline ConfiguredRobot::Description uvms_parts(const Section& s) {
  (void)s.choice("arm", "maris");
  UvmsMounts<double> mounts{.arm = s.pose("arm_mount").value_or(maris_arm_mount<double>()),
                            .camera = s.pose("camera").value_or(identity_pose<double>()),
                            .tool = s.pose("tool").value_or(identity_pose<double>())};
  s.finish();
  return uvms_description<ConfiguredRobot>(maris_arm<double>(), mounts);
}

inline ConfiguredRobot::Description urdf_parts(const Section& s, RobotParts& parts) {
  const std::string file = s.text("file");
  parts.base = s.choice("base", "fixed");
  UrdfOptions<double> options{.base = base_called(parts.base)};
  (void)s.known("locked", Value::joint_values);
  if (s.has("locked")) {
    const ConfigNode& locked = s.at("locked");
    s.map(locked, "locked");
    for (std::size_t i = 0; i < locked.items.size(); ++i) {
      const std::string& name = locked.names[i].name;
      options.locked.push_back({name, s.number_at(locked.items[i], name, Unit::joint, Range::any)});
    }
  }
  s.finish();
  const std::string path = file.starts_with('/') ? file : s.file().folder + file;
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  if (!stream || !(text << stream.rdbuf())) {
    s.fail(s.at("file"), "'", path, "': there is no such file, it is empty or unreadable");
  }
  return at_place(s, s.at("file"),
                  [&] { return urdf_description<double>(text.str(), options, "'" + path + "'"); });
}

inline Joint<double> tree_joint(const Section& s) {
  Joint<double> joint{s.text("name"), s.text("parent"), s.text("link")};
  const std::string type = s.choice("type", "revolute");
  joint.type = type == "fixed"        ? JointType::fixed
               : type == "continuous" ? JointType::continuous
               : type == "prismatic"  ? JointType::prismatic
                                      : JointType::revolute;
  const Unit unit = unit_of(joint.type), speed = unit == Unit::length ? Unit::speed : Unit::turn;
  joint.origin = s.pose("origin").value_or(identity_pose<double>());
  joint.axis = s.vector("axis").value_or(Vector3<double>(0, 0, 1));
  joint.lower = s.number("lower", -infinity<double>, unit);
  joint.upper = s.number("upper", infinity<double>, unit);
  joint.max_velocity = s.number("max_velocity", infinity<double>, speed);
  joint.max_acceleration = s.number("max_acceleration", infinity<double>);
  if (const auto mimic = s.section("mimic")) {
    joint.mimic = Mimic<double>{mimic->text("joint"), mimic->number("multiplier", 1),
                                mimic->number("offset", 0, unit)};
    mimic->finish();
  }
  s.finish();
  return joint;
}

/// A parent is a link, or the root: the one that is named, or the first that no joint moves.
inline void check_parents(const std::vector<Section>& joints,
                          const ConfiguredRobot::Description& description) {
  std::vector<std::string> links;
  for (const auto& joint : description.joints) links.push_back(joint.link);
  const auto known = [&](const std::string& link) {
    return std::find(links.begin(), links.end(), link) != links.end();
  };
  std::string root = description.root;
  for (const auto& joint : description.joints) {
    if (root.empty() && !known(joint.parent)) root = joint.parent;
  }
  if (!root.empty()) links.insert(links.begin(), root);
  for (const Section& joint : joints) (void)joint.look_up(joint.at("parent"), "link", links);
}

inline ConfiguredRobot::Description tree_parts(const Section& s, RobotParts& parts) {
  ConfiguredRobot::Description description;
  parts.base = s.choice("base", "fixed");
  description.base = base_called(parts.base);
  description.root = s.text("root");
  const auto joints = s.sections("joints");
  for (const Section& joint : joints) description.joints.push_back(tree_joint(joint));
  check_parents(joints, description);
  for (const Section& mass : s.sections("masses")) {
    description.masses.push_back(
        {mass.text("link"), mass.number("mass", 0), *mass.vector("center")});
    mass.finish();
  }
  s.finish();
  return description;
}

inline RobotParts robot_parts(const Section& s) {
  RobotParts parts;
  const auto uvms = s.section("uvms"), urdf = s.section("urdf"), tree = s.section("tree");
  parts.description = uvms   ? uvms_parts(*uvms)
                      : urdf ? urdf_parts(*urdf, parts)
                             : tree_parts(*tree, parts);
  return parts;
}

/// Where the robot of section `s` goes wrong: what is said of a joint stands at that joint, where
/// the joint is written here.
inline const ConfigNode& place_of(const Section& s, std::string_view error) {
  const ConfigNode* tree = s.node().find("tree");
  const ConfigNode* joints = tree ? tree->find("joints") : nullptr;
  for (std::size_t i = 0; joints && i < joints->items.size(); ++i) {
    const ConfigNode* name = joints->items[i].find("name");
    if (name && error.find("joint '" + name->text + "'") != error.npos) return joints->items[i];
  }
  return s.node();
}

/// The names of its frames.
inline std::vector<std::string> frame_names(const ConfiguredRobot& robot) {
  std::vector<std::string> names;
  for (Index i = 0; i < robot.frame_count(); ++i) names.push_back(robot.frame_name(FrameId(i)));
  return names;
}
/// The frame that the key `name` names.
inline FrameId frame_of(const Section& s, const char* name, const ConfiguredRobot& robot) {
  const auto names = frame_names(robot);
  (void)s.known(name, Value::text);
  return robot.frame(names[s.look_up(s.at(name), "frame", names)]);
}
/// The same where there is such a key.
inline std::optional<FrameId> frame_if(const Section& s, const char* name,
                                       const ConfiguredRobot& robot) {
  (void)s.known(name, Value::text);
  if (!s.has(name)) return std::nullopt;
  return frame_of(s, name, robot);
}

inline void add_frames(const Section& s, ConfiguredRobot& robot) {
  for (const auto& [name, frame] : s.named("frames")) {
    const FrameId parent = frame_of(frame, "parent", robot);
    const Pose<double> pose = *frame.pose("pose");
    frame.finish();
    at_place(frame, frame.node(),
             [&, &called = name] { return robot.add_frame(called, parent, pose); });
  }
}

inline std::vector<std::string> joint_names(const ConfiguredRobot& robot) {
  std::vector<std::string> names;
  for (const auto& joint : robot.joints()) names.push_back(joint.name);
  return names;
}

/// What configurations and their readers know of a robot.
struct RobotContext {
  ConfiguredRobot& robot;
  const RobotParts& parts;

  /// Columns by the names that the key `name` lists: joints, columns of the base, or all of either.
  Columns columns(const Section& s, const char* name) const {
    const auto joints = joint_names(robot);
    std::vector<std::string> names = joints;
    for_each_word(parts.base == "free"      ? "surge sway heave roll pitch yaw"
                  : parts.base == "surface" ? "surge sway yaw"
                  : parts.base == "fixed"   ? ""
                                            : "surge yaw",
                  [&](std::string_view w) { names.emplace_back(w); });
    const std::size_t single = names.size();
    names.insert(names.end(), {"joints", "base"});
    const auto words = s.names(name);
    List<Index> columns;
    for (std::size_t k = 0; k < words.size(); ++k) {
      const ConfigNode& all = s.at(name);
      const ConfigNode& at = all.is(ConfigNode::Kind::list) ? all.items[k] : all;
      const std::size_t i = s.look_up(at, "column", names);
      const std::size_t first = i < single ? i : i == single ? 0 : joints.size();
      const std::size_t end = i < single ? i + 1 : i == single ? joints.size() : single;
      for (std::size_t c = first; c < end; ++c) {
        for (const Index other : columns) {
          if (other == static_cast<Index>(c)) s.fail(at, "column '", names[c], "' stands twice");
        }
        columns.push_back(static_cast<Index>(c));
      }
    }
    return Columns({columns.data(), columns.size()});
  }

  /// The joints that the key `joints` names; none: all are meant.
  std::vector<std::string> joints(const Section& s) const {
    const auto words = s.names("joints");
    const auto names = joint_names(robot);
    for (std::size_t k = 0; k < words.size(); ++k) {
      const ConfigNode& all = s.at("joints");
      (void)s.look_up(all.is(ConfigNode::Kind::list) ? all.items[k] : all, "joint", names);
    }
    return words;
  }
  /// Positions of the joints `names`, as a list with one for each, or by their names. `all`: none
  /// may be missing; else those that are not there are 0.
  Vector<double, Eigen::Dynamic> joint_values(const Section& s, const char* name,
                                              const std::vector<std::string>& names,
                                              bool all) const {
    (void)s.known(name, Value::joint_values);
    auto q = zeros<Vector<double, Eigen::Dynamic>>(static_cast<Index>(names.size()));
    if (!s.has(name)) return q;
    const ConfigNode& at = s.at(name);
    const auto value = [&](std::size_t i, const ConfigNode& from) {
      q(static_cast<Index>(i)) =
          s.number_at(from, names[i], unit_of(parts.description, names[i]), Range::any);
    };
    if (at.is(ConfigNode::Kind::list)) {
      if (at.items.size() != names.size()) {
        s.fail(at, "'", name, "' has ", at.items.size(), " numbers for ", names.size(), " joints");
      }
      for (std::size_t i = 0; i < names.size(); ++i) value(i, at.items[i]);
      return q;
    }
    s.map(at, name);
    for (std::size_t k = 0; k < at.items.size(); ++k) {
      const auto& word = at.names[k];
      const auto found = std::find(names.begin(), names.end(), word.name);
      if (found == names.end()) {
        fail_at(s, word, names);
      }
      value(static_cast<std::size_t>(found - names.begin()), at.items[k]);
    }
    for (const std::string& joint : names) {
      if (all && !at.find(joint)) s.fail(at, "'", name, "' says nothing of joint '", joint, "'");
    }
    return q;
  }

  /// The limits of motion; those of the robot where there is no such section.
  MotionLimits<ConfiguredRobot> limits(const std::optional<Section>& section) const {
    if (!section) return {};
    const Section& s = *section;
    MotionLimits<ConfiguredRobot>::Options options;
    const bool none = s.boolean("unlimited", false);
    options.reaction_time = s.number("reaction_time", options.reaction_time);
    options.max_velocity = s.number("max_velocity", infinity<double>);
    options.max_acceleration = s.number("max_acceleration", infinity<double>);
    for (const auto& [name, joint] : s.named("joints")) {
      const std::size_t i = index_of_joint(s, name);
      JointInfo<double> info = robot.joints()[i];
      const Unit unit = unit_of(parts.description, name);
      info.lower = joint.number("lower", info.lower, unit);
      info.upper = joint.number("upper", info.upper, unit);
      info.max_velocity = joint.number("max_velocity", info.max_velocity,
                                       unit == Unit::length ? Unit::speed : Unit::turn);
      info.max_acceleration = joint.number("max_acceleration", info.max_acceleration);
      joint.finish();
      options.joints.push_back(info);
    }
    options.base_velocity = s.numbers("base_velocity");
    options.base_acceleration = s.numbers("base_acceleration");
    s.finish();
    if (none && s.node().items.size() > 1) s.fail(s.node(), "'unlimited' stands alone");
    if (none) return unlimited;
    return at_place(s, s.node(), [&] { return MotionLimits<ConfiguredRobot>(robot, options); });
  }

 private:
  /// Of one that the key `joints` names.
  std::size_t index_of_joint(const Section& s, const std::string& name) const {
    const auto names = joint_names(robot);
    const auto found = std::find(names.begin(), names.end(), name);
    if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
    for (const auto& word : s.at("joints").names) {
      if (word.name == name) fail_at(s, word, names);
    }
    return 0;
  }
  [[noreturn]] static void fail_at(const Section& s, const ConfigNode::Name& word,
                                   const std::vector<std::string>& names) {
    ConfigNode place;
    place.line = word.line;
    place.column = word.column;
    s.fail(place, "no joint '", word.name, "'", there_are(word.name, names));
  }
};

}  // namespace detail
}  // namespace icat
