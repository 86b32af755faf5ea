// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// The keys of configurations as a JSON schema for editors (draft 7), and as Markdown tables. Both
/// are generated from the parser's table of keys. Needs no library.
#pragma once

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "icat/adapters/yaml_task_keys.hpp"
#include "icat/adapters/yaml_units.hpp"

namespace icat {
namespace detail {

/// Writes JSON; all texts are the library's own.
class SchemaWriter {
 public:
  std::string schema() {
    std::string root = section(top_section);
    std::string text("{\n\"$schema\": \"http://json-schema.org/draft-07/schema#\",\n");
    text.append("\"title\": \"icat configuration\",\n\"definitions\": {\n");
    std::string all;
    for (const auto& [name, definition] : definitions_) {
      all.append(all.empty() ? "" : ",\n").append(quoted(name)).append(": ").append(definition);
    }
    return text.append(all).append("\n},\n").append(root.substr(1)).append("\n");
  }

 private:
  static std::string quoted(std::string_view text) {
    std::string result("\"");
    for (const char c : text) result.append(c == '"' || c == '\\' ? "\\" : "").append(1, c);
    return result.append("\"");
  }
  /// A reference to the definition `name`, which `make` makes the first time.
  template <class Make>
  std::string reference(const std::string& name, Make&& make) {
    if (known_.insert(name).second) definitions_.emplace_back(name, make());
    return "{\"$ref\": \"#/definitions/" + name + "\"}";
  }
  static std::string list_of(const std::string& item, int count = 0) {
    std::string text = "{\"type\": \"array\", \"items\": " + item;
    if (count > 0) {
      const std::string n = std::to_string(count);
      text.append(", \"minItems\": ").append(n).append(", \"maxItems\": ").append(n);
    }
    return text.append("}");
  }
  static std::string by_name(const std::string& item) {
    return "{\"type\": \"object\", \"additionalProperties\": " + item + "}";
  }
  static std::string any_of(const std::string& a, const std::string& b) {
    return "{\"anyOf\": [" + a + ", " + b + "]}";
  }
  static std::string one_of(std::string_view words) {
    std::string list;
    for_each_word(words, [&](std::string_view w) {
      list.append(list.empty() ? "" : ", ").append(quoted(w));
    });
    return "{\"enum\": [" + list + "]}";
  }

  std::string number(Unit unit, Range range) {
    const auto units = units_of(unit);
    std::string name = range == Range::positive       ? "positive"
                       : range == Range::not_negative ? "not_negative"
                                                      : "number";
    std::string names, words;
    for (const UnitName& u : units) {
      name.append("_");
      for (const char* c = u.name; *c != '\0'; ++c) {
        name.append(*c == '/' ? "_per_" : *c == '^' ? "" : std::string(1, *c));
      }
      names.append(names.empty() ? "" : "|");
      for (const char* c = u.name; *c != '\0'; ++c) {
        names.append(*c == '^' ? "\\^" : std::string(1, *c));
      }
      words.append(words.empty() ? "a number in " : ", ").append(u.name);
    }
    return reference(name, [&] {
      const std::string sign = range == Range::any ? "[-+]?" : "[+]?";
      const std::string unit_names = units.empty() ? "" : "( *(" + names + "))?";
      const std::string pattern =
          "^" + sign + "(\\.inf|([0-9]+\\.?[0-9]*|\\.[0-9]+)([eE][-+]?[0-9]+)?)" + unit_names + "$";
      const std::string text = "{\"type\": \"string\", \"pattern\": " + quoted(pattern) + "}";
      const char* least = range == Range::positive       ? ", \"exclusiveMinimum\": 0"
                          : range == Range::not_negative ? ", \"minimum\": 0"
                                                         : "";
      const std::string plain = std::string("{\"type\": \"number\"") + least + "}";
      const std::string either = any_of(plain, text);
      return words.empty() ? either
                           : "{\"description\": " + quoted(words) + ", " + either.substr(1);
    });
  }
  std::string pose(bool placed, bool turn) {
    const std::string one =
        reference(placed ? "placed_pose"
                  : turn ? "orientation"
                         : "pose",
                  [&] {
                    std::string text = object(pose_section, turn ? "position" : "");
                    if (placed) text.insert(text.size() - 1, ", \"required\": [\"position\"]");
                    return text;
                  });
    const std::string item = placed ? pose_part() : one;
    return any_of(one, "{\"type\": \"array\", \"minItems\": 1, \"items\": " + item + "}");
  }
  std::string pose_part() {
    return reference("pose", [&] { return object(pose_section, ""); });
  }
  std::string objective(Unit unit) {
    return reference("objective_" + std::to_string(static_cast<int>(unit)), [&] {
      std::string keys;
      for (std::size_t i = 0; i < objective_section.count; ++i) {
        ConfigKey key = objective_section.keys[i];
        key.unit = unit;
        keys.append(keys.empty() ? "" : ", ").append(property(key));
      }
      return "{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {" + keys +
             "}, \"anyOf\": [{\"required\": [\"equal_to\"]}, {\"required\": [\"at_least\", "
             "\"margin\"]}, {\"required\": [\"at_most\", \"margin\"]}]}";
    });
  }

