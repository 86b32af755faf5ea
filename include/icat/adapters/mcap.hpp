// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Writes a log as MCAP, which Foxglove opens. Messages are JSON:
///
///     /tf              foxglove.FrameTransforms: all poses, from `world`
///     /<group>         icat.<group>: the numbers and points of a group, by their names
///     /event, /phase, /explanation    foxglove.Log
///
/// A character of a name that is no letter, digit or `_` becomes `_` in topics and fields, so that
/// a path of Foxglove can name them; two names of a group that become the same are told apart by a
/// number at the end, and a group that would have the name of another topic above gets `_` at its
/// end. A number that was not set is left out. ⟨0⟩ of a vehicle is NED: choose "Z
/// down" in Foxglove's 3-D panel.
#pragma once

#include <fstream>
#include <string>
#include <vector>

#include "icat/adapters/json_text.hpp"
#include "icat/adapters/mcap_records.hpp"
#include "icat/control/log.hpp"

namespace icat {

/// Settings of the file.
struct McapOptions {
  double start =
      0;  ///< s since 1970, which time 0 of the log is; what lies before 1970 is put there
};

namespace detail {

/// The schemas of Foxglove that are used, without their descriptions.
inline constexpr std::string_view foxglove_time =
    R"({"type":"object","title":"time","properties":{"sec":{"type":"integer","minimum":0},)"
    R"("nsec":{"type":"integer","minimum":0,"maximum":999999999}}})";
inline std::string foxglove_frame_transforms() {
  std::string s =
      R"({"title":"foxglove.FrameTransforms","type":"object","properties":{"transforms":{)"
      R"("type":"array","items":{"title":"foxglove.FrameTransform","type":"object","properties":{)"
      R"("timestamp":)";
  s += foxglove_time;
  s += R"(,"parent_frame_id":{"type":"string"},"child_frame_id":{"type":"string"},)"
       R"("translation":{"title":"foxglove.Vector3","type":"object","properties":{)"
       R"("x":{"type":"number"},"y":{"type":"number"},"z":{"type":"number"}},)"
       R"("required":["x","y","z"]},)"
       R"("rotation":{"title":"foxglove.Quaternion","type":"object","properties":{)"
       R"("x":{"type":"number"},"y":{"type":"number"},"z":{"type":"number"},)"
       R"("w":{"type":"number"}},"required":["x","y","z","w"]}},)"
       R"("required":["timestamp","parent_frame_id","child_frame_id","translation","rotation"]}}},)"
       R"("required":["transforms"]})";
  return s;
}
inline std::string foxglove_log() {
  std::string s = R"({"title":"foxglove.Log","type":"object","properties":{"timestamp":)";
  s += foxglove_time;
  s += R"(,"level":{"title":"foxglove.LogLevel","oneOf":[)"
       R"({"title":"UNKNOWN","const":0},{"title":"DEBUG","const":1},{"title":"INFO","const":2},)"
       R"({"title":"WARNING","const":3},{"title":"ERROR","const":4},{"title":"FATAL","const":5}]},)"
       R"("message":{"type":"string"},"name":{"type":"string"},"file":{"type":"string"},)"
       R"("line":{"type":"integer","minimum":0}},)"
       R"("required":["timestamp","level","message","name","file","line"]})";
  return s;
}

inline std::string mcap_name(std::string_view name, bool path) {
  std::string s;
  for (const char c : name) {
    const bool good = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                      c == '_' || (path && c == '/');
    s += good ? c : '_';
  }
  return s;
}

inline std::uint64_t mcap_time(double seconds) noexcept {
  // 2^63 ns is the year 2262.
  return seconds > 0 && seconds < 9.2e9 ? static_cast<std::uint64_t>(seconds * 1e9 + 0.5) : 0;
}
inline void mcap_stamp(std::string& to, std::uint64_t time) {
  json_key(to, "timestamp");
  to += "{\"sec\":" + std::to_string(time / 1000000000u) +
        ",\"nsec\":" + std::to_string(time % 1000000000u) + "}";
}

/// The numbers and points of a group: a topic.
struct McapGroup {
  std::string name;
  std::vector<std::size_t> channels;
  std::vector<std::string> fields;
  std::uint16_t id{0};

