// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The region of the arm in both images, from the joints' positions [MARIS, IV]: lines in it are no
/// contours of the object. Boxes on frames of the robot stand for the arm; the corners of each are
/// projected by ᶜT_f = (⁰T_c)⁻¹ ⁰T_f, and their convex hull is the mask. Of a box that is partly
/// behind the camera the part in front is taken. Which boxes is up to the user; the paper prints
/// none.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "icat/core/status.hpp"
#include "icat/model/robot.hpp"
#include "icat/perception/camera.hpp"

namespace icat {

/// A convex polygon in an image; without points it holds nothing.
template <class Scalar>
class ImageHull {
 public:
  /// A box cut by a plane has at most so many corners and cuts together.
  static constexpr int most = 20;

  /// The hull of `points`, px; of more than `most` the first ones. Points of which one is not
  /// finite have no hull. No allocation.
  void set(std::span<const Pixel<Scalar>> points) noexcept {
    count_ = 0;
    std::array<Pixel<Scalar>, most> p;
    const int n = static_cast<int>(std::min<std::size_t>(points.size(), most));
    for (int i = 0; i < n; ++i) {
      if (!detail::all_finite(points[static_cast<std::size_t>(i)])) return;
      p[static_cast<std::size_t>(i)] = points[static_cast<std::size_t>(i)];
    }
    std::sort(p.begin(), p.begin() + n, [](const Pixel<Scalar>& a, const Pixel<Scalar>& b) {
      return a(0) < b(0) || (a(0) == b(0) && a(1) < b(1));
    });
    // Andrew's monotone chain: below from left to right, above from right to left.
    for (int half = 0; half < 2; ++half) {
      const int base = count_;
      for (int k = 0; k < n; ++k) {
        const Pixel<Scalar>& next = p[static_cast<std::size_t>(half == 0 ? k : n - 1 - k)];
        while (count_ - base >= 2 && turn(corner(count_ - 2), corner(count_ - 1), next) <= 0) {
          --count_;
        }
        corners_[static_cast<std::size_t>(count_++)] = next;
      }
      if (n > 1) --count_;  // the first one of the other half
    }
    if (count_ < 3) count_ = 0;
  }
  /// Holds nothing from now on.
  void clear() noexcept { count_ = 0; }
  /// Corners, in the sense that turns x to y.
  std::span<const Pixel<Scalar>> corners() const noexcept {
    return {corners_.data(), static_cast<std::size_t>(count_)};
  }
  /// Whether it holds the point, its edge included; false for NaN. No allocation.
  bool contains(const Pixel<Scalar>& p) const noexcept {
    for (int i = 0; i < count_; ++i) {
      if (!(turn(corner(i), corner((i + 1) % count_), p) >= Scalar(0))) return false;
    }
    return count_ > 0;
  }
  /// The part of a segment that it holds, between the shares `low` and `high` of the way. False
  /// where it holds none. No allocation.
  bool covers(const Pixel<Scalar>& from, const Pixel<Scalar>& to, Scalar& low,
              Scalar& high) const noexcept {
    low = Scalar(0), high = Scalar(1);
    if (count_ == 0) return false;
    for (int i = 0; i < count_; ++i) {
      const Pixel<Scalar>& a = corner(i);
      const Pixel<Scalar>& b = corner((i + 1) % count_);
      if (!detail::clip(turn(a, b, from), turn(a, b, to), low, high)) return false;
    }
    return true;
  }
  /// The point of its edge nearest to `p`; `p` where there is no hull. No allocation.
  Pixel<Scalar> nearest_edge(const Pixel<Scalar>& p) const noexcept {
    Pixel<Scalar> best = p;
    Scalar least = infinity<Scalar>;
    for (int i = 0; i < count_; ++i) {
      const Pixel<Scalar>& a = corner(i);
      const Pixel<Scalar>& b = corner((i + 1) % count_);
      const Scalar x = b(0) - a(0), y = b(1) - a(1);
      const Scalar s = ((p(0) - a(0)) * x + (p(1) - a(1)) * y) / (x * x + y * y);
      const Pixel<Scalar> q = detail::on_segment(a, b, std::clamp(s, Scalar(0), Scalar(1)));
      const Scalar d = std::hypot(q(0) - p(0), q(1) - p(1));
      if (d < least) {
        least = d;
        best = q;
      }
    }
    return best;
  }

 private:
  const Pixel<Scalar>& corner(int i) const noexcept {
    return corners_[static_cast<std::size_t>(i)];
  }
  // > 0 where a, b, c turn as x to y does.
  static Scalar turn(const Pixel<Scalar>& a, const Pixel<Scalar>& b,
                     const Pixel<Scalar>& c) noexcept {
    return (b(0) - a(0)) * (c(1) - a(1)) - (b(1) - a(1)) * (c(0) - a(0));
  }

