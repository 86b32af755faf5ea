// SPDX-License-Identifier: BSD-3-Clause
// Mass matrix, bias forces and accelerations against MuJoCo's, in vacuum: added mass and drag it
// models otherwise.
//
// MuJoCo: q̇vel = ν = [v of the vehicle on ⟨0⟩; ω on ⟨v⟩; q̇] = T ẏ, hence M = Tᵀ M_m T and
// c = Tᵀ (c_m + M_m Ṫ ẏ) with Ṫ ẏ = [R (ω × v); 0; 0].
#include <gtest/gtest.h>

#include <memory>
#include <sstream>

#include "../examples/support/mujoco/maris.hpp"
#include "support/hydrodynamics.hpp"

namespace {

using namespace testing_support;
using MatrixN = Dynamics::MatrixN;

void compare(const Dynamics::Description& description) {
  std::ostringstream option;
  option.precision(17);
  option << "<option gravity='0 0 " << description.gravity
         << "'><flag contact='disable' constraint='disable'/></option>";
  const std::string text = option.str();
  const auto model = support::load_mujoco(support::mjcf(description, {.option = text.c_str()}));
  const mjModel* m = model.get();
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(m), mj_deleteData);
  mjData* d = data.get();
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
