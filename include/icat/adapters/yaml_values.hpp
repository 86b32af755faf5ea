// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Values of a configuration by the table of its keys: numbers with units, poses, objectives.
#pragma once

#include <cstdint>
#include <optional>

#include "icat/adapters/yaml_node.hpp"
#include "icat/adapters/yaml_units.hpp"
#include "icat/math/rigid_motion.hpp"
#include "icat/task/axes.hpp"
#include "icat/task/joint_tasks.hpp"
#include "icat/task/objective.hpp"

namespace icat::detail {

/// The values of a section, by its table. Each accessor throws `std::invalid_argument` with file,
/// line and column on what the table does not allow.
class Section {
 public:
  using Vector3d = Vector3<double>;
  using Posed = Pose<double>;

  /// `where`: how errors call it. Unknown keys and those that are missing are found here.
  [[gnu::cold]] Section(const ConfigFile& file, const ConfigNode& node, const ConfigSection& table,
                        std::string where)
      : file_(&file), node_(&node), table_(&table), where_(std::move(where)) {
    if (!node.is(ConfigNode::Kind::map)) fail(node, "must have keys; ", listed(key_names()));
    for (std::size_t i = 0; i < node.names.size(); ++i) {
      const auto& name = node.names[i];
      if (key(name.name)) continue;
      wrong(file, name.line, name.column, where_, where_.empty() ? "" : ": ", "unknown key '",
            name.name, "'", there_are(name.name, key_names()));
    }
    for (std::size_t i = 0; i < table.count; ++i) {
      if (table.keys[i].required && !node.find(table.keys[i].name)) {
        fail(node, "'", table.keys[i].name, "' is missing");
      }
    }
    check_one_of();
  }

  const ConfigFile& file() const noexcept { return *file_; }
  const ConfigNode& node() const noexcept { return *node_; }
  const ConfigSection& table() const noexcept { return *table_; }
  /// The same, otherwise called in errors.
  Section called(std::string where) const {
    Section other = *this;
    other.where_ = std::move(where);
    return other;
  }
  bool has(const char* name) const { return find(name) != nullptr; }
  /// The value of a key that is there.
  const ConfigNode& at(const char* name) const {
    const ConfigNode* value = find(name);
    return value ? *value : *node_;
  }

  /// Throws with the place of `at`.
  template <class... Parts>
  [[noreturn]] [[gnu::cold]] void fail(const ConfigNode& at, const Parts&... parts) const {
    wrong(*file_, at, where_, where_.empty() ? "" : ": ", parts...);
  }
  /// Which of `names` the word at `at` is; `what` they are.
  [[gnu::cold]] std::size_t look_up(const ConfigNode& at, const char* what,
                                    const std::vector<std::string>& names) const {
    const std::string name = word(at, what);
    const auto found = std::find(names.begin(), names.end(), name);
    if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
    fail(at, "no ", what, " '", name, "'", there_are(name, names));
  }
  /// The text of a scalar.
  const std::string& word(const ConfigNode& at, const char* what) const {
    if (!at.is(ConfigNode::Kind::scalar) || at.text.empty()) {
      fail(at, "'", what, "' must be a word");
    }
    return at.text;
  }

