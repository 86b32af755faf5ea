// SPDX-License-Identifier: BSD-3-Clause
// The three campaigns of [MARIS, Table I], simulated: attempts to grasp a pipe, their outcomes, and
// April without each of its remedies.
//
//   16_maris_campaign --attempts 300 continues where it was stopped
//   16_maris_campaign --attempts 300 --shard 1/4   every fourth attempt
//   16_maris_campaign --merge                      joins all shards in the folder
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/support.hpp"
#include "attempt.hpp"
#include "results.hpp"

namespace {

using campaign::Key;
using campaign::Results;

/// Runs `todo`, on `jobs` threads; each result is in `file` as soon as there is one.
void run(const std::vector<Key>& todo, int jobs, const std::string& file) {
  campaign::Journal journal(file);
  std::atomic<std::size_t> next = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < jobs; ++i) {
    threads.emplace_back([&] {
      for (std::size_t k = next++; k < todo.size(); k = next++) {
        const auto& [set, seed] = todo[k];
        const auto attempt = std::make_unique<campaign::Attempt>(
            campaign::sets[set], static_cast<std::uint64_t>(seed), false);
        journal.add(todo[k], attempt->run());
      }
    });
  }
  support::ProgressBar bar("attempts");
  while (journal.count() < static_cast<int>(todo.size())) {
    bar.show(static_cast<double>(journal.count()) / static_cast<double>(todo.size()));
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  for (auto& thread : threads) thread.join();
}

/// The first attempt of each set, for the picture.
void trace(const std::string& folder) {
  for (int set = 0; set < campaign::set_count; ++set) {
    const auto attempt =
        std::make_unique<campaign::Attempt>(campaign::sets[set], std::uint64_t{1}, true);
    (void)attempt->run();
    support::Csv csv(folder, "trace" + std::to_string(set) + ".csv",
                     "t,error,u,v,w,u_command,v_command,w_command,joints");
    for (const auto& s : attempt->samples()) csv.row(s.t, s.error, s.actual, s.command, s.joints);
  }
}

/// Numbers of "2/4"; false where it is no shard.
bool shard(const std::string& text, int& index, int& count) {
  char rest = 0;
  return std::sscanf(text.c_str(), "%d/%d%c", &index, &count, &rest) == 2 && count >= 1 &&
         index >= 1 && index <= count;
}

}  // namespace

int main(int argc, char** argv) {
  std::string attempts = "2", part = "1/1", jobs = "0";
  const auto arguments =
      support::parse(argc, argv, "The campaigns of 46 grasps, simulated.", "out/16_maris_campaign",
                     {}, {"--merge", "run nothing, join the shards in the folder"},
                     {{"--attempts", "of each campaign", &attempts},
                      {"--shard", "i/n: only this part of them", &part},
                      {"--jobs", "threads; 0: as many as there are processors", &jobs}});
  int index = 1, shards = 1;
  if (!shard(part, index, shards)) {
    std::fprintf(stderr, "--shard: i/n with 1 <= i <= n, got %s\n", part.c_str());
    return 2;
  }
  const int count = std::atoi(attempts.c_str());
  int threads = std::atoi(jobs.c_str());
  if (count < 1 || threads < 0) {
    std::fprintf(stderr, "--attempts must be > 0 and --jobs >= 0\n");
    return 2;
  }
  if (threads == 0) threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));

  std::error_code error;
  std::filesystem::create_directories(arguments.output, error);
  const std::string whole = arguments.output + "/attempts.csv";
  Results results;
  if (arguments.extended) {
    for (const auto& entry : std::filesystem::directory_iterator(arguments.output)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with("shard-") && name.ends_with(".csv")) {
        results.merge(campaign::read(entry.path().string()));
      }
    }
  } else {
    const std::string file = shards == 1 ? whole
                                         : arguments.output + "/shard-" + std::to_string(index) +
                                               "-of-" + std::to_string(shards) + ".csv";
    results = campaign::read(file);
    if (!campaign::write(file, results)) {
      std::fprintf(stderr, "cannot write %s\n", file.c_str());
      return 1;
    }
    std::vector<Key> todo;  // all campaigns side by side, so that a part is a smaller whole
    for (int seed = index; seed <= count; seed += shards) {
      for (int set = 0; set < campaign::set_count; ++set) {
        if (!results.contains({set, seed})) todo.push_back({set, seed});
      }
    }
    run(todo, threads, file);
    results = campaign::read(file);
    std::printf("%zu attempts, %zu of them now\n", results.size(), todo.size());
    if (shards > 1) return 0;
  }
  if (!campaign::write(whole, results)) {
    std::fprintf(stderr, "cannot write %s\n", whole.c_str());
    return 1;
  }
  const std::string text = campaign::table(results);
  std::ofstream(arguments.output + "/table.txt") << text;
  std::printf("\n%s", text.c_str());
  if (arguments.pictures) {
    trace(arguments.output);
    support::draw(arguments.output);
  }
  for (const auto& [key, r] : results) {
    if (r.outcome == "fault") return 1;
  }
  return results.empty() ? 1 : 0;
}