  std::array<Pixel<Scalar>, most + 2> corners_;
  int count_{0};
};

/// Hulls in the left and the right image.
template <class Scalar>
using ArmOutline = std::array<std::vector<ImageHull<Scalar>>, 2>;

/// A box that moves with a frame, sides parallel to the axes of it.
template <class Scalar>
struct FrameBox {
  FrameId frame;          ///< of the robot
  Vector3<Scalar> lower;  ///< corner with the smallest components, in the frame, m
  Vector3<Scalar> upper;  ///< with the largest, m
};

/// See the file comment.
template <FramedRobot R>
class ArmMask {
 public:
  /// Scalar type.
  using Scalar = typename R::Scalar;

  /// `robot` must outlive this. Allocates.
  /// @param robot    whose arm it is
  /// @param rig      its frame ⟨c⟩
  /// @param cameras  the rig
  /// @param boxes    of the arm
  /// @throws std::invalid_argument on a frame of another robot, or a box without extent.
  ArmMask(const R& robot, FrameId rig, const StereoCamera<Scalar>& cameras,
          std::span<const FrameBox<Scalar>> boxes)
      : robot_(&robot), rig_(rig), cameras_(cameras), boxes_(boxes.begin(), boxes.end()) {
    const char* const owner = "ArmMask";
    detail::check_cameras(owner, cameras);
    if (!detail::may_have(robot, rig)) {
      detail::invalid(owner, ": the frame of the cameras was looked up in another robot");
    }
    for (const FrameBox<Scalar>& box : boxes_) {
      if (!detail::may_have(robot, box.frame)) {
        detail::invalid(owner, ": the frame of a box was looked up in another robot");
      }
      for (Index i = 0; i < 3; ++i) {
        if (!(box.lower(i) < box.upper(i)) || !std::isfinite(box.upper(i) - box.lower(i))) {
          detail::invalid(owner, ": lower < upper must hold, got ", box.lower(i), " and ",
                          box.upper(i));
        }
      }
    }
    for (auto& hulls : outline_) hulls.resize(boxes_.size());
  }

  /// By the robot's poses of its last `update`. A box whose pose is not finite has no hull, and the
  /// answer is `non_finite`. No allocation.
  Status update() noexcept {
    Status status = Status::ok;
    const Pose<Scalar> rig = robot_->pose(rig_);
    const Matrix3<Scalar> back = detail::transpose(detail::rotation(rig));
    for (std::size_t b = 0; b < boxes_.size(); ++b) {
      const Pose<Scalar> frame = robot_->pose(boxes_[b].frame);
      const bool finite = detail::all_finite(frame.matrix()) && detail::all_finite(rig.matrix());
      if (!finite) status = Status::non_finite;
      for (std::size_t k = 0; k < 2; ++k) {
        if (finite) {
          project(boxes_[b], frame, rig, back, cameras_[k], outline_[k][b]);
        } else {
          outline_[k][b].clear();
        }
      }
    }
    return status;
  }

  /// One hull for each box and camera, in the order of the boxes; empty ones for boxes behind.
  const ArmOutline<Scalar>& outline() const noexcept { return outline_; }
  /// Whether the arm hides the pixel of camera 0 or 1. No allocation.
  bool hides(int camera, const Pixel<Scalar>& p) const noexcept {
    for (const ImageHull<Scalar>& hull : outline_[static_cast<std::size_t>(camera)]) {
      if (hull.contains(p)) return true;
    }
    return false;
  }

 private:
  static void project(const FrameBox<Scalar>& box, const Pose<Scalar>& frame,
                      const Pose<Scalar>& rig, const Matrix3<Scalar>& back,
                      const PinholeCamera<Scalar>& k, ImageHull<Scalar>& hull) noexcept {
    std::array<Vector3<Scalar>, 8> corners;
    std::array<Pixel<Scalar>, ImageHull<Scalar>::most> points;
    std::size_t count = 0;
    const Scalar near = static_cast<Scalar>(1.001 * PinholeCamera<Scalar>::nearest);
    const auto add = [&](const Vector3<Scalar>& p) { count += k.project(p, points[count]); };
    for (unsigned i = 0; i < 8; ++i) {
      Vector3<Scalar> p;
      for (unsigned j = 0; j < 3; ++j) p(j) = (i >> j & 1u) ? box.upper(j) : box.lower(j);
      const Vector3<Scalar> world = detail::transform(frame, p);
      corners[i] = k.from_rig(detail::times(back, detail::minus(world, detail::origin(rig))));
      if (corners[i](2) >= near) add(corners[i]);
    }
    for (unsigned i = 0; i < 8; ++i) {  // edges that pass the image plane
      for (unsigned j = 0; j < 3; ++j) {
        const Vector3<Scalar>&a = corners[i], &b = corners[i ^ 1u << j];
        if ((i >> j & 1u) || (a(2) >= near) == (b(2) >= near)) continue;
        Vector3<Scalar> cut = detail::plus(a, (near - a(2)) / (b(2) - a(2)), detail::minus(b, a));
        cut(2) = near;
        add(cut);
      }
    }
    hull.set({points.data(), count});
  }

  const R* robot_;
  FrameId rig_;
  StereoCamera<Scalar> cameras_;
  std::vector<FrameBox<Scalar>> boxes_;
  ArmOutline<Scalar> outline_;
};

}  // namespace icat
