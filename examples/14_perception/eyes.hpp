// SPDX-License-Identifier: BSD-3-Clause
// From a pair of images to a pose and its error.
#pragma once

#include <icat/adapters/opencv.hpp>
#include <icat/perception/cylinder_pose.hpp>

#include "scene.hpp"

namespace perception {

inline const Condition clear_day = conditions()[0], clear_night = conditions()[1];

using Pair = std::array<cv::Mat, 2>;  ///< left, right

/// Renders pairs.
class Rig {
 public:
  explicit Rig(const icat::StereoCamera<double>& cameras, std::uint64_t seed = 1)
      : cameras_(cameras), sensor_(seed) {}
  const icat::StereoCamera<double>& cameras() const { return cameras_; }
  static cv::Size size(const icat::PinholeCamera<double>& k) {
    return {int(k.width), int(k.height)};
  }

  /// What both cameras see, under each of `conditions`. `camera` is ⟨c⟩ in ⟨0⟩.
  std::vector<Pair> take(const Pool& pool, const Pose& camera,
                         std::span<const Condition> conditions) {
    std::vector<Pair> pairs(conditions.size());
    for (std::size_t k = 0; k < 2; ++k) {
      const auto& seen = renderer_.render(pool, camera * cameras_[k].pose, size(cameras_[k]),
                                          PinholeRays(cameras_[k]));
      std::size_t i = 0;
      for (const Condition& c : conditions) {
        pairs[i++][k] =
            sensor_.take(seen, size(cameras_[k]), camera.translation().z(), c.water, c.light);
      }
    }
    return pairs;
  }
  Pair take(const Pool& pool, const Pose& camera, const Condition& condition = clear_day) {
    return take(pool, camera, std::span(&condition, 1))[0];
  }

 private:
  icat::StereoCamera<double> cameras_;
  Renderer renderer_;
  Sensor sensor_;
};

/// Both finders and the estimator.
class Eyes {
 public:
  explicit Eyes(const icat::StereoCamera<double>& cameras)
      : finders_{icat::PipeContours(Rig::size(cameras[0]), 0),
                 icat::PipeContours(Rig::size(cameras[1]), 1)},
        pose_(cameras) {}

  //! [mask]
  /// The arm in both images; none without hulls.
  void mask(const icat::ArmOutline<double>& arm) {
    for (std::size_t k = 0; k < 2; ++k) {
      finders_[k].clear_mask();
      for (const auto& hull : arm[k]) {
        if (!hull.corners().empty()) (void)finders_[k].add_mask(hull.corners());
      }
    }
  }
  //! [mask]

  //! [look]
  /// `gravity` is on ⟨c⟩.
  icat::Status look(const Pair& pictures, const Vector3& gravity,
                    icat::CylinderMeasurement<double>& pipe) {
    count_ = 0;
    for (std::size_t k = 0; k < 2; ++k) {
      if (finders_[k].find(pictures[k]) != icat::Status::ok) continue;
      for (const auto& line : finders_[k].lines()) lines_[count_++] = line;
    }
    return pose_.measure({lines_.data(), count_}, gravity, pipe);
  }
  //! [look]

  const icat::PipeContours& finder(std::size_t k) const { return finders_[k]; }
  std::span<const icat::ContourLine<double>> lines() const { return {lines_.data(), count_}; }

 private:
  std::array<icat::PipeContours, 2> finders_;
  icat::CylinderPose<double> pose_;
  std::array<icat::ContourLine<double>, 2 * icat::PipeContours::most> lines_;
  std::size_t count_ = 0;
};

/// m, rad. A pipe has no front: the axis is compared, not its sense.
struct PoseError {
  double across, along, angle;
};
inline PoseError error_of(const icat::CylinderMeasurement<double>& found, const Pose& camera,
                          const Pose& pipe) {
  const Pose truth = camera.inverse() * pipe;
  const Vector3 d = truth.linear().col(1), e = found.frame.linear().col(1);
  const Vector3 off = found.frame.translation() - truth.translation();
  const double along = d.dot(off);
  // Of the found axis, beside the middle of the true one.
  const Vector3 at = off - (along / d.dot(e)) * e;
  return {at.norm(), std::abs(along), std::asin(std::min(1.0, d.cross(e).norm()))};
}

inline Vector3 gravity_on(const Pose& camera) {
  return camera.linear().transpose() * Vector3(0, 0, 1);
}

}  // namespace perception
