// SPDX-License-Identifier: BSD-3-Clause
// What an example writes for gnuplot: tables of numbers, strokes of a drawing.
#pragma once

#include <algorithm>
#include <cstdio>
#include <icat/core/types.hpp>
#include <initializer_list>
#include <memory>
#include <string>

namespace support {

/// Numbers in a text file; where it cannot be opened, nowhere.
class TextFile {
 public:
  /// All of it so far is in the file: it was opened, and the disk is not full.
  bool written() const;

 protected:
  /// `folder` is created if need be.
  TextFile(const std::string& folder, const std::string& name);
  void put(const char* text);
  void put(double value);

 private:
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

/// Comma-separated, one line a row.
class Csv : TextFile {
 public:
  using TextFile::written;
  /// `header` names the columns.
  Csv(const std::string& folder, const std::string& name, const std::string& header);
  /// Each value is a number or a range of numbers, such as a vector.
  template <class... Values>
  void row(const Values&... values) {
    (add(values), ...);
    end();
  }
  void row(std::initializer_list<double> values) { row<std::initializer_list<double>>(values); }

 private:
  template <class Value>
  void add(const Value& value) {
    if constexpr (requires { double(value); }) {
      add(double(value));
    } else if constexpr (requires { value.data(); }) {
      for (decltype(value.size()) i = 0; i < value.size(); ++i) add(double(value.data()[i]));
    } else {
      for (const double v : value) add(v);
    }
  }
  void add(double value);
  void end();

  const char* comma_ = "";
};

/// Blocks of points for gnuplot's `index`.
class Strokes : TextFile {
 public:
  Strokes(const std::string& folder, const std::string& name);
  /// The next block; `points` is a range of vectors.
  template <class Points = std::initializer_list<icat::Vector3<double>>>
  void add(const Points& points) {
    for (const auto& p : points) add(p.x(), p.y(), p.z());
    end();
  }

 private:
  void add(double x, double y, double z);
  void end();
};

/// The first of `samples` at time `t` or later.
template <class Samples>
const auto& sample_at(const Samples& samples, double t) {
  return *std::find_if(samples.begin(), samples.end() - 1,
                       [&](const auto& sample) { return sample.t >= t - 1e-9; });
}

}  // namespace support
