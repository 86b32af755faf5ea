// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The messages of ROS 2 that dds.hpp carries, as Cyclone DDS wants them described: the samples in
/// memory, and a program for its interpreter (dds_opcodes.h) that checks, turns and writes them,
/// which is else made of IDL by idlc. Structures within structures are written flat, which is the
/// same in CDR. Without XTypes' description, so that types match by their names, as ROS 2's do.
#pragma once

#include <dds/dds.h>

#include <cstddef>
#include <cstdint>

namespace icat::detail::dds {

struct JointStateSample {
  std::int32_t sec;
  std::uint32_t nanosec;
  char* frame_id;
  dds_sequence_t name, position, velocity, effort;
};
struct OdometrySample {
  std::int32_t sec;
  std::uint32_t nanosec;
  char* frame_id;
  char* child_frame_id;
  double numbers[85];  // position 3, orientation 4, covariance 36, twist 6, covariance 36
};
struct TwistSample {
  double numbers[6];
};
struct DimensionSample {
  char* label;
  std::uint32_t size, stride;
};
struct MultiArraySample {
  dds_sequence_t dim;
  std::uint32_t data_offset;
  dds_sequence_t data;
};

template <class... Parts>
constexpr std::uint32_t op(Parts... parts) noexcept {
  return (static_cast<std::uint32_t>(parts) | ...);
}
inline constexpr std::uint32_t integer_op = op(DDS_OP_ADR, DDS_OP_TYPE_4BY);
inline constexpr std::uint32_t string_op = op(DDS_OP_ADR, DDS_OP_TYPE_STR);
inline constexpr std::uint32_t strings_op = op(DDS_OP_ADR, DDS_OP_TYPE_SEQ, DDS_OP_SUBTYPE_STR);
inline constexpr std::uint32_t doubles_op =
    op(DDS_OP_ADR, DDS_OP_TYPE_SEQ, DDS_OP_SUBTYPE_8BY, DDS_OP_FLAG_FP);
inline constexpr std::uint32_t array_op =
    op(DDS_OP_ADR, DDS_OP_TYPE_ARR, DDS_OP_SUBTYPE_8BY, DDS_OP_FLAG_FP);

// clang-format off
inline constexpr std::uint32_t joint_state_ops[] = {
    op(integer_op, DDS_OP_FLAG_SGN), offsetof(JointStateSample, sec),
    integer_op, offsetof(JointStateSample, nanosec),
    string_op, offsetof(JointStateSample, frame_id),
    strings_op, offsetof(JointStateSample, name),
    doubles_op, offsetof(JointStateSample, position),
    doubles_op, offsetof(JointStateSample, velocity),
    doubles_op, offsetof(JointStateSample, effort),
    DDS_OP_RTS};
inline constexpr std::uint32_t odometry_ops[] = {
    op(integer_op, DDS_OP_FLAG_SGN), offsetof(OdometrySample, sec),
    integer_op, offsetof(OdometrySample, nanosec),
    string_op, offsetof(OdometrySample, frame_id),
    string_op, offsetof(OdometrySample, child_frame_id),
    array_op, offsetof(OdometrySample, numbers), 85,
    DDS_OP_RTS};
inline constexpr std::uint32_t twist_ops[] = {
    array_op, offsetof(TwistSample, numbers), 6,
    DDS_OP_RTS};
inline constexpr std::uint32_t multi_array_ops[] = {
    // The elements' program begins 4 words from here, that of the next member 11.
    op(DDS_OP_ADR, DDS_OP_TYPE_SEQ, DDS_OP_SUBTYPE_STU), offsetof(MultiArraySample, dim),
        sizeof(DimensionSample), (11u << 16u) + 4u,
    string_op, offsetof(DimensionSample, label),
    integer_op, offsetof(DimensionSample, size),
    integer_op, offsetof(DimensionSample, stride),
    DDS_OP_RTS,
    integer_op, offsetof(MultiArraySample, data_offset),
    doubles_op, offsetof(MultiArraySample, data),
    DDS_OP_RTS};
// clang-format on

template <class Sample, std::size_t N>
constexpr dds_topic_descriptor_t describe_type(const char* name, const std::uint32_t (&ops)[N],
                                               std::uint32_t instructions,
                                               std::uint32_t flags) noexcept {
  return {sizeof(Sample), alignof(Sample), flags, 0, name, nullptr, instructions, ops, "",
          {nullptr, 0},   {nullptr, 0},    0};
}
inline constexpr dds_topic_descriptor_t joint_state_type =
    describe_type<JointStateSample>("sensor_msgs::msg::dds_::JointState_", joint_state_ops, 8, 0);
inline constexpr dds_topic_descriptor_t odometry_type =
    describe_type<OdometrySample>("nav_msgs::msg::dds_::Odometry_", odometry_ops, 6, 0);
inline constexpr dds_topic_descriptor_t twist_type = describe_type<TwistSample>(
    "geometry_msgs::msg::dds_::Twist_", twist_ops, 2, DDS_TOPIC_FIXED_SIZE);
inline constexpr dds_topic_descriptor_t multi_array_type = describe_type<MultiArraySample>(
    "std_msgs::msg::dds_::Float64MultiArray_", multi_array_ops, 8, 0);

}  // namespace icat::detail::dds
