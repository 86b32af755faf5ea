// SPDX-License-Identifier: BSD-3-Clause
// Thrusts against a linear program that is solved by a plain simplex; continuity, limits, failures.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <icat/control/thruster_allocation.hpp>
#include <icat/model/maris.hpp>
#include <random>

#include "support/allocation_counter.hpp"
#include "support/linear_program.hpp"
#include "support/sanitized.hpp"

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using icat::Status;
using icat::Thruster;
using icat::WrenchComponent;
using Vector6d = icat::Vector6<double>;
using Allocation = icat::ThrusterAllocation<double>;

constexpr auto surge = WrenchComponent::surge, sway = WrenchComponent::sway,
               heave = WrenchComponent::heave, roll = WrenchComponent::roll,
               pitch = WrenchComponent::pitch, yaw = WrenchComponent::yaw;

struct Layout {
  std::vector<Thruster<double>> thrusters;
  icat::WrenchPriority priority;
  std::vector<bool> failed;
};

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double real(double a, double b) { return std::uniform_real_distribution<double>(a, b)(engine_); }
  int integer(int a, int b) { return std::uniform_int_distribution<int>(a, b)(engine_); }
  Vector6d direction() {
    Vector6d w;
    for (int i = 0; i < 6; ++i) w(i) = std::normal_distribution<double>()(engine_);
    return w;
  }
  // Any places and directions, limits that differ, some one-way; any order of any components.
  Layout layout() {
    Layout layout;
    const int n = integer(3, 9);
    for (int i = 0; i < n; ++i) {
      Thruster<double> t;
      for (int j = 0; j < 3; ++j) t.position(j) = real(-1, 1);
      t.direction = direction().head<3>();
      if (integer(0, 2) == 0) t.direction(integer(0, 2)) = 0;
      t.maximum = real(20, 100);
      t.minimum = integer(0, 9) == 0 ? 0 : -real(0.5, 1) * t.maximum;
      layout.thrusters.push_back(t);
      layout.failed.push_back(integer(0, 9) == 0);
    }
    std::vector<WrenchComponent> all{surge, sway, heave, roll, pitch, yaw};
    std::shuffle(all.begin(), all.end(), engine_);
    all.resize(static_cast<std::size_t>(integer(1, 6)));
    for (std::size_t at = 0; at < all.size();) {
      const std::size_t size = std::min(all.size() - at, static_cast<std::size_t>(integer(1, 3)));
      layout.priority.emplace_back(all.begin() + static_cast<long>(at),
                                   all.begin() + static_cast<long>(at + size));
      at += size;
    }
    return layout;
  }

 private:
  std::mt19937 engine_;
};

Layout r2() {
  return {icat::r2_thrusters<double>(), icat::torque_before_force(), std::vector<bool>(8)};
}

Allocation build(const Layout& layout) {
  Allocation allocation(layout.thrusters, layout.priority);
  for (std::size_t i = 0; i < layout.failed.size(); ++i) {
    if (layout.failed[i]) {
      EXPECT_EQ(allocation.fail(static_cast<Eigen::Index>(i)), Status::ok);
    }
  }
  return allocation;
}

// The set S of the header by linear programs alone.
class Oracle {
 public:
  explicit Oracle(const Layout& layout) : priority_(layout.priority) {
    const auto n = static_cast<Eigen::Index>(layout.thrusters.size());
    B_.resize(6, n);
    lower_.resize(n);
    upper_.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto& t = layout.thrusters[static_cast<std::size_t>(i)];
      const bool failed = layout.failed[static_cast<std::size_t>(i)];
      const icat::Vector3<double> d = t.direction.normalized();
      B_.col(i) << d, t.position.cross(d);
      lower_(i) = failed ? 0 : t.minimum;
      upper_(i) = failed ? 0 : t.maximum;
    }
  }
  const MatrixXd& B() const { return B_; }
  const VectorXd& lower() const { return lower_; }
  const VectorXd& upper() const { return upper_; }

  // Largest s in [0, most] with components `rows` at s `along`, those of `held` at `value`.
  std::optional<double> largest(const std::vector<int>& held, const VectorXd& value,
                                const std::vector<int>& rows, const VectorXd& along,
                                double most) const {
    const Eigen::Index n = B_.cols(), h = static_cast<Eigen::Index>(held.size()),
                       r = static_cast<Eigen::Index>(rows.size());
    MatrixXd A = MatrixXd::Zero(h + r, n + 1);
    VectorXd b = VectorXd::Zero(h + r);
    A.topLeftCorner(h, n) = B_(held, Eigen::all);
    b.head(h) = value;
    A.bottomLeftCorner(r, n) = B_(rows, Eigen::all);
    A.col(n).tail(r) = -along;
    b -= A.leftCols(n) * lower_;
    VectorXd u(n + 1), c = VectorXd::Zero(n + 1);
    u << upper_ - lower_, most;
    c(n) = 1;
    return maximum(A, b, u, c);
  }
  // Extent of a component.
  double reach(int row) const {
    return std::max(extreme({}, VectorXd(0), row, 1), -extreme({}, VectorXd(0), row, -1));
  }
  double extreme(const std::vector<int>& held, const VectorXd& value, int row, double sign) const {
    const Eigen::Index n = B_.cols(), h = static_cast<Eigen::Index>(held.size());
    const MatrixXd A = B_(held, Eigen::all);
    const VectorXd b = value - A * lower_, c = sign * B_.row(row).transpose();
    (void)h;
    (void)n;
    const auto m = maximum(A, b, upper_ - lower_, c);
    return m ? sign * *m + B_.row(row).dot(lower_) : 0;
  }

 private:
  icat::WrenchPriority priority_;
  MatrixXd B_;
  VectorXd lower_, upper_;
};

