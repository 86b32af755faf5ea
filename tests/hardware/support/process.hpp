// SPDX-License-Identifier: BSD-3-Clause
// A peer in a process of its own, which can be killed and started again.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <stdexcept>
#include <string>
#include <vector>

namespace hardware {

/// Runs until it is killed, at the latest by the destructor; its standard output is ours to read.
class Process {
 public:
  explicit Process(std::vector<std::string> command) : command_(std::move(command)) { start(); }
  ~Process() { kill(); }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void start() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("pipe2");
    pid_ = ::fork();
    if (pid_ < 0) throw std::runtime_error("fork");
    if (pid_ == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      ::setpgid(0, 0);
      ::dup2(ends[1], STDOUT_FILENO);
      std::vector<char*> arguments;
      for (std::string& a : command_) arguments.push_back(a.data());
      arguments.push_back(nullptr);
      ::execvp(arguments[0], arguments.data());
      std::perror(arguments[0]);
      ::_exit(127);
    }
    ::setpgid(pid_, pid_);
    ::close(ends[1]);
    output_ = ends[0];
    seen_.clear();
  }
  /// At once, with its children; nothing where it does not run.
  void kill(int signal = SIGKILL) {
    if (pid_ <= 0) return;
    ::kill(-pid_, signal);
    ::waitpid(pid_, nullptr, 0);
    ::close(output_);
    pid_ = -1;
  }
  /// Reads its output until `text` comes; false after `seconds`, or where it ends before.
  bool wait_for(const std::string& text, double seconds) {
    using Clock = std::chrono::steady_clock;
    const auto end = Clock::now() + std::chrono::duration<double>(seconds);
    while (seen_.find(text) == std::string::npos) {
      const auto left =
          std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
      pollfd ready{output_, POLLIN, 0};
      if (left <= 0 || ::poll(&ready, 1, static_cast<int>(left)) <= 0) return false;
      char block[4096];
      const ssize_t n = ::read(output_, block, sizeof block);
      if (n <= 0) return false;
      seen_.append(block, static_cast<std::size_t>(n));
    }
    return true;
  }
  /// What it wrote, as far as `wait_for` read it.
  const std::string& output() const { return seen_; }
  pid_t pid() const { return pid_; }

 private:
  std::vector<std::string> command_;
  pid_t pid_{-1};
  int output_{-1};
  std::string seen_;
};

}  // namespace hardware
