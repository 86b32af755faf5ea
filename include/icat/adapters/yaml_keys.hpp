// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The keys that a configuration may have: one table, of which the parser takes what it accepts,
/// yaml_schema.hpp the schema for editors, and docs/configuration.md its list. Keys of tasks are in
/// yaml_task_keys.hpp.
#pragma once

#include <cstddef>

namespace icat::detail {

/// What a number measures, and so which units may stand behind it.
enum class Unit {
  none,
  length,
  angle,
  time,
  rate,
  speed,
  turn,
  mass,
  joint,               // rad or m, as the joint turns or slides
  joint_speed,         // rad/s or m/s
  joint_acceleration,  // rad/s^2 or m/s^2
};

/// Which numbers are taken.
enum class Range { any, positive, not_negative };

/// What stands behind a key.
enum class Value {
  number,
  integer,
  boolean,
  text,
  choice,        // one of `choices`
  vector,        // three numbers
  numbers,       // a list of numbers
  per_joint,     // a number for all joints, or a list with one for each
  joint_values,  // a list with one for each joint, or numbers by the names of joints
  names,         // a list of words
  axes,          // a list of x, y, z
  pose,          // a pose, or a list of poses, each on the axes of the one before
  goal_pose,     // a pose, or 'here'
  goal_point,    // three numbers, or 'here'
  goal_turn,     // a rotation, or 'here'
  objective,     // keys of objective_section, in the unit of the key
  section,       // keys of `section`
  sections,      // a list of such
  some,          // one such, or a list
  named,         // such by names
  levels,        // by names: a list of tasks, or of lists of tasks of equal priority
  pairs,         // a list of lists of two words
  tasks,         // by names: the keys of their type
};

struct ConfigSection;

/// A key, see the file comment.
struct ConfigKey {
  const char* name;
  Value value;
  const char* about;  // a few words for editors and the page
  Unit unit{Unit::none};
  Range range{Range::any};
  bool required{false};
  bool live{false};                       // may change at run time
  const ConfigSection* section{nullptr};  // what stands below
  const char* choices{""};                // words with spaces between
};

/// Keys that stand together.
struct ConfigSection {
  const char* name;       // in errors and the schema
  const ConfigKey* keys;  // the first of `count`
  std::size_t count;
  const char* one_of{""};  // words with spaces between: exactly one of these keys must be there
};

template <std::size_t N>
constexpr ConfigSection section_of(const char* name, const ConfigKey (&keys)[N],
                                   const char* one_of = "") {
  return {name, keys, N, one_of};
}

// clang-format off
namespace config {

inline constexpr bool needed = true;
inline constexpr Range any = Range::any, positive = Range::positive, from_0 = Range::not_negative;

inline constexpr ConfigKey axis_angle_keys[] = {
    {"axis", Value::vector, "unit vector", Unit::none, any, needed},
    {"angle", Value::number, "angle of rotation about the axis", Unit::angle, any, needed}};
inline constexpr ConfigSection axis_angle_section = section_of("axis_angle", axis_angle_keys);
inline constexpr ConfigKey quaternion_keys[] = {
    {"w", Value::number, "real part", Unit::none, any, needed},
    {"x", Value::number, "the quaternion has norm 1", Unit::none, any, needed},
    {"y", Value::number, "the quaternion has norm 1", Unit::none, any, needed},
    {"z", Value::number, "the quaternion has norm 1", Unit::none, any, needed}};
inline constexpr ConfigSection quaternion_section = section_of("quaternion", quaternion_keys);
inline constexpr ConfigKey pose_keys[] = {
    {"position", Value::vector, "m; required unless the pose is in a list", Unit::length},
    {"rpy", Value::vector, "roll, pitch, yaw: rotation by yaw about z, then by pitch about the new y, then by roll about the new x", Unit::angle},
    {"axis_angle", Value::section, "rotation about an axis", Unit::none, any, false, false, &axis_angle_section},
    {"quaternion", Value::section, "rotation by a unit quaternion", Unit::none, any, false, false, &quaternion_section}};
inline constexpr ConfigSection pose_section = section_of("pose", pose_keys);

inline constexpr ConfigKey objective_keys[] = {
    {"equal_to", Value::number, "x must equal this", Unit::none},
    {"at_least", Value::number, "minimum of x", Unit::none},
    {"at_most", Value::number, "maximum of x; with at_least: a range", Unit::none},
    {"margin", Value::number, "distance from the limit at which the task becomes active; required except for equal_to", Unit::none, positive},
    {"toward", Value::number, "reference point; default: the near edge of the margin", Unit::none}};
inline constexpr ConfigSection objective_section = section_of("objective", objective_keys);
inline constexpr ConfigKey norms_keys[] = {
    {"position", Value::objective, "objective on the distance", Unit::length, any, needed},
    {"orientation", Value::objective, "objective on the angle", Unit::angle, any, needed}};
inline constexpr ConfigSection norms_section = section_of("norms", norms_keys);

// --- robot

inline constexpr const char* bases = "fixed free surface differential_drive";

inline constexpr ConfigKey uvms_keys[] = {
    {"arm", Value::choice, "the arm", Unit::none, any, needed, false, nullptr, "maris"},
    {"arm_mount", Value::pose, "the arm's base on the vehicle; default: that of the MARIS arm"},
    {"camera", Value::pose, "on the vehicle; it looks along its z axis; default: at the vehicle's origin"},
    {"tool", Value::pose, "on the end-effector; default: at its origin"}};
inline constexpr ConfigSection uvms_section = section_of("uvms", uvms_keys);
inline constexpr ConfigKey urdf_keys[] = {
    {"file", Value::text, "path, from the folder of this file", Unit::none, any, needed},
    {"base", Value::choice, "motions of the root link; default: fixed", Unit::none, any, false, false, nullptr, bases},
    {"locked", Value::joint_values, "joints to be fixed, by their names, and their positions", Unit::joint}};
inline constexpr ConfigSection urdf_section = section_of("urdf", urdf_keys);
inline constexpr ConfigKey mimic_keys[] = {
    {"joint", Value::text, "the joint that is followed", Unit::none, any, needed},
    {"multiplier", Value::number, "default: 1"},
    {"offset", Value::number, "default: 0", Unit::joint}};
inline constexpr ConfigSection mimic_section = section_of("mimic", mimic_keys);
inline constexpr ConfigKey joint_keys[] = {
    {"name", Value::text, "of the joint", Unit::none, any, needed},
    {"parent", Value::text, "link that carries it", Unit::none, any, needed},
    {"link", Value::text, "link that it moves", Unit::none, any, needed},
    {"type", Value::choice, "default: revolute", Unit::none, any, false, false, nullptr, "fixed revolute continuous prismatic"},
    {"origin", Value::pose, "pose of its frame in the parent's; default: identity"},
    {"axis", Value::vector, "unit vector on its frame; default: z"},
    {"lower", Value::number, "default: no limit", Unit::joint},
    {"upper", Value::number, "default: no limit", Unit::joint},
    {"max_velocity", Value::number, "default: no limit", Unit::joint_speed, positive},
    {"max_acceleration", Value::number, "default: no limit", Unit::joint_acceleration, positive},
    {"mimic", Value::section, "the joint follows another joint", Unit::none, any, false, false, &mimic_section}};
inline constexpr ConfigSection joint_section = section_of("joint", joint_keys);
inline constexpr ConfigKey mass_keys[] = {
    {"link", Value::text, "name of the link", Unit::none, any, needed},
    {"mass", Value::number, "of the link", Unit::mass, from_0, needed},
    {"center", Value::vector, "centre of mass on the link", Unit::length, any, needed}};
inline constexpr ConfigSection mass_section = section_of("mass", mass_keys);
inline constexpr ConfigKey tree_keys[] = {
    {"base", Value::choice, "motions of the root link; default: fixed", Unit::none, any, false, false, nullptr, bases},
    {"root", Value::text, "name of the root link; required if there are no joints"},
    {"joints", Value::sections, "in any order", Unit::none, any, false, false, &joint_section},
    {"masses", Value::sections, "of some links", Unit::none, any, false, false, &mass_section}};
inline constexpr ConfigSection tree_section = section_of("tree", tree_keys);
inline constexpr ConfigKey frame_keys[] = {
    {"parent", Value::text, "frame to which it is fixed", Unit::none, any, needed},
    {"pose", Value::pose, "in the parent", Unit::none, any, needed}};
inline constexpr ConfigSection frame_section = section_of("frame", frame_keys);
inline constexpr ConfigKey robot_keys[] = {
    {"uvms", Value::section, "the papers' robot: a vehicle with an arm", Unit::none, any, false, false, &uvms_section},
    {"urdf", Value::section, "a robot from a URDF", Unit::none, any, false, false, &urdf_section},
    {"tree", Value::section, "a robot described in this file", Unit::none, any, false, false, &tree_section},
    {"frames", Value::named, "additional frames", Unit::none, any, false, false, &frame_section}};
inline constexpr ConfigSection robot_section = section_of("robot", robot_keys, "uvms urdf tree");

// --- start, limits, controller, plant

inline constexpr ConfigKey start_keys[] = {
    {"q", Value::joint_values, "positions of joints; default: 0", Unit::joint},
    {"base", Value::pose, "of the base; default: at the origin of the world"}};
inline constexpr ConfigSection start_section = section_of("start", start_keys);
inline constexpr ConfigKey joint_limit_keys[] = {
    {"lower", Value::number, "default: the robot's", Unit::joint},
    {"upper", Value::number, "default: the robot's", Unit::joint},
    {"max_velocity", Value::number, "default: the robot's", Unit::joint_speed, positive},
    {"max_acceleration", Value::number, "default: the robot's", Unit::joint_acceleration, positive}};
inline constexpr ConfigSection joint_limit_section = section_of("limits of a joint", joint_limit_keys);
inline constexpr ConfigKey limits_keys[] = {
    {"unlimited", Value::boolean, "true: no limits at all; excludes all other keys here"},
    {"reaction_time", Value::number, "time from a measured state to the end of the motion commanded for it; default: 0.1 s", Unit::time, positive},
    {"max_velocity", Value::number, "of every joint; a joint's own limit holds if it is less", Unit::joint_speed, positive},
    {"max_acceleration", Value::number, "likewise", Unit::joint_acceleration, positive},
    {"joints", Value::named, "in place of the robot's own, by the names of joints", Unit::none, any, false, false, &joint_limit_section},
    {"base_velocity", Value::numbers, "of the base's columns, one each", Unit::none, positive},
    {"base_acceleration", Value::numbers, "likewise", Unit::none, positive}};
inline constexpr ConfigSection limits_section = section_of("limits", limits_keys);
inline constexpr ConfigKey regularization_keys[] = {
    {"lambda", Value::number, "height of the bell; default: 0.0001", Unit::none, positive},
    {"threshold", Value::number, "squared singular values above it are inverted exactly; default: 0.01", Unit::none, positive}};
inline constexpr ConfigSection regularization_section = section_of("regularization", regularization_keys);
inline constexpr ConfigKey bounds_keys[] = {
    {"joints", Value::per_joint, "of each; default: unbounded", Unit::joint_speed, positive},
    {"base", Value::numbers, "of the base's columns, one each; default: unbounded", Unit::none, positive}};
inline constexpr ConfigSection bounds_section = section_of("velocity_bounds", bounds_keys);
inline constexpr ConfigKey controller_keys[] = {
    {"kind", Value::choice, "default: whole_body; parallel: the joints compensate the tracking error of the base", Unit::none, any, false, false, nullptr, "whole_body parallel"},
    {"given", Value::names, "columns that are not commanded: 'joints', 'base', or names of joints and of the base's columns"},
    {"regularization", Value::section, "of the solver", Unit::none, any, false, false, &regularization_section},
    {"projection_weight", Value::number, "default: 1, as in the paper", Unit::none, positive},
    {"velocity_bounds", Value::section, "of the solver, in both directions", Unit::none, any, false, false, &bounds_section},
    {"saturation", Value::choice, "of a level at the bounds; default: scale, as published", Unit::none, any, false, false, nullptr, "scale continuous_scale redistribute"},
    {"max_step", Value::number, "longest period of the loop; default: 0.1 s", Unit::time, positive},
    {"hold", Value::number, "a fault that lasts longer stops the robot; default: 0.1 s", Unit::time, positive},
    {"ramp", Value::number, "duration in which the command then goes to zero, and returns; default: 0.5 s", Unit::time, positive},
    {"characteristic_length", Value::number, "rows in metres are divided by it; default: the reach of the tasks' frames; 1: as in the papers", Unit::length, positive}};
inline constexpr ConfigSection controller_section = section_of("controller", controller_keys);
inline constexpr ConfigKey current_keys[] = {
    {"velocity", Value::vector, "in the world; the amplitude if there is a period", Unit::speed, any, needed},
    {"period", Value::number, "of a sine that begins at 0; default: constant", Unit::time, positive}};
inline constexpr ConfigSection current_section = section_of("current", current_keys);
inline constexpr ConfigKey plant_keys[] = {
    {"tracking_lag", Value::number, "of the base; default: 0", Unit::time, from_0},
    {"not_actuated", Value::names, "columns that do not follow commands, named as in 'given'"},
    {"current", Value::section, "carries a free base along", Unit::none, any, false, false, &current_section}};
inline constexpr ConfigSection plant_section = section_of("plant", plant_keys);

// --- mission

inline constexpr ConfigKey condition_keys[] = {
    {"task", Value::text, "the task whose error is tested"},
    {"position", Value::number, "error of the task's position, less than this", Unit::length, positive},
    {"orientation", Value::number, "error of the task's orientation, less than this", Unit::angle, positive},
    {"angle", Value::number, "of attitude, look_at and occlusion, less than this", Unit::angle, positive},
    {"joints", Value::number, "largest error of joint_position, less than this", Unit::joint, positive},
    {"holds", Value::boolean, "true: the objective of manipulability or frame_distance holds"},
    {"settled", Value::boolean, "true: no action is being entered"}};
inline constexpr ConfigSection condition_section = section_of("condition", condition_keys);
inline constexpr ConfigKey reaction_keys[] = {
    {"event", Value::text, "name of the event", Unit::none, any, needed},
    {"to", Value::text, "the phase that follows", Unit::none, any, needed},
    {"times", Value::integer, "maximum number of times; default: no limit", Unit::none, from_0},
    {"otherwise", Value::text, "the phase that follows after these times"}};
inline constexpr ConfigSection reaction_section = section_of("reaction", reaction_keys);
inline constexpr ConfigKey phase_keys[] = {
    {"name", Value::text, "in reports and in other phases", Unit::none, any, needed},
    {"action", Value::text, "the action that runs; default: the controller stops"},
    {"fade", Value::number, "duration of the transition into the action, or to a stop; default: 2 s", Unit::time, positive},
    {"until", Value::some, "the phase ends when all conditions are met", Unit::none, any, false, false, &condition_section},
    {"hold", Value::number, "time for which 'until' must be met; default: 0", Unit::time, from_0},
    {"then", Value::text, "the phase that follows"},
    {"time_limit", Value::number, "a phase that lasts longer is ended; default: no limit", Unit::time, positive},
    {"on_timeout", Value::text, "the phase that follows the time limit"},
    {"events", Value::sections, "phases that follow events", Unit::none, any, false, false, &reaction_section},
    {"end", Value::choice, "the mission ends here", Unit::none, any, false, false, nullptr, "success failure"}};
inline constexpr ConfigSection phase_section = section_of("phase", phase_keys);
inline constexpr ConfigKey mission_keys[] = {
    {"phases", Value::sections, "the mission begins with the first", Unit::none, any, needed, false, &phase_section},
    {"always", Value::sections, "phases that follow events in every phase that does not list the event", Unit::none, any, false, false, &reaction_section},
    {"max_step", Value::number, "longest period; default: 1 s", Unit::time, positive}};
inline constexpr ConfigSection mission_section = section_of("mission", mission_keys);

// --- all

inline constexpr ConfigKey top_keys[] = {
    {"about", Value::text, "description for readers"},
    {"period", Value::number, "of the loop; default: 0.01 s", Unit::time, positive},
    {"robot", Value::section, "the robot", Unit::none, any, needed, false, &robot_section},
    {"start", Value::section, "the initial state", Unit::none, any, false, false, &start_section},
    {"limits", Value::section, "hard motion limits; default: the robot's own", Unit::none, any, false, false, &limits_section},
    {"controller", Value::section, "the kinematic controller", Unit::none, any, false, false, &controller_section},
    {"plant", Value::section, "the simulated robot", Unit::none, any, false, false, &plant_section},
    {"tasks", Value::tasks, "tasks by their names", Unit::none, any, needed},
    {"actions", Value::levels, "actions by their names, the highest priority first", Unit::none, any, needed},
    {"mission", Value::section, "phases that follow events", Unit::none, any, false, false, &mission_section}};
inline constexpr ConfigSection top_section = section_of("configuration", top_keys);

}  // namespace config
// clang-format on

using config::objective_section;
using config::pose_section;
using config::top_section;

}  // namespace icat::detail
