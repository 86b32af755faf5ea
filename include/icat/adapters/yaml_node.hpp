// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The values of a YAML file, each with its line and column: yaml-cpp reads the file once, and no
/// other header of this adapter includes yaml-cpp. A key that stands twice, a second document, and
/// what would grow without end (an alias inside itself) are errors here.
#pragma once

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "icat/core/error.hpp"
#include "icat/model/robot.hpp"

namespace icat::detail {

/// A value of a file and where it stands, line and column from 1.
struct ConfigNode {
  enum class Kind { empty, scalar, list, map };
  struct Name {
    std::string name;
    int line, column;
  };

  Kind kind{Kind::empty};
  std::string text;               // of a scalar
  bool quoted{false};             // of a scalar
  std::vector<ConfigNode> items;  // of a list; values of a map
  std::vector<Name> names;        // of a map, one for each item
  int line{1}, column{1};

  bool is(Kind k) const noexcept { return kind == k; }
  /// The value of `name` in a map; null where there is none.
  const ConfigNode* find(std::string_view name) const noexcept {
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (names[i].name == name) return &items[i];
    }
    return nullptr;
  }
};

/// A file.
struct ConfigFile {
  std::string name;    // in errors
  std::string folder;  // of relative paths; with a slash at its end, or empty
  ConfigNode root;
};

/// Throws `std::invalid_argument` that begins with file, line and column.
template <class... Parts>
[[noreturn]] [[gnu::cold]] void wrong(const ConfigFile& file, int line, int column,
                                      const Parts&... parts) {
  invalid(file.name, ":", line, ":", column, ": ", parts...);
}
template <class... Parts>
[[noreturn]] [[gnu::cold]] void wrong(const ConfigFile& file, const ConfigNode& at,
                                      const Parts&... parts) {
  wrong(file, at.line, at.column, parts...);
}

/// How many letters must be put in, taken out, exchanged for another, or for their neighbour, to
/// make `b` of `a`.
inline std::size_t letters_apart(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before[j - 2] + 1);
      }
    }
    before = last;
    last = row;
  }
  return last[b.size()];
}

/// "; did you mean 'gain'? There are 'gain', 'margin'" for `name` that is none of `names`.
[[gnu::cold]] inline std::string there_are(std::string_view name,
                                           const std::vector<std::string>& names) {
  if (names.empty()) return "; there are none";
  const std::string* nearest = nullptr;
  std::size_t fewest = name.size() / 3 + 2;
  for (const std::string& candidate : names) {
    const std::size_t letters = letters_apart(name, candidate);
    if (letters >= fewest || letters >= candidate.size()) continue;
    nearest = &candidate;
    fewest = letters;
  }
  std::string text("; ");
  if (nearest) text.append("did you mean '").append(*nearest).append("'? There are ");
  return text.append(nearest ? "" : "there are ").append(listed(names));
}

/// Takes over what yaml-cpp read.
class ConfigReader {
 public:
  explicit ConfigReader(ConfigFile& file) : file_(file) {}

  void read(const std::string& text) {
    try {
      const std::vector<YAML::Node> documents = YAML::LoadAll(text);
      if (documents.size() > 1) {
        wrong(file_, node(documents[1], 0), "a second document; a configuration is one");
      }
      if (!documents.empty()) file_.root = node(documents[0], 0);
    } catch (const YAML::Exception& error) {
      const bool known = !error.mark.is_null();
      wrong(file_, known ? error.mark.line + 1 : 1, known ? error.mark.column + 1 : 1, error.msg);
    }
    if (!file_.root.is(ConfigNode::Kind::map)) {
      wrong(file_, file_.root, "a configuration begins with keys such as 'robot:'");
    }
  }

 private:
  static constexpr int deepest = 32;
  static constexpr int most = 100000;

  ConfigNode node(const YAML::Node& from, int depth) {
    ConfigNode to;
    if (!from.Mark().is_null()) {
      to.line = from.Mark().line + 1;
      to.column = from.Mark().column + 1;
    }
    if (++count_ > most || depth > deepest) {
      wrong(file_, to, "more than ", most, " values, or deeper than ", deepest,
            ": does an alias stand for itself?");
    }
    if (from.IsScalar()) {
      to.kind = ConfigNode::Kind::scalar;
      to.text = from.Scalar();
      to.quoted = from.Tag() == "!";
    } else if (from.IsSequence()) {
      to.kind = ConfigNode::Kind::list;
      for (const YAML::Node& item : from) to.items.push_back(node(item, depth + 1));
    } else if (from.IsMap()) {
      to.kind = ConfigNode::Kind::map;
      for (const auto& item : from) add(item.first, item.second, depth, to);
    }
    return to;
  }
  void add(const YAML::Node& key, const YAML::Node& value, int depth, ConfigNode& to) {
    const int line = key.Mark().line + 1, column = key.Mark().column + 1;
    if (!key.IsScalar()) wrong(file_, line, column, "a key must be a word");
    for (const ConfigNode::Name& other : to.names) {
      if (other.name != key.Scalar()) continue;
      wrong(file_, line, column, "'", key.Scalar(), "' stands twice, first in line ", other.line);
    }
    to.names.push_back({key.Scalar(), line, column});
    to.items.push_back(node(value, depth + 1));
    // An empty value has no place of its own.
    if (to.items.back().is(ConfigNode::Kind::empty)) {
      to.items.back().line = line;
      to.items.back().column = column;
    }
  }

  ConfigFile& file_;
  int count_{0};
};

/// @throws std::invalid_argument on what is no YAML, with file, line and column.
[[gnu::cold]] inline ConfigFile config_text(const std::string& text, const std::string& name) {
  ConfigFile file{name, "", {}};
  const std::size_t slash = name.rfind('/');
  if (slash != std::string::npos) file.folder = name.substr(0, slash + 1);
  ConfigReader(file).read(text);
  return file;
}
/// @throws std::invalid_argument where the file cannot be read, and as `config_text`.
[[gnu::cold]] inline ConfigFile config_file(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  if (!stream || !(text << stream.rdbuf())) {
    invalid(path, ": there is no such file, it is empty or unreadable");
  }
  return config_text(text.str(), path);
}

}  // namespace icat::detail
