// SPDX-License-Identifier: BSD-3-Clause
// Checkerboards: rendered behind the port, found and used by OpenCV.
#pragma once

#include <numeric>
#include <opencv2/calib3d.hpp>

#include "port.hpp"

namespace calibration {

inline const cv::Size picture_size(1292, 964), board_corners(9, 6);
constexpr double square = 0.025;  ///< m

/// In ⟨k⟩ of the board: x along its rows, z away from who looks at it, m.
inline std::vector<cv::Point3f> board_points() {
  std::vector<cv::Point3f> points;
  for (int j = 0; j < board_corners.height; ++j) {
    for (int i = 0; i < board_corners.width; ++i) {
      points.emplace_back(float(i * square), float(j * square), 0.f);
    }
  }
  return points;
}
inline Vector3 board_middle() {
  return {(board_corners.width - 1) * square / 2, (board_corners.height - 1) * square / 2, 0};
}

/// Whether the camera sees all of the board, with a margin.
inline bool sees(const PortCamera& camera, const Pose& board) {
  for (const double x : {-1.0, double(board_corners.width)}) {
    for (const double y : {-1.0, double(board_corners.height)}) {
      const Vector3 p = board * Vector3(x * square, y * square, 0);
      if (p.z() < 0.2) return false;
      const cv::Point2d uv = camera.project(p);
      if (uv.x < 8 || uv.y < 8 || uv.x > picture_size.width - 9 || uv.y > picture_size.height - 9) {
        return false;
      }
    }
  }
  return true;
}

/// The picture of a board at `board` in ⟨k⟩, with noise, by the ray of each pixel.
inline cv::Mat render_board(const PortCamera& camera, const Pose& board, cv::RNG& random) {
  cv::Mat picture(picture_size, CV_8U, cv::Scalar(60));  // the water behind
  std::vector<cv::Point2f> outline;
  for (const double a : {-1.6, board_corners.width + 0.6}) {
    for (const double b : {-1.6, board_corners.height + 0.6}) {
      outline.push_back(camera.project(board * Vector3(a * square, b * square, 0)));
    }
  }
  const cv::Rect around = (cv::boundingRect(outline) + cv::Size(8, 8) - cv::Point(4, 4)) &
                          cv::Rect(cv::Point(), picture_size);
  const Pose back = board.inverse();
  const V x = perception::from(back.linear().row(0)), y = perception::from(back.linear().row(1)),
          z = perception::from(back.linear().row(2)), t = perception::from(back.translation());
  // Edges of the squares are as wide as a pixel there.
  const double pixel =
      0.7 * (camera(640, 480).direction.z * board.translation().z()) / 1500 / square;
  cv::parallel_for_(cv::Range(around.y, around.br().y), [&](const cv::Range& rows) {
    for (int v = rows.start; v < rows.end; ++v) {
      for (int u = around.x; u < around.br().x; ++u) {
        const Ray ray = camera(u, v);
        const V o{dot(x, ray.origin) + t.x, dot(y, ray.origin) + t.y, dot(z, ray.origin) + t.z};
        const V d{dot(x, ray.direction), dot(y, ray.direction), dot(z, ray.direction)};
        const double s = -o.z / d.z, a = (o.x + s * d.x) / square, b = (o.y + s * d.y) / square;
        double level = 60;
        if (a > -1.5 && b > -1.5 && a < board_corners.width + 0.5 &&
            b < board_corners.height + 0.5) {
          level = 190;  // the border
          if (a > -1 && b > -1 && a < board_corners.width && b < board_corners.height) {
            // +1 on even squares, −1 on odd ones, a ramp between.
            const auto wave = [pixel](double q) {
              const double edge = q - std::round(q), sign = int(std::lround(q)) % 2 ? -1 : 1;
              return sign * std::clamp(edge / pixel, -1.0, 1.0);
            };
            level = 115 + 75 * wave(a) * wave(b);
          }
        }
        picture.at<unsigned char>(v, u) = cv::saturate_cast<unsigned char>(level);
      }
    }
  });
  cv::GaussianBlur(picture, picture, cv::Size(), 0.7);
  cv::Mat noise(picture.size(), CV_16S), sum;
  random.fill(noise, cv::RNG::NORMAL, 0, 2);
  cv::add(picture, noise, sum, cv::noArray(), CV_8U);
  return sum;
}

/// The corners in the order of `board_points`; none where the board is not found.
inline std::vector<cv::Point2f> find_board(const cv::Mat& picture) {
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCorners(picture, board_corners, corners,
                                 cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_FAST_CHECK)) {
    return {};
  }
  cv::cornerSubPix(picture, corners, {5, 5}, {-1, -1},
                   {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 30, 0.005});
  // The square before the first corner is light. A board of 9 × 6 looks the other way round when it
  // is turned by half a turn, so that tells which corner is the first.
  const auto outside = [&](std::size_t at, std::size_t inner) {
    const cv::Point2f p = corners[at] + 0.5f * (corners[at] - corners[inner]);
    const cv::Rect around(cvRound(p.x) - 1, cvRound(p.y) - 1, 3, 3);
    const cv::Rect all(cv::Point(), picture.size());
    return cv::mean(picture(around & all))[0];
  };
  const std::size_t last = corners.size() - 1, step = std::size_t(board_corners.width) + 1;
  if (outside(0, step) < outside(last, last - step)) std::reverse(corners.begin(), corners.end());
  return corners;
}

