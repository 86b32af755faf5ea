// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <functional>
#include <icat/math/numerical_differentiation.hpp>
#include <icat/model/kinematic_tree.hpp>
#include <icat/task/clearance.hpp>
#include <icat/task/frame_tasks.hpp>
#include <icat/tpik/tpik.hpp>
#include <random>
#include <string>

#include "support/allocation_counter.hpp"

namespace {

using icat::Index;
using V3 = icat::Vector3<double>;
using V6 = icat::Vector6<double>;
using M3 = icat::Matrix3<double>;
using Capsule = icat::Capsule<double>;
using Obstacle = icat::Obstacle<double>;
constexpr double bulge = 0.02;

template <class S = double>
icat::Pose<S> pose(const V3& origin, const V3& phi = V3::Zero()) {
  return icat::detail::make_pose<S>(icat::rotation_exp<double>(phi).cast<S>(), origin.cast<S>());
}

struct Random {
  std::mt19937 rng{7};
  double operator()(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(rng);
  }
  V3 point(double size) {
    return {(*this)(-size, size), (*this)(-size, size), (*this)(-size, size)};
  }
};

// --- the true distance, by exact formulas for a point and a search along the segment

struct Box {
  icat::Pose<double> pose;
  V3 size;
};

double exact(const Capsule& c, const V3& p) {
  const V3 u = c.to - c.from;
  const double t =
      u.squaredNorm() > 0 ? std::clamp((p - c.from).dot(u) / u.squaredNorm(), 0.0, 1.0) : 0.0;
  return (p - c.from - t * u).norm() - c.radius;
}
double exact(const Box& box, const V3& p) {
  const V3 q = (box.pose.inverse() * p).cwiseAbs() - box.size / 2;
  return q.cwiseMax(0).norm() + std::min(q.maxCoeff(), 0.0);
}
// The distance to a convex set is convex along the segment.
template <class Shape>
double true_distance(const Capsule& c, const Shape& shape) {
  const auto f = [&](double s) { return exact(shape, (1 - s) * c.from + s * c.to); };
  double low = 0, high = 1;
  for (int i = 0; i < 200; ++i) {
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    (f(a) < f(b) ? high : low) = f(a) < f(b) ? b : a;
  }
  return f((low + high) / 2) - c.radius;
}

// --- a capsule and an obstacle in places that may be awkward

struct Scene {
  std::string name;
  Capsule body;
  Obstacle obstacle;
};

std::vector<Scene> scenes() {
  std::vector<Scene> all;
  Random u;
  const V3 z = V3::UnitZ();
  const auto box = [](const V3& size) { return Obstacle::box(pose(V3::Zero()), size); };
  const V3 size(0.4, 0.3, 0.2);
  for (int i = 0; i < 60; ++i) {
    const std::string n = std::to_string(i);
    const Capsule body{u.point(0.4), u.point(0.4), u(0.02, 0.1)};
    const V3 p = u.point(0.4);
    all.push_back({"capsule capsule " + n, body, Obstacle::capsule(u.point(0.4), p, u(0.02, 0.1))});
    all.push_back({"capsule sphere " + n, body, Obstacle::sphere(p, u(0.02, 0.3))});
    all.push_back({"capsule plane " + n, body, Obstacle::plane(p, u.point(1).normalized())});
    all.push_back({"capsule box " + n, body,
                   Obstacle::box(pose(p, u.point(3)), u.point(0.2) + V3::Constant(0.21))});
    const Capsule ball{p, p, u(0.02, 0.1)};
    all.push_back({"sphere capsule " + n, ball, all[all.size() - 4].obstacle});
    all.push_back({"sphere sphere " + n, ball, Obstacle::sphere(u.point(0.4), u(0.02, 0.3))});
    all.push_back({"sphere plane " + n, ball, all[all.size() - 4].obstacle});
    all.push_back({"sphere box " + n, ball, all[all.size() - 4].obstacle});
  }
  // Parallel and nearly so, of equal and other lengths, one beside the other's end, in one line.
  for (const double angle : {0.0, 1e-12, 1e-8, 1e-4, 1e-2, -1e-3}) {
    const std::string n = std::to_string(angle);
    const V3 half(0.25 * std::cos(angle), 0, 0.25 * std::sin(angle));
    for (const double x : {0.0, 0.1, 0.5, 0.7}) {
      for (const double h : {0.3, 0.12, 0.03, 0.0}) {
        const V3 c(x, 0, h);
        const std::string at = n + " " + std::to_string(x) + " " + std::to_string(h);
        all.push_back({"parallel " + at,
                       {c - half, c + half, 0.05},
                       Obstacle::capsule({-0.25, 0, 0}, {0.25, 0, 0}, 0.06)});
        all.push_back({"parallel longer " + at,
                       {c - half, c + half, 0.05},
                       Obstacle::capsule({-0.4, 0, 0}, {0.3, 0, 0}, 0.06)});
        all.push_back({"parallel face " + at, {c - half, c + half, 0.05}, box(size)});
        all.push_back(
            {"parallel plane " + at, {c - half, c + half, 0.05}, Obstacle::plane(V3::Zero(), z)});
      }
    }
  }
  // Crossing at distance 0 and near it.
  for (const double h : {0.0, 1e-9, 1e-3, 0.03, 0.055}) {
    all.push_back({"crossing " + std::to_string(h),
                   {{-0.2, 0, h}, {0.3, 0, h}, 0.05},
                   Obstacle::capsule({0, -0.3, 0}, {0.02, 0.2, 0}, 0.06)});
  }
  // Spheres and capsules at edges, corners, faces, middle planes and the middle of a box.
  for (const double x : {0.0, 1e-3, 0.1, 0.19, 0.2, 0.2 + 1e-9, 0.21, 0.26}) {
    for (const double y : {0.0, 0.05, 0.14, 0.15, 0.16, 0.2}) {
      for (const double h : {0.0, -0.05, 0.09, 0.1, 0.11, 0.15}) {
        const std::string n = std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(h);
        const V3 p(x, y, h);
        all.push_back({"sphere at box " + n, {p, p, 0.06}, box(size)});
        const V3 u1(0.1, -0.1, 0.0), u2(0.05, 0.2, 0.1);
        all.push_back({"capsule at box " + n, {p - u1, p + u1, 0.06}, box(size)});
        all.push_back({"capsule from box " + n, {p, p + u2, 0.06}, box(size)});
        all.push_back({"capsule along edge " + n, {p, p - V3(0.3, 0, 0), 0.06}, box(size)});
        all.push_back({"sphere at plate " + n, {p, p, 0.1}, box({0.4, 0.3, 0.005})});
      }
    }
  }
  // Coincident centres, a sphere on a segment and on its end.
  for (const double x : {0.0, 1e-12, 1e-4, 0.2}) {
    const V3 p(x, 0, 0);
    all.push_back({"on sphere", {p, p, 0.05}, Obstacle::sphere(V3::Zero(), 0.1)});
    all.push_back({"on segment", {p, p, 0.05}, Obstacle::capsule({-0.2, 0, 0}, {0.2, 0, 0}, 0.1)});
    all.push_back({"over sphere", {p, -p, 0.05}, Obstacle::sphere(V3::Zero(), 0.1)});
  }
  return all;
}

// Both ends moved by the twist, at ⟨0⟩.
Capsule moved(const Capsule& c, const V6& twist) {
  const auto T = icat::integrate<double>(pose(V3::Zero()), twist, 1.0);
  return {T * c.from, T * c.to, c.radius};
}
// The derivative of x by that twist.
V6 slope(const icat::Proximity<double>& near) {
  V6 g;
  g << near.gradient, near.point.cross(near.gradient);
  return g;
}

TEST(Proximity, GradientIsTheDerivativeOfTheDistance) {
  for (const Scene& scene : scenes()) {
    const auto near = icat::proximity(scene.body, scene.obstacle, bulge);
    V6 expected;
    // Curvatures are below 1 / radius, or L² / (8 b) = 6 L for the wandering point: < 50 / m. They
    // may jump, never the gradient.
    const double h = 1e-7;
    for (Index i = 0; i < 6; ++i) {
      const V6 d = h * V6::Unit(i);
      expected(i) = (icat::proximity(moved(scene.body, d), scene.obstacle, bulge).distance -
                     icat::proximity(moved(scene.body, -d), scene.obstacle, bulge).distance) /
                    (2 * h);
    }
    EXPECT_LT((slope(near) - expected).lpNorm<Eigen::Infinity>(), 1e-5)
        << scene.name << "\n"
        << slope(near).transpose() << "\n"
        << expected.transpose();
    EXPECT_LE(near.gradient.norm(), 1 + 1e-12) << scene.name;
  }
}

TEST(Proximity, IsTheTrueDistanceToAStatedBound) {
  int deep = 0, shallow = 0;
  const auto check = [&](const std::string& name, const Capsule& body, const Obstacle& obstacle,
                         double truth, double radius, double length) {
    const double x = icat::proximity(body, obstacle, bulge).distance, b = bulge * length;
    if (truth >= -radius / 2) {
      ++shallow;
      EXPECT_LE(x, truth + 1e-12) << name;
      EXPECT_GE(x, truth - b - 1e-12) << name;
    } else {
      ++deep;
      EXPECT_LE(std::abs(x - truth), std::max(b, radius / 2) + 1e-12) << name;
      EXPECT_LT(x, 0) << name;
    }
  };
  Random u;
  for (int i = 0; i < 3000; ++i) {
    const std::string n = std::to_string(i);
    const double size = i % 2 ? 0.4 : 0.15, r = u(0.02, 0.15);
    Capsule body{u.point(size), u.point(size), r};
    if (i % 5 == 0) body.to = body.from;
    const double length = (body.to - body.from).norm();
    const Box box{pose(u.point(size), u.point(3)), u.point(0.2) + V3::Constant(0.205)};
    check("box " + n, body, Obstacle::box(box.pose, box.size), true_distance(body, box), r, length);
    Capsule other{u.point(size), u.point(size), u(0.02, 0.15)};
    if (i % 7 == 0) other.to = other.from;
    check("round " + n, body, Obstacle::capsule(other.from, other.to, other.radius),
          true_distance(body, other), r + other.radius, other.to == other.from ? 0.0 : length);
    const V3 p = u.point(size), normal = u.point(1).normalized();
    check("plane " + n, body, Obstacle::plane(p, normal),
          std::min(normal.dot(body.from - p), normal.dot(body.to - p)) - r, 1e9, length);
  }
  EXPECT_GT(deep, 300);
  EXPECT_GT(shallow, 3000);
}

TEST(Proximity, IsExactForSpheresAndPushesOut) {
  const Capsule ball{{0.3, 0.1, -0.2}, {0.3, 0.1, -0.2}, 0.07};
  const auto sphere = icat::proximity(ball, Obstacle::sphere({0.3, 0.1, 0.3}, 0.2), bulge);
  EXPECT_DOUBLE_EQ(sphere.distance, 0.5 - 0.27);
  EXPECT_LT((sphere.gradient + V3::UnitZ()).norm(), 1e-15);
  const auto plane = icat::proximity(ball, Obstacle::plane({9, 9, -1}, {0, 0, 1}), bulge);
  EXPECT_DOUBLE_EQ(plane.distance, 0.8 - 0.07);
  // Inside a box near a face: out through that face, and x as it is outside.
  const Box box{pose({0, 0, 0}), {0.4, 0.3, 0.2}};
  const V3 inside(0.02, 0.03, 0.09);
  const auto in = icat::proximity({inside, inside, 0.04}, Obstacle::box(box.pose, box.size), bulge);
  EXPECT_LT((in.gradient - V3::UnitZ()).norm(), 1e-15);
  EXPECT_NEAR(in.distance, -0.01 - 0.04, 1e-15);
  // From anywhere inside, going along the gradient gets out.
  Random u;
  for (int i = 0; i < 200; ++i) {
    V3 p(u(-0.2, 0.2), u(-0.15, 0.15), u(-0.1, 0.1));
    for (int k = 0; k < 400; ++k) {
      p += 1e-3 * icat::proximity({p, p, 0.04}, Obstacle::box(box.pose, box.size), bulge)
                      .gradient.normalized();
    }
    EXPECT_GT(exact(box, p), 0.1) << i;
  }
}

TEST(Proximity, IsDefinedWhereCentresCoincide) {
  const V3 o = V3::Zero();
  const Capsule ball{o, o, 0.1}, rod{{-0.2, 0, 0}, {0.2, 0, 0}, 0.1};
  const Obstacle all[] = {
      Obstacle::sphere(o, 0.1), Obstacle::capsule({0, -0.2, 0}, {0, 0.2, 0}, 0.1),
      Obstacle::capsule(rod.from, rod.to, 0.1), Obstacle::box(pose(o), {0.4, 0.3, 0.2})};
  for (const Obstacle& obstacle : all) {
    for (const Capsule& body : {ball, rod}) {
      const auto near = icat::proximity(body, obstacle, bulge);
      EXPECT_LT(near.distance, -0.1);
      EXPECT_LT(near.gradient.norm(), 1e-12);
      EXPECT_TRUE(near.point.allFinite());
    }
  }
}

// However long and thin: the slope changes its sign within roundings of s*.
TEST(Proximity, FindsTheNearestPointOfLongAndThinCapsules) {
  Random u;
  for (int i = 0; i < 2000; ++i) {
    const V3 through = u.point(1e-3), a = u.point(1).normalized(), b = u.point(1).normalized();
    const Capsule body{through - u(0, 100) * a, through + u(0, 100) * a, 1e-5};
    const Obstacle other = i % 2 ? Obstacle::capsule(-u(0, 100) * b, u(0, 100) * b, 1e-5)
                                 : Obstacle::box(pose(V3::Zero(), u.point(3)), {1e-3, 2e-3, 1e-3});
    const double s = icat::detail::nearest_parameter(body, other, 1e-3, 1e-5);
    const V3 axis = body.to - body.from;
    const auto slope_at = [&](double t) {
      return other.distance_at(body.from + t * axis, 1e-5).gradient.dot(axis.normalized()) +
             8e-3 * (t - 0.5);
    };
    EXPECT_TRUE(s == 0 || slope_at(s - 1e-11) < 0) << i << " " << s;
    EXPECT_TRUE(s == 1 || slope_at(s + 1e-11) > 0) << i << " " << s;
  }
}

// Along a path that passes what makes nearest points jump, x and its derivative move by less and
// less as the step shrinks: by a quarter of the jump for a quarter of the step.
TEST(Proximity, MovesContinuously) {
  const Obstacle box = Obstacle::box(pose(V3::Zero()), {0.4, 0.3, 0.2});
  const Obstacle rod = Obstacle::capsule({-0.25, 0, 0}, {0.25, 0, 0}, 0.06);
  const auto ball = [](const V3& p) { return Capsule{p, p, 0.06}; };
  const auto bar = [](const V3& c, const V3& half) { return Capsule{c - half, c + half, 0.06}; };
  const auto tilted = [](double t) { return V3(0.25 * std::cos(t), 0, 0.25 * std::sin(t)); };
  struct Path {
    std::string name;
    std::function<Capsule(double)> body;  // of t in [-1, 1]
    Obstacle obstacle;
  };
  const Path paths[] = {
      {"tilting over a capsule",
       [&](double t) {
         return bar({0.03, 0, 0.2}, tilted(t / 2));
       },
       rod},
      {"turning over a capsule",
       [&](double t) {
         return bar({0.03, 0.04, 0.2}, {0.2 * std::cos(t), 0.2 * std::sin(t), 0});
       },
       rod},
      {"turning in contact",
       [&](double t) {
         return bar({0.03, 0, 0.1}, tilted(t / 2));
       },
       rod},
      {"tilting inside",
       [&](double t) {
         return bar({0.03, 0.01, 0.02}, tilted(t / 2));
       },
       rod},
      {"past the end",
       [&](double t) {
         return bar({0.5 * t, 0.05, 0.1}, {0, 0.1, 0.0});
       },
       rod},
      {"along the line",
       [&](double t) {
         return bar({t, 0, 0}, {0.2, 0, 0});
       },
       rod},
      {"through a capsule",
       [&](double t) {
         return bar({0.03, 0, 0.2 * t}, {0.02, 0.2, 0});
       },
       rod},
      {"tilting over a face",
       [&](double t) {
         return bar({0.03, 0, 0.2}, tilted(t / 2));
       },
       box},
      {"tilting over an edge",
       [&](double t) {
         return bar({0.2, 0, 0.2}, tilted(t));
       },
       box},
      {"tilting in a face",
       [&](double t) {
         return bar({0.03, 0, 0.1}, tilted(t / 2));
       },
       box},
      {"tilting inside a box",
       [&](double t) {
         return bar({0.03, 0.02, 0.04}, tilted(t / 2));
       },
       box},
      {"tilting over a plane",
       [&](double t) {
         return bar({0.03, 0, 0.2}, tilted(t / 2));
       },
       Obstacle::plane(V3::Zero(), V3::UnitZ())},
      {"past an edge",
       [&](double t) {
         return ball({0.2 + 0.2 * t, 0.01, 0.17});
       },
       box},
      {"past a corner",
       [&](double t) {
         return ball({0.2 + 0.1 * t, 0.15 + 0.1 * t, 0.13});
       },
       box},
      {"through an edge",
       [&](double t) {
         return ball({0.2 + 0.2 * t, 0.0, 0.1 + 0.15 * t});
       },
       box},
      {"through a corner",
       [&](double t) { return ball(V3(0.2, 0.15, 0.1) + t * V3(0.2, 0.2, 0.1)); }, box},
      {"in one face, out of another",
       [&](double t) {
         return ball({0.15 + 0.2 * t, 0.04, 0.06 + 0.1 * t});
       },
       box},
      {"through the middle",
       [&](double t) {
         return ball({0, 0, 0.3 * t});
       },
       box},
      {"near the middle",
       [&](double t) {
         return ball({1e-3, 0.3 * t, 1e-4});
       },
       box},
      {"through a plate",
       [&](double t) {
         return ball({0.05, 0.3 * t, 0.1 * t});
       },
       Obstacle::box(pose(V3::Zero()), {0.4, 0.3, 0.01})},
      {"a bar through a box",
       [&](double t) {
         return bar({0, 0.3 * t, 0.02}, {0.3, 0.1, 0.1});
       },
       box},
      {"through a sphere",
       [&](double t) {
         return ball({0, 0, 0.3 * t});
       },
       Obstacle::sphere(V3::Zero(), 0.1)},
      {"a sphere along a bar",
       [&](double t) {
         return bar({0.5 * t, 0, 0.02}, {0.2, 0, 0});
       },
       Obstacle::sphere(V3::Zero(), 0.1)},
  };
  for (const Path& path : paths) {
    const auto jumps = [&](int steps) {
      icat::Vector<double, 2> jump(0, 0);
      double x = 0;
      V6 g;
      for (int i = 0; i <= steps; ++i) {
        const Capsule body = path.body(2.0 * i / steps - 1);
        const auto near = icat::proximity(body, path.obstacle, bulge);
        if (i > 0) {
          jump(0) = std::max(jump(0), std::abs(near.distance - x));
          jump(1) = std::max(jump(1), (slope(near) - g).norm());
        }
        x = near.distance;
        g = slope(near);
      }
      return jump;
    };
    const auto coarse = jumps(4000), fine = jumps(16000);
    for (Index i = 0; i < 2; ++i) EXPECT_LT(fine(i), 0.3 * coarse(i) + 1e-12) << path.name << i;
    EXPECT_GT(coarse(1), 1e-6) << path.name << ": nothing happens on this path";
    // No steeper than the bound on curvatures of the first test.
    EXPECT_LT(coarse(1), 100 * 2.0 / 4000) << path.name;
  }
}

// In single precision the same as in double, to what its rounding allows.
// Not inlined: GCC 12 takes some numbers back to double unrounded.
[[gnu::noinline]] icat::Capsule<float> narrow(const Capsule& c) {
  return {c.from.cast<float>(), c.to.cast<float>(), static_cast<float>(c.radius)};
}
[[gnu::noinline]] Capsule wide(const icat::Capsule<float>& c) {
  return {c.from.cast<double>(), c.to.cast<double>(), c.radius};
}

TEST(Proximity, WorksInSinglePrecision) {
  for (const Scene& scene : scenes()) {
    if (!scene.obstacle.is_round()) continue;
    const auto a = narrow(scene.body), b = narrow(scene.obstacle.round());
    const Capsule other = wide(b);
    const auto got =
        icat::proximity(a, icat::Obstacle<float>::capsule(b.from, b.to, b.radius), 0.02f);
    const auto expected =
        icat::proximity(wide(a), Obstacle::capsule(other.from, other.to, other.radius), bulge);
    EXPECT_NEAR(got.distance, expected.distance, 2e-6) << scene.name;
    EXPECT_LT((got.gradient.cast<double>() - expected.gradient).norm(), 1e-3) << scene.name;
  }
}

// --- the tasks, on a free base with two arms

template <class S, int N>
icat::KinematicTree<S, N> make_robot() {
  const auto joint = [](const std::string& name, const std::string& parent, const V3& at,
                        const V3& axis, icat::JointType type) {
    icat::Joint<S> j{name, parent, name, type};
    j.origin = pose<S>(at, V3(0.1, -0.2, 0.15));
    j.axis = axis.cast<S>();
    return j;
  };
  using enum icat::JointType;
  return icat::KinematicTree<S, N>(
      {.joints = {joint("l1", "hull", {0.3, 0.2, 0}, V3::UnitZ(), revolute),
                  joint("l2", "l1", {0.3, 0, 0}, V3::UnitY(), revolute),
                  joint("l3", "l2", {0.3, 0, 0}, V3::UnitX(), prismatic),
                  joint("r1", "hull", {0.3, -0.2, 0}, V3::UnitZ(), revolute),
                  joint("r2", "r1", {0.3, 0, 0}, V3::UnitY(), continuous)},
       .base = icat::Base<S>::free()});
}

template <class Robot>
struct Case {
  using S = typename Robot::Scalar;
  using V = icat::Vector3<S>;
  using Body = icat::CollisionBody<S>;
  using O = icat::Obstacle<S>;

