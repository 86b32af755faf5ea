// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Errors of construction and configuration: `std::invalid_argument` with names and numbers. Where
/// a program is compiled without exceptions (`-fno-exceptions`), the same text goes to the handler
/// of `set_error_handler`, and the program ends. Compile the whole program one way: the linker
/// keeps one version of each function of a header.
///
/// Control steps do neither: they answer with a `Status`.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <string>
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
  std::string text;
  for (std::size_t i = 0; i < count; ++i) {
    char number[32] = "";
    if (parts[i].kind != MessagePart::Kind::text) {
      const bool integer = parts[i].kind == MessagePart::Kind::integer;
      std::snprintf(number, sizeof number, integer ? "%.0f" : "%g", parts[i].number);
    }
    text.append(parts[i].text).append(number);
  }
#if defined(__cpp_exceptions)
  throw std::invalid_argument(text);
#else
  if (error_handler) error_handler(text.c_str());
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
