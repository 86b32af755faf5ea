// SPDX-License-Identifier: BSD-3-Clause
#include "maris.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <sstream>
#include <stdexcept>

namespace support {

namespace {

using Body = icat::RigidBody<double>;

template <class V>
std::string text(const V& v) {
  std::ostringstream s;
  s.precision(17);
  for (icat::Index i = 0; i < v.size(); ++i) s << v(i) << ' ';
  return s.str();
}
std::string text(const icat::Pose<double>& pose) {
  const Eigen::Quaterniond q(pose.linear());
  return "pos='" + text(pose.translation()) + "' quat='" +
         text(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z())) + "'";
}

std::string inertial(const Body& body) {
  // Along principal axes: MuJoCo's own diagonalization keeps eight digits only.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(body.inertia);
  icat::Pose<double> axes = body.pose;
  axes.linear() *= principal.eigenvectors() * principal.eigenvectors().determinant();
  return "<inertial " + text(axes) + " mass='" + text(icat::Vector<double, 1>(body.mass)) +
         "' diaginertia='" + text(principal.eigenvalues()) + "'/>\n";
}
// As long along z as the cuboid with this inertia, 5 cm thick.
std::string link_shape(const Body& body) {
  const auto& I = body.inertia;
  const double length = std::sqrt(6 / body.mass * (I(0, 0) + I(1, 1) - I(2, 2)));
  return "<geom class='robot' type='cylinder' " + text(body.pose) + " size='" +
         text(Eigen::Vector2d(0.05, length / 2)) + "'/>\n";
}

}  // namespace

MujocoScene pool() {
  return {.option =
              "<option timestep='0.002' gravity='0 0 -0.0981' density='1000' "
              "viscosity='0.001'/>",
          .world =
              "<geom class='scene' type='plane' pos='0 0 3.05' zaxis='0 0 -1' size='9 9 1'/>"
              "<geom class='scene' name='pipe' type='cylinder' pos='0.5 0.5 3' size='0.05 1.5'"
              " zaxis='-0.5646 0.8253 0'/>",  // across the heading of 0.6 rad
          .shapes = true};
}

// Bodies of links are parallel to their parent's at q = 0, so ⟨b⟩ is the frame of all.
std::string mjcf(const icat::VehicleManipulatorDynamics<double, 7>::Description& robot,
                 const MujocoScene& scene) {
  std::ostringstream xml;
  xml << "<mujoco><compiler inertiafromgeom='false' angle='radian' boundmass='0'/>" << scene.option
      << "<default><default class='robot'><geom contype='1' conaffinity='2'/></default>"
      << "<default class='scene'><geom contype='2' conaffinity='1'/></default></default>"
      << "<worldbody>" << scene.world << "<body name='vehicle'><freejoint/>\n"
      << inertial(robot.vehicle);
  if (scene.shapes) xml << "<geom class='robot' name='hull' type='box' size='0.5 0.3 0.365'/>\n";
  for (std::size_t i = 0; i < 7; ++i) {
    const auto& joint = robot.arm.joints[i];
    xml << "<body name='link" << i + 1 << "' " << (i == 0 ? text(robot.arm_mount) : "")
        << "><joint name='joint" << i + 1 << "' type='"
        << (joint.type == icat::JointType::revolute ? "hinge" : "slide") << "' axis='"
        << text(joint.axis) << "' pos='" << text(joint.point) << "' limited='true' range='"
        << text(Eigen::Vector2d(joint.lower, joint.upper)) << "'/>\n"
        << inertial(robot.links[i]);
    if (scene.shapes) xml << link_shape(robot.links[i]);
  }
  for (int i = 0; i < 8; ++i) xml << "</body>";
  xml << "</worldbody></mujoco>";
  return xml.str();
}

MujocoModel load_mujoco(const std::string& xml) {
  mjVFS files;
  mj_defaultVFS(&files);
  mj_makeEmptyFileVFS(&files, "robot.xml", static_cast<int>(xml.size()));
  std::copy(xml.begin(), xml.end(), static_cast<char*>(files.filedata[0]));
  char error[1000] = "";
  MujocoModel model(mj_loadXML("robot.xml", &files, error, sizeof error), mj_deleteModel);
  mj_deleteVFS(&files);
  if (!model) throw std::runtime_error(error);
  return model;
}

}  // namespace support