  Robot robot = make_robot<S, Robot::size>();
  std::vector<Body> bodies{
      Body::capsule(robot.frame("hull"), V(S(-0.4), 0, 0), V(S(0.3), 0, 0), S(0.15)),
      Body::capsule(robot.frame("l2"), V(0, 0, 0), V(S(0.3), 0, 0), S(0.05)),
      Body::sphere(robot.frame("l3"), V(S(0.1), 0, S(0.02)), S(0.06)),
      Body::capsule(robot.frame("r1"), V(S(0.05), 0, 0), V(S(0.3), S(0.02), 0), S(0.05)),
      Body::capsule(robot.frame("r2"), V(0, 0, 0), V(S(0.4), 0, S(0.1)), S(0.04))};
  std::vector<O> obstacles{
      O::sphere(V(S(0.9), S(0.1), S(0.2)), S(0.2)),
      O::capsule(V(S(0.5), -1, S(0.3)), V(S(0.6), 1, S(0.2)), S(0.1)),
      O::plane(V(0, 0, S(-0.4)), V(0, S(0.6), S(0.8))),
      O::box(pose<S>({0.8, -0.3, 0}, {0.5, 0.3, 1.0}), V(S(0.4), S(0.3), S(0.2)))};
  icat::Objective<S> objective = icat::Objective<S>::at_least(S(0.05), S(0.1));
  icat::task::Clearance<Robot> clearance{robot, bodies, obstacles, objective};
  icat::task::SelfClearance<Robot> self{
      robot, bodies, {{0, 2}, {1, 3}, {1, 4}, {4, 2}, {0, 4}}, objective};

