// SPDX-License-Identifier: BSD-3-Clause
// The arm law of [Coop, Eq. (24), (25)] against MARIS' TPIK 2, and the two ways of telling the
// solver what is not actuated.
#include <gtest/gtest.h>

#include <icat/tpik/parametric_tpik.hpp>
#include <icat/tpik/tpik.hpp>

#include "support/random_hierarchy.hpp"

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using icat::Status;
using Vector6d = icat::Vector6<double>;

TEST(ParametricTpik, AgreesWithTpik2ForEveryVehicleVelocity) {
  double worst = 0;
  for (unsigned seed = 0; seed < 500; ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    RandomHierarchy h = gen.hierarchy(10, 20);
    const Eigen::Index l = h.dof - 6;
    icat::ParametricTpik<double> law(l);
    for (const auto& level : h.levels) {
      ASSERT_EQ(law.add_level(level.J, level.a, level.reference), Status::ok);
    }
    ASSERT_EQ(law.minimize_velocity(), Status::ok);
    MatrixXd Q0 = MatrixXd::Zero(h.dof, h.dof);
    Q0.topLeftCorner(l, l).setIdentity();
    icat::Tpik<double> tpik2(h.dof);
    for (int k = 0; k < 5; ++k) {
      const Vector6d v = gen.matrix(6, 1) * (k == 0 ? 0.0 : 0.3);
      VectorXd rho0 = VectorXd::Zero(h.dof);
      rho0.tail<6>() = v;
      ASSERT_EQ(tpik2.reset(rho0, Q0), Status::ok);
      for (const auto& level : h.levels) {
        ASSERT_EQ(tpik2.add_level(level.J, level.a, level.reference), Status::ok);
      }
      ASSERT_EQ(tpik2.minimize_velocity(), Status::ok);
      const VectorXd expected = tpik2.velocity().head(l);
      const double error = (law.evaluate(v) - expected).norm() / std::max(1.0, expected.norm());
      worst = std::max(worst, error);
      ASSERT_LE(error, 1e-9);
      ASSERT_EQ(tpik2.velocity().tail<6>(), v);
    }
  }
  std::printf("worst relative error %.2e\n", worst);
}

TEST(ParametricTpik, StaticSizeAgreesWithDynamic) {
  HierarchyGenerator gen(77);
  const RandomHierarchy h = gen.hierarchy(13, 13);
  icat::ParametricTpik<double, 7> fixed;
  icat::ParametricTpik<double> dynamic(7);
  for (const auto& level : h.levels) {
    ASSERT_EQ(fixed.add_level(level.J, level.a, level.reference), Status::ok);
    ASSERT_EQ(dynamic.add_level(level.J, level.a, level.reference), Status::ok);
  }
  ASSERT_EQ(fixed.minimize_velocity(), Status::ok);
  ASSERT_EQ(dynamic.minimize_velocity(), Status::ok);
  EXPECT_LT((fixed.rho() - dynamic.rho()).norm(), 1e-9 * (1 + fixed.rho().norm()));
  EXPECT_LT((fixed.P() - dynamic.P()).norm(), 1e-9 * (1 + fixed.P().norm()));
}

TEST(ParametricTpik, RefusesBadInput) {
  icat::ParametricTpik<double, 7> law;
  HierarchyGenerator gen(1);
  MatrixXd J = gen.matrix(2, 13);
  const VectorXd one = VectorXd::Ones(2);
  ASSERT_EQ(law.add_level(J, one, one), Status::ok);
  const VectorXd rho = law.rho();
  J(1, 12) = NAN;
  EXPECT_EQ(law.add_level(J, one, one), Status::non_finite);
  EXPECT_EQ(law.add_level(MatrixXd(J.leftCols(7)), one, one), Status::wrong_size);
  EXPECT_EQ(law.rho(), rho);
  EXPECT_EQ(law.report().failed_level(), 1);
  EXPECT_EQ(law.report().failed_row(), 1);
  EXPECT_THROW((icat::ParametricTpik<double, 7>({.projection_weight = -1})), std::invalid_argument);
  EXPECT_THROW(icat::ParametricTpik<double>(0), std::invalid_argument);
}