  double number(const char* name, double fallback, std::optional<Unit> unit = {}) const {
    const ConfigKey& k = known(name, Value::number);
    const ConfigNode* value = find(name);
    return value ? number_at(*value, name, unit.value_or(k.unit), k.range) : fallback;
  }
  int integer(const char* name, int fallback) const {
    (void)known(name, Value::integer);
    const ConfigNode* value = find(name);
    if (!value) return fallback;
    const double x = number_at(*value, name, Unit::none, Range::not_negative);
    if (!(x <= 1e9) || x != std::floor(x)) {
      fail(*value, "'", name, "' must be a whole number, got '", value->text, "'");
    }
    return static_cast<int>(x);
  }
  bool boolean(const char* name, bool fallback) const {
    (void)known(name, Value::boolean);
    const ConfigNode* value = find(name);
    if (!value) return fallback;
    const bool yes = value->text == "true";
    if (!value->is(ConfigNode::Kind::scalar) || value->quoted || (!yes && value->text != "false")) {
      fail(*value, "'", name, "' must be true or false");
    }
    return yes;
  }
  std::string text(const char* name) const {
    (void)known(name, Value::text);
    const ConfigNode* value = find(name);
    return value ? word(*value, name) : std::string();
  }
  std::string choice(const char* name, const char* fallback) const {
    const ConfigKey& k = known(name, Value::choice);
    const ConfigNode* value = find(name);
    if (!value) return fallback;
    std::vector<std::string> words;
    for_each_word(k.choices, [&](std::string_view w) { words.emplace_back(w); });
    return words[look_up(*value, name, words)];
  }
  std::optional<Vector3d> vector(const char* name) const {
    const ConfigKey& k = known(name, Value::vector, Value::goal_point);
    const ConfigNode* value = find(name);
    if (!value) return std::nullopt;
    const auto x = numbers_at(*value, name, k.unit, k.range);
    if (x.size() != 3) fail(*value, "'", name, "' must be three numbers, got ", x.size());
    return Vector3d(x[0], x[1], x[2]);
  }
  std::vector<double> numbers(const char* name) const {
    const ConfigKey& k = known(name, Value::numbers);
    const ConfigNode* value = find(name);
    return value ? numbers_at(*value, name, k.unit, k.range) : std::vector<double>();
  }
  PerJoint<double> per_joint(const char* name, double fallback) const {
    const ConfigKey& k = known(name, Value::per_joint);
    const ConfigNode* value = find(name);
    if (!value) return fallback;
    if (value->is(ConfigNode::Kind::list)) return numbers_at(*value, name, k.unit, k.range);
    return number_at(*value, name, k.unit, k.range);
  }
  std::vector<std::string> names(const char* name) const {
    (void)known(name, Value::names);
    const ConfigNode* value = find(name);
    if (!value) return {};
    std::vector<std::string> words;  // one word is a list of one
    if (value->is(ConfigNode::Kind::scalar)) return {word(*value, name)};
    for (const ConfigNode& item : list(*value, name)) words.push_back(word(item, name));
    return words;
  }
  Axes axes(const char* name) const {
    (void)known(name, Value::axes);
    const ConfigNode* value = find(name);
    if (!value) return {};
    bool counts[3] = {false, false, false};
    for (const ConfigNode& item : list(*value, name)) {
      const std::size_t i = look_up(item, "axis", {"x", "y", "z"});
      if (counts[i]) fail(item, "axis '", item.text, "' stands twice");
      counts[i] = true;
    }
    return {counts[0], counts[1], counts[2]};
  }
  /// Whether the goal is where the frame is at the start.
  bool here(const char* name) const {
    const ConfigNode* value = find(name);
    return value && value->is(ConfigNode::Kind::scalar) && value->text == "here";
  }
  std::optional<Posed> pose(const char* name) const {
    const ConfigKey& k = known(name, Value::pose, Value::goal_pose, Value::goal_turn);
    const ConfigNode* value = find(name);
    if (!value) return std::nullopt;
    const bool turn = k.value == Value::goal_turn;
    if (!value->is(ConfigNode::Kind::list)) return pose_at(*value, name, !turn, turn);
    if (value->items.empty()) fail(*value, "'", name, "' is an empty list of poses");
    Posed all = identity_pose<double>();
    for (std::size_t i = 0; i < value->items.size(); ++i) {
      all = compose(all, pose_at(value->items[i], name, false, turn));
    }
    return all;
  }
  std::optional<Objective<double>> objective(const char* name) const;

  /// The section behind `name`, if there is one.
  std::optional<Section> section(const char* name) const {
    const ConfigKey& k = known(name, Value::section);
    const ConfigNode* value = find(name);
    if (!value) return std::nullopt;
    return Section(*file_, *value, *k.section, below(name));
  }
  /// The sections behind `name`.
  std::vector<Section> sections(const char* name) const {
    const ConfigKey& k = known(name, Value::sections, Value::some);
    const ConfigNode* value = find(name);
    std::vector<Section> all;
    if (!value) return all;
    if (k.value == Value::some && value->is(ConfigNode::Kind::map)) {
      all.emplace_back(*file_, *value, *k.section, below(name));
      return all;
    }
    for (const ConfigNode& item : list(*value, name)) {
      // What has a name is called by it.
      const ConfigNode* called = item.find("name");
      all.emplace_back(*file_, item, *k.section,
                       called && !called->text.empty()
                           ? std::string(k.section->name) + " '" + called->text + "'"
                           : below(k.section->name));
    }
    return all;
  }
  /// The sections behind `name`, each with its own name.
  std::vector<std::pair<std::string, Section>> named(const char* name) const {
    const ConfigKey& k = known(name, Value::named);
    const ConfigNode* value = find(name);
    std::vector<std::pair<std::string, Section>> all;
    if (!value) return all;
    map(*value, name);
    for (std::size_t i = 0; i < value->items.size(); ++i) {
      const std::string& own = value->names[i].name;
      all.emplace_back(own, Section(*file_, value->items[i], *k.section,
                                    std::string(k.section->name) + " '" + own + "'"));
    }
    return all;
  }