  icat::Vector<S, Eigen::Dynamic> q = icat::detail::zeros<icat::Vector<S, Eigen::Dynamic>>(5);
  icat::Pose<S> base = pose<S>({0, 0, 0});

  // The state moved by ẏ.
  void move(const icat::Vector<S, Eigen::Dynamic>& y) {
    const icat::Vector<S, Eigen::Dynamic> to = q + y.head(5);
    const icat::Vector6<S> twist = y.tail(6);
    ASSERT_EQ(robot.update(to, icat::integrate<S>(base, twist, S(1))), icat::Status::ok);
  }
  void set(Random& u) {
    for (Index i = 0; i < 5; ++i) q(i) = S(u(-1.5, 1.5));
    base = pose<S>(u.point(0.3), u.point(1));
    move(icat::detail::zeros<icat::Vector<S, Eigen::Dynamic>>(11));
  }
};

template <class Robot>
class ClearanceTask : public testing::Test {};
using Robots = testing::Types<icat::KinematicTree<double, 11>, icat::KinematicTree<double>,
                              icat::KinematicTree<float, 11>, icat::KinematicTree<float>>;
TYPED_TEST_SUITE(ClearanceTask, Robots);

TYPED_TEST(ClearanceTask, JacobiansAreDerivatives) {
  using S = typename TypeParam::Scalar;
  using X = icat::Vector<S, Eigen::Dynamic>;
  Case<TypeParam> c;
  Random u;
  const bool wide = sizeof(S) == 8;
  for (int i = 0; i < 50; ++i) {
    c.set(u);
    const auto check = [&](auto& task) {
      task.update();
      const Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic> got = task.jacobian();
      const auto f = [&](const X& y) {
        c.move(y);
        task.update();
        X x(task.rows());
        for (Index k = 0; k < x.size(); ++k) x(k) = task.value(k);
        return x;
      };
      const auto expected =
          icat::central_difference(f, icat::detail::zeros<X>(11), wide ? S(1e-6) : S(4e-3));
      c.move(icat::detail::zeros<X>(11));
      // Curvature < 100 / m; single precision: step 4e-3, rounding 1e-6 / 4e-3.
      EXPECT_LT((got - expected).cwiseAbs().maxCoeff(), wide ? S(1e-4) : S(5e-2)) << task.name();
    };
    check(c.clearance);
    check(c.self);
  }
}

TYPED_TEST(ClearanceTask, ValuesReferencesAndActivations) {
  using S = typename TypeParam::Scalar;
  Case<TypeParam> c;
  Random u;
  for (int i = 0; i < 20; ++i) {
    c.set(u);
    c.clearance.update();
    S smallest = S(9);
    for (Index b = 0; b < 5; ++b) {
      for (Index o = 0; o < 4; ++o) {
        const Index row = c.clearance.row(b, o);
        const S x = c.clearance.value(row);
        smallest = std::min(smallest, x);
        const auto& body = c.bodies[static_cast<std::size_t>(b)];
        const auto T = c.robot.pose(body.frame);
        const icat::Capsule<S> placed{T * body.shape.from, T * body.shape.to, body.shape.radius};
        const auto near =
            icat::proximity(placed, c.obstacles[static_cast<std::size_t>(o)], S(bulge));
        EXPECT_NEAR(x, near.distance, S(1e-5));
        EXPECT_NEAR(c.clearance.reference()(row), c.objective.target(x) - x, S(1e-6));
        const S fade = icat::smooth_step(2 * near.gradient.norm());
        EXPECT_NEAR(c.clearance.activation()(row), fade * c.objective.activation(x), S(1e-3));
      }
    }
    EXPECT_EQ(c.clearance.smallest(), smallest);
  }
}

// What a moving obstacle does to x is in the reference, so that J ẏ = ẋ̄ tracks it without lag.
// A motion of all of the robot changes no distance within it. Capsules of equal length are the
// awkward ones: which of them is the thicker must not depend on rounding.
TYPED_TEST(ClearanceTask, SelfClearanceIsTheShapeOfTheRobot) {
  using S = typename TypeParam::Scalar;
  using V = icat::Vector3<S>;
  using Body = icat::CollisionBody<S>;
  Case<TypeParam> c;
  const std::vector<Body> bodies{
      Body::capsule(c.robot.frame("l2"), V(0, S(0.1), 0), V(S(0.2), S(0.1), S(0.2)), S(0.03)),
      Body::capsule(c.robot.frame("r2"), V(0, 0, S(0.1)), V(S(0.2), S(0.2), S(0.1)), S(0.03)),
      Body::capsule(c.robot.frame("hull"), V(-3, 0, 0), V(3, 0, 0), S(0.03))};
  icat::task::SelfClearance task(c.robot, bodies, {{0, 1}, {0, 2}, {2, 0}}, c.objective);
  Random u;
  for (int i = 0; i < 100; ++i) {
    c.set(u);
    task.update();
    const S before[] = {task.value(0), task.value(1), task.value(2)};
    // Not thicker than by the shorter, whatever the order.
    EXPECT_EQ(before[1], before[2]);
    c.base = pose<S>(u.point(0.3), u.point(1));
    c.move(icat::detail::zeros<icat::Vector<S, Eigen::Dynamic>>(11));
    task.update();
    for (Index k = 0; k < 3; ++k) {
      EXPECT_NEAR(task.value(k), before[k], sizeof(S) == 8 ? S(1e-12) : S(1e-5));
      EXPECT_LT(task.jacobian().row(k).tail(6).norm(), sizeof(S) == 8 ? S(1e-12) : S(1e-5));
    }
    const icat::Capsule<double> shorter{
        (c.robot.pose(bodies[0].frame) * bodies[0].shape.from).template cast<double>(),
        (c.robot.pose(bodies[0].frame) * bodies[0].shape.to).template cast<double>(), 0.03};
    const icat::Capsule<double> longer{
        (c.robot.pose(bodies[2].frame) * bodies[2].shape.from).template cast<double>(),
        (c.robot.pose(bodies[2].frame) * bodies[2].shape.to).template cast<double>(), 0.03};
    EXPECT_GE(task.value(1), true_distance(shorter, longer) - bulge * 0.2 * std::sqrt(2.0) - 1e-5);
  }
}

TYPED_TEST(ClearanceTask, FeedsForwardTheVelocityOfObstacles) {
  using S = typename TypeParam::Scalar;
  using V = icat::Vector3<S>;
  using O = icat::Obstacle<S>;
  Case<TypeParam> c;
  Random u;
  const S h = sizeof(S) == 8 ? S(1e-6) : S(4e-3);
  for (int i = 0; i < 20; ++i) {
    c.set(u);
    icat::Vector6<S> velocity;
    velocity << u.point(1).cast<S>(), u.point(1).cast<S>();
    for (Index o = 0; o < 4; ++o) {
      // The obstacle after a time.
      const auto at = [&](S time) {
        const V omega = icat::detail::column3(velocity, 3, 0);
        const icat::Matrix3<S> turn = icat::rotation_exp<S>(V(omega * time));
        const V start = c.obstacles[static_cast<std::size_t>(o)].origin();
        const V end = start + time * icat::detail::column3(velocity, 0, 0);
        if (o == 0) return O::sphere(end, S(0.2));
        if (o == 1) return O::capsule(end, end + turn * V(S(0.1), 2, S(-0.1)), S(0.1));
        if (o == 2) return O::plane(end, turn * V(0, S(0.6), S(0.8)));
        auto T = pose<S>({0.8, -0.3, 0}, {0.5, 0.3, 1.0});
        return O::box(icat::detail::make_pose<S>(turn * icat::detail::rotation(T), end),
                      V(S(0.4), S(0.3), S(0.2)));
      };
      const auto values = [&](S time) {
        EXPECT_EQ(c.clearance.set_obstacle(o, at(time)), icat::Status::ok);
        c.clearance.update();
        icat::Vector<S, 5> x;
        for (Index b = 0; b < 5; ++b) x(b) = c.clearance.value(c.clearance.row(b, o));
        return x;
      };
      const icat::Vector<S, 5> rate = (values(h) - values(-h)) / (2 * h);
      (void)values(0);
      const auto rest = c.clearance.reference();
      EXPECT_EQ(c.clearance.set_obstacle(o, at(0), velocity), icat::Status::ok);
      c.clearance.update();
      for (Index b = 0; b < 5; ++b) {
        const Index row = c.clearance.row(b, o);
        EXPECT_NEAR(c.clearance.reference()(row) - rest(row), -rate(b),
                    sizeof(S) == 8 ? S(1e-4) : S(5e-2));
      }
      EXPECT_EQ(c.clearance.set_obstacle(o, at(0)), icat::Status::ok);
    }
  }
}

TYPED_TEST(ClearanceTask, DoesNotAllocate) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "the sanitizer has malloc";
#endif
  using S = typename TypeParam::Scalar;
  Case<TypeParam> c;
  Random u;
  c.set(u);
  c.clearance.update();                                             // the robot's Jacobians too
  EXPECT_GT(count_allocations([&] { c.bodies.reserve(100); }), 0);  // the counter counts
  EXPECT_EQ(count_allocations([&] {
              c.clearance.update();
              c.self.update();
              (void)c.clearance.smallest();
              (void)c.clearance.set_obstacle(0, c.obstacles[3]);
              (void)c.clearance.set_shape(0, c.bodies[1].shape);
              (void)c.self.set_max_rate(S(1));
            }),
            0);
}

