// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Errors of construction and configuration: `std::invalid_argument` with names and numbers.
#pragma once

#include <limits>
#include <sstream>
#include <stdexcept>

namespace icat::detail {

/// Throws `std::invalid_argument` whose text is all the parts one after the other.
template <class... Parts>
[[noreturn]] void invalid(const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  throw std::invalid_argument(text.str());
}

/// Throws unless `value` is finite and above zero. NaN fails.
template <class Scalar>
void require_positive(const char* owner, const char* name, Scalar value) {
  if (!(value > Scalar(0)) || value > std::numeric_limits<Scalar>::max()) {
    invalid(owner, ": ", name, " must be finite and > 0, got ", value);
  }
}

}  // namespace icat::detail
