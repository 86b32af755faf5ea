// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Version of icat: the one place it is written; CMake reads it from here.
#pragma once

/// Grows when code that uses icat must change.
#define ICAT_VERSION_MAJOR 0
/// Grows with features; below 1.0 also when code that uses icat must change.
#define ICAT_VERSION_MINOR 1
/// Grows with repairs.
#define ICAT_VERSION_PATCH 0

/// @cond
#define ICAT_VERSION_JOIN_(major, minor, patch) #major "." #minor "." #patch
#define ICAT_VERSION_JOIN(major, minor, patch) ICAT_VERSION_JOIN_(major, minor, patch)
/// @endcond

/// The version as a string literal, "major.minor.patch".
#define ICAT_VERSION_STRING \
  ICAT_VERSION_JOIN(ICAT_VERSION_MAJOR, ICAT_VERSION_MINOR, ICAT_VERSION_PATCH)
