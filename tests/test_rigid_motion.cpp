// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <icat/math/numerical_differentiation.hpp>
#include <icat/math/rigid_motion.hpp>
#include <icat/math/smooth_step.hpp>

#include "support/states.hpp"

namespace {

template <class S>
class RigidMotion : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(RigidMotion, Scalars);

// A tolerance of so many roundings of numbers of order 1.
template <class S>
constexpr S roundings(int n) {
  return S(n) * std::numeric_limits<S>::epsilon();
}

TYPED_TEST(RigidMotion, LogInvertsExp) {
  using S = TypeParam;
  using V = icat::Vector3<S>;
  constexpr S pi = std::numbers::pi_v<S>;
  const V axis = V(S(0.36), S(-0.48), S(0.8));
  for (const S angle :
       {S(0), S(1e-12), S(1e-8), S(1e-4), S(0.5), S(2), pi - S(1e-3), pi - S(1e-6)}) {
    const V phi = angle * axis;
    EXPECT_LT((icat::rotation_log<S>(icat::rotation_exp<S>(phi)) - phi).norm(), roundings<S>(40))
        << angle;
  }
  // At π the axis has two signs.
  const V at_pi = icat::rotation_log<S>(icat::rotation_exp<S>(V(pi * axis)));
  EXPECT_LT(std::min((at_pi - pi * axis).norm(), (at_pi + pi * axis).norm()), roundings<S>(40));
}

TYPED_TEST(RigidMotion, IntegratesTwistsExactly) {
  using S = TypeParam;
  for (const double scale : {0.0, 1e-9, 1e-5, 9e-3, 1.1e-2, 1.0, 3.0}) {
    icat::Vector6<S> twist;
    twist << S(0.3), S(-0.2), S(0.5), S(scale * 0.36), S(scale * -0.48), S(scale * 0.8);
    const auto start = testing_support::make_pose<S>(1, 2, 3, 0.1, 0.2, 0.3);
    const icat::Pose<double> begin = testing_support::make_pose<double>(1, 2, 3, 0.1, 0.2, 0.3);
    using M4 = Eigen::Matrix<long double, 4, 4>;
    M4 generator = M4::Zero();
    generator.topLeftCorner<3, 3>() =
        icat::skew(twist.template tail<3>().template cast<long double>());
    generator.topRightCorner<3, 1>() = twist.template head<3>().template cast<long double>();
    // exp by scaling and squaring of the Taylor series.
    M4 exponential = M4::Identity(), term = exponential;
    for (int k = 1; k < 20; ++k) {
      term = (term * generator / (1024.0L * k)).eval();
      exponential += term;
    }
    for (int k = 0; k < 10; ++k) exponential = (exponential * exponential).eval();
    const M4 expected = begin.matrix().template cast<long double>() * exponential;
    const icat::Pose<S> got = icat::integrate<S>(start, twist, S(1));
    EXPECT_LT(static_cast<S>((got.matrix().template cast<long double>() - expected).norm()),
              roundings<S>(60))
        << scale;
  }
}

TYPED_TEST(RigidMotion, MisalignmentAndItsRates) {
  using S = TypeParam;
  using V = icat::Vector3<S>;
  constexpr double pi = std::numbers::pi;
  for (const double theta : {0.0, 1e-9, 5e-4, 2e-3, 0.3, pi / 2, 2.5, pi - 0.6, pi - 0.4, pi - 0.05,
                             pi - 2e-4, pi - 5e-5, pi}) {
    for (const double psi : {0.0, 0.7, 3.0, 4.4}) {
      SCOPED_TRACE(testing::Message() << theta << ' ' << psi);
      const V n(S(-std::sin(psi)), S(std::cos(psi)), S(0));
      const V d(S(std::sin(theta) * std::cos(psi)), S(std::sin(theta) * std::sin(psi)),
                S(std::cos(theta)));
      const auto m = icat::misalignment_from_z<S>(d);
      EXPECT_NEAR(m.angle, S(theta), roundings<S>(8));
      // θ n; at π, where rounding makes n, only its length.
      if (theta < pi) {
        EXPECT_LT((m.vector - S(theta) * n.template head<2>()).norm(),
                  roundings<S>(8) * (1 + S(pi) / std::max(std::hypot(d(0), d(1)), S(1e-4))));
      }
      EXPECT_NEAR(m.vector.norm(), S(theta), roundings<S>(8));
      // No direction that d can move in is lost, none is stretched.
      const icat::Matrix3<S> across = icat::Matrix3<S>::Identity() - d * d.transpose();
      const Eigen::Matrix<S, 2, 3> rate = m.vector_rate * across;
      EXPECT_LT((rate.transpose() * rate - across).norm(), roundings<S>(80));
      // Along n it is θ̇. At both ends n is not known.
      const S sine = std::hypot(d(0), d(1));
      if (sine > S(1e-3)) {
        EXPECT_LT((n.template head<2>().transpose() * rate - m.angle_gradient).norm(),
                  roundings<S>(20) / sine);
      }
      // Derivatives along rotations of d, the only motions it has, in double.
      if constexpr (std::is_same_v<S, double>) {
        const auto rotated = [&](const V& w) { return V(icat::rotation_exp<S>(w) * d); };
        const auto angle_numeric = icat::central_difference(
            [&](const V& w) {
              return icat::Vector<S, 1>(icat::misalignment_from_z<S>(rotated(w)).angle);
            },
            V(V::Zero()), 1e-7);
        // Closer to the kink than the step the difference sees both of its sides.
        if (theta != 1e-9) {
          EXPECT_LT((-m.angle_gradient * icat::skew(d) - angle_numeric).norm(), 1e-5);
        }
        const auto numeric = icat::central_difference(
            [&](const V& w) { return icat::misalignment_from_z<S>(rotated(w)).vector; },
            V(V::Zero()), 1e-7);
        if (theta < 1e-2) {
          EXPECT_LT((-m.vector_rate * icat::skew(d) - numeric).norm(), 1e-5);
        }
      }
    }
  }
}

TYPED_TEST(RigidMotion, StraightBehindTheMisalignmentIsAboutX) {
  using S = TypeParam;
  const auto m = icat::misalignment_from_z<S>(icat::Vector3<S>(S(0), S(0), S(-1)));
  EXPECT_EQ(m.vector, (icat::Vector<S, 2>(std::numbers::pi_v<S>, S(0))));
  Eigen::Matrix<S, 2, 3> rate;
  rate << S(0), S(1), S(0), S(1), S(0), S(0);
  EXPECT_EQ(m.vector_rate, rate);
}

TYPED_TEST(RigidMotion, SmoothStepStaysInTheUnitInterval) {
  using S = TypeParam;
  EXPECT_EQ(icat::smooth_step(S(-1)), S(0));
  EXPECT_EQ(icat::smooth_step(S(0)), S(0));
  EXPECT_EQ(icat::smooth_step(S(0.5)), S(0.5));
  EXPECT_EQ(icat::smooth_step(S(1)), S(1));
  EXPECT_EQ(icat::smooth_step(std::numeric_limits<S>::infinity()), S(1));
  EXPECT_TRUE(std::isnan(icat::smooth_step(std::numeric_limits<S>::quiet_NaN())));
  S u = 1;
  for (int i = 0; i < 1000; ++i) {
    u = std::nextafter(u, S(0));
    EXPECT_LE(icat::smooth_step(u), S(1));
  }
  for (double x = 0.05; x < 1; x += 0.1) {
    const double numeric = (icat::smooth_step(x + 1e-6) - icat::smooth_step(x - 1e-6)) / 2e-6;
    EXPECT_NEAR(icat::smooth_step_derivative(x), numeric, 1e-8);
  }
}

}  // namespace
