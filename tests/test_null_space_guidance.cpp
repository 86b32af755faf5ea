// SPDX-License-Identifier: BSD-3-Clause
// Null-space-based guidance against [NSB, Eq. (33)] as printed, with an SVD of everything.
#include <gtest/gtest.h>

#include <icat/tpik/null_space_guidance.hpp>
#include <limits>
#include <random>
#include <vector>

#include "support/allocation_counter.hpp"
#include "support/linear_algebra.hpp"

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using icat::Status;

struct RandomTask {
  MatrixXd J;
  VectorXd rate;
};

/// The Moore-Penrose inverse, with the tolerance that the header documents.
MatrixXd pseudo_inverse(const MatrixXd& J) { return testing_support::pseudo_inverse(J, 1.5e-8); }

/// Eq. (33).
VectorXd literal(const std::vector<RandomTask>& tasks, Index n) {
  VectorXd velocity = VectorXd::Zero(n);
  MatrixXd stacked(0, n);
  for (const auto& task : tasks) {
    MatrixXd P = MatrixXd::Identity(n, n);
    if (stacked.rows() > 0) P -= pseudo_inverse(stacked) * stacked;
    velocity += P * pseudo_inverse(task.J) * task.rate;
    const Index rows = stacked.rows();
    stacked.conservativeResize(rows + task.J.rows(), n);
    stacked.bottomRows(task.J.rows()) = task.J;
  }
  return velocity;
}

class Generator {
 public:
  explicit Generator(unsigned seed) : rng_(seed) {}
  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(rng_); }
  MatrixXd matrix(Index rows, Index cols) {
    std::normal_distribution<double> normal;
    return MatrixXd::NullaryExpr(rows, cols, [&] { return normal(rng_); });
  }
  /// Up to six tasks of 1 to n + 3 rows; zero rows, rows that repeat others of this task or of a
  /// higher one, multiples of them, whole tasks of zeros.
  std::vector<RandomTask> tasks(Index n) {
    std::vector<RandomTask> tasks;
    MatrixXd seen(0, n);
    for (int count = integer(1, 6); count > 0; --count) {
      const int rows = integer(0, 4) == 0 ? integer(1, static_cast<int>(n) + 3) : integer(1, 3);
      RandomTask task{matrix(rows, n), matrix(rows, 1)};
      for (int i = 0; i < rows; ++i) {
        const int kind = integer(0, 9);
        if (kind == 0) task.J.row(i).setZero();
        if (kind == 1 && i > 0) task.J.row(i) = -2 * task.J.row(integer(0, i - 1));
        if (kind == 2 && seen.rows() > 0) {
          task.J.row(i) = 3 * seen.row(integer(0, static_cast<int>(seen.rows()) - 1));
        }
      }
      if (integer(0, 9) == 0) task.J.setZero();
      seen.conservativeResize(seen.rows() + rows, n);
      seen.bottomRows(rows) = task.J;
      tasks.push_back(task);
    }
    return tasks;
  }

 private:
  std::mt19937 rng_;
};

template <class Scalar, int N>
icat::NullSpaceGuidance<Scalar, N> make(Index n) {
  if constexpr (N == Eigen::Dynamic) {
    return icat::NullSpaceGuidance<Scalar, N>(n);
  } else {
    return {};
  }
}

template <class T>
class NullSpaceGuidance : public testing::Test {};
template <class S, int Size>
struct Case {
  using Scalar = S;
  static constexpr int N = Size;
};
using Cases = testing::Types<Case<double, Eigen::Dynamic>, Case<double, 6>,
                             Case<float, Eigen::Dynamic>, Case<float, 6>>;
TYPED_TEST_SUITE(NullSpaceGuidance, Cases);

