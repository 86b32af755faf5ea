// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The concepts of a robot that tasks and controllers use: a velocity of n columns, frames that
/// move with it, joints with limits, and a base.
///
///     ẏ = [q̇; v] ∈ Rⁿ                       in the papers' order; the order is the robot's own
///     twist of ⟨f⟩ = J_f ẏ                   6 × n, [linear; angular] at the origin of ⟨f⟩, on ⟨0⟩
///     twist of the base, on itself = B v     B constant, 6 × k: motions of the base
///
/// A task requires only those of these concepts that it needs, and names no type of robot. A
/// robot's `update` is not among them: what a state is differs from robot to robot.
#pragma once

#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "icat/core/error.hpp"
#include "icat/core/list.hpp"
#include "icat/core/pose.hpp"
#include "icat/core/types.hpp"

namespace icat {

/// A frame of a robot, looked up by name once, at configuration.
class FrameId {
 public:
  /// For robots: the `index`-th of their frames.
  constexpr explicit FrameId(Index index) noexcept : index_(index) {}
  /// The same, called `name`: a task of a robot that has another frame at this index refuses it.
  constexpr FrameId(Index index, std::string_view name) noexcept
      : index_(index), mark_(mark_of(name)) {}
  /// As given at construction.
  constexpr Index index() const noexcept { return index_; }
  /// Whether it may be a frame called `name`; true where it was made without a name.
  constexpr bool may_be(std::string_view name) const noexcept {
    return mark_ == 0 || mark_ == mark_of(name);
  }
  /// The same frame, both of one robot.
  friend constexpr bool operator==(FrameId a, FrameId b) noexcept { return a.index_ == b.index_; }

 private:
  // FNV-1a, which is 0 for one name of four billion.
  static constexpr std::uint32_t mark_of(std::string_view name) noexcept {
    std::uint32_t mark = 2166136261u;
    for (const char c : name) mark = (mark ^ static_cast<unsigned char>(c)) * 16777619u;
    return mark;
  }