/// What OpenCV's calibration says of one camera.
struct Intrinsics {
  cv::Mat matrix, distortion;
  double error = 0;  ///< of the reprojection, rms, px
};

/// Both cameras and what is between them.
struct StereoCalibration {
  std::array<Intrinsics, 2> cameras;
  Pose right = Pose::Identity();  ///< ⟨right⟩ in ⟨c⟩
  double error = 0;               ///< of both, rms, px
  int views = 0;
};

inline Pose pose_of(const cv::Mat& rotation, const cv::Mat& translation) {
  cv::Mat R = rotation;
  if (rotation.total() == 3) cv::Rodrigues(rotation, R);
  Pose pose = Pose::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose.linear()(i, j) = R.at<double>(i, j);
    pose.translation()(i) = translation.at<double>(i);
  }
  return pose;
}

/// Boards all over both pictures, at 0.5 to 1.3 m, tilted by up to 0.5 rad.
inline StereoCalibration calibrate(const PortRig& rig, int views, std::uint64_t seed) {
  cv::RNG random(seed);
  std::vector<std::vector<cv::Point3f>> points;
  std::array<std::vector<std::vector<cv::Point2f>>, 2> seen;
  for (int tried = 0; int(points.size()) < views && tried < 3000; ++tried) {
    const auto near = [&](double most) { return random.uniform(-most, most); };
    Pose board = Pose::Identity();
    board.linear() = icat::rotation_exp<double>(Vector3(near(0.5), near(0.5), near(0.4)));
    const double range = random.uniform(0.5, 1.3);
    board.translation() = Vector3(0.125 + near(0.5) * range, near(0.35) * range, range) -
                          board.linear() * board_middle();
    const std::array<Pose, 2> in{rig.poses[0].inverse() * board, rig.poses[1].inverse() * board};
    if (!sees(rig.cameras[0], in[0]) || !sees(rig.cameras[1], in[1])) continue;
    std::array<std::vector<cv::Point2f>, 2> corners;
    for (std::size_t k = 0; k < 2; ++k) {
      corners[k] = find_board(render_board(rig.cameras[k], in[k], random));
    }
    if (corners[0].empty() || corners[1].empty()) continue;
    points.push_back(board_points());
    for (std::size_t k = 0; k < 2; ++k) seen[k].push_back(corners[k]);
  }
  StereoCalibration result;
  result.views = int(points.size());
  std::vector<cv::Mat> rotations, translations;
  for (std::size_t k = 0; k < 2; ++k) {
    Intrinsics& c = result.cameras[k];
    c.error = cv::calibrateCamera(points, seen[k], picture_size, c.matrix, c.distortion, rotations,
                                  translations, cv::CALIB_FIX_K3);
  }
  cv::Mat R, t, E, F;
  auto& [left, right] = result.cameras;
  result.error =
      cv::stereoCalibrate(points, seen[0], seen[1], left.matrix, left.distortion, right.matrix,
                          right.distortion, picture_size, R, t, E, F, cv::CALIB_FIX_INTRINSIC);
  result.right = pose_of(R, t).inverse();
  return result;
}

}  // namespace calibration
