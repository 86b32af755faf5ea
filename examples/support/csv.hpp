// SPDX-License-Identifier: BSD-3-Clause
// What an example writes for gnuplot: tables of numbers, strokes of a drawing.
#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <icat/core/types.hpp>
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

/// Blocks of points for gnuplot's `index`.
class Strokes {
 public:
  Strokes(const std::filesystem::path& folder, const std::string& name) {
    std::filesystem::create_directories(folder);
    out_.open(folder / name);
  }
  /// The next block; `points` is a range of vectors.
  template <class Points = std::initializer_list<icat::Vector3<double>>>
  void add(const Points& points) {
    for (const auto& p : points) out_ << p.x() << ',' << p.y() << ',' << p.z() << '\n';
    out_ << "\n\n";
  }

 private:
  std::ofstream out_;
};

/// The first of `samples` at time `t` or later.
template <class Samples>
const auto& sample_at(const Samples& samples, double t) {
  return *std::find_if(samples.begin(), samples.end() - 1,
                       [&](const auto& sample) { return sample.t >= t - 1e-9; });
}

}  // namespace support
