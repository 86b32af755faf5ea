// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// A stereo rig that looks down on pipes, for the tests of perception.
#pragma once

#include <algorithm>
#include <cmath>
#include <icat/perception/cylinder_pose.hpp>
#include <icat/sim/noise.hpp>
#include <random>
#include <vector>

namespace support {

/// ⟨o⟩ in ⟨c⟩ of a level pipe straight ahead of a camera that looks down: y along x of ⟨c⟩ turned
/// by `heading`, z as z of ⟨c⟩.
template <class Scalar = double>
icat::Pose<Scalar> level_pipe(double x, double y, double range, double heading) {
  using V = icat::Vector3<Scalar>;
  icat::Pose<Scalar> p = icat::Pose<Scalar>::Identity();
  const auto quarter = std::numbers::pi / 2;
  p.linear() = icat::axis_rotation<Scalar>(V::UnitZ(), static_cast<Scalar>(heading - quarter));
  p.translation() = V(static_cast<Scalar>(x), static_cast<Scalar>(y), static_cast<Scalar>(range));
  return p;
}

/// All contours that the cameras would have with images without border, and ends that are in them.
template <class Scalar>
std::vector<icat::ContourLine<Scalar>> contours(const icat::StereoCamera<Scalar>& cameras,
                                                const icat::CylinderShape<Scalar>& shape,
                                                const icat::Pose<Scalar>& pose, bool ends) {
  std::vector<icat::ContourLine<Scalar>> lines;
  for (int camera = 0; camera < 2; ++camera) {
    for (int side = 0; side < 2; ++side) {
      const auto edge = icat::edge_line(cameras, camera, shape, pose, side);
      if (edge) lines.push_back(*edge);
      const auto end = icat::end_segment(cameras, camera, shape, pose, side);
      if (ends && end) lines.push_back(end->line);
    }
  }
  return lines;
}

/// Lines of what is seen of each contour, both ends of which move across it by noise.
inline std::vector<icat::ContourLine<double>> noisy_lines(const icat::StereoCamera<double>& cameras,
                                                          const icat::Pose<double>& pose, bool ends,
                                                          double deviation, icat::Noise& noise) {
  const icat::CylinderShape<double> shape{};
  std::vector<icat::ContourLine<double>> lines;
  for (int k = 0; k < 8; ++k) {
    const auto s = k < 4 ? icat::edge_segment(cameras, k / 2, shape, pose, k % 2)
                         : icat::end_segment(cameras, (k - 4) / 2, shape, pose, k % 2);
    if (!s || (k >= 4 && !ends)) continue;
    const double a = deviation * noise.normal(), b = deviation * noise.normal();
    const double x = std::cos(s->line.theta), y = std::sin(s->line.theta);
    auto line = icat::line_through<double>({s->from(0) + a * x, s->from(1) + a * y},
                                           {s->to(0) + b * x, s->to(1) + b * y}, {x, y}, deviation);
    line.camera = s->line.camera, line.kind = s->line.kind;
    lines.push_back(line);
  }
  return lines;
}

/// How a measured frame differs from the true one, on the true one's axes; of both directions that
/// a pipe has the nearer.
template <class Scalar>
struct PipeError {
  Scalar lateral, along, tilt;         ///< m, m, rad
  icat::Vector<Scalar, 6> components;  ///< [δp; δφ]
};
template <class Scalar>
PipeError<Scalar> pipe_error(const icat::Pose<Scalar>& measured, const icat::Pose<Scalar>& truth) {
  icat::Pose<Scalar> m = measured;
  if (m.linear().col(1).dot(truth.linear().col(1)) < 0) m.linear().leftCols(2) *= Scalar(-1);
  PipeError<Scalar> e;
  const icat::Vector3<Scalar> p =
      truth.linear().transpose() * (m.translation() - truth.translation());
  const icat::Matrix3<Scalar> turn = truth.linear().transpose() * m.linear();
  e.components << p, icat::rotation_log<Scalar>(turn);
  e.lateral = std::hypot(p(0), p(2));
  e.along = std::abs(p(1));
  e.tilt = std::hypot(e.components(3), e.components(5));
  return e;
}

}  // namespace support