TYPED_TEST(ClearanceTask, SettersTakeGoodAndRefuseBad) {
  using S = typename TypeParam::Scalar;
  using V = icat::Vector3<S>;
  using O = icat::Obstacle<S>;
  using icat::Status;
  Case<TypeParam> c;
  auto& task = c.clearance;
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const V o(0, 0, 0), z(0, 0, 1), one(1, 1, 1);
  const auto zero = icat::detail::zeros<icat::Vector6<S>>(6);
  icat::Vector6<S> bad_velocity = zero;
  bad_velocity(4) = nan;
  icat::Pose<S> scaled = pose<S>({0, 0, 0}), lost = scaled;
  scaled.matrix()(1, 1) = S(1.1);
  lost.matrix()(0, 3) = nan;
  task.update();
  const auto before = task.reference();

  EXPECT_EQ(task.set_obstacle(-1, c.obstacles[0]), Status::out_of_range);
  EXPECT_EQ(task.set_obstacle(4, c.obstacles[0]), Status::out_of_range);
  EXPECT_EQ(task.set_obstacle(0, c.obstacles[0], bad_velocity), Status::non_finite);
  EXPECT_EQ(task.set_obstacle(0, O::sphere(V(nan, 0, 0), 1)), Status::non_finite);
  EXPECT_EQ(task.set_obstacle(0, O::sphere(o, nan)), Status::non_finite);
  EXPECT_EQ(task.set_obstacle(0, O::sphere(o, 0)), Status::out_of_range);
  EXPECT_EQ(task.set_obstacle(0, O::sphere(o, -1)), Status::out_of_range);
  EXPECT_EQ(task.set_obstacle(0, O::capsule(o, V(0, nan, 0), 1)), Status::non_finite);
  EXPECT_EQ(task.set_obstacle(0, O::plane(o, V(0, 0, 2))), Status::out_of_range);
  EXPECT_EQ(task.set_obstacle(0, O::plane(o, o)), Status::out_of_range);
  EXPECT_EQ(task.set_obstacle(0, O::plane(o, V(0, 0, nan))), Status::non_finite);
  EXPECT_EQ(task.set_obstacle(0, O::plane(V(nan, 0, 0), z)), Status::non_finite);
  EXPECT_EQ(task.set_obstacle(0, O::box(pose<S>({0, 0, 0}), V(1, 0, 1))), Status::out_of_range);
  EXPECT_EQ(task.set_obstacle(0, O::box(pose<S>({0, 0, 0}), V(1, nan, 1))), Status::non_finite);
  EXPECT_EQ(task.set_obstacle(0, O::box(scaled, one)), Status::not_a_rotation);
  EXPECT_EQ(task.set_obstacle(0, O::box(lost, one)), Status::non_finite);
  EXPECT_EQ(task.set_shape(5, {o, z, 1}), Status::out_of_range);
  EXPECT_EQ(task.set_shape(-1, {o, z, 1}), Status::out_of_range);
  EXPECT_EQ(task.set_shape(0, {o, z, 0}), Status::out_of_range);
  EXPECT_EQ(task.set_shape(0, {o, V(nan, 0, 0), 1}), Status::non_finite);
  EXPECT_EQ(task.set_max_rate(0), Status::out_of_range);
  EXPECT_EQ(task.set_max_rate(nan), Status::out_of_range);
  EXPECT_EQ(task.set_gain(-1), Status::out_of_range);
  task.update();
  EXPECT_EQ(task.reference(), before);

  const S x = task.value(0), y = task.value(1);
  auto shape = c.bodies[0].shape;
  shape.radius += S(0.03);
  EXPECT_EQ(task.set_shape(0, shape), Status::ok);
  task.update();
  EXPECT_NEAR(task.value(0), x - S(0.03), S(1e-6));
  EXPECT_NEAR(task.value(1), y - S(0.03), S(1e-6));
  task.set_objective(icat::Objective<S>::at_least(5, 1));
  EXPECT_EQ(task.set_max_rate(S(0.25)), Status::ok);
  task.update();
  EXPECT_EQ(task.reference()(0), S(0.25));
  EXPECT_EQ(task.set_obstacle(0, O::plane(V(0, 0, -9), z)), Status::ok);
  task.update();
  EXPECT_GT(task.value(0), 8);
}