  Index index_;
  std::uint32_t mark_{0};
};

/// Columns `first`, `first` + 1, … of ẏ.
struct ColumnRange {
  Index first{0};  ///< in [0, n)
  Index count{0};  ///< how many
  /// Whether column `c` is one of them.
  constexpr bool holds(Index c) const noexcept { return c >= first && c < first + count; }
};

/// What a robot says of a joint.
template <class Scalar>
struct JointInfo {
  std::string name;                           ///< unique
  Index column;                               ///< of ẏ, where q̇ stands
  Scalar lower{-infinity<Scalar>};            ///< rad or m
  Scalar upper{infinity<Scalar>};             ///< rad or m
  Scalar max_velocity{infinity<Scalar>};      ///< rad/s or m/s
  Scalar max_acceleration{infinity<Scalar>};  ///< rad/s² or m/s²
  bool continuous{false};                     ///< turns without end: q and q + 2π are the same
};

namespace detail {

/// A value of just this type, or a reference to one: tasks and controllers compute with what they
/// get, and a type that would only convert to `U` may store its elements in another order.
template <class T, class U>
concept Just = std::same_as<std::remove_cvref_t<T>, U>;

}  // namespace detail

/// A scalar type and the number of degrees of freedom n, at compile time (`size`, or
/// `Eigen::Dynamic`) and at run time.
template <class R>
concept Robot = requires(const R& robot) {
  typename R::Scalar;
  requires std::floating_point<typename R::Scalar>;
  requires(!std::is_member_pointer_v<decltype(&R::size)>);  // static: GCC 12 stops on another
  typename std::integral_constant<int, R::size>;
  { robot.dof() } -> std::convertible_to<Index>;
};

/// Frames: `frame` throws `std::invalid_argument` with the names there are; `pose` is ⟨f⟩ in ⟨0⟩;
/// `jacobian` is 6 × n, at the origin of ⟨f⟩, components on ⟨0⟩. Both are of the last `update`, and
/// neither throws nor allocates.
template <class R>
concept FramedRobot = Robot<R> && requires(const R& robot, FrameId frame, std::string_view name) {
  { robot.frame(name) } -> std::same_as<FrameId>;
  { robot.pose(frame) } -> detail::Just<Pose<typename R::Scalar>>;
  { robot.jacobian(frame) } -> detail::Just<Eigen::Matrix<typename R::Scalar, 6, R::size>>;
};

/// Joints: `joints` is a range of `JointInfo` that the robot keeps, such as `const std::vector&` or
/// `std::span<const JointInfo>`; `position(i)` is that of the i-th, rad or m.
template <class R>
concept JointedRobot = Robot<R> && requires(const R& robot, Index i, std::size_t k) {
  { robot.joints().size() } -> std::convertible_to<std::size_t>;
  { robot.joints()[k] } -> std::same_as<const JointInfo<typename R::Scalar>&>;
  { *robot.joints().begin() } -> std::same_as<const JointInfo<typename R::Scalar>&>;
  { robot.joints().begin() != robot.joints().end() } -> std::convertible_to<bool>;
  { robot.position(i) } -> std::convertible_to<typename R::Scalar>;
};

/// A base: its frame, its columns and B.
template <class R>
concept MobileRobot = FramedRobot<R> && requires(const R& robot, Index i) {
  { robot.base() } -> std::same_as<FrameId>;
  { robot.base_columns() } -> detail::Just<ColumnRange>;
  { robot.base_motion()(i, i) } -> std::convertible_to<typename R::Scalar>;
  { robot.base_motion().cols() } -> std::convertible_to<Index>;
};

/// Masses: their sum (kg), the centre of mass in ⟨0⟩ (m) and its Jacobian, 3 × n.
template <class R>
concept MassiveRobot = Robot<R> && requires(const R& robot) {
  { robot.mass() } -> std::convertible_to<typename R::Scalar>;
  { robot.center_of_mass() } -> detail::Just<Vector3<typename R::Scalar>>;
  {
    robot.center_of_mass_jacobian()
    } -> detail::Just<Eigen::Matrix<typename R::Scalar, 3, R::size>>;
};

/// A set of columns of ẏ, in the order given. Configuration: allocates.
class Columns {
 public:
  /// None.
  Columns() {}  // not defaulted: see `infinity`
  /// These; two numbers are two columns, not a block.
  Columns(std::initializer_list<Index> indices) : Columns({indices.begin(), indices.size()}) {}
  /// These.
  explicit Columns(std::span<const Index> indices) : indices_(indices.size()) {
    for (std::size_t i = 0; i < indices.size(); ++i) indices_[i] = indices[i];
  }
  /// A block.
  Columns(ColumnRange range)  // NOLINT: a block is a set
      : indices_(static_cast<std::size_t>(range.count)) {
    for (Index i = 0; i < range.count; ++i) {
      indices_[static_cast<std::size_t>(i)] = range.first + i;
    }
  }
  /// How many.
  Index size() const noexcept { return static_cast<Index>(indices_.size()); }
  /// The i-th.
  Index operator[](Index i) const noexcept { return indices_[static_cast<std::size_t>(i)]; }
  /// For loops.
  auto begin() const noexcept { return indices_.begin(); }
  /// For loops.
  auto end() const noexcept { return indices_.end(); }

