// SPDX-License-Identifier: BSD-3-Clause
// A table of numbers in a file.
#pragma once

#include <concepts>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <string>

namespace support {

/// Comma-separated, one line a row.
class Csv {
 public:
  /// `folder` is created if need be; `header` names the columns.
  Csv(const std::filesystem::path& folder, const std::string& name, const std::string& header) {
    std::filesystem::create_directories(folder);
    out_.open(folder / name);
    out_.precision(9);
    out_ << header << '\n';
  }
  /// Each value is a number or a range of numbers, such as a vector.
  template <class... Values>
  void row(const Values&... values) {
    const char* comma = "";
    const auto put = [&](double value) {
      out_ << comma << value;
      comma = ",";
    };
    const auto put_all = [&](const auto& value) {
      if constexpr (requires { double(value); }) {
        put(double(value));
      } else {
        for (const double v : value) put(v);
      }
    };
    (put_all(values), ...);
    out_ << '\n';
  }
  void row(std::initializer_list<double> values) { row<std::initializer_list<double>>(values); }

 private:
  std::ofstream out_;
};

}  // namespace support