  std::string value(const ConfigKey& k) {
    // A joint may be called 1.
    const std::string text = "{\"type\": [\"string\", \"number\"], \"minLength\": 1}";
    const std::string here = "{\"const\": \"here\"}";
    const std::string vector = list_of(number(k.unit, k.range), 3);
    switch (k.value) {
      case Value::number:
        return number(k.unit, k.range);
      case Value::integer:
        return "{\"type\": \"integer\", \"minimum\": 0}";
      case Value::boolean:
        return "{\"type\": \"boolean\"}";
      case Value::text:
        return text;
      case Value::choice:
        return one_of(k.choices);
      case Value::vector:
        return vector;
      case Value::goal_point:
        return any_of(vector, here);
      case Value::numbers:
        return list_of(number(k.unit, k.range));
      case Value::per_joint:
        return any_of(number(k.unit, k.range), list_of(number(k.unit, k.range)));
      case Value::joint_values:
        return any_of(list_of(number(k.unit, k.range)), by_name(number(k.unit, k.range)));
      case Value::names:
        return any_of(text, list_of(text));
      case Value::axes:
        return list_of(one_of("x y z"));
      case Value::pose:
        return pose(true, false);
      case Value::goal_pose:
        return any_of(pose(true, false), here);
      case Value::goal_turn:
        return any_of(pose(false, true), here);
      case Value::objective:
        return objective(k.unit);
      case Value::section:
        return section_reference(*k.section);
      case Value::sections:
        return list_of(section_reference(*k.section));
      case Value::some:
        return any_of(section_reference(*k.section), list_of(section_reference(*k.section)));
      case Value::named:
        return by_name(section_reference(*k.section));
      case Value::levels:
        return by_name(list_of(any_of(text, list_of(text))));
      case Value::pairs:
        return list_of(list_of(text, 2));
      case Value::tasks:
        return by_name(tasks());
    }
    return "{}";
  }
  std::string property(const ConfigKey& k) {
    std::string about(k.about);
    if (k.live) about.append(" (may change at run time)");
    // Beside $ref editors look at nothing else, so both stand in a list of one.
    return quoted(k.name) + ": {\"description\": " + quoted(about) + ", \"allOf\": [" + value(k) +
           "]}";
  }
  /// Keys of `s` without the key `but`.
  std::string object(const ConfigSection& s, std::string_view but) {
    std::string keys, required, either;
    for (std::size_t i = 0; i < s.count; ++i) {
      if (but == s.keys[i].name) continue;
      keys.append(keys.empty() ? "" : ",\n  ").append(property(s.keys[i]));
      if (!s.keys[i].required) continue;
      required.append(required.empty() ? "" : ", ").append(quoted(s.keys[i].name));
    }
    for_each_word(s.one_of, [&](std::string_view w) {
      either.append(either.empty() ? "" : ", ").append("{\"required\": [" + quoted(w) + "]}");
    });
    std::string text(
        "{\"type\": \"object\", \"additionalProperties\": false, \"properties\": {\n  ");
    text.append(keys).append("}");
    if (!required.empty()) text.append(", \"required\": [").append(required).append("]");
    if (!either.empty()) text.append(", \"oneOf\": [").append(either).append("]");
    return text.append("}");
  }
  std::string section(const ConfigSection& s) { return object(s, ""); }
  std::string section_reference(const ConfigSection& s) {
    std::string name(s.name);
    for (char& c : name) c = c == ' ' ? '_' : c;
    return reference(name, [&] { return section(s); });
  }
  std::string tasks() {
    std::string types, cases;
    for (const ConfigSection& s : task_sections) {
      types.append(types.empty() ? "" : ", ").append(quoted(s.name));
      cases.append(cases.empty() ? "" : ",\n  ")
          .append("{\"if\": {\"properties\": {\"type\": {\"const\": " + quoted(s.name) +
                  "}}}, \"then\": " + section_reference(s) + "}");
    }
    return reference("task", [&] {
      return "{\"type\": \"object\", \"required\": [\"type\"], \"properties\": {\"type\": "
             "{\"enum\": [" +
             types + "]}}, \"allOf\": [\n  " + cases + "]}";
    });
  }

