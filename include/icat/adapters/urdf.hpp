// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A kinematic tree of a URDF file or text, read by urdfdom. The program links
/// `urdfdom::urdfdom_model`; docs/adapters.md has the lines of CMake.
///
/// Every link is a frame. Joints: revolute, continuous, prismatic and fixed ones; mimics follow
/// their leader and have no column. Columns are depth first, the joints of a link by their names;
/// Pinocchio has the same order. Limits of position and velocity and masses are those of the file,
/// with two exceptions: a range [0, 0] and a velocity 0 mean that the file states no limit. Limits
/// of mimics are ignored. A limit of acceleration is read where urdfdom does (headers 3.0 and
/// newer).
///
/// Needs exceptions, since the headers of urdfdom do. What urdfdom has to say goes into the text of
/// the error, not to stderr.
#pragma once

#include <console_bridge/console.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <cmath>
#include <fstream>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "icat/model/kinematic_tree.hpp"

namespace icat {

/// A joint that does not move.
template <class Scalar>
struct LockedJoint {
  std::string joint;  ///< name in the file
  Scalar position;    ///< where it stays, rad or m
};

/// Settings that a URDF does not contain.
template <class Scalar>
struct UrdfOptions {
  Base<Scalar> base{};  ///< what the root link can do; fixed by default
  std::vector<LockedJoint<Scalar>> locked = EmptyList{};  ///< they and their mimics become fixed
};

namespace detail {

/// Keeps what urdfdom says in place of printing it.
class UrdfMessages : public console_bridge::OutputHandler {
 public:
  UrdfMessages() { console_bridge::useOutputHandler(this); }
  ~UrdfMessages() override { console_bridge::restorePreviousOutputHandler(); }
  UrdfMessages(const UrdfMessages&) = delete;
  UrdfMessages& operator=(const UrdfMessages&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR) {
      text_.append(text_.empty() ? "" : "; ").append(text);
    }
  }
  const std::string& text() const noexcept { return text_; }

 private:
  std::string text_;
};

template <class Scalar>
Pose<Scalar> urdf_pose(const urdf::Pose& pose) {
  UnitQuaternion<double> q;
  q.w = pose.rotation.w;
  q.v = {pose.rotation.x, pose.rotation.y, pose.rotation.z};
  const Matrix3<double> R = q.matrix();
  Pose<Scalar> result = identity_pose<Scalar>();
  for (Index j = 0; j < 3; ++j) {
    for (Index i = 0; i < 3; ++i) result.matrix()(i, j) = Scalar(R(i, j));
  }
  result.matrix()(0, 3) = Scalar(pose.position.x);
  result.matrix()(1, 3) = Scalar(pose.position.y);
  result.matrix()(2, 3) = Scalar(pose.position.z);
  return result;
}

/// What `urdf_description` needs to know while it goes through a model.
template <class Scalar>
class UrdfReader {
 public:
  using Description = typename KinematicTree<Scalar>::Description;

  UrdfReader(const urdf::ModelInterface& model, const UrdfOptions<Scalar>& options,
             const std::string& owner)
      : model_(model), owner_(owner) {
    description_.base = options.base;
    description_.root = model.getRoot()->name;
    for (const auto& locked : options.locked) lock(locked);
    for (const auto& [name, link] : model.links_) {
      if (!link->inertial) continue;
      const urdf::Vector3& c = link->inertial->origin.position;
      description_.masses.push_back(
          {name, Scalar(link->inertial->mass), {Scalar(c.x), Scalar(c.y), Scalar(c.z)}});
    }
    descend(*model.getRoot());
    // Joints that the root does not reach are for the tree to refuse.
    for (const auto& [name, joint] : model.joints_) add(*joint);
  }
  const Description& description() const noexcept { return description_; }

