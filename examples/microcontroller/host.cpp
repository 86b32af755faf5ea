// SPDX-License-Identifier: BSD-3-Clause
// The computer that compiles: it yields the velocities to compare with and measures nothing.
#include <cstdio>
#include <cstdlib>

#include "board.hpp"

namespace board {

void print(const char* text) { std::fputs(text, stdout); }
std::uint32_t now() { return 0; }
std::uint32_t elapsed(std::uint32_t) { return 0; }
void run_instructions(std::uint32_t) {}
void lock_memory() {}
void print_memory() {}
void finish() { std::exit(0); }
void fail(const char* text) {
  std::fprintf(stderr, "error: %s\n", text);
  std::exit(1);
}

}  // namespace board
