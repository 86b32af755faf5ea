// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The planar vehicle with two arms of [NSB, II] and its five tasks [NSB, III], in the plane z = 0
/// of ⟨0⟩, y up.
///
///     ẏ = [q̇₂ q̇₁ u v r]     ζ₂ = its first two, ζ₁ = its last six; u, v on the vehicle
///
/// **Errata.** Eq. (3), (23): `q12` in the second arm is `q22`. Eq. (13): J₁₂ has six columns.
/// Eq. (20): the rotation's (1,2) entry is `−sin`. Eq. (22): J_p and J_o are on ⟨b⟩, so a, a_des
/// and p_e are too; here all of them are on ⟨0⟩, which changes neither σ₂₁ nor J₂₁.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <icat/icat.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "../support/geometry.hpp"

namespace nsb {

namespace task = icat::task;
inline constexpr double degree = std::numbers::pi / 180;
using Robot = icat::KinematicTree<double, 8>;
using Pose = icat::Pose<double>;
using Vector3 = icat::Vector3<double>;
using Vector6 = icat::Vector6<double>;
using Joints = icat::Vector<double, 5>;  ///< q₂, q₁
using Velocity = icat::Vector<double, 8>;
using Link = icat::DhRow<double>;

inline Link link(double length) {
  return {length, 0, 0, 0, icat::JointType::revolute, -170 * degree, 170 * degree};
}
/// Of vehicle and links, m. The paper gives none.
struct Dimensions {
  double length = 1.2, height = 0.5;
  std::vector<Link> arm1{link(0.4), link(0.4), link(0.4)}, arm2{link(0.5), link(0.4)};
};

//! [robot]
/// Eq. (1)–(5). Arm 2 comes first: so the leader, vehicle and arm 1, has adjacent columns.
inline Robot make_robot(const Dimensions& d) {
  std::vector<icat::Joint<double>> joints;
  const auto add = [&](const std::string& arm, double x, const std::vector<Link>& links) {
    joints.push_back({arm, "vehicle", arm, icat::JointType::fixed,
                      support::pose({x, d.height / 2, 0}, 0, 0, 0)});
    for (const auto& joint : icat::dh_chain(links, icat::DhConvention::standard, arm, arm + "_")) {
      joints.push_back(joint);
    }
  };
  add("arm2", d.length / 2, d.arm2);
  add("arm1", -d.length / 2, d.arm1);
  return Robot({.joints = joints, .base = icat::Base<double>::surface()});  // u, v, r
}
//! [robot]

/// The reference of σ₁₁: a point that goes along a line at constant speed and waits at its end, and
/// an orientation normal to the line, to its left.
struct Line {
  Vector3 start, end;  ///< m
  double speed;        ///< m/s

  Vector3 direction() const { return (end - start).normalized(); }
  double duration() const { return (end - start).norm() / speed; }
  Pose pose(double t) const {
    return support::pose(start + direction() * speed * std::min(t, duration()), 0, 0,
                         std::atan2(direction().y(), direction().x()) + 90 * degree);
  }
  Vector6 velocity(double t) const {
    Vector6 v = Vector6::Zero();
    if (t < duration()) v.head<3>() = speed * direction();
    return v;
  }
};

/// ε of [NSB, Remark 2].
inline constexpr double field_of_view_epsilon = 1e-3;

/// σ₂₁ = ‖a_des − a‖, Eq. (17)–(23): a is where the camera's x axis points, a_des where the target
/// is. `LookAt` has the angle 2 asin(σ₂₁/2) instead, so it does not converge as the paper's does.
///
/// Remark 2: the Jacobian divides by ε where the norm is smaller. J₂₁ then passes through 0 instead
/// of jumping from one sign to the other, but J₂₁⁺ grows as J₂₁ shrinks: a rate of −λσ₂₁ would make
/// the arm chatter with ±λε. So give the rate the factor that the Jacobian has: J⁺ rate is then
/// what it is without Remark 2, and smooth.
class FieldOfView : public icat::ScalarTask<Robot> {
 public:
  FieldOfView(const Robot& robot, icat::FrameId camera, icat::FrameId target, double gain)
      : ScalarTask(robot, "field of view", icat::Objective<double>::equal_to(0), gain,
                   icat::infinity<double>),
        camera_(camera),
        target_(target) {}

