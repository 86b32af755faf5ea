// SPDX-License-Identifier: BSD-3-Clause
// Thrusts against a linear program that is solved by a plain simplex; continuity, limits, failures.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <icat/control/thruster_allocation.hpp>
#include <icat/model/maris.hpp>
#include <random>

#include "support/allocation_counter.hpp"
#include "support/linear_algebra.hpp"
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
  explicit Oracle(const Layout& layout) {
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
  // Largest (sign +1) or smallest (−1) value of component `row`.
  double extreme(const std::vector<int>& held, const VectorXd& value, int row, double sign) const {
    const MatrixXd A = B_(held, Eigen::all);
    const auto m = maximum(A, value - A * lower_, upper_ - lower_, sign * B_.row(row).transpose());
    return m ? sign * *m + B_.row(row).dot(lower_) : 0;
  }
  double extent(const std::vector<int>& held, const VectorXd& value, int row) const {
    return extreme(held, value, row, 1) - extreme(held, value, row, -1);
  }
  // To one part in a million.
  bool independent(const std::vector<int>& rows) const {
    MatrixXd A = B_(rows, Eigen::all) * (upper_ - lower_).asDiagonal();
    if (!(A.rowwise().norm().minCoeff() > 1e-9)) return false;
    A.rowwise().normalize();
    return testing_support::singular_values(A).tail(1)(0) > 1e-6 && A.rows() <= A.cols();
  }
  double reach(int row) const {
    const VectorXd b = B_.row(row).transpose();
    const VectorXd one = b.cwiseProduct(upper_), other = b.cwiseProduct(lower_);
    return std::max(one.cwiseMax(other).sum(), -one.cwiseMin(other).sum());
  }

 private:
  MatrixXd B_;
  VectorXd lower_, upper_;
};

struct Counts {
  int groups = 0, exact = 0, scaled = 0, along = 0;
};

// One request against the oracle, group by group. What a group got lies between what it gets along
// its request and what its components get one after the other; it is the former where S reaches
// far enough about 0. Components that others determine are no part of this.
void compare(const Layout& layout, const Oracle& oracle, const Allocation& allocation,
             const Vector6d& request, Counts& counts, bool always_exact) {
  const VectorXd f = allocation.thrust();
  ASSERT_TRUE((f.array() >= oracle.lower().array()).all());
  ASSERT_TRUE((f.array() <= oracle.upper().array()).all());
  ASSERT_LE((oracle.B() * f - allocation.achieved()).norm(), 1e-10);
  // The simplex decides to 1e-9 of the numbers that it compares, up to 1e3 here.
  const double tolerance = 1e-6 * oracle.upper().maxCoeff();
  std::vector<int> held;  // components that are given, and their values
  VectorXd value(0);
  for (std::size_t g = 0; g < layout.priority.size(); ++g) {
    SCOPED_TRACE(testing::Message() << "group " << g);
    const auto group = static_cast<Eigen::Index>(g);
    std::vector<int> rows, next = held;
    for (const auto component : layout.priority[g]) {
      next.push_back(static_cast<int>(component));
      if (oracle.independent(next)) {
        rows.push_back(next.back());
      } else {
        next.pop_back();
      }
    }
    const bool all = rows.size() == layout.priority[g].size();
    const VectorXd wanted = request(rows), got = allocation.achieved()(rows);
    const Eigen::Index size = wanted.size();
    // How far S reaches along the axes, both ways: the ball in their hull is inside S.
    double inverse = 0, width = 0;
    for (Eigen::Index k = 0; k < size; ++k) {
      const int row = rows[static_cast<std::size_t>(k)];
      const VectorXd axis = oracle.reach(row) * VectorXd::Unit(size, k);
      const auto there = oracle.largest(held, value, rows, axis, 10),
                 back = oracle.largest(held, value, rows, -axis, 10);
      const double near = there && back ? std::min(*there, *back) : 0;
      inverse += 1 / std::max(near * near, 1e-12);
      width = std::max(width, oracle.extent(held, value, row) / oracle.reach(row));
    }
    ASSERT_GE(allocation.scale(group), 0);
    ASSERT_LE(allocation.scale(group), 1);
    const bool exact = always_exact || (inverse < 1e11 && 20 / std::sqrt(inverse) > width);
    const auto s = oracle.largest(held, value, rows, wanted, 1);
    if (exact) {
      ASSERT_TRUE(s);
      EXPECT_LE((got - *s * wanted).norm(), tolerance);
      EXPECT_TRUE(allocation.direction_kept(group) || !all);
      if (size > 0) {
        EXPECT_NEAR(allocation.scale(group), *s, tolerance / (1e-9 + wanted.norm()));
      }
    } else {
      VectorXd in_order(size);
      std::vector<int> before = held;
      VectorXd values = value;
      for (Eigen::Index k = 0; k < size; ++k) {
        const int row = rows[static_cast<std::size_t>(k)];
        in_order(k) = std::min(std::max(wanted(k), oracle.extreme(before, values, row, -1)),
                               oracle.extreme(before, values, row, 1));
        before.push_back(row);
        values.conservativeResize(values.size() + 1);
        values(values.size() - 1) = in_order(k);
      }
      const VectorXd line = s ? VectorXd(*s * wanted - in_order) : VectorXd::Zero(size);
      const double part = (got - in_order).dot(line) / std::max(line.squaredNorm(), 1e-30);
      EXPECT_LE((got - in_order - std::clamp(part, 0.0, 1.0) * line).norm(), 10 * tolerance)
          << got.transpose() << " | " << in_order.transpose() << " | " << line.transpose();
    }
    counts.groups += size > 0 ? 1 : 0;
    counts.exact += size > 0 && exact ? 1 : 0;
    counts.scaled += size > 1 && exact && *s < 0.999 ? 1 : 0;
    counts.along += size > 0 && allocation.direction_kept(group) ? 1 : 0;
    held = next;
    value.conservativeResize(value.size() + size);
    value.tail(size) = got;
  }
}

