// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Writes logs as one HTML file that any browser opens without a network: the robot in 3-D over a
/// time slider, texts, and plots that follow the slider; several runs side by side. The page's own
/// files are in examples/support/replay, and `share/icat/replay` once installed; three.js (r111 …
/// r159, as a script: Debian's libjs-three, npm's three@0.149) is read from where you say when the
/// page is written. Without it, the page has all but the 3-D picture, and says so.
///
/// Numbers have 32 bits; those of points and poses have 16 between their smallest and largest
/// value: 1 mm in 65 m.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "icat/adapters/json_text.hpp"
#include "icat/adapters/replay_scene.hpp"

namespace icat {

/// Where the files are that the page is made of.
struct ReplayFiles {
  std::string folder;      ///< has page.html
  std::string three = {};  ///< three.min.js; empty or not there: no 3-D picture
};

namespace detail {

inline const char* replay_form(ReplayForm form) noexcept {
  constexpr const char* names[] = {"box",  "sphere", "cylinder", "capsule", "cone",
                                   "axes", "bone",   "path",     "ground"};
  return names[static_cast<std::size_t>(form)];
}
inline const char* log_topic(LogTopic topic) noexcept {
  return topic == LogTopic::event ? "event" : topic == LogTopic::phase ? "phase" : "explanation";
}
inline const char* log_kind(LogKind kind) noexcept {
  return kind == LogKind::number ? "number" : kind == LogKind::point ? "point" : "pose";
}

inline void base64(std::string& to, std::string_view bytes) {
  constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const auto byte = [&](std::size_t i) -> std::uint32_t {
    return i < bytes.size() ? static_cast<unsigned char>(bytes[i]) : 0u;
  };
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::uint32_t block = byte(i) << 16 | byte(i + 1) << 8 | byte(i + 2);
    to += digits[block >> 18];
    to += digits[block >> 12 & 63];
    to += i + 1 < bytes.size() ? digits[block >> 6 & 63] : '=';
    to += i + 2 < bytes.size() ? digits[block & 63] : '=';
  }
}
/// Little endian.
template <class Integer>
void put_integer(std::string& to, Integer value) {
  for (std::size_t i = 0; i < sizeof value; ++i) to += static_cast<char>(value >> (8 * i) & 255u);
}

/// See `decode` of data.js.
inline void replay_column(std::string& to, const std::vector<double>& values, LogKind kind) {
  double least = infinity<double>, most = -infinity<double>;
  bool gaps = false;
  for (const double v : values) {
    if (std::isfinite(v)) {
      least = std::min(least, v);
      most = std::max(most, v);
    } else {
      gaps = true;
    }
  }
  if (!(least <= most)) {
    to += "null";
    return;
  }
  if (!gaps && least == most) {
    json_number(to, least);
    return;
  }
  std::string bytes;
  if (kind == LogKind::number) {
    for (const double v : values) {
      const double largest = std::numeric_limits<float>::max();
      // Beyond a float's range a conversion is undefined; infinity and NaN are gaps of the line.
      put_integer(bytes, std::bit_cast<std::uint32_t>(static_cast<float>(
                             std::isfinite(v) ? std::clamp(v, -largest, largest) : v)));
    }
    to += '"';
    base64(to, bytes);
    to += '"';
    return;
  }
  constexpr std::uint16_t not_set = 65535;
  // Each is halved: the difference of two numbers may be too large for one.
  const double range = most / 2 - least / 2;
  for (const double v : values) {
    const double share = range > 0 ? (v / 2 - least / 2) / range : 0;
    put_integer(bytes, std::isfinite(v) ? static_cast<std::uint16_t>(share * (not_set - 1) + 0.5)
                                        : not_set);
  }
  to += '[';
  json_number(to, least);
  to += ',';
  json_number(to, most);
  to += ",\"";
  base64(to, bytes);
  to += "\"]";
}

inline void replay_shape(std::string& to, const ReplayShape& s) {
  json_comma(to);
  to += '{';
  json_member(to, "shape", replay_form(s.form));
  if (!s.frame.empty()) json_member(to, "frame", s.frame);
  if (!s.to.empty()) json_member(to, "to", s.to);
  const Matrix3<double> R = s.at.linear();
  const auto q = UnitQuaternion<double>::of(R);
  const double at[] = {
      s.at.matrix()(0, 3), s.at.matrix()(1, 3), s.at.matrix()(2, 3), q.v(0), q.v(1), q.v(2), q.w};
  json_key(to, "at");
  json_array(to, at, 7);
  json_key(to, "size");
  json_array(to, s.size.data(), 3);
  json_member(to, "color", s.color);
  json_member(to, "opacity", s.opacity);
  to += '}';
}
inline void replay_plot(std::string& to, const ReplayPlot& p) {
  json_comma(to);
  to += '{';
  json_member(to, "title", p.title);
  json_member(to, "unit", p.unit);
  if (p.least < p.most) {
    const double range[] = {p.least, p.most};
    json_key(to, "range");
    json_array(to, range, 2);
  }
  if (p.logarithmic) json_member(to, "log", 1);
  json_key(to, "channels");
  to += '[';
  for (const auto& c : p.channels) {
    json_comma(to);
    json_string(to, c);
  }
  to += "]}";
}
inline std::vector<ReplayPlot> default_plots() {
  return {{"Activations", {"activation/"}, "", -0.02, 1.02},
          {"Rates that tasks ask for and do not get", {"error/"}},
          {"Velocities", {"velocity/"}, "rad/s, m/s"}};
}

inline void replay_run(std::string& to, const ReplayRun& run, double period, bool values) {
  const Log& log = *run.log;
  json_comma(to);
  to += '{';
  json_member(to, "name", run.name);
  json_member(to, "title", run.title);
  json_key(to, "channels");
  to += '[';
  for (std::size_t c = 0; c < log.channel_count(); ++c) {
    json_comma(to);
    to += '{';
    json_member(to, "name", log.name(c));
    json_member(to, "unit", log.unit(c));
    json_member(to, "kind", log_kind(log.kind(c)));
    to += '}';
  }
  to += ']';
  json_key(to, "shapes");
  to += '[';
  for (const auto& s : run.shapes) replay_shape(to, s);
  to += ']';
  json_key(to, "plots");
  to += '[';
  for (const auto& p : run.plots.empty() ? default_plots() : run.plots) replay_plot(to, p);
  to += ']';

  std::vector<std::size_t> samples;  // that the page gets; the last one always
  for (std::size_t i = 0; values && i < log.size(); ++i) {
    // Half a nanosecond for the rounding of times.
    const bool due = samples.empty() || log.time(i) >= log.time(samples.back()) + period - 0.5e-9;
    if (due || i + 1 == log.size()) samples.push_back(i);
  }
  std::vector<double> column;
  for (const std::size_t i : samples) column.push_back(log.time(i));
  json_key(to, "times");
  json_array(to, column.data(), column.size());
  json_key(to, "texts");
  to += '[';
  for (std::size_t i = 0; values && i < log.text_count(); ++i) {
    const Log::Text t = log.text(i);
    json_comma(to);
    to += '[';
    json_number(to, t.time);
    to += ',';
    json_string(to, log_topic(t.topic));
    to += ',';
    json_string(to, t.text);
    to += ']';
  }
  to += ']';
  if (values) {
    json_key(to, "columns");
    to += '[';
    for (std::size_t c = 0; c < log.channel_count(); ++c) {
      for (std::size_t k = 0; k < Log::width(log.kind(c)); ++k) {
        column.clear();
        for (const std::size_t i : samples) column.push_back(log.values(c, i)[k]);
        json_comma(to);
        replay_column(to, column, log.kind(c));
      }
    }
    to += ']';
  }
  to += '}';
}

inline bool read_file(const std::string& path, std::string& text) {
  std::ifstream from(path, std::ios::binary);
  text.assign(std::istreambuf_iterator<char>(from), {});
  return from.good() || (from.eof() && !text.empty());
}
inline void replace_mark(std::string& page, std::string_view mark, const std::string& by) {
  const std::size_t at = page.find(mark);
  if (at != page.npos) page.replace(at, mark.size(), by);
}

/// The page with `data`; empty where a file of it cannot be read.
inline std::string replay_page(const ReplayFiles& files, const std::string& data) {
  std::string page, style, three, script, part;
  if (!read_file(files.folder + "/page.html", page)) return {};
  if (!read_file(files.folder + "/style.css", style)) return {};
  for (const char* name : {"/data.js", "/view.js", "/plots.js", "/main.js"}) {
    if (!read_file(files.folder + name, part)) return {};
    script += part;
  }
  if (files.three.empty() || !read_file(files.three, three)) three.clear();
  // Data last: no mark that stands in them is replaced.
  replace_mark(page, "/*{style}*/", style);
  replace_mark(page, "/*{script}*/", script);
  replace_mark(page, "/*{three}*/", three);
  replace_mark(page, "/*{data}*/", data);
  return page;
}

inline std::string replay_data(const std::vector<ReplayRun>& runs, const ReplayOptions& options,
                               bool live) {
  std::string data = "{";
  json_member(data, "title", options.title);
  json_key(data, "zDown");
  data += options.z_down ? "true" : "false";
  json_key(data, "live");
  data += live ? "true" : "false";
  json_member(data, "azimuth", options.azimuth);
  json_member(data, "elevation", options.elevation);
  json_key(data, "shown");
  data += '[';
  for (const auto& name : options.shown) {
    json_comma(data);
    json_string(data, name);
  }
  data += ']';
  json_key(data, "runs");
  data += '[';
  for (const auto& run : runs) replay_run(data, run, options.period, !live);
  return data + "]}";
}

}  // namespace detail

/// The page of `runs` to the file `path`, which is replaced. False where a file cannot be read or
/// written. Allocates: after the loop.
[[nodiscard]] inline bool write_replay(const std::string& path, const ReplayFiles& files,
                                       const std::vector<ReplayRun>& runs,
                                       const ReplayOptions& options = {}) {
  const std::string page = detail::replay_page(files, detail::replay_data(runs, options, false));
  if (page.empty()) return false;
  std::ofstream to(path, std::ios::binary);
  to << page;
  return static_cast<bool>(to.flush());
}

}  // namespace icat
