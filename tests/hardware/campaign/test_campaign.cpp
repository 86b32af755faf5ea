// SPDX-License-Identifier: BSD-3-Clause
// The campaigns on fewer attempts; parts, interruptions and the statistics of the table.
#include <gtest/gtest.h>
#include <sys/wait.h>

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
/// For the shell: a path may have spaces.
std::string quoted(const std::string& path) { return "'" + path + "'"; }
/// What the program said to its caller; its errors are in `output`/errors.
int shell(const std::string& command) {
  const int status =
      std::system((command + " > /dev/null 2> " + quoted(output + "/errors")).c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}
std::string program(const std::string& where, const std::string& options) {
  return quoted(ICAT_CAMPAIGN) + " --no-pictures --output " + quoted(where) + " " + options;
}
std::string script(const std::string& where, const std::string& options) {
  return "ICAT_CAMPAIGN=" + quoted(ICAT_CAMPAIGN) + " ICAT_OUTPUT=" + quoted(where) + " " +
         quoted(ICAT_SOURCE "/scripts/campaign.sh") + " " + options;
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

  // Killed outright while it runs, and gone on with by two threads.
  const std::string shot = folder("shot");
  const std::string lines = "$(cat " + quoted(shot + "/attempts.csv") + " 2> /dev/null | wc -l)";
  ASSERT_EQ(shell("{ " + program(shot, "--attempts 3 --jobs 2") + " & p=$!; while [ " + lines +
                  " -lt 5 ]; do sleep 0.05; done; kill -9 $p; }"),
            0);
  EXPECT_LT(campaign::read(shot + "/attempts.csv").size(), 3u * campaign::set_count);
  ASSERT_EQ(shell(program(shot, "--attempts 3 --jobs 2")), 0);
  same(shot);

  const std::string parallel = folder("parallel");
  ASSERT_EQ(shell(script(parallel, "3 parallel 2")), 0);
  same(parallel);
  const std::string mpi = folder("mpi");
  ASSERT_EQ(shell(script(mpi, "3 mpi 2")), 0);
  same(mpi);
}

/// Results that nobody ran: attempts `first`, first + step … 6 of each campaign.
Results drawn(int first, int step) {
  Results results;
  for (int seed = first; seed <= 6; seed += step) {
    for (int set = 0; set < campaign::set_count; ++set) {
      results[{set, seed}].outcome = (seed + set) % 2 ? "done" : "lost";
    }
  }
  return results;
}
void put(const std::string& where, const campaign::Part& part, const Results& results) {
  ASSERT_TRUE(campaign::write(where + "/" + campaign::part_file(part), results));
}

// What is joined is the whole, or the program says what is not there; nothing is lost.
TEST(Campaign, MergeKnowsTheWhole) {
  const auto merge = [](const std::string& where) { return shell(program(where, "--merge")); };
  const auto said = [](const char* what) {
    return bytes(output + "/errors").find(what) != std::string::npos;
  };
  const std::string all = folder("merge_all");
  for (int i = 1; i <= 3; ++i) put(all, {i, 3}, drawn(i, 3));
  put(all, {1, 2}, drawn(1, 2));  // of another run, the same again
  EXPECT_EQ(merge(all), 0);
  const std::string whole = bytes(all + "/attempts.csv");
  ASSERT_TRUE(campaign::write(all + "/compare.csv", drawn(1, 1)));
  EXPECT_EQ(whole, bytes(all + "/compare.csv"));

  // No part: what was there before stays.
  const std::string none = folder("merge_none");
  ASSERT_TRUE(campaign::write(none + "/attempts.csv", drawn(1, 1)));
  EXPECT_NE(merge(none), 0);
  EXPECT_EQ(bytes(none + "/attempts.csv"), whole);
  EXPECT_NE(merge(folder("merge_nothing")), 0);
  EXPECT_FALSE(std::filesystem::exists(output + "/merge_nothing/attempts.csv"));

  // The last part, which leaves no gap, and one between.
  for (const int missing : {3, 2}) {
    const std::string where = folder("merge_missing");
    for (int i = 1; i <= 3; ++i) {
      if (i != missing) put(where, {i, 3}, drawn(i, 3));
    }
    EXPECT_EQ(merge(where), 1);
    EXPECT_TRUE(said(("shard-" + std::to_string(missing) + "-of-3").c_str()));
    EXPECT_EQ(campaign::read(where + "/attempts.csv").size(), 4u * campaign::set_count);
  }
  // One that was stopped.
  const std::string stopped = folder("merge_stopped");
  put(stopped, {1, 2}, drawn(1, 2));
  put(stopped, {2, 2}, drawn(2, 4));
  EXPECT_EQ(merge(stopped), 1);
  EXPECT_TRUE(said((std::to_string(campaign::set_count) + " attempts are not done").c_str()));
  // Two that say different things of one attempt.
  const std::string split = folder("merge_split");
  put(split, {1, 1}, drawn(1, 1));
  Results other = drawn(1, 2);
  other[{2, 3}].time = 1;
  put(split, {1, 2}, other);
  EXPECT_EQ(merge(split), 1);
  EXPECT_TRUE(said("attempt 3 of April 2016 ended in two ways"));
}

TEST(Campaign, RefusesWrongArguments) {
  const std::string where = folder("arguments");
  for (const char* wrong :
       {"--attempts 5x", "--attempts 1e3", "--attempts ''", "--attempts 0", "--attempts -1",
        "--attempts 99999999999", "--attempts 1.5", "--jobs two", "--jobs -1", "--shard 0/3",
        "--shard 4/3", "--shard 1/0", "--shard 1/2/3", "--shard 2", "--shard '1/ 2'",
        "--merge --shard 1/2"}) {
    EXPECT_EQ(shell(program(where, wrong)), 2) << wrong;
  }
  EXPECT_TRUE(std::filesystem::is_empty(where));
  std::ofstream(where + "/file") << "no folder";
  EXPECT_EQ(shell(program(where + "/file", "--attempts 1")), 1);
}

TEST(Campaign, LosesNoResults) {
  EXPECT_FALSE(campaign::Journal("/dev/full").add({0, 1}, {}));
  // Of another revision: put aside.
  const std::string where = folder("old");
  std::ofstream(where + "/attempts.csv") << "revision 0\n0,1,done\n";
  ASSERT_EQ(shell(program(where, "--attempts 1")), 0);
  EXPECT_EQ(bytes(where + "/attempts.csv.old"), "revision 0\n0,1,done\n");
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
  // October < December, and April 1.5 to 3 times December, as far as so few can tell.
  const auto lower = [&](int set) { return campaign::wilson(c[set]).lower; };
  const auto upper = [&](int set) { return campaign::wilson(c[set]).upper; };
  EXPECT_LT(lower(0), upper(1));
  EXPECT_LT(1.5 * lower(1), upper(2));
  EXPECT_GT(3 * upper(1), lower(2));
  // April owes it to the compensation, and that to the DVL.
  EXPECT_LT(campaign::fisher(c[3], c[2]), 0.05);
  EXPECT_TRUE(meet(c[3], campaign::paper[1]));
  EXPECT_GT(campaign::fisher(c[5], c[1]), 0.05);
  // What the page says of April: calibration, rounding and delay do not make it as in the trials.
  EXPECT_GT(c[6].rate(), c[1].rate());
  EXPECT_TRUE(meet(c[6], c[2]));
  // December owes it to the thrusters' dead zone.
  EXPECT_GT(c[7].rate(), c[1].rate());
  EXPECT_GT(c[7].rate(), 0.4);
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
