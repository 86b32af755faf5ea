// SPDX-License-Identifier: BSD-3-Clause
// Mass matrix, bias forces and accelerations against MuJoCo's, in vacuum: added mass and drag it
// models otherwise.
//
// MuJoCo: q̇vel = ν = [v of the vehicle on ⟨0⟩; ω on ⟨v⟩; q̇] = T ẏ, hence M = Tᵀ M_m T and
// c = Tᵀ (c_m + M_m Ṫ ẏ) with Ṫ ẏ = [R (ω × v); 0; 0].
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <Eigen/Eigenvalues>
#include <memory>
#include <sstream>

#include "support/hydrodynamics.hpp"

namespace {

using namespace testing_support;
using MatrixN = Dynamics::MatrixN;

template <class V>
std::string text(const V& v) {
  std::ostringstream s;
  s.precision(17);
  for (Eigen::Index i = 0; i < v.size(); ++i) s << v(i) << ' ';
  return s.str();
}
std::string text(const icat::Pose<double>& pose) {
  const Eigen::Quaterniond q(pose.linear());
  return "pos='" + text(pose.translation()) + "' quat='" +
         text(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z())) + "'";
}

// Bodies of links are parallel to their parent's at q = 0, so ⟨b⟩ is the frame of all.
std::string mjcf(const Dynamics::Description& d) {
  std::ostringstream xml;
  const auto inertial = [&](const icat::RigidBody<double>& b) {
    // Along principal axes: MuJoCo's own diagonalization keeps eight digits only.
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(b.inertia);
    icat::Pose<double> axes = b.pose;
    axes.linear() *= principal.eigenvectors() * principal.eigenvectors().determinant();
    xml << "<inertial " << text(axes) << " mass='" << text(icat::Vector<double, 1>(b.mass))
        << "' diaginertia='" << text(principal.eigenvalues()) << "'/>\n";
  };
  xml << "<mujoco><compiler inertiafromgeom='false' angle='radian' boundmass='0'/>"
      << "<option gravity='0 0 " << text(icat::Vector<double, 1>(d.gravity))
      << "'><flag contact='disable' constraint='disable'/></option><worldbody>"
      << "<body name='vehicle'><freejoint/>\n";
  inertial(d.vehicle);
  for (std::size_t i = 0; i < 7; ++i) {
    const auto& joint = d.arm.joints[i];
    xml << "<body " << (i == 0 ? text(d.arm_mount) : "") << "><joint type='"
        << (joint.type == icat::JointType::revolute ? "hinge" : "slide") << "' axis='"
        << text(joint.axis) << "' pos='" << text(joint.point) << "'/>\n";
    inertial(d.links[i]);
  }
  for (int i = 0; i < 8; ++i) xml << "</body>";
  xml << "</worldbody></mujoco>";
  return xml.str();
}

struct Engine {
  std::unique_ptr<mjModel, void (*)(mjModel*)> model{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, void (*)(mjData*)> data{nullptr, mj_deleteData};

  explicit Engine(const std::string& xml) {
    mjVFS files;
    mj_defaultVFS(&files);
    mj_makeEmptyFileVFS(&files, "robot.xml", static_cast<int>(xml.size()));
    std::copy(xml.begin(), xml.end(), static_cast<char*>(files.filedata[0]));
    char error[1000] = "";
    model.reset(mj_loadXML("robot.xml", &files, error, sizeof error));
    mj_deleteVFS(&files);
    if (!model) throw std::runtime_error(error);
    data.reset(mj_makeData(model.get()));
  }
};

void compare(const Dynamics::Description& description) {
  Engine engine(mjcf(description));
  const mjModel* m = engine.model.get();
  mjData* d = engine.data.get();
  ASSERT_EQ(m->nv, 13);
  ASSERT_EQ(m->nq, 14);
  Dynamics dynamics(description);
  std::mt19937 rng(17);
  double worst[3] = {};
  for (const auto& state : random_states<double>(100, 18)) {
    SCOPED_TRACE(state.name);
    const VectorN y = random_vector(rng, 1.5), f = random_vector(rng, 100);
    const Eigen::Matrix3d R = state.vehicle.linear();
    const Eigen::Vector3d v = y.segment<3>(7), w = y.tail<3>();
    MatrixN T = MatrixN::Zero();
    T.block<3, 3>(0, 7) = R;
    T.block<3, 3>(3, 10).setIdentity();
    T.block<7, 7>(6, 0).setIdentity();
    VectorN T_dot_y = VectorN::Zero();
    T_dot_y.head<3>() = R * w.cross(v);

    const Eigen::Quaterniond quaternion(R);
    Eigen::Map<Eigen::Vector3d>(d->qpos) = state.vehicle.translation();
    Eigen::Map<Eigen::Vector4d>(d->qpos + 3) << quaternion.w(), quaternion.vec();
    Eigen::Map<icat::Vector<double, 7>>(d->qpos + 7) = state.q;
    Eigen::Map<VectorN>(d->qvel) = T * y;
    // f · ẏ = f_m · T ẏ.
    Eigen::Map<VectorN>(d->qfrc_applied) = T * f;  // T is orthogonal
    mj_forward(m, d);
    Eigen::Matrix<double, 13, 13, Eigen::RowMajor> M;
    mj_fullM(m, M.data(), d->qM);
    const VectorN c = Eigen::Map<VectorN>(d->qfrc_bias), acc = Eigen::Map<VectorN>(d->qacc);

    ASSERT_EQ(dynamics.update(state.q, state.vehicle, y), icat::Status::ok);
    const MatrixN expected_M = T.transpose() * M * T;
    const VectorN expected_c = T.transpose() * (c + M * T_dot_y);
    const VectorN expected_a = T.transpose() * (acc - T_dot_y);
    const VectorN a = dynamics.mass_matrix().llt().solve(f - dynamics.bias());
    const double error[3] = {(dynamics.mass_matrix() - expected_M).norm() / expected_M.norm(),
                             (dynamics.bias() - expected_c).norm() / expected_c.norm(),
                             (a - expected_a).norm() / expected_a.norm()};
    for (int i = 0; i < 3; ++i) {
      worst[i] = std::max(worst[i], error[i]);
      EXPECT_LT(error[i], 1e-8) << "M, c, acceleration: " << i;
    }
  }
  std::printf("largest relative differences: M %.1e, c %.1e, acceleration %.1e\n", worst[0],
              worst[1], worst[2]);
}

TEST(DynamicsAgainstMujoco, TheRobotOfThePaper) { compare(dry(maris_description())); }

TEST(DynamicsAgainstMujoco, RandomBodiesAndASlidingJoint) {
  for (unsigned seed = 0; seed < 5; ++seed) compare(random_description(seed));
}

}  // namespace
