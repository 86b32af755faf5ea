// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The action by which the trials grasped [MARIS, III-B7], its seven levels, the highest first:
///
///     1  joint limits
///     2  manipulability of the arm
///     3  elbow out of the camera's view
///     4  camera centred on the object
///     5  position of the tool
///     6  orientation of the tool: the position has priority over it
///     7  preferred shape of the arm
///
/// The camera measures in frames that move with the vehicle. So goals are given in these frames,
/// with the vehicle's pose at the time of the image, and are held in ⟨0⟩ until the next image:
///
///     ⁰T_g = ⁰T_v(t_picture) ᵛT_g,     ⁰p_l = ⁰T_v(t_picture) ᵛT_c ᶜp_l
///
/// The paper prints no threshold and no gain: all of `Options` are ours.
#pragma once

#include "icat/action/action.hpp"
#include "icat/task/direction_tasks.hpp"
#include "icat/task/frame_tasks.hpp"
#include "icat/task/joint_tasks.hpp"
#include "icat/task/manipulability.hpp"

namespace icat {

/// Frames of a robot that grasps.
struct GraspFrames {
  FrameId tool;    ///< comes to the goal
  FrameId elbow;   ///< stays out of view
  FrameId camera;  ///< fixed to the vehicle, looks along its z axis
};

/// The seven tasks and their order. They may stand in other actions too. Construction allocates and
/// throws; nothing else does.
template <FramedRobot R>
requires JointedRobot<R> && MobileRobot<R>
class MarisGrasp {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;
  /// One entry for each joint, rad or m.
  using Positions = Vector<Scalar, Eigen::Dynamic>;

  /// Thresholds and gains.
  struct Options {
    Scalar joint_margin = static_cast<Scalar>(0.2);            ///< rad or m
    Scalar manipulability = static_cast<Scalar>(0.05);         ///< at least, m³
    Scalar manipulability_margin = static_cast<Scalar>(0.04);  ///< m³
    Scalar view = static_cast<Scalar>(0.35);        ///< half the cone that the elbow keeps off, rad
    Scalar view_margin = static_cast<Scalar>(0.1);  ///< rad
    Scalar centering = static_cast<Scalar>(0.2);    ///< angle of the object from z, at most, rad
    Scalar centering_margin = static_cast<Scalar>(0.1);  ///< rad
    Scalar gain = static_cast<Scalar>(0.5);              ///< of levels 1 to 6, 1/s
    Scalar shape_gain = static_cast<Scalar>(0.2);        ///< of level 7, 1/s
    Scalar linear_rate = static_cast<Scalar>(0.1);       ///< of the tool, m/s
    Scalar angular_rate = static_cast<Scalar>(0.2);      ///< of the tool and the camera, rad/s
  };

  /// Until the first picture the goal is where the tool is, and the object straight ahead of the
  /// camera. `preferred`: the shape, one entry for each joint. `robot` must outlive this.
  /// @throws std::invalid_argument on settings out of range, or a camera that a joint moves.
  [[gnu::cold]] MarisGrasp(const R& robot, const GraspFrames& frames, const Positions& preferred)
      : MarisGrasp(robot, frames, preferred, Options{}) {}
  /// The same with options.
  [[gnu::cold]] MarisGrasp(const R& robot, const GraspFrames& frames, const Positions& preferred,
                           Options options)
      : joint_limits(robot, {.margin = options.joint_margin, .gain = options.gain}),
        manipulability(
            robot, frames.tool,
            Objective<Scalar>::at_least(options.manipulability, options.manipulability_margin),
            {.gain = options.gain}),
        occlusion(
            robot, frames.camera, frames.elbow,
            Objective<Scalar>::at_least(options.view, options.view_margin),
            {.name = "elbow occlusion", .gain = options.gain, .max_rate = options.angular_rate}),
        centering(robot, frames.camera, ahead(robot.pose(frames.camera)),
                  {.name = "camera centering",
                   .norm = Objective<Scalar>::at_most(options.centering, options.centering_margin),
                   .gain = options.gain,
                   .max_rate = options.angular_rate}),
        position(robot, frames.tool, detail::origin(robot.pose(frames.tool)),
                 {.name = "tool position", .gain = options.gain, .max_rate = options.linear_rate}),
        orientation(
            robot, frames.tool, detail::rotation(robot.pose(frames.tool)),
            {.name = "tool orientation", .gain = options.gain, .max_rate = options.angular_rate}),
        shape(robot, preferred, {.name = "preferred shape", .gain = options.shape_gain}),
        camera_(frames.camera) {
    const auto J = robot.jacobian(frames.camera);
    for (Index c = 0; c < robot.dof(); ++c) {
      for (Index i = 0; i < 6 && !robot.base_columns().holds(c); ++i) {
        if (!(std::abs(J(i, c)) < Scalar(1e-6))) {
          detail::invalid("MarisGrasp: column ", c, " moves the camera");
        }
      }
    }
  }

