// SPDX-License-Identifier: BSD-3-Clause
// The functions that main.cpp needs of its machine: board.cpp is a Cortex-M without operating
// system, host.cpp the computer that compiles.
#pragma once

#include <array>
#include <charconv>
#include <cstdint>

namespace board {

void print(const char* text);
// Without printf, which takes memory from the heap for a float.
inline void print(std::uint32_t number, int base = 10) {
  std::array<char, 12> text{};
  std::to_chars(text.begin(), text.end() - 1, number, base);
  print(text.data());
}
/// One line of what compare.cpp makes a table of.
inline void print_figure(const char* name, std::uint32_t value) {
  print("figure ");
  print(name);
  print(" ");
  print(value);
  print("\n");
}

/// A counter that wraps; only differences, by `elapsed`, mean something.
std::uint32_t now();
/// Instructions since `start`, to a multiple of the counter's step.
std::uint32_t elapsed(std::uint32_t start);
/// Runs a loop of `instructions` (even) instructions, to check `elapsed` against.
void run_instructions(std::uint32_t instructions);

/// From here on an allocation ends the program with an error.
void lock_memory();
/// Prints flash, static memory, arena and stack, if this machine has such limits.
void print_memory();
/// Ends the program with success. Where memory can be locked, only if an allocation is caught.
[[noreturn]] void finish();
/// Ends the program with an error.
[[noreturn]] void fail(const char* text);

}  // namespace board