TYPED_TEST(ClearanceTask, ConstructionNamesItsFault) {
  using S = typename TypeParam::Scalar;
  using V = icat::Vector3<S>;
  using O = icat::Obstacle<S>;
  using Clearance = icat::task::Clearance<TypeParam>;
  using Self = icat::task::SelfClearance<TypeParam>;
  Case<TypeParam> c;
  const auto message = [](auto&& build) -> std::string {
    try {
      build();
    } catch (const std::invalid_argument& e) {
      return e.what();
    }
    return "nothing was thrown";
  };
  const auto clearance = [&](auto bodies, auto obstacles, typename Clearance::Options options) {
    options.name = "arms";
    return message([&] { Clearance(c.robot, bodies, obstacles, c.objective, options); });
  };
  auto obstacles = c.obstacles;
  obstacles[2] = O::sphere(V(0, 0, 0), S(-1));
  EXPECT_EQ(clearance(c.bodies, obstacles, {}),
            "task 'arms': obstacle 2: its radius must be finite and > 0, got -1");
  obstacles[2] = O::plane(V(0, 0, 0), V(0, 0, 2));
  EXPECT_EQ(clearance(c.bodies, obstacles, {}),
            "task 'arms': obstacle 2: its normal must have length 1, got 2");
  obstacles[2] = O::box(pose<S>({0, 0, 0}), V(1, 1, -3));
  EXPECT_EQ(clearance(c.bodies, obstacles, {}),
            "task 'arms': obstacle 2: its edges must be > 0, got -3");
  auto bodies = c.bodies;
  bodies[1].shape.radius = 0;
  EXPECT_EQ(clearance(bodies, c.obstacles, {}),
            "task 'arms': body 1: its radius must be finite and > 0, got 0");
  EXPECT_EQ(clearance(c.bodies, std::vector<O>{}, {}), "task 'arms': needs a row at least, got 0");
  EXPECT_EQ(clearance(c.bodies, c.obstacles, {.bulge = 0}),
            "task 'arms': bulge must be in (0, 1], got 0");
  EXPECT_EQ(clearance(c.bodies, c.obstacles, {.gain = -1}),
            "task 'arms': gain must be finite and > 0, got -1");
  EXPECT_EQ(clearance(c.bodies, c.obstacles, {.max_rate = 0}),
            "task 'arms': max_rate must be > 0, got 0");

  const auto self = [&](const std::vector<icat::BodyPair>& pairs) {
    return message([&] { Self(c.robot, c.bodies, pairs, c.objective); });
  };
  EXPECT_EQ(self({{0, 1}, {0, 5}}), "task 'self clearance': body 5 is not among the 5");
  EXPECT_EQ(self({{-1, 1}}), "task 'self clearance': body -1 is not among the 5");
  EXPECT_EQ(self({{3, 3}}),
            "task 'self clearance': bodies 3 and 3 are on one frame, so they cannot move apart");
  EXPECT_EQ(self({}), "task 'self clearance': needs a row at least, got 0");
}

