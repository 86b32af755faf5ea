// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Writes a log as comma-separated values: a line of names, `time` first, then a line for each
/// sample. PlotJuggler opens it, with `time` as its time and a tree by the `/` in the names; so
/// does everything that reads tables.
///
/// A blank, comma, semicolon or quote of a name becomes `_`: PlotJuggler takes the most frequent of
/// them for the separator. A name that stands there already gets a number at its end. A number that
/// was not set is an empty cell. Numbers have the shortest text that reads as the same `double`.
#pragma once

#include <charconv>
#include <cmath>
#include <fstream>
#include <set>
#include <string>
#include <string_view>

#include "icat/control/log.hpp"

namespace icat {

namespace detail {

inline void csv_name(std::string& to, std::string_view name) {
  for (const char c : name) {
    const bool bad = static_cast<unsigned char>(c) <= ' ' || c == ',' || c == ';' || c == '"';
    to += bad ? '_' : c;
  }
}
/// The names of a line, which are told apart.
class CsvNames {
 public:
  /// `name` as it may stand there.
  std::string add(std::string_view name) {
    std::string good;
    csv_name(good, name);
    std::string unique = good;
    for (int k = 2; !used_.insert(unique).second; ++k) {
      unique = good;
      unique.append("_").append(std::to_string(k));
    }
    return unique;
  }

 private:
  std::set<std::string> used_;
};
inline void csv_number(std::string& to, double value) {
  char text[32];
  if (!std::isfinite(value)) return;
  const auto end = std::to_chars(text, text + sizeof text, value);
  to.append(text, static_cast<std::size_t>(end.ptr - text));
}

}  // namespace detail

/// Components of a channel's numbers, to append to its name.
inline const char* log_component(LogKind kind, std::size_t i) noexcept {
  constexpr const char* names[] = {"/x", "/y", "/z", "/qx", "/qy", "/qz", "/qw"};
  return kind == LogKind::number ? "" : names[i];
}

/// The samples, to a stream that the caller opened. False where the stream fails.
[[nodiscard]] inline bool write_csv(const Log& log, std::ostream& to) {
  detail::CsvNames names;
  std::string line = names.add("time");
  for (std::size_t c = 0; c < log.channel_count(); ++c) {
    for (std::size_t k = 0; k < Log::width(log.kind(c)); ++k) {
      line += ',';
      line += names.add(log.name(c) + log_component(log.kind(c), k));
    }
  }
  to << line << '\n';
  for (std::size_t i = 0; i < log.size(); ++i) {
    line.clear();
    detail::csv_number(line, log.time(i));
    for (std::size_t c = 0; c < log.channel_count(); ++c) {
      const double* values = log.values(c, i);
      for (std::size_t k = 0; k < Log::width(log.kind(c)); ++k) {
        line += ',';
        detail::csv_number(line, values[k]);
      }
    }
    to << line << '\n';
  }
  return static_cast<bool>(to.flush());
}
/// The same to the file `path`, which is replaced. Texts are not in it: MCAP and the replay have
/// them.
[[nodiscard]] inline bool write_csv(const Log& log, const std::string& path) {
  std::ofstream to(path, std::ios::binary);
  return to && write_csv(log, to);
}

}  // namespace icat
