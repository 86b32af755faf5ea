// SPDX-License-Identifier: BSD-3-Clause
// Counts heap allocations of the calling thread, in whatever program it is loaded into
// (LD_PRELOAD). Small objects of Python come from Python's own memory and are not seen.
#include "../../tests/support/allocation_counter.hpp"

extern "C" long peers_allocations() { return allocations; }
