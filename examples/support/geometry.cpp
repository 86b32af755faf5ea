// SPDX-License-Identifier: BSD-3-Clause
#include "geometry.hpp"

namespace support {

using Matrix3 = icat::Matrix3<double>;
using Pose = icat::Pose<double>;
using Vector3 = icat::Vector3<double>;

Pose pose(const Vector3& position, double roll, double pitch, double yaw) {
  const Matrix3 turn = icat::axis_rotation<double>(Vector3(0, 0, 1), yaw) *
                       Matrix3(icat::axis_rotation<double>(Vector3(0, 1, 0), pitch) *
                               icat::axis_rotation<double>(Vector3(1, 0, 0), roll));
  Pose p;
  p.linear() = turn;
  p.translation() = position;
  p.makeAffine();
  return p;
}

Pose moved(const Pose& p, const Vector3& by) {
  Pose result = p;
  result.translation() = p * by;
  return result;
}

Pose turned_half(Pose p) {
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 3; ++i) p.matrix()(i, j) *= -1;
  }
  return p;
}

Distance distance(const Pose& a, const Pose& b) {
  const Matrix3 Ra = a.linear(), Rb = b.linear(), turn = Ra * Rb.transpose();
  const Vector3 pa = a.translation(), pb = b.translation();
  return {(pa - pb).norm(), icat::rotation_log<double>(turn).norm()};
}

double angle_from_z(const Pose& frame, const Vector3& point) {
  const Matrix3 R = frame.linear();
  const Vector3 p = frame.translation(), d = point - p, z = R.col(2);
  return std::acos(std::clamp(z.dot(d) / d.norm(), -1.0, 1.0));
}

}  // namespace support