 private:
  void compute() noexcept override {
    const Pose camera = robot().pose(camera_);
    const Vector3 a = camera.linear().col(0);
    const Vector3 p_e = robot().pose(target_).translation() - camera.translation();
    const double range = std::max(p_e.norm(), 1e-9);  // in the lens: no direction
    const Vector3 a_des = p_e / range;
    Vector3 difference = a_des - a;
    set_value(difference.norm());
    reference_ *= std::min(1.0, value() / field_of_view_epsilon);
    // Below rounding the difference has no direction. J = 0 would hand its null space to the next
    // task for a cycle; so the limit, with what is left of its length.
    constexpr double rounding = 1e-12;
    if (value() < rounding) difference = rounding * Vector3::UnitZ().cross(a);
    const Vector3 unit = difference / std::max(value(), field_of_view_epsilon);
    // −S(a_des) S(p_e)⁺ x = −(I − a_des a_desᵀ) x / ‖p_e‖ and uᵀ S(a) ω = −(a × u)ᵀ ω.
    const Vector3 along = (unit - a_des * a_des.dot(unit)) / range;
    const auto &J = robot().jacobian(camera_), &K = robot().jacobian(target_);
    jacobian_ =
        along.transpose() * (K - J).topRows<3>() - a.cross(unit).transpose() * J.bottomRows<3>();
  }

  icat::FrameId camera_, target_;
};

inline constexpr icat::Axes in_plane{.z = false}, about_z{.x = false, .y = false};

/// σ₁₃ is along y of the world; `relative_to` the vehicle would be along the vehicle's.
inline auto height_over_vehicle(icat::FrameId hand) {
  return [hand](const Robot& robot, auto x, auto J) {
    x(0) = robot.pose(hand)(1, 3) - robot.pose(robot.base())(1, 3);
    J = robot.jacobian(hand).row(1) - robot.jacobian(robot.base()).row(1);
  };
}

//! [tasks]
/// σ₁₁ (8)–(10), σ₁₂ (11)–(13), σ₁₃ (14)–(16) of the leader, σ₂₁ (17)–(23), σ₂₂ (24)–(26) of the
/// follower, with the gains of (35).
struct Tasks {
  const Robot& robot;
  Line line;
  icat::Objective<double> height;
  icat::FrameId hand = robot.frame("arm1_link3"), camera = robot.frame("arm2_link2");

  task::FramePose<Robot> tool{
      robot, hand, line.pose(0), {.linear = in_plane, .angular = about_z, .gain = 1}};
  task::FrameOrientation<Robot> level{
      robot, robot.base(), Pose::Identity().linear(), {.axes = about_z, .gain = 3}};
  task::FunctionTask<Robot> distance{robot, height, height_over_vehicle(hand), {.gain = 2}};
  FieldOfView view{robot, camera, hand, 1};
  task::JointPosition<Robot> joint{
      robot, Eigen::VectorXd::Constant(1, 90 * degree), {.joints = {"arm2_joint1"}, .gain = 3}};

  icat::Status follow(double t) noexcept { return tool.set_goal(line.pose(t), line.velocity(t)); }
};
//! [tasks]

/// σ_d − σ of σ₁₁ (3 rows), σ₁₂, σ₁₃, σ₂₁, σ₂₂ as of the last update, at t.
inline icat::Vector<double, 7> errors(const Tasks& k, double t) {
  const Vector6 v = k.line.velocity(t);
  icat::Vector<double, 7> e;
  e << (k.tool.reference() - Vector3(v(0), v(1), v(5))) / k.tool.gain(),
      k.level.reference() / k.level.gain(), k.distance.reference() / k.distance.gain(),
      -k.view.value(), k.joint.reference() / k.joint.gain();
  return e;
}

}  // namespace nsb