// A row whose centres coincide has no direction: it counts for nothing instead of for anything.
TYPED_TEST(ClearanceTask, FadesWhereCentresCoincide) {
  using S = typename TypeParam::Scalar;
  using V = icat::Vector3<S>;
  using O = icat::Obstacle<S>;
  using Body = icat::CollisionBody<S>;
  auto robot = make_robot<S, TypeParam::size>();
  const V at = robot.pose(robot.frame("l3")) * V(0, 0, 0);
  icat::task::Clearance task(robot, {Body::sphere(robot.frame("l3"), V(0, 0, 0), S(0.1))},
                             {O::sphere(at, S(0.2)), O::box(pose<S>(at.template cast<double>()),
                                                            V(S(0.3), S(0.3), S(0.3)))},
                             icat::Objective<S>::at_least(S(0.1), S(0.1)));
  task.update();
  for (Index row = 0; row < 2; ++row) {
    EXPECT_LT(task.jacobian().row(row).norm(), S(1e-6));
    EXPECT_LT(task.activation()(row), S(1e-6));
    EXPECT_LT(task.value(row), S(-0.1));
    EXPECT_TRUE(std::isfinite(task.reference()(row)));
  }
}

// A robot that is no more than the concept asks for: a point, and the world to compare with.
struct Gantry {
  using Scalar = double;
  static constexpr int size = 3;
  Index dof() const { return 3; }
  icat::FrameId frame(std::string_view name) const { return icat::FrameId(name == "point"); }
  icat::Pose<double> pose(icat::FrameId f) const { return ::pose(f.index() ? at : V3::Zero()); }
  const Eigen::Matrix<double, 6, 3>& jacobian(icat::FrameId f) const { return J[f.index()]; }

