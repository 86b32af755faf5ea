// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The keys of each type of task in a configuration, see yaml_keys.hpp.
#pragma once

#include "icat/adapters/yaml_keys.hpp"

namespace icat::detail {

// clang-format off
namespace config {

inline constexpr bool live = true;
inline constexpr ConfigKey type_key{"type", Value::text, "of the task", Unit::none, any, needed};
inline constexpr ConfigKey gain_key{"gain", Value::number, "of the error; default: 1", Unit::rate, positive, false, live};
inline constexpr ConfigKey joints_key{"joints", Value::names, "names of joints; default: all"};
inline constexpr ConfigKey frame_key{"frame", Value::text, "the frame that is controlled", Unit::none, any, needed};
inline constexpr ConfigKey relative_key{"relative_to", Value::text, "reference frame of the goal; default: the world"};
inline constexpr ConfigKey axes_of_key{"axes_of", Value::choice, "frame whose axes are used; default: reference", Unit::none, any, false, false, nullptr, "reference frame"};
constexpr ConfigKey objective_key(Unit unit) {
  return {"objective", Value::objective, "objective on the controlled value", unit, any, needed, live};
}
constexpr ConfigKey norm_key(const char* about, Unit unit) {
  return {"norm", Value::objective, about, unit, any, false, live};
}
constexpr ConfigKey max_rate_key(Unit unit, Value value = Value::number) {
  return {"max_rate", value, "default: no limit", unit, positive, false, live};
}

inline constexpr ConfigKey move_keys[] = {
    {"from", Value::number, "start time, on the clock of the loop", Unit::time, any, needed},
    {"to", Value::number, "end time; the goal is then at rest", Unit::time, any, needed},
    {"by", Value::vector, "displacement of the goal, on the reference", Unit::length, any, needed}};
inline constexpr ConfigSection move_section = section_of("move", move_keys);
inline constexpr ConfigKey moves_key{"moves", Value::sections, "motions of the goal over time, added", Unit::none, any, false, false, &move_section};

inline constexpr ConfigKey body_keys[] = {
    {"name", Value::text, "name used in pairs", Unit::none, any, needed},
    {"frame", Value::text, "frame to which it is fixed", Unit::none, any, needed},
    {"center", Value::vector, "of a sphere, on the frame", Unit::length},
    {"from", Value::vector, "one end of a capsule, on the frame", Unit::length},
    {"to", Value::vector, "the other end", Unit::length},
    {"radius", Value::number, "of the sphere or capsule", Unit::length, positive, needed}};
inline constexpr ConfigSection body_section = section_of("body", body_keys);
inline constexpr ConfigKey sphere_keys[] = {
    {"center", Value::vector, "in the world", Unit::length, any, needed},
    {"radius", Value::number, "of the sphere", Unit::length, positive, needed}};
inline constexpr ConfigSection sphere_section = section_of("sphere", sphere_keys);
inline constexpr ConfigKey capsule_keys[] = {
    {"from", Value::vector, "one end, in the world", Unit::length, any, needed},
    {"to", Value::vector, "the other end", Unit::length, any, needed},
    {"radius", Value::number, "of the capsule", Unit::length, positive, needed}};
inline constexpr ConfigSection capsule_section = section_of("capsule", capsule_keys);
inline constexpr ConfigKey plane_keys[] = {
    {"point", Value::vector, "a point of the plane, in the world", Unit::length, any, needed},
    {"normal", Value::vector, "unit vector out of the obstacle", Unit::none, any, needed}};
inline constexpr ConfigSection plane_section = section_of("plane", plane_keys);
inline constexpr ConfigKey box_keys[] = {
    {"pose", Value::pose, "of its centre", Unit::none, any, needed},
    {"size", Value::vector, "lengths of its edges", Unit::length, positive, needed}};
inline constexpr ConfigSection box_section = section_of("box", box_keys);
inline constexpr ConfigKey obstacle_keys[] = {
    {"sphere", Value::section, "a sphere", Unit::none, any, false, false, &sphere_section},
    {"capsule", Value::section, "a segment with a radius", Unit::none, any, false, false, &capsule_section},
    {"plane", Value::section, "the half-space behind a plane", Unit::none, any, false, false, &plane_section},
    {"box", Value::section, "a box", Unit::none, any, false, false, &box_section}};
inline constexpr ConfigSection obstacle_section = section_of("obstacle", obstacle_keys, "sphere capsule plane box");
inline constexpr ConfigKey bodies_key{"bodies", Value::sections, "of the robot", Unit::none, any, needed, false, &body_section};
inline constexpr ConfigKey bulge_key{"bulge", Value::number, "by how much a capsule is thicker in its middle, as a fraction of its length; default: 0.02", Unit::none, positive};

inline constexpr ConfigKey joint_limits_keys[] = {type_key, gain_key, joints_key,
    {"margin", Value::per_joint, "distance from a limit at which the task becomes active; default: 0.1", Unit::joint, positive, false, live},
    {"to_middle", Value::boolean, "true: the reference point is the middle of the range"},
    max_rate_key(Unit::joint_speed, Value::per_joint)};
inline constexpr ConfigKey joint_position_keys[] = {type_key, gain_key, joints_key,
    {"goal", Value::joint_values, "of each of its joints", Unit::joint, any, needed, live},
    norm_key("objective on the distance from the goal; default: one row for each joint", Unit::joint),
    max_rate_key(Unit::joint_speed, Value::per_joint)};
inline constexpr ConfigKey frame_pose_keys[] = {type_key, gain_key, frame_key, relative_key, axes_of_key,
    {"goal", Value::goal_pose, "in the reference; 'here': that of the frame at the start", Unit::none, any, needed, live},
    {"linear", Value::axes, "controlled axes of the position; default: all"},
    {"angular", Value::axes, "controlled axes of the orientation; default: all"},
    {"norms", Value::section, "one row for the distance, one for the angle", Unit::none, any, false, live, &norms_section},
    {"max_linear_rate", Value::number, "default: no limit", Unit::speed, positive, false, live},
    {"max_angular_rate", Value::number, "default: no limit", Unit::turn, positive, false, live},
    moves_key};
inline constexpr ConfigKey frame_position_keys[] = {type_key, gain_key, frame_key, relative_key, axes_of_key,
    {"goal", Value::goal_point, "in the reference; 'here': that of the frame at the start", Unit::length, any, needed, live},
    {"axes", Value::axes, "axes that are controlled; default: all"},
    norm_key("objective on the distance; default: one row for each axis", Unit::length),
    max_rate_key(Unit::speed),
    moves_key};
inline constexpr ConfigKey frame_orientation_keys[] = {type_key, gain_key, frame_key, relative_key, axes_of_key,
    {"goal", Value::goal_turn, "a pose without position; 'here': its orientation at the start", Unit::none, any, needed, live},
    {"axes", Value::axes, "axes that are controlled; default: all"},
    norm_key("objective on the angle; default: one row for each axis", Unit::angle),
    max_rate_key(Unit::turn)};
inline constexpr ConfigKey frame_velocity_keys[] = {
    type_key, frame_key,
    {"relative_to", Value::text, "the reference; default: the world"},
    {"axes_of", Value::choice, "frame whose axes are used; default: frame", Unit::none, any, false, false, nullptr, "reference frame"},
    {"linear", Value::axes, "controlled axes of the linear velocity; default: all"},
    {"angular", Value::axes, "controlled axes of the angular velocity; default: all"},
    {"linear_velocity", Value::vector, "default: 0", Unit::speed, any, false, live},
    {"angular_velocity", Value::vector, "default: 0", Unit::turn, any, false, live}};
inline constexpr ConfigKey attitude_keys[] = {type_key, gain_key, frame_key,
    {"axis", Value::vector, "unit vector on the frame; default: z"},
    {"world_axis", Value::vector, "unit vector in the world; default: z", Unit::none, any, false, live},
    norm_key("objective on the angle; default: two rows, to zero", Unit::angle),
    max_rate_key(Unit::turn)};
inline constexpr ConfigKey look_at_keys[] = {type_key, gain_key,
    {"camera", Value::text, "frame of the camera", Unit::none, any, needed},
    {"target", Value::vector, "in the world", Unit::length, any, false, live},
    {"target_frame", Value::text, "or a frame of the robot"},
    {"axis", Value::vector, "unit vector on the camera; default: z"},
    norm_key("objective on the angle; default: two rows, to zero", Unit::angle),
    max_rate_key(Unit::turn)};
inline constexpr ConfigKey occlusion_keys[] = {type_key, gain_key, frame_key,
    {"camera", Value::text, "frame of the camera", Unit::none, any, needed},
    {"axis", Value::vector, "unit vector on the camera; default: z"},
    max_rate_key(Unit::turn), objective_key(Unit::angle)};
inline constexpr ConfigKey frame_distance_keys[] = {type_key, gain_key, frame_key,
    {"point", Value::vector, "in the world", Unit::length, any, false, live},
    {"other_frame", Value::text, "or a frame of the robot"},
    max_rate_key(Unit::speed), objective_key(Unit::length)};
inline constexpr ConfigKey center_of_mass_keys[] = {type_key, gain_key,
    {"goal", Value::goal_point, "in the world; 'here': its position at the start", Unit::length, any, needed, live},
    {"axes", Value::axes, "axes that are controlled; default: all"},
    max_rate_key(Unit::speed)};
inline constexpr ConfigKey manipulability_keys[] = {type_key, gain_key, frame_key, joints_key,
    max_rate_key(Unit::none), objective_key(Unit::none)};
inline constexpr ConfigKey clearance_keys[] = {type_key, gain_key, bodies_key, bulge_key,
    {"obstacles", Value::sections, "in the world; their number may not change", Unit::none, any, needed, live, &obstacle_section},
    max_rate_key(Unit::speed), objective_key(Unit::length)};
inline constexpr ConfigKey self_clearance_keys[] = {type_key, gain_key, bodies_key, bulge_key,
    {"pairs", Value::pairs, "pairs of names of bodies", Unit::none, any, needed},
    max_rate_key(Unit::speed), objective_key(Unit::length)};
inline constexpr ConfigKey minimality_keys[] = {
    type_key,
    {"columns", Value::names, "'joints', 'base', or names of joints and of the base's columns", Unit::none, any, needed}};
inline constexpr ConfigKey given_velocity_keys[] = {
    type_key,
    {"columns", Value::names, "'joints', 'base', or names of joints and of the base's columns", Unit::none, any, needed},
    {"velocity", Value::numbers, "of each column; default: 0", Unit::none, any, false, live}};

/// All types of tasks; a section's name is the type.
inline constexpr ConfigSection task_sections[] = {
    section_of("joint_limits", joint_limits_keys), section_of("joint_position", joint_position_keys),
    section_of("frame_pose", frame_pose_keys), section_of("frame_position", frame_position_keys),
    section_of("frame_orientation", frame_orientation_keys), section_of("frame_velocity", frame_velocity_keys),
    section_of("attitude", attitude_keys), section_of("look_at", look_at_keys, "target target_frame"),
    section_of("occlusion", occlusion_keys), section_of("frame_distance", frame_distance_keys, "point other_frame"),
    section_of("center_of_mass", center_of_mass_keys), section_of("manipulability", manipulability_keys),
    section_of("clearance", clearance_keys), section_of("self_clearance", self_clearance_keys),
    section_of("minimality", minimality_keys), section_of("given_velocity", given_velocity_keys)};

}  // namespace config
// clang-format on

using config::task_sections;

}  // namespace icat::detail