 private:
  void lock(const LockedJoint<Scalar>& locked) {
    const auto found = model_.joints_.find(locked.joint);
    if (found == model_.joints_.end() || found->second->type == urdf::Joint::FIXED) {
      std::vector<std::string> names;
      for (const auto& [name, joint] : model_.joints_) {
        if (joint->type != urdf::Joint::FIXED && !joint->mimic) names.push_back(name);
      }
      invalid(owner_, ": no moving joint '", locked.joint, "' to lock; there are ", listed(names));
    }
    if (found->second->mimic) {
      invalid(owner_, ": joint '", locked.joint, "' follows '", found->second->mimic->joint_name,
              "': lock that one");
    }
    if (!std::isfinite(locked.position)) {
      invalid(owner_, ": joint '", locked.joint, "' is to be locked at ", locked.position);
    }
    if (!locked_.emplace(locked.joint, locked.position).second) {
      invalid(owner_, ": joint '", locked.joint, "' is to be locked twice");
    }
  }

  // Children are in the order of the names of their joints.
  void descend(const urdf::Link& link) {
    for (const auto& joint : link.child_joints) {
      if (!add(*joint)) continue;
      descend(*model_.getLink(joint->child_link_name));
    }
  }

  // Where a joint is locked, and its mimics with it.
  std::optional<Scalar> locked_at(const urdf::Joint& joint) const {
    Scalar multiplier(1), offset(0);
    const urdf::Joint* leader = &joint;
    // A chain of mimics that bites its tail is for the tree to refuse.
    for (std::size_t i = 0; leader->mimic && i < model_.joints_.size(); ++i) {
      offset += multiplier * Scalar(leader->mimic->offset);
      multiplier *= Scalar(leader->mimic->multiplier);
      const auto next = model_.joints_.find(leader->mimic->joint_name);
      if (next == model_.joints_.end()) return std::nullopt;
      leader = next->second.get();
    }
    const auto found = locked_.find(leader->name);
    if (found == locked_.end()) return std::nullopt;
    return multiplier * found->second + offset;
  }

  // Whether the joint is new.
  bool add(const urdf::Joint& from) {
    if (!done_.insert(from.name).second) return false;
    Joint<Scalar> joint{from.name, from.parent_link_name, from.child_link_name, type(from)};
    joint.origin = urdf_pose<Scalar>(from.parent_to_joint_origin_transform);
    if (joint.type != JointType::fixed) {
      const double length = std::hypot(from.axis.x, from.axis.y, from.axis.z);
      if (!(length > 0)) invalid(owner_, ": joint '", from.name, "' has an axis of length 0");
      joint.axis = {Scalar(from.axis.x / length), Scalar(from.axis.y / length),
                    Scalar(from.axis.z / length)};
    }
    const auto position = locked_at(from);
    if (joint.type != JointType::fixed && position) {
      const Vector3<Scalar> none(Scalar(0), Scalar(0), Scalar(0));
      joint.origin = compose(
          joint.origin, joint.type == JointType::prismatic
                            ? make_pose(identity<Matrix3<Scalar>>(3), scaled(joint.axis, *position))
                            : make_pose(axis_rotation<Scalar>(joint.axis, *position), none));
      joint.type = JointType::fixed;
    }
    if (from.limits) set_limits(*from.limits, joint);
    if (from.mimic && joint.type != JointType::fixed) {
      if (!model_.getJoint(from.mimic->joint_name)) {
        invalid(owner_, ": joint '", from.name, "' follows '", from.mimic->joint_name,
                "', and there is no such joint");
      }
      joint.mimic = Mimic<Scalar>{from.mimic->joint_name, Scalar(from.mimic->multiplier),
                                  Scalar(from.mimic->offset)};
    }
    description_.joints.push_back(std::move(joint));
    return true;
  }

