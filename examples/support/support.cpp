// SPDX-License-Identifier: BSD-3-Clause
#define ICAT_PLOT_SCRIPT ""  // each example has its own
#include "support.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <vector>

namespace support {

namespace {

// In gnuplot's single quotes.
std::string quoted(std::string_view given) {
  std::string text(given);
  for (std::size_t i = 0; (i = text.find('\'', i)) != std::string::npos; i += 2)
    text.insert(i, 1, '\'');
  return "'" + text + "'";
}

// The processes of gnuplot; no shell is asked, so that a missing gnuplot is seen.
class Gnuplots {
 public:
  ~Gnuplots() { wait(); }
  void start(std::string text, std::string script) {
    char name[] = "gnuplot", execute[] = "-e";
    char* arguments[] = {name, execute, text.data(), script.data(), nullptr};
    posix_spawn_file_actions_t quiet;
    posix_spawn_file_actions_init(&quiet);
    for (const int stream : {STDOUT_FILENO, STDERR_FILENO})
      posix_spawn_file_actions_addopen(&quiet, stream, "/dev/null", O_WRONLY, 0);
    pid_t pid = 0;
    ++started_;
    if (const int error = posix_spawnp(&pid, name, &quiet, nullptr, arguments, environ)) {
      reason_ = std::string("gnuplot: ") + std::strerror(error);
    } else {
      running_.push_back(pid);
    }
    posix_spawn_file_actions_destroy(&quiet);
  }
  bool wait() {
    for (const pid_t pid : running_) {
      int status = 0;
      if (waitpid(pid, &status, 0) != pid || status != 0) reason_ = "gnuplot failed";
    }
    running_.clear();
    if (!reason_.empty()) std::fprintf(stderr, "Pictures are missing (%s)\n", reason_.c_str());
    failed_ = failed_ || !reason_.empty();
    reason_.clear();
    return started_ > 0 && !failed_;
  }

 private:
  std::vector<pid_t> running_;
  std::string reason_;
  int started_ = 0;
  bool failed_ = false;
} gnuplots;

}  // namespace

void draw(const std::string& folder, std::initializer_list<Variable> more, const char* script) {
  std::string text = "folder = " + quoted(folder);
  for (const Variable& v : more) text += std::string("; ") + v.name + " = " + quoted(v.text);
  gnuplots.start(std::move(text), script);
}

bool drawn() { return gnuplots.wait(); }

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