TYPED_TEST(NullSpaceGuidance, IsTheLiteralFormula) {
  using Scalar = typename TypeParam::Scalar;
  constexpr int N = TypeParam::N;
  const double tolerance = sizeof(Scalar) == 8 ? 1e-9 : 2e-3;
  int compared = 0, dependent = 0;
  for (unsigned seed = 0; seed < 400; ++seed) {
    SCOPED_TRACE(seed);
    Generator gen(seed);
    const Index n = N == Eigen::Dynamic ? gen.integer(1, 12) : N;
    const auto tasks = gen.tasks(n);
    auto solver = make<Scalar, N>(n);
    solver.reset();
    double size = 1;  // of the terms: what rounding is compared with
    for (const auto& task : tasks) {
      ASSERT_EQ(solver.add_task(task.J.cast<Scalar>().eval(), task.rate.cast<Scalar>().eval()),
                Status::ok);
      const MatrixXd inverse = pseudo_inverse(task.J);
      size += inverse.norm() * inverse.norm() * task.J.norm() * task.rate.norm();
      dependent += solver.report().levels().back().regularized;
    }
    // In float, a matrix near a rank deficiency has lost its digits in the cast already.
    if (sizeof(Scalar) == 4 && size > 1e3) continue;
    ++compared;
    EXPECT_LT((solver.velocity().template cast<double>() - literal(tasks, n)).norm(),
              tolerance * size);
  }
  EXPECT_GT(compared, 150);
  EXPECT_GT(dependent, 50);
}

// What no lower task can do: change what a higher one gets.
TYPED_TEST(NullSpaceGuidance, LowerTasksDoNotTouchHigherOnes) {
  using Scalar = typename TypeParam::Scalar;
  constexpr int N = TypeParam::N;
  const double tolerance = sizeof(Scalar) == 8 ? 1e-11 : 1e-3;
  for (unsigned seed = 0; seed < 100; ++seed) {
    Generator gen(seed);
    auto solver = make<Scalar, N>(6);
    solver.reset();
    Eigen::Matrix<Scalar, 3, 6> J1 = gen.matrix(3, 6).cast<Scalar>();
    J1.row(2) = J1.row(0) + Scalar(0.5) * J1.row(1);  // of rank two
    ASSERT_EQ(solver.add_task(J1, gen.matrix(3, 1).cast<Scalar>().eval()), Status::ok);
    EXPECT_TRUE(solver.report().levels()[0].regularized);
    const icat::Vector<Scalar, 3> alone = J1 * solver.velocity();
    for (int k = 0; k < 4; ++k) {
      ASSERT_EQ(solver.add_task(gen.matrix(2, 6).cast<Scalar>().eval(),
                                gen.matrix(2, 1).cast<Scalar>().eval()),
                Status::ok);
    }
    EXPECT_LT((J1 * solver.velocity() - alone).norm(), tolerance * (1 + alone.norm()));
    // Nothing is left: 2 + 2 + 2 rows.
    const icat::Vector<Scalar, 6> full = solver.velocity();
    ASSERT_EQ(solver.add_task(gen.matrix(6, 6).cast<Scalar>().eval(),
                              gen.matrix(6, 1).cast<Scalar>().eval()),
              Status::ok);
    EXPECT_LT((solver.velocity() - full).norm(), tolerance * 100);
  }
}

// A row of which little is new: rounding must not tilt what the tasks below are projected on.
TYPED_TEST(NullSpaceGuidance, NearlyDependentTasksStayOrthogonal) {
  using Scalar = typename TypeParam::Scalar;
  using Row = Eigen::Matrix<Scalar, 1, 6>;
  const Scalar epsilon = std::numeric_limits<Scalar>::epsilon();
  for (unsigned seed = 0; seed < 100; ++seed) {
    Generator gen(seed);
    const Row J1 = gen.matrix(1, 6).cast<Scalar>().normalized();
    const Row J2 = J1 + 100 * std::sqrt(epsilon) * gen.matrix(1, 6).cast<Scalar>();
    const icat::Vector<Scalar, 1> zero(Scalar(0));
    auto solver = make<Scalar, TypeParam::N>(6);
    solver.reset();
    ASSERT_EQ(solver.add_task(J1, zero), Status::ok);
    ASSERT_EQ(solver.add_task(J2, zero), Status::ok);
    ASSERT_EQ(solver.add_task(gen.matrix(3, 6).cast<Scalar>().eval(),
                              gen.matrix(3, 1).cast<Scalar>().eval()),
              Status::ok);
    EXPECT_LT(std::abs(J1.dot(solver.velocity())), 4 * epsilon * (1 + solver.velocity().norm()));
  }
}

