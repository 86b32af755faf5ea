// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Sanitizers slow Eigen down some thirty times; the long sweeps are cut short there. The Release
/// build runs them in full.
#pragma once

#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool sanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
inline constexpr bool sanitized = true;
#else
inline constexpr bool sanitized = false;
#endif
#else
inline constexpr bool sanitized = false;
#endif