  static void set_limits(const auto& limits, Joint<Scalar>& joint) {
    if (limits.lower != 0 || limits.upper != 0) {
      joint.lower = Scalar(limits.lower);
      joint.upper = Scalar(limits.upper);
    }
    if (limits.velocity != 0) joint.max_velocity = Scalar(limits.velocity);
    if constexpr (requires { limits.acceleration; }) {
      if (limits.acceleration != 0) joint.max_acceleration = Scalar(limits.acceleration);
    }
  }

  [[noreturn]] void refuse(const urdf::Joint& joint, const char* type, const char* base,
                           const char* otherwise) const {
    invalid(owner_, ": joint '", joint.name, "' is ", type,
            ": if it carries the robot, take the joint and its parent '", joint.parent_link_name,
            "' out of the file and say UrdfOptions{.base = Base::", base, "}; otherwise ",
            otherwise);
  }
  JointType type(const urdf::Joint& joint) const {
    switch (joint.type) {
      case urdf::Joint::FIXED:
        return JointType::fixed;
      case urdf::Joint::REVOLUTE:
        return JointType::revolute;
      case urdf::Joint::CONTINUOUS:
        return JointType::continuous;
      case urdf::Joint::PRISMATIC:
        return JointType::prismatic;
      case urdf::Joint::FLOATING:
        refuse(joint, "floating", "free()", "make it fixed");
      case urdf::Joint::PLANAR:
        refuse(joint, "planar", "surface()", "write it as two prismatic joints and a revolute one");
      default:
        invalid(owner_, ": joint '", joint.name, "' is of a type that is none of URDF's");
    }
  }

  const urdf::ModelInterface& model_;
  const std::string& owner_;
  std::map<std::string, Scalar> locked_;
  std::set<std::string> done_;
  Description description_;
};

/// What the tree is made of. `owner` begins the text of an error.
template <class Scalar>
typename KinematicTree<Scalar>::Description urdf_description(const std::string& text,
                                                             const UrdfOptions<Scalar>& options,
                                                             const std::string& owner) {
  urdf::ModelInterfaceSharedPtr model;
  std::string messages;
  {
    static std::mutex one_at_a_time;  // one handler of messages is all that console_bridge has
    const std::lock_guard<std::mutex> lock(one_at_a_time);
    UrdfMessages handler;
    model = urdf::parseURDF(text);
    messages = handler.text();
  }
  if (!model || !model->getRoot()) {
    invalid(owner, ": is no URDF", messages.empty() ? "" : ": ", messages);
  }
  return UrdfReader<Scalar>(*model, options, owner).description();
}

template <class Scalar>
KinematicTree<Scalar> urdf_tree(const std::string& text, const UrdfOptions<Scalar>& options,
                                const std::string& owner) {
  const auto description = urdf_description<Scalar>(text, options, owner);
  try {
    return KinematicTree<Scalar>(description);
  } catch (const std::invalid_argument& error) {
    invalid(owner, ": ", error.what());
  }
}

}  // namespace detail

/// The robot that `text` describes, at q = 0, its root on ⟨0⟩. For configuration: allocates.
/// @throws std::invalid_argument on what is no URDF or no tree, planar and floating joints, limits
///         out of order, and joints to lock that there are not; with the names at fault.
template <class Scalar = double>
KinematicTree<Scalar> parse_urdf(const std::string& text, const UrdfOptions<Scalar>& options = {}) {
  return detail::urdf_tree<Scalar>(text, options, "parse_urdf");
}

/// The robot that the file at the path `file` describes. For configuration: reads the file,
/// allocates.
/// @throws std::invalid_argument on a file that cannot be read, and as `parse_urdf`, with the path.
template <class Scalar = double>
KinematicTree<Scalar> load_urdf(const std::string& file, const UrdfOptions<Scalar>& options = {}) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  if (!stream || !(text << stream.rdbuf())) {
    detail::invalid("load_urdf: '", file, "': there is no such file, it is empty or unreadable");
  }
  return detail::urdf_tree<Scalar>(text.str(), options, "load_urdf: '" + file + "'");
}

}  // namespace icat