  void add(std::size_t channel, std::string_view field) {
    std::string name_of = field.empty() ? "_" : mcap_name(field, false);
    for (bool again = true; again;) {
      again = false;
      for (const auto& f : fields) again = again || f == name_of;
      if (again) name_of += "_" + std::to_string(channel);
    }
    channels.push_back(channel);
    fields.push_back(std::move(name_of));
  }
  std::string schema(const Log& log) const {
    std::string s = "{\"title\":";
    json_string(s, "icat." + name);
    s += ",\"type\":\"object\",\"properties\":{";
    for (std::size_t i = 0; i < channels.size(); ++i) {
      json_key(s, fields[i]);
      s += log.kind(channels[i]) == LogKind::number
               ? R"({"type":"number")"
               : R"({"type":"object","properties":{"x":{"type":"number"},"y":{"type":"number"},)"
                 R"("z":{"type":"number"}})";
      std::string words = log.name(channels[i]);
      if (!log.unit(channels[i]).empty()) words += ", " + log.unit(channels[i]);
      json_member(s, "description", words);
      s += '}';
    }
    return s + "}}";
  }
  std::string message(const Log& log, std::size_t sample) const {
    std::string s = "{";
    for (std::size_t i = 0; i < channels.size(); ++i) {
      const double* v = log.values(channels[i], sample);
      if (log.kind(channels[i]) == LogKind::number) {
        if (std::isfinite(v[0])) json_member(s, fields[i], v[0]);
      } else if (std::isfinite(v[0] + v[1] + v[2])) {
        json_key(s, fields[i]);
        s += '{';
        json_member(s, "x", v[0]), json_member(s, "y", v[1]), json_member(s, "z", v[2]);
        s += '}';
      }
    }
    return s + "}";
  }
};

inline std::vector<McapGroup> mcap_groups(const Log& log) {
  std::vector<McapGroup> groups;
  for (std::size_t c = 0; c < log.channel_count(); ++c) {
    if (log.kind(c) == LogKind::pose) continue;
    const std::string_view name = log.name(c);
    const std::size_t slash = name.rfind('/');
    const std::string_view field = slash == name.npos ? name : name.substr(slash + 1);
    std::string group =
        mcap_name(slash == name.npos ? std::string_view("log") : name.substr(0, slash), true);
    for (const char* other : {"tf", "event", "phase", "explanation", ""}) {
      if (group == other) {
        group += '_';
        break;
      }
    }
    std::size_t g = 0;
    while (g < groups.size() && groups[g].name != group) ++g;
    if (g == groups.size()) {
      groups.emplace_back();
      groups[g].name = group;
    }
    groups[g].add(c, field);
  }
  return groups;
}

inline std::string mcap_transforms(const Log& log, std::size_t sample, std::uint64_t time) {
  std::string s = "{\"transforms\":[";
  for (std::size_t c = 0; c < log.channel_count(); ++c) {
    if (log.kind(c) != LogKind::pose) continue;
    const double* v = log.values(c, sample);
    if (!std::isfinite(v[0] + v[1] + v[2] + v[3] + v[4] + v[5] + v[6])) continue;
    json_comma(s);
    s += '{';
    mcap_stamp(s, time);
    json_member(s, "parent_frame_id", "world");
    json_member(s, "child_frame_id", log.name(c));
    json_key(s, "translation");
    s += '{';
    json_member(s, "x", v[0]), json_member(s, "y", v[1]), json_member(s, "z", v[2]);
    s += '}';
    json_key(s, "rotation");
    s += '{';
    json_member(s, "x", v[3]), json_member(s, "y", v[4]), json_member(s, "z", v[5]);
    json_member(s, "w", v[6]);
    s += "}}";
  }
  return s + "]}";
}

}  // namespace detail

/// The whole log, to a stream that the caller opened in binary mode. False where the stream fails.
[[nodiscard]] inline bool write_mcap(const Log& log, std::ostream& to,
                                     const McapOptions& options = {}) {
  detail::McapWriter writer(to);
  const std::uint16_t tf = writer.add_channel(
      writer.add_schema("foxglove.FrameTransforms", detail::foxglove_frame_transforms()), "/tf");
  const std::uint16_t log_schema = writer.add_schema("foxglove.Log", detail::foxglove_log());
  const char* const topics[] = {"/event", "/phase", "/explanation"};
  std::uint16_t text_channels[3];
  for (std::size_t i = 0; i < 3; ++i) {
    text_channels[i] = writer.add_channel(log_schema, topics[i]);
  }
  std::vector<detail::McapGroup> groups = detail::mcap_groups(log);
  bool poses = false;
  for (std::size_t c = 0; c < log.channel_count(); ++c) {
    poses = poses || log.kind(c) == LogKind::pose;
  }
  for (auto& g : groups) {
    g.id = writer.add_channel(writer.add_schema("icat." + g.name, g.schema(log)), "/" + g.name);
  }
  std::size_t text = 0;
  const auto write_texts = [&](double until) {
    for (; text < log.text_count() && log.text(text).time <= until; ++text) {
      const Log::Text words = log.text(text);
      const std::uint64_t time = detail::mcap_time(options.start + words.time);
      const auto topic = static_cast<std::size_t>(words.topic);
      std::string s = "{";
      detail::mcap_stamp(s, time);
      detail::json_member(s, "level", 2);
      detail::json_member(s, "message", words.text);
      detail::json_member(s, "name", topics[topic] + 1);
      s += ",\"file\":\"\",\"line\":0}";
      writer.message(text_channels[topic], time, s);
    }
  };
  for (std::size_t i = 0; i < log.size(); ++i) {
    write_texts(log.time(i));
    const std::uint64_t time = detail::mcap_time(options.start + log.time(i));
    if (poses) writer.message(tf, time, detail::mcap_transforms(log, i, time));
    for (const auto& g : groups) writer.message(g.id, time, g.message(log, i));
  }
  write_texts(infinity<double>);
  return writer.finish();
}
/// The same to the file `path`, which is replaced.
[[nodiscard]] inline bool write_mcap(const Log& log, const std::string& path,
                                     const McapOptions& options = {}) {
  std::ofstream to(path, std::ios::binary);
  return to && write_mcap(log, to, options);
}

}  // namespace icat
