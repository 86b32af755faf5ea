// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The keys of each type of task in a configuration, see yaml_keys.hpp.
#pragma once

#include "icat/adapters/yaml_keys.hpp"

namespace icat::detail {

// clang-format off
namespace config {

inline constexpr bool live = true;
#define ICAT_CONFIG_GAIN \
  {"type", Value::text, "of the task", Unit::none, any, needed}, \
  {"gain", Value::number, "of the error; none: 1", Unit::rate, positive, false, live}
#define ICAT_CONFIG_SCALAR(unit_of_value, unit_of_rate) \
  {"max_rate", Value::number, "largest rate; none: no limit", unit_of_rate, positive, false, live}, \
  {"objective", Value::objective, "what the value is to do", unit_of_value, any, needed, live}
#define ICAT_CONFIG_NORM(what, unit_of_norm) \
  {"norm", Value::objective, what, unit_of_norm, any, false, live}
#define ICAT_CONFIG_JOINTS \
  {"joints", Value::names, "by name; none: all"}
#define ICAT_CONFIG_FRAME \
  {"frame", Value::text, "the frame that is controlled", Unit::none, any, needed}
#define ICAT_CONFIG_RELATIVE \
  {"relative_to", Value::text, "frame that the goal is given in; none: the world"}, \
  {"axes_of", Value::choice, "whose axes count; none: reference", Unit::none, any, false, false, nullptr, "reference frame"}

inline constexpr ConfigKey move_keys[] = {
    {"from", Value::number, "when it begins, on the clock of the loop", Unit::time, any, needed},
    {"to", Value::number, "when it ends, at rest", Unit::time, any, needed},
    {"by", Value::vector, "how far the goal moves, on the reference", Unit::length, any, needed}};
inline constexpr ConfigSection move_section = section_of("move", move_keys);
#define ICAT_CONFIG_MOVES \
  {"moves", Value::sections, "of the goal over time, added up", Unit::none, any, false, false, &move_section}

inline constexpr ConfigKey body_keys[] = {
    {"name", Value::text, "for pairs", Unit::none, any, needed},
    {"frame", Value::text, "that it moves with", Unit::none, any, needed},
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
    {"point", Value::vector, "on it, in the world", Unit::length, any, needed},
    {"normal", Value::vector, "out of it, of length 1", Unit::none, any, needed}};
inline constexpr ConfigSection plane_section = section_of("plane", plane_keys);
inline constexpr ConfigKey box_keys[] = {
    {"pose", Value::pose, "of its centre", Unit::none, any, needed},
    {"size", Value::vector, "lengths of its edges", Unit::length, positive, needed}};
inline constexpr ConfigSection box_section = section_of("box", box_keys);
inline constexpr ConfigKey obstacle_keys[] = {
    {"sphere", Value::section, "a ball", Unit::none, any, false, false, &sphere_section},
    {"capsule", Value::section, "a segment with a radius", Unit::none, any, false, false, &capsule_section},
    {"plane", Value::section, "what is behind a plane", Unit::none, any, false, false, &plane_section},
    {"box", Value::section, "a box", Unit::none, any, false, false, &box_section}};
inline constexpr ConfigSection obstacle_section = section_of("obstacle", obstacle_keys, "sphere capsule plane box");
#define ICAT_CONFIG_CLEARANCE \
  {"bodies", Value::sections, "of the robot", Unit::none, any, needed, false, &body_section}, \
  {"bulge", Value::number, "how much thicker a capsule is in its middle, in its lengths; none: 0.02", Unit::none, positive}

inline constexpr ConfigKey joint_limits_keys[] = {ICAT_CONFIG_GAIN, ICAT_CONFIG_JOINTS,
    {"margin", Value::per_joint, "active so far before a limit; none: 0.1", Unit::joint, positive, false, live},
    {"to_middle", Value::boolean, "true: pull to the middle of the range"},
    {"max_rate", Value::per_joint, "none: no limit", Unit::joint_speed, positive, false, live}};
inline constexpr ConfigKey joint_position_keys[] = {ICAT_CONFIG_GAIN, ICAT_CONFIG_JOINTS,
    {"goal", Value::joint_values, "of each of its joints", Unit::joint, any, needed, live},
    ICAT_CONFIG_NORM("objective on the distance from the goal; none: each joint to its own", Unit::joint),
    {"max_rate", Value::per_joint, "none: no limit", Unit::joint_speed, positive, false, live}};
inline constexpr ConfigKey frame_pose_keys[] = {ICAT_CONFIG_GAIN, ICAT_CONFIG_FRAME, ICAT_CONFIG_RELATIVE,
    {"goal", Value::goal_pose, "in the reference; 'here': where it is at the start", Unit::none, any, needed, live},
    {"linear", Value::axes, "of the position; none: all"},
    {"angular", Value::axes, "of the orientation; none: all"},
    {"norms", Value::section, "one row for the distance, one for the angle", Unit::none, any, false, live, &norms_section},
    {"max_linear_rate", Value::number, "none: no limit", Unit::speed, positive, false, live},
    {"max_angular_rate", Value::number, "none: no limit", Unit::turn, positive, false, live},
    ICAT_CONFIG_MOVES};
inline constexpr ConfigKey frame_position_keys[] = {ICAT_CONFIG_GAIN, ICAT_CONFIG_FRAME, ICAT_CONFIG_RELATIVE,
    {"goal", Value::goal_point, "in the reference; 'here': where it is at the start", Unit::length, any, needed, live},
    {"axes", Value::axes, "that count; none: all"},
    ICAT_CONFIG_NORM("objective on the distance; none: each axis", Unit::length),
    {"max_rate", Value::number, "none: no limit", Unit::speed, positive, false, live},
    ICAT_CONFIG_MOVES};
inline constexpr ConfigKey frame_orientation_keys[] = {ICAT_CONFIG_GAIN, ICAT_CONFIG_FRAME, ICAT_CONFIG_RELATIVE,
    {"goal", Value::goal_turn, "a pose without position; 'here': as it is at the start", Unit::none, any, needed, live},
    {"axes", Value::axes, "that count; none: all"},
    ICAT_CONFIG_NORM("objective on the angle; none: each axis", Unit::angle),
    {"max_rate", Value::number, "none: no limit", Unit::turn, positive, false, live}};
inline constexpr ConfigKey frame_velocity_keys[] = {
    {"type", Value::text, "of the task", Unit::none, any, needed}, ICAT_CONFIG_FRAME,
    {"relative_to", Value::text, "the reference; none: the world"},
    {"axes_of", Value::choice, "whose axes count; none: frame", Unit::none, any, false, false, nullptr, "reference frame"},
    {"linear", Value::axes, "of the linear velocity; none: all"},
    {"angular", Value::axes, "of the angular velocity; none: all"},
    {"linear_velocity", Value::vector, "none: 0", Unit::speed, any, false, live},
    {"angular_velocity", Value::vector, "none: 0", Unit::turn, any, false, live}};
inline constexpr ConfigKey attitude_keys[] = {ICAT_CONFIG_GAIN, ICAT_CONFIG_FRAME,
    {"axis", Value::vector, "of length 1, on the frame; none: z"},
    {"world_axis", Value::vector, "of length 1, on the world; none: z", Unit::none, any, false, live},
    ICAT_CONFIG_NORM("objective on the angle; none: two rows, to zero", Unit::angle),
    {"max_rate", Value::number, "none: no limit", Unit::turn, positive, false, live}};
inline constexpr ConfigKey look_at_keys[] = {ICAT_CONFIG_GAIN,
    {"camera", Value::text, "frame of the camera", Unit::none, any, needed},
    {"target", Value::vector, "in the world", Unit::length, any, false, live},
    {"target_frame", Value::text, "or a frame of the robot"},
    {"axis", Value::vector, "of length 1, on the camera; none: z"},
    ICAT_CONFIG_NORM("objective on the angle; none: two rows, to zero", Unit::angle),
    {"max_rate", Value::number, "none: no limit", Unit::turn, positive, false, live}};
inline constexpr ConfigKey occlusion_keys[] = {ICAT_CONFIG_GAIN, ICAT_CONFIG_FRAME,
    {"camera", Value::text, "frame of the camera", Unit::none, any, needed},
    {"axis", Value::vector, "of length 1, on the camera; none: z"},
    ICAT_CONFIG_SCALAR(Unit::angle, Unit::turn)};
inline constexpr ConfigKey frame_distance_keys[] = {ICAT_CONFIG_GAIN, ICAT_CONFIG_FRAME,
    {"point", Value::vector, "in the world", Unit::length, any, false, live},
    {"other_frame", Value::text, "or a frame of the robot"},
    ICAT_CONFIG_SCALAR(Unit::length, Unit::speed)};
inline constexpr ConfigKey center_of_mass_keys[] = {ICAT_CONFIG_GAIN,
    {"goal", Value::goal_point, "in the world; 'here': where it is at the start", Unit::length, any, needed, live},
    {"axes", Value::axes, "that count; none: all"},
    {"max_rate", Value::number, "none: no limit", Unit::speed, positive, false, live}};
inline constexpr ConfigKey manipulability_keys[] = {ICAT_CONFIG_GAIN, ICAT_CONFIG_FRAME, ICAT_CONFIG_JOINTS,
    ICAT_CONFIG_SCALAR(Unit::none, Unit::none)};
inline constexpr ConfigKey clearance_keys[] = {ICAT_CONFIG_GAIN, ICAT_CONFIG_CLEARANCE,
    {"obstacles", Value::sections, "in the world; their number stays", Unit::none, any, needed, live, &obstacle_section},
    ICAT_CONFIG_SCALAR(Unit::length, Unit::speed)};
inline constexpr ConfigKey self_clearance_keys[] = {ICAT_CONFIG_GAIN, ICAT_CONFIG_CLEARANCE,
    {"pairs", Value::pairs, "of names of bodies", Unit::none, any, needed},
    ICAT_CONFIG_SCALAR(Unit::length, Unit::speed)};
inline constexpr ConfigKey minimality_keys[] = {
    {"type", Value::text, "of the task", Unit::none, any, needed},
    {"columns", Value::names, "'joints', 'base', or names of joints and of the base's columns", Unit::none, any, needed}};
inline constexpr ConfigKey given_velocity_keys[] = {
    {"type", Value::text, "of the task", Unit::none, any, needed},
    {"columns", Value::names, "'joints', 'base', or names of joints and of the base's columns", Unit::none, any, needed},
    {"velocity", Value::numbers, "of each column; none: 0", Unit::none, any, false, live}};

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

#undef ICAT_CONFIG_GAIN
#undef ICAT_CONFIG_SCALAR
#undef ICAT_CONFIG_NORM
#undef ICAT_CONFIG_JOINTS
#undef ICAT_CONFIG_FRAME
#undef ICAT_CONFIG_RELATIVE
#undef ICAT_CONFIG_MOVES
#undef ICAT_CONFIG_CLEARANCE

}  // namespace icat::detail
