// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The values of a YAML file, each with its line and column: yaml-cpp reads the file once, and no
/// other header of this adapter includes yaml-cpp. A key that stands twice, a second document, and
/// what would grow without end (an alias inside itself) are errors here.
#pragma once

#include <yaml-cpp/eventhandler.h>
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
    take_lines(text);
    try {
      // YAML::LoadAll never returns where the rest is no document, as after `"a", b`.
      std::istringstream stream(text);
      YAML::Parser parser(stream);
      DocumentStart start;
      if (parser.HandleNextDocument(start) && parser.HandleNextDocument(start)) {
        wrong(file_, start.at.line + 1, column(start.at),
              "a second document; a configuration is one");
      }
      file_.root = node(YAML::Load(text), 0);
    } catch (const YAML::Exception& error) {
      if (error.mark.is_null()) wrong(file_, 1, 1, error.msg);
      const int line = error.mark.line + 1;
      wrong(file_, line, column(error.mark), error.msg,
            tab_indents(line) ? "; a tab cannot indent in YAML, blanks can" : "");
    }
    if (!file_.root.is(ConfigNode::Kind::map)) {
      wrong(file_, file_.root, "a configuration begins with keys such as 'robot:'");
    }
  }

 private:
  /// Where a document begins; the rest of it does not count.
  struct DocumentStart : YAML::EventHandler {
    YAML::Mark at;
    void OnDocumentStart(const YAML::Mark& mark) override { at = mark; }
    void OnDocumentEnd() override {}
    void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
    void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
    void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t,
                  const std::string&) override {}
    void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                         YAML::EmitterStyle::value) override {}
    void OnSequenceEnd() override {}
    void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                    YAML::EmitterStyle::value) override {}
    void OnMapEnd() override {}
  };

  static constexpr int deepest = 32;
  static constexpr int most = 100000;

  ConfigNode node(const YAML::Node& from, int depth) {
    ConfigNode to;
    if (!from.Mark().is_null()) {
      to.line = from.Mark().line + 1;
      to.column = column(from.Mark());
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
    const int line = key.Mark().line + 1, at = column(key.Mark());
    if (!key.IsScalar()) wrong(file_, line, at, "a key must be a word");
    for (const ConfigNode::Name& other : to.names) {
      if (other.name != key.Scalar()) continue;
      wrong(file_, line, at, "'", key.Scalar(), "' stands twice, first in line ", other.line);
    }
    to.names.push_back({key.Scalar(), line, at});
    to.items.push_back(node(value, depth + 1));
    // An empty value has no place of its own.
    if (to.items.back().is(ConfigNode::Kind::empty)) {
      to.items.back().line = line;
      to.items.back().column = at;
    }
  }

  // Lines of UTF-8; of UTF-16 and UTF-32, which yaml-cpp knows too, none.
  void take_lines(std::string_view text) {
    if (text.find('\0') != text.npos || text.starts_with("\xfe\xff") ||
        text.starts_with("\xff\xfe")) {
      return;
    }
    if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
    for (std::size_t i = 0, begin = 0; i <= text.size(); ++i) {
      if (i < text.size() && text[i] != '\n') continue;
      lines_.emplace_back(text.substr(begin, i - begin));
      begin = i + 1;
    }
    for (std::size_t k = 0; k < lines_.size(); ++k) {
      const std::string_view line = lines_[k];
      for (std::size_t i = 0, count = 0; i < line.size(); ++count) {
        const std::size_t length = character(line.substr(i));
        if (length == 0) {
          wrong(file_, static_cast<int>(k) + 1, static_cast<int>(count) + 1, "this is no UTF-8");
        }
        i += length;
      }
    }
  }
  // Bytes of the first character; 0: it is none.
  static std::size_t character(std::string_view text) noexcept {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const std::size_t length = byte(0) < 0x80   ? 1
                               : byte(0) < 0xc2 ? 0
                               : byte(0) < 0xe0 ? 2
                               : byte(0) < 0xf0 ? 3
                               : byte(0) < 0xf5 ? 4
                                                : 0;
    if (length > text.size()) return 0;
    for (std::size_t i = 1; i < length; ++i) {
      if ((byte(i) & 0xc0u) != 0x80) return 0;
    }
    return length;
  }
  // yaml-cpp counts bytes, editors characters. In a line that nobody reads in an editor they may
  // differ: counting them for each value would take too long.
  int column(const YAML::Mark& at) const {
    const auto line = static_cast<std::size_t>(at.line);
    int count = at.column;
    if (line >= lines_.size() || count > 4096) return count + 1;
    const std::string_view before = std::string_view(lines_[line]).substr(0, std::size_t(count));
    for (const char c : before) count -= (static_cast<unsigned char>(c) & 0xc0u) == 0x80;
    return count + 1;
  }
  // Line `line` from 1, or the one before, at whose end yaml-cpp may be.
  bool tab_indents(int line) const {
    for (const int k : {line - 1, line - 2}) {
      if (k < 0 || static_cast<std::size_t>(k) >= lines_.size()) continue;
      const std::string& text = lines_[static_cast<std::size_t>(k)];
      const std::size_t first = text.find_first_not_of(" \t");
      if (text.substr(0, first).find('\t') != text.npos && first != text.npos) return true;
    }
    return false;
  }

  ConfigFile& file_;
  std::vector<std::string> lines_;
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
