// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Errors of construction and configuration: `std::invalid_argument` with names and numbers. Where
/// a program is compiled without exceptions (`-fno-exceptions`), the same text goes to the handler
/// of `set_error_handler`, and the program ends. Compile the whole program with the same setting:
/// the linker keeps one version of each function of a header.
///
/// Control steps do neither: they return a `Status`.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <type_traits>

namespace icat {

#if !defined(__cpp_exceptions)
/// Gets the text of an error of construction or configuration. It may log, reset the machine or
/// jump; if it returns, `std::abort` follows.
using ErrorHandler = void (*)(const char* text);

namespace detail {
inline ErrorHandler error_handler = nullptr;
}

/// Exists only in programs without exceptions. Until it is called, and for `nullptr`, an error ends
/// in `std::abort` alone. Call it once, before the first construction.
inline void set_error_handler(ErrorHandler handler) noexcept { detail::error_handler = handler; }
#endif

namespace detail {

/// A piece of a message. Plain data, so that a message costs its caller little.
struct MessagePart {
  enum class Kind { text, integer, real } kind;
  std::string_view text;
  double number;

  template <class Part>
  static MessagePart of(const Part& part) noexcept {
    if constexpr (std::is_convertible_v<const Part&, std::string_view>) {
      return {Kind::text, part, 0};
    } else {
      return {std::is_integral_v<Part> ? Kind::integer : Kind::real, {}, static_cast<double>(part)};
    }
  }
};

[[noreturn]] [[gnu::cold]] inline void invalid_message(const MessagePart* parts,
                                                       std::size_t count) {
  // Without std::string, whose members are compiled anew in each file since C++20.
  constexpr std::size_t digits = 32;
  std::size_t size = 1;
  for (std::size_t i = 0; i < count; ++i) size += parts[i].text.size() + digits;
  char* const text = new char[size];
  char* end = text;
  for (std::size_t i = 0; i < count; ++i) {
    const MessagePart& part = parts[i];
    if (part.kind == MessagePart::Kind::text) {
      for (const char c : part.text) *end++ = c;
    } else {
      const bool integer = part.kind == MessagePart::Kind::integer;
      end += std::snprintf(end, digits, integer ? "%.0f" : "%g", part.number);
    }
  }
  *end = '\0';
#if defined(__cpp_exceptions)
  const std::invalid_argument error(text);
  delete[] text;
  throw error;
#else
  if (error_handler) error_handler(text);
  std::abort();
#endif
}

/// Throws `std::invalid_argument` whose text is all the parts one after the other.
template <class... Parts>
[[noreturn]] [[gnu::cold]] void invalid(const Parts&... parts) {
  const MessagePart all[] = {MessagePart::of(parts)...};
  invalid_message(all, sizeof...(parts));
}

/// Throws unless `value` is finite and above zero. NaN fails.
template <class Scalar>
void require_positive(const char* owner, const char* name, Scalar value) {
  if (!(value > Scalar(0)) || value > std::numeric_limits<Scalar>::max()) {
    invalid(owner, ": ", name, " must be finite and > 0, got ", value);
  }
}

}  // namespace detail
}  // namespace icat
