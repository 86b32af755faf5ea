// SPDX-License-Identifier: BSD-3-Clause
// All of roscpp in a program of icat; C++17.
//! [boundary]
#include "icat/adapters/ros1_boundary.hpp"
//! [boundary]