  V3 at{0.5, 0, 0};
  Eigen::Matrix<double, 6, 3> J[2] = {Eigen::Matrix<double, 6, 3>::Zero(),
                                      Eigen::Matrix<double, 6, 3>::Identity()};
};

TEST(Clearance, WorksWithAnyFramedRobot) {
  const Gantry robot;
  const auto objective = icat::Objective<double>::at_least(0.2, 0.3);
  using Body = icat::CollisionBody<double>;
  const std::vector<Body> bodies{Body::sphere(robot.frame("point"), {0, 0, 0.1}, 0.1),
                                 Body::sphere(robot.frame("world"), {0, 0, 0.1}, 0.2)};
  icat::task::Clearance clearance(robot, bodies, {Obstacle::plane({1, 0, 0}, {-1, 0, 0})},
                                  objective, {.gain = 2});
  icat::task::SelfClearance self(robot, bodies, {{0, 1}}, objective);
  clearance.update();
  self.update();
  EXPECT_NEAR(clearance.value(0), 0.4, 1e-15);
  EXPECT_LT((clearance.jacobian().row(0).transpose() - V3(-1, 0, 0)).norm(), 1e-15);
  EXPECT_NEAR(clearance.reference()(0), 2 * (0.5 - 0.4), 1e-15);
  EXPECT_NEAR(self.value(0), 0.2, 1e-15);
  EXPECT_LT((self.jacobian().row(0).transpose() - V3(1, 0, 0)).norm(), 1e-15);
}

