// SPDX-License-Identifier: BSD-3-Clause
// The campaigns on fewer attempts; parts, interruptions and the statistics of the table.
#include <gtest/gtest.h>

#include <cstdlib>

#include "examples/16_maris_campaign/results.hpp"

namespace {

using campaign::Count;
using campaign::Results;

const std::string output = ICAT_OUTPUT;

/// Alone in its folder; what was there before is gone.
std::string folder(const std::string& name) {
  const std::string path = output + "/" + name;
  std::filesystem::remove_all(path);
  std::filesystem::create_directories(path);
  return path;
}
int shell(const std::string& command) { return std::system((command + " > /dev/null").c_str()); }
std::string program(const std::string& where, const std::string& options) {
  return std::string(ICAT_CAMPAIGN) + " --no-pictures --output " + where + " " + options;
}
std::string script(const std::string& where, const std::string& options) {
  return "ICAT_CAMPAIGN=" + std::string(ICAT_CAMPAIGN) + " ICAT_OUTPUT=" + where + " " +
         ICAT_SOURCE + "/scripts/campaign.sh " + options;
}
std::string bytes(const std::string& file) {
  std::ifstream in(file);
  std::stringstream all;
  all << in.rdbuf();
  return all.str();
}

TEST(CampaignStatistics, AgainstThePublishedNumbers) {
  // The intervals of [MARIS, Table I] to a tenth of a per cent, by another program.
  const double lower[] = {0.102, 0.127, 0.469}, upper[] = {0.495, 0.576, 0.867};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(campaign::wilson(campaign::paper[i]).lower, lower[i], 5e-4);
    EXPECT_NEAR(campaign::wilson(campaign::paper[i]).upper, upper[i], 5e-4);
  }
  EXPECT_NEAR(campaign::fisher(campaign::paper[1], campaign::paper[2]), 0.063, 5e-4);
  EXPECT_NEAR(campaign::fisher({8, 29}, campaign::paper[2]), 0.006, 5e-4);
  EXPECT_NEAR(campaign::fisher({3, 10}, {3, 10}), 1, 1e-12);
  EXPECT_LT(campaign::fisher({0, 20}, {20, 20}), 1e-10);
}

// Whatever part ran where and was stopped when: the same bytes.
TEST(Campaign, PartsMakeTheSameTable) {
  const std::string whole = folder("whole");
  ASSERT_EQ(shell(program(whole, "--attempts 3 --jobs 1")), 0);
  const std::string attempts = bytes(whole + "/attempts.csv"), table = bytes(whole + "/table.txt");
  ASSERT_EQ(std::count(attempts.begin(), attempts.end(), '\n'), 1 + 3 * campaign::set_count);
  const auto same = [&](const std::string& where) {
    EXPECT_EQ(bytes(where + "/attempts.csv"), attempts) << where;
    EXPECT_EQ(bytes(where + "/table.txt"), table) << where;
  };
  const std::string threads = folder("threads");
  ASSERT_EQ(shell(program(threads, "--attempts 3 --jobs 3")), 0);
  same(threads);

  // Killed in the middle of a line, and of another revision.
  const std::string killed = folder("killed");
  std::ofstream(killed + "/attempts.csv") << attempts.substr(0, attempts.size() * 2 / 3);
  ASSERT_EQ(shell(program(killed, "--attempts 3")), 0);
  same(killed);
  std::string other = attempts;
  other.replace(0, other.find(','), "revision 0");
  std::ofstream(killed + "/attempts.csv") << other;
  EXPECT_TRUE(campaign::read(killed + "/attempts.csv").empty());

  const std::string parallel = folder("parallel");
  ASSERT_EQ(shell(script(parallel, "3 parallel 2")), 0);
  same(parallel);
  const std::string mpi = folder("mpi");
  ASSERT_EQ(shell(script(mpi, "3 mpi 2")), 0);
  same(mpi);
}

// 30 attempts of each campaign, or as many as ICAT_CAMPAIGN_ATTEMPTS says. The deviation of a rate
// p of 30 is √(p (1 − p) / 30): 9 points at worst. So rates are compared by their 95 % intervals.
TEST(Campaign, Acceptance) {
  const char* told = std::getenv("ICAT_CAMPAIGN_ATTEMPTS");
  const std::string where = folder("acceptance");
  ASSERT_EQ(shell(program(where, "--attempts " + std::string(told ? told : "30"))), 0);
  const Results results = campaign::read(where + "/attempts.csv");
  std::printf("%s", campaign::table(results).c_str());
  Count c[campaign::set_count];
  for (int i = 0; i < campaign::set_count; ++i) c[i] = campaign::count(results, i);
  const auto meet = [](const Count& a, const Count& b) {
    const auto x = campaign::wilson(a), y = campaign::wilson(b);
    return x.lower <= y.upper && y.lower <= x.upper;
  };
  // October and December were tuned to, April was not.
  EXPECT_TRUE(meet(c[0], campaign::paper[0]));
  EXPECT_TRUE(meet(c[1], campaign::paper[1]));
  EXPECT_LT(campaign::fisher(c[1], c[2]), 0.05);
  EXPECT_GT(c[2].rate(), c[1].rate());
  // April owes it to the compensation, and that to the DVL.
  EXPECT_LT(campaign::fisher(c[3], c[2]), 0.05);
  EXPECT_TRUE(meet(c[3], campaign::paper[1]));
  EXPECT_GT(campaign::fisher(c[5], c[1]), 0.05);
  // October fails by its eyes: nothing, or the wrong thing, was seen. December does not.
  const auto blind = [&](int set) {
    return campaign::count(results, set, "not found") + campaign::count(results, set, "lost");
  };
  EXPECT_GT(2 * blind(0), c[0].failures());
  EXPECT_LT(2 * blind(1), c[1].failures());
  for (int i = 0; i < campaign::set_count; ++i) {
    EXPECT_EQ(campaign::count(results, i, "fault"), 0);
  }
}

}  // namespace
