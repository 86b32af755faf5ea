// SPDX-License-Identifier: BSD-3-Clause
// Runs the steps of docs/tutorial.md, each as it should be and with one line broken: prints what
// `explain` says of either, and writes a replay with both beside each other.
#include <cstdio>

#include "../support/command_line.hpp"
#include "../support/replay.hpp"
#include "steps.hpp"

int main(int argc, char** argv) {
  std::vector<std::string> numbers;
  for (int step = 1; step <= tutorial::steps; ++step) numbers.push_back(std::to_string(step));
  std::string only;
  const auto arguments =
      support::parse(argc, argv, "Six steps, each as it should be and with one line broken.",
                     "out/tutorial", {}, {}, {{"--step", "run this one alone", &only, numbers}});

  for (int step = 1; step <= tutorial::steps; ++step) {
    if (!only.empty() && only != std::to_string(step)) continue;
    const std::string number = std::to_string(step);
    const std::string title = "Step " + number + ": " + tutorial::title(step);
    support::Replay replay(title.c_str(), step == 4);  // the vehicle's z points down
    std::printf("%s\n", title.c_str());
    for (const auto form : {tutorial::Form::whole, tutorial::Form::broken}) {
      const auto outcome = tutorial::run(step, form, &replay);
      std::printf(
          "\n%s (tool %.1f mm off its goal at the end, joints at least %.2f rad off their "
          "ends):\n%s",
          form == tutorial::Form::whole ? "As it should be" : "One line broken",
          1e3 * outcome.error, outcome.margin, outcome.text.c_str());
    }
    std::printf("\n");
    replay.write(arguments.output + "/" + number, arguments.logs);
    std::printf("\n");
  }
}
