// SPDX-License-Identifier: BSD-3-Clause
/// @file
/// Everything of icat that needs Eigen alone.
#pragma once

#include "icat/core/error.hpp"
#include "icat/core/status.hpp"
#include "icat/core/types.hpp"
#include "icat/math/regularization.hpp"
#include "icat/math/smooth_step.hpp"
#include "icat/tpik/parametric_tpik.hpp"
#include "icat/tpik/tpik.hpp"
#include "icat/version.hpp"