  std::set<std::string> known_;
  std::vector<std::pair<std::string, std::string>> definitions_;
};

/// What stands behind a key, in a few words.
inline std::string value_in_words(const ConfigKey& k) {
  std::string unit;
  for (const UnitName& u : units_of(k.unit)) {
    if (u.size == 1) unit.append(unit.empty() ? ", " : " or ").append(u.name);
  }
  const std::string range = k.range == Range::positive       ? " > 0"
                            : k.range == Range::not_negative ? " ≥ 0"
                                                             : "";
  std::string words(k.choices);
  for (std::size_t i = 0; (i = words.find(' ', i)) != std::string::npos; i += 2) {
    words.replace(i, 1, ", ");
  }
  switch (k.value) {
    case Value::number:
      return "number" + range + unit;
    case Value::integer:
      return "whole number";
    case Value::boolean:
      return "true or false";
    case Value::text:
      return "word";
    case Value::choice:
      return words;
    case Value::vector:
      return "[x, y, z]" + unit;
    case Value::goal_point:
      return "[x, y, z]" + unit + ", or here";
    case Value::numbers:
      return "list of numbers" + range + unit;
    case Value::per_joint:
      return "number" + range + unit + ", or a list";
    case Value::joint_values:
      return "list of numbers, or numbers by joints" + unit;
    case Value::names:
      return "list of words";
    case Value::axes:
      return "list of x, y, z";
    case Value::pose:
      return "pose";
    case Value::goal_pose:
      return "pose, or here";
    case Value::goal_turn:
      return "pose without position, or here";
    case Value::objective:
      return "objective" + unit;
    case Value::section:
      return k.section->name;
    case Value::sections:
      return std::string("list of ") + k.section->name;
    case Value::some:
      return std::string(k.section->name) + ", or a list";
    case Value::named:
      return std::string(k.section->name) + ", by names";
    case Value::levels:
      return "lists of tasks, by names";
    case Value::pairs:
      return "list of pairs of words";
    case Value::tasks:
      return "tasks, by names";
  }
  return "";
}

/// Rows of `s`, and then those of what stands below that `done` does not have.
inline void append_tables(const ConfigSection& s, std::set<std::string>& done, std::string& text) {
  if (!done.insert(s.name).second) return;
  text.append("\n**").append(s.name).append("**\n\n| key | value | |\n|---|---|---|\n");
  for (std::size_t i = 0; i < s.count; ++i) {
    const ConfigKey& k = s.keys[i];
    text.append("| `").append(k.name).append("`").append(k.required ? " *" : "");
    text.append(k.live ? " ↻" : "").append(" | ").append(value_in_words(k));
    text.append(" | ").append(k.about).append(" |\n");
  }
  for (std::size_t i = 0; i < s.count; ++i) {
    if (s.keys[i].section) append_tables(*s.keys[i].section, done, text);
  }
}

}  // namespace detail

/// The JSON schema (draft 7) of configurations. Allocates.
[[gnu::cold]] inline std::string configuration_schema() { return detail::SchemaWriter().schema(); }

/// All keys as tables of Markdown; *: required, ↻: may change at run time. Allocates.
[[gnu::cold]] inline std::string configuration_tables() {
  std::string text;
  std::set<std::string> done;
  detail::append_tables(detail::top_section, done, text);
  for (const detail::ConfigSection& s : detail::task_sections) {
    detail::append_tables(s, done, text);
  }
  detail::append_tables(detail::pose_section, done, text);
  detail::append_tables(detail::objective_section, done, text);
  return text;
}

}  // namespace icat
