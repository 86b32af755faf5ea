// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// icat behind plain numbers: what may be built with other flags than the rest of a program, as a
/// shared library of its own.
#pragma once

/// One level of `rows` × `dof` (column by column), all rows active, and the closing one. Returns
/// false if icat refuses. `velocity` has `dof` components.
[[gnu::visibility("default")]] bool solve(int rows, int dof, const double* jacobian,
                                          const double* rate, double* velocity) noexcept;
