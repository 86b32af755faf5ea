// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Writes JSON (RFC 8259) piece by piece to a string: what mcap.hpp, replay.hpp and live.hpp share.
/// Reading it is a library's.
#pragma once

#include <charconv>
#include <cmath>
#include <string>
#include <string_view>

namespace icat::detail {

/// Appends a string in quotes. Bytes above 0x7f are copied: give it UTF-8. `<` is escaped, so that
/// the text may stand in a script of HTML.
inline void json_string(std::string& to, std::string_view text) {
  constexpr char hex[] = "0123456789abcdef";
  to += '"';
  for (const char c : text) {
    const auto u = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      to += '\\';
      to += c;
    } else if (u < 0x20 || c == '<' || u == 0x7f) {
      to += "\\u00";
      to += hex[u >> 4];
      to += hex[u & 15];
    } else {
      to += c;
    }
  }
  to += '"';
}

/// Appends the shortest text that reads as `value`; `null` where it is not finite.
inline void json_number(std::string& to, double value) {
  if (!std::isfinite(value)) {
    to += "null";
    return;
  }
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value);
  to.append(text, static_cast<std::size_t>(end.ptr - text));
}

/// Appends `, ` where something stands before it in the object or array.
inline void json_comma(std::string& to) {
  if (!to.empty() && to.back() != '{' && to.back() != '[') to += ',';
}
/// Appends `"name":`, after a comma where one is needed.
inline void json_key(std::string& to, std::string_view name) {
  json_comma(to);
  json_string(to, name);
  to += ':';
}
/// Appends `"name":value`.
inline void json_member(std::string& to, std::string_view name, double value) {
  json_key(to, name);
  json_number(to, value);
}
/// The same for a string.
inline void json_member(std::string& to, std::string_view name, std::string_view value) {
  json_key(to, name);
  json_string(to, value);
}
/// The same for a string that would convert to a number first.
inline void json_member(std::string& to, std::string_view name, const char* value) {
  json_member(to, name, std::string_view(value));
}
/// Appends `[a,b,…]`.
inline void json_array(std::string& to, const double* values, std::size_t count) {
  to += '[';
  for (std::size_t i = 0; i < count; ++i) {
    json_comma(to);
    json_number(to, values[i]);
  }
  to += ']';
}

}  // namespace icat::detail
