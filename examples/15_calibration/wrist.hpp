// SPDX-License-Identifier: BSD-3-Clause
// Where the cameras are in the arm's base, by a board on the wrist [MARIS, VI-A1, Fig. 11]:
//
//     ᵇT_c = ᵇT₆ ⁶T_k (ᶜT_k)⁻¹
//
// from the arm's joints, a ⁶T_k measured by hand, and the board as OpenCV sees it; averaged over
// postures of the arm.
#pragma once

#include "../14_perception/scene.hpp"
#include "board.hpp"

namespace calibration {

/// Positions, and directions by the sum of quaternions of one sign: good for poses that are near
/// each other.
inline Pose average(const std::vector<Pose>& poses) {
  Vector3 position = Vector3::Zero();
  Eigen::Vector4d sum = Eigen::Vector4d::Zero(), first = sum;
  for (const Pose& p : poses) {
    position += p.translation() / double(poses.size());
    const Eigen::Vector4d q = Eigen::Quaterniond(p.linear()).coeffs();
    if (first.isZero()) first = q;
    sum += q.dot(first) < 0 ? -q : q;
  }
  Pose mean = Pose::Identity();
  mean.linear() = Eigen::Quaterniond(sum.normalized()).toRotationMatrix();
  mean.translation() = position;
  return mean;
}

/// A posture of the arm and the corners that the left camera saw.
struct WristView {
  Pose wrist;  ///< ᵇT₆ by the joints as measured
  std::vector<cv::Point2f> corners;
};

/// The arm holds the board before the cameras.
class WristBoard {
 public:
  WristBoard() : robot_(perception::make_robot()) {
    board_.linear() = icat::rotation_exp<double>(Vector3(0.02, -0.03, 0.1));
    board_.translation() = Vector3(0.03, 0, 0.04) - board_.linear() * board_middle();
    const Pose base = robot_.pose(robot_.frame("arm_base"));
    camera_ = base.inverse() * robot_.pose(robot_.frame("camera"));
  }
  /// ᵇT_c and ⁶T_k as they are.
  const Pose& camera() const { return camera_; }
  const Pose& board() const { return board_; }

  /// The first picture of `take` in which the board was found.
  const cv::Mat& picture() const { return first_; }

  /// Postures about the folded arm, joints known to 0.5 mrad. Only the board is drawn.
  std::vector<WristView> take(const PortCamera& camera, int views, std::uint64_t seed) {
    cv::RNG random(seed);
    std::vector<WristView> result;
    for (int tried = 0; int(result.size()) < views && tried < 2000; ++tried) {
      icat::Vector<double, 7> q, measured;
      q << 0, 0.7, 0, -1.8, 0, 1.1, 0;
      for (int i = 0; i < 7; ++i) {
        q(i) += random.uniform(-0.35, 0.35);
        measured(i) = q(i) + random.gaussian(0.5e-3);
      }
      const Pose seen = camera_.inverse() * wrist(q) * board_;
      if (!sees(camera, seen) || seen.linear()(2, 2) < 0.8) continue;
      const cv::Mat picture = render_board(camera, seen, random);
      auto corners = find_board(picture);
      if (corners.empty()) continue;
      if (result.empty()) first_ = picture;
      result.push_back({wrist(measured), std::move(corners)});
    }
    return result;
  }

 private:
  Pose wrist(const icat::Vector<double, 7>& q) {
    const icat::Status status = robot_.update(q, Pose::Identity());
    if (status != icat::Status::ok) std::printf("%s\n", icat::describe(status));
    return robot_.pose(robot_.frame("arm_base")).inverse() * robot_.pose(robot_.frame("link6"));
  }

  perception::Robot robot_;
  Pose board_ = Pose::Identity(), camera_;
  cv::Mat first_;
};

/// ᵇT_c of each view. `board` is ⁶T_k.
inline std::vector<Pose> camera_in_arm(const std::vector<WristView>& views, const Pose& board,
                                       const Intrinsics& camera) {
  std::vector<Pose> result;
  for (const WristView& view : views) {
    cv::Mat rotation, translation;
    if (!cv::solvePnP(board_points(), view.corners, camera.matrix, camera.distortion, rotation,
                      translation)) {
      continue;
    }
    result.push_back(view.wrist * board * pose_of(rotation, translation).inverse());
  }
  return result;
}

/// The point that two cameras see, in ⟨c⟩: the nearest to both rays.
inline Vector3 triangulate(const StereoCalibration& c, const std::array<cv::Point2d, 2>& pixels) {
  std::array<Vector3, 2> d;
  for (std::size_t k = 0; k < 2; ++k) {
    std::vector<cv::Point2d> from{pixels[k]}, to;
    cv::undistortPoints(from, to, c.cameras[k].matrix, c.cameras[k].distortion);
    d[k] = Vector3(to[0].x, to[0].y, 1).normalized();
  }
  d[1] = c.right.linear() * d[1];
  const Vector3 b = c.right.translation();
  const double m = d[0].dot(d[1]), det = 1 - m * m;
  const double s = (d[0].dot(b) - m * d[1].dot(b)) / det, t = (m * d[0].dot(b) - d[1].dot(b)) / det;
  return (s * d[0] + b + t * d[1]) / 2;
}

}  // namespace calibration
