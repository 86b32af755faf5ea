// SPDX-License-Identifier: BSD-3-Clause
// The relations of the cooperative paper's Table III.
#include <gtest/gtest.h>

#include "../examples/04_table3/table.hpp"

namespace {

using namespace table3;

TEST(Table3, Spearman) {
  EXPECT_EQ(spearman({1, 2, 3, 4}, {10, 20, 30, 40}), 1);
  EXPECT_EQ(spearman({1, 2, 3, 4}, {4, 3, 2, 1}), -1);
  EXPECT_NEAR(spearman({1, 2, 3, 4}, {2, 1, 3, 4}), 0.8, 1e-12);
}

TEST(Table3, RelationsOfThePaperHoldButOne) {
  const Table t = run_all({}, 11, [](double) {});
  for (const auto& r : t.results) {
    EXPECT_EQ(r.status, icat::Status::ok) << icat::describe(r.status);
    EXPECT_LT(r.drift, 1e-4);
  }
  for (const Relation& relation : relations(t)) {
    // A known miss: docs/hydrodynamics.md says why.
    if (std::string(relation.text).starts_with("T1 aborts")) continue;
    EXPECT_TRUE(relation.holds) << relation.text;
  }
  const Correlations c = correlations(t);
  EXPECT_GE(c.force_mean, 0.85);
  EXPECT_GE(c.force_max, 0.8);
  EXPECT_GE(c.moment_mean, 0.7);
  double peak = 0;
  for (const auto& r : t.results) {
    peak = std::max(peak, r.thrust_peak);
    EXPECT_GE(r.thrust_mean, 20);
    EXPECT_LE(r.thrust_mean, 80);
    EXPECT_LE(r.thrust_peak, 250);
  }
  EXPECT_GE(peak, 100);
}

// The force limit is what ends a run.
TEST(Table3, AbortsAtTheForceLimit) {
  Parameters p;
  p.force_limit = 1;
  p.duration = 5;
  const Result r = run(rows[1], p);
  EXPECT_TRUE(r.aborted);
  EXPECT_EQ(r.status, icat::Status::ok);
  EXPECT_LT(r.end, p.duration);
  EXPECT_GT(r.force.max, p.force_limit);
}

}  // namespace
