// SPDX-License-Identifier: BSD-3-Clause
// Why a robot moves as it does, for a replay that is written after the run.
#pragma once

#include <ctime>
#include <icat/control/explain.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace support {

/// What `explain` concludes of a controller, four times a second.
template <class Controller>
class Reasons {
 public:
  /// After the controller's step at `t`; always the same controller.
  void record(double t, const Controller& controller) {
    if (t < next_) return;
    next_ = t + 0.25;  // s: as often as a person reads
    const std::clock_t begin = std::clock();
    if (!explainer_) explainer_.emplace(controller);
    explainer_->update();
    sentences_.emplace_back(t, explainer_->conclusion());
    took_ += std::clock() - begin;
  }
  /// Each with its time, s.
  const std::vector<std::pair<double, std::string>>& sentences() const { return sentences_; }

  /// What the sentences cost, s: no part of what the run cost.
  double seconds() const { return static_cast<double>(took_) / CLOCKS_PER_SEC; }

 private:
  std::optional<icat::Explainer<Controller>> explainer_;
  std::vector<std::pair<double, std::string>> sentences_;
  double next_ = 0;
  std::clock_t took_ = 0;
};

}  // namespace support
