// SPDX-License-Identifier: BSD-3-Clause
// What the examples share: pictures by gnuplot, a progress bar.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>

namespace support {

/// A string of a gnuplot script.
struct Variable {
  const char* name;
  std::string_view text;
};

/// Starts gnuplot on `script` with its strings `folder` and `more`; it draws while the program goes
/// on.
void draw(const std::string& folder, std::initializer_list<Variable> more = {},
          const char* script = ICAT_PLOT_SCRIPT);

/// Waits for what `draw` started: are there pictures, and did none fail? A failure is told once on
/// standard error. A program that does not ask waits at its end.
bool drawn();

/// A progress bar on a terminal; prints nothing elsewhere; removed when destroyed.
class ProgressBar {
 public:
  explicit ProgressBar(std::string title) : title_(std::move(title)) {}
  ~ProgressBar();
  /// `share` from 0 to 1.
  void show(double share);

 private:
  std::string title_;
  int shown_ = -1;
};

}  // namespace support
