// SPDX-License-Identifier: BSD-3-Clause
// The six steps of docs/tutorial.md, each as it should be and with one line broken.
#pragma once

#include <icat/control/explanation.hpp>
#include <string>
#include <vector>

namespace support {
class Replay;
}

namespace tutorial {

inline constexpr int steps = 6;

/// One of a step's two forms.
enum class Form { whole, broken };

/// How it stood with a task when the step asked why.
struct Judgement {
  std::string task;           ///< its name
  icat::Verdict verdict;      ///< in a word
  bool alarm;                 ///< somebody should look at it
  icat::LossCause cause{};    ///< of its largest loss; means nothing where it loses nothing
  icat::LimitKind limit{};    ///< of that cause
  std::string taken_by = {};  ///< the task that took it; empty: none
  std::string column = {};    ///< the joint, or the axis of the base; empty: none
};

/// What came of a step.
struct Outcome {
  std::string text;                   ///< `explain`'s, at the moment that the step asks
  std::vector<Judgement> judgements;  ///< the same for a program
  double error = 0;                   ///< from the tool to its goal at the end, m
  double margin = 0;                  ///< least distance of a joint from its limit, rad
  double largest_change = 0;          ///< of the command from a cycle to the next, norm
};

/// What a step is about.
const char* title(int step);
/// Runs `step`, 1 … `steps`. With a replay, a run is added to it.
Outcome run(int step, Form form, support::Replay* replay = nullptr);

}  // namespace tutorial
