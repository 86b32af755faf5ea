// SPDX-License-Identifier: BSD-3-Clause
// The solver against the literal Eq. (20)–(23) where rows are dependent, nearly so, or of very
// different size.
#include <icat/tpik/tpik.hpp>

#include "support/oracle_rule.hpp"
#include "support/sanitized.hpp"

namespace {

struct Shard {
  Family family;
  int part;
};

class Families : public testing::TestWithParam<Shard> {};

TEST_P(Families, EqualTheLiteralFormula) {
  constexpr int per_part = sanitized ? 100 : 10000;
  const auto [family, part] = GetParam();
  oracle::Judged worst{};
  int beyond = 0;
  for (int i = 0; i < per_part; ++i) {
    const unsigned seed = static_cast<unsigned>(part * per_part + i);
    SCOPED_TRACE(seed);
    const RandomHierarchy h = HierarchyGenerator(seed).hierarchy_of(family);
    icat::Tpik<double> tpik(h.dof);
    oracle::run(tpik, h);
    const auto judged = oracle::expect_exact<double>(tpik.velocity(), h);
    worst = {std::max(worst.error, judged.error), std::max(worst.by_literal, judged.by_literal)};
    beyond += judged.error > 1e-9;
  }
  std::printf("worst relative error %.1e, %d beyond 1e-9, worst %.2f of the literal's\n",
              worst.error, beyond, worst.by_literal);
}

// 20,000 of each family, in two parts for two cores.
INSTANTIATE_TEST_SUITE_P(All, Families,
                         testing::Values(Shard{Family::dependent, 0}, Shard{Family::dependent, 1},
                                         Shard{Family::nearly_dependent, 0},
                                         Shard{Family::nearly_dependent, 1},
                                         Shard{Family::scaled, 0}, Shard{Family::scaled, 1},
                                         Shard{Family::tall, 0}, Shard{Family::tall, 1}));

}  // namespace
