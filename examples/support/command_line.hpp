// SPDX-License-Identifier: BSD-3-Clause
// The examples' command line. CLI11 takes longer to compile than an example, so it is behind a
// function that is compiled once.
#pragma once

#include <string>
#include <vector>

namespace support {

/// What was asked for.
struct CommandLine {
  std::string output;     ///< --output: folder of the CSV files and pictures
  std::string variant;    ///< --variant: run this one alone; empty: all
  bool pictures = true;   ///< --no-pictures: do not call gnuplot
  bool logs = false;      ///< --logs: every run as CSV and MCAP, too
  bool extended = false;  ///< the example's own flag
};

/// An example's own flag, such as {"--sensitivity", "vary the choices, too"}.
struct Flag {
  const char* name = nullptr;
  const char* help = nullptr;
};

/// An example's own option with a value; what it holds before is the default.
struct Option {
  const char* name;
  const char* help;
  std::string* value;
  std::vector<std::string> choices = {};  ///< none: anything
};

/// Ends the program for --help (0) or a bad command line (not 0). `--variant` exists where there
/// are `variants`.
CommandLine parse(int argc, char** argv, const char* description, const char* output,
                  const std::vector<std::string>& variants = {}, Flag flag = {},
                  const std::vector<Option>& options = {});

}  // namespace support
