// SPDX-License-Identifier: BSD-3-Clause
#define ICAT_PLOT_SCRIPT ""  // each example has its own
#include "support.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <memory>

namespace support {

namespace {

// In gnuplot's single quotes.
std::string quoted(std::string_view given) {
  std::string text(given);
  for (std::size_t i = 0; (i = text.find('\'', i)) != std::string::npos; i += 2)
    text.insert(i, 1, '\'');
  return "'" + text + "'";
}

}  // namespace

bool draw(const std::string& folder, std::initializer_list<Variable> more, const char* script) {
  const std::unique_ptr<FILE, int (*)(FILE*)> gnuplot(popen("gnuplot 2>/dev/null", "w"), pclose);
  if (!gnuplot) return false;
  std::string text = "folder = " + quoted(folder) + "\n";
  for (const Variable& v : more) text += std::string(v.name) + " = " + quoted(v.text) + "\n";
  text += "load " + quoted(script) + "\n";
  return std::fputs(text.c_str(), gnuplot.get()) >= 0;
}

ProgressBar::~ProgressBar() {
  if (shown_ >= 0) std::fprintf(stderr, "\r%60s\r", "");
}
void ProgressBar::show(double share) {
  const int length = static_cast<int>(30 * std::clamp(share, 0.0, 1.0));
  if (length == shown_ || isatty(STDERR_FILENO) == 0) return;
  shown_ = length;
  std::fprintf(stderr, "\r%-12s [%.*s%*s]", title_.c_str(), length,
               "##############################", 30 - length, "");
  std::fflush(stderr);
}

}  // namespace support