// --- closed loop: a planar arm reaches for a goal that obstacles are in the way of

struct LoopRun {
  double smallest = 9, largest_step = 0, largest_speed = 0, travelled = 0, rest = 0, last_speed = 0;
  int contacts = 0;
};

LoopRun reach(const std::vector<Obstacle>& obstacles, const V3& goal, double dt) {
  const auto link = [](const std::string& name, const std::string& parent, double x) {
    icat::Joint<double> j{name, parent, name};
    j.origin = pose({x, 0, 0});
    return j;
  };
  icat::KinematicTree<double, 3> robot(
      {.joints = {link("upper", "base", 0), link("lower", "upper", 0.4),
                  link("hand", "lower", 0.4)}});
  const auto tip = robot.add_frame("tip", robot.frame("hand"), pose({0.3, 0, 0}));
  using Body = icat::CollisionBody<double>;
  icat::task::Clearance avoid(robot,
                              {Body::capsule(robot.frame("upper"), {0, 0, 0}, {0.4, 0, 0}, 0.04),
                               Body::capsule(robot.frame("lower"), {0, 0, 0}, {0.4, 0, 0}, 0.04),
                               Body::capsule(robot.frame("hand"), {0, 0, 0}, {0.3, 0, 0}, 0.04)},
                              obstacles, icat::Objective<double>::at_least(0.01, 0.04),
                              {.gain = 4, .max_rate = 0.3});
  icat::task::FramePosition go(robot, tip, goal,
                               {.axes = {.z = false}, .gain = 1, .max_rate = 0.3});
  icat::Tpik<double, 3> tpik;
  LoopRun run;
  V3 q(0.9, 0.3, 0.3), last = V3::Zero();
  V3 before = V3::Zero();
  for (int i = 0; i * dt < 12; ++i) {
    EXPECT_EQ(robot.update(q), icat::Status::ok);
    avoid.update();
    go.update();
    tpik.reset();
    EXPECT_EQ(tpik.add_level(avoid.jacobian(), avoid.activation(), avoid.reference()),
              icat::Status::ok);
    EXPECT_EQ(tpik.add_level(go.jacobian(), go.activation(), go.reference()), icat::Status::ok);
    EXPECT_EQ(tpik.minimize_velocity(), icat::Status::ok);
    const V3 velocity = tpik.velocity(), hand = robot.pose(tip).translation();
    run.smallest = std::min(run.smallest, avoid.smallest());
    if (i > 0) {
      run.largest_step = std::max(run.largest_step, (velocity - last).norm());
      if (avoid.smallest() < 0.05) {
        ++run.contacts;
        run.travelled += (hand - before).norm();
      }
    }
    run.largest_speed = std::max(run.largest_speed, velocity.norm());
    run.last_speed = velocity.norm();
    run.rest = (hand - goal).norm();
    before = hand;
    last = velocity;
    q += dt * velocity;
  }
  return run;
}

TEST(ClearanceLoop, SlidesAlongObstaclesWithoutPenetrating) {
  struct Setting {
    std::string name;
    std::vector<Obstacle> obstacles;
    V3 goal;
    bool reachable;
  };
  const Setting settings[] = {
      {"around a sphere", {Obstacle::sphere({0.75, 0.15, 0}, 0.12)}, {0.7, -0.35, 0}, true},
      {"along a box",
       {Obstacle::box(pose({0.75, 0.0, 0}), {0.6, 0.3, 0.3})},
       {0.85, 0.0, 0},
       false},
      {"along a wall", {Obstacle::plane({0, -0.1, 0}, {0, 1, 0})}, {0.8, -0.3, 0}, false},
      {"between two",
       {Obstacle::sphere({0.1, 0.75, 0}, 0.1), Obstacle::capsule({0.8, 0, -1}, {0.8, 0, 1}, 0.1)},
       {0.9, 0.3, 0},
       false},
  };
  for (const Setting& s : settings) {
    const LoopRun coarse = reach(s.obstacles, s.goal, 2e-3);
    const LoopRun fine = reach(s.obstacles, s.goal, 5e-4);
    for (const LoopRun& run : {coarse, fine}) {
      // The objective's minimum is 0.01; the obstacles are at rest, so nothing gets nearer.
      EXPECT_GT(run.smallest, 0.01) << s.name;
      EXPECT_GT(run.contacts, 1000) << s.name;
      EXPECT_GT(run.travelled, 0.2) << s.name;
      EXPECT_LT(run.last_speed, 1e-2) << s.name;
      EXPECT_LT(run.largest_speed, 5) << s.name;
      EXPECT_TRUE(!s.reachable || run.rest < 1e-3) << s.name << run.rest;
    }
    // A jump would be as large in short steps.
    EXPECT_LT(fine.largest_step, 0.3 * coarse.largest_step) << s.name;
  }
}

}  // namespace