  /// The levels of the file comment.
  [[gnu::cold]] Action<R> action(const std::string& name = "grasp") {
    return {name,
            {{joint_limits},
             {manipulability},
             {occlusion},
             {centering},
             {position},
             {orientation},
             {shape}}};
  }

  /// A measurement from an image: ⟨g⟩ in ⟨v⟩, and ⟨v⟩ in ⟨0⟩ at the time of the image. If it is not
  /// finite, or no rotation, it is refused, and the previous goal stays.
  Status see_grasp(const Pose<Scalar>& grasp_in_vehicle, const Pose<Scalar>& vehicle) noexcept {
    if (!detail::all_finite(grasp_in_vehicle.matrix()) || !detail::all_finite(vehicle.matrix())) {
      return Status::non_finite;
    }
    if (!is_rigid(grasp_in_vehicle) || !is_rigid(vehicle)) return Status::not_a_rotation;
    const Pose<Scalar> goal = detail::compose(vehicle, grasp_in_vehicle);
    const Status status = orientation.set_goal(detail::rotation(goal));
    return status == Status::ok ? position.set_goal(detail::origin(goal)) : status;
  }
  /// A picture: the point to keep in view on ⟨c⟩ (m), such as one end of a pipe, and ⟨v⟩ in ⟨0⟩
  /// when it was taken. Refused as in `see_grasp`.
  Status see_object(const Vector3<Scalar>& point_in_camera, const Pose<Scalar>& vehicle) noexcept {
    if (!detail::all_finite(point_in_camera) || !detail::all_finite(vehicle.matrix())) {
      return Status::non_finite;
    }
    if (!is_rigid(vehicle)) return Status::not_a_rotation;
    const R& robot = centering.robot();
    const Vector3<Scalar> world =
        detail::transform(Pose<Scalar>(robot.pose(camera_)), point_in_camera);
    // ᵛp_l by the present poses of vehicle and camera, of which one sits on the other.
    const Pose<Scalar> now = robot.pose(robot.base());
    const Vector3<Scalar> in_vehicle =
        detail::transposed_times(detail::rotation(now), detail::minus(world, detail::origin(now)));
    return centering.set_target(detail::transform(vehicle, in_vehicle));
  }

  // The tasks, for other actions, and to be set while they run. Of `position`, `orientation` and
  // `centering` the goals are those of the pictures.
  task::JointLimits<R> joint_limits;       ///< level 1
  task::Manipulability<R> manipulability;  ///< level 2
  task::Occlusion<R> occlusion;            ///< level 3
  task::LookAt<R> centering;               ///< level 4
  task::FramePosition<R> position;         ///< level 5
  task::FrameOrientation<R> orientation;   ///< level 6
  task::JointPosition<R> shape;            ///< level 7

 private:
  static Vector3<Scalar> ahead(const Pose<Scalar>& camera) noexcept {
    return detail::transform(camera, Vector3<Scalar>(Scalar(0), Scalar(0), Scalar(1)));
  }

  FrameId camera_;
};

}  // namespace icat