// The successive projection, (I − J₁⁺J₁)(I − J₂⁺J₂), is another formula: it lets task 3 disturb
// task 2.
TEST(NullSpaceGuidanceOnce, ProjectsOnTheNullSpaceOfAllRows) {
  icat::NullSpaceGuidance<double, 3> solver;
  solver.reset();
  const Eigen::RowVector3d J1(1, 0, 0), J2(1, 1, 0), J3(0, 1, 0);
  const icat::Vector<double, 1> zero(0.0), one(1.0);
  ASSERT_EQ(solver.add_task(J1, zero), Status::ok);
  ASSERT_EQ(solver.add_task(J2, zero), Status::ok);
  ASSERT_EQ(solver.add_task(J3, one), Status::ok);
  EXPECT_LT(solver.velocity().norm(), 1e-15);
}

TYPED_TEST(NullSpaceGuidance, TruncatesAtTheDocumentedTolerance) {
  using Scalar = typename TypeParam::Scalar;
  auto solver = make<Scalar, TypeParam::N>(6);
  const Scalar tolerance = std::sqrt(std::numeric_limits<Scalar>::epsilon());
  for (const Scalar scale : {Scalar(1e-10), Scalar(1), Scalar(1e10)}) {  // relative, not absolute
    for (const Scalar factor : {Scalar(2), Scalar(0.5)}) {
      Eigen::Matrix<Scalar, 2, 6> J = Eigen::Matrix<Scalar, 2, 6>::Zero();
      J(0, 0) = scale;
      J(1, 1) = scale * factor * tolerance;
      const icat::Vector<Scalar, 2> rate(0, J(1, 1));
      solver.reset();
      ASSERT_EQ(solver.add_task(J, rate), Status::ok);
      const bool kept = factor > Scalar(1);
      EXPECT_EQ(solver.report().levels()[0].regularized, !kept);
      EXPECT_NEAR(static_cast<double>(solver.velocity()(1)), kept ? 1 : 0, 1e-6);
      // What was not moved along is left to the next task.
      Eigen::Matrix<Scalar, 1, 6> next = Eigen::Matrix<Scalar, 1, 6>::Zero();
      next(1) = 1;
      ASSERT_EQ(solver.add_task(next, icat::Vector<Scalar, 1>(Scalar(5))), Status::ok);
      EXPECT_NEAR(static_cast<double>(solver.velocity()(1)), kept ? 1 : 5, 1e-5);
    }
  }
}

TYPED_TEST(NullSpaceGuidance, RefusesBadInputAndChangesNothing) {
  using Scalar = typename TypeParam::Scalar;
  using M = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  using V = icat::Vector<Scalar, Eigen::Dynamic>;
  auto solver = make<Scalar, TypeParam::N>(6);
  Generator gen(3);
  const M J = gen.matrix(2, 6).cast<Scalar>(), lower = gen.matrix(2, 6).cast<Scalar>();
  const V rate = gen.matrix(2, 1).cast<Scalar>();
  solver.reset();
  ASSERT_EQ(solver.add_task(J, rate), Status::ok);
  ASSERT_EQ(solver.add_task(lower, rate), Status::ok);
  const V expected = solver.velocity();

  const Scalar nan = std::numeric_limits<Scalar>::quiet_NaN();
  const Scalar infinity = std::numeric_limits<Scalar>::infinity();
  const Scalar most = std::numeric_limits<Scalar>::max();
  solver.reset();
  EXPECT_EQ(solver.report().status(), Status::ok);
  ASSERT_EQ(solver.add_task(J, rate), Status::ok);
  for (const Scalar bad : {nan, infinity, -infinity}) {
    M bad_J = lower;
    bad_J(1, 3) = bad;
    EXPECT_EQ(solver.add_task(bad_J, rate), Status::non_finite);
    V bad_rate = rate;
    bad_rate(1) = bad;
    EXPECT_EQ(solver.add_task(lower, bad_rate), Status::non_finite);
  }
  EXPECT_EQ(solver.report().failed_level(), 1);
  EXPECT_EQ(solver.report().failed_row(), 1);
  EXPECT_EQ(solver.add_task(M(M::Ones(2, 5)), rate), Status::wrong_size);
  EXPECT_EQ(solver.add_task(lower, V(V::Ones(3))), Status::wrong_size);
  EXPECT_EQ(solver.add_task(M(M::Constant(2, 6, Scalar(1) / most)), V(V::Constant(2, most))),
            Status::numerical_failure);
  EXPECT_EQ(solver.add_task(M(M(0, 6)), V(V(0))), Status::ok);  // no rows, nothing to do
  EXPECT_EQ(solver.add_task(M(M::Zero(2, 6)), rate), Status::ok);
  ASSERT_EQ(solver.add_task(lower, rate), Status::ok);
  EXPECT_EQ(V(solver.velocity()), expected);
}