// [Coop, Eq. (31)] against [MARIS, III-B8], activations binary.
TEST(Underactuation, BothFormulationsAgree) {
  double worst = 0;
  for (unsigned seed = 0; seed < 300; ++seed) {
    SCOPED_TRACE(seed);
    HierarchyGenerator gen(seed);
    RandomHierarchy h = gen.hierarchy(10, 20);
    for (auto& level : h.levels) {
      level.a = level.a.unaryExpr([](double a) { return a > 0.5 ? 1.0 : 0.0; });
    }
    VectorXd rho0 = VectorXd::Zero(h.dof), mask = VectorXd::Zero(6);
    const VectorXd measured = gen.matrix(6, 1) * 0.2;
    MatrixXd Q0 = MatrixXd::Identity(h.dof, h.dof);
    for (int i = 0; i < 6; ++i) {
      if (gen.integer(0, 1) == 0) continue;
      mask(i) = 1;
      rho0(h.dof - 6 + i) = measured(i);
      Q0(h.dof - 6 + i, h.dof - 6 + i) = 0;
    }
    icat::Tpik<double> coop(h.dof), maris(h.dof);
    ASSERT_EQ(coop.reset(rho0, Q0), Status::ok);
    maris.reset();
    MatrixXd J = MatrixXd::Zero(6, h.dof);
    J.rightCols(6).setIdentity();
    ASSERT_EQ(maris.add_level(J, mask, measured), Status::ok);
    for (const auto& level : h.levels) {
      ASSERT_EQ(coop.add_level(level.J, level.a, level.reference), Status::ok);
      ASSERT_EQ(maris.add_level(level.J, level.a, level.reference), Status::ok);
    }
    ASSERT_EQ(coop.minimize_velocity(), Status::ok);
    ASSERT_EQ(maris.minimize_velocity(), Status::ok);
    const double error =
        (coop.velocity() - maris.velocity()).norm() / std::max(1.0, coop.velocity().norm());
    worst = std::max(worst, error);
    ASSERT_LE(error, 1e-9);
    for (int i = 0; i < 6; ++i) {
      if (mask(i) == 1) {
        ASSERT_EQ(coop.velocity()(h.dof - 6 + i), measured(i));
      }
    }
  }
  std::printf("worst relative error %.2e\n", worst);
}

// Eigen stores the law of a single joint by rows.
TEST(ParametricTpik, OneJoint) {
  icat::ParametricTpik<double, 1> law;
  icat::ParametricTpik<double> dynamic(1);
  MatrixXd J(1, 7), J2(1, 7);
  J << 1, 2, 3, 4, 5, 6, 7;
  J2 << 0.5, 7, 6, 5, 4, 3, 2;
  const VectorXd half = VectorXd::Constant(1, 0.5), one = VectorXd::Ones(1);
  for (const auto& level : {J, J2}) {
    ASSERT_EQ(law.add_level(level, half, one), Status::ok);
    ASSERT_EQ(dynamic.add_level(level, half, one), Status::ok);
  }
  EXPECT_LT((MatrixXd(law.P()) - MatrixXd(dynamic.P())).norm(), 1e-12);
  icat::Tpik<double, 7> tpik;
  Eigen::Matrix<double, 7, 7> Q0 = Eigen::Matrix<double, 7, 7>::Zero();
  Q0(0, 0) = 1;
  Eigen::Matrix<double, 7, 1> rho0;
  rho0 << 0, 1, -2, 3, -4, 5, -6;
  ASSERT_EQ(tpik.reset(rho0, Q0), Status::ok);
  for (const auto& level : {J, J2}) ASSERT_EQ(tpik.add_level(level, half, one), Status::ok);
  const Vector6d v = rho0.tail<6>();
  EXPECT_NEAR(law.evaluate(v)(0), tpik.velocity()(0), 1e-12);
}

}  // namespace
