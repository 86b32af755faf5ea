// SPDX-License-Identifier: BSD-3-Clause
// A table of numbers in a file.
#pragma once

#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <string>

namespace support {

/// Comma-separated, one line a row.
class Csv {
 public:
  /// `folder` is created if need be; `header` names the columns.
  Csv(const std::filesystem::path& folder, const char* name, const char* header) {
    std::filesystem::create_directories(folder);
    out_.open(folder / name);
    out_.precision(9);
    out_ << header << '\n';
  }
  void row(std::initializer_list<double> values) {
    const char* comma = "";
    for (const double value : values) {
      out_ << comma << value;
      comma = ",";
    }
    out_ << '\n';
  }

 private:
  std::ofstream out_;
};

}  // namespace support
