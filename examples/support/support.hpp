// SPDX-License-Identifier: BSD-3-Clause
// What the examples share: pictures by gnuplot, a progress bar.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>

namespace support {

/// A string in gnuplot's single quotes.
inline std::string quoted(std::string text) {
  for (std::size_t i = 0; (i = text.find('\'', i)) != std::string::npos; i += 2)
    text.insert(i, 1, '\'');
  return "'" + text + "'";
}

/// Runs the example's plot.gp after the assignments in `variables`. False where gnuplot cannot be
/// started.
inline bool draw(const std::string& variables) {
  const std::unique_ptr<FILE, int (*)(FILE*)> gnuplot(popen("gnuplot 2>/dev/null", "w"), pclose);
  if (!gnuplot) return false;
  const std::string script = variables + "\nload " + quoted(ICAT_PLOT_SCRIPT) + "\n";
  return std::fputs(script.c_str(), gnuplot.get()) >= 0;
}

/// One line on a terminal, nothing elsewhere; gone when it is destroyed.
class ProgressBar {
 public:
  explicit ProgressBar(std::string title) : title_(std::move(title)) {}
  ~ProgressBar() {
    if (shown_ >= 0) std::fprintf(stderr, "\r%60s\r", "");
  }
  /// `share` from 0 to 1.
  void show(double share) {
    const int length = static_cast<int>(30 * std::clamp(share, 0.0, 1.0));
    if (length == shown_ || isatty(STDERR_FILENO) == 0) return;
    shown_ = length;
    std::fprintf(stderr, "\r%-12s [%.*s%*s]", title_.c_str(), length,
                 "##############################", 30 - length, "");
    std::fflush(stderr);
  }

 private:
  std::string title_;
  int shown_ = -1;
};

}  // namespace support
