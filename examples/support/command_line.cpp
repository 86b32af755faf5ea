// SPDX-License-Identifier: BSD-3-Clause
#include "command_line.hpp"

#include <CLI/CLI.hpp>
#include <cstdlib>

namespace support {

CommandLine parse(int argc, char** argv, const char* description, const char* output,
                  const std::vector<std::string>& variants, Flag flag,
                  const std::vector<Option>& options) {
  CommandLine line;
  line.output = output;
  bool no_pictures = false;
  CLI::App app{description};
  app.add_option("--output", line.output, "folder of the CSV files and pictures")
      ->capture_default_str();
  app.add_flag("--no-pictures", no_pictures, "do not call gnuplot");
  app.add_flag("--logs", line.logs, "write every run of the replay as CSV and MCAP, too");
  if (!variants.empty()) {
    app.add_option("--variant", line.variant, "run this one alone")->check(CLI::IsMember(variants));
  }
  if (flag.name) app.add_flag(flag.name, line.extended, flag.help);
  for (const Option& o : options) {
    CLI::Option* option = app.add_option(o.name, *o.value, o.help)->capture_default_str();
    if (!o.choices.empty()) option->check(CLI::IsMember(o.choices));
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    std::exit(app.exit(error));
  }
  line.pictures = !no_pictures;
  return line;
}

}  // namespace support
