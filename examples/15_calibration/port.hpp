// SPDX-License-Identifier: BSD-3-Clause
// A camera behind a flat port, by exact refraction: a lens in air, a pane, water. Such a camera has
// no centre, all rays of its picture meet an axis [MARIS, VI-A1; there "axial camera"]. By Snell's
// law, with the sine s of the angle to the axis in air,
//
//     R = d_air s/√(1 − s²) + d_glass s/√(n_g² − s²) + (Z − d_air − d_glass) s/√(n_w² − s²)
//
// for a point at the distance R from the axis and Z along it: R grows with s, so s is found by
// halving. The other way, from a pixel to its ray in the water, is closed.
#pragma once

#include "../14_perception/renderer.hpp"

namespace calibration {

using perception::Pose;
using perception::Ray;
using perception::V;
using perception::Vector3;

/// m; of a canister. Ours: nothing of it is published.
struct Port {
  double air = 0.03, glass = 0.010;
  double glass_index = 1.49, water_index = 1.333;  ///< 1: all in air
  double tilt = 0.004;                             ///< of the pane's axis about y, rad
};

/// The lens, in air: radial distortion as OpenCV has it.
struct Lens {
  double f = 1173;  ///< px: 4.4 mm, the shortest of the trials [MARIS, II-B], at 3.75 µm a pixel
  double cx = 650.5, cy = 478.2;
  double k1 = -0.12, k2 = 0.04;
};

class PortCamera {
 public:
  PortCamera(const Lens& lens, const Port& port) : lens_(lens), port_(port) {
    normal_ = {std::sin(port.tilt), 0, std::cos(port.tilt)};
  }

  /// The ray in the water of a pixel.
  Ray operator()(double u, double v) const {
    const double x = (u - lens_.cx) / lens_.f, y = (v - lens_.cy) / lens_.f;
    double a = x, b = y;
    for (int i = 0; i < 12; ++i) {
      const double r = a * a + b * b, g = 1 + r * (lens_.k1 + r * lens_.k2);
      a = x / g, b = y / g;
    }
    V d{a, b, 1};
    d = (1 / norm(d)) * d;
    V at = (port_.air / dot(normal_, d)) * d;
    d = refract(d, 1 / port_.glass_index);
    at = at + (port_.glass / dot(normal_, d)) * d;
    return {at, refract(d, port_.glass_index / port_.water_index)};
  }

  /// The pixel of a point in ⟨k⟩, beyond the port.
  cv::Point2d project(const Vector3& point) const {
    const V p = perception::from(point);
    const double along = dot(normal_, p);
    const V across = p - along * normal_;
    const double R = norm(across);
    double low = 0, high = 1;
    for (int i = 0; i < 60; ++i) {
      const double s = (low + high) / 2;
      (reach(s, along) < R ? low : high) = s;
    }
    const double s = (low + high) / 2, c = std::sqrt(1 - s * s);
    const V d = R > 0 ? c * normal_ + (s / R) * across : normal_;
    const double x = d.x / d.z, y = d.y / d.z, r = x * x + y * y;
    const double g = 1 + r * (lens_.k1 + r * lens_.k2);
    return {lens_.cx + lens_.f * g * x, lens_.cy + lens_.f * g * y};
  }

 private:
  double reach(double s, double along) const {
    const auto part = [s](double d, double n) { return d * s / std::sqrt(n * n - s * s); };
    return part(port_.air, 1) + part(port_.glass, port_.glass_index) +
           part(along - port_.air - port_.glass, port_.water_index);
  }
  V refract(V d, double ratio) const {
    const double c = dot(normal_, d), other = std::sqrt(1 - ratio * ratio * (1 - c * c));
    return ratio * d + (other - ratio * c) * normal_;
  }

  Lens lens_;
  Port port_;
  V normal_;
};

/// Two such cameras side by side, not quite parallel; ⟨k⟩ in ⟨c⟩, the left one.
struct PortRig {
  std::array<PortCamera, 2> cameras;
  std::array<Pose, 2> poses;
};
inline PortRig port_rig(const Port& port) {
  Lens left, right;
  right.f = 1169, right.cx = 641.3, right.cy = 485.9, right.k1 = -0.125;
  PortRig rig{{PortCamera(left, port), PortCamera(right, port)},
              {Pose::Identity(), Pose::Identity()}};
  rig.poses[1].translation() = Vector3(0.25, 0.001, -0.002);
  rig.poses[1].linear() = icat::rotation_exp<double>(Vector3(0.003, -0.02, 0.002));
  return rig;
}

}  // namespace calibration
