// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Refuses compiler flags under which NaN passes every check, or sums are taken in another order:
/// where the compiler tells of them, by not compiling; where it does not, when a solver is
/// constructed.
#pragma once

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error \
    "icat must not be compiled with -ffast-math, -Ofast or -ffinite-math-only: the compiler \
would drop every check for NaN and infinity, and bad input would reach the motors"
#endif
#if defined(__ASSOCIATIVE_MATH__)
#error \
    "icat must not be compiled with -fassociative-math or -funsafe-math-optimizations: \
its bounds on rounding errors depend on the order of the sums"
#endif

#include <cmath>
#include <limits>

#include "icat/core/error.hpp"

namespace icat::detail {

/// Throws `std::invalid_argument` in a program whose flags the macros above do not show: clang
/// tells nothing of -fno-honor-nans and -fassociative-math, GCC nothing before version 12 and
/// nothing of a pragma.
template <class Scalar>
[[gnu::noinline, gnu::cold]] void require_strict_arithmetic() {
  using Limits = std::numeric_limits<Scalar>;
  // Volatile, so that what is computed from them is computed as it is in a control step.
  volatile Scalar not_a_number = Limits::quiet_NaN(), unbounded = Limits::infinity();
  volatile Scalar large = Scalar(1) / (Limits::epsilon() * Limits::epsilon()), small(1);
  const Scalar x = not_a_number, y = unbounded, a = large, b = small;
  if (!(x != x) || std::isfinite(x) || std::isfinite(y) || !(y > Limits::max()) ||
      x * Scalar(0) == Scalar(0) || y * Scalar(0) == Scalar(0)) {
    invalid(
        "icat was compiled with a flag such as -fno-honor-nans: checks for NaN and infinity do ",
        "not work, and bad input would reach the motors");
  }
  // `b` is lost in `a`, unless the compiler takes `a` away first.
  if ((a + b) - a != Scalar(0)) {
    invalid("icat was compiled with a flag such as -fassociative-math: its bounds on rounding ",
            "errors depend on the order of the sums");
  }
}

}  // namespace icat::detail