 private:
  List<Index> indices_;
};

namespace detail {

/// Makes "'a', 'b', 'c'" of it, for messages.
[[gnu::cold]] inline void append_name(std::string& list, std::string_view name) {
  list.append(list.empty() ? "'" : ", '").append(name).append("'");
}
template <class Names>
[[gnu::cold]] std::string listed(const Names& names) {
  std::string text;
  for (const auto& name : names) append_name(text, name);
  return text;
}

/// Which of `items`, frames or joints, is called `name`; −1 where there is none. No allocation.
template <class Items>
Index index_of(const Items& items, std::string_view name) noexcept {
  Index i = 0;
  for (const auto& item : items) {
    if (item.name == name) return i;
    ++i;
  }
  return -1;
}
/// The same; `what` they are and `owner` are for the error.
/// @throws std::invalid_argument with the names there are.
template <class Items>
[[gnu::cold]] Index look_up(const Items& items, std::string_view name, const char* what,
                            std::string_view owner = "") {
  const Index i = index_of(items, name);
  if (i >= 0) return i;
  std::string names;
  for (const auto& item : items) append_name(names, item.name);
  invalid(owner, owner.empty() ? "" : ": ", "no ", what, " '", name, "'; there are ", names);
}

/// How errors call a task.
[[gnu::cold]] inline std::string task_called(std::string_view name) {
  std::string text("task '");
  text.append(name).append("'");
  return text;
}

/// The column of the joint called `name`; −1 where there is none. No allocation.
template <JointedRobot R>
Index column_of(const R& robot, std::string_view name) noexcept {
  const Index i = index_of(robot.joints(), name);
  return i < 0 ? i : robot.joints()[static_cast<std::size_t>(i)].column;
}

/// Whether `frame` may be one of the robot's. Only a robot that counts and names its frames can
/// refuse: it has fewer frames, or another one at this index. No allocation.
template <FramedRobot R>
bool may_have(const R& robot, FrameId frame) noexcept {
  if constexpr (requires { FrameId(robot.frame_count(), robot.frame_name(frame)); }) {
    return frame.index() >= 0 && frame.index() < robot.frame_count() &&
           frame.may_be(robot.frame_name(frame));
  } else {
    return true;
  }
}
/// @throws std::invalid_argument with the `task`'s name unless the robot may have the frame.
template <FramedRobot R>
[[gnu::cold]] void check_frame(const R& robot, FrameId frame, std::string_view task) {
  if (!may_have(robot, frame)) {
    invalid("task '", task, "': the frame was looked up in another robot");
  }
}

/// @throws std::invalid_argument on a column that is not the robot's, or one that stands twice.
[[gnu::cold]] inline void check_columns(const std::string& owner, const Columns& columns,
                                        Index dof) {
  for (Index i = 0; i < columns.size(); ++i) {
    const Index c = columns[i];
    if (c < 0 || c >= dof) {
      invalid(owner, ": column ", c, " is not among the robot's ", dof);
    }
    for (Index k = 0; k < i; ++k) {
      if (columns[k] == c) invalid(owner, ": column ", c, " stands twice");
    }
  }
}

}  // namespace detail

/// Which of `robot.joints()` is called `name`; `owner` begins the error. For configuration.
/// @throws std::invalid_argument with the names there are.
template <JointedRobot R>
[[gnu::cold]] Index joint_index(const R& robot, std::string_view name,
                                std::string_view owner = "") {
  return detail::look_up(robot.joints(), name, "joint", owner);
}

/// The indices of the joints called `names`; `owner` begins the error. For configuration.
/// @throws std::invalid_argument on a name that stands twice, or that there is not, with those that
///         there are.
template <JointedRobot R>
[[gnu::cold]] List<Index> joint_indices(const R& robot, const std::vector<std::string>& names,
                                        std::string_view owner = "") {
  List<Index> indices;
  for (const auto& name : names) {
    const Index i = joint_index(robot, name, owner);
    for (const Index other : indices) {
      if (other == i) {
        detail::invalid(owner, owner.empty() ? "" : ": ", "joint '", name, "' stands twice");
      }
    }
    indices.push_back(i);
  }
  return indices;
}

/// The columns of all joints. For configuration.
template <JointedRobot R>
[[gnu::cold]] Columns joint_columns(const R& robot) {
  List<Index> columns;
  for (const auto& joint : robot.joints()) columns.push_back(joint.column);
  return Columns({columns.data(), columns.size()});
}
/// The columns of the joints called `names`, none where there are none; `owner` begins the error.
/// For configuration.
/// @throws std::invalid_argument as `joint_indices`.
template <JointedRobot R>
[[gnu::cold]] Columns joint_columns(const R& robot, const std::vector<std::string>& names,
                                    std::string_view owner = "") {
  List<Index> columns;
  for (const Index i : joint_indices(robot, names, owner)) {
    columns.push_back(robot.joints()[static_cast<std::size_t>(i)].column);
  }
  return Columns({columns.data(), columns.size()});
}

}  // namespace icat