// Published layout, also where it pulls less than it pushes: the direction is always kept.
TEST(ThrusterAllocation, IsTheLinearProgramOnTheLayoutOfR2) {
  Random random(1);
  Counts counts;
  for (const double minimum : {-60, -48, -20}) {
    Layout layout = r2();
    layout.thrusters = icat::r2_thrusters<double>(60, minimum);
    const Oracle oracle(layout);
    Allocation allocation = build(layout);
    for (int k = 0; k < (sanitized ? 1000 : 10'000); ++k) {
      SCOPED_TRACE(testing::Message() << minimum << " " << k);
      Vector6d w = random.direction() * random.real(0, 200);
      w(5) *= random.real(0, 1.5);
      ASSERT_EQ(allocation.allocate(w), Status::ok);
      compare(layout, oracle, allocation, w, counts, true);
      if (testing::Test::HasFailure()) return;
    }
  }
  EXPECT_EQ(counts.exact, counts.groups);
  EXPECT_GT(counts.scaled, counts.groups / 10);
}

TEST(ThrusterAllocation, IsTheLinearProgramOnAnyLayout) {
  Random random(2);
  Counts counts;
  for (int k = 0; k < (sanitized ? 3000 : 70'000) / 10; ++k) {
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
  EXPECT_GT(counts.exact, counts.groups / 2);
  EXPECT_GT(counts.along, counts.exact);
  EXPECT_GT(counts.scaled, counts.groups / 10);
}

// The largest change of thrust along a curve, followed into ever smaller steps, goes to zero: a
// jump would stay. Curves turn by a frequency for each component, through the limits and back.
double change_of_smallest_step(Allocation& allocation, const Vector6d& amplitude,
                               const Vector6d& phase) {
  const auto thrust = [&](double t) {
    Vector6d w;
    for (int i = 0; i < 6; ++i) w(i) = amplitude(i) * std::sin((1 + i * 0.37) * t + phase(i));
    EXPECT_EQ(allocation.allocate(w), Status::ok);
    return VectorXd(allocation.thrust());
  };
  double from = 0, step = 0.02, largest = -1;
  VectorXd last = thrust(0);
  for (int k = 1; k <= 300; ++k) {
    const VectorXd next = thrust(k * step);
    if ((next - last).norm() > largest) {
      largest = (next - last).norm();
      from = (k - 1) * step;
    }
    last = next;
  }
  for (int halving = 0; halving < 30; ++halving) {
    step /= 2;
    const VectorXd a = thrust(from), b = thrust(from + step), c = thrust(from + 2 * step);
    largest = std::max((b - a).norm(), (c - b).norm());
    if ((c - b).norm() > (b - a).norm()) from += step;
  }
  return largest;  // over a step of 2e-11
}

TEST(ThrusterAllocation, IsContinuous) {
  Random random(3);
  for (int k = 0; k < (sanitized ? 200 : 1000); ++k) {
    SCOPED_TRACE(k);
    const Layout layout = k % 3 == 0 ? r2() : random.layout();
    Allocation allocation = build(layout);
    // One thruster or two of R2 fail in most runs: then yaw brings a force with it.
    for (int failures = k % 4; k % 3 == 0 && failures > 1; --failures) {
      ASSERT_EQ(allocation.fail(random.integer(0, 3)), Status::ok);
    }
    Vector6d amplitude = random.direction() * 150;
    amplitude(5) *= random.real(0.3, 1.5);
    const Vector6d phase = random.direction() * 3;
    const double change = change_of_smallest_step(allocation, amplitude, phase);
    // Slopes of thrust over t: below 5e4 N on R2, also with failed thrusters, where the request has
    // up to 1e3 N; up to 1e7 N on random layouts that are nearly degenerate. A jump would be 1 N or
    // more.
    EXPECT_LE(change, k % 3 == 0 ? 1e-6 : 1e-3);
  }
}

// Where a lateral thruster stays free while yaw takes the others: the case of the header in which
// the largest factor jumps as surge turns from zero.
TEST(ThrusterAllocation, IsContinuousWhereTheLargestFactorIsNot) {
  std::vector<Thruster<double>> thrusters(3);
  for (auto& thruster : thrusters) {
    thruster.minimum = -50;
    thruster.maximum = 50;
  }
  thrusters[0].position = {0, -0.3, 0};
  thrusters[1].position = {0, 0.3, 0};
  thrusters[0].direction = thrusters[1].direction = {1, 0, 0};
  thrusters[2].direction = {0, 1, 0};
  Allocation allocation(thrusters, {{yaw}, {surge, sway}});
  Vector6d w = Vector6d::Zero();
  w(5) = 40;  // 30 N m is the most
  w(1) = 20;
  for (const double x : {0.0, 1e-12, -1e-12, 1e-6, 1.0, 100.0}) {
    w(0) = x;
    ASSERT_EQ(allocation.allocate(w), Status::ok);
    EXPECT_NEAR(allocation.achieved()(0), 0, 1e-9);
    EXPECT_NEAR(allocation.achieved()(1), 20, 1e-9);
    EXPECT_NEAR(allocation.achieved()(5), 30, 1e-9);
    EXPECT_EQ(allocation.direction_kept(1), std::abs(x) < 1e-9);
  }
  w(5) = 0;  // room enough: the direction is kept
  w(0) = 200;
  ASSERT_EQ(allocation.allocate(w), Status::ok);
  EXPECT_NEAR(allocation.achieved()(0), 100, 1e-9);
  EXPECT_NEAR(allocation.achieved()(1), 10, 1e-9);
  EXPECT_NEAR(allocation.scale(1), 0.5, 1e-12);
}

// [MARIS, III-D]: always able to turn. Yaw is what it would be without any force.
TEST(ThrusterAllocation, TorqueBeforeForce) {
  Allocation allocation = build(r2());
  const double most = 4 * 60 * 0.75 / std::sqrt(2.0);  // lever (0.45 + 0.30) / √2 of each
  Random random(4);
  for (int k = 0; k < 1000; ++k) {
    Vector6d w = random.direction() * 300;
    w(5) = random.real(-1.2, 1.2) * most;
    ASSERT_EQ(allocation.allocate(w), Status::ok);
    EXPECT_NEAR(allocation.achieved()(5), std::clamp(w(5), -most, most), 1e-9);
    // A multiple of the request, not negative.
    const Eigen::Vector2d got = allocation.achieved().head<2>(), wanted = w.head<2>();
    EXPECT_NEAR(got(0) * wanted(1) - got(1) * wanted(0), 0, 1e-8 * wanted.norm());
    EXPECT_GE(got.dot(wanted), 0);
    // Heave has thrusters of its own, all alike.
    for (int i = 4; i < 8; ++i) {
      EXPECT_NEAR(allocation.thrust()(i), std::clamp(w(2) / 4, -60.0, 60.0), 1e-9);
    }
  }
  EXPECT_EQ(allocation.groups(), 3);
  EXPECT_EQ(allocation.size(), 8);
}

// What the example of docs/vehicle.md shows.
TEST(ThrusterAllocation, AFailedThrusterIsOneCall) {
  //! [thrusters]
  icat::ThrusterAllocation<double, 8> thrusters(icat::r2_thrusters<double>());
  icat::Vector6<double> wrench;
  wrench << 100, 50, 20, 0, 0, 40;  // N, N m, on ⟨v⟩

  icat::Status status = thrusters.allocate(wrench);  // in each cycle
  icat::Vector<double, 8> thrust = thrusters.thrust();
  double force_scale = thrusters.scale(1);              // of surge and sway
  icat::Vector6<double> pushed = thrusters.achieved();  // for the anti-windup of the velocity loop

  status = thrusters.fail(2);  // back left: the others take over at once
  //! [thrusters]
  EXPECT_EQ(status, Status::ok);
  EXPECT_NEAR(pushed(5), 40, 1e-9);
  EXPECT_GT(force_scale, 0.5);
  EXPECT_GT(thrust.norm(), 0);
  EXPECT_TRUE(thrusters.failed(2));
  EXPECT_EQ(thrusters.thrust()(2), 0);
  EXPECT_NEAR(thrusters.achieved()(5), 40, 1e-9);
  EXPECT_NEAR(thrusters.achieved()(2), 20, 1e-9);
  EXPECT_LT(thrusters.scale(1), force_scale);
  EXPECT_TRUE(thrusters.direction_kept(1));
  EXPECT_EQ(thrusters.restore(2), Status::ok);
  EXPECT_FALSE(thrusters.failed(2));
  EXPECT_EQ(thrusters.thrust(), thrust);
  EXPECT_EQ(thrusters.fail(8), Status::out_of_range);
  EXPECT_EQ(thrusters.fail(-1), Status::out_of_range);
  // The same as a layout that never had it, but for the way of rounding.
  auto seven = icat::r2_thrusters<double>();
  seven.erase(seven.begin() + 2);
  Allocation without(seven);
  ASSERT_EQ(without.allocate(wrench), Status::ok);
  ASSERT_EQ(thrusters.fail(2), Status::ok);
  for (int i = 0; i < 7; ++i) {
    EXPECT_NEAR(without.thrust()(i), thrusters.thrust()(i < 2 ? i : i + 1), 1e-9);
  }
}

// The shortest thrusts that give what was achieved, by trying all 3ⁿ sets of thrusters at limits.
TEST(ThrusterAllocation, ThrustsAreTheShortest) {
  Random random(5);
  int at_limits = 0;
  for (int k = 0; k < (sanitized ? 30 : 500); ++k) {
    SCOPED_TRACE(k);
    Layout layout = random.layout();
    if (layout.thrusters.size() > 6) continue;
    Allocation allocation = build(layout);
    const Oracle oracle(layout);
    const Vector6d w = random.direction() * random.real(0, 60);
    ASSERT_EQ(allocation.allocate(w), Status::ok);
    std::vector<int> rows;
    for (const auto& group : layout.priority) {
      for (const auto c : group) rows.push_back(static_cast<int>(c));
    }
    const MatrixXd B = oracle.B()(rows, Eigen::all);
    const VectorXd wrench = allocation.achieved()(rows), f = allocation.thrust();
    const Eigen::Index n = f.size();
    double best = 1e300;
    int sets = 1;
    for (Eigen::Index i = 0; i < n; ++i) sets *= 3;
    for (int set = 0; set < sets; ++set) {
      std::vector<Eigen::Index> free;
      VectorXd x(n);
      for (Eigen::Index i = 0, rest = set; i < n; ++i, rest /= 3) {
        x(i) = rest % 3 == 0 ? 0 : rest % 3 == 1 ? oracle.upper()(i) : oracle.lower()(i);
        if (rest % 3 == 0) free.push_back(i);
      }
      if (!free.empty()) {
        const MatrixXd A = B(Eigen::all, free);
        const VectorXd y = testing_support::pseudo_inverse(A, 1e-10) * (wrench - B * x);
        for (std::size_t i = 0; i < free.size(); ++i) x(free[i]) = y(static_cast<Eigen::Index>(i));
      }
      if ((B * x - wrench).norm() > 1e-7 || (x - oracle.upper()).maxCoeff() > 1e-7 ||
          (oracle.lower() - x).maxCoeff() > 1e-7) {
        continue;
      }
      best = std::min(best, x.norm());
    }
    EXPECT_NEAR(f.norm(), best, 1e-5);
    for (Eigen::Index i = 0; i < n; ++i) at_limits += allocation.saturated(i) ? 1 : 0;
  }
  EXPECT_GT(at_limits, sanitized ? 10 : 200);
}

TEST(ThrusterAllocation, ZeroAndNothing) {
  Allocation allocation = build(r2());
  EXPECT_EQ(allocation.thrust().norm(), 0);  // before the first request
  ASSERT_EQ(allocation.allocate(Vector6d::Constant(100)), Status::ok);
  ASSERT_EQ(allocation.allocate(Vector6d::Zero()), Status::ok);
  EXPECT_LE(allocation.thrust().norm(), 1e-12);
  for (int g = 0; g < 3; ++g) {
    EXPECT_EQ(allocation.scale(g), 1);
    EXPECT_TRUE(allocation.direction_kept(g));
  }
  // One after the other fails: never beyond a limit, and nothing at the end.
  const Vector6d wrench = Vector6d::Constant(100);
  ASSERT_EQ(allocation.allocate(wrench), Status::ok);
  for (int i = 0; i < 8; ++i) {
    ASSERT_EQ(allocation.fail(i), Status::ok);
    EXPECT_LE(allocation.thrust().cwiseAbs().maxCoeff(), 60);
    EXPECT_EQ(allocation.thrust().head(i + 1).norm(), 0);
  }
  EXPECT_EQ(allocation.achieved().norm(), 0);
  EXPECT_EQ(allocation.scale(0), 0);
  EXPECT_FALSE(allocation.direction_kept(1));
  for (int i = 0; i < 8; ++i) ASSERT_EQ(allocation.restore(i), Status::ok);
  EXPECT_EQ(allocation.achieved()(5), 100);
}

// Thrusters along axes on a grid depend on each other in every way, and most of them fail.
TEST(ThrusterAllocation, DegenerateLayouts) {
  Random random(8);
  Counts counts;
  for (int k = 0; k < (sanitized ? 30 : 2000); ++k) {
    Layout layout = random.layout();
    for (auto& t : layout.thrusters) {
      for (int j = 0; j < 3; ++j) t.position(j) = random.integer(-1, 1);
      t.direction.setZero();
      t.direction(random.integer(0, 2)) = random.integer(0, 1) == 0 ? -1 : 1;
    }
    Allocation allocation = build(layout);
    for (int r = 0; r < 8; ++r) {
      SCOPED_TRACE(testing::Message() << k << " " << r);
      const Vector6d w = random.direction() * 100;
      ASSERT_EQ(allocation.allocate(w), Status::ok);
      compare(layout, Oracle(layout), allocation, w, counts, false);
      if (testing::Test::HasFailure()) return;
      const int thruster = random.integer(0, static_cast<int>(layout.thrusters.size()) - 1);
      const bool fails = random.integer(0, 3) > 0;
      layout.failed[static_cast<std::size_t>(thruster)] = fails;
      ASSERT_EQ(fails ? allocation.fail(thruster) : allocation.restore(thruster), Status::ok);
    }
  }
  EXPECT_GT(counts.exact, counts.groups / 2);
}

// What no thruster can do is left out; the rest keeps its direction.
TEST(ThrusterAllocation, RankLoss) {
  std::vector<Thruster<double>> thrusters(2);
  for (auto& thruster : thrusters) {
    thruster = {.position = {0, 0.3, 0}, .direction = {2, 0, 0}, .minimum = -40, .maximum = 50};
  }
  thrusters[0].position(1) = -0.3;
  Allocation allocation(thrusters, {{yaw, sway}, {surge, heave}});
  Vector6d w;
  w << 30, 10, 5, 1, 1, 6;
  ASSERT_EQ(allocation.allocate(w), Status::ok);
  EXPECT_NEAR(allocation.achieved()(0), 30, 1e-9);
  EXPECT_NEAR(allocation.achieved()(5), 6, 1e-9);
  EXPECT_EQ(allocation.scale(0), 1);
  EXPECT_FALSE(allocation.direction_kept(0));
  EXPECT_FALSE(allocation.direction_kept(1));
  // Two in one place: surge and yaw depend on each other, yaw comes first.
  thrusters[1] = thrusters[0];
  Allocation twins(thrusters, {{yaw}, {surge}});
  ASSERT_EQ(twins.allocate(w), Status::ok);
  EXPECT_NEAR(twins.achieved()(5), 6, 1e-9);
  EXPECT_NEAR(twins.achieved()(0), 20, 1e-9);
  EXPECT_NEAR(twins.thrust()(0), twins.thrust()(1), 1e-12);
  EXPECT_EQ(twins.scale(1), 0);
}

TEST(ThrusterAllocation, WhatIsNotFiniteStopsTheThrusters) {
  Allocation allocation = build(r2());
  for (int i = 0; i < 6; ++i) {
    for (const double bad : {std::nan(""), 1.0 / 0.0, -1.0 / 0.0}) {
      ASSERT_EQ(allocation.allocate(Vector6d::Constant(50)), Status::ok);
      ASSERT_GT(allocation.thrust().norm(), 1);
      Vector6d w = Vector6d::Constant(50);
      w(i) = bad;
      EXPECT_EQ(allocation.allocate(w), Status::non_finite);
      EXPECT_EQ(allocation.thrust().norm(), 0);
      EXPECT_EQ(allocation.achieved().norm(), 0);
      EXPECT_EQ(allocation.scale(0), 0);
    }
  }
  // As large as numbers get: at the limits, in the same direction.
  for (const double huge : {1e6, 1e300, 1.7e308}) {
    Vector6d w = Vector6d::Zero();
    w(0) = huge;
    w(1) = -huge / 2;
    ASSERT_EQ(allocation.allocate(w), Status::ok);
    EXPECT_NEAR(allocation.achieved()(0), 2 * 60 * std::sqrt(2.0) / 1.5, 1e-9);
    EXPECT_NEAR(allocation.achieved()(1), -allocation.achieved()(0) / 2, 1e-9);
    ASSERT_EQ(allocation.allocate(Vector6d::Constant(-huge)), Status::ok);
    EXPECT_LE(allocation.thrust().cwiseAbs().maxCoeff(), 60);
    EXPECT_NEAR(allocation.achieved()(5), -127.27922, 1e-4);
  }
}

TEST(ThrusterAllocation, FloatAndStaticSizeGiveTheSame) {
  Random random(6);
  for (int k = 0; k < (sanitized ? 100 : 5000); ++k) {
    icat::ThrusterAllocation<double, 8> fixed(icat::r2_thrusters<double>(60, -48));
    icat::ThrusterAllocation<double> dynamic(icat::r2_thrusters<double>(60, -48));
    icat::ThrusterAllocation<float, 8> single(icat::r2_thrusters<float>(60, -48));
    const int failed = random.integer(0, 15);
    for (int r = 0; r < 10; ++r) {
      const Vector6d w = random.direction() * random.real(0, 200);
      if (r == 5 && failed < 8) {
        ASSERT_EQ(fixed.fail(failed), Status::ok);
        ASSERT_EQ(dynamic.fail(failed), Status::ok);
        ASSERT_EQ(single.fail(failed), Status::ok);
      }
      ASSERT_EQ(fixed.allocate(w), Status::ok);
      ASSERT_EQ(dynamic.allocate(w), Status::ok);
      ASSERT_EQ(single.allocate(w.cast<float>()), Status::ok);
      EXPECT_EQ(fixed.thrust(), dynamic.thrust());
      EXPECT_LE((single.thrust().cast<double>() - fixed.thrust()).norm(), 0.02);
      EXPECT_LE((single.achieved().cast<double>() - fixed.achieved()).norm(), 0.002);
      EXPECT_LE(single.thrust().maxCoeff(), 60);
      EXPECT_GE(single.thrust().minCoeff(), -48);
    }
    if (testing::Test::HasFailure()) return;
  }
}

TEST(ThrusterAllocation, NoAllocation) {
#ifdef ICAT_TEST_NO_MALLOC_COUNT
  GTEST_SKIP();
#endif
  Random random(7);
  for (int k = 0; k < 50; ++k) {
    const Layout layout = random.layout();
    Allocation allocation = build(layout);
    const Vector6d w = random.direction() * 100;
    Status status[4];
    EXPECT_EQ(count_allocations([&] {
                status[0] = allocation.allocate(w);
                status[1] = allocation.fail(1);
                status[2] = allocation.restore(1);
                status[3] = allocation.allocate(Vector6d::Constant(std::nan("")));
              }),
              0);
    EXPECT_EQ(status[1], Status::ok);
    EXPECT_EQ(status[3], Status::non_finite);
  }
}

template <class F>
void expect_refused(F&& f, const char* text) {
  try {
    f();
    FAIL() << "accepted: " << text;
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), text);
  }
}

TEST(ThrusterAllocation, RefusesWithNamesAndNumbers) {
  const auto good = icat::r2_thrusters<double>();
  const auto with = [&](auto change) {
    auto thrusters = good;
    change(thrusters[3]);
    return [thrusters] { Allocation{thrusters}; };
  };
  expect_refused([] { Allocation{std::vector<Thruster<double>>{}}; },
                 "ThrusterAllocation: 0 thrusters, expected 1 or more");
  expect_refused([&] { icat::ThrusterAllocation<double, 6>{good}; },
                 "ThrusterAllocation: 8 thrusters, expected 6");
  expect_refused(with([](auto& t) { t.position(1) = std::nan(""); }),
                 "ThrusterAllocation: thruster 3: position 1 must be finite, got nan");
  expect_refused(
      with([](auto& t) { t.direction.setZero(); }),
      "ThrusterAllocation: thruster 3: direction must be finite and not 0, got (0, 0, 0)");
  expect_refused(with([](auto& t) { t.minimum = 5; }),
                 "ThrusterAllocation: thruster 3: limits must be finite, minimum <= 0 <= maximum, "
                 "not both 0, got 5 and 60");
  expect_refused(with([](auto& t) { t.minimum = t.maximum = 0; }),
                 "ThrusterAllocation: thruster 3: limits must be finite, minimum <= 0 <= maximum, "
                 "not both 0, got 0 and 0");
  expect_refused(with([](auto& t) { t.maximum = 1.0 / 0.0; }),
                 "ThrusterAllocation: thruster 3: limits must be finite, minimum <= 0 <= maximum, "
                 "not both 0, got -60 and inf");
  expect_refused([&] { Allocation(good, {}); }, "ThrusterAllocation: the priority has no group");
  expect_refused([&] { Allocation(good, {{yaw}, {}}); }, "ThrusterAllocation: group 1 is empty");
  expect_refused(
      [&] {
        Allocation(good, {{yaw}, {surge, yaw}});
      },
      "ThrusterAllocation: group 1: yaw stands twice");
  const std::vector<Thruster<double>> many(30, good[0]);
  expect_refused(
      [&] {
        Allocation(many, {{yaw}, {roll, pitch}, {surge, sway, heave}});
      },
      "ThrusterAllocation: 30 thrusters and 6 components need 182587 half-spaces, at most 100000");
  const auto build_some = [&](std::size_t n, const icat::WrenchPriority& priority) {
    const std::vector<Thruster<double>> some(n, good[0]);
    return Allocation(some, priority).size();
  };
  EXPECT_EQ(build_some(26, {{surge, sway, heave, roll, pitch, yaw}}), 26);
  EXPECT_EQ(build_some(26, {{surge, sway}, {heave, roll, pitch, yaw}}), 26);
  EXPECT_EQ(build_some(26, {{surge, sway, heave, roll}, {pitch, yaw}}), 26);
  EXPECT_EQ(build_some(83, icat::torque_before_force()), 83);
  EXPECT_EQ(build_some(83, {{yaw, surge}, {sway, heave}}), 83);
  EXPECT_EQ(build_some(500, {{yaw}}), 500);
}

// The time of a step is bounded by these: docs/vehicle.md.
TEST(ThrusterAllocation, HalfSpaces) { EXPECT_EQ(build(r2()).half_spaces(), 43); }

}  // namespace
