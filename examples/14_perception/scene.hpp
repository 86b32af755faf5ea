// SPDX-License-Identifier: BSD-3-Clause
// The vehicle with its arm and its cameras over a pipe in a pool.
#pragma once

#include <icat/model/maris.hpp>
#include <icat/model/uvms.hpp>
#include <icat/perception/arm_mask.hpp>

#include "../support/geometry.hpp"
#include "renderer.hpp"

namespace perception {

using Robot = icat::KinematicTree<double, 13>;

/// A part of the arm in a frame of it, m: what is drawn, and what the mask has a box around.
struct Part {
  const char* frame;
  Vector3 from, to;
  double radius;
};
inline const std::array<Part, 5> arm_parts{{{"link1", {0, 0, 0}, {0, 0, 0.283}, 0.08},
                                            {"link3", {0, 0, 0}, {-0.1455, 0, 0.4315}, 0.07},
                                            {"link5", {0, 0, 0}, {0, 0, 0.42}, 0.06},
                                            {"link7", {0, 0, 0}, {0, 0, 0.10}, 0.055},
                                            {"link7", {0, -0.06, 0.12}, {0, 0.06, 0.14}, 0.03}}};

/// ⟨c⟩ in ⟨v⟩: at the bow, looking down and 17° aft; the arm comes in from below. Ours.
inline Pose camera_mount() {
  Pose mount = Pose::Identity();
  mount.linear().col(0) = Vector3(0, 1, 0);
  mount.linear().col(2) = Vector3(-0.2924, 0, 0.9563);
  mount.linear().col(1) = mount.linear().col(2).cross(mount.linear().col(0));
  mount.translation() = Vector3(0.75, -0.125, 0.30);
  return mount;
}

inline Robot make_robot() {
  return icat::uvms(icat::maris_arm<double>(),
                    {.arm = icat::maris_arm_mount<double>(), .camera = camera_mount()});
}

/// A box around each part, grown by 1 cm: the arm is known as well as that.
inline std::vector<icat::FrameBox<double>> arm_boxes(const Robot& robot) {
  std::vector<icat::FrameBox<double>> boxes;
  for (const Part& p : arm_parts) {
    const Vector3 margin = Vector3::Constant(p.radius + 0.01);
    boxes.push_back(
        {robot.frame(p.frame), p.from.cwiseMin(p.to) - margin, p.from.cwiseMax(p.to) + margin});
  }
  return boxes;
}

/// Adds the arm as `robot` has it. `sleeve`: the forearm has the colour that the pipe has from
/// further away, where water took more of the red.
inline void add_arm(Pool& pool, const Robot& robot, bool sleeve = false) {
  for (const Part& p : arm_parts) {
    const Pose pose = robot.pose(robot.frame(p.frame));
    const bool forearm = std::string_view(p.frame) == "link5";
    pool.rods.push_back({from(pose * p.from), from(pose * p.to), p.radius,
                         sleeve && forearm ? Albedo{0.56f, 0.52f, 0.05f} : dark, false});
  }
}

/// A pipe on the floor that the left camera looks at from `range` (m), moved in the picture by
/// `ahead` and `right` (m) and turned by `yaw` in it; ⟨o⟩ in ⟨0⟩, where ⟨c⟩ is `camera`.
struct View {
  Pose camera, pipe;
};
inline View look_at_pipe(double floor, double range, double yaw, double right = 0,
                         double ahead = 0) {
  View view;
  view.camera = camera_mount();
  view.pipe = Pose::Identity();
  view.pipe.linear() = icat::axis_rotation<double>(Vector3(0, 0, 1), yaw);
  view.pipe.translation() = Vector3(0, 0, floor - 0.08);
  const Vector3 middle = 0.125 * view.camera.linear().col(0) + range * view.camera.linear().col(2);
  view.camera.translation() = view.pipe.translation() - middle + Vector3(ahead, right, 0);
  return view;
}

}  // namespace perception