  /// A number of this unit and range.
  double number_at(const ConfigNode& at, std::string_view name, Unit unit, Range range) const;
  const std::vector<ConfigNode>& list(const ConfigNode& at, const char* name) const {
    if (!at.is(ConfigNode::Kind::list)) fail(at, "'", name, "' must be a list: [ … ]");
    return at.items;
  }
  void map(const ConfigNode& at, const char* name) const {
    if (!at.is(ConfigNode::Kind::map)) fail(at, "'", name, "' must have names and values");
  }
  /// What the table says of `name`. Asking for what the table does not have, or has otherwise, is
  /// an error of the parser's, and so is never asking for what it has: see `finish`.
  template <class... Values>
  const ConfigKey& known(const char* name, Values... values) const {
    const ConfigKey* k = key(name);
    if (!k || !((k->value == values) || ...)) {
      invalid("the table of '", table_->name, "' has no key '", name, "' of this kind");
    }
    asked_ |= std::uint64_t{1} << (k - table_->keys);
    return *k;
  }
  /// Ends the reading of a section: all keys of its table were asked for.
  void finish() const {
    for (std::size_t i = 0; i < table_->count; ++i) {
      if ((asked_ >> i) & 1) continue;
      invalid("the table of '", table_->name, "' has a key '", table_->keys[i].name,
              "' that nobody reads");
    }
  }

 private:
  const ConfigKey* key(std::string_view name) const noexcept {
    for (std::size_t i = 0; i < table_->count; ++i) {
      if (name == table_->keys[i].name) return table_->keys + i;
    }
    return nullptr;
  }
  std::vector<std::string> key_names() const {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < table_->count; ++i) names.emplace_back(table_->keys[i].name);
    return names;
  }
  const ConfigNode* find(std::string_view name) const { return node_->find(name); }
  std::string below(const char* name) const {
    return where_.empty() ? std::string(name) : where_ + ": " + name;
  }
  void check_one_of() const {
    const ConfigNode* found = nullptr;
    std::string words, first;
    for_each_word(table_->one_of, [&](std::string_view w) {
      append_name(words, w);
      const ConfigNode* value = find(w);
      if (value && found) fail(*value, "'", w, "' and '", first, "' exclude each other");
      if (!value) return;
      found = value;
      first = w;
    });
    if (!words.empty() && !found) fail(*node_, "one of ", words, " is missing");
  }
  std::vector<double> numbers_at(const ConfigNode& at, const char* name, Unit unit,
                                 Range range) const {
    std::vector<double> all;
    for (const ConfigNode& item : list(at, name)) {
      all.push_back(number_at(item, name, unit, range));
    }
    return all;
  }
  Posed pose_at(const ConfigNode& at, const char* name, bool placed, bool turn) const;

  const ConfigFile* file_;
  const ConfigNode* node_;
  const ConfigSection* table_;
  std::string where_;
  mutable std::uint64_t asked_{0};
};

