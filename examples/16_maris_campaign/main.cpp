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
#include <numbers>
#include <optional>
#include <thread>

#include "../support/command_line.hpp"
#include "../support/csv.hpp"
#include "../support/geometry.hpp"
#include "../support/robot_replay.hpp"
#include "../support/support.hpp"
#include "attempt.hpp"
#include "results.hpp"

namespace {

using campaign::Key;
using campaign::Results;

/// Runs `todo`, on `jobs` threads; each result is in `file` as soon as there is one. False, and the
/// rest is left, where the file does not take them.
bool run(const std::vector<Key>& todo, int jobs, const std::string& file) {
  campaign::Journal journal(file);
  std::atomic<std::size_t> next = 0;
  std::atomic<bool> written = true;
  std::vector<std::thread> threads;
  for (int i = 0; i < jobs; ++i) {
    threads.emplace_back([&] {
      for (std::size_t k = next++; k < todo.size() && written; k = next++) {
        const auto& [set, seed] = todo[k];
        const auto attempt = std::make_unique<campaign::Attempt>(campaign::sets[set],
                                                                 static_cast<std::uint64_t>(seed));
        if (!journal.add(todo[k], attempt->run())) written = false;
      }
    });
  }
  support::ProgressBar bar("attempts");
  while (written && journal.count() < static_cast<int>(todo.size())) {
    bar.show(static_cast<double>(journal.count()) / static_cast<double>(todo.size()));
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  for (auto& thread : threads) thread.join();
  return written;
}

/// An attempt in the replay.
class View {
 public:
  View(support::Replay& replay, const char* name, const campaign::Attempt& attempt)
      : view_(replay, attempt.controller(),
              {.frames = {"tool"},
               .name = name,
               .base = {1.0, 0.6, 0.6},
               .ground = campaign::floor,
               .samples = 4000,
               .rows = false}) {
    view_.run().shapes.push_back({.form = icat::ReplayForm::cylinder,
                                  .frame = "pipe",
                                  .at = support::pose({0, 0, 0}, 0, std::numbers::pi / 2, 0),
                                  .size = {campaign::radius, 1, 0},
                                  .color = "#b5651d"});
    view_.run().shapes.push_back({.form = icat::ReplayForm::cone,
                                  .frame = "frame/base",
                                  .at = campaign::camera_mount(),
                                  .size = {0.4, 1.8, 0},
                                  .color = "#f4d35e",
                                  .opacity = 0.16});
    view_.run().plots.insert(view_.run().plots.begin(),
                             {"Palm to its place over the pipe", {"palm/"}, "m", 0, 0, true});
  }
  void record(const campaign::Attempt& now, const campaign::Sample& sample) {
    if (now.phase() == "survey") {  // no goal yet
      view_.record(sample.t, now.phase());
    } else {
      view_.record(sample.t, now.goal().translation(), now.phase());
    }
    view_.log().set(pipe_, now.seen_pipe());
    view_.log().set(error_, sample.error);
  }
  void end(const char* name, const std::string& outcome) {
    view_.run().title = name + (": " + outcome);
  }

 private:
  support::RobotReplay<icat::ParallelController<campaign::Robot>> view_;
  icat::LogChannel pipe_ = view_.log().add("pipe", "m", icat::LogKind::pose),
                   error_ = view_.log().add("palm/true error", "m");
};

/// The first attempt of each set, for the picture; those of the campaigns and of April
/// without compensation in the replay.
void trace(const std::string& folder, support::Replay& replay) {
  for (int set = 0; set < campaign::set_count; ++set) {
    const char* name = campaign::sets[set].name;
    const auto attempt = std::make_unique<campaign::Attempt>(campaign::sets[set], std::uint64_t{1});
    std::optional<View> view;
    if (set < 4) view.emplace(replay, name, *attempt);
    support::Csv csv(folder, "trace" + std::to_string(set) + ".csv",
                     "t,error,u,v,w,u_command,v_command,w_command,joints");
    const auto result = attempt->run([&](const campaign::Attempt& now) {
      const campaign::Sample s = now.sample();
      csv.row(s.t, s.error, s.actual, s.command, s.joints);
      if (view) view->record(now, s);
    });
    if (view) view->end(name, result.outcome);
  }
}

/// Takes a file of another revision out of the way.
bool make_way(const std::string& file) {
  if (!campaign::foreign(file)) return true;
  std::error_code error;
  std::filesystem::rename(file, file + ".old", error);
  std::fprintf(stderr, "%s is of another revision: it is %s.old now\n", file.c_str(), file.c_str());
  return !error;
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
  const auto shard = campaign::part(part);
  if (!shard) {
    std::fprintf(stderr, "--shard: i/n with 1 <= i <= n, got %s\n", part.c_str());
    return 2;
  }
  const auto count = campaign::number(attempts, 1), threads = campaign::number(jobs, 0);
  if (!count || !threads) {
    std::fprintf(stderr, "--attempts must be > 0 and --jobs >= 0, got %s and %s\n",
                 attempts.c_str(), jobs.c_str());
    return 2;
  }
  if (arguments.extended && shard->count > 1) {
    std::fprintf(stderr, "--merge joins all shards, it takes no --shard\n");
    return 2;
  }

  std::error_code error;
  std::filesystem::create_directories(arguments.output, error);
  if (!std::filesystem::is_directory(arguments.output, error)) {
    std::fprintf(stderr, "cannot make the folder %s\n", arguments.output.c_str());
    return 1;
  }
  const std::string whole = arguments.output + "/attempts.csv";
  Results results;
  int code = 0;
  if (arguments.extended) {
    auto joined = campaign::join(arguments.output);
    for (const std::string& reason : joined.missing) {
      std::fprintf(stderr, "not whole: %s\n", reason.c_str());
      code = 1;
    }
    results = std::move(joined.results);
    if (results.empty()) return 1;
  } else {
    const std::string file =
        shard->count == 1 ? whole : arguments.output + "/" + campaign::part_file(*shard);
    results = campaign::read(file);
    if (!make_way(file) || !campaign::write(file, results)) {
      std::fprintf(stderr, "cannot write %s\n", file.c_str());
      return 1;
    }
    std::vector<Key> todo;  // all campaigns side by side, so that a part is a smaller whole
    for (int seed = shard->index; seed <= *count; seed += shard->count) {
      for (int set = 0; set < campaign::set_count; ++set) {
        if (!results.contains({set, seed})) todo.push_back({set, seed});
      }
    }
    const int processors = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    const bool written = run(todo, *threads > 0 ? *threads : processors, file);
    results = campaign::read(file);
    for (const Key& key : todo) {
      if (written && results.contains(key)) continue;
      std::fprintf(stderr, "results were lost: %s is full, or another program writes it\n",
                   file.c_str());
      return 1;
    }
    std::printf("%zu attempts, %zu of them now\n", results.size(), todo.size());
    if (shard->count > 1) return 0;
  }
  if (!make_way(whole) || !campaign::write(whole, results)) {
    std::fprintf(stderr, "cannot write %s\n", whole.c_str());
    return 1;
  }
  const std::string text = campaign::table(results);
  std::ofstream(arguments.output + "/table.txt") << text;
  std::printf("\n%s", text.c_str());
  if (arguments.pictures) {
    support::Replay replay("Attempts to grasp a pipe in the campaigns of MARIS", true);
    trace(arguments.output, replay);
    support::draw(arguments.output);
    replay.show(campaign::sets[2].name, campaign::sets[3].name);
    replay.write(arguments.output, arguments.logs);
  }
  for (const auto& [key, r] : results) {
    if (r.outcome == "fault") code = 1;
  }
  return code;
}