// Squares of these would overflow or vanish.
TYPED_TEST(NullSpaceGuidance, ScaleOfAJacobianDoesNotMatter) {
  using Scalar = typename TypeParam::Scalar;
  using M = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  using V = icat::Vector<Scalar, Eigen::Dynamic>;
  const M J = Generator(5).matrix(3, 6).cast<Scalar>();
  const V rate = Generator(6).matrix(3, 1).cast<Scalar>();
  auto solver = make<Scalar, TypeParam::N>(6);
  solver.reset();
  ASSERT_EQ(solver.add_task(J, rate), Status::ok);
  const V expected = solver.velocity();
  for (const int exponent : {-100, 100}) {
    const Scalar scale = std::ldexp(Scalar(1), exponent);
    solver.reset();
    ASSERT_EQ(solver.add_task(M(scale * J), V(scale * rate)), Status::ok);
    EXPECT_LT((solver.velocity() - expected).norm(), Scalar(1e-5));
  }
}

// The snippet of the documentation.
TEST(NullSpaceGuidanceOnce, InThreeLines) {
  const Eigen::RowVector3d J1(1, 0, 0), J2(1, 1, 0);
  const icat::Vector<double, 1> rate1(1.0), rate2(4.0);
  //! [solver]
  icat::NullSpaceGuidance<double, 3> guidance;  // NullSpaceGuidance<double>(dof) at run time
  guidance.reset();
  icat::Status status = guidance.add_task(J1, rate1);  // the highest priority first
  if (status == icat::Status::ok) status = guidance.add_task(J2, rate2);
  const icat::Vector<double, 3> velocity = guidance.velocity();  // always finite
  //! [solver]
  EXPECT_EQ(status, icat::Status::ok);
  EXPECT_LT((velocity - Eigen::Vector3d(1, 2, 0)).norm(), 1e-12);
}

TEST(NullSpaceGuidanceOnce, NeedsADegreeOfFreedom) {
  try {
    icat::NullSpaceGuidance<double> none(0);
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_STREQ(e.what(), "NullSpaceGuidance: dof must be >= 1, got 0");
  }
}

TYPED_TEST(NullSpaceGuidance, NeverAllocates) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP() << "malloc belongs to the sanitizer";
#endif
  using Scalar = typename TypeParam::Scalar;
  using M = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  using V = icat::Vector<Scalar, Eigen::Dynamic>;
  EXPECT_GT(count_allocations([] {
              volatile double keep = MatrixXd::Ones(30, 30).eval()(3);
              (void)keep;
            }),
            0);
  for (unsigned seed = 0; seed < 40; ++seed) {
    Generator gen(seed);
    const Index n = TypeParam::N == Eigen::Dynamic ? gen.integer(1, 40) : 6;
    std::vector<std::pair<M, V>> tasks;
    for (const auto& task : gen.tasks(n)) {
      tasks.emplace_back(task.J.cast<Scalar>(), task.rate.cast<Scalar>());
    }
    tasks.emplace_back(M::Ones(n + 7, n), V::Ones(n + 7));
    tasks.emplace_back(M::Ones(2, n), V::Constant(2, std::numeric_limits<Scalar>::quiet_NaN()));
    auto solver = make<Scalar, TypeParam::N>(n);
    Status status = Status::ok;
    EXPECT_EQ(count_allocations([&] {
                solver.reset();
                for (const auto& [J, rate] : tasks) status = solver.add_task(J, rate);
              }),
              0);
    EXPECT_EQ(status, Status::non_finite);
    EXPECT_TRUE(solver.velocity().allFinite());
  }
}

}  // namespace