[[gnu::cold]] inline double Section::number_at(const ConfigNode& at, std::string_view name,
                                               Unit unit, Range range) const {
  const auto units = units_of(unit);
  std::string_view rest = at.text;
  double value = 0;
  if (!at.is(ConfigNode::Kind::scalar) || !take_number(rest, value)) {
    const bool word = at.is(ConfigNode::Kind::scalar);
    fail(at, "'", name, "' must be a number", units.empty() ? "" : ", in ",
         units.empty() ? "" : units[0].name, word ? ", got '" : "", word ? at.text : "",
         word ? "'" : "");
  }
  while (rest.starts_with(' ')) rest.remove_prefix(1);
  if (!rest.empty()) {
    std::string names;
    const UnitName* meant = nullptr;
    for (const UnitName& u : units) {
      append_name(names, u.name);
      if (rest == u.name) meant = &u;
    }
    if (!meant) {
      fail(at, "'", rest, "' is no unit of '", name, "'; there ",
           units.empty() ? "is none" : "are ", names);
    }
    value *= meant->size;
  }
  if (range == Range::positive && !(value > 0)) {
    fail(at, "'", name, "' must be > 0, got ", at.text);
  }
  if (range == Range::not_negative && !(value >= 0)) {
    fail(at, "'", name, "' must be >= 0, got ", at.text);
  }
  return value;
}

[[gnu::cold]] inline Pose<double> Section::pose_at(const ConfigNode& at, const char* name,
                                                   bool placed, bool turn) const {
  const Section s(*file_, at, pose_section, below(name));
  const auto position = s.vector("position"), rpy = s.vector("rpy");
  const auto about = s.section("axis_angle"), quaternion = s.section("quaternion");
  s.finish();
  if (placed && !position) s.fail(at, "'position' is missing");
  if (turn && position) s.fail(s.at("position"), "an orientation has no 'position'");
  if (int(rpy.has_value()) + int(about.has_value()) + int(quaternion.has_value()) > 1) {
    s.fail(at, "'rpy', 'axis_angle' and 'quaternion' exclude each other");
  }
  Matrix3<double> R = identity<Matrix3<double>>(3);
  if (rpy) {
    R = times(turned(Vector3d(0, 0, 1), (*rpy)(2)),
              times(turned(Vector3d(0, 1, 0), (*rpy)(1)), turned(Vector3d(1, 0, 0), (*rpy)(0))));
  } else if (about) {
    const Vector3d axis = *about->vector("axis");
    const double length = norm(axis);
    if (!(std::abs(length - 1) < 1e-4)) {
      about->fail(about->at("axis"), "'axis' must have length 1, got ", length);
    }
    R = turned(scaled(axis, 1 / length), about->number("angle", 0));
    about->finish();
  } else if (quaternion) {
    UnitQuaternion<double> q{
        quaternion->number("w", 0),
        {quaternion->number("x", 0), quaternion->number("y", 0), quaternion->number("z", 0)}};
    quaternion->finish();
    const double length = std::sqrt(q.w * q.w + dot(q.v, q.v));
    if (!(std::abs(length - 1) < 1e-4)) {
      quaternion->fail(quaternion->node(), "must have length 1, got ", length);
    }
    q.w /= length;
    q.v = scaled(q.v, 1 / length);
    R = q.matrix();
  }
  const Posed result = make_pose(R, position.value_or(Vector3d(0, 0, 0)));
  if (!is_rigid(result)) s.fail(at, "is not finite");
  return result;
}

[[gnu::cold]] inline std::optional<Objective<double>> Section::objective(const char* name) const {
  const ConfigKey& k = known(name, Value::objective);
  const ConfigNode* value = find(name);
  if (!value) return std::nullopt;
  const Section s(*file_, *value, objective_section, below(name));
  const bool equal = s.has("equal_to"), least = s.has("at_least"), most = s.has("at_most");
  const double exactly = s.number("equal_to", 0, k.unit),
               lower = s.number("at_least", -infinity<double>, k.unit),
               upper = s.number("at_most", infinity<double>, k.unit),
               margin = s.number("margin", 0, k.unit), toward = s.number("toward", 0, k.unit);
  s.finish();
  if (equal ? least || most || s.has("margin") || s.has("toward") : !least && !most) {
    s.fail(*value, "needs 'equal_to' alone, or 'at_least' or 'at_most' or both");
  }
  if (!equal && !s.has("margin")) s.fail(*value, "'margin' is missing");
  try {
    if (equal) return Objective<double>::equal_to(exactly);
    const auto inside = least && most ? Objective<double>::between(lower, upper, margin)
                        : least       ? Objective<double>::at_least(lower, margin)
                                      : Objective<double>::at_most(upper, margin);
    return s.has("toward") ? inside.toward(toward) : inside;
  } catch (const std::invalid_argument& error) {
    s.fail(*value, error.what());
  }
}

}  // namespace icat::detail
