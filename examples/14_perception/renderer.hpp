// SPDX-License-Identifier: BSD-3-Clause
// Rays into a pool: a floor of tiles, a pipe, capsules of an arm, a camera of any kind.
#pragma once

#include <icat/perception/cylinder_contours.hpp>
#include <limits>

#include "water.hpp"

namespace perception {

using Vector3 = icat::Vector3<double>;
using Pose = icat::Pose<double>;
using Albedo = std::array<float, 3>;  ///< red, green, blue

/// A plain vector: Eigen's are slow at -O1.
struct V {
  double x = 0, y = 0, z = 0;
};
inline V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline V operator*(double s, V a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline double norm(V a) { return std::sqrt(dot(a, a)); }
inline V from(const Vector3& v) { return {v.x(), v.y(), v.z()}; }

struct Ray {
  V origin, direction;  ///< direction of any length
};

/// A cylinder with round ends, or flat ones.
struct Rod {
  V from, to;
  double radius = 0.05;
  Albedo albedo{};
  bool flat = false;
};

/// z of ⟨0⟩ points down, its origin is at the surface of the water.
struct Pool {
  double floor = 3.5;     ///< depth, m
  std::vector<Rod> rods;  ///< the pipe first
};

inline const Albedo yellow{0.75f, 0.50f, 0.05f}, dark{0.06f, 0.06f, 0.07f};

/// The pipe, ⟨o⟩ in ⟨0⟩.
inline Rod pipe_rod(const Pose& pose, const icat::CylinderShape<double>& shape = {}) {
  const Vector3 half = pose.linear().col(1) * shape.length / 2;
  return {from(pose.translation() - half), from(pose.translation() + half), shape.radius, yellow,
          true};
}

/// The rays of a pinhole; pixel centres are at whole numbers.
struct PinholeRays {
  explicit PinholeRays(const icat::PinholeCamera<double>& camera) : k(camera) {}
  Ray operator()(double u, double v) const {
    return {{}, {(u - k.cx) / k.fx, (v - k.cy) / k.fy, 1}};
  }
  icat::PinholeCamera<double> k;
};

/// Surfaces for each pixel.
class Renderer {
 public:
  Renderer() {
    cv::RNG random(3);
    floor_.create(texels, texels, CV_32F);
    caustics_.create(texels, texels, CV_32F);
    cv::Mat coarse(32, 32, CV_32F), dirt;
    random.fill(coarse, cv::RNG::UNIFORM, 0.75, 1.1);
    cv::resize(coarse, dirt, floor_.size(), 0, 0, cv::INTER_CUBIC);
    cv::Mat tile(8, 8, CV_32F);
    random.fill(tile, cv::RNG::UNIFORM, 0.9, 1.05);
    for (int j = 0; j < texels; ++j) {
      for (int i = 0; i < texels; ++i) {
        constexpr int size = texels / 8;
        const bool grout = i % size < 4 || j % size < 4;
        floor_.at<float>(j, i) = dirt.at<float>(j, i) * random.uniform(0.94f, 1.06f) *
                                 (grout ? 0.55f : tile.at<float>(j / size, i / size));
        const double x = 2 * CV_PI * i / texels, y = 2 * CV_PI * j / texels;
        const double s = std::sin(5 * x + 2.1 * std::sin(3 * y)) +
                         std::sin(6 * y + 1.7 * std::sin(4 * x + 1)) +
                         std::sin(3 * x - 4 * y + std::sin(5 * x));
        caustics_.at<float>(j, i) = float(0.92 + 0.3 * std::pow(1 - std::abs(s) / 3, 6));
      }
    }
  }

  /// Of all pixels, row by row. `camera` is ⟨k⟩ in ⟨0⟩; lamps are 0.4 m to both sides of it.
  template <class Rays>
  const std::vector<Surface>& render(const Pool& pool, const Pose& camera, cv::Size size,
                                     const Rays& rays) {
    pool_ = &pool;
    origin_ = from(camera.translation());
    x_ = from(camera.linear().col(0)), y_ = from(camera.linear().col(1));
    z_ = from(camera.linear().col(2));
    const auto area = static_cast<std::size_t>(size.area());
    seen_.resize(area), what_.resize(area);
    cv::parallel_for_(cv::Range(0, size.height), [&](const cv::Range& rows) {
      for (int j = rows.start; j < rows.end; ++j) {
        auto k = static_cast<std::size_t>(j * size.width);
        for (int i = 0; i < size.width; ++i, ++k) what_[k] = look(rays(i, j), seen_[k]);
      }
    });
    // Pixels with more than one thing in them: sixteen rays.
    for (int j = 1; j < size.height - 1; ++j) {
      for (int i = 1; i < size.width - 1; ++i) {
        const auto k = static_cast<std::size_t>(j * size.width + i);
        const auto w = static_cast<std::size_t>(size.width);
        if (what_[k] == what_[k - 1] && what_[k] == what_[k + 1] && what_[k] == what_[k - w] &&
            what_[k] == what_[k + w]) {
          continue;
        }
        Surface sum;
        for (int n = 0; n < 16; ++n) {
          Surface s;
          look(rays(i + (n % 4 - 1.5) / 4, j + (n / 4 - 1.5) / 4), s);
          sum.range += s.range / 16, sum.depth += s.depth / 16;
          // The light belongs to the albedo: what is averaged is their product.
          sum.sun += s.sun / 16, sum.lamp += s.lamp / 16;
          for (std::size_t c = 0; c < 3; ++c) sum.albedo[c] += s.albedo[c] * (s.sun + s.lamp) / 16;
        }
        for (float& a : sum.albedo) a /= std::max(sum.sun + sum.lamp, 1e-6f);
        seen_[k] = sum;
      }
    }
    return seen_;
  }

 private:
  static constexpr int texels = 1024;  // of 2 m

  // Returns what it is: −1 the floor, else the rod.
  int look(const Ray& local, Surface& s) const {
    const V o = origin_ + turn(local.origin);
    V d = turn(local.direction);
    d = (1 / norm(d)) * d;
    double best = d.z > 1e-6 ? (pool_->floor - o.z) / d.z : 1e3;
    V normal{0, 0, -1};
    int what = -1;
    for (std::size_t i = 0; i < pool_->rods.size(); ++i) {
      const Rod& rod = pool_->rods[i];
      if (meet(rod, o, d, best, normal)) what = static_cast<int>(i);
    }
    const V p = o + best * d;
    s.range = static_cast<float>(std::min(best, 20.0));
    s.depth = static_cast<float>(p.z);
    const double up = std::max(0.0, -normal.z);
    s.sun = static_cast<float>(0.4 + 0.6 * up);
    if (what < 0) {
      const float shade = texel(floor_, p.x, p.y) * contact_shadow(p);
      s.albedo = {0.38f * shade, 0.39f * shade, 0.40f * shade};
    } else {
      s.albedo = pool_->rods[static_cast<std::size_t>(what)].albedo;
    }
    s.sun *= texel(caustics_, p.x, p.y);
    s.lamp = 0;
    for (const double side : {-0.4, 0.4}) {
      const V way = origin_ + side * x_ - p;
      const double r = norm(way), lit = dot(normal, way) / r;
      const double beam = std::max(0.0, -dot(way, z_) / r);  // straight ahead 1
      s.lamp += static_cast<float>(0.5 * std::max(0.0, lit) * beam * beam * beam * beam / (r * r));
    }
    return what;
  }
  V turn(V d) const { return d.x * x_ + (d.y * y_ + d.z * z_); }
  static float texel(const cv::Mat& texture, double x, double y) {
    const auto wrap = [](double t) {
      t /= 2;
      return static_cast<int>((t - std::floor(t)) * texels) & (texels - 1);
    };
    return texture.at<float>(wrap(y), wrap(x));
  }
  // Less light beside and below the pipe.
  float contact_shadow(V p) const {
    if (pool_->rods.empty()) return 1;
    const Rod& r = pool_->rods[0];
    const V along = r.to - r.from, way = p - r.from;
    const double share = std::clamp(dot(way, along) / dot(along, along), 0.0, 1.0);
    const V off = way - share * along;
    const double d = std::hypot(off.x, off.y) / (1.3 * r.radius);
    return static_cast<float>(d > 3 ? 1 : 1 - 0.5 * std::exp(-d * d));
  }

  static bool meet(const Rod& rod, V o, V d, double& best, V& normal) {
    const V axis = rod.to - rod.from;
    const double length = norm(axis);
    const V e = (1 / length) * axis, w = o - rod.from;
    // A sphere around all of it first.
    const V c = 0.5 * (rod.from + rod.to) - o;
    const double way = dot(c, d), bound = length / 2 + rod.radius;
    if (dot(c, c) - way * way > bound * bound) return false;
    bool hit = false;
    const auto take = [&](double t, V n) {
      if (t > 1e-3 && t < best) best = t, normal = n, hit = true;
    };
    const double de = dot(d, e), we = dot(w, e);
    const V dn = d - de * e, wn = w - we * e;
    const double a = dot(dn, dn), b = dot(dn, wn), q = dot(wn, wn) - rod.radius * rod.radius;
    const double root = b * b - a * q;
    if (root > 0 && a > 1e-12) {
      const double t = (-b - std::sqrt(root)) / a, s = we + t * de;
      if (s >= 0 && s <= length) take(t, (1 / rod.radius) * (wn + t * dn));
    }
    for (const bool far : {false, true}) {
      const V center = far ? rod.to : rod.from, m = o - center;
      if (rod.flat) {
        if (std::abs(de) < 1e-9) continue;
        const double t = -dot(m, e) / de;
        const V p = m + t * d;
        if (dot(p, p) < rod.radius * rod.radius) take(t, (de > 0 ? -1.0 : 1.0) * e);
      } else {
        const double h = dot(m, d), g = h * h - dot(m, m) + rod.radius * rod.radius;
        if (g > 0) take(-h - std::sqrt(g), (1 / rod.radius) * (m + (-h - std::sqrt(g)) * d));
      }
    }
    return hit;
  }

  const Pool* pool_ = nullptr;
  V origin_, x_, y_, z_;
  cv::Mat floor_, caustics_;
  std::vector<Surface> seen_;
  std::vector<int> what_;
};

}  // namespace perception