struct Counts {
  int groups = 0, exact = 0, scaled = 0;
};

// One request against the oracle, group by group.
void compare(const Layout& layout, const Oracle& oracle, const Allocation& allocation,
             const Vector6d& request, Counts& counts, bool always_exact) {
  const VectorXd f = allocation.thrust();
  ASSERT_TRUE((f.array() >= oracle.lower().array()).all());
  ASSERT_TRUE((f.array() <= oracle.upper().array()).all());
  ASSERT_LE((oracle.B() * f - allocation.achieved()).norm(), 1e-10);
  std::vector<int> held;
  VectorXd value(0);
  for (std::size_t g = 0; g < layout.priority.size(); ++g) {
    std::vector<int> rows;
    for (const auto c : layout.priority[g]) rows.push_back(static_cast<int>(c));
    const VectorXd wanted = request(rows);
    const auto size = static_cast<Eigen::Index>(rows.size());
    const VectorXd got = allocation.achieved()(rows);
    const auto group = static_cast<Eigen::Index>(g);
    // How far S reaches along the axes, both ways: the ball in their hull is inside S.
    double inverse = 0, width = 0, tolerance = 1e-7;
    bool room = true;
    for (Eigen::Index k = 0; k < size; ++k) {
      const int row = rows[static_cast<std::size_t>(k)];
      const double reach = oracle.reach(row);
      if (reach < 1e-9) {
        room = false;
        continue;
      }
      VectorXd axis = VectorXd::Zero(size);
      axis(k) = reach;
      const auto there = oracle.largest(held, value, rows, axis, 10),
                 back = oracle.largest(held, value, rows, -axis, 10);
      const double near = there && back ? std::min(*there, *back) : 0;
      room = room && near > 1e-6;
      inverse += 1 / std::max(near * near, 1e-20);
      width = std::max(
          width,
          (oracle.extreme(held, value, row, 1) - oracle.extreme(held, value, row, -1)) / reach);
    }
    ++counts.groups;
    const bool exact = always_exact || (room && 20 / std::sqrt(inverse) > 1.0001 * width);
    ASSERT_GE(allocation.scale(group), 0);
    ASSERT_LE(allocation.scale(group), 1);
    if (exact) {
      const auto s = oracle.largest(held, value, rows, wanted, 1);
      ASSERT_TRUE(s);
      // The simplex decides to 1e-9 of the numbers that it compares.
      EXPECT_LE((got - *s * wanted).norm(), tolerance * (1 + oracle.upper().maxCoeff()));
      if (wanted.norm() > 0) {
        EXPECT_NEAR(allocation.scale(group), *s, 1e-6);
      }
      EXPECT_TRUE(allocation.direction_kept(group));
      ++counts.exact;
      counts.scaled += *s < 0.999 ? 1 : 0;
    } else if (size == 1) {
      // One component: as near as it can be.
      const double above = oracle.extreme(held, value, rows[0], 1),
                   below = oracle.extreme(held, value, rows[0], -1);
      EXPECT_NEAR(got(0), std::min(std::max(wanted(0), below), above), 1e-6);
    } else if (allocation.direction_kept(group) && wanted.norm() > 0) {
      EXPECT_LE((got - allocation.scale(group) * wanted).norm(), 1e-6 * wanted.norm());
    }
    held.insert(held.end(), rows.begin(), rows.end());
    VectorXd next(value.size() + size);
    next << value, got;
    value = next;
  }
}

TEST(ThrusterAllocation, IsTheLinearProgramOnTheLayoutOfR2) {
  const Layout layout = r2();
  const Oracle oracle(layout);
  Allocation allocation = build(layout);
  Random random(1);
  Counts counts;
  for (int k = 0; k < (sanitized ? 300 : 30'000); ++k) {
    SCOPED_TRACE(k);
    Vector6d w = random.direction() * random.real(0, 200);
    w(5) *= random.real(0, 1.5);
    ASSERT_EQ(allocation.allocate(w), Status::ok);
    compare(layout, oracle, allocation, w, counts, true);
    if (testing::Test::HasFailure()) return;
  }
  EXPECT_GT(counts.scaled, counts.groups / 10);
}

TEST(ThrusterAllocation, IsTheLinearProgramOnAnyLayout) {
  Random random(2);
  Counts counts;
  for (int k = 0; k < (sanitized ? 300 : 70'000) / 10; ++k) {
    const Layout layout = random.layout();
    const Oracle oracle(layout);
    Allocation allocation = build(layout);
    for (int r = 0; r < 10; ++r) {
      SCOPED_TRACE(testing::Message() << k << " " << r);
      Vector6d w = random.direction() * random.real(0, 200);
      w.tail<3>() *= random.real(0, 1);
      ASSERT_EQ(allocation.allocate(w), Status::ok);
      compare(layout, oracle, allocation, w, counts, false);
      if (testing::Test::HasFailure()) return;
    }
  }
  printf("%d groups %d exact %d scaled\n", counts.groups, counts.exact, counts.scaled);
}

}  // namespace
