// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Lines of text that instruments send, taken apart strictly: fields between commas, decimal
/// numbers of digits and one point. No locale, no allocation, no exception. Private to nmea.hpp and
/// pd6.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace icat::detail::text {

constexpr bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }
constexpr bool is_upper(char c) noexcept { return c >= 'A' && c <= 'Z'; }

/// What stands between commas.
struct Fields {
  static constexpr std::size_t most = 24;
  std::array<std::string_view, most> field{};
  std::size_t count{0};  ///< 0 where there are more than `most`

  explicit Fields(std::string_view line) noexcept {
    for (;;) {
      if (count == most) {
        count = 0;
        return;
      }
      const std::size_t comma = line.find(',');
      field[count++] = line.substr(0, comma);
      if (comma == std::string_view::npos) return;
      line.remove_prefix(comma + 1);
    }
  }
  std::string_view operator[](std::size_t i) const noexcept { return field[i]; }
};

/// "12.30" with 1 … 15 digits, one of them before the point. `decimals`: how many after it, −1 for
/// any, of which there may be none.
constexpr bool parse_unsigned(std::string_view s, double& value, int decimals = -1) noexcept {
  constexpr double power[] = {1,   1e1, 1e2,  1e3,  1e4,  1e5,  1e6, 1e7,
                              1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14};
  if (s.empty() || !is_digit(s.front())) return false;
  long long digits = 0;  // below 1e15, so that its double is exact
  int count = 0, after = 0;
  bool point = false;
  for (const char c : s) {
    if (c == '.' && !point) {
      point = true;
    } else if (is_digit(c) && ++count <= 15) {
      digits = digits * 10 + (c - '0');
      if (point) ++after;
    } else {
      return false;
    }
  }
  if (decimals >= 0 && (after != decimals || point != (decimals > 0))) return false;
  value = static_cast<double>(digits) / power[after];
  return true;
}

/// The same with a sign, which must stand there where `sign_required`.
constexpr bool parse_signed(std::string_view s, double& value, int decimals = -1,
                            bool sign_required = false) noexcept {
  const bool sign = !s.empty() && (s.front() == '+' || s.front() == '-');
  if (sign_required && !sign) return false;
  if (!parse_unsigned(s.substr(sign ? 1 : 0), value, decimals)) return false;
  if (sign && s.front() == '-') value = -value;
  return true;
}

/// `count` digits from `at` on as a whole number; −1 where there is anything else.
constexpr int parse_digits(std::string_view s, std::size_t at, std::size_t count) noexcept {
  if (at + count > s.size()) return -1;
  int value = 0;
  for (std::size_t i = at; i < at + count; ++i) {
    if (!is_digit(s[i])) return -1;
    value = value * 10 + (s[i] - '0');
  }
  return value;
}

/// Days from 1970-01-01 to a date of the Gregorian calendar.
constexpr long days_from_civil(int year, int month, int day) noexcept {
  // Counted from 1 March, so that the day which comes every four years is the last one.
  const int y = month > 2 ? year : year - 1;
  const int m = month > 2 ? month - 3 : month + 9;
  return 365L * y + y / 4 - y / 100 + y / 400 + (153 * m + 2) / 5 + day - 1 - 719468L;
}
/// Whether there is such a date, of the years 1970 … 9999.
constexpr bool is_date(int year, int month, int day) noexcept {
  if (year < 1970 || year > 9999 || month < 1 || month > 12 || day < 1) return false;
  const long next =
      month == 12 ? days_from_civil(year + 1, 1, 1) : days_from_civil(year, month + 1, 1);
  return day <= next - days_from_civil(year, month, 1);
}

}  // namespace icat::detail::text
