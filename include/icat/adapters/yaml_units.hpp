// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Numbers of a configuration and their units. A number is in SI units, or says its unit: `0.2`,
/// `0.2 rad`, `11.5 deg`.
#pragma once

#include <charconv>
#include <numbers>
#include <span>
#include <string_view>
#include <utility>

#include "icat/adapters/yaml_keys.hpp"
#include "icat/math/rigid_motion.hpp"

namespace icat::detail {

/// A way to write a unit, in SI units.
struct UnitName {
  const char* name;
  double size;
};
inline constexpr double config_degree = std::numbers::pi / 180;

/// The units that may stand behind a number.
inline std::span<const UnitName> units_of(Unit unit) noexcept {
  static constexpr UnitName
      length[] = {{"m", 1}, {"cm", 0.01}, {"mm", 0.001}},
      angle[] = {{"rad", 1}, {"deg", config_degree}}, time[] = {{"s", 1}, {"ms", 0.001}},
      rate[] = {{"1/s", 1}}, speed[] = {{"m/s", 1}, {"cm/s", 0.01}, {"mm/s", 0.001}},
      turn[] = {{"rad/s", 1}, {"deg/s", config_degree}}, mass[] = {{"kg", 1}},
      joint[] = {{"rad", 1}, {"deg", config_degree}, {"m", 1}, {"cm", 0.01}, {"mm", 0.001}},
      joint_speed[] = {{"rad/s", 1},
                       {"deg/s", config_degree},
                       {"m/s", 1},
                       {"cm/s", 0.01},
                       {"mm/s", 0.001}},
      joint_acceleration[] = {{"rad/s^2", 1}, {"deg/s^2", config_degree}, {"m/s^2", 1}};
  switch (unit) {
    case Unit::none:
      return {};
    case Unit::length:
      return length;
    case Unit::angle:
      return angle;
    case Unit::time:
      return time;
    case Unit::rate:
      return rate;
    case Unit::speed:
      return speed;
    case Unit::turn:
      return turn;
    case Unit::mass:
      return mass;
    case Unit::joint:
      return joint;
    case Unit::joint_speed:
      return joint_speed;
    case Unit::joint_acceleration:
      return joint_acceleration;
  }
  return {};
}

/// Calls `visit` for each word of `words`.
template <class Visit>
void for_each_word(std::string_view words, Visit&& visit) {
  while (!words.empty()) {
    const std::size_t end = std::min(words.find(' '), words.size());
    if (end > 0) visit(words.substr(0, end));
    words.remove_prefix(std::min(end + 1, words.size()));
  }
}

/// Reads the number that `text` begins with, and takes it away; false where there is none.
inline bool take_number(std::string_view& text, double& value) noexcept {
  for (const auto& [word, meant] : {std::pair<std::string_view, double>(".inf", infinity<double>),
                                    {"+.inf", infinity<double>},
                                    {"-.inf", -infinity<double>}}) {
    if (!text.starts_with(word)) continue;
    value = meant;
    text.remove_prefix(word.size());
    return true;
  }
  std::string_view digits = text;
  const bool plus = digits.starts_with('+');
  if (plus) digits.remove_prefix(1);
  const char first = !plus && digits.starts_with('-') && digits.size() > 1 ? digits[1]
                     : digits.empty()                                      ? 'x'
                                                                           : digits[0];
  if (!(first >= '0' && first <= '9') && first != '.') return false;  // no "inf", no "nan"
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc()) return false;
  text = digits.substr(static_cast<std::size_t>(end - digits.data()));
  return true;
}

/// A turn about an axis; by right angles exactly, where rounding leaves sines of 1e-16.
inline Matrix3<double> turned(const Vector3<double>& axis, double angle) noexcept {
  Matrix3<double> R = axis_rotation<double>(axis, angle);
  for (Index i = 0; i < 9; ++i) {
    double& x = R.data()[i];
    if (std::abs(x) < 1e-15) x = 0;
  }
  return R;
}

}  // namespace icat::detail
