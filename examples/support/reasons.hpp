// SPDX-License-Identifier: BSD-3-Clause
// Why a robot moves as it does, for a replay that is written after the run.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace support {

/// What `explain` concludes of a controller, four times a second. For the controllers that
/// reasons.cpp names: it is slow to compile, so it is compiled once.
template <class Controller>
class Reasons {
 public:
  Reasons();
  ~Reasons();
  Reasons(Reasons&&) noexcept;
  Reasons& operator=(Reasons&&) noexcept;

  /// After the controller's step at `t`; always the same controller.
  void record(double t, const Controller& controller);
  /// Each with its time, s.
  const std::vector<std::pair<double, std::string>>& sentences() const;
  /// What the sentences cost, s: no part of what the run cost.
  double seconds() const;

 private:
  struct Recorded;
  std::unique_ptr<Recorded> recorded_;
};

}  // namespace support
